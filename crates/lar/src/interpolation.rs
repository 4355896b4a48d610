//! What a walk means between its configurations: nodes move on straight lines, in a roll on
//! straight lines in a frame that turns with the robot about the side rolled over.

use nalgebra::{Rotation3, Unit, Vector3};

use crate::{Dimension, Walk};

impl Walk {
    /// Positions of the nodes a fraction (0 to 1) of the way from configuration `index` to the
    /// next, in space; a planar walk moves in the plane y = 0. None where there is no next
    /// configuration, or a roll does not exchange one node of the support.
    ///
    /// # Examples
    ///
    /// ```
    /// use tensegra_lar::{WalkProblem, plan_walk};
    ///
    /// let problem = WalkProblem::from_toml(
    ///     "planner = \"greedy\"\nwaypoints = [[0.5, 0.2]]\n[robot]\npreset = \"k5\"\n",
    /// )?;
    /// let walk = plan_walk(&problem)?.walk;
    /// let roll = walk.rolls[0];
    /// let half_way = walk.positions_between(roll, 0.5).unwrap();
    /// // The landing node is on its way down.
    /// let [before, after] = [&walk.configurations[roll], &walk.configurations[roll + 1]];
    /// let landed = *after.support.iter().find(|n| !before.support.contains(n)).unwrap();
    /// assert!(half_way[landed].z > 0.0 && half_way[landed].z < before.positions[landed][2]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn positions_between(&self, index: usize, fraction: f64) -> Option<Vec<Vector3<f64>>> {
        let here = self.positions(index)?;
        let next = self.positions(index + 1)?;
        if !self.rolls.contains(&index) {
            let pairs = here.iter().zip(&next);
            return Some(pairs.map(|(a, b)| a.lerp(b, fraction)).collect());
        }
        let turn = self.turn(index, &here)?;
        let pairs = here.iter().zip(&next);
        Some(
            pairs
                .map(|(a, b)| {
                    let shape = turn.by(-turn.angle, b);
                    turn.by(fraction * turn.angle, &a.lerp(&shape, fraction))
                })
                .collect(),
        )
    }

    /// Positions of the nodes of a configuration, in space.
    fn positions(&self, index: usize) -> Option<Vec<Vector3<f64>>> {
        let configuration = self.configurations.get(index)?;
        let positions = configuration.positions.iter();
        positions
            .map(|p| match (self.dimension, p.as_slice()) {
                (Dimension::Two, &[x, z]) => Some(Vector3::new(x, 0.0, z)),
                (Dimension::Three, &[x, y, z]) => Some(Vector3::new(x, y, z)),
                _ => None,
            })
            .collect()
    }

    /// The rigid turn of a roll that starts from the positions `here`.
    fn turn(&self, index: usize, here: &[Vector3<f64>]) -> Option<Turn> {
        let before = &self.configurations[index].support;
        let after = &self.configurations[index + 1].support;
        let at = |node: &usize| here.get(*node).copied();
        let mut pivots = before.iter().filter(|node| after.contains(node));
        let origin = at(pivots.next()?)?;
        let along = match self.dimension {
            Dimension::Two => Vector3::y(),
            Dimension::Three => {
                let along = at(pivots.next()?)? - origin;
                Vector3::new(along.x, along.y, 0.0)
            }
        };
        let landed = at(after.iter().find(|node| !before.contains(node))?)? - origin;
        let lifted = at(before.iter().find(|node| !after.contains(node))?)? - origin;
        let mut axis = Unit::try_new(along, 0.0)?;
        if lifted.dot(&axis.cross(&Vector3::z())) > 0.0 {
            axis = -axis;
        }
        let outward = axis.cross(&Vector3::z());
        Some(Turn {
            origin,
            axis,
            angle: landed.z.atan2(landed.dot(&outward)),
        })
    }
}

/// A turn about a line on the ground.
struct Turn {
    origin: Vector3<f64>,
    axis: Unit<Vector3<f64>>,
    /// The whole angle of the roll.
    angle: f64,
}

impl Turn {
    fn by(&self, angle: f64, point: &Vector3<f64>) -> Vector3<f64> {
        let rotation = Rotation3::from_axis_angle(&self.axis, angle);
        self.origin + rotation * (point - self.origin)
    }
}
