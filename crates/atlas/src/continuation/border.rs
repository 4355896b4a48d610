//! What ends a component.

use crate::manifold::ImplicitManifold;

/// Limits may be broken by rounding.
const ROUNDING: f64 = 1e-10;

/// What ends the component in some direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum Border {
    /// The lower bound of a variable.
    Lower(usize),
    /// The upper bound of a variable.
    Upper(usize),
    /// A limit g(x) ≥ 0.
    Limit(usize),
    /// A contact.
    Contact(usize),
    /// An obstruction that no contact describes.
    Blocked,
    /// The manifold is singular.
    Singular,
    /// The manifold bends too much for the smallest chart.
    Curvature,
}

impl Border {
    /// The border in words; contacts, which only a validity test knows by name,
    /// by their number.
    pub fn name<M: ImplicitManifold + ?Sized>(self, manifold: &M) -> String {
        match self {
            Self::Lower(i) => format!("the lower bound of {}", manifold.variable_name(i)),
            Self::Upper(i) => format!("the upper bound of {}", manifold.variable_name(i)),
            Self::Limit(i) => manifold.limit_name(i),
            Self::Contact(i) => format!("contact {i}"),
            Self::Blocked => "an obstruction".to_owned(),
            Self::Singular => "a singularity".to_owned(),
            Self::Curvature => "strong curvature".to_owned(),
        }
    }
}

/// Writes the values of all bounds and limits at x, which are not negative where x
/// is within them: for each variable the distances from its bounds, then the limits.
pub(super) fn border_values<M: ImplicitManifold + ?Sized>(
    manifold: &M,
    x: &[f64],
    values: &mut Vec<f64>,
) {
    values.clear();
    let bounds = manifold.lower_bounds().iter().zip(manifold.upper_bounds());
    for (&x, (&lo, &hi)) in x.iter().zip(bounds) {
        values.extend([x - lo, hi - x]);
    }
    let first = values.len();
    values.resize(first + manifold.limit_count(), 0.0);
    manifold.limits(x, &mut values[first..]);
}

/// The bound or limit that is broken the most, by the values of all.
pub(super) fn worst<M: ImplicitManifold + ?Sized>(manifold: &M, values: &[f64]) -> Option<Border> {
    let mut worst = (-ROUNDING, None);
    for (i, &value) in values.iter().enumerate() {
        if value < worst.0 || value.is_nan() {
            worst = (value, Some(i));
        }
    }
    let bounds = 2 * manifold.ambient_dimension();
    worst.1.map(|i| match i {
        i if i >= bounds => Border::Limit(i - bounds),
        i if i % 2 == 0 => Border::Lower(i / 2),
        i => Border::Upper(i / 2),
    })
}

/// The bound or limit that a point breaks the most.
pub(super) fn broken_limit<M: ImplicitManifold + ?Sized>(
    manifold: &M,
    x: &[f64],
) -> Option<Border> {
    let mut values = Vec::new();
    border_values(manifold, x, &mut values);
    worst(manifold, &values)
}
