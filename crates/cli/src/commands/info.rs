//! `tensegra info`: what a structure is.

use std::path::PathBuf;

use serde_json::{Value, json};
use tensegra::{
    Description, Rigidity,
    formfinding::Loss,
    model::{Problem, Structure, statics::StiffnessSpectrum},
};

use super::{Formulation, formulation_name, json_failure, print_json, read_problem};
use crate::failure::Failure;

/// Say what a structure is: nodes, elements, equations, dimension of its
/// equilibrium manifold; and its statics at the start: states of self-stress,
/// mechanisms, stability, what would make it collapse.
///
/// Stiffnesses are eigenvalues of the tangent stiffness, in force per length, on
/// the motions that keep constant lengths. An element counts as lost when a cable
/// goes slack or anything breaks, while motors hold all rest lengths.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    tensegra info fixtures/kite.toml --formulation directions --json\n  \
    tensegra info fixtures/formfinding/six_bar.toml --node-mass 1")]
pub struct Arguments {
    /// Problem (.toml) or structure (.tens) file.
    file: PathBuf,
    /// Coordinates of the equilibrium manifold [default: the problem's].
    #[arg(long, value_enum)]
    formulation: Option<Formulation>,
    /// Mass of every node, for natural frequencies [default: half the mass of each
    /// element at either end, where elements state one].
    #[arg(long, value_name = "M", value_parser = parse_mass)]
    node_mass: Option<f64>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

fn parse_mass(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(mass) if mass.is_finite() && mass > 0.0 => Ok(mass),
        _ => Err("give a positive number".to_owned()),
    }
}

/// Runs the verb.
pub fn run(arguments: &Arguments) -> Result<bool, Failure> {
    let describe = || {
        let mut problem = read_problem(&arguments.file)?;
        if let Some(formulation) = arguments.formulation {
            problem.settings.formulation = formulation.into();
        }
        let description =
            tensegra::describe(&problem, arguments.node_mass).map_err(Failure::message)?;
        let problems = tensegra::find_flaws(&problem);
        Ok((problem, description, problems))
    };
    let (problem, description, flaws) =
        describe().map_err(|failure| json_failure(arguments.json, "ok", failure))?;
    if arguments.json {
        print_json(&as_json(&problem, &description, &flaws));
    } else {
        print(&problem, &description, &flaws);
    }
    Ok(true)
}

fn as_json(problem: &Problem, d: &Description, flaws: &[String]) -> Value {
    let elements: serde_json::Map<_, _> = d
        .elements
        .iter()
        .map(|(kind, n)| (kind.keyword().to_owned(), json!(n)))
        .collect();
    json!({
        "name": problem.name,
        "nodes": d.nodes,
        "elements": elements,
        "formulation": formulation_name(d.formulation),
        "variables_raw": d.variables_raw,
        "equations_raw": d.equations_raw,
        "variables": d.variables,
        "equations": d.equations,
        "independent": d.independent,
        "dimension": d.dimension,
        "self_stress_states": d.rigidity.self_stress.len(),
        "mechanisms": d.rigidity.mechanisms.len(),
        "statics": statics_json(&problem.structure, &d.rigidity),
        "problems": flaws,
    })
}

