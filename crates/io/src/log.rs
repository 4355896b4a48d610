//! A motion as an MCAP log: the scene moves with time in Foxglove and in other
//! programs that read its schemas, and the series of lengths, rest lengths and
//! forces can be plotted there.
//!
//! Topics:
//! - `/environment`: the obstacles, once, as `foxglove.SceneUpdate`;
//! - `/structure`: elements and nodes at each configuration, as
//!   `foxglove.SceneUpdate`, coloured by force: from grey through blue in
//!   compression, through orange in tension;
//! - `/attachments` and `/tf`: rigid bodies glued to nodes, once, each in a
//!   frame of its own name, and the poses of these frames at each
//!   configuration, as `foxglove.FrameTransforms`; nothing where there are none;
//! - `/lengths`, `/rest_lengths`, `/forces`: one JSON object with a member for
//!   each element, at each configuration.
//!
//! A log is a function of its input alone: same path, same bytes.

use std::{collections::BTreeMap, f64::consts::PI, io::Cursor, path::Path as FilePath};

use foxglove::{
    Encode,
    messages::{
        Color, CubePrimitive, CylinderPrimitive, FrameTransform, FrameTransforms, LinePrimitive,
        Point3, Pose, Quaternion, SceneEntity, SceneUpdate, SpherePrimitive, Timestamp,
        TriangleListPrimitive, Vector3, line_primitive,
    },
};
use mcap::{Compression, WriteOptions, Writer, records::MessageHeader};
use nalgebra as na;
use serde_json::{Map, Value, json};
use tensegra_model::{Configuration, ElementKind, Path, Problem, Role, Shape, Structure};

use crate::{
    atomic::{WriteError, write_atomic},
    consistency::{PathMismatch, check_path_of},
    geometry::{Bounds, attachment_pose, parameters_along, perpendicular, prism_faces},
};

pub(crate) const WORLD: &str = "world";
pub(crate) const NANOSECONDS: f64 = 1e9;

/// How a motion is logged.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct LogOptions {
    /// Time from start to goal, in seconds. Default 10.
    pub duration: f64,
}

impl Default for LogOptions {
    fn default() -> Self {
        Self { duration: 10.0 }
    }
}

impl LogOptions {
    /// These options with another time from start to goal, in seconds.
    pub fn duration(mut self, seconds: f64) -> Self {
        self.duration = seconds;
        self
    }

    pub(crate) fn check(&self) -> Result<(), LogError> {
        match self.duration > 0.0 && self.duration < 4e9 {
            true => Ok(()),
            false => Err(LogError::Duration(self.duration)),
        }
    }
}

