//! Direct and inverse form-finding, against published poses, closed forms and each
//! other.

use nalgebra::{Isometry3, Point3, Vector3};
use serde::Deserialize;
use tensegra_formfinding::{
    DirectError, DirectForm, DirectOptions, DirectSolver, InverseError, InverseOptions, Loss,
    alignment, critical_force_density, free_standing_shape, losses, rest_lengths,
};
use tensegra_model::{
    Actuation, ElementKind, ElementSpec, ForceLaw, Interval, Structure, StructureBuilder,
    statics::{EquilibriumMatrix, MatrixAnalysis, StiffnessSpectrum, force_density_matrix},
};

/// Published poses of a robot.
#[derive(Deserialize)]
struct Robot {
    nodes: usize,
    cables: Vec<[usize; 2]>,
    cable_stiffness: f64,
    rods: Vec<[usize; 2]>,
    rod_stiffness: f64,
    rod_rest_length: f64,
    poses: Vec<Pose>,
}

#[derive(Deserialize)]
struct Pose {
    rest_lengths: Vec<f64>,
    nodes: Vec<[f64; 3]>,
}

fn read<T: serde::de::DeserializeOwned>(name: &str) -> T {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/formfinding/");
    let text = std::fs::read_to_string(format!("{folder}{name}")).unwrap();
    serde_json::from_str(&text).unwrap()
}

impl Robot {
    /// The structure, and for each of its nodes the number that the file gives it.
    fn structure(&self) -> (Structure, Vec<usize>) {
        let mut builder = StructureBuilder::spatial()
            .free_flying([9.0; 3])
            .pretension(None);
        let spec = |kind, name: String, pair: &[usize; 2], stiffness| {
            let nodes = pair.map(|node| format!("n{node}"));
            ElementSpec::new(kind, name, nodes, [2.0, 4.0]).stiffness(stiffness)
        };
        for (i, pair) in self.cables.iter().enumerate() {
            let mut cable = spec(
                ElementKind::Cable,
                format!("c{i}"),
                pair,
                self.cable_stiffness,
            );
            cable = cable.rest(0.0..=2.0);
            builder = builder.element(cable);
        }
        for (i, pair) in self.rods.iter().enumerate() {
            let rod = spec(
                ElementKind::Prismatic,
                format!("r{i}"),
                pair,
                self.rod_stiffness,
            );
            builder = builder.element(rod.rest(self.rod_rest_length));
        }
        let mut structure = builder.build().unwrap();
        for element in &mut structure.elements {
            element.length = Interval::new(0.0, 9.0);
            let least = if element.pulls_only() {
                0.0
            } else {
                f64::NEG_INFINITY
            };
            element.force = Interval::new(least, f64::INFINITY);
        }
        let number = |name: &str| name[1..].parse().unwrap();
        let order = structure
            .nodes
            .iter()
            .map(|node| number(&node.name))
            .collect();
        (structure, order)
    }

    fn rest(&self, pose: &Pose) -> Vec<Option<f64>> {
        let cables = pose.rest_lengths.iter().map(|rest| Some(*rest));
        cables.chain(self.rods.iter().map(|_| None)).collect()
    }
}

fn points(nodes: &[[f64; 3]], order: &[usize]) -> Vec<Point3<f64>> {
    order
        .iter()
        .map(|&node| Point3::from(nodes[node]))
        .collect()
}

/// The largest distance between two poses after alignment.
fn distance(found: &[Point3<f64>], stored: &[Point3<f64>]) -> f64 {
    let motion = alignment(found, stored, false);
    let pairs = found.iter().zip(stored);
    pairs
        .map(|(a, b)| (motion * a - b).norm())
        .fold(0.0, f64::max)
}

