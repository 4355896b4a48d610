//! Cholesky factorisation UᵀU of a symmetric block-tridiagonal matrix.
//!
//! Everything is done with whole rows of blocks, by code that is compiled for the length of a
//! row: most of the time would else go into loops of a few rounds. Blocks of more than eight rows
//! are padded with those of the identity to a multiple of four.

use super::dot;
use crate::vector::axpy;

/// What is left of a diagonal entry is rounding below this fraction: rows that are nearly active
/// have weights many orders of magnitude above all else.
const NOISE: f64 = 1e-14;

/// Calls a function with the length of a row as a constant, or with 0 where it is large.
macro_rules! with_length {
    ($length:expr, $function:ident($($argument:expr),*)) => {
        match $length {
            1 => $function::<1>($($argument),*),
            2 => $function::<2>($($argument),*),
            3 => $function::<3>($($argument),*),
            4 => $function::<4>($($argument),*),
            5 => $function::<5>($($argument),*),
            6 => $function::<6>($($argument),*),
            7 => $function::<7>($($argument),*),
            8 => $function::<8>($($argument),*),
            12 => $function::<12>($($argument),*),
            16 => $function::<16>($($argument),*),
            20 => $function::<20>($($argument),*),
            24 => $function::<24>($($argument),*),
            _ => $function::<0>($($argument),*),
        }
    };
}

/// The matrix, then its factor U: one block on the diagonal and one to the right of it for each
/// block of variables.
#[derive(Debug, Clone, Default)]
pub(super) struct BlockCholesky {
    blocks: usize,
    size: usize,
    /// Length of a row, padding included.
    length: usize,
    /// Row-major. Of the matrix only the upper triangle counts; of the factor what is above the
    /// diagonal is kept, and zeros elsewhere.
    diagonal: Vec<f64>,
    /// Row-major: rows belong to a block, columns to the next.
    right: Vec<f64>,
    /// Inverses of the pivots, the diagonal of the factor.
    inverses: Vec<f64>,
    /// Coefficients of a row, and right-hand sides, padded.
    padded: Vec<f64>,
}

impl BlockCholesky {
    /// Takes a matrix: diagonal blocks, and those below the diagonal, row-major.
    #[inline(always)]
    pub(super) fn load(&mut self, blocks: usize, size: usize, diagonal: &[f64], below: &[f64]) {
        let length = match size {
            0..=8 => size,
            9..=24 => size.next_multiple_of(4),
            _ => size,
        };
        let square = length * length;
        (self.blocks, self.size, self.length) = (blocks, size, length);
        self.diagonal.resize(blocks * square, 0.0);
        self.right.resize(blocks.saturating_sub(1) * square, 0.0);
        self.inverses.resize(blocks * length, 0.0);
        if size == 0 {
            return;
        }
        let given = diagonal.chunks_exact(size * size);
        for (block, given) in self.diagonal.chunks_exact_mut(square).zip(given) {
            for (row, given) in block.chunks_exact_mut(length).zip(given.chunks_exact(size)) {
                row[..size].copy_from_slice(given);
                row[size..].fill(0.0);
            }
            for i in size..length {
                block[i * length..(i + 1) * length].fill(0.0);
                block[i * length + i] = 1.0;
            }
        }
        let given = below.chunks_exact(size * size);
        for (right, below) in self.right.chunks_exact_mut(square).zip(given) {
            for (i, row) in right.chunks_exact_mut(length).enumerate() {
                row.fill(0.0);
                if i < size {
                    for (entry, column) in row.iter_mut().zip(below.chunks_exact(size)) {
                        *entry = column[i];
                    }
                }
            }
        }
    }

    /// Adds to a diagonal entry.
    #[inline(always)]
    pub(super) fn add_diagonal(&mut self, variable: usize, value: f64) {
        let (block, i) = (variable / self.size, variable % self.size);
        self.diagonal[(block * self.length + i) * self.length + i] += value;
    }

    /// Adds `weight` a aᵀ, a being the coefficients of `block` or of it and the next.
    #[inline(always)]
    pub(super) fn add_outer_product(&mut self, block: usize, a: &[f64], weight: f64) {
        let (size, length) = (self.size, self.length);
        self.padded.clear();
        for part in a.chunks_exact(size) {
            self.padded.extend_from_slice(part);
            self.padded.resize(self.padded.len() + length - size, 0.0);
        }
        let (first, second) = self.padded.split_at(length);
        let square = length * length;
        let diagonal = &mut self.diagonal[block * square..];
        with_length!(length, add_product(length, diagonal, first, first, weight));
        if second.is_empty() {
            return;
        }
        let diagonal = &mut self.diagonal[(block + 1) * square..];
        with_length!(
            length,
            add_product(length, diagonal, second, second, weight)
        );
        let right = &mut self.right[block * square..];
        with_length!(length, add_product(length, right, first, second, weight));
    }

    /// Factorises in place.
    ///
    /// # Errors
    /// The block at which the matrix turns out not to be positive definite.
    #[inline(always)]
    pub(super) fn factorise(&mut self) -> Result<(), usize> {
        let (diagonal, right) = (&mut self.diagonal, &mut self.right);
        let (length, inverses) = (self.length, &mut self.inverses);
        with_length!(length, factorise_blocks(length, diagonal, right, inverses))
    }

