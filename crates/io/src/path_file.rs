//! The path file: a planned motion as one JSON object, for `check`, for other
//! programs and for keeping.
//!
//! The format is described in `docs/path-file.md` and, for machines, in
//! `docs/path.schema.json`. Numbers are written with the fewest digits that
//! read back to the same bits. Reading costs one pass over the file; the place
//! of an error that is not one of syntax is looked up in a second pass.

use std::{
    collections::HashMap,
    fs, io,
    path::{Component, Path as FilePath, PathBuf},
};

use nalgebra::Point3;
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};
use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use tensegra_model::{
    Actuation, Configuration, ElementKind, Formulation, NeighbourSearch, Path, PlannerKind,
    PlannerSettings, Problem, ReadErrors, SamplingRadius, SourceFile, Structure,
};

use crate::{
    atomic::{WriteError, write_atomic},
    consistency::{PathMismatch, check_counts, check_path},
    json::{Layout, Step, locate},
};

const FORMAT: &str = "tensegra-path";
const VERSION: u64 = 1;

/// A motion of a structure, with what is needed to judge and to repeat it.
#[derive(Clone, Debug, PartialEq)]
pub struct PathFile {
    /// The problem that the motion solves.
    pub problem: ProblemReference,
    /// Coordinates in which it was planned: `nodes` or `directions`.
    pub formulation: String,
    /// Seed of every random choice.
    pub seed: u64,
    /// Parameters by name.
    pub parameters: Value,
    /// Names of the nodes, in the order of the positions.
    pub nodes: Vec<String>,
    /// The elements, in the order of lengths, rest lengths and forces.
    pub elements: Vec<ElementRecord>,
    /// The configurations from start to goal.
    pub path: Path,
    /// Whether the motion ends where it does, not at the problem's goal: one
    /// that was traced, not planned.
    pub open_end: bool,
    /// Whether the motion begins where it does, not at the problem's start.
    pub open_start: bool,
    /// Whether this is one configuration that meets what the problem's table
    /// `[formfind]` asks for.
    pub form: bool,
    /// Statistics of planning by name, among them `planning_seconds`.
    pub statistics: Value,
    /// Verdict of the checker; null where it has not been run.
    pub check: Value,
}

/// Where the problem of a path is to be found again, and by what to know it.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ProblemReference {
    /// Name of the problem.
    pub name: String,
    /// Its file, as it was given to the program that wrote the path; absent for
    /// a problem that came from no file.
    #[serde(default)]
    pub source: Option<String>,
    /// Its file, seen from the folder of the path file.
    #[serde(default)]
    pub relative: Option<String>,
    /// Its file, from the root of the file system.
    #[serde(default)]
    pub absolute: Option<String>,
    /// The texts that it was read from, the problem file first.
    #[serde(default)]
    pub texts: Vec<TextDigest>,
}

/// A text of a problem, and by what to know it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct TextDigest {
    /// Name of the file, without its folder.
    pub name: String,
    /// SHA-256 of the text in hexadecimal, as `sha256sum` prints it.
    pub sha256: String,
}

/// An element as a path file names it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ElementRecord {
    /// Name, unique among the elements.
    pub id: String,
    /// What it is.
    #[serde(serialize_with = "write_kind", deserialize_with = "read_kind")]
    pub kind: ElementKind,
    /// Names of its two nodes.
    pub nodes: [String; 2],
}

