//! The problem: a chain of balls p₁ … p_L at unit distance from each other,
//! from the origin to a point of a sphere, is to turn about the origin.
//!
//! The problem is one of the demonstrations of the Open Motion Planning Library
//! (Kingston, Moll and Kavraki 2019).

use tensegra_atlas::{ImplicitManifold, Predicate, SparsityPattern, Validity};

/// Balls stay this far from each other and from the origin, in maximum norm.
const RADIUS: f64 = 0.2;

/// The chain. Variables are the coordinates of the balls, one after the other.
pub struct Chain {
    links: usize,
    pattern: SparsityPattern,
    lower: Vec<f64>,
    upper: Vec<f64>,
}

impl Chain {
    pub fn new(links: usize) -> Self {
        let ball = |i: usize| 3 * i..3 * i + 3;
        // Equation i says that ball i is one away from the ball before (the
        // first: from the origin); the last one, that the last ball is on a
        // sphere about the origin.
        let mut rows = vec![ball(0).collect::<Vec<_>>()];
        rows.extend((1..links).map(|i| ball(i - 1).chain(ball(i)).collect()));
        rows.push(ball(links - 1).collect());
        // Ball i is at most i + 1 away from the origin, and above the ground.
        let reach = |i: usize| (i + 1) as f64;
        Self {
            links,
            pattern: SparsityPattern::from_rows(3 * links, &rows),
            lower: (0..links)
                .flat_map(|i| [-reach(i), -reach(i), 0.0])
                .collect(),
            upper: (0..links).flat_map(|i| [reach(i); 3]).collect(),
        }
    }

    /// Radius of the sphere that the last ball stays on.
    fn sphere(&self) -> f64 {
        (self.links - 2) as f64
    }

    /// No ball touches another one, and only the last may touch the origin.
    pub fn is_valid(x: &[f64]) -> bool {
        Self::is_clear(x, RADIUS)
    }

    /// Whether the balls are at least `distance` apart.
    fn is_clear(x: &[f64], distance: f64) -> bool {
        let (balls, _) = x.as_chunks::<3>();
        let (_, inner) = balls.split_last().unwrap_or((&[0.0; 3], &[]));
        let clear = |a: &[f64; 3], b: &[f64; 3]| (0..3).any(|i| (a[i] - b[i]).abs() >= distance);
        inner.iter().all(|ball| clear(ball, &[0.0; 3]))
            && balls
                .iter()
                .enumerate()
                .all(|(i, a)| balls[..i].iter().all(|b| clear(a, b)))
    }

    /// The test of steps: at their ends and at two points between, with a margin
    /// for what is not looked at.
    pub fn free_space(&self) -> impl Validity {
        Predicate::new(3 * self.links, 2, |x: &[f64]| {
            Self::is_clear(x, RADIUS + 0.015)
        })
    }

    /// Start: stretched along the x axis, with one corner back. Goal: the same,
    /// half a turn about the vertical axis away.
    pub fn endpoints(&self) -> [Vec<f64>; 2] {
        let far = self.sphere();
        let straight = (1..self.links - 2).map(|i| [i as f64, 0.0, 0.0]);
        let start: Vec<f64> = straight
            .chain([[far - 1.0, -1.0, 0.0], [far, -1.0, 0.0], [far, 0.0, 0.0]])
            .flatten()
            .collect();
        let goal = start.iter().map(|x| 0.0 - x).collect();
        [start, goal]
    }
}

impl ImplicitManifold for Chain {
    fn ambient_dimension(&self) -> usize {
        3 * self.links
    }

    fn equation_count(&self) -> usize {
        self.links + 1
    }

    fn residual(&self, x: &[f64], residual: &mut [f64]) {
        let mut before = [0.0; 3];
        let (balls, _) = x.as_chunks::<3>();
        for (ball, value) in balls.iter().zip(residual.iter_mut()) {
            *value = 0.5 * (squared_distance(ball, &before) - 1.0);
            before = *ball;
        }
        let radius = self.sphere();
        let square = squared_distance(&before, &[0.0; 3]);
        residual[self.links] = 0.5 * (square / radius - radius);
    }

    fn jacobian_pattern(&self) -> &SparsityPattern {
        &self.pattern
    }

    fn jacobian(&self, x: &[f64], values: &mut [f64]) {
        // In the order of the pattern: the ball before, then the ball.
        let (balls, _) = x.as_chunks::<3>();
        let (first, rest) = values.split_at_mut(3);
        first.copy_from_slice(&balls[0]);
        let (rows, last) = rest.split_at_mut(6 * (self.links - 1));
        for (pair, row) in balls.windows(2).zip(rows.chunks_exact_mut(6)) {
            for axis in 0..3 {
                let difference = pair[1][axis] - pair[0][axis];
                row[axis] = -difference;
                row[3 + axis] = difference;
            }
        }
        for (value, x) in last.iter_mut().zip(&balls[self.links - 1]) {
            *value = x / self.sphere();
        }
    }

    fn lower_bounds(&self) -> &[f64] {
        &self.lower
    }

    fn upper_bounds(&self) -> &[f64] {
        &self.upper
    }
}

fn squared_distance(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    (0..3).map(|i| (a[i] - b[i]).powi(2)).sum()
}
