//! The data of a dense quadratic programme, and its constraints by name.

use crate::vector::{dot, refill};
use thiserror::Error;

/// The data of a dense, strictly convex quadratic programme:
/// min ½ xᵀHx + gᵀx subject to l ≤ Ax ≤ u and x_l ≤ x ≤ x_u.
///
/// # Examples
///
/// The point of x₀ + x₁ = 1, x₀ ≥ 0.8 nearest to the origin:
///
/// ```
/// use tensegra_optim::{DenseQp, DenseQpSolver, QpStatus};
///
/// let mut qp = DenseQp::new(2);
/// qp.set_hessian(0, 0, 1.0);
/// qp.set_hessian(1, 1, 1.0);
/// qp.push_equality(&[1.0, 1.0], 1.0);
/// qp.push_at_least(&[1.0, 0.0], 0.8);
///
/// let mut solver = DenseQpSolver::new();
/// let report = solver.solve(&qp)?;
/// assert_eq!(report.status, QpStatus::Solved);
/// assert!((solver.solution()[0] - 0.8).abs() < 1e-14);
/// assert!((solver.solution()[1] - 0.2).abs() < 1e-14);
/// # Ok::<(), tensegra_optim::DenseQpError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct DenseQp {
    pub(super) num_variables: usize,
    /// Row-major n × n, both triangles kept equal.
    pub(super) hessian: Vec<f64>,
    pub(super) gradient: Vec<f64>,
    pub(super) lower: Vec<f64>,
    pub(super) upper: Vec<f64>,
    /// Row-major m × n.
    pub(super) rows: Vec<f64>,
    pub(super) row_lower: Vec<f64>,
    pub(super) row_upper: Vec<f64>,
}

impl DenseQp {
    /// A programme in `num_variables` free variables with H = 0, g = 0 and no constraints. H has
    /// to be made positive definite before it is solved.
    #[must_use]
    pub fn new(num_variables: usize) -> Self {
        let mut qp = Self {
            num_variables: 0,
            hessian: Vec::new(),
            gradient: Vec::new(),
            lower: Vec::new(),
            upper: Vec::new(),
            rows: Vec::new(),
            row_lower: Vec::new(),
            row_upper: Vec::new(),
        };
        qp.reset(num_variables);
        qp
    }

    /// Makes this the programme that [`new`](Self::new) returns, keeping its memory.
    pub fn reset(&mut self, num_variables: usize) {
        let n = num_variables;
        self.num_variables = n;
        refill(&mut self.hessian, n * n, 0.0);
        refill(&mut self.gradient, n, 0.0);
        refill(&mut self.lower, n, f64::NEG_INFINITY);
        refill(&mut self.upper, n, f64::INFINITY);
        self.clear_rows();
    }

    /// Removes all rows of A.
    pub fn clear_rows(&mut self) {
        self.rows.clear();
        self.row_lower.clear();
        self.row_upper.clear();
    }

    /// Number of variables n.
    #[must_use]
    pub fn num_variables(&self) -> usize {
        self.num_variables
    }

    /// Number of rows m of A.
    #[must_use]
    pub fn num_rows(&self) -> usize {
        self.row_lower.len()
    }

    /// Sets the entries (i, j) and (j, i) of H.
    ///
    /// # Panics
    /// If i or j is not a variable.
    pub fn set_hessian(&mut self, i: usize, j: usize, value: f64) {
        let n = self.num_variables;
        assert!(i < n && j < n, "no variables {i}, {j} among {n}");
        self.hessian[i * n + j] = value;
        self.hessian[j * n + i] = value;
    }

    /// Adds to the entries (i, j) and (j, i) of H.
    pub(crate) fn add_hessian(&mut self, i: usize, j: usize, value: f64) {
        let sum = self.hessian[i * self.num_variables + j] + value;
        self.set_hessian(i, j, sum);
    }

    /// The gradient g at the origin (length n).
    pub fn gradient_mut(&mut self) -> &mut [f64] {
        &mut self.gradient
    }

    /// Sets the bounds of variable j; infinite where there is none.
    ///
    /// # Panics
    /// If j is not a variable.
    pub fn set_bounds(&mut self, j: usize, lower: f64, upper: f64) {
        self.lower[j] = lower;
        self.upper[j] = upper;
    }

    /// Appends the row `lower` ≤ aᵀx ≤ `upper`.
    ///
    /// # Panics
    /// If `normal` does not have n entries.
    pub fn push_range(&mut self, normal: &[f64], lower: f64, upper: f64) {
        assert_eq!(normal.len(), self.num_variables, "entries of the normal");
        self.rows.extend_from_slice(normal);
        self.row_lower.push(lower);
        self.row_upper.push(upper);
    }

    /// Appends the row aᵀx = `value`.
    ///
    /// # Panics
    /// If `normal` does not have n entries.
    pub fn push_equality(&mut self, normal: &[f64], value: f64) {
        self.push_range(normal, value, value);
    }

    /// Appends the row aᵀx ≥ `value`.
    ///
    /// # Panics
    /// If `normal` does not have n entries.
    pub fn push_at_least(&mut self, normal: &[f64], value: f64) {
        self.push_range(normal, value, f64::INFINITY);
    }

