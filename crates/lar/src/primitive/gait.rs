//! Periodic gaits (equation (39)): along a straight strip, and with turns.
//!
//! A gait begins and ends at the tipping configuration, whose shape is free, and so need not come
//! back to the symmetric stance. A tipping configuration that is its own mirror image lets the
//! gait turn left and, mirrored, right; entered from the stance and left to it, it walks along any
//! path over the triangular grid that does not go back over the side just come over.

use super::follow::{follows_back, follows_turns};
use super::motion::{Ends, TipMirror};
use super::search::{Sequence, Solved, interpolate, repeated, resample, solve_full};
use super::sequence::{Stance, SymmetricRobot, Turn, straight_strip};
use super::symmetry::match_nodes;
use super::{
    Primitive, PrimitiveAttempt, PrimitiveError, PrimitiveOptions, SupportedMotion, actuation_cost,
    length_ratio,
};
use crate::{GroundIsometry, Robot, Support};

/// A periodic gait (equation (39)): from the tipping configuration of one roll to that of the
/// next, of the same shape, along a straight strip.
#[derive(Debug, Clone, PartialEq)]
pub struct Gait {
    pub(super) symmetric: SymmetricRobot,
    pub(super) motion: SupportedMotion,
    pub(super) period: Period,
}

impl Gait {
    /// The robot with the stance and the renaming that the gait belongs to.
    #[must_use]
    pub fn symmetric_robot(&self) -> &SymmetricRobot {
        &self.symmetric
    }

    /// One period with its supports: over the roll that leads from the stance over its side, to
    /// the tipping configuration of the side to the left. Mirrored by
    /// [`SymmetricRobot::place`], it leads to that of the side to the right.
    #[must_use]
    pub fn motion(&self) -> &SupportedMotion {
        &self.motion
    }

    /// Coordinates of each configuration of one period. The first is the tipping configuration;
    /// the robot rolls between the first and the second.
    #[must_use]
    pub fn configurations(&self) -> &[Vec<f64>] {
        &self.motion.configurations
    }

    /// Sum of the squared length changes of one period.
    #[must_use]
    pub fn cost(&self) -> f64 {
        actuation_cost(&self.symmetric, &self.motion.configurations)
    }

    /// Greatest length of any member at any time over the least.
    #[must_use]
    pub fn length_ratio(&self) -> f64 {
        length_ratio(&self.symmetric, &self.motion.configurations)
    }

    /// The gait repeated over `periods` rolls.
    #[must_use]
    pub fn repeat(&self, periods: usize) -> SupportedMotion {
        let robot = self.symmetric.robot();
        let dimension = robot.dimension();
        let nodes = robot.graph().num_nodes();
        let mut roles: Vec<usize> = (0..nodes).collect();
        let mut motion = SupportedMotion {
            configurations: vec![self.motion.configurations[0].clone()],
            supports: vec![self.motion.supports[0].clone()],
            rolls: Vec::new(),
        };
        for period in 0..periods {
            motion.rolls.push(motion.configurations.len() - 1);
            for source in &self.motion.configurations[1..] {
                let mut placed = source.clone();
                for (node, &role) in roles.iter().enumerate() {
                    let mut point = dimension.node(source, role);
                    for _ in 0..period {
                        point = self.period.map.apply(&point);
                    }
                    dimension.set_node(&mut placed, node, &point);
                }
                motion.configurations.push(placed);
            }
            let mut support = self.motion.supports[1].nodes().to_vec();
            for node in &mut support {
                // Every role is played by one node.
                *node = roles.iter().position(|role| role == node).unwrap_or(*node);
            }
            if let Ok(support) = Support::new(robot, &support) {
                motion.supports.push(support);
            }
            roles = roles.iter().map(|&role| self.period.roles[role]).collect();
        }
        motion
    }
}

/// Outcome of a search for a periodic gait.
#[derive(Debug, Clone, PartialEq)]
pub struct GaitSearch {
    /// The gait.
    pub best: Gait,
    /// The optimisation that found it.
    pub attempt: PrimitiveAttempt,
}

