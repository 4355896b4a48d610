//! The problem classes as traits: what a user of this crate implements.
//!
//! Every method takes `&mut self`, so that an implementation may keep scratch memory and reuse at
//! one point what it has computed there before (a solver asks for the derivatives at a point only
//! after it has asked for the values there).

use crate::error::{BoundKind, ProblemError};
use nalgebra::DMatrix;

/// A smooth function to minimise without constraints: min f(x), x ∈ ℝⁿ.
///
/// A value that is NaN or infinite tells the solver that x lies outside the domain of f; line
/// searches then shorten the step.
pub trait SmoothFunction {
    /// Number of variables n.
    fn num_variables(&self) -> usize;

    /// f(x).
    fn value(&mut self, x: &[f64]) -> f64;

    /// f(x), with ∇f(x) written into `gradient` (length n).
    fn value_and_gradient(&mut self, x: &[f64], gradient: &mut [f64]) -> f64;
}

/// A nonlinear least-squares problem: min ½‖r(x)‖², x ∈ ℝⁿ, r(x) ∈ ℝᵐ.
///
/// m may be smaller than, equal to or larger than n, and the Jacobian may be rank-deficient.
pub trait LeastSquares {
    /// Number of variables n.
    fn num_variables(&self) -> usize;

    /// Number of residuals m.
    fn num_residuals(&self) -> usize;

    /// Writes r(x) into `residuals` (length m).
    fn residuals(&mut self, x: &[f64], residuals: &mut [f64]);

    /// Writes ∂r/∂x at `x` into `jacobian` (m × n). The matrix still holds the values of an
    /// earlier call: entries that are always zero need to be written only once.
    fn jacobian(&mut self, x: &[f64], jacobian: &mut DMatrix<f64>);
}

/// A nonlinear programme with a sparse Jacobian of fixed pattern:
///
/// ```text
/// minimise    f(x)                       x ∈ ℝⁿ
/// subject to  l ≤ c(x) ≤ u               c(x) ∈ ℝᵐ
///             x_l ≤ x ≤ x_u
/// ```
///
/// An equality is a constraint with l = u; an absent bound is ±[`f64::INFINITY`] (a large number
/// in its place spoils the scaling). A variable with equal bounds is fixed and costs nothing.
///
/// The Lagrangian is L(x, λ, z) = f(x) + λᵀc(x) + zᵀx: multipliers are positive at upper bounds
/// and negative at lower bounds.
///
/// # Examples
///
/// Minimise (x₀ − 2)² + (x₁ − 1)² inside the unit disc:
///
/// ```
/// use tensegra_optim::{Hessian, Nlp, TripletPattern};
///
/// struct Disc;
///
/// impl Nlp for Disc {
///     fn num_variables(&self) -> usize { 2 }
///     fn num_constraints(&self) -> usize { 1 }
///     fn constraint_bounds(&self, _lower: &mut [f64], upper: &mut [f64]) {
///         upper[0] = 1.0; // lower stays −∞
///     }
///     fn jacobian_pattern(&self) -> TripletPattern {
///         TripletPattern::dense(1, 2)
///     }
///     fn objective(&mut self, x: &[f64]) -> f64 {
///         (x[0] - 2.0).powi(2) + (x[1] - 1.0).powi(2)
///     }
///     fn gradient(&mut self, x: &[f64], gradient: &mut [f64]) {
///         gradient[0] = 2.0 * (x[0] - 2.0);
///         gradient[1] = 2.0 * (x[1] - 1.0);
///     }
///     fn constraints(&mut self, x: &[f64], values: &mut [f64]) {
///         values[0] = x[0] * x[0] + x[1] * x[1];
///     }
///     fn jacobian(&mut self, x: &[f64], values: &mut [f64]) {
///         values[0] = 2.0 * x[0];
///         values[1] = 2.0 * x[1];
///     }
///     fn hessian_kind(&self) -> Hessian { Hessian::Lagrangian }
///     fn hessian_pattern(&self) -> TripletPattern {
///         TripletPattern::diagonal(2)
///     }
///     fn hessian(&mut self, _x: &[f64], weight: f64, multipliers: &[f64], values: &mut [f64]) {
///         values.fill(2.0 * (weight + multipliers[0]));
///     }
/// }
/// ```
pub trait Nlp {
    /// Number of variables n.
    fn num_variables(&self) -> usize;

    /// Number of constraints m (bounds on variables are not counted).
    fn num_constraints(&self) -> usize;

    /// Writes the bounds of the variables (length n each). The slices arrive filled with −∞ and
    /// +∞; the default leaves every variable free.
    fn variable_bounds(&self, _lower: &mut [f64], _upper: &mut [f64]) {}

    /// Writes the bounds of the constraints (length m each). The slices arrive filled with −∞
    /// and +∞.
    fn constraint_bounds(&self, lower: &mut [f64], upper: &mut [f64]);

    /// Writes a typical magnitude of change of each variable (length n, arrives filled with 1).
    /// The trust region is the box |dⱼ| ≤ Δ·scaleⱼ.
    fn variable_scales(&self, _scales: &mut [f64]) {}

    /// Positions (constraint, variable) of the entries of the Jacobian ∂c/∂x. Called once for
    /// each solve. Entries that occur twice are summed.
    fn jacobian_pattern(&self) -> TripletPattern;

    /// f(x). NaN or infinity says that x lies outside the domain; the solver then steps back.
    fn objective(&mut self, x: &[f64]) -> f64;

