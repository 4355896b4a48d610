//! Pictures of an atlas in the space of three quantities (Porta and
//! Hernández-Juan 2016, figures 5 and 6), and its area.

use tensegra_atlas::{OutlinePoint, Workspace};
use tensegra_io::{Axis, Curve, Patch, Picture, PictureError, Quantity, SpacePlot, Units};
use tensegra_model::{Configuration, Path, Problem};
use tensegra_sampling::{AtlasRrt, PlannerOptions};

use crate::{
    exploring::{AtlasError, EquilibriumAtlas, border_kind},
    planning::PlanningError,
    quantity::Shade,
};

/// Colour of borders that are limits (black) and contacts (vermilion).
const LIMIT_COLOR: usize = 6;
const CONTACT_COLOR: usize = 1;
/// Colour of a path (reddish purple), which no shade has.
const PATH_COLOR: usize = 3;

/// What is drawn of an atlas.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct AtlasView {
    /// The three quantities that configurations are shown by.
    pub quantities: [Quantity; 3],
    /// What the charts are coloured by.
    pub shade: Shade,
    /// Units for the axes.
    pub units: Units,
    /// A title.
    pub title: String,
}

impl AtlasView {
    /// A view of the three quantities, coloured by the shade.
    pub fn new(quantities: [Quantity; 3], shade: Shade, title: impl Into<String>) -> Self {
        Self {
            quantities,
            shade,
            units: Units::default(),
            title: title.into(),
        }
    }
}

/// A tree on the manifold: points with the index of their parents.
pub type Tree = Vec<(Vec<f64>, Option<usize>)>;

impl EquilibriumAtlas {
    /// The configurations at the centres of the charts.
    pub fn configurations(&self) -> Vec<Configuration> {
        (0..self.charts.len())
            .map(|i| self.manifold.configuration(self.charts.chart(i).center()))
            .collect()
    }

    /// The outlines of the charts' domains up to the borders of the component, for
    /// k = 1 and 2; empty for others.
    ///
    /// # Errors
    /// [`AtlasError`] when the problem is not the one that was explored.
    pub fn outlines(&self, problem: &Problem) -> Result<Vec<Vec<OutlinePoint>>, AtlasError> {
        let free = self.valid_space(problem)?;
        let mut work = Workspace::default();
        Ok((0..self.charts.len())
            .map(|i| {
                self.charts
                    .outline(self.manifold.as_ref(), &free, i, &mut work)
            })
            .collect())
    }

    /// The area (for k = 1 the length) of the component in the coordinates of the
    /// formulation, by flat triangles: an estimate that is low by a share of the
    /// order of ρ². None for other dimensions.
    pub fn area(&self, outlines: &[Vec<OutlinePoint>]) -> Option<f64> {
        let of_chart = |i: usize, outline: &[OutlinePoint]| -> f64 {
            let center = self.charts.chart(i).center();
            match self.dimension() {
                1 => outline.iter().map(|p| distance(center, &p.point)).sum(),
                _ => (0..outline.len())
                    .map(|j| {
                        let next = &outline[(j + 1) % outline.len()].point;
                        triangle(center, &outline[j].point, next)
                    })
                    .sum(),
            }
        };
        let outlined = outlines.iter().enumerate();
        (self.dimension() <= 2).then(|| outlined.map(|(i, outline)| of_chart(i, outline)).sum())
    }

    /// Draws the atlas, and on it a path: for k = 2 a polygon for each chart, up to
    /// the borders, which are lines of their own; for k = 1 the links between
    /// neighbouring charts, for more those from each to the one that it was reached from.
    ///
    /// # Errors
    /// [`PictureError`] when a quantity has no value.
    pub fn draw(
        &self,
        problem: &Problem,
        outlines: &[Vec<OutlinePoint>],
        view: &AtlasView,
        path: Option<&Path>,
    ) -> Result<Picture, PictureError> {
        let mut plot = self.plot(problem, outlines, view)?;
        for (label, kind, color) in [
            ("limit", "limit", LIMIT_COLOR),
            ("collision", "contact", CONTACT_COLOR),
        ] {
            let sides = self.border_sides(problem, outlines, view, kind)?;
            if !sides.is_empty() {
                plot = plot.curve(Curve::segments(label, sides).color(color));
            }
        }
        if let Some(path) = path {
            let points = path.configurations.iter();
            let points = points.map(|c| self.place(problem, view, c));
            let points = points.collect::<Result<_, _>>()?;
            plot = plot.curve(Curve::path("path", points).color(PATH_COLOR));
        }
        plot.draw()
    }

    /// Draws a tree on the atlas.
    ///
    /// # Errors
    /// [`PictureError`] when a quantity has no value.
    pub fn draw_tree(
        &self,
        problem: &Problem,
        outlines: &[Vec<OutlinePoint>],
        view: &AtlasView,
        tree: &Tree,
    ) -> Result<Picture, PictureError> {
        let mut edges = Vec::new();
        for (point, parent) in tree {
            if let Some(parent) = parent {
                let ends = [&tree[*parent].0, point].map(|x| self.manifold.configuration(x));
                let [a, b] = ends.map(|c| self.place(problem, view, &c));
                edges.push([a?, b?]);
            }
        }
        let label = format!("tree of {} nodes", tree.len());
        self.plot(problem, outlines, view)?
            .curve(Curve::segments(label, edges))
            .draw()
    }

