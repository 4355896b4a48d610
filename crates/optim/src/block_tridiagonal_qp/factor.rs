//! Cholesky factorisation UᵀU of a symmetric block-tridiagonal matrix.
//!
//! Everything is done with whole rows of blocks, and for small blocks by code that is compiled
//! for their size: most of the time would else go into loops of a few rounds.

use super::{axpy, dot};

/// Calls a function with the block size as a constant where it is small, with 0 elsewhere.
macro_rules! with_size {
    ($size:expr, $function:ident($($argument:expr),*)) => {
        match $size {
            1 => $function::<1>($($argument),*),
            2 => $function::<2>($($argument),*),
            3 => $function::<3>($($argument),*),
            4 => $function::<4>($($argument),*),
            5 => $function::<5>($($argument),*),
            6 => $function::<6>($($argument),*),
            7 => $function::<7>($($argument),*),
            8 => $function::<8>($($argument),*),
            _ => $function::<0>($($argument),*),
        }
    };
}

/// The matrix, then its factor U: diagonal blocks upper triangular, with the inverses of the
/// pivots on their diagonals, and one block to the right of each.
#[derive(Debug, Clone, Default)]
pub(super) struct BlockCholesky {
    blocks: usize,
    size: usize,
    /// Row-major; only the upper triangle of each block counts.
    diagonal: Vec<f64>,
    /// Row-major: rows belong to a block, columns to the next.
    right: Vec<f64>,
}

impl BlockCholesky {
    /// Takes a matrix: diagonal blocks, and those below the diagonal, row-major.
    #[inline(always)]
    pub(super) fn load(&mut self, blocks: usize, size: usize, diagonal: &[f64], below: &[f64]) {
        self.blocks = blocks;
        self.size = size;
        self.diagonal.clear();
        self.diagonal.extend_from_slice(diagonal);
        self.right.resize(below.len(), 0.0);
        let square = (size * size).max(1);
        for (right, below) in self
            .right
            .chunks_exact_mut(square)
            .zip(below.chunks_exact(square))
        {
            for (i, row) in right.chunks_exact_mut(size).enumerate() {
                for (entry, column) in row.iter_mut().zip(below.chunks_exact(size)) {
                    *entry = column[i];
                }
            }
        }
    }

    /// Adds to a diagonal entry.
    #[inline(always)]
    pub(super) fn add_diagonal(&mut self, variable: usize, value: f64) {
        let k = self.size;
        self.diagonal[variable * k + variable % k] += value;
    }

    /// Adds `weight` a aᵀ, a being the coefficients of `block` or of it and the next.
    #[inline(always)]
    pub(super) fn add_outer_product(&mut self, block: usize, a: &[f64], weight: f64) {
        let k = self.size;
        let (first, second) = a.split_at(k);
        add_upper(&mut self.diagonal[block * k * k..], first, weight);
        if second.is_empty() {
            return;
        }
        add_upper(&mut self.diagonal[(block + 1) * k * k..], second, weight);
        for (row, &a) in self.right[block * k * k..].chunks_exact_mut(k).zip(first) {
            axpy(weight * a, second, row);
        }
    }

    /// Factorises in place.
    ///
    /// # Errors
    /// The block at which the matrix turns out not to be positive definite.
    #[inline(always)]
    pub(super) fn factorise(&mut self) -> Result<(), usize> {
        let (size, diagonal, right) = (self.size, &mut self.diagonal, &mut self.right);
        with_size!(size, factorise_blocks(size, diagonal, right))
    }

    /// Solves in place.
    #[inline(always)]
    pub(super) fn solve(&self, x: &mut [f64]) {
        let (size, diagonal, right) = (self.size, &self.diagonal, &self.right);
        with_size!(size, solve_blocks(size, diagonal, right, x));
    }
}

