//! Polynomials of degree two in many variables: symbolic ones to set up and
//! simplify a system of equations, and a compiled system to evaluate it.
//!
//! Every equation of equilibrium in directions, lengths, rest lengths and forces
//! has at most degree two (Porta and Hernández-Juan, 2016, section 3), and
//! affine substitutions keep it so.

use std::ops::{Add, Mul};

use tensegra_atlas::SparsityPattern;

/// A coefficient counts as cancelled when it is below this fraction of the terms
/// that it is the sum of.
const CANCELLED: f64 = 1e-11;

/// A product of at most two variables: their numbers from one on in ascending
/// order, zero where there is none.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) struct Monomial([u32; 2]);

impl Monomial {
    pub(super) const ONE: Self = Self([0, 0]);

    pub(super) fn variable(i: usize) -> Self {
        Self([0, number(i)])
    }

    fn product(i: usize, j: usize) -> Self {
        Self([number(i.min(j)), number(i.max(j))])
    }

    /// The variables that it is made of.
    pub(super) fn variables(self) -> impl Iterator<Item = usize> {
        self.0
            .into_iter()
            .filter(|&v| v > 0)
            .map(|v| v as usize - 1)
    }

    /// The one variable that it is, if it is of degree one.
    pub(super) fn as_variable(self) -> Option<usize> {
        (self.0[0] == 0 && self.0[1] > 0).then(|| self.0[1] as usize - 1)
    }

    /// The two factors, if it is of degree two.
    pub(super) fn as_product(self) -> Option<[usize; 2]> {
        (self.0[0] > 0).then(|| self.0.map(|v| v as usize - 1))
    }
}

/// The number of a variable within a monomial.
fn number(i: usize) -> u32 {
    u32::try_from(i + 1).unwrap_or(u32::MAX)
}

/// Σ c · monomial, sorted by monomial, no coefficient being zero.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Polynomial {
    terms: Vec<(Monomial, f64)>,
}

impl Polynomial {
    pub(super) fn constant(value: f64) -> Self {
        Self::from_terms(vec![(Monomial::ONE, value)])
    }

    pub(super) fn variable(i: usize) -> Self {
        Self {
            terms: vec![(Monomial::variable(i), 1.0)],
        }
    }

    /// Sorts the terms, and adds up those of one monomial.
    fn from_terms(mut terms: Vec<(Monomial, f64)>) -> Self {
        terms.sort_by_key(|&(monomial, _)| monomial);
        let mut kept: Vec<(Monomial, f64)> = Vec::with_capacity(terms.len());
        for like in terms.chunk_by(|a, b| a.0 == b.0) {
            let sum: f64 = like.iter().map(|t| t.1).sum();
            let largest = like.iter().fold(0.0_f64, |m, t| m.max(t.1.abs()));
            if sum.abs() > CANCELLED * largest {
                kept.push((like[0].0, sum));
            }
        }
        Self { terms: kept }
    }

    pub(super) fn constant_term(&self) -> f64 {
        match self.terms.first() {
            Some(&(Monomial::ONE, c)) => c,
            _ => 0.0,
        }
    }

    /// The terms that are not constant.
    pub(super) fn varying(&self) -> &[(Monomial, f64)] {
        match self.terms.first() {
            Some(&(Monomial::ONE, _)) => &self.terms[1..],
            _ => &self.terms,
        }
    }

    /// The largest absolute coefficient.
    pub(super) fn magnitude(&self) -> f64 {
        self.terms.iter().fold(0.0, |m, t| m.max(t.1.abs()))
    }

    /// self + factor · other.
    pub(super) fn plus(&self, factor: f64, other: &Self) -> Self {
        let other = other.terms.iter().map(|&(m, c)| (m, factor * c));
        Self::from_terms(self.terms.iter().copied().chain(other).collect())
    }

