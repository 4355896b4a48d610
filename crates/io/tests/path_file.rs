//! Path files: what is written is read, bit for bit; what is wrong is named
//! with its place; and the problem is found again.

#[allow(dead_code)] // each test uses a part of it
#[path = "../examples/gallery/data.rs"]
mod data;

use std::{fs, path::Path};

use proptest::prelude::*;
use serde_json::{Value, json};
use tensegra_io::{
    PathFile, PathMismatch, PathWriteError, ReadError, read_path_file, write_path_file,
};
use tensegra_model::{Configuration, Problem};

/// Two struts and three cables around a triangle with a tail.
const PROBLEM: &str = r#"
name = "tail"

[structure]
planar = true
fixed = { a = [0, 0], b = [1, 0] }

[structure.elements]
s1 = { kind = "strut", nodes = ["a", "b"], length = 1, force = [-4, 0] }
s2 = { kind = "strut", nodes = ["a", "c"], length = 1, force = [-4, 0] }
c1 = { kind = "cable", nodes = ["b", "c"], length = [0, 3], stiffness = 9, rest = [0, 2] }
"#;

fn planned(problem: &Problem) -> PathFile {
    let configuration = Configuration {
        positions: vec![Default::default(); 3],
        lengths: vec![1.0; 3],
        rest_lengths: vec![None, None, Some(0.5)],
        forces: vec![Some(0.0); 3],
    };
    let path = tensegra_model::Path {
        configurations: vec![configuration],
    };
    PathFile::new(problem, path)
}

fn written(folder: &Path) -> (PathFile, std::path::PathBuf) {
    let (problem, path) = data::kite();
    let mut contents = PathFile::new(&problem, path);
    contents.statistics = json!({"planning_seconds": 0.0017, "charts": 12});
    contents.check = json!({"ok": true, "failures": []});
    let file = folder.join("path.json");
    write_path_file(&file, &contents).unwrap();
    (contents, file)
}

fn bits(configuration: &Configuration) -> Vec<Option<u64>> {
    let positions = configuration
        .positions
        .iter()
        .flat_map(|p| p.iter().copied());
    positions
        .chain(configuration.lengths.iter().copied())
        .map(Some)
        .chain(configuration.rest_lengths.iter().copied())
        .chain(configuration.forces.iter().copied())
        .map(|value| value.map(f64::to_bits))
        .collect()
}

#[test]
fn what_is_written_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let (contents, file) = written(folder.path());
    let read = read_path_file(&file).unwrap();
    assert_eq!(read, contents);
    for (a, b) in read
        .path
        .configurations
        .iter()
        .zip(&contents.path.configurations)
    {
        assert_eq!(bits(a), bits(b));
    }
    let text = fs::read_to_string(&file).unwrap();
    let lines = text
        .lines()
        .filter(|line| line.trim_start().starts_with("{\"positions\""));
    assert_eq!(
        lines.count(),
        contents.path.configurations.len(),
        "one line each"
    );
}

proptest! {
    #[test]
    fn every_number_survives(values in prop::collection::vec(
        any::<f64>().prop_filter("finite", |value| value.is_finite()), 9,
    )) {
        let folder = tempfile::tempdir().unwrap();
        let (problem, mut path) = data::kite();
        path.configurations.truncate(1);
        let configuration = &mut path.configurations[0];
        configuration.lengths.clone_from(&values);
        configuration.rest_lengths = values.iter().map(|&value| Some(value)).collect();
        configuration.rest_lengths[0] = None;
        for (position, value) in configuration.positions.iter_mut().zip(&values) {
            position.x = *value;
        }
        let before = bits(configuration);
        let file = folder.path().join("path.json");
        write_path_file(&file, &PathFile::new(&problem, path)).unwrap();
        let read = read_path_file(&file).unwrap();
        prop_assert_eq!(bits(&read.path.configurations[0]), before);
    }
}

