//! How far a motion falls short of its limits between configurations, where nodes move on
//! straight lines.
//!
//! A motion problem constrains configurations alone. A member that turns far in one step is
//! shorter, and the angles at its ends sharper, half way than at the two configurations; the
//! limits of the problem are then tightened by what is missing. Cost: O(configurations ×
//! (members + corners)).

use super::SupportedMotion;
use crate::clearance::turned_back;
use crate::{Limits, Robot};

/// Positions looked at between two configurations.
const SAMPLES: usize = 8;
/// Part of a limit by which lengths and angles may miss it between configurations; the check
/// allows 1 %.
const ALLOWANCE: f64 = 0.009;

/// Limits of `robot` tightened so that a motion that lies as far inside them as `motion` lies
/// inside `current` keeps the robot's limits between configurations as well; none when `motion`
/// keeps them already.
pub(super) fn tightened(
    robot: &Robot,
    current: &Limits,
    motion: &SupportedMotion,
) -> Option<Limits> {
    let limits = robot.limits();
    let (mut length, mut angle) = (f64::INFINITY, f64::INFINITY);
    for (index, pair) in motion.configurations.windows(2).enumerate() {
        let turned = motion.rolls.contains(&index).then(|| {
            let before = (pair[0].as_slice(), motion.support(index));
            turned_back(
                robot,
                before,
                (pair[1].as_slice(), motion.support(index + 1)),
            )
        });
        let end = turned.flatten();
        let end = end.as_deref().unwrap_or(&pair[1]);
        for sample in 1..SAMPLES {
            let time = sample as f64 / SAMPLES as f64;
            let shape = super::search::interpolate(&pair[0], end, time);
            length = robot.lengths(&shape).into_iter().fold(length, f64::min);
            angle = (0..robot.graph().corners().len())
                .map(|corner| robot.corner_angle(&shape, corner))
                .fold(angle, f64::min);
        }
    }
    let short = |least: f64, limit: f64| (limit * (1.0 - 0.5 * ALLOWANCE) - least).max(0.0);
    let keeps = |least: f64, limit: f64| least >= limit * (1.0 - ALLOWANCE);
    if keeps(length, limits.min_length) && keeps(angle, limits.min_angle) {
        return None;
    }
    Some(
        current
            .clone()
            .with_min_length(current.min_length + short(length, limits.min_length))
            .with_min_angle(current.min_angle + short(angle, limits.min_angle)),
    )
}
