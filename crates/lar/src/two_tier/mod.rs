//! Two-tier planning: a path of support polygons over the triangular grid, walked by motion
//! primitives.
//!
//! Source: Usevitch et al., sections V.C and V.D. A* chooses the support polygons; a roll is
//! allowed where the ground that the one-roll primitive sweeps is free. The path is then cut into
//! pieces, each walked by the primitive for its sequence of turns or by a periodic gait that can
//! turn, so that the sum of the costs is least. The result is feasible by construction.

mod grid;
mod library;
mod pieces;
mod store;

use nalgebra::{Point2, Vector3};
use thiserror::Error;

pub use grid::{Cell, GridGoal, GridSearch, TriangularGrid, search_grid};
pub use library::{LibraryAttempts, PrimitiveLibrary};
pub use pieces::Piece;

use pieces::RollPath;

use crate::obstacle::{convex_hull, plan_view};
use crate::place::KeptClear;
use crate::{Obstacle, PlaceError, Robot, SequenceRoll, Stance, SupportedMotion};

/// Why two-tier planning found no walk.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum TwoTierError {
    /// The start is not a symmetric stance of the library's robot.
    #[error(
        "the robot does not start in the symmetric stance that its primitives begin with: start there, or walk there first"
    )]
    StartStance,
    /// A start or a waypoint that cannot be.
    #[error(transparent)]
    Place(#[from] PlaceError),
    /// A waypoint that only a walk of excessive length would reach.
    #[error(
        "waypoint {index} is {distance:.3e} away from the one before it, or the start: at most {limit} sides of the support triangle, {most:.3e}, are walked at once"
    )]
    TooFar {
        /// Index of the waypoint.
        index: usize,
        /// Its distance from the place before it.
        distance: f64,
        /// Greatest distance in sides.
        limit: f64,
        /// Greatest distance.
        most: f64,
    },
    /// No sequence of rolls leads to a waypoint.
    #[error(
        "no sequence of rolls leads to waypoint {index}: {explored} support polygons can be reached, none of them there"
    )]
    Unreachable {
        /// Index of the waypoint.
        index: usize,
        /// Support polygons explored.
        explored: usize,
    },
}

/// Greatest distance of waypoints, in sides of the support triangle.
const FARTHEST: f64 = 1000.0;

/// A walk over the triangular grid.
#[derive(Debug, Clone, PartialEq)]
pub struct TwoTierWalk {
    /// The motion.
    pub motion: SupportedMotion,
    /// The grid.
    pub grid: TriangularGrid,
    /// The cells walked over, one for each support.
    pub cells: Vec<Cell>,
    /// What the walk is made of, in order.
    pub pieces: Vec<Piece>,
    /// The search for each waypoint.
    pub searches: Vec<GridSearch>,
}

/// Plans two-tier walks.
#[derive(Debug, Clone)]
pub struct TwoTierPlanner<'a> {
    library: &'a PrimitiveLibrary,
    clear: KeptClear<'a>,
}

impl<'a> TwoTierPlanner<'a> {
    /// A planner that walks by the primitives of `library`.
    #[must_use]
    pub fn new(library: &'a PrimitiveLibrary) -> Self {
        let limits = library.one_roll().symmetric_robot().robot().limits();
        Self {
            library,
            clear: KeptClear {
                obstacles: &[],
                clearance: 0.5 * limits.min_distance,
            },
        }
    }

    /// Sets the obstacles, and the distance to keep from them seen from above.
    #[must_use]
    pub fn with_obstacles(mut self, obstacles: &'a [Obstacle], clearance: f64) -> Self {
        self.clear = KeptClear {
            obstacles,
            clearance,
        };
        self
    }

