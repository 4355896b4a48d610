//! Greedy locomotion: one small optimisation a step moves the centre of mass towards the next
//! waypoint; where it would leave the support polygon, the robot rolls.
//!
//! Source: Usevitch et al., section IV. Three things go beyond the paper. A step that would carry
//! the centre of mass over a side ends exactly above it, so that the robot is balanced at every
//! configuration before it rolls. A step without solution is tried again at smaller sizes. And a
//! robot that is stuck goes back a few rolls, takes up a better posture (nominal lengths) and
//! tries another direction for a while ([`Persistence::Recover`]); what it goes back over is not
//! part of the walk.
//!
//! Obstacles are met twice: a route for the centre of mass leads around them, and in each step
//! the nodes stay on this side of a line that separates them from the obstacle.

mod options;
mod step;

use nalgebra::{Point2, Rotation3, Vector3};
use tensegra_optim::{DenseSqp, SqpOptions, SqpStatus};

use crate::obstacle::plan_view;
use crate::place::KeptClear;
use crate::route::route_around;
use crate::{Constraint, Dimension, Obstacle, Robot, Stance, Support, SupportedMotion};
pub use options::{
    GreedyError, GreedyObjective, GreedyOptions, GreedyStop, GreedyWalk, Persistence,
};
use step::{HalfPlane, StepProblem, StepRow};

/// Fractions of the step that are tried in turn.
const SHRINKING: [f64; 4] = [1.0, 0.4, 0.1, 0.02];
/// Those tried by a planner that can do better than creep on.
const SHRINKING_BEFORE_RECOVERY: usize = 3;
/// Constraints hold to this tolerance at every configuration.
const TOLERANCE: f64 = 1e-8;
/// Between configurations, lengths and angles may fall below their limits by this fraction.
const BETWEEN: f64 = 0.009;
/// Rolls after one another without a step between them.
const MAX_ROLLS: usize = 12;

/// Most steps towards a better posture.
const POSTURE_STEPS: usize = 60;
/// Directions tried by a robot that is stuck, relative to that of its goal, in radians.
const DETOUR_ANGLES: [f64; 7] = [0.0, 0.7, -0.7, 1.4, -1.4, 2.1, -2.1];
/// Most steps in such a direction.
const DETOUR_STEPS: usize = 150;
/// A detour is this many times the robot's size, times one, two or three.
const DETOUR_LENGTH: f64 = 0.3;

/// Plans greedy walks of one robot.
#[derive(Debug)]
pub struct GreedyPlanner<'a> {
    robot: &'a Robot,
    options: GreedyOptions,
    obstacles: &'a [Obstacle],
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
    /// Configuration at which each waypoint was reached.
    arrivals: Vec<usize>,
    recoveries: usize,
}

impl State {
    fn new(start: &Stance) -> Self {
        Self {
            coordinates: start.coordinates.clone(),
            support: start.support.clone(),
            motion: SupportedMotion {
                configurations: vec![start.coordinates.clone()],
                supports: vec![start.support.clone()],
                rolls: Vec::new(),
            },
            arrivals: Vec::new(),
            recoveries: 0,
        }
    }

    fn push(&mut self) {
        self.motion.configurations.push(self.coordinates.clone());
    }

