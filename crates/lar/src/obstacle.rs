//! Obstacles on the ground: upright prisms of unlimited height with convex outlines.
//!
//! A robot keeps clear of an obstacle when the convex hull of its nodes, seen from above, stays
//! away from the outline. Cost of a gap: O(n log n) for the hull plus O(hull × outline).

use nalgebra::{Point2, Vector2, Vector3};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::Robot;
use crate::segment::closest_points;

/// An obstacle with a convex outline, seen from above.
///
/// # Examples
///
/// ```
/// use nalgebra::Point2;
/// use tensegra_lar::Obstacle;
///
/// let wall = Obstacle::rectangle([1.0, 0.0], [1.5, 4.0])?;
/// assert!(wall.contains(&Point2::new(1.2, 3.0), 0.0));
/// assert!(!wall.contains(&Point2::new(0.9, 3.0), 0.05));
/// assert!(wall.contains(&Point2::new(0.9, 3.0), 0.2));
/// # Ok::<(), tensegra_lar::ObstacleError>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Vec<[f64; 2]>", into = "Vec<[f64; 2]>")]
pub struct Obstacle {
    corners: Vec<Point2<f64>>,
}

/// An outline that encloses no convex region.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum ObstacleError {
    /// Fewer than three corners.
    #[error("an outline needs at least three corners, found {found}")]
    TooFewCorners {
        /// Number of corners found.
        found: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("corner {corner} is ({x}, {y}): give finite numbers")]
    NotFinite {
        /// The corner.
        corner: usize,
        /// First coordinate.
        x: f64,
        /// Second coordinate.
        y: f64,
    },
    /// The outline bends inward, or lies on a line.
    #[error("the outline is not convex at corner {corner}: split the obstacle into convex parts")]
    NotConvex {
        /// The corner.
        corner: usize,
    },
}

impl Obstacle {
    /// An obstacle with the given corners, in order around it, either way round.
    ///
    /// # Errors
    /// See [`ObstacleError`].
    pub fn new(corners: &[[f64; 2]]) -> Result<Self, ObstacleError> {
        if corners.len() < 3 {
            return Err(ObstacleError::TooFewCorners {
                found: corners.len(),
            });
        }
        for (corner, &[x, y]) in corners.iter().enumerate() {
            if !x.is_finite() || !y.is_finite() {
                return Err(ObstacleError::NotFinite { corner, x, y });
            }
        }
        let mut corners: Vec<Point2<f64>> =
            corners.iter().map(|&[x, y]| Point2::new(x, y)).collect();
        let count = corners.len();
        let area: f64 = (0..count)
            .map(|k| corners[k].coords.perp(&corners[(k + 1) % count].coords))
            .sum();
        if area < 0.0 {
            corners.reverse();
        }
        for k in 0..count {
            let (a, b, c) = (
                corners[k],
                corners[(k + 1) % count],
                corners[(k + 2) % count],
            );
            if !((b - a).perp(&(c - b)) > 0.0) {
                return Err(ObstacleError::NotConvex {
                    corner: (k + 1) % count,
                });
            }
        }
        Ok(Self { corners })
    }

    /// The axis-parallel rectangle between two opposite corners.
    ///
    /// # Errors
    /// Corners that are not finite or enclose no area.
    pub fn rectangle(min: [f64; 2], max: [f64; 2]) -> Result<Self, ObstacleError> {
        Self::new(&[
            [min[0], min[1]],
            [max[0], min[1]],
            [max[0], max[1]],
            [min[0], max[1]],
        ])
    }

    /// The corners, counter-clockwise.
    #[must_use]
    pub fn corners(&self) -> &[Point2<f64>] {
        &self.corners
    }

    /// Whether a point lies inside the outline or within `clearance` of it.
    #[must_use]
    pub fn contains(&self, point: &Point2<f64>, clearance: f64) -> bool {
        self.gap(&[*point]).distance <= clearance
    }

    /// Distance between the outline and the convex hull of `points`, with a line that separates
    /// them.
    pub(crate) fn gap(&self, points: &[Point2<f64>]) -> Gap {
        let hull = convex_hull(points);
        let inside = |polygon: &[Point2<f64>], p: &Point2<f64>| {
            polygon.len() > 2
                && (0..polygon.len()).all(|k| {
                    let (a, b) = (polygon[k], polygon[(k + 1) % polygon.len()]);
                    (b - a).perp(&(p - a)) >= 0.0
                })
        };
        let overlapping = inside(&self.corners, &hull[0]) || inside(&hull, &self.corners[0]);
        let mut best = Gap {
            distance: f64::INFINITY,
            normal: Vector2::zeros(),
            offset: 0.0,
        };
        let lift = |p: &Point2<f64>| Vector3::new(p.x, p.y, 0.0);
        for k in 0..hull.len() {
            let (a, b) = (lift(&hull[k]), lift(&hull[(k + 1) % hull.len()]));
            for l in 0..self.corners.len() {
                let c = lift(&self.corners[l]);
                let d = lift(&self.corners[(l + 1) % self.corners.len()]);
                // A hull of one point is a segment of length zero: take its distance directly.
                let (to_obstacle, there) = if a == b {
                    let side = d - c;
                    let t = ((a - c).dot(&side) / side.norm_squared()).clamp(0.0, 1.0);
                    (c + side * t - a, c + side * t)
                } else {
                    let closest = closest_points(&a, &b, &c, &d);
                    (-closest.separation, c + (d - c) * closest.t)
                };
                let distance = to_obstacle.norm();
                if distance < best.distance {
                    let normal = if distance > 0.0 {
                        to_obstacle.xy() / distance
                    } else {
                        Vector2::zeros()
                    };
                    best = Gap {
                        distance,
                        normal,
                        offset: normal.dot(&there.xy()),
                    };
                }
            }
        }
        if overlapping {
            best.distance = 0.0;
        }
        best
    }
}

