//! Structures of Porta and Hernández-Juan (2016), and what must hold for them.

use nalgebra::Rotation3;
use num_dual::{Dual64, DualNum};
use tensegra_atlas::{Chart, Workspace, dimension, project};

use super::*;
use crate::{
    AttachedShape, Coupling, ElementKind, ElementSpec, ForceLaw, Role, Shape, StructureBuilder,
};

fn kite() -> Structure {
    let mut builder = StructureBuilder::planar()
        .pretension(4.0)
        .element(ElementSpec::new(ElementKind::Strut, "s1", ["n1", "n2"], 1.0).force(-16.0..=0.0))
        .element(ElementSpec::new(ElementKind::Strut, "s2", ["n3", "n4"], 1.0).force(-16.0..=0.0))
        .element(ElementSpec::new(ElementKind::Strut, "s3", ["n4", "n5"], 0.25).force(0.0));
    for (name, nodes) in [
        ("c1", ["n1", "n3"]),
        ("c2", ["n2", "n3"]),
        ("c3", ["n1", "n4"]),
        ("c4", ["n2", "n4"]),
    ] {
        builder = builder.cable(name, nodes, 0.0..=3.0, 16.0, 0.0..=2.0);
    }
    builder
        .fix("n1", [0.0; 3])
        .fix_coordinate("n2", 0, 1.0)
        .fix_coordinate("n2", 1, 0.0)
        .couple_orientations("s2", &[("s3", Rotation3::identity())])
        .build()
        .unwrap()
}

fn free_flying() -> Structure {
    let mut builder = StructureBuilder::planar()
        .free_flying([3.0, 3.0, 0.0])
        .strut("s1", ["n1", "n2"], 1.0)
        .strut("s2", ["n3", "n4"], 1.0);
    for (name, nodes) in [
        ("c1", ["n1", "n3"]),
        ("c2", ["n2", "n3"]),
        ("c3", ["n1", "n4"]),
        ("c4", ["n2", "n4"]),
    ] {
        builder = builder.cable(name, nodes, 0.0..=3.0, 1.0, 0.0..=2.0);
    }
    builder.build().unwrap()
}

fn tower() -> Structure {
    let mut builder = StructureBuilder::planar();
    let strut = 0.3125_f64.sqrt();
    for (name, a, b) in [
        ("s1", "n1", "n4"),
        ("s2", "n2", "n3"),
        ("s3", "n5", "n8"),
        ("s4", "n6", "n7"),
        ("s5", "n9", "n12"),
        ("s6", "n10", "n11"),
    ] {
        builder = builder.strut(name, [a, b], strut);
    }
    builder = builder
        .cable("c1", ["n1", "n2"], 0.0..=1.0, 2.0, 0.0..=0.88)
        .spring("c2", ["n11", "n12"], 0.0..=1.0, 0.397_576_169_574_137, 0.1);
    for (name, a, b, longest, stiffness) in [
        ("c3", "n1", "n6", 1.7, 1.0),
        ("c4", "n2", "n5", 1.7, 1.0),
        ("c5", "n7", "n12", 1.7, 1.0),
        ("c6", "n8", "n11", 1.7, 1.0),
        ("c7", "n3", "n10", 1.3, 5.0),
        ("c8", "n4", "n9", 1.3, 5.0),
        ("c9", "n1", "n5", 1.4, 5.0),
        ("c10", "n2", "n6", 1.4, 5.0),
        ("c11", "n5", "n3", 0.6, 10.0),
        ("c12", "n6", "n4", 0.6, 10.0),
        ("c13", "n3", "n9", 0.8, 1.0),
        ("c14", "n4", "n10", 0.8, 1.0),
        ("c15", "n9", "n7", 0.6, 10.0),
        ("c16", "n10", "n8", 0.6, 10.0),
        ("c17", "n7", "n11", 1.4, 5.0),
        ("c18", "n8", "n12", 1.4, 5.0),
    ] {
        builder = builder.cable(name, [a, b], 0.0..=longest, stiffness, 0.0..=longest);
    }
    builder
        .fix("n1", [0.0; 3])
        .fix_coordinate("n2", 0, 0.0)
        .fix_coordinate("n2", 1, 0.25)
        .build()
        .unwrap()
}

