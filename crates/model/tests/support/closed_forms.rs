//! The structures of fixtures/statics/closed_forms.toml, with their positions.
#![allow(dead_code)] // Each test file uses a part.

use std::{f64::consts::TAU, path::PathBuf};

use nalgebra::{Point3, Rotation2, Vector2, Vector3};
use serde::Deserialize;
use tensegra_model::{
    Configuration, ElementKind, ElementSpec, Structure, StructureBuilder,
    statics::{EquilibriumMatrix, MatrixAnalysis},
};

/// What a closed form says.
#[derive(Deserialize)]
pub struct Expected {
    pub rank: usize,
    pub self_stress_states: usize,
    pub mechanisms: usize,
    pub densities: Vec<f64>,
    pub eigenvalues: Vec<f64>,
    pub stiffened: Vec<f64>,
}

#[derive(Deserialize)]
pub struct Prism {
    pub sides: usize,
    #[serde(flatten)]
    pub expected: Expected,
}

#[derive(Deserialize)]
pub struct Octahedron {
    pub nodes: Vec<[f64; 3]>,
    pub struts: Vec<[usize; 2]>,
    pub cables: Vec<[usize; 2]>,
    pub cable_over_strut: f64,
    #[serde(flatten)]
    pub expected: Expected,
}

#[derive(Deserialize)]
pub struct ClosedForms {
    pub prism: Vec<Prism>,
    pub octahedron: Octahedron,
    pub hexagon: Expected,
    pub square: Expected,
    pub two_layer_prism: TwoLayerPrism,
    pub tower: Tower,
}

#[derive(Deserialize)]
pub struct TwoLayerPrism {
    pub radius: f64,
    pub layer: f64,
    pub self_stress_states: usize,
    pub mechanisms: usize,
    pub densities: Vec<f64>,
}

#[derive(Deserialize)]
pub struct Tower {
    pub side: f64,
    pub bar: f64,
    pub self_stress_states: usize,
    pub mechanisms: usize,
    pub shapes: Vec<TowerShape>,
}

#[derive(Deserialize)]
pub struct TowerShape {
    pub azimuth: f64,
    pub declination: f64,
    pub overlap: f64,
    pub height: f64,
    pub densities: Vec<f64>,
}

pub fn closed_forms() -> ClosedForms {
    let file = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../fixtures/statics/closed_forms.toml"
    );
    toml::from_str(&std::fs::read_to_string(PathBuf::from(file)).unwrap()).unwrap()
}

/// A structure with positions, and the group of each element.
#[derive(Clone)]
pub struct Case {
    pub structure: Structure,
    pub positions: Vec<Point3<f64>>,
    pub groups: Vec<usize>,
}

pub const STIFFNESS: [f64; 5] = [100.0, 10.0, 20.0, 15.0, 100.0];

/// Elements of one kind and force density.
pub type Group = (ElementKind, Vec<[usize; 2]>);

/// Elements by group. Supports are by node.
pub fn case(dimension: usize, points: &[[f64; 3]], groups: &[Group], supports: &[usize]) -> Case {
    let mut builder = match dimension {
        2 => StructureBuilder::planar(),
        _ => StructureBuilder::spatial(),
    };
    let mut order: Vec<usize> = Vec::new();
    let mut of = Vec::new();
    for (group, (kind, pairs)) in groups.iter().enumerate() {
        for (i, pair) in pairs.iter().enumerate() {
            let nodes = pair.map(|node| format!("n{node}"));
            let spec = ElementSpec::new(*kind, format!("e{group}.{i}"), nodes, [5.0, 9.0])
                .stiffness(STIFFNESS[group])
                .rest(0.0..=9.0);
            builder = builder.element(spec);
            of.push(group);
            for node in pair {
                if !order.contains(node) {
                    order.push(*node);
                }
            }
        }
    }
    for node in supports {
        builder = builder.support(&format!("n{node}"));
    }
    let mut structure = builder.build().unwrap();
    if !supports.is_empty() {
        // Supports stay where the positions put them: no gauge is needed.
        structure.fixed.clear();
    }
    Case {
        structure,
        positions: order
            .iter()
            .map(|&node| Point3::from(points[node]))
            .collect(),
        groups: of,
    }
}

impl Case {
    /// The configuration with the self-stress in which the first element has this
    /// force density.
    pub fn prestressed(&self, first: f64) -> Configuration {
        let matrix = EquilibriumMatrix::new(&self.structure, &self.positions).unwrap();
        let analysis = MatrixAnalysis::new(&matrix, &self.positions);
        assert_eq!(analysis.self_stress.ncols(), 1);
        let stress = analysis.self_stress.column(0);
        let scale = first * self.lengths()[0] / stress[0];
        self.under(stress.iter().map(|force| scale * force).collect())
    }

    /// The configuration with a force density for each group.
    pub fn stressed(&self, densities: &[f64]) -> Configuration {
        let pairs = self.groups.iter().zip(self.lengths());
        self.under(pairs.map(|(&g, length)| densities[g] * length).collect())
    }

    /// The configuration under forces.
    fn under(&self, forces: Vec<f64>) -> Configuration {
        let lengths = self.lengths();
        let rest = forces
            .iter()
            .zip(&lengths)
            .zip(&self.structure.elements)
            .map(|((force, length), element)| Some(length - force / element.stiffness().unwrap()));
        Configuration {
            positions: self.positions.clone(),
            rest_lengths: rest.collect(),
            forces: forces.iter().map(|force| Some(*force)).collect(),
            lengths,
        }
    }

    fn lengths(&self) -> Vec<f64> {
        let length = |[a, b]: [usize; 2]| (self.positions[b] - self.positions[a]).norm();
        let elements = self.structure.elements.iter();
        elements.map(|element| length(element.nodes)).collect()
    }
}

