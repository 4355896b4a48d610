//! The gradient of the control effort with respect to the points of a path.
//!
//! With the step Δ = xᵢ₊₁ − xᵢ and the tangential energy gradient g = P ∇E at xᵢ,
//! P being the projector onto the tangent space, a step contributes
//! |Δ| (1 + |g|²) − 2 Δ·g. The projector changes along a tangent vector v by
//! dP = −P dJᵀ J⁺ᵀ − J⁺ dJ P, so that, with H_λ = Σ λ ∇²F,
//!
//! ∇(w·P∇E) = ∇²E P w − H_μ P w − H_ν P ∇E,  μ = J⁺ᵀ∇E, ν = J⁺ᵀw.
//!
//! The equations are quadratic and so is E: products with their second
//! derivatives are differences of first derivatives, exact.
//!
//! Cost: a factorisation of the Jacobian a point.

use tensegra_atlas::{Chart, ImplicitManifold, Workspace, dimension};

use super::{DirectionsManifold, EffortError, distance, dot};

/// A point's chart and energy gradient, and the memory for products.
struct Place<'a> {
    manifold: &'a DirectionsManifold,
    x: &'a [f64],
    chart: Chart,
    energy: Vec<f64>,
    /// J⁺ᵀ∇E, one value for each equation.
    multipliers: Vec<f64>,
    /// P ∇E.
    drift: Vec<f64>,
}

impl<'a> Place<'a> {
    fn new(
        manifold: &'a DirectionsManifold,
        index: usize,
        x: &'a [f64],
        k: usize,
        work: &mut Workspace,
    ) -> Result<Self, EffortError> {
        let chart = Chart::new(manifold, x, k, work)
            .map_err(|source| EffortError::NoTangentSpace { index, source })?;
        let mut energy = vec![0.0; x.len()];
        manifold.potential_energy_gradient(x, &mut energy);
        let mut multipliers = vec![0.0; manifold.equation_count()];
        chart.multipliers(&energy, &mut multipliers);
        let drift = project(&chart, &energy);
        Ok(Self {
            manifold,
            x,
            chart,
            energy,
            multipliers,
            drift,
        })
    }

    /// Adds `scale` ∇(w·P∇E) to `sum`.
    fn add_drift_gradient(&self, w: &[f64], scale: f64, sum: &mut [f64]) {
        let along = project(&self.chart, w);
        let mut of_w = vec![0.0; self.multipliers.len()];
        self.chart.multipliers(w, &mut of_w);
        self.add_energy_curvature(&along, scale, sum);
        self.add_curvature(&self.multipliers, &along, -scale, sum);
        self.add_curvature(&of_w, &self.drift, -scale, sum);
    }

    /// Adds `scale` ∇²E u.
    fn add_energy_curvature(&self, u: &[f64], scale: f64, sum: &mut [f64]) {
        let moved: Vec<f64> = self.x.iter().zip(u).map(|(x, u)| x + u).collect();
        let mut gradient = vec![0.0; u.len()];
        self.manifold
            .potential_energy_gradient(&moved, &mut gradient);
        for ((sum, after), before) in sum.iter_mut().zip(&gradient).zip(&self.energy) {
            *sum += scale * (after - before);
        }
    }

    /// Adds `scale` Σ λ ∇²F u.
    fn add_curvature(&self, multipliers: &[f64], u: &[f64], scale: f64, sum: &mut [f64]) {
        let pattern = self.manifold.jacobian_pattern();
        let moved: Vec<f64> = self.x.iter().zip(u).map(|(x, u)| x + u).collect();
        let [mut before, mut after] = [vec![0.0; pattern.len()], vec![0.0; pattern.len()]];
        self.manifold.jacobian(self.x, &mut before);
        self.manifold.jacobian(&moved, &mut after);
        for (row, &multiplier) in multipliers.iter().enumerate() {
            for (slot, &column) in pattern.row_range(row).zip(pattern.row(row)) {
                sum[column] += scale * multiplier * (after[slot] - before[slot]);
            }
        }
    }
}

/// P w.
fn project(chart: &Chart, w: &[f64]) -> Vec<f64> {
    let mut along = vec![0.0; w.len()];
    for tangent in (0..chart.dimension()).map(|j| chart.tangent(j)) {
        let t = dot(tangent, w);
        for (a, v) in along.iter_mut().zip(tangent) {
            *a += t * v;
        }
    }
    along
}

impl DirectionsManifold {
    /// The gradient of the [control effort](Self::control_effort) with respect
    /// to every point of the path (m values each), within its tangent space.
    ///
    /// # Errors
    /// [`EffortError::NoTangentSpace`] at a singular point.
    pub fn control_effort_gradient<P: AsRef<[f64]>>(
        &self,
        points: &[P],
    ) -> Result<Vec<Vec<f64>>, EffortError> {
        let Some(first) = points.first() else {
            return Ok(Vec::new());
        };
        let k = dimension(self, first.as_ref());
        let mut work = Workspace::default();
        let places = points
            .iter()
            .enumerate()
            .map(|(index, x)| Place::new(self, index, x.as_ref(), k, &mut work))
            .collect::<Result<Vec<_>, _>>()?;
        let mut gradients = vec![vec![0.0; self.ambient_dimension()]; points.len()];
        for (index, place) in places.iter().enumerate() {
            let Some(next) = places.get(index + 1) else {
                break;
            };
            let step = distance(place.x, next.x);
            if step == 0.0 {
                continue;
            }
            let delta: Vec<f64> = next.x.iter().zip(place.x).map(|(b, a)| b - a).collect();
            let stretch = (1.0 + dot(&place.drift, &place.drift)) / step;
            for (i, (delta, drift)) in delta.iter().zip(&place.drift).enumerate() {
                let change = stretch * delta - 2.0 * drift;
                gradients[index + 1][i] += change;
                gradients[index][i] -= change;
            }
            let here = &mut gradients[index];
            place.add_drift_gradient(&place.energy, step, here);
            // |g|² = ∇E·P∇E depends on ∇E twice.
            place.add_energy_curvature(&place.drift, step, here);
            place.add_drift_gradient(&delta, -2.0, here);
        }
        for (place, gradient) in places.iter().zip(&mut gradients) {
            *gradient = project(&place.chart, gradient);
        }
        Ok(gradients)
    }
}
