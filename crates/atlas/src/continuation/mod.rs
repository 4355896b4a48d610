//! Higher-dimensional continuation: the atlas of a whole component (Henderson
//! 2002; Porta and Hernández-Juan 2016, section 4.2).
//!
//! The first chart is built at a valid point. As long as some polytope has a
//! vertex outside of its chart's radius, there is manifold left beyond it: a new
//! chart is placed at the radius in the direction of the vertex, and cuts the
//! vertex off. Centres keep a distance of about a radius, so that their number is
//! bounded by the size of the component.
//!
//! Bounds and limits of the manifold and the validity test are borders. Centres
//! are always valid, and reached from the chart before by a valid way; where the
//! direction of a vertex leads outside, the rim of the domain around it is
//! sampled for another way on, and only when there is none is the vertex closed.
//! Up to the border, the domains of the charts next to it cover the component.
//!
//! A chart's radius shrinks where the manifold leaves its tangent space by more
//! than ε within it.
//!
//! Cost: for each chart one factorisation, about 2k to 3k + 1 validity tests, and
//! cuts of small polytopes; the number of charts grows like ρ⁻ᵏ. Made for k = 1,
//! 2, 3.

mod border;
mod component;
mod frontier;
mod index;
mod outline;
mod route;
mod walk;

use std::{
    collections::{BTreeMap, VecDeque},
    ops::ControlFlow,
};

pub use border::Border;
pub use component::{ComponentAtlas, Corner};
pub use outline::OutlinePoint;
pub use route::{Route, RouteError, RouteOptions};
pub use walk::BilliardWalk;

use crate::{
    atlas::{ChartDomain, squared_distance},
    chart::Workspace,
    error::ManifoldError,
    manifold::{ImplicitManifold, SparseRow},
    newton::dimension,
    qr::dot,
    validity::{Obstruction, Validity},
};
use border::broken_limit;
use frontier::Rim;

/// Blocked ways are tried again in steps of this fraction of the stride.
const FINER: f64 = 0.25;
/// Residual at which points at a border are looked at.
const ROUGH: f64 = 1e-5;
/// Halvings of the angle between samples of a rim where it may open.
const CLOSER: usize = 4;
/// A radius shrinks by this factor.
const SHRINK: f64 = 0.7;
/// Radii do not shrink below this fraction of ρ, or ε where that is less.
const LEAST_RADIUS: f64 = 0.1;
/// A chart's first radius is at most this multiple of that of its parent.
const GROWTH: f64 = 1.3;

/// Parameters of a [`Continuation`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct ContinuationOptions {
    /// How far charts reach.
    pub domain: ChartDomain,
    /// Residual below which the equations hold.
    pub tolerance: f64,
    /// Charts after which the continuation is given up.
    pub max_charts: usize,
    /// Longest step, in tangent coordinates, that validity is tested over; a quarter
    /// of it where that does not suffice.
    pub stride: f64,
    /// Angle, in radians, between the directions in which the rim of a domain is
    /// searched for a way on, before a border is taken for closed.
    pub rim_angle: f64,
}

impl Default for ContinuationOptions {
    fn default() -> Self {
        Self {
            domain: ChartDomain::default(),
            tolerance: 1e-9,
            max_charts: 100_000,
            stride: 0.2,
            rim_angle: 0.2,
        }
    }
}

/// Why there is no atlas.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ContinuationError {
    /// The first point is no regular point of the manifold.
    #[error("the start is not a regular point of the manifold: {0}")]
    Manifold(#[from] ManifoldError),
    /// The first point is outside of the component.
    #[error("the start is not valid: {0}")]
    Invalid(String),
    /// The manifold is a point, or has too many dimensions.
    #[error("the manifold has dimension {0}: {advice}", advice = advice(*.0))]
    Dimension(usize),
}

fn advice(dimension: usize) -> String {
    match dimension {
        0 => "the start is an isolated point, and there is nothing to explore".to_owned(),
        _ => format!(
            "continuation explores dimensions up to {MAX_DIMENSION}; a sampling-based planner does \
             not depend on it"
        ),
    }
}

/// Largest dimension explored: polytopes start with 2ᵏ vertices.
const MAX_DIMENSION: usize = 6;

/// What a continuation found.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Exploration {
    /// The atlas.
    pub atlas: ComponentAtlas,
    /// Whether nothing is left to explore.
    pub complete: bool,
    /// Directions in which the component ends, by what ends it.
    pub borders: BTreeMap<Border, usize>,
    /// Ways from a centre whose validity was tested.
    pub validity_tests: usize,
    /// Projections onto the manifold.
    pub projections: usize,
}

