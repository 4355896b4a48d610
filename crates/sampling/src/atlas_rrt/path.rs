//! The path through the trees: points that hold the equations and limits closely,
//! as near to each other as is asked for.

use cpu_time::ThreadTime;
use tensegra_atlas::{ImplicitManifold, Validity, project};

use super::{ROUNDING, search::Search, step::interpolate};
use crate::{
    plan::Statistics,
    tree::{Tree, squared_distance},
};

/// Residual of the points of the returned path.
const FINAL_TOLERANCE: f64 = 1e-10;
/// Points are put this fraction of the longest step apart: the way along the manifold
/// is a little longer than that along the edges.
const SPACING: f64 = 0.98;
/// How often the gap between two points is halved.
const HALVINGS: usize = 8;
/// Corrections of a point that violates limits.
const CORRECTIONS: usize = 8;
/// Between points of the path, limits may be left by this much,
const BETWEEN: f64 = 5e-4;
/// and the motion may stray from the straight line by this fraction of its length.
const DEVIATION: f64 = 0.05;
/// Gaps shorter than this fraction of a step, and turns of a smaller cosine, are the
/// marks of a path that changes from one sheet of the manifold to another.
const SHORT: f64 = 1.0 / 3.0;
const TURN: f64 = 0.9;
/// Newton steps that return to the manifold there.
const RETURN: usize = 30;
/// A correction aims this far inside a limit, and this fraction of the violation farther.
const INSIDE: f64 = 1e-6;
const OVERSHOOT: f64 = 0.2;

/// A node of one of the trees.
#[derive(Clone, Copy, Debug)]
pub(super) struct NodeOf {
    tree: usize,
    node: usize,
}

/// Where the edges of a path meet.
#[derive(Clone, Debug)]
struct Corner {
    x: Vec<f64>,
    chart: usize,
}

