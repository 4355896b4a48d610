//! The equations of equilibrium before simplification: Porta and Hernández-Juan
//! (2016), section 3, eqs. (1) to (6).
//!
//! Variables, in this order: for each element its direction u (3), its length l
//! if that varies, its rest length r if the force law is linear, and its force f
//! if it carries one; for each attachment the axes of its frame (9) and its
//! origin (3); the position (3) of each node that lies on no loop; the position
//! of node 0 of a free-flying structure (2 in the plane, 3 in space).
//!
//! Equations, in this order:
//! - |u|² = 1 for each element (1), and u_z = 0 in the plane;
//! - Σ ± l u = 0 around each independent loop (3), three each;
//! - f = k (l − r) for each linear law (4);
//! - Σ ± f u + load = 0 at each balanced node where a force acts (5), three each;
//! - the pretension Σ f² = P²;
//! - couplings, and fixed coordinates of nodes other than node 0;
//! - for each attachment six for an orthonormal right-handed frame and three for
//!   each anchor; three for the position of each node that lies on no loop.

use std::collections::VecDeque;

use nalgebra::Vector3;

use super::polynomial::Polynomial;
use crate::{
    equilibrium::EquilibriumError,
    structure::{Attachment, Coupling, ForceLaw, Interval, Structure},
};

/// Entries of a rotation below this are rounding errors of a zero.
const ROUNDING: f64 = 1e-14;

const AXES: [&str; 3] = ["x", "y", "z"];

/// A variable of the system, with its name and range.
#[derive(Clone, Debug)]
pub(super) struct RawVariable {
    pub(super) name: String,
    pub(super) range: Interval,
}

/// An equation p = 0, with what it states.
#[derive(Clone, Debug)]
pub(super) struct Equation {
    pub(super) statement: String,
    pub(super) polynomial: Polynomial,
}

/// The length of an element.
#[derive(Clone, Copy, Debug)]
pub(super) enum Length {
    Constant(f64),
    Variable(usize),
}

/// Variables of one element.
#[derive(Clone, Debug)]
pub(super) struct ElementVariables {
    pub(super) direction: [usize; 3],
    pub(super) length: Length,
    pub(super) rest: Option<usize>,
    pub(super) force: Option<usize>,
}

/// Variables of one attachment.
#[derive(Clone, Debug)]
pub(super) struct FrameVariables {
    pub(super) axes: [[usize; 3]; 3],
    pub(super) origin: [usize; 3],
}

/// Where the variables of each part of the structure stand.
#[derive(Clone, Debug, Default)]
pub(super) struct Layout {
    pub(super) elements: Vec<ElementVariables>,
    pub(super) frames: Vec<FrameVariables>,
    /// Nodes that lie on no loop.
    pub(super) loose_nodes: Vec<(usize, [usize; 3])>,
    /// Position of node 0 of a free-flying structure.
    pub(super) base: Vec<usize>,
}

/// How a node hangs on the spanning tree.
#[derive(Clone, Copy, Debug)]
pub(super) struct Branch {
    pub(super) node: usize,
    pub(super) parent: usize,
    pub(super) element: usize,
    /// +1 where the element points from the parent to the node.
    pub(super) sign: f64,
}

/// A spanning tree of shortest paths from node 0, which gives every node its
/// position: p = p₀ + Σ ± l u (2).
#[derive(Clone, Debug)]
pub(super) struct SpanningTree {
    /// In an order in which parents come first; node 0 is not among them.
    pub(super) branches: Vec<Branch>,
    /// Index of each node's branch.
    pub(super) branch_of_node: Vec<Option<usize>>,
}