fn prism() -> Structure {
    let (side, k1, k2) = (
        0.896_575_472_168_053,
        0.175_494_628_703_572,
        0.303_965_613_370_022,
    );
    let mut builder = StructureBuilder::spatial();
    for (name, a, b) in [("s1", "n1", "n2"), ("s2", "n3", "n4"), ("s3", "n5", "n6")] {
        builder = builder.prismatic(name, [a, b], 0.99..=1.83, -k2, 0.0);
    }
    for (name, a, b) in [("c1", "n2", "n4"), ("c2", "n4", "n6"), ("c3", "n2", "n6")] {
        builder = builder.spring(name, [a, b], 0.01..=1.79, k1, 0.0);
    }
    for (name, a, b) in [("c4", "n1", "n6"), ("c5", "n2", "n3"), ("c6", "n4", "n5")] {
        builder = builder.spring(name, [a, b], 0.01..=3.1, k2, 0.0);
    }
    let height = side * 0.75_f64.sqrt();
    builder
        .fix("n1", [0.0; 3])
        .fix("n3", [side, 0.0, 0.0])
        .fix("n5", [0.5 * side, height, 0.0])
        .support("n1")
        .support("n3")
        .support("n5")
        .build()
        .unwrap()
}

/// Two stages of three struts each. `symmetric` couples all that a third of a
/// turn maps onto each other, and has cables in the place of the springs.
fn two_stages(symmetric: bool) -> Structure {
    let mut builder = StructureBuilder::spatial();
    for i in 0..6 {
        let [a, b] = [2 * i + 1, 2 * i + 2].map(|n| format!("n{n}"));
        builder = builder.strut(&format!("s{}", i + 1), [&a, &b], 0.4);
    }
    let diagonal = ["c1", "c3", "c5", "c14", "c16", "c18"];
    let vertical = ["c2", "c4", "c6", "c13", "c15", "c17"];
    let saddle = ["c7", "c8", "c9", "c10", "c11", "c12"];
    for (i, [a, b]) in [
        [1, 11],
        [1, 6],
        [3, 7],
        [3, 2],
        [5, 9],
        [5, 4],
        [7, 4],
        [7, 2],
        [9, 6],
        [9, 4],
        [11, 2],
        [11, 6],
        [11, 8],
        [2, 8],
        [7, 10],
        [4, 10],
        [9, 12],
        [6, 12],
    ]
    .into_iter()
    .enumerate()
    {
        let name = format!("c{}", i + 1);
        let [a, b] = [a, b].map(|n| format!("n{n}"));
        let nodes = [a.as_str(), b.as_str()];
        builder = if !vertical.contains(&name.as_str()) {
            builder.cable(&name, nodes, 0.0..=0.5, 243.722_018_707_8, 0.0..=0.5)
        } else if symmetric {
            builder.cable(&name, nodes, 0.0..=0.7, 27.08, 0.0..=0.7)
        } else {
            builder.spring(
                &name,
                nodes,
                0.03..=0.7,
                0.240_713_104_896_6,
                0.176_705_970_470_7,
            )
        };
    }
    let triangles = ["c19", "c20", "c21", "c22", "c23", "c24"];
    for (name, [a, b]) in triangles.into_iter().zip([
        ["n1", "n3"],
        ["n1", "n5"],
        ["n3", "n5"],
        ["n8", "n10"],
        ["n8", "n12"],
        ["n10", "n12"],
    ]) {
        builder = builder.inextensible_cable(name, [a, b], 0.27);
    }
    let plate = AttachedShape {
        shape: Shape::Sphere {
            center: Point3::origin(),
            radius: 0.01,
        },
        role: Role::Decoration,
        color: None,
    };
    let corner = [0.135, -0.27 * 0.75_f64.sqrt(), 0.0];
    builder = builder
        .fix("n1", [0.0; 3])
        .fix_coordinate("n3", 2, 0.0)
        .fix_coordinate("n5", 1, 0.0)
        .fix_coordinate("n5", 2, 0.0)
        .attach(
            "platform",
            vec![plate],
            [([0.0; 3], "n8"), ([0.27, 0.0, 0.0], "n10"), (corner, "n12")],
        );
    fn rest<'a>(family: &[&'a str]) -> Vec<(&'a str, f64)> {
        family[1..].iter().map(|&name| (name, 1.0)).collect()
    }
    builder = builder.couple_forces("c19", &rest(&triangles));
    if symmetric {
        let third = |n: f64| {
            let turn = n * std::f64::consts::TAU / 3.0;
            Rotation3::from_axis_angle(&Vector3::z_axis(), turn)
        };
        builder = builder
            .couple_orientations(
                "s1",
                &[("s2", third(1.0)), ("s3", third(2.0)), ("s5", third(0.0))],
            )
            .couple_orientations("s3", &[("s4", third(0.0))])
            .couple_orientations("s2", &[("s6", third(0.0))])
            .couple_forces("s1", &rest(&["s1", "s2", "s3", "s4", "s5", "s6"]));
        for family in [diagonal, vertical, saddle] {
            builder = builder
                .couple_lengths(family[0], &rest(&family))
                .couple_rest_lengths(family[0], &rest(&family))
                .couple_forces(family[0], &rest(&family));
        }
    }
    builder.build().unwrap()
}

