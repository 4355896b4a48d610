//! AtlasRRT: rapidly-exploring random trees on an implicit manifold, over an
//! atlas that is built as the trees grow (Jaillet and Porta 2013; Porta and
//! Hernández-Juan 2016, section 4.2).
//!
//! A sample is drawn in the tangent space of a random chart; the tree grows
//! from its nearest node towards it in steps of δ, and each productive branch
//! is followed by one attempt to connect to the other tree.
//!
//! Branches slide along limits and contacts. A step that would violate some is
//! replaced by the nearest step, in tangent coordinates, that respects them to
//! first order (a small quadratic programme), projected, tested and corrected up
//! to three times. Limits that a branch slides along are remembered from step
//! to step. A branch ends when less than a third of the wanted step is left, or
//! when it hardly comes nearer to its target.

use cpu_time::ThreadTime;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64;
use tensegra_atlas::{
    Atlas, ImplicitManifold, ManifoldError, Obstruction, SparseRow, Validity, Workspace, dimension,
};

use crate::{
    options::{PlannerOptions, SampleRadius},
    plan::{Failure, Observer, Plan, PlanError, Progress, Statistics},
    slide::{Constraint, NearestStep},
    tree::{Tree, squared_distance},
};

/// A sliding step is worth taking when at least this fraction of the wanted
/// step is left.
const LEAST_STEP: f64 = 0.3;
/// Draws of a sample before one outside its chart's domain is taken.
const DRAWS: usize = 20;
/// Corrections of a sliding step.
const CORRECTIONS: usize = 3;
/// A step is halved down to this fraction of δ before its branch stops.
const SHORTEST_STEP: f64 = 0.1;
/// Nodes of a branch that are tried as origin of a connection.
const CONNECTION_CANDIDATES: usize = 6;
/// A tree this many times larger than the other one waits.
const IMBALANCE: usize = 4;
/// Each step must lower the squared distance to the target by this multiple of
/// the squared step.
const NEARER: f64 = 0.1;
/// A neighbouring chart takes over when its centre is this much nearer.
const NEARER_CHART: f64 = 0.7;
/// Extensions in a row without a new node after which planning is given up.
const FRUITLESS: usize = 200_000;
/// Residual of the points of the returned path.
const FINAL_TOLERANCE: f64 = 1e-12;
/// Constraints may be violated by rounding.
const ROUNDING: f64 = 1e-10;

/// The planner: a manifold, a validity test and options.
#[derive(Clone, Debug)]
pub struct AtlasRrt<'a, M: ?Sized, V> {
    manifold: &'a M,
    validity: &'a V,
    options: PlannerOptions,
    max_displacement: f64,
}

impl<'a, M: ImplicitManifold + ?Sized, V: Validity> AtlasRrt<'a, M, V> {
    /// A planner with the given options.
    pub fn new(manifold: &'a M, validity: &'a V, options: PlannerOptions) -> Self {
        Self {
            manifold,
            validity,
            options,
            max_displacement: f64::INFINITY,
        }
    }

    /// Bounds the displacement (see [`Validity::displacement`]) between
    /// neighbouring points of the path returned.
    pub fn max_displacement(mut self, displacement: f64) -> Self {
        self.max_displacement = displacement;
        self
    }

    /// Plans from `start` to `goal`, points of the manifold.
    ///
    /// # Errors
    /// [`PlanError`]: an endpoint is not valid, or no path was found within the
    /// limits of the options.
    pub fn plan(
        &self,
        start: &[f64],
        goal: &[f64],
        observer: &mut dyn Observer,
    ) -> Result<Plan, PlanError> {
        let clock = ThreadTime::now();
        for (which, x) in [("start", start), ("goal", goal)] {
            self.validate(which, x)?;
        }
        let k = dimension(self.manifold, start);
        let at_goal = dimension(self.manifold, goal);
        if k != at_goal {
            let error = ManifoldError::DimensionChanges {
                first: k,
                second: at_goal,
            };
            return Err(PlanError::Manifold {
                which: "goal",
                error,
            });
        }
        let mut search = Search::new(self, k, start, goal)?;
        let outcome = search.run(&clock, observer);
        search.finish(outcome, &clock)
    }