    /// Goes back to the configuration after the last roll but `rolls`.
    fn rewind(&mut self, rolls: usize) {
        let kept = self.motion.rolls.len().saturating_sub(rolls);
        let last = kept
            .checked_sub(1)
            .map_or(0, |roll| self.motion.rolls[roll] + 1);
        self.motion.rolls.truncate(kept);
        self.motion.supports.truncate(kept + 1);
        self.motion.configurations.truncate(last + 1);
        self.coordinates
            .copy_from_slice(&self.motion.configurations[last]);
        self.support = self.motion.supports[kept].clone();
        self.arrivals.retain(|&arrival| arrival <= last);
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
            obstacles: &[],
            problem: StepProblem::new(robot),
            solver,
            x: Vec::new(),
            candidate: Vec::new(),
            optimisations: 0,
            iterations: 0,
        })
    }

    /// Sets the obstacles to keep clear of.
    #[must_use]
    pub fn with_obstacles(mut self, obstacles: &'a [Obstacle]) -> Self {
        self.obstacles = obstacles;
        self
    }

    fn clearance(&self) -> f64 {
        self.options
            .obstacle_clearance
            .unwrap_or(0.5 * self.robot.limits().min_distance)
    }

    fn check_input(&self, start: &Stance, waypoints: &[[f64; 2]]) -> Result<(), GreedyError> {
        let robot = self.robot;
        start.support.validate(robot, &start.coordinates, 1e-6)?;
        let violations = robot.violations(&start.coordinates, 1e-6);
        if let Some((constraint, violation)) = violations.into_iter().next() {
            return Err(GreedyError::StartInfeasible {
                constraint,
                violation,
            });
        }
        if robot.dimension() == Dimension::Two && !self.obstacles.is_empty() {
            return Err(GreedyError::PlanarObstacles);
        }
        let points = waypoints.iter().map(|&[x, y]| Point2::new(x, y));
        KeptClear {
            obstacles: self.obstacles,
            clearance: self.clearance(),
        }
        .check(robot, start, points)?;
        Ok(())
    }

    /// Walks from `start` to the waypoints one after another. In the plane the second coordinate
    /// of a waypoint is ignored.
    ///
    /// # Errors
    /// A start that does not stand, violates a limit or touches an obstacle; a waypoint that is
    /// not finite or lies in an obstacle. That a waypoint could not be reached is not an error:
    /// see [`GreedyWalk::stop`].
    pub fn walk(
        &mut self,
        start: &Stance,
        waypoints: &[[f64; 2]],
    ) -> Result<GreedyWalk, GreedyError> {
        self.check_input(start, waypoints)?;
        self.optimisations = 0;
        self.iterations = 0;
        let mut state = State::new(start);
        let stop = self.walk_through(&mut state, waypoints);
        Ok(GreedyWalk {
            motion: state.motion,
            stop,
            reached: state.arrivals.len(),
            optimisations: self.optimisations,
            iterations: self.iterations,
            recoveries: state.recoveries,
        })
    }

    fn walk_through(&mut self, state: &mut State, waypoints: &[[f64; 2]]) -> GreedyStop {
        let mut troubles = 0;
        // The farthest that the walk has come: waypoints reached, distance to the next.
        let mut best = (0, f64::INFINITY);
        let mut route: Vec<Point2<f64>> = Vec::new();
        loop {
            let waypoint = state.arrivals.len();
            let Some(&[x, y]) = waypoints.get(waypoint) else {
                return GreedyStop::Arrived;
            };
            if state.motion.configurations.len() >= self.options.max_configurations {
                return GreedyStop::TooLong { waypoint };
            }
            let goal = Point2::new(x, y);
            let distance = self.offset(state, &goal).norm();
            if distance <= self.options.waypoint_tolerance {
                state.arrivals.push(state.motion.configurations.len() - 1);
                route.clear();
                continue;
            }
            // Real progress earns back patience.
            if waypoint > best.0 || (waypoint == best.0 && distance < best.1 - 0.5) {
                best = (waypoint, distance);
                troubles = 0;
            }
            if route.last() != Some(&goal) {
                let Some(found) = self.route(state, goal) else {
                    return GreedyStop::NoRoute { waypoint };
                };
                route = found;
            }
            let near = |p: &Point2<f64>| self.offset(state, p).norm() <= 0.2 * self.size(state);
            if route.len() > 1 && near(&route[0]) {
                route.remove(0);
            }
            let outcome = self.advance(state, &route[0], self.options.objective);
            if matches!(outcome, Advance::Moved) {
                continue;
            }
            if self.options.persistence == Persistence::Recover && troubles < self.options.patience
            {
                self.recover(state, &goal, troubles);
                route.clear();
                state.recoveries += 1;
                troubles += 1;
                continue;
            }
            return match outcome {
                Advance::Blocked(active) => GreedyStop::Stuck { waypoint, active },
                _ => GreedyStop::CannotRoll { waypoint },
            };
        }
    }

    /// Horizontal reach of the robot around its centre of mass.
    fn size(&self, state: &State) -> f64 {
        let centre = self.robot.centre_of_mass(&state.coordinates).xy();
        let points = plan_view(self.robot, &state.coordinates);
        points
            .iter()
            .map(|p| (p.coords - centre).norm())
            .fold(0.0, f64::max)
    }

    /// A route around the obstacles, as wide as can be found.
    fn route(&self, state: &State, goal: Point2<f64>) -> Option<Vec<Point2<f64>>> {
        if self.obstacles.is_empty() {
            return Some(vec![goal]);
        }
        let start: Point2<f64> = self.robot.centre_of_mass(&state.coordinates).xy().into();
        let size = self.size(state);
        // The last part of the way may have to be narrower than the robot would like.
        [1.2, 0.9, 0.6, 0.3, 0.0].iter().find_map(|width| {
            let clearance = self.clearance() + width * size;
            route_around(start, goal, self.obstacles, clearance, 0.25 * size)
        })
    }

    /// Horizontal vector from the centre of mass to a goal.
    fn offset(&self, state: &State, goal: &Point2<f64>) -> Vector3<f64> {
        let centre = self.robot.centre_of_mass(&state.coordinates);
        let along = match self.robot.dimension() {
            Dimension::Two => 0.0,
            Dimension::Three => goal.y - centre.y,
        };
        Vector3::new(goal.x - centre.x, along, 0.0)
    }

    /// One step towards a goal, shrunk if necessary, and the rolls that follow from it.
    fn advance(
        &mut self,
        state: &mut State,
        goal: &Point2<f64>,
        objective: GreedyObjective,
    ) -> Advance {
        let factors: &[f64] = match self.options.persistence {
            Persistence::Stop => &SHRINKING[..1],
            Persistence::Shrink => &SHRINKING,
            Persistence::Recover => &SHRINKING[..SHRINKING_BEFORE_RECOVERY],
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
            match self.solve(state, centre + step * fraction, objective) {
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

    /// Rolls over a side, and on while the centre of mass is outside the new support. Nothing
    /// moves when one of these rolls cannot be made.
    fn roll(&mut self, state: &mut State, side: usize) -> Advance {
        let mut side = side;
        let mut made: Vec<(Vec<f64>, Support)> = Vec::new();
        for _ in 0..MAX_ROLLS {
            let (before, support) = made
                .last()
                .map_or((&state.coordinates, &state.support), |(x, support)| {
                    (x, support)
                });
            let mut after = before.clone();
            let Some(roll) = support.roll(self.robot, &mut after, side) else {
                return Advance::CannotRoll;
            };
            // Seen from above, every node stays between its places before and after the roll.
            let mut swept = plan_view(self.robot, before);
            swept.extend(plan_view(self.robot, &after));
            let clearance = self.clearance();
            if self
                .obstacles
                .iter()
                .any(|o| !(o.gap(&swept).distance > clearance))
            {
                return Advance::CannotRoll;
            }
            let centre = self.robot.centre_of_mass(&after);
            let (next, outside) =
                roll.support
                    .outermost_side(self.robot.dimension(), &after, &centre);
            made.push((after, roll.support));
            if outside <= 1e-9 {
                for (after, support) in made {
                    state
                        .motion
                        .rolls
                        .push(state.motion.configurations.len() - 1);
                    state.motion.supports.push(support.clone());
                    state.coordinates = after;
                    state.support = support;
                    state.push();
                }
                return Advance::Moved;
            }
            side = next;
        }
        Advance::CannotRoll
    }

    /// Lines that separate the robot from the obstacles within reach of a step.
    fn walls(&self, state: &State) -> Vec<HalfPlane> {
        if self.obstacles.is_empty() {
            return Vec::new();
        }
        let points = plan_view(self.robot, &state.coordinates);
        let clearance = self.clearance();
        self.obstacles
            .iter()
            .map(|obstacle| obstacle.gap(&points))
            .filter(|gap| gap.distance < clearance + self.robot.limits().max_move)
            .map(|gap| HalfPlane {
                normal: Vector3::new(gap.normal.x, gap.normal.y, 0.0),
                // Rounding must not put the robot beyond a line that it touches.
                offset: gap.offset - clearance.min(gap.distance),
            })
            .collect()
    }

    /// Solves one step and moves the state there; the constraints in the way if there is no
    /// solution.
    fn solve(
        &mut self,
        state: &mut State,
        target: Vector3<f64>,
        objective: GreedyObjective,
    ) -> Result<(), Vec<Constraint>> {
        let walls = self.walls(state);
        self.problem.prepare(
            &state.coordinates,
            &state.support,
            target,
            objective,
            &walls,
        );
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

    /// Gets out of a configuration from which no step leads on: goes back over some rolls, takes
    /// up a better posture there and walks another way for a while. `troubles` counts the
    /// attempts, which differ from each other and go back farther and farther.
    fn recover(&mut self, state: &mut State, goal: &Point2<f64>, troubles: usize) {
        if troubles > 0 {
            state.rewind(troubles.div_ceil(DETOUR_ANGLES.len()) - 1);
        }
        let nominal = GreedyObjective::NominalLengths(match self.options.objective {
            GreedyObjective::NominalLengths(length) => length,
            GreedyObjective::LeastMotion => {
                let lengths = self.robot.lengths(&state.motion.configurations[0]);
                lengths.iter().sum::<f64>() / lengths.len() as f64
            }
        });
        let centre = self.robot.centre_of_mass(&state.coordinates);
        for _ in 0..POSTURE_STEPS {
            if self.solve(state, centre, nominal).is_err() {
                break;
            }
            let before = &state.motion.configurations[state.motion.configurations.len() - 1];
            let change = before
                .iter()
                .zip(&state.coordinates)
                .fold(0.0_f64, |most, (a, b)| most.max((a - b).abs()));
            state.push();
            if change < 0.05 * self.robot.limits().max_move {
                break;
            }
        }
        if troubles == 0 {
            return;
        }
        let angle = DETOUR_ANGLES[troubles % DETOUR_ANGLES.len()];
        let length = DETOUR_LENGTH * (1 + troubles % 3) as f64 * self.size(state);
        let towards = Rotation3::from_axis_angle(&Vector3::z_axis(), angle)
            * self.offset(state, goal).normalize();
        let aside = Point2::from((centre + towards * length).xy());
        for _ in 0..DETOUR_STEPS {
            if self.offset(state, &aside).norm() <= self.options.waypoint_tolerance
                || !matches!(self.advance(state, &aside, nominal), Advance::Moved)
            {
                break;
            }
        }
    }
}
