//! The atlas of a whole component, and its cells.
//!
//! # Cells without cracks
//! Each chart i with centre x_i and radius R_i owns the points y of the manifold
//! with |y − x_i|² − R_i² ≤ |y − x_j|² − R_j² for all its neighbours j: a
//! partition (a power diagram), whatever the curvature. In tangent coordinates of
//! chart i, with d = x_j − x_i = Φ t_j + n_j and y − x_i = Φ t + n, this reads
//! tᵀ t_j ≤ (|d|² + R_i² − R_j²)/2 − nᵀ n_j. The polytope takes ε |n_j| for the
//! last term, which bounds it wherever the manifold lies within ε of the tangent
//! space. So polytopes contain their cells, neighbours overlap a little where the
//! manifold is curved, and there is no crack between them. The paper's cut
//! 2 tᵀ t_j ≤ |t_j|² (Porta and Hernández-Juan 2016, eq. 18) leaves cracks of the
//! order of |n_j|².
//!
//! When all vertices of all polytopes lie within their charts' radii, the atlas
//! covers its component: a point on the rim of what is covered would lie on a
//! facet, and beyond a facet lies a cell of another chart.

use std::collections::BTreeSet;

use crate::{
    atlas::{ChartDomain, bisector, squared_distance},
    chart::{Chart, Workspace},
    continuation::index::CenterIndex,
    error::ManifoldError,
    manifold::ImplicitManifold,
    polytope::{Polytope, Vertex},
    qr::dot,
};

/// Two charts are on one sheet without further test when their normal offsets
/// agree to this fraction.
const AGREE: f64 = 0.5;
/// Points that two charts agree on lie this close together, relative to ρ.
const SAME_POINT: f64 = 1e-4;
/// A cut leaves at least this fraction of the way to the neighbour's centre.
const LEAST_CUT: f64 = 0.1;
/// Residual to which points are compared with those of a chart.
const SHEET_TOLERANCE: f64 = 1e-9;
/// Residual to which corners are put on the manifold.
const CORNER_TOLERANCE: f64 = 1e-10;
/// A neighbour that cuts the rim of a domain cuts it at this fraction of the radius
/// or nearer.
const RIM: f64 = 0.97;
/// Relative slack of tests on the border of a domain.
const ROUNDING: f64 = 1e-9;

/// A chart next to another, seen from it.
#[derive(Clone, Debug)]
pub(super) struct Neighbour {
    pub(super) chart: usize,
    /// t_j, the neighbour's centre in tangent coordinates.
    pub(super) at: Vec<f64>,
    /// |d|².
    squared_distance: f64,
}

/// Charts that cover a component of the valid part of a manifold, with their
/// polytopes; made by [`Continuation`](crate::Continuation).
#[derive(Clone, Debug)]
pub struct ComponentAtlas {
    domain: ChartDomain,
    dimension: usize,
    charts: Vec<Chart>,
    radii: Vec<f64>,
    parents: Vec<Option<usize>>,
    cells: Vec<Polytope>,
    neighbours: Vec<Vec<Neighbour>>,
    index: Option<CenterIndex>,
}

/// A corner of a cell, common to as many other cells as the manifold has
/// dimensions.
#[derive(Clone, Debug, PartialEq)]
pub struct Corner {
    /// Tangent coordinates in the chart that was asked.
    pub tangent: Vec<f64>,
    /// The point of the manifold.
    pub point: Vec<f64>,
    /// The charts whose cells meet there, in ascending order.
    pub charts: Vec<usize>,
}

impl ComponentAtlas {
    pub(super) fn new(dimension: usize, domain: ChartDomain) -> Self {
        Self {
            domain,
            dimension,
            charts: Vec::new(),
            radii: Vec::new(),
            parents: Vec::new(),
            cells: Vec::new(),
            neighbours: Vec::new(),
            index: None,
        }
    }

