//! The `nodes` formulation: node coordinates and force densities.
//!
//! Unknowns are the node coordinates that no linear condition determines
//! (gauge, planarity, directions coupled between elements of constant length)
//! and the force densities q = f / l of elements whose force does not follow
//! from their length. Everything with a closed form is eliminated: lengths are
//! distances, rest lengths are r = l − f/k, a spring has q = k (1 − r/l), and
//! elements of one force share one unknown.
//!
//! Equations: force balance Σ q (p_b − p_a) + load = 0 at every balanced node, but
//! for what follows from the balance of the others where a structure stands alone;
//! |p_a − p_b|² = L² for every element of constant length, the pretension
//! Σ (q l)² = P², and those couplings that are not linear. Ranges of lengths,
//! rest lengths and forces are bounds of an unknown where they can be, and
//! limits otherwise.
//!
//! Unknowns are scaled by the structure's size and by its forces, so that
//! distances mean the same for a structure of any size and any pretension.
//! Residual and limits cost O(elements).

mod builder;
mod jacobian;

use std::cell::RefCell;

use nalgebra::{Point3, Vector3};
use tensegra_atlas::{ImplicitManifold, SparseRow, SparsityPattern};

use super::{
    ElementQuantity, EquilibriumError, EquilibriumManifold,
    affine::{AffineMap, AffineSums},
};
use crate::{
    configuration::Configuration,
    structure::{ForceLaw, Structure},
};
use builder::Builder;
use jacobian::Atom;

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

/// A node at which forces balance, along some axes at least.
#[derive(Clone, Debug)]
struct BalancedNode {
    /// Its load, in the unit of the equations, padded.
    load: [f64; NODE_VALUES],
    /// How many links pull at it.
    pulls: usize,
    /// Along how many axes there is an equation.
    axes: usize,
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
    /// What the distance to the bound counts, positive at a lower end, negative at an
    /// upper one.
    weight: f64,
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

impl LinkState {
    fn force(&self) -> f64 {
        self.density * self.length
    }

    fn value(&self, quantity: Quantity) -> f64 {
        match quantity {
            Quantity::Length => self.length,
            Quantity::Rest { stiffness } => self.length - self.force() / stiffness,
            Quantity::Force => self.force(),
        }
    }

    /// Derivatives of a quantity by length and by density.
    fn derivatives(&self, quantity: Quantity) -> (f64, f64) {
        let (l, q, s) = (self.length, self.density, self.slope);
        match quantity {
            Quantity::Length => (1.0, 0.0),
            Quantity::Rest { stiffness } => (1.0 - (q + l * l * s) / stiffness, -l / stiffness),
            Quantity::Force => (q + l * l * s, l),
        }
    }
}

/// Values of each link that [`Scratch::values`] begins with: d and q.
const LINK_VALUES: usize = 4;

/// Values of each node: a vector, and a fourth value of no meaning that makes it two
/// registers wide.
const NODE_VALUES: usize = 4;

#[derive(Default)]
struct Scratch {
    /// Places of nodes one after the other, then the force density of each link, springs
    /// apart.
    places: Vec<f64>,
    /// d and q of one link after the other, then the further atoms of the Jacobian.
    values: Vec<f64>,
    /// Difference of two points.
    change: Vec<f64>,
}

impl Scratch {
    fn link(&self, link: usize) -> ([f64; 3], f64) {
        let [x, y, z, q] = self.values.as_chunks::<LINK_VALUES>().0[link];
        ([x, y, z], q)
    }

    fn square(&self, link: usize) -> f64 {
        square(self.link(link).0)
    }

    fn length(&self, link: usize) -> f64 {
        self.square(link).sqrt()
    }

