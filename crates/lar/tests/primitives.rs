//! Motion primitives against the figures of the literature and the independent check.

mod common;

use common::{check_motion, known_primitive, known_primitives};
use rand::SeedableRng;
use rand_pcg::Pcg64;
use tensegra_lar::{
    Gait, Limits, MotionFileError, Primitive, PrimitiveError, PrimitiveOptions, RobotAtStart,
    Support, SymmetricRobot, SymmetryError, Turn, TurningGait, check_symmetry, extend_primitive,
    find_cheapest_primitive, find_gait, find_primitive, find_turning_gait, solve_primitive,
    straight_strip, unit_k5,
};

#[test]
fn one_roll_primitives_reproduce_the_literature() {
    for known in known_primitives() {
        let primitive = known.primitive();
        let (cost, ratio) = (primitive.cost(), primitive.length_ratio());
        assert!(
            (cost - known.cost).abs() < 0.005 * known.cost,
            "{}: cost {cost}",
            known.name
        );
        assert!(
            (ratio - known.ratio).abs() < 0.005,
            "{}: ratio {ratio}",
            known.name
        );
        assert!(
            (cost - known.cost_paper).abs() < 0.0005,
            "{}: as printed",
            known.name
        );
        assert!(
            (ratio - known.ratio_paper).abs() < 0.005,
            "{}: as printed",
            known.name
        );

        let (walk, verdict) = check_motion(primitive.symmetric_robot(), primitive.motion());
        assert!(
            verdict.valid,
            "{}: {:?}",
            known.name,
            verdict.faults.first()
        );
        assert!(verdict.worst_violation.unwrap() < 1e-7);
        let clearance = walk.statistics.certified_clearance.unwrap();
        assert!(clearance > 0.075, "{}", known.name);
        assert!(verdict.least_distance.unwrap() >= clearance);
    }
}

#[test]
fn the_cost_per_roll_falls_with_the_number_of_rolls_and_to_the_gait() {
    let options = PrimitiveOptions::default();
    for known in [known_primitive("octahedron"), known_primitive("k5-rolling")] {
        let one = known.primitive();
        let mut last = one.cost();
        for rolls in 2..=3 {
            let (primitive, _) = extend_primitive(&one, &straight_strip(rolls), &options).unwrap();
            let per_roll = primitive.cost() / rolls as f64;
            assert!(per_roll < last);
            assert!(
                (per_roll - known.per_roll[rolls - 1]).abs() < 2e-4,
                "{}",
                known.name
            );
            last = per_roll;
            let (_, verdict) = check_motion(primitive.symmetric_robot(), primitive.motion());
            assert!(
                verdict.valid,
                "{}: {:?}",
                known.name,
                verdict.faults.first()
            );
        }
        let gait = find_gait(&one, &options).unwrap().best;
        assert!(gait.cost() < last && gait.cost() / one.cost() <= known.gait);
        let motion = gait.repeat(3);
        assert_eq!(motion.rolls.len(), 3);
        let (_, verdict) = check_motion(gait_robot(&one), &motion);
        assert!(
            verdict.valid,
            "{}: {:?}",
            known.name,
            verdict.faults.first()
        );
    }
}

#[test]
fn the_cheapest_renaming_is_found() {
    let RobotAtStart { robot, stance } = unit_k5(Limits::default()).unwrap();
    let ways = SymmetricRobot::all(&robot, &stance.coordinates, &stance.support).unwrap();
    assert_eq!(ways.len(), 4);
    let options = PrimitiveOptions::default().with_starts(12).with_kept(1);
    let search = find_cheapest_primitive(&ways, &options, || Pcg64::seed_from_u64(1)).unwrap();
    let known = known_primitive("k5-rolling");
    assert!((search.best.cost() - known.cost).abs() < 0.005 * known.cost);
    assert_eq!(
        search.best.symmetric_robot().relabelling().roles(),
        known.roles
    );
}