    /// Whether an endpoint is within all bounds and limits, and valid.
    fn validate(&self, which: &'static str, x: &[f64]) -> Result<(), PlanError> {
        let manifold = self.manifold;
        let invalid = |reason: String| Err(PlanError::InvalidEndpoint { which, reason });
        for (i, (&value, (&lo, &hi))) in x
            .iter()
            .zip(manifold.lower_bounds().iter().zip(manifold.upper_bounds()))
            .enumerate()
        {
            if !value.is_finite() || value < lo - ROUNDING || value > hi + ROUNDING {
                return invalid(format!(
                    "{} is {value:.6}, outside [{lo:.6}, {hi:.6}]",
                    manifold.variable_name(i)
                ));
            }
        }
        let mut values = vec![0.0; manifold.limit_count()];
        manifold.limits(x, &mut values);
        if let Some((i, value)) = values.iter().enumerate().find(|(_, v)| **v < -ROUNDING) {
            return invalid(format!(
                "{} is exceeded by {:.3e}",
                manifold.limit_name(i),
                -value
            ));
        }
        if !self.validity.is_valid(x) {
            return invalid("it is in collision".to_owned());
        }
        Ok(())
    }
}

/// Why a branch stops.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stop {
    Reached,
    Limit,
    Contact,
    Blocked,
    NoProgress,
    Correction,
    Projection,
    Singular,
}

/// What became of a step.
enum Step {
    /// The point and its tangent coordinates are in `next`.
    Accepted,
    /// The chart does not represent the manifold well enough there.
    NeedsChart,
    Stopped(Stop),
}

/// What an extension added.
struct Branch {
    first: usize,
    last: usize,
    reached: bool,
}

/// A point with its tangent coordinates.
#[derive(Clone, Debug, Default)]
struct Place {
    x: Vec<f64>,
    t: Vec<f64>,
}

struct Search<'p, M: ?Sized, V: Validity> {
    planner: &'p AtlasRrt<'p, M, V>,
    atlas: Atlas,
    trees: Vec<Tree>,
    /// Charts that represent nodes of each tree.
    charts: Vec<Vec<usize>>,
    /// Sampling radius of each chart, when adaptive.
    radii: Vec<f64>,
    goal: Vec<f64>,
    goal_chart: usize,
    random: Pcg64,
    statistics: Statistics,
    work: Workspace,
    rows: NearestStep,
    // Scratch of a step.
    here: Place,
    next: Place,
    memory: V::Memory,
    next_memory: V::Memory,
    target_t: Vec<f64>,
    wanted: Vec<f64>,
    step: Vec<f64>,
    limits: Vec<f64>,
    violated: Vec<Constraint>,
    contacts: Vec<usize>,
    gradient: SparseRow,
    tangent_gradient: Vec<f64>,
    /// Changes of the normal offset over the last two steps, newest first.
    normal_changes: [Vec<f64>; 2],
    normal_history: usize,
}

impl<'p, M: ImplicitManifold + ?Sized, V: Validity> Search<'p, M, V> {
    fn new(
        planner: &'p AtlasRrt<'p, M, V>,
        k: usize,
        start: &[f64],
        goal: &[f64],
    ) -> Result<Self, PlanError> {
        let mut atlas = Atlas::new(k, planner.options.domain);
        let mut work = Workspace::default();
        let mut add = |which, x: &[f64]| {
            atlas
                .add(planner.manifold, x, &mut work)
                .map_err(|error| PlanError::Manifold { which, error })
        };
        let start_chart = add("start", start)?;
        let goal_chart = if start == goal {
            start_chart
        } else {
            add("goal", goal)?
        };
        let mut trees = vec![Tree::new(start, start_chart, start)];
        let mut charts = vec![vec![start_chart]];
        if planner.options.two_trees {
            trees.push(Tree::new(goal, goal_chart, goal));
            charts.push(vec![goal_chart]);
        }
        let m = planner.manifold.ambient_dimension();
        let place = || Place {
            x: vec![0.0; m],
            t: vec![0.0; k],
        };
        Ok(Self {
            planner,
            atlas,
            trees,
            charts,
            radii: Vec::new(),
            goal: goal.to_vec(),
            goal_chart,
            random: Pcg64::seed_from_u64(planner.options.seed),
            statistics: Statistics::default(),
            work,
            rows: NearestStep::new(k),
            here: place(),
            next: place(),
            memory: planner.validity.memory(),
            next_memory: planner.validity.memory(),
            target_t: vec![0.0; k],
            wanted: vec![0.0; k],
            step: vec![0.0; k],
            limits: vec![0.0; planner.manifold.limit_count()],
            violated: Vec::new(),
            contacts: Vec::new(),
            gradient: SparseRow::default(),
            tangent_gradient: vec![0.0; k],
            normal_changes: [vec![0.0; m], vec![0.0; m]],
            normal_history: 0,
        })
    }

