//! Segment and cylinder with flat ends, with depth.
//!
//! Outside, half the derivative of the squared distance along the segment does not decrease. It is smooth between
//! the parameters where the segment passes a plane of an end or the wall, and a safeguarded Newton iteration finds
//! its zero there (only over a rim; over the wall and over the ends the zero is found directly).
//!
//! Crossing, the shortest translation out is along the axis, or across it (plane distance of the segment from the
//! axis), or perpendicular to the segment over a rim. Seen along the segment, the rim is an ellipse, and the depth
//! is the distance to it from inside (Eberly, "Distance from a Point to an Ellipse, an Ellipsoid, or a
//! Hyperellipsoid", 2013). About 60 ns outside, 150 ns inside.

use nalgebra::{Vector2, Vector3};

use super::{AxisWitness, TOUCHING, across, deepest_along};
use crate::closest::PARALLEL_SINE_SQUARED;

/// `start + s axis` against the cylinder around the third axis with the given radius and half of its height.
#[inline]
pub(crate) fn axis_cylinder(
    start: &Vector3<f64>,
    axis: &Vector3<f64>,
    radius: f64,
    half: f64,
) -> AxisWitness {
    let squared_length = axis.norm_squared();
    let s = Slope::new(start, axis, radius, half).zero();
    let point = start + axis * s;
    let rho = point.xy().norm();
    let outside = (rho - radius).max(0.0);
    let over = point.z - point.z.max(-half).min(half);
    let squared = outside * outside + over * over;
    let reach = TOUCHING * (radius + half);
    if squared <= reach * reach {
        return depth(start, axis, radius, half);
    }
    let distance = squared.sqrt();
    let radial = if outside > 0.0 {
        outside / (rho * distance)
    } else {
        0.0
    };
    let along = if over == 0.0 { 0.0 } else { axis.z * axis.z };
    let turning = if outside > 0.0 {
        let inward = point.xy().dot(&axis.xy());
        (1.0 - radius / rho) * axis.xy().norm_squared() + radius / rho * (inward / rho).powi(2)
    } else {
        0.0
    };
    AxisWitness {
        distance,
        normal: Vector3::new(point.x * radial, point.y * radial, over / distance),
        s,
        unique: along + turning > PARALLEL_SINE_SQUARED * squared_length || squared_length == 0.0,
    }
}

/// Half the derivative of the squared distance along the segment.
struct Slope {
    start: Vector3<f64>,
    axis: Vector3<f64>,
    radius: f64,
    half: f64,
    /// Squared length of the segment seen along the cylinder.
    across: f64,
    /// Inner product of start and segment seen along the cylinder.
    inward: f64,
}

impl Slope {
    #[inline]
    fn new(start: &Vector3<f64>, axis: &Vector3<f64>, radius: f64, half: f64) -> Self {
        Self {
            start: *start,
            axis: *axis,
            radius,
            half,
            across: axis.xy().norm_squared(),
            inward: start.xy().dot(&axis.xy()),
        }
    }

    /// Value and derivative.
    #[inline]
    fn at(&self, s: f64) -> (f64, f64) {
        let z = self.start.z + s * self.axis.z;
        let over = z - z.max(-self.half).min(self.half);
        let mut value = self.axis.z * over;
        let mut derivative = if over == 0.0 {
            0.0
        } else {
            self.axis.z * self.axis.z
        };
        let rho = (self.start.xy() + self.axis.xy() * s).norm();
        if rho > self.radius {
            let approach = self.inward + s * self.across;
            let ratio = self.radius / rho;
            value += approach * (1.0 - ratio);
            derivative += self.across * (1.0 - ratio) + ratio * (approach / rho).powi(2);
        }
        (value, derivative)
    }

    /// The middle of the range in `[0, 1]` where the slope is zero, or the end where the distance is least.
    #[inline]
    fn zero(&self) -> f64 {
        let (mut low, mut high) = (0.0, 1.0);
        let (mut value_low, mut value_high) = (self.at(low).0, self.at(high).0);
        if value_low > 0.0 {
            return 0.0;
        }
        if value_high < 0.0 {
            return 1.0;
        }
        let mut zeros = (f64::INFINITY, f64::NEG_INFINITY);
        if value_low == 0.0 {
            zeros = (0.0, 0.0);
        }
        if value_high == 0.0 {
            zeros = (zeros.0.min(1.0), 1.0);
        }
        let mut visit = |s: f64| {
            if s > low && s < high {
                let (value, _) = self.at(s);
                if value < 0.0 {
                    (low, value_low) = (s, value);
                } else if value > 0.0 {
                    (high, value_high) = (s, value);
                } else {
                    zeros = (zeros.0.min(s), zeros.1.max(s));
                }
            }
        };
        if self.axis.z != 0.0 {
            visit((self.half - self.start.z) / self.axis.z);
            visit((-self.half - self.start.z) / self.axis.z);
        }
        if self.across > 0.0 {
            let foot = -self.inward / self.across;
            visit(foot);
            let least = self.start.xy().norm_squared() - self.inward * self.inward / self.across;
            let wall = self.radius * self.radius - least;
            if wall > 0.0 {
                let reach = (wall / self.across).sqrt();
                visit(foot - reach);
                visit(foot + reach);
            }
        }
        if zeros.0 <= zeros.1 {
            return 0.5 * (zeros.0 + zeros.1);
        }
        let mut s = low - value_low * (high - low) / (value_high - value_low);
        for _ in 0..60 {
            let (value, derivative) = self.at(s);
            if value < 0.0 {
                low = s;
            } else {
                high = s;
            }
            let newton = s - value / derivative;
            let next = if newton > low && newton < high {
                newton
            } else {
                0.5 * (low + high)
            };
            let change = (next - s).abs();
            s = next;
            if change <= 1e-15 {
                break;
            }
        }
        s
    }
}