    /// Writes ∇f(x) into `gradient` (length n).
    fn gradient(&mut self, x: &[f64], gradient: &mut [f64]);

    /// Writes c(x) into `values` (length m).
    fn constraints(&mut self, x: &[f64], values: &mut [f64]);

    /// Writes the entries of ∂c/∂x at `x` into `values`, in the order of the pattern.
    fn jacobian(&mut self, x: &[f64], values: &mut [f64]);

    /// Which second derivatives [`hessian`](Nlp::hessian) supplies; by default none.
    fn hessian_kind(&self) -> Hessian {
        Hessian::QuasiNewton
    }

    /// Positions of the entries of the Hessian, one for each symmetric pair (in either triangle).
    /// Called once for each solve. Entries that occur twice are summed.
    fn hessian_pattern(&self) -> TripletPattern {
        TripletPattern::new()
    }

    /// Writes the entries of `weight`·∇²f(x) + Σ multipliersᵢ·∇²cᵢ(x) into `values`, in the order
    /// of the pattern. For [`Hessian::Convex`] any positive semidefinite substitute, such as
    /// `weight` times the Gauss–Newton matrix of a sum of squares.
    fn hessian(&mut self, _x: &[f64], _weight: f64, _multipliers: &[f64], _values: &mut [f64]) {}
}

/// What an [`Nlp`] says about its second derivatives.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Hessian {
    /// Nothing: the solver builds a dense quasi-Newton approximation (damped BFGS) from
    /// gradients. Right for small problems; memory n², and the sparsity of a large one is lost.
    #[default]
    QuasiNewton,
    /// A positive semidefinite matrix, which is used as it is: the Hessian of a convex objective,
    /// or a Gauss–Newton matrix. Convergence is linear in general, fast when the multipliers or
    /// the curvature of the constraints are small, and quadratic when as many constraints are
    /// active as there are variables.
    Convex,
    /// The exact Hessian of the Lagrangian, definite or not: the solver convexifies it.
    Lagrangian,
}

/// Positions of the entries of a sparse matrix in coordinate form.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct TripletPattern {
    rows: Vec<usize>,
    columns: Vec<usize>,
}

impl TripletPattern {
    /// The pattern without entries.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// All entries of a `rows` × `columns` matrix, row after row.
    #[must_use]
    pub fn dense(rows: usize, columns: usize) -> Self {
        let mut pattern = Self::default();
        for row in 0..rows {
            pattern.push_row(row, 0..columns);
        }
        pattern
    }

    /// The diagonal of an `order` × `order` matrix.
    #[must_use]
    pub fn diagonal(order: usize) -> Self {
        Self {
            rows: (0..order).collect(),
            columns: (0..order).collect(),
        }
    }

    /// The lower triangle of an `order` × `order` matrix, diagonal included, row after row.
    #[must_use]
    pub fn lower_triangle(order: usize) -> Self {
        let mut pattern = Self::default();
        for row in 0..order {
            pattern.push_row(row, 0..=row);
        }
        pattern
    }

    /// Appends one entry.
    pub fn push(&mut self, row: usize, column: usize) {
        self.rows.push(row);
        self.columns.push(column);
    }

    /// Appends the entries of one row in the given columns.
    pub fn push_row(&mut self, row: usize, columns: impl IntoIterator<Item = usize>) {
        for column in columns {
            self.push(row, column);
        }
    }

    /// Number of entries.
    #[must_use]
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Whether there are no entries.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Row of each entry.
    #[must_use]
    pub fn rows(&self) -> &[usize] {
        &self.rows
    }

    /// Column of each entry.
    #[must_use]
    pub fn columns(&self) -> &[usize] {
        &self.columns
    }

    /// The entries as (row, column).
    pub fn iter(&self) -> impl ExactSizeIterator<Item = (usize, usize)> + Clone + '_ {
        self.rows.iter().copied().zip(self.columns.iter().copied())
    }
}

/// Checks the length of a slice against the problem's dimension.
pub(crate) fn check_length(
    what: &'static str,
    expected: usize,
    found: usize,
) -> Result<(), ProblemError> {
    if expected == found {
        Ok(())
    } else {
        Err(ProblemError::WrongLength {
            what,
            expected,
            found,
        })
    }
}

/// Checks that a pattern lies inside its matrix.
pub(crate) fn check_pattern(
    matrix: &'static str,
    pattern: &TripletPattern,
    rows: usize,
    columns: usize,
) -> Result<(), ProblemError> {
    match pattern
        .iter()
        .position(|(row, column)| row >= rows || column >= columns)
    {
        None => Ok(()),
        Some(entry) => Err(ProblemError::PatternOutOfRange {
            matrix,
            entry,
            row: pattern.rows[entry],
            column: pattern.columns[entry],
            rows,
            columns,
        }),
    }
}

/// Checks that every pair of bounds leaves room for a value.
pub(crate) fn check_bounds(
    kind: BoundKind,
    lower: &[f64],
    upper: &[f64],
) -> Result<(), ProblemError> {
    for (index, (&l, &u)) in lower.iter().zip(upper).enumerate() {
        let ordered = l <= u && l < f64::INFINITY && u > f64::NEG_INFINITY;
        if !ordered {
            return Err(ProblemError::ContradictoryBounds {
                kind,
                index,
                lower: l,
                upper: u,
            });
        }
    }
    Ok(())
}
