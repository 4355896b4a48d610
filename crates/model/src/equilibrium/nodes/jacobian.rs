//! The Jacobian as sums of a few functions of each link.

use std::collections::BTreeMap;

use tensegra_atlas::SparsityPattern;

use super::{Density, Equation, LINK_VALUES, Link, builder::Builder};
use crate::equilibrium::affine::{AffineMap, AffineSums};

/// What an entry of the Jacobian is made of: a function of one link's vector
/// d = p_b − p_a, length l, density q, and s = (dq/dl) / l.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Atom {
    /// 1.
    One,
    /// q.
    Density,
    /// dᵢ.
    Vector(usize),
    /// s dᵢ dⱼ.
    DensitySlope(usize, usize),
    /// q l².
    SquaredForceByDensity,
    /// (q² + q l² s) dᵢ.
    SquaredForceByPosition(usize),
    /// l.
    Length,
    /// (q / l + l s) dᵢ.
    ForceByPosition(usize),
    /// dᵢ / l.
    Direction(usize),
    /// (δᵢⱼ − dᵢ dⱼ / l²) / l.
    DirectionByPosition(usize, usize),
}

impl Builder<'_> {
    /// Adds the derivatives of an equation.
    pub(super) fn differentiate(
        &self,
        equation: &Equation,
        row: usize,
        jacobian: &mut JacobianTerms,
    ) {
        let is_spring = |i: usize| matches!(self.links[i].density, Density::Spring { .. });
        match equation {
            Equation::Length { link, length } => {
                for axis in 0..3 {
                    let c = 1.0 / (length * self.size);
                    jacobian.by_vector(row, *link, axis, Atom::Vector(axis), c);
                }
            }
            Equation::Pretension { links, norm } => {
                let c = 1.0 / (norm * norm);
                for &i in links {
                    jacobian.by_density(row, i, Atom::SquaredForceByDensity, c);
                    for axis in 0..3 {
                        let atom = Atom::SquaredForceByPosition(axis);
                        jacobian.by_vector(row, i, axis, atom, c);
                    }
                }
            }
            Equation::EqualLengths { links, scale } => {
                for (&i, c) in links.iter().zip([1.0, -scale]) {
                    for axis in 0..3 {
                        let atom = Atom::Direction(axis);
                        jacobian.by_vector(row, i, axis, atom, c / self.size);
                    }
                }
            }
            Equation::EqualRests {
                links,
                stiffness,
                scale,
            } => {
                for ((&i, k), c) in links.iter().zip(stiffness).zip([1.0, -scale]) {
                    let c = c / self.size;
                    jacobian.by_density(row, i, Atom::Length, -c / k);
                    for axis in 0..3 {
                        jacobian.by_vector(row, i, axis, Atom::Direction(axis), c);
                        jacobian.by_vector(row, i, axis, Atom::ForceByPosition(axis), -c / k);
                    }
                }
            }
            Equation::EqualForces { links, scale } => {
                for (&i, c) in links.iter().zip([1.0, -scale]) {
                    let c = c / self.force;
                    jacobian.by_density(row, i, Atom::Length, c);
                    for axis in 0..3 {
                        jacobian.by_vector(row, i, axis, Atom::ForceByPosition(axis), c);
                    }
                }
            }
            Equation::EqualDirections {
                links: [a, b],
                rotation,
                axis,
            } => {
                for j in 0..3 {
                    jacobian.by_vector(row, *a, j, Atom::DirectionByPosition(*axis, j), 1.0);
                    for i in 0..3 {
                        let atom = Atom::DirectionByPosition(i, j);
                        jacobian.by_vector(row, *b, j, atom, -rotation[i]);
                    }
                }
            }
        }
        debug_assert!(!matches!(equation, Equation::Length { link, .. } if is_spring(*link)));
    }
}

/// Collects the derivatives of all equations as sums of atoms.
pub(super) struct JacobianTerms<'a> {
    coordinates: &'a AffineMap,
    densities: &'a AffineMap,
    links: &'a [Link],
    atoms: BTreeMap<(usize, Atom), u32>,
    rows: Vec<BTreeMap<usize, Vec<(u32, f64)>>>,
}

impl<'a> JacobianTerms<'a> {
    pub(super) fn new(
        rows: usize,
        coordinates: &'a AffineMap,
        densities: &'a AffineMap,
        links: &'a [Link],
    ) -> Self {
        Self {
            coordinates,
            densities,
            links,
            atoms: BTreeMap::new(),
            rows: vec![BTreeMap::new(); rows],
        }
    }

    fn add(&mut self, row: usize, column: usize, atom: u32, c: f64) {
        let terms = self.rows[row].entry(column).or_default();
        match terms.iter_mut().find(|(other, _)| *other == atom) {
            Some((_, sum)) => *sum += c,
            None => terms.push((atom, c)),
        }
    }

    /// Where the value of an atom will stand: vectors and densities of all links come first.
    fn atom(&mut self, link: usize, atom: Atom) -> u32 {
        let first = LINK_VALUES * link;
        let index = match atom {
            Atom::Vector(axis) => first + axis,
            Atom::Density => first + 3,
            _ => {
                let next = LINK_VALUES * self.links.len() + self.atoms.len();
                return *self.atoms.entry((link, atom)).or_insert(next as u32);
            }
        };
        index as u32
    }

    /// The derivative with respect to component `axis` of d = p_b − p_a.
    pub(super) fn by_vector(&mut self, row: usize, link: usize, axis: usize, atom: Atom, c: f64) {
        let [a, b] = self.links[link].nodes;
        let atom = self.atom(link, atom);
        for (node, sign) in [(b, c), (a, -c)] {
            for &(j, s) in self.coordinates.row(3 * node + axis) {
                self.add(row, j, atom, sign * s);
            }
        }
    }

    /// The derivative with respect to q, where it is an unknown.
    pub(super) fn by_density(&mut self, row: usize, link: usize, atom: Atom, c: f64) {
        if let Density::Unknown(q) = self.links[link].density {
            let atom = self.atom(link, atom);
            for &(j, s) in self.densities.row(q) {
                self.add(row, j, atom, c * s);
            }
        }
    }

    #[allow(clippy::type_complexity)]
    pub(super) fn finish(
        self,
        variables: usize,
    ) -> (SparsityPattern, Vec<(usize, Atom)>, AffineSums) {
        let mut atoms = vec![(0, Atom::One); self.atoms.len()];
        for ((link, atom), index) in self.atoms {
            atoms[index as usize - LINK_VALUES * self.links.len()] = (link, atom);
        }
        let columns: Vec<Vec<usize>> = self
            .rows
            .iter()
            .map(|row| row.keys().copied().collect())
            .collect();
        let entries = self.rows.into_iter().flatten().map(|(_, terms)| {
            let terms = terms.into_iter().filter(|(_, c)| *c != 0.0);
            (0.0, terms.map(|(atom, c)| (atom as usize, c)).collect())
        });
        let entries = AffineSums::from_rows(entries);
        (
            SparsityPattern::from_rows(variables, &columns),
            atoms,
            entries,
        )
    }
}