    fn robot(&self) -> &'a Robot {
        self.library.one_roll().symmetric_robot().robot()
    }

    /// The ground that a motion sweeps: the hull of all nodes at all configurations. During a
    /// roll every node stays between its places before and after, seen from above.
    fn swept(&self, motion: &SupportedMotion) -> Vec<Point2<f64>> {
        let points: Vec<Point2<f64>> = motion
            .configurations
            .iter()
            .flat_map(|x| plan_view(self.robot(), x))
            .collect();
        convex_hull(&points)
    }

    /// Walks from `start` to the goals one after another: a point counts as visited when the
    /// robot stands on the triangle that contains it.
    ///
    /// # Errors
    /// See [`TwoTierError`].
    pub fn walk(&self, start: &Stance, goals: &[GridGoal]) -> Result<TwoTierWalk, TwoTierError> {
        let robot = self.robot();
        let dimension = robot.dimension();
        if self.library.one_roll().place(start, 0, false).is_none() {
            return Err(TwoTierError::StartStance);
        }
        let points = goals.iter().map(|goal| goal.centre());
        self.clear.check(robot, start, points)?;
        let corners: [Point2<f64>; 3] = std::array::from_fn(|k| {
            dimension
                .node(&start.coordinates, start.support.nodes()[k])
                .xy()
                .into()
        });
        let grid = TriangularGrid::new(corners);

        let mut place = grid.centre(Cell::ORIGIN);
        let most = FARTHEST * (corners[1] - corners[0]).norm();
        for (index, goal) in goals.iter().enumerate() {
            let distance = (goal.centre() - place).norm();
            if !(distance <= most) {
                let limit = FARTHEST;
                return Err(TwoTierError::TooFar {
                    index,
                    distance,
                    limit,
                    most,
                });
            }
            place = goal.centre();
        }

        // The first tier: cells.
        let mut cells = vec![Cell::ORIGIN];
        let mut searches = Vec::with_capacity(goals.len());
        let inside = self.search_region(&grid, goals);
        let sweep = self.one_roll_sweep();
        for (index, &goal) in goals.iter().enumerate() {
            let allowed = |cell: Cell, side: usize| {
                self.clear.obstacles.is_empty()
                    || self
                        .clear
                        .touched(&placed_sweep(&grid, cell, side, &sweep))
                        .is_none()
            };
            let from = cells[cells.len() - 1];
            let search = search_grid(&grid, from, goal, allowed, &inside);
            let Some(path) = &search.path else {
                let explored = search.closed.len();
                return Err(TwoTierError::Unreachable { index, explored });
            };
            cells.extend_from_slice(&path[1..]);
            searches.push(search);
        }

        // The second tier: primitives and gaits.
        let (stances, rolls) = self
            .stances(start, &grid, &cells)
            .ok_or(TwoTierError::StartStance)?;
        let path = RollPath::new(self.library, stances, rolls);
        let is_free = |motion: &SupportedMotion| self.clear.touched(&self.swept(motion)).is_none();
        let is_free: Option<&dyn Fn(&SupportedMotion) -> bool> =
            (!self.clear.obstacles.is_empty()).then_some(&is_free);
        let (pieces, motion) = path.walk(is_free).ok_or(TwoTierError::StartStance)?;
        Ok(TwoTierWalk {
            motion,
            grid,
            cells,
            pieces,
            searches,
        })
    }

    /// A region that holds everything with room to walk around it.
    fn search_region(
        &self,
        grid: &TriangularGrid,
        goals: &[GridGoal],
    ) -> impl Fn(Point2<f64>) -> bool + use<> {
        let side = (grid.corners(Cell::ORIGIN)[1] - grid.corners(Cell::ORIGIN)[0]).norm();
        let start = grid.centre(Cell::ORIGIN);
        let (mut low, mut high) = (start, start);
        let goals = goals.iter().map(|goal| goal.centre());
        let corners = self
            .clear
            .obstacles
            .iter()
            .flat_map(|obstacle| obstacle.corners().iter().copied());
        for point in goals.chain(corners) {
            low = low.inf(&point);
            high = high.sup(&point);
        }
        let margin = 4.0 * side + 2.0 * self.clear.clearance;
        move |p: Point2<f64>| {
            p.x >= low.x - margin
                && p.y >= low.y - margin
                && p.x <= high.x + margin
                && p.y <= high.y + margin
        }
    }

    /// The ground swept by the one-roll primitive, relative to the side rolled over: along it
    /// from its middle, and outward.
    fn one_roll_sweep(&self) -> Vec<Point2<f64>> {
        let primitive = self.library.one_roll();
        let stance = primitive.symmetric_robot().start();
        let side = primitive.symmetric_robot().side();
        let dimension = self.robot().dimension();
        let line = stance
            .support
            .side_line(dimension, &stance.coordinates, side);
        let nodes = stance.support.side_nodes(side);
        let middle: Vector3<f64> = nodes
            .iter()
            .map(|&node| dimension.node(&stance.coordinates, node))
            .sum::<Vector3<f64>>()
            / 2.0;
        self.swept(primitive.motion())
            .iter()
            .map(|p| {
                let offset = Vector3::new(p.x, p.y, 0.0) - middle;
                Point2::new(offset.dot(&line.axis), offset.dot(&line.outward))
            })
            .collect()
    }

    /// The symmetric stances along a path of cells.
    fn stances(
        &self,
        start: &Stance,
        grid: &TriangularGrid,
        cells: &[Cell],
    ) -> Option<(Vec<Stance>, Vec<SequenceRoll>)> {
        let symmetric = self.library.one_roll().symmetric_robot();
        let dimension = self.robot().dimension();
        let mut stances = vec![start.clone()];
        let mut rolls = Vec::with_capacity(cells.len());
        for pair in cells.windows(2) {
            let stance = &stances[stances.len() - 1];
            // The side opposite the support node that is no corner of the next cell.
            let next = grid.corners(pair[1]).map(|p| Vector3::new(p.x, p.y, 0.0));
            let farthest = |node: &usize| {
                let position = dimension.node(&stance.coordinates, *node);
                next.iter()
                    .map(|p| (p - position).norm())
                    .fold(f64::INFINITY, f64::min)
            };
            let nodes = stance.support.nodes();
            let side = (0..nodes.len())
                .max_by(|&a, &b| farthest(&nodes[a]).total_cmp(&farthest(&nodes[b])))?;
            let (after, roll) = symmetric.roll(stance, side)?;
            stances.push(after);
            rolls.push(roll);
        }
        Some((stances, rolls))
    }
}

/// The swept ground of a roll from a cell over the side opposite one of its corners.
fn placed_sweep(
    grid: &TriangularGrid,
    cell: Cell,
    side: usize,
    sweep: &[Point2<f64>],
) -> Vec<Point2<f64>> {
    let corners = grid.corners(cell);
    let (a, b) = (corners[(side + 1) % 3], corners[(side + 2) % 3]);
    let middle = nalgebra::center(&a, &b);
    let outward = (middle - corners[side]).normalize();
    // The axis of a side is the outward direction turned left, see `SideLine`.
    let axis = nalgebra::Vector2::new(-outward.y, outward.x);
    sweep
        .iter()
        .map(|p| middle + axis * p.x + outward * p.y)
        .collect()
}