    /// An atlas with the given centres, radii and parents (as told by
    /// [`Self::chart`], [`Self::radius`] and [`Self::parent`]): charts and cells
    /// are built again, so that these three are all that a file must keep.
    ///
    /// # Errors
    /// [`ManifoldError`] with the number of the chart whose centre is no regular
    /// point of the manifold.
    pub fn rebuild<M: ImplicitManifold + ?Sized>(
        manifold: &M,
        dimension: usize,
        domain: ChartDomain,
        charts: impl IntoIterator<Item = (Vec<f64>, f64, Option<usize>)>,
    ) -> Result<Self, (usize, ManifoldError)> {
        let mut atlas = Self::new(dimension, domain);
        let mut work = Workspace::default();
        for (i, (center, radius, parent)) in charts.into_iter().enumerate() {
            crate::input::on_manifold(manifold, &center).map_err(|error| (i, error))?;
            let chart =
                Chart::new(manifold, &center, dimension, &mut work).map_err(|error| (i, error))?;
            atlas.insert(manifold, chart, radius, parent, &mut work);
        }
        Ok(atlas)
    }

    /// Dimension k of the manifold.
    pub fn dimension(&self) -> usize {
        self.dimension
    }

    /// How far charts reach at most.
    pub fn domain(&self) -> ChartDomain {
        self.domain
    }

    /// Number of charts.
    pub fn len(&self) -> usize {
        self.charts.len()
    }

    /// Whether there is no chart.
    pub fn is_empty(&self) -> bool {
        self.charts.is_empty()
    }

    /// The chart with the given index; its centre is a valid point.
    pub fn chart(&self, index: usize) -> &Chart {
        &self.charts[index]
    }

    /// Radius R of a chart's domain: ρ, or less where the manifold bends more.
    pub fn radius(&self, index: usize) -> f64 {
        self.radii[index]
    }

    /// The chart from which a chart was reached, by a valid way from centre to
    /// centre; none for the first.
    pub fn parent(&self, index: usize) -> Option<usize> {
        self.parents[index]
    }

    /// The polytope of a chart. Its domain is the polytope within the radius.
    pub fn cell(&self, index: usize) -> &Polytope {
        &self.cells[index]
    }

    /// Charts whose domains may touch that of a chart.
    pub fn neighbours(&self, index: usize) -> impl Iterator<Item = usize> {
        self.neighbours[index].iter().map(|n| n.chart)
    }

    /// Whether the domain of a chart ends at its radius somewhere instead of at
    /// its neighbours: in an atlas that is complete, at a border of the component.
    pub fn is_at_border(&self, index: usize) -> bool {
        let vertices = self.cells[index].vertices();
        vertices.iter().any(|v| self.is_exterior(index, v))
    }

    /// Whether a vertex of a cell lies outside of its chart's radius, or on a side
    /// of the first cube, which touches the sphere of that radius.
    pub(super) fn is_exterior(&self, index: usize, vertex: &Vertex) -> bool {
        self.is_beyond(index, &vertex.point) || self.cells[index].is_on_cube(vertex)
    }

    fn is_beyond(&self, index: usize, t: &[f64]) -> bool {
        dot(t, t) > (self.radii[index] * (1.0 + ROUNDING)).powi(2)
    }

    pub(super) fn cell_mut(&mut self, index: usize) -> &mut Polytope {
        &mut self.cells[index]
    }

    /// Adds a chart, and cuts its polytope and those of its neighbours. Cost: a cut for
    /// each chart nearby.
    pub(super) fn insert<M: ImplicitManifold + ?Sized>(
        &mut self,
        manifold: &M,
        chart: Chart,
        radius: f64,
        parent: Option<usize>,
        work: &mut Workspace,
    ) -> usize {
        let new = self.charts.len();
        let width = 2.0 * self.domain.radius;
        let index = self
            .index
            .get_or_insert_with(|| CenterIndex::new(&chart, width));
        let mut near = Vec::new();
        index.near(chart.center(), &mut near);
        index.insert(new, chart.center());
        self.charts.push(chart);
        self.radii.push(radius);
        self.parents.push(parent);
        self.cells.push(Polytope::cube(self.dimension, radius));
        self.neighbours.push(Vec::new());
        // The parent is a neighbour in any case: it was left on its own sheet.
        near.retain(|&other| Some(other) != parent);
        for other in parent.into_iter().chain(near) {
            let [from, to] = [new, other].map(|chart| self.charts[chart].center());
            let distance = squared_distance(from, to);
            let known = Some(other) == parent;
            if !known && distance > (radius + self.radii[other]).powi(2) || distance == 0.0 {
                continue;
            }
            if let Some([here, there]) = self.pair(manifold, [new, other], distance, known, work) {
                self.cut(new, &here);
                self.cut(other, &there);
                self.neighbours[new].push(here);
                self.neighbours[other].push(there);
            }
        }
        new
    }

