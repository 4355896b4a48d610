//! Equilibrium between two samples: interpolates node coordinates and forces linearly and restores
//! all equations of the structure by Gauss–Newton steps of least norm.
//!
//! This is the judge's own solver; it shares nothing with the planners'. Unknowns are the free node
//! coordinates, over the size of the structure, and all forces, over the largest force. Equations
//! are force balance, constant lengths, rest lengths and forces, couplings, pretension and the
//! rigidity of attachments, each made dimensionless. They are redundant by nature, so a step solves
//! (J Jᵀ + μ I) y = −F and takes Jᵀ y, with a μ so small that it only keeps the Cholesky
//! factorisation alive. The factor is kept for as long as it contracts well.
//!
//! Cost for m equations and n unknowns: m² n / 2 + m³ / 6 multiplications for a factor, mostly one
//! for each call, and 2 m (m + n) for a step.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Matrix3, Rotation3, Vector3};
use tensegra_model::{Configuration, Coupling, ForceLaw, Structure};

use crate::statics::{axis, largest_force};

/// Residual at which iteration stops.
const TARGET: f64 = 1e-11;
/// μ over the largest diagonal entry of J Jᵀ.
const DAMPING: f64 = 1e-12;
const MAX_STEPS: usize = 40;
/// A factor is renewed when a step leaves more than this share of the residual.
const CONTRACTION: f64 = 0.05;
/// Below this residual, a fresh factor that contracts badly has met rounding or equations that
/// contradict each other by so much.
const STAGNATION: f64 = 1e-8;

/// One scalar or vector equation.
enum Equation {
    /// Σ f u + load = 0 at a node.
    Balance { node: usize },
    /// l = value.
    Length { element: usize, value: f64 },
    /// f = k (l − r) with a constant rest length r.
    Hooke {
        element: usize,
        stiffness: f64,
        rest: f64,
    },
    /// f = value.
    Force { element: usize, value: f64 },
    /// l(a) = scale · l(b).
    LengthCoupling { a: usize, b: usize, scale: f64 },
    /// r(a) = scale · r(b), with r = l − f / k.
    RestCoupling {
        a: usize,
        b: usize,
        scale: f64,
        stiffness: [f64; 2],
    },
    /// f(a) = scale · f(b).
    ForceCoupling { a: usize, b: usize, scale: f64 },
    /// u(a) = R u(b).
    Orientation {
        a: usize,
        b: usize,
        rotation: Rotation3<f64>,
    },
    /// Σ f² = P².
    Pretension { norm: f64 },
    /// |p(a) − p(b)| = value.
    Distance { a: usize, b: usize, value: f64 },
}

pub(crate) struct Restorer<'a> {
    structure: &'a Structure,
    size: f64,
    force_scale: f64,
    equations: Vec<Equation>,
    /// Unknown of each coordinate of each node.
    coordinate: Vec<[Option<usize>; 3]>,
    /// Unknown of each force.
    force: Vec<Option<usize>>,
    /// Elements at each node, and whether the node is the first.
    incident: Vec<Vec<(usize, bool)>>,
    /// Vector, length and direction of each element.
    lengths: Vec<f64>,
    directions: Vec<Vector3<f64>>,
    residual: DVector<f64>,
    /// Jᵀ: one column for each equation.
    gradients: DMatrix<f64>,
    gram: Option<DMatrix<f64>>,
    multipliers: DVector<f64>,
    step: DVector<f64>,
}

impl<'a> Restorer<'a> {
    pub(crate) fn new(structure: &'a Structure, size: f64) -> Self {
        let mut unknowns = 0;
        let mut next = || {
            unknowns += 1;
            Some(unknowns - 1)
        };
        let coordinate: Vec<[Option<usize>; 3]> = (0..structure.nodes.len())
            .map(|node| {
                [0, 1, 2].map(|axis| {
                    let fixed = structure
                        .fixed
                        .iter()
                        .any(|f| f.node == node && f.axis == axis);
                    if fixed || axis >= structure.dimension {
                        None
                    } else {
                        next()
                    }
                })
            })
            .collect();
        let force = structure
            .elements
            .iter()
            .map(|e| e.carries_force().then(&mut next).flatten());
        let force: Vec<Option<usize>> = force.collect();
        let mut incident = vec![Vec::new(); structure.nodes.len()];
        for (index, element) in structure.elements.iter().enumerate() {
            if element.carries_force() {
                incident[element.nodes[0]].push((index, true));
                incident[element.nodes[1]].push((index, false));
            }
        }
        let equations = equations(structure, &incident);
        let rows = equations
            .iter()
            .map(|equation| equation.rows(structure.dimension))
            .sum();
        Self {
            structure,
            size,
            force_scale: 1.0,
            equations,
            coordinate,
            force,
            incident,
            lengths: vec![0.0; structure.elements.len()],
            directions: vec![Vector3::zeros(); structure.elements.len()],
            residual: DVector::zeros(rows),
            gradients: DMatrix::zeros(unknowns, rows),
            gram: Some(DMatrix::zeros(rows, rows)),
            multipliers: DVector::zeros(rows),
            step: DVector::zeros(unknowns),
        }
    }

