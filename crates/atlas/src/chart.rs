//! Charts: local parametrisations of the manifold by its tangent space.
//!
//! A chart at x_c maps tangent coordinates t ∈ ℝᵏ to the point of the manifold
//! that projects orthogonally onto x_c + Φ t (the exponential map ψ), and back
//! by t = Φᵀ (x − x_c) (the logarithmic map ψ⁻¹): Porta and Hernández-Juan
//! (2016), eqs. (10)–(14).
//!
//! The exponential map solves F(x) = 0 with x − x_c − Φ t in the normal space at
//! the centre. The chart keeps the pseudo-inverse B of the independent rows of
//! the Jacobian at the centre, and iterates x ← x − B F(x), accelerated by
//! Broyden's rank-one updates: a residual and m r multiplications an iteration,
//! superlinearly convergent. Where that contracts poorly it falls back to
//! Newton's method in the same normal space.

mod recenter;

use crate::{
    error::ManifoldError,
    manifold::{ImplicitManifold, SparseRow, SparsityPattern},
    qr::{
        LANES, Lanes, PivotedQr, axpy, blocks, dot, padded_axpy, padded_dot, vectorised,
        vectorised_rows,
    },
};

/// Rank is lost when the last pivot is below this fraction of the first.
pub(crate) const SINGULAR_PIVOT: f64 = 1e-7;

/// Contraction of the residual that a chord iteration must at least achieve.
const POOR_CONTRACTION: f64 = 0.7;
/// Contraction from which the next iteration's is foreseen, and the room for error then.
const SURE_CONTRACTION: f64 = 0.1;
/// Who asks for residuals below this gets none that is only foreseen: near singular
/// points one contraction may be much better than those that follow.
const FORESEEN: f64 = 1e-6;

/// Memory that the operations of charts share; one for each thread.
#[derive(Clone, Debug, Default)]
pub struct Workspace {
    pub(crate) qr: PivotedQr,
    residual: Vec<f64>,
    /// −F on the independent rows, padded.
    right: Vec<Lanes>,
    /// Steps of the current projection, one after the other, padded.
    steps: Vec<Lanes>,
    /// Their squared lengths.
    lengths: Vec<f64>,
    jacobian: Vec<f64>,
    newton: Vec<f64>,
    saved: Vec<f64>,
    /// Charts near a new one, with their squared distances from it.
    pub(crate) near: Vec<(usize, f64)>,
    /// Chord iterations made so far.
    pub chord_iterations: usize,
    /// Newton iterations made so far.
    pub newton_iterations: usize,
    /// Projections made so far.
    pub projections: usize,
}

/// Why the exponential map has no value.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("the projection onto the manifold stopped at a residual of {residual:.3e}")]
pub struct ProjectionFailed {
    /// Largest residual reached.
    pub residual: f64,
}

/// A local parametrisation about a point of the manifold.
#[derive(Clone, Debug)]
pub struct Chart {
    center: Vec<f64>,
    /// Φ, one tangent vector after the other.
    basis: Vec<f64>,
    /// Φᵀ x_c.
    center_along: Vec<f64>,
    dimension: usize,
    /// Independent equations.
    rows: Vec<u32>,
    /// B, the pseudo-inverse of the independent rows at the centre: for [`LANES`]
    /// variables after the other, their values in one column after the other; padded
    /// with zeros to whole [`LANES`] in both directions.
    pseudo_inverse: Vec<Lanes>,
}

