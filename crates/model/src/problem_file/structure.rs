//! The table `[structure]` of a problem file.

use std::{collections::HashMap, path::Path};

use nalgebra::{Rotation3, Vector3};
use toml::de::DeValue;

use super::{
    TensFile,
    decode::{Decoder, Entry, Table, Value},
    environment::{attached_shape, color, role},
    load_tens,
};
use crate::{
    builder::{AttachmentSpec, CouplingSpec, ElementSpec, Followers, StructureBuilder},
    declarations::{AttachmentSpans, Declarations, ElementSpans, Span},
    diagnostic::did_you_mean,
    environment::Role,
    files::{self, Meshes},
    structure::{Appearance, ElementKind, Interval},
    tens::transform,
    validate::ElementPart,
};

/// Where the structure of a problem comes from.
pub(crate) enum Source {
    /// The problem file itself.
    Inline(Box<Declarations>),
    /// A `.tens` file.
    Tens(Box<TensFile>),
}

impl Source {
    /// Whether the structure is planar.
    pub(crate) fn is_planar(&self) -> bool {
        let declarations = match self {
            Self::Inline(declarations) => declarations,
            Self::Tens(tens) => &tens.declarations,
        };
        declarations.structure.dimension == 2
    }
}

/// Decodes the value of `structure`. Nothing if an error was found that leaves no
/// structure to go on with.
pub(crate) fn decode(decoder: &mut Decoder<'_>, value: Value<'_>, folder: &Path) -> Option<Source> {
    if let DeValue::String(name) = value.get_ref() {
        return tens(decoder, folder, name, None);
    }
    let mut table = decoder.table(value)?;
    let Some(file) = table.take("file") else {
        return Some(Source::Inline(Box::new(inline(decoder, table, folder))));
    };
    let name = decoder.text(file, "the name of a `.tens` file");
    let param = table
        .take("parameters")
        .and_then(|value| decoder.text(value, "the name of a `.param` file"));
    decoder.finish(table);
    tens(decoder, folder, name?, param)
}

fn tens(
    decoder: &mut Decoder<'_>,
    folder: &Path,
    name: &str,
    param: Option<&str>,
) -> Option<Source> {
    let file = files::read_text(&folder.join(name), decoder.findings)?;
    let param = param.map(|param| folder.join(param));
    let tens = load_tens(file, param.as_deref(), decoder.findings)?;
    Some(Source::Tens(Box::new(tens)))
}

fn inline(decoder: &mut Decoder<'_>, mut table: Table<'_>, folder: &Path) -> Declarations {
    let planar = table
        .take("planar")
        .and_then(|value| decoder.flag(value))
        .unwrap_or(false);
    let mut declarations = Declarations::new();
    declarations.spans.structure = table.span.clone();
    let mut builder = if planar {
        StructureBuilder::planar()
    } else {
        StructureBuilder::spatial()
    };
    if let Some(value) = table.take("free_flying") {
        declarations.spans.base_range = value.span();
        if let Some(range) = decoder.vector(value, planar) {
            builder = builder.free_flying(range);
        }
    }
    if let Some(value) = table.take("pretension") {
        declarations.spans.pretension = Some(value.span());
        if let Some(pretension) = decoder.number(value) {
            builder = builder.pretension((pretension != 0.0).then_some(pretension));
        }
    }
    declarations.structure = builder;

    let types = match table.take("types") {
        Some(value) => types(decoder, value),
        None => HashMap::new(),
    };
    if let Some(value) = table.take("elements") {
        elements(decoder, value, &types, &mut declarations);
    }
    if let Some(value) = table.take("fixed") {
        fixed(decoder, value, planar, &mut declarations);
    }
    if let Some(value) = table.take("supports") {
        for (name, span) in decoder.names(value).unwrap_or_default() {
            declarations.structure.supports.push(name.to_string());
            declarations.spans.supports.push(span);
        }
    }
    if let Some(table) = table.take("loads").and_then(|value| decoder.table(value)) {
        for entry in table.into_entries() {
            if let Some(force) = decoder.vector(entry.value, planar) {
                let load = (entry.key.to_string(), Vector3::from(force));
                declarations.structure.loads.push(load);
                declarations.spans.loads.push(entry.key_span);
            }
        }
    }
    if let Some(table) = table.take("masses").and_then(|value| decoder.table(value)) {
        for entry in table.into_entries() {
            if let Some(mass) = decoder.number(entry.value) {
                declarations
                    .structure
                    .masses
                    .push((entry.key.to_string(), mass));
                declarations.spans.masses.push(entry.key_span);
            }
        }
    }
    if let Some(value) = table.take("gravity") {
        declarations.spans.gravity = value.span();
        if let Some(acceleration) = decoder.vector(value, planar) {
            declarations.structure.gravity = Vector3::from(acceleration);
        }
    }
    if let Some(value) = table.take("couplings") {
        for value in decoder.list(value).unwrap_or_default() {
            coupling(decoder, value, &mut declarations);
        }
    }
    if let Some(table) = table
        .take("attachments")
        .and_then(|value| decoder.table(value))
    {
        let mut meshes = Meshes::in_folder(folder);
        for entry in table.into_entries() {
            attachment(decoder, &entry, &mut meshes, &mut declarations);
        }
    }
    decoder.finish(table);
    declarations
}

