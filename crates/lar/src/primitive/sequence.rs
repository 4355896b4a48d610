//! Sequences of rolls over the triangular grid, each from one symmetric configuration to the next.
//!
//! The roll over one side of the canonical start fixes all others: the isometry that takes that
//! side to the side rolled over carries the start, the end and the renaming of nodes along.

use super::SupportedMotion;
use crate::primitive::symmetry::{Relabelling, check_symmetry, match_nodes, relabellings};
use crate::{GroundIsometry, Robot, Support, SymmetryError};

/// Which of the two free sides the next roll goes over, seen in the direction of the last roll.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Turn {
    /// The side to the left.
    Left,
    /// The side to the right.
    Right,
}

impl Turn {
    /// The other turn.
    #[must_use]
    pub fn mirrored(self) -> Self {
        match self {
            Self::Left => Self::Right,
            Self::Right => Self::Left,
        }
    }
}

/// A robot in a symmetric configuration together with how it rolls from there: the basis of
/// motion primitives.
#[derive(Debug, Clone, PartialEq)]
pub struct SymmetricRobot {
    robot: Robot,
    start: Vec<f64>,
    support: Support,
    side: usize,
    relabelling: Relabelling,
}

/// A symmetric configuration of a [`SymmetricRobot`] somewhere on the grid.
#[derive(Debug, Clone, PartialEq)]
pub struct Stance {
    /// Coordinates of the nodes.
    pub coordinates: Vec<f64>,
    /// The support.
    pub support: Support,
}

/// One roll of a sequence.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SequenceRoll {
    /// Index of the side of the support rolled over.
    pub side: usize,
    /// The nodes of that side.
    pub pivots: [usize; 2],
    /// The node that lifts off.
    pub lifted: usize,
    /// The node that comes down.
    pub landed: usize,
}

/// Nodes within this distance of each other, relative to the side of the support, coincide.
const MATCH_TOLERANCE: f64 = 1e-6;

impl SymmetricRobot {
    /// A robot that rolls from `start`, standing on `support`, over the given side with the given
    /// renaming of nodes (one of [`relabellings`](crate::relabellings)).
    ///
    /// # Errors
    /// A start without the symmetry of section V.A.
    pub fn new(
        robot: Robot,
        start: &[f64],
        support: Support,
        side: usize,
        relabelling: Relabelling,
    ) -> Result<Self, SymmetryError> {
        check_symmetry(&robot, start, &support, MATCH_TOLERANCE)?;
        Ok(Self {
            robot,
            start: start.to_vec(),
            support,
            side,
            relabelling,
        })
    }

    /// All ways in which a robot can roll from `start` over side 0 of `support`, one for each
    /// renaming of nodes.
    ///
    /// # Errors
    /// A start without the symmetry of section V.A.
    pub fn all(
        robot: &Robot,
        start: &[f64],
        support: &Support,
    ) -> Result<Vec<Self>, SymmetryError> {
        let found = relabellings(robot, start, support, 0, MATCH_TOLERANCE)?;
        Ok(found
            .into_iter()
            .map(|relabelling| Self {
                robot: robot.clone(),
                start: start.to_vec(),
                support: support.clone(),
                side: 0,
                relabelling,
            })
            .collect())
    }

    /// The robot.
    #[must_use]
    pub fn robot(&self) -> &Robot {
        &self.robot
    }

    /// The renaming of nodes in a roll.
    #[must_use]
    pub fn relabelling(&self) -> &Relabelling {
        &self.relabelling
    }

    /// The side of the start's support that the canonical roll goes over.
    #[must_use]
    pub fn side(&self) -> usize {
        self.side
    }

    /// The canonical starting stance.
    #[must_use]
    pub fn start(&self) -> Stance {
        Stance {
            coordinates: self.start.clone(),
            support: self.support.clone(),
        }
    }

    /// The roll of a stance over a side of its support. None when the stance is not a symmetric
    /// configuration of this robot.
    #[must_use]
    pub fn roll(&self, stance: &Stance, side: usize) -> Option<(Stance, SequenceRoll)> {
        let map = self.placement(stance, side, false)?;
        let roles = match_nodes(
            &self.robot,
            &self.start,
            &stance.coordinates,
            &map,
            self.tolerance(),
        )
        .ok()?;
        let end = self
            .relabelling
            .end(&self.robot, &self.start, &self.support, self.side);
        let dimension = self.robot.dimension();
        let mut coordinates = stance.coordinates.clone();
        for (node, &role) in roles.iter().enumerate() {
            dimension.set_node(
                &mut coordinates,
                node,
                &map.apply(&dimension.node(&end, role)),
            );
        }
        let landed = roles
            .iter()
            .position(|&role| role == self.relabelling.landing())?;
        let pivots = stance.support.side_nodes(side);
        let lifted = stance.support.nodes()[side];
        let nodes: Vec<usize> = stance
            .support
            .nodes()
            .iter()
            .map(|&node| if node == lifted { landed } else { node })
            .collect();
        let support = Support::new(&self.robot, &nodes).ok()?;
        let roll = SequenceRoll {
            side,
            pivots: [pivots[0], pivots[1]],
            lifted,
            landed,
        };
        Some((
            Stance {
                coordinates,
                support,
            },
            roll,
        ))
    }

