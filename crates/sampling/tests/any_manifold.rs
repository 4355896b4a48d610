//! The planner on manifolds that have nothing to do with structures: those of
//! the examples.

#[path = "../examples/implicit_chain/problem.rs"]
mod chain;
#[path = "../examples/implicit_parallel/problem.rs"]
mod parallel;
#[path = "../examples/sphere_walls/problem.rs"]
mod sphere;

use tensegra_atlas::{
    Everywhere, ImplicitManifold, ManifoldError, Validity, check_jacobian, dimension, project,
};
use tensegra_sampling::{AtlasRrt, PlanError, PlannerOptions};

/// A planning problem with a test of points.
struct Case<'a, M> {
    manifold: &'a M,
    endpoints: [Vec<f64>; 2],
    is_valid: fn(&[f64]) -> bool,
    dimension: usize,
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    let square: f64 = a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum();
    square.sqrt()
}

fn residual<M: ImplicitManifold>(manifold: &M, x: &[f64]) -> f64 {
    let mut values = vec![0.0; manifold.equation_count()];
    manifold.residual(x, &mut values);
    values.iter().fold(0.0, |largest, v| v.abs().max(largest))
}

/// The ends are on the manifold, and the Jacobian is right near them.
fn differentiate<M: ImplicitManifold>(case: &Case<'_, M>) {
    let manifold = case.manifold;
    for end in &case.endpoints {
        assert!(residual(manifold, end) < 1e-14);
        assert_eq!(dimension(manifold, end), case.dimension);
        let moved = end.iter().enumerate();
        let moved: Vec<f64> = moved.map(|(i, x)| x + 0.1 * (i as f64).sin()).collect();
        assert_eq!(check_jacobian(manifold, &moved), Ok(()));
    }
}

/// Plans, and follows the path through: it joins the ends, stays on the
/// manifold and within the bounds, and is valid at its points and at points
/// between them that the planner did not look at.
fn plan<M: ImplicitManifold, V: Validity>(case: &Case<'_, M>, free: &V, options: PlannerOptions) {
    let manifold = case.manifold;
    let seed = options.seed;
    let step = options.step;
    let [start, goal] = &case.endpoints;
    let plan = AtlasRrt::new(manifold, free, options)
        .plan(start, goal, &mut ())
        .unwrap();
    let points = &plan.points;
    assert!(distance(&points[0], start) < 1e-9 && distance(&points[points.len() - 1], goal) < 1e-9);
    for x in points {
        assert!(residual(manifold, x) < 1e-10, "seed {seed}");
        assert!((case.is_valid)(x), "seed {seed}: {x:?}");
        let bounds = manifold.lower_bounds().iter().zip(manifold.upper_bounds());
        for (x, (lo, hi)) in x.iter().zip(bounds) {
            assert!(*x >= lo - 1e-9 && *x <= hi + 1e-9, "seed {seed}: {x}");
        }
    }
    for pair in points.windows(2) {
        let length = distance(&pair[0], &pair[1]);
        assert!(length < 1.7 * step, "seed {seed}: a step of {length}");
        for i in 1..7 {
            let s = f64::from(i) / 7.0;
            let mut x: Vec<f64> = pair[0]
                .iter()
                .zip(&pair[1])
                .map(|(a, b)| a + s * (b - a))
                .collect();
            project(manifold, &mut x, 1e-12, 20).unwrap();
            assert!((case.is_valid)(&x), "seed {seed}: {x:?}");
        }
    }
}

fn seeded(seed: u64) -> PlannerOptions {
    let mut options = PlannerOptions::default();
    options.seed = seed;
    options
}

#[test]
fn a_sphere_with_walls() {
    let case = Case {
        manifold: &sphere::Sphere::new(),
        endpoints: sphere::endpoints(),
        is_valid: sphere::is_valid,
        dimension: 2,
    };
    differentiate(&case);
    (1..=5).for_each(|seed| plan(&case, &sphere::walls(), sphere::options(seed)));
}

#[test]
fn a_chain() {
    let chain = chain::Chain::new(5);
    let case = Case {
        manifold: &chain,
        endpoints: chain.endpoints(),
        is_valid: chain::Chain::is_valid,
        dimension: 9,
    };
    differentiate(&case);
    (1..=5).for_each(|seed| plan(&case, &chain.free_space(), seeded(seed)));
}

#[test]
fn a_parallel_robot() {
    let robot = parallel::ParallelRobot::new();
    let case = Case {
        manifold: &robot,
        endpoints: robot.endpoints(),
        is_valid: parallel::ParallelRobot::is_valid,
        dimension: 19,
    };
    differentiate(&case);
    (1..=5).for_each(|seed| plan(&case, &robot.free_space(), seeded(seed)));
}

/// A chain of any number of links is a manifold of dimension 2 L − 1.
#[test]
fn a_longer_chain() {
    let chain = chain::Chain::new(7);
    let case = Case {
        manifold: &chain,
        endpoints: chain.endpoints(),
        is_valid: chain::Chain::is_valid,
        dimension: 13,
    };
    differentiate(&case);
}

#[test]
fn points_and_options_that_make_no_sense_are_refused() {
    let sphere = sphere::Sphere::new();
    let [south, north] = sphere::endpoints();
    let refusal = |start: &[f64], options| {
        let planner = AtlasRrt::new(&sphere, &Everywhere, options);
        planner.plan(start, &north, &mut ()).unwrap_err()
    };
    for (start, expected) in [
        (
            &[0.0, 0.0, -1.1][..],
            ManifoldError::NotOnManifold {
                residual: 0.105,
                equation: 0,
            },
        ),
        (
            &[0.0, -1.0],
            ManifoldError::WrongLength {
                found: 2,
                expected: 3,
            },
        ),
    ] {
        let error = refusal(start, seeded(1));
        let PlanError::Manifold { which, error } = error else {
            panic!("{error}");
        };
        assert_eq!(which, "start");
        assert_eq!(
            std::mem::discriminant(&error),
            std::mem::discriminant(&expected),
            "{error}"
        );
    }
    for step in [0.0, -0.1, f64::NAN] {
        let mut options = seeded(1);
        options.step = step;
        let error = refusal(&south, options);
        assert!(matches!(error, PlanError::Option { name: "step", .. }));
    }
}