#[test]
fn limits_hold_between_configurations_as_well() {
    // Two everting rolls of K5 turn a member so far in one step that the angle at its end would
    // miss its limit half way by 2.5 %.
    let one = known_primitive("k5-everting").primitive();
    let options = PrimitiveOptions::default();
    let (two, _) = extend_primitive(&one, &straight_strip(2), &options).unwrap();
    assert!(two.cost() < 2.0 * 0.82 * one.cost());
    let (_, verdict) = check_motion(two.symmetric_robot(), two.motion());
    assert!(verdict.valid, "{:?}", verdict.faults.first());
}

fn gait_robot(primitive: &Primitive) -> &SymmetricRobot {
    primitive.symmetric_robot()
}

#[test]
fn an_imposed_rigidity_index_holds_along_a_gait() {
    let known = known_primitive("octahedron");
    let least = 0.0025;
    let symmetric = known.symmetric(Limits::default().with_min_rigidity(Some(least)));
    let options = PrimitiveOptions::default();
    let (one, _) = solve_primitive(&symmetric, &known.tip_shape(), &options).unwrap();
    let gait = find_gait(&one, &options).unwrap().best;
    assert!(gait.cost() / one.cost() <= known.gait);
    let robot = symmetric.robot();
    for x in gait.configurations() {
        assert!(robot.extremes(x).rigidity >= least * (1.0 - 1e-6));
    }
}

#[test]
fn the_search_needs_no_tip_shape() {
    let known = known_primitive("k5-rolling");
    let options = PrimitiveOptions::default().with_starts(12).with_kept(1);
    let symmetric = known.symmetric(Limits::default());
    let search = find_primitive(&symmetric, &options, &mut Pcg64::seed_from_u64(1)).unwrap();
    assert!((search.best.cost() - known.cost).abs() < 0.005 * known.cost);
    let again = find_primitive(&symmetric, &options, &mut Pcg64::seed_from_u64(1)).unwrap();
    assert_eq!(search, again);
}

#[test]
fn primitives_are_placed_mirrored_and_stored() {
    let one = known_primitive("octahedron").primitive();
    let symmetric = one.symmetric_robot();
    let turns = [Turn::Left];
    let options = PrimitiveOptions::default();
    let (two, _) = extend_primitive(&one, &turns, &options).unwrap();

    let text = two.to_json();
    let read = Primitive::from_json(&text).unwrap();
    assert_eq!(read.turns(), turns);
    assert_eq!(read.motion(), two.motion());
    let tampered = text.replacen("\"max_length\":4.0", "\"max_length\":1.1", 1);
    assert!(
        Primitive::from_json(&tampered)
            .unwrap_err()
            .to_string()
            .contains("greatest length")
    );

    // Left, and mirrored right, from a stance reached by another roll.
    let (stance, _) = symmetric.roll(&symmetric.start(), 1).unwrap();
    for (mirrored, turn) in [(false, Turn::Left), (true, Turn::Right)] {
        for side in 0..3 {
            let (motion, end) = two.place(&stance, side, mirrored).unwrap();
            assert_eq!(motion.configurations[0].len(), stance.coordinates.len());
            for (a, b) in motion.configurations[0].iter().zip(&stance.coordinates) {
                assert!((a - b).abs() < 1e-9);
            }
            let (_, verdict) = check_motion(symmetric, &motion);
            assert!(
                verdict.valid,
                "{turn:?} {side}: {:?}",
                verdict.faults.first()
            );
            // The end is again a stance to go on from.
            assert!(one.place(&end, 0, false).is_some());
        }
    }
    let crooked = {
        let mut stance = symmetric.start();
        stance.coordinates[11] += 0.1;
        stance
    };
    assert!(one.place(&crooked, 0, false).is_none());
}

/// Text of a gait, changed by `edit`, as `read` refuses it.
fn refusal<G: std::fmt::Debug>(
    read: impl Fn(&str) -> Result<G, MotionFileError>,
    text: &str,
    edit: impl FnOnce(&mut serde_json::Value),
) -> String {
    let mut value: serde_json::Value = serde_json::from_str(text).unwrap();
    edit(&mut value);
    read(&value.to_string()).unwrap_err().to_string()
}