impl<M: ImplicitManifold + ?Sized, V: Validity> Search<'_, M, V> {
    /// Figures of the search.
    pub(super) fn figures(&self, clock: &ThreadTime) -> Statistics {
        let mut figures = self.statistics;
        (figures.charts, figures.nodes) = self.grown();
        figures.projections = self.work.projections;
        figures.chord_iterations = self.work.chord_iterations;
        figures.newton_iterations = self.work.newton_iterations;
        figures.seconds = clock.elapsed().as_secs_f64();
        figures
    }

    /// The path through node `a` of the first tree and `b` of the second (or the
    /// goal): points at equal spacing along the edges between them, which cut a corner
    /// where that is valid.
    ///
    /// # Errors
    /// The node whose branch cannot be kept within the limits and clear at
    /// points between it and its parent.
    pub(super) fn path(&mut self, a: usize, b: usize) -> Result<Vec<Vec<f64>>, NodeOf> {
        let mut nodes = branch_of(&self.trees, 0, a);
        nodes.reverse();
        let meeting = nodes.len();
        if self.trees.len() == 2 {
            nodes.extend(branch_of(&self.trees, 1, b));
        }
        // Where the trees meet, or where the branch leads away from the root: the
        // node before.
        let edge_to = |corner: usize| nodes[if corner < meeting { corner } else { corner - 1 }];
        let corners = self.corners(&nodes);
        let steps = self.cumulated_steps(&corners);
        let last = corners.len() - 1;
        let mut x = corners[0].x.clone();
        self.settle(&mut x, corners[0].chart).ok_or(nodes[0])?;
        self.planner.validity.enter(&x, &mut self.memory);
        self.here.x.copy_from_slice(&x);
        let mut points = vec![x];
        let pieces = (steps[last] / SPACING).ceil().max(1.0) as usize;
        // The corner ahead.
        let mut ahead = 1;
        for piece in 1..=pieces {
            let passed = ahead;
            let mut x = vec![0.0; self.here.x.len()];
            if piece == pieces {
                ahead = last;
                x.copy_from_slice(&corners[last].x);
            } else {
                let at = steps[last] * piece as f64 / pieces as f64;
                ahead += steps[ahead..last].partition_point(|&steps| steps < at);
                let s = (at - steps[ahead - 1]) / (steps[ahead] - steps[ahead - 1]);
                interpolate(s, &corners[ahead - 1].x, &corners[ahead].x, &mut x);
            }
            let chart = corners[ahead].chart;
            self.settle(&mut x, chart).ok_or(edge_to(ahead))?;
            if passed < ahead {
                match self.append(&mut points, x, chart) {
                    Ok(()) => continue,
                    Err(same) => x = same,
                }
                // Some corner on the way must not be cut.
                for corner in passed..ahead {
                    let Corner { mut x, chart } = corners[corner].clone();
                    self.settle(&mut x, chart).ok_or(nodes[corner])?;
                    if !self.refine(&mut points, x, chart, HALVINGS) {
                        return Err(edge_to(corner));
                    }
                }
            }
            if !self.refine(&mut points, x, chart, HALVINGS) {
                return Err(edge_to(ahead));
            }
        }
        Ok(points)
    }

    /// The places of nodes, and the goal behind them where it is none.
    fn corners(&self, nodes: &[NodeOf]) -> Vec<Corner> {
        let goal = (self.trees.len() == 1).then(|| Corner {
            x: self.goal.clone(),
            chart: self.goal_chart,
        });
        let places = nodes.iter().map(|&NodeOf { tree, node }| Corner {
            x: self.trees[tree].point(node).to_vec(),
            chart: self.trees[tree].chart(node),
        });
        places.chain(goal).collect()
    }

    /// The way from the first corner to each, in steps as long as the path may have.
    fn cumulated_steps(&self, corners: &[Corner]) -> Vec<f64> {
        let planner = self.planner;
        let resolution = self.resolution();
        let mut way = 0.0;
        let mut steps = vec![0.0];
        steps.extend(corners.windows(2).map(|pair| {
            let (a, b) = (&pair[0].x, &pair[1].x);
            let distance = squared_distance(a, b).sqrt() / resolution;
            let displacement = planner.validity.displacement(a, b) / planner.max_displacement;
            way += distance.max(displacement);
            way
        }));
        steps
    }

    /// Distance at which points of the path are put.
    fn resolution(&self) -> f64 {
        self.full_step.min(self.planner.options.path_step)
    }

    /// Removes a node and all that grew from it; a root stays.
    pub(super) fn prune(&mut self, broken: NodeOf) {
        self.trees[broken.tree].prune(broken.node);
    }

    /// Moves a point onto the manifold and into the limits.
    fn settle(&mut self, x: &mut [f64], chart: usize) -> Option<()> {
        let manifold = self.planner.manifold;
        self.next.x.copy_from_slice(x);
        for _ in 0..=CORRECTIONS {
            self.atlas
                .chart(chart)
                .retract(manifold, &mut self.next.x, FINAL_TOLERANCE, &mut self.work)
                .ok()?;
            self.violated.clear();
            self.find_violated_limits(ROUNDING);
            if self.violated.is_empty() {
                x.copy_from_slice(&self.next.x);
                return Some(());
            }
            self.rows.clear();
            manifold.jacobian(&self.next.x, &mut self.jacobian);
            for i in 0..self.violated.len() {
                let constraint = self.violated[i];
                let value = self.linearise(chart, constraint, true)?;
                let wanted = INSIDE - (1.0 + OVERSHOOT) * value;
                self.rows.set(constraint, &self.tangent_gradient, wanted);
            }
            self.step.fill(0.0);
            self.rows.solve(&mut self.step);
            let chart = self.atlas.chart(chart);
            for (j, &s) in self.step.iter().enumerate() {
                for (x, v) in self.next.x.iter_mut().zip(chart.tangent(j)) {
                    *x += s * v;
                }
            }
        }
        None
    }

    /// Whether the motion from `here` to x, judged at its middle, keeps to the
    /// limits and strays little from the straight line. The middle remains in `next`.
    fn is_nearly_straight(&mut self, chart: usize, x: &[f64]) -> bool {
        let planner = self.planner;
        let (manifold, tolerance) = (planner.manifold, planner.options.tolerance);
        let straight = middle(&self.here.x, x);
        self.next.x.copy_from_slice(&straight);
        let chart = self.atlas.chart(chart);
        if chart
            .retract(manifold, &mut self.next.x, tolerance, &mut self.work)
            .is_err()
        {
            return false;
        }
        self.violated.clear();
        self.find_violated_limits(BETWEEN);
        self.violated.is_empty()
            && squared_distance(&self.next.x, &straight)
                <= DEVIATION * DEVIATION * squared_distance(&self.here.x, x)
    }

    /// Whether a short gap to x follows the points at an angle.
    fn turns_sharply(&self, points: &[Vec<f64>], x: &[f64]) -> bool {
        let here = &self.here.x;
        let gap = squared_distance(here, x);
        let step = self.resolution();
        let [.., before, _] = points else {
            return false;
        };
        if gap > (SHORT * step).powi(2) {
            return false;
        }
        let ways = before.iter().zip(here).zip(x);
        let along: f64 = ways.map(|((b, h), x)| (h - b) * (x - h)).sum();
        along < TURN * (squared_distance(before, here) * gap).sqrt()
    }

    /// Where sheets meet, how far the middle strays depends on how it returns to the
    /// manifold, and the equations nearly hold far from it: puts into `next` the one
    /// found by Newton's method to the last digit, if that strays farther. Whether there
    /// is one, within the limits.
    fn take_other_middle(&mut self, x: &[f64]) -> bool {
        let manifold = self.planner.manifold;
        let straight = middle(&self.here.x, x);
        let mut other = straight.clone();
        if project(manifold, &mut other, FINAL_TOLERANCE, RETURN).is_err() {
            return false;
        }
        if squared_distance(&other, &straight) > squared_distance(&self.next.x, &straight) {
            self.next.x.copy_from_slice(&other);
        }
        self.violated.clear();
        self.find_violated_limits(BETWEEN);
        self.violated.is_empty()
    }

    /// Whether the step from `here` to x, whose middle is in `next`, is valid for
    /// whoever knows its ends alone.
    fn is_robust(&mut self, chart: usize, x: &[f64]) -> bool {
        let Self {
            planner,
            atlas,
            here,
            next,
            memory,
            next_memory,
            work,
            ..
        } = self;
        let (options, manifold) = (&planner.options, planner.manifold);
        let chart = atlas.chart(chart);
        planner
            .validity
            .robust_step(memory, x, next_memory, &mut |s, y| {
                if s == 0.5 {
                    y.copy_from_slice(&next.x);
                    return true;
                }
                interpolate(s, &here.x, x, y);
                chart.retract(manifold, y, options.tolerance, work).is_ok()
            })
    }

    /// Appends `x`, if the gap between the last point (in `here`) and it is not too
    /// wide.
    ///
    /// # Errors
    /// `x`, where it is.
    fn append(
        &mut self,
        points: &mut Vec<Vec<f64>>,
        x: Vec<f64>,
        chart: usize,
    ) -> Result<(), Vec<f64>> {
        let planner = self.planner;
        let longest = planner.options.path_step;
        let fits = squared_distance(&self.here.x, &x) <= longest * longest
            && planner.validity.displacement(&self.here.x, &x) <= planner.max_displacement
            && self.is_nearly_straight(chart, &x)
            && (!self.turns_sharply(points, &x) || self.take_other_middle(&x))
            && self.is_robust(chart, &x);
        if !fits {
            return Err(x);
        }
        self.here.x.copy_from_slice(&x);
        std::mem::swap(&mut self.memory, &mut self.next_memory);
        points.push(x);
        Ok(())
    }

    /// Appends `x`, and before it points between the last one and it until none of the
    /// gaps is too wide. `false` where this does not help.
    fn refine(
        &mut self,
        points: &mut Vec<Vec<f64>>,
        x: Vec<f64>,
        chart: usize,
        halvings: usize,
    ) -> bool {
        let Err(x) = self.append(points, x, chart) else {
            return true;
        };
        if halvings == 0 {
            return false;
        }
        let mut middle = middle(&self.here.x, &x);
        self.settle(&mut middle, chart).is_some()
            && self.refine(points, middle, chart, halvings - 1)
            && self.refine(points, x, chart, halvings - 1)
    }
}

/// A node and those that lead to it, from the node to the root.
fn branch_of(trees: &[Tree], tree: usize, node: usize) -> Vec<NodeOf> {
    std::iter::successors(Some(node), |&node| trees[tree].parent(node))
        .map(|node| NodeOf { tree, node })
        .collect()
}

/// The point halfway between two.
fn middle(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| 0.5 * (a + b)).collect()
}
