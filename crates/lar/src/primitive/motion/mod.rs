//! The nonlinear programme of a motion over several configurations and rolls.
//!
//! Source: Usevitch et al., equations (30) to (39). Unknowns are the positions of the nodes that
//! do not carry the robot, in every configuration that is not given: support nodes stand where
//! the triangular grid puts them. The objective is the sum of the squared length changes between
//! successive configurations; its Hessian and that of the Lagrangian are block tridiagonal over
//! the configurations and exact, except for the rigidity index, whose curvature is left out.
//!
//! Cost of an evaluation: O(configurations × (members + pairs + corners)).

mod nlp;
mod rows;

use std::ops::Range;

use nalgebra::{Matrix3, Vector3};

use crate::constraint::ConstraintFunction;
use crate::primitive::sequence::{SequenceRoll, Stance};
use crate::{Dimension, GroundIsometry, Robot, SideLine, Support};

/// What a motion problem is built from.
pub(super) struct MotionSpec<'a> {
    /// Symmetric stances before the first, between, and after the last roll.
    pub stances: &'a [Stance],
    pub rolls: &'a [SequenceRoll],
    /// Configurations for each roll.
    pub steps: usize,
    /// Index of the configuration, counted from that of the stance before it, that tips.
    pub tip: usize,
    /// Largest distance that a node travels between configurations, except in a roll.
    pub max_move: Option<f64>,
    /// Largest change of a length in a roll (c of equation (37)).
    pub max_tip_change: Option<f64>,
    /// Greatest fall of the centre of mass in a roll.
    pub max_fall: Option<f64>,
    pub ends: Ends,
}

/// What holds at the two ends.
#[derive(Debug, Clone)]
pub(super) enum Ends {
    /// The first and the last configuration are the first and the last stance.
    Fixed,
    /// The motion begins at the tipping configuration of the first roll and ends at that of the
    /// second, which is its image: node i there stands at the image of node `roles[i]` here
    /// (equation (39)). Two rolls and three stances are given. With `mirror`, the tipping
    /// configuration, and those that follow it, are their own mirror images in the middle of the
    /// side rolled over.
    Periodic {
        map: GroundIsometry,
        roles: Vec<usize>,
        mirror: Option<TipMirror>,
    },
    /// The motion begins and ends at given configurations, without a roll, or with one in its
    /// first step. Between them, or after the roll, there are `steps` steps.
    Given {
        first: Vec<f64>,
        last: Vec<f64>,
        steps: usize,
        rolls: bool,
    },
}

impl Ends {
    /// Whether this is a part of the gait that turns, whose rolls are not to be hard.
    pub(super) fn has_soft_rolls(&self) -> bool {
        matches!(
            self,
            Self::Periodic {
                mirror: Some(_),
                ..
            } | Self::Given { .. }
        )
    }

    fn mirror(&self) -> Option<&TipMirror> {
        match self {
            Self::Periodic { mirror, .. } => mirror.as_ref(),
            _ => None,
        }
    }
}

/// The mirror image of a configuration about to roll, or just after it, in the vertical plane
/// through the middle of the side rolled over: node i stands at the image of node `partners[i]`.
#[derive(Debug, Clone)]
pub(super) struct TipMirror {
    pub map: GroundIsometry,
    pub partners: Vec<usize>,
    /// Configurations after the first that are their own mirror images as well.
    pub held: usize,
}

/// One configuration of the motion.
struct Slot {
    support: Support,
    /// Nodes whose positions are unknown; empty for a given configuration.
    free: Vec<usize>,
    /// Index of the first unknown.
    offset: usize,
    /// Place of each node among the free ones.
    place: Vec<Option<usize>>,
}

#[derive(Debug, Clone)]
enum Row {
    /// A physical constraint on one configuration.
    Function {
        slot: usize,
        function: ConstraintFunction,
    },
    /// Signed distance of the centre of mass outside a side: at most 0, or 0 when it tips.
    Balance {
        slot: usize,
        line: SideLine,
        tips: bool,
    },
    /// Distance of the node that lands from a node of the side rolled over (35), (36).
    Landing {
        slot: usize,
        landed: usize,
        pivot: Vector3<f64>,
        distance: f64,
    },
    /// (‖Δp‖² − d²)/(2d) ≤ 0 for a node between a configuration and the next (19).
    Move {
        slot: usize,
        node: usize,
        limit: f64,
    },
    /// Change of a length between a configuration and the next (37).
    TipChange {
        slot: usize,
        member: usize,
        limit: f64,
    },
    /// Fall of the centre of mass between a configuration and the next.
    Fall { slot: usize, limit: f64 },
    /// The worst-case rigidity index of one configuration.
    Rigidity { slot: usize, least: f64 },
    /// A coordinate of the last configuration minus that of the image of the first (39).
    Periodic {
        node: usize,
        role: usize,
        axis: usize,
    },
    /// A component of a node minus that of its partner's mirror image.
    Mirror {
        slot: usize,
        node: usize,
        partner: usize,
        direction: Vector3<f64>,
    },
}

