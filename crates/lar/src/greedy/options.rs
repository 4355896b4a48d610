//! What a greedy walk is asked for, and what comes of it.

use thiserror::Error;

use crate::limits::setters;
use crate::{Constraint, PlaceError, SupportError, SupportedMotion};

/// What a greedy step minimises.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum GreedyObjective {
    /// ‖L − L_previous‖², the motion of the actuators (28).
    LeastMotion,
    /// ‖L − l_N‖², the distance from a nominal length (29).
    NominalLengths(f64),
}

/// What the planner does when a step has no solution.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Persistence {
    /// Stops at once, as in the literature.
    Stop,
    /// Tries smaller steps, then stops.
    Shrink,
    /// Tries smaller steps, then goes back over some rolls, takes up a better posture and tries
    /// other directions, then stops.
    Recover,
}

/// How greedy locomotion works.
///
/// # Examples
///
/// ```
/// use tensegra_lar::{GreedyObjective, GreedyOptions};
///
/// let options = GreedyOptions::default().with_objective(GreedyObjective::NominalLengths(1.0));
/// assert!(options.validate().is_ok());
/// assert!(options.with_step(0.0).validate().is_err());
/// ```
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct GreedyOptions {
    /// What a step minimises. Default: the motion of the actuators.
    pub objective: GreedyObjective,
    /// Distance that the centre of mass advances in a step. Default 0.02. It must stay below
    /// d_move times the mass fraction of the nodes that do not carry the robot.
    pub step: f64,
    /// A waypoint counts as reached at this horizontal distance of the centre of mass. Default
    /// 0.05.
    pub waypoint_tolerance: f64,
    /// Configurations after which the planner stops. Default 20 000.
    pub max_configurations: usize,
    /// What to do when a step has no solution. Default [`Persistence::Recover`].
    pub persistence: Persistence,
    /// Attempts to recover without progress after which the planner stops. Default 60.
    pub patience: usize,
    /// Distance that nodes keep from obstacles, seen from above. Default: half the least distance
    /// between members, their radius.
    pub obstacle_clearance: Option<f64>,
}

impl Default for GreedyOptions {
    fn default() -> Self {
        Self {
            objective: GreedyObjective::LeastMotion,
            step: 0.02,
            waypoint_tolerance: 0.05,
            max_configurations: 20_000,
            persistence: Persistence::Recover,
            patience: 60,
            obstacle_clearance: None,
        }
    }
}

impl GreedyOptions {
    setters! {
        objective / with_objective: GreedyObjective;
        step / with_step: f64;
        waypoint_tolerance / with_waypoint_tolerance: f64;
        max_configurations / with_max_configurations: usize;
        persistence / with_persistence: Persistence;
        patience / with_patience: usize;
        obstacle_clearance / with_obstacle_clearance: Option<f64>;
    }

    /// Checks every option against its range.
    ///
    /// # Errors
    /// The first option outside its range.
    pub fn validate(&self) -> Result<(), GreedyError> {
        let positive = |name, value: f64| {
            if value > 0.0 && value.is_finite() {
                Ok(())
            } else {
                Err(GreedyError::Option { name, value })
            }
        };
        positive("step", self.step)?;
        positive("waypoint_tolerance", self.waypoint_tolerance)?;
        if let GreedyObjective::NominalLengths(length) = self.objective {
            positive("nominal length", length)?;
        }
        positive("max_configurations", self.max_configurations as f64)?;
        match self.obstacle_clearance {
            Some(clearance) => positive("obstacle_clearance", clearance),
            None => Ok(()),
        }
    }
}

/// Why greedy planning cannot start.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum GreedyError {
    /// An option outside its range.
    #[error("the option `{name}` is {value}: it must be positive and finite")]
    Option {
        /// Name of the option.
        name: &'static str,
        /// The value given.
        value: f64,
    },
    /// The support does not carry the robot at the start.
    #[error("the start does not stand: {0}")]
    Support(#[from] SupportError),
    /// The start violates a limit.
    #[error(
        "the starting configuration violates the {constraint} by {violation}: change the start or the limits"
    )]
    StartInfeasible {
        /// The limit that is violated most.
        constraint: Constraint,
        /// By how much.
        violation: f64,
    },
    /// A start or a waypoint that cannot be.
    #[error(transparent)]
    Place(#[from] PlaceError),
    /// Obstacles are outlines on the ground, which the plane does not have.
    #[error("obstacles need a robot in space")]
    PlanarObstacles,
}

/// Why a greedy walk ended.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum GreedyStop {
    /// All waypoints were reached.
    Arrived,
    /// No step towards the waypoint meets all constraints.
    Stuck {
        /// The waypoint.
        waypoint: usize,
        /// Constraints that stand in the way of the last step tried.
        active: Vec<Constraint>,
    },
    /// A roll that cannot be made: no node lies beyond the side, or an obstacle does.
    CannotRoll {
        /// The waypoint.
        waypoint: usize,
    },
    /// No way around the obstacles is wide enough for the robot.
    NoRoute {
        /// The waypoint.
        waypoint: usize,
    },
    /// The limit on configurations was reached.
    TooLong {
        /// The waypoint.
        waypoint: usize,
    },
}

/// A greedy walk.
#[derive(Debug, Clone, PartialEq)]
pub struct GreedyWalk {
    /// The motion, from the start to where the planner stopped.
    pub motion: SupportedMotion,
    /// Why it stopped.
    pub stop: GreedyStop,
    /// Waypoints reached.
    pub reached: usize,
    /// Optimisations solved, those without solution included.
    pub optimisations: usize,
    /// Iterations of all optimisations together.
    pub iterations: usize,
    /// Times that the planner was stuck and recovered.
    pub recoveries: usize,
}
