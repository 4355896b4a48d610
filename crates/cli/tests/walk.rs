//! The verb `walk`, and `check` on walks, through the program.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../fixtures/lar")
        .join(name)
}

fn tensegra(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tensegra"))
        .args(arguments)
        .env("NO_COLOR", "1")
        .output()
        .unwrap()
}

fn json(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout).unwrap()
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// A tetrahedron with everything spelt out; tests replace parts of it.
const TETRAHEDRON: &str = r#"planner = "greedy"
waypoints = [[0.8, 0.3]]

[robot]
nodes = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.4, 0.9, 0.0], [0.5, 0.3, 0.8]]
edges = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]]
support = [0, 1, 2]
names = ["west", "east", "north", "top"]
"#;

#[test]
fn a_greedy_walk_is_planned_written_and_judged() {
    let folder = tempfile::tempdir().unwrap();
    let problem = folder.path().join("stroll.toml");
    let toml = "planner = \"greedy\"\nwaypoints = [[0.6, 0.3]]\n[robot]\npreset = \"octahedron\"\n";
    std::fs::write(&problem, toml).unwrap();
    let out = folder.path().join("out");
    let run = [
        "walk",
        text(&problem),
        "--out",
        text(&out),
        "--json",
        "--simulate=2",
    ];
    let output = tensegra(&run);
    assert!(output.status.success(), "{output:?}");
    assert!(
        output.stderr.is_empty(),
        "no progress where there is no terminal"
    );
    let report = json(&output);
    for key in [
        "steps",
        "rolls",
        "cost",
        "planning_seconds",
        "smallest_clearance",
    ] {
        assert!(report[key].as_f64().unwrap() > 0.0, "{key}");
    }
    assert_eq!(report["solved"], true);
    assert_eq!(report["planner"], "greedy");
    assert_eq!(report["check"]["ok"], true);
    assert!(report["simulations"][0]["mean_error"].as_f64().unwrap() > 0.0);
    for name in ["gait", "track", "margins", "tracking"] {
        for kind in ["svg", "png"] {
            assert!(
                out.join(format!("{name}.{kind}")).is_file(),
                "{name}.{kind}"
            );
        }
    }
    let log = std::fs::read(out.join("walk.mcap")).unwrap();
    assert!(log.starts_with(b"\x89MCAP0\r\n"));

    // The judge accepts the file, by itself and against the problem.
    let walk = out.join("walk.json");
    assert_eq!(report["path"], text(&walk));
    let against = ["check", text(&walk), "--problem", text(&problem), "--json"];
    let output = tensegra(&against);
    assert!(output.status.success(), "{output:?}");
    assert_eq!(json(&output)["ok"], true);
    let output = tensegra(&["check", text(&walk)]);
    assert!(output.status.success());
    assert!(String::from_utf8_lossy(&output.stdout).contains("accepted by the independent judge"));

    // Same problem, same walk, but for the time that it took.
    let again = folder.path().join("again");
    tensegra(&[
        "walk",
        text(&problem),
        "--out",
        text(&again),
        "--no-pictures",
    ]);
    assert!(!again.join("gait.svg").exists());
    let timeless = |file: &Path| {
        let mut walk: Value = serde_json::from_slice(&std::fs::read(file).unwrap()).unwrap();
        walk["statistics"]["seconds"] = Value::Null;
        walk
    };
    assert_eq!(timeless(&walk), timeless(&again.join("walk.json")));

    // And refuses what has been tampered with, and a walk for another goal.
    let mut forged = timeless(&walk);
    forged["statistics"]["seconds"] = 0.0.into();
    let position = forged
        .pointer_mut("/configurations/3/positions/0/0")
        .unwrap();
    *position = (position.as_f64().unwrap() + 0.01).into();
    let forgery = folder.path().join("forged.json");
    std::fs::write(&forgery, forged.to_string()).unwrap();
    let output = tensegra(&["check", text(&forgery), "--json"]);
    assert_eq!(output.status.code(), Some(1));
    let verdict = json(&output);
    assert_eq!(verdict["ok"], false);
    assert!(
        verdict["reasons"].to_string().contains("slides"),
        "{verdict}"
    );
    let farther = folder.path().join("farther.toml");
    std::fs::write(&farther, toml.replace("[0.6, 0.3]", "[9.0, 9.0]")).unwrap();
    let output = tensegra(&["check", text(&walk), "--problem", text(&farther)]);
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stdout).contains("waypoint 0 is not visited"));
}

