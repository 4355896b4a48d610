//! A thin layer over the SVG elements: what is drawn, in pixels from the upper
//! left corner.

use std::fmt::Write as _;

use svg::node::{
    Blob, Text as TextNode,
    element::{Circle, Element, Group, Line, Path, Rectangle},
};

use super::{
    style::{INK, Rgb, TEXT, WHITE},
    text::{Run, raised_size, runs},
};

/// A point of the page: pixels to the right and down.
pub(crate) type Place = [f64; 2];

/// The fonts to try, the one whose widths are known first.
const FONTS: &str = "Noto Sans, Helvetica, Arial, sans-serif";
/// Height of the digits above the line, in shares of the font size.
const CAP_HEIGHT: f64 = 0.714;
const PRECISION: f64 = 100.0;

/// How a line is drawn.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stroke {
    pub(crate) color: Rgb,
    pub(crate) width: f64,
    pub(crate) dash: &'static str,
    pub(crate) opacity: f64,
    pub(crate) round: bool,
}

impl Stroke {
    pub(crate) const fn new(color: Rgb, width: f64) -> Self {
        Self {
            color,
            width,
            dash: "",
            opacity: 1.0,
            round: false,
        }
    }

    pub(crate) const fn dash(mut self, dash: &'static str) -> Self {
        self.dash = dash;
        self
    }

    pub(crate) const fn round(mut self) -> Self {
        self.round = true;
        self
    }
}

/// How an area is filled and outlined.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fill {
    pub(crate) color: Rgb,
    pub(crate) opacity: f64,
    pub(crate) outline: Option<Stroke>,
}

impl Fill {
    pub(crate) const fn new(color: Rgb) -> Self {
        Self {
            color,
            opacity: 1.0,
            outline: None,
        }
    }

    pub(crate) const fn opacity(mut self, opacity: f64) -> Self {
        self.opacity = opacity;
        self
    }

    pub(crate) const fn outline(mut self, outline: Stroke) -> Self {
        self.outline = Some(outline);
        self
    }
}

/// Which end of a text stands at its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Anchor {
    Start,
    Middle,
    End,
}

/// A text, centred vertically on its place.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Label<'a> {
    pub(crate) text: &'a str,
    pub(crate) at: Place,
    pub(crate) size: f64,
    pub(crate) anchor: Anchor,
    pub(crate) color: Rgb,
    /// Turn in degrees, clockwise.
    pub(crate) angle: f64,
    /// Whether a white border keeps it apart from what is behind.
    pub(crate) halo: bool,
}

impl<'a> Label<'a> {
    pub(crate) const fn new(text: &'a str, at: Place) -> Self {
        Self {
            text,
            at,
            size: TEXT,
            anchor: Anchor::Middle,
            color: INK,
            angle: 0.0,
            halo: false,
        }
    }

    pub(crate) const fn size(mut self, size: f64) -> Self {
        self.size = size;
        self
    }

    pub(crate) const fn anchor(mut self, anchor: Anchor) -> Self {
        self.anchor = anchor;
        self
    }

    pub(crate) const fn color(mut self, color: Rgb) -> Self {
        self.color = color;
        self
    }

    pub(crate) const fn turned(mut self, degrees: f64) -> Self {
        self.angle = degrees;
        self
    }

    pub(crate) const fn halo(mut self) -> Self {
        self.halo = true;
        self
    }
}

/// A drawing in the making.
#[derive(Clone, Debug)]
pub(crate) struct Canvas {
    root: Group,
}

impl Canvas {
    pub(crate) fn new() -> Self {
        Self { root: Group::new() }
    }

    pub(crate) fn into_group(self) -> Group {
        self.root
    }

    fn add(&mut self, node: impl Into<Box<dyn svg::Node>>) {
        svg::Node::append(&mut self.root, node);
    }

    /// Adds what another canvas holds, its upper left corner at `at`, cut to
    /// `size`. Nested pictures need no identifiers, unlike clip paths, so that
    /// pictures may be put into one another.
    pub(crate) fn window(&mut self, inner: Self, at: Place, size: [f64; 2]) {
        let mut window = Element::new("svg");
        for (name, value) in [
            ("x", at[0]),
            ("y", at[1]),
            ("width", size[0]),
            ("height", size[1]),
        ] {
            svg::Node::assign(&mut window, name, px(value));
        }
        svg::Node::append(&mut window, inner.root);
        self.add(window);
    }

    /// Adds what another canvas holds, its upper left corner at `at`.
    pub(crate) fn put(&mut self, inner: Group, at: Place) {
        let shift = format!("translate({} {})", px(at[0]), px(at[1]));
        self.add(Group::new().set("transform", shift).add(inner));
    }

    pub(crate) fn line(&mut self, from: Place, to: Place, stroke: Stroke) {
        let line = Line::new()
            .set("x1", px(from[0]))
            .set("y1", px(from[1]))
            .set("x2", px(to[0]))
            .set("y2", px(to[1]));
        self.add(stroked(line, stroke));
    }

    pub(crate) fn polyline(&mut self, points: &[Place], stroke: Stroke) {
        if points.len() > 1 {
            let path = Path::new()
                .set("d", outline(points, false))
                .set("fill", "none")
                .set("stroke-linejoin", "round");
            self.add(stroked(path, stroke));
        }
    }

    pub(crate) fn polygon(&mut self, points: &[Place], fill: Fill) {
        if points.len() > 2 {
            let path = Path::new()
                .set("d", outline(points, true))
                .set("stroke-linejoin", "round");
            self.add(filled(path, fill));
        }
    }

