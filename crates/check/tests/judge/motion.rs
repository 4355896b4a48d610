//! Whole paths: their ends, their steps, and what happens between the samples.

use nalgebra::{Point3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use tensegra_check::{Check, CheckOptions, Location, Report, check_path};
use tensegra_model::{Body, Configuration, Endpoint, Interval, Obstacle, Path, Problem, Shape};

use crate::structures::{
    ball, crossed_struts, fixed, link, node, obstacle, prism, problem, raising, rectangle,
    rectangles,
};

/// Steps of any size.
fn any_step() -> CheckOptions {
    CheckOptions::default().with_max_displacement(Some(10.0))
}

fn judge(obstacles: Vec<Obstacle>, steps: usize) -> Report {
    let problem = problem(crossed_struts(), obstacles);
    let path = rectangles(&problem.structure, 70.0, 20.0, steps);
    check_path(&problem, &path, &any_step())
}

fn endpoint(configuration: &Configuration) -> Endpoint {
    let mut endpoint = Endpoint::at(configuration.positions.clone(), &crossed_struts());
    endpoint.forces.clone_from(&configuration.forces);
    endpoint
}

#[test]
fn a_path_of_closed_form_equilibria_is_accepted() {
    let mut problem = problem(crossed_struts(), vec![ball("sun", 1.2, 1.2, 0.1)]);
    let path = rectangles(&problem.structure, 70.0, 20.0, 20);
    problem.start = path.configurations.first().map(endpoint);
    problem.goal = path.configurations.last().map(endpoint);
    let report = check_path(&problem, &path, &CheckOptions::default());
    assert!(report.ok, "{report}");
    assert_eq!(report.statistics.configurations, 21);
    // Node c moves on the unit circle, by chords of 2.5°; every other node moves less.
    let chord = 2.0 * 1.25f64.to_radians().sin();
    assert!((report.statistics.path_length - 20.0 * chord).abs() < 1e-12);
    assert!((report.figure(Check::Displacement).unwrap().value - chord).abs() < 1e-12);
    assert!(report.figure(Check::RangesBetween).unwrap().value < 1e-12);
    // Proven clearance is below the true one, 1.2 √2 − 1.1, by little.
    let truth = 1.2 * 2f64.sqrt() - 1.1;
    let proven = report.figure(Check::ClearanceBetween).unwrap().value;
    assert!(proven <= truth && proven > 0.8 * truth, "{report}");
}

#[test]
fn ends_must_be_those_of_the_problem() {
    let mut problem = problem(crossed_struts(), Vec::new());
    let path = rectangles(&problem.structure, 70.0, 20.0, 20);
    let elsewhere = |degrees: f64| {
        Some(endpoint(&rectangle(
            &crossed_struts(),
            f64::to_radians(degrees),
        )))
    };
    problem.start = elsewhere(70.01);
    problem.goal = elsewhere(20.01);
    assert!(check_path(&problem, &path, &CheckOptions::default()).ok);
    problem.start = elsewhere(72.0);
    problem.goal = elsewhere(18.0);
    let report = check_path(&problem, &path, &CheckOptions::default());
    assert!(report.fails(Check::Start) && report.fails(Check::Goal));
    let goal = report.figure(Check::Goal).unwrap();
    assert_eq!(goal.location, Location::Configuration { index: 20 });
    assert!(
        (goal.value - 2.0 * 1f64.to_radians().sin()).abs() < 1e-9,
        "{report}"
    );

    // Right place, wrong forces; but another pretension of the same forces is the same place.
    let mut scaled = elsewhere(70.0);
    scaled
        .iter_mut()
        .flat_map(|e| &mut e.forces)
        .flatten()
        .for_each(|force| *force *= 3.0);
    problem.start = scaled.clone();
    problem.goal = None;
    assert!(check_path(&problem, &path, &CheckOptions::default()).ok);
    if let Some(endpoint) = &mut scaled {
        endpoint.forces[2] = Some(-1.0);
    }
    problem.start = scaled;
    let report = check_path(&problem, &path, &CheckOptions::default());
    assert!(report.fails(Check::StartForces) && !report.fails(Check::Start));
}

#[test]
fn a_step_that_is_too_long_is_named() {
    let problem = problem(crossed_struts(), Vec::new());
    let mut path = rectangles(&problem.structure, 70.0, 20.0, 20);
    path.configurations.drain(7..9);
    let report = check_path(&problem, &path, &CheckOptions::default());
    let [failure] = &report.failures[..] else {
        panic!("{report}")
    };
    assert_eq!(failure.check, Check::Displacement);
    assert_eq!(failure.location, Location::Step { index: 6 });
    assert_eq!(failure.subject, "node c");
    assert!((failure.limit.unwrap() - 0.05).abs() < 1e-9);
}

#[test]
fn an_obstacle_jumped_between_two_samples_is_found() {
    // A pin on the way of the strut a–c, half-way between two samples; and a wall as thin.
    let angle = (70.0f64 - 2.5 * 5.5).to_radians();
    let (x, y) = (0.7 * angle.cos(), 0.7 * angle.sin());
    let wall = Shape::Box {
        min: Point3::new(x - 1e-4, y - 1e-4, -1.0),
        max: Point3::new(x + 1e-4, y + 1e-4, 1.0),
    };
    for obstacle in [ball("pin", x, y, 0.002), obstacle("wall", wall)] {
        let mut problem = problem(crossed_struts(), vec![obstacle]);
        problem.environment.pairs = vec![[Body::Element(0), Body::Obstacle(0)]];
        let path = rectangles(&problem.structure, 70.0, 20.0, 20);
        let report = check_path(&problem, &path, &any_step());
        assert!(
            report.figure(Check::Clearance).unwrap().value > 1e-3,
            "free at the samples"
        );
        let [failure] = &report.failures[..] else {
            panic!("{report}")
        };
        assert_eq!(failure.check, Check::ClearanceBetween);
        assert!(failure.subject.starts_with("ac and "), "{report}");
        let Location::Interval { index: 5, fraction } = failure.location else {
            panic!("{report}")
        };
        assert!((fraction - 0.5).abs() < 0.25, "{report}");
        assert!(failure.value.unwrap() < 0.0);
    }
}

#[test]
fn a_path_that_grazes_is_accepted_and_one_that_scrapes_is_not() {
    // Node c passes a ball outside its circle. A chord of the circle stays farther away from it
    // than the arc does, by 2e-4 for these steps.
    let outside = |gap: f64| {
        let reach = (1.1 + gap) * 45f64.to_radians().cos();
        vec![ball("sun", reach, reach, 0.1)]
    };
    let report = judge(outside(1e-4), 21);
    assert!(report.ok, "{report}");
    let proven = report.figure(Check::ClearanceBetween).unwrap().value;
    assert!(proven > 0.0 && proven <= 1e-4, "{report}");
    assert!(report.statistics.depth >= 1);

    let report = judge(outside(-5e-5), 21);
    assert!(!report.fails(Check::Clearance), "{report}");
    assert!(report.fails(Check::ClearanceBetween), "{report}");
}

#[test]
fn sliding_along_a_wall_is_accepted() {
    // Cable a–b stays on the x axis; its ends move along a floor that is 1e-7 below.
    let (point, normal) = (Point3::new(0.0, -0.01 - 1e-7, 0.0), Vector3::y());
    let floor = obstacle("floor", Shape::HalfSpace { point, normal });
    let report = judge(vec![floor], 20);
    assert!(report.ok, "{report}");
}

#[test]
fn required_clearance_holds_between_samples_too() {
    let sun = || vec![ball("sun", 0.8, 0.8, 0.1)];
    let truth = 0.8 * 2f64.sqrt() - 1.1;
    let problem = problem(crossed_struts(), sun());
    let path = rectangles(&problem.structure, 70.0, 20.0, 21);
    let with = |gap: f64| check_path(&problem, &path, &any_step().with_min_clearance(gap));
    assert!(with(truth - 1e-4).ok, "{}", with(truth - 1e-4));
    let report = with(truth + 1e-5);
    assert!(
        !report.fails(Check::Clearance) && report.fails(Check::ClearanceBetween),
        "{report}"
    );
    assert!(with(truth + 1e-2).fails(Check::Clearance));
}

#[test]
fn elements_are_kept_apart() {
    // The struts cross each other in the plane, always.
    let mut problem = problem(crossed_struts(), Vec::new());
    problem.environment.pairs = vec![[Body::Element(0), Body::Element(1)]];
    let path = rectangles(&problem.structure, 70.0, 60.0, 10);
    let report = check_path(&problem, &path, &any_step());
    let failure = &report.failures[0];
    assert_eq!(
        (failure.check, failure.subject.as_str()),
        (Check::Clearance, "ac and bd")
    );
    assert_eq!(failure.count, 11);

    problem.environment.pairs = vec![[Body::Element(2), Body::Element(4)]];
    let report = check_path(&problem, &path, &any_step());
    assert!(report.ok);
    let least = 60f64.to_radians().sin() - 0.02;
    assert!((report.figure(Check::Clearance).unwrap().value - least).abs() < 1e-12);
}

#[test]
fn ranges_may_not_be_left_between_samples() {
    // The structure turns about its centre, on a leash that is as long as both samples need, which
    // is not enough half-way: there node a is farthest from the post.
    let mut structure = crossed_struts();
    structure.nodes.push(node("post"));
    let mut leash = link("leash", [0, 4], 1.0);
    leash.length = Interval::new(0.0, 3.0);
    structure.elements.push(leash);
    structure.fixed = vec![fixed(4, 0, -2.0), fixed(4, 1, 0.0)];
    let turned = |angle: f64| {
        let mut configuration = rectangle(&crossed_struts(), 0.7);
        let turn = nalgebra::Rotation3::from_axis_angle(&Vector3::z_axis(), angle - 0.7);
        let center = configuration.positions[2].coords * 0.5;
        let positions = &mut configuration.positions;
        // A half turn on top brings node a to where c would be, away from the post.
        positions
            .iter_mut()
            .for_each(|p| *p = Point3::from(-(turn * (p.coords - center))));
        positions.push(Point3::new(-2.0, 0.0, 0.0));
        configuration
            .lengths
            .push((positions[4] - positions[0]).norm());
        configuration.rest_lengths.push(None);
        configuration.forces.push(None);
        configuration
    };
    let path = Path {
        configurations: vec![turned(-0.3), turned(0.3)],
    };
    let longest = path.configurations[0].lengths[6];
    assert!((longest - path.configurations[1].lengths[6]).abs() < 1e-12 && longest < 2.49);

    let mut problem = problem(structure, Vec::new());
    let report = check_path(&problem, &path, &any_step());
    assert!(report.ok, "{report}");
    problem.structure.elements[6].length.hi = longest;
    let report = check_path(&problem, &path, &any_step());
    let [failure] = &report.failures[..] else {
        panic!("{report}")
    };
    assert_eq!(failure.check, Check::RangesBetween);
    assert_eq!(failure.subject, "element leash");
    assert!(
        (failure.value.unwrap() - (2.5 - longest)).abs() < 1e-6,
        "{report}"
    );
    let lenient = any_step().with_range_tolerance_between(0.1);
    assert!(check_path(&problem, &path, &lenient).ok);
}

#[test]
fn a_jump_to_another_sheet_is_not_a_motion() {
    // Node e hangs on two links between a and c and lies on either side of the line.
    let mut structure = crossed_struts();
    structure.nodes.push(node("e"));
    structure.elements.push(link("ae", [0, 4], 0.5001));
    structure.elements.push(link("ce", [2, 4], 0.5001));
    let problem = problem(structure, Vec::new());
    let height = (0.5001f64.powi(2) - 0.25).sqrt();
    assert!(height < 0.012);
    let with = |degrees: f64, side: f64| {
        let mut configuration = rectangle(&crossed_struts(), degrees.to_radians());
        let c = configuration.positions[2];
        let across = Vector3::new(-c.y, c.x, 0.0);
        configuration
            .positions
            .push(nalgebra::center(&Point3::origin(), &c) + across * side * height);
        configuration.lengths.extend([0.5001, 0.5001]);
        configuration.rest_lengths.extend([None, None]);
        configuration.forces.extend([None, None]);
        configuration
    };
    let judge = |path: Vec<Configuration>| {
        check_path(
            &problem,
            &Path {
                configurations: path,
            },
            &CheckOptions::default(),
        )
    };
    let report = judge(vec![with(50.0, 1.0), with(51.0, 1.0), with(52.0, 1.0)]);
    assert!(report.ok, "{report}");
    for second in [50.0, 51.0, 52.0] {
        let report = judge(vec![with(50.0, 1.0), with(second, -1.0)]);
        assert!(
            report.fails(Check::Continuity) || report.fails(Check::EquilibriumBetween),
            "{report}"
        );
        assert!(!report.fails(Check::Balance) && !report.fails(Check::Displacement));
    }
}

fn prism_problem(obstacles: Vec<Obstacle>, pairs: Vec<[Body; 2]>) -> Problem {
    let mut problem = problem(prism(), obstacles);
    problem.environment.pairs = pairs;
    problem
}

#[test]
fn the_prism_rises_between_its_own_bodies() {
    // Struts against each other, and the platform against the struts.
    let elements: Vec<usize> = (0..12).collect();
    let mut pairs = Vec::new();
    for &i in &elements {
        for &j in &elements {
            let shares = |i: usize, j: usize| {
                let structure = prism();
                let nodes = structure.elements[j].nodes;
                structure.elements[i]
                    .nodes
                    .iter()
                    .any(|node| nodes.contains(node))
            };
            if i < j && !shares(i, j) {
                pairs.push([Body::Element(i), Body::Element(j)]);
            }
        }
    }
    pairs.extend((0..3).map(|i| [Body::Element(4 * i + 2), Body::Attachment(0)]));
    let problem = prism_problem(Vec::new(), pairs);
    let path = raising(&problem.structure, 0.6, 1.0, 10);
    let report = check_path(&problem, &path, &CheckOptions::default());
    assert!(report.ok, "{report}");
}

#[test]
fn a_platform_meets_ceilings_and_holes() {
    // The peg's top is 0.3 above the upper triangle. It rises from 1.1 to 1.3.
    let ceiling = |height: f64| {
        obstacle(
            "ceiling",
            Shape::Box {
                min: Point3::new(-1.0, -1.0, height),
                max: Point3::new(1.0, 1.0, height + 0.1),
            },
        )
    };
    let judge = |obstacle: Obstacle| {
        let problem = prism_problem(
            vec![obstacle],
            vec![[Body::Attachment(0), Body::Obstacle(0)]],
        );
        let path = raising(&problem.structure, 0.8, 1.0, 8);
        check_path(&problem, &path, &CheckOptions::default())
    };
    let report = judge(ceiling(1.301));
    assert!(report.ok, "{report}");
    assert!(
        (report.figure(Check::Clearance).unwrap().value - 1e-3).abs() < 1e-9,
        "{report}"
    );
    assert!(judge(ceiling(1.299)).fails(Check::Clearance));
    // A frame of four beams around the peg: a hole, as a mesh.
    let report = judge(obstacle("frame", frame(0.021, 1.2)));
    assert!(report.ok, "{report}");
    let report = judge(obstacle("frame", frame(0.019, 1.2)));
    assert!(report.fails(Check::Clearance), "{report}");
    // A thin sheet that the slab would have to pass.
    assert!(judge(ceiling(0.9)).fails(Check::Clearance));
}

/// A square plate with a square hole of a half width at the origin, from `height` to 0.05 above.
fn frame(half: f64, height: f64) -> Shape {
    let mut vertices = Vec::new();
    for z in [height, height + 0.05] {
        for reach in [half, 0.5] {
            for (x, y) in [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)] {
                vertices.push(Point3::new(reach * x, reach * y, z));
            }
        }
    }
    let mut faces = Vec::new();
    for i in 0..4 {
        let j = (i + 1) % 4;
        faces.push(vec![i, j, 4 + j, 4 + i]);
        faces.push(vec![8 + i, 12 + i, 12 + j, 8 + j]);
        faces.push(vec![i, 8 + i, 8 + j, j]);
        faces.push(vec![4 + i, 4 + j, 12 + j, 12 + i]);
    }
    Shape::Mesh {
        file: "frame.off".to_owned(),
        vertices,
        faces,
    }
}

