//! Atlases: sets of charts whose domains are coordinated.
//!
//! The domain of a chart is a ball of radius ρ cut by half-spaces, one for each
//! neighbouring chart: 2 tᵀ t_j ≤ |t_j|², with t_j the neighbour's centre in
//! the coordinates of the chart (Porta and Hernández-Juan 2016, figure 4). Where
//! the manifold bends, such cuts would leave cracks between neighbours: they are
//! moved outwards by as much as it takes. Adding a chart costs one chart and a scan
//! over the centres.
//!
//! Polytopes with explicit vertices, for manifolds of few dimensions, are those
//! of [`ComponentAtlas`](crate::ComponentAtlas).

use crate::{
    chart::{Chart, ProjectionFailed, Workspace},
    error::ManifoldError,
    manifold::ImplicitManifold,
    packed::PackedPoints,
    qr::dot,
};

/// How far a chart reaches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChartDomain {
    /// Radius ρ of a chart in tangent coordinates.
    pub radius: f64,
    /// Largest distance ε between tangent space and manifold.
    pub error: f64,
    /// A step in tangent space must be at least this fraction of the step on
    /// the manifold (1 − CE; cos α in the paper).
    pub cosine: f64,
}

impl Default for ChartDomain {
    fn default() -> Self {
        Self {
            radius: 0.4,
            error: 0.1,
            cosine: 0.9,
        }
    }
}

/// A half-space of tangent coordinates, tᵀ normal ≤ offset, beyond which the
/// neighbour's chart takes over.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cut<'a> {
    /// The neighbour's centre in tangent coordinates, t_j.
    pub normal: &'a [f64],
    /// |t_j|² / 2, and a little more where the manifold bends.
    pub offset: f64,
    /// The neighbour.
    pub neighbour: usize,
}

/// The half-spaces of one chart, one after the other.
#[derive(Clone, Debug, Default)]
struct Cuts {
    normals: Vec<f64>,
    /// Offset and neighbour of each.
    ends: Vec<(f64, u32)>,
}

impl Cuts {
    fn push(&mut self, cut: &Cut<'_>) {
        self.normals.extend_from_slice(cut.normal);
        self.ends.push((cut.offset, cut.neighbour as u32));
    }

    fn iter(&self, dimension: usize) -> impl ExactSizeIterator<Item = Cut<'_>> {
        let normals = self.normals.chunks_exact(dimension.max(1));
        normals
            .zip(&self.ends)
            .map(|(normal, &(offset, neighbour))| Cut {
                normal,
                offset,
                neighbour: neighbour as usize,
            })
    }
}

/// A set of charts.
#[derive(Clone, Debug)]
pub struct Atlas {
    domain: ChartDomain,
    dimension: usize,
    charts: Vec<Chart>,
    centers: PackedPoints,
    cuts: Vec<Cuts>,
}

impl Atlas {
    /// An atlas without charts, for a manifold of the given dimension k.
    pub fn new(dimension: usize, domain: ChartDomain) -> Self {
        Self {
            domain,
            dimension,
            charts: Vec::new(),
            centers: PackedPoints::new(0),
            cuts: Vec::new(),
        }
    }

    /// Dimension k of the manifold.
    pub fn dimension(&self) -> usize {
        self.dimension
    }

    /// How far charts reach.
    pub fn domain(&self) -> ChartDomain {
        self.domain
    }

    /// Number of charts.
    pub fn len(&self) -> usize {
        self.charts.len()
    }

    /// Whether there is no chart yet.
    pub fn is_empty(&self) -> bool {
        self.charts.is_empty()
    }

    /// The chart with the given index.
    pub fn chart(&self, index: usize) -> &Chart {
        &self.charts[index]
    }

