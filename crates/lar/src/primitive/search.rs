//! Solving for motion primitives: from a guess, from nothing, and by extension of shorter ones.
//!
//! The search from nothing needs no knowledge of the tip shape. It first solves a motion of two
//! steps (start, tip, end) from random placements of the free nodes; this finds candidate tip
//! shapes. Those that can be reached without members passing through each other on
//! the straight way come first, the cheaper before the dearer. They are carried on to a motion
//! with few steps and from there to the full one, by linear interpolation in a frame that turns
//! with the roll; a tip whose motion cannot be much cheaper than one found already is left out.
//! All attempts are reported.

use nalgebra::Vector3;
use rand::{Rng, RngExt};
use tensegra_optim::{DenseSqp, SparseSqp, SqpOptions, SqpReport, SqpStatus};

use super::between::tightened;
use super::motion::{Ends, MotionProblem, MotionSpec};
use super::sequence::{SequenceRoll, Stance, SymmetricRobot, Turn};
use super::{Primitive, PrimitiveError, PrimitiveOptions, SupportedMotion};
use crate::Robot;
use crate::support::{landing_angle, turn};

/// Steps of the coarse motion, and most iterations spent on it.
const COARSE_STEPS: usize = 14;
const COARSE_ITERATIONS: usize = 30;
/// Coarse motions dearer than the cheapest by more than this factor are not refined.
const WORTH_REFINING: f64 = 1.2;
/// Tip shapes whose costs agree this closely are the same.
const SAME_COST: f64 = 1e-3;
/// Constraints are met to this tolerance.
const FEASIBILITY: f64 = 1e-8;
/// One attempt of a search.
#[derive(Debug, Clone, PartialEq)]
pub struct PrimitiveAttempt {
    /// Number of steps of the motion: 2 for a tip shape.
    pub steps: usize,
    /// Objective of the final point.
    pub cost: f64,
    /// Largest violation of a constraint at the final point.
    pub violation: f64,
    /// Iterations of the solver.
    pub iterations: usize,
    /// Whether the solver converged.
    pub converged: bool,
}

impl PrimitiveAttempt {
    fn new(steps: usize, report: &SqpReport) -> Self {
        Self {
            steps,
            cost: report.objective,
            violation: report.residuals.infeasibility,
            iterations: report.iterations,
            converged: report.is_converged(),
        }
    }

    /// Whether the final point meets all constraints.
    #[must_use]
    pub fn is_feasible(&self) -> bool {
        self.violation <= 1e-6
    }
}

/// Outcome of a search for a primitive: the best and all attempts.
#[derive(Debug, Clone, PartialEq)]
pub struct PrimitiveSearch {
    /// The best motion found.
    pub best: Primitive,
    /// All attempts in the order in which they were made.
    pub attempts: Vec<PrimitiveAttempt>,
}

/// The parts that all problems of one sequence share.
pub(super) struct Sequence<'a> {
    pub robot: &'a Robot,
    pub stances: Vec<Stance>,
    pub rolls: Vec<SequenceRoll>,
}

impl<'a> Sequence<'a> {
    pub(super) fn new(
        symmetric: &'a SymmetricRobot,
        turns: &[Turn],
    ) -> Result<Self, PrimitiveError> {
        let (stances, rolls) = symmetric.sequence(turns).ok_or(PrimitiveError::Sequence)?;
        let robot = symmetric.robot();
        for stance in &stances {
            if let Some((constraint, violation)) = robot
                .violations(&stance.coordinates, FEASIBILITY)
                .into_iter()
                .next()
            {
                let constraint = constraint.to_string();
                return Err(PrimitiveError::StartInfeasible {
                    constraint,
                    violation,
                });
            }
        }
        Ok(Self {
            robot,
            stances,
            rolls,
        })
    }

    /// Length of the sides of the support triangles.
    fn side(&self) -> f64 {
        let Stance {
            coordinates,
            support,
        } = &self.stances[0];
        let at = |k: usize| self.robot.dimension().node(coordinates, support.nodes()[k]);
        (at(1) - at(0)).norm()
    }

