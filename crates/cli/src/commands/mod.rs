//! The verbs of the program.

pub mod atlas;
mod axes;
pub mod check;
pub mod formfind;
pub mod info;
pub mod plan;
pub mod rest_lengths;
pub mod smooth;
pub mod trace;
pub mod walk;

use std::path::{Path, PathBuf};

use clap::ValueEnum;
use tensegra::{
    io::{PathFile, Picture},
    model::{self, Problem},
};

use crate::failure::Failure;

/// Pixels to a CSS pixel in PNG pictures.
const PNG_SCALE: f64 = 2.0;

/// Coordinates of the equilibrium manifold.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum Formulation {
    /// Node coordinates and force densities (compact, fast).
    Nodes,
    /// Directions, lengths, rest lengths and forces (the paper's).
    Directions,
}

impl From<Formulation> for model::Formulation {
    fn from(formulation: Formulation) -> Self {
        match formulation {
            Formulation::Nodes => Self::Nodes,
            Formulation::Directions => Self::Directions,
        }
    }
}

/// Name of a formulation, as the command line spells it.
pub fn formulation_name(formulation: model::Formulation) -> &'static str {
    match formulation {
        model::Formulation::Nodes => "nodes",
        model::Formulation::Directions => "directions",
    }
}

/// What motors keep constant when their elements are disturbed.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum Actuation {
    /// Rest lengths of elastic elements, lengths of inextensible ones.
    Length,
    /// Forces.
    Force,
}

/// How stable the equilibria of a motion must be.
#[derive(clap::Args)]
pub struct StabilityArguments {
    /// Keep to equilibria whose tangent stiffness on admissible motions has no
    /// eigenvalue of S or less (force per length; 0 without a value) [default: the
    /// problem's demand, if it has one].
    #[arg(long, value_name = "S", num_args = 0..=1, require_equals = true,
          default_missing_value = "0", value_parser = parse_stiffness)]
    stable: Option<f64>,
    /// What motors keep constant when their elements are disturbed [default: the
    /// problem's].
    #[arg(long, value_enum)]
    actuation: Option<Actuation>,
}

impl StabilityArguments {
    /// Puts what was given into a problem's settings.
    pub fn apply(&self, problem: &mut Problem) {
        if let Some(actuation) = self.actuation {
            problem.settings.actuation = match actuation {
                Actuation::Length => model::Actuation::Length,
                Actuation::Force => model::Actuation::Force,
            };
        }
        if let Some(margin) = self.stable {
            problem.settings.least_stiffness = Some(margin);
        }
    }
}

fn parse_stiffness(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(stiffness) if stiffness.is_finite() && stiffness >= 0.0 => Ok(stiffness),
        _ => Err(format!(
            "`{text}` is no stiffness; give a number of at least 0 (force per length)"
        )),
    }
}

/// The smallest stiffness along a path and where, for people.
pub fn stiffness_text(least: Option<(usize, f64)>) -> String {
    match least {
        Some((index, stiffness)) => format!("{stiffness:.4e} at configuration {index}"),
        None => "no motion is admissible".to_owned(),
    }
}

/// The smallest stiffness along a path and where, for programs.
pub fn stiffness_json(least: Option<(usize, f64)>) -> serde_json::Value {
    match least {
        Some((index, value)) => serde_json::json!({ "value": value, "configuration": index }),
        None => serde_json::Value::Null,
    }
}

/// Reads a problem and passes its warnings on.
pub fn read_problem(file: &Path) -> Result<Problem, Failure> {
    let problem = Problem::read(file)?;
    for notice in &problem.notices {
        eprintln!("{notice:#}");
    }
    Ok(problem)
}