    /// Distance of two configurations in the unknowns: coordinates over the size, forces over the
    /// largest force.
    pub(crate) fn distance(&self, a: &Configuration, b: &Configuration) -> f64 {
        let mut sum = 0.0;
        for (p, q) in a.positions.iter().zip(&b.positions) {
            sum += (p - q).norm_squared() / (self.size * self.size);
        }
        let scale = force_scale(a).max(force_scale(b));
        for (f, g) in a.forces.iter().zip(&b.forces) {
            if let (Some(f), Some(g)) = (f, g) {
                sum += ((f - g) / scale).powi(2);
            }
        }
        sum.sqrt()
    }

    /// Writes into `middle` the equilibrium next to the mean of `a` and `b`, as good as it gets,
    /// and returns the norm of the residual.
    pub(crate) fn restore(
        &mut self,
        a: &Configuration,
        b: &Configuration,
        middle: &mut Configuration,
    ) -> f64 {
        self.force_scale = force_scale(a).max(force_scale(b));
        middle.clone_from(a);
        for (p, q) in middle.positions.iter_mut().zip(&b.positions) {
            *p = nalgebra::center(p, q);
        }
        for (f, g) in middle.forces.iter_mut().zip(&b.forces) {
            if let (Some(f), Some(g)) = (f, g) {
                *f = 0.5 * (*f + *g);
            }
        }
        let residual = self.solve(middle);
        self.complete(a, b, middle);
        residual
    }

    fn solve(&mut self, x: &mut Configuration) -> f64 {
        self.evaluate(x, true);
        let mut norm = self.residual.norm();
        let mut kept = None;
        for _ in 0..MAX_STEPS {
            if norm <= TARGET || !norm.is_finite() {
                break;
            }
            let fresh = kept.is_none();
            let Some(factor) = kept.take().or_else(|| self.factorise()) else {
                break;
            };
            self.multipliers.copy_from(&self.residual);
            factor.solve_mut(&mut self.multipliers);
            self.step
                .gemv(-1.0, &self.gradients, &self.multipliers, 0.0);
            self.advance(x, 1.0);
            self.evaluate(x, false);
            let reached = self.residual.norm();
            if reached <= CONTRACTION * norm {
                kept = Some(factor);
                norm = reached;
                continue;
            }
            self.gram = Some(factor.unpack_dirty());
            if fresh && reached < norm && norm < STAGNATION {
                norm = reached;
                break;
            }
            // NaN counts as worse.
            let better = reached < norm;
            if fresh && !better && !self.backtrack(x, norm) {
                break;
            }
            if !fresh && !better {
                self.advance(x, -1.0);
            }
            self.evaluate(x, true);
            norm = self.residual.norm();
        }
        if let Some(factor) = kept {
            self.gram = Some(factor.unpack_dirty());
        }
        norm
    }

    /// Halves the step taken until the residual falls below `norm`; whether it did.
    fn backtrack(&mut self, x: &mut Configuration, norm: f64) -> bool {
        let mut taken = 1.0;
        for _ in 0..8 {
            self.advance(x, -0.5 * taken);
            taken *= 0.5;
            self.evaluate(x, false);
            if self.residual.norm() < norm {
                return true;
            }
        }
        self.advance(x, -taken);
        self.evaluate(x, false);
        false
    }

    fn factorise(&mut self) -> Option<Cholesky<f64, Dyn>> {
        let rows = self.residual.len();
        // The matrix is away only while a factor is alive.
        let mut gram = self
            .gram
            .take()
            .unwrap_or_else(|| DMatrix::zeros(rows, rows));
        for j in 0..rows {
            let column = self.gradients.column(j);
            for i in j..rows {
                gram[(i, j)] = column.dot(&self.gradients.column(i));
            }
        }
        let damping = DAMPING * gram.diagonal().amax();
        for i in 0..rows {
            gram[(i, i)] += damping;
        }
        Cholesky::new(gram)
    }

