//! What can be wrong with a walk.

use serde::{Deserialize, Serialize};

use crate::Constraint;

/// One thing that is wrong with a walk.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WalkFault {
    /// The configuration, or the one before where the fault lies between two.
    pub configuration: usize,
    /// Whether the fault lies between this configuration and the next.
    pub between: bool,
    /// What is wrong.
    pub kind: WalkFaultKind,
}

/// What can be wrong with a walk.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "fault", rename_all = "snake_case")]
#[non_exhaustive]
pub enum WalkFaultKind {
    /// A list has the wrong length, a number is not finite, or an index does not exist.
    Malformed {
        /// What is malformed.
        what: String,
    },
    /// The walk is not that of the robot it is judged for.
    OtherRobot {
        /// What differs.
        what: String,
    },
    /// The walk does not start where its problem says.
    OtherStart,
    /// A physical constraint is violated.
    Violated {
        /// The constraint.
        constraint: Constraint,
        /// By how much: a length, an angle in radians, a difference of indices.
        violation: f64,
    },
    /// A length stated is not the distance of the nodes.
    WrongLength {
        /// The member.
        member: usize,
        /// The length stated.
        stated: f64,
        /// The distance of its nodes.
        actual: f64,
    },
    /// Members come closer than the clearance that the walk states.
    Clearance {
        /// The members.
        members: [usize; 2],
        /// Their distance.
        distance: f64,
        /// The clearance stated.
        stated: f64,
    },
    /// A support node moves, or is off the ground.
    Slides {
        /// The node.
        node: usize,
        /// How far it moves, or its height.
        by: f64,
    },
    /// A node moves too far in one step.
    Jumps {
        /// The node.
        node: usize,
        /// How far.
        by: f64,
    },
    /// The support changes without a roll, or a roll does not exchange exactly one node.
    SupportChange,
    /// A roll starts although the centre of mass is still inside the side rolled over.
    RollsTooEarly {
        /// Distance inside.
        inside: f64,
    },
    /// A node comes too close to an obstacle.
    Obstacle {
        /// The obstacle.
        obstacle: usize,
        /// Distance.
        distance: f64,
    },
    /// A waypoint is not visited.
    NotVisited {
        /// The waypoint.
        waypoint: usize,
    },
}

impl std::fmt::Display for WalkFault {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self {
            configuration,
            between,
            kind,
        } = self;
        if *between {
            write!(
                f,
                "between configurations {configuration} and {}: {kind}",
                configuration + 1
            )
        } else {
            write!(f, "at configuration {configuration}: {kind}")
        }
    }
}

impl std::fmt::Display for WalkFaultKind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Malformed { what } => f.write_str(what),
            Self::OtherRobot { what } => {
                write!(f, "the walk is that of another robot: its {what} differ")
            }
            Self::OtherStart => f.write_str("the walk does not start where its problem says"),
            Self::Violated {
                constraint,
                violation,
            } => write!(f, "{constraint} violated by {violation:.3e}"),
            Self::WrongLength {
                member,
                stated,
                actual,
            } => write!(
                f,
                "member {member} is stated to be {stated} long, its nodes are {actual} apart"
            ),
            Self::Clearance {
                members: [a, b],
                distance,
                stated,
            } => write!(
                f,
                "members {a} and {b} are {distance:.6} apart, less than the clearance {stated:.6} \
                 that the walk states"
            ),
            Self::Slides { node, by } => {
                write!(
                    f,
                    "support node {node} slides, or is off the ground, by {by:.3e}"
                )
            }
            Self::Jumps { node, by } => {
                write!(
                    f,
                    "node {node} moves {by:.6} in one step, more than max_move"
                )
            }
            Self::SupportChange => {
                f.write_str("the support changes other than by a roll that exchanges one node")
            }
            Self::RollsTooEarly { inside } => write!(
                f,
                "a roll starts with the centre of mass {inside:.3e} inside the side rolled over"
            ),
            Self::Obstacle { obstacle, distance } => write!(
                f,
                "a member is {distance:.6} from obstacle {obstacle}, seen from above: too close"
            ),
            Self::NotVisited { waypoint } => write!(f, "waypoint {waypoint} is not visited"),
        }
    }
}
