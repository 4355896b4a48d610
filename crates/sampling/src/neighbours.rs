//! Search for the node of a tree that is nearest to a point.

use kdtree::KdTree;
use tensegra_atlas::PackedPoints;

use crate::{options::NeighbourSearch, tree::squared_distance};

/// The nodes of a tree, arranged for searches.
#[derive(Clone, Debug)]
pub(crate) enum Neighbours {
    ByChart(ByChart),
    Linear(Linear),
    KdTree(KdTree<f64, usize, Vec<f64>>),
}

impl Neighbours {
    /// No nodes yet, of points of the given dimension.
    pub(crate) fn new(search: NeighbourSearch, dimension: usize) -> Self {
        match search {
            NeighbourSearch::ByChart => Self::ByChart(ByChart::new(dimension)),
            NeighbourSearch::Linear => Self::Linear(Linear::new(dimension)),
            NeighbourSearch::KdTree => Self::KdTree(KdTree::new(dimension)),
        }
    }

    /// Adds a node, numbered in order from zero, that was found by the chart with
    /// the given centre.
    pub(crate) fn add(&mut self, node: usize, point: &[f64], chart: usize, center: &[f64]) {
        match self {
            Self::ByChart(groups) => groups.add(node, point, chart, center),
            Self::Linear(list) => list.points.push(point),
            Self::KdTree(tree) => add_to_tree(tree, point, node),
        }
    }

    /// The node nearest to x, and its squared distance, if that is less than
    /// `reach` squared.
    pub(crate) fn nearest(&mut self, x: &[f64], reach: f64) -> Option<(usize, f64)> {
        let found = match self {
            Self::ByChart(groups) => groups.nearest(x, reach),
            Self::Linear(list) => list.nearest(x),
            Self::KdTree(tree) => {
                let found = tree.nearest(x, 1, &squared_distance).ok()?;
                let &(distance, &node) = found.first()?;
                Some((node, distance))
            }
        };
        found.filter(|(_, distance)| *distance < reach * reach)
    }

    /// Keeps the nodes with a new number, in ascending order, and gives them that;
    /// `point` tells the point of each by its new number.
    pub(crate) fn renumber<'p>(
        &mut self,
        numbers: &[Option<usize>],
        point: impl Fn(usize) -> &'p [f64],
    ) {
        let kept = numbers.iter().copied().flatten();
        match self {
            Self::ByChart(groups) => groups.renumber(numbers, point),
            Self::Linear(list) => {
                *list = Linear::new(list.points.dimension());
                kept.for_each(|node| list.points.push(point(node)));
            }
            Self::KdTree(tree) => {
                let mut kept = kept.peekable();
                *tree = KdTree::new(kept.peek().map_or(0, |&node| point(node).len()));
                kept.for_each(|node| add_to_tree(tree, point(node), node));
            }
        }
    }
}

fn add_to_tree(tree: &mut KdTree<f64, usize, Vec<f64>>, point: &[f64], node: usize) {
    let added = tree.add(point.to_vec(), node);
    debug_assert!(added.is_ok(), "points are finite and of one dimension");
}

/// A list of all points.
#[derive(Clone, Debug)]
pub(crate) struct Linear {
    points: PackedPoints,
    distances: Vec<f64>,
}

impl Linear {
    fn new(dimension: usize) -> Self {
        Self {
            points: PackedPoints::new(dimension),
            distances: Vec::new(),
        }
    }

    fn nearest(&mut self, x: &[f64]) -> Option<(usize, f64)> {
        self.points.squared_distances(x, &mut self.distances);
        let distances = self.distances.iter().copied().enumerate();
        distances.min_by(|a, b| a.1.total_cmp(&b.1))
    }
}

/// Nodes grouped by the chart that found them: a group whose centre minus radius
/// is farther than the best node found is skipped.
#[derive(Clone, Debug)]
pub(crate) struct ByChart {
    groups: Vec<Group>,
    /// Centres of the groups, and how far their members lie from them.
    centers: PackedPoints,
    radii: Vec<f64>,
    /// Group of each chart of the atlas, if it has one.
    group_of_chart: Vec<Option<u32>>,
    /// Scratch: squared distances of centres, and of members.
    squares: Vec<f64>,
    distances: Vec<f64>,
}

/// Nodes of one chart.
#[derive(Clone, Debug)]
struct Group {
    members: Vec<u32>,
    points: PackedPoints,
}

impl ByChart {
    fn new(dimension: usize) -> Self {
        Self {
            groups: Vec::new(),
            centers: PackedPoints::new(dimension),
            radii: Vec::new(),
            group_of_chart: Vec::new(),
            squares: Vec::new(),
            distances: Vec::new(),
        }
    }

    fn add(&mut self, node: usize, point: &[f64], chart: usize, center: &[f64]) {
        if self.group_of_chart.len() <= chart {
            self.group_of_chart.resize(chart + 1, None);
        }
        let group = *self.group_of_chart[chart].get_or_insert_with(|| {
            self.groups.push(Group {
                members: Vec::new(),
                points: PackedPoints::new(point.len()),
            });
            self.centers.push(center);
            self.radii.push(0.0);
            self.groups.len() as u32 - 1
        }) as usize;
        let radius = &mut self.radii[group];
        *radius = radius.max(squared_distance(point, center).sqrt());
        let group = &mut self.groups[group];
        group.members.push(node as u32);
        group.points.push(point);
    }

    fn renumber<'p>(&mut self, numbers: &[Option<usize>], point: impl Fn(usize) -> &'p [f64]) {
        // Radii stay bounds, if not the least ones.
        for group in &mut self.groups {
            group.points = PackedPoints::new(group.points.dimension());
            group.members.retain_mut(|member| {
                let Some(number) = numbers[*member as usize] else {
                    return false;
                };
                *member = number as u32;
                group.points.push(point(number));
                true
            });
        }
    }

    fn nearest(&mut self, x: &[f64], reach: f64) -> Option<(usize, f64)> {
        let Self {
            groups,
            centers,
            radii,
            squares,
            distances,
            ..
        } = self;
        centers.squared_distances(x, squares);
        let mut best = (None, reach * reach);
        let mut search = |group: &Group, best: &mut (Option<usize>, f64)| {
            group.points.squared_distances(x, distances);
            for (&node, &distance) in group.members.iter().zip(&*distances) {
                if distance < best.1 {
                    *best = (Some(node as usize), distance);
                }
            }
        };
        // The group with the nearest centre first: most others are then skipped.
        let (mut nearest, mut least) = (None, f64::INFINITY);
        for (i, &square) in squares.iter().enumerate() {
            if square < least {
                (nearest, least) = (Some(i), square);
            }
        }
        let mut reach = reach;
        let others = (0..groups.len()).filter(|&i| Some(i) != nearest);
        for i in nearest.into_iter().chain(others) {
            let farthest = reach + radii[i];
            if squares[i] < farthest * farthest {
                search(&groups[i], &mut best);
                reach = best.1.sqrt();
            }
        }
        best.0.map(|node| (node, best.1))
    }
}