    /// Grows trees until they meet. Returns the nodes where they do: one of the
    /// first tree and, with two trees, one of the second.
    fn run(
        &mut self,
        clock: &ThreadTime,
        observer: &mut dyn Observer,
    ) -> Result<(usize, usize), Failure> {
        let options = &self.planner.options;
        // The straight connection first: easy problems need no search.
        let goal = self.goal.clone();
        let branch = self.extend(0, 0, &goal, true);
        if branch.reached {
            return Ok((branch.last, 0));
        }
        let mut target = vec![0.0; goal.len()];
        let mut turn = 0;
        let mut fruitless = 0;
        for iteration in 0_usize.. {
            if iteration % 16 == 0 {
                let progress = Progress {
                    seconds: clock.elapsed().as_secs_f64(),
                    charts: self.atlas.len(),
                    nodes: self.trees.iter().map(Tree::len).sum(),
                };
                if progress.seconds > options.time_limit {
                    return Err(Failure::Time);
                }
                if progress.charts > options.max_charts {
                    return Err(Failure::Charts);
                }
                if progress.nodes > options.max_nodes {
                    return Err(Failure::Nodes);
                }
                if !observer.progress(&progress) {
                    return Err(Failure::Cancelled);
                }
            }
            if fruitless > FRUITLESS {
                return Err(Failure::NoProgress);
            }
            turn = self.next_tree(turn);
            let other = 1 - turn;
            let biased = self.random.random::<f64>() < options.goal_bias;
            let chart = if biased {
                if options.two_trees {
                    let node = self.random.random_range(0..self.trees[other].len());
                    target.copy_from_slice(self.trees[other].point(node));
                } else {
                    target.copy_from_slice(&self.goal);
                }
                None
            } else {
                Some(self.sample(turn, &mut target))
            };
            let (near, _) = self.trees[turn].nearest(&target);
            let branch = self.extend(turn, near, &target, false);
            if let Some(chart) = chart {
                self.adapt_radius(chart, branch.reached);
            }
            if branch.first == branch.last {
                fruitless += 1;
                continue;
            }
            fruitless = 0;
            if let Some(meeting) = self.connect(turn, &branch, &mut target) {
                return Ok(meeting);
            }
        }
        Err(Failure::NoProgress)
    }

    /// Alternates, but lets a much larger tree wait.
    fn next_tree(&self, last: usize) -> usize {
        if self.trees.len() == 1 {
            return 0;
        }
        let next = 1 - last;
        if self.trees[next].len() > IMBALANCE * self.trees[last].len() {
            last
        } else {
            next
        }
    }

    /// Draws a point near the atlas of a tree into `x`; returns the chart.
    fn sample(&mut self, tree: usize, x: &mut [f64]) -> usize {
        let k = self.atlas.dimension();
        let mut chart = 0;
        for _ in 0..DRAWS {
            chart = self.charts[tree][self.random.random_range(0..self.charts[tree].len())];
            let radius = match self.planner.options.sample_radius {
                SampleRadius::Fixed(radius) => radius,
                SampleRadius::Adaptive { largest } => {
                    self.radii.resize(self.atlas.len(), largest);
                    self.radii[chart]
                }
            };
            let mut square = 0.0;
            for t in &mut self.wanted {
                *t = self.random.sample(StandardNormal);
                square += *t * *t;
            }
            let length = radius * self.random.random::<f64>().powf(1.0 / k as f64);
            let scale = length / square.sqrt().max(f64::MIN_POSITIVE);
            self.wanted.iter_mut().for_each(|t| *t *= scale);
            if self.atlas.inside_cuts(chart, &self.wanted) {
                break;
            }
        }
        self.atlas.chart(chart).tangent_point(&self.wanted, x);
        chart
    }

