//! Structures and environments built in Rust.

use nalgebra::{Point3, Rotation3, Vector3};
use tensegra_model::{
    Body, ElementKind, ElementSpec, EnvironmentBuilder, EnvironmentFlaw, EnvironmentPlace,
    ForceLaw, Interval, Obstacle, Place, Problem, Role, Shape, StructureBuilder, StructureFlaw,
};

fn triangle() -> StructureBuilder {
    StructureBuilder::spatial()
        .strut("s", ["a", "b"], 1.0)
        .bar("t", ["b", "c"], 1.0)
        .spring("u", ["c", "a"], 0.1..=2.0, 3.0, 0.5)
}

fn ball(name: &str, role: Role) -> Obstacle {
    Obstacle {
        name: name.into(),
        shape: Shape::Sphere {
            center: Point3::new(9.0, 0.0, 0.0),
            radius: 1.0,
        },
        role,
        color: None,
    }
}

#[test]
fn elements_of_every_kind_get_the_law_of_their_kind() {
    let structure = triangle()
        .cable("v", ["a", "d"], [0.0, 2.0], 1.0, 0.0..=3.0)
        .inextensible_cable("w", ["b", "d"], 1.5)
        .prismatic("x", ["c", "d"], 1.0..=2.0, -2.0, 0.25)
        .pretension(2.0)
        .build()
        .unwrap();
    let laws: Vec<ForceLaw> = structure.elements.iter().map(|e| e.law).collect();
    let linear = |stiffness, lo, hi| ForceLaw::Linear {
        stiffness,
        rest: Interval::new(lo, hi),
    };
    assert_eq!(
        laws,
        [
            ForceLaw::Free,
            ForceLaw::Free,
            linear(3.0, 0.5, 0.5),
            linear(1.0, 0.0, 3.0),
            ForceLaw::Free,
            linear(-2.0, 0.25, 0.25),
        ]
    );
    let forces: Vec<Interval> = structure.elements.iter().map(|e| e.force).collect();
    assert_eq!(
        forces,
        [
            Interval::new(f64::NEG_INFINITY, 0.0),
            Interval::new(f64::NEG_INFINITY, f64::INFINITY),
            Interval::new(0.0, 4.5),
            Interval::new(0.0, 2.0),
            Interval::new(0.0, f64::INFINITY),
            Interval::new(-3.5, -1.5),
        ]
    );
}

#[test]
fn the_order_of_naming_is_the_order_of_nodes() {
    let structure = triangle().build().unwrap();
    let names: Vec<&str> = structure.nodes.iter().map(|n| n.name.as_str()).collect();
    assert_eq!(names, ["a", "b", "c"]);
    assert_eq!(structure.pretension, Some(1.0));
    assert_eq!(structure.fixed.len(), 3);
    let fixed = triangle().fix("a", [1.0, 2.0, 3.0]).build().unwrap().fixed;
    let values: Vec<f64> = fixed.iter().map(|coordinate| coordinate.value).collect();
    assert_eq!(values, [1.0, 2.0, 3.0]);
}

#[test]
fn a_structure_without_forces_has_no_pretension() {
    let linkage = |name| ElementSpec::new(ElementKind::Bar, name, ["a", "b"], 1.0).force(0.0);
    let structure = StructureBuilder::spatial()
        .element(linkage("l"))
        .build()
        .unwrap();
    assert_eq!(structure.pretension, None);
    let errors = StructureBuilder::spatial()
        .element(linkage("l"))
        .pretension(1.0)
        .build()
        .unwrap_err();
    assert_eq!(errors[0].flaw, StructureFlaw::NothingToTension);
}

#[test]
fn errors_tell_where_what_and_how_to_mend_it() {
    let errors = StructureBuilder::spatial().build().unwrap_err();
    assert_eq!(
        (errors[0].place, &errors[0].flaw),
        (Place::Structure, &StructureFlaw::Empty)
    );
    assert_eq!(
        errors[0].to_string(),
        "structure: there is no element; declare at least one strut, bar, cable, spring or \
         prismatic strut"
    );

    let errors = triangle()
        .fix_coordinate("b", 1, 0.0)
        .fix_coordinate("b", 1, 1.0)
        .fix_coordinate("a", 0, f64::NAN)
        .load("c", [f64::INFINITY, 0.0, 0.0])
        .couple_forces("s", &[("r", 1.0)])
        .couple_orientations(
            "s",
            &[("t", Rotation3::identity()), ("t", Rotation3::identity())],
        )
        .pretension(0.0)
        .build()
        .unwrap_err();
    let told: Vec<String> = errors.iter().map(ToString::to_string).collect();
    assert_eq!(
        told,
        [
            "fixed coordinate y of node `b`: coordinate y of node `b` is fixed already, at 0",
            "fixed coordinate x of node `a`: the coordinate is NaN, which is no finite number",
            "load at node `c`: the load is inf, which is no finite number",
            "coupling of force to `s`: there is no element `r`",
            "coupling of orientation to `s`: element `t` occurs twice",
            "structure: the pretension is zero, but forces of norm zero carry nothing; leave the \
             pretension out to prescribe none",
        ]
    );
    assert_eq!(errors[0].place, Place::FixedCoordinate(1));
    assert_eq!(errors[4].place, Place::Coupling(1, 2));
}

