//! Two-tier planning: a path of support polygons over the triangular grid, walked by motion
//! primitives.
//!
//! Source: Usevitch et al., sections V.C and V.D. A* chooses the support polygons; a roll is
//! allowed where the ground that the one-roll primitive sweeps is free. The path is then cut into
//! pieces of one or more rolls, each walked by the primitive for its sequence of turns, so that
//! the sum of the costs is least (dynamic programming); pieces whose primitive would touch an
//! obstacle are not used. The result is feasible by construction.

mod grid;

use std::collections::BTreeMap;

use nalgebra::{Point2, Vector3};
use thiserror::Error;

pub use grid::{Cell, GridGoal, GridSearch, TriangularGrid, search_grid};

use crate::obstacle::{convex_hull, plan_view};
use crate::{
    Obstacle, Primitive, PrimitiveAttempt, PrimitiveError, PrimitiveOptions, Robot, SequenceRoll,
    Stance, SupportedMotion, Turn, extend_primitive,
};

/// Primitives over one or more rolls, found by their turns.
///
/// A sequence whose first turn leads right is walked by the mirror image of the one that leads
/// left, so that 2^(p−2) primitives serve all sequences of p rolls.
#[derive(Debug, Clone, PartialEq)]
pub struct PrimitiveLibrary {
    primitives: BTreeMap<Vec<bool>, Primitive>,
}

/// For each sequence of turns of a library, how its optimisation went.
pub type LibraryAttempts = Vec<(Vec<Turn>, PrimitiveAttempt)>;

/// A sequence of turns as a key: whether each differs from the first.
fn key(turns: &[Turn]) -> Vec<bool> {
    turns.iter().map(|turn| *turn != turns[0]).collect()
}

impl PrimitiveLibrary {
    /// A library of the one-roll primitive alone.
    #[must_use]
    pub fn new(one_roll: Primitive) -> Self {
        Self {
            primitives: BTreeMap::from([(Vec::new(), one_roll)]),
        }
    }

    /// Adds optimised primitives for all sequences of up to `rolls` rolls. A sequence for which
    /// none is found is left out: it will be walked in shorter pieces.
    ///
    /// # Errors
    /// Options outside their range.
    pub fn extend(
        mut self,
        rolls: usize,
        options: &PrimitiveOptions,
    ) -> Result<(Self, LibraryAttempts), PrimitiveError> {
        let mut attempts = Vec::new();
        let one_roll = self.one_roll().clone();
        for count in 2..=rolls {
            // Turns after the first, as the bits of a number.
            for word in 0..1_usize << (count - 2) {
                let turns: Vec<Turn> = std::iter::once(Turn::Left)
                    .chain((0..count - 2).map(|bit| {
                        if word >> bit & 1 == 1 {
                            Turn::Right
                        } else {
                            Turn::Left
                        }
                    }))
                    .collect();
                match extend_primitive(&one_roll, &turns, options) {
                    Ok((primitive, attempt)) => {
                        self.primitives.insert(key(&turns), primitive);
                        attempts.push((turns, attempt));
                    }
                    Err(PrimitiveError::NotFound { .. }) => {}
                    Err(other) => return Err(other),
                }
            }
        }
        Ok((self, attempts))
    }

    /// Adds a primitive that was computed or read elsewhere. It must belong to the same robot and
    /// renaming as the others; returns false, and changes nothing, if not.
    pub fn insert(&mut self, primitive: Primitive) -> bool {
        let fits = primitive.symmetric_robot() == self.one_roll().symmetric_robot();
        if fits {
            self.primitives.insert(key(primitive.turns()), primitive);
        }
        fits
    }

    /// The one-roll primitive.
    #[must_use]
    pub fn one_roll(&self) -> &Primitive {
        // `new` puts it there, and nothing takes it out.
        &self.primitives[&Vec::new()]
    }

    /// The primitive for a sequence of turns after the first roll, and whether it has to be
    /// mirrored.
    #[must_use]
    pub fn get(&self, turns: &[Turn]) -> Option<(&Primitive, bool)> {
        let primitive = self.primitives.get(&key(turns))?;
        let mirrored = primitive.turns().first() != turns.first();
        Some((primitive, mirrored))
    }

    /// All primitives.
    pub fn primitives(&self) -> impl Iterator<Item = &Primitive> {
        self.primitives.values()
    }

    /// Most rolls of a primitive.
    #[must_use]
    pub fn max_rolls(&self) -> usize {
        self.primitives
            .values()
            .map(Primitive::num_rolls)
            .max()
            .unwrap_or(1)
    }
}