    /// The problem with `steps` steps a roll, for this robot or one with tighter limits. The bound
    /// on node steps grows with their size, so that a coarse motion may go as far as a fine one.
    pub(super) fn problem<'r>(
        &self,
        robot: &'r Robot,
        options: &PrimitiveOptions,
        (steps, tip): (usize, usize),
        ends: Ends,
    ) -> MotionProblem<'r> {
        let coarseness = options.steps as f64 / steps as f64;
        MotionProblem::new(
            robot,
            &MotionSpec {
                stances: &self.stances,
                rolls: &self.rolls,
                steps,
                tip,
                max_move: (steps > 2).then_some(self.robot.limits().max_move * coarseness),
                max_tip_change: options.max_tip_change.filter(|_| steps > 2),
                max_fall: options
                    .max_fall
                    .filter(|_| ends.has_soft_rolls())
                    .map(|fall| fall * self.side()),
                ends,
            },
        )
    }

    /// The shape `tip` before a roll, turned over the side so that the landing node stands where
    /// the next stance has it.
    pub(super) fn after_roll(&self, roll: usize, tip: &[f64]) -> Vec<f64> {
        let (stance, next) = (&self.stances[roll], &self.stances[roll + 1]);
        let SequenceRoll {
            side,
            pivots,
            landed,
            ..
        } = &self.rolls[roll];
        let line = stance
            .support
            .side_line(self.robot.dimension(), &stance.coordinates, *side);
        let angle = landing_angle(self.robot, tip, &line, *landed);
        let mut turned = tip.to_vec();
        turn(self.robot, &mut turned, &line, angle, pivots);
        for &node in next.support.nodes() {
            let place = self.robot.dimension().node(&next.coordinates, node);
            self.robot.dimension().set_node(&mut turned, node, &place);
        }
        turned
    }

    /// The motion start → tip → end of one roll by linear interpolation.
    fn through_tip(&self, tip: &[f64], steps: usize, tip_index: usize) -> Vec<Vec<f64>> {
        let after = self.after_roll(0, tip);
        (0..=steps)
            .map(|step| {
                if step <= tip_index {
                    let time = step as f64 / tip_index as f64;
                    interpolate(&self.stances[0].coordinates, tip, time)
                } else {
                    let time = (step - tip_index - 1) as f64 / (steps - tip_index - 1) as f64;
                    interpolate(&after, &self.stances[1].coordinates, time)
                }
            })
            .collect()
    }
}

pub(super) fn interpolate(from: &[f64], to: &[f64], time: f64) -> Vec<f64> {
    from.iter()
        .zip(to)
        .map(|(a, b)| a + time * (b - a))
        .collect()
}

/// Resamples a part of a motion between two configurations that are kept.
pub(super) fn resample(part: &[Vec<f64>], count: usize) -> Vec<Vec<f64>> {
    let last = part.len() - 1;
    (0..count)
        .map(|k| {
            let position = last as f64 * k as f64 / (count - 1).max(1) as f64;
            let index = (position as usize).min(last.saturating_sub(1));
            let next = (index + 1).min(last);
            interpolate(&part[index], &part[next], position - index as f64)
        })
        .collect()
}

fn sqp_options(options: &PrimitiveOptions, radius: f64) -> SqpOptions {
    SqpOptions::default()
        .with_max_iterations(options.max_iterations)
        .with_feasibility_tolerance(FEASIBILITY)
        .with_initial_radius(radius)
}

/// Runs the sparse solver from a motion; returns the report and the final motion.
fn solve(
    problem: &mut MotionProblem<'_>,
    guess: &[Vec<f64>],
    options: &PrimitiveOptions,
) -> Result<(SqpReport, Vec<Vec<f64>>), PrimitiveError> {
    let mut x = problem.variables(guess);
    let invalid = |reason: String| PrimitiveError::NotFound { reason };
    let mut solver =
        SparseSqp::new(sqp_options(options, 0.3)).map_err(|error| invalid(error.to_string()))?;
    let report = solver
        .solve(problem, &mut x)
        .map_err(|error| invalid(error.to_string()))?;
    Ok((report, problem.configurations(&x)))
}

