//! The problem as an SQP iteration sees it: free variables only, scaled, linearised.
//!
//! Fixed variables are eliminated. With the variables' scales S and the rows' scales R, the
//! iteration works in d̂ = S⁻¹d and ĉ = R c, so that gradient, Jacobian and Hessian become Sg, RJS
//! and SHS, and the trust region is the same in every direction.

use crate::error::BoundKind;
use crate::problem::{check_bounds, check_length, check_pattern};
use crate::vector::{largest, refill};
use crate::{Hessian, Nlp, ProblemError, TripletPattern};

/// Triplets that fall on fixed variables have no place in the model.
const NOWHERE: usize = usize::MAX;

/// A row's scale is one over the norm of its gradient at the start, but a gradient below this says
/// nothing about the row's magnitude.
const SMALLEST_ROW_NORM: f64 = 1e-2;

/// The weight of the augmentation, relative to the largest entry of the Hessian (the rows that it
/// multiplies have gradients of about unit length).
const AUGMENTATION: f64 = 10.0;

/// A sparse matrix by rows, filled from triplets of a fixed pattern.
#[derive(Debug, Clone, Default)]
pub(super) struct SparseRows {
    pub starts: Vec<usize>,
    pub columns: Vec<usize>,
    pub values: Vec<f64>,
    /// Where each triplet goes.
    places: Vec<usize>,
}

impl SparseRows {
    /// Lays out the pattern `entries` (row, column), in which a column `NOWHERE` drops the entry.
    fn lay_out(
        &mut self,
        num_rows: usize,
        entries: impl Iterator<Item = (usize, usize)> + Clone,
        scratch: &mut Vec<usize>,
    ) {
        self.places.clear();
        self.columns.clear();
        self.starts.clear();
        self.starts.resize(num_rows + 1, 0);
        for (row, column) in entries.clone() {
            if column != NOWHERE {
                self.starts[row + 1] += 1;
            }
        }
        for row in 0..num_rows {
            self.starts[row + 1] += self.starts[row];
        }
        // Triplets in the order of their rows.
        let total = self.starts[num_rows];
        scratch.clear();
        scratch.resize(total, 0);
        let mut cursor = std::mem::take(&mut self.columns);
        cursor.extend_from_slice(&self.starts[..num_rows]);
        for (k, (row, column)) in entries.clone().enumerate() {
            self.places.push(column);
            if column != NOWHERE {
                scratch[cursor[row]] = k;
                cursor[row] += 1;
            }
        }
        cursor.clear();
        self.columns = cursor;
        let mut begin = 0;
        for row in 0..num_rows {
            let end = self.starts[row + 1];
            let triplets = &mut scratch[begin..end];
            triplets.sort_unstable_by_key(|&k| (self.places[k], k));
            begin = end;
            let first = self.columns.len();
            self.starts[row] = first;
            for &k in triplets.iter() {
                let column = self.places[k];
                if self.columns.len() == first || self.columns.last() != Some(&column) {
                    self.columns.push(column);
                }
                self.places[k] = self.columns.len() - 1;
            }
        }
        self.starts[num_rows] = self.columns.len();
        self.values.clear();
        self.values.resize(self.columns.len(), 0.0);
    }

    /// Sums the triplets into the matrix.
    fn fill(&mut self, triplets: &[f64]) {
        self.values.fill(0.0);
        for (&place, value) in self.places.iter().zip(triplets) {
            if place != NOWHERE {
                self.values[place] += value;
            }
        }
    }

    pub fn row(&self, i: usize) -> (&[usize], &[f64]) {
        let range = self.starts[i]..self.starts[i + 1];
        (&self.columns[range.clone()], &self.values[range])
    }

    /// The product of row i with a vector.
    pub fn row_dot(&self, i: usize, vector: &[f64]) -> f64 {
        let (columns, values) = self.row(i);
        columns
            .iter()
            .zip(values)
            .map(|(&j, v)| v * vector[j])
            .sum()
    }

