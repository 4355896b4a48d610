//! A route for the centre of mass around obstacles.
//!
//! A* over a square lattice, with the straight distance as heuristic, followed by the removal of
//! corners that a straight line can cut. Cost: O(cells log cells × obstacles).

use std::cmp::Ordering;
use std::collections::{BinaryHeap, HashMap};

use nalgebra::Point2;

use crate::Obstacle;

/// A cell waiting in the queue, cheapest first; ties are broken by the cell, for determinism.
#[derive(Debug, PartialEq)]
struct Waiting {
    estimate: f64,
    cell: [i64; 2],
}

impl Eq for Waiting {}

impl Ord for Waiting {
    fn cmp(&self, other: &Self) -> Ordering {
        other
            .estimate
            .total_cmp(&self.estimate)
            .then(other.cell.cmp(&self.cell))
    }
}

impl PartialOrd for Waiting {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// Points to walk to one after another, the last being `goal`, such that the straight lines
/// between them keep `clearance` from all obstacles. None when the lattice of the given `spacing`
/// holds no such route.
pub(crate) fn route_around(
    start: Point2<f64>,
    goal: Point2<f64>,
    obstacles: &[Obstacle],
    clearance: f64,
    spacing: f64,
) -> Option<Vec<Point2<f64>>> {
    let open = |a: Point2<f64>, b: Point2<f64>| {
        obstacles
            .iter()
            .all(|obstacle| obstacle.gap(&[a, b]).distance > clearance)
    };
    if open(start, goal) {
        return Some(vec![goal]);
    }
    let point =
        |[i, j]: [i64; 2]| start + nalgebra::Vector2::new(i as f64 * spacing, j as f64 * spacing);
    // The lattice reaches around everything by a margin.
    let corners = obstacles
        .iter()
        .flat_map(|obstacle| obstacle.corners().iter());
    let margin = clearance + 2.0 * spacing;
    let (mut low, mut high) = (start.inf(&goal), start.sup(&goal));
    for corner in corners {
        low = low.inf(corner);
        high = high.sup(corner);
    }
    let inside = |p: Point2<f64>| {
        p.x >= low.x - margin
            && p.y >= low.y - margin
            && p.x <= high.x + margin
            && p.y <= high.y + margin
    };

    let mut cost = HashMap::from([([0, 0], 0.0)]);
    let mut parents: HashMap<[i64; 2], [i64; 2]> = HashMap::new();
    let mut queue = BinaryHeap::from([Waiting {
        estimate: (goal - start).norm(),
        cell: [0, 0],
    }]);
    let mut arrived = None;
    while let Some(Waiting { estimate, cell }) = queue.pop() {
        let here = point(cell);
        let so_far = cost[&cell];
        if estimate > so_far + (goal - here).norm() + 1e-9 {
            continue;
        }
        if (goal - here).norm() <= 1.5 * spacing && open(here, goal) {
            arrived = Some(cell);
            break;
        }
        for (di, dj) in [
            (1, 0),
            (-1, 0),
            (0, 1),
            (0, -1),
            (1, 1),
            (1, -1),
            (-1, 1),
            (-1, -1),
        ] {
            let next = [cell[0] + di, cell[1] + dj];
            let there = point(next);
            // A start closer than the clearance may still walk away.
            let leaving = cell == [0, 0] && open(there, there);
            if !inside(there) || !(open(here, there) || leaving) {
                continue;
            }
            let total = so_far + (there - here).norm();
            if cost.get(&next).is_none_or(|&known| total < known - 1e-12) {
                cost.insert(next, total);
                parents.insert(next, cell);
                queue.push(Waiting {
                    estimate: total + (goal - there).norm(),
                    cell: next,
                });
            }
        }
    }
    let mut cell = arrived?;
    let mut points = vec![goal, point(cell)];
    while let Some(&parent) = parents.get(&cell) {
        cell = parent;
        points.push(point(cell));
    }
    points.reverse();
    // Cut corners: from each kept point straight to the farthest point in sight.
    let mut route = Vec::new();
    let mut from = 0;
    while from + 1 < points.len() {
        let farthest = (from + 1..points.len())
            .rev()
            .find(|&to| open(points[from], points[to]))
            .unwrap_or(from + 1);
        route.push(points[farthest]);
        from = farthest;
    }
    Some(route)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wall_is_walked_around_with_clearance() {
        let wall = [Obstacle::rectangle([1.0, -2.0], [1.2, 1.0]).unwrap()];
        let (start, goal) = (Point2::new(0.0, 0.0), Point2::new(2.0, 0.0));
        let route = route_around(start, goal, &wall, 0.3, 0.2).unwrap();
        assert_eq!(route.last(), Some(&goal));
        let mut from = start;
        for &to in &route {
            assert!(wall[0].gap(&[from, to]).distance > 0.3);
            from = to;
        }
        assert!(route.len() >= 2);
        assert_eq!(route_around(start, goal, &[], 0.3, 0.2), Some(vec![goal]));
    }

    #[test]
    fn a_closed_room_has_no_route() {
        let room = [
            Obstacle::rectangle([1.0, -1.0], [1.1, 1.0]).unwrap(),
            Obstacle::rectangle([3.0, -1.0], [3.1, 1.0]).unwrap(),
            Obstacle::rectangle([1.0, 0.9], [3.1, 1.0]).unwrap(),
            Obstacle::rectangle([1.0, -1.0], [3.1, -0.9]).unwrap(),
        ];
        let route = route_around(
            Point2::new(0.0, 0.0),
            Point2::new(2.0, 0.0),
            &room,
            0.1,
            0.1,
        );
        assert_eq!(route, None);
    }
}
