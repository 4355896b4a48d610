//! The path that is smoothed: points with their charts, and its mesh.

use tensegra_atlas::{Chart, ImplicitManifold, ManifoldError, Validity, Workspace};

use crate::{
    shortcut::{cumulated, length},
    tree::squared_distance,
    walk::interpolate,
};

/// Residual of the points.
pub(super) const TOLERANCE: f64 = 1e-12;
/// New meshes aim at this fraction of the longest step and displacement allowed.
const AIM: f64 = 0.92;
/// Where some segments are too long, those beyond this fraction of what is allowed are
/// split too: they would be the next.
const NEARLY: f64 = 0.99;
/// Fractions of a segment that are constrained, at most.
const MOST_FRACTIONS: usize = 31;
/// Segments with as many need wider margins too, up to so many times the usual one.
const MANY_FRACTIONS: usize = 15;
const WIDEST: f64 = 8.0;
/// Parameter steps are at least this fraction of their mean.
const LEAST_WIDTH: f64 = 0.25;
/// Fewest segments of a path.
const FEWEST_SEGMENTS: usize = 8;

/// Points from start to goal. The inner ones have charts.
#[derive(Clone, Debug)]
pub(super) struct Chain {
    pub(super) points: Vec<Vec<f64>>,
    /// Of the inner points: the i-th is that of point i + 1.
    pub(super) charts: Vec<Chart>,
    /// Parameter steps of the segments; they add up to one.
    pub(super) widths: Vec<f64>,
    /// How many fractions of each segment are constrained.
    pub(super) fractions: Vec<usize>,
    /// The margin of the contacts on each segment, as a multiple of the usual one.
    pub(super) margins: Vec<f64>,
    pub(super) dimension: usize,
    work: Workspace,
}

impl Chain {
    /// A coarse path through some of the given points, about `step` apart.
    ///
    /// # Errors
    /// The point that has no chart, and why.
    pub(super) fn sampled<M: ImplicitManifold + ?Sized>(
        manifold: &M,
        dimension: usize,
        given: &[Vec<f64>],
        step: f64,
        segments: std::ops::RangeInclusive<usize>,
    ) -> Result<Self, (usize, ManifoldError)> {
        let lengths = cumulated(given);
        let whole = lengths[lengths.len() - 1];
        let segments = ((whole / step).ceil() as usize)
            .clamp(*segments.start(), *segments.end())
            .max(FEWEST_SEGMENTS);
        let mut work = Workspace::default();
        let mut points = vec![given[0].clone()];
        let mut charts: Vec<Chart> = Vec::new();
        for i in 1..segments {
            let at = whole * i as f64 / segments as f64;
            let after = lengths
                .partition_point(|&l| l < at)
                .clamp(1, given.len() - 1);
            let near = if lengths[after] - at < at - lengths[after - 1] {
                after
            } else {
                after - 1
            };
            let moved = charts.last().and_then(|chart| {
                let mut moved = chart.clone();
                moved
                    .recenter(manifold, &given[near], &mut work)
                    .then_some(moved)
            });
            let chart = match moved {
                Some(moved) => moved,
                None => Chart::new(manifold, &given[near], dimension, &mut work)
                    .map_err(|error| (near, error))?,
            };
            // Between two points of the path, where that is a point too.
            let width = lengths[after] - lengths[after - 1];
            let mut x = given[near].clone();
            if width > 0.0 {
                let s = (at - lengths[after - 1]) / width;
                interpolate(&given[after - 1], &given[after], s, &mut x);
                if chart
                    .retract(manifold, &mut x, TOLERANCE, &mut work)
                    .is_err()
                {
                    x.copy_from_slice(&given[near]);
                }
            }
            points.push(x);
            charts.push(chart);
        }
        points.push(given[given.len() - 1].clone());
        let mut chain = Self {
            points,
            charts,
            widths: vec![1.0 / segments as f64; segments],
            fractions: vec![1; segments],
            margins: vec![1.0; segments],
            dimension,
            work,
        };
        chain.center(manifold).map_err(|error| (0, error))?;
        Ok(chain)
    }

    /// Puts every chart about its point.
    pub(super) fn center<M: ImplicitManifold + ?Sized>(
        &mut self,
        manifold: &M,
    ) -> Result<(), ManifoldError> {
        let inner = self.points.iter().skip(1);
        for (chart, x) in self.charts.iter_mut().zip(inner) {
            if chart.center() != x && !chart.recenter(manifold, x, &mut self.work) {
                *chart = Chart::new(manifold, x, self.dimension, &mut self.work)?;
            }
        }
        Ok(())
    }

