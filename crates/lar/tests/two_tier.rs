//! Two-tier walks, judged by the independent check.

mod common;

use common::{fixture, known_primitive};
use nalgebra::Point2;
use tensegra_lar::{
    GridGoal, Obstacle, Piece, PlaceError, PlanWalkError, PrimitiveLibrary, PrimitiveOptions,
    SupportedMotion, Turn, TwoTierError, TwoTierPlanner, WalkProblem, plan_two_tier, plan_walk,
};

fn octahedron_library() -> PrimitiveLibrary {
    let one = known_primitive("octahedron").primitive();
    PrimitiveLibrary::new(one)
        .extend(2, &PrimitiveOptions::default())
        .unwrap()
        .0
}

#[test]
fn blocks_are_walked_around_and_smoothing_saves_cost() {
    let problem = WalkProblem::from_toml(&fixture("two-tier-blocks.toml")).unwrap();
    let smoothed = octahedron_library();
    let single = PrimitiveLibrary::new(smoothed.one_roll().clone());
    let mut costs = Vec::new();
    for library in [&smoothed, &single] {
        let planned = plan_two_tier(&problem, library, &|| 0.0).unwrap();
        let verdict = planned.walk.check.as_ref().unwrap();
        assert!(verdict.valid, "{:?}", verdict.faults.first());
        costs.push(planned.walk.statistics.actuation);
        let outcome = planned.two_tier.unwrap();
        assert_eq!(outcome.cells.len(), outcome.motion.rolls.len() + 1);
        assert_eq!(
            outcome
                .pieces
                .iter()
                .map(|piece| piece.rolls())
                .sum::<usize>(),
            outcome.motion.rolls.len()
        );
        assert_eq!(planned.walk.support_polygons().len(), outcome.cells.len());
    }
    assert!(costs[0] < 0.85 * costs[1], "{costs:?}");
}

#[test]
fn every_turn_is_walked_from_the_library() {
    let library = octahedron_library();
    let (_, left) = library.get(&[Turn::Left]).unwrap();
    let (_, right) = library.get(&[Turn::Right]).unwrap();
    assert!(!left && right);
    assert!(library.get(&[Turn::Left, Turn::Left]).is_none());

    // A tour in all directions.
    let start = library.one_roll().symmetric_robot().start();
    let goals = [
        [1.5, 0.0],
        [0.5, 1.6],
        [-1.7, 0.4],
        [-0.6, -1.5],
        [0.9, -0.8],
    ]
    .map(|[x, y]| GridGoal::Point(Point2::new(x, y)));
    let walk = TwoTierPlanner::new(&library).walk(&start, &goals).unwrap();
    let symmetric = library.one_roll().symmetric_robot();
    let (_, verdict) = common::check_motion(symmetric, &walk.motion);
    assert!(verdict.valid, "{:?}", verdict.faults.first());
}

#[test]
fn a_way_back_over_the_same_side_is_no_turn() {
    let library = octahedron_library();
    let symmetric = library.one_roll().symmetric_robot();
    let start = symmetric.start();
    // Two rolls along a strip and the same two back.
    let goals = [[0.6, 0.5], [-0.3, 0.0]].map(|[x, y]| GridGoal::Point(Point2::new(x, y)));
    let walk = TwoTierPlanner::new(&library).walk(&start, &goals).unwrap();
    assert_eq!(walk.cells[0], walk.cells[4], "{:?}", walk.cells);
    assert_eq!(walk.pieces, [Piece::Primitive { rolls: 2 }; 2]);
    let (_, verdict) = common::check_motion(symmetric, &walk.motion);
    assert!(verdict.valid, "{:?}", verdict.faults.first());
}

#[test]
fn a_gait_that_turns_walks_long_ways_at_less_cost() {
    for name in ["octahedron", "k5-rolling"] {
        let one = common::known_primitive(name).primitive();
        let single = PrimitiveLibrary::new(one);
        let library = single
            .clone()
            .with_gait(&PrimitiveOptions::default())
            .unwrap();
        let gait = library.gait().expect(name);
        let symmetric = library.one_roll().symmetric_robot();
        // Turns in all directions, and back the way that it came.
        let goals = [[2.4, 0.0], [0.4, 0.0], [0.0, 2.6], [-2.5, -1.3]]
            .map(|[x, y]| GridGoal::Point(Point2::new(x, y)));
        let start = symmetric.start();
        let walk = TwoTierPlanner::new(&library).walk(&start, &goals).unwrap();
        let back = gait.back().map(|_| Piece::Back);
        for piece in [Piece::Entry, Piece::Turn, Piece::Exit]
            .into_iter()
            .chain(back)
        {
            assert!(walk.pieces.contains(&piece), "{name}: {:?}", walk.pieces);
        }
        let (_, verdict) = common::check_motion(symmetric, &walk.motion);
        assert!(verdict.valid, "{name}: {:?}", verdict.faults.first());
        let stepwise = TwoTierPlanner::new(&single).walk(&start, &goals).unwrap();
        assert_eq!(stepwise.cells, walk.cells);
        let (walked, stepped) = (gait.cost(&walk.motion), gait.cost(&stepwise.motion));
        assert!(walked < 0.8 * stepped, "{name}: {walked} of {stepped}");
        // The product of steps and actuation, the cost (40), is less as well.
        let steps = |motion: &SupportedMotion| motion.configurations.len() as f64 - 1.0;
        let products = [&walk.motion, &stepwise.motion].map(|m| steps(m) * gait.cost(m));
        assert!(products[0] < 0.8 * products[1], "{name}: {products:?}");
    }
}

#[test]
fn walled_in_goals_and_bad_starts_are_refused() {
    let library = octahedron_library();
    let start = library.one_roll().symmetric_robot().start();
    let room = [
        Obstacle::rectangle([3.0, -3.0], [3.2, 3.0]).unwrap(),
        Obstacle::rectangle([9.0, -3.0], [9.2, 3.0]).unwrap(),
        Obstacle::rectangle([3.0, 2.8], [9.2, 3.0]).unwrap(),
        Obstacle::rectangle([3.0, -3.0], [9.2, -2.8]).unwrap(),
    ];
    let planner = TwoTierPlanner::new(&library).with_obstacles(&room, 0.075);
    let goal = |x| [GridGoal::Point(Point2::new(x, 0.0))];
    let error = planner.walk(&start, &goal(6.0)).unwrap_err();
    assert!(
        matches!(error, TwoTierError::Unreachable { index: 0, .. }),
        "{error}"
    );
    let error = planner.walk(&start, &goal(3.1)).unwrap_err();
    assert!(
        matches!(
            error,
            TwoTierError::Place(PlaceError::WaypointInObstacle { obstacle: 0, .. })
        ),
        "{error}"
    );
    for far in [1e30, -2000.0] {
        let error = planner.walk(&start, &goal(far)).unwrap_err();
        assert!(
            matches!(error, TwoTierError::TooFar { index: 0, .. }),
            "{error}"
        );
    }
    let mut crooked = start.clone();
    crooked.coordinates[9] += 0.1;
    let error = planner.walk(&crooked, &goal(1.0)).unwrap_err();
    assert_eq!(error, TwoTierError::StartStance);
}

#[test]
fn a_renaming_that_does_not_exist_is_refused() {
    let text = fixture("two-tier-blocks.toml").replace("[3, 1, 2, 0, 4, 5]", "[0, 1, 2, 3, 4, 5]");
    let problem = WalkProblem::from_toml(&text).unwrap();
    let error = plan_walk(&problem).unwrap_err();
    assert!(matches!(error, PlanWalkError::Roles { .. }), "{error}");
}
