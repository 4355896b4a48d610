//! The `directions` formulation: unit directions, lengths, rest lengths and
//! forces, as in Porta and Hernández-Juan (2016), section 3.
//!
//! The system as the paper states it (`raw`) is simplified (`simplify`): what a
//! linear equation in one or two variables determines is substituted, and
//! equations that hold by themselves are dropped. The variables left are the
//! coordinates of the manifold, and the coordinates in which lengths and control
//! efforts of paths are measured: constants do not count, what is coupled counts
//! once, and a force that is a multiple of a length does not count at all.
//!
//! All equations have degree two; residual and Jacobian are sums over flat arrays
//! of terms. Their cost is O(elements × depth of the spanning tree), without
//! allocation.

mod polynomial;
mod raw;
mod simplify;
#[cfg(test)]
mod tests;

use nalgebra::{Matrix3, Point3, Vector3};
use tensegra_atlas::{ImplicitManifold, SparseRow, SparsityPattern};

use self::{
    polynomial::{Affine, QuadraticSystem},
    raw::{ElementVariables, Layout, Length, RawSystem, RawVariable, SpanningTree},
    simplify::{Simplified, range_of_argument, simplify},
};
use super::{ElementQuantity, EquilibriumError, EquilibriumManifold};
use crate::{
    configuration::Configuration,
    structure::{Attachment, Interval, Structure},
};

/// Elements whose range of lengths begins at zero keep this fraction of the
/// least upper end of all ranges of lengths: at length zero their direction is
/// undefined, and the manifold singular.
const SHORTEST: f64 = 1e-2;

/// How far a constant may be out of its range.
const OUT_OF_RANGE: f64 = 1e-9;

/// Sizes of a system of equations before and after simplification.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct EquationCounts {
    /// Variables before simplification.
    pub raw_variables: usize,
    /// Equations before simplification.
    pub raw_equations: usize,
    /// Variables: the dimension of the ambient space.
    pub variables: usize,
    /// Equations, those among them included that follow from others.
    pub equations: usize,
}

/// The equilibrium manifold in directions, lengths, rest lengths and forces.
///
/// ```
/// use tensegra_atlas::ImplicitManifold;
/// use tensegra_model::{DirectionsManifold, StructureBuilder};
///
/// // Two crossing struts within four cables.
/// let structure = StructureBuilder::planar()
///     .strut("s1", ["n1", "n2"], 1.0)
///     .strut("s2", ["n3", "n4"], 1.0)
///     .cable("c1", ["n1", "n3"], 0.0..=3.0, 1.0, 0.0..=2.0)
///     .cable("c2", ["n2", "n3"], 0.0..=3.0, 1.0, 0.0..=2.0)
///     .cable("c3", ["n1", "n4"], 0.0..=3.0, 1.0, 0.0..=2.0)
///     .cable("c4", ["n2", "n4"], 0.0..=3.0, 1.0, 0.0..=2.0)
///     .free_flying([3.0, 3.0, 0.0])
///     .build()?;
/// let manifold = DirectionsManifold::new(&structure)?;
/// let counts = manifold.counts();
/// assert_eq!((counts.raw_variables, counts.raw_equations), (34, 38));
/// assert_eq!((counts.variables, counts.equations), (28, 25));
/// assert_eq!(manifold.variable_name(0), "direction x of s1");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct DirectionsManifold {
    structure: Structure,
    layout: Layout,
    tree: SpanningTree,
    /// Where node 0 is, unless the structure flies freely.
    origin: Vector3<f64>,
    /// Every variable of the paper's system in terms of the coordinates.
    values: Vec<Affine>,
    /// The variable of the paper's system that each coordinate is.
    kept: Vec<usize>,
    names: Vec<String>,
    lower: Vec<f64>,
    upper: Vec<f64>,
    system: QuadraticSystem,
    counts: EquationCounts,
}

