//! Walks of truss robots as files, logs and pictures, read back.

use std::collections::BTreeMap;

use foxglove::{Decode, messages::SceneUpdate};
use nalgebra::Point2;
use serde_json::{Value, json};
use tensegra_io::{
    LogError, LogOptions, PictureError, TrackingRun, WalkReadError, draw_gait, draw_grid_plan,
    draw_margins, draw_track, draw_tracking_error, encode_walk_log, read_format, read_walk_file,
    write_walk_file, write_walk_log,
};
use tensegra_lar::{
    GridGoal, Limits, PlannedWalk, PrimitiveLibrary, PrimitiveOptions, TwoTierPlanner, Walk,
    WalkCheckOptions, WalkFacts, WalkProblem, check_walk, experiments::PublishedGait, plan_walk,
};

const K5: &str = "name = \"stroll\"\nplanner = \"greedy\"\nwaypoints = [[0.5, 0.2]]\n\
                  [robot]\npreset = \"k5\"\nnames = [\"a\", \"b\", \"c\", \"d\", \"e\"]\n";
const TRIANGLE: &str = "planner = \"greedy\"\nwaypoints = [[1.2]]\n[robot]\n\
                        nodes = [[0.0, 0.0], [1.0, 0.0], [0.5, 0.9]]\n\
                        edges = [[0, 1], [1, 2], [0, 2]]\nsupport = [0, 1]\n";

fn planned(text: &str) -> (WalkProblem, PlannedWalk) {
    let problem = WalkProblem::from_toml(text).unwrap();
    let planned = plan_walk(&problem).unwrap();
    let check = planned.walk.check.as_ref().unwrap();
    assert!(check.valid, "{:?}", check.faults);
    assert!(!planned.walk.rolls.is_empty());
    (problem, planned)
}

#[test]
fn the_schema_describes_what_is_written() {
    let schema: Value =
        serde_json::from_str(include_str!("../../../docs/walk.schema.json")).unwrap();
    let validator = jsonschema::validator_for(&schema).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("walk.json");
    let mut good = Value::Null;
    for text in [TRIANGLE, K5] {
        let (_, planned) = planned(text);
        write_walk_file(&file, &planned.walk).unwrap();
        assert_eq!(read_walk_file(&file).unwrap(), planned.walk);
        assert_eq!(read_format(&file).as_deref(), Some("tensegra-walk"));
        good = serde_json::from_slice(&std::fs::read(&file).unwrap()).unwrap();
        let errors = validator.iter_errors(&good).map(|e| e.to_string());
        assert_eq!(errors.collect::<Vec<_>>(), [""; 0]);
    }

    let page = include_str!("../../../docs/walk-file.md");
    let (_, example) = page.split_once("```json\n").unwrap();
    let (example, _) = example.split_once("```").unwrap();
    assert!(validator.is_valid(&serde_json::from_str(example).unwrap()));
    let walk = Walk::from_json(example).unwrap();
    let verdict = check_walk(&WalkFacts::of(&walk), &walk, &WalkCheckOptions::default());
    assert!(verdict.valid, "{:?}", verdict.faults);

    // It is no schema that lets everything pass.
    for (pointer, value) in [
        ("/format", json!("tensegra-path")),
        ("/version", json!(2)),
        ("/dimension", json!(4)),
        ("/edges/0", json!([0])),
        ("/limits/min_length", json!(null)),
        ("/visit", json!("soon")),
        ("/configurations", json!([])),
        ("/configurations/0/positions/0", json!(["low", 0.0, 1.0])),
        ("/configurations/0/support", json!([0, 0, 1])),
        ("/configurations/0/active", json!([{"kind": "luck"}])),
        ("/rolls", json!([-1])),
        ("/statistics/cost", json!(null)),
        ("/check/ok", json!("yes")),
    ] {
        let mut bad = good.clone();
        *bad.pointer_mut(pointer).unwrap() = value;
        assert!(!validator.is_valid(&bad), "{pointer}");
    }
}

