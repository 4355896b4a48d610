//! The program as its users meet it: what it prints, writes and returns.

use std::{
    fs,
    path::{Path, PathBuf},
    process::{Command, Output},
};

use serde_json::Value;

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../fixtures")
        .join(name)
}

fn tensegra<I: AsRef<std::ffi::OsStr>>(arguments: impl IntoIterator<Item = I>) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tensegra"))
        .args(arguments)
        .output()
        .expect("the program runs")
}

fn json(output: &Output) -> Value {
    let text = String::from_utf8_lossy(&output.stdout);
    serde_json::from_str(&text).unwrap_or_else(|error| panic!("{error} in {text}"))
}

/// Plans `problem` and requires that it is refused: status 2, a message that
/// contains `message`, nothing on standard output, nothing written.
fn refuse(problem: &Path, message: &str) {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let output = Command::new(env!("CARGO_BIN_EXE_tensegra"))
        .arg("plan")
        .arg(problem)
        .arg("--out")
        .arg(&out)
        .env("COLUMNS", "200")
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{text}");
    // Messages are wrapped to the width of the terminal.
    let flat: String = text
        .split_whitespace()
        .filter(|word| !matches!(*word, "│" | "×" | "╰─▶"))
        .collect::<Vec<_>>()
        .join(" ");
    assert!(flat.contains(message), "`{message}` is not in:\n{text}");
    assert!(output.stdout.is_empty());
    let files = fs::read_dir(&out).map_or(0, Iterator::count);
    assert_eq!(files, 0, "something was written");
}

#[test]
fn every_kind_of_bad_input_is_refused_with_status_2() {
    for (file, message) in [
        ("no_such_file.toml", "there is no such file"),
        ("syntax_error.toml", "syntax_error.toml"),
        ("syntax_error.tens", "`length` is expected here"),
        ("unknown_node.toml", "there is no node `bb`"),
        ("unknown_key.toml", "unknown_key.toml"),
        ("negative_radius.toml", "the radius is negative"),
        ("empty_range.toml", "the range of the length is empty"),
        ("nan.toml", "no finite number"),
        ("no_finite_number.tens", "division by zero"),
        ("loop.toml", "two different nodes"),
        ("same_name.toml", "duplicate key"),
        ("disconnected.toml", "connect"),
        ("start_without_equilibrium.toml", "the start"),
        ("start_in_collision.toml", "the start is in collision"),
        ("empty.toml", "empty"),
        ("binary.toml", "this is not a text file"),
        ("not_utf8.tens", "this is not a text file"),
    ] {
        refuse(&fixture("bad").join(file), message);
    }
}

#[test]
fn a_file_of_a_hundred_megabytes_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("large.toml");
    let file = fs::File::create(&path).unwrap();
    file.set_len(100_000_000).unwrap();
    refuse(&path, "the file is too large");
}

#[test]
fn a_folder_is_no_problem() {
    let folder = tempfile::tempdir().unwrap();
    refuse(folder.path(), "this is a folder");
}

#[test]
fn an_output_folder_that_cannot_be_written_is_refused_before_the_work() {
    let folder = tempfile::tempdir().unwrap();
    // A file where the folder should be: refused to root as well.
    let out = folder.path().join("occupied");
    fs::write(&out, "mine").unwrap();
    let kite = fixture("kite.toml");
    let output = tensegra([
        "plan".as_ref(),
        kite.as_os_str(),
        "--out".as_ref(),
        out.as_os_str(),
    ]);
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("choose another folder with --out"));
    assert_eq!(fs::read_to_string(&out).unwrap(), "mine");
}

#[test]
fn with_json_a_refusal_is_an_object_too() {
    let output = tensegra([
        "plan".as_ref(),
        fixture("bad/unknown_node.toml").as_os_str(),
        "--json".as_ref(),
    ]);
    assert_eq!(output.status.code(), Some(2));
    let value = json(&output);
    assert_eq!(value["solved"], false);
    assert!(value["error"].as_str().unwrap().contains("bb"));
}

