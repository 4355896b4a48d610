//! Newton's method for the energy under constant lengths.
//!
//! The step d solves
//! ```text
//! min ½ dᵀ (H + σ I) d + gᵀ d   subject to   J d = −c,
//! ```
//! H being the Hessian of the Lagrangian with least-squares multipliers. What it
//! is factorised with, A = H + σ I + ω (Q Qᵀ + Jᵀ J), changes no step: Q spans the
//! neutral motions, in which the gradient does nothing, and J d is prescribed. If
//! A has a Cholesky factor the step leads to a minimum; else σ grows.

use nalgebra::{Cholesky, DMatrix, DVector};

use super::{DirectOptions, energy::Energy};

/// Longest step of a coordinate, relative to the size of the structure.
const LONGEST_STEP: f64 = 0.25;
/// A structure this many times as large as it was is flying apart.
const FAR: f64 = 50.0;
/// Forces below this multiple of stiffness times length are rounding.
const ROUNDING: f64 = 1e-13;
/// Energies that differ by less, relative to their size, are equal.
const ENERGY_ROUNDING: f64 = 1e-14;
/// Weight ω, relative to the largest entry of the Hessian.
const WEIGHT: f64 = 10.0;
/// First σ, and the σ below which it is 0, relative to the same.
const FIRST_SHIFT: f64 = 1e-3;
const NO_SHIFT: f64 = 1e-8;
/// Largest σ: the step is then shorter than rounding.
const LARGEST_SHIFT: f64 = 1e12;
/// How far a saddle is left, relative to the size.
const ESCAPE: f64 = 1e-2;
/// Constraints with a smaller square, relative to the largest, depend on others.
const DEPENDENT: f64 = 1e-10;

/// What counts as converged.
#[derive(Clone, Copy)]
pub(super) struct Allowed {
    pub(super) force: f64,
    pub(super) length: f64,
}

pub(super) enum Failure {
    Unbounded,
    NotConverged { iterations: usize, allowed: Allowed },
}

/// Eigenvalues of the Hessian on the motions that are free.
pub(super) struct Curvature {
    pub(super) least: Option<f64>,
    pub(super) largest: f64,
}

/// Memory of the method.
pub(super) struct Newton {
    x: DVector<f64>,
    step: DVector<f64>,
    gradient: DVector<f64>,
    /// Gradient of the Lagrangian.
    lagrangian: DVector<f64>,
    hessian: DMatrix<f64>,
    factor: DMatrix<f64>,
    constraints: DVector<f64>,
    multipliers: DVector<f64>,
    jacobian: DMatrix<f64>,
}

impl Newton {
    pub(super) fn new(n: usize, constraints: usize) -> Self {
        Self {
            x: DVector::zeros(n),
            step: DVector::zeros(n),
            gradient: DVector::zeros(n),
            lagrangian: DVector::zeros(n),
            hessian: DMatrix::zeros(n, n),
            factor: DMatrix::zeros(n, n),
            constraints: DVector::zeros(constraints),
            multipliers: DVector::zeros(constraints),
            jacobian: DMatrix::zeros(n, constraints),
        }
    }

