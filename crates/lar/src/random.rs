//! Random minimally rigid robots of any size.
//!
//! Source: Usevitch et al., section IV.D: start with a triangular base (in the plane, one member)
//! on the ground, add nodes one at a time and join each to d of the existing nodes, chosen at
//! random (a Henneberg construction, which keeps minimal rigidity); draw the position of each
//! node again until all constraints hold. A node that finds no place after many draws starts the
//! construction over, and so does a robot whose centre of mass is not above its base.

use rand::seq::SliceRandom;
use rand::{Rng, RngExt};
use thiserror::Error;

use crate::known::RobotAtStart;
use crate::{Dimension, Graph, Limits, LimitsError, Robot, RobotError, Stance, Support};

/// Draws of one node before the construction starts over.
const DRAWS: usize = 400;
/// Draws with the same neighbours.
const DRAWS_PER_NEIGHBOURHOOD: usize = 20;
/// Constructions before giving up.
const CONSTRUCTIONS: usize = 2000;

/// Why no random robot could be made.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum RandomRobotError {
    /// A limit outside its range.
    #[error(transparent)]
    Limits(#[from] LimitsError),
    /// Too few nodes.
    #[error(
        "a random robot in dimension {axes} needs more than {axes} nodes, {nodes} were asked for"
    )]
    TooFewNodes {
        /// The dimension.
        axes: usize,
        /// Number of nodes asked for.
        nodes: usize,
    },
    /// A rigidity index that no robot of this size has.
    #[error("min_rigidity is {least}, but the index of a robot of {nodes} nodes is at most {most}")]
    Rigidity {
        /// Number of nodes.
        nodes: usize,
        /// The index asked for.
        least: f64,
        /// The greatest possible: one over the rank of the rigidity matrix.
        most: f64,
    },
    /// The constraints were never met.
    #[error(
        "no robot of {nodes} nodes met the limits in {CONSTRUCTIONS} constructions: loosen the limits"
    )]
    NotFound {
        /// Number of nodes.
        nodes: usize,
    },
}

/// A random minimally rigid robot of `nodes` nodes standing on its base within `limits`; lengths
/// are of the order of twice the least length.
///
/// # Errors
/// Limits outside their range, too few nodes, or limits too tight to be met.
///
/// # Examples
///
/// ```
/// use rand::SeedableRng;
/// use tensegra_lar::{Dimension, Limits, Rigidity, random_robot};
///
/// let mut rng = rand_pcg::Pcg64::seed_from_u64(1);
/// let start = random_robot(7, Dimension::Three, Limits::default(), &mut rng)?;
/// assert_eq!(start.robot.graph().num_members(), 15);
/// let framework = start.robot.framework(&start.stance.coordinates).unwrap();
/// assert!(Rigidity::of(&framework).is_minimally_rigid());
/// # Ok::<(), tensegra_lar::RandomRobotError>(())
/// ```
pub fn random_robot(
    nodes: usize,
    dimension: Dimension,
    limits: Limits,
    rng: &mut impl Rng,
) -> Result<RobotAtStart, RandomRobotError> {
    limits.validate()?;
    let axes = dimension.axes();
    if nodes <= axes {
        return Err(RandomRobotError::TooFewNodes { axes, nodes });
    }
    let most = 1.0 / (nodes * axes - axes * (axes + 1) / 2) as f64;
    if let Some(least) = limits.min_rigidity.filter(|&least| least > most) {
        return Err(RandomRobotError::Rigidity { nodes, least, most });
    }
    for _ in 0..CONSTRUCTIONS {
        if let Some(found) = construct(nodes, dimension, &limits, rng) {
            return Ok(found);
        }
    }
    Err(RandomRobotError::NotFound { nodes })
}

