//! Implicit manifolds F(x) = 0 and their atlases: charts, exponential and
//! logarithmic maps, continuation.
//!
//! Nothing here knows of structures or robots: anything with equations, a
//! sparse Jacobian and ranges can be explored. Implement [`ImplicitManifold`],
//! see that its Jacobian is right with [`check_jacobian`], put a point on it with
//! [`project`], ask for its [`dimension`], and build [`Chart`]s or a whole [`Atlas`].

mod atlas;
mod chart;
mod contacts;
mod continuation;
pub mod doc;
mod error;
mod input;
mod manifold;
mod newton;
mod packed;
mod polytope;
mod qr;
mod validity;

pub use atlas::{Atlas, ChartDomain, Cut};
pub use chart::{Chart, ProjectionFailed, Workspace};
pub use contacts::{ContactRow, Contacts};
pub use continuation::{
    BilliardWalk, Border, ComponentAtlas, Continuation, ContinuationError, ContinuationOptions,
    Corner, Exploration, OutlinePoint, Route, RouteError, RouteOptions,
};
pub use error::ManifoldError;
pub use input::{check_jacobian, on_manifold};
pub use manifold::{ImplicitManifold, SparseRow, SparsityPattern};
pub use newton::{dimension, project};
pub use packed::PackedPoints;
pub use polytope::{Facet, Polytope, Vertex};
pub use validity::{Everywhere, Obstruction, Predicate, Validity};