/// Why a log was not made or not written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LogError {
    /// The path does not fit the structure.
    #[error(transparent)]
    Path(#[from] PathMismatch),
    /// The lists of a walk do not fit together.
    #[error(transparent)]
    Walk(#[from] crate::walk::WalkMismatch),
    /// The duration is not a positive number of seconds, or longer than a log
    /// can count (2³² s).
    #[error("a log cannot last {0} s; give a duration above 0 and below 4e9 s")]
    Duration(f64),
    /// A part of the log cannot be encoded.
    #[error("the log cannot be encoded: {0}")]
    Encoding(String),
    /// The file cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}

impl From<mcap::McapError> for LogError {
    fn from(failure: mcap::McapError) -> Self {
        Self::Encoding(failure.to_string())
    }
}

/// Writes the motion as an MCAP file, whole or not at all.
///
/// # Errors
/// [`LogError`] when the path does not fit the structure, the duration is out
/// of range, or the file cannot be written.
pub fn write_log(
    file: &FilePath,
    problem: &Problem,
    path: &Path,
    options: &LogOptions,
) -> Result<(), LogError> {
    Ok(write_atomic(file, &encode_log(problem, path, options)?)?)
}

/// The bytes of the MCAP file of a motion.
///
/// # Errors
/// [`LogError`] when the path does not fit the structure or the duration is out
/// of range.
pub fn encode_log(
    problem: &Problem,
    path: &Path,
    options: &LogOptions,
) -> Result<Vec<u8>, LogError> {
    let structure = &problem.structure;
    check_path_of(structure, path)?;
    options.check()?;
    // A path that passed the check has a configuration.
    let (Some(style), Some(first)) = (Style::new(structure, path), path.configurations.first())
    else {
        return Err(PathMismatch::Empty.into());
    };

    let mut log = Log::new()?;
    let environment = log.protobuf_channel::<SceneUpdate>("/environment")?;
    let scene = log.protobuf_channel::<SceneUpdate>("/structure")?;
    let mut series = Vec::new();
    for kind in Series::ALL {
        let schema = kind.schema(structure, first);
        let channel = log.json_channel(kind.topic(), kind.schema_name(), &schema)?;
        series.push((kind, channel));
    }

    log.write_protobuf(environment, 0, &update(obstacles(problem, style.bounds)))?;
    let mut frames = None;
    if !structure.attachments.is_empty() {
        let bodies = log.protobuf_channel::<SceneUpdate>("/attachments")?;
        log.write_protobuf(bodies, 0, &update(attachments(structure, style.bounds)))?;
        frames = Some(log.protobuf_channel::<FrameTransforms>("/tf")?);
    }
    for (configuration, parameter) in path.configurations.iter().zip(parameters_along(path)) {
        let time = (parameter * options.duration * NANOSECONDS).round() as u64;
        if let Some(frames) = frames {
            log.write_protobuf(frames, time, &transforms(structure, configuration, time))?;
        }
        let entity = style.entity(structure, configuration, time);
        log.write_protobuf(scene, time, &update(vec![entity]))?;
        for (kind, channel) in &series {
            let message = Value::Object(kind.message(structure, configuration));
            log.write(*channel, time, message.to_string().as_bytes())?;
        }
    }
    log.finish()
}

/// An MCAP file in the making.
pub(crate) struct Log {
    writer: Writer<Cursor<Vec<u8>>>,
    sequence: u32,
}

impl Log {
    pub(crate) fn new() -> Result<Self, LogError> {
        let options = WriteOptions::new()
            .compression(Some(Compression::Zstd))
            // Blocks cut by several threads would depend on their number.
            .compression_threads(0)
            .library(concat!("tensegra ", env!("CARGO_PKG_VERSION")));
        Ok(Self {
            writer: options.create(Cursor::new(Vec::new()))?,
            sequence: 0,
        })
    }

    pub(crate) fn protobuf_channel<T: Encode>(&mut self, topic: &str) -> Result<u16, LogError> {
        let schema = T::get_schema()
            .ok_or_else(|| LogError::Encoding(format!("no schema for the topic {topic}")))?;
        let schema = self
            .writer
            .add_schema(&schema.name, &schema.encoding, &schema.data)?;
        let encoding = T::get_message_encoding();
        Ok(self
            .writer
            .add_channel(schema, topic, &encoding, &BTreeMap::new())?)
    }

    pub(crate) fn json_channel(
        &mut self,
        topic: &str,
        name: &str,
        schema: &Value,
    ) -> Result<u16, LogError> {
        let schema = self
            .writer
            .add_schema(name, "jsonschema", schema.to_string().as_bytes())?;
        Ok(self
            .writer
            .add_channel(schema, topic, "json", &BTreeMap::new())?)
    }

    pub(crate) fn write_protobuf<T: Encode>(
        &mut self,
        channel: u16,
        time: u64,
        message: &T,
    ) -> Result<(), LogError> {
        let mut bytes = Vec::with_capacity(message.encoded_len().unwrap_or_default());
        message
            .encode(&mut bytes)
            .map_err(|failure| LogError::Encoding(failure.to_string()))?;
        self.write(channel, time, &bytes)
    }

    pub(crate) fn write(&mut self, channel: u16, time: u64, bytes: &[u8]) -> Result<(), LogError> {
        self.sequence = self.sequence.wrapping_add(1);
        let header = MessageHeader {
            channel_id: channel,
            sequence: self.sequence,
            log_time: time,
            publish_time: time,
        };
        Ok(self.writer.write_to_known_channel(&header, bytes)?)
    }

    pub(crate) fn finish(mut self) -> Result<Vec<u8>, LogError> {
        self.writer.finish()?;
        Ok(self.writer.into_inner().into_inner())
    }
}

/// A quantity of the elements that is logged as a series of numbers.
#[derive(Clone, Copy)]
enum Series {
    Lengths,
    RestLengths,
    Forces,
}

impl Series {
    const ALL: [Self; 3] = [Self::Lengths, Self::RestLengths, Self::Forces];

    const fn topic(self) -> &'static str {
        match self {
            Self::Lengths => "/lengths",
            Self::RestLengths => "/rest_lengths",
            Self::Forces => "/forces",
        }
    }

    const fn schema_name(self) -> &'static str {
        match self {
            Self::Lengths => "tensegra.Lengths",
            Self::RestLengths => "tensegra.RestLengths",
            Self::Forces => "tensegra.Forces",
        }
    }

    /// A JSON schema with a number for each element that has the quantity.
    fn schema(self, structure: &Structure, first: &Configuration) -> Value {
        let properties: Map<String, Value> = self
            .message(structure, first)
            .into_iter()
            .map(|(name, _)| (name, json!({"type": "number"})))
            .collect();
        json!({"type": "object", "title": self.schema_name(), "properties": properties})
    }

    fn message(self, structure: &Structure, configuration: &Configuration) -> Map<String, Value> {
        let value = |element: usize| match self {
            Self::Lengths => Some(configuration.lengths[element]),
            Self::RestLengths => configuration.rest_lengths[element],
            Self::Forces => configuration.forces[element],
        };
        structure
            .elements
            .iter()
            .enumerate()
            .filter_map(|(index, element)| Some((element.name.clone(), json!(value(index)?))))
            .collect()
    }
}

