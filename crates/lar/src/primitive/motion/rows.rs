//! Values, gradients and names of the rows of a motion problem.

use nalgebra::Vector3;

use super::{AXES, Ends, MotionProblem, Row, Slot};
use crate::Dimension;
use crate::constraint::RigidityFunction;

impl MotionProblem<'_> {
    pub(super) fn row_value(&self, row: &Row) -> f64 {
        let robot = self.robot;
        match row {
            Row::Function { slot, function } => {
                let nodes = function.nodes(robot);
                let positions = nodes.positions(robot, self.slot_coordinates(*slot));
                function.value(robot.limits(), &positions)
            }
            Row::Balance { slot, line, .. } => {
                line.outside(&robot.centre_of_mass(self.slot_coordinates(*slot)))
            }
            Row::Landing {
                slot,
                landed,
                pivot,
                ..
            } => (Dimension::Three.node(self.slot_coordinates(*slot), *landed) - pivot).norm(),
            Row::Move { slot, node, limit } => {
                let squared = self.displacement(*slot, *node).norm_squared();
                0.5 * (squared - limit * limit) / limit
            }
            Row::TipChange { slot, member, .. } => {
                let members = robot.graph().num_members();
                self.lengths[(slot + 1) * members + member] - self.lengths[slot * members + member]
            }
            Row::Fall { slot, .. } => {
                let height = |slot| robot.centre_of_mass(self.slot_coordinates(slot)).z;
                height(*slot) - height(slot + 1)
            }
            Row::Rigidity { slot, least } => {
                RigidityFunction::at(robot, self.slot_coordinates(*slot), *least).value()
            }
            Row::Periodic { node, role, axis } => {
                let Ends::Periodic { map, .. } = &self.ends else {
                    return 0.0;
                };
                let image = map.apply(&Dimension::Three.node(self.slot_coordinates(0), *role));
                let last = self.slot_coordinates(self.slots.len() - 1);
                Dimension::Three.node(last, *node)[*axis] - image[*axis]
            }
            Row::Mirror {
                slot,
                node,
                partner,
                direction,
            } => {
                let Some(mirror) = self.ends.mirror() else {
                    return 0.0;
                };
                let at = |node: usize| Dimension::Three.node(self.slot_coordinates(*slot), node);
                direction.dot(&(at(*node) - mirror.map.apply(&at(*partner))))
            }
        }
    }

    /// Displacement of a node from a configuration to the next.
    fn displacement(&self, slot: usize, node: usize) -> Vector3<f64> {
        Dimension::Three.node(self.slot_coordinates(slot + 1), node)
            - Dimension::Three.node(self.slot_coordinates(slot), node)
    }

    /// Calls `entry` with configuration, node and gradient for every node that a row depends on,
    /// in the same order at every point. Held nodes are left out.
    pub(super) fn row_gradient(&mut self, row: &Row, mut entry: impl FnMut(usize, Vector3<f64>)) {
        let robot = self.robot;
        let mut emit = |slots: &[Slot], slot: usize, node: usize, gradient: Vector3<f64>| {
            if let Some(place) = slots[slot].place[node] {
                entry(slots[slot].offset + AXES * place, gradient);
            }
        };
        match row {
            Row::Function { slot, function } => {
                let nodes = function.nodes(robot);
                let positions = nodes.positions(robot, self.slot_coordinates(*slot));
                let gradient = function.gradient(robot.limits(), &positions);
                for (&node, gradient) in nodes.as_slice().iter().zip(gradient) {
                    emit(&self.slots, *slot, node, gradient);
                }
            }
            Row::Balance { slot, line, .. } => {
                for (node, fraction) in robot.mass_fractions().iter().enumerate() {
                    emit(&self.slots, *slot, node, line.outward * *fraction);
                }
            }
            Row::Landing {
                slot,
                landed,
                pivot,
                ..
            } => {
                let node = Dimension::Three.node(self.slot_coordinates(*slot), *landed);
                emit(&self.slots, *slot, *landed, (node - pivot).normalize());
            }
            Row::Move { slot, node, limit } => {
                let gradient = self.displacement(*slot, *node) / *limit;
                emit(&self.slots, *slot, *node, -gradient);
                emit(&self.slots, slot + 1, *node, gradient);
            }
            Row::TipChange { slot, member, .. } => {
                let [a, b] = robot.graph().members()[*member];
                for (slot, sign) in [(*slot, -1.0), (slot + 1, 1.0)] {
                    let direction = self.direction(slot, *member) * sign;
                    emit(&self.slots, slot, a, direction);
                    emit(&self.slots, slot, b, -direction);
                }
            }
            Row::Fall { slot, .. } => {
                for (slot, sign) in [(*slot, 1.0), (slot + 1, -1.0)] {
                    for (node, fraction) in robot.mass_fractions().iter().enumerate() {
                        let gradient = Vector3::z() * (sign * fraction);
                        emit(&self.slots, slot, node, gradient);
                    }
                }
            }
            Row::Rigidity { slot, least } => {
                let mut gradient = std::mem::take(&mut self.rigidity_gradient);
                let coordinates = self.slot_coordinates(*slot);
                RigidityFunction::at(robot, coordinates, *least).gradient(
                    robot,
                    coordinates,
                    &mut gradient,
                );
                for node in 0..robot.graph().num_nodes() {
                    emit(
                        &self.slots,
                        *slot,
                        node,
                        Dimension::Three.node(&gradient, node),
                    );
                }
                self.rigidity_gradient = gradient;
            }
            Row::Periodic { node, role, axis } => {
                let Ends::Periodic { map, .. } = &self.ends else {
                    return;
                };
                let mut unit = Vector3::zeros();
                unit[*axis] = 1.0;
                let pulled_back = map.inverse().apply_direction(&unit);
                emit(&self.slots, self.slots.len() - 1, *node, unit);
                emit(&self.slots, 0, *role, -pulled_back);
            }
            Row::Mirror {
                slot,
                node,
                partner,
                direction,
            } => {
                let Some(mirror) = self.ends.mirror() else {
                    return;
                };
                let pulled_back = mirror.map.inverse().apply_direction(direction);
                if node == partner {
                    emit(&self.slots, *slot, *node, direction - pulled_back);
                } else {
                    emit(&self.slots, *slot, *node, *direction);
                    emit(&self.slots, *slot, *partner, -pulled_back);
                }
            }
        }
    }

    /// The physical constraint that a row of the problem stands for, for reports.
    pub(in crate::primitive) fn describe(&self, row: usize) -> String {
        match &self.rows[row] {
            Row::Function { slot, function } => {
                format!(
                    "{} at configuration {slot}",
                    function.describe(self.robot, true)
                )
            }
            Row::Balance {
                slot, tips: false, ..
            } => {
                format!("centre of mass inside the support at configuration {slot}")
            }
            Row::Balance { slot, .. } => {
                format!("centre of mass above the side rolled over at configuration {slot}")
            }
            Row::Landing { slot, landed, .. } => {
                format!("landing place of node {landed} at configuration {slot}")
            }
            Row::Move { slot, node, .. } => {
                format!("step of node {node} after configuration {slot}")
            }
            Row::TipChange { slot, member, .. } => {
                format!("length change of member {member} in the roll after configuration {slot}")
            }
            Row::Fall { slot, .. } => {
                format!("fall of the centre of mass in the roll after configuration {slot}")
            }
            Row::Rigidity { slot, .. } => format!("rigidity index at configuration {slot}"),
            Row::Periodic { node, .. } => format!("periodicity at node {node}"),
            Row::Mirror { slot, node, .. } => {
                format!("mirror symmetry of node {node} at configuration {slot}")
            }
        }
    }
}
