//! The SQP solver for large, sparse problems: the subproblems are solved by Clarabel's
//! interior-point method.
//!
//! An interior-point method pays for every row in every iteration, active or not. Most rows of a
//! large problem (clearances, ranges) are far from active, so the subproblem leaves out
//!
//! - rows that no step inside the trust region can violate, which is exact, and
//! - rows that only a step through a good part of the trust region could violate; if the step
//!   found does violate some of them they are put back and the subproblem is solved again.
//!
//! Only rows that a zero step violates carry slack variables: the others can be met by not moving.

use super::engine::{Aim, Backend, Elastic, Engine, Subproblem};
use super::model::{LocalModel, RowSide};
use crate::vector::{largest, refill};
use crate::{Nlp, OptionError, ProblemError, SqpOptions, SqpReport};
use clarabel::algebra::CscMatrix;
use clarabel::qdldl::{QDLDLFactorisation, QDLDLSettings};
use clarabel::solver::SupportedConeT::{NonnegativeConeT, ZeroConeT};
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SolverStatus};

/// A row is left out at first if its distance from its bound is more than this fraction of what
/// the largest step in the trust region could cover.
const LEFT_OUT_BEYOND: f64 = 0.3;
/// Most times that left-out rows are put back before all are.
const MAX_ROUNDS: usize = 3;
/// A violation of a left-out row below this is rounding.
const VIOLATION_TOLERANCE: f64 = 1e-9;
/// Tolerances on the scaled subproblem: at first, and when that stops short of the solution.
const COARSE_TOLERANCE: f64 = 1e-9;
const FINE_TOLERANCE: f64 = 1e-14;
/// A multiplier below this fraction of the distance from the constraint (both scaled) is what the
/// interior-point method leaves of zero.
const INACTIVE_RATIO: f64 = 1e-6;
/// Relative cost of a step in the pure feasibility problem.
const FEASIBILITY_CURVATURE: f64 = 1e-6;

/// Sequential quadratic programming for large problems with sparse derivatives, see [`Nlp`] for
/// the problem class.
///
/// A trust-region method for an exact penalty function: each step minimises a convex quadratic
/// model of the objective over the linearised constraints, some of them relaxed at a price, so
/// that every subproblem has a solution. A problem whose constraints cannot be met ends with
/// [`SqpStatus::Infeasible`](crate::SqpStatus::Infeasible) and the list of those constraints.
///
/// The variables' scales ([`Nlp::variable_scales`]) and the first trust region
/// ([`SqpOptions::initial_radius`]) matter most for speed: the radius should be about as far as the
/// linearised constraints can be believed.
///
/// # Examples
///
/// A chain of points from 0 to 9 that has to keep clear of its middle, with the shortest sum of
/// squared steps:
///
/// ```
/// use tensegra_optim::{Hessian, Nlp, SparseSqp, SqpOptions, TripletPattern};
///
/// struct Chain { points: usize }
///
/// impl Nlp for Chain {
///     fn num_variables(&self) -> usize { self.points }
///     fn num_constraints(&self) -> usize { self.points }
///     fn variable_bounds(&self, lower: &mut [f64], upper: &mut [f64]) {
///         (lower[0], upper[0]) = (0.0, 0.0);
///         let last = self.points - 1;
///         (lower[last], upper[last]) = (9.0, 9.0);
///     }
///     fn constraint_bounds(&self, lower: &mut [f64], _upper: &mut [f64]) { lower.fill(0.25) }
///     fn jacobian_pattern(&self) -> TripletPattern { TripletPattern::diagonal(self.points) }
///     fn objective(&mut self, x: &[f64]) -> f64 {
///         x.windows(2).map(|pair| (pair[1] - pair[0]).powi(2)).sum()
///     }
///     fn gradient(&mut self, x: &[f64], gradient: &mut [f64]) {
///         gradient.fill(0.0);
///         for k in 1..self.points {
///             gradient[k] += 2.0 * (x[k] - x[k - 1]);
///             gradient[k - 1] -= 2.0 * (x[k] - x[k - 1]);
///         }
///     }
///     fn constraints(&mut self, x: &[f64], values: &mut [f64]) {
///         for (value, x) in values.iter_mut().zip(x) { *value = (x - 4.5).powi(2); }
///     }
///     fn jacobian(&mut self, x: &[f64], values: &mut [f64]) {
///         for (value, x) in values.iter_mut().zip(x) { *value = 2.0 * (x - 4.5); }
///     }
///     fn hessian_kind(&self) -> Hessian { Hessian::Convex }
///     fn hessian_pattern(&self) -> TripletPattern {
///         let mut pattern = TripletPattern::diagonal(self.points);
///         for k in 1..self.points { pattern.push(k, k - 1); }
///         pattern
///     }
///     fn hessian(&mut self, _: &[f64], weight: f64, _: &[f64], values: &mut [f64]) {
///         let (diagonal, beside) = values.split_at_mut(self.points);
///         diagonal.fill(4.0 * weight);
///         diagonal[0] = 2.0 * weight;
///         diagonal[self.points - 1] = 2.0 * weight;
///         beside.fill(-2.0 * weight);
///     }
/// }
///
/// let mut chain = Chain { points: 20 };
/// let mut x: Vec<f64> = (0..20).map(|k| if k < 10 { 0.0 } else { 9.0 }).collect();
/// let report = SparseSqp::new(SqpOptions::default())?.solve(&mut chain, &mut x)?;
/// assert!(report.is_converged());
/// // Nine even steps to 4, one across to 5, nine even steps to 9.
/// assert!((report.objective - (1.0 + 2.0 * 16.0 / 9.0)).abs() < 1e-6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct SparseSqp {
    options: SqpOptions,
    engine: Engine<InteriorPoint>,
}

