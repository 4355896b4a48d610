//! The front of a continuation: charts whose cells still have corners to look at.

use std::collections::{BTreeMap, VecDeque};

use super::{Border, ComponentAtlas, Continuation, broken_limit, look::fit};
use crate::{
    chart::{Chart, Workspace},
    error::ManifoldError,
    manifold::{ImplicitManifold, SparseRow},
    qr::dot,
    validity::Validity,
};

/// Radii do not shrink below this fraction of ρ, or ε where that is less.
const LEAST_RADIUS: f64 = 0.1;
/// A chart's first radius is at most this multiple of that of its parent.
const GROWTH: f64 = 1.3;
/// Bounds of the factor by which a radius shrinks.
const SHRINK: [f64; 2] = [0.5, 0.9];

/// The state of a continuation.
pub(super) struct Front<'p, M: ?Sized, V: Validity> {
    pub(super) continuation: &'p Continuation<'p, M, V>,
    pub(super) atlas: ComponentAtlas,
    /// What validity remembers of each centre.
    pub(super) memories: Vec<V::Memory>,
    queue: VecDeque<usize>,
    queued: Vec<bool>,
    pub(super) borders: BTreeMap<Border, usize>,
    pub(super) tests: usize,
    pub(super) work: Workspace,
    pub(super) there: Vec<f64>,
    pub(super) memory_there: V::Memory,
    pub(super) memory_before: V::Memory,
    /// The contact last found violated, and scratch for its gradient.
    pub(super) last_contact: Option<usize>,
    pub(super) row: SparseRow,
}

impl<'p, M: ImplicitManifold + ?Sized, V: Validity> Front<'p, M, V> {
    pub(super) fn new(continuation: &'p Continuation<'p, M, V>, dimension: usize) -> Self {
        Self {
            continuation,
            atlas: ComponentAtlas::new(dimension, continuation.options.domain),
            memories: Vec::new(),
            queue: VecDeque::new(),
            queued: Vec::new(),
            borders: BTreeMap::new(),
            tests: 0,
            work: Workspace::default(),
            there: vec![0.0; continuation.manifold.ambient_dimension()],
            memory_there: continuation.validity.memory(),
            memory_before: continuation.validity.memory(),
            last_contact: None,
            row: SparseRow::default(),
        }
    }

    pub(super) fn add(
        &mut self,
        center: &[f64],
        parent: Option<usize>,
        memory: V::Memory,
    ) -> Result<(), ManifoldError> {
        let largest = self.continuation.options.domain.radius;
        let largest = parent.map_or(largest, |p| largest.min(GROWTH * self.atlas.radius(p)));
        let manifold = self.continuation.manifold;
        let chart = Chart::new(manifold, center, self.atlas.dimension(), &mut self.work)?;
        let radius = self.first_radius(&chart, largest);
        let new = self
            .atlas
            .insert(manifold, chart, radius, parent, &mut self.work);
        self.memories.push(memory);
        self.queued.push(false);
        self.enqueue(new);
        Ok(())
    }

    /// Adds charts along a way from a chart, each seen from the one before. Whether there
    /// was a first.
    pub(super) fn add_along(&mut self, chart: usize, way: Vec<(Vec<f64>, V::Memory)>) -> bool {
        let mut parent = chart;
        for (center, memory) in way {
            let new = self.atlas.len();
            if self.add(&center, Some(parent), memory).is_err() {
                break;
            }
            parent = new;
        }
        parent != chart
    }

    /// How far a chart represents the manifold along its axes: charts that need not shrink
    /// later save cuts.
    fn first_radius(&mut self, chart: &Chart, largest: f64) -> f64 {
        let manifold = self.continuation.manifold;
        let domain = &self.continuation.options.domain;
        let mut radius = largest;
        for axis in 0..chart.dimension() {
            for sign in [1.0, -1.0] {
                let mut direction = vec![0.0; chart.dimension()];
                direction[axis] = sign;
                let Self { there, work, .. } = self;
                let reach = fit(manifold, domain, chart, &direction, radius, there, work).reach;
                if reach < radius && broken_limit(manifold, there).is_none() {
                    radius = reach.max(self.least_radius());
                }
            }
        }
        radius
    }

    fn enqueue(&mut self, chart: usize) {
        if !std::mem::replace(&mut self.queued[chart], true) {
            self.queue.push_back(chart);
        }
    }

    /// Advances until every corner of every cell is closed.
    pub(super) fn run(&mut self, go_on: &mut dyn FnMut(usize) -> bool) -> bool {
        while let Some(chart) = self.queue.pop_front() {
            self.queued[chart] = false;
            while let Some(vertex) = self.open_vertex(chart) {
                let count = self.atlas.len();
                if count >= self.continuation.options.max_charts || !go_on(count) {
                    return false;
                }
                self.advance(chart, vertex);
            }
        }
        true
    }

    /// The farthest corner of a chart's cell that is not closed.
    fn open_vertex(&self, chart: usize) -> Option<usize> {
        let vertices = self.atlas.cell(chart).vertices().iter().enumerate();
        vertices
            .filter(|(_, v)| !v.closed)
            .max_by(|(_, a), (_, b)| dot(&a.point, &a.point).total_cmp(&dot(&b.point, &b.point)))
            .map(|(i, _)| i)
    }

    /// Adds a chart in the direction of a corner outside of the radius or near it,
    /// shrinks the chart, or closes the corner.
    fn advance(&mut self, chart: usize, vertex: usize) {
        let mut reason = None;
        if self.look_around(chart, vertex, &mut reason).is_continue() {
            self.atlas.cell_mut(chart).close(vertex);
            if let Some(border) = reason {
                *self.borders.entry(border).or_default() += 1;
            }
        }
    }

    /// Gives a chart a smaller radius, about that asked for; those around it may have
    /// to reach farther. `false` where it is as small as it may be.
    pub(super) fn shrink(&mut self, chart: usize, radius: f64) -> bool {
        if !self.can_shrink(chart) {
            return false;
        }
        let now = self.atlas.radius(chart);
        let [most, little] = SHRINK;
        let radius = radius.clamp(most * now, little * now);
        self.atlas.shrink(chart, radius.max(self.least_radius()));
        let around: Vec<usize> = self.atlas.neighbours(chart).collect();
        self.enqueue(chart);
        around.into_iter().for_each(|j| self.enqueue(j));
        true
    }

    pub(super) fn can_shrink(&self, chart: usize) -> bool {
        SHRINK[1] * self.atlas.radius(chart) >= self.least_radius()
    }

    fn least_radius(&self) -> f64 {
        let domain = &self.continuation.options.domain;
        (LEAST_RADIUS * domain.radius).min(domain.error)
    }
}