/// Why a path file was not read, or its problem not found.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadError {
    /// The file cannot be opened or read.
    #[error("cannot read `{}`: {reason}", file.display())]
    Unreadable {
        /// The file.
        file: PathBuf,
        /// What the system says.
        reason: io::Error,
    },
    /// The file is not text.
    #[error(
        "{}:{line}:{column}: this is not UTF-8 text, so it is no path file; \
         give a `.json` file that `tensegra plan` wrote",
        file.display()
    )]
    NotText {
        /// The file.
        file: PathBuf,
        /// Line of the first byte that is not text, from 1.
        line: usize,
        /// Its column in bytes, from 1.
        column: usize,
    },
    /// The file is not JSON, or a value is missing or of the wrong type.
    #[error("{}:{line}:{column}: {message}", file.display())]
    Syntax {
        /// The file.
        file: PathBuf,
        /// Line, from 1.
        line: usize,
        /// Column in bytes, from 1; 0 at an end of line.
        column: usize,
        /// What is wrong.
        message: String,
    },
    /// The file is JSON of another kind, or of a later version.
    #[error(
        "`{}` has the format {found}, not `{FORMAT}` version {VERSION}; \
         give a file that this version of `tensegra` wrote",
        file.display()
    )]
    Format {
        /// The file.
        file: PathBuf,
        /// The format and version that it states.
        found: String,
    },
    /// The parts of the file contradict each other.
    #[error("{}:{line}:{column}: {message}", file.display())]
    Content {
        /// The file.
        file: PathBuf,
        /// Line, from 1.
        line: usize,
        /// Column in bytes, from 1.
        column: usize,
        /// What is wrong, and with which node, element or configuration.
        message: String,
    },
    /// The path file names no problem file.
    #[error("`{}` names no problem file; give the problem along with the path", file.display())]
    NoProblem {
        /// The path file.
        file: PathBuf,
    },
    /// The problem file is not where it was.
    #[error(
        "the problem of `{}` is not found; looked for {}; \
         put it back or give the problem along with the path",
        file.display(),
        list(tried)
    )]
    ProblemMissing {
        /// The path file.
        file: PathBuf,
        /// Where it was looked for.
        tried: Vec<PathBuf>,
    },
    /// The problem file is no longer in order.
    #[error("the problem of the path cannot be read: {0:#}")]
    Problem(#[source] ReadErrors),
    /// The problem is no longer the one that was planned on.
    #[error(
        "`{changed}` has changed since the path `{}` was written; \
         plan again, or give the problem along with the path",
        file.display()
    )]
    ProblemChanged {
        /// The path file.
        file: PathBuf,
        /// The file of the problem that has changed.
        changed: String,
    },
    /// The path belongs to another structure.
    #[error("`{}` is no path of the problem `{problem}`: {difference}", file.display())]
    OtherStructure {
        /// The path file.
        file: PathBuf,
        /// Name of the problem.
        problem: String,
        /// The first node or element that differs.
        difference: String,
    },
}

