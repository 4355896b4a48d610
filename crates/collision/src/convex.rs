//! A convex body placed in space, seen through its extreme points: what the Gilbert-Johnson-Keerthi algorithm and the
//! separating-axis theorem need to know.

use nalgebra::{Point3, Vector3};
use parry3d_f64::math::{Pose, Vec3};
use parry3d_f64::shape::SupportMap;

use crate::frame::Frame;
use crate::polyhedron::Polyhedron;

#[derive(Clone, Copy, Debug)]
pub(crate) struct Convex<'a> {
    pub frame: Frame,
    pub kind: Kind<'a>,
}

/// The body in its frame.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Kind<'a> {
    Box { half: Vector3<f64> },
    Cylinder { radius: f64, half: f64 },
    Polyhedron(&'a Polyhedron),
    Triangle(&'a [Point3<f64>; 3]),
}

/// The points of a convex body that are extreme in some direction: a corner, an edge or a face.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Extreme {
    /// The middle of the points.
    pub point: Point3<f64>,
    pub rank: Rank,
}

#[derive(Clone, Copy, Debug)]
pub(crate) enum Rank {
    Corner,
    /// From one end to the other.
    Edge([Point3<f64>; 2]),
    Face,
}

impl<'a> Convex<'a> {
    /// Half of the diagonal of the body, or more.
    pub fn size(&self) -> f64 {
        match self.kind {
            Kind::Box { half } => half.norm(),
            Kind::Cylinder { radius, half } => radius + half,
            Kind::Polyhedron(body) => body.size,
            Kind::Triangle([a, b, c]) => (b - a).norm().max((c - a).norm()),
        }
    }

    /// A point inside.
    pub fn middle(&self) -> Point3<f64> {
        let mean = |points: &[Point3<f64>]| {
            points.iter().map(|p| p.coords).sum::<Vector3<f64>>() / points.len() as f64
        };
        match self.kind {
            Kind::Box { .. } | Kind::Cylinder { .. } => self.frame.origin,
            Kind::Polyhedron(body) => self.frame.world_point(&mean(&body.vertices)),
            Kind::Triangle(corners) => self.frame.world_point(&mean(corners)),
        }
    }

    /// A point that is extreme along `direction`.
    pub fn support(&self, direction: &Vector3<f64>) -> Point3<f64> {
        let local = self.frame.local_vector(direction);
        let farthest = |points: &[Point3<f64>]| {
            let mut best = (f64::NEG_INFINITY, Vector3::zeros());
            for p in points {
                let height = local.dot(&p.coords);
                if height > best.0 {
                    best = (height, p.coords);
                }
            }
            best.1
        };
        self.frame.world_point(&match self.kind {
            Kind::Box { half } => half.zip_map(&local, f64::copysign),
            Kind::Cylinder { radius, half } => {
                let flat = local.xy().try_normalize(0.0).unwrap_or_default() * radius;
                Vector3::new(flat.x, flat.y, half.copysign(local.z))
            }
            Kind::Polyhedron(body) => farthest(&body.vertices),
            Kind::Triangle(corners) => farthest(corners),
        })
    }

    /// How far the body reaches along the unit vector `n`.
    pub fn extent(&self, n: &Vector3<f64>) -> f64 {
        n.dot(&self.support(n).coords)
    }

