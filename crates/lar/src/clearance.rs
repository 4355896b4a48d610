//! Certified clearance of a motion between two configurations.
//!
//! Nodes move on straight lines (in a frame that turns with the robot during a roll), so the
//! distance f(t) between two members is Lipschitz with the largest relative displacement v of
//! their end points, and f ≥ (f(a) + f(b) − v (b − a))/2 on every interval [a, b]. Intervals are
//! halved until this bound is within a tolerance of the smallest value seen. Source: Usevitch et
//! al., section III.E (the Lipschitz argument of equation (20), applied from both ends). Cost:
//! O(pairs), plus O(v/tolerance) evaluations for pairs that come close.

use nalgebra::Vector3;

use crate::segment::closest_points;
use crate::{Robot, Support};

/// A bound is refined until it is this close to a value that occurs, or to this part of the way of
/// the members, whichever is more, so that no way takes long.
const SHARPNESS: f64 = 1e-3;
const PART_OF_WAY: f64 = 1.0 / 4096.0;

/// Largest distance such that members that share no node stay at least that far apart during a
/// straight motion of all nodes from `start` to `end`; infinite for a graph without such a pair,
/// zero where a coordinate is not a number.
///
/// The bound is within 1e-3 of the least distance that occurs, for motions of a few units.
///
/// # Examples
///
/// ```
/// use tensegra_lar::{Dimension, Graph, Limits, Robot, certified_clearance};
///
/// let robot = Robot::new(Graph::complete(4)?, Dimension::Three, Limits::default())?;
/// let start = [0., 0., 0., 1., 0., 0., 0., 1., 0., 0.2, 0.2, 0.8];
/// let end = [0., 0., 0., 1., 0., 0., 0., 1., 0., 0.2, 0.2, 0.7];
/// let clearance = certified_clearance(&robot, &start, &end);
/// let least = robot.extremes(&end).closest.unwrap().0;
/// assert!(clearance <= least && clearance > least - 2e-3);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[must_use]
pub fn certified_clearance(robot: &Robot, start: &[f64], end: &[f64]) -> f64 {
    let mut certified = f64::INFINITY;
    for &pair in robot.graph().disjoint_pairs() {
        let path = PairPath::new(robot, pair, start, end);
        certified = path.certify(certified);
    }
    certified
}

/// The end points of two members on straight paths.
struct PairPath {
    start: [Vector3<f64>; 4],
    displacement: [Vector3<f64>; 4],
    speed: f64,
}

impl PairPath {
    fn new(robot: &Robot, pair: [usize; 2], start: &[f64], end: &[f64]) -> Self {
        let members = robot.graph().members();
        let ([a, b], [c, d]) = (members[pair[0]], members[pair[1]]);
        let at = |x: &[f64]| [a, b, c, d].map(|node| robot.dimension().node(x, node));
        let (start, end) = (at(start), at(end));
        let displacement: [Vector3<f64>; 4] = std::array::from_fn(|k| end[k] - start[k]);
        // The relative velocity of two points of the members is a convex combination of those of
        // their end points.
        let speed = [(0, 2), (0, 3), (1, 2), (1, 3)]
            .iter()
            .map(|&(i, j)| (displacement[i] - displacement[j]).norm())
            .fold(0.0, f64::max);
        Self {
            start,
            displacement,
            speed,
        }
    }

    fn distance(&self, time: f64) -> f64 {
        let p: [Vector3<f64>; 4] =
            std::array::from_fn(|k| self.start[k] + self.displacement[k] * time);
        closest_points(&p[0], &p[1], &p[2], &p[3]).distance()
    }

    /// The smaller of `floor` and a certified bound on the distance.
    fn certify(&self, floor: f64) -> f64 {
        let (first, last) = (self.distance(0.0), self.distance(1.0));
        self.certify_interval((0.0, first), (1.0, last), floor)
    }

