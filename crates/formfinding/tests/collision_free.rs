//! Form-finding of the paper's prism, judged independently.

use std::path::PathBuf;

use nalgebra::{Point3, Rotation3, Vector3};
use tensegra_check::{CheckOptions, check_configuration};
use tensegra_formfinding::{
    FollowOptions, Form, FormError, FormProblem, Forms, Group, RESIDUAL, follow,
};
use tensegra_model::{
    FormCondition, FormCost, Interval, Obstacle, Problem, Role, Shape, Structure,
};

fn fixture(name: &str) -> Problem {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../fixtures");
    Problem::read(&path.join(name)).unwrap()
}

fn prism() -> Problem {
    fixture("formfinding/prism.toml")
}

fn find(problem: &Problem, seed: u64, starts: usize) -> Result<Forms, FormError> {
    FormProblem::new(problem, &[])?.find(seed, starts)
}

fn node(problem: &Problem, name: &str) -> usize {
    problem.structure.node_index(name).unwrap()
}

fn centroid(problem: &Problem, form: &Form) -> Point3<f64> {
    let sum: Vector3<f64> = ["b1", "b2", "b3"]
        .iter()
        .map(|name| form.configuration.positions[node(problem, name)].coords)
        .sum();
    Point3::from(sum / 3.0)
}

#[test]
fn most_starts_lead_to_forms_that_the_judge_accepts() {
    let problem = prism();
    let forms = find(&problem, 1, 100).unwrap();
    assert!(forms.forms.len() >= 80, "{}", forms.forms.len());
    for form in &forms.forms {
        assert!(form.residual <= RESIDUAL);
        assert!(form.clearance >= 0.0);
        assert!(form.least_stiffness.unwrap() > 0.0);
        let miss = (centroid(&problem, form) - Point3::new(0.0, 0.0, 0.5)).norm();
        assert!(miss < 1e-9, "{miss}");
        let report = check_configuration(&problem, &form.configuration, &CheckOptions::default());
        assert!(report.ok, "start {}: {report}", form.start);
        let judged = report.figure(tensegra_check::Check::Stability).unwrap();
        let own = form.least_stiffness.unwrap();
        assert!((judged.value - own).abs() < 1e-6 * own.abs().max(1.0));
    }
    assert!(forms.shape_count() > 1 && forms.shape_count() <= forms.forms.len());
}

#[test]
fn threads_do_not_matter() {
    let problem = prism();
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| find(&problem, 7, 12).unwrap())
    };
    assert_eq!(on(1), on(3));
    assert_ne!(on(1), find(&problem, 8, 12).unwrap());
}

#[test]
fn clearances_are_kept_where_they_are_asked_for() {
    let mut problem = prism();
    problem.form.clearance = 0.02;
    let forms = find(&problem, 1, 20).unwrap();
    assert!(forms.forms.iter().all(|form| form.clearance >= 0.02));
    // Lines without ends keep at least as far apart as bars.
    problem.form.clearance = 0.0;
    problem.form.infinite_cylinders = true;
    let forms = find(&problem, 1, 20).unwrap();
    for form in &forms.forms {
        let p = |name: &str| form.configuration.positions[node(&problem, name)];
        for [a, b] in [["1", "2"], ["2", "3"], ["3", "1"]] {
            let [a0, a1] = [p(&format!("a{a}")), p(&format!("b{a}"))];
            let [b0, b1] = [p(&format!("a{b}")), p(&format!("b{b}"))];
            let normal = (a1 - a0).cross(&(b1 - b0)).normalize();
            let apart = (a0 - b0).dot(&normal).abs();
            assert!(apart >= 0.035 - 1e-9, "{apart}");
        }
    }
}

#[test]
fn nodes_and_bars_keep_out_of_obstacles() {
    let mut problem = prism();
    problem.environment.obstacles.push(Obstacle {
        name: "wall".into(),
        shape: Shape::HalfSpace {
            point: Point3::new(0.0, 0.0, 0.53),
            normal: Vector3::new(0.0, 0.0, -1.0),
        },
        role: Role::Solid,
        color: None,
    });
    problem.form.node_radius = Some(0.01);
    let forms = find(&problem, 3, 20).unwrap();
    for form in &forms.forms {
        for name in ["b1", "b2", "b3"] {
            let height = form.configuration.positions[node(&problem, name)].z;
            assert!(height <= 0.52, "{height}");
        }
    }
}

#[test]
fn symmetric_forms() {
    let mut problem = prism();
    let turn =
        *Rotation3::from_axis_angle(&Vector3::z_axis(), std::f64::consts::TAU / 3.0).matrix();
    for [a, b] in [["b1", "b2"], ["b2", "b3"]] {
        problem.form.conditions.push(FormCondition::Image {
            nodes: [node(&problem, a), node(&problem, b)],
            linear: turn,
            translation: Vector3::zeros(),
        });
    }
    let elements = ["c1", "c2"].map(|name| problem.structure.element_index(name).unwrap());
    problem.form.conditions.push(FormCondition::Force {
        element: elements[0],
        range: Interval::constant(12.0),
    });
    let form = find(&problem, 5, 10).unwrap().best().clone();
    let lengths = elements.map(|e| form.configuration.lengths[e]);
    assert!((lengths[0] - lengths[1]).abs() < 1e-9);
    assert!((form.configuration.forces[elements[0]].unwrap() - 12.0).abs() < 1e-6);
}

