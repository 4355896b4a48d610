//! Solids as a pen would draw them: the faces towards the viewer, shaded, with
//! the outline and the sharp edges; and which points they hide.

use std::collections::HashMap;

use nalgebra::{Isometry3, Point3, Vector3};
use tensegra_model::Shape;

use super::{
    camera::Camera,
    canvas::{Canvas, Fill, Place, Stroke},
    style::{INK, Rgb, WHITE},
};
use crate::geometry::{Bounds, perpendicular, prism_faces};

/// Facets of the mantle of a cylinder.
const FACETS: usize = 48;
/// Edges sharper than this are drawn: the cosine of 40 degrees, so that round
/// bodies of ten or more facets stay smooth.
const SHARP: f64 = 0.766;
const LIGHT: [f64; 3] = [-0.38, 0.74, 0.55];

/// A solid as it is seen.
#[derive(Clone, Debug)]
pub(crate) struct Solid {
    form: Form,
    color: Rgb,
    /// Around the solid in the world.
    pub(crate) bounds: Bounds,
}

#[derive(Clone, Debug)]
enum Form {
    Ball {
        center: Point3<f64>,
        radius: f64,
    },
    /// Faces in the order of drawing; those that face away are left out.
    Faces(Vec<Face>),
}

#[derive(Clone, Debug)]
struct Face {
    /// Corners as seen: right, up, towards the viewer.
    corners: Vec<Point3<f64>>,
    normal: Vector3<f64>,
    /// Whether the edge that starts at each corner is drawn.
    drawn: Vec<bool>,
}

impl Solid {
    /// The solid of `shape` in the frame of `pose`; none for a half-space,
    /// which has no end, and for shapes without extent.
    pub(crate) fn new(
        shape: &Shape,
        pose: &Isometry3<f64>,
        color: Rgb,
        camera: &Camera,
    ) -> Option<Self> {
        let polygons = match shape {
            Shape::Sphere { center, radius } => {
                let center = pose * center;
                let reach = Vector3::repeat(*radius);
                return Some(Self {
                    form: Form::Ball {
                        center: camera.see(&center),
                        radius: *radius,
                    },
                    color,
                    bounds: Bounds {
                        min: center - reach,
                        max: center + reach,
                    },
                });
            }
            Shape::Box { min, max } => box_faces(Bounds {
                min: *min,
                max: *max,
            }),
            Shape::Cylinder { p, q, radius } => cylinder_faces(p, q, *radius),
            Shape::Prism { corners, height } => prism_faces(corners, *height)?,
            Shape::Mesh {
                vertices, faces, ..
            } => outwards(faces.iter().map(|face| {
                let corners = face.iter().filter_map(|&vertex| vertices.get(vertex));
                corners.copied().collect()
            })),
            Shape::HalfSpace { .. } => return None,
        };
        let world: Vec<Vec<Point3<f64>>> = polygons
            .iter()
            .map(|polygon| polygon.iter().map(|corner| pose * corner).collect())
            .collect();
        Some(Self {
            bounds: Bounds::around(world.iter().flatten().copied())?,
            form: Form::Faces(visible_faces(&world, camera)),
            color,
        })
    }

    /// Whether a seen point lies behind or inside the solid.
    pub(crate) fn hides(&self, point: &Point3<f64>) -> bool {
        // A point on the surface is in sight.
        let slack = 1e-3 * self.bounds.diagonal();
        match &self.form {
            Form::Ball { center, radius } => {
                let across = (point.xy() - center.xy()).norm_squared();
                let half = (radius * radius - across).max(0.0).sqrt();
                half > 0.0 && point.z < center.z + half - slack
            }
            Form::Faces(faces) => faces
                .iter()
                .any(|face| face.inside(point) && point.z < face.depth_at(point) - slack),
        }
    }

    /// Whether this solid can only be in front of `other`, never behind it.
    pub(crate) fn is_before(&self, other: &Self, toward: &Vector3<f64>) -> bool {
        let apart = |near: &Self, far: &Self| {
            (0..3).any(|axis| match toward[axis] {
                t if t > 0.0 => far.bounds.max[axis] <= near.bounds.min[axis],
                t if t < 0.0 => far.bounds.min[axis] >= near.bounds.max[axis],
                _ => false,
            })
        };
        apart(self, other) && !apart(other, self)
    }

