//! The table `[formfind]` of a problem file, and the conditions of a start or goal that is found.

use std::collections::HashMap;

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, Vector3};
use toml::de::DeValue;

use super::{
    decode::{Decoder, Table, Value},
    endpoint::unknown,
};
use crate::{
    declarations::Span,
    form::{FormCondition, FormCost, FormSettings},
    structure::{Interval, Structure},
    tens::transform,
};

/// A name and where it stands.
type Name<'t> = (&'t str, Span);

/// A condition whose names are not resolved yet.
pub(crate) enum Stated<'t> {
    Point {
        of: Vec<(Name<'t>, f64)>,
        at: [Option<Interval>; 3],
    },
    Distance([Name<'t>; 2], Interval),
    Element(Quantity, Name<'t>, Interval),
    EqualLengths([Name<'t>; 2]),
    Image {
        nodes: [Name<'t>; 2],
        linear: Matrix3<f64>,
        translation: Vector3<f64>,
    },
    Pose(Name<'t>, Isometry3<f64>),
}

/// A quantity of an element.
#[derive(Clone, Copy)]
pub(crate) enum Quantity {
    Length,
    RestLength,
    Force,
}

/// The table `[formfind]` before its names are resolved.
#[derive(Default)]
pub(crate) struct StatedSettings<'t> {
    settings: FormSettings,
    conditions: Vec<Stated<'t>>,
}

/// Decodes the table `[formfind]`.
pub(crate) fn decode<'t>(
    decoder: &mut Decoder<'_>,
    value: Value<'t>,
    planar: bool,
) -> StatedSettings<'t> {
    let mut stated = StatedSettings::default();
    let Some(mut table) = decoder.table(value) else {
        return stated;
    };
    stated.conditions = conditions(decoder, &mut table, planar);
    let settings = &mut stated.settings;
    if let Some(value) = table.take("starts")
        && let Some(count) = decoder.whole(value, 1..1_000_001)
    {
        // In range by the test above.
        settings.starts = count as usize;
    }
    let distance = |decoder: &mut Decoder<'_>, value| {
        decoder.number_if(value, "a distance that is not negative", |x| x >= 0.0)
    };
    if let Some(value) = table.take("clearance")
        && let Some(clearance) = distance(decoder, value)
    {
        settings.clearance = clearance;
    }
    if let Some(value) = table.take("node_radius") {
        settings.node_radius = distance(decoder, value);
    }
    if let Some(value) = table.take("infinite_cylinders") {
        settings.infinite_cylinders = decoder.flag(value).unwrap_or_default();
    }
    if let Some(value) = table.take("least_stiffness") {
        settings.least_stiffness = match value.get_ref() {
            DeValue::Boolean(_) => decoder.flag(value).and_then(|flag| flag.then_some(0.0)),
            _ => decoder.number_if(value, "a stiffness that is not negative, or false", |x| {
                x >= 0.0
            }),
        };
    }
    if let Some(value) = table.take("cost") {
        let costs = [("none", FormCost::None), ("energy", FormCost::Energy)];
        settings.cost = decoder.choice(value, &costs).unwrap_or_default();
    }
    decoder.finish(table);
    stated
}

/// Decodes the conditions of a start or goal.
pub(crate) fn decode_conditions<'t>(
    decoder: &mut Decoder<'_>,
    value: Value<'t>,
    planar: bool,
) -> Option<Vec<Stated<'t>>> {
    let mut table = decoder.table(value)?;
    let conditions = conditions(decoder, &mut table, planar);
    decoder.finish(table);
    Some(conditions)
}

/// Takes the conditions out of a table.
fn conditions<'t>(
    decoder: &mut Decoder<'_>,
    table: &mut Table<'t>,
    planar: bool,
) -> Vec<Stated<'t>> {
    let mut found = Vec::new();
    for entry in entries(decoder, table.take("nodes")) {
        if let Some(at) = coordinates(decoder, entry.value, planar) {
            let of = vec![((entry.key, entry.key_span), 1.0)];
            found.push(Stated::Point { of, at });
        }
    }
    for value in members(decoder, table.take("points")) {
        found.extend(point(decoder, value, planar));
    }
    for value in members(decoder, table.take("distances")) {
        found.extend(distance(decoder, value));
    }
    for (key, quantity) in [
        ("lengths", Quantity::Length),
        ("rest_lengths", Quantity::RestLength),
        ("forces", Quantity::Force),
    ] {
        for entry in entries(decoder, table.take(key)) {
            if let Some(range) = range(decoder, entry.value) {
                found.push(Stated::Element(
                    quantity,
                    (entry.key, entry.key_span),
                    range,
                ));
            }
        }
    }
    for value in members(decoder, table.take("equal_lengths")) {
        let names = decoder.names(value).unwrap_or_default();
        if names.len() < 2 {
            let message = "two elements or more are expected here";
            decoder.error(value.span(), message, None);
        }
        for pair in names.windows(2) {
            found.push(Stated::EqualLengths([pair[0].clone(), pair[1].clone()]));
        }
    }
    for value in members(decoder, table.take("symmetry")) {
        symmetry(decoder, value, planar, &mut found);
    }
    for entry in entries(decoder, table.take("poses")) {
        if let Some(pose) = pose(decoder, entry.value) {
            found.push(Stated::Pose((entry.key, entry.key_span), pose));
        }
    }
    found
}

