//! The options of the planners.

use toml::Spanned;

use super::tables::{GreedyTable, ObjectiveName, PersistenceName, TwoTierTable};
use super::{Locator, WalkProblemError};
use crate::{
    GreedyError, GreedyObjective, GreedyOptions, Persistence, PrimitiveError, PrimitiveOptions,
};

pub(super) fn read_greedy(
    at: &Locator<'_>,
    table: Option<&Spanned<GreedyTable>>,
    clearance: f64,
) -> Result<GreedyOptions, WalkProblemError> {
    let mut options = GreedyOptions::default().with_obstacle_clearance(Some(clearance));
    let Some(table) = table else {
        return Ok(options);
    };
    let given = table.get_ref();
    if let Some(ObjectiveName::NominalLengths) = given.objective {
        let nominal = given
            .nominal_length
            .as_ref()
            .map_or(1.0, |value| *value.get_ref());
        options.objective = GreedyObjective::NominalLengths(nominal);
    } else if let Some(nominal) = &given.nominal_length {
        let message = "`nominal_length` needs objective = \"nominal-lengths\"";
        return Err(at.error(nominal.span(), message));
    }
    if let Some(step) = &given.step {
        options.step = *step.get_ref();
    }
    if let Some(tolerance) = &given.waypoint_tolerance {
        options.waypoint_tolerance = *tolerance.get_ref();
    }
    if let Some(most) = &given.max_configurations {
        options.max_configurations = *most.get_ref();
    }
    options.persistence = match given.persistence {
        Some(PersistenceName::Stop) => Persistence::Stop,
        Some(PersistenceName::Shrink) => Persistence::Shrink,
        Some(PersistenceName::Recover) | None => Persistence::Recover,
    };
    options.validate().map_err(|error| {
        let span = match &error {
            GreedyError::Option { name, .. } => match *name {
                "step" => given.step.as_ref().map(Spanned::span),
                "waypoint_tolerance" => given.waypoint_tolerance.as_ref().map(Spanned::span),
                "max_configurations" => given.max_configurations.as_ref().map(Spanned::span),
                _ => given.nominal_length.as_ref().map(Spanned::span),
            },
            _ => None,
        };
        at.error(span.unwrap_or_else(|| table.span()), error)
    })?;
    Ok(options)
}

/// How two-tier planning works.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct TwoTierOptions {
    /// How motion primitives are computed.
    pub primitives: PrimitiveOptions,
    /// Rolls of the longest primitives that a walk is smoothed with. Default 2, as in the paper;
    /// more are cheaper a roll, but the number of primitives doubles with each, and the gait is
    /// cheaper still.
    pub rolls: usize,
    /// Whether a periodic gait may be walked, besides primitives. Default true.
    pub gait: bool,
    /// Renaming of nodes in a roll; by default the one with the cheapest primitive.
    pub roles: Option<Vec<usize>>,
}

impl Default for TwoTierOptions {
    fn default() -> Self {
        Self {
            primitives: PrimitiveOptions::default(),
            rolls: 2,
            gait: true,
            roles: None,
        }
    }
}

pub(super) fn read_two_tier(
    at: &Locator<'_>,
    table: Option<&Spanned<TwoTierTable>>,
    nodes: usize,
) -> Result<TwoTierOptions, WalkProblemError> {
    let mut options = TwoTierOptions::default();
    let Some(table) = table else {
        return Ok(options);
    };
    let given = table.get_ref();
    let span = |key: &Option<Spanned<usize>>| key.as_ref().map_or(table.span(), Spanned::span);
    if let Some(steps) = &given.steps {
        options.primitives.steps = *steps.get_ref();
        options.primitives.tip = *steps.get_ref() / 2;
    }
    if let Some(starts) = &given.starts {
        options.primitives.starts = *starts.get_ref();
    }
    options.primitives.validate().map_err(|error| {
        let key = match &error {
            PrimitiveError::Option { name: "starts", .. } => &given.starts,
            _ => &given.steps,
        };
        at.error(span(key), error)
    })?;
    if let Some(rolls) = &given.rolls {
        options.rolls = *rolls.get_ref();
    }
    if !(1..=6).contains(&options.rolls) {
        let message = format!("`rolls` is {}: it must lie between 1 and 6", options.rolls);
        return Err(at.error(span(&given.rolls), message));
    }
    if let Some(gait) = given.gait {
        options.gait = gait;
    }
    if let Some(roles) = &given.roles {
        let count = roles.get_ref().len();
        if count != nodes {
            let message = format!("`roles` names {count} nodes of {nodes}");
            return Err(at.error(roles.span(), message));
        }
        options.roles = Some(roles.get_ref().clone());
    }
    Ok(options)
}
