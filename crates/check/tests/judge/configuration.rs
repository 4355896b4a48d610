//! One configuration at a time: equilibria are accepted, and every way of not being one is named.

use nalgebra::{Point3, Rotation3, Vector3};
use tensegra_check::{Check, CheckOptions, Location, Report, check_configuration};
use tensegra_model::{Configuration, Coupling, ForceLaw, Interval, Problem};

use crate::structures::{
    ball, configuration, crossed_struts, fixed, link, node, prism, problem, raised, rectangle,
};

fn judge(problem: &Problem, configuration: &Configuration) -> Report {
    check_configuration(problem, configuration, &CheckOptions::default())
}

/// A rectangle with its problem.
fn crossed() -> (Problem, Configuration) {
    let problem = problem(crossed_struts(), Vec::new());
    let configuration = rectangle(&problem.structure, 0.7);
    (problem, configuration)
}

/// The kinds of failure, each once.
fn kinds(report: &Report) -> Vec<Check> {
    let mut kinds: Vec<Check> = report
        .failures
        .iter()
        .map(|failure| failure.check)
        .collect();
    kinds.dedup();
    kinds
}

#[test]
fn closed_form_equilibria_are_accepted() {
    let (problem, rectangle) = crossed();
    let report = judge(&problem, &rectangle);
    assert!(report.ok, "{report}");
    assert!(report.figure(Check::Balance).unwrap().value < 1e-15);
    assert!((report.figure(Check::LargestForce).unwrap().value - 0.5).abs() < 1e-15);

    let problem = crate::structures::problem(prism(), Vec::new());
    let report = judge(&problem, &raised(&problem.structure, 0.8));
    assert!(report.ok, "{report}");
}

#[test]
fn lengths_must_agree_with_positions_and_hookes_law() {
    let (problem, mut configuration) = crossed();
    configuration.lengths[2] += 1e-6;
    let report = judge(&problem, &configuration);
    assert_eq!(kinds(&report), [Check::Lengths, Check::HookesLaw]);
    let failure = &report.failures[0];
    assert_eq!(failure.subject, "element ab");
    assert_eq!(failure.location, Location::Configuration { index: 0 });
    assert!((failure.value.unwrap() - 1e-6).abs() < 1e-12);

    let (problem, mut configuration) = crossed();
    configuration.rest_lengths[3] = configuration.rest_lengths[3].map(|rest| rest + 1e-6);
    let report = judge(&problem, &configuration);
    assert_eq!(kinds(&report), [Check::HookesLaw]);
    assert_eq!(report.failures[0].subject, "element bc");
}

#[test]
fn constants_are_held() {
    let (mut problem, configuration) = crossed();
    problem.structure.elements[0].length = Interval::constant(1.001);
    let report = judge(&problem, &configuration);
    assert_eq!(kinds(&report), [Check::Constants]);
    assert_eq!(report.failures[0].subject, "element ac");

    let (mut problem, configuration) = crossed();
    let rest = Interval::constant(0.5);
    problem.structure.elements[4].law = ForceLaw::Linear {
        stiffness: 10.0,
        rest,
    };
    let report = judge(&problem, &configuration);
    assert_eq!(kinds(&report), [Check::Constants]);
    assert_eq!(report.failures[0].subject, "element cd");
}

#[test]
fn unbalanced_nodes_are_named() {
    let (problem, mut configuration) = crossed();
    configuration.forces[0] = Some(-0.5 - 1e-6);
    let report = judge(&problem, &configuration);
    assert_eq!(kinds(&report), [Check::Balance, Check::Pretension]);
    let mut nodes: Vec<&str> = report
        .failures
        .iter()
        .filter(|failure| failure.check == Check::Balance)
        .map(|failure| failure.subject.as_str())
        .collect();
    nodes.sort_unstable();
    assert_eq!(nodes, ["node a", "node c"]);
}

#[test]
fn supports_take_any_load_and_other_nodes_do_not() {
    let (mut problem, configuration) = crossed();
    problem.structure.nodes[1].load = Vector3::new(0.0, -1e-3, 0.0);
    let report = judge(&problem, &configuration);
    assert_eq!(kinds(&report), [Check::Balance]);
    assert_eq!(report.failures[0].subject, "node b");

    problem.structure.nodes[1].balanced = false;
    let report = judge(&problem, &configuration);
    assert!(report.ok, "{report}");
}

