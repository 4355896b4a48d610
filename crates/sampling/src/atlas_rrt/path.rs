//! The path through the trees: points that hold the equations and limits to
//! rounding, as close to each other as is asked for.

use cpu_time::ThreadTime;
use tensegra_atlas::{ImplicitManifold, Validity, project};

use super::{ROUNDING, search::Search, step::interpolate};
use crate::{
    plan::Statistics,
    tree::{Tree, squared_distance},
};

/// Residual of the points of the returned path.
const FINAL_TOLERANCE: f64 = 1e-12;
/// How often the gap between two nodes is halved.
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
    /// goal).
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
        let mut points: Vec<Vec<f64>> = Vec::new();
        for i in 0..=nodes.len() {
            let (mut x, chart) = match nodes.get(i) {
                Some(&NodeOf { tree, node }) => {
                    let tree = &self.trees[tree];
                    (tree.point(node).to_vec(), tree.chart(node))
                }
                None if self.trees.len() == 1 => (self.goal.clone(), self.goal_chart),
                None => break,
            };
            // Where the trees meet, or where the branch leads away from the root:
            // the node before.
            let broken = nodes[if i < meeting { i } else { i - 1 }];
            if self.settle(&mut x, chart).is_none() {
                return Err(nodes.get(i).copied().unwrap_or(broken));
            }
            if points.is_empty() {
                self.planner.validity.enter(&x, &mut self.memory);
                self.here.x.copy_from_slice(&x);
                points.push(x);
            } else if !self.refine(&mut points, x, chart, HALVINGS) {
                return Err(broken);
            }
        }
        Ok(points)
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
        let step = self.full_step.min(self.planner.options.path_step);
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

    /// Appends `x`, and before it points between the last one (in `here`) and it
    /// until none of the gaps is too wide.
    fn refine(
        &mut self,
        points: &mut Vec<Vec<f64>>,
        x: Vec<f64>,
        chart: usize,
        halvings: usize,
    ) -> bool {
        let planner = self.planner;
        let resolution = planner.options.path_step;
        if squared_distance(&self.here.x, &x) <= resolution * resolution
            && planner.validity.displacement(&self.here.x, &x) <= planner.max_displacement
            && self.is_nearly_straight(chart, &x)
            && (!self.turns_sharply(points, &x) || self.take_other_middle(&x))
            && self.is_robust(chart, &x)
        {
            self.here.x.copy_from_slice(&x);
            std::mem::swap(&mut self.memory, &mut self.next_memory);
            points.push(x);
            return true;
        }
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
