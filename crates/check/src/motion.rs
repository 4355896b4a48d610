//! Clearance between samples, proven.
//!
//! The motion between two neighbouring samples is defined by the samples alone: node coordinates
//! and forces interpolated linearly, and equilibrium restored ([`crate::restore`]). For each
//! interval the equilibrium half-way is solved for, and every part of a body is taken to stray from
//! the straight motion of its control points by at most σ, a stated multiple of the deviation found
//! half-way. Then, for each pair of parts,
//!
//! 1. with clearances c₀, c₁ at the ends and D the largest motion of any point of one part relative
//!    to any point of the other, the clearance is never below (c₀ + c₁ − D) / 2 − σ: at the share t
//!    of the straight motion it is at least c₀ − t D and at least c₁ − (1 − t) D;
//! 2. separating planes prove a clearance for the straight motion, of which σ is taken off;
//! 3. where both fall short, the interval is halved at the equilibrium found, to a stated depth.
//!
//! σ falls by four with every halving, D by two. A halving that does not bring the longer half well
//! below the whole means that the samples do not belong to one motion; it is followed to the same
//! depth.

use tensegra_model::{Configuration, Path};

use crate::{
    CheckOptions,
    bodies::{Bodies, Placement},
    report::{Check, Ledger, Location, Subject},
    restore::Restorer,
    statics::Statics,
};

/// Most that the longer half of an interval may be of the whole.
const LONGER_HALF: f64 = 0.6;
/// Shares of the clearance at the samples that planes are asked to prove, one after the other.
const PLANE_SHARES: [f64; 3] = [0.9, 0.5, 0.0];
/// Intervals shorter than this, in the solver's unknowns, are too short to tell halves apart.
const SHORT: f64 = 1e-6;

/// A configuration, where it puts the bodies, and the clearances of the pairs there: lower bounds
/// where the bodies are far from each other.
struct Sample {
    configuration: Configuration,
    placement: Placement,
    clearances: Vec<f64>,
}

impl Sample {
    fn empty() -> Self {
        let configuration = Configuration {
            positions: Vec::new(),
            lengths: Vec::new(),
            rest_lengths: Vec::new(),
            forces: Vec::new(),
        };
        Self {
            configuration,
            placement: Placement::default(),
            clearances: Vec::new(),
        }
    }
}

/// A stretch of the path within one interval.
#[derive(Clone, Copy)]
struct Span {
    index: usize,
    from: f64,
    to: f64,
    depth: u32,
}

impl Span {
    fn middle(&self) -> Location {
        Location::Interval {
            index: self.index,
            fraction: 0.5 * (self.from + self.to),
        }
    }

    fn halves(&self) -> [Self; 2] {
        let half = 0.5 * (self.from + self.to);
        let depth = self.depth + 1;
        [
            Self {
                to: half,
                depth,
                ..*self
            },
            Self {
                from: half,
                depth,
                ..*self
            },
        ]
    }
}

pub(crate) struct Motion<'a> {
    statics: &'a Statics<'a>,
    options: &'a CheckOptions,
    bodies: &'a Bodies<'a>,
    restorer: Restorer<'a>,
    /// Samples to write midpoints into, one for each level of halving.
    pool: Vec<Sample>,
}

impl<'a> Motion<'a> {
    pub(crate) fn new(statics: &'a Statics<'a>, bodies: &'a Bodies<'a>) -> Self {
        let restorer = Restorer::new(&statics.problem.structure, statics.size);
        Self {
            statics,
            options: statics.options,
            bodies,
            restorer,
            pool: Vec::new(),
        }
    }

    /// Judges clearance at all samples that are usable, and between those that follow each other.
    /// `displacements` holds the largest displacement of a node in each interval.
    pub(crate) fn judge(
        &mut self,
        path: &Path,
        usable: &[bool],
        displacements: &[f64],
        ledger: &mut Ledger,
    ) {
        let pairs: Vec<usize> = (0..self.bodies.pairs.len()).collect();
        let (mut before, mut after) = (Sample::empty(), Sample::empty());
        for (index, configuration) in path.configurations.iter().enumerate() {
            if !usable[index] {
                continue;
            }
            let neighbours =
                &displacements[index.saturating_sub(1)..displacements.len().min(index + 1)];
            let travel = neighbours.iter().fold(0.0, |most: f64, &one| most.max(one));
            after.configuration.clone_from(configuration);
            self.sample(
                &mut after,
                travel,
                Location::Configuration { index },
                ledger,
            );
            if index > 0 && usable[index - 1] {
                let span = Span {
                    index: index - 1,
                    from: 0.0,
                    to: 1.0,
                    depth: 0,
                };
                self.span(span, &before, &after, &pairs, ledger);
            }
            std::mem::swap(&mut before, &mut after);
        }
    }

    /// Places the bodies of a sample and judges their clearances. Pairs so far apart that neither
    /// they nor the motion by `travel` on either side can set the smallest clearance are not
    /// measured.
    fn sample(&self, sample: &mut Sample, travel: f64, location: Location, ledger: &mut Ledger) {
        let bodies = self.bodies;
        bodies.place(&sample.configuration.positions, &mut sample.placement);
        sample.clearances.clear();
        for pair in &bodies.pairs {
            let smallest = ledger.worst(Check::Clearance).unwrap_or(f64::INFINITY);
            let reach = smallest.max(self.options.min_clearance) + 2.0 * travel;
            let bound = bodies.bound(pair, &sample.placement);
            if bound > reach {
                sample.clearances.push(bound);
                continue;
            }
            let clearance = bodies.clearance(pair, &sample.placement);
            let (limit, subject) = (self.options.min_clearance, Subject::Pair(pair.bodies));
            ledger.judge(Check::Clearance, clearance, limit, location, subject);
            sample.clearances.push(clearance);
        }
    }

