//! A* over the triangular grid of support polygons.
//!
//! Source: Usevitch et al., section V.C and figure 10. A cell is a triangle of the grid that the
//! first support spans; a step is a roll over one of its sides. Every step costs one roll, and
//! the straight distance to the goal over the distance between neighbouring centres is the
//! heuristic. Cost: O(cells log cells) times the test of a step.

use std::cmp::Ordering;
use std::collections::{BTreeSet, BinaryHeap, HashMap};

use nalgebra::{Point2, Vector2};
use serde::Serialize;

/// A triangle of the grid. With the corners P(i, j) = p₀ + i (p₁ − p₀) + j (p₂ − p₀), the upward
/// cell (i, j) has the corners P(i, j), P(i+1, j), P(i, j+1), and the downward cell
/// P(i+1, j+1), P(i, j+1), P(i+1, j).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
pub struct Cell {
    /// First index.
    pub i: i64,
    /// Second index.
    pub j: i64,
    /// Whether the cell is upward.
    pub upward: bool,
}

impl Cell {
    /// The cell that the grid is laid out from.
    pub const ORIGIN: Self = Self {
        i: 0,
        j: 0,
        upward: true,
    };

    /// The neighbour across the side opposite corner `side`.
    #[must_use]
    pub fn neighbour(self, side: usize) -> Self {
        let Self { i, j, upward } = self;
        let step = if upward { -1 } else { 1 };
        let (di, dj) = [(0, 0), (step, 0), (0, step)][side % 3];
        Self {
            i: i + di,
            j: j + dj,
            upward: !upward,
        }
    }
}

/// The grid of triangles that a support triangle spans.
#[derive(Debug, Clone, PartialEq)]
pub struct TriangularGrid {
    origin: Point2<f64>,
    first: Vector2<f64>,
    second: Vector2<f64>,
}

impl TriangularGrid {
    /// The grid whose cell [`Cell::ORIGIN`] has the given corners.
    #[must_use]
    pub fn new(corners: [Point2<f64>; 3]) -> Self {
        Self {
            origin: corners[0],
            first: corners[1] - corners[0],
            second: corners[2] - corners[0],
        }
    }

    /// Corners of a cell.
    #[must_use]
    pub fn corners(&self, cell: Cell) -> [Point2<f64>; 3] {
        let at = |i: i64, j: i64| self.origin + self.first * i as f64 + self.second * j as f64;
        let Cell { i, j, upward } = cell;
        if upward {
            [at(i, j), at(i + 1, j), at(i, j + 1)]
        } else {
            [at(i + 1, j + 1), at(i, j + 1), at(i + 1, j)]
        }
    }

    /// Centre of a cell.
    #[must_use]
    pub fn centre(&self, cell: Cell) -> Point2<f64> {
        let [a, b, c] = self.corners(cell);
        Point2::from((a.coords + b.coords + c.coords) / 3.0)
    }

    /// The cell that contains a point.
    #[must_use]
    pub fn cell_at(&self, point: Point2<f64>) -> Cell {
        let offset = point - self.origin;
        let area = self.first.perp(&self.second);
        let (s, t) = (
            offset.perp(&self.second) / area,
            self.first.perp(&offset) / area,
        );
        let (i, j) = (s.floor(), t.floor());
        Cell {
            i: i as i64,
            j: j as i64,
            upward: (s - i) + (t - j) <= 1.0,
        }
    }

    /// Distance between the centres of neighbouring cells.
    fn step_length(&self) -> f64 {
        (self.centre(Cell::ORIGIN) - self.centre(Cell::ORIGIN.neighbour(0))).norm()
    }
}

/// Where a search over the grid is to end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum GridGoal {
    /// The cell that contains this point.
    Point(Point2<f64>),
    /// Any cell whose centre lies in this disc.
    Disc {
        /// Centre.
        centre: Point2<f64>,
        /// Radius.
        radius: f64,
    },
}

impl GridGoal {
    /// The point, or the centre of the disc.
    #[must_use]
    pub fn centre(&self) -> Point2<f64> {
        match *self {
            Self::Point(point) | Self::Disc { centre: point, .. } => point,
        }
    }
}

/// Outcome of a search over the grid.
#[derive(Debug, Clone, PartialEq)]
pub struct GridSearch {
    /// The cells from the start to the goal, both included; none when the goal cannot be reached.
    pub path: Option<Vec<Cell>>,
    /// Cells that were expanded.
    pub closed: Vec<Cell>,
    /// Cells that were seen but not expanded.
    pub open: Vec<Cell>,
}

/// A cell waiting in the queue.
#[derive(Debug, PartialEq)]
struct Waiting {
    estimate: f64,
    steps: usize,
    cell: Cell,
}

impl Eq for Waiting {}

impl Ord for Waiting {
    fn cmp(&self, other: &Self) -> Ordering {
        // Smallest estimate first, then the cell that has come farthest, then by index.
        other
            .estimate
            .total_cmp(&self.estimate)
            .then(self.steps.cmp(&other.steps))
            .then(other.cell.cmp(&self.cell))
    }
}