    /// Two charts as neighbours of each other; none when they lie on different
    /// sheets of the manifold, unless they are known not to.
    ///
    /// On one sheet, each centre lies about as far off the tangent space of the
    /// other, to the same side; on parallel sheets, to opposite sides. Where this
    /// is not clear, the point halfway is put on the manifold from both sides.
    fn pair<M: ImplicitManifold + ?Sized>(
        &self,
        manifold: &M,
        [a, b]: [usize; 2],
        distance: f64,
        known: bool,
        work: &mut Workspace,
    ) -> Option<[Neighbour; 2]> {
        let seen = |from: usize, to: usize| {
            let (from, target) = (&self.charts[from], self.charts[to].center());
            let mut at = vec![0.0; self.dimension];
            from.log(target, &mut at);
            let mut offset = target.to_vec();
            let mut foot = vec![0.0; target.len()];
            from.tangent_point(&at, &mut foot);
            offset.iter_mut().zip(&foot).for_each(|(o, f)| *o -= f);
            (at, offset)
        };
        let (at_b, offset_b) = seen(a, b);
        let (at_a, offset_a) = seen(b, a);
        let sizes = [norm(&offset_b), norm(&offset_a)];
        // Steeper than this, the projections mean nothing.
        if !known && sizes[0].max(sizes[1]).powi(2) > 0.5 * distance {
            return None;
        }
        let difference = squared_distance(&offset_a, &offset_b).sqrt();
        let clear =
            known || difference <= AGREE * sizes[0].max(sizes[1]) + SAME_POINT * self.domain.radius;
        if !clear && !self.share_the_middle(manifold, [a, b], &at_a, work) {
            return None;
        }
        let neighbour = |chart, at| Neighbour {
            chart,
            at,
            squared_distance: distance,
        };
        Some([neighbour(b, at_b), neighbour(a, at_a)])
    }

    /// Whether the point halfway from chart b to chart a, where b has it, is one
    /// that chart a has too.
    fn share_the_middle<M: ImplicitManifold + ?Sized>(
        &self,
        manifold: &M,
        [a, b]: [usize; 2],
        a_from_b: &[f64],
        work: &mut Workspace,
    ) -> bool {
        let half: Vec<f64> = a_from_b.iter().map(|t| 0.5 * t).collect();
        let mut middle = vec![0.0; self.charts[a].center().len()];
        if self.charts[b]
            .exp(manifold, &half, &mut middle, SHEET_TOLERANCE, work)
            .is_err()
        {
            return false;
        }
        self.has(manifold, a, &middle, work)
    }

    /// Whether a point of the manifold is the one that a chart has above the same
    /// tangent coordinates.
    pub(super) fn has<M: ImplicitManifold + ?Sized>(
        &self,
        manifold: &M,
        index: usize,
        x: &[f64],
        work: &mut Workspace,
    ) -> bool {
        let chart = &self.charts[index];
        let mut t = vec![0.0; self.dimension];
        let mut own = vec![0.0; x.len()];
        let same =
            |own: &[f64]| squared_distance(own, x) <= (SAME_POINT * self.domain.radius).powi(2);
        chart.log(x, &mut t);
        chart
            .exp(manifold, &t, &mut own, SHEET_TOLERANCE, work)
            .is_ok()
            && same(&own)
            // Far out, iterations that start from the tangent space may fail, or end on
            // another sheet.
            || follow(chart, manifold, &t, &mut own, work) && same(&own)
    }

