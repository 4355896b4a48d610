//! Plots in the space of three quantities: paths, trees, points, and polygons
//! coloured by a fourth quantity, such as the charts of an atlas.
//!
//! Everything is drawn from the farthest to the nearest: polygons by their
//! centre, lines in pieces short against them. Lines behind polygons are faint.

use nalgebra::Point3;

use super::{
    Axis, Picture, PictureError, View,
    axis::Fitted,
    camera::Camera,
    canvas::{Anchor, Canvas, Fill, Label, Place, Stroke},
    chart::{Legend, Sample, palette},
    style::{DASHES, FAINT, GRID, INK, Rgb, SERIES, SMALL, TEXT, TITLE, WHITE, viridis},
    text::width,
};
use crate::geometry::Bounds;

/// A plot of curves and polygons in the space of three quantities.
///
/// # Examples
/// ```
/// # fn main() -> Result<(), tensegra_io::PictureError> {
/// use tensegra_io::{Axis, Curve, SpacePlot};
/// let axes = ["length of c1", "length of c2", "length of c3"].map(Axis::new);
/// let helix = (0..50).map(|i| f64::from(i) * 0.2);
/// let helix = helix.map(|t| [t.cos(), t.sin(), 0.1 * t]).collect();
/// let picture = SpacePlot::new(axes).curve(Curve::path("planned", helix)).draw()?;
/// assert!(picture.to_svg().contains("length of c3"));
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct SpacePlot {
    title: Option<String>,
    axes: [Axis; 3],
    curves: Vec<Curve>,
    polygons: Vec<Patch>,
    polygon_axis: Axis,
    view: View,
    equal_scale: bool,
    size: [f64; 2],
}

/// A line, a set of segments or a set of points in space.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    label: String,
    look: Look,
    color: Option<usize>,
    width: f64,
}

#[derive(Clone, Debug, PartialEq)]
enum Look {
    /// From start to goal, both marked.
    Path(Vec<[f64; 3]>),
    Segments(Vec<[[f64; 3]; 2]>),
    Points(Vec<[f64; 3]>),
}

impl Curve {
    fn new(label: impl Into<String>, look: Look, width: f64) -> Self {
        Self {
            label: label.into(),
            look,
            color: None,
            width,
        }
    }

    /// A path from start to goal, both of which are marked. Here as in the
    /// other curves, an empty label makes no entry in the legend.
    pub fn path(label: impl Into<String>, points: Vec<[f64; 3]>) -> Self {
        Self::new(label, Look::Path(points), 1.8)
    }

    /// Segments that need not join, such as the edges of a tree.
    pub fn segments(label: impl Into<String>, segments: Vec<[[f64; 3]; 2]>) -> Self {
        Self::new(label, Look::Segments(segments), 0.8)
    }

    /// Points on their own.
    pub fn points(label: impl Into<String>, points: Vec<[f64; 3]>) -> Self {
        Self::new(label, Look::Points(points), 2.0)
    }

    /// This curve in the colour with this index instead of the next free one.
    pub fn color(mut self, index: usize) -> Self {
        self.color = Some(index);
        self
    }

    fn points_of(&self) -> Box<dyn Iterator<Item = &[f64; 3]> + '_> {
        match &self.look {
            Look::Path(points) | Look::Points(points) => Box::new(points.iter()),
            Look::Segments(segments) => Box::new(segments.iter().flatten()),
        }
    }
}

/// A convex polygon in space, nearly flat, coloured by a value; with two corners, a
/// segment.
#[derive(Clone, Debug, PartialEq)]
pub struct Patch {
    /// Corners in order.
    pub corners: Vec<[f64; 3]>,
    /// The value that decides the colour.
    pub value: f64,
}

/// What is drawn, with its distance from the plane of the page.
struct Item {
    depth: f64,
    shape: Shape,
}

enum Shape {
    Polygon(Vec<Place>, Rgb),
    /// A line, with the index of its curve.
    Line(Vec<Place>, usize, Stroke),
    Dot(Place, f64, Fill),
}

/// Width of polygons that are segments.
const LINK: f64 = 0.9;
/// Opacity of lines behind polygons.
const HIDDEN: f64 = 0.3;
const BAR: f64 = 12.0;
const TICK: f64 = 4.0;
const GAP: f64 = 6.0;

