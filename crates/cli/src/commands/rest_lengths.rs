//! `tensegra formfind --direct` and `--inverse`: from rest lengths to node
//! positions, and back.

use std::path::Path;

use serde_json::{Map, Value, json};
use tensegra::{
    check::{CheckOptions, Report, check_configuration},
    formfinding::{
        DirectError, DirectForm, DirectOptions, DirectSolver, InverseError, InverseForm,
        InverseOptions, rest_lengths,
    },
    io::{PathFile, write_path_file},
    model::{self, Configuration, Problem, Structure},
};

use super::print_json;
use crate::failure::Failure;

/// Which way, and with what.
#[derive(clap::Args)]
pub struct RestLengthArguments {
    /// From rest lengths to node positions: where the structure settles from its
    /// start. Rest lengths are those of the start, or follow from its forces.
    #[arg(long, conflicts_with_all = ["inverse", "starts", "seed", "threads"])]
    pub direct: bool,
    /// From node positions to rest lengths: those that hold the structure where its
    /// start is, if any do.
    #[arg(long, conflicts_with_all = ["starts", "seed", "threads"])]
    pub inverse: bool,
    /// With --direct, the rest length of an element; may be given several times.
    #[arg(long = "rest", value_name = "NAME=LENGTH", value_parser = parse_rest, requires = "direct")]
    rest: Vec<(String, f64)>,
    /// With --direct, let cables push as well as pull, as a linear model would.
    #[arg(long, requires = "direct")]
    pushing_cables: bool,
    /// With --inverse, what counts as balanced, relative to the largest force.
    #[arg(long, value_name = "X", default_value_t = 1e-6, value_parser = parse_size, requires = "inverse")]
    tolerance: f64,
    /// With --inverse, the least tension of every cable [default: a thousandth of an
    /// evenly spread prestress].
    #[arg(long, value_name = "FORCE", value_parser = parse_size, requires = "inverse")]
    least_tension: Option<f64>,
}

fn parse_rest(text: &str) -> Result<(String, f64), String> {
    let form = || "write NAME=LENGTH, for instance c1=0.25".to_owned();
    let (name, length) = text.rsplit_once('=').ok_or_else(form)?;
    let length: f64 = length.trim().parse().map_err(|_| form())?;
    Ok((name.trim().to_owned(), length))
}

fn parse_size(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(size) if size.is_finite() && size >= 0.0 => Ok(size),
        _ => Err("give a number that is not negative".to_owned()),
    }
}

/// What was found: how to print it, and whether it is sound.
struct Found {
    configuration: Configuration,
    figures: Map<String, Value>,
    lines: Vec<String>,
    sound: bool,
}

/// Runs the mode that is asked for.
pub fn run(
    arguments: &RestLengthArguments,
    problem: &Problem,
    out: &Path,
    json: bool,
) -> Result<bool, Failure> {
    let start = problem.start.as_ref().ok_or_else(|| {
        Failure::Message(
            "the problem states no start: add its node coordinates, under [start.nodes]".into(),
        )
    })?;
    let found = if arguments.direct {
        let mut rest = tensegra::complete(&problem.structure, start).rest_lengths;
        for (name, length) in &arguments.rest {
            set_rest_length(&problem.structure, &mut rest, name, *length)?;
        }
        let mut options = DirectOptions::default();
        options.pushing_cables = arguments.pushing_cables;
        DirectSolver::with_options(&problem.structure, options)
            .solve(&start.positions, &rest)
            .map(|form| direct(&problem.structure, form))
            .map_err(|error| (is_bad_input(&error), error.to_string()))
    } else {
        let mut options = InverseOptions::default();
        options.tolerance = arguments.tolerance;
        options.least_tension = arguments.least_tension;
        options.wanted_rest_lengths = start.rest_lengths.clone();
        rest_lengths(&problem.structure, &start.positions, &options)
            .map(|form| inverse(problem, form))
            .map_err(|error| (matches!(error, InverseError::Statics(_)), error.to_string()))
    };
    let found = match found {
        Ok(found) => found,
        Err((true, reason)) => return Err(Failure::Message(reason)),
        Err((false, reason)) => {
            if json {
                print_json(&json!({ "found": false, "error": reason }));
            } else {
                say!("not found          {reason}");
            }
            return Ok(false);
        }
    };
    let mode = if arguments.direct {
        "direct"
    } else {
        "inverse"
    };
    let report = check_configuration(problem, &found.configuration, &CheckOptions::default());
    let file = out.join(format!("{mode}.json"));
    let mut contents = PathFile::new(
        problem,
        model::Path {
            configurations: vec![found.configuration.clone()],
        },
    );
    (contents.open_start, contents.open_end) = (true, true);
    contents.statistics = Value::Object(found.figures.clone());
    contents.check = json!(report);
    write_path_file(&file, &contents).map_err(Failure::message)?;
    if json {
        print_json(&as_json(problem, &found, &report, &file));
    } else {
        for line in &found.lines {
            say!("{line}");
        }
        say!("check              {}", verdict(&report));
        say!("written            {}", file.display());
    }
    Ok(found.sound && report.ok)
}

