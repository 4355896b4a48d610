//! The dense dual active-set method on quadratic programmes with known solutions, on random ones
//! judged by their optimality conditions, and on degenerate, redundant and contradictory ones.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use tensegra_optim::{DenseQp, DenseQpError, DenseQpSolver, QpConstraint, QpStatus, Side};

const INF: f64 = f64::INFINITY;

fn qp(hessian: &[&[f64]], gradient: &[f64]) -> DenseQp {
    let mut qp = DenseQp::new(gradient.len());
    for (i, row) in hessian.iter().enumerate() {
        for (j, &value) in row.iter().enumerate() {
            qp.set_hessian(i, j, value);
        }
    }
    qp.gradient_mut().copy_from_slice(gradient);
    qp
}

fn identity(n: usize) -> DenseQp {
    let mut qp = DenseQp::new(n);
    for i in 0..n {
        qp.set_hessian(i, i, 1.0);
    }
    qp
}

fn assert_close(found: &[f64], expected: &[f64], tolerance: f64) {
    assert_eq!(found.len(), expected.len());
    for (f, e) in found.iter().zip(expected) {
        assert!((f - e).abs() <= tolerance, "{found:?} against {expected:?}");
    }
}

fn solve(qp: &DenseQp) -> (DenseQpSolver, f64) {
    let mut solver = DenseQpSolver::new();
    let report = solver.solve(qp).expect("valid data");
    assert_eq!(report.status, QpStatus::Solved);
    assert!(report.residuals.infeasibility < 1e-9, "{report:?}");
    assert!(report.residuals.relative_stationarity < 1e-9, "{report:?}");
    assert!(report.residuals.complementarity < 1e-8, "{report:?}");
    (solver, report.objective)
}

/// The example of Goldfarb and Idnani's paper as distributed with R's quadprog package.
#[test]
fn three_variables_three_inequalities() {
    let mut qp = identity(3);
    qp.gradient_mut().copy_from_slice(&[0.0, -5.0, 0.0]);
    qp.push_at_least(&[-4.0, -3.0, 0.0], -8.0);
    qp.push_at_least(&[2.0, 1.0, 0.0], 2.0);
    qp.push_at_least(&[0.0, -2.0, 1.0], 0.0);
    let (solver, objective) = solve(&qp);
    assert_close(
        solver.solution(),
        &[10.0 / 21.0, 22.0 / 21.0, 44.0 / 21.0],
        1e-12,
    );
    assert_close(&[objective], &[-50.0 / 21.0], 1e-12);
}

/// Hock and Schittkowski's problem 21.
#[test]
fn hock_schittkowski_21() {
    let mut qp = qp(&[&[0.02, 0.0], &[0.0, 2.0]], &[0.0, 0.0]);
    qp.push_at_least(&[10.0, -1.0], 10.0);
    qp.set_bounds(0, 2.0, 50.0);
    qp.set_bounds(1, -50.0, 50.0);
    let (solver, objective) = solve(&qp);
    assert_close(solver.solution(), &[2.0, 0.0], 1e-12);
    assert_close(&[objective - 100.0], &[-99.96], 1e-12);
    assert_eq!(solver.active_set().len(), 1);
    assert_eq!(solver.active_set()[0].constraint, QpConstraint::Bound(0));
    assert_eq!(solver.active_set()[0].side, Side::Lower);
    assert_close(solver.bound_multipliers(), &[-0.04, 0.0], 1e-12);
}

/// Hock and Schittkowski's problem 35.
#[test]
fn hock_schittkowski_35() {
    let mut qp = qp(
        &[&[4.0, 2.0, 2.0], &[2.0, 4.0, 0.0], &[2.0, 0.0, 2.0]],
        &[-8.0, -6.0, -4.0],
    );
    qp.push_range(&[1.0, 1.0, 2.0], -INF, 3.0);
    for j in 0..3 {
        qp.set_bounds(j, 0.0, INF);
    }
    let (solver, objective) = solve(&qp);
    assert_close(solver.solution(), &[4.0 / 3.0, 7.0 / 9.0, 4.0 / 9.0], 1e-12);
    assert_close(&[objective + 9.0], &[1.0 / 9.0], 1e-12);
}