#[test]
fn strip_gaits_are_placed_mirrored_and_stored() {
    let one = known_primitive("k5-rolling").primitive();
    let gait = find_gait(&one, &PrimitiveOptions::default()).unwrap().best;
    let text = gait.to_json();
    let read = Gait::from_json(&text).unwrap();
    assert!((read.cost() - gait.cost()).abs() < 1e-9);
    assert_eq!(Gait::from_json(&read.to_json()).unwrap(), read);
    let symmetric = read.symmetric_robot();
    let (_, verdict) = check_motion(symmetric, &read.repeat(4));
    assert!(verdict.valid, "{:?}", verdict.faults.first());

    // The mirror image walks a strip that begins with a turn to the right, as cheaply.
    let right = symmetric
        .place(read.motion(), &symmetric.start(), symmetric.side(), true)
        .unwrap();
    assert_ne!(right.configurations[1], read.motion().configurations[1]);
    let (_, verdict) = check_motion(symmetric, &right);
    assert!(verdict.valid, "{:?}", verdict.faults.first());

    // Contents are judged, not trusted.
    let point = "/motion/period/5/4/2";
    for (pointer, value, reason) in [
        ("/version", 1.into(), "optimised anew"),
        ("/format", "tensegra-gait".into(), "tensegra-strip-gait"),
        (point, serde_json::Value::Null, "invalid type: null"),
        (point, 1e300.into(), "configuration 5 of the period"),
        (point, (-0.1).into(), "configuration 5"),
        ("/motion/period/5", serde_json::json!([]), "0 nodes"),
        ("/motion/period", serde_json::json!([]), "the period has 0"),
        ("/robot/limits/max_length", 0.9.into(), "greatest length"),
        ("/robot/limits/max_length", (-4.0).into(), "max_length"),
        (
            "/robot/nodes",
            1_000_000_000_000_u64.into(),
            "the start has 5",
        ),
        ("/robot/nodes", (-5).into(), "-5"),
        ("/robot/edges/0/1", 17.into(), "17"),
        ("/robot/support/0", 17.into(), "node 17"),
        ("/robot/side", 3.into(), "side 3"),
        ("/robot/roles", serde_json::json!([0]), "renaming"),
        ("/robot/mass_fractions/0", 1e308.into(), "mass"),
    ] {
        let edit = |file: &mut serde_json::Value| *file.pointer_mut(pointer).unwrap() = value;
        let message = refusal(Gait::from_json, &text, edit);
        assert!(message.contains(reason), "{pointer}: {message}");
    }
    // A huge limit on lengths lets no motion of huge steps through, nor long judging.
    let message = refusal(Gait::from_json, &text, |file| {
        file["robot"]["limits"]["max_length"] = 1e200.into();
        file["motion"]["period"][7][4] = serde_json::json!([1e150, 0.0, 1e150]);
    });
    assert!(message.contains("configuration 7"), "{message}");
    // A period that does not end where the next begins.
    let message = refusal(Gait::from_json, &text, |file| {
        file["motion"]["period"].as_array_mut().unwrap().pop();
    });
    assert!(message.contains("the end of its period"), "{message}");
    // A roll from a configuration whose centre of mass is not above the side.
    let message = refusal(Gait::from_json, &text, |file| {
        let start = file["robot"]["start"].clone();
        let period = file["motion"]["period"].as_array_mut().unwrap();
        period.insert(0, start);
    });
    assert!(message.contains("does not fit"), "{message}");
    let message = refusal(Gait::from_json, &text, |file| {
        file["robot"].as_object_mut().unwrap().remove("limits");
    });
    assert!(message.contains("limits"), "{message}");
}