/// Why two-tier planning found no walk.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum TwoTierError {
    /// The start is not a symmetric stance of the library's robot.
    #[error(
        "the robot does not start in the symmetric stance that its primitives begin with: start there, or walk there first"
    )]
    StartStance,
    /// A waypoint is not finite.
    #[error("waypoint {index} is ({x}, {y}): give finite numbers")]
    Waypoint {
        /// Index of the waypoint.
        index: usize,
        /// First coordinate.
        x: f64,
        /// Second coordinate.
        y: f64,
    },
    /// A waypoint lies inside an obstacle, or too close to it.
    #[error(
        "waypoint {index} lies inside obstacle {obstacle} or within {clearance} of it: move one of them"
    )]
    WaypointInObstacle {
        /// Index of the waypoint.
        index: usize,
        /// Index of the obstacle.
        obstacle: usize,
        /// Distance that the robot keeps from obstacles.
        clearance: f64,
    },
    /// The robot starts inside an obstacle, or too close to it.
    #[error("the robot starts within {clearance} of obstacle {obstacle}: move one of them")]
    StartInObstacle {
        /// Index of the obstacle.
        obstacle: usize,
        /// Distance that the robot keeps from obstacles.
        clearance: f64,
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

/// A walk over the triangular grid.
#[derive(Debug, Clone, PartialEq)]
pub struct TwoTierWalk {
    /// The motion.
    pub motion: SupportedMotion,
    /// The grid.
    pub grid: TriangularGrid,
    /// The cells walked over, one for each support.
    pub cells: Vec<Cell>,
    /// Rolls of the primitives that the walk is made of, in order.
    pub pieces: Vec<usize>,
    /// The search for each waypoint.
    pub searches: Vec<GridSearch>,
}

/// Plans two-tier walks.
#[derive(Debug, Clone)]
pub struct TwoTierPlanner<'a> {
    library: &'a PrimitiveLibrary,
    obstacles: &'a [Obstacle],
    clearance: f64,
}

impl<'a> TwoTierPlanner<'a> {
    /// A planner that walks by the primitives of `library`.
    #[must_use]
    pub fn new(library: &'a PrimitiveLibrary) -> Self {
        let limits = library.one_roll().symmetric_robot().robot().limits();
        Self {
            library,
            obstacles: &[],
            clearance: 0.5 * limits.min_distance,
        }
    }

    /// Sets the obstacles, and the distance to keep from them seen from above.
    #[must_use]
    pub fn with_obstacles(mut self, obstacles: &'a [Obstacle], clearance: f64) -> Self {
        self.obstacles = obstacles;
        self.clearance = clearance;
        self
    }

