//! Smoothing a path of a problem, and the best of several plans smoothed.

use std::f64::consts::TAU;

use cpu_time::ThreadTime;
use tensegra_atlas::{ManifoldError, project};
use tensegra_check::{CheckOptions, Report, check_path};
use tensegra_model::{
    BodyError, Configuration, DirectionsManifold, EquilibriumError, EquilibriumManifold, FreeSpace,
    NodesManifold, Path, Problem, Stability, Stable, Structure, control_effort, path_length,
};
use tensegra_sampling::{
    Draft, Observer, ShortcutOptions, Shortcutter, Shortened, SmoothError, SmoothObserver,
    Smoother, SmootherOptions,
};

use crate::planning::{Plan, PlanningError, plan};

/// Residual of a path's points.
const TOLERANCE: f64 = 1e-12;
const MAX_ITERATIONS: usize = 30;
/// The seeds of several plans differ by multiples of this, so that those of
/// neighbouring seeds differ too.
const SEED_STRIDE: u64 = 0x9E37_79B9_7F4A_7C15;
/// The seeds of plans that replace one another differ by multiples of this.
const RETRY_STRIDE: u64 = 0xD1B5_4A32_D192_ED03;
/// Plans that are tried in place of one whose elements turn the long way round.
const RETRIES: usize = 8;
/// Sums of turns that differ by less are the same, rad.
const SAME_TURN: f64 = 1e-3;
/// Of several plans, one that is longer than the shortest by this factor once it is smooth
/// on a coarse mesh is of another class.
const HOPELESS: f64 = 1.2;
/// A single plan that is then longer than this multiple of the straight line from start to
/// goal may be of a poor class.
const DETOUR: f64 = 1.75;
/// Plans that such a one is compared with, at most.
const SECOND_LOOKS: usize = 2;
/// A path is about as long as on the coarse mesh, up to this factor.
const DRAFT_ERROR: f64 = 1.05;
/// Attempts to smooth with ever wider margins.
const ATTEMPTS: usize = 4;
/// Factor from one attempt's margins to the next one's.
const WIDER: f64 = 2.0;
/// Factor from the steps of an attempt that did not reach a path to the next one's.
const SHORTER: f64 = 0.5;

/// How a path is smoothed.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct SmoothingOptions {
    /// Shortcuts, which come first.
    pub shortcut: ShortcutOptions,
    /// Smoothing proper.
    pub smoother: SmootherOptions,
}

impl SmoothingOptions {
    /// The options for a problem: its step, its seed.
    pub fn of(problem: &Problem) -> Self {
        let mut options = Self::default();
        options.shortcut.seed = problem.seed;
        options.shortcut.step = problem.settings.step;
        options.smoother.step = problem.settings.step;
        options
    }
}

/// A smoothed path, with what it was before. Lengths and efforts are in the
/// coordinates of Porta and Hernández-Juan (2016).
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Smoothing {
    /// The motion from start to goal.
    pub path: Path,
    /// Verdict of the independent judge about it.
    pub report: Report,
    /// Length of the path.
    pub path_length: f64,
    /// Its control effort (eq. 24); `None` where it passes a singular point.
    pub control_effort: Option<f64>,
    /// Length of the path given.
    pub path_length_before: f64,
    /// Control effort of the path given.
    pub control_effort_before: Option<f64>,
    /// Length after the shortcuts.
    pub shortcut_length: f64,
    /// Reduced gradient of the path's energy over its length, largest entry;
    /// `None` where the path is that of the shortcuts.
    pub optimality: Option<f64>,
    /// Whether the optimality asked for was reached.
    pub converged: bool,
    /// Iterations of all attempts.
    pub iterations: usize,
    /// CPU seconds of the shortcuts.
    pub shortcut_seconds: f64,
    /// CPU seconds of shortcuts, smoothing, and the judge's verdicts in between.
    pub seconds: f64,
    /// The smallest eigenvalue of the tangent stiffness along the path, force per
    /// length, with the index of the configuration that has it; `None` where no
    /// motion is admissible.
    pub least_stiffness: Option<(usize, f64)>,
    /// Why the path is that of the shortcuts, where it is.
    pub setback: Option<String>,
}

