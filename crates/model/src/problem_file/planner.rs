//! The table `[planner]` of a problem file.

use toml::de::DeValue;

use super::decode::{Decoder, Value};
use crate::{
    problem::{Formulation, NeighbourSearch, PlannerKind, PlannerSettings, SamplingRadius},
    statics::Actuation,
};

/// Decodes the value of `planner` into settings; what it does not state stays.
pub(crate) fn decode(decoder: &mut Decoder<'_>, value: Value<'_>, settings: &mut PlannerSettings) {
    let Some(mut table) = decoder.table(value) else {
        return;
    };
    if let Some(value) = table.take("kind") {
        let kinds = [
            ("two-trees", PlannerKind::TwoTrees),
            ("one-tree", PlannerKind::OneTree),
        ];
        if let Some(kind) = decoder.choice(value, &kinds) {
            settings.planner = kind;
        }
    }
    if let Some(value) = table.take("formulation") {
        let formulations = [
            ("nodes", Formulation::Nodes),
            ("directions", Formulation::Directions),
        ];
        if let Some(formulation) = decoder.choice(value, &formulations) {
            settings.formulation = formulation;
        }
    }
    if let Some(value) = table.take("sampling_radius") {
        let radius = if let DeValue::String(_) = value.get_ref() {
            let choices = [
                ("automatic", SamplingRadius::Automatic),
                ("adaptive", SamplingRadius::Adaptive),
            ];
            decoder.choice(value, &choices)
        } else {
            positive(decoder, value).map(SamplingRadius::Fixed)
        };
        if let Some(radius) = radius {
            settings.sampling_radius = radius;
        }
    }
    if let Some(value) = table.take("neighbours")
        && let Some(neighbours) = decoder.choice(value, &NeighbourSearch::NAMED)
    {
        settings.neighbours = neighbours;
    }
    if let Some(value) = table.take("slide")
        && let Some(slide) = decoder.flag(value)
    {
        settings.slide = slide;
    }
    for (key, target) in [
        ("tolerance", &mut settings.tolerance),
        ("chart_radius", &mut settings.chart_radius),
        ("chart_error", &mut settings.chart_error),
        ("step", &mut settings.step),
        ("time_limit", &mut settings.time_limit),
    ] {
        if let Some(value) = table.take(key)
            && let Some(number) = positive(decoder, value)
        {
            *target = number;
        }
    }
    if let Some(value) = table.take("curvature") {
        let fraction = |number| number > 0.0 && number < 1.0;
        if let Some(number) = decoder.number_if(value, "a number between 0 and 1", fraction) {
            settings.curvature = number;
        }
    }
    for (key, target) in [
        ("max_newton_iterations", &mut settings.max_newton_iterations),
        ("max_charts", &mut settings.max_charts),
        ("max_nodes", &mut settings.max_nodes),
    ] {
        if let Some(value) = table.take(key)
            && let Some(count) = count(decoder, value)
        {
            *target = count;
        }
    }
    if let Some(value) = table.take("actuation") {
        let actuations = [("length", Actuation::Length), ("force", Actuation::Force)];
        if let Some(actuation) = decoder.choice(value, &actuations) {
            settings.actuation = actuation;
        }
    }
    if let Some(value) = table.take("least_stiffness") {
        let stiffness = decoder.number_if(value, "a number of at least 0", |number| number >= 0.0);
        settings.least_stiffness = stiffness.or(settings.least_stiffness);
    }
    if let Some(value) = table.take("expected_dimension") {
        settings.expected_dimension = count(decoder, value).or(settings.expected_dimension);
    }
    decoder.finish(table);
}

fn positive(decoder: &mut Decoder<'_>, value: Value<'_>) -> Option<f64> {
    decoder.number_if(value, "a positive number", |number| number > 0.0)
}

fn count(decoder: &mut Decoder<'_>, value: Value<'_>) -> Option<usize> {
    let count = decoder.whole(value, 1..u64::MAX)?;
    // Saturates, which is as good as no limit.
    Some(usize::try_from(count).unwrap_or(usize::MAX))
}
