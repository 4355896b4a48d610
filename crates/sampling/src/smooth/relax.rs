//! The iterations on one mesh: sequential quadratic programming with a trust
//! region.

use tensegra_atlas::{ImplicitManifold, Validity, Workspace};
use tensegra_optim::{BlockTridiagonalQp, BlockTridiagonalQpSolver};

use super::{
    SmoothProgress, SmootherOptions,
    chain::{Chain, TOLERANCE},
    curvature::{Curvature, negative_part},
    rows::{Finder, Rows, long_step},
};
use crate::walk::interpolate;

/// Price of violations at the start, over the length of the path: a low one lets steps go
/// farther along rows that bend.
const FIRST_PRICE: f64 = 8.0;
/// Largest price, over the length of the path.
const LAST_PRICE: f64 = 1e5;
/// A step is taken when it achieves this fraction of what the model promises.
const LEAST_GAIN: f64 = 0.05;
/// Tolerance of the programmes' solutions.
const QP_TOLERANCE: f64 = 1e-6;
/// Smallest trust radius.
const SMALLEST_RADIUS: f64 = 1e-6;
/// Shares of the negative curvature that are tried, the largest that leaves the
/// model convex is taken.
const NEGATIVE_SHARES: [f64; 4] = [1.0, 0.6, 0.3, 0.0];
/// How often a programme is solved with more and more of its rows.
const SOLVES: usize = 3;
/// What a row left out of the programme may be violated by.
const OVERLOOKED: f64 = 1e-7;
/// How often a step is tried again with rows found where it ended.
const CUTTING_ROUNDS: usize = 4;
/// A step inside the trust region that gains less than the first of these parts of what it
/// promised, but not less than the second, has gone too far: along it the merit is much like
/// a parabola, and is evaluated once more at its lowest point.
const OVERSHOT: [f64; 2] = [0.5, -2.0];

/// Iterations end where a step inside the trust region promises less than this multiple of
/// the optimality asked for, as a fraction of the energy.
const VAIN: f64 = 1e-2;
/// Iterations end after so many steps that have lowered the energy by less than this fraction
/// altogether. On plateaus that lead to lower ground it has been several times as much.
const STALE: usize = 15;
const STALE_GAIN: f64 = 1e-3;

/// A row about the chain's points that was found elsewhere.
struct Cut {
    block: usize,
    coefficients: Vec<f64>,
    above: f64,
}

/// What iterations on one mesh reached.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Relaxed {
    pub(super) length: f64,
    /// Reduced gradient of the energy over the length.
    pub(super) optimality: f64,
    /// Largest violation of an inequality, margins left aside.
    pub(super) violation: f64,
    /// Whether the gradient, or what another step promises, is small enough.
    pub(super) converged: bool,
}

impl Relaxed {
    /// What an observer is told.
    pub(super) fn progress(&self, iterations: usize, seconds: f64) -> SmoothProgress {
        SmoothProgress {
            seconds,
            iterations,
            length: self.length,
            optimality: self.optimality,
        }
    }
}

/// The iterations, with their memory.
pub(super) struct Relaxation<'a, M: ?Sized, V: Validity> {
    manifold: &'a M,
    validity: &'a V,
    finder: Finder<'a, M, V>,
    largest_radius: f64,
    price: f64,
    iterations: usize,
    /// What part of the programme's solution the last step tried was.
    scale: f64,
    qp: BlockTridiagonalQp,
    solver: BlockTridiagonalQpSolver,
    rows: Rows,
    trial_rows: Rows,
    /// Rows that steps from the same points have met.
    cuts: Vec<Cut>,
    /// Which rows those of the programme are; none for a cut.
    included: Vec<Option<usize>>,
    /// Whether each of the rows is in the programme.
    is_included: Vec<bool>,
    /// Gradient of the energy at each inner point, m values each.
    pulls: Vec<f64>,
    /// Forces of active inequalities on each inner point, m values each; empty
    /// while they are not known.
    pushes: Vec<f64>,
    curvature: Curvature,
    /// Second derivatives of the Lagrangian at each inner point, k × k each, and
    /// their negative parts.
    curvatures: Vec<f64>,
    negative: Vec<f64>,
    trial: Vec<Vec<f64>>,
    /// Tangent coordinates of one point.
    step: Vec<f64>,
    residual: Vec<f64>,
    work: Workspace,
}

