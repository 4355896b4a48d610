//! Statics against closed forms, and what must not change it.

use std::f64::consts::TAU;

use nalgebra::{Isometry3, Point3, Vector3};
use tensegra_model::{
    Actuation, Configuration, ElementKind, ElementSpec, StructureBuilder,
    statics::{
        EquilibriumMatrix, MatrixAnalysis, PrestressStability, StaticsError, StiffnessSpectrum,
        SuperStability, force_densities, force_density_matrix, lumped_masses, natural_frequencies,
    },
};

#[path = "support/closed_forms.rs"]
mod closed_forms;
use closed_forms::{
    Case, Expected, case, closed_forms, octahedron, polygon, prism, tower, tower_overlap,
    two_layer_prism,
};

fn assert_close(found: &[f64], expected: &[f64], tolerance: f64) {
    assert_eq!(found.len(), expected.len(), "{found:?} for {expected:?}");
    for (a, b) in found.iter().zip(expected) {
        assert!((a - b).abs() < tolerance, "{found:?} for {expected:?}");
    }
}

fn compare(case: &Case, expected: &Expected) {
    let Case {
        structure,
        positions,
        groups,
    } = case;
    let matrix = EquilibriumMatrix::new(structure, positions).unwrap();
    let analysis = MatrixAnalysis::new(&matrix, positions);
    assert_eq!(analysis.rank, expected.rank);
    assert_eq!(analysis.self_stress.ncols(), expected.self_stress_states);
    assert_eq!(analysis.mechanisms.ncols(), expected.mechanisms);
    let (counts, does_not) = analysis.gap();
    assert!(counts > 1e-3 && does_not < 1e-13, "{counts} {does_not}");
    assert!((matrix.matrix() * &analysis.self_stress).amax() < 1e-13);
    let strain = (matrix.matrix().transpose() * &analysis.mechanisms).amax();
    assert!(strain < 1e-12, "{strain:e}");
    let across = analysis.rigid_motions.transpose() * &analysis.mechanisms;
    assert!(across.is_empty() || across.amax() < 1e-13);

    let configuration = case.prestressed(expected.densities[0]);
    let densities = force_densities(&configuration);
    for (density, &group) in densities.iter().zip(groups) {
        assert!(
            (density - expected.densities[group]).abs() < 1e-12,
            "{densities:?}"
        );
    }
    let matrix_of_densities = force_density_matrix(structure, &densities);
    for axis in 0..3 {
        let coordinates = nalgebra::DVector::from_fn(positions.len(), |i, _| positions[i][axis]);
        assert!((&matrix_of_densities * coordinates).amax() < 1e-13);
    }
    let super_stability = SuperStability::new(structure, &configuration).unwrap();
    assert!(super_stability.is_super_stable(), "{super_stability:?}");
    assert_eq!(super_stability.nullity, structure.dimension + 1);
    let nonzero = &super_stability.eigenvalues[super_stability.nullity..];
    assert_close(nonzero, &expected.eigenvalues, 1e-8);
    let prestress = PrestressStability::new(structure, &configuration, &matrix, &analysis).unwrap();
    assert!(prestress.is_stable());
    assert_close(&prestress.eigenvalues, &expected.stiffened, 1e-8);
    let stability = StiffnessSpectrum::new(structure, &configuration, Actuation::Length).unwrap();
    assert!(stability.is_stable(), "{:?}", stability.eigenvalues);
}

#[test]
fn prisms_have_their_closed_forms() {
    for data in closed_forms().prism {
        let n = data.sides;
        assert_eq!(data.expected.mechanisms, 2 * n - 5);
        let horizontal = 0.5 / (TAU / 2.0 / n as f64).sin();
        assert!((data.expected.densities[1] - horizontal).abs() < 1e-12);
        compare(&prism(n), &data.expected);
    }
}

#[test]
fn the_expanded_octahedron_has_its_closed_form() {
    let data = closed_forms().octahedron;
    let case = octahedron(&data);
    let configuration = case.prestressed(-1.5);
    let ratio = configuration.lengths[6] / configuration.lengths[0];
    assert!((ratio - data.cable_over_strut).abs() < 1e-15);
    compare(&case, &data.expected);
}

