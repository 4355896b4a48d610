//! BFGS and L-BFGS with both line searches on the problems of Moré, Garbow and Hillstrom.

mod support;

use support::more_garbow_hillstrom::*;
use tensegra_optim::{
    Bfgs, Lbfgs, LineSearch, LineSearchOptions, MinimiseReport, MinimiseStatus, ProblemError,
    QuasiNewtonOptions, SmoothFunction,
};

fn options(rule: LineSearch) -> QuasiNewtonOptions {
    QuasiNewtonOptions::default().with_line_search(LineSearchOptions::default().with_rule(rule))
}

type Minimise<F> = fn(QuasiNewtonOptions, &mut F, &mut [f64]) -> MinimiseReport;

fn bfgs<F: SmoothFunction>(
    options: QuasiNewtonOptions,
    f: &mut F,
    x: &mut [f64],
) -> MinimiseReport {
    Bfgs::new(options).unwrap().minimise(f, x).unwrap()
}

fn lbfgs<F: SmoothFunction>(
    options: QuasiNewtonOptions,
    f: &mut F,
    x: &mut [f64],
) -> MinimiseReport {
    Lbfgs::new(options).unwrap().minimise(f, x).unwrap()
}

fn complaint<R: Residuals>(
    rule: LineSearch,
    minimise: Minimise<SumOfSquares<R>>,
) -> Option<String> {
    let mut x = R::start();
    let mut function = SumOfSquares::<R>::new();
    let report = minimise(options(rule), &mut function, &mut x);
    let known = R::OPTIMA
        .iter()
        .any(|o| (report.value - o).abs() <= 1e-9 * o + 1e-12);
    // Where the least value is far from zero its rounding hides the last decreases.
    let ended = match report.status {
        MinimiseStatus::Converged => true,
        MinimiseStatus::NoDecrease => R::OPTIMA[0] > 0.0,
        _ => false,
    };
    let mut gradient = vec![0.0; x.len()];
    let value = function.value_and_gradient(&x, &mut gradient);
    let norm = gradient.iter().fold(0.0_f64, |n, g| n.max(g.abs()));
    let measured = report.value == value && report.gradient_norm == norm;
    (!(known && ended && measured)).then(|| format!("{}: {report:?}", R::NAME))
}

#[test]
fn bfgs_with_the_strong_wolfe_rules() {
    let mut complaints: Vec<String> = Vec::new();
    macro_rules! visit {
        ($($name:ident),*) => {
            $( complaints.extend(complaint::<$name>(LineSearch::StrongWolfe, bfgs)); )*
        };
    }
    for_each_sum_of_squares!(visit);
    assert!(complaints.is_empty(), "{complaints:#?}");
}

#[test]
fn bfgs_with_armijos_rule() {
    let mut complaints: Vec<String> = Vec::new();
    macro_rules! visit {
        ($($name:ident),*) => {
            $( complaints.extend(complaint::<$name>(LineSearch::Armijo, bfgs)); )*
        };
    }
    for_each_sum_of_squares!(visit);
    assert!(complaints.is_empty(), "{complaints:#?}");
}

#[test]
fn lbfgs_with_the_strong_wolfe_rules() {
    let mut complaints: Vec<String> = Vec::new();
    macro_rules! visit {
        ($($name:ident),*) => {
            $( complaints.extend(complaint::<$name>(LineSearch::StrongWolfe, lbfgs)); )*
        };
    }
    for_each_sum_of_squares!(visit);
    assert!(complaints.is_empty(), "{complaints:#?}");
}

#[test]
fn lbfgs_with_armijos_rule() {
    let mut complaints: Vec<String> = Vec::new();
    macro_rules! visit {
        ($($name:ident),*) => {
            $( complaints.extend(complaint::<$name>(LineSearch::Armijo, lbfgs)); )*
        };
    }
    for_each_sum_of_squares!(visit);
    assert!(complaints.is_empty(), "{complaints:#?}");
}

/// Σ k (xₖ − 1)² with a rotation between neighbours: a thousand variables, condition number 1000.
struct LargeQuadratic;

