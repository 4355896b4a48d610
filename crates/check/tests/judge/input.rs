//! Data that cannot be judged: a failure in words, never a panic.

use nalgebra::Point3;
use tensegra_check::{Check, CheckOptions, Location, check_configuration, check_path};
use tensegra_model::{Body, Endpoint, Path, Problem, Shape};

use crate::structures::{
    ball, crossed_struts, fixed, obstacle, prism, problem, raised, rectangle, rectangles,
};

#[test]
fn an_empty_path_is_refused() {
    let problem = problem(crossed_struts(), Vec::new());
    let report = check_path(&problem, &Path::default(), &CheckOptions::default());
    assert!(!report.ok);
    assert_eq!(report.failures[0].message, "the path has no configurations");
}

#[test]
fn missing_numbers_are_named() {
    let problem = problem(crossed_struts(), vec![ball("sun", 2.0, 2.0, 0.1)]);
    let whole = rectangles(&problem.structure, 70.0, 50.0, 10);
    let options = CheckOptions::default();
    assert!(check_path(&problem, &whole, &options).ok);
    let spoil = |change: fn(&mut tensegra_model::Configuration)| {
        let mut path = whole.clone();
        change(&mut path.configurations[4]);
        let report = check_path(&problem, &path, &options);
        assert!(!report.ok);
        let [failure] = &report.failures[..] else {
            panic!("{report}")
        };
        assert_eq!(failure.location, Location::Configuration { index: 4 });
        (failure.check, failure.message.clone())
    };
    let (check, message) = spoil(|c| c.positions.truncate(3));
    assert_eq!(check, Check::Input);
    assert_eq!(message, "configuration 4: 3 positions, 4 expected");
    assert_eq!(spoil(|c| c.lengths.clear()).0, Check::Input);
    assert_eq!(spoil(|c| c.rest_lengths.push(None)).0, Check::Input);
    assert_eq!(spoil(|c| c.forces.clear()).0, Check::Input);
    let (check, message) = spoil(|c| c.forces[2] = None);
    assert_eq!(check, Check::Input);
    assert_eq!(message, "configuration 4: element ab has no force");
    assert_eq!(spoil(|c| c.rest_lengths[3] = None).0, Check::Input);
    let (check, message) = spoil(|c| c.positions[1].y = f64::NAN);
    assert_eq!(check, Check::Finite);
    assert!(message.contains("node b"), "{message}");
    assert_eq!(spoil(|c| c.lengths[0] = f64::INFINITY).0, Check::Finite);
    assert_eq!(spoil(|c| c.forces[0] = Some(f64::NAN)).0, Check::Finite);
    assert_eq!(spoil(|c| c.rest_lengths[2] = Some(-1e200)).0, Check::Finite);
}

#[test]
fn a_path_of_numbers_that_are_not_finite_is_refused_whole() {
    let problem = problem(crossed_struts(), vec![ball("sun", 2.0, 2.0, 0.1)]);
    let mut path = rectangles(&problem.structure, 70.0, 50.0, 3);
    for configuration in &mut path.configurations {
        configuration
            .positions
            .fill(Point3::new(f64::NAN, f64::INFINITY, -f64::NAN));
    }
    let report = check_path(&problem, &path, &CheckOptions::default());
    assert_eq!(report.failures.len(), 16);
}

#[test]
fn a_force_where_none_can_be_is_refused() {
    let mut problem = problem(crossed_struts(), Vec::new());
    let mut configuration = rectangle(&problem.structure, 0.7);
    problem.structure.elements[2].law = tensegra_model::ForceLaw::None;
    configuration.rest_lengths[2] = None;
    let report = check_configuration(&problem, &configuration, &CheckOptions::default());
    assert!(
        report.failures[0].message.contains("can have none"),
        "{report}"
    );
}