#[test]
fn planar_polygons_have_their_closed_forms() {
    let forms = closed_forms();
    compare(&polygon(6), &forms.hexagon);
    compare(&polygon(4), &forms.square);
}

/// Ranks, and that force densities by group are a self-stress; where there is but one, that it is
/// found.
fn compare_on_supports(case: &Case, states: usize, mechanisms: usize, densities: &[f64]) {
    let matrix = EquilibriumMatrix::new(&case.structure, &case.positions).unwrap();
    let analysis = MatrixAnalysis::new(&matrix, &case.positions);
    assert_eq!(analysis.self_stress.ncols(), states);
    assert_eq!(analysis.mechanisms.ncols(), mechanisms);
    assert_eq!(analysis.rigid_motions.ncols(), 0);
    let configuration = case.stressed(densities);
    let forces = nalgebra::DVector::from_fn(matrix.elements().len(), |e, _| {
        configuration.forces[e].unwrap()
    });
    let unbalanced = (matrix.matrix() * &forces).amax();
    assert!(unbalanced < 1e-10 * forces.amax(), "{unbalanced:e}");
    let across = analysis.self_stress.tr_mul(&forces);
    let outside = (&forces - &analysis.self_stress * across).norm();
    assert!(outside < 1e-10 * forces.norm(), "{outside:e}");
    let prestress =
        PrestressStability::new(&case.structure, &configuration, &matrix, &analysis).unwrap();
    assert!(prestress.is_stable(), "{:?}", prestress.eigenvalues);
}

#[test]
fn the_prism_of_two_layers_has_its_closed_form() {
    let data = closed_forms().two_layer_prism;
    let case = two_layer_prism(&data);
    let (states, mechanisms) = (data.self_stress_states, data.mechanisms);
    compare_on_supports(&case, states, mechanisms, &data.densities);
}

#[test]
fn the_tower_of_two_stages_has_its_closed_form() {
    let data = closed_forms().tower;
    for shape in &data.shapes {
        assert!((tower_overlap(&data, shape) - shape.overlap).abs() < 1e-12);
        let case = tower(&data, shape);
        let highest = case.positions.iter().map(|p| p.z).fold(0.0, f64::max);
        assert!((highest - shape.height).abs() < 1e-12);
        let densities = tower_densities(&case);
        for (exact, printed) in densities.iter().zip(&shape.densities) {
            assert!((exact - printed).abs() < 6e-6, "{exact} {printed}");
        }
        compare_on_supports(&case, data.self_stress_states, data.mechanisms, &densities);
    }
}

/// Force densities of the tower with −1 in the bars: those of the cables balance an upper end of
/// a lower bar, three equations; that of the triangle balances a node on top, along its radius.
fn tower_densities(case: &Case) -> Vec<f64> {
    let node = |name: &str| case.structure.node_index(name).unwrap();
    let pulls = |at: usize| {
        let mut pulls = [Vector3::zeros(); 5];
        for (element, &group) in case.structure.elements.iter().zip(&case.groups) {
            let [a, b] = element.nodes;
            if let Some(other) = [(a, b), (b, a)].iter().find(|pair| pair.0 == at) {
                pulls[group] += case.positions[other.1] - case.positions[at];
            }
        }
        pulls
    };
    let [bar, cables @ .., _] = pulls(node("n3"));
    let balance = nalgebra::Matrix3::from_columns(&cables);
    let cables = balance.lu().solve(&bar).unwrap();
    let top = node("n9");
    let [bar, saddle, vertical, diagonal, triangle] = pulls(top);
    let load = -bar + saddle * cables[0] + vertical * cables[1] + diagonal * cables[2];
    let ring = -load.dot(&triangle) / triangle.norm_squared();
    assert!(
        (load + triangle * ring).norm() < 1e-12,
        "the plate is in balance"
    );
    vec![-1.0, cables[0], cables[1], cables[2], ring]
}

