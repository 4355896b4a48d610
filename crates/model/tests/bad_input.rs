//! Files that must be refused: each with what is wrong, where, and a hint.

use std::{fs, io::Write, path::PathBuf};

use miette::Diagnostic;
use tensegra_model::{Finding, Problem, ReadErrors};

fn bad(name: &str) -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/bad")).join(name)
}

fn refuse(path: PathBuf) -> ReadErrors {
    match Problem::read(&path) {
        Ok(_) => panic!("{} must be refused", path.display()),
        Err(errors) => errors,
    }
}

/// An error: line, column, the text underlined, part of the message, part of the hint.
type Expected = (usize, usize, &'static str, &'static str, &'static str);

fn check(name: &str, expected: &[Expected]) {
    let errors = refuse(bad(name));
    assert_eq!(errors.errors().len(), expected.len(), "{errors:#}");
    for (error, &(line, column, excerpt, message, hint)) in errors.errors().iter().zip(expected) {
        assert!(error.path().ends_with(name), "{error:#}");
        assert_eq!(error.position(), Some((line, column)), "{error:#}");
        assert_eq!(error.excerpt(), Some(excerpt), "{error:#}");
        assert!(error.message().contains(message), "{error:#}");
        assert!(error.hint().unwrap_or("").contains(hint), "{error:#}");
    }
}

#[test]
fn a_syntax_error() {
    let errors = refuse(bad("syntax_error.toml"));
    assert!(errors.errors().len() >= 2, "{errors:#}");
    let lines: Vec<usize> = errors
        .errors()
        .iter()
        .map(|error| error.position().unwrap().0)
        .collect();
    assert!(lines.contains(&3) && lines.contains(&12), "{errors:#}");
    check(
        "syntax_error.tens",
        &[
            (3, 18, "lenght", "`length` is expected here", ""),
            (4, 12, "a", "`:` is expected here", ""),
        ],
    );
}

#[test]
fn an_unknown_node() {
    check(
        "unknown_node.toml",
        &[(19, 1, "bb = [1, 0]", "there is no node `bb`", "")],
    );
}

#[test]
fn a_negative_radius() {
    // The type has it, and both struts of the type.
    let error = (6, 65, "-0.1", "the radius is negative: -0.1", "");
    check("negative_radius.toml", &[error, error]);
}

#[test]
fn a_range_with_lo_above_hi() {
    let message = "the range of the length is empty: [3, 0]";
    let error = (7, 36, "[3, 0]", message, "the smaller end comes first");
    check("empty_range.toml", &[error; 4]);
}

#[test]
fn nan_and_infinity() {
    let infinite = (
        6,
        36,
        "inf",
        "the length is inf, which is no finite number",
        "",
    );
    let nan = (
        7,
        56,
        "nan",
        "the stiffness is NaN, which is no finite number",
        "",
    );
    check("nan.toml", &[infinite, infinite, nan, nan, nan, nan]);
    check(
        "no_finite_number.tens",
        &[
            (5, 25, "1/zero", "division by zero", ""),
            (
                6,
                25,
                "sqrt(-1)",
                "the square root of a negative number",
                "",
            ),
            (7, 29, "1e999", "the number is out of range", ""),
        ],
    );
}

#[test]
fn an_element_between_a_node_and_itself() {
    let nodes = "[\"d\", \"d\"]";
    let hint = "two different nodes";
    check(
        "loop.toml",
        &[(
            15,
            32,
            nodes,
            "cable `c4`: it joins node `d` to itself",
            hint,
        )],
    );
}

#[test]
fn two_elements_with_one_name() {
    check("same_name.toml", &[(15, 1, "c3", "duplicate key", "")]);
}

#[test]
fn a_disconnected_structure() {
    let message = "the structure falls apart: `e` cannot be reached from `a` along elements";
    check(
        "disconnected.toml",
        &[(
            16,
            44,
            "[\"e\", \"f\"]",
            message,
            "add the elements that join the parts",
        )],
    );
}

#[test]
fn unknown_keys() {
    check(
        "unknown_key.toml",
        &[
            (
                7,
                44,
                "stifness",
                "no key `stifness`",
                "did you mean `stiffness`?",
            ),
            (3, 1, "planer", "no key `planer`", "did you mean `planar`?"),
            (18, 1, "steps", "no key `steps`", "did you mean `step`?"),
        ],
    );
}

#[test]
fn several_errors_in_one_run() {
    check(
        "several.toml",
        &[
            (2, 8, "-1", "a whole number from 0 is expected here", ""),
            (9, 15, "\"stick\"", "one of \"strut\", \"bar\"", ""),
            (9, 1, "s1", "element `s1` has no kind", "kind ="),
            (
                10,
                54,
                "sqrt(-1)",
                "the square root of a negative number",
                "",
            ),
            (10, 1, "s2", "element `s2` has no length", ""),
            (11, 1, "c1", "element `c1` has no length", "length = "),
            (6, 15, "[1, 0, 0, 0]", "[x, y] is expected here", ""),
            (14, 12, "true", "a table is expected here", ""),
        ],
    );
}

/// The only error, which must be about a file as a whole.
fn about_file(errors: &ReadErrors) -> &Finding {
    assert_eq!(errors.errors().len(), 1, "{errors:#}");
    let error = &errors.errors()[0];
    assert_eq!((error.position(), error.excerpt()), (None, None));
    error
}

#[test]
fn a_missing_file() {
    let errors = refuse(bad("../kit.toml"));
    let error = about_file(&errors);
    assert_eq!(error.message(), "there is no such file");
    assert_eq!(error.hint(), Some("did you mean `kite.toml`?"));
}

#[test]
fn a_folder() {
    let errors = refuse(bad(""));
    assert!(about_file(&errors).message().contains("this is a folder"));
}

#[test]
fn an_empty_file() {
    let errors = refuse(bad("empty.toml"));
    assert_eq!(about_file(&errors).message(), "the file is empty");
}

#[test]
fn binary_files() {
    for (name, byte) in [("binary.toml", "byte 25 "), ("not_utf8.tens", "byte 20 ")] {
        let errors = refuse(bad(name));
        let message = about_file(&errors).message();
        assert!(message.contains("not a text file"), "{message}");
        assert!(message.contains(byte), "{message}");
    }
}

#[test]
fn a_file_of_100_megabytes_is_refused_by_its_size() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["large.toml", "large.tens"] {
        let path = folder.path().join(name);
        // Sparse: takes neither room nor time, unless it is read.
        fs::File::create(&path).unwrap().set_len(100 << 20).unwrap();
        let errors = refuse(path);
        let message = about_file(&errors).message();
        assert!(
            message.contains("too large: 104857600 bytes; at most 16777216"),
            "{message}"
        );
    }
}

