//! A tree of points of the manifold, with nearest neighbours by chart.
//!
//! Nodes are grouped by the chart that represents them; a group whose centre
//! minus radius is farther than the best node found is skipped. Exact; a query
//! costs one distance per chart and one per node in the charts nearby.

use tensegra_atlas::PackedPoints;

/// Nodes of one chart.
#[derive(Clone, Debug)]
struct Group {
    members: Vec<u32>,
    points: PackedPoints,
}

#[derive(Clone, Debug)]
pub(crate) struct Tree {
    dimension: usize,
    points: Vec<f64>,
    parents: Vec<u32>,
    charts: Vec<u32>,
    /// Charts that nodes are or were represented by, and whether a chart is one.
    used: Vec<usize>,
    is_used: Vec<bool>,
    groups: Vec<Group>,
    /// Centres of the groups, and how far their members lie from them.
    centers: PackedPoints,
    radii: Vec<f64>,
    /// Group of each chart of the atlas, `u32::MAX` where there is none.
    group_of_chart: Vec<u32>,
    /// Scratch: lower bounds of the distances of groups, and distances of members.
    bounds: Vec<f64>,
    distances: Vec<f64>,
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
    pub(crate) fn new(root: &[f64], chart: usize, center: &[f64]) -> Self {
        let mut tree = Self::empty(root.len());
        tree.add(root, None, chart, center);
        tree.use_chart(chart);
        tree
    }

    fn empty(dimension: usize) -> Self {
        Self {
            dimension,
            points: Vec::new(),
            parents: Vec::new(),
            charts: Vec::new(),
            used: Vec::new(),
            is_used: Vec::new(),
            groups: Vec::new(),
            centers: PackedPoints::new(dimension),
            radii: Vec::new(),
            group_of_chart: Vec::new(),
            bounds: Vec::new(),
            distances: Vec::new(),
        }
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

    /// Lets another chart represent a node. The node stays in its group, which
    /// only serves the search for neighbours.
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
        if self.group_of_chart.len() <= chart {
            self.group_of_chart.resize(chart + 1, NONE);
        }
        if self.group_of_chart[chart] == NONE {
            self.group_of_chart[chart] = self.groups.len() as u32;
            self.groups.push(Group {
                members: Vec::new(),
                points: PackedPoints::new(self.dimension),
            });
            self.centers.push(center);
            self.radii.push(0.0);
        }
        let group = self.group_of_chart[chart] as usize;
        let radius = &mut self.radii[group];
        *radius = radius.max(squared_distance(point, center).sqrt());
        let group = &mut self.groups[group];
        group.members.push(node as u32);
        group.points.push(point);
        node
    }

    /// Removes a node with all its descendants, unless it is the root; the others
    /// are numbered anew. Cost: linear in the nodes.
    pub(crate) fn prune(&mut self, node: usize) {
        if node == 0 {
            return;
        }
        let mut whole = std::mem::replace(self, Self::empty(self.dimension));
        self.used = std::mem::take(&mut whole.used);
        self.is_used = std::mem::take(&mut whole.is_used);
        let mut center = vec![0.0; self.dimension];
        let mut group_charts = vec![0; whole.len()];
        for (chart, &group) in whole.group_of_chart.iter().enumerate() {
            if group != NONE {
                for &member in &whole.groups[group as usize].members {
                    group_charts[member as usize] = chart;
                }
            }
        }
        // Parents come before their children.
        let mut numbers = vec![NONE; whole.len()];
        for old in 0..whole.len() {
            let parent = whole.parent(old).map(|parent| numbers[parent]);
            if old == node || parent == Some(NONE) {
                continue;
            }
            let chart = group_charts[old];
            let group = whole.group_of_chart[chart] as usize;
            whole.centers.copy(group, &mut center);
            let parent = parent.map(|parent| parent as usize);
            let new = self.add(whole.point(old), parent, chart, &center);
            self.set_chart(new, whole.chart(old));
            numbers[old] = new as u32;
        }
    }

    /// The node nearest to x, and its distance.
    pub(crate) fn nearest(&mut self, x: &[f64]) -> (usize, f64) {
        self.nearest_within(x, f64::INFINITY)
            .unwrap_or((0, f64::INFINITY))
    }

    /// The node nearest to x, and its distance, if that is less than `reach`: the
    /// smaller, the cheaper.
    pub(crate) fn nearest_within(&mut self, x: &[f64], reach: f64) -> Option<(usize, f64)> {
        let Self {
            groups,
            centers,
            radii,
            bounds,
            distances,
            ..
        } = self;
        centers.squared_distances(x, bounds);
        for (bound, radius) in bounds.iter_mut().zip(&*radii) {
            let distance = (bound.sqrt() - radius).max(0.0);
            *bound = distance * distance;
        }
        let mut best = (usize::MAX, reach * reach);
        let mut search = |group: &Group, best: &mut (usize, f64)| {
            group.points.squared_distances(x, distances);
            for (&node, &distance) in group.members.iter().zip(&*distances) {
                if distance < best.1 {
                    *best = (node as usize, distance);
                }
            }
        };
        // The most promising group first: most others are then skipped.
        let promising = (0..groups.len()).min_by(|&a, &b| bounds[a].total_cmp(&bounds[b]));
        if let Some(first) = promising
            && bounds[first] < best.1
        {
            search(&groups[first], &mut best);
            bounds[first] = f64::INFINITY;
        }
        for (group, &bound) in groups.iter().zip(&*bounds) {
            if bound < best.1 {
                search(group, &mut best);
            }
        }
        (best.0 != usize::MAX).then(|| (best.0, best.1.sqrt()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pruning_removes_a_node_and_what_grew_from_it() {
        let mut tree = Tree::new(&[0.0], 0, &[0.0]);
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

    #[test]
    fn the_nearest_node_is_that_of_a_full_scan() {
        let mut tree = Tree::new(&[0.0; 3], 0, &[0.0; 3]);
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
