//! Prints what each query costs, in nanoseconds: `cargo run --release -p tensegra-collision --example pair_costs`.
//!
//! Figures are for random pairs; the first decile is what an undisturbed core does.

#[path = "../tests/common/mod.rs"]
mod common;

use std::hint::black_box;
use std::time::Instant;

use common::{HoledBox, capsule, generator, pose, vector};
use nalgebra::{Isometry3, Point3, Vector3};
use rand::RngExt;
use rand_pcg::Pcg64;
use tensegra_collision::swept::{swept_capsule_capsule, swept_capsule_solid};
use tensegra_collision::{
    Capsule, MeshHint, Solid, capsule_capsule, capsule_capsule_lower_bound, capsule_solid,
    capsule_solid_hinted, clearance_lower_bound, solid_solid,
};

const PAIRS: usize = 1000;
const PASSES: usize = 300;

/// Times blocks of queries too short to be interrupted often, so that a busy machine disturbs few of them.
fn row<T, R>(name: &str, pairs: &[T], mut query: impl FnMut(&T) -> R) {
    let mut time = |block: &[T]| {
        let start = Instant::now();
        for pair in block {
            black_box(query(black_box(pair)));
        }
        start.elapsed().as_secs_f64() * 1e9 / block.len() as f64
    };
    let once = time(pairs);
    let block = ((2e5 / once) as usize).clamp(1, pairs.len());
    let mut times: Vec<f64> = (0..PASSES)
        .map(|pass| time(&pairs[pass * block % (pairs.len() - block + 1)..][..block]))
        .collect();
    times.sort_by(f64::total_cmp);
    let at = |share: f64| times[(share * (PASSES - 1) as f64) as usize];
    println!(
        "{name:<58} {:>9.1} ns median {:>9.1} ns first decile",
        at(0.5),
        at(0.1)
    );
}

/// Capsules whose clearance to a solid satisfies a condition.
fn select(
    rng: &mut Pcg64,
    reach: f64,
    radius: f64,
    solid: &Solid,
    accept: impl Fn(f64) -> bool,
) -> Vec<Capsule> {
    let mut found = Vec::new();
    while found.len() < PAIRS {
        let mut c = capsule(rng, reach);
        c.radius = radius;
        if accept(capsule_solid(&c, solid).clearance + radius) {
            found.push(c);
        }
    }
    found
}

