//! Builds structures and validates them: the one way from declarations, in Rust
//! or in a file, to a [`Structure`].
//!
//! Cost: linear in the size of the declarations.

use std::{
    collections::{HashMap, HashSet},
    ops::RangeInclusive,
};

use nalgebra::{Point3, Rotation3, Vector3};

use crate::{
    build_errors::BuildErrors,
    diagnostic::did_you_mean,
    structure::{
        Anchor, Appearance, AttachedShape, Attachment, Coupling, Element, ElementKind,
        FixedCoordinate, ForceLaw, Interval, Node, Structure,
    },
    validate::{ElementPart, Place, StructureError, StructureFlaw},
};

impl ElementKind {
    /// Radius of an element that states none.
    pub const fn default_radius(self) -> f64 {
        match self {
            Self::Strut | Self::Bar | Self::Prismatic => 0.025,
            Self::Cable => 0.003_125,
            Self::Spring => 0.006_25,
        }
    }

    /// Forces that the kind can carry, tension positive.
    const fn natural_force(self) -> Interval {
        match self {
            Self::Strut => Interval::new(f64::NEG_INFINITY, 0.0),
            Self::Cable | Self::Spring => Interval::new(0.0, f64::INFINITY),
            Self::Bar | Self::Prismatic => Interval::new(f64::NEG_INFINITY, f64::INFINITY),
        }
    }
}

impl From<f64> for Interval {
    fn from(value: f64) -> Self {
        Self::constant(value)
    }
}

impl From<[f64; 2]> for Interval {
    fn from([lo, hi]: [f64; 2]) -> Self {
        Self { lo, hi }
    }
}

impl From<RangeInclusive<f64>> for Interval {
    fn from(range: RangeInclusive<f64>) -> Self {
        Self {
            lo: *range.start(),
            hi: *range.end(),
        }
    }
}

impl Interval {
    /// The values of `factor · x` for x in the interval; the factor is not zero.
    fn scaled(self, factor: f64) -> Self {
        let (a, b) = (factor * self.lo, factor * self.hi);
        Self {
            lo: a.min(b),
            hi: a.max(b),
        }
    }

    fn is_empty(self) -> bool {
        // Written so that a NaN counts as empty.
        !matches!(
            self.lo.partial_cmp(&self.hi),
            Some(std::cmp::Ordering::Less | std::cmp::Ordering::Equal)
        )
    }
}

/// The declaration of an element, for [`StructureBuilder::element`].
///
/// ```
/// use tensegra_model::{ElementKind, ElementSpec};
///
/// let rope = ElementSpec::new(ElementKind::Cable, "rope", ["a", "b"], 0.0..=3.0)
///     .stiffness(16.0)
///     .rest(0.0..=2.0)
///     .radius(0.005);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct ElementSpec {
    pub(crate) kind: ElementKind,
    pub(crate) name: String,
    pub(crate) nodes: [String; 2],
    pub(crate) length: Interval,
    pub(crate) stiffness: Option<f64>,
    pub(crate) rest: Option<Interval>,
    pub(crate) force: Option<Interval>,
    pub(crate) radius: Option<f64>,
    pub(crate) appearance: Appearance,
    pub(crate) dynamics: Vec<(String, Vec<f64>)>,
}

impl ElementSpec {
    /// An element of a kind, between two nodes, with a constant length or a range
    /// of lengths. Nodes come into being where an element names them first.
    pub fn new(
        kind: ElementKind,
        name: impl Into<String>,
        nodes: [impl Into<String>; 2],
        length: impl Into<Interval>,
    ) -> Self {
        Self {
            kind,
            name: name.into(),
            nodes: nodes.map(Into::into),
            length: length.into(),
            stiffness: None,
            rest: None,
            force: None,
            radius: None,
            appearance: Appearance::default(),
            dynamics: Vec::new(),
        }
    }

    /// Stiffness k of the law f = k (l − r).
    pub fn stiffness(mut self, stiffness: f64) -> Self {
        self.stiffness = Some(stiffness);
        self
    }

    /// Rest length r of the law, or its range where a motor changes it. Zero
    /// unless stated.
    pub fn rest(mut self, rest: impl Into<Interval>) -> Self {
        self.rest = Some(rest.into());
        self
    }

    /// Admissible forces, tension positive. For a strut or bar, the constant 0
    /// means that the element is geometry only and takes no part in equilibrium.
    pub fn force(mut self, force: impl Into<Interval>) -> Self {
        self.force = Some(force.into());
        self
    }

    /// Radius of the body; [`ElementKind::default_radius`] unless stated.
    pub fn radius(mut self, radius: f64) -> Self {
        self.radius = Some(radius);
        self
    }

    /// How the element is drawn, and whether it collides.
    pub fn appearance(mut self, appearance: Appearance) -> Self {
        self.appearance = appearance;
        self
    }

    /// An attribute of a dynamic model, kept by keyword.
    pub fn dynamic(mut self, keyword: impl Into<String>, values: Vec<f64>) -> Self {
        self.dynamics.push((keyword.into(), values));
        self
    }
}

