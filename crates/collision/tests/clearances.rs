//! Capsules against capsules and solids.

mod common;

use common::{Body, HoledBox, bodies, capsule, direction, generator, point, pose, vector};
use nalgebra::{Isometry3, Point3, Vector3};
use rand_pcg::Pcg64;
use tensegra_collision::{
    Capsule, Contact, MeshHint, Solid, capsule_capsule, capsule_capsule_lower_bound, capsule_solid,
    capsule_solid_around, capsule_solid_hinted, capsule_solid_posed, clearance_lower_bound,
    closest_points_point_triangle, closest_points_segment_triangle,
};

/// How far a plane across `n` keeps a capsule from a body: a lower bound on the signed clearance, and the signed
/// clearance is the greatest of these.
fn separation(c: &Capsule, body: &Body, n: &Vector3<f64>) -> f64 {
    n.dot(&c.a.coords).min(n.dot(&c.b.coords)) - c.radius - body.hull.extent(n)
}

/// The fields fit together.
fn check_fields(contact: &Contact, c: &Capsule, what: &str) {
    assert!(
        (contact.normal.norm() - 1.0).abs() < 1e-12,
        "{what}: {contact:?}"
    );
    let apart = contact.on_a - contact.on_b - contact.normal * contact.clearance;
    assert!(apart.norm() < 1e-12, "{what}: {contact:?}");
    let on_axis = c.point(contact.s) - contact.normal * c.radius;
    assert!(
        (contact.on_a - on_axis).norm() < 1e-12,
        "{what}: {contact:?}"
    );
    assert!((0.0..=1.0).contains(&contact.s) && (0.0..=1.0).contains(&contact.t));
}

#[test]
fn convex_clearances_are_attained_and_not_surpassed() {
    let mut rng = generator(11);
    let directions: Vec<_> = (0..400).map(|_| direction(&mut rng)).collect();
    let mut deep = 0;
    for round in 0..400 {
        for body in bodies(&mut rng) {
            let mut c = capsule(&mut rng, [0.6, 1.0, 2.0][round % 3]);
            match round % 11 {
                0 => c.b = c.a,
                1 => c.b = c.a + Vector3::x(),
                _ => {}
            }
            let contact = capsule_solid(&c, &body.solid);
            check_fields(&contact, &c, body.name);
            // The plane across the normal proves the clearance from below …
            let proven = separation(&c, &body, &contact.normal);
            assert!(
                (proven - contact.clearance).abs() < 1e-10,
                "{} {c:?} {contact:?} {proven}",
                body.name
            );
            if contact.clearance + c.radius > 0.0 {
                // … and two points of axis and body, so far apart, from above.
                for n in &directions {
                    assert!(
                        n.dot(&contact.on_b.coords) <= body.hull.extent(n) + 1e-10,
                        "{}",
                        body.name
                    );
                }
            } else {
                deep += 1;
                assert!(
                    contact.clearance >= steepest(&c, &body, &directions, &mut rng) - 1e-9,
                    "{} {c:?} {contact:?}",
                    body.name
                );
            }
        }
    }
    assert!(deep > 500, "{deep}");
}

/// The greatest separation over many directions, improved by random steps.
fn steepest(c: &Capsule, body: &Body, directions: &[Vector3<f64>], rng: &mut Pcg64) -> f64 {
    let mut best: Vec<_> = directions
        .iter()
        .map(|n| (separation(c, body, n), *n))
        .collect();
    best.sort_by(|p, q| q.0.total_cmp(&p.0));
    best.truncate(3);
    for (value, n) in &mut best {
        let mut step = 0.2;
        while step > 1e-6 {
            let tries = (0..12).map(|_| (*n + vector(rng, step)).normalize());
            let found = tries
                .map(|n| (separation(c, body, &n), n))
                .max_by(|p, q| p.0.total_cmp(&q.0));
            match found {
                Some(better) if better.0 > *value => (*value, *n) = better,
                _ => step *= 0.6,
            }
        }
    }
    best.iter().map(|b| b.0).fold(f64::MIN, f64::max)
}

