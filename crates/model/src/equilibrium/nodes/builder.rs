//! Construction of the manifold: linear conditions are eliminated, the rest
//! becomes equations, bounds and limits.

use nalgebra::{DMatrix, DVector, Point3, RowDVector, Vector3};

use super::{
    BalancedNode, Density, Equation, Limit, Link, NODE_VALUES, NodesManifold, Origin, Quantity,
    jacobian::{Atom, JacobianTerms},
};
use crate::{
    equilibrium::{
        EquilibriumError,
        affine::{AffineMap, AffineSums, Elimination},
    },
    structure::{Coupling, Element, ForceLaw, Interval, Node, Structure},
};

/// Elements that may shrink to nothing keep this fraction of the structure's
/// size: at length zero the direction of the force is undefined.
const SHORTEST: f64 = 1e-2;

/// Relations between equations whose coefficients come this near to depending on
/// others determine nothing.
const DEPENDENT: f64 = 1e-6;

/// Construction, step by step.
pub(super) struct Builder<'a> {
    pub(super) structure: &'a Structure,
    pub(super) links: Vec<Link>,
    /// Element of each row of densities.
    pub(super) unknown_densities: Vec<usize>,
    pub(super) reference_lengths: Vec<f64>,
    pub(super) size: f64,
    pub(super) force: f64,
    pub(super) force_weight: f64,
}

impl<'a> Builder<'a> {
    pub(super) fn new(structure: &'a Structure, reference: &[Point3<f64>]) -> Self {
        let mut links = Vec::new();
        let mut unknown_densities = Vec::new();
        let mut reference_lengths = Vec::new();
        for (e, element) in structure.elements.iter().enumerate() {
            let density = match element.law {
                ForceLaw::None => Density::None,
                ForceLaw::Linear { stiffness, rest } if rest.is_constant() => {
                    if rest.lo == 0.0 {
                        Density::Constant(stiffness)
                    } else {
                        Density::Spring {
                            stiffness,
                            rest: rest.lo,
                        }
                    }
                }
                _ => {
                    unknown_densities.push(e);
                    Density::Unknown(unknown_densities.len() - 1)
                }
            };
            links.push(Link {
                nodes: element.nodes,
                density,
            });
            let [a, b] = element.nodes;
            let length = if element.has_constant_length() {
                element.length.lo
            } else {
                (reference[a] - reference[b]).norm()
            };
            reference_lengths.push(length.max(1e-6));
        }
        let size = structure.size(reference);
        let mean_length = if reference_lengths.is_empty() {
            size
        } else {
            reference_lengths.iter().sum::<f64>() / reference_lengths.len() as f64
        };
        let force = structure.pretension.unwrap_or_else(|| {
            let stiffest = structure
                .elements
                .iter()
                .filter_map(Element::stiffness)
                .fold(0.0, |s: f64, k| s.max(k.abs()));
            let load = structure
                .nodes
                .iter()
                .map(|n| n.load.norm())
                .fold(0.0, f64::max);
            let force = (0.2 * stiffest * size).max(load);
            if force > 0.0 { force } else { 1.0 }
        });
        Self {
            structure,
            links,
            unknown_densities,
            reference_lengths,
            size,
            force,
            force_weight: mean_length / size,
        }
    }

