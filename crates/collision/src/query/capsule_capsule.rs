//! Two capsules: the distance of their axes less the radii.
//!
//! For axes that touch or cross, the clearance is `-(ra + rb)` along the common perpendicular: the shortest
//! translation that separates the capsules. About 15 ns.

use nalgebra::{Point3, Vector3};

use super::TOUCHING;
use crate::{Capsule, Contact, closest_points_segment_segment};

/// Clearance between two capsules: exact, and exact as a depth (the shortest translation that separates them).
///
/// Where the axes touch or cross, or the capsules are balls with one centre, the normal is their common
/// perpendicular (any perpendicular of parallel axes, any direction for balls) and [`Contact::unique`] is false.
///
/// ```
/// use nalgebra::Point3;
/// use tensegra_collision::{Capsule, capsule_capsule};
///
/// let bar = Capsule::new(Point3::new(-1.0, 0.0, 0.0), Point3::new(1.0, 0.0, 0.0), 0.1)?;
/// let cable = Capsule::new(Point3::new(0.0, -1.0, 1.0), Point3::new(0.0, 1.0, 1.0), 0.2)?;
/// let contact = capsule_capsule(&bar, &cable);
/// assert!((contact.clearance - 0.7).abs() < 1e-15);
/// assert_eq!(contact.normal.z, -1.0); // from the cable towards the bar
/// # Ok::<(), tensegra_collision::ShapeError>(())
/// ```
#[inline]
#[must_use]
pub fn capsule_capsule(a: &Capsule, b: &Capsule) -> Contact {
    let pair = closest_points_segment_segment(&a.a, &a.b, &b.a, &b.b);
    let apart = pair.on_a - pair.on_b;
    let squared = apart.norm_squared();
    let reach = TOUCHING * TOUCHING * (a.axis().norm_squared() + b.axis().norm_squared());
    let (distance, normal, unique) = if squared > reach {
        // Root and quotient do not wait for each other.
        let distance = squared.sqrt();
        (distance, apart * (distance * (1.0 / squared)), pair.unique)
    } else {
        (0.0, perpendicular_of_both(a, b), false)
    };
    Contact {
        clearance: distance - a.radius - b.radius,
        normal,
        on_a: pair.on_a - normal * a.radius,
        on_b: pair.on_b + normal * b.radius,
        s: pair.s,
        t: pair.t,
        unique,
    }
}

/// A lower bound on the clearance that [`capsule_capsule`] finds: the distance of the middles less half lengths and
/// radii.
#[inline]
#[must_use]
pub fn capsule_capsule_lower_bound(a: &Capsule, b: &Capsule) -> f64 {
    let middles = 0.5 * ((a.a - b.a) + (a.b - b.b)).norm();
    middles - 0.5 * (a.axis().norm() + b.axis().norm()) - a.radius - b.radius
}

/// A unit vector across both axes, turned towards the middle of A.
#[cold]
fn perpendicular_of_both(a: &Capsule, b: &Capsule) -> Vector3<f64> {
    let (da, db) = (a.axis(), b.axis());
    let middle = |c: &Capsule| Point3::from((c.a.coords + c.b.coords) * 0.5);
    let between = middle(a) - middle(b);
    let common = da.cross(&db);
    let scale = da.norm() * db.norm();
    let normal = if common.norm() > 1e-12 * scale {
        common.normalize()
    } else {
        across(
            if da.norm_squared() >= db.norm_squared() {
                &da
            } else {
                &db
            },
            &between,
        )
    };
    if normal.dot(&between) < 0.0 {
        -normal
    } else {
        normal
    }
}

/// A unit vector perpendicular to `axis`, along `towards` where that has a component across the axis. Without an
/// axis, a direction along `towards` or, failing that, x.
pub(crate) fn across(axis: &Vector3<f64>, towards: &Vector3<f64>) -> Vector3<f64> {
    let Some(unit) = axis.try_normalize(0.0) else {
        return towards.try_normalize(0.0).unwrap_or_else(Vector3::x);
    };
    let part = towards - unit * unit.dot(towards);
    if part.norm_squared() > 1e-16 * towards.norm_squared() {
        return part.normalize();
    }
    // The coordinate axis that is farthest from being parallel: the cross product is at least 0.8 long.
    let mut pick = Vector3::zeros();
    pick[unit.iamin()] = 1.0;
    unit.cross(&pick).normalize()
}
