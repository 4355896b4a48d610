//! The independent check of a walk.
//!
//! It judges a walk from its configurations alone and shares no code with the planners: lengths,
//! angles, distances, rigidity, balance and rolls are computed here from the positions by other
//! formulas than those that planning uses. Between configurations the motion is sampled, 20 times
//! finer by default.
//!
//! What must hold:
//! - at every configuration: all limits, all nodes on or above the ground, the support nodes on
//!   it, the centre of mass above the support;
//! - between configurations: the same for ground and balance, lengths and angles within 1 % of
//!   their limits, members at least the certified clearance apart that the walk states;
//! - a roll starts with the centre of mass above (or beyond) the side rolled over, turns about
//!   that side until exactly one node of the new support comes down, and keeps the two nodes of
//!   the side in place;
//! - support nodes do not slide; nodes move at most d_move in a step;
//! - the waypoints are visited in order and no obstacle is touched.
//!
//! Cost: O(configurations × samples × (pairs + corners)), and one singular value decomposition a
//! configuration.

use nalgebra::{DMatrix, Point2, Rotation3, Unit, Vector3};
use serde::{Deserialize, Serialize};

use crate::walk::{Visit, Walk};
use crate::{Constraint, Dimension, Limits, Obstacle, WalkGoal, WalkProblem};

/// What a walk is judged by.
#[derive(Debug, Clone, PartialEq)]
pub struct WalkFacts {
    /// Number of coordinates of a position.
    pub dimension: Dimension,
    /// Number of nodes.
    pub nodes: usize,
    /// The nodes that each member joins.
    pub edges: Vec<[usize; 2]>,
    /// Part of the mass that sits at each node.
    pub mass_fractions: Vec<f64>,
    /// The limits.
    pub limits: Limits,
    /// Points to visit in order.
    pub waypoints: Vec<[f64; 2]>,
    /// When a waypoint counts as visited.
    pub visit: Visit,
    /// Obstacles.
    pub obstacles: Vec<Obstacle>,
    /// Distance to keep from them, seen from above.
    pub obstacle_clearance: f64,
    /// Coordinates that the walk has to start from, if it has to.
    pub start: Option<Vec<f64>>,
}

impl WalkFacts {
    /// The facts that a walk states about itself.
    #[must_use]
    pub fn of(walk: &Walk) -> Self {
        Self {
            dimension: walk.dimension,
            nodes: walk.nodes.len(),
            edges: walk.edges.clone(),
            mass_fractions: walk.mass_fractions.clone(),
            limits: walk.limits.clone(),
            waypoints: walk.waypoints.clone(),
            visit: walk.visit,
            obstacles: walk.obstacles.clone(),
            obstacle_clearance: walk.obstacle_clearance,
            start: None,
        }
    }

    /// The facts of a problem. Waypoints are visited as `visit` says, for that is a matter of the
    /// planner, unless the problem has a region to end in.
    #[must_use]
    pub fn of_problem(problem: &WalkProblem, visit: Visit) -> Self {
        let robot = &problem.robot;
        Self {
            dimension: robot.dimension(),
            nodes: robot.graph().num_nodes(),
            edges: robot.graph().members().to_vec(),
            mass_fractions: robot.mass_fractions().to_vec(),
            limits: robot.limits().clone(),
            waypoints: problem.goal.points(),
            visit: match (&problem.goal, visit) {
                (WalkGoal::Region { radius, .. }, _) => Visit::CentreOfMass(*radius),
                (WalkGoal::Waypoints(_), Visit::Support) => Visit::Support,
                (WalkGoal::Waypoints(_), Visit::CentreOfMass(_)) => {
                    Visit::CentreOfMass(problem.greedy.waypoint_tolerance)
                }
            },
            obstacles: problem.obstacles.clone(),
            obstacle_clearance: problem.obstacle_clearance,
            start: Some(problem.start.coordinates.clone()),
        }
    }
}