    fn force(&self, link: usize) -> f64 {
        self.length(link) * self.link(link).1
    }
}

#[inline]
fn square(d: [f64; 3]) -> f64 {
    d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
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
    variables: usize,
    raw_variables: usize,
    raw_equations: usize,
    coordinates: AffineMap,
    densities: AffineMap,
    /// The coordinates again, four rows a node, the fourth zero; then the force density
    /// of each link, zero for springs.
    places: AffineSums,
    links: Vec<Link>,
    /// The links that are springs.
    springs: Vec<usize>,
    /// The node and axis along which each equation of force balance holds.
    balance: Vec<[usize; 2]>,
    /// The nodes of these equations, one after the other.
    balanced: Vec<BalancedNode>,
    /// The links that pull at each of them, with ± the unit of the equations.
    pulls: Vec<(u32, f64)>,
    equations: Vec<Equation>,
    limits: Vec<Limit>,
    lower: Vec<f64>,
    upper: Vec<f64>,
    names: Vec<String>,
    /// What each unknown is: a coordinate 3 node + axis, or a link's density.
    origins: Vec<Origin>,
    pattern: SparsityPattern,
    /// What the Jacobian is made of besides the vectors and densities of links.
    atoms: Vec<(usize, Atom)>,
    /// The entries of the Jacobian, sums of multiples of all these.
    entries: AffineSums,
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

    /// Length of the structure that counts as one unit of distance:
    /// [`Structure::size`] at the reference.
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
        if let Some(&[node, axis]) = self.balance.get(equation) {
            let node = &self.structure.nodes[node].name;
            return format!("force balance of {node} along {}", ["x", "y", "z"][axis]);
        }
        match &self.equations[equation - self.balance.len()] {
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
        self.balance.len()
    }

    /// The unit in which the residual of an equation counts, in the problem's units.
    pub fn equation_unit(&self, equation: usize) -> f64 {
        if equation < self.balance.len() {
            return self.force;
        }
        match &self.equations[equation - self.balance.len()] {
            Equation::Length { .. }
            | Equation::EqualLengths { .. }
            | Equation::EqualRests { .. } => self.size,
            Equation::EqualForces { .. } => self.force,
            Equation::Pretension { norm, .. } => *norm,
            Equation::EqualDirections { .. } => 1.0,
        }
    }

    /// Whether an equation is about node positions alone: a length or direction, no force.
    pub fn equation_is_geometric(&self, equation: usize) -> bool {
        equation >= self.balance.len()
            && matches!(
                self.equations[equation - self.balance.len()],
                Equation::Length { .. }
                    | Equation::EqualLengths { .. }
                    | Equation::EqualDirections { .. }
            )
    }

    /// Whether a limit is one of a length, not of a rest length or force.
    pub fn limit_is_geometric(&self, limit: usize) -> bool {
        matches!(self.limits[limit].quantity, Quantity::Length)
    }

    /// Whether a variable is a coordinate of a node, not a force density.
    pub fn variable_is_geometric(&self, variable: usize) -> bool {
        matches!(self.origins[variable], Origin::Coordinate(_))
    }

    /// The unit in which a limit counts, in the problem's units.
    pub fn limit_unit(&self, limit: usize) -> f64 {
        1.0 / self.limits[limit].weight.abs()
    }

    fn evaluate_links(&self, x: &[f64], scratch: &mut Scratch) {
        self.place_nodes(x, scratch);
        let Scratch { places, values, .. } = scratch;
        let (places, densities) = places.split_at(NODE_VALUES * self.structure.nodes.len());
        let places = places.as_chunks::<NODE_VALUES>().0;
        values.resize(LINK_VALUES * self.links.len(), 0.0);
        let values = values.as_chunks_mut::<LINK_VALUES>().0;
        for ((link, &q), values) in self.links.iter().zip(densities).zip(&mut *values) {
            let [a, b] = link.nodes.map(|node| places[node]);
            *values = [b[0] - a[0], b[1] - a[1], b[2] - a[2], b[3] - a[3]];
            values[3] = q;
        }
        for &link in &self.springs {
            if let Density::Spring { stiffness, rest } = self.links[link].density {
                let [x, y, z, q] = &mut values[link];
                let length = self.spring_length(square([*x, *y, *z]).sqrt());
                *q = stiffness * (1.0 - rest / length);
            }
        }
    }

    /// Evaluates the places of nodes and what densities follow from no length.
    fn place_nodes(&self, x: &[f64], scratch: &mut Scratch) {
        scratch.places.resize(self.places.len(), 0.0);
        self.places.values(x, &mut scratch.places);
    }

    /// The vectors of the nodes among all places.
    fn node_vectors(&self, places: &[f64]) -> impl Iterator<Item = [f64; 3]> {
        let vectors = places.as_chunks::<NODE_VALUES>().0.iter();
        vectors
            .take(self.structure.nodes.len())
            .map(|&[x, y, z, _]| [x, y, z])
    }

    /// The direction of a spring's force is undefined at length zero.
    fn spring_length(&self, length: f64) -> f64 {
        length.max(1e-9 * self.size)
    }

    /// The state of one link: what [`Self::evaluate_links`] does for all.
    fn evaluate_link(&self, link: usize, x: &[f64]) -> LinkState {
        let [a, b] = self.links[link].nodes;
        let d = [0, 1, 2].map(|axis| {
            self.coordinates.value(3 * b + axis, x) - self.coordinates.value(3 * a + axis, x)
        });
        let length = square(d).sqrt();
        let density = match self.links[link].density {
            Density::None => 0.0,
            Density::Constant(q) => q,
            Density::Unknown(row) => self.densities.value(row, x),
            Density::Spring { stiffness, rest } => {
                stiffness * (1.0 - rest / self.spring_length(length))
            }
        };
        LinkState {
            d,
            length,
            density,
            slope: self.density_slope(link, length),
        }
    }

    /// s = (dq/dl) / l of a link of length l.
    fn density_slope(&self, link: usize, length: f64) -> f64 {
        match self.links[link].density {
            Density::Spring { stiffness, rest } => {
                stiffness * rest / self.spring_length(length).powi(3)
            }
            _ => 0.0,
        }
    }

    #[inline]
    fn evaluate_limit(&self, limit: &Limit, length: f64, density: f64) -> f64 {
        let value = match limit.quantity {
            Quantity::Length => length,
            Quantity::Rest { stiffness } => length * (1.0 - density / stiffness),
            Quantity::Force => density * length,
        };
        limit.weight * (value - limit.bound)
    }

    /// An element's quantity as one of its link; `None` where it has none.
    fn resolve(&self, quantity: ElementQuantity) -> Option<(usize, Quantity)> {
        let element = self.structure.elements.get(quantity.element())?;
        let resolved = match quantity {
            ElementQuantity::Length(_) => Quantity::Length,
            ElementQuantity::Rest(_) => Quantity::Rest {
                stiffness: element.stiffness()?,
            },
            ElementQuantity::Force(_) => element.carries_force().then_some(Quantity::Force)?,
        };
        Some((quantity.element(), resolved))
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
        self.balance.len() + self.equations.len()
    }

    fn residual(&self, x: &[f64], residual: &mut [f64]) {
        SCRATCH.with_borrow_mut(|scratch| {
            self.evaluate_links(x, scratch);
            let (balance, others) = residual.split_at_mut(self.balance.len());
            let states = scratch.values.as_chunks::<LINK_VALUES>().0;
            let mut pulls = self.pulls.iter();
            let mut rows = balance.iter_mut().zip(&self.balance);
            for node in &self.balanced {
                let mut force = node.load;
                for &(link, unit) in pulls.by_ref().take(node.pulls) {
                    let state = &states[link as usize];
                    let density = unit * state[3];
                    for i in 0..NODE_VALUES {
                        force[i] += density * state[i];
                    }
                }
                for (value, &[_, axis]) in rows.by_ref().take(node.axes) {
                    *value = force[axis];
                }
            }
            let scratch = &*scratch;
            let length = |i: usize| scratch.length(i);
            let force = |i: usize| scratch.force(i);
            for (equation, value) in self.equations.iter().zip(others) {
                *value = match equation {
                    Equation::Length { link, length: l } => {
                        (scratch.square(*link) - l * l) / (2.0 * l * self.size)
                    }
                    Equation::Pretension { links, norm } => {
                        let sum: f64 = links
                            .iter()
                            .map(|&i| scratch.square(i) * scratch.link(i).1.powi(2))
                            .sum();
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
                        let (d, other) = (scratch.link(*a).0, scratch.link(*b).0);
                        let turned: f64 = (0..3).map(|j| rotation[j] * other[j]).sum();
                        d[*axis] / length(*a) - turned / length(*b)
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
            for &(link, atom) in &self.atoms {
                let (d, q) = scratch.link(link);
                let square = square(d);
                let length = || square.sqrt();
                let slope = || self.density_slope(link, length());
                scratch.values.push(match atom {
                    Atom::One => 1.0,
                    Atom::Density => q,
                    Atom::Vector(i) => d[i],
                    Atom::DensitySlope(i, j) => slope() * d[i] * d[j],
                    Atom::SquaredForceByDensity => q * square,
                    Atom::SquaredForceByPosition(i) => (q * q + q * square * slope()) * d[i],
                    Atom::Length => length(),
                    Atom::ForceByPosition(i) => (q / length() + length() * slope()) * d[i],
                    Atom::Direction(i) => d[i] / length(),
                    Atom::DirectionByPosition(i, j) => {
                        (f64::from(u8::from(i == j)) - d[i] * d[j] / square) / length()
                    }
                });
            }
            self.entries.values(&scratch.values, values);
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
            // Those of a link follow one after the other.
            let (mut link, mut length, mut density) = (usize::MAX, 0.0, 0.0);
            for (limit, value) in self.limits.iter().zip(values) {
                if limit.link != link {
                    link = limit.link;
                    let (d, q) = scratch.link(link);
                    (length, density) = (square(d).sqrt(), q);
                }
                *value = self.evaluate_limit(limit, length, density);
            }
        });
    }

    fn limit_gradient(&self, limit: usize, x: &[f64], row: &mut SparseRow) {
        let limit = &self.limits[limit];
        let state = self.evaluate_link(limit.link, x);
        let (by_length, by_q) = state.derivatives(limit.quantity);
        let c = limit.weight;
        let by_d = state.d.map(|d| c * by_length * d / state.length);
        self.add_link_gradient(limit.link, by_d, c * by_q, row);
    }

    fn limit(&self, limit: usize, x: &[f64]) -> f64 {
        let limit = &self.limits[limit];
        let link = self.evaluate_link(limit.link, x);
        self.evaluate_limit(limit, link.length, link.density)
    }

    fn limit_name(&self, limit: usize) -> String {
        let limit = &self.limits[limit];
        let (quantity, end) = (
            match limit.quantity {
                Quantity::Length => "length",
                Quantity::Rest { .. } => "rest length",
                Quantity::Force => "force",
            },
            if limit.weight > 0.0 { "lower" } else { "upper" },
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
        SCRATCH.with_borrow_mut(|scratch| {
            self.place_nodes(x, scratch);
            let vectors = self.node_vectors(&scratch.places);
            for (position, vector) in positions.iter_mut().zip(vectors) {
                *position = vector.into();
            }
        });
    }

    fn displacement(&self, a: &[f64], b: &[f64]) -> f64 {
        SCRATCH.with_borrow_mut(|Scratch { places, change, .. }| {
            change.clear();
            change.extend(a.iter().zip(b).map(|(a, b)| b - a));
            places.clear();
            places.resize(self.places.len(), 0.0);
            self.places.add_changes(change, places);
            let squares = self.node_vectors(places).map(square);
            squares.fold(0.0, f64::max).sqrt()
        })
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

    fn quantity(&self, quantity: ElementQuantity, x: &[f64]) -> Option<f64> {
        let (element, quantity) = self.resolve(quantity)?;
        Some(self.evaluate_link(element, x).value(quantity))
    }

    fn forces_and_lengths(&self, x: &[f64], values: &mut Vec<[f64; 2]>) {
        SCRATCH.with_borrow_mut(|scratch| {
            self.evaluate_links(x, scratch);
            let states = scratch.values.as_chunks::<LINK_VALUES>().0.iter();
            values.clear();
            values.extend(
                states
                    .take(self.structure.elements.len())
                    .map(|&[x, y, z, q]| {
                        let length = square([x, y, z]).sqrt();
                        [q * length, length]
                    }),
            );
        });
    }

    fn quantity_gradient(&self, quantity: ElementQuantity, x: &[f64], row: &mut SparseRow) {
        if let Some((element, quantity)) = self.resolve(quantity) {
            let state = self.evaluate_link(element, x);
            let (by_length, by_q) = state.derivatives(quantity);
            let by_d = state.d.map(|d| by_length * d / state.length);
            self.add_link_gradient(element, by_d, by_q, row);
        }
    }

    fn configuration(&self, x: &[f64]) -> Configuration {
        SCRATCH.with_borrow_mut(|scratch| {
            self.evaluate_links(x, scratch);
            let elements = &self.structure.elements;
            let lengths: Vec<f64> = (0..elements.len()).map(|e| scratch.length(e)).collect();
            Configuration {
                positions: self
                    .node_vectors(&scratch.places)
                    .map(Point3::from)
                    .collect(),
                rest_lengths: elements
                    .iter()
                    .enumerate()
                    .map(|(e, element)| match element.law {
                        ForceLaw::Linear { rest, .. } if rest.is_constant() => Some(rest.lo),
                        ForceLaw::Linear { stiffness, .. } => {
                            Some(lengths[e] - scratch.force(e) / stiffness)
                        }
                        _ => None,
                    })
                    .collect(),
                forces: elements
                    .iter()
                    .enumerate()
                    .map(|(e, element)| element.carries_force().then(|| scratch.force(e)))
                    .collect(),
                lengths,
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