impl DirectionsManifold {
    /// The equilibrium manifold of a structure.
    ///
    /// # Errors
    /// [`EquilibriumError`] when parts of the structure hang together by no
    /// element, when its conditions contradict each other, or when they leave no
    /// value of a quantity within its range.
    pub fn new(structure: &Structure) -> Result<Self, EquilibriumError> {
        let RawSystem {
            variables,
            equations,
            layout,
            tree,
        } = RawSystem::new(structure)?;
        let raw_equations = equations.len();
        let Simplified {
            values,
            kept,
            equations,
        } = simplify(&variables, equations)?;
        let system = QuadraticSystem::new(kept.len(), &equations);
        let (lower, upper) = bounds(structure, &variables, &layout, &values, &kept)?;
        Ok(Self {
            structure: structure.clone(),
            origin: raw::origin(structure),
            counts: EquationCounts {
                raw_variables: variables.len(),
                raw_equations,
                variables: kept.len(),
                equations: equations.len(),
            },
            names: kept.iter().map(|&i| variables[i].name.clone()).collect(),
            layout,
            tree,
            values,
            kept,
            lower,
            upper,
            system,
        })
    }

    /// Numbers of variables and equations before and after simplification.
    pub fn counts(&self) -> EquationCounts {
        self.counts
    }

    /// Potential energy E = ½ Σ k (l − r)² of the elements with a linear law at
    /// the coordinates x (eq. 19).
    ///
    /// # Units
    /// Force times length.
    pub fn potential_energy(&self, x: &[f64]) -> f64 {
        self.elastic_elements()
            .map(|(stiffness, element, rest)| {
                let stretch = self.length(element, x) - self.values[rest].value(x);
                0.5 * stiffness * stretch * stretch
            })
            .sum()
    }

    /// Writes the gradient of the potential energy with respect to the
    /// coordinates (eq. 20; m values).
    pub fn potential_energy_gradient(&self, x: &[f64], gradient: &mut [f64]) {
        gradient.fill(0.0);
        for (stiffness, element, rest) in self.elastic_elements() {
            let force = stiffness * (self.length(element, x) - self.values[rest].value(x));
            if let Length::Variable(length) = element.length
                && let Some((i, scale)) = self.values[length].variable
            {
                gradient[i] += force * scale;
            }
            if let Some((i, scale)) = self.values[rest].variable {
                gradient[i] -= force * scale;
            }
        }
    }

    /// Stiffness, variables and rest length of the elements with a linear law.
    fn elastic_elements(&self) -> impl Iterator<Item = (f64, &ElementVariables, usize)> {
        self.structure
            .elements
            .iter()
            .zip(&self.layout.elements)
            .filter_map(|(element, variables)| {
                Some((element.stiffness()?, variables, variables.rest?))
            })
    }

    fn length(&self, element: &ElementVariables, x: &[f64]) -> f64 {
        match element.length {
            Length::Constant(length) => length,
            Length::Variable(i) => self.values[i].value(x),
        }
    }

    /// An element's quantity in terms of the coordinates.
    fn affine(&self, quantity: ElementQuantity) -> Option<Affine> {
        let element = self.layout.elements.get(quantity.element())?;
        let variable = match quantity {
            ElementQuantity::Length(_) => match element.length {
                Length::Constant(length) => return Some(Affine::constant(length)),
                Length::Variable(i) => i,
            },
            ElementQuantity::Rest(_) => element.rest?,
            ElementQuantity::Force(_) => element.force?,
        };
        Some(self.values[variable])
    }

    fn vector(&self, variables: &[usize; 3], x: &[f64]) -> Vector3<f64> {
        Vector3::from_fn(|axis, _| self.values[variables[axis]].value(x))
    }
}

