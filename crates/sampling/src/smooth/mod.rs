//! Smoothing: the path of least energy, and by that of least length, among those
//! that keep all bounds, limits and contacts; all points are moved at once.
//!
//! The energy ½ Σ |xᵢ₊₁ − xᵢ|² / hᵢ, with parameter steps hᵢ that add up to one,
//! is least where the path is a shortest one and passed at constant speed:
//! spacing takes care of itself. The unknowns of an iteration are the tangent
//! coordinates of every point (k each) in a chart of its own. It solves the
//! quadratic programme with
//!
//! - the energy's Hessian in these coordinates, block-tridiagonal and positive
//!   definite, and second derivatives of the Lagrangian at each point, as far as
//!   the whole stays so,
//! - a box on all unknowns, the trust region,
//! - bounds, limits and contacts linearised, at the points and at fractions of
//!   the segments between them, where each touches the two neighbours alone;
//!   they may be violated at a price,
//!
//! ([`BlockTridiagonalQp`](tensegra_optim::BlockTridiagonalQp)), moves all points
//! by the exponential maps of their charts, and accepts what lowers the energy
//! plus the priced violations. The price is raised where it does not suffice.
//!
//! A coarse path comes first: there an iteration costs little, and most of the
//! way is made. Then the mesh is refined to the step asked for, in coordinates
//! and in displacement, and again as the path shrinks. A path counts only when
//! [`Validity::is_clear`] accepts every segment; where it does not, more fractions
//! of the segment are constrained and the path is moved again.
//!
//! Cost of an iteration: for each point one chart moved along (k m r), a
//! projection, and the contacts within reach; then 10 to 20 interior-point
//! iterations of O(k³) a point and O(k²) a row.

mod chain;
mod curvature;
mod relax;
mod rows;

use cpu_time::ThreadTime;
use tensegra_atlas::{ImplicitManifold, ManifoldError, Validity, dimension};

use self::{
    chain::Chain,
    relax::{Relaxation, Relaxed},
};

/// The optimality asked for on the coarse mesh is so many times looser.
const COARSE: f64 = 10.0;
/// Iterations on the first fine mesh, at most.
const ROUGH_ITERATIONS: usize = 20;
/// First trust radius on a fine mesh, and after small changes of it, as parts of
/// the largest.
const FINE_RADIUS: f64 = 0.1;
const LATE_RADIUS: f64 = 0.02;

/// Parameters of [`Smoother`]; distances are in the manifold's coordinates.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct SmootherOptions {
    /// Longest step of the path.
    pub step: f64,
    /// Steps of the coarse path are this many times longer, within the bounds
    /// that `coarse_segments` sets.
    pub coarsening: f64,
    /// Fewest and most segments of the coarse path.
    pub coarse_segments: [usize; 2],
    /// Reduced gradient of the energy over the length (largest entry) at which
    /// to stop.
    pub optimality: f64,
    /// Value that contacts are kept above.
    pub contact_margin: f64,
    /// Distance that bounds and limits are kept inside.
    pub limit_margin: f64,
    /// Largest change of a tangent coordinate in an iteration.
    pub trust_radius: f64,
    /// Iterations on the coarse path, at most.
    pub coarse_iterations: usize,
    /// Iterations on the fine path after each refinement, at most.
    pub fine_iterations: usize,
    /// Refinements of the mesh or of the constraints between points, at most.
    pub max_rounds: usize,
}

impl Default for SmootherOptions {
    fn default() -> Self {
        Self {
            step: 0.05,
            coarsening: 4.0,
            coarse_segments: [24, 32],
            optimality: 1e-3,
            contact_margin: 1e-4,
            limit_margin: 1e-6,
            trust_radius: 0.5,
            coarse_iterations: 60,
            fine_iterations: 60,
            max_rounds: 10,
        }
    }
}

/// A smoothed path.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Smoothed {
    /// Points of the manifold, from the start to the goal of the path given.
    pub points: Vec<Vec<f64>>,
    /// Length of the polyline through them.
    pub length: f64,
    /// Reduced gradient of the energy over the length (largest entry).
    pub optimality: f64,
    /// Whether that is at most what the options ask for.
    pub converged: bool,
    /// Iterations on all meshes.
    pub iterations: usize,
    /// CPU seconds.
    pub seconds: f64,
}

/// A path that is smooth on a coarse mesh ([`Smoother::draft`]).
#[derive(Clone, Debug)]
pub struct Draft {
    chain: Chain,
    length: f64,
    price: f64,
    iterations: usize,
    seconds: f64,
}

impl Draft {
    /// Length of the polyline through its points; the smoothed path will be about as long.
    pub fn length(&self) -> f64 {
        self.length
    }

    /// Iterations made.
    pub fn iterations(&self) -> usize {
        self.iterations
    }
}