fn reproduce(robot: &Robot, tolerance: f64) {
    let (structure, order) = robot.structure();
    assert_eq!(order.len(), robot.nodes);
    let start = points(&robot.poses[0].nodes, &order);
    let mut solver = DirectSolver::new(&structure);
    let mut iterations = Vec::new();
    for pose in &robot.poses {
        let form = solver.solve(&start, &robot.rest(pose)).unwrap();
        assert!(form.residual <= 1e-9, "{}", form.residual);
        assert!(form.is_stable() && form.slack.is_empty());
        let off = distance(&form.configuration.positions, &points(&pose.nodes, &order));
        assert!(off < tolerance, "{off}");
        iterations.push(form.iterations);
        // The pose is where it started, as a whole.
        let motion = alignment(&form.configuration.positions, &start, false);
        assert!(motion.translation.vector.norm() < 1e-9 && motion.rotation.angle() < 1e-9);
    }
    iterations.sort_unstable();
    assert!(iterations[iterations.len() / 2] <= 6, "{iterations:?}");
}

#[test]
fn published_poses_of_the_six_bar_are_reproduced() {
    reproduce(&read("six_bar_poses.json"), 2e-5);
}

#[test]
fn published_poses_of_the_prism_are_reproduced() {
    // A softer structure, published with larger residuals.
    reproduce(&read("three_prism_poses.json"), 1e-3);
}

/// Half lengths of rods of the symmetric six-bar, and its positions.
fn symmetric_six_bar(robot: &Robot, order: &[usize]) -> (f64, Vec<Point3<f64>>) {
    let (k, stiff) = (robot.cable_stiffness, robot.rod_stiffness);
    let b = (3.0 * k * 0.25 / 1.5_f64.sqrt() + stiff * 0.5) / (3.0 * k + 2.0 * stiff);
    let a = b / 2.0;
    let nodes = [
        [-a, 0.0, -b],
        [-a, 0.0, b],
        [a, 0.0, -b],
        [a, 0.0, b],
        [0.0, -b, -a],
        [0.0, b, -a],
        [0.0, -b, a],
        [0.0, b, a],
        [-b, -a, 0.0],
        [b, -a, 0.0],
        [-b, a, 0.0],
        [b, a, 0.0],
    ];
    (b, points(&nodes, order))
}

/// Deterministic displacements of about `size`.
fn shaken(positions: &[Point3<f64>], size: f64) -> Vec<Point3<f64>> {
    let mut state = 1_u64;
    let mut next = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        size * ((state >> 33) as f64 / f64::from(1 << 30) - 1.0)
    };
    let shake = |p: &Point3<f64>| p + Vector3::new(next(), next(), next());
    positions.iter().map(shake).collect()
}

#[test]
fn the_symmetric_six_bar_has_its_closed_form() {
    let robot: Robot = read("six_bar_poses.json");
    let (structure, order) = robot.structure();
    let (b, exact) = symmetric_six_bar(&robot, &order);
    assert!((b - 0.244_016_192_856_338_9).abs() < 1e-15);
    let rest = |e: usize| Some(if e < 24 { 0.25 } else { 0.5 });
    let rest: Vec<_> = (0..30).map(rest).collect();
    let mut solver = DirectSolver::new(&structure);
    for start in [shaken(&exact, 0.03), shaken(&exact, 0.1)] {
        let form = solver.solve(&start, &rest).unwrap();
        assert!(distance(&form.configuration.positions, &exact) < 1e-10);
        let forces = &form.configuration.forces;
        assert!((forces[3].unwrap() - 0.488_575_807_373).abs() < 1e-11);
        assert!((forces[27].unwrap() + 1.196_761_428_732).abs() < 1e-11);
        assert!((form.least_stiffness.unwrap() - 4.9958).abs() < 1e-3);
        assert!((form.largest_stiffness - 231.7).abs() < 0.1);
        let stability =
            StiffnessSpectrum::new(&structure, &form.configuration, Actuation::Length).unwrap();
        assert!((form.least_stiffness.unwrap() - stability.least().unwrap()).abs() < 1e-10);
    }
}

