//! Suite `formfinding`: stable forms from topology, ranges and conditions alone.

use std::time::Duration;

use tensegra::{
    check::{CheckOptions, check_configuration, check_path},
    find_endpoints,
    formfinding::FormProblem,
    io::{Axis, BenchRow, Chart, ReferenceValue, Series},
    model::Problem,
};

mod poses;

use super::{BenchArguments, Results, RunFailure};
use crate::{Error, root};

const SUITE: &str = "formfinding";

const INTRODUCTION: &str = "\
`starts`: random starts of the prism of Hernández Juan and Mirats Tur (2008) with self-collision, \
fifty for each seed. A single start is a success when it converges to residual 1e-9, the \
equilibrium is stable and free of collisions, and the judge accepts it; with restarts, when one of \
five in a row is. Time is CPU time of one start, on one thread, successful or not. Reference: \
`paper`, the time that the authors report for one configuration, on a machine of its time.

`six_bar`: direct form-finding, from the rest lengths of sixty published poses of a six-bar robot \
(fixtures/formfinding/six_bar_poses.json) to node positions, each from the symmetric shape, on one \
thread. A pose is a success when the equilibrium is stable, its largest unbalanced force is at most \
1e-9 N, and nodes are within 2e-5 m of the published ones after alignment; seeds repeat the series.

The other cases are the planning problems of suite `manifold` with start and goal found from a \
description (fixtures/NAME-formfound.toml), then planned. A run is a success when both are found, a \
path between them is found, and the judge accepts it; the time is that of finding both.
";

/// Random starts for each seed, and starts in a row of which one has to succeed.
const STARTS: usize = 50;
const RESTARTS: usize = 5;

/// Planning problems whose start and goal are found.
const FORMFOUND: [&str; 3] = ["kite", "prism", "robot"];

/// Figures of a case.
#[derive(Default)]
struct Figures {
    rows: Vec<BenchRow>,
    failures: Vec<RunFailure>,
    seconds: Vec<(String, Vec<f64>)>,
}

impl Figures {
    /// Keeps times to be drawn, where there are any.
    fn distribution(&mut self, label: String, seconds: Vec<f64>) {
        if !seconds.is_empty() {
            self.seconds.push((label, seconds));
        }
    }
}

pub fn measure(arguments: &BenchArguments) -> Result<Results, Error> {
    let mut names = vec!["starts".to_owned(), poses::CASE.to_owned()];
    names.extend(FORMFOUND.map(str::to_owned));
    if let Some(unknown) = arguments.cases.iter().find(|name| !names.contains(name)) {
        let known = names.join(", ");
        return Err(format!("the suite has no case {unknown}: choose from {known}").into());
    }
    let mut figures = Figures::default();
    for (index, name) in names.iter().enumerate() {
        if !arguments.selects_case(name, index) {
            continue;
        }
        match index {
            0 => starts(arguments, &mut figures)?,
            1 => poses::measure(arguments, &mut figures)?,
            _ => endpoints(name, arguments, &mut figures)?,
        }
    }
    let mut chart = Chart::new(
        Axis::new("CPU time").unit("s").logarithmic(),
        Axis::new("share of runs").range(0.0, 1.0),
    )
    .title("time of one start, or of finding start and goal");
    for (label, seconds) in &figures.seconds {
        chart = chart.series(Series::distribution(label.clone(), seconds));
    }
    let picture = if figures.seconds.is_empty() {
        None
    } else {
        Some(chart.draw()?)
    };
    Ok(Results {
        introduction: INTRODUCTION,
        rows: figures.rows,
        failures: figures.failures,
        picture,
    })
}

fn read(fixture: &str) -> Result<Problem, Error> {
    let file = root().join("fixtures").join(fixture);
    Problem::read(&file).map_err(|errors| format!("{errors:#}").into())
}

fn row(case: &str, metric: &str, unit: &str, runs: usize, samples: &[f64]) -> BenchRow {
    let mut row = BenchRow::new(case, metric, unit, runs, samples);
    row.suite = SUITE.to_owned();
    row
}