/// The form of least energy, which is unique, from a form found with another structure's help.
fn least_energy(mut problem: Problem) -> Form {
    problem.form.cost = FormCost::Energy;
    find(&problem, 2, 6).unwrap().best().clone()
}

fn turned(structure: &mut Structure, rotation: &Rotation3<f64>) {
    let mut places = vec![Point3::origin(); structure.nodes.len()];
    for fixed in &structure.fixed {
        places[fixed.node][fixed.axis] = fixed.value;
    }
    for fixed in &mut structure.fixed {
        fixed.value = (rotation * places[fixed.node])[fixed.axis];
    }
    for node in &mut structure.nodes {
        node.load = rotation * node.load;
    }
}

#[test]
fn forms_do_not_depend_on_place_units_and_strength() {
    let reference = least_energy(prism());
    let lengths = |form: &Form, unit: f64| -> Vec<f64> {
        form.configuration
            .lengths
            .iter()
            .map(|l| l * unit)
            .collect()
    };
    let close = |a: &[f64], b: &[f64], what: &str| {
        for (a, b) in a.iter().zip(b) {
            assert!((a - b).abs() < 1e-4, "{what}: {a} is not {b}");
        }
    };

    let mut problem = prism();
    let rotation = Rotation3::from_euler_angles(0.3, -0.8, 1.1);
    turned(&mut problem.structure, &rotation);
    let place = rotation * Point3::new(0.0, 0.0, 0.5);
    let nodes = ["b1", "b2", "b3"].map(|name| node(&problem, name));
    problem.form.conditions = vec![FormCondition::centroid(&nodes, place.coords.into())];
    let form = least_energy(problem);
    close(&lengths(&form, 1.0), &lengths(&reference, 1.0), "turned");

    // Metres to millimetres and newtons to kilonewtons; then twice as stiff and as strong, under
    // twice the loads.
    for (force, length) in [(1e-3, 1e3), (2.0, 1.0)] {
        let form = least_energy(scaled(prism(), force, length));
        let what = format!("forces times {force}, lengths times {length}");
        close(
            &lengths(&form, 1.0 / length),
            &lengths(&reference, 1.0),
            &what,
        );
        let stiffness = |form: &Form| form.least_stiffness.unwrap();
        let ratio = stiffness(&form) * length / force / stiffness(&reference);
        assert!((ratio - 1.0).abs() < 1e-3, "{what}: {ratio}");
        assert!(
            (form.clearance / length - reference.clearance).abs() < 1e-4,
            "{what}"
        );
        let forces = |form: &Form, unit: f64| -> Vec<f64> {
            let forces = form.configuration.forces.iter();
            forces.map(|force| force.unwrap() * unit).collect()
        };
        for (a, b) in forces(&form, 1.0 / force)
            .iter()
            .zip(&forces(&reference, 1.0))
        {
            assert!(
                (a - b).abs() < 1e-3 * b.abs().max(1.0),
                "{what}: {a} is not {b}"
            );
        }
    }

    let form = least_energy(relabelled(prism()));
    close(
        &lengths(&form, 1.0),
        &lengths(&reference, 1.0),
        "relabelled",
    );
}

/// The problem in other units.
fn scaled(mut problem: Problem, force: f64, length: f64) -> Problem {
    let times = |range: Interval, unit: f64| Interval::new(unit * range.lo, unit * range.hi);
    let structure = &mut problem.structure;
    for element in &mut structure.elements {
        element.length = times(element.length, length);
        element.force = times(element.force, force);
        element.radius *= length;
        if let tensegra_model::ForceLaw::Linear { stiffness, rest } = &mut element.law {
            *stiffness *= force / length;
            *rest = times(*rest, length);
        }
    }
    structure
        .nodes
        .iter_mut()
        .for_each(|node| node.load *= force);
    structure
        .fixed
        .iter_mut()
        .for_each(|fixed| fixed.value *= length);
    for condition in &mut problem.form.conditions {
        if let FormCondition::Point { at, .. } = condition {
            at.iter_mut()
                .flatten()
                .for_each(|range| *range = times(*range, length));
        }
    }
    problem
}

/// The problem with its nodes in the reverse order, and elements from their second to their first.
fn relabelled(mut problem: Problem) -> Problem {
    let structure = &mut problem.structure;
    let last = structure.nodes.len() - 1;
    structure.nodes.reverse();
    for element in &mut structure.elements {
        element.nodes = element.nodes.map(|node| last - node);
        element.nodes.reverse();
    }
    structure
        .fixed
        .iter_mut()
        .for_each(|fixed| fixed.node = last - fixed.node);
    for condition in &mut problem.form.conditions {
        if let FormCondition::Point { of, .. } = condition {
            of.iter_mut().for_each(|(node, _)| *node = last - *node);
        }
    }
    problem
}

