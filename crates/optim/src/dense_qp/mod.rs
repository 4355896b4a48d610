//! Strictly convex quadratic programmes with few variables, by a dual active-set method.
//!
//! ```text
//! minimise    ½ xᵀ H x + gᵀ x            x ∈ ℝⁿ, H symmetric positive definite
//! subject to  l ≤ A x ≤ u                m rows; l = u makes an equality
//!             x_l ≤ x ≤ x_u
//! ```
//!
//! Source: D. Goldfarb, A. Idnani, "A numerically stable dual method for solving strictly convex
//! quadratic programs", Mathematical Programming 27 (1983), 1–33. The method starts from the
//! unconstrained minimum and takes in violated constraints one after the other, each time
//! restoring dual feasibility. It needs no feasible start, ends after finitely many steps, and
//! proves infeasibility by a set of constraints that contradict one another. Linearly dependent
//! and degenerate constraints are allowed.
//!
//! A warm start takes a guess of the active set, solves with it as equalities, and drops the
//! constraints whose multipliers have the wrong sign; what remains is a valid starting pair of the
//! method whatever the guess was.
//!
//! Cost: n³/2 for the factorisation, then O(n² + m n) for every change of the active set.

mod factor;
mod problem;

use crate::kkt::KktResiduals;
use crate::vector::{axpy, dot, refill};
use factor::{cholesky, givens, invert_transposed, norm_squared, rotate_columns, solve_upper};
pub use problem::{ActiveConstraint, DenseQp, DenseQpError, QpConstraint, Side};
use problem::{bounds_of, constraint_of, index_of, norm_of, sign_of, target_of, value_of};

/// A violation below this multiple of the size of the terms in a constraint is rounding.
const VIOLATION_TOLERANCE: f64 = 1e-12;
/// A normal whose part outside the span of the active normals is below this fraction of its
/// length (in the norm of H⁻¹) counts as linearly dependent.
const DEPENDENCE_TOLERANCE: f64 = 1e-10;
/// The same for guessed constraints, which are only worth having if they do no harm.
const GUESS_DEPENDENCE_TOLERANCE: f64 = 1e-6;

/// Why [`DenseQpSolver::solve`] ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum QpStatus {
    /// The minimum was found.
    Solved,
    /// No point meets all constraints; [`DenseQpSolver::conflict`] names some that contradict one
    /// another.
    Infeasible,
    /// The active set changed more often than it should; rounding makes the method cycle.
    NumericalTrouble,
}

/// What a solve ended with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DenseQpReport {
    /// Why the solve ended.
    pub status: QpStatus,
    /// ½ xᵀHx + gᵀx at the final point.
    pub objective: f64,
    /// Optimality and feasibility of the final point, measured afresh from the data.
    pub residuals: KktResiduals,
    /// Number of changes of the active set.
    pub iterations: usize,
}

/// Goldfarb and Idnani's dual active-set method, with its memory.
///
/// A solver may be used for programmes of any sizes one after the other; it allocates only when
/// one is larger than all before.
#[derive(Debug, Clone, Default)]
pub struct DenseQpSolver {
    n: usize,
    /// J = L⁻ᵀQ with H = LLᵀ, row-major: JᵀHJ = I, and the first q columns of J span the active
    /// normals in the metric of H⁻¹: J₁ᵀN = R, J₂ᵀN = 0.
    basis: Vec<f64>,
    /// The upper triangular q × q factor R, column after column, each padded to n entries.
    triangle: Vec<f64>,
    factor: Vec<f64>,
    x: Vec<f64>,
    active: Vec<ActiveConstraint>,
    /// How many of the active constraints, at the front of the list, are equalities.
    num_equalities: usize,
    /// Multipliers u ≥ 0 of the active constraints, in the order of `active`.
    dual: Vec<f64>,
    /// By bound, then row: whether it is active.
    is_active: Vec<bool>,
    row_norms: Vec<f64>,
    /// Coordinates Jᵀn of the constraint to be taken in.
    coordinates: Vec<f64>,
    /// Primal and dual directions.
    direction: Vec<f64>,
    dual_direction: Vec<f64>,
    conflict: Vec<QpConstraint>,
    bound_multipliers: Vec<f64>,
    row_multipliers: Vec<f64>,
    guess: Vec<ActiveConstraint>,
}