/// Which relation a coupling states, with the factor or rotation of each follower.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Followers {
    Length(Vec<(String, f64)>),
    Rest(Vec<(String, f64)>),
    Force(Vec<(String, f64)>),
    Orientation(Vec<(String, Rotation3<f64>)>),
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct CouplingSpec {
    pub(crate) reference: String,
    pub(crate) followers: Followers,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct AttachmentSpec {
    pub(crate) name: String,
    pub(crate) shapes: Vec<AttachedShape>,
    pub(crate) anchors: [(Point3<f64>, String); 3],
}

/// Builds a [`Structure`] from declarations, with full validation.
///
/// ```
/// use tensegra_model::StructureBuilder;
///
/// // Two crossed struts in the plane, tied together by four cables.
/// let structure = StructureBuilder::planar()
///     .strut("s1", ["a", "b"], 1.0)
///     .strut("s2", ["c", "d"], 1.0)
///     .cable("c1", ["a", "c"], 0.0..=3.0, 1.0, 0.0..=2.0)
///     .cable("c2", ["b", "c"], 0.0..=3.0, 1.0, 0.0..=2.0)
///     .cable("c3", ["a", "d"], 0.0..=3.0, 1.0, 0.0..=2.0)
///     .cable("c4", ["b", "d"], 0.0..=3.0, 1.0, 0.0..=2.0)
///     .fix_coordinate("b", 1, 0.0)
///     .build()?;
/// assert_eq!(structure.nodes.len(), 4);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct StructureBuilder {
    pub(crate) dimension: usize,
    pub(crate) elements: Vec<ElementSpec>,
    pub(crate) fixed: Vec<(String, usize, f64)>,
    pub(crate) loads: Vec<(String, Vector3<f64>)>,
    pub(crate) masses: Vec<(String, f64)>,
    pub(crate) gravity: Vector3<f64>,
    pub(crate) supports: Vec<String>,
    pub(crate) couplings: Vec<CouplingSpec>,
    pub(crate) attachments: Vec<AttachmentSpec>,
    pub(crate) base_range: Option<Vector3<f64>>,
    /// `None` is unstated.
    pub(crate) pretension: Option<Option<f64>>,
}

/// The norm of all forces where none is stated.
const DEFAULT_PRETENSION: f64 = 1.0;

/// Relative amount by which ranges may miss each other and still count as touching.
const ROUNDING: f64 = 1e-9;

const AXES: [char; 3] = ['x', 'y', 'z'];

impl StructureBuilder {
    fn new(dimension: usize) -> Self {
        Self {
            dimension,
            elements: Vec::new(),
            fixed: Vec::new(),
            loads: Vec::new(),
            masses: Vec::new(),
            gravity: Vector3::zeros(),
            supports: Vec::new(),
            couplings: Vec::new(),
            attachments: Vec::new(),
            base_range: None,
            pretension: None,
        }
    }

    /// A structure in space.
    pub fn spatial() -> Self {
        Self::new(3)
    }

    /// A structure in the plane z = 0.
    pub fn planar() -> Self {
        Self::new(2)
    }

    /// Adds an element.
    pub fn element(mut self, element: ElementSpec) -> Self {
        self.elements.push(element);
        self
    }

    /// Adds a strut: constant length, compression only.
    pub fn strut(self, name: &str, nodes: [&str; 2], length: f64) -> Self {
        self.element(ElementSpec::new(ElementKind::Strut, name, nodes, length))
    }

    /// Adds a bar: constant length, tension or compression.
    pub fn bar(self, name: &str, nodes: [&str; 2], length: f64) -> Self {
        self.element(ElementSpec::new(ElementKind::Bar, name, nodes, length))
    }

    /// Adds an elastic cable, whose rest length a motor may change.
    pub fn cable(
        self,
        name: &str,
        nodes: [&str; 2],
        length: impl Into<Interval>,
        stiffness: f64,
        rest: impl Into<Interval>,
    ) -> Self {
        self.element(
            ElementSpec::new(ElementKind::Cable, name, nodes, length)
                .stiffness(stiffness)
                .rest(rest),
        )
    }

    /// Adds a cable of constant length.
    pub fn inextensible_cable(self, name: &str, nodes: [&str; 2], length: f64) -> Self {
        self.element(ElementSpec::new(ElementKind::Cable, name, nodes, length))
    }

    /// Adds a spring: elastic, in tension, with a constant rest length.
    pub fn spring(
        self,
        name: &str,
        nodes: [&str; 2],
        length: impl Into<Interval>,
        stiffness: f64,
        rest: f64,
    ) -> Self {
        self.element(
            ElementSpec::new(ElementKind::Spring, name, nodes, length)
                .stiffness(stiffness)
                .rest(rest),
        )
    }

    /// Adds a prismatic strut: elastic and telescopic; the stiffness is negative
    /// for one that is longer than its rest length under compression.
    pub fn prismatic(
        self,
        name: &str,
        nodes: [&str; 2],
        length: impl Into<Interval>,
        stiffness: f64,
        rest: impl Into<Interval>,
    ) -> Self {
        self.element(
            ElementSpec::new(ElementKind::Prismatic, name, nodes, length)
                .stiffness(stiffness)
                .rest(rest),
        )
    }