    pub(crate) fn rectangle(&mut self, at: Place, size: [f64; 2], fill: Fill) {
        let rectangle = Rectangle::new()
            .set("x", px(at[0]))
            .set("y", px(at[1]))
            .set("width", px(size[0]))
            .set("height", px(size[1]));
        self.add(filled(rectangle, fill));
    }

    pub(crate) fn circle(&mut self, center: Place, radius: f64, fill: Fill) {
        self.add(filled(round(center, radius), fill));
    }

    /// A ball lit from above on the left.
    pub(crate) fn ball(&mut self, center: Place, radius: f64, color: Rgb) {
        // The name follows from the colour, so that one definition serves all
        // balls of a document, however pictures are put together.
        let name = format!("ball-{}", &color.to_string()[1..]);
        let stop = |offset: &str, color: Rgb| {
            let mut stop = Element::new("stop");
            svg::Node::assign(&mut stop, "offset", offset);
            svg::Node::assign(&mut stop, "stop-color", color.to_string());
            stop
        };
        let gradient = svg::node::element::RadialGradient::new()
            .set("id", name.as_str())
            .set("cx", "0.38")
            .set("cy", "0.34")
            .set("r", "0.72")
            .add(stop("0", color.mix(WHITE, 0.65)))
            .add(stop("0.6", color))
            .add(stop("1", color.mix(INK, 0.22)));
        self.add(svg::node::element::Definitions::new().add(gradient));
        let ball = round(center, radius)
            .set("fill", format!("url(#{name})"))
            .set("stroke", color.mix(INK, 0.45).to_string())
            .set("stroke-width", 0.6);
        self.add(ball);
    }

    pub(crate) fn text(&mut self, label: Label<'_>) {
        let [x, y] = label.at;
        let mut text = Element::new("text");
        let mut set = |name: &str, value: String| svg::Node::assign(&mut text, name, value);
        set("x", px(x).to_string());
        set("y", px(y + 0.5 * CAP_HEIGHT * label.size).to_string());
        set("font-family", FONTS.to_owned());
        set("font-size", px(label.size).to_string());
        set("fill", label.color.to_string());
        let anchor = match label.anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        set("text-anchor", anchor.to_owned());
        if label.angle != 0.0 {
            let turn = format!("rotate({} {} {})", px(label.angle), px(x), px(y));
            set("transform", turn);
        }
        if label.halo {
            set("stroke", WHITE.to_string());
            set("stroke-width", "2.5".to_owned());
            set("stroke-linejoin", "round".to_owned());
            set("paint-order", "stroke".to_owned());
        }
        let content: Box<dyn svg::Node> = match runs(label.text).as_slice() {
            [
                Run {
                    text,
                    raised: false,
                },
            ] => Box::new(TextNode::new(*text)),
            runs => Box::new(Blob::new(spans(runs, label.size))),
        };
        svg::Node::append(&mut text, content);
        self.add(text);
    }
}

/// Raised and other stretches of text, in one line: a line break between them
/// would show as a space.
fn spans(runs: &[Run<'_>], size: f64) -> String {
    let mut spans = String::new();
    let mut raised = false;
    for run in runs {
        let shift = 0.38 * size;
        let attributes = match (run.raised, raised) {
            (true, _) => {
                let size = px(raised_size(size));
                format!(" dy=\"{}\" font-size=\"{size}\"", px(-shift))
            }
            (false, true) => format!(" dy=\"{}\"", px(shift)),
            (false, false) => String::new(),
        };
        // Writing to a string cannot fail.
        let _ = write!(
            spans,
            "<tspan{attributes}>{}</tspan>",
            TextNode::new(run.text)
        );
        raised = run.raised;
    }
    spans
}

/// A coordinate with as many digits as an eye or a printer can use.
fn px(value: f64) -> f64 {
    // Adding zero turns a negative zero into a positive one.
    (value * PRECISION).round() / PRECISION + 0.0
}

fn outline(points: &[Place], closed: bool) -> String {
    let mut data = String::with_capacity(12 * points.len());
    for (index, [x, y]) in points.iter().enumerate() {
        let command = if index == 0 { 'M' } else { 'L' };
        // Writing to a string cannot fail.
        let _ = write!(data, "{command}{} {}", px(*x), px(*y));
    }
    if closed {
        data.push('Z');
    }
    data
}

fn round(center: Place, radius: f64) -> Circle {
    Circle::new()
        .set("cx", px(center[0]))
        .set("cy", px(center[1]))
        .set("r", px(radius))
}

fn stroked<T: svg::Node>(mut node: T, stroke: Stroke) -> T {
    node.assign("stroke", stroke.color.to_string());
    node.assign("stroke-width", px(stroke.width));
    if !stroke.dash.is_empty() {
        node.assign("stroke-dasharray", stroke.dash);
    }
    if stroke.opacity < 1.0 {
        node.assign("stroke-opacity", px(stroke.opacity));
    }
    if stroke.round {
        node.assign("stroke-linecap", "round");
    }
    node
}

fn filled<T: svg::Node>(mut node: T, fill: Fill) -> T {
    node.assign("fill", fill.color.to_string());
    if fill.opacity < 1.0 {
        node.assign("fill-opacity", px(fill.opacity));
    }
    match fill.outline {
        Some(stroke) => stroked(node, stroke),
        None => node,
    }
}
