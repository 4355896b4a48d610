//! What a robot's members allow: lengths, clearances, angles, steps and rigidity.

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Physical limits of a robot (section III of Usevitch et al.). Lengths are in the robot's own
/// unit, that of its node positions.
///
/// # Examples
///
/// ```
/// use tensegra_lar::Limits;
///
/// let limits = Limits::default().with_max_length(2.5).with_min_rigidity(Some(0.0025));
/// assert!(limits.validate().is_ok());
/// assert!(limits.with_min_length(3.0).validate().is_err());
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct Limits {
    /// Shortest length of a member, L_min. Default 0.5.
    pub min_length: f64,
    /// Greatest length of a member, L_max. Default 4.
    pub max_length: f64,
    /// Least distance between the axes of two members that share no node, d_min: the diameter of
    /// a member. Default 0.15.
    pub min_distance: f64,
    /// Least angle between two members at a node, θ_min, in radians. Default 10°.
    pub min_angle: f64,
    /// Greatest distance that a node travels between two configurations, d_move; smaller than
    /// `min_distance`, so that members cannot jump over each other. Default 0.075.
    pub max_move: f64,
    /// Least worst-case rigidity index λ/tr(RᵀR), if it is imposed. Default none. The threshold
    /// 0.005 of the literature, relative to Σ L², is 0.0025 here.
    pub min_rigidity: Option<f64>,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            min_length: 0.5,
            max_length: 4.0,
            min_distance: 0.15,
            min_angle: 10.0_f64.to_radians(),
            max_move: 0.075,
            min_rigidity: None,
        }
    }
}

/// A limit outside its range.
#[derive(Debug, Clone, PartialEq, Error)]
#[error("the limit `{name}` is {value}: it must {requirement}")]
pub struct LimitsError {
    /// Name of the limit.
    pub name: &'static str,
    /// The value given.
    pub value: f64,
    /// What the value has to satisfy.
    pub requirement: &'static str,
}

macro_rules! setters {
    ($($field:ident / $setter:ident: $type:ty;)*) => {
        $(
            #[doc = concat!("Sets [`", stringify!($field), "`](Self::", stringify!($field), ").")]
            #[must_use]
            pub fn $setter(mut self, value: $type) -> Self {
                self.$field = value;
                self
            }
        )*
    };
}
pub(crate) use setters;

impl Limits {
    setters! {
        min_length / with_min_length: f64;
        max_length / with_max_length: f64;
        min_distance / with_min_distance: f64;
        min_angle / with_min_angle: f64;
        max_move / with_max_move: f64;
        min_rigidity / with_min_rigidity: Option<f64>;
    }

    /// Checks every limit against its range.
    ///
    /// # Errors
    /// The first limit outside its range.
    pub fn validate(&self) -> Result<(), LimitsError> {
        let require = |name, value: f64, requirement, met: bool| {
            if value.is_finite() && met {
                Ok(())
            } else {
                Err(LimitsError {
                    name,
                    value,
                    requirement,
                })
            }
        };
        let (low, high) = (self.min_length, self.max_length);
        require("min_length", low, "be positive", low > 0.0)?;
        require(
            "max_length",
            high,
            "be finite and exceed min_length",
            high > low,
        )?;
        let distance = self.min_distance;
        require("min_distance", distance, "be positive", distance > 0.0)?;
        let angle = self.min_angle;
        let right = std::f64::consts::FRAC_PI_2;
        require(
            "min_angle",
            angle,
            "lie between 0 and a right angle (in radians)",
            angle > 0.0 && angle < right,
        )?;
        require(
            "max_move",
            self.max_move,
            "be positive and smaller than min_distance, so that members cannot jump over each other",
            self.max_move > 0.0 && self.max_move < distance,
        )?;
        match self.min_rigidity {
            Some(index) => require(
                "min_rigidity",
                index,
                "lie between 0 and 1 (an index is at most 1/(3n − 6))",
                index > 0.0 && index < 1.0,
            ),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_limit_is_checked() {
        let base = Limits::default();
        for (limits, name) in [
            (base.clone().with_min_length(0.0), "min_length"),
            (base.clone().with_max_length(0.4), "max_length"),
            (base.clone().with_min_distance(f64::NAN), "min_distance"),
            (base.clone().with_min_angle(2.0), "min_angle"),
            (base.clone().with_max_move(0.15), "max_move"),
            (base.clone().with_min_rigidity(Some(-1.0)), "min_rigidity"),
        ] {
            assert_eq!(limits.validate().unwrap_err().name, name);
        }
    }
}