/// Why a path was not written as a file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PathWriteError {
    /// The path does not fit its nodes and elements.
    #[error(transparent)]
    Path(#[from] PathMismatch),
    /// A value of `parameters`, `statistics` or `check` cannot be written.
    #[error("the path cannot be written as JSON: {0}")]
    Json(serde_json::Error),
    /// The file cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}

impl PathFile {
    /// A file for `path`, which solves `problem`: names, formulation, seed and
    /// parameters are the problem's; statistics and verdict are null, for the
    /// caller to fill in.
    pub fn new(problem: &Problem, path: Path) -> Self {
        let structure = &problem.structure;
        Self {
            problem: ProblemReference::new(problem),
            formulation: formulation_name(problem.settings.formulation).to_owned(),
            seed: problem.seed,
            parameters: parameters(&problem.settings),
            nodes: node_names(structure),
            elements: element_records(structure),
            path,
            open_end: false,
            open_start: false,
            form: false,
            statistics: Value::Null,
            check: Value::Null,
        }
    }

    /// Reads the problem of the path, which was itself read from `path_file`,
    /// from the first place where its file stands: as seen from the path file,
    /// from the root of the file system, or as it was given.
    ///
    /// # Errors
    /// [`ReadError`] when the problem names no file, or its file is nowhere, is
    /// not in order, or is not what it was when the path was planned.
    pub fn read_problem(&self, path_file: &FilePath) -> Result<Problem, ReadError> {
        let file = || path_file.to_path_buf();
        let reference = &self.problem;
        let folder = path_file.parent().unwrap_or(FilePath::new(""));
        let mut places: Vec<PathBuf> = [
            reference.relative.as_ref().map(|place| folder.join(place)),
            reference.absolute.as_ref().map(PathBuf::from),
            reference.source.as_ref().map(PathBuf::from),
        ]
        .into_iter()
        .flatten()
        .collect();
        if places.is_empty() {
            return Err(ReadError::NoProblem { file: file() });
        }
        let Some(place) = places.iter().find(|place| place.is_file()) else {
            places.dedup();
            return Err(ReadError::ProblemMissing {
                file: file(),
                tried: places,
            });
        };
        let problem = Problem::read(place).map_err(ReadError::Problem)?;
        let now = digests(&problem);
        let was = &reference.texts;
        if let Some(changed) = was.iter().find(|text| !now.contains(text)) {
            return Err(ReadError::ProblemChanged {
                file: file(),
                changed: changed.name.clone(),
            });
        }
        self.check_structure(path_file, &problem)?;
        Ok(problem)
    }

    /// Checks that the path, which was read from `path_file`, has the nodes and
    /// elements of a problem.
    ///
    /// # Errors
    /// [`ReadError::OtherStructure`] with the first that differs.
    pub fn check_structure(
        &self,
        path_file: &FilePath,
        problem: &Problem,
    ) -> Result<(), ReadError> {
        let nodes = node_names(&problem.structure);
        let elements = element_records(&problem.structure);
        let counts = [
            ("nodes", self.nodes.len(), nodes.len()),
            ("elements", self.elements.len(), elements.len()),
        ];
        let counted = counts
            .into_iter()
            .find(|(_, here, there)| here != there)
            .map(|(what, here, there)| format!("it has {here} {what}, the problem has {there}"));
        let named = || {
            let mut pairs = self.nodes.iter().zip(&nodes);
            let (here, there) = pairs.find(|(here, there)| here != there)?;
            Some(format!("its node `{here}` is `{there}` in the problem"))
        };
        let joined = || {
            let mut pairs = self.elements.iter().zip(&elements);
            let (here, there) = pairs.find(|(here, there)| here != there)?;
            let (here, there) = (here.describe(), there.describe());
            Some(format!("its {here} is the {there} in the problem"))
        };
        match counted.or_else(named).or_else(joined) {
            None => Ok(()),
            Some(difference) => Err(ReadError::OtherStructure {
                file: path_file.to_path_buf(),
                problem: problem.name.clone(),
                difference,
            }),
        }
    }
}

impl ElementRecord {
    fn describe(&self) -> String {
        let Self { id, kind, nodes } = self;
        format!(
            "{} `{id}` from `{}` to `{}`",
            kind.keyword(),
            nodes[0],
            nodes[1]
        )
    }
}

impl ProblemReference {
    /// A reference to `problem`.
    pub fn new(problem: &Problem) -> Self {
        let text = |path: &FilePath| path.to_string_lossy().into_owned();
        let absolute = problem.source.as_ref().and_then(|source| {
            let resolved = fs::canonicalize(source).or_else(|_| std::path::absolute(source));
            resolved.ok()
        });
        Self {
            name: problem.name.clone(),
            source: problem.source.as_deref().map(text),
            relative: None,
            absolute: absolute.as_deref().map(text),
            texts: digests(problem),
        }
    }

    /// This reference with the place of the problem as seen from a file.
    pub(crate) fn seen_from(&self, file: &FilePath) -> Self {
        let absolute = self.absolute.as_ref();
        Self {
            relative: absolute.and_then(|problem| relative(file, FilePath::new(problem))),
            ..self.clone()
        }
    }
}

fn digests(problem: &Problem) -> Vec<TextDigest> {
    let digest = |file: &SourceFile| TextDigest {
        name: file
            .path()
            .file_name()
            .map_or_else(String::new, |name| name.to_string_lossy().into_owned()),
        sha256: sha256(file.text().as_bytes()),
    };
    problem.files.iter().map(digest).collect()
}

/// Writes a path file, whole or not at all. The place of the problem as seen
/// from the file is filled in.
///
/// # Errors
/// [`PathWriteError`] when the path does not fit the nodes and elements, a
/// number is not finite, or the file cannot be written.
pub fn write_path_file(file: &FilePath, contents: &PathFile) -> Result<(), PathWriteError> {
    let reference = contents.problem.seen_from(file);
    Ok(write_atomic(file, &encode(contents, &reference)?)?)
}

/// Reads a path file.
///
/// # Errors
/// [`ReadError`] with file, line and column when the file is unreadable, not
/// JSON, not a path file, or contradicts itself.
pub fn read_path_file(file: &FilePath) -> Result<PathFile, ReadError> {
    let bytes = fs::read(file).map_err(|reason| ReadError::Unreadable {
        file: file.to_path_buf(),
        reason,
    })?;
    let text = std::str::from_utf8(&bytes).map_err(|failure| {
        let (line, column) = crate::json::line_and_column(&bytes, failure.valid_up_to());
        ReadError::NotText {
            file: file.to_path_buf(),
            line,
            column,
        }
    })?;
    if text.trim().is_empty() {
        return Err(ReadError::Syntax {
            file: file.to_path_buf(),
            line: 1,
            column: 1,
            message: "the file is empty; give a `.json` file that `tensegra plan` wrote".into(),
        });
    }
    let syntax = |failure: serde_json::Error| ReadError::Syntax {
        file: file.to_path_buf(),
        line: failure.line(),
        column: failure.column(),
        message: without_place(&failure),
    };
    // Serde would read the values of an array as format and version.
    let first = text.len() - text.trim_start().len();
    if !text[first..].starts_with('{') {
        let (line, column) = crate::json::line_and_column(&bytes, first);
        return Err(ReadError::Syntax {
            file: file.to_path_buf(),
            line,
            column,
            message: "a path file is one JSON object".into(),
        });
    }
    let header: Header = serde_json::from_str(text).map_err(syntax)?;
    header.check().map_err(|found| ReadError::Format {
        file: file.to_path_buf(),
        found,
    })?;
    let record: Record = serde_json::from_str(text).map_err(syntax)?;
    record.check().map_err(|(steps, message)| {
        let (line, column) = locate(text, &steps);
        ReadError::Content {
            file: file.to_path_buf(),
            line,
            column,
            message,
        }
    })?;
    Ok(PathFile {
        problem: record.problem,
        formulation: record.formulation,
        seed: record.seed,
        parameters: record.parameters,
        nodes: record.nodes,
        elements: record.elements,
        path: Path {
            configurations: record.configurations,
        },
        open_end: record.open_end,
        open_start: record.open_start,
        form: record.form,
        statistics: record.statistics,
        check: record.check,
    })
}

/// Format and version alone, read before anything else is asked of the file.
#[derive(Deserialize)]
struct Header {
    #[serde(default)]
    format: Value,
    #[serde(default)]
    version: Value,
}

impl Header {
    fn check(&self) -> Result<(), String> {
        if self.format == FORMAT && self.version == VERSION {
            return Ok(());
        }
        Err(match &self.format {
            Value::Null => "of some other program (it has no `format`)".to_owned(),
            Value::String(format) => format!("`{format}` version {}", self.version),
            other => other.to_string(),
        })
    }
}

/// What is read: everything but format and version.
#[derive(Deserialize)]
struct Record {
    problem: ProblemReference,
    formulation: String,
    seed: u64,
    #[serde(default)]
    parameters: Value,
    nodes: Vec<String>,
    elements: Vec<ElementRecord>,
    #[serde(deserialize_with = "read_configurations")]
    configurations: Vec<Configuration>,
    #[serde(default)]
    open_end: bool,
    #[serde(default)]
    open_start: bool,
    #[serde(default)]
    form: bool,
    #[serde(default)]
    statistics: Value,
    #[serde(default)]
    check: Value,
}

impl Record {
    /// Whether names are unique and known, and lists as long as they must be;
    /// otherwise where and why not.
    fn check(&self) -> Result<(), (Vec<Step>, String)> {
        let mut nodes = HashMap::new();
        for (index, name) in self.nodes.iter().enumerate() {
            if nodes.insert(name.as_str(), index).is_some() {
                let place = vec![Step::Key("nodes"), Step::Index(index)];
                return Err((place, format!("two nodes are called `{name}`")));
            }
        }
        let mut elements = HashMap::new();
        for (index, element) in self.elements.iter().enumerate() {
            let place = || vec![Step::Key("elements"), Step::Index(index)];
            let id = &element.id;
            if elements.insert(id.as_str(), index).is_some() {
                return Err((place(), format!("two elements are called `{id}`")));
            }
            for name in &element.nodes {
                if !nodes.contains_key(name.as_str()) {
                    let message = format!("element `{id}` ends at `{name}`, which is no node");
                    return Err((place(), message));
                }
            }
        }
        if self.configurations.is_empty() {
            let message = "a path has at least one configuration".to_owned();
            return Err((vec![Step::Key("configurations")], message));
        }
        for (index, configuration) in self.configurations.iter().enumerate() {
            let [nodes, elements] = [self.nodes.len(), self.elements.len()];
            check_counts(configuration, index, nodes, elements).map_err(|mismatch| {
                let mut place = vec![Step::Key("configurations"), Step::Index(index)];
                if let PathMismatch::Count { quantity, .. } = mismatch {
                    place.push(Step::Key(quantity));
                }
                (place, mismatch.to_string())
            })?;
        }
        Ok(())
    }
}

/// What is written, borrowed from a [`PathFile`].
#[derive(Serialize)]
struct View<'a> {
    format: &'static str,
    version: u64,
    problem: &'a ProblemReference,
    formulation: &'a str,
    seed: u64,
    parameters: &'a Value,
    nodes: &'a [String],
    elements: &'a [ElementRecord],
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    open_end: bool,
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    open_start: bool,
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    form: bool,
    configurations: Vec<ConfigurationView<'a>>,
    statistics: &'a Value,
    check: &'a Value,
}