#[test]
fn known_depths() {
    let bar = |a: [f64; 3], b: [f64; 3]| Capsule {
        a: Point3::from(a),
        b: Point3::from(b),
        radius: 0.125,
    };
    let unit = Solid::cuboid(Point3::new(-1.0, -1.0, -1.0), Point3::new(1.0, 1.0, 1.0)).unwrap();
    // Through the middle: out sideways, by any of four faces.
    let contact = capsule_solid(&bar([0.0, 0.0, -5.0], [0.0, 0.0, 5.0]), &unit);
    assert_eq!((contact.clearance, contact.unique), (-1.125, false));
    // Out upwards.
    let contact = capsule_solid(&bar([0.0, 0.0, 0.75], [0.25, 0.0, 9.0]), &unit);
    assert_eq!(
        (contact.clearance, contact.normal, contact.s),
        (-0.375, Vector3::z(), 0.0)
    );
    assert!(contact.unique);
    // Across the edge x = z = 1, half way in.
    let contact = capsule_solid(&bar([1.25, 0.0, 0.25], [0.25, 0.0, 1.25]), &unit);
    let depth = (2.0 - 1.5) / 2f64.sqrt();
    assert!((contact.clearance + depth + 0.125).abs() < 1e-15);
    assert!((contact.s - 0.5).abs() < 1e-15 && contact.unique);
    assert!((contact.on_b - Point3::new(1.0, 0.0, 1.0)).norm() < 1e-15);

    let drum =
        Solid::cylinder(Point3::new(0.0, 0.0, -1.0), Point3::new(0.0, 0.0, 1.0), 1.0).unwrap();
    let contact = capsule_solid(&bar([0.75, -3.0, 0.0], [0.75, 3.0, 0.0]), &drum);
    assert_eq!(
        (contact.clearance, contact.normal, contact.s),
        (-0.375, Vector3::x(), 0.5)
    );
    let contact = capsule_solid(&bar([0.0, 0.0, 0.5], [0.0, 0.0, 7.0]), &drum);
    assert_eq!((contact.clearance, contact.normal), (-0.625, Vector3::z()));

    // Two balls with one centre, and a bar through the centre of a ball.
    let ball = Solid::sphere(Point3::origin(), 0.5).unwrap();
    let contact = capsule_solid(&bar([0.0; 3], [0.0; 3]), &ball);
    assert_eq!((contact.clearance, contact.unique), (-0.625, false));
    let contact = capsule_solid(&bar([-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]), &ball);
    assert_eq!(
        (contact.clearance, contact.unique, contact.normal.x),
        (-0.625, false, 0.0)
    );

    let floor = Solid::half_space(Point3::new(7.0, 8.0, 0.0), Vector3::new(0.0, 0.0, 5.0)).unwrap();
    let contact = capsule_solid(&bar([0.0, 0.0, 3.0], [1.0, 0.0, -2.0]), &floor);
    assert_eq!(
        (contact.clearance, contact.normal, contact.s),
        (-2.125, Vector3::z(), 1.0)
    );
    let contact = capsule_solid(&bar([0.0, 0.0, 3.0], [1.0, 0.0, 3.0]), &floor);
    assert_eq!(
        (contact.clearance, contact.unique, contact.s),
        (2.875, false, 0.5)
    );
}

