//! The `nodes` formulation: node coordinates and force densities.
//!
//! Unknowns are the node coordinates that no linear condition determines
//! (gauge, planarity, directions coupled between elements of constant length)
//! and the force densities q = f / l of elements whose force does not follow
//! from their length. Everything with a closed form is eliminated: lengths are
//! distances, rest lengths are r = l − f/k, a spring has q = k (1 − r/l), and
//! elements of one force share one unknown.
//!
//! Equations: force balance Σ q (p_b − p_a) + load = 0 at every balanced node,
//! |p_a − p_b|² = L² for every element of constant length, the pretension
//! Σ (q l)² = P², and those couplings that are not linear. Ranges of lengths,
//! rest lengths and forces are bounds of an unknown where they can be, and
//! limits otherwise.
//!
//! Unknowns are scaled by the structure's size and by its forces, so that
//! distances mean the same for a structure of any size and any pretension.
//! Residual and limits cost O(elements).

use std::cell::RefCell;
use std::collections::BTreeMap;

use nalgebra::{Point3, Vector3};
use tensegra_atlas::{ImplicitManifold, SparseRow, SparsityPattern};

use super::{EquilibriumError, EquilibriumManifold, affine::AffineMap, affine::Elimination};
use crate::{
    configuration::Configuration,
    structure::{Coupling, Element, ForceLaw, Interval, Structure},
};

/// Elements that may shrink to nothing keep this fraction of the structure's
/// size: at length zero the direction of the force is undefined.
const SHORTEST: f64 = 1e-2;

/// How the force density of a link is known.
#[derive(Clone, Copy, Debug)]
enum Density {
    /// The link carries no force.
    None,
    /// q is constant: a spring of rest length zero.
    Constant(f64),
    /// q is an unknown, at this row of the map of densities.
    Unknown(usize),
    /// q = k (1 − r / l).
    Spring { stiffness: f64, rest: f64 },
}

/// A pair of nodes whose distance matters: an element, or two anchors of an
/// attachment.
#[derive(Clone, Debug)]
struct Link {
    nodes: [usize; 2],
    density: Density,
}

/// What an entry of the Jacobian is made of: a function of one link's vector
/// d = p_b − p_a, length l, density q, and s = (dq/dl) / l.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Atom {
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

/// A residual that is not force balance.
#[derive(Clone, Debug)]
enum Equation {
    /// (|d|² − L²) / (2 L size).
    Length { link: usize, length: f64 },
    /// (Σ f² − P²) / (2 P²).
    Pretension { links: Vec<usize>, norm: f64 },
    /// (l_a − s l_b) / size.
    EqualLengths { links: [usize; 2], scale: f64 },
    /// (r_a − s r_b) / size, with the stiffnesses.
    EqualRests {
        links: [usize; 2],
        stiffness: [f64; 2],
        scale: f64,
    },
    /// (f_a − s f_b) / force.
    EqualForces { links: [usize; 2], scale: f64 },
    /// Component `axis` of d_a / l_a − R d_b / l_b.
    EqualDirections {
        links: [usize; 2],
        rotation: Vector3<f64>,
        axis: usize,
    },
}

