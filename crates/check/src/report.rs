//! What the judge answers.

use std::{collections::HashMap, fmt};

use serde::Serialize;
use tensegra_model::{Body, FormCondition, Problem};

/// What is judged; one figure each.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Check {
    /// Problem, options and path are of one piece: sizes, indices, values that are there.
    Input,
    /// All numbers are finite.
    Finite,
    /// Stated lengths against node positions, over the size of the structure.
    Lengths,
    /// The shortest element, over the size of the structure: below a floor it has no direction.
    ShortestElement,
    /// Lengths, rest lengths and forces that the structure holds constant, relative.
    Constants,
    /// Hooke's law f = k (l − r), over the largest force.
    HookesLaw,
    /// Force balance at the nodes, over the largest force.
    Balance,
    /// Distance of lengths inside their ranges, over the size of the structure.
    LengthRanges,
    /// Distance of rest lengths inside their ranges, over the size of the structure.
    RestRanges,
    /// Distance of forces inside their ranges, over the largest force.
    ForceRanges,
    /// Σ f² = P², relative.
    Pretension,
    /// Coordinates held fixed and the plane of a planar structure, over the size.
    Gauge,
    /// Distance of the base of a free-flying structure inside its range, over the size.
    BaseRange,
    /// Couplings of lengths, rest lengths, forces and orientations, relative.
    Couplings,
    /// Distances between the anchors of an attachment, over the size.
    Attachments,
    /// Distance of nodes in the first configuration from the problem's start, over the size.
    Start,
    /// Distance of forces and rest lengths from those stated for the start, relative.
    StartForces,
    /// Distance of nodes in the last configuration from the problem's goal, over the size.
    Goal,
    /// Distance of forces and rest lengths from those stated for the goal, relative.
    GoalForces,
    /// How far conditions on the form are missed, at an end of the path that is described by them
    /// or in a form: lengths over the size, forces over the largest force.
    Conditions,
    /// Clearance of nodes and obstacles there, in units of length.
    NodeClearance,
    /// Displacement of a node in one step, in units of length.
    Displacement,
    /// Clearance at the samples, in units of length.
    Clearance,
    /// Residual of the equilibrium that is restored between two samples, relative.
    EquilibriumBetween,
    /// Whether two samples belong to one motion: the longer half of an interval over the whole.
    Continuity,
    /// How far the motion between samples leaves the ranges, relative.
    RangesBetween,
    /// Clearance proven for the whole motion between samples, in units of length.
    ClearanceBetween,
    /// The largest force of any element. Reported, not judged.
    LargestForce,
    /// The smallest eigenvalue of the tangent stiffness on admissible motions, in force per
    /// length: negative where the equilibrium is not stable. Judged where form-finding demands
    /// stability, else reported; of structures with more than a hundred coordinates at both ends
    /// of the path only.
    Stability,
}

/// Which side of its limit a figure must stay on.
#[derive(Clone, Copy, PartialEq)]
enum Sense {
    AtMost,
    AtLeast,
}

impl Check {
    const COUNT: usize = Self::Stability as usize + 1;

    /// What a person reads.
    pub const fn title(self) -> &'static str {
        match self {
            Self::Input => "input",
            Self::Finite => "finite numbers",
            Self::Lengths => "lengths against positions",
            Self::ShortestElement => "shortest element",
            Self::Constants => "constants held",
            Self::HookesLaw => "Hooke's law",
            Self::Balance => "force balance",
            Self::LengthRanges => "length ranges, margin",
            Self::RestRanges => "rest length ranges, margin",
            Self::ForceRanges => "force ranges, margin",
            Self::Pretension => "pretension",
            Self::Gauge => "fixed coordinates",
            Self::BaseRange => "base range, margin",
            Self::Couplings => "couplings",
            Self::Attachments => "attachments rigid",
            Self::Start => "distance from start",
            Self::StartForces => "forces against start",
            Self::Goal => "distance from goal",
            Self::GoalForces => "forces against goal",
            Self::Conditions => "conditions on the form",
            Self::NodeClearance => "clearance of nodes",
            Self::Displacement => "node displacement a step",
            Self::Clearance => "clearance at samples",
            Self::EquilibriumBetween => "equilibrium between samples",
            Self::Continuity => "continuity between samples",
            Self::RangesBetween => "ranges between samples, excess",
            Self::ClearanceBetween => "clearance between samples",
            Self::LargestForce => "largest force",
            Self::Stability => "least tangent stiffness",
        }
    }

    const fn sense(self) -> Sense {
        match self {
            Self::ShortestElement
            | Self::LengthRanges
            | Self::RestRanges
            | Self::ForceRanges
            | Self::BaseRange
            | Self::NodeClearance
            | Self::Clearance
            | Self::ClearanceBetween
            | Self::Stability => Sense::AtLeast,
            _ => Sense::AtMost,
        }
    }

    /// Whether `value` respects `limit`; NaN never does.
    fn holds(self, value: f64, limit: f64) -> bool {
        match self.sense() {
            Sense::AtMost => value <= limit,
            Sense::AtLeast => value >= limit,
        }
    }

    /// Whether `value` is worse than `other`; NaN is the worst.
    fn worse(self, value: f64, other: f64) -> bool {
        !other.is_nan()
            && match self.sense() {
                Sense::AtMost => value > other || value.is_nan(),
                Sense::AtLeast => value < other || value.is_nan(),
            }
    }
}

