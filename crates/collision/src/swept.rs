//! Proofs of clearance over a whole motion, not only at samples of it.
//!
//! The ends of a capsule move linearly between two instants. A plane that has a convex obstacle on one side and all
//! ends, at an instant, with the radius to spare, on the other, proves the clearance there; and since the ends move
//! linearly, the clearance over one plane is a concave, piecewise linear function of time: the plane proves it over
//! a whole interval, whose ends have closed forms. The witness normals of the start and of the end are tried first,
//! and what their intervals leave open is halved. Planes that have all ends on one side at all times (sliding along
//! a wall) prove the whole motion at once, at any distance.
//!
//! Two capsules are treated alike, through the differences of their ends at the same instant. The surface of a mesh is
//! treated triangle by triangle, those far from the motion left out box by box.
//!
//! The planes are checked against the extent of the whole obstacle, not derived from witness points, so that a proof
//! rests on a few sums of products and is right to some 1e-15 of the coordinates. Cost: two to four clearance queries
//! where there is room.

use std::cell::Cell;

use nalgebra::{Point3, Vector3};

use crate::mesh::{Mesh, Triangle, axis_mesh, box_of};
use crate::solid::Shape;
use crate::{
    Capsule, Solid, capsule_capsule, capsule_solid, clearance_lower_bound,
    closest_points_segment_triangle,
};

/// How often an interval of time is halved.
const MAX_DEPTH: u32 = 12;

/// Outcome of a continuous test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Certificate {
    /// Proven: at every instant the clearance is at least `clearance`, which is at least the slack asked for.
    Clear {
        /// Lower bound on the clearance over the whole motion.
        clearance: f64,
    },
    /// Not proven. Either there is less clearance than the slack at some instant, or it is so close to the slack that
    /// the search gave up.
    Undecided,
}

impl Certificate {
    /// Whether the clearance was proven.
    #[inline]
    #[must_use]
    pub fn is_clear(&self) -> bool {
        matches!(self, Self::Clear { .. })
    }

    #[inline]
    fn of(bound: Option<f64>) -> Self {
        bound.map_or(Self::Undecided, |clearance| Self::Clear { clearance })
    }
}

/// A lower bound on a clearance between two instants at which it is `start` and `end`, for bodies of which no two
/// points move towards each other by more than `displacement` in between, at constant speed.
///
/// ```
/// use tensegra_collision::swept::displacement_bound;
/// assert_eq!(displacement_bound(0.5, 0.25, 0.125), 0.25);
/// assert_eq!(displacement_bound(0.5, 0.25, 0.5), 0.125);
/// ```
#[inline]
#[must_use]
pub fn displacement_bound(start: f64, end: f64, displacement: f64) -> f64 {
    start.min(end).min(0.5 * (start + end - displacement))
}

/// Proves that a capsule whose ends move linearly, from those of `start` to those of `end`, keeps at least `slack`
/// from a solid all the way. The radius is the larger of the two.
///
/// Give as slack the clearance that is wanted plus the most that any point of the true motion deviates from the
/// linear one. A negative slack allows penetration up to that depth; for a mesh it must stay above minus the radius.
///
/// ```
/// use nalgebra::{Point3, Vector3};
/// use tensegra_collision::{Capsule, Solid, swept::{Certificate, swept_capsule_solid}};
///
/// let ball = Solid::sphere(Point3::origin(), 1.0)?;
/// let at = |x: f64, y: f64| Capsule {
///     a: Point3::new(x, y, -1.0),
///     b: Point3::new(x, y, 1.0),
///     radius: 0.1,
/// };
/// // Past the ball, with 0.4 to spare; and through it, with both ends of the motion free.
/// assert!(swept_capsule_solid(&at(-5.0, 1.5), &at(5.0, 1.5), &ball, 0.39).is_clear());
/// assert_eq!(swept_capsule_solid(&at(-5.0, 0.5), &at(5.0, 0.5), &ball, 0.0), Certificate::Undecided);
/// # Ok::<(), tensegra_collision::ShapeError>(())
/// ```
#[must_use]
pub fn swept_capsule_solid(
    start: &Capsule,
    end: &Capsule,
    solid: &Solid,
    slack: f64,
) -> Certificate {
    let motion = Motion::new(start, end);
    // Far away: the capsule with twice the ends, as one body.
    let culled = motion.culling_bound(solid);
    if culled >= slack {
        return Certificate::Clear { clearance: culled };
    }
    match &solid.shape {
        Shape::Capsule(other) => {
            let other = Motion::new(other, other);
            Certificate::of(prove(&|time| pair_wedge(&motion, &other, time), slack))
        }
        Shape::HalfSpace(plane) => {
            // Heights over a plane are linear: the least is at an end, at the start or at the end.
            let least = motion
                .points()
                .map(|p| plane.height(&p))
                .into_iter()
                .fold(f64::INFINITY, f64::min);
            let clearance = least - motion.radius;
            Certificate::of((clearance >= slack).then_some(clearance))
        }
        Shape::Mesh(mesh) => Certificate::of(prove_mesh(&motion, mesh, slack)),
        _ => {
            let wedge = |time: f64| {
                let normal = capsule_solid(&motion.at(time), solid).normal;
                let beyond = solid.extent(&normal) + motion.radius;
                Wedge::of_plane(time, &motion, &normal, beyond)
            };
            Certificate::of(prove(&wedge, slack))
        }
    }
}

