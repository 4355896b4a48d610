//! Cholesky factorisation of a symmetric block-tridiagonal matrix.

use crate::vector::{axpy, dot};

/// The matrix, then its factor L: diagonal blocks lower triangular, one block below each.
#[derive(Debug, Clone, Default)]
pub(super) struct BlockCholesky {
    blocks: usize,
    size: usize,
    /// Row-major; only the lower triangle of each block counts.
    diagonal: Vec<f64>,
    below: Vec<f64>,
}

impl BlockCholesky {
    /// Takes a matrix: diagonal blocks, and those below the diagonal, row-major.
    pub(super) fn load(&mut self, blocks: usize, size: usize, diagonal: &[f64], below: &[f64]) {
        self.blocks = blocks;
        self.size = size;
        self.diagonal.clear();
        self.diagonal.extend_from_slice(diagonal);
        self.below.clear();
        self.below.extend_from_slice(below);
    }

    /// Adds to a diagonal entry.
    pub(super) fn add_diagonal(&mut self, variable: usize, value: f64) {
        let k = self.size;
        self.diagonal[variable * k + variable % k] += value;
    }

    /// Adds `weight` a aᵀ, a being the coefficients of `block` or of it and the next.
    pub(super) fn add_outer_product(&mut self, block: usize, a: &[f64], weight: f64) {
        let k = self.size;
        let (first, second) = a.split_at(k);
        add_lower(&mut self.diagonal[block * k * k..], first, weight);
        if second.is_empty() {
            return;
        }
        add_lower(&mut self.diagonal[(block + 1) * k * k..], second, weight);
        for (row, &a) in self.below[block * k * k..].chunks_exact_mut(k).zip(second) {
            axpy(weight * a, first, row);
        }
    }

    /// Factorises in place.
    ///
    /// # Errors
    /// The block at which the matrix turns out not to be positive definite.
    pub(super) fn factorise(&mut self) -> Result<(), usize> {
        let k = self.size;
        let square = k * k;
        for block in 0..self.blocks {
            let (head, tail) = self.diagonal.split_at_mut((block + 1) * square);
            let diagonal = &mut head[block * square..];
            if !cholesky(diagonal, k) {
                return Err(block);
            }
            if block + 1 == self.blocks {
                break;
            }
            // W Lᵀ = C, row by row; then the next diagonal block loses W Wᵀ.
            let below = &mut self.below[block * square..(block + 1) * square];
            for row in below.chunks_exact_mut(k) {
                for j in 0..k {
                    let l = &diagonal[j * k..j * k + j + 1];
                    row[j] = (row[j] - dot(&l[..j], &row[..j])) / l[j];
                }
            }
            for (i, next) in tail[..square].chunks_exact_mut(k).enumerate() {
                let row = &below[i * k..(i + 1) * k];
                for (j, entry) in next[..=i].iter_mut().enumerate() {
                    *entry -= dot(row, &below[j * k..(j + 1) * k]);
                }
            }
        }
        Ok(())
    }

    /// Solves in place.
    pub(super) fn solve(&self, x: &mut [f64]) {
        let k = self.size;
        let square = k * k;
        for block in 0..self.blocks {
            let (before, rest) = x.split_at_mut(block * k);
            if block > 0 {
                let below = &self.below[(block - 1) * square..block * square];
                let before = &before[(block - 1) * k..];
                for (x, row) in rest.iter_mut().zip(below.chunks_exact(k)) {
                    *x -= dot(row, before);
                }
            }
            let diagonal = &self.diagonal[block * square..];
            for i in 0..k {
                let l = &diagonal[i * k..i * k + i + 1];
                rest[i] = (rest[i] - dot(&l[..i], &rest[..i])) / l[i];
            }
        }
        for block in (0..self.blocks).rev() {
            let (here, after) = x.split_at_mut((block + 1) * k);
            let here = &mut here[block * k..];
            if block + 1 < self.blocks {
                let below = &self.below[block * square..(block + 1) * square];
                for (row, &y) in below.chunks_exact(k).zip(after.iter()) {
                    axpy(-y, row, here);
                }
            }
            let diagonal = &self.diagonal[block * square..];
            for i in (0..k).rev() {
                here[i] /= diagonal[i * k + i];
                let y = here[i];
                axpy(-y, &diagonal[i * k..i * k + i], &mut here[..i]);
            }
        }
    }
}

fn add_lower(block: &mut [f64], a: &[f64], weight: f64) {
    let k = a.len();
    for (i, (row, &ai)) in block.chunks_exact_mut(k).zip(a).enumerate() {
        axpy(weight * ai, &a[..=i], &mut row[..=i]);
    }
}

/// Factorises the lower triangle of a k × k block; `false` where a pivot is not positive.
fn cholesky(a: &mut [f64], k: usize) -> bool {
    for i in 0..k {
        let (before, row) = a.split_at_mut(i * k);
        for j in 0..i {
            let l = &before[j * k..j * k + j + 1];
            row[j] = (row[j] - dot(&l[..j], &row[..j])) / l[j];
        }
        let pivot = row[i] - dot(&row[..i], &row[..i]);
        if !(pivot > 0.0 && pivot.is_finite()) {
            return false;
        }
        row[i] = pivot.sqrt();
    }
    true
}
