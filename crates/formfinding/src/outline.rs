//! Which forms are of one shape.

use nalgebra::Point3;

/// What tells shapes apart, whatever rigid motion they have made: the distances of all nodes, and
/// on which side of three nodes the others lie.
pub(crate) struct Outline {
    distances: Vec<f64>,
    volume: f64,
}

impl Outline {
    pub(crate) fn of(positions: &[Point3<f64>]) -> Self {
        let mut distances = Vec::with_capacity(positions.len() * positions.len() / 2);
        for (i, a) in positions.iter().enumerate() {
            distances.extend(positions[i + 1..].iter().map(|b| (b - a).norm()));
        }
        let volume = match positions {
            [a, b, c, others @ ..] => others
                .iter()
                .map(|d| (b - a).cross(&(c - a)).dot(&(d - a)))
                .max_by(|a, b| a.abs().total_cmp(&b.abs()))
                .unwrap_or(0.0),
            _ => 0.0,
        };
        Self { distances, volume }
    }

    /// Whether no two nodes are farther apart or closer by more than `apart`.
    pub(crate) fn is_like(&self, other: &Self, apart: f64) -> bool {
        let mut pairs = self.distances.iter().zip(&other.distances);
        // Shapes that are all but flat have no side.
        let flat = apart
            * self
                .distances
                .iter()
                .fold(0.0_f64, |m, d| m.max(*d))
                .powi(2);
        let sides = self.volume.signum() == other.volume.signum()
            || self.volume.abs() < flat
            || other.volume.abs() < flat;
        sides && pairs.all(|(a, b)| (a - b).abs() <= apart)
    }
}
