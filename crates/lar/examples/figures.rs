//! Measures the figures of the crate: primitives, gaits, greedy and two-tier trials, random
//! robots, dynamics. Times are processor seconds of this thread.
//!
//! Arguments name the parts to run: `primitives`, `greedy`, `two-tier`, `random`, `dynamics`; all
//! if none is given. `rolling`, `everting` and `octahedron` restrict primitives, two-tier walks
//! and dynamics to these gaits. A number sets the count of random sequences (100).

use rand::SeedableRng;
use rand_pcg::Pcg64;
use tensegra_lar::experiments::{
    Trials, greedy_trials, power_law_exponent, random_robot_trials, random_sequences,
    two_tier_trials,
};
use tensegra_lar::{
    DynamicsOptions, GreedyObjective, GreedyOptions, Limits, Persistence, Primitive,
    PrimitiveLibrary, PrimitiveOptions, RobotAtStart, SymmetricRobot, extend_primitive, find_gait,
    find_primitive, simulate_motion, solve_primitive, straight_strip, unit_k5, unit_octahedron,
};

type Outcome = Result<(), Box<dyn std::error::Error>>;

/// Processor seconds of this thread where the system tells them, else wall-clock seconds.
fn clock() -> f64 {
    std::fs::read_to_string("/proc/thread-self/schedstat")
        .ok()
        .and_then(|text| text.split(' ').next()?.parse::<u64>().ok())
        .map_or_else(
            || {
                std::time::SystemTime::now()
                    .duration_since(std::time::UNIX_EPOCH)
                    .map_or(0.0, |time| time.as_secs_f64())
            },
            |nanoseconds| nanoseconds as f64 * 1e-9,
        )
}

/// Parts of this programme.
const PARTS: [&str; 5] = ["primitives", "dynamics", "two-tier", "greedy", "random"];

/// A gait of the literature.
struct Known {
    name: &'static str,
    start: RobotAtStart,
    roles: &'static [usize],
    tip: &'static [(usize, [f64; 3])],
}

/// The gaits asked for.
fn known(rigidity: Option<f64>, names: &[&str]) -> Result<Vec<Known>, Box<dyn std::error::Error>> {
    let k5 = unit_k5(Limits::default())?;
    let mut all = vec![
        Known {
            name: "K5 rolling",
            start: k5.clone(),
            roles: &[4, 1, 2, 3, 0],
            tip: &[(4, [0.6536, 0.0, 0.5678]), (3, [0.2124, 0.0, 0.2])],
        },
        Known {
            name: "K5 everting",
            start: k5,
            roles: &[3, 1, 2, 0, 4],
            tip: &[(3, [0.7, 0.0, 0.5099]), (4, [0.166, 0.0, 0.75])],
        },
        Known {
            name: "octahedron",
            start: unit_octahedron(Limits::default().with_min_rigidity(rigidity))?,
            roles: &[3, 1, 2, 0, 4, 5],
            tip: &[
                (3, [0.815, 0.0, 0.293]),
                (4, [0.025, 0.437, 0.804]),
                (5, [0.025, -0.437, 0.804]),
            ],
        },
    ];
    if !names.is_empty() {
        all.retain(|gait| names.iter().any(|name| gait.name.ends_with(name)));
    }
    Ok(all)
}

impl Known {
    fn symmetric(&self) -> Result<SymmetricRobot, Box<dyn std::error::Error>> {
        let RobotAtStart { robot, stance } = &self.start;
        SymmetricRobot::all(robot, &stance.coordinates, &stance.support)?
            .into_iter()
            .find(|symmetric| symmetric.relabelling().roles() == self.roles)
            .ok_or_else(|| "no such renaming".into())
    }

    fn tip_shape(&self) -> Vec<f64> {
        let mut tip = self.start.stance.coordinates.clone();
        for (node, position) in self.tip {
            tip[3 * node..3 * node + 3].copy_from_slice(position);
        }
        tip
    }

    fn primitive(&self) -> Result<Primitive, Box<dyn std::error::Error>> {
        Ok(solve_primitive(
            &self.symmetric()?,
            &self.tip_shape(),
            &PrimitiveOptions::default(),
        )?
        .0)
    }
}

fn primitives(names: &[&str]) -> Outcome {
    let options = PrimitiveOptions::default();
    for known in known(None, names)? {
        let symmetric = known.symmetric()?;
        let began = clock();
        let (one, attempt) = solve_primitive(&symmetric, &known.tip_shape(), &options)?;
        println!(
            "{}: cost {:.5}, ratio {:.4}, {} iterations, {:.3} s, violation {:.1e}",
            known.name,
            one.cost(),
            one.length_ratio(),
            attempt.iterations,
            clock() - began,
            attempt.violation
        );
        for seed in 0..5 {
            let began = clock();
            match find_primitive(&symmetric, &options, &mut Pcg64::seed_from_u64(seed)) {
                Ok(search) => {
                    let seconds = clock() - began;
                    let longer = search.attempts.iter().filter(|a| a.steps > 2);
                    let told: Vec<String> = longer
                        .map(|a| format!("{}×{} → {:.4}", a.steps, a.iterations, a.cost))
                        .collect();
                    println!(
                        "  search, seed {seed}: cost {:.5}, {} attempts, {seconds:.2} s; steps × \
                         iterations → cost: {}",
                        search.best.cost(),
                        search.attempts.len(),
                        told.join(", ")
                    );
                }
                Err(error) => println!("  search, seed {seed}: {error}"),
            }
        }
        for rolls in 2..=4 {
            let began = clock();
            let (more, attempt) = extend_primitive(&one, &straight_strip(rolls), &options)?;
            println!(
                "  {rolls} rolls: {:.4} a roll ({:.3}), {} iterations, {:.2} s",
                more.cost() / rolls as f64,
                more.cost() / rolls as f64 / one.cost(),
                attempt.iterations,
                clock() - began
            );
        }
    }
    for rigidity in [0.0025, 0.005] {
        for known in known(Some(rigidity), names)? {
            let one = known.primitive()?;
            let began = clock();
            let gait = find_gait(&one, &options)?.best;
            println!(
                "{}: gait {:.5} ({:.3}), {:.2} s (octahedron with index ≥ {rigidity})",
                known.name,
                gait.cost(),
                gait.cost() / one.cost(),
                clock() - began
            );
        }
    }
    Ok(())
}

