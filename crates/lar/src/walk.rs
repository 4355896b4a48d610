//! A walk as it is stored, checked and drawn: configurations with their supports, the rolls
//! between them, and statistics.

use nalgebra::Point2;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::check::WalkCheck;
use crate::clearance::{certified_clearance, turned_back};
use crate::{Constraint, Dimension, Limits, Obstacle, Robot, SupportedMotion};

/// Value of [`Walk::format`].
pub const WALK_FORMAT: &str = "tensegra-walk";
/// Value of [`Walk::version`].
pub const WALK_VERSION: u32 = 1;

/// Constraints closer to their bound than this are listed as active.
const ACTIVE: f64 = 1e-5;

/// A walk of a robot.
///
/// In JSON, positions have as many coordinates as the dimension, the last being the height.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Walk {
    /// Always `"tensegra-walk"`.
    pub format: String,
    /// Version of the format.
    pub version: u32,
    /// Name of the problem.
    pub name: String,
    /// Number of coordinates of a position, 2 or 3.
    pub dimension: Dimension,
    /// Names of the nodes.
    pub nodes: Vec<String>,
    /// The nodes that each member joins.
    pub edges: Vec<[usize; 2]>,
    /// Part of the mass that sits at each node.
    pub mass_fractions: Vec<f64>,
    /// The limits that the walk keeps.
    pub limits: Limits,
    /// Points that the walk visits in order.
    pub waypoints: Vec<[f64; 2]>,
    /// When a waypoint counts as visited.
    pub visit: Visit,
    /// Obstacles, and the distance kept from them seen from above.
    pub obstacles: Vec<Obstacle>,
    /// Distance kept from obstacles, seen from above.
    pub obstacle_clearance: f64,
    /// The configurations in order. Between two of them nodes move on straight lines, in a roll
    /// on straight lines in a frame that turns with the robot.
    pub configurations: Vec<WalkConfiguration>,
    /// Index of the last configuration before each roll.
    pub rolls: Vec<usize>,
    /// Figures about the walk.
    pub statistics: WalkStatistics,
    /// The verdict of the independent check, if it was run.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub check: Option<WalkCheck>,
}

/// When a waypoint counts as visited.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Visit {
    /// The centre of mass comes within this horizontal distance.
    CentreOfMass(f64),
    /// The robot stands on a support polygon that contains the point.
    Support,
}

/// One configuration of a walk.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WalkConfiguration {
    /// Position of each node.
    pub positions: Vec<Vec<f64>>,
    /// Length of each member.
    pub lengths: Vec<f64>,
    /// The nodes that carry the robot.
    pub support: Vec<usize>,
    /// Constraints that are at their bound.
    pub active: Vec<Constraint>,
}

/// Figures about a walk.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct WalkStatistics {
    /// Name of the planner.
    pub planner: String,
    /// Why the planner stopped, in words.
    pub stop: String,
    /// Waypoints reached.
    pub reached: usize,
    /// Sum of the squared length changes, Σ‖ΔL‖².
    pub actuation: f64,
    /// Sum of the straight distances from the centre of mass at the start from waypoint to
    /// waypoint, d.
    pub distance: f64,
    /// K Σ‖ΔL‖²/d with K steps of equal duration and unit total time: equation (40).
    pub cost: f64,
    /// Members that share no node stay at least this far apart at and between all
    /// configurations; none where all members share nodes.
    pub certified_clearance: Option<f64>,
    /// Optimisations solved.
    pub optimisations: usize,
    /// Iterations of all optimisations together.
    pub iterations: usize,
    /// Times that the planner was stuck and found a way on.
    pub recoveries: usize,
    /// Seconds spent planning, where measured.
    pub seconds: f64,
}

/// What one configuration leaves to each limit, for plots along a walk (figure 7 of the paper).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Margins {
    /// Length of the shortest member.
    pub shortest: f64,
    /// Length of the longest member.
    pub longest: f64,
    /// Least distance between members that share no node; infinite for a graph without such.
    pub distance: f64,
    /// Least angle between members at a node, in radians.
    pub angle: f64,
    /// Height of the lowest node.
    pub lowest: f64,
    /// Worst-case rigidity index λ/tr(RᵀR).
    pub rigidity: f64,
    /// Distance of the centre of mass from the nearest side of the support, negative outside.
    pub balance: f64,
}