impl Chart {
    /// The chart about the point `center` of a manifold of dimension `dimension`.
    ///
    /// Cost: one Jacobian and one pivoted QR.
    ///
    /// # Errors
    /// [`ManifoldError::Singular`] where the rank of the Jacobian is smaller
    /// than it should be.
    pub fn new<M: ImplicitManifold + ?Sized>(
        manifold: &M,
        center: &[f64],
        dimension: usize,
        work: &mut Workspace,
    ) -> Result<Self, ManifoldError> {
        let m = manifold.ambient_dimension();
        let pattern = manifold.jacobian_pattern();
        let expected = m - dimension;
        work.jacobian.resize(pattern.len(), 0.0);
        manifold.jacobian(center, &mut work.jacobian);
        let qr = &mut work.qr;
        let rank = qr.factorise(pattern, &work.jacobian, expected, SINGULAR_PIVOT);
        if rank < expected {
            return Err(ManifoldError::Singular {
                rank,
                expected,
                pivot_ratio: qr.rest_ratio(),
            });
        }
        let mut basis = Vec::with_capacity(m * dimension);
        qr.write_null_basis(&mut basis);
        let mut pseudo_inverse = Vec::with_capacity(blocks(m) * blocks(rank) * LANES);
        qr.write_pseudo_inverse(pattern, &work.jacobian, &mut pseudo_inverse);
        let vectors = basis.chunks_exact(m);
        Ok(Self {
            center: center.to_vec(),
            center_along: vectors.map(|vector| dot(vector, center)).collect(),
            basis,
            dimension,
            rows: qr.independent_rows().iter().map(|&r| r as u32).collect(),
            pseudo_inverse,
        })
    }

    /// The point x_c of the manifold that the chart is built at (m values).
    #[inline]
    pub fn center(&self) -> &[f64] {
        &self.center
    }

    /// Dimension k of the manifold.
    #[inline]
    pub fn dimension(&self) -> usize {
        self.dimension
    }

    /// The j-th vector of the orthonormal tangent basis Φ (m values).
    #[inline]
    pub fn tangent(&self, j: usize) -> &[f64] {
        let m = self.center.len();
        &self.basis[j * m..(j + 1) * m]
    }

    /// The row of Φ that belongs to one variable (k values): the tangent
    /// coordinates of that variable's gradient.
    #[inline]
    pub fn variable(&self, variable: usize) -> impl Iterator<Item = f64> {
        let row = self.basis.iter().skip(variable);
        row.step_by(self.center.len()).copied()
    }

    /// The multipliers y with Jᵀ y nearest to `w`, J being the Jacobian at the
    /// centre that the pseudo-inverse belongs to: y = J⁺ᵀ w, zero for equations
    /// that depend on others (n values). Cost: m r.
    pub fn multipliers(&self, w: &[f64], y: &mut [f64]) {
        y.fill(0.0);
        for (w, panel) in w.chunks(LANES).zip(self.panels()) {
            for (&row, b) in self.rows.iter().zip(panel) {
                y[row as usize] += w.iter().zip(b).map(|(w, b)| w * b).sum::<f64>();
            }
        }
    }

    /// The columns of B for [`LANES`] variables after the other.
    #[inline(always)]
    fn panels(&self) -> impl Iterator<Item = &[Lanes]> {
        let columns = LANES * blocks(self.rows.len());
        self.pseudo_inverse.chunks_exact(columns.max(1))
    }

    /// The row of B that belongs to one variable, with its padding.
    #[inline(always)]
    fn pseudo_inverse_row(&self, variable: usize) -> impl Iterator<Item = f64> {
        let columns = LANES * blocks(self.rows.len());
        let panel = &self.pseudo_inverse[variable / LANES * columns..][..columns];
        panel.iter().map(move |b| b[variable % LANES])
    }

    /// y = B f, both padded.
    #[inline(always)]
    fn times_pseudo_inverse(&self, f: &[Lanes], y: &mut [Lanes]) {
        // The innermost loop of all: what `panels` gives, without the division it begins with.
        let mut panels = &self.pseudo_inverse[..];
        for y in y {
            let (panel, rest) = panels.split_at(LANES * f.len());
            panels = rest;
            let mut sum = [0.0; LANES];
            for (f, [a, b, c, d]) in f.iter().zip(panel.as_chunks::<LANES>().0) {
                for i in 0..LANES {
                    sum[i] += (f[0] * a[i] + f[1] * b[i]) + (f[2] * c[i] + f[3] * d[i]);
                }
            }
            *y = sum;
        }
    }

    /// Logarithmic map: tangent coordinates t = Φᵀ (x − x_c). Cost: k m.
    pub fn log(&self, x: &[f64], t: &mut [f64]) {
        let vectors = self.basis.chunks_exact(self.center.len());
        vectorised(
            #[inline(always)]
            || {
                for ((t, vector), along) in t.iter_mut().zip(vectors).zip(&self.center_along) {
                    *t = dot(vector, x) - along;
                }
            },
        );
    }

