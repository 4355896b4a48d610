//! Pictures as SVG and PNG: structures, quantities along paths, paths in the
//! space of three quantities, atlases, and the charts of benchmarks.

mod axis;
mod camera;
mod canvas;
mod chart;
mod motion;
mod raster;
mod scene;
mod solid;
mod space;
mod style;
mod text;

use std::path::Path;

pub use axis::{Axis, Scale};
pub use camera::View;
pub use chart::{Chart, Level, PowerLaw, Region, Series, fit_power_law};
pub use motion::{
    Quantity, Units, draw_configuration, draw_forces, draw_lengths, draw_paths, draw_rest_lengths,
    draw_snapshots,
};
pub use raster::rasterise;
pub use scene::{Scene, SceneOptions, draw_scenes};
pub use space::{Curve, Patch, SpacePlot};
use svg::node::element::Group;

use crate::atomic::{WriteError, write_atomic};
use canvas::{Canvas, Fill};
use style::WHITE;

/// Why a picture was not drawn or not written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PictureError {
    /// There is nothing to draw.
    #[error("{what} is empty; there is nothing to draw")]
    Empty {
        /// What is empty.
        what: String,
    },
    /// A number is infinite, no number, or too large.
    #[error("{what} holds {value}; only numbers of size below 1e100 can be drawn")]
    NotFinite {
        /// What holds it.
        what: String,
        /// The number.
        value: f64,
    },
    /// A number that a logarithmic axis cannot show.
    #[error(
        "{what} holds {value}, but its axis is logarithmic; give positive numbers or a linear axis"
    )]
    NotPositive {
        /// What holds it.
        what: String,
        /// The number.
        value: f64,
    },
    /// The path does not fit the structure.
    #[error(transparent)]
    Path(#[from] crate::consistency::PathMismatch),
    /// The lists of a walk do not fit together.
    #[error(transparent)]
    Walk(#[from] crate::walk::WalkMismatch),
    /// A quantity that an element or node does not have.
    #[error("{0} has no value; choose a quantity that every configuration has")]
    NoValue(String),
    /// The picture cannot be turned into pixels.
    #[error("the picture cannot be turned into pixels: {reason}")]
    Raster {
        /// What is wrong.
        reason: String,
    },
    /// The file cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}

/// A finished picture.
///
/// Its size is in CSS pixels, 96 to the inch: text is 7.5 to 9.5 points high
/// when printed in that size.
#[derive(Clone, Debug)]
pub struct Picture {
    body: Group,
    width: f64,
    height: f64,
}

impl Picture {
    pub(crate) fn new(canvas: Canvas, [width, height]: [f64; 2]) -> Self {
        Self {
            body: canvas.into_group(),
            width: width.ceil(),
            height: height.ceil(),
        }
    }

    /// Width and height in pixels.
    pub fn size(&self) -> [f64; 2] {
        [self.width, self.height]
    }

    /// The picture as an SVG document on white ground.
    pub fn to_svg(&self) -> String {
        let mut page = Canvas::new();
        page.rectangle([0.0, 0.0], self.size(), Fill::new(WHITE));
        page.put(self.body.clone(), [0.0, 0.0]);
        let document = svg::Document::new()
            .set("viewBox", (0.0, 0.0, self.width, self.height))
            .set("width", self.width)
            .set("height", self.height)
            .add(page.into_group());
        format!("{document}\n")
    }

    /// The picture as a PNG image, `scale` dots for each pixel: 3 gives about
    /// 300 dots to the inch.
    ///
    /// # Errors
    /// [`PictureError::Raster`] when the image would be empty or too large.
    pub fn to_png(&self, scale: f64) -> Result<Vec<u8>, PictureError> {
        rasterise(&self.to_svg(), scale)
    }

    /// Writes the picture as an SVG file, whole or not at all.
    ///
    /// # Errors
    /// [`WriteError`] when the file cannot be written.
    pub fn write_svg(&self, file: &Path) -> Result<(), WriteError> {
        write_atomic(file, self.to_svg().as_bytes())
    }

    /// Writes the picture as a PNG file, `scale` dots for each pixel, whole or
    /// not at all.
    ///
    /// # Errors
    /// [`PictureError`] when the image would be empty or too large, or the file
    /// cannot be written.
    pub fn write_png(&self, file: &Path, scale: f64) -> Result<(), PictureError> {
        Ok(write_atomic(file, &self.to_png(scale)?)?)
    }

    /// Pictures side by side, `columns` to a row.
    pub fn grid(pictures: &[Self], columns: usize) -> Self {
        const GAP: f64 = 14.0;
        let columns = columns.max(1);
        let mut page = Canvas::new();
        let mut reach: [f64; 2] = [0.0; 2];
        for row in pictures.chunks(columns) {
            let top = if reach[1] > 0.0 { reach[1] + GAP } else { 0.0 };
            let mut left = 0.0;
            for picture in row {
                page.put(picture.body.clone(), [left, top]);
                reach[0] = reach[0].max(left + picture.width);
                reach[1] = reach[1].max(top + picture.height);
                left += picture.width + GAP;
            }
        }
        Self::new(page, reach)
    }
}
