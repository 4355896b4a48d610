//! `tensegra walk`: plans the walk of a truss robot, judges it, and writes it for other tools.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::ValueEnum;
use serde_json::{Value, json};
use tensegra::{
    MotionSource, StoredMotionsError,
    io::{
        LogOptions, TrackingRun, draw_gait, draw_grid_plan, draw_margins, draw_track,
        draw_tracking_error, write_walk_file, write_walk_log,
    },
    lar::{
        DynamicsOptions, DynamicsReport, PlannedWalk, Walk, WalkCheck, WalkPlanner, WalkProblem,
    },
};

use super::{
    outcomes_failure, parse_seconds, parse_seeds, print_outcomes, print_written, require_writable,
    write_pictures,
};
use crate::{failure::Failure, progress::Spinner};

/// Seconds that a step takes in the log.
const SECONDS_OF_STEP: f64 = 0.04;
const UNIT: &str = "units of length";

/// Plan the walk of a linear-actuator (truss) robot along waypoints or into a goal region, judge
/// it, and write it.
///
/// A problem is a TOML file: robot (a preset, or nodes, members and support), limits, waypoints or
/// goal, obstacles, planner. Writes into the output folder: walk.json (the walk), walk.mcap (for
/// Foxglove), and pictures as SVG and PNG: gait (snapshots), track (centre of mass and support
/// polygons), margins (what is left to each limit), plan (the search over the grid, two-tier),
/// and with --simulate tracking (error of an execution by controlled actuators).
///
/// A greedy walk that gets stuck is written as far as it came.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    tensegra walk fixtures/lar/two-tier-blocks.toml\n  \
    tensegra walk fixtures/lar/greedy-s.toml --out /tmp/s --json\n  \
    tensegra walk fixtures/lar/two-tier-s.toml --simulate=2,6,12\n  \
    tensegra walk fixtures/lar/two-tier-s.toml --seeds 1..5\n  \
    tensegra walk fixtures/lar/two-tier-s.toml --motions octahedron.json\n\n\
    Exit status: 0 solved and accepted by the judge, 1 not, 2 bad input.")]
pub struct Arguments {
    /// Walk problem (.toml).
    problem: PathBuf,
    /// Planner [default: the problem's].
    #[arg(long, value_enum)]
    planner: Option<Planner>,
    /// Seed of the search for motion primitives [default: the problem's]; the greedy planner makes
    /// no random choices.
    #[arg(long, conflicts_with = "seeds")]
    seed: Option<u64>,
    /// Plan with every seed from A to B (both included), two-tier only; each seed writes its
    /// walk.json and walk.mcap into a folder of its own, without pictures.
    #[arg(long, value_name = "A..B", value_parser = parse_seeds)]
    seeds: Option<(u64, u64)>,
    /// Walk by the motions in this file, two-tier only; where it does not exist, the motions are
    /// optimised and written to it, for other goals and obstacles of the same robot.
    #[arg(long, value_name = "FILE", conflicts_with = "seeds")]
    motions: Option<PathBuf>,
    /// Run the walk on a robot of 1 kg nodes with length-controlled actuators, a roll in each of
    /// these times, lengths being metres [without times: 2,4,6,8,12].
    #[arg(
        long,
        value_name = "S,…",
        num_args = 0..,
        require_equals = true,
        value_delimiter = ',',
        default_missing_values = ["2", "4", "6", "8", "12"],
        value_parser = parse_seconds,
        conflicts_with = "seeds"
    )]
    simulate: Option<Vec<f64>>,
    /// Write walk.json and walk.mcap alone.
    #[arg(long)]
    no_pictures: bool,
    /// Output folder [default: out/NAME].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print one JSON object (with --seeds, an array of them).
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Planner {
    /// One small optimisation a step.
    Greedy,
    /// A path of support polygons walked by motion primitives.
    TwoTier,
}

/// One run of the planner with what was made of it.
struct Outcome {
    seed: u64,
    planner: WalkPlanner,
    /// The error says why there is no walk at all.
    result: Result<Planned, String>,
}

struct Planned {
    walk: Walk,
    /// Two-tier walks: where the motions came from, and the file that holds them, if any.
    motions: Option<(MotionSource, Option<PathBuf>)>,
    check: WalkCheck,
    simulations: Vec<(f64, DynamicsReport)>,
    write_seconds: f64,
    files: Vec<PathBuf>,
}