/// How strictly a walk is checked.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct WalkCheckOptions {
    /// Largest violation at a configuration, and of ground, balance and standing still anywhere.
    /// Default 1e-6.
    pub tolerance: f64,
    /// Part of a limit by which lengths and angles may miss it between configurations. Default
    /// 0.01.
    pub between: f64,
    /// Samples between two configurations. Default 20.
    pub samples: usize,
}

impl Default for WalkCheckOptions {
    fn default() -> Self {
        Self {
            tolerance: 1e-6,
            between: 0.01,
            samples: 20,
        }
    }
}

impl WalkCheckOptions {
    crate::limits::setters! {
        tolerance / with_tolerance: f64;
        between / with_between: f64;
        samples / with_samples: usize;
    }
}

/// The verdict on a walk.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct WalkCheck {
    /// Whether everything holds; `ok` in files.
    #[serde(rename = "ok")]
    pub valid: bool,
    /// What does not, at most 100 entries.
    pub faults: Vec<WalkFault>,
    /// Number of faults found.
    pub num_faults: usize,
    /// Largest violation of a constraint at a configuration (negative when all keep away from
    /// their bounds); none for a walk that could not be judged.
    pub worst_violation: Option<f64>,
    /// Least distance of members that share no node, at and between configurations.
    pub least_distance: Option<f64>,
    /// Least height of a node, at and between configurations.
    pub least_height: Option<f64>,
    /// Largest displacement of a support node between configurations.
    pub worst_slide: f64,
    /// Waypoints visited in order.
    pub visited: usize,
    /// Positions sampled, configurations included.
    pub samples: usize,
}

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

/// Judges a walk by the facts of its problem. A walk that is malformed beyond reading (a wrong
/// number of nodes, say) is reported as such and not judged further.
///
/// # Examples
///
/// ```
/// use tensegra_lar::*;
///
/// let start = unit_octahedron(Limits::default())?;
/// let options = GreedyOptions::default();
/// let outcome = GreedyPlanner::new(&start.robot, options)?.walk(&start.stance, &[[0.5, 0.0]])?;
/// let context = WalkContext {
///     name: "half a unit",
///     robot: &start.robot,
///     node_names: &[],
///     waypoints: &[[0.5, 0.0]],
///     visit: Visit::CentreOfMass(0.05),
///     obstacles: &[],
///     obstacle_clearance: 0.0,
/// };
/// let walk = Walk::new(&context, &outcome.motion, WalkStatistics::default());
/// let verdict = check_walk(&WalkFacts::of(&walk), &walk, &WalkCheckOptions::default());
/// assert!(verdict.valid, "{:?}", verdict.faults);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[must_use]
pub fn check_walk(facts: &WalkFacts, walk: &Walk, options: &WalkCheckOptions) -> WalkCheck {
    let mut checker = Checker {
        facts,
        walk,
        options,
        verdict: WalkCheck::default(),
    };
    if checker.well_formed() {
        checker.run();
    }
    let mut verdict = checker.verdict;
    verdict.valid = verdict.num_faults == 0;
    verdict
}

const MAX_FAULTS: usize = 100;

/// Keeps the largest value seen.
fn raise(largest: &mut Option<f64>, value: f64) {
    *largest = Some(largest.map_or(value, |known| known.max(value)));
}

/// Keeps the least value seen.
fn lower(least: &mut Option<f64>, value: f64) {
    *least = Some(least.map_or(value, |known| known.min(value)));
}

struct Checker<'a> {
    facts: &'a WalkFacts,
    walk: &'a Walk,
    options: &'a WalkCheckOptions,
    verdict: WalkCheck,
}

