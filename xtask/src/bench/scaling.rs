//! Case `scaling` of the suite `manifold`: what a node of the trees and a chart
//! cost as structures grow.
//!
//! A tower of N stages lies in the plane. Stage s is a cross of two struts from
//! its left nodes, at x = s times the pitch, to its right nodes, half a unit
//! farther; neighbouring stages overlap. Active cables run along both sides
//! (rails), across each stage's ends (uprights), and crosswise between the ends
//! that no stage joins (diagonals). The start is stretched, the goal is shorter,
//! and the far end has to move around a ball between the two.

use nalgebra::Point3;
use tensegra::{
    describe,
    io::{Axis, BenchRow, Chart, Picture, Series, fit_power_law},
    model::{
        ElementKind, ElementSpec, Endpoint, EnvironmentBuilder, Obstacle, Problem, Role, Shape,
        Structure, StructureBuilder,
    },
};

use super::BenchArguments;
use crate::Error;

pub const NAME: &str = "scaling";

/// Stages of the smallest and the largest tower.
const STAGES: std::ops::RangeInclusive<usize> = 2..=12;
/// Runs of each tower at most: figures per node spread little.
const SEEDS: u64 = 5;
/// Nodes of the trees after which a run has shown what it costs.
const NODES: usize = 1000;
/// Reach of a stage along the tower, and half of the tower's height.
const REACH: f64 = 0.5;
const HALF_HEIGHT: f64 = 0.125;
/// Distance of the stages at start and goal.
const PITCHES: [f64; 2] = [0.35, 0.28];
const STIFFNESS: f64 = 20.0;

/// Adds the rows of the case; the picture shows them.
pub fn measure(arguments: &BenchArguments, rows: &mut Vec<BenchRow>) -> Result<Picture, Error> {
    let mut points: [Vec<[f64; 2]>; 2] = Default::default();
    let runs = arguments.seed_count().min(SEEDS);
    let variant_row = |variant: &str, metric: &str, unit: &str, samples: &[f64]| {
        let mut row = BenchRow::new(NAME, metric, unit, runs as usize, samples);
        row.suite = super::manifold::SUITE.to_owned();
        row.variant = variant.to_owned();
        row
    };
    for stages in STAGES {
        let mut problem = tower(stages)?;
        problem.settings.time_limit = arguments.time_limit;
        problem.settings.max_nodes = NODES;
        let elements = problem.structure.elements.len();
        let dimension = describe(&problem, None)?.dimension;
        let variant = format!("{stages} stages, {elements} elements, k = {dimension}");
        let mut samples: [Vec<f64>; 2] = Default::default();
        for seed in 1..=runs {
            problem.seed = seed;
            let statistics = match tensegra::plan(&problem, &mut ()) {
                Ok(plan) => plan.statistics,
                Err(error) => match error.statistics() {
                    Some(statistics) => *statistics,
                    None => return Err(error.into()),
                },
            };
            for (samples, count) in samples
                .iter_mut()
                .zip([statistics.nodes, statistics.charts])
            {
                samples.push(1e6 * statistics.seconds / count as f64);
            }
        }
        eprintln!("{NAME}: {variant}");
        for ((metric, samples), points) in ["time a node", "time a chart"]
            .into_iter()
            .zip(&samples)
            .zip(&mut points)
        {
            let row = variant_row(&variant, metric, "µs", samples);
            points.extend(row.median.map(|median| [elements as f64, median]));
            rows.push(row);
        }
    }
    let mut chart = Chart::new(
        Axis::new("elements").logarithmic(),
        Axis::new("planning time").unit("µs").logarithmic(),
    )
    .title("planar towers of 2 to 12 stages");
    for (index, (name, points)) in ["node", "chart"].into_iter().zip(points).enumerate() {
        let Some(law) = fit_power_law(&points) else {
            continue;
        };
        let metric = format!("exponent of the time a {name}");
        rows.push(variant_row("", &metric, "1", &[law.exponent]));
        let line = points.iter().map(|&[x, _]| [x, law.at(x)]).collect();
        let fit = format!("∝ elements^{:.2}", law.exponent);
        chart = chart
            .series(Series::points(format!("a {name}"), points).color(index))
            .series(Series::line(fit, line).color(index));
    }
    Ok(chart.draw()?)
}

/// The nodes of a side along the tower: left and right ends of the stages
/// alternate where these overlap.
fn rail(stages: usize) -> Vec<(char, usize)> {
    let mut nodes = vec![('l', 0)];
    for stage in 1..stages {
        nodes.extend([('l', stage), ('r', stage - 1)]);
    }
    nodes.push(('r', stages - 1));
    nodes
}

