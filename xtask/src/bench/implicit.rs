//! Suite `implicit`: planning on manifolds that are no structures, those of the
//! examples of `tensegra-sampling`.

#[path = "../../../crates/sampling/examples/implicit_chain/problem.rs"]
mod chain;
#[path = "../../../crates/sampling/examples/implicit_parallel/problem.rs"]
mod parallel;
#[path = "../../../crates/sampling/examples/sphere_walls/problem.rs"]
mod sphere;

use tensegra::{
    io::{Axis, BenchRow, Chart, ReferenceValue, Series, quantile},
    sampling::{AtlasRrt, Plan, PlannerOptions},
};
use tensegra_atlas::{ImplicitManifold, Validity, project};

use super::{BenchArguments, Results, RunFailure};
use crate::Error;

const SUITE: &str = "implicit";

const INTRODUCTION: &str = "\
Planning on any manifold F(x) = 0: the sphere with three walls, the closed chain of five balls and \
the parallel robot of four chains, demonstrations of the Open Motion Planning Library (OMPL). \
The user writes F, its Jacobian and a test of points (`crates/sampling/examples`); options are the \
defaults, but for longer steps and nearer samples on the sphere. A run is a success when a path is found that joins start and goal, stays on the manifold \
and within the bounds, and is valid at its points and at six points between each two of them. \
Planning time is CPU time of planning alone.

References: `OMPL`, the fastest of the planners of OMPL 2.0.2 on the same problem, median, measured \
by us on a machine like the one below.
";

/// A problem of the suite.
struct Case {
    name: &'static str,
    /// Plans with a seed and a limit of time, and judges.
    plan: fn(u64, f64) -> Result<Plan, String>,
    /// Median planning time of the peer's best planner, s.
    peer: f64,
}

const CASES: [Case; 3] = [
    Case {
        name: "sphere",
        plan: |seed, time_limit| {
            let sphere = sphere::Sphere::new();
            let (ends, mut options) = (sphere::endpoints(), sphere::options(seed));
            options.time_limit = time_limit;
            run(&sphere, &sphere::walls(), sphere::is_valid, &ends, options)
        },
        peer: 0.010,
    },
    Case {
        name: "chain",
        plan: |seed, time_limit| {
            let chain = chain::Chain::new(5);
            let (free, ends) = (chain.free_space(), chain.endpoints());
            run(
                &chain,
                &free,
                chain::Chain::is_valid,
                &ends,
                options(seed, time_limit),
            )
        },
        peer: 0.055,
    },
    Case {
        name: "parallel",
        plan: |seed, time_limit| {
            let robot = parallel::ParallelRobot::new();
            let (free, ends) = (robot.free_space(), robot.endpoints());
            let is_valid = parallel::ParallelRobot::is_valid;
            run(&robot, &free, is_valid, &ends, options(seed, time_limit))
        },
        peer: 0.043,
    },
];

pub fn measure(arguments: &BenchArguments) -> Result<Results, Error> {
    arguments.refuse_unknown_cases(&CASES.each_ref().map(|case| case.name))?;
    let mut rows = Vec::new();
    let mut failures = Vec::new();
    let mut chart = Chart::new(
        Axis::new("planning time").unit("s").logarithmic(),
        Axis::new("share of successful runs").range(0.0, 1.0),
    );
    let mut any = false;
    for (index, case) in CASES.iter().enumerate() {
        if !arguments.selects_case(case.name, index) {
            continue;
        }
        let count = arguments.seed_count() as usize;
        let mut plans = Vec::new();
        for seed in 1..=arguments.seed_count() {
            match (case.plan)(seed, arguments.time_limit) {
                Ok(plan) => plans.push(plan),
                Err(reason) => failures.push(RunFailure {
                    case: case.name.to_owned(),
                    variant: String::new(),
                    seed,
                    reason,
                }),
            }
        }
        eprintln!("{}: {}/{count}", case.name, plans.len());
        let seconds: Vec<f64> = plans.iter().map(|plan| plan.statistics.seconds).collect();
        if !seconds.is_empty() {
            any = true;
            let label = format!("{} ({}/{count})", case.name, seconds.len());
            chart = chart.series(Series::distribution(label, &seconds));
        }
        rows.extend(rows_of(case, count, &plans));
    }
    Ok(Results {
        introduction: INTRODUCTION,
        picture: any.then(|| chart.draw()).transpose()?,
        rows,
        failures,
    })
}