/// The isometry and renaming that carry a tipping configuration to the next: node i stands at the
/// image of node `roles[i]`.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Period {
    map: GroundIsometry,
    roles: Vec<usize>,
}

impl Period {
    /// The configuration that `coordinates` is carried to.
    pub(super) fn image(&self, robot: &Robot, coordinates: &[f64]) -> Vec<f64> {
        let mut image = coordinates.to_vec();
        for (node, &role) in self.roles.iter().enumerate() {
            let point = robot.dimension().node(coordinates, role);
            robot
                .dimension()
                .set_node(&mut image, node, &self.map.apply(&point));
        }
        image
    }
}

/// Optimises a periodic gait along a straight strip (equation (39)), whose shape at the tip is
/// free, starting from a one-roll primitive; should that fail, from the straight way between its
/// tip shapes.
///
/// # Errors
/// See [`PrimitiveError`]; `NotFound` when no attempt reaches a feasible gait.
pub fn find_gait(
    primitive: &Primitive,
    options: &PrimitiveOptions,
) -> Result<GaitSearch, PrimitiveError> {
    options.validate()?;
    let symmetric = primitive.symmetric_robot();
    let sequence = Sequence::new(symmetric, &straight_strip(2))?;
    let (_, period) = strip_period(symmetric).ok_or(PrimitiveError::Sequence)?;
    let Solved { motion, attempt } = solve_period(primitive, &sequence, &period, None, options)?;
    let best = Gait {
        symmetric: symmetric.clone(),
        motion,
        period,
    };
    Ok(GaitSearch { best, attempt })
}

/// Solves for one period, from the tipping configuration of the first roll of `sequence` to that
/// of the second.
fn solve_period(
    primitive: &Primitive,
    sequence: &Sequence<'_>,
    period: &Period,
    mirror: Option<&TipMirror>,
    options: &PrimitiveOptions,
) -> Result<Solved, PrimitiveError> {
    let twice = repeated(primitive, sequence)?;
    let (first, second) = (options.tip, options.tip + options.steps);
    let through_stance = twice[first..=second].to_vec();
    // Straight from the shape after the roll to the next tipping shape.
    let direct: Vec<Vec<f64>> = std::iter::once(through_stance[0].clone())
        .chain((1..=options.steps).map(|step| {
            let time = (step - 1) as f64 / (options.steps - 1) as f64;
            interpolate(&through_stance[1], &through_stance[options.steps], time)
        }))
        .collect();
    let solve = |guess: &[Vec<f64>]| {
        solve_full(sequence, guess, options, |robot| {
            let ends = Ends::Periodic {
                map: period.map,
                roles: period.roles.clone(),
                mirror: mirror.cloned(),
            };
            sequence.problem(robot, options, (options.steps, 0), ends)
        })
    };
    match solve(&through_stance) {
        Err(PrimitiveError::NotFound { .. }) => solve(&direct),
        other => other,
    }
}

/// The stances along two rolls of a straight strip, and what carries the first, with its roll, to
/// the second. None where the strip does not lead along symmetric stances.
pub(super) fn strip_period(symmetric: &SymmetricRobot) -> Option<(Vec<Stance>, Period)> {
    let (stances, rolls) = symmetric.sequence(&straight_strip(2))?;
    let (stance, next) = (&stances[0], &stances[1]);
    let dimension = symmetric.robot().dimension();
    let (first, second) = (&rolls[0], &rolls[1]);
    // The pivot that stays is the image of the one that lifts next: v₁ → v₂ while v₀ → v₁.
    let lifts = second.lifted;
    let stays = if first.pivots[0] == lifts {
        first.pivots[1]
    } else {
        first.pivots[0]
    };
    let at = |stance: &Stance, node: usize| dimension.node(&stance.coordinates, node);
    let from = [at(stance, first.lifted), at(stance, lifts)];
    let to = [at(next, lifts), at(next, stays)];
    let period = [true, false].into_iter().find_map(|mirrored| {
        let map = GroundIsometry::between_segments(from, to, mirrored, 1e-6)?;
        let image = map.apply(&at(stance, stays));
        if (image - at(next, second.pivots.iter().copied().find(|&n| n != stays)?)).norm() > 1e-6 {
            return None;
        }
        let roles = match_nodes(
            symmetric.robot(),
            &stance.coordinates,
            &next.coordinates,
            &map,
            1e-6,
        )
        .ok()?;
        Some(Period { map, roles })
    })?;
    Some((stances, period))
}

