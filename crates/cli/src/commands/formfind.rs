//! `tensegra formfind`: stable, collision-free shapes of a structure.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use tensegra::{
    FormOptions, JudgedForms,
    formfinding::{Form, FormError},
    io::{PathFile, Units, draw_configuration, write_path_file},
    model::{self, Problem},
};

use super::{
    json_failure, print_json, read_problem, require_writable,
    rest_lengths::{self, RestLengthArguments},
    write_picture,
};
use crate::failure::Failure;

/// Forms listed for people.
const LISTED: usize = 10;

/// Find stable, collision-free shapes of a structure from its topology, ranges,
/// loads, obstacles and conditions alone.
///
/// The table `[formfind]` of the problem states what is asked of the shape: nodes
/// or centroids at given places, lengths, forces, distances, symmetry, poses,
/// clearances. Many random starts are solved in parallel; each shape found is
/// judged independently. Writes into the output folder: best.json (a path file
/// with the best shape), and its picture as SVG and PNG.
///
/// With --direct or --inverse, node positions follow from rest lengths or rest
/// lengths from node positions instead, and the result is direct.json or
/// inverse.json.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    tensegra formfind fixtures/formfinding/prism.toml\n  \
    tensegra formfind fixtures/formfinding/prism.toml --seed 7 --starts 1000 --json\n  \
    tensegra formfind fixtures/formfinding/six_bar.toml --direct --rest c1=0.2\n  \
    tensegra formfind fixtures/formfinding/six_bar.toml --inverse\n\n\
    Exit status: 0 a shape was found and accepted by the judge, 1 not, 2 bad input.")]
pub struct Arguments {
    /// Problem (.toml) or structure (.tens) file.
    problem: PathBuf,
    /// Seed of the random starts [default: the problem's].
    #[arg(long)]
    seed: Option<u64>,
    /// Number of random starts [default: the problem's].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..1_000_000))]
    starts: Option<u64>,
    /// Number of threads; the shapes do not depend on it [default: all processors].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..1024))]
    threads: Option<u64>,
    #[command(flatten)]
    rest_lengths: RestLengthArguments,
    /// Output folder [default: out/NAME].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(arguments: &Arguments) -> Result<bool, Failure> {
    let read = || {
        let problem = read_problem(&arguments.problem)?;
        let out = arguments
            .out
            .clone()
            .unwrap_or_else(|| Path::new("out").join(&problem.name));
        require_writable(&out)?;
        Ok((problem, out))
    };
    let (problem, out) =
        read().map_err(|failure| json_failure(arguments.json, "found", failure))?;
    if arguments.rest_lengths.direct || arguments.rest_lengths.inverse {
        return rest_lengths::run(&arguments.rest_lengths, &problem, &out, arguments.json)
            .map_err(|failure| json_failure(arguments.json, "found", failure));
    }
    let mut options = FormOptions::default();
    options.seed = arguments.seed;
    // In range by their parsers.
    options.starts = arguments.starts.map(|n| n as usize);
    options.threads = arguments.threads.map(|n| n as usize);
    match tensegra::formfind(&problem, options) {
        Ok(found) => {
            let files = write(&problem, &found, &out)
                .map_err(|failure| json_failure(arguments.json, "found", failure))?;
            if arguments.json {
                print_json(&as_json(&found, &files));
            } else {
                print(&problem, &found, &files);
            }
            Ok(found.reports[found.forms.best_index()].ok)
        }
        Err(error @ FormError::Unmet { .. }) => {
            if arguments.json {
                print_json(&unmet_json(&error));
            } else {
                say!("not found          {error}");
            }
            Ok(false)
        }
        Err(error) => Err(json_failure(
            arguments.json,
            "found",
            Failure::message(error),
        )),
    }
}

/// Writes the best form; returns the names of the files, the path file first.
fn write(problem: &Problem, found: &JudgedForms, out: &Path) -> Result<Vec<PathBuf>, Failure> {
    let best = found.forms.best();
    let path = model::Path {
        configurations: vec![best.configuration.clone()],
    };
    let mut files = vec![out.join("best.json")];
    let mut contents = PathFile::new(problem, path);
    contents.form = true;
    contents.statistics = form_json(found, found.forms.best_index());
    contents.check = json!(found.reports[found.forms.best_index()]);
    write_path_file(&files[0], &contents).map_err(Failure::message)?;
    let picture = draw_configuration(
        &problem.structure,
        &problem.environment,
        &best.configuration,
        &format!(
            "{}: best of {} forms",
            problem.name,
            found.forms.forms.len()
        ),
        &Units::default(),
    )
    .map_err(Failure::message)?;
    write_picture(out, "best", &picture, &mut files)?;
    Ok(files)
}