#[test]
fn what_is_no_walk_is_refused_with_its_place() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("walk.json");
    assert_eq!(read_format(&file), None);
    let missing = read_walk_file(&file).unwrap_err();
    assert!(matches!(missing, WalkReadError::Unreadable { .. }));
    std::fs::write(&file, "{\"format\": \"tensegra-walk\",\n \"version\": }").unwrap();
    let syntax = read_walk_file(&file).unwrap_err().to_string();
    assert!(
        syntax.contains("walk.json") && syntax.contains("line 2"),
        "{syntax}"
    );
    assert_eq!(read_format(&file), None);
}

/// Messages by topic: time and bytes of each.
fn messages(bytes: &[u8]) -> BTreeMap<String, Vec<(u64, Vec<u8>)>> {
    let mut messages = BTreeMap::<String, Vec<(u64, Vec<u8>)>>::new();
    for message in mcap::MessageStream::new(bytes).unwrap() {
        let message = message.unwrap();
        let of_topic = messages.entry(message.channel.topic.clone()).or_default();
        of_topic.push((message.log_time, message.data.into_owned()));
    }
    messages
}

fn scene((_, bytes): &(u64, Vec<u8>)) -> SceneUpdate {
    SceneUpdate::decode(bytes.as_slice()).unwrap()
}

#[test]
fn a_log_shows_every_configuration_and_the_rolls_between() {
    let (_, planned) = planned(&format!(
        "{K5}[[obstacles]]\nmin = [3.0, -1.0]\nmax = [4.0, 1.0]\n"
    ));
    let walk = &planned.walk;
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("walk.mcap");
    let options = LogOptions::default().duration(6.0);
    write_walk_log(&file, walk, &options).unwrap();
    let bytes = std::fs::read(&file).unwrap();
    assert_eq!(bytes, encode_walk_log(walk, &options).unwrap());
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
        ("/environment", "foxglove.SceneUpdate"),
        ("/lengths", "tensegra.Lengths"),
        ("/robot", "foxglove.SceneUpdate"),
        ("/support", "tensegra.Support"),
    ];
    assert_eq!(topics.into_iter().collect::<Vec<_>>(), expected);

    let messages = messages(&bytes);
    let ids: Vec<String> = scene(&messages["/environment"][0])
        .entities
        .into_iter()
        .map(|entity| entity.id)
        .collect();
    assert_eq!(ids, ["ground", "obstacle 0", "waypoint 0"]);

    let robot = &messages["/robot"];
    assert_eq!(
        robot.len(),
        walk.configurations.len() + 12 * walk.rolls.len()
    );
    assert!(robot.windows(2).all(|pair| pair[0].0 < pair[1].0));
    assert_eq!((robot[0].0, robot.last().unwrap().0), (0, 6_000_000_000));
    for message in robot {
        let update = scene(message);
        let [entity] = update.entities.as_slice() else {
            panic!("one entity, replaced at each time");
        };
        assert_eq!(
            (entity.frame_id.as_str(), entity.id.as_str()),
            ("world", "robot")
        );
        // Ten members; five nodes and the centre of mass.
        assert_eq!([entity.cylinders.len(), entity.spheres.len()], [10, 6]);
        // Nothing jumps or sinks, not in a roll either.
        let heights = entity.spheres.iter().map(|ball| {
            let position = ball.pose.as_ref().unwrap().position.unwrap();
            position.z
        });
        assert!(heights.fold(f64::INFINITY, f64::min) > -1e-6);
    }
    let lengths = &messages["/lengths"];
    assert_eq!(lengths.len(), walk.configurations.len());
    for ((_, bytes), configuration) in lengths.iter().zip(&walk.configurations) {
        let message: Value = serde_json::from_slice(bytes).unwrap();
        for (&[a, b], length) in walk.edges.iter().zip(&configuration.lengths) {
            let name = format!("{}-{}", walk.nodes[a], walk.nodes[b]);
            assert_eq!(message[name].as_f64(), Some(*length));
        }
    }
    let support: Value = serde_json::from_slice(&messages["/support"][0].1).unwrap();
    assert_eq!(support["nodes"], json!(["a", "b", "c"]));
}

