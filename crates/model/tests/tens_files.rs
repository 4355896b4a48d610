//! Structure files in the `.tens` language, with their `.param` and `.links` files.

use std::{fs, path::PathBuf};

use nalgebra::{Point3, Rotation3, Vector3};
use tensegra_model::{
    Body, Coupling, ElementKind, FixedCoordinate, ForceLaw, Interval, PlannerSettings, Problem,
    Role, SamplingRadius, Severity, Shape,
};

fn fixture(name: &str) -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures")).join(name)
}

/// Reads a text as a `.tens` file; the errors as one text.
fn read(text: &str) -> Result<Problem, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tens");
    fs::write(&path, text).unwrap();
    let prefix = format!("{}/", folder.path().display());
    Problem::read(&path).map_err(|errors| format!("{errors:#}").replace(&prefix, ""))
}

/// The errors of a text that must be refused.
fn refused(text: &str) -> String {
    match read(text) {
        Ok(_) => panic!("this must be refused:\n{text}"),
        Err(errors) => errors,
    }
}

#[test]
fn every_feature_of_the_language_is_read() {
    let problem = Problem::read(&fixture("tens/features.tens")).unwrap();
    let structure = &problem.structure;
    let names: Vec<&str> = structure.nodes.iter().map(|n| n.name.as_str()).collect();
    assert_eq!(names, ["p1", "p2", "p3", "p4", "p5"]);
    assert_eq!(structure.dimension, 3);
    assert_eq!(structure.pretension, Some(1.0));
    assert_eq!(structure.base_range, None);

    let element = |name: &str| &structure.elements[structure.element_index(name).unwrap()];
    let free = Interval::new(f64::NEG_INFINITY, f64::INFINITY);
    let b1 = element("b1");
    assert_eq!(b1.kind, ElementKind::Bar);
    assert_eq!((b1.law, b1.force, b1.radius), (ForceLaw::Free, free, 0.025));
    let b2 = element("b2");
    assert_eq!((b2.force, b2.radius), (Interval::new(-20.0, 30.0), 0.01));
    assert_eq!(b2.appearance.granularity, Some(12));
    let attributes: Vec<(&str, usize)> = b2
        .dynamics
        .iter()
        .map(|(keyword, values)| (keyword.as_str(), values.len()))
        .collect();
    assert_eq!(
        attributes,
        [
            ("mass", 1),
            ("inertial frame", 12),
            ("inertia", 6),
            ("velocity", 1),
            ("acceleration", 1),
            ("effort", 1),
            ("cost", 1),
            ("friction", 1),
            ("damping", 1),
        ]
    );
    // Rotation first, then the way along x: rows of [R | t].
    let frame = [0.0, -1.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    for (value, expected) in b2.dynamics[1].1.iter().zip(frame) {
        assert!((value - expected).abs() < 1e-15);
    }
    let rope = element("rope");
    assert_eq!(rope.law, ForceLaw::Free);
    assert_eq!(rope.force, Interval::new(0.0, f64::INFINITY));
    assert_eq!(rope.radius, 0.003_125);
    assert_eq!(rope.appearance.color.as_deref(), Some("purple"));
    let tendon = element("tendon");
    assert_eq!(tendon.appearance.role, Role::Hidden);
    assert_eq!(
        tendon.law,
        ForceLaw::Linear {
            stiffness: 0.5,
            rest: Interval::new(0.0, 2.0)
        }
    );
    // 0.5 (l − r) over [0, 4] and [0, 2], in tension.
    assert_eq!(tendon.force, Interval::new(0.0, 2.0));
    let ram = element("ram");
    assert_eq!(ram.stiffness(), Some(-0.5));
    assert!((ram.force.lo + 0.5 * (8.0_f64.sqrt() - 0.5)).abs() < 1e-12);
    assert!((ram.force.hi + 0.5 * (2.0_f64.sqrt() - 0.5)).abs() < 1e-8);
    let coil = element("coil");
    assert_eq!((coil.force, coil.radius), (Interval::new(0.0, 2.0), 0.02));
    assert_eq!(coil.appearance.loops, Some(30));
    let tail = element("tail");
    assert_eq!((tail.law, tail.length.lo), (ForceLaw::None, 1.0));
    assert_eq!(tail.appearance.role, Role::Decoration);
    assert_eq!(element("loose").rest(), Some(Interval::constant(0.0)));
    assert_eq!(element("loose").radius, 0.006_25);

    let plate = &structure.attachments[0];
    assert_eq!(
        plate.shapes[0].shape,
        Shape::Box {
            min: Point3::new(0.0, 0.0, 0.1),
            max: Point3::new(2.0, 2.0, 0.2)
        }
    );
    assert_eq!(plate.shapes[1].role, Role::Decoration);
    assert_eq!(plate.anchors[2].node, 2);
    assert_eq!(plate.anchors[2].local, Point3::new(2.0, 2.0, 0.0));

    let fixed = |node, axis, value| FixedCoordinate { node, axis, value };
    assert_eq!(
        structure.fixed,
        [
            fixed(0, 0, 0.0),
            fixed(0, 1, 0.0),
            fixed(0, 2, 0.0),
            fixed(1, 1, 0.0),
            fixed(1, 2, 0.0),
            fixed(2, 0, 2.0),
            fixed(2, 1, 2.0),
            fixed(2, 2, 0.0),
        ]
    );
    assert_eq!(structure.nodes[3].load, Vector3::new(0.0, 0.25, -1.0));
    let balanced: Vec<bool> = structure.nodes.iter().map(|n| n.balanced).collect();
    assert_eq!(balanced, [false, true, false, true, true]);

    let index = |name: &str| structure.element_index(name).unwrap();
    let quarter = Rotation3::from_axis_angle(&Vector3::z_axis(), -std::f64::consts::FRAC_PI_2);
    assert_eq!(
        structure.couplings[..2],
        [
            Coupling::Length {
                reference: index("coil"),
                followers: vec![(index("loose"), 1.0)]
            },
            Coupling::Force {
                reference: index("coil"),
                followers: vec![(index("loose"), 0.5)]
            },
        ]
    );
    match &structure.couplings[2] {
        Coupling::Orientation {
            reference,
            followers,
        } => {
            assert_eq!((*reference, followers[0].0), (index("b1"), index("b2")));
            assert!((followers[0].1.matrix() - quarter.matrix()).norm() < 1e-15);
        }
        other => panic!("{other:?}"),
    }

    let obstacles = &problem.environment.obstacles;
    assert_eq!(
        obstacles[0].shape,
        Shape::Box {
            min: Point3::new(-4.0, -4.0, -1.0),
            max: Point3::new(4.0, 4.0, -0.5)
        }
    );
    assert_eq!(obstacles[1].role, Role::Hidden);
    match &obstacles[3].shape {
        Shape::Mesh { vertices, .. } => assert_eq!(vertices.len(), 88),
        other => panic!("{other:?}"),
    }

    // Seven elements and the plate collide; of the elements, only b1 with b2 is
    // tested of all that share a node.
    let body = |body: &Body| match *body {
        Body::Element(index) => structure.elements[index].name.as_str(),
        Body::Attachment(index) => structure.attachments[index].name.as_str(),
        Body::Obstacle(index) => obstacles[index].name.as_str(),
    };
    let pairs: Vec<String> = problem
        .environment
        .pairs
        .iter()
        .map(|[a, b]| format!("{} {}", body(a), body(b)))
        .collect();
    let tested = |pair: &str| pairs.iter().any(|found| found == pair);
    assert!(tested("b1 b2") && tested("b1 rope") && tested("coil plate"));
    assert!(tested("coil wedge") && tested("b1 floor") && tested("plate post"));
    assert!(!tested("b2 rope") && !tested("b1 wedge") && !tested("plate floor"));
    assert!(
        !pairs
            .iter()
            .any(|pair| pair.contains("tail") || pair.contains("rock"))
    );

    let notes: Vec<(Severity, &str)> = problem
        .notices
        .iter()
        .map(|notice| (notice.severity(), notice.message()))
        .collect();
    assert_eq!(notes[0], (Severity::Note, "diagonal = 2.8284271247461903"));
    assert_eq!(notes.len(), 2);
    // Neither parameters nor configurations stand beside the file.
    assert_eq!(problem.settings, PlannerSettings::default());
    assert!(problem.start.is_none() && problem.goal.is_none());
}

#[test]
fn siblings_give_parameters_start_and_goal() {
    let problem = Problem::read(&fixture("tens/kite.tens")).unwrap();
    assert_eq!(problem.name, "kite");
    assert_eq!(problem.structure.pretension, Some(4.0));
    assert_eq!(problem.structure.elements[3].stiffness(), Some(16.0));
    assert_eq!(problem.settings.sampling_radius, SamplingRadius::Fixed(3.0));
    assert_eq!(problem.settings.expected_dimension, Some(3));
    assert_eq!(problem.files.len(), 3);
    let names: Vec<_> = problem
        .files
        .iter()
        .map(|file| file.path().file_name().unwrap().to_str().unwrap())
        .collect();
    assert_eq!(names, ["kite.tens", "kite.param", "kite.links"]);

    // The same problem as the problem file states.
    let other = Problem::read(&fixture("kite.toml")).unwrap();
    assert_eq!(problem.structure, other.structure);
    assert_eq!(problem.environment, other.environment);
    for (ours, theirs) in [(&problem.start, &other.start), (&problem.goal, &other.goal)] {
        let (ours, theirs) = (ours.as_ref().unwrap(), theirs.as_ref().unwrap());
        for (p, q) in ours.positions.iter().zip(&theirs.positions) {
            assert!((p - q).norm() < 1e-8, "{p} {q}");
        }
        for (f, g) in ours.forces.iter().zip(&theirs.forces) {
            assert_eq!(f.is_some(), g.is_some());
            assert!((f.unwrap_or(0.0) - g.unwrap_or(0.0)).abs() < 1e-9);
        }
    }
}

const STRUT: &str = "[STRUCTURE] strut s : a b length 1 cable c : b a length [0,2] stiffness 1\n";

#[test]
fn free_flying_structures_have_a_base_and_no_fixed_points() {
    let text = "[CONSTANTS] r := 3 [FREE FLYING PLANAR STRUCTURE r, 2*r] strut s : a b length 1
        cable c : b a length [0,2] stiffness 1";
    let structure = read(text).unwrap().structure;
    assert_eq!(structure.dimension, 2);
    assert_eq!(structure.base_range, Some(Vector3::new(3.0, 6.0, 0.0)));
    assert_eq!(structure.fixed, []);
    let spatial = text.replace("PLANAR STRUCTURE r, 2*r", "STRUCTURE r, r, r");
    assert_eq!(
        read(&spatial).unwrap().structure.base_range,
        Some(Vector3::new(3.0, 3.0, 3.0))
    );
    let fixed = format!("{text} [FIXED POINTS] a(x) = 0");
    assert!(refused(&fixed).contains("free-flying structure cannot be fixed"));
    let negative = text.replace("r := 3", "r := -3");
    assert!(refused(&negative).contains("the half range is negative: -3"));
}

#[test]
fn a_pretension_of_zero_prescribes_none() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tens");
    fs::write(&path, STRUT).unwrap();
    assert_eq!(
        Problem::read(&path).unwrap().structure.pretension,
        Some(1.0)
    );
    fs::write(path.with_extension("param"), "PRETENSION = 0").unwrap();
    assert_eq!(Problem::read(&path).unwrap().structure.pretension, None);
}

