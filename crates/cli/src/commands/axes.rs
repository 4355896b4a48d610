//! Quantities of a structure by name: the axes of a picture.

use tensegra::{
    io::Quantity,
    model::{ElementKind, Problem, Structure},
    parse_quantity,
};

use crate::failure::Failure;

/// Reads three quantities, such as `length:c1,rest:c2,x:n3`; `c1.length` is the
/// same as `length:c1`.
pub fn parse_axes(text: &str, structure: &Structure) -> Result<[Quantity; 3], Failure> {
    let parts: Vec<&str> = text.split(',').map(str::trim).collect();
    let [a, b, c] = parts[..] else {
        return Err(Failure::Message(format!(
            "--axes needs three quantities, not {}: write them like length:c1,rest:c2,x:n3",
            parts.len()
        )));
    };
    let parse = |part: &str| {
        let swapped = match part.rsplit_once('.') {
            Some((name, kind)) if !part.contains(':') => format!("{kind}:{name}"),
            _ => part.to_owned(),
        };
        parse_quantity(structure, &swapped).map_err(Failure::message)
    };
    Ok([parse(a)?, parse(b)?, parse(c)?])
}

/// The first three cables (or, where there are fewer, elements) whose lengths
/// vary.
pub fn three_lengths(problem: &Problem) -> Option<[Quantity; 3]> {
    let elements = &problem.structure.elements;
    let mut varying: Vec<usize> = (0..elements.len())
        .filter(|&e| !elements[e].has_constant_length())
        .collect();
    varying.sort_by_key(|&e| elements[e].kind != ElementKind::Cable);
    match varying[..] {
        [a, b, c, ..] => Some([a, b, c].map(Quantity::Length)),
        _ => None,
    }
}