    pub(super) fn segments(&self) -> usize {
        self.widths.len()
    }

    pub(super) fn length(&self) -> f64 {
        length(&self.points)
    }

    /// ½ Σ |xᵢ₊₁ − xᵢ|² / hᵢ of the chain with these points in place of its own.
    pub(super) fn energy(&self, points: &[Vec<f64>]) -> f64 {
        points
            .windows(2)
            .zip(&self.widths)
            .map(|(pair, width)| 0.5 * squared_distance(&pair[0], &pair[1]) / width)
            .sum()
    }

    /// Gives each segment a parameter step in proportion to its length, as far as
    /// that is not too short: the energy becomes the least for the points where
    /// they are, ½ length².
    pub(super) fn respace(&mut self) {
        let lengths = self
            .points
            .windows(2)
            .map(|pair| squared_distance(&pair[0], &pair[1]).sqrt());
        for (width, length) in self.widths.iter_mut().zip(lengths) {
            *width = length;
        }
        let mean = self.widths.iter().sum::<f64>() / self.widths.len() as f64;
        let least = (LEAST_WIDTH * mean).max(f64::MIN_POSITIVE);
        self.widths
            .iter_mut()
            .for_each(|width| *width = width.max(least));
        let sum: f64 = self.widths.iter().sum();
        self.widths.iter_mut().for_each(|width| *width /= sum);
    }

    /// The chart that serves a segment.
    pub(super) fn chart_of_segment(&self, segment: usize) -> &Chart {
        &self.charts[segment.saturating_sub(1)]
    }

    /// How many steps of at most `step` and displacements of at most
    /// `displacement` each segment should be.
    fn needed<V: Validity>(&self, validity: &V, step: f64, displacement: f64) -> Vec<f64> {
        self.points
            .windows(2)
            .map(|pair| {
                let length = squared_distance(&pair[0], &pair[1]).sqrt();
                (length / step).max(validity.displacement(&pair[0], &pair[1]) / displacement)
            })
            .collect()
    }

    /// Splits the segments that are longer than `step` or move points farther
    /// than `displacement` into halves; returns how many there are.
    ///
    /// # Errors
    /// A segment between whose ends no point of the manifold was found: the path is
    /// torn there.
    pub(super) fn split<M: ImplicitManifold + ?Sized, V: Validity>(
        &mut self,
        manifold: &M,
        validity: &V,
        step: f64,
        displacement: f64,
    ) -> Result<usize, usize> {
        let needed = self.needed(validity, step, displacement);
        if needed.iter().all(|&n| n <= 1.0) {
            return Ok(0);
        }
        let long: Vec<usize> = (0..needed.len()).filter(|&i| needed[i] > NEARLY).collect();
        self.halve(manifold, &long)?;
        Ok(long.len())
    }

    /// Splits some segments, in ascending order, into halves.
    ///
    /// # Errors
    /// As [`Chain::split`].
    pub(super) fn halve<M: ImplicitManifold + ?Sized>(
        &mut self,
        manifold: &M,
        segments: &[usize],
    ) -> Result<(), usize> {
        for &segment in segments.iter().rev() {
            let (x, chart) = self.between(manifold, segment, 0.5).ok_or(segment)?;
            self.points.insert(segment + 1, x);
            self.charts.insert(segment, chart);
            let half = 0.5 * self.widths[segment];
            self.widths[segment] = half;
            self.widths.insert(segment + 1, half);
            let fractions = (self.fractions[segment] / 2).max(1);
            self.fractions[segment] = fractions;
            self.fractions.insert(segment + 1, fractions);
            self.margins.insert(segment + 1, self.margins[segment]);
        }
        if !segments.is_empty() {
            self.respace();
        }
        Ok(())
    }

    /// Of some segments those with as many constrained fractions as may be.
    pub(super) fn closely_watched(&self, segments: &[usize]) -> Vec<usize> {
        let watched = |&segment: &usize| self.fractions[segment] >= MOST_FRACTIONS;
        segments.iter().copied().filter(watched).collect()
    }

