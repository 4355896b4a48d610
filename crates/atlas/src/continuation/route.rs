//! Paths over an atlas: graph search between charts.
//!
//! A* over the centres, with the distance in the ambient space as cost and as
//! bound of what is left. A way between two centres is only tested when the search
//! takes it. The ways by which charts were reached are valid, so that any two
//! charts are connected; where such a way breaks a limit between the points at which
//! it was tested, it is led along the limit. Cost: one test for each chart that the
//! search looks at.

use std::{cmp::Ordering, collections::BinaryHeap};

use crate::{
    atlas::squared_distance,
    chart::{Chart, Workspace},
    continuation::{
        border::{Border, broken_limit},
        component::ComponentAtlas,
        interpolate, settle,
    },
    manifold::{ImplicitManifold, SparseRow},
    validity::Validity,
};

/// A point of a route may be this many times farther from the last than wanted.
const LONGEST: f64 = 2.0;
/// Halvings of the step towards the largest displacement.
const HALVINGS: usize = 8;
/// Corrections of a point that breaks limits.
const CORRECTIONS: usize = 8;
/// A correction aims this far inside a limit, and this fraction of the violation farther.
const INSIDE: f64 = 1e-6;
const OVERSHOOT: f64 = 0.2;

/// How fine a route is.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct RouteOptions {
    /// Distance of neighbouring points.
    pub step: f64,
    /// Largest displacement between neighbouring points (see
    /// [`Validity::displacement`]).
    pub max_displacement: f64,
    /// Residual below which the equations hold.
    pub tolerance: f64,
}

impl Default for RouteOptions {
    fn default() -> Self {
        Self {
            step: 0.05,
            max_displacement: f64::INFINITY,
            tolerance: 1e-9,
        }
    }
}

/// A path over an atlas.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Route {
    /// Points of the manifold from start to goal.
    pub points: Vec<Vec<f64>>,
    /// The charts whose centres it passes.
    pub charts: Vec<usize>,
    /// Ways between centres whose validity was tested.
    pub tested: usize,
}

/// Why there is no path over an atlas.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RouteError {
    /// No chart is near an endpoint.
    #[error(
        "the {which} lies on none of the {charts} charts of the atlas: it belongs to another \
             component, or the atlas is not complete"
    )]
    NotCovered {
        /// "start" or "goal".
        which: &'static str,
        /// Number of charts.
        charts: usize,
    },
    /// Every way is blocked.
    #[error("no way over the atlas from start to goal is valid ({tested} ways tried)")]
    Blocked {
        /// Ways between centres whose validity was tested.
        tested: usize,
    },
}

/// An entry of the queue of A*.
struct Entry {
    /// Cost so far and bound of what is left.
    bound: f64,
    cost: f64,
    node: usize,
    from: usize,
}

impl Ord for Entry {
    fn cmp(&self, other: &Self) -> Ordering {
        // The heap yields its largest entry.
        other
            .bound
            .total_cmp(&self.bound)
            .then_with(|| other.node.cmp(&self.node))
            .then_with(|| other.from.cmp(&self.from))
    }
}

impl PartialOrd for Entry {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Entry {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Entry {}

impl ComponentAtlas {
    /// A valid path from `start` to `goal`, points of the manifold, along centres
    /// of charts.
    ///
    /// # Errors
    /// [`RouteError`] when an endpoint lies on no chart, or no way is valid.
    pub fn route<M: ImplicitManifold + ?Sized, V: Validity>(
        &self,
        manifold: &M,
        validity: &V,
        [start, goal]: [&[f64]; 2],
        options: &RouteOptions,
    ) -> Result<Route, RouteError> {
        let mut search = RouteSearch {
            atlas: self,
            manifold,
            validity,
            options,
            ends: [start, goal],
            doors: [Vec::new(), Vec::new()],
            work: Workspace::default(),
            tested: 0,
        };
        for (end, which) in ["start", "goal"].into_iter().enumerate() {
            search.doors[end] = search.find_doors(search.ends[end]);
            if search.doors[end].is_empty() {
                return Err(RouteError::NotCovered {
                    which,
                    charts: self.len(),
                });
            }
        }
        search.run()
    }
}

/// Nodes are the charts, then start and goal.
struct RouteSearch<'a, M: ?Sized, V> {
    atlas: &'a ComponentAtlas,
    manifold: &'a M,
    validity: &'a V,
    options: &'a RouteOptions,
    ends: [&'a [f64]; 2],
    /// Charts that have the start, and the goal, the nearest first.
    doors: [Vec<usize>; 2],
    work: Workspace,
    tested: usize,
}

impl<M: ImplicitManifold + ?Sized, V: Validity> RouteSearch<'_, M, V> {
    fn find_doors(&mut self, x: &[f64]) -> Vec<usize> {
        let mut near = self.atlas.near(x);
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        near.into_iter()
            .map(|(_, chart)| chart)
            .filter(|&chart| self.atlas.has(self.manifold, chart, x, &mut self.work))
            .collect()
    }