impl SpanningTree {
    fn new(structure: &Structure) -> Result<Self, EquilibriumError> {
        let count = structure.nodes.len();
        let mut incident = vec![Vec::new(); count];
        for (e, element) in structure.elements.iter().enumerate() {
            let [a, b] = element.nodes;
            incident[a].push((e, b, 1.0));
            incident[b].push((e, a, -1.0));
        }
        let mut tree = Self {
            branches: Vec::with_capacity(count),
            branch_of_node: vec![None; count],
        };
        let mut queue = VecDeque::from([0]);
        while let Some(parent) = queue.pop_front() {
            let Some(neighbours) = incident.get(parent) else {
                break; // a structure without nodes
            };
            for &(element, node, sign) in neighbours {
                if node != 0 && tree.branch_of_node[node].is_none() {
                    tree.branch_of_node[node] = Some(tree.branches.len());
                    tree.branches.push(Branch {
                        node,
                        parent,
                        element,
                        sign,
                    });
                    queue.push_back(node);
                }
            }
        }
        match (1..count).find(|&node| tree.branch_of_node[node].is_none()) {
            None => Ok(tree),
            Some(node) => Err(EquilibriumError::Disconnected {
                node: structure.nodes[node].name.clone(),
                first: structure.nodes[0].name.clone(),
            }),
        }
    }

    /// The branches from a node up to node 0.
    pub(super) fn path(&self, node: usize) -> impl Iterator<Item = &Branch> {
        let branch = move |node: usize| self.branch_of_node[node].map(|b| &self.branches[b]);
        std::iter::successors(branch(node), move |b| branch(b.parent))
    }

    /// Whether an element is a branch of the tree.
    fn has_branch(&self, structure: &Structure, element: usize) -> bool {
        structure.elements[element].nodes.iter().any(|&node| {
            self.branch_of_node[node].is_some_and(|b| self.branches[b].element == element)
        })
    }

    /// Nodes other than node 0 through which no loop passes.
    fn loose_nodes(&self, structure: &Structure) -> Vec<usize> {
        // An element lies on a loop where an element off the tree closes one.
        let mut crossings = vec![0_usize; self.branch_of_node.len()];
        let mut on_loop = vec![false; self.branch_of_node.len()];
        for (e, element) in structure.elements.iter().enumerate() {
            if self.has_branch(structure, e) {
                continue;
            }
            let [a, b] = element.nodes;
            on_loop[a] = true;
            on_loop[b] = true;
            // Branches on both paths are passed twice and cancel.
            for end in [a, b] {
                for branch in self.path(end) {
                    crossings[branch.node] += 1;
                }
            }
            for end in [a, b] {
                for branch in self.path(end) {
                    if crossings[branch.node] == 1 {
                        on_loop[branch.node] = true;
                        on_loop[branch.parent] = true;
                    }
                }
            }
            for end in [a, b] {
                for branch in self.path(end) {
                    crossings[branch.node] = 0;
                }
            }
        }
        (1..on_loop.len()).filter(|&node| !on_loop[node]).collect()
    }
}

/// The whole system.
#[derive(Clone, Debug)]
pub(super) struct RawSystem {
    pub(super) variables: Vec<RawVariable>,
    pub(super) equations: Vec<Equation>,
    pub(super) layout: Layout,
    pub(super) tree: SpanningTree,
}

impl RawSystem {
    /// Variables and equations of a structure. Cost: linear in the size of the
    /// structure times the depth of its spanning tree.
    pub(super) fn new(structure: &Structure) -> Result<Self, EquilibriumError> {
        let mut system = Self {
            variables: Vec::new(),
            equations: Vec::new(),
            layout: Layout::default(),
            tree: SpanningTree::new(structure)?,
        };
        system.add_variables(structure);
        let positions = system.symbolic_positions(structure);
        system.add_directions(structure);
        system.add_loops(structure, &positions);
        system.add_force_laws(structure);
        system.add_balance(structure);
        system.add_pretension(structure);
        system.add_couplings(structure)?;
        system.add_gauge(structure, &positions);
        for (frame, attachment) in structure.attachments.iter().enumerate() {
            system.add_attachment(structure, attachment, frame, &positions);
        }
        system.add_loose_nodes(structure, &positions);
        Ok(system)
    }

    fn variable(&mut self, name: String, range: Interval) -> usize {
        self.variables.push(RawVariable { name, range });
        self.variables.len() - 1
    }

    fn vector(&mut self, what: &str, ranges: [Interval; 3]) -> [usize; 3] {
        [0, 1, 2].map(|axis| self.variable(format!("{} of {what}", AXES[axis]), ranges[axis]))
    }