    /// Goes from where the energy stands to a point where nothing is unbalanced;
    /// the number of iterations.
    pub(super) fn minimise(
        &mut self,
        energy: &mut Energy,
        neutral: &DMatrix<f64>,
        options: &DirectOptions,
    ) -> Result<usize, Failure> {
        let size = energy.size();
        let mut shift = 0.0;
        let mut penalty = 0.0_f64;
        energy.read(&mut self.x);
        let mut value = self.evaluate(energy);
        let mut iterations = 0;
        loop {
            let force_scale = energy.force_scale().max(self.multipliers.amax());
            let allowed = Allowed {
                force: options.tolerance * force_scale + ROUNDING * energy.rounding_force(),
                length: ROUNDING * size,
            };
            let (force_error, length_error) = (self.lagrangian.amax(), self.constraints.amax());
            if force_error <= allowed.force && length_error <= allowed.length {
                return Ok(iterations);
            }
            let not_converged = Failure::NotConverged {
                iterations,
                allowed,
            };
            if iterations >= options.max_iterations || !value.is_finite() {
                return Err(not_converged);
            }
            if energy.size() > FAR * size {
                return Err(Failure::Unbounded);
            }
            iterations += 1;
            energy.hessian(&self.multipliers, &mut self.hessian);
            let stiffness = self.hessian.diagonal().amax().max(f64::MIN_POSITIVE);
            penalty = penalty.max(2.0 * self.multipliers.amax());
            let merit = value + penalty * self.constraints.lp_norm(1);
            let error = force_error / allowed.force + length_error / allowed.length;
            loop {
                if shift > LARGEST_SHIFT * stiffness {
                    return Err(not_converged);
                }
                if !self.solve(neutral, shift, WEIGHT * stiffness) {
                    shift = (4.0 * shift).max(FIRST_SHIFT * stiffness);
                    continue;
                }
                let scale = (LONGEST_STEP * size / self.step.amax()).min(1.0);
                let predicted = self.predicted_reduction(scale, penalty);
                energy.write(&self.x, &self.step, scale);
                let new_value = self.evaluate(energy);
                let reduction = merit - new_value - penalty * self.constraints.lp_norm(1);
                let new_error = self.lagrangian.amax() / allowed.force
                    + self.constraints.amax() / allowed.length;
                // Close to the end energies differ by rounding, and constraints curve:
                // there the equations are what counts.
                let noise = ENERGY_ROUNDING * (value.abs() + force_scale * size);
                let close = (shift == 0.0 && scale == 1.0 && new_error <= 0.5 * error)
                    || (predicted <= noise && new_error < error);
                if close || (predicted > 0.0 && reduction >= 1e-4 * predicted) {
                    if close || reduction >= 0.5 * predicted {
                        shift /= 8.0;
                        if shift < NO_SHIFT * stiffness {
                            shift = 0.0;
                        }
                    } else if reduction < 0.1 * predicted {
                        shift = (2.0 * shift).max(FIRST_SHIFT * stiffness);
                    }
                    energy.read(&mut self.x);
                    value = new_value;
                    break;
                }
                shift = (4.0 * shift).max(FIRST_SHIFT * stiffness);
                energy.write(&self.x, &self.step, 0.0);
                self.evaluate(energy);
            }
        }
    }

    /// Gradients, constraints and multipliers where the energy stands.
    fn evaluate(&mut self, energy: &mut Energy) -> f64 {
        let value = energy.gradient(&mut self.gradient);
        self.lagrangian.copy_from(&self.gradient);
        if !self.constraints.is_empty() {
            energy.constraints(&mut self.constraints);
            energy.jacobian(&mut self.jacobian);
            let (inverse, _) = pseudo_inverse(self.jacobian.tr_mul(&self.jacobian));
            self.multipliers = -(inverse * self.jacobian.tr_mul(&self.gradient));
            self.lagrangian
                .gemv(1.0, &self.jacobian, &self.multipliers, 1.0);
        }
        value
    }

    /// The step; false where the shifted Hessian is not positive definite.
    fn solve(&mut self, neutral: &DMatrix<f64>, shift: f64, weight: f64) -> bool {
        let n = self.x.len();
        let mut matrix = std::mem::take(&mut self.factor);
        if matrix.nrows() != n {
            matrix = DMatrix::zeros(n, n);
        }
        matrix.copy_from(&self.hessian);
        for stiffened in neutral.column_iter().chain(self.jacobian.column_iter()) {
            for j in 0..n {
                let scaled = weight * stiffened[j];
                if scaled != 0.0 {
                    for i in j..n {
                        matrix[(i, j)] += scaled * stiffened[i];
                    }
                }
            }
        }
        for i in 0..n {
            matrix[(i, i)] += shift;
        }
        let Some(cholesky) = Cholesky::new(matrix) else {
            return false;
        };
        self.step.copy_from(&self.lagrangian);
        cholesky.solve_mut(&mut self.step);
        if !self.constraints.is_empty() {
            // J A⁻¹ Jᵀ ν = c − J A⁻¹ g, then d = −A⁻¹ (g + Jᵀ ν).
            let compliant = cholesky.solve(&self.jacobian);
            let (inverse, _) = pseudo_inverse(self.jacobian.tr_mul(&compliant));
            let right = &self.constraints - self.jacobian.tr_mul(&self.step);
            self.step.gemv(1.0, &compliant, &(inverse * right), 1.0);
        }
        self.step.neg_mut();
        self.factor = cholesky.unpack_dirty();
        self.step.iter().all(|value| value.is_finite())
    }