#[derive(Serialize)]
struct ConfigurationView<'a> {
    positions: &'a [Point3<f64>],
    lengths: &'a [f64],
    rest_lengths: &'a [Option<f64>],
    forces: &'a [Option<f64>],
}

#[derive(Deserialize)]
#[serde(remote = "Configuration")]
struct ConfigurationRecord {
    positions: Vec<Point3<f64>>,
    lengths: Vec<f64>,
    rest_lengths: Vec<Option<f64>>,
    forces: Vec<Option<f64>>,
}

fn read_configurations<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Vec<Configuration>, D::Error> {
    #[derive(Deserialize)]
    struct Wrapped(#[serde(with = "ConfigurationRecord")] Configuration);
    let wrapped = Vec::<Wrapped>::deserialize(deserializer)?;
    Ok(wrapped.into_iter().map(|wrapped| wrapped.0).collect())
}

fn encode(contents: &PathFile, problem: &ProblemReference) -> Result<Vec<u8>, PathWriteError> {
    let nodes: Vec<&str> = contents.nodes.iter().map(String::as_str).collect();
    let elements: Vec<&str> = contents.elements.iter().map(|e| e.id.as_str()).collect();
    check_path(&contents.path, &nodes, &elements)?;
    let view = View {
        format: FORMAT,
        version: VERSION,
        problem,
        formulation: &contents.formulation,
        seed: contents.seed,
        parameters: &contents.parameters,
        nodes: &contents.nodes,
        elements: &contents.elements,
        open_end: contents.open_end,
        open_start: contents.open_start,
        form: contents.form,
        configurations: contents
            .path
            .configurations
            .iter()
            .map(|configuration| ConfigurationView {
                positions: &configuration.positions,
                lengths: &configuration.lengths,
                rest_lengths: &configuration.rest_lengths,
                forces: &configuration.forces,
            })
            .collect(),
        statistics: &contents.statistics,
        check: &contents.check,
    };
    let mut bytes = Vec::new();
    let mut serializer = serde_json::Serializer::with_formatter(&mut bytes, Layout::default());
    view.serialize(&mut serializer)
        .map_err(PathWriteError::Json)?;
    bytes.push(b'\n');
    Ok(bytes)
}

pub(crate) fn node_names(structure: &Structure) -> Vec<String> {
    structure
        .nodes
        .iter()
        .map(|node| node.name.clone())
        .collect()
}

pub(crate) fn element_records(structure: &Structure) -> Vec<ElementRecord> {
    let name = |node: usize| structure.nodes[node].name.clone();
    structure
        .elements
        .iter()
        .map(|element| ElementRecord {
            id: element.name.clone(),
            kind: element.kind,
            nodes: element.nodes.map(name),
        })
        .collect()
}

pub(crate) const fn formulation_name(formulation: Formulation) -> &'static str {
    match formulation {
        Formulation::Nodes => "nodes",
        Formulation::Directions => "directions",
    }
}

