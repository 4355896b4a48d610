//! Which charts have their centres near a point.
//!
//! Centres are hashed by their coordinates along up to three tangent vectors of
//! the first chart, in boxes as wide as the search radius: projections shorten
//! distances, so that no near centre is missed. Cost of a look-up: the charts in
//! at most 27 boxes.

use std::collections::HashMap;

use crate::{chart::Chart, qr::dot};

/// Directions that boxes are counted along.
const AXES: usize = 3;

#[derive(Clone, Debug)]
pub(super) struct CenterIndex {
    axes: Vec<Vec<f64>>,
    width: f64,
    boxes: HashMap<[i64; AXES], Vec<usize>>,
}

impl CenterIndex {
    /// An index along the tangent vectors of a chart, for searches within `width`.
    pub(super) fn new(chart: &Chart, width: f64) -> Self {
        let axes = (0..chart.dimension().min(AXES)).map(|j| chart.tangent(j).to_vec());
        Self {
            axes: axes.collect(),
            width,
            boxes: HashMap::new(),
        }
    }

    fn place(&self, x: &[f64]) -> [i64; AXES] {
        let mut place = [0; AXES];
        for (place, axis) in place.iter_mut().zip(&self.axes) {
            *place = (dot(axis, x) / self.width).floor() as i64;
        }
        place
    }

    pub(super) fn insert(&mut self, index: usize, center: &[f64]) {
        self.boxes
            .entry(self.place(center))
            .or_default()
            .push(index);
    }

    /// Writes, in ascending order, charts among which are all those whose centres
    /// lie within the width of x.
    pub(super) fn near(&self, x: &[f64], found: &mut Vec<usize>) {
        found.clear();
        let place = self.place(x);
        for code in 0..3_usize.pow(self.axes.len() as u32) {
            let mut neighbour = place;
            let mut rest = code;
            for coordinate in neighbour.iter_mut().take(self.axes.len()) {
                *coordinate += rest as i64 % 3 - 1;
                rest /= 3;
            }
            if let Some(charts) = self.boxes.get(&neighbour) {
                found.extend_from_slice(charts);
            }
        }
        found.sort_unstable();
    }
}