/// Where along the path.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(tag = "at", rename_all = "snake_case")]
pub enum Location {
    /// Nowhere in particular.
    Whole,
    /// At a configuration, counted from 0.
    Configuration {
        /// Index of the configuration.
        index: usize,
    },
    /// The step from one configuration to the next.
    Step {
        /// Index of the configuration before, counted from 0.
        index: usize,
    },
    /// Between two configurations.
    Interval {
        /// Index of the configuration before, counted from 0.
        index: usize,
        /// How far on towards the next one, from 0 to 1.
        fraction: f64,
    },
}

impl fmt::Display for Location {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Whole => f.write_str("whole"),
            Self::Configuration { index } => write!(f, "configuration {index}"),
            Self::Step { index } => write!(f, "configurations {index} to {}", index + 1),
            Self::Interval { index, fraction } => {
                write!(
                    f,
                    "configurations {index} to {} at {fraction:.4}",
                    index + 1
                )
            }
        }
    }
}

/// The worst value met of one kind, and where.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Figure {
    /// What was measured, in which unit.
    pub check: Check,
    /// The worst value.
    pub value: f64,
    /// The value it is judged against, where it is judged.
    pub limit: Option<f64>,
    /// Where along the path.
    pub location: Location,
    /// The node, element, pair … concerned, empty where there is none.
    pub subject: String,
}

/// Why a path is not accepted: one for each kind of check and node, element or pair, at its worst
/// place.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Failure {
    /// What failed.
    pub check: Check,
    /// The worst value, where there is one.
    pub value: Option<f64>,
    /// The limit that it breaks.
    pub limit: Option<f64>,
    /// Where along the path it is worst.
    pub location: Location,
    /// The node, element, pair … concerned, empty where there is none.
    pub subject: String,
    /// At how many places it fails.
    pub count: usize,
    /// All of this in one sentence.
    pub message: String,
}

/// Figures of the path as a whole.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Statistics {
    /// Number of configurations.
    pub configurations: usize,
    /// Sum over the steps of the largest node displacement, in units of length.
    pub path_length: f64,
    /// Equilibria restored between samples.
    pub midpoints: usize,
    /// How often an interval was halved at most.
    pub depth: u32,
}

/// The verdict on a path or a configuration.
///
/// It serialises to one object, and displays as a table that a person can read.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// Whether nothing failed.
    pub ok: bool,
    /// What failed.
    pub failures: Vec<Failure>,
    /// The worst value of everything that was measured.
    pub figures: Vec<Figure>,
    /// Figures of the path as a whole.
    pub statistics: Statistics,
}

impl Report {
    /// The worst value of one kind; `None` where the problem has nothing of that kind.
    pub fn figure(&self, check: Check) -> Option<&Figure> {
        self.figures.iter().find(|figure| figure.check == check)
    }

    /// Whether something of one kind failed.
    pub fn fails(&self, check: Check) -> bool {
        self.failures.iter().any(|failure| failure.check == check)
    }