impl SpacePlot {
    /// A plot without data, 480 by 400 pixels, seen obliquely.
    pub fn new(axes: [Axis; 3]) -> Self {
        Self {
            title: None,
            axes,
            curves: Vec::new(),
            polygons: Vec::new(),
            polygon_axis: Axis::default(),
            view: View::oblique(),
            equal_scale: false,
            size: [480.0, 400.0],
        }
    }

    /// This plot with a title.
    pub fn title(mut self, title: impl Into<String>) -> Self {
        self.title = Some(title.into());
        self
    }

    /// This plot with one more curve.
    pub fn curve(mut self, curve: Curve) -> Self {
        self.curves.push(curve);
        self
    }

    /// This plot with polygons, whose values are told by a bar of colours with
    /// the given axis.
    pub fn polygons(mut self, axis: Axis, polygons: Vec<Patch>) -> Self {
        self.polygon_axis = axis;
        self.polygons = polygons;
        self
    }

    /// This plot seen from elsewhere.
    pub fn view(mut self, view: View) -> Self {
        self.view = view;
        self
    }

    /// This plot with one scale for all three axes.
    pub fn equal_scale(mut self) -> Self {
        self.equal_scale = true;
        self
    }

    /// This plot in another size, in pixels; at least 240 by 200.
    pub fn size(mut self, width: f64, height: f64) -> Self {
        self.size = [width.max(240.0), height.max(200.0)];
        self
    }

    /// Draws the plot.
    ///
    /// # Errors
    /// [`PictureError`] when there is no data or it cannot be drawn on the axes.
    pub fn draw(&self) -> Result<Picture, PictureError> {
        let cube = self.cube()?;
        let colors = self.colors()?;
        let legend = Legend::flow(self.samples().into_iter(), self.size[0] - 20.0);
        let heading = self.title.as_ref().map_or(0.0, |_| TITLE + GAP);
        let top = 8.0 + heading + legend.height();
        let bar = colors.as_ref().map_or(0.0, |axis| {
            3.0 * GAP + BAR + TICK + 3.0 + widest(axis) + GAP + TEXT + 8.0
        });
        let room = [self.size[0] - bar, self.size[1] - top];
        let sheet = Sheet::new(&cube, self.view.camera(), [0.0, top], room);
        let height = sheet.height;

        let mut canvas = Canvas::new();
        if let Some(title) = &self.title {
            let at = [0.5 * self.size[0], 8.0 + 0.5 * TITLE];
            canvas.text(Label::new(title, at).size(TITLE));
        }
        legend.draw(&mut canvas, [10.0, 8.0 + heading], self.size[0] - 20.0);
        sheet.draw_box(&mut canvas, &cube);
        if self.polygons.is_empty() {
            self.draw_shadows(&mut canvas, &cube, &sheet);
        }
        let mut items = self.items(&cube, &sheet, colors.as_ref());
        items.sort_by(|a, b| a.depth.total_cmp(&b.depth));
        for item in joined(items) {
            item.draw(&mut canvas);
        }
        if let Some(axis) = &colors {
            let at = [room[0] + 3.0 * GAP, top + 0.1 * height];
            draw_color_bar(&mut canvas, axis, at, 0.7 * height);
        }
        Ok(Picture::new(canvas, [self.size[0], top + height]))
    }

    /// Fits the axes, and spans the box that they bound.
    fn cube(&self) -> Result<Cube, PictureError> {
        let values = |axis: usize| {
            let curves = self.curves.iter().flat_map(Curve::points_of);
            let polygons = self.polygons.iter().flat_map(|patch| &patch.corners);
            curves.chain(polygons).map(move |point| point[axis])
        };
        let fit = |axis: usize| self.axes[axis].fit(values(axis), 5, 0.05);
        let axes = [fit(0)?, fit(1)?, fit(2)?];
        let spans = axes.each_ref().map(|axis| axis.hi - axis.lo);
        let longest = spans.into_iter().fold(0.0, f64::max);
        let sides = match self.equal_scale {
            true => spans.map(|span| span / longest),
            false => [1.0, 1.0, 0.85],
        };
        Ok(Cube { axes, sides })
    }

