//! Greedy locomotion: one small optimisation a step moves the centre of mass towards the next
//! waypoint; where it would leave the support polygon, the robot rolls.
//!
//! Source: Usevitch et al., section IV. Three things go beyond the paper. A step that would carry
//! the centre of mass over a side ends exactly above it, so that the robot is balanced at every
//! configuration before it rolls. A step without solution is tried again at smaller sizes. And a
//! robot that is stuck takes up a better posture above the same point (nominal lengths), then
//! tries other directions for a while ([`Persistence::Recover`]).

mod step;

use nalgebra::{Rotation3, Vector3};
use tensegra_optim::{DenseSqp, SqpOptions, SqpStatus};
use thiserror::Error;

use crate::limits::setters;
use crate::{Constraint, Robot, Stance, Support, SupportError, SupportedMotion};
use step::{StepProblem, StepRow};

/// What a greedy step minimises.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum GreedyObjective {
    /// ‖L − L_previous‖², the motion of the actuators (28).
    LeastMotion,
    /// ‖L − l_N‖², the distance from a nominal length (29).
    NominalLengths(f64),
}

/// What the planner does when a step has no solution.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Persistence {
    /// Stops at once, as in the literature.
    Stop,
    /// Tries smaller steps, then stops.
    Shrink,
    /// Tries smaller steps, then a better posture, then other directions, then stops.
    Recover,
}

/// How greedy locomotion works.
///
/// # Examples
///
/// ```
/// use tensegra_lar::{GreedyObjective, GreedyOptions};
///
/// let options = GreedyOptions::default().with_objective(GreedyObjective::NominalLengths(1.0));
/// assert!(options.validate().is_ok());
/// assert!(options.with_step(0.0).validate().is_err());
/// ```
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct GreedyOptions {
    /// What a step minimises. Default: the motion of the actuators.
    pub objective: GreedyObjective,
    /// Distance that the centre of mass advances in a step. Default 0.02. It must stay below
    /// d_move times the mass fraction of the nodes that do not carry the robot.
    pub step: f64,
    /// A waypoint counts as reached at this horizontal distance of the centre of mass. Default
    /// 0.05.
    pub waypoint_tolerance: f64,
    /// Configurations after which the planner stops. Default 20 000.
    pub max_configurations: usize,
    /// What to do when a step has no solution. Default [`Persistence::Recover`].
    pub persistence: Persistence,
}

impl Default for GreedyOptions {
    fn default() -> Self {
        Self {
            objective: GreedyObjective::LeastMotion,
            step: 0.02,
            waypoint_tolerance: 0.05,
            max_configurations: 20_000,
            persistence: Persistence::Recover,
        }
    }
}

impl GreedyOptions {
    setters! {
        objective / with_objective: GreedyObjective;
        step / with_step: f64;
        waypoint_tolerance / with_waypoint_tolerance: f64;
        max_configurations / with_max_configurations: usize;
        persistence / with_persistence: Persistence;
    }

    /// Checks every option against its range.
    ///
    /// # Errors
    /// The first option outside its range.
    pub fn validate(&self) -> Result<(), GreedyError> {
        let positive = |name, value: f64| {
            if value > 0.0 && value.is_finite() {
                Ok(())
            } else {
                Err(GreedyError::Option { name, value })
            }
        };
        positive("step", self.step)?;
        positive("waypoint_tolerance", self.waypoint_tolerance)?;
        if let GreedyObjective::NominalLengths(length) = self.objective {
            positive("nominal length", length)?;
        }
        positive("max_configurations", self.max_configurations as f64)
    }
}

