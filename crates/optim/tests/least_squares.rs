//! Levenberg–Marquardt on the problems of Moré, Garbow and Hillstrom, on rank-deficient systems,
//! and as the polish that restores feasibility.

mod support;

use nalgebra::DMatrix;
use support::hock_schittkowski::{Hs7, Hs40, Hs71, Hs100};
use support::more_garbow_hillstrom::*;
use support::{Differentiated, Formulas};
use tensegra_optim::{
    Hessian, LeastSquares, LeastSquaresOptions, LeastSquaresStatus, LevenbergMarquardt,
    ProblemError, StepScaling, restore_feasibility,
};

fn solver() -> LevenbergMarquardt {
    LevenbergMarquardt::new(LeastSquaresOptions::default()).unwrap()
}

fn complaint<R: Residuals>() -> Option<String> {
    let mut x = R::start();
    let report = solver()
        .solve(&mut SumOfSquares::<R>::new(), &mut x)
        .unwrap();
    let known = R::OPTIMA
        .iter()
        .any(|o| (report.sum_of_squares - o).abs() <= 1e-10 * o + 1e-25);
    let sum: f64 = R::residuals(&x).iter().map(|r| r * r).sum();
    let sound = report.is_converged() && known && report.sum_of_squares == sum;
    (!sound).then(|| format!("{}: {report:?}", R::NAME))
}

#[test]
fn standard_problems_to_full_accuracy() {
    let mut complaints: Vec<String> = Vec::new();
    macro_rules! visit {
        ($($name:ident),*) => { $( complaints.extend(complaint::<$name>()); )* };
    }
    for_each_sum_of_squares!(visit);
    assert!(complaints.is_empty(), "{complaints:#?}");
}

#[test]
fn parameters_of_the_fits() {
    let mut x = Bard::start();
    solver()
        .solve(&mut SumOfSquares::<Bard>::new(), &mut x)
        .unwrap();
    for (found, expected) in x
        .iter()
        .zip([0.082_410_559_74, 1.133_036_092, 2.343_695_178])
    {
        assert!((found - expected).abs() < 1e-8, "{x:?}");
    }
    let mut x = Meyer::start();
    solver()
        .solve(&mut SumOfSquares::<Meyer>::new(), &mut x)
        .unwrap();
    for (found, expected) in x
        .iter()
        .zip([5.609_636_471e-3, 6_181.346_346, 345.223_634_6])
    {
        assert!((found / expected - 1.0).abs() < 1e-7, "{x:?}");
    }
}

/// Two spheres given by three dependent equations: a circle of solutions, rank 2 of 3 rows.
struct Circle;

impl LeastSquares for Circle {
    fn num_variables(&self) -> usize {
        3
    }
    fn num_residuals(&self) -> usize {
        3
    }
    fn residuals(&mut self, x: &[f64], r: &mut [f64]) {
        r[0] = x[0] * x[0] + x[1] * x[1] + x[2] * x[2] - 1.0;
        r[1] = x[0] * x[0] + x[1] * x[1] + (x[2] - 1.0).powi(2) - 1.0;
        r[2] = 2.0 * r[0] - r[1];
    }
    fn jacobian(&mut self, x: &[f64], jacobian: &mut DMatrix<f64>) {
        for j in 0..3 {
            let shifted = x[j] - if j == 2 { 1.0 } else { 0.0 };
            jacobian[(0, j)] = 2.0 * x[j];
            jacobian[(1, j)] = 2.0 * shifted;
            jacobian[(2, j)] = 4.0 * x[j] - 2.0 * shifted;
        }
    }
}

#[test]
fn dependent_equations_with_a_set_of_solutions_converge_quadratically() {
    let mut x = [0.7, 0.4, 0.6];
    let options = LeastSquaresOptions::default().with_scaling(StepScaling::None);
    let mut solver = LevenbergMarquardt::new(options).unwrap();
    let report = solver.solve(&mut Circle, &mut x).unwrap();
    assert!(
        report.is_converged() && report.largest_residual < 4e-16,
        "{report:?}"
    );
    assert!(report.iterations <= 7, "{report:?}");
    // The nearest point of the circle z = 1/2, radius √3/2, is in the same direction.
    assert!((x[2] - 0.5).abs() < 1e-15);
    let angle = x[1].atan2(x[0]) - 0.4_f64.atan2(0.7);
    assert!(angle.abs() < 1e-12, "{angle:e}");
}

