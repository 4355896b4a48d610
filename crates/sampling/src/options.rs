//! Parameters of the planners.

use tensegra_atlas::ChartDomain;

use crate::plan::PlanError;

/// Radius of the ball in a chart's tangent space from which samples are drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SampleRadius {
    /// One radius for all charts.
    Fixed(f64),
    /// A radius for each chart that grows by a factor of 1.2 when a branch
    /// towards a sample arrives and shrinks by 0.8 when it does not, between a
    /// chart's radius and the given largest radius (Porta and Jaillet 2014).
    Adaptive {
        /// Largest radius, and that of a new chart.
        largest: f64,
    },
}

/// How the node nearest to a sample is found; all are exact.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum NeighbourSearch {
    /// Nodes are grouped by chart, and groups that are too far are skipped. A query
    /// costs a distance for each chart, and one for each node of charts nearby.
    #[default]
    ByChart,
    /// A distance for each node.
    Linear,
    /// A k-d tree. It divides along single coordinates, of which there are more than
    /// the manifold has dimensions.
    KdTree,
}

/// Parameters of [`AtlasRrt`](crate::AtlasRrt). The defaults solve all benchmark
/// problems; distances are in the manifold's coordinates.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct PlannerOptions {
    /// Seed of every random choice.
    pub seed: u64,
    /// Whether a second tree grows from the goal.
    pub two_trees: bool,
    /// Length δ of a step of a branch.
    pub step: f64,
    /// Largest distance between neighbouring points of the path returned. They lie as
    /// far apart as this and the length of a step allow.
    pub path_step: f64,
    /// How far charts reach.
    pub domain: ChartDomain,
    /// Radius ρ_s of sampling.
    pub sample_radius: SampleRadius,
    /// How nearest nodes are found.
    pub neighbours: NeighbourSearch,
    /// Probability that a branch aims at a random node of the other tree (at
    /// the goal, with one tree) instead of at a sample.
    pub goal_bias: f64,
    /// Residual of the nodes of the trees. Those of the path returned hold to
    /// 1e-10.
    pub tolerance: f64,
    /// Whether branches slide along limits and contacts instead of stopping.
    pub slide: bool,
    /// Distance inside a limit at which a sliding branch aims.
    pub limit_margin: f64,
    /// Clearance at which a sliding branch aims.
    pub contact_margin: f64,
    /// Tree nodes after which the search starts anew, with a tenth more each time:
    /// another attempt may be faster than a very unlucky one, but large trees find
    /// narrow passages sooner than small ones.
    pub restart_nodes: usize,
    /// Charts, of all attempts, after which planning is given up.
    pub max_charts: usize,
    /// Tree nodes, of all attempts, after which planning is given up.
    pub max_nodes: usize,
    /// CPU seconds of the planning thread after which planning is given up.
    pub time_limit: f64,
}

impl Default for PlannerOptions {
    fn default() -> Self {
        Self {
            seed: 1,
            two_trees: true,
            step: 0.05,
            path_step: f64::INFINITY,
            domain: ChartDomain::default(),
            sample_radius: SampleRadius::Adaptive { largest: 24.0 },
            neighbours: NeighbourSearch::default(),
            goal_bias: 0.1,
            tolerance: 1e-4,
            slide: true,
            limit_margin: 2e-3,
            contact_margin: 3e-3,
            restart_nodes: 20_000,
            max_charts: 150_000,
            max_nodes: 250_000,
            time_limit: 600.0,
        }
    }
}

impl PlannerOptions {
    /// Refuses lengths that are not positive: steps of no length never end.
    pub(crate) fn check(&self) -> Result<(), PlanError> {
        let sampled = match self.sample_radius {
            SampleRadius::Fixed(radius) | SampleRadius::Adaptive { largest: radius } => radius,
        };
        [
            ("step", self.step),
            ("path_step", self.path_step),
            ("domain.radius", self.domain.radius),
            ("domain.error", self.domain.error),
            ("domain.cosine", self.domain.cosine),
            ("sample_radius", sampled),
            ("tolerance", self.tolerance),
        ]
        .into_iter()
        .find(|(_, value)| value.is_nan() || *value <= 0.0)
        .map_or(Ok(()), |(name, value)| {
            Err(PlanError::Option { name, value })
        })
    }
}