#[test]
fn info_tells_the_counts() {
    let output = tensegra([
        "info".as_ref(),
        fixture("kite.toml").as_os_str(),
        "--formulation".as_ref(),
        "directions".as_ref(),
        "--json".as_ref(),
    ]);
    assert_eq!(output.status.code(), Some(0));
    let value = json(&output);
    for (key, count) in [
        ("variables_raw", 38),
        ("equations_raw", 48),
        ("variables", 26),
        ("equations", 26),
        ("independent", 23),
        ("dimension", 3),
    ] {
        assert_eq!(value[key], count, "{key}");
    }
}

#[test]
fn a_plan_is_written_judged_and_the_same_again() {
    let folder = tempfile::tempdir().unwrap();
    let plan = |name: &str| {
        let out = folder.path().join(name);
        let output = tensegra([
            "plan".as_ref(),
            fixture("kite.toml").as_os_str(),
            "--out".as_ref(),
            out.as_os_str(),
            "--seed".as_ref(),
            "3".as_ref(),
            "--json".as_ref(),
        ]);
        assert_eq!(output.status.code(), Some(0));
        let value = json(&output);
        assert_eq!(value["solved"], true);
        assert_eq!(value["seed"], 3);
        assert_eq!(value["check"]["ok"], true);
        for key in [
            "planning_seconds",
            "charts",
            "nodes",
            "path_length",
            "control_effort",
        ] {
            assert!(value[key].as_f64().unwrap() > 0.0, "{key}");
        }
        for file in [
            "path.json",
            "path.mcap",
            "start.svg",
            "goal.svg",
            "snapshots.svg",
            "forces.svg",
            "lengths.svg",
        ] {
            assert!(
                fs::metadata(out.join(file)).unwrap().len() > 500,
                "{file} is empty"
            );
        }
        PathBuf::from(value["path"].as_str().unwrap())
    };
    let first = plan("first");
    let second = plan("second");
    let configurations = |path: &Path| -> Value {
        let file: Value = serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap();
        file["configurations"].clone()
    };
    assert_eq!(configurations(&first), configurations(&second));

    let output = tensegra(["check".as_ref(), first.as_os_str(), "--json".as_ref()]);
    assert_eq!(output.status.code(), Some(0));
    assert_eq!(json(&output)["ok"], true);

    // A path that was tampered with is refused, with the reason.
    let mut file: Value = serde_json::from_str(&fs::read_to_string(&first).unwrap()).unwrap();
    let x = &mut file["configurations"][5]["positions"][2][0];
    *x = Value::from(x.as_f64().unwrap() + 1e-3);
    fs::write(&first, file.to_string()).unwrap();
    let output = tensegra(["check".as_ref(), first.as_os_str(), "--json".as_ref()]);
    assert_eq!(output.status.code(), Some(1));
    let value = json(&output);
    assert_eq!(value["ok"], false);
    assert!(!value["failures"].as_array().unwrap().is_empty());
}

#[test]
fn seeds_give_an_array() {
    let folder = tempfile::tempdir().unwrap();
    let output = tensegra([
        "plan".as_ref(),
        fixture("kite.toml").as_os_str(),
        "--seeds".as_ref(),
        "4..5".as_ref(),
        "--out".as_ref(),
        folder.path().as_os_str(),
        "--json".as_ref(),
    ]);
    assert_eq!(output.status.code(), Some(0));
    let value = json(&output);
    let seeds: Vec<_> = value
        .as_array()
        .unwrap()
        .iter()
        .map(|v| v["seed"].clone())
        .collect();
    assert_eq!(seeds, [4, 5]);
}

#[test]
fn seeds_give_an_array_also_where_the_input_is_refused() {
    for verb in ["plan", "walk"] {
        let output = tensegra([verb, "no_such_file.toml", "--seeds", "1..2", "--json"]);
        assert_eq!(output.status.code(), Some(2));
        let value = json(&output);
        let [refused] = value.as_array().unwrap().as_slice() else {
            panic!("{value}");
        };
        assert_eq!(refused["solved"], false);
        assert!(refused["error"].as_str().unwrap().contains("no such file"));
    }
}

