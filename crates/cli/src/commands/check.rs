//! `tensegra check`: the independent judge of a path file.

use std::path::{Path, PathBuf};

use serde_json::json;
use tensegra::{
    check::{CheckOptions, Report, check_path},
    io::read_path_file,
};

use super::{json_failure, print_json, read_problem};
use crate::failure::Failure;

/// Judge a path: equilibrium, ranges, start and goal, and clearance at and
/// between the configurations, by code that shares nothing with the planner.
///
/// Prints each worst figure and where it occurs.
#[derive(clap::Args)]
#[command(after_help = "Example:\n  tensegra check out/kite/path.json")]
pub struct Arguments {
    /// Path file (JSON) written by `tensegra plan`.
    path: PathBuf,
    /// Problem to judge it against [default: the one that the path names].
    #[arg(long)]
    problem: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(arguments: &Arguments) -> Result<bool, Failure> {
    let report = judge(&arguments.path, arguments.problem.as_deref())
        .map_err(|failure| json_failure(arguments.json, "ok", failure))?;
    if arguments.json {
        let mut value = json!(report);
        // One sentence a failure, for those who only want to know why.
        value["reasons"] = report
            .failures
            .iter()
            .map(|failure| json!(failure.message))
            .collect();
        print_json(&value);
    } else {
        println!("{report}");
    }
    Ok(report.ok)
}

fn judge(file: &Path, problem: Option<&Path>) -> Result<Report, Failure> {
    let contents = read_path_file(file).map_err(Failure::message)?;
    let problem = match problem {
        Some(problem) => read_problem(problem)?,
        None => contents.read_problem(file).map_err(Failure::message)?,
    };
    contents
        .check_structure(file, &problem)
        .map_err(Failure::message)?;
    Ok(check_path(
        &problem,
        &contents.path,
        &CheckOptions::default(),
    ))
}
