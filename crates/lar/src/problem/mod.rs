//! Walk problems in TOML files.
//!
//! ```toml
//! name = "around the block"
//! planner = "two-tier"                 # or "greedy"
//! seed = 0
//! waypoints = [[2.0, 1.0], [4.0, 0.5]] # one number each for a robot in the plane
//! # or, instead of waypoints, a region to end in:
//! # goal = { centre = [4.0, 0.5], radius = 0.5 }
//!
//! [robot]
//! preset = "octahedron"                # or "k5"; or nodes, members and support as below
//! centre_of_mass = [0.0, 0.0]          # optional: moves the robot there
//! # nodes = [[0.0, 0.0, 0.0], …]       # two numbers each for a robot in the plane
//! # members = [[0, 1], …]              # or "complete"; `edges` is the same
//! # support = [0, 1, 2]
//! # names = ["left", …]                # optional
//! # masses = [1.0, …]                  # optional
//!
//! [limits]                             # all optional
//! min_length = 0.5
//! max_length = 4.0
//! min_distance = 0.15
//! min_angle_degrees = 10.0
//! max_move = 0.075
//! min_rigidity = 0.0025
//!
//! [greedy]                             # all optional
//! objective = "least-motion"           # or "nominal-lengths"
//! nominal_length = 1.0
//! step = 0.02
//! waypoint_tolerance = 0.05
//! persistence = "recover"              # or "shrink", "stop"
//! max_configurations = 20000
//!
//! [two_tier]                           # all optional
//! rolls = 2                            # longest primitive used for smoothing
//! gait = true                          # whether a periodic gait may be walked as well
//! roles = [3, 1, 2, 0, 4, 5]           # renaming of nodes in a roll; the cheapest if absent
//! steps = 40
//! starts = 32
//!
//! [[obstacles]]
//! corners = [[2.0, -1.0], [2.5, -1.0], [2.5, 0.5], [2.0, 0.5]]
//! # or min = […], max = […] for a rectangle
//! ```
//!
//! Every error says at which line and column of the file it was found.

mod planners;
mod robot;
mod tables;

use std::ops::Range;

use nalgebra::Point2;
use serde::Deserialize;
use thiserror::Error;
use toml::Spanned;

pub use planners::TwoTierOptions;
use planners::{read_greedy, read_two_tier};
use robot::{check_start, read_robot};
use tables::{File, LimitsTable, ObstacleTable, Region};

use crate::{Dimension, GreedyOptions, GridGoal, Limits, Obstacle, Robot, Stance};

/// Which planner walks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum WalkPlanner {
    /// One small optimisation a step.
    Greedy,
    /// A path of support polygons walked by motion primitives.
    TwoTier,
}

/// Where a walk is to lead.
#[derive(Debug, Clone, PartialEq)]
pub enum WalkGoal {
    /// Points to visit in order.
    Waypoints(Vec<[f64; 2]>),
    /// A disc to end in.
    Region {
        /// Centre.
        centre: [f64; 2],
        /// Radius.
        radius: f64,
    },
}

impl WalkGoal {
    /// The points concerned: the waypoints, or the centre of the region.
    #[must_use]
    pub fn points(&self) -> Vec<[f64; 2]> {
        match self {
            Self::Waypoints(points) => points.clone(),
            Self::Region { centre, .. } => vec![*centre],
        }
    }

    /// The goals of a search over the grid.
    #[must_use]
    pub fn grid_goals(&self) -> Vec<GridGoal> {
        match self {
            Self::Waypoints(points) => points
                .iter()
                .map(|&[x, y]| GridGoal::Point(Point2::new(x, y)))
                .collect(),
            Self::Region {
                centre: [x, y],
                radius,
            } => {
                vec![GridGoal::Disc {
                    centre: Point2::new(*x, *y),
                    radius: *radius,
                }]
            }
        }
    }
}

/// A walk problem.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct WalkProblem {
    /// Name, for reports.
    pub name: String,
    /// Which planner walks.
    pub planner: WalkPlanner,
    /// Seed of every random choice.
    pub seed: u64,
    /// The robot.
    pub robot: Robot,
    /// Names of the nodes; empty where the file gives none.
    pub node_names: Vec<String>,
    /// Where the robot starts.
    pub start: Stance,
    /// Where it is to go.
    pub goal: WalkGoal,
    /// Obstacles.
    pub obstacles: Vec<Obstacle>,
    /// Distance to keep from them, seen from above.
    pub obstacle_clearance: f64,
    /// Options of the greedy planner.
    pub greedy: GreedyOptions,
    /// Options of two-tier planning.
    pub two_tier: TwoTierOptions,
}

