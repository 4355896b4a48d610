//! Contacts near a point, as inequalities that an optimiser can keep.

use crate::manifold::SparseRow;

/// Contacts value(x) ≥ 0 near a point, each with its gradient. One contact may
/// occur several times, with different places where the bodies are close: all
/// of them must keep clear.
#[derive(Clone, Debug, Default)]
pub struct Contacts {
    heads: Vec<Head>,
    gradients: Vec<(usize, f64)>,
}

#[derive(Clone, Copy, Debug)]
struct Head {
    contact: usize,
    value: f64,
    start: usize,
}

/// One of [`Contacts`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactRow<'a> {
    /// Index of the contact, as in [`Validity::contact`](crate::Validity::contact).
    pub contact: usize,
    /// Its value: positive when clear, and below zero the more so the deeper
    /// the bodies overlap.
    pub value: f64,
    /// Gradient: columns with values that add up.
    pub gradient: &'a [(usize, f64)],
}

impl Contacts {
    /// Removes all and keeps the memory.
    pub fn clear(&mut self) {
        self.heads.clear();
        self.gradients.clear();
    }

    /// Adds a contact with its value and gradient.
    pub fn push(&mut self, contact: usize, value: f64, gradient: &SparseRow) {
        self.heads.push(Head {
            contact,
            value,
            start: self.gradients.len(),
        });
        self.gradients.extend_from_slice(gradient.entries());
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.heads.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.heads.is_empty()
    }

    /// The rows in the order in which they were added.
    pub fn iter(&self) -> impl Iterator<Item = ContactRow<'_>> {
        let ends = self.heads.iter().skip(1).map(|head| head.start);
        self.heads
            .iter()
            .zip(ends.chain([self.gradients.len()]))
            .map(|(head, end)| ContactRow {
                contact: head.contact,
                value: head.value,
                gradient: &self.gradients[head.start..end],
            })
    }
}
