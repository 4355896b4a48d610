//! Axes: which values are marked, how they are written, and where they stand.

use super::PictureError;
use crate::number::fixed;

/// How values are spread along an axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Scale {
    /// Evenly.
    #[default]
    Linear,
    /// By their logarithm; all values must be positive.
    Logarithmic,
}

/// What an axis shows: label, unit, scale and range.
///
/// # Examples
/// ```
/// use tensegra_io::Axis;
/// let time = Axis::new("planning time").unit("s").logarithmic();
/// assert_eq!(time.title(), "planning time (s)");
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Axis {
    label: String,
    unit: Option<String>,
    pub(crate) scale: Scale,
    range: Option<[f64; 2]>,
}

impl Axis {
    /// A linear axis whose range follows from the data.
    pub fn new(label: impl Into<String>) -> Self {
        Self {
            label: label.into(),
            ..Self::default()
        }
    }

    /// This axis with a unit, which is written in parentheses after the label.
    pub fn unit(mut self, unit: impl Into<String>) -> Self {
        self.unit = Some(unit.into()).filter(|unit| !unit.is_empty());
        self
    }

    /// This axis with a logarithmic scale.
    pub fn logarithmic(mut self) -> Self {
        self.scale = Scale::Logarithmic;
        self
    }

    /// This axis with a fixed range; what lies outside is cut off.
    pub fn range(mut self, from: f64, to: f64) -> Self {
        self.range = Some([from, to]);
        self
    }

    /// Label and unit.
    pub fn title(&self) -> String {
        match &self.unit {
            Some(unit) => format!("{} ({unit})", self.label),
            None => self.label.clone(),
        }
    }

    /// Label, and unit with a power of ten before it.
    fn title_in_powers(&self, power: i32) -> String {
        let factor = match power {
            0 => return self.title(),
            power if power < 0 => format!("10^{{\u{2212}{}}}", -power),
            power => format!("10^{{{power}}}"),
        };
        match &self.unit {
            Some(unit) => format!("{} ({factor} {unit})", self.label),
            None => format!("{} ({factor})", self.label),
        }
    }

    /// Fits the axis to values and lays out about `count` marks.
    ///
    /// # Errors
    /// When a value is not finite, or not positive on a logarithmic axis, or
    /// the range is empty.
    pub(crate) fn fit(
        &self,
        values: impl Iterator<Item = f64>,
        count: usize,
        padding: f64,
    ) -> Result<Fitted, PictureError> {
        let what = || format!("the axis `{}`", self.title());
        let mut extent = [f64::INFINITY, f64::NEG_INFINITY];
        let fixed = self.range.into_iter().flatten();
        for value in values.chain(fixed) {
            if !drawable(value) {
                return Err(PictureError::NotFinite {
                    what: what(),
                    value,
                });
            }
            if self.scale == Scale::Logarithmic && value <= 0.0 {
                return Err(PictureError::NotPositive {
                    what: what(),
                    value,
                });
            }
            extent = [extent[0].min(value), extent[1].max(value)];
        }
        if extent[0] > extent[1] {
            return Err(PictureError::Empty { what: what() });
        }
        let (extent, padding) = match self.range {
            Some([from, to]) => ([from.min(to), from.max(to)], 0.0),
            None => (extent, padding),
        };
        Ok(match self.scale {
            Scale::Linear => self.fit_linear(extent, count, padding),
            Scale::Logarithmic => self.fit_logarithmic(extent, padding),
        })
    }

