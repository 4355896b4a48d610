//! The body inside a closed surface of triangles, convex or not.
//!
//! Distances come from a tree of boxes in a frame aligned with the largest faces; the side of the surface from the
//! angle-weighted normal at the closest point (Bærentzen and Aanæs, "Signed Distance Computation Using the Angle
//! Weighted Pseudonormal", IEEE TVCG 11(3), 2005).

mod bvh;
mod polygon;
mod segment;
mod surface;

use nalgebra::{Point3, Vector3};

pub(crate) use bvh::Bvh;
pub(crate) use segment::{axis_mesh, axis_mesh_around};

use crate::closest::{Feature, point_triangle};
use crate::frame::Frame;
use crate::{Aabb, MeshError};
use surface::Surface;

/// A triangle of the surface, in the frame of the mesh.
#[derive(Clone, Debug)]
pub(crate) struct Triangle {
    pub corners: [Point3<f64>; 3],
    /// Outward unit normal.
    pub normal: Vector3<f64>,
    pub offset: f64,
    /// Bit `i`: edge `i` is this triangle's to test. Of two neighbours one is charged, and neither where they lie in
    /// one plane: no closest point lies on such an edge only.
    edges: u8,
}

impl Triangle {
    #[inline(always)]
    pub fn height(&self, p: &Point3<f64>) -> f64 {
        self.normal.dot(&p.coords) - self.offset
    }
}

#[derive(Clone, Debug)]
pub(crate) struct Mesh {
    /// The frame of the mesh in the frame of the solid.
    pub frame: Frame,
    /// In the order of the tree's leaves.
    pub triangles: Vec<Triangle>,
    /// For each triangle, the normals of its edges and corners, not of unit length.
    pseudonormals: Vec<[Vector3<f64>; 6]>,
    /// In the frame of the solid.
    pub vertices: Vec<Point3<f64>>,
    pub tree: Bvh,
    /// Half of the diagonal of the bounding box: the scale of the tolerances.
    pub size: f64,
}

/// The closest point of a surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SurfacePoint {
    pub triangle: usize,
    pub feature: Feature,
    pub point: Point3<f64>,
}

/// The point of the surface closest to a point, and the signed distance, negative inside.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SignedDistance {
    pub distance: f64,
    /// Gradient of the signed distance, of unit length.
    pub gradient: Vector3<f64>,
    pub triangle: usize,
}

impl Mesh {
    pub fn new<F: AsRef<[usize]>>(given: &[Point3<f64>], faces: &[F]) -> Result<Self, MeshError> {
        let surface = Surface::new(given, faces)?;
        let frame = aligned_frame(&surface);
        let local: Vec<_> = surface
            .vertices
            .iter()
            .map(|p| Point3::from(frame.local_point(p)))
            .collect();
        let boxes: Vec<Aabb> = surface
            .triangles
            .iter()
            .map(|t| box_of(&t.map(|v| local[v])))
            .collect();
        let (tree, order) = Bvh::new(&boxes);
        let size = tree.bounds().half_extents().norm();

        let normals: Vec<Vector3<f64>> = surface
            .triangles
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(|v| local[v]);
                (b - a).cross(&(c - a)).normalize()
            })
            .collect();
        let mut at_vertex = vec![Vector3::zeros(); local.len()];
        for (t, normal) in surface.triangles.iter().zip(&normals) {
            for k in 0..3 {
                let [p, q, r] = [t[k], t[(k + 1) % 3], t[(k + 2) % 3]].map(|v| local[v]);
                at_vertex[t[k]] += normal * (q - p).angle(&(r - p));
            }
        }

        let mut triangles = Vec::with_capacity(order.len());
        let mut pseudonormals = Vec::with_capacity(order.len());
        for &i in &order {
            let t = surface.triangles[i];
            let corners = t.map(|v| local[v]);
            let normal = normals[i];
            let mut edges = 0;
            let mut pseudo = [Vector3::zeros(); 6];
            for k in 0..3 {
                let (p, q) = (t[k], t[(k + 1) % 3]);
                let other = normals[surface.sides[&(q, p)]];
                let flat = normal.cross(&other).norm() < 1e-9 && normal.dot(&other) > 0.0;
                if p < q && !flat {
                    edges |= 1 << k;
                }
                pseudo[k] = normal + other;
                pseudo[k + 3] = at_vertex[p];
            }
            triangles.push(Triangle {
                corners,
                normal,
                offset: normal.dot(&corners[0].coords),
                edges,
            });
            pseudonormals.push(pseudo);
        }
        Ok(Self {
            frame,
            triangles,
            pseudonormals,
            vertices: surface.vertices,
            tree,
            size,
        })
    }

    /// A normal that tells the two sides of the surface apart, for a point whose closest point is on this feature.
    #[inline]
    pub fn pseudonormal(&self, at: &SurfacePoint) -> Vector3<f64> {
        match at.feature {
            Feature::Face => self.triangles[at.triangle].normal,
            Feature::Edge(k) => self.pseudonormals[at.triangle][usize::from(k)],
            Feature::Corner(k) => self.pseudonormals[at.triangle][usize::from(k) + 3],
        }
    }

    /// Signed distance of a point in the frame of the mesh, and the triangle where it is attained.
    pub fn signed_distance(&self, p: &Point3<f64>) -> SignedDistance {
        let mut best = SurfacePoint {
            triangle: 0,
            feature: Feature::Face,
            point: self.triangles[0].corners[0],
        };
        let squared = self.tree.visit(
            f64::INFINITY,
            |node| {
                let apart = (node.min - p).sup(&(p - node.max)).sup(&Vector3::zeros());
                apart.norm_squared()
            },
            |range, mut limit| {
                for index in range {
                    let triangle = &self.triangles[index];
                    let height = triangle.height(p);
                    if height * height >= limit {
                        continue;
                    }
                    let (point, feature) = point_triangle(p, &triangle.corners);
                    let squared = (p - point).norm_squared();
                    if squared < limit {
                        limit = squared;
                        best = SurfacePoint {
                            triangle: index,
                            feature,
                            point,
                        };
                    }
                }
                limit
            },
        );
        self.signed(p, &best, squared)
    }

    /// Signs the distance of `p` from its closest point on the surface.
    #[inline]
    pub fn signed(&self, p: &Point3<f64>, best: &SurfacePoint, squared: f64) -> SignedDistance {
        let apart = p - best.point;
        let pseudonormal = self.pseudonormal(best);
        let distance = squared.sqrt();
        let sign = 1f64.copysign(apart.dot(&pseudonormal));
        let gradient = if distance > crate::query::TOUCHING * self.size {
            apart * (sign / distance)
        } else {
            // On the surface the difference is rounding. A pseudonormal is a positive sum of outward normals; where
            // it vanishes (a needle's tip) the face must do.
            pseudonormal
                .try_normalize(1e-9)
                .unwrap_or(self.triangles[best.triangle].normal)
        };
        SignedDistance {
            distance: sign * distance,
            gradient,
            triangle: best.triangle,
        }
    }
}

