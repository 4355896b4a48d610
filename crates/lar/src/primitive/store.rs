//! Motion primitives and gaits in files.
//!
//! A file holds the robot with its symmetric start, and the motions. Everything that can be
//! checked is checked again on reading, by the independent check as well, so that a motion from a
//! file is as good as one computed.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::gait::{TipImages, strip_period};
use super::sequence::Stance;
use super::symmetry::relabellings;
use super::{Gait, Primitive, SupportedMotion, SymmetricRobot, Turn, TurningGait};
use crate::graph::MOST_MEMBERS;
use crate::{
    Dimension, Graph, GraphError, Limits, Robot, RobotError, Support, SupportError, SymmetryError,
    Visit, Walk, WalkCheckOptions, WalkContext, WalkFacts, WalkStatistics, check_walk,
};

const PRIMITIVE_FORMAT: &str = "tensegra-primitive";
const STRIP_GAIT_FORMAT: &str = "tensegra-strip-gait";
const GAIT_FORMAT: &str = "tensegra-gait";
pub(crate) const VERSION: u32 = 2;
/// Constraints of a stored motion hold to this tolerance.
const TOLERANCE: f64 = 1e-6;

/// Positions of the nodes at each configuration of a motion.
type Positions = Vec<Vec<[f64; 3]>>;

/// Looks at the format and version of a file before the rest is read.
pub(crate) fn require_format(text: &str, expected: &'static str) -> Result<(), MotionFileError> {
    #[derive(Deserialize)]
    struct Header {
        format: String,
        version: u32,
    }
    let Header { format, version } = serde_json::from_str(text)?;
    if format != expected || version != VERSION {
        return Err(MotionFileError::Format {
            format,
            version,
            expected,
        });
    }
    Ok(())
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct MotionFile<M> {
    format: String,
    version: u32,
    robot: StoredRobot,
    motion: M,
}

/// A [`SymmetricRobot`] as it is stored.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct StoredRobot {
    nodes: usize,
    edges: Vec<[usize; 2]>,
    mass_fractions: Vec<f64>,
    limits: Limits,
    start: Vec<[f64; 3]>,
    support: Vec<usize>,
    side: usize,
    roles: Vec<usize>,
}

/// A [`Primitive`] as it is stored, without its robot.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct StoredPrimitive {
    turns: Vec<Turn>,
    rolls: Vec<usize>,
    configurations: Positions,
}

/// A [`Gait`] as it is stored, without its robot.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct StoredStripGait {
    period: Positions,
}

/// A [`TurningGait`] as it is stored, without its robot.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct StoredGait {
    entry: Positions,
    turn: Positions,
    back: Option<Positions>,
    exit: Positions,
}

