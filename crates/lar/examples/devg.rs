use rand::{RngExt, SeedableRng};
use tensegra_lar::*;
fn cpu() -> f64 {
    std::fs::read_to_string("/proc/thread-self/schedstat")
        .unwrap()
        .split(' ')
        .next()
        .unwrap()
        .parse::<u64>()
        .unwrap() as f64
        * 1e-9
}
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let n: usize = a[1].parse().unwrap();
    let pers = match a[2].as_str() {
        "p" => Persistence::Stop,
        "s" => Persistence::Shrink,
        _ => Persistence::Recover,
    };
    let which = a.get(3).cloned().unwrap_or("k28k29o28o29".into());
    for (name, start, obj) in [
        (
            "k28",
            unit_k5(Limits::default()).unwrap(),
            GreedyObjective::LeastMotion,
        ),
        (
            "k29",
            unit_k5(Limits::default()).unwrap(),
            GreedyObjective::NominalLengths(1.0),
        ),
        (
            "o28",
            unit_octahedron(Limits::default().with_min_rigidity(Some(0.0025))).unwrap(),
            GreedyObjective::LeastMotion,
        ),
        (
            "o29",
            unit_octahedron(Limits::default().with_min_rigidity(Some(0.0025))).unwrap(),
            GreedyObjective::NominalLengths(1.0),
        ),
    ] {
        if !which.contains(name) {
            continue;
        }
        let mut rng = rand_pcg::Pcg64::seed_from_u64(1);
        let RobotAtStart { robot, mut stance } = start;
        let c = robot.centre_of_mass(&stance.coordinates);
        for p in stance.coordinates.chunks_mut(3) {
            p[0] += 2.5 - c.x;
            p[1] += 2.5 - c.y;
        }
        let mut planner = GreedyPlanner::new(
            &robot,
            GreedyOptions::default()
                .with_objective(obj)
                .with_persistence(pers),
        )
        .unwrap();
        let (mut ok, mut steps, mut its, mut t, mut cost, mut rec) = (0, 0, 0, 0.0, 0.0, 0);
        let mut worst = 0.0f64;
        let mut confs = 0;
        let mut rolls = 0;
        let mut stops = std::collections::BTreeMap::new();
        for _ in 0..n {
            let w: Vec<[f64; 2]> = (0..5)
                .map(|_| [rng.random_range(0.0..5.0), rng.random_range(0.0..5.0)])
                .collect();
            let mut d = 0.0;
            let mut p = [2.5, 2.5];
            for q in &w {
                d += f64::hypot(q[0] - p[0], q[1] - p[1]);
                p = *q;
            }
            let t0 = cpu();
            let walk = planner.walk(&stance, &w).unwrap();
            t += cpu() - t0;
            steps += walk.optimisations;
            its += walk.iterations;
            rec += walk.recoveries;
            confs += walk.motion.configurations.len();
            rolls += walk.motion.rolls.len();
            let ls: Vec<Vec<f64>> = walk
                .motion
                .configurations
                .iter()
                .map(|x| robot.lengths(x))
                .collect();
            let s: f64 = ls
                .windows(2)
                .map(|p| {
                    p[0].iter()
                        .zip(&p[1])
                        .map(|(a, b)| (a - b) * (a - b))
                        .sum::<f64>()
                })
                .sum();
            if n <= 30 {
                for c in &walk.motion.configurations {
                    for (_, v) in robot.violations(c, 0.0).first() {
                        worst = worst.max(*v);
                    }
                }
            }
            match walk.stop {
                GreedyStop::Arrived => {
                    ok += 1;
                    cost += (ls.len() - 1) as f64 * s / d;
                }
                GreedyStop::Stuck { active, .. } => {
                    *stops
                        .entry(format!(
                            "stuck {}",
                            active
                                .iter()
                                .map(|a| format!("{a}")
                                    .split(' ')
                                    .take(2)
                                    .collect::<Vec<_>>()
                                    .join(" "))
                                .collect::<std::collections::BTreeSet<_>>()
                                .into_iter()
                                .collect::<Vec<_>>()
                                .join("+")
                        ))
                        .or_insert(0) += 1;
                }
                o => {
                    *stops
                        .entry(format!("{o:?}").split(' ').next().unwrap().to_string())
                        .or_insert(0) += 1;
                }
            }
        }
        println!(
            "{name}: {ok}/{n} ms/opt {:.4} it/opt {:.2} confs {} rolls {} cost {:.1} rec {rec} worst {worst:.1e} t {t:.1} {stops:?}",
            t / steps as f64 * 1e3,
            its as f64 / steps as f64,
            confs / n,
            rolls / n,
            cost / ok as f64
        );
    }
}
