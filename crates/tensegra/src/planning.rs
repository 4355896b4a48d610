//! From a problem to a plan.

use cpu_time::ThreadTime;
use tensegra_atlas::{ChartDomain, ManifoldError, Validity};
use tensegra_formfinding::FormError;
use tensegra_model::{
    Body, BodyError, Configuration, DirectionsManifold, EquilibriumError, EquilibriumManifold,
    Formulation, FreeSpace, NodesManifold, Path, PlannerKind, Problem, SamplingRadius, Stability,
    Stable, Structure, control_effort, path_length,
};
use tensegra_sampling::{
    AtlasRrt, NeighbourSearch, Observer, PlanError, PlannerOptions, SampleRadius, Statistics,
};

use crate::{
    endpoint::{EndpointError, complete, refine},
    forms::find_endpoints,
};

/// Branches grow in steps this much longer than those of the path, which is made
/// finer when it is found.
const BRANCH_STEP: f64 = 2.0;
/// Points of the path lie at most this multiple of a step apart in the manifold's
/// coordinates, forces included.
const PATH_STEP: f64 = 1.1;
/// Nodes of the trees hold the equations to this multiple of what is asked for; the
/// points of the path hold them to less.
const TREE_TOLERANCE: f64 = 1e5;

/// A path, and how it was found.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Plan {
    /// The motion from start to goal.
    pub path: Path,
    /// Figures of the search.
    pub statistics: Statistics,
    /// CPU seconds of preparation: manifold, start and goal, collision bodies.
    pub preparation_seconds: f64,
    /// CPU seconds of planning alone.
    pub planning_seconds: f64,
    /// Dimension k of the manifold.
    pub dimension: usize,
    /// The smallest eigenvalue of the tangent stiffness along the path on
    /// admissible motions, force per length, with the index of the configuration
    /// that has it; `None` where no motion is admissible.
    pub least_stiffness: Option<(usize, f64)>,
    /// Formulation planned in.
    pub formulation: Formulation,
    /// Seed of every random choice.
    pub seed: u64,
    /// Length of the path in the coordinates of Porta and Hernández-Juan.
    pub path_length: f64,
    /// Control effort of the path in the same coordinates (their eq. 24);
    /// `None` where the path passes a point whose directions are singular.
    pub control_effort: Option<f64>,
}

