//! Charts of two quantities: lines, points, steps, bars, regions, and levels
//! such as limits, on linear or logarithmic axes.
//!
//! Room is left for what is written, from the widths of the texts; nothing is
//! written over the data but the data.

use super::{
    Axis, Picture, PictureError, Scale,
    axis::{Fitted, drawable},
    canvas::{Anchor, Canvas, Fill, Label, Place, Stroke},
    style::{DASHES, FAINT, GRID, INK, Rgb, SERIES, SMALL, SOFT, TEXT, TITLE, WHITE},
    text::width,
};
use crate::bench::quantile;

/// A chart of two quantities.
///
/// # Examples
/// ```
/// # fn main() -> Result<(), tensegra_io::PictureError> {
/// use tensegra_io::{Axis, Chart, Level, Series};
/// let chart = Chart::new(Axis::new("time").unit("s"), Axis::new("force").unit("N"))
///     .series(Series::line("c1", vec![[0.0, 1.0], [1.0, 3.0], [2.0, 2.5]]))
///     .level(Level::new("limit of c1", 4.0));
/// let svg = chart.draw()?.to_svg();
/// assert!(svg.contains("force (N)"));
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Chart {
    title: Option<String>,
    x: Axis,
    y: Axis,
    series: Vec<Series>,
    levels: Vec<Level>,
    regions: Vec<Region>,
    notes: Vec<String>,
    size: [f64; 2],
    equal_scale: bool,
}

/// Points of a chart that belong together.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    label: String,
    points: Vec<[f64; 2]>,
    look: Look,
    color: Option<usize>,
    dash: Option<usize>,
    width: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Look {
    Line,
    Points,
    Steps,
    /// Each point is the left end and the height of a bar; the last one only
    /// closes the bar before it.
    Bars,
}

/// A horizontal line across a chart, such as a limit.
#[derive(Clone, Debug, PartialEq)]
pub struct Level {
    label: String,
    value: f64,
    color: Option<usize>,
}

impl Level {
    /// A line at `value`, named at the right edge.
    pub fn new(label: impl Into<String>, value: f64) -> Self {
        Self {
            label: label.into(),
            value,
            color: None,
        }
    }

    /// This line in the colour of the series with this index.
    pub fn color(mut self, index: usize) -> Self {
        self.color = Some(index);
        self
    }

    fn lines(&self) -> Vec<String> {
        const WIDEST: f64 = 110.0;
        wrap(&self.label, WIDEST)
    }
}

/// A filled polygon behind the series, such as a support or an obstacle.
#[derive(Clone, Debug, PartialEq)]
pub struct Region {
    label: String,
    corners: Vec<[f64; 2]>,
    color: Option<usize>,
}

impl Region {
    /// A grey polygon; without an entry in the legend when the label is empty.
    pub fn new(label: impl Into<String>, corners: Vec<[f64; 2]>) -> Self {
        Self {
            label: label.into(),
            corners,
            color: None,
        }
    }

    /// This polygon in the colour of the series with this index.
    pub fn color(mut self, index: usize) -> Self {
        self.color = Some(index);
        self
    }

    fn color_of(&self) -> Rgb {
        self.color.map_or(FAINT, palette)
    }
}

impl Series {
    fn new(label: impl Into<String>, points: Vec<[f64; 2]>, look: Look) -> Self {
        Self {
            label: label.into(),
            points,
            look,
            color: None,
            dash: None,
            width: 1.5,
        }
    }

    /// Points joined by straight lines. Here as in the other series, an empty
    /// label makes no entry in the legend.
    pub fn line(label: impl Into<String>, points: Vec<[f64; 2]>) -> Self {
        Self::new(label, points, Look::Line)
    }

    /// Points on their own.
    pub fn points(label: impl Into<String>, points: Vec<[f64; 2]>) -> Self {
        Self::new(label, points, Look::Points)
    }

