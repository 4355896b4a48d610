//! The atlas of a structure's whole equilibrium component, and paths over it.

use std::collections::BTreeMap;

use cpu_time::ThreadTime;
use nalgebra::Point3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use tensegra_atlas::{
    BilliardWalk, Border, ChartDomain, ComponentAtlas, Continuation, ContinuationError,
    ContinuationOptions, ManifoldError, RouteError, RouteOptions, Workspace,
};
use tensegra_io::{AtlasFile, BorderRecord, ChartRecord};
use tensegra_model::{
    Configuration, EquilibriumManifold, Formulation, FreeSpace, Path, Problem, Stable,
};
use tensegra_sampling::{Observer, Progress};

use crate::{
    endpoint::{EndpointError, complete, refine},
    forms::find_endpoints,
    planning::{
        Grounded, PlanningError, body_name, equilibrium_manifold, prepare_start, refuse_collision,
        refuse_instability,
    },
};

/// Steps between the points that a coverage is measured at, and their length.
const WALK_STEP: f64 = 0.05;

/// The atlas of the component of a structure's equilibrium manifold that its
/// start lies on: all configurations that it can reach within its ranges and
/// without collision.
pub struct EquilibriumAtlas {
    pub(crate) manifold: Box<dyn EquilibriumManifold>,
    /// Charts, and how they hang together.
    pub charts: ComponentAtlas,
    /// Coordinates in which the manifold is described.
    pub formulation: Formulation,
    /// Whether all of the component is explored.
    pub complete: bool,
    /// What ends the component, with the number of directions in which it does,
    /// in descending order.
    pub borders: Vec<BorderRecord>,
    /// CPU seconds of the continuation alone.
    pub seconds: f64,
    /// Validity tests of ways between centres.
    pub validity_tests: usize,
    /// Node positions that set the scales of the coordinates.
    reference: Vec<Point3<f64>>,
    size: f64,
}

/// How much of a component the charts of an atlas cover.
#[derive(Clone, Debug, PartialEq)]
pub struct Coverage {
    /// Points of the component, traced at random from the start.
    pub points: usize,
    /// How many of them lie in the domain of a chart.
    pub covered: usize,
}

/// A path found over an atlas.
#[derive(Clone, Debug)]
pub struct AtlasPath {
    /// The motion from start to goal.
    pub path: Path,
    /// The charts that it passes.
    pub charts: Vec<usize>,
    /// Ways between charts that were tested.
    pub tested: usize,
    /// CPU seconds of the search.
    pub seconds: f64,
}

/// Why there is no atlas, or no path over it.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum AtlasError {
    /// The structure, its start or its goal is refused.
    #[error(transparent)]
    Problem(#[from] PlanningError),
    /// The component cannot be explored.
    #[error(transparent)]
    Continuation(#[from] ContinuationError),
    /// The search found no path.
    #[error(transparent)]
    Route(#[from] RouteError),
    /// A chart of a file is no chart of the problem's manifold.
    #[error(
        "the atlas does not belong to the structure of `{problem}`: chart {chart} is not in \
         equilibrium there ({error}); build an atlas of this problem"
    )]
    OtherManifold {
        /// Name of the problem.
        problem: String,
        /// The chart.
        chart: usize,
        /// What is wrong with it.
        error: ManifoldError,
    },
    /// The numbers of a file do not fit the problem.
    #[error(
        "the atlas does not belong to the structure of `{problem}`: {difference}; build an atlas \
         of this problem"
    )]
    OtherStructure {
        /// Name of the problem.
        problem: String,
        /// What differs.
        difference: String,
    },
}

