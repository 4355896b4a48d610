//! A local planner: form after form along a given motion, each sought from the last.
//!
//! Hernández Juan and Mirats Tur (2008, section IV) move the centroid of a structure along a line, and
//! an obstacle towards it, by solving the same problem again and again, slightly changed. Here the
//! step is halved where the nodes would move too far, and the reason is reported where the motion
//! cannot go on.

use tensegra_model::Configuration;

use crate::{
    collision_free::{Form, FormProblem},
    error::FormError,
};

/// How a motion is followed.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct FollowOptions {
    /// Number of steps of the parameter from 0 to 1, where none has to be halved.
    pub steps: usize,
    /// Largest displacement of a node in one step, in units of length.
    pub max_displacement: f64,
    /// How often a step is halved before the motion is given up.
    pub max_halvings: u32,
}

impl FollowOptions {
    /// Options with a number of steps and the largest displacement of a node in one of them.
    pub fn new(steps: usize, max_displacement: f64) -> Self {
        Self {
            steps: steps.max(1),
            max_displacement,
            max_halvings: 6,
        }
    }
}

/// Forms along a motion.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Followed {
    /// Parameter and form, from 0 on.
    pub forms: Vec<(f64, Form)>,
    /// Why the motion ended before the parameter 1, if it did.
    pub stopped: Option<FollowStop>,
}

/// Why a motion could not go on.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FollowStop {
    /// There is no form nearby at the next parameter.
    #[error("there is no form near the last one at parameter {parameter}: {error}")]
    NoForm {
        /// The parameter.
        parameter: f64,
        /// What cannot be met.
        error: FormError,
    },
    /// The form jumps.
    #[error("at parameter {parameter} a node jumps by {displacement:.3e}")]
    Jump {
        /// The parameter.
        parameter: f64,
        /// How far the node moves.
        displacement: f64,
    },
}

/// Follows the motion of the problem `at(t)` for t from 0 to 1, beginning near `from`.
///
/// # Errors
/// [`FormError`] where a problem makes no sense, or there is no form near `from` at t = 0. That the
/// motion cannot be followed to its end is no error: see [`Followed::stopped`].
pub fn follow(
    from: &Configuration,
    mut at: impl FnMut(f64) -> Result<FormProblem, FormError>,
    options: FollowOptions,
) -> Result<Followed, FormError> {
    let first = at(0.0)?.nearest(from)?;
    let mut forms = vec![(0.0, first)];
    let whole = 1.0 / options.steps as f64;
    let least = whole * 0.5_f64.powi(options.max_halvings as i32);
    let mut step = whole;
    let mut parameter = 0.0;
    while parameter < 1.0 {
        let next = if parameter + step >= 1.0 - 1e-9 {
            1.0
        } else {
            parameter + step
        };
        let last = &forms[forms.len() - 1].1.configuration;
        let stop = match at(next)?.nearest(last) {
            Ok(form) => {
                let displacement = displacement(last, &form.configuration);
                if displacement <= options.max_displacement {
                    forms.push((next, form));
                    parameter = next;
                    step = (2.0 * step).min(whole);
                    continue;
                }
                FollowStop::Jump {
                    parameter: next,
                    displacement,
                }
            }
            Err(error) => FollowStop::NoForm {
                parameter: next,
                error,
            },
        };
        step *= 0.5;
        if step < least {
            return Ok(Followed {
                forms,
                stopped: Some(stop),
            });
        }
    }
    Ok(Followed {
        forms,
        stopped: None,
    })
}

/// The largest displacement of a node.
fn displacement(a: &Configuration, b: &Configuration) -> f64 {
    a.positions
        .iter()
        .zip(&b.positions)
        .map(|(a, b)| (b - a).norm())
        .fold(0.0, f64::max)
}
