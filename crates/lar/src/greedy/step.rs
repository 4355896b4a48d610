//! The small optimisation behind one greedy step.
//!
//! Source: Usevitch et al., equations (23) to (29), with the target of the centre of mass that the
//! printed problem leaves out. Unknowns are the positions of the nodes that do not carry the
//! robot. Constraint functions that cannot reach their bound within one step are left out: a node
//! moves at most d_move, so the distance of two members changes at most by 2 d_move, and
//! likewise for lengths and angles. Cost: a few evaluations of the constraints near their bounds
//! and as many dense quadratic programmes in d·(n − d) unknowns.

use nalgebra::{DMatrix, Matrix3, Vector3};
use tensegra_optim::{Hessian, Nlp, TripletPattern};

use super::GreedyObjective;
use crate::constraint::{ConstraintFunction, RigidityFunction};
use crate::{Graph, RigiditySpectrum, Robot, Support};

/// A half-plane seen from above that free nodes may not leave: normal·p ≤ offset.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct HalfPlane {
    pub normal: Vector3<f64>,
    pub offset: f64,
}

/// One greedy step as a nonlinear programme; its memory is kept from step to step.
#[derive(Debug)]
pub(super) struct StepProblem<'a> {
    robot: &'a Robot,
    objective: GreedyObjective,
    /// All constraint functions of the robot, and those kept for this step.
    functions: Vec<ConstraintFunction>,
    kept: Vec<ConstraintFunction>,
    free: Vec<usize>,
    /// Place of each node among the free ones.
    place: Vec<Option<usize>>,
    target: Vector3<f64>,
    walls: Vec<HalfPlane>,
    previous: Vec<f64>,
    previous_lengths: Vec<f64>,
    coordinates: Vec<f64>,
    lengths: Vec<f64>,
    /// Dense lower triangle of the Hessian, row after row.
    hessian: Vec<f64>,
    rigidity_gradient: Vec<f64>,
    /// Least rigidity index, where it can be reached in this step.
    least_rigidity: Option<f64>,
    /// The rigidity function where it was evaluated last.
    rigidity: Option<RigidityFunction>,
    /// Largest eigenvalue of the graph's Laplacian.
    laplacian: f64,
}

impl<'a> StepProblem<'a> {
    pub(super) fn new(robot: &'a Robot) -> Self {
        let size = robot.num_coordinates();
        let members = robot.graph().num_members();
        Self {
            robot,
            objective: GreedyObjective::LeastMotion,
            functions: ConstraintFunction::all(robot),
            kept: Vec::new(),
            free: Vec::new(),
            place: vec![None; robot.graph().num_nodes()],
            target: Vector3::zeros(),
            walls: Vec::new(),
            previous: vec![0.0; size],
            previous_lengths: vec![0.0; members],
            coordinates: vec![0.0; size],
            lengths: vec![0.0; members],
            hessian: Vec::new(),
            rigidity_gradient: vec![0.0; size],
            least_rigidity: None,
            rigidity: None,
            laplacian: laplacian_norm(robot.graph()),
        }
    }

    /// Prepares the step from `previous`, standing on `support`, that brings the centre of mass
    /// above `target`.
    pub(super) fn prepare(
        &mut self,
        previous: &[f64],
        support: &Support,
        target: Vector3<f64>,
        objective: GreedyObjective,
        walls: &[HalfPlane],
    ) {
        self.objective = objective;
        self.target = target;
        self.previous.copy_from_slice(previous);
        self.coordinates.copy_from_slice(previous);
        self.robot
            .lengths_into(previous, &mut self.previous_lengths);
        self.free.clear();
        self.place.fill(None);
        for node in 0..self.robot.graph().num_nodes() {
            if !support.contains(node) {
                self.place[node] = Some(self.free.len());
                self.free.push(node);
            }
        }
        self.walls.clear();
        self.walls.extend_from_slice(walls);
        self.kept.clear();
        for index in 0..self.functions.len() {
            if self.may_become_active(self.functions[index]) {
                self.kept.push(self.functions[index]);
            }
        }
        self.rigidity = None;
        self.least_rigidity = self
            .robot
            .limits()
            .min_rigidity
            .filter(|&least| self.rigidity_may_become_active(least));
        let unknowns = self.num_variables();
        self.hessian.clear();
        self.hessian.resize(unknowns * (unknowns + 1) / 2, 0.0);
    }

