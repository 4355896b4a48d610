//! A sequence of rolls cut into pieces that primitives and gaits walk, at the least cost (40).
//!
//! Dynamic programming over the rolls: before each roll the robot stands in the symmetric stance
//! or, about to roll, in the tipping configuration of the gait. Pieces that would touch an
//! obstacle are not used.
//!
//! The cost is a product, K Σ‖ΔL‖² over the distance with K the number of steps, which dynamic
//! programming cannot minimise. It minimises Σ‖ΔL‖² + λ K instead, which has the same stationary
//! points for λ = Σ‖ΔL‖²/K; λ is found by repetition. Cost: O(rolls × longest primitive) times the
//! placing of a piece, a few times.

use super::PrimitiveLibrary;
use crate::primitive::actuation_cost;
use crate::{Primitive, SequenceRoll, Stance, SupportedMotion, Turn, TurningGait};

/// A part of a two-tier walk.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Piece {
    /// A primitive from stance to stance.
    Primitive {
        /// Its rolls.
        rolls: usize,
    },
    /// From the stance to the tipping configuration of the gait.
    Entry,
    /// A roll of the gait, from one tipping configuration to the next.
    Turn,
    /// A roll of the gait, from one tipping configuration to that of the same side, back again.
    Back,
    /// A roll from the tipping configuration of the gait to the stance.
    Exit,
}

impl Piece {
    /// Number of rolls.
    #[must_use]
    pub fn rolls(self) -> usize {
        match self {
            Self::Primitive { rolls } => rolls,
            Self::Entry => 0,
            Self::Turn | Self::Back | Self::Exit => 1,
        }
    }
}

/// A sequence of rolls with the stances before and after each.
pub(super) struct RollPath<'a> {
    library: &'a PrimitiveLibrary,
    stances: Vec<Stance>,
    rolls: Vec<SequenceRoll>,
    /// The turn between each roll and the next; none where the next goes back over the side that
    /// the last one came over, as at a waypoint from which the way leads back.
    turns: Vec<Option<Turn>>,
}

/// The cheapest way to the stance or the tipping configuration before a roll, by its last piece.
#[derive(Clone, Copy)]
struct Reached {
    cost: f64,
    last: Option<Piece>,
}

/// Most prices of a step that are tried.
const MOST_PRICES: usize = 8;

const UNREACHED: Reached = Reached {
    cost: f64::INFINITY,
    last: None,
};

impl<'a> RollPath<'a> {
    pub(super) fn new(
        library: &'a PrimitiveLibrary,
        stances: Vec<Stance>,
        rolls: Vec<SequenceRoll>,
    ) -> Self {
        let mut path = Self {
            library,
            stances,
            rolls,
            turns: Vec::new(),
        };
        path.turns = (1..path.rolls.len()).map(|k| path.turn(k)).collect();
        path
    }

    /// Whether roll `k` turns left or right after the one before.
    fn turn(&self, k: usize) -> Option<Turn> {
        let (stance, last, next) = (&self.stances[k], &self.rolls[k - 1], &self.rolls[k]);
        if next.lifted == last.landed {
            return None;
        }
        let dimension = self
            .library
            .one_roll()
            .symmetric_robot()
            .robot()
            .dimension();
        let at = |node: usize| dimension.node(&stance.coordinates, node);
        let ahead = at(last.landed) - (at(last.pivots[0]) + at(last.pivots[1])) * 0.5;
        // The pivot that lifts lies on the side away from the turn.
        Some(
            if ahead.cross(&(at(next.lifted) - at(last.landed))).z > 0.0 {
                Turn::Right
            } else {
                Turn::Left
            },
        )
    }

    /// The primitive for `rolls` rolls from roll `first` on, and whether it has to be mirrored.
    fn primitive(&self, first: usize, rolls: usize) -> Option<(&'a Primitive, bool)> {
        let turns = self.turns[first..first + rolls - 1].iter().copied();
        self.library.get(&turns.collect::<Option<Vec<Turn>>>()?)
    }

    /// The motion of a piece before roll `first` as the library has it, and whether it has to be
    /// mirrored.
    fn source(&self, piece: Piece, first: usize) -> Option<(&'a SupportedMotion, bool)> {
        Some(match piece {
            Piece::Primitive { rolls } => {
                let (primitive, mirrored) = self.primitive(first, rolls)?;
                (primitive.motion(), mirrored)
            }
            Piece::Entry => (self.library.gait()?.entry(), false),
            Piece::Turn => {
                let right = self.turns[first]? == Turn::Right;
                (self.library.gait()?.turn(), right)
            }
            Piece::Back => (self.library.gait()?.back()?, false),
            Piece::Exit => (self.library.gait()?.exit(), false),
        })
    }

    /// The motion of a piece before roll `first`, where it is walked.
    fn placed(&self, piece: Piece, first: usize) -> Option<SupportedMotion> {
        let (motion, mirrored) = self.source(piece, first)?;
        let symmetric = self.library.one_roll().symmetric_robot();
        symmetric.place(
            motion,
            &self.stances[first],
            self.rolls[first].side,
            mirrored,
        )
    }