#[test]
fn what_is_not_understood_is_refused_with_line_and_column() {
    for (text, error) in [
        (
            "[STRUCTUR] ",
            "a.tens:1:2: there is no such section (did you mean `STRUCTURE`?)",
        ),
        (
            "strut s : a b",
            "a.tens:1:1: the title of a section, such as [STRUCTURE], is expected here",
        ),
        (
            "[STRUCTURE]\n  strut s : a b lenght 1",
            "a.tens:2:17: `length` is expected here",
        ),
        (
            "[STRUCTURE]\n  rod s : a b length 1",
            "a.tens:2:3: `rod` is neither an attribute nor a kind of element",
        ),
        (
            "[STRUCTURE]\n strut s : a b length 1 redd",
            "a.tens:2:25: `redd` is neither an attribute nor a kind of element (did you mean `red`?)",
        ),
        (
            "[STRUCTURE] strut s : a b length 1 radius 1 force 0",
            "a.tens:1:45: `force` is not expected here",
        ),
        (
            "[STRUCTURE] strut s : a b length 1 red red",
            "`red` is not expected here",
        ),
        (
            "[STRUCTURE] strut s : a b length [1",
            "a.tens:1:36: the text ends here, but `,` is expected",
        ),
        (
            "[STRUCTURE] strut s : a b length 1 loops 1.5",
            "a whole number",
        ),
        (
            "[STRUCTURE] strut s : a b length 1 mass",
            "a value is expected",
        ),
        ("[STRUCTURE] [PLANAR STRUCTURE]", "one structure"),
        ("[FREE FLYING STRUCTURE 1,2] ", "`,` is expected here"),
        (
            "[CONSTANTS] a := 1 a := 2",
            "the constant `a` is defined already",
        ),
        (
            "[CONSTANTS] a := b b := 1",
            "a.tens:1:18: there is no constant `b`",
        ),
        ("[CONSTANTS] print a", "there is no constant `a`"),
        (
            "[CONSTANTS] a := $",
            "a.tens:1:18: this character has no meaning here",
        ),
        (
            "[COLLISIONS] check: connected",
            "connected elements cannot be checked",
        ),
        (
            "[COLLISIONS] chek: all",
            "`check :` or `do not check :` is expected here",
        ),
        (
            "[OBSTACLES] o : ball 1 (0,0,0)",
            "a shape (box, sphere, cylinder, prism or body) is expected here",
        ),
        ("[OBSTACLES] o : sphere 1 (0,0)", "`,` is expected here"),
        (
            "[OBSTACLES] o : sphere 1 (0,0,0) rde",
            "`rde` is no colour, and neither `decoration` nor `hidden` (did you mean `red`?)",
        ),
        (
            "[OBSTACLES] o : body stone.off",
            "the name of a file in quotes is expected here",
        ),
        (
            "[COUPLE] width : a, b",
            "`length`, `rest`, `force` or `orientation` is expected here",
        ),
        (
            "[COUPLE] orientation : a, [2] b",
            "a rotation (Rx, Ry or Rz) is expected here",
        ),
        ("[FORCES] no null : a", "`no null force :` is expected here"),
        (
            "[FIXED POINTS] a(w) = 1",
            "`x`, `y` or `z` is expected here",
        ),
        ("[ADDONS] p : (0,0,0) a (1,0,0) b", "`(` is expected"),
        ("[CONSTANTS] a := 1", "there is no structure"),
    ] {
        let errors = refused(text);
        assert!(errors.contains(error), "{text}\n  gives\n{errors}");
    }
}