    /// Judges the motion between two samples for some pairs; returns the pairs that fail.
    fn span(
        &mut self,
        span: Span,
        start: &Sample,
        end: &Sample,
        pairs: &[usize],
        ledger: &mut Ledger,
    ) -> Vec<usize> {
        let mut middle = self.pool.pop().unwrap_or_else(Sample::empty);
        let failed = self.span_with(span, start, &mut middle, end, pairs, ledger);
        self.pool.push(middle);
        failed
    }

    fn span_with(
        &mut self,
        span: Span,
        start: &Sample,
        middle: &mut Sample,
        end: &Sample,
        pairs: &[usize],
        ledger: &mut Ledger,
    ) -> Vec<usize> {
        let location = span.middle();
        let residual = self.restorer.restore(
            &start.configuration,
            &end.configuration,
            &mut middle.configuration,
        );
        ledger.statistics.midpoints += 1;
        ledger.statistics.depth = ledger.statistics.depth.max(span.depth);
        let limit = self.options.equation_tolerance;
        if !ledger.judge(
            Check::EquilibriumBetween,
            residual,
            limit,
            location,
            Subject::None,
        ) {
            return pairs.to_vec();
        }
        self.statics
            .judge_between(&middle.configuration, location, ledger);
        self.bodies
            .place(&middle.configuration.positions, &mut middle.placement);

        let last = span.depth >= self.options.max_depth;
        let continuous = self.continuous(span, start, middle, end, last, ledger);
        let mut failed = Vec::new();
        let mut open = Vec::new();
        for &pair in pairs {
            let [c0, c1] = [start.clearances[pair], end.clearances[pair]];
            let required = self.options.min_clearance;
            if !(c0 >= required && c1 >= required) {
                // Failed at a sample.
                failed.push(pair);
                continue;
            }
            let smallest = ledger
                .worst(Check::ClearanceBetween)
                .unwrap_or(f64::INFINITY);
            let proven = self.prove(pair, start, middle, end, required, smallest);
            let subject = Subject::Pair(self.bodies.pairs[pair].bodies);
            if proven >= required || last {
                let check = Check::ClearanceBetween;
                if !ledger.judge(check, proven, required, location, subject) {
                    failed.push(pair);
                }
            } else {
                open.push(pair);
            }
        }
        if open.is_empty() && (continuous || last) {
            return failed;
        }

        middle.clearances.clear();
        middle.clearances.resize(self.bodies.pairs.len(), f64::NAN);
        open.retain(|&pair| {
            let pair_data = &self.bodies.pairs[pair];
            let clearance = self.bodies.clearance(pair_data, &middle.placement);
            middle.clearances[pair] = clearance;
            let (required, subject) = (self.options.min_clearance, Subject::Pair(pair_data.bodies));
            let free = clearance >= required;
            if !free {
                ledger.judge(
                    Check::ClearanceBetween,
                    clearance,
                    required,
                    location,
                    subject,
                );
                failed.push(pair);
            }
            free
        });
        if open.is_empty() && continuous {
            return failed;
        }
        let [first, second] = span.halves();
        let lost = self.span(first, start, middle, &open, ledger);
        open.retain(|pair| !lost.contains(pair));
        failed.extend(lost);
        failed.extend(self.span(second, middle, end, &open, ledger));
        failed
    }

    /// Whether halving brings the longer half well below the whole; judged at the end of halving.
    fn continuous(
        &self,
        span: Span,
        start: &Sample,
        middle: &Sample,
        end: &Sample,
        last: bool,
        ledger: &mut Ledger,
    ) -> bool {
        let length =
            |a: &Sample, b: &Sample| self.restorer.distance(&a.configuration, &b.configuration);
        let whole = length(start, end);
        if whole < SHORT {
            return true;
        }
        let ratio = length(start, middle).max(length(middle, end)) / whole;
        let continuous = ratio <= LONGER_HALF;
        if continuous || last {
            ledger.judge(
                Check::Continuity,
                ratio,
                LONGER_HALF,
                span.middle(),
                Subject::None,
            );
        }
        continuous
    }

    /// The larger of the two lower bounds on the clearance of a pair during the motion. The second,
    /// which costs more, is left out where the first will do: it is neither below what is required
    /// nor below the smallest clearance proven so far.
    fn prove(
        &self,
        pair: usize,
        start: &Sample,
        middle: &Sample,
        end: &Sample,
        required: f64,
        smallest: f64,
    ) -> f64 {
        let at = [&start.placement, &middle.placement, &end.placement];
        let data = &self.bodies.pairs[pair];
        let [c0, c1] = [start.clearances[pair], end.clearances[pair]];
        let motion = self.bodies.relative_motion(data, at[0], at[2]);
        let factor = self.options.slack_factor;
        let bound = 0.5 * (c0 + c1 - motion) - factor * self.bodies.deviation(data, at);
        if bound >= required && bound >= smallest {
            return bound;
        }
        // A proof finds little more than it is asked for: ask for much first.
        let room = c0.min(c1).min(smallest) - required;
        PLANE_SHARES
            .iter()
            .find_map(|share| {
                self.bodies
                    .certificate(data, at, factor, required + share * room)
            })
            .map_or(bound, |proven| proven.max(bound))
    }
}
