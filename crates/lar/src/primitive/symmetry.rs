//! The symmetry that lets one motion primitive be used again and again, checked.
//!
//! The starting configuration stands on an equilateral triangle and equals its mirror image in
//! each of the three vertical planes through a support node and the middle of the opposite side,
//! up to a renaming of nodes that keeps members and masses. After a roll over a side the robot
//! must look like the mirror image of the start in the vertical plane through that side, again up
//! to such a renaming. Source: Usevitch et al., section V.A and figure 8. Cost: O(n²) for the
//! mirror images; the renamings of the end are searched by backtracking over graph automorphisms.

use nalgebra::Vector3;
use thiserror::Error;

use crate::{Dimension, GroundIsometry, Robot, Support, SupportError};

/// Why a configuration does not have the symmetry that motion primitives need.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum SymmetryError {
    /// Motion primitives are defined on the triangular grid, in space.
    #[error("motion primitives need a robot in space")]
    Planar,
    /// The support does not carry the robot.
    #[error(transparent)]
    Support(#[from] SupportError),
    /// The support triangle is not equilateral.
    #[error(
        "the support triangle of nodes {nodes:?} has sides of length {lengths:?}: it must be equilateral"
    )]
    NotEquilateral {
        /// The support nodes.
        nodes: [usize; 3],
        /// Lengths of the sides opposite to them.
        lengths: [f64; 3],
    },
    /// A node has no mirror partner.
    #[error(
        "the configuration is not symmetric about the line through support node {through}: the mirror image of node {node} is {distance} away from the nearest node"
    )]
    NoPartner {
        /// The support node on the mirror.
        through: usize,
        /// The node without partner.
        node: usize,
        /// Distance from its mirror image to the nearest node.
        distance: f64,
    },
    /// Mirror partners differ in their members.
    #[error(
        "nodes mirror each other about the line through support node {through}, but member {a}-{b} has no mirror partner"
    )]
    MemberWithoutPartner {
        /// The support node on the mirror.
        through: usize,
        /// One end of the member.
        a: usize,
        /// The other end.
        b: usize,
    },
    /// Mirror partners differ in mass.
    #[error(
        "nodes {node} and {partner} mirror each other about the line through support node {through}, but their masses differ"
    )]
    MassesDiffer {
        /// The support node on the mirror.
        through: usize,
        /// A node.
        node: usize,
        /// Its mirror partner.
        partner: usize,
    },
}

/// Checks that a configuration has the symmetry of a primitive's start, and returns for each
/// support node the mirror partner of every node about the line through it.
///
/// # Errors
/// See [`SymmetryError`], with nodes closer than `tolerance` counting as coincident.
pub fn check_symmetry(
    robot: &Robot,
    coordinates: &[f64],
    support: &Support,
    tolerance: f64,
) -> Result<[Vec<usize>; 3], SymmetryError> {
    if robot.dimension() == Dimension::Two {
        return Err(SymmetryError::Planar);
    }
    support.validate(robot, coordinates, tolerance)?;
    let nodes: [usize; 3] = std::array::from_fn(|k| support.nodes()[k]);
    let corner = nodes.map(|node| robot.dimension().node(coordinates, node));
    let lengths: [f64; 3] =
        std::array::from_fn(|k| (corner[(k + 1) % 3] - corner[(k + 2) % 3]).norm());
    let spread = lengths
        .iter()
        .fold(0.0_f64, |most, l| most.max((l - lengths[0]).abs()));
    if spread > tolerance {
        return Err(SymmetryError::NotEquilateral { nodes, lengths });
    }
    let mut partners = [Vec::new(), Vec::new(), Vec::new()];
    for (k, partners) in partners.iter_mut().enumerate() {
        let (a, b) = (corner[(k + 1) % 3], corner[(k + 2) % 3]);
        // Swapping the ends of the opposite side while keeping the sides of its line.
        let mirror = GroundIsometry::between_segments([a, b], [b, a], true, 10.0 * tolerance)
            .ok_or(SymmetryError::NotEquilateral { nodes, lengths })?;
        *partners = match_nodes(robot, coordinates, coordinates, &mirror, tolerance).map_err(
            |(node, distance)| SymmetryError::NoPartner {
                through: nodes[k],
                node,
                distance,
            },
        )?;
        let through = nodes[k];
        for &[a, b] in robot.graph().members() {
            if robot
                .graph()
                .member_between(partners[a], partners[b])
                .is_none()
            {
                return Err(SymmetryError::MemberWithoutPartner { through, a, b });
            }
        }
        for (node, &partner) in partners.iter().enumerate() {
            if (robot.mass_fractions()[node] - robot.mass_fractions()[partner]).abs() > 1e-9 {
                return Err(SymmetryError::MassesDiffer {
                    through,
                    node,
                    partner,
                });
            }
        }
    }
    Ok(partners)
}

