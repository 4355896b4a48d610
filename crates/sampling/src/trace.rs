//! Tracing: some quantities are moved, the manifold is followed
//! (Porta and Hernández-Juan 2016, section 4.1).
//!
//! A manifold of dimension k leaves k − c freedoms when c quantities are moved.
//! They are taken by a rule: at every moment the held quantities h change as
//! little as possible, in the sense of least squares, and what freedom is left
//! even then goes to the shortest motion:
//!
//! ẋ = arg min |ẋ|² among arg min |ḣ|² such that Ḟ = 0, ġ = v̇.
//!
//! With as many motors as freedoms the held quantities stay exactly where they
//! are; where that becomes impossible there is a fold, and the tracer stops. The
//! rule knows no past, so that the same way leads back; a tracer also remembers
//! where it went, and returns to the very points.
//!
//! Steps follow the trapezoidal rule: half of a step is the rule at its
//! beginning, half the rule at its end, which Gauss–Newton iterations find, each
//! with a chart at the point reached. Cost of an iteration: one pivoted QR, one
//! projection, and the eigenvalues of two k × k matrices.

use nalgebra::{DMatrix, DVector};
use tensegra_atlas::{
    Chart, ImplicitManifold, ManifoldError, Obstruction, SparseRow, Validity, Workspace, dimension,
    on_manifold,
};

/// Quantities of the points of a manifold that can be moved or held.
pub trait Quantities: Sync {
    /// Number of quantities.
    fn count(&self) -> usize;

    /// Value of a quantity at x.
    fn value(&self, quantity: usize, x: &[f64]) -> f64;

    /// Adds the gradient of a quantity at x to `row`.
    fn gradient(&self, quantity: usize, x: &[f64], row: &mut SparseRow);

    /// Whether `held` must give way when `moved` moves, for instance because it
    /// is tied to it.
    fn yields(&self, held: usize, moved: usize) -> bool {
        held == moved
    }
}

/// Parameters of a [`Tracer`]; distances are in the manifold's coordinates.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct TraceOptions {
    /// Longest step δ.
    pub step: f64,
    /// Largest displacement (see [`Validity::displacement`]) of a step.
    pub displacement: f64,
    /// Residual of the points returned.
    pub tolerance: f64,
    /// Distance from a limit or contact, in its own scale, at which it counts
    /// as met.
    pub met: f64,
}

impl Default for TraceOptions {
    fn default() -> Self {
        Self {
            step: 0.05,
            displacement: f64::INFINITY,
            tolerance: 1e-12,
            met: 1e-6,
        }
    }
}

/// An inequality of the manifold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Limit {
    /// The lower bound of a variable.
    Lower(usize),
    /// The upper bound of a variable.
    Upper(usize),
    /// A limit g(x) ≥ 0.
    Derived(usize),
}

/// What a step came to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Advance {
    /// The moved quantities came nearer to their targets.
    Moved,
    /// They have reached them.
    Arrived,
    /// There is no way on.
    Stopped(Stop),
}

/// Why there is no way on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Stop {
    /// A limit is met.
    Limit(Limit),
    /// A contact of the validity test is met.
    Contact(usize),
    /// The validity test refuses to go on and names no contact.
    Blocked,
    /// The moved quantities are at an extremum, or the held ones cannot be held
    /// any longer.
    Fold,
    /// The manifold is singular.
    Singular,
}