    /// Whether a function can reach its bound while no node moves farther than d_move.
    fn may_become_active(&self, function: ConstraintFunction) -> bool {
        let limits = self.robot.limits();
        let moves = |node: usize| {
            if self.place[node].is_some() {
                limits.max_move
            } else {
                0.0
            }
        };
        let nodes = function.nodes(self.robot);
        let list = nodes.as_slice();
        match function {
            ConstraintFunction::Length(member) => {
                let change = moves(list[0]) + moves(list[1]);
                let length = self.previous_lengths[member];
                change > 0.0
                    && (length - change < limits.min_length || length + change > limits.max_length)
            }
            ConstraintFunction::Distance(pair) => {
                let change =
                    moves(list[0]).max(moves(list[1])) + moves(list[2]).max(moves(list[3]));
                change > 0.0
                    && self.robot.pair_distance(&self.previous, pair) - change < limits.min_distance
            }
            ConstraintFunction::Angle(_) => {
                let p = nodes.positions(self.robot, &self.previous);
                let (a, b) = (p[1] - p[0], p[2] - p[0]);
                let turn = |side: &Vector3<f64>, change: f64| {
                    let sine = change / side.norm();
                    if sine < 1.0 {
                        sine.asin()
                    } else {
                        std::f64::consts::PI
                    }
                };
                let apex = moves(list[0]);
                let change = turn(&a, apex + moves(list[1])) + turn(&b, apex + moves(list[2]));
                let angle = a.cross(&b).norm().atan2(a.dot(&b));
                change > 0.0 && angle - change < limits.min_angle
            }
        }
    }

    /// Whether the rigidity index can fall to `least` while no node moves farther than d_move.
    ///
    /// The smallest non-rigid singular value of the rigidity matrix R changes at most by the norm
    /// of the change of R, whose square is at most the largest squared change of a member's
    /// vector times the largest eigenvalue of the graph's Laplacian; the trace is 2 Σ L².
    fn rigidity_may_become_active(&self, least: f64) -> bool {
        let (graph, dimension) = (self.robot.graph(), self.robot.dimension());
        let change = 2.0 * self.robot.limits().max_move;
        let squares = |grown: f64| -> f64 {
            self.previous_lengths
                .iter()
                .map(|length| (length + grown).powi(2))
                .sum()
        };
        let spectrum = RigiditySpectrum::at(graph, dimension, &self.previous);
        let singular = (spectrum.index() * 2.0 * squares(0.0)).sqrt();
        let lowest = (singular - change * self.laplacian.sqrt()).max(0.0).powi(2);
        // The smooth bound in place of the index lies below it by at most this factor.
        let factor = RigidityFunction::largest_gap(dimension.max_rank(graph.num_nodes()));
        lowest < factor * least * 2.0 * squares(change)
    }

    /// Functions that could have become active in this step.
    pub(super) fn kept(&self) -> &[ConstraintFunction] {
        &self.kept
    }

    /// The previous configuration with all free nodes shifted alike so that the centre of mass
    /// is above its target, written into `x`.
    pub(super) fn first_guess(&self, x: &mut Vec<f64>) {
        let (robot, dimension) = (self.robot, self.robot.dimension());
        let axes = dimension.axes();
        let mass: f64 = self
            .free
            .iter()
            .map(|&node| robot.mass_fractions()[node])
            .sum();
        let mut shift = self.target - robot.centre_of_mass(&self.previous);
        shift.z = 0.0;
        if mass > 0.0 {
            shift /= mass;
        }
        x.clear();
        for &node in &self.free {
            let position = dimension.node(&self.previous, node) + shift;
            x.extend((0..axes).map(|axis| dimension.component(&position, axis)));
        }
    }