#[test]
fn a_loaded_node_in_equilibrium_is_accepted() {
    // A weight of 2 on two cables at 45° from two supports.
    let (mut problem, _) = crossed();
    let structure = &mut problem.structure;
    structure.nodes = ["left", "right", "weight"].map(node).to_vec();
    structure.nodes[0].balanced = false;
    structure.nodes[1].balanced = false;
    structure.nodes[2].load = Vector3::new(0.0, -2.0, 0.0);
    structure.elements.truncate(4);
    structure.elements.drain(..2);
    structure.elements[0].nodes = [0, 2];
    structure.elements[1].nodes = [2, 1];
    structure.pretension = None;
    structure.fixed = vec![
        fixed(0, 0, 0.0),
        fixed(0, 1, 0.0),
        fixed(1, 0, 2.0),
        fixed(1, 1, 0.0),
    ];
    let positions = [[0.0, 0.0], [2.0, 0.0], [1.0, -1.0]].map(|[x, y]| Point3::new(x, y, 0.0));
    let forces = vec![Some(2f64.sqrt()); 2];
    let configuration = configuration(structure, positions.to_vec(), forces);
    let report = judge(&problem, &configuration);
    assert!(report.ok, "{report}");
    // The least stiffness at the weight, by hand: along the cables k, across them f / l = 1.
    assert!(
        (report.figure(Check::Stability).unwrap().value - 11.0).abs() < 1e-9,
        "{report}"
    );
}

#[test]
fn ranges_are_kept() {
    for (change, kind) in [
        (
            (|p| p.structure.elements[3].length.hi = 0.6) as fn(&mut Problem),
            Check::LengthRanges,
        ),
        (
            |p| {
                let rest = Interval::new(0.7, 1.0);
                p.structure.elements[3].law = ForceLaw::Linear {
                    stiffness: 10.0,
                    rest,
                };
            },
            Check::RestRanges,
        ),
        (
            |p| p.structure.elements[3].force.lo = 0.4,
            Check::ForceRanges,
        ),
    ] {
        let (mut problem, configuration) = crossed();
        change(&mut problem);
        let report = judge(&problem, &configuration);
        assert_eq!(kinds(&report), [kind], "{report}");
        assert_eq!(report.failures[0].subject, "element bc");
        assert!(report.failures[0].value.unwrap() < 0.0);
    }
}

#[test]
fn pretension_is_kept() {
    let (mut problem, configuration) = crossed();
    problem.structure.pretension = Some(1.001);
    assert_eq!(kinds(&judge(&problem, &configuration)), [Check::Pretension]);
    problem.structure.pretension = None;
    assert!(judge(&problem, &configuration).ok);
}

#[test]
fn gauge_and_plane_are_kept() {
    let (problem, mut configuration) = crossed();
    configuration
        .positions
        .iter_mut()
        .for_each(|position| position.x += 1e-6);
    let report = judge(&problem, &configuration);
    assert_eq!(kinds(&report), [Check::Gauge]);
    assert_eq!(report.failures[0].subject, "node a");

    let (mut problem, mut configuration) = crossed();
    problem.structure.fixed.clear();
    configuration
        .positions
        .iter_mut()
        .for_each(|position| position.z += 1e-6);
    assert_eq!(kinds(&judge(&problem, &configuration)), [Check::Gauge]);
}

#[test]
fn a_base_that_flies_stays_in_its_range() {
    let (mut problem, mut configuration) = crossed();
    problem.structure.fixed.clear();
    problem.structure.base_range = Some(Vector3::new(1.0, 2.0, 0.0));
    configuration
        .positions
        .iter_mut()
        .for_each(|position| position.x -= 0.9);
    assert!(judge(&problem, &configuration).ok);
    configuration
        .positions
        .iter_mut()
        .for_each(|position| position.x -= 0.2);
    let report = judge(&problem, &configuration);
    assert_eq!(kinds(&report), [Check::BaseRange]);
    assert!((report.failures[0].value.unwrap() + 0.1).abs() < 1e-12);
}

#[test]
fn couplings_are_kept() {
    let half_turn = Rotation3::from_axis_angle(&Vector3::z_axis(), std::f64::consts::PI);
    let good = vec![
        Coupling::Length {
            reference: 2,
            followers: vec![(4, 1.0)],
        },
        Coupling::Rest {
            reference: 3,
            followers: vec![(5, 1.0)],
        },
        Coupling::Force {
            reference: 0,
            followers: vec![(1, 1.0)],
        },
        Coupling::Orientation {
            reference: 2,
            followers: vec![(4, half_turn)],
        },
    ];
    let (mut problem, configuration) = crossed();
    problem.structure.couplings = good.clone();
    let report = judge(&problem, &configuration);
    assert!(report.ok, "{report}");

    let quarter_turn = Rotation3::from_axis_angle(&Vector3::z_axis(), 1.6);
    let bad = vec![
        Coupling::Length {
            reference: 2,
            followers: vec![(4, 1.001)],
        },
        Coupling::Rest {
            reference: 3,
            followers: vec![(5, 0.999)],
        },
        Coupling::Force {
            reference: 0,
            followers: vec![(1, 2.0)],
        },
        Coupling::Orientation {
            reference: 2,
            followers: vec![(4, quarter_turn)],
        },
    ];
    for (index, coupling) in bad.into_iter().enumerate() {
        let mut couplings = good.clone();
        couplings[index] = coupling;
        problem.structure.couplings = couplings;
        let report = judge(&problem, &configuration);
        assert_eq!(kinds(&report), [Check::Couplings]);
        let [failure] = &report.failures[..] else {
            panic!("{report}")
        };
        assert!(
            failure
                .subject
                .starts_with(&format!("coupling {}", index + 1))
        );
    }
}

