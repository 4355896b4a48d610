//! The experiments of section VI of Usevitch et al. as functions: random sequences of waypoints
//! for every planner, and random robots of growing size. Seeded; every walk is judged by the
//! independent check.
//!
//! Time is read from a clock that the caller passes in (seconds, from any origin), so that
//! processor time can be measured where wall-clock time would mislead.

use std::collections::BTreeMap;

use nalgebra::Point2;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use crate::known::RobotAtStart;
use crate::{
    Constraint, Dimension, GreedyError, GreedyOptions, GreedyPlanner, GreedyStop, GridGoal, Limits,
    Primitive, PrimitiveAttempt, PrimitiveError, PrimitiveLibrary, PrimitiveOptions,
    PrimitiveSearch, RandomRobotError, RobotError, SupportedMotion, SymmetricRobot, TwoTierError,
    TwoTierPlanner, Visit, Walk, WalkCheckOptions, WalkContext, WalkFacts, WalkStatistics,
    check_walk, find_primitive, random_robot, solve_primitive, unit_k5, unit_octahedron,
};

/// Random sequences of `length` waypoints in the square from 0 to `side`.
#[must_use]
pub fn random_sequences(count: usize, length: usize, side: f64, seed: u64) -> Vec<Vec<[f64; 2]>> {
    let mut rng = Pcg64::seed_from_u64(seed);
    (0..count)
        .map(|_| {
            (0..length)
                .map(|_| [rng.random_range(0.0..side), rng.random_range(0.0..side)])
                .collect()
        })
        .collect()
}

/// Outcome of a number of trials of one planner.
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct Trials {
    /// Number of trials.
    pub count: usize,
    /// Trials that reached all waypoints.
    pub succeeded: usize,
    /// Walks that the check refused for another reason than a waypoint not reached.
    pub faulty: usize,
    /// Cost (40) of each successful trial.
    pub costs: Vec<f64>,
    /// Optimisations solved in all trials together.
    pub optimisations: usize,
    /// Times that the planner was stuck and found a way on.
    pub recoveries: usize,
    /// Time of each trial divided by its number of optimisations, or of each trial.
    pub seconds: Vec<f64>,
    /// Largest violation of a constraint at any configuration of any trial.
    pub worst_violation: f64,
    /// Least certified clearance of any trial.
    pub least_clearance: f64,
    /// What stopped the trials that failed, with their number.
    pub stops: BTreeMap<String, usize>,
}

impl Trials {
    fn new(count: usize) -> Self {
        Self {
            count,
            worst_violation: f64::NEG_INFINITY,
            least_clearance: f64::INFINITY,
            ..Self::default()
        }
    }

    /// Mean cost of the successful trials.
    #[must_use]
    pub fn mean_cost(&self) -> f64 {
        mean(&self.costs)
    }

    /// Standard deviation of the cost of the successful trials.
    #[must_use]
    pub fn cost_deviation(&self) -> f64 {
        let mean = self.mean_cost();
        let squares: f64 = self.costs.iter().map(|cost| (cost - mean).powi(2)).sum();
        (squares / (self.costs.len().max(2) - 1) as f64).sqrt()
    }

    /// Mean of [`seconds`](Self::seconds).
    #[must_use]
    pub fn mean_seconds(&self) -> f64 {
        mean(&self.seconds)
    }