/// Why a path is not smoothed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SmoothError {
    /// The path has fewer than two points.
    #[error("a path of {points} points cannot be smoothed: give at least two")]
    TooShort {
        /// Number of points.
        points: usize,
    },
    /// A point of the path is singular, or the dimension changes.
    #[error("point {index} of the path is not a regular point of the manifold: {error}")]
    Manifold {
        /// Index of the point.
        index: usize,
        /// What is wrong.
        error: ManifoldError,
    },
    /// Two points next to each other are on different sheets of the manifold.
    #[error(
        "the path is torn: between the ends of segment {segment} of {segments} no point of the \
         manifold was found"
    )]
    Torn {
        /// The segment.
        segment: usize,
        /// Segments of the path.
        segments: usize,
    },
    /// No path that is clear throughout was reached.
    #[error(
        "no clear path was reached in {iterations} iterations: {blocked} of {segments} segments \
         stay blocked"
    )]
    Blocked {
        /// Segments that are not clear.
        blocked: usize,
        /// Segments of the path.
        segments: usize,
        /// Iterations made.
        iterations: usize,
    },
    /// The observer asked to stop.
    #[error("smoothing was cancelled")]
    Cancelled,
}

/// How far smoothing has come.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct SmoothProgress {
    /// CPU seconds so far.
    pub seconds: f64,
    /// Iterations so far.
    pub iterations: usize,
    /// Length of the path.
    pub length: f64,
    /// Reduced gradient over the length.
    pub optimality: f64,
}

/// Watches smoothing and may cancel it.
pub trait SmoothObserver {
    /// Called after every iteration; `false` cancels.
    fn progress(&mut self, progress: &SmoothProgress) -> bool;
}

/// Watches nothing.
impl SmoothObserver for () {
    fn progress(&mut self, _: &SmoothProgress) -> bool {
        true
    }
}

/// Smooths paths on a manifold.
///
/// # Examples
/// A detour over the pole of the sphere becomes the arc of a great circle:
/// ```
/// # use tensegra_atlas::{Everywhere, doc::Sphere};
/// # use tensegra_sampling::{Smoother, SmootherOptions};
/// let at = |longitude: f64, latitude: f64| {
///     let (sin, cos) = latitude.sin_cos();
///     vec![cos * longitude.cos(), cos * longitude.sin(), sin]
/// };
/// let up = (0..10).map(|i| at(0.0, 0.05 * f64::from(i)));
/// let across = (0..20).map(|i| at(0.05 * f64::from(i), 0.5));
/// let down = (0..10).rev().map(|i| at(1.0, 0.05 * f64::from(i)));
/// let path: Vec<Vec<f64>> = up.chain(across).chain(down).collect();
/// let sphere = Sphere::new();
/// let smoothed = Smoother::new(&sphere, &Everywhere, SmootherOptions::default())
///     .smooth(&path, &mut ())
///     .map_err(|error| error.to_string())?;
/// assert!(smoothed.converged && (smoothed.length - 1.0).abs() < 1e-3);
/// # Ok::<(), String>(())
/// ```
#[derive(Clone, Debug)]
pub struct Smoother<'a, M: ?Sized, V> {
    manifold: &'a M,
    validity: &'a V,
    options: SmootherOptions,
    max_displacement: f64,
}

impl<'a, M: ImplicitManifold + ?Sized, V: Validity> Smoother<'a, M, V> {
    /// A smoother with the given options.
    pub fn new(manifold: &'a M, validity: &'a V, options: SmootherOptions) -> Self {
        Self {
            manifold,
            validity,
            options,
            max_displacement: f64::INFINITY,
        }
    }

    /// Bounds the displacement (see [`Validity::displacement`]) between
    /// neighbouring points of the path.
    pub fn max_displacement(mut self, displacement: f64) -> Self {
        self.max_displacement = displacement;
        self
    }

    /// Smooths the path through `points`, each on the manifold. The path should
    /// be valid; small violations are mended.
    ///
    /// # Errors
    /// [`SmoothError`]: the path passes a singular point, or no path that is
    /// clear throughout was reached.
    pub fn smooth(
        &self,
        points: &[Vec<f64>],
        observer: &mut dyn SmoothObserver,
    ) -> Result<Smoothed, SmoothError> {
        let draft = self.draft(points, observer)?;
        self.refine(draft, observer)
    }

