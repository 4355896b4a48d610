//! A walk as an MCAP log, for Foxglove and other programs that read its schemas.
//!
//! Topics:
//! - `/environment`: ground, obstacles and waypoints, once, as `foxglove.SceneUpdate`;
//! - `/robot`: members, nodes, centre of mass and support polygon, as `foxglove.SceneUpdate`:
//!   at each configuration, and during rolls between them;
//! - `/lengths`: one JSON object with the length of each member, named by its nodes;
//! - `/support`: one JSON object with the nodes that carry the robot and the centre of mass.
//!
//! All steps take the same time, as in the cost of equation (40) of Usevitch et al.; a roll takes
//! as long as so many steps as it has frames.

use std::path::Path;

use foxglove::messages::{Color, LinePrimitive, SceneEntity, SceneUpdate, line_primitive};
use nalgebra::{Isometry3, Point3};
use serde_json::{Map, Value, json};
use tensegra_lar::{Dimension, Walk};

use super::{Frame, Frames, frame};
use crate::{
    atomic::write_atomic,
    geometry::Bounds,
    log::{
        DARK, Log, LogError, LogOptions, NANOSECONDS, OBSTACLE, WORLD, ball, cylinder, entity,
        point, pose, triangles, update,
    },
};

/// Frames between the configurations before and after a roll.
const ROLL_FRAMES: usize = 12;

const MEMBER: Color = Color {
    r: 0.0,
    g: 0.447,
    b: 0.698,
    a: 1.0,
};
const CENTRE: Color = Color {
    r: 0.835,
    g: 0.369,
    b: 0.0,
    a: 1.0,
};
const SUPPORT: Color = Color {
    r: 0.0,
    g: 0.62,
    b: 0.451,
    a: 0.5,
};
const GROUND: Color = Color {
    r: 0.9,
    g: 0.9,
    b: 0.88,
    a: 0.6,
};

/// Writes a walk as an MCAP file, whole or not at all.
///
/// # Errors
/// [`LogError`] when the walk's lists do not fit together, the duration is out of range, or the
/// file cannot be written.
pub fn write_walk_log(file: &Path, walk: &Walk, options: &LogOptions) -> Result<(), LogError> {
    Ok(write_atomic(file, &encode_walk_log(walk, options)?)?)
}

/// The bytes of the MCAP file of a walk.
///
/// # Errors
/// [`LogError`] when the walk's lists do not fit together or the duration is out of range.
pub fn encode_walk_log(walk: &Walk, options: &LogOptions) -> Result<Vec<u8>, LogError> {
    options.check()?;
    let shown = Frames::of(walk)?;
    let names: Vec<String> = shown
        .members
        .iter()
        .map(|&[a, b]| format!("{}-{}", walk.nodes[a], walk.nodes[b]))
        .collect();
    let style = Style::of(walk, &shown);

    let mut log = Log::new()?;
    let environment = log.protobuf_channel::<SceneUpdate>("/environment")?;
    let robot = log.protobuf_channel::<SceneUpdate>("/robot")?;
    let numbers: Map<String, Value> = names
        .iter()
        .map(|name| (name.clone(), json!({"type": "number"})))
        .collect();
    let schema = json!({"type": "object", "title": "tensegra.Lengths", "properties": numbers});
    let lengths = log.json_channel("/lengths", "tensegra.Lengths", &schema)?;
    let schema = json!({
        "type": "object",
        "title": "tensegra.Support",
        "properties": {
            "nodes": {"type": "array", "items": {"type": "string"}},
            "centre_of_mass": {
                "type": "object",
                "properties": {
                    "x": {"type": "number"}, "y": {"type": "number"}, "z": {"type": "number"}
                },
            },
        },
    });
    let support = log.json_channel("/support", "tensegra.Support", &schema)?;

    log.write_protobuf(environment, 0, &update(style.surroundings(walk)))?;
    let last = (shown.frames.len() - 1) as f64 + (walk.rolls.len() * ROLL_FRAMES) as f64;
    let mut tick = 0_usize;
    let time_of = |tick: &mut usize| {
        let time = *tick as f64 / last.max(1.0) * options.duration * NANOSECONDS;
        *tick += 1;
        time.round() as u64
    };
    for (index, here) in shown.frames.iter().enumerate() {
        let time = time_of(&mut tick);
        let scene = style.robot(&shown.members, here, time);
        log.write_protobuf(robot, time, &update(vec![scene]))?;
        let message: Map<String, Value> = names
            .iter()
            .zip(&walk.configurations[index].lengths)
            .map(|(name, length)| (name.clone(), json!(length)))
            .collect();
        log.write(lengths, time, Value::Object(message).to_string().as_bytes())?;
        let nodes: Vec<&String> = here.support.iter().map(|&node| &walk.nodes[node]).collect();
        let [x, y, z] = [here.centre.x, here.centre.y, here.centre.z];
        let message = json!({"nodes": nodes, "centre_of_mass": {"x": x, "y": y, "z": z}});
        log.write(support, time, message.to_string().as_bytes())?;
        if !walk.rolls.contains(&index) {
            continue;
        }
        for step in 1..=ROLL_FRAMES {
            let fraction = step as f64 / (ROLL_FRAMES + 1) as f64;
            let time = time_of(&mut tick);
            let Some(positions) = walk.positions_between(index, fraction) else {
                continue;
            };
            // During a roll the robot stands on the nodes that stay.
            let after = &shown.frames[index + 1].support;
            let mut pivots = here.support.clone();
            pivots.retain(|node| after.contains(node));
            let positions = positions.into_iter().map(Point3::from).collect();
            let scene = style.robot(&shown.members, &frame(walk, positions, pivots), time);
            log.write_protobuf(robot, time, &update(vec![scene]))?;
        }
    }
    log.finish()
}