/// A motion that keeps all constraints, and how its last optimisation went.
pub(super) struct Solved {
    pub motion: SupportedMotion,
    pub attempt: PrimitiveAttempt,
}

/// Times that limits are tightened for a motion that misses them between configurations.
const TIGHTENINGS: usize = 5;

/// Solves a full problem from a guess. Where the motion falls short of a limit between
/// configurations, the limit is tightened by what is missing and the problem solved again from
/// there. `build` states the problem for a robot with the limits to use.
///
/// # Errors
/// `NotFound` when no motion that keeps all constraints is reached.
pub(super) fn solve_full(
    sequence: &Sequence<'_>,
    guess: &[Vec<f64>],
    options: &PrimitiveOptions,
    build: impl for<'r> Fn(&'r Robot) -> MotionProblem<'r>,
) -> Result<Solved, PrimitiveError> {
    let mut robot = sequence.robot.clone();
    let mut guess = guess.to_vec();
    for _ in 0..=TIGHTENINGS {
        let mut problem = build(&robot);
        if guess.len() != problem.num_configurations() {
            return Err(PrimitiveError::GuessLength {
                expected: problem.num_configurations(),
                found: guess.len(),
            });
        }
        let (report, configurations) = solve(&mut problem, &guess, options)?;
        let attempt = PrimitiveAttempt::new(options.steps, &report);
        if !attempt.is_feasible() {
            return Err(PrimitiveError::NotFound {
                reason: reason(&problem, &report),
            });
        }
        let rolls = problem.rolls().to_vec();
        let stances = &sequence.stances[..=rolls.len()];
        let motion = SupportedMotion {
            configurations,
            supports: stances.iter().map(|s| s.support.clone()).collect(),
            rolls,
        };
        match tightened(sequence.robot, robot.limits(), &motion) {
            None => return Ok(Solved { motion, attempt }),
            Some(limits) => robot = robot.with_limits(limits),
        }
        guess = motion.configurations;
    }
    Err(PrimitiveError::NotFound {
        reason: "between configurations the limits are missed; try more steps".to_owned(),
    })
}

/// Says how a run ended.
fn reason(problem: &MotionProblem<'_>, report: &SqpReport) -> String {
    match &report.status {
        SqpStatus::Infeasible(unmet) => match unmet.first() {
            Some(worst) => format!(
                "the constraints cannot be met together, the worst is the {} (off by {:.2e})",
                problem.describe(worst.constraint),
                worst.violation.abs()
            ),
            None => "the constraints cannot be met together".to_owned(),
        },
        SqpStatus::IterationLimit => "the iteration limit was reached".to_owned(),
        other => format!("the solver stopped with {other:?}"),
    }
}

/// Optimises a one-roll primitive from a tip shape: the coordinates of the robot when its centre
/// of mass is above the side rolled over.
///
/// # Errors
/// See [`PrimitiveError`]; `NotFound` when the solver does not reach a feasible point.
pub fn solve_primitive(
    symmetric: &SymmetricRobot,
    tip_shape: &[f64],
    options: &PrimitiveOptions,
) -> Result<(Primitive, PrimitiveAttempt), PrimitiveError> {
    options.validate()?;
    let sequence = Sequence::new(symmetric, &[])?;
    if tip_shape.len() != symmetric.robot().num_coordinates() {
        return Err(PrimitiveError::GuessLength {
            expected: symmetric.robot().num_coordinates(),
            found: tip_shape.len(),
        });
    }
    let guess = sequence.through_tip(tip_shape, options.steps, options.tip);
    finish(symmetric, &sequence, &[], &guess, options)
}