    /// Grows a tree of AtlasRRT from the start, without a goal, until it has the
    /// given number of nodes (or does not grow any more).
    ///
    /// # Errors
    /// [`AtlasError`] when the start is refused.
    pub fn grow_tree(
        &self,
        problem: &Problem,
        nodes: usize,
        seed: u64,
    ) -> Result<Tree, AtlasError> {
        let free = self.valid_space(problem)?;
        let mut options = PlannerOptions::default();
        options.seed = seed;
        options.step = problem.settings.step;
        options.domain = self.charts.domain();
        options.time_limit = problem.settings.time_limit;
        let start = self.charts.chart(0).center();
        Ok(AtlasRrt::new(self.manifold.as_ref(), &free, options)
            .explore(start, nodes)
            .map_err(PlanningError::from)?)
    }

    /// The charts, coloured.
    fn plot(
        &self,
        problem: &Problem,
        outlines: &[Vec<OutlinePoint>],
        view: &AtlasView,
    ) -> Result<SpacePlot, PictureError> {
        let structure = &problem.structure;
        let axes = view.quantities.map(|q| q.axis(structure, &view.units));
        let plot = SpacePlot::new(axes).title(&view.title).size(560.0, 460.0);
        let centers = self.configurations();
        let bar: Axis = view.shade.axis(structure, &view.units);
        let value = |configuration: &Configuration| {
            let value = view.shade.value(structure, configuration);
            value.ok_or_else(|| PictureError::NoValue(bar.title()))
        };
        let mut patches = Vec::new();
        if self.dimension() == 2 {
            for (center, outline) in centers.iter().zip(outlines) {
                let corners = outline.iter().map(|p| self.point(problem, view, &p.point));
                patches.push(Patch {
                    corners: corners.collect::<Result<_, _>>()?,
                    value: value(center)?,
                });
            }
            patches.retain(|patch| patch.corners.len() > 2);
        } else {
            for (i, j) in self.links() {
                let [a, b] = [i, j].map(|chart| &centers[chart]);
                patches.push(Patch {
                    corners: vec![self.place(problem, view, a)?, self.place(problem, view, b)?],
                    value: 0.5 * (value(a)? + value(b)?),
                });
            }
        }
        Ok(plot.polygons(bar, patches))
    }

    /// Pairs of charts that a picture joins: neighbours on a curve; where charts have
    /// many neighbours, each and the one that it was reached from.
    fn links(&self) -> Vec<(usize, usize)> {
        let charts = 0..self.charts.len();
        if self.dimension() == 1 {
            let before = |i: usize| self.charts.neighbours(i).filter(move |j| *j < i);
            charts
                .flat_map(|i| before(i).map(move |j| (i, j)))
                .collect()
        } else {
            charts
                .filter_map(|i| Some((i, self.charts.parent(i)?)))
                .collect()
        }
    }

    /// The sides of outlines that lie on a border of one kind.
    fn border_sides(
        &self,
        problem: &Problem,
        outlines: &[Vec<OutlinePoint>],
        view: &AtlasView,
        kind: &str,
    ) -> Result<Vec<[[f64; 3]; 2]>, PictureError> {
        let mut sides = Vec::new();
        if self.dimension() != 2 {
            return Ok(sides);
        }
        for outline in outlines {
            for (i, a) in outline.iter().enumerate() {
                let b = &outline[(i + 1) % outline.len()];
                let [Some(from), Some(to)] = [a.border, b.border].map(|b| b.map(border_kind))
                else {
                    continue;
                };
                if from == kind && (to == kind || i % 2 == 0) {
                    let [a, b] = [a, b].map(|p| self.point(problem, view, &p.point));
                    sides.push([a?, b?]);
                }
            }
        }
        Ok(sides)
    }

    fn point(
        &self,
        problem: &Problem,
        view: &AtlasView,
        x: &[f64],
    ) -> Result<[f64; 3], PictureError> {
        self.place(problem, view, &self.manifold.configuration(x))
    }

    fn place(
        &self,
        problem: &Problem,
        view: &AtlasView,
        configuration: &Configuration,
    ) -> Result<[f64; 3], PictureError> {
        let mut place = [0.0; 3];
        for (value, quantity) in place.iter_mut().zip(view.quantities) {
            *value = quantity.value(configuration).ok_or_else(|| {
                let axis = quantity.axis(&problem.structure, &view.units);
                PictureError::NoValue(axis.title())
            })?;
        }
        Ok(place)
    }
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    let squares = a.iter().zip(b).map(|(a, b)| (a - b).powi(2));
    squares.sum::<f64>().sqrt()
}

/// Area of a triangle (Heron).
fn triangle(a: &[f64], b: &[f64], c: &[f64]) -> f64 {
    let (x, y, z) = (distance(a, b), distance(b, c), distance(c, a));
    let s = 0.5 * (x + y + z);
    (s * (s - x) * (s - y) * (s - z)).max(0.0).sqrt()
}
