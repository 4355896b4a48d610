//! The motion problem as the solver sees it: bounds, sparsity patterns, values and derivatives.

use nalgebra::Matrix3;
use tensegra_optim::{Hessian, Nlp, TripletPattern};

use super::{AXES, MotionProblem, Row};
use crate::Dimension;
use crate::constraint::ConstraintFunction;

impl Nlp for MotionProblem<'_> {
    fn num_variables(&self) -> usize {
        self.num_variables
    }

    fn num_constraints(&self) -> usize {
        self.rows.len()
    }

    fn variable_bounds(&self, lower: &mut [f64], _upper: &mut [f64]) {
        for height in lower.iter_mut().skip(2).step_by(AXES) {
            *height = 0.0;
        }
    }

    fn constraint_bounds(&self, lower: &mut [f64], upper: &mut [f64]) {
        for ((row, lower), upper) in self.rows.iter().zip(lower).zip(upper) {
            match row {
                Row::Function { function, .. } => {
                    (*lower, *upper) = function.bounds(self.robot.limits());
                }
                Row::Balance { tips, .. } => {
                    *upper = 0.0;
                    if *tips {
                        *lower = 0.0;
                    }
                }
                Row::Landing { distance, .. } => (*lower, *upper) = (*distance, *distance),
                Row::Move { .. } => *upper = 0.0,
                Row::Fall { limit, .. } => *upper = *limit,
                Row::TipChange { limit, .. } => (*lower, *upper) = (-limit, *limit),
                Row::Rigidity { .. } => *lower = 0.0,
                Row::Periodic { .. } | Row::Mirror { .. } => (*lower, *upper) = (0.0, 0.0),
            }
        }
    }

    fn jacobian_pattern(&self) -> TripletPattern {
        let mut pattern = TripletPattern::new();
        let mut push = |row: usize, slot: usize, node: usize| {
            if let Some(place) = self.slots[slot].place[node] {
                let first = self.slots[slot].offset + AXES * place;
                pattern.push_row(row, first..first + AXES);
            }
        };
        let nodes = self.robot.graph().num_nodes();
        for (index, row) in self.rows.iter().enumerate() {
            match row {
                Row::Function { slot, function } => {
                    for &node in function.nodes(self.robot).as_slice() {
                        push(index, *slot, node);
                    }
                }
                Row::Balance { slot, .. } | Row::Rigidity { slot, .. } => {
                    (0..nodes).for_each(|node| push(index, *slot, node));
                }
                Row::Landing { slot, landed, .. } => push(index, *slot, *landed),
                Row::Fall { slot, .. } => {
                    for slot in [*slot, slot + 1] {
                        (0..nodes).for_each(|node| push(index, slot, node));
                    }
                }
                Row::Move { slot, node, .. } => {
                    push(index, *slot, *node);
                    push(index, slot + 1, *node);
                }
                Row::TipChange { slot, member, .. } => {
                    let [a, b] = self.robot.graph().members()[*member];
                    for slot in [*slot, slot + 1] {
                        push(index, slot, a);
                        push(index, slot, b);
                    }
                }
                Row::Periodic { node, role, .. } => {
                    push(index, self.slots.len() - 1, *node);
                    push(index, 0, *role);
                }
                Row::Mirror {
                    slot,
                    node,
                    partner,
                    ..
                } => {
                    push(index, *slot, *node);
                    if partner != node {
                        push(index, *slot, *partner);
                    }
                }
            }
        }
        pattern
    }

    fn objective(&mut self, x: &[f64]) -> f64 {
        self.place(x);
        self.compute_lengths();
        let members = self.robot.graph().num_members();
        let mut total = 0.0;
        for pair in self.lengths.windows(2 * members).step_by(members) {
            let (here, next) = pair.split_at(members);
            let changes = here.iter().zip(next).map(|(a, b)| (b - a) * (b - a));
            total += changes.sum::<f64>();
        }
        total
    }

    fn gradient(&mut self, x: &[f64], gradient: &mut [f64]) {
        self.place(x);
        self.compute_lengths();
        self.compute_length_slopes();
        gradient.fill(0.0);
        let members = self.robot.graph().num_members();
        for (index, slot) in self.slots.iter().enumerate() {
            if slot.free.is_empty() {
                continue;
            }
            for member in 0..members {
                let slope = self.length_slopes[index * members + member];
                let push = self.direction(index, member) * slope;
                let [a, b] = self.robot.graph().members()[member];
                for (node, push) in [(a, push), (b, -push)] {
                    if let Some(place) = slot.place[node] {
                        let first = slot.offset + AXES * place;
                        for axis in 0..AXES {
                            gradient[first + axis] += push[axis];
                        }
                    }
                }
            }
        }
    }

    fn constraints(&mut self, x: &[f64], values: &mut [f64]) {
        self.place(x);
        self.compute_lengths();
        for (value, row) in values.iter_mut().zip(&self.rows) {
            *value = self.row_value(row);
        }
    }

    fn jacobian(&mut self, x: &[f64], values: &mut [f64]) {
        self.place(x);
        let rows = std::mem::take(&mut self.rows);
        let mut next = 0;
        for row in &rows {
            self.row_gradient(row, |_, gradient| {
                values[next..next + AXES].copy_from_slice(gradient.as_slice());
                next += AXES;
            });
        }
        self.rows = rows;
    }

    fn hessian_kind(&self) -> Hessian {
        Hessian::Lagrangian
    }

    fn hessian_pattern(&self) -> TripletPattern {
        let mut pattern = TripletPattern::new();
        for (index, slot) in self.slots.iter().enumerate() {
            let unknowns = AXES * slot.free.len();
            for row in 0..unknowns {
                pattern.push_row(slot.offset + row, slot.offset..=slot.offset + row);
            }
            if index > 0 {
                let before = &self.slots[index - 1];
                for row in 0..unknowns {
                    let columns = before.offset..before.offset + AXES * before.free.len();
                    pattern.push_row(slot.offset + row, columns);
                }
            }
        }
        pattern
    }

    fn hessian(&mut self, x: &[f64], weight: f64, multipliers: &[f64], values: &mut [f64]) {
        self.place(x);
        self.compute_lengths();
        self.compute_length_slopes();
        values.fill(0.0);
        let members = self.robot.graph().num_members();
        let last = self.slots.len() - 1;
        for slot in 0..=last {
            let neighbours = f64::from(u8::from(slot > 0)) + f64::from(u8::from(slot < last));
            for member in 0..members {
                let [a, b] = self.robot.graph().members()[member];
                let slope = self.length_slopes[slot * members + member];
                let function = ConstraintFunction::Length(member);
                self.add_function(values, slot, function, weight * slope);
                let here = self.direction(slot, member);
                let own = here * here.transpose() * (2.0 * weight * neighbours);
                for (p, q, sign) in [(a, a, 1.0), (b, b, 1.0), (a, b, -1.0), (b, a, -1.0)] {
                    self.add_diagonal(values, slot, (p, q), &(own * sign));
                }
                if slot > 0 {
                    let before = self.direction(slot - 1, member);
                    let cross = here * before.transpose() * (-2.0 * weight);
                    for (p, q, sign) in [(a, a, 1.0), (b, b, 1.0), (a, b, -1.0), (b, a, -1.0)] {
                        self.add_below(values, slot, (p, q), &(cross * sign));
                    }
                }
            }
        }
        for (row, &multiplier) in self.rows.iter().zip(multipliers) {
            if multiplier == 0.0 {
                continue;
            }
            match row {
                Row::Function { slot, function } => {
                    self.add_function(values, *slot, *function, multiplier);
                }
                Row::Landing {
                    slot,
                    landed,
                    pivot,
                    ..
                } => {
                    let node = Dimension::Three.node(self.slot_coordinates(*slot), *landed);
                    let (unit, length) = ((node - pivot).normalize(), (node - pivot).norm());
                    let block = (Matrix3::identity() - unit * unit.transpose()) / length;
                    let nodes = (*landed, *landed);
                    self.add_diagonal(values, *slot, nodes, &(block * multiplier));
                }
                Row::Move { slot, node, limit } => {
                    let block = Matrix3::from_diagonal_element(multiplier / limit);
                    self.add_diagonal(values, *slot, (*node, *node), &block);
                    self.add_diagonal(values, slot + 1, (*node, *node), &block);
                    self.add_below(values, slot + 1, (*node, *node), &(-block));
                }
                Row::TipChange { slot, member, .. } => {
                    let function = ConstraintFunction::Length(*member);
                    self.add_function(values, *slot, function, -multiplier);
                    self.add_function(values, slot + 1, function, multiplier);
                }
                Row::Balance { .. }
                | Row::Fall { .. }
                | Row::Rigidity { .. }
                | Row::Periodic { .. }
                | Row::Mirror { .. } => {}
            }
        }
    }
}
