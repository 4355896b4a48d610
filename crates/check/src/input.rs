//! Whether problem and path are of one piece, so that the rest may index freely.

use tensegra_model::{Body, Configuration, Coupling, ForceLaw, Problem};

use crate::report::{Check, Ledger, Location};

/// Numbers beyond this have squares that overflow.
const LARGEST: f64 = 1e150;

fn usable(value: f64) -> bool {
    value.abs() < LARGEST
}

/// Enters what is wrong with the problem; whether it can be judged against.
pub(crate) fn problem(problem: &Problem, ledger: &mut Ledger) -> bool {
    let mut faults = Vec::new();
    collect(problem, &mut faults);
    for fault in &faults {
        ledger.tell(Check::Input, Location::Whole, format!("problem: {fault}"));
    }
    faults.is_empty()
}

fn collect(problem: &Problem, faults: &mut Vec<String>) {
    let structure = &problem.structure;
    let (nodes, elements) = (structure.nodes.len(), structure.elements.len());
    if !matches!(structure.dimension, 2 | 3) {
        faults.push(format!(
            "dimension {}, 2 or 3 expected",
            structure.dimension
        ));
    }
    if nodes == 0 {
        faults.push("the structure has no nodes".to_owned());
    }
    for node in &structure.nodes {
        if !node.load.iter().all(|&load| usable(load)) {
            faults.push(format!("the load of node {} is not finite", node.name));
        }
    }
    for element in &structure.elements {
        let name = &element.name;
        if element.nodes.iter().any(|&node| node >= nodes) || element.nodes[0] == element.nodes[1] {
            faults.push(format!(
                "element {name} does not join two nodes of the structure"
            ));
        }
        if !(usable(element.radius) && element.radius >= 0.0) {
            faults.push(format!("element {name} has the radius {}", element.radius));
        }
        if let ForceLaw::Linear { stiffness, .. } = element.law
            && !usable(stiffness)
        {
            faults.push(format!("element {name} has the stiffness {stiffness}"));
        }
        let ranges = [Some(element.length), Some(element.force), element.rest()];
        if ranges
            .iter()
            .flatten()
            .any(|range| range.lo.is_nan() || range.hi.is_nan())
        {
            faults.push(format!("a range of element {name} is not a number"));
        }
    }
    for coupling in &structure.couplings {
        let (reference, followers): (_, Vec<(usize, f64)>) = match coupling {
            Coupling::Length {
                reference,
                followers,
            }
            | Coupling::Rest {
                reference,
                followers,
            }
            | Coupling::Force {
                reference,
                followers,
            } => (*reference, followers.clone()),
            Coupling::Orientation {
                reference,
                followers,
            } => {
                let sums = followers
                    .iter()
                    .map(|(e, rotation)| (*e, rotation.matrix().sum()));
                (*reference, sums.collect())
            }
        };
        if reference >= elements
            || followers
                .iter()
                .any(|&(e, scale)| e >= elements || !usable(scale))
        {
            faults.push("a coupling names an element that is not there".to_owned());
            continue;
        }
        let members = || {
            followers
                .iter()
                .map(|follower| follower.0)
                .chain([reference])
        };
        let fits = |e: usize| match coupling {
            Coupling::Rest { .. } => structure.elements[e].rest().is_some(),
            Coupling::Force { .. } => structure.elements[e].carries_force(),
            _ => true,
        };
        if let Some(e) = members().find(|&e| !fits(e)) {
            let name = &structure.elements[e].name;
            faults.push(format!(
                "a coupling asks element {name} for a value it does not have"
            ));
        }
    }
    for attachment in &structure.attachments {
        let name = &attachment.name;
        let anchors = &attachment.anchors;
        if anchors.iter().any(|anchor| anchor.node >= nodes) {
            faults.push(format!(
                "attachment {name} is glued to a node that is not there"
            ));
        }
        if !anchors
            .iter()
            .all(|anchor| anchor.local.iter().all(|&x| usable(x)))
        {
            faults.push(format!("an anchor of attachment {name} is not finite"));
        }
    }
    for fixed in &structure.fixed {
        if fixed.node >= nodes || fixed.axis > 2 || !usable(fixed.value) {
            faults.push(format!(
                "coordinate {} of node {} cannot be fixed at {}",
                fixed.axis, fixed.node, fixed.value
            ));
        }
    }
    if let Some(range) = structure.base_range
        && range.iter().any(|half| half.is_nan())
    {
        faults.push("the range of the base is not a number".to_owned());
    }
    if let Some(pretension) = structure.pretension
        && !(usable(pretension) && pretension > 0.0)
    {
        faults.push(format!("the pretension is {pretension}"));
    }
    for [a, b] in &problem.environment.pairs {
        let exists = |body: &Body| match *body {
            Body::Element(index) => index < elements,
            Body::Attachment(index) => index < structure.attachments.len(),
            Body::Obstacle(index) => index < problem.environment.obstacles.len(),
        };
        if a == b || !exists(a) || !exists(b) {
            faults.push(format!(
                "the collision pair {a:?} and {b:?} does not name two bodies"
            ));
        }
    }
    for (name, endpoint) in [("start", &problem.start), ("goal", &problem.goal)] {
        let Some(endpoint) = endpoint else { continue };
        if endpoint.positions.len() != nodes {
            faults.push(format!(
                "the {name} has {} positions for {nodes} nodes",
                endpoint.positions.len()
            ));
        }
        for (what, values) in [
            ("forces", &endpoint.forces),
            ("rest lengths", &endpoint.rest_lengths),
        ] {
            if values.len() != elements {
                let given = values.len();
                faults.push(format!(
                    "the {name} has {given} {what} for {elements} elements"
                ));
            }
        }
        let values = endpoint
            .forces
            .iter()
            .chain(&endpoint.rest_lengths)
            .flatten();
        let coordinates = endpoint
            .positions
            .iter()
            .flat_map(|position| position.iter());
        if !values.chain(coordinates).all(|&x| usable(x)) {
            faults.push(format!("the {name} has a number that is not finite"));
        }
    }
}

