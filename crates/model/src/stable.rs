//! Equilibria that are stable, as a validity test of planners.

use tensegra_atlas::{Obstruction, SparseRow, Validity};

use crate::{
    equilibrium::EquilibriumManifold,
    statics::{Actuation, Stability},
};

/// A validity test that also demands stability, at the end and in the middle of
/// each step.
#[derive(Clone, Debug)]
pub struct Stable<'a, M: ?Sized, V> {
    manifold: &'a M,
    stability: Stability<'a>,
    margin: Option<f64>,
    inner: V,
}

impl<'a, M: EquilibriumManifold + ?Sized, V: Validity> Stable<'a, M, V> {
    /// What `inner` accepts and all of whose stiffnesses exceed `margin` (force
    /// per length); without a margin all that `inner` accepts.
    pub fn new(manifold: &'a M, actuation: Actuation, margin: Option<f64>, inner: V) -> Self {
        Self {
            manifold,
            stability: Stability::new(manifold.structure(), actuation),
            margin,
            inner,
        }
    }

    /// The validity test inside.
    pub fn inner(&self) -> &V {
        &self.inner
    }

    /// The smallest stiffness of the equilibrium x and the margin demanded, where
    /// it does not exceed it.
    pub fn shortfall(&self, x: &[f64]) -> Option<(f64, f64)> {
        let configuration = self.manifold.configuration(x);
        let margin = self.margin?;
        if self.stability.exceeds(&configuration, margin) {
            return None;
        }
        let stiffness = self.stability.least_stiffness(&configuration);
        Some((stiffness.unwrap_or(f64::NAN), margin))
    }

    /// At the end of a step and in its middle.
    fn is_stable_step(&self, x: &[f64], between: &mut dyn FnMut(f64, &mut [f64]) -> bool) -> bool {
        if self.margin.is_none() {
            return true;
        }
        let mut middle = vec![0.0; x.len()];
        self.is_stable(x) && between(0.5, &mut middle) && self.is_stable(&middle)
    }

    fn is_stable(&self, x: &[f64]) -> bool {
        self.margin.is_none_or(|margin| {
            self.stability
                .exceeds(&self.manifold.configuration(x), margin)
        })
    }
}

impl<M: EquilibriumManifold + ?Sized, V: Validity> Validity for Stable<'_, M, V> {
    type Memory = V::Memory;

    fn memory(&self) -> Self::Memory {
        self.inner.memory()
    }

    fn enter(&self, x: &[f64], memory: &mut Self::Memory) {
        self.inner.enter(x, memory);
    }

    fn step(
        &self,
        from: &Self::Memory,
        x: &[f64],
        to: &mut Self::Memory,
        between: &mut dyn FnMut(f64, &mut [f64]) -> bool,
        violated: &mut Vec<usize>,
    ) -> Result<(), Obstruction> {
        self.inner.step(from, x, to, between, violated)?;
        if self.is_stable_step(x, between) {
            Ok(())
        } else {
            Err(Obstruction::Blocked)
        }
    }

    fn robust_step(
        &self,
        from: &Self::Memory,
        x: &[f64],
        to: &mut Self::Memory,
        between: &mut dyn FnMut(f64, &mut [f64]) -> bool,
    ) -> bool {
        self.inner.robust_step(from, x, to, between) && self.is_stable_step(x, between)
    }

    fn contact(&self, contact: usize, x: &[f64], row: &mut SparseRow) -> Option<f64> {
        self.inner.contact(contact, x, row)
    }

    fn displacement(&self, a: &[f64], b: &[f64]) -> f64 {
        self.inner.displacement(a, b)
    }

    fn is_valid(&self, x: &[f64]) -> bool {
        self.inner.is_valid(x) && self.is_stable(x)
    }
}
