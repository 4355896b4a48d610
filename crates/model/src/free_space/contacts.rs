//! All contacts near a configuration, and the sharp test of a finished step:
//! what an optimiser of paths asks of free space.

use nalgebra::{Point3, Vector3};
use tensegra_atlas::{Contacts, SparseRow};
use tensegra_collision::{
    Capsule, Contact, capsule_capsule_lower_bound, capsule_solid, capsule_solid_around,
    capsule_solid_posed, clearance_lower_bound,
};

use super::{
    CURVATURE_FACTOR, DEVIATION_FACTOR, Displacements, FreeSpace, Memory, Pair, Primitives, Scene,
    State,
};
use crate::equilibrium::EquilibriumManifold;

/// Halvings of a step of a finished path.
const HALVINGS: usize = 10;
/// Fraction of the least clearance that a finished path keeps.
const KEPT: f64 = 0.1;

/// Walls around a capsule count where they are nearer than this part of the structure's
/// size, about a step of a path.
const AROUND: f64 = 0.05;
/// Two contacts are the same where cosine and parameter agree to this.
const SAME: f64 = 1e-6;

/// Gradients with respect to node positions.
type NodeGradients = Vec<(usize, Vector3<f64>)>;

impl Scene {
    /// A lower bound of the clearance of a pair that costs little.
    pub(super) fn lower_bound(&self, pair: &Pair, state: &State) -> f64 {
        let ball = |s: usize| (state.middles[s], self.attached[s].radius);
        let as_capsule = |(center, radius): (Point3<f64>, f64)| Capsule {
            a: center,
            b: center,
            radius,
        };
        match pair.primitives {
            Primitives::Capsules(i, j) => {
                capsule_capsule_lower_bound(&state.capsules[i], &state.capsules[j])
            }
            Primitives::CapsuleObstacle(i, o) => {
                clearance_lower_bound(&state.capsules[i], &self.obstacles[o])
            }
            Primitives::CapsuleAttached(i, s) => {
                capsule_capsule_lower_bound(&state.capsules[i], &as_capsule(ball(s)))
            }
            Primitives::AttachedObstacle(s, o) => {
                clearance_lower_bound(&as_capsule(ball(s)), &self.obstacles[o])
            }
            Primitives::AttachedAttached(s, r) => {
                let ((p, a), (q, b)) = (ball(s), ball(r));
                (p - q).norm() - a - b
            }
        }
    }

    /// The contact of one end of a capsule, as a ball, with the solid of a pair.
    fn end_contact(&self, pair: &Pair, state: &State, end: usize) -> Option<Contact> {
        let ball = |i: usize| {
            let Capsule { a, b, radius } = state.capsules[i];
            let center = [a, b][end];
            Capsule {
                a: center,
                b: center,
                radius,
            }
        };
        let mut contact = match pair.primitives {
            Primitives::CapsuleObstacle(i, o) => capsule_solid(&ball(i), &self.obstacles[o]),
            Primitives::CapsuleAttached(i, s) => {
                let solid = &self.attached[s];
                let pose = &state.poses[solid.attachment];
                capsule_solid_posed(&ball(i), &solid.solid, pose)
            }
            _ => return None,
        };
        contact.s = end as f64;
        Some(contact)
    }

    /// Appends the contacts of a capsule with a mesh in all directions in which it is
    /// nearer than `reach`.
    fn contacts_around(&self, pair: &Pair, state: &State, reach: f64, found: &mut Vec<Contact>) {
        if let Primitives::CapsuleObstacle(i, o) = pair.primitives {
            capsule_solid_around(&state.capsules[i], &self.obstacles[o], reach, found);
        }
    }
}

