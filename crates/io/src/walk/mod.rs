//! Walks of truss robots: files, logs and pictures.

mod file;
mod log;
mod picture;

use nalgebra::Point3;
use tensegra_lar::{Dimension, Walk};

pub use file::{WalkReadError, WalkWriteError, read_format, read_walk_file, write_walk_file};
pub use log::{encode_walk_log, write_walk_log};
pub use picture::{
    TrackingRun, draw_gait, draw_grid_plan, draw_margins, draw_track, draw_tracking_error,
};

/// A walk whose lists do not fit together.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{place} of the walk {what}")]
pub struct WalkMismatch {
    place: String,
    what: &'static str,
}

/// What pictures and logs show of a walk, in space.
struct Frames {
    members: Vec<[usize; 2]>,
    frames: Vec<Frame>,
}

/// One configuration in space; a planar walk stands in the plane y = 0.
#[derive(Clone)]
struct Frame {
    positions: Vec<Point3<f64>>,
    support: Vec<usize>,
    centre: Point3<f64>,
}

impl Frame {
    /// Corners of the support polygon: two for a planar walk.
    fn support_corners(&self) -> Vec<Point3<f64>> {
        let corners = self.support.iter();
        corners.map(|&node| self.positions[node]).collect()
    }
}

impl Frames {
    /// Every configuration of a walk.
    fn of(walk: &Walk) -> Result<Self, WalkMismatch> {
        let nodes = walk.nodes.len();
        let refuse = |place: String, what| Err(WalkMismatch { place, what });
        if walk.configurations.is_empty() {
            return refuse("the list of configurations".to_owned(), "is empty");
        }
        if walk.mass_fractions.len() != nodes {
            return refuse("the list of masses".to_owned(), "has not one for each node");
        }
        let ends = walk.edges.iter().flatten();
        if let Some(node) = ends.copied().find(|&node| node >= nodes) {
            return refuse(
                format!("node {node}"),
                "is the end of a member, but not there",
            );
        }
        let mut frames = Vec::with_capacity(walk.configurations.len());
        for (index, configuration) in walk.configurations.iter().enumerate() {
            let place = || format!("configuration {index}");
            let positions: Option<Vec<Point3<f64>>> = configuration
                .positions
                .iter()
                .map(|p| in_space(walk.dimension, p))
                .collect();
            let Some(positions) = positions.filter(|positions| positions.len() == nodes) else {
                return refuse(
                    place(),
                    "has not one position of finite numbers for each node",
                );
            };
            if configuration.support.iter().any(|&node| node >= nodes) {
                return refuse(place(), "stands on a node that is not there");
            }
            if configuration.lengths.len() != walk.edges.len() {
                return refuse(place(), "has not one length for each member");
            }
            frames.push(frame(walk, positions, configuration.support.clone()));
        }
        if walk.rolls.iter().any(|&roll| roll + 1 >= frames.len()) {
            return refuse("a roll".to_owned(), "has no configuration after it");
        }
        Ok(Self {
            members: walk.edges.clone(),
            frames,
        })
    }
}

fn frame(walk: &Walk, positions: Vec<Point3<f64>>, support: Vec<usize>) -> Frame {
    let weighted = walk.mass_fractions.iter().zip(&positions);
    let centre = weighted.fold(Point3::origin(), |sum, (fraction, position)| {
        sum + position.coords * *fraction
    });
    Frame {
        positions,
        support,
        centre,
    }
}

fn in_space(dimension: Dimension, position: &[f64]) -> Option<Point3<f64>> {
    if !position.iter().all(|value| value.is_finite()) {
        return None;
    }
    match (dimension, position) {
        (Dimension::Two, &[x, z]) => Some(Point3::new(x, 0.0, z)),
        (Dimension::Three, &[x, y, z]) => Some(Point3::new(x, y, z)),
        _ => None,
    }
}