    /// Where the polytope of a chart ends towards a neighbour.
    fn offset(&self, index: usize, neighbour: &Neighbour) -> f64 {
        let length = dot(&neighbour.at, &neighbour.at);
        let radius = self.radii[index];
        let powers = 0.5 * (radius.powi(2) - self.radii[neighbour.chart].powi(2));
        let repaired = bisector(neighbour.squared_distance, length, self.domain.error) + powers;
        // A neighbour on the rim takes over there, however small it is: the rim
        // would be explored again and again.
        let rim = (0.5 * length + powers).max(RIM * radius * length.sqrt());
        repaired.min(rim).max(LEAST_CUT * length)
    }

    fn cut(&mut self, index: usize, neighbour: &Neighbour) {
        let offset = self.offset(index, neighbour);
        self.cells[index].cut(&neighbour.at, offset, neighbour.chart);
    }

    /// Gives a chart a smaller radius; its cell and those of its neighbours are
    /// cut anew.
    pub(super) fn shrink(&mut self, index: usize, radius: f64) {
        self.radii[index] = radius;
        let around: Vec<usize> = self.neighbours(index).collect();
        for chart in std::iter::once(index).chain(around) {
            let mut cell = Polytope::cube(self.dimension, self.radii[chart]);
            for neighbour in &self.neighbours[chart] {
                cell.cut(
                    &neighbour.at,
                    self.offset(chart, neighbour),
                    neighbour.chart,
                );
            }
            if chart != index {
                cell.keep_closed(&self.cells[chart], ROUNDING * self.radii[chart]);
            }
            self.cells[chart] = cell;
        }
    }

    /// The chart whose domain holds the point x of the manifold: within its
    /// polytope, its radius, and ε of its tangent space, and the very point that
    /// it has above these tangent coordinates. Of several the one with the nearest
    /// centre.
    pub fn covering<M: ImplicitManifold + ?Sized>(
        &self,
        manifold: &M,
        x: &[f64],
        work: &mut Workspace,
    ) -> Option<usize> {
        let mut t = vec![0.0; self.dimension];
        let mut candidates: Vec<(f64, usize)> = self
            .near(x)
            .into_iter()
            .filter(|&(distance, i)| {
                self.charts[i].log(x, &mut t);
                !self.is_beyond(i, &t)
                    && distance - dot(&t, &t) <= self.domain.error.powi(2)
                    && self.cells[i].contains(&t, ROUNDING * self.domain.radius)
            })
            .collect();
        candidates.sort_by(|a, b| a.0.total_cmp(&b.0));
        candidates
            .into_iter()
            .map(|(_, i)| i)
            .find(|&i| self.has(manifold, i, x, work))
    }

    /// Charts whose centres lie within 2ρ of x, with the squared distances.
    pub(super) fn near(&self, x: &[f64]) -> Vec<(f64, usize)> {
        let mut found = Vec::new();
        if let Some(index) = &self.index {
            index.near(x, &mut found);
        }
        found
            .into_iter()
            .map(|i| (squared_distance(x, self.charts[i].center()), i))
            .filter(|(distance, _)| *distance <= 4.0 * self.domain.radius.powi(2))
            .collect()
    }

    /// The corners of a chart's cell where it meets other cells, put on the
    /// manifold: each is the point that is equally far (in the sense of the cells)
    /// from the chart and from the k neighbours that meet there, so that neighbours
    /// agree on their common corners. Corners at the border are not among them.
    pub fn corners<M: ImplicitManifold + ?Sized>(
        &self,
        manifold: &M,
        index: usize,
        work: &mut Workspace,
    ) -> Vec<Corner> {
        let cell = &self.cells[index];
        // The vertices of the polytope are guesses: where it is a little larger
        // than the cell, another neighbour may own them.
        let mut guesses: Vec<(Vec<usize>, Vec<f64>)> = cell
            .vertices()
            .iter()
            .filter_map(|vertex| {
                let facets = vertex.facets.iter();
                let mut around = facets
                    .map(|&f| cell.facets()[f as usize].neighbour)
                    .collect::<Option<Vec<usize>>>()?;
                around.truncate(self.dimension);
                around.sort_unstable();
                Some((around, vertex.point.clone()))
            })
            .collect();
        let mut seen = BTreeSet::new();
        let mut corners = Vec::new();
        while let Some((around, start)) = guesses.pop() {
            if !seen.insert(around.clone()) {
                continue;
            }
            let Some(corner) = self.equidistant(manifold, index, &start, &around, work) else {
                continue;
            };
            match self.owner(index, &corner.point) {
                None if self.is_beyond(index, &corner.tangent) => {}
                None => corners.push(corner),
                Some(owner) if !around.contains(&owner) => {
                    for i in 0..around.len() {
                        let mut other = around.clone();
                        other[i] = owner;
                        other.sort_unstable();
                        guesses.push((other, corner.tangent.clone()));
                    }
                }
                Some(_) => {}
            }
        }
        corners
    }

