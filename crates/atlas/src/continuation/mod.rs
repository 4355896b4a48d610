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
//! searched for another way on, and only when there is none is the vertex closed.
//! Up to the border, the domains of the charts next to it cover the component.
//!
//! A chart's radius shrinks where the manifold leaves its tangent space by more
//! than ε within it.
//!
//! Cost: for each chart one factorisation, about two validity tests, and cuts of
//! small polytopes; at borders some tens of projections besides. The number of charts
//! grows like ρ⁻ᵏ. Made for k = 1, 2, 3.

mod border;
mod component;
mod front;
mod index;
mod look;
mod outline;
mod rim;
mod route;
mod walk;

use std::collections::BTreeMap;

pub use border::Border;
pub use component::{ComponentAtlas, Corner};
pub use outline::OutlinePoint;
pub use route::{Route, RouteError, RouteOptions};
pub use walk::BilliardWalk;

use crate::{
    atlas::ChartDomain,
    chart::{Chart, Workspace},
    error::ManifoldError,
    manifold::ImplicitManifold,
    newton::dimension,
    validity::Validity,
};
use border::broken_limit;
use front::Front;

/// Residual of the points that others see, where it can be reached.
const FINAL_TOLERANCE: f64 = 1e-12;
/// Residual at which points at a border are looked at.
const ROUGH: f64 = 1e-4;

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
    /// searched for a way on where no values of limits or contacts guide the search.
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
        if let Some(border) = broken_limit(self.manifold, start) {
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

/// Puts x on the manifold along the normal space of a chart, to rounding where that
/// can be reached and otherwise to `tolerance`; `false` where there is no point.
fn settle<M: ImplicitManifold + ?Sized>(
    chart: &Chart,
    manifold: &M,
    x: &mut [f64],
    tolerance: f64,
    work: &mut Workspace,
) -> bool {
    let before = x.to_vec();
    [FINAL_TOLERANCE, tolerance].into_iter().any(|tolerance| {
        x.copy_from_slice(&before);
        chart.retract(manifold, x, tolerance, work).is_ok()
    })
}

/// y = a + s (b − a).
fn interpolate(a: &[f64], b: &[f64], s: f64, y: &mut [f64]) {
    for ((y, a), b) in y.iter_mut().zip(a).zip(b) {
        *y = a + s * (b - a);
    }
}
