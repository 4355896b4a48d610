//! A structure in figures: sizes of its equations, dimension of its manifold,
//! statics.

use tensegra_model::{
    DirectionsManifold, ElementKind, EquilibriumManifold, Formulation, NodesManifold, Problem,
};

use crate::{
    endpoint::{EndpointError, complete, refine},
    planning::PlanningError,
    rigidity::Rigidity,
};

/// What there is to say about a problem's structure at its start.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Description {
    /// Number of nodes.
    pub nodes: usize,
    /// Number of elements of each kind that occurs.
    pub elements: Vec<(ElementKind, usize)>,
    /// The formulation that the counts are about.
    pub formulation: Formulation,
    /// Variables before simplification.
    pub variables_raw: usize,
    /// Equations before simplification.
    pub equations_raw: usize,
    /// Variables.
    pub variables: usize,
    /// Equations.
    pub equations: usize,
    /// Independent equations, at the start.
    pub independent: usize,
    /// Dimension k of the equilibrium manifold at the start.
    pub dimension: usize,
    /// Statics at the start.
    pub rigidity: Rigidity,
}

/// Describes a problem's structure in its formulation, with one mass at every node
/// where given, else with the masses that the elements state.
///
/// # Errors
/// [`PlanningError`] when the structure is contradictory or the start cannot be
/// put in equilibrium.
pub fn describe(problem: &Problem, node_mass: Option<f64>) -> Result<Description, PlanningError> {
    let found = crate::find_endpoints(problem)?;
    let problem = found.as_ref();
    let structure = &problem.structure;
    let start = problem
        .start
        .as_ref()
        .ok_or(EndpointError::Missing { which: "start" })?;
    let start = complete(structure, start);
    let nodes = NodesManifold::new(structure, &start.positions)?;
    let size = nodes.size();
    let formulation = problem.settings.formulation;
    let (manifold, variables_raw, equations_raw): (Box<dyn EquilibriumManifold>, _, _) =
        match formulation {
            Formulation::Nodes => {
                let raw = (nodes.raw_variable_count(), nodes.raw_equation_count());
                (Box::new(nodes), raw.0, raw.1)
            }
            Formulation::Directions => {
                let manifold = DirectionsManifold::new(structure)?;
                let counts = manifold.counts();
                (
                    Box::new(manifold),
                    counts.raw_variables,
                    counts.raw_equations,
                )
            }
        };
    let x = refine(manifold.as_ref(), "start", &start, size)?;
    let dimension = tensegra_atlas::dimension(manifold.as_ref(), &x);
    let masses = node_mass.map(|mass| vec![mass; structure.nodes.len()]);
    let rigidity = Rigidity::new(structure, &manifold.configuration(&x), masses.as_deref())?;
    let mut elements: Vec<(ElementKind, usize)> = Vec::new();
    for element in &structure.elements {
        match elements.iter_mut().find(|(kind, _)| *kind == element.kind) {
            Some((_, count)) => *count += 1,
            None => elements.push((element.kind, 1)),
        }
    }
    let variables = manifold.ambient_dimension();
    Ok(Description {
        nodes: structure.nodes.len(),
        elements,
        formulation,
        variables_raw,
        equations_raw,
        variables,
        equations: manifold.equation_count(),
        independent: variables - dimension,
        dimension,
        rigidity,
    })
}

/// What would keep the problem from being planned: endpoints that are missing,
/// in collision or out of range. Each is a sentence.
pub fn find_flaws(problem: &Problem) -> Vec<String> {
    let found = match crate::find_endpoints(problem) {
        Ok(found) => found,
        Err(error) => return vec![PlanningError::from(error).to_string()],
    };
    let problem = found.as_ref();
    let mut flaws = Vec::new();
    for (which, endpoint) in [("start", &problem.start), ("goal", &problem.goal)] {
        if endpoint.is_none() {
            flaws.push(EndpointError::Missing { which }.to_string());
        }
    }
    if flaws.is_empty()
        && let Err(error) = crate::planning::prepare(problem)
    {
        flaws.push(error.to_string());
    }
    flaws
}