/// Why greedy planning cannot start.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum GreedyError {
    /// An option outside its range.
    #[error("the option `{name}` is {value}: it must be positive and finite")]
    Option {
        /// Name of the option.
        name: &'static str,
        /// The value given.
        value: f64,
    },
    /// The support does not carry the robot at the start.
    #[error("the start does not stand: {0}")]
    Support(#[from] SupportError),
    /// The start violates a limit.
    #[error(
        "the starting configuration violates the {constraint} by {violation}: change the start or the limits"
    )]
    StartInfeasible {
        /// The limit that is violated most.
        constraint: Constraint,
        /// By how much.
        violation: f64,
    },
    /// A waypoint is not finite.
    #[error("waypoint {index} is ({x}, {y}): give finite numbers")]
    Waypoint {
        /// Index of the waypoint.
        index: usize,
        /// First coordinate.
        x: f64,
        /// Second coordinate.
        y: f64,
    },
}

/// Why a greedy walk ended.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum GreedyStop {
    /// All waypoints were reached.
    Arrived,
    /// No step towards the waypoint meets all constraints.
    Stuck {
        /// The waypoint.
        waypoint: usize,
        /// Constraints that stand in the way of the last step tried.
        active: Vec<Constraint>,
    },
    /// A roll that nothing stops: no node lies beyond the side.
    CannotRoll {
        /// The waypoint.
        waypoint: usize,
    },
    /// The limit on configurations was reached.
    TooLong {
        /// The waypoint.
        waypoint: usize,
    },
}

/// A greedy walk.
#[derive(Debug, Clone, PartialEq)]
pub struct GreedyWalk {
    /// The motion, from the start to where the planner stopped.
    pub motion: SupportedMotion,
    /// Why it stopped.
    pub stop: GreedyStop,
    /// Waypoints reached.
    pub reached: usize,
    /// Optimisations solved, those without solution included.
    pub optimisations: usize,
    /// Iterations of all optimisations together.
    pub iterations: usize,
    /// Times that the planner was stuck and recovered.
    pub recoveries: usize,
}

/// Fractions of the step that are tried in turn.
const SHRINKING: [f64; 4] = [1.0, 0.4, 0.1, 0.02];
/// Constraints hold to this tolerance at every configuration.
const TOLERANCE: f64 = 1e-8;
/// Between configurations, lengths and angles may fall below their limits by this fraction.
const BETWEEN: f64 = 0.009;
/// Rolls after one another without a step between them.
const MAX_ROLLS: usize = 12;

/// Plans greedy walks of one robot.
#[derive(Debug)]
pub struct GreedyPlanner<'a> {
    robot: &'a Robot,
    options: GreedyOptions,
    problem: StepProblem<'a>,
    solver: DenseSqp,
    x: Vec<f64>,
    candidate: Vec<f64>,
    optimisations: usize,
    iterations: usize,
}

/// Where a walk stands.
struct State {
    coordinates: Vec<f64>,
    support: Support,
    motion: SupportedMotion,
    recoveries: usize,
}

impl State {
    fn push(&mut self) {
        self.motion.configurations.push(self.coordinates.clone());
    }
}

/// What became of an attempt to move on.
enum Advance {
    Moved,
    Blocked(Vec<Constraint>),
    CannotRoll,
}

impl<'a> GreedyPlanner<'a> {
    /// A planner for `robot`.
    ///
    /// # Errors
    /// An option outside its range.
    pub fn new(robot: &'a Robot, options: GreedyOptions) -> Result<Self, GreedyError> {
        options.validate()?;
        let sqp = SqpOptions::default()
            .with_max_iterations(40)
            .with_feasibility_tolerance(1e-9)
            .with_optimality_tolerance(1e-4)
            .with_initial_radius(2.0 * robot.limits().max_move);
        let solver = DenseSqp::new(sqp).expect("these options lie within their ranges");
        Ok(Self {
            robot,
            options,
            problem: StepProblem::new(robot),
            solver,
            x: Vec::new(),
            candidate: Vec::new(),
            optimisations: 0,
            iterations: 0,
        })
    }