/// Follows a manifold, one step at a time.
///
/// # Examples
/// ```
/// use tensegra_atlas::{Everywhere, SparseRow, doc::Sphere};
/// use tensegra_sampling::{Advance, Quantities, TraceOptions, Tracer};
///
/// /// The three coordinates of a point.
/// struct Coordinates;
///
/// impl Quantities for Coordinates {
///     fn count(&self) -> usize {
///         3
///     }
///     fn value(&self, i: usize, x: &[f64]) -> f64 {
///         x[i]
///     }
///     fn gradient(&self, i: usize, _: &[f64], row: &mut SparseRow) {
///         row.add(i, 1.0);
///     }
/// }
///
/// // Raise x while z is held: along a circle of latitude.
/// let (sphere, options) = (Sphere::new(), TraceOptions::default());
/// let start = [0.0, 0.8, 0.6];
/// let mut tracer = Tracer::new(&sphere, &Everywhere, &Coordinates, &[2], options, &start)?;
/// while tracer.step(&[(0, 0.48)]) == Advance::Moved {}
/// let x = tracer.point();
/// assert!((x[0] - 0.48).abs() < 1e-9 && (x[1] - 0.64).abs() < 1e-9);
/// # Ok::<(), tensegra_atlas::ManifoldError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Tracer<'a, M: ?Sized, V: Validity, Q> {
    manifold: &'a M,
    validity: &'a V,
    quantities: &'a Q,
    options: TraceOptions,
    dimension: usize,
    /// All quantities that motors hold.
    motors: Vec<usize>,
    moved: Vec<usize>,
    held: Vec<usize>,
    /// What the held quantities were when the motion began.
    set_points: Vec<f64>,
    /// Whether the held quantities can all stay exactly where they are.
    exact: bool,
    /// Whether moved and held quantities leave no freedom.
    determined: bool,
    /// The steps taken: what was moved, and from where.
    trail: Vec<(Vec<usize>, Vec<f64>)>,
    x: Vec<f64>,
    next: Vec<f64>,
    memory: V::Memory,
    next_memory: V::Memory,
    work: Workspace,
}

/// Moved quantities have arrived when they are this near to their targets.
const ARRIVED: f64 = 1e-10;
/// A correction whose steps no longer shrink below this has converged.
const CONVERGED: f64 = 1e-11;
/// A correction that stalls has converged if its steps are below this.
const STALLED: f64 = 1e-8;
const MAX_ITERATIONS: usize = 60;
/// Singular values below this fraction of the largest count as zero.
const RANK: f64 = 1e-6;
/// Held quantities that could be held move by less than this.
const HELD: f64 = 1e-7;
/// A corrected step must not differ from its prediction by more than this
/// fraction: it would be on another branch.
const DEVIATION: f64 = 0.5;
/// Shortest step, relative to δ.
const SHORTEST: f64 = 1e-6;

impl<'a, M: ImplicitManifold + ?Sized, V: Validity, Q: Quantities> Tracer<'a, M, V, Q> {
    /// A tracer at the valid point `start` of the manifold. The quantities
    /// `motors` are held, but for those that are moved.
    ///
    /// # Errors
    /// [`ManifoldError`] where the start is not on the manifold or that is singular there.
    pub fn new(
        manifold: &'a M,
        validity: &'a V,
        quantities: &'a Q,
        motors: &[usize],
        options: TraceOptions,
        start: &[f64],
    ) -> Result<Self, ManifoldError> {
        let mut work = Workspace::default();
        on_manifold(manifold, start)?;
        let dimension = dimension(manifold, start);
        Chart::new(manifold, start, dimension, &mut work)?;
        let mut memory = validity.memory();
        validity.enter(start, &mut memory);
        Ok(Self {
            manifold,
            validity,
            quantities,
            options,
            dimension,
            motors: motors.to_vec(),
            moved: Vec::new(),
            held: Vec::new(),
            set_points: Vec::new(),
            exact: false,
            determined: false,
            trail: Vec::new(),
            x: start.to_vec(),
            next: start.to_vec(),
            next_memory: validity.memory(),
            memory,
            work,
        })
    }

    /// The point reached.
    pub fn point(&self) -> &[f64] {
        &self.x
    }

    /// Dimension k of the manifold.
    pub fn dimension(&self) -> usize {
        self.dimension
    }

    /// The points from the start to the one reached, those left again by going
    /// back excepted.
    pub fn trail(&self) -> impl Iterator<Item = &[f64]> {
        let before = self.trail.iter().map(|(_, x)| x.as_slice());
        before.chain([self.x.as_slice()])
    }