/// The tower of N ≥ 2 stages as a planning problem.
fn tower(stages: usize) -> Result<Problem, Error> {
    let name = |(end, stage): (char, usize), side: char| format!("{end}{stage}{side}");
    let mut elements: Vec<(ElementKind, String, String)> = Vec::new();
    for stage in 0..stages {
        for (a, b) in [('a', 'b'), ('b', 'a')] {
            let ends = (name(('l', stage), a), name(('r', stage), b));
            elements.push((ElementKind::Strut, ends.0, ends.1));
        }
        for end in ['l', 'r'] {
            let ends = (name((end, stage), 'a'), name((end, stage), 'b'));
            elements.push((ElementKind::Cable, ends.0, ends.1));
        }
    }
    for pair in rail(stages).windows(2) {
        for side in ['a', 'b'] {
            elements.push((ElementKind::Cable, name(pair[0], side), name(pair[1], side)));
        }
        // Where stages overlap their struts do what diagonals do elsewhere.
        if !(pair[0].0 == 'l' && pair[1].0 == 'r') {
            for (a, b) in [('a', 'b'), ('b', 'a')] {
                elements.push((ElementKind::Cable, name(pair[0], a), name(pair[1], b)));
            }
        }
    }
    let length = REACH.hypot(2.0 * HALF_HEIGHT);
    let mut builder = StructureBuilder::planar();
    for (i, (kind, a, b)) in elements.iter().enumerate() {
        let element = format!("e{i}");
        builder = builder.element(match kind {
            ElementKind::Strut => {
                ElementSpec::new(*kind, element, [a.as_str(), b.as_str()], length).radius(0.005)
            }
            _ => ElementSpec::new(*kind, element, [a.as_str(), b.as_str()], 0.0..=2.0)
                .stiffness(STIFFNESS)
                .rest(0.0..=2.0)
                .radius(0.002),
        });
    }
    let structure = builder
        .fix_coordinate("l0a", 0, 0.0)
        .fix_coordinate("l0a", 1, -HALF_HEIGHT)
        .fix_coordinate("l0b", 0, 0.0)
        .fix_coordinate("l0b", 1, HALF_HEIGHT)
        .build()?;
    let [start, goal] = PITCHES.map(|pitch| endpoint(&structure, pitch));
    let tips = PITCHES.map(|pitch| pitch * (stages - 1) as f64 + REACH);
    let end = format!("e{}", 4 * stages - 1);
    let environment = EnvironmentBuilder::default()
        .obstacle(Obstacle {
            name: "ball".to_owned(),
            shape: Shape::Sphere {
                center: Point3::new(0.5 * (tips[0] + tips[1]), 0.0, 0.0),
                radius: 0.02,
            },
            role: Role::default(),
            color: None,
        })
        .check(&end, "ball")
        .build(&structure)?;
    let mut problem = Problem::new(format!("tower of {stages} stages"), structure);
    problem.environment = environment;
    problem.start = Some(start);
    problem.goal = Some(goal);
    Ok(problem)
}

/// The straight tower with a distance of its stages, in a self-stress in closed
/// form: all struts alike, half of their thrust across the tower on the uprights
/// and half on the diagonals.
fn endpoint(structure: &Structure, pitch: f64) -> Endpoint {
    let positions: Vec<Point3<f64>> = structure
        .nodes
        .iter()
        .map(|node| {
            let (end, side) = (node.name.starts_with('l'), node.name.ends_with('a'));
            let stage: f64 = node.name[1..node.name.len() - 1].parse().unwrap_or(0.0);
            let x = pitch * stage + if end { 0.0 } else { REACH };
            Point3::new(x, if side { -HALF_HEIGHT } else { HALF_HEIGHT }, 0.0)
        })
        .collect();
    let length = REACH.hypot(2.0 * HALF_HEIGHT);
    let (along, across) = (REACH / length, 2.0 * HALF_HEIGHT / length);
    let mut forces: Vec<f64> = structure
        .elements
        .iter()
        .map(|element| {
            let [a, b] = element.nodes.map(|node| &structure.nodes[node].name);
            let d = positions[element.nodes[1]] - positions[element.nodes[0]];
            let slope = d.x.abs() / (2.0 * HALF_HEIGHT);
            if element.kind == ElementKind::Strut {
                -1.0
            } else if d.x.abs() < 1e-9 {
                0.5 * across
            } else if d.y.abs() > 1e-9 {
                0.5 * across * d.norm() / (2.0 * HALF_HEIGHT)
            } else if a.starts_with('l') && b.starts_with('r') {
                2.0 * along
            } else {
                along - 0.5 * across * slope
            }
        })
        .collect();
    let norm = forces.iter().map(|force| force * force).sum::<f64>().sqrt();
    forces.iter_mut().for_each(|force| *force /= norm);
    let mut endpoint = Endpoint::at(positions, structure);
    endpoint.forces = forces.into_iter().map(Some).collect();
    endpoint
}

#[cfg(test)]
mod tests {
    use tensegra::check::{CheckOptions, check_configuration};
    use tensegra::complete;

    use super::*;

    #[test]
    fn towers_of_any_height_are_in_equilibrium_at_both_ends() {
        for stages in STAGES {
            let problem = tower(stages).unwrap();
            assert_eq!(problem.structure.elements.len(), 10 * stages - 2);
            for endpoint in [&problem.start, &problem.goal] {
                let configuration = complete(&problem.structure, endpoint.as_ref().unwrap());
                let options = CheckOptions::default();
                let report = check_configuration(&problem, &configuration, &options);
                assert!(report.ok, "{stages}: {report}");
            }
        }
    }
}
