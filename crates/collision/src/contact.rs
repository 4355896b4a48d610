//! What a clearance query answers.

use nalgebra::{Isometry3, Point3, Vector3};

/// The clearance between two bodies A and B, and where it is attained.
///
/// The signed clearance is the distance between the surfaces while they are apart and minus a penetration depth
/// when they overlap; which depth is said at each query. It is 1-Lipschitz in the motion of the bodies: no point
/// of them can move by δ and change it by more than δ.
///
/// The fields satisfy `on_a - on_b == clearance * normal` up to rounding. Where [`unique`](Self::unique) holds, the
/// clearance is differentiable, and its rate of change is `normal · (velocity of A's material point at on_a −
/// velocity of B's material point at on_b)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// Signed clearance, negative when the bodies penetrate.
    pub clearance: f64,
    /// Unit vector from B towards A: moving A along it increases the clearance.
    pub normal: Vector3<f64>,
    /// Witness point on the surface of A.
    pub on_a: Point3<f64>,
    /// Witness point on the surface of B.
    pub on_b: Point3<f64>,
    /// Where A is a capsule, the parameter in `[0, 1]` of its axis point `a + s (b - a)` next to B, else 0.
    pub s: f64,
    /// The same for B.
    pub t: f64,
    /// False where the pair of witness points is one of several that are equally close (parallel axes that
    /// overlap, crossing axes, an axis that lies flat on a face, a point on the medial axis of a body): the witness
    /// or the normal jumps there and the clearance has a kink.
    pub unique: bool,
}

impl Contact {
    /// The same contact with the roles of A and B exchanged.
    #[inline]
    #[must_use]
    pub fn flipped(&self) -> Self {
        Self {
            normal: -self.normal,
            on_a: self.on_b,
            on_b: self.on_a,
            s: self.t,
            t: self.s,
            ..*self
        }
    }

    /// The same contact seen from another frame.
    #[inline]
    #[must_use]
    pub fn transformed(&self, motion: &Isometry3<f64>) -> Self {
        Self {
            normal: motion * self.normal,
            on_a: motion * self.on_a,
            on_b: motion * self.on_b,
            ..*self
        }
    }
}