    fn record(
        &mut self,
        start: &RobotAtStart,
        motion: &SupportedMotion,
        waypoints: &[[f64; 2]],
        visit: Visit,
        arrived: bool,
    ) {
        let context = WalkContext {
            name: "trial",
            robot: &start.robot,
            node_names: &[],
            waypoints: if arrived { waypoints } else { &[] },
            visit,
            obstacles: &[],
            obstacle_clearance: 0.0,
        };
        let walk = Walk::new(&context, motion, WalkStatistics::default());
        let verdict = check_walk(&WalkFacts::of(&walk), &walk, &WalkCheckOptions::default());
        if let Some(violation) = verdict.worst_violation {
            self.worst_violation = self.worst_violation.max(violation);
        }
        if let Some(clearance) = walk.statistics.certified_clearance {
            self.least_clearance = self.least_clearance.min(clearance);
        }
        if !verdict.valid {
            self.faulty += 1;
        }
        if arrived {
            self.succeeded += 1;
            self.costs.push(walk.statistics.cost);
        }
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// Walks greedily along each sequence of waypoints.
///
/// # Errors
/// Options or a start that the planner refuses.
pub fn greedy_trials(
    start: &RobotAtStart,
    options: &GreedyOptions,
    sequences: &[Vec<[f64; 2]>],
    clock: impl Fn() -> f64,
) -> Result<Trials, GreedyError> {
    let mut trials = Trials::new(sequences.len());
    let mut planner = GreedyPlanner::new(&start.robot, options.clone())?;
    for waypoints in sequences {
        let began = clock();
        let walk = planner.walk(&start.stance, waypoints)?;
        trials
            .seconds
            .push((clock() - began) / walk.optimisations.max(1) as f64);
        trials.optimisations += walk.optimisations;
        trials.recoveries += walk.recoveries;
        let visit = Visit::CentreOfMass(options.waypoint_tolerance);
        let arrived = walk.stop == GreedyStop::Arrived;
        if !arrived {
            *trials.stops.entry(summarise(&walk.stop)).or_insert(0) += 1;
        }
        trials.record(start, &walk.motion, waypoints, visit, arrived);
    }
    Ok(trials)
}

/// Walks along each sequence of waypoints by two-tier planning. The time of a trial does not
/// include the primitives.
///
/// # Errors
/// A start that does not fit the library, or a waypoint that cannot be reached.
pub fn two_tier_trials(
    start: &RobotAtStart,
    library: &PrimitiveLibrary,
    sequences: &[Vec<[f64; 2]>],
    clock: impl Fn() -> f64,
) -> Result<Trials, TwoTierError> {
    let mut trials = Trials::new(sequences.len());
    let planner = TwoTierPlanner::new(library);
    for waypoints in sequences {
        let goals: Vec<GridGoal> = waypoints
            .iter()
            .map(|&[x, y]| GridGoal::Point(Point2::new(x, y)))
            .collect();
        let began = clock();
        let walk = planner.walk(&start.stance, &goals)?;
        trials.seconds.push(clock() - began);
        trials.record(start, &walk.motion, waypoints, Visit::Support, true);
    }
    Ok(trials)
}

/// Lets random minimally rigid robots, one for each seed, travel a distance along the first axis.
///
/// # Errors
/// Limits that no random robot meets.
pub fn random_robot_trials(
    nodes: usize,
    limits: &Limits,
    distance: f64,
    seeds: std::ops::Range<u64>,
    options: &GreedyOptions,
    clock: impl Fn() -> f64,
) -> Result<Trials, RandomRobotError> {
    let mut trials = Trials::new((seeds.end - seeds.start) as usize);
    for seed in seeds {
        let mut rng = Pcg64::seed_from_u64(seed);
        let start = random_robot(nodes, Dimension::Three, limits.clone(), &mut rng)?;
        let centre = start.robot.centre_of_mass(&start.stance.coordinates);
        let waypoints = [[centre.x + distance, centre.y]];
        let began = clock();
        let walk = GreedyPlanner::new(&start.robot, options.clone())
            .and_then(|mut planner| planner.walk(&start.stance, &waypoints));
        let elapsed = clock() - began;
        let walk = match walk {
            Ok(walk) => walk,
            Err(error) => {
                *trials.stops.entry(error.to_string()).or_insert(0) += 1;
                continue;
            }
        };
        trials
            .seconds
            .push(elapsed / walk.optimisations.max(1) as f64);
        trials.optimisations += walk.optimisations;
        trials.recoveries += walk.recoveries;
        let arrived = walk.stop == GreedyStop::Arrived;
        if !arrived {
            *trials.stops.entry(summarise(&walk.stop)).or_insert(0) += 1;
        }
        let visit = Visit::CentreOfMass(options.waypoint_tolerance);
        trials.record(&start, &walk.motion, &waypoints, visit, arrived);
    }
    Ok(trials)
}

/// The kinds of constraints that stopped a walk.
fn summarise(stop: &GreedyStop) -> String {
    match stop {
        GreedyStop::Stuck { active, .. } => {
            let mut kinds: Vec<&str> = active
                .iter()
                .map(|constraint| match constraint {
                    Constraint::MinLength { .. } => "least length",
                    Constraint::MaxLength { .. } => "greatest length",
                    Constraint::Distance { .. } => "member distance",
                    Constraint::Angle { .. } => "angle",
                    Constraint::Ground { .. } => "ground",
                    Constraint::Rigidity => "rigidity",
                    Constraint::Balance => "balance",
                })
                .collect();
            kinds.sort_unstable();
            kinds.dedup();
            format!("stuck: {}", kinds.join(", "))
        }
        GreedyStop::Arrived => "arrived".to_owned(),
        GreedyStop::CannotRoll { .. } => "cannot roll".to_owned(),
        GreedyStop::NoRoute { .. } => "no route".to_owned(),
        GreedyStop::TooLong { .. } => "too long".to_owned(),
    }
}

/// A one-roll motion of the literature: a robot, the renaming of its nodes in a roll, and a guess
/// of its shape at the tip.
#[derive(Debug, Clone, PartialEq)]
pub struct PublishedGait {
    /// Name.
    pub name: &'static str,
    /// The robot in its symmetric stance.
    pub start: RobotAtStart,
    /// Node i ends where the mirror image of node `roles[i]` stood.
    pub roles: &'static [usize],
    tip: &'static [(usize, [f64; 3])],
}

impl PublishedGait {
    /// The three motions of figure 9: K5 rolling, K5 everting, and the octahedron, with limits
    /// other than the default for the octahedron if given (K5 cannot lose rigidity on its way).
    ///
    /// # Errors
    /// Limits outside their range.
    pub fn all(octahedron: &Limits) -> Result<[Self; 3], RobotError> {
        let k5 = unit_k5(Limits::default())?;
        Ok([
            Self {
                name: "K5 rolling",
                start: k5.clone(),
                roles: &[4, 1, 2, 3, 0],
                tip: &[(4, [0.6536, 0.0, 0.5678]), (3, [0.2124, 0.0, 0.2])],
            },
            Self {
                name: "K5 everting",
                start: k5,
                roles: &[3, 1, 2, 0, 4],
                tip: &[(3, [0.7, 0.0, 0.5099]), (4, [0.166, 0.0, 0.75])],
            },
            Self {
                name: "octahedron",
                start: unit_octahedron(octahedron.clone())?,
                roles: &[3, 1, 2, 0, 4, 5],
                tip: &[
                    (3, [0.815, 0.0, 0.293]),
                    (4, [0.025, 0.437, 0.804]),
                    (5, [0.025, -0.437, 0.804]),
                ],
            },
        ])
    }

    /// The robot with the renaming.
    ///
    /// # Errors
    /// [`PrimitiveError::Symmetry`] if the stance lacks the symmetry, [`PrimitiveError::Sequence`]
    /// if it does not permit the renaming.
    pub fn symmetric(&self) -> Result<SymmetricRobot, PrimitiveError> {
        let RobotAtStart { robot, stance } = &self.start;
        SymmetricRobot::all(robot, &stance.coordinates, &stance.support)?
            .into_iter()
            .find(|symmetric| symmetric.relabelling().roles() == self.roles)
            .ok_or(PrimitiveError::Sequence)
    }

    /// The one-roll primitive, found from the guess.
    ///
    /// # Errors
    /// See [`solve_primitive`].
    pub fn solve(
        &self,
        options: &PrimitiveOptions,
    ) -> Result<(Primitive, PrimitiveAttempt), PrimitiveError> {
        let mut tip = self.start.stance.coordinates.clone();
        for (node, position) in self.tip {
            tip[3 * node..3 * node + 3].copy_from_slice(position);
        }
        solve_primitive(&self.symmetric()?, &tip, options)
    }

    /// The one-roll primitive, found by the generic multi-start, which knows no shape of the tip.
    ///
    /// # Errors
    /// See [`find_primitive`].
    pub fn search(
        &self,
        options: &PrimitiveOptions,
        seed: u64,
    ) -> Result<PrimitiveSearch, PrimitiveError> {
        find_primitive(&self.symmetric()?, options, &mut Pcg64::seed_from_u64(seed))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn trials_are_deterministic_and_judged() {
        let sequences = random_sequences(2, 1, 1.0, 3);
        assert_eq!(sequences, random_sequences(2, 1, 1.0, 3));
        let start = unit_octahedron(Limits::default()).unwrap();
        let options = GreedyOptions::default();
        let trials = greedy_trials(&start, &options, &sequences, || 0.0).unwrap();
        assert_eq!((trials.succeeded, trials.faulty), (2, 0));
        assert!(trials.worst_violation <= 1e-6);
        assert_eq!(
            trials,
            greedy_trials(&start, &options, &sequences, || 0.0).unwrap()
        );
    }

    #[test]
    fn published_gaits_are_found_from_their_guesses() {
        let options = PrimitiveOptions::default();
        for (gait, cost) in PublishedGait::all(&Limits::default())
            .unwrap()
            .iter()
            .zip([0.0622, 0.1979, 0.0247])
        {
            let (primitive, _) = gait.solve(&options).unwrap();
            assert!(
                (primitive.cost() / cost - 1.0).abs() < 5e-3,
                "{}",
                gait.name
            );
        }
    }
}
