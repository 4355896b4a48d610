//! What makes a structure unusable, and where it stands.

use thiserror::Error;

use crate::diagnostic::list_names;

/// A part of a structure under construction, by its index in the order of declaration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Place {
    /// The structure as a whole.
    Structure,
    /// An element.
    Element(usize, ElementPart),
    /// A fixed coordinate.
    FixedCoordinate(usize),
    /// A load.
    Load(usize),
    /// A mass.
    Mass(usize),
    /// Gravity.
    Gravity,
    /// A node that is exempt from force balance.
    Support(usize),
    /// The half ranges of a free-flying structure.
    BaseRange,
    /// The pretension.
    Pretension,
    /// A coupling; its reference is member 0, its followers count from 1.
    Coupling(usize, usize),
    /// An attachment as a whole.
    Attachment(usize),
    /// A shape of an attachment.
    AttachedShape(usize, usize),
    /// An anchor of an attachment.
    Anchor(usize, usize),
}

/// A property of an element.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum ElementPart {
    /// The name.
    Name,
    /// The pair of nodes.
    Nodes,
    /// The length.
    Length,
    /// The stiffness.
    Stiffness,
    /// The rest length.
    Rest,
    /// The range of forces.
    Force,
    /// The radius.
    Radius,
    /// An attribute of a dynamic model.
    Dynamics,
}

/// An error of a structure: where, of what, and why.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("{subject}: {flaw}{}", .flaw.hint().map(|hint| format!("; {hint}")).unwrap_or_default())]
pub struct StructureError {
    /// Where it is.
    pub place: Place,
    /// What it is about, in words, such as "cable `c1`".
    pub subject: String,
    /// What is wrong.
    pub flaw: StructureFlaw,
}

