//! Planning on your own manifold: a sphere with three walls, each with a gap.
//!
//! You write the equations F(x) = 0, their Jacobian and a validity test (see
//! `problem.rs`); the planner does the rest. Run with
//! `cargo run --release -p tensegra-sampling --example sphere_walls`.

mod problem;
#[path = "../shared/report.rs"]
mod report;

use tensegra_sampling::{AtlasRrt, PlanError};

fn main() -> Result<(), PlanError> {
    let sphere = problem::Sphere::new();
    let walls = problem::walls();
    let [start, goal] = problem::endpoints();
    report::seeds(problem::is_valid, |seed| {
        AtlasRrt::new(&sphere, &walls, problem::options(seed)).plan(&start, &goal, &mut ())
    })
}