    /// Holds a node at a position (the gauge; takes no reaction force).
    pub fn fix(self, node: &str, position: [f64; 3]) -> Self {
        (0..3).fold(self, |builder, axis| {
            builder.fix_coordinate(node, axis, position[axis])
        })
    }

    /// Holds one coordinate of a node: 0, 1 or 2 for x, y or z.
    ///
    /// # Panics
    /// If `axis` is above 2.
    pub fn fix_coordinate(mut self, node: &str, axis: usize, value: f64) -> Self {
        assert!(axis < 3, "axis {axis} is none of 0, 1, 2");
        self.fixed.push((node.to_string(), axis, value));
        self
    }

    /// Adds a constant external force at a node; several add up.
    pub fn load(mut self, node: &str, force: [f64; 3]) -> Self {
        self.loads.push((node.to_string(), force.into()));
        self
    }

    /// Adds a mass at a node; several add up. With [`gravity`](Self::gravity) its weight is a load.
    pub fn mass(mut self, node: &str, mass: f64) -> Self {
        self.masses.push((node.to_string(), mass));
        self
    }

    /// The acceleration of gravity: the weights of the masses join the loads of balanced nodes.
    pub fn gravity(mut self, acceleration: [f64; 3]) -> Self {
        self.gravity = acceleration.into();
        self
    }

    /// Exempts a node from force balance: a true support that takes any reaction.
    pub fn support(mut self, node: &str) -> Self {
        self.supports.push(node.to_string());
        self
    }

    /// Couples lengths: length(reference) = factor · length(follower).
    pub fn couple_lengths(self, reference: &str, followers: &[(&str, f64)]) -> Self {
        self.couple(reference, Followers::Length(owned(followers)))
    }

    /// Couples rest lengths: rest(reference) = factor · rest(follower).
    pub fn couple_rest_lengths(self, reference: &str, followers: &[(&str, f64)]) -> Self {
        self.couple(reference, Followers::Rest(owned(followers)))
    }

    /// Couples forces: force(reference) = factor · force(follower).
    pub fn couple_forces(self, reference: &str, followers: &[(&str, f64)]) -> Self {
        self.couple(reference, Followers::Force(owned(followers)))
    }

    /// Couples directions: direction(reference) = R · direction(follower).
    pub fn couple_orientations(
        self,
        reference: &str,
        followers: &[(&str, Rotation3<f64>)],
    ) -> Self {
        self.couple(reference, Followers::Orientation(owned(followers)))
    }

    fn couple(mut self, reference: &str, followers: Followers) -> Self {
        self.couplings.push(CouplingSpec {
            reference: reference.to_string(),
            followers,
        });
        self
    }

    /// Glues a rigid body to three nodes, given where they are in its frame.
    pub fn attach(
        mut self,
        name: &str,
        shapes: Vec<AttachedShape>,
        anchors: [([f64; 3], &str); 3],
    ) -> Self {
        self.attachments.push(AttachmentSpec {
            name: name.to_string(),
            shapes,
            anchors: anchors.map(|(local, node)| (local.into(), node.to_string())),
        });
        self
    }

    /// Lets the structure fly freely: nothing is fixed, and the first node stays
    /// within these half ranges about the origin.
    pub fn free_flying(mut self, half_ranges: [f64; 3]) -> Self {
        self.base_range = Some(half_ranges.into());
        self
    }

    /// Prescribes the norm P of the vector of all forces, Σ f² = P², or none.
    /// It is 1 unless stated, if any element carries a force.
    pub fn pretension(mut self, pretension: impl Into<Option<f64>>) -> Self {
        self.pretension = Some(pretension.into());
        self
    }

    /// Validates the declarations and builds the structure.
    ///
    /// # Errors
    /// Everything that is wrong, in the order of declaration.
    pub fn build(self) -> Result<Structure, BuildErrors<StructureError>> {
        let mut build = Build::default();
        let structure = build.structure(self);
        BuildErrors::none_of(build.errors)?;
        Ok(structure)
    }
}

fn owned<T: Clone>(followers: &[(&str, T)]) -> Vec<(String, T)> {
    followers
        .iter()
        .map(|(name, value)| ((*name).to_string(), value.clone()))
        .collect()
}

/// The state of [`StructureBuilder::build`].
#[derive(Default)]
struct Build {
    dimension: usize,
    nodes: Vec<Node>,
    node_indices: HashMap<String, usize>,
    /// What has a name: elements and attachments, in words.
    names: HashMap<String, String>,
    element_indices: HashMap<String, usize>,
    errors: Vec<StructureError>,
}

impl Build {
    fn structure(&mut self, declared: StructureBuilder) -> Structure {
        let StructureBuilder {
            dimension,
            elements,
            fixed,
            loads,
            masses,
            gravity,
            supports,
            couplings,
            attachments,
            base_range,
            pretension,
        } = declared;
        self.dimension = dimension;
        let elements: Vec<Element> = elements
            .into_iter()
            .enumerate()
            .map(|(index, spec)| self.element(index, spec))
            .collect();
        self.connectedness(&elements);
        let fixed = self.gauge(base_range.is_some(), &fixed);
        self.supports(&supports);
        self.loads(&loads);
        self.weights(&masses, gravity);
        let couplings = couplings
            .iter()
            .enumerate()
            .filter_map(|(index, coupling)| self.coupling(index, coupling, &elements))
            .collect();
        let attachments = attachments
            .into_iter()
            .enumerate()
            .filter_map(|(index, attachment)| self.attachment(index, attachment))
            .collect();
        if let Some(range) = base_range {
            self.base_range(range);
        }
        let pretension = self.pretension(pretension, &elements);
        Structure {
            dimension,
            nodes: std::mem::take(&mut self.nodes),
            elements,
            couplings,
            attachments,
            fixed,
            base_range,
            pretension,
        }
    }