impl<'a, M: ImplicitManifold + ?Sized, V: Validity> Relaxation<'a, M, V> {
    pub(super) fn new(
        manifold: &'a M,
        validity: &'a V,
        options: &SmootherOptions,
        chain: &Chain,
        price: Option<f64>,
    ) -> Self {
        let ends = [&chain.points[0], &chain.points[chain.segments()]].map(Vec::as_slice);
        Self {
            manifold,
            validity,
            finder: Finder::new(
                manifold,
                validity,
                options.contact_margin,
                options.limit_margin,
                ends,
            ),
            largest_radius: options.trust_radius,
            price: price.unwrap_or_else(|| FIRST_PRICE * chain.length()),
            iterations: 0,
            scale: 1.0,
            qp: BlockTridiagonalQp::default(),
            solver: BlockTridiagonalQpSolver::new().tolerance(QP_TOLERANCE),
            rows: Rows::default(),
            trial_rows: Rows::default(),
            cuts: Vec::new(),
            included: Vec::new(),
            is_included: Vec::new(),
            pulls: Vec::new(),
            pushes: Vec::new(),
            curvature: Curvature::default(),
            curvatures: Vec::new(),
            negative: Vec::new(),
            trial: Vec::new(),
            step: Vec::new(),
            residual: Vec::new(),
            work: Workspace::default(),
        }
    }

    pub(super) fn iterations(&self) -> usize {
        self.iterations
    }

    /// The price of violations that has been found to suffice.
    pub(super) fn price(&self) -> f64 {
        self.price
    }

    pub(super) fn widen_margin(&mut self) {
        self.finder.widen_margin();
    }

    /// Largest violation of an inequality at the chain's points and at quarters of its
    /// segments, margins left aside.
    pub(super) fn depth(&mut self, chain: &Chain) -> f64 {
        let mut chain = chain.clone();
        chain.fractions.fill(3);
        self.finder.find(&chain, &chain.points, 0.0, &mut self.rows);
        self.rows.violation()
    }

    /// The segments of the chain that are not clear.
    pub(super) fn blocked(&mut self, chain: &Chain) -> Vec<usize> {
        (0..chain.segments())
            .filter(|&segment| {
                let [a, b] = [&chain.points[segment], &chain.points[segment + 1]];
                let chart = chain.chart_of_segment(segment);
                let (manifold, work) = (self.manifold, &mut self.work);
                !self.validity.is_clear(a, b, &mut |s, y| {
                    interpolate(a, b, s, y);
                    chart.retract(manifold, y, TOLERANCE, work).is_ok()
                })
            })
            .collect()
    }