/// A range of a derived quantity, one end of it.
#[derive(Clone, Copy, Debug)]
struct Limit {
    link: usize,
    quantity: Quantity,
    bound: f64,
    /// +1 for a lower end, −1 for an upper one.
    sign: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Quantity {
    Length,
    Rest { stiffness: f64 },
    Force,
}

/// State of one link at a point.
#[derive(Clone, Copy, Debug, Default)]
struct LinkState {
    d: [f64; 3],
    length: f64,
    density: f64,
    /// (dq/dl) / l.
    slope: f64,
}

#[derive(Default)]
struct Scratch {
    positions: Vec<[f64; 3]>,
    links: Vec<LinkState>,
    atoms: Vec<f64>,
}

thread_local! {
    static SCRATCH: RefCell<Scratch> = RefCell::default();
}

/// The equilibrium manifold in node coordinates and force densities.
#[derive(Clone, Debug)]
pub struct NodesManifold {
    structure: Structure,
    size: f64,
    force: f64,
    /// Weight of a force relative to a coordinate.
    force_weight: f64,
    variables: usize,
    raw_variables: usize,
    raw_equations: usize,
    coordinates: AffineMap,
    densities: AffineMap,
    links: Vec<Link>,
    loads: Vec<[f64; 3]>,
    /// Equation of each node and axis; `usize::MAX` where there is none.
    balance: Vec<[usize; 3]>,
    balance_count: usize,
    equations: Vec<Equation>,
    limits: Vec<Limit>,
    lower: Vec<f64>,
    upper: Vec<f64>,
    names: Vec<String>,
    /// What each unknown is: a coordinate 3 node + axis, or a link's density.
    origins: Vec<Origin>,
    pattern: SparsityPattern,
    atoms: Vec<(usize, Atom)>,
    term_starts: Vec<usize>,
    terms: Vec<(u32, f64)>,
}

#[derive(Clone, Copy, Debug)]
enum Origin {
    Coordinate(usize),
    Density(usize),
}

impl NodesManifold {
    /// The equilibrium manifold of a structure. `reference` holds a typical
    /// position of every node (the start, say): it sets the scales.
    ///
    /// # Errors
    /// [`EquilibriumError`] when fixed coordinates and couplings contradict
    /// each other.
    pub fn new(structure: &Structure, reference: &[Point3<f64>]) -> Result<Self, EquilibriumError> {
        Builder::new(structure, reference).build()
    }

    /// Length of the structure that counts as one unit of distance: the mean
    /// length of its compressed elements at the reference.
    pub fn size(&self) -> f64 {
        self.size
    }

    /// Number of variables before elimination: all coordinates, and a force
    /// density for each element whose force does not follow from its length.
    pub fn raw_variable_count(&self) -> usize {
        self.raw_variables
    }

    /// Number of equations before elimination: the linear conditions on these
    /// variables (planarity, gauge, couplings), and the equations that remain.
    pub fn raw_equation_count(&self) -> usize {
        self.raw_equations
    }

    /// Force that counts as one unit: the pretension, or an estimate from stiffnesses and loads.
    pub fn force_unit(&self) -> f64 {
        self.force
    }

    /// Force density q = f / l of an element at x; 0 for one that carries no force.
    pub fn force_density(&self, element: usize, x: &[f64]) -> f64 {
        self.evaluate_link(element, x).density
    }

    /// Adds `factor` times the gradient of an element's force density to `row`.
    pub fn force_density_gradient(
        &self,
        element: usize,
        x: &[f64],
        factor: f64,
        row: &mut SparseRow,
    ) {
        let LinkState { d, slope, .. } = self.evaluate_link(element, x);
        self.add_link_gradient(element, d.map(|d| factor * slope * d), factor, row);
    }

    /// Name of an equation, for messages.
    pub fn equation_name(&self, equation: usize) -> String {
        let elements = &self.structure.elements;
        let link = |link: usize| match elements.get(link) {
            Some(element) => element.name.clone(),
            None => {
                let [a, b] = self.links[link].nodes;
                let node = |i: usize| self.structure.nodes[i].name.as_str();
                format!("{}–{}", node(a), node(b))
            }
        };
        let pair = |[a, b]: [usize; 2]| format!("{} and {}", link(a), link(b));
        if equation < self.balance_count {
            for (node, rows) in self.balance.iter().enumerate() {
                if let Some(axis) = rows.iter().position(|&row| row == equation) {
                    let (axis, node) = (["x", "y", "z"][axis], &self.structure.nodes[node].name);
                    return format!("force balance of {node} along {axis}");
                }
            }
        }
        match &self.equations[equation - self.balance_count] {
            Equation::Length { link: l, length } => format!("length {length} of {}", link(*l)),
            Equation::Pretension { norm, .. } => format!("pretension {norm}"),
            Equation::EqualLengths { links, .. } => format!("coupled lengths of {}", pair(*links)),
            Equation::EqualRests { links, .. } => {
                format!("coupled rest lengths of {}", pair(*links))
            }
            Equation::EqualForces { links, .. } => format!("coupled forces of {}", pair(*links)),
            Equation::EqualDirections { links, .. } => {
                format!("coupled directions of {}", pair(*links))
            }
        }
    }