/// A periodic gait that can turn.
///
/// Its tipping configuration is its own mirror image in the middle of the side rolled over. One
/// period leads over a roll to the tipping configuration of the side to the left, its mirror image
/// to that of the side to the right. Other motions lead over a roll to the tipping configuration
/// of the same side, from the symmetric stance to the tipping configuration, and from there over a
/// roll to the stance.
#[derive(Debug, Clone, PartialEq)]
pub struct TurningGait {
    pub(super) symmetric: SymmetricRobot,
    pub(super) entry: SupportedMotion,
    pub(super) turn: SupportedMotion,
    pub(super) back: Option<SupportedMotion>,
    pub(super) exit: SupportedMotion,
}

/// Where the tipping configuration of a gait that can turn is carried.
pub(super) struct TipImages {
    /// To itself, mirrored.
    pub mirror: Period,
    /// After the roll, to the side on the left.
    pub left: Period,
    /// After the roll, to the side come over.
    pub back: Option<Period>,
}

impl TipImages {
    /// None when the roll and the turn do not lead along symmetric stances.
    pub(super) fn new(symmetric: &SymmetricRobot) -> Option<Self> {
        let (stances, rolls) = symmetric.sequence(&[Turn::Left])?;
        let at = |stance: &Stance, side: usize, mirrored: bool| {
            let map = symmetric.placement(stance, side, mirrored)?;
            let roles = symmetric.roles_at(stance, &map)?;
            Some(Period { map, roles })
        };
        // The side come over is opposite the node that landed.
        let mut nodes = stances[1].support.nodes().iter();
        let came_over = nodes.position(|&node| node == rolls[0].landed);
        Some(Self {
            mirror: at(&stances[0], symmetric.side(), true)?,
            left: at(&stances[1], rolls[1].side, false)?,
            back: came_over.and_then(|side| at(&stances[1], side, false)),
        })
    }
}

impl TurningGait {
    /// The robot with the stance and the renaming that the gait belongs to.
    #[must_use]
    pub fn symmetric_robot(&self) -> &SymmetricRobot {
        &self.symmetric
    }

    /// From the stance to the tipping configuration: no roll.
    #[must_use]
    pub fn entry(&self) -> &SupportedMotion {
        &self.entry
    }

    /// From a tipping configuration over a roll to that of the side to the left.
    #[must_use]
    pub fn turn(&self) -> &SupportedMotion {
        &self.turn
    }

    /// From a tipping configuration over a roll to that of the same side, back again; none if no
    /// such motion was found.
    #[must_use]
    pub fn back(&self) -> Option<&SupportedMotion> {
        self.back.as_ref()
    }

    /// From the tipping configuration over a roll to the stance.
    #[must_use]
    pub fn exit(&self) -> &SupportedMotion {
        &self.exit
    }

    /// Sum of the squared length changes of one of the motions.
    #[must_use]
    pub fn cost(&self, motion: &SupportedMotion) -> f64 {
        actuation_cost(&self.symmetric, &motion.configurations)
    }
}

/// Parts of the period, from its roll on, in which the gait that turns stays symmetric: the first
/// with which a simulated robot follows it.
const HELD: [f64; 3] = [0.25, 0.4, 0.5];

/// Part of the largest step that nodes take on the straight way to and from the gait.
const PACE: f64 = 0.6;

/// Longest straight way of a node.
fn longest_way(from: &[f64], to: &[f64]) -> f64 {
    let nodes = from.chunks_exact(3).zip(to.chunks_exact(3));
    let squares = nodes.map(|(a, b)| a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>());
    squares.fold(0.0, f64::max).sqrt()
}

