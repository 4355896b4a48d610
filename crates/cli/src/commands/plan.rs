//! `tensegra plan`: plans a motion, judges it, and writes it for other tools.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::ValueEnum;
use serde_json::{Value, json};
use tensegra::{
    Plan, PlanningError, SmoothedPlan, Smoothing, SmoothingOptions,
    check::{Check, CheckOptions, Report, check_path},
    io::{
        LogOptions, PathFile, Picture, Quantity, Units, draw_configuration, draw_forces,
        draw_paths, draw_snapshots, write_log, write_path_file,
    },
    model::{self, NeighbourSearch, PlannerKind, Problem, SamplingRadius},
    sampling::{Statistics, StopCounts},
};

use super::{
    Formulation, StabilityArguments,
    axes::{parse_axes, three_lengths},
    formulation_name, outcomes_failure, parse_seconds, parse_seeds, print_outcomes, print_written,
    read_problem, require_writable,
    smooth::{add_json, draw_before_and_after, print},
    stiffness_json, stiffness_text, write_pictures,
};
use crate::{failure::Failure, progress::Spinner};

/// Snapshots between start and goal in the picture of the motion.
const SNAPSHOTS: usize = 4;

/// Plan a motion from the problem's start to its goal, judge it, and write it.
///
/// Writes into the output folder: path.json (the path), path.mcap (for
/// Foxglove), and pictures as SVG and PNG: start, goal, snapshots, forces along
/// the path, and the path in the space of three cable lengths.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    tensegra plan fixtures/kite.toml\n  \
    tensegra plan fixtures/kite.toml --seed 7 --formulation directions --out /tmp/kite\n  \
    tensegra plan fixtures/kite.toml --seeds 1..20 --json\n  \
    tensegra plan fixtures/free_flying.toml --smooth --plans 6\n  \
    tensegra plan fixtures/tower.toml --stable=0.01\n\n\
    Exit status: 0 solved and accepted by the judge, 1 not, 2 bad input.")]
