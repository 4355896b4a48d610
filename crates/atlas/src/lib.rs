//! Implicit manifolds F(x) = 0 and their atlases: charts, exponential and
//! logarithmic maps, continuation.
//!
//! Nothing here knows of structures or robots: anything with equations, a
//! sparse Jacobian and ranges can be explored.

mod manifold;

pub use manifold::{ImplicitManifold, SparseRow, SparsityPattern};
