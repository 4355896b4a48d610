//! Walks of many rolls: greedy and two-tier along random waypoints, and random robots.

use cpu_time::ThreadTime;
use nalgebra::Point2;
use tensegra::{
    io::{Axis, Chart, Series, fit_power_law},
    lar::{
        DynamicsOptions, GreedyObjective, GreedyOptions, GridGoal, Limits, Persistence,
        PrimitiveLibrary, PrimitiveOptions, RobotAtStart, TwoTierPlanner,
        experiments::{
            PublishedGait, Trials, greedy_trials, random_robot_trials, random_sequences,
            two_tier_trials,
        },
        simulate_motion, unit_k5, unit_octahedron,
    },
};

use super::{MIN_RIGIDITY, Suite, timed};
use crate::Error;

/// A robot in the middle of the square of waypoints.
fn robots() -> Result<[(&'static str, RobotAtStart); 2], Error> {
    let limits = Limits::default().with_min_rigidity(Some(MIN_RIGIDITY));
    Ok([
        ("K5", unit_k5(Limits::default())?.moved_to([2.5, 2.5])),
        ("octahedron", unit_octahedron(limits)?.moved_to([2.5, 2.5])),
    ])
}

/// Trials one by one, so that each failure has its seed; all of them together.
struct Gathered {
    costs: Vec<f64>,
    seconds: Vec<f64>,
    optimisations: usize,
    clearances: Vec<f64>,
    violations: Vec<f64>,
    succeeded: usize,
}

impl Gathered {
    fn new() -> Self {
        Self {
            costs: Vec::new(),
            seconds: Vec::new(),
            optimisations: 0,
            clearances: Vec::new(),
            violations: Vec::new(),
            succeeded: 0,
        }
    }

    /// Adds a trial of one run; the error says why it is no success.
    fn add(&mut self, trial: &Trials) -> Result<(), String> {
        self.seconds.extend(&trial.seconds);
        self.optimisations += trial.optimisations;
        if trial.least_clearance.is_finite() {
            self.clearances.push(trial.least_clearance);
        }
        if trial.worst_violation.is_finite() {
            self.violations.push(trial.worst_violation);
        }
        if trial.faulty > 0 {
            return Err("the check refuses the walk".to_owned());
        }
        if trial.succeeded == 0 {
            let stops: Vec<&str> = trial.stops.keys().map(String::as_str).collect();
            return Err(stops.join(", "));
        }
        self.succeeded += 1;
        self.costs.extend(&trial.costs);
        Ok(())
    }
}

/// Rows that all walks share.
fn walk_rows(
    suite: &mut Suite,
    case: &str,
    variant: &str,
    runs: usize,
    gathered: &Gathered,
    share: &[(&str, f64)],
    cost: &[(&str, f64)],
) {
    let percent = 100.0 * gathered.succeeded as f64 / runs.max(1) as f64;
    let mut row = |metric, samples: &[f64], reference: &[(&str, f64)]| {
        suite.row(case, variant, metric, runs, samples, reference);
        if let Some(row) = suite.rows.last_mut() {
            row.success = gathered.succeeded;
        }
    };
    row(["share that succeeded", "%"], &[percent], share);
    if !gathered.costs.is_empty() {
        row(["cost (40)", "length"], &gathered.costs, &[]);
        row(
            ["cost (40), mean", "length"],
            &[mean(&gathered.costs)],
            cost,
        );
    }
    row(
        ["least certified clearance", "length"],
        &gathered.clearances,
        &[],
    );
    row(["worst violation", "1"], &gathered.violations, &[]);
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

fn milliseconds(seconds: &[f64]) -> Vec<f64> {
    seconds.iter().map(|s| 1e3 * s).collect()
}

pub fn greedy(suite: &mut Suite) -> Result<(), Error> {
    let case = "greedy";
    // Share of successes by the paper, time of a step and mean cost by IPOPT.
    let references = [
        [(12.0, None, None), (70.0, Some(12.0), Some(132.0))],
        [(85.0, Some(11.7), Some(40.6)), (75.0, None, Some(77.9))],
    ];
    let objectives = [
        ("least motion", GreedyObjective::LeastMotion),
        ("nominal lengths", GreedyObjective::NominalLengths(1.0)),
    ];
    let sequences = random_sequences(suite.trials as usize, 5, 5.0, 1);
    let mut chart = cost_chart("Greedy walks");
    for ((robot, start), references) in robots()?.iter().zip(references) {
        for ((aim, objective), (share, ipopt, cost)) in objectives.iter().zip(references) {
            let options = GreedyOptions::default().with_objective(*objective);
            let variant = format!("{robot}, {aim}");
            let mut gathered = Gathered::new();
            let mut walking = 0.0;
            for (index, sequence) in sequences.iter().enumerate() {
                let clock = ThreadTime::now();
                let trial = greedy_trials(start, &options, std::slice::from_ref(sequence), || {
                    clock.elapsed().as_secs_f64()
                })?;
                walking += trial.mean_seconds() * trial.optimisations.max(1) as f64;
                if let Err(reason) = gathered.add(&trial) {
                    suite.fail(case, &variant, index as u64 + 1, reason);
                }
            }
            let runs = sequences.len();
            let mut times = vec![("paper", 63.0)];
            times.extend(ipopt.map(|time| ("IPOPT", time)));
            let cost: Vec<(&str, f64)> = cost.map(|cost| ("IPOPT", cost)).into_iter().collect();
            suite.row(
                case,
                &variant,
                ["time a step", "ms"],
                runs,
                &milliseconds(&gathered.seconds),
                &[],
            );
            let average = 1e3 * walking / gathered.optimisations.max(1) as f64;
            suite.row(
                case,
                &variant,
                ["time a step, mean", "ms"],
                runs,
                &[average],
                &times,
            );
            if let Some(row) = suite.rows.last_mut() {
                // One figure over all walks.
                row.success = gathered.succeeded;
            }
            walk_rows(
                suite,
                case,
                &variant,
                runs,
                &gathered,
                &[("paper", share)],
                &cost,
            );
            for (persistence, name) in [
                (Persistence::Stop, "stopping where no step is feasible"),
                (Persistence::Shrink, "shorter steps alone"),
            ] {
                let options = options.clone().with_persistence(persistence);
                let trials = greedy_trials(start, &options, &sequences, || 0.0)?;
                let percent = 100.0 * trials.succeeded as f64 / runs.max(1) as f64;
                let metric = ["share that succeeded", "%"];
                let variant = format!("{variant}, {name}");
                suite.row(
                    case,
                    &variant,
                    metric,
                    runs,
                    &[percent],
                    &[("paper", share)],
                );
                if let Some(row) = suite.rows.last_mut() {
                    row.success = trials.succeeded;
                }
            }
            eprintln!("{case} {variant}: {}/{runs}", gathered.succeeded);
            if !gathered.costs.is_empty() {
                chart = chart.series(Series::distribution(variant, &gathered.costs));
            }
        }
    }
    suite.pictures.extend(chart.draw().ok());
    Ok(())
}

/// Cumulated distributions of the cost of walks.
fn cost_chart(title: &str) -> Chart {
    Chart::new(
        Axis::new("cost (40)").unit("length").logarithmic(),
        Axis::new("share of successful walks").range(0.0, 1.0),
    )
    .title(title)
}

pub fn two_tier(suite: &mut Suite) -> Result<(), Error> {
    let case = "two-tier";
    let options = PrimitiveOptions::default();
    let sequences = random_sequences(suite.trials as usize, 5, 5.0, 1);
    // Longest primitive, and whether the gait that can turn is there as well.
    let libraries: &[(usize, bool)] = if suite.quick {
        &[(1, true)]
    } else {
        &[(1, false), (2, false), (4, false), (2, true)]
    };
    let mut chart = cost_chart("Two-tier walks");
    let limits = Limits::default().with_min_rigidity(Some(MIN_RIGIDITY));
    for gait in PublishedGait::all(&limits)? {
        let start = gait.start.clone().moved_to([2.5, 2.5]);
        let (one, _) = gait.solve(&options)?;
        for &(rolls, turning) in libraries {
            let primitives = match rolls {
                1 => "one-roll primitives".to_owned(),
                _ => format!("up to {rolls} rolls"),
            };
            let with = if turning { " and gait" } else { "" };
            let variant = format!("{}, {primitives}{with}", gait.name);
            let (library, seconds) = timed(|| {
                let (library, _) = PrimitiveLibrary::new(one.clone()).extend(rolls, &options)?;
                if turning {
                    library.with_gait(&options)
                } else {
                    Ok(library)
                }
            });
            let library = library?;
            let mut gathered = Gathered::new();
            for (index, sequence) in sequences.iter().enumerate() {
                let clock = ThreadTime::now();
                let trial =
                    two_tier_trials(&start, &library, std::slice::from_ref(sequence), || {
                        clock.elapsed().as_secs_f64()
                    });
                let added = match &trial {
                    Ok(trial) => gathered.add(trial),
                    Err(error) => Err(error.to_string()),
                };
                if let Err(reason) = added {
                    suite.fail(case, &variant, index as u64 + 1, reason);
                }
            }
            let runs = sequences.len();
            let times = milliseconds(&gathered.seconds);
            suite.row(case, &variant, ["time of a walk", "ms"], runs, &times, &[]);
            if rolls > 1 || turning {
                let metric = ["time of longer primitives and gait", "s"];
                suite.row(case, &variant, metric, 1, &[seconds], &[]);
            }
            walk_rows(
                suite,
                case,
                &variant,
                runs,
                &gathered,
                &[("paper", 100.0)],
                &[],
            );
            if turning {
                let simulated = &sequences[..sequences.len().min(SIMULATED)];
                execution_rows(suite, case, &variant, (&start, &library), simulated)?;
            }
            eprintln!("{case} {variant}: {}/{runs}", gathered.succeeded);
            if !gathered.costs.is_empty() {
                chart = chart.series(Series::distribution(variant, &gathered.costs));
            }
        }
    }
    suite.pictures.extend(chart.draw().ok());
    Ok(())
}

/// Walks that are simulated as well.
const SIMULATED: usize = 20;

/// Error of whole walks under length control.
fn execution_rows(
    suite: &mut Suite,
    case: &str,
    variant: &str,
    (start, library): (&RobotAtStart, &PrimitiveLibrary),
    sequences: &[Vec<[f64; 2]>],
) -> Result<(), Error> {
    let planner = TwoTierPlanner::new(library);
    for seconds in [6.0, 12.0] {
        let variant = format!("{variant}, a roll in {seconds} s");
        let mut errors = Vec::new();
        for (index, sequence) in sequences.iter().enumerate() {
            let goals: Vec<GridGoal> = sequence
                .iter()
                .map(|&[x, y]| GridGoal::Point(Point2::new(x, y)))
                .collect();
            let motion = planner.walk(&start.stance, &goals)?.motion;
            let duration = seconds * motion.rolls.len() as f64;
            let options = DynamicsOptions::default();
            let report = simulate_motion(&start.robot, &motion, duration, &options)?;
            if report.lost {
                suite.fail(case, &variant, index as u64 + 1, "the robot falls");
            } else {
                errors.push(100.0 * report.mean_error);
            }
        }
        let metric = ["mean error of a walk", "cm"];
        suite.row(case, &variant, metric, sequences.len(), &errors, &[]);
    }
    Ok(())
}

pub fn random(suite: &mut Suite) -> Result<(), Error> {
    let case = "random";
    let options = GreedyOptions::default().with_max_configurations(5000);
    let seeds = suite.trials.min(20);
    let sizes: &[(usize, f64)] = if suite.quick {
        &[(7, 0.0025)]
    } else {
        &[(7, 0.0025), (10, 0.001), (15, 0.0002)]
    };
    let (mut means, mut all) = (Vec::new(), Vec::new());
    for &(nodes, index) in sizes {
        let limits = Limits::default().with_min_rigidity(Some(index));
        let members = 3 * nodes - 6;
        let variant = format!("{nodes} nodes, {members} members");
        let mut gathered = Gathered::new();
        for seed in 0..seeds {
            let clock = ThreadTime::now();
            let trial = random_robot_trials(nodes, &limits, 5.0, seed..seed + 1, &options, || {
                clock.elapsed().as_secs_f64()
            });
            let added = match &trial {
                Ok(trial) => gathered.add(trial),
                Err(error) => Err(error.to_string()),
            };
            if let Err(reason) = added {
                suite.fail(case, &variant, seed, reason);
            }
        }
        let times = milliseconds(&gathered.seconds);
        let runs = seeds as usize;
        suite.row(case, &variant, ["time a step", "ms"], runs, &times, &[]);
        walk_rows(suite, case, &variant, runs, &gathered, &[], &[]);
        eprintln!("{case} {variant}: {}/{runs}", gathered.succeeded);
        all.extend(times.iter().map(|&time| [members as f64, time]));
        if !times.is_empty() {
            means.push([members as f64, mean(&times)]);
        }
    }
    let mut chart = Chart::new(
        Axis::new("members").logarithmic(),
        Axis::new("time a step").unit("ms").logarithmic(),
    )
    .title("Random minimally rigid robots");
    if let Some(law) = fit_power_law(&means) {
        let metric = ["exponent of time a step against members", "1"];
        suite.row(case, "", metric, means.len(), &[law.exponent], &[]);
        let ends = [means[0][0], means[means.len() - 1][0]];
        let line = ends.map(|members| [members, law.at(members)]).to_vec();
        let label = format!("∝ members^{{{:.2}}}", law.exponent);
        chart = chart.series(Series::line(label, line).color(1));
    }
    if !all.is_empty() {
        let chart = chart.series(Series::points("one robot each", all).color(0));
        suite.pictures.push(chart.draw()?);
    }
    Ok(())
}
