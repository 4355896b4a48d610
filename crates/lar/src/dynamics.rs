//! The dynamic check of a motion: point masses, actuators under PID control of their lengths,
//! contact with the ground, rolling.
//!
//! Source: Usevitch et al., section VII, equations (41) and (42), with the sign of the error put
//! right: e = L_d − L, so that positive gains and a positive force that lengthens the member
//! stabilise. The motion is run at constant speed over the given time. Nodes on the ground are
//! held; a node is released when its reaction would have to pull, and a node that meets the ground
//! stays there (an inelastic hit). The integrator is semi-implicit Euler. The error is the mean
//! distance of the nodes from the plan, over all times but those when fewer than d nodes carry the
//! robot and those of the planned roll itself, where the plan says nothing.
//!
//! Cost: O(duration/step × members).

use nalgebra::Vector3;
use thiserror::Error;

use crate::limits::setters;
use crate::{Dimension, Robot, SupportedMotion};

/// How a motion is simulated. Units: metres for lengths, kilograms, seconds, newtons.
///
/// # Examples
///
/// ```
/// use tensegra_lar::DynamicsOptions;
///
/// assert!(DynamicsOptions::default().validate().is_ok());
/// assert!(DynamicsOptions::default().with_time_step(0.0).validate().is_err());
/// ```
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct DynamicsOptions {
    /// Proportional gain K_p. Default 5000 N/m.
    pub proportional: f64,
    /// Derivative gain K_d. Default 200 N s/m.
    pub derivative: f64,
    /// Integral gain K_I. Default 1000 N/(m s).
    pub integral: f64,
    /// Mass of each node. Default 1 kg.
    pub node_mass: f64,
    /// Acceleration of gravity. Default 9.81 m/s².
    pub gravity: f64,
    /// Step of the integrator. Default 0.5 ms.
    pub time_step: f64,
    /// A node is released from the ground only when the force that lifts it exceeds this. Default
    /// 0.05 N. It keeps contacts from chattering near the tip.
    pub release_force: f64,
    /// Time to hold the last configuration after the motion. Default 0.2 s.
    pub settle: f64,
}

impl Default for DynamicsOptions {
    fn default() -> Self {
        Self {
            proportional: 5000.0,
            derivative: 200.0,
            integral: 1000.0,
            node_mass: 1.0,
            gravity: 9.81,
            time_step: 5e-4,
            release_force: 0.05,
            settle: 0.2,
        }
    }
}

/// An option outside its range, or a motion that cannot be simulated.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum DynamicsError {
    /// An option outside its range.
    #[error("the option `{name}` is {value}: it must {requirement}")]
    Option {
        /// Name of the option.
        name: &'static str,
        /// The value given.
        value: f64,
        /// What the value has to satisfy.
        requirement: &'static str,
    },
    /// Fewer than two configurations.
    #[error("the motion has {found} configuration(s): there is nothing to simulate")]
    NoMotion {
        /// Number of configurations.
        found: usize,
    },
    /// The simulation left the range of numbers: the gains are too large for the step.
    #[error("the simulation diverged after {time} s: lower the gains or the time step")]
    Diverged {
        /// Time at which it was noticed.
        time: f64,
    },
}

impl DynamicsOptions {
    setters! {
        proportional / with_proportional: f64;
        derivative / with_derivative: f64;
        integral / with_integral: f64;
        node_mass / with_node_mass: f64;
        gravity / with_gravity: f64;
        time_step / with_time_step: f64;
        release_force / with_release_force: f64;
        settle / with_settle: f64;
    }

    /// Checks every option against its range.
    ///
    /// # Errors
    /// The first option outside its range.
    pub fn validate(&self) -> Result<(), DynamicsError> {
        let require = |name, value: f64, positive: bool| {
            let met = value.is_finite() && if positive { value > 0.0 } else { value >= 0.0 };
            let requirement = if positive {
                "be positive"
            } else {
                "not be negative"
            };
            if met {
                Ok(())
            } else {
                Err(DynamicsError::Option {
                    name,
                    value,
                    requirement,
                })
            }
        };
        require("proportional", self.proportional, true)?;
        require("derivative", self.derivative, false)?;
        require("integral", self.integral, false)?;
        require("node_mass", self.node_mass, true)?;
        require("gravity", self.gravity, false)?;
        require("time_step", self.time_step, true)?;
        require("release_force", self.release_force, false)?;
        require("settle", self.settle, false)
    }
}