/// What can be wrong with a structure.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum StructureFlaw {
    /// There is no element.
    #[error("there is no element")]
    Empty,
    /// Not every node can be reached from the first one along elements.
    #[error(
        "the structure falls apart: {names} cannot be reached from `{origin}` along elements",
        names = list_names(.unreached.iter().map(String::as_str))
    )]
    Disconnected {
        /// The first node.
        origin: String,
        /// Nodes that are not connected with it; one of each other part.
        unreached: Vec<String>,
    },
    /// A name is empty.
    #[error("the name is empty")]
    EmptyName,
    /// Two things have one name.
    #[error("the name `{name}` is taken by {by}")]
    DuplicateName {
        /// The name.
        name: String,
        /// What has it already.
        by: String,
    },
    /// No node has this name.
    #[error("there is no node `{name}`")]
    UnknownNode {
        /// The name.
        name: String,
        /// A node that may be meant.
        suggestion: Option<String>,
    },
    /// No element has this name.
    #[error("there is no element `{name}`")]
    UnknownElement {
        /// The name.
        name: String,
        /// An element that may be meant.
        suggestion: Option<String>,
    },
    /// An element joins a node to itself.
    #[error("it joins node `{node}` to itself")]
    Loop {
        /// The node.
        node: String,
    },
    /// A number is NaN, or infinite where it must not be.
    #[error("the {quantity} is {value}, which is no finite number")]
    NotFinite {
        /// Of which quantity.
        quantity: &'static str,
        /// The number.
        value: f64,
    },
    /// A number is negative.
    #[error("the {quantity} is negative: {value}")]
    Negative {
        /// Of which quantity.
        quantity: &'static str,
        /// The number.
        value: f64,
    },
    /// The lower end of a range exceeds the upper end.
    #[error("the range of the {quantity} is empty: [{lo}, {hi}]")]
    EmptyRange {
        /// Of which quantity.
        quantity: &'static str,
        /// Lower end.
        lo: f64,
        /// Upper end.
        hi: f64,
    },
    /// The length is zero throughout.
    #[error("the length is zero, so that the element has no direction")]
    NoLength,
    /// The length varies, but the element is rigid.
    #[error("a {kind} has a constant length, but its length may vary")]
    LengthVaries {
        /// Keyword of the kind.
        kind: &'static str,
    },
    /// The length is constant, but the element is elastic.
    #[error("a {kind} needs a range of lengths, but its length is constant")]
    LengthConstant {
        /// Keyword of the kind.
        kind: &'static str,
    },
    /// Stiffness or rest length of an element whose length is constant.
    #[error("a {kind} of constant length has no {quantity}")]
    NotElastic {
        /// Keyword of the kind.
        kind: &'static str,
        /// `stiffness` or `rest length`.
        quantity: &'static str,
    },
    /// An elastic element without stiffness.
    #[error("the length varies, but there is no stiffness")]
    StiffnessMissing,
    /// The rest length of a spring varies.
    #[error("the rest length of a spring is constant, but here it may vary")]
    RestVaries,
    /// A prismatic strut extends by more than its retracted length.
    #[error("it extends by {extension}, which is more than its shortest length {shortest}")]
    PrismaticRange {
        /// hi − lo.
        extension: f64,
        /// lo.
        shortest: f64,
    },
    /// The range of forces has a sign that the kind excludes.
    #[error("a {kind} carries {allowed} only, but the range of forces is [{lo}, {hi}]")]
    ForceSign {
        /// Keyword of the kind.
        kind: &'static str,
        /// `tension` or `compression`.
        allowed: &'static str,
        /// Lower end of the range.
        lo: f64,
        /// Upper end of the range.
        hi: f64,
    },
    /// No force is both allowed and possible.
    #[error(
        "no force is possible: k (l − r) lies in [{}, {}], the force must lie in [{}, {}]",
        .possible[0], .possible[1], .allowed[0], .allowed[1]
    )]
    NoForce {
        /// Range of k (l − r).
        possible: [f64; 2],
        /// Range that the kind and the declaration allow.
        allowed: [f64; 2],
    },
    /// A fixed coordinate in a structure that flies freely.
    #[error("coordinates of a free-flying structure cannot be fixed")]
    FixedInFlight,
    /// A coordinate is fixed at two values.
    #[error("coordinate {axis} of node `{node}` is fixed already, at {value}")]
    FixedTwice {
        /// The node.
        node: String,
        /// x, y or z.
        axis: char,
        /// The first value.
        value: f64,
    },
    /// Something leaves the plane of a planar structure.
    #[error("the structure is planar, but the {quantity} is {value}")]
    OutOfPlane {
        /// What leaves the plane.
        quantity: &'static str,
        /// Its z component.
        value: f64,
    },
    /// A load at a node that is exempt from force balance.
    #[error("node `{node}` is exempt from force balance, so that the load has no effect")]
    LoadAtSupport {
        /// The node.
        node: String,
    },
    /// A coupling of one element.
    #[error("it couples one element to nothing")]
    CouplesNothing,
    /// An element occurs twice in a coupling.
    #[error("element `{element}` occurs twice")]
    CoupledTwice {
        /// The element.
        element: String,
    },
    /// Coupled elements differ in kind or in the law of their force.
    #[error("`{follower}` ({follower_is}) and `{reference}` ({reference_is}) cannot be coupled")]
    Unlike {
        /// The element that the others relate to.
        reference: String,
        /// What it is.
        reference_is: String,
        /// The other element.
        follower: String,
        /// What it is.
        follower_is: String,
    },
    /// The coupled quantity does not exist or does not vary.
    #[error("the {quantity} of {element} cannot be coupled: {why}")]
    NothingToCouple {
        /// The quantity.
        quantity: &'static str,
        /// The element.
        element: String,
        /// The reason.
        why: &'static str,
    },
    /// The factor of a coupling is zero.
    #[error("the factor is zero")]
    ZeroFactor,
    /// The ranges of coupled quantities have no common value.
    #[error(
        "the {quantity} of `{reference}` lies in [{}, {}], but `{follower}` asks for [{}, {}]",
        .range[0], .range[1], .asked[0], .asked[1]
    )]
    CoupledRanges {
        /// The quantity.
        quantity: &'static str,
        /// The element that the others relate to.
        reference: String,
        /// Range of its quantity.
        range: [f64; 2],
        /// The other element.
        follower: String,
        /// Scaled range of its quantity.
        asked: [f64; 2],
    },
    /// An attachment without shape.
    #[error("it has no shape")]
    NoShape,
    /// A shape that is no body.
    #[error("{reason}")]
    BadShape {
        /// Why.
        reason: String,
    },
    /// Two anchors of an attachment are at one node.
    #[error("two anchors are at node `{node}`")]
    AnchorTwice {
        /// The node.
        node: String,
    },
    /// The anchors of an attachment lie on one line.
    #[error("the three anchors lie on one line, which leaves the body free to turn about it")]
    AnchorsInLine,
    /// No choice of forces within their ranges has the prescribed norm.
    #[error(
        "the norm of all forces is prescribed as {pretension}, but their ranges allow [{least}, {greatest}]"
    )]
    PretensionOutOfReach {
        /// P.
        pretension: f64,
        /// Least norm.
        least: f64,
        /// Greatest norm.
        greatest: f64,
    },
    /// The pretension is zero.
    #[error("the pretension is zero, but forces of norm zero carry nothing")]
    NoPretension,
    /// A pretension, but no element that carries a force.
    #[error("a pretension is prescribed, but no element carries a force")]
    NothingToTension,
}