#[test]
fn the_shortened_six_bar_flattens_as_measured() {
    // Two parallel rods of rest length 0.35: widths and cables as in the literature.
    let robot: Robot = read("six_bar_poses.json");
    let (structure, order) = robot.structure();
    let (_, exact) = symmetric_six_bar(&robot, &order);
    let mut wide = structure.clone();
    for e in [28, 29] {
        if let ForceLaw::Linear { rest, .. } = &mut wide.elements[e].law {
            *rest = Interval::constant(0.35);
        }
    }
    let mut rest = vec![Some(0.25); 24];
    rest.resize(30, None);
    let form = DirectSolver::new(&wide).solve(&exact, &rest).unwrap();
    let lengths = &form.configuration.lengths;
    assert!((lengths[28] - 0.345_667).abs() < 1e-6, "{}", lengths[28]);
    assert!((form.least_stiffness.unwrap() - 3.311).abs() < 1e-3);
}

fn solve_scaled(force: f64, length: f64) -> (DirectForm, Vec<Point3<f64>>) {
    let robot: Robot = read("six_bar_poses.json");
    let (mut structure, order) = robot.structure();
    for element in &mut structure.elements {
        if let ForceLaw::Linear { stiffness, rest } = &mut element.law {
            *stiffness *= force / length;
            *rest = Interval::new(rest.lo * length, rest.hi * length);
        }
    }
    let pose = &robot.poses[5];
    let start: Vec<_> = points(&robot.poses[0].nodes, &order)
        .into_iter()
        .map(|point| point * length)
        .collect();
    let rest = robot.rest(pose).into_iter().map(|r| r.map(|r| r * length));
    let form = DirectSolver::new(&structure)
        .solve(&start, &rest.collect::<Vec<_>>())
        .unwrap();
    (form, start)
}

#[test]
fn units_and_doubled_stiffnesses_scale_the_result() {
    let (reference, _) = solve_scaled(1.0, 1.0);
    for (force, length) in [(1e-3, 1e3), (2.0, 1.0)] {
        let (found, _) = solve_scaled(force, length);
        let expected: Vec<_> = reference
            .configuration
            .positions
            .iter()
            .map(|point| point * length)
            .collect();
        assert!(distance(&found.configuration.positions, &expected) < 1e-11 * length);
        let stiffness = reference.least_stiffness.unwrap() * force / length;
        assert!((found.least_stiffness.unwrap() / stiffness - 1.0).abs() < 1e-9);
        assert!((found.energy / (reference.energy * force * length) - 1.0).abs() < 1e-9);
    }
}

#[test]
fn rigid_motions_of_the_start_move_the_result() {
    let robot: Robot = read("six_bar_poses.json");
    let (structure, order) = robot.structure();
    let rest = robot.rest(&robot.poses[7]);
    let start = points(&robot.poses[0].nodes, &order);
    let motion = Isometry3::new(Vector3::new(1.0, -2.0, 3.0), Vector3::new(0.5, 1.0, -0.3));
    let moved: Vec<_> = start.iter().map(|point| motion * point).collect();
    let mut solver = DirectSolver::new(&structure);
    let first = solver.solve(&start, &rest).unwrap();
    let second = solver.solve(&moved, &rest).unwrap();
    let pairs = first
        .configuration
        .positions
        .iter()
        .zip(&second.configuration.positions);
    for (a, b) in pairs {
        assert!((motion * a - b).norm() < 1e-11);
    }
}

#[test]
fn relabelling_of_nodes_changes_nothing() {
    let robot: Robot = read("six_bar_poses.json");
    let (structure, order) = robot.structure();
    let rest = robot.rest(&robot.poses[3]);
    let start = points(&robot.poses[0].nodes, &order);
    let form = DirectSolver::new(&structure).solve(&start, &rest).unwrap();
    let n = structure.nodes.len();
    let mut relabelled = structure.clone();
    relabelled.nodes.reverse();
    for element in &mut relabelled.elements {
        element.nodes = element.nodes.map(|node| n - 1 - node);
        element.nodes.reverse();
    }
    let back: Vec<_> = start.iter().rev().copied().collect();
    let again = DirectSolver::new(&relabelled).solve(&back, &rest).unwrap();
    let pairs = form
        .configuration
        .positions
        .iter()
        .rev()
        .zip(&again.configuration.positions);
    for (a, b) in pairs {
        assert!((a - b).norm() < 1e-11);
    }
}

