//! Whether a path fits the structure it belongs to: checked before anything is
//! written from it, so that no writer has to.

use tensegra_model::{Configuration, Path, Structure};

/// How a path does not fit its structure.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PathMismatch {
    /// The path is empty.
    #[error("the path has no configuration; there is nothing to write")]
    Empty,
    /// A configuration has not one value for each node or element.
    #[error(
        "configuration {configuration} has {found} {quantity}, but there are {expected} {owners}"
    )]
    Count {
        /// Index of the configuration.
        configuration: usize,
        /// Which list.
        quantity: &'static str,
        /// Its length.
        found: usize,
        /// The number of nodes or elements.
        expected: usize,
        /// `nodes` or `elements`.
        owners: &'static str,
    },
    /// A number is infinite or no number.
    #[error("configuration {configuration}: {quantity} is {value}, not a finite number")]
    NotFinite {
        /// Index of the configuration.
        configuration: usize,
        /// Which quantity of which node or element.
        quantity: String,
        /// Its value.
        value: f64,
    },
}

/// Checks `path` against the names of the nodes and elements.
pub(crate) fn check_path(
    path: &Path,
    nodes: &[&str],
    elements: &[&str],
) -> Result<(), PathMismatch> {
    if path.configurations.is_empty() {
        return Err(PathMismatch::Empty);
    }
    for (index, configuration) in path.configurations.iter().enumerate() {
        check_configuration(configuration, index, nodes, elements)?;
    }
    Ok(())
}

/// Checks `path` against a structure.
pub(crate) fn check_path_of(structure: &Structure, path: &Path) -> Result<(), PathMismatch> {
    let [nodes, elements] = names(structure);
    check_path(path, &nodes, &elements)
}

/// Checks one configuration against a structure.
pub(crate) fn check_configuration_of(
    structure: &Structure,
    configuration: &Configuration,
) -> Result<(), PathMismatch> {
    let [nodes, elements] = names(structure);
    check_configuration(configuration, 0, &nodes, &elements)
}

fn names(structure: &Structure) -> [Vec<&str>; 2] {
    let nodes = structure.nodes.iter().map(|node| node.name.as_str());
    let elements = structure.elements.iter();
    let elements = elements.map(|element| element.name.as_str());
    [nodes.collect(), elements.collect()]
}

/// Checks that the lists of a configuration are as long as they must be.
pub(crate) fn check_counts(
    configuration: &Configuration,
    index: usize,
    nodes: usize,
    elements: usize,
) -> Result<(), PathMismatch> {
    let lists = [
        ("positions", configuration.positions.len(), nodes, "nodes"),
        ("lengths", configuration.lengths.len(), elements, "elements"),
        (
            "rest_lengths",
            configuration.rest_lengths.len(),
            elements,
            "elements",
        ),
        ("forces", configuration.forces.len(), elements, "elements"),
    ];
    for (quantity, found, expected, owners) in lists {
        if found != expected {
            return Err(PathMismatch::Count {
                configuration: index,
                quantity,
                found,
                expected,
                owners,
            });
        }
    }
    Ok(())
}

fn check_configuration(
    configuration: &Configuration,
    index: usize,
    nodes: &[&str],
    elements: &[&str],
) -> Result<(), PathMismatch> {
    check_counts(configuration, index, nodes.len(), elements.len())?;
    let not_finite = |quantity: String, value: f64| PathMismatch::NotFinite {
        configuration: index,
        quantity,
        value,
    };
    for (name, position) in nodes.iter().zip(&configuration.positions) {
        if let Some(&value) = position.iter().find(|value| !value.is_finite()) {
            return Err(not_finite(format!("the position of node `{name}`"), value));
        }
    }
    for (e, name) in elements.iter().enumerate() {
        for (what, value) in [
            ("length", Some(configuration.lengths[e])),
            ("rest length", configuration.rest_lengths[e]),
            ("force", configuration.forces[e]),
        ] {
            if let Some(value) = value.filter(|value| !value.is_finite()) {
                return Err(not_finite(format!("the {what} of element `{name}`"), value));
            }
        }
    }
    Ok(())
}