impl Checker<'_> {
    fn fault(&mut self, configuration: usize, between: bool, kind: WalkFaultKind) {
        self.verdict.num_faults += 1;
        if self.verdict.faults.len() < MAX_FAULTS {
            self.verdict.faults.push(WalkFault {
                configuration,
                between,
                kind,
            });
        }
    }

    fn malformed(&mut self, configuration: usize, what: impl Into<String>) {
        self.fault(
            configuration,
            false,
            WalkFaultKind::Malformed { what: what.into() },
        );
    }

    /// Whether the walk can be read at all; faults are reported.
    fn well_formed(&mut self) -> bool {
        let (facts, walk) = (self.facts, self.walk);
        let axes = facts.dimension.axes();
        for (differs, what) in [
            (walk.dimension != facts.dimension, "dimension"),
            (walk.nodes.len() != facts.nodes, "number of nodes"),
            (walk.edges != facts.edges, "members"),
            (walk.limits != facts.limits, "limits"),
        ] {
            if differs {
                self.fault(
                    0,
                    false,
                    WalkFaultKind::OtherRobot {
                        what: what.to_owned(),
                    },
                );
            }
        }
        if facts
            .edges
            .iter()
            .flatten()
            .any(|&node| node >= facts.nodes)
        {
            self.malformed(0, "a member ends at a node that does not exist");
        }
        if facts.mass_fractions.len() != facts.nodes {
            self.malformed(0, "the masses are not one for each node");
        }
        if walk.configurations.is_empty() {
            self.malformed(0, "the walk has no configurations");
        }
        if walk.rolls.windows(2).any(|pair| pair[0] >= pair[1])
            || walk
                .rolls
                .last()
                .is_some_and(|&roll| roll + 1 >= walk.configurations.len())
        {
            self.malformed(0, "the rolls are not rising indices of configurations");
        }
        for (index, configuration) in walk.configurations.iter().enumerate() {
            let positions = &configuration.positions;
            if positions.len() != facts.nodes || positions.iter().any(|p| p.len() != axes) {
                self.malformed(
                    index,
                    "the positions do not match the nodes and the dimension",
                );
            } else if positions.iter().flatten().any(|value| !value.is_finite()) {
                self.malformed(index, "a position is not finite");
            }
            if configuration.lengths.len() != facts.edges.len() {
                self.malformed(index, "the lengths are not one for each member");
            }
            let support = &configuration.support;
            let repeated = |k: usize| support[..k].contains(&support[k]);
            if support.len() != axes
                || support.iter().any(|&node| node >= facts.nodes)
                || (0..support.len()).any(repeated)
            {
                self.malformed(
                    index,
                    "the support does not consist of that many different nodes",
                );
            }
        }
        if self.verdict.num_faults == 0
            && let (Some(start), Some(first)) = (&facts.start, walk.configurations.first())
        {
            let begins = first.positions.iter().flatten();
            if !begins
                .zip(start)
                .all(|(a, b)| (a - b).abs() <= self.options.tolerance)
            {
                self.fault(0, false, WalkFaultKind::OtherStart);
            }
        }
        self.verdict.num_faults == 0
    }

    fn positions(&self, configuration: usize) -> Vec<Vector3<f64>> {
        self.walk.configurations[configuration]
            .positions
            .iter()
            .map(|p| match self.facts.dimension {
                Dimension::Two => Vector3::new(p[0], 0.0, p[1]),
                Dimension::Three => Vector3::new(p[0], p[1], p[2]),
            })
            .collect()
    }

    fn run(&mut self) {
        let mut waypoint = 0;
        for index in 0..self.walk.configurations.len() {
            let here = self.positions(index);
            self.check_configuration(index, &here);
            while waypoint < self.facts.waypoints.len() && self.visits(index, &here, waypoint) {
                waypoint += 1;
            }
            if index + 1 < self.walk.configurations.len() {
                let next = self.positions(index + 1);
                if self.walk.rolls.contains(&index) {
                    self.check_roll(index, &here, &next);
                } else {
                    self.check_step(index, &here, &next);
                }
            }
        }
        self.verdict.visited = waypoint;
        if waypoint < self.facts.waypoints.len() {
            let last = self.walk.configurations.len() - 1;
            self.fault(last, false, WalkFaultKind::NotVisited { waypoint });
        }
    }

    fn centre(&self, positions: &[Vector3<f64>]) -> Vector3<f64> {
        let mut centre = Vector3::zeros();
        for (position, fraction) in positions.iter().zip(&self.facts.mass_fractions) {
            centre += position * *fraction;
        }
        centre
    }

    /// Signed distance of a point inside each side of the support, with the support node
    /// opposite: barycentric coordinates times heights.
    fn inside(
        &self,
        support: &[usize],
        positions: &[Vector3<f64>],
        point: &Vector3<f64>,
    ) -> Vec<(usize, f64)> {
        let flat = |v: &Vector3<f64>| Vector3::new(v.x, v.y, 0.0);
        let p: Vec<Vector3<f64>> = support.iter().map(|&node| flat(&positions[node])).collect();
        let point = flat(point);
        match self.facts.dimension {
            Dimension::Two => {
                let towards = (p[1].x - p[0].x).signum();
                vec![
                    (support[0], towards * (p[1].x - point.x)),
                    (support[1], towards * (point.x - p[0].x)),
                ]
            }
            Dimension::Three => (0..3)
                .map(|k| {
                    let (a, b) = (p[(k + 1) % 3], p[(k + 2) % 3]);
                    let area = |q: &Vector3<f64>| (b - a).cross(&(q - a)).z;
                    (
                        support[k],
                        area(&point) * area(&p[k]).signum() / (b - a).norm(),
                    )
                })
                .collect(),
        }
    }

    fn check_configuration(&mut self, index: usize, positions: &[Vector3<f64>]) {
        let configuration = &self.walk.configurations[index];
        let (facts, tolerance) = (self.facts, self.options.tolerance);
        for (member, &[a, b]) in facts.edges.iter().enumerate() {
            let actual = (positions[a] - positions[b]).norm();
            let stated = configuration.lengths[member];
            if !((stated - actual).abs() <= tolerance) {
                let kind = WalkFaultKind::WrongLength {
                    member,
                    stated,
                    actual,
                };
                self.fault(index, false, kind);
            }
        }
        self.judge(index, positions, None);
        for &node in &configuration.support {
            let height = positions[node].z;
            if !(height.abs() <= tolerance) {
                self.fault(index, false, WalkFaultKind::Slides { node, by: height });
            }
        }
        // A configuration between two rolls is left as soon as it is reached.
        let passing =
            index > 0 && self.walk.rolls.contains(&(index - 1)) && self.walk.rolls.contains(&index);
        if !passing {
            self.check_balance(index, positions, false);
        }
        if let Some(required) = facts.limits.min_rigidity {
            self.violation(
                index,
                false,
                Constraint::Rigidity,
                required - self.index(positions),
            );
        }
    }

    /// Reports a violation at a configuration beyond the tolerance.
    fn violation(&mut self, index: usize, between: bool, constraint: Constraint, violation: f64) {
        raise(&mut self.verdict.worst_violation, violation);
        if !(violation <= self.options.tolerance) {
            let kind = WalkFaultKind::Violated {
                constraint,
                violation,
            };
            self.fault(index, between, kind);
        }
    }

    fn check_balance(&mut self, index: usize, positions: &[Vector3<f64>], between: bool) {
        let support = &self.walk.configurations[index].support;
        let inside = self.inside(support, positions, &self.centre(positions));
        let least = inside.iter().map(|(_, d)| *d).fold(f64::INFINITY, f64::min);
        if between {
            if !(least >= -self.options.tolerance) {
                let kind = WalkFaultKind::Violated {
                    constraint: Constraint::Balance,
                    violation: -least,
                };
                self.fault(index, true, kind);
            }
        } else {
            self.violation(index, false, Constraint::Balance, -least);
        }
    }

    /// Lengths, angles, distances, heights and obstacles at one moment. Between configurations
    /// lengths and angles may miss their limits by a fraction, and members keep the clearance
    /// `stated` by the walk; at configurations they keep all limits.
    fn judge(&mut self, index: usize, positions: &[Vector3<f64>], stated: Option<f64>) {
        let facts = self.facts;
        let limits = &facts.limits;
        let between = stated.is_some();
        let slack = if between { self.options.between } else { 0.0 };
        self.verdict.samples += 1;
        let report = |checker: &mut Self, constraint: Constraint, violation: f64, slack: f64| {
            if between {
                if !(violation <= slack + checker.options.tolerance) {
                    let kind = WalkFaultKind::Violated {
                        constraint,
                        violation,
                    };
                    checker.fault(index, true, kind);
                }
            } else {
                checker.violation(index, false, constraint, violation);
            }
        };
        for &member in &facts.edges {
            let [a, b] = member;
            let length = (positions[a] - positions[b]).norm();
            let short = limits.min_length - length;
            report(
                self,
                Constraint::MinLength { member },
                short,
                slack * limits.min_length,
            );
            let long = length - limits.max_length;
            report(
                self,
                Constraint::MaxLength { member },
                long,
                slack * limits.max_length,
            );
        }
        for (first, &[a, b]) in facts.edges.iter().enumerate() {
            for (second, &[c, d]) in facts.edges.iter().enumerate().skip(first + 1) {
                let shared = if a == c || a == d {
                    Some((a, b, if a == c { d } else { c }))
                } else if b == c || b == d {
                    Some((b, a, if b == c { d } else { c }))
                } else {
                    None
                };
                if let Some((apex, p, q)) = shared {
                    let (u, v) = (
                        positions[p] - positions[apex],
                        positions[q] - positions[apex],
                    );
                    let (u, v) = (u.normalize(), v.normalize());
                    // The half angle by the sum and difference of unit vectors is exact for all
                    // angles.
                    let angle = 2.0 * (u - v).norm().atan2((u + v).norm());
                    let constraint = Constraint::Angle {
                        node: apex,
                        ends: [p.min(q), p.max(q)],
                    };
                    let slack = slack * limits.min_angle;
                    report(self, constraint, limits.min_angle - angle, slack);
                    continue;
                }
                let distance =
                    member_distance([positions[a], positions[b]], [positions[c], positions[d]]);
                lower(&mut self.verdict.least_distance, distance);
                match stated {
                    None => {
                        let constraint = Constraint::Distance {
                            members: [[a, b], [c, d]],
                        };
                        report(self, constraint, limits.min_distance - distance, 0.0);
                    }
                    Some(stated) => {
                        if !(distance >= stated - 1e-9) {
                            let members = [first, second];
                            let kind = WalkFaultKind::Clearance {
                                members,
                                distance,
                                stated,
                            };
                            self.fault(index, true, kind);
                        }
                    }
                }
            }
        }
        for (node, position) in positions.iter().enumerate() {
            lower(&mut self.verdict.least_height, position.z);
            report(self, Constraint::Ground { node }, -position.z, 0.0);
        }
        for (obstacle, outline) in facts.obstacles.iter().enumerate() {
            let distance = facts
                .edges
                .iter()
                .map(|&[a, b]| outline_distance(outline, positions[a], positions[b]))
                .fold(f64::INFINITY, f64::min);
            if !(distance >= facts.obstacle_clearance - self.options.tolerance) {
                self.fault(
                    index,
                    between,
                    WalkFaultKind::Obstacle { obstacle, distance },
                );
            }
        }
    }

    /// The worst-case rigidity index from the singular values of the rigidity matrix.
    fn index(&self, positions: &[Vector3<f64>]) -> f64 {
        let facts = self.facts;
        let axes = facts.dimension.axes();
        let component = |v: &Vector3<f64>, axis: usize| match facts.dimension {
            Dimension::Two => v[2 * axis],
            Dimension::Three => v[axis],
        };
        let matrix = DMatrix::from_fn(facts.edges.len(), facts.nodes * axes, |row, column| {
            let [a, b] = facts.edges[row];
            let (node, axis) = (column / axes, column % axes);
            let edge = positions[a] - positions[b];
            if node == a {
                component(&edge, axis)
            } else if node == b {
                -component(&edge, axis)
            } else {
                0.0
            }
        });
        let mut squares: Vec<f64> = matrix.singular_values().iter().map(|s| s * s).collect();
        squares.sort_by(|a, b| b.total_cmp(a));
        let total: f64 = squares.iter().sum();
        // Of d·n eigenvalues the rigid motions take the last d (d + 1)/2.
        let rank = facts.nodes * axes - axes * (axes + 1) / 2;
        squares
            .get(rank.wrapping_sub(1))
            .map_or(0.0, |smallest| smallest / total)
    }

    /// The clearance that the walk states, which no sample between configurations may undercut.
    fn stated_clearance(&self) -> f64 {
        self.walk.statistics.certified_clearance.unwrap_or(0.0)
    }

    fn check_step(&mut self, index: usize, here: &[Vector3<f64>], next: &[Vector3<f64>]) {
        let (before, after) = (
            &self.walk.configurations[index],
            &self.walk.configurations[index + 1],
        );
        let same = before
            .support
            .iter()
            .all(|node| after.support.contains(node));
        if !same {
            self.fault(index, true, WalkFaultKind::SupportChange);
        }
        for &node in &before.support {
            let by = (next[node] - here[node]).norm();
            self.verdict.worst_slide = self.verdict.worst_slide.max(by);
            if !(by <= self.options.tolerance) {
                self.fault(index, true, WalkFaultKind::Slides { node, by });
            }
        }
        for node in 0..here.len() {
            let by = (next[node] - here[node]).norm();
            if !(by <= self.facts.limits.max_move + self.options.tolerance) {
                self.fault(index, true, WalkFaultKind::Jumps { node, by });
            }
        }
        for sample in 1..self.options.samples {
            let time = sample as f64 / self.options.samples as f64;
            let moment: Vec<Vector3<f64>> = here
                .iter()
                .zip(next)
                .map(|(a, b)| a.lerp(b, time))
                .collect();
            self.judge(index, &moment, Some(self.stated_clearance()));
            self.check_balance(index, &moment, true);
        }
    }

    fn check_roll(&mut self, index: usize, here: &[Vector3<f64>], next: &[Vector3<f64>]) {
        let before = &self.walk.configurations[index].support;
        let after = &self.walk.configurations[index + 1].support;
        let pivots: Vec<usize> = before
            .iter()
            .copied()
            .filter(|node| after.contains(node))
            .collect();
        let landed = after.iter().copied().find(|node| !before.contains(node));
        let lifted = before.iter().copied().find(|node| !after.contains(node));
        let (Some(landed), Some(lifted), true) = (landed, lifted, pivots.len() + 1 == before.len())
        else {
            self.fault(index, true, WalkFaultKind::SupportChange);
            return;
        };
        for &node in &pivots {
            let by = (next[node] - here[node]).norm();
            self.verdict.worst_slide = self.verdict.worst_slide.max(by);
            if !(by <= self.options.tolerance) {
                self.fault(index, true, WalkFaultKind::Slides { node, by });
            }
        }
        let inside = self
            .inside(before, here, &self.centre(here))
            .into_iter()
            .find(|&(opposite, _)| opposite == lifted)
            .map_or(0.0, |(_, inside)| inside);
        if !(inside <= self.options.tolerance) {
            self.fault(index, true, WalkFaultKind::RollsTooEarly { inside });
        }

        // The axis of the turn, oriented so that the landing node comes down.
        let origin = here[pivots[0]];
        let axis = match self.facts.dimension {
            Dimension::Two => Vector3::y(),
            Dimension::Three => {
                let along = here[pivots[1]] - origin;
                Vector3::new(along.x, along.y, 0.0)
            }
        };
        let mut axis = Unit::new_normalize(axis);
        let away = |axis: &Unit<Vector3<f64>>| axis.cross(&Vector3::z());
        if (here[lifted] - origin).dot(&away(&axis)) > 0.0 {
            axis = -axis;
        }
        let out = away(&axis);
        let angle = (here[landed] - origin)
            .z
            .atan2((here[landed] - origin).dot(&out));
        if !(angle >= -self.options.tolerance) {
            self.fault(index, true, WalkFaultKind::SupportChange);
        }
        let turn = |by: f64| {
            let rotation = Rotation3::from_axis_angle(&axis, by);
            move |p: &Vector3<f64>| origin + rotation * (p - origin)
        };
        let back = turn(-angle);
        let shape: Vec<Vector3<f64>> = next.iter().map(&back).collect();
        for sample in 1..self.options.samples {
            let time = sample as f64 / self.options.samples as f64;
            let forward = turn(time * angle);
            let moment: Vec<Vector3<f64>> = here
                .iter()
                .zip(&shape)
                .map(|(a, b)| forward(&a.lerp(b, time)))
                .collect();
            self.judge(index, &moment, Some(self.stated_clearance()));
        }
    }

    fn visits(&self, index: usize, positions: &[Vector3<f64>], waypoint: usize) -> bool {
        let [x, y] = self.facts.waypoints[waypoint];
        let point = match self.facts.dimension {
            Dimension::Two => Vector3::new(x, 0.0, 0.0),
            Dimension::Three => Vector3::new(x, y, 0.0),
        };
        match self.facts.visit {
            Visit::CentreOfMass(tolerance) => {
                let offset = self.centre(positions) - point;
                offset.x.hypot(offset.y) <= tolerance + self.options.tolerance
            }
            Visit::Support => {
                let support = &self.walk.configurations[index].support;
                let inside = self.inside(support, positions, &point);
                inside
                    .iter()
                    .all(|&(_, inside)| inside >= -self.options.tolerance)
            }
        }
    }
}