/// The nonlinear programme.
pub(super) struct MotionProblem<'a> {
    robot: &'a Robot,
    slots: Vec<Slot>,
    rows: Vec<Row>,
    /// Index of the last configuration before each roll.
    rolls: Vec<usize>,
    ends: Ends,
    num_variables: usize,
    /// Coordinates of all configurations, one after another; those given or held stay.
    coordinates: Vec<f64>,
    lengths: Vec<f64>,
    /// Derivative of the objective by each length.
    length_slopes: Vec<f64>,
    /// Start of each configuration's blocks in the Hessian's values.
    diagonal: Vec<Range<usize>>,
    below: Vec<Range<usize>>,
    rigidity_gradient: Vec<f64>,
}

const AXES: usize = 3;

impl<'a> MotionProblem<'a> {
    pub(super) fn new(robot: &'a Robot, spec: &MotionSpec<'_>) -> Self {
        let size = robot.num_coordinates();
        let periodic = matches!(spec.ends, Ends::Periodic { .. });
        let (count, rolls): (usize, Vec<usize>) = match spec.ends {
            Ends::Periodic { .. } => (spec.steps + 1, vec![0]),
            Ends::Given {
                steps, rolls: true, ..
            } => (steps + 2, vec![0]),
            Ends::Given { steps, .. } => (steps + 1, Vec::new()),
            Ends::Fixed => {
                let rolls = (0..spec.rolls.len())
                    .map(|roll| roll * spec.steps + spec.tip)
                    .collect();
                (spec.rolls.len() * spec.steps + 1, rolls)
            }
        };

        let mut slots: Vec<Slot> = Vec::with_capacity(count);
        let mut coordinates = Vec::with_capacity(count * size);
        let mut offset = 0;
        for index in 0..count {
            let stance = &spec.stances[rolls.iter().filter(|&&roll| roll < index).count()];
            let given = !periodic && (index == 0 || index + 1 == count);
            coordinates.extend_from_slice(match &spec.ends {
                Ends::Given { first, .. } if index == 0 => first,
                Ends::Given { last, .. } if index + 1 == count => last,
                _ => &stance.coordinates,
            });
            let nodes = robot.graph().num_nodes();
            let free: Vec<usize> = if given {
                Vec::new()
            } else {
                (0..nodes)
                    .filter(|&node| !stance.support.contains(node))
                    .collect()
            };
            let mut place = vec![None; nodes];
            for (position, &node) in free.iter().enumerate() {
                place[node] = Some(position);
            }
            let unknowns = AXES * free.len();
            slots.push(Slot {
                support: stance.support.clone(),
                free,
                offset,
                place,
            });
            offset += unknowns;
        }

        let mut diagonal = Vec::with_capacity(count);
        let mut below = Vec::with_capacity(count);
        let mut entries = 0;
        for index in 0..count {
            let unknowns = AXES * slots[index].free.len();
            let before = if index > 0 {
                AXES * slots[index - 1].free.len()
            } else {
                0
            };
            diagonal.push(entries..entries + unknowns * (unknowns + 1) / 2);
            entries = diagonal[index].end;
            below.push(entries..entries + unknowns * before);
            entries = below[index].end;
        }

        let members = robot.graph().num_members();
        let mut problem = Self {
            robot,
            slots,
            rows: Vec::new(),
            rolls,
            ends: spec.ends.clone(),
            num_variables: offset,
            coordinates,
            lengths: vec![0.0; count * members],
            length_slopes: vec![0.0; count * members],
            diagonal,
            below,
            rigidity_gradient: vec![0.0; size],
        };
        problem.rows = problem.build_rows(spec);
        problem
    }

