//! The verbs of the program.

pub mod check;
pub mod formfind;
pub mod info;
pub mod plan;

use std::path::Path;

use clap::ValueEnum;
use tensegra::model::{self, Problem};

use crate::failure::Failure;

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

/// Reads a problem and passes its warnings on.
pub fn read_problem(file: &Path) -> Result<Problem, Failure> {
    let problem = Problem::read(file)?;
    for notice in &problem.notices {
        eprintln!("{notice:#}");
    }
    Ok(problem)
}

/// Prints one JSON value on standard output.
pub fn print_json(value: &serde_json::Value) {
    println!("{value:#}");
}

/// Prints the failure as a JSON object on standard output where asked for, and
/// passes it on.
pub fn json_failure(json: bool, verdict: &str, failure: Failure) -> Failure {
    if json {
        print_json(&serde_json::json!({ verdict: false, "error": failure.text() }));
    }
    failure
}

/// Refuses a folder that cannot be written into, before the work and not after it.
pub fn require_writable(folder: &Path) -> Result<(), Failure> {
    let unwritable = |error: std::io::Error| {
        Failure::Message(format!(
            "cannot write into `{}`: {error}; choose another folder with --out",
            folder.display()
        ))
    };
    std::fs::create_dir_all(folder).map_err(unwritable)?;
    tempfile::tempfile_in(folder).map(drop).map_err(unwritable)
}
