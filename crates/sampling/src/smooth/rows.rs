//! The inequalities near a path: bounds and limits at its points, contacts at
//! its points and between them.

use tensegra_atlas::{Chart, Contacts, ImplicitManifold, SparseRow, Validity, Workspace};

use super::chain::Chain;
use crate::walk::interpolate;

/// Residual of points between those of the path.
const TOLERANCE: f64 = 1e-7;
/// What a value falls short of its margin counts little up to this part of it.
const SOFT: f64 = 0.8;
/// Steps rarely are longer than these multiples of the trust radius: with few
/// tangent coordinates, where a row too many costs little, and with many.
const LONG: [f64; 2] = [2.0, 0.5];
/// The most tangent coordinates that are few.
const FEW: usize = 4;

/// value ≥ margin, at a fraction of a segment.
#[derive(Clone, Copy, Debug)]
struct Head {
    segment: usize,
    fraction: f64,
    value: f64,
    margin: f64,
    start: usize,
}

/// What multiple of the trust radius steps rarely are longer than.
pub(super) fn long_step(dimension: usize) -> f64 {
    LONG[usize::from(dimension > FEW)]
}

/// An inequality in tangent coordinates.
pub(super) struct TangentRow<'a> {
    /// First block concerned.
    pub(super) block: usize,
    /// Of one block or of two.
    pub(super) coefficients: &'a [f64],
    /// Value less margin.
    pub(super) above: f64,
}

/// Inequalities with their gradients in the manifold's coordinates.
#[derive(Clone, Debug, Default)]
pub(super) struct Rows {
    heads: Vec<Head>,
    gradients: Vec<(usize, f64)>,
}

impl Rows {
    fn push(&mut self, head: Head, gradient: &[(usize, f64)]) {
        self.heads.push(Head {
            start: self.gradients.len(),
            ..head
        });
        self.gradients.extend_from_slice(gradient);
    }

    /// Number of rows.
    pub(super) fn len(&self) -> usize {
        self.heads.len()
    }

    /// Σ of what the values fall short of their margins.
    pub(super) fn shortfall(&self) -> f64 {
        self.heads
            .iter()
            .map(|head| (head.margin - head.value).max(0.0))
            .sum()
    }

    /// Σ of what the values fall short of their margins, counted little as long as
    /// it is a small part of the margin: rows that bend would else stop all but the
    /// shortest steps along them (the Maratos effect).
    pub(super) fn penalty(&self) -> f64 {
        self.heads
            .iter()
            .map(|head| {
                let (short, soft) = ((head.margin - head.value).max(0.0), SOFT * head.margin);
                if short < soft {
                    0.5 * short * short / soft
                } else {
                    short - 0.5 * soft
                }
            })
            .sum()
    }

    /// Largest violation, margins left aside.
    pub(super) fn violation(&self) -> f64 {
        self.heads
            .iter()
            .fold(0.0, |most: f64, head| most.max(-head.value))
    }