/// Explores the component of the valid part of a manifold that a point lies on.
///
/// # Examples
/// ```
/// use tensegra_atlas::{Continuation, ContinuationOptions, Everywhere, doc::Sphere};
/// let sphere = Sphere::new();
/// let found = Continuation::new(&sphere, &Everywhere, ContinuationOptions::default())
///     .explore(&[0.0, 0.0, 1.0], &mut |_| true)?;
/// assert!(found.complete && found.borders.is_empty());
/// assert!((60..300).contains(&found.atlas.len()));
/// # Ok::<(), tensegra_atlas::ContinuationError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Continuation<'a, M: ?Sized, V> {
    manifold: &'a M,
    validity: &'a V,
    options: ContinuationOptions,
}

impl<'a, M: ImplicitManifold + ?Sized, V: Validity> Continuation<'a, M, V> {
    /// A continuation with the given options.
    pub fn new(manifold: &'a M, validity: &'a V, options: ContinuationOptions) -> Self {
        Self {
            manifold,
            validity,
            options,
        }
    }

    /// Explores from `start`, a valid point of the manifold. `go_on` is asked
    /// before each chart with the number of charts so far; when it says no, the
    /// atlas is returned as it is.
    ///
    /// # Errors
    /// [`ContinuationError`] when the start will not do.
    pub fn explore(
        &self,
        start: &[f64],
        go_on: &mut dyn FnMut(usize) -> bool,
    ) -> Result<Exploration, ContinuationError> {
        crate::input::on_manifold(self.manifold, start)?;
        let k = dimension(self.manifold, start);
        if !(1..=MAX_DIMENSION).contains(&k) {
            return Err(ContinuationError::Dimension(k));
        }
        if let Some((border, _)) = broken_limit(self.manifold, start) {
            let border = border.name(self.manifold);
            return Err(ContinuationError::Invalid(format!("it exceeds {border}")));
        }
        if !self.validity.is_valid(start) {
            return Err(ContinuationError::Invalid("it is in collision".to_owned()));
        }
        let mut front = Front::new(self, k);
        let mut memory = self.validity.memory();
        self.validity.enter(start, &mut memory);
        front.add(start, None, memory)?;
        let complete = front.run(go_on);
        Ok(Exploration {
            complete,
            borders: front.borders,
            validity_tests: front.tests,
            projections: front.work.projections,
            atlas: front.atlas,
        })
    }
}

/// What lies in a direction from a centre.
enum Outlook {
    /// A valid point, in `Front::there` and `Front::memory_there`.
    Open,
    /// The component ends before; with the value of the limit or contact there,
    /// where there is one: it is broken less, the larger this is.
    Ends(Border, f64),
    /// The chart does not represent the manifold there.
    Poor,
}

/// The state of a continuation.
struct Front<'p, M: ?Sized, V: Validity> {
    continuation: &'p Continuation<'p, M, V>,
    atlas: ComponentAtlas,
    /// What validity remembers of each centre.
    memories: Vec<V::Memory>,
    queue: VecDeque<usize>,
    queued: Vec<bool>,
    borders: BTreeMap<Border, usize>,
    tests: usize,
    work: Workspace,
    there: Vec<f64>,
    memory_there: V::Memory,
    memory_before: V::Memory,
    /// The contact last found violated, and scratch for its gradient.
    last_contact: Option<usize>,
    row: SparseRow,
}

/// A direction in which the component ends, and the value of what ends it.
type Sample<'r> = (&'r Vec<f64>, f64);

