//! Structures and what surrounds them, as pictures in rows of panels.
//!
//! Members are cut where they cross in the picture, so that the nearer one runs
//! over the farther one; the parts that a solid hides are drawn faintly over
//! it, as in a technical drawing. The cost is quadratic in the number of
//! members, and members times faces of the solids.

use nalgebra::{Isometry3, Point3, Vector3};
use tensegra_model::{Configuration, ElementKind, Environment, Interval, Role, Shape, Structure};

use super::{
    Picture, PictureError, View,
    axis::drawable,
    camera::Camera,
    canvas::{Anchor, Canvas, Fill, Label, Place, Stroke},
    chart::{Legend, Sample},
    solid::Solid,
    style::{FAINT, GRID, INK, Rgb, SMALL, SOFT, STONE, TITLE, WHITE},
    text::width,
};
use crate::{
    geometry::{Bounds, attachment_pose, perpendicular},
    number::significant,
};

/// What one panel of a picture shows: members, joints, solids, and where it stands.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scene {
    members: Vec<Member>,
    joints: Vec<Joint>,
    solids: Vec<Placed>,
    supports: Vec<Vec<Point3<f64>>>,
    centres: Vec<Point3<f64>>,
}

/// A straight member between two points.
#[derive(Clone, Debug, PartialEq)]
struct Member {
    ends: [Point3<f64>; 2],
    kind: ElementKind,
    radius: f64,
    /// Length of the outer tube of a telescopic strut, from the first end.
    sleeve: f64,
    loops: u32,
}

#[derive(Clone, Debug, PartialEq)]
struct Joint {
    at: Point3<f64>,
    name: String,
}

#[derive(Clone, Debug, PartialEq)]
struct Placed {
    shape: Shape,
    pose: Isometry3<f64>,
    moves: bool,
}

impl Scene {
    /// An empty scene.
    pub fn new() -> Self {
        Self::default()
    }

    /// A structure in a configuration, with what surrounds it.
    ///
    /// # Errors
    /// [`PictureError::Path`] when the configuration does not fit the structure.
    pub fn of(
        structure: &Structure,
        environment: &Environment,
        configuration: &Configuration,
    ) -> Result<Self, PictureError> {
        crate::consistency::check_configuration_of(structure, configuration)?;
        let mut scene = Self::new();
        let positions = &configuration.positions;
        for element in &structure.elements {
            if element.appearance.role == Role::Hidden {
                continue;
            }
            scene.members.push(Member {
                ends: element.nodes.map(|node| positions[node]),
                kind: element.kind,
                radius: element.radius,
                sleeve: sleeve(element.length),
                loops: element.appearance.loops.unwrap_or(8).clamp(1, 40),
            });
        }
        for (node, at) in structure.nodes.iter().zip(positions) {
            scene = scene.joint(*at, &node.name);
        }
        for obstacle in &environment.obstacles {
            if obstacle.role != Role::Hidden {
                scene = scene.solid(obstacle.shape.clone(), Isometry3::identity(), false);
            }
        }
        for attachment in &structure.attachments {
            let Some(pose) = attachment_pose(&attachment.anchors, positions) else {
                continue;
            };
            for part in &attachment.shapes {
                if part.role != Role::Hidden {
                    scene = scene.solid(part.shape.clone(), pose, true);
                }
            }
        }
        Ok(scene)
    }

    /// This scene with one more member.
    pub fn member(mut self, kind: ElementKind, ends: [Point3<f64>; 2], radius: f64) -> Self {
        self.members.push(Member {
            ends,
            kind,
            radius,
            sleeve: 0.5 * nalgebra::distance(&ends[0], &ends[1]),
            loops: 8,
        });
        self
    }

    /// This scene with one more joint; an empty name is not written.
    pub fn joint(mut self, at: Point3<f64>, name: &str) -> Self {
        self.joints.push(Joint {
            at,
            name: name.to_owned(),
        });
        self
    }

    /// This scene with one more solid, in the frame of `pose`. What moves has
    /// another colour than what stands.
    pub fn solid(mut self, shape: Shape, pose: Isometry3<f64>, moves: bool) -> Self {
        self.solids.push(Placed { shape, pose, moves });
        self
    }

    /// This scene with a support polygon, a filled area under everything; two corners make a
    /// line.
    pub fn support(mut self, corners: Vec<Point3<f64>>) -> Self {
        self.supports.push(corners);
        self
    }

    /// This scene with a centre of mass, and a plumb line from it to the ground.
    pub fn centre_of_mass(mut self, at: Point3<f64>) -> Self {
        self.centres.push(at);
        self
    }