#[test]
fn gaits_are_placed_mirrored_and_stored() {
    let one = known_primitive("octahedron").primitive();
    let gait = find_turning_gait(&one, &PrimitiveOptions::default()).unwrap();
    let text = gait.to_json();
    let read = TurningGait::from_json(&text).unwrap();
    assert_eq!(read.turn(), gait.turn());
    assert_eq!(
        (read.entry(), read.back(), read.exit()),
        (gait.entry(), gait.back(), gait.exit())
    );

    // The mirror image of what was read turns right, as cheaply.
    let symmetric = read.symmetric_robot();
    let right = symmetric
        .place(read.turn(), &symmetric.start(), symmetric.side(), true)
        .unwrap();
    assert!((read.cost(&right) - read.cost(read.turn())).abs() < 1e-9);
    assert_ne!(right.configurations[1], read.turn().configurations[1]);
    let (_, verdict) = check_motion(symmetric, &right);
    assert!(verdict.valid, "{:?}", verdict.faults.first());

    // Bad files are refused with the reason.
    let half = &text[..text.len() / 2];
    assert!(TurningGait::from_json(half).is_err());
    assert!(
        Primitive::from_json(&text)
            .unwrap_err()
            .to_string()
            .contains("tensegra-gait")
    );
    assert!(TurningGait::from_json(&one.to_json()).is_err());
    let number = "/motion/turn/5/3/2";
    assert!(TurningGait::from_json(&text.replacen("4.0", "NaN", 1)).is_err());
    for (pointer, value, reason) in [
        (number, serde_json::Value::Null, "invalid type: null"),
        (number, 0.9.into(), "configuration"),
        ("/robot/limits/max_length", 1.1.into(), "greatest length"),
        ("/robot/roles/0", 1.into(), "renaming"),
        ("/robot/start/0/0", (-0.8).into(), "equilateral"),
    ] {
        let message = refusal(TurningGait::from_json, &text, |file| {
            *file.pointer_mut(pointer).unwrap() = value
        });
        assert!(message.contains(reason), "{pointer}: {message}");
    }
    let message = refusal(TurningGait::from_json, &text, |file| {
        file["motion"]["turn"].as_array_mut().unwrap().pop();
    });
    assert!(message.contains("the end of its turn"), "{message}");
    let message = refusal(TurningGait::from_json, &text, |file| {
        file["motion"]["entry"].as_array_mut().unwrap().remove(0);
    });
    assert!(message.contains("the start of its entry"), "{message}");
}

#[test]
fn asymmetric_starts_are_refused_by_node() {
    let RobotAtStart { robot, stance } = unit_k5(Limits::default()).unwrap();
    let check = |coordinates: &[f64]| {
        check_symmetry(&robot, coordinates, &stance.support, 1e-6).unwrap_err()
    };
    let mut shifted = stance.coordinates.clone();
    shifted[3 * 4 + 1] += 0.05;
    assert!(matches!(
        check(&shifted),
        SymmetryError::NoPartner { node: 4, .. }
    ));
    let mut wide = stance.coordinates.clone();
    wide[4] -= 0.2;
    assert!(matches!(check(&wide), SymmetryError::NotEquilateral { .. }));
    let heavy = robot
        .clone()
        .with_masses(&[2.0, 1.0, 1.0, 1.0, 1.0])
        .unwrap();
    let error = check_symmetry(&heavy, &stance.coordinates, &stance.support, 1e-6).unwrap_err();
    assert!(
        matches!(error, SymmetryError::MassesDiffer { .. }),
        "{error}"
    );
}

#[test]
fn a_start_beyond_the_limits_is_refused_by_member() {
    let limits = Limits::default().with_max_length(0.9);
    let RobotAtStart { robot, stance } = unit_k5(limits).unwrap();
    let support = Support::new(&robot, &[0, 1, 2]).unwrap();
    let symmetric = &SymmetricRobot::all(&robot, &stance.coordinates, &support).unwrap()[0];
    let error = solve_primitive(symmetric, &stance.coordinates, &PrimitiveOptions::default());
    assert!(matches!(error, Err(PrimitiveError::StartInfeasible { .. })));
}