impl StructureFlaw {
    /// How to mend it, where that is not plain from the message.
    pub fn hint(&self) -> Option<String> {
        let text = match self {
            Self::UnknownNode { suggestion, .. } | Self::UnknownElement { suggestion, .. } => {
                return suggestion.clone();
            }
            Self::Empty => "declare at least one strut, bar, cable, spring or prismatic strut",
            Self::Disconnected { .. } => {
                "add the elements that join the parts, or correct a node's name"
            }
            Self::DuplicateName { .. } => {
                "elements, obstacles and attachments share one set of names; choose another"
            }
            Self::Loop { .. } => "an element joins two different nodes",
            Self::EmptyRange { .. } => "the smaller end comes first",
            Self::LengthVaries { .. } => {
                "give one number, or use a bar, a prismatic strut, a cable or a spring"
            }
            Self::LengthConstant { .. } => "give a range [shortest, longest]",
            Self::NotElastic { .. } => {
                "leave it out and state a range of forces, or give a range of lengths"
            }
            Self::StiffnessMissing => "state the stiffness k of f = k (l − r)",
            Self::RestVaries => "use a cable for an element with an actuated rest length",
            Self::PrismaticRange { .. } => {
                "the rod must fit into the tube: shortest ≥ longest − shortest"
            }
            Self::ForceSign { kind, .. } => match *kind {
                "strut" => "compression is negative; use a bar to allow both signs",
                _ => "tension is positive",
            },
            Self::NoForce { .. } => {
                "check the signs and the ranges of stiffness, length, rest length and force"
            }
            Self::FixedInFlight => "leave the fixed coordinates out, or do not let it fly freely",
            Self::CouplesNothing => "name at least two elements",
            Self::Unlike { .. } => "couple elements of one kind whose forces follow one law",
            Self::CoupledRanges { .. } => "widen one of the ranges or correct the factor",
            Self::AnchorsInLine => "choose three anchors that span a triangle",
            Self::LoadAtSupport { .. } => "remove the load, or the exemption",
            Self::PretensionOutOfReach { .. } => "change the pretension or the ranges of force",
            Self::NoPretension => "leave the pretension out to prescribe none",
            Self::NothingToTension => "leave the pretension out",
            Self::Negative {
                quantity: "stiffness",
                ..
            } => "only a prismatic strut may have a negative stiffness",
            _ => return None,
        };
        Some(text.to_string())
    }
}
