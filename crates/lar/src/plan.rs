//! From a walk problem to a walk: runs the planner that the problem names and describes the
//! outcome.

use rand::SeedableRng;
use rand_pcg::Pcg64;
use thiserror::Error;

use crate::greedy::GreedyStop;
use crate::{
    GreedyError, GreedyPlanner, PrimitiveError, PrimitiveLibrary, SupportedMotion, SymmetricRobot,
    SymmetryError, TwoTierError, TwoTierPlanner, TwoTierWalk, Visit, Walk, WalkCheckOptions,
    WalkContext, WalkFacts, WalkGoal, WalkPlanner, WalkProblem, WalkStatistics, check_walk,
    find_cheapest_primitive,
};

/// A planned walk, with what a picture of the planning needs.
#[derive(Debug, Clone, PartialEq)]
pub struct PlannedWalk {
    /// The walk, with the verdict of the independent check.
    pub walk: Walk,
    /// The motion that it describes.
    pub motion: SupportedMotion,
    /// The outcome of two-tier planning: grid, cells and searches.
    pub two_tier: Option<TwoTierWalk>,
}

/// Why a walk could not be planned.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum PlanWalkError {
    /// Greedy planning could not start.
    #[error(transparent)]
    Greedy(#[from] GreedyError),
    /// Two-tier planning found no walk.
    #[error(transparent)]
    TwoTier(#[from] TwoTierError),
    /// The start is not symmetric, as two-tier planning needs.
    #[error("two-tier planning: {0}")]
    Symmetry(#[from] SymmetryError),
    /// There is no motion primitive.
    #[error("two-tier planning: {0}")]
    Primitive(#[from] PrimitiveError),
    /// The renaming of nodes that the problem asks for does not exist.
    #[error(
        "the renaming of nodes {roles:?} is none of those that the start permits: {permitted:?}"
    )]
    Roles {
        /// The renaming asked for.
        roles: Vec<usize>,
        /// Those permitted.
        permitted: Vec<Vec<usize>>,
    },
}

/// Plans a walk and checks it: [`plan_walk_timed`] without a clock.
///
/// A greedy walk that does not reach its goal is returned as far as it came, with the reason in
/// its statistics; its check fails.
///
/// # Errors
/// See [`PlanWalkError`].
///
/// # Examples
///
/// ```
/// use tensegra_lar::{WalkProblem, plan_walk};
///
/// let problem = WalkProblem::from_toml(
///     r#"
/// planner = "greedy"
/// waypoints = [[0.5, 0.2]]
/// [robot]
/// preset = "octahedron"
/// "#,
/// )?;
/// let planned = plan_walk(&problem)?;
/// assert!(planned.walk.check.unwrap().valid);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn plan_walk(problem: &WalkProblem) -> Result<PlannedWalk, PlanWalkError> {
    plan_walk_timed(problem, &|| 0.0)
}

/// Plans a walk and checks it. `clock` tells the time in seconds from any origin; the time that
/// planning takes, motion primitives included and the check not, goes into the statistics.
///
/// # Errors
/// See [`PlanWalkError`].
pub fn plan_walk_timed(
    problem: &WalkProblem,
    clock: &dyn Fn() -> f64,
) -> Result<PlannedWalk, PlanWalkError> {
    let began = clock();
    let mut planned = match problem.planner {
        WalkPlanner::Greedy => plan_greedy(problem, clock)?,
        WalkPlanner::TwoTier => {
            let library = primitive_library(problem)?;
            plan_with(problem, &library, clock)?
        }
    };
    planned.walk.statistics.seconds -= began;
    planned.walk = checked(planned.walk);
    Ok(planned)
}

/// The statistics of the walk returned hold the time at which planning ended.
fn plan_greedy(
    problem: &WalkProblem,
    clock: &dyn Fn() -> f64,
) -> Result<PlannedWalk, PlanWalkError> {
    let points = problem.goal.points();
    let mut options = problem.greedy.clone();
    if let WalkGoal::Region { radius, .. } = problem.goal {
        options.waypoint_tolerance = radius;
    }
    let tolerance = options.waypoint_tolerance;
    let mut planner =
        GreedyPlanner::new(&problem.robot, options)?.with_obstacles(&problem.obstacles);
    let outcome = planner.walk(&problem.start, &points)?;
    let statistics = WalkStatistics {
        planner: "greedy".to_owned(),
        stop: describe(&outcome.stop),
        reached: outcome.reached,
        optimisations: outcome.optimisations,
        iterations: outcome.iterations,
        recoveries: outcome.recoveries,
        seconds: clock(),
        ..WalkStatistics::default()
    };
    let visit = Visit::CentreOfMass(tolerance);
    let walk = Walk::new(
        &context(problem, &points, visit),
        &outcome.motion,
        statistics,
    );
    Ok(PlannedWalk {
        walk,
        motion: outcome.motion,
        two_tier: None,
    })
}