    /// The share of `values` (0 to 1) that is at most as large as each of them:
    /// the cumulated distribution, as steps.
    pub fn distribution(label: impl Into<String>, values: &[f64]) -> Self {
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        let count = sorted.len() as f64;
        let first = sorted.first().map(|&value| [value, 0.0]);
        let rest = sorted.iter().enumerate();
        let rest = rest.map(|(index, &value)| [value, (index + 1) as f64 / count]);
        Self::new(label, first.into_iter().chain(rest).collect(), Look::Steps)
    }

    /// The number of `values` in each of `bins` intervals, which are equally
    /// wide on an axis of the given scale.
    pub fn histogram(label: impl Into<String>, values: &[f64], bins: usize, scale: Scale) -> Self {
        let bins = bins.max(1);
        type Map = fn(f64) -> f64;
        let (to, from): (Map, Map) = match scale {
            Scale::Linear => (|value| value, |value| value),
            Scale::Logarithmic => (f64::ln, f64::exp),
        };
        let mut sorted: Vec<f64> = values.iter().map(|&value| to(value)).collect();
        sorted.sort_by(f64::total_cmp);
        let lo = quantile(&sorted, 0.0).unwrap_or_default();
        let hi = quantile(&sorted, 1.0).unwrap_or_default();
        let width = if hi > lo {
            (hi - lo) / bins as f64
        } else {
            1.0
        };
        let mut counts = vec![0.0; bins + 1];
        for value in &sorted {
            let bin = ((value - lo) / width).floor() as usize;
            counts[bin.min(bins - 1)] += 1.0;
        }
        let points = counts.iter().enumerate();
        let points = points.map(|(bin, &count)| [from(lo + bin as f64 * width), count]);
        Self::new(label, points.collect(), Look::Bars)
    }

    /// This series in the colour with this index instead of the next free one.
    pub fn color(mut self, index: usize) -> Self {
        self.color = Some(index);
        self
    }

    /// This series with the dashes of this index: 0 is a full line.
    pub fn dash(mut self, index: usize) -> Self {
        self.dash = Some(index);
        self
    }

    /// This series with lines of half the usual width.
    pub fn thin(mut self) -> Self {
        self.width = 0.75;
        self
    }
}

/// The colour of the series with this index.
pub(crate) fn palette(index: usize) -> Rgb {
    SERIES[index % SERIES.len()]
}

/// A series with its colour, dashes and marker decided.
struct Styled<'a> {
    series: &'a Series,
    color: Rgb,
    stroke: Stroke,
    marker: usize,
}

const GAP: f64 = 6.0;
const TICK: f64 = 4.0;
const SAMPLE: f64 = 20.0;
const ROW: f64 = 16.0;
/// From line to line of small text.
const LEADING: f64 = SMALL + 3.0;

impl Chart {
    /// A chart without data, 480 by 320 pixels.
    pub fn new(x: Axis, y: Axis) -> Self {
        Self {
            title: None,
            x,
            y,
            series: Vec::new(),
            levels: Vec::new(),
            regions: Vec::new(),
            notes: Vec::new(),
            size: [480.0, 320.0],
            equal_scale: false,
        }
    }

    /// This chart with a title.
    pub fn title(mut self, title: impl Into<String>) -> Self {
        self.title = Some(title.into());
        self
    }

    /// This chart with one more series.
    pub fn series(mut self, series: Series) -> Self {
        self.series.push(series);
        self
    }

    /// This chart with one more level.
    pub fn level(mut self, level: Level) -> Self {
        self.levels.push(level);
        self
    }

    /// This chart with one more region.
    pub fn region(mut self, region: Region) -> Self {
        self.regions.push(region);
        self
    }

    /// This chart with a remark below it.
    pub fn note(mut self, note: impl Into<String>) -> Self {
        self.notes.push(note.into());
        self
    }

