//! Planning on your own manifold: a platform carried by several chains.
//!
//! You write the equations F(x) = 0, their Jacobian and a validity test (see
//! `problem.rs`); the planner does the rest. Run with
//! `cargo run --release -p tensegra-sampling --example implicit_parallel`.

mod problem;
#[path = "../shared/report.rs"]
mod report;

use tensegra_sampling::{AtlasRrt, PlanError, PlannerOptions};

fn main() -> Result<(), PlanError> {
    let robot = problem::ParallelRobot::new();
    let free = robot.free_space();
    let [start, goal] = robot.endpoints();
    report::seeds(problem::ParallelRobot::is_valid, |seed| {
        let mut options = PlannerOptions::default();
        options.seed = seed;
        AtlasRrt::new(&robot, &free, options).plan(&start, &goal, &mut ())
    })
}