fn entries<'t>(
    decoder: &mut Decoder<'_>,
    value: Option<Value<'t>>,
) -> Vec<super::decode::Entry<'t>> {
    value
        .and_then(|value| decoder.table(value))
        .map(Table::into_entries)
        .unwrap_or_default()
}

fn members<'t>(decoder: &mut Decoder<'_>, value: Option<Value<'t>>) -> Vec<Value<'t>> {
    value
        .and_then(|value| decoder.list(value))
        .unwrap_or_default()
}

/// All coordinates `[x, y, z]`, or some of them or ranges, `{ z = [1, 2] }`.
fn coordinates(
    decoder: &mut Decoder<'_>,
    value: Value<'_>,
    planar: bool,
) -> Option<[Option<Interval>; 3]> {
    let mut at = [None; 3];
    if let DeValue::Table(_) = value.get_ref() {
        let mut table = decoder.table(value)?;
        for (key, coordinate) in ["x", "y", "z"].into_iter().zip(&mut at) {
            if let Some(value) = table.take(key) {
                *coordinate = range(decoder, value);
            }
        }
        decoder.finish(table);
        if at == [None; 3] {
            let hint = "for example { z = 0.5 }".to_string();
            decoder.error(value.span(), "no coordinate is stated", hint);
        }
    } else {
        at = decoder
            .vector(value, planar)?
            .map(|value| Some(Interval::constant(value)));
    }
    if at
        .iter()
        .flatten()
        .any(|x| x.lo.is_nan() || x.lo == f64::INFINITY)
    {
        decoder.error(value.span(), "a position is made of finite numbers", None);
    }
    if planar && at[2].is_some_and(|z| z != Interval::constant(0.0)) {
        let message = "the structure is planar, so that z is 0";
        decoder.error(value.span(), message, None);
    }
    if planar {
        at[2] = None;
    }
    Some(at)
}

fn point<'t>(decoder: &mut Decoder<'_>, value: Value<'t>, planar: bool) -> Option<Stated<'t>> {
    let mut table = decoder.table(value)?;
    let of = table.take("of");
    let at = table.take("at");
    let weights = table.take("weights");
    decoder.finish(table);
    let (Some(of), Some(at)) = (of, at) else {
        let hint = "{ of = [\"a\", \"b\"], at = [x, y, z] }".to_string();
        decoder.error(value.span(), "`of` and `at` are expected here", hint);
        return None;
    };
    let names = decoder.names(of)?;
    if names.is_empty() {
        decoder.error(of.span(), "the point names no node", None);
        return None;
    }
    let weights = match weights {
        None => vec![1.0 / names.len() as f64; names.len()],
        Some(value) => {
            let weights = decoder.number_list(value)?;
            let sum: f64 = weights.iter().sum();
            if weights.len() != names.len() || !(sum.is_finite() && sum != 0.0) {
                let message = "a weight for each node is expected here, with a sum that is not 0";
                decoder.error(value.span(), message, None);
                return None;
            }
            weights.into_iter().map(|weight| weight / sum).collect()
        }
    };
    Some(Stated::Point {
        of: names.into_iter().zip(weights).collect(),
        at: coordinates(decoder, at, planar)?,
    })
}