/// Puts the stability that a path was planned to keep into the problem's settings, and
/// takes from the problem the ends that the path does not have.
fn keep_demands(path: &PathFile, problem: &mut Problem) {
    if let Some(margin) = path.parameters["least_stiffness"].as_f64() {
        problem.settings.least_stiffness = Some(margin);
    }
    if path.parameters["actuation"] == "force" {
        problem.settings.actuation = model::Actuation::Force;
    }
    if path.open_start {
        (problem.start, problem.start_form) = (None, None);
    }
    if path.open_end {
        (problem.goal, problem.goal_form) = (None, None);
    }
}

/// Prints one JSON value on standard output.
pub fn print_json(value: &serde_json::Value) {
    say!("{value:#}");
}

/// Prints the outcome of one run as a JSON object, those of many as an array.
fn print_outcomes(outcomes: impl Iterator<Item = serde_json::Value>, many: bool) {
    let mut outcomes: Vec<serde_json::Value> = outcomes.collect();
    if many {
        print_json(&outcomes.into());
    } else if let Some(outcome) = outcomes.pop() {
        print_json(&outcome);
    }
}

/// Prints the failure as a JSON object on standard output where asked for, and
/// passes it on.
pub fn json_failure(json: bool, verdict: &str, failure: Failure) -> Failure {
    outcomes_failure(json, false, verdict, failure)
}

/// [`json_failure`] of a verb that takes many seeds: then an array of one object.
fn outcomes_failure(json: bool, many: bool, verdict: &str, failure: Failure) -> Failure {
    if json {
        let failed = serde_json::json!({ verdict: false, "error": failure.text() });
        print_outcomes(std::iter::once(failed), many);
    }
    failure
}

/// Reads a range of seeds from the command line.
fn parse_seeds(text: &str) -> Result<(u64, u64), String> {
    let wrong = || format!("`{text}` is no range of seeds; write A..B with A ≤ B, such as 1..20");
    let (a, b) = text.split_once("..").ok_or_else(wrong)?;
    let b = b.strip_prefix('=').unwrap_or(b);
    let (a, b) = (
        a.parse().map_err(|_| wrong())?,
        b.parse().map_err(|_| wrong())?,
    );
    if a <= b { Ok((a, b)) } else { Err(wrong()) }
}

/// Reads a positive number of seconds from the command line.
fn parse_seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if seconds.is_finite() && seconds > 0.0 => Ok(seconds),
        _ => Err(format!(
            "`{text}` is no time; give a positive number of seconds"
        )),
    }
}

/// Refuses an output folder that cannot be written into.
fn require_writable(folder: &Path) -> Result<(), Failure> {
    let unwritable = |error: std::io::Error| {
        Failure::Message(format!(
            "cannot write into `{}`: {error}; choose another folder with --out",
            folder.display()
        ))
    };
    std::fs::create_dir_all(folder).map_err(unwritable)?;
    tempfile::tempfile_in(folder).map(drop).map_err(unwritable)
}

/// Writes pictures by name as SVG and PNG, and adds the files to `files`.
fn write_pictures(
    folder: &Path,
    pictures: &[(&str, Picture)],
    files: &mut Vec<PathBuf>,
) -> Result<(), Failure> {
    pictures
        .iter()
        .try_for_each(|(name, picture)| write_picture(folder, name, picture, files))
}

/// Writes one picture as SVG and PNG, and adds the files to `files`.
fn write_picture(
    folder: &Path,
    name: &str,
    picture: &Picture,
    files: &mut Vec<PathBuf>,
) -> Result<(), Failure> {
    let [svg, png] = ["svg", "png"].map(|kind| folder.join(format!("{name}.{kind}")));
    picture.write_svg(&svg).map_err(Failure::message)?;
    picture
        .write_png(&png, PNG_SCALE)
        .map_err(Failure::message)?;
    files.extend([svg, png]);
    Ok(())
}

/// Prints the names of the files written.
fn print_written(files: &[PathBuf]) {
    for (i, file) in files.iter().enumerate() {
        say!(
            "{:<18} {}",
            if i == 0 { "written" } else { "" },
            file.display()
        );
    }
}