#[test]
fn broken_problems_are_refused() {
    let changes: [fn(&mut Problem); 15] = [
        |p| p.structure.dimension = 4,
        |p| p.structure.elements[0].nodes = [0, 9],
        |p| p.structure.elements[0].nodes = [1, 1],
        |p| p.structure.elements[0].radius = -1.0,
        |p| p.structure.elements[0].length.hi = f64::NAN,
        |p| p.structure.nodes[0].load.x = f64::NAN,
        |p| p.structure.fixed.push(fixed(0, 3, 0.0)),
        |p| p.structure.pretension = Some(f64::NAN),
        |p| {
            p.environment
                .pairs
                .push([Body::Element(0), Body::Element(0)])
        },
        |p| {
            p.environment
                .pairs
                .push([Body::Element(0), Body::Obstacle(7)])
        },
        |p| p.environment.obstacles[0] = ball("sun", f64::NAN, 0.0, 0.1),
        |p| {
            let (vertices, faces) = (Vec::new(), Vec::new());
            let mesh = Shape::Mesh {
                file: "empty.off".to_owned(),
                vertices,
                faces,
            };
            p.environment.obstacles[0] = obstacle("empty", mesh);
        },
        |p| p.start = Some(Endpoint::at(Vec::new(), &p.structure)),
        |p| {
            let followers = vec![(99, 1.0)];
            p.structure.couplings = vec![tensegra_model::Coupling::Length {
                reference: 0,
                followers,
            }];
        },
        |p| {
            let followers = vec![(1, 1.0)];
            p.structure.couplings = vec![tensegra_model::Coupling::Rest {
                reference: 0,
                followers,
            }];
        },
    ];
    for (index, change) in changes.into_iter().enumerate() {
        let mut problem = problem(crossed_struts(), vec![ball("sun", 2.0, 2.0, 0.1)]);
        let path = rectangles(&problem.structure, 70.0, 60.0, 4);
        change(&mut problem);
        let report = check_path(&problem, &path, &CheckOptions::default());
        assert!(report.fails(Check::Input), "change {index}: {report}");
        assert!(
            report.failures[0].message.starts_with("problem: "),
            "{report}"
        );
    }
}

#[test]
fn attachments_that_cannot_be_placed_are_refused() {
    let pairs = vec![[Body::Attachment(0), Body::Obstacle(0)]];
    let judge = |change: fn(&mut Problem)| {
        let mut problem = problem(prism(), vec![ball("sun", 2.0, 2.0, 0.1)]);
        problem.environment.pairs = pairs.clone();
        let configuration = raised(&problem.structure, 0.8);
        change(&mut problem);
        check_configuration(&problem, &configuration, &CheckOptions::default())
    };
    assert!(judge(|_| ()).ok);
    let report = judge(|p| {
        for (i, anchor) in p.structure.attachments[0].anchors.iter_mut().enumerate() {
            anchor.local = Point3::new(i as f64, 0.0, 0.0);
        }
    });
    assert!(
        report.failures[0].message.contains("in one line"),
        "{report}"
    );
    let report = judge(|p| {
        let (point, normal) = (Point3::origin(), nalgebra::Vector3::z());
        p.structure.attachments[0].shapes[0].shape = Shape::HalfSpace { point, normal };
    });
    assert!(report.failures[0].message.contains("unbounded"), "{report}");
}

#[test]
fn options_out_of_range_are_refused() {
    let problem = problem(crossed_struts(), Vec::new());
    let path = rectangles(&problem.structure, 70.0, 60.0, 4);
    for options in [
        CheckOptions::default().with_balance_tolerance(f64::NAN),
        CheckOptions::default().with_range_tolerance(-1.0),
        CheckOptions::default().with_slack_factor(0.5),
        CheckOptions::default().with_max_depth(99),
        CheckOptions::default().with_max_displacement(Some(0.0)),
        CheckOptions::default().with_min_clearance(f64::INFINITY),
    ] {
        let fault = options.validate().unwrap_err();
        let report = check_path(&problem, &path, &options);
        assert!(report.fails(Check::Input));
        assert_eq!(report.failures[0].message, fault.to_string());
    }
}

#[test]
fn a_report_is_one_json_object() {
    let problem = problem(crossed_struts(), vec![ball("sun", 0.5, 0.5, 0.1)]);
    let path = rectangles(&problem.structure, 70.0, 60.0, 4);
    let report = check_path(&problem, &path, &CheckOptions::default());
    let json = serde_json::to_value(&report).unwrap();
    assert_eq!(json["ok"], false);
    let failure = &json["failures"][0];
    assert_eq!(failure["check"], "clearance");
    assert_eq!(failure["subject"], "bc and sun");
    assert_eq!(failure["location"]["at"], "configuration");
    assert!(failure["message"].as_str().unwrap().contains("at least 0"));
    assert_eq!(json["statistics"]["configurations"], 5);
    let figures = json["figures"].as_array().unwrap();
    assert!(figures.iter().any(|figure| figure["check"] == "balance"));
}

#[test]
fn a_report_reads_as_a_table() {
    let problem = problem(crossed_struts(), vec![ball("sun", 0.5, 0.5, 0.1)]);
    let path = rectangles(&problem.structure, 70.0, 60.0, 4);
    let report = check_path(&problem, &path, &CheckOptions::default());
    let text = report.to_string();
    for figure in &report.figures {
        assert!(text.contains(figure.check.title()), "{text}");
    }
    assert!(
        text.contains("FAILED clearance at samples, bc and sun"),
        "{text}"
    );
    assert!(text.ends_with("The path is refused."), "{text}");
}