/// Enters what is wrong with the data of a configuration; whether it can be judged.
pub(crate) fn configuration(
    problem: &Problem,
    configuration: &Configuration,
    location: Location,
    ledger: &mut Ledger,
) -> bool {
    let (nodes, elements) = (
        problem.structure.nodes.len(),
        problem.structure.elements.len(),
    );
    let Configuration {
        positions,
        lengths,
        rest_lengths,
        forces,
    } = configuration;
    let mut good = true;
    for (what, found, expected) in [
        ("positions", positions.len(), nodes),
        ("lengths", lengths.len(), elements),
        ("rest lengths", rest_lengths.len(), elements),
        ("forces", forces.len(), elements),
    ] {
        if found != expected {
            let message = format!("{location}: {found} {what}, {expected} expected");
            ledger.tell(Check::Input, location, message);
            good = false;
        }
    }
    if !good {
        return false;
    }
    for (node, position) in problem.structure.nodes.iter().zip(positions) {
        if !position.iter().all(|&x| usable(x)) {
            let [x, y, z] = [position.x, position.y, position.z];
            let message = format!("{location}: node {} is at ({x:e}, {y:e}, {z:e})", node.name);
            ledger.tell(Check::Finite, location, message);
            good = false;
        }
    }
    for (index, element) in problem.structure.elements.iter().enumerate() {
        let name = &element.name;
        let linear = element.rest().is_some();
        for (what, value, needed) in [
            ("length", Some(lengths[index]), true),
            (
                "rest length",
                rest_lengths[index].filter(|_| linear),
                linear,
            ),
            ("force", forces[index], element.carries_force()),
        ] {
            let fault = match value {
                None if needed => (Check::Input, format!("has no {what}")),
                Some(value) if !usable(value) => {
                    (Check::Finite, format!("has the {what} {value:.3e}"))
                }
                Some(value) if !needed && value != 0.0 => (
                    Check::Input,
                    format!("has the {what} {value:.3e} but can have none"),
                ),
                _ => continue,
            };
            let (check, fault) = fault;
            ledger.tell(
                check,
                location,
                format!("{location}: element {name} {fault}"),
            );
            good = false;
        }
    }
    good
}
