//! A form as a nonlinear programme in the coordinates of the `nodes` formulation.
//!
//! ```text
//! minimise    elastic energy, or nothing
//! subject to  force balance, constant lengths, pretension, couplings     = 0
//!             ranges of lengths, rest lengths and forces                 within
//!             clearance of every collision pair                          ≥ clearance
//!             distance of every node from every obstacle (if asked for)  ≥ node radius
//!             conditions on the form                                     within
//!             least tangent stiffness                                    ≥ least stiffness
//! ```
//!
//! All rows count in the manifold's units: lengths in multiples of the structure's size, forces in
//! multiples of its force unit. Inequalities can be tightened by a margin, and the rows of a group
//! weighted, which is how the cause of an infeasible problem is found.

use nalgebra::{Point3, Vector3};
use tensegra_atlas::{ImplicitManifold, SparseRow, Validity};
use tensegra_collision::{Capsule, capsule_solid};
use tensegra_model::{EquilibriumManifold, FormCondition, FormCost, Interval, Memory};
use tensegra_optim::{Hessian, Nlp, TripletPattern};

use crate::frame::{Frame, Group, Row};

/// The programme with its scratch memory: one for each thread.
pub(crate) struct Program<'f, 'a> {
    frame: &'f Frame<'a>,
    /// By how much inequalities are tightened, in the manifold's units.
    pub(crate) margin: f64,
    /// Whether the stability row takes part.
    pub(crate) stable: bool,
    /// Weight of the rows of a group that is relaxed; with weight 0 they do not count at all.
    pub(crate) relaxed: Option<(Group, f64)>,
    memory: Memory,
    clearances: Vec<f64>,
    positions: Vec<Point3<f64>>,
    densities: Vec<f64>,
    limits: Vec<f64>,
    equation_entries: Vec<f64>,
    dense: Vec<f64>,
    sparse: SparseRow,
    gradients: Vec<(usize, Vector3<f64>)>,
}

impl<'a> Frame<'a> {
    /// A programme with its own memory.
    pub(crate) fn program(&self) -> Program<'_, 'a> {
        let structure = self.manifold.structure();
        Program {
            frame: self,
            margin: 0.0,
            stable: false,
            relaxed: None,
            memory: self.free.memory(),
            clearances: vec![0.0; self.free.contact_count()],
            positions: vec![Point3::origin(); structure.nodes.len()],
            densities: vec![0.0; structure.elements.len()],
            limits: vec![0.0; self.manifold.limit_count()],
            equation_entries: vec![0.0; self.manifold.jacobian_pattern().len()],
            dense: vec![0.0; self.manifold.ambient_dimension()],
            sparse: SparseRow::default(),
            gradients: Vec::new(),
        }
    }
}

impl Program<'_, '_> {
    fn place(&mut self, x: &[f64]) {
        let manifold = self.frame.manifold;
        manifold.positions(x, &mut self.positions);
        for (element, density) in self.densities.iter_mut().enumerate() {
            *density = manifold.force_density(element, x);
        }
    }

    /// The least stiffness at x, in force per length.
    pub(crate) fn least_stiffness(&mut self, x: &[f64]) -> Option<f64> {
        self.place(x);
        let softest = self
            .frame
            .stability
            .softest(&self.positions, &self.densities)?;
        Some(softest.eigenvalue)
    }

    /// The smallest clearance at x, in units of length; infinite where nothing can collide.
    pub(crate) fn least_clearance(&mut self, x: &[f64]) -> f64 {
        self.frame
            .free
            .clearances(x, &mut self.memory, &mut self.clearances);
        self.clearances
            .iter()
            .copied()
            .fold(f64::INFINITY, f64::min)
    }

    /// The largest residual of the equations, and the largest violation of an inequality.
    pub(crate) fn violations(&mut self, x: &[f64]) -> (f64, f64) {
        let mut values = vec![0.0; self.frame.rows.len()];
        self.constraints(x, &mut values);
        let (mut equations, mut inequalities) = (0.0_f64, 0.0_f64);
        for (row, value) in self.frame.rows.iter().zip(&values) {
            if matches!(row.row, Row::Stiffness) && !self.stable {
                continue;
            }
            let worst = if row.range.is_constant() {
                &mut equations
            } else {
                &mut inequalities
            };
            *worst = worst.max(-row.range.margin(*value));
        }
        let manifold = self.frame.manifold;
        let bounds = manifold.lower_bounds().iter().zip(manifold.upper_bounds());
        for (value, (lower, upper)) in x.iter().zip(bounds) {
            inequalities = inequalities.max(lower - value).max(value - upper);
        }
        (equations, inequalities)
    }

