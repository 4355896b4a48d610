//! `tensegra smooth`: shortens and smooths a path, judges it, and writes it.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use tensegra::{
    Smoothing, SmoothingOptions,
    io::{
        LogOptions, PathFile, Picture, PictureError, Quantity, Units, draw_forces, draw_paths,
        draw_snapshots, read_path_file, write_log, write_path_file,
    },
    model::{self, Problem},
};

use super::{
    StabilityArguments,
    axes::{parse_axes, three_lengths},
    json_failure, keep_demands, print_json, print_written, read_problem, require_writable,
    stiffness_json, stiffness_text, write_picture,
};
use crate::{failure::Failure, progress::Spinner};

/// Snapshots between start and goal in the picture of the motion.
const SNAPSHOTS: usize = 4;

/// Smooth a path: shortcuts, then the path of least control effort near it that
/// keeps all ranges and touches nothing, judged and written.
///
/// Writes into the output folder: path.json, path.mcap, and as SVG and PNG the
/// path before and after in the space of three quantities (before_and_after),
/// snapshots, and forces along the path.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    tensegra smooth out/kite/path.json\n  \
    tensegra smooth out/kite/path.json --axes length:c1,length:c2,x:n5 --out /tmp/smooth\n\n\
    Exit status: 0 smoothed and accepted by the judge, 1 not, 2 bad input.")]
pub struct Arguments {
    /// Path file (JSON) written by `tensegra plan`.
    path: PathBuf,
    /// Problem that it solves [default: the one that the path names].
    #[arg(long, value_name = "FILE")]
    problem: Option<PathBuf>,
    /// Seed of the shortcuts [default: the path's].
    #[arg(long)]
    seed: Option<u64>,
    #[command(flatten)]
    stability: StabilityArguments,
    /// Axes of the picture of the path before and after: three of
    /// length:ELEMENT, rest:ELEMENT, force:ELEMENT, x:NODE, y:NODE, z:NODE
    /// [default: the lengths of the first three cables].
    #[arg(long, value_name = "A,B,C")]
    axes: Option<String>,
    /// Output folder [default: out/NAME/smooth].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(arguments: &Arguments) -> Result<bool, Failure> {
    let (smoothing, files) =
        smooth(arguments).map_err(|failure| json_failure(arguments.json, "solved", failure))?;
    let success = smoothing.report.ok && smoothing.optimality.is_some();
    if arguments.json {
        let mut value = json!({
            "solved": success,
            "configurations": smoothing.path.configurations.len(),
            "path": files[0],
            "files": files,
            "check": smoothing.report,
        });
        add_json(&mut value, &smoothing);
        print_json(&value);
    } else {
        print(&smoothing);
        say!(
            "least stiffness    {}",
            stiffness_text(smoothing.least_stiffness)
        );
        if smoothing.report.ok {
            say!("check              accepted by the independent judge");
        } else {
            say!("check              REFUSED by the independent judge");
            for failure in &smoothing.report.failures {
                say!("                   {}", failure.message);
            }
        }
        print_written(&files);
    }
    Ok(success)
}

fn smooth(arguments: &Arguments) -> Result<(Smoothing, Vec<PathBuf>), Failure> {
    let file = &arguments.path;
    let contents = read_path_file(file).map_err(Failure::message)?;
    let mut problem = match &arguments.problem {
        Some(problem) => read_problem(problem)?,
        None => contents.read_problem(file).map_err(Failure::message)?,
    };
    contents
        .check_structure(file, &problem)
        .map_err(Failure::message)?;
    keep_demands(&contents, &mut problem);
    arguments.stability.apply(&mut problem);
    problem.seed = arguments.seed.unwrap_or(contents.seed);
    let axes = match &arguments.axes {
        Some(text) => Some(parse_axes(text, &problem.structure)?),
        None => three_lengths(&problem),
    };
    let out = arguments
        .out
        .clone()
        .unwrap_or_else(|| Path::new("out").join(&problem.name).join("smooth"));
    require_writable(&out)?;
    let options = SmoothingOptions::of(&problem);
    let mut spinner = Spinner::new(&format!("smoothing {}", problem.name));
    let smoothing = tensegra::smooth(&problem, &contents.path, &options, &mut spinner);
    drop(spinner);
    let smoothing = smoothing.map_err(Failure::message)?;
    let files = write(&problem, &contents, &smoothing, axes, &out)?;
    Ok((smoothing, files))
}