    /// Points that the picture has room for.
    fn points(&self, camera: &Camera) -> Vec<Point3<f64>> {
        let ends = self.members.iter().flat_map(|member| member.ends);
        let joints = self.joints.iter().map(|joint| joint.at);
        let solids = self.solids.iter().flat_map(|placed| {
            let solid = Solid::new(&placed.shape, &placed.pose, STONE, camera);
            solid
                .map(|solid| solid.bounds.corners())
                .into_iter()
                .flatten()
        });
        let supports = self.supports.iter().flatten().copied();
        let centres = self.centres.iter().copied();
        ends.chain(joints)
            .chain(solids)
            .chain(supports)
            .chain(centres)
            .collect()
    }
}

/// The tube of a telescopic strut is as long as the strut at its shortest.
fn sleeve(length: Interval) -> f64 {
    if length.lo.is_finite() {
        length.lo
    } else {
        0.0
    }
}

/// How scenes are drawn.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct SceneOptions {
    /// From where the scenes are seen; by default obliquely.
    pub view: View,
    /// Width of the picture in pixels. Default 640.
    pub width: f64,
    /// Panels to a row; by default what makes them largest.
    pub columns: Option<usize>,
    /// Whether the joints of the first panel are named. Default false.
    pub names: bool,
    /// Unit of length for the scale bar, such as `m`.
    pub unit: Option<String>,
}

impl Default for SceneOptions {
    fn default() -> Self {
        Self {
            view: View::oblique(),
            width: 640.0,
            columns: None,
            names: false,
            unit: None,
        }
    }
}

impl SceneOptions {
    /// These options with scenes seen from elsewhere.
    pub fn view(mut self, view: View) -> Self {
        self.view = view;
        self
    }

    /// These options with another width of the picture, in pixels; at least 160.
    pub fn width(mut self, width: f64) -> Self {
        self.width = width.max(160.0);
        self
    }

    /// These options with so many panels to a row.
    pub fn columns(mut self, columns: usize) -> Self {
        self.columns = Some(columns);
        self
    }

    /// These options with the joints of the first panel named.
    pub fn names(mut self) -> Self {
        self.names = true;
        self
    }

    /// These options with a unit of length for the scale bar.
    pub fn unit(mut self, unit: impl Into<String>) -> Self {
        self.unit = Some(unit.into());
        self
    }
}

/// Draws scenes in panels of one scale, each with its title.
///
/// # Errors
/// [`PictureError`] when there is nothing to draw, or a coordinate is not a
/// finite number.
///
/// # Examples
/// ```
/// # fn main() -> Result<(), tensegra_io::PictureError> {
/// use nalgebra::Point3;
/// use tensegra_io::{Scene, SceneOptions, View, draw_scenes};
/// use tensegra_model::ElementKind;
///
/// let [a, b, c] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.4, 0.8, 0.0]].map(Point3::from);
/// let scene = Scene::new()
///     .member(ElementKind::Strut, [a, b], 0.02)
///     .member(ElementKind::Cable, [a, c], 0.002)
///     .member(ElementKind::Cable, [b, c], 0.002)
///     .joint(a, "a")
///     .joint(b, "b")
///     .joint(c, "c");
/// let options = SceneOptions::default().view(View::Plan).names().unit("m");
/// let picture = draw_scenes(&[("triangle".to_owned(), scene)], &options)?;
/// assert!(picture.to_svg().contains("triangle"));
/// # Ok(())
/// # }
/// ```
pub fn draw_scenes(
    panels: &[(String, Scene)],
    options: &SceneOptions,
) -> Result<Picture, PictureError> {
    let camera = options.view.camera();
    let mut points = Vec::new();
    for (title, scene) in panels {
        let of_scene = scene.points(&camera);
        if let Some(&value) = of_scene
            .iter()
            .flat_map(|point| point.iter())
            .find(|value| !drawable(**value))
        {
            let what = format!("the panel `{title}`");
            return Err(PictureError::NotFinite { what, value });
        }
        points.extend(of_scene);
    }
    let empty = || PictureError::Empty {
        what: "the scene".to_owned(),
    };
    let world = Bounds::around(points.iter().copied()).ok_or_else(empty)?;
    let seen = Bounds::around(points.iter().map(|point| camera.see(point))).ok_or_else(empty)?;

    let sheet = Sheet::new(panels.len(), &seen, options);
    let legend = Legend::flow(samples(panels).into_iter(), options.width - 20.0);
    let top = 10.0 + legend.height() + 4.0;
    let mut canvas = Canvas::new();
    legend.draw(&mut canvas, [10.0, 8.0], options.width - 20.0);
    for (index, (title, scene)) in panels.iter().enumerate() {
        let at = sheet.place(index);
        let at = [at[0], top + at[1]];
        let middle = at[0] + 0.5 * sheet.panel[0];
        let heading = Label::new(title, [middle, at[1] + 0.5 * TITLE]);
        canvas.text(heading.size(SMALL + 1.0));
        let panel = Panel {
            camera,
            center: nalgebra::center(&seen.min, &seen.max),
            scale: sheet.scale,
            size: [sheet.panel[0], sheet.panel[1] - HEADING],
            flat: options.view == View::Plan,
            world,
        };
        let window = panel.draw(scene, options.names && index == 0);
        canvas.window(window, [at[0], at[1] + HEADING], panel.size);
    }
    let bottom = top + sheet.height();
    draw_footer(&mut canvas, &sheet, bottom, &camera, options);
    Ok(Picture::new(canvas, [options.width, bottom + FOOTER]))
}