/// Optimises a gait that can turn, starting from a one-roll primitive: first the period, whose
/// tipping shape is free but symmetric, then the ways from and to the stance.
///
/// The cheapest gaits are not those that a robot with mass can follow: it rolls late, for it starts
/// from balance, lands with speed, and rocks over the node that lands. What rocks sideways, or falls
/// far, does not come to rest where it should. The fall of the centre of mass is therefore bounded
/// ([`max_fall`](PrimitiveOptions::max_fall)), and the robot stays symmetric for a part of the period
/// after the roll, so that it rocks straight ahead and back; a longer part where a simulated robot
/// does not follow the gait otherwise ([`simulate_motion`](crate::simulate_motion)). The way back
/// over the same side, which leaves the robot close to balance all the time, is left out where it is
/// not followed.
///
/// # Errors
/// See [`PrimitiveError`]; `NotFound` when one of the motions is not found, or none is followed.
pub fn find_turning_gait(
    primitive: &Primitive,
    options: &PrimitiveOptions,
) -> Result<TurningGait, PrimitiveError> {
    options.validate()?;
    for part in HELD {
        let held = (part * options.steps as f64) as usize;
        let mut gait = solve_turning_gait(primitive, held, options)?;
        if follows_turns(&gait) {
            if !follows_back(&gait) {
                gait.back = None;
            }
            return Ok(gait);
        }
    }
    Err(PrimitiveError::NotFound {
        reason: "a robot with mass follows none of the gaits".to_owned(),
    })
}

/// A gait that can turn whose period stays symmetric for `held` configurations after its roll.
fn solve_turning_gait(
    primitive: &Primitive,
    held: usize,
    options: &PrimitiveOptions,
) -> Result<TurningGait, PrimitiveError> {
    let symmetric = primitive.symmetric_robot();
    let sequence = Sequence::new(symmetric, &[Turn::Left])?;
    let images = TipImages::new(symmetric).ok_or(PrimitiveError::Sequence)?;
    let mirror = TipMirror {
        map: images.mirror.map,
        partners: images.mirror.roles,
        held,
    };
    let turn = solve_period(primitive, &sequence, &images.left, Some(&mirror), options)?.motion;

    let (tip, turned) = (&turn.configurations[0], &turn.configurations[1]);
    let single = Sequence::new(symmetric, &[])?;
    let [stance, next] = [&single.stances[0], &single.stances[1]];
    let size = (options.steps, options.tip);
    // A way costs the square of its length over the number of its steps; the walk is cheapest when
    // a step on it is as dear as one of the gait.
    let price = actuation_cost(symmetric, &turn.configurations) / options.steps as f64;
    let solve = |first: &Vec<f64>, last: &Vec<f64>, rolls: bool| {
        let from = if rolls { turned } else { first };
        let straight = actuation_cost(symmetric, &[from.clone(), last.clone()]);
        // Nodes that have far to go need more steps.
        let pace = PACE * symmetric.robot().limits().max_move;
        let steps = (straight / price)
            .sqrt()
            .max(longest_way(from, last) / pace)
            .max(1.0)
            .ceil() as usize;
        let mut guess = if rolls {
            vec![first.clone()]
        } else {
            Vec::new()
        };
        guess.extend(resample(&[from.clone(), last.clone()], steps + 1));
        solve_full(&single, &guess, options, |robot| {
            let ends = Ends::Given {
                first: first.clone(),
                last: last.clone(),
                steps,
                rolls,
            };
            single.problem(robot, options, size, ends)
        })
        .map(|solved| solved.motion)
    };
    let entry = solve(&stance.coordinates, tip, false)?;
    let exit = solve(tip, &next.coordinates, true)?;
    let back_tip = images
        .back
        .map(|period| period.image(symmetric.robot(), tip));
    let back = match back_tip.map(|back_tip| solve(tip, &back_tip, true)) {
        Some(Ok(motion)) => Some(motion),
        Some(Err(PrimitiveError::NotFound { .. })) | None => None,
        Some(Err(other)) => return Err(other),
    };
    Ok(TurningGait {
        symmetric: symmetric.clone(),
        entry,
        turn,
        back,
        exit,
    })
}
