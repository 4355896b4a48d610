//! The SQP solver for small problems: the subproblems are solved by the dense dual active-set
//! method, started from the active set of the subproblem before.

use super::engine::{Aim, Backend, Elastic, Engine, Subproblem};
use super::model::LocalModel;
use crate::dense_qp::{DenseQp, DenseQpSolver, QpStatus};
use crate::vector::refill;
use crate::{Nlp, OptionError, ProblemError, SqpOptions, SqpReport};

/// Relative curvature of the price of a violation, which keeps the elastic programme strictly
/// convex.
const ELASTIC_CURVATURE: f64 = 1e-5;

/// Sequential quadratic programming for small problems (up to some 30 variables and 200
/// constraints), see [`Nlp`] for the problem class.
///
/// Constraints are kept as dense rows; the subproblems are solved by a dual active-set method
/// ([`DenseQpSolver`]) that starts from the last active set. A solver keeps its memory: a further
/// solve of a problem of the same size allocates next to nothing, and the iterations allocate
/// nothing at all. The method is that of [`SparseSqp`](crate::SparseSqp) otherwise.
///
/// # Examples
///
/// Hock and Schittkowski's problem 71:
///
/// ```
/// use tensegra_optim::{DenseSqp, Nlp, SqpOptions, TripletPattern};
///
/// struct Hs71;
///
/// impl Nlp for Hs71 {
///     fn num_variables(&self) -> usize { 4 }
///     fn num_constraints(&self) -> usize { 2 }
///     fn variable_bounds(&self, lower: &mut [f64], upper: &mut [f64]) {
///         lower.fill(1.0);
///         upper.fill(5.0);
///     }
///     fn constraint_bounds(&self, lower: &mut [f64], upper: &mut [f64]) {
///         lower[0] = 25.0;
///         (lower[1], upper[1]) = (40.0, 40.0);
///     }
///     fn jacobian_pattern(&self) -> TripletPattern { TripletPattern::dense(2, 4) }
///     fn objective(&mut self, x: &[f64]) -> f64 {
///         x[0] * x[3] * (x[0] + x[1] + x[2]) + x[2]
///     }
///     fn gradient(&mut self, x: &[f64], gradient: &mut [f64]) {
///         gradient[0] = x[3] * (2.0 * x[0] + x[1] + x[2]);
///         gradient[1] = x[0] * x[3];
///         gradient[2] = x[0] * x[3] + 1.0;
///         gradient[3] = x[0] * (x[0] + x[1] + x[2]);
///     }
///     fn constraints(&mut self, x: &[f64], values: &mut [f64]) {
///         values[0] = x[0] * x[1] * x[2] * x[3];
///         values[1] = x.iter().map(|v| v * v).sum();
///     }
///     fn jacobian(&mut self, x: &[f64], values: &mut [f64]) {
///         for j in 0..4 {
///             values[j] = (0..4).filter(|&k| k != j).map(|k| x[k]).product();
///             values[4 + j] = 2.0 * x[j];
///         }
///     }
/// }
///
/// let mut x = [1.0, 5.0, 5.0, 1.0];
/// let report = DenseSqp::new(SqpOptions::default())?.solve(&mut Hs71, &mut x)?;
/// assert!(report.is_converged());
/// assert!((report.objective - 17.0140173).abs() < 1e-6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct DenseSqp {
    options: SqpOptions,
    engine: Engine<DualActiveSet>,
}

impl DenseSqp {
    /// A solver with the given options.
    ///
    /// # Errors
    /// An option outside its range.
    pub fn new(options: SqpOptions) -> Result<Self, OptionError> {
        options.validate()?;
        Ok(Self {
            options,
            engine: Engine::default(),
        })
    }

    /// Solves `problem` from `x`, which is moved into the variables' bounds first and overwritten
    /// by the final point. Whatever the status, the final point is the best one found.
    ///
    /// # Errors
    /// A problem that makes no sense: see [`ProblemError`]. That no solution was found is not an
    /// error but a status of the report.
    pub fn solve<P: Nlp>(
        &mut self,
        problem: &mut P,
        x: &mut [f64],
    ) -> Result<SqpReport, ProblemError> {
        self.engine.solve(&self.options, problem, x, false)
    }

