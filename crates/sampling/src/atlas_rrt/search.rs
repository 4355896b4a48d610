//! The search: trees, samples, connections.

use cpu_time::ThreadTime;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64;
use tensegra_atlas::{Atlas, ImplicitManifold, SparseRow, Validity, Workspace};

use super::{AtlasRrt, branch::Branch};
use crate::{
    options::SampleRadius,
    plan::{Failure, Observer, PlanError, Progress, Statistics},
    slide::{Constraint, NearestStep},
    tree::{Tree, squared_distance},
};

/// Draws of a sample before one outside its chart's domain is taken.
const DRAWS: usize = 20;
/// Nodes of a branch that are tried as origin of a connection.
const CONNECTION_CANDIDATES: usize = 2;
/// Connections in a row that added no node, after which every second one begins at
/// a random node.
const STUCK: usize = 16;
/// A tree this many times larger than the other one waits.
const IMBALANCE: usize = 4;
/// Each attempt may grow this much larger trees than the one before.
const ATTEMPT_GROWTH: f64 = 1.1;
/// Extensions in a row without a new node after which planning is given up.
pub(super) const FRUITLESS: usize = 200_000;

/// A point with its tangent coordinates.
#[derive(Clone, Debug, Default)]
pub(super) struct Place {
    pub(super) x: Vec<f64>,
    pub(super) t: Vec<f64>,
}

pub(super) struct Search<'p, M: ?Sized, V: Validity> {
    pub(super) planner: &'p AtlasRrt<'p, M, V>,
    /// Length δ of a step.
    pub(super) full_step: f64,
    /// Whether the straight connection has been tried.
    begun: bool,
    pub(super) atlas: Atlas,
    pub(super) trees: Vec<Tree>,
    /// Sampling radius of each chart, when adaptive.
    pub(super) radii: Vec<f64>,
    start: Vec<f64>,
    pub(super) goal: Vec<f64>,
    pub(super) goal_chart: usize,
    /// For each tree, the connections in a row that have added no node to it.
    stuck: [usize; 2],
    /// Nodes that the present attempt may have.
    attempt_nodes: f64,
    pub(super) random: Pcg64,
    pub(super) statistics: Statistics,
    pub(super) work: Workspace,
    pub(super) rows: NearestStep,
    // Scratch of a step.
    pub(super) here: Place,
    pub(super) next: Place,
    pub(super) memory: V::Memory,
    pub(super) next_memory: V::Memory,
    pub(super) target_t: Vec<f64>,
    pub(super) wanted: Vec<f64>,
    pub(super) step: Vec<f64>,
    /// The step before its last correction.
    pub(super) step_before: Vec<f64>,
    pub(super) limits: Vec<f64>,
    pub(super) violated: Vec<Constraint>,
    pub(super) contacts: Vec<usize>,
    pub(super) gradient: SparseRow,
    pub(super) tangent_gradient: Vec<f64>,
    /// Jacobian at the point where constraints are linearised.
    pub(super) jacobian: Vec<f64>,
    pub(super) dense: Vec<f64>,
    /// The step before, in tangent coordinates.
    pub(super) last_step: Vec<f64>,
    /// Changes of the normal offset over the last two steps, newest first.
    pub(super) normal_changes: [Vec<f64>; 2],
    pub(super) normal_history: usize,
}

/// An atlas with the charts of start and goal, the trees that begin there, and the
/// chart of the goal.
fn begin<M: ImplicitManifold + ?Sized, V: Validity>(
    planner: &AtlasRrt<'_, M, V>,
    k: usize,
    start: &[f64],
    goal: &[f64],
    work: &mut Workspace,
) -> Result<(Atlas, Vec<Tree>, usize), PlanError> {
    let mut atlas = Atlas::new(k, planner.options.domain);
    let mut add = |which, x: &[f64]| {
        atlas
            .add(planner.manifold, x, work)
            .map_err(|error| PlanError::Manifold { which, error })
    };
    let start_chart = add("start", start)?;
    let goal_chart = if start == goal {
        start_chart
    } else {
        add("goal", goal)?
    };
    let search = planner.options.neighbours;
    let mut trees = vec![Tree::new(search, start, start_chart)];
    if planner.options.two_trees {
        trees.push(Tree::new(search, goal, goal_chart));
    }
    Ok((atlas, trees, goal_chart))
}