const GAP: f64 = 10.0;
const HEADING: f64 = 18.0;
const FOOTER: f64 = 46.0;
const MARGIN: f64 = 14.0;

/// How the panels share the page.
struct Sheet {
    columns: usize,
    rows: usize,
    panel: [f64; 2],
    /// Pixels for a unit of length.
    scale: f64,
}

impl Sheet {
    fn new(panels: usize, seen: &Bounds, options: &SceneOptions) -> Self {
        let extent = seen.max - seen.min;
        // A structure on one line still needs a panel with two sides.
        let longest = extent.x.max(extent.y).max(f64::MIN_POSITIVE);
        let [across, up] = [extent.x.max(0.05 * longest), extent.y.max(0.05 * longest)];
        let tallest = options.width;
        let fit = |columns: usize| {
            let rows = panels.div_ceil(columns);
            let width = (options.width - (columns + 1) as f64 * GAP) / columns as f64;
            let height = tallest / rows as f64 - GAP - HEADING;
            let room = [width - 2.0 * MARGIN, height - 2.0 * MARGIN].map(|side| side.max(1.0));
            let scale = (room[0] / across).min(room[1] / up);
            Self {
                columns,
                rows,
                panel: [width, up * scale + 2.0 * MARGIN + HEADING],
                scale,
            }
        };
        let most = panels.max(1);
        match options.columns {
            Some(columns) => fit(columns.clamp(1, most)),
            None => (1..=most)
                .map(fit)
                .reduce(|best, next| if next.scale > best.scale { next } else { best })
                .unwrap_or_else(|| fit(1)),
        }
    }

    fn place(&self, index: usize) -> Place {
        let [column, row] = [index % self.columns, index / self.columns];
        [
            GAP + column as f64 * (self.panel[0] + GAP),
            row as f64 * (self.panel[1] + GAP),
        ]
    }

    fn height(&self) -> f64 {
        self.rows as f64 * (self.panel[1] + GAP)
    }
}

/// Scale bar on the right, axes on the left.
fn draw_footer(
    canvas: &mut Canvas,
    sheet: &Sheet,
    top: f64,
    camera: &Camera,
    options: &SceneOptions,
) {
    let length = bar_length(0.3 * sheet.panel[0].min(420.0) / sheet.scale);
    let unit = options.unit.as_deref().unwrap_or("units of length");
    let figure = significant(length, 3);
    let unit = match (figure.as_str(), unit.strip_prefix("units ")) {
        ("1", Some(rest)) => format!("unit {rest}"),
        _ => unit.to_owned(),
    };
    let caption = format!("{figure} {unit}");
    let pixels = length * sheet.scale;
    let half = 0.5 * pixels.max(width(&caption, SMALL));
    let middle = options.width - GAP - MARGIN - half;
    let stroke = Stroke::new(INK, 1.2);
    let height = top + 12.0;
    let [left, right] = [middle - 0.5 * pixels, middle + 0.5 * pixels];
    canvas.line([left, height], [right, height], stroke);
    for end in [left, right] {
        canvas.line([end, height - 3.0], [end, height + 3.0], stroke);
    }
    let label = Label::new(&caption, [middle, height + 6.0 + 0.5 * SMALL]);
    canvas.text(label.size(SMALL));

    const ARROW: f64 = 20.0;
    let origin = [GAP + MARGIN + 8.0, top + 22.0];
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        let mut unit = Point3::origin();
        unit[axis] = 1.0;
        let seen = camera.see(&unit);
        let size = seen.xy().coords.norm();
        // An axis that points at the viewer is a dot.
        if size < 0.1 {
            continue;
        }
        let end = |length: f64| [origin[0] + length * seen.x, origin[1] - length * seen.y];
        let tip = end(ARROW);
        canvas.line(origin, tip, Stroke::new(SOFT, 1.0));
        let along = [seen.x / size, -seen.y / size];
        let back = |side: f64| {
            [
                tip[0] - 4.0 * along[0] - side * along[1],
                tip[1] - 4.0 * along[1] + side * along[0],
            ]
        };
        canvas.polygon(&[tip, back(2.0), back(-2.0)], Fill::new(SOFT));
        let name_at = [tip[0] + 7.0 * along[0], tip[1] + 7.0 * along[1]];
        canvas.text(Label::new(name, name_at).size(SMALL).color(SOFT));
    }
}