    /// This chart in another size, in pixels; at least 160 by 120.
    pub fn size(mut self, width: f64, height: f64) -> Self {
        self.size = [width.max(160.0), height.max(120.0)];
        self
    }

    /// This chart with one scale for both axes, as for a map; its height
    /// follows from the data.
    pub fn equal_scale(mut self) -> Self {
        self.equal_scale = true;
        self
    }

    /// Draws the chart.
    ///
    /// # Errors
    /// [`PictureError`] when there is no data or it cannot be drawn on the axes.
    pub fn draw(&self) -> Result<Picture, PictureError> {
        let styled = self.styled();
        let legend = Legend::new(self, &styled, self.size[0] - 20.0);
        let notes: Vec<String> = self
            .notes
            .iter()
            .flat_map(|note| wrap(note, self.size[0] - 20.0))
            .collect();
        let top = 10.0
            + self.title.as_ref().map_or(0.0, |_| TITLE + GAP)
            + legend.height()
            + if legend.height() > 0.0 { 4.0 } else { 0.0 };
        let bottom = TICK + 3.0 + SMALL + GAP + TEXT + 10.0 + notes.len() as f64 * LEADING;
        let names = self.levels.iter().flat_map(|level| level.lines());
        let names = names.map(|line| width(&line, SMALL)).fold(0.0, f64::max);
        let right = if names > 0.0 { names + 2.0 * GAP } else { 16.0 };

        let mut plot = [0.0, self.size[1] - top - bottom];
        let y_marks = (plot[1] / 42.0).max(2.0) as usize;
        let mut y = self.y.fit(self.values(1), y_marks, 0.05)?;
        // Bars stand on the axis.
        if y.lo < 0.0 && self.values(1).all(|value| value >= 0.0) && self.has_bars() {
            let axis = self.y.clone().range(0.0, y.hi);
            y = axis.fit(std::iter::empty(), y_marks, 0.0)?;
        }
        let left = |y: &Fitted| 8.0 + TEXT + GAP + widest(y) + 3.0 + TICK;
        plot[0] = (self.size[0] - left(&y) - right).max(60.0);
        let x_marks = (plot[0] / 70.0).max(2.0) as usize;
        let mut x = self.x.fit(self.values(0), x_marks, self.padding())?;
        if self.equal_scale {
            [x, y] = self.with_equal_scale(x, y, &mut plot)?;
            plot[0] = (self.size[0] - left(&y) - right).max(60.0);
        }

        let frame = Frame {
            at: [left(&y), top],
            size: plot,
            x,
            y,
        };
        let mut canvas = Canvas::new();
        let middle = frame.at[0] + 0.5 * plot[0];
        if let Some(title) = &self.title {
            canvas.text(Label::new(title, [middle, 10.0 + 0.5 * TITLE]).size(TITLE));
        }
        legend.draw(
            &mut canvas,
            [10.0, top - legend.height() - 4.0],
            self.size[0] - 20.0,
        );
        frame.draw_grid(&mut canvas);
        self.draw_data(&mut canvas, &frame, &styled);
        frame.draw_axes(&mut canvas);
        self.draw_level_names(&mut canvas, &frame);
        let below = top + plot[1] + bottom - 6.0;
        for (index, note) in notes.iter().rev().enumerate() {
            let at = [10.0, below - (index as f64 + 0.5) * LEADING];
            let label = Label::new(note, at).size(SMALL).color(SOFT);
            canvas.text(label.anchor(Anchor::Start));
        }
        Ok(Picture::new(canvas, [self.size[0], top + plot[1] + bottom]))
    }

    fn values(&self, axis: usize) -> impl Iterator<Item = f64> {
        let series = self.series.iter().flat_map(|series| &series.points);
        let regions = self.regions.iter().flat_map(|region| &region.corners);
        let levels = self.levels.iter().map(|level| level.value);
        series
            .chain(regions)
            .map(move |point| point[axis])
            .chain(levels.filter(move |_| axis == 1))
    }