/// Explores the whole component that the problem's start lies on, by
/// higher-dimensional continuation. Chart radius and error, the largest number of
/// charts and the time limit are the problem's settings.
///
/// # Errors
/// [`AtlasError`] when the start will not do. A limit that is met is no error: the
/// atlas is then not complete.
pub fn explore(
    problem: &Problem,
    observer: &mut dyn Observer,
) -> Result<EquilibriumAtlas, AtlasError> {
    let found = find_endpoints(problem).map_err(PlanningError::from)?;
    let problem = found.as_ref();
    let settings = &problem.settings;
    let Grounded {
        manifold,
        start,
        size,
        ..
    } = prepare_start(problem)?;
    let free = valid_space(problem, manifold.as_ref(), size, &[("start", &start)])?;
    let mut options = ContinuationOptions::default();
    options.domain = ChartDomain {
        radius: settings.chart_radius,
        error: settings.chart_error,
        cosine: 1.0 - settings.curvature,
    };
    options.tolerance = settings.tolerance.max(1e-10);
    options.max_charts = settings.max_charts;
    let clock = ThreadTime::now();
    let mut go_on = |charts: usize| {
        let mut progress = Progress::default();
        progress.charts = charts;
        // The clock is a system call: not for every chart.
        if charts.is_multiple_of(16) {
            progress.seconds = clock.elapsed().as_secs_f64();
            return progress.seconds <= settings.time_limit && observer.progress(&progress);
        }
        true
    };
    let exploration =
        Continuation::new(manifold.as_ref(), &free, options).explore(&start, &mut go_on)?;
    let seconds = clock.elapsed().as_secs_f64();
    // The parts of a prismatic strut have one name.
    let mut counts = BTreeMap::new();
    for (&border, &count) in &exploration.borders {
        let name = match border {
            Border::Contact(contact) => {
                let [a, b] = free
                    .inner()
                    .bodies(contact)
                    .map(|body| body_name(problem, body));
                format!("{a} and {b}")
            }
            other => other.name(manifold.as_ref()),
        };
        *counts.entry((border_kind(border), name)).or_insert(0) += count;
    }
    let mut borders: Vec<BorderRecord> = counts
        .into_iter()
        .map(|((kind, name), count)| BorderRecord {
            kind: kind.to_owned(),
            name,
            count,
        })
        .collect();
    borders.sort_by(|a, b| b.count.cmp(&a.count).then_with(|| a.name.cmp(&b.name)));
    Ok(EquilibriumAtlas {
        charts: exploration.atlas,
        formulation: settings.formulation,
        complete: exploration.complete,
        borders,
        seconds,
        validity_tests: exploration.validity_tests,
        reference: reference(problem),
        size,
        manifold,
    })
}

/// Which sort of border it is: "limit", "contact", "singularity" or "curvature".
pub(crate) fn border_kind(border: Border) -> &'static str {
    match border {
        Border::Lower(_) | Border::Upper(_) | Border::Limit(_) => "limit",
        Border::Singular => "singularity",
        Border::Curvature => "curvature",
        _ => "contact",
    }
}

/// Node positions that set the scales of the manifold of a problem.
fn reference(problem: &Problem) -> Vec<Point3<f64>> {
    let start = problem.start.as_ref();
    start.map_or_else(Vec::new, |start| start.positions.clone())
}

/// What is free of collisions and, where the problem demands it, stable.
type ValidSpace<'a, M> = Stable<'a, M, FreeSpace<'a, M>>;

/// The valid space of a problem, with the given points in it.
fn valid_space<'a, M: EquilibriumManifold + ?Sized>(
    problem: &Problem,
    manifold: &'a M,
    size: f64,
    points: &[(&'static str, &[f64])],
) -> Result<ValidSpace<'a, M>, PlanningError> {
    let settings = &problem.settings;
    let mut free = FreeSpace::new(manifold, &problem.environment, size)?;
    for &(which, x) in points {
        refuse_collision(problem, &free, which, x)?;
        free.admit(x);
    }
    let valid = Stable::new(manifold, settings.actuation, settings.least_stiffness, free);
    for &(which, x) in points {
        refuse_instability(&valid, which, x)?;
    }
    Ok(valid)
}

impl EquilibriumAtlas {
    /// Dimension k of the manifold.
    pub fn dimension(&self) -> usize {
        self.charts.dimension()
    }

    /// Charts whose domain ends at a border of the component.
    pub fn border_charts(&self) -> usize {
        (0..self.charts.len())
            .filter(|&i| self.charts.is_at_border(i))
            .count()
    }

