//! The motions that a two-tier walk is made of.

use std::collections::BTreeMap;

use crate::{
    Primitive, PrimitiveAttempt, PrimitiveError, PrimitiveOptions, Turn, TurningGait,
    extend_primitive, find_turning_gait,
};

/// Primitives over one or more rolls, found by their turns, and a periodic gait that can turn.
///
/// A sequence whose first turn leads right is walked by the mirror image of the one that leads
/// left, so that 2^(p−2) primitives serve all sequences of p rolls.
#[derive(Debug, Clone, PartialEq)]
pub struct PrimitiveLibrary {
    primitives: BTreeMap<Vec<bool>, Primitive>,
    pub(super) gait: Option<TurningGait>,
}

/// For each sequence of turns of a library, how its optimisation went.
pub type LibraryAttempts = Vec<(Vec<Turn>, PrimitiveAttempt)>;

/// A sequence of turns as a key: whether each differs from the first.
fn key(turns: &[Turn]) -> Vec<bool> {
    turns.iter().map(|turn| *turn != turns[0]).collect()
}

impl PrimitiveLibrary {
    /// A library of the one-roll primitive alone.
    #[must_use]
    pub fn new(one_roll: Primitive) -> Self {
        Self {
            primitives: BTreeMap::from([(Vec::new(), one_roll)]),
            gait: None,
        }
    }

    /// Adds optimised primitives for all sequences of up to `rolls` rolls. A sequence for which
    /// none is found is left out: it will be walked in shorter pieces.
    ///
    /// # Errors
    /// Options outside their range.
    pub fn extend(
        mut self,
        rolls: usize,
        options: &PrimitiveOptions,
    ) -> Result<(Self, LibraryAttempts), PrimitiveError> {
        let mut attempts = Vec::new();
        let one_roll = self.one_roll().clone();
        for count in 2..=rolls {
            // Turns after the first, as the bits of a number.
            for word in 0..1_usize << (count - 2) {
                let turns: Vec<Turn> = std::iter::once(Turn::Left)
                    .chain((0..count - 2).map(|bit| {
                        if word >> bit & 1 == 1 {
                            Turn::Right
                        } else {
                            Turn::Left
                        }
                    }))
                    .collect();
                match extend_primitive(&one_roll, &turns, options) {
                    Ok((primitive, attempt)) => {
                        self.primitives.insert(key(&turns), primitive);
                        attempts.push((turns, attempt));
                    }
                    Err(PrimitiveError::NotFound { .. }) => {}
                    Err(other) => return Err(other),
                }
            }
        }
        Ok((self, attempts))
    }

    /// Adds the gait that can turn, if one is found.
    ///
    /// # Errors
    /// Options outside their range.
    pub fn with_gait(mut self, options: &PrimitiveOptions) -> Result<Self, PrimitiveError> {
        self.gait = match find_turning_gait(self.one_roll(), options) {
            Ok(gait) => Some(gait),
            Err(PrimitiveError::NotFound { .. }) => None,
            Err(other) => return Err(other),
        };
        Ok(self)
    }

    /// The gait that can turn.
    #[must_use]
    pub fn gait(&self) -> Option<&TurningGait> {
        self.gait.as_ref()
    }

    /// Adds a primitive that was computed or read elsewhere. It must belong to the same robot and
    /// renaming as the others; returns false, and changes nothing, if not.
    pub fn insert(&mut self, primitive: Primitive) -> bool {
        let fits = primitive.symmetric_robot() == self.one_roll().symmetric_robot();
        if fits {
            self.primitives.insert(key(primitive.turns()), primitive);
        }
        fits
    }

    /// The one-roll primitive.
    #[must_use]
    pub fn one_roll(&self) -> &Primitive {
        // `new` puts it there, and nothing takes it out.
        &self.primitives[&Vec::new()]
    }

    /// The primitive for a sequence of turns after the first roll, and whether it has to be
    /// mirrored.
    #[must_use]
    pub fn get(&self, turns: &[Turn]) -> Option<(&Primitive, bool)> {
        let primitive = self.primitives.get(&key(turns))?;
        let mirrored = primitive.turns().first() != turns.first();
        Some((primitive, mirrored))
    }

    /// All primitives.
    pub fn primitives(&self) -> impl Iterator<Item = &Primitive> {
        self.primitives.values()
    }

    /// Most rolls of a primitive.
    #[must_use]
    pub fn max_rolls(&self) -> usize {
        self.primitives
            .values()
            .map(Primitive::num_rolls)
            .max()
            .unwrap_or(1)
    }
}
