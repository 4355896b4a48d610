//! Inverse form-finding: from node positions to rest lengths.
//!
//! At given positions equilibrium is linear in the forces t of the elements, and
//! so are the ranges of forces and rest lengths r = l − t / k:
//! ```text
//! min ½ ‖t − t₀‖²   subject to   A t + p = 0,   couplings,   t_lo ≤ t ≤ t_hi,
//! ```
//! where t₀ is an evenly spread prestress, or the forces that wanted rest lengths
//! give. The equations are solved once, by a singular value decomposition that
//! tells their dependent part; what remains is a quadratic programme in as many
//! variables as there are states of self-stress. A prescribed norm of the forces,
//! the pretension, is met by a few such programmes.
//!
//! That no forces are found is a normal answer: most shapes are no equilibrium.
//! Then the answer says what contradicts what, and by how much at best.
//!
//! Cost: one singular value decomposition of freedoms by elements.

mod balance;

use nalgebra::Point3;
use tensegra_model::{Configuration, Structure, statics::StaticsError};

use balance::Balance;

/// What inverse form-finding aims at.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct InverseOptions {
    /// Forces below this count as balanced, relative to the largest force; what
    /// the positions are known to, roughly. Default 1e-6.
    pub tolerance: f64,
    /// Least tension of every cable and spring, in units of force; 0 admits slack
    /// ones. Default: a thousandth of an evenly spread prestress.
    pub least_tension: Option<f64>,
    /// Rest lengths to stay near, where there are several solutions. Default: none.
    pub wanted_rest_lengths: Vec<Option<f64>>,
}

impl Default for InverseOptions {
    fn default() -> Self {
        Self {
            tolerance: 1e-6,
            least_tension: None,
            wanted_rest_lengths: Vec::new(),
        }
    }
}

/// Rest lengths and forces that hold a structure at given positions.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct InverseForm {
    /// The configuration.
    pub configuration: Configuration,
    /// Dimension of the set of forces that would do, but for ranges.
    pub choices: usize,
    /// Largest unbalanced force at a node, in units of force.
    pub residual: f64,
}

/// Why no rest lengths hold the structure at the given positions.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum InverseError {
    /// Bad input.
    #[error(transparent)]
    Statics(#[from] StaticsError),
    /// An element is as long as it cannot be.
    #[error(
        "`{element}` is {length:.6} long at these positions, outside of its range by \
         {violation:.3e}"
    )]
    Length {
        /// The element.
        element: String,
        /// How long it is.
        length: f64,
        /// How far that is outside of its range.
        violation: f64,
    },
    /// No forces balance, whatever their size and sign.
    #[error(
        "no forces of the elements balance {what} at these positions: at best {force:.3e} is left \
         over at `{node}`, {allowed:.1e} would count as balanced"
    )]
    NoBalance {
        /// "the loads", "the constant springs", or "one another".
        what: &'static str,
        /// The node with the largest unbalanced force.
        node: String,
        /// That force.
        force: f64,
        /// What would be allowed.
        allowed: f64,
    },
    /// The shape cannot be prestressed.
    #[error(
        "the structure cannot be prestressed in this shape: its equilibrium matrix has full rank, \
         the smallest singular value being {smallest:.3e} of the largest where a self-stress needs 0"
    )]
    NoSelfStress {
        /// The smallest singular value, relative to the largest.
        smallest: f64,
    },
    /// Relations of couplings cannot hold together with balance.
    #[error(
        "no balanced forces satisfy the coupling of `{element}`: it is missed by {force:.3e} at \
         best, in units of force"
    )]
    NoCoupling {
        /// The element that follows.
        element: String,
        /// What is left over.
        force: f64,
    },
    /// Forces that balance do not keep their ranges.
    #[error("{}", describe_conflict(.elements, .worst, *.violation))]
    OutOfRange {
        /// Elements whose ranges contradict one another.
        elements: Vec<String>,
        /// The element that misses its range the most when all miss it as little as
        /// can be.
        worst: String,
        /// By how much it does, in units of force.
        violation: f64,
    },
    /// No forces of the prescribed norm keep their ranges.
    #[error(
        "balanced forces within their ranges cannot have the norm {pretension}, the prescribed \
         pretension: {reached:.6} comes closest"
    )]
    Pretension {
        /// The prescribed norm.
        pretension: f64,
        /// The norm that was reached.
        reached: f64,
    },
}

