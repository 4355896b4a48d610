//! Robots of the literature in their symmetric starting configurations.
//!
//! Source: Usevitch et al., sections V and VI: the complete graph on five nodes and the octahedron,
//! standing on a unit triangle with their longest members of unit length. The support is nodes
//! 0, 1, 2, and side 0 of it, between nodes 1 and 2, lies on the y axis with the robot behind it.

use crate::{Dimension, Graph, GraphError, Limits, Robot, RobotError, Stance, Support};

/// A robot in the configuration that it starts from.
#[derive(Debug, Clone, PartialEq)]
pub struct RobotAtStart {
    /// The robot.
    pub robot: Robot,
    /// Its coordinates and support.
    pub stance: Stance,
}

impl RobotAtStart {
    /// The same start, shifted so that the centre of mass is above the given point.
    #[must_use]
    pub fn moved_to(mut self, [x, y]: [f64; 2]) -> Self {
        let centre = self.robot.centre_of_mass(&self.stance.coordinates);
        let axes = self.robot.dimension().axes();
        for position in self.stance.coordinates.chunks_exact_mut(axes) {
            position[0] += x - centre.x;
            if axes == 3 {
                position[1] += y - centre.y;
            }
        }
        self
    }
}

/// Distance from the middle of a unit triangle to its sides.
const INRADIUS: f64 = 0.288_675_134_594_812_9;
/// Height of the regular unit tetrahedron, √(2/3).
const TETRAHEDRON_HEIGHT: f64 = 0.816_496_580_927_726;

fn at_start(
    graph: Result<Graph, GraphError>,
    limits: Limits,
    points: &[[f64; 3]],
) -> Result<RobotAtStart, RobotError> {
    let graph = graph.expect("the graphs of this file have no loops, double members or free nodes");
    let robot = Robot::new(graph, Dimension::Three, limits)?;
    let support = Support::new(&robot, &[0, 1, 2]).expect("three different nodes");
    Ok(RobotAtStart {
        robot,
        stance: Stance {
            coordinates: points.concat(),
            support,
        },
    })
}

/// The complete graph K5: a regular unit tetrahedron (nodes 0, 1, 2 and 4) with node 3 at its
/// centroid.
///
/// # Errors
/// A limit outside its range.
///
/// # Examples
///
/// ```
/// use tensegra_lar::{Limits, unit_k5};
///
/// let k5 = unit_k5(Limits::default())?;
/// assert!(k5.robot.violations(&k5.stance.coordinates, 1e-9).is_empty());
/// # Ok::<(), tensegra_lar::RobotError>(())
/// ```
pub fn unit_k5(limits: Limits) -> Result<RobotAtStart, RobotError> {
    at_start(
        Graph::complete(5),
        limits,
        &[
            [-3.0 * INRADIUS, 0.0, 0.0],
            [0.0, -0.5, 0.0],
            [0.0, 0.5, 0.0],
            [-INRADIUS, 0.0, 0.25 * TETRAHEDRON_HEIGHT],
            [-INRADIUS, 0.0, TETRAHEDRON_HEIGHT],
        ],
    )
}

/// The regular octahedron with unit members, standing on a face; antipodes are (0, 3), (1, 4)
/// and (2, 5).
///
/// # Errors
/// A limit outside its range.
pub fn unit_octahedron(limits: Limits) -> Result<RobotAtStart, RobotError> {
    at_start(
        Ok(Graph::octahedron()),
        limits,
        &[
            [-3.0 * INRADIUS, 0.0, 0.0],
            [0.0, -0.5, 0.0],
            [0.0, 0.5, 0.0],
            [INRADIUS, 0.0, TETRAHEDRON_HEIGHT],
            [-2.0 * INRADIUS, 0.5, TETRAHEDRON_HEIGHT],
            [-2.0 * INRADIUS, -0.5, TETRAHEDRON_HEIGHT],
        ],
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{RigiditySpectrum, check_symmetry, relabellings};

    #[test]
    fn starts_are_symmetric_and_within_limits() {
        let limits = Limits::default().with_min_rigidity(Some(0.0025));
        for (start, renamings) in [
            (unit_k5(limits.clone()), 4),
            (unit_octahedron(limits.clone()), 1),
        ] {
            let RobotAtStart { robot, stance } = start.unwrap();
            assert!(robot.violations(&stance.coordinates, 1e-12).is_empty());
            check_symmetry(&robot, &stance.coordinates, &stance.support, 1e-9).unwrap();
            let found =
                relabellings(&robot, &stance.coordinates, &stance.support, 0, 1e-9).unwrap();
            assert_eq!(found.len(), renamings);
            for relabelling in &found {
                let end = relabelling.end(&robot, &stance.coordinates, &stance.support, 0);
                let landed = robot.dimension().node(&end, relabelling.landing());
                assert!((landed.x - 3.0 * INRADIUS).abs() < 1e-12 && landed.z.abs() < 1e-12);
                assert!(robot.violations(&end, 1e-12).is_empty());
            }
        }
    }

    #[test]
    fn indices_of_the_starts() {
        let k5 = unit_k5(Limits::default()).unwrap();
        let octahedron = unit_octahedron(Limits::default()).unwrap();
        for (start, index) in [(k5, 0.0356), (octahedron, 1.0 / 24.0)] {
            let framework = start.robot.framework(&start.stance.coordinates).unwrap();
            assert!((RigiditySpectrum::of(&framework).index() - index).abs() < 5e-5);
        }
    }
}
