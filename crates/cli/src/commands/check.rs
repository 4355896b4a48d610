//! `tensegra check`: the independent judges of path files and walk files.

use std::path::{Path, PathBuf};

use serde_json::json;
use tensegra::{
    check::{CheckOptions, Report, check_form, check_path},
    io::{read_format, read_path_file, read_walk_file},
    lar::{WALK_FORMAT, WalkCheckOptions, WalkFacts, check_walk},
};

use super::{
    json_failure, keep_demands, print_json, read_problem,
    walk::{check_json, print_check},
};
use crate::failure::Failure;

/// Judge a path or a walk by code that shares nothing with the planner.
///
/// Of a path: equilibrium, ranges, start and goal (or the conditions that describe
/// them), and clearance at and between the configurations. Of a form: equilibrium,
/// ranges, and what the problem's table `[formfind]` asks for. Of a walk: every constraint at the
/// configurations and between them, the rule of rolling, standing nodes that do
/// not slide, waypoints and obstacles. Prints each worst figure.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    tensegra check out/kite/path.json\n  \
    tensegra check out/formfinding-prism/best.json\n  \
    tensegra check out/two-tier-s/walk.json --problem fixtures/lar/two-tier-s.toml\n\n\
    Exit status: 0 accepted, 1 refused, 2 bad input.")]
pub struct Arguments {
    /// Path file (JSON) written by `tensegra plan`, `trace` or `formfind`, or
    /// walk file written by `tensegra walk`; its member `format` tells which.
    path: PathBuf,
    /// Problem to judge it against [default: the one that the path names; for a
    /// walk, the robot, limits and waypoints that it states itself].
    #[arg(long)]
    problem: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(arguments: &Arguments) -> Result<bool, Failure> {
    if read_format(&arguments.path).as_deref() == Some(WALK_FORMAT) {
        return run_walk(arguments).map_err(|failure| json_failure(arguments.json, "ok", failure));
    }
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
        say!("{report}");
    }
    Ok(report.ok)
}

fn run_walk(arguments: &Arguments) -> Result<bool, Failure> {
    let walk = read_walk_file(&arguments.path).map_err(Failure::message)?;
    let facts = match &arguments.problem {
        Some(problem) => WalkFacts::of_problem(&tensegra::read_walk_problem(problem)?, walk.visit),
        None => WalkFacts::of(&walk),
    };
    let check = check_walk(&facts, &walk, &WalkCheckOptions::default());
    if arguments.json {
        print_json(&check_json(&check));
    } else {
        print_check(&check, &walk);
    }
    Ok(check.valid)
}

fn judge(file: &Path, problem: Option<&Path>) -> Result<Report, Failure> {
    let contents = read_path_file(file).map_err(Failure::message)?;
    let mut problem = match problem {
        Some(problem) => read_problem(problem)?,
        None => contents.read_problem(file).map_err(Failure::message)?,
    };
    contents
        .check_structure(file, &problem)
        .map_err(Failure::message)?;
    keep_demands(&contents, &mut problem);
    let options = CheckOptions::default();
    // A path file has at least one configuration.
    Ok(match contents.path.configurations.as_slice() {
        [form] if contents.form => check_form(&problem, form, &options),
        _ => check_path(&problem, &contents.path, &options),
    })
}
