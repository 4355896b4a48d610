//! From a list of polygons to a closed, outward-oriented surface of triangles.
//!
//! Vertices with equal coordinates are joined, polygons split, faces that are listed twice dropped, and neighbours
//! turned the same way round. Linear in the number of faces.

use std::collections::{HashMap, HashSet};

use nalgebra::Point3;

use super::polygon::triangulate;
use crate::{MeshError, weld::weld};

/// A closed, oriented surface: every edge belongs to two triangles that run along it in opposite directions.
pub(crate) struct Surface {
    pub vertices: Vec<Point3<f64>>,
    pub triangles: Vec<[usize; 3]>,
    /// Which triangle runs along each edge, by its ends in order.
    pub sides: HashMap<(usize, usize), usize>,
}

impl Surface {
    pub fn new<F: AsRef<[usize]>>(given: &[Point3<f64>], faces: &[F]) -> Result<Self, MeshError> {
        if given.len() < 4 || faces.len() < 4 {
            return Err(MeshError::TooSmall {
                vertices: given.len(),
                faces: faces.len(),
            });
        }
        for (vertex, p) in given.iter().enumerate() {
            if let Some(&value) = p.iter().find(|x| !x.is_finite()) {
                return Err(MeshError::NotFinite { vertex, value });
            }
        }
        let (vertices, welded) = weld(given);
        // For messages: the first given vertex at each place.
        let mut name = vec![usize::MAX; vertices.len()];
        for (index, &w) in welded.iter().enumerate().rev() {
            name[w] = index;
        }

        let mut triangles: Vec<[usize; 3]> = Vec::new();
        let mut face_of: Vec<usize> = Vec::new();
        let mut known = HashSet::new();
        for (face, corners) in faces.iter().enumerate() {
            let mut ring = Vec::with_capacity(corners.as_ref().len());
            for &index in corners.as_ref() {
                let &vertex = welded.get(index).ok_or(MeshError::NoSuchVertex {
                    face,
                    index,
                    vertices: given.len(),
                })?;
                ring.push(vertex);
            }
            ring.dedup();
            if ring.len() > 1 && ring.first() == ring.last() {
                ring.pop();
            }
            if ring.len() < 3 {
                return Err(MeshError::FaceTooSmall { face });
            }
            let corners: Vec<_> = ring.iter().map(|&v| vertices[v]).collect();
            for t in triangulate(&corners).ok_or(MeshError::BadFace { face })? {
                let triangle = t.map(|i| ring[i]);
                let mut key = triangle;
                key.sort_unstable();
                if known.insert(key) {
                    triangles.push(triangle);
                    face_of.push(face);
                }
            }
        }

        orient(&vertices, &mut triangles, &face_of, &name)?;
        let volume = signed_volume(&vertices, &triangles);
        let size = extent(&vertices);
        if volume.abs() <= 1e-12 * size.powi(3) {
            return Err(MeshError::NoVolume);
        }
        if volume < 0.0 {
            triangles.iter_mut().for_each(|t| t.swap(1, 2));
        }
        let sides = sides(&triangles);
        Ok(Self {
            vertices,
            triangles,
            sides,
        })
    }
}

fn sides(triangles: &[[usize; 3]]) -> HashMap<(usize, usize), usize> {
    let mut sides = HashMap::with_capacity(3 * triangles.len());
    for (i, t) in triangles.iter().enumerate() {
        for k in 0..3 {
            sides.insert((t[k], t[(k + 1) % 3]), i);
        }
    }
    sides
}

/// Turns the triangles of each connected part the same way round. A part that comes consistently oriented is kept
/// as it is (it may bound a cavity), one that does not is turned outward.
fn orient(
    vertices: &[Point3<f64>],
    triangles: &mut [[usize; 3]],
    face_of: &[usize],
    name: &[usize],
) -> Result<(), MeshError> {
    let mut around: HashMap<(usize, usize), Vec<usize>> = HashMap::new();
    for (i, t) in triangles.iter().enumerate() {
        for k in 0..3 {
            let (p, q) = (t[k], t[(k + 1) % 3]);
            around.entry((p.min(q), p.max(q))).or_default().push(i);
        }
    }
    // The first edge in the order of the faces, so that the message does not depend on the order of a hash table.
    for t in triangles.iter() {
        for k in 0..3 {
            let (p, q) = (t[k], t[(k + 1) % 3]);
            let faces = around[&(p.min(q), p.max(q))].len();
            if faces != 2 {
                return Err(MeshError::OpenEdge {
                    a: name[p],
                    b: name[q],
                    faces,
                });
            }
        }
    }
    let mut seen = vec![false; triangles.len()];
    for start in 0..triangles.len() {
        if seen[start] {
            continue;
        }
        seen[start] = true;
        let mut part = vec![start];
        let mut turned = false;
        let mut next = 0;
        while let Some(&i) = part.get(next) {
            next += 1;
            let t = triangles[i];
            for k in 0..3 {
                let (p, q) = (t[k], t[(k + 1) % 3]);
                for &other in &around[&(p.min(q), p.max(q))] {
                    if other == i {
                        continue;
                    }
                    let o = triangles[other];
                    let same_way = (0..3).any(|m| (o[m], o[(m + 1) % 3]) == (p, q));
                    if same_way && seen[other] {
                        return Err(MeshError::NotOrientable {
                            face: face_of[other],
                        });
                    }
                    if same_way {
                        triangles[other].swap(1, 2);
                        turned = true;
                    }
                    if !seen[other] {
                        seen[other] = true;
                        part.push(other);
                    }
                }
            }
        }
        let volume: f64 = part
            .iter()
            .map(|&i| signed_volume(vertices, &[triangles[i]]))
            .sum();
        if turned && volume < 0.0 {
            for i in part {
                triangles[i].swap(1, 2);
            }
        }
    }
    Ok(())
}

/// Volume inside, positive for a surface oriented outward; taken about a vertex to keep digits far from the origin.
fn signed_volume(vertices: &[Point3<f64>], triangles: &[[usize; 3]]) -> f64 {
    let origin = vertices[0];
    triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|i| vertices[i] - origin);
            a.dot(&b.cross(&c)) / 6.0
        })
        .sum()
}

fn extent(vertices: &[Point3<f64>]) -> f64 {
    vertices
        .iter()
        .map(|p| (p - vertices[0]).norm())
        .fold(0.0, f64::max)
}