/// Solves the full problem of a sequence from a guess.
fn finish(
    symmetric: &SymmetricRobot,
    sequence: &Sequence<'_>,
    turns: &[Turn],
    guess: &[Vec<f64>],
    options: &PrimitiveOptions,
) -> Result<(Primitive, PrimitiveAttempt), PrimitiveError> {
    let size = (options.steps, options.tip);
    let Solved { motion, attempt } = solve_full(sequence, guess, options, |robot| {
        sequence.problem(robot, options, size, Ends::Fixed)
    })?;
    let primitive = Primitive {
        symmetric: symmetric.clone(),
        turns: turns.to_vec(),
        motion,
        end: sequence.stances[sequence.stances.len() - 1].clone(),
    };
    Ok((primitive, attempt))
}

/// Searches for a one-roll primitive without any knowledge of the tip shape.
///
/// # Errors
/// See [`PrimitiveError`]; `NotFound` when no attempt reaches a feasible motion.
pub fn find_primitive(
    symmetric: &SymmetricRobot,
    options: &PrimitiveOptions,
    rng: &mut impl Rng,
) -> Result<PrimitiveSearch, PrimitiveError> {
    options.validate()?;
    let sequence = Sequence::new(symmetric, &[])?;
    let mut attempts = Vec::new();
    let tips = find_tips(&sequence, options, rng, &mut attempts)?;
    refine_tips(symmetric, &sequence, &tips, options, attempts)
}

/// Searches for the cheapest of the one-roll primitives of several renamings of nodes, as
/// [`find_primitive`] does for one; `rng` makes a fresh generator for each. Renamings whose tip
/// shapes promise nothing cheaper than what is found already are not looked into.
///
/// # Errors
/// See [`PrimitiveError`]; `NotFound` when no attempt reaches a feasible motion.
pub fn find_cheapest_primitive<R: Rng>(
    ways: &[SymmetricRobot],
    options: &PrimitiveOptions,
    rng: impl Fn() -> R,
) -> Result<PrimitiveSearch, PrimitiveError> {
    options.validate()?;
    let mut candidates = Vec::with_capacity(ways.len());
    for way in ways {
        let sequence = Sequence::new(way, &[])?;
        let mut attempts = Vec::new();
        let tips = find_tips(&sequence, options, &mut rng(), &mut attempts)?;
        let cheapest = tips.iter().map(|(cost, _)| *cost);
        // With D² the cost of one large step, n small ones cost at least D²/n.
        let least = cheapest.fold(f64::INFINITY, f64::min) * 2.0 / options.steps as f64;
        candidates.push((least, way, sequence, tips, attempts));
    }
    candidates.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut best: Option<(f64, PrimitiveSearch)> = None;
    let mut failure = PrimitiveError::Sequence;
    for (least, way, sequence, tips, attempts) in candidates {
        if best.as_ref().is_some_and(|(cost, _)| least >= *cost) {
            break;
        }
        match refine_tips(way, &sequence, &tips, options, attempts) {
            Ok(search) => {
                let cost = search.best.cost();
                if best.as_ref().is_none_or(|(least, _)| cost < *least) {
                    best = Some((cost, search));
                }
            }
            Err(error) => failure = error,
        }
    }
    best.map(|(_, search)| search).ok_or(failure)
}

