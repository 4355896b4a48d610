//! The problem: a parallel robot of four chains of three balls each, from a
//! circle on the ground to the rim of a flat round platform, lowers the platform.
//!
//! The problem is one of the demonstrations of the Open Motion Planning Library
//! (Kingston, Moll and Kavraki 2019).

use std::f64::consts::PI;

use nalgebra::Vector3;
use tensegra_atlas::{ImplicitManifold, Predicate, SparsityPattern, Validity};

/// Chains.
const CHAINS: usize = 4;
/// Balls of a chain; the last one, its tip, is on the rim of the platform.
const BALLS: usize = 3;
/// Variables: the coordinates of the balls, chain after chain.
const VARIABLES: usize = 3 * BALLS * CHAINS;
/// Balls stay this far from each other and from the origin, in maximum norm.
const RADIUS: f64 = 0.2;

type Vector = Vector3<f64>;

/// The robot.
pub struct ParallelRobot {
    pattern: SparsityPattern,
    lower: Vec<f64>,
    upper: Vec<f64>,
}

/// Where a chain is fixed to the ground.
fn base(chain: usize) -> Vector {
    let angle = 2.0 * PI * chain as f64 / CHAINS as f64;
    Vector::new(angle.cos(), angle.sin(), 0.0)
}

/// A ball of a chain.
fn ball(x: &[f64], chain: usize, ball: usize) -> Vector {
    Vector::from_column_slice(&x[3 * (BALLS * chain + ball)..][..3])
}

/// The tips of the chains.
fn tips(x: &[f64]) -> [Vector; CHAINS] {
    std::array::from_fn(|chain| ball(x, chain, BALLS - 1))
}

impl ParallelRobot {
    pub fn new() -> Self {
        let variables = |chain: usize, ball: usize| {
            let first = 3 * (BALLS * chain + ball);
            first..first + 3
        };
        let tips: Vec<usize> = (0..CHAINS)
            .flat_map(|chain| variables(chain, BALLS - 1))
            .collect();
        // Each ball is one away from the ball before, the first of a chain from
        // its base.
        let mut rows = Vec::new();
        for chain in 0..CHAINS {
            rows.push(variables(chain, 0).collect());
            for i in 1..BALLS {
                rows.push(variables(chain, i - 1).chain(variables(chain, i)).collect());
            }
        }
        // Each tip is one away from the centre of the tips, and these are in one
        // plane: equations of all tips.
        rows.extend(vec![tips; CHAINS + 1]);
        let reach = |i: usize| (i + 2) as f64;
        let balls = || (0..CHAINS).flat_map(|_| 0..BALLS);
        Self {
            pattern: SparsityPattern::from_rows(VARIABLES, &rows),
            // All above the ground.
            lower: balls().flat_map(|i| [-reach(i), -reach(i), 0.0]).collect(),
            upper: balls().flat_map(|i| [reach(i); 3]).collect(),
        }
    }

    /// No ball touches another one or the origin.
    pub fn is_valid(x: &[f64]) -> bool {
        Self::is_clear(x, RADIUS)
    }

    /// Whether the balls are at least `distance` apart.
    fn is_clear(x: &[f64], distance: f64) -> bool {
        let (balls, _) = x.as_chunks::<3>();
        let clear = |a: &[f64; 3], b: &[f64; 3]| (0..3).any(|i| (a[i] - b[i]).abs() >= distance);
        balls
            .iter()
            .enumerate()
            .all(|(i, a)| clear(a, &[0.0; 3]) && balls[..i].iter().all(|b| clear(a, b)))
    }

    /// The test of steps: at their ends and at two points between, with a margin
    /// for what is not looked at.
    pub fn free_space(&self) -> impl Validity {
        Predicate::new(VARIABLES, 2, |x: &[f64]| Self::is_clear(x, RADIUS + 0.015))
    }

    /// Start: all chains upright, bulging a little. Goal: each chain goes out
    /// along the ground, up and back in, with the platform at a third of its
    /// height.
    pub fn endpoints(&self) -> [Vec<f64>; 2] {
        let (sin, cos) = (PI / 16.0).sin_cos();
        let chain = |points: [Vector; BALLS]| points.into_iter().flat_map(|p| [p.x, p.y, p.z]);
        let start = |c: usize| {
            let outward = base(c);
            let first = outward + outward * sin + Vector::z() * cos;
            let second = first + Vector::z();
            chain([first, second, second - outward * sin + Vector::z() * cos])
        };
        let goal = |c: usize| {
            let outward = base(c);
            let corner = 2.0 * outward + Vector::z();
            chain([2.0 * outward, corner, corner - outward])
        };
        [
            (0..CHAINS).flat_map(start).collect(),
            (0..CHAINS).flat_map(goal).collect(),
        ]
    }
}

impl ImplicitManifold for ParallelRobot {
    fn ambient_dimension(&self) -> usize {
        VARIABLES
    }

    fn equation_count(&self) -> usize {
        CHAINS * BALLS + CHAINS + 1
    }

    fn residual(&self, x: &[f64], residual: &mut [f64]) {
        let mut values = residual.iter_mut();
        let mut write = |value: f64| {
            if let Some(place) = values.next() {
                *place = value;
            }
        };
        for chain in 0..CHAINS {
            let mut before = base(chain);
            for i in 0..BALLS {
                let ball = ball(x, chain, i);
                write(0.5 * ((ball - before).norm_squared() - 1.0));
                before = ball;
            }
        }
        let tips = tips(x);
        let center = tips.iter().sum::<Vector>() / CHAINS as f64;
        for tip in tips {
            write(0.5 * ((tip - center).norm_squared() - 1.0));
        }
        let [a, b, c] = [1, 2, 3].map(|i| tips[i] - tips[0]);
        write(c.dot(&a.cross(&b)));
    }

    fn jacobian_pattern(&self) -> &SparsityPattern {
        &self.pattern
    }

    fn jacobian(&self, x: &[f64], values: &mut [f64]) {
        let mut places = values.chunks_exact_mut(3);
        let mut write = |value: Vector| {
            if let Some(place) = places.next() {
                place.copy_from_slice(value.as_slice());
            }
        };
        // In the order of the pattern.
        for chain in 0..CHAINS {
            let mut before = base(chain);
            for i in 0..BALLS {
                let ball = ball(x, chain, i);
                let difference = ball - before;
                if i > 0 {
                    write(-difference);
                }
                write(difference);
                before = ball;
            }
        }
        let tips = tips(x);
        let share = 1.0 / CHAINS as f64;
        let center = tips.iter().sum::<Vector>() * share;
        for tip in 0..CHAINS {
            let difference = tips[tip] - center;
            for other in 0..CHAINS {
                let own = if other == tip { 1.0 } else { 0.0 };
                write(difference * (own - share));
            }
        }
        let [a, b, c] = [1, 2, 3].map(|i| tips[i] - tips[0]);
        let gradients = [b.cross(&c), c.cross(&a), a.cross(&b)];
        write(-gradients.iter().sum::<Vector>());
        gradients.into_iter().for_each(write);
    }

    fn lower_bounds(&self) -> &[f64] {
        &self.lower
    }

    fn upper_bounds(&self) -> &[f64] {
        &self.upper
    }
}