    fn colors(&self) -> Result<Option<Fitted>, PictureError> {
        if self.polygons.is_empty() {
            return Ok(None);
        }
        let values = self.polygons.iter().map(|patch| patch.value);
        self.polygon_axis.fit(values, 6, 0.0).map(Some)
    }

    fn color_of(&self, index: usize) -> (Rgb, &'static str) {
        // On coloured polygons, black stands out best.
        let first = if self.polygons.is_empty() {
            0
        } else {
            SERIES.len() - 1
        };
        let automatic = self.curves[..index]
            .iter()
            .filter(|c| c.color.is_none())
            .count();
        let index = self.curves[index].color.unwrap_or(first + automatic);
        (palette(index), DASHES[index / SERIES.len() % DASHES.len()])
    }

    fn samples(&self) -> Vec<Sample<'_>> {
        let mut samples: Vec<Sample<'_>> = self
            .curves
            .iter()
            .enumerate()
            .map(|(index, curve)| {
                let (color, dash) = self.color_of(index);
                match curve.look {
                    Look::Points(_) => Sample::Marker(&curve.label, 0, color),
                    _ => Sample::Line(&curve.label, Stroke::new(color, curve.width).dash(dash)),
                }
            })
            .collect();
        if self
            .curves
            .iter()
            .any(|curve| matches!(curve.look, Look::Path(_)))
        {
            samples.push(Sample::Dot("start", WHITE));
            samples.push(Sample::Dot("goal", INK));
        }
        samples
    }

    /// What the paths would throw on the floor in the noon sun: it tells
    /// heights apart.
    fn draw_shadows(&self, canvas: &mut Canvas, cube: &Cube, sheet: &Sheet) {
        for curve in &self.curves {
            if let Look::Path(points) = &curve.look {
                let floor = points.iter().map(|point| {
                    let mut place = cube.place(point);
                    place.z = 0.0;
                    sheet.page(&place)
                });
                let floor = super::chart::thinned(&floor.collect::<Vec<_>>());
                canvas.polyline(&floor, Stroke::new(Rgb(205, 205, 205), 1.2));
            }
        }
    }

    fn items(&self, cube: &Cube, sheet: &Sheet, colors: Option<&Fitted>) -> Vec<Item> {
        let mut items = Vec::new();
        let mut facets = Vec::new();
        let mut reach = 0.0;
        for (patch, axis) in self
            .polygons
            .iter()
            .zip(std::iter::repeat(colors).flatten())
        {
            let seen: Vec<_> = patch
                .corners
                .iter()
                .map(|corner| sheet.camera.see(&cube.place(corner)))
                .collect();
            let Some(bounds) = Bounds::around(seen.iter().copied()) else {
                continue;
            };
            reach += bounds.max.z - bounds.min.z;
            let corners: Vec<Place> = seen.iter().map(|corner| sheet.flat(corner)).collect();
            let color = viridis(axis.place(patch.value));
            let depth = seen.iter().map(|corner| corner.z).sum::<f64>() / seen.len() as f64;
            let shape = match seen.len() {
                ..3 => Shape::Line(corners, usize::MAX, Stroke::new(color, LINK).round()),
                _ => Shape::Polygon(corners, color),
            };
            items.push(Item { depth, shape });
            facets.push(Facet { seen, depth });
        }
        // Without polygons nothing hides an end of a path.
        let ahead = if self.polygons.is_empty() { 10.0 } else { 0.02 };
        // Lines on a polygon are as deep as it is and must not sink into it.
        let lift = 0.5 * reach / self.polygons.len().max(1) as f64 + 1e-6;
        let seen = |point: &[f64; 3]| sheet.camera.see(&cube.place(point));
        let mut pieces = Vec::new();
        for (index, curve) in self.curves.iter().enumerate() {
            let (color, dash) = self.color_of(index);
            let stroke = Stroke::new(color, curve.width).dash(dash);
            match &curve.look {
                Look::Path(points) => {
                    let places: Vec<_> = points.iter().map(seen).collect();
                    if self.polygons.is_empty() {
                        items.push(sheet.whole(&places, index, stroke));
                    } else {
                        for side in places.windows(2) {
                            sheet.cut(&mut pieces, [side[0], side[1]], lift, index, stroke.round());
                        }
                    }
                    let ends = [(places.first(), WHITE), (places.last(), INK)];
                    for (end, color) in ends {
                        let Some(end) = end else { continue };
                        let fill = Fill::new(color).outline(Stroke::new(INK, 1.2));
                        items.push(Item {
                            depth: end.z + 4.0 * lift + ahead,
                            shape: Shape::Dot(sheet.flat(end), 3.8, fill),
                        });
                    }
                }
                Look::Segments(segments) => {
                    for segment in segments {
                        let ends = segment.each_ref().map(seen);
                        sheet.cut(&mut pieces, ends, lift, index, stroke.round());
                    }
                }
                Look::Points(points) => items.extend(points.iter().map(seen).map(|place| {
                    let fill = Fill::new(color)
                        .opacity(0.85)
                        .outline(Stroke::new(WHITE, 0.5));
                    Item {
                        depth: place.z + lift,
                        shape: Shape::Dot(sheet.flat(&place), 2.4, fill),
                    }
                })),
            }
        }
        items.extend(pieces.into_iter().map(|piece| piece.over(&facets)));
        items
    }
}

