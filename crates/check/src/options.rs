//! What the judge accepts.

use thiserror::Error;

/// Tolerances and limits of the judge.
///
/// Every tolerance is relative: lengths are measured against the size of the structure
/// ([`tensegra_model::Structure::size`] at the first configuration), forces against the largest
/// force or load of the configuration concerned.
///
/// ```
/// use tensegra_check::CheckOptions;
///
/// let strict = CheckOptions::default().with_min_clearance(1e-3);
/// assert!(strict.validate().is_ok());
/// assert!(CheckOptions::default().with_slack_factor(f64::NAN).validate().is_err());
/// ```
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct CheckOptions {
    /// How well the equations hold that are not force balance: lengths, Hooke's law, constants,
    /// pretension, gauge, couplings, attachments. Default 1e-8.
    pub equation_tolerance: f64,
    /// Largest unbalanced force at a node, over the largest force. Default 1e-8.
    pub balance_tolerance: f64,
    /// How far a sample may lie outside a range. Default 1e-9.
    pub range_tolerance: f64,
    /// How far the motion between two samples may leave a range. Default 2e-3: a motion that runs
    /// along a limit leaves it by a term of second order in the step.
    pub range_tolerance_between: f64,
    /// How far nodes may begin and end from where the problem states: its endpoints are refined
    /// onto the equilibrium manifold before planning. Default 1e-2.
    pub endpoint_tolerance: f64,
    /// How far forces and rest lengths may begin and end from those that the problem states, which
    /// follow the nodes with the stiffness of the elements. Default 5e-2.
    pub endpoint_force_tolerance: f64,
    /// Length, over the size of the structure, below which an element has no direction.
    /// Default 1e-6.
    pub min_length: f64,
    /// Largest displacement of a node in one step, in units of length. `None`, the default, takes
    /// the step of the problem's planner settings times the size of the structure.
    pub max_displacement: Option<f64>,
    /// Least clearance, at samples and between them, in units of length. Default 0.
    pub min_clearance: f64,
    /// The motion between two samples is taken to stray from the straight one by at most this
    /// multiple of the deviation measured half-way. Default 2.
    pub slack_factor: f64,
    /// How often an interval may be halved before a pair counts as not proven clear. Default 12.
    pub max_depth: u32,
}

impl Default for CheckOptions {
    fn default() -> Self {
        Self {
            equation_tolerance: 1e-8,
            balance_tolerance: 1e-8,
            range_tolerance: 1e-9,
            range_tolerance_between: 2e-3,
            endpoint_tolerance: 1e-2,
            endpoint_force_tolerance: 5e-2,
            min_length: 1e-6,
            max_displacement: None,
            min_clearance: 0.0,
            slack_factor: 2.0,
            max_depth: 12,
        }
    }
}

/// An option of the judge that is out of its range.
#[derive(Clone, Debug, Error, PartialEq)]
#[error("option {name} is {value}; give {requirement}")]
pub struct OptionError {
    /// Name of the option.
    pub name: &'static str,
    /// The value that was given.
    pub value: f64,
    /// What is accepted.
    pub requirement: &'static str,
}

macro_rules! setters {
    ($($setter:ident, $field:ident: $type:ty;)*) => {$(
        #[doc = concat!("Sets [`", stringify!($field), "`](Self::", stringify!($field), ").")]
        #[must_use]
        pub fn $setter(mut self, value: $type) -> Self {
            self.$field = value;
            self
        }
    )*};
}

impl CheckOptions {
    setters! {
        with_equation_tolerance, equation_tolerance: f64;
        with_balance_tolerance, balance_tolerance: f64;
        with_range_tolerance, range_tolerance: f64;
        with_range_tolerance_between, range_tolerance_between: f64;
        with_endpoint_tolerance, endpoint_tolerance: f64;
        with_endpoint_force_tolerance, endpoint_force_tolerance: f64;
        with_min_length, min_length: f64;
        with_max_displacement, max_displacement: Option<f64>;
        with_min_clearance, min_clearance: f64;
        with_slack_factor, slack_factor: f64;
        with_max_depth, max_depth: u32;
    }

    /// Checks every option against its range.
    ///
    /// # Errors
    /// The first option that is out of its range.
    pub fn validate(&self) -> Result<(), OptionError> {
        let positive = [
            ("equation_tolerance", self.equation_tolerance),
            ("balance_tolerance", self.balance_tolerance),
            ("range_tolerance", self.range_tolerance),
            ("range_tolerance_between", self.range_tolerance_between),
            ("endpoint_tolerance", self.endpoint_tolerance),
            ("endpoint_force_tolerance", self.endpoint_force_tolerance),
            ("min_length", self.min_length),
            ("max_displacement", self.max_displacement.unwrap_or(1.0)),
        ];
        for (name, value) in positive {
            if !(value > 0.0 && value.is_finite()) {
                let requirement = "a positive finite number";
                return Err(OptionError {
                    name,
                    value,
                    requirement,
                });
            }
        }
        if !(self.min_clearance >= 0.0 && self.min_clearance.is_finite()) {
            return Err(OptionError {
                name: "min_clearance",
                value: self.min_clearance,
                requirement: "a finite number that is not negative",
            });
        }
        if !(self.slack_factor >= 1.0 && self.slack_factor.is_finite()) {
            return Err(OptionError {
                name: "slack_factor",
                value: self.slack_factor,
                requirement: "a finite number of at least 1",
            });
        }
        if self.max_depth > 40 {
            return Err(OptionError {
                name: "max_depth",
                value: f64::from(self.max_depth),
                requirement: "at most 40: an interval cannot be halved more often in f64",
            });
        }
        Ok(())
    }
}