    /// The half-spaces that bound a chart against its neighbours.
    pub fn cuts(&self, index: usize) -> impl ExactSizeIterator<Item = Cut<'_>> {
        self.cuts[index].iter(self.dimension)
    }

    /// Adds a chart at a point of the manifold and cuts its domain and those of
    /// its neighbours against each other. Returns its index.
    ///
    /// Neighbours are charts whose centres lie within 2ρ of each other in both
    /// tangent spaces and within 2ε of them, so that other sheets of the
    /// manifold that pass nearby do not count.
    ///
    /// # Errors
    /// [`ManifoldError::Singular`] at a singular point.
    pub fn add<M: ImplicitManifold + ?Sized>(
        &mut self,
        manifold: &M,
        center: &[f64],
        work: &mut Workspace,
    ) -> Result<usize, ManifoldError> {
        let chart = Chart::new(manifold, center, self.dimension, work)?;
        let index = self.charts.len();
        let reach = 2.0 * self.domain.radius.hypot(self.domain.error);
        let mut cuts = Cuts::default();
        let mut normals = vec![0.0; 2 * self.dimension];
        let (normal, opposite_normal) = normals.split_at_mut(self.dimension);
        if self.is_empty() {
            self.centers = PackedPoints::new(center.len());
        }
        self.centers.within(center, reach, &mut work.near);
        for &(j, distance) in &work.near {
            if distance == 0.0 {
                continue;
            }
            let other = &self.charts[j];
            chart.log(other.center(), normal);
            other.log(center, opposite_normal);
            let cut = self.cut(normal, distance, j);
            let opposite = self.cut(opposite_normal, distance, index);
            if let (Some(cut), Some(opposite)) = (cut, opposite) {
                cuts.push(&cut);
                self.cuts[j].push(&opposite);
            }
        }
        self.centers.push(center);
        self.charts.push(chart);
        self.cuts.push(cuts);
        Ok(index)
    }

    /// The half-space that bounds a chart against a neighbour whose centre has the
    /// tangent coordinates `normal`, unless that is too far.
    fn cut<'a>(&self, normal: &'a [f64], distance: f64, neighbour: usize) -> Option<Cut<'a>> {
        let length = dot(normal, normal);
        let near = length < 4.0 * self.domain.radius.powi(2)
            && distance - length <= 4.0 * self.domain.error.powi(2);
        near.then(|| Cut {
            offset: bisector(distance, length, self.domain.error),
            normal,
            neighbour,
        })
    }

    /// Whether tangent coordinates lie within the half-spaces of a chart.
    pub fn inside_cuts(&self, index: usize, t: &[f64]) -> bool {
        self.cuts(index).all(|cut| dot(cut.normal, t) <= cut.offset)
    }

    /// The neighbour whose half-space the tangent coordinates violate the most.
    pub fn crossed_into(&self, index: usize, t: &[f64]) -> Option<usize> {
        let mut worst = (0.0, None);
        for cut in self.cuts(index) {
            let excess = dot(cut.normal, t) - cut.offset;
            if excess > worst.0 {
                worst = (excess, Some(cut.neighbour));
            }
        }
        worst.1
    }

    /// Whether the chart represents the point x of the manifold well: within ρ
    /// in tangent coordinates `t` and within ε of the tangent space.
    pub fn represents(&self, index: usize, x: &[f64], t: &[f64]) -> bool {
        let length = dot(t, t);
        length <= self.domain.radius.powi(2)
            && squared_distance(x, self.charts[index].center()) - length
                <= self.domain.error.powi(2)
    }

    /// Exponential map of a chart; see [`Chart::exp`].
    ///
    /// # Errors
    /// As [`Chart::exp`].
    pub fn exp<M: ImplicitManifold + ?Sized>(
        &self,
        manifold: &M,
        index: usize,
        t: &[f64],
        x: &mut [f64],
        tolerance: f64,
        work: &mut Workspace,
    ) -> Result<(), ProjectionFailed> {
        self.charts[index].exp(manifold, t, x, tolerance, work)
    }
}

/// Where a chart's domain ends towards a neighbour so that no crack is left.
///
/// Points y halfway between two centres, at the distance d = Φ t_j + n_j, fulfil
/// (y − x_i)ᵀ d = |d|²/2. In tangent coordinates, with y − x_i = Φ t + n, this is
/// tᵀ t_j = |d|²/2 − nᵀ n_j, and −nᵀ n_j is at most ε |n_j| as long as the manifold
/// stays within ε of the tangent space. Given |d|² and |t_j|², this is the largest
/// tᵀ t_j of any point halfway.
pub(crate) fn bisector(squared_distance: f64, squared_length: f64, error: f64) -> f64 {
    let normal_offset = (squared_distance - squared_length).max(0.0).sqrt();
    0.5 * squared_distance + error * normal_offset
}

/// |a − b|².
pub(crate) fn squared_distance(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 4];
    let (a4, b4) = (a.chunks_exact(4), b.chunks_exact(4));
    let rest: f64 = a4
        .remainder()
        .iter()
        .zip(b4.remainder())
        .map(|(x, y)| (x - y) * (x - y))
        .sum();
    for (x, y) in a4.zip(b4) {
        for i in 0..4 {
            let d = x[i] - y[i];
            sums[i] += d * d;
        }
    }
    (sums[0] + sums[2]) + (sums[1] + sums[3]) + rest
}
