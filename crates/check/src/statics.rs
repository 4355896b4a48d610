//! Whether one configuration is an equilibrium of the structure within its ranges.
//!
//! Everything is evaluated in node coordinates, straight from the definitions: the unbalanced force
//! at a node is Σ f u + load over its elements, with u the unit vector from the node along the
//! element. One pass over the structure, no factorisation.

use nalgebra::{Point3, Vector3};
use tensegra_model::{Configuration, Coupling, Endpoint, ForceLaw, Interval, Problem, Structure};

use crate::{
    CheckOptions,
    report::{Check, Ledger, Location, Subject},
};

/// The vector from the first to the second node of an element.
pub(crate) fn axis(
    structure: &Structure,
    positions: &[Point3<f64>],
    element: usize,
) -> Vector3<f64> {
    let [a, b] = structure.elements[element].nodes;
    positions[b] - positions[a]
}

/// The largest force of any element.
pub(crate) fn largest_force(configuration: &Configuration) -> f64 {
    configuration
        .forces
        .iter()
        .flatten()
        .fold(0.0, |largest, force| force.abs().max(largest))
}

/// What the forces of a configuration are measured against.
pub(crate) fn force_scale(structure: &Structure, configuration: &Configuration) -> f64 {
    let scale = structure
        .nodes
        .iter()
        .fold(largest_force(configuration), |largest, node| {
            largest.max(node.load.norm())
        });
    if scale > 0.0 { scale } else { 1.0 }
}

/// How far a value lies outside a range, 0 inside. A constant is an equation, not a range.
fn excess(range: &Interval, value: f64) -> f64 {
    if range.is_constant() {
        return 0.0;
    }
    (-range.margin(value)).max(0.0)
}

pub(crate) struct Statics<'a> {
    pub(crate) problem: &'a Problem,
    pub(crate) options: &'a CheckOptions,
    /// Size of the structure, that lengths are measured against.
    pub(crate) size: f64,
    /// Unbalanced force of every node, scratch.
    unbalanced: Vec<Vector3<f64>>,
}

impl<'a> Statics<'a> {
    pub(crate) fn new(problem: &'a Problem, options: &'a CheckOptions, size: f64) -> Self {
        let unbalanced = vec![Vector3::zeros(); problem.structure.nodes.len()];
        Self {
            problem,
            options,
            size,
            unbalanced,
        }
    }

    /// Judges one configuration whose data are complete and finite.
    pub(crate) fn judge(
        &mut self,
        configuration: &Configuration,
        location: Location,
        ledger: &mut Ledger,
    ) {
        let force_scale = force_scale(&self.problem.structure, configuration);
        self.elements(configuration, force_scale, location, ledger);
        self.balance(configuration, force_scale, location, ledger);
        self.gauge(configuration, location, ledger);
        self.couplings(configuration, force_scale, location, ledger);
        self.attachments(configuration, location, ledger);
        if let Some(pretension) = self.problem.structure.pretension {
            let sum: f64 = configuration
                .forces
                .iter()
                .flatten()
                .map(|force| force * force)
                .sum();
            let error = (sum / (pretension * pretension) - 1.0).abs();
            let limit = self.options.equation_tolerance;
            ledger.judge(Check::Pretension, error, limit, location, Subject::None);
        }
    }

    fn elements(
        &self,
        configuration: &Configuration,
        force_scale: f64,
        location: Location,
        ledger: &mut Ledger,
    ) {
        let structure = &self.problem.structure;
        let equation = self.options.equation_tolerance;
        let mut held = |check, range: &Interval, value: f64, scale: f64, subject| {
            if range.is_constant() {
                let error = (value - range.lo).abs() / scale;
                ledger.judge(Check::Constants, error, equation, location, subject);
            } else {
                let margin = range.margin(value) / scale;
                ledger.judge(
                    check,
                    margin,
                    -self.options.range_tolerance,
                    location,
                    subject,
                );
            }
        };
        for (index, element) in structure.elements.iter().enumerate() {
            let subject = Subject::Element(index);
            held(
                Check::LengthRanges,
                &element.length,
                configuration.lengths[index],
                self.size,
                subject,
            );
            if let (Some(range), Some(rest)) = (element.rest(), configuration.rest_lengths[index]) {
                held(Check::RestRanges, &range, rest, self.size, subject);
            }
            if let (true, Some(force)) = (element.carries_force(), configuration.forces[index]) {
                held(
                    Check::ForceRanges,
                    &element.force,
                    force,
                    force_scale,
                    subject,
                );
            }
        }
        for (index, element) in structure.elements.iter().enumerate() {
            let subject = Subject::Element(index);
            let length = configuration.lengths[index];
            let measured = axis(structure, &configuration.positions, index).norm();
            let error = (length - measured).abs() / self.size;
            ledger.judge(Check::Lengths, error, equation, location, subject);
            let (shortest, floor) = (measured / self.size, self.options.min_length);
            ledger.judge(Check::ShortestElement, shortest, floor, location, subject);
            if let (ForceLaw::Linear { stiffness, .. }, Some(rest), Some(force)) = (
                element.law,
                configuration.rest_lengths[index],
                configuration.forces[index],
            ) {
                let pull = stiffness * (length - rest);
                // What can only pull hangs slack where it is shorter than its rest length.
                let slack = element.pulls_only() && length < rest;
                let error = (force - if slack { 0.0 } else { pull }).abs() / force_scale;
                ledger.judge(Check::HookesLaw, error, equation, location, subject);
            }
        }
        let forces = configuration.forces.iter().enumerate();
        let largest = forces
            .filter_map(|(index, force)| force.map(|force| (index, force.abs())))
            .max_by(|a, b| a.1.total_cmp(&b.1));
        if let Some((index, force)) = largest {
            ledger.report(
                Check::LargestForce,
                force,
                location,
                Subject::Element(index),
            );
        }
    }