/// Everything that must not depend on how a structure is written down, or scale.
struct Summary {
    counts: [usize; 4],
    stiffness: Vec<f64>,
    force_controlled: Vec<f64>,
    stiffened: Vec<f64>,
    force_densities: Vec<f64>,
    frequencies: Vec<f64>,
}

fn summary(case: &Case, configuration: &Configuration) -> Summary {
    let structure = &case.structure;
    let matrix = EquilibriumMatrix::new(structure, &configuration.positions).unwrap();
    let analysis = MatrixAnalysis::new(&matrix, &configuration.positions);
    let eigenvalues = |actuation| {
        let stability = StiffnessSpectrum::new(structure, configuration, actuation).unwrap();
        stability.eigenvalues
    };
    let masses: Vec<f64> = (0..structure.nodes.len())
        .map(|node| 1.0 + structure.nodes[node].name.len() as f64)
        .collect();
    let prestress = PrestressStability::new(structure, configuration, &matrix, &analysis).unwrap();
    let super_stability = SuperStability::new(structure, configuration).unwrap();
    Summary {
        counts: [
            analysis.rank,
            analysis.self_stress.ncols(),
            analysis.mechanisms.ncols(),
            super_stability.nullity,
        ],
        stiffness: eigenvalues(Actuation::Length),
        force_controlled: eigenvalues(Actuation::Force),
        stiffened: prestress.eigenvalues,
        force_densities: super_stability.eigenvalues,
        frequencies: natural_frequencies(structure, configuration, &masses, Actuation::Length)
            .unwrap(),
    }
}

/// Compares where forces are multiplied by `force` and lengths by `length`.
fn assert_scaled(found: &Summary, reference: &Summary, force: f64, length: f64) {
    assert_eq!(found.counts, reference.counts);
    let compare = |found: &[f64], reference: &[f64], scale: f64| {
        let largest = reference
            .iter()
            .fold(0.0_f64, |l, value| l.max(value.abs()));
        let expected: Vec<f64> = reference.iter().map(|value| scale * value).collect();
        assert_close(found, &expected, 1e-11 * scale * largest);
    };
    let stiffness = force / length;
    compare(&found.stiffness, &reference.stiffness, stiffness);
    compare(
        &found.force_controlled,
        &reference.force_controlled,
        stiffness,
    );
    compare(&found.stiffened, &reference.stiffened, stiffness);
    compare(
        &found.force_densities,
        &reference.force_densities,
        stiffness,
    );
    compare(&found.frequencies, &reference.frequencies, stiffness.sqrt());
}

fn scaled(
    case: &Case,
    configuration: &Configuration,
    force: f64,
    length: f64,
) -> (Case, Configuration) {
    let (mut case, mut configuration) = (case.clone(), configuration.clone());
    for element in &mut case.structure.elements {
        if let tensegra_model::ForceLaw::Linear { stiffness, .. } = &mut element.law {
            *stiffness *= force / length;
        }
    }
    configuration
        .positions
        .iter_mut()
        .for_each(|p| *p *= length);
    configuration.lengths.iter_mut().for_each(|l| *l *= length);
    configuration
        .rest_lengths
        .iter_mut()
        .flatten()
        .for_each(|r| *r *= length);
    configuration
        .forces
        .iter_mut()
        .flatten()
        .for_each(|f| *f *= force);
    (case, configuration)
}

#[test]
fn rigid_motions_change_nothing() {
    let case = octahedron(&closed_forms().octahedron);
    let configuration = case.prestressed(-1.5);
    let reference = summary(&case, &configuration);
    let motion = Isometry3::new(Vector3::new(3.0, -2.0, 7.0), Vector3::new(0.4, 1.1, -0.7));
    let mut moved = configuration;
    moved.positions.iter_mut().for_each(|p| *p = motion * *p);
    assert_scaled(&summary(&case, &moved), &reference, 1.0, 1.0);
}