    /// Walks from `start` to the waypoints one after another. In the plane the second coordinate
    /// of a waypoint is ignored.
    ///
    /// # Errors
    /// A start that does not stand or violates a limit, or a waypoint that is not finite. That a
    /// waypoint could not be reached is not an error: see [`GreedyWalk::stop`].
    pub fn walk(
        &mut self,
        start: &Stance,
        waypoints: &[[f64; 2]],
    ) -> Result<GreedyWalk, GreedyError> {
        let robot = self.robot;
        start.support.validate(robot, &start.coordinates, 1e-6)?;
        let violations = robot.violations(&start.coordinates, 1e-6);
        if let Some((constraint, violation)) = violations.into_iter().next() {
            return Err(GreedyError::StartInfeasible {
                constraint,
                violation,
            });
        }
        for (index, &[x, y]) in waypoints.iter().enumerate() {
            if !x.is_finite() || !y.is_finite() {
                return Err(GreedyError::Waypoint { index, x, y });
            }
        }
        self.optimisations = 0;
        self.iterations = 0;
        let mut state = State {
            coordinates: start.coordinates.clone(),
            support: start.support.clone(),
            motion: SupportedMotion {
                configurations: vec![start.coordinates.clone()],
                supports: vec![start.support.clone()],
                rolls: Vec::new(),
            },
            recoveries: 0,
        };
        let mut reached = 0;
        let mut stop = GreedyStop::Arrived;
        for (index, &[x, y]) in waypoints.iter().enumerate() {
            match self.walk_to(&mut state, index, Vector3::new(x, y, 0.0)) {
                None => reached += 1,
                Some(reason) => {
                    stop = reason;
                    break;
                }
            }
        }
        Ok(GreedyWalk {
            motion: state.motion,
            stop,
            reached,
            optimisations: self.optimisations,
            iterations: self.iterations,
            recoveries: state.recoveries,
        })
    }

    /// Walks to one waypoint; None when it is reached.
    fn walk_to(
        &mut self,
        state: &mut State,
        waypoint: usize,
        goal: Vector3<f64>,
    ) -> Option<GreedyStop> {
        let mut troubles = 0;
        let mut best = f64::INFINITY;
        loop {
            let distance = self.offset(state, &goal).norm();
            if distance <= self.options.waypoint_tolerance {
                return None;
            }
            if state.motion.configurations.len() >= self.options.max_configurations {
                return Some(GreedyStop::TooLong { waypoint });
            }
            // Real progress earns back patience.
            if distance < best - 0.5 {
                best = distance;
                troubles = 0;
            }
            match self.advance(state, &goal) {
                Advance::Moved => {}
                Advance::CannotRoll => return Some(GreedyStop::CannotRoll { waypoint }),
                Advance::Blocked(active) => {
                    if self.options.persistence != Persistence::Recover
                        || !self.recover(state, &goal, troubles)
                    {
                        return Some(GreedyStop::Stuck { waypoint, active });
                    }
                    state.recoveries += 1;
                    troubles += 1;
                }
            }
        }
    }

    /// Horizontal vector from the centre of mass to a goal.
    fn offset(&self, state: &State, goal: &Vector3<f64>) -> Vector3<f64> {
        let mut offset = goal - self.robot.centre_of_mass(&state.coordinates);
        offset.z = 0.0;
        if self.robot.dimension() == crate::Dimension::Two {
            offset.y = 0.0;
        }
        offset
    }

    /// One step towards a goal, shrunk if necessary, and the rolls that follow from it.
    fn advance(&mut self, state: &mut State, goal: &Vector3<f64>) -> Advance {
        let factors: &[f64] = match self.options.persistence {
            Persistence::Stop => &SHRINKING[..1],
            Persistence::Shrink | Persistence::Recover => &SHRINKING,
        };
        let centre = self.robot.centre_of_mass(&state.coordinates);
        let offset = self.offset(state, goal);
        let mut blocked = Vec::new();
        for factor in factors {
            let length = (factor * self.options.step).min(offset.norm());
            let step = offset.normalize() * length;
            let (fraction, tips) = self.until_side(state, &centre, &step);
            // Right at the side, nothing is left but to roll.
            if let Some(side) = tips
                && fraction * length < 1e-9
            {
                return self.roll(state, side);
            }
            match self.solve(state, centre + step * fraction, self.options.objective) {
                Ok(()) => {
                    state.push();
                    return match tips {
                        Some(side) => self.roll(state, side),
                        None => Advance::Moved,
                    };
                }
                Err(active) => blocked = active,
            }
        }
        Advance::Blocked(blocked)
    }

