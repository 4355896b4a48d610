//! The least tangent stiffness: whether an equilibrium is a minimum of the elastic energy while
//! the motors hold their rest lengths.
//!
//! The tangent stiffness of an element with vector d, length l and direction u is
//! k u uᵀ + (f / l) (I − u uᵀ), the first term for elastic elements that are not slack. It is
//! restricted to the displacements that keep supports, elements without a law (their motors hold
//! lengths), attachments and coupled orientations, and that contain no rigid motion but those that
//! loads resist: such as turn a load. Nodes that no force reaches are left out. Its smallest
//! eigenvalue there is the answer (Guest, 2006, "The stiffness of prestressed frameworks").
//! Constraints are orthonormalised by
//! Gram–Schmidt; those that depend on others drop out. Constraint directions get a large
//! stiffness instead of being removed. Cost for n coordinates: about 4 n³ / 3 for the eigenvalues.

use nalgebra::{DMatrix, DVector, Matrix3, Matrix6, Point3, Vector3, Vector6};
use tensegra_model::{Configuration, Coupling, Element, ForceLaw, Structure};

use crate::statics::axis;

/// A constraint shorter than this after orthogonalisation depends on the others.
const DEPENDENT: f64 = 1e-9;

/// Most coordinates of a structure for which eigenvalues count as cheap: a millisecond or two.
const CHEAP: usize = 100;

pub(crate) struct Stability<'a> {
    structure: &'a Structure,
    /// Whether a force reaches the node.
    reached: Vec<bool>,
    /// Orthonormal directions in which no admissible displacement goes.
    constraints: Vec<DVector<f64>>,
    row: DVector<f64>,
    stiffness: DMatrix<f64>,
}

impl<'a> Stability<'a> {
    pub(crate) fn new(structure: &'a Structure) -> Self {
        let n = structure.nodes.len() * structure.dimension;
        let mut reached = vec![false; structure.nodes.len()];
        for element in structure.elements.iter().filter(|e| e.carries_force()) {
            element.nodes.iter().for_each(|&node| reached[node] = true);
        }
        Self {
            structure,
            reached,
            constraints: Vec::new(),
            row: DVector::zeros(n),
            stiffness: DMatrix::zeros(n, n),
        }
    }

    pub(crate) fn is_cheap(&self) -> bool {
        self.row.len() <= CHEAP
    }

    /// The smallest eigenvalue of the tangent stiffness on admissible displacements, in force per
    /// length; `None` where there are none, or an element has no length.
    pub(crate) fn least_stiffness(&mut self, configuration: &Configuration) -> Option<f64> {
        self.assemble(configuration)?;
        self.constrain(configuration);
        let n = self.row.len();
        if self.constraints.len() >= n {
            return None;
        }
        // S ← (I − C Cᵀ) S (I − C Cᵀ) + h C Cᵀ, with h above every eigenvalue of S: its norm.
        let above = 1.0 + self.stiffness.norm();
        for constraint in &self.constraints {
            let image = &self.stiffness * constraint;
            let along = constraint.dot(&image);
            self.stiffness.ger(-1.0, constraint, &image, 1.0);
            self.stiffness.ger(-1.0, &image, constraint, 1.0);
            self.stiffness
                .ger(along + 2.0 * above, constraint, constraint, 1.0);
        }
        let least = self.stiffness.symmetric_eigenvalues().min();
        least.is_finite().then_some(least)
    }

    fn assemble(&mut self, configuration: &Configuration) -> Option<()> {
        let dimension = self.structure.dimension;
        self.stiffness.fill(0.0);
        for (index, element) in self.structure.elements.iter().enumerate() {
            let Some(force) = configuration.forces[index] else {
                continue;
            };
            let vector = axis(self.structure, &configuration.positions, index);
            let length = vector.norm();
            if length == 0.0 {
                return None;
            }
            let outer = vector * vector.transpose() / (length * length);
            let elastic = match element.law {
                ForceLaw::Linear { .. } if element.pulls_only() && force <= 0.0 => 0.0,
                ForceLaw::Linear { stiffness, .. } => stiffness,
                ForceLaw::None | ForceLaw::Free => 0.0,
            };
            let block = outer * elastic + (Matrix3::identity() - outer) * (force / length);
            let [a, b] = element.nodes.map(|node| node * dimension);
            for i in 0..dimension {
                for j in 0..dimension {
                    self.stiffness[(a + i, a + j)] += block[(i, j)];
                    self.stiffness[(b + i, b + j)] += block[(i, j)];
                    self.stiffness[(a + i, b + j)] -= block[(i, j)];
                    self.stiffness[(b + i, a + j)] -= block[(i, j)];
                }
            }
        }
        Some(())
    }