    /// Moves by a multiple of the step.
    fn advance(&self, x: &mut Configuration, share: f64) {
        for (position, unknowns) in x.positions.iter_mut().zip(&self.coordinate) {
            for (axis, unknown) in unknowns.iter().enumerate() {
                if let Some(unknown) = unknown {
                    position[axis] += share * self.size * self.step[*unknown];
                }
            }
        }
        for (force, unknown) in x.forces.iter_mut().zip(&self.force) {
            if let (Some(force), Some(unknown)) = (force, unknown) {
                *force += share * self.force_scale * self.step[*unknown];
            }
        }
    }

    /// Lengths, and rest lengths where they are free, from positions and forces.
    fn complete(&self, a: &Configuration, b: &Configuration, x: &mut Configuration) {
        for (index, element) in self.structure.elements.iter().enumerate() {
            x.lengths[index] = self.lengths[index];
            if let ForceLaw::Linear { stiffness, rest } = element.law {
                x.rest_lengths[index] = match (x.forces[index], a.rest_lengths[index]) {
                    _ if rest.is_constant() => Some(rest.lo),
                    (Some(force), _) if stiffness != 0.0 => {
                        Some(self.lengths[index] - force / stiffness)
                    }
                    (_, before) => before
                        .zip(b.rest_lengths[index])
                        .map(|(before, after)| 0.5 * (before + after)),
                };
            }
        }
    }

    /// Residual, and gradients where asked for, at `x`.
    fn evaluate(&mut self, x: &Configuration, with_gradients: bool) {
        for index in 0..self.structure.elements.len() {
            let vector = axis(self.structure, &x.positions, index);
            let length = vector.norm();
            self.lengths[index] = length;
            // An element without length pulls nowhere.
            self.directions[index] = if length > 0.0 {
                vector / length
            } else {
                Vector3::zeros()
            };
        }
        if with_gradients {
            self.gradients.fill(0.0);
        }
        let equations = std::mem::take(&mut self.equations);
        let mut row = 0;
        for equation in &equations {
            self.residuals(equation, x, row);
            if with_gradients {
                self.derivatives(equation, x, row);
            }
            row += equation.rows(self.structure.dimension);
        }
        self.equations = equations;
    }

    fn force(&self, x: &Configuration, element: usize) -> f64 {
        x.forces[element].unwrap_or(0.0)
    }

    /// What the residual of Hooke's law is measured against.
    fn hooke_scale(&self, stiffness: f64) -> f64 {
        self.force_scale.max(stiffness.abs() * self.size)
    }

    fn residuals(&mut self, equation: &Equation, x: &Configuration, row: usize) {
        let value = match *equation {
            Equation::Balance { node } => {
                let mut sum = self.structure.nodes[node].load;
                for &(element, first) in &self.incident[node] {
                    let pull = self.force(x, element) * self.directions[element];
                    sum += if first { pull } else { -pull };
                }
                for axis in 0..self.structure.dimension {
                    self.residual[row + axis] = sum[axis] / self.force_scale;
                }
                return;
            }
            Equation::Orientation { a, b, rotation } => {
                let error = self.directions[a] - rotation * self.directions[b];
                for axis in 0..self.structure.dimension {
                    self.residual[row + axis] = error[axis];
                }
                return;
            }
            Equation::Length { element, value } => (self.lengths[element] - value) / self.size,
            Equation::Hooke {
                element,
                stiffness,
                rest,
            } => {
                let law = stiffness * (self.lengths[element] - rest);
                (self.force(x, element) - law) / self.hooke_scale(stiffness)
            }
            Equation::Force { element, value } => {
                (self.force(x, element) - value) / self.force_scale
            }
            Equation::LengthCoupling { a, b, scale } => {
                (self.lengths[a] - scale * self.lengths[b]) / self.size
            }
            Equation::RestCoupling {
                a,
                b,
                scale,
                stiffness,
            } => {
                let rest =
                    |e: usize, stiffness: f64| self.lengths[e] - self.force(x, e) / stiffness;
                (rest(a, stiffness[0]) - scale * rest(b, stiffness[1])) / self.size
            }
            Equation::ForceCoupling { a, b, scale } => {
                (self.force(x, a) - scale * self.force(x, b)) / self.force_scale
            }
            Equation::Pretension { norm } => {
                let sum: f64 = x.forces.iter().flatten().map(|force| force * force).sum();
                (sum - norm * norm) / (self.force_scale * self.force_scale)
            }
            Equation::Distance { a, b, value } => {
                ((x.positions[a] - x.positions[b]).norm() - value) / self.size
            }
        };
        self.residual[row] = value;
    }

