//! Robots and motions that several tests share.
#![allow(dead_code)] // each test file uses a part

use serde::Deserialize;
use tensegra_lar::{
    Limits, Primitive, PrimitiveOptions, RobotAtStart, SupportedMotion, SymmetricRobot, Visit,
    Walk, WalkCheck, WalkCheckOptions, WalkContext, WalkFacts, WalkStatistics, check_walk,
    solve_primitive, unit_k5, unit_octahedron,
};

/// Text of a file of `fixtures/lar`.
pub fn fixture(name: &str) -> String {
    let path = format!("{}/../../fixtures/lar/{name}", env!("CARGO_MANIFEST_DIR"));
    std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// One entry of `fixtures/lar/primitives.toml`.
#[derive(Debug, Clone, Deserialize)]
pub struct KnownPrimitive {
    pub name: String,
    pub robot: String,
    pub roles: Vec<usize>,
    pub tip: Vec<(usize, f64, f64, f64)>,
    pub cost: f64,
    pub ratio: f64,
    pub cost_paper: f64,
    pub ratio_paper: f64,
    pub gait: f64,
    pub gait_paper: f64,
    pub per_roll: Vec<f64>,
}

#[derive(Deserialize)]
struct KnownPrimitives {
    primitive: Vec<KnownPrimitive>,
}

pub fn known_primitives() -> Vec<KnownPrimitive> {
    toml::from_str::<KnownPrimitives>(&fixture("primitives.toml"))
        .unwrap()
        .primitive
}

pub fn known_primitive(name: &str) -> KnownPrimitive {
    known_primitives()
        .into_iter()
        .find(|known| known.name == name)
        .unwrap()
}

impl KnownPrimitive {
    pub fn start(&self, limits: Limits) -> RobotAtStart {
        match self.robot.as_str() {
            "k5" => unit_k5(limits).unwrap(),
            _ => unit_octahedron(limits).unwrap(),
        }
    }

    pub fn symmetric(&self, limits: Limits) -> SymmetricRobot {
        let RobotAtStart { robot, stance } = self.start(limits);
        SymmetricRobot::all(&robot, &stance.coordinates, &stance.support)
            .unwrap()
            .into_iter()
            .find(|symmetric| symmetric.relabelling().roles() == self.roles)
            .unwrap()
    }

    pub fn tip_shape(&self) -> Vec<f64> {
        let mut tip = self.start(Limits::default()).stance.coordinates;
        for &(node, x, y, z) in &self.tip {
            tip[3 * node..3 * node + 3].copy_from_slice(&[x, y, z]);
        }
        tip
    }

    pub fn primitive(&self) -> Primitive {
        let options = PrimitiveOptions::default();
        solve_primitive(
            &self.symmetric(Limits::default()),
            &self.tip_shape(),
            &options,
        )
        .unwrap()
        .0
    }
}

/// The independent check of a motion without waypoints.
pub fn check_motion(symmetric: &SymmetricRobot, motion: &SupportedMotion) -> (Walk, WalkCheck) {
    let context = WalkContext {
        name: "test",
        robot: symmetric.robot(),
        node_names: &[],
        waypoints: &[],
        visit: Visit::Support,
        obstacles: &[],
        obstacle_clearance: 0.0,
    };
    let walk = Walk::new(&context, motion, WalkStatistics::default());
    let verdict = check_walk(&WalkFacts::of(&walk), &walk, &WalkCheckOptions::default());
    (walk, verdict)
}
