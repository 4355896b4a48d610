//! Positions of closed forms, found from rest lengths by direct form-finding.

use nalgebra::{Point3, Vector3};
use tensegra_formfinding::{DirectSolver, alignment};
use tensegra_model::Configuration;

#[path = "../../model/tests/support/closed_forms.rs"]
mod closed_forms;
use closed_forms::{Case, closed_forms, octahedron, polygon, prism, tower, two_layer_prism};

/// Displacement of nodes, over the longest element.
const SHAKE: f64 = 0.02;

/// Shakes the structure and lets it settle: it has to come back.
fn settles_in(case: &Case, configuration: &Configuration) {
    let structure = &case.structure;
    let longest = configuration.lengths.iter().fold(0.0_f64, |m, l| m.max(*l));
    let mut state = 1_u64;
    let mut next = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        SHAKE * longest * ((state >> 33) as f64 / f64::from(1 << 30) - 1.0)
    };
    let shaken: Vec<Point3<f64>> = structure
        .nodes
        .iter()
        .zip(&case.positions)
        .map(|(node, point)| {
            let by = Vector3::from_fn(|axis, _| {
                if axis < structure.dimension {
                    next()
                } else {
                    0.0
                }
            });
            if node.balanced { point + by } else { *point }
        })
        .collect();
    let form = DirectSolver::new(structure)
        .solve(&shaken, &configuration.rest_lengths)
        .unwrap();
    assert!(form.is_stable() && form.slack.is_empty());
    let found = &form.configuration.positions;
    let floats = structure.nodes.iter().all(|node| node.balanced);
    let motion = match floats {
        true => alignment(found, &case.positions, structure.dimension == 2),
        false => nalgebra::Isometry3::identity(),
    };
    for (a, b) in found.iter().zip(&case.positions) {
        let off = (motion * a - b).norm();
        assert!(off < 1e-10 * longest.max(1.0), "{off:e}");
    }
    let forces = form.configuration.forces.iter().zip(&configuration.forces);
    for ((found, expected), length) in forces.zip(&configuration.lengths) {
        let density = (found.unwrap() - expected.unwrap()) / length;
        assert!(density.abs() < 1e-10, "{density:e}");
    }
}

#[test]
fn free_structures_settle_in_their_closed_forms() {
    let forms = closed_forms();
    for data in &forms.prism {
        let case = prism(data.sides);
        settles_in(&case, &case.prestressed(data.expected.densities[0]));
    }
    let case = octahedron(&forms.octahedron);
    settles_in(
        &case,
        &case.prestressed(forms.octahedron.expected.densities[0]),
    );
    for (sides, expected) in [(6, &forms.hexagon), (4, &forms.square)] {
        let case = polygon(sides);
        settles_in(&case, &case.prestressed(expected.densities[0]));
    }
}

#[test]
fn supported_structures_settle_in_their_closed_forms() {
    let forms = closed_forms();
    let case = two_layer_prism(&forms.two_layer_prism);
    settles_in(&case, &case.stressed(&forms.two_layer_prism.densities));
    for shape in &forms.tower.shapes {
        let case = tower(&forms.tower, shape);
        settles_in(&case, &case.prestressed(-1.0));
    }
}
