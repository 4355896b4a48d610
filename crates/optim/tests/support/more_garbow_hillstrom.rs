//! Problems of J. J. Moré, B. S. Garbow, K. E. Hillstrom, "Testing unconstrained optimization
//! software", ACM Transactions on Mathematical Software 7 (1981), 17–41, by their residuals.

use super::Number;
use nalgebra::DMatrix;
use num_dual::Dual64;
use std::marker::PhantomData;
use tensegra_optim::{LeastSquares, SmoothFunction};

/// A sum of squares by its residuals.
pub trait Residuals {
    const NAME: &'static str;
    /// Known local minima of Σ r², the global one first.
    const OPTIMA: &'static [f64];
    fn start() -> Vec<f64>;
    fn residuals<D: Number>(x: &[D]) -> Vec<D>;
}

/// The problem as the solvers see it.
pub struct SumOfSquares<R> {
    num_variables: usize,
    num_residuals: usize,
    problem: PhantomData<R>,
}

impl<R: Residuals> SumOfSquares<R> {
    pub fn new() -> Self {
        let start = R::start();
        Self {
            num_variables: start.len(),
            num_residuals: R::residuals(&start).len(),
            problem: PhantomData,
        }
    }
}

fn seeded(x: &[f64], j: usize) -> Vec<Dual64> {
    let mut seeded: Vec<_> = x.iter().map(|&v| Dual64::new(v, 0.0)).collect();
    seeded[j].eps = 1.0;
    seeded
}

impl<R: Residuals> LeastSquares for SumOfSquares<R> {
    fn num_variables(&self) -> usize {
        self.num_variables
    }

    fn num_residuals(&self) -> usize {
        self.num_residuals
    }

    fn residuals(&mut self, x: &[f64], residuals: &mut [f64]) {
        residuals.copy_from_slice(&R::residuals(x));
    }

    fn jacobian(&mut self, x: &[f64], jacobian: &mut DMatrix<f64>) {
        for j in 0..self.num_variables {
            for (i, r) in R::residuals(&seeded(x, j)).into_iter().enumerate() {
                jacobian[(i, j)] = r.eps;
            }
        }
    }
}

impl<R: Residuals> SmoothFunction for SumOfSquares<R> {
    fn num_variables(&self) -> usize {
        self.num_variables
    }

    fn value(&mut self, x: &[f64]) -> f64 {
        R::residuals(x).iter().map(|r| r * r).sum()
    }

    fn value_and_gradient(&mut self, x: &[f64], gradient: &mut [f64]) -> f64 {
        for (j, g) in gradient.iter_mut().enumerate() {
            *g = R::residuals(&seeded(x, j))
                .into_iter()
                .map(|r| 2.0 * r.re * r.eps)
                .sum();
        }
        self.value(x)
    }
}