#[test]
fn one_run_tells_of_the_errors_of_all_statements() {
    let errors = refused(
        "[CONSTANTS]\n a := 1/0\n b := a + )\n c := 2*a
[STRUCTURE]\n strut s1 : a b length q\n strut s2 a b length 1\n cable c1 : a b length [0,1]\n
[OBSTACLES]\n o1 : sphere (0,0,0)\n o2 : cube\n",
    );
    let places: Vec<&str> = errors
        .lines()
        .map(|line| line.split(": ").next().unwrap())
        .collect();
    assert_eq!(
        places,
        [
            "a.tens:2:7",
            "a.tens:3:11",
            "a.tens:6:24",
            "a.tens:7:11",
            "a.tens:11:16",
            "a.tens:12:7"
        ],
        "{errors}"
    );
}

#[test]
fn one_run_tells_of_all_flaws_of_a_structure() {
    let errors = refused(
        "[STRUCTURE]
 strut s1 : a b length 1 stiffness 2
 strut s1 : b c length -1
 cable c1 : a a length [2,1] stiffness 1
 spring c2 : c a length [0,1] stiffness -1 rest [0,1]
 prismatic p : a c length [1,3] stiffness 1
[FIXED POINTS] z(x) = 0
[COUPLE] force : s1, c2, q
[FORCES] a (1,0,0) no null force : y",
    );
    for error in [
        "a.tens:2:36: strut `s1`: a strut of constant length has no stiffness",
        "a.tens:3:8: strut `s1`: the name `s1` is taken by strut `s1`",
        "a.tens:3:24: strut `s1`: the length is negative: -1",
        "a.tens:4:13: cable `c1`: it joins node `a` to itself",
        "a.tens:4:24: cable `c1`: the range of the length is empty: [2, 1]",
        "a.tens:5:49: spring `c2`: the rest length of a spring is constant, but here it may vary",
        "a.tens:5:41: spring `c2`: the stiffness is negative: -1",
        "a.tens:6:27: prismatic `p`: it extends by 2, which is more than its shortest length 1",
        "a.tens:7:16: fixed coordinate x of node `z`: there is no node `z`",
        "a.tens:8:22: coupling of force to `s1`: `c2` (spring, force by stiffness) and `s1` (strut, free force) cannot be coupled",
        "a.tens:8:26: coupling of force to `s1`: there is no element `q`",
        "a.tens:9:36: exemption from force balance: there is no node `y`",
    ] {
        assert!(errors.contains(error), "{error}\n  is not in\n{errors}");
    }
}