    /// The point x_c + Φ t of the tangent space. Cost: k m.
    pub fn tangent_point(&self, t: &[f64], x: &mut [f64]) {
        x.copy_from_slice(&self.center);
        for (&t, vector) in t.iter().zip(self.basis.chunks_exact(self.center.len())) {
            axpy(t, vector, x);
        }
    }

    /// Gradient, in tangent coordinates, of a function on the manifold at one of
    /// its points: Φᵀ (g − Jᵀ Bᵀ g), with `gradient` g in all variables and the
    /// values J of the Jacobian at that point. It is exact at the centre and to
    /// first order in the turn of the tangent space from there. `scratch` is memory.
    /// Cost: k m, and the entries of J.
    pub fn pull_back(
        &self,
        pattern: &SparsityPattern,
        jacobian: &[f64],
        gradient: &SparseRow,
        scratch: &mut Vec<f64>,
        tangent_gradient: &mut [f64],
    ) {
        let (m, r) = (self.center.len(), self.rows.len());
        scratch.clear();
        scratch.resize(m + r, 0.0);
        vectorised(
            #[inline(always)]
            || {
                let (normal, multipliers) = scratch.split_at_mut(m);
                for &(i, g) in gradient.entries() {
                    normal[i] += g;
                    for (y, b) in multipliers.iter_mut().zip(self.pseudo_inverse_row(i)) {
                        *y += g * b;
                    }
                }
                for (&row, &multiplier) in self.rows.iter().zip(&*multipliers) {
                    let range = pattern.row_range(row as usize);
                    for (&i, &v) in pattern.row(row as usize).iter().zip(&jacobian[range]) {
                        normal[i] -= v * multiplier;
                    }
                }
                let vectors = self.basis.chunks_exact(m);
                for (g, vector) in tangent_gradient.iter_mut().zip(vectors) {
                    *g = dot(vector, normal);
                }
            },
        );
    }

    /// Exponential map: the point of the manifold with tangent coordinates t.
    ///
    /// # Errors
    /// [`ProjectionFailed`] when neither chord nor Newton iterations converge to
    /// residuals of at most `tolerance`.
    pub fn exp<M: ImplicitManifold + ?Sized>(
        &self,
        manifold: &M,
        t: &[f64],
        x: &mut [f64],
        tolerance: f64,
        work: &mut Workspace,
    ) -> Result<(), ProjectionFailed> {
        self.tangent_point(t, x);
        self.retract(manifold, x, tolerance, work)
    }

    /// Moves `x` along the normal space at the centre onto the manifold: its
    /// tangent coordinates stay. Starting from a good prediction instead of
    /// from the tangent space saves iterations.
    ///
    /// # Errors
    /// As [`Chart::exp`].
    pub fn retract<M: ImplicitManifold + ?Sized>(
        &self,
        manifold: &M,
        x: &mut [f64],
        tolerance: f64,
        work: &mut Workspace,
    ) -> Result<(), ProjectionFailed> {
        work.projections += 1;
        work.residual.resize(manifold.equation_count(), 0.0);
        work.saved.clear();
        work.saved.extend_from_slice(x);
        work.lengths.clear();
        let mut previous = f64::INFINITY;
        let mut poor = 0;
        loop {
            manifold.residual(x, &mut work.residual);
            let size = self.independent_residual(work);
            // The dependent rows hold by themselves near the manifold; where
            // they do not, x is a point of another set.
            let all_hold = |work: &Workspace| {
                let limit = 1e3 * tolerance;
                work.residual.iter().all(|f| f.abs() <= limit)
            };
            if size <= tolerance {
                return if all_hold(work) {
                    Ok(())
                } else {
                    let residual = crate::newton::largest(&work.residual).1;
                    Err(ProjectionFailed { residual })
                };
            }
            if size.is_nan() || size > 1e3 || size > 2.0 * previous {
                break;
            }
            if size > POOR_CONTRACTION * previous {
                poor += 1;
                if poor > 3 {
                    break;
                }
            }
            // Convergence is superlinear: where the last contraction, repeated, goes far
            // enough, the residual after the step need not be looked at.
            let contraction = size / previous;
            let last = tolerance >= FORESEEN
                && previous.is_finite()
                && contraction < SURE_CONTRACTION
                && contraction * size <= SURE_CONTRACTION * tolerance
                && all_hold(work);
            previous = size;
            if !self.chord_step(x, work) {
                break;
            }
            if last {
                return Ok(());
            }
        }
        x.copy_from_slice(&work.saved);
        self.newton(manifold, x, tolerance, work)
    }