#[test]
fn capsules_against_each_other() {
    let at = |a: [f64; 3], b: [f64; 3], radius: f64| Capsule {
        a: Point3::from(a),
        b: Point3::from(b),
        radius,
    };
    // Crossing axes: across both, towards the middle of the first.
    let across = at([0.0, -1.0, 0.0], [0.0, 1.0, 0.0], 0.25);
    let contact = capsule_capsule(&at([-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], 0.5), &across);
    assert_eq!((contact.clearance, contact.unique), (-0.75, false));
    assert_eq!(contact.normal.z.abs(), 1.0);
    assert!((contact.on_a - contact.on_b - contact.normal * contact.clearance).norm() < 1e-15);
    // Collinear and overlapping.
    let contact = capsule_capsule(
        &at([0.0; 3], [2.0, 0.0, 0.0], 0.5),
        &at([1.0, 0.0, 0.0], [4.0, 0.0, 0.0], 0.5),
    );
    assert_eq!(
        (contact.clearance, contact.unique, contact.normal.x),
        (-1.0, false, 0.0)
    );
    // One point.
    let dot = at([1.0, 2.0, 3.0], [1.0, 2.0, 3.0], 0.5);
    let contact = capsule_capsule(&dot, &dot);
    assert_eq!((contact.clearance, contact.unique), (-1.0, false));
    assert!((contact.normal.norm() - 1.0).abs() < 1e-15);

    let mut rng = generator(12);
    for _ in 0..20_000 {
        let (a, b) = (capsule(&mut rng, 1.0), capsule(&mut rng, 1.0));
        let contact = capsule_capsule(&a, &b);
        check_fields(&contact, &a, "capsules");
        check_fields(&contact.flipped(), &b, "capsules flipped");
        let mirrored = capsule_capsule(&b, &a).flipped();
        assert!((mirrored.clearance - contact.clearance).abs() < 1e-13);
        assert!((mirrored.normal - contact.normal).norm() < 1e-9);
        let turned = Capsule {
            a: a.b,
            b: a.a,
            ..a
        };
        let turned = capsule_capsule(&turned, &b);
        assert!((turned.clearance - contact.clearance).abs() < 1e-13);
        assert!((turned.s + contact.s - 1.0).abs() < 1e-9);
        assert!(capsule_capsule_lower_bound(&a, &b) <= contact.clearance + 1e-15);
        let as_solid = Solid::capsule(b.a, b.b, b.radius).unwrap();
        assert_eq!(capsule_solid(&a, &as_solid), contact);
    }
}

/// All kinds of solids, a mesh among them.
fn solids(rng: &mut Pcg64) -> Vec<(&'static str, Solid)> {
    let mut all: Vec<_> = bodies(rng).into_iter().map(|b| (b.name, b.solid)).collect();
    let holed = HoledBox {
        half: Vector3::new(0.5, 0.7, 0.8),
        hole: 0.4,
        sides: 9,
    };
    all.push(("holed box", holed.solid(&pose(rng, 0.3))));
    all
}

#[test]
fn the_normal_is_the_gradient() {
    let mut rng = generator(13);
    let (mut tested, mut off) = (0, 0);
    for _ in 0..300 {
        for (name, solid) in solids(&mut rng) {
            let c = capsule(&mut rng, 1.2);
            let contact = capsule_solid(&c, &solid);
            if !contact.unique {
                continue;
            }
            let (va, vb) = (vector(&mut rng, 1.0), vector(&mut rng, 1.0));
            let after = |h: f64| {
                let moved = Capsule {
                    a: c.a + va * h,
                    b: c.b + vb * h,
                    ..c
                };
                capsule_solid(&moved, &solid).clearance
            };
            let h = 1e-6;
            let measured = (after(h) - after(-h)) / (2.0 * h);
            let predicted = contact
                .normal
                .dot(&(va * (1.0 - contact.s) + vb * contact.s));
            tested += 1;
            if (measured - predicted).abs() > 1e-4 {
                off += 1;
                // A kink within the difference is the only excuse; forward and backward differ there.
                let (forward, backward) =
                    (after(h) - contact.clearance, contact.clearance - after(-h));
                assert!(
                    (forward - backward).abs() > 1e-5 * h,
                    "{name} {c:?} {contact:?} {measured} {predicted}"
                );
            }
        }
    }
    assert!(tested > 2000 && off < tested / 200, "{off} of {tested}");
}

#[test]
fn clearance_never_changes_faster_than_the_capsule_moves() {
    let mut rng = generator(14);
    for _ in 0..25 {
        for (name, solid) in solids(&mut rng) {
            // A straight way through the body, from outside to outside.
            let (start, end) = (capsule(&mut rng, 1.6), capsule(&mut rng, 1.6));
            let steps = 200;
            let at = |k: usize| {
                let time = k as f64 / steps as f64;
                Capsule {
                    a: start.a + (end.a - start.a) * time,
                    b: start.b + (end.b - start.b) * time,
                    radius: 0.1,
                }
            };
            let step = (end.a - start.a).norm().max((end.b - start.b).norm()) / steps as f64;
            for k in 0..steps {
                let change = capsule_solid(&at(k + 1), &solid).clearance
                    - capsule_solid(&at(k), &solid).clearance;
                assert!(
                    change.abs() <= step + 1e-8,
                    "{name}: {change} in a step of {step}, {:?}",
                    at(k)
                );
            }
        }
    }
}