    fn adapt_radius(&mut self, chart: usize, reached: bool) {
        if let SampleRadius::Adaptive { largest } = self.planner.options.sample_radius {
            let radius = &mut self.radii[chart];
            let smallest = self.planner.options.domain.radius.min(largest);
            *radius = (*radius * if reached { 1.2 } else { 0.8 }).clamp(smallest, largest);
        }
    }

    /// Tries to connect a new branch to the other tree (or to the goal).
    fn connect(
        &mut self,
        tree: usize,
        branch: &Branch,
        target: &mut Vec<f64>,
    ) -> Option<(usize, usize)> {
        let count = branch.last - branch.first;
        let candidates = count.min(CONNECTION_CANDIDATES);
        let mut best = (f64::INFINITY, 0, 0);
        for i in 0..candidates {
            // The last nodes of the branch and evenly spaced ones before.
            let node = branch.last - i * count / candidates;
            let point = self.trees[tree].point(node);
            let (near, distance) = if self.trees.len() == 2 {
                target.copy_from_slice(point);
                self.trees[1 - tree].nearest(target)
            } else {
                (0, squared_distance(point, &self.goal).sqrt())
            };
            if distance < best.0 {
                best = (distance, node, near);
            }
        }
        let (_, node, near) = best;
        if self.trees.len() == 1 {
            target.copy_from_slice(&self.goal);
            let goal = self.extend(tree, node, &std::mem::take(target), true);
            target.resize(self.goal.len(), 0.0);
            return goal.reached.then_some((goal.last, 0));
        }
        target.copy_from_slice(self.trees[tree].point(node));
        let goal = std::mem::take(target);
        let connection = self.extend(1 - tree, near, &goal, true);
        *target = goal;
        let meeting = if tree == 0 {
            (node, connection.last)
        } else {
            (connection.last, node)
        };
        connection.reached.then_some(meeting)
    }

