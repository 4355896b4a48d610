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

/// The bound or limit that a point breaks the most, with its value.
pub(super) fn broken_limit<M: ImplicitManifold + ?Sized>(
    manifold: &M,
    x: &[f64],
) -> Option<(Border, f64)> {
    let mut worst = (-ROUNDING, None);
    let mut see = |value: f64, border| {
        if value < worst.0 || value.is_nan() {
            worst = (value, Some(border));
        }
    };
    let bounds = manifold.lower_bounds().iter().zip(manifold.upper_bounds());
    for (i, (&x, (&lo, &hi))) in x.iter().zip(bounds).enumerate() {
        see(x - lo, Border::Lower(i));
        see(hi - x, Border::Upper(i));
    }
    let count = manifold.limit_count();
    if count > 0 {
        let mut values = vec![0.0; count];
        manifold.limits(x, &mut values);
        for (i, &value) in values.iter().enumerate() {
            see(value, Border::Limit(i));
        }
    }
    worst.1.map(|border| (border, worst.0))
}
