//! Suite `lar`: the experiments of Usevitch, Hammond and Schwager (2020) on
//! linear-actuator (truss) robots.

use cpu_time::ThreadTime;
use tensegra::{
    io::{
        Axis, BenchRow, Chart, Level, Picture, ReferenceValue, Series, TrackingRun,
        draw_tracking_error, fit_power_law,
    },
    lar::{
        DynamicsOptions, GreedyObjective, GreedyOptions, Limits, PrimitiveLibrary,
        PrimitiveOptions, RobotAtStart,
        experiments::{
            PublishedGait, Trials, greedy_trials, random_robot_trials, random_sequences,
            two_tier_trials,
        },
        extend_primitive, find_gait, simulate_motion, straight_strip, unit_k5, unit_octahedron,
    },
};

use super::{BenchArguments, Results, RunFailure};
use crate::Error;

const SUITE: &str = "lar";

const INTRODUCTION: &str = "\
Truss robots of Usevitch, Hammond and Schwager (2020): K5 and the octahedron on a unit triangle, \
and random minimally rigid robots. Every walk is judged by the independent check; a walk that is \
refused, or does not reach its waypoints, is a failure. Times are CPU seconds of one thread; a \
time a step is that of a whole walk over its optimisations, recoveries and rolls included. Cost is \
Σ‖ΔL‖² for primitives and equation (40), steps × Σ‖ΔL‖²/distance, for walks. A mean, a share or an \
exponent stands in the column of the median.

Cases: `primitives` (one roll, from a given shape at the tip and from the generic multi-start), \
`gaits` (cost per roll over two to four rolls and of the periodic gait, relative to one roll), \
`greedy` and `two-tier` (random sequences of five waypoints in a square of side 5, the robot \
starting in its middle), `random` (random robots travel 5 units), `dynamics` (one roll under \
length control, nodes of 1 kg).

References: `paper`, as printed; `IPOPT`, the same problems stated with CasADi and solved by \
IPOPT on a machine like the one below (walks: small samples).
";

/// Measures one case.
type Case = fn(&mut Suite) -> Result<(), Error>;

const CASES: [(&str, Case); 6] = [
    ("primitives", primitives),
    ("gaits", gaits),
    ("greedy", greedy),
    ("two-tier", two_tier),
    ("random", random),
    ("dynamics", dynamics),
];

/// The rigidity index imposed on walks; the paper's 0.005 on another scale.
const MIN_RIGIDITY: f64 = 0.0025;

/// Figures of others for one gait.
struct GaitReference {
    cost: [f64; 2],
    ratio: [f64; 2],
    seconds: [f64; 2],
    /// Cost per roll relative to one roll, by IPOPT, over 2, 3 and 4 rolls.
    per_roll: [Option<f64>; 3],
    /// The same of the periodic gait: paper, IPOPT.
    periodic: [f64; 2],
    /// Mean error in cm at 2, 6 and 12 s, by simulation of the IPOPT motion.
    errors: [(f64, f64); 3],
}

/// In the order of [`PublishedGait::all`]; pairs are paper, IPOPT.
const GAITS: [GaitReference; 3] = [
    GaitReference {
        cost: [0.062, 0.0622],
        ratio: [2.85, 2.850],
        seconds: [134.0, 0.39],
        per_roll: [Some(0.751), Some(0.667), Some(0.626)],
        periodic: [0.46, 0.501],
        errors: [(2.0, 0.13), (6.0, 0.16), (12.0, 0.17)],
    },
    GaitReference {
        cost: [0.198, 0.1979],
        ratio: [3.11, 3.112],
        seconds: [127.0, 0.24],
        per_roll: [Some(0.806), Some(0.712), Some(0.655)],
        periodic: [0.51, 0.361],
        errors: [(2.0, 0.10), (6.0, 0.10), (12.0, 0.09)],
    },
    GaitReference {
        cost: [0.025, 0.0247],
        ratio: [1.58, 1.584],
        seconds: [166.0, 0.42],
        per_roll: [Some(0.789), Some(0.722), None],
        periodic: [0.76, 0.505],
        errors: [(2.0, 0.25), (6.0, 0.14), (12.0, 0.13)],
    },
];

fn paper_and_ipopt([paper, ipopt]: [f64; 2]) -> Vec<(&'static str, f64)> {
    vec![("paper", paper), ("IPOPT", ipopt)]
}

/// What is measured on the way.
#[derive(Default)]
struct Suite {
    rows: Vec<BenchRow>,
    failures: Vec<RunFailure>,
    pictures: Vec<Picture>,
    quick: bool,
    /// Trials of each kind of walk.
    trials: u64,
}