    /// The part of a step of the centre of mass that stays above the support, and the side where
    /// it would leave.
    fn until_side(
        &self,
        state: &State,
        centre: &Vector3<f64>,
        step: &Vector3<f64>,
    ) -> (f64, Option<usize>) {
        let mut result = (1.0, None);
        for side in 0..state.support.num_sides() {
            let line = state
                .support
                .side_line(self.robot.dimension(), &state.coordinates, side);
            let (inside, speed) = (-line.outside(centre), step.dot(&line.outward));
            if speed > 0.0 && inside - speed < 0.0 {
                let fraction = (inside / speed).clamp(0.0, 1.0);
                if fraction < result.0 {
                    result = (fraction, Some(side));
                }
            }
        }
        result
    }

    /// Rolls over a side, and on while the centre of mass is outside the new support.
    fn roll(&mut self, state: &mut State, side: usize) -> Advance {
        let mut side = side;
        for _ in 0..MAX_ROLLS {
            let before = state.motion.configurations.len() - 1;
            let Some(roll) = state.support.roll(self.robot, &mut state.coordinates, side) else {
                return Advance::CannotRoll;
            };
            state.support = roll.support;
            state.push();
            state.motion.rolls.push(before);
            state.motion.supports.push(state.support.clone());
            let centre = self.robot.centre_of_mass(&state.coordinates);
            let (next, outside) =
                state
                    .support
                    .outermost_side(self.robot.dimension(), &state.coordinates, &centre);
            if outside <= 1e-9 {
                return Advance::Moved;
            }
            side = next;
        }
        Advance::CannotRoll
    }

    /// Solves one step and moves the state there; the constraints in the way if there is no
    /// solution.
    fn solve(
        &mut self,
        state: &mut State,
        target: Vector3<f64>,
        objective: GreedyObjective,
    ) -> Result<(), Vec<Constraint>> {
        self.problem
            .prepare(&state.coordinates, &state.support, target, objective, &[]);
        self.problem.first_guess(&mut self.x);
        self.optimisations += 1;
        // The problem is well-formed and finite at the start, which is a valid configuration.
        let Ok(report) = self.solver.solve(&mut self.problem, &mut self.x) else {
            return Err(Vec::new());
        };
        self.iterations += report.iterations;
        if report.residuals.infeasibility > TOLERANCE {
            let unmet = match &report.status {
                SqpStatus::Infeasible(unmet) => unmet.as_slice(),
                _ => &[],
            };
            let mut active: Vec<Constraint> = Vec::new();
            let multipliers = self.solver.multipliers();
            let pressing = multipliers
                .iter()
                .enumerate()
                .filter(|(_, m)| m.abs() > 1e-6);
            let rows = unmet
                .iter()
                .map(|unmet| (unmet.constraint, unmet.violation < 0.0))
                .chain(pressing.map(|(row, multiplier)| (row, *multiplier < 0.0)));
            for (row, below) in rows {
                if let StepRow::Physical(constraint) = self.problem.describe(row, below)
                    && !active.contains(&constraint)
                {
                    active.push(constraint);
                }
            }
            return Err(active);
        }
        self.candidate.clear();
        self.candidate
            .extend_from_slice(self.problem.configuration(&self.x));
        if let Some(constraint) = self.dip(&state.coordinates) {
            return Err(vec![constraint]);
        }
        std::mem::swap(&mut state.coordinates, &mut self.candidate);
        Ok(())
    }