    pub(crate) fn draw(&self, canvas: &mut Canvas, page: &impl Fn(&Point3<f64>) -> Place) {
        match &self.form {
            Form::Ball { center, radius } => {
                let edge = page(&(center + Vector3::x() * *radius));
                let center = page(center);
                canvas.ball(center, edge[0] - center[0], self.color);
            }
            Form::Faces(faces) => {
                let edge = Stroke::new(self.color.mix(INK, 0.45), 0.6).round();
                for face in faces {
                    let corners: Vec<Place> = face.corners.iter().map(page).collect();
                    let color = face.shaded(self.color);
                    // A line in the same colour closes the seam that renderers
                    // leave between neighbours.
                    let fill = Fill::new(color).outline(Stroke::new(color, 0.5));
                    canvas.polygon(&corners, fill);
                    for (index, _) in face.drawn.iter().enumerate().filter(|(_, drawn)| **drawn) {
                        canvas.line(corners[index], corners[(index + 1) % corners.len()], edge);
                    }
                }
            }
        }
    }
}

impl Face {
    fn inside(&self, point: &Point3<f64>) -> bool {
        // Even-odd rule.
        let mut inside = false;
        for (index, a) in self.corners.iter().enumerate() {
            let b = &self.corners[(index + 1) % self.corners.len()];
            if (a.y > point.y) != (b.y > point.y) {
                let crossing = a.x + (point.y - a.y) / (b.y - a.y) * (b.x - a.x);
                inside ^= point.x < crossing;
            }
        }
        inside
    }

    fn depth_at(&self, point: &Point3<f64>) -> f64 {
        let corner = &self.corners[0];
        let across = (point.xy() - corner.xy()).dot(&self.normal.xy());
        // Faces that are drawn face the viewer: the component is positive.
        corner.z - across / self.normal.z
    }

    fn shaded(&self, color: Rgb) -> Rgb {
        let light = Vector3::from(LIGHT).normalize().dot(&self.normal);
        match light {
            light if light > 0.0 => color.mix(WHITE, 0.75 * light),
            light => color.mix(INK, -0.25 * light),
        }
    }
}

/// The faces towards the viewer, the farthest first.
fn visible_faces(polygons: &[Vec<Point3<f64>>], camera: &Camera) -> Vec<Face> {
    let seen: Vec<(Vec<Point3<f64>>, Vector3<f64>)> = polygons
        .iter()
        .map(|polygon| {
            let corners: Vec<_> = polygon.iter().map(|corner| camera.see(corner)).collect();
            let normal = area(&corners).try_normalize(0.0).unwrap_or_default();
            (corners, normal)
        })
        .collect();
    // Corners are matched by their bits: neighbours share them.
    let key = |point: &Point3<f64>| [point.x, point.y, point.z].map(|c| (c + 0.0).to_bits());
    let mut sides: HashMap<_, Vec<Vector3<f64>>> = HashMap::new();
    for (corners, normal) in &seen {
        for (index, a) in corners.iter().enumerate() {
            let mut ends = [key(a), key(&corners[(index + 1) % corners.len()])];
            ends.sort_unstable();
            sides.entry(ends).or_default().push(*normal);
        }
    }
    let mut faces: Vec<Face> = seen
        .iter()
        .filter(|(_, normal)| normal.z > 1e-9)
        .map(|(corners, normal)| {
            let drawn = (0..corners.len()).map(|index| {
                let mut ends = [
                    key(&corners[index]),
                    key(&corners[(index + 1) % corners.len()]),
                ];
                ends.sort_unstable();
                let normals = &sides[&ends];
                normals.len() == 1
                    || normals
                        .iter()
                        .any(|other| other.z <= 1e-9 || other.dot(normal) < SHARP)
            });
            Face {
                drawn: drawn.collect(),
                corners: corners.clone(),
                normal: *normal,
            }
        })
        .collect();
    let depth = |face: &Face| {
        face.corners.iter().map(|corner| corner.z).sum::<f64>() / face.corners.len() as f64
    };
    faces.sort_by(|a, b| depth(a).total_cmp(&depth(b)));
    faces
}

