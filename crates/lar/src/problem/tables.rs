//! The tables of a problem file, as they stand there.

use serde::Deserialize;
use serde::de::{Deserializer, SeqAccess, Visitor};
use toml::Spanned;

use super::WalkPlanner;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct File {
    #[serde(default)]
    pub name: String,
    pub planner: WalkPlanner,
    #[serde(default)]
    pub seed: u64,
    pub waypoints: Option<Spanned<Vec<Spanned<Vec<f64>>>>>,
    pub goal: Option<Spanned<Region>>,
    pub robot: Spanned<RobotTable>,
    pub limits: Option<Spanned<LimitsTable>>,
    pub greedy: Option<Spanned<GreedyTable>>,
    pub two_tier: Option<Spanned<TwoTierTable>>,
    #[serde(default)]
    pub obstacles: Vec<Spanned<ObstacleTable>>,
    pub obstacle_clearance: Option<Spanned<f64>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Region {
    pub centre: Spanned<Vec<f64>>,
    pub radius: Spanned<f64>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RobotTable {
    pub preset: Option<Spanned<Preset>>,
    pub centre_of_mass: Option<Spanned<Vec<f64>>>,
    pub nodes: Option<Spanned<Vec<Spanned<Vec<f64>>>>>,
    #[serde(alias = "edges")]
    pub members: Option<Spanned<MemberList>>,
    pub support: Option<Spanned<Vec<usize>>>,
    pub names: Option<Spanned<Vec<String>>>,
    pub masses: Option<Spanned<Vec<f64>>>,
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Preset {
    K5,
    Octahedron,
}

#[derive(Debug)]
pub(super) enum MemberList {
    List(Vec<Spanned<[usize; 2]>>),
    Complete,
}

impl<'de> Deserialize<'de> for MemberList {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Either;

        impl<'de> Visitor<'de> for Either {
            type Value = MemberList;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("a list of pairs of node numbers, or \"complete\"")
            }

            fn visit_str<E: serde::de::Error>(self, word: &str) -> Result<MemberList, E> {
                match word {
                    "complete" => Ok(MemberList::Complete),
                    other => Err(E::invalid_value(serde::de::Unexpected::Str(other), &self)),
                }
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<MemberList, A::Error> {
                let mut members = Vec::new();
                while let Some(member) = list.next_element()? {
                    members.push(member);
                }
                Ok(MemberList::List(members))
            }
        }

        deserializer.deserialize_any(Either)
    }
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct LimitsTable {
    pub min_length: Option<Spanned<f64>>,
    pub max_length: Option<Spanned<f64>>,
    pub min_distance: Option<Spanned<f64>>,
    pub min_angle_degrees: Option<Spanned<f64>>,
    pub max_move: Option<Spanned<f64>>,
    pub min_rigidity: Option<Spanned<f64>>,
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum ObjectiveName {
    LeastMotion,
    NominalLengths,
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum PersistenceName {
    Stop,
    Shrink,
    Recover,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct GreedyTable {
    pub objective: Option<ObjectiveName>,
    pub nominal_length: Option<Spanned<f64>>,
    pub step: Option<Spanned<f64>>,
    pub waypoint_tolerance: Option<Spanned<f64>>,
    pub persistence: Option<PersistenceName>,
    pub max_configurations: Option<Spanned<usize>>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TwoTierTable {
    pub rolls: Option<Spanned<usize>>,
    pub gait: Option<bool>,
    pub roles: Option<Spanned<Vec<usize>>>,
    pub steps: Option<Spanned<usize>>,
    pub starts: Option<Spanned<usize>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ObstacleTable {
    pub corners: Option<Spanned<Vec<[f64; 2]>>>,
    pub min: Option<[f64; 2]>,
    pub max: Option<[f64; 2]>,
}