#[test]
fn no_plan_within_the_time_is_status_1_with_statistics() {
    let folder = tempfile::tempdir().unwrap();
    let output = tensegra([
        "plan".as_ref(),
        fixture("free_flying.toml").as_os_str(),
        "--time-limit".as_ref(),
        "1e-9".as_ref(),
        "--out".as_ref(),
        folder.path().as_os_str(),
        "--json".as_ref(),
    ]);
    assert_eq!(output.status.code(), Some(1));
    let value = json(&output);
    assert_eq!(value["solved"], false);
    assert!(value["statistics"].is_object());
}

#[test]
fn a_reader_that_has_left_is_no_failure() {
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let output = Command::new(env!("CARGO_BIN_EXE_tensegra"))
        .arg("info")
        .arg(fixture("kite.toml"))
        .stdout(writer)
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(0));
    assert!(output.stderr.is_empty());
}

#[test]
fn wrong_arguments_are_status_2() {
    for arguments in [
        &["plan"][..],
        &["paln", "x.toml"],
        &["plan", "x.toml", "--seeds", "5..1"],
        &["plan", "x.toml", "--time-limit", "-1"],
        &["check", "no_such_path.json"],
    ] {
        let output = tensegra(arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(!output.stderr.is_empty());
    }
}

#[test]
fn tracing_says_whether_and_why_it_stops() {
    let folder = tempfile::tempdir().unwrap();
    let trace = |file: &str, arguments: &[&str]| {
        let mut all = vec!["trace".to_owned(), fixture(file).display().to_string()];
        all.extend(arguments.iter().map(ToString::to_string));
        all.extend(["--json", "--out"].map(str::to_owned));
        all.push(folder.path().display().to_string());
        tensegra(&all)
    };
    // Reached: the path is written, and judged again from its file.
    let moved = ["--move", "c1:rest=0.3", "--move", "c2:rest=0.5"];
    let output = trace("kite.toml", &moved);
    assert_eq!(output.status.code(), Some(0));
    let value = json(&output);
    assert_eq!(value["stop"], "reached");
    assert_eq!(value["check"]["ok"], true);
    for file in [
        "path.mcap",
        "snapshots.svg",
        "forces.png",
        "rest_lengths.png",
    ] {
        assert!(folder.path().join(file).is_file(), "{file}");
    }
    let path = folder.path().join("path.json");
    let again = tensegra(["check".as_ref(), path.as_os_str()]);
    assert_eq!(again.status.code(), Some(0));
    // Not reached: the reason is given, and the path as far as it goes.
    let moved = ["--element", "c1", "--quantity", "rest", "--to", "0.4"];
    let output = trace("kite.toml", &moved);
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(json(&output)["stop"], "collision");
    assert_eq!(json(&output)["reason"], "s2 touches sp1");
    let output = trace("arch.toml", &["--move", "s1:rest=1"]);
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(json(&output)["stop"], "fold");
    // A trace can be smoothed: it has no goal.
    let smooth = folder.path().join("smooth");
    let flags = ["--json", "--out"].map(AsRef::as_ref);
    let [verb, path] = ["smooth".as_ref(), path.as_os_str()];
    let output = tensegra([verb, path, flags[0], flags[1], smooth.as_os_str()]);
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let again = tensegra(["check".as_ref(), smooth.join("path.json").as_os_str()]);
    assert_eq!(again.status.code(), Some(0));
    // A structure all of whose rest lengths are constant.
    let output = trace("prism.toml", &["--move", "s1:length=1.1"]);
    assert_eq!(output.status.code(), Some(0));
    assert!(folder.path().join("lengths.svg").is_file());
    // More motors than freedoms.
    let moves = ["c1:rest=0.4", "c2:rest=0.4", "c3:rest=0.4", "c4:rest=0.5"];
    let output = trace("kite.toml", &moves.map(|m| ["--move", m]).concat());
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(json(&output)["stop"], "too_many");
    // Bad input.
    for arguments in [
        &["--element", "c9", "--quantity", "rest", "--to", "1"][..],
        &["--element", "s1", "--quantity", "rest", "--to", "1"],
        &["--element", "c1", "--to", "1"],
        &["--move", "c1:colour=1"],
        &[],
    ] {
        let output = trace("kite.toml", arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
    }
}