    /// Number of equations of force balance, which come first.
    pub fn balance_count(&self) -> usize {
        self.balance_count
    }

    /// The unit in which the residual of an equation counts, in the problem's units.
    pub fn equation_unit(&self, equation: usize) -> f64 {
        if equation < self.balance_count {
            return self.force;
        }
        match &self.equations[equation - self.balance_count] {
            Equation::Length { .. }
            | Equation::EqualLengths { .. }
            | Equation::EqualRests { .. } => self.size,
            Equation::EqualForces { .. } => self.force,
            Equation::Pretension { norm, .. } => *norm,
            Equation::EqualDirections { .. } => 1.0,
        }
    }

    /// The unit in which a limit counts, in the problem's units.
    pub fn limit_unit(&self, limit: usize) -> f64 {
        match self.limits[limit].quantity {
            Quantity::Length | Quantity::Rest { .. } => self.size,
            Quantity::Force => self.force / self.force_weight,
        }
    }

    fn evaluate_links(&self, x: &[f64], scratch: &mut Scratch) {
        let Scratch {
            positions, links, ..
        } = scratch;
        positions.resize(self.structure.nodes.len(), [0.0; 3]);
        self.coordinates.values(x, positions.as_flattened_mut());
        links.clear();
        for (i, link) in self.links.iter().enumerate() {
            let [a, b] = link.nodes;
            let (pa, pb) = (&positions[a], &positions[b]);
            let d = [pb[0] - pa[0], pb[1] - pa[1], pb[2] - pa[2]];
            links.push(self.link_state(i, d, x));
        }
    }

    /// The state of one link: what [`Self::evaluate_links`] does for all.
    fn evaluate_link(&self, link: usize, x: &[f64]) -> LinkState {
        let [a, b] = self.links[link].nodes;
        let d = [0, 1, 2].map(|axis| {
            self.coordinates.value(3 * b + axis, x) - self.coordinates.value(3 * a + axis, x)
        });
        self.link_state(link, d, x)
    }

    #[inline]
    fn link_state(&self, link: usize, d: [f64; 3], x: &[f64]) -> LinkState {
        let length = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
        let (density, slope) = match self.links[link].density {
            Density::None => (0.0, 0.0),
            Density::Constant(q) => (q, 0.0),
            Density::Unknown(row) => (self.densities.value(row, x), 0.0),
            Density::Spring { stiffness, rest } => {
                let length = length.max(1e-9 * self.size);
                (
                    stiffness * (1.0 - rest / length),
                    stiffness * rest / length.powi(3),
                )
            }
        };
        LinkState {
            d,
            length,
            density,
            slope,
        }
    }

    fn evaluate_limit(&self, limit: &Limit, link: &LinkState) -> f64 {
        let value = match limit.quantity {
            Quantity::Length => (link.length - limit.bound) / self.size,
            Quantity::Rest { stiffness } => {
                (link.length * (1.0 - link.density / stiffness) - limit.bound) / self.size
            }
            Quantity::Force => {
                (link.density * link.length - limit.bound) * self.force_weight / self.force
            }
        };
        limit.sign * value
    }