    fn robot(&self) -> &'a Robot {
        self.library.one_roll().symmetric_robot().robot()
    }

    /// The first obstacle that points come too close to.
    fn touched(&self, points: &[Point2<f64>]) -> Option<usize> {
        self.obstacles
            .iter()
            .position(|o| !(o.gap(points).distance > self.clearance))
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
        let (clearance, dimension) = (self.clearance, robot.dimension());
        if self.library.one_roll().place(start, 0, false).is_none() {
            return Err(TwoTierError::StartStance);
        }
        if let Some(obstacle) = self.touched(&plan_view(robot, &start.coordinates)) {
            return Err(TwoTierError::StartInObstacle {
                obstacle,
                clearance,
            });
        }
        for (index, goal) in goals.iter().enumerate() {
            let (GridGoal::Point(p) | GridGoal::Disc { centre: p, .. }) = goal;
            if !p.x.is_finite() || !p.y.is_finite() {
                return Err(TwoTierError::Waypoint {
                    index,
                    x: p.x,
                    y: p.y,
                });
            }
            if let Some(obstacle) = self.touched(&[*p]) {
                return Err(TwoTierError::WaypointInObstacle {
                    index,
                    obstacle,
                    clearance,
                });
            }
        }
        let corners: [Point2<f64>; 3] = std::array::from_fn(|k| {
            dimension
                .node(&start.coordinates, start.support.nodes()[k])
                .xy()
                .into()
        });
        let grid = TriangularGrid::new(corners);

        // The first tier: cells.
        let mut cells = vec![Cell::ORIGIN];
        let mut searches = Vec::with_capacity(goals.len());
        let inside = self.search_region(&grid, goals);
        let sweep = self.one_roll_sweep();
        for (index, &goal) in goals.iter().enumerate() {
            let allowed = |cell: Cell, side: usize| {
                self.obstacles.is_empty()
                    || self
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

        // The second tier: primitives.
        let (stances, rolls) = self
            .stances(start, &grid, &cells)
            .ok_or(TwoTierError::StartStance)?;
        let pieces = self
            .cut(&stances, &rolls)
            .ok_or(TwoTierError::StartStance)?;
        let motion = self.stitch(start, &stances, &rolls, &pieces);
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
        let goals = goals.iter().map(|goal| match goal {
            GridGoal::Point(point) | GridGoal::Disc { centre: point, .. } => *point,
        });
        let corners = self
            .obstacles
            .iter()
            .flat_map(|obstacle| obstacle.corners().iter().copied());
        for point in goals.chain(corners) {
            low = low.inf(&point);
            high = high.sup(&point);
        }
        let margin = 4.0 * side + 2.0 * self.clearance;
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
        self.swept(&primitive.motion())
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

    /// Cuts the rolls into pieces that primitives walk, at the least sum of costs.
    fn cut(&self, stances: &[Stance], rolls: &[SequenceRoll]) -> Option<Vec<usize>> {
        let turns = self.turns(stances, rolls);
        // Least cost of the first k rolls, and the length of the last piece.
        let mut best: Vec<(f64, usize)> = vec![(0.0, 0)];
        for end in 1..=rolls.len() {
            let mut choice = (f64::INFINITY, 0);
            for length in 1..=self.library.max_rolls().min(end) {
                let first = end - length;
                let Some((primitive, mirrored)) = self.primitive(&turns[first..end - 1]) else {
                    continue;
                };
                let cost = best[first].0 + primitive.cost();
                if cost < choice.0
                    && self.is_free(primitive, &stances[first], &rolls[first], mirrored)
                {
                    choice = (cost, length);
                }
            }
            best.push(choice);
        }
        let mut pieces = Vec::new();
        let mut end = rolls.len();
        while end > 0 {
            let length = best[end].1;
            if length == 0 {
                return None;
            }
            pieces.push(length);
            end -= length;
        }
        pieces.reverse();
        Some(pieces)
    }

    fn is_free(
        &self,
        primitive: &Primitive,
        stance: &Stance,
        roll: &SequenceRoll,
        mirrored: bool,
    ) -> bool {
        self.obstacles.is_empty()
            || primitive
                .place(stance, roll.side, mirrored)
                .is_some_and(|(motion, _)| self.touched(&self.swept(&motion)).is_none())
    }

    /// The turns between successive rolls; none where a roll goes back over the side that the last
    /// one came over, as at a waypoint from which the way leads back.
    fn turns(&self, stances: &[Stance], rolls: &[SequenceRoll]) -> Vec<Option<Turn>> {
        (1..rolls.len())
            .map(|k| self.turn(&stances[k], &rolls[k - 1], &rolls[k]))
            .collect()
    }

    /// The primitive that walks a piece with the given turns, and whether it has to be mirrored.
    fn primitive(&self, turns: &[Option<Turn>]) -> Option<(&'a Primitive, bool)> {
        let turns: Vec<Turn> = turns.iter().copied().collect::<Option<_>>()?;
        self.library.get(&turns)
    }

    /// Whether `next` turns left or right after `last`.
    fn turn(&self, stance: &Stance, last: &SequenceRoll, next: &SequenceRoll) -> Option<Turn> {
        if next.lifted == last.landed {
            return None;
        }
        let at = |node: usize| self.robot().dimension().node(&stance.coordinates, node);
        let ahead = at(last.landed) - (at(last.pivots[0]) + at(last.pivots[1])) * 0.5;
        // The pivot that lifts lies on the side away from the turn.
        Some(
            if ahead.cross(&(at(next.lifted) - at(last.landed))).z > 0.0 {
                Turn::Right
            } else {
                Turn::Left
            },
        )
    }

    fn stitch(
        &self,
        start: &Stance,
        stances: &[Stance],
        rolls: &[SequenceRoll],
        pieces: &[usize],
    ) -> SupportedMotion {
        let turns = self.turns(stances, rolls);
        let mut motion = SupportedMotion {
            configurations: vec![start.coordinates.clone()],
            supports: vec![start.support.clone()],
            rolls: Vec::new(),
        };
        let mut first = 0;
        for &length in pieces {
            let placed = self
                .primitive(&turns[first..first + length - 1])
                .and_then(|(p, mirrored)| p.place(&stances[first], rolls[first].side, mirrored));
            // `cut` has used only primitives that are there and can be placed.
            if let Some((piece, _)) = placed {
                let offset = motion.configurations.len() - 1;
                motion
                    .rolls
                    .extend(piece.rolls.iter().map(|roll| roll + offset));
                motion
                    .configurations
                    .extend_from_slice(&piece.configurations[1..]);
                motion.supports.extend_from_slice(&piece.supports[1..]);
            }
            first += length;
        }
        motion
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