impl Suite {
    fn row(
        &mut self,
        case: &str,
        variant: &str,
        [metric, unit]: [&str; 2],
        runs: usize,
        samples: &[f64],
        reference: &[(&str, f64)],
    ) {
        let mut row = BenchRow::new(case, metric, unit, runs, samples);
        row.suite = SUITE.to_owned();
        row.variant = variant.to_owned();
        row.reference = reference
            .iter()
            .map(|&(source, value)| ReferenceValue {
                source: source.to_owned(),
                value,
            })
            .collect();
        self.rows.push(row);
    }

    fn fail(&mut self, case: &str, variant: &str, seed: u64, reason: impl ToString) {
        self.failures.push(RunFailure {
            case: case.to_owned(),
            variant: variant.to_owned(),
            seed,
            reason: reason.to_string(),
        });
    }
}

pub fn measure(arguments: &BenchArguments) -> Result<Results, Error> {
    let known = CASES.map(|(name, _)| name);
    if let Some(unknown) = arguments
        .cases
        .iter()
        .find(|name| !known.contains(&name.as_str()))
    {
        let known = known.join(", ");
        return Err(format!("the suite has no case {unknown}: choose from {known}").into());
    }
    let mut suite = Suite {
        quick: arguments.quick,
        trials: arguments
            .seeds
            .unwrap_or(if arguments.quick { 2 } else { 100 }),
        ..Suite::default()
    };
    for (name, measure) in CASES {
        if arguments.cases.is_empty() || arguments.cases.iter().any(|case| case == name) {
            let start = ThreadTime::now();
            measure(&mut suite)?;
            eprintln!("{name}: {:.1} s", start.elapsed().as_secs_f64());
        }
    }
    let picture = (!suite.pictures.is_empty()).then(|| Picture::grid(&suite.pictures, 2));
    Ok(Results {
        introduction: INTRODUCTION,
        rows: suite.rows,
        failures: suite.failures,
        picture,
    })
}

/// Seconds of CPU that a computation takes, with its outcome.
fn timed<T>(compute: impl FnOnce() -> T) -> (T, f64) {
    let start = ThreadTime::now();
    let outcome = compute();
    (outcome, start.elapsed().as_secs_f64())
}

fn primitives(suite: &mut Suite) -> Result<(), Error> {
    const REPEATS: usize = 5;
    let case = "primitives";
    let options = PrimitiveOptions::default();
    for (gait, reference) in PublishedGait::all(&Limits::default())?.iter().zip(&GAITS) {
        let mut seconds = Vec::new();
        let mut found = Vec::new();
        for _ in 0..REPEATS {
            let (solved, time) = timed(|| gait.solve(&options));
            match solved {
                Ok((primitive, _)) => {
                    seconds.push(time);
                    found.push(primitive);
                }
                Err(error) => suite.fail(case, gait.name, 0, error),
            }
        }
        let costs: Vec<f64> = found.iter().map(|primitive| primitive.cost()).collect();
        let ratios: Vec<f64> = found.iter().map(|p| p.length_ratio()).collect();
        let mut row = |metric, samples: &[f64], reference| {
            let reference = paper_and_ipopt(reference);
            suite.row(case, gait.name, metric, REPEATS, samples, &reference);
        };
        row(["cost", "length²"], &costs, reference.cost);
        row(
            ["longest over shortest length", "1"],
            &ratios,
            reference.ratio,
        );
        row(
            ["time from a given tip shape", "s"],
            &seconds,
            reference.seconds,
        );
        if suite.quick {
            continue;
        }
        let seeds = suite.trials.min(10);
        let (mut costs, mut seconds) = (Vec::new(), Vec::new());
        for seed in 1..=seeds {
            let (search, time) = timed(|| gait.search(&options, seed));
            match search {
                Ok(search) => {
                    costs.push(search.best.cost());
                    seconds.push(time);
                }
                Err(error) => suite.fail(case, gait.name, seed, error),
            }
        }
        for (metric, samples) in [
            (["cost by multi-start", "length²"], &costs),
            (["time of multi-start", "s"], &seconds),
        ] {
            suite.row(case, gait.name, metric, seeds as usize, samples, &[]);
        }
    }
    Ok(())
}