#[test]
fn ranges_that_exclude_every_force_are_refused() {
    // The spring is always longer than its rest length: it cannot be slack.
    let taut = ElementSpec::new(ElementKind::Spring, "u", ["a", "b"], 1.0..=2.0).stiffness(1.0);
    let build = |spec: ElementSpec| StructureBuilder::spatial().element(spec).build();
    assert!(build(taut.clone().force([0.5, 1.5])).is_ok());
    let errors = build(taut.force([0.0, 0.5])).unwrap_err();
    assert_eq!(
        errors[0].flaw,
        StructureFlaw::NoForce {
            possible: [1.0, 2.0],
            allowed: [0.0, 0.5]
        }
    );
    // The wrong sign of stiffness for a strut that is to be compressed.
    let telescope = ElementSpec::new(ElementKind::Prismatic, "p", ["a", "b"], 1.0..=2.0);
    let pulled = telescope.clone().stiffness(1.0).force([-5.0, 0.0]);
    assert!(matches!(
        build(pulled).unwrap_err()[0].flaw,
        StructureFlaw::NoForce { .. }
    ));
    assert!(build(telescope.stiffness(-1.0).force([-5.0, 0.0])).is_ok());
}

#[test]
fn the_last_rule_about_a_pair_decides() {
    let structure = triangle().bar("v", ["a", "d"], 1.0).build().unwrap();
    let pairs = |builder: EnvironmentBuilder| builder.build(&structure).unwrap().pairs;
    let all = EnvironmentBuilder::default()
        .obstacle(ball("o", Role::Solid))
        .obstacle(ball("p", Role::Decoration))
        .check_all();
    // Six pairs of elements, and four with the only obstacle that collides.
    assert_eq!(pairs(all.clone()).len(), 10);
    // Only t and v share no node.
    let unconnected = all.ignore_connected();
    let elements = pairs(unconnected.clone());
    assert_eq!(elements[0], [Body::Element(0), Body::Obstacle(0)]);
    assert_eq!(elements.len(), 5);
    assert!(elements.contains(&[Body::Element(1), Body::Element(3)]));
    assert!(elements.is_sorted());
    let fewer = unconnected.clone().ignore("v", "t").ignore("o", "s");
    assert_eq!(pairs(fewer.clone()).len(), 3);
    assert_eq!(pairs(fewer.check_obstacle("o")).len(), 4);
    assert_eq!(pairs(unconnected.check("s", "t")).len(), 6);
    let named = EnvironmentBuilder::default()
        .check("t", "s")
        .check("s", "t");
    assert_eq!(pairs(named), [[Body::Element(0), Body::Element(1)]]);
}

#[test]
fn errors_of_an_environment_tell_which_part() {
    let structure = triangle().build().unwrap();
    let errors = EnvironmentBuilder::default()
        .obstacle(ball("s", Role::Solid))
        .obstacle(ball("o", Role::Decoration))
        .check("s", "nothing")
        .check_obstacle("o")
        .build(&structure)
        .unwrap_err();
    let places: Vec<EnvironmentPlace> = errors.iter().map(|error| error.place).collect();
    assert_eq!(
        places,
        [
            EnvironmentPlace::Obstacle(0),
            EnvironmentPlace::Rule(0, 1),
            EnvironmentPlace::Rule(1, 0)
        ]
    );
    assert_eq!(
        errors[2].flaw,
        EnvironmentFlaw::Decoration { name: "o".into() }
    );
}

#[test]
fn shapes_that_are_no_bodies_are_refused() {
    let structure = triangle().build().unwrap();
    let origin = Point3::origin();
    let x = Point3::new(1.0, 0.0, 0.0);
    for shape in [
        Shape::Sphere {
            center: Point3::new(f64::NAN, 0.0, 0.0),
            radius: 1.0,
        },
        Shape::Sphere {
            center: origin,
            radius: -1.0,
        },
        Shape::Box {
            min: x,
            max: origin,
        },
        Shape::Cylinder {
            p: x,
            q: x,
            radius: 1.0,
        },
        Shape::Prism {
            corners: [origin, x, Point3::new(2.0, 0.0, 0.0)],
            height: 1.0,
        },
        Shape::HalfSpace {
            point: origin,
            normal: Vector3::zeros(),
        },
        Shape::Mesh {
            file: "m.off".into(),
            vertices: vec![
                origin,
                x,
                Point3::new(0.0, 1.0, 0.0),
                Point3::new(0.0, 0.0, 1.0),
            ],
            faces: vec![vec![0, 1, 2], vec![0, 1, 3], vec![0, 2, 3]],
        },
    ] {
        let obstacle = Obstacle {
            shape: shape.clone(),
            ..ball("o", Role::Solid)
        };
        let errors = EnvironmentBuilder::default()
            .obstacle(obstacle)
            .build(&structure);
        let errors = errors.unwrap_err();
        let bad_shape = matches!(errors[0].flaw, EnvironmentFlaw::BadShape { .. });
        assert!(bad_shape, "{shape:?}");
    }
}

#[test]
fn a_problem_can_be_made_without_files() {
    let problem = Problem::new("triangle", triangle().build().unwrap());
    assert!(problem.start.is_none() && problem.files.is_empty());
}