impl SparseSqp {
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

    /// As [`solve`](Self::solve), starting with the multipliers of the last solve: worth it for a
    /// sequence of similar problems.
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

/// One inequality of the subproblem: a side of a row, with or without a slack variable.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Inequality {
    row: usize,
    side: RowSide,
    elastic: bool,
}

/// A solver with the structure that it was made for: as long as that does not change, new numbers
/// can be put in without analysing the structure again.
struct LastSolve {
    solver: DefaultSolver<f64>,
    equalities: Vec<usize>,
    inequalities: Vec<Inequality>,
    hessian_starts: Vec<usize>,
    hessian_rows: Vec<usize>,
    aim: Aim,
    tolerance: f64,
}

/// The subproblems as Clarabel's cone programmes.
struct InteriorPoint {
    last: Option<LastSolve>,
    /// Upper triangle of the Hessian with everything added that convexifies it.
    hessian: CscMatrix<f64>,
    equalities: Vec<usize>,
    inequalities: Vec<Inequality>,
    left_out: Vec<Inequality>,
    was_active: Vec<bool>,
    column: Vec<f64>,
    marks: Vec<usize>,
    tolerance: f64,
    solves: usize,
}

impl std::fmt::Debug for InteriorPoint {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("InteriorPoint").finish_non_exhaustive()
    }
}

impl Default for InteriorPoint {
    fn default() -> Self {
        Self {
            last: None,
            hessian: CscMatrix::zeros((0, 0)),
            equalities: Vec::new(),
            inequalities: Vec::new(),
            left_out: Vec::new(),
            was_active: Vec::new(),
            column: Vec::new(),
            marks: Vec::new(),
            tolerance: COARSE_TOLERANCE,
            solves: 0,
        }
    }
}

impl Backend for InteriorPoint {
    fn set_up(&mut self, model: &LocalModel, _warm: bool) {
        self.solves = 0;
        self.tolerance = COARSE_TOLERANCE;
        self.last = None;
        self.was_active.clear();
        self.was_active.resize(model.num_rows(), false);
    }

    fn set_model(&mut self, model: &LocalModel, certainly_convex: bool) -> bool {
        self.assemble_hessian(model);
        certainly_convex || self.is_positive_definite()
    }

