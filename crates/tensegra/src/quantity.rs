//! Quantities of a configuration by name, and what an atlas is coloured by.

use tensegra_io::{Axis, Quantity, Units};
use tensegra_model::{Configuration, ForceLaw, Structure};

/// A text that names no quantity.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("`{text}` names no quantity: {reason}")]
pub struct QuantityError {
    /// The text.
    pub text: String,
    /// What is wrong with it.
    pub reason: String,
}

/// Reads the name of a quantity: `length:c1`, `rest:c1` or `force:c1` of an
/// element, `x:n1`, `y:n1` or `z:n1` of a node.
///
/// # Errors
/// [`QuantityError`] that says what may be written.
pub fn parse_quantity(structure: &Structure, text: &str) -> Result<Quantity, QuantityError> {
    let wrong = |reason: String| QuantityError {
        text: text.to_owned(),
        reason,
    };
    let (kind, name) = text.split_once(':').ok_or_else(|| {
        wrong("write length:ELEMENT, rest:ELEMENT, force:ELEMENT or z:NODE".into())
    })?;
    let axis = ["x", "y", "z"].iter().position(|axis| *axis == kind);
    if let Some(axis) = axis {
        let node = structure.nodes.iter().position(|node| node.name == name);
        let node = node.ok_or_else(|| wrong(format!("there is no node {name}")))?;
        return Ok(Quantity::Coordinate { node, axis });
    }
    if !["length", "rest", "force"].contains(&kind) {
        return Err(wrong(
            "the kinds are length, rest, force, x, y and z".to_owned(),
        ));
    }
    let element = structure.elements.iter().position(|e| e.name == name);
    let element = element.ok_or_else(|| wrong(format!("there is no element {name}")))?;
    let of = &structure.elements[element];
    match kind {
        "length" => Ok(Quantity::Length(element)),
        "rest" if of.rest().is_some() => Ok(Quantity::RestLength(element)),
        "rest" => Err(wrong(format!("{name} has no rest length"))),
        "force" if of.carries_force() => Ok(Quantity::Force(element)),
        _ => Err(wrong(format!("{name} carries no force"))),
    }
}

/// What a picture of an atlas is coloured by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Shade {
    /// A quantity of an element or node.
    Quantity(Quantity),
    /// The compression of an element: its force, the sign changed.
    Compression(usize),
    /// The elastic energy of all elements with a linear law.
    Energy,
}

impl Shade {
    /// Reads `energy`, `compression:s1`, or the name of a quantity (see
    /// [`parse_quantity`]).
    ///
    /// # Errors
    /// [`QuantityError`] that says what may be written.
    pub fn parse(structure: &Structure, text: &str) -> Result<Self, QuantityError> {
        if text == "energy" {
            return Ok(Self::Energy);
        }
        let Some(name) = text.strip_prefix("compression:") else {
            return parse_quantity(structure, text).map(Self::Quantity);
        };
        match parse_quantity(structure, &format!("force:{name}")) {
            Ok(Quantity::Force(element)) => Ok(Self::Compression(element)),
            Ok(_) => Err(QuantityError {
                text: text.to_owned(),
                reason: format!("{name} carries no force"),
            }),
            Err(error) => Err(QuantityError {
                text: text.to_owned(),
                ..error
            }),
        }
    }

    /// The compression of the first element that can only be compressed, else the
    /// energy.
    pub fn usual(structure: &Structure) -> Self {
        let strut = structure
            .elements
            .iter()
            .position(|e| e.carries_force() && e.force.hi <= 0.0 && !e.force.is_constant());
        strut.map_or(Self::Energy, Self::Compression)
    }

    /// The value in a configuration; none where there is no such quantity.
    pub fn value(self, structure: &Structure, configuration: &Configuration) -> Option<f64> {
        match self {
            Self::Quantity(quantity) => quantity.value(configuration),
            Self::Compression(element) => Quantity::Force(element).value(configuration).map(|f| -f),
            Self::Energy => {
                let elements = structure.elements.iter().zip(&configuration.forces);
                Some(
                    elements
                        .filter_map(|(element, force)| match element.law {
                            ForceLaw::Linear { stiffness, .. } => {
                                Some(force.as_ref()?.powi(2) / (2.0 * stiffness))
                            }
                            _ => None,
                        })
                        .sum(),
                )
            }
        }
    }