/// A change of contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactEvent {
    /// When.
    pub time: f64,
    /// The node.
    pub node: usize,
    /// Whether it came down (or lifted off).
    pub landed: bool,
    /// Speed at which it came down.
    pub speed: f64,
}

/// Outcome of a simulation.
#[derive(Debug, Clone, PartialEq)]
pub struct DynamicsReport {
    /// Mean distance of the nodes from the plan over the times that count.
    pub mean_error: f64,
    /// Largest mean (over the nodes) distance at any time that counts.
    pub largest_error: f64,
    /// Whether the robot has lost its way: nodes were farther from the plan than the least length
    /// of a member, as after a fall.
    pub lost: bool,
    /// Largest force of an actuator.
    pub peak_force: f64,
    /// Changes of contact.
    pub contacts: Vec<ContactEvent>,
    /// Time with fewer contacts than carry the robot.
    pub tipping_time: f64,
    /// Final coordinates.
    pub final_coordinates: Vec<f64>,
    /// Error over time: (time, mean distance of the nodes from the plan).
    pub errors: Vec<(f64, f64)>,
}

/// Every so many steps the error is recorded.
const RECORD_EVERY: usize = 20;

/// Runs a motion over `duration` seconds on a robot with PID-controlled actuators.
///
/// # Errors
/// See [`DynamicsError`].
pub fn simulate_motion(
    robot: &Robot,
    motion: &SupportedMotion,
    duration: f64,
    options: &DynamicsOptions,
) -> Result<DynamicsReport, DynamicsError> {
    options.validate()?;
    if !(duration > 0.0) || !duration.is_finite() {
        return Err(DynamicsError::Option {
            name: "duration",
            value: duration,
            requirement: "be positive",
        });
    }
    if motion.configurations.len() < 2 {
        return Err(DynamicsError::NoMotion {
            found: motion.configurations.len(),
        });
    }
    let mut simulation = Simulation::new(robot, motion, duration, options);
    let steps = ((duration + options.settle) / options.time_step).ceil() as usize;
    for step in 0..steps {
        simulation.advance(step)?;
    }
    Ok(simulation.report())
}

struct Simulation<'a> {
    robot: &'a Robot,
    motion: &'a SupportedMotion,
    duration: f64,
    options: &'a DynamicsOptions,
    planned_lengths: Vec<Vec<f64>>,
    positions: Vec<Vector3<f64>>,
    velocities: Vec<Vector3<f64>>,
    forces: Vec<Vector3<f64>>,
    grounded: Vec<bool>,
    error_integrals: Vec<f64>,
    contacts: Vec<ContactEvent>,
    errors: Vec<(f64, f64)>,
    error_sum: f64,
    error_time: f64,
    largest_error: f64,
    peak_force: f64,
    tipping_time: f64,
}

impl<'a> Simulation<'a> {
    fn new(
        robot: &'a Robot,
        motion: &'a SupportedMotion,
        duration: f64,
        options: &'a DynamicsOptions,
    ) -> Self {
        let nodes = robot.graph().num_nodes();
        let members = robot.graph().num_members();
        let start = &motion.configurations[0];
        Self {
            robot,
            motion,
            duration,
            options,
            planned_lengths: motion
                .configurations
                .iter()
                .map(|x| robot.lengths(x))
                .collect(),
            positions: (0..nodes)
                .map(|node| robot.dimension().node(start, node))
                .collect(),
            velocities: vec![Vector3::zeros(); nodes],
            forces: vec![Vector3::zeros(); nodes],
            grounded: (0..nodes)
                .map(|node| motion.supports[0].contains(node))
                .collect(),
            error_integrals: vec![0.0; members],
            contacts: Vec::new(),
            errors: Vec::new(),
            error_sum: 0.0,
            error_time: 0.0,
            largest_error: 0.0,
            peak_force: 0.0,
            tipping_time: 0.0,
        }
    }

    /// The planned configurations around a time, and the fraction of the way between them.
    fn plan_at(&self, time: f64) -> (usize, f64) {
        let intervals = self.motion.configurations.len() - 1;
        let position = (time / self.duration).clamp(0.0, 1.0) * intervals as f64;
        let index = (position as usize).min(intervals - 1);
        (index, position - index as f64)
    }

