//! Walk problems and walks as files: errors with their place, round trips, and a checker that
//! notices what has been tampered with.

mod common;

use common::{check_motion, fixture, known_primitive};
use tensegra_lar::{
    Constraint, Walk, WalkCheckOptions, WalkFacts, WalkFaultKind, WalkFileError, WalkGoal,
    WalkPlanner, WalkProblem, check_walk,
};

#[test]
fn fixtures_are_read() {
    let problem = WalkProblem::from_toml(&fixture("greedy-s.toml")).unwrap();
    assert_eq!(problem.planner, WalkPlanner::Greedy);
    assert_eq!(problem.goal.points().len(), 5);
    let problem = WalkProblem::from_toml(&fixture("two-tier-s.toml")).unwrap();
    assert_eq!(problem.two_tier.rolls, 2);
    let problem = WalkProblem::from_toml(&fixture("two-tier-blocks.toml")).unwrap();
    assert!(matches!(problem.goal, WalkGoal::Region { .. }));
    assert_eq!(problem.obstacles.len(), 3);
    let centre = problem.robot.centre_of_mass(&problem.start.coordinates);
    assert!(centre.x.abs() < 1e-12 && centre.y.abs() < 1e-12);
}

/// A tetrahedron with everything spelt out; each test replaces a line.
const TETRAHEDRON: &str = r#"planner = "greedy"
waypoints = [[1.0, 0.0]]

[robot]
nodes = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.4, 0.9, 0.0], [0.5, 0.3, 0.8]]
members = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]]
support = [0, 1, 2]
"#;

#[test]
fn errors_say_where_and_what() {
    assert!(WalkProblem::from_toml(TETRAHEDRON).is_ok());
    let cases = [
        // (what to replace, by what, line, column, part of the message)
        ("\"greedy\"", "\"fly\"", 1, 11, "unknown variant"),
        ("[[1.0, 0.0]]", "[]", 2, 13, "at least one waypoint"),
        (
            "[[1.0, 0.0]]",
            "[[1.0, 0.0], [nan, 0.0]]",
            2,
            26,
            "waypoint 1 has the coordinate NaN",
        ),
        (
            "[0.5, 0.3, 0.8]]",
            "[0.5, 0.3]]",
            5,
            61,
            "node 3 has 2 coordinates",
        ),
        (
            "[0.5, 0.3, 0.8]]",
            "[0.5, 0.12, 0.05]]",
            5,
            9,
            "violates the distance between members 0-1 and 2-3",
        ),
        ("[[0, 1], ", "[[0, 0], ", 6, 12, "joins node 0 to itself"),
        ("[2, 3]]", "[2, 9]]", 6, 52, "joins nodes 2 and 9"),
        (", [2, 3]]", "]", 6, 11, "not infinitesimally rigid"),
        (
            "[0, 1, 2]",
            "[0, 1, 3]",
            7,
            11,
            "support node 3 is at height 0.8",
        ),
        ("[0, 1, 2]", "[0, 1]", 7, 11, "a support has 3 nodes"),
        ("support", "supprt", 7, 1, "unknown field"),
    ];
    for (from, to, line, column, message) in cases {
        assert!(TETRAHEDRON.contains(from));
        let error = WalkProblem::from_toml(&TETRAHEDRON.replacen(from, to, 1)).unwrap_err();
        assert!(error.message.contains(message), "{to}: {error}");
        assert_eq!((error.line, error.column), (line, column), "{to}: {error}");
    }
}

#[test]
fn a_free_node_and_a_blocked_waypoint_are_named() {
    let free = TETRAHEDRON.replace("[0.5, 0.3, 0.8]]", "[0.5, 0.3, 0.8], [3.0, 0.0, 1.0]]");
    let error = WalkProblem::from_toml(&free).unwrap_err();
    assert!(error.message.contains("node 4 has no member"), "{error}");

    let blocked = format!("{TETRAHEDRON}\n[[obstacles]]\nmin = [0.9, -0.5]\nmax = [2.0, 0.5]\n");
    let error = WalkProblem::from_toml(&blocked).unwrap_err();
    assert!(
        error.message.contains("waypoint 0 lies inside obstacle 0"),
        "{error}"
    );
    assert_eq!((error.line, error.column), (2, 14));

    let limits = format!("{TETRAHEDRON}\n[limits]\nmin_angle_degrees = 120.0\n");
    let error = WalkProblem::from_toml(&limits).unwrap_err();
    assert!(error.message.contains("min_angle"), "{error}");
}