#[test]
fn the_schema_describes_what_is_written() {
    let schema: Value =
        serde_json::from_str(include_str!("../../../docs/path.schema.json")).unwrap();
    let validator = jsonschema::validator_for(&schema).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let (_, file) = written(folder.path());
    let good: Value = serde_json::from_slice(&fs::read(file).unwrap()).unwrap();
    let errors: Vec<String> = validator
        .iter_errors(&good)
        .map(|e| e.to_string())
        .collect();
    assert_eq!(errors, [""; 0]);

    let page = include_str!("../../../docs/path-file.md");
    let (_, example) = page.split_once("```json\n").unwrap();
    let (example, _) = example.split_once("```").unwrap();
    let file = folder.path().join("example.json");
    fs::write(&file, example).unwrap();
    assert_eq!(read_path_file(&file).unwrap().nodes, ["a", "b", "c"]);
    assert!(validator.is_valid(&serde_json::from_str(example).unwrap()));

    // It is no schema that lets everything pass.
    for (pointer, value) in [
        ("/format", json!("other")),
        ("/version", json!(2)),
        ("/seed", json!(-1)),
        ("/elements/0/kind", json!("rope")),
        ("/elements/0/nodes", json!(["n1"])),
        ("/configurations", json!([])),
        ("/configurations/0/positions/0", json!([0.0, 1.0])),
        ("/configurations/0/lengths/0", Value::Null),
        ("/configurations/0/forces/0", json!("strong")),
        ("/problem", json!("kite.toml")),
    ] {
        let mut bad = good.clone();
        *bad.pointer_mut(pointer).unwrap() = value;
        assert!(!validator.is_valid(&bad), "{pointer}");
    }
}

/// Reads `text` as a path file and returns what is said of it, without the name
/// of the file.
fn complaint(text: impl AsRef<[u8]>) -> String {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("path.json");
    fs::write(&file, text).unwrap();
    let failure = read_path_file(&file).unwrap_err().to_string();
    assert!(failure.contains("path.json"), "{failure}");
    failure.replace(&file.display().to_string(), "")
}

#[test]
fn what_is_no_path_file_is_refused() {
    let missing = read_path_file(Path::new("/nowhere/path.json")).unwrap_err();
    assert!(matches!(missing, ReadError::Unreadable { .. }), "{missing}");
    assert!(complaint("").starts_with(":1:1: the file is empty"));
    assert!(complaint(" \n ").contains("empty"));
    assert!(complaint(b"{\n  \"a\xff\"").starts_with(":2:5: this is not UTF-8"));
    assert!(complaint("{\"format\": 3,\n oops}").starts_with(":2:2: "));
    assert!(complaint("[1, 2]").starts_with(":1:"));
    assert!(complaint("{}").contains("no `format`"));
    let other = complaint(r#"{"format": "tensegra-walk", "version": 1}"#);
    assert!(other.contains("`tensegra-walk` version 1"), "{other}");
    let later = complaint(r#"{"format": "tensegra-path", "version": 9}"#);
    assert!(later.contains("version 9"), "{later}");
}

#[test]
fn contradictions_are_named_with_their_place() {
    let folder = tempfile::tempdir().unwrap();
    let (_, file) = written(folder.path());
    let text = fs::read_to_string(file).unwrap();
    let change = |from: &str, to: &str| {
        assert!(text.contains(from), "{from}");
        complaint(text.replacen(from, to, 1))
    };
    let line_of = |needle: &str| {
        let before = &text[..text.find(needle).unwrap()];
        before.matches('\n').count() + 1
    };

    let twice = change("    \"n2\"", "    \"n1\"");
    let place = format!(":{}:5: two nodes are called `n1`", line_of("    \"n2\""));
    assert_eq!(twice, place);
    let twice = change("\"id\": \"s2\"", "\"id\": \"s1\"");
    assert!(twice.contains("two elements are called `s1`"), "{twice}");
    let unknown = change("\"nodes\": [\"n3\", \"n4\"]", "\"nodes\": [\"n3\", \"x\"]");
    assert!(unknown.contains("element `s2` ends at `x`"), "{unknown}");
    let kind = change("\"kind\": \"strut\"", "\"kind\": \"rope\"");
    assert!(
        kind.starts_with(&format!(":{}:", line_of("\"kind\": \"strut\""))),
        "{kind}"
    );
    assert!(
        kind.contains("`rope` is no kind of element; one of `strut`"),
        "{kind}"
    );
    let short = change("\"lengths\": [", "\"lengths\": [1.0, ");
    let place = format!(":{}:", line_of("\"lengths\": ["));
    assert!(short.starts_with(&place), "{short}");
    assert!(
        short.contains("configuration 0 has 10 lengths, but there are 9 elements"),
        "{short}"
    );
    let infinite = change("\"lengths\": [", "\"lengths\": [1e999, ");
    assert!(infinite.starts_with(&place), "{infinite}");
}

#[test]
fn what_cannot_be_read_back_is_not_written() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("path.json");
    let (problem, path) = data::kite();
    let attempt = |change: &dyn Fn(&mut Vec<Configuration>)| {
        let mut path = path.clone();
        change(&mut path.configurations);
        let failure = write_path_file(&file, &PathFile::new(&problem, path)).unwrap_err();
        assert!(!file.exists());
        match failure {
            PathWriteError::Path(mismatch) => mismatch,
            other => panic!("{other}"),
        }
    };
    assert_eq!(attempt(&|all| all.clear()), PathMismatch::Empty);
    let nan = attempt(&|all| all[3].positions[1].y = f64::NAN);
    assert!(
        nan.to_string()
            .contains("configuration 3: the position of node `n2`"),
        "{nan}"
    );
    let infinite = attempt(&|all| all[0].forces[4] = Some(f64::INFINITY));
    assert!(
        infinite.to_string().contains("the force of element `c2`"),
        "{infinite}"
    );
    let missing = attempt(&|all| {
        all[2].forces.pop();
    });
    assert!(
        missing.to_string().contains("configuration 2 has 8 forces"),
        "{missing}"
    );

    let blocked = folder.path().join("file");
    fs::write(&blocked, "").unwrap();
    let contents = PathFile::new(&problem, path.clone());
    let failure = write_path_file(&blocked.join("path.json"), &contents).unwrap_err();
    assert!(matches!(failure, PathWriteError::Write(_)), "{failure}");
}

#[test]
fn the_problem_is_found_wherever_the_folders_go() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path().canonicalize().unwrap();
    let [one, two] = ["one", "two"].map(|name| folder.join(name));
    fs::create_dir_all(&one).unwrap();
    fs::write(one.join("tail.toml"), PROBLEM).unwrap();
    let problem = Problem::read(&one.join("tail.toml")).unwrap();
    let file = one.join("out/tail/path.json");
    write_path_file(&file, &planned(&problem)).unwrap();
    let read = read_path_file(&file).unwrap();
    assert_eq!(read.problem.relative.as_deref(), Some("../../tail.toml"));
    assert_eq!(
        read.read_problem(&file).unwrap().structure,
        problem.structure
    );

    // The whole folder moves: the place seen from the path file holds.
    fs::rename(&one, &two).unwrap();
    let file = two.join("out/tail/path.json");
    let found = read_path_file(&file).unwrap().read_problem(&file).unwrap();
    assert_eq!(
        found.source.unwrap().canonicalize().unwrap(),
        two.join("tail.toml")
    );

    // The path file alone moves: the absolute place holds.
    let contents = planned(&found_at(&two));
    write_path_file(&file, &contents).unwrap();
    let elsewhere = folder.join("elsewhere.json");
    fs::rename(&file, &elsewhere).unwrap();
    let read = read_path_file(&elsewhere).unwrap();
    assert!(read.read_problem(&elsewhere).is_ok());

    // The problem changes, breaks, and goes.
    fs::write(
        two.join("tail.toml"),
        PROBLEM.replace("stiffness = 9", "stiffness = 8"),
    )
    .unwrap();
    let changed = read.read_problem(&elsewhere).unwrap_err();
    assert!(
        matches!(&changed, ReadError::ProblemChanged { changed, .. } if changed == "tail.toml")
    );
    fs::write(two.join("tail.toml"), "name = ").unwrap();
    let broken = read.read_problem(&elsewhere).unwrap_err();
    assert!(matches!(broken, ReadError::Problem(_)), "{broken}");
    fs::remove_file(two.join("tail.toml")).unwrap();
    let missing = read.read_problem(&elsewhere).unwrap_err();
    assert!(
        matches!(missing, ReadError::ProblemMissing { .. }),
        "{missing}"
    );
    assert!(missing.to_string().contains("tail.toml"), "{missing}");
}

