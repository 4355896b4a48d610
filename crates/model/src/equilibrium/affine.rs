//! Affine maps y = b + S z from few unknowns to many quantities, and their
//! construction by eliminating linear equations.

/// A row of an affine map: the offset, and the entries of S.
pub(super) type Row = (f64, Vec<(usize, f64)>);

/// y = b + S z with a sparse S, row by row.
#[derive(Clone, Debug, Default)]
pub(super) struct AffineMap {
    offsets: Vec<f64>,
    starts: Vec<usize>,
    entries: Vec<(usize, f64)>,
}

impl AffineMap {
    pub(super) fn from_rows(rows: impl IntoIterator<Item = Row>) -> Self {
        let mut map = Self {
            starts: vec![0],
            ..Self::default()
        };
        for (offset, entries) in rows {
            map.offsets.push(offset);
            map.entries.extend(entries);
            map.starts.push(map.entries.len());
        }
        map
    }

    /// The entries of S in row i.
    #[inline]
    pub(super) fn row(&self, i: usize) -> &[(usize, f64)] {
        &self.entries[self.starts[i]..self.starts[i + 1]]
    }

    /// Row i as [`Self::from_rows`] takes it.
    pub(super) fn owned_row(&self, i: usize) -> Row {
        (self.offsets[i], self.row(i).to_vec())
    }

    /// The offset b of row i.
    pub(super) fn offset(&self, i: usize) -> f64 {
        self.offsets[i]
    }

    /// Whether two rows have the same value everywhere.
    pub(super) fn are_equal(&self, i: usize, j: usize) -> bool {
        self.offsets[i] == self.offsets[j] && self.row(i) == self.row(j)
    }

    /// The value of row i at z.
    #[inline]
    pub(super) fn value(&self, i: usize, z: &[f64]) -> f64 {
        self.row(i)
            .iter()
            .fold(self.offsets[i], |sum, &(j, c)| sum + c * z[j])
    }
}

/// An affine map of which all rows are evaluated together: most have one entry or
/// none, and a loop for each would cost more than the entries.
#[derive(Clone, Debug, Default)]
pub(super) struct AffineSums {
    offsets: Vec<f64>,
    /// Row, column and coefficient.
    terms: Vec<(u32, u32, f64)>,
}

impl AffineSums {
    pub(super) fn from_rows(rows: impl IntoIterator<Item = Row>) -> Self {
        let mut sums = Self::default();
        for (i, (offset, entries)) in rows.into_iter().enumerate() {
            sums.offsets.push(offset);
            let terms = entries.into_iter().map(|(j, c)| (i as u32, j as u32, c));
            sums.terms.extend(terms);
        }
        sums
    }

    /// Number of rows.
    pub(super) fn len(&self) -> usize {
        self.offsets.len()
    }

    /// The values of all rows at z.
    #[inline]
    pub(super) fn values(&self, z: &[f64], values: &mut [f64]) {
        values.copy_from_slice(&self.offsets);
        self.add_changes(z, values);
    }

    /// Adds S z to the values of all rows.
    #[inline]
    pub(super) fn add_changes(&self, z: &[f64], values: &mut [f64]) {
        for &(i, j, c) in &self.terms {
            values[i as usize] += c * z[j as usize];
        }
    }
}

/// Linear equations Σ aⱼ yⱼ = b in reduced form: each dependent variable is an
/// affine function of the free ones.
#[derive(Debug)]
pub(super) struct Elimination {
    variables: usize,
    /// One equation a row; the last column is the right-hand side.
    rows: Vec<Vec<f64>>,
    /// The variable that each row determines.
    pivots: Vec<usize>,
}

/// Coefficients below this (relative to one) count as zero.
const NEGLIGIBLE: f64 = 1e-12;

impl Elimination {
    pub(super) fn new(variables: usize) -> Self {
        Self {
            variables,
            rows: Vec::new(),
            pivots: Vec::new(),
        }
    }

    /// Adds Σ aⱼ yⱼ = b. Returns the contradiction's size if the equation
    /// contradicts those before it.
    pub(super) fn add(&mut self, terms: &[(usize, f64)], b: f64) -> Result<(), f64> {
        let mut row = vec![0.0; self.variables + 1];
        for &(j, a) in terms {
            row[j] += a;
        }
        row[self.variables] = b;
        let size = row[..self.variables]
            .iter()
            .fold(0.0_f64, |s, v| s.max(v.abs()));
        if size == 0.0 {
            return Ok(());
        }
        for (other, &pivot) in self.rows.iter().zip(&self.pivots) {
            let factor = row[pivot];
            if factor != 0.0 {
                row.iter_mut()
                    .zip(other)
                    .for_each(|(x, y)| *x -= factor * y);
                row[pivot] = 0.0;
            }
        }
        // Determine the last-declared variable, so that earlier nodes stay free.
        let largest = row[..self.variables]
            .iter()
            .fold(0.0_f64, |s, v| s.max(v.abs()));
        if largest <= NEGLIGIBLE * size {
            let rest = row[self.variables].abs();
            return if rest > 1e-9 * size.max(b.abs()) {
                Err(rest)
            } else {
                Ok(())
            };
        }
        let Some(pivot) = (0..self.variables)
            .rev()
            .find(|&j| row[j].abs() > 0.5 * largest)
        else {
            return Ok(());
        };
        let scale = 1.0 / row[pivot];
        row.iter_mut().for_each(|x| *x *= scale);
        for x in row[..self.variables].iter_mut() {
            if x.abs() < NEGLIGIBLE {
                *x = 0.0;
            }
        }
        for other in &mut self.rows {
            let factor = other[pivot];
            if factor != 0.0 {
                other
                    .iter_mut()
                    .zip(&row)
                    .for_each(|(x, y)| *x -= factor * y);
                other[pivot] = 0.0;
            }
        }
        self.rows.push(row);
        self.pivots.push(pivot);
        Ok(())
    }

    /// The variable's determining row, unless it is free.
    pub(super) fn row_of(&self, variable: usize) -> Option<Row> {
        let i = self.pivots.iter().position(|&p| p == variable)?;
        let row = &self.rows[i];
        let entries = (0..self.variables)
            .filter(|&j| j != variable && row[j].abs() > NEGLIGIBLE)
            .map(|j| (j, -row[j]))
            .collect();
        Some((row[self.variables], entries))
    }
}