fn distance<'t>(decoder: &mut Decoder<'_>, value: Value<'t>) -> Option<Stated<'t>> {
    let mut table = decoder.table(value)?;
    let nodes = table.take("nodes");
    let stated = table.take("range");
    decoder.finish(table);
    let (Some(nodes), Some(stated)) = (nodes, stated) else {
        let hint = "{ nodes = [\"a\", \"b\"], range = [shortest, longest] }".to_string();
        decoder.error(value.span(), "`nodes` and `range` are expected here", hint);
        return None;
    };
    let names: Result<[Name<'t>; 2], _> = decoder.names(nodes)?.try_into();
    let Ok(names) = names else {
        decoder.error(nodes.span(), "two nodes are expected here", None);
        return None;
    };
    Some(Stated::Distance(names, range(decoder, stated)?))
}

/// A constant or a range that is not empty.
fn range(decoder: &mut Decoder<'_>, value: Value<'_>) -> Option<Interval> {
    let range = decoder.interval(value)?;
    let sound = range.lo <= range.hi && range.lo < f64::INFINITY && range.hi > f64::NEG_INFINITY;
    if !sound {
        let hint = "the smaller end comes first".to_string();
        decoder.error(value.span(), "this range holds no number", hint);
    }
    sound.then_some(range)
}

fn symmetry<'t>(
    decoder: &mut Decoder<'_>,
    value: Value<'t>,
    planar: bool,
    found: &mut Vec<Stated<'t>>,
) {
    let Some(mut table) = decoder.table(value) else {
        return;
    };
    let turn = table.take("turn");
    let mirror = table.take("mirror");
    let through = table
        .take("through")
        .and_then(|value| decoder.vector(value, planar))
        .map_or_else(Vector3::zeros, Vector3::from);
    let nodes = table.take("nodes");
    decoder.finish(table);
    let linear = match (turn, mirror) {
        (Some(turn), None) => {
            let rotation = decoder.within(turn, |reader, scope| transform(reader, scope, false));
            rotation.map(|motion| motion.rotation.to_rotation_matrix().into_inner())
        }
        (None, Some(mirror)) => decoder.vector(mirror, planar).and_then(|normal| {
            let normal = Vector3::from(normal).try_normalize(f64::MIN_POSITIVE);
            if normal.is_none() {
                decoder.error(mirror.span(), "the normal of the mirror is zero", None);
            }
            normal.map(|n| Matrix3::identity() - 2.0 * n * n.transpose())
        }),
        _ => {
            let hint = "turn = \"Rz(2*pi/3)\", or mirror = [nx, ny, nz]".to_string();
            let message = "either `turn` or `mirror` is expected here";
            decoder.error(value.span(), message, hint);
            None
        }
    };
    let Some(nodes) = nodes else {
        let hint = "nodes = [[\"a\", \"b\", \"c\"]]: b is the image of a, c of b".to_string();
        decoder.error(value.span(), "`nodes` is expected here", hint);
        return;
    };
    for list in members(decoder, Some(nodes)) {
        let names = decoder.names(list).unwrap_or_default();
        if names.is_empty() {
            decoder.error(list.span(), "a list of nodes is expected here", None);
        }
        let pairs: Vec<[Name<'t>; 2]> = match &names[..] {
            [alone] => vec![[alone.clone(), alone.clone()]],
            _ => names
                .windows(2)
                .map(|pair| [pair[0].clone(), pair[1].clone()])
                .collect(),
        };
        if let Some(linear) = linear {
            found.extend(pairs.into_iter().map(|nodes| Stated::Image {
                nodes,
                linear,
                translation: through - linear * through,
            }));
        }
    }
}

fn pose(decoder: &mut Decoder<'_>, value: Value<'_>) -> Option<Isometry3<f64>> {
    let mut table = decoder.table(value)?;
    let position = table.take("position");
    let rotation = table.take("rotation");
    decoder.finish(table);
    let Some(position) = position else {
        let hint = "{ position = [x, y, z], rotation = \"Rz(pi/3)\" }".to_string();
        decoder.error(value.span(), "`position` is expected here", hint);
        return None;
    };
    let position = decoder.point(position, false)?;
    let rotation = match rotation {
        None => Rotation3::identity(),
        Some(value) => {
            let turn = decoder.within(value, |reader, scope| transform(reader, scope, false));
            turn?.rotation.to_rotation_matrix()
        }
    };
    Some(Isometry3::from_parts(
        Translation3::from(position.coords),
        rotation.into(),
    ))
}