    fn error(&mut self, place: Place, subject: impl Into<String>, flaw: StructureFlaw) {
        self.errors.push(StructureError {
            place,
            subject: subject.into(),
            flaw,
        });
    }

    /// Registers a name of an element or attachment.
    fn name(&mut self, place: Place, subject: &str, name: &str) {
        if name.is_empty() {
            self.error(place, subject, StructureFlaw::EmptyName);
        } else if let Some(by) = self.names.get(name) {
            let flaw = StructureFlaw::DuplicateName {
                name: name.to_string(),
                by: by.clone(),
            };
            self.error(place, subject, flaw);
        } else {
            self.names.insert(name.to_string(), subject.to_string());
        }
    }

    fn node(&mut self, name: &str) -> usize {
        if let Some(&index) = self.node_indices.get(name) {
            return index;
        }
        let index = self.nodes.len();
        self.nodes.push(Node {
            name: name.to_string(),
            balanced: true,
            load: Vector3::zeros(),
            mass: 0.0,
        });
        self.node_indices.insert(name.to_string(), index);
        index
    }

    fn known_node(&mut self, place: Place, subject: &str, name: &str) -> Option<usize> {
        let index = self.node_indices.get(name).copied();
        if index.is_none() {
            let suggestion = self.suggestion(name, self.nodes.iter().map(|node| &node.name));
            let name = name.to_string();
            self.error(
                place,
                subject,
                StructureFlaw::UnknownNode { name, suggestion },
            );
        }
        index
    }