#[test]
fn slack_cables_are_reported_and_pushing_ones_are_an_option() {
    let robot: Robot = read("six_bar_poses.json");
    let (structure, order) = robot.structure();
    let start = points(&robot.poses[0].nodes, &order);
    let mut rest = robot.rest(&robot.poses[0]);
    rest[0] = Some(0.6);
    let form = DirectSolver::new(&structure).solve(&start, &rest).unwrap();
    assert_eq!(form.slack, [0]);
    assert_eq!(form.configuration.forces[0], Some(0.0));
    assert!(form.residual < 1e-9);
    let mut options = DirectOptions::default();
    options.pushing_cables = true;
    let pushing = DirectSolver::with_options(&structure, options)
        .solve(&start, &rest)
        .unwrap();
    assert!(pushing.slack.is_empty() && pushing.configuration.forces[0].unwrap() < 0.0);
}

/// A square of cables with crossed struts of constant length, in the plane.
fn crossed_square(pretension: Option<f64>) -> (Structure, Vec<Point3<f64>>) {
    let mut builder = StructureBuilder::planar()
        .strut("s1", ["a", "c"], 2.0)
        .strut("s2", ["b", "d"], 2.0)
        .pretension(pretension);
    let sides = [["a", "b"], ["b", "c"], ["c", "d"], ["d", "a"]];
    for (i, nodes) in sides.into_iter().enumerate() {
        builder = builder.cable(&format!("c{i}"), nodes, 0.0..=3.0, 10.0, 0.0..=2.0);
    }
    // In the order in which elements name the nodes: a, c, b, d.
    let corners = [[0.0, 0.0], [2.0, 0.0], [1.0, 1.0], [1.0, -1.0]];
    let positions = corners.map(|[x, y]| Point3::new(x, y, 0.0)).to_vec();
    (builder.build().unwrap(), positions)
}

#[test]
fn constant_lengths_are_kept_and_their_forces_found() {
    let (structure, square) = crossed_square(None);
    let start = shaken(&square, 0.2);
    let rest = [None, None, Some(1.2), Some(1.2), Some(1.2), Some(1.2)];
    let form = DirectSolver::new(&structure).solve(&start, &rest).unwrap();
    let configuration = &form.configuration;
    assert!((configuration.lengths[0] - 2.0).abs() < 1e-12);
    assert!(form.residual < 1e-10, "{}", form.residual);
    assert!((configuration.lengths[2] - 2f64.sqrt()).abs() < 1e-11);
    let tension = 10.0 * (2f64.sqrt() - 1.2);
    assert!((configuration.forces[0].unwrap() + 2f64.sqrt() * tension).abs() < 1e-9);
    // The first node is the origin, and stays there.
    assert_eq!(configuration.positions[0], Point3::origin());
    let stability = StiffnessSpectrum::new(&structure, configuration, Actuation::Length).unwrap();
    assert!((form.least_stiffness.unwrap() - stability.least().unwrap()).abs() < 1e-9);
}

#[test]
fn inverse_and_direct_agree() {
    let robot: Robot = read("six_bar_poses.json");
    let (structure, order) = robot.structure();
    let start = points(&robot.poses[0].nodes, &order);
    for pose in robot.poses.iter().skip(1).step_by(7) {
        let rest = robot.rest(pose);
        let form = DirectSolver::new(&structure).solve(&start, &rest).unwrap();
        let options = InverseOptions::default();
        let found = rest_lengths(&structure, &form.configuration.positions, &options).unwrap();
        for (a, b) in found.configuration.rest_lengths.iter().zip(&rest[..24]) {
            assert!((a.unwrap() - b.unwrap()).abs() < 1e-9);
        }
        assert!(found.residual < 1e-9);
        // What is no equilibrium is told by the force that is left over.
        let wry = shaken(&form.configuration.positions, 0.02);
        let error = rest_lengths(&structure, &wry, &options).unwrap_err();
        assert!(
            matches!(error, InverseError::NoBalance { force, .. } if force > 1e-3),
            "{error}"
        );
    }
}