    fn add_variables(&mut self, structure: &Structure) {
        let unit = Interval::new(-1.0, 1.0);
        for element in &structure.elements {
            let name = &element.name;
            let direction = [0, 1, 2]
                .map(|axis| self.variable(format!("direction {} of {name}", AXES[axis]), unit));
            let length = if element.has_constant_length() {
                Length::Constant(element.length.lo)
            } else {
                Length::Variable(self.variable(format!("length of {name}"), element.length))
            };
            let rest = element
                .rest()
                .map(|range| self.variable(format!("rest length of {name}"), range));
            let force = element
                .carries_force()
                .then(|| self.variable(format!("force of {name}"), element.force));
            self.layout.elements.push(ElementVariables {
                direction,
                length,
                rest,
                force,
            });
        }
        for attachment in &structure.attachments {
            let name = &attachment.name;
            let axes =
                [0, 1, 2].map(|a| self.vector(&format!("axis {} of {name}", AXES[a]), [unit; 3]));
            let reach = attachment
                .anchors
                .iter()
                .map(|anchor| self.reach(structure, anchor.node) + anchor.local.coords.norm())
                .fold(f64::INFINITY, f64::min);
            let origin = self.vector(
                &format!("the origin of {name}"),
                box_about_node_0(structure, reach),
            );
            self.layout.frames.push(FrameVariables { axes, origin });
        }
        for node in self.tree.loose_nodes(structure) {
            let ranges = box_about_node_0(structure, self.reach(structure, node));
            let position = self.vector(&structure.nodes[node].name, ranges);
            self.layout.loose_nodes.push((node, position));
        }
        if let Some(half) = structure.base_range {
            let name = structure.nodes.first().map_or("node 0", |n| &n.name);
            for axis in 0..structure.dimension.min(3) {
                let range = Interval::new(-half[axis], half[axis]);
                let base = self.variable(format!("{} of the base {name}", AXES[axis]), range);
                self.layout.base.push(base);
            }
        }
    }

    /// How far a node can be from node 0.
    fn reach(&self, structure: &Structure, node: usize) -> f64 {
        self.tree
            .path(node)
            .map(|branch| structure.elements[branch.element].length.hi)
            .sum()
    }

    fn state(&mut self, statement: impl Into<String>, polynomial: Polynomial) {
        self.equations.push(Equation {
            statement: statement.into(),
            polynomial,
        });
    }

    fn direction(&self, element: usize, axis: usize) -> Polynomial {
        Polynomial::variable(self.layout.elements[element].direction[axis])
    }

    fn length(&self, element: usize) -> Polynomial {
        match self.layout.elements[element].length {
            Length::Constant(value) => Polynomial::constant(value),
            Length::Variable(i) => Polynomial::variable(i),
        }
    }

    /// The vector l u from an element's first node to its second.
    fn span(&self, element: usize) -> [Polynomial; 3] {
        let length = self.length(element);
        [0, 1, 2].map(|axis| length.times(&self.direction(element, axis)))
    }

    /// The position of every node as a sum along the spanning tree.
    fn symbolic_positions(&self, structure: &Structure) -> Vec<[Polynomial; 3]> {
        let mut positions = vec![[(); 3].map(|()| Polynomial::default()); structure.nodes.len()];
        let origin = origin(structure);
        if let Some(first) = positions.first_mut() {
            *first = [0, 1, 2].map(|axis| match self.layout.base.get(axis) {
                Some(&i) => Polynomial::variable(i),
                None => Polynomial::constant(origin[axis]),
            });
        }
        for branch in &self.tree.branches {
            let span = self.span(branch.element);
            positions[branch.node] =
                [0, 1, 2].map(|axis| positions[branch.parent][axis].plus(branch.sign, &span[axis]));
        }
        positions
    }

    fn add_directions(&mut self, structure: &Structure) {
        for (e, element) in structure.elements.iter().enumerate() {
            let name = &element.name;
            let square = (0..3).fold(Polynomial::constant(-1.0), |sum, axis| {
                let u = self.direction(e, axis);
                sum.plus(1.0, &u.times(&u))
            });
            self.state(format!("unit length of the direction of {name}"), square);
            if structure.dimension == 2 {
                let z = self.direction(e, 2);
                self.state(format!("planarity of {name}"), z);
            }
        }
    }

