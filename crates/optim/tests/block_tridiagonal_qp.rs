//! The interior-point method on chains of blocks: closed forms, optimality conditions of random
//! programmes, agreement with the dense active-set method, and refused data.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use tensegra_optim::{
    BlockTridiagonalQp, BlockTridiagonalQpError, BlockTridiagonalQpSolver,
    BlockTridiagonalQpStatus, DenseQp, DenseQpSolver, QpStatus,
};

const INF: f64 = f64::INFINITY;

/// One row of a random programme.
struct Row {
    block: usize,
    coefficients: Vec<f64>,
    at_least: f64,
}

/// A random programme with its dense Hessian.
struct Random {
    qp: BlockTridiagonalQp,
    hessian: Vec<Vec<f64>>,
    gradient: Vec<f64>,
    rows: Vec<Row>,
}

/// H = Bᵀ B + I with B block bidiagonal, so that H is block-tridiagonal.
fn random(seed: u64, blocks: usize, k: usize, rows: usize, price: f64, bound: f64) -> Random {
    let mut random = Pcg64::seed_from_u64(seed);
    let n = blocks * k;
    let mut factor = vec![vec![0.0; n]; n];
    for i in 0..n {
        let block = i / k;
        for j in block * k..((block + 2) * k).min(n) {
            factor[i][j] = random.random_range(-1.0..1.0);
        }
    }
    let mut hessian = vec![vec![0.0; n]; n];
    for i in 0..n {
        for j in 0..n {
            hessian[i][j] = (0..n).map(|l| factor[l][i] * factor[l][j]).sum::<f64>()
                + f64::from(u8::from(i == j));
        }
    }
    let mut qp = BlockTridiagonalQp::new(blocks, k);
    for block in 0..blocks {
        for i in 0..k {
            for j in 0..k {
                qp.diagonal_mut(block)[i * k + j] = hessian[block * k + i][block * k + j];
                if block + 1 < blocks {
                    qp.coupling_mut(block)[i * k + j] = hessian[(block + 1) * k + i][block * k + j];
                }
            }
        }
    }
    let gradient: Vec<f64> = (0..n).map(|_| random.random_range(-3.0..3.0)).collect();
    for block in 0..blocks {
        qp.gradient_mut(block)
            .copy_from_slice(&gradient[block * k..(block + 1) * k]);
    }
    if bound.is_finite() {
        qp.set_box(-bound, bound);
    }
    let rows: Vec<Row> = (0..rows)
        .map(|i| {
            let spans = 1 + i % 2;
            let block = random.random_range(0..=blocks - spans);
            Row {
                block,
                coefficients: (0..spans * k)
                    .map(|_| random.random_range(-1.0..1.0))
                    .collect(),
                at_least: random.random_range(-0.3..0.2),
            }
        })
        .collect();
    for row in &rows {
        qp.push_row(row.block, &row.coefficients, row.at_least, price);
    }
    Random {
        qp,
        hessian,
        gradient,
        rows,
    }
}

#[test]
fn solutions_meet_the_optimality_conditions() {
    for seed in 0..40 {
        let k = [1, 2, 3, 4, 6, 11, 15, 26][seed as usize % 8];
        let blocks = 1 + seed as usize % if k > 8 { 4 } else { 9 };
        let price = [0.3, 3.0, 1e3][seed as usize % 3];
        let rows = if blocks == 1 { 0 } else { 25 };
        let made = random(seed, blocks, k, rows, price, 0.7);
        let mut solver = BlockTridiagonalQpSolver::new().tolerance(1e-10);
        let report = solver.solve(&made.qp).unwrap();
        assert_eq!(report.status, BlockTridiagonalQpStatus::Solved, "{seed}");
        assert!(report.iterations < 30, "{seed}: {report:?}");
        let t = solver.solution();
        let mut residual: Vec<f64> = made
            .hessian
            .iter()
            .zip(&made.gradient)
            .zip(solver.bound_multipliers())
            .map(|((row, g), z)| row.iter().zip(t).map(|(h, t)| h * t).sum::<f64>() + g - z)
            .collect();
        for (row, &multiplier) in made.rows.iter().zip(solver.row_multipliers()) {
            let value: f64 = row
                .coefficients
                .iter()
                .enumerate()
                .map(|(i, a)| {
                    residual[row.block * k + i] -= multiplier * a;
                    a * t[row.block * k + i]
                })
                .sum();
            let above = value - row.at_least;
            assert!(multiplier > -1e-9 && multiplier < price + 1e-9);
            // Above its bound a row has no multiplier, below it the whole price.
            assert!(above < 1e-5 || multiplier < 1e-5 * price.max(1.0), "{seed}");
            assert!(above > -1e-5 || multiplier > price * (1.0 - 1e-4), "{seed}");
        }
        for (r, (t, z)) in residual
            .iter()
            .zip(t.iter().zip(solver.bound_multipliers()))
        {
            assert!(r.abs() < 1e-6, "{seed}: {residual:?}");
            assert!(t.abs() <= 0.7);
            assert!((t + 0.7) < 1e-5 || *z < 1e-5);
            assert!((0.7 - t) < 1e-5 || *z > -1e-5);
        }
    }
}

