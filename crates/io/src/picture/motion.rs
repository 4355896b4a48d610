//! Pictures of a motion: snapshots, quantities of the elements along the path,
//! and paths in the space of three quantities.

use tensegra_model::{Configuration, ElementKind, Environment, Interval, Path, Structure};

use super::{
    Axis, Chart, Curve, Level, Picture, PictureError, Scene, SceneOptions, Series, SpacePlot, View,
    draw_scenes,
};
use crate::{consistency::check_path_of, geometry::parameters_along, number::significant};

/// Units of a problem, as they are written on axes; a problem states none.
///
/// # Examples
/// ```
/// use tensegra_io::Units;
/// let units = Units::new("m", "N");
/// assert_eq!(units.length, "m");
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Units {
    /// Unit of length.
    pub length: String,
    /// Unit of force.
    pub force: String,
}

impl Units {
    /// Units of length and force.
    pub fn new(length: impl Into<String>, force: impl Into<String>) -> Self {
        Self {
            length: length.into(),
            force: force.into(),
        }
    }
}

impl Default for Units {
    fn default() -> Self {
        Self::new("units of length", "units of force")
    }
}

/// A number that every configuration of a structure has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Quantity {
    /// Length of an element.
    Length(usize),
    /// Rest length of an element with a linear law.
    RestLength(usize),
    /// Force of an element that carries one, tension positive.
    Force(usize),
    /// Coordinate of a node.
    Coordinate {
        /// The node.
        node: usize,
        /// 0, 1 or 2 for x, y or z.
        axis: usize,
    },
}

impl Quantity {
    /// The value in a configuration; none where the element has no such
    /// quantity or there is no such element or node.
    pub fn value(self, configuration: &Configuration) -> Option<f64> {
        match self {
            Self::Length(element) => configuration.lengths.get(element).copied(),
            Self::RestLength(element) => configuration.rest_lengths.get(element).copied()?,
            Self::Force(element) => configuration.forces.get(element).copied()?,
            Self::Coordinate { node, axis } => {
                let position = configuration.positions.get(node)?;
                position.coords.get(axis).copied()
            }
        }
    }

    /// An axis for the quantity, with the names of the structure.
    pub fn axis(self, structure: &Structure, units: &Units) -> Axis {
        let element = |index: usize| name(structure.elements.get(index).map(|e| &e.name));
        match self {
            Self::Length(e) => Axis::new(format!("length of {}", element(e))).unit(&units.length),
            Self::RestLength(e) => {
                Axis::new(format!("rest length of {}", element(e))).unit(&units.length)
            }
            Self::Force(e) => Axis::new(format!("force of {}", element(e))).unit(&units.force),
            Self::Coordinate { node, axis } => {
                let node = name(structure.nodes.get(node).map(|n| &n.name));
                let axis = ["x", "y", "z"].get(axis).copied().unwrap_or("?");
                Axis::new(format!("{axis} of {node}")).unit(&units.length)
            }
        }
    }
}

fn name(name: Option<&String>) -> &str {
    name.map_or("?", String::as_str)
}

/// Draws one configuration, with the names of the nodes where they are few.
///
/// # Errors
/// [`PictureError`] when the configuration does not fit the structure.
pub fn draw_configuration(
    structure: &Structure,
    environment: &Environment,
    configuration: &Configuration,
    title: &str,
    units: &Units,
) -> Result<Picture, PictureError> {
    let scene = Scene::of(structure, environment, configuration)?;
    let mut options = scene_options(structure, units);
    options.width = 420.0;
    draw_scenes(&[(title.to_owned(), scene)], &options)
}