    /// As [`solve`](Self::solve), starting with the multipliers and the active set of the last
    /// solve: worth it for a sequence of similar problems.
    ///
    /// # Errors
    /// As [`solve`](Self::solve).
    pub fn solve_warm<P: Nlp>(
        &mut self,
        problem: &mut P,
        x: &mut [f64],
    ) -> Result<SqpReport, ProblemError> {
        self.engine.solve(&self.options, problem, x, true)
    }

    /// Multipliers λ of the constraints at the final point of the last solve: positive at an
    /// upper bound, negative at a lower bound.
    #[must_use]
    pub fn multipliers(&self) -> &[f64] {
        &self.engine.multipliers
    }
}

/// The subproblems as dense quadratic programmes.
#[derive(Debug)]
struct DualActiveSet {
    /// All constraints rigid.
    rigid: DenseQp,
    solver: DenseQpSolver,
    /// With a slack variable for every elastic side of a constraint.
    elastic: DenseQp,
    elastic_solver: DenseQpSolver,
    row: Vec<f64>,
    solves: usize,
}

impl Default for DualActiveSet {
    fn default() -> Self {
        Self {
            rigid: DenseQp::new(0),
            solver: DenseQpSolver::new(),
            elastic: DenseQp::new(0),
            elastic_solver: DenseQpSolver::new(),
            row: Vec::new(),
            solves: 0,
        }
    }
}

impl Backend for DualActiveSet {
    fn set_up(&mut self, _model: &LocalModel, warm: bool) {
        self.solves = 0;
        if !warm {
            self.solver.forget_active_set();
        }
    }

    fn set_model(&mut self, model: &LocalModel, _certainly_convex: bool) -> bool {
        let n = model.num_variables();
        self.rigid.reset(n);
        fill_hessian(&mut self.rigid, model);
        if !self.solver.factorises(&self.rigid) {
            return false;
        }
        for i in 0..model.num_rows() {
            refill(&mut self.row, n, 0.0);
            scatter(model, i, &mut self.row);
            self.rigid
                .push_range(&self.row, f64::NEG_INFINITY, f64::INFINITY);
        }
        true
    }

    fn solve(
        &mut self,
        model: &LocalModel,
        subproblem: &Subproblem<'_>,
        step: &mut [f64],
        multipliers: &mut [f64],
    ) -> bool {
        if subproblem.elastic == Elastic::Violated && subproblem.aim == Aim::Objective {
            for (j, (&lower, &upper)) in subproblem.lower.iter().zip(subproblem.upper).enumerate() {
                self.rigid.set_bounds(j, lower, upper);
            }
            for (i, (&lower, &upper)) in subproblem
                .row_lower
                .iter()
                .zip(subproblem.row_upper)
                .enumerate()
            {
                self.rigid.set_row_bounds(i, lower, upper);
            }
            fill_gradient(&mut self.rigid, model, subproblem);
            self.solves += 1;
            match self.solver.solve_unchecked(&self.rigid) {
                Ok((QpStatus::Solved, _)) => {
                    step.copy_from_slice(self.solver.solution());
                    multipliers.copy_from_slice(self.solver.row_multipliers());
                    return true;
                }
                Ok(_) => {}
                Err(_) => return false,
            }
        }
        self.solve_elastic(model, subproblem, step, multipliers)
    }

    fn refine(&mut self) -> bool {
        false
    }

    fn solves(&self) -> usize {
        self.solves
    }
}