    /// A name that may be meant; none after many errors, which keeps the cost of
    /// hopeless input linear.
    fn suggestion<'a>(
        &self,
        name: &str,
        candidates: impl Iterator<Item = &'a String>,
    ) -> Option<String> {
        const SUGGESTED: usize = 40;
        (self.errors.len() < SUGGESTED)
            .then(|| did_you_mean(name, candidates.map(String::as_str)))
            .flatten()
    }

    fn element(&mut self, index: usize, spec: ElementSpec) -> Element {
        let keyword = spec.kind.keyword();
        let subject = format!("{keyword} `{}`", spec.name);
        let at = |part| Place::Element(index, part);
        self.name(at(ElementPart::Name), &subject, &spec.name);
        self.element_indices
            .entry(spec.name.clone())
            .or_insert(index);
        if spec.nodes.iter().any(String::is_empty) {
            self.error(at(ElementPart::Nodes), &*subject, StructureFlaw::EmptyName);
        } else if spec.nodes[0] == spec.nodes[1] {
            let node = spec.nodes[0].clone();
            self.error(
                at(ElementPart::Nodes),
                &*subject,
                StructureFlaw::Loop { node },
            );
        }
        let nodes = [self.node(&spec.nodes[0]), self.node(&spec.nodes[1])];

        // A quantity that is broken in itself is not compared with others.
        let mut sound = true;
        let mut check = |part, flaw: Option<StructureFlaw>| {
            if let Some(flaw) = flaw {
                sound = false;
                self.error(at(part), &*subject, flaw);
            }
        };
        check(ElementPart::Length, bad_size("length", spec.length));
        if let Some(stiffness) = spec.stiffness {
            check(ElementPart::Stiffness, not_finite("stiffness", stiffness));
        }
        if let Some(rest) = spec.rest {
            check(ElementPart::Rest, bad_size("rest length", rest));
        }
        if let Some(force) = spec.force {
            check(ElementPart::Force, bad_force(force));
        }
        let radius = spec.radius.unwrap_or(spec.kind.default_radius());
        check(
            ElementPart::Radius,
            bad_size("radius", Interval::constant(radius)),
        );
        for (_, values) in &spec.dynamics {
            let bad = values
                .iter()
                .find_map(|&value| not_finite("dynamic attribute", value));
            check(ElementPart::Dynamics, bad);
        }
        let (law, force) = if sound {
            self.law(index, &subject, &spec)
        } else {
            (ForceLaw::Free, spec.kind.natural_force())
        };
        Element {
            name: spec.name,
            kind: spec.kind,
            nodes,
            length: spec.length,
            law,
            force,
            radius,
            appearance: spec.appearance,
            dynamics: spec.dynamics,
        }
    }

    /// The law of an element's force and the admissible forces, from sound numbers.
    fn law(&mut self, index: usize, subject: &str, spec: &ElementSpec) -> (ForceLaw, Interval) {
        use StructureFlaw as Flaw;
        let kind = spec.kind.keyword();
        let at = |part| Place::Element(index, part);
        let natural = spec.kind.natural_force();
        let declared = spec.force.unwrap_or(natural);
        let constant = spec.length.is_constant();
        let rigid = match spec.kind {
            ElementKind::Strut => true,
            ElementKind::Bar | ElementKind::Cable => constant,
            ElementKind::Spring | ElementKind::Prismatic => false,
        };

        if spec.length.hi == 0.0 {
            self.error(at(ElementPart::Length), subject, Flaw::NoLength);
        }
        if declared.lo < natural.lo || declared.hi > natural.hi {
            let allowed = match spec.kind {
                ElementKind::Strut => "compression",
                _ => "tension",
            };
            let (lo, hi) = (declared.lo, declared.hi);
            self.error(
                at(ElementPart::Force),
                subject,
                Flaw::ForceSign {
                    kind,
                    allowed,
                    lo,
                    hi,
                },
            );
            return (ForceLaw::Free, natural);
        }
        if rigid {
            if !constant {
                self.error(
                    at(ElementPart::Length),
                    subject,
                    Flaw::LengthVaries { kind },
                );
            }
            if spec.stiffness.is_some() {
                let quantity = "stiffness";
                self.error(
                    at(ElementPart::Stiffness),
                    subject,
                    Flaw::NotElastic { kind, quantity },
                );
            }
            if spec.rest.is_some() {
                let quantity = "rest length";
                self.error(
                    at(ElementPart::Rest),
                    subject,
                    Flaw::NotElastic { kind, quantity },
                );
            }
            let geometry_only =
                spec.kind != ElementKind::Cable && declared == Interval::constant(0.0);
            let law = if geometry_only {
                ForceLaw::None
            } else {
                ForceLaw::Free
            };
            return (law, declared);
        }

        if constant {
            self.error(
                at(ElementPart::Length),
                subject,
                Flaw::LengthConstant { kind },
            );
        }
        let rest = spec.rest.unwrap_or(Interval::constant(0.0));
        if spec.kind == ElementKind::Spring && !rest.is_constant() {
            self.error(at(ElementPart::Rest), subject, Flaw::RestVaries);
        }
        let (shortest, extension) = (spec.length.lo, spec.length.hi - spec.length.lo);
        if spec.kind == ElementKind::Prismatic && shortest < extension * (1.0 - ROUNDING) {
            let flaw = Flaw::PrismaticRange {
                extension,
                shortest,
            };
            self.error(at(ElementPart::Length), subject, flaw);
        }
        let Some(stiffness) = spec.stiffness else {
            self.error(at(ElementPart::Length), subject, Flaw::StiffnessMissing);
            return (ForceLaw::Free, declared);
        };
        if stiffness < 0.0 && spec.kind != ElementKind::Prismatic {
            let flaw = Flaw::Negative {
                quantity: "stiffness",
                value: stiffness,
            };
            self.error(at(ElementPart::Stiffness), subject, flaw);
            return (ForceLaw::Linear { stiffness, rest }, declared);
        }
        let stretch = Interval::new(spec.length.lo - rest.hi, spec.length.hi - rest.lo);
        let possible = stretch.scaled(stiffness);
        let force = possible.intersection(&declared);
        if force.is_empty() {
            let flaw = Flaw::NoForce {
                possible: [possible.lo, possible.hi],
                allowed: [declared.lo, declared.hi],
            };
            let part = if spec.force.is_some() {
                ElementPart::Force
            } else {
                ElementPart::Stiffness
            };
            self.error(at(part), subject, flaw);
        }
        (ForceLaw::Linear { stiffness, rest }, force)
    }

    /// Refuses structures without elements and those that fall apart.
    fn connectedness(&mut self, elements: &[Element]) {
        if elements.is_empty() {
            self.error(Place::Structure, "structure", StructureFlaw::Empty);
            return;
        }
        let mut parts = Partition::new(self.nodes.len());
        for element in elements {
            parts.join(element.nodes[0], element.nodes[1]);
        }
        let mut seen = HashSet::from([parts.representative(0)]);
        let apart: Vec<usize> = (1..self.nodes.len())
            .filter(|&node| seen.insert(parts.representative(node)))
            .collect();
        if !apart.is_empty() {
            let flaw = StructureFlaw::Disconnected {
                origin: self.nodes[0].name.clone(),
                unreached: apart
                    .iter()
                    .map(|&node| self.nodes[node].name.clone())
                    .collect(),
            };
            // Point to the first element that is out of reach.
            let origin = parts.representative(0);
            let place = elements
                .iter()
                .position(|element| parts.representative(element.nodes[0]) != origin)
                .map_or(Place::Structure, |index| {
                    Place::Element(index, ElementPart::Nodes)
                });
            self.error(place, "structure", flaw);
        }
    }

    fn gauge(
        &mut self,
        free_flying: bool,
        declared: &[(String, usize, f64)],
    ) -> Vec<FixedCoordinate> {
        let mut fixed: Vec<FixedCoordinate> = Vec::new();
        let mut values: HashMap<(usize, usize), f64> = HashMap::new();
        for (index, (name, axis, value)) in declared.iter().enumerate() {
            let (axis, value) = (*axis, *value);
            let place = Place::FixedCoordinate(index);
            let subject = format!("fixed coordinate {} of node `{name}`", AXES[axis]);
            if free_flying {
                self.error(place, subject, StructureFlaw::FixedInFlight);
                continue;
            }
            // A node that is not known is reported once, not for each of its coordinates.
            if index > 0 && declared[index - 1].0 == *name && !self.node_indices.contains_key(name)
            {
                continue;
            }
            let Some(node) = self.known_node(place, &subject, name) else {
                continue;
            };
            if let Some(flaw) = not_finite("coordinate", value) {
                self.error(place, subject, flaw);
                continue;
            }
            if axis >= self.dimension {
                if value != 0.0 {
                    let quantity = "fixed coordinate z";
                    self.error(
                        place,
                        subject,
                        StructureFlaw::OutOfPlane { quantity, value },
                    );
                }
                continue;
            }
            match values.insert((node, axis), value) {
                None => fixed.push(FixedCoordinate { node, axis, value }),
                Some(first) if first == value => {}
                Some(first) => {
                    let flaw = StructureFlaw::FixedTwice {
                        node: name.clone(),
                        axis: AXES[axis],
                        value: first,
                    };
                    self.error(place, subject, flaw);
                }
            }
        }
        if !free_flying {
            // The first node is the origin.
            for axis in (0..self.dimension).rev() {
                if !values.contains_key(&(0, axis)) {
                    let origin = FixedCoordinate {
                        node: 0,
                        axis,
                        value: 0.0,
                    };
                    fixed.insert(0, origin);
                }
            }
        }
        fixed
    }

    fn supports(&mut self, supports: &[String]) {
        for (index, name) in supports.iter().enumerate() {
            let place = Place::Support(index);
            if let Some(node) = self.known_node(place, "exemption from force balance", name) {
                self.nodes[node].balanced = false;
            }
        }
    }

    fn loads(&mut self, loads: &[(String, Vector3<f64>)]) {
        for (index, (name, force)) in loads.iter().enumerate() {
            let place = Place::Load(index);
            let subject = format!("load at node `{name}`");
            let Some(node) = self.known_node(place, &subject, name) else {
                continue;
            };
            if let Some(flaw) = force.iter().find_map(|&value| not_finite("load", value)) {
                self.error(place, subject, flaw);
            } else if self.dimension == 2 && force.z != 0.0 {
                let flaw = StructureFlaw::OutOfPlane {
                    quantity: "load along z",
                    value: force.z,
                };
                self.error(place, subject, flaw);
            } else if !self.nodes[node].balanced {
                let node = name.clone();
                self.error(place, subject, StructureFlaw::LoadAtSupport { node });
            } else {
                self.nodes[node].load += force;
            }
        }
    }

    /// Masses, and their weights as loads; a support takes the weight of its own mass.
    fn weights(&mut self, masses: &[(String, f64)], gravity: Vector3<f64>) {
        let flaw = gravity
            .iter()
            .find_map(|&value| not_finite("gravity", value))
            .or(
                (self.dimension == 2 && gravity.z != 0.0).then_some(StructureFlaw::OutOfPlane {
                    quantity: "gravity along z",
                    value: gravity.z,
                }),
            );
        if let Some(flaw) = flaw {
            self.error(Place::Gravity, "structure", flaw);
            return;
        }
        for (index, (name, mass)) in masses.iter().enumerate() {
            let place = Place::Mass(index);
            let subject = format!("mass at node `{name}`");
            let Some(node) = self.known_node(place, &subject, name) else {
                continue;
            };
            if let Some(flaw) = bad_size("mass", Interval::constant(*mass)) {
                self.error(place, subject, flaw);
                continue;
            }
            let node = &mut self.nodes[node];
            node.mass += mass;
            if node.balanced {
                node.load += gravity * *mass;
            }
        }
    }

    fn base_range(&mut self, range: Vector3<f64>) {
        let flaw = range
            .iter()
            .find_map(|&value| bad_size("half range", Interval::constant(value)))
            .or(
                (self.dimension == 2 && range.z != 0.0).then_some(StructureFlaw::OutOfPlane {
                    quantity: "half range along z",
                    value: range.z,
                }),
            );
        if let Some(flaw) = flaw {
            self.error(Place::BaseRange, "free-flying structure", flaw);
        }
    }

    fn known_element(&mut self, place: Place, subject: &str, name: &str) -> Option<usize> {
        let index = self.element_indices.get(name).copied();
        if index.is_none() {
            let suggestion = self.suggestion(name, self.element_indices.keys());
            let name = name.to_string();
            self.error(
                place,
                subject,
                StructureFlaw::UnknownElement { name, suggestion },
            );
        }
        index
    }

    fn coupling(
        &mut self,
        index: usize,
        spec: &CouplingSpec,
        elements: &[Element],
    ) -> Option<Coupling> {
        let quantity = match &spec.followers {
            Followers::Length(_) => "length",
            Followers::Rest(_) => "rest length",
            Followers::Force(_) => "force",
            Followers::Orientation(_) => "orientation",
        };
        let subject = format!("coupling of {quantity} to `{}`", spec.reference);
        let reference = self.known_element(Place::Coupling(index, 0), &subject, &spec.reference);
        let names: Vec<&String> = match &spec.followers {
            Followers::Length(list) | Followers::Rest(list) | Followers::Force(list) => {
                list.iter().map(|(name, _)| name).collect()
            }
            Followers::Orientation(list) => list.iter().map(|(name, _)| name).collect(),
        };
        if names.is_empty() {
            self.error(
                Place::Coupling(index, 0),
                &*subject,
                StructureFlaw::CouplesNothing,
            );
        }
        let followers: Vec<Option<usize>> = names
            .iter()
            .enumerate()
            .map(|(member, name)| {
                self.known_element(Place::Coupling(index, member + 1), &subject, name)
            })
            .collect();
        let mut seen: HashSet<usize> = reference.into_iter().collect();
        for (member, follower) in followers.iter().enumerate() {
            if let Some(follower) = *follower
                && !seen.insert(follower)
            {
                let element = elements[follower].name.clone();
                let place = Place::Coupling(index, member + 1);
                self.error(place, &*subject, StructureFlaw::CoupledTwice { element });
            }
        }
        let reference = reference?;
        let scaled = |build: &mut Self, list: &[(String, f64)]| -> Vec<(usize, f64)> {
            let mut result = Vec::new();
            for (member, (&follower, &(_, factor))) in followers.iter().zip(list).enumerate() {
                let Some(follower) = follower else { continue };
                let place = Place::Coupling(index, member + 1);
                let (a, b) = (&elements[reference], &elements[follower]);
                match coupled_flaw(quantity, a, b, factor) {
                    Some(flaw) => build.error(place, &*subject, flaw),
                    None => result.push((follower, factor)),
                }
            }
            result
        };
        Some(match &spec.followers {
            Followers::Length(list) => Coupling::Length {
                reference,
                followers: scaled(self, list),
            },
            Followers::Rest(list) => Coupling::Rest {
                reference,
                followers: scaled(self, list),
            },
            Followers::Force(list) => Coupling::Force {
                reference,
                followers: scaled(self, list),
            },
            Followers::Orientation(list) => {
                let mut rotated = Vec::new();
                for (member, (&follower, (_, rotation))) in followers.iter().zip(list).enumerate() {
                    let place = Place::Coupling(index, member + 1);
                    let bad = rotation
                        .matrix()
                        .iter()
                        .find_map(|&entry| not_finite("rotation", entry))
                        .or_else(|| self.tilted(rotation));
                    if let Some(flaw) = bad {
                        self.error(place, &*subject, flaw);
                    } else if let Some(follower) = follower {
                        rotated.push((follower, *rotation));
                    }
                }
                Coupling::Orientation {
                    reference,
                    followers: rotated,
                }
            }
        })
    }

    /// What is wrong with a rotation that takes directions out of the plane.
    fn tilted(&self, rotation: &Rotation3<f64>) -> Option<StructureFlaw> {
        let (x, y) = (rotation[(2, 0)], rotation[(2, 1)]);
        let value = if x.abs() > y.abs() { x } else { y };
        (self.dimension == 2 && value.abs() > ROUNDING).then_some(StructureFlaw::OutOfPlane {
            quantity: "z component of a rotated direction",
            value,
        })
    }

    fn attachment(&mut self, index: usize, spec: AttachmentSpec) -> Option<Attachment> {
        let subject = format!("attachment `{}`", spec.name);
        let place = Place::Attachment(index);
        self.name(place, &subject, &spec.name);
        if spec.shapes.is_empty() {
            self.error(place, &*subject, StructureFlaw::NoShape);
        }
        for (number, attached) in spec.shapes.iter().enumerate() {
            if let Err(error) = attached.shape.validate(attached.role) {
                let reason = error.to_string();
                let place = Place::AttachedShape(index, number);
                self.error(place, &*subject, StructureFlaw::BadShape { reason });
            }
        }
        let mut anchors: Vec<Anchor> = Vec::with_capacity(3);
        for (number, (local, name)) in spec.anchors.iter().enumerate() {
            let place = Place::Anchor(index, number);
            let bad = local
                .iter()
                .find_map(|&value| not_finite("anchor's coordinate", value));
            if let Some(flaw) = bad {
                self.error(place, &*subject, flaw);
                continue;
            }
            let Some(node) = self.known_node(place, &subject, name) else {
                continue;
            };
            if anchors.iter().any(|anchor| anchor.node == node) {
                let node = name.clone();
                self.error(place, &*subject, StructureFlaw::AnchorTwice { node });
            }
            anchors.push(Anchor {
                local: *local,
                node,
            });
        }
        let anchors: [Anchor; 3] = anchors.try_into().ok()?;
        let [p, q, r] = anchors.map(|anchor| anchor.local);
        let area = (q - p).cross(&(r - p)).norm();
        let size = (q - p).norm().max((r - p).norm());
        if area <= 1e-9 * size * size {
            self.error(place, subject, StructureFlaw::AnchorsInLine);
        }
        Some(Attachment {
            name: spec.name,
            shapes: spec.shapes,
            anchors,
        })
    }

    /// The pretension, if the forces can have that norm.
    fn pretension(&mut self, stated: Option<Option<f64>>, elements: &[Element]) -> Option<f64> {
        let any_force = elements.iter().any(Element::carries_force);
        let pretension = match stated {
            Some(stated) => stated?,
            None if any_force => DEFAULT_PRETENSION,
            None => return None,
        };
        let flaw = if let Some(flaw) = bad_size("pretension", Interval::constant(pretension)) {
            Some(flaw)
        } else if pretension == 0.0 {
            Some(StructureFlaw::NoPretension)
        } else if !any_force {
            Some(StructureFlaw::NothingToTension)
        } else {
            let (mut least, mut greatest) = (0.0, 0.0);
            for force in elements.iter().map(|element| element.force) {
                let nearest = 0.0_f64.clamp(force.lo.min(force.hi), force.hi.max(force.lo));
                least += nearest * nearest;
                greatest += (force.lo * force.lo).max(force.hi * force.hi);
            }
            let (least, greatest) = (least.sqrt(), greatest.sqrt());
            let reach = Interval::new(least * (1.0 - ROUNDING), greatest * (1.0 + ROUNDING));
            // Ranges that are broken themselves have been reported.
            (self.errors.is_empty() && reach.margin(pretension) < 0.0).then_some(
                StructureFlaw::PretensionOutOfReach {
                    pretension,
                    least,
                    greatest,
                },
            )
        };
        if let Some(flaw) = flaw {
            self.error(Place::Pretension, "structure", flaw);
        }
        Some(pretension)
    }
}