#[test]
fn logs_and_pictures_of_nonsense_are_refused() {
    let (problem, planned) = planned(TRIANGLE);
    let margins = Walk::margins(&problem.robot, &planned.motion);
    let spoilt: [fn(&mut Walk); 7] = [
        |walk| walk.configurations.clear(),
        |walk| walk.configurations[1].positions[0][0] = f64::NAN,
        |walk| walk.configurations[1].positions.truncate(2),
        |walk| walk.configurations[1].support[0] = 9,
        |walk| walk.configurations[1].lengths.truncate(1),
        |walk| walk.edges[0][0] = 9,
        |walk| walk.rolls.push(100_000),
    ];
    for spoil in spoilt {
        let mut walk = planned.walk.clone();
        spoil(&mut walk);
        let log = encode_walk_log(&walk, &LogOptions::default());
        assert!(matches!(log, Err(LogError::Walk(_))), "{log:?}");
        for picture in [
            draw_gait(&walk, "m"),
            draw_track(&walk, "m"),
            draw_margins(&walk, &margins, "m"),
        ] {
            assert!(matches!(picture, Err(PictureError::Walk(_))));
        }
    }
    let log = encode_walk_log(&planned.walk, &LogOptions::default().duration(0.0));
    assert!(matches!(log, Err(LogError::Duration(_))));
    assert!(draw_margins(&planned.walk, &margins[1..], "m").is_err());
    assert!(draw_tracking_error(&[]).is_err());
}

#[test]
fn pictures_show_the_walk_in_space_and_in_the_plane() {
    for (text, track) in [(K5, "support polygon"), (TRIANGLE, "waypoint 0")] {
        let (problem, planned) = planned(text);
        let margins = Walk::margins(&problem.robot, &planned.motion);
        let roll = planned.walk.rolls[0];
        let before = format!("step {roll}, before the roll");
        for (picture, parts) in [
            (draw_gait(&planned.walk, "m"), ["centre of mass", &before]),
            (draw_track(&planned.walk, "m"), [track, "x (m)"]),
            (
                draw_margins(&planned.walk, &margins, "m"),
                ["least angle (°)", "greatest length"],
            ),
        ] {
            let svg = picture.unwrap().to_svg();
            for part in parts {
                assert!(svg.contains(part), "{part}");
            }
        }
    }
    let run = |name: &str, seconds_of_roll| TrackingRun {
        name: name.to_owned(),
        seconds_of_roll,
        mean_error: 0.01 / seconds_of_roll,
        errors: vec![(0.0, 0.0), (seconds_of_roll, 0.01)],
    };
    let runs = [run("first", 2.0), run("first", 4.0), run("second", 2.0)];
    let svg = draw_tracking_error(&runs).unwrap().to_svg();
    assert!(svg.contains("second") && svg.contains("4 s a roll"));
}

#[test]
fn the_plan_over_the_grid_shows_what_was_searched() {
    let [_, _, gait] = PublishedGait::all(&Limits::default()).unwrap();
    let (primitive, _) = gait.solve(&PrimitiveOptions::default()).unwrap();
    let library = PrimitiveLibrary::new(primitive);
    let goal = GridGoal::Point(Point2::new(1.5, 0.4));
    let plan = TwoTierPlanner::new(&library)
        .walk(&gait.start.stance, &[goal])
        .unwrap();
    let context = tensegra_lar::WalkContext {
        name: "grid",
        robot: &gait.start.robot,
        node_names: &[],
        waypoints: &[[1.5, 0.4]],
        visit: tensegra_lar::Visit::Support,
        obstacles: &[],
        obstacle_clearance: 0.0,
    };
    let walk = Walk::new(
        &context,
        &plan.motion,
        tensegra_lar::WalkStatistics::default(),
    );
    let svg = draw_grid_plan(&walk, &plan, "m").unwrap().to_svg();
    for part in ["walked over", "waypoint", "grid: plan over"] {
        assert!(svg.contains(part), "{part}");
    }
    let cells: std::collections::BTreeSet<_> = plan
        .searches
        .iter()
        .flat_map(|search| search.closed.iter().chain(&search.open))
        .chain(&plan.cells)
        .collect();
    // A filled polygon for each cell.
    assert!(svg.matches("fill-opacity=\"0.35\"").count() >= cells.len());
}