    /// Adds the gradient of a function of one link, given its derivatives with
    /// respect to d (times one) and q.
    fn add_link_gradient(&self, link: usize, by_d: [f64; 3], by_q: f64, row: &mut SparseRow) {
        let [a, b] = self.links[link].nodes;
        for (axis, &g) in by_d.iter().enumerate() {
            if g != 0.0 {
                for &(j, c) in self.coordinates.row(3 * b + axis) {
                    row.add(j, g * c);
                }
                for &(j, c) in self.coordinates.row(3 * a + axis) {
                    row.add(j, -g * c);
                }
            }
        }
        if let Density::Unknown(q) = self.links[link].density {
            for &(j, c) in self.densities.row(q) {
                row.add(j, by_q * c);
            }
        }
    }
}

impl ImplicitManifold for NodesManifold {
    fn ambient_dimension(&self) -> usize {
        self.variables
    }

    fn equation_count(&self) -> usize {
        self.balance_count + self.equations.len()
    }

    fn residual(&self, x: &[f64], residual: &mut [f64]) {
        SCRATCH.with_borrow_mut(|scratch| {
            self.evaluate_links(x, scratch);
            let (balance, others) = residual.split_at_mut(self.balance_count);
            for (rows, load) in self.balance.iter().zip(&self.loads) {
                for (&row, &load) in rows.iter().zip(load) {
                    if row != usize::MAX {
                        balance[row] = load / self.force;
                    }
                }
            }
            let unit = 1.0 / self.force;
            for (link, state) in self.links.iter().zip(&scratch.links) {
                if state.density == 0.0 {
                    continue;
                }
                let [a, b] = link.nodes;
                let q = state.density * unit;
                for axis in 0..3 {
                    let force = q * state.d[axis];
                    let (row_a, row_b) = (self.balance[a][axis], self.balance[b][axis]);
                    if row_a != usize::MAX {
                        balance[row_a] += force;
                    }
                    if row_b != usize::MAX {
                        balance[row_b] -= force;
                    }
                }
            }
            let links = &scratch.links;
            let length = |i: usize| links[i].length;
            let force = |i: usize| links[i].density * links[i].length;
            for (equation, value) in self.equations.iter().zip(others) {
                *value = match equation {
                    Equation::Length { link, length: l } => {
                        let d = &links[*link].d;
                        let square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
                        (square - l * l) / (2.0 * l * self.size)
                    }
                    Equation::Pretension { links, norm } => {
                        let sum: f64 = links.iter().map(|&i| force(i).powi(2)).sum();
                        0.5 * (sum / (norm * norm) - 1.0)
                    }
                    Equation::EqualLengths {
                        links: [a, b],
                        scale,
                    } => (length(*a) - scale * length(*b)) / self.size,
                    Equation::EqualRests {
                        links: [a, b],
                        stiffness,
                        scale,
                    } => {
                        let rest = |i: usize, k: f64| length(i) - force(i) / k;
                        (rest(*a, stiffness[0]) - scale * rest(*b, stiffness[1])) / self.size
                    }
                    Equation::EqualForces {
                        links: [a, b],
                        scale,
                    } => (force(*a) - scale * force(*b)) / self.force,
                    Equation::EqualDirections {
                        links: [a, b],
                        rotation,
                        axis,
                    } => {
                        let turned: f64 = (0..3).map(|j| rotation[j] * links[*b].d[j]).sum();
                        links[*a].d[*axis] / length(*a) - turned / length(*b)
                    }
                };
            }
        });
    }

    fn jacobian_pattern(&self) -> &SparsityPattern {
        &self.pattern
    }