#[test]
fn inverse_does_not_depend_on_place_units_labels_and_strength() {
    let robot: Robot = read("six_bar_poses.json");
    let (structure, order) = robot.structure();
    let start = points(&robot.poses[0].nodes, &order);
    let form = DirectSolver::new(&structure)
        .solve(&start, &robot.rest(&robot.poses[9]))
        .unwrap();
    let positions = form.configuration.positions;
    let forces = |structure: &Structure, positions: &[Point3<f64>]| -> Vec<f64> {
        let found = rest_lengths(structure, positions, &InverseOptions::default()).unwrap();
        found
            .configuration
            .forces
            .iter()
            .map(|force| force.unwrap())
            .collect()
    };
    let reference = forces(&structure, &positions);
    let compare = |found: &[f64], unit: f64, what: &str| {
        for (a, b) in found.iter().zip(&reference) {
            assert!((a / unit - b).abs() < 1e-9, "{what}: {a} is not {b}");
        }
    };

    let motion = Isometry3::new(Vector3::new(1.0, -2.0, 3.0), Vector3::new(0.5, 1.0, -0.3));
    let moved: Vec<_> = positions.iter().map(|point| motion * point).collect();
    compare(&forces(&structure, &moved), 1.0, "moved");

    let last = structure.nodes.len() - 1;
    let mut relabelled = structure.clone();
    relabelled.nodes.reverse();
    for element in &mut relabelled.elements {
        element.nodes = element.nodes.map(|node| last - node);
    }
    let back: Vec<_> = positions.iter().rev().copied().collect();
    compare(&forces(&relabelled, &back), 1.0, "relabelled");

    // Metres to millimetres and newtons to kilonewtons; then twice as stiff.
    for (force, length) in [(1e-3, 1e3), (2.0, 1.0)] {
        let mut scaled = structure.clone();
        for element in &mut scaled.elements {
            let range = element.length;
            element.length = Interval::new(range.lo * length, range.hi * length);
            if let ForceLaw::Linear { stiffness, rest } = &mut element.law {
                *stiffness *= force / length;
                *rest = Interval::new(rest.lo * length, rest.hi * length);
            }
        }
        let large: Vec<_> = positions.iter().map(|point| point * length).collect();
        compare(&forces(&scaled, &large), force, "scaled");
    }
}

#[test]
fn inverse_meets_the_pretension_and_wanted_rest_lengths() {
    let (structure, square) = crossed_square(Some(3.0));
    let found = rest_lengths(&structure, &square, &InverseOptions::default()).unwrap();
    let norm: f64 = found
        .configuration
        .forces
        .iter()
        .flatten()
        .map(|f| f * f)
        .sum();
    assert!((norm.sqrt() - 3.0).abs() < 1e-12);
    assert_eq!(found.choices, 1);
    let (structure, square) = crossed_square(None);
    let mut options = InverseOptions::default();
    options.wanted_rest_lengths = vec![None, None, Some(1.3), Some(1.3), Some(1.3), Some(1.3)];
    let found = rest_lengths(&structure, &square, &options).unwrap();
    // The struts would rather carry nothing: a compromise, and the same for all.
    let rest: Vec<f64> = found
        .configuration
        .rest_lengths
        .iter()
        .flatten()
        .copied()
        .collect();
    assert!(
        rest.iter()
            .all(|r| (r - rest[0]).abs() < 1e-12 && *r > 1.2 && *r < 1.414),
        "{rest:?}"
    );
}