#[test]
fn the_systems_have_the_sizes_of_the_paper() {
    for (name, structure, raw, simplified) in [
        ("kite", kite(), (38, 48), (26, 26)),
        ("free_flying", free_flying(), (34, 38), (28, 25)),
        ("tower", tower(), (132, 144), (106, 94)),
        ("prism", prism(), (54, 46), (32, 33)),
        ("robot", two_stages(false), (168, 165), (144, 147)),
        ("tower3D", two_stages(true), (168, 230), (94, 137)),
    ] {
        let counts = DirectionsManifold::new(&structure).unwrap().counts();
        assert_eq!((counts.raw_variables, counts.raw_equations), raw, "{name}");
        assert_eq!((counts.variables, counts.equations), simplified, "{name}");
    }
}

/// A structure with node positions and forces in equilibrium to six digits.
struct Case {
    name: &'static str,
    manifold: DirectionsManifold,
    /// A point of the manifold away from all symmetry.
    x: Vec<f64>,
    dimension: usize,
}

impl Case {
    fn new(
        name: &'static str,
        structure: &Structure,
        dimension: usize,
        positions: &[(&str, [f64; 3])],
        force: impl Fn(&str) -> f64,
    ) -> Self {
        let manifold = DirectionsManifold::new(structure).unwrap();
        let configuration = configuration(structure, positions, force);
        let mut x = manifold.coordinates(&configuration);
        let mut residual = vec![0.0; manifold.equation_count()];
        manifold.residual(&x, &mut residual);
        assert!(residual.iter().all(|r| r.abs() < 1e-4), "{name}");
        project(&manifold, &mut x, 1e-13, 20).unwrap();
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

fn configuration(
    structure: &Structure,
    positions: &[(&str, [f64; 3])],
    force: impl Fn(&str) -> f64,
) -> Configuration {
    let mut points = vec![Point3::origin(); structure.nodes.len()];
    for &(name, position) in positions {
        points[structure.node_index(name).unwrap()] = position.into();
    }
    Configuration {
        lengths: structure
            .elements
            .iter()
            .map(|e| (points[e.nodes[1]] - points[e.nodes[0]]).norm())
            .collect(),
        rest_lengths: structure
            .elements
            .iter()
            .map(|e| e.rest().filter(Interval::is_constant).map(|r| r.lo))
            .collect(),
        forces: structure
            .elements
            .iter()
            .map(|e| e.carries_force().then(|| force(&e.name)))
            .collect(),
        positions: points,
    }
}

fn cases() -> Vec<Case> {
    let (side, tension) = (0.5_f64.sqrt(), 0.125_f64.sqrt());
    let flying = [
        ("n1", [0.3, -0.2, 0.0]),
        ("n2", [0.3 + side, -0.2 + side, 0.0]),
        ("n3", [0.3 + side, -0.2, 0.0]),
        ("n4", [0.3, -0.2 + side, 0.0]),
    ];
    let crossed = [
        ("n1", [0.0, 0.0, 0.0]),
        ("n2", [1.0, 0.0, 0.0]),
        ("n3", [0.287_193, -0.076_844, 0.0]),
        ("n4", [-0.101_994, 0.844_315, 0.0]),
        ("n5", [-0.199_291, 1.074_605, 0.0]),
    ];
    let ladder: Vec<(String, [f64; 3])> = [0.0, 0.5, 0.35, 0.85, 0.7, 1.2]
        .into_iter()
        .zip([[1, 2], [3, 4], [5, 6], [7, 8], [9, 10], [11, 12]])
        .flat_map(|(x, [a, b])| {
            [
                (format!("n{a}"), [x, 0.0, 0.0]),
                (format!("n{b}"), [x, 0.25, 0.0]),
            ]
        })
        .collect();
    let ladder: Vec<(&str, [f64; 3])> = ladder.iter().map(|(n, p)| (n.as_str(), *p)).collect();
    let turned = [
        ("n1", [0.0, 0.0, 0.0]),
        ("n3", [0.896_575, 0.0, 0.0]),
        ("n5", [0.448_288, 0.776_457, 0.0]),
        ("n2", [1.181_461, -0.114_331, 0.973_796]),
        ("n4", [0.405_004, 0.333_956, 0.973_796]),
        ("n6", [0.405_004, -0.562_619, 0.973_796]),
    ];
    let (prism_structure, stiffness) = (prism(), [-0.303_965_6, 0.175_494_6, 0.303_965_6]);
    let lengths = configuration(&prism_structure, &turned, |_| 0.0).lengths;
    let prism_force = |name: &str| {
        let e = prism_structure.element_index(name).unwrap();
        stiffness[e / 3] * lengths[e]
    };
    let (b, h) = (0.27, 0.4 * 0.75_f64.sqrt());
    let (row, top) = (b * 0.75_f64.sqrt(), 1.5 * h);
    let center = row * 2.0 / 3.0;
    let stages = [
        ("n1", [0.0, 0.0, 0.0]),
        ("n3", [0.5 * b, row, 0.0]),
        ("n5", [b, 0.0, 0.0]),
        ("n2", [0.1, 0.5 * h, h]),
        ("n4", [0.5 * b + 0.1, row - 0.5 * h, h]),
        ("n6", [b - 0.2, 0.0, h]),
        ("n8", [0.0, center, top]),
        ("n10", [b, center, top]),
        ("n12", [0.5 * b, center - row, top]),
        ("n7", [0.2, center, top - h]),
        ("n9", [b - 0.1, center - 0.5 * h, top - h]),
        ("n11", [0.5 * b - 0.1, center - row + 0.5 * h, top - h]),
    ];
    let stage_force = |name: &str| match name {
        "c2" | "c4" | "c6" | "c13" | "c15" | "c17" => 0.042_535_4,
        "c19" | "c20" | "c21" | "c22" | "c23" | "c24" => 0.013_239_2,
        name if name.starts_with('s') => -0.264_784_4,
        _ => 0.217_452_7,
    };
    vec![
        Case::new("kite", &kite(), 3, &crossed, |name| match name {
            "s1" => -2.241_059,
            "s2" => -0.902_625,
            "c1" => 2.397_384,
            "c2" => 1.976_009,
            "c3" => 0.624_170,
            _ => 0.348_242,
        }),
        Case::new("free_flying", &free_flying(), 6, &flying, |name| {
            if name.starts_with('s') { -0.5 } else { tension }
        }),
        Case::new("tower", &tower(), 15, &ladder, |name| match name {
            "s1" | "s2" | "s5" | "s6" => -0.263_906_6,
            "s3" | "s4" => -0.130_555_5,
            "c1" | "c2" => 0.059_636_4,
            "c3" | "c4" | "c5" | "c6" => 0.100_451_4,
            "c7" | "c8" => 0.151_142_7,
            "c9" | "c10" | "c17" | "c18" => 0.154_304_6,
            "c13" | "c14" => 0.022_354_3,
            _ => 0.352_817_7,
        }),
        Case::new("prism", &prism_structure, 2, &turned, prism_force),
        Case::new("robot", &two_stages(false), 6, &stages, stage_force),
        Case::new("tower3D", &two_stages(true), 2, &stages, stage_force),
    ]
}

#[test]
fn as_many_equations_are_independent_as_the_paper_says() {
    for (case, independent) in cases().iter().zip([23, 22, 91, 30, 138, 92]) {
        let name = case.name;
        assert_eq!(dimension(&case.manifold, &case.x), case.dimension, "{name}");
        assert_eq!(case.x.len() - case.dimension, independent, "{name}");
        let bounds = case
            .manifold
            .lower_bounds()
            .iter()
            .zip(case.manifold.upper_bounds());
        for (i, (x, (lo, hi))) in case.x.iter().zip(bounds).enumerate() {
            let variable = case.manifold.variable_name(i);
            assert!(
                lo <= x && x <= hi,
                "{name}: {variable} is {x}, not in [{lo}, {hi}]"
            );
        }
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

    let mut coupled = kite();
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

    let mut tied = kite();
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
    let mut structure = free_flying();
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