    fn jacobian(&self, x: &[f64], values: &mut [f64]) {
        SCRATCH.with_borrow_mut(|scratch| {
            self.evaluate_links(x, scratch);
            let Scratch { links, atoms, .. } = scratch;
            atoms.clear();
            atoms.extend(self.atoms.iter().map(|&(link, atom)| {
                let LinkState {
                    d,
                    length: l,
                    density: q,
                    slope: s,
                } = links[link];
                match atom {
                    Atom::One => 1.0,
                    Atom::Density => q,
                    Atom::Vector(i) => d[i],
                    Atom::DensitySlope(i, j) => s * d[i] * d[j],
                    Atom::SquaredForceByDensity => q * l * l,
                    Atom::SquaredForceByPosition(i) => (q * q + q * l * l * s) * d[i],
                    Atom::Length => l,
                    Atom::ForceByPosition(i) => (q / l + l * s) * d[i],
                    Atom::Direction(i) => d[i] / l,
                    Atom::DirectionByPosition(i, j) => {
                        (f64::from(u8::from(i == j)) - d[i] * d[j] / (l * l)) / l
                    }
                }
            }));
            for (value, range) in values.iter_mut().zip(self.term_starts.windows(2)) {
                *value = self.terms[range[0]..range[1]]
                    .iter()
                    .fold(0.0, |sum, &(atom, c)| sum + c * atoms[atom as usize]);
            }
        });
    }

    fn lower_bounds(&self) -> &[f64] {
        &self.lower
    }

    fn upper_bounds(&self) -> &[f64] {
        &self.upper
    }

    fn limit_count(&self) -> usize {
        self.limits.len()
    }

    fn limits(&self, x: &[f64], values: &mut [f64]) {
        SCRATCH.with_borrow_mut(|scratch| {
            self.evaluate_links(x, scratch);
            for (limit, value) in self.limits.iter().zip(values) {
                *value = self.evaluate_limit(limit, &scratch.links[limit.link]);
            }
        });
    }

    fn limit_gradient(&self, limit: usize, x: &[f64], row: &mut SparseRow) {
        let limit = &self.limits[limit];
        let LinkState {
            d,
            length: l,
            density: q,
            slope: s,
        } = self.evaluate_link(limit.link, x);
        let (by_length, by_q, unit) = match limit.quantity {
            Quantity::Length => (1.0, 0.0, 1.0 / self.size),
            Quantity::Rest { stiffness } => (
                1.0 - (q + l * l * s) / stiffness,
                -l / stiffness,
                1.0 / self.size,
            ),
            Quantity::Force => (q + l * l * s, l, self.force_weight / self.force),
        };
        let c = limit.sign * unit;
        self.add_link_gradient(limit.link, d.map(|d| c * by_length * d / l), c * by_q, row);
    }

    fn limit(&self, limit: usize, x: &[f64]) -> f64 {
        let limit = &self.limits[limit];
        self.evaluate_limit(limit, &self.evaluate_link(limit.link, x))
    }

    fn limit_name(&self, limit: usize) -> String {
        let limit = &self.limits[limit];
        let (quantity, end) = (
            match limit.quantity {
                Quantity::Length => "length",
                Quantity::Rest { .. } => "rest length",
                Quantity::Force => "force",
            },
            if limit.sign > 0.0 { "lower" } else { "upper" },
        );
        let name = &self.structure.elements[limit.link].name;
        format!("{end} limit {:.6} of the {quantity} of {name}", limit.bound)
    }

    fn variable_name(&self, variable: usize) -> String {
        self.names[variable].clone()
    }
}

impl EquilibriumManifold for NodesManifold {
    fn structure(&self) -> &Structure {
        &self.structure
    }

    fn positions(&self, x: &[f64], positions: &mut [Point3<f64>]) {
        for (node, p) in positions.iter_mut().enumerate() {
            for axis in 0..3 {
                p[axis] = self.coordinates.value(3 * node + axis, x);
            }
        }
    }

    fn pull_back(&self, _: &[f64], gradients: &[(usize, Vector3<f64>)], row: &mut SparseRow) {
        for &(node, gradient) in gradients {
            for axis in 0..3 {
                for &(j, c) in self.coordinates.row(3 * node + axis) {
                    row.add(j, c * gradient[axis]);
                }
            }
        }
    }