/// Runs the verb.
pub fn run(arguments: &Arguments) -> Result<bool, Failure> {
    let outcomes = plan_all(arguments).map_err(|failure| {
        outcomes_failure(arguments.json, arguments.seeds.is_some(), "solved", failure)
    })?;
    match (arguments.json, arguments.seeds.is_some()) {
        (true, many) => print_outcomes(outcomes.iter().map(as_json), many),
        (false, true) => print_many(&outcomes),
        (false, false) => outcomes.iter().for_each(print_one),
    }
    let solved = |outcome: &Outcome| matches!(&outcome.result, Ok(planned) if planned.check.valid);
    Ok(outcomes.iter().all(solved))
}

fn plan_all(arguments: &Arguments) -> Result<Vec<Outcome>, Failure> {
    let mut problem = tensegra::read_walk_problem(&arguments.problem)?;
    if let Some(planner) = arguments.planner {
        problem.planner = match planner {
            Planner::Greedy => WalkPlanner::Greedy,
            Planner::TwoTier => WalkPlanner::TwoTier,
        };
    }
    if arguments.seeds.is_some() && problem.planner == WalkPlanner::Greedy {
        return Err(Failure::Message(
            "the greedy planner makes no random choices, every seed gives the same walk; leave \
             out --seeds, or give --planner two-tier"
                .to_owned(),
        ));
    }
    if arguments.motions.is_some() && problem.planner == WalkPlanner::Greedy {
        return Err(Failure::Message(
            "the greedy planner has no motions to store; leave out --motions, or give --planner \
             two-tier"
                .to_owned(),
        ));
    }
    let out = arguments
        .out
        .clone()
        .unwrap_or_else(|| Path::new("out").join(&problem.name));
    // An unwritable folder is found before the work, not after it.
    require_writable(&out)?;
    let first = arguments.seed.unwrap_or(problem.seed);
    let (first, last) = arguments.seeds.unwrap_or((first, first));
    (first..=last)
        .map(|seed| {
            problem.seed = seed;
            let folder = match arguments.seeds {
                Some(_) => out.join(format!("seed-{seed}")),
                None => out.clone(),
            };
            plan_one(&problem, &folder, arguments)
        })
        .collect()
}

fn plan_one(
    problem: &WalkProblem,
    folder: &Path,
    arguments: &Arguments,
) -> Result<Outcome, Failure> {
    let spinner = Spinner::steady(&format!("planning {}", problem.name));
    let result = match &arguments.motions {
        None => tensegra::plan_walk(problem)
            .map(|planned| (planned, MotionSource::Optimised))
            .map_err(StoredMotionsError::from),
        Some(file) => tensegra::plan_walk_with_motions(problem, file),
    };
    drop(spinner);
    let outcome = |result| Outcome {
        seed: problem.seed,
        planner: problem.planner,
        result,
    };
    let (planned, source) = match result {
        Ok(planned) => planned,
        Err(StoredMotionsError::Plan(error)) if tensegra::is_bad_input(&error) => {
            let file = arguments.problem.display();
            return Err(Failure::Message(format!("{file}: {error}")));
        }
        Err(StoredMotionsError::Plan(error)) => return Ok(outcome(Err(error.to_string()))),
        Err(error) => return Err(Failure::message(error)),
    };
    let mut simulations = Vec::new();
    if let Some(times) = &arguments.simulate {
        let spinner = Spinner::steady("simulating");
        let reports =
            tensegra::simulate_walk(problem, &planned, times, &DynamicsOptions::default())
                .map_err(Failure::message)?;
        drop(spinner);
        simulations = times.iter().copied().zip(reports).collect();
    }
    let clock = Instant::now();
    let pictures = arguments.seeds.is_none() && !arguments.no_pictures;
    let files = write(problem, &planned, &simulations, folder, pictures)?;
    let check = planned.walk.check.clone().unwrap_or_default();
    let two_tier = planned.two_tier.is_some();
    Ok(outcome(Ok(Planned {
        walk: planned.walk,
        motions: two_tier.then(|| (source, arguments.motions.clone())),
        check,
        simulations,
        write_seconds: clock.elapsed().as_secs_f64(),
        files,
    })))
}

