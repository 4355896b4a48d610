//! The atlas file: the atlas of an equilibrium component as one JSON object, to be
//! queried again.
//!
//! It keeps what an atlas is built of: centres, radii and parents of its charts.
//! The format is described in `docs/atlas.md`. Numbers are written with the fewest
//! digits that read back to the same bits.

use std::{
    fs, io,
    path::{Path, PathBuf},
};

use nalgebra::Point3;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use tensegra_model::{Formulation, Problem};

use crate::{
    atomic::{WriteError, write_atomic},
    json::{Layout, Step, locate},
    path_file::{
        ElementRecord, ProblemReference, element_records, formulation_name, node_names,
        without_place,
    },
};

const FORMAT: &str = "tensegra-atlas";
const VERSION: u64 = 1;

/// An atlas, with what is needed to query it.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct AtlasFile {
    /// The problem whose component was explored.
    pub problem: ProblemReference,
    /// Coordinates of the centres.
    pub formulation: Formulation,
    /// Names of the nodes.
    pub nodes: Vec<String>,
    /// The elements.
    pub elements: Vec<ElementRecord>,
    /// Node positions that set the scales of the coordinates.
    pub reference: Vec<Point3<f64>>,
    /// Dimension k of the manifold.
    pub dimension: usize,
    /// Largest radius ρ of a chart.
    pub radius: f64,
    /// Largest distance ε of a chart from the manifold.
    pub error: f64,
    /// Least ratio of a step in a chart to that on the manifold.
    pub cosine: f64,
    /// Whether the whole component was explored.
    pub complete: bool,
    /// What ends the component.
    pub borders: Vec<BorderRecord>,
    /// The charts in the order in which they were found.
    pub charts: Vec<ChartRecord>,
}

/// Something that ends the component.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct BorderRecord {
    /// `limit`, `contact`, `singularity` or `curvature`.
    pub kind: String,
    /// Which limit, or whose contact.
    pub name: String,
    /// Directions in which a chart met it.
    pub count: usize,
}

/// A chart of an atlas.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ChartRecord {
    /// Coordinates of its centre.
    pub center: Vec<f64>,
    /// Its radius.
    pub radius: f64,
    /// The chart before it.
    #[serde(default)]
    pub parent: Option<usize>,
}

/// Why an atlas file was not read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AtlasReadError {
    /// The file cannot be opened or read.
    #[error("cannot read `{}`: {reason}", file.display())]
    Unreadable {
        /// The file.
        file: PathBuf,
        /// What the system says.
        reason: io::Error,
    },
    /// The file is not an atlas file, or contradicts itself.
    #[error("{}:{line}:{column}: {message}", file.display())]
    Content {
        /// The file.
        file: PathBuf,
        /// Line, from 1.
        line: usize,
        /// Column in bytes, from 1.
        column: usize,
        /// What is wrong, and how to mend it.
        message: String,
    },
}

/// Why an atlas was not written as a file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AtlasWriteError {
    /// A number cannot be written.
    #[error("the atlas cannot be written as JSON: {0}")]
    Json(serde_json::Error),
    /// The file cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}

impl AtlasFile {
    /// A file without charts, for the component of a problem's start.
    pub fn new(problem: &Problem, formulation: Formulation) -> Self {
        Self {
            problem: ProblemReference::new(problem),
            formulation,
            nodes: node_names(&problem.structure),
            elements: element_records(&problem.structure),
            reference: Vec::new(),
            dimension: 0,
            radius: 0.0,
            error: 0.0,
            cosine: 0.0,
            complete: false,
            borders: Vec::new(),
            charts: Vec::new(),
        }
    }

    /// The first respect in which the nodes and elements of a problem differ from
    /// those of the atlas, in words; none where they agree.
    pub fn difference(&self, problem: &Problem) -> Option<String> {
        let nodes = node_names(&problem.structure);
        let elements = element_records(&problem.structure);
        for (what, here, there) in [
            ("nodes", self.nodes.len(), nodes.len()),
            ("elements", self.elements.len(), elements.len()),
        ] {
            if here != there {
                return Some(format!("it has {here} {what}, the problem has {there}"));
            }
        }
        let node = self.nodes.iter().zip(&nodes).find(|(a, b)| a != b);
        let element = self.elements.iter().zip(&elements).find(|(a, b)| a != b);
        node.map(|(a, b)| format!("its node `{a}` is `{b}` in the problem"))
            .or_else(|| {
                element.map(|(a, b)| format!("its element `{}` is not the `{}` there", a.id, b.id))
            })
    }
}

/// What stands in the file.
#[derive(Serialize, Deserialize)]
struct Record {
    format: String,
    version: u64,
    problem: ProblemReference,
    formulation: String,
    nodes: Vec<String>,
    elements: Vec<ElementRecord>,
    reference: Vec<Point3<f64>>,
    dimension: usize,
    radius: f64,
    error: f64,
    cosine: f64,
    complete: bool,
    borders: Vec<BorderRecord>,
    charts: Vec<ChartRecord>,
}

#[derive(Deserialize)]
struct Header {
    #[serde(default)]
    format: Value,
    #[serde(default)]
    version: Value,
}

