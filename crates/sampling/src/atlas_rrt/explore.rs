//! Trees without a goal: how a sampling-based planner explores a manifold.

use cpu_time::ThreadTime;
use tensegra_atlas::{ImplicitManifold, Validity, dimension};

use super::{AtlasRrt, search::Search};
use crate::plan::PlanError;

/// Branches in a row without a node after which a tree counts as full. Without a goal
/// there is no narrow passage that must be found.
const FRUITLESS: usize = 5_000;

/// A point of the manifold, and the index of the node that it was reached from.
pub type ExploredNode = (Vec<f64>, Option<usize>);

impl<M: ImplicitManifold + ?Sized, V: Validity> AtlasRrt<'_, M, V> {
    /// Grows one tree from `start`, a point of the manifold, until it has `nodes`
    /// nodes, the time limit is reached, or no branch makes progress any more.
    /// Returns its nodes, each with the index of its parent.
    ///
    /// # Errors
    /// [`PlanError`] when an option makes no sense or the start is not valid.
    pub fn explore(&self, start: &[f64], nodes: usize) -> Result<Vec<ExploredNode>, PlanError> {
        let clock = ThreadTime::now();
        self.options.check()?;
        self.validate("start", start)?;
        let mut planner = AtlasRrt::new(self.manifold, self.validity, self.options.clone());
        planner.options.two_trees = false;
        let k = dimension(self.manifold, start);
        let mut search = Search::new(&planner, k, start, start)?;
        let mut target = start.to_vec();
        let mut fruitless = 0;
        while search.trees[0].len() < nodes
            && fruitless < FRUITLESS
            && clock.elapsed().as_secs_f64() < self.options.time_limit
        {
            let chart = search.sample(0, &mut target);
            let (near, _) = search.trees[0].nearest(&target);
            let branch = search.extend(0, near, &target, false);
            search.adapt_radius(chart, branch.reached);
            fruitless = if branch.first == branch.last {
                fruitless + 1
            } else {
                0
            };
        }
        let tree = &search.trees[0];
        Ok((0..tree.len().min(nodes))
            .map(|node| (tree.point(node).to_vec(), tree.parent(node)))
            .collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::PlannerOptions;
    use tensegra_atlas::{Predicate, doc::Sphere};

    #[test]
    fn a_tree_spreads_over_the_valid_part_of_the_sphere() {
        let sphere = Sphere::new();
        let upper = Predicate::new(3, 2, |x: &[f64]| x[2] > 0.0);
        let planner = AtlasRrt::new(&sphere, &upper, PlannerOptions::default());
        let tree = planner.explore(&[0.0, 0.0, 1.0], 600).unwrap();
        assert_eq!(tree.len(), 600);
        assert!(tree[0].1.is_none());
        for (i, (point, parent)) in tree.iter().enumerate().skip(1) {
            assert!(point[2] > 0.0 && parent.unwrap() < i);
        }
        // It reaches all sides.
        for side in [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]] {
            let near = |x: &[f64]| (x[0] - side[0]).hypot(x[1] - side[1]) < 0.3;
            assert!(tree.iter().any(|(x, _)| near(x)), "{side:?}");
        }
        assert!(planner.explore(&[0.0, 0.0, -1.0], 10).is_err());
    }
}