    /// ½ xᵀHx + gᵀx.
    ///
    /// # Panics
    /// If `x` does not have n entries.
    #[must_use]
    pub fn objective(&self, x: &[f64]) -> f64 {
        assert_eq!(x.len(), self.num_variables, "entries of x");
        let mut value = 0.0;
        for (i, row) in self.hessian.chunks_exact(x.len().max(1)).enumerate() {
            value += x[i] * (0.5 * dot(row, x) + self.gradient[i]);
        }
        value
    }

    /// The normal of row i.
    pub(super) fn row(&self, i: usize) -> &[f64] {
        &self.rows[i * self.num_variables..(i + 1) * self.num_variables]
    }

    /// Overwrites the bounds of a row.
    pub(crate) fn set_row_bounds(&mut self, i: usize, lower: f64, upper: f64) {
        self.row_lower[i] = lower;
        self.row_upper[i] = upper;
    }

    /// Refuses data that are not finite, and bounds that no value meets.
    pub(super) fn validate(&self) -> Result<(), DenseQpError> {
        let finite = |values: &[f64]| values.iter().all(|v| v.is_finite());
        for (what, values) in [
            ("Hessian", &self.hessian),
            ("gradient", &self.gradient),
            ("rows", &self.rows),
        ] {
            if !finite(values) {
                return Err(DenseQpError::NotFinite { what });
            }
        }
        let ordered = |l: f64, u: f64| l <= u && l < f64::INFINITY && u > f64::NEG_INFINITY;
        for j in 0..self.num_variables {
            if !ordered(self.lower[j], self.upper[j]) {
                return Err(DenseQpError::ContradictoryBounds {
                    constraint: QpConstraint::Bound(j),
                    lower: self.lower[j],
                    upper: self.upper[j],
                });
            }
        }
        for i in 0..self.num_rows() {
            if !ordered(self.row_lower[i], self.row_upper[i]) {
                return Err(DenseQpError::ContradictoryBounds {
                    constraint: QpConstraint::Row(i),
                    lower: self.row_lower[i],
                    upper: self.row_upper[i],
                });
            }
        }
        Ok(())
    }
}

/// A constraint of a [`DenseQp`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum QpConstraint {
    /// The bounds of a variable.
    Bound(usize),
    /// A row of A.
    Row(usize),
}

/// Which bound of a constraint holds with equality.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Side {
    /// The lower bound.
    Lower,
    /// The upper bound.
    Upper,
}

/// A constraint that holds with equality at the solution.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct ActiveConstraint {
    /// The constraint.
    pub constraint: QpConstraint,
    /// The bound it is held at; for an equality, the side that it was reached from.
    pub side: Side,
}

/// Why a [`DenseQp`] cannot be solved.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
#[non_exhaustive]
pub enum DenseQpError {
    /// H is not positive definite to working precision.
    #[error(
        "the Hessian is not positive definite (pivot {pivot} is {value:e}): add a positive multiple of the identity"
    )]
    NotPositiveDefinite {
        /// The row at which the Cholesky factorisation broke down.
        pivot: usize,
        /// The pivot found there.
        value: f64,
    },
    /// The data hold a NaN or an infinity.
    #[error("the {what} of the quadratic programme hold a value that is not finite")]
    NotFinite {
        /// The part of the data concerned.
        what: &'static str,
    },
    /// A lower bound above its upper bound, NaN, or an infinity of the wrong sign.
    #[error("{constraint:?} has the bounds [{lower}, {upper}], which no value meets")]
    ContradictoryBounds {
        /// The constraint.
        constraint: QpConstraint,
        /// Its lower bound.
        lower: f64,
        /// Its upper bound.
        upper: f64,
    },
}

/// The k-th constraint: the bounds, then the rows.
pub(super) fn constraint_of(k: usize, n: usize) -> QpConstraint {
    if k < n {
        QpConstraint::Bound(k)
    } else {
        QpConstraint::Row(k - n)
    }
}

/// Its number.
pub(super) fn index_of(constraint: QpConstraint, n: usize) -> usize {
    match constraint {
        QpConstraint::Bound(j) => j,
        QpConstraint::Row(i) => n + i,
    }
}

/// Its lower and its upper bound.
pub(super) fn bounds_of(qp: &DenseQp, constraint: QpConstraint) -> (f64, f64) {
    match constraint {
        QpConstraint::Bound(j) => (qp.lower[j], qp.upper[j]),
        QpConstraint::Row(i) => (qp.row_lower[i], qp.row_upper[i]),
    }
}

/// Its value at x.
pub(super) fn value_of(qp: &DenseQp, constraint: QpConstraint, x: &[f64]) -> f64 {
    match constraint {
        QpConstraint::Bound(j) => x[j],
        QpConstraint::Row(i) => dot(qp.row(i), x),
    }
}

/// The norm of its normal.
pub(super) fn norm_of(row_norms: &[f64], constraint: QpConstraint) -> f64 {
    match constraint {
        QpConstraint::Bound(_) => 1.0,
        QpConstraint::Row(i) => row_norms[i],
    }
}

/// The bound that it is held at.
pub(super) fn target_of(qp: &DenseQp, active: ActiveConstraint) -> f64 {
    let (lower, upper) = bounds_of(qp, active.constraint);
    match active.side {
        Side::Lower => lower,
        Side::Upper => upper,
    }
}

/// The sign of the normal that points into the feasible side.
pub(super) fn sign_of(side: Side) -> f64 {
    match side {
        Side::Lower => 1.0,
        Side::Upper => -1.0,
    }
}
