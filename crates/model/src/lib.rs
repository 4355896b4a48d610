//! What a tensegrity is, as data: structure, environment, problem files,
//! configurations and paths; its statics; and its equilibrium manifold.
//!
//! # Conventions
//! Tension is positive, compression negative. Units are those of the problem:
//! nothing here converts them. Nodes, elements, obstacles and attachments are
//! referred to by their index in the order of declaration; names are for people
//! and files.

mod build_errors;
mod builder;
mod configuration;
mod declarations;
mod diagnostic;
mod effort;
mod environment;
mod equilibrium;
mod files;
mod form;
mod free_space;
mod problem;
mod problem_file;
mod stable;
pub mod statics;
mod structure;
mod tens;
mod validate;

pub use build_errors::BuildErrors;
pub use builder::{ElementSpec, StructureBuilder};
pub use configuration::{Configuration, Path};
pub use diagnostic::{Finding, ReadErrors, Severity, SourceFile};
pub use effort::{EffortError, control_effort, path_length};
pub use environment::{
    BadShape, Body, CollisionRule, Environment, EnvironmentBuilder, EnvironmentError,
    EnvironmentFlaw, EnvironmentPlace, Obstacle, PairSelection, Role, Shape,
};
pub use equilibrium::{
    DirectionsManifold, ElementQuantity, EquationCounts, EquilibriumError, EquilibriumManifold,
    NodesManifold,
};
pub use form::{FormCondition, FormCost, FormSettings};
pub use free_space::{BodyError, Closest, FreeSpace, Memory};
pub use problem::{
    Endpoint, Formulation, NeighbourSearch, PlannerKind, PlannerSettings, Problem, SamplingRadius,
};
pub use stable::Stable;
pub use statics::{Actuation, Stability};
pub use structure::{
    Anchor, Appearance, AttachedShape, Attachment, Coupling, Element, ElementKind, FixedCoordinate,
    ForceLaw, Interval, Node, Structure,
};
pub use validate::{ElementPart, Place, StructureError, StructureFlaw};
