//! `tensegra info`: what a structure is.

use std::path::PathBuf;

use serde_json::json;
use tensegra::Description;

use super::{Formulation, formulation_name, json_failure, print_json, read_problem};
use crate::failure::Failure;

/// Say what a structure is: nodes, elements, equations, dimension of its
/// equilibrium manifold, states of self-stress and mechanisms at the start.
#[derive(clap::Args)]
#[command(
    after_help = "Example:\n  tensegra info fixtures/kite.toml --formulation directions --json"
)]
pub struct Arguments {
    /// Problem (.toml) or structure (.tens) file.
    file: PathBuf,
    /// Coordinates of the equilibrium manifold [default: the problem's].
    #[arg(long, value_enum)]
    formulation: Option<Formulation>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
pub fn run(arguments: &Arguments) -> Result<bool, Failure> {
    let describe = || {
        let mut problem = read_problem(&arguments.file)?;
        if let Some(formulation) = arguments.formulation {
            problem.settings.formulation = formulation.into();
        }
        let description = tensegra::describe(&problem).map_err(Failure::message)?;
        let problems = tensegra::find_flaws(&problem);
        Ok((problem, description, problems))
    };
    let (problem, description, flaws) =
        describe().map_err(|failure| json_failure(arguments.json, "ok", failure))?;
    if arguments.json {
        print_json(&as_json(&problem.name, &description, &flaws));
    } else {
        print(&problem.name, &description, &flaws);
    }
    Ok(true)
}

fn as_json(name: &str, d: &Description, flaws: &[String]) -> serde_json::Value {
    let elements: serde_json::Map<_, _> = d
        .elements
        .iter()
        .map(|(kind, n)| (kind.keyword().to_owned(), json!(n)))
        .collect();
    json!({
        "name": name,
        "nodes": d.nodes,
        "elements": elements,
        "formulation": formulation_name(d.formulation),
        "variables_raw": d.variables_raw,
        "equations_raw": d.equations_raw,
        "variables": d.variables,
        "equations": d.equations,
        "independent": d.independent,
        "dimension": d.dimension,
        "self_stress_states": d.self_stress_states,
        "mechanisms": d.mechanisms,
        "problems": flaws,
    })
}

fn print(name: &str, d: &Description, flaws: &[String]) {
    let elements: Vec<String> = d
        .elements
        .iter()
        .map(|(kind, n)| format!("{n} {}", plural(kind.keyword(), *n)))
        .collect();
    println!("{name}");
    println!("  nodes                {}", d.nodes);
    println!("  elements             {}", elements.join(", "));
    println!("  formulation          {}", formulation_name(d.formulation));
    println!(
        "  before elimination   {} variables, {} equations",
        d.variables_raw, d.equations_raw
    );
    println!(
        "  after elimination    {} variables, {} equations",
        d.variables, d.equations
    );
    println!(
        "  independent          {} equations at the start",
        d.independent
    );
    println!("  dimension            k = {}", d.dimension);
    println!("  self-stress states   {}", d.self_stress_states);
    println!("  mechanisms           {}", d.mechanisms);
    println!();
    println!("{}", in_words(d));
    if flaws.is_empty() {
        println!("No problems found.");
    }
    for flaw in flaws {
        println!("Problem: {flaw}");
    }
}

fn plural(word: &str, n: usize) -> String {
    if n == 1 || word == "prismatic" {
        word.to_owned()
    } else {
        format!("{word}s")
    }
}

fn in_words(d: &Description) -> String {
    let rigid = match d.mechanisms {
        0 => "Held at constant length, its elements make it rigid".to_owned(),
        1 => "Held at constant length, its elements leave 1 infinitesimal mechanism".to_owned(),
        m => format!("Held at constant length, its elements leave {m} infinitesimal mechanisms"),
    };
    let stress = match d.self_stress_states {
        0 => "it cannot be prestressed".to_owned(),
        1 => "it can be prestressed in one way".to_owned(),
        s => format!("it can be prestressed in {s} independent ways"),
    };
    let k = d.dimension;
    let freedoms = if k == 1 {
        "1 parameter".to_owned()
    } else {
        format!("{k} parameters")
    };
    format!("{rigid}; {stress}. In equilibrium it moves with {freedoms}.")
}