    /// The configuration with the given free coordinates.
    pub(super) fn configuration(&mut self, x: &[f64]) -> &[f64] {
        self.write(x);
        &self.coordinates
    }

    fn write(&mut self, x: &[f64]) {
        let axes = self.robot.dimension().axes();
        for (from, &node) in x.chunks_exact(axes).zip(&self.free) {
            self.coordinates[axes * node..axes * (node + 1)].copy_from_slice(from);
        }
    }

    /// The length that the objective pulls member `member` towards.
    fn aim(&self, member: usize) -> f64 {
        match self.objective {
            GreedyObjective::LeastMotion => self.previous_lengths[member],
            GreedyObjective::NominalLengths(length) => length,
        }
    }

    /// Number of horizontal axes: rows for the target of the centre of mass.
    fn horizontal(&self) -> usize {
        self.robot.dimension().axes() - 1
    }

    /// Displacement of a free node from the previous configuration.
    fn displacement(&self, node: usize) -> Vector3<f64> {
        let dimension = self.robot.dimension();
        dimension.node(&self.coordinates, node) - dimension.node(&self.previous, node)
    }

    fn unit(&self, member: usize) -> Vector3<f64> {
        let [a, b] = self.robot.graph().members()[member];
        let dimension = self.robot.dimension();
        (dimension.node(&self.coordinates, a) - dimension.node(&self.coordinates, b)).normalize()
    }

    /// Adds a block to the Hessian, for two nodes.
    fn add_block(&mut self, a: usize, b: usize, block: &Matrix3<f64>) {
        let dimension = self.robot.dimension();
        let axes = dimension.axes();
        let (Some(row), Some(column)) = (self.place[a], self.place[b]) else {
            return;
        };
        if row < column {
            return;
        }
        // The axes of the plane are x and z.
        let axis = |k: usize| if axes == 2 { 2 * k } else { k };
        for i in 0..axes {
            let r = axes * row + i;
            let last = if row == column { i + 1 } else { axes };
            for j in 0..last {
                let entry = block[(axis(i), axis(j))];
                self.hessian[r * (r + 1) / 2 + axes * column + j] += entry;
            }
        }
    }

    /// Adds `scale` times the Hessian of a constraint function.
    fn add_function(&mut self, function: ConstraintFunction, scale: f64) {
        let nodes = function.nodes(self.robot);
        let positions = nodes.positions(self.robot, &self.coordinates);
        let blocks = function.hessian(self.robot.limits(), &positions);
        for (i, &a) in nodes.as_slice().iter().enumerate() {
            for (j, &b) in nodes.as_slice().iter().enumerate() {
                self.add_block(a, b, &(blocks[i][j] * scale));
            }
        }
    }

    /// Rows after those of the kept functions: target, steps, walls, rigidity.
    fn first_row_of_steps(&self) -> usize {
        self.kept.len() + self.horizontal()
    }

    /// What a row of the problem stands for.
    pub(super) fn describe(&self, row: usize, below: bool) -> StepRow {
        if let Some(function) = self.kept.get(row) {
            return StepRow::Physical(function.describe(self.robot, below));
        }
        if row < self.first_row_of_steps() {
            return StepRow::Target;
        }
        match self.free.get(row - self.first_row_of_steps()) {
            Some(&node) => StepRow::NodeStep(node),
            None if row < self.first_row_of_steps() + self.free.len() * (1 + self.walls.len()) => {
                StepRow::Obstacle
            }
            None => StepRow::Physical(crate::Constraint::Rigidity),
        }
    }
}

/// Largest eigenvalue of the Laplacian of a graph.
fn laplacian_norm(graph: &Graph) -> f64 {
    let mut laplacian = DMatrix::<f64>::zeros(graph.num_nodes(), graph.num_nodes());
    for &[a, b] in graph.members() {
        laplacian[(a, a)] += 1.0;
        laplacian[(b, b)] += 1.0;
        laplacian[(a, b)] -= 1.0;
        laplacian[(b, a)] -= 1.0;
    }
    laplacian.symmetric_eigenvalues().max()
}