/// Why a file does not hold the motions that it should.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum MotionFileError {
    /// Not JSON of the expected shape.
    #[error("not a file of motions: {0}")]
    Json(#[from] serde_json::Error),
    /// Another format or version.
    #[error(
        "the file has format `{format}` version {version}; this reads `{expected}` version {VERSION}; \
         motions of another version have to be optimised anew"
    )]
    Format {
        /// Format found.
        format: String,
        /// Version found.
        version: u32,
        /// Format expected.
        expected: &'static str,
    },
    /// The graph is not that of a robot.
    #[error(transparent)]
    Graph(#[from] GraphError),
    /// The robot cannot be.
    #[error(transparent)]
    Robot(#[from] RobotError),
    /// The support is not one.
    #[error(transparent)]
    Support(#[from] SupportError),
    /// The start is not symmetric.
    #[error(transparent)]
    Symmetry(#[from] SymmetryError),
    /// The renaming of nodes is not one that the start permits.
    #[error("the renaming of nodes {roles:?} does not lead from one symmetric stance to the next")]
    Roles {
        /// The renaming found.
        roles: Vec<usize>,
    },
    /// The motion does not fit the rest of the file.
    #[error("the motion does not fit: {reason}")]
    Motion {
        /// What does not fit.
        reason: String,
    },
    /// The motions are those of another robot than the problem's.
    #[error("the motions are those of another robot: {what}")]
    OtherRobot {
        /// What differs.
        what: String,
    },
    /// The motions were optimised with other options than the problem's.
    #[error("the motions were optimised with `{key}` = {found}, the problem has {expected}")]
    OtherOptions {
        /// Key of the table `two_tier`.
        key: &'static str,
        /// Its value in the file.
        found: String,
        /// Its value in the problem.
        expected: String,
    },
}

fn unfit(reason: impl Into<String>) -> MotionFileError {
    MotionFileError::Motion {
        reason: reason.into(),
    }
}

fn positions(configurations: &[Vec<f64>]) -> Positions {
    configurations
        .iter()
        .map(|x| x.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect())
        .collect()
}

fn require_same(what: &str, found: &[f64], expected: &[f64]) -> Result<(), MotionFileError> {
    let off = found
        .iter()
        .zip(expected)
        .fold(0.0_f64, |most, (a, b)| most.max((a - b).abs()));
    if off > TOLERANCE {
        return Err(unfit(format!("{what} is off by {off:.3e}")));
    }
    Ok(())
}

fn require_limits(robot: &Robot, what: &str, coordinates: &[f64]) -> Result<(), MotionFileError> {
    match robot.violations(coordinates, TOLERANCE).first() {
        None => Ok(()),
        Some((constraint, violation)) => Err(unfit(format!(
            "{what} violates the {constraint} by {violation:.3e}"
        ))),
    }
}

impl StoredRobot {
    pub(crate) fn of(symmetric: &SymmetricRobot) -> Self {
        let (robot, start) = (symmetric.robot(), symmetric.start());
        Self {
            nodes: robot.graph().num_nodes(),
            edges: robot.graph().members().to_vec(),
            mass_fractions: robot.mass_fractions().to_vec(),
            limits: robot.limits().clone(),
            start: positions(&[start.coordinates]).concat(),
            support: start.support.nodes().to_vec(),
            side: symmetric.side(),
            roles: symmetric.relabelling().roles().to_vec(),
        }
    }

    pub(crate) fn read(self) -> Result<SymmetricRobot, MotionFileError> {
        // Before anything is made as large as the file says.
        if self.start.len() != self.nodes {
            let found = self.start.len();
            return Err(unfit(format!(
                "the start has {found} nodes, the robot {}",
                self.nodes
            )));
        }
        if self.edges.len() > MOST_MEMBERS {
            let found = self.edges.len();
            return Err(unfit(format!(
                "{found} members are too many: at most {MOST_MEMBERS}"
            )));
        }
        let graph = Graph::new(self.nodes, self.edges)?;
        let robot =
            Robot::new(graph, Dimension::Three, self.limits)?.with_masses(&self.mass_fractions)?;
        let start = self.start.concat();
        require_limits(&robot, "the start", &start)?;
        let support = Support::new(&robot, &self.support)?;
        if self.side >= support.num_sides() {
            return Err(unfit(format!("side {} does not exist", self.side)));
        }
        let relabelling = relabellings(&robot, &start, &support, self.side, TOLERANCE)?
            .into_iter()
            .find(|relabelling| relabelling.roles() == self.roles)
            .ok_or(MotionFileError::Roles { roles: self.roles })?;
        let symmetric = SymmetricRobot::new(robot, &start, support, self.side, relabelling)?;
        Ok(symmetric)
    }
}

/// A motion of `symmetric` along `stances` from what a file holds of it, judged; `name` says in
/// errors which one it is.
fn read_motion(
    name: &str,
    symmetric: &SymmetricRobot,
    stances: &[Stance],
    rolls: Vec<usize>,
    stored: &Positions,
) -> Result<SupportedMotion, MotionFileError> {
    let robot = symmetric.robot();
    let nodes = robot.graph().num_nodes();
    if rolls.len() + 1 != stances.len()
        || !rolls.is_sorted_by(|a, b| a < b)
        || rolls.last().is_some_and(|&roll| roll + 1 >= stored.len())
        || stored.is_empty()
    {
        return Err(unfit(format!(
            "{name} has {} configurations and {} supports with rolls {rolls:?}",
            stored.len(),
            stances.len()
        )));
    }
    let farthest = 2.0 * robot.limits().max_length;
    let mut configurations: Vec<Vec<f64>> = Vec::with_capacity(stored.len());
    for (index, points) in stored.iter().enumerate() {
        if points.len() != nodes {
            return Err(unfit(format!(
                "configuration {index} of {name} has {} nodes, the robot {nodes}",
                points.len()
            )));
        }
        let configuration = points.concat();
        require_limits(
            robot,
            &format!("configuration {index} of {name}"),
            &configuration,
        )?;
        // Certifying a step takes time in proportion to its length.
        let last = configurations.last().unwrap_or(&configuration);
        if configuration
            .iter()
            .zip(last)
            .any(|(a, b)| !((a - b).abs() <= farthest))
        {
            return Err(unfit(format!(
                "configuration {index} of {name} is far from the last"
            )));
        }
        configurations.push(configuration);
    }
    let motion = SupportedMotion {
        configurations,
        supports: stances
            .iter()
            .map(|stance| stance.support.clone())
            .collect(),
        rolls,
    };
    let context = WalkContext {
        name: "",
        robot,
        node_names: &[],
        waypoints: &[],
        visit: Visit::Support,
        obstacles: &[],
        obstacle_clearance: 0.0,
    };
    let walk = Walk::new(&context, &motion, WalkStatistics::default());
    let verdict = check_walk(&WalkFacts::of(&walk), &walk, &WalkCheckOptions::default());
    match verdict.faults.first() {
        Some(fault) => Err(unfit(format!("{name}: {fault}"))),
        None => Ok(motion),
    }
}

impl StoredPrimitive {
    pub(crate) fn of(primitive: &Primitive) -> Self {
        Self {
            turns: primitive.turns.clone(),
            rolls: primitive.motion.rolls.clone(),
            configurations: positions(&primitive.motion.configurations),
        }
    }

    /// The primitive; `name` says in errors which one it is.
    pub(crate) fn read(
        self,
        name: &str,
        symmetric: &SymmetricRobot,
    ) -> Result<Primitive, MotionFileError> {
        let (stances, _) = symmetric.sequence(&self.turns).ok_or_else(|| {
            unfit(format!(
                "the turns of {name} do not lead along symmetric stances"
            ))
        })?;
        let motion = read_motion(name, symmetric, &stances, self.rolls, &self.configurations)?;
        let end = stances[stances.len() - 1].clone();
        let (first, last) = ends(&motion);
        require_same(
            &format!("the start of {name}"),
            first,
            &stances[0].coordinates,
        )?;
        require_same(&format!("the end of {name}"), last, &end.coordinates)?;
        Ok(Primitive {
            symmetric: symmetric.clone(),
            turns: self.turns,
            motion,
            end,
        })
    }
}

/// First and last configuration of a motion, which has at least one.
fn ends(motion: &SupportedMotion) -> (&[f64], &[f64]) {
    let configurations = &motion.configurations;
    (
        &configurations[0],
        &configurations[configurations.len() - 1],
    )
}

impl StoredStripGait {
    pub(crate) fn of(gait: &Gait) -> Self {
        Self {
            period: positions(&gait.motion.configurations),
        }
    }

    pub(crate) fn read(self, symmetric: &SymmetricRobot) -> Result<Gait, MotionFileError> {
        let (stances, period) = strip_period(symmetric)
            .ok_or_else(|| unfit("its strip does not lead along symmetric stances"))?;
        let mut motion = read_motion(
            "the period",
            symmetric,
            &stances[..2],
            vec![0],
            &self.period,
        )?;
        let (tip, next) = ends(&motion);
        let image = period.image(symmetric.robot(), tip);
        require_same("the end of its period", next, &image)?;
        // Periods join exactly, however many are walked.
        if let Some(last) = motion.configurations.last_mut() {
            *last = image;
        }
        Ok(Gait {
            symmetric: symmetric.clone(),
            motion,
            period,
        })
    }
}

impl StoredGait {
    pub(crate) fn of(gait: &TurningGait) -> Self {
        let stored = |motion: &SupportedMotion| positions(&motion.configurations);
        Self {
            entry: stored(&gait.entry),
            turn: stored(&gait.turn),
            back: gait.back.as_ref().map(stored),
            exit: stored(&gait.exit),
        }
    }

    pub(crate) fn read(self, symmetric: &SymmetricRobot) -> Result<TurningGait, MotionFileError> {
        let (stances, _) = symmetric
            .sequence(&[])
            .ok_or_else(|| unfit("its roll does not lead to a symmetric stance"))?;
        let images = TipImages::new(symmetric)
            .ok_or_else(|| unfit("its turn does not lead to a symmetric stance"))?;
        let robot = symmetric.robot();
        let entry = read_motion(
            "the gait's entry",
            symmetric,
            &stances[..1],
            Vec::new(),
            &self.entry,
        )?;
        let over_roll = |name, stored| read_motion(name, symmetric, &stances, vec![0], stored);
        let turn = over_roll("the gait's turn", &self.turn)?;
        let exit = over_roll("the gait's exit", &self.exit)?;
        let back = self
            .back
            .as_ref()
            .map(|back| over_roll("the gait's way back", back))
            .transpose()?;

        let (start, entered) = ends(&entry);
        let (tip, turned) = ends(&turn);
        let (leaving, left) = ends(&exit);
        require_same("the start of its entry", start, &stances[0].coordinates)?;
        require_same("the end of its entry", entered, tip)?;
        require_same(
            "the mirror image of its tipping configuration",
            &images.mirror.image(robot, tip),
            tip,
        )?;
        require_same(
            "the end of its turn",
            turned,
            &images.left.image(robot, tip),
        )?;
        require_same("the start of its exit", leaving, tip)?;
        require_same("the end of its exit", left, &stances[1].coordinates)?;
        if let Some(back) = &back {
            let (first, last) = ends(back);
            let image = images
                .back
                .as_ref()
                .map(|period| period.image(robot, tip))
                .ok_or_else(|| unfit("its way back does not lead to a symmetric stance"))?;
            require_same("the start of its way back", first, tip)?;
            require_same("the end of its way back", last, &image)?;
        }
        Ok(TurningGait {
            symmetric: symmetric.clone(),
            entry,
            turn,
            back,
            exit,
        })
    }
}

fn to_json<M: Serialize>(format: &str, symmetric: &SymmetricRobot, motion: M) -> String {
    let file = MotionFile {
        format: format.to_owned(),
        version: VERSION,
        robot: StoredRobot::of(symmetric),
        motion,
    };
    // Numbers, strings and lists only: nothing in it can fail to be written.
    serde_json::to_string(&file).unwrap_or_default()
}

fn from_json<M: serde::de::DeserializeOwned>(
    format: &'static str,
    text: &str,
) -> Result<(SymmetricRobot, M), MotionFileError> {
    require_format(text, format)?;
    let file: MotionFile<M> = serde_json::from_str(text)?;
    Ok((file.robot.read()?, file.motion))
}

impl Primitive {
    /// The primitive as JSON text.
    #[must_use]
    pub fn to_json(&self) -> String {
        to_json(PRIMITIVE_FORMAT, &self.symmetric, StoredPrimitive::of(self))
    }

    /// Reads a primitive from JSON text.
    ///
    /// # Errors
    /// See [`MotionFileError`]: besides the form of the file, the symmetry of the start is
    /// checked, and the motion by [`check_walk`].
    pub fn from_json(text: &str) -> Result<Self, MotionFileError> {
        let (symmetric, stored): (_, StoredPrimitive) = from_json(PRIMITIVE_FORMAT, text)?;
        stored.read("the primitive", &symmetric)
    }
}

impl Gait {
    /// The gait as JSON text.
    #[must_use]
    pub fn to_json(&self) -> String {
        to_json(
            STRIP_GAIT_FORMAT,
            &self.symmetric,
            StoredStripGait::of(self),
        )
    }

    /// Reads a gait from JSON text.
    ///
    /// # Errors
    /// See [`MotionFileError`]: besides the form of the file, the symmetry of the start is
    /// checked, that the period ends in the image of the tipping configuration that it begins
    /// with, and the motion by [`check_walk`].
    pub fn from_json(text: &str) -> Result<Self, MotionFileError> {
        let (symmetric, stored): (_, StoredStripGait) = from_json(STRIP_GAIT_FORMAT, text)?;
        stored.read(&symmetric)
    }
}

impl TurningGait {
    /// The gait as JSON text.
    #[must_use]
    pub fn to_json(&self) -> String {
        to_json(GAIT_FORMAT, &self.symmetric, StoredGait::of(self))
    }

    /// Reads a gait from JSON text.
    ///
    /// # Errors
    /// See [`MotionFileError`]: besides the form of the file, the symmetry of the start and of
    /// the tipping configuration is checked, that the motions of the gait join, and each of them
    /// by [`check_walk`].
    pub fn from_json(text: &str) -> Result<Self, MotionFileError> {
        let (symmetric, stored): (_, StoredGait) = from_json(GAIT_FORMAT, text)?;
        stored.read(&symmetric)
    }
}