fn form_json(found: &JudgedForms, index: usize) -> Value {
    let form = &found.forms.forms[index];
    let report = &found.reports[index];
    let failures: Vec<&str> = report
        .failures
        .iter()
        .map(|failure| failure.message.as_str())
        .collect();
    json!({
        "start": form.start,
        "shape": found.forms.shapes[index],
        "residual": form.residual,
        "least_stiffness": form.least_stiffness,
        "clearance": form.clearance.is_finite().then_some(form.clearance),
        "energy": form.energy,
        "iterations": form.iterations,
        "accepted": report.ok,
        "failures": failures,
    })
}

fn as_json(found: &JudgedForms, files: &[PathBuf]) -> Value {
    let forms = &found.forms;
    let all: Vec<Value> = (0..forms.forms.len())
        .map(|index| form_json(found, index))
        .collect();
    let best = &forms.best().configuration;
    json!({
        "found": true,
        "seed": found.seed,
        "starts": forms.starts,
        "converged": forms.forms.len(),
        "accepted": found.accepted(),
        "shapes": forms.shape_count(),
        "best": forms.best_index(),
        "positions": best.positions,
        "lengths": best.lengths,
        "rest_lengths": best.rest_lengths,
        "forces": best.forces,
        "check": found.reports[forms.best_index()],
        "files": files,
        "forms": all,
    })
}

fn unmet_json(error: &FormError) -> Value {
    let FormError::Unmet { unmet, starts } = error else {
        return json!({ "found": false, "error": error.to_string() });
    };
    let unmet: Vec<Value> = unmet
        .iter()
        .map(|unmet| json!({ "constraint": unmet.constraint, "violation": unmet.violation }))
        .collect();
    json!({
        "found": false,
        "error": error.to_string(),
        "starts": starts,
        "converged": 0,
        "unmet": unmet,
    })
}

fn print(problem: &Problem, found: &JudgedForms, files: &[PathBuf]) {
    let forms = &found.forms;
    say!(
        "found              {} of {} starts converged, seed {}",
        forms.forms.len(),
        forms.starts,
        found.seed
    );
    say!("shapes             {} distinct", forms.shape_count());
    say!(
        "check              {} of {} accepted by the independent judge",
        found.accepted(),
        forms.forms.len()
    );
    say!();
    say!("  start  shape   residual   stiffness   clearance      energy  check");
    let best = forms.best_index();
    let listed = (0..forms.forms.len()).filter(|&i| i < LISTED || i == best);
    for index in listed {
        let form = &forms.forms[index];
        say!(
            "{}{:>6} {:>6} {:>10.1e} {:>11} {:>11} {:>11.4e}  {}",
            if index == best { "*" } else { " " },
            form.start,
            forms.shapes[index],
            form.residual,
            optional(form.least_stiffness),
            optional(form.clearance.is_finite().then_some(form.clearance)),
            form.energy,
            if found.reports[index].ok {
                "accepted"
            } else {
                "REFUSED"
            },
        );
    }
    say!();
    print_best(problem, forms.best());
    for failure in &found.reports[best].failures {
        say!("                   {}", failure.message);
    }
    for (i, file) in files.iter().enumerate() {
        say!(
            "{:<18} {}",
            if i == 0 { "written" } else { "" },
            file.display()
        );
    }
}

fn print_best(problem: &Problem, form: &Form) {
    say!("best (*)           element     length     rest length   force");
    let configuration = &form.configuration;
    for (e, element) in problem.structure.elements.iter().enumerate() {
        say!(
            "                   {:<8} {:>9.5} {:>13} {:>11}",
            element.name,
            configuration.lengths[e],
            configuration.rest_lengths[e].map_or("-".to_owned(), |r| format!("{r:.5}")),
            configuration.forces[e].map_or("-".to_owned(), |f| format!("{f:.5}")),
        );
    }
}

fn optional(value: Option<f64>) -> String {
    value.map_or_else(|| "-".to_owned(), |value| format!("{value:.3e}"))
}