impl<M: EquilibriumManifold + ?Sized> FreeSpace<'_, M> {
    /// Appends the contacts whose values are below `reach`. A capsule near a
    /// solid counts with its nearest point and with both ends: the nearest point
    /// jumps from end to end where they are level. In a hole of a mesh it counts with
    /// the walls all around: away from the nearest one it meets the others.
    pub(super) fn find_contacts(
        &self,
        x: &[f64],
        memory: &mut Memory,
        reach: f64,
        found: &mut Contacts,
    ) {
        let state = &mut memory.state;
        self.place(x, state);
        let farthest = self.least + reach * self.size;
        let scale = 1.0 / self.size;
        let mut row = SparseRow::default();
        let mut gradients = NodeGradients::new();
        let (mut known, mut around) = (Vec::new(), Vec::new());
        let mut add = |index: usize, contact: &Contact| {
            if !contact.clearance.is_finite() || contact.clearance >= farthest {
                return;
            }
            gradients.clear();
            let pair = &self.scene.pairs[index];
            if self
                .contact_gradients(pair, contact, state, &mut gradients)
                .is_some()
            {
                for (_, gradient) in &mut gradients {
                    *gradient *= scale;
                }
                row.clear();
                self.manifold.pull_back(x, &gradients, &mut row);
                found.push(index, (contact.clearance - self.least) * scale, &row);
            }
        };
        for (index, pair) in self.scene.pairs.iter().enumerate() {
            if self.scene.lower_bound(pair, state) >= farthest {
                continue;
            }
            let nearest = self.scene.contact(pair, state);
            if nearest.clearance >= farthest {
                continue;
            }
            known.clear();
            known.push(nearest);
            for end in 0..2 {
                if nearest.s != end as f64 {
                    known.extend(self.scene.end_contact(pair, state, end));
                }
            }
            around.clear();
            let near = self.least + AROUND.min(reach) * self.size;
            self.scene.contacts_around(pair, state, near, &mut around);
            around.retain(|contact: &Contact| {
                known.iter().all(|other: &Contact| {
                    contact.normal.dot(&other.normal) < 1.0 - SAME
                        || (contact.s - other.s).abs() > SAME
                })
            });
            for contact in known.iter().chain(&around) {
                add(index, contact);
            }
        }
    }

    /// Whether all pairs keep a tenth of the least clearance between `a` and
    /// `b`, both on the manifold: by their clearances at both ends against the
    /// motion, by separating planes with room for the deviation from the linear
    /// motion, or the same for both halves.
    pub(super) fn is_clear_throughout(
        &self,
        a: &[f64],
        b: &[f64],
        between: &mut dyn FnMut(f64, &mut [f64]) -> bool,
    ) -> bool {
        let (a, b) = (self.state(a), self.state(b));
        let mut moved = Displacements::default();
        self.scene.displacements(&a, &b, &mut moved);
        let reach = moved.capsules.iter().fold(0.0, |m: f64, d| m.max(*d));
        let kept = KEPT * self.least;
        let near: Vec<usize> = (0..self.scene.pairs.len())
            .filter(|&i| {
                let pair = &self.scene.pairs[i];
                let attached = !matches!(
                    pair.primitives,
                    Primitives::Capsules(..) | Primitives::CapsuleObstacle(..)
                );
                attached
                    || self.scene.lower_bound(pair, &a) <= kept + 2.0 * CURVATURE_FACTOR * reach
            })
            .collect();
        let clear = |state: &State| {
            near.iter()
                .all(|&i| self.scene.contact(&self.scene.pairs[i], state).clearance >= kept)
        };
        clear(&a) && clear(&b) && self.halve(&near, (&a, &b), [0.0, 1.0], between, HALVINGS)
    }

    fn halve(
        &self,
        pairs: &[usize],
        (a, b): (&State, &State),
        s: [f64; 2],
        between: &mut dyn FnMut(f64, &mut [f64]) -> bool,
        halvings: usize,
    ) -> bool {
        let kept = KEPT * self.least;
        let mut moved = Displacements::default();
        self.scene.displacements(a, b, &mut moved);
        let open: Vec<usize> = pairs
            .iter()
            .copied()
            .filter(|&i| {
                let pair = &self.scene.pairs[i];
                let clearance =
                    self.scene.contact(pair, a).clearance + self.scene.contact(pair, b).clearance;
                let sum = self.scene.displacement(pair, &moved);
                clearance - 2.0 * kept <= self.scene.relative_displacement(pair, sum, a, b)
            })
            .collect();
        if open.is_empty() {
            return true;
        }
        let mut y = vec![0.0; self.manifold.ambient_dimension()];
        let middle = 0.5 * (s[0] + s[1]);
        if !between(middle, &mut y) {
            return false;
        }
        let state = self.state(&y);
        let strays: Vec<f64> = a
            .capsules
            .iter()
            .zip(&b.capsules)
            .zip(&state.capsules)
            .map(|((a, b), m)| {
                let first = (m.a - nalgebra::center(&a.a, &b.a)).norm();
                first.max((m.b - nalgebra::center(&a.b, &b.b)).norm())
            })
            .collect();
        let mut left = Vec::new();
        for i in open {
            let pair = &self.scene.pairs[i];
            let strays = match pair.primitives {
                Primitives::Capsules(i, j) => strays[i] + strays[j],
                Primitives::CapsuleObstacle(i, _) => strays[i],
                _ => 0.0,
            };
            if self.scene.contact(pair, &state).clearance < kept {
                return false;
            }
            let slack = kept + DEVIATION_FACTOR * strays;
            if !self.scene.is_swept_clear(pair, a, b, slack) {
                left.push(i);
            }
        }
        left.is_empty()
            || (halvings > 0
                && self.halve(&left, (a, &state), [s[0], middle], between, halvings - 1)
                && self.halve(&left, (&state, b), [middle, s[1]], between, halvings - 1))
    }
}
