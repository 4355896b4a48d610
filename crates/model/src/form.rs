//! What is asked of a form: the conditions of form-finding.

use nalgebra::{Matrix3, Vector3};

use crate::structure::{Interval, Structure};

/// A condition on a configuration that form-finding has to meet.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum FormCondition {
    /// The coordinates of a weighted sum of node positions, such as a node or a centroid, lie in
    /// ranges.
    Point {
        /// Nodes and weights.
        of: Vec<(usize, f64)>,
        /// The ranges of the coordinates that are prescribed.
        at: [Option<Interval>; 3],
    },
    /// The distance of two nodes lies in a range.
    Distance {
        /// The nodes.
        nodes: [usize; 2],
        /// The range.
        range: Interval,
    },
    /// The length of an element lies in a range.
    Length {
        /// The element.
        element: usize,
        /// The range.
        range: Interval,
    },
    /// The rest length of an element with a linear law lies in a range.
    RestLength {
        /// The element.
        element: usize,
        /// The range.
        range: Interval,
    },
    /// The force of an element lies in a range, tension positive.
    Force {
        /// The element.
        element: usize,
        /// The range.
        range: Interval,
    },
    /// Two elements are equally long.
    EqualLengths {
        /// The elements.
        elements: [usize; 2],
    },
    /// A symmetry: the second node is the image A p + b of the first.
    Image {
        /// The node, and its image.
        nodes: [usize; 2],
        /// The linear part A, a rotation or reflection.
        linear: Matrix3<f64>,
        /// The translation b.
        translation: Vector3<f64>,
    },
}

impl FormCondition {
    /// The condition that the centroid of some nodes lies at a place.
    pub fn centroid(nodes: &[usize], at: [f64; 3]) -> Self {
        let weight = 1.0 / nodes.len().max(1) as f64;
        Self::Point {
            of: nodes.iter().map(|&node| (node, weight)).collect(),
            at: at.map(|value| Some(Interval::constant(value))),
        }
    }

    /// The condition in words, for messages.
    pub fn describe(&self, structure: &Structure) -> String {
        let node = |i: usize| structure.nodes[i].name.as_str();
        let element = |i: usize| structure.elements[i].name.as_str();
        let range = |range: &Interval| {
            if range.is_constant() {
                format!("= {}", range.lo)
            } else {
                format!("in [{}, {}]", range.lo, range.hi)
            }
        };
        match self {
            Self::Point { of, at } => {
                let names: Vec<&str> = of.iter().map(|&(i, _)| node(i)).collect();
                let what = match (&names[..], of.iter().all(|p| p.1 == of[0].1)) {
                    ([name], true) => format!("node {name}"),
                    (_, true) => format!("the centroid of {}", names.join(", ")),
                    _ => format!("the weighted centre of {}", names.join(", ")),
                };
                let at: Vec<String> = ["x", "y", "z"]
                    .iter()
                    .zip(at)
                    .filter_map(|(axis, value)| value.map(|v| format!("{axis} {}", range(&v))))
                    .collect();
                format!("{what} at {}", at.join(", "))
            }
            Self::Distance {
                nodes: [a, b],
                range: r,
            } => {
                format!("distance of {} and {} {}", node(*a), node(*b), range(r))
            }
            Self::Length {
                element: e,
                range: r,
            } => {
                format!("length of {} {}", element(*e), range(r))
            }
            Self::RestLength {
                element: e,
                range: r,
            } => {
                format!("rest length of {} {}", element(*e), range(r))
            }
            Self::Force {
                element: e,
                range: r,
            } => {
                format!("force of {} {}", element(*e), range(r))
            }
            Self::EqualLengths { elements: [a, b] } => {
                format!("equal lengths of {} and {}", element(*a), element(*b))
            }
            Self::Image { nodes: [a, b], .. } => {
                format!("{} as the image of {}", node(*b), node(*a))
            }
        }
    }
}

/// What is minimised among the forms that meet all conditions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum FormCost {
    /// Nothing: any form that meets the conditions is as good as another.
    #[default]
    None,
    /// The elastic energy Σ f² / (2 |k|) of the elements with a linear law.
    Energy,
}

/// Settings of form-finding.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct FormSettings {
    /// Conditions on every form.
    pub conditions: Vec<FormCondition>,
    /// Number of random starts.
    pub starts: usize,
    /// Clearance that collision pairs keep.
    pub clearance: f64,
    /// Where stated, nodes are balls of this radius that keep out of all obstacles.
    pub node_radius: Option<f64>,
    /// Whether pairs of struts, bars and prismatic struts are tested as cylinders without ends,
    /// as in Hernández Juan and Mirats Tur (2008), instead of capsules.
    pub infinite_cylinders: bool,
    /// What the smallest eigenvalue of the tangent stiffness has to exceed, in force per length,
    /// where rest lengths are held; `None` accepts unstable equilibria as well.
    pub least_stiffness: Option<f64>,
    /// What is minimised.
    pub cost: FormCost,
}

impl Default for FormSettings {
    fn default() -> Self {
        Self {
            conditions: Vec::new(),
            starts: 20,
            clearance: 0.0,
            node_radius: None,
            infinite_cylinders: false,
            least_stiffness: Some(0.0),
            cost: FormCost::None,
        }
    }
}
