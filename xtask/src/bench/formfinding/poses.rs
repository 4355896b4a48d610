//! Direct form-finding of published poses.

use serde::Deserialize;
use tensegra::{
    formfinding::{DirectForm, DirectSolver, alignment},
    model::{Endpoint, Structure},
};

use super::{Figures, read, row, timed};
use crate::{
    Error,
    bench::{BenchArguments, RunFailure},
    root,
};

/// The structure is fixtures/formfinding/six_bar.toml.
pub const CASE: &str = "six_bar";

/// Largest unbalanced force of a success, N, and its distance from what is
/// published, m.
const RESIDUAL: f64 = 1e-9;
const DISTANCE: f64 = 2e-5;

#[derive(Deserialize)]
struct Published {
    poses: Vec<Pose>,
}

#[derive(Deserialize)]
struct Pose {
    /// Of the cables, in the order of the structure.
    rest_lengths: Vec<f64>,
    nodes: Vec<[f64; 3]>,
}

pub fn measure(arguments: &BenchArguments, figures: &mut Figures) -> Result<(), Error> {
    let problem = read("formfinding/six_bar.toml")?;
    let structure = &problem.structure;
    let start = problem.start.as_ref().ok_or("six_bar.toml has no start")?;
    let file = root().join("fixtures/formfinding/six_bar_poses.json");
    let published: Published = serde_json::from_slice(&std::fs::read(file)?)?;
    let mut solver = DirectSolver::new(structure);
    let (mut seconds, mut iterations) = (Vec::new(), Vec::new());
    let (mut residuals, mut distances) = (Vec::new(), Vec::new());
    let count = published.poses.len() * arguments.seed_count() as usize;
    for seed in 1..=arguments.seed_count() {
        for (index, pose) in published.poses.iter().enumerate() {
            let rest = rest_lengths(structure, start, pose);
            let (form, time) = timed(|| solver.solve(&start.positions, &rest));
            let judged = form
                .map_err(|error| error.to_string())
                .and_then(|form| judge(structure, &form, pose).map(|distance| (form, distance)));
            match judged {
                Ok((form, distance)) => {
                    seconds.push(time);
                    iterations.push(form.iterations as f64);
                    residuals.push(form.residual);
                    distances.push(distance);
                }
                Err(reason) => figures.failures.push(RunFailure {
                    case: CASE.to_owned(),
                    variant: format!("pose {index}"),
                    seed,
                    reason,
                }),
            }
        }
    }
    eprintln!("{CASE}: {}/{count}", seconds.len());
    figures.rows.extend([
        row(CASE, "CPU time of a pose", "s", count, &seconds),
        row(CASE, "Newton iterations", "1", count, &iterations),
        row(CASE, "unbalanced force", "N", count, &residuals),
        row(
            CASE,
            "distance from the published pose",
            "m",
            count,
            &distances,
        ),
    ]);
    figures.distribution("six-bar, one pose".to_owned(), seconds);
    Ok(())
}

/// The rest lengths of a pose: those of cables in their order, of rods the constant
/// ones.
fn rest_lengths(structure: &Structure, start: &Endpoint, pose: &Pose) -> Vec<Option<f64>> {
    let mut rest = start.rest_lengths.clone();
    let cables = (0..rest.len()).filter(|&e| structure.elements[e].is_actuated());
    for (cable, length) in cables.zip(&pose.rest_lengths) {
        rest[cable] = Some(*length);
    }
    rest
}

/// The distance from what is published, where the form is a success.
fn judge(structure: &Structure, form: &DirectForm, pose: &Pose) -> Result<f64, String> {
    let published: Vec<_> = pose.nodes.iter().map(|&node| node.into()).collect();
    let found = &form.configuration.positions;
    let motion = alignment(found, &published, structure.dimension == 2);
    let pairs = found.iter().zip(&published);
    let distance = pairs
        .map(|(a, b)| (motion * a - b).norm())
        .fold(0.0, f64::max);
    match (
        form.is_stable(),
        form.residual <= RESIDUAL,
        distance <= DISTANCE,
    ) {
        (true, true, true) => Ok(distance),
        (false, ..) => Err("the equilibrium is not stable".to_owned()),
        (_, false, _) => Err(format!("{:.1e} N is unbalanced", form.residual)),
        (_, _, false) => Err(format!("a node is {distance:.1e} m from the published one")),
    }
}