    fn start(&self) -> usize {
        self.atlas.len()
    }

    fn goal(&self) -> usize {
        self.atlas.len() + 1
    }

    fn point(&self, node: usize) -> &[f64] {
        match node.checked_sub(self.atlas.len()) {
            None => self.atlas.chart(node).center(),
            Some(end) => self.ends[end],
        }
    }

    /// The chart that represents the surroundings of a node.
    fn chart_of(&self, node: usize) -> usize {
        match node.checked_sub(self.atlas.len()) {
            None => node,
            Some(end) => self.doors[end][0],
        }
    }

    fn neighbours(&self, node: usize) -> Vec<usize> {
        if node == self.start() {
            let mut all = self.doors[0].clone();
            let near = 4.0 * self.atlas.domain().radius.powi(2);
            if squared_distance(self.ends[0], self.ends[1]) < near {
                all.push(self.goal());
            }
            return all;
        }
        let mut all: Vec<usize> = self.atlas.neighbours(node).collect();
        // Charts that were reached from here may since have shrunk apart.
        all.extend(self.atlas.parent(node));
        if self.doors[1].contains(&node) {
            all.push(self.goal());
        }
        all
    }

    fn run(mut self) -> Result<Route, RouteError> {
        let (start, goal) = (self.start(), self.goal());
        let mut ways: Vec<Option<(usize, Vec<Vec<f64>>)>> = vec![None; self.atlas.len() + 2];
        let mut queue = BinaryHeap::new();
        queue.push(Entry {
            bound: 0.0,
            cost: 0.0,
            node: start,
            from: start,
        });
        while let Some(entry) = queue.pop() {
            let node = entry.node;
            if ways[node].is_some() {
                continue;
            }
            let way = if node == start {
                vec![self.ends[0].to_vec()]
            } else {
                match self.way(entry.from, node) {
                    Some(way) => way,
                    None => continue,
                }
            };
            ways[node] = Some((entry.from, way));
            if node == goal {
                return Ok(self.finish(ways));
            }
            for next in self.neighbours(node) {
                if ways[next].is_none() {
                    let length = squared_distance(self.point(node), self.point(next)).sqrt();
                    let left = squared_distance(self.point(next), self.ends[1]).sqrt();
                    queue.push(Entry {
                        bound: entry.cost + length + left,
                        cost: entry.cost + length,
                        node: next,
                        from: node,
                    });
                }
            }
        }
        Err(RouteError::Blocked {
            tested: self.tested,
        })
    }

    fn finish(&self, mut ways: Vec<Option<(usize, Vec<Vec<f64>>)>>) -> Route {
        let mut pieces = Vec::new();
        let mut charts = Vec::new();
        let mut node = self.goal();
        while let Some((from, way)) = ways[node].take() {
            pieces.push(way);
            if node < self.atlas.len() {
                charts.push(node);
            }
            node = from;
        }
        pieces.reverse();
        charts.reverse();
        Route {
            points: pieces.concat(),
            charts,
            tested: self.tested,
        }
    }

    /// The valid points from one node, excluded, to another one, included; none
    /// where the way is not valid.
    fn way(&mut self, from: usize, to: usize) -> Option<Vec<Vec<f64>>> {
        self.tested += 1;
        let distance = squared_distance(self.point(from), self.point(to)).sqrt();
        let mut steps = (distance / self.options.step).ceil().max(1.0) as usize;
        for _ in 0..HALVINGS {
            let way = self.points_between(from, to, steps)?;
            let mut previous = self.point(from);
            let coarse = way.iter().any(|x| {
                let moved = self.validity.displacement(previous, x);
                previous = x;
                moved > self.options.max_displacement
            });
            if !coarse {
                return self.is_valid(from, to, &way).then_some(way);
            }
            steps *= 2;
        }
        None
    }