/// For each node i of `target` the node r of `source` with `map`(sourceᵣ) = targetᵢ; or the node
/// without a partner and its distance from the nearest candidate.
pub(super) fn match_nodes(
    robot: &Robot,
    source: &[f64],
    target: &[f64],
    map: &GroundIsometry,
    tolerance: f64,
) -> Result<Vec<usize>, (usize, f64)> {
    let dimension = robot.dimension();
    let count = robot.graph().num_nodes();
    let images: Vec<Vector3<f64>> = (0..count)
        .map(|node| map.apply(&dimension.node(source, node)))
        .collect();
    let mut taken = vec![false; count];
    let mut roles = Vec::with_capacity(count);
    for node in 0..count {
        let position = dimension.node(target, node);
        let nearest = (0..count)
            .filter(|&role| !taken[role])
            .map(|role| (role, (images[role] - position).norm()))
            .min_by(|a, b| a.1.total_cmp(&b.1));
        match nearest {
            Some((role, distance)) if distance <= tolerance => {
                taken[role] = true;
                roles.push(role);
            }
            other => return Err((node, other.map_or(f64::INFINITY, |(_, distance)| distance))),
        }
    }
    Ok(roles)
}

/// Which node takes whose place when the robot rolls: node i ends where the mirror image of
/// node `roles()[i]` stood.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Relabelling {
    roles: Vec<usize>,
    landing: usize,
}

impl Relabelling {
    /// For each node, the node whose place (mirrored in the side rolled over) it takes.
    #[must_use]
    pub fn roles(&self) -> &[usize] {
        &self.roles
    }

    /// The node that comes down.
    #[must_use]
    pub fn landing(&self) -> usize {
        self.landing
    }

    /// Coordinates after the roll.
    #[must_use]
    pub fn end(&self, robot: &Robot, start: &[f64], support: &Support, side: usize) -> Vec<f64> {
        let line = support.side_line(robot.dimension(), start, side);
        let mut end = start.to_vec();
        for (node, &role) in self.roles.iter().enumerate() {
            let point = robot.dimension().node(start, role);
            let image = point - line.outward * (2.0 * line.outside(&point));
            robot.dimension().set_node(&mut end, node, &image);
        }
        end
    }
}

/// All ways to rename nodes in a roll over `side` that keep members and masses, leave the two
/// nodes of the side in place and bring another node down: the candidates for the end of a
/// primitive, in lexicographic order. Whether a motion leads to each is another matter.
///
/// # Errors
/// A start without the symmetry of section V.A.
pub fn relabellings(
    robot: &Robot,
    start: &[f64],
    support: &Support,
    side: usize,
    tolerance: f64,
) -> Result<Vec<Relabelling>, SymmetryError> {
    check_symmetry(robot, start, support, tolerance)?;
    let pivots = support.side_nodes(side);
    let lifted = support.nodes()[side];
    let count = robot.graph().num_nodes();
    let mut found = Vec::new();
    let mut roles = Vec::with_capacity(count);
    extend_roles(robot, &pivots, &mut roles, &mut |roles| {
        let landing = roles.iter().position(|&role| role == lifted);
        if let Some(landing) = landing.filter(|&node| node != lifted) {
            found.push(Relabelling {
                roles: roles.to_vec(),
                landing,
            });
        }
    });
    Ok(found)
}

/// Backtracking over renamings: nodes before `roles.len()` are assigned.
fn extend_roles(
    robot: &Robot,
    pivots: &[usize],
    roles: &mut Vec<usize>,
    report: &mut impl FnMut(&[usize]),
) {
    let graph = robot.graph();
    let node = roles.len();
    if node == graph.num_nodes() {
        report(roles);
        return;
    }
    for role in 0..graph.num_nodes() {
        let stays = pivots.contains(&node) || pivots.contains(&role);
        if (stays && role != node)
            || roles.contains(&role)
            || (robot.mass_fractions()[role] - robot.mass_fractions()[node]).abs() > 1e-9
        {
            continue;
        }
        let keeps_members = roles.iter().enumerate().all(|(other, &other_role)| {
            graph.member_between(node, other).is_some()
                == graph.member_between(role, other_role).is_some()
        });
        if keeps_members {
            roles.push(role);
            extend_roles(robot, pivots, roles, report);
            roles.pop();
        }
    }
}