    fn fit_linear(&self, [mut lo, mut hi]: [f64; 2], count: usize, padding: f64) -> Fitted {
        // A constant gets room on both sides, as does one that only rounding
        // keeps from being constant.
        let size = lo.abs().max(hi.abs());
        if hi - lo <= 1e-9 * size || hi == lo {
            let room = if size > 0.0 { 0.05 * size } else { 1.0 };
            (lo, hi) = (lo - room, hi + room);
        } else {
            let room = padding * (hi - lo);
            (lo, hi) = (lo - room, hi + room);
        }
        let step = nice_step((hi - lo) / count.max(1) as f64);
        let power = shown_power(lo.abs().max(hi.abs()));
        let unit = 10_f64.powi(power);
        let decimals = (power - step.log10().floor() as i32).max(0) as usize;
        let first = (lo / step - 1e-9).ceil() as i64;
        let last = (hi / step + 1e-9).floor() as i64;
        let marks = (first..=last)
            .map(|index| {
                let value = index as f64 * step;
                Mark {
                    value,
                    label: fixed(value / unit, decimals),
                }
            })
            .collect();
        Fitted {
            title: self.title_in_powers(power),
            scale: self.scale,
            lo,
            hi,
            marks,
            minor: Vec::new(),
        }
    }

    fn fit_logarithmic(&self, [lo, hi]: [f64; 2], padding: f64) -> Fitted {
        let (mut from, mut to) = (lo.log10(), hi.log10());
        let room = (padding * (to - from)).max(0.02);
        if self.range.is_none() {
            (from, to) = (from - room, to + room);
        }
        let (lo, hi) = (10_f64.powf(from), 10_f64.powf(to));
        let decades = (from.floor() as i32)..=(to.ceil() as i32);
        let inside = |value: &f64| (lo..=hi).contains(value);
        let multiples = |factors: &'static [f64]| {
            let decades = decades.clone();
            decades.flat_map(move |decade| {
                let unit = 10_f64.powi(decade);
                factors.iter().map(move |factor| (factor * unit, decade))
            })
        };
        let whole = multiples(&[1.0]).filter(|(value, _)| inside(value)).count();
        // Few powers of ten in the range: mark their multiples too.
        let factors: &[f64] = match whole {
            0 | 1 if to - from < 0.5 => &[1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0],
            0..=2 => &[1.0, 2.0, 5.0],
            _ => &[1.0],
        };
        let every = (whole / 8 + 1) as i32;
        let marked: Vec<(f64, i32)> = multiples(factors)
            .filter(|(value, decade)| inside(value) && (factors.len() > 1 || decade % every == 0))
            .collect();
        let plain = marked.iter().all(|(_, decade)| (-3..4).contains(decade));
        let marks = marked
            .into_iter()
            .map(|(value, decade)| Mark {
                value,
                label: match plain {
                    true => crate::number::significant(value, 2),
                    false => in_powers(value, decade),
                },
            })
            .collect();
        let minor = multiples(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0])
            .map(|(value, _)| value)
            .filter(inside)
            .collect();
        Fitted {
            title: self.title(),
            scale: self.scale,
            lo,
            hi,
            marks,
            minor,
        }
    }
}

/// Whether differences and squares of such numbers are finite.
pub(crate) fn drawable(value: f64) -> bool {
    value.abs() < 1e100
}

fn in_powers(value: f64, decade: i32) -> String {
    let sign = if decade < 0 { "\u{2212}" } else { "" };
    let power = format!("10^{{{sign}{}}}", decade.abs());
    let factor = value / 10_f64.powi(decade);
    match (factor - 1.0).abs() < 1e-9 {
        true => power,
        false => format!("{}×{power}", crate::number::significant(factor, 2)),
    }
}

/// The number nearest to `step`, by ratio, that is 1, 2 or 5 times a power of ten.
fn nice_step(step: f64) -> f64 {
    let unit = 10_f64.powf(step.log10().floor());
    let ratio = step / unit;
    let factor = [
        (2.0_f64.sqrt(), 1.0),
        (10.0_f64.sqrt(), 2.0),
        (50.0_f64.sqrt(), 5.0),
    ]
    .into_iter()
    .find(|(bound, _)| ratio < *bound)
    .map_or(10.0, |(_, factor)| factor);
    factor * unit
}

/// The power of ten, a multiple of three, in which values up to `size` are
/// written; 0 where they read well as they are.
fn shown_power(size: f64) -> i32 {
    match size.log10().floor() as i32 {
        -2..=4 => 0,
        magnitude => magnitude.div_euclid(3) * 3,
    }
}