    /// Grows a tree from one of its nodes towards `target`; when `exact`, the
    /// target is a point of the manifold to be reached itself.
    fn extend(&mut self, tree: usize, from: usize, target: &[f64], exact: bool) -> Branch {
        self.statistics.extensions += 1;
        let planner = self.planner;
        let full_step = planner.options.step;
        let mut chart = self.trees[tree].chart(from);
        self.here.x.copy_from_slice(self.trees[tree].point(from));
        self.atlas.chart(chart).log(&self.here.x, &mut self.here.t);
        self.atlas.chart(chart).log(target, &mut self.target_t);
        planner.validity.enter(&self.here.x, &mut self.memory);
        self.rows.clear();
        self.normal_history = 0;
        let mut branch = Branch {
            first: from,
            last: from,
            reached: false,
        };
        let mut fresh = self.here.t.iter().all(|t| t.abs() < 1e-9);
        let mut scale = 1.0;
        let mut added = 0;
        let stop = loop {
            if exact && squared_distance(&self.here.x, target) <= full_step * full_step {
                break self.arrive(chart, target);
            }
            let length = self
                .target_t
                .iter()
                .zip(&self.here.t)
                .map(|(a, b)| (a - b) * (a - b))
                .sum::<f64>()
                .sqrt();
            if length < 0.1 * full_step {
                // Above the same tangent point but elsewhere: another sheet.
                break if exact {
                    Stop::NoProgress
                } else {
                    Stop::Reached
                };
            }
            let step = (scale * full_step).min(length);
            for ((w, a), b) in self.wanted.iter_mut().zip(&self.target_t).zip(&self.here.t) {
                *w = (a - b) * step / length;
            }
            match self.try_step(chart, step, length) {
                Step::Accepted if !self.is_nearer(target, step) => break Stop::NoProgress,
                Step::Accepted => {
                    let center = self.atlas.chart(chart).center();
                    let parent = branch.last;
                    branch.last = self.trees[tree].add(&self.next.x, Some(parent), chart, center);
                    if added == 0 {
                        branch.first = parent;
                    }
                    added += 1;
                    self.remember_normal_change(chart);
                    std::mem::swap(&mut self.here, &mut self.next);
                    std::mem::swap(&mut self.memory, &mut self.next_memory);
                    fresh = false;
                    scale = f64::min(1.0, 2.0 * scale);
                    if let Some(neighbour) = self.atlas.crossed_into(chart, &self.here.t) {
                        let entered = self.atlas.chart(neighbour);
                        entered.log(&self.here.x, &mut self.next.t);
                        if self.atlas.represents(neighbour, &self.here.x, &self.next.t) {
                            self.here.t.copy_from_slice(&self.next.t);
                            entered.log(target, &mut self.target_t);
                            chart = neighbour;
                            self.use_chart(tree, chart);
                        }
                    }
                }
                Step::NeedsChart if !fresh => {
                    if let Some(neighbour) = self.nearer_chart(chart) {
                        chart = neighbour;
                        self.use_chart(tree, chart);
                        self.trees[tree].set_chart(branch.last, chart);
                        std::mem::swap(&mut self.here.t, &mut self.next.t);
                        self.atlas.chart(chart).log(target, &mut self.target_t);
                        continue;
                    }
                    match self
                        .atlas
                        .add(planner.manifold, &self.here.x, &mut self.work)
                    {
                        Ok(new) => {
                            chart = new;
                            self.use_chart(tree, chart);
                            self.trees[tree].set_chart(branch.last, chart);
                            self.here.t.fill(0.0);
                            self.atlas.chart(chart).log(target, &mut self.target_t);
                            fresh = true;
                        }
                        Err(_) => break Stop::Singular,
                    }
                }
                Step::NeedsChart => {
                    scale *= 0.5;
                    if scale < SHORTEST_STEP {
                        break Stop::Projection;
                    }
                }
                Step::Stopped(Stop::Correction) if scale == 1.0 => scale = 0.5,
                Step::Stopped(stop) => break stop,
            }
        };
        if added > 0 {
            self.statistics.productive_extensions += 1;
        }
        self.count(stop);
        branch.reached = stop == Stop::Reached;
        branch
    }

    /// Whether the step came nearer to the target. Seen from different charts
    /// the target lies in different directions: without this test a branch
    /// could go back and forth between them for ever.
    fn is_nearer(&self, target: &[f64], step: f64) -> bool {
        squared_distance(&self.next.x, target)
            <= squared_distance(&self.here.x, target) - NEARER * step * step
    }

    /// A neighbour of a chart whose centre lies much nearer to `here`; tangent
    /// coordinates go to `next.t`.
    fn nearer_chart(&mut self, chart: usize) -> Option<usize> {
        let mut best = (NEARER_CHART * norm(&self.here.t), None);
        for cut in self.atlas.cuts(chart) {
            let neighbour = self.atlas.chart(cut.neighbour);
            neighbour.log(&self.here.x, &mut self.next.t);
            let length = norm(&self.next.t);
            if length < best.0
                && self
                    .atlas
                    .represents(cut.neighbour, &self.here.x, &self.next.t)
            {
                best = (length, Some(cut.neighbour));
            }
        }
        let neighbour = best.1?;
        self.atlas
            .chart(neighbour)
            .log(&self.here.x, &mut self.next.t);
        Some(neighbour)
    }

    /// Prepares for a branch to go on in another chart.
    fn use_chart(&mut self, tree: usize, chart: usize) {
        self.normal_history = 0;
        let charts = &mut self.charts[tree];
        if !charts.contains(&chart) {
            charts.push(chart);
        }
    }

    /// The last step of an exact branch: straight to the target.
    fn arrive(&mut self, chart: usize, target: &[f64]) -> Stop {
        self.atlas.chart(chart).log(target, &mut self.next.t);
        self.contacts.clear();
        match self.test(chart, target) {
            Ok(()) => Stop::Reached,
            Err(Obstruction::Contacts) => Stop::Contact,
            Err(Obstruction::Blocked) => Stop::Blocked,
        }
    }