impl DenseQpSolver {
    /// A solver without memory yet.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Solves `qp` from the unconstrained minimum.
    ///
    /// # Errors
    /// Data that are not finite, contradictory bounds, or a Hessian that is not positive definite.
    /// Constraints that contradict one another are not an error but a status.
    pub fn solve(&mut self, qp: &DenseQp) -> Result<DenseQpReport, DenseQpError> {
        self.active.clear();
        self.solve_warm(qp)
    }

    /// Solves `qp` starting with the active set that the last solve ended with, as far as it fits.
    /// The solution is the same as that of [`solve`](Self::solve), up to rounding; it is found
    /// faster if the active sets are alike.
    ///
    /// # Errors
    /// As [`solve`](Self::solve).
    pub fn solve_warm(&mut self, qp: &DenseQp) -> Result<DenseQpReport, DenseQpError> {
        qp.validate()?;
        let (status, iterations) = self.solve_unchecked(qp)?;
        Ok(DenseQpReport {
            status,
            objective: qp.objective(&self.x),
            residuals: self.measure(qp),
            iterations,
        })
    }

    /// The solution x of the last solve.
    #[must_use]
    pub fn solution(&self) -> &[f64] {
        &self.x
    }

    /// Multipliers λ of the rows: Hx + g + Aᵀλ + z = 0, positive at upper bounds, negative at
    /// lower bounds.
    #[must_use]
    pub fn row_multipliers(&self) -> &[f64] {
        &self.row_multipliers
    }

    /// Multipliers z of the bounds, with the signs of [`row_multipliers`](Self::row_multipliers).
    #[must_use]
    pub fn bound_multipliers(&self) -> &[f64] {
        &self.bound_multipliers
    }

    /// The constraints that the last solve held with equality.
    #[must_use]
    pub fn active_set(&self) -> &[ActiveConstraint] {
        &self.active
    }

    /// Constraints that contradict one another, if the last solve ended as infeasible.
    #[must_use]
    pub fn conflict(&self) -> &[QpConstraint] {
        &self.conflict
    }

    /// Forgets the active set, so that the next warm start is a cold one.
    pub(crate) fn forget_active_set(&mut self) {
        self.active.clear();
    }

    /// Whether the Hessian is positive definite.
    pub(crate) fn factorises(&mut self, qp: &DenseQp) -> bool {
        let n = qp.num_variables;
        refill(&mut self.factor, n * n, 0.0);
        cholesky(&qp.hessian, &mut self.factor, n).is_ok()
    }

    /// The solve without validation of the data and without the report. Returns the status and the
    /// number of changes of the active set.
    pub(crate) fn solve_unchecked(
        &mut self,
        qp: &DenseQp,
    ) -> Result<(QpStatus, usize), DenseQpError> {
        self.prepare(qp)?;
        let (status, changes) = self.iterate(qp);
        if status == QpStatus::Solved {
            // The steps taken have added up rounding errors: end with the solution of the
            // equality-constrained problem on the final active set.
            self.solve_on_active_set(qp);
        }
        for (k, active) in self.active.iter().enumerate() {
            let multiplier = match active.side {
                Side::Lower => -self.dual[k],
                Side::Upper => self.dual[k],
            };
            match active.constraint {
                QpConstraint::Bound(j) => self.bound_multipliers[j] = multiplier,
                QpConstraint::Row(i) => self.row_multipliers[i] = multiplier,
            }
        }
        Ok((status, changes))
    }

    /// Sizes the memory, factorises H, and takes in the guessed active set.
    fn prepare(&mut self, qp: &DenseQp) -> Result<(), DenseQpError> {
        let n = qp.num_variables;
        let m = qp.num_rows();
        self.n = n;
        self.guess.clone_from(&self.active);
        self.active.clear();
        self.conflict.clear();
        self.num_equalities = 0;
        refill(&mut self.basis, n * n, 0.0);
        refill(&mut self.triangle, n * n, 0.0);
        refill(&mut self.factor, n * n, 0.0);
        for vector in [
            &mut self.x,
            &mut self.dual,
            &mut self.coordinates,
            &mut self.direction,
            &mut self.dual_direction,
            &mut self.bound_multipliers,
        ] {
            refill(vector, n, 0.0);
        }
        refill(&mut self.row_multipliers, m, 0.0);
        refill(&mut self.row_norms, m, 0.0);
        self.is_active.clear();
        self.is_active.resize(n + m, false);
        for (i, norm) in self.row_norms.iter_mut().enumerate() {
            *norm = dot(qp.row(i), qp.row(i)).sqrt();
        }
        cholesky(&qp.hessian, &mut self.factor, n)?;
        invert_transposed(&self.factor, &mut self.basis, n);
        Ok(())
    }