/// Why a path is not smoothed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SmoothingError {
    /// The structure has no equilibrium manifold.
    #[error(transparent)]
    Structure(#[from] EquilibriumError),
    /// A body has no valid shape.
    #[error(transparent)]
    Body(#[from] BodyError),
    /// The path has no configurations.
    #[error("the path has no configurations: there is nothing to smooth")]
    Empty,
    /// A configuration of the path does not fit the structure.
    #[error("configuration {index} of the path does not fit the structure of the problem")]
    Unfit {
        /// Index of the configuration.
        index: usize,
    },
    /// A configuration of the path is not in equilibrium.
    #[error("configuration {index} of the path is not in equilibrium: {error}")]
    NoEquilibrium {
        /// Index of the configuration.
        index: usize,
        /// What the projection says.
        error: ManifoldError,
    },
    /// The path cannot be moved.
    #[error(transparent)]
    Smoother(#[from] SmoothError),
}

/// A path after the shortcuts, smooth on a coarse mesh.
struct Drafted {
    shortened: Shortened,
    draft: Result<Draft, SmoothError>,
    /// Length of the draft, or after the shortcuts where there is none.
    length: f64,
    /// How deep the draft cuts into obstacles.
    depth: f64,
    /// Distance between start and goal.
    straight: f64,
    seconds: f64,
}

/// Where the paths of a problem are smoothed.
struct Ground<'m> {
    manifold: &'m DirectionsManifold,
    free: Stable<'m, DirectionsManifold, FreeSpace<'m, DirectionsManifold>>,
    max_displacement: f64,
    /// The given path.
    points: Vec<Vec<f64>>,
    /// CPU seconds that it took to put the path here.
    seconds: f64,
}

impl<'m> Ground<'m> {
    fn new(
        problem: &Problem,
        manifold: &'m DirectionsManifold,
        path: &Path,
    ) -> Result<Self, SmoothingError> {
        let clock = ThreadTime::now();
        let structure = &problem.structure;
        let first = path.configurations.first().ok_or(SmoothingError::Empty)?;
        for (index, configuration) in path.configurations.iter().enumerate() {
            let elements = structure.elements.len();
            if configuration.positions.len() != structure.nodes.len()
                || configuration.lengths.len() != elements
                || configuration.rest_lengths.len() != elements
                || configuration.forces.len() != elements
            {
                return Err(SmoothingError::Unfit { index });
            }
        }
        let size = NodesManifold::new(structure, &first.positions)?.size();
        let points = path
            .configurations
            .iter()
            .enumerate()
            .map(|(index, configuration)| {
                let mut x = manifold.coordinates(configuration);
                project(manifold, &mut x, TOLERANCE, MAX_ITERATIONS)
                    .map(|()| x)
                    .map_err(|error| SmoothingError::NoEquilibrium { index, error })
            })
            .collect::<Result<Vec<_>, _>>()?;
        let mut free = FreeSpace::new(manifold, &problem.environment, size)?;
        for end in [points.first(), points.last()].into_iter().flatten() {
            free.admit(end);
        }
        let settings = &problem.settings;
        let free = Stable::new(manifold, settings.actuation, settings.least_stiffness, free)
            .scaled_at(&points[0]);
        Ok(Self {
            manifold,
            free,
            max_displacement: settings.step * size,
            points,
            seconds: clock.elapsed().as_secs_f64(),
        })
    }

    fn smoother(
        &self,
        options: SmootherOptions,
    ) -> Smoother<
        '_,
        DirectionsManifold,
        Stable<'m, DirectionsManifold, FreeSpace<'m, DirectionsManifold>>,
    > {
        Smoother::new(self.manifold, &self.free, options).max_displacement(self.max_displacement)
    }

    /// Shortcuts, then smoothing on a coarse mesh.
    fn draft(
        &self,
        options: &SmoothingOptions,
        observer: &mut dyn SmoothObserver,
    ) -> Result<Drafted, SmoothingError> {
        let clock = ThreadTime::now();
        let shortened = Shortcutter::new(self.manifold, &self.free, options.shortcut.clone())
            .max_displacement(self.max_displacement)
            .shorten(&self.points)
            .map_err(|error| SmoothError::Manifold { index: 0, error })?;
        let smoother = self.smoother(options.smoother.clone());
        let draft = smoother.draft(&shortened.points, observer);
        if let Err(SmoothError::Cancelled) = draft {
            return Err(SmoothError::Cancelled.into());
        }
        let ends = [&self.points[0], &self.points[self.points.len() - 1]];
        Ok(Drafted {
            length: draft.as_ref().map_or(shortened.length, Draft::length),
            depth: draft.as_ref().map_or(0.0, |draft| smoother.depth(draft)),
            straight: self.manifold.path_length(&ends),
            shortened,
            draft,
            seconds: self.seconds + clock.elapsed().as_secs_f64(),
        })
    }

    /// Smooths a draft of the path on fine meshes, and the path from the beginning with
    /// ever wider margins where that does not end well.
    fn refine(
        &self,
        problem: &Problem,
        path: &Path,
        drafted: Drafted,
        options: &SmoothingOptions,
        observer: &mut dyn SmoothObserver,
    ) -> Result<Smoothing, SmoothingError> {
        let clock = ThreadTime::now();
        let (structure, manifold) = (&problem.structure, self.manifold);
        let as_path = |points: &[Vec<f64>]| Path {
            configurations: points.iter().map(|x| manifold.configuration(x)).collect(),
        };
        let judge = |path: &Path| check_path(problem, path, &CheckOptions::default());
        let Drafted {
            shortened,
            draft,
            seconds: seconds_before,
            ..
        } = drafted;
        let mut draft = Some(draft);
        let mut margins = options.smoother.clone();
        let mut iterations = 0;
        let mut setback = None;
        let mut smoothed = None;
        let mut from = shortened.points.clone();
        for _ in 0..ATTEMPTS {
            let smoother = self.smoother(margins.clone());
            let found = match draft.take() {
                Some(draft) => draft.and_then(|draft| smoother.refine(draft, observer)),
                None => smoother.smooth(&from, observer),
            };
            match found {
                Ok(found) => {
                    iterations += found.iterations;
                    let path = as_path(&found.points);
                    let report = judge(&path);
                    if report.ok {
                        setback = None;
                        smoothed = Some((path, report, found.optimality, found.converged));
                        break;
                    }
                    setback = report.failures.first().map(|f| f.message.clone());
                    from = found.points;
                }
                Err(SmoothError::Cancelled) => return Err(SmoothError::Cancelled.into()),
                Err(error) => {
                    setback = Some(error.to_string());
                    from.clone_from(&shortened.points);
                    // Shorter steps neither tear the path nor jump over obstacles.
                    margins.trust_radius *= SHORTER;
                }
            }
            margins.contact_margin *= WIDER;
            margins.limit_margin *= WIDER;
        }
        let (path_after, report, optimality, converged) = match smoothed {
            Some((path, report, optimality, converged)) => {
                (path, report, Some(optimality), converged)
            }
            None => {
                let shortcut = as_path(&shortened.points);
                let report = judge(&shortcut);
                if report.ok {
                    (shortcut, report, None, false)
                } else {
                    (path.clone(), judge(path), None, false)
                }
            }
        };
        let seconds = seconds_before + clock.elapsed().as_secs_f64();
        let stability = Stability::new(structure, problem.settings.actuation);
        Ok(Smoothing {
            path_length: path_length(structure, &path_after)?,
            control_effort: control_effort(structure, &path_after).ok(),
            path_length_before: path_length(structure, path)?,
            control_effort_before: control_effort(structure, path).ok(),
            least_stiffness: stability.least_along(&path_after),
            path: path_after,
            report,
            shortcut_length: shortened.length,
            optimality,
            converged,
            iterations,
            shortcut_seconds: shortened.seconds,
            seconds,
            setback,
        })
    }
}

/// Shortens and smooths a path of a problem: the path of least control effort
/// among its neighbours that keep all ranges, touch nothing and stay as stable as the
/// problem demands, with steps that the independent judge accepts.
///
/// The path should be one that the judge accepts. Where smoothing does not end
/// with such a path, the one after the shortcuts is returned, or the one given.
///
/// # Errors
/// [`SmoothingError`]: the path does not fit the problem or is not in
/// equilibrium, or the observer cancelled.
pub fn smooth(
    problem: &Problem,
    path: &Path,
    options: &SmoothingOptions,
    observer: &mut dyn SmoothObserver,
) -> Result<Smoothing, SmoothingError> {
    let manifold = DirectionsManifold::new(&problem.structure)?;
    let ground = Ground::new(problem, &manifold, path)?;
    let drafted = ground.draft(options, observer)?;
    ground.refine(problem, path, drafted, options, observer)
}

/// The best of several plans, smoothed.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct SmoothedPlan {
    /// The plan whose smoothed path costs least; its least stiffness is that of
    /// the smoothed path.
    pub plan: Plan,
    /// What smoothing made of it.
    pub smoothing: Smoothing,
    /// Length of every plan once it was smooth on a coarse mesh, in the order of planning;
    /// `None` where there is none.
    pub draft_lengths: Vec<Option<f64>>,
    /// Control effort of every plan that was smoothed to the end, in the same order;
    /// `None` for the others.
    pub efforts: Vec<Option<f64>>,
    /// CPU seconds of planning, all plans together.
    pub planning_seconds: f64,
    /// CPU seconds of shortcuts and smoothing, all plans together.
    pub smoothing_seconds: f64,
}

