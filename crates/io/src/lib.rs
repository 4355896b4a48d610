//! Files that other tools open: path files, MCAP logs, pictures.

mod atomic;
mod bench;
mod consistency;
mod geometry;
mod json;
mod log;
mod number;
mod path_file;
mod picture;

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
