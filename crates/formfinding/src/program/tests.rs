//! Derivatives of everything that can be asked for.

use std::path::Path;

use tensegra_model::{Problem, Shape};

use crate::FormProblem;

use super::*;

/// Everything that can be asked for at once: the derivatives must be those of the values.
#[test]
fn derivatives_agree_with_differences() {
    for (fixture, infinite) in [("formfinding/plane.toml", true), ("kite.toml", false)] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures");
        let mut problem = Problem::read(&path.join(fixture)).unwrap();
        problem.form.infinite_cylinders = infinite;
        problem.form.node_radius = Some(0.01);
        problem.form.cost = FormCost::Energy;
        for obstacle in &mut problem.environment.obstacles {
            // Away from kinks: inside of a half-space or ball the depth is smooth.
            if let Shape::HalfSpace { point, .. } = &mut obstacle.shape {
                point.x += 0.3;
            }
        }
        let wide = Interval::new(-1e3, 1e3);
        let count = problem.structure.nodes.len();
        problem.form.conditions.extend([
            FormCondition::Distance {
                nodes: [count - 1, 1],
                range: wide,
            },
            FormCondition::Length {
                element: 4,
                range: wide,
            },
            FormCondition::RestLength {
                element: 5,
                range: wide,
            },
            FormCondition::Force {
                element: 4,
                range: wide,
            },
            FormCondition::EqualLengths { elements: [3, 5] },
            FormCondition::Image {
                nodes: [count - 1, count - 2],
                linear: *nalgebra::Rotation3::from_euler_angles(0.1, 0.2, 0.3).matrix(),
                translation: Vector3::new(0.1, 0.2, 0.3),
            },
        ]);
        let found = FormProblem::new(&problem, &[]).unwrap();
        for start in 0..3 {
            found.with_random_point(start, |program, x| compare(program, x, fixture));
        }
    }
}

fn compare(program: &mut Program<'_, '_>, x: &[f64], fixture: &str) {
    const STEP: f64 = 1e-6;
    program.stable = true;
    let pattern = program.jacobian_pattern();
    let rows = program.num_constraints();
    let mut entries = vec![0.0; pattern.len()];
    program.jacobian(x, &mut entries);
    let mut gradient = vec![0.0; x.len()];
    program.gradient(x, &mut gradient);
    let mut at = x.to_vec();
    let (mut before, mut after) = (vec![0.0; rows], vec![0.0; rows]);
    let mut values = vec![0.0; rows];
    program.constraints(x, &mut values);
    for column in 0..x.len() {
        at[column] = x[column] + STEP;
        program.constraints(&at, &mut after);
        let energy = program.objective(&at);
        at[column] = x[column] - STEP;
        program.constraints(&at, &mut before);
        let slope = (energy - program.objective(&at)) / (2.0 * STEP);
        at[column] = x[column];
        let size = 1.0 + gradient[column].abs();
        assert!(
            (slope - gradient[column]).abs() < 1e-5 * size,
            "energy by {column}"
        );
        for row in 0..rows {
            // Away from equilibrium, rigid motions and turning members add to it what is left
            // out.
            let floats = fixture == "kite.toml";
            if floats && matches!(program.frame.rows[row].row, Row::Stiffness) {
                continue;
            }
            let stated: f64 = pattern
                .iter()
                .zip(&entries)
                .filter(|(place, _)| *place == (row, column))
                .map(|(_, entry)| entry)
                .sum();
            let measured = (after[row] - before[row]) / (2.0 * STEP);
            // Where one side of a kink is on either side of x there is no derivative.
            let bend = (after[row] + before[row] - 2.0 * values[row]).abs() / STEP;
            let size = 1.0 + stated.abs();
            assert!(
                (measured - stated).abs() < 2e-5 * size + 2.0 * bend,
                "{fixture}: {:?} by {column}: {measured} is not {stated}",
                program.frame.rows[row].row
            );
        }
    }
}
