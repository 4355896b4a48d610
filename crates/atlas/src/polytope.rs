//! Bounded convex polytopes with explicit vertices, in any dimension k.
//!
//! A polytope starts as a cube about the origin and is cut by half-spaces, one
//! after the other (double description: vertices on the wrong side go, and each
//! edge that the plane crosses gives a new one). Every vertex knows the facets
//! it lies on, which tells edges: two vertices are joined when no third one lies
//! on all the facets they share. Cost of a cut: one inner product for each vertex,
//! and for each pair of a vertex kept and one removed a look at the others; there
//! are a handful of vertices for k = 2, some dozens for k = 3.

use crate::{atlas::squared_distance, qr::dot};

/// A half-space tᵀ normal ≤ offset that bounds a polytope.
#[derive(Clone, Debug, PartialEq)]
pub struct Facet {
    /// Outward normal, of any length.
    pub normal: Vec<f64>,
    /// Largest inner product with the normal.
    pub offset: f64,
    /// What lies beyond; none for the sides of the first cube.
    pub neighbour: Option<usize>,
}

/// A corner of a polytope.
#[derive(Clone, Debug, PartialEq)]
pub struct Vertex {
    /// Its coordinates.
    pub point: Vec<f64>,
    /// The facets that meet in it, in ascending order.
    pub facets: Vec<u32>,
    /// Whether nothing is left to explore beyond it.
    pub(crate) closed: bool,
}

/// A bounded convex polytope that holds the origin.
///
/// # Examples
/// ```
/// use tensegra_atlas::Polytope;
/// let mut square = Polytope::cube(2, 1.0);
/// square.cut(&[1.0, 1.0], 1.0, 7);
/// assert_eq!(square.vertices().len(), 5);
/// assert_eq!(square.neighbours().collect::<Vec<_>>(), [7]);
/// assert!(square.contains(&[0.5, 0.5], 1e-12) && !square.contains(&[0.6, 0.5], 1e-12));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Polytope {
    dimension: usize,
    facets: Vec<Facet>,
    vertices: Vec<Vertex>,
}

impl Polytope {
    /// The cube [−half, half]ᵏ.
    pub fn cube(dimension: usize, half: f64) -> Self {
        let facets = (0..2 * dimension)
            .map(|f| {
                let mut normal = vec![0.0; dimension];
                normal[f / 2] = if f % 2 == 0 { -1.0 } else { 1.0 };
                Facet {
                    normal,
                    offset: half,
                    neighbour: None,
                }
            })
            .collect();
        let vertices = (0..1_usize << dimension)
            .map(|corner| {
                let upper = |axis: usize| corner >> axis & 1;
                Vertex {
                    point: (0..dimension)
                        .map(|axis| if upper(axis) == 1 { half } else { -half })
                        .collect(),
                    facets: (0..dimension)
                        .map(|axis| (2 * axis + upper(axis)) as u32)
                        .collect(),
                    closed: false,
                }
            })
            .collect();
        Self {
            dimension,
            facets,
            vertices,
        }
    }

    /// Dimension k of the space.
    pub fn dimension(&self) -> usize {
        self.dimension
    }

    /// The facets, among them some that no longer bound anything.
    pub fn facets(&self) -> &[Facet] {
        &self.facets
    }

    /// The corners.
    pub fn vertices(&self) -> &[Vertex] {
        &self.vertices
    }

    pub(crate) fn close(&mut self, vertex: usize) {
        self.vertices[vertex].closed = true;
    }

    /// Closes the vertices that another polytope has, too, closed and joined to the
    /// same ones, within a distance.
    pub(crate) fn keep_closed(&mut self, other: &Self, distance: f64) {
        let same = |vertex: usize| {
            let point = &self.vertices[vertex].point;
            let near = |v: &&Vertex| squared_distance(&v.point, point) <= distance * distance;
            other.vertices.iter().find(near)
        };
        let known: Vec<usize> = (0..self.vertices.len())
            .filter(|&v| {
                same(v).is_some_and(|v| v.closed)
                    && self.adjacent(v).all(|joined| same(joined).is_some())
            })
            .collect();
        known.into_iter().for_each(|v| self.close(v));
    }

