//! Motion primitives: optimised motions over one or more rolls between symmetric stances, and
//! periodic gaits. Source: Usevitch et al., section V.

mod motion;
mod search;
mod sequence;
mod store;
mod symmetry;

use thiserror::Error;

use crate::Support;
use crate::limits::setters;

pub use search::{
    GaitSearch, PrimitiveAttempt, PrimitiveSearch, extend_primitive, find_gait, find_primitive,
    solve_primitive,
};
pub use sequence::{SequenceRoll, Stance, SymmetricRobot, Turn, straight_strip};
pub use store::PrimitiveFileError;
pub use symmetry::{Relabelling, SymmetryError, check_symmetry, relabellings};

/// How motion primitives are computed.
///
/// # Examples
///
/// ```
/// use tensegra_lar::PrimitiveOptions;
///
/// let options = PrimitiveOptions::default().with_steps(20).with_tip(10);
/// assert!(options.validate().is_ok());
/// assert!(options.with_tip(20).validate().is_err());
/// ```
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct PrimitiveOptions {
    /// Number of length changes for each roll, N_steps. Default 40.
    pub steps: usize,
    /// Index of the tipping configuration in each roll, j*. Default 20.
    pub tip: usize,
    /// Largest change of a member's length in the roll itself, c of equation (37), or none.
    /// Default 0.05: loose enough not to act on the known primitives.
    pub max_tip_change: Option<f64>,
    /// Random tip shapes that the search starts from. Default 32.
    pub starts: usize,
    /// Distinct coarse motions that the search carries on with. Default 3.
    pub kept: usize,
    /// Most iterations of one optimisation. Default 200.
    pub max_iterations: usize,
}

impl Default for PrimitiveOptions {
    fn default() -> Self {
        Self {
            steps: 40,
            tip: 20,
            max_tip_change: Some(0.05),
            starts: 32,
            kept: 3,
            max_iterations: 200,
        }
    }
}

impl PrimitiveOptions {
    setters! {
        steps / with_steps: usize;
        tip / with_tip: usize;
        max_tip_change / with_max_tip_change: Option<f64>;
        starts / with_starts: usize;
        kept / with_kept: usize;
        max_iterations / with_max_iterations: usize;
    }

    /// Checks every option against its range.
    ///
    /// # Errors
    /// The first option outside its range.
    pub fn validate(&self) -> Result<(), PrimitiveError> {
        let bad = |name, requirement| Err(PrimitiveError::Option { name, requirement });
        if self.steps < 3 {
            return bad("steps", "be at least 3");
        }
        if self.tip == 0 || self.tip + 1 >= self.steps {
            return bad(
                "tip",
                "lie strictly between the first and the last but one configuration",
            );
        }
        if self.max_tip_change.is_some_and(|c| !(c > 0.0)) {
            return bad("max_tip_change", "be positive");
        }
        if self.starts == 0 {
            return bad("starts", "be at least 1");
        }
        if self.kept == 0 {
            return bad("kept", "be at least 1");
        }
        if self.max_iterations == 0 {
            return bad("max_iterations", "be at least 1");
        }
        Ok(())
    }
}

/// Why there is no motion primitive.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum PrimitiveError {
    /// The start does not have the symmetry needed.
    #[error(transparent)]
    Symmetry(#[from] SymmetryError),
    /// An option outside its range.
    #[error("the option `{name}` must {requirement}")]
    Option {
        /// Name of the option.
        name: &'static str,
        /// What its value has to satisfy.
        requirement: &'static str,
    },
    /// The start violates a physical limit.
    #[error(
        "the starting configuration violates the {constraint} by {violation}: change the start or the limits"
    )]
    StartInfeasible {
        /// The limit that is violated most, with its members or nodes.
        constraint: String,
        /// By how much.
        violation: f64,
    },
    /// A roll of the sequence does not end in a symmetric stance.
    #[error("the sequence of turns does not lead from one symmetric stance to the next")]
    Sequence,
    /// A guess does not have the shape of the motion.
    #[error("the guess has {found} configurations, the motion {expected}")]
    GuessLength {
        /// Number of configurations of the motion.
        expected: usize,
        /// Number found.
        found: usize,
    },
    /// No motion was found from any start.
    #[error(
        "no feasible motion found: {reason}; try more starts, other limits or another renaming of nodes"
    )]
    NotFound {
        /// How the best attempt ended.
        reason: String,
    },
}