/// A plan of several.
struct Candidate<'m> {
    /// Which one it is.
    index: usize,
    plan: Plan,
    ground: Ground<'m>,
    drafted: Drafted,
}

/// Plans, again where elements of the path turn the long way round. Returns the
/// plan whose elements turn least, and the CPU seconds of all.
fn plan_unwound(
    problem: &Problem,
    observer: &mut dyn Observer,
) -> Result<(Plan, f64), PlanningError> {
    let mut best = plan(problem, observer)?;
    let mut seconds = best.planning_seconds;
    let structure = &problem.structure;
    let mut least = net_turns(structure, &best.path);
    let mut seeded = problem.clone();
    for _ in 0..RETRIES {
        if least.total <= least.direct + SAME_TURN {
            break;
        }
        seeded.seed = seeded.seed.wrapping_add(RETRY_STRIDE);
        let Ok(other) = plan(&seeded, observer) else {
            continue;
        };
        seconds += other.planning_seconds;
        let turns = net_turns(structure, &other.path);
        if turns.total < least.total - SAME_TURN {
            (best, least) = (other, turns);
        }
    }
    Ok((best, seconds))
}

/// How far the elements of a path turn from start to goal, rad.
struct NetTurns {
    /// Root of the sum of squares along the path. No path of its class is shorter.
    total: f64,
    /// The same if all took the shorter way round.
    direct: f64,
}