#[test]
fn a_file_of_another_kind() {
    let errors = refuse(bad("../meshes/box_with_round_hole.off"));
    assert_eq!(about_file(&errors).message(), "this is no problem file");
}

#[test]
fn hopeless_input_ends_soon_and_is_summed_up() {
    let folder = tempfile::tempdir().unwrap();
    let mut large = Vec::new();
    // A hundred thousand elements that all fall apart, and as many unknown names.
    writeln!(large, "[STRUCTURE]").unwrap();
    for index in 0..100_000 {
        writeln!(large, "bar e{index} : a{index} b{index} length 1").unwrap();
    }
    writeln!(large, "[FIXED POINTS]").unwrap();
    for index in 0..100_000 {
        writeln!(large, "c{index}(x) = 0").unwrap();
    }
    let path = folder.path().join("large.tens");
    fs::write(&path, &large).unwrap();
    let errors = refuse(path);
    assert_eq!(errors.errors().len() + errors.omitted(), 100_001);
    assert!(errors.errors()[0].message().contains("and 99993 more"));

    // Brackets that never close, and a text of one endless line.
    for (name, text) in [
        ("deep.toml", "a = ".to_string() + &"[".repeat(1_000_000)),
        (
            "deep.tens",
            "[CONSTANTS] a := ".to_string() + &"(".repeat(1_000_000),
        ),
        (
            "line.tens",
            "[CONSTANTS] ".to_string() + &"a ".repeat(1_000_000),
        ),
        ("line.toml", "a ".repeat(1_000_000)),
    ] {
        let path = folder.path().join(name);
        fs::write(&path, text).unwrap();
        assert!(!refuse(path).errors().is_empty());
    }
}

#[test]
fn all_pairs_of_very_many_bodies_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mut text = "[STRUCTURE]\n".to_string();
    for index in 0..3_000 {
        text += &format!("bar e{index} : n{index} n{} length 1\n", index + 1);
    }
    text += "[COLLISIONS] check: all";
    let path = folder.path().join("many.tens");
    fs::write(&path, text).unwrap();
    let errors = refuse(path);
    let error = &errors.errors()[0];
    assert!(error.message().contains("4498500 pairs"), "{error:#}");
    assert_eq!(error.excerpt(), Some("all"));
}

#[test]
fn a_renderer_gets_source_label_and_help() {
    let errors = refuse(bad("loop.toml"));
    let related: Vec<&dyn Diagnostic> = errors.related().unwrap().collect();
    assert_eq!(related.len(), 1);
    let error = related[0];
    let label = error.labels().unwrap().next().unwrap();
    let source = error.source_code().unwrap();
    let shown = source.read_span(label.inner(), 0, 0).unwrap();
    let text = std::str::from_utf8(shown.data()).unwrap();
    assert_eq!(text, r#"["d", "d"]"#);
    assert!(shown.name().unwrap().ends_with("loop.toml"));
    assert_eq!(shown.line(), 14);
    assert!(
        error
            .help()
            .unwrap()
            .to_string()
            .contains("two different nodes")
    );
}
