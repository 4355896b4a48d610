//! Logs are read back with the readers of other tools.

#[allow(dead_code)] // each test uses a part of it
#[path = "../examples/gallery/data.rs"]
mod data;

use std::collections::BTreeMap;

use foxglove::{
    Decode,
    messages::{FrameTransforms, SceneUpdate},
};
use serde_json::Value;
use tensegra_io::{LogError, LogOptions, encode_log, write_log};

/// Messages by topic: time and bytes of each.
type Messages = BTreeMap<String, Vec<(u64, Vec<u8>)>>;

fn messages(bytes: &[u8]) -> Messages {
    let mut messages = Messages::new();
    for message in mcap::MessageStream::new(bytes).unwrap() {
        let message = message.unwrap();
        messages
            .entry(message.channel.topic.clone())
            .or_default()
            .push((message.log_time, message.data.into_owned()));
    }
    messages
}

fn scene((_, bytes): &(u64, Vec<u8>)) -> SceneUpdate {
    SceneUpdate::decode(bytes.as_slice()).unwrap()
}

#[test]
fn a_log_holds_the_whole_motion() {
    let (problem, path) = data::prism();
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("prism.mcap");
    write_log(&file, &problem, &path, &LogOptions::default().duration(4.0)).unwrap();
    let bytes = std::fs::read(&file).unwrap();
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let topics: BTreeMap<&str, &str> = summary
        .channels
        .values()
        .map(|channel| {
            let schema = channel.schema.as_ref().unwrap();
            (channel.topic.as_str(), schema.name.as_str())
        })
        .collect();
    let expected = [
        ("/attachments", "foxglove.SceneUpdate"),
        ("/environment", "foxglove.SceneUpdate"),
        ("/forces", "tensegra.Forces"),
        ("/lengths", "tensegra.Lengths"),
        ("/rest_lengths", "tensegra.RestLengths"),
        ("/structure", "foxglove.SceneUpdate"),
        ("/tf", "foxglove.FrameTransforms"),
    ];
    assert_eq!(topics.into_iter().collect::<Vec<_>>(), expected);

    let messages = messages(&bytes);
    let structure = &messages["/structure"];
    assert_eq!(structure.len(), path.configurations.len());
    assert!(structure.windows(2).all(|pair| pair[0].0 < pair[1].0));
    assert_eq!(
        (structure[0].0, structure.last().unwrap().0),
        (0, 4_000_000_000)
    );
    for (message, configuration) in structure.iter().zip(&path.configurations) {
        let update = scene(message);
        let [entity] = update.entities.as_slice() else {
            panic!("one entity, replaced at each time");
        };
        assert_eq!(
            (entity.frame_id.as_str(), entity.id.as_str()),
            ("world", "structure")
        );
        // Three struts and a telescopic one, eight cables and a spring.
        assert_eq!([entity.cylinders.len(), entity.lines.len()], [4, 9]);
        assert_eq!(entity.spheres.len(), configuration.positions.len());
        let center = entity.spheres[1].pose.as_ref().unwrap().position.unwrap();
        assert_eq!(center.x, configuration.positions[1].x);
    }

    let shapes = scene(&messages["/environment"][0]);
    let count = |shape: fn(&foxglove::messages::SceneEntity) -> usize| {
        shapes.entities.iter().map(shape).sum::<usize>()
    };
    assert_eq!(shapes.entities.len(), problem.environment.obstacles.len());
    assert_eq!(count(|e| e.cubes.len()), 1);
    assert_eq!(count(|e| e.spheres.len()), 1);
    assert_eq!(count(|e| e.cylinders.len()), 1);
    // The floor (2 triangles), the wedge (8) and the ring (768).
    assert_eq!(
        count(|e| e.triangles.iter().map(|t| t.points.len()).sum()),
        3 * 778
    );

    for ((_, bytes), configuration) in messages["/forces"].iter().zip(&path.configurations) {
        let forces: Value = serde_json::from_slice(bytes).unwrap();
        for (element, force) in problem.structure.elements.iter().zip(&configuration.forces) {
            assert_eq!(forces[&element.name].as_f64(), *force);
        }
    }
    let rest: Value = serde_json::from_slice(&messages["/rest_lengths"][0].1).unwrap();
    assert!(rest.get("strut1").is_none() && rest.get("base1").is_some());
}

