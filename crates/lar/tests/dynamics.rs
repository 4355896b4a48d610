//! The dynamic check: standing still, following a gait, and the effect of speed.

mod common;

use common::{known_primitive, known_primitives};
use nalgebra::Point2;
use tensegra_lar::{
    DynamicsError, DynamicsOptions, GridGoal, Limits, Piece, PrimitiveLibrary, PrimitiveOptions,
    RobotAtStart, SupportedMotion, TwoTierPlanner, simulate_motion, unit_k5,
};

#[test]
fn a_robot_that_stands_still_sags_by_the_weight_over_the_gains() {
    let RobotAtStart { robot, stance } = unit_k5(Limits::default()).unwrap();
    let motion = SupportedMotion {
        configurations: vec![stance.coordinates.clone(); 2],
        supports: vec![stance.support.clone()],
        rolls: Vec::new(),
    };
    let sag = |gain: f64| {
        let options = DynamicsOptions::default()
            .with_proportional(gain)
            .with_integral(0.0);
        simulate_motion(&robot, &motion, 3.0, &options).unwrap()
    };
    let (soft, stiff) = (sag(4000.0), sag(8000.0));
    assert!(soft.contacts.is_empty() && stiff.contacts.is_empty());
    let last = |report: &tensegra_lar::DynamicsReport| report.errors[report.errors.len() - 1].1;
    assert!((last(&soft) / last(&stiff) - 2.0).abs() < 0.05);
    // The integral part removes the sag in time.
    let options = DynamicsOptions::default().with_integral(20_000.0);
    let held = simulate_motion(&robot, &motion, 6.0, &options).unwrap();
    assert!(last(&held) < 0.01 * last(&soft));
}

#[test]
fn gaits_of_six_seconds_are_followed_within_a_centimetre() {
    for known in known_primitives() {
        let primitive = known.primitive();
        let robot = primitive.symmetric_robot().robot();
        let options = DynamicsOptions::default();
        let report = simulate_motion(robot, primitive.motion(), 6.0, &options).unwrap();
        assert!(
            report.mean_error < 0.01,
            "{}: {}",
            known.name,
            report.mean_error
        );
        // It stands where the plan ends.
        let end = &primitive.configurations()[primitive.configurations().len() - 1];
        for (a, b) in report.final_coordinates.iter().zip(end) {
            assert!((a - b).abs() < 0.03, "{}: {a} {b}", known.name);
        }
    }
}

#[test]
fn walks_by_the_everting_gait_that_turns_are_followed() {
    let one = known_primitive("k5-everting").primitive();
    let symmetric = one.symmetric_robot().clone();
    let library = PrimitiveLibrary::new(one)
        .with_gait(&PrimitiveOptions::default())
        .unwrap();
    // The centre of mass falls no farther than the bound, and the roll is symmetric.
    let turn = library.gait().unwrap().turn();
    let robot = symmetric.robot();
    let centre = [0, 1].map(|k| robot.centre_of_mass(&turn.configurations[k]));
    assert!(centre[0].z - centre[1].z < 0.1 + 1e-6);
    assert!(centre.iter().all(|centre| centre.y.abs() < 1e-6));

    // Turns to both sides, and back over a side.
    let goals = [[1.6, 0.9], [1.0, 0.2]].map(|[x, y]| GridGoal::Point(Point2::new(x, y)));
    let planner = TwoTierPlanner::new(&library);
    let walk = planner.walk(&symmetric.start(), &goals).unwrap();
    for piece in [Piece::Entry, Piece::Turn, Piece::Exit] {
        assert!(walk.pieces.contains(&piece), "{:?}", walk.pieces);
    }
    let rolls = walk.motion.rolls.len() as f64;
    for seconds in [6.0, 10.0] {
        let options = DynamicsOptions::default();
        let report = simulate_motion(robot, &walk.motion, seconds * rolls, &options).unwrap();
        assert!(!report.lost);
        assert!(
            report.mean_error < 0.01,
            "{seconds} s: {}",
            report.mean_error
        );
    }
}

#[test]
fn bad_input_and_divergence_are_reported() {
    let primitive = known_primitive("octahedron").primitive();
    let robot = primitive.symmetric_robot().robot();
    let run = |duration, options: &DynamicsOptions| {
        simulate_motion(robot, primitive.motion(), duration, options).unwrap_err()
    };
    let options = DynamicsOptions::default();
    assert!(matches!(
        run(0.0, &options),
        DynamicsError::Option {
            name: "duration",
            ..
        }
    ));
    let error = run(1.0, &options.clone().with_node_mass(-1.0));
    assert!(matches!(
        error,
        DynamicsError::Option {
            name: "node_mass",
            ..
        }
    ));
    let error = run(1.0, &options.with_derivative(1e5));
    assert!(matches!(error, DynamicsError::Diverged { .. }), "{error}");
}