fn construct(
    nodes: usize,
    dimension: Dimension,
    limits: &Limits,
    rng: &mut impl Rng,
) -> Option<RobotAtStart> {
    let axes = dimension.axes();
    // Twice the least length, within the limits.
    let unit = (2.0 * limits.min_length).min(limits.max_length);
    // Room for all nodes at a density that does not depend on their number.
    let spread = unit * (nodes as f64 / (axes + 2) as f64).powf(1.0 / axes as f64);
    let mut members: Vec<[usize; 2]> = Vec::new();
    let mut coordinates: Vec<f64> = match dimension {
        Dimension::Two => {
            members.push([0, 1]);
            vec![-0.5 * unit, 0.0, 0.5 * unit, 0.0]
        }
        Dimension::Three => {
            members.extend([[0, 1], [0, 2], [1, 2]]);
            let radius = unit / 3.0_f64.sqrt();
            (0..3)
                .flat_map(|k| {
                    let angle = f64::from(k) * std::f64::consts::TAU / 3.0;
                    [radius * angle.cos(), radius * angle.sin(), 0.0]
                })
                .collect()
        }
    };
    for node in axes..nodes {
        let before = members.len();
        let mut placed = false;
        for draw in 0..DRAWS {
            if draw % DRAWS_PER_NEIGHBOURHOOD == 0 {
                let mut neighbours: Vec<usize> = (0..node).collect();
                neighbours.shuffle(rng);
                members.truncate(before);
                members.extend(
                    neighbours[..axes]
                        .iter()
                        .map(|&neighbour| [neighbour, node]),
                );
            }
            coordinates.truncate(node * axes);
            for axis in 0..axes {
                coordinates.push(if axis + 1 == axes {
                    rng.random_range(0.0..spread)
                } else {
                    rng.random_range(-spread..spread)
                });
            }
            // The lengths of the new members are cheap to test and exclude most places.
            let fits = members[before..].iter().all(|&[a, b]| {
                let edge = dimension.node(&coordinates, a) - dimension.node(&coordinates, b);
                (limits.min_length..=limits.max_length).contains(&edge.norm())
            });
            if !fits {
                continue;
            }
            let graph = Graph::new(node + 1, members.iter().copied()).ok()?;
            let robot = Robot::new(graph, dimension, limits.clone()).ok()?;
            if clear_of_others(&robot, &coordinates, node)
                && robot.violations(&coordinates, 0.0).is_empty()
            {
                placed = true;
                break;
            }
        }
        if !placed {
            return None;
        }
    }
    let robot = Robot::new(Graph::new(nodes, members).ok()?, dimension, limits.clone());
    let robot = robot.map_err(|_: RobotError| ()).ok()?;
    let base: Vec<usize> = (0..axes).collect();
    let support = Support::new(&robot, &base).ok()?;
    support.validate(&robot, &coordinates, 0.0).ok()?;
    Some(RobotAtStart {
        robot,
        stance: Stance {
            coordinates,
            support,
        },
    })
}

/// Whether the members of a node keep their distance from all others.
fn clear_of_others(robot: &Robot, coordinates: &[f64], node: usize) -> bool {
    let members = robot.graph().members();
    robot
        .graph()
        .disjoint_pairs()
        .iter()
        .filter(|pair| pair.iter().any(|&member| members[member].contains(&node)))
        .all(|&pair| robot.pair_distance(coordinates, pair) >= robot.limits().min_distance)
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_pcg::Pcg64;

    use super::*;
    use crate::Rigidity;

    #[test]
    fn robots_are_minimally_rigid_and_within_limits() {
        let mut rng = Pcg64::seed_from_u64(4);
        for (dimension, nodes) in [
            (Dimension::Two, 6),
            (Dimension::Three, 7),
            (Dimension::Three, 10),
        ] {
            let limits = Limits::default().with_min_rigidity(Some(1e-4));
            let RobotAtStart { robot, stance } =
                random_robot(nodes, dimension, limits, &mut rng).unwrap();
            let framework = robot.framework(&stance.coordinates).unwrap();
            assert!(Rigidity::of(&framework).is_minimally_rigid());
            assert!(robot.violations(&stance.coordinates, 1e-12).is_empty());
            stance
                .support
                .validate(&robot, &stance.coordinates, 1e-12)
                .unwrap();
        }
    }

    #[test]
    fn impossible_requests_are_refused() {
        let mut rng = Pcg64::seed_from_u64(4);
        let few = random_robot(3, Dimension::Three, Limits::default(), &mut rng);
        assert!(matches!(
            few,
            Err(RandomRobotError::TooFewNodes { nodes: 3, .. })
        ));
        let tight = Limits::default().with_min_rigidity(Some(0.5));
        let tight = random_robot(4, Dimension::Three, tight, &mut rng).unwrap_err();
        assert!(
            tight.to_string().contains("at most 0.1666"),
            "no eigenvalue exceeds the mean of all: {tight}"
        );
        // In the plane three nodes find no place at all.
        let blunt = Limits::default().with_min_angle(1.2);
        let blunt = random_robot(3, Dimension::Two, blunt, &mut rng);
        assert_eq!(blunt, Err(RandomRobotError::NotFound { nodes: 3 }));
    }
}
