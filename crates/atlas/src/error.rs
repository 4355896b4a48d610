//! What can go wrong on a manifold.

/// Why a point could not be put on the manifold or a chart could not be built.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ManifoldError {
    /// The iteration towards the manifold did not converge.
    #[error(
        "no point of the manifold found nearby: the residual is still {residual:.3e} after \
         {iterations} iterations (worst in equation {equation})"
    )]
    NotConverged {
        /// Largest residual reached.
        residual: f64,
        /// Iterations made.
        iterations: usize,
        /// Index of the equation with the largest residual.
        equation: usize,
    },
    /// The rank of the Jacobian is smaller than on the rest of the manifold.
    #[error(
        "the point is singular: the Jacobian has rank {rank} there instead of {expected} (last \
         pivot ratio {pivot_ratio:.1e})"
    )]
    Singular {
        /// Rank found.
        rank: usize,
        /// Rank expected.
        expected: usize,
        /// Ratio of the last pivot to the first.
        pivot_ratio: f64,
    },
    /// The dimension at two points differs.
    #[error("the manifold has dimension {first} at one point and {second} at the other")]
    DimensionChanges {
        /// Dimension at the first point.
        first: usize,
        /// Dimension at the second point.
        second: usize,
    },
    /// A point is not on the manifold.
    #[error(
        "it is not on the manifold: equation {equation} has residual {residual:.3e} there; \
         `project` moves a point onto it"
    )]
    NotOnManifold {
        /// Largest residual.
        residual: f64,
        /// Index of the equation with that residual.
        equation: usize,
    },
    /// The manifold has too many or too few of something.
    #[error("the manifold has {found} {what} instead of {expected}")]
    WrongCount {
        /// Of what.
        what: &'static str,
        /// Number found.
        found: usize,
        /// Number expected.
        expected: usize,
    },
    /// A derivative is not a finite number.
    #[error("the derivative of equation {equation} by variable {variable} is {value}")]
    Derivative {
        /// Index of the equation.
        equation: usize,
        /// Index of the variable.
        variable: usize,
        /// Its value.
        value: f64,
    },
    /// The Jacobian does not agree with differences of the equations.
    #[error(
        "the Jacobian states {stated:.6e} for the derivative of equation {equation} by variable \
         {variable}, and differences give {difference:.6e}"
    )]
    WrongDerivative {
        /// Index of the equation.
        equation: usize,
        /// Index of the variable.
        variable: usize,
        /// The Jacobian's entry, 0 where its pattern has none.
        stated: f64,
        /// The difference quotient.
        difference: f64,
    },
    /// A coordinate is not a finite number.
    #[error("coordinate {index} of the point is {value}")]
    NotFinite {
        /// Index of the coordinate.
        index: usize,
        /// Its value.
        value: f64,
    },
    /// A point has too many or too few coordinates.
    #[error("the point has {found} coordinates, the manifold's have {expected}")]
    WrongLength {
        /// Number of its coordinates.
        found: usize,
        /// Number of variables of the manifold.
        expected: usize,
    },
}