fn statics_json(structure: &Structure, r: &Rigidity) -> Value {
    let names = |elements: Vec<usize>| -> Vec<&str> {
        let names = elements
            .iter()
            .map(|&e| structure.elements[e].name.as_str());
        names.collect()
    };
    let by_element = |densities: &[f64]| -> Value {
        let named = structure.elements.iter().zip(densities);
        named
            .map(|(element, density)| (element.name.clone(), json!(density)))
            .collect::<serde_json::Map<_, _>>()
            .into()
    };
    let by_node = |displacements: Vec<[f64; 3]>| -> Value {
        let named = structure.nodes.iter().zip(displacements);
        named
            .map(|(node, v)| (node.name.clone(), json!(v)))
            .collect::<serde_json::Map<_, _>>()
            .into()
    };
    let stability = |stability: &StiffnessSpectrum| {
        json!({
            "stable": stability.is_stable(),
            "least_stiffness": stability.least(),
            "soft_motions": stability.soft_motions(),
            "eigenvalues": stability.eigenvalues,
            "softest_motion": by_node(stability.softest.iter().map(|&v| v.into()).collect()),
        })
    };
    let losses: serde_json::Map<_, _> = structure
        .elements
        .iter()
        .zip(&r.losses)
        .filter_map(|(element, loss)| {
            let loss = match (*loss)? {
                Loss::Collapses => json!({ "holds": false }),
                Loss::Holds {
                    displacement,
                    least_stiffness,
                } => json!({
                    "holds": true,
                    "displacement": displacement,
                    "least_stiffness": least_stiffness,
                }),
            };
            Some((element.name.clone(), loss))
        })
        .collect();
    let mechanisms = r.mechanisms.iter();
    let mechanisms = mechanisms.map(|motion| by_node(motion.iter().map(|&v| v.into()).collect()));
    let s = &r.super_stability;
    json!({
        "rank": r.rank,
        "rank_gap": r.rank_gap,
        "rigid_motions": r.rigid_motions,
        "self_stress": r.self_stress.iter().map(|q| by_element(q)).collect::<Vec<_>>(),
        "mechanisms": mechanisms.collect::<Vec<_>>(),
        "force_densities": by_element(&r.force_densities),
        "length_controlled": stability(&r.length_controlled),
        "force_controlled": stability(&r.force_controlled),
        "prestress": {
            "stable": r.prestress.is_stable(),
            "mechanism_stiffness": r.prestress.eigenvalues,
        },
        "super_stability": {
            "super_stable": s.is_super_stable(),
            "positive_semidefinite": s.is_positive_semidefinite(),
            "nullity": s.nullity,
            "required_nullity": s.required_nullity,
            "on_conic": s.on_conic,
            "force_density_eigenvalues": s.eigenvalues,
        },
        "buckling_factor": r.buckling_factor,
        "natural_frequencies": r.frequencies,
        "loosest": r.loosest.map(|(e, force)| {
            json!({ "element": structure.elements[e].name, "force": force })
        }),
        "critical_elements": names(r.critical_elements()),
        "folding_elements": names(r.folding_elements()),
        "dispensable_elements": names(r.dispensable_elements()),
        "losses": losses,
        "words": r.in_words(structure),
    })
}

fn print(problem: &Problem, d: &Description, flaws: &[String]) {
    let elements: Vec<String> = d
        .elements
        .iter()
        .map(|(kind, n)| format!("{n} {}", plural(kind.keyword(), *n)))
        .collect();
    say!("{}", problem.name);
    say!("  nodes                {}", d.nodes);
    say!("  elements             {}", elements.join(", "));
    say!("  formulation          {}", formulation_name(d.formulation));
    say!(
        "  before elimination   {} variables, {} equations",
        d.variables_raw,
        d.equations_raw
    );
    say!(
        "  after elimination    {} variables, {} equations",
        d.variables,
        d.equations
    );
    say!(
        "  independent          {} equations at the start",
        d.independent
    );
    say!("  dimension            k = {}", d.dimension);
    say!("  self-stress states   {}", d.rigidity.self_stress.len());
    say!("  mechanisms           {}", d.rigidity.mechanisms.len());
    say!();
    say!("In equilibrium it moves with {}.", parameters(d.dimension));
    for sentence in d.rigidity.in_words(&problem.structure) {
        say!("{sentence}");
    }
    if flaws.is_empty() {
        say!("No problems found.");
    }
    for flaw in flaws {
        say!("Problem: {flaw}");
    }
}

fn plural(word: &str, n: usize) -> String {
    if n == 1 || word == "prismatic" {
        word.to_owned()
    } else {
        format!("{word}s")
    }
}

fn parameters(dimension: usize) -> String {
    match dimension {
        1 => "1 parameter".to_owned(),
        k => format!("{k} parameters"),
    }
}