#[test]
fn contradictory_equations_end_at_the_least_squares_solution() {
    struct Contradiction;
    impl LeastSquares for Contradiction {
        fn num_variables(&self) -> usize {
            1
        }
        fn num_residuals(&self) -> usize {
            2
        }
        fn residuals(&mut self, x: &[f64], r: &mut [f64]) {
            (r[0], r[1]) = (x[0] - 1.0, x[0] - 3.0);
        }
        fn jacobian(&mut self, _x: &[f64], jacobian: &mut DMatrix<f64>) {
            jacobian.fill(1.0);
        }
    }
    let mut x = [17.0];
    let report = solver().solve(&mut Contradiction, &mut x).unwrap();
    assert!(report.is_converged());
    assert!((x[0] - 2.0).abs() < 1e-12 && (report.sum_of_squares - 2.0).abs() < 1e-12);
}

#[test]
fn a_residual_tolerance_ends_early() {
    let options = LeastSquaresOptions::default().with_residual_tolerance(1e-3);
    let mut solver = LevenbergMarquardt::new(options).unwrap();
    let mut x = Rosenbrock::start();
    let report = solver
        .solve(&mut SumOfSquares::<Rosenbrock>::new(), &mut x)
        .unwrap();
    assert_eq!(report.status, LeastSquaresStatus::ResidualSmall);
    assert!(report.largest_residual <= 1e-3);
}

#[test]
fn a_wrong_jacobian_is_trouble() {
    struct Wrong;
    impl LeastSquares for Wrong {
        fn num_variables(&self) -> usize {
            1
        }
        fn num_residuals(&self) -> usize {
            1
        }
        fn residuals(&mut self, x: &[f64], r: &mut [f64]) {
            r[0] = x[0];
        }
        fn jacobian(&mut self, _x: &[f64], jacobian: &mut DMatrix<f64>) {
            jacobian.fill(-1.0);
        }
    }
    let mut x = [1.0];
    let report = solver().solve(&mut Wrong, &mut x).unwrap();
    assert!(
        !report.is_converged() || report.sum_of_squares < 1.0,
        "{report:?}"
    );
    assert_eq!(x, [1.0]);
}

#[test]
fn bad_starts_are_named() {
    let mut problem = SumOfSquares::<KowalikOsborne>::new();
    let error = solver().solve(&mut problem, &mut [1.0; 3]).unwrap_err();
    assert!(matches!(
        error,
        ProblemError::WrongLength {
            expected: 4,
            found: 3,
            ..
        }
    ));
    let error = solver()
        .solve(&mut problem, &mut [0.0, 0.0, 0.0, f64::INFINITY])
        .unwrap_err();
    assert!(matches!(
        error,
        ProblemError::StartNotFinite { index: 3, .. }
    ));
    // The denominators vanish.
    let error = solver()
        .solve(&mut problem, &mut [1.0, 1.0, -4.0, 0.0])
        .unwrap_err();
    assert!(matches!(
        error,
        ProblemError::NotFiniteAtStart {
            what: "residual",
            index: 0,
            ..
        }
    ));
}

fn restored<F: Formulas>(mut x: Vec<f64>) {
    let options = LeastSquaresOptions::default().with_scaling(StepScaling::None);
    let mut solver = LevenbergMarquardt::new(options).unwrap();
    let mut problem = Differentiated::<F>::new(Hessian::QuasiNewton);
    let report = restore_feasibility(&mut problem, &mut solver, &mut x).unwrap();
    assert!(report.is_converged(), "{}: {report:?}", F::NAME);
    assert!(report.largest_residual < 1e-12, "{}: {report:?}", F::NAME);
    for (value, (lower, upper)) in F::constraints(&x).into_iter().zip(F::ranges()) {
        assert!(value >= lower - 1e-12 && value <= upper + 1e-12);
    }
    for (value, (lower, upper)) in x.into_iter().zip(F::bounds()) {
        assert!(value >= lower - 1e-12 && value <= upper + 1e-12);
    }
}

#[test]
fn feasibility_is_restored() {
    restored::<Hs7>(vec![0.1, 1.8]);
    restored::<Hs40>(vec![0.7, 0.8, 0.5, 0.9]);
    restored::<Hs71>(vec![0.9, 4.7, 3.8, 1.4]);
    restored::<Hs100>(vec![2.4, 2.0, -0.4, 4.5, -0.6, 1.1, 1.6]);
}