    /// Points of the manifold on the way between two nodes: of the first one's
    /// chart up to the middle, of the second one's from there.
    fn points_between(&mut self, from: usize, to: usize, steps: usize) -> Option<Vec<Vec<f64>>> {
        let (a, b) = (self.point(from).to_vec(), self.point(to).to_vec());
        let longest = LONGEST * squared_distance(&a, &b).sqrt() / steps as f64;
        let mut way: Vec<Vec<f64>> = Vec::with_capacity(steps);
        for step in 1..=steps {
            let mut x = b.clone();
            if step < steps {
                interpolate(&a, &b, step as f64 / steps as f64, &mut x);
                let node = if 2 * step <= steps { from } else { to };
                let chart = self.atlas.chart(self.chart_of(node));
                let tolerance = self.options.tolerance;
                if !settle(chart, self.manifold, &mut x, tolerance, &mut self.work)
                    || !self.bring_inside(chart, &mut x)
                {
                    return None;
                }
            }
            let previous = way.last().unwrap_or(&a);
            if squared_distance(previous, &x) > longest * longest {
                return None;
            }
            way.push(x);
        }
        Some(way)
    }

    /// Moves a point along the manifold until it breaks no limit, by the one that it
    /// breaks the most after the other. `false` where this does not help.
    fn bring_inside(&mut self, chart: &Chart, x: &mut [f64]) -> bool {
        let manifold = self.manifold;
        for _ in 0..CORRECTIONS {
            let Some(border) = broken_limit(manifold, x) else {
                return true;
            };
            let mut gradient = SparseRow::default();
            let value = match border {
                Border::Lower(i) => {
                    gradient.add(i, 1.0);
                    x[i] - manifold.lower_bounds()[i]
                }
                Border::Upper(i) => {
                    gradient.add(i, -1.0);
                    manifold.upper_bounds()[i] - x[i]
                }
                Border::Limit(i) => {
                    manifold.limit_gradient(i, x, &mut gradient);
                    manifold.limit(i, x)
                }
                _ => return false,
            };
            let pattern = manifold.jacobian_pattern();
            let mut jacobian = vec![0.0; pattern.len()];
            manifold.jacobian(x, &mut jacobian);
            let mut along = vec![0.0; chart.dimension()];
            chart.pull_back(pattern, &jacobian, &gradient, &mut Vec::new(), &mut along);
            let square: f64 = along.iter().map(|g| g * g).sum();
            let step = (INSIDE - (1.0 + OVERSHOOT) * value) / square;
            if !step.is_finite() {
                return false;
            }
            for (j, g) in along.iter().enumerate() {
                for (x, v) in x.iter_mut().zip(chart.tangent(j)) {
                    *x += step * g * v;
                }
            }
            let tolerance = self.options.tolerance;
            if !settle(chart, manifold, x, tolerance, &mut self.work) {
                return false;
            }
        }
        broken_limit(manifold, x).is_none()
    }

    fn is_valid(&mut self, from: usize, to: usize, way: &[Vec<f64>]) -> bool {
        let (mut memory, mut next) = (self.validity.memory(), self.validity.memory());
        let mut before = self.point(from).to_vec();
        self.validity.enter(&before, &mut memory);
        for (i, x) in way.iter().enumerate() {
            let node = if 2 * (i + 1) <= way.len() { from } else { to };
            let chart = self.atlas.chart(self.chart_of(node));
            let (manifold, tolerance) = (self.manifold, self.options.tolerance);
            let work = &mut self.work;
            let mut between = |s: f64, y: &mut [f64]| {
                interpolate(&before, x, s, y);
                chart.retract(manifold, y, tolerance, work).is_ok()
            };
            let step = self
                .validity
                .step(&memory, x, &mut next, &mut between, &mut Vec::new());
            if step.is_err() {
                return false;
            }
            std::mem::swap(&mut memory, &mut next);
            before.copy_from_slice(x);
        }
        true
    }
}