/// Carries tip shapes on to coarse motions and the best of these to full ones.
fn refine_tips(
    symmetric: &SymmetricRobot,
    sequence: &Sequence<'_>,
    tips: &[(f64, Vec<f64>)],
    options: &PrimitiveOptions,
    mut attempts: Vec<PrimitiveAttempt>,
) -> Result<PrimitiveSearch, PrimitiveError> {
    let mut failure = "no tip shape was found".to_owned();
    let mut coarse: Vec<(f64, Vec<Vec<f64>>)> = Vec::new();
    for (tip_cost, tip) in tips {
        if coarse.len() == options.kept {
            break;
        }
        if options.steps <= COARSE_STEPS {
            coarse.push((0.0, sequence.through_tip(tip, options.steps, options.tip)));
            continue;
        }
        // With D² the cost of one large step, n small ones cost at least D²/n: a motion through
        // this tip would be too dear to refine.
        let least = tip_cost * 2.0 / COARSE_STEPS as f64;
        if coarse
            .iter()
            .any(|(known, _)| least > WORTH_REFINING * known)
        {
            continue;
        }
        let tip_index = COARSE_STEPS / 2;
        let guess = sequence.through_tip(tip, COARSE_STEPS, tip_index);
        let size = (COARSE_STEPS, tip_index);
        let mut problem = sequence.problem(sequence.robot, options, size, Ends::Fixed);
        let patience = options.max_iterations.min(COARSE_ITERATIONS);
        let (full, options) = (options, options.clone().with_max_iterations(patience));
        let (report, motion) = solve(&mut problem, &guess, &options)?;
        let attempt = PrimitiveAttempt::new(COARSE_STEPS, &report);
        if attempt.is_feasible() {
            let new = |(cost, _): &(f64, _)| (cost - attempt.cost).abs() > SAME_COST * cost;
            if coarse.iter().all(new) {
                let mut fine = resample(&motion[..=tip_index], full.tip + 1);
                fine.extend(resample(&motion[tip_index + 1..], full.steps - full.tip));
                coarse.push((attempt.cost, fine));
            }
        } else {
            failure = reason(&problem, &report);
        }
        attempts.push(attempt);
    }
    coarse.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut best: Option<(f64, Primitive)> = None;
    let mut refined: Option<f64> = None;
    for (cost, guess) in coarse {
        // Much dearer or equal motions are not worth refining.
        if refined.is_some_and(|least| cost > WORTH_REFINING * least)
            || refined.is_some_and(|least| cost - least < SAME_COST * least)
        {
            continue;
        }
        match finish(symmetric, sequence, &[], &guess, options) {
            Ok((primitive, attempt)) => {
                refined.get_or_insert(cost);
                if best.as_ref().is_none_or(|(least, _)| attempt.cost < *least) {
                    best = Some((attempt.cost, primitive));
                }
                attempts.push(attempt);
            }
            Err(PrimitiveError::NotFound { reason }) => failure = reason,
            Err(other) => return Err(other),
        }
    }
    match best {
        Some((_, best)) => Ok(PrimitiveSearch { best, attempts }),
        None => Err(PrimitiveError::NotFound { reason: failure }),
    }
}

/// Distinct feasible tip shapes of the first roll with the cost of their two-step motions: those
/// that members need not cross to reach first, the cheaper before the dearer.
fn find_tips(
    sequence: &Sequence<'_>,
    options: &PrimitiveOptions,
    rng: &mut impl Rng,
    attempts: &mut Vec<PrimitiveAttempt>,
) -> Result<Vec<(f64, Vec<f64>)>, PrimitiveError> {
    let robot = sequence.robot;
    let invalid = |reason: String| PrimitiveError::NotFound { reason };
    let stance = &sequence.stances[0];
    let roll = &sequence.rolls[0];
    let line = stance
        .support
        .side_line(robot.dimension(), &stance.coordinates, roll.side);
    let pivots = roll
        .pivots
        .map(|node| robot.dimension().node(&stance.coordinates, node));
    let middle = (pivots[0] + pivots[1]) * 0.5;
    let side = (pivots[0] - pivots[1]).norm();
    let landing = robot
        .dimension()
        .node(&sequence.stances[1].coordinates, roll.landed);
    let reach = line.outside(&landing);
    let along = (landing - middle).dot(&line.axis);

    let mut problem = sequence.problem(robot, options, (2, 1), Ends::Fixed);
    let mut solver = DenseSqp::new(sqp_options(options, 0.3).with_max_iterations(60))
        .map_err(|error| invalid(error.to_string()))?;
    let mut found: Vec<(usize, f64, Vec<f64>)> = Vec::new();
    for _ in 0..options.starts {
        let mut tip = stance.coordinates.clone();
        for node in (0..robot.graph().num_nodes()).filter(|&n| !stance.support.contains(n)) {
            let (out, height) = if node == roll.landed {
                let elevation = rng.random_range(0.1..2.4_f64);
                (reach * elevation.cos(), reach * elevation.sin())
            } else {
                (
                    side * rng.random_range(-1.0..1.0),
                    side * rng.random_range(0.1..1.2),
                )
            };
            let across = if node == roll.landed {
                along
            } else {
                side * rng.random_range(-0.7..0.7)
            };
            let point = middle + line.outward * out + line.axis * across + Vector3::z() * height;
            robot.dimension().set_node(&mut tip, node, &point);
        }
        let end = &sequence.stances[1].coordinates;
        let mut x = problem.variables(&[stance.coordinates.clone(), tip, end.clone()]);
        let report = solver
            .solve(&mut problem, &mut x)
            .map_err(|error| invalid(error.to_string()))?;
        let attempt = PrimitiveAttempt::new(2, &report);
        if attempt.is_feasible() {
            let new = |(_, cost, _): &(usize, f64, _)| {
                (cost - attempt.cost).abs() > SAME_COST * attempt.cost
            };
            if found.iter().all(new) {
                let shape = problem.configurations(&x).swap_remove(1);
                let crossings = crossings(robot, &stance.coordinates, &shape)
                    + crossings(robot, &sequence.after_roll(0, &shape), end);
                found.push((crossings, attempt.cost, shape));
            }
        }
        attempts.push(attempt);
    }
    found.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    Ok(found
        .into_iter()
        .map(|(_, cost, tip)| (cost, tip))
        .collect())
}

