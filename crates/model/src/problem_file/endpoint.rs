//! The tables `[start]` and `[goal]` of a problem file.

use std::{collections::HashMap, path::Path};

use nalgebra::Point3;

use super::{
    decode::{Decoder, Value},
    formfind,
};
use crate::{
    declarations::Span,
    diagnostic::{SourceFile, did_you_mean, list_names},
    files,
    problem::Endpoint,
    structure::Structure,
    tens,
};

/// A start or goal as stated, before its names are resolved.
pub(crate) enum Stated<'t> {
    /// Positions, forces and rest lengths by name.
    Values {
        span: Span,
        nodes: Vec<(&'t str, Span, Point3<f64>)>,
        forces: Vec<(&'t str, Span, f64)>,
        rest_lengths: Vec<(&'t str, Span, f64)>,
    },
    /// A row of a `.links` file.
    Row {
        file: &'t str,
        row: usize,
        row_span: Span,
    },
    /// Conditions of a form to be found.
    Form(Vec<formfind::Stated<'t>>),
}

/// Decodes the value of `start` or `goal`. Nothing if an error was found.
pub(crate) fn decode<'t>(
    decoder: &mut Decoder<'_>,
    value: Value<'t>,
    planar: bool,
) -> Option<Stated<'t>> {
    let mut table = decoder.table(value)?;
    if let Some(formfind) = table.take("formfind") {
        let conditions = formfind::decode_conditions(decoder, formfind, planar);
        decoder.finish(table);
        return conditions.map(Stated::Form);
    }
    if let Some(links) = table.take("links") {
        let file = decoder.text(links, "the name of a `.links` file");
        let mut row_span = links.span();
        let row = match table.take("row") {
            Some(value) => {
                row_span = value.span();
                decoder.whole(value, 1..1_000_000)
            }
            None => {
                let hint = "row = 1 is the first row".to_string();
                decoder.error(table.span.clone(), "the row is missing", hint);
                None
            }
        };
        decoder.finish(table);
        // In range by the test above.
        let row = row? as usize;
        let file = file?;
        return Some(Stated::Row {
            file,
            row,
            row_span,
        });
    }
    let Some(nodes) = table.take("nodes") else {
        let message = "neither `nodes` nor `links` is stated";
        let hint = "nodes = { n1 = [x, y, z], … } or links = \"file.links\", row = 1".to_string();
        decoder.error(table.span.clone(), message, hint);
        return None;
    };
    let nodes = decoder.table(nodes).map(|table| {
        let entries = table.into_entries().into_iter();
        entries
            .filter_map(|entry| {
                let position = decoder.point(entry.value, planar)?;
                let bad = position.iter().any(|x| !x.is_finite());
                if bad || (planar && position.z != 0.0) {
                    let message = if bad {
                        "a position is made of finite numbers"
                    } else {
                        "the structure is planar, so that z is 0"
                    };
                    decoder.error(entry.value.span(), message, None);
                }
                Some((entry.key, entry.key_span, position))
            })
            .collect()
    });
    let mut numbers = |key| -> Vec<(&'t str, Span, f64)> {
        let Some(table) = table.take(key).and_then(|value| decoder.table(value)) else {
            return Vec::new();
        };
        let entries = table.into_entries().into_iter();
        entries
            .filter_map(|entry| {
                let number = decoder.number_if(entry.value, "a finite number", |_| true)?;
                Some((entry.key, entry.key_span, number))
            })
            .collect()
    };
    let forces = numbers("forces");
    let rest_lengths = numbers("rest_lengths");
    let span = table.span.clone();
    decoder.finish(table);
    Some(Stated::Values {
        span,
        nodes: nodes?,
        forces,
        rest_lengths,
    })
}

/// Resolves the names of an endpoint, or reads its row. Nothing if an error was
/// found.
pub(crate) fn resolve(
    decoder: &mut Decoder<'_>,
    stated: Stated<'_>,
    structure: &Structure,
    folder: &Path,
    read: &mut Vec<SourceFile>,
) -> Option<Endpoint> {
    match stated {
        Stated::Form(_) => None,
        Stated::Row {
            file,
            row,
            row_span,
        } => {
            let path = folder.join(file);
            let known = read.iter().find(|source| source.path() == path).cloned();
            let source = match known {
                Some(source) => source,
                None => {
                    let source = files::read_text(&path, decoder.findings)?;
                    read.push(source.clone());
                    source
                }
            };
            let errors = decoder.findings.error_count();
            let endpoint = tens::read_row(&source, row, structure, decoder.findings);
            if endpoint.is_none() && decoder.findings.error_count() == errors {
                decoder.error(row_span, format!("`{file}` has no row {row}"), None);
            }
            endpoint
        }
        Stated::Values {
            span,
            nodes,
            forces,
            rest_lengths,
        } => {
            let mut positions = fixed_positions(structure);
            let indices: HashMap<&str, usize> = structure
                .nodes
                .iter()
                .enumerate()
                .map(|(index, node)| (node.name.as_str(), index))
                .collect();
            for (name, span, position) in nodes {
                match indices.get(name) {
                    Some(&index) => positions[index] = Some(position),
                    None => unknown(decoder, "node", name, span, indices.keys().copied()),
                }
            }
            let elements: HashMap<&str, usize> = structure
                .elements
                .iter()
                .enumerate()
                .map(|(index, element)| (element.name.as_str(), index))
                .collect();
            let count = structure.elements.len();
            let (mut stated_forces, mut stated_rest) = (vec![None; count], vec![None; count]);
            for (name, span, force) in forces {
                match elements.get(name) {
                    Some(&index) if structure.elements[index].carries_force() => {
                        stated_forces[index] = Some(force);
                    }
                    Some(_) if force == 0.0 => {}
                    Some(_) => {
                        let message = format!("`{name}` carries no force");
                        decoder.error(span, message, None);
                    }
                    None => unknown(decoder, "element", name, span, elements.keys().copied()),
                }
            }
            for (name, span, rest) in rest_lengths {
                match elements.get(name) {
                    Some(&index) if structure.elements[index].rest().is_some() => {
                        stated_rest[index] = Some(rest);
                    }
                    Some(_) => {
                        let message = format!("`{name}` has no rest length");
                        decoder.error(span, message, None);
                    }
                    None => unknown(decoder, "element", name, span, elements.keys().copied()),
                }
            }
            let missing: Vec<&str> = structure
                .nodes
                .iter()
                .zip(&positions)
                .filter(|(_, position)| position.is_none())
                .map(|(node, _)| node.name.as_str())
                .collect();
            if !missing.is_empty() {
                let message = format!(
                    "there is no position of {}",
                    list_names(missing.iter().copied())
                );
                let hint = "state all nodes except those whose coordinates are all fixed";
                decoder.error(span, message, hint.to_string());
            }
            let positions: Option<Vec<Point3<f64>>> = positions.into_iter().collect();
            Some(Endpoint {
                positions: positions?,
                forces: stated_forces,
                rest_lengths: stated_rest,
            })
        }
    }
}

/// Positions of the nodes that are fixed in all coordinates.
fn fixed_positions(structure: &Structure) -> Vec<Option<Point3<f64>>> {
    let count = structure.nodes.len();
    let mut positions = vec![Point3::origin(); count];
    let mut fixed = vec![0; count];
    for coordinate in &structure.fixed {
        positions[coordinate.node][coordinate.axis] = coordinate.value;
        fixed[coordinate.node] += 1;
    }
    positions
        .into_iter()
        .zip(fixed)
        .map(|(position, fixed)| (fixed == structure.dimension).then_some(position))
        .collect()
}

pub(crate) fn unknown<'n>(
    decoder: &mut Decoder<'_>,
    what: &str,
    name: &str,
    span: Span,
    names: impl Iterator<Item = &'n str>,
) {
    if decoder.findings.is_full() {
        return;
    }
    let hint = did_you_mean(name, names);
    decoder.error(span, format!("there is no {what} `{name}`"), hint);
}
