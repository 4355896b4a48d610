//! `tensegra trace`: moves motors and follows the equilibrium.

use std::path::{Path, PathBuf};

use clap::ValueEnum;
use serde_json::{Value, json};
use tensegra::{
    Motion, Trace, TraceStop,
    check::{CheckOptions, Report, check_path},
    io::{
        LogOptions, PathFile, Picture, PictureError, Units, draw_configuration, draw_forces,
        draw_lengths, draw_rest_lengths, draw_snapshots, write_log, write_path_file,
    },
    model::{ElementQuantity, Interval, Problem, Structure},
    trace,
};

use super::{
    Formulation, StabilityArguments, formulation_name, json_failure, print_json, print_written,
    read_problem, require_writable, stiffness_json, stiffness_text, write_pictures,
};
use crate::{failure::Failure, progress::Spinner};

/// Snapshots between the ends in the picture of the motion.
const SNAPSHOTS: usize = 4;

/// Move motors from the problem's start and follow the equilibrium.
///
/// Moves one quantity, or several in proportion, until it has its value, a limit
/// or a collision is met, or no such equilibrium lies beyond (a fold); says
/// which. The other motors are held as well as possible: they change as little
/// as they can at every moment.
///
/// Writes into the output folder: path.json (the path), path.mcap (for
/// Foxglove), and pictures as SVG and PNG: start, end, snapshots, and forces and
/// rest lengths (lengths, where no rest length may change) along the path.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    tensegra trace fixtures/kite.toml --element c1 --quantity rest --to 0.4\n  \
    tensegra trace fixtures/kite.toml --move c1:rest=0.4 --move c2:rest=0.5\n  \
    tensegra trace fixtures/tower.toml --element c1 --quantity force --to 0.1 --stable\n\n\
    Exit status: 0 the values are reached and the judge accepts the path, 1 not, 2 bad input.")]
pub struct Arguments {
    /// Problem (.toml) or structure (.tens) file.
    problem: PathBuf,
    /// Element that is moved; several times for several elements.
    #[arg(long, value_name = "NAME")]
    element: Vec<String>,
    /// Quantity of the element; given once, it is that of all elements.
    #[arg(long, value_enum)]
    quantity: Vec<Kind>,
    /// Value that the quantity is to have in the end; one for each element.
    #[arg(long, value_name = "VALUE", allow_negative_numbers = true)]
    to: Vec<f64>,
    /// The same in one word: element, quantity and value.
    #[arg(long = "move", value_name = "NAME:QUANTITY=VALUE", value_parser = parse_move)]
    moves: Vec<(String, Kind, f64)>,
    /// Coordinates of the equilibrium manifold [default: the problem's].
    #[arg(long, value_enum)]
    formulation: Option<Formulation>,
    #[command(flatten)]
    stability: StabilityArguments,
    /// Output folder [default: out/NAME-trace].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// A quantity of an element.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Kind {
    /// Rest length.
    Rest,
    /// Length.
    Length,
    /// Force, tension positive.
    Force,
}

fn parse_move(text: &str) -> Result<(String, Kind, f64), String> {
    let wrong = || format!("`{text}` is no motion; write NAME:QUANTITY=VALUE, such as c1:rest=0.4");
    let (what, value) = text.rsplit_once('=').ok_or_else(wrong)?;
    let (element, kind) = what.rsplit_once(':').ok_or_else(wrong)?;
    let kind = Kind::from_str(kind, false)
        .map_err(|_| format!("`{kind}` is no quantity; choose rest, length or force"))?;
    Ok((
        element.to_owned(),
        kind,
        value.parse().map_err(|_| wrong())?,
    ))
}

/// Runs the verb.
pub fn run(arguments: &Arguments) -> Result<bool, Failure> {
    trace_and_write(arguments).map_err(|failure| json_failure(arguments.json, "reached", failure))
}