    fn has_bars(&self) -> bool {
        self.series.iter().any(|series| series.look == Look::Bars)
    }

    /// Lines may run from edge to edge; points and maps stand off a little.
    fn padding(&self) -> f64 {
        let lines = self.series.iter().all(|series| series.look == Look::Line);
        if lines && self.regions.is_empty() && !self.equal_scale {
            0.0
        } else {
            0.04
        }
    }

    fn with_equal_scale(
        &self,
        x: Fitted,
        y: Fitted,
        plot: &mut [f64; 2],
    ) -> Result<[Fitted; 2], PictureError> {
        let spans = [x.hi - x.lo, y.hi - y.lo];
        let height = plot[0] * spans[1] / spans[0];
        plot[1] = height.clamp(0.25 * plot[0], 1.4 * plot[0]);
        let scale = (plot[0] / spans[0]).min(plot[1] / spans[1]);
        let ranges = [(&x, plot[0]), (&y, plot[1])].map(|(axis, pixels)| {
            let room = 0.5 * (pixels / scale - (axis.hi - axis.lo));
            [axis.lo - room, axis.hi + room]
        });
        let marks = (plot[0].min(plot[1]) / 50.0).max(2.0);
        let fit = |axis: &Axis, [lo, hi]: [f64; 2], pixels: f64| {
            let count = marks * pixels / plot[0].min(plot[1]);
            let axis = axis.clone().range(lo, hi);
            axis.fit(std::iter::empty(), count as usize, 0.0)
        };
        Ok([
            fit(&self.x, ranges[0], plot[0])?,
            fit(&self.y, ranges[1], plot[1])?,
        ])
    }

    fn styled(&self) -> Vec<Styled<'_>> {
        let mut next = 0;
        let series = self.series.iter();
        series
            .map(|series| {
                let index = series.color.unwrap_or_else(|| {
                    next += 1;
                    next - 1
                });
                let dash = series.dash.unwrap_or(index / SERIES.len());
                let color = palette(index);
                let stroke = Stroke::new(color, series.width).dash(DASHES[dash % DASHES.len()]);
                Styled {
                    series,
                    color,
                    stroke,
                    marker: index,
                }
            })
            .collect()
    }

    fn draw_data(&self, canvas: &mut Canvas, frame: &Frame, styled: &[Styled<'_>]) {
        // Half a line more on each side, so that lines at the edge stay whole.
        const EDGE: f64 = 1.0;
        let mut inner = Canvas::new();
        let to = |point: &[f64; 2]| frame.inside(*point).map(|pixels| pixels + EDGE);
        for region in &self.regions {
            let corners: Vec<Place> = region.corners.iter().map(to).collect();
            let outline = Stroke::new(region.color_of().mix(INK, 0.2), 0.75);
            let fill = Fill::new(region.color_of()).opacity(0.35);
            inner.polygon(&corners, fill.outline(outline));
        }
        for level in &self.levels {
            let height = to(&[frame.x.lo, level.value])[1];
            let color = level.color.map_or(SOFT, palette);
            inner.line(
                [0.0, height],
                [frame.size[0] + 2.0 * EDGE, height],
                Stroke::new(color, 0.9).dash("1.5 2.5"),
            );
        }
        for styled in styled {
            let points: Vec<Place> = styled.series.points.iter().map(to).collect();
            match styled.series.look {
                Look::Line => inner.polyline(&thinned(&points), styled.stroke),
                Look::Steps => inner.polyline(&stairs(&points), styled.stroke),
                Look::Points => points.iter().for_each(|&at| {
                    marker(&mut inner, at, styled.marker, styled.color);
                }),
                Look::Bars => {
                    let ground = to(&[frame.x.lo, frame.y.lo.max(0.0)])[1];
                    for pair in points.windows(2) {
                        let size = [pair[1][0] - pair[0][0], ground - pair[0][1]];
                        let fill = Fill::new(styled.color).opacity(0.55);
                        let outline = Stroke::new(WHITE, 0.75);
                        inner.rectangle(pair[0], size, fill.outline(outline));
                    }
                }
            }
        }
        let at = frame.at.map(|pixels| pixels - EDGE);
        canvas.window(inner, at, frame.size.map(|side| side + 2.0 * EDGE));
    }

    fn draw_level_names(&self, canvas: &mut Canvas, frame: &Frame) {
        let shown: Vec<&Level> = self
            .levels
            .iter()
            .filter(|level| !level.label.is_empty() && frame.y.holds(level.value))
            .collect();
        let lines: Vec<Vec<String>> = shown.iter().map(|level| level.lines()).collect();
        let [top, bottom] = [frame.at[1], frame.at[1] + frame.size[1]];
        let mut blocks: Vec<[f64; 2]> = shown
            .iter()
            .zip(&lines)
            .map(|(level, lines)| {
                let middle = top + frame.inside([frame.x.lo, level.value])[1];
                [middle, lines.len() as f64 * LEADING]
            })
            .collect();
        spread(&mut blocks, top, bottom);
        for ((level, lines), [middle, height]) in shown.iter().zip(&lines).zip(blocks) {
            let color = level.color.map_or(SOFT, palette);
            for (index, line) in lines.iter().enumerate() {
                let down = middle - 0.5 * height + (index as f64 + 0.5) * LEADING;
                let label = Label::new(line, [frame.at[0] + frame.size[0] + GAP, down]);
                canvas.text(label.size(SMALL).color(color).anchor(Anchor::Start));
            }
        }
    }
}