    /// An axis for the values.
    pub fn axis(self, structure: &Structure, units: &Units) -> Axis {
        match self {
            Self::Quantity(quantity) => quantity.axis(structure, units),
            Self::Compression(element) => {
                let name = &structure.elements[element].name;
                Axis::new(format!("compression of {name}")).unit(&units.force)
            }
            Self::Energy => {
                Axis::new("elastic energy").unit(format!("{} × {}", units.force, units.length))
            }
        }
    }
}

/// Three quantities that tell configurations apart: lengths of elements first,
/// then rest lengths, forces and coordinates, without those that are constant or
/// vary like one before. Fewer than three only where there are no more.
pub fn three_quantities(
    structure: &Structure,
    configurations: &[Configuration],
) -> Option<[Quantity; 3]> {
    const SAME: f64 = 1e-6;
    let elements = 0..structure.elements.len();
    let nodes = 0..structure.nodes.len();
    let coordinates =
        nodes.flat_map(|node| [2, 0, 1].map(move |axis| Quantity::Coordinate { node, axis }));
    let candidates = elements
        .clone()
        .map(Quantity::Length)
        .chain(elements.clone().map(Quantity::RestLength))
        .chain(elements.map(Quantity::Force))
        .chain(coordinates);
    let mut chosen: Vec<(Quantity, Vec<f64>)> = Vec::new();
    for quantity in candidates {
        let values: Option<Vec<f64>> = configurations.iter().map(|c| quantity.value(c)).collect();
        let Some(values) = values else { continue };
        let (lo, hi) = values
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), &v| {
                (lo.min(v), hi.max(v))
            });
        let scale = SAME * hi.abs().max(lo.abs());
        let like = |other: &Vec<f64>| {
            let pairs = values.iter().zip(other);
            pairs.into_iter().all(|(a, b)| (a - b).abs() <= scale)
        };
        if hi - lo > scale && !chosen.iter().any(|(_, other)| like(other)) {
            chosen.push((quantity, values));
        }
        if chosen.len() == 3 {
            break;
        }
    }
    let chosen: Vec<Quantity> = chosen.into_iter().map(|(quantity, _)| quantity).collect();
    chosen.try_into().ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use tensegra_model::StructureBuilder;

    fn structure() -> Structure {
        StructureBuilder::planar()
            .strut("s", ["foot", "tip"], 1.0)
            .cable("c", ["tip", "wall"], 0.1..=3.0, 10.0, 0.0..=2.0)
            .build()
            .unwrap()
    }

    #[test]
    fn quantities_have_names() {
        let structure = structure();
        let parse = |text| parse_quantity(&structure, text);
        assert_eq!(parse("length:c"), Ok(Quantity::Length(1)));
        assert_eq!(parse("rest:c"), Ok(Quantity::RestLength(1)));
        assert_eq!(parse("force:s"), Ok(Quantity::Force(0)));
        assert_eq!(
            parse("y:tip"),
            Ok(Quantity::Coordinate { node: 1, axis: 1 })
        );
        for (text, reason) in [
            ("c", "write length:ELEMENT"),
            ("rest:s", "no rest length"),
            ("length:d", "no element d"),
            ("z:d", "no node d"),
            ("mass:n", "the kinds are"),
        ] {
            let error = parse(text).unwrap_err().to_string();
            assert!(error.contains(reason) && error.contains(text), "{error}");
        }
    }

    #[test]
    fn shades_are_energies_and_compressions_too() {
        let structure = structure();
        let configuration = Configuration {
            positions: vec![Default::default(); 3],
            lengths: vec![1.0, 1.3],
            rest_lengths: vec![None, Some(1.1)],
            forces: vec![Some(-3.0), Some(2.0)],
        };
        let value = |text| {
            let shade = Shade::parse(&structure, text).unwrap();
            shade.value(&structure, &configuration).unwrap()
        };
        assert_eq!(value("compression:s"), 3.0);
        // k (l − r)² / 2 = 10 · 0.2² / 2.
        assert!((value("energy") - 0.2).abs() < 1e-15);
        assert_eq!(value("length:c"), 1.3);
        assert_eq!(Shade::usual(&structure), Shade::Compression(0));
        assert!(Shade::parse(&structure, "compression:x").is_err());
    }
}