fn trace_and_write(arguments: &Arguments) -> Result<bool, Failure> {
    let mut problem = read_problem(&arguments.problem)?;
    if let Some(formulation) = arguments.formulation {
        problem.settings.formulation = formulation.into();
    }
    arguments.stability.apply(&mut problem);
    // The motion ends where it ends.
    problem.goal = None;
    let motions = motions(arguments, &problem.structure)?;
    let folder = arguments
        .out
        .clone()
        .unwrap_or_else(|| Path::new("out").join(format!("{}-trace", problem.name)));
    require_writable(&folder)?;
    let mut spinner = Spinner::new(&format!("tracing {}", problem.name));
    let traced = trace(&problem, &motions, &mut spinner);
    drop(spinner);
    let traced = traced.map_err(Failure::message)?;
    let report = check_path(&problem, &traced.path, &CheckOptions::default());
    let files = write(&problem, &motions, &traced, &report, &folder)?;
    let reached = traced.stop.is_none() && !traced.cancelled;
    if arguments.json {
        let mut value = summary(&problem, &motions, &traced);
        value["path"] = json!(files[0]);
        value["files"] = json!(files);
        value["check"] = json!(report);
        print_json(&value);
    } else {
        print(&problem, &motions, &traced, &report, &files);
    }
    Ok(reached && report.ok)
}

/// The motions asked for, by element.
fn motions(arguments: &Arguments, structure: &Structure) -> Result<Vec<Motion>, Failure> {
    let (elements, quantities, values) = (&arguments.element, &arguments.quantity, &arguments.to);
    if values.len() != elements.len()
        || (quantities.len() != elements.len() && quantities.len() != 1.min(elements.len()))
    {
        return Err(Failure::Message(format!(
            "{} elements, {} quantities and {} values do not go together: give a --quantity and a \
             --to for each --element",
            elements.len(),
            quantities.len(),
            values.len()
        )));
    }
    let kinds = quantities.iter().cycle();
    let separate = elements.iter().zip(kinds).zip(values);
    let separate = separate.map(|((element, &kind), &value)| (element, kind, value));
    let joined = arguments
        .moves
        .iter()
        .map(|(element, kind, value)| (element, *kind, *value));
    let motions = separate
        .chain(joined)
        .map(|(name, kind, to)| {
            let element = structure.element_index(name).ok_or_else(|| {
                let names: Vec<&str> = structure.elements.iter().map(|e| e.name.as_str()).collect();
                Failure::Message(format!(
                    "there is no element `{name}`: choose from {}",
                    names.join(", ")
                ))
            })?;
            let quantity = match kind {
                Kind::Rest => ElementQuantity::Rest(element),
                Kind::Length => ElementQuantity::Length(element),
                Kind::Force => ElementQuantity::Force(element),
            };
            Ok(Motion { quantity, to })
        })
        .collect::<Result<Vec<Motion>, Failure>>()?;
    if motions.is_empty() {
        return Err(Failure::Message(
            "nothing is to be moved: give --element NAME --quantity rest --to VALUE, or --move \
             NAME:rest=VALUE"
                .to_owned(),
        ));
    }
    Ok(motions)
}

/// Name of a quantity, for messages.
fn name(structure: &Structure, quantity: ElementQuantity) -> String {
    let element = &structure.elements[quantity.element()].name;
    format!("{} of {element}", quantity.noun())
}

/// With six decimals, or in powers of ten where that would be unreadable.
fn decimal(value: f64) -> String {
    if value == 0.0 || (1e-3..1e6).contains(&value.abs()) {
        format!("{value:.6}")
    } else {
        format!("{value:.6e}")
    }
}

/// In one word, for programs.
fn verdict(traced: &Trace) -> &'static str {
    match &traced.stop {
        None if traced.cancelled => "time",
        None => "reached",
        Some(TraceStop::Range { .. } | TraceStop::Limit { .. }) => "limit",
        Some(TraceStop::Collision { .. }) => "collision",
        Some(TraceStop::Unstable { .. }) => "unstable",
        Some(TraceStop::Singular) => "singular",
        Some(TraceStop::TooMany { .. }) => "too_many",
        Some(_) => "fold",
    }
}