    /// A length or an angle that falls too far below its limit on the straight way from `before`
    /// to the candidate.
    fn dip(&self, before: &[f64]) -> Option<Constraint> {
        use crate::constraint::ConstraintFunction;
        let limits = self.robot.limits();
        self.problem.kept().iter().find_map(|function| {
            let nodes = function.nodes(self.robot);
            let from = nodes.positions(self.robot, before);
            let to = nodes.positions(self.robot, &self.candidate);
            let at = |time: f64| -> [Vector3<f64>; 4] {
                std::array::from_fn(|k| from[k].lerp(&to[k], time))
            };
            let too_low = match function {
                ConstraintFunction::Length(_) => {
                    let (edge, change) = (from[0] - from[1], (to[0] - to[1]) - (from[0] - from[1]));
                    let time = -edge.dot(&change) / change.norm_squared().max(f64::MIN_POSITIVE);
                    let lowest = (edge + change * time.clamp(0.0, 1.0)).norm();
                    lowest < (1.0 - BETWEEN) * limits.min_length
                }
                ConstraintFunction::Angle(_) => [0.25, 0.5, 0.75].iter().any(|&time| {
                    let p = at(time);
                    let (a, b) = (p[1] - p[0], p[2] - p[0]);
                    a.cross(&b).norm().atan2(a.dot(&b)) < (1.0 - BETWEEN) * limits.min_angle
                }),
                ConstraintFunction::Distance(_) => false,
            };
            too_low.then(|| function.describe(self.robot, true))
        })
    }

    /// Tries to get out of a configuration from which no step leads on; false when nothing helps.
    fn recover(&mut self, state: &mut State, goal: &Vector3<f64>, troubles: usize) -> bool {
        const POSTURE_STEPS: usize = 60;
        const DETOUR_ANGLES: [f64; 7] = [0.6, -0.6, 1.2, -1.2, 1.8, -1.8, 2.6];
        let nominal = match self.options.objective {
            GreedyObjective::NominalLengths(length) => length,
            GreedyObjective::LeastMotion => {
                let lengths = self.robot.lengths(&state.motion.configurations[0]);
                lengths.iter().sum::<f64>() / lengths.len() as f64
            }
        };
        // A better posture above the same point.
        let centre = self.robot.centre_of_mass(&state.coordinates);
        let mut moved = false;
        for _ in 0..POSTURE_STEPS {
            let before = state.coordinates.clone();
            if self
                .solve(state, centre, GreedyObjective::NominalLengths(nominal))
                .is_err()
            {
                break;
            }
            let change = before
                .iter()
                .zip(&state.coordinates)
                .fold(0.0_f64, |most, (a, b)| most.max((a - b).abs()));
            if change < 1e-4 {
                break;
            }
            state.push();
            moved = true;
        }
        if moved && troubles == 0 {
            return true;
        }
        // Another direction for a while, farther the more often nothing else helped.
        let Some(angle) = DETOUR_ANGLES.get(troubles % DETOUR_ANGLES.len()) else {
            return false;
        };
        if troubles >= 3 * DETOUR_ANGLES.len() {
            return false;
        }
        let length = 0.5 * (1 + troubles / DETOUR_ANGLES.len()) as f64;
        let direction = Rotation3::from_axis_angle(&Vector3::z_axis(), *angle)
            * self.offset(state, goal).normalize();
        let centre = self.robot.centre_of_mass(&state.coordinates);
        let aside = centre + direction * length;
        let mut progress = false;
        for _ in 0..200 {
            if self.offset(state, &aside).norm() <= self.options.waypoint_tolerance {
                break;
            }
            match self.advance(state, &aside) {
                Advance::Moved => progress = true,
                Advance::Blocked(_) | Advance::CannotRoll => break,
            }
        }
        progress || moved || troubles + 1 < 3 * DETOUR_ANGLES.len()
    }
}
