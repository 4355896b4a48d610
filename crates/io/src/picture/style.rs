//! The look that all pictures share: ink, palettes, sizes.
//!
//! Series take the colours of Okabe and Ito ("Color Universal Design", 2008),
//! which people with any common colour blindness tell apart; scalars take
//! viridis (van der Walt and Smith, 2015), whose lightness grows evenly, so
//! that it survives a black and white printer.

use std::fmt;

/// A colour, red, green and blue from 0 to 255.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Rgb(pub u8, pub u8, pub u8);

impl fmt::Display for Rgb {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "#{:02x}{:02x}{:02x}", self.0, self.1, self.2)
    }
}

impl Rgb {
    /// This colour mixed with a share (0 to 1) of another.
    pub(crate) fn mix(self, other: Self, share: f64) -> Self {
        let channel = |a: u8, b: u8| {
            let mixed = f64::from(a) + share.clamp(0.0, 1.0) * (f64::from(b) - f64::from(a));
            mixed.round() as u8
        };
        Self(
            channel(self.0, other.0),
            channel(self.1, other.1),
            channel(self.2, other.2),
        )
    }
}

pub(crate) const WHITE: Rgb = Rgb(255, 255, 255);
pub(crate) const INK: Rgb = Rgb(34, 34, 34);
pub(crate) const SOFT: Rgb = Rgb(105, 105, 105);
pub(crate) const FAINT: Rgb = Rgb(176, 176, 176);
pub(crate) const GRID: Rgb = Rgb(230, 230, 230);
pub(crate) const STONE: Rgb = Rgb(198, 201, 205);

/// Colours of series, in the order of use.
pub(crate) const SERIES: [Rgb; 7] = [
    Rgb(0, 114, 178),
    Rgb(213, 94, 0),
    Rgb(0, 158, 115),
    Rgb(204, 121, 167),
    Rgb(230, 159, 0),
    Rgb(86, 180, 233),
    Rgb(0, 0, 0),
];

/// Dashes of series, once the colours are used up.
pub(crate) const DASHES: [&str; 4] = ["", "6 2.5", "2 2", "8 2.5 2 2.5"];

/// Size of the text of labels and ticks, in pixels.
pub(crate) const TEXT: f64 = 11.0;
/// Size of the text of ticks and legends.
pub(crate) const SMALL: f64 = 10.0;
/// Size of the text of titles.
pub(crate) const TITLE: f64 = 12.5;

/// The colour of a share (0 to 1) on the viridis scale.
pub(crate) fn viridis(share: f64) -> Rgb {
    const STOPS: [Rgb; 9] = [
        Rgb(68, 1, 84),
        Rgb(71, 45, 123),
        Rgb(59, 82, 139),
        Rgb(44, 114, 142),
        Rgb(33, 145, 140),
        Rgb(40, 174, 128),
        Rgb(94, 201, 98),
        Rgb(173, 220, 48),
        Rgb(253, 231, 37),
    ];
    let place = share.clamp(0.0, 1.0) * (STOPS.len() - 1) as f64;
    let below = (place.floor() as usize).min(STOPS.len() - 2);
    STOPS[below].mix(STOPS[below + 1], place - below as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scalar_scale_grows_lighter_all_along() {
        let lightness = |share: f64| {
            let Rgb(r, g, b) = viridis(share);
            0.2126 * f64::from(r) + 0.7152 * f64::from(g) + 0.0722 * f64::from(b)
        };
        let steps: Vec<f64> = (0..=100).map(|i| lightness(f64::from(i) / 100.0)).collect();
        assert!(steps.windows(2).all(|pair| pair[0] < pair[1] + 0.5));
        assert_eq!(viridis(-1.0), viridis(0.0));
        assert_eq!(viridis(2.0).to_string(), "#fde725");
    }
}