/// Writes an atlas file, whole or not at all.
///
/// # Errors
/// [`AtlasWriteError`] when the file cannot be written.
pub fn write_atlas_file(file: &Path, atlas: &AtlasFile) -> Result<(), AtlasWriteError> {
    let atlas = atlas.clone();
    let record = Record {
        format: FORMAT.to_owned(),
        version: VERSION,
        problem: atlas.problem.seen_from(file),
        formulation: formulation_name(atlas.formulation).to_owned(),
        nodes: atlas.nodes,
        elements: atlas.elements,
        reference: atlas.reference,
        dimension: atlas.dimension,
        radius: atlas.radius,
        error: atlas.error,
        cosine: atlas.cosine,
        complete: atlas.complete,
        borders: atlas.borders,
        charts: atlas.charts,
    };
    let mut bytes = Vec::new();
    let mut serializer = serde_json::Serializer::with_formatter(&mut bytes, Layout::default());
    record
        .serialize(&mut serializer)
        .map_err(AtlasWriteError::Json)?;
    bytes.push(b'\n');
    Ok(write_atomic(file, &bytes)?)
}

/// Reads an atlas file.
///
/// # Errors
/// [`AtlasReadError`] with file, line and column when the file is unreadable, not
/// JSON, no atlas file, or contradicts itself.
pub fn read_atlas_file(file: &Path) -> Result<AtlasFile, AtlasReadError> {
    let bytes = fs::read(file).map_err(|reason| AtlasReadError::Unreadable {
        file: file.to_path_buf(),
        reason,
    })?;
    let wrong = |(line, column): (usize, usize), message: String| AtlasReadError::Content {
        file: file.to_path_buf(),
        line,
        column,
        message,
    };
    let hint = "give a file that `tensegra atlas` wrote";
    let text = std::str::from_utf8(&bytes).map_err(|failure| {
        let place = crate::json::line_and_column(&bytes, failure.valid_up_to());
        wrong(place, format!("this is not UTF-8 text; {hint}"))
    })?;
    if text.trim().is_empty() {
        return Err(wrong((1, 1), format!("the file is empty; {hint}")));
    }
    let syntax = |failure: serde_json::Error| {
        wrong((failure.line(), failure.column()), without_place(&failure))
    };
    let header: Header = serde_json::from_str(text).map_err(syntax)?;
    if header.format != FORMAT || header.version != VERSION {
        let found = match &header.format {
            Value::Null => "no `format`".to_owned(),
            other => format!("the format {other} version {}", header.version),
        };
        let message = format!("the file has {found}, not `{FORMAT}` version {VERSION}; {hint}");
        return Err(wrong((1, 1), message));
    }
    let record: Record = serde_json::from_str(text).map_err(syntax)?;
    let formulation =
        check(&record).map_err(|(steps, message)| wrong(locate(text, &steps), message))?;
    Ok(AtlasFile {
        problem: record.problem,
        formulation,
        nodes: record.nodes,
        elements: record.elements,
        reference: record.reference,
        dimension: record.dimension,
        radius: record.radius,
        error: record.error,
        cosine: record.cosine,
        complete: record.complete,
        borders: record.borders,
        charts: record.charts,
    })
}

/// Whether the parts of the file agree; otherwise where and why not.
fn check(record: &Record) -> Result<Formulation, (Vec<Step>, String)> {
    let at = |key: &'static str, message: String| (vec![Step::Key(key)], message);
    let formulation = [Formulation::Nodes, Formulation::Directions]
        .into_iter()
        .find(|&formulation| formulation_name(formulation) == record.formulation)
        .ok_or_else(|| {
            let message = format!("`{}` is no formulation", record.formulation);
            at("formulation", message)
        })?;
    if record.reference.len() != record.nodes.len() {
        let (positions, nodes) = (record.reference.len(), record.nodes.len());
        let message = format!("there are {positions} positions for {nodes} nodes");
        return Err(at("reference", message));
    }
    for (key, value, most) in [
        ("radius", record.radius, f64::MAX),
        ("error", record.error, f64::MAX),
        ("cosine", record.cosine, 1.0),
    ] {
        if !(value > 0.0 && value <= most) {
            return Err(at(key, format!("{key} is {value}, but must be positive")));
        }
    }
    let Some(first) = record.charts.first() else {
        return Err(at("charts", "an atlas has at least one chart".to_owned()));
    };
    let variables = first.center.len();
    if record.dimension == 0 || record.dimension > variables {
        let dimension = record.dimension;
        let message = format!("a manifold of {variables} variables has no dimension {dimension}");
        return Err(at("dimension", message));
    }
    for (i, chart) in record.charts.iter().enumerate() {
        let wrong = |message: String| (vec![Step::Key("charts"), Step::Index(i)], message);
        if chart.center.len() != variables {
            let found = chart.center.len();
            let message = format!("the centre has {found} coordinates, the first has {variables}");
            return Err(wrong(message));
        }
        if !(chart.radius > 0.0 && chart.radius <= record.radius) {
            let (found, most) = (chart.radius, record.radius);
            return Err(wrong(format!(
                "the chart has radius {found}, but must have one above 0 and up to {most}"
            )));
        }
        if chart.parent.is_some_and(|parent| parent >= i) || (i > 0 && chart.parent.is_none()) {
            return Err(wrong("a chart's parent is a chart before it".to_owned()));
        }
    }
    Ok(formulation)
}
