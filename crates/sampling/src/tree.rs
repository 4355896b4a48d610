//! A tree of points of the manifold.

use crate::{neighbours::Neighbours, options::NeighbourSearch};

#[derive(Clone, Debug)]
pub(crate) struct Tree {
    dimension: usize,
    points: Vec<f64>,
    parents: Vec<u32>,
    charts: Vec<u32>,
    /// Charts that nodes are or were represented by, and whether a chart is one.
    used: Vec<usize>,
    is_used: Vec<bool>,
    neighbours: Neighbours,
}

const NONE: u32 = u32::MAX;

#[inline(always)]
pub(crate) fn squared_distance(a: &[f64], b: &[f64]) -> f64 {
    if let ([a0, a1, a2], [b0, b1, b2]) = (a, b) {
        let d = [a0 - b0, a1 - b1, a2 - b2];
        return d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
    }
    let mut sums = [0.0; 4];
    let (a4, b4) = (a.chunks_exact(4), b.chunks_exact(4));
    let rest: f64 = a4
        .remainder()
        .iter()
        .zip(b4.remainder())
        .map(|(x, y)| (x - y) * (x - y))
        .sum();
    for (x, y) in a4.zip(b4) {
        for i in 0..4 {
            let d = x[i] - y[i];
            sums[i] += d * d;
        }
    }
    (sums[0] + sums[2]) + (sums[1] + sums[3]) + rest
}

impl Tree {
    /// A tree with one node.
    pub(crate) fn new(search: NeighbourSearch, root: &[f64], chart: usize) -> Self {
        let mut tree = Self {
            dimension: root.len(),
            points: Vec::new(),
            parents: Vec::new(),
            charts: Vec::new(),
            used: Vec::new(),
            is_used: Vec::new(),
            neighbours: Neighbours::new(search, root.len()),
        };
        tree.add(root, None, chart, root);
        tree.use_chart(chart);
        tree
    }

    pub(crate) fn len(&self) -> usize {
        self.parents.len()
    }

    pub(crate) fn point(&self, node: usize) -> &[f64] {
        &self.points[node * self.dimension..(node + 1) * self.dimension]
    }

    pub(crate) fn chart(&self, node: usize) -> usize {
        self.charts[node] as usize
    }

    /// Lets another chart represent a node. The node stays where the search for
    /// neighbours looks for it.
    pub(crate) fn set_chart(&mut self, node: usize, chart: usize) {
        self.charts[node] = chart as u32;
    }

    /// Charts that nodes are, or were, represented by.
    pub(crate) fn used_charts(&self) -> &[usize] {
        &self.used
    }

    /// Adds a chart to the used ones.
    pub(crate) fn use_chart(&mut self, chart: usize) {
        if self.is_used.len() <= chart {
            self.is_used.resize(chart + 1, false);
        }
        if !std::mem::replace(&mut self.is_used[chart], true) {
            self.used.push(chart);
        }
    }

    pub(crate) fn parent(&self, node: usize) -> Option<usize> {
        let parent = self.parents[node];
        (parent != NONE).then_some(parent as usize)
    }

    /// Adds a node represented by the chart with the given centre.
    pub(crate) fn add(
        &mut self,
        point: &[f64],
        parent: Option<usize>,
        chart: usize,
        center: &[f64],
    ) -> usize {
        let node = self.parents.len();
        self.points.extend_from_slice(point);
        self.parents.push(parent.map_or(NONE, |p| p as u32));
        self.charts.push(chart as u32);
        self.neighbours.add(node, point, chart, center);
        node
    }

