//! What the tests and the cost example share: random bodies and a box with a round hole through it.
#![allow(dead_code)] // Every user takes a part of it.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use tensegra_collision::{Capsule, Solid};

pub fn generator(seed: u64) -> Pcg64 {
    Pcg64::seed_from_u64(seed)
}

/// Uniform in a cube.
pub fn vector(rng: &mut Pcg64, reach: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| rng.random_range(-reach..=reach))
}

pub fn point(rng: &mut Pcg64, reach: f64) -> Point3<f64> {
    Point3::from(vector(rng, reach))
}

/// Uniform on the sphere.
pub fn direction(rng: &mut Pcg64) -> Vector3<f64> {
    loop {
        let v = vector(rng, 1.0);
        if v.norm() > 0.1 && v.norm() < 1.0 {
            return v.normalize();
        }
    }
}

pub fn capsule(rng: &mut Pcg64, reach: f64) -> Capsule {
    Capsule {
        a: point(rng, reach),
        b: point(rng, reach),
        radius: rng.random_range(0.0..0.2),
    }
}

pub fn pose(rng: &mut Pcg64, reach: f64) -> Isometry3<f64> {
    let turn = direction(rng) * rng.random_range(0.0..std::f64::consts::PI);
    Isometry3::from_parts(
        Translation3::from(vector(rng, reach)),
        UnitQuaternion::from_scaled_axis(turn),
    )
}

/// A convex body together with a description of it that is independent of the library.
pub struct Body {
    pub name: &'static str,
    pub solid: Solid,
    pub hull: Hull,
}

/// The greatest `n · x` of a body is that of its points plus this.
pub struct Hull {
    pub points: Vec<Point3<f64>>,
    pub radius: f64,
    /// A disc of this radius, across this unit vector, around every point.
    pub disc: Option<(f64, Vector3<f64>)>,
    /// The one direction in which a half-space is bounded.
    pub only: Option<Vector3<f64>>,
}

impl Hull {
    fn of_points(points: Vec<Point3<f64>>) -> Self {
        Self {
            points,
            radius: 0.0,
            disc: None,
            only: None,
        }
    }

    pub fn extent(&self, n: &Vector3<f64>) -> f64 {
        if self.only.is_some_and(|only| (only - n).norm() > 1e-12) {
            return f64::INFINITY;
        }
        let farthest = self
            .points
            .iter()
            .map(|p| n.dot(&p.coords))
            .fold(f64::MIN, f64::max);
        let disc = self
            .disc
            .map_or(0.0, |(r, axis)| r * (n - axis * axis.dot(n)).norm());
        farthest + self.radius + disc
    }
}

fn corners(center: Point3<f64>, edges: [Vector3<f64>; 3]) -> Vec<Point3<f64>> {
    (0..8)
        .map(|k| {
            let sign = |bit: usize| if k >> bit & 1 == 1 { 1.0 } else { -1.0 };
            center + edges[0] * sign(0) + edges[1] * sign(1) + edges[2] * sign(2)
        })
        .collect()
}

/// One convex body of each kind, about a unit large, near the origin.
pub fn bodies(rng: &mut Pcg64) -> Vec<Body> {
    let mut size = || 0.3 + 0.7 * rng.random::<f64>();
    let half = Vector3::new(size(), size(), size());
    let (radius, height) = (size(), size());
    let center = point(rng, 0.3);
    let axes = Vector3::new(half.x, 0.0, 0.0);
    let place = pose(rng, 0.3);
    let axis = direction(rng);
    let (p, q) = (center - axis * height, center + axis * height);
    let normal = direction(rng);
    let corner = [point(rng, 1.0), point(rng, 1.0), point(rng, 1.0)];
    let up = (corner[1] - corner[0])
        .cross(&(corner[2] - corner[0]))
        .normalize()
        * height;
    let cloud: Vec<_> = (0..20).map(|_| point(rng, 0.8)).collect();
    vec![
        Body {
            name: "sphere",
            solid: Solid::sphere(center, radius).unwrap(),
            hull: Hull {
                radius,
                ..Hull::of_points(vec![center])
            },
        },
        Body {
            name: "capsule",
            solid: Solid::capsule(p, q, radius).unwrap(),
            hull: Hull {
                radius,
                ..Hull::of_points(vec![p, q])
            },
        },
        Body {
            name: "box",
            solid: Solid::cuboid(center - half, center + half).unwrap(),
            hull: Hull::of_points(corners(
                center,
                [
                    axes,
                    Vector3::new(0.0, half.y, 0.0),
                    Vector3::new(0.0, 0.0, half.z),
                ],
            )),
        },
        Body {
            name: "oriented box",
            solid: Solid::oriented_box(&place, half).unwrap(),
            hull: Hull::of_points(corners(
                place * Point3::origin(),
                [
                    place * Vector3::x() * half.x,
                    place * Vector3::y() * half.y,
                    place * Vector3::z() * half.z,
                ],
            )),
        },
        Body {
            name: "cylinder",
            solid: Solid::cylinder(p, q, radius).unwrap(),
            hull: Hull {
                disc: Some((radius, axis)),
                ..Hull::of_points(vec![p, q])
            },
        },
        Body {
            name: "half-space",
            solid: Solid::half_space(center, normal * 3.0).unwrap(),
            hull: Hull {
                only: Some(normal),
                ..Hull::of_points(vec![center])
            },
        },
        Body {
            name: "prism",
            solid: Solid::triangular_prism(corner[0], corner[1], corner[2], height).unwrap(),
            hull: Hull::of_points(corner.iter().flat_map(|c| [*c, c + up]).collect()),
        },
        Body {
            name: "convex hull",
            solid: Solid::convex_hull(&cloud).unwrap(),
            hull: Hull::of_points(cloud),
        },
    ]
}