/// A polygon as it is seen, for the lines that lie on it.
struct Facet {
    seen: Vec<Point3<f64>>,
    depth: f64,
}

impl Facet {
    /// Depth of the facet where a point covers it; the facet is a fan of triangles.
    fn depth_at(&self, point: &Point3<f64>) -> Option<f64> {
        let [hub, rest @ ..] = self.seen.as_slice() else {
            return None;
        };
        rest.windows(2).find_map(|side| {
            let (u, v, p) = (side[0] - hub, side[1] - hub, point - hub);
            let area = u.x * v.y - u.y * v.x;
            let along_u = (p.x * v.y - p.y * v.x) / area;
            let along_v = (u.x * p.y - u.y * p.x) / area;
            let inside = along_u >= 0.0 && along_v >= 0.0 && along_u + along_v <= 1.0;
            inside.then(|| hub.z + along_u * u.z + along_v * v.z)
        })
    }
}

/// A short piece of a line.
struct Piece {
    middle: Point3<f64>,
    item: Item,
}

impl Piece {
    /// The item, drawn after the facets that it lies on (a facet as a whole may count
    /// as nearer than a line on the far part of it), and faintly on those that hide it,
    /// so that lines can be followed.
    fn over(mut self, facets: &[Facet]) -> Item {
        /// How far a line may be from a facet that it lies on, as facets are flat.
        const NEAR: f64 = 0.06;
        for facet in facets {
            let Some(depth) = facet.depth_at(&self.middle) else {
                continue;
            };
            if depth - self.middle.z > NEAR
                && let Shape::Line(_, _, stroke) = &mut self.item.shape
            {
                stroke.opacity = HIDDEN;
            }
            self.item.depth = self.item.depth.max(facet.depth + 1e-6);
        }
        self.item
    }
}

impl Item {
    fn draw(&self, canvas: &mut Canvas) {
        match &self.shape {
            Shape::Polygon(corners, color) => {
                let edge = Stroke::new(color.mix(INK, 0.35), 0.35);
                canvas.polygon(corners, Fill::new(*color).outline(edge));
            }
            Shape::Line(points, _, stroke) => canvas.polyline(points, *stroke),
            Shape::Dot(at, radius, fill) => canvas.circle(*at, *radius, *fill),
        }
    }
}

/// The items in their order, where pieces of one curve that follow each other
/// and meet are one line: drawn apart, their overlapping ends would show.
fn joined(items: Vec<Item>) -> Vec<Item> {
    let near = |a: Place, b: Place| (a[0] - b[0]).hypot(a[1] - b[1]) < 0.01;
    let mut joined: Vec<Item> = Vec::with_capacity(items.len());
    for item in items {
        if let (Shape::Line(next, curve, stroke), Some(last)) = (&item.shape, joined.last_mut())
            && let Shape::Line(line, same, of_last) = &mut last.shape
            && curve == same
            && (stroke.color, stroke.opacity) == (of_last.color, of_last.opacity)
            && let ([.., end], &[from, to]) = (line.as_slice(), next.as_slice())
        {
            // Depth may grow along the curve or against it.
            if near(*end, from) {
                line.push(to);
                continue;
            }
            if near(line[0], to) {
                line.insert(0, from);
                continue;
            }
        }
        joined.push(item);
    }
    joined
}

