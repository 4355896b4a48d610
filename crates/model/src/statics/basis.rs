//! Orthonormal bases of small spaces.

use nalgebra::DMatrix;

/// An orthonormal basis of the span of `columns`: Gram–Schmidt with pivoting,
/// every column orthogonalised twice. Columns of which less than `tolerance`
/// times the longest remains depend on the others. Cost: 4 n c² for n × c.
pub(super) fn span(mut columns: DMatrix<f64>, tolerance: f64) -> DMatrix<f64> {
    let count = columns.ncols();
    let longest = (0..count)
        .map(|j| columns.column(j).norm())
        .fold(0.0, f64::max);
    let mut rank = 0;
    while rank < count {
        let norms = (rank..count).map(|j| (j, columns.column(j).norm()));
        let Some((pivot, norm)) = norms.max_by(|a, b| a.1.total_cmp(&b.1)) else {
            break;
        };
        if !(norm > tolerance * longest) {
            break;
        }
        columns.swap_columns(rank, pivot);
        // Once more against what is there already: the first time left rounding.
        let (before, mut after) = columns.columns_range_pair_mut(..rank, rank..);
        for done in before.column_iter() {
            let share = done.dot(&after.column(0));
            after.column_mut(0).axpy(-share, &done, 1.0);
        }
        let norm = after.column(0).norm();
        after.column_mut(0).unscale_mut(norm);
        let (unit, mut rest) = after.columns_range_pair_mut(0, 1..);
        for mut column in rest.column_iter_mut() {
            let share = unit.dot(&column);
            column.axpy(-share, &unit, 1.0);
        }
        rank += 1;
    }
    columns.columns(0, rank).into_owned()
}

/// An orthonormal basis of the vectors orthogonal to `basis`, which has
/// orthonormal columns. Cost: 4 n³ / 3.
pub(super) fn complement(basis: &DMatrix<f64>) -> DMatrix<f64> {
    let (n, c) = basis.shape();
    if c == 0 {
        return DMatrix::identity(n, n);
    }
    // The orthogonal factor of the basis, padded to a square, begins with the basis.
    let mut padded = DMatrix::zeros(n, n);
    padded.columns_mut(0, c).copy_from(basis);
    padded.qr().q().columns(c, n - c).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn span_drops_what_depends_and_complement_is_the_rest() {
        let columns = DMatrix::from_column_slice(
            4,
            3,
            &[1.0, 2.0, 0.0, 1.0, 2.0, 4.0, 0.0, 2.0, 0.0, 1.0, 3.0, -1.0],
        );
        let basis = span(columns.clone(), 1e-10);
        assert_eq!(basis.ncols(), 2);
        let rest = complement(&basis);
        assert_eq!(rest.ncols(), 2);
        let mut all = DMatrix::zeros(4, 4);
        all.columns_mut(0, 2).copy_from(&basis);
        all.columns_mut(2, 2).copy_from(&rest);
        assert!((all.transpose() * &all - DMatrix::identity(4, 4)).norm() < 1e-14);
        assert!((rest.transpose() * columns).norm() < 1e-14);
        assert_eq!(complement(&DMatrix::zeros(3, 0)), DMatrix::identity(3, 3));
        assert_eq!(span(DMatrix::zeros(3, 2), 1e-10).ncols(), 0);
    }
}
