//! Sampling-based planners over implicit manifolds.
//!
//! [`AtlasRrt`] plans between two points of any [`ImplicitManifold`] under any
//! [`Validity`]: a sphere with walls as well as a tensegrity among obstacles.
//! It knows of nothing but these two traits. [`Tracer`] follows a manifold while
//! some quantities of its points are moved.
//!
//! [`ImplicitManifold`]: tensegra_atlas::ImplicitManifold
//! [`Validity`]: tensegra_atlas::Validity

mod atlas_rrt;
mod neighbours;
mod options;
mod plan;
mod shortcut;
mod slide;
mod smooth;
mod trace;
mod tree;
mod walk;

pub use atlas_rrt::AtlasRrt;
pub use options::{NeighbourSearch, PlannerOptions, SampleRadius};
pub use plan::{Failure, Observer, Plan, PlanError, Progress, Statistics, StopCounts};
pub use shortcut::{ShortcutOptions, Shortcutter, Shortened};
pub use smooth::{
    Draft, SmoothError, SmoothObserver, SmoothProgress, Smoothed, Smoother, SmootherOptions,
};
pub use trace::{Advance, Limit, Quantities, Stop, TraceOptions, Tracer};
