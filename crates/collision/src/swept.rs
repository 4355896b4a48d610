//! Proofs of clearance over a whole linear motion.

use crate::{Capsule, Solid};

/// Outcome of a continuous test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Certificate {
    /// The clearance is at least this at every instant, and this is at least the slack asked for.
    Clear {
        /// Proven lower bound.
        clearance: f64,
    },
    /// No proof was found: there is a collision, or less clearance than asked for, or the depth was too small.
    Undecided,
}

/// Proves that a capsule whose ends move linearly from `start` to `end` keeps at least `slack` from a solid.
#[must_use]
pub fn swept_capsule_solid(
    _start: &Capsule,
    _end: &Capsule,
    _solid: &Solid,
    _slack: f64,
) -> Certificate {
    todo!()
}

/// Proves that two capsules whose ends move linearly, at the same time, keep at least `slack` from each other.
#[must_use]
pub fn swept_capsule_capsule(
    _start_a: &Capsule,
    _end_a: &Capsule,
    _start_b: &Capsule,
    _end_b: &Capsule,
    _slack: f64,
) -> Certificate {
    todo!()
}
