//! Linear-actuator (truss) robots: rigidity, kinematics, locomotion and motion primitives.
//!
//! A linear-actuator robot is a graph whose members change their length. This crate answers, for
//! such robots in the plane and in space:
//!
//! - **Is it rigid, and how well?** [`Rigidity`] (rank, mechanisms, redundant members),
//!   [`RigiditySpectrum`] (the worst-case rigidity index and its derivatives, also where
//!   eigenvalues are repeated), [`is_generically_rigid`], [`rigidity_equivalence`].
//! - **How do lengths move nodes?** [`DifferentialKinematics`]: forward and inverse, with ground
//!   contact and with independent and dependent actuators.
//! - **What may it do?** [`Limits`] on lengths, distances, angles, steps and rigidity; a [`Robot`]
//!   measures a configuration against them; [`certified_clearance`] bounds the distance of members
//!   between configurations.
//! - **How does it walk?** Greedily, one small optimisation a step ([`GreedyPlanner`]: any robot,
//!   no promise to arrive); by optimised motion primitives between symmetric stances
//!   ([`find_primitive`], [`extend_primitive`], [`find_gait`]) that are stitched along a path of
//!   support polygons ([`TwoTierPlanner`]: symmetric robots, always arrives where a path exists).
//! - **Would it work?** [`simulate_motion`] runs a motion on a robot with mass under PID control;
//!   [`check_walk`] judges a walk without any of the planners' code.
//!
//! A walk problem is read from a TOML file by [`WalkProblem::from_toml`], solved by [`plan_walk`],
//! and stored as a [`Walk`].
//!
//! Configurations are coordinate slices, node after node, the last coordinate of a node being its
//! height; a robot carries its weight on as many nodes as the space has axes (its [`Support`]).
//! Lengths are in the robot's own unit, angles in radians, masses relative.
//!
//! The method is that of N. S. Usevitch, Z. M. Hammond and M. Schwager, "Locomotion of linear
//! actuator robots through kinematic planning and nonlinear optimization", IEEE Transactions on
//! Robotics 36 (2020); equation and section numbers refer to it.
//!
//! # Examples
//!
//! ```
//! use tensegra_lar::{GreedyOptions, GreedyPlanner, GreedyStop, Limits, unit_octahedron};
//!
//! let start = unit_octahedron(Limits::default())?;
//! let mut planner = GreedyPlanner::new(&start.robot, GreedyOptions::default())?;
//! let walk = planner.walk(&start.stance, &[[1.0, 0.0]])?;
//! assert_eq!(walk.stop, GreedyStop::Arrived);
//! assert!(!walk.motion.rolls.is_empty());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod check;
mod clearance;
mod constraint;
mod dynamics;
mod equivalence;
pub mod experiments;
mod framework;
mod graph;
mod greedy;
mod ground_isometry;
mod interpolation;
mod kinematics;
mod known;
mod limits;
mod obstacle;
mod place;
mod plan;
mod primitive;
mod problem;
mod random;
mod rigidity;
mod rigidity_index;
mod robot;
mod route;
mod segment;
mod support;
mod two_tier;
mod walk;

pub use check::{WalkCheck, WalkCheckOptions, WalkFacts, WalkFault, WalkFaultKind, check_walk};
pub use clearance::{certified_clearance, turned_back};
pub use constraint::Constraint;
pub use dynamics::{ContactEvent, DynamicsError, DynamicsOptions, DynamicsReport, simulate_motion};
pub use equivalence::{Equivalence, OrientedSimplex, oriented_simplices, rigidity_equivalence};
pub use framework::{Dimension, Framework, FrameworkError};
pub use graph::{Corner, Graph, GraphError};
pub use greedy::{
    GreedyError, GreedyObjective, GreedyOptions, GreedyPlanner, GreedyStop, GreedyWalk, Persistence,
};
pub use ground_isometry::GroundIsometry;
pub use kinematics::{DifferentialKinematics, GroundContact, KinematicsError};
pub use known::{RobotAtStart, unit_k5, unit_octahedron};
pub use limits::{Limits, LimitsError};
pub use obstacle::{Obstacle, ObstacleError};
pub use place::PlaceError;
pub use plan::{
    PlanWalkError, PlannedWalk, plan_two_tier, plan_walk, plan_walk_timed, primitive_library,
};
pub use primitive::{
    Gait, GaitSearch, MotionFileError, Primitive, PrimitiveAttempt, PrimitiveError,
    PrimitiveOptions, PrimitiveSearch, Relabelling, SequenceRoll, Stance, SupportedMotion,
    SymmetricRobot, SymmetryError, Turn, TurningGait, check_symmetry, extend_primitive,
    find_cheapest_primitive, find_gait, find_primitive, find_turning_gait, relabellings,
    solve_primitive, straight_strip,
};
pub use problem::{TwoTierOptions, WalkGoal, WalkPlanner, WalkProblem, WalkProblemError};
pub use random::{RandomRobotError, random_robot};
pub use rigidity::{
    Rigidity, RowScaling, is_generically_minimally_rigid, is_generically_rigid, rigidity_matrix,
};
pub use rigidity_index::{IndexScale, RigiditySpectrum, worst_case_rigidity_index};
pub use robot::{ConfigurationExtremes, Robot, RobotError};
pub use support::{Roll, SideLine, Support, SupportError};
pub use two_tier::{
    Cell, GridGoal, GridSearch, LibraryAttempts, Piece, PrimitiveLibrary, TriangularGrid,
    TwoTierError, TwoTierPlanner, TwoTierWalk, search_grid,
};
pub use walk::{
    Margins, Visit, WALK_FORMAT, WALK_VERSION, Walk, WalkConfiguration, WalkContext, WalkFileError,
    WalkStatistics, motion_clearance,
};