    /// How far the held quantity that gave way the most is from where it was
    /// when the motion began, and which it is.
    pub fn worst_held(&self) -> Option<(usize, f64)> {
        let deviation = |(&q, set_point): (&usize, &f64)| {
            (q, (self.quantities.value(q, &self.x) - set_point).abs())
        };
        let deviations = self.held.iter().zip(self.set_points.iter()).map(deviation);
        deviations.max_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// Moves quantities towards their targets, in proportion, by one step; a
    /// step back along the way that the tracer came returns to where it was.
    ///
    /// After [`Advance::Stopped`] the point is as far as it can go, and steps
    /// towards other targets may follow.
    pub fn step(&mut self, targets: &[(usize, f64)]) -> Advance {
        self.begin(targets);
        let here = self.values(&self.x);
        let left: Vec<f64> = targets.iter().zip(&here).map(|(t, v)| t.1 - v).collect();
        let scale = targets.iter().fold(1.0, |s: f64, t| s.max(t.1.abs()));
        if left.iter().all(|l| l.abs() <= ARRIVED * scale) {
            return Advance::Arrived;
        }
        let back = self.share_to_trail(&here, &left);
        if let Some(share) = back.filter(|share| *share <= 1.0 + 1e-9)
            && let Some((_, x)) = self.trail.pop()
        {
            self.x = x;
            self.validity.enter(&self.x, &mut self.memory);
            return if share >= 1.0 - 1e-9 {
                Advance::Arrived
            } else {
                Advance::Moved
            };
        }
        let chart = match Chart::new(self.manifold, &self.x, self.dimension, &mut self.work) {
            Ok(chart) => chart,
            Err(_) => return Advance::Stopped(Stop::Singular),
        };
        let held = self.local_set_points();
        let direction = match (back, self.trail.last()) {
            // The target lies between this point and the one before.
            (Some(share), Some((_, x))) => {
                let mut t = vec![0.0; self.dimension];
                chart.log(x, &mut t);
                Some(DVector::from_vec(t) / share)
            }
            _ => self.direction(&chart, &self.x, &left, &held, &self.x),
        };
        let Some(direction) = direction else {
            return Advance::Stopped(Stop::Fold);
        };
        let length = direction.norm();
        // A fraction of what is left: at most a step.
        let mut share = (self.options.step / length).min(1.0);
        let mut stop = Stop::Fold;
        while share * length > SHORTEST * self.options.step {
            let targets: Vec<f64> = here.iter().zip(&left).map(|(v, l)| v + share * l).collect();
            let predicted = &direction * share;
            match self.try_step(&chart, &predicted, &targets, &held) {
                Ok(()) => {
                    let before = std::mem::replace(&mut self.x, self.next.clone());
                    std::mem::swap(&mut self.memory, &mut self.next_memory);
                    if back.is_none() {
                        self.trail.push((self.moved.clone(), before));
                    }
                    return if share == 1.0 {
                        Advance::Arrived
                    } else {
                        Advance::Moved
                    };
                }
                Err(refusal) => {
                    stop = refusal.stop;
                    match refusal.factor {
                        Some(factor) => share *= factor,
                        None => break,
                    }
                }
            }
        }
        Advance::Stopped(stop)
    }

    /// Where the last point of the trail lies on the way to the targets, as a
    /// multiple of that way; `None` where it does not.
    fn share_to_trail(&self, here: &[f64], left: &[f64]) -> Option<f64> {
        let (moved, x) = self.trail.last()?;
        if *moved != self.moved {
            return None;
        }
        let before = DVector::from_vec(self.values(x)) - DVector::from_column_slice(here);
        let left = DVector::from_column_slice(left);
        let share = before.dot(&left) / left.norm_squared();
        let aside = (before - &left * share).norm();
        (share > 0.0 && aside <= 1e-8 * share * left.norm()).then_some(share)
    }

    /// Decides what is held when other quantities are moved than before.
    fn begin(&mut self, targets: &[(usize, f64)]) {
        let quantities = targets.iter().map(|target| target.0);
        if self.moved.iter().copied().eq(quantities.clone()) {
            return;
        }
        self.moved = quantities.collect();
        self.held = self.motors.clone();
        let (moved, all) = (&self.moved, self.quantities);
        self.held
            .retain(|&held| !moved.iter().any(|&moved| all.yields(held, moved)));
        let values = self.held.iter().map(|&q| all.value(q, &self.x));
        self.set_points = values.collect();
        (self.exact, self.determined) = (false, false);
        if let Ok(chart) = Chart::new(self.manifold, &self.x, self.dimension, &mut self.work) {
            let moved = self.gradients(&chart, &self.x, &self.moved);
            let (_, free) = split(&moved);
            let held = self.gradients(&chart, &self.x, &self.held) * &free;
            let rank = rank(&held);
            self.exact = rank == self.held.len();
            self.determined = rank == free.ncols();
        }
    }

    /// What the held quantities should be after the next step.
    fn local_set_points(&self) -> DVector<f64> {
        let here = self.held.iter().map(|&q| self.quantities.value(q, &self.x));
        if self.exact {
            DVector::from_column_slice(&self.set_points)
        } else {
            DVector::from_iterator(self.held.len(), here)
        }
    }

    /// Values of the moved quantities.
    fn values(&self, x: &[f64]) -> Vec<f64> {
        let value = |&q: &usize| self.quantities.value(q, x);
        self.moved.iter().map(value).collect()
    }

    /// Gradients in tangent coordinates, one quantity a row.
    fn gradients(&self, chart: &Chart, x: &[f64], quantities: &[usize]) -> DMatrix<f64> {
        let mut matrix = DMatrix::zeros(quantities.len(), self.dimension);
        let mut row = SparseRow::default();
        for (i, &quantity) in quantities.iter().enumerate() {
            row.clear();
            self.quantities.gradient(quantity, x, &mut row);
            for &(variable, g) in row.entries() {
                for (j, v) in chart.variable(variable).enumerate() {
                    matrix[(i, j)] += g * v;
                }
            }
        }
        matrix
    }

    /// The tangent step at x that moves the moved quantities by `change`, brings
    /// the held ones nearest to `set_points` (nothing is held where there are
    /// none), and else comes nearest to `reference`. `None` where the moved
    /// quantities cannot move.
    fn direction(
        &self,
        chart: &Chart,
        x: &[f64],
        change: &[f64],
        set_points: &DVector<f64>,
        reference: &[f64],
    ) -> Option<DVector<f64>> {
        let moved = self.gradients(chart, x, &self.moved);
        let (inverse, free) = split(&moved);
        let change = DVector::from_column_slice(change);
        let mut step = inverse * &change;
        if (&moved * &step - &change).norm() > 1e-6 * change.norm() {
            return None;
        }
        let held = &self.held[..set_points.len()];
        let values = held.iter().map(|&q| self.quantities.value(q, x));
        let values = DVector::from_iterator(held.len(), values);
        let held = self.gradients(chart, x, held);
        let errors = set_points - values - &held * &step;
        let (inverse, freer) = split(&(held * &free));
        step += &free * (inverse * errors);
        let rest = &free * freer;
        let back = DVector::from_iterator(
            self.dimension,
            (0..self.dimension).map(|j| {
                let tangent = chart.tangent(j).iter().zip(reference).zip(x);
                tangent.map(|((v, r), x)| v * (r - x)).sum::<f64>()
            }),
        ) - &step;
        step += &rest * (rest.transpose() * back);
        Some(step)
    }

    /// Tries a step from x to the given targets, about `predicted`, into `next`.
    fn try_step(
        &mut self,
        chart: &Chart,
        predicted: &DVector<f64>,
        targets: &[f64],
        held: &DVector<f64>,
    ) -> Result<(), Refusal> {
        let shorter = |stop| Refusal {
            factor: Some(0.5),
            stop,
        };
        let (tolerance, manifold) = (self.options.tolerance, self.manifold);
        let mut next = self.x.clone();
        let t = predicted.as_slice();
        chart
            .exp(manifold, t, &mut next, tolerance, &mut self.work)
            .map_err(|_| shorter(Stop::Fold))?;
        let (explicit, longest) = (next.clone(), predicted.norm());
        let here = self.x.clone();
        self.correct(&mut next, targets, held, &here, longest)
            .map_err(shorter)?;
        if !self.determined {
            // Half the rule at the beginning of the step, half that at its end.
            let middle = explicit.iter().zip(&next).map(|(a, b)| 0.5 * (a + b));
            let middle: Vec<f64> = middle.collect();
            let none = DVector::zeros(0);
            let held = if self.exact { held } else { &none };
            self.correct(&mut next, targets, held, &middle, longest)
                .map_err(shorter)?;
        }
        self.next = next;
        let mut t = vec![0.0; self.dimension];
        chart.log(&self.next, &mut t);
        let off = DVector::from_column_slice(&t) - predicted;
        let size = predicted.norm().min(self.options.step);
        if off.norm() > DEVIATION * size {
            return Err(shorter(Stop::Fold));
        }
        self.respect_limits()?;
        if self.validity.displacement(&self.x, &self.next) > self.options.displacement {
            return Err(shorter(Stop::Fold));
        }
        self.respect_contacts(chart)
    }

    /// Gauss–Newton iterations from `x` to the point of the manifold where the
    /// moved quantities are at their targets, the held ones nearest to
    /// `set_points`, and that is else nearest to `reference`.
    fn correct(
        &mut self,
        x: &mut [f64],
        targets: &[f64],
        set_points: &DVector<f64>,
        reference: &[f64],
        longest: f64,
    ) -> Result<(), Stop> {
        let mut previous = f64::INFINITY;
        for _ in 0..MAX_ITERATIONS {
            let chart = Chart::new(self.manifold, x, self.dimension, &mut self.work)
                .map_err(|_| Stop::Singular)?;
            let values = self.values(x);
            let change: Vec<f64> = targets.iter().zip(&values).map(|(t, v)| t - v).collect();
            let mut t = self
                .direction(&chart, x, &change, set_points, reference)
                .ok_or(Stop::Fold)?;
            let length = t.norm();
            if length <= CONVERGED || (length <= STALLED && length > 0.5 * previous) {
                return self.confirm(x);
            }
            if length.is_nan() || length > 1e3 * longest {
                return Err(Stop::Fold);
            }
            if length > longest {
                t *= longest / length;
            }
            previous = length;
            let (manifold, tolerance) = (self.manifold, self.options.tolerance);
            chart
                .exp(manifold, t.as_slice(), x, tolerance, &mut self.work)
                .map_err(|_| Stop::Fold)?;
        }
        Err(Stop::Fold)
    }

    /// Whether what can be held is held.
    fn confirm(&self, x: &[f64]) -> Result<(), Stop> {
        let mut held = self.held.iter().zip(&self.set_points);
        let lost = |(&q, set_point): (&usize, &f64)| {
            (self.quantities.value(q, x) - set_point).abs() > HELD * set_point.abs().max(1.0)
        };
        if self.exact && held.any(lost) {
            return Err(Stop::Fold);
        }
        Ok(())
    }

    /// Refuses a step that leaves a limit, with the share of it that does not.
    fn respect_limits(&self) -> Result<(), Refusal> {
        let manifold = self.manifold;
        let mut values = [vec![], vec![]];
        for (values, x) in values.iter_mut().zip([&self.x, &self.next]) {
            values.resize(manifold.limit_count(), 0.0);
            manifold.limits(x, values);
        }
        let [before, after] = &values;
        let derived = before
            .iter()
            .zip(after)
            .enumerate()
            .map(|(i, (&a, &b))| (Limit::Derived(i), a, b));
        let points = self.x.iter().zip(&self.next).enumerate();
        let lower = points
            .clone()
            .zip(manifold.lower_bounds())
            .map(|((i, (a, b)), lo)| (Limit::Lower(i), a - lo, b - lo));
        let upper = points
            .zip(manifold.upper_bounds())
            .map(|((i, (a, b)), hi)| (Limit::Upper(i), hi - a, hi - b));
        let first = derived
            .chain(lower)
            .chain(upper)
            .filter(|&(_, _, after)| after < 0.0)
            .map(|(limit, before, after)| (limit, before, before / (before - after)))
            .min_by(|a, b| a.2.total_cmp(&b.2));
        match first {
            None => Ok(()),
            Some((limit, before, factor)) => Err(Refusal {
                factor: (before > self.options.met).then_some(0.999 * factor),
                stop: Stop::Limit(limit),
            }),
        }
    }

    /// Refuses a step that is not valid, with the share of it that may be.
    fn respect_contacts(&mut self, chart: &Chart) -> Result<(), Refusal> {
        let (manifold, tolerance) = (self.manifold, self.options.tolerance);
        let (x, next, work) = (&self.x, &self.next, &mut self.work);
        let mut violated = Vec::new();
        let outcome = self.validity.step(
            &self.memory,
            next,
            &mut self.next_memory,
            &mut |s, y| {
                for ((y, a), b) in y.iter_mut().zip(x).zip(next) {
                    *y = a + s * (b - a);
                }
                chart.retract(manifold, y, tolerance, work).is_ok()
            },
            &mut violated,
        );
        match outcome {
            Ok(()) => Ok(()),
            Err(Obstruction::Blocked) => Err(Refusal {
                factor: Some(0.5),
                stop: Stop::Blocked,
            }),
            Err(Obstruction::Contacts) => {
                let mut row = SparseRow::default();
                let mut first: Option<(usize, f64, f64)> = None;
                for contact in violated {
                    row.clear();
                    let before =
                        self.validity
                            .contact(contact, &self.x, &mut self.memory, &mut row);
                    row.clear();
                    let after =
                        self.validity
                            .contact(contact, &self.next, &mut self.next_memory, &mut row);
                    let (before, after) = (before.unwrap_or(0.0), after.unwrap_or(0.0));
                    let factor = if before > after {
                        (before / (before - after)).clamp(0.0, 1.0)
                    } else {
                        0.5
                    };
                    if first.is_none_or(|first| factor < first.2) {
                        first = Some((contact, before, factor));
                    }
                }
                let (stop, before, factor) = first.map_or(
                    (Stop::Blocked, f64::INFINITY, 0.5),
                    |(contact, before, factor)| (Stop::Contact(contact), before, factor),
                );
                Err(Refusal {
                    // Where a clearance is curved the first share may be too long.
                    factor: (before > self.options.met).then_some((0.99 * factor).clamp(0.1, 0.9)),
                    stop,
                })
            }
        }
    }
}

/// Why a step is refused, and which share of it to try instead, if any.
struct Refusal {
    factor: Option<f64>,
    stop: Stop,
}

/// The pseudo-inverse of a matrix and an orthonormal basis of its null space.
fn split(matrix: &DMatrix<f64>) -> (DMatrix<f64>, DMatrix<f64>) {
    let k = matrix.ncols();
    if matrix.nrows() == 0 || k == 0 {
        return (DMatrix::zeros(k, matrix.nrows()), DMatrix::identity(k, k));
    }
    let eigen = (matrix.transpose() * matrix).symmetric_eigen();
    let least = RANK * RANK * eigen.eigenvalues.max();
    let columns = |keep: &dyn Fn(f64) -> bool| -> Vec<usize> {
        (0..k).filter(|&j| keep(eigen.eigenvalues[j])).collect()
    };
    let large = columns(&|value| value > least && value > 0.0);
    let small = columns(&|value| !(value > least && value > 0.0));
    let range = eigen.eigenvectors.select_columns(&large);
    let mut inverse = range.transpose() * matrix.transpose();
    for (mut row, &j) in inverse.row_iter_mut().zip(&large) {
        row /= eigen.eigenvalues[j];
    }
    (range * inverse, eigen.eigenvectors.select_columns(&small))
}

fn rank(matrix: &DMatrix<f64>) -> usize {
    matrix.ncols() - split(matrix).1.ncols()
}

#[cfg(test)]
mod tests {
    use tensegra_atlas::{Everywhere, Predicate, doc::Sphere};

