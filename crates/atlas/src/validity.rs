//! What else must hold on a manifold: the test of a step, and contacts as
//! inequalities that a branch can slide along.

use crate::{contacts::Contacts, manifold::SparseRow};

/// What obstructs a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Obstruction {
    /// Contacts would be violated at the end of the step: their indices are in
    /// the list that the test was given. A branch may slide along them.
    Contacts,
    /// The step is obstructed in a way that no contact describes: the branch stops.
    Blocked,
}

/// A test of steps on a manifold.
///
/// A planner calls [`Validity::enter`] at the beginning of a branch and
/// [`Validity::step`] for each step; the memory holds what is worth remembering
/// of the point reached, such as lower bounds of clearances.
pub trait Validity: Sync {
    /// What is remembered of a point.
    type Memory: Clone + Send;

    /// Memory of the right size.
    fn memory(&self) -> Self::Memory;

    /// Prepares the memory for a branch that begins at the valid point `x`.
    fn enter(&self, x: &[f64], memory: &mut Self::Memory);

    /// Judges the step from the valid point in `from` to the point `x`, both on
    /// the manifold and a step apart. On success `to` holds the memory of `x`.
    ///
    /// The whole step must be valid, not only its end: `between(s, y)` gives
    /// the point y of the manifold at the fraction s of the step, or `false`
    /// where there is none.
    ///
    /// # Errors
    /// The [`Obstruction`]; for [`Obstruction::Contacts`] the violated contacts
    /// are appended to `violated`.
    fn step(
        &self,
        from: &Self::Memory,
        x: &[f64],
        to: &mut Self::Memory,
        between: &mut dyn FnMut(f64, &mut [f64]) -> bool,
        violated: &mut Vec<usize>,
    ) -> Result<(), Obstruction>;

    /// Judges a step of a search tree as [`Validity::step`] does, but may take the
    /// motion for the straight line between its ends: what becomes part of a path is
    /// judged again by [`Validity::robust_step`].
    ///
    /// # Errors
    /// As [`Validity::step`].
    fn tree_step(
        &self,
        from: &Self::Memory,
        x: &[f64],
        to: &mut Self::Memory,
        between: &mut dyn FnMut(f64, &mut [f64]) -> bool,
        violated: &mut Vec<usize>,
    ) -> Result<(), Obstruction> {
        self.step(from, x, to, between, violated)
    }

    /// Judges a step of a path that others will know by its two ends alone: they
    /// may return to the manifold between them in a way of their own, and must
    /// find the motion valid too. `false` asks for points closer together.
    fn robust_step(
        &self,
        from: &Self::Memory,
        x: &[f64],
        to: &mut Self::Memory,
        between: &mut dyn FnMut(f64, &mut [f64]) -> bool,
    ) -> bool {
        self.step(from, x, to, between, &mut Vec::new()).is_ok()
    }

    /// Value of a contact at x, scaled like the variables: positive when clear.
    /// Adds its gradient to `row`. `None` where the contact has no usable
    /// normal, so that a branch must stop there. Fastest with the memory of x;
    /// any other serves as scratch.
    fn contact(
        &self,
        contact: usize,
        x: &[f64],
        memory: &mut Self::Memory,
        row: &mut SparseRow,
    ) -> Option<f64> {
        let _ = (contact, x, memory, row);
        None
    }

    /// Appends to `found` all contacts whose values at x are below `reach`, with
    /// their gradients: what an optimiser of paths needs to keep clear. Values
    /// are those of [`Validity::contact`]. `memory` serves as scratch.
    ///
    /// Without contacts, the default, an optimiser sees no obstacles and can
    /// only reject what [`Validity::is_clear`] refuses.
    fn contacts(&self, x: &[f64], memory: &mut Self::Memory, reach: f64, found: &mut Contacts) {
        let _ = (x, memory, reach, found);
    }

    /// Whether the motion between two points, a step apart, is valid
    /// throughout. May be sharper, and dearer, than [`Validity::step`], which is
    /// the default: it judges finished paths.
    fn is_clear(
        &self,
        a: &[f64],
        b: &[f64],
        between: &mut dyn FnMut(f64, &mut [f64]) -> bool,
    ) -> bool {
        let (mut from, mut to) = (self.memory(), self.memory());
        self.enter(a, &mut from);
        self.step(&from, b, &mut to, between, &mut Vec::new())
            .is_ok()
    }

    /// How far apart two points are for the purposes of a path's resolution:
    /// the largest displacement of a node, for a structure. Euclidean unless
    /// said otherwise.
    fn displacement(&self, a: &[f64], b: &[f64]) -> f64 {
        crate::atlas::squared_distance(a, b).sqrt()
    }

    /// Whether the point x is valid by itself; used for start and goal.
    fn is_valid(&self, x: &[f64]) -> bool;
}

/// Every step is valid.
#[derive(Clone, Copy, Debug, Default)]
pub struct Everywhere;

impl Validity for Everywhere {
    type Memory = ();

    fn memory(&self) {}

    fn enter(&self, _: &[f64], (): &mut ()) {}

    fn step(
        &self,
        (): &(),
        _: &[f64],
        (): &mut (),
        _: &mut dyn FnMut(f64, &mut [f64]) -> bool,
        _: &mut Vec<usize>,
    ) -> Result<(), Obstruction> {
        Ok(())
    }

    fn is_valid(&self, _: &[f64]) -> bool {
        true
    }
}

/// A predicate on points, tested at the end of each step and at points between.
#[derive(Clone, Debug)]
pub struct Predicate<P> {
    predicate: P,
    dimension: usize,
    subdivisions: usize,
}

impl<P: Fn(&[f64]) -> bool + Sync> Predicate<P> {
    /// A test on points with `dimension` variables that looks at `subdivisions`
    /// points inside each step besides its end.
    pub fn new(dimension: usize, subdivisions: usize, predicate: P) -> Self {
        Self {
            predicate,
            dimension,
            subdivisions,
        }
    }
}

impl<P: Fn(&[f64]) -> bool + Sync> Validity for Predicate<P> {
    type Memory = ();

    fn memory(&self) {}

    fn enter(&self, _: &[f64], (): &mut ()) {}

    fn step(
        &self,
        (): &(),
        x: &[f64],
        (): &mut (),
        between: &mut dyn FnMut(f64, &mut [f64]) -> bool,
        _: &mut Vec<usize>,
    ) -> Result<(), Obstruction> {
        if !(self.predicate)(x) {
            return Err(Obstruction::Blocked);
        }
        let mut y = vec![
            0.0;
            if self.subdivisions > 0 {
                self.dimension
            } else {
                0
            }
        ];
        for i in 1..=self.subdivisions {
            let s = i as f64 / (self.subdivisions + 1) as f64;
            if !between(s, &mut y) || !(self.predicate)(&y) {
                return Err(Obstruction::Blocked);
            }
        }
        Ok(())
    }

    fn is_valid(&self, x: &[f64]) -> bool {
        (self.predicate)(x)
    }
}