#[test]
fn robots_of_ones_own_walk_in_space_and_in_the_plane() {
    let folder = tempfile::tempdir().unwrap();
    for (name, toml) in [
        // A random graph of nobody's making: K5 with one member less is minimally rigid.
        (
            "space",
            "planner = \"greedy\"\nwaypoints = [[1.8, 0.4]]\n[robot]\n\
             nodes = [[0, 0, 0], [1, 0, 0], [0.5, 0.9, 0], [0.4, 0.3, 0.9], [1.1, 0.7, 0.8]]\n\
             edges = [[0, 1], [0, 2], [1, 2], [0, 3], [1, 3], [2, 3], [1, 4], [2, 4], [3, 4]]\n\
             support = [0, 1, 2]\n[limits]\nmax_length = 3.0\n",
        ),
        (
            "plane",
            "planner = \"greedy\"\nwaypoints = [[1.5]]\n[robot]\n\
             nodes = [[0.0, 0.0], [1.0, 0.0], [0.5, 0.9]]\n\
             edges = \"complete\"\nsupport = [0, 1]\n",
        ),
    ] {
        let problem = folder.path().join(format!("{name}.toml"));
        // Integers are numbers too.
        std::fs::write(&problem, toml).unwrap();
        let out = folder.path().join(name);
        let output = tensegra(&[
            "walk",
            text(&problem),
            "--out",
            text(&out),
            "--json",
            "--no-pictures",
        ]);
        assert!(output.status.success(), "{output:?}");
        let report = json(&output);
        assert_eq!(report["check"]["ok"], true);
        assert!(report["rolls"].as_u64().unwrap() > 0, "{report}");
    }
}

#[test]
fn a_walk_that_cannot_be_made_is_a_negative_result() {
    let folder = tempfile::tempdir().unwrap();
    // The waypoint is walled in.
    let walls = "[[obstacles]]\nmin = [3.0, -2.0]\nmax = [3.2, 2.0]\n\
                 [[obstacles]]\nmin = [6.8, -2.0]\nmax = [7.0, 2.0]\n\
                 [[obstacles]]\nmin = [3.0, 1.8]\nmax = [7.0, 2.0]\n\
                 [[obstacles]]\nmin = [3.0, -2.0]\nmax = [7.0, -1.8]\n";
    let toml = format!(
        "planner = \"greedy\"\nwaypoints = [[5.0, 0.0]]\n[robot]\npreset = \"k5\"\n{walls}"
    );
    let problem = folder.path().join("walled.toml");
    std::fs::write(&problem, toml).unwrap();
    let out = folder.path().join("out");
    let output = tensegra(&[
        "walk",
        text(&problem),
        "--out",
        text(&out),
        "--json",
        "--no-pictures",
    ]);
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    let report = json(&output);
    assert_eq!(report["solved"], false);
    assert!(
        report["stop"]
            .as_str()
            .unwrap()
            .contains("no way around the obstacles")
    );
}

/// What the program says of a bad problem: exit status 2, the message on standard error, and a
/// JSON object with `solved` false on standard output.
fn complaint(toml: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let problem = folder.path().join("bad.toml");
    std::fs::write(&problem, toml).unwrap();
    let out = folder.path().join("out");
    let output = tensegra(&["walk", text(&problem), "--out", text(&out), "--json"]);
    assert_eq!(output.status.code(), Some(2), "{output:?}");
    assert_eq!(json(&output)["solved"], false);
    assert!(!out.join("walk.json").exists());
    // Lines may be wrapped, at hyphens too.
    let message = String::from_utf8(output.stderr).unwrap();
    message
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" ")
        .replace(" │ ", " ")
        .replace("- ", "-")
}