/// A file that is not a walk problem.
#[derive(Debug, Clone, PartialEq, Error)]
#[error("line {line}, column {column}: {message}")]
pub struct WalkProblemError {
    /// Line, counted from 1.
    pub line: usize,
    /// Column in characters, counted from 1.
    pub column: usize,
    /// Bytes of the text concerned.
    pub span: Range<usize>,
    /// What is wrong and how to mend it.
    pub message: String,
}

/// Turns positions in the text into lines and columns.
struct Locator<'t>(&'t str);

impl Locator<'_> {
    fn error(&self, span: Range<usize>, message: impl ToString) -> WalkProblemError {
        let before = &self.0[..floor_boundary(self.0, span.start)];
        let line_start = before.rfind('\n').map_or(0, |at| at + 1);
        WalkProblemError {
            line: before.matches('\n').count() + 1,
            column: before[line_start..].chars().count() + 1,
            span,
            message: message.to_string(),
        }
    }
}

/// The largest character boundary not after `index`.
fn floor_boundary(text: &str, index: usize) -> usize {
    let mut index = index.min(text.len());
    while !text.is_char_boundary(index) {
        index -= 1;
    }
    index
}

impl WalkProblem {
    /// Reads a problem from TOML text.
    ///
    /// # Errors
    /// Text that is not TOML or not a walk problem, a robot that is not rigid, an initial
    /// configuration that violates a limit or does not stand, a waypoint inside an obstacle, a
    /// node without members: each with line and column, and with the members or nodes concerned.
    ///
    /// # Examples
    ///
    /// ```
    /// use tensegra_lar::WalkProblem;
    ///
    /// let text = r#"
    /// planner = "greedy"
    /// waypoints = [[1.0, 0.0]]
    /// [robot]
    /// preset = "k5"
    /// "#;
    /// let problem = WalkProblem::from_toml(text)?;
    /// assert_eq!(problem.robot.graph().num_members(), 10);
    ///
    /// let error = WalkProblem::from_toml(&text.replace("1.0, 0.0", "1.0, inf")).unwrap_err();
    /// assert_eq!((error.line, error.column), (3, 14));
    /// # Ok::<(), tensegra_lar::WalkProblemError>(())
    /// ```
    pub fn from_toml(text: &str) -> Result<Self, WalkProblemError> {
        let at = Locator(text);
        let file: File = toml::from_str(text)
            .map_err(|error| at.error(error.span().unwrap_or(0..0), error.message()))?;

        let limits = read_limits(&at, file.limits.as_ref())?;
        let (robot, node_names, start) = read_robot(&at, &file.robot, &limits)?;
        check_start(&at, &file.robot, &robot, &start)?;

        let mut obstacles = Vec::with_capacity(file.obstacles.len());
        for table in &file.obstacles {
            obstacles.push(read_obstacle(&at, table)?);
        }
        let obstacle_clearance = match &file.obstacle_clearance {
            Some(value) if !(*value.get_ref() > 0.0 && value.get_ref().is_finite()) => {
                let message = format!("the clearance {} must be positive", value.get_ref());
                return Err(at.error(value.span(), message));
            }
            Some(value) => *value.get_ref(),
            None => 0.5 * robot.limits().min_distance,
        };
        if robot.dimension() == Dimension::Two
            && let Some(table) = file.obstacles.first()
        {
            return Err(at.error(table.span(), "obstacles need a robot in space"));
        }
        let goal = read_goal(
            &at,
            &file,
            robot.dimension(),
            &obstacles,
            obstacle_clearance,
        )?;
        let greedy = read_greedy(&at, file.greedy.as_ref(), obstacle_clearance)?;
        let nodes = robot.graph().num_nodes();
        let two_tier = read_two_tier(&at, file.two_tier.as_ref(), nodes)?;
        Ok(Self {
            name: file.name,
            planner: file.planner,
            seed: file.seed,
            robot,
            node_names,
            start,
            goal,
            obstacles,
            obstacle_clearance,
            greedy,
            two_tier,
        })
    }
}