/// A marked value.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Mark {
    pub(crate) value: f64,
    pub(crate) label: String,
}

/// An axis with its range and marks.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Fitted {
    pub(crate) title: String,
    scale: Scale,
    pub(crate) lo: f64,
    pub(crate) hi: f64,
    pub(crate) marks: Vec<Mark>,
    /// Further values that are marked without a label.
    pub(crate) minor: Vec<f64>,
}

impl Fitted {
    /// Where a value stands: 0 at the lower end, 1 at the upper.
    pub(crate) fn place(&self, value: f64) -> f64 {
        match self.scale {
            Scale::Linear => (value - self.lo) / (self.hi - self.lo),
            Scale::Logarithmic => (value / self.lo).ln() / (self.hi / self.lo).ln(),
        }
    }

    /// Whether a value lies in the range.
    pub(crate) fn holds(&self, value: f64) -> bool {
        (self.lo..=self.hi).contains(&value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(fitted: &Fitted) -> Vec<&str> {
        fitted.marks.iter().map(|m| m.label.as_str()).collect()
    }

    #[test]
    fn linear_marks_are_round() {
        let fitted = Axis::new("x")
            .fit([-0.13, 0.9].into_iter(), 5, 0.0)
            .unwrap();
        assert_eq!(labels(&fitted), ["0.0", "0.2", "0.4", "0.6", "0.8"]);
        assert!((fitted.place(-0.13)).abs() < 1e-12 && (fitted.place(0.9) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn large_and_small_values_take_a_power_of_ten() {
        let axis = Axis::new("time").unit("s");
        let fitted = axis.fit([0.0, 0.0045].into_iter(), 5, 0.0).unwrap();
        assert_eq!(fitted.title, "time (10^{\u{2212}3} s)");
        assert_eq!(labels(&fitted), ["0", "1", "2", "3", "4"]);
        let fitted = axis.fit([0.0, 2.4e6].into_iter(), 3, 0.0).unwrap();
        assert_eq!(fitted.title, "time (10^{6} s)");
        assert_eq!(labels(&fitted), ["0", "1", "2"]);
    }

    #[test]
    fn a_constant_stands_in_the_middle() {
        for value in [0.0, -3.0, 1e-7] {
            let fitted = Axis::new("x").fit([value; 3].into_iter(), 5, 0.1).unwrap();
            assert!((fitted.place(value) - 0.5).abs() < 1e-9);
            assert!(!fitted.marks.is_empty());
        }
    }

    #[test]
    fn logarithmic_marks() {
        let axis = Axis::new("x").logarithmic();
        let fitted = axis.fit([2e-5, 30.0].into_iter(), 5, 0.0).unwrap();
        let powers = ["\u{2212}4", "\u{2212}3", "\u{2212}2", "\u{2212}1", "0", "1"];
        assert_eq!(
            labels(&fitted),
            powers.map(|power| format!("10^{{{power}}}"))
        );
        let fitted = axis.fit([0.02, 30.0].into_iter(), 5, 0.0).unwrap();
        assert_eq!(labels(&fitted), ["0.1", "1", "10"]);
        let fitted = axis.fit([12.0, 130.0].into_iter(), 5, 0.0).unwrap();
        assert_eq!(labels(&fitted), ["20", "50", "100"]);
        assert!(matches!(
            axis.fit([0.0, 1.0].into_iter(), 5, 0.0),
            Err(PictureError::NotPositive { .. })
        ));
    }

    #[test]
    fn nothing_and_no_number_are_refused() {
        let axis = Axis::new("x");
        let empty = axis.fit(std::iter::empty(), 5, 0.0);
        assert!(matches!(empty, Err(PictureError::Empty { .. })));
        let nan = axis.fit([f64::NAN].into_iter(), 5, 0.0);
        assert!(matches!(nan, Err(PictureError::NotFinite { .. })));
    }
}