/// Number of times that members pass through each other while all nodes move straight from
/// `start` to `end`.
fn crossings(robot: &Robot, start: &[f64], end: &[f64]) -> usize {
    const SAMPLES: usize = 40;
    let members = robot.graph().members();
    let mut count = 0;
    let mut sides: Vec<f64> = Vec::new();
    for sample in 0..=SAMPLES {
        let x = interpolate(start, end, sample as f64 / SAMPLES as f64);
        for (index, pair) in robot.graph().disjoint_pairs().iter().enumerate() {
            let ([a, b], [c, d]) = (members[pair[0]], members[pair[1]]);
            let [a, b, c, d] = [a, b, c, d].map(|node| robot.dimension().node(&x, node));
            // The members pass each other when the volume that they span changes its sign, and
            // through each other when they are close at that moment.
            let side = (b - a).cross(&(d - c)).dot(&(c - a));
            match sides.get_mut(index) {
                None => sides.push(side),
                Some(before) => {
                    let close = 0.5 * robot.limits().min_distance;
                    if *before * side < 0.0 && robot.pair_distance(&x, *pair) < close {
                        count += 1;
                    }
                    *before = side;
                }
            }
        }
    }
    count
}

/// Optimises a primitive over several rolls, starting from a one-roll primitive repeated along
/// the sequence. `turns` are those after the first roll.
///
/// # Errors
/// See [`PrimitiveError`]; `NotFound` when the solver does not reach a feasible point.
pub fn extend_primitive(
    primitive: &Primitive,
    turns: &[Turn],
    options: &PrimitiveOptions,
) -> Result<(Primitive, PrimitiveAttempt), PrimitiveError> {
    options.validate()?;
    let symmetric = primitive.symmetric_robot();
    let sequence = Sequence::new(symmetric, turns)?;
    let guess = repeated(primitive, &sequence)?;
    finish(symmetric, &sequence, turns, &guess, options)
}

/// A one-roll primitive repeated along a sequence.
pub(super) fn repeated(
    primitive: &Primitive,
    sequence: &Sequence<'_>,
) -> Result<Vec<Vec<f64>>, PrimitiveError> {
    let mut motion = vec![sequence.stances[0].coordinates.clone()];
    for (stance, roll) in sequence.stances.iter().zip(&sequence.rolls) {
        let (placed, _) = primitive
            .place(stance, roll.side, false)
            .ok_or(PrimitiveError::Sequence)?;
        motion.extend_from_slice(&placed.configurations[1..]);
    }
    Ok(motion)
}