/// Draws start, end and `between` configurations evenly spread over the way
/// between them, in panels of one scale.
///
/// # Errors
/// [`PictureError`] when the path is empty or does not fit the structure.
pub fn draw_snapshots(
    structure: &Structure,
    environment: &Environment,
    path: &Path,
    between: usize,
    units: &Units,
) -> Result<Picture, PictureError> {
    check_path_of(structure, path)?;
    let parameters = parameters_along(path);
    let mut chosen: Vec<usize> = (0..between + 2)
        .map(|index| {
            let target = index as f64 / (between + 1) as f64;
            let distance = |i: &usize| (parameters[*i] - target).abs();
            let all = 0..parameters.len();
            all.min_by(|a, b| distance(a).total_cmp(&distance(b)))
                .unwrap_or(0)
        })
        .collect();
    chosen.dedup();
    let panels = chosen
        .iter()
        .map(|&index| {
            let title = match index {
                0 => "start".to_owned(),
                index if index + 1 == parameters.len() => "end".to_owned(),
                _ => format!("{:.0} % of the way", 100.0 * parameters[index]),
            };
            let configuration = &path.configurations[index];
            Ok((title, Scene::of(structure, environment, configuration)?))
        })
        .collect::<Result<Vec<_>, PictureError>>()?;
    draw_scenes(&panels, &scene_options(structure, units))
}

fn scene_options(structure: &Structure, units: &Units) -> SceneOptions {
    SceneOptions {
        view: View::for_dimension(structure.dimension),
        names: structure.nodes.len() <= FEW,
        unit: Some(units.length.clone()),
        ..SceneOptions::default()
    }
}

/// Draws the forces of the elements along a path, compression negative and
/// tension positive, with the limits that are near; the others are named below.
///
/// # Errors
/// [`PictureError`] when the path is empty, does not fit the structure, or no
/// element carries a force.
pub fn draw_forces(
    structure: &Structure,
    path: &Path,
    units: &Units,
) -> Result<Picture, PictureError> {
    let axis = Axis::new("force, tension above zero").unit(&units.force);
    draw_elements(structure, path, axis, "force", |element| {
        (Quantity::Force(element), structure.elements[element].force)
    })
}

/// Draws the lengths of the elements whose length may change along a path, with
/// the limits that are near; the others are named below.
///
/// # Errors
/// [`PictureError`] when the path is empty, does not fit the structure, or no
/// length may change.
pub fn draw_lengths(
    structure: &Structure,
    path: &Path,
    units: &Units,
) -> Result<Picture, PictureError> {
    let axis = Axis::new("length").unit(&units.length);
    draw_elements(structure, path, axis, "length", |element| {
        (
            Quantity::Length(element),
            structure.elements[element].length,
        )
    })
}

/// Draws the rest lengths of the elements that are actuated along a path, with
/// the limits that are near; the others are named below.
///
/// # Errors
/// [`PictureError`] when the path is empty, does not fit the structure, or no
/// rest length may change.
pub fn draw_rest_lengths(
    structure: &Structure,
    path: &Path,
    units: &Units,
) -> Result<Picture, PictureError> {
    let axis = Axis::new("rest length").unit(&units.length);
    draw_elements(structure, path, axis, "rest length", |element| {
        let rest = structure.elements[element].rest();
        let rest = rest.unwrap_or(Interval::constant(0.0));
        (Quantity::RestLength(element), rest)
    })
}

fn draw_elements(
    structure: &Structure,
    path: &Path,
    axis: Axis,
    what: &str,
    quantity: impl Fn(usize) -> (Quantity, Interval),
) -> Result<Picture, PictureError> {
    check_path_of(structure, path)?;
    let parameters = parameters_along(path);
    let mut lines = Vec::new();
    for element in 0..structure.elements.len() {
        let (quantity, range) = quantity(element);
        let values = path.configurations.iter().map(|c| quantity.value(c));
        let values: Option<Vec<f64>> = values.collect();
        if let Some(values) = values.filter(|_| !range.is_constant()) {
            lines.push(Line {
                element,
                range,
                values,
            });
        }
    }
    if lines.is_empty() {
        return Err(PictureError::Empty {
            what: format!("the set of elements whose {what} may change"),
        });
    }
    let steady = steady(structure, &mut lines);
    let position = Axis::new("position along the path, from start to end").range(0.0, 1.0);
    let mut chart = Chart::new(position, axis).size(560.0, 340.0);
    let looks = looks(structure, &lines);
    for (line, look) in lines.iter().zip(looks) {
        let points = parameters.iter().zip(&line.values);
        let points = points
            .map(|(&position, &value)| [position, value])
            .collect();
        let series = Series::line(look.label, points)
            .color(look.color)
            .dash(look.dash);
        let series = if lines.len() > FEW {
            series.thin()
        } else {
            series
        };
        chart = chart.series(series);
    }
    let limits = Limits::new(structure, &lines, what);
    for (label, value) in limits.near {
        chart = chart.level(Level::new(label, value));
    }
    if !limits.far.is_empty() {
        let far = limits.far.join("; ");
        chart = chart.note(format!("Limits outside the picture: {far}."));
    }
    if !steady.is_empty() {
        chart = chart.note(format!("Constant along the path: {}.", steady.join(", ")));
    }
    chart.draw()
}