/// The largest of 1, 2 and 5 times a power of ten up to `longest`.
fn bar_length(longest: f64) -> f64 {
    let unit = 10_f64.powf(longest.log10().floor());
    [5.0, 2.0]
        .into_iter()
        .map(|factor| factor * unit)
        .find(|length| *length <= longest)
        .unwrap_or(unit)
}

const KINDS: [(ElementKind, &str); 5] = [
    (ElementKind::Strut, "strut"),
    (ElementKind::Bar, "bar"),
    (ElementKind::Prismatic, "telescopic strut"),
    (ElementKind::Cable, "cable"),
    (ElementKind::Spring, "spring"),
];

const fn color_of(kind: ElementKind) -> Rgb {
    match kind {
        ElementKind::Strut => Rgb(38, 62, 104),
        ElementKind::Bar => Rgb(96, 96, 104),
        ElementKind::Prismatic => Rgb(0, 114, 178),
        ElementKind::Cable => Rgb(213, 94, 0),
        ElementKind::Spring => Rgb(0, 140, 102),
    }
}

const MOVING: Rgb = Rgb(157, 190, 214);
const SUPPORT: Rgb = Rgb(0, 158, 115);
const CENTRE: Rgb = Rgb(213, 94, 0);

/// Entries of the legend for what the panels show.
fn samples(panels: &[(String, Scene)]) -> Vec<Sample<'static>> {
    let scenes = || panels.iter().map(|(_, scene)| scene);
    let mut samples = Vec::new();
    for (kind, name) in KINDS {
        if scenes().any(|scene| scene.members.iter().any(|m| m.kind == kind)) {
            let thick = match kind {
                ElementKind::Cable | ElementKind::Spring => 1.3,
                _ => 4.0,
            };
            samples.push(Sample::Line(name, Stroke::new(color_of(kind), thick)));
        }
    }
    for (moves, name, color) in [(false, "obstacle", STONE), (true, "rigid body", MOVING)] {
        if scenes().any(|scene| scene.solids.iter().any(|s| s.moves == moves)) {
            samples.push(Sample::Area(name, color));
        }
    }
    if scenes().any(|scene| !scene.supports.is_empty()) {
        samples.push(Sample::Area("support polygon", SUPPORT));
    }
    if scenes().any(|scene| !scene.centres.is_empty()) {
        samples.push(Sample::Dot("centre of mass", CENTRE));
    }
    samples
}

/// One scene on its part of the page.
struct Panel {
    camera: Camera,
    /// What is seen in the middle.
    center: Point3<f64>,
    scale: f64,
    size: [f64; 2],
    flat: bool,
    world: Bounds,
}

/// A part of a member that crosses at most one other.
struct Piece {
    member: usize,
    from: f64,
    to: f64,
    depth: f64,
    hidden: bool,
}

impl Panel {
    fn page(&self, seen: &Point3<f64>) -> Place {
        [
            0.5 * self.size[0] + self.scale * (seen.x - self.center.x),
            0.5 * self.size[1] - self.scale * (seen.y - self.center.y),
        ]
    }

