//! Problem files in TOML: the benchmarks, and the keys one by one.

use std::{fs, path::PathBuf};

use nalgebra::Vector3;
use tensegra_model::{
    Body, Coupling, ElementKind, ForceLaw, Formulation, Interval, NeighbourSearch, PlannerKind,
    PlannerSettings, Problem, Role, SamplingRadius, Shape, Structure,
};

fn fixture(name: &str) -> Problem {
    let folder = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures"));
    Problem::read(&folder.join(name)).unwrap_or_else(|errors| panic!("{errors:#}"))
}

/// Reads a text as a problem file; the errors as one text.
fn read(text: &str) -> Result<Problem, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.toml");
    fs::write(&path, text).unwrap();
    let prefix = format!("{}/", folder.path().display());
    Problem::read(&path).map_err(|errors| format!("{errors:#}").replace(&prefix, ""))
}

fn refused(text: &str) -> String {
    match read(text) {
        Ok(_) => panic!("this must be refused:\n{text}"),
        Err(errors) => errors,
    }
}

/// Two crossed struts and four cables; what is added goes on in `[structure]`.
fn cross(structure: &str, rest: &str) -> String {
    format!(
        "[structure]
planar = true
{structure}
[structure.types]
strut = {{ kind = \"strut\", length = 1 }}
cable = {{ kind = \"cable\", length = [0, 3], stiffness = 1, rest = [0, 2] }}
[structure.elements]
s1 = {{ type = \"strut\", nodes = [\"a\", \"b\"] }}
s2 = {{ type = \"strut\", nodes = [\"c\", \"d\"], color = \"red\" }}
c1 = {{ type = \"cable\", nodes = [\"a\", \"c\"] }}
c2 = {{ type = \"cable\", nodes = [\"b\", \"c\"] }}
c3 = {{ type = \"cable\", nodes = [\"a\", \"d\"] }}
c4 = {{ type = \"cable\", nodes = [\"b\", \"d\"], length = [0.5, 2] }}
{rest}"
    )
}

fn kinds(structure: &Structure) -> Vec<(ElementKind, usize)> {
    use ElementKind::{Bar, Cable, Prismatic, Spring, Strut};
    [Strut, Bar, Cable, Spring, Prismatic]
        .into_iter()
        .map(|kind| {
            let of_kind = structure.elements.iter().filter(|e| e.kind == kind);
            (kind, of_kind.count())
        })
        .filter(|&(_, count)| count > 0)
        .collect()
}

/// An endpoint states positions that respect constant lengths, and forces that
/// balance every node with the prescribed norm.
fn check_endpoints(problem: &Problem) {
    let structure = &problem.structure;
    for endpoint in problem.start.iter().chain(&problem.goal) {
        let mut balance: Vec<Vector3<f64>> = structure.nodes.iter().map(|n| n.load).collect();
        let mut norm = 0.0;
        for (element, force) in structure.elements.iter().zip(&endpoint.forces) {
            let [a, b] = element.nodes;
            let way = endpoint.positions[b] - endpoint.positions[a];
            let length = way.norm();
            assert!(element.length.margin(length) > -1e-8, "{}", element.name);
            assert_eq!(force.is_some(), element.carries_force(), "{}", element.name);
            let force = force.unwrap_or(0.0);
            assert!(!element.carries_force() || element.force.margin(force) > -1e-8);
            norm += force * force;
            balance[a] += way * (force / length);
            balance[b] -= way * (force / length);
        }
        assert!((norm.sqrt() - structure.pretension.unwrap()).abs() < 1e-7);
        for (node, residual) in structure.nodes.iter().zip(&balance) {
            let held = !node.balanced;
            assert!(held || residual.norm() < 1e-7, "{} {residual}", node.name);
        }
        for fixed in &structure.fixed {
            let found = endpoint.positions[fixed.node][fixed.axis];
            assert!((found - fixed.value).abs() < 1e-8);
        }
    }
}

#[test]
fn the_kite() {
    let problem = fixture("kite.toml");
    let structure = &problem.structure;
    assert_eq!(problem.name, "kite");
    assert_eq!((structure.dimension, structure.pretension), (2, Some(4.0)));
    assert_eq!(
        kinds(structure),
        [(ElementKind::Strut, 3), (ElementKind::Cable, 4)]
    );
    assert_eq!(structure.elements[0].force, Interval::new(-16.0, 0.0));
    assert_eq!(structure.elements[2].law, ForceLaw::None);
    assert_eq!(structure.elements[3].stiffness(), Some(16.0));
    assert_eq!(structure.elements[3].force, Interval::new(0.0, 48.0));
    assert_eq!(problem.environment.pairs.len(), 10);
    assert_eq!(problem.files[0].path().file_name().unwrap(), "kite.toml");
    assert!(problem.files[0].text().contains("[structure.elements]"));
    check_endpoints(&problem);
}

#[test]
fn the_free_flying_kite() {
    let problem = fixture("free_flying.toml");
    assert_eq!(
        problem.structure.base_range,
        Some(Vector3::new(3.0, 3.0, 0.0))
    );
    assert_eq!(problem.structure.fixed, []);
    assert_eq!(problem.environment.pairs.len(), 12);
    match problem.environment.obstacles[1].shape {
        Shape::Box { min, max } => {
            assert!((min.y + 3.4).abs() < 1e-15 && (max.y + 0.15).abs() < 1e-15);
        }
        ref other => panic!("{other:?}"),
    }
    check_endpoints(&problem);
}

#[test]
fn the_tower() {
    let problem = fixture("tower.toml");
    let structure = &problem.structure;
    assert_eq!(structure.nodes.len(), 12);
    assert_eq!(
        kinds(structure),
        [
            (ElementKind::Strut, 6),
            (ElementKind::Cable, 17),
            (ElementKind::Spring, 1)
        ]
    );
    assert_eq!(problem.environment.pairs.len(), 24);
    let hidden = structure
        .elements
        .iter()
        .filter(|e| e.appearance.role == Role::Hidden);
    assert_eq!(hidden.count(), 1);
    check_endpoints(&problem);
}

#[test]
fn the_prism() {
    let problem = fixture("prism.toml");
    let structure = &problem.structure;
    assert_eq!(
        kinds(structure),
        [(ElementKind::Spring, 6), (ElementKind::Prismatic, 3)]
    );
    let held: Vec<&str> = structure
        .nodes
        .iter()
        .filter(|node| !node.balanced)
        .map(|node| node.name.as_str())
        .collect();
    assert_eq!(held, ["n1", "n3", "n5"]);
    // The scale that all forces of the regular prism give it.
    assert!((structure.elements[0].stiffness().unwrap() + 0.303_965_613_370_022).abs() < 1e-14);
    assert_eq!(problem.environment.pairs.len(), 9);
    check_endpoints(&problem);
}

#[test]
fn the_robot() {
    let problem = fixture("robot.toml");
    let structure = &problem.structure;
    assert_eq!(
        kinds(structure),
        [
            (ElementKind::Strut, 6),
            (ElementKind::Cable, 18),
            (ElementKind::Spring, 6)
        ]
    );
    // All pairs of elements that share no node; everything with the plane, the base
    // and the block; the peg with all of them.
    assert_eq!(problem.environment.pairs.len(), 315 + 30 * 3 + 30 + 3);
    let platform = [Body::Attachment(0), Body::Obstacle(8)];
    assert!(problem.environment.pairs.contains(&platform));
    assert_eq!(structure.attachments[0].shapes.len(), 9);
    check_endpoints(&problem);

    // The block is a box with a round hole along its longest axis.
    let Shape::Mesh {
        vertices, faces, ..
    } = &problem.environment.obstacles[8].shape
    else {
        panic!("the block is a mesh");
    };
    assert_eq!((vertices.len(), faces.len()), (88, 176));
    let (sin, cos) = 60.0_f64.to_radians().sin_cos();
    for vertex in vertices {
        let d = vertex - nalgebra::Point3::new(0.004_351, 0.0375, 0.767_464);
        let along = cos * d.x - sin * d.z;
        let across = sin * d.x + cos * d.z;
        assert!((along.abs() - 0.05625).abs() < 1e-8);
        let corner = (d.y.abs() - 0.0375).abs() < 1e-8 && (across.abs() - 0.0375).abs() < 1e-8;
        let rim = (d.y.hypot(across) - 0.015).abs() < 1e-8;
        assert!(corner || rim, "{vertex}");
    }
}

#[test]
fn the_symmetric_tower() {
    let problem = fixture("tower3D.toml");
    let structure = &problem.structure;
    assert_eq!(
        kinds(structure),
        [(ElementKind::Strut, 6), (ElementKind::Cable, 24)]
    );
    assert_eq!(structure.couplings.len(), 14);
    let orientations = structure.couplings.iter();
    let orientations = orientations.filter(|c| matches!(c, Coupling::Orientation { .. }));
    assert_eq!(orientations.count(), 3);
    assert!(problem.goal.is_none());
    check_endpoints(&problem);
    // Direction of s1 = Rz(120°) · direction of s2.
    let positions = &problem.start.as_ref().unwrap().positions;
    let direction = |element: usize| {
        let [a, b] = structure.elements[element].nodes;
        (positions[b] - positions[a]).normalize()
    };
    match &structure.couplings[0] {
        Coupling::Orientation {
            reference,
            followers,
        } => {
            for (follower, rotation) in followers {
                let error = direction(*reference) - rotation * direction(*follower);
                assert!(error.norm() < 1e-9);
            }
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn what_is_not_stated_has_defaults() {
    let problem = read(&cross("", "")).unwrap();
    assert_eq!((problem.name.as_str(), problem.seed), ("a", 0));
    assert_eq!(problem.settings, PlannerSettings::default());
    assert_eq!(problem.structure.pretension, Some(1.0));
    assert_eq!(problem.structure.fixed.len(), 2);
    assert!(problem.environment.pairs.is_empty());
    let c4 = &problem.structure.elements[5];
    assert_eq!(
        c4.length,
        Interval::new(0.5, 2.0),
        "own properties come first"
    );
    assert_eq!(c4.rest(), Some(Interval::new(0.0, 2.0)));

    // Obstacles without rules are tested against everything.
    let ball = "[obstacles]\nball = { shape = \"sphere\", center = [3, 0], radius = 0.5 }
        far = { shape = \"half_space\", point = [9, 0], normal = [-1, 0], role = \"decoration\" }";
    let problem = read(&cross("", ball)).unwrap();
    assert_eq!(problem.environment.pairs.len(), 6);
    let far = &problem.environment.obstacles[1];
    assert_eq!(far.role, Role::Decoration);
}

#[test]
fn every_key_of_the_planner_reaches_its_setting() {
    let planner = "[planner]\nkind = \"one-tree\"\nformulation = \"directions\"\ntolerance = 1e-8
        chart_radius = 0.3\nchart_error = 0.2\ncurvature = 0.15\nstep = 0.01\ntime_limit = 5
        sampling_radius = 2.5\nneighbours = \"kd-tree\"\nslide = false\nmax_newton_iterations = 7\nmax_charts = 8\nmax_nodes = 9
        expected_dimension = 3";
    let text = format!("name = \"x\"\nseed = 17\n{}", cross("", planner));
    let problem = read(&text).unwrap();
    let mut expected = PlannerSettings::default();
    expected.planner = PlannerKind::OneTree;
    expected.formulation = Formulation::Directions;
    expected.tolerance = 1e-8;
    expected.chart_radius = 0.3;
    expected.chart_error = 0.2;
    expected.curvature = 0.15;
    expected.step = 0.01;
    expected.time_limit = 5.0;
    expected.sampling_radius = SamplingRadius::Fixed(2.5);
    expected.neighbours = NeighbourSearch::KdTree;
    expected.slide = false;
    expected.max_newton_iterations = 7;
    expected.max_charts = 8;
    expected.max_nodes = 9;
    expected.expected_dimension = Some(3);
    assert_eq!(problem.settings, expected);
    assert_eq!((problem.name.as_str(), problem.seed), ("x", 17));
    let adaptive = cross("", "[planner]\nsampling_radius = \"adaptive\"");
    let settings = read(&adaptive).unwrap().settings;
    assert_eq!(settings.sampling_radius, SamplingRadius::Adaptive);
}

#[test]
fn structures_have_loads_supports_gauge_and_couplings() {
    let structure = "pretension = 0\nsupports = [\"d\"]
        loads = { c = [1, \"-1/2\"] }\nfixed = { b = { y = 0 } }
        couplings = [
          { length = [\"c1\", { element = \"c2\", factor = \"2/2\" }] },
          { orientation = [\"s1\", { element = \"s2\", rotation = \"Rz(pi)\" }] },
        ]";
    let structure = read(&cross(structure, "")).unwrap().structure;
    assert_eq!(structure.pretension, None);
    assert!(!structure.nodes[3].balanced);
    assert_eq!(structure.nodes[2].load, Vector3::new(1.0, -0.5, 0.0));
    assert_eq!(structure.fixed.len(), 3);
    assert_eq!(
        structure.couplings[0],
        Coupling::Length {
            reference: 2,
            followers: vec![(3, 1.0)]
        }
    );
}

#[test]
fn start_and_goal_are_nodes_or_rows() {
    let start = "[start]\nnodes = { b = [1, 0], c = [0.5, -0.5], d = [0.5, 0.5] }
        forces = { c1 = \"1/4\" }\nrest_lengths = { c2 = 0.5 }";
    let problem = read(&cross("", start)).unwrap();
    let start = problem.start.unwrap();
    // The origin is fixed and need not be stated.
    assert_eq!(start.positions[0], nalgebra::Point3::origin());
    assert_eq!(start.positions[2], nalgebra::Point3::new(0.5, -0.5, 0.0));
    assert_eq!(start.forces[2], Some(0.25));
    assert_eq!(start.forces[3], None);
    assert_eq!(start.rest_lengths[3], Some(0.5));

    // A structure file, with rows of its configurations in the other order.
    let folder = tempfile::tempdir().unwrap();
    let tens = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/tens");
    let text = format!(
        "structure = \"{tens}/kite.tens\"
        start = {{ links = \"{tens}/kite.links\", row = 2 }}
        goal = {{ links = \"{tens}/kite.links\", row = 1 }}
        [planner]\nstep = 0.03"
    );
    let path = folder.path().join("back.toml");
    fs::write(&path, &text).unwrap();
    let back = Problem::read(&path).unwrap();
    let kite = fixture("tens/kite.tens");
    assert_eq!(back.structure, kite.structure);
    assert_eq!(back.environment, kite.environment);
    assert_eq!((back.start, back.goal), (kite.goal, kite.start));
    assert_eq!(back.settings.step, 0.03);
    assert_eq!(back.settings.expected_dimension, Some(3));
    assert_eq!(back.files.len(), 4);

    // Obstacles and rules of the problem file replace those of the structure file.
    let bare = format!("{text}\n[collisions]\ncheck = [[\"s2\", [\"c1\", \"c2\"]]]");
    fs::write(&path, bare).unwrap();
    let bare = Problem::read(&path).unwrap();
    assert!(bare.environment.obstacles.is_empty());
    assert_eq!(bare.environment.pairs.len(), 2);

    let beyond = text.replace("row = 2", "row = 3");
    fs::write(&path, beyond).unwrap();
    let errors = Problem::read(&path).unwrap_err();
    assert!(
        errors.errors()[0].message().ends_with("has no row 3"),
        "{errors:#}"
    );
}

#[test]
fn slips_are_refused_where_they_stand() {
    for (structure, rest, error) in [
        (
            "",
            "[starts]",
            "a.toml:14:2: there is no key `starts` here (did you mean `start`?)",
        ),
        (
            "fixed = 3",
            "",
            "a.toml:3:9: a table is expected here, not a number",
        ),
        ("fixed = { b = { w = 1 } }", "", "there is no key `w` here"),
        (
            "supports = [1]",
            "",
            "a name is expected here, not a number",
        ),
        ("free_flying = [1, 2, 3, 4]", "", "[x, y] is expected here"),
        (
            "free_flying = [1, 2]\nfixed = { b = { y = 0 } }",
            "",
            "cannot be fixed",
        ),
        (
            "pretension = -1",
            "",
            "a.toml:3:14: structure: the pretension is negative: -1",
        ),
        (
            "couplings = [{ width = [\"c1\"] }]",
            "",
            "one of length, rest, force or orientation",
        ),
        (
            "couplings = [{ force = [\"c1\"] }]",
            "",
            "it couples one element to nothing",
        ),
        (
            "couplings = [{ force = [\"c1\", \"c1\"] }]",
            "",
            "element `c1` occurs twice",
        ),
        (
            "couplings = [{ length = [\"s1\", \"s2\"] }]",
            "",
            "the length of `s1` cannot be coupled: its length is constant",
        ),
        (
            "couplings = [{ length = [\"c1\", { element = \"c2\", factor = 0 }] }]",
            "",
            "the factor is zero",
        ),
        (
            "couplings = [{ length = [\"c4\", { element = \"c2\", factor = -1 }] }]",
            "",
            "the length of `c4` lies in [0.5, 2], but `c2` asks for [-3, -0]",
        ),
        (
            "couplings = [{ orientation = [\"s1\", { element = \"s2\", rotation = \"Rx(1)\" }] }]",
            "",
            "the z component of a rotated direction is",
        ),
        (
            "loads = { a = [0, 0, 1] }",
            "",
            "the structure is planar, but the load along z is 1",
        ),
        (
            "loads = { a = [0, 1] }\nsupports = [\"a\"]",
            "",
            "node `a` is exempt from force balance",
        ),
        (
            "fixed = { a = [0, 1], b = [inf, 0] }",
            "",
            "the coordinate is inf",
        ),
        (
            "",
            "[structure.elements.x]\ntype = \"strutt\"\nnodes = [\"a\", \"b\"]",
            "there is no type `strutt` (did you mean `strut`?)",
        ),
        (
            "",
            "[structure.elements.x]\ntype = \"strut\"\nnodes = [\"a\", \"b\", \"c\"]",
            "two nodes are expected here",
        ),
        (
            "",
            "[structure.elements.x]\ntype = \"strut\"",
            "element `x` has no nodes",
        ),
        (
            "",
            "[structure.elements.x]\ntype = \"strut\"\nnodes = [\"a\", \"b\"]\ndynamics = { mass = 1, inertia = [1] }",
            "6 numbers are expected here",
        ),
        (
            "",
            "[obstacles]\no = { shape = \"ball\" }",
            "one of \"box\", \"sphere\", \"cylinder\", \"prism\", \"half_space\", \"mesh\" is expected here",
        ),
        ("", "[obstacles]\no = { radius = 1 }", "no shape is stated"),
        (
            "",
            "[obstacles]\no = { shape = \"sphere\", center = [0, 0] }",
            "`radius` is missing",
        ),
        (
            "",
            "[obstacles]\no = { shape = \"sphere\", center = [0, 0], radius = -1 }",
            "a.toml:15:1: obstacle `o`: sphere",
        ),
        (
            "",
            "[obstacles]\no = { shape = \"sphere\", center = [0, 0], radius = 1, color = \"rad\" }",
            "there is no colour `rad` (did you mean `red`?)",
        ),
        (
            "",
            "[obstacles]\no = { shape = \"box\", min = [0, 0, 0] }",
            "`max` or `size` is missing",
        ),
        (
            "",
            "[collisions]\ncheck = \"connected\"",
            "connected elements cannot be checked",
        ),
        (
            "",
            "[collisions]\ncheck = [\"s3\"]",
            "there is no element, attachment or obstacle `s3`",
        ),
        (
            "",
            "[collisions]\ncheck = [[\"s1\"]]",
            "a pair of bodies is expected here",
        ),
        ("", "[start]", "neither `nodes` nor `links` is stated"),
        (
            "",
            "start.nodes = { b = [1, 0], q = [0, 0] }",
            "there is no node `q`",
        ),
        (
            "",
            "start.nodes = { b = [1, 0], c = [0, 1, 2], d = [0, nan] }",
            "z is 0",
        ),
        (
            "",
            "[start]\nnodes.b = [1, 0]",
            "there is no position of `c`, `d`",
        ),
        ("", "[start]\nlinks = \"a.links\"", "the row is missing"),
        (
            "",
            "[start]\nlinks = \"a.links\"\nrow = 0",
            "a whole number from 1 is expected here",
        ),
        (
            "",
            "[start]\nlinks = \"a.links\"\nrow = 1",
            "a.links: there is no such file",
        ),
        (
            "",
            "[start]\nformfind = { nodes = { q = [0, 0] } }",
            "there is no node `q`",
        ),
        (
            "",
            "[goal]\nformfind = { points = [{ of = [\"a\"] }] }",
            "`of` and `at` are expected here",
        ),
        (
            "",
            "[formfind]\nlengths = { c1 = [2, 1] }",
            "this range holds no number",
        ),
        (
            "",
            "[formfind]\nforces = { c9 = 1 }",
            "there is no element `c9`",
        ),
        (
            "",
            "[formfind]\nrest_lengths = { s1 = 1 }",
            "`s1` has no rest length",
        ),
        (
            "",
            "[formfind]\nsymmetry = [{ nodes = [[\"a\"]] }]",
            "either `turn` or `mirror` is expected here",
        ),
        (
            "",
            "[formfind]\nposes = { plate = { position = [0, 0, 0] } }",
            "there is no attachment `plate`",
        ),
        (
            "",
            "[formfind]\nclearance = -1",
            "a distance that is not negative is expected here",
        ),
        ("", "[formfind]\nstart = 3", "there is no key `start` here"),
        (
            "",
            "[planner]\nstep = 0",
            "a positive number is expected here",
        ),
        (
            "",
            "[planner]\ncurvature = 1",
            "a number between 0 and 1 is expected here",
        ),
        (
            "",
            "[planner]\nkind = \"two\"",
            "one of \"two-trees\", \"one-tree\" is expected here",
        ),
        ("", "[constants]\nx = \"y\"", "there is no constant `y`"),
        (
            "",
            "[constants]\nx = \"1\\u0030\"",
            "the expression cannot be read",
        ),
        (
            "",
            "[constants]\nx = \"1 2\"",
            "the end of the expression is expected here",
        ),
    ] {
        let text = cross(structure, rest);
        let text = match rest.strip_prefix("start.") {
            // Dotted keys stand before the first table.
            Some(_) => format!("{rest}\n{}", cross(structure, "")),
            None => text,
        };
        let errors = refused(&text);
        assert!(
            errors.contains(error),
            "{structure} {rest}\n  gives\n{errors}"
        );
    }
    assert!(refused("name = \"x\"").contains("there is no structure"));
    assert!(refused("structure = \"none.tens\"").contains("none.tens: there is no such file"));
}

#[test]
fn a_pretension_out_of_reach_is_refused() {
    let crushed =
        cross("pretension = 10", "").replace("length = 1 }", "length = 1, force = [-1, 0] }");
    // Four cables of at most 3 and two struts of at most 1.
    let errors = refused(&crushed);
    assert!(errors.contains("prescribed as 10"), "{errors}");
    assert!(read(&crushed.replace("= 10", "= 5")).is_ok());
}
