//! Structures: nodes, elements, couplings, supports, loads and attachments.

use nalgebra::{Point3, Rotation3, Vector3};

use crate::environment::{Role, Shape};

/// A closed interval of admissible values; a constant when both ends agree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Lower end, possibly −∞.
    pub lo: f64,
    /// Upper end, possibly +∞.
    pub hi: f64,
}

impl Interval {
    /// The interval `[lo, hi]`.
    pub const fn new(lo: f64, hi: f64) -> Self {
        Self { lo, hi }
    }

    /// The interval that holds one value.
    pub const fn constant(value: f64) -> Self {
        Self {
            lo: value,
            hi: value,
        }
    }

    /// Whether the interval holds one value only.
    pub fn is_constant(&self) -> bool {
        self.lo == self.hi
    }

    /// How far `value` lies inside: the distance to the nearer end, negative outside.
    pub fn margin(&self, value: f64) -> f64 {
        (value - self.lo).min(self.hi - value)
    }

    /// The values that both intervals hold; empty when `lo > hi` in the result.
    pub fn intersection(&self, other: &Self) -> Self {
        Self {
            lo: self.lo.max(other.lo),
            hi: self.hi.min(other.hi),
        }
    }
}

/// A node: a frictionless joint where elements meet.
#[derive(Clone, Debug, PartialEq)]
pub struct Node {
    /// Name, unique among the nodes.
    pub name: String,
    /// Whether the forces at the node must balance. `false` makes it a true
    /// support that takes any reaction.
    pub balanced: bool,
    /// Constant external force at the node, the weight of its mass included.
    pub load: Vector3<f64>,
    /// Mass at the node.
    pub mass: f64,
}

/// What an element is; decides the sign of its force and how it is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ElementKind {
    /// Constant length, in compression.
    Strut,
    /// Tension or compression; of constant length, or elastic with an actuated rest length.
    Bar,
    /// In tension; of constant length, or elastic with an actuated rest length.
    Cable,
    /// Elastic with a constant rest length, in tension.
    Spring,
    /// An elastic telescopic strut.
    Prismatic,
}

impl ElementKind {
    /// The keyword of files and reports.
    pub const fn keyword(self) -> &'static str {
        match self {
            Self::Strut => "strut",
            Self::Bar => "bar",
            Self::Cable => "cable",
            Self::Spring => "spring",
            Self::Prismatic => "prismatic",
        }
    }
}

/// How the force of an element follows from its length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ForceLaw {
    /// The element carries no force: it is geometry only.
    None,
    /// The force is free: whatever equilibrium asks of an inextensible element.
    Free,
    /// Hooke's law f = k (l − r).
    Linear {
        /// Stiffness k (force per length); negative for an element that is
        /// longer than its rest length under compression.
        stiffness: f64,
        /// Admissible rest lengths r; a constant when not actuated.
        rest: Interval,
    },
}

/// How an element is drawn.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Appearance {
    /// Name of a colour, where the file gives one.
    pub color: Option<String>,
    /// Whether and how the element is drawn; a decoration never collides.
    pub role: Role,
    /// Number of loops that a spring is drawn with.
    pub loops: Option<u32>,
    /// Number of facets that a round body is drawn with.
    pub granularity: Option<u32>,
}

/// A strut, bar, cable, spring or prismatic strut between two nodes.
#[derive(Clone, Debug, PartialEq)]
pub struct Element {
    /// Name, unique among the elements.
    pub name: String,
    /// What it is.
    pub kind: ElementKind,
    /// The two nodes, from first to second.
    pub nodes: [usize; 2],
    /// Admissible lengths l.
    pub length: Interval,
    /// How force follows from length.
    pub law: ForceLaw,
    /// Admissible forces f, tension positive: what the file allows, cut with
    /// what kind, law and ranges allow.
    pub force: Interval,
    /// Radius of the collision body and of the drawing.
    pub radius: f64,
    /// How it is drawn.
    pub appearance: Appearance,
    /// Attributes of a dynamic model (mass, inertia, friction …): kept as read,
    /// by keyword; statics does not use them.
    pub dynamics: Vec<(String, Vec<f64>)>,
}

impl Element {
    /// Whether the element carries a force.
    pub fn carries_force(&self) -> bool {
        !matches!(self.law, ForceLaw::None)
    }

    /// Whether the length never changes.
    pub fn has_constant_length(&self) -> bool {
        self.length.is_constant()
    }

    /// Stiffness k, for an element with a linear law.
    pub fn stiffness(&self) -> Option<f64> {
        match self.law {
            ForceLaw::Linear { stiffness, .. } => Some(stiffness),
            _ => None,
        }
    }

    /// Admissible rest lengths, for an element with a linear law.
    pub fn rest(&self) -> Option<Interval> {
        match self.law {
            ForceLaw::Linear { rest, .. } => Some(rest),
            _ => None,
        }
    }

    /// Whether the element can only pull: it is slack where it would have to push.
    pub fn pulls_only(&self) -> bool {
        matches!(self.kind, ElementKind::Cable | ElementKind::Spring)
    }

