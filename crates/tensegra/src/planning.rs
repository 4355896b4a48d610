//! From a problem to a plan.

use cpu_time::ThreadTime;
use tensegra_atlas::{ChartDomain, ManifoldError};
use tensegra_formfinding::FormError;
use tensegra_model::{
    Body, BodyError, Configuration, DirectionsManifold, Endpoint, EquilibriumError,
    EquilibriumManifold, Formulation, FreeSpace, NodesManifold, Path, PlannerKind, Problem,
    SamplingRadius, Structure, control_effort, path_length,
};
use tensegra_sampling::{AtlasRrt, Observer, PlanError, PlannerOptions, SampleRadius, Statistics};

use crate::{
    endpoint::{EndpointError, complete, refine},
    forms::find_endpoints,
};

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

/// A problem made ready for planning.
pub(crate) struct Prepared {
    manifold: Box<dyn EquilibriumManifold>,
    start: Vec<f64>,
    goal: Vec<f64>,
    dimension: usize,
    size: f64,
}

/// Builds the manifold, refines start and goal onto it, and refuses what no
/// planner could solve.
pub(crate) fn prepare(problem: &Problem) -> Result<Prepared, PlanningError> {
    let settings = &problem.settings;
    let structure = &problem.structure;
    let stated = |which, endpoint: &Option<Endpoint>| match endpoint {
        Some(endpoint) => Ok(complete(structure, endpoint)),
        None => Err(EndpointError::Missing { which }),
    };
    let stated_start = stated("start", &problem.start)?;
    let stated_goal = stated("goal", &problem.goal)?;
    let size = NodesManifold::new(structure, &stated_start.positions)?.size();
    let manifold = equilibrium_manifold(structure, settings.formulation, &stated_start)?;
    let start = refine(manifold.as_ref(), "start", &stated_start, size)?;
    let goal = refine(manifold.as_ref(), "goal", &stated_goal, size)?;
    let dimension = tensegra_atlas::dimension(manifold.as_ref(), &start);
    if let Some(stated) = settings.expected_dimension
        && stated != dimension
    {
        return Err(PlanningError::Dimension {
            found: dimension,
            stated,
        });
    }
    let at_goal = tensegra_atlas::dimension(manifold.as_ref(), &goal);
    if at_goal != dimension {
        let error = ManifoldError::DimensionChanges {
            first: dimension,
            second: at_goal,
        };
        return Err(EndpointError::NoEquilibrium {
            which: "goal",
            error,
        }
        .into());
    }
    let free = FreeSpace::new(manifold.as_ref(), &problem.environment, size)?;
    for (which, x) in [("start", &start), ("goal", &goal)] {
        if let Some(closest) = free.closest(x)
            && closest.clearance <= 0.0
        {
            let [a, b] = closest.bodies.map(|body| body_name(problem, body));
            return Err(PlanningError::Collision {
                which,
                a,
                b,
                depth: -closest.clearance,
            });
        }
    }
    Ok(Prepared {
        manifold,
        start,
        goal,
        dimension,
        size,
    })
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
    let prepared = prepare(problem)?;
    let manifold = prepared.manifold.as_ref();
    let mut free = FreeSpace::new(manifold, &problem.environment, prepared.size)?;
    free.admit(&prepared.start);
    free.admit(&prepared.goal);
    let preparation_seconds = clock.elapsed().as_secs_f64();
    let planner = AtlasRrt::new(manifold, &free, planner_options(problem))
        .max_displacement(settings.step * prepared.size);
    let found = planner.plan(&prepared.start, &prepared.goal, observer)?;
    let path = Path {
        configurations: found
            .points
            .iter()
            .map(|x| manifold.configuration(x))
            .collect(),
    };
    Ok(Plan {
        path_length: path_length(&problem.structure, &path)?,
        control_effort: control_effort(&problem.structure, &path).ok(),
        path,
        planning_seconds: found.statistics.seconds,
        statistics: found.statistics,
        preparation_seconds,
        dimension: prepared.dimension,
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
    options.step = settings.step;
    options.domain = ChartDomain {
        radius: settings.chart_radius,
        error: settings.chart_error,
        cosine: 1.0 - settings.curvature,
    };
    options.sample_radius = match settings.sampling_radius {
        SamplingRadius::Automatic => options.sample_radius,
        SamplingRadius::Fixed(radius) => SampleRadius::Fixed(radius),
        SamplingRadius::Adaptive => SampleRadius::Adaptive { largest: 3.0 },
    };
    options.tolerance = settings.tolerance.max(1e-10);
    options.max_charts = settings.max_charts;
    options.max_nodes = settings.max_nodes;
    options.time_limit = settings.time_limit;
    options
}

/// Name of a body, for messages.
pub(crate) fn body_name(problem: &Problem, body: Body) -> String {
    match body {
        Body::Element(i) => problem.structure.elements[i].name.clone(),
        Body::Attachment(i) => problem.structure.attachments[i].name.clone(),
        Body::Obstacle(i) => problem.environment.obstacles[i].name.clone(),
    }
}