#[test]
fn inverse_says_what_contradicts_what() {
    let (structure, square) = crossed_square(None);
    // Too slack a range: the cables cannot be short enough.
    let mut slack = structure.clone();
    for element in &mut slack.elements[2..] {
        if let ForceLaw::Linear { rest, .. } = &mut element.law {
            *rest = Interval::new(1.6, 2.0);
        }
    }
    let error = rest_lengths(&slack, &square, &InverseOptions::default()).unwrap_err();
    let InverseError::OutOfRange {
        elements,
        violation,
        ..
    } = &error
    else {
        panic!("{error}");
    };
    assert!(
        elements.iter().any(|name| name.starts_with('c')) && *violation > 0.0,
        "{error}"
    );
    // A strut that is not as long as it has to be.
    let mut long = square.clone();
    long[1].x = 2.5;
    let error = rest_lengths(&structure, &long, &InverseOptions::default()).unwrap_err();
    assert!(
        matches!(&error, InverseError::Length { element, .. } if element == "s1"),
        "{error}"
    );
    // A shape without self-stress.
    let turned = [[0.0, 0.0], [2.0, 0.0], [2.5, 1.0], [2.5, -1.0]];
    let turned = turned.map(|[x, y]| Point3::new(x, y, 0.0));
    let mut few = structure.clone();
    few.elements.pop();
    let error = rest_lengths(&few, &turned, &InverseOptions::default()).unwrap_err();
    assert!(
        matches!(error, InverseError::NoSelfStress { .. }),
        "{error}"
    );
}

#[test]
fn loads_are_carried_or_refused() {
    // A weight on two cables from two supports.
    let hanging = |supported: bool| {
        let mut builder = StructureBuilder::planar()
            .cable("left", ["a", "b"], 0.0..=9.0, 100.0, 0.0..=5.0)
            .cable("right", ["b", "c"], 0.0..=9.0, 100.0, 0.0..=5.0)
            .pretension(None)
            .load("b", [0.0, -6.0, 0.0]);
        if supported {
            builder = builder.support("a").support("c");
        }
        builder.build().unwrap()
    };
    let start = [[0.0, 0.0], [1.0, 0.2], [2.0, 0.0]].map(|[x, y]| Point3::new(x, y, 0.0));
    let rest = [Some(1.25), Some(1.25)];
    let structure = hanging(true);
    let form = DirectSolver::new(&structure).solve(&start, &rest).unwrap();
    let length = form.configuration.lengths[0];
    let sine = -form.configuration.positions[1].y / length;
    assert!((2.0 * 100.0 * (length - 1.25) * sine - 6.0).abs() < 1e-9);
    assert!(form.is_stable() && form.residual < 1e-9);
    let error = DirectSolver::new(&hanging(false))
        .solve(&start, &rest)
        .unwrap_err();
    assert!(
        matches!(error, DirectError::UnbalancedLoads { axis: 'y', .. }),
        "{error}"
    );
    // Inverse, with the node level with the supports: no tension carries the weight.
    let level = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]].map(|[x, y]| Point3::new(x, y, 0.0));
    let error = rest_lengths(&structure, &level, &InverseOptions::default()).unwrap_err();
    assert!(error.to_string().contains("the loads"), "{error}");
    let below = [[0.0, 0.0], [1.0, -0.75], [2.0, 0.0]].map(|[x, y]| Point3::new(x, y, 0.0));
    let found = rest_lengths(&structure, &below, &InverseOptions::default()).unwrap();
    assert!((found.configuration.forces[0].unwrap() - 5.0).abs() < 1e-12);
}