    fn draw(&self, scene: &Scene, names: bool) -> Canvas {
        let mut canvas = Canvas::new();
        for placed in &scene.solids {
            if let Shape::HalfSpace { point, normal } = &placed.shape {
                self.draw_ground(&mut canvas, &(placed.pose * point), &(placed.pose * normal));
            }
        }
        for corners in &scene.supports {
            self.draw_support(&mut canvas, corners);
        }
        let solids = self.solids(scene);
        for solid in &solids {
            solid.draw(&mut canvas, &|point| self.page(point));
        }
        // In the plan of a planar structure nothing stands above it.
        let hiding: &[Solid] = if self.flat { &[] } else { &solids };
        let ends: Vec<[Point3<f64>; 2]> = scene
            .members
            .iter()
            .map(|member| member.ends.map(|end| self.camera.see(&end)))
            .collect();
        let mut pieces = self.pieces(scene, &ends, hiding);
        pieces.sort_by(|a, b| {
            let hidden = b.hidden.cmp(&a.hidden);
            let rank = |piece: &Piece| is_thin(scene.members[piece.member].kind);
            hidden
                .then(a.depth.total_cmp(&b.depth))
                .then(rank(a).cmp(&rank(b)))
        });
        for piece in &pieces {
            self.draw_piece(
                &mut canvas,
                &scene.members[piece.member],
                &ends[piece.member],
                piece,
            );
        }
        self.draw_joints(&mut canvas, scene, hiding);
        for centre in &scene.centres {
            self.draw_centre(&mut canvas, centre);
        }
        if names {
            self.draw_names(&mut canvas, scene, &ends);
        }
        canvas
    }

    /// The solids that have an end, the farthest first.
    fn solids(&self, scene: &Scene) -> Vec<Solid> {
        let mut rest: Vec<Solid> = scene
            .solids
            .iter()
            .filter_map(|placed| {
                let color = if placed.moves { MOVING } else { STONE };
                Solid::new(&placed.shape, &placed.pose, color, &self.camera)
            })
            .collect();
        let toward = self.camera.toward();
        let depth = |solid: &Solid| {
            let middle = nalgebra::center(&solid.bounds.min, &solid.bounds.max);
            toward.dot(&middle.coords)
        };
        rest.sort_by(|a, b| depth(a).total_cmp(&depth(b)));
        let mut sorted = Vec::with_capacity(rest.len());
        while !rest.is_empty() {
            // The farthest of those that no other has to precede; where bodies
            // overlap in a ring, the farthest.
            let next = (0..rest.len())
                .find(|&candidate| {
                    let others = rest
                        .iter()
                        .enumerate()
                        .filter(|(index, _)| *index != candidate);
                    others
                        .map(|(_, other)| other)
                        .all(|other| !rest[candidate].is_before(other, &toward))
                })
                .unwrap_or(0);
            sorted.push(rest.remove(next));
        }
        sorted
    }

    /// Cuts the members where they pass from sight to behind a solid, and
    /// midway between the places where they cross.
    fn pieces(&self, scene: &Scene, ends: &[[Point3<f64>; 2]], solids: &[Solid]) -> Vec<Piece> {
        const SAMPLES: usize = 96;
        let grain = 1e-9 * self.world.diagonal();
        let mut pieces = Vec::new();
        for (member, [p, q]) in ends.iter().enumerate() {
            let at = |t: f64| p + (q - p) * t;
            let mut crossings: Vec<f64> = ends
                .iter()
                .enumerate()
                .filter(|(other, _)| *other != member)
                .filter_map(|(_, [a, b])| crossing(p, q, a, b))
                .collect();
            crossings.sort_by(f64::total_cmp);
            let mut cuts = vec![0.0, 1.0];
            cuts.extend(crossings.windows(2).map(|pair| 0.5 * (pair[0] + pair[1])));
            let kind = &scene.members[member];
            if kind.kind == ElementKind::Prismatic {
                let share = kind.sleeve / nalgebra::distance(&kind.ends[0], &kind.ends[1]);
                cuts.extend(Some(share).filter(|share| (0.0..1.0).contains(share)));
            }
            let hidden = |t: f64| solids.iter().any(|solid| solid.hides(&at(t)));
            if !solids.is_empty() {
                let mut before = hidden(0.5 / SAMPLES as f64);
                for sample in 1..SAMPLES {
                    let after = hidden((sample as f64 + 0.5) / SAMPLES as f64);
                    if before != after {
                        cuts.push(sample as f64 / SAMPLES as f64);
                    }
                    before = after;
                }
            }
            cuts.sort_by(f64::total_cmp);
            for cut in cuts.windows(2).filter(|cut| cut[1] > cut[0]) {
                let within = crossings.iter().find(|t| (cut[0]..=cut[1]).contains(*t));
                let middle = 0.5 * (cut[0] + cut[1]);
                let depth = at(within.copied().unwrap_or(middle)).z;
                pieces.push(Piece {
                    member,
                    from: cut[0],
                    to: cut[1],
                    // Rounding must not decide what lies over what in a plane.
                    depth: (depth / grain.max(f64::MIN_POSITIVE)).round(),
                    hidden: hidden(middle),
                });
            }
        }
        pieces
    }

