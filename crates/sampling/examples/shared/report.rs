//! Plans with seeds 1 to 20 and prints what became of each.

use tensegra_sampling::{Plan, PlanError};

/// Calls `plan` with each seed; prints a line for each plan, and the median of
/// the planning times.
///
/// # Panics
/// When a point of a path is not valid.
pub fn seeds(
    is_valid: impl Fn(&[f64]) -> bool,
    plan: impl Fn(u64) -> Result<Plan, PlanError>,
) -> Result<(), PlanError> {
    let mut seconds = Vec::new();
    for seed in 1..=20 {
        let Plan {
            points, statistics, ..
        } = plan(seed)?;
        assert!(points.iter().all(|x| is_valid(x)), "seed {seed}");
        println!(
            "seed {seed:>2}: {:>4} points, {:>3} charts, {:>5} nodes, {:.4} s",
            points.len(),
            statistics.charts,
            statistics.nodes,
            statistics.seconds
        );
        seconds.push(statistics.seconds);
    }
    seconds.sort_by(f64::total_cmp);
    let median = 0.5 * (seconds[9] + seconds[10]);
    println!(
        "20 of 20 solved, median {median:.4} s, longest {:.4} s",
        seconds[19]
    );
    Ok(())
}
