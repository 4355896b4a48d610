//! The penalty method on problems of Hock and Schittkowski, with the polish by SQP that follows it.

mod support;

use support::hock_schittkowski::*;
use support::{Differentiated, Formulas, Number, is_known_minimum};
use tensegra_optim::{
    DenseSqp, Hessian, PenaltyMethod, PenaltyMinimiser, PenaltyOptions, PenaltyStatus, SqpOptions,
};

/// Known to end elsewhere: at a saddle point (29), short of a solution whose multipliers exceed
/// what the last weight can express (72).
fn out_of_reach(name: &str) -> bool {
    matches!(name, "HS29" | "HS72")
}

fn complaint<F: Formulas>(minimiser: PenaltyMinimiser) -> Option<String> {
    if out_of_reach(F::NAME) {
        return None;
    }
    let mut problem = Differentiated::<F>::new(Hessian::Lagrangian);
    let mut x = F::start();
    let options = PenaltyOptions::default().with_minimiser(minimiser);
    let report = PenaltyMethod::new(options)
        .unwrap()
        .solve(&mut problem, &mut x)
        .unwrap();
    let close = report.status == PenaltyStatus::Converged
        && report.residuals.infeasibility < 1e-2
        && report.objective == F::objective(&x)
        && is_known_minimum::<F>(report.objective, 1e-2);
    // The polish starts close to the solution and must not wander off.
    let options = SqpOptions::default().with_initial_radius(0.1);
    let polished = DenseSqp::new(options)
        .unwrap()
        .solve(&mut problem, &mut x)
        .unwrap();
    let exact = polished.is_converged()
        && polished.residuals.infeasibility < 1e-8
        && is_known_minimum::<F>(polished.objective, 1e-6);
    (!(close && exact)).then(|| format!("{}: {report:?}, then {polished:?}", F::NAME))
}

#[test]
fn standard_problems_with_bfgs() {
    let mut complaints: Vec<String> = Vec::new();
    macro_rules! visit {
        ($($name:ident),*) => {
            $( complaints.extend(complaint::<$name>(PenaltyMinimiser::Bfgs)); )*
        };
    }
    for_each_problem!(visit);
    assert!(complaints.is_empty(), "{complaints:#?}");
}

#[test]
fn standard_problems_with_lbfgs() {
    let mut complaints: Vec<String> = Vec::new();
    macro_rules! visit {
        ($($name:ident),*) => {
            $( complaints.extend(complaint::<$name>(PenaltyMinimiser::Lbfgs)); )*
        };
    }
    for_each_problem!(visit);
    assert!(complaints.is_empty(), "{complaints:#?}");
}

/// A start so far outside that e^(−c g) would overflow.
#[test]
fn a_far_start_does_not_overflow() {
    struct Far;
    impl Formulas for Far {
        const NAME: &'static str = "far";
        const OPTIMUM: f64 = 1.0;
        fn start() -> Vec<f64> {
            vec![-1e7, 1e6]
        }
        fn ranges() -> Vec<(f64, f64)> {
            vec![(1.0, f64::INFINITY)]
        }
        fn objective<D: Number>(x: &[D]) -> D {
            x[0] * x[0] + x[1] * x[1]
        }
        fn constraints<D: Number>(x: &[D]) -> Vec<D> {
            vec![x[0]]
        }
    }
    let options = PenaltyOptions::default().with_initial_weight(1e4);
    let mut x = Far::start();
    let mut problem = Differentiated::<Far>::new(Hessian::QuasiNewton);
    let report = PenaltyMethod::new(options)
        .unwrap()
        .solve(&mut problem, &mut x)
        .unwrap();
    assert_eq!(report.status, PenaltyStatus::Converged);
    assert!((report.objective - 1.0).abs() < 1e-2, "{report:?}");
}

#[test]
fn multipliers_are_those_of_the_problem() {
    let mut method = PenaltyMethod::new(PenaltyOptions::default()).unwrap();
    let mut x = Hs43::start();
    let mut problem = Differentiated::<Hs43>::new(Hessian::QuasiNewton);
    let report = method.solve(&mut problem, &mut x).unwrap();
    assert_eq!(report.status, PenaltyStatus::Converged);
    for (found, expected) in method.multipliers().iter().zip([-1.0, 0.0, -2.0]) {
        assert!(
            (found - expected).abs() < 1e-3,
            "{:?}",
            method.multipliers()
        );
    }
}

#[test]
fn constraints_that_cannot_be_met_are_listed() {
    struct Contradiction;
    impl Formulas for Contradiction {
        const NAME: &'static str = "contradiction";
        const OPTIMUM: f64 = f64::NAN;
        fn start() -> Vec<f64> {
            vec![0.3, 0.0]
        }
        fn ranges() -> Vec<(f64, f64)> {
            vec![(2.0, f64::INFINITY), (f64::NEG_INFINITY, 1.0), (5.0, 5.0)]
        }
        fn objective<D: Number>(x: &[D]) -> D {
            x[0] * x[0]
        }
        fn constraints<D: Number>(x: &[D]) -> Vec<D> {
            vec![x[0], x[0], x[1]]
        }
    }
    let mut x = Contradiction::start();
    let mut problem = Differentiated::<Contradiction>::new(Hessian::QuasiNewton);
    let mut method = PenaltyMethod::new(PenaltyOptions::default()).unwrap();
    let report = method.solve(&mut problem, &mut x).unwrap();
    let PenaltyStatus::Infeasible(unmet) = report.status else {
        panic!("{report:?}");
    };
    assert!(!unmet.is_empty() && unmet.iter().all(|u| u.constraint < 2));
    assert!((x[1] - 5.0).abs() < 1e-3);
}