    fn build_rows(&self, spec: &MotionSpec<'_>) -> Vec<Row> {
        let robot = self.robot;
        let mut rows = Vec::new();
        let functions = ConstraintFunction::all(robot);
        for (index, slot) in self.slots.iter().enumerate() {
            let coordinates = self.slot_coordinates(index);
            if !slot.free.is_empty() {
                for &function in &functions {
                    let moves = |&node: &usize| slot.place[node].is_some();
                    if function.nodes(robot).as_slice().iter().any(moves) {
                        rows.push(Row::Function {
                            slot: index,
                            function,
                        });
                    }
                }
                let last_of_period =
                    matches!(self.ends, Ends::Periodic { .. }) && index + 1 == self.slots.len();
                let tipping = if last_of_period {
                    spec.rolls.get(1)
                } else {
                    self.rolls
                        .iter()
                        .position(|&roll| roll == index)
                        .map(|roll| &spec.rolls[roll])
                };
                for side in 0..slot.support.num_sides() {
                    let line = slot.support.side_line(Dimension::Three, coordinates, side);
                    let tips = tipping.is_some_and(|roll| roll.side == side);
                    rows.push(Row::Balance {
                        slot: index,
                        line,
                        tips,
                    });
                }
                if let Some(roll) = tipping {
                    let next = &spec.stances[self.rolls.iter().filter(|&&r| r < index).count() + 1];
                    let landing = robot.dimension().node(&next.coordinates, roll.landed);
                    for pivot in roll.pivots {
                        let pivot = robot.dimension().node(coordinates, pivot);
                        let distance = (landing - pivot).norm();
                        let landed = roll.landed;
                        rows.push(Row::Landing {
                            slot: index,
                            landed,
                            pivot,
                            distance,
                        });
                    }
                }
                if let Some(least) = robot.limits().min_rigidity {
                    rows.push(Row::Rigidity { slot: index, least });
                }
            }
            if index + 1 == self.slots.len() {
                break;
            }
            let next = &self.slots[index + 1];
            if self.rolls.contains(&index) {
                if let Some(limit) = spec.max_fall {
                    rows.push(Row::Fall { slot: index, limit });
                }
                if let Some(limit) = spec.max_tip_change {
                    for member in 0..robot.graph().num_members() {
                        rows.push(Row::TipChange {
                            slot: index,
                            member,
                            limit,
                        });
                    }
                }
            } else if let Some(limit) = spec.max_move {
                for node in 0..robot.graph().num_nodes() {
                    if slot.place[node].is_some() || next.place[node].is_some() {
                        rows.push(Row::Move {
                            slot: index,
                            node,
                            limit,
                        });
                    }
                }
            }
        }
        if let Ends::Periodic { roles, mirror, .. } = &self.ends {
            let last = &self.slots[self.slots.len() - 1];
            for &node in &last.free {
                for axis in 0..AXES {
                    rows.push(Row::Periodic {
                        node,
                        role: roles[node],
                        axis,
                    });
                }
            }
            let side = spec.rolls[0].side;
            let line =
                self.slots[0]
                    .support
                    .side_line(Dimension::Three, self.slot_coordinates(0), side);
            let directions = [line.axis, line.outward, Vector3::z()];
            let mirrored = mirror.iter().flat_map(|mirror| {
                let slots = self.slots.iter().enumerate().take(1 + mirror.held);
                slots.flat_map(move |(index, slot)| {
                    let free = slot.free.iter();
                    free.map(move |&node| (index, node, mirror.partners[node]))
                })
            });
            for (slot, node, partner) in mirrored {
                // A node that is its own partner is only kept from leaving the mirror.
                let count = match partner.cmp(&node) {
                    std::cmp::Ordering::Less => 0,
                    std::cmp::Ordering::Equal => 1,
                    std::cmp::Ordering::Greater => 3,
                };
                for &direction in &directions[..count] {
                    rows.push(Row::Mirror {
                        slot,
                        node,
                        partner,
                        direction,
                    });
                }
            }
        }
        rows
    }

    /// Number of configurations.
    pub(super) fn num_configurations(&self) -> usize {
        self.slots.len()
    }

    /// Index of the last configuration before each roll.
    pub(super) fn rolls(&self) -> &[usize] {
        &self.rolls
    }

    fn slot_coordinates(&self, slot: usize) -> &[f64] {
        let size = self.robot.num_coordinates();
        &self.coordinates[slot * size..(slot + 1) * size]
    }

    /// Reads the unknowns off a motion.
    pub(super) fn variables(&self, configurations: &[Vec<f64>]) -> Vec<f64> {
        let mut x = Vec::with_capacity(self.num_variables);
        for (slot, configuration) in self.slots.iter().zip(configurations) {
            for &node in &slot.free {
                x.extend_from_slice(&configuration[AXES * node..AXES * (node + 1)]);
            }
        }
        x
    }

