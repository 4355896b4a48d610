//! What must hold for the structures of Porta and Hernández-Juan (2016).

use std::path::PathBuf;

use num_dual::{Dual64, DualNum};
use tensegra_atlas::{Chart, Workspace, dimension, project};

use super::*;
use crate::{Coupling, ForceLaw, Problem, StructureBuilder};

fn problem(name: &str) -> Problem {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures");
    Problem::read(&PathBuf::from(folder).join(name).with_extension("toml")).unwrap()
}

/// A manifold and a point of it, a little away from where its problem starts.
struct Case {
    name: &'static str,
    manifold: DirectionsManifold,
    x: Vec<f64>,
    dimension: usize,
}

impl Case {
    fn new(name: &'static str, dimension: usize) -> Self {
        let problem = problem(name);
        let elements = &problem.structure.elements;
        let start = problem.start.unwrap();
        let lengths = elements.iter().map(|element| {
            let [a, b] = element.nodes.map(|node| start.positions[node]);
            (b - a).norm()
        });
        let manifold = DirectionsManifold::new(&problem.structure).unwrap();
        let mut x = manifold.coordinates(&Configuration {
            lengths: lengths.collect(),
            positions: start.positions,
            rest_lengths: vec![None; elements.len()],
            forces: start.forces,
        });
        let mut residual = vec![0.0; manifold.equation_count()];
        manifold.residual(&x, &mut residual);
        assert!(residual.iter().all(|r| r.abs() < 1e-7), "{name}");
        project(&manifold, &mut x, 1e-13, 20).unwrap();
        for (i, x) in x.iter().enumerate() {
            let (lo, hi) = (manifold.lower[i], manifold.upper[i]);
            let variable = manifold.variable_name(i);
            assert!(
                lo <= *x && *x <= hi,
                "{name}: {variable} is {x}, not in [{lo}, {hi}]"
            );
        }
        let mut work = Workspace::default();
        let chart = Chart::new(&manifold, &x, dimension, &mut work).unwrap();
        let t: Vec<f64> = (1..=dimension).map(|j| 0.01 * (j as f64).sin()).collect();
        chart.exp(&manifold, &t, &mut x, 1e-13, &mut work).unwrap();
        Self {
            name,
            manifold,
            x,
            dimension,
        }
    }
}

fn cases() -> [Case; 6] {
    [
        ("kite", 3),
        ("free_flying", 6),
        ("tower", 15),
        ("prism", 2),
        ("robot", 6),
        ("tower3D", 2),
    ]
    .map(|(name, dimension)| Case::new(name, dimension))
}

#[test]
fn the_systems_have_the_sizes_of_the_paper() {
    for (name, raw, simplified) in [
        ("kite", (38, 48), (26, 26)),
        ("free_flying", (34, 38), (28, 25)),
        ("tower", (132, 144), (106, 94)),
        ("prism", (54, 46), (32, 33)),
        ("robot", (168, 165), (144, 147)),
        ("tower3D", (168, 230), (94, 137)),
    ] {
        let structure = problem(name).structure;
        let counts = DirectionsManifold::new(&structure).unwrap().counts();
        assert_eq!((counts.raw_variables, counts.raw_equations), raw, "{name}");
        assert_eq!((counts.variables, counts.equations), simplified, "{name}");
    }
}

#[test]
fn as_many_equations_are_independent_as_the_paper_says() {
    for (case, independent) in cases().iter().zip([23, 22, 91, 30, 138, 92]) {
        let name = case.name;
        assert_eq!(dimension(&case.manifold, &case.x), case.dimension, "{name}");
        assert_eq!(case.x.len() - case.dimension, independent, "{name}");
    }
}