    /// Removes a node with all its descendants, unless it is the root; the others
    /// are numbered anew. Cost: linear in the nodes.
    pub(crate) fn prune(&mut self, node: usize) {
        if node == 0 {
            return;
        }
        // Parents come before their children.
        let mut numbers: Vec<Option<usize>> = Vec::with_capacity(self.len());
        let mut kept = 0;
        for old in 0..self.len() {
            let orphan = self.parent(old).is_some_and(|p| numbers[p].is_none());
            let number = (old != node && !orphan).then_some(kept);
            if number.is_some() {
                let parent = self.parent(old).and_then(|p| numbers[p]);
                self.parents[kept] = parent.map_or(NONE, |p| p as u32);
                self.charts[kept] = self.charts[old];
                let range = old * self.dimension..(old + 1) * self.dimension;
                self.points.copy_within(range, kept * self.dimension);
                kept += 1;
            }
            numbers.push(number);
        }
        self.parents.truncate(kept);
        self.charts.truncate(kept);
        self.points.truncate(kept * self.dimension);
        let (points, dimension) = (&self.points, self.dimension);
        let point = |node: usize| &points[node * dimension..(node + 1) * dimension];
        self.neighbours.renumber(&numbers, point);
    }

    /// The node nearest to x, and its distance.
    pub(crate) fn nearest(&mut self, x: &[f64]) -> (usize, f64) {
        self.nearest_within(x, f64::INFINITY)
            .unwrap_or((0, f64::INFINITY))
    }

    /// The node nearest to x, and its distance, if that is less than `reach`: the
    /// smaller, the cheaper.
    pub(crate) fn nearest_within(&mut self, x: &[f64], reach: f64) -> Option<(usize, f64)> {
        let (node, square) = self.neighbours.nearest(x, reach)?;
        Some((node, square.sqrt()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SEARCHES: [NeighbourSearch; 3] = [
        NeighbourSearch::ByChart,
        NeighbourSearch::Linear,
        NeighbourSearch::KdTree,
    ];

    #[test]
    fn pruning_removes_a_node_and_what_grew_from_it() {
        for search in SEARCHES {
            let mut tree = Tree::new(search, &[0.0], 0);
            for (x, parent, chart) in [
                (1.0, 0, 0),
                (2.0, 1, 1),
                (3.0, 2, 1),
                (4.0, 0, 1),
                (5.0, 4, 2),
            ] {
                tree.add(&[x], Some(parent), chart, &[2.0 * chart as f64]);
            }
            tree.set_chart(1, 2);
            tree.prune(2);
            let left: Vec<f64> = (0..tree.len()).map(|i| tree.point(i)[0]).collect();
            assert_eq!(left, [0.0, 1.0, 4.0, 5.0]);
            assert_eq!([tree.parent(2), tree.parent(3)], [Some(0), Some(2)]);
            assert_eq!([tree.chart(1), tree.chart(2), tree.chart(3)], [2, 1, 2]);
            assert_eq!(tree.nearest(&[2.9]), (2, 4.0 - 2.9));
            tree.prune(0);
            assert_eq!(tree.len(), 4);
        }
    }

    #[test]
    fn the_nearest_node_is_that_of_a_full_scan() {
        for search in SEARCHES {
            let mut tree = Tree::new(search, &[0.0; 3], 0);
            let mut state = 1_u64;
            let mut random = || {
                state = state
                    .wrapping_mul(6364136223846793005)
                    .wrapping_add(1442695040888963407);
                (state >> 33) as f64 / f64::from(1_u32 << 31) - 0.5
            };
            for i in 0..200 {
                let chart = i % 7;
                let point = [random(), random(), random()];
                tree.add(
                    &point,
                    Some(0),
                    chart,
                    &[chart as f64 / 7.0 - 0.5, 0.0, 0.0],
                );
            }
            for _ in 0..100 {
                let x = [random(), random(), random()];
                let (node, distance) = tree.nearest(&x);
                let full = (0..tree.len())
                    .map(|i| squared_distance(&x, tree.point(i)).sqrt())
                    .fold(f64::INFINITY, f64::min);
                assert_eq!(distance, full);
                assert_eq!(squared_distance(&x, tree.point(node)).sqrt(), full);
            }
        }
    }
}
