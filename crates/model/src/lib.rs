//! What a tensegrity is, as data: structure, environment, problem files,
//! configurations and paths; its statics; and its equilibrium manifold.
//!
//! # Conventions
//! Tension is positive, compression negative. Units are those of the problem:
//! nothing here converts them. Nodes, elements, obstacles and attachments are
//! referred to by their index in the order of declaration; names are for people
//! and files.

mod configuration;
mod environment;
mod equilibrium;
mod problem;
mod structure;

pub use configuration::{Configuration, Path};
pub use environment::{Body, Environment, Obstacle, Role, Shape};
pub use equilibrium::EquilibriumManifold;
pub use problem::{Endpoint, Formulation, PlannerKind, PlannerSettings, Problem, SamplingRadius};
pub use structure::{
    Anchor, Appearance, AttachedShape, Attachment, Coupling, Element, ElementKind, FixedCoordinate,
    ForceLaw, Interval, Node, Structure,
};