    fn draw_piece(
        &self,
        canvas: &mut Canvas,
        member: &Member,
        ends: &[Point3<f64>; 2],
        piece: &Piece,
    ) {
        // In a plane nothing runs over anything else.
        let halo = match (self.flat, is_thin(member.kind)) {
            (true, _) => 0.0,
            (false, true) => 2.0,
            (false, false) => 2.4,
        };
        let full = self.line_width(member);
        let telescopic = member.kind == ElementKind::Prismatic;
        let length = nalgebra::distance(&member.ends[0], &member.ends[1]);
        let rod = telescopic && piece.from * length >= member.sleeve * (1.0 - 1e-9);
        let thick = if rod { (0.5 * full).max(1.6) } else { full };
        let [p, q] = ends.map(|end| self.page(&end));
        let at = |t: f64| [p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1])];
        let color = color_of(member.kind);
        let color = if piece.hidden {
            color.mix(STONE, 0.62)
        } else {
            color
        };
        let points = match member.kind {
            ElementKind::Spring => zigzag(p, q, member.loops, piece.from, piece.to),
            _ => vec![at(piece.from), at(piece.to)],
        };
        if !piece.hidden && halo > 0.0 {
            canvas.polyline(&points, Stroke::new(WHITE, thick + halo));
        }
        // Neighbouring pieces overlap by a hair, which closes the seam.
        let mut points = points;
        let hair = 0.3 / (q[0] - p[0]).hypot(q[1] - p[1]).max(0.3);
        if member.kind != ElementKind::Spring {
            points = vec![
                at((piece.from - hair).max(0.0)),
                at((piece.to + hair).min(1.0)),
            ];
        }
        canvas.polyline(&points, Stroke::new(color, thick));
    }

    /// True to scale, but never so thin that it is lost.
    fn line_width(&self, member: &Member) -> f64 {
        let least = match member.kind {
            ElementKind::Cable | ElementKind::Spring => 1.1,
            ElementKind::Bar => 2.2,
            ElementKind::Strut | ElementKind::Prismatic => 3.0,
        };
        (2.0 * member.radius * self.scale).max(least)
    }

    fn draw_joints(&self, canvas: &mut Canvas, scene: &Scene, solids: &[Solid]) {
        let thickest = scene
            .members
            .iter()
            .filter(|member| !is_thin(member.kind))
            .map(|member| 0.5 * self.line_width(member));
        let radius = thickest.fold(1.8, f64::max).min(5.0) + 0.5;
        let mut seen: Vec<Point3<f64>> = scene
            .joints
            .iter()
            .map(|joint| self.camera.see(&joint.at))
            .collect();
        seen.sort_by(|a, b| a.z.total_cmp(&b.z));
        for joint in &seen {
            let hidden = solids.iter().any(|solid| solid.hides(joint));
            let [fill, line] = match hidden {
                true => [STONE.mix(WHITE, 0.4), FAINT],
                false => [WHITE, INK],
            };
            let fill = Fill::new(fill).outline(Stroke::new(line, 0.9));
            canvas.circle(self.page(joint), radius, fill);
        }
    }

    /// Names beside the joints, where they cover the least.
    fn draw_names(&self, canvas: &mut Canvas, scene: &Scene, ends: &[[Point3<f64>; 2]]) {
        let lines: Vec<[Place; 2]> = ends
            .iter()
            .map(|ends| ends.map(|end| self.page(&end)))
            .collect();
        let joints: Vec<Place> = scene
            .joints
            .iter()
            .map(|joint| self.page(&self.camera.see(&joint.at)))
            .collect();
        let mut taken: Vec<[Place; 2]> = Vec::new();
        for (joint, at) in scene.joints.iter().zip(&joints) {
            if joint.name.is_empty() {
                continue;
            }
            let half = [0.5 * width(&joint.name, SMALL) + 1.0, 0.5 * SMALL];
            let candidates = (0..12).map(|step| {
                let angle = std::f64::consts::TAU * (f64::from(step) + 0.5) / 12.0;
                let reach = 6.0 + half[0].min(half[1] / angle.sin().abs().max(0.3));
                [
                    at[0] + reach * angle.cos() * (1.0 + 0.2 * half[0] / half[1]),
                    at[1] - reach * angle.sin(),
                ]
            });
            let cost = |center: &Place| {
                let corners = [
                    [center[0] - half[0], center[1] - half[1]],
                    [center[0] + half[0], center[1] + half[1]],
                ];
                let outside = corners[0][0] < 0.0
                    || corners[0][1] < 0.0
                    || corners[1][0] > self.size[0]
                    || corners[1][1] > self.size[1];
                let overlaps = taken
                    .iter()
                    .filter(|other| boxes_meet(&corners, other))
                    .count();
                let crossed = lines
                    .iter()
                    .filter(|line| meets_box(line, &corners))
                    .count();
                let covered = joints
                    .iter()
                    .filter(|joint| meets_box(&[**joint, **joint], &corners));
                20 * usize::from(outside) + 10 * overlaps + 2 * crossed + 4 * covered.count()
            };
            let Some(best) = candidates.min_by_key(cost) else {
                continue;
            };
            taken.push([
                [best[0] - half[0], best[1] - half[1]],
                [best[0] + half[0], best[1] + half[1]],
            ]);
            canvas.text(
                Label::new(&joint.name, best)
                    .size(SMALL)
                    .anchor(Anchor::Middle)
                    .halo(),
            );
        }
    }

    fn draw_support(&self, canvas: &mut Canvas, corners: &[Point3<f64>]) {
        let places: Vec<Place> = corners
            .iter()
            .map(|corner| self.page(&self.camera.see(corner)))
            .collect();
        if let [from, to] = places.as_slice() {
            canvas.line(*from, *to, Stroke::new(SUPPORT, 5.0).round());
            return;
        }
        let outline = Stroke::new(SUPPORT, 0.9);
        canvas.polygon(&places, Fill::new(SUPPORT).opacity(0.28).outline(outline));
    }

    /// A dot, and a plumb line to a cross on the ground.
    fn draw_centre(&self, canvas: &mut Canvas, centre: &Point3<f64>) {
        const ARM: f64 = 3.2;
        let at = self.page(&self.camera.see(centre));
        let ground = Point3::new(centre.x, centre.y, 0.0);
        let foot = self.page(&self.camera.see(&ground));
        canvas.line(at, foot, Stroke::new(CENTRE, 1.1).dash("2 2"));
        for side in [-1.0, 1.0] {
            let [from, to] = [-ARM, ARM].map(|arm| [foot[0] + arm, foot[1] + side * arm]);
            canvas.line(from, to, Stroke::new(CENTRE, 1.3));
        }
        let fill = Fill::new(CENTRE).outline(Stroke::new(INK, 0.9));
        canvas.circle(at, 3.4, fill);
    }

    /// The plane of a half-space under the scene, as a grid; the half-space
    /// itself where it is seen from the side.
    fn draw_ground(&self, canvas: &mut Canvas, point: &Point3<f64>, normal: &Vector3<f64>) {
        const LINES: i32 = 8;
        let Some(normal) = normal.try_normalize(0.0) else {
            return;
        };
        let middle = nalgebra::center(&self.world.min, &self.world.max);
        let foot = middle - normal * normal.dot(&(middle - point));
        let reach = 0.6 * self.world.diagonal();
        let seen = |along: [f64; 2], axes: &[Vector3<f64>; 2]| {
            let place = foot + (axes[0] * along[0] + axes[1] * along[1]) * reach;
            self.page(&self.camera.see(&place))
        };
        if self.camera.toward().dot(&normal).abs() < 0.02 {
            let across = self.camera.toward().cross(&normal);
            let axes = [across, -normal];
            let corners = [[-2.0, 0.0], [2.0, 0.0], [2.0, 2.0], [-2.0, 2.0]];
            let corners = corners.map(|corner| seen(corner, &axes));
            canvas.polygon(&corners, Fill::new(STONE.mix(WHITE, 0.4)));
            canvas.line(corners[0], corners[1], Stroke::new(SOFT, 0.8));
            return;
        }
        let axes = perpendicular(&normal);
        let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
        let corners = corners.map(|corner| seen(corner, &axes));
        let outline = Stroke::new(FAINT, 0.6);
        canvas.polygon(&corners, Fill::new(Rgb(247, 247, 246)).outline(outline));
        for line in 1 - LINES..LINES {
            let share = f64::from(line) / f64::from(LINES);
            let grid = Stroke::new(GRID, 0.6);
            canvas.line(seen([share, -1.0], &axes), seen([share, 1.0], &axes), grid);
            canvas.line(seen([-1.0, share], &axes), seen([1.0, share], &axes), grid);
        }
    }
}