fn read_limits(
    at: &Locator<'_>,
    table: Option<&Spanned<LimitsTable>>,
) -> Result<Limits, WalkProblemError> {
    let mut limits = Limits::default();
    let Some(table) = table else {
        return Ok(limits);
    };
    let given = table.get_ref();
    let value = |field: &Option<Spanned<f64>>| field.as_ref().map(|value| *value.get_ref());
    let degrees = value(&given.min_angle_degrees);
    for (target, value) in [
        (&mut limits.min_length, value(&given.min_length)),
        (&mut limits.max_length, value(&given.max_length)),
        (&mut limits.min_distance, value(&given.min_distance)),
        (&mut limits.min_angle, degrees.map(f64::to_radians)),
        (&mut limits.max_move, value(&given.max_move)),
    ] {
        if let Some(value) = value {
            *target = value;
        }
    }
    limits.min_rigidity = value(&given.min_rigidity);
    limits.validate().map_err(|error| {
        let field = match error.name {
            "min_length" => &given.min_length,
            "max_length" => &given.max_length,
            "min_distance" => &given.min_distance,
            "min_angle" => &given.min_angle_degrees,
            "max_move" => &given.max_move,
            _ => &given.min_rigidity,
        };
        // A default that another limit has ruled out stands nowhere in the file.
        let span = field.as_ref().map_or_else(|| table.span(), Spanned::span);
        match degrees {
            Some(degrees) if error.name == "min_angle" => at.error(
                span,
                format!("the limit `min_angle_degrees` is {degrees}: it must lie between 0 and 90"),
            ),
            _ => at.error(span, error),
        }
    })?;
    Ok(limits)
}

/// A place on the ground: two finite numbers, one for a robot in the plane.
fn read_place(
    at: &Locator<'_>,
    place: &Spanned<Vec<f64>>,
    dimension: Dimension,
    what: &str,
) -> Result<[f64; 2], WalkProblemError> {
    let values = place.get_ref();
    if let Some(value) = values.iter().find(|value| !value.is_finite()) {
        let message = format!("{what} has the coordinate {value}: give finite numbers");
        return Err(at.error(place.span(), message));
    }
    let wrong = |needed: &str| {
        let message = format!("{what} has {} coordinates: a robot {needed}", values.len());
        Err(at.error(place.span(), message))
    };
    match (dimension, values.as_slice()) {
        (Dimension::Three, &[x, y]) => Ok([x, y]),
        (Dimension::Three, _) => wrong("in space needs two, [x, y]"),
        // The plane of the robot is that where y is zero.
        (Dimension::Two, &[x] | &[x, 0.0]) => Ok([x, 0.0]),
        (Dimension::Two, &[_, y]) => {
            let message =
                format!("{what} has y = {y}: a robot in the plane walks along x; give [x]");
            Err(at.error(place.span(), message))
        }
        (Dimension::Two, _) => wrong("in the plane needs one, [x]"),
    }
}

fn read_obstacle(
    at: &Locator<'_>,
    table: &Spanned<ObstacleTable>,
) -> Result<Obstacle, WalkProblemError> {
    let mut span = table.span();
    let obstacle = match table.get_ref() {
        ObstacleTable {
            corners: Some(corners),
            min: None,
            max: None,
        } => {
            span = corners.span();
            Obstacle::new(corners.get_ref())
        }
        ObstacleTable {
            corners: None,
            min: Some(min),
            max: Some(max),
        } => Obstacle::rectangle(*min, *max),
        _ => {
            let message = "an obstacle needs either `corners` or `min` and `max`";
            return Err(at.error(table.span(), message));
        }
    };
    obstacle.map_err(|error| at.error(span, error))
}

fn read_goal(
    at: &Locator<'_>,
    file: &File,
    dimension: Dimension,
    obstacles: &[Obstacle],
    clearance: f64,
) -> Result<WalkGoal, WalkProblemError> {
    let read = |place: &Spanned<Vec<f64>>, what: &str| {
        let [x, y] = read_place(at, place, dimension, what)?;
        let inside = |obstacle: &Obstacle| obstacle.contains(&Point2::new(x, y), clearance);
        match obstacles.iter().position(inside) {
            Some(obstacle) => Err(at.error(
                place.span(),
                format!(
                    "{what} lies inside obstacle {obstacle} or within {clearance} of it: move one \
                     of them"
                ),
            )),
            None => Ok([x, y]),
        }
    };
    match (&file.waypoints, &file.goal) {
        (Some(waypoints), None) => {
            if waypoints.get_ref().is_empty() {
                return Err(at.error(waypoints.span(), "give at least one waypoint"));
            }
            let points = waypoints.get_ref().iter().enumerate();
            points
                .map(|(index, point)| read(point, &format!("waypoint {index}")))
                .collect::<Result<_, _>>()
                .map(WalkGoal::Waypoints)
        }
        (None, Some(goal)) => {
            let Region { centre, radius } = goal.get_ref();
            let centre = read(centre, "the centre of the goal")?;
            let (span, radius) = (radius.span(), *radius.get_ref());
            if !(radius > 0.0 && radius.is_finite()) {
                let message = format!("the radius of the goal is {radius}: it must be positive");
                return Err(at.error(span, message));
            }
            Ok(WalkGoal::Region { centre, radius })
        }
        (Some(_), Some(goal)) => {
            Err(at.error(goal.span(), "give either `waypoints` or `goal`, not both"))
        }
        (None, None) => Err(at.error(0..0, "give `waypoints` or a `goal` to walk to")),
    }
}