/// Writes walk, log and pictures; returns their names, the walk first.
fn write(
    problem: &WalkProblem,
    planned: &PlannedWalk,
    simulations: &[(f64, DynamicsReport)],
    folder: &Path,
    pictures: bool,
) -> Result<Vec<PathBuf>, Failure> {
    let walk = &planned.walk;
    let mut files = vec![folder.join("walk.json"), folder.join("walk.mcap")];
    write_walk_file(&files[0], walk).map_err(Failure::message)?;
    let duration = SECONDS_OF_STEP * walk.configurations.len() as f64;
    write_walk_log(&files[1], walk, &LogOptions::default().duration(duration))
        .map_err(Failure::message)?;
    if !pictures {
        return Ok(files);
    }
    let margins = Walk::margins(&problem.robot, &planned.motion);
    let mut drawn = vec![
        ("gait", draw_gait(walk, UNIT)),
        ("track", draw_track(walk, UNIT)),
        ("margins", draw_margins(walk, &margins, UNIT)),
    ];
    if let Some(plan) = &planned.two_tier {
        drawn.push(("plan", draw_grid_plan(walk, plan, UNIT)));
    }
    if !simulations.is_empty() {
        drawn.push(("tracking", draw_tracking_error(&runs(walk, simulations))));
    }
    let drawn = drawn
        .into_iter()
        .map(|(name, picture)| Ok((name, picture.map_err(Failure::message)?)))
        .collect::<Result<Vec<_>, Failure>>()?;
    write_pictures(folder, &drawn, &mut files)?;
    Ok(files)
}

fn runs(walk: &Walk, simulations: &[(f64, DynamicsReport)]) -> Vec<TrackingRun> {
    let run = |(seconds, report): &(f64, DynamicsReport)| TrackingRun {
        name: walk.name.clone(),
        seconds_of_roll: *seconds,
        mean_error: report.mean_error,
        errors: report.errors.clone(),
    };
    simulations.iter().map(run).collect()
}

const fn planner_name(planner: WalkPlanner) -> &'static str {
    match planner {
        WalkPlanner::Greedy => "greedy",
        WalkPlanner::TwoTier => "two-tier",
    }
}

/// A verdict as JSON, with one sentence a fault for those who only want to know why.
pub fn check_json(check: &WalkCheck) -> Value {
    let mut value = json!(check);
    value["reasons"] = check.faults.iter().map(|f| json!(f.to_string())).collect();
    value
}

fn as_json(outcome: &Outcome) -> Value {
    let planner = planner_name(outcome.planner);
    match &outcome.result {
        Ok(planned) => {
            let (walk, statistics) = (&planned.walk, &planned.walk.statistics);
            let simulations: Vec<Value> = planned
                .simulations
                .iter()
                .map(|(seconds, report)| {
                    json!({
                        "seconds_of_roll": seconds,
                        "mean_error": report.mean_error,
                        "largest_error": report.largest_error,
                        "lost": report.lost,
                        "peak_force": report.peak_force,
                        "tipping_time": report.tipping_time,
                    })
                })
                .collect();
            json!({
                "solved": planned.check.valid,
                "planner": planner,
                "seed": outcome.seed,
                "stop": statistics.stop,
                "steps": walk.configurations.len().saturating_sub(1),
                "rolls": walk.rolls.len(),
                "waypoints": walk.waypoints.len(),
                "reached": statistics.reached,
                "cost": statistics.cost,
                "actuation": statistics.actuation,
                "distance": statistics.distance,
                "planning_seconds": statistics.seconds,
                "motions": planned.motions.as_ref().map(|(source, file)| {
                    let source = match source {
                        MotionSource::File => "file",
                        MotionSource::Optimised => "optimised",
                    };
                    json!({ "source": source, "file": file })
                }),
                "smallest_clearance": statistics.certified_clearance,
                "path": planned.files[0],
                "files": planned.files,
                "simulations": simulations,
                "check": check_json(&planned.check),
            })
        }
        Err(error) => json!({
            "solved": false,
            "planner": planner,
            "seed": outcome.seed,
            "error": error,
            "steps": null,
            "rolls": null,
            "cost": null,
            "planning_seconds": null,
            "motions": null,
            "smallest_clearance": null,
            "path": null,
            "check": null,
        }),
    }
}