const fn is_thin(kind: ElementKind) -> bool {
    matches!(kind, ElementKind::Cable | ElementKind::Spring)
}

/// Where on the line from `p` to `q` (0 to 1) it crosses that from `a` to `b`
/// in the picture; none at shared ends.
fn crossing(p: &Point3<f64>, q: &Point3<f64>, a: &Point3<f64>, b: &Point3<f64>) -> Option<f64> {
    const ENDS: f64 = 1e-3;
    let [d, e, f] = [(q - p).xy(), (b - a).xy(), (a - p).xy()];
    let turn = d.perp(&e);
    if turn.abs() <= 1e-9 * d.norm() * e.norm() {
        return None;
    }
    let [t, s] = [f.perp(&e) / turn, f.perp(&d) / turn];
    let inside = ENDS..1.0 - ENDS;
    (inside.contains(&t) && inside.contains(&s)).then_some(t)
}

/// The part from `from` to `to` (0 to 1) of a spring between two places.
fn zigzag(p: Place, q: Place, loops: u32, from: f64, to: f64) -> Vec<Place> {
    const AMPLITUDE: f64 = 3.2;
    const STRAIGHT: f64 = 0.15;
    let [dx, dy] = [q[0] - p[0], q[1] - p[1]];
    let length = dx.hypot(dy).max(f64::MIN_POSITIVE);
    let half_turns = 2 * loops;
    let coil = |t: f64| {
        let turn = (t - STRAIGHT) / (1.0 - 2.0 * STRAIGHT) * f64::from(half_turns);
        if !(0.0..=f64::from(half_turns)).contains(&turn) {
            return 0.0;
        }
        // A triangle wave through 0, 1, 0, −1, 0.
        let phase = (turn * 0.5).fract();
        AMPLITUDE * (1.0 - (4.0 * ((phase + 0.75).fract()) - 2.0).abs())
    };
    let at = |t: f64| {
        let side = coil(t);
        [
            p[0] + t * dx - side * dy / length,
            p[1] + t * dy + side * dx / length,
        ]
    };
    let corners = (0..=2 * half_turns).map(|corner| {
        STRAIGHT + (1.0 - 2.0 * STRAIGHT) * f64::from(corner) / f64::from(2 * half_turns)
    });
    let inner = corners.filter(|t| (from..to).contains(t) && *t > from);
    [from]
        .into_iter()
        .chain(inner)
        .chain([to])
        .map(at)
        .collect()
}