#[test]
fn names_must_exist_before_they_are_used() {
    let late = format!("[FIXED POINTS] b(y) = 0\n{STRUT}");
    assert!(refused(&late).contains("a.tens:1:16: `b` is used before it is declared"));
    let late = format!("{STRUT}[COLLISIONS] check: o [OBSTACLES] o : sphere 1 (5,0,0)");
    assert!(refused(&late).contains("a.tens:2:21: `o` is used before it is declared"));
    let unknown = format!("{STRUT}[COLLISIONS] check: s, ball [OBSTACLES] wall : sphere 1 (5,0,0)");
    assert!(refused(&unknown).contains("there is no element, attachment or obstacle `ball`"));
}

#[test]
fn environments_are_validated() {
    let with = |text: &str| refused(&format!("{STRUT}{text}"));
    for (text, error) in [
        (
            "[OBSTACLES] o : sphere -1 (0,0,0)",
            "a.tens:2:13: obstacle `o`: sphere",
        ),
        (
            "[OBSTACLES] o : box (0,0,0) (0,1,1)",
            "a.tens:2:13: obstacle `o`: box",
        ),
        (
            "[OBSTACLES] s : sphere 1 (0,0,0)",
            "the name `s` is taken by an element",
        ),
        (
            "[OBSTACLES] o : sphere 1 (0,0,0) o : sphere 1 (0,0,0)",
            "the name `o` is taken by another obstacle",
        ),
        ("[COLLISIONS] check: s", "`s` is no obstacle"),
        ("[COLLISIONS] check: s, s", "`s` cannot collide with itself"),
        (
            "[OBSTACLES] o : sphere 1 (0,0,0) decoration [COLLISIONS] check: s, o",
            "`o` is a decoration",
        ),
        (
            "[OBSTACLES] o : sphere 1 (0,0,0) p : sphere 1 (9,0,0) [COLLISIONS] check: o, p",
            "`o` and `p` are both obstacles",
        ),
        (
            "[OBSTACLES] o : body \"none.off\"",
            "none.off: there is no such file",
        ),
        (
            "[OBSTACLES] o : body \"none.off\"",
            "this mesh cannot be read",
        ),
        (
            "[ADDONS] p : (0,0,0) a (1,0,0) b (0,1,0) a",
            "it has no shape",
        ),
        (
            "[ADDONS] p : sphere 1 (0,0,0) (0,0,0) a (1,0,0) b (0,1,0) a",
            "two anchors are at node `a`",
        ),
    ] {
        let errors = with(text);
        assert!(errors.contains(error), "{text}\n  gives\n{errors}");
    }
    let line = "[STRUCTURE] bar x : a b length 1 bar y : b c length 1 bar z : c a length 2
        [ADDONS] p : sphere 1 (0,0,0) (0,0,0) a (1,0,0) b (2,0,0) c";
    assert!(refused(line).contains("the three anchors lie on one line"));
}

