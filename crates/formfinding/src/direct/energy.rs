//! The potential energy of a structure with given rest lengths, its derivatives,
//! and the constant lengths as constraints.

use nalgebra::{DMatrix, DVector, Point3, Vector3};
use tensegra_model::{Configuration, ForceLaw, Structure, statics::Freedoms};

/// No freedom: the coordinate is held.
const HELD: usize = usize::MAX;

/// An elastic element.
struct Elastic {
    element: usize,
    nodes: [usize; 2],
    stiffness: f64,
    rest: f64,
    pulls_only: bool,
}

/// An element of constant length that moves.
struct Rigid {
    element: usize,
    nodes: [usize; 2],
    length: f64,
}

pub(super) struct Energy {
    dimension: usize,
    /// Freedom of every coordinate of every node.
    index: Vec<[usize; 3]>,
    coordinates: Vec<[usize; 2]>,
    elastic: Vec<Elastic>,
    rigid: Vec<Rigid>,
    /// All elements of constant length, those between held nodes included.
    inextensible: Vec<usize>,
    loads: Vec<Vector3<f64>>,
    positions: Vec<Point3<f64>>,
    /// Unbalanced force of every node, scratch.
    pulls: Vec<Vector3<f64>>,
    /// Largest force of an elastic element at the last evaluation.
    largest_force: f64,
}

impl Energy {
    /// The energy of a structure without its `absent` elements.
    pub(super) fn new(
        structure: &Structure,
        freedoms: &Freedoms,
        pushing_cables: bool,
        absent: &[usize],
    ) -> Self {
        let index: Vec<[usize; 3]> = (0..structure.nodes.len())
            .map(|node| [0, 1, 2].map(|axis| freedoms.index(node, axis).unwrap_or(HELD)))
            .collect();
        let mut elastic = Vec::new();
        let mut rigid = Vec::new();
        let mut inextensible = Vec::new();
        for (element, e) in structure.elements.iter().enumerate() {
            let nodes = e.nodes;
            match e.law {
                _ if absent.contains(&element) => {}
                ForceLaw::None => {}
                ForceLaw::Linear { stiffness, rest } => elastic.push(Elastic {
                    element,
                    nodes,
                    stiffness,
                    rest: rest.lo,
                    pulls_only: e.pulls_only() && !pushing_cables,
                }),
                ForceLaw::Free => {
                    inextensible.push(element);
                    let moves = nodes
                        .iter()
                        .any(|&node| index[node].iter().any(|&i| i != HELD));
                    if moves {
                        rigid.push(Rigid {
                            element,
                            nodes,
                            length: e.length.lo,
                        });
                    }
                }
            }
        }
        Self {
            dimension: structure.dimension,
            coordinates: freedoms.coordinates().to_vec(),
            elastic,
            rigid,
            inextensible,
            loads: structure.nodes.iter().map(|node| node.load).collect(),
            positions: vec![Point3::origin(); index.len()],
            pulls: vec![Vector3::zeros(); index.len()],
            largest_force: 0.0,
            index,
        }
    }

    pub(super) fn constraint_count(&self) -> usize {
        self.rigid.len()
    }

    pub(super) fn set_rest_length(&mut self, element: usize, rest: f64) {
        if let Some(elastic) = self.elastic.iter_mut().find(|e| e.element == element) {
            elastic.rest = rest;
        }
    }

    pub(super) fn set_constant_length(&mut self, element: usize, length: f64) {
        if let Some(rigid) = self.rigid.iter_mut().find(|r| r.element == element) {
            rigid.length = length;
        }
    }

    pub(super) fn positions(&self) -> &[Point3<f64>] {
        &self.positions
    }

    pub(super) fn set_positions(&mut self, positions: &[Point3<f64>]) {
        self.positions.copy_from_slice(positions);
    }

    /// The free coordinates.
    pub(super) fn read(&self, x: &mut DVector<f64>) {
        for (value, &[node, axis]) in x.iter_mut().zip(&self.coordinates) {
            *value = self.positions[node][axis];
        }
    }

    /// Puts the free coordinates at x + scale · step.
    pub(super) fn write(&mut self, x: &DVector<f64>, step: &DVector<f64>, scale: f64) {
        for (i, &[node, axis]) in self.coordinates.iter().enumerate() {
            self.positions[node][axis] = x[i] + scale * step[i];
        }
    }

    /// Diameter of the box around all nodes that an element with a force touches.
    pub(super) fn size(&self) -> f64 {
        let nodes = self
            .elastic
            .iter()
            .flat_map(|e| e.nodes)
            .chain(self.rigid.iter().flat_map(|r| r.nodes));
        let (lo, hi) = nodes.fold(
            (
                Vector3::repeat(f64::INFINITY),
                Vector3::repeat(f64::NEG_INFINITY),
            ),
            |(lo, hi), node| {
                let at = self.positions[node].coords;
                (lo.inf(&at), hi.sup(&at))
            },
        );
        let longest = self.elastic.iter().map(|e| e.rest).fold(0.0, f64::max);
        let constant = self.rigid.iter().map(|r| r.length).fold(0.0, f64::max);
        let size = (hi - lo).norm().max(longest).max(constant);
        if size.is_finite() && size > 0.0 {
            size
        } else {
            1.0
        }
    }