    /// Moves the points until the reduced gradient over the length is at most
    /// `goal`, with `radius` as first trust radius. `None` when `report` cancels.
    pub(super) fn relax(
        &mut self,
        chain: &mut Chain,
        [goal, mut radius]: [f64; 2],
        max_iterations: usize,
        report: &mut dyn FnMut(&Relaxed, usize) -> bool,
    ) -> Option<Relaxed> {
        // Gradients of contacts are about unit vectors at most.
        let long = long_step(chain.dimension);
        let mut found = long * radius;
        self.finder
            .find(chain, &chain.points, found, &mut self.rows);
        let mut relaxed = Relaxed {
            length: chain.length(),
            optimality: f64::INFINITY,
            violation: self.rows.violation(),
            converged: false,
        };
        self.trial.clone_from(&chain.points);
        let mut stalled = 0;
        let mut refused = 0;
        // Energies after the steps taken without violation.
        let mut energies = Vec::new();
        self.cuts.clear();
        self.pushes.clear();
        for _ in 0..max_iterations {
            if chain.center(self.manifold).is_err() {
                break;
            }
            self.iterations += 1;
            if found < long * radius {
                found = long * radius;
                self.finder
                    .find(chain, &chain.points, found, &mut self.rows);
            }
            if refused == 0 {
                self.assemble(chain, radius);
                self.add_curvature(chain);
            } else {
                // The same programme, in a smaller box.
                self.qp.set_box(-radius, radius);
                self.push_cuts();
            }
            let shortfall = self.rows.shortfall();
            if !self.solve(chain) {
                break;
            }
            // A price that buys no way out of violations is too low.
            while self.price < LAST_PRICE * relaxed.length
                && self.left_violated() > 0.1 * shortfall + 1e-9
                && (self.largest_move() < 0.99 * radius || stalled >= 3)
            {
                stalled = 0;
                self.price *= 4.0;
                self.qp.set_prices(self.price);
                if self.solver.solve(&self.qp).is_err() {
                    return Some(relaxed);
                }
            }
            self.find_pushes(chain);
            relaxed.optimality = self.optimality(chain) / relaxed.length;
            relaxed.violation = self.rows.violation();
            if !report(&relaxed, self.iterations) {
                return None;
            }
            let moved = self.largest_move();
            if relaxed.optimality <= goal && relaxed.violation == 0.0 {
                relaxed.converged = true;
                break;
            }
            let energy = chain.energy(&chain.points);
            let penalty = self.rows.penalty();
            let before = energy + self.price * penalty;
            let left = self.left_violated();
            let by_energy = self.price * left - self.qp.objective(self.solver.solution());
            let promised = by_energy + self.price * (penalty - left).max(0.0);
            let at_edge = moved > 0.99 * radius;
            // The promise is of the second order in the reduced gradient; at the edge it
            // may be small because the box is.
            let least = goal * if at_edge { goal } else { VAIN };
            let vain = promised < least * energy && relaxed.violation == 0.0;
            relaxed.converged = vain && !at_edge;
            if vain || !(promised > 1e-12 * before) {
                break;
            }
            let next_radius = if at_edge {
                (2.0 * radius).min(self.largest_radius)
            } else {
                (2.0 * moved).clamp(0.25 * radius, radius)
            };
            let reach = long * next_radius;
            let mut after = self.merit_after(chain, 1.0, reach);
            let [enough, too_little] = OVERSHOT;
            if let Some(merit) = after {
                let gain = (before - merit) / promised;
                if !at_edge && gain < enough && gain > too_little {
                    after = self.merit_after(chain, 1.0 / (2.0 - gain), reach);
                }
            }
            let gain = after.map_or(f64::NEG_INFINITY, |merit| (before - merit) / promised);
            if gain > LEAST_GAIN {
                std::mem::swap(&mut chain.points, &mut self.trial);
                std::mem::swap(&mut self.rows, &mut self.trial_rows);
                found = long * next_radius;
                relaxed.length = chain.length();
                relaxed.violation = self.rows.violation();
                let stays = self.rows.shortfall() > 0.7 * shortfall;
                stalled = if stays { stalled + 1 } else { 0 };
                radius = if gain < 0.25 {
                    0.5 * moved
                } else {
                    next_radius
                };
                radius = radius.max(SMALLEST_RADIUS);
                refused = 0;
                self.cuts.clear();
                if relaxed.violation > 0.0 {
                    energies.clear();
                } else {
                    let energy = chain.energy(&chain.points);
                    energies.push(energy);
                    let before = energies.len().checked_sub(STALE + 1).map(|i| energies[i]);
                    if before.is_some_and(|before| energy > (1.0 - STALE_GAIN) * before) {
                        break;
                    }
                }
            } else {
                // Other places than those constrained came close: constrain them.
                refused += 1;
                if after.is_some() && refused <= CUTTING_ROUNDS {
                    self.find_cuts(chain);
                    // They may be all that was missing.
                    radius = match refused {
                        1 => moved,
                        _ if gain > -1.0 => 0.8 * moved,
                        _ => 0.5 * moved,
                    };
                } else {
                    radius = 0.4 * moved;
                }
                if radius < SMALLEST_RADIUS {
                    break;
                }
            }
        }
        Some(relaxed)
    }

