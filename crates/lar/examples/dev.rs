use rand::SeedableRng;
struct Instant(u64);
impl Instant {
    fn now() -> Self {
        Self(cpu())
    }
    fn elapsed(&self) -> std::time::Duration {
        std::time::Duration::from_nanos(cpu() - self.0)
    }
}
fn cpu() -> u64 {
    std::fs::read_to_string("/proc/thread-self/schedstat")
        .unwrap()
        .split(' ')
        .next()
        .unwrap()
        .parse()
        .unwrap()
}

use tensegra_lar::*;
fn main() {
    let arg = std::env::args().nth(1).unwrap_or_default();
    let s3 = 3f64.sqrt() / 2.0;
    for (name, start, roles, tip) in [
        (
            "roll",
            unit_k5(Limits::default()).unwrap(),
            vec![4, 1, 2, 3, 0],
            vec![
                (4, [s3 * 0.715f64.cos(), 0., s3 * 0.715f64.sin()]),
                (3, [s3 - s3 * 0.715f64.cos(), 0., 0.2]),
            ],
        ),
        (
            "evert",
            unit_k5(Limits::default()).unwrap(),
            vec![3, 1, 2, 0, 4],
            vec![(3, [0.7, 0., 0.26f64.sqrt()]), (4, [s3 - 0.7, 0., 0.75])],
        ),
        (
            "oct",
            unit_octahedron(Limits::default()).unwrap(),
            vec![3, 1, 2, 0, 4, 5],
            vec![
                (3, [0.815, 0., 0.293]),
                (4, [0.025, 0.437, 0.804]),
                (5, [0.025, -0.437, 0.804]),
            ],
        ),
    ] {
        let RobotAtStart { robot, stance } = start;
        let all = SymmetricRobot::all(&robot, &stance.coordinates, &stance.support).unwrap();
        let sym = all
            .into_iter()
            .find(|s| s.relabelling().roles() == roles)
            .unwrap();
        let mut t = stance.coordinates.clone();
        for (n, p) in tip {
            robot.dimension().set_node(&mut t, n, &p.into());
        }
        let options = PrimitiveOptions::default();
        let now = Instant::now();
        match solve_primitive(&sym, &t, &options) {
            Ok((p, a)) => {
                println!(
                    "{name}: cost {:.5} ratio {:.4} it {} conv {} viol {:.1e} {:.3}s",
                    p.cost(),
                    p.length_ratio(),
                    a.iterations,
                    a.converged,
                    a.violation,
                    now.elapsed().as_secs_f64()
                );
                if arg.contains('m') {
                    for n in 2..=4 {
                        let now = Instant::now();
                        match extend_primitive(&p, &straight_strip(n), &options) {
                            Ok((q, a)) => println!(
                                "  {n}: {:.5} frac {:.3} it {} conv {} {:.2}s",
                                q.cost() / n as f64,
                                q.cost() / n as f64 / p.cost(),
                                a.iterations,
                                a.converged,
                                now.elapsed().as_secs_f64()
                            ),
                            Err(e) => println!("  {n}: {e} {:.2}s", now.elapsed().as_secs_f64()),
                        }
                    }
                }
                if arg.contains('g') {
                    let now = Instant::now();
                    match find_gait(&p, &options) {
                        Ok(g) => println!(
                            "  gait {:.5} frac {:.3} {:?} {:.2}s",
                            g.best.cost(),
                            g.best.cost() / p.cost(),
                            g.attempts,
                            now.elapsed().as_secs_f64()
                        ),
                        Err(e) => println!("  gait {e} {:.2}s", now.elapsed().as_secs_f64()),
                    }
                }
            }
            Err(e) => println!("{name}: {e} {:.3}s", now.elapsed().as_secs_f64()),
        }
        if arg.contains('s') {
            for seed in 0..3 {
                let now = Instant::now();
                match find_primitive(&sym, &options, &mut rand_pcg::Pcg64::seed_from_u64(seed)) {
                    Ok(s) => println!(
                        "  search: {:.5} {:.3}s\n   {:?}",
                        s.best.cost(),
                        now.elapsed().as_secs_f64(),
                        s.attempts
                            .iter()
                            .filter(|a| a.steps > 3 || a.is_feasible())
                            .map(|a| (
                                a.steps,
                                (a.cost * 1e4).round() / 1e4,
                                a.iterations,
                                a.converged
                            ))
                            .collect::<Vec<_>>()
                    ),
                    Err(e) => println!("  search: {e} {:.3}s", now.elapsed().as_secs_f64()),
                }
            }
        }
    }
}