    /// Validity of the step from `here` to x (tangent coordinates in `next.t`).
    fn test(&mut self, chart: usize, x: &[f64]) -> Result<(), Obstruction> {
        self.statistics.validity_tests += 1;
        let planner = self.planner;
        let chart = self.atlas.chart(chart);
        let (here, work) = (&self.here, &mut self.work);
        planner.validity.step(
            &self.memory,
            x,
            &mut self.next_memory,
            &mut |s, y| {
                for ((y, a), b) in y.iter_mut().zip(&here.x).zip(x) {
                    *y = a + s * (b - a);
                }
                chart
                    .retract(planner.manifold, y, planner.options.tolerance, work)
                    .is_ok()
            },
            &mut self.contacts,
        )
    }

    /// One step of `wanted`, slid along whatever is in the way, into `next`.
    fn try_step(&mut self, chart: usize, step: f64, length: f64) -> Step {
        let planner = self.planner;
        let options = &planner.options;
        self.refresh_rows(chart, step);
        let mut slid = !self.rows.is_empty();
        for _ in 0..=CORRECTIONS {
            self.step.copy_from_slice(&self.wanted);
            if slid {
                self.rows.solve(&mut self.step);
                let size = norm(&self.step);
                if size < LEAST_STEP * step {
                    return Step::Stopped(self.obstacle());
                }
                let longest = 1.5 * step;
                if size > longest {
                    self.step.iter_mut().for_each(|s| *s *= longest / size);
                }
            }
            for ((t, a), b) in self.next.t.iter_mut().zip(&self.here.t).zip(&self.step) {
                *t = a + b;
            }
            if slid {
                let left = self
                    .target_t
                    .iter()
                    .zip(&self.next.t)
                    .map(|(a, b)| (a - b) * (a - b))
                    .sum::<f64>()
                    .sqrt();
                if length - left < 0.5 * LEAST_STEP * step {
                    return Step::Stopped(Stop::NoProgress);
                }
            }
            self.predict(chart, slid);
            let here = self.atlas.chart(chart);
            if here
                .retract(
                    planner.manifold,
                    &mut self.next.x,
                    options.tolerance,
                    &mut self.work,
                )
                .is_err()
                || !self.atlas.represents(chart, &self.next.x, &self.next.t)
                || norm(&self.step)
                    < options.domain.cosine * squared_distance(&self.next.x, &self.here.x).sqrt()
            {
                return Step::NeedsChart;
            }
            self.violated.clear();
            self.find_violated_limits();
            if self.violated.is_empty() {
                self.contacts.clear();
                let x = std::mem::take(&mut self.next.x);
                let outcome = self.test(chart, &x);
                self.next.x = x;
                match outcome {
                    Ok(()) => {
                        self.statistics.sliding_steps += usize::from(slid);
                        return Step::Accepted;
                    }
                    Err(Obstruction::Blocked) => return Step::Stopped(Stop::Blocked),
                    Err(Obstruction::Contacts) => self
                        .violated
                        .extend(self.contacts.iter().map(|&i| Constraint::Contact(i))),
                }
            }
            if !options.slide {
                let contact = matches!(self.violated[0], Constraint::Contact(_));
                return Step::Stopped(if contact { Stop::Contact } else { Stop::Limit });
            }
            slid = true;
            for i in 0..self.violated.len() {
                let constraint = self.violated[i];
                let Some(value) = self.linearise(chart, constraint, true) else {
                    return Step::Stopped(Stop::Contact);
                };
                let margin = self.margin(constraint);
                let moved: f64 = self
                    .tangent_gradient
                    .iter()
                    .zip(&self.step)
                    .map(|(a, b)| a * b)
                    .sum();
                self.rows
                    .set(constraint, &self.tangent_gradient, margin - value + moved);
            }
        }
        Step::Stopped(Stop::Correction)
    }

