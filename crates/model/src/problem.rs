//! A planning problem: structure, environment, start, goal and settings.

use std::path::{Path, PathBuf};

use nalgebra::Point3;

use crate::{
    diagnostic::{Finding, ReadErrors, SourceFile},
    environment::Environment,
    form::{FormCondition, FormSettings},
    problem_file,
    statics::Actuation,
    structure::Structure,
};

/// The coordinates in which the equilibrium manifold is described.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Formulation {
    /// Node coordinates and force densities; everything that has a closed form
    /// is eliminated. Compact and fast.
    #[default]
    Nodes,
    /// Unit directions, lengths, rest lengths and forces, as in Porta and
    /// Hernández-Juan (2016).
    Directions,
}

/// Which planner to run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum PlannerKind {
    /// AtlasRRT with one tree from the start and one from the goal.
    #[default]
    TwoTrees,
    /// AtlasRRT with one tree from the start.
    OneTree,
}

/// Radius ρ_s of the ball around a chart's centre from which samples are drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum SamplingRadius {
    /// The planner's own choice: an adaptive one (the dimension k of the manifold in the
    /// paper).
    #[default]
    Automatic,
    /// A given radius.
    Fixed(f64),
    /// A radius for each chart that grows with success and shrinks with failure
    /// (Porta and Jaillet, 2014).
    Adaptive,
}

/// How a planner finds the node of its tree that is nearest to a point. All ways find
/// the same node; they differ in speed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum NeighbourSearch {
    /// Nodes grouped by chart.
    #[default]
    ByChart,
    /// All nodes, one after the other.
    Linear,
    /// A k-d tree.
    KdTree,
}

impl NeighbourSearch {
    /// All ways, with the names that files know them by.
    pub const NAMED: [(&str, Self); 3] = [
        ("chart", Self::ByChart),
        ("linear", Self::Linear),
        ("kd-tree", Self::KdTree),
    ];
}

/// Parameters of planning; the defaults are those of Porta and Hernández-Juan (2016).
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct PlannerSettings {
    /// Which planner to run.
    pub planner: PlannerKind,
    /// Coordinates of the manifold.
    pub formulation: Formulation,
    /// Residual below which the equations hold.
    pub tolerance: f64,
    /// Radius ρ of a chart.
    pub chart_radius: f64,
    /// Largest distance ε between a chart and the manifold.
    pub chart_error: f64,
    /// Largest relative shortening of a step in tangent space against the step
    /// on the manifold (CE).
    pub curvature: f64,
    /// Step δ: no node moves farther than this times the structure's size in a
    /// step of the path. Branches grow in steps twice as long.
    pub step: f64,
    /// Radius from which samples are drawn.
    pub sampling_radius: SamplingRadius,
    /// How nearest nodes are found.
    pub neighbours: NeighbourSearch,
    /// Whether branches slide along limits and contacts instead of stopping there.
    pub slide: bool,
    /// Newton iterations after which a projection is given up.
    pub max_newton_iterations: usize,
    /// Charts after which planning is given up.
    pub max_charts: usize,
    /// Tree nodes after which planning is given up.
    pub max_nodes: usize,
    /// CPU seconds after which planning is given up.
    pub time_limit: f64,
    /// What motors keep constant when their elements are disturbed.
    pub actuation: Actuation,
    /// What the smallest eigenvalue of the tangent stiffness must exceed all
    /// along (force per length); no demand where there is none.
    pub least_stiffness: Option<f64>,
    /// Dimension k of the manifold, where the file states it: checked against
    /// the one found.
    pub expected_dimension: Option<usize>,
}

impl Default for PlannerSettings {
    fn default() -> Self {
        Self {
            planner: PlannerKind::default(),
            formulation: Formulation::default(),
            tolerance: 1e-9,
            chart_radius: 0.4,
            chart_error: 0.1,
            curvature: 0.1,
            step: 0.05,
            sampling_radius: SamplingRadius::default(),
            neighbours: NeighbourSearch::default(),
            slide: true,
            max_newton_iterations: 50,
            max_charts: 150_000,
            max_nodes: 250_000,
            time_limit: 600.0,
            actuation: Actuation::default(),
            least_stiffness: None,
            expected_dimension: None,
        }
    }
}

/// A start or goal as a file states it, before it is refined onto the manifold.
#[derive(Clone, Debug, PartialEq)]
pub struct Endpoint {
    /// Position of every node.
    pub positions: Vec<Point3<f64>>,
    /// Force of every element, where stated.
    pub forces: Vec<Option<f64>>,
    /// Rest length of every element, where stated.
    pub rest_lengths: Vec<Option<f64>>,
}

impl Endpoint {
    /// An endpoint that states positions alone.
    pub fn at(positions: Vec<Point3<f64>>, structure: &Structure) -> Self {
        let elements = structure.elements.len();
        Self {
            positions,
            forces: vec![None; elements],
            rest_lengths: vec![None; elements],
        }
    }
}

/// A planning problem.
#[derive(Clone, Debug, PartialEq)]
pub struct Problem {
    /// Name, for reports and folders of results.
    pub name: String,
    /// The file it was read from.
    pub source: Option<PathBuf>,
    /// The structure.
    pub structure: Structure,
    /// Obstacles and collision pairs.
    pub environment: Environment,
    /// Where the motion starts.
    pub start: Option<Endpoint>,
    /// Where it ends.
    pub goal: Option<Endpoint>,
    /// What is asked of the start, where it is to be found by form-finding.
    pub start_form: Option<Vec<FormCondition>>,
    /// The same of the goal.
    pub goal_form: Option<Vec<FormCondition>>,
    /// Settings of form-finding.
    pub form: FormSettings,
    /// Parameters of planning.
    pub settings: PlannerSettings,
    /// Seed of every random choice.
    pub seed: u64,
    /// The texts it was read from, the file named by `source` first.
    pub files: Vec<SourceFile>,
    /// Warnings and notes from reading.
    pub notices: Vec<Finding>,
}

impl Problem {
    /// A problem without obstacles, start and goal, with default settings.
    pub fn new(name: impl Into<String>, structure: Structure) -> Self {
        Self {
            name: name.into(),
            source: None,
            structure,
            environment: Environment::default(),
            start: None,
            goal: None,
            start_form: None,
            goal_form: None,
            form: FormSettings::default(),
            settings: PlannerSettings::default(),
            seed: 0,
            files: Vec::new(),
            notices: Vec::new(),
        }
    }

    /// Reads a problem file (`.toml`), or a structure file (`.tens`) with its
    /// siblings `.param` and `.links`, rows 1 and 2 of which are start and goal.
    ///
    /// # Errors
    /// Everything found to be wrong, each with file, line, column and a hint.
    pub fn read(path: &Path) -> Result<Self, ReadErrors> {
        problem_file::read(path)
    }
}
