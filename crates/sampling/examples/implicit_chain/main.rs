//! Planning on your own manifold: a closed chain of balls joined by rods.
//!
//! You write the equations F(x) = 0, their Jacobian and a validity test (see
//! `problem.rs`); the planner does the rest. Run with
//! `cargo run --release -p tensegra-sampling --example implicit_chain`.

mod problem;
#[path = "../shared/report.rs"]
mod report;

use tensegra_sampling::{AtlasRrt, PlanError, PlannerOptions};

fn main() -> Result<(), PlanError> {
    let chain = problem::Chain::new(5);
    let free = chain.free_space();
    let [start, goal] = chain.endpoints();
    report::seeds(problem::Chain::is_valid, |seed| {
        let mut options = PlannerOptions::default();
        options.seed = seed;
        AtlasRrt::new(&chain, &free, options).plan(&start, &goal, &mut ())
    })
}