    fn balance(
        &mut self,
        configuration: &Configuration,
        force_scale: f64,
        location: Location,
        ledger: &mut Ledger,
    ) {
        let structure = &self.problem.structure;
        for (sum, node) in self.unbalanced.iter_mut().zip(&structure.nodes) {
            *sum = node.load;
        }
        for (index, element) in structure.elements.iter().enumerate() {
            let Some(force) = configuration.forces[index].filter(|&force| force != 0.0) else {
                continue;
            };
            // NaN for an element without length that carries a force: no balance can be claimed.
            let pull = axis(structure, &configuration.positions, index).normalize() * force;
            self.unbalanced[element.nodes[0]] += pull;
            self.unbalanced[element.nodes[1]] -= pull;
        }
        let balanced = structure.nodes.iter().enumerate();
        for (index, _) in balanced.filter(|(_, node)| node.balanced) {
            let error = self.unbalanced[index].norm() / force_scale;
            let limit = self.options.balance_tolerance;
            ledger.judge(Check::Balance, error, limit, location, Subject::Node(index));
        }
    }

    fn gauge(&self, configuration: &Configuration, location: Location, ledger: &mut Ledger) {
        let structure = &self.problem.structure;
        let limit = self.options.equation_tolerance;
        let mut held = |node: usize, axis: usize, value: f64| {
            let error = (configuration.positions[node][axis] - value).abs() / self.size;
            ledger.judge(Check::Gauge, error, limit, location, Subject::Node(node));
        };
        for fixed in &structure.fixed {
            held(fixed.node, fixed.axis, fixed.value);
        }
        if structure.dimension == 2 {
            (0..structure.nodes.len()).for_each(|node| held(node, 2, 0.0));
        }
        if let Some(half) = structure.base_range {
            let base = configuration.positions[0];
            let margin = (0..structure.dimension)
                .map(|axis| (half[axis] - base[axis].abs()) / self.size)
                .fold(f64::INFINITY, f64::min);
            let limit = -self.options.range_tolerance;
            ledger.judge(Check::BaseRange, margin, limit, location, Subject::Node(0));
        }
    }

    fn couplings(
        &self,
        configuration: &Configuration,
        force_scale: f64,
        location: Location,
        ledger: &mut Ledger,
    ) {
        let structure = &self.problem.structure;
        let limit = self.options.equation_tolerance;
        for (index, coupling) in structure.couplings.iter().enumerate() {
            let mut enter = |follower: usize, error: f64| {
                let subject = Subject::Coupling(index, follower);
                ledger.judge(Check::Couplings, error, limit, location, subject);
            };
            let mut scalar = |values: &dyn Fn(usize) -> f64,
                              scale: f64,
                              reference: usize,
                              followers: &[(usize, f64)]| {
                for &(follower, factor) in followers {
                    let error = values(reference) - factor * values(follower);
                    enter(follower, error.abs() / scale);
                }
            };
            // Absent values were refused with the data, so NaN is never met.
            let rest = |e: usize| configuration.rest_lengths[e].unwrap_or(f64::NAN);
            let force = |e: usize| configuration.forces[e].unwrap_or(f64::NAN);
            match coupling {
                Coupling::Length {
                    reference,
                    followers,
                } => {
                    scalar(
                        &|e| configuration.lengths[e],
                        self.size,
                        *reference,
                        followers,
                    );
                }
                Coupling::Rest {
                    reference,
                    followers,
                } => {
                    scalar(&rest, self.size, *reference, followers);
                }
                Coupling::Force {
                    reference,
                    followers,
                } => {
                    scalar(&force, force_scale, *reference, followers);
                }
                Coupling::Orientation {
                    reference,
                    followers,
                } => {
                    let direction =
                        |e: usize| axis(structure, &configuration.positions, e).normalize();
                    for (follower, rotation) in followers {
                        let error = direction(*reference) - rotation * direction(*follower);
                        enter(*follower, error.norm());
                    }
                }
            }
        }
    }