    fn iterate(&mut self, qp: &DenseQp) -> (QpStatus, usize) {
        let n = self.n;
        let m = qp.num_rows();
        let limit = 50 + 10 * (n + m);
        let mut changes = 0;

        self.solve_on_active_set(qp);
        // Equalities first: they are never dropped again.
        for k in 0..n + m {
            let constraint = constraint_of(k, n);
            let (lower, upper) = bounds_of(qp, constraint);
            if lower < upper {
                continue;
            }
            let side = if value_of(qp, constraint, &self.x) >= lower {
                Side::Upper
            } else {
                Side::Lower
            };
            let active = ActiveConstraint { constraint, side };
            match self.take_in(qp, active, limit, &mut changes) {
                TakenIn::Added => self.num_equalities += 1,
                TakenIn::Redundant => {}
                TakenIn::Contradiction => return (QpStatus::Infeasible, changes),
                TakenIn::Cycling => return (QpStatus::NumericalTrouble, changes),
            }
        }
        self.adopt_guess(qp);

        while let Some(violated) = self.most_violated(qp) {
            match self.take_in(qp, violated, limit, &mut changes) {
                TakenIn::Added => {}
                TakenIn::Contradiction => return (QpStatus::Infeasible, changes),
                // A violated inequality is redundant only through rounding.
                TakenIn::Redundant | TakenIn::Cycling => {
                    return (QpStatus::NumericalTrouble, changes);
                }
            }
        }
        (QpStatus::Solved, changes)
    }

    /// Takes the guessed constraints into the active set and drops those whose multipliers come
    /// out negative.
    fn adopt_guess(&mut self, qp: &DenseQp) {
        let mut guess = std::mem::take(&mut self.guess);
        for &active in &guess {
            let in_range = match active.constraint {
                QpConstraint::Bound(j) => j < self.n,
                QpConstraint::Row(i) => i < qp.num_rows(),
            };
            if !in_range || self.is_active[index_of(active.constraint, self.n)] {
                continue;
            }
            if !target_of(qp, active).is_finite() {
                continue;
            }
            self.compute_coordinates(qp, active);
            let outside = norm_squared(&self.coordinates[self.active.len()..]);
            let total = norm_squared(&self.coordinates);
            if outside > GUESS_DEPENDENCE_TOLERANCE.powi(2) * total {
                self.append(active);
            }
        }
        guess.clear();
        self.guess = guess;
        if self.active.len() == self.num_equalities {
            return;
        }
        loop {
            self.solve_on_active_set(qp);
            let worst = (self.num_equalities..self.active.len())
                .min_by(|&a, &b| self.dual[a].total_cmp(&self.dual[b]));
            match worst {
                Some(k) if self.dual[k] < 0.0 => self.remove(k),
                _ => break,
            }
        }
    }

    /// The violated inequality farthest from x, if there is one.
    fn most_violated(&self, qp: &DenseQp) -> Option<ActiveConstraint> {
        let n = self.n;
        let mut worst = None;
        let mut worst_violation = 0.0;
        let mut consider = |constraint, violation: f64, side, scale: f64| {
            if violation > worst_violation && violation > VIOLATION_TOLERANCE * scale {
                worst_violation = violation;
                worst = Some(ActiveConstraint { constraint, side });
            }
        };
        for j in 0..n {
            if self.is_active[j] || qp.lower[j] == qp.upper[j] {
                continue;
            }
            let value = self.x[j];
            let constraint = QpConstraint::Bound(j);
            let scale = 1.0 + value.abs();
            consider(constraint, qp.lower[j] - value, Side::Lower, scale);
            consider(constraint, value - qp.upper[j], Side::Upper, scale);
        }
        let size = 1.0 + norm_squared(&self.x).sqrt();
        for i in 0..qp.num_rows() {
            let (lower, upper) = (qp.row_lower[i], qp.row_upper[i]);
            if self.is_active[n + i] || lower == upper {
                continue;
            }
            let value = dot(qp.row(i), &self.x);
            // A row of zeros has no normal to measure by; it is violated by constants alone.
            let norm = if self.row_norms[i] > 0.0 {
                self.row_norms[i]
            } else {
                1.0
            };
            let constraint = QpConstraint::Row(i);
            consider(constraint, (lower - value) / norm, Side::Lower, size);
            consider(constraint, (value - upper) / norm, Side::Upper, size);
        }
        worst
    }

