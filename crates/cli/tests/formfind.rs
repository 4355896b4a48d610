//! Form-finding as its users meet it: what cannot be is named, with its smallest violation.

use std::{
    fs,
    process::{Command, Output},
};

use serde_json::Value;

/// A tripod of three cables and three bars on the ground: the node `top` is pushed up by bars
/// and held down by cables.
const TRIPOD: &str = r#"
name = "tripod"
[structure]
pretension = 0
fixed = { a = [1, 0, 0], b = [-0.5, 0.8, 0], c = [-0.5, -0.8, 0], d = [0, 0, 0] }
supports = ["a", "b", "c", "d"]
gravity = [0, 0, -9.81]
masses = { top = 0.2 }
[structure.types]
cable = { kind = "cable", length = [0.1, 2], stiffness = 500, rest = [0.1, 2], force = [2, 40] }
bar = { kind = "bar", length = [0.1, 1.5], stiffness = 4000, rest = [0.1, 2], force = [-100, 0] }
[structure.elements]
c1 = { type = "cable", nodes = ["a", "top"] }
c2 = { type = "cable", nodes = ["b", "top"] }
c3 = { type = "cable", nodes = ["c", "top"] }
s1 = { type = "bar", nodes = ["d", "top"] }
"#;

struct Run {
    output: Output,
    _folder: tempfile::TempDir,
}

impl Run {
    /// Runs `tensegra formfind` on a problem text.
    fn of(problem: &str, arguments: &[&str]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("problem.toml");
        fs::write(&file, problem).unwrap();
        let output = Command::new(env!("CARGO_BIN_EXE_tensegra"))
            .arg("formfind")
            .arg(&file)
            .args(["--out".as_ref(), folder.path().join("out").as_os_str()])
            .args(arguments)
            .env("COLUMNS", "500")
            .output()
            .unwrap();
        Self {
            output,
            _folder: folder,
        }
    }

    fn status(&self) -> Option<i32> {
        self.output.status.code()
    }

    fn json(&self) -> Value {
        let text = String::from_utf8_lossy(&self.output.stdout);
        serde_json::from_str(&text).unwrap_or_else(|error| panic!("{error} in {text}"))
    }

    /// Requires status 1 and returns the constraints missed with their violations, and the message.
    fn unmet(&self) -> (Vec<(String, f64)>, String) {
        let value = self.json();
        assert_eq!(self.status(), Some(1), "{value}");
        assert_eq!(value["found"], false);
        let message = value["error"].as_str().unwrap().to_owned();
        let unmet = value["unmet"].as_array().unwrap().iter().map(|unmet| {
            let name = unmet["constraint"].as_str().unwrap().to_owned();
            (name, unmet["violation"].as_f64().unwrap())
        });
        (unmet.collect(), message)
    }
}

#[test]
fn a_form_is_found_and_the_same_on_any_number_of_threads() {
    let seeded = |threads| {
        let arguments = [
            "--json",
            "--starts",
            "8",
            "--seed",
            "3",
            "--threads",
            threads,
        ];
        let run = Run::of(TRIPOD, &arguments);
        let mut value = run.json();
        assert_eq!(run.status(), Some(0), "{value}");
        value.as_object_mut().unwrap().remove("files");
        value
    };
    let found = seeded("1");
    assert_eq!(found, seeded("2"));
    assert_eq!(found["accepted"], found["converged"]);
    assert!(found["converged"].as_u64().unwrap() >= 6, "{found}");
}

#[test]
fn lengths_that_contradict_each_other_are_named_alone() {
    // A triangle with sides of at most 0.4, 0.4 and at least 1 misses by 0.2 in all.
    let problem = TRIPOD.to_owned()
        + r#"
t1 = { type = "cable", nodes = ["top", "u"], length = [0.1, 0.4] }
t2 = { type = "cable", nodes = ["u", "v"], length = [0.1, 0.4] }
t3 = { kind = "bar", nodes = ["v", "top"], length = [1, 1.5], stiffness = 4000, rest = [0.1, 2], force = [-100, 0] }
t4 = { type = "bar", nodes = ["d", "u"] }
t5 = { type = "bar", nodes = ["a", "v"] }
"#;
    let (unmet, message) = Run::of(&problem, &["--json"]).unmet();
    assert!(
        message.starts_with("the lengths contradict each other"),
        "{message}"
    );
    for (name, violation) in &unmet {
        assert!(name.contains("of the length of t"), "{message}");
        assert!(*violation > 0.0 && *violation <= 0.2 + 1e-3, "{message}");
    }
    let sum: f64 = unmet.iter().map(|unmet| unmet.1).sum();
    assert!(sum > 0.19 && sum < 0.25, "{message}");
}