    /// The quadratic programme about the chain's points.
    fn assemble(&mut self, chain: &Chain, radius: f64) {
        let k = chain.dimension;
        let qp = &mut self.qp;
        qp.reset(chain.charts.len(), k);
        qp.set_box(-radius, radius);
        let m = chain.points[0].len();
        self.pulls.resize(m * chain.charts.len(), 0.0);
        for (block, (chart, force)) in chain
            .charts
            .iter()
            .zip(self.pulls.chunks_exact_mut(m))
            .enumerate()
        {
            let [before, here, after] =
                [block, block + 1, block + 2].map(|i| chain.points[i].as_slice());
            let [left, right] = [1.0 / chain.widths[block], 1.0 / chain.widths[block + 1]];
            for i in 0..m {
                force[i] = left * (here[i] - before[i]) - right * (after[i] - here[i]);
            }
            let diagonal = qp.diagonal_mut(block);
            for j in 0..k {
                diagonal[j * k + j] = left + right;
            }
            let gradient = qp.gradient_mut(block);
            for (j, g) in gradient.iter_mut().enumerate() {
                *g = dot(chart.tangent(j), force);
            }
            if let Some(next) = chain.charts.get(block + 1) {
                let coupling = qp.coupling_mut(block);
                for i in 0..k {
                    for j in 0..k {
                        coupling[i * k + j] = -right * dot(next.tangent(i), chart.tangent(j));
                    }
                }
            }
        }
        let price = self.price;
        self.included.clear();
        self.is_included.clear();
        self.is_included.resize(self.rows.len(), false);
        self.rows.for_each_tangent(chain, radius, |index, row| {
            self.included.push(Some(index));
            self.is_included[index] = true;
            qp.push_row(row.block, row.coefficients, -row.above, price);
        });
        self.cuts.clear();
    }

    /// Adds the rows to the programme that the last step tried has met.
    fn push_cuts(&mut self) {
        for cut in self.cuts.drain(..) {
            self.included.push(None);
            self.qp
                .push_row(cut.block, &cut.coefficients, -cut.above, self.price);
        }
    }

    /// Solves the programme, and again with the rows left out that the solution
    /// violates. `false` where it cannot be solved.
    fn solve(&mut self, chain: &Chain) -> bool {
        for _ in 0..SOLVES {
            if self.solver.solve(&self.qp).is_err() {
                return false;
            }
            let (t, k, price) = (self.solver.solution(), chain.dimension, self.price);
            let (qp, included, is_included) =
                (&mut self.qp, &mut self.included, &mut self.is_included);
            let before = included.len();
            self.rows.for_each(chain, |index, row| {
                if !is_included[index]
                    && row.above + dot(row.coefficients, &t[row.block * k..]) < -OVERLOOKED
                {
                    is_included[index] = true;
                    included.push(Some(index));
                    qp.push_row(row.block, row.coefficients, -row.above, price);
                }
            });
            if self.included.len() == before {
                return true;
            }
        }
        self.solver.solve(&self.qp).is_ok()
    }

    /// Adds second derivatives to the programme, as much of the negative ones as
    /// leaves it convex.
    fn add_curvature(&mut self, chain: &Chain) {
        let (m, k) = (chain.points[0].len(), chain.dimension);
        if self.pushes.len() != self.pulls.len() || k == 0 {
            return;
        }
        let square = k * k;
        self.curvatures.resize(square * chain.charts.len(), 0.0);
        for ((chart, matrix), (pull, push)) in chain
            .charts
            .iter()
            .zip(self.curvatures.chunks_exact_mut(square))
            .zip(
                self.pulls
                    .chunks_exact_mut(m)
                    .zip(self.pushes.chunks_exact(m)),
            )
        {
            for (w, push) in pull.iter_mut().zip(push) {
                *w -= push;
            }
            self.curvature.at(self.manifold, chart, pull, matrix);
        }
        let mut share = 0.0;
        self.qp.add_to_diagonal(1.0, &self.curvatures);
        for (i, wanted) in NEGATIVE_SHARES.into_iter().enumerate() {
            if i == 0 {
                share = wanted;
            } else {
                if i == 1 {
                    self.negative.resize(self.curvatures.len(), 0.0);
                    for (matrix, negative) in self
                        .curvatures
                        .chunks_exact(square)
                        .zip(self.negative.chunks_exact_mut(square))
                    {
                        negative_part(matrix, k, negative);
                    }
                }
                self.qp.add_to_diagonal(wanted - share, &self.negative);
                share = wanted;
            }
            if self.solver.is_convex(&self.qp) {
                break;
            }
        }
    }