/// The bounds of the coordinates: the ranges of all variables that depend on
/// each of them.
fn bounds(
    structure: &Structure,
    variables: &[RawVariable],
    layout: &Layout,
    values: &[Affine],
    kept: &[usize],
) -> Result<(Vec<f64>, Vec<f64>), EquilibriumError> {
    let mut ranges: Vec<Interval> = variables.iter().map(|v| v.range).collect();
    let lengths = structure.elements.iter().map(|e| e.length.hi);
    let shortest = SHORTEST * lengths.fold(f64::INFINITY, f64::min);
    for element in &layout.elements {
        if let Length::Variable(i) = element.length
            && ranges[i].lo <= 0.0
            && shortest.is_finite()
        {
            ranges[i].lo = shortest;
        }
    }
    // What the equations imply by themselves is no bound: a direction may turn
    // through its extreme values, where the gradient of such a bound vanishes and
    // its linearisation would be a wall.
    let everything = Interval::new(f64::NEG_INFINITY, f64::INFINITY);
    let elements = layout.elements.iter().map(|e| e.direction);
    let frames = layout
        .frames
        .iter()
        .flat_map(|f| f.axes.into_iter().chain([f.origin]));
    let loose = layout.loose_nodes.iter().map(|(_, position)| *position);
    for i in elements.chain(frames).chain(loose).flatten() {
        ranges[i] = everything;
    }
    let mut bounds = vec![everything; kept.len()];
    for ((variable, range), value) in variables.iter().zip(ranges).zip(values) {
        match value.variable {
            Some((i, scale)) => {
                let range = range_of_argument(range, scale, value.offset);
                bounds[i] = bounds[i].intersection(&range);
                if bounds[i].lo > bounds[i].hi {
                    return Err(EquilibriumError::NoAdmissibleValue {
                        quantity: variables[kept[i]].name.clone(),
                        least: bounds[i].lo,
                        most: bounds[i].hi,
                    });
                }
            }
            None => {
                let slack = OUT_OF_RANGE * value.offset.abs().max(1.0);
                if range.margin(value.offset) < -slack {
                    return Err(EquilibriumError::OutOfRange {
                        quantity: variable.name.clone(),
                        value: value.offset,
                        lo: range.lo,
                        hi: range.hi,
                    });
                }
            }
        }
    }
    Ok(bounds.iter().map(|b| (b.lo, b.hi)).unzip())
}

impl ImplicitManifold for DirectionsManifold {
    fn ambient_dimension(&self) -> usize {
        self.kept.len()
    }

    fn equation_count(&self) -> usize {
        self.system.equation_count()
    }

    fn residual(&self, x: &[f64], residual: &mut [f64]) {
        self.system.residual(x, residual);
    }

    fn jacobian_pattern(&self) -> &SparsityPattern {
        self.system.pattern()
    }

    fn jacobian(&self, x: &[f64], values: &mut [f64]) {
        self.system.jacobian(x, values);
    }

    fn lower_bounds(&self) -> &[f64] {
        &self.lower
    }

    fn upper_bounds(&self) -> &[f64] {
        &self.upper
    }

    fn variable_name(&self, variable: usize) -> String {
        self.names[variable].clone()
    }
}

impl EquilibriumManifold for DirectionsManifold {
    fn structure(&self) -> &Structure {
        &self.structure
    }

    fn positions(&self, x: &[f64], positions: &mut [Point3<f64>]) {
        let Some(first) = positions.first_mut() else {
            return;
        };
        *first = self.origin.into();
        for (axis, &i) in self.layout.base.iter().enumerate() {
            first[axis] = self.values[i].value(x);
        }
        for branch in &self.tree.branches {
            let element = &self.layout.elements[branch.element];
            let step = branch.sign * self.length(element, x);
            positions[branch.node] =
                positions[branch.parent] + step * self.vector(&element.direction, x);
        }
    }

    fn pull_back(&self, x: &[f64], gradients: &[(usize, Vector3<f64>)], row: &mut SparseRow) {
        for &(node, gradient) in gradients {
            for (axis, &i) in self.layout.base.iter().enumerate() {
                if let Some((j, scale)) = self.values[i].variable {
                    row.add(j, scale * gradient[axis]);
                }
            }
            for branch in self.tree.path(node) {
                let element = &self.layout.elements[branch.element];
                let gradient = branch.sign * gradient;
                let length = self.length(element, x);
                for (axis, &i) in element.direction.iter().enumerate() {
                    if let Some((j, scale)) = self.values[i].variable {
                        row.add(j, length * scale * gradient[axis]);
                    }
                }
                if let Length::Variable(i) = element.length
                    && let Some((j, scale)) = self.values[i].variable
                {
                    row.add(j, scale * gradient.dot(&self.vector(&element.direction, x)));
                }
            }
        }
    }