    /// The motion with the given unknowns.
    pub(super) fn configurations(&mut self, x: &[f64]) -> Vec<Vec<f64>> {
        self.place(x);
        (0..self.slots.len())
            .map(|slot| self.slot_coordinates(slot).to_vec())
            .collect()
    }

    /// Writes the unknowns into the coordinates.
    fn place(&mut self, x: &[f64]) {
        let size = self.robot.num_coordinates();
        for (index, slot) in self.slots.iter().enumerate() {
            let coordinates = &mut self.coordinates[index * size..(index + 1) * size];
            for (k, &node) in slot.free.iter().enumerate() {
                let from = slot.offset + AXES * k;
                coordinates[AXES * node..AXES * (node + 1)].copy_from_slice(&x[from..from + AXES]);
            }
        }
    }

    fn compute_lengths(&mut self) {
        let size = self.robot.num_coordinates();
        let members = self.robot.graph().num_members();
        for (coordinates, lengths) in self
            .coordinates
            .chunks_exact(size)
            .zip(self.lengths.chunks_exact_mut(members))
        {
            self.robot.lengths_into(coordinates, lengths);
        }
    }

    /// Computes ∂f/∂L for every length of every configuration.
    fn compute_length_slopes(&mut self) {
        let members = self.robot.graph().num_members();
        self.length_slopes.fill(0.0);
        for slot in 0..self.slots.len() - 1 {
            for member in 0..members {
                let (here, next) = (slot * members + member, (slot + 1) * members + member);
                let change = 2.0 * (self.lengths[next] - self.lengths[here]);
                self.length_slopes[here] -= change;
                self.length_slopes[next] += change;
            }
        }
    }

    /// Unit vector along a member, from its second end to its first.
    fn direction(&self, slot: usize, member: usize) -> Vector3<f64> {
        let [a, b] = self.robot.graph().members()[member];
        let coordinates = self.slot_coordinates(slot);
        let edge = Dimension::Three.node(coordinates, a) - Dimension::Three.node(coordinates, b);
        edge.normalize()
    }

    /// Adds a 3 × 3 block to the Hessian's values, for two nodes of one configuration; blocks
    /// above the diagonal and of nodes that are held are left out.
    fn add_diagonal(
        &self,
        values: &mut [f64],
        slot: usize,
        nodes: (usize, usize),
        block: &Matrix3<f64>,
    ) {
        let slot_data = &self.slots[slot];
        let (Some(row), Some(column)) = (slot_data.place[nodes.0], slot_data.place[nodes.1]) else {
            return;
        };
        if row < column {
            return;
        }
        let start = self.diagonal[slot].start;
        for i in 0..AXES {
            let r = AXES * row + i;
            let last = if row == column { i + 1 } else { AXES };
            for j in 0..last {
                values[start + r * (r + 1) / 2 + AXES * column + j] += block[(i, j)];
            }
        }
    }

    /// Adds a 3 × 3 block that couples a node of a configuration (row) with one of the
    /// configuration before (column).
    fn add_below(
        &self,
        values: &mut [f64],
        slot: usize,
        nodes: (usize, usize),
        block: &Matrix3<f64>,
    ) {
        let (here, before) = (&self.slots[slot], &self.slots[slot - 1]);
        let (Some(row), Some(column)) = (here.place[nodes.0], before.place[nodes.1]) else {
            return;
        };
        let width = AXES * before.free.len();
        let start = self.below[slot].start;
        for i in 0..AXES {
            for j in 0..AXES {
                values[start + (AXES * row + i) * width + AXES * column + j] += block[(i, j)];
            }
        }
    }

    /// Adds `scale` times the Hessian of a constraint function on one configuration.
    fn add_function(
        &self,
        values: &mut [f64],
        slot: usize,
        function: ConstraintFunction,
        scale: f64,
    ) {
        if scale == 0.0 || self.slots[slot].free.is_empty() {
            return;
        }
        let nodes = function.nodes(self.robot);
        let positions = nodes.positions(self.robot, self.slot_coordinates(slot));
        let blocks = function.hessian(self.robot.limits(), &positions);
        for (i, &a) in nodes.as_slice().iter().enumerate() {
            for (j, &b) in nodes.as_slice().iter().enumerate() {
                self.add_diagonal(values, slot, (a, b), &(blocks[i][j] * scale));
            }
        }
    }
}
