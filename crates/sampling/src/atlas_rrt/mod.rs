//! AtlasRRT: rapidly-exploring random trees on an implicit manifold, over an
//! atlas that is built as the trees grow (Jaillet and Porta 2013; Porta and
//! Hernández-Juan 2016, section 4.2).
//!
//! A sample is drawn in the tangent space of a random chart; the tree grows
//! from its nearest node towards it in steps of δ, and each productive branch
//! is followed by one attempt to connect to the other tree.
//!
//! Branches slide along limits and contacts. A step that would violate some is
//! replaced by the nearest step, in tangent coordinates, that respects them to
//! first order (a small quadratic programme), projected, tested and corrected up
//! to three times. Limits that a branch slides along are remembered from step
//! to step. A branch ends when less than a third of the wanted step is left, or
//! when it hardly comes nearer to its target.

mod branch;
mod explore;
mod path;
mod search;
mod step;

use cpu_time::ThreadTime;
use tensegra_atlas::{ImplicitManifold, ManifoldError, Validity, dimension, on_manifold};

use crate::{
    options::PlannerOptions,
    plan::{Failure, Observer, Plan, PlanError},
};
use search::Search;

/// Where a path cannot be made as fine as it is asked for, the branch concerned is
/// removed and the search goes on; after every so many times, it starts anew.
const REPAIRS: usize = 40;
/// Removed branches after which planning is given up.
const MAX_REPAIRS: usize = 1000;
/// Constraints may be violated by rounding.
const ROUNDING: f64 = 1e-10;

/// The planner: a manifold, a validity test and options.
#[derive(Clone, Debug)]
pub struct AtlasRrt<'a, M: ?Sized, V> {
    manifold: &'a M,
    validity: &'a V,
    options: PlannerOptions,
    max_displacement: f64,
}

impl<'a, M: ImplicitManifold + ?Sized, V: Validity> AtlasRrt<'a, M, V> {
    /// A planner with the given options.
    pub fn new(manifold: &'a M, validity: &'a V, options: PlannerOptions) -> Self {
        Self {
            manifold,
            validity,
            options,
            max_displacement: f64::INFINITY,
        }
    }

    /// Bounds the displacement (see [`Validity::displacement`]) between
    /// neighbouring points of the path returned.
    pub fn max_displacement(mut self, displacement: f64) -> Self {
        self.max_displacement = displacement;
        self
    }

    /// Plans from `start` to `goal`, points of the manifold.
    ///
    /// # Errors
    /// [`PlanError`]: an option makes no sense, an endpoint is not valid, or no path was
    /// found within the limits of the options.
    pub fn plan(
        &self,
        start: &[f64],
        goal: &[f64],
        observer: &mut dyn Observer,
    ) -> Result<Plan, PlanError> {
        let clock = ThreadTime::now();
        self.options.check()?;
        for (which, x) in [("start", start), ("goal", goal)] {
            self.validate(which, x)?;
        }
        let k = dimension(self.manifold, start);
        let at_goal = dimension(self.manifold, goal);
        if k != at_goal {
            let error = ManifoldError::DimensionChanges {
                first: k,
                second: at_goal,
            };
            return Err(PlanError::Manifold {
                which: "goal",
                error,
            });
        }
        let mut search = Search::new(self, k, start, goal)?;
        let mut repairs = 0;
        let failure = loop {
            match search.run(&clock, observer) {
                Ok((a, b)) => match search.path(a, b) {
                    Ok(points) => {
                        return Ok(Plan {
                            points,
                            statistics: search.figures(&clock),
                            trees: None,
                        });
                    }
                    Err(_) if repairs == MAX_REPAIRS => break Failure::Resolution,
                    Err(_) if repairs % REPAIRS == REPAIRS - 1 => search.start_anew(),
                    Err(broken) => search.prune(broken),
                },
                Err(failure) => break failure,
            }
            repairs += 1;
        };
        Err(PlanError::NotFound {
            failure,
            statistics: Box::new(search.figures(&clock)),
        })
    }

    /// Whether an endpoint is on the manifold, within all bounds and limits, and valid.
    fn validate(&self, which: &'static str, x: &[f64]) -> Result<(), PlanError> {
        let manifold = self.manifold;
        on_manifold(manifold, x).map_err(|error| PlanError::Manifold { which, error })?;
        let invalid = |reason: String| Err(PlanError::InvalidEndpoint { which, reason });
        for (i, (&value, (&lo, &hi))) in x
            .iter()
            .zip(manifold.lower_bounds().iter().zip(manifold.upper_bounds()))
            .enumerate()
        {
            if !(lo - ROUNDING..=hi + ROUNDING).contains(&value) {
                return invalid(format!(
                    "{} is {value:.6}, outside [{lo:.6}, {hi:.6}]",
                    manifold.variable_name(i)
                ));
            }
        }
        let mut values = vec![0.0; manifold.limit_count()];
        manifold.limits(x, &mut values);
        if let Some((i, value)) = values.iter().enumerate().find(|(_, v)| **v < -ROUNDING) {
            return invalid(format!(
                "{} is exceeded by {:.3e}",
                manifold.limit_name(i),
                -value
            ));
        }
        if !self.validity.is_valid(x) {
            return invalid("it is in collision".to_owned());
        }
        Ok(())
    }
}