#[test]
fn bad_input_is_refused_by_name() {
    let (structure, square) = crossed_square(None);
    let mut solver = DirectSolver::new(&structure);
    let rest = [None, None, Some(1.2), None, Some(1.2), Some(1.2)];
    let error = solver.solve(&square, &rest).unwrap_err();
    assert!(
        matches!(&error, DirectError::MissingRest { element } if element == "c1"),
        "{error}"
    );
    let rest = [None, None, Some(1.2), Some(-1.0), Some(1.2), Some(1.2)];
    let error = solver.solve(&square, &rest).unwrap_err();
    assert!(
        matches!(&error, DirectError::BadRest { element, .. } if element == "c1"),
        "{error}"
    );
    assert!(solver.solve(&square[1..], &rest).is_err());
    let mut bad = square.clone();
    bad[1].y = f64::INFINITY;
    let rest = [None, None, Some(1.2), Some(1.2), Some(1.2), Some(1.2)];
    let error = solver.solve(&bad, &rest).unwrap_err();
    assert!(
        matches!(&error, DirectError::BadStart { node } if node == "c"),
        "{error}"
    );
}

#[test]
fn constant_lengths_that_contradict_one_another_are_named() {
    let structure = StructureBuilder::planar()
        .bar("short", ["a", "b"], 1.0)
        .bar("left", ["b", "c"], 1.0)
        .bar("long", ["c", "a"], 3.0)
        .pretension(None)
        .build()
        .unwrap();
    let start = [[0.0, 0.0], [1.0, 0.0], [1.5, 0.9]].map(|[x, y]| Point3::new(x, y, 0.0));
    let error = DirectSolver::new(&structure)
        .solve(&start, &[None; 3])
        .unwrap_err();
    assert!(
        matches!(error, DirectError::IncompatibleLengths { .. }),
        "{error}"
    );
}

#[test]
fn the_six_bar_needs_every_element_and_the_braced_square_does_not() {
    let (structure, square) = crossed_square(None);
    let rest = [None, None, Some(1.2), Some(1.2), Some(1.2), Some(1.2)];
    let form = DirectSolver::new(&structure).solve(&square, &rest).unwrap();
    let fates = losses(&structure, &form.configuration);
    assert!(
        fates.iter().all(|fate| *fate == Some(Loss::Collapses)),
        "{fates:?}"
    );
    // Two cables side by side: one of them can go.
    let doubled = StructureBuilder::planar()
        .cable("one", ["a", "b"], 0.0..=9.0, 10.0, 0.5)
        .cable("two", ["a", "b"], 0.0..=9.0, 10.0, 0.5)
        .cable("other", ["b", "c"], 0.0..=9.0, 10.0, 0.5)
        .support("a")
        .support("c")
        .pretension(None)
        .build()
        .unwrap();
    let start = [[0.0, 0.0], [1.0, 0.1], [2.0, 0.0]].map(|[x, y]| Point3::new(x, y, 0.0));
    let rest = [Some(0.5); 3];
    let form = DirectSolver::new(&doubled).solve(&start, &rest).unwrap();
    let fates = losses(&doubled, &form.configuration);
    assert!(matches!(fates[0], Some(Loss::Holds { displacement, .. }) if displacement > 0.01));
    assert_eq!(fates[2], Some(Loss::Collapses));
}

/// The edges of a truncated tetrahedron: of its triangles, the others, and struts.
fn truncated_tetrahedron() -> [Vec<[usize; 2]>; 3] {
    let mut corners: Vec<[i32; 3]> = Vec::new();
    for long in 0..3 {
        for signs in 0..8 {
            let sign = |axis: usize| if signs >> axis & 1 == 1 { -1 } else { 1 };
            if sign(0) * sign(1) * sign(2) > 0 {
                let size = |axis: usize| if axis == long { 3 } else { 1 };
                corners.push([0, 1, 2].map(|axis| sign(axis) * size(axis)));
            }
        }
    }
    let signs = |i: usize| corners[i].map(i32::signum);
    let apart = |i: usize, j: usize| -> i32 {
        (0..3)
            .map(|axis| (corners[i][axis] - corners[j][axis]).pow(2))
            .sum()
    };
    let vector = |i: usize| Vector3::from(corners[i].map(f64::from));
    // The next corner of a triangle, counterclockwise seen from outside.
    let next = |i: usize| {
        let normal = Vector3::from(signs(i).map(f64::from));
        (0..12)
            .filter(|&j| j != i && signs(j) == signs(i))
            .find(|&j| vector(i).cross(&vector(j)).dot(&normal) > 0.0)
            .unwrap()
    };
    let partner = |i: usize| {
        (0..12)
            .find(|&j| apart(i, j) == 8 && signs(i) != signs(j))
            .unwrap()
    };
    let mut groups: [Vec<[usize; 2]>; 3] = Default::default();
    for i in 0..12 {
        groups[0].push([i, next(i)]);
        // A step, an edge, and two steps on, which is one back.
        let far = next(next(partner(next(i))));
        for (group, j) in [(1, partner(i)), (2, far)] {
            if i < j {
                groups[group].push([i, j]);
            }
        }
    }
    groups
}

