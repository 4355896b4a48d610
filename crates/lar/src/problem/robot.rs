//! The robot of a problem, and where it starts.

use std::ops::Range;

use toml::Spanned;

use super::tables::{MemberList, Preset, RobotTable};
use super::{Locator, WalkProblemError, read_place};
use crate::graph::MOST_MEMBERS;
use crate::known::RobotAtStart;
use crate::{
    Dimension, Framework, Graph, GraphError, Limits, Rigidity, Robot, Stance, Support, unit_k5,
    unit_octahedron,
};

pub(super) fn read_robot(
    at: &Locator<'_>,
    table: &Spanned<RobotTable>,
    limits: &Limits,
) -> Result<(Robot, Vec<String>, Stance), WalkProblemError> {
    let given = table.get_ref();
    let (mut robot, mut start) = match &given.preset {
        Some(preset) => {
            for (present, name) in [
                (given.nodes.is_some(), "nodes"),
                (given.members.is_some(), "members"),
                (given.support.is_some(), "support"),
            ] {
                if present {
                    let message = format!("give either a preset or `{name}`, not both");
                    return Err(at.error(preset.span(), message));
                }
            }
            let RobotAtStart { robot, stance } = match preset.get_ref() {
                Preset::K5 => unit_k5(limits.clone()),
                Preset::Octahedron => unit_octahedron(limits.clone()),
            }
            .map_err(|error| at.error(preset.span(), error))?;
            (robot, stance)
        }
        None => read_explicit_robot(at, table, limits)?,
    };
    if let Some(masses) = &given.masses {
        robot = robot
            .with_masses(masses.get_ref())
            .map_err(|error| at.error(masses.span(), error))?;
    }
    let names = match &given.names {
        Some(names) => {
            let count = robot.graph().num_nodes();
            if names.get_ref().len() != count {
                let message = format!(
                    "{} names for {count} nodes: name each once",
                    names.get_ref().len()
                );
                return Err(at.error(names.span(), message));
            }
            names.get_ref().clone()
        }
        None => Vec::new(),
    };
    if let Some(centre) = &given.centre_of_mass {
        let place = read_place(at, centre, robot.dimension(), "the centre of mass")?;
        let moved = RobotAtStart {
            robot,
            stance: start,
        }
        .moved_to(place);
        (robot, start) = (moved.robot, moved.stance);
    }
    Ok((robot, names, start))
}

fn read_explicit_robot(
    at: &Locator<'_>,
    table: &Spanned<RobotTable>,
    limits: &Limits,
) -> Result<(Robot, Stance), WalkProblemError> {
    let given = table.get_ref();
    let missing = |name: &str| {
        at.error(
            table.span(),
            format!("the robot needs `{name}` (or a `preset`)"),
        )
    };
    let nodes = given.nodes.as_ref().ok_or_else(|| missing("nodes"))?;
    let members = given.members.as_ref().ok_or_else(|| missing("members"))?;
    let support = given.support.as_ref().ok_or_else(|| missing("support"))?;

    let axes = nodes
        .get_ref()
        .first()
        .map_or(0, |position| position.get_ref().len());
    let dimension = Dimension::try_from(axes).map_err(|_| {
        at.error(
            nodes.span(),
            "give each node two coordinates (plane) or three (space)",
        )
    })?;
    let mut coordinates = Vec::with_capacity(axes * nodes.get_ref().len());
    for (node, position) in nodes.get_ref().iter().enumerate() {
        if position.get_ref().len() != axes {
            let message = format!(
                "node {node} has {} coordinates, node 0 has {axes}",
                position.get_ref().len()
            );
            return Err(at.error(position.span(), message));
        }
        if let Some(value) = position.get_ref().iter().find(|value| !value.is_finite()) {
            let message = format!("node {node} has the coordinate {value}: give finite numbers");
            return Err(at.error(position.span(), message));
        }
        coordinates.extend_from_slice(position.get_ref());
    }
    let count = nodes.get_ref().len();
    let num_members = match members.get_ref() {
        MemberList::List(list) => list.len(),
        MemberList::Complete => count.saturating_mul(count.saturating_sub(1)) / 2,
    };
    if num_members > MOST_MEMBERS {
        let message = format!("{num_members} members are too many: at most {MOST_MEMBERS}");
        return Err(at.error(members.span(), message));
    }
    let graph = match members.get_ref() {
        MemberList::List(list) => Graph::new(count, list.iter().map(|member| *member.get_ref())),
        MemberList::Complete => Graph::complete(count),
    }
    .map_err(|error| {
        let member = |index: usize| match members.get_ref() {
            MemberList::List(list) => list.get(index).map(Spanned::span),
            MemberList::Complete => None,
        };
        let span = match error {
            GraphError::NodeOutOfRange { member: index, .. }
            | GraphError::Loop { member: index, .. }
            | GraphError::Duplicate { second: index, .. } => member(index),
            GraphError::FreeNode { node } => nodes.get_ref().get(node).map(Spanned::span),
            GraphError::TooSmall { .. } => Some(nodes.span()),
        };
        at.error(span.unwrap_or_else(|| members.span()), error)
    })?;
    // Coinciding ends of a member are refused here, with the nodes.
    Framework::new(graph.clone(), dimension, coordinates.clone())
        .map_err(|error| at.error(nodes.span(), error))?;
    let robot = Robot::new(graph, dimension, limits.clone())
        .map_err(|error| at.error(table.span(), error))?;
    let support =
        Support::new(&robot, support.get_ref()).map_err(|error| at.error(support.span(), error))?;
    Ok((
        robot,
        Stance {
            coordinates,
            support,
        },
    ))
}

/// Refuses a robot that is not rigid, violates a limit or does not stand.
pub(super) fn check_start(
    at: &Locator<'_>,
    table: &Spanned<RobotTable>,
    robot: &Robot,
    start: &Stance,
) -> Result<(), WalkProblemError> {
    let given = table.get_ref();
    let place = |key: Option<Range<usize>>| key.unwrap_or_else(|| table.span());
    let (nodes, members) = (
        given.nodes.as_ref().map(Spanned::span),
        given.members.as_ref().map(Spanned::span),
    );
    let framework = robot
        .framework(&start.coordinates)
        .map_err(|error| at.error(place(nodes.clone()), error))?;
    let rigidity = Rigidity::of(&framework);
    if !rigidity.is_infinitesimally_rigid() {
        let loose: Vec<String> = rigidity
            .loose_nodes()
            .into_iter()
            .map(|node| {
                match given
                    .names
                    .as_ref()
                    .and_then(|names| names.get_ref().get(node))
                {
                    Some(name) => format!("{node} ({name})"),
                    None => node.to_string(),
                }
            })
            .collect();
        let message = format!(
            "the robot is not infinitesimally rigid: it has {} mechanism(s), which move nodes \
             {}; add members there, or move nodes out of a common line or plane",
            rigidity.num_mechanisms(),
            loose.join(", ")
        );
        return Err(at.error(place(members), message));
    }
    let violations = robot.violations(&start.coordinates, 1e-6);
    if let Some((constraint, violation)) = violations.first() {
        let message = format!(
            "the initial configuration violates the {constraint} by {violation:.6} ({} \
             constraint(s) in all): change the positions or the limits",
            violations.len()
        );
        return Err(at.error(place(nodes), message));
    }
    start
        .support
        .validate(robot, &start.coordinates, 1e-6)
        .map_err(|error| {
            let support = given.support.as_ref().map(Spanned::span);
            at.error(place(support), format!("the robot does not stand: {error}"))
        })
}