#[test]
fn attachments_stay_rigid() {
    let mut problem = problem(prism(), Vec::new());
    let configuration = raised(&problem.structure, 0.8);
    problem.structure.attachments[0].anchors[1].local.x += 1e-5;
    let report = judge(&problem, &configuration);
    assert_eq!(kinds(&report), [Check::Attachments]);
    assert_eq!(report.failures[0].subject, "attachment platform");
}

#[test]
fn an_element_without_length_is_refused() {
    let (mut problem, mut configuration) = crossed();
    problem.structure.nodes.push(node("e"));
    problem.structure.elements.push(link("point", [0, 4], 0.0));
    configuration.positions.push(Point3::origin());
    configuration.lengths.push(0.0);
    configuration.rest_lengths.push(None);
    configuration.forces.push(None);
    let report = judge(&problem, &configuration);
    assert_eq!(kinds(&report), [Check::ShortestElement]);
    assert_eq!(report.failures[0].subject, "element point");

    problem.structure.elements[6].law = ForceLaw::Free;
    configuration.forces[6] = Some(-0.1);
    assert!(judge(&problem, &configuration).fails(Check::Balance));
}

#[test]
fn clearance_at_a_sample_is_judged_to_the_digit() {
    // The strut a–c points at the ball; its cap ends at node c.
    let angle: f64 = 0.7;
    let (sin, cos) = angle.sin_cos();
    for (distance, ok) in [(0.05, true), (-0.02, false)] {
        let reach = 1.1 + distance;
        let problem = problem(
            crossed_struts(),
            vec![ball("sun", reach * cos, reach * sin, 0.1)],
        );
        let report = judge(&problem, &rectangle(&problem.structure, angle));
        assert_eq!(report.ok, ok, "{report}");
        let clearance = report.figure(Check::Clearance).unwrap();
        assert_eq!(clearance.subject, "ac and sun");
        assert!((clearance.value - distance).abs() < 1e-12, "{report}");
    }
}

#[test]
fn decorations_do_not_collide_and_hidden_bodies_do() {
    use tensegra_model::Role;
    let mut problem = problem(crossed_struts(), vec![ball("sun", 0.5, 0.5, 0.3)]);
    let configuration = rectangle(&problem.structure, 0.7);
    assert!(judge(&problem, &configuration).fails(Check::Clearance));
    problem.environment.obstacles[0].role = Role::Hidden;
    assert!(judge(&problem, &configuration).fails(Check::Clearance));
    problem.environment.obstacles[0].role = Role::Decoration;
    assert!(judge(&problem, &configuration).ok);
    problem.environment.obstacles[0].role = Role::Solid;
    for element in &mut problem.structure.elements {
        element.appearance.role = Role::Decoration;
    }
    assert!(judge(&problem, &configuration).ok);
}

#[test]
fn bodies_of_elements_cover_what_they_should() {
    // A small ball next to the axis of each kind of element, at several distances from the first
    // node: the clearance tells the radius there.
    let mut problem = problem(prism(), vec![ball("probe", 0.0, 0.0, 1e-3)]);
    let configuration = raised(&problem.structure, 0.9);
    let mut clearance = |element: usize, along: f64| {
        let [a, b] = problem.structure.elements[element].nodes;
        let [a, b] = [configuration.positions[a], configuration.positions[b]];
        let length = (b - a).norm();
        let side = (b - a).cross(&Vector3::new(0.3, 0.5, -0.2)).normalize();
        let center = a + (b - a) * (along / length) + side * 0.02;
        problem.environment.obstacles[0].shape = tensegra_model::Shape::Sphere {
            center,
            radius: 1e-3,
        };
        let pair = [
            tensegra_model::Body::Element(element),
            tensegra_model::Body::Obstacle(0),
        ];
        problem.environment.pairs = vec![pair];
        judge(&problem, &configuration)
            .figure(Check::Clearance)
            .unwrap()
            .value
    };
    let near = |value: f64, expected: f64| assert!((value - expected).abs() < 1e-9, "{value}");
    // Element 0 is a telescopic strut of 0.8 to 1.5; it is 1.32 long here.
    let length = (0.5f64.powi(2) * (2.0 - 2.0 * 150f64.to_radians().cos()) + 0.81).sqrt();
    near(clearance(0, 0.4), 0.019 - 0.01);
    // The rod covers the last 0.7.
    near(clearance(0, 0.55), 0.019 - 0.01);
    near(clearance(0, 0.82), 0.019 - 0.005);
    near(clearance(0, 1.0), 0.019 - 0.005);
    near(clearance(0, length - 0.01), 0.019 - 0.01);
    near(clearance(0, length), 0.02f64.hypot(0.01) - 0.011);
    // Element 1 is a cable.
    let cable = configuration.lengths[1];
    near(clearance(1, 0.5 * cable), 0.019 - 0.01);
    near(clearance(1, 0.0), 0.02f64.hypot(0.1 * cable) - 0.011);
}