    /// Smooths the path through `points` on a coarse mesh, which takes a small part of
    /// the time of all and tells how long the path will be: of several paths the best
    /// one may go on alone.
    ///
    /// # Errors
    /// [`SmoothError`]: the path passes a singular point.
    pub fn draft(
        &self,
        points: &[Vec<f64>],
        observer: &mut dyn SmoothObserver,
    ) -> Result<Draft, SmoothError> {
        let clock = ThreadTime::now();
        let options = &self.options;
        let (Some(start), Some(goal)) = (points.first(), points.last()) else {
            return Err(SmoothError::TooShort { points: 0 });
        };
        if points.len() < 2 {
            return Err(SmoothError::TooShort { points: 1 });
        }
        let k = dimension(self.manifold, start);
        let at_goal = dimension(self.manifold, goal);
        if k != at_goal {
            return Err(SmoothError::Manifold {
                index: points.len() - 1,
                error: ManifoldError::DimensionChanges {
                    first: k,
                    second: at_goal,
                },
            });
        }
        let coarse = options.coarsening * options.step;
        let [fewest, most] = options.coarse_segments;
        let mut chain = Chain::sampled(self.manifold, k, points, coarse, fewest..=most)
            .map_err(|(index, error)| SmoothError::Manifold { index, error })?;
        let mut relaxation = Relaxation::new(self.manifold, self.validity, options, &chain, None);
        let relaxed = relaxation
            .relax(
                &mut chain,
                [COARSE * options.optimality, options.trust_radius],
                options.coarse_iterations,
                &mut |relaxed, iterations| {
                    observer.progress(&relaxed.progress(iterations, clock.elapsed().as_secs_f64()))
                },
            )
            .ok_or(SmoothError::Cancelled)?;
        Ok(Draft {
            chain,
            length: relaxed.length,
            price: relaxation.price(),
            iterations: relaxation.iterations(),
            seconds: clock.elapsed().as_secs_f64(),
        })
    }

    /// How deep a draft cuts into obstacles at quarters of its segments, at most: much where
    /// it jumps over one. Cost: the contacts at four places a segment.
    pub fn depth(&self, draft: &Draft) -> f64 {
        let price = Some(draft.price);
        Relaxation::new(
            self.manifold,
            self.validity,
            &self.options,
            &draft.chain,
            price,
        )
        .depth(&draft.chain)
    }

    /// Smooths a draft on fine meshes.
    ///
    /// # Errors
    /// [`SmoothError`]: the path is torn, or no path that is clear throughout was
    /// reached.
    pub fn refine(
        &self,
        draft: Draft,
        observer: &mut dyn SmoothObserver,
    ) -> Result<Smoothed, SmoothError> {
        let clock = ThreadTime::now();
        let options = &self.options;
        let Draft {
            mut chain,
            price,
            iterations: before,
            seconds: seconds_before,
            ..
        } = draft;
        let seconds = || seconds_before + clock.elapsed().as_secs_f64();
        let mut relaxation =
            Relaxation::new(self.manifold, self.validity, options, &chain, Some(price));
        let mut report = |relaxed: &Relaxed, iterations: usize| {
            observer.progress(&relaxed.progress(before + iterations, seconds()))
        };
        let (step, displacement) = (options.step, self.max_displacement);
        let torn = |segment, chain: &Chain| SmoothError::Torn {
            segment,
            segments: chain.segments(),
        };
        chain
            .remesh(self.manifold, self.validity, step, displacement)
            .map_err(|segment| torn(segment, &chain))?;
        let mut radius = FINE_RADIUS * options.trust_radius;
        let mut blocked = Vec::new();
        let mut relaxed = Relaxed::default();
        for round in 0..=options.max_rounds {
            // The first fine mesh is rarely the last one.
            let rough = round == 0 && options.max_rounds > 0;
            let (looser, iterations) = if rough {
                (3.0, options.fine_iterations.min(ROUGH_ITERATIONS))
            } else {
                (1.0, options.fine_iterations)
            };
            relaxed = relaxation
                .relax(
                    &mut chain,
                    [looser * options.optimality, radius],
                    iterations,
                    &mut report,
                )
                .ok_or(SmoothError::Cancelled)?;
            let split = chain
                .split(self.manifold, self.validity, step, displacement)
                .map_err(|segment| torn(segment, &chain))?;
            blocked = relaxation.blocked(&chain);
            let fine = !rough || relaxed.optimality <= options.optimality;
            let done = fine && split == 0 && blocked.is_empty() && relaxed.violation == 0.0;
            if done || round == options.max_rounds {
                break;
            }
            let stubborn = chain.closely_watched(&blocked);
            if !blocked.is_empty() && !chain.watch_closer(&blocked) {
                relaxation.widen_margin();
            }
            chain
                .halve(self.manifold, &stubborn)
                .map_err(|segment| torn(segment, &chain))?;
            // What was never on a fine mesh may need a new one.
            if 4 * split > chain.segments() {
                chain
                    .remesh(self.manifold, self.validity, step, displacement)
                    .map_err(|segment| torn(segment, &chain))?;
            } else {
                radius = LATE_RADIUS * options.trust_radius;
            }
        }
        if !blocked.is_empty() || relaxed.violation > 0.0 {
            return Err(SmoothError::Blocked {
                blocked: blocked.len(),
                segments: chain.segments(),
                iterations: before + relaxation.iterations(),
            });
        }
        Ok(Smoothed {
            length: chain.length(),
            points: chain.into_points(),
            optimality: relaxed.optimality,
            converged: relaxed.converged,
            iterations: before + relaxation.iterations(),
            seconds: seconds(),
        })
    }
}
