use tensegra_lar::*;
fn main() {
    let RobotAtStart { robot, stance } =
        unit_octahedron(Limits::default().with_min_rigidity(Some(0.0025))).unwrap();
    let mut planner = GreedyPlanner::new(
        &robot,
        GreedyOptions::default()
            .with_objective(GreedyObjective::NominalLengths(1.0))
            .with_persistence(Persistence::Stop),
    )
    .unwrap();
    let w = planner.walk(&stance, &[[0.5, 0.3]]).unwrap();
    println!("{:?} {}", w.stop, w.motion.configurations.len());
}
