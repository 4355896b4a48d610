//! Suite `smoothing`: control effort of planned and smoothed paths of the five
//! problems of Porta and Hernández-Juan (2016).

use tensegra::{
    SmoothedPlan, SmoothingOptions,
    io::{Axis, BenchRow, Chart, Picture, ReferenceValue, Series, quantile},
    model::Problem,
};

use super::{BenchArguments, Results, RunFailure};
use crate::{Error, root};

const SUITE: &str = "smoothing";

const INTRODUCTION: &str = "\
Planning problems of Porta and Hernández-Juan (2016): planned in the default formulation, then \
shortcuts and smoothing. A run is a success when the judge accepts the smoothed path, clearance \
between the samples included, and smoothing itself ended with a path. Control effort and length \
are in the coordinates of the paper, with steps of at most 0.05. Smoothing time is CPU time of \
shortcuts, smoothing and the judge's verdict in between, of all plans together; `optimality` is \
the largest entry of the reduced gradient of the path's energy over its length. For `free_flying`, \
whose paths fall into classes that cannot be deformed into each other, six plans are made, and \
others in place of those of poor classes; all are smoothed on a coarse mesh, and the best to the \
end. A maximum stands in the column of the median.

References: `paper`, the effort after optimisation and the time that it took, in the table of \
Porta and Hernández-Juan (2016); `CuikSuite`, the CuikSuite 3.1 measured by us after shortcuts \
and 1000 iterations of its effort minimisation. Its smoothed paths collide, at samples and \
between them.
";

/// A problem of the suite, with the figures that others report.
struct Case {
    name: &'static str,
    plans: usize,
    /// Effort after optimisation, and its time, s.
    paper: [f64; 2],
    peer: [f64; 2],
}

const CASES: [Case; 5] = [
    Case {
        name: "kite",
        plans: 1,
        paper: [11.37, 10.0],
        peer: [10.9, 7.1],
    },
    Case {
        name: "free_flying",
        plans: 6,
        paper: [20.19, 28.0],
        peer: [14.2, 11.0],
    },
    Case {
        name: "tower",
        plans: 1,
        paper: [9.54, 120.0],
        peer: [7.04, 51.0],
    },
    Case {
        name: "prism",
        plans: 1,
        paper: [2.89, 5.0],
        peer: [2.893, 2.8],
    },
    Case {
        name: "robot",
        plans: 1,
        paper: [4.81, 85.0],
        peer: [3.74, 65.0],
    },
];

/// Figures of a successful run.
struct Run {
    effort: f64,
    effort_before: Option<f64>,
    length: f64,
    optimality: f64,
    seconds: f64,
    iterations: f64,
    converged: bool,
}