#[test]
fn clearance_does_not_depend_on_the_frame() {
    let mut rng = generator(15);
    for _ in 0..100 {
        for (name, solid) in solids(&mut rng) {
            let (c, motion) = (capsule(&mut rng, 1.0), pose(&mut rng, 3.0));
            let here = capsule_solid(&c, &solid);
            let there = capsule_solid_posed(&c.transformed(&motion), &solid, &motion);
            assert!((here.clearance - there.clearance).abs() < 1e-8, "{name}");
            check_fields(&there, &c.transformed(&motion), name);
            if here.unique && there.unique {
                assert!(
                    (motion * here.normal - there.normal).norm() < 1e-5,
                    "{name} {here:?} {there:?}"
                );
            }
        }
    }
}

#[test]
fn lower_bounds_are_below() {
    let mut rng = generator(16);
    for round in 0..300 {
        for (name, solid) in solids(&mut rng) {
            let c = capsule(&mut rng, [0.7, 3.0][round % 2]);
            let clearance = capsule_solid(&c, &solid).clearance;
            assert!(
                clearance_lower_bound(&c, &solid) <= clearance + 1e-12,
                "{name}"
            );
            let p = point(&mut rng, 2.0);
            let dot = Capsule {
                a: p,
                b: p,
                radius: 0.0,
            };
            let distance = capsule_solid(&dot, &solid).clearance;
            assert!(solid.distance_bound(&p) <= distance + 1e-12, "{name}");
            if !matches!(name, "half-space") {
                let bounds = solid.aabb();
                let (center, reach) = solid.bounding_sphere();
                assert!(
                    bounds.distance_to_point(&contact_point(&dot, &solid)) < 1e-9,
                    "{name}"
                );
                assert!(
                    (contact_point(&dot, &solid) - center).norm() < reach + 1e-9,
                    "{name}"
                );
            }
        }
    }
}

fn contact_point(c: &Capsule, solid: &Solid) -> Point3<f64> {
    capsule_solid(c, solid).on_b
}

#[test]
fn a_mesh_agrees_with_all_its_triangles() {
    let mut rng = generator(17);
    let holed = HoledBox {
        half: Vector3::new(0.6, 0.5, 0.4),
        hole: 0.3,
        sides: 12,
    };
    let (vertices, faces) = holed.surface();
    let (mut outside, mut touching, mut inside) = (0, 0, 0);
    let mut hint = MeshHint::default();
    for round in 0..600 {
        let place = pose(&mut rng, 1.0);
        let solid = holed.solid(&place);
        let mut local = capsule(&mut rng, [0.3, 0.6, 1.5][round % 3]);
        if round % 5 == 0 {
            local.b = local.a + (local.b - local.a) * 0.05;
        }
        if round % 7 == 0 {
            // Along the hole.
            local.b = local.a + Vector3::x();
        }
        let c = local.transformed(&place);
        let contact = capsule_solid(&c, &solid);
        check_fields(&contact, &c, "mesh");
        let hinted = capsule_solid_hinted(&c, &solid, &mut hint);
        assert!((hinted.clearance - contact.clearance).abs() < 1e-9);

        let triangles = || faces.iter().map(|f| [0, 1, 2].map(|k| vertices[f[k]]));
        let distance = triangles()
            .map(|t| closest_points_segment_triangle(&local.a, &local.b, &t).distance())
            .fold(f64::INFINITY, f64::min);
        if distance > 1e-9 && !holed.contains(&local.a) {
            outside += 1;
            assert!(
                (contact.clearance + c.radius - distance).abs() < 1e-12,
                "{local:?} {contact:?} {distance}"
            );
            continue;
        }
        // The deepest of many points of the axis.
        let signed = |s: f64| {
            let p = local.point(s);
            let distance = triangles()
                .map(|t| closest_points_point_triangle(&p, &t).distance())
                .fold(f64::INFINITY, f64::min);
            if holed.contains(&p) {
                -distance
            } else {
                distance
            }
        };
        let samples = 300;
        let deepest = (0..=samples)
            .map(|k| signed(f64::from(k) / f64::from(samples)))
            .fold(f64::INFINITY, f64::min);
        let found = contact.clearance + c.radius;
        let step = local.axis().norm() / f64::from(samples);
        assert!(
            found <= deepest + 1e-8 && found >= deepest - step,
            "{found} {deepest}"
        );
        assert!((signed(contact.s) - found).abs() < 1e-9);
        if distance > 1e-9 {
            inside += 1
        } else {
            touching += 1
        }
    }
    assert!(
        outside > 100 && touching > 100 && inside > 20,
        "{outside} {touching} {inside}"
    );
}