impl DualActiveSet {
    /// Solves the programme in which constraints may be violated at a price: a slack variable
    /// s ≥ 0 at the cost ν s + ½ ρ s² for every elastic side.
    fn solve_elastic(
        &mut self,
        model: &LocalModel,
        subproblem: &Subproblem<'_>,
        step: &mut [f64],
        multipliers: &mut [f64],
    ) -> bool {
        let n = model.num_variables();
        let elastic_sides = |i: usize| {
            let (lower, upper) = (subproblem.row_lower[i], subproblem.row_upper[i]);
            match subproblem.elastic {
                Elastic::Violated => (lower > 0.0, upper < 0.0),
                Elastic::All => {
                    // Sides that no step in the box can reach need no slack.
                    let (columns, values) = model.jacobian.row(i);
                    let (mut least, mut most) = (0.0, 0.0);
                    for (&j, v) in columns.iter().zip(values) {
                        let (a, b) = (v * subproblem.lower[j], v * subproblem.upper[j]);
                        least += a.min(b);
                        most += a.max(b);
                    }
                    (lower > least, upper < most)
                }
            }
        };
        let mut slacks = 0;
        let mut worst = 0.0_f64;
        for i in 0..model.num_rows() {
            let (below, above) = elastic_sides(i);
            slacks += usize::from(below) + usize::from(above);
            worst = worst
                .max(subproblem.row_lower[i])
                .max(-subproblem.row_upper[i]);
        }
        let qp = &mut self.elastic;
        qp.reset(n + slacks);
        match subproblem.aim {
            Aim::Objective => {
                fill_hessian(qp, model);
                fill_gradient(qp, model, subproblem);
            }
            Aim::Feasibility => {
                // A cost of the step that is small against the violation even at the edge of the
                // trust region.
                let size = subproblem.penalty * worst.max(f64::MIN_POSITIVE)
                    / subproblem.radius.powi(2)
                    * ELASTIC_CURVATURE;
                for j in 0..n {
                    qp.set_hessian(j, j, size);
                }
            }
        }
        for j in 0..n {
            qp.set_bounds(j, subproblem.lower[j], subproblem.upper[j]);
        }
        let curvature = ELASTIC_CURVATURE * subproblem.penalty / worst.max(f64::MIN_POSITIVE);
        for slack in n..n + slacks {
            qp.set_hessian(slack, slack, curvature);
            qp.gradient_mut()[slack] = subproblem.penalty;
            qp.set_bounds(slack, 0.0, f64::INFINITY);
        }
        let mut slack = n;
        for i in 0..model.num_rows() {
            refill(&mut self.row, n + slacks, 0.0);
            scatter(model, i, &mut self.row);
            let (below, above) = elastic_sides(i);
            if below {
                self.row[slack] = 1.0;
                slack += 1;
            }
            if above {
                self.row[slack] = -1.0;
                slack += 1;
            }
            qp.push_range(&self.row, subproblem.row_lower[i], subproblem.row_upper[i]);
        }
        self.solves += 1;
        self.elastic_solver.forget_active_set();
        match self.elastic_solver.solve_unchecked(qp) {
            Ok((QpStatus::Solved, _)) => {
                step.copy_from_slice(&self.elastic_solver.solution()[..n]);
                multipliers.copy_from_slice(self.elastic_solver.row_multipliers());
                true
            }
            _ => false,
        }
    }
}

fn fill_hessian(qp: &mut DenseQp, model: &LocalModel) {
    for j in 0..model.num_variables() {
        let (rows, values) = model.hessian.row(j);
        for (&i, &value) in rows.iter().zip(values) {
            let shift = if i == j { model.shift } else { 0.0 };
            qp.set_hessian(i, j, value + shift);
        }
    }
    let weight = model.augmentation.weight;
    for &(i, _) in &model.augmentation.rows {
        let (columns, values) = model.jacobian.row(i);
        for (&a, v) in columns.iter().zip(values) {
            for (&b, w) in columns.iter().zip(values) {
                if a <= b {
                    qp.add_hessian(a, b, weight * v * w);
                }
            }
        }
    }
    for &j in &model.augmentation.variables {
        qp.add_hessian(j, j, weight);
    }
}

fn fill_gradient(qp: &mut DenseQp, model: &LocalModel, subproblem: &Subproblem<'_>) {
    let gradient = &mut qp.gradient_mut()[..model.num_variables()];
    gradient.copy_from_slice(&model.gradient);
    model.add_augmented_gradient(subproblem.row_lower, subproblem.row_upper, gradient);
}

fn scatter(model: &LocalModel, i: usize, row: &mut [f64]) {
    let (columns, values) = model.jacobian.row(i);
    for (&j, &value) in columns.iter().zip(values) {
        row[j] = value;
    }
}