fn parameters(settings: &PlannerSettings) -> Value {
    json!({
        "planner": match settings.planner {
            PlannerKind::TwoTrees => "two-trees",
            PlannerKind::OneTree => "one-tree",
        },
        "tolerance": settings.tolerance,
        "chart_radius": settings.chart_radius,
        "chart_error": settings.chart_error,
        "curvature": settings.curvature,
        "step": settings.step,
        "sampling_radius": match settings.sampling_radius {
            SamplingRadius::Automatic => json!("automatic"),
            SamplingRadius::Adaptive => json!("adaptive"),
            SamplingRadius::Fixed(radius) => json!(radius),
        },
        "neighbours": NeighbourSearch::NAMED
            .iter()
            .find(|(_, search)| *search == settings.neighbours)
            .map(|(name, _)| name),
        "slide": settings.slide,
        "max_newton_iterations": settings.max_newton_iterations,
        "max_charts": settings.max_charts,
        "max_nodes": settings.max_nodes,
        "time_limit": settings.time_limit,
        "actuation": match settings.actuation {
            Actuation::Length => "length",
            Actuation::Force => "force",
        },
        "least_stiffness": settings.least_stiffness,
    })
}

fn write_kind<S: Serializer>(kind: &ElementKind, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(kind.keyword())
}