    /// The isometry that takes the canonical start to `stance`, its side to `side`.
    pub(crate) fn placement(
        &self,
        stance: &Stance,
        side: usize,
        mirrored: bool,
    ) -> Option<GroundIsometry> {
        let ends = |coordinates: &[f64], support: &Support, side: usize| {
            let line = support.side_line(self.robot.dimension(), coordinates, side);
            let [a, b] = [1, 2].map(|k| {
                self.robot
                    .dimension()
                    .node(coordinates, support.nodes()[(side + k) % 3])
            });
            // Ordered along the axis, so that outward goes to outward without a mirror image.
            if (b - a).dot(&line.axis) > 0.0 {
                [a, b]
            } else {
                [b, a]
            }
        };
        let from = ends(&self.start, &self.support, self.side);
        let mut to = ends(&stance.coordinates, &stance.support, side);
        if mirrored {
            to.swap(0, 1);
        }
        GroundIsometry::between_segments(from, to, mirrored, self.tolerance())
    }

    /// A motion that starts from the canonical start, or is relative to it, carried to another
    /// stance, its first roll over `side`; `mirrored` swaps left and right. None when `stance` is
    /// not a symmetric stance of this robot.
    #[must_use]
    pub fn place(
        &self,
        motion: &SupportedMotion,
        stance: &Stance,
        side: usize,
        mirrored: bool,
    ) -> Option<SupportedMotion> {
        let map = self.placement(stance, side, mirrored)?;
        let roles = self.roles_at(stance, &map)?;
        let dimension = self.robot.dimension();
        let place = |source: &Vec<f64>| {
            let mut placed = source.clone();
            for (node, &role) in roles.iter().enumerate() {
                let image = map.apply(&dimension.node(source, role));
                dimension.set_node(&mut placed, node, &image);
            }
            placed
        };
        let node_of = |role: usize| roles.iter().position(|&r| r == role);
        let rename = |support: &Support| {
            let nodes: Option<Vec<usize>> =
                support.nodes().iter().map(|&role| node_of(role)).collect();
            Support::new(&self.robot, &nodes?).ok()
        };
        Some(SupportedMotion {
            configurations: motion.configurations.iter().map(place).collect(),
            supports: motion
                .supports
                .iter()
                .map(rename)
                .collect::<Option<Vec<_>>>()?,
            rolls: motion.rolls.clone(),
        })
    }

    /// Names of nodes of the canonical start at the places of `stance` seen through `map`.
    pub(crate) fn roles_at(&self, stance: &Stance, map: &GroundIsometry) -> Option<Vec<usize>> {
        match_nodes(
            &self.robot,
            &self.start,
            &stance.coordinates,
            map,
            self.tolerance(),
        )
        .ok()
    }

    fn tolerance(&self) -> f64 {
        let node = |k: usize| {
            self.robot
                .dimension()
                .node(&self.start, self.support.nodes()[k])
        };
        MATCH_TOLERANCE * (node(1) - node(0)).norm()
    }

    /// The stances and rolls of a sequence that starts at the canonical start with a roll over its
    /// side and then turns as told: `turns.len()` + 1 rolls. None when some roll does not end in a
    /// symmetric stance.
    #[must_use]
    pub fn sequence(&self, turns: &[Turn]) -> Option<(Vec<Stance>, Vec<SequenceRoll>)> {
        let mut stances = vec![self.start()];
        let mut rolls: Vec<SequenceRoll> = Vec::with_capacity(turns.len() + 1);
        for step in 0..=turns.len() {
            let stance = &stances[step];
            let side = match step.checked_sub(1) {
                None => self.side,
                Some(turn) => next_side(&self.robot, stance, &rolls[turn], turns[turn]),
            };
            let (next, roll) = self.roll(stance, side)?;
            stances.push(next);
            rolls.push(roll);
        }
        Some((stances, rolls))
    }
}

/// The turns of a straight strip of `rolls` triangles: left, right, left, …
#[must_use]
pub fn straight_strip(rolls: usize) -> Vec<Turn> {
    (1..rolls)
        .map(|k| if k % 2 == 1 { Turn::Left } else { Turn::Right })
        .collect()
}

/// The side that a turn after `last` leads over.
pub(super) fn next_side(robot: &Robot, stance: &Stance, last: &SequenceRoll, turn: Turn) -> usize {
    let dimension = robot.dimension();
    let at = |node: usize| dimension.node(&stance.coordinates, node);
    let ahead = at(last.landed) - (at(last.pivots[0]) + at(last.pivots[1])) * 0.5;
    // The side to the left is opposite the pivot to the right.
    let to_the_left = |node: usize| ahead.cross(&(at(node) - at(last.landed))).z > 0.0;
    let opposite = match turn {
        Turn::Left => last.pivots.iter().find(|&&node| !to_the_left(node)),
        Turn::Right => last.pivots.iter().find(|&&node| to_the_left(node)),
    };
    let opposite = opposite.copied().unwrap_or(last.pivots[0]);
    stance
        .support
        .nodes()
        .iter()
        .position(|&node| node == opposite)
        .unwrap_or(0)
}
