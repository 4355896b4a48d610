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
    for (name, start, roles) in [
        (
            "roll",
            unit_k5(Limits::default()).unwrap(),
            vec![4, 1, 2, 3, 0],
        ),
        (
            "evert",
            unit_k5(Limits::default()).unwrap(),
            vec![3, 1, 2, 0, 4],
        ),
        (
            "oct",
            unit_octahedron(Limits::default()).unwrap(),
            vec![3, 1, 2, 0, 4, 5],
        ),
    ] {
        let RobotAtStart { robot, mut stance } = start;
        let c = robot.centre_of_mass(&stance.coordinates);
        for p in stance.coordinates.chunks_mut(3) {
            p[0] += 2.5 - c.x;
            p[1] += 2.5 - c.y;
        }
        let sym = SymmetricRobot::all(&robot, &stance.coordinates, &stance.support)
            .unwrap()
            .into_iter()
            .find(|s| s.relabelling().roles() == roles)
            .unwrap();
        let t = cpu();
        let one = find_primitive(
            &sym,
            &PrimitiveOptions::default(),
            &mut rand_pcg::Pcg64::seed_from_u64(0),
        )
        .unwrap()
        .best;
        println!("{name} one {:.4} {:.2}s", one.cost(), cpu() - t);
        for max in [1, 2, 3, 4] {
            let t = cpu();
            let (lib, att) = PrimitiveLibrary::new(one.clone())
                .extend(max, &PrimitiveOptions::default())
                .unwrap();
            let tl = cpu() - t;
            let planner = TwoTierPlanner::new(&lib);
            let mut rng = rand_pcg::Pcg64::seed_from_u64(1);
            let (mut ok, mut cost, mut cost1) = (0, 0.0, 0.0);
            let t = cpu();
            for _ in 0..100 {
                let w: Vec<[f64; 2]> = (0..5)
                    .map(|_| [rng.random_range(0.0..5.0), rng.random_range(0.0..5.0)])
                    .collect();
                let mut d = 0.0;
                let mut p = [2.5, 2.5];
                for q in &w {
                    d += f64::hypot(q[0] - p[0], q[1] - p[1]);
                    p = *q;
                }
                let walk = planner
                    .walk(
                        &stance,
                        &w.iter()
                            .map(|&[x, y]| GridGoal::Point(nalgebra::Point2::new(x, y)))
                            .collect::<Vec<_>>(),
                    )
                    .unwrap();
                let ls: Vec<Vec<f64>> = walk
                    .motion
                    .configurations
                    .iter()
                    .map(|x| robot.lengths(x))
                    .collect();
                let sq: Vec<f64> = ls
                    .windows(2)
                    .map(|p| {
                        p[0].iter()
                            .zip(&p[1])
                            .map(|(a, b)| (a - b) * (a - b))
                            .sum::<f64>()
                    })
                    .collect();
                cost += (ls.len() - 1) as f64 * sq.iter().sum::<f64>() / d;
                cost1 += sq.iter().map(|s| s.sqrt()).sum::<f64>().powi(2) / d;
                ok += 1;
            }
            println!(
                "  {max}: {ok} J {:.1} J* {:.1} lib {tl:.2}s plan {:.3}s {:?}",
                cost / 100.0,
                cost1 / 100.0,
                cpu() - t,
                att.iter()
                    .map(|(t, a)| (
                        t.iter()
                            .map(|t| if *t == Turn::Left { 'L' } else { 'R' })
                            .collect::<String>(),
                        (a.cost / (t.len() + 1) as f64 * 1e4).round() / 1e4
                    ))
                    .collect::<Vec<_>>()
            );
        }
    }
}