/// Hock and Schittkowski's problem 76.
#[test]
fn hock_schittkowski_76() {
    let mut qp = qp(
        &[
            &[2.0, 0.0, -1.0, 0.0],
            &[0.0, 1.0, 0.0, 0.0],
            &[-1.0, 0.0, 2.0, 1.0],
            &[0.0, 0.0, 1.0, 1.0],
        ],
        &[-1.0, -3.0, 1.0, -1.0],
    );
    qp.push_range(&[1.0, 2.0, 1.0, 1.0], -INF, 5.0);
    qp.push_range(&[3.0, 1.0, 2.0, -1.0], -INF, 4.0);
    qp.push_at_least(&[0.0, 1.0, 4.0, 0.0], 1.5);
    for j in 0..4 {
        qp.set_bounds(j, 0.0, INF);
    }
    let (solver, objective) = solve(&qp);
    assert_close(&[objective], &[-4.681_818_181_818_182], 1e-12);
    assert_close(
        solver.solution(),
        &[0.272_727_272_727, 2.090_909_090_909, 0.0, 0.545_454_545_455],
        1e-11,
    );
}

/// Hock and Schittkowski's problem 118: 15 variables, 29 rows, a degenerate vertex region.
#[test]
fn hock_schittkowski_118() {
    let mut qp = DenseQp::new(15);
    for k in 0..5 {
        let (a, b, c) = (3 * k, 3 * k + 1, 3 * k + 2);
        qp.set_hessian(a, a, 2e-4);
        qp.set_hessian(b, b, 2e-4);
        qp.set_hessian(c, c, 3e-4);
        qp.gradient_mut()[a] = 2.3;
        qp.gradient_mut()[b] = 1.7;
        qp.gradient_mut()[c] = 2.2;
        qp.set_bounds(a, 0.0, 90.0);
        qp.set_bounds(b, 0.0, 120.0);
        qp.set_bounds(c, 0.0, 60.0);
    }
    qp.set_bounds(0, 8.0, 21.0);
    qp.set_bounds(1, 43.0, 57.0);
    qp.set_bounds(2, 3.0, 16.0);
    for k in 1..5 {
        for (offset, upper) in [(0, 6.0), (1, 7.0), (2, 6.0)] {
            let mut row = [0.0; 15];
            row[3 * k + offset] = 1.0;
            row[3 * k + offset - 3] = -1.0;
            qp.push_range(&row, -7.0, upper);
        }
    }
    for (k, total) in [60.0, 50.0, 70.0, 85.0, 100.0].into_iter().enumerate() {
        let mut row = [0.0; 15];
        row[3 * k..3 * k + 3].fill(1.0);
        qp.push_at_least(&row, total);
    }
    let (solver, objective) = solve(&qp);
    assert_close(&[objective], &[664.820_450], 1e-6);
    assert_close(
        solver.solution(),
        &[
            8.0, 49.0, 3.0, 1.0, 56.0, 0.0, 1.0, 63.0, 6.0, 3.0, 70.0, 12.0, 5.0, 77.0, 18.0,
        ],
        1e-9,
    );
}

fn random_qp(generator: &mut Pcg64, n: usize, m: usize) -> DenseQp {
    let mut uniform = || generator.random_range(-1.0..1.0);
    let mut qp = DenseQp::new(n);
    let factor: Vec<f64> = (0..n * n).map(|_| uniform()).collect();
    for i in 0..n {
        for j in 0..=i {
            let sum: f64 = (0..n).map(|k| factor[i * n + k] * factor[j * n + k]).sum();
            qp.set_hessian(i, j, sum + if i == j { 0.01 } else { 0.0 });
        }
    }
    for g in qp.gradient_mut() {
        *g = 10.0 * uniform();
    }
    // Rows that a known point meets, some of them with nothing to spare.
    let inside: Vec<f64> = (0..n).map(|_| uniform()).collect();
    for i in 0..m {
        let row: Vec<f64> = (0..n).map(|_| uniform()).collect();
        let value: f64 = row.iter().zip(&inside).map(|(a, b)| a * b).sum();
        match i % 4 {
            0 if i < n => qp.push_equality(&row, value),
            1 => qp.push_at_least(&row, value),
            2 => qp.push_range(&row, value - 0.3, value + 0.2),
            _ => qp.push_range(&row, -INF, value + 0.1),
        }
    }
    for (j, &value) in inside.iter().enumerate().filter(|(j, _)| j % 2 == 0) {
        qp.set_bounds(j, value - 0.1, value + 0.1);
    }
    qp
}