    fn solve(
        &mut self,
        model: &LocalModel,
        subproblem: &Subproblem<'_>,
        step: &mut [f64],
        multipliers: &mut [f64],
    ) -> bool {
        self.select_rows(model, subproblem);
        for round in 0.. {
            if !self.solve_selected(model, subproblem, step, multipliers) {
                return false;
            }
            let mut complete = true;
            let all = round >= MAX_ROUNDS;
            let inequalities = &mut self.inequalities;
            self.left_out.retain(|&left_out| {
                let value = model.jacobian.row_dot(left_out.row, step);
                let violation = match left_out.side {
                    RowSide::Lower => subproblem.row_lower[left_out.row] - value,
                    RowSide::Upper => value - subproblem.row_upper[left_out.row],
                };
                let violated = violation > VIOLATION_TOLERANCE;
                complete &= !violated;
                if violated || all {
                    inequalities.push(left_out);
                }
                !(violated || all)
            });
            if complete {
                break;
            }
            // The order that the selection has, so that the structure can be recognised.
            self.inequalities
                .sort_unstable_by_key(|i| (i.row, i.side == RowSide::Upper));
        }
        for (active, multiplier) in self.was_active.iter_mut().zip(multipliers.iter()) {
            *active = multiplier.abs() > 1e-6 * subproblem.penalty;
        }
        true
    }

    fn refine(&mut self) -> bool {
        let refined = self.tolerance > FINE_TOLERANCE;
        self.tolerance = FINE_TOLERANCE;
        refined
    }

    fn solves(&self) -> usize {
        self.solves
    }
}

impl InteriorPoint {
    /// H + shift·I + augmentation as an upper triangle by columns.
    fn assemble_hessian(&mut self, model: &LocalModel) {
        let n = model.num_variables();
        let augmentation = &model.augmentation;
        // For the augmentation: which augmented rows touch each column.
        let mut touching: Vec<Vec<usize>> = Vec::new();
        if !augmentation.rows.is_empty() {
            touching.resize(n, Vec::new());
            for &(i, _) in &augmentation.rows {
                for &j in model.jacobian.row(i).0 {
                    touching[j].push(i);
                }
            }
        }
        let hessian = &mut self.hessian;
        (hessian.m, hessian.n) = (n, n);
        hessian.colptr.clear();
        hessian.rowval.clear();
        hessian.nzval.clear();
        refill(&mut self.column, n, 0.0);
        self.marks.clear();
        self.marks.resize(n, usize::MAX);
        for j in 0..n {
            let first = hessian.rowval.len();
            hessian.colptr.push(first);
            let mut add = |i: usize, value: f64| {
                if self.marks[i] != j {
                    self.marks[i] = j;
                    self.column[i] = 0.0;
                    hessian.rowval.push(i);
                }
                self.column[i] += value;
            };
            let (rows, values) = model.hessian.row(j);
            for (&i, &value) in rows.iter().zip(values) {
                add(i, value);
            }
            add(j, model.shift);
            if let Some(touching) = touching.get(j) {
                for &row in touching {
                    let (columns, values) = model.jacobian.row(row);
                    let own = columns
                        .iter()
                        .position(|&c| c == j)
                        .map_or(0.0, |k| values[k]);
                    for (&i, v) in columns.iter().zip(values).filter(|(i, _)| **i <= j) {
                        add(i, augmentation.weight * v * own);
                    }
                }
            }
            hessian.rowval[first..].sort_unstable();
            for &i in &hessian.rowval[first..] {
                hessian.nzval.push(self.column[i]);
            }
        }
        hessian.colptr.push(hessian.rowval.len());
        for &j in &augmentation.variables {
            // The diagonal is the last entry of its column.
            hessian.nzval[hessian.colptr[j + 1] - 1] += augmentation.weight;
        }
    }

    fn is_positive_definite(&self) -> bool {
        let settings = QDLDLSettings {
            regularize_enable: false,
            ..QDLDLSettings::default()
        };
        let size = largest(&self.hessian.nzval);
        match QDLDLFactorisation::new(&self.hessian, Some(settings)) {
            // A pivot that is all cancellation is no better than zero.
            Ok(factors) => factors.D.iter().all(|&pivot| pivot > 1e-14 * size),
            Err(_) => false,
        }
    }

    /// Clarabel's settings; further attempts are more careful.
    fn settings(&self, attempt: usize) -> DefaultSettings<f64> {
        DefaultSettings {
            verbose: false,
            // Data can be updated only if the structure is left as it is.
            presolve_enable: false,
            max_threads: 1,
            tol_gap_abs: self.tolerance,
            tol_gap_rel: self.tolerance,
            tol_feas: self.tolerance.max(1e-12),
            reduced_tol_gap_abs: 1e2 * COARSE_TOLERANCE,
            reduced_tol_gap_rel: 1e2 * COARSE_TOLERANCE,
            reduced_tol_feas: 1e2 * COARSE_TOLERANCE,
            equilibrate_enable: attempt == 0,
            static_regularization_constant: if attempt < 2 { 1e-8 } else { 1e-7 },
            ..DefaultSettings::default()
        }
    }