pub struct Arguments {
    /// Problem (.toml) or structure (.tens) file.
    problem: PathBuf,
    /// Seed of every random choice [default: the problem's].
    #[arg(long, conflicts_with = "seeds")]
    seed: Option<u64>,
    /// Plan with every seed from A to B (both included); each seed writes its
    /// path.json and path.mcap into a folder of its own, without pictures.
    #[arg(long, value_name = "A..B", value_parser = parse_seeds)]
    seeds: Option<(u64, u64)>,
    /// Coordinates of the equilibrium manifold [default: the problem's].
    #[arg(long, value_enum)]
    formulation: Option<Formulation>,
    /// Planner [default: the problem's].
    #[arg(long, value_enum)]
    planner: Option<Planner>,
    /// Radius from which samples are drawn around a chart's centre: a number for all
    /// charts, `adaptive` (a radius for each chart, which grows with success and shrinks
    /// with failure), or `automatic`, which is adaptive [default: the problem's].
    #[arg(long, value_name = "R", value_parser = parse_radius, allow_negative_numbers = true)]
    sampling_radius: Option<SamplingRadius>,
    /// How the node nearest to a sample is found: all ways find the same one
    /// [default: the problem's].
    #[arg(long, value_enum)]
    neighbours: Option<Neighbours>,
    /// Stop branches at limits and contacts instead of sliding along them.
    #[arg(long)]
    no_slide: bool,
    /// CPU seconds after which planning is given up [default: the problem's].
    #[arg(long, value_name = "S", value_parser = parse_seconds, allow_negative_numbers = true)]
    time_limit: Option<f64>,
    #[command(flatten)]
    stability: StabilityArguments,
    /// Smooth the path: shortcuts, then the path of least control effort near it.
    #[arg(long)]
    smooth: bool,
    /// Plan K times with seeds that follow from the first, smooth every path on a coarse
    /// mesh, and the shortest to the end; plans of poor classes are replaced, K times at
    /// most.
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u32).range(1..))]
    plans: Option<u32>,
    /// Axes of the picture of the path: three of length:ELEMENT,
    /// rest:ELEMENT, force:ELEMENT, x:NODE, y:NODE, z:NODE [default: the lengths
    /// of the first three cables].
    #[arg(long, value_name = "A,B,C")]
    axes: Option<String>,
    /// Output folder [default: out/NAME].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print one JSON object (with --seeds, an array of them).
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Planner {
    /// AtlasRRT with a tree from the start and one from the goal.
    TwoTrees,
    /// AtlasRRT with a tree from the start.
    OneTree,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Neighbours {
    /// Nodes grouped by chart.
    Chart,
    /// All nodes, one after the other.
    Linear,
    /// A k-d tree.
    KdTree,
}

fn parse_radius(text: &str) -> Result<SamplingRadius, String> {
    match (text, text.parse::<f64>()) {
        ("adaptive", _) => Ok(SamplingRadius::Adaptive),
        ("automatic", _) => Ok(SamplingRadius::Automatic),
        (_, Ok(radius)) if radius.is_finite() && radius > 0.0 => Ok(SamplingRadius::Fixed(radius)),
        _ => Err(format!(
            "`{text}` is no radius; give a positive number, `adaptive` or `automatic`"
        )),
    }
}

/// One run of the planner with what was made of it.
struct Outcome {
    seed: u64,
    result: Result<Solved, (PlanningError, Statistics)>,
}

struct Solved {
    plan: Plan,
    /// The path before smoothing, and the figures.
    smoothed: Option<Smoothed>,
    report: Report,
    check_seconds: f64,
    write_seconds: f64,
    files: Vec<PathBuf>,
}

/// What became of the path found.
struct Smoothed {
    before: model::Path,
    smoothing: Smoothing,
    /// Lengths of all plans on the coarse mesh.
    draft_lengths: Vec<Option<f64>>,
    /// Efforts of the plans that were smoothed to the end.
    efforts: Vec<Option<f64>>,
    planning_seconds: f64,
    smoothing_seconds: f64,
}

/// Runs the verb.
pub fn run(arguments: &Arguments) -> Result<bool, Failure> {
    let outcomes = plan_all(arguments).map_err(|failure| {
        outcomes_failure(arguments.json, arguments.seeds.is_some(), "solved", failure)
    })?;
    let accepted = |outcome: &Outcome| matches!(&outcome.result, Ok(s) if s.report.ok);
    let success = outcomes.iter().all(accepted);
    match (arguments.json, arguments.seeds.is_some()) {
        (true, many) => print_outcomes(outcomes.iter().map(as_json), many),
        (false, true) => print_many(&outcomes),
        (false, false) => outcomes.iter().for_each(print_one),
    }
    Ok(success)
}

fn plan_all(arguments: &Arguments) -> Result<Vec<Outcome>, Failure> {
    let mut problem = read_problem(&arguments.problem)?;
    if let Some(formulation) = arguments.formulation {
        problem.settings.formulation = formulation.into();
    }
    if let Some(planner) = arguments.planner {
        problem.settings.planner = match planner {
            Planner::TwoTrees => PlannerKind::TwoTrees,
            Planner::OneTree => PlannerKind::OneTree,
        };
    }
    if let Some(radius) = arguments.sampling_radius {
        problem.settings.sampling_radius = radius;
    }
    if let Some(neighbours) = arguments.neighbours {
        problem.settings.neighbours = match neighbours {
            Neighbours::Chart => NeighbourSearch::ByChart,
            Neighbours::Linear => NeighbourSearch::Linear,
            Neighbours::KdTree => NeighbourSearch::KdTree,
        };
    }
    if arguments.no_slide {
        problem.settings.slide = false;
    }
    arguments.stability.apply(&mut problem);
    if let Some(seconds) = arguments.time_limit {
        problem.settings.time_limit = seconds;
    }
    let out = arguments
        .out
        .clone()
        .unwrap_or_else(|| Path::new("out").join(&problem.name));
    require_writable(&out)?;
    let request = Request {
        plans: match arguments.plans {
            Some(plans) => Some(plans as usize),
            None => arguments.smooth.then_some(1),
        },
        axes: match &arguments.axes {
            Some(text) => Some(parse_axes(text, &problem.structure)?),
            None => three_lengths(&problem),
        },
    };
    let (first, last) = arguments
        .seeds
        .unwrap_or_else(|| (arguments.seed.unwrap_or(problem.seed), problem.seed));
    let last = if arguments.seeds.is_some() {
        last
    } else {
        first
    };
    (first..=last)
        .map(|seed| {
            problem.seed = seed;
            let (folder, pictures) = match arguments.seeds {
                Some(_) => (out.join(format!("seed-{seed}")), false),
                None => (out.clone(), true),
            };
            plan_one(&problem, &request, &folder, pictures)
        })
        .collect()
}

/// What is to be done besides planning.
struct Request {
    /// How many plans are smoothed, if at all.
    plans: Option<usize>,
    /// Axes of the picture of the path.
    axes: Option<[Quantity; 3]>,
}

/// Plans, and smooths where asked to.
fn find(problem: &Problem, request: &Request) -> Result<(Plan, Option<Smoothed>), PlanningError> {
    let mut spinner = Spinner::new(&format!("planning {}, seed {}", problem.name, problem.seed));
    let Some(plans) = request.plans else {
        return Ok((tensegra::plan(problem, &mut spinner)?, None));
    };
    let options = SmoothingOptions::of(problem);
    let SmoothedPlan {
        mut plan,
        smoothing,
        draft_lengths,
        efforts,
        planning_seconds,
        smoothing_seconds,
        ..
    } = tensegra::plan_and_smooth(problem, plans, &options, &mut spinner)?;
    let before = std::mem::replace(&mut plan.path, smoothing.path.clone());
    plan.path_length = smoothing.path_length;
    plan.control_effort = smoothing.control_effort;
    let smoothed = Smoothed {
        before,
        smoothing,
        draft_lengths,
        efforts,
        planning_seconds,
        smoothing_seconds,
    };
    Ok((plan, Some(smoothed)))
}

fn plan_one(
    problem: &Problem,
    request: &Request,
    folder: &Path,
    pictures: bool,
) -> Result<Outcome, Failure> {
    let complete = match tensegra::find_endpoints(problem) {
        Ok(complete) => complete,
        Err(error) => return Err(Failure::message(PlanningError::from(error))),
    };
    let problem = complete.as_ref();
    let (plan, smoothed) = match find(problem, request) {
        Ok(found) => found,
        Err(error) => match error.statistics().copied() {
            Some(statistics) => {
                return Ok(Outcome {
                    seed: problem.seed,
                    result: Err((error, statistics)),
                });
            }
            None => return Err(Failure::message(error)),
        },
    };
    let clock = Instant::now();
    let report = check_path(problem, &plan.path, &CheckOptions::default());
    let check_seconds = clock.elapsed().as_secs_f64();
    let clock = Instant::now();
    let mut solved = Solved {
        plan,
        smoothed,
        report,
        check_seconds,
        write_seconds: 0.0,
        files: Vec::new(),
    };
    solved.files = write(problem, &solved, request.axes, folder, pictures)?;
    solved.write_seconds = clock.elapsed().as_secs_f64();
    Ok(Outcome {
        seed: problem.seed,
        result: Ok(solved),
    })
}

/// Writes path, log and pictures; returns their names, the path first.
fn write(
    problem: &Problem,
    solved: &Solved,
    axes: Option<[Quantity; 3]>,
    folder: &Path,
    pictures: bool,
) -> Result<Vec<PathBuf>, Failure> {
    let plan = &solved.plan;
    let mut files = vec![folder.join("path.json"), folder.join("path.mcap")];
    let mut contents = PathFile::new(problem, plan.path.clone());
    contents.statistics = statistics_json(&plan.statistics, plan.planning_seconds);
    if let Some(smoothed) = &solved.smoothed {
        add_json(&mut contents.statistics, &smoothed.smoothing);
    }
    contents.check = json!(solved.report);
    write_path_file(&files[0], &contents).map_err(Failure::message)?;
    write_log(&files[1], problem, &plan.path, &LogOptions::default()).map_err(Failure::message)?;
    if !pictures {
        return Ok(files);
    }
    let (structure, environment) = (&problem.structure, &problem.environment);
    let units = Units::default();
    let configurations = &plan.path.configurations;
    let mut drawn: Vec<(&str, Picture)> = Vec::new();
    let mut draw = |name, picture: Result<Picture, tensegra::io::PictureError>| {
        picture
            .map(|picture| drawn.push((name, picture)))
            .map_err(Failure::message)
    };
    for (name, configuration) in [
        ("start", configurations.first()),
        ("goal", configurations.last()),
    ] {
        if let Some(configuration) = configuration {
            let title = format!("{}: {name}", problem.name);
            draw(
                name,
                draw_configuration(structure, environment, configuration, &title, &units),
            )?;
        }
    }
    draw(
        "snapshots",
        draw_snapshots(structure, environment, &plan.path, SNAPSHOTS, &units),
    )?;
    draw("forces", draw_forces(structure, &plan.path, &units))?;
    if let Some(axes) = axes {
        match &solved.smoothed {
            Some(Smoothed { before, .. }) => {
                let (name, picture) = draw_before_and_after(problem, before, &plan.path, axes);
                draw(name, picture)?;
            }
            None => {
                let paths = [("path", &plan.path)];
                draw("lengths", draw_paths(structure, &paths, axes, &units))?;
            }
        }
    }
    write_pictures(folder, &drawn, &mut files)?;
    Ok(files)
}

fn statistics_json(s: &Statistics, planning_seconds: f64) -> Value {
    json!({
        "planning_seconds": planning_seconds,
        "charts": s.charts,
        "nodes": s.nodes,
        "restarts": s.restarts,
        "extensions": s.extensions,
        "productive_extensions": s.productive_extensions,
        "projections": s.projections,
        "chord_iterations": s.chord_iterations,
        "newton_iterations": s.newton_iterations,
        "validity_tests": s.validity_tests,
        "sliding_steps": s.sliding_steps,
        "stops": stops(&s.stops).into_iter().map(|(k, v)| (k.to_owned(), json!(v)))
            .collect::<serde_json::Map<_, _>>(),
    })
}

fn stops(stops: &StopCounts) -> [(&'static str, usize); 8] {
    [
        ("reached", stops.reached),
        ("limit", stops.limit),
        ("contact", stops.contact),
        ("blocked", stops.blocked),
        ("no_progress", stops.no_progress),
        ("correction", stops.correction),
        ("projection", stops.projection),
        ("singular", stops.singular),
    ]
}

fn as_json(outcome: &Outcome) -> Value {
    match &outcome.result {
        Ok(solved) => {
            let plan = &solved.plan;
            let mut value = json!({
                "solved": true,
                "seed": outcome.seed,
                "formulation": formulation_name(plan.formulation),
                "planning_seconds": plan.planning_seconds,
                "charts": plan.statistics.charts,
                "nodes": plan.statistics.nodes,
                "dimension": plan.dimension,
                "configurations": plan.path.configurations.len(),
                "path_length": plan.path_length,
                "control_effort": plan.control_effort,
                "least_stiffness": stiffness_json(plan.least_stiffness),
                "path": solved.files[0],
                "files": solved.files,
                "statistics": statistics_json(&plan.statistics, plan.planning_seconds),
                "check": solved.report,
            });
            if let Some(smoothed) = &solved.smoothed {
                add_json(&mut value, &smoothed.smoothing);
                value["plans"] = json!(smoothed.efforts.len());
                value["control_effort_of_plans"] = json!(smoothed.efforts);
                value["draft_length_of_plans"] = json!(smoothed.draft_lengths);
                value["planning_seconds"] = json!(smoothed.planning_seconds);
                value["smoothing_seconds"] = json!(smoothed.smoothing_seconds);
            }
            value
        }
        Err((error, statistics)) => json!({
            "solved": false,
            "seed": outcome.seed,
            "planning_seconds": statistics.seconds,
            "charts": statistics.charts,
            "nodes": statistics.nodes,
            "path_length": null,
            "control_effort": null,
            "path": null,
            "error": error.to_string(),
            "statistics": statistics_json(statistics, statistics.seconds),
            "check": null,
        }),
    }
}

fn print_one(outcome: &Outcome) {
    match &outcome.result {
        Ok(solved) => print_solved(outcome.seed, solved),
        Err((error, statistics)) => {
            say!("not solved         {error}");
            print_statistics(statistics);
        }
    }
}

fn print_solved(seed: u64, solved: &Solved) {
    let Solved { plan, report, .. } = solved;
    say!(
        "solved             seed {seed}, formulation {}",
        formulation_name(plan.formulation)
    );
    say!(
        "time               preparation {:.4} s, planning {:.4} s, check {:.3} s, writing {:.3} s",
        plan.preparation_seconds,
        plan.planning_seconds,
        solved.check_seconds,
        solved.write_seconds
    );
    print_statistics(&plan.statistics);
    match &solved.smoothed {
        Some(smoothed) => print_smoothed(smoothed),
        None => say!(
            "path               {} configurations, length {:.4}, control effort {}",
            plan.path.configurations.len(),
            plan.path_length,
            effort_text(plan)
        ),
    }
    for (label, check) in [
        ("clearance", Check::Clearance),
        ("  between samples", Check::ClearanceBetween),
        ("largest step", Check::Displacement),
        ("worst balance", Check::Balance),
    ] {
        if let Some(figure) = report.figure(check) {
            say!(
                "{label:<18} {:.3e}  {} {}",
                figure.value,
                figure.subject,
                figure.location
            );
        }
    }
    say!(
        "least stiffness    {}",
        stiffness_text(plan.least_stiffness)
    );
    if report.ok {
        say!("check              accepted by the independent judge");
    } else {
        say!("check              REFUSED by the independent judge");
        for failure in &report.failures {
            say!("                   {}", failure.message);
        }
    }
    print_written(&solved.files);
}

fn print_smoothed(smoothed: &Smoothed) {
    print(&smoothed.smoothing);
    if smoothed.efforts.len() > 1 {
        let lengths: Vec<String> = smoothed
            .draft_lengths
            .iter()
            .map(|length| length.map_or_else(|| "-".to_owned(), |l| format!("{l:.3}")))
            .collect();
        say!(
            "lengths of plans   {} on a coarse mesh; {} smoothed to the end; {:.4} s of planning, \
             {:.3} s of smoothing",
            lengths.join(", "),
            smoothed.efforts.iter().flatten().count(),
            smoothed.planning_seconds,
            smoothed.smoothing_seconds
        );
    }
}

fn effort_text(plan: &Plan) -> String {
    plan.control_effort
        .map_or_else(|| "-".to_owned(), |effort| format!("{effort:.4}"))
}

fn print_statistics(s: &Statistics) {
    say!(
        "search             {} charts, {} nodes, {} branches ({} productive)",
        s.charts,
        s.nodes,
        s.extensions,
        s.productive_extensions
    );
    if s.restarts > 0 {
        say!("restarts           {}", s.restarts);
    }
    let reasons: Vec<String> = stops(&s.stops)
        .iter()
        .filter(|(_, count)| *count > 0)
        .map(|(reason, count)| format!("{} {count}", reason.replace('_', " ")))
        .collect();
    say!("branches ended     {}", reasons.join(", "));
}

fn print_many(outcomes: &[Outcome]) {
    say!("  seed  solved  check     planning s   charts    nodes   length   effort");
    let mut seconds = Vec::new();
    for outcome in outcomes {
        match &outcome.result {
            Ok(Solved { plan, report, .. }) => {
                seconds.push(plan.planning_seconds);
                say!(
                    "{:>6}  yes     {:<8} {:>11.5} {:>8} {:>8} {:>8.3} {:>8}",
                    outcome.seed,
                    if report.ok { "accepted" } else { "REFUSED" },
                    plan.planning_seconds,
                    plan.statistics.charts,
                    plan.statistics.nodes,
                    plan.path_length,
                    effort_text(plan)
                );
            }
            Err((error, statistics)) => say!(
                "{:>6}  NO               {:>11.5} {:>8} {:>8}  {error}",
                outcome.seed,
                statistics.seconds,
                statistics.charts,
                statistics.nodes
            ),
        }
    }
    seconds.sort_by(f64::total_cmp);
    if let Some(median) = tensegra::io::quantile(&seconds, 0.5) {
        say!(
            "{} of {} solved; median planning time {median:.5} s",
            seconds.len(),
            outcomes.len()
        );
    }
}