#[test]
fn rows_of_infinite_price_agree_with_the_active_set_method() {
    for seed in 100..120 {
        let (blocks, k) = (5, 3);
        let mut made = random(seed, blocks, k, 12, INF, INF);
        // Keep the origin feasible, so that there is a solution.
        made.qp.clear_rows();
        let mut dense = DenseQp::new(blocks * k);
        for i in 0..blocks * k {
            for j in 0..=i {
                dense.set_hessian(i, j, made.hessian[i][j]);
            }
        }
        dense.gradient_mut().copy_from_slice(&made.gradient);
        for row in &mut made.rows {
            row.at_least = -row.at_least.abs();
            made.qp
                .push_row(row.block, &row.coefficients, row.at_least, INF);
            let mut full = vec![0.0; blocks * k];
            full[row.block * k..row.block * k + row.coefficients.len()]
                .copy_from_slice(&row.coefficients);
            dense.push_at_least(&full, row.at_least);
        }
        let mut reference = DenseQpSolver::new();
        assert_eq!(reference.solve(&dense).unwrap().status, QpStatus::Solved);
        let mut solver = BlockTridiagonalQpSolver::new().tolerance(1e-11);
        let report = solver.solve(&made.qp).unwrap();
        assert_eq!(report.status, BlockTridiagonalQpStatus::Solved);
        assert!(report.infeasibility < 1e-9, "{report:?}");
        for (a, b) in solver.solution().iter().zip(reference.solution()) {
            assert!((a - b).abs() < 1e-5, "{seed}: {a} {b}");
        }
    }
}

#[test]
fn contradictory_rows_of_infinite_price_stall_and_priced_ones_are_shared() {
    let mut qp = BlockTridiagonalQp::new(1, 1);
    qp.diagonal_mut(0)[0] = 1.0;
    qp.push_row(0, &[1.0], 1.0, INF);
    qp.push_row(0, &[-1.0], 1.0, INF);
    let mut solver = BlockTridiagonalQpSolver::new();
    let report = solver.solve(&qp).unwrap();
    assert_eq!(report.status, BlockTridiagonalQpStatus::Stalled);
    assert!(report.infeasibility > 0.9);
    // At a price of 10 each, any t between −1 and 1 costs 20; the Hessian decides for 0.
    qp.clear_rows();
    qp.push_row(0, &[1.0], 1.0, 10.0);
    qp.push_row(0, &[-1.0], 1.0, 10.0);
    let report = solver.solve(&qp).unwrap();
    assert_eq!(report.status, BlockTridiagonalQpStatus::Solved);
    assert!(solver.solution()[0].abs() < 1e-6);
    assert!((report.objective - 20.0).abs() < 1e-5);
}

#[test]
fn a_long_chain_takes_no_more_iterations_than_a_short_one() {
    // An obstacle problem: a string from 0 to 0 above a bump.
    let iterations = |n: usize| {
        let mut qp = BlockTridiagonalQp::new(n, 1);
        let h = 1.0 / (n + 1) as f64;
        for i in 0..n {
            qp.diagonal_mut(i)[0] = 2.0 / h;
            if i + 1 < n {
                qp.coupling_mut(i)[0] = -1.0 / h;
            }
            let x = (i + 1) as f64 * h;
            qp.push_row(i, &[1.0], 0.5 - 4.0 * (x - 0.5) * (x - 0.5), 100.0);
        }
        let mut solver = BlockTridiagonalQpSolver::new();
        let report = solver.solve(&qp).unwrap();
        assert_eq!(report.status, BlockTridiagonalQpStatus::Solved);
        // Straight up to where it touches at a tangent: energy ½ ∫ y'².
        let c = 0.25 * (2.0 - 2.0_f64.sqrt());
        let slope = 8.0 * c;
        let expected = slope * slope * (0.5 - c) + 64.0 * c.powi(3) / 3.0;
        assert!((report.objective - expected).abs() < 0.1 * h, "{report:?}");
        report.iterations
    };
    let (short, long) = (iterations(20), iterations(2000));
    assert!(long < 3 * short.max(10), "{short} {long}");
}

#[test]
fn the_same_programme_has_the_same_solution_bit_for_bit() {
    let made = random(7, 6, 3, 20, 5.0, 0.5);
    let mut solver = BlockTridiagonalQpSolver::new();
    solver.solve(&random(8, 9, 4, 30, 5.0, 0.5).qp).unwrap();
    solver.solve(&made.qp).unwrap();
    let first = solver.solution().to_vec();
    let mut other = BlockTridiagonalQpSolver::new();
    other.solve(&made.qp).unwrap();
    assert_eq!(first, other.solution());
}

#[test]
fn bad_data_are_refused() {
    let mut solver = BlockTridiagonalQpSolver::new();
    let mut qp = BlockTridiagonalQp::new(2, 1);
    qp.diagonal_mut(0)[0] = 1.0;
    qp.diagonal_mut(1)[0] = -1.0;
    qp.gradient_mut(1)[0] = 1.0;
    let refused = |solver: &mut BlockTridiagonalQpSolver, qp: &BlockTridiagonalQp| {
        solver.solve(qp).unwrap_err()
    };
    assert_eq!(
        refused(&mut solver, &qp),
        BlockTridiagonalQpError::NotConvex { block: 1 }
    );
    qp.diagonal_mut(1)[0] = f64::NAN;
    assert!(matches!(
        refused(&mut solver, &qp),
        BlockTridiagonalQpError::NotFinite { block: 1, .. }
    ));
    qp.diagonal_mut(1)[0] = 1.0;
    qp.push_row(0, &[1.0], 0.0, 0.0);
    assert!(matches!(
        refused(&mut solver, &qp),
        BlockTridiagonalQpError::BadPrice { row: 0, .. }
    ));
    qp.clear_rows();
    qp.bounds_mut(1).0[0] = 2.0;
    qp.bounds_mut(1).1[0] = 2.0;
    assert!(matches!(
        refused(&mut solver, &qp),
        BlockTridiagonalQpError::NoRoom { variable: 1, .. }
    ));
}
