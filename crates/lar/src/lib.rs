//! Linear-actuator (truss) robots: rigidity, kinematics, locomotion and motion primitives.

mod equivalence;
mod framework;
mod graph;
mod kinematics;
mod rigidity;
mod rigidity_index;

pub use equivalence::{Equivalence, OrientedSimplex, oriented_simplices, rigidity_equivalence};
pub use framework::{Dimension, Framework, FrameworkError};
pub use graph::{Corner, Graph, GraphError};
pub use kinematics::{DifferentialKinematics, GroundContact, KinematicsError};
pub use rigidity::{
    Rigidity, RowScaling, is_generically_minimally_rigid, is_generically_rigid, rigidity_matrix,
};
pub use rigidity_index::{IndexScale, RigiditySpectrum, worst_case_rigidity_index};

mod clearance;
mod constraint;
mod limits;
mod robot;
mod segment;
mod support;

pub use clearance::{certified_clearance, turned_back};
pub use constraint::Constraint;
pub use limits::{Limits, LimitsError};
pub use robot::{ConfigurationExtremes, Robot, RobotError};
pub use support::{Roll, SideLine, Support, SupportError};

mod ground_isometry;
mod primitive;

pub use ground_isometry::GroundIsometry;
pub use primitive::{
    Gait, GaitSearch, Primitive, PrimitiveAttempt, PrimitiveError, PrimitiveFileError,
    PrimitiveOptions, PrimitiveSearch, Relabelling, SequenceRoll, Stance, SupportedMotion,
    SymmetricRobot, SymmetryError, Turn, check_symmetry, extend_primitive, find_gait,
    find_primitive, relabellings, solve_primitive, straight_strip,
};

mod known;

pub use known::{RobotAtStart, unit_k5, unit_octahedron};

mod greedy;

pub use greedy::{
    GreedyError, GreedyObjective, GreedyOptions, GreedyPlanner, GreedyStop, GreedyWalk, Persistence,
};

mod obstacle;
mod route;

pub use obstacle::{Obstacle, ObstacleError};

mod random;

pub use random::{RandomRobotError, random_robot};

mod two_tier;

pub use two_tier::{
    Cell, GridGoal, GridSearch, PrimitiveLibrary, TriangularGrid, TwoTierError, TwoTierPlanner,
    TwoTierWalk, search_grid,
};