    /// All points that are extreme along the unit vector `n`, up to rounding.
    pub fn extreme(&self, n: &Vector3<f64>) -> Extreme {
        const LEVEL: f64 = 1e-9;
        if let Kind::Cylinder { radius, half } = self.kind {
            let local = self.frame.local_vector(n);
            let point = self.support(n);
            let axis = self.frame.axes.column(2).into_owned();
            return if local.xy().norm() <= LEVEL {
                Extreme {
                    point: self.frame.origin + axis * half.copysign(local.z),
                    rank: Rank::Face,
                }
            } else if local.z.abs() <= LEVEL * (1.0 + radius / half) {
                let middle = point - axis * half.copysign(local.z);
                Extreme {
                    point: middle,
                    rank: Rank::Edge([middle - axis * half, middle + axis * half]),
                }
            } else {
                Extreme {
                    point,
                    rank: Rank::Corner,
                }
            };
        }
        let level = self.extent(n) - LEVEL * self.size();
        let mut count = 0;
        let mut sum = Vector3::zeros();
        let mut ends = [self.frame.origin; 2];
        self.for_each_vertex(|p| {
            if n.dot(&p.coords) >= level {
                if count < 2 {
                    ends[count] = p;
                }
                count += 1;
                sum += p.coords;
            }
        });
        Extreme {
            point: Point3::from(sum / count as f64),
            rank: match count {
                1 => Rank::Corner,
                2 => Rank::Edge(ends),
                _ => Rank::Face,
            },
        }
    }

    /// The vertices of a polyhedral body; of a cylinder, eight points of each rim.
    pub fn for_each_vertex(&self, mut visit: impl FnMut(Point3<f64>)) {
        let mut local = |p: Vector3<f64>| visit(self.frame.world_point(&p));
        match self.kind {
            Kind::Box { half } => {
                for corner in 0..8 {
                    let sign = |bit: usize| if corner >> bit & 1 == 1 { 1.0 } else { -1.0 };
                    local(half.component_mul(&Vector3::new(sign(0), sign(1), sign(2))));
                }
            }
            Kind::Cylinder { radius, half } => {
                for step in 0..8 {
                    let (sin, cos) = (f64::from(step) * std::f64::consts::FRAC_PI_4).sin_cos();
                    local(Vector3::new(radius * cos, radius * sin, half));
                    local(Vector3::new(radius * cos, radius * sin, -half));
                }
            }
            Kind::Polyhedron(body) => body.vertices.iter().for_each(|p| local(p.coords)),
            Kind::Triangle(corners) => corners.iter().for_each(|p| local(p.coords)),
        }
    }

    /// Normals of the flat faces, up to sign.
    pub fn for_each_normal(&self, mut visit: impl FnMut(Vector3<f64>)) {
        match self.kind {
            Kind::Box { .. } => {
                for k in 0..3 {
                    visit(self.frame.axes.column(k).into_owned());
                }
            }
            Kind::Cylinder { .. } => visit(self.frame.axes.column(2).into_owned()),
            Kind::Polyhedron(body) => {
                for plane in &body.planes {
                    visit(self.frame.world_vector(&plane.normal));
                }
            }
            Kind::Triangle([a, b, c]) => {
                if let Some(normal) = (b - a).cross(&(c - a)).try_normalize(0.0) {
                    visit(self.frame.world_vector(&normal));
                }
            }
        }
    }

    /// Directions of the straight edges; of a cylinder, of its axis.
    pub fn for_each_edge(&self, mut visit: impl FnMut(Vector3<f64>)) {
        match self.kind {
            Kind::Box { .. } | Kind::Cylinder { .. } => self.for_each_normal(visit),
            Kind::Polyhedron(body) => {
                for edge in &body.edges {
                    visit(self.frame.world_vector(&(edge.to - edge.from).normalize()));
                }
            }
            Kind::Triangle([a, b, c]) => {
                for side in [b - a, c - b, a - c] {
                    visit(self.frame.world_vector(&side.normalize()));
                }
            }
        }
    }
}

pub(crate) fn to_parry(v: &Vector3<f64>) -> Vec3 {
    Vec3::new(v.x, v.y, v.z)
}

pub(crate) fn of_parry(v: Vec3) -> Vector3<f64> {
    Vector3::new(v.x, v.y, v.z)
}

/// The body gives its extreme points in the common frame, so both poses are the identity.
impl SupportMap for Convex<'_> {
    fn local_support_point(&self, direction: Vec3) -> Vec3 {
        to_parry(&self.support(&of_parry(direction)).coords)
    }

    fn support_point(&self, _identity: &Pose, direction: Vec3) -> Vec3 {
        self.local_support_point(direction)
    }
}