/// Proves that two capsules whose ends move linearly, at the same time, keep at least `slack` from each other all the
/// way. Radius and slack as in [`swept_capsule_solid`].
#[must_use]
pub fn swept_capsule_capsule(
    start_a: &Capsule,
    end_a: &Capsule,
    start_b: &Capsule,
    end_b: &Capsule,
    slack: f64,
) -> Certificate {
    let (a, b) = (Motion::new(start_a, end_a), Motion::new(start_b, end_b));
    Certificate::of(prove(&|time| pair_wedge(&a, &b, time), slack))
}

/// A capsule in linear motion.
struct Motion {
    a: [Point3<f64>; 2],
    b: [Point3<f64>; 2],
    radius: f64,
}

impl Motion {
    fn new(start: &Capsule, end: &Capsule) -> Self {
        Self {
            a: [start.a, end.a],
            b: [start.b, end.b],
            radius: start.radius.max(end.radius),
        }
    }

    fn at(&self, time: f64) -> Capsule {
        let between = |[from, to]: [Point3<f64>; 2]| from + (to - from) * time;
        Capsule {
            a: between(self.a),
            b: between(self.b),
            radius: self.radius,
        }
    }

    fn points(&self) -> [Point3<f64>; 4] {
        [self.a[0], self.a[1], self.b[0], self.b[1]]
    }

    /// The middle of the four points is never farther from one of the axis than the farthest of the four.
    fn culling_bound(&self, solid: &Solid) -> f64 {
        let points = self.points();
        let middle = Point3::from(points.iter().map(|p| p.coords).sum::<Vector3<f64>>() * 0.25);
        let reach = points
            .iter()
            .map(|p| (p - middle).norm())
            .fold(0.0, f64::max);
        let ball = Capsule {
            a: middle,
            b: middle,
            radius: reach + self.radius,
        };
        clearance_lower_bound(&ball, solid)
    }
}

/// The clearance over one plane as a function of time: the least of up to four linear functions.
#[derive(Clone, Copy)]
struct Wedge {
    /// Values at time 0 and at time 1 of each.
    lines: [[f64; 2]; 4],
    time: f64,
}

impl Wedge {
    /// The height of a capsule over a plane; `beyond` is the offset of the plane plus the radius.
    fn of_plane(time: f64, motion: &Motion, normal: &Vector3<f64>, beyond: f64) -> Self {
        let height = |p: Point3<f64>| normal.dot(&p.coords) - beyond;
        let (a, b) = (motion.a.map(height), motion.b.map(height));
        Self {
            lines: [a, b, a, b],
            time,
        }
    }

    fn at(&self, time: f64) -> f64 {
        self.lines
            .iter()
            .map(|[start, end]| start + (end - start) * time)
            .fold(f64::INFINITY, f64::min)
    }

    /// The interval around the wedge's own time in which it is at least `slack`.
    fn interval(&self, slack: f64) -> Option<(f64, f64)> {
        if self.at(self.time) < slack {
            return None;
        }
        let (mut low, mut high) = (0f64, 1f64);
        for [start, end] in self.lines {
            // Each line crosses the slack once; it is above it at the wedge's own time.
            if start < slack {
                low = low.max((slack - start) / (end - start));
            }
            if end < slack {
                high = high.min((start - slack) / (start - end));
            }
        }
        Some((low.min(self.time), high.max(self.time)))
    }

    /// The least value in an interval: a concave function has it at an end.
    fn least(&self, low: f64, high: f64) -> f64 {
        self.at(low).min(self.at(high))
    }
}

/// Two capsules: the plane is common to both, across the normal at that time.
fn pair_wedge(a: &Motion, b: &Motion, time: f64) -> Wedge {
    let normal = capsule_capsule(&a.at(time), &b.at(time)).normal;
    let radii = a.radius + b.radius;
    let gap = |p: [Point3<f64>; 2], q: [Point3<f64>; 2]| {
        [0, 1].map(|i| normal.dot(&(p[i] - q[i])) - radii)
    };
    Wedge {
        lines: [gap(a.a, b.a), gap(a.a, b.b), gap(a.b, b.a), gap(a.b, b.b)],
        time,
    }
}

/// A lower bound, at least `slack`, on the clearance over times 0 to 1, from wedges made at chosen times.
fn prove(wedge: &impl Fn(f64) -> Wedge, slack: f64) -> Option<f64> {
    let first = Proven::new(wedge(0.0), slack)?;
    if first.high >= 1.0 {
        return Some(first.wedge.least(0.0, 1.0));
    }
    let last = Proven::new(wedge(1.0), slack)?;
    if last.low <= 0.0 {
        return Some(last.wedge.least(0.0, 1.0));
    }
    join(wedge, &first, 0.0, &last, 1.0, slack, 0)
}