    fn add_loops(&mut self, structure: &Structure, positions: &[[Polynomial; 3]]) {
        for (e, element) in structure.elements.iter().enumerate() {
            if self.tree.has_branch(structure, e) {
                continue;
            }
            let [a, b] = element.nodes;
            for (axis, span) in self.span(e).iter().enumerate() {
                let gap = positions[a][axis]
                    .plus(1.0, span)
                    .plus(-1.0, &positions[b][axis]);
                self.state(
                    format!("closure of a loop by {} in {}", element.name, AXES[axis]),
                    gap,
                );
            }
        }
    }

    fn add_force_laws(&mut self, structure: &Structure) {
        for (e, element) in structure.elements.iter().enumerate() {
            let ElementVariables { rest, force, .. } = self.layout.elements[e];
            if let (ForceLaw::Linear { stiffness, .. }, Some(rest), Some(force)) =
                (element.law, rest, force)
            {
                let law = Polynomial::variable(force)
                    .plus(-stiffness, &self.length(e))
                    .plus(stiffness, &Polynomial::variable(rest));
                self.state(format!("force law of {}", element.name), law);
            }
        }
    }

    fn add_balance(&mut self, structure: &Structure) {
        for (n, node) in structure.nodes.iter().enumerate() {
            let forces: Vec<(usize, usize, f64)> = structure
                .elements
                .iter()
                .enumerate()
                .filter_map(|(e, element)| {
                    let sign = match element.nodes {
                        [a, _] if a == n => 1.0,
                        [_, b] if b == n => -1.0,
                        _ => return None,
                    };
                    self.layout.elements[e].force.map(|force| (e, force, sign))
                })
                .collect();
            if !node.balanced || (forces.is_empty() && node.load == Vector3::zeros()) {
                continue;
            }
            for (axis, label) in AXES.iter().enumerate() {
                let load = Polynomial::constant(node.load[axis]);
                let sum = forces.iter().fold(load, |sum, &(e, force, sign)| {
                    let force = Polynomial::variable(force);
                    sum.plus(sign, &force.times(&self.direction(e, axis)))
                });
                self.state(format!("force balance of {} in {label}", node.name), sum);
            }
        }
    }

    fn add_pretension(&mut self, structure: &Structure) {
        let Some(norm) = structure.pretension else {
            return;
        };
        let forces = self.layout.elements.iter().filter_map(|e| e.force);
        let sum = forces.fold(Polynomial::constant(-norm * norm), |sum, force| {
            let force = Polynomial::variable(force);
            sum.plus(1.0, &force.times(&force))
        });
        self.state("pretension", sum);
    }