/// Where the data stand on the page.
struct Frame {
    at: Place,
    size: [f64; 2],
    x: Fitted,
    y: Fitted,
}

impl Frame {
    /// Pixels from the upper left corner of the frame.
    fn inside(&self, [x, y]: [f64; 2]) -> Place {
        [
            self.x.place(x) * self.size[0],
            (1.0 - self.y.place(y)) * self.size[1],
        ]
    }

    fn page(&self, point: [f64; 2]) -> Place {
        let [right, down] = self.inside(point);
        [self.at[0] + right, self.at[1] + down]
    }

    fn draw_grid(&self, canvas: &mut Canvas) {
        let stroke = Stroke::new(GRID, 0.75);
        for mark in &self.y.marks {
            let at = self.page([self.x.lo, mark.value]);
            canvas.line(at, [at[0] + self.size[0], at[1]], stroke);
        }
        for mark in &self.x.marks {
            let at = self.page([mark.value, self.y.lo]);
            canvas.line(at, [at[0], at[1] - self.size[1]], stroke);
        }
        if self.y.lo < 0.0 && self.y.hi > 0.0 {
            let at = self.page([self.x.lo, 0.0]);
            let zero = Stroke::new(FAINT, 0.9);
            canvas.line(at, [at[0] + self.size[0], at[1]], zero);
        }
    }

