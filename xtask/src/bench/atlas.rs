//! Suite `atlas`: atlases of whole components by higher-dimensional continuation.

use tensegra::{
    io::{BenchRow, ReferenceValue},
    model::Problem,
};

use super::{BenchArguments, Results, RunFailure};
use crate::{Error, root};

const SUITE: &str = "atlas";

/// Points of a component that are traced at random, to test that charts cover
/// them.
const TRACED: usize = 10_000;

const INTRODUCTION: &str = "\
Atlases of the whole component of a structure's equilibrium manifold (k = 2), by \
higher-dimensional continuation from its start. A run is a success when the component is explored \
whole and each of 10 000 points, traced over it at random by small steps that know nothing of the \
atlas, lies in the domain of a chart; the seed decides where they are traced. Exploration time is \
CPU time of the continuation alone, collisions included.

References: `paper`, Porta and Hernández-Juan (2016), section 4.2 (\"less than 5 seconds\"); \
`CuikSuite`, the CuikSuite 3.1 measured by us, one thread of a machine like the one below, on \
tower3D and on a free three-strut prism of its own.
";

struct Case {
    name: &'static str,
    /// What others need, in seconds and charts.
    seconds: &'static [(&'static str, f64)],
    charts: &'static [(&'static str, f64)],
}

/// The cases: each is fixtures/NAME.toml.
const CASES: [Case; 2] = [
    Case {
        name: "tower3D",
        seconds: &[("paper", 5.0), ("CuikSuite", 1.37)],
        charts: &[("CuikSuite", 164.0)],
    },
    Case {
        name: "free_prism",
        seconds: &[("CuikSuite", 0.46)],
        charts: &[("CuikSuite", 1795.0)],
    },
];

struct Run {
    seconds: f64,
    charts: f64,
    border_charts: f64,
    covered: f64,
}

pub fn measure(arguments: &BenchArguments) -> Result<Results, Error> {
    arguments.refuse_unknown_cases(&CASES.each_ref().map(|case| case.name))?;
    let mut rows = Vec::new();
    let mut failures = Vec::new();
    for (index, case) in CASES.iter().enumerate() {
        if !arguments.selects_case(case.name, index) {
            continue;
        }
        let file = root().join(format!("fixtures/{}.toml", case.name));
        let mut problem = Problem::read(&file).map_err(|errors| format!("{errors:#}"))?;
        problem.settings.time_limit = arguments.time_limit;
        let mut runs = Vec::new();
        for seed in 1..=arguments.seed_count() {
            match run(&problem, seed) {
                Ok(run) => runs.push(run),
                Err(reason) => failures.push(RunFailure {
                    case: case.name.to_owned(),
                    variant: String::new(),
                    seed,
                    reason,
                }),
            }
        }
        let count = arguments.seed_count() as usize;
        eprintln!("{}: {}/{count}", case.name, runs.len());
        rows.extend(rows_of(case, count, &runs));
    }
    Ok(Results {
        introduction: INTRODUCTION,
        picture: None,
        rows,
        failures,
    })
}

/// Explores and traces; the error says why the run is no success.
fn run(problem: &Problem, seed: u64) -> Result<Run, String> {
    let atlas = tensegra::explore(problem, &mut ()).map_err(|error| error.to_string())?;
    if !atlas.complete {
        return Err("the component is not explored whole".to_owned());
    }
    let coverage = atlas
        .measure_coverage(problem, TRACED, seed)
        .map_err(|error| error.to_string())?;
    if coverage.covered < coverage.points {
        let missed = coverage.points - coverage.covered;
        return Err(format!("{missed} of {TRACED} points lie on no chart"));
    }
    Ok(Run {
        seconds: atlas.seconds,
        charts: atlas.charts.len() as f64,
        border_charts: atlas.border_charts() as f64,
        covered: coverage.covered as f64 / coverage.points as f64,
    })
}

fn rows_of(case: &Case, count: usize, runs: &[Run]) -> Vec<BenchRow> {
    let row = |metric, unit, quantity: fn(&Run) -> f64, references: &[(&str, f64)]| {
        let samples: Vec<f64> = runs.iter().map(quantity).collect();
        let mut row = BenchRow::new(case.name, metric, unit, count, &samples);
        row.suite = SUITE.to_owned();
        row.reference = references
            .iter()
            .map(|&(source, value)| ReferenceValue {
                source: source.to_owned(),
                value,
            })
            .collect();
        row
    };
    vec![
        row("exploration time", "s", |run| run.seconds, case.seconds),
        row("charts", "1", |run| run.charts, case.charts),
        row("charts at a border", "1", |run| run.border_charts, &[]),
        row(
            "share of traced points covered",
            "1",
            |run| run.covered,
            &[],
        ),
    ]
}