/// Text that is not a walk.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum WalkFileError {
    /// Not JSON of the expected shape.
    #[error("not a walk: {0}")]
    Json(#[from] serde_json::Error),
    /// Another format or version.
    #[error(
        "the file has format `{format}` version {version}; this reads `{WALK_FORMAT}` version {WALK_VERSION}"
    )]
    Format {
        /// Format found.
        format: String,
        /// Version found.
        version: u32,
    },
}

/// What a walk is made from, besides the motion.
#[derive(Debug, Clone, PartialEq)]
pub struct WalkContext<'a> {
    /// Name of the problem.
    pub name: &'a str,
    /// The robot.
    pub robot: &'a Robot,
    /// Names of the nodes; numbers where there are none.
    pub node_names: &'a [String],
    /// Waypoints.
    pub waypoints: &'a [[f64; 2]],
    /// When they count as visited.
    pub visit: Visit,
    /// Obstacles.
    pub obstacles: &'a [Obstacle],
    /// Distance kept from them.
    pub obstacle_clearance: f64,
}

impl Walk {
    /// Describes a motion as a walk. `statistics` brings what only the planner knows; what can be
    /// measured from the motion is filled in.
    #[must_use]
    pub fn new(
        context: &WalkContext<'_>,
        motion: &SupportedMotion,
        mut statistics: WalkStatistics,
    ) -> Self {
        let robot = context.robot;
        let axes = robot.dimension().axes();
        let configurations: Vec<WalkConfiguration> = motion
            .configurations
            .iter()
            .enumerate()
            .map(|(index, x)| WalkConfiguration {
                positions: x.chunks_exact(axes).map(<[f64]>::to_vec).collect(),
                lengths: robot.lengths(x),
                support: motion.support(index).nodes().to_vec(),
                active: active(robot, x, motion, index),
            })
            .collect();
        let nodes = robot.graph().num_nodes();
        let names = if context.node_names.len() == nodes {
            context.node_names.to_vec()
        } else {
            (0..nodes).map(|node| node.to_string()).collect()
        };
        statistics.actuation = actuation(&configurations);
        statistics.distance = self::distance(robot, motion, context.waypoints);
        let steps = configurations.len().saturating_sub(1) as f64;
        statistics.cost = if statistics.distance > 0.0 {
            steps * statistics.actuation / statistics.distance
        } else {
            0.0
        };
        let clearance = motion_clearance(robot, motion);
        statistics.certified_clearance = clearance.is_finite().then_some(clearance);
        Self {
            format: WALK_FORMAT.to_owned(),
            version: WALK_VERSION,
            name: context.name.to_owned(),
            dimension: robot.dimension(),
            nodes: names,
            edges: robot.graph().members().to_vec(),
            mass_fractions: robot.mass_fractions().to_vec(),
            limits: robot.limits().clone(),
            waypoints: context.waypoints.to_vec(),
            visit: context.visit,
            obstacles: context.obstacles.to_vec(),
            obstacle_clearance: context.obstacle_clearance,
            configurations,
            rolls: motion.rolls.clone(),
            statistics,
            check: None,
        }
    }

    /// The walk as JSON text.
    ///
    /// # Errors
    /// A number that JSON cannot hold is written as null; nothing else can fail.
    pub fn to_json(&self) -> Result<String, WalkFileError> {
        Ok(serde_json::to_string(self)?)
    }

    /// Reads a walk from JSON text. Only the form is checked: see [`check_walk`](crate::check_walk).
    ///
    /// # Errors
    /// See [`WalkFileError`].
    pub fn from_json(text: &str) -> Result<Self, WalkFileError> {
        #[derive(Deserialize)]
        struct Header {
            format: String,
            version: u32,
        }
        let Header { format, version } = serde_json::from_str(text)?;
        if format != WALK_FORMAT || version != WALK_VERSION {
            return Err(WalkFileError::Format { format, version });
        }
        Ok(serde_json::from_str(text)?)
    }

