//! Equilibria that are stable, as a validity test of planners.

use tensegra_atlas::{Contacts, Obstruction, SparseRow, Validity};

use crate::{
    equilibrium::EquilibriumManifold,
    statics::{Actuation, Stability, force_densities},
};

/// Step of the differences that give the gradient of the smallest stiffness.
const DIFFERENCE: f64 = 1e-6;
/// Index of stability among the contacts of [`Stable`].
const STABILITY: usize = usize::MAX;

/// A validity test that also demands stability, at the end and in the middle of
/// each step.
#[derive(Clone, Debug)]
pub struct Stable<'a, M: ?Sized, V> {
    manifold: &'a M,
    stability: Stability<'a>,
    margin: Option<f64>,
    /// Change of the smallest stiffness for a unit step, about.
    scale: f64,
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
            scale: 1.0,
            inner,
        }
    }

    /// Takes the scale of stability as a contact, see [`Validity::contacts`], from
    /// the slope of the smallest stiffness at the equilibrium x: a typical one.
    pub fn scaled_at(mut self, x: &[f64]) -> Self {
        let mut gradient = SparseRow::default();
        if self.margin.is_some() && self.softest(x, f64::INFINITY, &mut gradient).is_some() {
            let slope = gradient.entries().iter().map(|(_, g)| g * g).sum::<f64>();
            if slope > 0.0 && slope.is_finite() {
                self.scale = slope.sqrt();
            }
        }
        self
    }

    /// The smallest stiffness at the equilibrium x, and its gradient where it is
    /// below `reach`; `None` where nothing can move. Cost: the eigenvalues, and two
    /// configurations for each variable.
    fn softest(&self, x: &[f64], reach: f64, gradient: &mut SparseRow) -> Option<f64> {
        let configuration = self.manifold.configuration(x);
        let densities = force_densities(&configuration);
        let softest = self
            .stability
            .softest(&configuration.positions, &densities)?;
        if !(softest.eigenvalue < reach) {
            return Some(softest.eigenvalue);
        }
        let elements = &self.manifold.structure().elements;
        let mut moved = x.to_vec();
        for i in 0..x.len() {
            let mut at = |step: f64| {
                moved[i] = x[i] + step;
                let configuration = self.manifold.configuration(&moved);
                let vector =
                    |[a, b]: [usize; 2]| configuration.positions[b] - configuration.positions[a];
                let by_element = softest.by_vector.iter().zip(elements);
                let by_tie = softest.by_tie.iter();
                let by_density = softest.by_density.iter();
                by_element
                    .map(|(g, element)| g.dot(&vector(element.nodes)))
                    .chain(by_tie.map(|(nodes, g)| g.dot(&vector(*nodes))))
                    .chain(
                        by_density
                            .zip(force_densities(&configuration))
                            .map(|(g, q)| g * q),
                    )
                    .sum::<f64>()
            };
            let change = at(DIFFERENCE) - at(-DIFFERENCE);
            moved[i] = x[i];
            gradient.add(i, change / (2.0 * DIFFERENCE));
        }
        Some(softest.eigenvalue)
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

fn blocked_unless(stable: bool) -> Result<(), Obstruction> {
    stable.then_some(()).ok_or(Obstruction::Blocked)
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
        blocked_unless(self.is_stable_step(x, between))
    }

    fn tree_step(
        &self,
        from: &Self::Memory,
        x: &[f64],
        to: &mut Self::Memory,
        between: &mut dyn FnMut(f64, &mut [f64]) -> bool,
        violated: &mut Vec<usize>,
    ) -> Result<(), Obstruction> {
        self.inner.tree_step(from, x, to, between, violated)?;
        blocked_unless(self.is_stable(x))
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

    fn contact(
        &self,
        contact: usize,
        x: &[f64],
        memory: &mut Self::Memory,
        row: &mut SparseRow,
    ) -> Option<f64> {
        self.inner.contact(contact, x, memory, row)
    }

    /// Those inside, and stability as one more: what the smallest stiffness has
    /// above the margin, over its scale.
    fn contacts(&self, x: &[f64], memory: &mut Self::Memory, reach: f64, found: &mut Contacts) {
        self.inner.contacts(x, memory, reach, found);
        let Some(margin) = self.margin else {
            return;
        };
        let mut row = SparseRow::default();
        let farthest = margin + reach * self.scale;
        if let Some(least) = self.softest(x, farthest, &mut row)
            && least < farthest
        {
            let mut scaled = SparseRow::default();
            for &(variable, g) in row.entries() {
                scaled.add(variable, g / self.scale);
            }
            found.push(STABILITY, (least - margin) / self.scale, &scaled);
        }
    }

    fn is_clear(
        &self,
        a: &[f64],
        b: &[f64],
        between: &mut dyn FnMut(f64, &mut [f64]) -> bool,
    ) -> bool {
        self.inner.is_clear(a, b, between) && self.is_stable_step(b, between)
    }

    fn displacement(&self, a: &[f64], b: &[f64]) -> f64 {
        self.inner.displacement(a, b)
    }

    fn is_valid(&self, x: &[f64]) -> bool {
        self.inner.is_valid(x) && self.is_stable(x)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;
    use tensegra_atlas::Everywhere;

    use super::*;
    use crate::{StructureBuilder, configuration::Configuration, equilibrium::DirectionsManifold};

    /// A node on two springs between two supports, the line of which is off the
    /// line of the forces: the stiffness changes in every direction.
    #[test]
    fn the_gradient_of_stability_agrees_with_differences_along_the_manifold() {
        let structure = StructureBuilder::planar()
            .cable("left", ["a", "b"], 0.0..=9.0, 3.0, 0.0..=2.0)
            .cable("right", ["b", "c"], 0.0..=9.0, 2.0, 0.0..=2.0)
            .cable("up", ["b", "d"], 0.0..=9.0, 4.0, 0.0..=9.0)
            .support("a")
            .support("c")
            .support("d")
            .build()
            .unwrap();
        let positions = [
            Point3::origin(),
            Point3::new(1.0, -0.2, 0.0),
            Point3::new(2.0, 0.1, 0.0),
            Point3::new(1.1, -1.5, 0.0),
        ];
        let lengths: Vec<f64> = [0, 2, 3]
            .map(|i| (positions[i] - positions[1]).norm())
            .to_vec();
        // Tensions that are in balance only after projection.
        let configuration = Configuration {
            positions: positions.to_vec(),
            rest_lengths: lengths.iter().map(|length| Some(0.8 * length)).collect(),
            forces: vec![None; 3],
            lengths,
        };
        let manifold = DirectionsManifold::new(&structure).unwrap();
        let mut x = manifold.coordinates(&configuration);
        tensegra_atlas::project(&manifold, &mut x, 1e-13, 50).unwrap();
        let stable = Stable::new(&manifold, Actuation::Length, Some(0.0), Everywhere);
        let mut found = Contacts::default();
        stable.contacts(&x, &mut (), 1e3, &mut found);
        let row = found.iter().next().unwrap();
        let value = |x: &[f64]| {
            let mut found = Contacts::default();
            stable.contacts(x, &mut (), 1e3, &mut found);
            found.iter().next().unwrap().value
        };
        let k = tensegra_atlas::dimension(&manifold, &x);
        let chart = tensegra_atlas::Chart::new(&manifold, &x, k, &mut Default::default()).unwrap();
        assert!(k > 0);
        for j in 0..k {
            let along: f64 = row
                .gradient
                .iter()
                .map(|&(i, g)| g * chart.tangent(j)[i])
                .sum();
            let at = |step: f64| {
                let mut y = x.clone();
                let mut t = vec![0.0; k];
                t[j] = step;
                chart
                    .exp(&manifold, &t, &mut y, 1e-13, &mut Default::default())
                    .unwrap();
                value(&y)
            };
            let difference = (at(1e-4) - at(-1e-4)) / 2e-4;
            assert!(
                (along - difference).abs() < 1e-6,
                "{j}: {along} {difference}"
            );
        }
    }
}