    /// Adds the transposed product Jᵀy to `sum`.
    pub fn add_transposed_product(&self, y: &[f64], sum: &mut [f64]) {
        for (i, &factor) in y.iter().enumerate() {
            if factor != 0.0 {
                let (columns, values) = self.row(i);
                for (&j, v) in columns.iter().zip(values) {
                    sum[j] += factor * v;
                }
            }
        }
    }
}

/// Which bound of a row is meant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum RowSide {
    Lower,
    Upper,
}

/// Quadratic terms ½ρ(Jᵢd − tᵢ)² for constraints that are expected to hold with equality,
/// tᵢ being the distance to their bound. They vanish where the constraint does hold with equality,
/// and so change neither the step nor the multipliers, but make the Hessian positive definite if
/// it is so on the tangent space of these constraints. (The idea of the augmented Lagrangian; see
/// P. E. Gill, D. P. Robinson, "A globally convergent stabilized SQP method", SIAM J. Optim. 23
/// (2013).)
#[derive(Debug, Clone, Default)]
pub(super) struct Augmentation {
    /// ρ.
    pub weight: f64,
    pub rows: Vec<(usize, RowSide)>,
    /// Free variables at a bound that the objective pushes them against.
    pub variables: Vec<usize>,
}

impl Augmentation {
    pub fn clear(&mut self) {
        self.weight = 0.0;
        self.rows.clear();
        self.variables.clear();
    }

    pub fn is_empty(&self) -> bool {
        self.rows.is_empty() && self.variables.is_empty()
    }
}

/// The scaled linear-quadratic model of a problem at a point.
#[derive(Debug, Clone, Default)]
pub(super) struct LocalModel {
    /// Scaled gradient of the objective.
    pub gradient: Vec<f64>,
    /// Scaled Jacobian.
    pub jacobian: SparseRows,
    /// Scaled Hessian: row j holds the entries (i, j), i ≤ j, of its upper triangle, the diagonal
    /// last and always present. (These are the columns of the upper triangle.)
    pub hessian: SparseRows,
    /// Added to the diagonal of the Hessian to make it positive definite.
    pub shift: f64,
    /// Constraints held with equality at the last step, and the weight of their augmentation.
    pub augmentation: Augmentation,
    /// Original index of each free variable.
    pub free: Vec<usize>,
    /// Scale of each free variable.
    pub scales: Vec<f64>,
    /// Scale of each row.
    pub row_scales: Vec<f64>,
    /// Bounds of all variables and constraints, in the problem's own units.
    pub lower: Vec<f64>,
    pub upper: Vec<f64>,
    pub row_lower: Vec<f64>,
    pub row_upper: Vec<f64>,
    jacobian_triplets: Vec<f64>,
    hessian_triplets: Vec<f64>,
    full_gradient: Vec<f64>,
    free_index: Vec<usize>,
    scratch: Vec<usize>,
}