/// Why two elements cannot have a quantity coupled by a factor, if so.
fn coupled_flaw(
    quantity: &'static str,
    reference: &Element,
    follower: &Element,
    factor: f64,
) -> Option<StructureFlaw> {
    if let Some(flaw) = not_finite("factor", factor) {
        return Some(flaw);
    }
    if factor == 0.0 {
        return Some(StructureFlaw::ZeroFactor);
    }
    let law = |element: &Element| match element.law {
        ForceLaw::None => "no force",
        ForceLaw::Free => "free force",
        ForceLaw::Linear { .. } => "force by stiffness",
    };
    if reference.kind != follower.kind || law(reference) != law(follower) {
        let describe = |element: &Element| format!("{}, {}", element.kind.keyword(), law(element));
        return Some(StructureFlaw::Unlike {
            reference: reference.name.clone(),
            reference_is: describe(reference),
            follower: follower.name.clone(),
            follower_is: describe(follower),
        });
    }
    let range = |element: &Element| match quantity {
        "length" if element.length.is_constant() => Err("its length is constant"),
        "length" => Ok(element.length),
        "rest length" => element.rest().ok_or("it has none"),
        _ if !element.carries_force() => Err("it carries none"),
        _ => Ok(element.force),
    };
    let nothing = |element: &Element, why| StructureFlaw::NothingToCouple {
        quantity,
        element: format!("`{}`", element.name),
        why,
    };
    let own = match range(reference) {
        Ok(range) => range,
        Err(why) => return Some(nothing(reference, why)),
    };
    let asked = match range(follower) {
        Ok(range) => range.scaled(factor),
        Err(why) => return Some(nothing(follower, why)),
    };
    let slack = ROUNDING * (asked.lo.abs().min(asked.hi.abs()));
    let widened = Interval::new(asked.lo - slack, asked.hi + slack);
    widened
        .intersection(&own)
        .is_empty()
        .then(|| StructureFlaw::CoupledRanges {
            quantity,
            reference: reference.name.clone(),
            range: [own.lo, own.hi],
            follower: follower.name.clone(),
            asked: [asked.lo, asked.hi],
        })
}