pub(crate) fn box_of(corners: &[Point3<f64>; 3]) -> Aabb {
    let [a, b, c] = corners;
    Aabb {
        min: a.inf(b).inf(c),
        max: a.sup(b).sup(c),
    }
}

/// The frame in which the boxes around the triangles have the least surface: that of the solid, or the one along the
/// two largest directions of faces. It makes boxes of long thin faces tight.
fn aligned_frame(surface: &Surface) -> Frame {
    let areas: Vec<Vector3<f64>> = surface
        .triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|v| surface.vertices[v]);
            (b - a).cross(&(c - a))
        })
        .collect();
    let plain = Frame {
        origin: surface.vertices[0],
        axes: nalgebra::Matrix3::identity(),
    };
    // The area of all faces parallel to each of the largest triangles.
    let mut large: Vec<usize> = (0..areas.len()).collect();
    large.sort_by(|&i, &j| areas[j].norm().total_cmp(&areas[i].norm()).then(i.cmp(&j)));
    large.truncate(64);
    let total = |direction: &Vector3<f64>| -> f64 {
        areas
            .iter()
            .filter(|a| a.cross(direction).norm() <= 1e-3 * a.norm())
            .map(|a| a.norm())
            .sum()
    };
    let candidates: Vec<(Vector3<f64>, f64)> = large
        .iter()
        .map(|&i| areas[i].normalize())
        .map(|d| (d, total(&d)))
        .collect();
    let largest = |pick: &dyn Fn(&Vector3<f64>) -> bool| {
        candidates
            .iter()
            .filter(|(d, _)| pick(d))
            .fold(None::<(Vector3<f64>, f64)>, |best, &(d, area)| match best {
                Some((_, known)) if known >= area => best,
                _ => Some((d, area)),
            })
            .map(|(d, _)| d)
    };
    let Some(z) = largest(&|_| true) else {
        return plain;
    };
    let x = largest(&|d| d.dot(&z).abs() < 1e-3).unwrap_or_else(Vector3::zeros);
    let aligned = Frame::of_axes(plain.origin, &z, &x);
    let cost = |frame: &Frame| -> f64 {
        surface
            .triangles
            .iter()
            .map(|t| {
                let corners = t.map(|v| Point3::from(frame.local_point(&surface.vertices[v])));
                let side = box_of(&corners).half_extents();
                side.x * side.y + side.y * side.z + side.z * side.x
            })
            .sum()
    };
    if cost(&aligned) < 0.999 * cost(&plain) {
        aligned
    } else {
        plain
    }
}
