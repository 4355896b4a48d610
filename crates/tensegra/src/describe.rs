//! A structure in figures: sizes of its equations, dimension of its manifold,
//! states of self-stress and mechanisms.

use nalgebra::DMatrix;
use tensegra_model::{
    Configuration, DirectionsManifold, ElementKind, EquilibriumManifold, Formulation,
    NodesManifold, Problem, Structure,
};

use crate::{
    endpoint::{EndpointError, complete, refine},
    planning::PlanningError,
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
    /// Independent states of self-stress of the elements that carry a force.
    pub self_stress_states: usize,
    /// Infinitesimal mechanisms of those elements taken as rigid.
    pub mechanisms: usize,
}

/// Describes a problem's structure in its formulation.
///
/// # Errors
/// [`PlanningError`] when the structure is contradictory or the start cannot be
/// put in equilibrium.
pub fn describe(problem: &Problem) -> Result<Description, PlanningError> {
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
    let (self_stress_states, mechanisms) = statics_counts(structure, &manifold.configuration(&x));
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
        self_stress_states,
        mechanisms,
    })
}

/// States of self-stress and mechanisms by the rank r of the equilibrium
/// matrix: s = elements − r; m = degrees of freedom − rigid motions − r
/// (Pellegrino and Calladine 1986). Supports that take reactions are held.
fn statics_counts(structure: &Structure, at: &Configuration) -> (usize, usize) {
    let d = structure.dimension;
    let balanced: Vec<usize> = (0..structure.nodes.len())
        .filter(|&i| structure.nodes[i].balanced)
        .collect();
    let carrying: Vec<usize> = (0..structure.elements.len())
        .filter(|&e| structure.elements[e].carries_force())
        .collect();
    // Nodes that only decorate (no element with a force) do not count.
    let touched: Vec<usize> = balanced
        .into_iter()
        .filter(|&i| {
            carrying
                .iter()
                .any(|&e| structure.elements[e].nodes.contains(&i))
        })
        .collect();
    if touched.is_empty() || carrying.is_empty() {
        return (carrying.len(), 0);
    }
    let mut matrix = DMatrix::<f64>::zeros(d * touched.len(), carrying.len());
    for (column, &e) in carrying.iter().enumerate() {
        let [a, b] = structure.elements[e].nodes;
        let direction = (at.positions[b] - at.positions[a]) / at.lengths[e];
        for (node, sign) in [(a, 1.0), (b, -1.0)] {
            if let Some(row) = touched.iter().position(|&i| i == node) {
                for axis in 0..d {
                    matrix[(d * row + axis, column)] = sign * direction[axis];
                }
            }
        }
    }
    let singular = matrix.singular_values();
    let rank = singular
        .iter()
        .filter(|&&s| s > 1e-8 * singular.max())
        .count();
    let supports = structure.nodes.iter().filter(|node| !node.balanced).count();
    // Rigid motions that the supports leave.
    let rigid = match (d, supports) {
        (2, 0) => 3,
        (2, 1) => 1,
        (3, 0) => 6,
        (3, 1) => 3,
        (3, 2) => 1,
        _ => 0,
    };
    let freedoms = d * touched.len();
    (carrying.len() - rank, freedoms.saturating_sub(rigid + rank))
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
