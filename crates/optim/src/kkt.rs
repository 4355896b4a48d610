//! Optimality and feasibility of a point, measured from the problem's functions alone.
//!
//! The measures use nothing of a solver but the point and the multipliers that it returns.

use crate::{Nlp, ProblemError};

/// Residuals of the first-order (Karush–Kuhn–Tucker) conditions of a constrained problem.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct KktResiduals {
    /// Largest violation of a constraint or variable bound, in its own units.
    pub infeasibility: f64,
    /// ‖∇f + Jᵀλ + z‖∞.
    pub stationarity: f64,
    /// `stationarity` divided by the largest of the terms that cancel in it, ‖∇f‖∞ and
    /// max |λᵢ|‖∇cᵢ‖∞.
    pub relative_stationarity: f64,
    /// Largest product of a multiplier and the distance of its constraint from the bound that
    /// the multiplier's sign stands for (a multiplier for an absent bound counts whole).
    pub complementarity: f64,
}

impl KktResiduals {
    /// Measures the point `x` of `problem` with the given multipliers of the constraints. The
    /// multipliers of the variables' bounds are those that make the stationarity residual
    /// smallest: free in sign where x lies within 1e-8 (relative to 1 + |x|) of the bound,
    /// zero elsewhere.
    ///
    /// # Errors
    /// `x` or `multipliers` of the wrong length, or a pattern that leaves its matrix.
    pub fn measure<P: Nlp>(
        problem: &mut P,
        x: &[f64],
        multipliers: &[f64],
    ) -> Result<Self, ProblemError> {
        let n = problem.num_variables();
        let m = problem.num_constraints();
        crate::problem::check_length("the point", n, x.len())?;
        crate::problem::check_length("the vector of multipliers", m, multipliers.len())?;
        let mut lower = vec![f64::NEG_INFINITY; n.max(m)];
        let mut upper = vec![f64::INFINITY; n.max(m)];
        let mut residuals = Self::default();

        let mut values = vec![0.0; m];
        problem.constraint_bounds(&mut lower[..m], &mut upper[..m]);
        problem.constraints(x, &mut values);
        for i in 0..m {
            residuals.include(values[i], lower[i], upper[i], multipliers[i]);
        }

        let pattern = problem.jacobian_pattern();
        crate::problem::check_pattern("Jacobian", &pattern, m, n)?;
        let mut gradient = vec![0.0; n];
        problem.gradient(x, &mut gradient);
        let mut size = gradient.iter().fold(0.0_f64, |a, g| a.max(g.abs()));
        let mut entries = vec![0.0; pattern.len()];
        problem.jacobian(x, &mut entries);
        for ((row, column), entry) in pattern.iter().zip(&entries) {
            let term = multipliers[row] * entry;
            gradient[column] += term;
            size = size.max(term.abs());
        }

        lower.fill(f64::NEG_INFINITY);
        upper.fill(f64::INFINITY);
        problem.variable_bounds(&mut lower[..n], &mut upper[..n]);
        for j in 0..n {
            residuals.include(x[j], lower[j], upper[j], 0.0);
            let near = 1e-8 * (1.0 + x[j].abs());
            let residual = gradient[j];
            let held = (residual > 0.0 && x[j] <= lower[j] + near)
                || (residual < 0.0 && x[j] >= upper[j] - near);
            if !held {
                residuals.stationarity = residuals.stationarity.max(residual.abs());
            }
        }
        if size > 0.0 {
            residuals.relative_stationarity = residuals.stationarity / size;
        }
        Ok(residuals)
    }

    /// Takes one constraint `lower` ≤ `value` ≤ `upper` into the measures.
    pub(crate) fn include(&mut self, value: f64, lower: f64, upper: f64, multiplier: f64) {
        let violation = (lower - value).max(value - upper).max(0.0);
        self.infeasibility = self.infeasibility.max(violation);
        if multiplier != 0.0 {
            let distance = if multiplier > 0.0 {
                upper - value
            } else {
                value - lower
            };
            let distance = if distance.is_finite() {
                distance.abs()
            } else {
                1.0
            };
            self.complementarity = self.complementarity.max(multiplier.abs() * distance);
        }
    }
}
