//! Planning on your own manifold: a sphere with three walls, each with a gap.
//!
//! You write the equations F(x) = 0, their Jacobian and a validity test; the
//! planner does the rest. Run with
//! `cargo run --release -p tensegra-sampling --example sphere_walls`.

use tensegra_atlas::{Predicate, doc::Sphere};
use tensegra_sampling::{AtlasRrt, PlannerOptions};

/// Three bands of latitude are forbidden but for a gap in each.
fn is_valid(x: &[f64]) -> bool {
    let [x, y, z] = [x[0], x[1], x[2]];
    if z > -0.8 && z < -0.6 {
        y.abs() < 0.05 && x > 0.0
    } else if z > -0.1 && z < 0.1 {
        x.abs() < 0.05 && y < 0.0
    } else if z > 0.6 && z < 0.8 {
        y.abs() < 0.05 && x < 0.0
    } else {
        true
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let sphere = Sphere::new();
    let validity = Predicate::new(3, 1, is_valid);
    let mut seconds = Vec::new();
    for seed in 1..=20 {
        let mut options = PlannerOptions::default();
        options.seed = seed;
        let planner = AtlasRrt::new(&sphere, &validity, options);
        let plan = planner.plan(&[0.0, 0.0, -1.0], &[0.0, 0.0, 1.0], &mut ())?;
        let statistics = plan.statistics;
        println!(
            "seed {seed}: {} points, {} charts, {} nodes, {:.4} s",
            plan.points.len(),
            statistics.charts,
            statistics.nodes,
            statistics.seconds
        );
        seconds.push(statistics.seconds);
    }
    seconds.sort_by(f64::total_cmp);
    println!("median {:.4} s", seconds[seconds.len() / 2]);
    Ok(())
}