impl SmoothFunction for LargeQuadratic {
    fn num_variables(&self) -> usize {
        1000
    }
    fn value(&mut self, x: &[f64]) -> f64 {
        let mut gradient = vec![0.0; x.len()];
        self.value_and_gradient(x, &mut gradient)
    }
    fn value_and_gradient(&mut self, x: &[f64], gradient: &mut [f64]) -> f64 {
        let mut value = 0.0;
        gradient.fill(0.0);
        for (k, pair) in x.windows(2).enumerate() {
            let weight = (k + 1) as f64;
            let (sum, difference) = (pair[0] + pair[1] - 2.0, pair[0] - pair[1]);
            value += weight * sum * sum + difference * difference;
            gradient[k] += 2.0 * weight * sum + 2.0 * difference;
            gradient[k + 1] += 2.0 * weight * sum - 2.0 * difference;
        }
        value
    }
}

#[test]
fn a_thousand_variables() {
    let mut x = vec![0.0; 1000];
    let report = lbfgs(
        options(LineSearch::StrongWolfe),
        &mut LargeQuadratic,
        &mut x,
    );
    assert!(report.is_converged(), "{report:?}");
    assert!(x.iter().all(|x| (x - 1.0).abs() < 1e-6));
}

#[test]
fn a_domain_is_not_left() {
    struct Barrier;
    impl SmoothFunction for Barrier {
        fn num_variables(&self) -> usize {
            2
        }
        fn value(&mut self, x: &[f64]) -> f64 {
            x[0] + 100.0 * x[1] - x[0].ln() - x[1].ln()
        }
        fn value_and_gradient(&mut self, x: &[f64], gradient: &mut [f64]) -> f64 {
            (gradient[0], gradient[1]) = (1.0 - 1.0 / x[0], 100.0 - 1.0 / x[1]);
            self.value(x)
        }
    }
    for rule in [LineSearch::Armijo, LineSearch::StrongWolfe] {
        for minimise in [bfgs, lbfgs] {
            let mut x = [5.0, 5.0];
            let report = minimise(options(rule), &mut Barrier, &mut x);
            assert!(report.is_converged(), "{report:?}");
            assert!(
                (x[0] - 1.0).abs() < 1e-8 && (x[1] - 0.01).abs() < 1e-8,
                "{x:?}"
            );
        }
    }
}

#[test]
fn an_unbounded_function_is_said_to_be() {
    struct Fall;
    impl SmoothFunction for Fall {
        fn num_variables(&self) -> usize {
            1
        }
        fn value(&mut self, x: &[f64]) -> f64 {
            -x[0].powi(3)
        }
        fn value_and_gradient(&mut self, x: &[f64], gradient: &mut [f64]) -> f64 {
            gradient[0] = -3.0 * x[0] * x[0];
            self.value(x)
        }
    }
    let report = bfgs(options(LineSearch::StrongWolfe), &mut Fall, &mut [1.0]);
    assert_eq!(report.status, MinimiseStatus::Unbounded);
}

#[test]
fn limits_and_bad_input() {
    let limited = options(LineSearch::StrongWolfe).with_max_iterations(3);
    let mut x = Rosenbrock::start();
    let report = bfgs(limited, &mut SumOfSquares::<Rosenbrock>::new(), &mut x);
    assert_eq!(
        (report.status, report.iterations),
        (MinimiseStatus::IterationLimit, 3)
    );

    let mut minimiser = Bfgs::new(QuasiNewtonOptions::default()).unwrap();
    let error = minimiser.minimise(&mut SumOfSquares::<Rosenbrock>::new(), &mut [0.0]);
    assert!(matches!(
        error,
        Err(ProblemError::WrongLength {
            expected: 2,
            found: 1,
            ..
        })
    ));
    let error = minimiser.minimise(&mut SumOfSquares::<Rosenbrock>::new(), &mut [0.0, f64::NAN]);
    assert!(matches!(
        error,
        Err(ProblemError::StartNotFinite { index: 1, .. })
    ));

    let error = Lbfgs::new(QuasiNewtonOptions::default().with_memory(0)).unwrap_err();
    assert_eq!(error.name, "memory");
    let steep = LineSearchOptions::default().with_curvature(1.5);
    let error = Bfgs::new(QuasiNewtonOptions::default().with_line_search(steep)).unwrap_err();
    assert_eq!(error.name, "curvature");
}
