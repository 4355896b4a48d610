//! From a walk problem in a file to a walk.

use std::path::Path;

use cpu_time::ThreadTime;
use tensegra_lar::{
    DynamicsError, DynamicsOptions, DynamicsReport, PlanWalkError, PlannedWalk, PrimitiveError,
    TwoTierError, WalkProblem, plan_walk_timed, simulate_motion,
};
use tensegra_model::{Finding, ReadErrors, SourceFile};

/// Reads a walk problem. A problem without a name takes that of its file.
///
/// # Errors
/// What is wrong with the file, with its place and the nodes and members concerned.
///
/// # Examples
///
/// ```no_run
/// let problem = tensegra::read_walk_problem("fixtures/lar/two-tier-s.toml".as_ref())?;
/// let planned = tensegra::plan_walk(&problem)?;
/// println!("{} steps, {:.3} s", planned.walk.configurations.len() - 1, planned.walk.statistics.seconds);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn read_walk_problem(file: &Path) -> Result<WalkProblem, ReadErrors> {
    let source = SourceFile::read(file)?;
    let mut problem = WalkProblem::from_toml(source.text())
        .map_err(|error| Finding::error(&source, error.span, error.message))?;
    if problem.name.is_empty() {
        problem.name = file
            .file_stem()
            .map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
    }
    Ok(problem)
}

/// Plans a walk and checks it; the statistics tell the processor time of planning alone.
///
/// # Errors
/// See [`PlanWalkError`]; [`is_bad_input`] tells errors of the problem from those of the search.
pub fn plan_walk(problem: &WalkProblem) -> Result<PlannedWalk, PlanWalkError> {
    let start = ThreadTime::now();
    plan_walk_timed(problem, &|| start.elapsed().as_secs_f64())
}

/// Whether a walk was not planned because the problem does not permit it, rather than because
/// none was found.
pub fn is_bad_input(error: &PlanWalkError) -> bool {
    !matches!(
        error,
        PlanWalkError::TwoTier(TwoTierError::Unreachable { .. })
            | PlanWalkError::Primitive(PrimitiveError::NotFound { .. })
    )
}

/// Runs a walk on a robot with mass under control of its lengths, once for each of the given
/// execution times of a roll, in seconds. A walk without rolls takes one such time.
///
/// # Errors
/// A time that is not positive, a walk without motion, or a simulation that diverges.
pub fn simulate_walk(
    problem: &WalkProblem,
    planned: &PlannedWalk,
    seconds_of_roll: &[f64],
    options: &DynamicsOptions,
) -> Result<Vec<DynamicsReport>, DynamicsError> {
    let rolls = planned.motion.rolls.len().max(1) as f64;
    seconds_of_roll
        .iter()
        .map(|seconds| simulate_motion(&problem.robot, &planned.motion, seconds * rolls, options))
        .collect()
}
