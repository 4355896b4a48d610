//! Structures with equilibria in closed form.

use nalgebra::{Point3, Vector3};
use tensegra_model::{
    Anchor, Appearance, AttachedShape, Attachment, Body, Configuration, Element, ElementKind,
    Environment, FixedCoordinate, ForceLaw, Interval, Node, Obstacle, Path, Problem, Role, Shape,
    Structure,
};

pub fn node(name: &str) -> Node {
    Node {
        name: name.to_owned(),
        balanced: true,
        load: Vector3::zeros(),
        mass: 0.0,
    }
}

fn element(
    name: &str,
    kind: ElementKind,
    nodes: [usize; 2],
    length: Interval,
    law: ForceLaw,
    force: Interval,
) -> Element {
    Element {
        name: name.to_owned(),
        kind,
        nodes,
        length,
        law,
        force,
        radius: 0.01,
        appearance: Appearance::default(),
        dynamics: Vec::new(),
    }
}

pub fn strut(name: &str, nodes: [usize; 2], length: f64) -> Element {
    let force = Interval::new(f64::NEG_INFINITY, 0.0);
    element(
        name,
        ElementKind::Strut,
        nodes,
        Interval::constant(length),
        ForceLaw::Free,
        force,
    )
}

/// A strut that carries nothing.
pub fn link(name: &str, nodes: [usize; 2], length: f64) -> Element {
    Element {
        law: ForceLaw::None,
        force: Interval::constant(0.0),
        ..strut(name, nodes, length)
    }
}

pub fn cable(name: &str, nodes: [usize; 2], stiffness: f64) -> Element {
    let law = ForceLaw::Linear {
        stiffness,
        rest: Interval::new(0.0, 3.0),
    };
    let force = Interval::new(0.0, f64::INFINITY);
    element(
        name,
        ElementKind::Cable,
        nodes,
        Interval::new(0.0, 3.0),
        law,
        force,
    )
}

pub fn prismatic(name: &str, nodes: [usize; 2], length: Interval, stiffness: f64) -> Element {
    let law = ForceLaw::Linear {
        stiffness,
        rest: Interval::new(0.0, 3.0),
    };
    let force = Interval::new(f64::NEG_INFINITY, 0.0);
    element(name, ElementKind::Prismatic, nodes, length, law, force)
}

pub fn fixed(node: usize, axis: usize, value: f64) -> FixedCoordinate {
    FixedCoordinate { node, axis, value }
}

pub fn obstacle(name: &str, shape: Shape) -> Obstacle {
    Obstacle {
        name: name.to_owned(),
        shape,
        role: Role::Solid,
        color: None,
    }
}

pub fn ball(name: &str, x: f64, y: f64, radius: f64) -> Obstacle {
    obstacle(
        name,
        Shape::Sphere {
            center: Point3::new(x, y, 0.0),
            radius,
        },
    )
}

/// Pairs of every element with every obstacle.
pub fn all_pairs(structure: &Structure, obstacles: &[Obstacle]) -> Vec<[Body; 2]> {
    let elements = 0..structure.elements.len();
    elements
        .flat_map(|element| {
            (0..obstacles.len()).map(move |o| [Body::Element(element), Body::Obstacle(o)])
        })
        .collect()
}

pub fn problem(structure: Structure, obstacles: Vec<Obstacle>) -> Problem {
    let pairs = all_pairs(&structure, &obstacles);
    let mut problem = Problem::new("test", structure);
    problem.environment = Environment { obstacles, pairs };
    problem
}

/// A configuration from positions and forces: lengths as measured, rest lengths by Hooke's law.
pub fn configuration(
    structure: &Structure,
    positions: Vec<Point3<f64>>,
    forces: Vec<Option<f64>>,
) -> Configuration {
    let lengths: Vec<f64> = structure
        .elements
        .iter()
        .map(|element| (positions[element.nodes[1]] - positions[element.nodes[0]]).norm())
        .collect();
    let rest_lengths = structure
        .elements
        .iter()
        .enumerate()
        .map(|(index, element)| Some(lengths[index] - forces[index]? / element.stiffness()?))
        .collect();
    Configuration {
        positions,
        lengths,
        rest_lengths,
        forces,
    }
}

/// Two crossed struts of length 1 and four cables around them, in the plane. Every rectangle with
/// diagonals of length 1 is in equilibrium when all cables have the force density q and the struts
/// −q; Σ f² = 4 q².
pub fn crossed_struts() -> Structure {
    Structure {
        dimension: 2,
        nodes: ["a", "b", "c", "d"].map(node).to_vec(),
        elements: vec![
            strut("ac", [0, 2], 1.0),
            strut("bd", [1, 3], 1.0),
            cable("ab", [0, 1], 10.0),
            cable("bc", [1, 2], 10.0),
            cable("cd", [2, 3], 10.0),
            cable("da", [3, 0], 10.0),
        ],
        couplings: Vec::new(),
        attachments: Vec::new(),
        fixed: vec![
            fixed(0, 0, 0.0),
            fixed(0, 1, 0.0),
            fixed(0, 2, 0.0),
            fixed(1, 1, 0.0),
        ],
        base_range: None,
        pretension: Some(1.0),
    }
}