    /// Puts −F on the independent rows where the next step takes it from. Returns the
    /// largest, or NaN where there is one.
    fn independent_residual(&self, work: &mut Workspace) -> f64 {
        let Workspace {
            right, residual, ..
        } = work;
        self.clear_right(right);
        let (mut size, mut sum) = (0.0, 0.0);
        for (f, &row) in right.as_flattened_mut().iter_mut().zip(&self.rows) {
            let v = residual[row as usize];
            *f = -v;
            sum += v;
            let v = v.abs();
            size = if v > size { v } else { size };
        }
        if sum.is_nan() { sum } else { size }
    }

    /// Gives a padded vector of independent rows its length, with zeros as padding.
    fn clear_right(&self, right: &mut Vec<Lanes>) {
        right.resize(blocks(self.rows.len()), [0.0; LANES]);
        if let Some(last) = right.last_mut() {
            *last = [0.0; LANES];
        }
    }

    /// One step of Broyden's method from B as approximate inverse (Kelley 1995,
    /// algorithm `brsol`); −F(x) is in the workspace. `false` where the update
    /// breaks down.
    fn chord_step(&self, x: &mut [f64], work: &mut Workspace) -> bool {
        // Of known length, the vectors of small structures stay in registers.
        vectorised_rows(
            blocks(x.len()),
            #[inline(always)]
            |length| self.broyden_step(length, x, work),
        )
    }

    #[inline(always)]
    fn broyden_step(&self, length: usize, x: &mut [f64], work: &mut Workspace) -> bool {
        work.chord_iterations += 1;
        let count = work.lengths.len();
        if work.steps.len() < (count + 1) * length {
            work.steps.resize((count + 1) * length, [0.0; LANES]);
        }
        let (before, step) = work.steps.split_at_mut(count * length);
        let step = &mut step[..length];
        self.times_pseudo_inverse(&work.right, step);
        if let Some(newest) = count.checked_sub(1) {
            for j in 0..newest {
                let (s, next) = before[j * length..].split_at(length);
                let factor = padded_dot(s, step) / work.lengths[j];
                padded_axpy(factor, next, step);
            }
            let last = &before[newest * length..];
            let scale = 1.0 - padded_dot(last, step) / work.lengths[newest];
            if scale.abs() < 0.1 {
                return false;
            }
            let inverse = 1.0 / scale;
            for s in step.as_flattened_mut() {
                *s *= inverse;
            }
        }
        work.lengths.push(padded_dot(step, step));
        for (x, s) in x.iter_mut().zip(step.as_flattened()) {
            *x += s;
        }
        true
    }

    /// Newton's method for F(x) = 0 in the normal space at the centre: the
    /// correction is B y with (J(x) B) y = −F(x) on independent rows.
    fn newton<M: ImplicitManifold + ?Sized>(
        &self,
        manifold: &M,
        x: &mut [f64],
        tolerance: f64,
        work: &mut Workspace,
    ) -> Result<(), ProjectionFailed> {
        const MAX_ITERATIONS: usize = 8;
        let pattern = manifold.jacobian_pattern();
        let r = self.rows.len();
        let mut previous = f64::INFINITY;
        work.jacobian.resize(pattern.len(), 0.0);
        self.clear_right(&mut work.right);
        work.steps
            .resize(blocks(x.len()).max(work.steps.len()), [0.0; LANES]);
        for _ in 0..=MAX_ITERATIONS {
            manifold.residual(x, &mut work.residual);
            let (_, size) = crate::newton::largest(&work.residual);
            if size <= tolerance {
                return Ok(());
            }
            if size.is_nan() || size > 0.9 * previous {
                break;
            }
            previous = size;
            work.newton_iterations += 1;
            manifold.jacobian(x, &mut work.jacobian);
            let Workspace {
                newton: matrix,
                jacobian,
                residual,
                right,
                steps,
                ..
            } = work;
            let step = &mut steps[..blocks(x.len())];
            matrix.clear();
            matrix.resize(r * (r + 1), 0.0);
            let solved = vectorised(
                #[inline(always)]
                || {
                    for (&row, product) in self.rows.iter().zip(matrix.chunks_exact_mut(r + 1)) {
                        let range = pattern.row_range(row as usize);
                        for (&c, &v) in pattern.row(row as usize).iter().zip(&jacobian[range]) {
                            for (p, b) in product[..r].iter_mut().zip(self.pseudo_inverse_row(c)) {
                                *p += v * b;
                            }
                        }
                        product[r] = residual[row as usize];
                    }
                    solve_by_elimination(matrix, r)
                },
            );
            if !solved {
                break;
            }
            for (f, product) in right
                .as_flattened_mut()
                .iter_mut()
                .zip(matrix.chunks_exact(r + 1))
            {
                *f = -product[r];
            }
            self.times_pseudo_inverse(right, step);
            for (x, s) in x.iter_mut().zip(step.as_flattened()) {
                *x += s;
            }
        }
        Err(ProjectionFailed { residual: previous })
    }
}