/// Up to here each element has a look of its own and an entry in the legend.
const FEW: usize = 14;

/// A quantity of an element along a path.
struct Line {
    element: usize,
    range: Interval,
    values: Vec<f64>,
}

/// Takes away the lines that stay as they are, unless all do, and tells their
/// values: lines on top of each other say less.
fn steady(structure: &Structure, lines: &mut Vec<Line>) -> Vec<String> {
    const SAME: f64 = 1e-6;
    let is_steady = |line: &Line| {
        let lo = line.values.iter().copied().fold(f64::INFINITY, f64::min);
        let hi = line
            .values
            .iter()
            .copied()
            .fold(f64::NEG_INFINITY, f64::max);
        hi - lo <= SAME * hi.abs().max(lo.abs())
    };
    if lines.iter().all(is_steady) {
        return Vec::new();
    }
    let told = lines.iter().filter(|line| is_steady(line)).map(|line| {
        let name = &structure.elements[line.element].name;
        format!("{name} = {}", figure(line.values[0]))
    });
    let told = told.collect();
    lines.retain(|line| !is_steady(line));
    told
}

fn figure(value: f64) -> String {
    significant(value, 3).replace('-', "\u{2212}")
}

struct Look {
    label: String,
    color: usize,
    dash: usize,
}

/// How each line is drawn: where they are few, each in its own colour, dashed
/// for rigid elements; else one colour for each kind.
fn looks(structure: &Structure, lines: &[Line]) -> Vec<Look> {
    const COLORS: usize = 7;
    let kind = |line: &Line| structure.elements[line.element].kind;
    let look = |index: usize| {
        let line = &lines[index];
        let before =
            |same: &dyn Fn(&Line) -> bool| lines[..index].iter().filter(|l| same(l)).count();
        if lines.len() <= FEW {
            let rigid = is_rigid(kind(line));
            let rank = before(&|other| is_rigid(kind(other)) == rigid);
            return Look {
                label: structure.elements[line.element].name.clone(),
                color: rank % COLORS,
                dash: usize::from(rigid) + 2 * (rank / COLORS),
            };
        }
        let of_kind = |other: &Line| kind(other) == kind(line);
        let all = lines.iter().filter(|other| of_kind(other)).count();
        let first = before(&of_kind) == 0;
        Look {
            label: if first {
                format!("{} ({all})", plural(kind(line)))
            } else {
                String::new()
            },
            color: match kind(line) {
                ElementKind::Strut => 0,
                ElementKind::Cable => 1,
                ElementKind::Spring => 2,
                ElementKind::Prismatic => 5,
                ElementKind::Bar => 6,
            },
            dash: 0,
        }
    };
    (0..lines.len()).map(look).collect()
}

const fn is_rigid(kind: ElementKind) -> bool {
    !matches!(kind, ElementKind::Cable | ElementKind::Spring)
}

fn plural(kind: ElementKind) -> String {
    match kind {
        ElementKind::Prismatic => "prismatic struts".to_owned(),
        kind => format!("{}s", kind.keyword()),
    }
}