    /// A point of the manifold at a fraction of a segment, and its chart; `None` where
    /// neither of the charts around reaches it.
    fn between<M: ImplicitManifold + ?Sized>(
        &mut self,
        manifold: &M,
        segment: usize,
        s: f64,
    ) -> Option<(Vec<f64>, Chart)> {
        let mut x = vec![0.0; self.points[segment].len()];
        // The chart of the nearer of the two points around first.
        let ends = if s < 0.5 {
            [segment, segment + 1]
        } else {
            [segment + 1, segment]
        };
        let charts = ends.map(|point| &self.charts[point.clamp(1, self.charts.len()) - 1]);
        for chart in charts {
            interpolate(&self.points[segment], &self.points[segment + 1], s, &mut x);
            if chart
                .retract(manifold, &mut x, TOLERANCE, &mut self.work)
                .is_err()
            {
                continue;
            }
            let mut moved = chart.clone();
            if moved.recenter(manifold, &x, &mut self.work) {
                return Some((x, moved));
            }
            if let Ok(new) = Chart::new(manifold, &x, self.dimension, &mut self.work) {
                return Some((x, new));
            }
        }
        None
    }

    /// Makes a new mesh with steps of at most `step` and displacements of at most
    /// `displacement`, finer where points move faster. New points are put on the
    /// manifold between the old ones.
    ///
    /// # Errors
    /// A segment where that is not possible: the path is torn there.
    pub(super) fn remesh<M: ImplicitManifold + ?Sized, V: Validity>(
        &mut self,
        manifold: &M,
        validity: &V,
        step: f64,
        displacement: f64,
    ) -> Result<(), usize> {
        let needed = self.needed(validity, step, displacement);
        let needed: Vec<f64> = (0..needed.len())
            .map(|i| {
                let around = &needed[i.saturating_sub(1)..(i + 2).min(needed.len())];
                let most = around.iter().fold(0.0, |m: f64, &n| m.max(n));
                (0.5 * (most + needed[i])).max(1e-6) / AIM
            })
            .collect();
        let total: f64 = needed.iter().sum();
        let segments = (total.ceil() as usize).max(FEWEST_SEGMENTS);
        let (mut points, mut charts) = (vec![self.points[0].clone()], Vec::new());
        let (mut widths, mut fractions, mut margins) = (Vec::new(), Vec::new(), Vec::new());
        let mut old = 0;
        let mut passed = 0.0;
        let mut parameter = 0.0;
        let mut parameter_before = 0.0;
        for i in 1..=segments {
            let at = total * i as f64 / segments as f64;
            let mut spacing = f64::INFINITY;
            let mut margin = 1.0_f64;
            loop {
                spacing = spacing.min(self.widths[old] / (self.fractions[old] + 1) as f64);
                margin = margin.max(self.margins[old]);
                if old + 1 == self.segments() || passed + needed[old] >= at {
                    break;
                }
                passed += needed[old];
                parameter += self.widths[old];
                old += 1;
            }
            let s = ((at - passed) / needed[old]).clamp(0.0, 1.0);
            let here = if i == segments {
                1.0
            } else {
                parameter + s * self.widths[old]
            };
            let width = (here - parameter_before).max(1e-9);
            widths.push(width);
            parameter_before = here;
            let rows = (width / spacing).ceil() as usize;
            fractions.push(rows.saturating_sub(1).clamp(1, MOST_FRACTIONS));
            margins.push(margin);
            if i == segments {
                points.push(self.points[self.points.len() - 1].clone());
                break;
            }
            let (x, moved) = self.between(manifold, old, s).ok_or(old)?;
            points.push(x);
            charts.push(moved);
        }
        self.points = points;
        self.charts = charts;
        self.widths = widths;
        self.fractions = fractions;
        self.margins = margins;
        self.respace();
        Ok(())
    }

    /// Constrains more fractions of some segments and of their neighbours, and where
    /// these are many, with wider margins; `false` where nothing can be raised.
    pub(super) fn watch_closer(&mut self, segments: &[usize]) -> bool {
        let mut more = false;
        let (before, margins_before) = (self.fractions.clone(), self.margins.clone());
        for &segment in segments {
            let last = (segment + 1).min(self.segments() - 1);
            for near in segment.saturating_sub(1)..=last {
                let raised = if near == segment {
                    4 * before[near] + 3
                } else {
                    2 * before[near] + 1
                };
                let raised = raised.min(MOST_FRACTIONS);
                self.fractions[near] = self.fractions[near].max(raised);
                if before[segment] >= MANY_FRACTIONS {
                    let raised = (2.0 * margins_before[near]).min(WIDEST);
                    self.margins[near] = self.margins[near].max(raised);
                }
            }
            more |= self.fractions[segment] > before[segment]
                || self.margins[segment] > margins_before[segment];
        }
        more
    }

    pub(super) fn into_points(self) -> Vec<Vec<f64>> {
        self.points
    }
}
