//! Motion primitives in files.
//!
//! A file holds the robot, the symmetric start and the motion. Everything that can be checked is
//! checked again on reading, so that a primitive from a file is as good as one computed.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::symmetry::relabellings;
use super::{Primitive, SupportedMotion, SymmetricRobot, Turn};
use crate::{
    Dimension, Graph, GraphError, Limits, Robot, RobotError, Support, SupportError, SymmetryError,
};

const FORMAT: &str = "tensegra-primitive";
const VERSION: u32 = 1;
/// Constraints of a stored motion hold to this tolerance.
const TOLERANCE: f64 = 1e-6;

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct PrimitiveFile {
    format: String,
    version: u32,
    nodes: usize,
    edges: Vec<[usize; 2]>,
    mass_fractions: Vec<f64>,
    limits: Limits,
    support: Vec<usize>,
    side: usize,
    roles: Vec<usize>,
    turns: Vec<Turn>,
    rolls: Vec<usize>,
    configurations: Vec<Vec<[f64; 3]>>,
}

/// Why a file does not hold a motion primitive.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum PrimitiveFileError {
    /// Not JSON of the expected shape.
    #[error("not a motion primitive: {0}")]
    Json(#[from] serde_json::Error),
    /// Another format or version.
    #[error(
        "the file has format `{format}` version {version}; this reads `{FORMAT}` version {VERSION}"
    )]
    Format {
        /// Format found.
        format: String,
        /// Version found.
        version: u32,
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
}

impl Primitive {
    /// The primitive as JSON text.
    #[must_use]
    pub fn to_json(&self) -> String {
        let robot = self.symmetric.robot();
        let start = self.symmetric.start();
        let file = PrimitiveFile {
            format: FORMAT.to_owned(),
            version: VERSION,
            nodes: robot.graph().num_nodes(),
            edges: robot.graph().members().to_vec(),
            mass_fractions: robot.mass_fractions().to_vec(),
            limits: robot.limits().clone(),
            support: start.support.nodes().to_vec(),
            side: self.symmetric.side(),
            roles: self.symmetric.relabelling().roles().to_vec(),
            turns: self.turns.clone(),
            rolls: self.motion.rolls.clone(),
            configurations: self
                .motion
                .configurations
                .iter()
                .map(|x| x.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect())
                .collect(),
        };
        // Numbers, strings and lists only: nothing in it can fail to be written.
        serde_json::to_string(&file).unwrap_or_default()
    }

    /// Reads a primitive from JSON text.
    ///
    /// # Errors
    /// See [`PrimitiveFileError`]: besides the form of the file, the symmetry of the start and
    /// the limits at every configuration are checked.
    pub fn from_json(text: &str) -> Result<Self, PrimitiveFileError> {
        let file: PrimitiveFile = serde_json::from_str(text)?;
        if file.format != FORMAT || file.version != VERSION {
            let PrimitiveFile {
                format, version, ..
            } = file;
            return Err(PrimitiveFileError::Format { format, version });
        }
        let unfit = |reason: String| PrimitiveFileError::Motion { reason };
        let graph = Graph::new(file.nodes, file.edges)?;
        let robot =
            Robot::new(graph, Dimension::Three, file.limits)?.with_masses(&file.mass_fractions)?;
        let configurations: Vec<Vec<f64>> = file
            .configurations
            .iter()
            .map(|points| points.concat())
            .collect();
        for (index, configuration) in configurations.iter().enumerate() {
            if configuration.len() != robot.num_coordinates() {
                return Err(unfit(format!(
                    "configuration {index} has {} nodes, the robot {}",
                    configuration.len() / 3,
                    file.nodes
                )));
            }
            let worst = robot
                .violations(configuration, TOLERANCE)
                .into_iter()
                .next();
            if let Some((constraint, violation)) = worst {
                return Err(unfit(format!(
                    "configuration {index} violates the {constraint} by {violation:.3e}"
                )));
            }
        }
        let (Some(start), Some(last)) = (configurations.first(), configurations.last()) else {
            return Err(unfit("it has no configurations".to_owned()));
        };
        let support = Support::new(&robot, &file.support)?;
        if file.side >= support.num_sides() {
            return Err(unfit(format!("side {} does not exist", file.side)));
        }
        let relabelling = relabellings(&robot, start, &support, file.side, TOLERANCE)?
            .into_iter()
            .find(|relabelling| relabelling.roles() == file.roles)
            .ok_or(PrimitiveFileError::Roles { roles: file.roles })?;
        let symmetric = SymmetricRobot::new(robot, start, support, file.side, relabelling)?;
        let (stances, _) = symmetric
            .sequence(&file.turns)
            .ok_or_else(|| unfit("its turns do not lead along symmetric stances".to_owned()))?;
        let end = stances[stances.len() - 1].clone();
        if file.rolls.len() + 1 != stances.len()
            || !file.rolls.is_sorted_by(|a, b| a < b)
            || file
                .rolls
                .last()
                .is_some_and(|&roll| roll + 1 >= configurations.len())
        {
            return Err(unfit(format!(
                "{} turns with rolls {:?}",
                file.turns.len(),
                file.rolls
            )));
        }
        let off = last
            .iter()
            .zip(&end.coordinates)
            .fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
        if off > TOLERANCE {
            return Err(unfit(format!(
                "it ends {off:.3e} away from the symmetric stance"
            )));
        }
        let supports = stances.into_iter().map(|stance| stance.support).collect();
        Ok(Self {
            symmetric,
            turns: file.turns,
            motion: SupportedMotion {
                configurations,
                supports,
                rolls: file.rolls,
            },
            end,
        })
    }
}