/// The ends of the ranges, those of one value together.
struct Limits {
    /// Near the values: label and value.
    near: Vec<(String, f64)>,
    /// Too far away to be drawn without flattening the values.
    far: Vec<String>,
}

impl Limits {
    fn new(structure: &Structure, lines: &[Line], what: &str) -> Self {
        const MOST: usize = 8;
        let values = || lines.iter().flat_map(|line| line.values.iter().copied());
        let lo = values().fold(f64::INFINITY, f64::min);
        let hi = values().fold(f64::NEG_INFINITY, f64::max);
        let room = 0.6 * (hi - lo).max(0.05 * hi.abs().max(lo.abs()));

        let mut limits: Vec<(f64, char, Vec<usize>)> = Vec::new();
        for line in lines {
            for (value, sign) in [(line.range.lo, '≥'), (line.range.hi, '≤')] {
                // Zero has its line in every chart.
                if !value.is_finite() || value == 0.0 {
                    continue;
                }
                let known = limits
                    .iter_mut()
                    .find(|(v, s, _)| *v == value && *s == sign);
                match known {
                    Some((.., elements)) => elements.push(line.element),
                    None => limits.push((value, sign, vec![line.element])),
                }
            }
        }
        limits.sort_by(|a, b| a.0.total_cmp(&b.0));

        let mut found = Self {
            near: Vec::new(),
            far: Vec::new(),
        };
        for (value, sign, elements) in limits {
            let whose = whose(structure, lines, &elements);
            let label = format!("{whose} {sign} {}", figure(value));
            match (lo - room..=hi + room).contains(&value) {
                true => found.near.push((label, value)),
                false => found.far.push(label),
            }
        }
        if found.near.len() + found.far.len() > MOST {
            found.near.clear();
            found.far = vec![format!(
                "the ranges of {what}, which differ between elements"
            )];
        }
        found
    }
}

/// The elements by kind where they are all of it, else by name where they are
/// few.
fn whose(structure: &Structure, lines: &[Line], elements: &[usize]) -> String {
    let kind = |element: usize| structure.elements[element].kind;
    let mut names: Vec<String> = Vec::new();
    let mut counted: Vec<ElementKind> = Vec::new();
    for &element in elements {
        let of_kind = |other: &usize| kind(*other) == kind(element);
        let here = elements.iter().filter(|other| of_kind(other)).count();
        let all = lines.iter().filter(|line| of_kind(&line.element)).count();
        if here == 1 || (here < all && here <= 3) {
            names.push(structure.elements[element].name.clone());
        } else if !counted.contains(&kind(element)) {
            counted.push(kind(element));
            names.push(match here == all {
                true => plural(kind(element)),
                false => format!("{here} {}", plural(kind(element))),
            });
        }
    }
    names.join(", ")
}

/// Draws paths in the space of three quantities, start and goal marked: the
/// same motion before and after smoothing, for instance.
///
/// # Errors
/// [`PictureError`] when a path is empty or does not fit the structure, or a
/// configuration has no value for a quantity.
pub fn draw_paths(
    structure: &Structure,
    paths: &[(&str, &Path)],
    quantities: [Quantity; 3],
    units: &Units,
) -> Result<Picture, PictureError> {
    let mut plot = SpacePlot::new(quantities.map(|quantity| quantity.axis(structure, units)));
    for (label, path) in paths {
        check_path_of(structure, path)?;
        let points = path
            .configurations
            .iter()
            .map(|configuration| point_of(structure, configuration, quantities, units))
            .collect::<Result<Vec<_>, _>>()?;
        plot = plot.curve(Curve::path(*label, points));
    }
    plot.draw()
}

fn point_of(
    structure: &Structure,
    configuration: &Configuration,
    quantities: [Quantity; 3],
    units: &Units,
) -> Result<[f64; 3], PictureError> {
    let mut point = [0.0; 3];
    for (value, quantity) in point.iter_mut().zip(quantities) {
        *value = quantity
            .value(configuration)
            .ok_or_else(|| PictureError::NoValue(quantity.axis(structure, units).title()))?;
    }
    Ok(point)
}