    /// The space that the atlas was explored in.
    pub(crate) fn valid_space(
        &self,
        problem: &Problem,
    ) -> Result<ValidSpace<'_, dyn EquilibriumManifold>, PlanningError> {
        let start = self.charts.chart(0).center();
        valid_space(
            problem,
            self.manifold.as_ref(),
            self.size,
            &[("start", start)],
        )
    }

    /// The chart in whose domain the equilibrium nearest to a configuration lies; `None`
    /// where none is near, or it lies on no chart: beyond what is explored, or on another
    /// component.
    pub fn covering(&self, configuration: &Configuration) -> Option<usize> {
        let manifold = self.manifold.as_ref();
        let x = refine(manifold, "configuration", configuration, self.size).ok()?;
        self.charts
            .covering(manifold, &x, &mut Workspace::default())
    }

    /// A path from the problem's start to its goal by graph search over the
    /// charts. The problem may be another one than the atlas was explored for,
    /// with the same structure: ways between charts are tested in its environment.
    ///
    /// # Errors
    /// [`AtlasError`] when an endpoint is refused or on no chart, or there is no
    /// valid way.
    pub fn answer(&self, problem: &Problem) -> Result<AtlasPath, AtlasError> {
        let found = find_endpoints(problem).map_err(PlanningError::from)?;
        let problem = found.as_ref();
        let structure = &problem.structure;
        let manifold = self.manifold.as_ref();
        let endpoint = |which, stated: &Option<_>| -> Result<Vec<f64>, PlanningError> {
            let stated = stated.as_ref().ok_or(EndpointError::Missing { which })?;
            let stated = complete(structure, stated);
            Ok(refine(manifold, which, &stated, self.size)?)
        };
        let start = endpoint("start", &problem.start)?;
        let goal = endpoint("goal", &problem.goal)?;
        let ends: [(&'static str, &[f64]); 2] = [("start", &start), ("goal", &goal)];
        let free = valid_space(problem, manifold, self.size, &ends)?;
        let mut options = RouteOptions::default();
        options.step = problem.settings.step;
        options.max_displacement = problem.settings.step * self.size;
        options.tolerance = problem.settings.tolerance.max(1e-10);
        let clock = ThreadTime::now();
        let route = self
            .charts
            .route(manifold, &free, [&start, &goal], &options)?;
        let seconds = clock.elapsed().as_secs_f64();
        let configurations = route.points.iter().map(|x| manifold.configuration(x));
        Ok(AtlasPath {
            path: Path {
                configurations: configurations.collect(),
            },
            charts: route.charts,
            tested: route.tested,
            seconds,
        })
    }

    /// Traces `points` points of the component at random from its start, by small
    /// steps that know nothing of the atlas, and counts those that a chart covers.
    ///
    /// # Errors
    /// [`AtlasError`] when the problem is not the one that was explored.
    pub fn measure_coverage(
        &self,
        problem: &Problem,
        points: usize,
        seed: u64,
    ) -> Result<Coverage, AtlasError> {
        let free = self.valid_space(problem)?;
        let manifold = self.manifold.as_ref();
        let mut random = Pcg64::seed_from_u64(seed);
        let start = self.charts.chart(0).center();
        let mut walk = BilliardWalk::new(manifold, &free, start, WALK_STEP, || random.random());
        let mut work = Workspace::default();
        let mut coverage = Coverage { points, covered: 0 };
        for _ in 0..points {
            let x = walk.advance().map_err(ContinuationError::from)?;
            let chart = self.charts.covering(manifold, x, &mut work);
            coverage.covered += usize::from(chart.is_some());
        }
        Ok(coverage)
    }

    /// The atlas as a file keeps it.
    pub fn to_file(&self, problem: &Problem) -> AtlasFile {
        let domain = self.charts.domain();
        let mut file = AtlasFile::new(problem, self.formulation);
        file.reference.clone_from(&self.reference);
        file.dimension = self.dimension();
        file.radius = domain.radius;
        file.error = domain.error;
        file.cosine = domain.cosine;
        file.complete = self.complete;
        file.borders.clone_from(&self.borders);
        file.charts = (0..self.charts.len())
            .map(|i| ChartRecord {
                center: self.charts.chart(i).center().to_vec(),
                radius: self.charts.radius(i),
                parent: self.charts.parent(i),
            })
            .collect();
        file
    }

    /// The atlas of a file, for queries of `problem`: its charts are built again.
    ///
    /// # Errors
    /// [`AtlasError`] when the file's charts are none of the problem's manifold.
    pub fn from_file(file: &AtlasFile, problem: &Problem) -> Result<Self, AtlasError> {
        let other = |difference: String| AtlasError::OtherStructure {
            problem: problem.name.clone(),
            difference,
        };
        if let Some(difference) = file.difference(problem) {
            return Err(other(difference));
        }
        let formulation = file.formulation;
        let size = problem.structure.size(&file.reference);
        let reference = tensegra_model::Endpoint::at(file.reference.clone(), &problem.structure);
        let reference = complete(&problem.structure, &reference);
        let manifold = equilibrium_manifold(&problem.structure, formulation, &reference)
            .map_err(PlanningError::from)?;
        let domain = ChartDomain {
            radius: file.radius,
            error: file.error,
            cosine: file.cosine,
        };
        let charts = file
            .charts
            .iter()
            .map(|chart| (chart.center.clone(), chart.radius, chart.parent));
        let charts = ComponentAtlas::rebuild(manifold.as_ref(), file.dimension, domain, charts)
            .map_err(|(chart, error)| AtlasError::OtherManifold {
                problem: problem.name.clone(),
                chart,
                error,
            })?;
        Ok(Self {
            manifold,
            charts,
            formulation,
            complete: file.complete,
            borders: file.borders.clone(),
            seconds: 0.0,
            validity_tests: 0,
            reference: file.reference.clone(),
            size,
        })
    }
}
