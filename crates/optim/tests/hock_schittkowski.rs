//! The SQP solvers on problems of Hock and Schittkowski, from the standard starting points, with
//! exact second derivatives and without.

mod support;

use support::hock_schittkowski::*;
use support::{Differentiated, Formulas, is_known_minimum};
use tensegra_optim::{
    DenseSqp, Hessian, KktResiduals, SparseSqp, SqpOptions, SqpReport, SqpStatus,
};

fn dense<F: Formulas>(kind: Hessian) -> (SqpReport, Vec<f64>, Vec<f64>) {
    let mut x = F::start();
    let mut solver = DenseSqp::new(SqpOptions::default()).unwrap();
    let report = solver
        .solve(&mut Differentiated::<F>::new(kind), &mut x)
        .unwrap();
    (report, x, solver.multipliers().to_vec())
}

fn sparse<F: Formulas>(kind: Hessian) -> (SqpReport, Vec<f64>, Vec<f64>) {
    let mut x = F::start();
    let mut solver = SparseSqp::new(SqpOptions::default()).unwrap();
    let report = solver
        .solve(&mut Differentiated::<F>::new(kind), &mut x)
        .unwrap();
    (report, x, solver.multipliers().to_vec())
}

/// What is wrong with a run, if anything.
fn complaint<F: Formulas>(
    (report, x, multipliers): (SqpReport, Vec<f64>, Vec<f64>),
    kind: Hessian,
) -> Option<String> {
    let mut problem = Differentiated::<F>::new(kind);
    let measured = KktResiduals::measure(&mut problem, &x, &multipliers).unwrap();
    let first_gradient = {
        let start = F::start();
        let zeros = vec![0.0; multipliers.len()];
        let at_start = KktResiduals::measure(&mut problem, &start, &zeros).unwrap();
        at_start.stationarity.max(1.0)
    };
    let largest = multipliers
        .iter()
        .fold(first_gradient, |a, m| a.max(m.abs()));
    let sound = report.status == SqpStatus::Converged
        && report.residuals == measured
        && measured.infeasibility <= 1e-8
        && measured.stationarity <= 1e-4 * largest
        && measured.complementarity <= 1e-5 * largest
        && (report.objective - F::objective(&x)).abs() == 0.0
        && is_known_minimum::<F>(report.objective, 1e-6)
        && report.iterations <= 80;
    (!sound).then(|| format!("{} ({kind:?}): {report:?}", F::NAME))
}

#[test]
fn dense_solver_with_exact_hessians() {
    let mut complaints: Vec<String> = Vec::new();
    macro_rules! visit {
        ($($name:ident),*) => {
            $( complaints.extend(complaint::<$name>(dense::<$name>(Hessian::Lagrangian), Hessian::Lagrangian)); )*
        };
    }
    for_each_problem!(visit);
    assert!(complaints.is_empty(), "{complaints:#?}");
}

#[test]
fn dense_solver_with_quasi_newton_hessians() {
    let mut complaints: Vec<String> = Vec::new();
    macro_rules! visit {
        ($($name:ident),*) => {
            $( complaints.extend(complaint::<$name>(dense::<$name>(Hessian::QuasiNewton), Hessian::QuasiNewton)); )*
        };
    }
    for_each_problem!(visit);
    assert!(complaints.is_empty(), "{complaints:#?}");
}

/// On problem 108 the interior-point subproblems lead to a point where the gradients of active
/// constraints vanish, from which only the active-set subproblems get away.
fn too_degenerate_for_sparse(name: &str) -> bool {
    name == "HS108"
}

#[test]
fn sparse_solver_with_exact_hessians() {
    let mut complaints: Vec<String> = Vec::new();
    macro_rules! visit {
        ($($name:ident),*) => {
            $( if !too_degenerate_for_sparse($name::NAME) {
                complaints.extend(complaint::<$name>(sparse::<$name>(Hessian::Lagrangian), Hessian::Lagrangian));
            } )*
        };
    }
    for_each_problem!(visit);
    assert!(complaints.is_empty(), "{complaints:#?}");
}

#[test]
fn sparse_solver_with_quasi_newton_hessians() {
    let mut complaints: Vec<String> = Vec::new();
    macro_rules! visit {
        ($($name:ident),*) => {
            $( if !too_degenerate_for_sparse($name::NAME) {
                complaints.extend(complaint::<$name>(sparse::<$name>(Hessian::QuasiNewton), Hessian::QuasiNewton));
            } )*
        };
    }
    for_each_problem!(visit);
    assert!(complaints.is_empty(), "{complaints:#?}");
}

/// Known solutions, to more digits than the objective tells.
#[test]
fn solutions_and_multipliers_of_problem_71() {
    for (report, x, multipliers) in [
        dense::<Hs71>(Hessian::Lagrangian),
        sparse::<Hs71>(Hessian::Lagrangian),
    ] {
        assert!(report.is_converged());
        for (found, expected) in x
            .iter()
            .zip([1.0, 4.742_999_63, 3.821_149_98, 1.379_408_29])
        {
            assert!((found - expected).abs() < 1e-7, "{x:?}");
        }
        assert!(
            (multipliers[0] + 0.552_293_66).abs() < 1e-6,
            "{multipliers:?}"
        );
        assert!(
            (multipliers[1] - 0.161_468_56).abs() < 1e-6,
            "{multipliers:?}"
        );
    }
}

/// With exact second derivatives few iterations are needed.
#[test]
fn exact_hessians_give_fast_convergence() {
    assert!(dense::<Hs71>(Hessian::Lagrangian).0.iterations <= 9);
    assert!(dense::<Hs100>(Hessian::Lagrangian).0.iterations <= 10);
    assert!(dense::<Hs113>(Hessian::Lagrangian).0.iterations <= 9);
    assert!(dense::<Hs93>(Hessian::Lagrangian).0.iterations <= 8);
    assert!(sparse::<Hs100>(Hessian::Lagrangian).0.iterations <= 10);
    assert!(sparse::<Hs81>(Hessian::Lagrangian).0.iterations <= 11);
}

/// Problem 13 has no multipliers at its solution (1, 0): the constraint's gradient vanishes there.
#[test]
fn problem_13_without_multipliers() {
    struct Hs13;
    impl Formulas for Hs13 {
        const NAME: &'static str = "HS13";
        const OPTIMUM: f64 = 1.0;
        fn start() -> Vec<f64> {
            vec![-2.0, -2.0]
        }
        fn bounds() -> Vec<(f64, f64)> {
            vec![(0.0, f64::INFINITY); 2]
        }
        fn ranges() -> Vec<(f64, f64)> {
            vec![(0.0, f64::INFINITY)]
        }
        fn objective<D: support::Number>(x: &[D]) -> D {
            (x[0] - 2.0).powi(2) + x[1].powi(2)
        }
        fn constraints<D: support::Number>(x: &[D]) -> Vec<D> {
            vec![(-x[0] + 1.0).powi(3) - x[1]]
        }
    }
    for (report, x, _) in [
        dense::<Hs13>(Hessian::Lagrangian),
        sparse::<Hs13>(Hessian::Lagrangian),
        dense::<Hs13>(Hessian::QuasiNewton),
        sparse::<Hs13>(Hessian::QuasiNewton),
    ] {
        assert!(report.residuals.infeasibility < 1e-6, "{report:?}");
        assert!(
            (x[0] - 1.0).abs() < 0.03 && x[1].abs() < 1e-6,
            "{x:?} {report:?}"
        );
    }
}