#[derive(Deserialize)]
struct Truncated {
    truncated_tetrahedron: Vec<TruncatedRow>,
}

#[derive(Deserialize)]
struct TruncatedRow {
    edge: f64,
    strut: f64,
}

#[test]
fn truncated_tetrahedra_have_their_force_densities() {
    let groups = truncated_tetrahedron();
    assert_eq!(groups.each_ref().map(Vec::len), [12, 6, 6]);
    let mut builder = StructureBuilder::spatial();
    let mut of = Vec::new();
    for (group, pairs) in groups.iter().enumerate() {
        for (i, pair) in pairs.iter().enumerate() {
            let nodes = pair.map(|node| format!("n{node}"));
            let kind = [
                ElementKind::Cable,
                ElementKind::Cable,
                ElementKind::Prismatic,
            ][group];
            let spec = ElementSpec::new(kind, format!("e{group}.{i}"), nodes, [2.0, 4.0]);
            builder = builder.element(spec.stiffness(10.0).rest(0.0..=9.0));
            of.push(group);
        }
    }
    let structure = builder.build().unwrap();
    let struts: Vec<usize> = (0..of.len()).filter(|&e| of[e] == 2).collect();
    let folder = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../fixtures/statics/closed_forms.toml"
    );
    let data: Truncated = toml::from_str(&std::fs::read_to_string(folder).unwrap()).unwrap();
    for row in data.truncated_tetrahedron {
        let densities = |strut: f64| -> Vec<f64> {
            of.iter()
                .map(|&group| [1.0, row.edge, strut][group])
                .collect()
        };
        let strut = critical_force_density(&structure, &densities(0.0), &struts).unwrap();
        assert!(
            (strut - row.strut).abs() < 1e-10,
            "{strut} for {}",
            row.strut
        );
        let densities = densities(strut);
        let shape = free_standing_shape(&structure, &densities).unwrap();
        let matrix = force_density_matrix(&structure, &densities);
        for axis in 0..3 {
            let column = nalgebra::DVector::from_fn(12, |i, _| shape[i][axis]);
            assert!((&matrix * &column).amax() < 1e-12);
            assert!((column.norm() - 1.0).abs() < 1e-12);
        }
        // Edges of a group are equally long, and the force densities are a self-stress.
        let length = |e: usize| {
            let [a, b] = structure.elements[e].nodes;
            (shape[b] - shape[a]).norm()
        };
        for (e, &group) in of.iter().enumerate() {
            let first = of.iter().position(|&other| other == group).unwrap();
            assert!((length(e) - length(first)).abs() < 1e-10);
        }
        let equilibrium = EquilibriumMatrix::new(&structure, &shape).unwrap();
        let analysis = MatrixAnalysis::new(&equilibrium, &shape);
        assert!(analysis.self_stress.ncols() >= 1);
        let forces = nalgebra::DVector::from_fn(of.len(), |e, _| densities[e] * length(e));
        let outside = &forces - &analysis.self_stress * analysis.self_stress.tr_mul(&forces);
        assert!(outside.norm() < 1e-10 * forces.norm());
    }
    assert!(free_standing_shape(&structure, &vec![1.0; of.len()]).is_err());
}