fn main() {
    let mut rng = generator(1);

    let pairs: Vec<_> = (0..PAIRS)
        .map(|_| (capsule(&mut rng, 1.0), capsule(&mut rng, 1.0)))
        .collect();
    row("capsule, capsule", &pairs, |(a, b)| capsule_capsule(a, b));
    row("capsule, capsule: lower bound", &pairs, |(a, b)| {
        capsule_capsule_lower_bound(a, b)
    });

    let corner = [
        Point3::new(-0.5, -0.5, -0.1),
        Point3::new(0.6, -0.5, -0.1),
        Point3::new(0.0, 0.7, -0.1),
    ];
    let cloud: Vec<_> = (0..20)
        .map(|_| Point3::from(vector(&mut rng, 0.6)))
        .collect();
    let solids = [
        ("sphere", Solid::sphere(Point3::origin(), 0.5)),
        (
            "half-space",
            Solid::half_space(Point3::origin(), Vector3::new(1.0, 2.0, 3.0)),
        ),
        (
            "box",
            Solid::cuboid(Point3::new(-0.5, -0.4, -0.3), Point3::new(0.5, 0.4, 0.3)),
        ),
        (
            "oriented box",
            Solid::oriented_box(&pose(&mut rng, 0.0), Vector3::new(0.5, 0.4, 0.3)),
        ),
        (
            "cylinder",
            Solid::cylinder(Point3::new(0.0, 0.0, -0.5), Point3::new(0.0, 0.1, 0.5), 0.4),
        ),
        (
            "triangular prism",
            Solid::triangular_prism(corner[0], corner[1], corner[2], 0.2),
        ),
        ("convex hull of 20 points", Solid::convex_hull(&cloud)),
    ];
    for (name, solid) in solids {
        let solid = solid.expect("valid numbers");
        for (where_, capsules) in [
            ("apart", select(&mut rng, 1.5, 0.02, &solid, |d| d > 0.0)),
            (
                "axis inside",
                select(&mut rng, 1.0, 0.02, &solid, |d| d < 0.0),
            ),
        ] {
            row(&format!("capsule, {name}, {where_}"), &capsules, |c| {
                capsule_solid(c, &solid)
            });
        }
        let capsules = select(&mut rng, 1.5, 0.02, &solid, |_| true);
        row(&format!("capsule, {name}: lower bound"), &capsules, |c| {
            clearance_lower_bound(c, &solid)
        });
    }

    // The peg of a benchmark in and around its hole, and cables passing by.
    let holed = HoledBox::benchmark();
    let place = Isometry3::new(
        Vector3::new(0.004, 0.0375, 0.767),
        Vector3::new(0.0, 1.05, 0.0),
    );
    let (vertices, faces) = holed.surface();
    let vertices: Vec<_> = vertices.iter().map(|p| place * p).collect();
    // Every face twice, as the benchmark's file has them: they are dropped.
    let twice: Vec<_> = faces.iter().chain(&faces).collect();
    let solid = Solid::mesh(&vertices, &twice).expect("a closed surface");
    let mut peg = |off: f64, tilt: f64| {
        let middle = Point3::new(rng.random_range(-0.1..0.1), 0.0, 0.0) + vector(&mut rng, off);
        let along = Vector3::new(0.125, 0.0, 0.0) + vector(&mut rng, tilt);
        let peg = Capsule {
            a: middle - along,
            b: middle + along,
            radius: 0.005,
        };
        peg.transformed(&place)
    };
    let in_hole: Vec<_> = (0..PAIRS).map(|_| peg(0.005, 0.002)).collect();
    let before: Vec<_> = (0..PAIRS).map(|_| peg(0.03, 0.03)).collect();
    let mut walk = vec![peg(0.004, 0.002)];
    for i in 1..PAIRS {
        let Capsule { a, b, radius } = walk[i - 1];
        let step = vector(&mut rng, 2e-4);
        let next = Capsule {
            a: a + step,
            b: b + step + vector(&mut rng, 1e-4),
            radius,
        };
        let free = capsule_solid(&next, &solid).clearance > 0.0;
        walk.push(if free { next } else { walk[i - 1] });
    }
    let crossing: Vec<_> = before
        .iter()
        .copied()
        .filter(|c| capsule_solid(c, &solid).clearance < -0.005)
        .collect();
    let before: Vec<_> = before
        .into_iter()
        .filter(|c| capsule_solid(c, &solid).clearance > -0.005)
        .collect();
    row("peg in the hole", &in_hole, |c| capsule_solid(c, &solid));
    row("peg on a walk in the hole", &walk, |c| {
        capsule_solid(c, &solid)
    });
    let mut hint = MeshHint::default();
    row("peg on a walk in the hole, with a hint", &walk, |c| {
        capsule_solid_hinted(c, &solid, &mut hint)
    });
    row("peg around the hole, axis outside", &before, |c| {
        capsule_solid(c, &solid)
    });
    row("peg around the hole, axis inside", &crossing, |c| {
        capsule_solid(c, &solid)
    });
    let passing: Vec<_> = (0..PAIRS)
        .map(|_| {
            let mut c = capsule(&mut rng, 0.4);
            c.a.z += 0.5;
            c.b.z += 0.5;
            Capsule { radius: 0.001, ..c }
        })
        .filter(|c| capsule_solid(c, &solid).clearance > 0.0)
        .collect();
    row("cables around the box with the hole", &passing, |c| {
        capsule_solid(c, &solid)
    });

    // Certificates: steps of 0.02 with some clearance.
    let step = |rng: &mut Pcg64, c: &Capsule, reach: f64| Capsule {
        a: c.a + vector(rng, reach),
        b: c.b + vector(rng, reach),
        ..*c
    };
    let moving: Vec<_> = pairs
        .iter()
        .map(|(a, b)| (*a, step(&mut rng, a, 0.02), *b, step(&mut rng, b, 0.02)))
        .filter(|(a, _, b, _)| capsule_capsule(a, b).clearance > 0.02)
        .collect();
    row("swept capsule, capsule", &moving, |(a, c, b, d)| {
        swept_capsule_capsule(a, c, b, d, 1e-4)
    });
    let cuboid = Solid::cuboid(Point3::new(-0.5, -0.4, -0.3), Point3::new(0.5, 0.4, 0.3))
        .expect("valid numbers");
    let near: Vec<_> = select(&mut rng, 1.0, 0.02, &cuboid, |d| d > 0.03 && d < 0.2)
        .into_iter()
        .map(|c| (c, step(&mut rng, &c, 0.02)))
        .collect();
    row("swept capsule, box", &near, |(a, b)| {
        swept_capsule_solid(a, b, &cuboid, 1e-4)
    });
    let sliding: Vec<_> = walk
        .iter()
        .map(|c| {
            let along = place * Vector3::new(0.02, 0.0, 0.0);
            (
                *c,
                Capsule {
                    a: c.a + along,
                    b: c.b + along,
                    radius: c.radius,
                },
            )
        })
        .collect();
    row(
        "swept peg in the hole, 0.02 along it",
        &sliding,
        |(a, b)| swept_capsule_solid(a, b, &solid, 1e-5),
    );

    // A platform against a box, a prism and the box with the hole.
    let prism =
        Solid::triangular_prism(corner[0], corner[1], corner[2], 0.2).expect("valid numbers");
    let here = Isometry3::identity();
    let poses: Vec<_> = (0..100).map(|_| pose(&mut rng, 1.5)).collect();
    let apart: Vec<_> = poses
        .iter()
        .filter(|p| solid_solid(&prism, p, &cuboid, &here).clearance > 0.0)
        .collect();
    row("prism, box, apart", &apart, |p| {
        solid_solid(&prism, p, &cuboid, &here)
    });
    row("prism, prism", &poses, |p| {
        solid_solid(&prism, p, &prism, &here)
    });
    let near: Vec<_> = (0..20)
        .map(|_| {
            Isometry3::from_parts(
                (place.translation.vector + vector(&mut rng, 0.5)).into(),
                pose(&mut rng, 1.0).rotation,
            )
        })
        .collect();
    row("prism, box with a hole", &near, |p| {
        solid_solid(&prism, p, &solid, &here)
    });
}
