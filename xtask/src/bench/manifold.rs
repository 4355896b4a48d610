//! Suite `manifold`: the five planning problems of Porta and Hernández-Juan
//! (2016) on equilibrium manifolds.

use tensegra::{
    check::{Check, CheckOptions, check_path},
    io::{Axis, BenchRow, Chart, Picture, ReferenceValue, Series, quantile},
    model::{Formulation, NeighbourSearch, PlannerKind, PlannerSettings, Problem, SamplingRadius},
};

use super::{BenchArguments, Results, RunFailure, scaling};
use crate::{Error, root};

pub const SUITE: &str = "manifold";

const INTRODUCTION: &str = "\
Planning problems of Porta and Hernández-Juan (2016), from start to goal without smoothing. The \
variant without a name is the default: formulation `nodes`, two trees, one sampling radius, sliding \
along limits and contacts; each other variant differs from it in what it is named after, and is \
given up after 5 s. A run \
is a success when a path is found and the judge accepts it, clearance between the samples \
included. Planning time is CPU time of planning alone; path length and control effort are in the \
coordinates of the paper; the smallest clearance, in units of length, is the one proven for the \
whole motion; force balance is the largest unbalanced force over the largest force. A percentile \
or maximum stands in the column of the median. Of the branches begun, `productive branches` added \
a node, and `stopped at limits and contacts` ended where these left no way on.

The case `scaling` takes planar towers of 2 to 12 stages: CPU time of planning over the nodes of the \
trees and over the charts, and the exponents of the power laws in the number of elements that fit \
them best.

References: `paper`, the table of Porta and Hernández-Juan (2016), on a machine of its time, \
control effort before smoothing; `CuikSuite`, the CuikSuite 3.1 measured by us with its shipped \
parameters, one thread of a machine like the one below.
";

/// A problem of the suite, with the figures that others report.
struct Case {
    name: &'static str,
    paper: Figures,
    peer: Figures,
    /// Longest planning time of the peer, s.
    peer_longest: f64,
}

/// A row of others' figures.
struct Figures {
    seconds: f64,
    charts: f64,
    nodes: f64,
    effort: f64,
}

const fn figures(seconds: f64, charts: f64, nodes: f64, effort: f64) -> Figures {
    Figures {
        seconds,
        charts,
        nodes,
        effort,
    }
}

/// The cases: each is fixtures/NAME.toml. The peer's figures are medians of
/// seconds (the faster of two series of runs) and typical counts.
const CASES: [Case; 5] = [
    Case {
        name: "kite",
        paper: figures(0.16, 165.0, 1456.0, 18.21),
        peer: figures(0.106, 240.0, 2275.0, 23.1),
        peer_longest: 0.33,
    },
    Case {
        name: "free_flying",
        paper: figures(25.59, 3368.0, 34053.0, 50.68),
        peer: figures(2.20, 3860.0, 36040.0, 40.2),
        peer_longest: 11.8,
    },
    Case {
        name: "tower",
        paper: figures(8.69, 229.0, 2620.0, 25.74),
        peer: figures(10.6, 248.0, 3534.0, 16.3),
        peer_longest: 114.0,
    },
    Case {
        name: "prism",
        paper: figures(0.04, 17.0, 167.0, 4.65),
        peer: figures(0.0148, 17.0, 161.0, 4.34),
        peer_longest: 0.062,
    },
    Case {
        name: "robot",
        paper: figures(5.08, 175.0, 1576.0, 11.12),
        peer: figures(1.21, 131.0, 1196.0, 5.98),
        peer_longest: 4.3,
    },
];

/// A way of planning that is compared with the default.
struct Variant {
    /// Empty for the default.
    name: &'static str,
    apply: fn(&mut PlannerSettings),
    /// Cases that it is run on; all when empty.
    cases: &'static [&'static str],
}

/// CPU seconds after which variants are given up.
const PATIENCE: f64 = 5.0;

const VARIANTS: [Variant; 7] = [
    Variant {
        name: "",
        apply: |settings| {
            settings.formulation = Formulation::Nodes;
            settings.planner = PlannerKind::TwoTrees;
            settings.sampling_radius = SamplingRadius::Automatic;
            settings.neighbours = NeighbourSearch::ByChart;
            settings.slide = true;
        },
        cases: &[],
    },
    Variant {
        name: "directions",
        apply: |settings| settings.formulation = Formulation::Directions,
        // Elsewhere its many variables make it a matter of patience.
        cases: &["kite", "prism"],
    },
    Variant {
        name: "one tree",
        apply: |settings| settings.planner = PlannerKind::OneTree,
        cases: &[],
    },
    Variant {
        name: "fixed radius",
        apply: |settings| settings.sampling_radius = SamplingRadius::Fixed(6.0),
        cases: &[],
    },
    Variant {
        name: "linear search",
        apply: |settings| settings.neighbours = NeighbourSearch::Linear,
        cases: &[],
    },
    Variant {
        name: "k-d tree",
        apply: |settings| settings.neighbours = NeighbourSearch::KdTree,
        cases: &[],
    },
    Variant {
        name: "no sliding",
        apply: |settings| settings.slide = false,
        // Elsewhere nothing is found in time.
        cases: &["kite", "tower", "prism", "robot"],
    },
];