/// What decides the look of the structure, the same for the whole motion.
struct Style {
    bounds: Bounds,
    strongest_tension: f64,
    strongest_compression: f64,
    node_diameter: f64,
    least_diameter: f64,
}

impl Style {
    fn new(structure: &Structure, path: &Path) -> Option<Self> {
        let positions = path.configurations.iter().flat_map(|c| c.positions.iter());
        let bounds = Bounds::around(positions.copied())?;
        let forces = path.configurations.iter().flat_map(|c| c.forces.iter());
        let (least, greatest) = forces
            .flatten()
            .fold((0.0_f64, 0.0_f64), |(least, greatest), &force| {
                (least.min(force), greatest.max(force))
            });
        // Thin enough not to hide anything, thick enough to be seen, whatever
        // the units.
        let least_diameter = 0.003 * bounds.diagonal();
        let thickest = structure.elements.iter().map(|element| element.radius);
        Some(Self {
            bounds,
            strongest_tension: greatest,
            strongest_compression: -least,
            node_diameter: thickest.fold(1.5 * least_diameter, f64::max) * 2.2,
            least_diameter,
        })
    }

    fn color(&self, force: Option<f64>) -> Color {
        const NEUTRAL: [f64; 3] = [0.75, 0.75, 0.75];
        const TENSION: [f64; 3] = [0.835, 0.369, 0.0];
        const COMPRESSION: [f64; 3] = [0.0, 0.447, 0.698];
        let force = force.unwrap_or_default();
        let (end, strongest) = match force > 0.0 {
            true => (TENSION, self.strongest_tension),
            false => (COMPRESSION, self.strongest_compression),
        };
        let share = match strongest > 0.0 {
            true => force.abs() / strongest,
            false => 0.0,
        };
        let [r, g, b] = std::array::from_fn(|c| NEUTRAL[c] + share * (end[c] - NEUTRAL[c]));
        Color { r, g, b, a: 1.0 }
    }