/// Something stated, and where.
type Stated<T> = Option<(T, Span)>;

/// The properties that an element or a type of elements states.
#[derive(Clone, Debug, Default)]
struct Properties {
    kind: Option<ElementKind>,
    length: Stated<Interval>,
    stiffness: Stated<f64>,
    rest: Stated<Interval>,
    force: Stated<Interval>,
    radius: Stated<f64>,
    color: Option<String>,
    role: Option<Role>,
    loops: Option<u32>,
    granularity: Option<u32>,
    dynamics: Vec<(String, Vec<f64>)>,
}

const KINDS: [(&str, ElementKind); 5] = [
    ("strut", ElementKind::Strut),
    ("bar", ElementKind::Bar),
    ("cable", ElementKind::Cable),
    ("spring", ElementKind::Spring),
    ("prismatic", ElementKind::Prismatic),
];

fn types<'t>(decoder: &mut Decoder<'_>, value: Value<'t>) -> HashMap<&'t str, Properties> {
    let Some(table) = decoder.table(value) else {
        return HashMap::new();
    };
    table
        .into_entries()
        .into_iter()
        .filter_map(|entry| {
            let mut table = decoder.table(entry.value)?;
            let properties = properties(decoder, &mut table);
            decoder.finish(table);
            Some((entry.key, properties))
        })
        .collect()
}

fn properties(decoder: &mut Decoder<'_>, table: &mut Table<'_>) -> Properties {
    let facets = 1..1_000_001;
    let mut interval = |decoder: &mut Decoder<'_>, key| -> Stated<Interval> {
        let value = table.take(key)?;
        Some((decoder.interval(value)?, value.span()))
    };
    let length = interval(decoder, "length");
    let rest = interval(decoder, "rest");
    let force = interval(decoder, "force");
    let mut number = |decoder: &mut Decoder<'_>, key| -> Stated<f64> {
        let value = table.take(key)?;
        Some((decoder.number(value)?, value.span()))
    };
    let stiffness = number(decoder, "stiffness");
    let radius = number(decoder, "radius");
    // In range of u32 by `facets`.
    let mut natural = |decoder: &mut Decoder<'_>, key| {
        let value = table.take(key)?;
        decoder
            .whole(value, facets.clone())
            .map(|number| number as u32)
    };
    let loops = natural(decoder, "loops");
    let granularity = natural(decoder, "granularity");
    Properties {
        kind: table
            .take("kind")
            .and_then(|value| decoder.choice(value, &KINDS)),
        length,
        stiffness,
        rest,
        force,
        radius,
        color: color(decoder, table),
        role: role(decoder, table),
        loops,
        granularity,
        dynamics: table
            .take("dynamics")
            .map_or_else(Vec::new, |value| dynamics(decoder, value)),
    }
}

/// Attributes of a dynamic model: their keywords and how many numbers each has.
const DYNAMICS: [(&str, &str, usize); 9] = [
    ("mass", "mass", 1),
    ("inertial_frame", "inertial frame", 12),
    ("inertia", "inertia", 6),
    ("velocity", "velocity", 1),
    ("acceleration", "acceleration", 1),
    ("effort", "effort", 1),
    ("cost", "cost", 1),
    ("friction", "friction", 1),
    ("damping", "damping", 1),
];

fn dynamics(decoder: &mut Decoder<'_>, value: Value<'_>) -> Vec<(String, Vec<f64>)> {
    let Some(mut table) = decoder.table(value) else {
        return Vec::new();
    };
    let mut dynamics = Vec::new();
    for (key, keyword, count) in DYNAMICS {
        let Some(value) = table.take(key) else {
            continue;
        };
        let numbers = if count == 1 {
            decoder.number(value).map(|number| vec![number])
        } else {
            decoder.number_list(value)
        };
        match numbers {
            Some(numbers) if numbers.len() == count => {
                dynamics.push((keyword.to_string(), numbers));
            }
            Some(_) => {
                let message = format!("{count} numbers are expected here");
                decoder.error(value.span(), message, None);
            }
            None => {}
        }
    }
    decoder.finish(table);
    dynamics
}