    fn structure_is_that_of_last_solve(
        &self,
        hessian: &CscMatrix<f64>,
        subproblem: &Subproblem<'_>,
    ) -> bool {
        self.last.as_ref().is_some_and(|last| {
            last.aim == subproblem.aim
                && last.tolerance == self.tolerance
                && last.equalities == self.equalities
                && last.inequalities == self.inequalities
                && last.hessian_starts == hessian.colptr
                && last.hessian_rows == hessian.rowval
        })
    }

    /// Sorts the rows into equalities, inequalities that may become active, those left out for
    /// the time being, and those that cannot matter.
    fn select_rows(&mut self, model: &LocalModel, subproblem: &Subproblem<'_>) {
        self.equalities.clear();
        self.inequalities.clear();
        self.left_out.clear();
        for i in 0..model.num_rows() {
            let (lower, upper) = (subproblem.row_lower[i], subproblem.row_upper[i]);
            let (columns, values) = model.jacobian.row(i);
            if lower == upper {
                self.equalities.push(i);
                continue;
            }
            // The range of Jd over the box.
            let (mut least, mut most) = (0.0, 0.0);
            for (&j, v) in columns.iter().zip(values) {
                let (a, b) = (v * subproblem.lower[j], v * subproblem.upper[j]);
                least += a.min(b);
                most += a.max(b);
            }
            for (side, distance, reach) in [
                (RowSide::Lower, -lower, -least),
                (RowSide::Upper, upper, most),
            ] {
                if distance >= reach && distance >= 0.0 {
                    continue;
                }
                let inequality = Inequality {
                    row: i,
                    side,
                    elastic: subproblem.elastic == Elastic::All || distance < 0.0,
                };
                if distance > LEFT_OUT_BEYOND * reach && !self.was_active[i] {
                    self.left_out.push(inequality);
                } else {
                    self.inequalities.push(inequality);
                }
            }
        }
    }