    /// Struts, bars and prismatic struts as cylinders, cables and springs as
    /// lines, nodes as balls.
    fn entity(
        &self,
        structure: &Structure,
        configuration: &Configuration,
        time: u64,
    ) -> SceneEntity {
        let mut entity = entity("structure", WORLD, time);
        let forces = &configuration.forces;
        for (element, force) in structure.elements.iter().zip(forces) {
            if element.appearance.role == Role::Hidden {
                continue;
            }
            let ends = element.nodes.map(|node| configuration.positions[node]);
            let diameter = (2.0 * element.radius).max(self.least_diameter);
            let color = self.color(*force);
            match element.kind {
                ElementKind::Strut | ElementKind::Bar | ElementKind::Prismatic => {
                    entity.cylinders.push(cylinder(ends, diameter, color))
                }
                ElementKind::Cable | ElementKind::Spring => entity.lines.push(LinePrimitive {
                    r#type: line_primitive::Type::LineStrip as i32,
                    pose: Some(pose(&na::Isometry3::identity())),
                    thickness: diameter,
                    points: ends.map(|end| point(&end)).to_vec(),
                    color: Some(color),
                    ..LinePrimitive::default()
                }),
            }
        }
        entity.spheres = configuration
            .positions
            .iter()
            .map(|position| ball(position, self.node_diameter, DARK))
            .collect();
        entity
    }
}

pub(crate) const DARK: Color = Color {
    r: 0.2,
    g: 0.2,
    b: 0.2,
    a: 1.0,
};
pub(crate) const OBSTACLE: Color = Color {
    r: 0.6,
    g: 0.6,
    b: 0.6,
    a: 0.6,
};
const ATTACHMENT: Color = Color {
    r: 0.35,
    g: 0.5,
    b: 0.6,
    a: 0.9,
};

fn obstacles(problem: &Problem, bounds: Bounds) -> Vec<SceneEntity> {
    let shown = problem.environment.obstacles.iter();
    shown
        .filter(|obstacle| obstacle.role != Role::Hidden)
        .map(|obstacle| {
            let mut entity = entity(&format!("obstacle {}", obstacle.name), WORLD, 0);
            add_shape(&mut entity, &obstacle.shape, OBSTACLE, bounds);
            entity
        })
        .collect()
}

fn attachments(structure: &Structure, bounds: Bounds) -> Vec<SceneEntity> {
    structure
        .attachments
        .iter()
        .map(|attachment| {
            let id = format!("attachment {}", attachment.name);
            let mut entity = entity(&id, &attachment.name, 0);
            entity.frame_locked = true;
            for part in &attachment.shapes {
                if part.role != Role::Hidden {
                    add_shape(&mut entity, &part.shape, ATTACHMENT, bounds);
                }
            }
            entity
        })
        .collect()
}

fn transforms(structure: &Structure, configuration: &Configuration, time: u64) -> FrameTransforms {
    let transforms = structure
        .attachments
        .iter()
        .filter_map(|attachment| {
            let pose = attachment_pose(&attachment.anchors, &configuration.positions)?;
            Some(FrameTransform {
                timestamp: Some(timestamp(time)),
                parent_frame_id: WORLD.to_owned(),
                child_frame_id: attachment.name.clone(),
                translation: Some(vector(&pose.translation.vector)),
                rotation: Some(quaternion(&pose.rotation)),
            })
        })
        .collect();
    FrameTransforms { transforms }
}

fn add_shape(entity: &mut SceneEntity, shape: &Shape, color: Color, bounds: Bounds) {
    match shape {
        Shape::Box { min, max } => entity.cubes.push(CubePrimitive {
            pose: Some(pose(
                &na::Translation3::from(na::center(min, max).coords).into(),
            )),
            size: Some(vector(&(max - min))),
            color: Some(color),
        }),
        Shape::Sphere { center, radius } => {
            entity.spheres.push(ball(center, 2.0 * radius, color));
        }
        Shape::Cylinder { p, q, radius } => {
            entity
                .cylinders
                .push(cylinder([*p, *q], 2.0 * radius, color));
        }
        Shape::Prism { corners, height } => {
            let faces = prism_faces(corners, *height).unwrap_or_default();
            entity.triangles.push(triangles(faces, color));
        }
        Shape::Mesh {
            vertices, faces, ..
        } => {
            let faces = faces
                .iter()
                .map(|face| face.iter().map(|&vertex| vertices[vertex]).collect());
            entity.triangles.push(triangles(faces, color));
        }
        Shape::HalfSpace { point, normal } => {
            entity
                .triangles
                .push(triangles(plane_patch(point, normal, bounds), color));
        }
    }
}