/// The box of the axes, whose longest side is 1.
struct Cube {
    axes: [Fitted; 3],
    sides: [f64; 3],
}

impl Cube {
    fn place(&self, point: &[f64; 3]) -> Point3<f64> {
        Point3::from(std::array::from_fn(|axis| {
            self.axes[axis].place(point[axis]) * self.sides[axis]
        }))
    }
}

/// Where the box stands on the page.
struct Sheet {
    camera: Camera,
    center: Point3<f64>,
    middle: Place,
    scale: f64,
    /// Height of box, marks and titles.
    height: f64,
}

impl Sheet {
    fn new(cube: &Cube, camera: Camera, at: Place, room: [f64; 2]) -> Self {
        let max = Point3::from(cube.sides);
        let bounds = Bounds {
            min: Point3::origin(),
            max,
        };
        let seen = bounds.corners().map(|corner| camera.see(&corner));
        let extent = |axis: usize| {
            let values = seen.iter().map(|corner| corner[axis]);
            values.clone().fold(f64::NEG_INFINITY, f64::max) - values.fold(f64::INFINITY, f64::min)
        };
        // Ticks and titles stand on the left and below, titles turned along
        // their edges.
        let labels = cube.axes.iter().map(widest).fold(0.0, f64::max);
        let beside = TICK + 3.0 + labels + GAP + TEXT + 10.0;
        let below = TICK + 3.0 + SMALL + GAP + TEXT + 16.0;
        let free = [room[0] - beside - 24.0, room[1] - below - 10.0];
        let scale = (free[0] / extent(0)).min(free[1] / extent(1)).max(1.0);
        let tall = scale * extent(1);
        Self {
            camera,
            center: camera.see(&nalgebra::center(&bounds.min, &bounds.max)),
            middle: [at[0] + beside + 0.5 * free[0], at[1] + 10.0 + 0.5 * tall],
            scale,
            height: 10.0 + tall + below,
        }
    }

    fn flat(&self, seen: &Point3<f64>) -> Place {
        [
            self.middle[0] + self.scale * (seen.x - self.center.x),
            self.middle[1] - self.scale * (seen.y - self.center.y),
        ]
    }

    fn page(&self, place: &Point3<f64>) -> Place {
        self.flat(&self.camera.see(place))
    }

    /// A curve as one line: nothing stands between its parts.
    fn whole(&self, places: &[Point3<f64>], curve: usize, stroke: Stroke) -> Item {
        let depth = places.iter().map(|place| place.z).sum::<f64>();
        let line: Vec<Place> = places.iter().map(|place| self.flat(place)).collect();
        Item {
            depth: depth / places.len().max(1) as f64,
            shape: Shape::Line(super::chart::thinned(&line), curve, stroke),
        }
    }

    /// Adds a segment in pieces that are short against the box.
    fn cut(
        &self,
        pieces: &mut Vec<Piece>,
        [from, to]: [Point3<f64>; 2],
        lift: f64,
        curve: usize,
        stroke: Stroke,
    ) {
        const LENGTH: f64 = 0.03;
        let count = ((to - from).norm() / LENGTH).ceil().clamp(1.0, 64.0) as usize;
        for piece in 0..count {
            let ends =
                [piece, piece + 1].map(|end| from + (to - from) * (end as f64 / count as f64));
            let middle = nalgebra::center(&ends[0], &ends[1]);
            let line = ends.iter().map(|end| self.flat(end)).collect();
            pieces.push(Piece {
                middle,
                item: Item {
                    depth: middle.z + lift,
                    shape: Shape::Line(line, curve, stroke),
                },
            });
        }
    }

