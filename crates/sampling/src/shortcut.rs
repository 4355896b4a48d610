//! Random shortcuts: two points of a path are drawn, and what lies between them
//! is replaced by the straight walk on the manifold where that is valid and
//! shorter (Geraerts and Overmars, "Creating high-quality paths for motion
//! planning", 2007).
//!
//! Takes the detours out of a planned path at the cost of one walk an attempt,
//! mostly charts moved along ([`Chart::recenter`](tensegra_atlas::Chart::recenter))
//! and tests of validity. It saturates well above the shortest path: in front of
//! [`Smoother`](crate::Smoother) a few dozen attempts are enough.

use cpu_time::ThreadTime;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use tensegra_atlas::{ImplicitManifold, ManifoldError, Validity, dimension, on_manifold};

use crate::{tree::squared_distance, walk::Walker};

/// A shortcut must save this fraction of what it replaces.
const LEAST_GAIN: f64 = 1e-3;

/// Parameters of [`Shortcutter`]; distances are in the manifold's coordinates.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct ShortcutOptions {
    /// Seed of every random choice.
    pub seed: u64,
    /// Longest step of a walk.
    pub step: f64,
    /// Largest number of attempts.
    pub max_attempts: usize,
    /// Attempts in a row without success after which to stop.
    pub patience: usize,
}

impl Default for ShortcutOptions {
    fn default() -> Self {
        Self {
            seed: 1,
            step: 0.05,
            max_attempts: 40,
            patience: 10,
        }
    }
}

/// A path after shortcuts.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Shortened {
    /// Points of the manifold, from the start to the goal of the path given.
    pub points: Vec<Vec<f64>>,
    /// Length of the polyline through them.
    pub length: f64,
    /// Shortcuts tried.
    pub attempts: usize,
    /// Shortcuts taken.
    pub taken: usize,
    /// CPU seconds.
    pub seconds: f64,
}

/// Shortens paths on a manifold by random shortcuts.
///
/// # Examples
/// A detour on the sphere over the pole, between two points of the equator a
/// radian apart:
/// ```
/// # use tensegra_atlas::{Everywhere, doc::Sphere};
/// # use tensegra_sampling::{ShortcutOptions, Shortcutter};
/// let at = |longitude: f64, latitude: f64| {
///     let (sin, cos) = latitude.sin_cos();
///     vec![cos * longitude.cos(), cos * longitude.sin(), sin]
/// };
/// let up = (0..30).map(|i| at(0.0, 0.05 * f64::from(i)));
/// let down = (0..30).rev().map(|i| at(1.0, 0.05 * f64::from(i)));
/// let path: Vec<Vec<f64>> = up.chain(down).collect();
/// let sphere = Sphere::new();
/// let shortened = Shortcutter::new(&sphere, &Everywhere, ShortcutOptions::default())
///     .shorten(&path)?;
/// assert!(shortened.length < 1.3);
/// assert_eq!(shortened.points.first(), path.first());
/// # Ok::<(), tensegra_atlas::ManifoldError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Shortcutter<'a, M: ?Sized, V> {
    manifold: &'a M,
    validity: &'a V,
    options: ShortcutOptions,
    max_displacement: f64,
}

impl<'a, M: ImplicitManifold + ?Sized, V: Validity> Shortcutter<'a, M, V> {
    /// A shortener with the given options.
    pub fn new(manifold: &'a M, validity: &'a V, options: ShortcutOptions) -> Self {
        Self {
            manifold,
            validity,
            options,
            max_displacement: f64::INFINITY,
        }
    }

    /// Bounds the displacement (see [`Validity::displacement`]) in each step of
    /// a shortcut.
    pub fn max_displacement(mut self, displacement: f64) -> Self {
        self.max_displacement = displacement;
        self
    }

    /// Shortens the valid path through `points`, each on the manifold.
    ///
    /// # Errors
    /// [`ManifoldError`] where an end of the path is not on the manifold, or the
    /// dimension of the manifold changes between them.
    pub fn shorten(&self, points: &[Vec<f64>]) -> Result<Shortened, ManifoldError> {
        let clock = ThreadTime::now();
        let mut path = points.to_vec();
        let shortened = |path: Vec<Vec<f64>>, attempts, taken| Shortened {
            length: length(&path),
            points: path,
            attempts,
            taken,
            seconds: clock.elapsed().as_secs_f64(),
        };
        if path.len() < 3 {
            return Ok(shortened(path, 0, 0));
        }
        for end in [0, path.len() - 1] {
            on_manifold(self.manifold, &path[end])?;
        }
        let k = dimension(self.manifold, &path[0]);
        let at_goal = dimension(self.manifold, &path[path.len() - 1]);
        if k != at_goal {
            return Err(ManifoldError::DimensionChanges {
                first: k,
                second: at_goal,
            });
        }
        let mut random = Pcg64::seed_from_u64(self.options.seed);
        let mut walker = Walker::new(
            self.manifold,
            self.validity,
            k,
            self.options.step,
            self.max_displacement,
        );
        let mut between = Vec::new();
        let (mut attempts, mut taken, mut failed) = (0, 0, 0);
        let mut lengths = cumulated(&path);
        // The straight walk from start to goal is the best of all.
        let mut pair = Some((0, path.len() - 1));
        while attempts < self.options.max_attempts && failed < self.options.patience {
            attempts += 1;
            failed += 1;
            let (first, last) = pair.take().unwrap_or_else(|| {
                let whole = lengths[lengths.len() - 1];
                let mut draw = || {
                    let at = whole * random.random::<f64>();
                    lengths.partition_point(|&l| l < at).min(path.len() - 1)
                };
                let (a, b) = (draw(), draw());
                (a.min(b), a.max(b))
            });
            if last - first < 2 {
                continue;
            }
            let old = lengths[last] - lengths[first];
            let longest = (1.0 - LEAST_GAIN) * old;
            if squared_distance(&path[first], &path[last]).sqrt() > longest {
                continue;
            }
            if walker
                .walk(&path[first], &path[last], longest, &mut between)
                .is_some()
            {
                path.splice(first + 1..last, between.drain(..));
                lengths = cumulated(&path);
                taken += 1;
                failed = 0;
            }
        }
        Ok(shortened(path, attempts, taken))
    }
}

/// Length of the polyline up to each point.
pub(crate) fn cumulated(points: &[Vec<f64>]) -> Vec<f64> {
    let mut sum = 0.0;
    let mut lengths = vec![0.0];
    lengths.extend(points.windows(2).map(|pair| {
        sum += squared_distance(&pair[0], &pair[1]).sqrt();
        sum
    }));
    lengths
}

/// Length of the polyline through some points.
pub(crate) fn length(points: &[Vec<f64>]) -> f64 {
    cumulated(points).last().copied().unwrap_or(0.0)
}