fn read_kind<'de, D: Deserializer<'de>>(deserializer: D) -> Result<ElementKind, D::Error> {
    const KINDS: [ElementKind; 5] = [
        ElementKind::Strut,
        ElementKind::Bar,
        ElementKind::Cable,
        ElementKind::Spring,
        ElementKind::Prismatic,
    ];
    let keyword = String::deserialize(deserializer)?;
    KINDS
        .into_iter()
        .find(|kind| kind.keyword() == keyword)
        .ok_or_else(|| {
            let known = KINDS.map(ElementKind::keyword).join("`, `");
            de::Error::custom(format!(
                "`{keyword}` is no kind of element; one of `{known}`"
            ))
        })
}

fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes)
        .iter()
        .map(|byte| format!("{byte:02x}"))
        .collect()
}

/// `target` as seen from the folder of `file`, with forward slashes; none when
/// they share no root.
fn relative(file: &FilePath, target: &FilePath) -> Option<String> {
    let folder = match file.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => FilePath::new("."),
    };
    let folder = fs::canonicalize(folder)
        .or_else(|_| std::path::absolute(folder))
        .ok()?;
    let folder: Vec<Component<'_>> = folder.components().collect();
    let target: Vec<Component<'_>> = target.components().collect();
    let common = folder
        .iter()
        .zip(&target)
        .take_while(|(a, b)| a == b)
        .count();
    if common == 0 {
        return None;
    }
    let up = folder[common..].iter().map(|_| "..".into());
    let down = target[common..]
        .iter()
        .map(|component| component.as_os_str().to_string_lossy());
    Some(up.chain(down).collect::<Vec<_>>().join("/"))
}

/// The message of a JSON error without the place, which stands before it.
pub(crate) fn without_place(failure: &serde_json::Error) -> String {
    let message = failure.to_string();
    let place = format!(" at line {} column {}", failure.line(), failure.column());
    match message.strip_suffix(&place) {
        Some(bare) => bare.to_owned(),
        None => message,
    }
}

fn list(places: &[PathBuf]) -> String {
    let quoted: Vec<String> = places
        .iter()
        .map(|place| format!("`{}`", place.display()))
        .collect();
    quoted.join(", ")
}