    /// Linear conditions on coordinates and densities.
    fn eliminate(&self) -> Result<(Elimination, usize), EquilibriumError> {
        let s = self.structure;
        let n = 3 * s.nodes.len();
        let mut elimination = Elimination::new(n + self.unknown_densities.len());
        let mut count = 0;
        let mut add = |terms: &[(usize, f64)], b: f64, what: &dyn Fn() -> String| {
            count += 1;
            elimination
                .add(terms, b)
                .map_err(|by| EquilibriumError::Contradiction { what: what(), by })
        };
        if s.dimension == 2 {
            for node in 0..s.nodes.len() {
                add(&[(3 * node + 2, 1.0)], 0.0, &|| "planarity".to_owned())?;
            }
        }
        for fixed in &s.fixed {
            add(&[(3 * fixed.node + fixed.axis, 1.0)], fixed.value, &|| {
                let axis = ["x", "y", "z"][fixed.axis];
                format!(
                    "the fixed {axis} coordinate of {}",
                    s.nodes[fixed.node].name
                )
            })?;
        }
        for coupling in &s.couplings {
            match coupling {
                Coupling::Orientation {
                    reference,
                    followers,
                } => {
                    for (follower, rotation) in followers {
                        if !self.are_rigid(*reference, *follower) {
                            continue;
                        }
                        // d_a = (L_a / L_b) R d_b.
                        let (a, b) = (&s.elements[*reference], &s.elements[*follower]);
                        let ratio = a.length.lo / b.length.lo;
                        for axis in 0..3 {
                            let mut terms =
                                vec![(3 * a.nodes[1] + axis, 1.0), (3 * a.nodes[0] + axis, -1.0)];
                            for j in 0..3 {
                                let c = ratio * rotation[(axis, j)];
                                terms.push((3 * b.nodes[1] + j, -c));
                                terms.push((3 * b.nodes[0] + j, c));
                            }
                            add(&terms, 0.0, &|| {
                                format!("the directions of {} and {}", a.name, b.name)
                            })?;
                        }
                    }
                }
                Coupling::Force {
                    reference,
                    followers,
                } => {
                    for &(follower, scale) in followers {
                        if let Some(ratio) = self.density_ratio(*reference, follower, scale)
                            && let (Density::Unknown(i), Density::Unknown(j)) =
                                (self.links[*reference].density, self.links[follower].density)
                        {
                            add(&[(n + i, 1.0), (n + j, -ratio)], 0.0, &|| {
                                "coupled forces".to_owned()
                            })?;
                        }
                    }
                }
                Coupling::Length { .. } | Coupling::Rest { .. } => {}
            }
        }
        Ok((elimination, count))
    }

    fn are_rigid(&self, a: usize, b: usize) -> bool {
        [a, b]
            .iter()
            .all(|&e| self.structure.elements[e].has_constant_length())
    }

    /// q_a / q_b for coupled forces f_a = `scale` f_b, where it is constant.
    fn density_ratio(&self, a: usize, b: usize, scale: f64) -> Option<f64> {
        if self.are_rigid(a, b) {
            let length = |e: usize| self.structure.elements[e].length.lo;
            return Some(scale * length(b) / length(a));
        }
        self.length_scale(a, b).map(|length| scale / length)
    }

    /// l_a / l_b where a coupling of lengths says so.
    fn length_scale(&self, a: usize, b: usize) -> Option<f64> {
        self.structure
            .couplings
            .iter()
            .find_map(|coupling| match coupling {
                Coupling::Length {
                    reference,
                    followers,
                } if *reference == a => followers
                    .iter()
                    .find(|(follower, _)| *follower == b)
                    .map(|&(_, scale)| scale),
                _ => None,
            })
    }

