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

mod distance;
mod fault;
mod moment;
mod motion;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

pub use fault::{WalkFault, WalkFaultKind};

use crate::walk::{Visit, Walk};
use crate::{Dimension, Limits, Obstacle, WalkGoal, WalkProblem};

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
        } else if !((facts.mass_fractions.iter().sum::<f64>() - 1.0).abs() <= 1e-9)
            || facts.mass_fractions.iter().any(|&part| part < 0.0)
        {
            self.malformed(
                0,
                "the parts of the mass are negative or do not add up to 1",
            );
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