/// Twice the area of a polygon, along its normal (Newell).
fn area(corners: &[Point3<f64>]) -> Vector3<f64> {
    let Some(first) = corners.first() else {
        return Vector3::zeros();
    };
    corners
        .windows(2)
        .map(|side| (side[0] - first).cross(&(side[1] - first)))
        .sum()
}

/// Polygons of a closed surface, turned so that they are counterclockwise seen
/// from outside.
fn outwards(polygons: impl Iterator<Item = Vec<Point3<f64>>>) -> Vec<Vec<Point3<f64>>> {
    let mut polygons: Vec<_> = polygons.filter(|polygon| polygon.len() > 2).collect();
    let volume: f64 = polygons
        .iter()
        .map(|polygon| polygon[0].coords.dot(&area(polygon)))
        .sum();
    if volume < 0.0 {
        polygons.iter_mut().for_each(|polygon| polygon.reverse());
    }
    polygons
}

fn box_faces(bounds: Bounds) -> Vec<Vec<Point3<f64>>> {
    // Indices into the corners, whose bits are the ends along x, y and z.
    const FACES: [[usize; 4]; 6] = [
        [0, 4, 6, 2],
        [1, 3, 7, 5],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 2, 3, 1],
        [4, 5, 7, 6],
    ];
    let corners = bounds.corners();
    FACES
        .iter()
        .map(|face| face.iter().map(|&corner| corners[corner]).collect())
        .collect()
}

fn cylinder_faces(p: &Point3<f64>, q: &Point3<f64>, radius: f64) -> Vec<Vec<Point3<f64>>> {
    let [first, second] = perpendicular(&(q - p));
    let rim = |center: &Point3<f64>| -> Vec<Point3<f64>> {
        (0..FACETS)
            .map(|facet| {
                let angle = std::f64::consts::TAU * facet as f64 / FACETS as f64;
                center + (first * angle.cos() + second * angle.sin()) * radius
            })
            .collect()
    };
    let [bottom, top] = [rim(p), rim(q)];
    let mut faces: Vec<Vec<Point3<f64>>> = (0..FACETS)
        .map(|facet| {
            let next = (facet + 1) % FACETS;
            vec![bottom[facet], bottom[next], top[next], top[facet]]
        })
        .collect();
    faces.push(bottom.into_iter().rev().collect());
    faces.push(top);
    faces
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::camera::View;

    fn volume(polygons: &[Vec<Point3<f64>>]) -> f64 {
        polygons
            .iter()
            .map(|polygon| polygon[0].coords.dot(&area(polygon)))
            .sum::<f64>()
            / 6.0
    }

    #[test]
    fn faces_look_outwards_and_close_the_volume() {
        let origin = Point3::origin();
        let cube = box_faces(Bounds {
            min: origin,
            max: Point3::new(1.0, 2.0, 3.0),
        });
        assert!((volume(&cube) - 6.0).abs() < 1e-12);
        let cylinder = cylinder_faces(&origin, &Point3::new(0.0, 0.0, 2.0), 1.0);
        assert!((volume(&cylinder) / (2.0 * std::f64::consts::PI) - 1.0).abs() < 0.01);
        let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]].map(Point3::from);
        for height in [2.0, -2.0] {
            let prism = prism_faces(&corners, height).unwrap();
            assert!((volume(&prism) - 1.0).abs() < 1e-12);
        }
        let inside_out = cube.iter().map(|face| face.iter().rev().copied().collect());
        assert!((volume(&outwards(inside_out)) - 6.0).abs() < 1e-12);
    }

    #[test]
    fn a_box_hides_what_is_behind_it() {
        let camera = View::Plan.camera();
        let unit = Shape::Box {
            min: Point3::new(-1.0, -1.0, -1.0),
            max: Point3::new(1.0, 1.0, 1.0),
        };
        let ball = Shape::Sphere {
            center: Point3::origin(),
            radius: 1.0,
        };
        for shape in [unit, ball] {
            let solid = Solid::new(&shape, &Isometry3::identity(), INK, &camera).unwrap();
            assert!(solid.hides(&Point3::new(0.1, 0.0, -2.0)));
            assert!(!solid.hides(&Point3::new(0.1, 0.0, 2.0)));
            assert!(!solid.hides(&Point3::new(1.5, 0.0, -2.0)));
        }
    }
}