pub fn measure(arguments: &BenchArguments) -> Result<Results, Error> {
    let known: Vec<&str> = CASES.iter().map(|case| case.name).collect();
    if let Some(unknown) = arguments
        .cases
        .iter()
        .find(|name| !known.contains(&name.as_str()))
    {
        let choice = known.join(", ");
        return Err(format!("the suite has no case {unknown}: choose from {choice}").into());
    }
    let (mut rows, mut failures, mut efforts) = (Vec::new(), Vec::new(), Vec::new());
    for (index, case) in CASES.iter().enumerate() {
        if !arguments.selects_case(case.name, index) {
            continue;
        }
        let file = root().join(format!("fixtures/{}.toml", case.name));
        let mut problem = Problem::read(&file).map_err(|errors| format!("{errors:#}"))?;
        problem.settings.time_limit = arguments.time_limit;
        let mut runs = Vec::new();
        for seed in 1..=arguments.seed_count() {
            problem.seed = seed;
            match run(&problem, case.plans) {
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
        efforts.push((case, runs));
    }
    Ok(Results {
        introduction: INTRODUCTION,
        picture: picture(&efforts)?,
        rows,
        failures,
    })
}

/// Plans, smooths and judges; the error says why the run is no success.
fn run(problem: &Problem, plans: usize) -> Result<Run, String> {
    let options = SmoothingOptions::of(problem);
    let found = tensegra::plan_and_smooth(problem, plans, &options, &mut ())
        .map_err(|error| error.to_string())?;
    let SmoothedPlan {
        smoothing,
        smoothing_seconds,
        ..
    } = found;
    if !smoothing.report.ok {
        let reasons = smoothing
            .report
            .failures
            .iter()
            .map(|failure| failure.message.as_str());
        let reasons: Vec<&str> = reasons.collect();
        return Err(format!(
            "the judge refuses the path: {}",
            reasons.join("; ")
        ));
    }
    match (smoothing.control_effort, smoothing.optimality) {
        (Some(effort), Some(optimality)) => Ok(Run {
            effort,
            effort_before: smoothing.control_effort_before,
            length: smoothing.path_length,
            optimality,
            seconds: smoothing_seconds,
            iterations: smoothing.iterations as f64,
            converged: smoothing.converged,
        }),
        (None, _) => Err("the path passes a singular point".to_owned()),
        (_, None) => Err(smoothing
            .setback
            .unwrap_or_else(|| "not smoothed".to_owned())),
    }
}

fn rows_of(case: &Case, count: usize, runs: &[Run]) -> Vec<BenchRow> {
    let references = |figure: usize| {
        [
            ("paper", case.paper[figure]),
            ("CuikSuite", case.peer[figure]),
        ]
        .map(|(source, value)| ReferenceValue {
            source: source.to_owned(),
            value,
        })
    };
    let row = |metric: &str, unit: &str, samples: &[f64]| {
        let mut row = BenchRow::new(case.name, metric, unit, count, samples);
        row.success = runs.len();
        row.suite = SUITE.to_owned();
        row
    };
    let all = |quantity: fn(&Run) -> f64| -> Vec<f64> { runs.iter().map(quantity).collect() };
    let most = |metric: &str, unit: &str, mut samples: Vec<f64>| {
        samples.sort_by(f64::total_cmp);
        let mut row = row(metric, unit, &[]);
        row.median = quantile(&samples, 1.0);
        row
    };
    let before: Vec<f64> = runs.iter().filter_map(|run| run.effort_before).collect();
    let mut effort = row("control effort", "1", &all(|run| run.effort));
    effort.reference = references(0).to_vec();
    let mut seconds = row("smoothing time", "s", &all(|run| run.seconds));
    seconds.reference = references(1).to_vec();
    vec![
        effort,
        most("control effort, maximum", "1", all(|run| run.effort)),
        row("control effort before", "1", &before),
        row("path length", "1", &all(|run| run.length)),
        seconds,
        most("smoothing time, maximum", "s", all(|run| run.seconds)),
        row("iterations", "1", &all(|run| run.iterations)),
        row("optimality", "1", &all(|run| run.optimality)),
        row(
            "share converged",
            "1",
            &all(|run| f64::from(u8::from(run.converged))),
        ),
    ]
}

/// Distributions of efforts, over the smallest effort of each case.
fn picture(efforts: &[(&Case, Vec<Run>)]) -> Result<Option<Picture>, Error> {
    let mut chart = Chart::new(
        Axis::new("control effort over the smallest"),
        Axis::new("share of successful runs").range(0.0, 1.0),
    )
    .title("Control effort after smoothing");
    let mut any = false;
    for (case, runs) in efforts.iter().filter(|(_, runs)| !runs.is_empty()) {
        any = true;
        let least = runs.iter().fold(f64::INFINITY, |l, run| l.min(run.effort));
        let values: Vec<f64> = runs.iter().map(|run| run.effort / least).collect();
        chart = chart.series(Series::distribution(case.name, &values));
    }
    Ok(if any { Some(chart.draw()?) } else { None })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_hold_medians_and_maxima_beside_references() {
        let run = |effort| Run {
            effort,
            effort_before: Some(2.0 * effort),
            length: effort,
            optimality: 1e-4,
            seconds: 0.1,
            iterations: 30.0,
            converged: true,
        };
        let rows = rows_of(&CASES[0], 4, &[run(9.0), run(10.0), run(11.0)]);
        assert!(rows.iter().all(|row| (row.runs, row.success) == (4, 3)));
        assert_eq!((rows[0].median, rows[1].median), (Some(10.0), Some(11.0)));
        assert_eq!(rows[0].reference.len(), 2);
        let none = rows_of(&CASES[0], 4, &[]);
        assert!(
            none.iter()
                .all(|row| (row.success, row.median) == (0, None))
        );
        assert!(picture(&[(&CASES[0], Vec::new())]).unwrap().is_none());
    }
}