    fn configuration(&self, x: &[f64]) -> Configuration {
        SCRATCH.with_borrow_mut(|scratch| {
            self.evaluate_links(x, scratch);
            let elements = &self.structure.elements;
            let states = &scratch.links[..elements.len()];
            let force = |state: &LinkState| state.density * state.length;
            Configuration {
                positions: scratch.positions.iter().map(|&p| Point3::from(p)).collect(),
                lengths: states.iter().map(|state| state.length).collect(),
                rest_lengths: elements
                    .iter()
                    .zip(states)
                    .map(|(element, state)| match element.law {
                        ForceLaw::Linear { rest, .. } if rest.is_constant() => Some(rest.lo),
                        ForceLaw::Linear { stiffness, .. } => {
                            Some(state.length - force(state) / stiffness)
                        }
                        _ => None,
                    })
                    .collect(),
                forces: elements
                    .iter()
                    .zip(states)
                    .map(|(element, state)| element.carries_force().then(|| force(state)))
                    .collect(),
            }
        })
    }

    fn coordinates(&self, configuration: &Configuration) -> Vec<f64> {
        self.origins
            .iter()
            .enumerate()
            .map(|(j, origin)| match *origin {
                Origin::Coordinate(i) => configuration.positions[i / 3][i % 3] / self.size,
                Origin::Density(element) => {
                    let row = match self.links[element].density {
                        Density::Unknown(row) => row,
                        _ => return 0.0,
                    };
                    let scale = self.densities.row(row)[0].1;
                    debug_assert_eq!(self.densities.row(row)[0].0, j);
                    let force = configuration.forces[element].unwrap_or(0.0);
                    force / configuration.lengths[element] / scale
                }
            })
            .collect()
    }
}

/// Construction, step by step.
struct Builder<'a> {
    structure: &'a Structure,
    links: Vec<Link>,
    /// Element of each row of densities.
    unknown_densities: Vec<usize>,
    reference_lengths: Vec<f64>,
    size: f64,
    force: f64,
    force_weight: f64,
}