impl LocalModel {
    /// Reads the problem's bounds, scales and patterns.
    pub fn set_up<P: Nlp>(&mut self, problem: &P) -> Result<(), ProblemError> {
        let n = problem.num_variables();
        let m = problem.num_constraints();
        refill(&mut self.lower, n, f64::NEG_INFINITY);
        refill(&mut self.upper, n, f64::INFINITY);
        refill(&mut self.row_lower, m, f64::NEG_INFINITY);
        refill(&mut self.row_upper, m, f64::INFINITY);
        refill(&mut self.full_gradient, n, 1.0);
        problem.variable_bounds(&mut self.lower, &mut self.upper);
        problem.constraint_bounds(&mut self.row_lower, &mut self.row_upper);
        check_bounds(BoundKind::Variable, &self.lower, &self.upper)?;
        check_bounds(BoundKind::Constraint, &self.row_lower, &self.row_upper)?;

        self.free.clear();
        self.scales.clear();
        self.free_index.clear();
        problem.variable_scales(&mut self.full_gradient);
        for (j, &scale) in self.full_gradient.iter().enumerate() {
            if scale.is_nan() || scale <= 0.0 || scale.is_infinite() {
                return Err(ProblemError::BadScale { index: j, scale });
            }
            if self.lower[j] < self.upper[j] {
                self.free_index.push(self.free.len());
                self.free.push(j);
                self.scales.push(scale);
            } else {
                self.free_index.push(NOWHERE);
            }
        }

        let pattern = problem.jacobian_pattern();
        check_pattern("Jacobian", &pattern, m, n)?;
        let free_index = &self.free_index;
        self.jacobian.lay_out(
            m,
            pattern
                .iter()
                .map(|(row, column)| (row, free_index[column])),
            &mut self.scratch,
        );
        refill(&mut self.jacobian_triplets, pattern.len(), 0.0);
        refill(&mut self.row_scales, m, 1.0);

        let k = self.free.len();
        refill(&mut self.gradient, k, 0.0);
        self.shift = 0.0;
        self.augmentation.clear();
        let pattern = if problem.hessian_kind() == Hessian::QuasiNewton {
            TripletPattern::new()
        } else {
            problem.hessian_pattern()
        };
        check_pattern("Hessian", &pattern, n, n)?;
        if problem.hessian_kind() == Hessian::QuasiNewton {
            self.hessian.lay_out(
                k,
                (0..k).flat_map(|column| (0..=column).map(move |row| (column, row))),
                &mut self.scratch,
            );
        } else {
            // The diagonal is appended as triplets of its own, so that it is always present.
            let triangle = pattern.iter().map(|(row, column)| {
                let (a, b) = (free_index[row], free_index[column]);
                if a == NOWHERE || b == NOWHERE {
                    (0, NOWHERE)
                } else {
                    (a.max(b), a.min(b))
                }
            });
            self.hessian
                .lay_out(k, triangle.chain((0..k).map(|j| (j, j))), &mut self.scratch);
        }
        refill(&mut self.hessian_triplets, pattern.len(), 0.0);
        Ok(())
    }

    pub fn num_variables(&self) -> usize {
        self.free.len()
    }

    pub fn num_rows(&self) -> usize {
        self.row_scales.len()
    }

    /// Evaluates gradient and Jacobian at `x`; names what is not finite.
    pub fn linearise<P: Nlp>(
        &mut self,
        problem: &mut P,
        x: &[f64],
    ) -> Result<(), (&'static str, usize, f64)> {
        problem.gradient(x, &mut self.full_gradient);
        check_finite("objective gradient", &self.full_gradient)?;
        problem.jacobian(x, &mut self.jacobian_triplets);
        check_finite("constraint Jacobian", &self.jacobian_triplets)?;
        for ((g, &j), scale) in self.gradient.iter_mut().zip(&self.free).zip(&self.scales) {
            *g = scale * self.full_gradient[j];
        }
        self.jacobian.fill(&self.jacobian_triplets);
        for i in 0..self.row_scales.len() {
            let range = self.jacobian.starts[i]..self.jacobian.starts[i + 1];
            for (value, &j) in self.jacobian.values[range.clone()]
                .iter_mut()
                .zip(&self.jacobian.columns[range])
            {
                *value *= self.row_scales[i] * self.scales[j];
            }
        }
        Ok(())
    }

    /// Scales the rows by the norms of their gradients, at the first linearisation.
    pub fn scale_rows(&mut self) {
        for i in 0..self.row_scales.len() {
            let range = self.jacobian.starts[i]..self.jacobian.starts[i + 1];
            let values = &mut self.jacobian.values[range];
            let norm = values.iter().map(|v| v * v).sum::<f64>().sqrt();
            let scale = 1.0 / norm.max(SMALLEST_ROW_NORM);
            for value in values {
                *value *= scale;
            }
            self.row_scales[i] = scale;
        }
    }

    /// Evaluates the Hessian at `x` with the multipliers of the problem's own rows.
    pub fn evaluate_hessian<P: Nlp>(
        &mut self,
        problem: &mut P,
        x: &[f64],
        multipliers: &[f64],
    ) -> Result<(), (&'static str, usize, f64)> {
        problem.hessian(x, 1.0, multipliers, &mut self.hessian_triplets);
        check_finite("Hessian", &self.hessian_triplets)?;
        self.hessian.fill(&self.hessian_triplets);
        for column in 0..self.free.len() {
            let range = self.hessian.starts[column]..self.hessian.starts[column + 1];
            for (value, &row) in self.hessian.values[range.clone()]
                .iter_mut()
                .zip(&self.hessian.columns[range])
            {
                *value *= self.scales[row] * self.scales[column];
            }
        }
        Ok(())
    }