/// Writes path, log and pictures; returns their names, the path first.
fn write(
    problem: &Problem,
    before: &PathFile,
    smoothing: &Smoothing,
    axes: Option<[Quantity; 3]>,
    folder: &Path,
) -> Result<Vec<PathBuf>, Failure> {
    let mut files = vec![folder.join("path.json"), folder.join("path.mcap")];
    let path = &smoothing.path;
    let mut contents = PathFile::new(problem, path.clone());
    contents.formulation = "directions".to_owned();
    (contents.open_start, contents.open_end) = (before.open_start, before.open_end);
    contents.statistics = json!({});
    add_json(&mut contents.statistics, smoothing);
    contents.check = json!(smoothing.report);
    write_path_file(&files[0], &contents).map_err(Failure::message)?;
    write_log(&files[1], problem, path, &LogOptions::default()).map_err(Failure::message)?;
    let (structure, units) = (&problem.structure, Units::default());
    let mut pictures = vec![
        (
            "snapshots",
            draw_snapshots(structure, &problem.environment, path, SNAPSHOTS, &units),
        ),
        ("forces", draw_forces(structure, path, &units)),
    ];
    if let Some(axes) = axes {
        pictures.insert(0, draw_before_and_after(problem, &before.path, path, axes));
    }
    for (name, picture) in pictures {
        write_picture(
            folder,
            name,
            &picture.map_err(Failure::message)?,
            &mut files,
        )?;
    }
    Ok(files)
}

/// The picture of a path before and after, with its name.
pub fn draw_before_and_after(
    problem: &Problem,
    before: &model::Path,
    after: &model::Path,
    axes: [Quantity; 3],
) -> (&'static str, Result<Picture, PictureError>) {
    let paths = [("before", before), ("after", after)];
    let picture = draw_paths(&problem.structure, &paths, axes, &Units::default());
    ("before_and_after", picture)
}

/// Adds the figures of smoothing to a JSON object.
pub fn add_json(object: &mut Value, smoothing: &Smoothing) {
    for (key, value) in [
        ("control_effort", json!(smoothing.control_effort)),
        ("path_length", json!(smoothing.path_length)),
        (
            "control_effort_before",
            json!(smoothing.control_effort_before),
        ),
        ("path_length_before", json!(smoothing.path_length_before)),
        ("shortcut_length", json!(smoothing.shortcut_length)),
        ("smoothing_seconds", json!(smoothing.seconds)),
        ("shortcut_seconds", json!(smoothing.shortcut_seconds)),
        ("smoothing_iterations", json!(smoothing.iterations)),
        ("optimality", json!(smoothing.optimality)),
        ("converged", json!(smoothing.converged)),
        ("least_stiffness", stiffness_json(smoothing.least_stiffness)),
        ("setback", json!(smoothing.setback)),
    ] {
        object[key] = value;
    }
}

/// Prints the figures of smoothing.
pub fn print(smoothing: &Smoothing) {
    let effort = |c: Option<f64>| c.map_or_else(|| "-".to_owned(), |c| format!("{c:.4}"));
    say!(
        "control effort     {} before, {} after",
        effort(smoothing.control_effort_before),
        effort(smoothing.control_effort)
    );
    say!(
        "path length        {:.4} before, {:.4} after shortcuts, {:.4} after; {} configurations",
        smoothing.path_length_before,
        smoothing.shortcut_length,
        smoothing.path_length,
        smoothing.path.configurations.len()
    );
    match smoothing.optimality {
        Some(optimality) => say!(
            "optimality         {optimality:.2e} ({}), {} iterations",
            if smoothing.converged {
                "converged"
            } else {
                "not converged"
            },
            smoothing.iterations
        ),
        None => say!("optimality         - (not smoothed)"),
    }
    if let Some(setback) = &smoothing.setback {
        say!("                   {setback}");
    }
    say!(
        "smoothing time     {:.3} s, {:.3} s of it for shortcuts",
        smoothing.seconds,
        smoothing.shortcut_seconds
    );
}
