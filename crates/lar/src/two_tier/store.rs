//! A library of motions in a file, for use in other problems of the same robot.

use serde::{Deserialize, Serialize};

use super::PrimitiveLibrary;
use crate::primitive::{StoredGait, StoredPrimitive, StoredRobot, VERSION, require_format};
use crate::{MotionFileError, Robot, TwoTierOptions, WalkProblem};

const FORMAT: &str = "tensegra-motions";
/// Masses and limits that differ by no more, relative to their size, are the same.
const TOLERANCE: f64 = 1e-9;

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct LibraryFile {
    format: String,
    version: u32,
    options: StoredOptions,
    robot: StoredRobot,
    primitives: Vec<StoredPrimitive>,
    gait: Option<StoredGait>,
}

/// The keys of the table `two_tier` that the motions of a library depend on.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct StoredOptions {
    rolls: usize,
    gait: bool,
    steps: usize,
    starts: usize,
}

impl StoredOptions {
    fn of(options: &TwoTierOptions) -> Self {
        Self {
            rolls: options.rolls,
            gait: options.gait,
            steps: options.primitives.steps,
            starts: options.primitives.starts,
        }
    }

    fn require(&self, options: &TwoTierOptions) -> Result<(), MotionFileError> {
        let expected = Self::of(options);
        for (key, found, expected) in [
            ("rolls", self.rolls.to_string(), expected.rolls.to_string()),
            ("gait", self.gait.to_string(), expected.gait.to_string()),
            ("steps", self.steps.to_string(), expected.steps.to_string()),
            (
                "starts",
                self.starts.to_string(),
                expected.starts.to_string(),
            ),
        ] {
            if found != expected {
                return Err(MotionFileError::OtherOptions {
                    key,
                    found,
                    expected,
                });
            }
        }
        Ok(())
    }
}

fn same(a: f64, b: f64) -> bool {
    (a - b).abs() <= TOLERANCE * a.abs().max(b.abs())
}

/// What of two robots differs, if anything.
fn difference(robot: &Robot, expected: &Robot) -> Option<String> {
    let (graph, other) = (robot.graph(), expected.graph());
    if (graph.num_nodes(), graph.members()) != (other.num_nodes(), other.members()) {
        return Some(format!(
            "{} nodes and {} members, the problem has {} and {}, or joins others",
            graph.num_nodes(),
            graph.num_members(),
            other.num_nodes(),
            other.num_members()
        ));
    }
    let masses = robot.mass_fractions().iter().zip(expected.mass_fractions());
    if let Some(node) = masses.into_iter().position(|(a, b)| !same(*a, *b)) {
        return Some(format!("node {node} has another part of the mass"));
    }
    let (limits, other) = (robot.limits(), expected.limits());
    let rigidity = [limits, other].map(|limits| limits.min_rigidity.unwrap_or(0.0));
    [
        ("min_length", limits.min_length, other.min_length),
        ("max_length", limits.max_length, other.max_length),
        ("min_distance", limits.min_distance, other.min_distance),
        ("min_angle", limits.min_angle, other.min_angle),
        ("max_move", limits.max_move, other.max_move),
        ("min_rigidity", rigidity[0], rigidity[1]),
    ]
    .into_iter()
    .find(|(_, a, b)| !same(*a, *b))
    .map(|(name, a, b)| format!("its {name} is {a}, that of the problem {b}"))
}

impl PrimitiveLibrary {
    /// The library as JSON text; `options` are those that it was optimised with.
    #[must_use]
    pub fn to_json(&self, options: &TwoTierOptions) -> String {
        let file = LibraryFile {
            format: FORMAT.to_owned(),
            version: VERSION,
            options: StoredOptions::of(options),
            robot: StoredRobot::of(self.one_roll().symmetric_robot()),
            primitives: self.primitives().map(StoredPrimitive::of).collect(),
            gait: self.gait().map(StoredGait::of),
        };
        // Numbers, strings and lists only: nothing in it can fail to be written.
        serde_json::to_string(&file).unwrap_or_default()
    }

    /// Reads a library for a problem from JSON text. The problem may start elsewhere on the
    /// ground, and have other goals, obstacles and another seed.
    ///
    /// # Errors
    /// Motions of another robot, with other limits, or optimised with other options than the
    /// problem's; and as for [`Primitive::from_json`](crate::Primitive::from_json).
    pub fn from_json(text: &str, problem: &WalkProblem) -> Result<Self, MotionFileError> {
        require_format(text, FORMAT)?;
        let file: LibraryFile = serde_json::from_str(text)?;
        let symmetric = file.robot.read()?;
        let other = |what: String| MotionFileError::OtherRobot { what };
        if let Some(what) = difference(symmetric.robot(), &problem.robot) {
            return Err(other(what));
        }
        if symmetric.roll(&problem.start, 0).is_none() {
            return Err(other("it starts in another stance".to_owned()));
        }
        file.options.require(&problem.two_tier)?;
        let roles = symmetric.relabelling().roles();
        if let Some(expected) = problem.two_tier.roles.as_deref().filter(|&r| r != roles) {
            return Err(MotionFileError::OtherOptions {
                key: "roles",
                found: format!("{roles:?}"),
                expected: format!("{expected:?}"),
            });
        }
        let mut primitives = file
            .primitives
            .into_iter()
            .enumerate()
            .map(|(index, stored)| stored.read(&format!("primitive {index}"), &symmetric));
        let one_roll = primitives
            .next()
            .transpose()?
            .filter(|primitive| primitive.num_rolls() == 1)
            .ok_or_else(|| MotionFileError::Motion {
                reason: "the first primitive is not one of one roll".to_owned(),
            })?;
        let mut library = Self::new(one_roll);
        for primitive in primitives {
            library.insert(primitive?);
        }
        library.gait = file.gait.map(|gait| gait.read(&symmetric)).transpose()?;
        Ok(library)
    }
}