    /// Solves in place.
    #[inline(always)]
    pub(super) fn solve(&mut self, x: &mut [f64]) {
        let (size, length) = (self.size, self.length);
        if size == 0 {
            return;
        }
        let padded = &mut self.padded;
        padded.clear();
        for part in x.chunks_exact(size) {
            padded.extend_from_slice(part);
            padded.resize(padded.len() + length - size, 0.0);
        }
        let (diagonal, right, inverses) = (&self.diagonal, &self.right, &self.inverses);
        with_length!(
            length,
            solve_blocks(length, diagonal, right, inverses, padded)
        );
        for (part, padded) in x.chunks_exact_mut(size).zip(padded.chunks_exact(length)) {
            part.copy_from_slice(&padded[..size]);
        }
    }
}

/// `to` += `factor` · `from` for whole rows.
#[inline(always)]
fn add_row<const K: usize>(factor: f64, from: &[f64], to: &mut [f64]) {
    if K == 0 {
        axpy(factor, from, to);
    } else if let (Some(from), Some(to)) = (from.first_chunk::<K>(), to.first_chunk_mut::<K>()) {
        for i in 0..K {
            to[i] += factor * from[i];
        }
    }
}

/// `row` *= `factor`.
#[inline(always)]
fn scale_row<const K: usize>(factor: f64, row: &mut [f64]) {
    if K == 0 {
        row.iter_mut().for_each(|entry| *entry *= factor);
    } else if let Some(row) = row.first_chunk_mut::<K>() {
        for entry in row {
            *entry *= factor;
        }
    }
}

/// Adds `weight` a bᵀ to a block.
#[inline(always)]
fn add_product<const K: usize>(
    length: usize,
    block: &mut [f64],
    a: &[f64],
    b: &[f64],
    weight: f64,
) {
    let k = if K > 0 { K } else { length };
    for (row, &a) in block.chunks_exact_mut(k).zip(a) {
        add_row::<K>(weight * a, b, row);
    }
}

#[inline(always)]
fn factorise_blocks<const K: usize>(
    length: usize,
    diagonal: &mut [f64],
    right: &mut [f64],
    inverses: &mut [f64],
) -> Result<(), usize> {
    let k = if K > 0 { K } else { length };
    let square = k * k;
    for block in 0..diagonal.len() / square.max(1) {
        let (head, tail) = diagonal.split_at_mut((block + 1) * square);
        let diagonal = &mut head[block * square..];
        let inverses = &mut inverses[block * k..(block + 1) * k];
        if !cholesky::<K>(k, diagonal, inverses) {
            return Err(block);
        }
        if tail.is_empty() {
            break;
        }
        // Uᵀ Y = C, whole rows; then the next diagonal block loses Yᵀ Y.
        let right = &mut right[block * square..(block + 1) * square];
        for j in 0..k {
            let (head, tail) = right.split_at_mut((j + 1) * k);
            let row = &mut head[j * k..];
            scale_row::<K>(inverses[j], row);
            let factors = &diagonal[j * k..(j + 1) * k];
            for (other, factor) in tail.chunks_exact_mut(k).zip(&factors[j + 1..]) {
                add_row::<K>(-factor, row, other);
            }
        }
        for row in right.chunks_exact(k) {
            for (next, factor) in tail[..square].chunks_exact_mut(k).zip(row) {
                add_row::<K>(-factor, row, next);
            }
        }
    }
    Ok(())
}

/// Factorises the upper triangle of a block; `false` where a pivot is not positive.
#[inline(always)]
fn cholesky<const K: usize>(length: usize, a: &mut [f64], inverses: &mut [f64]) -> bool {
    let k = if K > 0 { K } else { length };
    let a = &mut a[..k * k];
    for (j, entry) in inverses.iter_mut().enumerate() {
        *entry = a[j * k + j];
    }
    for j in 0..k {
        let (head, tail) = a.split_at_mut((j + 1) * k);
        let row = &mut head[j * k..];
        let noise = NOISE * inverses[j];
        let pivot = if row[j].abs() < noise { noise } else { row[j] };
        if !(pivot > 0.0 && pivot.is_finite()) {
            return false;
        }
        let inverse = 1.0 / pivot.sqrt();
        inverses[j] = inverse;
        row[..=j].fill(0.0);
        scale_row::<K>(inverse, row);
        for (other, factor) in tail.chunks_exact_mut(k).zip(&row[j + 1..]) {
            add_row::<K>(-factor, row, other);
        }
    }
    true
}

#[inline(always)]
fn solve_blocks<const K: usize>(
    length: usize,
    diagonal: &[f64],
    right: &[f64],
    inverses: &[f64],
    x: &mut [f64],
) {
    let k = if K > 0 { K } else { length };
    let square = k * k;
    let blocks = x.len() / k;
    for block in 0..blocks {
        let (here, after) = x.split_at_mut((block + 1) * k);
        let here = &mut here[block * k..];
        let diagonal = &diagonal[block * square..(block + 1) * square];
        for (j, row) in diagonal.chunks_exact(k).enumerate() {
            here[j] *= inverses[block * k + j];
            add_row::<K>(-here[j], row, here);
        }
        if block + 1 < blocks {
            let right = &right[block * square..(block + 1) * square];
            for (row, &y) in right.chunks_exact(k).zip(&*here) {
                add_row::<K>(-y, row, &mut after[..k]);
            }
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
            here[j] = (here[j] - dot(row, here)) * inverses[block * k + j];
        }
    }
}