/// What the paper's equations leave at a point, written down for one element and
/// node after the other, without anything being eliminated.
fn paper_residuals<T: DualNum<Primitive = f64> + Copy>(
    manifold: &DirectionsManifold,
    x: &[T],
) -> Vec<T> {
    let structure = &manifold.structure;
    let value = |i: usize| {
        let Affine { variable, offset } = manifold.values[i];
        variable.map_or(T::from(offset), |(j, scale)| x[j] * scale + offset)
    };
    let vector = |variables: [usize; 3]| variables.map(value);
    let dot = |a: [T; 3], b: [T; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let mut zeros = Vec::new();
    let elements = &manifold.layout.elements;
    let directions: Vec<[T; 3]> = elements.iter().map(|e| vector(e.direction)).collect();
    let lengths: Vec<T> = elements
        .iter()
        .map(|e| match e.length {
            Length::Constant(l) => T::from(l),
            Length::Variable(i) => value(i),
        })
        .collect();
    let rests: Vec<Option<T>> = elements.iter().map(|e| e.rest.map(value)).collect();
    let forces: Vec<Option<T>> = elements.iter().map(|e| e.force.map(value)).collect();
    // Positions along any chain of elements; closure of all loops.
    let mut positions: Vec<Option<[T; 3]>> = vec![None; structure.nodes.len()];
    let mut first = [0, 1, 2].map(|axis| T::from(manifold.origin[axis]));
    for (p, &i) in first.iter_mut().zip(&manifold.layout.base) {
        *p = value(i);
    }
    positions[0] = Some(first);
    while positions.iter().any(Option::is_none) {
        for (e, element) in structure.elements.iter().enumerate() {
            let [a, b] = element.nodes;
            let span = directions[e].map(|u| u * lengths[e]);
            match (positions[a], positions[b]) {
                (Some(p), None) => positions[b] = Some([0, 1, 2].map(|i| p[i] + span[i])),
                (None, Some(p)) => positions[a] = Some([0, 1, 2].map(|i| p[i] - span[i])),
                _ => {}
            }
        }
    }
    let positions: Vec<[T; 3]> = positions.into_iter().flatten().collect();
    for (e, element) in structure.elements.iter().enumerate() {
        let [a, b] = element.nodes;
        zeros.push(dot(directions[e], directions[e]) - 1.0);
        for i in 0..3 {
            zeros.push(positions[b][i] - positions[a][i] - directions[e][i] * lengths[e]);
        }
        if structure.dimension == 2 {
            zeros.push(directions[e][2]);
        }
        if let (ForceLaw::Linear { stiffness, rest }, Some(r), Some(f)) =
            (element.law, rests[e], forces[e])
        {
            zeros.push(f - (lengths[e] - r) * stiffness);
            if rest.is_constant() {
                zeros.push(r - rest.lo);
            }
        }
    }
    for (n, node) in structure
        .nodes
        .iter()
        .enumerate()
        .filter(|(_, n)| n.balanced)
    {
        let mut sum = [0, 1, 2].map(|i| T::from(node.load[i]));
        for (e, element) in structure.elements.iter().enumerate() {
            let sign = f64::from(i8::from(element.nodes[0] == n) - i8::from(element.nodes[1] == n));
            for i in 0..3 {
                sum[i] += forces[e].unwrap_or(T::from(0.0)) * directions[e][i] * sign;
            }
        }
        zeros.extend(sum);
    }
    if let Some(norm) = structure.pretension {
        let squares = forces.iter().flatten().map(|&f| f * f);
        zeros.push(squares.fold(T::from(-norm * norm), |sum, f| sum + f));
    }
    for coupling in &structure.couplings {
        match coupling {
            Coupling::Length {
                reference,
                followers,
            } => {
                let equal = |&(f, scale): &(usize, f64)| lengths[*reference] - lengths[f] * scale;
                zeros.extend(followers.iter().map(equal));
            }
            Coupling::Rest {
                reference,
                followers,
            } => {
                let equal = |&(f, scale): &(usize, f64)| {
                    rests[*reference].unwrap() - rests[f].unwrap() * scale
                };
                zeros.extend(followers.iter().map(equal));
            }
            Coupling::Force {
                reference,
                followers,
            } => {
                let equal = |&(f, scale): &(usize, f64)| {
                    forces[*reference].unwrap() - forces[f].unwrap() * scale
                };
                zeros.extend(followers.iter().map(equal));
            }
            Coupling::Orientation {
                reference,
                followers,
            } => {
                for (f, rotation) in followers {
                    for i in 0..3 {
                        let row = [0, 1, 2].map(|j| T::from(rotation[(i, j)]));
                        zeros.push(directions[*reference][i] - dot(row, directions[*f]));
                    }
                }
            }
        }
    }
    for fixed in &structure.fixed {
        zeros.push(positions[fixed.node][fixed.axis] - fixed.value);
    }
    for (attachment, frame) in structure.attachments.iter().zip(&manifold.layout.frames) {
        let [u, v, w] = frame.axes.map(vector);
        zeros.extend([dot(u, u) - 1.0, dot(v, v) - 1.0, dot(u, v)]);
        for i in 0..3 {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            zeros.push(u[j] * v[k] - u[k] * v[j] - w[i]);
            for anchor in &attachment.anchors {
                let local = anchor.local.coords;
                let p = u[i] * local.x + v[i] * local.y + w[i] * local.z;
                zeros.push(value(frame.origin[i]) + p - positions[anchor.node][i]);
            }
        }
    }
    for &(node, variables) in &manifold.layout.loose_nodes {
        let position = vector(variables);
        zeros.extend((0..3).map(|i| position[i] - positions[node][i]));
    }
    zeros
}

#[test]
fn nothing_is_lost_in_simplification() {
    for Case {
        name,
        manifold,
        x,
        dimension,
    } in cases()
    {
        for zero in paper_residuals(&manifold, &x) {
            assert!(zero.abs() < 1e-9, "{name}: {zero}");
        }
        let chart = Chart::new(&manifold, &x, dimension, &mut Workspace::default()).unwrap();
        for j in 0..dimension {
            let moving: Vec<Dual64> = x
                .iter()
                .zip(chart.tangent(j))
                .map(|(&x, &t)| Dual64::new(x, t))
                .collect();
            for zero in paper_residuals(&manifold, &moving) {
                assert!(zero.eps.abs() < 1e-8, "{name}: {}", zero.eps);
            }
        }
    }
}

#[test]
fn the_jacobian_is_the_derivative_of_the_residual() {
    for Case {
        name, manifold, x, ..
    } in cases()
    {
        let pattern = manifold.jacobian_pattern();
        // Anywhere, not only on the manifold.
        let x: Vec<f64> = (0..x.len()).map(|i| x[i] + (i as f64).cos()).collect();
        let mut values = vec![0.0; pattern.len()];
        manifold.jacobian(&x, &mut values);
        let n = manifold.equation_count();
        let (mut up, mut down) = (vec![0.0; n], vec![0.0; n]);
        let mut dual = vec![Dual64::from(0.0); n];
        for j in 0..x.len() {
            let mut moving: Vec<Dual64> = x.iter().map(|&x| Dual64::from(x)).collect();
            moving[j].eps = 1.0;
            manifold.system.residual(&moving, &mut dual);
            let mut moved = x.clone();
            moved[j] = x[j] + 1e-4;
            manifold.residual(&moved, &mut up);
            moved[j] = x[j] - 1e-4;
            manifold.residual(&moved, &mut down);
            for row in 0..n {
                let value = pattern.find(row, j).map_or(0.0, |slot| values[slot]);
                let scale = value.abs().max(1.0);
                assert!((value - dual[row].eps).abs() < 1e-13 * scale, "{name}");
                let difference = (up[row] - down[row]) / 2e-4;
                assert!((value - difference).abs() < 1e-7 * scale, "{name}");
            }
        }
    }
}

#[test]
fn coordinates_and_configurations_are_inverse_to_each_other() {
    for Case {
        name, manifold, x, ..
    } in cases()
    {
        let configuration = manifold.configuration(&x);
        for (a, b) in manifold.coordinates(&configuration).iter().zip(&x) {
            assert!((a - b).abs() < 1e-9, "{name}");
        }
        let bare = Configuration {
            rest_lengths: vec![None; configuration.rest_lengths.len()],
            ..configuration.clone()
        };
        for (a, b) in manifold.coordinates(&bare).iter().zip(&x) {
            assert!(
                (a - b).abs() < 1e-9,
                "{name}: rest lengths follow from forces"
            );
        }
        for (e, element) in manifold.structure.elements.iter().enumerate() {
            let [a, b] = element.nodes.map(|node| configuration.positions[node]);
            assert!(
                ((b - a).norm() - configuration.lengths[e]).abs() < 1e-9,
                "{name}"
            );
            assert_eq!(configuration.forces[e].is_some(), element.carries_force());
        }
    }
}

#[test]
fn gradients_are_pulled_back_from_positions() {
    for Case {
        name, manifold, x, ..
    } in cases()
    {
        let nodes = manifold.structure.nodes.len();
        let gradients: Vec<(usize, Vector3<f64>)> = (0..nodes)
            .step_by(2)
            .map(|n| (n, Vector3::new(1.0 + n as f64, -2.0, 0.5 * n as f64)))
            .collect();
        let mut row = SparseRow::default();
        manifold.pull_back(&x, &gradients, &mut row);
        let mut positions = vec![Point3::origin(); nodes];
        let mut function = |x: &[f64]| -> f64 {
            manifold.positions(x, &mut positions);
            gradients
                .iter()
                .map(|(n, g)| g.dot(&positions[*n].coords))
                .sum()
        };
        for j in 0..x.len() {
            let mut direction = vec![0.0; x.len()];
            direction[j] = 1.0;
            let mut moved = x.clone();
            moved[j] = x[j] + 1e-4;
            let up = function(&moved);
            moved[j] = x[j] - 1e-4;
            let difference = (up - function(&moved)) / 2e-4;
            assert!((row.dot(&direction) - difference).abs() < 1e-9, "{name}");
        }
    }
}

#[test]
fn the_gradient_of_the_energy_is_its_derivative() {
    for Case {
        name, manifold, x, ..
    } in cases()
    {
        let mut gradient = vec![0.0; x.len()];
        manifold.potential_energy_gradient(&x, &mut gradient);
        for j in 0..x.len() {
            let mut moved = x.clone();
            moved[j] = x[j] + 1e-4;
            let up = manifold.potential_energy(&moved);
            moved[j] = x[j] - 1e-4;
            let difference = (up - manifold.potential_energy(&moved)) / 2e-4;
            assert!((gradient[j] - difference).abs() < 1e-8, "{name}");
        }
    }
}

#[test]
fn a_coupled_range_is_the_intersection_of_the_ranges() {
    // Rest lengths r2 = r1 / 2 and forces f2 = 3 f1.
    let structure = StructureBuilder::planar()
        .strut("s1", ["n1", "n2"], 1.0)
        .strut("s2", ["n3", "n4"], 1.0)
        .cable("c1", ["n1", "n3"], 0.0..=3.0, 1.0, 0.2..=2.0)
        .cable("c2", ["n2", "n3"], 0.0..=3.0, 1.0, 0.0..=0.5)
        .cable("c3", ["n1", "n4"], 0.5..=3.0, 1.0, 0.0..=2.0)
        .cable("c4", ["n2", "n4"], 0.0..=3.0, 1.0, 0.0..=2.0)
        .couple_rest_lengths("c1", &[("c2", 2.0)])
        .couple_forces("c4", &[("c3", 3.0)])
        .free_flying([3.0, 3.0, 0.0])
        .build()
        .unwrap();
    let manifold = DirectionsManifold::new(&structure).unwrap();
    let bounds = |name: &str| {
        let i = manifold.names.iter().position(|n| n == name)?;
        Some((manifold.lower[i], manifold.upper[i]))
    };
    assert_eq!(bounds("rest length of c1"), Some((0.2, 1.0)));
    assert_eq!(bounds("rest length of c2"), None);
    assert_eq!(bounds("force of c3"), Some((0.0, 1.0)));
    assert_eq!(bounds("length of c3"), Some((0.5, 3.0)));
    // At length zero there is no direction.
    assert_eq!(bounds("length of c4"), Some((0.01, 3.0)));
}

#[test]
fn conditions_that_contradict_each_other_are_refused() {
    let pinned = |distance: f64| {
        StructureBuilder::planar()
            .strut("s", ["n1", "n2"], 1.0)
            .fix("n1", [0.0; 3])
            .fix_coordinate("n2", 0, distance)
            .fix_coordinate("n2", 1, 0.0)
            .support("n1")
            .support("n2")
            .build()
            .unwrap()
    };
    assert!(DirectionsManifold::new(&pinned(1.0)).is_ok());
    let error = DirectionsManifold::new(&pinned(0.9)).unwrap_err();
    let EquilibriumError::Contradiction { what, .. } = &error else {
        panic!("{error}");
    };
    assert_eq!(
        what,
        "the equations for the unit length of the direction of s"
    );

    let mut parted = pinned(1.0);
    parted.nodes.push(parted.nodes[0].clone());
    parted.nodes[2].name = "n3".into();
    assert_eq!(
        DirectionsManifold::new(&parted).unwrap_err(),
        EquilibriumError::Disconnected {
            first: "n1".into(),
            node: "n3".into()
        }
    );

    let mut coupled = problem("kite").structure;
    coupled.couplings.push(Coupling::Force {
        reference: 0,
        followers: vec![(2, 1.0)],
    });
    assert_eq!(
        DirectionsManifold::new(&coupled).unwrap_err(),
        EquilibriumError::NothingToCouple {
            element: "s3".into(),
            quantity: "force"
        }
    );

    let mut tied = problem("kite").structure;
    tied.elements[4].force = Interval::new(40.0, 48.0);
    tied.elements[5].force = Interval::new(0.0, 2.0);
    tied.couplings.push(Coupling::Force {
        reference: 4,
        followers: vec![(5, 1.0)],
    });
    assert_eq!(
        DirectionsManifold::new(&tied).unwrap_err(),
        EquilibriumError::NoAdmissibleValue {
            quantity: "force of c2".into(),
            least: 40.0,
            most: 2.0
        }
    );
}

#[test]
fn a_variable_held_outside_of_its_range_is_refused() {
    let mut structure = problem("free_flying").structure;
    let cable = &mut structure.elements[2];
    cable.force = Interval::constant(0.3);
    cable.law = ForceLaw::Linear {
        stiffness: 1.0,
        rest: Interval::constant(0.2),
    };
    cable.length = Interval::new(0.1, 0.4);
    let error = DirectionsManifold::new(&structure).unwrap_err();
    assert_eq!(
        error.to_string(),
        "the length of c1 can only be 0.5, outside of its range [0.1, 0.4]"
    );
}