/// Sizes of what is drawn, the same for the whole walk.
struct Style {
    bounds: Bounds,
    member: f64,
    node: f64,
}

impl Style {
    fn of(walk: &Walk, shown: &Frames) -> Self {
        // As thick as members may be without touching, but never out of proportion.
        let thickest = 0.12 * walk.limits.max_length.min(1.0);
        let member = (0.4 * walk.limits.min_distance).min(thickest);
        let points = shown.frames.iter().flat_map(|frame| frame.positions.iter());
        let bounds = Bounds::around(points.copied()).unwrap_or(Bounds {
            min: Point3::origin(),
            max: Point3::origin(),
        });
        Self {
            bounds,
            member,
            node: 1.6 * member,
        }
    }

    fn robot(&self, members: &[[usize; 2]], frame: &Frame, time: u64) -> SceneEntity {
        let mut entity = entity("robot", WORLD, time);
        for &[a, b] in members {
            let ends = [frame.positions[a], frame.positions[b]];
            entity.cylinders.push(cylinder(ends, self.member, MEMBER));
        }
        for (node, position) in frame.positions.iter().enumerate() {
            let color = if frame.support.contains(&node) {
                Color { a: 1.0, ..SUPPORT }
            } else {
                DARK
            };
            entity.spheres.push(ball(position, self.node, color));
        }
        entity
            .spheres
            .push(ball(&frame.centre, 1.3 * self.node, CENTRE));
        let corners = frame.support_corners();
        if corners.len() > 2 {
            // Both sides, so that it is seen from below as well.
            let under: Vec<Point3<f64>> = corners.iter().rev().copied().collect();
            entity.triangles.push(triangles([corners, under], SUPPORT));
        }
        // A plumb line tells where the weight acts.
        let foot = Point3::new(frame.centre.x, frame.centre.y, 0.0);
        entity.lines.push(LinePrimitive {
            r#type: line_primitive::Type::LineStrip as i32,
            pose: Some(pose(&Isometry3::identity())),
            thickness: 0.3 * self.member,
            points: vec![point(&frame.centre), point(&foot)],
            color: Some(CENTRE),
            ..LinePrimitive::default()
        });
        entity
    }

    /// Ground, obstacles and waypoints.
    fn surroundings(&self, walk: &Walk) -> Vec<SceneEntity> {
        let mut ground = entity("ground", WORLD, 0);
        let reach = 0.1 * self.bounds.diagonal();
        let (low, high) = (self.bounds.min, self.bounds.max);
        let corner = |x: f64, y: f64| Point3::new(x, y, -0.5 * self.node);
        ground.triangles.push(triangles(
            [vec![
                corner(low.x - reach, low.y - reach),
                corner(high.x + reach, low.y - reach),
                corner(high.x + reach, high.y + reach),
                corner(low.x - reach, high.y + reach),
            ]],
            GROUND,
        ));
        let mut entities = vec![ground];
        let height = 0.5 * self.bounds.max.z;
        for (index, obstacle) in walk.obstacles.iter().enumerate() {
            let at = |z: f64| -> Vec<Point3<f64>> {
                let corners = obstacle.corners().iter();
                corners.map(|p| Point3::new(p.x, p.y, z)).collect()
            };
            let (floor, top) = (at(0.0), at(height));
            let count = floor.len();
            let sides = (0..count).map(|k| {
                let next = (k + 1) % count;
                vec![floor[k], floor[next], top[next], top[k]]
            });
            let faces: Vec<Vec<Point3<f64>>> = sides.chain([top.clone()]).collect();
            let mut shape = entity(&format!("obstacle {index}"), WORLD, 0);
            shape.triangles.push(triangles(faces, OBSTACLE));
            entities.push(shape);
        }
        for (index, &[x, y]) in walk.waypoints.iter().enumerate() {
            let y = match walk.dimension {
                Dimension::Two => 0.0,
                Dimension::Three => y,
            };
            let mut mark = entity(&format!("waypoint {index}"), WORLD, 0);
            mark.spheres
                .push(ball(&Point3::new(x, y, 0.0), 1.5 * self.node, CENTRE));
            entities.push(mark);
        }
        entities
    }
}
