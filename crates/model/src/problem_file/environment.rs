//! The tables `[obstacles]` and `[collisions]` of a problem file.

use toml::de::DeValue;

use super::decode::{Decoder, Table, Value};
use crate::{
    declarations::{self, Span, Spans, color_names},
    diagnostic::did_you_mean,
    environment::{CollisionRule, EnvironmentBuilder, Obstacle, PairSelection, Role, Shape},
    files::Meshes,
    structure::AttachedShape,
};

const ROLES: [(&str, Role); 3] = [
    ("solid", Role::Solid),
    ("hidden", Role::Hidden),
    ("decoration", Role::Decoration),
];

/// The colour that a table states.
pub(crate) fn color(decoder: &mut Decoder<'_>, table: &mut Table<'_>) -> Option<String> {
    let value = table.take("color")?;
    let name = decoder.text(value, "the name of a colour")?;
    let color = declarations::color(name);
    if color.is_none() {
        let names: Vec<&str> = color_names().collect();
        let hint = did_you_mean(name, color_names())
            .unwrap_or_else(|| format!("colours are {}", names.join(", ")));
        decoder.error(value.span(), format!("there is no colour `{name}`"), hint);
    }
    color
}

/// The role that a table states.
pub(crate) fn role(decoder: &mut Decoder<'_>, table: &mut Table<'_>) -> Option<Role> {
    let value = table.take("role")?;
    decoder.choice(value, &ROLES)
}

/// Which shape a table describes.
#[derive(Clone, Copy)]
enum Form {
    Box,
    Sphere,
    Cylinder,
    Prism,
    HalfSpace,
    Mesh,
}

const FORMS: [(&str, Form); 6] = [
    ("box", Form::Box),
    ("sphere", Form::Sphere),
    ("cylinder", Form::Cylinder),
    ("prism", Form::Prism),
    ("half_space", Form::HalfSpace),
    ("mesh", Form::Mesh),
];

/// The shape that a table describes, with its colour and role; what else the table
/// holds is left in it.
pub(crate) fn attached_shape(
    decoder: &mut Decoder<'_>,
    table: &mut Table<'_>,
    planar: bool,
    meshes: &mut Meshes,
) -> Option<AttachedShape> {
    let color = color(decoder, table);
    let role = role(decoder, table).unwrap_or_default();
    let Some(form) = table.take("shape") else {
        let hint =
            "shape = \"box\", \"sphere\", \"cylinder\", \"prism\", \"half_space\" or \"mesh\"";
        decoder.error(table.span.clone(), "no shape is stated", hint.to_string());
        return None;
    };
    let form = decoder.choice(form, &FORMS)?;
    let shape = shape(decoder, table, form, planar, meshes)?;
    Some(AttachedShape { shape, role, color })
}

fn shape<'t>(
    decoder: &mut Decoder<'_>,
    table: &mut Table<'t>,
    form: Form,
    planar: bool,
    meshes: &mut Meshes,
) -> Option<Shape> {
    let span = table.span.clone();
    let mut need = |decoder: &mut Decoder<'_>, key: &'static str| -> Option<Value<'t>> {
        let value = table.take(key);
        if value.is_none() {
            decoder.error(span.clone(), format!("`{key}` is missing"), None);
        }
        value
    };
    match form {
        Form::Box => {
            let min = need(decoder, "min").and_then(|value| decoder.point(value, false));
            if let Some(size) = table.take("size") {
                let size = decoder.vector(size, false)?;
                let min = min?;
                let max = min + nalgebra::Vector3::from(size);
                return Some(Shape::Box { min, max });
            }
            let Some(max) = table.take("max") else {
                decoder.error(span, "`max` or `size` is missing", None);
                return None;
            };
            let max = decoder.point(max, false)?;
            Some(Shape::Box { min: min?, max })
        }
        Form::Sphere => {
            let center = need(decoder, "center").and_then(|value| decoder.point(value, planar));
            let radius = need(decoder, "radius").and_then(|value| decoder.number(value));
            Some(Shape::Sphere {
                center: center?,
                radius: radius?,
            })
        }
        Form::Cylinder => {
            let p = need(decoder, "from").and_then(|value| decoder.point(value, planar));
            let q = need(decoder, "to").and_then(|value| decoder.point(value, planar));
            let radius = need(decoder, "radius").and_then(|value| decoder.number(value));
            Some(Shape::Cylinder {
                p: p?,
                q: q?,
                radius: radius?,
            })
        }
        Form::Prism => {
            let height = need(decoder, "height").and_then(|value| decoder.number(value));
            let value = need(decoder, "corners")?;
            let corners: Vec<_> = decoder
                .list(value)?
                .into_iter()
                .filter_map(|corner| decoder.point(corner, false))
                .collect();
            let Ok(corners) = corners.try_into() else {
                decoder.error(value.span(), "three corners are expected here", None);
                return None;
            };
            let height = height?;
            Some(Shape::Prism { corners, height })
        }
        Form::HalfSpace => {
            let point = need(decoder, "point").and_then(|value| decoder.point(value, planar));
            let normal = need(decoder, "normal").and_then(|value| decoder.vector(value, planar));
            Some(Shape::HalfSpace {
                point: point?,
                normal: normal?.into(),
            })
        }
        Form::Mesh => {
            let value = need(decoder, "file")?;
            let name = decoder.text(value, "the name of an `.off` file")?;
            let shape = meshes.mesh(name, decoder.findings);
            if shape.is_none() {
                decoder.error(value.span(), "this mesh cannot be read", None);
            }
            shape
        }
    }
}