    /// Calls `each` with the rows that a step in the box |t| ≤ `radius`, and not
    /// longer than is usual, can violate.
    pub(super) fn for_each_tangent(
        &self,
        chain: &Chain,
        radius: f64,
        mut each: impl FnMut(usize, TangentRow<'_>),
    ) {
        self.for_each(chain, |index, row| {
            let most: f64 = row.coefficients.iter().map(|a| a.abs()).sum();
            let long = long_step(chain.dimension)
                * row.coefficients.iter().map(|a| a * a).sum::<f64>().sqrt();
            if row.above <= radius * most.min(long) {
                each(index, row);
            }
        });
    }

    /// Calls `each` with every row that falls short of its margin.
    pub(super) fn for_each_short(&self, chain: &Chain, mut each: impl FnMut(TangentRow<'_>)) {
        self.for_each(chain, |_, row| {
            if row.above < 0.0 {
                each(row);
            }
        });
    }

    /// Adds a multiple of a row's gradient to the values of the inner points that
    /// it touches, m for each.
    pub(super) fn add_gradient(&self, row: usize, factor: f64, forces: &mut [f64], m: usize) {
        let head = self.heads[row];
        let end = self
            .heads
            .get(row + 1)
            .map_or(self.gradients.len(), |h| h.start);
        let inner = forces.len() / m;
        for (point, share) in [
            (head.segment, 1.0 - head.fraction),
            (head.segment + 1, head.fraction),
        ] {
            if share > 0.0 && (1..=inner).contains(&point) {
                for &(variable, g) in &self.gradients[head.start..end] {
                    forces[(point - 1) * m + variable] += factor * share * g;
                }
            }
        }
    }

    /// Calls `each` with every row.
    pub(super) fn for_each(&self, chain: &Chain, mut each: impl FnMut(usize, TangentRow<'_>)) {
        let k = chain.dimension;
        let mut coefficients = vec![0.0; 2 * k];
        let ends = self.heads.iter().skip(1).map(|head| head.start);
        let ends = ends.chain([self.gradients.len()]);
        for (index, (head, end)) in self.heads.iter().zip(ends).enumerate() {
            let gradient = &self.gradients[head.start..end];
            coefficients.fill(0.0);
            let (first, second) = coefficients.split_at_mut(k);
            let before =
                (head.fraction < 1.0 && head.segment > 0).then(|| &chain.charts[head.segment - 1]);
            let after = (head.fraction > 0.0).then(|| chain.charts.get(head.segment));
            let pull = |chart: &Chart, share: f64, into: &mut [f64]| {
                for &(variable, g) in gradient {
                    for (a, v) in into.iter_mut().zip(chart.variable(variable)) {
                        *a += share * g * v;
                    }
                }
            };
            if let Some(chart) = before {
                pull(chart, 1.0 - head.fraction, first);
            }
            if let Some(Some(chart)) = after {
                pull(chart, head.fraction, second);
            }
            let (block, range) = match (before, after.flatten()) {
                (Some(_), Some(_)) => (head.segment - 1, 0..2 * k),
                (Some(_), None) => (head.segment - 1, 0..k),
                (None, Some(_)) => (head.segment, k..2 * k),
                (None, None) => continue,
            };
            let row = TangentRow {
                block,
                coefficients: &coefficients[range],
                above: head.value - head.margin,
            };
            each(index, row);
        }
    }
}

/// Finds inequalities, with the memory for it.
pub(super) struct Finder<'a, M: ?Sized, V: Validity> {
    manifold: &'a M,
    validity: &'a V,
    contact_margin: f64,
    limit_margin: f64,
    /// Contacts of start and goal that are closer than the margin, with half
    /// their values there.
    admitted: Vec<(usize, f64)>,
    memory: V::Memory,
    contacts: Contacts,
    limits: Vec<f64>,
    row: SparseRow,
    between: Vec<f64>,
    work: Workspace,
}

impl<'a, M: ImplicitManifold + ?Sized, V: Validity> Finder<'a, M, V> {
    pub(super) fn new(
        manifold: &'a M,
        validity: &'a V,
        contact_margin: f64,
        limit_margin: f64,
        ends: [&[f64]; 2],
    ) -> Self {
        let mut finder = Self {
            manifold,
            validity,
            contact_margin,
            limit_margin,
            admitted: Vec::new(),
            memory: validity.memory(),
            contacts: Contacts::default(),
            limits: vec![0.0; manifold.limit_count()],
            row: SparseRow::default(),
            between: vec![0.0; manifold.ambient_dimension()],
            work: Workspace::default(),
        };
        // Wide enough for margins widened later.
        let reach = 40.0 * contact_margin;
        for x in ends {
            finder.contacts.clear();
            validity.contacts(x, &mut finder.memory, reach, &mut finder.contacts);
            for row in finder.contacts.iter() {
                finder
                    .admitted
                    .push((row.contact, 0.5 * row.value.max(0.0)));
            }
        }
        finder
    }

    pub(super) fn widen_margin(&mut self) {
        self.contact_margin *= 2.0;
    }

    /// Replaces `rows` by all inequalities whose values are within `reach` of
    /// their margins, of the chain with these points in place of its own.
    pub(super) fn find(&mut self, chain: &Chain, points: &[Vec<f64>], reach: f64, rows: &mut Rows) {
        rows.heads.clear();
        rows.gradients.clear();
        let segments = points.len() - 1;
        for segment in 0..segments {
            if segment > 0 {
                self.limits_at(&points[segment], segment, reach, rows);
                let margin = chain.margins[segment].max(chain.margins[segment - 1]);
                self.contacts_at(&points[segment], segment, [0.0, margin], reach, rows);
            }
            let count = chain.fractions[segment];
            let chart = chain.chart_of_segment(segment);
            for i in 1..=count {
                let fraction = i as f64 / (count + 1) as f64;
                let mut y = std::mem::take(&mut self.between);
                interpolate(&points[segment], &points[segment + 1], fraction, &mut y);
                if chart
                    .retract(self.manifold, &mut y, TOLERANCE, &mut self.work)
                    .is_ok()
                {
                    let margin = chain.margins[segment];
                    self.contacts_at(&y, segment, [fraction, margin], reach, rows);
                }
                self.between = y;
            }
        }
    }

    fn limits_at(&mut self, x: &[f64], segment: usize, reach: f64, rows: &mut Rows) {
        let manifold = self.manifold;
        let margin = self.limit_margin;
        let mut push = |value: f64, gradient: &[(usize, f64)]| {
            let head = Head {
                segment,
                fraction: 0.0,
                value,
                margin,
                start: 0,
            };
            rows.push(head, gradient);
        };
        let bounds = manifold.lower_bounds().iter().zip(manifold.upper_bounds());
        for (i, (&x, (&lo, &hi))) in x.iter().zip(bounds).enumerate() {
            if x - lo < reach {
                push(x - lo, &[(i, 1.0)]);
            }
            if hi - x < reach {
                push(hi - x, &[(i, -1.0)]);
            }
        }
        manifold.limits(x, &mut self.limits);
        for (i, &value) in self.limits.iter().enumerate() {
            if value < reach {
                self.row.clear();
                manifold.limit_gradient(i, x, &mut self.row);
                push(value, self.row.entries());
            }
        }
    }

    /// Contacts at a fraction of a segment, with a multiple of the margin.
    fn contacts_at(
        &mut self,
        x: &[f64],
        segment: usize,
        [fraction, multiple]: [f64; 2],
        reach: f64,
        rows: &mut Rows,
    ) {
        let widest = multiple * self.contact_margin;
        self.contacts.clear();
        self.validity
            .contacts(x, &mut self.memory, reach + widest, &mut self.contacts);
        for row in self.contacts.iter() {
            let margin = self
                .admitted
                .iter()
                .filter(|(contact, _)| *contact == row.contact)
                .fold(widest, |margin, &(_, admitted)| margin.min(admitted));
            let head = Head {
                segment,
                fraction,
                value: row.value,
                margin,
                start: 0,
            };
            rows.push(head, row.gradient);
        }
    }
}