    fn derivatives(&mut self, equation: &Equation, x: &Configuration, row: usize) {
        let unit = |index: usize| Vector3::from_fn(|axis, _| f64::from(u8::from(axis == index)));
        match *equation {
            Equation::Balance { node } => {
                for k in 0..self.incident[node].len() {
                    let (element, first) = self.incident[node][k];
                    let sign = if first { 1.0 } else { -1.0 };
                    let tension = sign * self.force(x, element) * self.size / self.force_scale;
                    let turn = self.turn(element);
                    for axis in 0..self.structure.dimension {
                        let along = tension * (turn * unit(axis));
                        self.add_vector(row + axis, element, along);
                        self.add_force(row + axis, element, sign * self.directions[element][axis]);
                    }
                }
            }
            Equation::Orientation { a, b, rotation } => {
                for axis in 0..self.structure.dimension {
                    let along = self.size * (self.turn(a) * unit(axis));
                    self.add_vector(row + axis, a, along);
                    let along = self.size * (self.turn(b) * (rotation.inverse() * unit(axis)));
                    self.add_vector(row + axis, b, -along);
                }
            }
            Equation::Length { element, .. } => self.add_length(row, element, 1.0),
            Equation::Hooke {
                element, stiffness, ..
            } => {
                let scale = self.hooke_scale(stiffness);
                self.add_force(row, element, self.force_scale / scale);
                self.add_length(row, element, -stiffness * self.size / scale);
            }
            Equation::Force { element, .. } => self.add_force(row, element, 1.0),
            Equation::LengthCoupling { a, b, scale } => {
                self.add_length(row, a, 1.0);
                self.add_length(row, b, -scale);
            }
            Equation::RestCoupling {
                a,
                b,
                scale,
                stiffness,
            } => {
                let share = self.force_scale / self.size;
                self.add_length(row, a, 1.0);
                self.add_force(row, a, -share / stiffness[0]);
                self.add_length(row, b, -scale);
                self.add_force(row, b, scale * share / stiffness[1]);
            }
            Equation::ForceCoupling { a, b, scale } => {
                self.add_force(row, a, 1.0);
                self.add_force(row, b, -scale);
            }
            Equation::Pretension { .. } => {
                for element in 0..self.structure.elements.len() {
                    let slope = 2.0 * self.force(x, element) / self.force_scale;
                    self.add_force(row, element, slope);
                }
            }
            Equation::Distance { a, b, .. } => {
                let vector = x.positions[b] - x.positions[a];
                let along = vector.try_normalize(0.0).unwrap_or_else(Vector3::zeros);
                self.add_nodes(row, [a, b], along);
            }
        }
    }

    /// Derivative (I − u uᵀ) / l of the direction of an element by its vector.
    fn turn(&self, element: usize) -> Matrix3<f64> {
        let (direction, length) = (self.directions[element], self.lengths[element]);
        if length > 0.0 {
            (Matrix3::identity() - direction * direction.transpose()) / length
        } else {
            Matrix3::zeros()
        }
    }

    /// Adds the derivative by the vector from node a to node b, in units of the size.
    fn add_nodes(&mut self, row: usize, [a, b]: [usize; 2], gradient: Vector3<f64>) {
        for axis in 0..3 {
            if let Some(unknown) = self.coordinate[b][axis] {
                self.gradients[(unknown, row)] += gradient[axis];
            }
            if let Some(unknown) = self.coordinate[a][axis] {
                self.gradients[(unknown, row)] -= gradient[axis];
            }
        }
    }

    fn add_vector(&mut self, row: usize, element: usize, gradient: Vector3<f64>) {
        self.add_nodes(row, self.structure.elements[element].nodes, gradient);
    }

    fn add_length(&mut self, row: usize, element: usize, slope: f64) {
        self.add_vector(row, element, slope * self.directions[element]);
    }