#[test]
fn relabelling_of_nodes_changes_nothing() {
    let data = closed_forms().octahedron;
    let case = octahedron(&data);
    let reference = summary(&case, &case.prestressed(-1.5));
    // Elements in the reverse order, ends exchanged, and so nodes in another order.
    let back = |pairs: &[[usize; 2]]| -> Vec<[usize; 2]> {
        pairs.iter().rev().map(|[a, b]| [*b, *a]).collect()
    };
    let relabelled = super_case(&data.nodes, &back(&data.struts), &back(&data.cables));
    let found = summary(&relabelled, &relabelled.prestressed(-1.5));
    assert_scaled(&found, &reference, 1.0, 1.0);
}

fn super_case(points: &[[f64; 3]], struts: &[[usize; 2]], cables: &[[usize; 2]]) -> Case {
    let groups = [
        (ElementKind::Prismatic, struts.to_vec()),
        (ElementKind::Cable, cables.to_vec()),
    ];
    case(3, points, &groups, &[])
}

#[test]
fn units_and_doubled_forces_scale_the_results() {
    let case = prism(4);
    let configuration = case.prestressed(-1.0);
    let reference = summary(&case, &configuration);
    // Metres to millimetres, newtons to kilonewtons; then twice as strong.
    for (force, length) in [(1e-3, 1e3), (2.0, 1.0)] {
        let (case, configuration) = scaled(&case, &configuration, force, length);
        let found = summary(&case, &configuration);
        assert_scaled(&found, &reference, force, length);
    }
}

#[test]
fn supports_take_freedoms_and_motions_away() {
    // The prism on its base: no rigid motion is left, and the base needs no cables.
    let n = 3;
    let whole = prism(n);
    let configuration = whole.prestressed(-1.0);
    let mut held = whole.clone();
    for node in &mut held.structure.nodes {
        let index: usize = node.name[1..].parse().unwrap();
        node.balanced = index >= n;
    }
    let matrix = EquilibriumMatrix::new(&held.structure, &held.positions).unwrap();
    let analysis = MatrixAnalysis::new(&matrix, &held.positions);
    assert_eq!(matrix.matrix().shape(), (9, 12));
    assert_eq!(analysis.rigid_motions.ncols(), 0);
    // The three base edges join supports: they stress nothing, and count each.
    assert_eq!(
        (analysis.self_stress.ncols(), analysis.mechanisms.ncols()),
        (4, 1)
    );
    let super_stability = SuperStability::new(&held.structure, &configuration).unwrap();
    assert_eq!(super_stability.required_nullity, 1);
    assert!(super_stability.is_super_stable(), "{super_stability:?}");
    let stability =
        StiffnessSpectrum::new(&held.structure, &configuration, Actuation::Length).unwrap();
    assert_eq!(stability.eigenvalues.len(), 9);
    assert!(stability.is_stable());
    let motion = &stability.softest;
    assert!(
        held.structure
            .nodes
            .iter()
            .zip(motion)
            .all(|(node, v)| node.balanced || v.norm() == 0.0)
    );
}

#[test]
fn compression_beyond_buckling_is_unstable() {
    // Pushing cables: the prestress of the hexagon reversed drives its mechanism.
    let case = polygon(6);
    let configuration = case.prestressed(0.5);
    let matrix = EquilibriumMatrix::new(&case.structure, &case.positions).unwrap();
    let analysis = MatrixAnalysis::new(&matrix, &case.positions);
    let prestress =
        PrestressStability::new(&case.structure, &configuration, &matrix, &analysis).unwrap();
    assert_eq!(prestress.unstable_mechanisms(), 1);
    assert!(
        !SuperStability::new(&case.structure, &configuration)
            .unwrap()
            .is_super_stable()
    );
}

#[test]
fn structures_on_a_conic_are_not_super_stable() {
    let points = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [1.0, 1.0, 0.0],
        [0.0, 1.0, 0.0],
    ];
    let sides = vec![[0, 1], [1, 2], [2, 3], [3, 0]];
    let groups = [
        (ElementKind::Prismatic, vec![[0, 2], [1, 3]]),
        (ElementKind::Cable, sides),
    ];
    let case = case(2, &points, &groups, &[]);
    let mut configuration = case.prestressed(-1.0);
    assert!(
        !SuperStability::new(&case.structure, &configuration)
            .unwrap()
            .on_conic
    );
    // Without stress in the diagonals two directions are left, and the square shears.
    configuration.forces[0] = Some(0.0);
    configuration.forces[1] = Some(0.0);
    assert!(
        SuperStability::new(&case.structure, &configuration)
            .unwrap()
            .on_conic
    );
}