impl TryFrom<Vec<[f64; 2]>> for Obstacle {
    type Error = ObstacleError;

    fn try_from(corners: Vec<[f64; 2]>) -> Result<Self, ObstacleError> {
        Self::new(&corners)
    }
}

impl From<Obstacle> for Vec<[f64; 2]> {
    fn from(obstacle: Obstacle) -> Self {
        obstacle
            .corners
            .iter()
            .map(|corner| [corner.x, corner.y])
            .collect()
    }
}

/// The gap between a set of points and an obstacle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Gap {
    /// Distance of the convex hulls, zero where they overlap.
    pub distance: f64,
    /// Unit vector towards the obstacle.
    pub normal: Vector2<f64>,
    /// The obstacle lies where normal·p ≥ offset.
    pub offset: f64,
}

/// Positions of a robot's nodes seen from above.
pub(crate) fn plan_view(robot: &Robot, coordinates: &[f64]) -> Vec<Point2<f64>> {
    (0..robot.graph().num_nodes())
        .map(|node| robot.dimension().node(coordinates, node).xy().into())
        .collect()
}

/// Corners of the convex hull, counter-clockwise (Andrew's monotone chain). At least one point
/// must be given.
pub(crate) fn convex_hull(points: &[Point2<f64>]) -> Vec<Point2<f64>> {
    let mut sorted = points.to_vec();
    sorted.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    sorted.dedup();
    if sorted.len() < 3 {
        return sorted;
    }
    let chain = |points: &mut dyn Iterator<Item = Point2<f64>>| {
        let mut chain: Vec<Point2<f64>> = Vec::new();
        for point in points {
            while let [.., a, b] = chain.as_slice()
                && (b - a).perp(&(point - b)) <= 0.0
            {
                chain.pop();
            }
            chain.push(point);
        }
        chain.pop();
        chain
    };
    let mut hull = chain(&mut sorted.iter().copied());
    hull.extend(chain(&mut sorted.iter().rev().copied()));
    hull
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_and_separating_lines() {
        let block = Obstacle::rectangle([2.0, 0.0], [3.0, 1.0]).unwrap();
        let triangle = [(0.0, 0.0), (1.0, 0.5), (0.0, 1.0), (0.3, 0.5)];
        let triangle = triangle.map(|(x, y)| Point2::new(x, y));
        let gap = block.gap(&triangle);
        assert!((gap.distance - 1.0).abs() < 1e-12);
        assert!((gap.normal - Vector2::x()).norm() < 1e-12 && (gap.offset - 2.0).abs() < 1e-12);
        // A hull that encloses the obstacle, and one inside it.
        let around = [(-9.0, -9.0), (9.0, -9.0), (0.0, 9.0)].map(|(x, y)| Point2::new(x, y));
        assert_eq!(block.gap(&around).distance, 0.0);
        assert_eq!(block.gap(&[Point2::new(2.5, 0.5)]).distance, 0.0);
        assert!((block.gap(&[Point2::new(2.5, 1.5)]).distance - 0.5).abs() < 1e-12);
    }

    #[test]
    fn outlines_are_checked() {
        assert!(matches!(
            Obstacle::new(&[[0.0, 0.0], [1.0, 0.0]]),
            Err(ObstacleError::TooFewCorners { found: 2 })
        ));
        let dent = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [1.0, 0.5], [0.0, 2.0]];
        assert_eq!(
            Obstacle::new(&dent),
            Err(ObstacleError::NotConvex { corner: 3 })
        );
        let clockwise = [[0.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, 0.0]];
        assert!(
            Obstacle::new(&clockwise)
                .unwrap()
                .contains(&Point2::new(0.5, 0.5), 0.0)
        );
        assert!(Obstacle::new(&[[0.0, 0.0], [1.0, f64::NAN], [1.0, 1.0]]).is_err());
    }

    #[test]
    fn hulls_drop_inner_and_collinear_points() {
        let points = [
            (0., 0.),
            (1., 0.),
            (2., 0.),
            (2., 2.),
            (0., 2.),
            (1., 1.),
            (0., 0.),
        ];
        let hull = convex_hull(&points.map(|(x, y)| Point2::new(x, y)));
        assert_eq!(hull.len(), 4);
    }
}