/// The motion primitives that a two-tier problem needs: those for the renaming that it names, or
/// for the renaming with the cheapest one-roll primitive.
///
/// # Errors
/// A start without symmetry, a renaming that does not exist, or no feasible primitive.
pub fn primitive_library(problem: &WalkProblem) -> Result<PrimitiveLibrary, PlanWalkError> {
    let all = SymmetricRobot::all(
        &problem.robot,
        &problem.start.coordinates,
        &problem.start.support,
    )?;
    let permitted: Vec<Vec<usize>> = all
        .iter()
        .map(|s| s.relabelling().roles().to_vec())
        .collect();
    let chosen: Vec<SymmetricRobot> = match &problem.two_tier.roles {
        None => all,
        Some(roles) => {
            let found: Vec<_> = all
                .into_iter()
                .filter(|s| s.relabelling().roles() == roles)
                .collect();
            if found.is_empty() {
                return Err(PlanWalkError::Roles {
                    roles: roles.clone(),
                    permitted,
                });
            }
            found
        }
    };
    let primitives = &problem.two_tier.primitives;
    let rng = || Pcg64::seed_from_u64(problem.seed);
    let one_roll = find_cheapest_primitive(&chosen, primitives, rng)?.best;
    let (library, _) =
        PrimitiveLibrary::new(one_roll).extend(problem.two_tier.rolls, primitives)?;
    if problem.two_tier.gait {
        return Ok(library.with_gait(primitives)?);
    }
    Ok(library)
}

/// Plans a two-tier walk by primitives that were computed before. The time that `clock` tells at
/// the end of planning, before the check, goes into the statistics.
///
/// # Errors
/// See [`PlanWalkError`].
pub fn plan_two_tier(
    problem: &WalkProblem,
    library: &PrimitiveLibrary,
    clock: &dyn Fn() -> f64,
) -> Result<PlannedWalk, PlanWalkError> {
    let mut planned = plan_with(problem, library, clock)?;
    planned.walk = checked(planned.walk);
    Ok(planned)
}

/// The statistics of the walk returned hold the time at which planning ended.
fn plan_with(
    problem: &WalkProblem,
    library: &PrimitiveLibrary,
    clock: &dyn Fn() -> f64,
) -> Result<PlannedWalk, PlanWalkError> {
    let planner =
        TwoTierPlanner::new(library).with_obstacles(&problem.obstacles, problem.obstacle_clearance);
    let outcome = planner.walk(&problem.start, &problem.goal.grid_goals())?;
    let points = problem.goal.points();
    let visit = match problem.goal {
        WalkGoal::Waypoints(_) => Visit::Support,
        WalkGoal::Region { radius, .. } => Visit::CentreOfMass(radius),
    };
    let statistics = WalkStatistics {
        planner: "two-tier".to_owned(),
        stop: "arrived".to_owned(),
        reached: points.len(),
        seconds: clock(),
        ..WalkStatistics::default()
    };
    let walk = Walk::new(
        &context(problem, &points, visit),
        &outcome.motion,
        statistics,
    );
    Ok(PlannedWalk {
        walk,
        motion: outcome.motion.clone(),
        two_tier: Some(outcome),
    })
}

fn context<'a>(
    problem: &'a WalkProblem,
    waypoints: &'a [[f64; 2]],
    visit: Visit,
) -> WalkContext<'a> {
    WalkContext {
        name: &problem.name,
        robot: &problem.robot,
        node_names: &problem.node_names,
        waypoints,
        visit,
        obstacles: &problem.obstacles,
        obstacle_clearance: problem.obstacle_clearance,
    }
}

fn checked(mut walk: Walk) -> Walk {
    let verdict = check_walk(&WalkFacts::of(&walk), &walk, &WalkCheckOptions::default());
    walk.check = Some(verdict);
    walk
}

fn describe(stop: &GreedyStop) -> String {
    match stop {
        GreedyStop::Arrived => "arrived".to_owned(),
        GreedyStop::Stuck { waypoint, active } => {
            let list: Vec<String> = active.iter().map(ToString::to_string).collect();
            format!(
                "stuck on the way to waypoint {waypoint}, held by: {}",
                list.join("; ")
            )
        }
        GreedyStop::CannotRoll { waypoint } => {
            format!("a roll on the way to waypoint {waypoint} cannot be made")
        }
        GreedyStop::NoRoute { waypoint } => {
            format!("no way around the obstacles leads to waypoint {waypoint}")
        }
        GreedyStop::TooLong { waypoint } => {
            format!("too many configurations on the way to waypoint {waypoint}")
        }
    }
}