fn boxes_meet(a: &[Place; 2], b: &[Place; 2]) -> bool {
    (0..2).all(|axis| a[0][axis] < b[1][axis] && b[0][axis] < a[1][axis])
}

/// Whether a line passes through a box (Liang and Barsky).
fn meets_box([p, q]: &[Place; 2], corners: &[Place; 2]) -> bool {
    let [mut enter, mut leave] = [0.0_f64, 1.0_f64];
    for axis in 0..2 {
        let along = q[axis] - p[axis];
        let [lo, hi] = [corners[0][axis] - p[axis], corners[1][axis] - p[axis]];
        if along == 0.0 {
            if lo > 0.0 || hi < 0.0 {
                return false;
            }
            continue;
        }
        let [a, b] = [lo / along, hi / along];
        enter = enter.max(a.min(b));
        leave = leave.min(a.max(b));
    }
    enter <= leave
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crossings_are_found_between_the_ends_only() {
        let [p, q] = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]].map(Point3::from);
        let [a, b] = [[0.5, -1.0, 3.0], [0.5, 1.0, 1.0]].map(Point3::from);
        assert_eq!(crossing(&p, &q, &a, &b), Some(0.25));
        assert_eq!(crossing(&p, &q, &p, &b), None);
        assert_eq!(crossing(&p, &q, &p, &q), None);
    }

    #[test]
    fn lines_meet_boxes() {
        let corners = [[0.0, 0.0], [2.0, 1.0]];
        assert!(meets_box(&[[-1.0, -1.0], [3.0, 2.0]], &corners));
        assert!(meets_box(&[[1.0, 0.5], [1.0, 0.5]], &corners));
        assert!(!meets_box(&[[-1.0, 0.0], [0.0, 2.0]], &corners));
        assert!(!meets_box(&[[3.0, -1.0], [3.0, 2.0]], &corners));
    }

    #[test]
    fn scale_bars_are_round() {
        assert_eq!(bar_length(0.7), 0.5);
        assert_eq!(bar_length(30.0), 20.0);
        assert_eq!(bar_length(1.9), 1.0);
    }

    #[test]
    fn nothing_and_no_number_are_refused() {
        let options = SceneOptions::default();
        let empty = draw_scenes(&[("a".into(), Scene::new())], &options);
        assert!(matches!(empty, Err(PictureError::Empty { .. })));
        let lost = Scene::new().joint(Point3::new(f64::NAN, 0.0, 0.0), "n");
        let lost = draw_scenes(&[("a".into(), lost)], &options);
        assert!(matches!(lost, Err(PictureError::NotFinite { .. })));
    }
}
