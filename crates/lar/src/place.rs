//! Where walks may start and lead: away from obstacles.

use nalgebra::Point2;
use thiserror::Error;

use crate::obstacle::plan_view;
use crate::{Obstacle, Robot, Stance};

/// A start or a waypoint that cannot be.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum PlaceError {
    /// A waypoint is not finite.
    #[error("waypoint {index} is ({x}, {y}): give finite numbers")]
    Waypoint {
        /// Index of the waypoint.
        index: usize,
        /// First coordinate.
        x: f64,
        /// Second coordinate.
        y: f64,
    },
    /// A waypoint lies inside an obstacle, or too close to it.
    #[error(
        "waypoint {index} lies inside obstacle {obstacle} or within {clearance} of it: move one of them"
    )]
    WaypointInObstacle {
        /// Index of the waypoint.
        index: usize,
        /// Index of the obstacle.
        obstacle: usize,
        /// Distance that the robot keeps from obstacles.
        clearance: f64,
    },
    /// The robot starts inside an obstacle, or too close to it.
    #[error("the robot starts within {clearance} of obstacle {obstacle}: move one of them")]
    StartInObstacle {
        /// Index of the obstacle.
        obstacle: usize,
        /// Distance that the robot keeps from obstacles.
        clearance: f64,
    },
}

/// Obstacles with the distance to keep from them, seen from above.
#[derive(Debug, Clone, Copy)]
pub(crate) struct KeptClear<'a> {
    pub obstacles: &'a [Obstacle],
    pub clearance: f64,
}

impl KeptClear<'_> {
    /// The first obstacle that the hull of some points comes too close to.
    pub(crate) fn touched(&self, points: &[Point2<f64>]) -> Option<usize> {
        self.obstacles
            .iter()
            .position(|o| !(o.gap(points).distance > self.clearance))
    }

    /// Refuses a start too close to an obstacle, and waypoints that are, or are not finite.
    pub(crate) fn check(
        &self,
        robot: &Robot,
        start: &Stance,
        waypoints: impl IntoIterator<Item = Point2<f64>>,
    ) -> Result<(), PlaceError> {
        let clearance = self.clearance;
        if let Some(obstacle) = self.touched(&plan_view(robot, &start.coordinates)) {
            return Err(PlaceError::StartInObstacle {
                obstacle,
                clearance,
            });
        }
        for (index, point) in waypoints.into_iter().enumerate() {
            let (x, y) = (point.x, point.y);
            if !x.is_finite() || !y.is_finite() {
                return Err(PlaceError::Waypoint { index, x, y });
            }
            if let Some(obstacle) = self.touched(&[point]) {
                return Err(PlaceError::WaypointInObstacle {
                    index,
                    obstacle,
                    clearance,
                });
            }
        }
        Ok(())
    }
}
