//! Form-finding of tensegrity structures: configurations in stable equilibrium.
//!
//! | given | wanted | with |
//! |---|---|---|
//! | topology, ranges, conditions | forms free of collisions | [`FormProblem`], [`follow`] |
//! | rest lengths, a start | node positions | [`DirectSolver`] |
//! | node positions | rest lengths and forces | [`rest_lengths`] |
//! | force densities | node positions | [`force_density_positions`], [`free_standing_shape`] |
//! | a structure and an element less | what becomes of it | [`losses`] |
//!
//! Units are those of the structure. Nothing here draws random numbers unless a
//! seed is given, and all of it is silent.

mod alignment;
mod collision_free;
mod cylinders;
mod direct;
mod error;
mod follow;
mod followers;
mod force_density;
mod frame;
mod inverse;
mod loss;
mod outline;
mod program;
mod search;
mod start;

pub use alignment::alignment;
pub use collision_free::{Form, FormProblem, Forms, RESIDUAL};
pub use direct::{DirectError, DirectForm, DirectOptions, DirectSolver};
pub use error::{FormError, Unmet};
pub use follow::{FollowOptions, FollowStop, Followed, follow};
pub use force_density::{
    ForceDensityError, critical_force_density, force_density_positions, free_standing_shape,
};
pub use frame::Group;
pub use inverse::{InverseError, InverseForm, InverseOptions, rest_lengths};
pub use loss::{Loss, losses};