fn rods(pairs: impl IntoIterator<Item = [usize; 2]>) -> Group {
    (ElementKind::Prismatic, pairs.into_iter().collect())
}

fn cables(pairs: impl IntoIterator<Item = [usize; 2]>) -> Group {
    (ElementKind::Cable, pairs.into_iter().collect())
}

pub fn ring(n: usize, at: usize) -> Vec<[usize; 2]> {
    (0..n).map(|i| [at + i, at + (i + 1) % n]).collect()
}

/// The regular prism with n struts.
pub fn prism(n: usize) -> Case {
    let twist = TAU / 4.0 - TAU / 2.0 / n as f64;
    let point = |i: usize, turn: f64, z: f64| {
        let angle = TAU * i as f64 / n as f64 + turn;
        [angle.cos(), angle.sin(), z]
    };
    let lower = (0..n).map(|i| point(i, 0.0, 0.0));
    let upper = (0..n).map(|i| point(i, -twist, 1.0));
    let points: Vec<[f64; 3]> = lower.chain(upper).collect();
    let struts = rods((0..n).map(|i| [i, n + (i + n - 1) % n]));
    let vertical = cables((0..n).map(|i| [i, n + i]));
    let polygons = cables([ring(n, 0), ring(n, n)].concat());
    case(3, &points, &[struts, polygons, vertical], &[])
}

pub fn octahedron(data: &Octahedron) -> Case {
    let groups = [rods(data.struts.clone()), cables(data.cables.clone())];
    case(3, &data.nodes, &groups, &[])
}

pub fn polygon(n: usize) -> Case {
    let points: Vec<[f64; 3]> = (0..n)
        .map(|i| TAU * i as f64 / n as f64)
        .map(|angle| [angle.cos(), angle.sin(), 0.0])
        .collect();
    let struts = (0..n / 2).map(|i| [i, i + n / 2]);
    case(2, &points, &[rods(struts), cables(ring(n, 0))], &[])
}

/// Two prisms of three struts each, the lower one on three supports; groups are struts,
/// vertical cables, the ring between the layers and the ring on top.
pub fn two_layer_prism(data: &TwoLayerPrism) -> Case {
    let point = |layer: usize, i: usize| {
        let angle = TAU * (i as f64 / 3.0 - layer as f64 / 12.0);
        let z = data.layer * layer as f64;
        [data.radius * angle.cos(), data.radius * angle.sin(), z]
    };
    let points: Vec<[f64; 3]> = (0..9).map(|node| point(node / 3, node % 3)).collect();
    let up = |turn: usize| (0..6).map(move |node| [node, node / 3 * 3 + 3 + (node + turn) % 3]);
    let groups = [
        rods(up(2)),
        cables(up(0)),
        cables(ring(3, 3)),
        cables(ring(3, 6)),
    ];
    case(3, &points, &groups, &[0, 1, 2])
}

/// The tower of two stages of three bars each: A are the supports, B the upper ends of the
/// lower bars, C the lower ends of the upper ones, D the rigid triangle on top. Groups are
/// bars, saddle cables, vertical cables, diagonal cables and the triangle.
pub fn tower(data: &Tower, shape: &TowerShape) -> Case {
    let (azimuth, declination) = (shape.azimuth.to_radians(), shape.declination.to_radians());
    let overlap = tower_overlap(data, shape);
    let height = 2.0 * data.bar * declination.cos() - overlap;
    let base = |i: usize| {
        let angle = TAU * (i % 3) as f64 / 3.0;
        Vector2::new(angle.cos(), angle.sin()) * data.side / 3.0_f64.sqrt()
    };
    let mut lower: Vec<Vector3<f64>> = (0..3).map(|i| base(i).push(0.0)).collect();
    for i in 0..3 {
        let along = Rotation2::new(azimuth) * (base(i + 1) - base(i)).normalize();
        let bar = (along * declination.sin()).push(declination.cos()) * data.bar;
        lower.push(lower[i] + bar);
    }
    // The upper half is the inversion of the lower one in the middle of the axis.
    let top = Vector3::new(0.0, 0.0, height);
    let upper = [3, 4, 5, 0, 1, 2].map(|node| top - lower[node]);
    let points: Vec<[f64; 3]> = lower.into_iter().chain(upper).map(Into::into).collect();
    let [a, b, c, d] = [0, 3, 6, 9].map(|first| move |i: usize| first + i % 3);
    let groups = [
        rods((0..3).flat_map(|i| [[a(i), b(i)], [d(i), c(i)]])),
        cables((0..3).flat_map(|i| [[b(i), c(i + 1)], [b(i), c(i + 2)]])),
        cables((0..3).flat_map(|i| [[a(i), b(i + 1)], [d(i), c(i + 1)]])),
        cables((0..3).flat_map(|i| [[a(i), c(i + 2)], [d(i), b(i + 2)]])),
        rods(ring(3, 9)),
    ];
    case(3, &points, &groups, &[0, 1, 2])
}

/// How far the stages of the tower overlap: Sultan, Corless and Skelton's closed form.
pub fn tower_overlap(data: &Tower, shape: &TowerShape) -> f64 {
    let (azimuth, declination) = (shape.azimuth.to_radians(), shape.declination.to_radians());
    let (l, b) = (data.bar, data.side);
    let u = declination.sin() * (azimuth + TAU / 12.0).cos();
    if u.abs() < 1e-12 {
        return 0.5 * l * declination.cos();
    }
    let root = (b * b / 3.0 - 3.0 * l * l * u * u).sqrt();
    declination.cos() / (2.0 * u) * (l * u + root - b / 3.0_f64.sqrt())
}