/// Gaussian elimination with partial pivoting on an augmented matrix of r rows
/// and r + 1 columns; the solution replaces the last column. `false` when a
/// pivot vanishes.
#[inline(always)]
pub(crate) fn solve_by_elimination(a: &mut [f64], r: usize) -> bool {
    let w = r + 1;
    for j in 0..r {
        let p = (j..r)
            .max_by(|&p, &q| a[p * w + j].abs().total_cmp(&a[q * w + j].abs()))
            .unwrap_or(j);
        if a[p * w + j] == 0.0 || a[p * w + j].is_nan() {
            return false;
        }
        if p != j {
            let (head, tail) = a.split_at_mut(p * w);
            head[j * w..j * w + w].swap_with_slice(&mut tail[..w]);
        }
        let (head, tail) = a.split_at_mut((j + 1) * w);
        let pivot_row = &head[j * w..];
        for row in tail.chunks_exact_mut(w) {
            let factor = row[j] / pivot_row[j];
            if factor != 0.0 {
                axpy(-factor, &pivot_row[j..], &mut row[j..]);
            }
        }
    }
    for j in (0..r).rev() {
        let x = a[j * w + r] / a[j * w + j];
        a[j * w + r] = x;
        for i in 0..j {
            a[i * w + r] -= a[i * w + j] * x;
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::doc::Sphere;

    #[test]
    fn the_exponential_map_of_the_sphere_is_the_closed_form() {
        let sphere = Sphere::new();
        let mut work = Workspace::default();
        let chart = Chart::new(&sphere, &[0.0, 0.0, 1.0], 2, &mut work).unwrap();
        let mut x = [0.0; 3];
        for t in [[0.1, 0.2], [0.3, -0.4], [0.6, 0.5], [0.0, 0.98]] {
            chart.exp(&sphere, &t, &mut x, 1e-13, &mut work).unwrap();
            // The point above x_c + Φ t: height √(1 − |t|²).
            let height = (1.0 - t[0] * t[0] - t[1] * t[1]).sqrt();
            assert!((x[2] - height).abs() < 1e-11, "{t:?}");
            let mut back = [0.0; 2];
            chart.log(&x, &mut back);
            assert!((back[0] - t[0]).abs() < 1e-13 && (back[1] - t[1]).abs() < 1e-13);
        }
        assert!(
            chart
                .exp(&sphere, &[0.9, 0.9], &mut x, 1e-13, &mut work)
                .is_err()
        );
    }

    #[test]
    fn newton_reaches_the_point_that_chord_iterations_reach() {
        let sphere = Sphere::new();
        let mut work = Workspace::default();
        let chart = Chart::new(&sphere, &[0.0, 0.0, 1.0], 2, &mut work).unwrap();
        let mut x = [0.0; 3];
        for t in [[0.1, 0.2], [0.0, 0.98]] {
            chart.tangent_point(&t, &mut x);
            work.residual.resize(1, 0.0);
            chart.newton(&sphere, &mut x, 1e-13, &mut work).unwrap();
            let height = (1.0 - t[0] * t[0] - t[1] * t[1]).sqrt();
            assert!((x[2] - height).abs() < 1e-11, "{t:?}");
        }
        assert!(work.newton_iterations > 0 && work.chord_iterations == 0);
    }
}
