//! What manifolds and points of users must be: checked before anything is built
//! on them.

use crate::{error::ManifoldError, manifold::ImplicitManifold, newton::largest};

/// Whether `x` is a point of the manifold, to residuals of at most 10⁻⁶, and the
/// manifold is of one piece there: as many bounds and columns as variables, as many
/// rows as equations, derivatives that are numbers.
///
/// # Errors
/// [`ManifoldError`] with the count, coordinate, residual or derivative that says
/// otherwise.
pub fn on_manifold<M: ImplicitManifold + ?Sized>(
    manifold: &M,
    x: &[f64],
) -> Result<(), ManifoldError> {
    const TOLERANCE: f64 = 1e-6;
    let (m, n) = (manifold.ambient_dimension(), manifold.equation_count());
    if x.len() != m {
        return Err(ManifoldError::WrongLength {
            found: x.len(),
            expected: m,
        });
    }
    let pattern = manifold.jacobian_pattern();
    for (what, found, expected) in [
        ("lower bounds", manifold.lower_bounds().len(), m),
        ("upper bounds", manifold.upper_bounds().len(), m),
        ("columns of the Jacobian's pattern", pattern.columns(), m),
        ("rows of the Jacobian's pattern", pattern.rows(), n),
    ] {
        if found != expected {
            return Err(ManifoldError::WrongCount {
                what,
                found,
                expected,
            });
        }
    }
    if let Some((index, &value)) = x.iter().enumerate().find(|(_, v)| !v.is_finite()) {
        return Err(ManifoldError::NotFinite { index, value });
    }
    let mut residual = vec![0.0; n];
    manifold.residual(x, &mut residual);
    let (equation, residual) = largest(&residual);
    if residual.is_nan() || residual > TOLERANCE {
        return Err(ManifoldError::NotOnManifold { residual, equation });
    }
    let mut values = vec![0.0; pattern.len()];
    manifold.jacobian(x, &mut values);
    let wrong = values.iter().position(|value| !value.is_finite());
    wrong.map_or(Ok(()), |entry| {
        let equation = (0..n).find(|&row| pattern.row_range(row).contains(&entry));
        let equation = equation.unwrap_or(0);
        let variable = pattern.row(equation)[entry - pattern.row_range(equation).start];
        Err(ManifoldError::Derivative {
            equation,
            variable,
            value: values[entry],
        })
    })
}

/// Compares the Jacobian with central differences of the equations at `x`, entries
/// outside of its pattern included: for tests of a manifold of your own. Costs 2 m
/// residuals for m variables.
///
/// # Errors
/// What [`on_manifold`] finds (x need not be on the manifold), or
/// [`ManifoldError::WrongDerivative`] for the entry that is off the most.
///
/// # Examples
/// ```
/// # use tensegra_atlas::{check_jacobian, doc::Sphere};
/// check_jacobian(&Sphere::new(), &[0.2, -0.5, 0.9])?;
/// # Ok::<(), tensegra_atlas::ManifoldError>(())
/// ```
pub fn check_jacobian<M: ImplicitManifold + ?Sized>(
    manifold: &M,
    x: &[f64],
) -> Result<(), ManifoldError> {
    /// Step of the differences, and what they may be off, relative to one or to the
    /// derivative where that is larger.
    const STEP: f64 = 1e-6;
    const TOLERANCE: f64 = 1e-5;
    match on_manifold(manifold, x) {
        Ok(()) | Err(ManifoldError::NotOnManifold { .. }) => {}
        Err(error) => return Err(error),
    }
    let pattern = manifold.jacobian_pattern();
    let n = manifold.equation_count();
    let mut values = vec![0.0; pattern.len()];
    manifold.jacobian(x, &mut values);
    let [mut above, mut below] = [vec![0.0; n], vec![0.0; n]];
    let mut y = x.to_vec();
    let mut worst = TOLERANCE;
    let mut verdict = Ok(());
    for variable in 0..x.len() {
        let step = STEP * x[variable].abs().max(1.0);
        y[variable] = x[variable] + step;
        manifold.residual(&y, &mut above);
        y[variable] = x[variable] - step;
        manifold.residual(&y, &mut below);
        y[variable] = x[variable];
        for equation in 0..n {
            let entry = pattern.find(equation, variable);
            let stated = entry.map_or(0.0, |entry| values[entry]);
            let difference = (above[equation] - below[equation]) / (2.0 * step);
            let off = (stated - difference).abs() / difference.abs().max(1.0);
            if off.is_nan() || off > worst {
                worst = off;
                verdict = Err(ManifoldError::WrongDerivative {
                    equation,
                    variable,
                    stated,
                    difference,
                });
            }
        }
    }
    verdict
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{doc::Sphere, manifold::SparsityPattern};

    /// A sphere with one thing wrong.
    struct Flawed {
        sphere: Sphere,
        flaw: Flaw,
    }

    #[derive(Clone, Copy, PartialEq)]
    enum Flaw {
        Residual,
        NanDerivative,
        Sign,
        Bounds,
    }

    impl ImplicitManifold for Flawed {
        fn ambient_dimension(&self) -> usize {
            3
        }
        fn equation_count(&self) -> usize {
            1
        }
        fn residual(&self, x: &[f64], residual: &mut [f64]) {
            self.sphere.residual(x, residual);
            if self.flaw == Flaw::Residual {
                residual[0] = f64::NAN;
            }
        }
        fn jacobian_pattern(&self) -> &SparsityPattern {
            self.sphere.jacobian_pattern()
        }
        fn jacobian(&self, x: &[f64], values: &mut [f64]) {
            self.sphere.jacobian(x, values);
            match self.flaw {
                Flaw::NanDerivative => values[1] = f64::NAN,
                Flaw::Sign => values[2] = -values[2],
                _ => {}
            }
        }
        fn lower_bounds(&self) -> &[f64] {
            let bounds = self.sphere.lower_bounds();
            &bounds[usize::from(self.flaw == Flaw::Bounds)..]
        }
        fn upper_bounds(&self) -> &[f64] {
            self.sphere.upper_bounds()
        }
    }

    const POINT: [f64; 3] = [0.0, 0.6, 0.8];

    #[test]
    fn points_off_the_manifold_are_told_apart() {
        let sphere = Sphere::new();
        assert_eq!(on_manifold(&sphere, &POINT), Ok(()));
        for (x, message) in [
            (&[0.0, 0.6][..], "2 coordinates"),
            (&[0.0, f64::NAN, 0.8], "coordinate 1"),
            (&[0.0, 0.6, 0.9], "equation 0"),
        ] {
            let error = on_manifold(&sphere, x).unwrap_err().to_string();
            assert!(error.contains(message), "{error}");
        }
    }

    #[test]
    fn flaws_of_a_manifold_are_named() {
        let verdict = |flaw| {
            let sphere = Sphere::new();
            check_jacobian(&Flawed { sphere, flaw }, &POINT).map_err(|error| error.to_string())
        };
        for (flaw, message) in [
            (Flaw::NanDerivative, "equation 0 by variable 1 is NaN"),
            (Flaw::Sign, "equation 0 by variable 2"),
            (Flaw::Bounds, "2 lower bounds"),
            (Flaw::Residual, "NaN"),
        ] {
            let error = verdict(flaw).unwrap_err();
            assert!(error.contains(message), "{error}");
        }
    }
}
