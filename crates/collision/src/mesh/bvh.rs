//! A binary tree of axis-aligned boxes over triangles: split at the median of the longest side of the centres, so its
//! depth is the logarithm of the number of triangles and a fixed stack suffices. Best-first among siblings.

use crate::Aabb;

/// Triangles in a leaf, at most.
const LEAF: usize = 4;
/// Enough for 2^32 triangles.
const STACK: usize = 34;

#[derive(Clone, Debug)]
pub(crate) struct Node {
    pub bounds: Aabb,
    /// Of a leaf: its first triangle. Of an inner node: its second child; the first follows the node.
    first: u32,
    /// Number of triangles of a leaf, 0 for an inner node.
    count: u32,
}

#[derive(Clone, Debug)]
pub(crate) struct Bvh {
    nodes: Vec<Node>,
}

impl Bvh {
    /// The tree, and the order in which the triangles must be stored.
    pub fn new(boxes: &[Aabb]) -> (Self, Vec<usize>) {
        let mut order: Vec<usize> = (0..boxes.len()).collect();
        let mut tree = Self { nodes: Vec::new() };
        tree.build(boxes, &mut order, 0);
        (tree, order)
    }

    fn build(&mut self, boxes: &[Aabb], order: &mut [usize], first: usize) {
        let bounds = order[1..]
            .iter()
            .fold(boxes[order[0]], |sum, &i| sum.merged(&boxes[i]));
        let node = self.nodes.len();
        self.nodes.push(Node {
            bounds,
            first: first as u32,
            count: order.len() as u32,
        });
        if order.len() <= LEAF {
            return;
        }
        let centers: Vec<_> = order.iter().map(|&i| boxes[i].center()).collect();
        // At least one box, or there would be nothing to split.
        let Some(spread) = Aabb::of_points(&centers) else {
            return;
        };
        let side = spread.half_extents().imax();
        let middle = order.len() / 2;
        order.select_nth_unstable_by(middle, |&i, &j| {
            boxes[i].center()[side]
                .total_cmp(&boxes[j].center()[side])
                .then(i.cmp(&j))
        });
        let (left, right) = order.split_at_mut(middle);
        self.build(boxes, left, first);
        self.nodes[node].count = 0;
        self.nodes[node].first = self.nodes.len() as u32;
        self.build(boxes, right, first + middle);
    }

    pub fn bounds(&self) -> &Aabb {
        &self.nodes[0].bounds
    }

    /// Visits leaves, the nearer child first, as long as `bound` of their box is below the limit. `leaf` gets a range
    /// of triangles and the limit and returns the new limit.
    #[inline(always)]
    pub fn visit(
        &self,
        mut limit: f64,
        bound: impl Fn(&Aabb) -> f64,
        mut leaf: impl FnMut(std::ops::Range<usize>, f64) -> f64,
    ) -> f64 {
        let mut stack = [(0u32, 0f64); STACK];
        let mut depth = 0;
        let mut current = 0u32;
        if bound(&self.nodes[0].bounds) >= limit {
            return limit;
        }
        loop {
            let node = &self.nodes[current as usize];
            if node.count > 0 {
                let first = node.first as usize;
                limit = leaf(first..first + node.count as usize, limit);
            } else {
                let (left, right) = (current + 1, node.first);
                let near = bound(&self.nodes[left as usize].bounds);
                let far = bound(&self.nodes[right as usize].bounds);
                let ((near, low), (far, high)) = if near <= far {
                    ((left, near), (right, far))
                } else {
                    ((right, far), (left, near))
                };
                if high < limit {
                    stack[depth] = (far, high);
                    depth += 1;
                }
                if low < limit {
                    current = near;
                    continue;
                }
            }
            loop {
                if depth == 0 {
                    return limit;
                }
                depth -= 1;
                if stack[depth].1 < limit {
                    current = stack[depth].0;
                    break;
                }
            }
        }
    }
}