    fn quantity(&self, quantity: ElementQuantity, x: &[f64]) -> Option<f64> {
        Some(self.affine(quantity)?.value(x))
    }

    fn quantity_gradient(&self, quantity: ElementQuantity, _: &[f64], row: &mut SparseRow) {
        if let Some((variable, scale)) = self.affine(quantity).and_then(|a| a.variable) {
            row.add(variable, scale);
        }
    }

    fn configuration(&self, x: &[f64]) -> Configuration {
        let mut positions = vec![Point3::origin(); self.structure.nodes.len()];
        self.positions(x, &mut positions);
        let elements = &self.layout.elements;
        let value = |i: usize| self.values[i].value(x);
        Configuration {
            positions,
            lengths: elements.iter().map(|e| self.length(e, x)).collect(),
            rest_lengths: elements.iter().map(|e| e.rest.map(value)).collect(),
            forces: elements.iter().map(|e| e.force.map(value)).collect(),
        }
    }

    fn coordinates(&self, configuration: &Configuration) -> Vec<f64> {
        let Configuration {
            positions,
            lengths,
            rest_lengths,
            forces,
        } = configuration;
        let mut raw = vec![0.0; self.values.len()];
        let mut write = |variables: &[usize], values: &[f64]| {
            for (&i, &value) in variables.iter().zip(values) {
                raw[i] = value;
            }
        };
        for (e, variables) in self.layout.elements.iter().enumerate() {
            let element = &self.structure.elements[e];
            let [a, b] = element.nodes;
            let direction = (positions[b] - positions[a])
                .try_normalize(0.0)
                .unwrap_or_else(Vector3::x);
            write(&variables.direction, direction.as_slice());
            if let Length::Variable(i) = variables.length {
                write(&[i], &[lengths[e]]);
            }
            // What a configuration leaves open follows from the force law.
            let (length, rest, force) = (lengths[e], rest_lengths[e], forces[e]);
            let (rest, force) = match element.stiffness() {
                Some(k) => (
                    rest.unwrap_or(length - force.unwrap_or(0.0) / k),
                    force.or(rest.map(|rest| k * (length - rest))),
                ),
                None => (0.0, force),
            };
            if let Some(i) = variables.rest {
                write(&[i], &[rest]);
            }
            if let Some(i) = variables.force {
                write(&[i], &[force.unwrap_or(0.0)]);
            }
        }
        for (attachment, frame) in self.structure.attachments.iter().zip(&self.layout.frames) {
            let (axes, origin) = frame_of(attachment, positions);
            for (variables, axis) in frame.axes.iter().zip(axes.column_iter()) {
                write(variables, axis.clone_owned().as_slice());
            }
            write(&frame.origin, origin.as_slice());
        }
        for (node, variables) in &self.layout.loose_nodes {
            write(variables, positions[*node].coords.as_slice());
        }
        if let Some(first) = positions.first() {
            write(&self.layout.base, first.coords.as_slice());
        }
        self.kept.iter().map(|&i| raw[i]).collect()
    }
}

/// The axes (columns) and the origin of the frame of an attachment whose anchors
/// are at their nodes.
fn frame_of(
    Attachment { anchors, .. }: &Attachment,
    positions: &[Point3<f64>],
) -> (Matrix3<f64>, Vector3<f64>) {
    let local = triad(anchors.map(|anchor| anchor.local));
    let world = triad(anchors.map(|anchor| positions[anchor.node]));
    let axes = world * local.transpose();
    let first = anchors[0];
    let origin = positions[first.node].coords - axes * first.local.coords;
    (axes, origin)
}

/// An orthonormal right-handed frame that is fixed to three points.
fn triad([a, b, c]: [Point3<f64>; 3]) -> Matrix3<f64> {
    let x = (b - a).try_normalize(0.0).unwrap_or_else(Vector3::x);
    let z = x.cross(&(c - a)).try_normalize(0.0).unwrap_or_else(|| {
        x.cross(&Vector3::y())
            .try_normalize(0.0)
            .unwrap_or_else(Vector3::z)
    });
    Matrix3::from_columns(&[x, z.cross(&x), z])
}