#[cold]
fn depth(start: &Vector3<f64>, axis: &Vector3<f64>, radius: f64, half: f64) -> AxisWitness {
    let end = start + axis;
    let squared_length = axis.norm_squared();

    // Out through an end.
    let (up, down) = (start.z.min(end.z) - half, -start.z.max(end.z) - half);
    let sign = if up >= down { 1.0 } else { -1.0 };
    let normal = Vector3::z() * sign;
    let (s, unique) = deepest_along(&normal, axis, squared_length);
    let mut best = AxisWitness {
        distance: up.max(down),
        normal,
        s,
        unique,
    };
    let mut second = up.min(down);
    let mut challenge = |candidate: AxisWitness| {
        second = second.max(best.distance.min(candidate.distance));
        if candidate.distance > best.distance {
            best = candidate;
        }
    };

    // Out through the wall, across the axis of the cylinder.
    let flat = axis.xy();
    let s = if flat.norm_squared() > 0.0 {
        (-start.xy().dot(&flat) / flat.norm_squared()).clamp(0.0, 1.0)
    } else {
        0.5
    };
    let point = start.xy() + flat * s;
    let rho = point.norm();
    let centred = rho <= TOUCHING * radius;
    let normal = if centred {
        let normal = across(&Vector3::new(flat.x, flat.y, 0.0), &Vector3::zeros());
        Vector2::new(normal.x, normal.y).normalize()
    } else {
        point / rho
    };
    challenge(AxisWitness {
        distance: rho - radius,
        normal: Vector3::new(normal.x, normal.y, 0.0),
        s,
        unique: !centred
            && (squared_length == 0.0
                || flat.norm_squared() > PARALLEL_SINE_SQUARED * squared_length),
    });

    if let Some(candidate) = over_rim(start, axis, radius, half) {
        challenge(candidate);
    }
    best.unique &= best.distance - second > 1e-9 * (radius + half);
    best
}

/// Out over a rim, perpendicular to the segment.
fn over_rim(
    start: &Vector3<f64>,
    axis: &Vector3<f64>,
    radius: f64,
    half: f64,
) -> Option<AxisWitness> {
    let length = axis.norm();
    let (sine, cosine) = (axis.xy().norm() / length, axis.z.abs() / length);
    let minor = radius * cosine;
    // Along the cylinder or flat across it (or a point): the rim adds nothing to end and wall.
    if !(sine > 1e-9 && cosine > 1e-9) {
        return None;
    }
    let unit = axis / length;
    let level = unit.cross(&Vector3::z()) / sine;
    let steep = level.cross(&unit);
    let (u, w) = (level.dot(start), steep.dot(start));
    let normal = ellipse_normal(radius, minor, u.abs(), w.abs() - half * sine)?;
    let normal = level * normal.x.copysign(u) + steep * normal.y.copysign(w);
    let flat = normal.xy().norm();
    let distance =
        normal.dot(start).min(normal.dot(&(start + axis))) - radius * flat - half * normal.z.abs();
    let around = if flat > 0.0 {
        normal.xy() * (radius / flat)
    } else {
        Vector2::zeros()
    };
    let rim = Vector3::new(around.x, around.y, half.copysign(normal.z));
    Some(AxisWitness {
        distance,
        normal,
        s: ((rim - start).dot(axis) / (length * length)).clamp(0.0, 1.0),
        unique: true,
    })
}

/// Outward unit normal at the point, in the first quadrant, of the ellipse with semi-axes `major` and `minor` that is
/// nearest to the inner point (u, v), u ≥ 0. For v < 0 there may be none: then the wall is nearer.
///
/// The nearest point is (major² u / (major² − λ), minor² v / (minor² − λ)); λ solves
/// G = (major u / (major² − λ))² + (minor v / (minor² − λ))² − 1 = 0. G is convex between its poles, so Newton's
/// iteration started where G ≥ 0 moves one way.
fn ellipse_normal(major: f64, minor: f64, u: f64, v: f64) -> Option<Vector2<f64>> {
    let (mm, nn) = (major * major, minor * minor);
    // On the major axis both poles meet the point; step off it by less than rounding can show.
    let v = if v.abs() < 1e-12 * minor {
        1e-12 * minor
    } else {
        v
    };
    let mut lambda = if v > 0.0 {
        (nn - minor * v).min(mm - major * u)
    } else {
        nn - minor * v
    };
    for _ in 0..60 {
        let (p, q) = (mm - lambda, nn - lambda);
        if p <= 0.0 {
            return None;
        }
        let (x, y) = (major * u / p, minor * v / q);
        let value = x * x + y * y - 1.0;
        let derivative = 2.0 * (x * x / p + y * y / q);
        if v < 0.0 && derivative >= 0.0 {
            return None;
        }
        let step = if derivative == 0.0 {
            0.0
        } else {
            value / derivative
        };
        lambda -= step;
        if step.abs() <= 1e-15 * mm {
            break;
        }
    }
    // The normal at (X, Y) is (X / major², Y / minor²).
    Vector2::new(u / (mm - lambda), v / (nn - lambda)).try_normalize(0.0)
}
