//! Points packed four by four, for distances from one point to many.

use crate::qr::{LANES, vectorised};

/// Coordinates that are looked at first for whether points are near.
const HEAD: usize = 4;

/// A growing set of points of one dimension, stored so that the distances of four of
/// them from another point are computed at once.
///
/// Cost of a query: about one instruction for each coordinate of each point.
///
/// ```
/// use tensegra_atlas::PackedPoints;
/// let mut points = PackedPoints::new(2);
/// points.push(&[3.0, 4.0]);
/// points.push(&[1.0, 0.0]);
/// let mut distances = Vec::new();
/// points.squared_distances(&[0.0, 0.0], &mut distances);
/// assert_eq!(distances, [25.0, 1.0]);
/// ```
#[derive(Clone, Debug)]
pub struct PackedPoints {
    dimension: usize,
    len: usize,
    /// One coordinate of four points after the other; lanes without a point are infinite.
    blocks: Vec<[f64; LANES]>,
}

impl PackedPoints {
    /// No points yet, of the given dimension.
    pub fn new(dimension: usize) -> Self {
        Self {
            dimension,
            len: 0,
            blocks: Vec::new(),
        }
    }

    /// Number of coordinates of a point.
    pub fn dimension(&self) -> usize {
        self.dimension
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Adds a point; its index is the number of points before.
    pub fn push(&mut self, point: &[f64]) {
        debug_assert_eq!(point.len(), self.dimension);
        let lane = self.len % LANES;
        if lane == 0 {
            let blocks = self.blocks.len() + self.dimension;
            self.blocks.resize(blocks, [f64::INFINITY; LANES]);
        }
        let first = self.blocks.len() - self.dimension;
        for (block, &x) in self.blocks[first..].iter_mut().zip(point) {
            block[lane] = x;
        }
        self.len += 1;
    }

    /// Writes the squared distance of every point from x.
    pub fn squared_distances(&self, x: &[f64], distances: &mut Vec<f64>) {
        distances.clear();
        distances.resize(self.len.next_multiple_of(LANES), 0.0);
        let blocks = self.blocks.chunks_exact(self.dimension.max(1));
        vectorised(
            #[inline(always)]
            || {
                for (sums, block) in distances.as_chunks_mut::<LANES>().0.iter_mut().zip(blocks) {
                    let mut total = [0.0; LANES];
                    add_squares(&mut total, block, x);
                    *sums = total;
                }
            },
        );
        distances.truncate(self.len);
    }

    /// Writes the points closer to x than `reach`: index and squared distance.
    ///
    /// Points that are too far by their first few coordinates alone cost no more than
    /// those: for short reaches, a fraction of [`squared_distances`](Self::squared_distances).
    pub fn within(&self, x: &[f64], reach: f64, found: &mut Vec<(usize, f64)>) {
        found.clear();
        let square = reach * reach;
        let (head, tail) = x.split_at(HEAD.min(x.len()));
        let blocks = self.blocks.chunks_exact(self.dimension.max(1));
        vectorised(
            #[inline(always)]
            || {
                for (number, block) in blocks.enumerate() {
                    let (block_head, block_tail) = block.split_at(head.len());
                    let mut total = [0.0; LANES];
                    add_squares(&mut total, block_head, head);
                    if total.iter().all(|&sum| sum >= square) {
                        continue;
                    }
                    add_squares(&mut total, block_tail, tail);
                    for (lane, &sum) in total.iter().enumerate() {
                        if sum < square {
                            found.push((number * LANES + lane, sum));
                        }
                    }
                }
            },
        );
    }
}

/// Adds the squared differences of some coordinates, for each point of a block.
#[inline(always)]
fn add_squares(total: &mut [f64; LANES], block: &[[f64; LANES]], x: &[f64]) {
    for (coordinate, &x) in block.iter().zip(x) {
        for (sum, &y) in total.iter_mut().zip(coordinate) {
            *sum += (y - x) * (y - x);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_those_of_single_points() {
        let point = |i: usize| [i as f64, (i * i % 7) as f64, 0.5 - i as f64];
        let x = [1.5, 2.0, -3.0];
        let mut points = PackedPoints::new(3);
        let mut distances = Vec::new();
        for i in 0..11 {
            points.push(&point(i));
            points.squared_distances(&x, &mut distances);
            assert_eq!(distances.len(), points.len());
        }
        for (i, distance) in distances.into_iter().enumerate() {
            let square = crate::atlas::squared_distance(&point(i), &x);
            assert!((distance - square).abs() < 1e-12 * square);
        }
    }

    #[test]
    fn near_points_are_those_of_small_distance() {
        // More coordinates than are looked at first, and fewer.
        for dimension in [6, 2] {
            let point = |i: usize| -> Vec<f64> {
                (0..dimension)
                    .map(|j| ((i * 7 + j * 3) % 11) as f64)
                    .collect()
            };
            let mut points = PackedPoints::new(dimension);
            (0..10).for_each(|i| points.push(&point(i)));
            let x = point(3);
            let (mut distances, mut near) = (Vec::new(), Vec::new());
            points.squared_distances(&x, &mut distances);
            for reach in [0.5, 4.0, 7.0, f64::INFINITY] {
                points.within(&x, reach, &mut near);
                let distances = distances.iter().copied().enumerate();
                let expected: Vec<_> = distances.filter(|(_, d)| *d < reach * reach).collect();
                assert!(!expected.is_empty());
                assert_eq!(near, expected);
            }
        }
    }
}
