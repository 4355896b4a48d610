//! Physical configurations and paths: what planners return and what `check`
//! judges.

use nalgebra::Point3;

/// A static configuration of a structure, in physical terms alone.
#[derive(Clone, Debug, PartialEq)]
pub struct Configuration {
    /// Position of every node.
    pub positions: Vec<Point3<f64>>,
    /// Length of every element.
    pub lengths: Vec<f64>,
    /// Rest length of every element with a linear law.
    pub rest_lengths: Vec<Option<f64>>,
    /// Force of every element that carries one, tension positive.
    pub forces: Vec<Option<f64>>,
}

/// A sequence of configurations from start to goal.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Path {
    /// The configurations in order.
    pub configurations: Vec<Configuration>,
}
