//! What planning returns.

use tensegra_atlas::ManifoldError;

/// How often branches stopped, by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct StopCounts {
    /// The branch reached its target.
    pub reached: usize,
    /// A bound or limit left no way on.
    pub limit: usize,
    /// A contact left no way on.
    pub contact: usize,
    /// An obstruction that no contact describes.
    pub blocked: usize,
    /// Sliding did not come nearer to the target.
    pub no_progress: usize,
    /// Corrections of a sliding step did not settle.
    pub correction: usize,
    /// No point of the manifold was found, even on a fresh chart.
    pub projection: usize,
    /// The manifold is singular there.
    pub singular: usize,
}

/// Figures of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Statistics {
    /// CPU seconds of the planning thread.
    pub seconds: f64,
    /// Charts built.
    pub charts: usize,
    /// Nodes added to trees.
    pub nodes: usize,
    /// How often the search started anew.
    pub restarts: usize,
    /// Branches begun.
    pub extensions: usize,
    /// Branches that added a node.
    pub productive_extensions: usize,
    /// Projections onto the manifold.
    pub projections: usize,
    /// Chord iterations of all projections.
    pub chord_iterations: usize,
    /// Newton iterations of all projections.
    pub newton_iterations: usize,
    /// Steps whose validity was tested.
    pub validity_tests: usize,
    /// Steps that slid along limits or contacts.
    pub sliding_steps: usize,
    /// Why branches stopped.
    pub stops: StopCounts,
}

/// A path on the manifold.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Plan {
    /// Points of the manifold from start to goal, a step apart.
    pub points: Vec<Vec<f64>>,
    /// Figures of the run.
    pub statistics: Statistics,
    /// All tree nodes with the index of their parents, where asked for.
    pub trees: Option<Vec<(Vec<f64>, Option<usize>)>>,
}

/// Which limit ended planning without a path.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Failure {
    /// The time limit.
    #[error("the time limit was reached")]
    Time,
    /// The largest number of charts.
    #[error("the largest number of charts was reached")]
    Charts,
    /// The largest number of nodes.
    #[error("the largest number of nodes was reached")]
    Nodes,
    /// No branch made any progress for a long time.
    #[error("no branch makes progress any more")]
    NoProgress,
    /// A path was found, but not as fine as asked for: points between its nodes
    /// leave the limits or are not clear.
    #[error("no path as fine as asked for was found")]
    Resolution,
    /// The observer asked to stop.
    #[error("planning was cancelled")]
    Cancelled,
}

/// Why there is no path.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PlanError {
    /// The search ended at a limit.
    #[error("no path found: {failure} ({} charts, {} nodes, {:.3} s)",
        statistics.charts, statistics.nodes, statistics.seconds)]
    NotFound {
        /// The limit.
        failure: Failure,
        /// Figures of the run.
        statistics: Box<Statistics>,
    },
    /// An option makes no sense.
    #[error("the option {name} is {value}: give a positive number")]
    Option {
        /// Its name.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// Start or goal is not valid by itself.
    #[error("the {which} is not valid: {reason}")]
    InvalidEndpoint {
        /// "start" or "goal".
        which: &'static str,
        /// The offending quantity.
        reason: String,
    },
    /// Start or goal cannot be a chart's centre, or the dimensions differ.
    #[error("the {which} is not a regular point of the manifold: {error}")]
    Manifold {
        /// "start" or "goal".
        which: &'static str,
        /// What is wrong.
        error: ManifoldError,
    },
}

/// How far planning has come.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Progress {
    /// CPU seconds so far.
    pub seconds: f64,
    /// Charts so far.
    pub charts: usize,
    /// Nodes so far.
    pub nodes: usize,
}

/// Watches a planner and may cancel it.
pub trait Observer {
    /// Called now and then; `false` cancels planning.
    fn progress(&mut self, progress: &Progress) -> bool;
}

/// Watches nothing.
impl Observer for () {
    fn progress(&mut self, _: &Progress) -> bool {
        true
    }
}
