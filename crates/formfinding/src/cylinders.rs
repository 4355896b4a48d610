//! Pairs of bars as cylinders without ends.
//!
//! S. Hernández Juan and J. M. Mirats Tur, "A method to generate stable, collision free
//! configurations for tensegrity based robots", IROS 2008, eq. (5), with the squares that are
//! missing there: for the lines P₀ + s u and Q₀ + t v, with w₀ = P₀ − Q₀, a = u·u, b = u·v,
//! c = v·v, d = u·w₀, e = v·w₀ and Δ = ac − b²,
//!
//! ```text
//! |w₀ Δ + (be − cd) u − (ae − bd) v|² − Δ² (r_p + r_q)² ≥ 0.
//! ```
//!
//! The vector on the left is the component of w₀ Δ along n = u × v, and Δ = |n|², so that the
//! left-hand side is Δ ((w₀·n)² − Δ (r_p + r_q)²): this is what is evaluated. It is 0 for parallel
//! lines, of which it says nothing.

use nalgebra::{Point3, Vector3};
use tensegra_model::{Body, ElementKind, Structure};

/// Whether an element is one that the paper takes for a cylinder.
fn are_cylinders(kind: ElementKind) -> bool {
    matches!(
        kind,
        ElementKind::Strut | ElementKind::Bar | ElementKind::Prismatic
    )
}

/// A pair of bars.
#[derive(Clone, Debug)]
pub(crate) struct Cylinders {
    pub(crate) elements: [usize; 2],
    nodes: [[usize; 2]; 2],
    /// Sum of the radii, and the clearance.
    reach: f64,
    /// Makes the constraint a number of the order of the distance over the structure's size.
    scale: f64,
}

impl Cylinders {
    /// The pair, if both bodies are bars.
    pub(crate) fn of(
        structure: &Structure,
        bodies: [Body; 2],
        clearance: f64,
        size: f64,
    ) -> Option<Self> {
        let [Body::Element(a), Body::Element(b)] = bodies else {
            return None;
        };
        let elements = [a, b].map(|e| &structure.elements[e]);
        if !elements.iter().all(|element| are_cylinders(element.kind)) {
            return None;
        }
        let reach = elements[0].radius + elements[1].radius + clearance;
        Some(Self {
            elements: [a, b],
            nodes: elements.map(|element| element.nodes),
            reach,
            scale: 1.0 / (size.powi(9) * 2.0 * reach.max(1e-3 * size)),
        })
    }

    fn vectors(&self, positions: &[Point3<f64>]) -> [Vector3<f64>; 3] {
        let [[p0, p1], [q0, q1]] = self.nodes;
        [
            positions[p1] - positions[p0],
            positions[q1] - positions[q0],
            positions[p0] - positions[q0],
        ]
    }

    pub(crate) fn value(&self, positions: &[Point3<f64>]) -> f64 {
        let [u, v, w] = self.vectors(positions);
        let n = u.cross(&v);
        let (delta, along) = (n.norm_squared(), w.dot(&n));
        self.scale * delta * (along * along - delta * self.reach * self.reach)
    }

    /// Appends the gradients with respect to node positions.
    pub(crate) fn gradient(
        &self,
        positions: &[Point3<f64>],
        gradients: &mut Vec<(usize, Vector3<f64>)>,
    ) {
        let [u, v, w] = self.vectors(positions);
        let n = u.cross(&v);
        let (delta, along) = (n.norm_squared(), w.dot(&n));
        let square = self.reach * self.reach;
        let by_along = 2.0 * delta * along * self.scale;
        let by_n = n * (2.0 * self.scale * (along * along - 2.0 * delta * square)) + w * by_along;
        let (by_u, by_v, by_w) = (v.cross(&by_n), by_n.cross(&u), n * by_along);
        let [[p0, p1], [q0, q1]] = self.nodes;
        gradients.extend([
            (p0, by_w - by_u),
            (p1, by_u),
            (q0, -by_w - by_v),
            (q1, by_v),
        ]);
    }
}