    /// Solves the programme with the rows selected.
    fn solve_selected(
        &mut self,
        model: &LocalModel,
        subproblem: &Subproblem<'_>,
        step: &mut [f64],
        multipliers: &mut [f64],
    ) -> bool {
        let n = model.num_variables();
        let num_elastic = self.inequalities.iter().filter(|i| i.elastic).count();
        let num_slacks = 2 * self.equalities.len() + num_elastic;
        let total = n + num_slacks;

        // Objective, scaled so that its gradient is of the size of one.
        let size = match subproblem.aim {
            Aim::Objective => largest(&model.gradient).max(1e-3 * subproblem.penalty),
            Aim::Feasibility => 0.0,
        };
        let scale = if size > 0.0 { 1.0 / size } else { 1.0 };
        let mut hessian = CscMatrix::<f64>::zeros((total, total));
        let mut gradient = vec![0.0; n];
        let penalty = match subproblem.aim {
            Aim::Objective => {
                hessian.colptr[..=n].copy_from_slice(&self.hessian.colptr);
                hessian.rowval.extend_from_slice(&self.hessian.rowval);
                hessian
                    .nzval
                    .extend(self.hessian.nzval.iter().map(|v| v * scale));
                hessian.colptr[n + 1..].fill(self.hessian.rowval.len());
                gradient.copy_from_slice(&model.gradient);
                model.add_augmented_gradient(
                    subproblem.row_lower,
                    subproblem.row_upper,
                    &mut gradient,
                );
                for g in &mut gradient {
                    *g *= scale;
                }
                scale * subproblem.penalty
            }
            Aim::Feasibility => {
                for j in 0..n {
                    hessian.rowval.push(j);
                    hessian.nzval.push(FEASIBILITY_CURVATURE);
                    hessian.colptr[j + 1] = j + 1;
                }
                hessian.colptr[n + 1..].fill(n);
                1.0
            }
        };
        gradient.resize(total, penalty);

        // Constraints A x + s = b, s in the cones: equalities, inequalities, slacks, the box.
        let num_rows = self.equalities.len() + self.inequalities.len() + num_slacks + 2 * n;
        let mut right = Vec::with_capacity(num_rows);
        let (mut rows, mut columns, mut values) = (Vec::new(), Vec::new(), Vec::new());
        let mut push = |row: usize, column: usize, value: f64| {
            rows.push(row);
            columns.push(column);
            values.push(value);
        };
        let mut slack = n;
        for &i in &self.equalities {
            let row = right.len();
            let (js, vs) = model.jacobian.row(i);
            for (&j, &v) in js.iter().zip(vs) {
                push(row, j, v);
            }
            push(row, slack, 1.0);
            push(row, slack + 1, -1.0);
            slack += 2;
            right.push(subproblem.row_lower[i]);
        }
        for inequality in &self.inequalities {
            let row = right.len();
            let (sign, bound) = match inequality.side {
                RowSide::Lower => (-1.0, -subproblem.row_lower[inequality.row]),
                RowSide::Upper => (1.0, subproblem.row_upper[inequality.row]),
            };
            let (js, vs) = model.jacobian.row(inequality.row);
            for (&j, &v) in js.iter().zip(vs) {
                push(row, j, sign * v);
            }
            if inequality.elastic {
                push(row, slack, -1.0);
                slack += 1;
            }
            right.push(bound);
        }
        for slack in n..total {
            push(right.len(), slack, -1.0);
            right.push(0.0);
        }
        for j in 0..n {
            push(right.len(), j, 1.0);
            right.push(subproblem.upper[j]);
            push(right.len(), j, -1.0);
            right.push(-subproblem.lower[j]);
        }
        let matrix = CscMatrix::new_from_triplets(num_rows, total, rows, columns, values);
        let cones = [
            ZeroConeT(self.equalities.len()),
            NonnegativeConeT(num_rows - self.equalities.len()),
        ];

        for attempt in 0..3 {
            self.solves += 1;
            let reusable =
                attempt == 0 && self.structure_is_that_of_last_solve(&hessian, subproblem);
            let reused = reusable
                && self.last.as_mut().is_some_and(|last| {
                    last.solver
                        .update_data(&hessian, &gradient, &matrix, &right)
                        .is_ok()
                });
            if !reused {
                let settings = self.settings(attempt);
                let Ok(solver) =
                    DefaultSolver::new(&hessian, &gradient, &matrix, &right, &cones, settings)
                else {
                    return false;
                };
                self.last = Some(LastSolve {
                    solver,
                    equalities: self.equalities.clone(),
                    inequalities: self.inequalities.clone(),
                    hessian_starts: hessian.colptr.clone(),
                    hessian_rows: hessian.rowval.clone(),
                    aim: subproblem.aim,
                    tolerance: self.tolerance,
                });
            }
            let Some(LastSolve { solver, .. }) = &mut self.last else {
                return false;
            };
            solver.solve();
            let solution = &solver.solution;
            let usable = matches!(
                solution.status,
                SolverStatus::Solved | SolverStatus::AlmostSolved
            );
            if !usable {
                self.last = None;
                continue;
            }
            step.copy_from_slice(&solution.x[..n]);
            multipliers.fill(0.0);
            let prices = &solution.z;
            for (k, &i) in self.equalities.iter().enumerate() {
                multipliers[i] = prices[k] / scale;
            }
            for (k, inequality) in self.inequalities.iter().enumerate() {
                let k = self.equalities.len() + k;
                if prices[k] < INACTIVE_RATIO * solution.s[k] {
                    continue;
                }
                let price = prices[k] / scale;
                multipliers[inequality.row] += match inequality.side {
                    RowSide::Lower => -price,
                    RowSide::Upper => price,
                };
            }
            // The method stops just short of active bounds: go there.
            let first = num_rows - 2 * n;
            for (j, d) in step.iter_mut().enumerate() {
                let (above, below) = (first + 2 * j, first + 2 * j + 1);
                if prices[above] > solution.s[above] {
                    *d = subproblem.upper[j];
                } else if prices[below] > solution.s[below] {
                    *d = subproblem.lower[j];
                }
            }
            return true;
        }
        false
    }
}