    /// Steps in primal and dual space until `entering` holds with equality, dropping constraints
    /// whose multipliers would become negative.
    fn take_in(
        &mut self,
        qp: &DenseQp,
        entering: ActiveConstraint,
        limit: usize,
        changes: &mut usize,
    ) -> TakenIn {
        let mut entering_dual = 0.0;
        let sign = sign_of(entering.side);
        loop {
            *changes += 1;
            if *changes > limit {
                return TakenIn::Cycling;
            }
            let q = self.active.len();
            let gap = sign * (value_of(qp, entering.constraint, &self.x) - target_of(qp, entering));
            self.compute_coordinates(qp, entering);
            let total = norm_squared(&self.coordinates);
            let outside = norm_squared(&self.coordinates[q..]);
            let dependent = outside <= DEPENDENCE_TOLERANCE.powi(2) * total;
            self.compute_dual_direction();

            // The longest step that keeps the multipliers non-negative.
            let mut dual_step = f64::INFINITY;
            let mut leaving = None;
            for k in self.num_equalities..q {
                let rate = self.dual_direction[k];
                if rate > 0.0 && self.dual[k] < dual_step * rate {
                    dual_step = self.dual[k] / rate;
                    leaving = Some(k);
                }
            }
            // The step that makes the constraint hold.
            let primal_step = if dependent {
                f64::INFINITY
            } else {
                (-gap / outside).max(0.0)
            };

            let step = match (leaving, dependent) {
                (None, true) => {
                    let scale = 1.0 + norm_squared(&self.x).sqrt();
                    let norm = norm_of(&self.row_norms, entering.constraint);
                    if gap >= -1e3 * VIOLATION_TOLERANCE * scale * norm.max(f64::MIN_POSITIVE)
                        && bounds_of(qp, entering.constraint).0
                            == bounds_of(qp, entering.constraint).1
                    {
                        return TakenIn::Redundant;
                    }
                    self.record_conflict(entering.constraint);
                    return TakenIn::Contradiction;
                }
                _ => dual_step.min(primal_step),
            };
            if !dependent {
                for j in 0..self.n {
                    let row = &self.basis[j * self.n..(j + 1) * self.n];
                    self.direction[j] = dot(&row[q..], &self.coordinates[q..]);
                }
                for (x, direction) in self.x.iter_mut().zip(&self.direction) {
                    *x += step * direction;
                }
            }
            for k in 0..q {
                self.dual[k] -= step * self.dual_direction[k];
            }
            entering_dual += step;
            match leaving {
                Some(k) if dual_step < primal_step => self.remove(k),
                _ => {
                    self.append(entering);
                    self.dual[q] = entering_dual;
                    return TakenIn::Added;
                }
            }
        }
    }

    /// The contradiction: n = Σ rₖ nₖ with rₖ ≤ 0 for every active inequality.
    fn record_conflict(&mut self, entering: QpConstraint) {
        let size = self.dual_direction[..self.active.len()]
            .iter()
            .fold(0.0_f64, |a, r| a.max(r.abs()));
        self.conflict.push(entering);
        for (k, active) in self.active.iter().enumerate() {
            if self.dual_direction[k].abs() > 1e-9 * size {
                self.conflict.push(active.constraint);
            }
        }
    }

    /// `coordinates` = Jᵀ n for the normal n that points into the feasible side.
    fn compute_coordinates(&mut self, qp: &DenseQp, active: ActiveConstraint) {
        let n = self.n;
        let sign = sign_of(active.side);
        match active.constraint {
            QpConstraint::Bound(j) => {
                for (c, b) in self.coordinates.iter_mut().zip(&self.basis[j * n..]) {
                    *c = sign * b;
                }
            }
            QpConstraint::Row(i) => {
                self.coordinates.fill(0.0);
                for (j, &a) in qp.row(i).iter().enumerate() {
                    if a != 0.0 {
                        axpy(
                            sign * a,
                            &self.basis[j * n..(j + 1) * n],
                            &mut self.coordinates,
                        );
                    }
                }
            }
        }
    }

    /// `dual_direction` = R⁻¹ (Jᵀn)₁.
    fn compute_dual_direction(&mut self) {
        let q = self.active.len();
        self.dual_direction[..q].copy_from_slice(&self.coordinates[..q]);
        solve_upper(&self.triangle, self.n, &mut self.dual_direction[..q]);
    }