/// The start of the kite of Porta and Hernández-Juan (2016), as published with 13 digits.
#[test]
fn the_start_of_the_kite_is_accepted() {
    let (mut problem, _) = crossed();
    let structure = &mut problem.structure;
    structure.nodes.push(node("e"));
    let cable = |name, nodes| crate::structures::cable(name, nodes, 16.0);
    structure.elements = vec![
        crate::structures::strut("s1", [0, 1], 1.0),
        crate::structures::strut("s2", [2, 3], 1.0),
        link("s3", [3, 4], 0.25),
        cable("c1", [0, 2]),
        cable("c2", [1, 2]),
        cable("c3", [0, 3]),
        cable("c4", [1, 3]),
    ];
    structure.couplings = vec![Coupling::Orientation {
        reference: 1,
        followers: vec![(2, Rotation3::identity())],
    }];
    structure.fixed.push(fixed(1, 0, 1.0));
    structure.pretension = Some(4.0);
    let positions = [
        [0.0, 0.0],
        [1.0, 0.0],
        [0.2871928874925, -0.07684367830385],
        [-0.101994340946, 0.8443149949009],
        [-0.1992911480556, 1.074604663202],
    ];
    let positions = positions.map(|[x, y]| Point3::new(x, y, 0.0)).to_vec();
    let forces = vec![
        Some(-2.241059220063),
        Some(-0.9026245474868),
        None,
        Some(2.39738401827),
        Some(1.976008879431),
        Some(0.624170317567),
        Some(0.3482422870178),
    ];
    let start = configuration(structure, positions, forces);
    let report = judge(&problem, &start);
    assert!(report.ok, "{report}");
    assert!(report.figure(Check::Balance).unwrap().value < 1e-11);
    // The equilibrium is stable, and so says the least stiffness.
    assert!(
        report.figure(Check::Stability).unwrap().value > 0.0,
        "{report}"
    );
}

#[test]
fn units_of_length_and_force_do_not_matter() {
    let (problem, mut start) = crossed();
    start.positions[2].x += 1e-7;
    start.forces[4] = Some(start.forces[4].unwrap() * (1.0 + 1e-7));
    let expected = judge(&problem, &start);

    let (length, force) = (1000.0, 1e-3);
    let mut scaled = problem.clone();
    for element in &mut scaled.structure.elements {
        let scale = |range: Interval, by: f64| Interval::new(range.lo * by, range.hi * by);
        element.length = scale(element.length, length);
        element.force = scale(element.force, force);
        if let ForceLaw::Linear { stiffness, rest } = element.law {
            let (stiffness, rest) = (stiffness * force / length, scale(rest, length));
            element.law = ForceLaw::Linear { stiffness, rest };
        }
    }
    scaled.structure.pretension = Some(force);
    start
        .positions
        .iter_mut()
        .for_each(|position| *position *= length);
    start.lengths.iter_mut().for_each(|value| *value *= length);
    start
        .rest_lengths
        .iter_mut()
        .flatten()
        .for_each(|value| *value *= length);
    start
        .forces
        .iter_mut()
        .flatten()
        .for_each(|value| *value *= force);
    let report = judge(&scaled, &start);
    assert_eq!(kinds(&report), kinds(&expected));
    for check in [
        Check::Lengths,
        Check::ShortestElement,
        Check::HookesLaw,
        Check::Balance,
        Check::LengthRanges,
        Check::ForceRanges,
        Check::Pretension,
    ] {
        let [before, after] =
            [&expected, &report].map(|report| report.figure(check).unwrap().value);
        assert!(
            (before - after).abs() <= 1e-12 + 1e-6 * before.abs(),
            "{check:?} {before} {after}"
        );
    }
}