    /// Whether a vertex lies on a side of the cube that the polytope began as.
    pub(crate) fn is_on_cube(&self, vertex: &Vertex) -> bool {
        vertex
            .facets
            .first()
            .is_some_and(|&f| (f as usize) < 2 * self.dimension)
    }

    /// What lies beyond the facets that bound the polytope, in ascending order.
    pub fn neighbours(&self) -> impl Iterator<Item = usize> {
        let mut bounding: Vec<usize> = self
            .vertices
            .iter()
            .flat_map(|vertex| &vertex.facets)
            .filter_map(|&f| self.facets[f as usize].neighbour)
            .collect();
        bounding.sort_unstable();
        bounding.dedup();
        bounding.into_iter()
    }

    /// Whether a point lies inside, or outside by no more than `tolerance`.
    pub fn contains(&self, t: &[f64], tolerance: f64) -> bool {
        self.facets.iter().all(|facet| {
            let scale = dot(&facet.normal, &facet.normal).sqrt();
            dot(&facet.normal, t) <= facet.offset + tolerance * scale
        })
    }

    /// How far a ray from the origin stays inside: the largest λ for which
    /// λ `direction` does.
    pub fn reach(&self, direction: &[f64]) -> f64 {
        self.facets
            .iter()
            .filter_map(|facet| {
                let slope = dot(&facet.normal, direction);
                (slope > 0.0).then(|| facet.offset / slope)
            })
            .fold(f64::INFINITY, f64::min)
    }

    /// Cuts off what lies beyond tᵀ `normal` = `offset`, with `offset` > 0.
    /// Returns whether anything was cut off.
    pub fn cut(&mut self, normal: &[f64], offset: f64, neighbour: usize) -> bool {
        let tolerance = 1e-12 * offset.abs().max(f64::MIN_POSITIVE);
        let sides: Vec<f64> = self
            .vertices
            .iter()
            .map(|vertex| dot(normal, &vertex.point) - offset)
            .collect();
        if sides.iter().all(|&side| side <= tolerance) {
            return false;
        }
        let new = self.facets.len() as u32;
        let mut corners = Vec::new();
        for (kept, &inside) in sides.iter().enumerate().filter(|(_, s)| **s < -tolerance) {
            for (removed, &outside) in sides.iter().enumerate().filter(|(_, s)| **s > tolerance) {
                let Some(mut facets) = self.edge(kept, removed) else {
                    continue;
                };
                let share = inside / (inside - outside);
                let (inner, outer) = (&self.vertices[kept], &self.vertices[removed]);
                let (a, b) = (&inner.point, &outer.point);
                facets.push(new);
                corners.push(Vertex {
                    point: a.iter().zip(b).map(|(a, b)| a + share * (b - a)).collect(),
                    facets,
                    // What lies beyond it lay beyond one of the two.
                    closed: inner.closed && outer.closed,
                });
            }
        }
        let mut side = sides.iter();
        self.vertices.retain_mut(|vertex| {
            let side = *side.next().unwrap_or(&0.0);
            if side.abs() <= tolerance {
                vertex.facets.push(new);
            }
            side <= tolerance
        });
        self.vertices.append(&mut corners);
        self.facets.push(Facet {
            normal: normal.to_vec(),
            offset,
            neighbour: Some(neighbour),
        });
        true
    }

    /// The facets that share the edge between two vertices; none where they are
    /// not joined by an edge.
    fn edge(&self, a: usize, b: usize) -> Option<Vec<u32>> {
        let common: Vec<u32> = self.vertices[a]
            .facets
            .iter()
            .copied()
            .filter(|f| self.vertices[b].facets.binary_search(f).is_ok())
            .collect();
        if common.len() + 1 < self.dimension {
            return None;
        }
        let holds_all = |vertex: &Vertex| {
            common
                .iter()
                .all(|f| vertex.facets.binary_search(f).is_ok())
        };
        let third = |(i, vertex): (usize, &Vertex)| i != a && i != b && holds_all(vertex);
        (!self.vertices.iter().enumerate().any(third)).then_some(common)
    }

