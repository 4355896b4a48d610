//! Test problems from their formulas alone: derivatives by dual numbers.

#![allow(dead_code, unused_imports, unused_macros)] // Each test file uses a part.

pub mod hock_schittkowski;
pub mod more_garbow_hillstrom;

use num_dual::{Dual64, DualNum, HyperDual64};
use std::marker::PhantomData;
use tensegra_optim::{Hessian, Nlp, TripletPattern};

/// A number that formulas are written for.
pub trait Number: DualNum<Primitive = f64> + Copy {}
impl<T: DualNum<Primitive = f64> + Copy> Number for T {}

/// A test problem: its formulas, bounds, start, and known optimum.
pub trait Formulas {
    const NAME: &'static str;
    /// Known least value.
    const OPTIMUM: f64;
    /// Values at local minima that are known besides.
    const OTHER_MINIMA: &'static [f64] = &[];
    fn start() -> Vec<f64>;
    fn bounds() -> Vec<(f64, f64)> {
        vec![(f64::NEG_INFINITY, f64::INFINITY); Self::start().len()]
    }
    /// Bounds of the constraints.
    fn ranges() -> Vec<(f64, f64)> {
        Vec::new()
    }
    fn objective<D: Number>(x: &[D]) -> D;
    fn constraints<D: Number>(_x: &[D]) -> Vec<D> {
        Vec::new()
    }
}

/// Whether a value is the known optimum, or that of another known local minimum.
pub fn is_known_minimum<F: Formulas>(value: f64, tolerance: f64) -> bool {
    std::iter::once(&F::OPTIMUM)
        .chain(F::OTHER_MINIMA)
        .any(|minimum| (value - minimum).abs() <= tolerance * minimum.abs().max(1.0))
}

/// A test problem as the solvers see it.
pub struct Differentiated<F> {
    kind: Hessian,
    num_variables: usize,
    num_constraints: usize,
    formulas: PhantomData<F>,
}

impl<F: Formulas> Differentiated<F> {
    pub fn new(kind: Hessian) -> Self {
        Self {
            kind,
            num_variables: F::start().len(),
            num_constraints: F::ranges().len(),
            formulas: PhantomData,
        }
    }
}

fn seeded(x: &[f64], j: usize) -> Vec<Dual64> {
    let mut seeded: Vec<_> = x.iter().map(|&v| Dual64::new(v, 0.0)).collect();
    seeded[j].eps = 1.0;
    seeded
}

impl<F: Formulas> Nlp for Differentiated<F> {
    fn num_variables(&self) -> usize {
        self.num_variables
    }

    fn num_constraints(&self) -> usize {
        self.num_constraints
    }

    fn variable_bounds(&self, lower: &mut [f64], upper: &mut [f64]) {
        for (j, (l, u)) in F::bounds().into_iter().enumerate() {
            (lower[j], upper[j]) = (l, u);
        }
    }

    fn constraint_bounds(&self, lower: &mut [f64], upper: &mut [f64]) {
        for (i, (l, u)) in F::ranges().into_iter().enumerate() {
            (lower[i], upper[i]) = (l, u);
        }
    }

    fn jacobian_pattern(&self) -> TripletPattern {
        TripletPattern::dense(self.num_constraints, self.num_variables)
    }

    fn objective(&mut self, x: &[f64]) -> f64 {
        F::objective(x)
    }

    fn gradient(&mut self, x: &[f64], gradient: &mut [f64]) {
        for (j, g) in gradient.iter_mut().enumerate() {
            *g = F::objective(&seeded(x, j)).eps;
        }
    }

    fn constraints(&mut self, x: &[f64], values: &mut [f64]) {
        values.copy_from_slice(&F::constraints(x));
    }

    fn jacobian(&mut self, x: &[f64], values: &mut [f64]) {
        for j in 0..self.num_variables {
            for (i, c) in F::constraints(&seeded(x, j)).into_iter().enumerate() {
                values[i * self.num_variables + j] = c.eps;
            }
        }
    }

    fn hessian_kind(&self) -> Hessian {
        self.kind
    }

    fn hessian_pattern(&self) -> TripletPattern {
        TripletPattern::lower_triangle(self.num_variables)
    }

    fn hessian(&mut self, x: &[f64], weight: f64, multipliers: &[f64], values: &mut [f64]) {
        let mut k = 0;
        for row in 0..self.num_variables {
            for column in 0..=row {
                let mut seeded: Vec<_> = x.iter().map(|&v| HyperDual64::from_re(v)).collect();
                seeded[row].eps1 = 1.0;
                seeded[column].eps2 = 1.0;
                values[k] = weight * F::objective(&seeded).eps1eps2;
                for (c, multiplier) in F::constraints(&seeded).into_iter().zip(multipliers) {
                    values[k] += multiplier * c.eps1eps2;
                }
                k += 1;
            }
        }
    }
}