fn elements(
    decoder: &mut Decoder<'_>,
    value: Value<'_>,
    types: &HashMap<&str, Properties>,
    declarations: &mut Declarations,
) {
    let Some(table) = decoder.table(value) else {
        return;
    };
    for entry in table.into_entries() {
        if decoder.findings.is_full() {
            return;
        }
        if let Some((spec, spans)) = element(decoder, &entry, types) {
            declarations.structure.elements.push(spec);
            declarations.spans.elements.push(spans);
        }
    }
}

fn element(
    decoder: &mut Decoder<'_>,
    entry: &Entry<'_>,
    types: &HashMap<&str, Properties>,
) -> Option<(ElementSpec, ElementSpans)> {
    let mut table = decoder.table(entry.value)?;
    let inherited = match table.take("type") {
        None => Properties::default(),
        Some(value) => {
            let name = decoder.text(value, "the name of a type")?;
            match types.get(name) {
                Some(properties) => properties.clone(),
                None => {
                    let hint = did_you_mean(name, types.keys().copied()).unwrap_or_else(|| {
                        format!("define it: structure.types.{name} = {{ kind = … }}")
                    });
                    decoder.error(value.span(), format!("there is no type `{name}`"), hint);
                    return None;
                }
            }
        }
    };
    let nodes = table.take("nodes").map(|value| {
        let names = decoder.names(value)?;
        let names: Result<[_; 2], _> = names.try_into();
        if names.is_err() {
            decoder.error(value.span(), "two nodes are expected here", None);
        }
        names.ok().map(|names| (names, value.span()))
    });
    let own = properties(decoder, &mut table);
    decoder.finish(table);
    let missing = |what: &str| format!("element `{}` has no {what}", entry.key);
    let nodes = match nodes {
        Some(nodes) => nodes?,
        None => {
            let hint = "nodes = [\"first\", \"second\"]".to_string();
            decoder.error(entry.key_span.clone(), missing("nodes"), hint);
            return None;
        }
    };
    let Some(kind) = own.kind.or(inherited.kind) else {
        let hint = "kind = \"strut\", \"bar\", \"cable\", \"spring\" or \"prismatic\", or type = …";
        decoder.error(entry.key_span.clone(), missing("kind"), hint.to_string());
        return None;
    };
    let Some(length) = own.length.or(inherited.length) else {
        let hint = "length = 1.0, or length = [shortest, longest]".to_string();
        decoder.error(entry.key_span.clone(), missing("length"), hint);
        return None;
    };
    let mut parts = vec![
        (ElementPart::Nodes, nodes.1),
        (ElementPart::Length, length.1),
    ];
    let ([(first, _), (second, _)], length) = (nodes.0, length.0);
    let mut spec = ElementSpec::new(kind, entry.key, [first, second], length);
    let mut place = |part, span| parts.push((part, span));
    if let Some((stiffness, span)) = own.stiffness.or(inherited.stiffness) {
        spec.stiffness = Some(stiffness);
        place(ElementPart::Stiffness, span);
    }
    if let Some((rest, span)) = own.rest.or(inherited.rest) {
        spec.rest = Some(rest);
        place(ElementPart::Rest, span);
    }
    if let Some((force, span)) = own.force.or(inherited.force) {
        spec.force = Some(force);
        place(ElementPart::Force, span);
    }
    if let Some((radius, span)) = own.radius.or(inherited.radius) {
        spec.radius = Some(radius);
        place(ElementPart::Radius, span);
    }
    spec.appearance = Appearance {
        color: own.color.or(inherited.color),
        role: own.role.or(inherited.role).unwrap_or_default(),
        loops: own.loops.or(inherited.loops),
        granularity: own.granularity.or(inherited.granularity),
    };
    spec.dynamics = if own.dynamics.is_empty() {
        inherited.dynamics
    } else {
        own.dynamics
    };
    let spans = ElementSpans {
        name: entry.key_span.clone(),
        parts,
    };
    Some((spec, spans))
}

fn fixed(
    decoder: &mut Decoder<'_>,
    value: Value<'_>,
    planar: bool,
    declarations: &mut Declarations,
) {
    let Some(table) = decoder.table(value) else {
        return;
    };
    for entry in table.into_entries() {
        let mut fix = |axis: usize, value: f64, span: Span| {
            let coordinate = (entry.key.to_string(), axis, value);
            declarations.structure.fixed.push(coordinate);
            declarations.spans.fixed.push(span);
        };
        let span = entry.key_span.start..entry.value.span().end;
        if let DeValue::Table(_) = entry.value.get_ref() {
            let Some(mut table) = decoder.table(entry.value) else {
                continue;
            };
            for (axis, key) in ["x", "y", "z"].into_iter().enumerate() {
                if let Some(value) = table.take(key)
                    && let Some(number) = decoder.number(value)
                {
                    fix(axis, number, span.clone());
                }
            }
            decoder.finish(table);
        } else if let Some(position) = decoder.vector(entry.value, planar) {
            for (axis, value) in position.into_iter().enumerate() {
                fix(axis, value, span.clone());
            }
        }
    }
}