    /// The product of two polynomials of degree one.
    pub(super) fn times(&self, other: &Self) -> Self {
        let mut terms = Vec::with_capacity(self.terms.len() * other.terms.len());
        for &(a, x) in &self.terms {
            for &(b, y) in &other.terms {
                let monomial = match (a.as_variable(), b.as_variable()) {
                    (Some(i), Some(j)) => Monomial::product(i, j),
                    _ => a.max(b),
                };
                terms.push((monomial, x * y));
            }
        }
        Self::from_terms(terms)
    }

    /// Whether the variable occurs.
    fn contains(&self, variable: usize) -> bool {
        let number = number(variable);
        self.terms.iter().any(|(m, _)| m.0.contains(&number))
    }

    /// Puts an affine expression in the place of a variable.
    pub(super) fn substitute(&mut self, variable: usize, value: &Affine) {
        if !self.contains(variable) {
            return;
        }
        let expression = |i: usize| {
            if i == variable {
                value.polynomial()
            } else {
                Self::variable(i)
            }
        };
        let mut terms = Vec::with_capacity(2 * self.terms.len());
        for &(monomial, c) in &self.terms {
            if monomial.variables().any(|i| i == variable) {
                let product = monomial
                    .variables()
                    .map(expression)
                    .fold(Self::constant(c), |product, factor| product.times(&factor));
                terms.extend(product.terms);
            } else {
                terms.push((monomial, c));
            }
        }
        *self = Self::from_terms(terms);
    }

    /// The same polynomial with other numbers for the variables, in the same order.
    pub(super) fn renumbered(mut self, numbers: &[usize]) -> Self {
        for (monomial, _) in &mut self.terms {
            for v in &mut monomial.0 {
                if *v > 0 {
                    *v = number(numbers[*v as usize - 1]);
                }
            }
        }
        self
    }

    /// The factor a for which self + a · pivot has the fewest monomials, if that
    /// is fewer than self has. Constants do not count.
    pub(super) fn shortening(&self, pivot: &Self) -> Option<f64> {
        let mut shared = 0;
        // Each ratio of coefficients, and how many monomials it cancels.
        let mut ratios: Vec<(f64, usize)> = Vec::new();
        let (mut a, mut b) = (
            self.varying().iter().peekable(),
            pivot.varying().iter().peekable(),
        );
        while let (Some(&&(x, c)), Some(&&(y, d))) = (a.peek(), b.peek()) {
            if x == y {
                shared += 1;
                let ratio = c / d;
                let same = |r: &f64| (r - ratio).abs() <= CANCELLED * ratio.abs();
                match ratios.iter_mut().find(|(r, _)| same(r)) {
                    Some((_, count)) => *count += 1,
                    None => ratios.push((ratio, 1)),
                }
            }
            if x <= y {
                a.next();
            }
            if y <= x {
                b.next();
            }
        }
        let (ratio, cancelled) = ratios
            .into_iter()
            .reduce(|best, next| if next.1 > best.1 { next } else { best })?;
        (pivot.varying().len() < shared + cancelled).then_some(-ratio)
    }

    /// Whether the two differ by a factor only.
    pub(super) fn is_multiple_of(&self, other: &Self) -> bool {
        let (Some(first), Some(second)) = (self.terms.last(), other.terms.last()) else {
            return self.terms.len() == other.terms.len();
        };
        let factor = first.1 / second.1;
        self.terms.len() == other.terms.len()
            && self.terms.iter().zip(&other.terms).all(|(a, b)| {
                a.0 == b.0 && (a.1 - factor * b.1).abs() <= 10.0 * CANCELLED * a.1.abs()
            })
    }
}

/// scale · x + offset in one variable x, or a constant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Affine {
    /// The variable and its scale.
    pub(super) variable: Option<(usize, f64)>,
    pub(super) offset: f64,
}

impl Affine {
    pub(super) fn constant(value: f64) -> Self {
        Self {
            variable: None,
            offset: value,
        }
    }