    pub(super) fn build(mut self) -> Result<NodesManifold, EquilibriumError> {
        let s = self.structure;
        let node_count = s.nodes.len();
        let (elimination, conditions) = self.eliminate()?;
        let raw = 3 * node_count + self.unknown_densities.len();
        // Free variables, scaled.
        let mut column = vec![None; raw];
        let (mut origins, mut names, mut scales) = (Vec::new(), Vec::new(), Vec::new());
        for (i, column) in column.iter_mut().enumerate() {
            if elimination.row_of(i).is_some() {
                continue;
            }
            *column = Some(origins.len());
            if i < 3 * node_count {
                origins.push(Origin::Coordinate(i));
                scales.push(self.size);
                names.push(format!(
                    "{} of {}",
                    ["x", "y", "z"][i % 3],
                    s.nodes[i / 3].name
                ));
            } else {
                let e = self.unknown_densities[i - 3 * node_count];
                origins.push(Origin::Density(e));
                scales.push(self.force / (self.force_weight * self.reference_lengths[e]));
                names.push(format!("force density of {}", s.elements[e].name));
            }
        }
        let map_row = |i: usize| match elimination.row_of(i) {
            Some((offset, entries)) => {
                let entries = entries
                    .into_iter()
                    .filter_map(|(j, c)| column[j].map(|k| (k, c * scales[k])))
                    .collect();
                (offset, entries)
            }
            None => (0.0, column[i].map(|k| (k, scales[k])).into_iter().collect()),
        };
        let coordinates = AffineMap::from_rows((0..3 * node_count).map(map_row));
        let densities = AffineMap::from_rows((3 * node_count..raw).map(map_row));
        let is_spring = |&i: &usize| matches!(self.links[i].density, Density::Spring { .. });
        let springs = (0..self.links.len()).filter(is_spring).collect();
        let variables = origins.len();

        let equations = self.equations(&coordinates);
        let places = self.places(&coordinates, &densities);
        // A node where no force acts balances by itself.
        let mut loaded: Vec<bool> = s.nodes.iter().map(|n| n.load != Vector3::zeros()).collect();
        let carries = |link: &&Link| !matches!(link.density, Density::None);
        for link in self.links.iter().filter(carries) {
            link.nodes.iter().for_each(|&node| loaded[node] = true);
        }
        let forces = self.links.iter().any(|link| carries(&link));
        let mut balance: Vec<[usize; 2]> = (0..node_count)
            .filter(|&node| forces && s.nodes[node].balanced && loaded[node])
            .flat_map(|node| (0..s.dimension).map(move |axis| [node, axis]))
            .collect();
        let raw_equations = conditions + balance.len() + equations.len();
        let alone = |node: usize| {
            let Node { balanced, load, .. } = &s.nodes[node];
            *load == Vector3::zeros() && (*balanced || !loaded[node])
        };
        if (0..node_count).all(alone) {
            let implied = self.implied_balance(&coordinates, &balance);
            balance.retain(|row| !implied.contains(row));
        }
        let mut row_of = vec![None; 3 * node_count];
        for (row, &[node, axis]) in balance.iter().enumerate() {
            row_of[3 * node + axis] = Some(row);
        }

        let (lower, upper, limits) = self.ranges(&coordinates, &densities, variables);
        let mut jacobian = JacobianTerms::new(
            balance.len() + equations.len(),
            &coordinates,
            &densities,
            &self.links,
        );
        let unit = 1.0 / self.force;
        for (i, link) in self.links.iter().enumerate() {
            if matches!(link.density, Density::None) {
                continue;
            }
            let [a, b] = link.nodes;
            for axis in 0..3 {
                if coordinates.are_equal(3 * a + axis, 3 * b + axis) {
                    continue;
                }
                for (node, sign) in [(a, unit), (b, -unit)] {
                    let Some(row) = row_of[3 * node + axis] else {
                        continue;
                    };
                    // d(q d)/dp and d(q d)/dq.
                    jacobian.by_vector(row, i, axis, Atom::Density, sign);
                    jacobian.by_density(row, i, Atom::Vector(axis), sign);
                    if matches!(link.density, Density::Spring { .. }) {
                        for j in 0..3 {
                            jacobian.by_vector(row, i, j, Atom::DensitySlope(axis, j), sign);
                        }
                    }
                }
            }
        }
        for (i, equation) in equations.iter().enumerate() {
            self.differentiate(equation, balance.len() + i, &mut jacobian);
        }
        let (pattern, atoms, entries) = jacobian.finish(variables);
        let (balanced, pulls) = self.pulls(&balance);
        Ok(NodesManifold {
            structure: s.clone(),
            size: self.size,
            force: self.force,
            variables,
            raw_variables: raw,
            raw_equations,
            coordinates,
            densities,
            places,
            springs,
            links: std::mem::take(&mut self.links),
            balance,
            balanced,
            pulls,
            equations,
            limits,
            lower,
            upper,
            names,
            origins,
            pattern,
            atoms,
            entries,
        })
    }

