//! Joins points with equal coordinates.

use std::collections::HashMap;

use nalgebra::Point3;

/// The different points, in order of first appearance, and for each given point its number among them.
pub(crate) fn weld(points: &[Point3<f64>]) -> (Vec<Point3<f64>>, Vec<usize>) {
    let mut numbers = HashMap::new();
    let mut different = Vec::new();
    let of_given = points
        .iter()
        .map(|p| {
            // Adding zero makes −0 and 0 the same.
            let key = [p.x, p.y, p.z].map(|x| (x + 0.0).to_bits());
            *numbers.entry(key).or_insert_with(|| {
                different.push(*p);
                different.len() - 1
            })
        })
        .collect();
    (different, of_given)
}