fn not_finite(quantity: &'static str, value: f64) -> Option<StructureFlaw> {
    (!value.is_finite()).then_some(StructureFlaw::NotFinite { quantity, value })
}

/// What is wrong with a range of sizes: finite, not negative, not empty.
fn bad_size(quantity: &'static str, range: Interval) -> Option<StructureFlaw> {
    not_finite(quantity, range.lo)
        .or_else(|| not_finite(quantity, range.hi))
        .or_else(|| empty_range(quantity, range))
        .or_else(|| {
            (range.lo < 0.0).then_some(StructureFlaw::Negative {
                quantity,
                value: range.lo,
            })
        })
}

/// What is wrong with a range of forces, whose ends may be infinite.
fn bad_force(range: Interval) -> Option<StructureFlaw> {
    let quantity = "force";
    if range.lo.is_nan() || range.lo == f64::INFINITY {
        return not_finite(quantity, range.lo);
    }
    if range.hi.is_nan() || range.hi == f64::NEG_INFINITY {
        return not_finite(quantity, range.hi);
    }
    empty_range(quantity, range)
}

fn empty_range(quantity: &'static str, range: Interval) -> Option<StructureFlaw> {
    range.is_empty().then_some(StructureFlaw::EmptyRange {
        quantity,
        lo: range.lo,
        hi: range.hi,
    })
}

/// Disjoint sets of nodes, with path halving.
struct Partition {
    parents: Vec<usize>,
}

impl Partition {
    fn new(size: usize) -> Self {
        Self {
            parents: (0..size).collect(),
        }
    }

    fn representative(&mut self, mut node: usize) -> usize {
        while self.parents[node] != node {
            self.parents[node] = self.parents[self.parents[node]];
            node = self.parents[node];
        }
        node
    }

    fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.representative(a), self.representative(b));
        self.parents[a.max(b)] = a.min(b);
    }
}