fn options(seed: u64, time_limit: f64) -> PlannerOptions {
    let mut options = PlannerOptions::default();
    options.seed = seed;
    options.time_limit = time_limit;
    options
}

/// Plans and judges; the error says why the run is no success.
fn run<M: ImplicitManifold, V: Validity>(
    manifold: &M,
    free: &V,
    is_valid: fn(&[f64]) -> bool,
    [start, goal]: &[Vec<f64>; 2],
    options: PlannerOptions,
) -> Result<Plan, String> {
    let step = options.step;
    let plan = AtlasRrt::new(manifold, free, options)
        .plan(start, goal, &mut ())
        .map_err(|error| error.to_string())?;
    let mut residual = vec![0.0; manifold.equation_count()];
    let bounds = || manifold.lower_bounds().iter().zip(manifold.upper_bounds());
    for x in &plan.points {
        manifold.residual(x, &mut residual);
        if residual.iter().any(|r| r.is_nan() || r.abs() > 1e-9) {
            return Err("the path leaves the manifold".to_owned());
        }
        let inside = |(x, (lo, hi)): (&f64, (&f64, &f64))| *x >= lo - 1e-9 && *x <= hi + 1e-9;
        if !x.iter().zip(bounds()).all(inside) {
            return Err("the path leaves the bounds".to_owned());
        }
    }
    let joined = |at: Option<&Vec<f64>>, end: &[f64]| at.is_some_and(|x| distance(x, end) < 1e-9);
    if !joined(plan.points.first(), start) || !joined(plan.points.last(), goal) {
        return Err("the path does not join start and goal".to_owned());
    }
    for pair in plan.points.windows(2) {
        if distance(&pair[0], &pair[1]) > 2.0 * step {
            return Err("the path jumps".to_owned());
        }
        for i in 0..7 {
            let share = f64::from(i) / 7.0;
            let points = pair[0].iter().zip(&pair[1]);
            let mut x: Vec<f64> = points.map(|(a, b)| a + share * (b - a)).collect();
            project(manifold, &mut x, 1e-12, 20).map_err(|error| error.to_string())?;
            if !is_valid(&x) {
                return Err("the path is not in free space".to_owned());
            }
        }
    }
    Ok(plan)
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    let square: f64 = a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum();
    square.sqrt()
}

fn rows_of(case: &Case, count: usize, plans: &[Plan]) -> Vec<BenchRow> {
    let row = |metric, unit, samples: &[f64], reference: Option<f64>| {
        let mut row = BenchRow::new(case.name, metric, unit, count, samples);
        row.success = plans.len();
        row.suite = SUITE.to_owned();
        row.reference = reference
            .into_iter()
            .map(|value| ReferenceValue {
                source: "OMPL".to_owned(),
                value,
            })
            .collect();
        row
    };
    let all = |quantity: fn(&Plan) -> f64| -> Vec<f64> { plans.iter().map(quantity).collect() };
    let mut seconds = all(|plan| plan.statistics.seconds);
    seconds.sort_by(f64::total_cmp);
    let mut worst = row("planning time, 95th percentile", "s", &[], None);
    worst.median = quantile(&seconds, 0.95);
    vec![
        row("planning time", "s", &seconds, Some(case.peer)),
        worst,
        row(
            "charts",
            "1",
            &all(|plan| plan.statistics.charts as f64),
            None,
        ),
        row(
            "nodes",
            "1",
            &all(|plan| plan.statistics.nodes as f64),
            None,
        ),
        row(
            "path length",
            "1",
            &all(|plan| {
                let steps = plan.points.windows(2);
                steps.map(|pair| distance(&pair[0], &pair[1])).sum()
            }),
            None,
        ),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_case_is_solved_and_judged() {
        for case in &CASES {
            let plan = (case.plan)(1, 60.0).unwrap();
            let rows = rows_of(case, 2, &[plan]);
            assert!(rows.iter().all(|row| (row.runs, row.success) == (2, 1)));
            assert_eq!(rows[0].reference[0].value, case.peer);
        }
    }
}