    pub(super) fn variable(i: usize) -> Self {
        Self {
            variable: Some((i, 1.0)),
            offset: 0.0,
        }
    }

    #[inline]
    pub(super) fn value(&self, x: &[f64]) -> f64 {
        match self.variable {
            Some((i, scale)) => scale * x[i] + self.offset,
            None => self.offset,
        }
    }

    fn polynomial(&self) -> Polynomial {
        let constant = Polynomial::constant(self.offset);
        match self.variable {
            Some((i, scale)) => constant.plus(scale, &Polynomial::variable(i)),
            None => constant,
        }
    }

    /// Puts an affine expression in the place of a variable.
    pub(super) fn substitute(&mut self, variable: usize, value: &Self) {
        if let Some((i, scale)) = self.variable
            && i == variable
        {
            self.offset += scale * value.offset;
            self.variable = value.variable.map(|(j, s)| (j, scale * s));
        }
    }
}

/// c · xᵢ · xⱼ, and where its two derivatives stand in the array of the
/// Jacobian's entries.
#[derive(Clone, Copy, Debug)]
struct Product {
    coefficient: f64,
    variables: [u32; 2],
    slots: [u32; 2],
}

/// Equations of degree two as flat arrays of terms.
#[derive(Clone, Debug)]
pub(super) struct QuadraticSystem {
    constants: Vec<f64>,
    linear_starts: Vec<usize>,
    linear: Vec<(u32, f64)>,
    product_starts: Vec<usize>,
    products: Vec<Product>,
    pattern: SparsityPattern,
    /// Entries of the Jacobian at x = 0.
    constant_jacobian: Vec<f64>,
}