impl<'p, M: ImplicitManifold + ?Sized, V: Validity> Front<'p, M, V> {
    fn new(continuation: &'p Continuation<'p, M, V>, dimension: usize) -> Self {
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

    fn add(
        &mut self,
        center: &[f64],
        parent: Option<usize>,
        memory: V::Memory,
    ) -> Result<(), ManifoldError> {
        let largest = self.continuation.options.domain.radius;
        let radius = parent.map_or(largest, |p| largest.min(GROWTH * self.atlas.radius(p)));
        let manifold = self.continuation.manifold;
        let new = self
            .atlas
            .insert(manifold, center, radius, parent, &mut self.work)?;
        self.memories.push(memory);
        self.queued.push(false);
        self.enqueue(new);
        Ok(())
    }

    fn enqueue(&mut self, chart: usize) {
        if !std::mem::replace(&mut self.queued[chart], true) {
            self.queue.push_back(chart);
        }
    }

    /// Advances until no polytope has an open vertex outside of its radius.
    fn run(&mut self, go_on: &mut dyn FnMut(usize) -> bool) -> bool {
        while let Some(chart) = self.queue.pop_front() {
            self.queued[chart] = false;
            while let Some(vertex) = self.open_vertex(chart) {
                let count = self.atlas.len();
                if count >= self.continuation.options.max_charts || !go_on(count) {
                    return false;
                }
                self.advance(chart, vertex);
            }
            if self.bends_within(chart) {
                self.shrink(chart);
                self.enqueue(chart);
            }
        }
        true
    }

    /// Whether the manifold leaves the tangent space of a chart by more than ε at a
    /// corner of its cell within its radius, where no direction was looked in.
    fn bends_within(&mut self, chart: usize) -> bool {
        let manifold = self.continuation.manifold;
        let error = self.continuation.options.domain.error;
        if !self.can_shrink(chart) {
            return false;
        }
        let Self {
            atlas, there, work, ..
        } = self;
        let (here, x) = (atlas.chart(chart), there);
        let vertices = atlas.cell(chart).vertices().iter();
        vertices.filter(|v| !atlas.is_exterior(chart, v)).any(|v| {
            here.exp(manifold, &v.point, x, ROUGH, work).is_ok()
                && squared_distance(x, here.center()) - dot(&v.point, &v.point) > error.powi(2)
                && broken_limit(manifold, x).is_none()
        })
    }

    fn can_shrink(&self, chart: usize) -> bool {
        let domain = &self.continuation.options.domain;
        let least = (LEAST_RADIUS * domain.radius).min(domain.error);
        SHRINK * self.atlas.radius(chart) >= least
    }

    /// Gives a chart a smaller radius; those around it may have to reach farther.
    fn shrink(&mut self, chart: usize) {
        self.atlas.shrink(chart, SHRINK * self.atlas.radius(chart));
        let around: Vec<usize> = self.atlas.neighbours(chart).collect();
        around.into_iter().for_each(|j| self.enqueue(j));
    }

    /// The farthest vertex of a chart that is outside of its radius and not
    /// closed.
    fn open_vertex(&self, chart: usize) -> Option<usize> {
        let vertices = self.atlas.cell(chart).vertices().iter().enumerate();
        vertices
            .filter(|(_, v)| !v.closed && self.atlas.is_exterior(chart, v))
            .max_by(|(_, a), (_, b)| dot(&a.point, &a.point).total_cmp(&dot(&b.point, &b.point)))
            .map(|(i, _)| i)
    }

    /// Adds a chart in the direction of a vertex or near it, shrinks the chart,
    /// or closes the vertex.
    fn advance(&mut self, chart: usize, vertex: usize) {
        let cell = self.atlas.cell(chart);
        let radius = self.atlas.radius(chart);
        let rim = frontier::rim(cell, vertex, radius, self.continuation.options.rim_angle);
        let mut reason = None;
        if self.search_rim(chart, &rim, &mut reason).is_continue() {
            self.atlas.cell_mut(chart).close(vertex);
            let border = reason.unwrap_or(Border::Curvature);
            *self.borders.entry(border).or_default() += 1;
        }
    }

    /// Looks along the rim for a way on: at the samples, and then more closely where
    /// the border recedes most between them.
    fn search_rim(
        &mut self,
        chart: usize,
        rim: &Rim,
        reason: &mut Option<Border>,
    ) -> ControlFlow<()> {
        let vertex = self.attempt(chart, &rim.vertex, true, reason)?;
        let mut arms = Vec::with_capacity(rim.arms.len());
        for arm in &rim.arms {
            arms.push(self.attempt_all(chart, arm, reason)?);
        }
        for arc in &rim.between {
            let values = self.attempt_all(chart, arc, reason)?;
            let samples: Vec<Sample> = arc.iter().zip(values).collect();
            self.look_closely(chart, &samples, reason)?;
        }
        for (i, a) in arms.iter().enumerate() {
            for (j, b) in arms.iter().enumerate().skip(i + 1) {
                let there = rim.arms[i].iter().zip(a.iter().copied()).rev();
                let back = rim.arms[j].iter().zip(b.iter().copied());
                let samples: Vec<Sample> =
                    there.chain([(&rim.vertex, vertex)]).chain(back).collect();
                self.look_closely(chart, &samples, reason)?;
            }
        }
        ControlFlow::Continue(())
    }

    fn attempt_all(
        &mut self,
        chart: usize,
        directions: &[Vec<f64>],
        reason: &mut Option<Border>,
    ) -> ControlFlow<(), Vec<f64>> {
        let mut values = Vec::with_capacity(directions.len());
        for direction in directions {
            values.push(self.attempt(chart, direction, false, reason)?);
        }
        ControlFlow::Continue(values)
    }

    /// Halves the angle between samples about each that is broken less than those
    /// next to it, as long as the value may reach zero in between: were it concave,
    /// it would rise on one side of the sample by no more than it falls on the other.
    fn look_closely(
        &mut self,
        chart: usize,
        samples: &[Sample],
        reason: &mut Option<Border>,
    ) -> ControlFlow<()> {
        for triple in samples.windows(3) {
            let [mut left, mut top, mut right] =
                [0, 1, 2].map(|i| (triple[i].0.clone(), triple[i].1));
            for _ in 0..CLOSER {
                let rise = top.1 - left.1.min(right.1);
                let peaks = top.1 >= left.1.max(right.1);
                if !peaks || !rise.is_finite() || top.1 + rise < 0.0 {
                    break;
                }
                for side in [&mut left, &mut right] {
                    let direction = frontier::middle(&side.0, &top.0);
                    let value = self.attempt(chart, &direction, false, reason)?;
                    let middle = (direction, value);
                    *side = if value > top.1 {
                        std::mem::replace(&mut top, middle)
                    } else {
                        middle
                    };
                }
            }
        }
        ControlFlow::Continue(())
    }

    /// Looks in a direction. Adds a chart if there is a way on; shrinks the chart
    /// if it does not represent the manifold there and this is the direction
    /// of the vertex. Otherwise tells how far the border's limit is broken.
    fn attempt(
        &mut self,
        chart: usize,
        direction: &[f64],
        is_vertex: bool,
        reason: &mut Option<Border>,
    ) -> ControlFlow<(), f64> {
        match self.look(chart, direction) {
            Outlook::Open => {
                let center = self.there.clone();
                let memory = self.memory_there.clone();
                match self.add(&center, Some(chart), memory) {
                    Ok(()) => return ControlFlow::Break(()),
                    Err(_) => *reason = reason.or(Some(Border::Singular)),
                }
            }
            Outlook::Ends(border, value) => {
                *reason = reason.or(Some(border));
                return ControlFlow::Continue(value);
            }
            // Elsewhere, the vertex that is nearer will tell.
            Outlook::Poor if is_vertex => {
                if self.can_shrink(chart) {
                    self.shrink(chart);
                    return ControlFlow::Break(());
                }
                *reason = Some(Border::Curvature);
            }
            Outlook::Poor => {}
        }
        ControlFlow::Continue(f64::NEG_INFINITY)
    }

    /// What lies at the radius of a chart in a direction (of length 1): roughly
    /// first, since most looks end at a border.
    fn look(&mut self, chart: usize, direction: &[f64]) -> Outlook {
        let tolerance = self.continuation.options.tolerance;
        match self.look_within(chart, direction, tolerance.max(ROUGH)) {
            Outlook::Open => self.look_within(chart, direction, tolerance),
            outlook => outlook,
        }
    }

    fn look_within(&mut self, chart: usize, direction: &[f64], tolerance: f64) -> Outlook {
        let radius = self.atlas.radius(chart);
        let options = &self.continuation.options;
        let manifold = self.continuation.manifold;
        let here = self.atlas.chart(chart);
        let at = |s: f64| -> Vec<f64> { direction.iter().map(|d| s * radius * d).collect() };
        let mut x = std::mem::take(&mut self.there);
        let represented = here
            .exp(manifold, &at(1.0), &mut x, tolerance, &mut self.work)
            .is_ok()
            && {
                let square = squared_distance(&x, here.center());
                square - radius * radius <= options.domain.error.powi(2)
                    && radius >= options.domain.cosine * square.sqrt()
            };
        let outlook = if represented {
            match broken_limit(manifold, &x) {
                Some((border, value)) => Outlook::Ends(border, value),
                None => match self.contact_at(chart, &x) {
                    Some((contact, value)) => Outlook::Ends(Border::Contact(contact), value),
                    None => self.go(chart, &x, tolerance),
                },
            }
        } else {
            // Beyond a border the manifold may be anything.
            let mut middle = vec![0.0; x.len()];
            let ends = here
                .exp(manifold, &at(0.5), &mut middle, tolerance, &mut self.work)
                .ok()
                .and_then(|()| broken_limit(manifold, &middle));
            ends.map_or(Outlook::Poor, |(border, _)| {
                Outlook::Ends(border, f64::NEG_INFINITY)
            })
        };
        self.there = x;
        outlook
    }

    /// A contact violated at x, reached from a chart, and its value.
    fn contact_at(&mut self, chart: usize, x: &[f64]) -> Option<(usize, f64)> {
        // Along a rim it is mostly the same one.
        if let Some(contact) = self.last_contact {
            let value = self.contact_value(contact, x);
            if value < 0.0 {
                return Some((contact, value));
            }
        }
        let (from, there) = (&self.memories[chart], &mut self.memory_there);
        let mut violated = Vec::new();
        // Without points between, only the end is judged.
        let validity = self.continuation.validity;
        let _ = validity.step(from, x, there, &mut |_, _| false, &mut violated);
        self.last_contact = violated.first().copied();
        let contact = self.last_contact?;
        Some((contact, self.contact_value(contact, x)))
    }

    fn contact_value(&mut self, contact: usize, x: &[f64]) -> f64 {
        let (memory, row) = (&mut self.memory_there, &mut self.row);
        row.clear();
        let value = self.continuation.validity.contact(contact, x, memory, row);
        value.unwrap_or(f64::NEG_INFINITY)
    }

    /// Tests the way from the centre of a chart to x, straight in tangent
    /// coordinates. Where long steps do not show it to be free, short ones may.
    fn go(&mut self, chart: usize, x: &[f64], tolerance: f64) -> Outlook {
        let stride = self.continuation.options.stride;
        match self.go_in_steps(chart, x, tolerance, stride) {
            Outlook::Ends(Border::Blocked, _) => {
                self.go_in_steps(chart, x, tolerance, FINER * stride)
            }
            outlook => outlook,
        }
    }

    fn go_in_steps(&mut self, chart: usize, x: &[f64], tolerance: f64, stride: f64) -> Outlook {
        self.tests += 1;
        let Continuation {
            manifold, validity, ..
        } = *self.continuation;
        let here = self.atlas.chart(chart);
        let radius = self.atlas.radius(chart);
        let steps = (radius / stride).ceil().max(1.0) as usize;
        let mut from = vec![0.0; x.len()];
        let mut to = here.center().to_vec();
        let mut violated = Vec::new();
        for step in 1..=steps {
            from.copy_from_slice(&to);
            let s = step as f64 / steps as f64;
            if step == steps {
                to.copy_from_slice(x);
            } else {
                interpolate(here.center(), x, s, &mut to);
                if here
                    .retract(manifold, &mut to, tolerance, &mut self.work)
                    .is_err()
                {
                    return Outlook::Poor;
                }
                if let Some((border, _)) = broken_limit(manifold, &to) {
                    return Outlook::Ends(border, f64::NEG_INFINITY);
                }
            }
            let memory = if step == 1 {
                &self.memories[chart]
            } else {
                std::mem::swap(&mut self.memory_before, &mut self.memory_there);
                &self.memory_before
            };
            let work = &mut self.work;
            let mut between = |s: f64, y: &mut [f64]| {
                interpolate(&from, &to, s, y);
                here.retract(manifold, y, tolerance, work).is_ok()
            };
            violated.clear();
            match validity.step(
                memory,
                &to,
                &mut self.memory_there,
                &mut between,
                &mut violated,
            ) {
                Ok(()) => {}
                Err(Obstruction::Contacts) => {
                    let contact = violated.first().copied();
                    let border = contact.map_or(Border::Blocked, Border::Contact);
                    return Outlook::Ends(border, f64::NEG_INFINITY);
                }
                Err(Obstruction::Blocked) => {
                    return Outlook::Ends(Border::Blocked, f64::NEG_INFINITY);
                }
            }
        }
        Outlook::Open
    }
}

/// y = a + s (b − a).
fn interpolate(a: &[f64], b: &[f64], s: f64, y: &mut [f64]) {
    for ((y, a), b) in y.iter_mut().zip(a).zip(b) {
        *y = a + s * (b - a);
    }
}