#[test]
fn a_platform_that_jumps_through_a_sheet_is_found() {
    // The slab is 0.02 thick and the sheet 0.001; steps of 0.04 pass it between samples.
    let sheet = |low: f64| {
        let (min, max) = (
            Point3::new(-0.15, -0.15, low),
            Point3::new(-0.1, -0.1, low + 1e-3),
        );
        obstacle("sheet", Shape::Box { min, max })
    };
    let mut problem = prism_problem(
        vec![sheet(0.829)],
        vec![[Body::Attachment(0), Body::Obstacle(0)]],
    );
    let path = raising(&problem.structure, 0.8, 0.96, 4);
    let report = check_path(&problem, &path, &any_step());
    assert!(!report.fails(Check::Clearance), "{report}");
    assert!(report.fails(Check::ClearanceBetween), "{report}");
    assert_eq!(report.failures[0].subject, "platform and sheet");

    // Out of the way of the slab it is no obstacle.
    let (min, max) = (Point3::new(0.25, 0.25, 0.829), Point3::new(0.3, 0.3, 0.83));
    problem.environment.obstacles[0] = obstacle("sheet", Shape::Box { min, max });
    let report = check_path(&problem, &path, &any_step());
    assert!(report.ok, "{report}");
}

#[test]
fn a_free_flying_structure_may_be_anywhere() {
    // The same path, moved rigidly, has the same figures.
    let mut problem = problem(crossed_struts(), vec![ball("sun", 1.2, 1.2, 0.1)]);
    problem.structure.fixed.clear();
    let path = rectangles(&problem.structure, 70.0, 20.0, 20);
    let expected = check_path(&problem, &path, &CheckOptions::default());
    assert!(expected.ok, "{expected}");

    let turn = nalgebra::Rotation3::from_axis_angle(&Vector3::z_axis(), 0.4);
    let moved = |point: Point3<f64>| turn * point + Vector3::new(3.0, -2.0, 0.0);
    let mut path = path;
    for configuration in &mut path.configurations {
        configuration
            .positions
            .iter_mut()
            .for_each(|position| *position = moved(*position));
    }
    let center = moved(Point3::new(1.2, 1.2, 0.0));
    problem.environment.obstacles[0] = ball("sun", center.x, center.y, 0.1);
    problem.structure.base_range = Some(Vector3::new(4.0, 4.0, 0.0));
    let report = check_path(&problem, &path, &CheckOptions::default());
    assert!(report.ok, "{report}");
    for check in [
        Check::Clearance,
        Check::ClearanceBetween,
        Check::Displacement,
        Check::Stability,
    ] {
        let [before, after] = [&expected, &report].map(|r| r.figure(check).unwrap().value);
        assert!((before - after).abs() < 1e-9, "{check:?}: {before} {after}");
    }
}