    /// Weight of a row.
    fn weight(&self, group: Group) -> f64 {
        match self.relaxed {
            Some((relaxed, weight)) if relaxed == group => weight,
            _ => 1.0,
        }
    }

    fn tightened(&self, range: Interval) -> Interval {
        if range.is_constant() {
            return range;
        }
        let margin = self.margin.min(0.25 * (range.hi - range.lo));
        Interval::new(range.lo + margin, range.hi - margin)
    }

    fn elastic(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        let elements = &self.frame.manifold.structure().elements;
        elements
            .iter()
            .enumerate()
            .filter_map(|(e, element)| Some((e, element.stiffness()?)))
    }

    fn length(&self, element: usize) -> (Vector3<f64>, f64) {
        let [a, b] = self.frame.manifold.structure().elements[element].nodes;
        let d = self.positions[b] - self.positions[a];
        (d, d.norm())
    }

    fn value(&mut self, row: &Row, x: &[f64]) -> f64 {
        let frame = self.frame;
        let size = frame.manifold.size();
        match row {
            Row::Equation(_) | Row::Limit(_) => 0.0,
            // Far apart is far enough.
            Row::Contact(contact) => (self.clearances[*contact] / size).min(1e6),
            Row::Cylinders(cylinders) => cylinders.value(&self.positions),
            Row::NodeObstacle { node, solid } => {
                self.ball(*node, *solid).clearance.min(1e6 * size) / size
            }
            Row::Point { condition, axis } => match &frame.conditions[*condition] {
                FormCondition::Point { of, .. } => {
                    let sum: f64 = of
                        .iter()
                        .map(|&(node, weight)| weight * self.positions[node][*axis])
                        .sum();
                    sum / size
                }
                _ => 0.0,
            },
            Row::Image { condition, axis } => match &frame.conditions[*condition] {
                FormCondition::Image {
                    nodes: [a, b],
                    linear,
                    translation,
                } => {
                    let image = linear * self.positions[*a].coords + translation;
                    (image[*axis] - self.positions[*b][*axis]) / size
                }
                _ => 0.0,
            },
            Row::Condition(condition) => match &frame.conditions[*condition] {
                FormCondition::Distance { nodes: [a, b], .. } => {
                    (self.positions[*b] - self.positions[*a]).norm() / size
                }
                FormCondition::Length { element, .. } => self.length(*element).1 / size,
                FormCondition::RestLength { element, .. } => {
                    let length = self.length(*element).1;
                    let elements = &frame.manifold.structure().elements;
                    let stiffness = elements[*element].stiffness().unwrap_or(f64::INFINITY);
                    length * (1.0 - self.densities[*element] / stiffness) / size
                }
                FormCondition::Force { element, .. } => {
                    self.densities[*element] * self.length(*element).1 / frame.manifold.force_unit()
                }
                FormCondition::EqualLengths { elements: [a, b] } => {
                    (self.length(*a).1 - self.length(*b).1) / size
                }
                _ => 0.0,
            },
            Row::Stiffness => {
                if !self.stable {
                    return f64::INFINITY;
                }
                let _ = x;
                frame
                    .stability
                    .softest(&self.positions, &self.densities)
                    .map_or(1e6, |softest| softest.eigenvalue / frame.stiffness_unit)
            }
        }
    }

    fn ball(&self, node: usize, solid: usize) -> tensegra_collision::Contact {
        let point = self.positions[node];
        let capsule = Capsule {
            a: point,
            b: point,
            radius: 0.0,
        };
        capsule_solid(&capsule, &self.frame.solids[solid].1)
    }