    fn add_force(&mut self, row: usize, element: usize, slope: f64) {
        if let Some(unknown) = self.force[element] {
            self.gradients[(unknown, row)] += slope;
        }
    }
}

impl Equation {
    fn rows(&self, dimension: usize) -> usize {
        match self {
            Self::Balance { .. } | Self::Orientation { .. } => dimension,
            _ => 1,
        }
    }
}

fn force_scale(configuration: &Configuration) -> f64 {
    let largest = largest_force(configuration);
    if largest > 0.0 { largest } else { 1.0 }
}

fn equations(structure: &Structure, incident: &[Vec<(usize, bool)>]) -> Vec<Equation> {
    let mut equations = Vec::new();
    for (node, incident) in incident.iter().enumerate() {
        if structure.nodes[node].balanced && !incident.is_empty() {
            equations.push(Equation::Balance { node });
        }
    }
    for (element, data) in structure.elements.iter().enumerate() {
        if data.has_constant_length() {
            equations.push(Equation::Length {
                element,
                value: data.length.lo,
            });
        }
        match data.law {
            ForceLaw::Linear { stiffness: 0.0, .. } => {
                equations.push(Equation::Force {
                    element,
                    value: 0.0,
                });
            }
            ForceLaw::Linear { stiffness, rest } if rest.is_constant() => {
                equations.push(Equation::Hooke {
                    element,
                    stiffness,
                    rest: rest.lo,
                });
            }
            _ => {}
        }
        if data.carries_force() && data.force.is_constant() {
            equations.push(Equation::Force {
                element,
                value: data.force.lo,
            });
        }
    }
    for coupling in &structure.couplings {
        match coupling {
            Coupling::Length {
                reference,
                followers,
            } => {
                let each = followers.iter();
                equations.extend(each.map(|&(b, scale)| Equation::LengthCoupling {
                    a: *reference,
                    b,
                    scale,
                }));
            }
            Coupling::Rest {
                reference,
                followers,
            } => {
                equations.extend(followers.iter().filter_map(|&(b, scale)| {
                    let stiffness = [*reference, b].map(|e| structure.elements[e].stiffness());
                    let stiffness = [stiffness[0]?, stiffness[1]?];
                    (stiffness[0] != 0.0 && stiffness[1] != 0.0).then_some(Equation::RestCoupling {
                        a: *reference,
                        b,
                        scale,
                        stiffness,
                    })
                }));
            }
            Coupling::Force {
                reference,
                followers,
            } => {
                let each = followers.iter();
                equations.extend(each.map(|&(b, scale)| Equation::ForceCoupling {
                    a: *reference,
                    b,
                    scale,
                }));
            }
            Coupling::Orientation {
                reference,
                followers,
            } => {
                let a = *reference;
                equations.extend(
                    followers
                        .iter()
                        .map(|&(b, rotation)| Equation::Orientation { a, b, rotation }),
                );
            }
        }
    }
    if let Some(norm) = structure.pretension {
        equations.push(Equation::Pretension { norm });
    }
    for attachment in &structure.attachments {
        for (i, j) in [(0, 1), (1, 2), (2, 0)] {
            let [a, b] = [&attachment.anchors[i], &attachment.anchors[j]];
            let value = (a.local - b.local).norm();
            equations.push(Equation::Distance {
                a: a.node,
                b: b.node,
                value,
            });
        }
    }
    equations
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point3, Vector3};
    use tensegra_model::{
        Anchor, Appearance, Attachment, Element, ElementKind, FixedCoordinate, Interval, Node,
    };

    use super::*;

    fn element(index: usize, nodes: [usize; 2], law: ForceLaw, length: Interval) -> Element {
        Element {
            name: format!("e{index}"),
            kind: ElementKind::Bar,
            nodes,
            length,
            law,
            force: Interval::new(f64::NEG_INFINITY, f64::INFINITY),
            radius: 0.01,
            appearance: Appearance::default(),
            dynamics: Vec::new(),
        }
    }

    /// Five nodes in space with an equation of every kind. Not an equilibrium.
    fn everything() -> (Structure, Configuration) {
        let range = Interval::new(0.0, 5.0);
        let elastic = |stiffness, rest| ForceLaw::Linear { stiffness, rest };
        let constant = Interval::constant(1.1);
        let mut elements: Vec<Element> = [
            ([0, 1], ForceLaw::Free, constant),
            ([1, 2], elastic(3.0, range), range),
            ([2, 3], elastic(7.0, range), range),
            ([3, 0], elastic(2.0, Interval::constant(0.4)), range),
            ([0, 2], elastic(0.0, range), range),
            ([1, 3], ForceLaw::None, constant),
            ([2, 4], ForceLaw::Free, range),
            ([4, 0], ForceLaw::Free, range),
        ]
        .into_iter()
        .enumerate()
        .map(|(index, (nodes, law, length))| element(index, nodes, law, length))
        .collect();
        elements[6].force = Interval::constant(0.3);
        let rotation = Rotation3::from_euler_angles(0.3, -0.2, 1.1);
        let couplings = vec![
            Coupling::Length {
                reference: 1,
                followers: vec![(2, 1.2)],
            },
            Coupling::Rest {
                reference: 1,
                followers: vec![(2, 0.7)],
            },
            Coupling::Force {
                reference: 0,
                followers: vec![(7, -0.5)],
            },
            Coupling::Orientation {
                reference: 3,
                followers: vec![(6, rotation)],
            },
        ];
        let node = |index: usize| Node {
            name: format!("n{index}"),
            balanced: index != 4,
            load: Vector3::new(0.1, -0.2, 0.05 * index as f64),
            mass: 0.0,
        };
        let anchor = |node: usize, x: f64, y: f64| Anchor {
            local: Point3::new(x, y, 0.0),
            node,
        };
        let structure = Structure {
            dimension: 3,
            nodes: (0..5).map(node).collect(),
            elements,
            couplings,
            attachments: vec![Attachment {
                name: "plate".to_owned(),
                shapes: Vec::new(),
                anchors: [
                    anchor(1, 0.0, 0.0),
                    anchor(3, 1.0, 0.0),
                    anchor(4, 0.3, 0.8),
                ],
            }],
            fixed: vec![FixedCoordinate {
                node: 0,
                axis: 1,
                value: 0.1,
            }],
            base_range: None,
            pretension: Some(2.0),
        };
        let positions = [
            [0.0, 0.1, 0.0],
            [1.0, 0.2, -0.1],
            [0.8, 1.1, 0.4],
            [-0.2, 0.9, 0.7],
            [0.4, -0.3, 1.2],
        ]
        .map(|[x, y, z]| Point3::new(x, y, z));
        let forces = [-0.7, 0.4, 0.9, 1.3, 0.1, 0.0, 0.2, -1.1];
        let configuration = Configuration {
            positions: positions.to_vec(),
            lengths: vec![0.0; 8],
            rest_lengths: vec![Some(0.5); 8],
            forces: forces
                .iter()
                .enumerate()
                .map(|(i, &f)| (i != 5).then_some(f))
                .collect(),
        };
        (structure, configuration)
    }

    #[test]
    fn gradients_agree_with_central_differences() {
        let (structure, configuration) = everything();
        let mut restorer = Restorer::new(&structure, 1.7);
        restorer.force_scale = 1.3;
        restorer.evaluate(&configuration, true);
        let gradients = restorer.gradients.clone();
        let step = 1e-6;
        for unknown in 0..gradients.nrows() {
            restorer.step.fill(0.0);
            restorer.step[unknown] = step;
            let mut at = |share: f64| {
                let mut moved = configuration.clone();
                restorer.advance(&mut moved, share);
                restorer.evaluate(&moved, false);
                restorer.residual.clone()
            };
            let slope = (at(1.0) - at(-1.0)) / (2.0 * step);
            let error = (gradients.row(unknown).transpose() - slope).amax();
            assert!(error < 1e-8, "unknown {unknown}: {error}");
        }
    }

    #[test]
    fn what_cannot_be_restored_says_so() {
        // More equations than a structure can satisfy: no panic, and a residual that is not small.
        let (structure, configuration) = everything();
        let mut restorer = Restorer::new(&structure, 1.0);
        let mut middle = configuration.clone();
        let residual = restorer.restore(&configuration, &configuration, &mut middle);
        assert!(residual > 1e-3 && residual.is_finite());
    }

    #[test]
    fn a_point_that_all_elements_share_is_no_equilibrium() {
        let (structure, mut configuration) = everything();
        configuration.positions.fill(Point3::origin());
        let mut restorer = Restorer::new(&structure, 1.0);
        let mut middle = configuration.clone();
        let residual = restorer.restore(&configuration, &configuration, &mut middle);
        assert!(residual > 1e-3 || residual.is_nan());
    }
}
