//! Manifolds with closed forms, for examples and tests.

use crate::manifold::{ImplicitManifold, SparsityPattern};

/// The unit sphere in space, as the one equation (|x|² − 1)/2 = 0.
#[derive(Clone, Debug)]
pub struct Sphere {
    pattern: SparsityPattern,
}

impl Sphere {
    /// The unit sphere about the origin.
    pub fn new() -> Self {
        Self {
            pattern: SparsityPattern::dense(1, 3),
        }
    }
}

impl Default for Sphere {
    fn default() -> Self {
        Self::new()
    }
}

impl ImplicitManifold for Sphere {
    fn ambient_dimension(&self) -> usize {
        3
    }

    fn equation_count(&self) -> usize {
        1
    }

    fn residual(&self, x: &[f64], residual: &mut [f64]) {
        residual[0] = 0.5 * (x.iter().map(|x| x * x).sum::<f64>() - 1.0);
    }

    fn jacobian_pattern(&self) -> &SparsityPattern {
        &self.pattern
    }

    fn jacobian(&self, x: &[f64], values: &mut [f64]) {
        values.copy_from_slice(x);
    }

    fn lower_bounds(&self) -> &[f64] {
        &[-2.0; 3]
    }

    fn upper_bounds(&self) -> &[f64] {
        &[2.0; 3]
    }
}

/// A torus about the z axis, as the one equation
/// (√(x² + y²) − R)² + z² − r² = 0, divided by 2r.
#[derive(Clone, Debug)]
pub struct Torus {
    pattern: SparsityPattern,
    ring: f64,
    tube: f64,
}

impl Torus {
    /// The torus with radius R of the circle in the middle of its tube and radius
    /// r < R of the tube. Its area is 4π² R r.
    pub fn new(ring: f64, tube: f64) -> Self {
        Self {
            pattern: SparsityPattern::dense(1, 3),
            ring,
            tube,
        }
    }

    /// The point at the angles `around` the axis and `across` the tube.
    pub fn point(&self, around: f64, across: f64) -> [f64; 3] {
        let out = self.ring + self.tube * across.cos();
        [
            out * around.cos(),
            out * around.sin(),
            self.tube * across.sin(),
        ]
    }
}

impl ImplicitManifold for Torus {
    fn ambient_dimension(&self) -> usize {
        3
    }

    fn equation_count(&self) -> usize {
        1
    }

    fn residual(&self, x: &[f64], residual: &mut [f64]) {
        let out = x[0].hypot(x[1]) - self.ring;
        residual[0] = (out * out + x[2] * x[2] - self.tube * self.tube) / (2.0 * self.tube);
    }

    fn jacobian_pattern(&self) -> &SparsityPattern {
        &self.pattern
    }

    fn jacobian(&self, x: &[f64], values: &mut [f64]) {
        let radius = x[0].hypot(x[1]);
        let slope = (radius - self.ring) / (radius * self.tube);
        values.copy_from_slice(&[slope * x[0], slope * x[1], x[2] / self.tube]);
    }

    fn lower_bounds(&self) -> &[f64] {
        &[f64::NEG_INFINITY; 3]
    }

    fn upper_bounds(&self) -> &[f64] {
        &[f64::INFINITY; 3]
    }
}

/// Another manifold with all of its equations stated twice, the second time
/// multiplied by −3: redundant and consistent.
#[derive(Clone, Debug)]
pub struct Twice<M> {
    manifold: M,
    pattern: SparsityPattern,
}

impl<M: ImplicitManifold> Twice<M> {
    /// The manifold with its equations stated twice.
    pub fn new(manifold: M) -> Self {
        let once = manifold.jacobian_pattern();
        let rows: Vec<Vec<usize>> = (0..once.rows()).map(|i| once.row(i).to_vec()).collect();
        Self {
            pattern: SparsityPattern::from_rows(once.columns(), &[rows.clone(), rows].concat()),
            manifold,
        }
    }
}

impl<M: ImplicitManifold> ImplicitManifold for Twice<M> {
    fn ambient_dimension(&self) -> usize {
        self.manifold.ambient_dimension()
    }

    fn equation_count(&self) -> usize {
        2 * self.manifold.equation_count()
    }

    fn residual(&self, x: &[f64], residual: &mut [f64]) {
        let (once, again) = residual.split_at_mut(self.manifold.equation_count());
        self.manifold.residual(x, once);
        again.iter_mut().zip(once).for_each(|(a, o)| *a = -3.0 * *o);
    }

    fn jacobian_pattern(&self) -> &SparsityPattern {
        &self.pattern
    }

    fn jacobian(&self, x: &[f64], values: &mut [f64]) {
        let (once, again) = values.split_at_mut(self.manifold.jacobian_pattern().len());
        self.manifold.jacobian(x, once);
        again.iter_mut().zip(once).for_each(|(a, o)| *a = -3.0 * *o);
    }

    fn lower_bounds(&self) -> &[f64] {
        self.manifold.lower_bounds()
    }

    fn upper_bounds(&self) -> &[f64] {
        self.manifold.upper_bounds()
    }
}