    /// The nodes at which forces balance, and the links that pull at them.
    fn pulls(&self, balance: &[[usize; 2]]) -> (Vec<BalancedNode>, Vec<(u32, f64)>) {
        let unit = 1.0 / self.force;
        let mut pulls = Vec::new();
        let nodes = balance.chunk_by(|[a, _], [b, _]| a == b).map(|rows| {
            let [node, _] = rows[0];
            let before = pulls.len();
            for (i, link) in self.links.iter().enumerate() {
                let ends = link.nodes.into_iter().zip([unit, -unit]);
                let here = ends.filter(|&(end, _)| end == node);
                if !matches!(link.density, Density::None) {
                    pulls.extend(here.map(|(_, unit)| (i as u32, unit)));
                }
            }
            BalancedNode {
                load: (unit * self.structure.nodes[node].load).push(0.0).into(),
                pulls: pulls.len() - before,
                axes: rows.len(),
            }
        });
        (nodes.collect(), pulls)
    }

    /// Four rows for each node and one for each link.
    fn places(&self, coordinates: &AffineMap, densities: &AffineMap) -> AffineSums {
        let constant = |value: f64| (value, Vec::new());
        let nodes = (0..NODE_VALUES * self.structure.nodes.len()).map(|i| {
            match (i / NODE_VALUES, i % NODE_VALUES) {
                (_, 3) => constant(0.0),
                (node, axis) => coordinates.owned_row(3 * node + axis),
            }
        });
        let links = self.links.iter().map(|link| match link.density {
            Density::None | Density::Spring { .. } => constant(0.0),
            Density::Constant(q) => constant(q),
            Density::Unknown(row) => densities.owned_row(row),
        });
        AffineSums::from_rows(nodes.chain(links))
    }

    /// The equations of balance, a node and an axis each, that follow from the others
    /// where neither loads nor supports act: internal forces F at the nodes have no
    /// resultant and no moment, Σ F = 0 and Σ (p − o) × F = 0, in equilibrium or not.
    /// The relations determine as many F as have independent coefficients there;
    /// coefficients are known at nodes that keep their place relative to the node o.
    fn implied_balance(&self, coordinates: &AffineMap, balance: &[[usize; 2]]) -> Vec<[usize; 2]> {
        let rows = |node: usize| [0, 1, 2].map(|axis| coordinates.row(3 * node + axis));
        let is_fixed = |node: &usize| rows(*node).iter().all(|row| row.is_empty());
        let mut nodes = balance.iter().map(|&[node, _]| node);
        let Some(origin) = nodes.clone().find(is_fixed).or(nodes.next()) else {
            return Vec::new();
        };
        let offset =
            |node: usize| Vector3::from([0, 1, 2].map(|i| coordinates.offset(3 * node + i)));
        let keeps_place = |&&[node, _]: &&[usize; 2]| rows(node) == rows(origin);
        let candidates: Vec<_> = balance.iter().filter(keeps_place).copied().collect();
        let coefficients =
            DMatrix::from_columns(&Vec::from_iter(candidates.iter().map(|&[node, axis]| {
                let force = Vector3::ith(axis, 1.0);
                let arm = (offset(node) - offset(origin)) / self.size;
                DVector::from_iterator(6, force.iter().chain(&arm.cross(&force)).copied())
            })));
        let qr = coefficients.col_piv_qr();
        let pivots = qr.r().diagonal();
        let rank = pivots.iter().take_while(|p| p.abs() > DEPENDENT).count();
        let mut order = RowDVector::from_iterator(candidates.len(), 0..candidates.len());
        qr.p().permute_columns(&mut order);
        order.iter().take(rank).map(|&i| candidates[i]).collect()
    }