/// The rectangle whose diagonal a–c makes `angle` with the x axis, at P = 1.
pub fn rectangle(structure: &Structure, angle: f64) -> Configuration {
    let (height, width) = angle.sin_cos();
    let positions = vec![
        Point3::origin(),
        Point3::new(width, 0.0, 0.0),
        Point3::new(width, height, 0.0),
        Point3::new(0.0, height, 0.0),
    ];
    let forces = [
        -0.5,
        -0.5,
        0.5 * width,
        0.5 * height,
        0.5 * width,
        0.5 * height,
    ];
    configuration(structure, positions, forces.map(Some).to_vec())
}

/// Rectangles from one angle to another, in degrees.
pub fn rectangles(structure: &Structure, from: f64, to: f64, steps: usize) -> Path {
    let angle = |i: usize| (from + (to - from) * i as f64 / steps as f64).to_radians();
    Path {
        configurations: (0..=steps)
            .map(|i| rectangle(structure, angle(i)))
            .collect(),
    }
}

/// The prism of three telescopic struts between two triangles of radius 0.5, the upper one turned
/// by 30° over the lower. Force densities: vertical cables q, struts −q, triangles q / √3.
/// A platform with a peg is glued to the upper triangle.
pub fn prism() -> Structure {
    let mut elements = Vec::new();
    for i in 0..3 {
        let length = Interval::new(0.8, 1.5);
        elements.push(prismatic(
            &format!("s{i}"),
            [i, 3 + (i + 1) % 3],
            length,
            20.0,
        ));
        elements.push(cable(&format!("v{i}"), [i, 3 + i], 5.0));
        elements.push(cable(&format!("lower{i}"), [i, (i + 1) % 3], 5.0));
        elements.push(cable(&format!("upper{i}"), [3 + i, 3 + (i + 1) % 3], 5.0));
    }
    let local = |i: usize| Point3::from(turned(0.0, i));
    let peg = Shape::Cylinder {
        p: Point3::new(0.0, 0.0, 0.02),
        q: Point3::new(0.0, 0.0, 0.3),
        radius: 0.02,
    };
    let slab = Shape::Box {
        min: Point3::new(-0.2, -0.2, 0.0),
        max: Point3::new(0.2, 0.2, 0.02),
    };
    let attached = |shape| AttachedShape {
        shape,
        role: Role::Solid,
        color: None,
    };
    Structure {
        dimension: 3,
        nodes: ["b0", "b1", "b2", "t0", "t1", "t2"].map(node).to_vec(),
        elements,
        couplings: Vec::new(),
        attachments: vec![Attachment {
            name: "platform".to_owned(),
            shapes: vec![attached(peg), attached(slab)],
            anchors: [0, 1, 2].map(|i| Anchor {
                local: local(i),
                node: 3 + i,
            }),
        }],
        fixed: vec![
            fixed(0, 0, 0.5),
            fixed(0, 1, 0.0),
            fixed(0, 2, 0.0),
            fixed(1, 2, 0.0),
            fixed(2, 2, 0.0),
        ],
        base_range: None,
        pretension: Some(1.0),
    }
}

fn turned(offset: f64, i: usize) -> Vector3<f64> {
    let angle = (offset + 120.0 * i as f64).to_radians();
    Vector3::new(0.5 * angle.cos(), 0.5 * angle.sin(), 0.0)
}

/// The equilibrium of the prism with the upper triangle at a height.
pub fn raised(structure: &Structure, height: f64) -> Configuration {
    let up = Vector3::new(0.0, 0.0, height);
    let positions: Vec<Point3<f64>> = (0..3)
        .map(|i| turned(0.0, i))
        .chain((0..3).map(|i| turned(30.0, i) + up))
        .map(Point3::from)
        .collect();
    let density = |element: &Element| match element.name.as_bytes()[0] {
        b's' => -1.0,
        b'v' => 1.0,
        _ => 1.0 / 3f64.sqrt(),
    };
    let mut forces: Vec<f64> = structure
        .elements
        .iter()
        .map(|e| density(e) * (positions[e.nodes[1]] - positions[e.nodes[0]]).norm())
        .collect();
    let norm = forces.iter().map(|force| force * force).sum::<f64>().sqrt();
    forces.iter_mut().for_each(|force| *force /= norm);
    configuration(structure, positions, forces.into_iter().map(Some).collect())
}

pub fn raising(structure: &Structure, from: f64, to: f64, steps: usize) -> Path {
    let height = |i: usize| from + (to - from) * i as f64 / steps as f64;
    Path {
        configurations: (0..=steps).map(|i| raised(structure, height(i))).collect(),
    }
}
