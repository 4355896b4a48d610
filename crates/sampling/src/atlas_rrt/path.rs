//! The path through the trees: polished, and subdivided where it is coarse.

use cpu_time::ThreadTime;
use tensegra_atlas::{ImplicitManifold, Validity};

use super::search::Search;
use crate::{
    plan::{Failure, Plan, PlanError},
    tree::Tree,
};

/// Residual of the points of the returned path.
const FINAL_TOLERANCE: f64 = 1e-12;

impl<M: ImplicitManifold + ?Sized, V: Validity> Search<'_, M, V> {
    /// Path and statistics.
    pub(super) fn finish(
        mut self,
        outcome: Result<(usize, usize), Failure>,
        clock: &ThreadTime,
    ) -> Result<Plan, PlanError> {
        let points = outcome.map(|(a, b)| self.path(a, b));
        let mut statistics = self.statistics;
        statistics.seconds = clock.elapsed().as_secs_f64();
        statistics.charts = self.atlas.len();
        statistics.nodes = self.trees.iter().map(Tree::len).sum();
        statistics.projections = self.work.projections;
        statistics.chord_iterations = self.work.chord_iterations;
        statistics.newton_iterations = self.work.newton_iterations;
        match points {
            Ok(points) => Ok(Plan {
                points,
                statistics,
                trees: None,
            }),
            Err(failure) => Err(PlanError::NotFound {
                failure,
                statistics: Box::new(statistics),
            }),
        }
    }

    /// The path through node `a` of the first tree and `b` of the second (or the
    /// goal), its points polished, and subdivided where they lie too far apart.
    pub(super) fn path(&mut self, a: usize, b: usize) -> Vec<Vec<f64>> {
        let mut nodes = Vec::new();
        let mut cursor = Some(a);
        while let Some(node) = cursor {
            nodes.push((
                self.trees[0].point(node).to_vec(),
                self.trees[0].chart(node),
            ));
            cursor = self.trees[0].parent(node);
        }
        nodes.reverse();
        if let Some(tree) = self.trees.get(1) {
            let mut cursor = Some(b);
            while let Some(node) = cursor {
                nodes.push((tree.point(node).to_vec(), tree.chart(node)));
                cursor = tree.parent(node);
            }
        } else {
            nodes.push((self.goal.clone(), self.goal_chart));
        }
        let mut points: Vec<Vec<f64>> = Vec::new();
        for (mut x, chart) in nodes {
            self.polish(&mut x, chart);
            if let Some(previous) = points.last().cloned() {
                self.subdivide(&mut points, &previous, &x, chart, 8);
            }
            points.push(x);
        }
        points
    }

    pub(super) fn polish(&mut self, x: &mut [f64], chart: usize) {
        let before = x.to_vec();
        let manifold = self.planner.manifold;
        let chart = self.atlas.chart(chart);
        if chart
            .retract(manifold, x, FINAL_TOLERANCE, &mut self.work)
            .is_err()
        {
            x.copy_from_slice(&before);
        }
    }

    /// Appends points between `a` and `b` until none of the gaps is too wide.
    pub(super) fn subdivide(
        &mut self,
        points: &mut Vec<Vec<f64>>,
        a: &[f64],
        b: &[f64],
        chart: usize,
        depth: usize,
    ) {
        let planner = self.planner;
        if depth == 0 || planner.validity.displacement(a, b) <= planner.max_displacement {
            return;
        }
        let mut middle: Vec<f64> = a.iter().zip(b).map(|(a, b)| 0.5 * (a + b)).collect();
        self.polish(&mut middle, chart);
        self.subdivide(points, a, &middle, chart, depth - 1);
        points.push(middle.clone());
        self.subdivide(points, &middle, b, chart, depth - 1);
    }
}