fn report(name: &str, trials: &Trials) {
    println!(
        "{name}: {}/{} succeeded, {} faulty, cost {:.1} ± {:.1}, {:.3} ms, worst violation \
         {:.1e}, least clearance {:.4}, {} recoveries, stops {:?}",
        trials.succeeded,
        trials.count,
        trials.faulty,
        trials.mean_cost(),
        trials.cost_deviation(),
        1e3 * trials.mean_seconds(),
        trials.worst_violation,
        trials.least_clearance,
        trials.recoveries,
        trials.stops
    );
}

fn greedy(count: usize) -> Outcome {
    let sequences = random_sequences(count, 5, 5.0, 1);
    let centre = [2.5, 2.5];
    let k5 = unit_k5(Limits::default())?.moved_to(centre);
    let octahedron =
        unit_octahedron(Limits::default().with_min_rigidity(Some(0.0025)))?.moved_to(centre);
    for (robot, start) in [("K5", k5), ("octahedron", octahedron)] {
        for (aim, objective) in [
            ("least motion", GreedyObjective::LeastMotion),
            ("nominal lengths", GreedyObjective::NominalLengths(1.0)),
        ] {
            for persistence in [Persistence::Stop, Persistence::Shrink, Persistence::Recover] {
                let options = GreedyOptions::default()
                    .with_objective(objective)
                    .with_persistence(persistence);
                let trials = greedy_trials(&start, &options, &sequences, clock)?;
                report(&format!("greedy {robot}, {aim}, {persistence:?}"), &trials);
            }
        }
    }
    Ok(())
}

fn two_tier(count: usize, names: &[&str]) -> Outcome {
    let sequences = random_sequences(count, 5, 5.0, 1);
    for known in known(Some(0.0025), names)? {
        let start = known.start.clone().moved_to([2.5, 2.5]);
        let one = known.primitive()?;
        for rolls in 1..=4 {
            let began = clock();
            let (library, _) =
                PrimitiveLibrary::new(one.clone()).extend(rolls, &PrimitiveOptions::default())?;
            let built = clock() - began;
            let trials = two_tier_trials(&start, &library, &sequences, clock)?;
            let name = format!(
                "two-tier {}, {rolls} rolls (library {built:.2} s)",
                known.name
            );
            report(&name, &trials);
        }
    }
    Ok(())
}

fn random() -> Outcome {
    let options = GreedyOptions::default().with_max_configurations(5000);
    let mut points = Vec::new();
    for (nodes, index) in [(7, 0.0025), (10, 0.001), (15, 0.0002)] {
        let limits = Limits::default().with_min_rigidity(Some(index));
        let trials = random_robot_trials(nodes, &limits, 5.0, 0..20, &options, clock)?;
        report(&format!("random, {nodes} nodes, index ≥ {index}"), &trials);
        points.push(((3 * nodes - 6) as f64, trials.mean_seconds()));
    }
    println!(
        "time of a step against members {points:?}: exponent {:.2}",
        power_law_exponent(&points)
    );
    Ok(())
}

fn dynamics(names: &[&str]) -> Outcome {
    for known in known(None, names)? {
        let one = known.primitive()?;
        for duration in [2.0, 4.0, 6.0, 8.0, 12.0] {
            let began = clock();
            let report = simulate_motion(
                known.symmetric()?.robot(),
                &one.motion(),
                duration,
                &DynamicsOptions::default(),
            )?;
            println!(
                "{} in {duration} s: error {:.2} cm (largest {:.2}), peak force {:.0} N, {} \
                 contact changes, {:.2} s tipping, {:.2} s",
                known.name,
                100.0 * report.mean_error,
                100.0 * report.largest_error,
                report.peak_force,
                report.contacts.len(),
                report.tipping_time,
                clock() - began
            );
        }
    }
    Ok(())
}

fn main() -> Outcome {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let count = arguments
        .iter()
        .find_map(|argument| argument.parse().ok())
        .unwrap_or(100);
    let (parts, names): (Vec<&str>, Vec<&str>) = arguments
        .iter()
        .map(String::as_str)
        .filter(|argument| argument.parse::<usize>().is_err())
        .partition(|argument| PARTS.contains(argument));
    let wanted = |part: &str| parts.is_empty() || parts.contains(&part);
    if wanted("primitives") {
        primitives(&names)?;
    }
    if wanted("dynamics") {
        dynamics(&names)?;
    }
    if wanted("two-tier") {
        two_tier(count, &names)?;
    }
    if wanted("greedy") {
        greedy(count)?;
    }
    if wanted("random") {
        random()?;
    }
    Ok(())
}