/// Resolves the names of the settings.
pub(crate) fn resolve_settings(
    decoder: &mut Decoder<'_>,
    stated: StatedSettings<'_>,
    structure: &Structure,
) -> FormSettings {
    FormSettings {
        conditions: resolve(decoder, stated.conditions, structure),
        ..stated.settings
    }
}

/// Resolves the names of conditions.
pub(crate) fn resolve(
    decoder: &mut Decoder<'_>,
    stated: Vec<Stated<'_>>,
    structure: &Structure,
) -> Vec<FormCondition> {
    fn indices<'n>(names: impl Iterator<Item = &'n String>) -> HashMap<&'n str, usize> {
        names
            .enumerate()
            .map(|(index, name)| (name.as_str(), index))
            .collect()
    }
    let nodes = indices(structure.nodes.iter().map(|node| &node.name));
    let elements = indices(structure.elements.iter().map(|element| &element.name));
    let attachments = indices(structure.attachments.iter().map(|a| &a.name));
    let find = |decoder: &mut Decoder<'_>,
                what: &str,
                known: &HashMap<&str, usize>,
                (name, span): Name<'_>| {
        let index = known.get(name).copied();
        if index.is_none() {
            unknown(decoder, what, name, span, known.keys().copied());
        }
        index
    };
    let mut conditions = Vec::new();
    for condition in stated {
        match condition {
            Stated::Point { of, at } => {
                let count = of.len();
                let of: Vec<(usize, f64)> = of
                    .into_iter()
                    .filter_map(|(name, weight)| {
                        Some((find(decoder, "node", &nodes, name)?, weight))
                    })
                    .collect();
                if of.len() == count {
                    conditions.push(FormCondition::Point { of, at });
                }
            }
            Stated::Distance(names, range) => {
                let found = names.map(|name| find(decoder, "node", &nodes, name));
                if let [Some(a), Some(b)] = found {
                    let nodes = [a, b];
                    conditions.push(FormCondition::Distance { nodes, range });
                }
            }
            Stated::Element(quantity, (name, span), range) => {
                let Some(element) = find(decoder, "element", &elements, (name, span.clone()))
                else {
                    continue;
                };
                let has = &structure.elements[element];
                let (missing, condition) = match quantity {
                    Quantity::Length => (None, FormCondition::Length { element, range }),
                    Quantity::RestLength => (
                        has.rest().is_none().then_some("has no rest length"),
                        FormCondition::RestLength { element, range },
                    ),
                    Quantity::Force => (
                        (!has.carries_force()).then_some("carries no force"),
                        FormCondition::Force { element, range },
                    ),
                };
                match missing {
                    Some(missing) => decoder.error(span, format!("`{name}` {missing}"), None),
                    None => conditions.push(condition),
                }
            }
            Stated::EqualLengths(names) => {
                let found = names.map(|name| find(decoder, "element", &elements, name));
                if let [Some(a), Some(b)] = found {
                    conditions.push(FormCondition::EqualLengths { elements: [a, b] });
                }
            }
            Stated::Image {
                nodes: names,
                linear,
                translation,
            } => {
                let found = names.map(|name| find(decoder, "node", &nodes, name));
                if let [Some(a), Some(b)] = found {
                    conditions.push(FormCondition::Image {
                        nodes: [a, b],
                        linear,
                        translation,
                    });
                }
            }
            Stated::Pose(name, pose) => {
                if let Some(index) = find(decoder, "attachment", &attachments, name) {
                    let anchors = &structure.attachments[index].anchors;
                    conditions.extend(anchors.iter().map(|anchor| {
                        let place: Point3<f64> = pose * anchor.local;
                        FormCondition::Point {
                            of: vec![(anchor.node, 1.0)],
                            at: [place.x, place.y, place.z].map(|x| Some(Interval::constant(x))),
                        }
                    }));
                }
            }
        }
    }
    conditions
}
