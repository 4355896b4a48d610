//! Greedy walks of known and random robots, judged by the independent check.

mod common;

use common::fixture;
use rand::SeedableRng;
use rand_pcg::Pcg64;
use tensegra_lar::{
    Dimension, GreedyError, GreedyObjective, GreedyOptions, GreedyPlanner, GreedyStop, GreedyWalk,
    Limits, Persistence, PlaceError, RobotAtStart, Visit, Walk, WalkCheck, WalkCheckOptions,
    WalkContext, WalkFacts, WalkProblem, WalkStatistics, check_walk, plan_walk, random_robot,
    unit_k5, unit_octahedron,
};

fn judge(start: &RobotAtStart, walk: &GreedyWalk, waypoints: &[[f64; 2]]) -> WalkCheck {
    let context = WalkContext {
        name: "test",
        robot: &start.robot,
        node_names: &[],
        waypoints,
        visit: Visit::CentreOfMass(GreedyOptions::default().waypoint_tolerance),
        obstacles: &[],
        obstacle_clearance: 0.0,
    };
    let walk = Walk::new(&context, &walk.motion, WalkStatistics::default());
    check_walk(&WalkFacts::of(&walk), &walk, &WalkCheckOptions::default())
}

#[test]
fn both_robots_walk_with_both_objectives() {
    let limits = Limits::default();
    let k5 = unit_k5(limits.clone()).unwrap();
    let octahedron = unit_octahedron(limits.with_min_rigidity(Some(0.0025))).unwrap();
    let waypoints = [[0.8, 0.5], [-0.3, 0.6]];
    for start in [k5, octahedron] {
        for objective in [
            GreedyObjective::LeastMotion,
            GreedyObjective::NominalLengths(1.0),
        ] {
            let options = GreedyOptions::default().with_objective(objective);
            let mut planner = GreedyPlanner::new(&start.robot, options.clone()).unwrap();
            let walk = planner.walk(&start.stance, &waypoints).unwrap();
            assert_eq!(walk.stop, GreedyStop::Arrived);
            let verdict = judge(&start, &walk, &waypoints);
            assert!(verdict.valid, "{objective:?}: {:?}", verdict.faults.first());
            // A planner that is used again, and another one, walk alike.
            assert_eq!(walk, planner.walk(&start.stance, &waypoints).unwrap());
            let other = GreedyPlanner::new(&start.robot, options).unwrap();
            assert_eq!(walk, { other }.walk(&start.stance, &waypoints).unwrap());
        }
    }
}

#[test]
fn random_robots_walk() {
    let limits = Limits::default().with_min_rigidity(Some(0.001));
    for (seed, nodes) in [(0, 6), (1, 7)] {
        let mut rng = Pcg64::seed_from_u64(seed);
        let start = random_robot(nodes, Dimension::Three, limits.clone(), &mut rng).unwrap();
        let centre = start.robot.centre_of_mass(&start.stance.coordinates);
        let waypoints = [[centre.x + 1.0, centre.y]];
        let mut planner = GreedyPlanner::new(&start.robot, GreedyOptions::default()).unwrap();
        let walk = planner.walk(&start.stance, &waypoints).unwrap();
        assert_eq!(walk.stop, GreedyStop::Arrived, "{nodes} nodes");
        let verdict = judge(&start, &walk, &waypoints);
        assert!(verdict.valid, "{nodes} nodes: {:?}", verdict.faults.first());
    }
}

#[test]
fn a_planar_robot_walks_over_its_nodes() {
    let mut rng = Pcg64::seed_from_u64(8);
    let start = random_robot(6, Dimension::Two, Limits::default(), &mut rng).unwrap();
    let centre = start.robot.centre_of_mass(&start.stance.coordinates);
    let waypoints = [[centre.x + 1.5, 0.0]];
    let mut planner = GreedyPlanner::new(&start.robot, GreedyOptions::default()).unwrap();
    let walk = planner.walk(&start.stance, &waypoints).unwrap();
    assert_eq!(walk.stop, GreedyStop::Arrived);
    assert!(!walk.motion.rolls.is_empty());
    let verdict = judge(&start, &walk, &waypoints);
    assert!(verdict.valid, "{:?}", verdict.faults.first());
}

#[test]
fn a_robot_that_stops_says_what_is_in_the_way() {
    let start = unit_k5(Limits::default()).unwrap();
    let options = GreedyOptions::default().with_persistence(Persistence::Shrink);
    let mut planner = GreedyPlanner::new(&start.robot, options).unwrap();
    let waypoints = [[4.0, 0.5], [-2.0, 3.0], [4.0, 4.0], [0.0, 0.0]];
    let walk = planner.walk(&start.stance, &waypoints).unwrap();
    let GreedyStop::Stuck { waypoint, active } = &walk.stop else {
        panic!("this walk is known to get stuck: {:?}", walk.stop)
    };
    assert_eq!(*waypoint, walk.reached);
    assert!(!active.is_empty());
    // What was walked until then is valid.
    assert!(judge(&start, &walk, &waypoints[..walk.reached]).valid);
}

#[test]
fn obstacles_are_walked_around() {
    let problem = WalkProblem::from_toml(&fixture("greedy-blocks.toml")).unwrap();
    let planned = plan_walk(&problem).unwrap();
    let verdict = planned.walk.check.as_ref().unwrap();
    assert!(
        verdict.valid,
        "{}: {:?}",
        planned.walk.statistics.stop,
        verdict.faults.first()
    );
    let aside = planned
        .walk
        .centre_of_mass_track()
        .iter()
        .map(|p| p.y.abs())
        .fold(0.0, f64::max);
    assert!(aside > 0.8, "the way leads around the block");
}

#[test]
fn bad_starts_and_waypoints_are_refused() {
    let start = unit_k5(Limits::default()).unwrap();
    let mut planner = GreedyPlanner::new(&start.robot, GreedyOptions::default()).unwrap();
    let error = planner.walk(&start.stance, &[[0.0, f64::NAN]]).unwrap_err();
    assert!(matches!(
        error,
        GreedyError::Place(PlaceError::Waypoint { index: 0, .. })
    ));
    let mut lifted = start.stance.clone();
    lifted
        .coordinates
        .chunks_exact_mut(3)
        .for_each(|p| p[2] += 0.1);
    let error = planner.walk(&lifted, &[[0.0, 0.0]]).unwrap_err();
    assert!(matches!(error, GreedyError::Support(_)));
    let mut long = start.stance.clone();
    long.coordinates[14] = 6.0;
    let error = planner.walk(&long, &[[0.0, 0.0]]).unwrap_err();
    assert!(
        matches!(error, GreedyError::StartInfeasible { .. }),
        "{error}"
    );
}