/// An optimised motion over one or more rolls, from one symmetric stance to another.
#[derive(Debug, Clone, PartialEq)]
pub struct Primitive {
    pub(crate) symmetric: SymmetricRobot,
    pub(crate) turns: Vec<Turn>,
    pub(crate) configurations: Vec<Vec<f64>>,
    pub(crate) supports: Vec<Support>,
    pub(crate) rolls: Vec<usize>,
    pub(crate) end: Stance,
}

/// A motion with the support of each configuration.
#[derive(Debug, Clone, PartialEq)]
pub struct SupportedMotion {
    /// Coordinates of each configuration.
    pub configurations: Vec<Vec<f64>>,
    /// The support during each roll-free part: one more than there are rolls.
    pub supports: Vec<Support>,
    /// Index of the last configuration before each roll.
    pub rolls: Vec<usize>,
}

impl SupportedMotion {
    /// The support of a configuration.
    #[must_use]
    pub fn support(&self, configuration: usize) -> &Support {
        &self.supports[self
            .rolls
            .iter()
            .filter(|&&roll| roll < configuration)
            .count()]
    }
}

impl Primitive {
    /// The robot with the stance and the renaming that the primitive belongs to.
    #[must_use]
    pub fn symmetric_robot(&self) -> &SymmetricRobot {
        &self.symmetric
    }

    /// The turns after the first roll.
    #[must_use]
    pub fn turns(&self) -> &[Turn] {
        &self.turns
    }

    /// Number of rolls.
    #[must_use]
    pub fn num_rolls(&self) -> usize {
        self.rolls.len()
    }

    /// Coordinates of each configuration, from the first stance to the last.
    #[must_use]
    pub fn configurations(&self) -> &[Vec<f64>] {
        &self.configurations
    }

    /// Index of the last configuration before each roll.
    #[must_use]
    pub fn rolls(&self) -> &[usize] {
        &self.rolls
    }

    /// The motion with its supports.
    #[must_use]
    pub fn motion(&self) -> SupportedMotion {
        SupportedMotion {
            configurations: self.configurations.clone(),
            supports: self.supports.clone(),
            rolls: self.rolls.clone(),
        }
    }

    /// Sum of the squared length changes, the objective (30).
    #[must_use]
    pub fn cost(&self) -> f64 {
        actuation_cost(&self.symmetric, &self.configurations)
    }

    /// Greatest length of any member at any time over the least.
    #[must_use]
    pub fn length_ratio(&self) -> f64 {
        length_ratio(&self.symmetric, &self.configurations)
    }

    /// The primitive carried to another stance of the same robot, its first roll over `side`;
    /// `mirrored` swaps left and right. Returns the motion and the stance that it ends in; none
    /// when `stance` is not a symmetric stance of this robot.
    #[must_use]
    pub fn place(
        &self,
        stance: &Stance,
        side: usize,
        mirrored: bool,
    ) -> Option<(SupportedMotion, Stance)> {
        let map = self.symmetric.placement(stance, side, mirrored)?;
        let roles = self.symmetric.roles_at(stance, &map)?;
        let robot = self.symmetric.robot();
        let dimension = robot.dimension();
        let place = |source: &[f64]| {
            let mut placed = source.to_vec();
            for (node, &role) in roles.iter().enumerate() {
                let image = map.apply(&dimension.node(source, role));
                dimension.set_node(&mut placed, node, &image);
            }
            placed
        };
        let node_of = |role: usize| roles.iter().position(|&r| r == role);
        let rename = |support: &Support| {
            let nodes: Option<Vec<usize>> =
                support.nodes().iter().map(|&role| node_of(role)).collect();
            Support::new(robot, &nodes?).ok()
        };
        let motion = SupportedMotion {
            configurations: self.configurations.iter().map(|c| place(c)).collect(),
            supports: self
                .supports
                .iter()
                .map(rename)
                .collect::<Option<Vec<_>>>()?,
            rolls: self.rolls.clone(),
        };
        let end = Stance {
            coordinates: place(&self.end.coordinates),
            support: rename(&self.end.support)?,
        };
        Some((motion, end))
    }
}