/// A box around the origin with a hole along x through it, a regular polygon with corners on a circle.
#[derive(Clone, Copy)]
pub struct HoledBox {
    pub half: Vector3<f64>,
    pub hole: f64,
    pub sides: usize,
}

impl HoledBox {
    /// As large as a benchmark's: 90 vertices, 180 different triangles.
    pub fn benchmark() -> Self {
        Self {
            half: Vector3::new(0.05625, 0.0375, 0.0375),
            hole: 0.015,
            sides: 37,
        }
    }

    pub fn surface(&self) -> (Vec<Point3<f64>>, Vec<Vec<usize>>) {
        let n = self.sides;
        let mut vertices = Vec::new();
        // Corner i of the hole: 2 i at the end of negative x, 2 i + 1 at the other.
        for i in 0..n {
            let (sin, cos) = (std::f64::consts::TAU * i as f64 / n as f64).sin_cos();
            for x in [-self.half.x, self.half.x] {
                vertices.push(Point3::new(x, self.hole * cos, self.hole * sin));
            }
        }
        // Corners and middles of sides of the box, by angle.
        let ring = [
            (1, 0),
            (1, 1),
            (0, 1),
            (-1, 1),
            (-1, 0),
            (-1, -1),
            (0, -1),
            (1, -1),
        ];
        for (y, z) in ring {
            for x in [-self.half.x, self.half.x] {
                let (y, z) = (self.half.y * f64::from(y), self.half.z * f64::from(z));
                vertices.push(Point3::new(x, y, z));
            }
        }
        let inner = |i: usize, side: usize| 2 * (i % n) + side;
        let outer = |k: usize, side: usize| 2 * n + 2 * (k % 8) + side;
        let mut faces = Vec::new();
        for i in 0..n {
            faces.push(vec![inner(i, 1), inner(i, 0), inner(i + 1, 0)]);
            faces.push(vec![inner(i, 1), inner(i + 1, 0), inner(i + 1, 1)]);
        }
        for k in 0..8 {
            faces.push(vec![outer(k, 0), outer(k, 1), outer(k + 1, 1)]);
            faces.push(vec![outer(k, 0), outer(k + 1, 1), outer(k + 1, 0)]);
        }
        // The ring between hole and rim, advancing on whichever side lags in angle.
        let (mut i, mut k) = (0, 0);
        while i < n || k < 8 {
            let inner_next = (i + 1) as f64 / n as f64;
            let outer_next = (k + 1) as f64 / 8.0;
            let (face, mirrored);
            if i < n && (k == 8 || inner_next <= outer_next) {
                face = vec![inner(i, 1), outer(k, 1), inner(i + 1, 1)];
                mirrored = vec![inner(i, 0), inner(i + 1, 0), outer(k, 0)];
                i += 1;
            } else {
                face = vec![inner(i, 1), outer(k, 1), outer(k + 1, 1)];
                mirrored = vec![inner(i, 0), outer(k + 1, 0), outer(k, 0)];
                k += 1;
            }
            faces.push(face);
            faces.push(mirrored);
        }
        (vertices, faces)
    }

    pub fn solid(&self, place: &Isometry3<f64>) -> Solid {
        let (vertices, faces) = self.surface();
        let vertices: Vec<_> = vertices.iter().map(|p| place * p).collect();
        Solid::mesh(&vertices, &faces).unwrap()
    }

    /// Whether a point, in the frame of the box, is inside.
    pub fn contains(&self, p: &Point3<f64>) -> bool {
        let in_box = (0..3).all(|k| p[k].abs() < self.half[k]);
        let step = std::f64::consts::TAU / self.sides as f64;
        let angle = p.z.atan2(p.y).rem_euclid(step) - 0.5 * step;
        let in_hole = p.y.hypot(p.z) * angle.cos() < self.hole * (0.5 * step).cos();
        in_box && !in_hole
    }
}