    /// The vertices that are joined to one of them by an edge.
    pub fn adjacent(&self, vertex: usize) -> impl Iterator<Item = usize> + '_ {
        (0..self.vertices.len())
            .filter(move |&other| other != vertex && self.edge(vertex, other).is_some())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Volume of a polytope in the plane or in space, by cones over its facets.
    fn volume(polytope: &Polytope) -> f64 {
        let points = |f: u32| -> Vec<&Vertex> {
            let on = |v: &&Vertex| v.facets.contains(&f);
            polytope.vertices().iter().filter(on).collect()
        };
        (0..polytope.facets().len() as u32)
            .map(|f| {
                let facet = &polytope.facets()[f as usize];
                let corners = points(f);
                if corners.len() < polytope.dimension() {
                    return 0.0;
                }
                let height = facet.offset / dot(&facet.normal, &facet.normal).sqrt();
                let middle: Vec<f64> = (0..polytope.dimension())
                    .map(|i| corners.iter().map(|c| c.point[i]).sum::<f64>() / corners.len() as f64)
                    .collect();
                let area: f64 = match polytope.dimension() {
                    2 => distance(&corners[0].point, &corners[1].point),
                    _ => {
                        // Each edge of the facet makes a triangle with its middle.
                        let mut area = 0.0;
                        for (i, a) in corners.iter().enumerate() {
                            for b in &corners[i + 1..] {
                                let shared =
                                    a.facets.iter().filter(|f| b.facets.contains(f)).count();
                                if shared >= 2 {
                                    area += triangle(&a.point, &b.point, &middle);
                                }
                            }
                        }
                        area
                    }
                };
                area * height / polytope.dimension() as f64
            })
            .sum()
    }

    fn distance(a: &[f64], b: &[f64]) -> f64 {
        a.iter()
            .zip(b)
            .map(|(a, b)| (a - b) * (a - b))
            .sum::<f64>()
            .sqrt()
    }

    fn triangle(a: &[f64], b: &[f64], c: &[f64]) -> f64 {
        let (x, y, z) = (distance(a, b), distance(b, c), distance(c, a));
        let s = 0.5 * (x + y + z);
        (s * (s - x) * (s - y) * (s - z)).max(0.0).sqrt()
    }

    #[test]
    fn cuts_take_away_what_they_should_in_one_to_three_dimensions() {
        let mut interval = Polytope::cube(1, 1.0);
        assert!(interval.cut(&[2.0], 1.0, 0) && !interval.cut(&[1.0], 0.7, 1));
        let mut ends: Vec<f64> = interval.vertices().iter().map(|v| v.point[0]).collect();
        ends.sort_by(f64::total_cmp);
        assert_eq!(ends, [-1.0, 0.5]);

        let mut square = Polytope::cube(2, 1.0);
        assert!((volume(&square) - 4.0).abs() < 1e-14);
        // A corner triangle with legs of one half.
        square.cut(&[1.0, 1.0], 1.5, 0);
        assert!((volume(&square) - 3.875).abs() < 1e-14);
        assert_eq!(square.vertices().len(), 5);

        let mut cube = Polytope::cube(3, 1.0);
        assert!((volume(&cube) - 8.0).abs() < 1e-13);
        // The corner tetrahedron with legs of one: volume 1/6.
        cube.cut(&[1.0, 1.0, 1.0], 2.0, 0);
        assert!((volume(&cube) - (8.0 - 1.0 / 6.0)).abs() < 1e-13);
        assert_eq!(cube.vertices().len(), 10);
        assert!(
            cube.vertices()
                .iter()
                .enumerate()
                .all(|(i, _)| cube.adjacent(i).count() == 3)
        );
    }

    #[test]
    fn degenerate_cuts_through_vertices_keep_the_combinatorics() {
        // Cutting the eight corners of the cube at the middles of its edges
        // gives the cuboctahedron: 12 vertices of degree 4, volume 8·5/6.
        let mut cube = Polytope::cube(3, 1.0);
        for corner in 0..8 {
            let normal = [0, 1, 2].map(|i| if corner >> i & 1 == 1 { 1.0 } else { -1.0 });
            cube.cut(&normal, 2.0, corner);
        }
        assert_eq!(cube.vertices().len(), 12);
        assert!((0..12).all(|i| cube.adjacent(i).count() == 4));
        assert!((volume(&cube) - 8.0 * 5.0 / 6.0).abs() < 1e-13);
        assert_eq!(cube.neighbours().count(), 8);
        assert!((cube.reach(&[1.0, 1.0, 1.0]) - 2.0 / 3.0).abs() < 1e-15);
    }
}
