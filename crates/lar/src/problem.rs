//! Walk problems in TOML files.
//!
//! ```toml
//! name = "around the block"
//! planner = "two-tier"                 # or "greedy"
//! seed = 0
//! waypoints = [[2.0, 1.0], [4.0, 0.5]]
//! # or, instead of waypoints, a region to end in:
//! # goal = { centre = [4.0, 0.5], radius = 0.5 }
//!
//! [robot]
//! preset = "octahedron"                # or "k5"; or nodes, members and support as below
//! centre_of_mass = [0.0, 0.0]          # optional: moves the robot there
//! # nodes = [[0.0, 0.0, 0.0], …]       # two numbers each for a robot in the plane
//! # members = [[0, 1], …]              # or "complete"
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
use thiserror::Error;
use toml::Spanned;

use crate::known::RobotAtStart;
use crate::{
    Dimension, Framework, Graph, GraphError, GreedyObjective, GreedyOptions, GridGoal, Limits,
    Obstacle, Persistence, PrimitiveOptions, Rigidity, Robot, Stance, Support, unit_k5,
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
    waypoints: Option<Spanned<Vec<Spanned<[f64; 2]>>>>,
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
    centre: [f64; 2],
    radius: f64,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RobotTable {
    preset: Option<Spanned<Preset>>,
    centre_of_mass: Option<[f64; 2]>,
    nodes: Option<Spanned<Vec<Spanned<Vec<f64>>>>>,
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

#[derive(Debug, Deserialize)]
#[serde(untagged)]
enum MemberList {
    List(Vec<[usize; 2]>),
    Word(String),
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct LimitsTable {
    min_length: Option<f64>,
    max_length: Option<f64>,
    min_distance: Option<f64>,
    min_angle_degrees: Option<f64>,
    max_move: Option<f64>,
    min_rigidity: Option<f64>,
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
    nominal_length: Option<f64>,
    step: Option<f64>,
    waypoint_tolerance: Option<f64>,
    persistence: Option<PersistenceName>,
    max_configurations: Option<usize>,
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
    corners: Option<Vec<[f64; 2]>>,
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
        let robot_span = file.robot.span();
        let (robot, node_names, start) = read_robot(&at, &file.robot, &limits)?;
        check_start(&at, robot_span, &robot, &start)?;

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
        let goal = read_goal(&at, &file, &obstacles, obstacle_clearance)?;
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
    for (target, value) in [
        (&mut limits.min_length, given.min_length),
        (&mut limits.max_length, given.max_length),
        (&mut limits.min_distance, given.min_distance),
        (
            &mut limits.min_angle,
            given.min_angle_degrees.map(f64::to_radians),
        ),
        (&mut limits.max_move, given.max_move),
    ] {
        if let Some(value) = value {
            *target = value;
        }
    }
    limits.min_rigidity = given.min_rigidity;
    limits
        .validate()
        .map_err(|error| at.error(table.span(), error))?;
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
    if let Some([x, y]) = given.centre_of_mass {
        if !x.is_finite() || !y.is_finite() {
            return Err(at.error(table.span(), "the centre of mass must be finite"));
        }
        let moved = RobotAtStart {
            robot,
            stance: start,
        }
        .moved_to([x, y]);
        (robot, start) = (moved.robot, moved.stance);
    }
    Ok((robot, names, start))
}

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
    let graph = match members.get_ref() {
        MemberList::List(list) => Graph::new(count, list.iter().copied()),
        MemberList::Word(word) if word == "complete" => Graph::complete(count),
        MemberList::Word(word) => {
            let message = format!("`{word}` is not a list of members: give pairs or \"complete\"");
            return Err(at.error(members.span(), message));
        }
    }
    .map_err(|error: GraphError| at.error(members.span(), error))?;
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

/// A robot that is not rigid, violates a limit or does not stand.
fn check_start(
    at: &Locator<'_>,
    span: Range<usize>,
    robot: &Robot,
    start: &Stance,
) -> Result<(), WalkProblemError> {
    let framework = robot
        .framework(&start.coordinates)
        .map_err(|error| at.error(span.clone(), error))?;
    let rigidity = Rigidity::of(&framework);
    if !rigidity.is_infinitesimally_rigid() {
        let message = format!(
            "the robot is not infinitesimally rigid: it has {} mechanism(s), which move nodes \
             {:?}; add members there",
            rigidity.num_mechanisms(),
            rigidity.loose_nodes()
        );
        return Err(at.error(span, message));
    }
    let violations = robot.violations(&start.coordinates, 1e-6);
    if let Some((constraint, violation)) = violations.first() {
        let message = format!(
            "the initial configuration violates the {constraint} by {violation:.6} ({} \
             constraint(s) in all): change the positions or the limits",
            violations.len()
        );
        return Err(at.error(span, message));
    }
    start
        .support
        .validate(robot, &start.coordinates, 1e-6)
        .map_err(|error| at.error(span, format!("the robot does not stand: {error}")))
}

fn read_obstacle(
    at: &Locator<'_>,
    table: &Spanned<ObstacleTable>,
) -> Result<Obstacle, WalkProblemError> {
    let obstacle = match table.get_ref() {
        ObstacleTable {
            corners: Some(corners),
            min: None,
            max: None,
        } => Obstacle::new(corners),
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
    obstacle.map_err(|error| at.error(table.span(), error))
}

fn read_goal(
    at: &Locator<'_>,
    file: &File,
    obstacles: &[Obstacle],
    clearance: f64,
) -> Result<WalkGoal, WalkProblemError> {
    let check =
        |[x, y]: [f64; 2], span: Range<usize>, what: String| {
            if !x.is_finite() || !y.is_finite() {
                return Err(at.error(span, format!("{what} is ({x}, {y}): give finite numbers")));
            }
            match obstacles.iter().position(|o| o.contains(&Point2::new(x, y), clearance)) {
            Some(obstacle) => Err(at.error(
                span,
                format!(
                    "{what} lies inside obstacle {obstacle} or within {clearance} of it: move one \
                     of them"
                ),
            )),
            None => Ok(()),
        }
        };
    match (&file.waypoints, &file.goal) {
        (Some(waypoints), None) => {
            let points = waypoints.get_ref();
            if points.is_empty() {
                return Err(at.error(waypoints.span(), "give at least one waypoint"));
            }
            for (index, point) in points.iter().enumerate() {
                check(*point.get_ref(), point.span(), format!("waypoint {index}"))?;
            }
            Ok(WalkGoal::Waypoints(
                points.iter().map(|point| *point.get_ref()).collect(),
            ))
        }
        (None, Some(goal)) => {
            let Region { centre, radius } = *goal.get_ref();
            check(centre, goal.span(), "the centre of the goal".to_owned())?;
            if !(radius > 0.0 && radius.is_finite()) {
                let message = format!("the radius of the goal is {radius}: it must be positive");
                return Err(at.error(goal.span(), message));
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
    let nominal = given.nominal_length.unwrap_or(1.0);
    if let Some(ObjectiveName::NominalLengths) = given.objective {
        options.objective = GreedyObjective::NominalLengths(nominal);
    } else if given.nominal_length.is_some() {
        let message = "`nominal_length` needs objective = \"nominal-lengths\"";
        return Err(at.error(table.span(), message));
    }
    if let Some(step) = given.step {
        options.step = step;
    }
    if let Some(tolerance) = given.waypoint_tolerance {
        options.waypoint_tolerance = tolerance;
    }
    if let Some(most) = given.max_configurations {
        options.max_configurations = most;
    }
    options.persistence = match given.persistence {
        Some(PersistenceName::Stop) => Persistence::Stop,
        Some(PersistenceName::Shrink) => Persistence::Shrink,
        Some(PersistenceName::Recover) | None => Persistence::Recover,
    };
    options
        .validate()
        .map_err(|error| at.error(table.span(), error))?;
    Ok(options)
}

fn read_two_tier(
    at: &Locator<'_>,
    table: Option<&Spanned<TwoTierTable>>,
    nodes: usize,
) -> Result<(PrimitiveOptions, usize, Option<Vec<usize>>), WalkProblemError> {
    let mut options = PrimitiveOptions::default();
    let Some(table) = table else {
        return Ok((options, 2, None));
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
    let rolls = given.rolls.unwrap_or(2);
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