fn print_one(outcome: &Outcome) {
    let planned = match &outcome.result {
        Ok(planned) => planned,
        Err(error) => {
            say!("not solved         {error}");
            return;
        }
    };
    let (walk, statistics) = (&planned.walk, &planned.walk.statistics);
    let label = if planned.check.valid {
        "solved"
    } else {
        "not solved"
    };
    say!(
        "{label:<18} {}: {}, {} of {} waypoints reached",
        planner_name(outcome.planner),
        statistics.stop,
        statistics.reached,
        walk.waypoints.len()
    );
    say!(
        "time               planning {:.4} s, writing {:.3} s",
        statistics.seconds,
        planned.write_seconds
    );
    match &planned.motions {
        Some((MotionSource::File, Some(file))) => {
            say!("motions            read from {}", file.display());
        }
        Some((_, Some(file))) => {
            say!(
                "motions            optimised, written to {}",
                file.display()
            );
        }
        Some((_, None)) => say!("motions            optimised"),
        None => {}
    }
    say!(
        "walk               {} steps, {} rolls, straight distance {:.3}",
        walk.configurations.len().saturating_sub(1),
        walk.rolls.len(),
        statistics.distance
    );
    say!(
        "cost               {:.3} (steps × Σ‖ΔL‖²/distance), Σ‖ΔL‖² {:.4}",
        statistics.cost,
        statistics.actuation
    );
    if outcome.planner == WalkPlanner::Greedy {
        say!(
            "optimisations      {}, {} iterations, {} recoveries",
            statistics.optimisations,
            statistics.iterations,
            statistics.recoveries
        );
    }
    for (seconds, report) in &planned.simulations {
        if report.lost {
            say!("simulated          {seconds} s a roll: the robot falls and loses its way");
            continue;
        }
        say!(
            "simulated          {seconds} s a roll: mean error {:.2} cm, largest {:.2} cm, peak \
             force {:.0} N",
            100.0 * report.mean_error,
            100.0 * report.largest_error,
            report.peak_force
        );
    }
    print_check(&planned.check, walk);
    print_written(&planned.files);
}

/// Prints a verdict with its worst figures.
pub fn print_check(check: &WalkCheck, walk: &Walk) {
    if let Some(clearance) = walk.statistics.certified_clearance {
        say!("clearance          {clearance:.6} between members, certified for the motion");
    }
    for (label, figure) in [
        ("  least sampled", check.least_distance),
        ("lowest node", check.least_height),
        ("worst violation", check.worst_violation),
        ("support slides", Some(check.worst_slide)),
    ] {
        if let Some(figure) = figure {
            // Adding zero turns a negative zero into a positive one.
            say!("{label:<18} {:.3e}", figure + 0.0);
        }
    }
    say!(
        "waypoints          {} of {} visited in order",
        check.visited,
        walk.waypoints.len()
    );
    if check.valid {
        say!(
            "check              accepted by the independent judge, {} positions sampled",
            check.samples
        );
        return;
    }
    const SHOWN: usize = 10;
    say!("check              REFUSED by the independent judge");
    for fault in check.faults.iter().take(SHOWN) {
        say!("                   {fault}");
    }
    if check.num_faults > SHOWN {
        say!("                   and {} more", check.num_faults - SHOWN);
    }
}

fn print_many(outcomes: &[Outcome]) {
    say!("  seed  solved  check     planning s    steps    rolls     cost  clearance");
    let mut costs = Vec::new();
    for outcome in outcomes {
        match &outcome.result {
            Ok(Planned { walk, check, .. }) => {
                let statistics = &walk.statistics;
                if check.valid {
                    costs.push(statistics.cost);
                }
                say!(
                    "{:>6}  {:<6}  {:<8} {:>11.4} {:>8} {:>8} {:>8.3} {:>10}",
                    outcome.seed,
                    if check.valid { "yes" } else { "NO" },
                    if check.valid { "accepted" } else { "REFUSED" },
                    statistics.seconds,
                    walk.configurations.len().saturating_sub(1),
                    walk.rolls.len(),
                    statistics.cost,
                    statistics
                        .certified_clearance
                        .map_or_else(|| "-".to_owned(), |clearance| format!("{clearance:.4}")),
                );
            }
            Err(error) => say!("{:>6}  NO      {error}", outcome.seed),
        }
    }
    costs.sort_by(f64::total_cmp);
    if let Some(median) = tensegra::io::quantile(&costs, 0.5) {
        say!(
            "{} of {} solved; median cost {median:.3}",
            costs.len(),
            outcomes.len()
        );
    }
}
