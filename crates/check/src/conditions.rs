//! Whether a configuration is a form that was asked for: the conditions of form-finding, the
//! distance of nodes from obstacles, and stability.
//!
//! Evaluated from their definitions in node coordinates; one pass over the conditions, and one over
//! nodes and obstacles.

use nalgebra::{Point3, Vector3};
use tensegra_collision::{Capsule, capsule_solid};
use tensegra_model::{Configuration, FormCondition, Interval, Problem, Role};

use crate::{
    CheckOptions,
    report::{Check, ConditionList, Ledger, Location, Subject},
    stability::Stability,
    statics::force_scale,
};

/// Judges conditions on the form of configurations.
pub(crate) struct Conditions<'a> {
    pub(crate) problem: &'a Problem,
    pub(crate) options: &'a CheckOptions,
    /// Size of the structure, that lengths are measured against.
    pub(crate) size: f64,
}

impl Conditions<'_> {
    /// Judges the conditions on every form, and those of `further`, at one configuration.
    pub(crate) fn judge(
        &self,
        further: ConditionList,
        configuration: &Configuration,
        location: Location,
        stability: &mut Stability<'_>,
        ledger: &mut Ledger,
    ) {
        let lists = match further {
            ConditionList::Form => vec![ConditionList::Form],
            further => vec![ConditionList::Form, further],
        };
        for list in lists {
            for (index, condition) in list.of(self.problem).iter().enumerate() {
                let Some(violation) = self.violation(condition, configuration) else {
                    let message = "a condition names nodes or elements that do not exist";
                    ledger.tell(Check::Input, location, message.to_owned());
                    continue;
                };
                let subject = Subject::Condition(list, index);
                let limit = self.options.equation_tolerance;
                ledger.judge(Check::Conditions, violation, limit, location, subject);
            }
        }
        self.nodes(configuration, location, ledger);
        let least = self.problem.form.least_stiffness;
        if let (Some(least), Some(found)) = (least, stability.least_stiffness(configuration)) {
            ledger.judge(Check::Stability, found, least, location, Subject::None);
        }
    }

    /// Nodes as balls among the obstacles.
    fn nodes(&self, configuration: &Configuration, location: Location, ledger: &mut Ledger) {
        let Some(radius) = self.problem.form.node_radius else {
            return;
        };
        for (index, obstacle) in self.problem.environment.obstacles.iter().enumerate() {
            if obstacle.role == Role::Decoration {
                continue;
            }
            let Ok(solid) = obstacle.shape.solid() else {
                let message = format!("the obstacle {} has no valid shape", obstacle.name);
                ledger.tell(Check::Input, location, message);
                continue;
            };
            for (node, &center) in configuration.positions.iter().enumerate() {
                let ball = Capsule {
                    a: center,
                    b: center,
                    radius,
                };
                ledger.judge(
                    Check::NodeClearance,
                    capsule_solid(&ball, &solid).clearance,
                    -self.options.range_tolerance * self.size,
                    location,
                    Subject::NodeObstacle(node, index),
                );
            }
        }
    }

    /// How far a condition is missed: lengths over the size, forces over the largest force. `None`
    /// where it names what does not exist.
    fn violation(&self, condition: &FormCondition, configuration: &Configuration) -> Option<f64> {
        let structure = &self.problem.structure;
        let node = |i: usize| configuration.positions.get(i).copied();
        let length = |e: usize| {
            let [a, b] = structure.elements.get(e)?.nodes;
            Some((node(b)? - node(a)?).norm())
        };
        let outside = |range: &Interval, value: f64| (-range.margin(value)).max(0.0);
        Some(match condition {
            FormCondition::Point { of, at } => {
                let mut center = Point3::origin();
                for &(i, weight) in of {
                    center += node(i)?.coords * weight;
                }
                let axes = (0..3).filter_map(|axis| Some(outside(&at[axis]?, center[axis])));
                axes.fold(0.0, f64::max) / self.size
            }
            FormCondition::Distance {
                nodes: [a, b],
                range,
            } => outside(range, (node(*b)? - node(*a)?).norm()) / self.size,
            FormCondition::Length { element, range } => {
                outside(range, length(*element)?) / self.size
            }
            FormCondition::RestLength { element, range } => {
                let rest = configuration.rest_lengths.get(*element)?;
                rest.map_or(f64::INFINITY, |rest| outside(range, rest) / self.size)
            }
            FormCondition::Force { element, range } => {
                let force = configuration.forces.get(*element)?;
                let scale = force_scale(structure, configuration);
                force.map_or(f64::INFINITY, |force| outside(range, force) / scale)
            }
            FormCondition::EqualLengths { elements: [a, b] } => {
                (length(*a)? - length(*b)?).abs() / self.size
            }
            FormCondition::Image {
                nodes: [a, b],
                linear,
                translation,
            } => {
                let image: Vector3<f64> = linear * node(*a)?.coords + translation;
                (node(*b)?.coords - image).norm() / self.size
            }
            // A condition of a kind that is not known here is not known to hold.
            _ => f64::INFINITY,
        })
    }
}