    fn draw_axes(&self, canvas: &mut Canvas) {
        let stroke = Stroke::new(INK, 0.9);
        let [left, top] = self.at;
        let [right, bottom] = [left + self.size[0], top + self.size[1]];
        canvas.polyline(&[[left, top], [left, bottom], [right, bottom]], stroke);
        for &value in &self.x.minor {
            let at = self.page([value, self.y.lo])[0];
            canvas.line([at, bottom], [at, bottom + 0.5 * TICK], stroke);
        }
        for &value in &self.y.minor {
            let at = self.page([self.x.lo, value])[1];
            canvas.line([left, at], [left - 0.5 * TICK, at], stroke);
        }
        let below = bottom + TICK + 3.0 + 0.5 * SMALL;
        let mut free = f64::NEG_INFINITY;
        for mark in &self.x.marks {
            let at = self.page([mark.value, self.y.lo])[0];
            canvas.line([at, bottom], [at, bottom + TICK], stroke);
            let half = 0.5 * width(&mark.label, SMALL);
            if at - half >= free {
                canvas.text(Label::new(&mark.label, [at, below]).size(SMALL));
                free = at + half + GAP;
            }
        }
        for mark in &self.y.marks {
            let at = self.page([self.x.lo, mark.value])[1];
            canvas.line([left, at], [left - TICK, at], stroke);
            let label = Label::new(&mark.label, [left - TICK - 3.0, at]).size(SMALL);
            canvas.text(label.anchor(Anchor::End));
        }
        let middle = [0.5 * (left + right), 0.5 * (top + bottom)];
        let title = [middle[0], below + 0.5 * SMALL + GAP + 0.5 * TEXT];
        canvas.text(Label::new(&self.x.title, title));
        let beside = left - TICK - 3.0 - widest(&self.y) - GAP - 0.5 * TEXT;
        canvas.text(Label::new(&self.y.title, [beside, middle[1]]).turned(-90.0));
    }
}

fn widest(axis: &Fitted) -> f64 {
    let widths = axis.marks.iter().map(|mark| width(&mark.label, SMALL));
    widths.fold(0.0, f64::max)
}

/// The names of series and regions, in rows.
pub(crate) struct Legend<'a> {
    rows: Vec<Vec<(Sample<'a>, f64)>>,
}