/// Decodes obstacles and collision rules. Nothing if the file states neither.
///
/// Without rules, every obstacle is tested against the whole structure.
pub(crate) fn decode(
    decoder: &mut Decoder<'_>,
    table: &mut Table<'_>,
    planar: bool,
    meshes: &mut Meshes,
) -> Option<(EnvironmentBuilder, Spans)> {
    let obstacles = table.take("obstacles");
    let collisions = table.take("collisions");
    if obstacles.is_none() && collisions.is_none() {
        return None;
    }
    let mut builder = EnvironmentBuilder::default();
    let mut spans = Spans::default();
    if let Some(obstacles) = obstacles.and_then(|value| decoder.table(value)) {
        for entry in obstacles.into_entries() {
            let Some(mut table) = decoder.table(entry.value) else {
                continue;
            };
            let attached = attached_shape(decoder, &mut table, planar, meshes);
            decoder.finish(table);
            if let Some(attached) = attached {
                if collisions.is_none() && attached.role != Role::Decoration {
                    builder = builder.check_obstacle(entry.key);
                    let span = entry.key_span.clone();
                    spans.rules.push([span.clone(), span]);
                }
                builder = builder.obstacle(Obstacle {
                    name: entry.key.to_string(),
                    shape: attached.shape,
                    role: attached.role,
                    color: attached.color,
                });
                spans.obstacles.push(entry.key_span);
            }
        }
    }
    let Some(collisions) = collisions else {
        return Some((builder, spans));
    };
    let mut rules = Vec::new();
    if let Some(mut table) = decoder.table(collisions) {
        if let Some(value) = table.take("check") {
            selections(decoder, value, true, &mut rules);
        }
        if let Some(value) = table.take("ignore") {
            selections(decoder, value, false, &mut rules);
        }
        decoder.finish(table);
    }
    for (rule, span) in rules {
        builder = builder.rule(rule);
        spans.rules.push(span);
    }
    Some((builder, spans))
}

/// `"all"`, `"connected"`, or a list of these, of obstacles, and of pairs, whose
/// members may be lists in turn.
fn selections(
    decoder: &mut Decoder<'_>,
    value: Value<'_>,
    check: bool,
    rules: &mut Vec<(CollisionRule, [Span; 2])>,
) {
    let list = match value.get_ref() {
        DeValue::String(_) => vec![value],
        _ => match decoder.list(value) {
            Some(list) => list,
            None => return,
        },
    };
    for value in list {
        let span = value.span();
        if let DeValue::String(name) = value.get_ref() {
            let pairs = match name.as_ref() {
                "all" => PairSelection::All,
                "connected" if check => {
                    let hint = "connected elements always touch; leave it out".to_string();
                    decoder.error(span, "connected elements cannot be checked", hint);
                    continue;
                }
                "connected" => PairSelection::Connected,
                name => PairSelection::Obstacle(name.to_string()),
            };
            rules.push((CollisionRule { check, pairs }, [span.clone(), span]));
            continue;
        }
        let Some(members) = decoder.list(value) else {
            continue;
        };
        let [first, second] = members[..] else {
            let hint = "a pair is [\"a\", \"b\"], or [[\"a\", \"b\"], [\"c\", \"d\"]] for every one with every other";
            decoder.error(span, "a pair of bodies is expected here", hint.to_string());
            continue;
        };
        let (Some(first), Some(second)) = (side(decoder, first), side(decoder, second)) else {
            continue;
        };
        // More rules than this cannot all matter: bounds the work on hopeless input.
        const MOST: usize = 1_000_000;
        if rules.len() + first.len().saturating_mul(second.len()) > MOST {
            decoder.error(value.span(), "there are too many pairs", None);
            return;
        }
        for (a, a_span) in &first {
            for (b, b_span) in &second {
                let pairs = PairSelection::Pair((*a).to_string(), (*b).to_string());
                let rule = CollisionRule { check, pairs };
                rules.push((rule, [a_span.clone(), b_span.clone()]));
            }
        }
    }
}

/// One side of a pair: a name or a list of names.
fn side<'t>(decoder: &mut Decoder<'_>, value: Value<'t>) -> Option<Vec<(&'t str, Span)>> {
    match value.get_ref() {
        DeValue::String(name) => Some(vec![(name.as_ref(), value.span())]),
        _ => decoder.names(value),
    }
}