impl<'p, M: ImplicitManifold + ?Sized, V: Validity> Search<'p, M, V> {
    pub(super) fn new(
        planner: &'p AtlasRrt<'p, M, V>,
        k: usize,
        start: &[f64],
        goal: &[f64],
    ) -> Result<Self, PlanError> {
        let mut work = Workspace::default();
        let (atlas, trees, goal_chart) = begin(planner, k, start, goal, &mut work)?;
        let m = planner.manifold.ambient_dimension();
        let place = || Place {
            x: vec![0.0; m],
            t: vec![0.0; k],
        };
        Ok(Self {
            planner,
            full_step: planner.options.step,
            begun: false,
            atlas,
            trees,
            radii: Vec::new(),
            start: start.to_vec(),
            goal: goal.to_vec(),
            goal_chart,
            stuck: [0; 2],
            attempt_nodes: planner.options.restart_nodes as f64,
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
            step_before: vec![0.0; k],
            limits: vec![0.0; planner.manifold.limit_count()],
            violated: Vec::new(),
            contacts: Vec::new(),
            gradient: SparseRow::default(),
            tangent_gradient: vec![0.0; k],
            jacobian: vec![0.0; planner.manifold.jacobian_pattern().len()],
            dense: Vec::new(),
            last_step: vec![0.0; k],
            normal_changes: [vec![0.0; m], vec![0.0; m]],
            normal_history: 0,
        })
    }

    /// Forgets trees and atlas, and lets the next attempt grow larger ones.
    pub(super) fn start_anew(&mut self) {
        let (charts, nodes) = self.grown();
        let k = self.atlas.dimension();
        // It worked before; where it should not, the search goes on.
        let begun = begin(self.planner, k, &self.start, &self.goal, &mut self.work);
        if let Ok((atlas, trees, goal_chart)) = begun {
            self.statistics.charts = charts;
            self.statistics.nodes = nodes;
            self.statistics.restarts += 1;
            (self.atlas, self.trees, self.goal_chart) = (atlas, trees, goal_chart);
            self.radii.clear();
            self.stuck = [0; 2];
        }
        self.attempt_nodes *= ATTEMPT_GROWTH;
    }

    /// Charts and nodes of all attempts.
    pub(super) fn grown(&self) -> (usize, usize) {
        let nodes: usize = self.trees.iter().map(Tree::len).sum();
        (
            self.statistics.charts + self.atlas.len(),
            self.statistics.nodes + nodes,
        )
    }

