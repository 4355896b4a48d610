use rand::SeedableRng;
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
    for (i, n) in [7usize, 10, 15].into_iter().enumerate() {
        if a.len() > 2 && a[2] != n.to_string() {
            continue;
        }
        let w = [0.0025, 0.001, 0.0002][i];
        let mut ok = 0;
        let (mut steps, mut t, mut gt) = (0, 0.0, 0.0);
        let mut stops = std::collections::BTreeMap::new();
        let mut rec = 0;
        for seed in 0..a[1].parse().unwrap() {
            let t0 = cpu();
            let mut rng = rand_pcg::Pcg64::seed_from_u64(seed);
            let r = random_robot(
                n,
                Dimension::Three,
                Limits::default().with_min_rigidity(Some(w)),
                &mut rng,
            );
            let RobotAtStart { robot, stance } = match r {
                Ok(r) => r,
                Err(e) => {
                    println!("{e} {:.2}", cpu() - t0);
                    continue;
                }
            };
            gt += cpu() - t0;
            let mut planner = GreedyPlanner::new(
                &robot,
                GreedyOptions::default().with_max_configurations(4000),
            )
            .unwrap();
            let c = robot.centre_of_mass(&stance.coordinates);
            let t0 = cpu();
            let walk = planner.walk(&stance, &[[c.x + 5.0, c.y]]).unwrap();
            t += cpu() - t0;
            steps += walk.optimisations;
            rec += walk.recoveries;
            if walk.stop == GreedyStop::Arrived {
                ok += 1
            } else {
                *stops
                    .entry(match walk.stop {
                        GreedyStop::Stuck { active, .. } => format!(
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
                        ),
                        o => format!("{o:?}"),
                    })
                    .or_insert(0) += 1;
            }
        }
        println!(
            "{n}: ok {ok} ms/opt {:.3} gen {gt:.2} t {t:.1} steps {steps} rec {rec} {stops:?}",
            t / steps as f64 * 1e3
        );
    }
}
