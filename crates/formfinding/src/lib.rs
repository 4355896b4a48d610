//! Form-finding of tensegrity structures: configurations in stable equilibrium, free of collisions.
//!
//! One module answers one question. None of them draws random numbers unless a seed is given, and
//! all of them are silent.

mod collision_free;
mod cylinders;
mod error;
mod follow;
mod frame;
mod program;
mod start;
mod stiffness;

pub use collision_free::{Form, FormProblem, Forms, RESIDUAL};
pub use error::{FormError, Unmet};
pub use follow::{FollowOptions, FollowStop, Followed, follow};
pub use frame::Group;
pub use stiffness::{LeastStiffness, Softest};