#[test]
fn bad_problems_are_refused_with_their_place() {
    let replaced = |from: &str, to: &str| {
        assert!(TETRAHEDRON.contains(from), "{from}");
        TETRAHEDRON.replacen(from, to, 1)
    };
    let appended = |more: &str| format!("{TETRAHEDRON}{more}");
    for (toml, place, parts) in [
        // A robot that is not rigid: the loose nodes are named.
        (
            replaced(", [2, 3]]", "]"),
            "bad.toml:6:9",
            ["not infinitesimally rigid", "3 (top)"],
        ),
        // An initial configuration that violates a constraint: length, distance, angle.
        (
            appended("[limits]\nmin_length = 0.99\n"),
            "bad.toml:5:9",
            [
                "initial configuration violates",
                "shortest length of member",
            ],
        ),
        (
            replaced("[0.5, 0.3, 0.8]", "[0.5, 0.12, 0.05]"),
            "bad.toml:5:9",
            [
                "initial configuration violates the",
                "distance between members 0-1 and 2-3",
            ],
        ),
        (
            replaced("[0.5, 0.3, 0.8]", "[0.5, 0.3, -0.8]"),
            "bad.toml:5:9",
            [
                "initial configuration violates the",
                "node 3 above the ground",
            ],
        ),
        // A robot that does not stand.
        (
            replaced("support = [0, 1, 2]", "support = [0, 1, 3]"),
            "bad.toml:7:11",
            ["does not stand", "support node 3 is at height 0.8"],
        ),
        (
            replaced("[0.5, 0.3, 0.8]", "[2.5, 0.3, 0.8]"),
            "bad.toml:7:11",
            ["does not stand", "would tip over"],
        ),
        // A waypoint inside an obstacle.
        (
            appended("[[obstacles]]\nmin = [0.7, 0.0]\nmax = [2.0, 0.5]\n"),
            "bad.toml:2:14",
            ["waypoint 0 lies inside obstacle 0", "move one of them"],
        ),
        // A graph with a free node, a loop, a double member, a node that is not there.
        (
            replaced("[0.5, 0.3, 0.8]]", "[0.5, 0.3, 0.8], [3.0, 0.0, 1.0]]"),
            "bad.toml:5:78",
            ["node 4 has no member", "join it to the others or remove it"],
        ),
        (
            replaced("[0, 1], ", "[0, 0], "),
            "bad.toml:6:10",
            ["joins node 0 to itself", ""],
        ),
        (
            replaced("[2, 3]]", "[1, 0]]"),
            "bad.toml:6:50",
            ["members 0 and 5 both join nodes 1 and 0", ""],
        ),
        (
            replaced("[2, 3]]", "[2, 9]]"),
            "bad.toml:6:50",
            ["joins nodes 2 and 9", "numbered 0 to 3"],
        ),
        // Unknown key, wrong types, NaN, missing keys.
        (
            replaced("support", "supprt"),
            "bad.toml:7:1",
            ["unknown field `supprt`", "`support`"],
        ),
        (
            replaced("[[0.8, 0.3]]", "[[0.8, \"far\"]]"),
            "bad.toml:2:20",
            ["invalid type: string", "far"],
        ),
        (
            replaced("[[0, 1], [0, 2]", "7 # [[0, 1], [0, 2]"),
            "bad.toml:6:9",
            ["invalid type: integer `7`", "\"complete\""],
        ),
        (
            replaced("[0, 1], ", "[0, -1], "),
            "bad.toml:6:14",
            ["invalid value: integer `-1`", ""],
        ),
        (
            replaced("[0.5, 0.3, 0.8]", "[0.5, nan, 0.8]"),
            "bad.toml:5:61",
            ["node 3 has the coordinate NaN", "give finite numbers"],
        ),
        (
            replaced("[[0.8, 0.3]]", "[[0.8, nan]]"),
            "bad.toml:2:14",
            ["waypoint 0 has the coordinate NaN", ""],
        ),
        (
            appended("[limits]\nmin_angle_degrees = nan\n"),
            "bad.toml:10:21",
            ["`min_angle_degrees` is NaN", "between 0 and 90"],
        ),
        (
            appended("[greedy]\nstep = -0.1\n"),
            "bad.toml:10:8",
            ["`step` is -0.1", "positive"],
        ),
        (
            appended("[[obstacles]]\ncorners = [[0, 0], [inf, 0], [1, 1]]\n"),
            "bad.toml:10:11",
            ["corner 1 is (inf, 0)", "finite"],
        ),
        (
            replaced(
                "waypoints = [[0.8, 0.3]]",
                "goal = { centre = [1.0, 0.0], radius = nan }",
            ),
            "bad.toml:2:40",
            ["radius of the goal is NaN", "positive"],
        ),
        (
            replaced("[[0.8, 0.3]]", "[]"),
            "bad.toml:2:13",
            ["give at least one waypoint", ""],
        ),
        (
            replaced("planner = \"greedy\"\n", ""),
            "bad.toml:",
            ["missing field `planner`", ""],
        ),
        ("planner = \"greedy".to_owned(), "bad.toml:1:", ["", ""]),
        // Two-tier planning needs a symmetric stance: the message says what is missing.
        (
            replaced("\"greedy\"", "\"two-tier\""),
            "bad.toml",
            ["equilateral", "support triangle of nodes [0, 1, 2]"],
        ),
    ] {
        let message = complaint(&toml);
        assert!(message.contains(place), "{place} in: {message}");
        for part in parts {
            assert!(message.contains(part), "{part} in: {message}");
        }
    }
}