    /// The three walls behind the data with their grids, and the axes on the
    /// edges in front.
    fn draw_box(&self, canvas: &mut Canvas, cube: &Cube) {
        let toward = self.camera.toward();
        // The side of each axis away from the viewer; the floor always is.
        let far: [f64; 3] = std::array::from_fn(|axis| match toward[axis] < 0.0 {
            true => cube.sides[axis],
            false => 0.0,
        });
        let near: [f64; 3] = std::array::from_fn(|axis| cube.sides[axis] - far[axis]);
        for normal in 0..3 {
            let [a, b] = [(normal + 1) % 3, (normal + 2) % 3];
            let at = |u: f64, v: f64| {
                let mut place = Point3::origin();
                place[normal] = far[normal];
                place[a] = u * cube.sides[a];
                place[b] = v * cube.sides[b];
                self.page(&place)
            };
            let corners = [at(0.0, 0.0), at(1.0, 0.0), at(1.0, 1.0), at(0.0, 1.0)];
            let wall = Fill::new(Rgb(250, 250, 250)).outline(Stroke::new(FAINT, 0.7));
            canvas.polygon(&corners, wall);
            let grid = Stroke::new(GRID, 0.7);
            for mark in &cube.axes[a].marks {
                let u = cube.axes[a].place(mark.value);
                canvas.line(at(u, 0.0), at(u, 1.0), grid);
            }
            for mark in &cube.axes[b].marks {
                let v = cube.axes[b].place(mark.value);
                canvas.line(at(0.0, v), at(1.0, v), grid);
            }
        }
        let ends = |axis: usize, rest: [f64; 3]| {
            [0.0, cube.sides[axis]].map(|end| {
                let mut place = Point3::from(rest);
                place[axis] = end;
                place
            })
        };
        self.draw_axis(canvas, &cube.axes[0], ends(0, [0.0, near[1], far[2]]));
        self.draw_axis(canvas, &cube.axes[1], ends(1, [near[0], 0.0, far[2]]));
        let upright = [[near[0], far[1], 0.0], [far[0], near[1], 0.0]];
        let leftmost = upright
            .into_iter()
            .min_by(|a, b| {
                let x = |rest: &[f64; 3]| self.page(&Point3::from(*rest))[0];
                x(a).total_cmp(&x(b))
            })
            .unwrap_or_default();
        self.draw_axis(canvas, &cube.axes[2], ends(2, leftmost));
    }

    fn draw_axis(&self, canvas: &mut Canvas, axis: &Fitted, ends: [Point3<f64>; 2]) {
        let [from, to] = ends.each_ref().map(|end| self.page(end));
        let along = [to[0] - from[0], to[1] - from[1]];
        let length = along[0].hypot(along[1]);
        // Seen from its end an axis has no room for marks.
        if length < 20.0 {
            return;
        }
        let middle = [0.5 * (from[0] + to[0]), 0.5 * (from[1] + to[1])];
        let mut out = [along[1] / length, -along[0] / length];
        let from_center = [middle[0] - self.middle[0], middle[1] - self.middle[1]];
        if out[0] * from_center[0] + out[1] * from_center[1] < 0.0 {
            out = out.map(|side| -side);
        }
        let stroke = Stroke::new(INK, 0.9);
        canvas.line(from, to, stroke);
        let beyond =
            |at: Place, distance: f64| [at[0] + distance * out[0], at[1] + distance * out[1]];
        let mut farthest = 0.0_f64;
        for mark in &axis.marks {
            let share = axis.place(mark.value);
            let at = [from[0] + share * along[0], from[1] + share * along[1]];
            canvas.line(at, beyond(at, TICK), stroke);
            // Labels at the very ends would meet those of the next axis.
            if !(0.03..=0.97).contains(&share) {
                continue;
            }
            let reach = out[0].abs() * width(&mark.label, SMALL) + out[1].abs() * SMALL;
            let label = beyond(at, TICK + 3.0 + 0.5 * reach);
            canvas.text(Label::new(&mark.label, label).size(SMALL));
            farthest = farthest.max(reach);
        }
        let place = beyond(middle, TICK + 3.0 + farthest + GAP + 0.5 * TEXT);
        let mut angle = along[1].atan2(along[0]).to_degrees();
        // Never upside down; upright axes read upwards.
        if angle > 89.0 {
            angle -= 180.0;
        } else if angle < -91.0 {
            angle += 180.0;
        }
        canvas.text(Label::new(&axis.title, place).turned(angle));
    }
}

