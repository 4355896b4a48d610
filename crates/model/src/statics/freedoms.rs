//! Which coordinates can move, and how the whole moves as one body.

use nalgebra::{DMatrix, Matrix6, Point3, Vector3, Vector6};

use super::basis::span;
use crate::structure::Structure;

/// A rigid motion slower than this at every node that has to rest counts as
/// resting there; sizes are scaled to one.
const AT_REST: f64 = 1e-9;

/// The coordinates that can move, numbered: by node, then by axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Freedoms {
    dimension: usize,
    /// Node and axis of each freedom.
    coordinates: Vec<[usize; 2]>,
    /// Number of the freedom, by node and axis.
    index: Vec<[Option<usize>; 3]>,
    /// Whether a force can reach the node.
    loaded: Vec<bool>,
}

impl Freedoms {
    /// The coordinates of the nodes at which forces have to balance.
    pub fn new(structure: &Structure) -> Self {
        Self::with(structure, |node, _| structure.nodes[node].balanced)
    }

    /// The coordinates (node, axis) that `is_free` admits, of nodes that a force
    /// reaches.
    pub fn with(structure: &Structure, is_free: impl Fn(usize, usize) -> bool) -> Self {
        let mut loaded = vec![false; structure.nodes.len()];
        for element in &structure.elements {
            if element.carries_force() {
                element.nodes.iter().for_each(|&node| loaded[node] = true);
            }
        }
        let mut coordinates = Vec::new();
        let mut index = vec![[None; 3]; structure.nodes.len()];
        for (node, axes) in index
            .iter_mut()
            .enumerate()
            .filter(|(node, _)| loaded[*node])
        {
            for (axis, number) in axes.iter_mut().enumerate().take(structure.dimension) {
                if is_free(node, axis) {
                    *number = Some(coordinates.len());
                    coordinates.push([node, axis]);
                }
            }
        }
        Self {
            dimension: structure.dimension,
            coordinates,
            index,
            loaded,
        }
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.coordinates.len()
    }

    /// Whether nothing can move.
    pub fn is_empty(&self) -> bool {
        self.coordinates.is_empty()
    }

    /// Node and axis of each freedom.
    pub fn coordinates(&self) -> &[[usize; 2]] {
        &self.coordinates
    }

    /// Number of the freedom of a node along an axis.
    pub fn index(&self, node: usize, axis: usize) -> Option<usize> {
        self.index[node][axis]
    }

    /// Whether a force can reach the node.
    pub fn is_loaded(&self, node: usize) -> bool {
        self.loaded[node]
    }

    /// The displacement of every node in the motion `motion` of the freedoms.
    pub fn displacements(&self, motion: &[f64]) -> Vec<Vector3<f64>> {
        let mut displacements = vec![Vector3::zeros(); self.index.len()];
        for (&[node, axis], &value) in self.coordinates.iter().zip(motion) {
            displacements[node][axis] = value;
        }
        displacements
    }

    /// Adds `scale · (v(b) − v(a)) · direction`, as a function of the velocities v
    /// of the freedoms, to `row`.
    pub(super) fn add_relative(
        &self,
        row: &mut [f64],
        [a, b]: [usize; 2],
        direction: Vector3<f64>,
        scale: f64,
    ) {
        for axis in 0..self.dimension {
            if let Some(i) = self.index[b][axis] {
                row[i] += scale * direction[axis];
            }
            if let Some(i) = self.index[a][axis] {
                row[i] -= scale * direction[axis];
            }
        }
    }

    /// Orthonormal rigid motions that leave what cannot move at rest: columns over
    /// the freedoms. Of nodes in one line, the rotation about it moves none and
    /// does not count.
    ///
    /// # Panics
    /// If there is not one position for each node.
    pub fn rigid_motions(&self, positions: &[Point3<f64>]) -> DMatrix<f64> {
        self.motions(positions, |_| 0.0)
    }

    /// Orthonormal rigid motions along which neither the elastic energy nor the
    /// work of the constant loads changes: those of [`rigid_motions`](Self::rigid_motions)
    /// that turn about the direction of every load.
    ///
    /// # Panics
    /// If there is not one position for each node.
    pub fn neutral_motions(
        &self,
        structure: &Structure,
        positions: &[Point3<f64>],
    ) -> DMatrix<f64> {
        let strongest = structure
            .nodes
            .iter()
            .map(|node| node.load.norm())
            .fold(0.0, f64::max);
        let loads: Vec<Vector3<f64>> = structure
            .nodes
            .iter()
            .map(|node| node.load / strongest)
            .filter(|load| load.norm() > AT_REST)
            .collect();
        // A rotation changes the directions in which loads work unless it is about them.
        self.motions(positions, |rotation| {
            let turned = loads.iter().map(|load| rotation.cross(load).norm_squared());
            turned.sum()
        })
    }