/// Whether there is nothing to be found because of what was given.
fn is_bad_input(error: &DirectError) -> bool {
    matches!(
        error,
        DirectError::WrongCount { .. }
            | DirectError::BadStart { .. }
            | DirectError::MissingRest { .. }
            | DirectError::BadRest { .. }
            | DirectError::NoLength { .. }
    )
}

fn set_rest_length(
    structure: &Structure,
    rest: &mut [Option<f64>],
    name: &str,
    length: f64,
) -> Result<(), Failure> {
    let element = structure.element_index(name).ok_or_else(|| {
        Failure::Message(format!(
            "--rest: there is no element `{name}` in the structure"
        ))
    })?;
    if !structure.elements[element].is_actuated() {
        return Err(Failure::Message(format!(
            "--rest: the rest length of `{name}` is not actuated: give it a range in the problem"
        )));
    }
    rest[element] = Some(length);
    Ok(())
}

fn direct(structure: &Structure, form: DirectForm) -> Found {
    let slack: Vec<&str> = form
        .slack
        .iter()
        .map(|&e| structure.elements[e].name.as_str())
        .collect();
    let stability = match (form.least_stiffness, form.is_stable()) {
        (None, _) => "nothing moves".to_owned(),
        (Some(least), true) => format!("stable: least stiffness {least:.6}"),
        (Some(least), false) => format!("not stable: least stiffness {least:.3e}"),
    };
    let slack_line = match slack.as_slice() {
        [] => "none".to_owned(),
        names => names.join(", "),
    };
    Found {
        lines: vec![
            format!(
                "equilibrium        found in {} Newton iterations",
                form.iterations
            ),
            format!(
                "residual           {:.1e}, the largest unbalanced force",
                form.residual
            ),
            format!("stability          {stability} (motors hold rest lengths)"),
            format!("slack              {slack_line}"),
            format!("energy             {:.6}", form.energy),
        ],
        figures: [
            ("stable", json!(form.is_stable())),
            ("least_stiffness", json!(form.least_stiffness)),
            ("residual", json!(form.residual)),
            ("slack", json!(slack)),
            ("energy", json!(form.energy)),
            ("iterations", json!(form.iterations)),
        ]
        .map(|(key, value)| (key.to_owned(), value))
        .into_iter()
        .collect(),
        sound: form.is_stable(),
        configuration: form.configuration,
    }
}

fn inverse(problem: &Problem, form: InverseForm) -> Found {
    let structure = &problem.structure;
    let mut lines = vec![
        format!(
            "choices            {} dimensions of balanced forces",
            form.choices
        ),
        format!(
            "residual           {:.1e}, the largest unbalanced force",
            form.residual
        ),
        "element            rest length          force".to_owned(),
    ];
    let quantities = form
        .configuration
        .rest_lengths
        .iter()
        .zip(&form.configuration.forces);
    for (element, (rest, force)) in structure.elements.iter().zip(quantities) {
        let figure = |value: &Option<f64>| value.map_or("–".to_owned(), |v| format!("{v:.9}"));
        lines.push(format!(
            "  {:<16} {:>11} {:>14}",
            element.name,
            figure(rest),
            figure(force)
        ));
    }
    Found {
        lines,
        figures: [
            ("choices", json!(form.choices)),
            ("residual", json!(form.residual)),
        ]
        .map(|(key, value)| (key.to_owned(), value))
        .into_iter()
        .collect(),
        sound: true,
        configuration: form.configuration,
    }
}

fn verdict(report: &Report) -> String {
    if report.ok {
        return "accepted by the independent judge".to_owned();
    }
    let failures = report
        .failures
        .iter()
        .map(|failure| failure.message.as_str());
    format!("refused: {}", failures.collect::<Vec<_>>().join("; "))
}

fn as_json(problem: &Problem, found: &Found, report: &Report, file: &Path) -> Value {
    let mut object = found.figures.clone();
    let configuration = &found.configuration;
    let nodes = problem.structure.nodes.iter().zip(&configuration.positions);
    let nodes: Map<String, Value> = nodes
        .map(|(node, p)| (node.name.clone(), json!([p.x, p.y, p.z])))
        .collect();
    let by_element = |values: &[Option<f64>]| -> Map<String, Value> {
        let named = problem.structure.elements.iter().zip(values);
        named
            .filter_map(|(element, value)| Some((element.name.clone(), json!((*value)?))))
            .collect()
    };
    let lengths: Vec<Option<f64>> = configuration.lengths.iter().copied().map(Some).collect();
    object.insert("found".into(), json!(true));
    object.insert("nodes".into(), Value::Object(nodes));
    object.insert("lengths".into(), Value::Object(by_element(&lengths)));
    let rest = by_element(&configuration.rest_lengths);
    object.insert("rest_lengths".into(), Value::Object(rest));
    let forces = by_element(&configuration.forces);
    object.insert("forces".into(), Value::Object(forces));
    object.insert("check".into(), json!(report));
    object.insert("files".into(), json!([file]));
    Value::Object(object)
}