fn describe_conflict(elements: &[String], worst: &str, violation: f64) -> String {
    let names: Vec<String> = elements.iter().map(|name| format!("`{name}`")).collect();
    format!(
        "no prestress keeps {} within {} of force and rest length at once; at best `{worst}` misses \
         by a force of {violation:.3e}",
        names.join(", "),
        if names.len() == 1 {
            "its range"
        } else {
            "their ranges"
        },
    )
}

/// Finds rest lengths and forces with which `positions`, one for each node, are an
/// equilibrium of the structure.
///
/// # Errors
/// [`InverseError`] says what stands against it.
///
/// # Examples
/// Two struts crossed in a square of cables of stiffness 10:
/// ```
/// use nalgebra::Point3;
/// use tensegra_formfinding::{InverseOptions, rest_lengths};
/// use tensegra_model::StructureBuilder;
///
/// let mut builder = StructureBuilder::planar()
///     .strut("s1", ["a", "c"], 2.0)
///     .strut("s2", ["b", "d"], 2.0)
///     .pretension(1.0);
/// for (name, nodes) in [("c1", ["a", "b"]), ("c2", ["b", "c"]), ("c3", ["c", "d"]), ("c4", ["d", "a"])] {
///     builder = builder.cable(name, nodes, 0.0..=3.0, 10.0, 0.0..=2.0);
/// }
/// let structure = builder.build()?;
/// // Nodes in the order in which elements name them: a, c, b, d.
/// let corners = [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]];
/// let positions = corners.map(|[x, y]| Point3::new(x, y, 0.0));
/// let form = rest_lengths(&structure, &positions, &InverseOptions::default())?;
/// let tension = form.configuration.forces[2].unwrap();
/// assert!((tension - 1.0 / 8f64.sqrt()).abs() < 1e-9);
/// assert!((form.configuration.rest_lengths[2].unwrap() - (2f64.sqrt() - tension / 10.0)).abs() < 1e-9);
///
/// let wry = [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.4], [0.3, -0.6]];
/// let wry = wry.map(|[x, y]| Point3::new(x, y, 0.0));
/// assert!(rest_lengths(&structure, &wry, &InverseOptions::default()).is_err());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn rest_lengths(
    structure: &Structure,
    positions: &[Point3<f64>],
    options: &InverseOptions,
) -> Result<InverseForm, InverseError> {
    let balance = Balance::new(structure, positions, options)?;
    let forces = balance.solve(structure)?;
    let configuration = balance.configuration(structure, positions, &forces);
    let residual = unbalanced(structure, &configuration).1;
    Ok(InverseForm {
        configuration,
        choices: balance.choices(),
        residual,
    })
}

/// The balanced node with the largest unbalanced force, and that force.
fn unbalanced(structure: &Structure, configuration: &Configuration) -> (usize, f64) {
    let mut pulls: Vec<_> = structure.nodes.iter().map(|node| node.load).collect();
    for (e, element) in structure.elements.iter().enumerate() {
        if let Some(force) = configuration.forces[e] {
            let [a, b] = element.nodes;
            let vector = configuration.positions[b] - configuration.positions[a];
            let pull = vector * (force / configuration.lengths[e]);
            pulls[a] += pull;
            pulls[b] -= pull;
        }
    }
    let balanced = pulls.iter().enumerate();
    balanced
        .filter(|(node, _)| structure.nodes[*node].balanced)
        .map(|(node, pull)| (node, pull.norm()))
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .unwrap_or((0, 0.0))
}