/// Figures of a successful run.
#[derive(Clone, Debug, Default)]
struct Run {
    seconds: f64,
    charts: f64,
    nodes: f64,
    path_length: f64,
    control_effort: Option<f64>,
    /// None where the problem has no pairs of bodies.
    clearance: Option<f64>,
    displacement: Option<f64>,
    balance: Option<f64>,
    branches: f64,
    /// Shares of the branches.
    productive: f64,
    obstructed: f64,
}

/// Planning times of a variant of a case, with the number of runs.
struct Times {
    variant: &'static str,
    runs: usize,
    seconds: Vec<f64>,
}

pub fn measure(arguments: &BenchArguments) -> Result<Results, Error> {
    let mut known = CASES.each_ref().map(|case| case.name).to_vec();
    known.push(scaling::NAME);
    arguments.refuse_unknown_cases(&known)?;
    let mut rows = Vec::new();
    let mut failures = Vec::new();
    let mut times: Vec<(&str, Vec<Times>)> = Vec::new();
    for (index, case) in CASES.iter().enumerate() {
        if !arguments.selects_case(case.name, index) {
            continue;
        }
        let file = root().join(format!("fixtures/{}.toml", case.name));
        // The first case is always there; others are left out only while the
        // problem is not, and never when they are asked for by name.
        if index > 0 && arguments.cases.is_empty() && !file.exists() {
            eprintln!("{}: left out, there is no {}", case.name, file.display());
            continue;
        }
        let default = Problem::read(&file).map_err(|errors| format!("{errors:#}"))?;
        let mut times_of_case = Vec::new();
        for variant in &VARIANTS {
            let everywhere = variant.cases.is_empty() || variant.cases.contains(&case.name);
            if !everywhere || (arguments.quick && !variant.name.is_empty()) {
                continue;
            }
            let mut problem = default.clone();
            (VARIANTS[0].apply)(&mut problem.settings);
            (variant.apply)(&mut problem.settings);
            problem.settings.time_limit = if variant.name.is_empty() {
                arguments.time_limit
            } else {
                arguments.time_limit.min(PATIENCE)
            };
            let mut runs = Vec::new();
            for seed in 1..=arguments.seed_count() {
                problem.seed = seed;
                match run(&problem) {
                    Ok(run) => runs.push(run),
                    Err(reason) => failures.push(RunFailure {
                        case: case.name.to_owned(),
                        variant: variant.name.to_owned(),
                        seed,
                        reason,
                    }),
                }
            }
            let count = arguments.seed_count() as usize;
            eprintln!("{} {}: {}/{count}", case.name, variant.name, runs.len());
            times_of_case.push(Times {
                variant: variant.name,
                runs: count,
                seconds: runs.iter().map(|run| run.seconds).collect(),
            });
            rows.extend(rows_of(case, variant.name, count, &runs));
        }
        times.push((case.name, times_of_case));
    }
    let mut pictures = pictures(&times)?;
    if arguments.selects_case(scaling::NAME, CASES.len()) {
        pictures.push(scaling::measure(arguments, &mut rows)?);
    }
    Ok(Results {
        introduction: INTRODUCTION,
        picture: (!pictures.is_empty()).then(|| Picture::grid(&pictures, 2)),
        rows,
        failures,
    })
}

/// Plans and judges; the error says why the run is no success.
fn run(problem: &Problem) -> Result<Run, String> {
    let plan = tensegra::plan(problem, &mut ()).map_err(|error| error.to_string())?;
    let report = check_path(problem, &plan.path, &CheckOptions::default());
    if !report.ok {
        let reasons = report
            .failures
            .iter()
            .map(|failure| failure.message.as_str());
        let reasons: Vec<&str> = reasons.collect();
        return Err(format!(
            "the judge refuses the path: {}",
            reasons.join("; ")
        ));
    }
    let statistics = &plan.statistics;
    let stops = &statistics.stops;
    let share = |count: usize| count as f64 / statistics.extensions as f64;
    let figure = |check| report.figure(check).map(|figure| figure.value);
    let clearances = [Check::Clearance, Check::ClearanceBetween]
        .into_iter()
        .filter_map(figure);
    Ok(Run {
        seconds: plan.planning_seconds,
        charts: statistics.charts as f64,
        nodes: statistics.nodes as f64,
        path_length: plan.path_length,
        control_effort: plan.control_effort,
        clearance: clearances.reduce(f64::min),
        displacement: figure(Check::Displacement),
        balance: figure(Check::Balance),
        branches: statistics.extensions as f64,
        productive: share(statistics.productive_extensions),
        obstructed: share(stops.limit + stops.contact),
    })
}

