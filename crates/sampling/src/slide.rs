//! The step nearest to a wanted one that respects linearised inequalities:
//! min |Δ − Δ_wanted|² subject to aᵢᵀ Δ ≥ bᵢ, in tangent coordinates.
//!
//! Solved by Hildreth's method: coordinate ascent on the multipliers with the
//! Gram matrix of the rows, from the multipliers of the solution before. Cost:
//! rows² k / 2 for the matrix, rows² a sweep. An unsolvable system ends at the sweep limit; the caller tests the step anyway.

/// Rows aᵢᵀ Δ ≥ bᵢ, and the memory to solve for the nearest step.
#[derive(Clone, Debug, Default)]
pub(crate) struct NearestStep {
    dimension: usize,
    /// What each row belongs to.
    pub(crate) constraints: Vec<Constraint>,
    normals: Vec<f64>,
    offsets: Vec<f64>,
    gram: Vec<f64>,
    multipliers: Vec<f64>,
    slacks: Vec<f64>,
}

/// An inequality of the problem.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Constraint {
    Lower(usize),
    Upper(usize),
    Limit(usize),
    Contact(usize),
}

const SWEEPS: usize = 60;
const TOLERANCE: f64 = 1e-7;

impl NearestStep {
    pub(crate) fn new(dimension: usize) -> Self {
        Self {
            dimension,
            ..Self::default()
        }
    }

    pub(crate) fn clear(&mut self) {
        self.constraints.clear();
        self.normals.clear();
        self.offsets.clear();
        self.multipliers.clear();
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.constraints.is_empty()
    }

    /// Sets the row of a constraint, adding it if it is new.
    pub(crate) fn set(&mut self, constraint: Constraint, normal: &[f64], offset: f64) {
        let k = self.dimension;
        match self.constraints.iter().position(|c| *c == constraint) {
            Some(i) => {
                self.normals[i * k..(i + 1) * k].copy_from_slice(normal);
                self.offsets[i] = offset;
            }
            None => {
                self.constraints.push(constraint);
                self.normals.extend_from_slice(normal);
                self.offsets.push(offset);
                self.multipliers.push(0.0);
            }
        }
    }

    /// Removes the i-th row.
    pub(crate) fn remove(&mut self, i: usize) {
        let k = self.dimension;
        self.constraints.remove(i);
        self.normals.drain(i * k..(i + 1) * k);
        self.offsets.remove(i);
        self.multipliers.remove(i);
    }

    /// Replaces `step` by the nearest step that satisfies all rows.
    pub(crate) fn solve(&mut self, step: &mut [f64]) {
        let (k, n) = (self.dimension, self.constraints.len());
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
        self.slacks.clear();
        self.slacks.extend(
            self.normals
                .chunks_exact(k)
                .zip(&self.offsets)
                .map(|(a, b)| dot(a, step) - b),
        );
        if self.slacks.iter().all(|s| *s >= -TOLERANCE) {
            self.multipliers.fill(0.0);
            return;
        }
        self.gram.resize(n * n, 0.0);
        for (i, a) in self.normals.chunks_exact(k).enumerate() {
            for (j, b) in self.normals.chunks_exact(k).take(i + 1).enumerate() {
                let product = dot(a, b);
                self.gram[i * n + j] = product;
                self.gram[j * n + i] = product;
            }
        }
        for (gram, &multiplier) in self.gram.chunks_exact(n).zip(&self.multipliers) {
            if multiplier > 0.0 {
                for (slack, g) in self.slacks.iter_mut().zip(gram) {
                    *slack += multiplier * g;
                }
            }
        }
        for _ in 0..SWEEPS {
            let mut change = 0.0_f64;
            for i in 0..n {
                let gram = &self.gram[i * n..(i + 1) * n];
                let norm = gram[i];
                if norm < 1e-16 {
                    continue;
                }
                let wanted = (self.multipliers[i] - self.slacks[i] / norm).max(0.0);
                let delta = wanted - self.multipliers[i];
                if delta != 0.0 {
                    self.multipliers[i] = wanted;
                    for (slack, g) in self.slacks.iter_mut().zip(gram) {
                        *slack += delta * g;
                    }
                    change = change.max(delta.abs() * norm.sqrt());
                }
            }
            if change <= TOLERANCE {
                break;
            }
        }
        for (a, &multiplier) in self.normals.chunks_exact(k).zip(&self.multipliers) {
            if multiplier > 0.0 {
                for (step, a) in step.iter_mut().zip(a) {
                    *step += multiplier * a;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn projects_onto_a_corner() {
        let mut nearest = NearestStep::new(2);
        nearest.set(Constraint::Lower(0), &[1.0, 0.0], 0.1);
        nearest.set(Constraint::Lower(1), &[0.6, 0.8], 0.2);
        let mut step = [-1.0, -1.0];
        nearest.solve(&mut step);
        assert!((step[0] - 0.1).abs() < 1e-6);
        assert!((0.6 * step[0] + 0.8 * step[1] - 0.2).abs() < 1e-6);
        let mut free = [1.0, 1.0];
        nearest.solve(&mut free);
        assert_eq!(free, [1.0, 1.0]);
    }
}
