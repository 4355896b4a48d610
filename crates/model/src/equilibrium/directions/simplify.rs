//! Removal of variables and equations that have a closed form.
//!
//! The steps, until none applies:
//! 1. A variable whose range is one value is that value. An equation that is
//!    linear in one or two variables, c₁ x₁ + c₂ x₂ + c₀ = 0, is solved for the
//!    later one, which is substituted everywhere.
//! 2. A product that must vanish, c x y = 0, gives y = 0 where the range of x
//!    excludes zero.
//! 3. Equations that hold for all values, and multiples of other equations, are
//!    dropped.
//! 4. Gaussian elimination as far as it shortens: with each equation as pivot in
//!    turn, a multiple of it is added to every other equation that is left with
//!    fewer monomials by that. It finds equations for the first two steps that
//!    several equations imply together.
//!
//! The sums of Porta and Hernández-Juan (2016), table 1, follow from these. Each
//! step keeps the set of solutions; equations that are redundant for other
//! reasons (equilibrium of the whole structure, say) remain. Cost: a few sweeps
//! over all pairs of equations.

use super::{
    polynomial::{Affine, Polynomial},
    raw::{Equation, RawVariable},
};
use crate::{equilibrium::EquilibriumError, structure::Interval};

/// Constants left over below this, relative to the coefficients of their
/// equation, are rounding errors of the numbers that describe the structure.
const CONTRADICTION: f64 = 1e-9;

/// What is left after simplification.
#[derive(Clone, Debug)]
pub(super) struct Simplified {
    /// Every variable before in terms of the variables after.
    pub(super) values: Vec<Affine>,
    /// The variable before that each variable after is.
    pub(super) kept: Vec<usize>,
    /// Equations in the variables after.
    pub(super) equations: Vec<Polynomial>,
}

/// Simplifies a system.
pub(super) fn simplify(
    variables: &[RawVariable],
    equations: Vec<Equation>,
) -> Result<Simplified, EquilibriumError> {
    let mut system = Simplifier {
        variables,
        values: (0..variables.len()).map(Affine::variable).collect(),
        equations: equations
            .into_iter()
            .map(|equation| Scaled {
                magnitude: equation.polynomial.magnitude().max(f64::MIN_POSITIVE),
                equation,
            })
            .collect(),
    };
    for (i, variable) in variables.iter().enumerate() {
        if variable.range.is_constant() {
            system.substitute(i, &Affine::constant(variable.range.lo));
        }
    }
    loop {
        system.substitute_all()?;
        system.drop_multiples();
        if !system.shorten() {
            break;
        }
    }
    Ok(system.finish())
}

/// An equation, with its largest coefficient before simplification.
struct Scaled {
    equation: Equation,
    magnitude: f64,
}

impl Scaled {
    fn polynomial(&self) -> &Polynomial {
        &self.equation.polynomial
    }
}

struct Simplifier<'a> {
    variables: &'a [RawVariable],
    /// Every variable in terms of those not yet substituted.
    values: Vec<Affine>,
    equations: Vec<Scaled>,
}

impl Simplifier<'_> {
    fn substitute(&mut self, variable: usize, value: &Affine) {
        for other in &mut self.values {
            other.substitute(variable, value);
        }
        for scaled in &mut self.equations {
            scaled.equation.polynomial.substitute(variable, value);
        }
    }

    /// Steps 1 and 2, and dropping of what holds for all values.
    fn substitute_all(&mut self) -> Result<(), EquilibriumError> {
        self.drop_trivial()?;
        while let Some((equation, variable, value)) = self
            .equations
            .iter()
            .enumerate()
            .find_map(|(i, scaled)| self.solve(scaled.polynomial()).map(|(x, v)| (i, x, v)))
        {
            self.equations.remove(equation);
            self.substitute(variable, &value);
            self.drop_trivial()?;
        }
        Ok(())
    }

    /// The variable that an equation determines by itself, and its value.
    fn solve(&self, equation: &Polynomial) -> Option<(usize, Affine)> {
        let offset = equation.constant_term();
        match *equation.varying() {
            [(x, c)] => match (x.as_variable(), x.as_product()) {
                (Some(x), _) => Some((x, Affine::constant(-offset / c))),
                (None, Some([x, y])) if offset == 0.0 && x != y => {
                    let zero = |v: usize| self.variables[v].range.margin(0.0) >= 0.0;
                    match (zero(x), zero(y)) {
                        (true, false) => Some((x, Affine::constant(0.0))),
                        (false, true) => Some((y, Affine::constant(0.0))),
                        _ => None,
                    }
                }
                _ => None,
            },
            [(x, c), (y, d)] => {
                let (x, y) = (x.as_variable()?, y.as_variable()?);
                let value = Affine {
                    variable: Some((x, -c / d)),
                    offset: -offset / d,
                };
                Some((y, value))
            }
            _ => None,
        }
    }

    fn drop_trivial(&mut self) -> Result<(), EquilibriumError> {
        for scaled in &self.equations {
            let rest = scaled.polynomial().constant_term().abs();
            let trivial = scaled.polynomial().varying().is_empty();
            if trivial && rest > CONTRADICTION * scaled.magnitude {
                return Err(EquilibriumError::Contradiction {
                    what: format!("the equations for the {}", scaled.equation.statement),
                    by: rest,
                });
            }
        }
        self.equations
            .retain(|scaled| !scaled.polynomial().varying().is_empty());
        Ok(())
    }

    fn drop_multiples(&mut self) {
        let mut kept: Vec<Scaled> = Vec::with_capacity(self.equations.len());
        for scaled in self.equations.drain(..) {
            let polynomial = scaled.polynomial();
            if !kept
                .iter()
                .any(|k| polynomial.is_multiple_of(k.polynomial()))
            {
                kept.push(scaled);
            }
        }
        self.equations = kept;
    }

    /// One sweep of step 4; whether it changed anything.
    fn shorten(&mut self) -> bool {
        let mut changed = false;
        for pivot in 0..self.equations.len() {
            let row = self.equations[pivot].polynomial().clone();
            for (i, other) in self.equations.iter_mut().enumerate() {
                if i == pivot {
                    continue;
                }
                if let Some(factor) = other.polynomial().shortening(&row) {
                    other.equation.polynomial = other.polynomial().plus(factor, &row);
                    changed = true;
                }
            }
        }
        changed
    }

    fn finish(self) -> Simplified {
        let kept: Vec<usize> = (0..self.values.len())
            .filter(|&i| self.values[i] == Affine::variable(i))
            .collect();
        let mut number = vec![0; self.values.len()];
        for (new, &old) in kept.iter().enumerate() {
            number[old] = new;
        }
        let values = self
            .values
            .into_iter()
            .map(|value| Affine {
                variable: value.variable.map(|(i, scale)| (number[i], scale)),
                ..value
            })
            .collect();
        let equations = self
            .equations
            .into_iter()
            .map(|scaled| scaled.equation.polynomial.renumbered(&number))
            .collect();
        Simplified {
            values,
            kept,
            equations,
        }
    }
}

/// The values of x for which scale · x + offset lies in a range.
pub(super) fn range_of_argument(range: Interval, scale: f64, offset: f64) -> Interval {
    let ends = [(range.lo - offset) / scale, (range.hi - offset) / scale];
    Interval::new(ends[0].min(ends[1]), ends[0].max(ends[1]))
}