    /// Largest magnitude among the entries of the Hessian.
    pub fn hessian_size(&self) -> f64 {
        largest(&self.hessian.values)
    }

    /// Augments by the constraints whose multipliers (in scaled units) say that they are active.
    pub fn augment(&mut self, x: &[f64], multipliers: &[f64], lagrangian_gradient: &[f64]) {
        self.augmentation.clear();
        let significant = 1e-6 * largest(multipliers);
        for (i, &multiplier) in multipliers.iter().enumerate() {
            if multiplier.abs() > significant {
                let side = if multiplier > 0.0 {
                    RowSide::Upper
                } else {
                    RowSide::Lower
                };
                self.augmentation.rows.push((i, side));
            }
        }
        for (k, &j) in self.free.iter().enumerate() {
            let pushed = lagrangian_gradient[k];
            if (pushed > 0.0 && x[j] == self.lower[j]) || (pushed < 0.0 && x[j] == self.upper[j]) {
                self.augmentation.variables.push(k);
            }
        }
        self.augmentation.weight = AUGMENTATION * self.hessian_size();
    }

    /// Adds the linear terms of the augmentation to a gradient, for the given bounds on Jd.
    pub fn add_augmented_gradient(&self, lower: &[f64], upper: &[f64], gradient: &mut [f64]) {
        for &(i, side) in &self.augmentation.rows {
            let target = match side {
                RowSide::Lower => lower[i],
                RowSide::Upper => upper[i],
            };
            if !target.is_finite() {
                continue;
            }
            let (columns, values) = self.jacobian.row(i);
            for (&j, v) in columns.iter().zip(values) {
                gradient[j] -= self.augmentation.weight * target * v;
            }
        }
    }

    /// ½ dᵀ(H + shift·I)d.
    pub fn curvature(&self, step: &[f64]) -> f64 {
        let mut sum = 0.0;
        for (j, &d) in step.iter().enumerate() {
            if d == 0.0 {
                continue;
            }
            let (rows, values) = self.hessian.row(j);
            let above: f64 = rows.iter().zip(values).map(|(&i, v)| v * step[i]).sum();
            // The diagonal is the last entry of its column and counts half.
            let diagonal = values.last().copied().unwrap_or(0.0);
            sum += d * (above - 0.5 * diagonal * d + 0.5 * self.shift * d);
        }
        sum
    }

    /// Sum of the scaled violations of the constraint values `c` (in the problem's units).
    pub fn violation(&self, c: &[f64]) -> f64 {
        let mut sum = 0.0;
        for (i, &value) in c.iter().enumerate() {
            let outside = (self.row_lower[i] - value).max(value - self.row_upper[i]);
            if outside > 0.0 {
                sum += self.row_scales[i] * outside;
            }
        }
        sum
    }

    /// Largest violation of the constraint values `c`, in the problem's units.
    pub fn largest_violation(&self, c: &[f64]) -> f64 {
        c.iter().enumerate().fold(0.0_f64, |worst, (i, &value)| {
            worst
                .max(self.row_lower[i] - value)
                .max(value - self.row_upper[i])
        })
    }
}

/// Checks a starting point.
pub(super) fn check_start(num_variables: usize, x: &[f64]) -> Result<(), ProblemError> {
    check_length("the starting point", num_variables, x.len())?;
    match x.iter().position(|v| !v.is_finite()) {
        None => Ok(()),
        Some(index) => Err(ProblemError::StartNotFinite {
            index,
            value: x[index],
        }),
    }
}

/// Names the first entry that is not finite.
pub(super) fn check_finite(
    what: &'static str,
    values: &[f64],
) -> Result<(), (&'static str, usize, f64)> {
    match values.iter().position(|v| !v.is_finite()) {
        None => Ok(()),
        Some(index) => Err((what, index, values[index])),
    }
}