/// Distance between two members: that of the feet of the common perpendicular where both lie on
/// the members, else the least distance of an end from the other member.
fn member_distance(first: [Vector3<f64>; 2], second: [Vector3<f64>; 2]) -> f64 {
    let (u, v) = (first[1] - first[0], second[1] - second[0]);
    let normal = u.cross(&v);
    let squared = normal.norm_squared();
    let between = second[0] - first[0];
    if squared > 1e-18 * u.norm_squared() * v.norm_squared() {
        let s = between.cross(&v).dot(&normal) / squared;
        let t = between.cross(&u).dot(&normal) / squared;
        if (0.0..=1.0).contains(&s) && (0.0..=1.0).contains(&t) {
            return between.dot(&normal).abs() / squared.sqrt();
        }
    }
    let to = |p: Vector3<f64>, member: [Vector3<f64>; 2]| {
        let side = member[1] - member[0];
        let along = ((p - member[0]).dot(&side) / side.norm_squared()).clamp(0.0, 1.0);
        (p - member[0] - side * along).norm()
    };
    to(first[0], second)
        .min(to(first[1], second))
        .min(to(second[0], first))
        .min(to(second[1], first))
}

/// Distance between a member and an obstacle seen from above; zero where they overlap.
fn outline_distance(obstacle: &Obstacle, a: Vector3<f64>, b: Vector3<f64>) -> f64 {
    let corners: Vec<Vector3<f64>> = obstacle
        .corners()
        .iter()
        .map(|p: &Point2<f64>| Vector3::new(p.x, p.y, 0.0))
        .collect();
    let flat = |v: Vector3<f64>| Vector3::new(v.x, v.y, 0.0);
    let (a, b) = (flat(a), flat(b));
    let sides = (0..corners.len()).map(|k| [corners[k], corners[(k + 1) % corners.len()]]);
    let inside = sides.clone().all(|[c, d]| (d - c).cross(&(a - c)).z >= 0.0);
    if inside {
        return 0.0;
    }
    let crosses = |c: Vector3<f64>, d: Vector3<f64>| {
        let side = |p: Vector3<f64>, q: Vector3<f64>, r: Vector3<f64>| (q - p).cross(&(r - p)).z;
        side(a, b, c) * side(a, b, d) < 0.0 && side(c, d, a) * side(c, d, b) < 0.0
    };
    let mut distance = f64::INFINITY;
    for [c, d] in sides {
        if crosses(c, d) {
            return 0.0;
        }
        let along = |p: Vector3<f64>, q: Vector3<f64>, r: Vector3<f64>| {
            let side = r - q;
            let squared = side.norm_squared().max(f64::MIN_POSITIVE);
            let t = ((p - q).dot(&side) / squared).clamp(0.0, 1.0);
            (p - q - side * t).norm()
        };
        distance = distance.min(along(a, c, d)).min(along(b, c, d));
        distance = distance.min(along(c, a, b)).min(along(d, a, b));
    }
    distance
}