#[test]
fn a_peg_in_its_hole() {
    let holed = HoledBox::benchmark();
    let place = Isometry3::new(Vector3::new(1.0, 2.0, 3.0), Vector3::new(0.3, -0.4, 0.5));
    let solid = holed.solid(&place);
    let apothem = holed.hole * (std::f64::consts::PI / 37.0).cos();
    // On the axis of the hole, every wall is equally far.
    let peg = Capsule {
        a: Point3::new(-0.2, 0.0, 0.0),
        b: Point3::new(0.2, 0.0, 0.0),
        radius: 0.005,
    };
    let contact = capsule_solid(&peg.transformed(&place), &solid);
    assert!((contact.clearance - (apothem - 0.005)).abs() < 1e-12);
    // Off the axis, towards the middle of a side.
    let angle = std::f64::consts::PI / 37.0;
    let shift = Vector3::new(0.0, angle.cos(), angle.sin());
    for by in [0.004, 0.0095, 0.012] {
        let moved = Capsule {
            a: peg.a + shift * by,
            b: peg.b + shift * by,
            ..peg
        };
        let contact = capsule_solid(&moved.transformed(&place), &solid);
        assert!(
            (contact.clearance - (apothem - 0.005 - by)).abs() < 1e-12,
            "{contact:?}"
        );
        assert!((contact.normal + place * shift).norm() < 1e-9);
    }
    // In the wall, between hole and side: the deepest point is half-way.
    let wall = Capsule {
        a: Point3::new(0.0, 0.0375 - 0.008, 0.0),
        b: Point3::new(0.0, 0.0375 + 0.008, 0.0),
        radius: 0.001,
    };
    let contact = capsule_solid(&wall.transformed(&place), &solid);
    assert!((contact.clearance + 0.009).abs() < 1e-9, "{contact:?}");
}

#[test]
fn faces_listed_twice_and_turned_make_the_same_body() {
    let holed = HoledBox::benchmark();
    let (vertices, faces) = holed.surface();
    assert_eq!((vertices.len(), faces.len()), (90, 180));
    let mut twice = faces.clone();
    twice.extend(faces.iter().cloned());
    let turned: Vec<Vec<usize>> = faces
        .iter()
        .enumerate()
        .map(|(i, f)| {
            if i % 3 == 0 {
                f.iter().rev().copied().collect()
            } else {
                f.clone()
            }
        })
        .collect();
    let inside_out: Vec<Vec<usize>> = faces
        .iter()
        .map(|f| f.iter().rev().copied().collect())
        .collect();
    let plain = Solid::mesh(&vertices, &faces).unwrap();
    let mut rng = generator(18);
    for other in [twice, turned, inside_out] {
        let other = Solid::mesh(&vertices, &other).unwrap();
        for _ in 0..200 {
            let mut c = capsule(&mut rng, 0.06);
            c.radius = 0.001;
            let difference =
                capsule_solid(&c, &plain).clearance - capsule_solid(&c, &other).clearance;
            assert!(difference.abs() < 1e-10);
        }
    }
}

