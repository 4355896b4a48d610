//! Whether a simulated robot follows a gait that turns: walks of a few rolls under control of the
//! lengths, a side of the support counting as a metre. Cost: O(simulated time / time step ×
//! members).

use super::sequence::{Stance, Turn, next_side};
use super::{SupportedMotion, TurningGait};
use crate::{DynamicsOptions, simulate_motion};

/// Seconds that a roll takes in the simulations.
const SECONDS_OF_ROLL: [f64; 2] = [6.0, 12.0];
/// Greatest mean error of a walk that counts as followed, in metres.
const STRAY: f64 = 0.01;
/// Turns of the walk that the gait is tried on.
const TURNS: [Turn; 4] = [Turn::Left, Turn::Left, Turn::Right, Turn::Right];

/// A motion, the stance before it, the side rolled over, and whether it is mirrored.
type Part<'a> = (&'a SupportedMotion, &'a Stance, usize, bool);

/// Whether turns to both sides are followed.
pub(super) fn follows_turns(gait: &TurningGait) -> bool {
    let Some((stances, rolls)) = gait.symmetric.sequence(&TURNS) else {
        return false;
    };
    let mut parts: Vec<Part<'_>> = vec![(&gait.entry, &stances[0], rolls[0].side, false)];
    for (k, turn) in TURNS.iter().enumerate() {
        let right = *turn == Turn::Right;
        parts.push((&gait.turn, &stances[k], rolls[k].side, right));
    }
    let last = TURNS.len();
    parts.push((&gait.exit, &stances[last], rolls[last].side, false));
    follows(gait, &parts).unwrap_or(false)
}

/// Whether the way back is followed, entered from the stance and left by a turn; true without one.
pub(super) fn follows_back(gait: &TurningGait) -> bool {
    let Some(back) = &gait.back else {
        return true;
    };
    let symmetric = &gait.symmetric;
    let followed = || {
        let start = symmetric.start();
        let (over, roll) = symmetric.roll(&start, symmetric.side())?;
        let come_over = over.support.side_between(&roll.pivots)?;
        let (again, roll) = symmetric.roll(&over, come_over)?;
        let left = next_side(symmetric.robot(), &again, &roll, Turn::Left);
        let parts = [
            (&gait.entry, &start, symmetric.side(), false),
            (back, &start, symmetric.side(), false),
            (&gait.turn, &over, come_over, false),
            (&gait.exit, &again, left, false),
        ];
        follows(gait, &parts)
    };
    followed().unwrap_or(false)
}

/// Whether a robot follows parts that join; none where they cannot be placed.
fn follows(gait: &TurningGait, parts: &[Part<'_>]) -> Option<bool> {
    let symmetric = &gait.symmetric;
    let mut placed = parts
        .iter()
        .map(|&(part, stance, side, mirrored)| symmetric.place(part, stance, side, mirrored));
    let mut motion = placed.next()??;
    for part in placed {
        motion.append(part?);
    }
    let robot = symmetric.robot();
    let start = symmetric.start();
    let at = |k: usize| {
        let node = start.support.nodes()[k];
        robot.dimension().node(&start.coordinates, node)
    };
    let side = (at(1) - at(0)).norm();
    let coordinates = motion.configurations.iter_mut().flatten();
    coordinates.for_each(|coordinate| *coordinate /= side);
    let rolls = motion.rolls.len() as f64;
    Some(SECONDS_OF_ROLL.iter().all(|seconds| {
        let options = DynamicsOptions::default();
        simulate_motion(robot, &motion, seconds * rolls, &options)
            .is_ok_and(|report| report.mean_error <= STRAY)
    }))
}
