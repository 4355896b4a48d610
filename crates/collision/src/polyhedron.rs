//! Convex polyhedra: vertices, face planes and the edges between different planes.

use std::collections::HashMap;

use nalgebra::{Point3, Vector3};
use parry3d_f64::math::Vec3;
use parry3d_f64::transformation::try_convex_hull;

use crate::{ShapeError, error, weld::weld};

/// The plane of a face, with the body behind it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Plane {
    pub normal: Vector3<f64>,
    pub offset: f64,
}

impl Plane {
    /// Signed distance of a point, positive outside.
    #[inline(always)]
    pub fn height(&self, p: &Point3<f64>) -> f64 {
        self.normal.dot(&p.coords) - self.offset
    }
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct Edge {
    pub from: Point3<f64>,
    pub to: Point3<f64>,
    pub faces: [u32; 2],
    /// Cosine between the normals of the two faces.
    pub cosine: f64,
}

#[derive(Clone, Debug)]
pub(crate) struct Polyhedron {
    pub vertices: Vec<Point3<f64>>,
    pub planes: Vec<Plane>,
    pub edges: Vec<Edge>,
    /// Half of the diagonal of its bounding box: the scale of its tolerances.
    pub size: f64,
}

/// Vertices nearer than this to a face plane, relative to the size of the body, belong to the face.
const COPLANAR: f64 = 1e-10;

impl Polyhedron {
    /// The convex hull of some points.
    pub fn hull(shape: &'static str, points: &[Point3<f64>]) -> Result<Self, ShapeError> {
        for p in points {
            error::finite_point(shape, "point", p)?;
        }
        let (given, _) = weld(points);
        let given: Vec<Vec3> = given.iter().map(|p| Vec3::new(p.x, p.y, p.z)).collect();
        if given.len() < 4 {
            return Err(ShapeError::TooFewPoints {
                shape,
                given: given.len(),
                needed: 4,
            });
        }
        let flat = ShapeError::Flat { shape };
        let (hull, triangles) = try_convex_hull(&given).map_err(|_| flat.clone())?;
        let vertices: Vec<_> = hull.iter().map(|p| Point3::new(p.x, p.y, p.z)).collect();
        let body = Self::of_triangles(vertices, &triangles).ok_or(flat.clone())?;
        // The hull must hold what it was given; a hull of almost flat points does not.
        let tolerance = 1e-9 * body.size;
        let holds = points
            .iter()
            .all(|p| body.planes.iter().all(|plane| plane.height(p) <= tolerance));
        let thin = body
            .planes
            .iter()
            .any(|plane| body.vertices.iter().all(|v| plane.height(v) >= -tolerance));
        if holds && !thin { Ok(body) } else { Err(flat) }
    }

    /// Joins triangles of one plane into faces. `None` if no closed polyhedron comes out.
    fn of_triangles(vertices: Vec<Point3<f64>>, triangles: &[[u32; 3]]) -> Option<Self> {
        let bounds = crate::Aabb::of_points(&vertices)?;
        let size = bounds.half_extents().norm();
        let area = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| vertices[i as usize]);
            (b - a).cross(&(c - a))
        };
        // Large triangles define the planes, slivers join them.
        let mut order: Vec<usize> = (0..triangles.len()).collect();
        let areas: Vec<f64> = triangles.iter().map(|t| area(t).norm()).collect();
        order.sort_by(|&i, &j| areas[j].total_cmp(&areas[i]));
        let mut planes: Vec<Plane> = Vec::new();
        let mut plane_of = vec![0u32; triangles.len()];
        for i in order {
            let corners = triangles[i].map(|v| vertices[v as usize]);
            let vector = area(&triangles[i]);
            let known = planes.iter().position(|plane| {
                plane.normal.dot(&vector) >= 0.0
                    && corners
                        .iter()
                        .all(|p| plane.height(p).abs() <= COPLANAR * size)
            });
            plane_of[i] = match known {
                Some(index) => index,
                None => {
                    let normal = vector.try_normalize(COPLANAR * size * size)?;
                    let offset = vertices
                        .iter()
                        .map(|v| normal.dot(&v.coords))
                        .fold(f64::NEG_INFINITY, f64::max);
                    planes.push(Plane { normal, offset });
                    planes.len() - 1
                }
            } as u32;
        }
        let mut sides: HashMap<(u32, u32), u32> = HashMap::new();
        for (i, t) in triangles.iter().enumerate() {
            for k in 0..3 {
                sides.insert((t[k], t[(k + 1) % 3]), plane_of[i]);
            }
        }
        let mut edges = Vec::new();
        for (i, t) in triangles.iter().enumerate() {
            for k in 0..3 {
                let (p, q) = (t[k], t[(k + 1) % 3]);
                let other = *sides.get(&(q, p))?;
                if p < q && other != plane_of[i] {
                    let faces = [plane_of[i], other];
                    let [n0, n1] = faces.map(|f| planes[f as usize].normal);
                    edges.push(Edge {
                        from: vertices[p as usize],
                        to: vertices[q as usize],
                        faces,
                        cosine: n0.dot(&n1),
                    });
                }
            }
        }
        (planes.len() >= 4).then_some(Self {
            vertices,
            planes,
            edges,
            size,
        })
    }
}