    fn constrain(&mut self, configuration: &Configuration) {
        let structure = self.structure;
        let dimension = structure.dimension;
        let positions = &configuration.positions;
        self.constraints.clear();
        for (node, _) in structure
            .nodes
            .iter()
            .enumerate()
            .filter(|(index, node)| !node.balanced || !self.reached[*index])
            .collect::<Vec<_>>()
        {
            for axis in 0..dimension {
                self.row[node * dimension + axis] = 1.0;
                self.enter();
            }
        }
        self.forbid_rigid_motions(configuration);
        let held =
            |element: &&Element| element.has_constant_length() || element.law == ForceLaw::Free;
        for element in structure.elements.iter().filter(held) {
            self.keep(positions, &[(element.nodes, None)]);
        }
        for attachment in &structure.attachments {
            let [a, b, c] = attachment.anchors.map(|anchor| anchor.node);
            for nodes in [[a, b], [b, c], [c, a]] {
                self.keep(positions, &[(nodes, None)]);
            }
        }
        for coupling in &structure.couplings {
            let Coupling::Orientation {
                reference,
                followers,
            } = coupling
            else {
                continue;
            };
            for (follower, rotation) in followers {
                for axis in 0..dimension {
                    // Rate of u(reference) − R u(follower) along one axis.
                    let unit = Vector3::from_fn(|i, _| f64::from(u8::from(i == axis)));
                    let [first, second] =
                        [reference, follower].map(|e| structure.elements[*e].nodes);
                    let back = -(rotation.inverse() * unit);
                    self.keep(positions, &[(first, Some(unit)), (second, Some(back))]);
                }
            }
        }
    }

    /// Forbids what changes the sum of rates; a node that no force reaches follows the others.
    fn keep(&mut self, positions: &[Point3<f64>], rates: &[([usize; 2], Option<Vector3<f64>>)]) {
        let nodes = || rates.iter().flat_map(|(nodes, _)| nodes);
        if nodes().all(|&node| self.reached[node]) {
            for &(nodes, turn) in rates {
                self.along(positions, nodes, turn);
            }
            self.enter();
        }
    }

    /// Adds to the row the rate of the distance of two nodes, or of the direction between them in
    /// the direction of `turn`.
    fn along(&mut self, positions: &[Point3<f64>], [a, b]: [usize; 2], turn: Option<Vector3<f64>>) {
        let vector = positions[b] - positions[a];
        let length = vector.norm();
        if length == 0.0 {
            return;
        }
        let direction = vector / length;
        let rate = match turn {
            None => direction,
            Some(turn) => (turn - direction * direction.dot(&turn)) / length,
        };
        let dimension = self.structure.dimension;
        for axis in 0..dimension {
            self.row[b * dimension + axis] += rate[axis];
            self.row[a * dimension + axis] -= rate[axis];
        }
    }

    /// Forbids the rigid motions that leave the supports where they are and turn no load.
    fn forbid_rigid_motions(&mut self, configuration: &Configuration) {
        let structure = self.structure;
        let positions = &configuration.positions;
        let planar = structure.dimension == 2;
        let reached = || (0..positions.len()).filter(|&node| self.reached[node]);
        let count = reached().count().max(1) as f64;
        let sum: Vector3<f64> = reached().map(|node| positions[node].coords).sum();
        let center = sum / count;
        let reach = reached()
            .map(|node| (positions[node].coords - center).norm())
            .fold(f64::MIN_POSITIVE, f64::max);
        let velocity = |node: usize, mode: &Vector6<f64>| {
            let turn = Vector3::new(mode[3], mode[4], mode[5]);
            let arm = (positions[node].coords - center) / reach;
            Vector3::new(mode[0], mode[1], mode[2]) + turn.cross(&arm)
        };
        // Motion of the supports as a quadratic form on the six rigid motions: its null space is
        // free. Motions out of the plane do not exist for a planar structure.
        let mut form = Matrix6::zeros();
        if planar {
            [2, 3, 4]
                .into_iter()
                .for_each(|mode| form[(mode, mode)] = 1.0);
        }
        let unit = |mode: usize| Vector6::from_fn(|i, _| f64::from(u8::from(i == mode)));
        let loads = structure.nodes.iter().map(|node| node.load);
        let strongest = loads.clone().map(|load| load.norm()).fold(0.0, f64::max);
        for load in loads.filter(|load| load.norm() > DEPENDENT * strongest) {
            // What a turn adds to the load, again as a quadratic form.
            let turned = |mode: usize| unit(mode).fixed_rows::<3>(3).cross(&load) / strongest;
            for i in 3..6 {
                for j in 3..6 {
                    form[(i, j)] += turned(i).dot(&turned(j));
                }
            }
        }
        for node in reached().filter(|&node| !structure.nodes[node].balanced) {
            for i in 0..6 {
                for j in 0..6 {
                    form[(i, j)] += velocity(node, &unit(i)).dot(&velocity(node, &unit(j)));
                }
            }
        }
        let eigen = form.symmetric_eigen();
        for (mode, value) in eigen.eigenvalues.iter().enumerate() {
            if *value < DEPENDENT {
                let motion = eigen.eigenvectors.column(mode).into_owned();
                for node in (0..structure.nodes.len()).filter(|&node| self.reached[node]) {
                    let velocity = velocity(node, &motion);
                    for axis in 0..structure.dimension {
                        self.row[node * structure.dimension + axis] = velocity[axis];
                    }
                }
                self.enter();
            }
        }
    }

    /// Orthonormalises the row against the constraints, keeps it if it is new, and clears it.
    fn enter(&mut self) {
        let norm = self.row.norm();
        if norm > 0.0 {
            self.row /= norm;
            // Twice is enough for orthogonality to rounding.
            for _ in 0..2 {
                for constraint in &self.constraints {
                    let share = constraint.dot(&self.row);
                    self.row.axpy(-share, constraint, 1.0);
                }
            }
            let rest = self.row.norm();
            if rest > DEPENDENT {
                self.constraints.push(&self.row / rest);
            }
        }
        self.row.fill(0.0);
    }
}