    /// The figures as rows of text for a table: what, value, limit, where.
    pub fn rows(&self) -> Vec<[String; 4]> {
        let row = |figure: &Figure| {
            let limit = figure.limit.map_or_else(String::new, |limit| {
                let sign = match figure.check.sense() {
                    Sense::AtMost => "≤",
                    Sense::AtLeast => "≥",
                };
                format!("{sign} {limit:.2e}")
            });
            let place = match (figure.subject.as_str(), figure.location) {
                ("", location) => location.to_string(),
                (subject, Location::Whole) => subject.to_owned(),
                (subject, location) => format!("{subject}, {location}"),
            };
            [
                figure.check.title().to_owned(),
                format!("{:.3e}", figure.value),
                limit,
                place,
            ]
        };
        self.figures.iter().map(row).collect()
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let rows = self.rows();
        let width = |column: usize| {
            rows.iter()
                .map(|row| row[column].chars().count())
                .max()
                .unwrap_or(0)
        };
        let (first, second, third) = (width(0), width(1), width(2));
        for [what, value, limit, place] in &rows {
            writeln!(
                f,
                "{what:<first$}  {value:>second$}  {limit:<third$}  {place}"
            )?;
        }
        let Statistics {
            configurations,
            path_length,
            midpoints,
            depth,
        } = self.statistics;
        writeln!(
            f,
            "{configurations} configurations, path length {path_length:.4}; {midpoints} equilibria \
             restored between samples, intervals halved at most {depth} times"
        )?;
        for failure in &self.failures {
            writeln!(f, "FAILED {}", failure.message)?;
        }
        f.write_str(if self.ok {
            "The path is accepted."
        } else {
            "The path is refused."
        })
    }
}

/// What a figure or failure concerns, by index: names are looked up once, at the end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Subject {
    None,
    Node(usize),
    Element(usize),
    Attachment(usize),
    /// A coupling of the structure, and the element that follows in it.
    Coupling(usize, usize),
    Pair([Body; 2]),
    /// A node and an obstacle.
    NodeObstacle(usize, usize),
    /// A condition on the form.
    Condition(ConditionList, usize),
}

/// Conditions on the form that a problem states.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum ConditionList {
    /// Those on every form.
    Form,
    /// Those that describe the start.
    Start,
    /// Those that describe the goal.
    Goal,
}

impl ConditionList {
    pub(crate) fn of(self, problem: &Problem) -> &[FormCondition] {
        match self {
            Self::Form => &problem.form.conditions,
            Self::Start => problem.start_form.as_deref().unwrap_or_default(),
            Self::Goal => problem.goal_form.as_deref().unwrap_or_default(),
        }
    }
}

impl Subject {
    fn name(self, problem: &Problem) -> String {
        let structure = &problem.structure;
        match self {
            Self::None => String::new(),
            Self::Node(node) => format!("node {}", structure.nodes[node].name),
            Self::Element(element) => format!("element {}", structure.elements[element].name),
            Self::Attachment(index) => format!("attachment {}", structure.attachments[index].name),
            Self::Coupling(coupling, follower) => {
                format!(
                    "coupling {}, element {}",
                    coupling + 1,
                    structure.elements[follower].name
                )
            }
            Self::Pair([a, b]) => format!("{} and {}", body(problem, a), body(problem, b)),
            Self::NodeObstacle(node, obstacle) => {
                let obstacle = body(problem, Body::Obstacle(obstacle));
                format!("node {} and {obstacle}", structure.nodes[node].name)
            }
            Self::Condition(list, index) => list.of(problem)[index].describe(structure),
        }
    }
}

fn body(problem: &Problem, body: Body) -> &str {
    match body {
        Body::Element(index) => &problem.structure.elements[index].name,
        Body::Attachment(index) => &problem.structure.attachments[index].name,
        Body::Obstacle(index) => &problem.environment.obstacles[index].name,
    }
}

#[derive(Clone, Copy)]
struct Worst {
    value: f64,
    limit: Option<f64>,
    location: Location,
    subject: Subject,
}

struct Broken {
    check: Check,
    worst: Worst,
    count: usize,
}

/// Keeps the worst figure of every check and of everything that fails.
pub(crate) struct Ledger {
    figures: [Option<Worst>; Check::COUNT],
    broken: Vec<Broken>,
    index: HashMap<(Check, Subject), usize>,
    /// Failures that are told in words.
    told: Vec<Failure>,
    pub(crate) statistics: Statistics,
}

impl Ledger {
    pub(crate) fn new() -> Self {
        Self {
            figures: [None; Check::COUNT],
            broken: Vec::new(),
            index: HashMap::new(),
            told: Vec::new(),
            statistics: Statistics::default(),
        }
    }

    /// Enters a value that must respect a limit; whether it does.
    pub(crate) fn judge(
        &mut self,
        check: Check,
        value: f64,
        limit: f64,
        location: Location,
        subject: Subject,
    ) -> bool {
        let worst = Worst {
            value,
            limit: Some(limit),
            location,
            subject,
        };
        self.figure(check, worst);
        let holds = check.holds(value, limit);
        if !holds {
            self.fail(check, worst);
        }
        holds
    }

