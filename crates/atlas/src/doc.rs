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