    fn advance(&mut self, step: usize) -> Result<(), DynamicsError> {
        let dt = self.options.time_step;
        let time = step as f64 * dt;
        let (index, fraction) = self.plan_at(time);
        self.apply_actuators(time, index, fraction);

        // Contacts that would have to pull let go.
        for node in 0..self.positions.len() {
            if self.grounded[node] && self.forces[node].z > self.options.release_force {
                self.grounded[node] = false;
                self.contacts.push(ContactEvent {
                    time,
                    node,
                    landed: false,
                    speed: 0.0,
                });
            }
        }
        for node in 0..self.positions.len() {
            if self.grounded[node] {
                continue;
            }
            self.velocities[node] += self.forces[node] * (dt / self.options.node_mass);
            self.positions[node] += self.velocities[node] * dt;
            if self.positions[node].z <= 0.0 && self.velocities[node].z < 0.0 {
                let speed = self.velocities[node].norm();
                self.positions[node].z = 0.0;
                self.velocities[node] = Vector3::zeros();
                self.grounded[node] = true;
                self.contacts.push(ContactEvent {
                    time,
                    node,
                    landed: true,
                    speed,
                });
            }
        }
        if !self.positions.iter().all(|p| p.norm() < 1e6) {
            return Err(DynamicsError::Diverged { time });
        }
        self.measure(step, time + dt);
        Ok(())
    }

    /// Forces on the nodes from gravity and actuators (41), (42).
    fn apply_actuators(&mut self, time: f64, index: usize, fraction: f64) {
        let options = self.options;
        let weight = Vector3::new(0.0, 0.0, -options.node_mass * options.gravity);
        self.forces.fill(weight);
        let intervals = (self.motion.configurations.len() - 1) as f64;
        let rate = if time < self.duration {
            intervals / self.duration
        } else {
            0.0
        };
        for (member, &[a, b]) in self.robot.graph().members().iter().enumerate() {
            let (from, to) = (
                self.planned_lengths[index][member],
                self.planned_lengths[index + 1][member],
            );
            let edge = self.positions[a] - self.positions[b];
            let length = edge.norm();
            let unit = edge / length;
            let error = from + fraction * (to - from) - length;
            let speed = unit.dot(&(self.velocities[a] - self.velocities[b]));
            let error_rate = rate * (to - from) - speed;
            self.error_integrals[member] += error * options.time_step;
            let force = options.proportional * error
                + options.derivative * error_rate
                + options.integral * self.error_integrals[member];
            self.peak_force = self.peak_force.max(force.abs());
            self.forces[a] += unit * force;
            self.forces[b] -= unit * force;
        }
    }

    fn measure(&mut self, step: usize, time: f64) {
        let dt = self.options.time_step;
        let carrying = self.grounded.iter().filter(|&&grounded| grounded).count();
        if carrying < self.robot.dimension().axes() {
            self.tipping_time += dt;
            return;
        }
        let (index, fraction) = self.plan_at(time);
        if self.motion.rolls.contains(&index) {
            return;
        }
        let (from, to) = (
            &self.motion.configurations[index],
            &self.motion.configurations[index + 1],
        );
        let dimension: Dimension = self.robot.dimension();
        let sum: f64 = self
            .positions
            .iter()
            .enumerate()
            .map(|(node, position)| {
                let planned = dimension
                    .node(from, node)
                    .lerp(&dimension.node(to, node), fraction);
                (position - planned).norm()
            })
            .sum();
        let error = sum / self.positions.len() as f64;
        self.error_sum += error * dt;
        self.error_time += dt;
        self.largest_error = self.largest_error.max(error);
        if step.is_multiple_of(RECORD_EVERY) {
            self.errors.push((time, error));
        }
    }

    fn report(self) -> DynamicsReport {
        let mut final_coordinates = vec![0.0; self.robot.num_coordinates()];
        for (node, position) in self.positions.iter().enumerate() {
            self.robot
                .dimension()
                .set_node(&mut final_coordinates, node, position);
        }
        DynamicsReport {
            mean_error: if self.error_time > 0.0 {
                self.error_sum / self.error_time
            } else {
                0.0
            },
            largest_error: self.largest_error,
            lost: self.largest_error > self.robot.limits().min_length,
            peak_force: self.peak_force,
            contacts: self.contacts,
            tipping_time: self.tipping_time,
            final_coordinates,
            errors: self.errors,
        }
    }
}