/// A wedge and the interval of time over which it proves the slack.
#[derive(Clone, Copy)]
struct Proven {
    wedge: Wedge,
    low: f64,
    high: f64,
}

impl Proven {
    fn new(wedge: Wedge, slack: f64) -> Option<Self> {
        let (low, high) = wedge.interval(slack)?;
        Some(Self { wedge, low, high })
    }
}

/// Closes the gap between two proven wedges, and bounds the clearance from `from` to `to`, times that they contain.
fn join(
    wedge: &impl Fn(f64) -> Wedge,
    left: &Proven,
    from: f64,
    right: &Proven,
    to: f64,
    slack: f64,
    depth: u32,
) -> Option<f64> {
    if left.high >= right.low {
        // They overlap: pass from one to the other where the straight lines between the ends of the overlap cross.
        let (low, high) = (right.low.max(from), left.high.min(to));
        let ahead = |time: f64| left.wedge.at(time) - right.wedge.at(time);
        let (gain, loss) = (ahead(low), -ahead(high));
        let share = if gain > 0.0 && loss > 0.0 {
            gain / (gain + loss)
        } else if gain > 0.0 {
            1.0
        } else {
            0.0
        };
        let seam = low + share * (high - low);
        return Some(
            left.wedge
                .least(from, seam)
                .min(right.wedge.least(seam, to)),
        );
    }
    if depth == MAX_DEPTH {
        return None;
    }
    let time = 0.5 * (left.high + right.low);
    let middle = Proven::new(wedge(time), slack)?;
    let before = join(wedge, left, from, &middle, time, slack, depth + 1)?;
    let after = join(wedge, &middle, time, right, to, slack, depth + 1)?;
    Some(before.min(after))
}

/// A mesh: outside at the start, and no triangle reached on the way.
fn prove_mesh(motion: &Motion, mesh: &Mesh, slack: f64) -> Option<f64> {
    // The axis must stay away from the surface, or "outside" proves nothing.
    let reach = motion.radius + slack;
    if reach <= 0.0 {
        return None;
    }
    let local = |p: Point3<f64>| Point3::from(mesh.frame.local_point(&p));
    let motion = Motion {
        a: motion.a.map(local),
        b: motion.b.map(local),
        radius: motion.radius,
    };
    let mut hint = usize::MAX;
    let start = axis_mesh(&motion.a[0], &motion.b[0], mesh, &mut hint).distance - motion.radius;
    if start < slack {
        return None;
    }
    let points = motion.points();
    let (low, high) = points
        .iter()
        .fold((points[0], points[0]), |(low, high), p| {
            (low.inf(p), high.sup(p))
        });
    let swept = crate::Aabb {
        min: low,
        max: high,
    };
    // Boxes that are left out are known to be this far away.
    let left_out = Cell::new(f64::INFINITY);
    let mut bound = start;
    let mut failed = false;
    mesh.tree.visit(
        f64::INFINITY,
        |node| {
            let apart = node.distance(&swept);
            if apart < reach {
                return apart;
            }
            left_out.set(left_out.get().min(apart));
            f64::INFINITY
        },
        |range, _| {
            for triangle in &mesh.triangles[range] {
                match prove_triangle(&motion, &swept, triangle, slack) {
                    Some(clearance) => bound = bound.min(clearance),
                    None => {
                        failed = true;
                        return f64::NEG_INFINITY;
                    }
                }
            }
            f64::INFINITY
        },
    );
    (!failed).then(|| bound.min(left_out.get() - motion.radius))
}

/// One triangle, as a flat convex body.
fn prove_triangle(
    motion: &Motion,
    swept: &crate::Aabb,
    triangle: &Triangle,
    slack: f64,
) -> Option<f64> {
    let heights = motion.points().map(|p| triangle.height(&p));
    let least = heights.into_iter().fold(f64::INFINITY, f64::min);
    let greatest = heights.into_iter().fold(f64::NEG_INFINITY, f64::max);
    let over = least.max(-greatest) - motion.radius;
    if over >= slack {
        return Some(over);
    }
    let apart = box_of(&triangle.corners).distance(swept) - motion.radius;
    if apart >= slack {
        return Some(apart);
    }
    let wedge = |time: f64| {
        let at = motion.at(time);
        let pair = closest_points_segment_triangle(&at.a, &at.b, &triangle.corners);
        let normal = (pair.on_a - pair.on_b)
            .try_normalize(0.0)
            .unwrap_or(triangle.normal);
        let extent = triangle
            .corners
            .iter()
            .map(|p| normal.dot(&p.coords))
            .fold(f64::NEG_INFINITY, f64::max);
        Wedge::of_plane(time, motion, &normal, extent + motion.radius)
    };
    prove(&wedge, slack)
}