/// A periodic gait (equation (39)): from the tipping configuration of one roll to that of the
/// next, of the same shape.
#[derive(Debug, Clone, PartialEq)]
pub struct Gait {
    pub(crate) symmetric: SymmetricRobot,
    pub(crate) configurations: Vec<Vec<f64>>,
    pub(crate) supports: [Support; 2],
    pub(crate) map: crate::GroundIsometry,
    pub(crate) roles: Vec<usize>,
}

impl Gait {
    /// Coordinates of each configuration of one period. The first is the tipping configuration;
    /// the robot rolls between the first and the second.
    #[must_use]
    pub fn configurations(&self) -> &[Vec<f64>] {
        &self.configurations
    }

    /// Sum of the squared length changes of one period.
    #[must_use]
    pub fn cost(&self) -> f64 {
        actuation_cost(&self.symmetric, &self.configurations)
    }

    /// Greatest length of any member at any time over the least.
    #[must_use]
    pub fn length_ratio(&self) -> f64 {
        length_ratio(&self.symmetric, &self.configurations)
    }

    /// The gait repeated over `periods` rolls.
    #[must_use]
    pub fn repeat(&self, periods: usize) -> SupportedMotion {
        let robot = self.symmetric.robot();
        let dimension = robot.dimension();
        let nodes = robot.graph().num_nodes();
        let mut roles: Vec<usize> = (0..nodes).collect();
        let mut motion = SupportedMotion {
            configurations: vec![self.configurations[0].clone()],
            supports: vec![self.supports[0].clone()],
            rolls: Vec::new(),
        };
        for period in 0..periods {
            motion.rolls.push(motion.configurations.len() - 1);
            for source in &self.configurations[1..] {
                let mut placed = source.clone();
                for (node, &role) in roles.iter().enumerate() {
                    let mut point = dimension.node(source, role);
                    for _ in 0..period {
                        point = self.map.apply(&point);
                    }
                    dimension.set_node(&mut placed, node, &point);
                }
                motion.configurations.push(placed);
            }
            let mut support = self.supports[1].nodes().to_vec();
            for node in &mut support {
                // Every role is played by one node.
                *node = roles.iter().position(|role| role == node).unwrap_or(*node);
            }
            if let Ok(support) = Support::new(robot, &support) {
                motion.supports.push(support);
            }
            roles = roles.iter().map(|&role| self.roles[role]).collect();
        }
        motion
    }
}

fn actuation_cost(symmetric: &SymmetricRobot, configurations: &[Vec<f64>]) -> f64 {
    let lengths: Vec<Vec<f64>> = configurations
        .iter()
        .map(|x| symmetric.robot().lengths(x))
        .collect();
    lengths
        .windows(2)
        .flat_map(|pair| pair[0].iter().zip(&pair[1]).map(|(a, b)| (b - a) * (b - a)))
        .sum()
}

fn length_ratio(symmetric: &SymmetricRobot, configurations: &[Vec<f64>]) -> f64 {
    let (least, most) = configurations
        .iter()
        .flat_map(|x| symmetric.robot().lengths(x))
        .fold((f64::INFINITY, 0.0_f64), |(least, most), length| {
            (least.min(length), most.max(length))
        });
    most / least
}