impl QuadraticSystem {
    /// The system of the equations p(x) = 0.
    pub(super) fn new<'a>(
        variables: usize,
        equations: impl IntoIterator<Item = &'a Polynomial>,
    ) -> Self {
        let equations: Vec<&Polynomial> = equations.into_iter().collect();
        let columns: Vec<Vec<usize>> = equations
            .iter()
            .map(|equation| {
                let mut row: Vec<usize> = equation
                    .varying()
                    .iter()
                    .flat_map(|(monomial, _)| monomial.variables())
                    .collect();
                row.sort_unstable();
                row.dedup();
                row
            })
            .collect();
        let pattern = SparsityPattern::from_rows(variables, &columns);
        let mut system = Self {
            constants: equations.iter().map(|e| e.constant_term()).collect(),
            linear_starts: vec![0],
            linear: Vec::new(),
            product_starts: vec![0],
            products: Vec::new(),
            constant_jacobian: vec![0.0; pattern.len()],
            pattern,
        };
        for (row, equation) in equations.iter().enumerate() {
            let start = system.pattern.row_range(row).start;
            let slot = |i: usize| start + columns[row].partition_point(|&column| column < i);
            for &(monomial, coefficient) in equation.varying() {
                match monomial.as_product() {
                    Some(pair) => system.products.push(Product {
                        coefficient,
                        variables: pair.map(|i| i as u32),
                        slots: pair.map(|i| slot(i) as u32),
                    }),
                    None => {
                        for i in monomial.variables() {
                            system.linear.push((i as u32, coefficient));
                            system.constant_jacobian[slot(i)] = coefficient;
                        }
                    }
                }
            }
            system.linear_starts.push(system.linear.len());
            system.product_starts.push(system.products.len());
        }
        system
    }

    pub(super) fn equation_count(&self) -> usize {
        self.constants.len()
    }

    pub(super) fn pattern(&self) -> &SparsityPattern {
        &self.pattern
    }

    /// Writes the values of all equations at x, for any kind of number.
    pub(super) fn residual<T>(&self, x: &[T], residual: &mut [T])
    where
        T: Copy + From<f64> + Add<Output = T> + Mul<Output = T>,
    {
        let ranges = self
            .linear_starts
            .windows(2)
            .zip(self.product_starts.windows(2));
        for ((value, &constant), (linear, products)) in
            residual.iter_mut().zip(&self.constants).zip(ranges)
        {
            let mut sum = T::from(constant);
            for &(i, c) in &self.linear[linear[0]..linear[1]] {
                sum = sum + T::from(c) * x[i as usize];
            }
            for product in &self.products[products[0]..products[1]] {
                let [i, j] = product.variables;
                sum = sum + T::from(product.coefficient) * x[i as usize] * x[j as usize];
            }
            *value = sum;
        }
    }

    /// Writes the entries of the Jacobian at x in the order of the pattern.
    pub(super) fn jacobian(&self, x: &[f64], values: &mut [f64]) {
        values.copy_from_slice(&self.constant_jacobian);
        for product in &self.products {
            let [i, j] = product.variables.map(|i| i as usize);
            let [by_i, by_j] = product.slots.map(|s| s as usize);
            values[by_i] += product.coefficient * x[j];
            values[by_j] += product.coefficient * x[i];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn linear(terms: &[(usize, f64)], constant: f64) -> Polynomial {
        terms
            .iter()
            .fold(Polynomial::constant(constant), |sum, &(i, c)| {
                sum.plus(c, &Polynomial::variable(i))
            })
    }

    #[test]
    fn substitution_multiplies_out() {
        // (x0 + 2 x1 − 1) (x1 − x2) at x1 = 3 x2 + 0.5.
        let mut p = linear(&[(0, 1.0), (1, 2.0)], -1.0).times(&linear(&[(1, 1.0), (2, -1.0)], 0.0));
        let value = Affine {
            variable: Some((2, 3.0)),
            offset: 0.5,
        };
        p.substitute(1, &value);
        assert!(!p.contains(1));
        let expected = linear(&[(0, 1.0), (2, 6.0)], 0.0).times(&linear(&[(2, 2.0)], 0.5));
        assert!(p.is_multiple_of(&expected));
        assert_eq!(p, expected);
    }

    #[test]
    fn shortening_cancels_as_many_monomials_as_possible() {
        let p = linear(&[(0, 1.0), (1, 2.0), (2, 4.0), (3, 1.0)], 7.0);
        let pivot = linear(&[(0, 3.0), (1, -1.0), (2, -2.0)], 1.0);
        assert_eq!(p.shortening(&pivot), Some(2.0));
        assert_eq!(p.plus(2.0, &pivot).varying().len(), 2);
        // Cancels one monomial, but brings one in.
        let pivot = linear(&[(0, 1.0), (4, 1.0)], 0.0);
        assert_eq!(p.shortening(&pivot), None);
    }

    #[test]
    fn the_compiled_system_has_the_values_and_derivatives_of_the_polynomials() {
        let p = linear(&[(0, 1.0), (2, -2.0)], 3.0).times(&linear(&[(2, 0.5), (1, 1.0)], 0.0));
        let q = linear(&[(1, 4.0)], -1.0);
        let system = QuadraticSystem::new(4, [&p, &q]);
        let x = [0.3, -1.2, 0.7, 9.0];
        let mut f = [0.0; 2];
        system.residual(&x, &mut f);
        let (a, b): (f64, f64) = (0.3 - 1.4 + 3.0, 0.35 - 1.2);
        assert!((f[0] - a * b).abs() < 1e-15);
        assert!((f[1] - (-5.8)).abs() < 1e-15);
        assert_eq!(system.pattern().row(0), &[0, 1, 2]);
        assert_eq!(system.pattern().row(1), &[1]);
        let mut values = [0.0; 4];
        system.jacobian(&x, &mut values);
        for (value, expected) in values.iter().zip([b, a, -2.0 * b + 0.5 * a, 4.0]) {
            assert!((value - expected).abs() < 1e-15);
        }
    }
}