fn found_at(folder: &Path) -> Problem {
    Problem::read(&folder.join("tail.toml")).unwrap()
}

#[test]
fn a_path_of_another_structure_is_told_apart() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("tail.toml"), PROBLEM).unwrap();
    let problem = found_at(folder.path());
    let file = Path::new("path.json");
    let complaint = |change: &dyn Fn(&mut PathFile)| {
        let mut contents = planned(&problem);
        change(&mut contents);
        contents
            .check_structure(file, &problem)
            .unwrap_err()
            .to_string()
    };
    assert!(planned(&problem).check_structure(file, &problem).is_ok());
    let short = complaint(&|contents| drop(contents.nodes.pop()));
    assert!(
        short.contains("it has 2 nodes, the problem has 3"),
        "{short}"
    );
    let renamed = complaint(&|contents| contents.nodes[1] = "x".into());
    assert!(
        renamed.contains("its node `x` is `b` in the problem"),
        "{renamed}"
    );
    let turned = complaint(&|contents| contents.elements[2].nodes.reverse());
    assert!(
        turned.contains("its cable `c1` from `c` to `b`"),
        "{turned}"
    );

    let (invented, path) = data::kite();
    let nameless = PathFile::new(&invented, path)
        .read_problem(file)
        .unwrap_err();
    assert!(
        matches!(nameless, ReadError::NoProblem { .. }),
        "{nameless}"
    );
}