    /// The largest product of a stiffness and a length: what forces are rounded
    /// against.
    pub(super) fn rounding_force(&self) -> f64 {
        let products = self.elastic.iter().map(|e| {
            let [a, b] = e.nodes;
            let length = (self.positions[b] - self.positions[a]).norm();
            e.stiffness.abs() * length.max(e.rest)
        });
        products.fold(0.0, f64::max)
    }

    /// The largest elastic force or load at the last evaluation.
    pub(super) fn force_scale(&self) -> f64 {
        let loads = self.loads.iter().map(|load| load.norm());
        loads.fold(self.largest_force, f64::max)
    }

    /// The energy.
    pub(super) fn value(&self) -> f64 {
        let strain: f64 = self
            .elastic
            .iter()
            .map(|e| {
                let [a, b] = e.nodes;
                let stretch = (self.positions[b] - self.positions[a]).norm() - e.rest;
                match e.pulls_only && stretch <= 0.0 {
                    true => 0.0,
                    false => 0.5 * e.stiffness * stretch * stretch,
                }
            })
            .sum();
        let work = self.loads.iter().zip(&self.positions);
        strain - work.map(|(load, at)| load.dot(&at.coords)).sum::<f64>()
    }

    /// Energy, with its gradient.
    pub(super) fn gradient(&mut self, gradient: &mut DVector<f64>) -> f64 {
        for (pull, load) in self.pulls.iter_mut().zip(&self.loads) {
            *pull = *load;
        }
        let mut value = 0.0;
        self.largest_force = 0.0;
        for e in &self.elastic {
            let [a, b] = e.nodes;
            let vector = self.positions[b] - self.positions[a];
            let length = vector.norm();
            let stretch = length - e.rest;
            if e.pulls_only && stretch <= 0.0 {
                continue;
            }
            value += 0.5 * e.stiffness * stretch * stretch;
            let force = e.stiffness * stretch;
            self.largest_force = self.largest_force.max(force.abs());
            if length > 0.0 {
                let pull = vector * (force / length);
                self.pulls[a] += pull;
                self.pulls[b] -= pull;
            }
        }
        for (load, at) in self.loads.iter().zip(&self.positions) {
            value -= load.dot(&at.coords);
        }
        for (value, &[node, axis]) in gradient.iter_mut().zip(&self.coordinates) {
            *value = -self.pulls[node][axis];
        }
        value
    }

    /// The Hessian of E + λᵀ c into the lower triangle of `hessian`.
    pub(super) fn hessian(&self, multipliers: &DVector<f64>, hessian: &mut DMatrix<f64>) {
        hessian.fill(0.0);
        for e in &self.elastic {
            let [a, b] = e.nodes;
            let vector = self.positions[b] - self.positions[a];
            let length = vector.norm();
            if (e.pulls_only && length <= e.rest) || length == 0.0 {
                continue;
            }
            let density = e.stiffness * (length - e.rest) / length;
            let along = (e.stiffness - density) / (length * length);
            self.add(hessian, e.nodes, vector, along, density);
        }
        for (r, &force) in self.rigid.iter().zip(multipliers.iter()) {
            let [a, b] = r.nodes;
            let vector = self.positions[b] - self.positions[a];
            let density = force / vector.norm();
            self.add(
                hessian,
                r.nodes,
                vector,
                -density / vector.norm_squared(),
                density,
            );
        }
    }

    /// Adds `along d dᵀ + across I` between two nodes, to the lower triangle.
    fn add(
        &self,
        hessian: &mut DMatrix<f64>,
        [a, b]: [usize; 2],
        d: Vector3<f64>,
        along: f64,
        across: f64,
    ) {
        let (a, b) = (&self.index[a], &self.index[b]);
        for j in 0..self.dimension {
            for i in 0..self.dimension {
                let mut value = along * d[i] * d[j];
                if i == j {
                    value += across;
                }
                if i >= j {
                    if a[i] != HELD && a[j] != HELD {
                        hessian[(a[i], a[j])] += value;
                    }
                    if b[i] != HELD && b[j] != HELD {
                        hessian[(b[i], b[j])] += value;
                    }
                }
                if a[i] != HELD && b[j] != HELD {
                    hessian[(a[i].max(b[j]), a[i].min(b[j]))] -= value;
                }
            }
        }
    }

    /// How far constant lengths are exceeded.
    pub(super) fn constraints(&self, values: &mut DVector<f64>) {
        for (value, r) in values.iter_mut().zip(&self.rigid) {
            let [a, b] = r.nodes;
            *value = (self.positions[b] - self.positions[a]).norm() - r.length;
        }
    }