#[test]
fn stiffness_is_the_derivative_of_the_forces() {
    let case = prism(3);
    let configuration = case.prestressed(-1.0);
    let structure = &case.structure;
    let matrix = EquilibriumMatrix::new(structure, &case.positions).unwrap();
    let freedoms = matrix.freedoms();
    let stiffness = tensegra_model::statics::material_stiffness(
        structure,
        &configuration,
        freedoms,
        Actuation::Length,
    )
    .unwrap()
        + tensegra_model::statics::geometric_stiffness(structure, &configuration, freedoms)
            .unwrap();
    let forces_at = |positions: &[Point3<f64>]| {
        let matrix = EquilibriumMatrix::new(structure, positions).unwrap();
        let tensions = nalgebra::DVector::from_fn(structure.elements.len(), |e, _| {
            let [a, b] = structure.elements[e].nodes;
            let length = (positions[b] - positions[a]).norm();
            structure.elements[e].stiffness().unwrap()
                * (length - configuration.rest_lengths[e].unwrap())
        });
        -matrix.matrix() * tensions
    };
    let step = 1e-6;
    for (column, &[node, axis]) in freedoms.coordinates().iter().enumerate() {
        let shifted = |by: f64| {
            let mut positions = case.positions.clone();
            positions[node][axis] += by;
            forces_at(&positions)
        };
        let difference = (shifted(step) - shifted(-step)) / (2.0 * step);
        assert!((stiffness.column(column) - difference).amax() < 1e-6);
    }
}

#[test]
fn two_masses_on_a_spring_vibrate_as_known() {
    let structure = StructureBuilder::spatial()
        .spring("spring", ["a", "b"], 0.0..=9.0, 50.0, 1.0)
        .build()
        .unwrap();
    let configuration = Configuration {
        positions: vec![Point3::origin(), Point3::new(0.0, 2.0, 0.0)],
        lengths: vec![2.0],
        rest_lengths: vec![Some(1.0)],
        forces: vec![Some(50.0)],
    };
    let masses = [2.0, 3.0];
    let found = natural_frequencies(&structure, &configuration, &masses, Actuation::Length);
    let expected = (50.0_f64 * (1.0 / 2.0 + 1.0 / 3.0)).sqrt() / TAU;
    assert_close(&found.unwrap(), &[expected], 1e-13);
    assert_eq!(lumped_masses(&structure), None);
    let none = natural_frequencies(&structure, &configuration, &[2.0, 0.0], Actuation::Length);
    assert!(matches!(none, Err(StaticsError::NoMass { node }) if node == "b"));
}

#[test]
fn masses_of_elements_go_to_their_ends() {
    let spec = |name: &str, nodes: [&str; 2], mass: f64| {
        ElementSpec::new(ElementKind::Bar, name, nodes, 1.0).dynamic("mass", vec![mass])
    };
    let structure = StructureBuilder::planar()
        .element(spec("one", ["a", "b"], 2.0))
        .element(spec("two", ["b", "c"], 4.0))
        .build()
        .unwrap();
    assert_eq!(lumped_masses(&structure), Some(vec![1.0, 3.0, 2.0]));
}

#[test]
fn bad_positions_are_refused_by_name() {
    let case = prism(3);
    let mut positions = case.positions.clone();
    positions[1].x = f64::NAN;
    let name = case.structure.nodes[1].name.clone();
    assert_eq!(
        EquilibriumMatrix::new(&case.structure, &positions).unwrap_err(),
        StaticsError::NotFinite { node: name }
    );
    let positions = vec![Point3::origin(); 6];
    let error = EquilibriumMatrix::new(&case.structure, &positions).unwrap_err();
    assert!(error.to_string().contains("e0.0"), "{error}");
    let error = EquilibriumMatrix::new(&case.structure, &positions[1..]).unwrap_err();
    assert!(error.to_string().contains("5 positions"), "{error}");
}