macro_rules! problems {
    ($(
        $(#[$doc:meta])* $name:ident, $start:expr, $optima:expr, |$x:ident| $residuals:expr;
    )*) => {
        $(
            $(#[$doc])*
            pub struct $name;

            impl Residuals for $name {
                const NAME: &'static str = stringify!($name);
                const OPTIMA: &'static [f64] = &$optima;
                fn start() -> Vec<f64> {
                    $start
                }
                fn residuals<D: Number>($x: &[D]) -> Vec<D> {
                    $residuals
                }
            }
        )*
    };
}

fn constant<D: Number>(value: f64) -> D {
    D::from(value)
}

problems! {
    Rosenbrock, vec![-1.2, 1.0], [0.0], |x| vec![(x[1] - x[0] * x[0]) * 10.0, -x[0] + 1.0];

    FreudensteinRoth, vec![0.5, -2.0], [0.0, 48.984_253_679_5], |x| vec![
        x[0] - 13.0 + ((-x[1] + 5.0) * x[1] - 2.0) * x[1],
        x[0] - 29.0 + ((x[1] + 1.0) * x[1] - 14.0) * x[1],
    ];

    PowellBadlyScaled, vec![0.0, 1.0], [0.0], |x| vec![
        x[0] * x[1] * 1e4 - 1.0,
        (-x[0]).exp() + (-x[1]).exp() - 1.0001,
    ];

    BrownBadlyScaled, vec![1.0, 1.0], [0.0], |x| vec![x[0] - 1e6, x[1] - 2e-6, x[0] * x[1] - 2.0];

    Beale, vec![1.0, 1.0], [0.0], |x| [1.5, 2.25, 2.625]
        .iter()
        .zip(1..)
        .map(|(&y, i)| -x[0] * (-x[1].powi(i) + 1.0) + y)
        .collect();

    JennrichSampson, vec![0.3, 0.4], [124.362_182_355_6], |x| (1..=10)
        .map(f64::from)
        .map(|i| -(x[0] * i).exp() - (x[1] * i).exp() + 2.0 + 2.0 * i)
        .collect();

    HelicalValley, vec![-1.0, 0.0, 0.0], [0.0], |x| {
        let half = if x[0].re() < 0.0 { 0.5 } else { 0.0 };
        let theta = (x[1] / x[0]).atan() / (2.0 * std::f64::consts::PI) + half;
        vec![
            (x[2] - theta * 10.0) * 10.0,
            ((x[0] * x[0] + x[1] * x[1]).sqrt() - 1.0) * 10.0,
            x[2],
        ]
    };

    Bard, vec![1.0, 1.0, 1.0], [8.214_877_306_578_96e-3, 17.428_693_333_33], |x| [
        0.14, 0.18, 0.22, 0.25, 0.29, 0.32, 0.35, 0.39, 0.37, 0.58, 0.73, 0.96, 1.34, 2.10, 4.39,
    ]
    .iter()
    .zip(1..)
    .map(|(&y, u)| {
        let (u, v) = (f64::from(u), f64::from(16 - u));
        -(x[0] + (x[1] * v + x[2] * u.min(v)).recip() * u) + y
    })
    .collect();

    Gaussian, vec![0.4, 1.0, 0.0], [1.127_932_769_62e-8], |x| [
        0.0009, 0.0044, 0.0175, 0.0540, 0.1295, 0.2420, 0.3521, 0.3989, 0.3521, 0.2420, 0.1295,
        0.0540, 0.0175, 0.0044, 0.0009,
    ]
    .iter()
    .zip(1..)
    .map(|(&y, i)| {
        let t = (8.0 - f64::from(i)) / 2.0;
        x[0] * (-x[1] * (-x[2] + t).powi(2) / 2.0).exp() - y
    })
    .collect();

    Meyer, vec![0.02, 4_000.0, 250.0], [87.945_855_171], |x| [
        34_780.0, 28_610.0, 23_650.0, 19_630.0, 16_370.0, 13_720.0, 11_540.0, 9_744.0, 8_261.0,
        7_030.0, 6_005.0, 5_147.0, 4_427.0, 3_820.0, 3_307.0, 2_872.0,
    ]
    .iter()
    .zip(1..)
    .map(|(&y, i)| x[0] * (x[1] / (x[2] + (45.0 + 5.0 * f64::from(i)))).exp() - y)
    .collect();

    Box3D, vec![0.0, 10.0, 20.0], [0.0], |x| (1..=10)
        .map(|i| 0.1 * f64::from(i))
        .map(|t| {
            let known: f64 = (-t).exp() - (-10.0 * t).exp();
            (-x[0] * t).exp() - (-x[1] * t).exp() - x[2] * known
        })
        .collect();

    /// J is singular at the solution.
    PowellSingular, vec![3.0, -1.0, 0.0, 1.0], [0.0], |x| vec![
        x[0] + x[1] * 10.0,
        (x[2] - x[3]) * 5.0_f64.sqrt(),
        (x[1] - x[2] * 2.0).powi(2),
        (x[0] - x[3]).powi(2) * 10.0_f64.sqrt(),
    ];

    Wood, vec![-3.0, -1.0, -3.0, -1.0], [0.0], |x| vec![
        (x[1] - x[0] * x[0]) * 10.0,
        -x[0] + 1.0,
        (x[3] - x[2] * x[2]) * 90.0_f64.sqrt(),
        -x[2] + 1.0,
        (x[1] + x[3] - 2.0) * 10.0_f64.sqrt(),
        (x[1] - x[3]) / 10.0_f64.sqrt(),
    ];

    KowalikOsborne, vec![0.25, 0.39, 0.415, 0.39], [3.075_056_038_49e-4], |x| [
        (0.1957, 4.0), (0.1947, 2.0), (0.1735, 1.0), (0.1600, 0.5), (0.0844, 0.25),
        (0.0627, 0.167), (0.0456, 0.125), (0.0342, 0.1), (0.0323, 0.0833), (0.0235, 0.0714),
        (0.0246, 0.0625),
    ]
    .iter()
    .map(|&(y, u)| -x[0] * (x[1] * u + u * u) / (x[2] * u + u * u + x[3]) + y)
    .collect();

    BrownDennis, vec![25.0, 5.0, -5.0, -1.0], [85_822.201_626_356], |x| (1..=20)
        .map(|i| f64::from(i) / 5.0)
        .map(|t| {
            (x[0] + x[1] * t - t.exp()).powi(2) + (x[2] + x[3] * t.sin() - t.cos()).powi(2)
        })
        .collect();

    Osborne1, vec![0.5, 1.5, -1.0, 0.01, 0.02], [5.464_894_697_482_2e-5], |x| [
        0.844, 0.908, 0.932, 0.936, 0.925, 0.908, 0.881, 0.850, 0.818, 0.784, 0.751, 0.718, 0.685,
        0.658, 0.628, 0.603, 0.580, 0.558, 0.538, 0.522, 0.506, 0.490, 0.478, 0.467, 0.457, 0.448,
        0.438, 0.431, 0.424, 0.420, 0.414, 0.411, 0.406,
    ]
    .iter()
    .zip(0..)
    .map(|(&y, i)| {
        let t = 10.0 * f64::from(i);
        -(x[0] + x[1] * (-x[3] * t).exp() + x[2] * (-x[4] * t).exp()) + y
    })
    .collect();

    Watson6, vec![0.0; 6], [2.287_670_053_552_4e-3], |x| {
        let mut residuals: Vec<D> = (1..=29)
            .map(|i| {
                let t = f64::from(i) / 29.0;
                let (mut derivative, mut value) = (constant::<D>(0.0), x[0]);
                for j in 1..6 {
                    derivative += x[j] * (j as f64 * t.powi(j as i32 - 1));
                    value += x[j] * t.powi(j as i32);
                }
                derivative - value * value - 1.0
            })
            .collect();
        residuals.push(x[0]);
        residuals.push(x[1] - x[0] * x[0] - 1.0);
        residuals
    };

    /// Rosenbrock's function in 20 variables.
    ExtendedRosenbrock, [-1.2, 1.0].repeat(10), [0.0], |x| x
        .chunks_exact(2)
        .flat_map(|p| [(p[1] - p[0] * p[0]) * 10.0, -p[0] + 1.0])
        .collect();

    /// Powell's singular function in 20 variables.
    ExtendedPowell, [3.0, -1.0, 0.0, 1.0].repeat(5), [0.0], |x| x
        .chunks_exact(4)
        .flat_map(|p| [
            p[0] + p[1] * 10.0,
            (p[2] - p[3]) * 5.0_f64.sqrt(),
            (p[1] - p[2] * 2.0).powi(2),
            (p[0] - p[3]).powi(2) * 10.0_f64.sqrt(),
        ])
        .collect();

    VariablyDimensioned, (1..=10).map(|j| 1.0 - f64::from(j) / 10.0).collect(), [0.0], |x| {
        let mut residuals: Vec<D> = x.iter().map(|&x| x - 1.0).collect();
        let sum = x
            .iter()
            .zip(1..)
            .fold(constant::<D>(0.0), |sum, (&x, j)| sum + (x - 1.0) * f64::from(j));
        residuals.push(sum);
        residuals.push(sum * sum);
        residuals
    };

    Trigonometric, vec![0.1; 10], [0.0, 2.795_056_121_88e-5], |x| {
        let n = x.len() as f64;
        let cosines = x.iter().fold(constant::<D>(0.0), |sum, x| sum + x.cos());
        x.iter()
            .zip(1..)
            .map(|(x, i)| -cosines + n - (x.cos() - 1.0) * f64::from(i) - x.sin())
            .collect()
    };

    BrownAlmostLinear, vec![0.5; 10], [0.0, 1.0], |x| {
        let sum = x.iter().fold(constant::<D>(0.0), |sum, &x| sum + x);
        let mut residuals: Vec<D> = x[..9].iter().map(|&x| x + sum - 11.0).collect();
        residuals.push(x.iter().fold(constant::<D>(1.0), |product, &x| product * x) - 1.0);
        residuals
    };

    DiscreteBoundaryValue, (1..=10)
        .map(|j| f64::from(j) / 11.0 * (f64::from(j) / 11.0 - 1.0))
        .collect(), [0.0], |x| {
        let h = 1.0 / 11.0;
        (0..10)
            .map(|i| {
                let t = (i + 1) as f64 * h;
                let left = if i > 0 { x[i - 1] } else { constant(0.0) };
                let right = if i < 9 { x[i + 1] } else { constant(0.0) };
                x[i] * 2.0 - left - right + (x[i] + (t + 1.0)).powi(3) * (0.5 * h * h)
            })
            .collect()
    };

    BroydenTridiagonal, vec![-1.0; 10], [0.0], |x| (0..10)
        .map(|i| {
            let left = if i > 0 { x[i - 1] } else { constant(0.0) };
            let right = if i < 9 { x[i + 1] } else { constant(0.0) };
            (-x[i] * 2.0 + 3.0) * x[i] - left - right * 2.0 + 1.0
        })
        .collect();

    /// Rank-deficient everywhere: rank 1 in 5 variables.
    LinearRankOne, vec![1.0; 5], [4.634_146_341_463_41], |x| (1..=20)
        .map(|i| {
            let sum = x
                .iter()
                .zip(1..)
                .fold(constant::<D>(0.0), |sum, (&x, j)| sum + x * f64::from(j));
            sum * f64::from(i) - 1.0
        })
        .collect();
}

/// Calls a macro with every problem.
macro_rules! for_each_sum_of_squares {
    ($visit:ident) => {
        $visit!(
            Rosenbrock,
            FreudensteinRoth,
            PowellBadlyScaled,
            BrownBadlyScaled,
            Beale,
            JennrichSampson,
            HelicalValley,
            Bard,
            Gaussian,
            Meyer,
            Box3D,
            PowellSingular,
            Wood,
            KowalikOsborne,
            BrownDennis,
            Osborne1,
            Watson6,
            ExtendedRosenbrock,
            ExtendedPowell,
            VariablyDimensioned,
            Trigonometric,
            BrownAlmostLinear,
            DiscreteBoundaryValue,
            BroydenTridiagonal,
            LinearRankOne
        )
    };
}
pub(crate) use for_each_sum_of_squares;
