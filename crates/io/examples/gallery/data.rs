//! Invented structures and motions that show every kind of element and solid.
//! The forces are made up: nothing here is in equilibrium.

use nalgebra::{Point3, Rotation3, Vector3};
use tensegra_model::{
    Anchor, Appearance, AttachedShape, Attachment, Configuration, Element, ElementKind, ForceLaw,
    Interval, Node, Obstacle, Path, Problem, Role, Shape, Structure,
};

/// A planar structure of three struts and six cables among balls, and its
/// motion.
pub fn kite() -> (Problem, Path) {
    let nodes = ["n1", "n2", "n3", "n4", "n5"];
    let mut elements = vec![
        element("s1", ElementKind::Strut, [0, 1]),
        element("s2", ElementKind::Strut, [2, 3]),
        element("s3", ElementKind::Strut, [3, 4]),
    ];
    for (index, ends) in [[0, 2], [2, 1], [1, 3], [0, 3], [0, 4], [4, 1]]
        .into_iter()
        .enumerate()
    {
        elements.push(element(
            &format!("c{}", index + 1),
            ElementKind::Cable,
            ends,
        ));
    }
    let shape = |s: f64| {
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), 1.1 * s - 0.2);
        let bend = 0.35 * (3.0 * s).sin();
        [
            Vector3::zeros(),
            Vector3::new(0.0, 1.0, 0.0),
            Vector3::new(-0.45 - 0.1 * bend, 0.45 + bend, 0.0),
            Vector3::new(0.42 + 0.08 * s, 0.3 + 0.6 * bend, 0.0),
            Vector3::new(0.6 + 0.05 * bend, 0.62 - 0.5 * bend, 0.0),
        ]
        .map(|place| {
            Point3::from(turn * place + Vector3::new(0.9 * s, 0.15 * (4.0 * s).sin(), 0.0))
        })
        .to_vec()
    };
    let ball = |name: &str, x: f64, y: f64| Obstacle {
        name: name.to_owned(),
        shape: Shape::Sphere {
            center: Point3::new(x, y, 0.0),
            radius: 0.12,
        },
        role: Role::Solid,
        color: None,
    };
    let obstacles = vec![
        ball("o1", -0.75, 0.2),
        ball("o2", 1.45, 1.15),
        ball("o3", 0.45, 1.3),
        ball("o4", 1.5, -0.25),
        ball("o5", 0.35, -0.3),
    ];
    let structure = structure(2, &nodes, elements);
    let path = motion(&structure, 120, shape);
    (problem("kite", structure, obstacles), path)
}

/// A spatial structure of three struts, nine cables, a spring and a telescopic
/// strut, with a platform and a peg on top, among solids of every kind, and its
/// motion.
pub fn prism() -> (Problem, Path) {
    let nodes = ["a1", "a2", "a3", "b1", "b2", "b3"];
    let mut elements = Vec::new();
    for side in 0..3 {
        let next = (side + 1) % 3;
        let name = |kind: &str| format!("{kind}{}", side + 1);
        elements.push(element(
            &name("strut"),
            ElementKind::Strut,
            [side, 3 + side],
        ));
        elements.push(element(&name("base"), ElementKind::Cable, [side, next]));
        elements.push(element(
            &name("top"),
            ElementKind::Cable,
            [3 + side, 3 + next],
        ));
        let kind = if side == 2 {
            ElementKind::Spring
        } else {
            ElementKind::Cable
        };
        elements.push(element(&name("side"), kind, [next, 3 + side]));
    }
    elements.push(element("lift", ElementKind::Prismatic, [1, 5]));
    let shape = |s: f64| {
        let height = 1.15 - 0.25 * s;
        let corner = |level: f64, radius: f64, angle: f64| {
            let (sin, cos) = angle.sin_cos();
            Point3::new(
                radius * cos + 0.15 * level * s,
                radius * sin - 0.1 * level * s,
                level,
            )
        };
        let third = std::f64::consts::TAU / 3.0;
        let twist = 2.6 + 0.5 * s;
        let base = (0..3).map(|side| corner(0.0, 0.6, third * f64::from(side)));
        let top = (0..3).map(|side| corner(height, 0.5, third * f64::from(side) + twist));
        base.chain(top).collect()
    };
    let mut structure = structure(3, &nodes, elements);
    let third = std::f64::consts::TAU / 3.0;
    structure.attachments.push(Attachment {
        name: "platform".to_owned(),
        shapes: vec![
            attached(Shape::Prism {
                corners: [0, 1, 2].map(|side| {
                    let (sin, cos) = (third * f64::from(side)).sin_cos();
                    Point3::new(0.5 * cos, 0.5 * sin, 0.0)
                }),
                height: 0.06,
            }),
            attached(Shape::Cylinder {
                p: Point3::new(0.0, 0.0, 0.06),
                q: Point3::new(0.0, 0.0, 0.35),
                radius: 0.07,
            }),
        ],
        anchors: [0, 1, 2].map(|side| {
            let (sin, cos) = (third * f64::from(side)).sin_cos();
            Anchor {
                local: Point3::new(0.5 * cos, 0.5 * sin, 0.0),
                node: 3 + side as usize,
            }
        }),
    });
    let obstacle = |name: &str, shape: Shape| Obstacle {
        name: name.to_owned(),
        shape,
        role: Role::Solid,
        color: None,
    };
    let obstacles = vec![
        obstacle(
            "floor",
            Shape::HalfSpace {
                point: Point3::new(0.0, 0.0, -0.06),
                normal: Vector3::z(),
            },
        ),
        obstacle(
            "box",
            Shape::Box {
                min: Point3::new(0.75, -0.3, -0.06),
                max: Point3::new(1.15, 0.3, 0.7),
            },
        ),
        obstacle(
            "ball",
            Shape::Sphere {
                center: Point3::new(-0.35, -0.75, 0.25),
                radius: 0.2,
            },
        ),
        obstacle(
            "post",
            Shape::Cylinder {
                p: Point3::new(-0.9, 0.35, -0.06),
                q: Point3::new(-0.9, 0.35, 1.1),
                radius: 0.12,
            },
        ),
        obstacle(
            "wedge",
            Shape::Prism {
                corners: [
                    Point3::new(0.1, 0.85, -0.06),
                    Point3::new(0.6, 0.85, -0.06),
                    Point3::new(0.35, 1.2, -0.06),
                ],
                height: 0.5,
            },
        ),
        obstacle("ring", ring(Point3::new(0.3, 0.0, 1.75), 0.3, 0.06)),
    ];
    let path = motion(&structure, 80, shape);
    (problem("prism", structure, obstacles), path)
}