#[inline(always)]
fn add_upper(block: &mut [f64], a: &[f64], weight: f64) {
    let k = a.len();
    for (i, (row, &ai)) in block.chunks_exact_mut(k).zip(a).enumerate() {
        axpy(weight * ai, &a[i..], &mut row[i..]);
    }
}

#[inline(always)]
fn factorise_blocks<const K: usize>(
    size: usize,
    diagonal: &mut [f64],
    right: &mut [f64],
) -> Result<(), usize> {
    let k = if K > 0 { K } else { size };
    let square = k * k;
    for block in 0..diagonal.len() / square.max(1) {
        let (head, tail) = diagonal.split_at_mut((block + 1) * square);
        let diagonal = &mut head[block * square..];
        if !cholesky::<K>(size, diagonal) {
            return Err(block);
        }
        if tail.is_empty() {
            break;
        }
        // Uᵀ Y = C, whole rows; then the next diagonal block loses Yᵀ Y.
        let right = &mut right[block * square..(block + 1) * square];
        for j in 0..k {
            let (before, row) = right.split_at_mut(j * k);
            let row = &mut row[..k];
            for (l, other) in before.chunks_exact(k).enumerate() {
                axpy(-diagonal[l * k + j], other, row);
            }
            let inverse = diagonal[j * k + j];
            row.iter_mut().for_each(|y| *y *= inverse);
        }
        for (i, next) in tail[..square].chunks_exact_mut(k).enumerate() {
            for row in right.chunks_exact(k) {
                axpy(-row[i], &row[i..], &mut next[i..]);
            }
        }
    }
    Ok(())
}

/// Factorises the upper triangle of a k × k block and inverts the pivots; `false` where one is not
/// positive.
#[inline(always)]
fn cholesky<const K: usize>(size: usize, a: &mut [f64]) -> bool {
    let k = if K > 0 { K } else { size };
    let a = &mut a[..k * k];
    for j in 0..k {
        let (head, tail) = a.split_at_mut((j + 1) * k);
        let row = &mut head[j * k..];
        let pivot = row[j];
        if !(pivot > 0.0 && pivot.is_finite()) {
            return false;
        }
        let inverse = 1.0 / pivot.sqrt();
        row[j] = inverse;
        row[j + 1..].iter_mut().for_each(|u| *u *= inverse);
        for (i, other) in (j + 1..k).zip(tail.chunks_exact_mut(k)) {
            axpy(-row[i], &row[i..], &mut other[i..]);
        }
    }
    true
}

#[inline(always)]
fn solve_blocks<const K: usize>(size: usize, diagonal: &[f64], right: &[f64], x: &mut [f64]) {
    let k = if K > 0 { K } else { size };
    let square = k * k;
    let blocks = x.len() / k.max(1);
    for block in 0..blocks {
        let (before, rest) = x.split_at_mut(block * k);
        let here = &mut rest[..k];
        if block > 0 {
            let right = &right[(block - 1) * square..block * square];
            for (row, &y) in right.chunks_exact(k).zip(&before[(block - 1) * k..]) {
                axpy(-y, row, here);
            }
        }
        let diagonal = &diagonal[block * square..(block + 1) * square];
        for (j, row) in diagonal.chunks_exact(k).enumerate() {
            here[j] *= row[j];
            let y = here[j];
            axpy(-y, &row[j + 1..], &mut here[j + 1..]);
        }
    }
    for block in (0..blocks).rev() {
        let (here, after) = x.split_at_mut((block + 1) * k);
        let here = &mut here[block * k..];
        if block + 1 < blocks {
            let right = &right[block * square..(block + 1) * square];
            for (y, row) in here.iter_mut().zip(right.chunks_exact(k)) {
                *y -= dot(row, &after[..k]);
            }
        }
        let diagonal = &diagonal[block * square..(block + 1) * square];
        for (j, row) in diagonal.chunks_exact(k).enumerate().rev() {
            let y = here[j] - dot(&row[j + 1..], &here[j + 1..]);
            here[j] = y * row[j];
        }
    }
}
