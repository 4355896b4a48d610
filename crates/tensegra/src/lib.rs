//! Motion planning of tensegrity structures and truss robots.
//!
//! This crate gathers the others under one name and adds the glue between a
//! problem file and a plan that programs, benchmarks and users share:
//!
//! ```no_run
//! use tensegra::prelude::*;
//!
//! let problem = Problem::read("fixtures/kite.toml".as_ref())?;
//! let plan = tensegra::plan(&problem, &mut ())?;
//! let report = tensegra::check::check_path(&problem, &plan.path, &CheckOptions::default());
//! println!("{} configurations, {report}", plan.path.configurations.len());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Each module is a crate that can be used alone.

pub use tensegra_atlas as atlas;
pub use tensegra_check as check;
pub use tensegra_collision as collision;
pub use tensegra_formfinding as formfinding;
pub use tensegra_io as io;
pub use tensegra_lar as lar;
pub use tensegra_model as model;
pub use tensegra_optim as optim;
pub use tensegra_sampling as sampling;

mod atlas_picture;
mod describe;
mod endpoint;
mod exploring;
mod forms;
mod planning;
mod quantity;
mod rigidity;
mod smoothing;
mod tracing;
mod walking;

pub use atlas_picture::{AtlasView, Tree};
pub use describe::{Description, describe, find_flaws};
pub use endpoint::{EndpointError, complete, refine};
pub use exploring::{AtlasError, AtlasPath, Coverage, EquilibriumAtlas, explore};
pub use forms::{FormOptions, JudgedForms, find_endpoints, formfind};
pub use planning::{Plan, PlanningError, equilibrium_manifold, plan};
pub use quantity::{QuantityError, Shade, parse_quantity, three_quantities};
pub use rigidity::Rigidity;
pub use smoothing::{
    SmoothedPlan, Smoothing, SmoothingError, SmoothingOptions, plan_and_smooth, smooth,
};
pub use tracing::{Motion, Trace, TraceError, TraceSetup, TraceStep, TraceStop, Tracer, trace};
pub use walking::{
    MotionSource, StoredMotionsError, is_bad_input, plan_walk, plan_walk_with_motions,
    read_walk_problem, simulate_walk,
};

/// What most programs need.
pub mod prelude {
    pub use crate::{Plan, PlanningError, SmoothingOptions, plan, smooth};
    pub use tensegra_check::{CheckOptions, check_path};
    pub use tensegra_model::{
        Configuration, Environment, Formulation, Path, Problem, Structure, StructureBuilder,
    };
    pub use tensegra_sampling::{Observer, Progress};
}