/// A torus as a mesh of triangles, around the axis z.
fn ring(center: Point3<f64>, radius: f64, thickness: f64) -> Shape {
    const AROUND: usize = 32;
    const ACROSS: usize = 12;
    let angle = |index: usize, count: usize| std::f64::consts::TAU * index as f64 / count as f64;
    let mut vertices = Vec::new();
    let mut faces = Vec::new();
    for i in 0..AROUND {
        for j in 0..ACROSS {
            let (sin, cos) = angle(i, AROUND).sin_cos();
            let (up, out) = angle(j, ACROSS).sin_cos();
            let reach = radius + thickness * out;
            let place = Vector3::new(reach * cos, reach * sin, thickness * up);
            vertices.push(center + place);
            let at = |i: usize, j: usize| i % AROUND * ACROSS + j % ACROSS;
            let corners = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            faces.push(vec![corners[0], corners[1], corners[2]]);
            faces.push(vec![corners[0], corners[2], corners[3]]);
        }
    }
    Shape::Mesh {
        file: "ring.off".to_owned(),
        vertices,
        faces,
    }
}

fn attached(shape: Shape) -> AttachedShape {
    AttachedShape {
        shape,
        role: Role::Solid,
        color: None,
    }
}

fn element(name: &str, kind: ElementKind, nodes: [usize; 2]) -> Element {
    let (law, force, radius) = match kind {
        ElementKind::Strut | ElementKind::Bar => (ForceLaw::Free, Interval::new(-16.0, 0.0), 0.02),
        kind => {
            let law = ForceLaw::Linear {
                stiffness: 10.0,
                rest: Interval::new(0.1, 1.5),
            };
            let radius = if kind == ElementKind::Prismatic {
                0.02
            } else {
                0.003
            };
            (law, Interval::new(0.0, 3.0), radius)
        }
    };
    let length = match kind {
        ElementKind::Strut | ElementKind::Bar => Interval::constant(1.0),
        ElementKind::Prismatic => Interval::new(0.6, 1.6),
        _ => Interval::new(0.2, 2.0),
    };
    Element {
        name: name.to_owned(),
        kind,
        nodes,
        length,
        law,
        force,
        radius,
        appearance: Appearance::default(),
        dynamics: Vec::new(),
    }
}

fn structure(dimension: usize, nodes: &[&str], elements: Vec<Element>) -> Structure {
    Structure {
        dimension,
        nodes: nodes
            .iter()
            .map(|name| Node {
                name: (*name).to_owned(),
                balanced: true,
                load: Vector3::zeros(),
                mass: 0.0,
            })
            .collect(),
        elements,
        couplings: Vec::new(),
        attachments: Vec::new(),
        fixed: Vec::new(),
        base_range: None,
        pretension: None,
    }
}

fn problem(name: &str, structure: Structure, obstacles: Vec<Obstacle>) -> Problem {
    let mut problem = Problem::new(name, structure);
    problem.environment.obstacles = obstacles;
    problem
}

/// Configurations at `count` places of a motion that is given by its shapes.
fn motion(structure: &Structure, count: usize, shape: impl Fn(f64) -> Vec<Point3<f64>>) -> Path {
    let configuration = |index: usize| {
        let s = index as f64 / (count - 1) as f64;
        let positions = shape(s);
        let lengths: Vec<f64> = structure
            .elements
            .iter()
            .map(|element| {
                let [a, b] = element.nodes.map(|node| positions[node]);
                nalgebra::distance(&a, &b)
            })
            .collect();
        let force = |index: usize, element: &Element| {
            let wave = 1.0 + 0.4 * (5.0 * s + 1.7 * index as f64).sin();
            match element.kind {
                ElementKind::Strut | ElementKind::Bar => -1.6 * wave,
                _ => 0.9 * wave,
            }
        };
        let forces: Vec<f64> = structure
            .elements
            .iter()
            .enumerate()
            .map(|(index, element)| force(index, element))
            .collect();
        let rest_lengths = structure.elements.iter().zip(lengths.iter().zip(&forces));
        Configuration {
            rest_lengths: rest_lengths
                .map(|(element, (length, force))| Some(length - force / element.stiffness()?))
                .collect(),
            positions,
            lengths,
            forces: forces.into_iter().map(Some).collect(),
        }
    };
    Path {
        configurations: (0..count).map(configuration).collect(),
    }
}