impl PartialOrd for Waiting {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// Fewest rolls from `start` to `goal`. `allowed` says whether the robot may roll from a cell over
/// the side opposite one of its corners; `inside` bounds the search.
#[must_use]
pub fn search_grid(
    grid: &TriangularGrid,
    start: Cell,
    goal: GridGoal,
    mut allowed: impl FnMut(Cell, usize) -> bool,
    inside: impl Fn(Point2<f64>) -> bool,
) -> GridSearch {
    let length = grid.step_length();
    let remaining = |cell: Cell| match goal {
        // The centre of the goal's cell is at most a step from the point.
        GridGoal::Point(point) => {
            ((grid.centre(grid.cell_at(point)) - grid.centre(cell)).norm() / length).max(0.0)
        }
        GridGoal::Disc { centre, radius } => {
            (((centre - grid.centre(cell)).norm() - radius) / length).max(0.0)
        }
    };
    let arrived = |cell: Cell| match goal {
        GridGoal::Point(point) => cell == grid.cell_at(point),
        GridGoal::Disc { centre, radius } => (centre - grid.centre(cell)).norm() <= radius,
    };
    let mut steps = HashMap::from([(start, 0)]);
    let mut parents: HashMap<Cell, Cell> = HashMap::new();
    let mut closed = Vec::new();
    let mut done = BTreeSet::new();
    let mut queue = BinaryHeap::from([Waiting {
        estimate: remaining(start),
        steps: 0,
        cell: start,
    }]);
    let mut path = None;
    while let Some(Waiting { cell, .. }) = queue.pop() {
        if !done.insert(cell) {
            continue;
        }
        closed.push(cell);
        if arrived(cell) {
            let mut cells = vec![cell];
            while let Some(&parent) = parents.get(&cells[cells.len() - 1]) {
                cells.push(parent);
            }
            cells.reverse();
            path = Some(cells);
            break;
        }
        let next_steps = steps[&cell] + 1;
        for side in 0..3 {
            let next = cell.neighbour(side);
            if done.contains(&next)
                || !inside(grid.centre(next))
                || steps.get(&next).is_some_and(|&known| known <= next_steps)
                || !allowed(cell, side)
            {
                continue;
            }
            steps.insert(next, next_steps);
            parents.insert(next, cell);
            let estimate = next_steps as f64 + remaining(next);
            queue.push(Waiting {
                estimate,
                steps: next_steps,
                cell: next,
            });
        }
    }
    let open: BTreeSet<Cell> = steps
        .keys()
        .copied()
        .filter(|cell| !done.contains(cell))
        .collect();
    GridSearch {
        path,
        closed,
        open: open.into_iter().collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit_grid() -> TriangularGrid {
        let height = 3.0_f64.sqrt() / 2.0;
        TriangularGrid::new([(0.0, 0.0), (1.0, 0.0), (0.5, height)].map(|(x, y)| Point2::new(x, y)))
    }

    #[test]
    fn neighbours_share_a_side_and_are_mutual() {
        let grid = unit_grid();
        for cell in [
            Cell::ORIGIN,
            Cell {
                i: 3,
                j: -2,
                upward: false,
            },
        ] {
            let corners = grid.corners(cell);
            assert_eq!(grid.cell_at(grid.centre(cell)), cell);
            for side in 0..3 {
                let next = cell.neighbour(side);
                assert_eq!(next.neighbour(side), cell);
                let others = grid.corners(next);
                for k in 0..3 {
                    let shared = others.iter().any(|p| (p - corners[k]).norm() < 1e-12);
                    assert_eq!(shared, k != side);
                }
            }
        }
    }

    #[test]
    fn a_free_grid_is_crossed_in_the_fewest_rolls() {
        let grid = unit_grid();
        let goal = GridGoal::Point(Point2::new(3.2, 0.1));
        let search = search_grid(&grid, Cell::ORIGIN, goal, |_, _| true, |_| true);
        let path = search.path.unwrap();
        assert_eq!(path.len(), 7, "two rolls a unit along a strip");
        assert_eq!(
            path[6],
            Cell {
                i: 3,
                j: 0,
                upward: true
            }
        );
        assert!(search.closed.len() >= 7 && !search.open.is_empty());
    }

    #[test]
    fn walls_are_walked_around_and_rooms_are_closed() {
        let grid = unit_grid();
        let goal = GridGoal::Disc {
            centre: Point2::new(4.0, 0.5),
            radius: 0.5,
        };
        let crosses = |cell: Cell, side: usize| {
            let (a, b) = (grid.centre(cell), grid.centre(cell.neighbour(side)));
            (a.x - 2.0) * (b.x - 2.0) <= 0.0 && a.y.min(b.y) < 2.0
        };
        let inside = |p: Point2<f64>| p.x.abs() < 6.0 && p.y.abs() < 6.0;
        let allowed = |cell, side| !crosses(cell, side);
        let path = search_grid(&grid, Cell::ORIGIN, goal, allowed, inside)
            .path
            .unwrap();
        assert!(path.iter().any(|&cell| grid.centre(cell).y > 2.0));
        let closed = search_grid(&grid, Cell::ORIGIN, goal, |_, _| false, inside);
        assert_eq!(closed.path, None);
        assert_eq!(closed.closed, [Cell::ORIGIN]);
    }
}