/// The rows of one variant of a case.
fn rows_of(case: &Case, variant: &str, count: usize, runs: &[Run]) -> Vec<BenchRow> {
    let both = |figure: fn(&Figures) -> f64| {
        vec![
            ("paper", figure(&case.paper)),
            ("CuikSuite", figure(&case.peer)),
        ]
    };
    let row = |metric, unit, samples: &[f64], reference: Vec<(&str, f64)>| {
        let mut row = BenchRow::new(case.name, metric, unit, count, samples);
        // Also where a quantity does not exist, a success is one.
        row.success = runs.len();
        row.suite = SUITE.to_owned();
        row.variant = variant.to_owned();
        row.reference = reference
            .into_iter()
            .map(|(source, value)| ReferenceValue {
                source: source.to_owned(),
                value,
            })
            .collect();
        row
    };
    let all = |quantity: fn(&Run) -> f64| -> Vec<f64> { runs.iter().map(quantity).collect() };
    let some = |quantity: fn(&Run) -> Option<f64>| -> Vec<f64> {
        runs.iter().filter_map(quantity).collect()
    };
    let seconds = all(|run| run.seconds);
    let level = |metric, level, reference| {
        let mut sorted = seconds.clone();
        sorted.sort_by(f64::total_cmp);
        let mut row = row(metric, "s", &[], reference);
        row.median = quantile(&sorted, level);
        row
    };
    vec![
        row("planning time", "s", &seconds, both(|f| f.seconds)),
        level("planning time, 95th percentile", 0.95, Vec::new()),
        level(
            "planning time, maximum",
            1.0,
            vec![("CuikSuite", case.peer_longest)],
        ),
        row("charts", "1", &all(|run| run.charts), both(|f| f.charts)),
        row("nodes", "1", &all(|run| run.nodes), both(|f| f.nodes)),
        row("path length", "1", &all(|run| run.path_length), Vec::new()),
        row(
            "control effort",
            "1",
            &some(|run| run.control_effort),
            both(|f| f.effort),
        ),
        row(
            "smallest clearance",
            "length",
            &some(|run| run.clearance),
            Vec::new(),
        ),
        row(
            "node displacement a step",
            "length",
            &some(|run| run.displacement),
            Vec::new(),
        ),
        row("force balance", "1", &some(|run| run.balance), Vec::new()),
        row("branches", "1", &all(|run| run.branches), Vec::new()),
        row(
            "productive branches",
            "1",
            &all(|run| run.productive),
            Vec::new(),
        ),
        row(
            "stopped at limits and contacts",
            "1",
            &all(|run| run.obstructed),
            Vec::new(),
        ),
    ]
}

/// Distributions of planning times: of all cases in the default variant, and of
/// the variants of each case that was run in several.
fn pictures(times: &[(&str, Vec<Times>)]) -> Result<Vec<Picture>, Error> {
    let mut pictures = Vec::new();
    let defaults = times.iter().filter_map(|(case, variants)| {
        let default = variants.iter().find(|times| times.variant.is_empty())?;
        Some((*case, default))
    });
    pictures.extend(distributions("default variant", defaults)?);
    for (case, variants) in times.iter().filter(|(_, variants)| variants.len() > 1) {
        let named = variants.iter().map(|times| {
            let name = if times.variant.is_empty() {
                "default"
            } else {
                times.variant
            };
            (name, times)
        });
        pictures.extend(distributions(case, named)?);
    }
    Ok(pictures)
}

/// Cumulated distributions in one chart; none where no run succeeded.
fn distributions<'a>(
    title: &str,
    times: impl Iterator<Item = (&'a str, &'a Times)>,
) -> Result<Option<Picture>, Error> {
    let mut chart = Chart::new(
        Axis::new("planning time").unit("s").logarithmic(),
        Axis::new("share of successful runs").range(0.0, 1.0),
    )
    .title(title);
    let mut any = false;
    for (name, times) in times.filter(|(_, times)| !times.seconds.is_empty()) {
        any = true;
        let label = format!("{name} ({}/{})", times.seconds.len(), times.runs);
        chart = chart.series(Series::distribution(label, &times.seconds));
    }
    Ok(if any { Some(chart.draw()?) } else { None })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn failed_runs_count() {
        let run = |seconds| Run {
            seconds,
            ..Run::default()
        };
        let rows = rows_of(&CASES[0], "", 4, &[run(0.1), run(0.3), run(0.2)]);
        assert!(rows.iter().all(|row| (row.runs, row.success) == (4, 3)));
        assert_eq!(rows[0].median, Some(0.2));
        assert_eq!(rows[2].median, Some(0.3));
        let none = rows_of(&CASES[0], "", 4, &[]);
        assert!(
            none.iter()
                .all(|row| (row.success, row.median) == (0, None))
        );
        assert_eq!(none[0].reference.len(), 2);
    }

    #[test]
    fn pictures_show_what_succeeded() {
        let times = |variant, seconds: &[f64]| Times {
            variant,
            runs: 3,
            seconds: seconds.to_vec(),
        };
        assert!(
            pictures(&[("kite", vec![times("", &[])])])
                .unwrap()
                .is_empty()
        );
        let variants = vec![times("", &[0.1, 0.2]), times("one tree", &[0.3])];
        let drawn = pictures(&[("kite", variants)]).unwrap();
        let svg = Picture::grid(&drawn, 2).to_svg();
        assert!(svg.contains("kite (2/3)") && svg.contains("one tree (1/3)"));
    }
}