    /// Lengths, pretension and non-linear couplings. May add links.
    fn equations(&mut self, coordinates: &AffineMap) -> Vec<Equation> {
        let s = self.structure;
        let is_fixed = |node: usize| (0..3).all(|axis| coordinates.row(3 * node + axis).is_empty());
        let mut equations = Vec::new();
        // Followers of a rigid orientation coupling inherit their length.
        let mut implied = vec![false; s.elements.len()];
        for coupling in &s.couplings {
            if let Coupling::Orientation {
                reference,
                followers,
            } = coupling
            {
                for &(follower, _) in followers {
                    implied[follower] |= self.are_rigid(*reference, follower);
                }
            }
        }
        for (e, element) in s.elements.iter().enumerate() {
            if element.has_constant_length()
                && !implied[e]
                && !element.nodes.iter().all(|&node| is_fixed(node))
            {
                equations.push(Equation::Length {
                    link: e,
                    length: element.length.lo,
                });
            }
        }
        for attachment in &s.attachments {
            for (i, j) in [(0, 1), (1, 2), (2, 0)] {
                let (p, q) = (&attachment.anchors[i], &attachment.anchors[j]);
                let tied = s.elements.iter().any(|element| {
                    element.has_constant_length()
                        && (element.nodes == [p.node, q.node] || element.nodes == [q.node, p.node])
                });
                if !tied {
                    let length = (p.local - q.local).norm();
                    let link = Link {
                        nodes: [p.node, q.node],
                        density: Density::None,
                    };
                    equations.push(Equation::Length {
                        link: self.links.len(),
                        length,
                    });
                    self.links.push(link);
                }
            }
        }
        if let Some(norm) = s.pretension {
            let links = (0..s.elements.len())
                .filter(|&e| s.elements[e].carries_force())
                .collect();
            equations.push(Equation::Pretension { links, norm });
        }
        for coupling in &s.couplings {
            match coupling {
                Coupling::Length {
                    reference,
                    followers,
                } => {
                    for &(follower, scale) in followers {
                        if !self.are_rigid(*reference, follower) {
                            let links = [*reference, follower];
                            equations.push(Equation::EqualLengths { links, scale });
                        }
                    }
                }
                Coupling::Rest {
                    reference,
                    followers,
                } => {
                    for &(follower, scale) in followers {
                        let (a, b) = (&s.elements[*reference], &s.elements[follower]);
                        if let (Some(ka), Some(kb)) = (a.stiffness(), b.stiffness())
                            && a.is_actuated()
                            && !self.implies_rest(*reference, follower, scale)
                        {
                            equations.push(Equation::EqualRests {
                                links: [*reference, follower],
                                stiffness: [ka, kb],
                                scale,
                            });
                        }
                    }
                }
                Coupling::Force {
                    reference,
                    followers,
                } => {
                    for &(follower, scale) in followers {
                        let unknown = [*reference, follower]
                            .iter()
                            .all(|&e| matches!(self.links[e].density, Density::Unknown(_)));
                        let linear = self.density_ratio(*reference, follower, scale).is_some();
                        if !(unknown && linear) {
                            let links = [*reference, follower];
                            equations.push(Equation::EqualForces { links, scale });
                        }
                    }
                }
                Coupling::Orientation {
                    reference,
                    followers,
                } => {
                    for (follower, rotation) in followers {
                        if self.are_rigid(*reference, *follower) {
                            continue;
                        }
                        for axis in 0..s.dimension {
                            equations.push(Equation::EqualDirections {
                                links: [*reference, *follower],
                                rotation: rotation.matrix().row(axis).transpose(),
                                axis,
                            });
                        }
                    }
                }
            }
        }
        equations
    }

    /// Whether equal lengths and forces already make the rest lengths equal.
    fn implies_rest(&self, a: usize, b: usize, scale: f64) -> bool {
        let force = self
            .structure
            .couplings
            .iter()
            .find_map(|coupling| match coupling {
                Coupling::Force {
                    reference,
                    followers,
                } if *reference == a => followers
                    .iter()
                    .find(|(follower, _)| *follower == b)
                    .map(|&(_, s)| s),
                _ => None,
            });
        let stiffness = |e: usize| self.structure.elements[e].stiffness();
        // r_a = l_a − f_a/k_a = s l_b − s f_b/k_b when all scales are s.
        self.length_scale(a, b) == Some(scale)
            && force == Some(scale)
            && stiffness(a) == stiffness(b)
    }

