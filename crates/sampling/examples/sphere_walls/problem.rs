//! The problem: from pole to pole of a sphere, through three walls.

use tensegra_atlas::{ImplicitManifold, Predicate, SparsityPattern, Validity};
use tensegra_sampling::{PlannerOptions, SampleRadius};

/// The unit sphere in space: F(x) = (|x|² − 1) / 2.
pub struct Sphere {
    pattern: SparsityPattern,
}

impl Sphere {
    pub fn new() -> Self {
        // One equation, in which all three variables occur.
        let pattern = SparsityPattern::dense(1, 3);
        Self { pattern }
    }
}

impl ImplicitManifold for Sphere {
    fn ambient_dimension(&self) -> usize {
        3
    }

    fn equation_count(&self) -> usize {
        1
    }

    fn residual(&self, x: &[f64], residual: &mut [f64]) {
        residual[0] = 0.5 * (x[0] * x[0] + x[1] * x[1] + x[2] * x[2] - 1.0);
    }

    fn jacobian_pattern(&self) -> &SparsityPattern {
        &self.pattern
    }

    fn jacobian(&self, x: &[f64], values: &mut [f64]) {
        values.copy_from_slice(x);
    }

    fn lower_bounds(&self) -> &[f64] {
        &[-2.0; 3]
    }

    fn upper_bounds(&self) -> &[f64] {
        &[2.0; 3]
    }
}

/// Whether a point is in free space: three bands of latitude are forbidden but
/// for a gap in each.
pub fn is_valid(x: &[f64]) -> bool {
    is_clear(x, 0.0)
}

/// Whether a point is as far as `margin` from the walls.
fn is_clear(x: &[f64], margin: f64) -> bool {
    let [x, y, z] = [x[0], x[1], x[2]];
    let in_band = |from: f64, to: f64| z > from - margin && z < to + margin;
    let half_gap = 0.05 - margin;
    if in_band(-0.8, -0.6) {
        y.abs() < half_gap && x > margin
    } else if in_band(-0.1, 0.1) {
        x.abs() < half_gap && y < -margin
    } else if in_band(0.6, 0.8) {
        y.abs() < half_gap && x < -margin
    } else {
        true
    }
}

/// Length of a step.
const STEP: f64 = 0.1;

/// The test of steps: at their ends and at six points between. A path may cut
/// corners by half the distance between two tests; that is the margin.
pub fn walls() -> impl Validity {
    Predicate::new(3, 6, |x: &[f64]| is_clear(x, 0.5 * STEP / 6.0))
}

/// The planner's options that are not left as they are: long steps, and samples
/// from as far about a chart as the sphere is wide, or less where walls are near.
pub fn options(seed: u64) -> PlannerOptions {
    let mut options = PlannerOptions::default();
    options.seed = seed;
    options.step = STEP;
    options.sample_radius = SampleRadius::Adaptive { largest: 2.0 };
    options
}

/// Start and goal: the south pole and the north pole.
pub fn endpoints() -> [Vec<f64>; 2] {
    [vec![0.0, 0.0, -1.0], vec![0.0, 0.0, 1.0]]
}
