//! Files that other tools open: path files, MCAP logs, pictures.
//!
//! - [`write_path_file`], [`read_path_file`]: a motion as one JSON object, bit for
//!   bit, which finds its problem again ([`PathFile::read_problem`]).
//! - [`write_atlas_file`], [`read_atlas_file`]: the atlas of a component, to be queried
//!   again.
//! - [`write_log`]: the motion as an MCAP log, which Foxglove plays and plots.
//! - [`draw_snapshots`], [`draw_forces`], [`draw_lengths`], [`draw_paths`]: the
//!   usual [`Picture`]s of a motion, as SVG and PNG. They are made of [`Scene`],
//!   [`Chart`] and [`SpacePlot`], which draw anything else: gaits, atlases,
//!   benchmarks.
//! - [`BenchRow`], [`bench_table`]: measured figures as JSON and Markdown.
//!
//! Whatever is written appears as a whole or not at all ([`write_atomic`]), and
//! follows from its input alone: same input, same bytes.
//!
//! # Examples
//! ```
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! use tensegra_io::{
//!     LogOptions, PathFile, Units, draw_snapshots, read_path_file, write_log, write_path_file,
//! };
//! use tensegra_model::{Configuration, Path, Problem, StructureBuilder};
//!
//! // A strut that a cable turns about one of its ends.
//! let structure = StructureBuilder::planar()
//!     .strut("s", ["foot", "tip"], 1.0)
//!     .cable("c", ["tip", "wall"], 0.1..=3.0, 10.0, 0.0..=2.0)
//!     .build()?;
//! let turned = |angle: f64| {
//!     let positions = [[0.0, 0.0, 0.0], [angle.cos(), angle.sin(), 0.0], [-1.0, 1.0, 0.0]];
//!     let positions = positions.map(Into::into).to_vec();
//!     let length = nalgebra::distance(&positions[1], &positions[2]);
//!     Configuration {
//!         positions,
//!         lengths: vec![1.0, length],
//!         rest_lengths: vec![None, Some(length - 0.1)],
//!         forces: vec![Some(-1.0), Some(1.0)],
//!     }
//! };
//! let path = Path {
//!     configurations: (0..=20).map(|i| turned(0.05 * f64::from(i))).collect(),
//! };
//! let problem = Problem::new("crane", structure);
//!
//! let folder = tempfile::tempdir()?;
//! let file = folder.path().join("path.json");
//! write_path_file(&file, &PathFile::new(&problem, path.clone()))?;
//! assert_eq!(read_path_file(&file)?.path, path);
//! write_log(&folder.path().join("path.mcap"), &problem, &path, &LogOptions::default())?;
//! let units = Units::new("m", "N");
//! draw_snapshots(&problem.structure, &problem.environment, &path, 2, &units)?
//!     .write_svg(&folder.path().join("snapshots.svg"))?;
//! # Ok(())
//! # }
//! ```

mod atlas_file;
mod atomic;
mod bench;
mod consistency;
mod geometry;
mod json;
mod log;
mod number;
mod path_file;
mod picture;
mod walk;

pub use atlas_file::{
    AtlasFile, AtlasReadError, AtlasWriteError, BorderRecord, ChartRecord, read_atlas_file,
    write_atlas_file,
};
pub use atomic::{WriteError, write_atomic};
pub use bench::{
    BenchReadError, BenchRow, Column, MarkdownTable, ReferenceValue, bench_table, quantile,
    read_bench_rows, write_bench_rows,
};
pub use consistency::PathMismatch;
pub use log::{LogError, LogOptions, encode_log, write_log};
pub use path_file::{
    ElementRecord, PathFile, PathWriteError, ProblemReference, ReadError, TextDigest,
    read_path_file, write_path_file,
};
pub use picture::{
    Axis, Chart, Curve, Level, Patch, Picture, PictureError, PowerLaw, Quantity, Region, Scale,
    Scene, SceneOptions, Series, SpacePlot, Units, View, draw_configuration, draw_forces,
    draw_lengths, draw_paths, draw_rest_lengths, draw_scenes, draw_snapshots, fit_power_law,
    rasterise,
};
pub use walk::{
    TrackingRun, WalkMismatch, WalkReadError, WalkWriteError, draw_gait, draw_grid_plan,
    draw_margins, draw_track, draw_tracking_error, encode_walk_log, read_format, read_walk_file,
    write_walk_file, write_walk_log,
};