fn draw_color_bar(canvas: &mut Canvas, axis: &Fitted, [left, top]: Place, height: f64) {
    const STRIPS: usize = 64;
    let strip = height / STRIPS as f64;
    for index in 0..STRIPS {
        let share = (index as f64 + 0.5) / STRIPS as f64;
        let at = [left, top + height - (index + 1) as f64 * strip];
        // Each strip reaches under the next, so that no seam shows.
        let under = if index == 0 { 0.0 } else { 0.4 };
        canvas.rectangle(at, [BAR, strip + under], Fill::new(viridis(share)));
    }
    let stroke = Stroke::new(INK, 0.9);
    let right = left + BAR;
    for mark in &axis.marks {
        let at = top + (1.0 - axis.place(mark.value)) * height;
        canvas.line([right, at], [right + TICK, at], stroke);
        let label = Label::new(&mark.label, [right + TICK + 3.0, at]).size(SMALL);
        canvas.text(label.anchor(Anchor::Start));
    }
    let at = [
        right + TICK + 3.0 + widest(axis) + GAP + 0.5 * TEXT,
        top + 0.5 * height,
    ];
    canvas.text(Label::new(&axis.title, at).turned(-90.0));
}

fn widest(axis: &Fitted) -> f64 {
    let widths = axis.marks.iter().map(|mark| width(&mark.label, SMALL));
    widths.fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axes() -> [Axis; 3] {
        ["a", "b", "c"].map(Axis::new)
    }

    #[test]
    fn nothing_and_no_number_are_refused() {
        let empty = SpacePlot::new(axes()).draw();
        assert!(matches!(empty, Err(PictureError::Empty { .. })));
        let curve = Curve::path("p", vec![[0.0; 3], [1.0, f64::INFINITY, 0.0]]);
        let infinite = SpacePlot::new(axes()).curve(curve).draw();
        assert!(matches!(infinite, Err(PictureError::NotFinite { .. })));
        let patch = Patch {
            corners: vec![[0.0; 3], [1.0; 3], [0.0, 1.0, 0.0]],
            value: f64::NAN,
        };
        let colorless = SpacePlot::new(axes()).polygons(Axis::new("v"), vec![patch]);
        assert!(matches!(
            colorless.draw(),
            Err(PictureError::NotFinite { .. })
        ));
    }

    #[test]
    fn lines_behind_polygons_are_faint_and_lines_on_them_are_not() {
        // A sheet across the box, level in depth; the viewer is at −y and above.
        let sheet = |y: f64| Patch {
            corners: [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]
                .map(|[x, z]| [x, y, z])
                .to_vec(),
            value: y,
        };
        let lines = |y: f64| {
            let line = Curve::segments("", vec![[[0.5, y, 0.5], [0.51, y, 0.5]]]);
            let plot =
                SpacePlot::new(axes()).polygons(Axis::new("v"), vec![sheet(0.0), sheet(1.0)]);
            plot.curve(line).draw().unwrap().to_svg()
        };
        assert!(!lines(0.0).contains("stroke-opacity"));
        assert!(lines(0.5).contains("stroke-opacity"));
        assert!(!lines(-0.5).contains("stroke-opacity"));
    }

    #[test]
    fn patches_with_two_corners_are_lines_in_their_colours() {
        let link = |z: f64| Patch {
            corners: vec![[0.0, 0.0, z], [1.0, 0.5, z]],
            value: z,
        };
        let plot = SpacePlot::new(axes()).polygons(Axis::new("v"), vec![link(0.0), link(1.0)]);
        let svg = plot.draw().unwrap().to_svg();
        for share in [0.0, 1.0] {
            let Rgb(r, g, b) = viridis(share);
            let stroke = format!("stroke=\"#{r:02x}{g:02x}{b:02x}\"");
            assert!(svg.contains(&stroke), "{stroke}");
        }
    }

    #[test]
    fn one_point_is_enough() {
        let point = Curve::points("here", vec![[1.0, 2.0, 3.0]]);
        assert!(SpacePlot::new(axes()).curve(point).draw().is_ok());
    }
}