#[test]
fn a_motion_is_followed_until_it_is_blocked() {
    let problem = prism();
    let nodes = ["b1", "b2", "b3"].map(|name| node(&problem, name));
    let start = least_energy(prism());
    let line = |t: f64| {
        let mut problem = problem.clone();
        problem.form.conditions = vec![FormCondition::centroid(&nodes, [0.0, 0.3 * t, 0.5])];
        FormProblem::new(&problem, &[])
    };
    let options = FollowOptions::new(20, 0.05);
    let followed = follow(&start.configuration, line, options).unwrap();
    assert_eq!(followed.stopped, None);
    assert_eq!(followed.forms.last().unwrap().0, 1.0);
    for pair in followed.forms.windows(2) {
        let [a, b] = [&pair[0].1, &pair[1].1].map(|form| &form.configuration.positions);
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).norm() <= 0.05));
    }
    // Bars of at most 2 m do not reach this far.
    let beyond = |t: f64| {
        let mut problem = problem.clone();
        problem.form.conditions = vec![FormCondition::centroid(&nodes, [0.0, 4.0 * t, 0.5])];
        FormProblem::new(&problem, &[])
    };
    let options = FollowOptions::new(20, 0.5);
    let followed = follow(&start.configuration, beyond, options).unwrap();
    let reached = followed.forms.last().unwrap().0;
    assert!(
        followed.stopped.is_some() && reached > 0.05 && reached < 0.6,
        "{reached}"
    );
}

/// What cannot be met, and its violation.
fn unmet(problem: &Problem) -> (Vec<(String, Group, f64)>, String) {
    let error = find(problem, 1, 6).unwrap_err();
    let text = error.to_string();
    let FormError::Unmet { unmet, .. } = error else {
        panic!("{text}");
    };
    let list = unmet
        .into_iter()
        .map(|unmet| (unmet.constraint, unmet.group, unmet.violation))
        .collect();
    (list, text)
}

#[test]
fn contradictory_ranges_are_named() {
    let mut problem = prism();
    problem.form.conditions.clear();
    // A triangle with sides of at most 0.3, 0.3 and at least 0.9.
    for (name, range) in [("t1", [0.1, 0.3]), ("t2", [0.1, 0.3]), ("t3", [0.9, 2.0])] {
        let element = problem.structure.element_index(name).unwrap();
        problem.structure.elements[element].length = range.into();
    }
    let (unmet, text) = unmet(&problem);
    assert!(
        unmet.iter().all(|(_, group, _)| *group == Group::Lengths),
        "{text}"
    );
    // The triangle's inequality is missed by 0.3 in all, whoever bears how much of it.
    assert!(
        unmet
            .iter()
            .all(|(what, ..)| what.contains(" of the length of t")),
        "{text}"
    );
    let (_, _, violation) = &unmet[0];
    assert!(*violation > 0.05 && *violation < 0.35, "{text}");
}

#[test]
fn a_place_out_of_reach_is_named() {
    let mut problem = prism();
    let nodes = ["b1", "b2", "b3"].map(|name| node(&problem, name));
    problem.form.conditions = vec![FormCondition::centroid(&nodes, [0.0, 0.0, 5.0])];
    let (unmet, text) = unmet(&problem);
    let (what, group, violation) = &unmet[0];
    assert_eq!(*group, Group::Conditions, "{text}");
    assert!(what.contains("centroid of b1, b2, b3 at z = 5"), "{text}");
    // Bars of 2 m on a base of radius 0.2 reach about 2 m high.
    assert!(*violation > 2.9 && *violation < 3.3, "{text}");
}

#[test]
fn a_load_that_cannot_be_carried_is_named() {
    let mut problem = prism();
    let pulled = node(&problem, "b2");
    // Cables carry 50 N and bars push: nothing holds 400 N upwards.
    problem.structure.nodes[pulled].load.z = 400.0;
    let (unmet, text) = unmet(&problem);
    assert!(
        unmet.iter().all(|(_, group, _)| *group == Group::Balance),
        "{text}"
    );
    assert!(text.contains("force balance of b2 along z"), "{text}");
    assert!(unmet[0].2 > 50.0 && unmet[0].2 < 400.0, "{text}");
}

#[test]
fn an_obstacle_that_swallows_a_fixed_node_is_named() {
    let mut problem = prism();
    problem.form.node_radius = Some(0.01);
    problem.environment.obstacles.push(Obstacle {
        name: "boulder".into(),
        shape: Shape::Sphere {
            center: Point3::new(0.25, 0.0, 0.0),
            radius: 0.2,
        },
        role: Role::Solid,
        color: None,
    });
    let error = FormProblem::new(&problem, &[]).unwrap_err();
    let FormError::Swallowed {
        node,
        obstacle,
        clearance,
        ..
    } = &error
    else {
        panic!("{error}");
    };
    assert_eq!((node.as_str(), obstacle.as_str()), ("a1", "boulder"));
    assert!((clearance + 0.15).abs() < 1e-12);
    assert!(error.to_string().contains("swallows the fixed node a1"));
}