    /// The forces of active inequalities on each point.
    fn find_pushes(&mut self, chain: &Chain) {
        let m = chain.points[0].len();
        self.pushes.clear();
        self.pushes.resize(m * chain.charts.len(), 0.0);
        for (row, &multiplier) in self.included.iter().zip(self.solver.row_multipliers()) {
            if let Some(row) = *row {
                self.rows.add_gradient(row, multiplier, &mut self.pushes, m);
            }
        }
    }

    /// Keeps the rows that fall short at the end of a refused step, extrapolated
    /// back to the chain's points.
    fn find_cuts(&mut self, chain: &Chain) {
        let (cuts, t) = (&mut self.cuts, self.solver.solution());
        let (k, scale) = (chain.dimension, self.scale);
        self.trial_rows.for_each_short(chain, |row| {
            let moved = scale * dot(row.coefficients, &t[row.block * k..]);
            cuts.push(Cut {
                block: row.block,
                coefficients: row.coefficients.to_vec(),
                // Where it holds now it must not seem violated.
                above: (row.above - moved).max(0.0),
            });
        });
    }

    /// What the solution leaves violated.
    fn left_violated(&self) -> f64 {
        self.qp.priced_shortfall(self.solver.solution())
    }

    fn largest_move(&self) -> f64 {
        self.solver
            .solution()
            .iter()
            .fold(0.0, |most: f64, t| most.max(t.abs()))
    }

    /// Largest entry of the gradient of the energy less that of the rows, in
    /// tangent coordinates.
    fn optimality(&mut self, chain: &Chain) -> f64 {
        self.residual.clear();
        for block in 0..chain.charts.len() {
            self.residual.extend_from_slice(self.qp.gradient_mut(block));
        }
        self.qp
            .subtract_rows(self.solver.row_multipliers(), &mut self.residual);
        self.residual
            .iter()
            .fold(0.0, |most: f64, r| most.max(r.abs()))
    }

    /// The energy plus the priced violations after a part of the step that is the
    /// programme's solution: moves the points into `trial` and finds their rows within
    /// `reach`. `None` where a point leaves the reach of its chart.
    fn merit_after(&mut self, chain: &Chain, scale: f64, reach: f64) -> Option<f64> {
        let k = chain.dimension;
        self.scale = scale;
        self.trial.clone_from(&chain.points);
        let solution = self.solver.solution().chunks_exact(k.max(1));
        for ((chart, t), x) in chain.charts.iter().zip(solution).zip(&mut self.trial[1..]) {
            self.step.clear();
            self.step.extend(t.iter().map(|t| scale * t));
            chart
                .exp(self.manifold, &self.step, x, TOLERANCE, &mut self.work)
                .ok()?;
        }
        self.finder
            .find(chain, &self.trial, reach, &mut self.trial_rows);
        Some(chain.energy(&self.trial) + self.price * self.trial_rows.penalty())
    }
}

/// Inner product with several sums, so that it is vectorised.
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 4];
    let (a4, b4) = (a.chunks_exact(4), b.chunks_exact(4));
    let rest = a4.remainder().iter().zip(b4.remainder());
    let rest: f64 = rest.map(|(a, b)| a * b).sum();
    for (a, b) in a4.zip(b4) {
        for i in 0..4 {
            sums[i] += a[i] * b[i];
        }
    }
    (sums[0] + sums[2]) + (sums[1] + sums[3]) + rest
}