/// Measures the CPU time of this thread.
fn timed<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let clock = cpu_time::ThreadTime::now();
    let result = work();
    (result, Duration::as_secs_f64(&clock.elapsed()))
}

fn starts(arguments: &BenchArguments, figures: &mut Figures) -> Result<(), Error> {
    let problem = read("formfinding/prism.toml")?;
    let forms = FormProblem::new(&problem, &[])?;
    let (mut seconds, mut succeeded, mut groups) = (Vec::new(), Vec::new(), 0);
    let mut iterations = Vec::new();
    let seeds = arguments.seed_count();
    for seed in 1..=seeds {
        let mut row = Vec::with_capacity(STARTS);
        for start in 0..STARTS {
            let (form, time) = timed(|| forms.attempt(seed, start));
            let form = form?;
            seconds.push(time);
            row.push(form.as_ref().is_some_and(|form| {
                let options = CheckOptions::default();
                check_configuration(&problem, &form.configuration, &options).ok
            }));
            iterations.extend(form.map(|form| form.iterations as f64));
        }
        for (group, attempts) in row.chunks(RESTARTS).enumerate() {
            if attempts.contains(&true) {
                groups += 1;
            } else {
                figures.failures.push(RunFailure {
                    case: "starts".to_owned(),
                    variant: "five restarts".to_owned(),
                    seed,
                    reason: format!("none of the starts from {} on succeeds", group * RESTARTS),
                });
            }
        }
        succeeded.extend(row);
    }
    let count = succeeded.len();
    let success = succeeded.iter().filter(|success| **success).count();
    eprintln!(
        "starts: {success}/{count}, five restarts: {groups}/{}",
        count / RESTARTS
    );
    let mut time = row("starts", "CPU time of a start", "s", count, &seconds);
    time.success = success;
    time.reference = vec![ReferenceValue {
        source: "paper".to_owned(),
        value: 0.2,
    }];
    let mut steps = row("starts", "steps of a start", "1", count, &iterations);
    steps.success = success;
    let mut restarted = row("starts", "success within five", "1", count / RESTARTS, &[]);
    restarted.variant = "five restarts".to_owned();
    restarted.success = groups;
    figures.rows.extend([time, steps, restarted]);
    figures.distribution("prism, one start".to_owned(), seconds);
    Ok(())
}

fn endpoints(name: &str, arguments: &BenchArguments, figures: &mut Figures) -> Result<(), Error> {
    let mut problem = read(&format!("{name}-formfound.toml"))?;
    problem.settings.time_limit = arguments.time_limit;
    let (mut finding, mut planning) = (Vec::new(), Vec::new());
    for seed in 1..=arguments.seed_count() {
        problem.seed = seed;
        match found_and_planned(&problem) {
            Ok((found, planned)) => {
                finding.push(found);
                planning.push(planned);
            }
            Err(reason) => figures.failures.push(RunFailure {
                case: name.to_owned(),
                variant: String::new(),
                seed,
                reason,
            }),
        }
    }
    let count = arguments.seed_count() as usize;
    eprintln!("{name}: {}/{count}", finding.len());
    figures.rows.extend([
        row(name, "CPU time of start and goal", "s", count, &finding),
        row(name, "planning time", "s", count, &planning),
    ]);
    let label = format!("{name}, start and goal ({}/{count})", finding.len());
    figures.distribution(label, finding);
    Ok(())
}

/// Times of finding start and goal and of planning between them, or why that failed.
fn found_and_planned(problem: &Problem) -> Result<(f64, f64), String> {
    let (found, finding) = timed(|| find_endpoints(problem));
    let found = found.map_err(|(which, error)| format!("the {which}: {error}"))?;
    let plan = tensegra::plan(&found, &mut ()).map_err(|error| error.to_string())?;
    let report = check_path(&found, &plan.path, &CheckOptions::default());
    if report.ok {
        return Ok((finding, plan.planning_seconds));
    }
    let reasons = report
        .failures
        .iter()
        .map(|failure| failure.message.as_str());
    let reasons: Vec<&str> = reasons.collect();
    Err(format!(
        "the judge refuses the path: {}",
        reasons.join("; ")
    ))
}