    use super::*;

    struct Coordinates;

    impl Quantities for Coordinates {
        fn count(&self) -> usize {
            3
        }

        fn value(&self, i: usize, x: &[f64]) -> f64 {
            x[i]
        }

        fn gradient(&self, i: usize, _: &[f64], row: &mut SparseRow) {
            row.add(i, 1.0);
        }
    }

    fn tracer<'a, V: Validity>(
        sphere: &'a Sphere,
        validity: &'a V,
        motors: &[usize],
    ) -> Tracer<'a, Sphere, V, Coordinates> {
        let start = [0.0, 0.8, 0.6];
        let options = TraceOptions::default();
        Tracer::new(sphere, validity, &Coordinates, motors, options, &start).unwrap()
    }

    fn follow<V: Validity>(
        tracer: &mut Tracer<'_, Sphere, V, Coordinates>,
        targets: &[(usize, f64)],
    ) -> Advance {
        for _ in 0..1000 {
            match tracer.step(targets) {
                Advance::Moved => {}
                advance => return advance,
            }
        }
        panic!("a thousand steps");
    }

    #[test]
    fn goes_back_the_way_it_came() {
        let sphere = Sphere::new();
        // Two motors too many: x and y give way for z.
        let mut tracer = tracer(&sphere, &Everywhere, &[0, 1, 2]);
        assert_eq!(follow(&mut tracer, &[(2, -0.9)]), Advance::Arrived);
        let far = tracer.point().to_vec();
        assert!((far[2] + 0.9).abs() < 1e-10);
        assert!(tracer.worst_held().unwrap().1 > 0.3);
        let steps = tracer.trail().count();
        assert_eq!(follow(&mut tracer, &[(2, 0.6)]), Advance::Arrived);
        assert_eq!(tracer.point(), [0.0, 0.8, 0.6]);
        assert_eq!(tracer.trail().count(), 1);
        assert!(steps > 30);
        // Another tracer, which knows nothing of that way, takes it too.
        let options = TraceOptions::default();
        let mut other = Tracer::new(
            &sphere,
            &Everywhere,
            &Coordinates,
            &[0, 1, 2],
            options,
            &far,
        )
        .unwrap();
        assert_eq!(follow(&mut other, &[(2, 0.6)]), Advance::Arrived);
        for (x, start) in other.point().iter().zip([0.0, 0.8, 0.6]) {
            assert!((x - start).abs() < 1e-4, "{:?}", other.point());
        }
    }

    #[test]
    fn goes_back_to_places_between() {
        let sphere = Sphere::new();
        let mut tracer = tracer(&sphere, &Everywhere, &[0]);
        for target in [0.3, 0.4, 0.31, 0.32, 0.1, 0.6] {
            assert_eq!(follow(&mut tracer, &[(2, target)]), Advance::Arrived);
            let x = tracer.point();
            assert!((x[2] - target).abs() < 1e-9 && x[0].abs() < 1e-9);
        }
        assert_eq!(tracer.point(), [0.0, 0.8, 0.6]);
    }

    #[test]
    fn stops_at_a_fold_when_the_held_quantity_cannot_be_held() {
        let sphere = Sphere::new();
        let mut tracer = tracer(&sphere, &Everywhere, &[2]);
        let advance = follow(&mut tracer, &[(0, 0.9)]);
        assert_eq!(advance, Advance::Stopped(Stop::Fold));
        // At the end of the circle of latitude: x = 0.8.
        assert!(
            (tracer.point()[0] - 0.8).abs() < 1e-8,
            "{:?}",
            tracer.point()
        );
        assert!((tracer.point()[2] - 0.6).abs() < 1e-8);
    }

    #[test]
    fn stops_at_the_extremum_of_the_moved_quantity() {
        let sphere = Sphere::new();
        let mut tracer = tracer(&sphere, &Everywhere, &[]);
        let advance = follow(&mut tracer, &[(2, 1.5)]);
        assert_eq!(advance, Advance::Stopped(Stop::Fold));
        assert!(
            (tracer.point()[2] - 1.0).abs() < 1e-8,
            "{:?}",
            tracer.point()
        );
    }

    #[test]
    fn moves_in_proportion() {
        let sphere = Sphere::new();
        let mut tracer = tracer(&sphere, &Everywhere, &[]);
        for _ in 0..3 {
            assert_eq!(tracer.step(&[(0, 0.4), (1, 0.6)]), Advance::Moved);
            let x = tracer.point();
            assert!((x[0] / 0.4 - (0.8 - x[1]) / 0.2).abs() < 1e-9);
        }
        assert_eq!(follow(&mut tracer, &[(0, 0.4), (1, 0.6)]), Advance::Arrived);
    }

    #[test]
    fn stops_where_the_validity_test_says_so() {
        let sphere = Sphere::new();
        let validity = Predicate::new(3, 3, |x: &[f64]| x[2] > 0.1);
        let mut tracer = tracer(&sphere, &validity, &[]);
        let advance = follow(&mut tracer, &[(2, -0.5)]);
        assert_eq!(advance, Advance::Stopped(Stop::Blocked));
        assert!((tracer.point()[2] - 0.1).abs() < 1e-6);
    }
}