    /// Rigid motions of which neither the velocity of held coordinates nor
    /// `forbidden`, a quadratic form of the rotation, is above zero.
    fn motions(
        &self,
        positions: &[Point3<f64>],
        forbidden: impl Fn(Vector3<f64>) -> f64,
    ) -> DMatrix<f64> {
        assert_eq!(positions.len(), self.index.len(), "one position a node");
        let loaded = || (0..positions.len()).filter(|&node| self.loaded[node]);
        let count = loaded().count().max(1) as f64;
        let center = loaded()
            .map(|node| positions[node].coords)
            .sum::<Vector3<f64>>()
            / count;
        let arm = |node: usize| positions[node].coords - center;
        let reach = loaded()
            .map(|node| arm(node).norm())
            .fold(f64::MIN_POSITIVE, f64::max);
        // Translations, then rotations about the centre, of size one.
        let velocity = |node: usize, mode: usize| {
            let unit = Vector3::ith(mode % 3, 1.0);
            match mode {
                0..3 => unit,
                _ => unit.cross(&(arm(node) / reach)),
            }
        };
        let mut form = Matrix6::<f64>::zeros();
        for node in loaded() {
            for axis in (0..self.dimension).filter(|&axis| self.index[node][axis].is_none()) {
                let at_axis = Vector6::from_fn(|mode, _| velocity(node, mode)[axis]);
                form += at_axis * at_axis.transpose();
            }
        }
        if self.dimension == 2 {
            [2, 3, 4]
                .into_iter()
                .for_each(|mode| form[(mode, mode)] += 1.0);
        }
        // The form of the rotation, by polarisation.
        let unit = |mode: usize| Vector3::ith(mode, 1.0);
        for i in 0..3 {
            for j in 0..3 {
                let mixed = forbidden(unit(i) + unit(j)) - forbidden(unit(i)) - forbidden(unit(j));
                form[(3 + i, 3 + j)] += mixed / 2.0;
            }
        }
        let eigen = form.symmetric_eigen();
        let free: Vec<usize> = (0..6)
            .filter(|&mode| eigen.eigenvalues[mode] < AT_REST)
            .collect();
        let columns = DMatrix::from_fn(self.len(), free.len(), |i, j| {
            let [node, axis] = self.coordinates[i];
            let motion = eigen.eigenvectors.column(free[j]);
            (0..6)
                .map(|mode| motion[mode] * velocity(node, mode)[axis])
                .sum()
        });
        span(columns, 1e-7)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::StructureBuilder;

    fn triangle(supports: usize) -> (Structure, Vec<Point3<f64>>) {
        let mut builder = StructureBuilder::spatial();
        for (name, nodes) in [("x", ["a", "b"]), ("y", ["b", "c"]), ("z", ["c", "a"])] {
            builder = builder.bar(name, nodes, 1.0);
        }
        for node in ["a", "b", "c"].into_iter().take(supports) {
            builder = builder.support(node);
        }
        let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.5, 0.8, 0.0]];
        (
            builder.build().unwrap(),
            positions.map(Point3::from).to_vec(),
        )
    }

    #[test]
    fn supports_take_rigid_motions_away() {
        for (supports, motions) in [(0, 6), (1, 3), (2, 1), (3, 0)] {
            let (structure, positions) = triangle(supports);
            let freedoms = Freedoms::new(&structure);
            assert_eq!(freedoms.len(), 9 - 3 * supports);
            let rigid = freedoms.rigid_motions(&positions);
            assert_eq!(rigid.ncols(), motions, "{supports} supports");
        }
    }

    #[test]
    fn a_line_has_no_rotation_about_itself() {
        let structure = StructureBuilder::spatial()
            .bar("x", ["a", "b"], 1.0)
            .build()
            .unwrap();
        let positions = [Point3::new(0.1, 0.2, 0.3), Point3::new(0.4, 1.2, 0.8)];
        let rigid = Freedoms::new(&structure).rigid_motions(&positions);
        assert_eq!(rigid.ncols(), 5);
    }

    #[test]
    fn loads_leave_the_rotation_about_them() {
        let (mut structure, positions) = triangle(1);
        let free = |structure: &Structure| {
            Freedoms::new(structure)
                .neutral_motions(structure, &positions)
                .ncols()
        };
        assert_eq!(free(&structure), 3);
        structure.nodes[1].load = Vector3::new(0.0, 0.0, -2.0);
        structure.nodes[2].load = Vector3::new(0.0, 0.0, -1.0);
        assert_eq!(free(&structure), 1);
        structure.nodes[2].load = Vector3::new(0.0, 1.0, -1.0);
        assert_eq!(free(&structure), 0);
    }
}