    /// Grows trees until they meet. Returns the nodes where they do: one of the
    /// first tree and, with two trees, one of the second.
    pub(super) fn run(
        &mut self,
        clock: &ThreadTime,
        observer: &mut dyn Observer,
    ) -> Result<(usize, usize), Failure> {
        let options = &self.planner.options;
        // The straight connection first: easy problems need no search.
        if !std::mem::replace(&mut self.begun, true) {
            let goal = self.goal.clone();
            let branch = self.extend(0, 0, &goal, true);
            if branch.reached {
                return Ok((branch.last, 0));
            }
        }
        let mut target = vec![0.0; self.goal.len()];
        let mut turn = 0;
        let mut fruitless = 0;
        for iteration in 0_usize.. {
            if iteration % 16 == 0 {
                let (charts, nodes) = self.grown();
                let progress = Progress {
                    seconds: clock.elapsed().as_secs_f64(),
                    charts,
                    nodes,
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
            if self.trees.iter().map(Tree::len).sum::<usize>() as f64 > self.attempt_nodes {
                self.start_anew();
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
    pub(super) fn next_tree(&self, last: usize) -> usize {
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

    /// Draws a point near the atlas of a tree into `x`, within the bounds of the
    /// variables: those far outside would pull branches to the limits and nowhere
    /// else. Returns the chart.
    pub(super) fn sample(&mut self, tree: usize, x: &mut [f64]) -> usize {
        let k = self.atlas.dimension();
        let mut chart = 0;
        for _ in 0..DRAWS {
            let charts = self.trees[tree].used_charts();
            chart = charts[self.random.random_range(0..charts.len())];
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
        let manifold = self.planner.manifold;
        let bounds = manifold.lower_bounds().iter().zip(manifold.upper_bounds());
        for (x, (&lower, &upper)) in x.iter_mut().zip(bounds) {
            *x = x.max(lower).min(upper);
        }
        chart
    }

    pub(super) fn adapt_radius(&mut self, chart: usize, reached: bool) {
        if let SampleRadius::Adaptive { largest } = self.planner.options.sample_radius {
            let radius = &mut self.radii[chart];
            let smallest = self.planner.options.domain.radius.min(largest);
            *radius = (*radius * if reached { 1.2 } else { 0.8 }).clamp(smallest, largest);
        }
    }

    /// Tries to connect a new branch to the other tree (or to the goal).
    pub(super) fn connect(
        &mut self,
        tree: usize,
        branch: &Branch,
        target: &mut Vec<f64>,
    ) -> Option<(usize, usize)> {
        let count = branch.last - branch.first;
        let candidates = count.min(CONNECTION_CANDIDATES);
        let mut best = (f64::INFINITY, 0, 0);
        for i in 0..candidates {
            // The last node of the branch and one halfway.
            let node = branch.last - i * count / candidates;
            let point = self.trees[tree].point(node);
            let nearer = if self.trees.len() == 2 {
                target.copy_from_slice(point);
                self.trees[1 - tree].nearest_within(target, best.0)
            } else {
                let distance = squared_distance(point, &self.goal).sqrt();
                (distance < best.0).then_some((0, distance))
            };
            if let Some((near, distance)) = nearer {
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
        let other = 1 - tree;
        // Nodes pressed against an obstacle are the nearest to all that lies behind
        // it, and lead nowhere.
        let elsewhere = self.stuck[other] >= STUCK && self.stuck[other].is_multiple_of(2);
        let origin = if elsewhere {
            self.random.random_range(0..self.trees[other].len())
        } else {
            near
        };
        target.copy_from_slice(self.trees[tree].point(node));
        let goal = std::mem::take(target);
        let connection = self.extend(other, origin, &goal, true);
        *target = goal;
        if elsewhere || connection.first == connection.last {
            self.stuck[other] += 1;
        } else {
            self.stuck[other] = 0;
        }
        let meeting = if tree == 0 {
            (node, connection.last)
        } else {
            (connection.last, node)
        };
        connection.reached.then_some(meeting)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::PlannerOptions;
    use tensegra_atlas::{Everywhere, doc::Sphere};

    #[test]
    fn samples_reach_far_but_not_out_of_bounds() {
        // Its bounds are -2 and 2.
        let sphere = Sphere::new();
        let planner = AtlasRrt::new(&sphere, &Everywhere, PlannerOptions::default());
        let start = [1.0, 0.0, 0.0];
        let mut search = Search::new(&planner, 2, &start, &start).unwrap();
        let mut x = [0.0; 3];
        let mut at_bounds = 0;
        for _ in 0..100 {
            search.sample(0, &mut x);
            assert!(x.iter().all(|x| x.abs() <= 2.0));
            at_bounds += usize::from(x[1..].iter().any(|x| x.abs() == 2.0));
        }
        assert!((50..100).contains(&at_bounds), "{at_bounds}");
    }
}
