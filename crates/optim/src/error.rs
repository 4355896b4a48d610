//! Errors of bad input. Whether a well-posed problem could be solved is not an error: it is the
//! status in a solver's report.

use thiserror::Error;

/// A problem that no solver can start on.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum ProblemError {
    /// A slice handed to a solver does not have the problem's dimension.
    #[error(
        "{what} has {found} entries where the problem has {expected}: pass a slice of length {expected}"
    )]
    WrongLength {
        /// The slice concerned, such as "the starting point".
        what: &'static str,
        /// The length that the problem's dimensions demand.
        expected: usize,
        /// The length found.
        found: usize,
    },
    /// A bound is NaN, or a lower bound lies above its upper bound.
    #[error(
        "the {kind} {index} has the bounds [{lower}, {upper}], which no value meets: order them, and write infinity where there is no bound"
    )]
    ContradictoryBounds {
        /// Whether a variable or a constraint is concerned.
        kind: BoundKind,
        /// Index of the variable or constraint.
        index: usize,
        /// Lower bound found.
        lower: f64,
        /// Upper bound found.
        upper: f64,
    },
    /// A triplet of a sparsity pattern lies outside its matrix.
    #[error(
        "entry {entry} of the {matrix} pattern is at ({row}, {column}), outside a matrix of {rows} rows and {columns} columns"
    )]
    PatternOutOfRange {
        /// The matrix concerned, "Jacobian" or "Hessian".
        matrix: &'static str,
        /// Index of the triplet.
        entry: usize,
        /// Row of the triplet.
        row: usize,
        /// Column of the triplet.
        column: usize,
        /// Number of rows of the matrix.
        rows: usize,
        /// Number of columns of the matrix.
        columns: usize,
    },
    /// A variable's scale is not a positive, finite number.
    #[error("the scale of variable {index} is {scale}: it must be positive and finite")]
    BadScale {
        /// Index of the variable.
        index: usize,
        /// The scale found.
        scale: f64,
    },
    /// A coordinate of the starting point is NaN or infinite.
    #[error("coordinate {index} of the starting point is {value}: start from a finite point")]
    StartNotFinite {
        /// Index of the coordinate.
        index: usize,
        /// The value found.
        value: f64,
    },
    /// A function of the problem is NaN or infinite at the starting point.
    #[error(
        "the {what} (entry {index}) is {value} at the starting point: start from a point where every function of the problem and its derivative is finite"
    )]
    NotFiniteAtStart {
        /// The function concerned, such as "objective" or "constraint Jacobian".
        what: &'static str,
        /// Index of the entry in the function's output.
        index: usize,
        /// The value found.
        value: f64,
    },
}

/// Which kind of bound is contradictory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BoundKind {
    /// The bounds of a variable.
    Variable,
    /// The bounds of a constraint.
    Constraint,
}

impl std::fmt::Display for BoundKind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            BoundKind::Variable => "variable",
            BoundKind::Constraint => "constraint",
        })
    }
}

/// An option outside its range.
#[derive(Debug, Clone, PartialEq, Error)]
#[error("the option `{name}` is {value}: it must {requirement}")]
pub struct OptionError {
    /// Name of the option.
    pub name: &'static str,
    /// The value given, as text.
    pub value: String,
    /// What the value has to satisfy, such as "be positive".
    pub requirement: &'static str,
}