    /// Adds the gradient of a function of positions and densities.
    fn gradient_of(&mut self, row: &Row, x: &[f64]) {
        let frame = self.frame;
        let manifold = frame.manifold;
        let size = manifold.size();
        self.gradients.clear();
        match row {
            Row::Equation(_) => {}
            Row::Limit(limit) => manifold.limit_gradient(*limit, x, &mut self.sparse),
            Row::Contact(contact) => {
                let found =
                    frame
                        .free
                        .clearance_gradient(*contact, &self.memory, &mut self.gradients);
                if found.is_none() {
                    self.gradients.clear();
                }
                for (_, gradient) in &mut self.gradients {
                    *gradient /= size;
                }
            }
            Row::Cylinders(cylinders) => {
                cylinders.gradient(&self.positions, &mut self.gradients);
            }
            Row::NodeObstacle { node, solid } => {
                let normal = self.ball(*node, *solid).normal;
                self.gradients.push((*node, normal / size));
            }
            Row::Point { condition, axis } => {
                if let FormCondition::Point { of, .. } = &frame.conditions[*condition] {
                    for &(node, weight) in of {
                        let mut gradient = Vector3::zeros();
                        gradient[*axis] = weight / size;
                        self.gradients.push((node, gradient));
                    }
                }
            }
            Row::Image { condition, axis } => {
                if let FormCondition::Image {
                    nodes: [a, b],
                    linear,
                    ..
                } = &frame.conditions[*condition]
                {
                    let mut unit = Vector3::zeros();
                    unit[*axis] = 1.0 / size;
                    self.gradients.push((*a, linear.transpose() * unit));
                    self.gradients.push((*b, -unit));
                }
            }
            Row::Condition(condition) => self.condition_gradient(&frame.conditions[*condition], x),
            Row::Stiffness => self.stiffness_gradient(x),
        }
        manifold.pull_back(x, &self.gradients, &mut self.sparse);
    }

    fn condition_gradient(&mut self, condition: &FormCondition, x: &[f64]) {
        let manifold = self.frame.manifold;
        let size = manifold.size();
        let elements = &manifold.structure().elements;
        match condition {
            FormCondition::Distance { nodes: [a, b], .. } => {
                let d = self.positions[*b] - self.positions[*a];
                let along = d.try_normalize(0.0).unwrap_or_else(Vector3::zeros) / size;
                self.gradients.extend([(*b, along), (*a, -along)]);
            }
            FormCondition::Length { element, .. } => self.along(*element, 1.0 / size),
            FormCondition::EqualLengths { elements: [a, b] } => {
                self.along(*a, 1.0 / size);
                self.along(*b, -1.0 / size);
            }
            FormCondition::RestLength { element, .. } => {
                let stiffness = elements[*element].stiffness().unwrap_or(f64::INFINITY);
                let (_, length) = self.length(*element);
                self.along(
                    *element,
                    (1.0 - self.densities[*element] / stiffness) / size,
                );
                let factor = -length / (stiffness * size);
                manifold.force_density_gradient(*element, x, factor, &mut self.sparse);
            }
            FormCondition::Force { element, .. } => {
                let unit = manifold.force_unit();
                let (_, length) = self.length(*element);
                self.along(*element, self.densities[*element] / unit);
                manifold.force_density_gradient(*element, x, length / unit, &mut self.sparse);
            }
            _ => {}
        }
    }

    /// Adds `factor` times the gradient of an element's length.
    fn along(&mut self, element: usize, factor: f64) {
        let [a, b] = self.frame.manifold.structure().elements[element].nodes;
        let (d, length) = self.length(element);
        if length > 0.0 {
            let gradient = d * (factor / length);
            self.gradients.extend([(b, gradient), (a, -gradient)]);
        }
    }

    fn stiffness_gradient(&mut self, x: &[f64]) {
        let frame = self.frame;
        if !self.stable {
            return;
        }
        let Some(softest) = frame.stability.softest(&self.positions, &self.densities) else {
            return;
        };
        let unit = frame.stiffness_unit;
        let elements = &frame.manifold.structure().elements;
        for (e, element) in elements.iter().enumerate() {
            let [a, b] = element.nodes;
            let gradient = softest.by_vector[e] / unit;
            self.gradients.extend([(b, gradient), (a, -gradient)]);
            if softest.by_density[e] != 0.0 {
                let factor = softest.by_density[e] / unit;
                frame
                    .manifold
                    .force_density_gradient(e, x, factor, &mut self.sparse);
            }
        }
        for ([a, b], gradient) in &softest.by_tie {
            self.gradients
                .extend([(*b, gradient / unit), (*a, -gradient / unit)]);
        }
    }
}

impl Nlp for Program<'_, '_> {
    fn num_variables(&self) -> usize {
        self.frame.manifold.ambient_dimension()
    }

    fn num_constraints(&self) -> usize {
        self.frame.rows.len()
    }

    fn variable_bounds(&self, lower: &mut [f64], upper: &mut [f64]) {
        let manifold = self.frame.manifold;
        let bounds = manifold.lower_bounds().iter().zip(manifold.upper_bounds());
        for ((&lo, &hi), (lower, upper)) in bounds.zip(lower.iter_mut().zip(upper)) {
            let range = self.tightened(Interval::new(lo, hi));
            (*lower, *upper) = (range.lo, range.hi);
        }
    }

