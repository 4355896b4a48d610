//! Closest points of two segments, as parameters along them, with the derivatives of the squared
//! distance.
//!
//! The parameters are those of Ericson, "Real-time collision detection", section 5.1.9: the
//! minimum over the infinite lines, clamped to the segments. The squared distance is once
//! continuously differentiable in the end points wherever its minimiser is unique (away from
//! parallel, overlapping segments); by the envelope theorem its gradient is that at fixed
//! parameters. Cost: constant.

use nalgebra::{Matrix3, Vector3};

/// Where two segments p₁p₂ and q₁q₂ are closest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ClosestPoints {
    /// Parameter along the first segment, 0 at p₁ and 1 at p₂.
    pub s: f64,
    /// Parameter along the second segment.
    pub t: f64,
    /// From the point on the second segment to the point on the first.
    pub separation: Vector3<f64>,
}

/// Closest points of the segments p₁p₂ and q₁q₂, neither of length zero.
#[inline]
pub(crate) fn closest_points(
    p1: &Vector3<f64>,
    p2: &Vector3<f64>,
    q1: &Vector3<f64>,
    q2: &Vector3<f64>,
) -> ClosestPoints {
    let (d1, d2, r) = (p2 - p1, q2 - q1, p1 - q1);
    let (a, b, e) = (d1.norm_squared(), d1.dot(&d2), d2.norm_squared());
    let (c, f) = (d1.dot(&r), d2.dot(&r));
    let denominator = a * e - b * b;
    let mut s = if denominator > 1e-14 * a * e {
        ((b * f - c * e) / denominator).clamp(0.0, 1.0)
    } else {
        0.0
    };
    let mut t = (b * s + f) / e;
    if t < 0.0 {
        t = 0.0;
        s = (-c / a).clamp(0.0, 1.0);
    } else if t > 1.0 {
        t = 1.0;
        s = ((b - c) / a).clamp(0.0, 1.0);
    }
    ClosestPoints {
        s,
        t,
        separation: r + d1 * s - d2 * t,
    }
}

impl ClosestPoints {
    /// The distance D.
    #[inline]
    pub(crate) fn distance(&self) -> f64 {
        self.separation.norm()
    }

    /// Weight of each end point (p₁, p₂, q₁, q₂) in the separation: the gradient of ½D² with
    /// respect to an end point is its weight times the separation.
    #[inline]
    pub(crate) fn weights(&self) -> [f64; 4] {
        [1.0 - self.s, self.s, self.t - 1.0, -self.t]
    }