    fn certify_interval(&self, from: (f64, f64), to: (f64, f64), floor: f64) -> f64 {
        let bound = 0.5 * (from.1 + to.1 - self.speed * (to.0 - from.0));
        if bound.is_nan() {
            return 0.0;
        }
        if bound >= floor {
            return floor;
        }
        if bound >= from.1.min(to.1) - SHARPNESS.max(PART_OF_WAY * self.speed) {
            return bound.max(0.0);
        }
        let time = 0.5 * (from.0 + to.0);
        let middle = (time, self.distance(time));
        let floor = self.certify_interval(from, middle, floor);
        self.certify_interval(middle, to, floor)
    }
}

/// The configuration after a roll as it would stand before the turn: `after` turned back about
/// the side between the nodes common to both supports, by the angle at which the landing node
/// stands in `before`. None when the supports do not share a side.
///
/// In this frame the shape changes little during a roll, and not at all in a rigid one.
#[must_use]
pub fn turned_back(
    robot: &Robot,
    before: (&[f64], &Support),
    after: (&[f64], &Support),
) -> Option<Vec<f64>> {
    let (support, next) = (before.1, after.1);
    let side = (0..support.num_sides()).find(|&side| !next.contains(support.nodes()[side]))?;
    let pivots = support.side_nodes(side);
    if !pivots.iter().all(|&node| next.contains(node)) {
        return None;
    }
    let landed = *next.nodes().iter().find(|node| !support.contains(**node))?;
    let line = support.side_line(robot.dimension(), before.0, side);
    let angle = crate::support::landing_angle(robot, before.0, &line, landed);
    let mut shape = after.0.to_vec();
    crate::support::turn(robot, &mut shape, &line, -angle, &pivots);
    Some(shape)
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    use super::*;
    use crate::{Dimension, Graph, Limits};

    #[test]
    fn the_bound_holds_and_is_sharp() {
        let robot = Robot::new(Graph::octahedron(), Dimension::Three, Limits::default()).unwrap();
        let mut rng = Pcg64::seed_from_u64(3);
        for _ in 0..50 {
            let start: Vec<f64> = (0..18).map(|_| rng.random_range(-1.0..1.0)).collect();
            let end: Vec<f64> = start
                .iter()
                .map(|x| x + rng.random_range(-0.1..0.1))
                .collect();
            let certified = certified_clearance(&robot, &start, &end);
            let mut least = f64::INFINITY;
            for step in 0..=500 {
                let time = f64::from(step) / 500.0;
                let x: Vec<f64> = start
                    .iter()
                    .zip(&end)
                    .map(|(a, b)| a + time * (b - a))
                    .collect();
                for &pair in robot.graph().disjoint_pairs() {
                    least = least.min(robot.pair_distance(&x, pair));
                }
            }
            assert!(certified <= least + 1e-12, "{certified} {least}");
            assert!(certified >= least - SHARPNESS - 1e-4, "{certified} {least}");
        }
        let nowhere = [f64::NAN; 18];
        assert_eq!(certified_clearance(&robot, &nowhere, &nowhere), 0.0);
        // A way without measure takes no time without measure.
        let far: Vec<f64> = (0..18).map(|k| 1e12 * f64::from(k * k % 7)).collect();
        assert!(certified_clearance(&robot, &[0.0; 18], &far) >= 0.0);
    }

    #[test]
    fn a_rigid_roll_turns_back_to_where_it_began() {
        let robot = Robot::new(
            Graph::complete(4).unwrap(),
            Dimension::Three,
            Limits::default(),
        )
        .unwrap();
        let before = vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.2, 0.3, 0.8];
        let support = Support::new(&robot, &[0, 1, 2]).unwrap();
        let mut after = before.clone();
        let roll = support.roll(&robot, &mut after, 0).unwrap();
        let shape = turned_back(&robot, (&before, &support), (&after, &roll.support)).unwrap();
        for (a, b) in before.iter().zip(&shape) {
            assert!((a - b).abs() < 1e-12);
        }
        assert!(turned_back(&robot, (&before, &support), (&before, &support)).is_none());
    }
}