    /// Starting point of the projection: the tangent step plus the expected
    /// change of the normal offset, extrapolated from the steps before.
    fn predict(&mut self, chart: usize, slid: bool) {
        self.next.x.copy_from_slice(&self.here.x);
        for (j, &s) in self.step.iter().enumerate() {
            let tangent = self.atlas.chart(chart).tangent(j);
            for (x, v) in self.next.x.iter_mut().zip(tangent) {
                *x += s * v;
            }
        }
        if slid || self.normal_history == 0 {
            return;
        }
        let [newest, before] = &self.normal_changes;
        if self.normal_history == 1 {
            self.next
                .x
                .iter_mut()
                .zip(newest)
                .for_each(|(x, a)| *x += a);
        } else {
            for ((x, a), b) in self.next.x.iter_mut().zip(newest).zip(before) {
                *x += 2.0 * a - b;
            }
        }
    }

    /// Records how the normal offset changed from `here` to `next`.
    fn remember_normal_change(&mut self, chart: usize) {
        self.normal_changes.swap(0, 1);
        let newest = &mut self.normal_changes[0];
        for ((d, a), b) in newest.iter_mut().zip(&self.next.x).zip(&self.here.x) {
            *d = a - b;
        }
        for (j, &s) in self.step.iter().enumerate() {
            let tangent = self.atlas.chart(chart).tangent(j);
            newest
                .iter_mut()
                .zip(tangent)
                .for_each(|(d, v)| *d -= s * v);
        }
        self.normal_history = (self.normal_history + 1).min(2);
    }

    /// Bounds and limits violated at `next`.
    fn find_violated_limits(&mut self) {
        let manifold = self.planner.manifold;
        let bounds = manifold.lower_bounds().iter().zip(manifold.upper_bounds());
        for (i, (&x, (&lo, &hi))) in self.next.x.iter().zip(bounds).enumerate() {
            if x < lo - ROUNDING {
                self.violated.push(Constraint::Lower(i));
            } else if x > hi + ROUNDING {
                self.violated.push(Constraint::Upper(i));
            }
        }
        manifold.limits(&self.next.x, &mut self.limits);
        for (i, &value) in self.limits.iter().enumerate() {
            if value < -ROUNDING {
                self.violated.push(Constraint::Limit(i));
            }
        }
    }

    fn margin(&self, constraint: Constraint) -> f64 {
        match constraint {
            Constraint::Contact(_) => self.planner.options.contact_margin,
            _ => self.planner.options.limit_margin,
        }
    }

    /// Value of a constraint at `next` (or `here`), with its gradient in tangent
    /// coordinates.
    fn linearise(&mut self, chart: usize, constraint: Constraint, at_next: bool) -> Option<f64> {
        let planner = self.planner;
        let x = if at_next { &self.next.x } else { &self.here.x };
        self.gradient.clear();
        let value = match constraint {
            Constraint::Lower(i) => {
                self.gradient.add(i, 1.0);
                x[i] - planner.manifold.lower_bounds()[i]
            }
            Constraint::Upper(i) => {
                self.gradient.add(i, -1.0);
                planner.manifold.upper_bounds()[i] - x[i]
            }
            Constraint::Limit(i) => {
                planner.manifold.limit_gradient(i, x, &mut self.gradient);
                planner.manifold.limit(i, x)
            }
            Constraint::Contact(i) => planner.validity.contact(i, x, &mut self.gradient)?,
        };
        let chart = self.atlas.chart(chart);
        self.tangent_gradient.fill(0.0);
        for &(variable, g) in self.gradient.entries() {
            for (a, v) in self
                .tangent_gradient
                .iter_mut()
                .zip(chart.variable(variable))
            {
                *a += g * v;
            }
        }
        Some(value)
    }

    /// Linearises the constraints of the step before at `here` and drops those
    /// that this step cannot reach.
    fn refresh_rows(&mut self, chart: usize, step: f64) {
        let mut i = 0;
        while i < self.rows.constraints.len() {
            let constraint = self.rows.constraints[i];
            let offset = self
                .linearise(chart, constraint, false)
                .map(|value| self.margin(constraint) - value);
            match offset {
                Some(offset) if offset > -step * norm(&self.tangent_gradient) => {
                    self.rows.set(constraint, &self.tangent_gradient, offset);
                    i += 1;
                }
                _ => self.rows.remove(i),
            }
        }
    }

