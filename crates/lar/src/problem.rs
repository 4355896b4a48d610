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
//! rolls = 4                            # longest primitive used for smoothing
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

use std::ops::Range;

use nalgebra::Point2;
use serde::Deserialize;
use serde::de::{Deserializer, SeqAccess, Visitor};
use thiserror::Error;
use toml::Spanned;

use crate::known::RobotAtStart;
use crate::{
    Dimension, Framework, Graph, GraphError, GreedyError, GreedyObjective, GreedyOptions, GridGoal,
    Limits, Obstacle, Persistence, PrimitiveOptions, Rigidity, Robot, Stance, Support, unit_k5,
    unit_octahedron,
};

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
    /// Options of motion primitives.
    pub primitives: PrimitiveOptions,
    /// Longest primitive used for smoothing, in rolls.
    pub smoothing_rolls: usize,
    /// Renaming of nodes in a roll; the cheapest if none is given.
    pub roles: Option<Vec<usize>>,
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

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(default)]
    name: String,
    planner: WalkPlanner,
    #[serde(default)]
    seed: u64,
    waypoints: Option<Spanned<Vec<Spanned<Vec<f64>>>>>,
    goal: Option<Spanned<Region>>,
    robot: Spanned<RobotTable>,
    limits: Option<Spanned<LimitsTable>>,
    greedy: Option<Spanned<GreedyTable>>,
    two_tier: Option<Spanned<TwoTierTable>>,
    #[serde(default)]
    obstacles: Vec<Spanned<ObstacleTable>>,
    obstacle_clearance: Option<Spanned<f64>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Region {
    centre: Spanned<Vec<f64>>,
    radius: Spanned<f64>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RobotTable {
    preset: Option<Spanned<Preset>>,
    centre_of_mass: Option<Spanned<Vec<f64>>>,
    nodes: Option<Spanned<Vec<Spanned<Vec<f64>>>>>,
    #[serde(alias = "edges")]
    members: Option<Spanned<MemberList>>,
    support: Option<Spanned<Vec<usize>>>,
    names: Option<Spanned<Vec<String>>>,
    masses: Option<Spanned<Vec<f64>>>,
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Preset {
    K5,
    Octahedron,
}

#[derive(Debug)]
enum MemberList {
    List(Vec<Spanned<[usize; 2]>>),
    Complete,
}

impl<'de> Deserialize<'de> for MemberList {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Either;

        impl<'de> Visitor<'de> for Either {
            type Value = MemberList;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("a list of pairs of node numbers, or \"complete\"")
            }

            fn visit_str<E: serde::de::Error>(self, word: &str) -> Result<MemberList, E> {
                match word {
                    "complete" => Ok(MemberList::Complete),
                    other => Err(E::invalid_value(serde::de::Unexpected::Str(other), &self)),
                }
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<MemberList, A::Error> {
                let mut members = Vec::new();
                while let Some(member) = list.next_element()? {
                    members.push(member);
                }
                Ok(MemberList::List(members))
            }
        }

        deserializer.deserialize_any(Either)
    }
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct LimitsTable {
    min_length: Option<Spanned<f64>>,
    max_length: Option<Spanned<f64>>,
    min_distance: Option<Spanned<f64>>,
    min_angle_degrees: Option<Spanned<f64>>,
    max_move: Option<Spanned<f64>>,
    min_rigidity: Option<Spanned<f64>>,
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum ObjectiveName {
    LeastMotion,
    NominalLengths,
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase")]
enum PersistenceName {
    Stop,
    Shrink,
    Recover,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct GreedyTable {
    objective: Option<ObjectiveName>,
    nominal_length: Option<Spanned<f64>>,
    step: Option<Spanned<f64>>,
    waypoint_tolerance: Option<Spanned<f64>>,
    persistence: Option<PersistenceName>,
    max_configurations: Option<Spanned<usize>>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct TwoTierTable {
    rolls: Option<usize>,
    roles: Option<Vec<usize>>,
    steps: Option<usize>,
    starts: Option<usize>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct ObstacleTable {
    corners: Option<Spanned<Vec<[f64; 2]>>>,
    min: Option<[f64; 2]>,
    max: Option<[f64; 2]>,
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
        let (primitives, smoothing_rolls, roles) =
            read_two_tier(&at, file.two_tier.as_ref(), robot.graph().num_nodes())?;
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
            primitives,
            smoothing_rolls,
            roles,
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

fn read_robot(
    at: &Locator<'_>,
    table: &Spanned<RobotTable>,
    limits: &Limits,
) -> Result<(Robot, Vec<String>, Stance), WalkProblemError> {
    let given = table.get_ref();
    let (mut robot, mut start) = match &given.preset {
        Some(preset) => {
            for (present, name) in [
                (given.nodes.is_some(), "nodes"),
                (given.members.is_some(), "members"),
                (given.support.is_some(), "support"),
            ] {
                if present {
                    let message = format!("give either a preset or `{name}`, not both");
                    return Err(at.error(preset.span(), message));
                }
            }
            let RobotAtStart { robot, stance } = match preset.get_ref() {
                Preset::K5 => unit_k5(limits.clone()),
                Preset::Octahedron => unit_octahedron(limits.clone()),
            }
            .map_err(|error| at.error(preset.span(), error))?;
            (robot, stance)
        }
        None => read_explicit_robot(at, table, limits)?,
    };
    if let Some(masses) = &given.masses {
        robot = robot
            .with_masses(masses.get_ref())
            .map_err(|error| at.error(masses.span(), error))?;
    }
    let names = match &given.names {
        Some(names) => {
            let count = robot.graph().num_nodes();
            if names.get_ref().len() != count {
                let message = format!(
                    "{} names for {count} nodes: name each once",
                    names.get_ref().len()
                );
                return Err(at.error(names.span(), message));
            }
            names.get_ref().clone()
        }
        None => Vec::new(),
    };
    if let Some(centre) = &given.centre_of_mass {
        let place = read_place(at, centre, robot.dimension(), "the centre of mass")?;
        let moved = RobotAtStart {
            robot,
            stance: start,
        }
        .moved_to(place);
        (robot, start) = (moved.robot, moved.stance);
    }
    Ok((robot, names, start))
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

/// More members than this would make pairs of members too many to watch.
const MOST_MEMBERS: usize = 2000;

fn read_explicit_robot(
    at: &Locator<'_>,
    table: &Spanned<RobotTable>,
    limits: &Limits,
) -> Result<(Robot, Stance), WalkProblemError> {
    let given = table.get_ref();
    let missing = |name: &str| {
        at.error(
            table.span(),
            format!("the robot needs `{name}` (or a `preset`)"),
        )
    };
    let nodes = given.nodes.as_ref().ok_or_else(|| missing("nodes"))?;
    let members = given.members.as_ref().ok_or_else(|| missing("members"))?;
    let support = given.support.as_ref().ok_or_else(|| missing("support"))?;

    let axes = nodes
        .get_ref()
        .first()
        .map_or(0, |position| position.get_ref().len());
    let dimension = Dimension::try_from(axes).map_err(|_| {
        at.error(
            nodes.span(),
            "give each node two coordinates (plane) or three (space)",
        )
    })?;
    let mut coordinates = Vec::with_capacity(axes * nodes.get_ref().len());
    for (node, position) in nodes.get_ref().iter().enumerate() {
        if position.get_ref().len() != axes {
            let message = format!(
                "node {node} has {} coordinates, node 0 has {axes}",
                position.get_ref().len()
            );
            return Err(at.error(position.span(), message));
        }
        if let Some(value) = position.get_ref().iter().find(|value| !value.is_finite()) {
            let message = format!("node {node} has the coordinate {value}: give finite numbers");
            return Err(at.error(position.span(), message));
        }
        coordinates.extend_from_slice(position.get_ref());
    }
    let count = nodes.get_ref().len();
    let num_members = match members.get_ref() {
        MemberList::List(list) => list.len(),
        MemberList::Complete => count.saturating_mul(count.saturating_sub(1)) / 2,
    };
    if num_members > MOST_MEMBERS {
        let message = format!("{num_members} members are too many: at most {MOST_MEMBERS}");
        return Err(at.error(members.span(), message));
    }
    let graph = match members.get_ref() {
        MemberList::List(list) => Graph::new(count, list.iter().map(|member| *member.get_ref())),
        MemberList::Complete => Graph::complete(count),
    }
    .map_err(|error| {
        let member = |index: usize| match members.get_ref() {
            MemberList::List(list) => list.get(index).map(Spanned::span),
            MemberList::Complete => None,
        };
        let span = match error {
            GraphError::NodeOutOfRange { member: index, .. }
            | GraphError::Loop { member: index, .. }
            | GraphError::Duplicate { second: index, .. } => member(index),
            GraphError::FreeNode { node } => nodes.get_ref().get(node).map(Spanned::span),
            GraphError::TooSmall { .. } => Some(nodes.span()),
        };
        at.error(span.unwrap_or_else(|| members.span()), error)
    })?;
    // Coinciding ends of a member are refused here, with the nodes.
    Framework::new(graph.clone(), dimension, coordinates.clone())
        .map_err(|error| at.error(nodes.span(), error))?;
    let robot = Robot::new(graph, dimension, limits.clone())
        .map_err(|error| at.error(table.span(), error))?;
    let support =
        Support::new(&robot, support.get_ref()).map_err(|error| at.error(support.span(), error))?;
    Ok((
        robot,
        Stance {
            coordinates,
            support,
        },
    ))
}

/// Refuses a robot that is not rigid, violates a limit or does not stand.
fn check_start(
    at: &Locator<'_>,
    table: &Spanned<RobotTable>,
    robot: &Robot,
    start: &Stance,
) -> Result<(), WalkProblemError> {
    let given = table.get_ref();
    let place = |key: Option<Range<usize>>| key.unwrap_or_else(|| table.span());
    let (nodes, members) = (
        given.nodes.as_ref().map(Spanned::span),
        given.members.as_ref().map(Spanned::span),
    );
    let framework = robot
        .framework(&start.coordinates)
        .map_err(|error| at.error(place(nodes.clone()), error))?;
    let rigidity = Rigidity::of(&framework);
    if !rigidity.is_infinitesimally_rigid() {
        let loose: Vec<String> = rigidity
            .loose_nodes()
            .into_iter()
            .map(|node| {
                match given
                    .names
                    .as_ref()
                    .and_then(|names| names.get_ref().get(node))
                {
                    Some(name) => format!("{node} ({name})"),
                    None => node.to_string(),
                }
            })
            .collect();
        let message = format!(
            "the robot is not infinitesimally rigid: it has {} mechanism(s), which move nodes \
             {}; add members there, or move nodes out of a common line or plane",
            rigidity.num_mechanisms(),
            loose.join(", ")
        );
        return Err(at.error(place(members), message));
    }
    let violations = robot.violations(&start.coordinates, 1e-6);
    if let Some((constraint, violation)) = violations.first() {
        let message = format!(
            "the initial configuration violates the {constraint} by {violation:.6} ({} \
             constraint(s) in all): change the positions or the limits",
            violations.len()
        );
        return Err(at.error(place(nodes), message));
    }
    start
        .support
        .validate(robot, &start.coordinates, 1e-6)
        .map_err(|error| {
            let support = given.support.as_ref().map(Spanned::span);
            at.error(place(support), format!("the robot does not stand: {error}"))
        })
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

fn read_greedy(
    at: &Locator<'_>,
    table: Option<&Spanned<GreedyTable>>,
    clearance: f64,
) -> Result<GreedyOptions, WalkProblemError> {
    let mut options = GreedyOptions::default().with_obstacle_clearance(Some(clearance));
    let Some(table) = table else {
        return Ok(options);
    };
    let given = table.get_ref();
    if let Some(ObjectiveName::NominalLengths) = given.objective {
        let nominal = given
            .nominal_length
            .as_ref()
            .map_or(1.0, |value| *value.get_ref());
        options.objective = GreedyObjective::NominalLengths(nominal);
    } else if let Some(nominal) = &given.nominal_length {
        let message = "`nominal_length` needs objective = \"nominal-lengths\"";
        return Err(at.error(nominal.span(), message));
    }
    if let Some(step) = &given.step {
        options.step = *step.get_ref();
    }
    if let Some(tolerance) = &given.waypoint_tolerance {
        options.waypoint_tolerance = *tolerance.get_ref();
    }
    if let Some(most) = &given.max_configurations {
        options.max_configurations = *most.get_ref();
    }
    options.persistence = match given.persistence {
        Some(PersistenceName::Stop) => Persistence::Stop,
        Some(PersistenceName::Shrink) => Persistence::Shrink,
        Some(PersistenceName::Recover) | None => Persistence::Recover,
    };
    options.validate().map_err(|error| {
        let span = match &error {
            GreedyError::Option { name, .. } => match *name {
                "step" => given.step.as_ref().map(Spanned::span),
                "waypoint_tolerance" => given.waypoint_tolerance.as_ref().map(Spanned::span),
                "max_configurations" => given.max_configurations.as_ref().map(Spanned::span),
                _ => given.nominal_length.as_ref().map(Spanned::span),
            },
            _ => None,
        };
        at.error(span.unwrap_or_else(|| table.span()), error)
    })?;
    Ok(options)
}

/// Rolls of the longest primitives that a two-tier walk is smoothed with, unless the file says
/// otherwise. The paper smooths over two; more are cheaper a roll, but the number of primitives
/// doubles with each.
const SMOOTHING_ROLLS: usize = 4;

fn read_two_tier(
    at: &Locator<'_>,
    table: Option<&Spanned<TwoTierTable>>,
    nodes: usize,
) -> Result<(PrimitiveOptions, usize, Option<Vec<usize>>), WalkProblemError> {
    let mut options = PrimitiveOptions::default();
    let Some(table) = table else {
        return Ok((options, SMOOTHING_ROLLS, None));
    };
    let given = table.get_ref();
    if let Some(steps) = given.steps {
        options.steps = steps;
        options.tip = steps / 2;
    }
    if let Some(starts) = given.starts {
        options.starts = starts;
    }
    options
        .validate()
        .map_err(|error| at.error(table.span(), error))?;
    let rolls = given.rolls.unwrap_or(SMOOTHING_ROLLS);
    if !(1..=6).contains(&rolls) {
        let message = format!("`rolls` is {rolls}: it must lie between 1 and 6");
        return Err(at.error(table.span(), message));
    }
    if let Some(roles) = &given.roles
        && roles.len() != nodes
    {
        let message = format!("`roles` names {} nodes of {nodes}", roles.len());
        return Err(at.error(table.span(), message));
    }
    Ok((options, rolls, given.roles.clone()))
}
