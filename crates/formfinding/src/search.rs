//! The solver behind form-finding: from a point to a form, or to what cannot be met.

use tensegra_atlas::ImplicitManifold;
use tensegra_model::{EquilibriumManifold, FormCost};
use tensegra_optim::{
    DenseSqp, LeastSquaresOptions, LevenbergMarquardt, Nlp, SqpOptions, StepScaling,
    restore_feasibility,
};

use crate::{
    collision_free::{Form, RESIDUAL},
    error::Unmet,
    frame::{Frame, Group},
    program::Program,
    start,
};

/// Margin of inequalities while a form is sought, in the manifold's units.
pub(crate) const WIDE_MARGIN: f64 = 1e-2;
/// Margin of inequalities of a polished form: what keeps rounding from crossing them.
pub(crate) const THIN_MARGIN: f64 = 1e-8;
/// Residual at which polishing ends.
const POLISHED: f64 = 1e-12;
/// Iterations of a search, and of polishing.
const SEARCH_ITERATIONS: usize = 150;
const POLISH_ITERATIONS: usize = 60;
/// Weight of constraints that are relaxed, and the violation of others that counts as none.
const RELAXED_WEIGHT: f64 = 1e-3;
const NEGLIGIBLE: f64 = 1e-4;

/// A solver with its memory: one for each thread.
pub(crate) struct Search<'f, 'a> {
    pub(crate) program: Program<'f, 'a>,
    frame: &'f Frame<'a>,
}

impl<'f, 'a> Search<'f, 'a> {
    pub(crate) fn new(frame: &'f Frame<'a>) -> Self {
        Self {
            program: frame.program(),
            frame,
        }
    }

    /// The point at which a random start begins.
    pub(crate) fn random(&self, seed: u64, start: usize) -> Vec<f64> {
        let mut rng = start::generator(seed, start as u64 + 1);
        let manifold = self.frame.manifold;
        let structure = manifold.structure();
        let positions = start::positions(structure, self.frame.conditions, &mut rng);
        let force = manifold.force_unit();
        let configuration = start::configuration(structure, positions, force, &mut rng);
        manifold.coordinates(&configuration)
    }

    /// The form that a random start leads to.
    pub(crate) fn try_start(&mut self, seed: u64, start: usize) -> Option<Form> {
        let mut x = self.random(seed, start);
        self.solve_anyhow(&mut x, StepScaling::Jacobian, WIDE_MARGIN, start)
    }

    /// Steps towards a point that meets all constraints with a margin; the number of steps, and
    /// whether it does.
    fn descend(
        &mut self,
        x: &mut [f64],
        margin: f64,
        scaling: StepScaling,
        iterations: usize,
    ) -> Option<(usize, bool)> {
        self.program.margin = margin;
        let options = LeastSquaresOptions::default()
            .with_max_iterations(iterations)
            .with_residual_tolerance(POLISHED)
            .with_scaling(scaling);
        let mut solver = LevenbergMarquardt::new(options).ok()?;
        let report = restore_feasibility(&mut self.program, &mut solver, x).ok()?;
        let met = report.largest_residual <= 0.5 * RESIDUAL;
        Some((report.iterations, met && x.iter().all(|v| v.is_finite())))
    }

    /// The form that is reached from x, if not directly, then by letting bodies pass through each
    /// other first.
    pub(crate) fn solve_anyhow(
        &mut self,
        x: &mut [f64],
        scaling: StepScaling,
        margin: f64,
        start: usize,
    ) -> Option<Form> {
        let from = x.to_vec();
        self.solve(x, scaling, margin, start).or_else(|| {
            x.copy_from_slice(&from);
            self.program.relaxed = Some((Group::Clearance, 0.0));
            self.program.stable = false;
            self.descend(x, margin, scaling, SEARCH_ITERATIONS)?;
            self.solve(x, scaling, margin, start)
        })
    }