    /// Whether a motor can move the element: its rest length has a range.
    pub fn is_actuated(&self) -> bool {
        self.rest().is_some_and(|rest| !rest.is_constant())
    }
}

/// A relation that ties quantities of several elements to those of one.
#[derive(Clone, Debug, PartialEq)]
pub enum Coupling {
    /// length(reference) = scale · length(follower).
    Length {
        /// The element that the others relate to.
        reference: usize,
        /// Followers and their scales.
        followers: Vec<(usize, f64)>,
    },
    /// rest(reference) = scale · rest(follower).
    Rest {
        /// The element that the others relate to.
        reference: usize,
        /// Followers and their scales.
        followers: Vec<(usize, f64)>,
    },
    /// force(reference) = scale · force(follower).
    Force {
        /// The element that the others relate to.
        reference: usize,
        /// Followers and their scales.
        followers: Vec<(usize, f64)>,
    },
    /// direction(reference) = R · direction(follower), directions being those
    /// from an element's first to its second node.
    Orientation {
        /// The element that the others relate to.
        reference: usize,
        /// Followers and their rotations R.
        followers: Vec<(usize, Rotation3<f64>)>,
    },
}

/// One coordinate of a node held at a value: removes a rigid motion, and takes
/// no reaction force.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FixedCoordinate {
    /// The node.
    pub node: usize,
    /// 0, 1 or 2 for x, y or z.
    pub axis: usize,
    /// The value it is held at.
    pub value: f64,
}

/// A point of an attachment that coincides with a node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Anchor {
    /// Position in the frame of the attachment.
    pub local: Point3<f64>,
    /// The node.
    pub node: usize,
}

/// A shape of an attachment.
#[derive(Clone, Debug, PartialEq)]
pub struct AttachedShape {
    /// The shape, in the frame of the attachment.
    pub shape: Shape,
    /// Whether it collides and is drawn.
    pub role: Role,
    /// Name of a colour, where the file gives one.
    pub color: Option<String>,
}

/// A rigid body glued to three nodes of the structure.
#[derive(Clone, Debug, PartialEq)]
pub struct Attachment {
    /// Name, unique among elements, obstacles and attachments.
    pub name: String,
    /// What it is made of.
    pub shapes: Vec<AttachedShape>,
    /// The three nodes it is glued to, not in one line.
    pub anchors: [Anchor; 3],
}

/// A tensegrity structure.
#[derive(Clone, Debug, PartialEq)]
pub struct Structure {
    /// 2 for a planar structure (all z are 0, no force acts along z), else 3.
    pub dimension: usize,
    /// Nodes, in the order in which the elements name them.
    pub nodes: Vec<Node>,
    /// Elements, in the order of declaration.
    pub elements: Vec<Element>,
    /// Relations between elements.
    pub couplings: Vec<Coupling>,
    /// Rigid bodies glued to nodes.
    pub attachments: Vec<Attachment>,
    /// Coordinates held fixed (the gauge). For a structure that does not fly
    /// freely these include the three coordinates of the origin, node 0; for a
    /// planar structure the z coordinates are fixed by `dimension`, not here.
    pub fixed: Vec<FixedCoordinate>,
    /// For a free-flying structure, the half ranges of the position of node 0
    /// about the origin.
    pub base_range: Option<Vector3<f64>>,
    /// Norm P of the vector of all forces, Σ f² = P², where prescribed.
    pub pretension: Option<f64>,
}

impl Structure {
    /// Index of the node called `name`.
    pub fn node_index(&self, name: &str) -> Option<usize> {
        self.nodes.iter().position(|node| node.name == name)
    }

    /// Index of the element called `name`.
    pub fn element_index(&self, name: &str) -> Option<usize> {
        self.elements
            .iter()
            .position(|element| element.name == name)
    }

    /// The structure's size: the length that distances are measured against. It is the mean length
    /// of the struts, bars and prismatic struts that carry a force, or of all elements where there
    /// are none of these; lengths that are not constant are taken at `positions`.
    ///
    /// Planners bound the displacement of nodes in a step by the step of their settings times this
    /// size, and so does whoever judges their paths, at the first configuration.
    pub fn size(&self, positions: &[Point3<f64>]) -> f64 {
        let mean = |among: &dyn Fn(&Element) -> bool| {
            let (mut sum, mut count) = (0.0, 0.0);
            for element in self.elements.iter().filter(|element| among(element)) {
                let [a, b] = element.nodes;
                sum += if element.has_constant_length() {
                    element.length.lo
                } else {
                    (positions[b] - positions[a]).norm()
                };
                count += 1.0;
            }
            Some(sum / count).filter(|mean: &f64| *mean > 0.0)
        };
        use ElementKind::{Bar, Prismatic, Strut};
        mean(&|e| e.carries_force() && matches!(e.kind, Strut | Bar | Prismatic))
            .or_else(|| mean(&|_| true))
            .unwrap_or(1.0)
    }
}