fn gaits(suite: &mut Suite) -> Result<(), Error> {
    let case = "gaits";
    let options = PrimitiveOptions::default();
    let longest = if suite.quick { 2 } else { 4 };
    let mut chart = Chart::new(
        Axis::new("rolls"),
        Axis::new("cost per roll, relative to one roll"),
    )
    .title("Cost of primitives over several rolls");
    // The octahedron may lose its rigidity in a periodic gait: there it is imposed.
    let rigid = PublishedGait::all(&Limits::default().with_min_rigidity(Some(MIN_RIGIDITY)))?;
    let free = PublishedGait::all(&Limits::default())?;
    for ((gait, rigid), reference) in free.iter().zip(&rigid).zip(&GAITS) {
        let (one, _) = gait.solve(&options)?;
        let mut points = vec![[1.0, 1.0]];
        for rolls in 2..=longest {
            let (solved, seconds) =
                timed(|| extend_primitive(&one, &straight_strip(rolls), &options));
            let variant = format!("{}, {rolls} rolls", gait.name);
            let (share, seconds) = match solved {
                Ok((more, _)) => (vec![more.cost() / rolls as f64 / one.cost()], vec![seconds]),
                Err(error) => {
                    suite.fail(case, &variant, 0, error);
                    (Vec::new(), Vec::new())
                }
            };
            points.extend(share.iter().map(|&share| [rolls as f64, share]));
            let ipopt = reference.per_roll[rolls - 2];
            let reference: Vec<(&str, f64)> =
                ipopt.map(|value| ("IPOPT", value)).into_iter().collect();
            let metric = ["cost per roll over that of one", "1"];
            suite.row(case, &variant, metric, 1, &share, &reference);
            suite.row(case, &variant, ["time", "s"], 1, &seconds, &[]);
        }
        let (one_rigid, _) = rigid.solve(&options)?;
        let (found, seconds) = timed(|| find_gait(&one_rigid, &options));
        let variant = format!("{}, periodic", gait.name);
        let (share, seconds) = match found {
            Ok(search) => (vec![search.best.cost() / one_rigid.cost()], vec![seconds]),
            Err(error) => {
                suite.fail(case, &variant, 0, error);
                (Vec::new(), Vec::new())
            }
        };
        let periodic = paper_and_ipopt(reference.periodic);
        let metric = ["cost per roll over that of one", "1"];
        suite.row(case, &variant, metric, 1, &share, &periodic);
        suite.row(case, &variant, ["time", "s"], 1, &seconds, &[]);
        chart = chart.series(Series::line(gait.name, points));
        if let [share] = share[..] {
            chart = chart.level(Level::new(format!("{}, periodic", gait.name), share));
        }
    }
    suite.pictures.push(chart.draw()?);
    Ok(())
}

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

fn greedy(suite: &mut Suite) -> Result<(), Error> {
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

fn two_tier(suite: &mut Suite) -> Result<(), Error> {
    let case = "two-tier";
    let options = PrimitiveOptions::default();
    let sequences = random_sequences(suite.trials as usize, 5, 5.0, 1);
    // Longest primitive, and whether the gait that can turn is there as well.
    let libraries: &[(usize, bool)] = if suite.quick {
        &[(1, true)]
    } else {
        &[
            (1, false),
            (2, false),
            (4, false),
            (1, true),
            (2, true),
            (4, true),
        ]
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
            eprintln!("{case} {variant}: {}/{runs}", gathered.succeeded);
            if !gathered.costs.is_empty() {
                chart = chart.series(Series::distribution(variant, &gathered.costs));
            }
        }
    }
    suite.pictures.extend(chart.draw().ok());
    Ok(())
}

fn random(suite: &mut Suite) -> Result<(), Error> {
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

fn dynamics(suite: &mut Suite) -> Result<(), Error> {
    let case = "dynamics";
    let durations: &[f64] = if suite.quick {
        &[6.0]
    } else {
        &[2.0, 4.0, 6.0, 8.0, 12.0]
    };
    let mut runs = Vec::new();
    for (gait, reference) in PublishedGait::all(&Limits::default())?.iter().zip(&GAITS) {
        let (one, _) = gait.solve(&PrimitiveOptions::default())?;
        let symmetric = gait.symmetric()?;
        for &duration in durations {
            let variant = format!("{} in {duration} s", gait.name);
            let report = simulate_motion(
                symmetric.robot(),
                one.motion(),
                duration,
                &DynamicsOptions::default(),
            );
            let (error, force) = match &report {
                Ok(report) => (vec![100.0 * report.mean_error], vec![report.peak_force]),
                Err(failure) => {
                    suite.fail(case, &variant, 0, failure);
                    (Vec::new(), Vec::new())
                }
            };
            let mut others: Vec<(&str, f64)> = reference
                .errors
                .iter()
                .filter(|(at, _)| (at - duration).abs() < 0.5)
                .map(|&(_, error)| ("IPOPT", error))
                .collect();
            if duration >= 6.0 {
                // The paper says: below this at 6 s and slower.
                others.push(("paper <", 1.0));
            }
            suite.row(case, &variant, ["mean error", "cm"], 1, &error, &others);
            suite.row(case, &variant, ["peak force", "N"], 1, &force, &[]);
            if let Ok(report) = report {
                runs.push(TrackingRun {
                    name: gait.name.to_owned(),
                    seconds_of_roll: duration,
                    mean_error: report.mean_error,
                    errors: report.errors,
                });
            }
        }
    }
    if !runs.is_empty() {
        suite.pictures.push(draw_tracking_error(&runs)?);
    }
    Ok(())
}