fn coupling(decoder: &mut Decoder<'_>, value: Value<'_>, declarations: &mut Declarations) {
    const QUANTITIES: [&str; 4] = ["length", "rest", "force", "orientation"];
    let Some(mut table) = decoder.table(value) else {
        return;
    };
    let stated: Vec<(&str, Value<'_>)> = QUANTITIES
        .into_iter()
        .filter_map(|quantity| Some((quantity, table.take(quantity)?)))
        .collect();
    decoder.finish(table);
    let [(quantity, members)] = stated[..] else {
        let message = "one of length, rest, force or orientation is expected here";
        let hint = "for example { force = [\"a\", \"b\"] }".to_string();
        decoder.error(value.span(), message, hint);
        return;
    };
    let Some(members) = decoder.list(members) else {
        return;
    };
    let rotates = quantity == "orientation";
    let count = members.len();
    let read: Vec<(String, f64, Rotation3<f64>, Span)> = members
        .into_iter()
        .filter_map(|member| coupled(decoder, member, rotates))
        .collect();
    if read.len() < count {
        return;
    }
    let mut members = read.into_iter();
    let Some((reference, _, _, span)) = members.next() else {
        decoder.error(value.span(), "the coupling names no element", None);
        return;
    };
    let mut spans = vec![span];
    let (mut scaled, mut rotated) = (Vec::new(), Vec::new());
    for (name, factor, rotation, span) in members {
        spans.push(span);
        if rotates {
            rotated.push((name, rotation));
        } else {
            scaled.push((name, factor));
        }
    }
    let followers = match quantity {
        "length" => Followers::Length(scaled),
        "rest" => Followers::Rest(scaled),
        "force" => Followers::Force(scaled),
        _ => Followers::Orientation(rotated),
    };
    declarations.structure.couplings.push(CouplingSpec {
        reference,
        followers,
    });
    declarations.spans.couplings.push(spans);
}

/// A member of a coupling: a name, or a table with a name and a factor or rotation.
fn coupled(
    decoder: &mut Decoder<'_>,
    value: Value<'_>,
    rotates: bool,
) -> Option<(String, f64, Rotation3<f64>, Span)> {
    let (mut factor, mut rotation) = (1.0, Rotation3::identity());
    let name = match value.get_ref() {
        DeValue::String(name) => name.to_string(),
        _ => {
            let mut table = decoder.table(value)?;
            let name = table.take("element");
            if rotates {
                if let Some(value) = table.take("rotation") {
                    let read =
                        decoder.within(value, |reader, scope| transform(reader, scope, false));
                    rotation = read?.rotation.to_rotation_matrix();
                }
            } else if let Some(value) = table.take("factor") {
                factor = decoder.number(value)?;
            }
            decoder.finish(table);
            let Some(name) = name else {
                let hint = "{ element = \"a\", … }".to_string();
                decoder.error(value.span(), "this member names no element", hint);
                return None;
            };
            decoder.text(name, "the name of an element")?.to_string()
        }
    };
    Some((name, factor, rotation, value.span()))
}

fn attachment(
    decoder: &mut Decoder<'_>,
    entry: &Entry<'_>,
    meshes: &mut Meshes,
    declarations: &mut Declarations,
) {
    let Some(mut table) = decoder.table(entry.value) else {
        return;
    };
    let mut spans = AttachmentSpans {
        name: entry.key_span.clone(),
        ..AttachmentSpans::default()
    };
    let mut shapes = Vec::new();
    if let Some(value) = table.take("shapes") {
        for value in decoder.list(value).unwrap_or_default() {
            let Some(mut shape) = decoder.table(value) else {
                continue;
            };
            let attached = attached_shape(decoder, &mut shape, false, meshes);
            decoder.finish(shape);
            if let Some(attached) = attached {
                shapes.push(attached);
                spans.shapes.push(value.span());
            }
        }
    }
    let anchors = table.take("anchors").and_then(|value| {
        let table = decoder.table(value)?;
        let anchors: Vec<_> = table
            .into_entries()
            .into_iter()
            .filter_map(|anchor| {
                let local = decoder.point(anchor.value, false)?;
                spans.anchors.push(anchor.key_span);
                Some((local, anchor.key.to_string()))
            })
            .collect();
        anchors.try_into().ok()
    });
    decoder.finish(table);
    let Some(anchors) = anchors else {
        let message = format!("attachment `{}` needs three anchors", entry.key);
        let hint = "anchors = { node = [x, y, z], … }".to_string();
        decoder.error(entry.key_span.clone(), message, hint);
        return;
    };
    declarations.structure.attachments.push(AttachmentSpec {
        name: entry.key.to_string(),
        shapes,
        anchors,
    });
    declarations.spans.attachments.push(spans);
}