    fn constraint_bounds(&self, lower: &mut [f64], upper: &mut [f64]) {
        for ((row, lower), upper) in self.frame.rows.iter().zip(lower).zip(upper) {
            let range = self.tightened(row.range);
            let weight = self.weight(row.group);
            (*lower, *upper) = if weight > 0.0 {
                (range.lo * weight, range.hi * weight)
            } else {
                (f64::NEG_INFINITY, f64::INFINITY)
            };
        }
    }

    fn jacobian_pattern(&self) -> TripletPattern {
        let mut pattern = TripletPattern::new();
        for (index, row) in self.frame.rows.iter().enumerate() {
            pattern.push_row(index, row.columns.iter().copied());
        }
        pattern
    }

    fn objective(&mut self, x: &[f64]) -> f64 {
        if self.frame.settings.cost == FormCost::None {
            return 0.0;
        }
        self.energy(x) / (self.frame.manifold.force_unit() * self.frame.manifold.size())
    }

    fn gradient(&mut self, x: &[f64], gradient: &mut [f64]) {
        gradient.fill(0.0);
        if self.frame.settings.cost == FormCost::None {
            return;
        }
        self.place(x);
        let manifold = self.frame.manifold;
        let unit = manifold.force_unit() * manifold.size();
        self.gradients.clear();
        self.sparse.clear();
        let elastic: Vec<(usize, f64)> = self.elastic().collect();
        for (e, stiffness) in elastic {
            // f ∇f / |k|, f = q l.
            let (_, length) = self.length(e);
            let factor = self.densities[e] * length / (stiffness.abs() * unit);
            self.along(e, factor * self.densities[e]);
            manifold.force_density_gradient(e, x, factor * length, &mut self.sparse);
        }
        manifold.pull_back(x, &self.gradients, &mut self.sparse);
        for &(column, value) in self.sparse.entries() {
            gradient[column] += value;
        }
    }

    fn constraints(&mut self, x: &[f64], values: &mut [f64]) {
        let frame = self.frame;
        let manifold = frame.manifold;
        self.place(x);
        frame
            .free
            .clearances(x, &mut self.memory, &mut self.clearances);
        let equations = manifold.equation_count();
        manifold.residual(x, &mut values[..equations]);
        manifold.limits(x, &mut self.limits);
        values[equations..equations + self.limits.len()].copy_from_slice(&self.limits);
        for (value, row) in values.iter_mut().zip(&frame.rows) {
            if !matches!(row.row, Row::Equation(_) | Row::Limit(_)) {
                *value = self.value(&row.row, x);
            }
            *value *= self.weight(row.group);
        }
    }

    fn jacobian(&mut self, x: &[f64], values: &mut [f64]) {
        let frame = self.frame;
        let manifold = frame.manifold;
        self.place(x);
        frame
            .free
            .clearances(x, &mut self.memory, &mut self.clearances);
        manifold.jacobian(x, &mut self.equation_entries);
        let (equations, others) = values.split_at_mut(self.equation_entries.len());
        equations.copy_from_slice(&self.equation_entries);
        let mut at = 0;
        for (index, row) in frame.rows.iter().enumerate() {
            let weight = self.weight(row.group);
            if index < manifold.equation_count() {
                if weight != 1.0 {
                    let range = manifold.jacobian_pattern().row_range(index);
                    equations[range].iter_mut().for_each(|v| *v *= weight);
                }
                continue;
            }
            self.sparse.clear();
            self.gradient_of(&row.row, x);
            for &(column, value) in self.sparse.entries() {
                self.dense[column] += value;
            }
            for &column in &row.columns {
                others[at] = weight * self.dense[column];
                at += 1;
            }
            for &(column, _) in self.sparse.entries() {
                self.dense[column] = 0.0;
            }
        }
    }

    fn hessian_kind(&self) -> Hessian {
        Hessian::QuasiNewton
    }
}

impl Program<'_, '_> {
    /// The elastic energy Σ f² / (2 |k|) at x.
    pub(crate) fn energy(&mut self, x: &[f64]) -> f64 {
        self.place(x);
        self.elastic()
            .map(|(e, stiffness)| {
                let force = self.densities[e] * self.length(e).1;
                0.5 * force * force / stiffness.abs()
            })
            .sum()
    }
}

#[cfg(test)]
mod tests;