impl<'a> Builder<'a> {
    fn new(structure: &'a Structure, reference: &[Point3<f64>]) -> Self {
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
        let mean = |pick: &dyn Fn(&Element) -> bool| {
            let (mut sum, mut count) = (0.0, 0);
            for (element, length) in structure.elements.iter().zip(&reference_lengths) {
                if pick(element) {
                    sum += length;
                    count += 1;
                }
            }
            (count > 0).then(|| sum / f64::from(count))
        };
        use crate::structure::ElementKind::{Bar, Prismatic, Strut};
        let mean_length = mean(&|_| true).unwrap_or(1.0);
        let size = mean(&|e| e.carries_force() && matches!(e.kind, Strut | Bar | Prismatic))
            .unwrap_or(mean_length);
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

    fn build(mut self) -> Result<NodesManifold, EquilibriumError> {
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
        let variables = origins.len();

        let equations = self.equations(&coordinates);
        let mut balance = vec![[usize::MAX; 3]; node_count];
        let mut balance_count = 0;
        for (rows, node) in balance.iter_mut().zip(&s.nodes) {
            if node.balanced
                && self
                    .links
                    .iter()
                    .any(|l| !matches!(l.density, Density::None))
            {
                for row in &mut rows[..s.dimension] {
                    *row = balance_count;
                    balance_count += 1;
                }
            }
        }
        // A node where no force acts balances by itself.
        let mut loaded = vec![false; node_count];
        for link in &self.links {
            if !matches!(link.density, Density::None) {
                loaded[link.nodes[0]] = true;
                loaded[link.nodes[1]] = true;
            }
        }
        let mut renumbered = 0;
        for (node, rows) in balance.iter_mut().enumerate() {
            for row in rows.iter_mut().filter(|row| **row != usize::MAX) {
                if loaded[node] || s.nodes[node].load != Vector3::zeros() {
                    *row = renumbered;
                    renumbered += 1;
                } else {
                    *row = usize::MAX;
                }
            }
        }
        balance_count = renumbered;

        let (lower, upper, limits) = self.ranges(&coordinates, &densities, variables);
        let mut jacobian = JacobianTerms::new(
            balance_count + equations.len(),
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
                for (row, sign) in [(balance[a][axis], unit), (balance[b][axis], -unit)] {
                    if row == usize::MAX {
                        continue;
                    }
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
            self.differentiate(equation, balance_count + i, &mut jacobian);
        }
        let (pattern, atoms, term_starts, terms) = jacobian.finish(variables);
        Ok(NodesManifold {
            structure: s.clone(),
            size: self.size,
            force: self.force,
            force_weight: self.force_weight,
            variables,
            raw_variables: raw,
            raw_equations: conditions + balance_count + equations.len(),
            coordinates,
            densities,
            loads: s.nodes.iter().map(|node| node.load.into()).collect(),
            links: std::mem::take(&mut self.links),
            balance,
            balance_count,
            equations,
            limits,
            lower,
            upper,
            names,
            origins,
            pattern,
            atoms,
            term_starts,
            terms,
        })
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
                for (end, sign) in [(range.lo, 1.0), (range.hi, -1.0)] {
                    if end.is_finite() && moves {
                        limits.push(Limit {
                            link: e,
                            quantity,
                            bound: end,
                            sign,
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

    /// Adds the derivatives of an equation.
    fn differentiate(&self, equation: &Equation, row: usize, jacobian: &mut JacobianTerms) {
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
struct JacobianTerms<'a> {
    coordinates: &'a AffineMap,
    densities: &'a AffineMap,
    links: &'a [Link],
    atoms: BTreeMap<(usize, Atom), u32>,
    rows: Vec<BTreeMap<usize, Vec<(u32, f64)>>>,
}

impl<'a> JacobianTerms<'a> {
    fn new(
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

    fn atom(&mut self, link: usize, atom: Atom) -> u32 {
        let next = self.atoms.len() as u32;
        *self.atoms.entry((link, atom)).or_insert(next)
    }

    /// The derivative with respect to component `axis` of d = p_b − p_a.
    fn by_vector(&mut self, row: usize, link: usize, axis: usize, atom: Atom, c: f64) {
        let [a, b] = self.links[link].nodes;
        let atom = self.atom(link, atom);
        for (node, sign) in [(b, c), (a, -c)] {
            for &(j, s) in self.coordinates.row(3 * node + axis) {
                self.add(row, j, atom, sign * s);
            }
        }
    }

    /// The derivative with respect to q, where it is an unknown.
    fn by_density(&mut self, row: usize, link: usize, atom: Atom, c: f64) {
        if let Density::Unknown(q) = self.links[link].density {
            let atom = self.atom(link, atom);
            for &(j, s) in self.densities.row(q) {
                self.add(row, j, atom, c * s);
            }
        }
    }

    #[allow(clippy::type_complexity)]
    fn finish(
        self,
        variables: usize,
    ) -> (
        SparsityPattern,
        Vec<(usize, Atom)>,
        Vec<usize>,
        Vec<(u32, f64)>,
    ) {
        let mut atoms = vec![(0, Atom::One); self.atoms.len()];
        for ((link, atom), index) in self.atoms {
            atoms[index as usize] = (link, atom);
        }
        let columns: Vec<Vec<usize>> = self
            .rows
            .iter()
            .map(|row| row.keys().copied().collect())
            .collect();
        let mut starts = vec![0];
        let mut terms = Vec::new();
        for row in self.rows {
            for (_, entry) in row {
                terms.extend(entry.into_iter().filter(|(_, c)| *c != 0.0));
                starts.push(terms.len());
            }
        }
        (
            SparsityPattern::from_rows(variables, &columns),
            atoms,
            starts,
            terms,
        )
    }
}
