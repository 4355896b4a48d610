//! Motion primitives: optimised motions over one or more rolls between symmetric stances, and
//! periodic gaits. Source: Usevitch et al., section V.

mod between;
mod follow;
mod gait;
mod motion;
mod search;
mod sequence;
mod store;
mod symmetry;

use thiserror::Error;

use crate::Support;
use crate::limits::setters;

pub use gait::{Gait, GaitSearch, TurningGait, find_gait, find_turning_gait};
pub use search::{
    PrimitiveAttempt, PrimitiveSearch, extend_primitive, find_cheapest_primitive, find_primitive,
    solve_primitive,
};
pub use sequence::{SequenceRoll, Stance, SymmetricRobot, Turn, straight_strip};
pub use store::MotionFileError;
pub(crate) use store::{StoredGait, StoredPrimitive, StoredRobot, VERSION, require_format};
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
    /// Greatest fall of the centre of mass in a roll of the gait that turns, in sides of the
    /// support triangle, or none. Default 0.1: a robot that falls much farther does not come to
    /// rest on the support that it lands on, see [`find_turning_gait`].
    pub max_fall: Option<f64>,
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
            max_fall: Some(0.1),
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
        max_fall / with_max_fall: Option<f64>;
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
        if self.max_fall.is_some_and(|fall| !(fall > 0.0)) {
            return bad("max_fall", "be positive");
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
    pub(crate) motion: SupportedMotion,
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

impl SupportedMotion {
    /// Adds a motion that begins where this one ends.
    pub(crate) fn append(&mut self, next: Self) {
        let offset = self.configurations.len() - 1;
        let rolls = next.rolls.into_iter().map(|roll| roll + offset);
        self.rolls.extend(rolls);
        let configurations = next.configurations.into_iter().skip(1);
        self.configurations.extend(configurations);
        self.supports.extend(next.supports.into_iter().skip(1));
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
        self.motion.rolls.len()
    }

    /// Coordinates of each configuration, from the first stance to the last.
    #[must_use]
    pub fn configurations(&self) -> &[Vec<f64>] {
        &self.motion.configurations
    }

    /// Index of the last configuration before each roll.
    #[must_use]
    pub fn rolls(&self) -> &[usize] {
        &self.motion.rolls
    }

    /// The motion with its supports.
    #[must_use]
    pub fn motion(&self) -> &SupportedMotion {
        &self.motion
    }

    /// Sum of the squared length changes, the objective (30).
    #[must_use]
    pub fn cost(&self) -> f64 {
        actuation_cost(&self.symmetric, &self.motion.configurations)
    }

    /// Greatest length of any member at any time over the least.
    #[must_use]
    pub fn length_ratio(&self) -> f64 {
        length_ratio(&self.symmetric, &self.motion.configurations)
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
        let placed = self.symmetric.place(&self.motion, stance, side, mirrored)?;
        let end = Stance {
            coordinates: placed.configurations.last()?.clone(),
            support: placed.supports.last()?.clone(),
        };
        Some((placed, end))
    }
}

pub(crate) fn actuation_cost(symmetric: &SymmetricRobot, configurations: &[Vec<f64>]) -> f64 {
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