#[test]
fn random_programmes_meet_their_optimality_conditions() {
    let mut generator = Pcg64::seed_from_u64(1);
    for n in [1, 2, 5, 9, 16, 30] {
        for m in [0, 1, 6, 40, 200] {
            for _ in 0..4 {
                solve(&random_qp(&mut generator, n, m));
            }
        }
    }
}

#[test]
fn a_warm_start_finds_the_same_solution_faster() {
    let mut generator = Pcg64::seed_from_u64(2);
    let (mut cold_changes, mut warm_changes) = (0, 0);
    for _ in 0..20 {
        let mut qp = random_qp(&mut generator, 12, 60);
        let mut warm = DenseQpSolver::new();
        warm.solve(&qp).unwrap();
        for g in qp.gradient_mut() {
            *g += 0.1;
        }
        let mut cold = DenseQpSolver::new();
        cold_changes += cold.solve(&qp).unwrap().iterations;
        warm_changes += warm.solve_warm(&qp).unwrap().iterations;
        assert_close(warm.solution(), cold.solution(), 1e-8);
    }
    assert!(
        4 * warm_changes < cold_changes,
        "{warm_changes} changes warm, {cold_changes} cold"
    );
}

#[test]
fn a_useless_guess_does_no_harm() {
    let mut generator = Pcg64::seed_from_u64(3);
    let mut solver = DenseQpSolver::new();
    for n in [8, 3, 12, 5] {
        let qp = random_qp(&mut generator, n, 20);
        let report = solver.solve_warm(&qp).unwrap();
        assert_eq!(report.status, QpStatus::Solved);
        assert!(report.residuals.infeasibility < 1e-9);
        assert!(report.residuals.relative_stationarity < 1e-9);
    }
}

/// Forty half-spaces through one vertex, each given twice: only n of them are independent.
#[test]
fn a_degenerate_vertex_with_duplicated_constraints() {
    let mut generator = Pcg64::seed_from_u64(4);
    for n in [2, 3, 6] {
        let mut qp = identity(n);
        qp.gradient_mut().fill(-3.0);
        let mut outward: Vec<Vec<f64>> = Vec::new();
        for _ in 0..40 {
            // Normals within a cone about (1, …, 1): the vertex (1, …, 1) is optimal.
            outward.push(
                (0..n)
                    .map(|_| 1.0 + generator.random_range(-0.9..0.9))
                    .collect(),
            );
        }
        for j in 0..n {
            let mut axis = vec![0.0; n];
            axis[j] = 1.0;
            outward.push(axis);
        }
        for normal in outward.iter().chain(&outward) {
            qp.push_range(normal, -INF, normal.iter().sum());
        }
        let (solver, _) = solve(&qp);
        assert_close(solver.solution(), &vec![1.0; n], 1e-10);
        assert!(solver.active_set().len() <= n);
    }
}

#[test]
fn redundant_equalities_are_accepted() {
    let mut qp = identity(3);
    qp.push_equality(&[1.0, 1.0, 1.0], 3.0);
    qp.push_equality(&[2.0, 2.0, 2.0], 6.0);
    qp.push_equality(&[1.0, -1.0, 0.0], 0.0);
    qp.push_equality(&[2.0, 0.0, 1.0], 3.0);
    qp.push_range(&[1.0, 1.0, 1.0], 3.0, 4.0);
    let (solver, _) = solve(&qp);
    assert_close(solver.solution(), &[1.0; 3], 1e-12);
}

#[test]
fn fixed_variables_are_equalities() {
    let mut qp = identity(3);
    qp.set_bounds(1, 2.0, 2.0);
    qp.push_equality(&[1.0, 1.0, 1.0], 0.0);
    let (solver, _) = solve(&qp);
    assert_close(solver.solution(), &[-1.0, 2.0, -1.0], 1e-12);
}