#[test]
fn the_verdict_is_the_same_on_every_run() {
    let problem = problem(crossed_struts(), vec![ball("sun", 0.8, 0.8, 0.1)]);
    let path = rectangles(&problem.structure, 70.0, 20.0, 20);
    let run = || check_path(&problem, &path, &CheckOptions::default());
    assert_eq!(run(), run());
}

#[test]
fn a_path_of_one_configuration_is_start_and_goal() {
    let mut problem = problem(crossed_struts(), Vec::new());
    problem.structure.fixed.push(fixed(1, 1, 0.0));
    let only = rectangle(&problem.structure, 0.7);
    problem.start = Some(endpoint(&only));
    let path = Path {
        configurations: vec![only],
    };
    assert!(check_path(&problem, &path, &CheckOptions::default()).ok);
    problem.goal = Some(endpoint(&rectangle(&problem.structure, 0.9)));
    assert!(check_path(&problem, &path, &CheckOptions::default()).fails(Check::Goal));
}

#[test]
fn proofs_hold_wherever_the_obstacle_is() {
    // The motion between these samples is known: rectangles of all angles. What is proven may not
    // exceed the clearance found by sampling it finely, and what is free by more than a hair must
    // be proven.
    let mut random = Pcg64::seed_from_u64(7);
    let mut uniform = |low: f64, high: f64| low + (high - low) * random.random::<f64>();
    let structure = crossed_struts();
    let path = rectangles(&structure, 70.0, 40.0, 12);
    let fine = rectangles(&structure, 70.0, 40.0, 12 * 24);
    let (mut free, mut blocked) = (0, 0);
    for index in 0..180 {
        let center = Point3::new(uniform(0.0, 0.8), uniform(0.0, 0.9), uniform(-0.02, 0.02));
        let reach = uniform(0.002, 0.05);
        let shape = match index % 3 {
            0 => Shape::Sphere {
                center,
                radius: reach,
            },
            1 => {
                let half = Vector3::new(reach, uniform(0.001, 0.1), 0.02);
                Shape::Box {
                    min: center - half,
                    max: center + half,
                }
            }
            _ => {
                let side = Vector3::new(uniform(-0.1, 0.1), uniform(-0.1, 0.1), 0.1);
                Shape::Cylinder {
                    p: center - side,
                    q: center + side,
                    radius: reach,
                }
            }
        };
        let mut problem = problem(structure.clone(), vec![obstacle("it", shape)]);
        // One pair at a time, or the first collision would hide the others.
        problem.environment.pairs = vec![[Body::Element(index % 6), Body::Obstacle(0)]];
        let report = check_path(&problem, &path, &any_step());
        let truth = fine
            .configurations
            .iter()
            .map(|configuration| {
                let report = tensegra_check::check_configuration(
                    &problem,
                    configuration,
                    &CheckOptions::default(),
                );
                report.figure(Check::Clearance).unwrap().value
            })
            .fold(f64::INFINITY, f64::min);
        // Between fine samples a point moves by less than 2e-3, so the truth may be 1e-3 less.
        if report.ok {
            let proven = report.figure(Check::ClearanceBetween).unwrap().value;
            assert!(
                proven <= truth + 1e-9 && truth > 0.0,
                "{index}: {truth}\n{report}"
            );
            assert!(proven > 0.4 * truth - 1e-3, "{index}: {truth}\n{report}");
            free += 1;
        } else {
            assert!(truth < 1e-3, "{index}: {truth}\n{report}");
            blocked += 1;
        }
    }
    assert!(free > 30 && blocked > 30, "{free} {blocked}");
}