fn sample() -> Walk {
    let known = known_primitive("octahedron");
    let primitive = known.primitive();
    check_motion(primitive.symmetric_robot(), primitive.motion()).0
}

#[test]
fn walks_survive_a_round_trip() {
    let walk = sample();
    let text = walk.to_json().unwrap();
    assert!(text.starts_with("{\"format\":\"tensegra-walk\",\"version\":1,"));
    assert_eq!(Walk::from_json(&text).unwrap(), walk);
    let newer = text.replacen("\"version\":1", "\"version\":2", 1);
    assert!(matches!(
        Walk::from_json(&newer),
        Err(WalkFileError::Format { version: 2, .. })
    ));
    assert!(matches!(Walk::from_json("{}"), Err(WalkFileError::Json(_))));
}

#[test]
fn the_check_notices_what_is_wrong() {
    let walk = sample();
    let facts = WalkFacts::of(&walk);
    let kinds = |walk: &Walk, facts: &WalkFacts| -> Vec<WalkFaultKind> {
        let verdict = check_walk(facts, walk, &WalkCheckOptions::default());
        assert_eq!(verdict.valid, verdict.faults.is_empty());
        verdict.faults.into_iter().map(|fault| fault.kind).collect()
    };
    assert!(kinds(&walk, &facts).is_empty());

    // A support node that slides.
    let mut slid = walk.clone();
    slid.configurations[5].positions[0][0] += 1e-3;
    assert!(
        kinds(&slid, &facts)
            .iter()
            .any(|k| matches!(k, WalkFaultKind::Slides { node: 0, .. }))
    );
    // A node below the ground.
    let mut sunk = walk.clone();
    sunk.configurations[7].positions[3][2] = -0.01;
    let ground = Constraint::Ground { node: 3 };
    assert!(
        kinds(&sunk, &facts).iter().any(
            |k| matches!(k, WalkFaultKind::Violated { constraint, .. } if *constraint == ground)
        )
    );
    // A leap.
    let mut leap = walk.clone();
    leap.configurations.drain(3..9);
    leap.rolls[0] -= 6;
    assert!(
        kinds(&leap, &facts)
            .iter()
            .any(|k| matches!(k, WalkFaultKind::Jumps { .. }))
    );
    // A roll that comes too early, and one that is not declared.
    let mut early = walk.clone();
    early.configurations.remove(20);
    early.rolls[0] = 19;
    assert!(
        kinds(&early, &facts)
            .iter()
            .any(|k| matches!(k, WalkFaultKind::RollsTooEarly { .. }))
    );
    let mut silent = walk.clone();
    silent.rolls.clear();
    assert!(kinds(&silent, &facts).contains(&WalkFaultKind::SupportChange));
    // Lengths that are not those of the positions.
    let mut stretched = walk.clone();
    stretched.configurations[2].lengths[4] += 0.1;
    assert!(
        kinds(&stretched, &facts)
            .iter()
            .any(|k| matches!(k, WalkFaultKind::WrongLength { member: 4, .. }))
    );
    // A clearance that is not kept.
    let mut boastful = walk.clone();
    boastful.statistics.certified_clearance = Some(0.6);
    assert!(
        kinds(&boastful, &facts)
            .iter()
            .any(|k| matches!(k, WalkFaultKind::Clearance { .. }))
    );
    // Stricter limits than those planned with, and another robot.
    let mut strict = facts.clone();
    strict.limits.max_length = 1.05;
    let found = kinds(&walk, &strict);
    assert!(
        found
            .iter()
            .any(|k| matches!(k, WalkFaultKind::OtherRobot { .. }))
    );
    let mut strict_walk = walk.clone();
    strict_walk.limits.max_length = 1.05;
    assert!(kinds(&strict_walk, &strict).iter().any(|k| matches!(
        k,
        WalkFaultKind::Violated {
            constraint: Constraint::MaxLength { .. },
            ..
        }
    )));
    // A waypoint that is not visited.
    let mut farther = facts.clone();
    farther.waypoints = vec![[9.0, 9.0]];
    assert!(kinds(&walk, &farther).contains(&WalkFaultKind::NotVisited { waypoint: 0 }));
    // Nonsense.
    let mut nonsense = walk.clone();
    nonsense.configurations[0].positions[0] = vec![f64::NAN; 3];
    nonsense.configurations[1].support = vec![0, 0, 7];
    assert!(
        kinds(&nonsense, &facts)
            .iter()
            .all(|k| matches!(k, WalkFaultKind::Malformed { .. }))
    );
}
