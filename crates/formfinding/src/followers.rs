//! Nodes that no force reaches, such as the tip of a rod that is geometry only:
//! they follow the others.

use nalgebra::{DMatrix, Point3, Rotation3, Vector3};
use tensegra_model::{Coupling, Structure};
use tensegra_optim::{LeastSquares, LeastSquaresOptions, LevenbergMarquardt, StepScaling};

/// Puts `followers` where their constant lengths and coupled directions want them,
/// the other nodes having moved from `start` to `positions`: first each goes along
/// with a neighbour, then the nearest place that satisfies the relations is found
/// by least squares. What nothing determines stays where it went along to.
pub(crate) fn place(
    structure: &Structure,
    followers: &[usize],
    start: &[Point3<f64>],
    positions: &mut [Point3<f64>],
) {
    let number = |node: usize| followers.iter().position(|&follower| follower == node);
    for &node in followers {
        let neighbour = structure.elements.iter().find_map(|element| {
            let [a, b] = element.nodes;
            let other = if a == node { b } else { a };
            ((a == node || b == node) && number(other).is_none()).then_some(other)
        });
        if let Some(other) = neighbour {
            positions[node] = start[node] + (positions[other] - start[other]);
        }
    }
    let touches = |element: usize| {
        let nodes = structure.elements[element].nodes;
        nodes.iter().any(|&node| number(node).is_some())
    };
    let mut relations = Vec::new();
    for (e, element) in structure.elements.iter().enumerate() {
        if element.has_constant_length() && touches(e) {
            relations.push(Relation::Length(element.nodes, element.length.lo));
        }
    }
    for coupling in &structure.couplings {
        if let Coupling::Orientation {
            reference,
            followers: turned,
        } = coupling
        {
            for (follower, rotation) in turned {
                if touches(*reference) || touches(*follower) {
                    let nodes = |element: usize| structure.elements[element].nodes;
                    let (first, second) = (nodes(*reference), nodes(*follower));
                    relations.push(Relation::Orientation(first, second, *rotation));
                }
            }
        }
    }
    let mut problem = Placement {
        dimension: structure.dimension,
        followers,
        relations: &relations,
        positions: positions.to_vec(),
    };
    if relations.is_empty() {
        return;
    }
    let mut x: Vec<f64> = followers
        .iter()
        .flat_map(|&node| (0..structure.dimension).map(move |axis| (node, axis)))
        .map(|(node, axis)| positions[node][axis])
        .collect();
    // The shortest way to the relations, not the quickest.
    let options = LeastSquaresOptions::default().with_scaling(StepScaling::None);
    let solved = LevenbergMarquardt::new(options)
        .ok()
        .and_then(|mut solver| solver.solve(&mut problem, &mut x).ok());
    if solved.is_some() {
        problem.write(&x);
        positions.copy_from_slice(&problem.positions);
    }
}

/// What followers have to satisfy.
enum Relation {
    /// The distance of two nodes.
    Length([usize; 2], f64),
    /// The direction of the first pair is that of the second, rotated.
    Orientation([usize; 2], [usize; 2], Rotation3<f64>),
}

struct Placement<'a> {
    dimension: usize,
    followers: &'a [usize],
    relations: &'a [Relation],
    positions: Vec<Point3<f64>>,
}

impl Placement<'_> {
    fn write(&mut self, x: &[f64]) {
        for (&node, values) in self.followers.iter().zip(x.chunks(self.dimension)) {
            for (axis, &value) in values.iter().enumerate() {
                self.positions[node][axis] = value;
            }
        }
    }

    fn vector(&self, [a, b]: [usize; 2]) -> Vector3<f64> {
        self.positions[b] - self.positions[a]
    }

    /// Adds `scale · d(vector of nodes)/dx` along `direction` to a row.
    fn differentiate(
        &self,
        row: usize,
        [a, b]: [usize; 2],
        direction: Vector3<f64>,
        jacobian: &mut DMatrix<f64>,
    ) {
        for (follower, &node) in self.followers.iter().enumerate() {
            for (end, sign) in [(a, -1.0), (b, 1.0)] {
                if end == node {
                    for axis in 0..self.dimension {
                        jacobian[(row, follower * self.dimension + axis)] += sign * direction[axis];
                    }
                }
            }
        }
    }
}

/// Rates of a unit vector: (I − u uᵀ) w / l.
fn turn(vector: Vector3<f64>, along: Vector3<f64>) -> Vector3<f64> {
    let length = vector.norm().max(f64::MIN_POSITIVE);
    let unit = vector / length;
    (along - unit * unit.dot(&along)) / length
}

fn unit(vector: Vector3<f64>) -> Vector3<f64> {
    vector.try_normalize(0.0).unwrap_or_default()
}

impl LeastSquares for Placement<'_> {
    fn num_variables(&self) -> usize {
        self.dimension * self.followers.len()
    }

    fn num_residuals(&self) -> usize {
        let rows = self.relations.iter().map(|relation| match relation {
            Relation::Length(..) => 1,
            Relation::Orientation(..) => 3,
        });
        rows.sum()
    }

    fn residuals(&mut self, x: &[f64], residuals: &mut [f64]) {
        self.write(x);
        let mut values = Vec::with_capacity(residuals.len());
        for relation in self.relations {
            match relation {
                Relation::Length(nodes, length) => values.push(self.vector(*nodes).norm() - length),
                Relation::Orientation(first, second, rotation) => {
                    let error = unit(self.vector(*first)) - rotation * unit(self.vector(*second));
                    values.extend(error.iter());
                }
            }
        }
        residuals.copy_from_slice(&values);
    }

    fn jacobian(&mut self, x: &[f64], jacobian: &mut DMatrix<f64>) {
        self.write(x);
        jacobian.fill(0.0);
        let mut row = 0;
        for relation in self.relations {
            match relation {
                Relation::Length(nodes, _) => {
                    let direction = unit(self.vector(*nodes));
                    self.differentiate(row, *nodes, direction, jacobian);
                    row += 1;
                }
                Relation::Orientation(first, second, rotation) => {
                    for axis in 0..3 {
                        let along = Vector3::ith(axis, 1.0);
                        let rate = turn(self.vector(*first), along);
                        self.differentiate(row, *first, rate, jacobian);
                        let rate = turn(self.vector(*second), -(rotation.inverse() * along));
                        self.differentiate(row, *second, rate, jacobian);
                        row += 1;
                    }
                }
            }
        }
    }
}
