//! What an implicit manifold is to this crate.

/// The positions of the entries of a sparse matrix, row by row.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SparsityPattern {
    columns: usize,
    row_starts: Vec<usize>,
    column_indices: Vec<usize>,
}

impl SparsityPattern {
    /// The pattern of a matrix with the given number of columns, whose i-th row
    /// has entries in the columns `rows[i]`, in that order.
    ///
    /// # Panics
    /// When a row names a column that is out of range, or one column twice.
    pub fn from_rows(columns: usize, rows: &[Vec<usize>]) -> Self {
        let mut row_starts = Vec::with_capacity(rows.len() + 1);
        let mut column_indices = Vec::new();
        let mut seen = vec![usize::MAX; columns];
        row_starts.push(0);
        for (i, row) in rows.iter().enumerate() {
            for &column in row {
                assert!(
                    column < columns,
                    "row {i} names column {column} of {columns}"
                );
                assert!(seen[column] != i, "row {i} names column {column} twice");
                seen[column] = i;
                column_indices.push(column);
            }
            row_starts.push(column_indices.len());
        }
        Self {
            columns,
            row_starts,
            column_indices,
        }
    }

    /// The pattern of a full matrix, row by row.
    pub fn dense(rows: usize, columns: usize) -> Self {
        Self::from_rows(columns, &vec![(0..columns).collect(); rows])
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.row_starts.len() - 1
    }

    /// Number of columns.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Number of entries.
    pub fn len(&self) -> usize {
        self.column_indices.len()
    }

    /// Whether there is no entry at all.
    pub fn is_empty(&self) -> bool {
        self.column_indices.is_empty()
    }

    /// Where the entries of a row stand in the array of values.
    #[inline]
    pub fn row_range(&self, row: usize) -> std::ops::Range<usize> {
        self.row_starts[row]..self.row_starts[row + 1]
    }

    /// The columns of the entries of a row.
    #[inline]
    pub fn row(&self, row: usize) -> &[usize] {
        &self.column_indices[self.row_range(row)]
    }

    /// Position in the array of values of the entry (`row`, `column`), if there is one.
    pub fn find(&self, row: usize, column: usize) -> Option<usize> {
        let range = self.row_range(row);
        let start = range.start;
        self.column_indices[range]
            .iter()
            .position(|&c| c == column)
            .map(|k| start + k)
    }
}

/// A sparse row that is filled again and again: the gradient of one inequality.
/// A column may occur more than once; its entries add up.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SparseRow {
    entries: Vec<(usize, f64)>,
}

impl SparseRow {
    /// Removes all entries and keeps the memory.
    pub fn clear(&mut self) {
        self.entries.clear();
    }

    /// Adds `value` at `column`.
    pub fn add(&mut self, column: usize, value: f64) {
        self.entries.push((column, value));
    }

    /// The entries in the order in which they were added.
    pub fn entries(&self) -> &[(usize, f64)] {
        &self.entries
    }

    /// Inner product with a dense vector.
    pub fn dot(&self, x: &[f64]) -> f64 {
        self.entries
            .iter()
            .map(|&(column, value)| value * x[column])
            .sum()
    }
}

/// The set of x ∈ ℝᵐ with F(x) = 0, F: ℝᵐ → ℝⁿ smooth, and within it the valid
/// part where x lies within its bounds and every limit g(x) ≥ 0 holds.
///
/// The equations may be redundant as long as they are consistent: at the points
/// of the manifold the Jacobian has the same rank m − k everywhere but on a
/// singular set, and k is the dimension of the manifold.
///
/// Distances are Euclidean in x: scale the variables so that a unit step means
/// about as much in each of them.
pub trait ImplicitManifold: Sync {
    /// Number m of variables.
    fn ambient_dimension(&self) -> usize;

    /// Number n of equations, redundant ones included.
    fn equation_count(&self) -> usize;

    /// Writes F(x) (n values).
    fn residual(&self, x: &[f64], residual: &mut [f64]);

    /// Where the Jacobian ∂F/∂x may differ from zero.
    fn jacobian_pattern(&self) -> &SparsityPattern;

    /// Writes the entries of ∂F/∂x at x, in the order of the pattern.
    fn jacobian(&self, x: &[f64], values: &mut [f64]);

    /// Lower bound of every variable (m values, −∞ where there is none).
    fn lower_bounds(&self) -> &[f64];

    /// Upper bound of every variable (m values, +∞ where there is none).
    fn upper_bounds(&self) -> &[f64];

    /// Number of limits g(x) ≥ 0 beyond the bounds of the variables: ranges of
    /// derived quantities.
    fn limit_count(&self) -> usize {
        0
    }

    /// Writes the values g(x) of all limits, scaled so that their gradients are
    /// of the order of one.
    fn limits(&self, x: &[f64], values: &mut [f64]) {
        let _ = (x, values);
    }

    /// The value g(x) of one limit.
    fn limit(&self, limit: usize, x: &[f64]) -> f64 {
        let mut values = vec![0.0; self.limit_count()];
        self.limits(x, &mut values);
        values[limit]
    }

    /// Adds the gradient of the limit with the given index to `row`.
    fn limit_gradient(&self, limit: usize, x: &[f64], row: &mut SparseRow) {
        let _ = (limit, x, row);
    }

    /// Name of a limit for messages.
    fn limit_name(&self, limit: usize) -> String {
        format!("limit {limit}")
    }

    /// Name of a variable for messages.
    fn variable_name(&self, variable: usize) -> String {
        format!("x{variable}")
    }
}