    /// Appends the constraint whose coordinates have been computed: rotates J so that only the
    /// first of the coordinates outside the active span remains.
    fn append(&mut self, active: ActiveConstraint) {
        let n = self.n;
        let q = self.active.len();
        for k in (q + 1..n).rev() {
            let (c, s, r) = givens(self.coordinates[k - 1], self.coordinates[k]);
            if s == 0.0 {
                continue;
            }
            self.coordinates[k - 1] = r;
            self.coordinates[k] = 0.0;
            rotate_columns(&mut self.basis, n, k - 1, c, s);
        }
        self.triangle[q * n..q * n + q + 1].copy_from_slice(&self.coordinates[..=q]);
        self.active.push(active);
        self.is_active[index_of(active.constraint, n)] = true;
    }

    /// Removes the k-th active constraint and restores the triangular form of R.
    fn remove(&mut self, k: usize) {
        let n = self.n;
        let active = self.active.remove(k);
        self.is_active[index_of(active.constraint, n)] = false;
        let q = self.active.len();
        self.dual.copy_within(k + 1..=q, k);
        for column in k..q {
            let next = (column + 1) * n;
            self.triangle
                .copy_within(next..next + column + 2, column * n);
            // The column now reaches one entry below the diagonal: rotate it away.
            let (c, s, r) = givens(
                self.triangle[column * n + column],
                self.triangle[column * n + column + 1],
            );
            self.triangle[column * n + column] = r;
            self.triangle[column * n + column + 1] = 0.0;
            if s == 0.0 {
                continue;
            }
            for later in column + 2..=q {
                let entry = later * n + column;
                let (a, b) = (self.triangle[entry], self.triangle[entry + 1]);
                self.triangle[entry] = c * a + s * b;
                self.triangle[entry + 1] = c * b - s * a;
            }
            rotate_columns(&mut self.basis, n, column, c, s);
        }
    }

    /// x and u of the problem in which the active constraints are equalities:
    /// x = J₁R⁻ᵀb − J₂J₂ᵀg and u = R⁻¹(R⁻ᵀb + J₁ᵀg).
    fn solve_on_active_set(&mut self, qp: &DenseQp) {
        let n = self.n;
        let q = self.active.len();
        let along = &mut self.direction;
        for (k, active) in self.active.iter().enumerate() {
            let column = &self.triangle[k * n..k * n + k];
            let value = sign_of(active.side) * target_of(qp, *active) - dot(column, &along[..k]);
            along[k] = value / self.triangle[k * n + k];
        }
        // Jᵀg
        self.coordinates.fill(0.0);
        for (j, &g) in qp.gradient.iter().enumerate() {
            axpy(g, &self.basis[j * n..(j + 1) * n], &mut self.coordinates);
        }
        let (inside, outside) = along.split_at_mut(q);
        for (dual, (a, c)) in self
            .dual
            .iter_mut()
            .zip(inside.iter().zip(&self.coordinates))
        {
            *dual = a + c;
        }
        for (a, c) in outside.iter_mut().zip(&self.coordinates[q..]) {
            *a = -c;
        }
        for j in 0..n {
            self.x[j] = dot(&self.basis[j * n..(j + 1) * n], along);
        }
        solve_upper(&self.triangle, n, &mut self.dual[..q]);
    }

    /// Residuals of the optimality conditions, from the data.
    fn measure(&self, qp: &DenseQp) -> KktResiduals {
        let mut residuals = KktResiduals::default();
        let mut size = 0.0_f64;
        for j in 0..self.n {
            let mut terms = [
                dot(&qp.hessian[j * self.n..(j + 1) * self.n], &self.x),
                qp.gradient[j],
                self.bound_multipliers[j],
                0.0,
            ];
            for i in 0..qp.num_rows() {
                terms[3] += self.row_multipliers[i] * qp.row(i)[j];
            }
            let sum: f64 = terms.iter().sum();
            residuals.stationarity = residuals.stationarity.max(sum.abs());
            size = terms.iter().fold(size, |a, t| a.max(t.abs()));
        }
        if size > 0.0 {
            residuals.relative_stationarity = residuals.stationarity / size;
        }
        for k in 0..self.n + qp.num_rows() {
            let constraint = constraint_of(k, self.n);
            let (lower, upper) = bounds_of(qp, constraint);
            let multiplier = match constraint {
                QpConstraint::Bound(j) => self.bound_multipliers[j],
                QpConstraint::Row(i) => self.row_multipliers[i],
            };
            residuals.include(value_of(qp, constraint, &self.x), lower, upper, multiplier);
        }
        residuals
    }
}

enum TakenIn {
    Added,
    Redundant,
    Contradiction,
    Cycling,
}