#[test]
fn the_same_body_by_four_constructors() {
    let mut rng = generator(19);
    let half = Vector3::new(0.5, 0.6, 0.7);
    let (min, max) = (Point3::from(-half), Point3::from(half));
    let corners: Vec<_> = (0..8)
        .map(|k| Point3::from([0, 1, 2].map(|b| if k >> b & 1 == 1 { max[b] } else { min[b] })))
        .collect();
    let faces = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    let convex = [
        Solid::cuboid(min, max).unwrap(),
        Solid::oriented_box(&Isometry3::identity(), half).unwrap(),
        Solid::convex_hull(&corners).unwrap(),
    ];
    let mesh = Solid::mesh(&corners, &faces).unwrap();
    for _ in 0..3000 {
        let c = capsule(&mut rng, 1.2);
        let clearances = [0, 1, 2].map(|k| capsule_solid(&c, &convex[k]).clearance);
        assert!((clearances[0] - clearances[1]).abs() < 1e-14);
        assert!((clearances[0] - clearances[2]).abs() < 1e-12);
        let on_mesh = capsule_solid(&c, &mesh).clearance;
        if clearances[0] > -c.radius {
            assert!(
                (clearances[0] - on_mesh).abs() < 1e-12,
                "{clearances:?} {on_mesh}"
            );
        } else {
            assert!(on_mesh <= -c.radius + 1e-12);
        }
    }
}

#[test]
fn far_from_the_origin_and_at_other_scales() {
    let mut rng = generator(20);
    for scale in [1e-3, 1.0, 1e3] {
        for _ in 0..200 {
            for body in bodies(&mut rng) {
                if matches!(body.name, "half-space") {
                    continue;
                }
                let c = capsule(&mut rng, 1.0);
                let here = capsule_solid(&c, &body.solid).clearance;
                let cloud: Vec<_> = body.hull.points.iter().map(|p| p * scale).collect();
                let (Ok(solid), None) = (Solid::convex_hull(&cloud), body.hull.disc) else {
                    continue;
                };
                let scaled = Capsule {
                    a: c.a * scale,
                    b: c.b * scale,
                    radius: c.radius * scale,
                };
                let there = capsule_solid(&scaled, &solid).clearance + body.hull.radius * scale;
                if body.hull.radius == 0.0 {
                    assert!(
                        (here * scale - there).abs() < 1e-10 * scale,
                        "{} {here} {there}",
                        body.name
                    );
                }
            }
        }
    }
}

#[test]
fn a_peg_in_a_hole_has_the_walls_all_around() {
    // A box with a square hole, 2 wide, along z: corners of the hole and of the box, below and above.
    let square = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let mut corners = Vec::new();
    for z in [0.0, 4.0] {
        for scale in [1.0, 3.0] {
            corners.extend(square.map(|[x, y]| Point3::new(scale * x, scale * y, z)));
        }
    }
    let mut faces = Vec::new();
    for i in 0..4 {
        let j = (i + 1) % 4;
        faces.push([i, i + 8, j + 8, j]);
        faces.push([i + 4, j + 4, j + 12, i + 12]);
        faces.push([i, j, j + 4, i + 4]);
        faces.push([i + 8, i + 12, j + 12, j + 8]);
    }
    let solid = Solid::mesh(&corners, &faces).unwrap();
    let peg = Capsule::new(
        Point3::new(0.2, -0.1, 1.0),
        Point3::new(0.25, 0.1, 6.0),
        0.5,
    )
    .unwrap();
    let mut found = Vec::new();
    capsule_solid_around(&peg, &solid, 1.0, &mut found);
    let nearest = capsule_solid(&peg, &solid);
    assert!((found[0].clearance - nearest.clearance).abs() < 1e-12);
    for contact in &found {
        check_fields(contact, &peg, "peg");
        assert!(contact.clearance < 1.0);
    }
    for (normal, clearance) in [
        (Vector3::x(), 0.7),
        (-Vector3::x(), 0.3),
        (Vector3::y(), 0.4),
        (-Vector3::y(), 0.6),
    ] {
        // The lower end at the wall, the upper part at its rim.
        let walls = found.iter().filter(|c| c.normal.dot(&normal) > 0.98);
        assert!(walls.clone().any(|c| c.s > 0.5), "{normal}");
        let at_end = walls.clone().find(|c| c.s == 0.0).unwrap();
        assert!((at_end.clearance - clearance).abs() < 1e-12, "{normal}");
    }
    let mut none = Vec::new();
    let ball = Solid::sphere(Point3::origin(), 1.0).unwrap();
    capsule_solid_around(&peg, &ball, 9.0, &mut none);
    assert!(none.is_empty());
}