/// The net turns of a planar structure's elements: they differ between two paths by
/// whole turns, and no deformation of a path changes them, as an element that turns
/// back would have to pass the length zero. In space turns have no number: all zero.
fn net_turns(structure: &Structure, path: &Path) -> NetTurns {
    let (mut total, mut direct) = (0.0, 0.0);
    if structure.dimension == 2 {
        for element in &structure.elements {
            let [a, b] = element.nodes;
            let angle = |configuration: &Configuration| {
                let d = configuration.positions[b] - configuration.positions[a];
                d.y.atan2(d.x)
            };
            let angles: Vec<f64> = path.configurations.iter().map(angle).collect();
            let turned = |from: f64, to: f64| {
                let turn = to - from;
                turn - TAU * (turn / TAU).round()
            };
            let along: f64 = angles.windows(2).map(|pair| turned(pair[0], pair[1])).sum();
            total += along * along;
            if let (Some(first), Some(last)) = (angles.first(), angles.last()) {
                direct += turned(*first, *last).powi(2);
            }
        }
    }
    NetTurns {
        total: total.sqrt(),
        direct: direct.sqrt(),
    }
}

/// Plans `plans` times with different seeds, smooths every path on a coarse mesh, which
/// tells how long it will be, and the shortest to the end, or one about as short that cuts
/// less deep into obstacles; also the next one where that came out longer than expected.
/// Each time it plans anew, at most eight times, while an element of the path turns the
/// long way round, and goes on with the path whose elements turn least.
///
/// Paths of different classes, which cannot be deformed into each other without touching
/// anything, have efforts that differ much: one plan alone may be of a poor class. Another
/// one is made in place of each plan that is a fifth longer than the shortest on the
/// coarse mesh, at most as often as there are plans. A single plan is compared with
/// two others at most while the shortest is much longer than the straight
/// line from start to goal.
///
/// The first seed is the problem's.
///
/// # Errors
/// The first [`PlanningError`] when no plan was found at all.
pub fn plan_and_smooth<O: Observer + SmoothObserver>(
    problem: &Problem,
    plans: usize,
    options: &SmoothingOptions,
    observer: &mut O,
) -> Result<SmoothedPlan, PlanningError> {
    let plans = plans.max(1);
    let most = match plans {
        1 => 1 + SECOND_LOOKS,
        _ => 2 * plans,
    };
    let manifold =
        DirectionsManifold::new(&problem.structure).map_err(SmoothingError::Structure)?;
    let mut candidates: Vec<Candidate<'_>> = Vec::new();
    let mut draft_lengths = Vec::new();
    let mut first_error = None;
    let (mut planning_seconds, mut smoothing_seconds) = (0.0, 0.0);
    for index in 0..most {
        let failures = draft_lengths.len() - candidates.len();
        if index >= plans && failures + promising(&candidates, plans) >= plans {
            break;
        }
        let mut seeded = problem.clone();
        seeded.seed = problem
            .seed
            .wrapping_add((index as u64).wrapping_mul(SEED_STRIDE));
        let mut options = options.clone();
        options.shortcut.seed = seeded.seed;
        let drafted = plan_unwound(&seeded, observer).and_then(|(plan, seconds)| {
            planning_seconds += seconds;
            let clock = ThreadTime::now();
            let drafted = Ground::new(problem, &manifold, &plan.path).and_then(|ground| {
                let drafted = ground.draft(&options, observer)?;
                Ok((ground, drafted))
            });
            smoothing_seconds += clock.elapsed().as_secs_f64();
            let (ground, drafted) = drafted?;
            Ok(Candidate {
                index,
                plan,
                ground,
                drafted,
            })
        });
        match drafted {
            Ok(candidate) => {
                draft_lengths.push(Some(candidate.drafted.length));
                candidates.push(candidate);
            }
            Err(error) => {
                draft_lengths.push(None);
                // What keeps one plan from being tried keeps all.
                if error.statistics().is_none() && candidates.is_empty() {
                    return Err(error);
                }
                first_error.get_or_insert(error);
            }
        }
    }
    // A draft may be short because it jumps over obstacles.
    let shortest = shortest(&candidates);
    candidates.sort_by(|a, b| {
        let rank = |Drafted { length, depth, .. }: &Drafted| {
            if *length <= DRAFT_ERROR * shortest {
                (0.0, *depth)
            } else {
                (*length, 0.0)
            }
        };
        let [(a, deep_a), (b, deep_b)] = [rank(&a.drafted), rank(&b.drafted)];
        a.total_cmp(&b).then(deep_a.total_cmp(&deep_b))
    });
    let mut efforts = vec![None; draft_lengths.len()];
    let mut best: Option<(Plan, Smoothing)> = None;
    for candidate in candidates {
        let Candidate {
            index,
            mut plan,
            ground,
            drafted,
        } = candidate;
        let no_better = |(_, found): &(Plan, Smoothing)| {
            found.report.ok && found.path_length <= DRAFT_ERROR * drafted.length
        };
        if best.as_ref().is_some_and(no_better) {
            break;
        }
        let before = drafted.seconds;
        let clock = ThreadTime::now();
        let smoothing = ground.refine(problem, &plan.path, drafted, options, observer);
        smoothing_seconds += match &smoothing {
            Ok(smoothing) => smoothing.seconds - before,
            Err(_) => clock.elapsed().as_secs_f64(),
        };
        match smoothing {
            Ok(smoothing) => {
                efforts[index] = smoothing.control_effort;
                plan.least_stiffness = smoothing.least_stiffness;
                let cost = |s: &Smoothing| {
                    let effort = s.control_effort.unwrap_or(f64::INFINITY);
                    (!s.report.ok, effort)
                };
                let better = best
                    .as_ref()
                    .is_none_or(|(_, best)| cost(&smoothing) < cost(best));
                if better {
                    best = Some((plan, smoothing));
                }
            }
            Err(error) => {
                first_error.get_or_insert(error.into());
            }
        }
    }
    match (best, first_error) {
        (Some((plan, smoothing)), _) => Ok(SmoothedPlan {
            plan,
            smoothing,
            draft_lengths,
            efforts,
            planning_seconds,
            smoothing_seconds,
        }),
        (None, Some(error)) => Err(error),
        (None, None) => Err(PlanningError::Smoothing(SmoothingError::Empty)),
    }
}

/// How many of some plans may be of the best class.
fn promising(candidates: &[Candidate<'_>], plans: usize) -> usize {
    let shortest = shortest(candidates);
    candidates
        .iter()
        .map(|candidate| &candidate.drafted)
        .filter(|draft| {
            draft.length <= HOPELESS * shortest
                && (plans > 1 || draft.length <= DETOUR * draft.straight)
        })
        .count()
}

/// Length of the shortest draft.
fn shortest(candidates: &[Candidate<'_>]) -> f64 {
    candidates.iter().fold(f64::INFINITY, |least, candidate| {
        least.min(candidate.drafted.length)
    })
}