    /// The pieces that walk the rolls at the least cost, and their motion; `is_free`, where there
    /// are obstacles, says whether a motion keeps away from them. None where some roll cannot be
    /// walked.
    pub(super) fn walk(
        &self,
        is_free: Option<&dyn Fn(&SupportedMotion) -> bool>,
    ) -> Option<(Vec<Piece>, SupportedMotion)> {
        let pieces = self.cheapest(is_free)?;
        let mut motion = SupportedMotion {
            configurations: vec![self.stances[0].coordinates.clone()],
            supports: vec![self.stances[0].support.clone()],
            rolls: Vec::new(),
        };
        let mut first = 0;
        for &piece in &pieces {
            motion.append(self.placed(piece, first)?);
            first += piece.rolls();
        }
        Some((pieces, motion))
    }

    /// The pieces of least cost (40) among those that are best for some price of a step.
    fn cheapest(&self, is_free: Option<&dyn Fn(&SupportedMotion) -> bool>) -> Option<Vec<Piece>> {
        let one_roll = self.library.one_roll();
        let mut price = one_roll.cost() / (one_roll.configurations().len() - 1) as f64;
        let mut best: Option<(f64, Vec<Piece>)> = None;
        for _ in 0..MOST_PRICES {
            let pieces = self.cut(price, is_free)?;
            let (actuation, steps) = self.totals(&pieces)?;
            let cost = actuation * steps;
            if best.as_ref().is_some_and(|(least, _)| cost >= *least) {
                break;
            }
            best = Some((cost, pieces));
            if steps == 0.0 {
                break;
            }
            price = actuation / steps;
        }
        best.map(|(_, pieces)| pieces)
    }

    /// Σ‖ΔL‖² and the number of steps of pieces in order.
    fn totals(&self, pieces: &[Piece]) -> Option<(f64, f64)> {
        let symmetric = self.library.one_roll().symmetric_robot();
        let (mut actuation, mut steps, mut first) = (0.0, 0.0, 0);
        for &piece in pieces {
            let (motion, _) = self.source(piece, first)?;
            actuation += actuation_cost(symmetric, &motion.configurations);
            steps += (motion.configurations.len() - 1) as f64;
            first += piece.rolls();
        }
        Some((actuation, steps))
    }

    /// The pieces of the least Σ‖ΔL‖² + `price` × steps.
    fn cut(
        &self,
        price: f64,
        is_free: Option<&dyn Fn(&SupportedMotion) -> bool>,
    ) -> Option<Vec<Piece>> {
        let count = self.rolls.len();
        let gait = self.library.gait();
        let priced = |motion: &SupportedMotion, actuation: f64| {
            actuation + price * (motion.configurations.len() - 1) as f64
        };
        let cost = |motion: Option<&SupportedMotion>| match (gait, motion) {
            (Some(gait), Some(motion)) => priced(motion, gait.cost(motion)),
            _ => f64::INFINITY,
        };
        let entry = cost(gait.map(TurningGait::entry));
        let turn = cost(gait.map(TurningGait::turn));
        let back = cost(gait.and_then(TurningGait::back));
        let exit = cost(gait.map(TurningGait::exit));
        let improve = |reached: &mut Reached, from: Reached, cost: f64, piece, first| {
            let cost = from.cost + cost;
            let free = || {
                is_free.is_none_or(|is_free| self.placed(piece, first).is_some_and(|m| is_free(&m)))
            };
            if cost < reached.cost && free() {
                *reached = Reached {
                    cost,
                    last: Some(piece),
                };
            }
        };
        let start = Reached {
            cost: 0.0,
            last: None,
        };
        let (mut stands, mut tips) = (vec![start], Vec::with_capacity(count));
        for roll in 0..=count {
            if roll > 0 {
                let mut standing = UNREACHED;
                for rolls in 1..=self.library.max_rolls().min(roll) {
                    let first = roll - rolls;
                    if let Some((primitive, _)) = self.primitive(first, rolls) {
                        let (from, piece) = (stands[first], Piece::Primitive { rolls });
                        let cost = priced(primitive.motion(), primitive.cost());
                        improve(&mut standing, from, cost, piece, first);
                    }
                }
                improve(&mut standing, tips[roll - 1], exit, Piece::Exit, roll - 1);
                stands.push(standing);
            }
            if roll < count {
                let mut tipping = UNREACHED;
                improve(&mut tipping, stands[roll], entry, Piece::Entry, roll);
                if roll > 0 {
                    let (cost, piece) = match self.turns[roll - 1] {
                        Some(_) => (turn, Piece::Turn),
                        None => (back, Piece::Back),
                    };
                    improve(&mut tipping, tips[roll - 1], cost, piece, roll - 1);
                }
                tips.push(tipping);
            }
        }

        // Back from the last stance.
        let (mut pieces, mut roll, mut standing) = (Vec::new(), count, true);
        while roll > 0 || !standing {
            let reached = if standing { stands[roll] } else { tips[roll] };
            let piece = reached.last?;
            pieces.push(piece);
            roll -= piece.rolls();
            standing = matches!(piece, Piece::Primitive { .. } | Piece::Entry);
        }
        pieces.reverse();
        Some(pieces)
    }
}