    /// The form that is reached from x.
    pub(crate) fn solve(
        &mut self,
        x: &mut [f64],
        scaling: StepScaling,
        margin: f64,
        start: usize,
    ) -> Option<Form> {
        let frame = self.frame;
        self.program.relaxed = None;
        self.program.stable = false;
        let least = frame.settings().least_stiffness;
        let (mut iterations, mut met) = self.descend(x, margin, scaling, SEARCH_ITERATIONS)?;
        if least.is_some() {
            self.program.stable = true;
            let stiffness = self.program.least_stiffness(x);
            if stiffness.is_some_and(|s| Some(s) <= least) {
                let (more, again) = self.descend(x, margin, scaling, SEARCH_ITERATIONS)?;
                iterations += more;
                met = again;
            }
        }
        if frame.settings().cost != FormCost::None {
            self.program.margin = THIN_MARGIN;
            let options = SqpOptions::default()
                .with_initial_radius(0.1)
                .with_feasibility_tolerance(1e-9);
            let mut sqp = DenseSqp::new(options).ok()?;
            let report = sqp.solve(&mut self.program, x).ok()?;
            iterations += report.iterations;
            met = false;
        }
        if !met {
            let (more, again) =
                self.descend(x, THIN_MARGIN, StepScaling::None, POLISH_ITERATIONS)?;
            iterations += more;
            if !again {
                return None;
            }
        }
        let (residual, violation) = self.program.violations(x);
        if !(residual <= RESIDUAL && violation <= 0.0) {
            return None;
        }
        Some(Form {
            configuration: frame.manifold.configuration(x),
            start,
            residual,
            least_stiffness: self.program.least_stiffness(x),
            clearance: self.program.least_clearance(x),
            energy: self.program.energy(x),
            iterations,
        })
    }

    /// A point that meets all but one group of constraints, and what it misses of that group; the
    /// sum of the violations comes first. Without a group, whatever is missed.
    pub(crate) fn relaxed(
        &mut self,
        group: Option<Group>,
        seed: u64,
        start: usize,
    ) -> Option<(f64, Vec<Unmet>)> {
        let mut x = self.random(seed, start);
        self.program.relaxed = group.map(|group| (group, RELAXED_WEIGHT));
        self.program.stable = false;
        let scaling = StepScaling::Jacobian;
        self.descend(&mut x, THIN_MARGIN, scaling, SEARCH_ITERATIONS)?;
        if self.frame.settings().least_stiffness.is_some() {
            self.program.stable = true;
            self.descend(&mut x, THIN_MARGIN, scaling, SEARCH_ITERATIONS)?;
        }
        self.unmet(&x, group)
    }

    /// What a point misses, if that is of the given group alone (of any without one).
    pub(crate) fn unmet(&mut self, x: &[f64], group: Option<Group>) -> Option<(f64, Vec<Unmet>)> {
        self.program.relaxed = None;
        let rows = self.program.num_constraints();
        let mut values = vec![0.0; rows];
        self.program.constraints(x, &mut values);
        let (mut lower, mut upper) = (vec![f64::NEG_INFINITY; rows], vec![f64::INFINITY; rows]);
        self.program.margin = 0.0;
        self.program.constraint_bounds(&mut lower, &mut upper);
        let mut sum = 0.0;
        let mut unmet = Vec::new();
        for (row, &value) in values.iter().enumerate() {
            let violation = (lower[row] - value).max(value - upper[row]);
            if violation <= NEGLIGIBLE {
                continue;
            }
            let of = self.frame.group(row);
            if group.is_some_and(|group| group != of) {
                return None;
            }
            let (constraint, unit) = self.frame.describe(row);
            sum += violation;
            unmet.push((
                violation,
                Unmet {
                    constraint,
                    group: of,
                    violation: violation * unit,
                },
            ));
        }
        let manifold = self.frame.manifold;
        for variable in 0..x.len() {
            let violation = (manifold.lower_bounds()[variable] - x[variable])
                .max(x[variable] - manifold.upper_bounds()[variable]);
            if violation <= NEGLIGIBLE {
                continue;
            }
            let of = self.frame.group_of_variable(variable);
            if group.is_some_and(|group| group != of) {
                return None;
            }
            sum += violation;
            unmet.push((
                violation,
                Unmet {
                    constraint: self.frame.describe_variable(variable),
                    group: of,
                    violation,
                },
            ));
        }
        // By their size in the manifold's units: metres and newtons do not compare.
        unmet.sort_by(|a, b| b.0.total_cmp(&a.0));
        let unmet: Vec<Unmet> = unmet.into_iter().map(|(_, unmet)| unmet).collect();
        (group.is_none() || !unmet.is_empty()).then_some((sum, unmet))
    }
}