pub(crate) enum Sample<'a> {
    Line(&'a str, Stroke),
    Marker(&'a str, usize, Rgb),
    Area(&'a str, Rgb),
    /// A dot with a dark edge, such as a start or goal.
    Dot(&'a str, Rgb),
}

impl<'a> Legend<'a> {
    fn new(chart: &'a Chart, styled: &[Styled<'a>], room: f64) -> Self {
        let series = styled.iter().map(|styled| {
            let label = styled.series.label.as_str();
            match styled.series.look {
                Look::Line | Look::Steps => Sample::Line(label, styled.stroke),
                Look::Points => Sample::Marker(label, styled.marker, styled.color),
                Look::Bars => Sample::Area(label, styled.color),
            }
        });
        let regions = chart
            .regions
            .iter()
            .map(|region| Sample::Area(&region.label, region.color_of()));
        Self::flow(series.chain(regions), room)
    }

    pub(crate) fn flow(samples: impl Iterator<Item = Sample<'a>>, room: f64) -> Self {
        let mut rows: Vec<Vec<(Sample<'a>, f64)>> = Vec::new();
        let mut used = f64::INFINITY;
        for sample in samples.filter(|sample| !sample.label().is_empty()) {
            let need = SAMPLE + 5.0 + width(sample.label(), SMALL) + 14.0;
            if used + need > room {
                rows.push(Vec::new());
                used = 0.0;
            }
            used += need;
            if let Some(row) = rows.last_mut() {
                row.push((sample, need));
            }
        }
        Self { rows }
    }

    pub(crate) fn height(&self) -> f64 {
        self.rows.len() as f64 * ROW
    }

    pub(crate) fn draw(&self, canvas: &mut Canvas, at: Place, room: f64) {
        for (index, row) in self.rows.iter().enumerate() {
            let used: f64 = row.iter().map(|(_, need)| need).sum();
            let mut left = at[0] + 0.5 * (room - used).max(0.0);
            let middle = at[1] + (index as f64 + 0.5) * ROW;
            for (sample, need) in row {
                sample.draw(canvas, [left, middle]);
                left += need;
            }
        }
    }
}

impl Sample<'_> {
    fn label(&self) -> &str {
        match self {
            Self::Line(label, _)
            | Self::Marker(label, _, _)
            | Self::Area(label, _)
            | Self::Dot(label, _) => label,
        }
    }

    fn draw(&self, canvas: &mut Canvas, [left, middle]: Place) {
        let center = [left + 0.5 * SAMPLE, middle];
        match self {
            Self::Line(_, stroke) => {
                canvas.line([left, middle], [left + SAMPLE, middle], *stroke);
            }
            Self::Marker(_, index, color) => marker(canvas, center, *index, *color),
            Self::Dot(_, color) => {
                let fill = Fill::new(*color).outline(Stroke::new(INK, 1.2));
                canvas.circle(center, 3.8, fill);
            }
            Self::Area(_, color) => {
                let at = [center[0] - 6.0, middle - 4.0];
                let fill = Fill::new(*color).opacity(0.5);
                canvas.rectangle(at, [12.0, 8.0], fill.outline(Stroke::new(*color, 0.75)));
            }
        }
        let at = [left + SAMPLE + 5.0, middle];
        let label = Label::new(self.label(), at).size(SMALL);
        canvas.text(label.anchor(Anchor::Start));
    }
}

/// A point, in a shape of its own for each series: shapes survive where colours
/// do not.
fn marker(canvas: &mut Canvas, [x, y]: Place, index: usize, color: Rgb) {
    let fill = Fill::new(color)
        .opacity(0.85)
        .outline(Stroke::new(WHITE, 0.5));
    let polygon = |corners: &[[f64; 2]]| -> Vec<Place> {
        corners.iter().map(|[dx, dy]| [x + dx, y + dy]).collect()
    };
    match index % 4 {
        0 => canvas.circle([x, y], 3.0, fill),
        1 => canvas.polygon(
            &polygon(&[[-2.7, -2.7], [2.7, -2.7], [2.7, 2.7], [-2.7, 2.7]]),
            fill,
        ),
        2 => canvas.polygon(&polygon(&[[0.0, -3.7], [3.4, 2.5], [-3.4, 2.5]]), fill),
        _ => canvas.polygon(
            &polygon(&[[0.0, -3.9], [3.5, 0.0], [0.0, 3.9], [-3.5, 0.0]]),
            fill,
        ),
    }
}

/// A line without the points that stand within a fifth of a pixel of the last.
pub(crate) fn thinned(points: &[Place]) -> Vec<Place> {
    let mut kept: Vec<Place> = Vec::with_capacity(points.len());
    for (index, point) in points.iter().enumerate() {
        let far = kept
            .last()
            .is_none_or(|last| (point[0] - last[0]).hypot(point[1] - last[1]) > 0.2);
        if far || index + 1 == points.len() {
            kept.push(*point);
        }
    }
    kept
}

/// Points joined by steps: across first, then up.
fn stairs(points: &[Place]) -> Vec<Place> {
    let mut stairs: Vec<Place> = Vec::with_capacity(2 * points.len());
    for point in points {
        if let Some(&[_, height]) = stairs.last() {
            stairs.push([point[0], height]);
        }
        stairs.push(*point);
    }
    stairs
}

/// Moves blocks, each a middle and a height, apart so that they do not overlap,
/// between `top` and `bottom` where there is room.
fn spread(blocks: &mut [[f64; 2]], top: f64, bottom: f64) {
    let mut order: Vec<usize> = (0..blocks.len()).collect();
    order.sort_by(|&a, &b| blocks[a][0].total_cmp(&blocks[b][0]));
    let mut free = top;
    for &index in &order {
        let [middle, height] = &mut blocks[index];
        *middle = middle.max(free + 0.5 * *height);
        free = *middle + 0.5 * *height;
    }
    let mut free = bottom;
    for &index in order.iter().rev() {
        let [middle, height] = &mut blocks[index];
        *middle = middle.min(free - 0.5 * *height);
        free = *middle - 0.5 * *height;
    }
}

/// Breaks a text into lines that fit.
pub(crate) fn wrap(text: &str, room: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if width(&format!("{line} {word}"), SMALL) <= room => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

/// A power law y = factor · x^exponent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PowerLaw {
    /// The exponent.
    pub exponent: f64,
    /// The value at x = 1.
    pub factor: f64,
}

impl PowerLaw {
    /// The value at `x`.
    pub fn at(&self, x: f64) -> f64 {
        self.factor * x.powf(self.exponent)
    }
}

/// The power law that fits points best, by least squares of the logarithms;
/// none when a coordinate is not positive or all x are the same.
///
/// # Examples
/// ```
/// let law = tensegra_io::fit_power_law(&[[1.0, 2.0], [2.0, 8.0], [4.0, 32.0]]).unwrap();
/// assert!((law.exponent - 2.0).abs() < 1e-12 && (law.factor - 2.0).abs() < 1e-12);
/// ```
pub fn fit_power_law(points: &[[f64; 2]]) -> Option<PowerLaw> {
    if points.iter().flatten().any(|&v| !drawable(v) || v <= 0.0) {
        return None;
    }
    let count = points.len() as f64;
    let logs: Vec<[f64; 2]> = points.iter().map(|point| point.map(f64::ln)).collect();
    let mean = |axis: usize| logs.iter().map(|log| log[axis]).sum::<f64>() / count;
    let [x, y] = [mean(0), mean(1)];
    let spread: f64 = logs.iter().map(|log| (log[0] - x).powi(2)).sum();
    let common: f64 = logs.iter().map(|log| (log[0] - x) * (log[1] - y)).sum();
    (spread > 0.0).then(|| {
        let exponent = common / spread;
        PowerLaw {
            exponent,
            factor: (y - exponent * x).exp(),
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_levels_are_moved_apart() {
        let mut blocks = [10.0, 11.0, 50.0, 93.0, 94.0].map(|middle| [middle, 12.0]);
        spread(&mut blocks, 0.0, 100.0);
        assert_eq!(blocks.map(|block| block[0]), [10.0, 22.0, 50.0, 82.0, 94.0]);
    }

    #[test]
    fn a_distribution_ends_at_one() {
        let series = Series::distribution("t", &[3.0, 1.0, 2.0, 2.0]);
        assert_eq!(
            series.points,
            [[1.0, 0.0], [1.0, 0.25], [2.0, 0.5], [2.0, 0.75], [3.0, 1.0]]
        );
    }

    #[test]
    fn a_histogram_counts_every_value_once() {
        let values = [1.0, 1.0, 2.0, 5.0, 10.0, 100.0];
        for scale in [Scale::Linear, Scale::Logarithmic] {
            let series = Series::histogram("t", &values, 4, scale);
            let total: f64 = series.points.iter().map(|point| point[1]).sum();
            assert_eq!((series.points.len(), total), (5, 6.0));
        }
        let constant = Series::histogram("t", &[2.0; 3], 4, Scale::Linear);
        assert_eq!(constant.points[0], [2.0, 3.0]);
    }

    #[test]
    fn a_power_law_needs_positive_points_that_differ() {
        assert_eq!(fit_power_law(&[]), None);
        assert_eq!(fit_power_law(&[[1.0, 1.0], [1.0, 2.0]]), None);
        assert_eq!(fit_power_law(&[[1.0, 0.0], [2.0, 2.0]]), None);
    }

    #[test]
    fn an_empty_chart_is_refused() {
        let chart = Chart::new(Axis::new("x"), Axis::new("y"));
        assert!(matches!(chart.draw(), Err(PictureError::Empty { .. })));
        let nan = Series::line("a", vec![[0.0, f64::NAN], [1.0, 1.0]]);
        let nan = chart.series(nan).draw();
        assert!(matches!(nan, Err(PictureError::NotFinite { .. })));
    }

    #[test]
    fn long_notes_are_wrapped() {
        let lines = wrap("one two three four", width("one two", SMALL));
        assert_eq!(lines, ["one two", "three", "four"]);
    }
}