    /// Enters a value that is reported only.
    pub(crate) fn report(
        &mut self,
        check: Check,
        value: f64,
        location: Location,
        subject: Subject,
    ) {
        self.figure(
            check,
            Worst {
                value,
                limit: None,
                location,
                subject,
            },
        );
    }

    /// The worst value so far.
    pub(crate) fn worst(&self, check: Check) -> Option<f64> {
        self.figures[check as usize].map(|worst| worst.value)
    }

    /// Enters a failure in words.
    pub(crate) fn tell(&mut self, check: Check, location: Location, message: String) {
        let (value, limit, subject) = (None, None, String::new());
        self.told.push(Failure {
            check,
            value,
            limit,
            location,
            subject,
            count: 1,
            message,
        });
    }

    fn figure(&mut self, check: Check, worst: Worst) {
        let entry = &mut self.figures[check as usize];
        if entry.is_none_or(|old| check.worse(worst.value, old.value)) {
            *entry = Some(worst);
        }
    }

    fn fail(&mut self, check: Check, worst: Worst) {
        let next = self.broken.len();
        let at = *self.index.entry((check, worst.subject)).or_insert(next);
        if at == next {
            self.broken.push(Broken {
                check,
                worst,
                count: 1,
            });
        } else {
            let broken = &mut self.broken[at];
            broken.count += 1;
            if check.worse(worst.value, broken.worst.value) {
                broken.worst = worst;
            }
        }
    }

    pub(crate) fn into_report(self, problem: &Problem) -> Report {
        let mut failures = self.told;
        failures.extend(self.broken.into_iter().map(
            |Broken {
                 check,
                 worst,
                 count,
             }| {
                let subject = worst.subject.name(problem);
                let message = sentence(check, &worst, &subject, count);
                let (value, limit, location) = (Some(worst.value), worst.limit, worst.location);
                Failure {
                    check,
                    value,
                    limit,
                    location,
                    subject,
                    count,
                    message,
                }
            },
        ));
        failures.sort_by_key(|failure| failure.check);
        let figures = CHECKS
            .iter()
            .zip(self.figures)
            .filter_map(|(&check, worst)| {
                worst.map(
                    |Worst {
                         value,
                         limit,
                         location,
                         subject,
                     }| Figure {
                        check,
                        value,
                        limit,
                        location,
                        subject: subject.name(problem),
                    },
                )
            });
        Report {
            ok: failures.is_empty(),
            figures: figures.collect(),
            failures,
            statistics: self.statistics,
        }
    }
}

fn sentence(check: Check, worst: &Worst, subject: &str, count: usize) -> String {
    let mut text = check.title().to_owned();
    if !subject.is_empty() {
        text.push_str(&format!(", {subject}"));
    }
    if worst.location != Location::Whole {
        text.push_str(&format!(", {}", worst.location));
    }
    text.push_str(&format!(": {:.3e}", worst.value));
    if let Some(limit) = worst.limit {
        let bound = match check.sense() {
            Sense::AtMost => "at most",
            Sense::AtLeast => "at least",
        };
        text.push_str(&format!(", {bound} {limit:.3e} is accepted"));
    }
    if count > 1 {
        text.push_str(&format!(" (fails at {count} places)"));
    }
    text
}

/// All checks, in the order of their discriminants.
const CHECKS: [Check; Check::COUNT] = [
    Check::Input,
    Check::Finite,
    Check::Lengths,
    Check::ShortestElement,
    Check::Constants,
    Check::HookesLaw,
    Check::Balance,
    Check::LengthRanges,
    Check::RestRanges,
    Check::ForceRanges,
    Check::Pretension,
    Check::Gauge,
    Check::BaseRange,
    Check::Couplings,
    Check::Attachments,
    Check::Start,
    Check::StartForces,
    Check::Goal,
    Check::GoalForces,
    Check::Conditions,
    Check::NodeClearance,
    Check::Displacement,
    Check::Clearance,
    Check::EquilibriumBetween,
    Check::Continuity,
    Check::RangesBetween,
    Check::ClearanceBetween,
    Check::LargestForce,
    Check::Stability,
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn checks_are_listed_in_the_order_of_their_discriminants() {
        for (index, check) in CHECKS.iter().enumerate() {
            assert_eq!(*check as usize, index);
        }
    }

    #[test]
    fn nan_neither_holds_nor_is_replaced_as_the_worst() {
        for check in [Check::Balance, Check::Clearance] {
            assert!(!check.holds(f64::NAN, 0.0));
            assert!(check.worse(f64::NAN, 1.0));
            assert!(!check.worse(1.0, f64::NAN));
        }
    }
}