    /// The neighbour whose cell a point belongs to rather than to a chart's.
    fn owner(&self, index: usize, x: &[f64]) -> Option<usize> {
        let least = self.power(index, x) - 1e3 * CORNER_TOLERANCE;
        self.neighbours[index]
            .iter()
            .map(|n| (self.power(n.chart, x), n.chart))
            .filter(|(power, _)| *power < least)
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map(|(_, chart)| chart)
    }

    /// The point that is equally far from a chart and k of its neighbours, by
    /// Newton's method with the neighbours' directions as derivative.
    fn equidistant<M: ImplicitManifold + ?Sized>(
        &self,
        manifold: &M,
        index: usize,
        start: &[f64],
        around: &[usize],
        work: &mut Workspace,
    ) -> Option<Corner> {
        const ITERATIONS: usize = 40;
        let k = self.dimension;
        let neighbours: Vec<&Neighbour> = around
            .iter()
            .filter_map(|&j| self.neighbours[index].iter().find(|n| n.chart == j))
            .collect();
        let mut t = start.to_vec();
        let mut point = vec![0.0; self.charts[index].center().len()];
        let mut system = vec![0.0; k * (k + 1)];
        for _ in 0..ITERATIONS {
            self.charts[index]
                .exp(manifold, &t, &mut point, CORNER_TOLERANCE, work)
                .ok()?;
            let own = self.power(index, &point);
            let mut miss = 0.0_f64;
            for (row, neighbour) in system.chunks_exact_mut(k + 1).zip(&neighbours) {
                row[..k].copy_from_slice(&neighbour.at);
                row[k] = 0.5 * (self.power(neighbour.chart, &point) - own);
                miss = miss.max(row[k].abs());
            }
            if miss <= CORNER_TOLERANCE {
                let mut charts = around.to_vec();
                charts.push(index);
                charts.sort_unstable();
                return Some(Corner {
                    tangent: t,
                    point,
                    charts,
                });
            }
            if !crate::chart::solve_by_elimination(&mut system, k) {
                return None;
            }
            for (t, row) in t.iter_mut().zip(system.chunks_exact(k + 1)) {
                *t += row[k];
            }
        }
        None
    }

    /// |x − x_i|² − R_i².
    fn power(&self, index: usize, x: &[f64]) -> f64 {
        squared_distance(x, self.charts[index].center()) - self.radii[index].powi(2)
    }
}

/// The point of a chart's own sheet with tangent coordinates t: along the ray from
/// the centre in short steps, each predicted from the two points before. `false`
/// where the sheet ends before.
fn follow<M: ImplicitManifold + ?Sized>(
    chart: &Chart,
    manifold: &M,
    t: &[f64],
    x: &mut [f64],
    work: &mut Workspace,
) -> bool {
    const STEPS: usize = 16;
    let mut before = vec![0.0; x.len()];
    let back: Vec<f64> = t.iter().map(|t| -t / STEPS as f64).collect();
    chart.tangent_point(&back, &mut before);
    x.copy_from_slice(chart.center());
    (0..STEPS).all(|_| {
        for (x, before) in x.iter_mut().zip(&mut before) {
            let next = 2.0 * *x - *before;
            *before = std::mem::replace(x, next);
        }
        chart.retract(manifold, x, SHEET_TOLERANCE, work).is_ok()
    })
}

fn norm(v: &[f64]) -> f64 {
    dot(v, v).sqrt()
}