/// What a row of a step problem stands for.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum StepRow {
    Physical(crate::Constraint),
    Target,
    NodeStep(usize),
    Obstacle,
}

impl Nlp for StepProblem<'_> {
    fn num_variables(&self) -> usize {
        self.free.len() * self.robot.dimension().axes()
    }

    fn num_constraints(&self) -> usize {
        self.first_row_of_steps()
            + self.free.len() * (1 + self.walls.len())
            + usize::from(self.least_rigidity.is_some())
    }

    fn variable_bounds(&self, lower: &mut [f64], _upper: &mut [f64]) {
        let axes = self.robot.dimension().axes();
        for height in lower.iter_mut().skip(axes - 1).step_by(axes) {
            *height = 0.0;
        }
    }

    fn constraint_bounds(&self, lower: &mut [f64], upper: &mut [f64]) {
        let limits = self.robot.limits();
        for (row, function) in self.kept.iter().enumerate() {
            (lower[row], upper[row]) = function.bounds(limits);
        }
        let mut row = self.kept.len();
        for axis in 0..self.horizontal() {
            let value = self.robot.dimension().component(&self.target, axis);
            (lower[row], upper[row]) = (value, value);
            row += 1;
        }
        for bound in &mut upper[row..row + self.free.len()] {
            *bound = 0.0;
        }
        row += self.free.len();
        for wall in &self.walls {
            for bound in &mut upper[row..row + self.free.len()] {
                *bound = wall.offset;
            }
            row += self.free.len();
        }
        if self.least_rigidity.is_some() {
            lower[row] = 0.0;
        }
    }

    fn jacobian_pattern(&self) -> TripletPattern {
        let axes = self.robot.dimension().axes();
        let mut pattern = TripletPattern::new();
        let mut row = 0;
        for function in &self.kept {
            for &node in function.nodes(self.robot).as_slice() {
                if let Some(place) = self.place[node] {
                    pattern.push_row(row, axes * place..axes * (place + 1));
                }
            }
            row += 1;
        }
        for axis in 0..self.horizontal() {
            pattern.push_row(row, (0..self.free.len()).map(|place| axes * place + axis));
            row += 1;
        }
        for _ in 0..=self.walls.len() {
            for place in 0..self.free.len() {
                pattern.push_row(row, axes * place..axes * (place + 1));
                row += 1;
            }
        }
        if self.least_rigidity.is_some() {
            pattern.push_row(row, 0..self.num_variables());
        }
        pattern
    }

    fn objective(&mut self, x: &[f64]) -> f64 {
        self.write(x);
        self.robot
            .lengths_into(&self.coordinates, &mut self.lengths);
        (0..self.lengths.len())
            .map(|m| (self.lengths[m] - self.aim(m)).powi(2))
            .sum()
    }

    fn gradient(&mut self, x: &[f64], gradient: &mut [f64]) {
        self.write(x);
        self.robot
            .lengths_into(&self.coordinates, &mut self.lengths);
        let dimension = self.robot.dimension();
        let axes = dimension.axes();
        gradient.fill(0.0);
        for member in 0..self.lengths.len() {
            let push = self.unit(member) * (2.0 * (self.lengths[member] - self.aim(member)));
            let [a, b] = self.robot.graph().members()[member];
            for (node, push) in [(a, push), (b, -push)] {
                if let Some(place) = self.place[node] {
                    for axis in 0..axes {
                        gradient[axes * place + axis] += dimension.component(&push, axis);
                    }
                }
            }
        }
    }

    fn constraints(&mut self, x: &[f64], values: &mut [f64]) {
        self.write(x);
        let robot = self.robot;
        let limits = robot.limits();
        for (value, function) in values.iter_mut().zip(&self.kept) {
            let positions = function.nodes(robot).positions(robot, &self.coordinates);
            *value = function.value(limits, &positions);
        }
        let mut row = self.kept.len();
        let centre = robot.centre_of_mass(&self.coordinates);
        for axis in 0..self.horizontal() {
            values[row] = robot.dimension().component(&centre, axis);
            row += 1;
        }
        let reach = limits.max_move;
        for &node in &self.free {
            let squared = self.displacement(node).norm_squared();
            values[row] = 0.5 * (squared - reach * reach) / reach;
            row += 1;
        }
        for wall in &self.walls {
            for &node in &self.free {
                values[row] = wall
                    .normal
                    .dot(&robot.dimension().node(&self.coordinates, node));
                row += 1;
            }
        }
        if let Some(least) = self.least_rigidity {
            let function = RigidityFunction::at(robot, &self.coordinates, least);
            values[row] = function.value();
            self.rigidity = Some(function);
        }
    }

    fn jacobian(&mut self, x: &[f64], values: &mut [f64]) {
        self.write(x);
        let robot = self.robot;
        let (limits, dimension) = (robot.limits(), robot.dimension());
        let axes = dimension.axes();
        let mut next = 0;
        let mut push = |vector: &Vector3<f64>| {
            for axis in 0..axes {
                values[next] = dimension.component(vector, axis);
                next += 1;
            }
        };
        for function in &self.kept {
            let nodes = function.nodes(robot);
            let gradient = function.gradient(limits, &nodes.positions(robot, &self.coordinates));
            for (&node, gradient) in nodes.as_slice().iter().zip(&gradient) {
                if self.place[node].is_some() {
                    push(gradient);
                }
            }
        }
        for _ in 0..self.horizontal() {
            for &node in &self.free {
                values[next] = robot.mass_fractions()[node];
                next += 1;
            }
        }
        let mut push = |vector: &Vector3<f64>| {
            for axis in 0..axes {
                values[next] = dimension.component(vector, axis);
                next += 1;
            }
        };
        for &node in &self.free {
            push(&(self.displacement(node) / limits.max_move));
        }
        for wall in &self.walls {
            for _ in &self.free {
                push(&wall.normal);
            }
        }
        // The derivatives are asked for where the values were.
        if let Some(function) = &self.rigidity {
            function.gradient(robot, &self.coordinates, &mut self.rigidity_gradient);
            for &node in &self.free {
                push(&dimension.node(&self.rigidity_gradient, node));
            }
        }
    }

    fn hessian_kind(&self) -> Hessian {
        Hessian::Lagrangian
    }

    fn hessian_pattern(&self) -> TripletPattern {
        TripletPattern::lower_triangle(self.num_variables())
    }

    fn hessian(&mut self, x: &[f64], weight: f64, multipliers: &[f64], values: &mut [f64]) {
        self.write(x);
        self.robot
            .lengths_into(&self.coordinates, &mut self.lengths);
        self.hessian.fill(0.0);
        for member in 0..self.lengths.len() {
            let [a, b] = self.robot.graph().members()[member];
            if self.place[a].is_none() && self.place[b].is_none() {
                continue;
            }
            let unit = self.unit(member);
            let outer = unit * unit.transpose();
            let stretch = 1.0 - self.aim(member) / self.lengths[member];
            let block = (outer + (Matrix3::identity() - outer) * stretch) * (2.0 * weight);
            self.add_block(a, a, &block);
            self.add_block(b, b, &block);
            self.add_block(a, b, &(-block));
            self.add_block(b, a, &(-block));
        }
        for row in 0..self.kept.len() {
            if multipliers[row] != 0.0 {
                self.add_function(self.kept[row], multipliers[row]);
            }
        }
        let first = self.first_row_of_steps();
        for place in 0..self.free.len() {
            let scale = multipliers[first + place] / self.robot.limits().max_move;
            let node = self.free[place];
            self.add_block(node, node, &Matrix3::from_diagonal_element(scale));
        }
        values.copy_from_slice(&self.hessian);
    }
}
