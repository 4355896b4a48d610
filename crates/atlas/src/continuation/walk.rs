//! Random walks over a component: points to test an atlas with, and samples of
//! it. They know nothing of atlases.

use crate::{
    atlas::squared_distance,
    chart::{Chart, Workspace},
    continuation::{border::broken_limit, interpolate},
    error::ManifoldError,
    manifold::ImplicitManifold,
    newton::dimension,
    validity::Validity,
};

/// Steps in one direction before another is drawn.
const STRAIGHT: usize = 20;
const TOLERANCE: f64 = 1e-10;

/// A walk over a component of the valid part of a manifold like that of a billiard
/// ball: straight on in the tangent space for a while, and in a random direction
/// when it hits a border.
///
/// Each step builds a chart at the point reached, so that errors do not add up.
///
/// # Examples
/// ```
/// use tensegra_atlas::{BilliardWalk, Everywhere, doc::Sphere};
/// let mut state = 1_u64;
/// let random = move || {
///     state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
///     (state >> 11) as f64 / (1_u64 << 53) as f64
/// };
/// let sphere = Sphere::new();
/// let mut walk = BilliardWalk::new(&sphere, &Everywhere, &[0.0, 0.0, 1.0], 0.1, random);
/// for _ in 0..50 {
///     let x = walk.advance()?;
///     assert!((x.iter().map(|x| x * x).sum::<f64>() - 1.0).abs() < 1e-9);
/// }
/// # Ok::<(), tensegra_atlas::ManifoldError>(())
/// ```
pub struct BilliardWalk<'a, M: ?Sized, V: Validity, R> {
    manifold: &'a M,
    validity: &'a V,
    step: f64,
    random: R,
    here: Vec<f64>,
    memory: V::Memory,
    next_memory: V::Memory,
    /// Where to, as a vector of the ambient space; empty for a new draw.
    heading: Vec<f64>,
    straight: usize,
    dimension: usize,
    work: Workspace,
}

impl<'a, M: ImplicitManifold + ?Sized, V: Validity, R: FnMut() -> f64> BilliardWalk<'a, M, V, R> {
    /// A walk from a valid point in steps of the given length; `random` draws
    /// numbers from 0 to 1.
    pub fn new(manifold: &'a M, validity: &'a V, start: &[f64], step: f64, random: R) -> Self {
        let mut memory = validity.memory();
        validity.enter(start, &mut memory);
        Self {
            manifold,
            validity,
            step,
            random,
            here: start.to_vec(),
            memory,
            next_memory: validity.memory(),
            heading: Vec::new(),
            straight: 0,
            dimension: dimension(manifold, start),
            work: Workspace::default(),
        }
    }

    /// Goes one step on, or turns at a border; returns the point reached.
    ///
    /// # Errors
    /// [`ManifoldError`] at a singular point.
    pub fn advance(&mut self) -> Result<&[f64], ManifoldError> {
        let manifold = self.manifold;
        let chart = Chart::new(manifold, &self.here, self.dimension, &mut self.work)?;
        let mut t = vec![0.0; self.dimension];
        if self.heading.is_empty() || self.straight == 0 {
            self.straight = STRAIGHT;
            t.iter_mut().for_each(|t| *t = self.normal_number());
        } else {
            for (j, t) in t.iter_mut().enumerate() {
                *t = crate::qr::dot(chart.tangent(j), &self.heading);
            }
        }
        let length = t.iter().map(|t| t * t).sum::<f64>().sqrt();
        t.iter_mut()
            .for_each(|t| *t *= self.step / length.max(f64::MIN_POSITIVE));
        let mut x = vec![0.0; self.here.len()];
        if self.try_step(&chart, &t, &mut x) {
            self.heading.clear();
            self.heading
                .extend(x.iter().zip(&self.here).map(|(a, b)| a - b));
            self.straight -= 1;
            self.here = x;
            std::mem::swap(&mut self.memory, &mut self.next_memory);
        } else {
            self.heading.clear();
        }
        Ok(&self.here)
    }

    fn try_step(&mut self, chart: &Chart, t: &[f64], x: &mut [f64]) -> bool {
        let manifold = self.manifold;
        let regular = chart.exp(manifold, t, x, TOLERANCE, &mut self.work).is_ok();
        // A step that leads far from the tangent space has left the sheet.
        if !regular
            || squared_distance(x, &self.here) > 2.0 * self.step * self.step
            || broken_limit(manifold, x).is_some()
        {
            return false;
        }
        let (here, work) = (&self.here, &mut self.work);
        let mut between = |s: f64, y: &mut [f64]| {
            interpolate(here, x, s, y);
            chart.retract(manifold, y, TOLERANCE, work).is_ok()
        };
        self.validity
            .step(
                &self.memory,
                x,
                &mut self.next_memory,
                &mut between,
                &mut Vec::new(),
            )
            .is_ok()
    }

    /// A normally distributed number, by Box and Muller.
    fn normal_number(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - (self.random)()).max(f64::MIN_POSITIVE).ln()).sqrt();
        radius * (std::f64::consts::TAU * (self.random)()).cos()
    }
}