#[test]
fn a_broken_mesh_is_reported_where_it_breaks() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tens");
    fs::write(&path, format!("{STRUT}[OBSTACLES] o : body \"b.off\"")).unwrap();
    fs::write(folder.path().join("b.off"), "OFF\n1 0 0\n0 zero 0\n").unwrap();
    let errors = Problem::read(&path).unwrap_err();
    let [error, named] = errors.errors() else {
        panic!("{errors}");
    };
    assert!(named.path().ends_with("a.tens") && named.excerpt() == Some("\"b.off\""));
    assert!(error.path().ends_with("b.off"));
    assert_eq!(
        (error.position(), error.excerpt()),
        (Some((3, 3)), Some("zero"))
    );
}

#[test]
fn faces_that_a_mesh_writes_twice_count_once() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tens");
    fs::write(&path, format!("{STRUT}[OBSTACLES] o : body \"b.off\"")).unwrap();
    let mesh = "OFF 4 8 6  0 0 0  1 0 0  0 1 0  0 0 1
        3 0 2 1  3 0 1 3  3 1 2 3  3 2 0 3  3 0 1 2  3 0 3 1  3 1 3 2  3 2 3 0";
    fs::write(folder.path().join("b.off"), mesh.replace("  ", "\n")).unwrap();
    let problem = Problem::read(&path).unwrap();
    match &problem.environment.obstacles[0].shape {
        Shape::Mesh { file, faces, .. } => assert_eq!((file.as_str(), faces.len()), ("b.off", 4)),
        other => panic!("{other:?}"),
    }
}

#[test]
fn errors_of_siblings_point_into_them() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tens");
    fs::write(&path, STRUT).unwrap();
    fs::write(path.with_extension("param"), "\nDELTA = -1\nEPSILON = 1 1").unwrap();
    let errors = Problem::read(&path).unwrap_err();
    assert_eq!(errors.errors().len(), 2);
    assert!(errors.errors()[0].path().ends_with("a.param"));
    assert_eq!(errors.errors()[0].position(), Some((2, 9)));
    fs::write(path.with_extension("param"), "DELTA = 0.1").unwrap();
    fs::write(path.with_extension("links"), "1 0 0 -1 0 0 1").unwrap();
    let errors = Problem::read(&path).unwrap_err();
    assert!(errors.errors()[0].path().ends_with("a.links"));
    assert!(errors.errors()[0].message().contains("holds 7 numbers"));
}