/// Why there is no plan.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PlanningError {
    /// The structure has no equilibrium manifold.
    #[error(transparent)]
    Structure(#[from] EquilibriumError),
    /// A body has no valid shape.
    #[error(transparent)]
    Body(#[from] BodyError),
    /// There is nothing to say about the statics.
    #[error(transparent)]
    Statics(#[from] tensegra_model::statics::StaticsError),
    /// Start or goal is refused.
    #[error(transparent)]
    Endpoint(#[from] EndpointError),
    /// Start or goal was to be found by form-finding, and was not.
    #[error("the {which} is not found: {error}")]
    Form {
        /// "start" or "goal".
        which: &'static str,
        /// Why.
        error: FormError,
    },
    /// Start or goal is in collision.
    #[error("the {which} is in collision: {a} and {b} overlap by {depth:.3e}")]
    Collision {
        /// "start" or "goal".
        which: &'static str,
        /// Name of one body.
        a: String,
        /// Name of the other body.
        b: String,
        /// Depth of the overlap.
        depth: f64,
    },
    /// Start or goal is not as stable as demanded.
    #[error(
        "the {which} is not stable enough: its smallest stiffness is {stiffness:.4e}, more than \
         {margin:.4e} is demanded"
    )]
    Unstable {
        /// "start" or "goal".
        which: &'static str,
        /// Smallest eigenvalue of the tangent stiffness, force per length.
        stiffness: f64,
        /// What it must exceed.
        margin: f64,
    },
    /// The dimension found is not the one that the problem states.
    #[error(
        "the equilibrium manifold has dimension {found} at the start, but the problem states {stated}"
    )]
    Dimension {
        /// Dimension found.
        found: usize,
        /// Dimension stated.
        stated: usize,
    },
    /// A path was found and could not be smoothed.
    #[error(transparent)]
    Smoothing(#[from] crate::smoothing::SmoothingError),
    /// The planner refused an endpoint or found no path.
    #[error(transparent)]
    Planner(#[from] PlanError),
}

impl From<(&'static str, FormError)> for PlanningError {
    fn from((which, error): (&'static str, FormError)) -> Self {
        Self::Form { which, error }
    }
}

impl PlanningError {
    /// Statistics, where a search took place and found nothing.
    pub fn statistics(&self) -> Option<&Statistics> {
        match self {
            Self::Planner(PlanError::NotFound { statistics, .. }) => Some(statistics),
            _ => None,
        }
    }
}

/// The equilibrium manifold of a structure in a formulation; `reference` sets
/// its scales.
///
/// # Errors
/// [`EquilibriumError`] when the structure's conditions contradict each other.
pub fn equilibrium_manifold(
    structure: &Structure,
    formulation: Formulation,
    reference: &Configuration,
) -> Result<Box<dyn EquilibriumManifold>, EquilibriumError> {
    Ok(match formulation {
        Formulation::Nodes => Box::new(NodesManifold::new(structure, &reference.positions)?),
        Formulation::Directions => Box::new(DirectionsManifold::new(structure)?),
    })
}

/// A structure made ready: its manifold, and its start on it.
pub(crate) struct Grounded {
    pub(crate) manifold: Box<dyn EquilibriumManifold>,
    pub(crate) start: Vec<f64>,
    pub(crate) dimension: usize,
    pub(crate) size: f64,
}

/// Builds the manifold and refines the start onto it; refuses a start in
/// collision.
pub(crate) fn prepare_start(problem: &Problem) -> Result<Grounded, PlanningError> {
    let settings = &problem.settings;
    let structure = &problem.structure;
    let start = problem.start.as_ref();
    let stated = complete(
        structure,
        start.ok_or(EndpointError::Missing { which: "start" })?,
    );
    let size = structure.size(&stated.positions);
    let manifold = equilibrium_manifold(structure, settings.formulation, &stated)?;
    let start = refine(manifold.as_ref(), "start", &stated, size)?;
    let dimension = tensegra_atlas::dimension(manifold.as_ref(), &start);
    if let Some(stated) = settings.expected_dimension
        && stated != dimension
    {
        return Err(PlanningError::Dimension {
            found: dimension,
            stated,
        });
    }
    let grounded = Grounded {
        manifold,
        start,
        dimension,
        size,
    };
    let free = FreeSpace::new(grounded.manifold.as_ref(), &problem.environment, size)?;
    refuse_collision(problem, &free, "start", &grounded.start)?;
    Ok(grounded)
}

pub(crate) fn refuse_collision<M: EquilibriumManifold + ?Sized>(
    problem: &Problem,
    free: &FreeSpace<'_, M>,
    which: &'static str,
    x: &[f64],
) -> Result<(), PlanningError> {
    match free.closest(x) {
        Some(closest) if closest.clearance <= 0.0 => {
            let [a, b] = closest.bodies.map(|body| body_name(problem, body));
            Err(PlanningError::Collision {
                which,
                a,
                b,
                depth: -closest.clearance,
            })
        }
        _ => Ok(()),
    }
}

/// A problem made ready for planning.
pub(crate) struct Prepared {
    grounded: Grounded,
    goal: Vec<f64>,
}

/// Builds the manifold, refines start and goal onto it, and refuses what no
/// planner could solve.
pub(crate) fn prepare(problem: &Problem) -> Result<Prepared, PlanningError> {
    let (Some(_), Some(goal)) = (&problem.start, &problem.goal) else {
        let which = if problem.start.is_none() {
            "start"
        } else {
            "goal"
        };
        return Err(EndpointError::Missing { which }.into());
    };
    let stated = complete(&problem.structure, goal);
    let grounded = prepare_start(problem)?;
    let manifold = grounded.manifold.as_ref();
    let goal = refine(manifold, "goal", &stated, grounded.size)?;
    let at_goal = tensegra_atlas::dimension(manifold, &goal);
    if at_goal != grounded.dimension {
        let error = ManifoldError::DimensionChanges {
            first: grounded.dimension,
            second: at_goal,
        };
        return Err(EndpointError::NoEquilibrium {
            which: "goal",
            error,
        }
        .into());
    }
    let free = FreeSpace::new(manifold, &problem.environment, grounded.size)?;
    refuse_collision(problem, &free, "goal", &goal)?;
    Ok(Prepared { grounded, goal })
}

/// Plans a motion from the problem's start to its goal.
///
/// # Errors
/// [`PlanningError`]: the input is refused, with the offending quantity, or no
/// path was found, with statistics.
pub fn plan(problem: &Problem, observer: &mut dyn Observer) -> Result<Plan, PlanningError> {
    let clock = ThreadTime::now();
    let found = find_endpoints(problem)?;
    let problem = found.as_ref();
    let settings = &problem.settings;
    let Prepared { grounded, goal } = prepare(problem)?;
    let Grounded {
        ref manifold,
        ref start,
        dimension,
        size,
    } = grounded;
    let manifold = manifold.as_ref();
    let mut free = FreeSpace::new(manifold, &problem.environment, size)?;
    free.admit(start);
    free.admit(&goal);
    let free = Stable::new(manifold, settings.actuation, settings.least_stiffness, free);
    for (which, x) in [("start", start), ("goal", &goal)] {
        refuse_instability(&free, which, x)?;
    }
    let preparation_seconds = clock.elapsed().as_secs_f64();
    // As the judge has it: at the first configuration.
    let first = manifold.configuration(start);
    let size = problem.structure.size(&first.positions);
    let planner = AtlasRrt::new(manifold, &free, planner_options(problem))
        .max_displacement(settings.step * size);
    let found = planner.plan(start, &goal, observer)?;
    let path = Path {
        configurations: found
            .points
            .iter()
            .map(|x| manifold.configuration(x))
            .collect(),
    };
    Ok(Plan {
        path_length: path_length(&problem.structure, &path)?,
        least_stiffness: Stability::new(&problem.structure, settings.actuation).least_along(&path),
        control_effort: control_effort(&problem.structure, &path).ok(),
        path,
        planning_seconds: found.statistics.seconds,
        statistics: found.statistics,
        preparation_seconds,
        dimension,
        formulation: settings.formulation,
        seed: problem.seed,
    })
}

/// The planner's options from a problem's settings.
fn planner_options(problem: &Problem) -> PlannerOptions {
    let settings = &problem.settings;
    let mut options = PlannerOptions::default();
    options.seed = problem.seed;
    options.two_trees = settings.planner == PlannerKind::TwoTrees;
    options.step = BRANCH_STEP * settings.step;
    options.domain = ChartDomain {
        radius: settings.chart_radius,
        error: settings.chart_error,
        cosine: 1.0 - settings.curvature,
    };
    options.sample_radius = match settings.sampling_radius {
        SamplingRadius::Automatic | SamplingRadius::Adaptive => options.sample_radius,
        SamplingRadius::Fixed(radius) => SampleRadius::Fixed(radius),
    };
    options.neighbours = match settings.neighbours {
        tensegra_model::NeighbourSearch::ByChart => NeighbourSearch::ByChart,
        tensegra_model::NeighbourSearch::Linear => NeighbourSearch::Linear,
        tensegra_model::NeighbourSearch::KdTree => NeighbourSearch::KdTree,
    };
    options.slide = settings.slide;
    options.path_step = PATH_STEP * settings.step;
    options.tolerance = (TREE_TOLERANCE * settings.tolerance).min(options.tolerance);
    options.max_charts = settings.max_charts;
    options.max_nodes = settings.max_nodes;
    options.time_limit = settings.time_limit;
    options
}

/// Refuses a start or goal that is not as stable as demanded.
pub(crate) fn refuse_instability<M: EquilibriumManifold + ?Sized, V: Validity>(
    stable: &Stable<'_, M, V>,
    which: &'static str,
    x: &[f64],
) -> Result<(), PlanningError> {
    match stable.shortfall(x) {
        None => Ok(()),
        Some((stiffness, margin)) => Err(PlanningError::Unstable {
            which,
            stiffness,
            margin,
        }),
    }
}

/// Name of a body, for messages.
pub(crate) fn body_name(problem: &Problem, body: Body) -> String {
    match body {
        Body::Element(i) => problem.structure.elements[i].name.clone(),
        Body::Attachment(i) => problem.structure.attachments[i].name.clone(),
        Body::Obstacle(i) => problem.environment.obstacles[i].name.clone(),
    }
}