#[test]
fn a_place_that_cannot_be_reached_is_named() {
    let problem = TRIPOD.to_owned() + "[formfind]\nnodes = { top = [0, 0, 3] }\n";
    let (unmet, message) = Run::of(&problem, &["--json"]).unmet();
    assert!(
        message.starts_with("the form asked for cannot be reached"),
        "{message}"
    );
    let (name, violation) = &unmet[0];
    assert!(name.contains("node top at z = 3"), "{message}");
    // The bar is at most 1.5 long.
    assert!((violation - 1.5).abs() < 0.01, "{message}");
    // To people as well.
    let run = Run::of(&problem, &[]);
    let text = String::from_utf8_lossy(&run.output.stdout);
    assert_eq!(run.status(), Some(1), "{text}");
    assert!(text.contains("node top at z = 3 by 1.5"), "{text}");
}

#[test]
fn a_load_that_no_prestress_can_carry_is_named() {
    let heavy = TRIPOD.replace("top = 0.2", "top = 20");
    let problem = heavy + "[formfind]\nnodes = { top = { z = 0.8 } }\n";
    let (unmet, message) = Run::of(&problem, &["--json"]).unmet();
    assert!(
        message.starts_with("no admissible forces carry the loads"),
        "{message}"
    );
    let (name, violation) = &unmet[0];
    assert_eq!(name, "force balance of top along z", "{message}");
    // 196 N on a bar that takes 100, and cables that pull down with 2 N at least.
    assert!(*violation > 95.0 && *violation < 101.0, "{message}");
}

#[test]
fn an_obstacle_that_swallows_a_fixed_node_is_bad_input() {
    let problem = TRIPOD.to_owned()
        + r#"
[obstacles]
rock = { shape = "sphere", center = [1, 0.1, 0], radius = 0.3 }
[collisions]
check = [["s1", "rock"]]
[formfind]
node_radius = 0.01
"#;
    let run = Run::of(&problem, &["--json"]);
    let value = run.json();
    assert_eq!(run.status(), Some(2), "{value}");
    let message = value["error"].as_str().unwrap();
    assert!(
        message.contains("the obstacle rock swallows the fixed node a")
            && message.contains("-2.000000e-1"),
        "{message}"
    );
}

/// A mast of one elastic bar, stayed by three cables in the plane x = 0 … 1; its start stands upright.
const MAST: &str = r#"
name = "mast"
[structure]
planar = true
pretension = 0
fixed = { foot = [0, 0], e = [1, 0], w = [-1, 0] }
supports = ["foot", "e", "w"]
loads = { top = [2, -3] }
[structure.types]
stay = { kind = "cable", length = [0.1, 3], stiffness = 200, rest = [0.5, 3] }
[structure.elements]
mast = { kind = "bar", nodes = ["foot", "top"], length = [0.1, 3], stiffness = 5000, rest = 1.2, force = [-500, 500] }
ce = { type = "stay", nodes = ["e", "top"] }
cw = { type = "stay", nodes = ["w", "top"] }
[start]
nodes = { foot = [0, 0], e = [1, 0], w = [-1, 0], top = [0, 1.2] }
rest_lengths = { ce = 1.7, cw = 1.5 }
"#;

#[test]
fn rest_lengths_give_positions_and_slack_cables_are_named() {
    let run = Run::of(MAST, &["--direct", "--json"]);
    let value = run.json();
    assert_eq!(run.status(), Some(0), "{value}");
    assert_eq!(value["slack"], serde_json::json!(["ce"]));
    assert_eq!(value["forces"]["ce"], 0.0);
    assert_eq!(value["check"]["ok"], true, "{value}");
    assert!(value["residual"].as_f64().unwrap() < 1e-9);
    // A rest length that is none is bad input, as is an element that does not exist.
    for (given, message) in [
        ("ce=-1", "the rest length of `ce` is -1"),
        ("zz=1", "there is no element `zz`"),
    ] {
        let run = Run::of(MAST, &["--direct", "--rest", given]);
        assert_eq!(run.status(), Some(2));
        let text = String::from_utf8_lossy(&run.output.stderr);
        assert!(text.contains(message), "{text}");
    }
}