    fn add_couplings(&mut self, structure: &Structure) -> Result<(), EquilibriumError> {
        let name = |e: usize| &structure.elements[e].name;
        let statement = |quantity: &str, a: usize, b: usize| {
            format!("coupling of the {quantity} of {} and {}", name(a), name(b))
        };
        // Elements without the quantity cannot be coupled by it.
        let missing = |quantity: &'static str, e: usize| EquilibriumError::NothingToCouple {
            element: name(e).clone(),
            quantity,
        };
        for coupling in &structure.couplings {
            match coupling {
                Coupling::Length {
                    reference,
                    followers,
                } => {
                    for &(follower, scale) in followers {
                        let difference =
                            self.length(*reference).plus(-scale, &self.length(follower));
                        self.state(statement("lengths", *reference, follower), difference);
                    }
                }
                Coupling::Rest {
                    reference,
                    followers,
                } => {
                    for &(follower, scale) in followers {
                        let rest = |e: usize| {
                            self.layout.elements[e]
                                .rest
                                .map(Polynomial::variable)
                                .ok_or_else(|| missing("rest length", e))
                        };
                        let difference = rest(*reference)?.plus(-scale, &rest(follower)?);
                        self.state(statement("rest lengths", *reference, follower), difference);
                    }
                }
                Coupling::Force {
                    reference,
                    followers,
                } => {
                    for &(follower, scale) in followers {
                        let force = |e: usize| {
                            self.layout.elements[e]
                                .force
                                .map(Polynomial::variable)
                                .ok_or_else(|| missing("force", e))
                        };
                        let difference = force(*reference)?.plus(-scale, &force(follower)?);
                        self.state(statement("forces", *reference, follower), difference);
                    }
                }
                Coupling::Orientation {
                    reference,
                    followers,
                } => {
                    for (follower, rotation) in followers {
                        for axis in 0..3 {
                            let row = rotation.matrix().row(axis);
                            let difference = row
                                .iter()
                                .enumerate()
                                .filter(|(_, c)| c.abs() > ROUNDING)
                                .fold(self.direction(*reference, axis), |sum, (j, &c)| {
                                    sum.plus(-c, &self.direction(*follower, j))
                                });
                            self.state(statement("directions", *reference, *follower), difference);
                        }
                    }
                }
            }
        }
        Ok(())
    }

    fn add_gauge(&mut self, structure: &Structure, positions: &[[Polynomial; 3]]) {
        for fixed in &structure.fixed {
            if fixed.node == 0 && structure.base_range.is_none() {
                continue; // where the spanning tree starts
            }
            let value = Polynomial::constant(fixed.value);
            let difference = positions[fixed.node][fixed.axis].plus(-1.0, &value);
            let node = &structure.nodes[fixed.node].name;
            self.state(format!("fixed {} of {node}", AXES[fixed.axis]), difference);
        }
    }

    fn add_attachment(
        &mut self,
        structure: &Structure,
        Attachment { name, anchors, .. }: &Attachment,
        frame: usize,
        positions: &[[Polynomial; 3]],
    ) {
        let FrameVariables { axes, origin } = self.layout.frames[frame].clone();
        let [x, y, z] = axes.map(|axis| axis.map(Polynomial::variable));
        let dot = |a: &[Polynomial; 3], b: &[Polynomial; 3], constant: f64| {
            a.iter()
                .zip(b)
                .fold(Polynomial::constant(constant), |sum, (a, b)| {
                    sum.plus(1.0, &a.times(b))
                })
        };
        self.state(
            format!("unit length of axis x of {name}"),
            dot(&x, &x, -1.0),
        );
        self.state(
            format!("unit length of axis y of {name}"),
            dot(&y, &y, -1.0),
        );
        self.state(
            format!("right angle of the axes of {name}"),
            dot(&x, &y, 0.0),
        );
        for axis in 0..3 {
            let (j, k) = ((axis + 1) % 3, (axis + 2) % 3);
            let cross = x[j]
                .times(&y[k])
                .plus(-1.0, &x[k].times(&y[j]))
                .plus(-1.0, &z[axis]);
            self.state(format!("axis z of {name} in {}", AXES[axis]), cross);
        }
        for anchor in anchors {
            for axis in 0..3 {
                let local = anchor.local.coords;
                let gap = Polynomial::variable(origin[axis])
                    .plus(local.x, &x[axis])
                    .plus(local.y, &y[axis])
                    .plus(local.z, &z[axis])
                    .plus(-1.0, &positions[anchor.node][axis]);
                let node = &structure.nodes[anchor.node].name;
                self.state(format!("anchor of {name} at {node} in {}", AXES[axis]), gap);
            }
        }
    }

    fn add_loose_nodes(&mut self, structure: &Structure, positions: &[[Polynomial; 3]]) {
        for (node, position) in self.layout.loose_nodes.clone() {
            let name = &structure.nodes[node].name;
            for axis in 0..3 {
                let gap = Polynomial::variable(position[axis]).plus(-1.0, &positions[node][axis]);
                self.state(format!("position of {name} in {}", AXES[axis]), gap);
            }
        }
    }
}

/// Where node 0 is, unless the structure flies freely.
pub(super) fn origin(structure: &Structure) -> Vector3<f64> {
    let mut origin = Vector3::zeros();
    for fixed in structure.fixed.iter().filter(|fixed| fixed.node == 0) {
        origin[fixed.axis] = fixed.value;
    }
    origin
}

/// The coordinates within a distance of every place that node 0 can be at.
fn box_about_node_0(structure: &Structure, distance: f64) -> [Interval; 3] {
    let center = origin(structure);
    let half = structure.base_range.unwrap_or_default();
    [0, 1, 2].map(|axis| {
        let reach = half[axis] + distance;
        Interval::new(center[axis] - reach, center[axis] + reach)
    })
}