#[test]
fn contradictions_are_named() {
    let mut qp = identity(2);
    qp.push_at_least(&[1.0, 0.0], -5.0);
    qp.push_at_least(&[1.0, 1.0], 2.0);
    qp.push_range(&[1.0, 0.0], -INF, 0.5);
    qp.push_range(&[0.0, 1.0], -INF, 1.0);
    let mut solver = DenseQpSolver::new();
    let report = solver.solve(&qp).unwrap();
    assert_eq!(report.status, QpStatus::Infeasible);
    let mut conflict = solver.conflict().to_vec();
    conflict.sort_by_key(|c| format!("{c:?}"));
    assert_eq!(
        conflict,
        [
            QpConstraint::Row(1),
            QpConstraint::Row(2),
            QpConstraint::Row(3)
        ]
    );
}

#[test]
fn contradictory_equalities_are_named() {
    let mut qp = identity(2);
    qp.push_equality(&[1.0, 1.0], 1.0);
    qp.push_equality(&[1.0, 0.0], 1.0);
    qp.push_equality(&[1.0, 1.0], 1.0 + 1e-6);
    let mut solver = DenseQpSolver::new();
    assert_eq!(solver.solve(&qp).unwrap().status, QpStatus::Infeasible);
    assert_eq!(
        solver.conflict(),
        [QpConstraint::Row(2), QpConstraint::Row(0)]
    );
}

#[test]
fn an_empty_row_contradicts_by_itself() {
    let mut qp = identity(2);
    qp.push_at_least(&[0.0, 0.0], 1.0);
    let mut solver = DenseQpSolver::new();
    assert_eq!(solver.solve(&qp).unwrap().status, QpStatus::Infeasible);
    assert_eq!(solver.conflict(), [QpConstraint::Row(0)]);
}

#[test]
fn bad_data_are_errors() {
    let mut solver = DenseQpSolver::new();
    let indefinite = qp(&[&[1.0, 2.0], &[2.0, 1.0]], &[0.0, 0.0]);
    assert!(matches!(
        solver.solve(&indefinite),
        Err(DenseQpError::NotPositiveDefinite { pivot: 1, .. })
    ));
    let mut crossed = identity(2);
    crossed.set_bounds(1, 1.0, 0.0);
    assert!(matches!(
        solver.solve(&crossed),
        Err(DenseQpError::ContradictoryBounds {
            constraint: QpConstraint::Bound(1),
            ..
        })
    ));
    let mut nan = identity(2);
    nan.gradient_mut()[0] = f64::NAN;
    assert!(matches!(
        solver.solve(&nan),
        Err(DenseQpError::NotFinite { what: "gradient" })
    ));
}

#[test]
fn scaling_of_variables_and_rows_changes_nothing() {
    let mut generator = Pcg64::seed_from_u64(5);
    let n = 6;
    for _ in 0..10 {
        let normals: Vec<Vec<f64>> = (0..15)
            .map(|_| (0..n).map(|_| generator.random_range(-1.0..1.0)).collect())
            .collect();
        let scales: Vec<f64> = (0..n).map(|j| 10.0_f64.powi(j as i32 - 3)).collect();
        let (mut plain, mut scaled) = (identity(n), DenseQp::new(n));
        for (j, scale) in scales.iter().enumerate() {
            plain.gradient_mut()[j] = 5.0;
            scaled.gradient_mut()[j] = 5.0 * scale;
            scaled.set_hessian(j, j, scale * scale);
        }
        for (i, normal) in normals.iter().enumerate() {
            plain.push_at_least(normal, -1.0);
            let factor = 10.0_f64.powi(i as i32 % 5 - 2);
            let row: Vec<f64> = normal
                .iter()
                .zip(&scales)
                .map(|(a, s)| factor * a * s)
                .collect();
            scaled.push_at_least(&row, -factor);
        }
        let mut solver = DenseQpSolver::new();
        solver.solve(&plain).unwrap();
        let expected = solver.solution().to_vec();
        assert_eq!(solver.solve(&scaled).unwrap().status, QpStatus::Solved);
        for ((x, scale), expected) in solver.solution().iter().zip(&scales).zip(&expected) {
            assert!(
                (x * scale - expected).abs() < 1e-7,
                "{x} {scale} {expected}"
            );
        }
    }
}