    /// Bounds of the unknowns, and limits of what is not an unknown.
    fn ranges(
        &self,
        coordinates: &AffineMap,
        densities: &AffineMap,
        variables: usize,
    ) -> (Vec<f64>, Vec<f64>, Vec<Limit>) {
        let s = self.structure;
        let mut lower = vec![f64::NEG_INFINITY; variables];
        let mut upper = vec![f64::INFINITY; variables];
        let mut limits = Vec::new();
        let mut bound = |map: &AffineMap, row: usize, range: Interval| {
            if let &[(j, c)] = map.row(row) {
                let ends = [range.lo, range.hi].map(|end| (end - map.offset(row)) / c);
                lower[j] = f64::max(lower[j], ends[0].min(ends[1]));
                upper[j] = f64::min(upper[j], ends[0].max(ends[1]));
            }
        };
        if let Some(half) = s.base_range {
            for axis in 0..s.dimension {
                bound(coordinates, axis, Interval::new(-half[axis], half[axis]));
            }
        }
        for (e, element) in s.elements.iter().enumerate() {
            let moves = element
                .nodes
                .iter()
                .any(|&node| (0..3).any(|axis| !coordinates.row(3 * node + axis).is_empty()));
            let mut limit = |quantity: Quantity, range: Interval| {
                let unit = match quantity {
                    Quantity::Length | Quantity::Rest { .. } => self.size,
                    Quantity::Force => self.force / self.force_weight,
                };
                for (end, sign) in [(range.lo, 1.0), (range.hi, -1.0)] {
                    if end.is_finite() && moves {
                        limits.push(Limit {
                            link: e,
                            quantity,
                            bound: end,
                            weight: sign / unit,
                        });
                    }
                }
            };
            let shortest = SHORTEST * self.size.min(self.reference_lengths[e]);
            let length = Interval::new(element.length.lo.max(shortest), element.length.hi);
            match (element.law, self.links[e].density) {
                (ForceLaw::Free, Density::Unknown(row)) if element.has_constant_length() => {
                    let l = element.length.lo;
                    bound(
                        densities,
                        row,
                        Interval::new(element.force.lo / l, element.force.hi / l),
                    );
                }
                (ForceLaw::Linear { stiffness: k, rest }, Density::Unknown(row)) => {
                    // Signs of force and rest length are bounds of the density.
                    let mut density = Interval::new(f64::NEG_INFINITY, f64::INFINITY);
                    let mut force = element.force;
                    let mut rest = rest;
                    if force.lo == 0.0 {
                        density.lo = 0.0;
                        force.lo = f64::NEG_INFINITY;
                    }
                    if force.hi == 0.0 {
                        density.hi = 0.0;
                        force.hi = f64::INFINITY;
                    }
                    if rest.lo == 0.0 {
                        if k > 0.0 {
                            density.hi = density.hi.min(k);
                        } else {
                            density.lo = density.lo.max(k);
                        }
                        rest.lo = f64::NEG_INFINITY;
                    }
                    bound(densities, row, density);
                    // What the ranges of length and rest length imply is no limit.
                    let ends = [
                        k * (element.length.lo - rest.hi),
                        k * (element.length.hi - element.rest().map_or(0.0, |r| r.lo)),
                    ];
                    let (implied_lo, implied_hi) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
                    if force.lo <= implied_lo {
                        force.lo = f64::NEG_INFINITY;
                    }
                    if force.hi >= implied_hi * (1.0 - 1e-9) {
                        force.hi = f64::INFINITY;
                    }
                    limit(Quantity::Length, length);
                    limit(Quantity::Rest { stiffness: k }, rest);
                    limit(Quantity::Force, force);
                }
                (ForceLaw::Linear { stiffness: k, rest }, _) => {
                    // The force follows from the length: one range of lengths.
                    let ends =
                        [element.force.lo, element.force.hi].map(|force| rest.lo + force / k);
                    let by_force = Interval::new(ends[0].min(ends[1]), ends[0].max(ends[1]));
                    limit(Quantity::Length, length.intersection(&by_force));
                }
                _ if !element.has_constant_length() => limit(Quantity::Length, length),
                _ => {}
            }
        }
        (lower, upper, limits)
    }
}