    fn attachments(&self, configuration: &Configuration, location: Location, ledger: &mut Ledger) {
        let limit = self.options.equation_tolerance;
        for (index, attachment) in self.problem.structure.attachments.iter().enumerate() {
            for (i, j) in [(0, 1), (1, 2), (2, 0)] {
                let [a, b] = [&attachment.anchors[i], &attachment.anchors[j]];
                let positions = &configuration.positions;
                let distance = (positions[a.node] - positions[b.node]).norm();
                let error = (distance - (a.local - b.local).norm()).abs() / self.size;
                ledger.judge(
                    Check::Attachments,
                    error,
                    limit,
                    location,
                    Subject::Attachment(index),
                );
            }
        }
    }

    /// Judges the ranges of a configuration between samples.
    pub(crate) fn judge_between(
        &self,
        configuration: &Configuration,
        location: Location,
        ledger: &mut Ledger,
    ) {
        let structure = &self.problem.structure;
        let force_scale = force_scale(structure, configuration);
        let limit = self.options.range_tolerance_between;
        for (index, element) in structure.elements.iter().enumerate() {
            let mut outside = excess(&element.length, configuration.lengths[index]) / self.size;
            if let (Some(range), Some(rest)) = (element.rest(), configuration.rest_lengths[index]) {
                outside = outside.max(excess(&range, rest) / self.size);
            }
            if let (true, Some(force)) = (element.carries_force(), configuration.forces[index]) {
                outside = outside.max(excess(&element.force, force) / force_scale);
            }
            let subject = Subject::Element(index);
            ledger.judge(Check::RangesBetween, outside, limit, location, subject);
        }
        if let Some(half) = structure.base_range {
            let base = configuration.positions[0];
            let outside = (0..structure.dimension)
                .map(|axis| (base[axis].abs() - half[axis]) / self.size)
                .fold(0.0, f64::max);
            ledger.judge(
                Check::RangesBetween,
                outside,
                limit,
                location,
                Subject::Node(0),
            );
        }
    }

    /// Judges how far a configuration is from an endpoint that the problem states: nodes, and
    /// forces and rest lengths where they are stated.
    ///
    /// Where the norm of all forces is prescribed, the stated forces count by their proportions:
    /// an endpoint may have been written down for another pretension.
    pub(crate) fn judge_endpoint(
        &self,
        [nodes, forces]: [Check; 2],
        endpoint: &Endpoint,
        configuration: &Configuration,
        location: Location,
        ledger: &mut Ledger,
    ) {
        let positions = endpoint.positions.iter().zip(&configuration.positions);
        for (index, (stated, actual)) in positions.enumerate() {
            let error = (stated - actual).norm() / self.size;
            let limit = self.options.endpoint_tolerance;
            ledger.judge(nodes, error, limit, location, Subject::Node(index));
        }

        let limit = self.options.endpoint_force_tolerance;
        let both = |stated: &[Option<f64>], actual: &[Option<f64>]| -> Vec<(usize, f64, f64)> {
            let each = stated.iter().zip(actual).enumerate();
            each.filter_map(|(index, (stated, actual))| Some((index, (*stated)?, (*actual)?)))
                .collect()
        };
        for (index, stated, actual) in both(&endpoint.rest_lengths, &configuration.rest_lengths) {
            let error = (stated - actual).abs() / self.size;
            ledger.judge(forces, error, limit, location, Subject::Element(index));
        }
        let pairs = both(&endpoint.forces, &configuration.forces);
        let norm = |value: fn(&(usize, f64, f64)) -> f64| {
            let norm = pairs
                .iter()
                .map(|pair| value(pair).powi(2))
                .sum::<f64>()
                .sqrt();
            if norm > 0.0 { norm } else { 1.0 }
        };
        let actual_norm = norm(|pair| pair.2);
        let stated_norm = match self.problem.structure.pretension {
            Some(_) => norm(|pair| pair.1),
            None => actual_norm,
        };
        for &(index, stated, actual) in &pairs {
            let error = (stated / stated_norm - actual / actual_norm).abs();
            ledger.judge(forces, error, limit, location, Subject::Element(index));
        }
    }
}