#[test]
fn motions_are_stored_and_used_again() {
    let folder = tempfile::tempdir().unwrap();
    let problem = folder.path().join("roll.toml");
    let motions = folder.path().join("motions.json");
    let out = folder.path().join("out");
    let run = |text_of_problem: &str| {
        std::fs::write(&problem, text_of_problem).unwrap();
        tensegra(&[
            "walk",
            text(&problem),
            "--motions",
            text(&motions),
            "--out",
            text(&out),
            "--no-pictures",
            "--json",
        ])
    };
    let toml = "planner = \"two-tier\"\nwaypoints = [[1.5, 0.5]]\n[robot]\npreset = \"octahedron\"\n\
                [two_tier]\nrolls = 1\nstarts = 4\n";
    let first = run(toml);
    assert!(first.status.success(), "{first:?}");
    let stored = std::fs::read_to_string(&motions).unwrap();
    let walk = |report: &Value| (report["cost"].clone(), report["steps"].clone());
    let first = json(&first);
    let source = |report: &Value| report["motions"]["source"].clone();
    assert_eq!(source(&first), "optimised");
    assert_eq!(first["motions"]["file"], text(&motions));

    // The same walk again, without optimising; a start elsewhere is no obstacle.
    let again = run(toml);
    assert!(again.status.success(), "{again:?}");
    assert_eq!(walk(&json(&again)), walk(&first));
    assert_eq!(source(&json(&again)), "file");
    let moved = toml.replace("preset", "centre_of_mass = [0.3, -0.2]\npreset");
    assert_eq!(json(&run(&moved))["solved"], true);
    assert_eq!(std::fs::read_to_string(&motions).unwrap(), stored);

    // What does not fit is refused, and the file left alone.
    let cut = &stored[..stored.len() / 2];
    let older = stored.replacen("\"version\":2", "\"version\":1", 1);
    for (toml, file, reason) in [
        (toml.replace("octahedron", "k5"), &*stored, "another robot"),
        (
            format!("{toml}[limits]\nmax_length = 3.5\n"),
            &*stored,
            "max_length",
        ),
        (
            toml.replace("rolls = 1", "rolls = 2"),
            &*stored,
            "`rolls` = 1",
        ),
        (toml.replace("two-tier", "greedy"), &*stored, "--motions"),
        (toml.to_owned(), cut, "not a file of motions"),
        (toml.to_owned(), &*older, "optimised anew"),
    ] {
        std::fs::write(&motions, file).unwrap();
        let output = run(&toml);
        assert_eq!(output.status.code(), Some(2), "{output:?}");
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(message.contains(reason), "{reason} in: {message}");
        assert_eq!(std::fs::read_to_string(&motions).unwrap(), file);
    }
}

#[test]
fn bad_files_and_flags_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let missing = folder.path().join("missing.toml");
    let greedy = fixture("greedy-s.toml");
    let out = folder.path().join("out");
    let (greedy, out) = (text(&greedy), text(&out));
    let blocked = folder.path().join("file");
    std::fs::write(&blocked, "").unwrap();
    for (arguments, part) in [
        (vec!["walk", text(&missing)], "there is no such file"),
        (vec!["walk", text(folder.path())], "this is a folder"),
        (vec!["walk", text(&blocked)], "empty"),
        (
            vec!["walk", greedy, "--planner", "swim"],
            "invalid value 'swim'",
        ),
        (
            vec!["walk", greedy, "--out", out, "--seeds", "1..3"],
            "no random choices",
        ),
        (
            vec!["walk", greedy, "--out", out, "--seeds", "3..1"],
            "no range of seeds",
        ),
        (
            vec!["walk", greedy, "--out", out, "--simulate=-2"],
            "no time",
        ),
        (
            vec!["walk", greedy, "--out", text(&blocked)],
            "choose another folder",
        ),
        (vec!["check", text(&missing)], "missing.toml"),
    ] {
        let output = tensegra(&arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {output:?}");
        let message = String::from_utf8_lossy(&output.stderr);
        assert!(message.contains(part), "{arguments:?}: {message}");
        assert!(output.stdout.is_empty());
    }
}