    /// The transposed Jacobian of the constraints: a column each.
    pub(super) fn jacobian(&self, columns: &mut DMatrix<f64>) {
        columns.fill(0.0);
        for (k, r) in self.rigid.iter().enumerate() {
            let [a, b] = r.nodes;
            let vector = self.positions[b] - self.positions[a];
            let unit = vector / vector.norm().max(f64::MIN_POSITIVE);
            for axis in 0..self.dimension {
                let (i, j) = (self.index[a][axis], self.index[b][axis]);
                if i != HELD {
                    columns[(i, k)] -= unit[axis];
                }
                if j != HELD {
                    columns[(j, k)] += unit[axis];
                }
            }
        }
    }

    /// The element of constant length that is farthest off, and by how much.
    pub(super) fn worst_length(&self) -> Option<(usize, f64)> {
        let errors = self.rigid.iter().map(|r| {
            let [a, b] = r.nodes;
            let length = (self.positions[b] - self.positions[a]).norm();
            (r.element, (length - r.length).abs())
        });
        errors.max_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// Elements that hang slack.
    pub(super) fn slack(&self) -> Vec<usize> {
        let slack = self.elastic.iter().filter(|e| {
            let [a, b] = e.nodes;
            e.pulls_only && (self.positions[b] - self.positions[a]).norm() <= e.rest
        });
        slack.map(|e| e.element).collect()
    }

    /// The configuration at `positions`: elastic forces from the lengths, those of
    /// elements of constant length as they balance the others best.
    pub(super) fn configuration(
        &self,
        structure: &Structure,
        positions: Vec<Point3<f64>>,
    ) -> Configuration {
        let lengths: Vec<f64> = structure
            .elements
            .iter()
            .map(|element| {
                let [a, b] = element.nodes;
                (positions[b] - positions[a]).norm()
            })
            .collect();
        let mut forces = vec![None; lengths.len()];
        let mut rest_lengths = vec![None; lengths.len()];
        for e in &self.elastic {
            let force = e.stiffness * (lengths[e.element] - e.rest);
            forces[e.element] = Some(if e.pulls_only { force.max(0.0) } else { force });
            rest_lengths[e.element] = Some(e.rest);
        }
        let mut configuration = Configuration {
            positions,
            lengths,
            rest_lengths,
            forces,
        };
        self.balance_rigid(structure, &mut configuration);
        configuration
    }

    /// Forces of all elements of constant length, by least squares over every node
    /// that has to be balanced, those with fixed coordinates included.
    fn balance_rigid(&self, structure: &Structure, configuration: &mut Configuration) {
        let rigid = &self.inextensible;
        if rigid.is_empty() {
            return;
        }
        let nodes = structure.nodes.len();
        let pulls = self.pulls_at(structure, configuration);
        let mut matrix = DMatrix::zeros(3 * nodes, rigid.len());
        let mut right = DVector::zeros(3 * nodes);
        let balanced = |node: usize| structure.nodes[node].balanced;
        for node in (0..nodes).filter(|&node| balanced(node)) {
            right.fixed_rows_mut::<3>(3 * node).copy_from(&-pulls[node]);
        }
        for (column, &e) in rigid.iter().enumerate() {
            let [a, b] = structure.elements[e].nodes;
            let vector = configuration.positions[b] - configuration.positions[a];
            let unit = vector / configuration.lengths[e].max(f64::MIN_POSITIVE);
            for (node, sign) in [(a, 1.0), (b, -1.0)] {
                if balanced(node) {
                    let mut block = matrix.fixed_view_mut::<3, 1>(3 * node, column);
                    block += sign * unit;
                }
            }
        }
        let solution = matrix.svd(true, true).solve(&right, 1e-10);
        for (i, &e) in rigid.iter().enumerate() {
            configuration.forces[e] = Some(solution.as_ref().map_or(0.0, |forces| forces[i]));
        }
    }

    /// Loads and pulls of all elements, at every node.
    fn pulls_at(&self, structure: &Structure, configuration: &Configuration) -> Vec<Vector3<f64>> {
        let mut pulls = self.loads.clone();
        for (e, element) in structure.elements.iter().enumerate() {
            let (Some(force), true) = (configuration.forces[e], configuration.lengths[e] > 0.0)
            else {
                continue;
            };
            let [a, b] = element.nodes;
            let vector = configuration.positions[b] - configuration.positions[a];
            let pull = vector * (force / configuration.lengths[e]);
            pulls[a] += pull;
            pulls[b] -= pull;
        }
        pulls
    }

    /// The node that has to be balanced and is farthest from it, with the force
    /// that is left over.
    pub(super) fn unbalanced(
        &self,
        structure: &Structure,
        configuration: &Configuration,
    ) -> (usize, f64) {
        let pulls = self.pulls_at(structure, configuration);
        let balanced = pulls.iter().enumerate();
        balanced
            .filter(|(node, _)| structure.nodes[*node].balanced)
            .map(|(node, pull)| (node, pull.norm()))
            .max_by(|a, b| a.1.total_cmp(&b.1))
            .unwrap_or((0, 0.0))
    }
}
