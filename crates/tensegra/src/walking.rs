//! From a walk problem in a file to a walk.

use std::path::{Path, PathBuf};

use cpu_time::ThreadTime;
use tensegra_io::{WriteError, write_atomic};
use tensegra_lar::{
    DynamicsError, DynamicsOptions, DynamicsReport, MotionFileError, PlanWalkError, PlannedWalk,
    PrimitiveError, PrimitiveLibrary, TwoTierError, WalkProblem, plan_two_tier, plan_walk_timed,
    primitive_library, simulate_motion,
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

/// Why a walk was not planned by stored motions.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StoredMotionsError {
    /// There are no motions, or no walk.
    #[error(transparent)]
    Plan(#[from] PlanWalkError),
    /// The file cannot be read.
    #[error("cannot read `{}`: {reason}", file.display())]
    Unreadable {
        /// The file.
        file: PathBuf,
        /// What the system says.
        reason: std::io::Error,
    },
    /// The file does not hold motions for the problem.
    #[error(
        "`{}`: {reason}; give another file, or one that does not exist to optimise anew",
        file.display()
    )]
    Unfit {
        /// The file.
        file: PathBuf,
        /// What is wrong with it.
        reason: MotionFileError,
    },
    /// The motions cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}

/// Where the motions of a two-tier walk came from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MotionSource {
    /// They were read from a file.
    File,
    /// They were optimised.
    Optimised,
}

/// Plans a two-tier walk by the motions in `file` and checks it. Where there is no such file, the
/// motions are optimised and written first. The statistics tell the processor time that this and
/// planning take.
///
/// # Errors
/// See [`StoredMotionsError`].
pub fn plan_walk_with_motions(
    problem: &WalkProblem,
    file: &Path,
) -> Result<(PlannedWalk, MotionSource), StoredMotionsError> {
    let start = ThreadTime::now();
    let (library, source) = match std::fs::read_to_string(file) {
        Ok(text) => {
            let library = PrimitiveLibrary::from_json(&text, problem).map_err(|reason| {
                StoredMotionsError::Unfit {
                    file: file.to_path_buf(),
                    reason,
                }
            })?;
            (library, MotionSource::File)
        }
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
            let library = primitive_library(problem)?;
            write_atomic(file, library.to_json(&problem.two_tier).as_bytes())?;
            (library, MotionSource::Optimised)
        }
        Err(reason) => {
            return Err(StoredMotionsError::Unreadable {
                file: file.to_path_buf(),
                reason,
            });
        }
    };
    let clock = || start.elapsed().as_secs_f64();
    Ok((plan_two_tier(problem, &library, &clock)?, source))
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