    /// Whether limits or contacts left no way on.
    fn obstacle(&self) -> Stop {
        let contact = |c: &Constraint| matches!(c, Constraint::Contact(_));
        if self.rows.constraints.iter().any(contact) {
            Stop::Contact
        } else {
            Stop::Limit
        }
    }

    fn count(&mut self, stop: Stop) {
        let stops = &mut self.statistics.stops;
        *match stop {
            Stop::Reached => &mut stops.reached,
            Stop::Limit => &mut stops.limit,
            Stop::Contact => &mut stops.contact,
            Stop::Blocked => &mut stops.blocked,
            Stop::NoProgress => &mut stops.no_progress,
            Stop::Correction => &mut stops.correction,
            Stop::Projection => &mut stops.projection,
            Stop::Singular => &mut stops.singular,
        } += 1;
    }

    /// Path and statistics.
    fn finish(
        mut self,
        outcome: Result<(usize, usize), Failure>,
        clock: &ThreadTime,
    ) -> Result<Plan, PlanError> {
        let points = outcome.map(|(a, b)| self.path(a, b));
        let mut statistics = self.statistics;
        statistics.seconds = clock.elapsed().as_secs_f64();
        statistics.charts = self.atlas.len();
        statistics.nodes = self.trees.iter().map(Tree::len).sum();
        statistics.projections = self.work.projections;
        statistics.chord_iterations = self.work.chord_iterations;
        statistics.newton_iterations = self.work.newton_iterations;
        match points {
            Ok(points) => Ok(Plan {
                points,
                statistics,
                trees: None,
            }),
            Err(failure) => Err(PlanError::NotFound {
                failure,
                statistics: Box::new(statistics),
            }),
        }
    }

    /// The path through node `a` of the first tree and `b` of the second (or the
    /// goal), its points polished, and subdivided where they lie too far apart.
    fn path(&mut self, a: usize, b: usize) -> Vec<Vec<f64>> {
        let mut nodes = Vec::new();
        let mut cursor = Some(a);
        while let Some(node) = cursor {
            nodes.push((
                self.trees[0].point(node).to_vec(),
                self.trees[0].chart(node),
            ));
            cursor = self.trees[0].parent(node);
        }
        nodes.reverse();
        if let Some(tree) = self.trees.get(1) {
            let mut cursor = Some(b);
            while let Some(node) = cursor {
                nodes.push((tree.point(node).to_vec(), tree.chart(node)));
                cursor = tree.parent(node);
            }
        } else {
            nodes.push((self.goal.clone(), self.goal_chart));
        }
        let mut points: Vec<Vec<f64>> = Vec::new();
        for (mut x, chart) in nodes {
            self.polish(&mut x, chart);
            if let Some(previous) = points.last().cloned() {
                self.subdivide(&mut points, &previous, &x, chart, 8);
            }
            points.push(x);
        }
        points
    }

    fn polish(&mut self, x: &mut [f64], chart: usize) {
        let before = x.to_vec();
        let manifold = self.planner.manifold;
        let chart = self.atlas.chart(chart);
        if chart
            .retract(manifold, x, FINAL_TOLERANCE, &mut self.work)
            .is_err()
        {
            x.copy_from_slice(&before);
        }
    }

    /// Appends points between `a` and `b` until none of the gaps is too wide.
    fn subdivide(
        &mut self,
        points: &mut Vec<Vec<f64>>,
        a: &[f64],
        b: &[f64],
        chart: usize,
        depth: usize,
    ) {
        let planner = self.planner;
        if depth == 0 || planner.validity.displacement(a, b) <= planner.max_displacement {
            return;
        }
        let mut middle: Vec<f64> = a.iter().zip(b).map(|(a, b)| 0.5 * (a + b)).collect();
        self.polish(&mut middle, chart);
        self.subdivide(points, a, &middle, chart, depth - 1);
        points.push(middle.clone());
        self.subdivide(points, &middle, b, chart, depth - 1);
    }
}

fn norm(v: &[f64]) -> f64 {
    v.iter().map(|v| v * v).sum::<f64>().sqrt()
}
