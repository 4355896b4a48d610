//! Two segments: the closest points of the two lines, clamped one after the other (Ericson, "Real-Time Collision
//! Detection", 2005, section 5.1.9).
//!
//! The parameter on the first line comes from cross products instead of the determinant `aa bb − ab²`: the
//! determinant loses all digits at an angle of 1e-8, the cross products only half of them, and what they lose does
//! not show in the distance. No branch but for parallels; about 10 ns.

use nalgebra::{Point3, Vector3};

use super::{ClosestPoints, PARALLEL_SINE_SQUARED};

/// Below this squared sine the common perpendicular is noise, and the segments are treated as exactly parallel.
const EXACTLY_PARALLEL: f64 = 1e-28;

/// The closest points of the segments from `a0` to `a1` (parameter `s`) and from `b0` to `b1` (parameter `t`).
///
/// Segments of length zero are points. Where parallel segments run side by side, the middle of the common part is
/// returned and `unique` is false.
///
/// ```
/// use nalgebra::Point3;
/// use tensegra_collision::closest_points_segment_segment;
///
/// let pair = closest_points_segment_segment(
///     &Point3::new(-1.0, 0.0, 0.0),
///     &Point3::new(1.0, 0.0, 0.0),
///     &Point3::new(0.5, -1.0, 2.0),
///     &Point3::new(0.5, 3.0, 2.0),
/// );
/// assert_eq!((pair.s, pair.t), (0.75, 0.25));
/// assert_eq!(pair.distance(), 2.0);
/// ```
#[inline]
#[must_use]
pub fn closest_points_segment_segment(
    a0: &Point3<f64>,
    a1: &Point3<f64>,
    b0: &Point3<f64>,
    b1: &Point3<f64>,
) -> ClosestPoints {
    let (da, db, offset) = (a1 - a0, b1 - b0, b0 - a0);
    let (aa, bb) = (da.norm_squared(), db.norm_squared());
    let common = da.cross(&db);
    let sine = common.norm_squared();
    let (s, t, unique) = if sine > PARALLEL_SINE_SQUARED * aa * bb {
        let s = offset.cross(&db).dot(&common) / sine;
        let (s, t) = alternate(s, aa, bb, &da, &db, &offset);
        (s, t, true)
    } else {
        nearly_parallel(aa, bb, sine, &da, &db, &offset, &common)
    };
    ClosestPoints {
        on_a: a0 + da * s,
        on_b: b0 + db * t,
        s,
        t,
        unique,
    }
}

/// The nearest point of A's line, clamped, its nearest on B, clamped, and the nearest to that on A again. The last
/// step changes something only where B was clamped; to take it always costs less than to ask.
#[inline(always)]
fn alternate(
    s: f64,
    aa: f64,
    bb: f64,
    da: &Vector3<f64>,
    db: &Vector3<f64>,
    offset: &Vector3<f64>,
) -> (f64, f64) {
    // Off the critical path: ready before `s` is.
    let (inverse_aa, inverse_bb) = (1.0 / aa, 1.0 / bb);
    let (ab, a_offset, b_offset) = (da.dot(db), da.dot(offset), db.dot(offset));
    let s = s.clamp(0.0, 1.0);
    let t = ((ab * s - b_offset) * inverse_bb).clamp(0.0, 1.0);
    let s = ((ab * t + a_offset) * inverse_aa).clamp(0.0, 1.0);
    (s, t)
}

/// Parallel, nearly parallel and point-like segments.
#[cold]
fn nearly_parallel(
    aa: f64,
    bb: f64,
    sine: f64,
    da: &Vector3<f64>,
    db: &Vector3<f64>,
    offset: &Vector3<f64>,
    common: &Vector3<f64>,
) -> (f64, f64, bool) {
    if aa == 0.0 || bb == 0.0 {
        let s = if aa > 0.0 {
            (da.dot(offset) / aa).clamp(0.0, 1.0)
        } else {
            0.0
        };
        let t = if bb > 0.0 {
            (-db.dot(offset) / bb).clamp(0.0, 1.0)
        } else {
            0.0
        };
        return (s, t, true);
    }
    // The range of A's parameter that runs beside B.
    let (p, q) = (da.dot(offset) / aa, (da.dot(offset) + da.dot(db)) / aa);
    let (low, high) = (p.min(q).clamp(0.0, 1.0), p.max(q).clamp(0.0, 1.0));
    let s = if sine > EXACTLY_PARALLEL * aa * bb {
        offset.cross(db).dot(common) / sine
    } else {
        0.5 * (low + high)
    };
    let (s, t) = alternate(s, aa, bb, da, db, offset);
    (s, t, high - low <= 1e-9)
}