    /// Hessian of ½D² as a 4 × 4 array of 3 × 3 blocks over the end points.
    ///
    /// At fixed parameters it is wᵢwⱼ I; each parameter strictly inside its segment adds the
    /// rank-one (or, together, rank-two) reduction by the sensitivity of the closest points.
    pub(crate) fn half_squared_hessian(
        &self,
        p1: &Vector3<f64>,
        p2: &Vector3<f64>,
        q1: &Vector3<f64>,
        q2: &Vector3<f64>,
    ) -> [[Matrix3<f64>; 4]; 4] {
        let weights = self.weights();
        let mut blocks = [[Matrix3::zeros(); 4]; 4];
        for (row, wi) in blocks.iter_mut().zip(weights) {
            for (block, wj) in row.iter_mut().zip(weights) {
                *block = Matrix3::from_diagonal_element(wi * wj);
            }
        }
        let inside = |parameter: f64| parameter > 0.0 && parameter < 1.0;
        let (d1, d2) = (p2 - p1, q2 - q1);
        // ∂(½D²)/∂s = n·d₁ and ∂(½D²)/∂t = −n·d₂; their derivatives by the end points:
        let n = self.separation;
        let by_s: [Vector3<f64>; 4] = [
            d1 * weights[0] - n,
            d1 * weights[1] + n,
            d1 * weights[2],
            d1 * weights[3],
        ];
        let by_t: [Vector3<f64>; 4] = [
            -d2 * weights[0],
            -d2 * weights[1],
            -d2 * weights[2] + n,
            -d2 * weights[3] - n,
        ];
        let (a, b, e) = (d1.norm_squared(), d1.dot(&d2), d2.norm_squared());
        // Inverse of the Hessian [[a, −b], [−b, e]] in the parameters that are free.
        let (ss, st, tt) = match (inside(self.s), inside(self.t)) {
            (true, true) => {
                let determinant = a * e - b * b;
                if determinant <= 1e-10 * a * e {
                    return blocks;
                }
                (e / determinant, b / determinant, a / determinant)
            }
            (true, false) => (1.0 / a, 0.0, 0.0),
            (false, true) => (0.0, 0.0, 1.0 / e),
            (false, false) => return blocks,
        };
        for (i, row) in blocks.iter_mut().enumerate() {
            for (j, block) in row.iter_mut().enumerate() {
                *block -= by_s[i] * (by_s[j] * ss + by_t[j] * st).transpose()
                    + by_t[i] * (by_s[j] * st + by_t[j] * tt).transpose();
            }
        }
        blocks
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    use super::*;

    fn at(points: &[Vector3<f64>; 4]) -> ClosestPoints {
        closest_points(&points[0], &points[1], &points[2], &points[3])
    }

    fn random_points(rng: &mut Pcg64) -> [Vector3<f64>; 4] {
        std::array::from_fn(|_| Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0)))
    }

    #[test]
    fn no_sampled_pair_of_points_is_closer() {
        let mut rng = Pcg64::seed_from_u64(11);
        for _ in 0..200 {
            let points = random_points(&mut rng);
            let distance = at(&points).distance();
            for i in 0..=20 {
                for j in 0..=20 {
                    let (s, t) = (f64::from(i) / 20.0, f64::from(j) / 20.0);
                    let p = points[0].lerp(&points[1], s);
                    let q = points[2].lerp(&points[3], t);
                    assert!((p - q).norm() >= distance - 1e-12);
                }
            }
        }
    }

    #[test]
    fn parallel_and_crossing_segments() {
        let v = Vector3::new;
        let parallel = [
            v(0., 0., 0.),
            v(1., 0., 0.),
            v(0.5, 0.2, 0.),
            v(3., 0.2, 0.),
        ];
        assert!((at(&parallel).distance() - 0.2).abs() < 1e-15);
        let crossing = [v(-1., 0., 0.), v(1., 0., 0.), v(0., -1., 0.), v(0., 1., 0.)];
        assert_eq!(at(&crossing).distance(), 0.0);
        let apart = [v(0., 0., 0.), v(1., 0., 0.), v(3., 0., 0.), v(4., 0., 0.)];
        assert_eq!(at(&apart).distance(), 2.0);
    }

    #[test]
    fn derivatives_agree_with_differences() {
        let mut rng = Pcg64::seed_from_u64(12);
        let step = 1e-5;
        for _ in 0..100 {
            let points = random_points(&mut rng);
            let here = at(&points);
            // Away from the seams between clamped and free parameters.
            if [here.s, here.t]
                .iter()
                .any(|p| (*p - 0.5).abs() > 0.49 && (*p - 0.5).abs() < 0.5)
            {
                continue;
            }
            let hessian = here.half_squared_hessian(&points[0], &points[1], &points[2], &points[3]);
            for node in 0..4 {
                for axis in 0..3 {
                    let shifted = |by: f64| {
                        let mut moved = points;
                        moved[node][axis] += by;
                        at(&moved)
                    };
                    let (ahead, behind) = (shifted(step), shifted(-step));
                    let half = |c: &ClosestPoints| 0.5 * c.separation.norm_squared();
                    let slope = (half(&ahead) - half(&behind)) / (2.0 * step);
                    let exact = here.weights()[node] * here.separation[axis];
                    assert!((slope - exact).abs() < 1e-8);
                    for other in 0..4 {
                        let gradient = |c: &ClosestPoints| c.separation * c.weights()[other];
                        let column = (gradient(&ahead) - gradient(&behind)) / (2.0 * step);
                        let exact: Vector3<f64> = hessian[other][node].column(axis).into();
                        assert!((column - exact).norm() < 1e-4 * (1.0 + exact.norm()));
                    }
                }
            }
        }
    }
}