    /// How much smaller the energy plus the penalised violation of the constraints
    /// should become.
    fn predicted_reduction(&self, scale: f64, penalty: f64) -> f64 {
        let n = self.step.len();
        let mut bent = 0.0;
        for j in 0..n {
            let mut sum = 0.5 * self.hessian[(j, j)] * self.step[j];
            for i in j + 1..n {
                sum += self.hessian[(i, j)] * self.step[i];
            }
            bent += 2.0 * sum * self.step[j];
        }
        let slope = self.gradient.dot(&self.step);
        -scale * (slope + 0.5 * scale * bent) + penalty * scale * self.constraints.lp_norm(1)
    }

    /// The curvature of the energy where it stands, on the motions that keep the
    /// constant lengths and are orthogonal to the neutral ones.
    pub(super) fn curvature(&mut self, energy: &mut Energy, neutral: &DMatrix<f64>) -> Curvature {
        self.evaluate(energy);
        let (projected, excluded) = self.projected_hessian(energy, neutral);
        let n = projected.nrows();
        if excluded >= n {
            return Curvature {
                least: None,
                largest: 0.0,
            };
        }
        let mut values = projected.symmetric_eigenvalues().as_slice().to_vec();
        values.sort_by(f64::total_cmp);
        Curvature {
            least: Some(values[0]),
            largest: values[n - excluded - 1],
        }
    }

    /// Leaves a saddle along the direction of least curvature, to the side on which
    /// the energy is lower.
    pub(super) fn escape(&mut self, energy: &mut Energy, neutral: &DMatrix<f64>) {
        let (projected, _) = self.projected_hessian(energy, neutral);
        let eigen = projected.symmetric_eigen();
        let direction = eigen
            .eigenvectors
            .column(eigen.eigenvalues.imin())
            .into_owned();
        energy.read(&mut self.x);
        let far = ESCAPE * energy.size() / direction.amax();
        energy.write(&self.x, &direction, far);
        let one = energy.value();
        energy.write(&self.x, &direction, -far);
        if one <= energy.value() {
            energy.write(&self.x, &direction, far);
        }
    }

    /// The Hessian where excluded motions are made the stiffest, and how many
    /// these are.
    fn projected_hessian(
        &mut self,
        energy: &Energy,
        neutral: &DMatrix<f64>,
    ) -> (DMatrix<f64>, usize) {
        energy.hessian(&self.multipliers, &mut self.hessian);
        self.hessian.fill_upper_triangle_with_lower_triangle();
        // Neutral motions keep all lengths: they are orthogonal to the constraints.
        let mut excluded = neutral * neutral.transpose();
        let mut count = neutral.ncols();
        if !self.constraints.is_empty() {
            energy.jacobian(&mut self.jacobian);
            let (inverse, rank) = pseudo_inverse(self.jacobian.tr_mul(&self.jacobian));
            excluded += &self.jacobian * inverse * self.jacobian.transpose();
            count += rank;
        }
        // P H P with P = I − B Bᵀ, plus a multiple of B Bᵀ above every eigenvalue.
        let image = &self.hessian * &excluded;
        let both = &excluded * &image;
        let above = 2.0 * self.hessian.norm() + f64::MIN_POSITIVE;
        let projected = &self.hessian - &image - image.transpose() + both + excluded * above;
        (projected, count)
    }
}

/// The pseudo-inverse of a small positive semidefinite matrix, and its rank.
fn pseudo_inverse(matrix: DMatrix<f64>) -> (DMatrix<f64>, usize) {
    let n = matrix.nrows();
    let eigen = matrix.symmetric_eigen();
    let largest = eigen.eigenvalues.amax();
    let mut inverse = DMatrix::zeros(n, n);
    let mut rank = 0;
    for (vector, &value) in eigen
        .eigenvectors
        .column_iter()
        .zip(eigen.eigenvalues.iter())
    {
        if value > DEPENDENT * largest {
            inverse.ger(1.0 / value, &vector, &vector, 1.0);
            rank += 1;
        }
    }
    (inverse, rank)
}