#[test]
fn cylinders_run_from_node_to_node() {
    let (problem, path) = data::prism();
    let bytes = encode_log(&problem, &path, &LogOptions::default()).unwrap();
    let update = scene(&messages(&bytes)["/structure"][5]);
    let cylinder = &update.entities[0].cylinders[0];
    let (pose, size) = (
        cylinder.pose.as_ref().unwrap(),
        cylinder.size.as_ref().unwrap(),
    );
    let (at, turn) = (pose.position.unwrap(), pose.orientation.unwrap());
    let turn = nalgebra::Quaternion::new(turn.w, turn.x, turn.y, turn.z);
    let turn = nalgebra::UnitQuaternion::from_quaternion(turn);
    let half = turn * nalgebra::Vector3::new(0.0, 0.0, 0.5 * size.z);
    let center = nalgebra::Point3::new(at.x, at.y, at.z);
    let nodes = problem.structure.elements[0].nodes;
    let ends = nodes.map(|node| path.configurations[5].positions[node]);
    assert!((center - half - ends[0]).norm() < 1e-12);
    assert!((center + half - ends[1]).norm() < 1e-12);
}

#[test]
fn attached_bodies_move_with_their_nodes() {
    let (problem, path) = data::prism();
    let bytes = encode_log(&problem, &path, &LogOptions::default()).unwrap();
    let messages = messages(&bytes);
    let body = &scene(&messages["/attachments"][0]).entities[0];
    assert_eq!(
        (body.frame_id.as_str(), body.frame_locked),
        ("platform", true)
    );
    let attachment = &problem.structure.attachments[0];
    for ((_, bytes), configuration) in messages["/tf"].iter().zip(&path.configurations) {
        let transforms = FrameTransforms::decode(bytes.as_slice())
            .unwrap()
            .transforms;
        let transform = &transforms[0];
        assert_eq!(transform.child_frame_id, "platform");
        let (t, r) = (transform.translation.unwrap(), transform.rotation.unwrap());
        let rotation = nalgebra::Quaternion::new(r.w, r.x, r.y, r.z);
        let rotation = nalgebra::UnitQuaternion::from_quaternion(rotation);
        let translation = nalgebra::Vector3::new(t.x, t.y, t.z);
        for anchor in &attachment.anchors {
            let place = rotation * anchor.local + translation;
            let node = configuration.positions[anchor.node];
            assert!((place - node).norm() < 1e-9, "{place} {node}");
        }
    }
}

#[test]
fn forces_decide_the_colours() {
    let (problem, mut path) = data::kite();
    path.configurations.truncate(1);
    let forces = &mut path.configurations[0].forces;
    *forces = vec![Some(0.0); forces.len()];
    forces[0] = Some(-2.0);
    forces[3] = Some(3.0);
    let bytes = encode_log(&problem, &path, &LogOptions::default()).unwrap();
    let entity = &scene(&messages(&bytes)["/structure"][0]).entities[0];
    let compressed = entity.cylinders[0].color.unwrap();
    let tensed = entity.lines[0].color.unwrap();
    let [idle, slack] = [
        entity.cylinders[1].color.unwrap(),
        entity.lines[1].color.unwrap(),
    ];
    assert!(compressed.b > 2.0 * compressed.r + 0.3, "blue");
    assert!(tensed.r > 2.0 * tensed.g && tensed.b == 0.0, "orange");
    assert_eq!(idle, slack);
    assert_eq!((idle.r, idle.g), (idle.b, idle.b), "grey");
}

#[test]
fn a_log_follows_from_its_input_alone() {
    let (problem, path) = data::kite();
    let encode = || encode_log(&problem, &path, &LogOptions::default()).unwrap();
    assert_eq!(encode(), encode());
}

#[test]
fn bad_input_is_refused() {
    let (problem, mut path) = data::kite();
    for duration in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e12] {
        let failure = encode_log(&problem, &path, &LogOptions::default().duration(duration));
        assert!(matches!(failure, Err(LogError::Duration(_))));
    }
    path.configurations[1].positions.pop();
    let failure = encode_log(&problem, &path, &LogOptions::default()).unwrap_err();
    assert!(
        failure
            .to_string()
            .contains("configuration 1 has 4 positions"),
        "{failure}"
    );
}