/// The part of a plane below and around what moves, as one square.
fn plane_patch(
    point: &na::Point3<f64>,
    normal: &na::Vector3<f64>,
    bounds: Bounds,
) -> Option<Vec<na::Point3<f64>>> {
    let normal = normal.try_normalize(0.0)?;
    let [first, second] = perpendicular(&normal);
    let center = na::center(&bounds.min, &bounds.max);
    let foot = center - normal * normal.dot(&(center - point));
    let reach = bounds.diagonal();
    let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
    Some(
        corners
            .map(|(a, b)| foot + (first * a + second * b) * reach)
            .to_vec(),
    )
}

pub(crate) fn update(entities: Vec<SceneEntity>) -> SceneUpdate {
    SceneUpdate {
        deletions: Vec::new(),
        entities,
    }
}

pub(crate) fn entity(id: &str, frame: &str, time: u64) -> SceneEntity {
    SceneEntity {
        timestamp: Some(timestamp(time)),
        frame_id: frame.to_owned(),
        id: id.to_owned(),
        ..SceneEntity::default()
    }
}

/// The cylinder between two points; Foxglove's stands upright around its centre.
pub(crate) fn cylinder(
    ends: [na::Point3<f64>; 2],
    diameter: f64,
    color: Color,
) -> CylinderPrimitive {
    let axis = ends[1] - ends[0];
    // Opposite directions have many rotations between them; any half turn does.
    let rotation = na::UnitQuaternion::rotation_between(&na::Vector3::z(), &axis)
        .unwrap_or_else(|| na::UnitQuaternion::from_axis_angle(&na::Vector3::x_axis(), PI));
    let center = na::Translation3::from(na::center(&ends[0], &ends[1]).coords);
    CylinderPrimitive {
        pose: Some(pose(&na::Isometry3::from_parts(center, rotation))),
        size: Some(Vector3 {
            x: diameter,
            y: diameter,
            z: axis.norm(),
        }),
        bottom_scale: 1.0,
        top_scale: 1.0,
        color: Some(color),
    }
}

pub(crate) fn ball(center: &na::Point3<f64>, diameter: f64, color: Color) -> SpherePrimitive {
    SpherePrimitive {
        pose: Some(pose(&na::Translation3::from(center.coords).into())),
        size: Some(vector(&na::Vector3::repeat(diameter))),
        color: Some(color),
    }
}

/// Convex polygons as a list of triangles.
pub(crate) fn triangles(
    polygons: impl IntoIterator<Item = Vec<na::Point3<f64>>>,
    color: Color,
) -> TriangleListPrimitive {
    let mut points = Vec::new();
    for polygon in polygons {
        let [first, rest @ ..] = polygon.as_slice() else {
            continue;
        };
        for side in rest.windows(2) {
            points.extend([first, &side[0], &side[1]].map(point));
        }
    }
    TriangleListPrimitive {
        pose: Some(pose(&na::Isometry3::identity())),
        points,
        color: Some(color),
        ..TriangleListPrimitive::default()
    }
}

fn timestamp(time: u64) -> Timestamp {
    // The range of the duration keeps the seconds within 32 bits.
    let seconds = u32::try_from(time / 1_000_000_000).unwrap_or(u32::MAX);
    Timestamp::new(seconds, (time % 1_000_000_000) as u32)
}

pub(crate) fn point(point: &na::Point3<f64>) -> Point3 {
    let [x, y, z] = point.coords.into();
    Point3 { x, y, z }
}

fn vector(vector: &na::Vector3<f64>) -> Vector3 {
    let [x, y, z] = (*vector).into();
    Vector3 { x, y, z }
}

fn quaternion(rotation: &na::UnitQuaternion<f64>) -> Quaternion {
    Quaternion {
        x: rotation.i,
        y: rotation.j,
        z: rotation.k,
        w: rotation.w,
    }
}

pub(crate) fn pose(isometry: &na::Isometry3<f64>) -> Pose {
    Pose {
        position: Some(vector(&isometry.translation.vector)),
        orientation: Some(quaternion(&isometry.rotation)),
    }
}
