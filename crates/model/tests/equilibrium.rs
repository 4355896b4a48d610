//! The equations of the equilibrium manifold.

use nalgebra::{Point3, Vector3};
use tensegra_atlas::{dimension, project};
use tensegra_model::{Configuration, EquilibriumManifold, NodesManifold, StructureBuilder};

/// Two struts that cross within four cables.
fn cross() -> StructureBuilder {
    let cable = |builder: StructureBuilder, name, nodes| {
        builder.cable(name, nodes, 0.0..=3.0, 16.0, 0.0..=2.0)
    };
    let builder = StructureBuilder::planar()
        .strut("s1", ["a", "b"], 1.0)
        .strut("s2", ["c", "d"], 1.0)
        .pretension(4.0);
    [
        ("c1", ["a", "c"]),
        ("c2", ["b", "c"]),
        ("c3", ["a", "d"]),
        ("c4", ["b", "d"]),
    ]
    .into_iter()
    .fold(builder, |builder, (name, nodes)| {
        cable(builder, name, nodes)
    })
}

fn flying() -> StructureBuilder {
    cross().free_flying([3.0, 3.0, 0.0])
}

fn fixed() -> StructureBuilder {
    cross().fix("a", [0.0; 3]).fix("b", [1.0, 0.0, 0.0])
}

/// Not in equilibrium yet. The order of nodes is that of naming.
fn guess() -> Configuration {
    let positions = [[0.0, 0.0], [1.0, 0.0], [0.6, 0.55], [0.35, -0.4]];
    Configuration {
        positions: positions.map(|[x, y]| Point3::new(x, y, 0.0)).to_vec(),
        lengths: vec![1.0, 1.0, 0.8, 0.7, 0.5, 0.8],
        rest_lengths: vec![None; 6],
        forces: [-2.0, -2.0, 1.5, 1.5, 1.5, 1.5].map(Some).to_vec(),
    }
}

/// The force that elements exert on each node.
fn forces(manifold: &NodesManifold, x: &[f64]) -> Vec<Vector3<f64>> {
    let configuration = manifold.configuration(x);
    let mut forces = vec![Vector3::zeros(); 4];
    for (element, force) in manifold
        .structure()
        .elements
        .iter()
        .zip(&configuration.forces)
    {
        let [a, b] = element.nodes;
        let along = configuration.positions[b] - configuration.positions[a];
        let pull = along.normalize() * force.unwrap();
        forces[a] += pull;
        forces[b] -= pull;
    }
    forces
}

#[test]
fn balance_that_follows_from_that_of_the_others_is_no_equation() {
    for (builder, left_out) in [
        // The resultant; with two nodes in their places, the moment too.
        (flying(), 2),
        (fixed(), 3),
        // Loads and supports are no internal forces.
        (
            fixed()
                .load("c", [0.0, 1.0, 0.0])
                .load("d", [0.0, -1.0, 0.0]),
            0,
        ),
        (fixed().support("a"), 0),
    ] {
        let manifold = NodesManifold::new(&builder.build().unwrap(), &guess().positions).unwrap();
        let balanced = manifold
            .structure()
            .nodes
            .iter()
            .filter(|node| node.balanced);
        assert_eq!(manifold.balance_count(), 2 * balanced.count() - left_out);
    }
}

#[test]
fn all_nodes_are_in_balance_where_the_equations_hold() {
    for (builder, k) in [(flying(), 6), (fixed(), 3)] {
        let structure = builder.build().unwrap();
        let manifold = NodesManifold::new(&structure, &guess().positions).unwrap();
        let mut x = manifold.coordinates(&guess());
        assert!(forces(&manifold, &x).iter().any(|force| force.norm() > 0.1));
        project(&manifold, &mut x, 1e-12, 50).unwrap();
        for force in forces(&manifold, &x) {
            assert!(force.norm() < 1e-10, "{force}");
        }
        assert_eq!(dimension(&manifold, &x), k);
    }
}