fn summary(problem: &Problem, motions: &[Motion], traced: &Trace) -> Value {
    let structure = &problem.structure;
    let moved = motions.iter().zip(&traced.reached).map(|(motion, value)| {
        json!({
            "element": structure.elements[motion.quantity.element()].name,
            "quantity": motion.quantity.noun(),
            "to": motion.to,
            "reached": value,
        })
    });
    json!({
        "reached": verdict(traced) == "reached",
        "stop": verdict(traced),
        "reason": traced.stop.as_ref().map(ToString::to_string),
        "moved": moved.collect::<Vec<_>>(),
        "worst_held": traced.worst_held.map(|(quantity, deviation)| json!({
            "element": structure.elements[quantity.element()].name,
            "quantity": quantity.noun(),
            "deviation": deviation,
        })),
        "dimension": traced.dimension,
        "configurations": traced.path.configurations.len(),
        "seconds": traced.seconds,
        "least_stiffness": stiffness_json(traced.least_stiffness),
        "formulation": formulation_name(problem.settings.formulation),
    })
}

/// Writes path, log and pictures; returns their names, the path first.
fn write(
    problem: &Problem,
    motions: &[Motion],
    traced: &Trace,
    report: &Report,
    folder: &Path,
) -> Result<Vec<PathBuf>, Failure> {
    let mut files = vec![folder.join("path.json"), folder.join("path.mcap")];
    let mut contents = PathFile::new(problem, traced.path.clone());
    contents.open_end = true;
    contents.statistics = summary(problem, motions, traced);
    contents.check = json!(report);
    write_path_file(&files[0], &contents).map_err(Failure::message)?;
    write_log(&files[1], problem, &traced.path, &LogOptions::default())
        .map_err(Failure::message)?;
    let pictures = draw(problem, traced).map_err(Failure::message)?;
    write_pictures(folder, &pictures, &mut files)?;
    Ok(files)
}

fn draw(problem: &Problem, traced: &Trace) -> Result<Vec<(&'static str, Picture)>, PictureError> {
    let (structure, environment) = (&problem.structure, &problem.environment);
    let (path, units) = (&traced.path, Units::default());
    let mut pictures = Vec::new();
    for (name, configuration) in [
        ("start", path.configurations.first()),
        ("end", path.configurations.last()),
    ] {
        if let Some(configuration) = configuration {
            let title = format!("{}: {name}", problem.name);
            let picture =
                draw_configuration(structure, environment, configuration, &title, &units)?;
            pictures.push((name, picture));
        }
    }
    let snapshots = draw_snapshots(structure, environment, path, SNAPSHOTS, &units)?;
    pictures.push(("snapshots", snapshots));
    pictures.push(("forces", draw_forces(structure, path, &units)?));
    let varies = |range: Option<Interval>| range.is_some_and(|range| !range.is_constant());
    if structure.elements.iter().any(|e| varies(e.rest())) {
        pictures.push(("rest_lengths", draw_rest_lengths(structure, path, &units)?));
    } else if structure.elements.iter().any(|e| varies(Some(e.length))) {
        pictures.push(("lengths", draw_lengths(structure, path, &units)?));
    }
    Ok(pictures)
}

fn print(
    problem: &Problem,
    motions: &[Motion],
    traced: &Trace,
    report: &Report,
    files: &[PathBuf],
) {
    let structure = &problem.structure;
    let first = traced.path.configurations.first();
    match &traced.stop {
        None if traced.cancelled => say!("stopped            the time limit was reached"),
        None => say!("reached            every value"),
        Some(stop) => say!("stopped            {stop}"),
    }
    for (motion, value) in motions.iter().zip(&traced.reached) {
        let from = first.and_then(|first| motion.quantity.value(first));
        say!(
            "moved              {} from {} to {} (asked for {})",
            name(structure, motion.quantity),
            decimal(from.unwrap_or(*value)),
            decimal(*value),
            decimal(motion.to)
        );
    }
    if let Some((quantity, deviation)) = traced.worst_held {
        say!(
            "held               {}: {deviation:.3e}",
            format_args!(
                "all other motors; the {} gave way most",
                name(structure, quantity)
            )
        );
    }
    say!(
        "path               {} configurations in {:.4} s",
        traced.path.configurations.len(),
        traced.seconds
    );
    say!(
        "least stiffness    {}",
        stiffness_text(traced.least_stiffness)
    );
    if report.ok {
        say!("check              accepted by the independent judge");
    } else {
        say!("check              REFUSED by the independent judge");
        for failure in &report.failures {
            say!("                   {}", failure.message);
        }
    }
    print_written(files);
}