    /// What each configuration of a motion leaves to the limits.
    #[must_use]
    pub fn margins(robot: &Robot, motion: &SupportedMotion) -> Vec<Margins> {
        motion
            .configurations
            .iter()
            .enumerate()
            .map(|(index, x)| {
                let extremes = robot.extremes(x);
                let centre = robot.centre_of_mass(x);
                let (_, outside) =
                    motion
                        .support(index)
                        .outermost_side(robot.dimension(), x, &centre);
                Margins {
                    shortest: extremes.shortest.0,
                    longest: extremes.longest.0,
                    distance: extremes
                        .closest
                        .map_or(f64::INFINITY, |(distance, _)| distance),
                    angle: extremes.sharpest.0,
                    lowest: extremes.lowest.0,
                    rigidity: extremes.rigidity,
                    balance: -outside,
                }
            })
            .collect()
    }

    /// The centre of mass at each configuration, seen from above (figures 6 and 14).
    #[must_use]
    pub fn centre_of_mass_track(&self) -> Vec<Point2<f64>> {
        self.configurations
            .iter()
            .map(|configuration| {
                let weighted = self.mass_fractions.iter().zip(&configuration.positions);
                weighted.fold(Point2::origin(), |sum, (fraction, position)| {
                    let y = if position.len() == 3 {
                        position[1]
                    } else {
                        0.0
                    };
                    Point2::new(sum.x + fraction * position[0], sum.y + fraction * y)
                })
            })
            .collect()
    }

    /// The corners of each support polygon in the order walked over, seen from above.
    #[must_use]
    pub fn support_polygons(&self) -> Vec<Vec<Point2<f64>>> {
        let firsts = std::iter::once(0).chain(self.rolls.iter().map(|roll| roll + 1));
        firsts
            .filter_map(|index| self.configurations.get(index))
            .map(|configuration| {
                configuration
                    .support
                    .iter()
                    .filter_map(|&node| configuration.positions.get(node))
                    .map(|p| Point2::new(p[0], if p.len() == 3 { p[1] } else { 0.0 }))
                    .collect()
            })
            .collect()
    }
}

/// Constraints at their bound; support nodes are on the ground by definition.
fn active(robot: &Robot, x: &[f64], motion: &SupportedMotion, index: usize) -> Vec<Constraint> {
    let support = motion.support(index);
    let mut active: Vec<Constraint> = robot
        .violations(x, -ACTIVE)
        .into_iter()
        .map(|(constraint, _)| constraint)
        .filter(|constraint| match constraint {
            Constraint::Ground { node } => !support.contains(*node),
            _ => true,
        })
        .collect();
    let centre = robot.centre_of_mass(x);
    if support.outermost_side(robot.dimension(), x, &centre).1 > -ACTIVE {
        active.push(Constraint::Balance);
    }
    active
}

fn actuation(configurations: &[WalkConfiguration]) -> f64 {
    configurations
        .windows(2)
        .flat_map(|pair| pair[0].lengths.iter().zip(&pair[1].lengths))
        .map(|(a, b)| (b - a) * (b - a))
        .fold(0.0, |sum, square| sum + square)
}

fn distance(robot: &Robot, motion: &SupportedMotion, waypoints: &[[f64; 2]]) -> f64 {
    let centre = robot.centre_of_mass(&motion.configurations[0]);
    let mut from = Point2::new(centre.x, centre.y);
    let mut total = 0.0;
    for &[x, y] in waypoints {
        let to = match robot.dimension() {
            Dimension::Two => Point2::new(x, 0.0),
            Dimension::Three => Point2::new(x, y),
        };
        total += (to - from).norm();
        from = to;
    }
    total
}

/// Certified clearance of a whole motion, rolls included: see
/// [`certified_clearance`](crate::certified_clearance). Infinite where all members share nodes.
#[must_use]
pub fn motion_clearance(robot: &Robot, motion: &SupportedMotion) -> f64 {
    let mut clearance = f64::INFINITY;
    for (index, pair) in motion.configurations.windows(2).enumerate() {
        let shape = if motion.rolls.contains(&index) {
            let before = (pair[0].as_slice(), motion.support(index));
            turned_back(
                robot,
                before,
                (pair[1].as_slice(), motion.support(index + 1)),
            )
        } else {
            None
        };
        let end = shape.as_deref().unwrap_or(&pair[1]);
        clearance = clearance.min(certified_clearance(robot, &pair[0], end));
    }
    clearance
}
