//! Optimality and feasibility of a point, measured from the problem's functions alone.

/// Residuals of the first-order (Karush–Kuhn–Tucker) conditions of an [`Nlp`](crate::Nlp).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct KktResiduals {
    /// Largest violation of a constraint or variable bound, in its own units.
    pub infeasibility: f64,
    /// ‖∇f + Jᵀλ + z‖∞ with the bound multipliers z that minimise it.
    pub stationarity: f64,
    /// `stationarity` divided by the largest of the terms that cancel in it, ‖∇f‖∞ and
    /// max |λᵢ|‖∇cᵢ‖∞.
    pub relative_stationarity: f64,
    /// Largest product of a multiplier and the distance of its constraint from the bound that
    /// the multiplier's sign stands for.
    pub complementarity: f64,
}
