//! Pictures of walks: snapshots of a gait, the track of the centre of mass, the margins left to
//! the limits, the plan over the triangular grid, and the error of a simulated execution.
//!
//! They correspond to figures 9, 6 and 14, 7, 10 and 16 of Usevitch et al. (2020).

use tensegra_lar::{Cell, Dimension, Margins, TriangularGrid, TwoTierWalk, Walk};
use tensegra_model::ElementKind;

use super::{Frame, Frames};
use crate::picture::{
    Axis, Chart, Level, Picture, PictureError, Region, Scene, SceneOptions, Series, View,
    draw_scenes,
};

/// Colours of the series of a chart, by what they mean.
mod palette {
    pub(super) const BLUE: usize = 0;
    pub(super) const ORANGE: usize = 1;
    pub(super) const GREEN: usize = 2;
    pub(super) const BLACK: usize = 6;
}

/// Width of charts and of scenes in pixels.
const WIDTH: f64 = 640.0;
/// Corners of the polygon that stands for a circle.
const CIRCLE: usize = 48;

/// Snapshots of the robot from the start to just before the second roll: at the start, half way
/// to the first roll, before and after it, half way on, and at the end (figure 9).
///
/// # Errors
/// [`PictureError`] when the walk's lists do not fit together.
pub fn draw_gait(walk: &Walk, unit: &str) -> Result<Picture, PictureError> {
    let shown = Frames::of(walk)?;
    let last = shown.frames.len() - 1;
    let end = walk.rolls.get(1).copied().unwrap_or(last);
    let mut picked: Vec<(usize, &str)> = match walk.rolls.first() {
        Some(&roll) => vec![
            (0, ""),
            (roll / 2, ""),
            (roll, ", before the roll"),
            (roll + 1, ", after it"),
            (usize::midpoint(roll + 1, end), ""),
            (end, ""),
        ],
        None => [0, 1, 2, 3, 4, 5].map(|k| (k * end / 5, "")).to_vec(),
    };
    picked.dedup_by_key(|(index, _)| *index);
    let radius = 0.2 * walk.limits.min_distance;
    let panels: Vec<(String, Scene)> = picked
        .into_iter()
        .map(|(index, remark)| {
            let title = format!("step {index}{remark}");
            (title, scene(walk, &shown, &shown.frames[index], radius))
        })
        .collect();
    let view = match walk.dimension {
        Dimension::Two => View::Axonometric {
            azimuth: -90.0,
            elevation: 0.0,
        },
        Dimension::Three => View::oblique(),
    };
    let options = SceneOptions::default()
        .view(view)
        .width(WIDTH)
        .columns(3)
        .names()
        .unit(unit);
    draw_scenes(&panels, &options)
}

fn scene(walk: &Walk, shown: &Frames, frame: &Frame, radius: f64) -> Scene {
    let mut scene = Scene::new();
    for &[a, b] in &shown.members {
        let ends = [frame.positions[a], frame.positions[b]];
        scene = scene.member(ElementKind::Prismatic, ends, radius);
    }
    for (at, name) in frame.positions.iter().zip(&walk.nodes) {
        scene = scene.joint(*at, name);
    }
    scene
        .support(frame.support_corners())
        .centre_of_mass(frame.centre)
}

/// The track of the centre of mass with support polygons, waypoints and obstacles, seen from
/// above (figures 6 and 14); for a planar walk, its place over the steps.
///
/// # Errors
/// [`PictureError`] when the walk's lists do not fit together.
pub fn draw_track(walk: &Walk, unit: &str) -> Result<Picture, PictureError> {
    let shown = Frames::of(walk)?;
    match walk.dimension {
        Dimension::Two => planar_track(walk, &shown, unit),
        Dimension::Three => {
            let mut chart = map(walk, unit, "Track of the centre of mass");
            for (index, polygon) in walk.support_polygons().iter().enumerate() {
                let corners = polygon.iter().map(|p| [p.x, p.y]).collect();
                let label = if index == 0 { "support polygon" } else { "" };
                chart = chart.region(Region::new(label, corners));
            }
            with_goals(with_obstacles(chart, walk), walk, &shown).draw()
        }
    }
}

/// A chart that is a map of the ground.
fn map(walk: &Walk, unit: &str, title: &str) -> Chart {
    let title = match walk.name.as_str() {
        "" => title.to_owned(),
        name => format!("{name}: {}", title.to_lowercase()),
    };
    Chart::new(Axis::new("x").unit(unit), Axis::new("y").unit(unit))
        .title(title)
        .size(WIDTH, 0.8 * WIDTH)
        .equal_scale()
}

fn with_obstacles(mut chart: Chart, walk: &Walk) -> Chart {
    for (index, obstacle) in walk.obstacles.iter().enumerate() {
        let corners = obstacle.corners().iter().map(|p| [p.x, p.y]).collect();
        let label = if index == 0 { "obstacle" } else { "" };
        chart = chart.region(Region::new(label, corners).color(palette::BLACK));
    }
    chart
}

/// Adds the track, the waypoints and the discs in which they count as visited, and the start.
fn with_goals(mut chart: Chart, walk: &Walk, shown: &Frames) -> Chart {
    if let tensegra_lar::Visit::CentreOfMass(radius) = walk.visit {
        for &[x, y] in &walk.waypoints {
            let circle = (0..CIRCLE).map(|k| {
                let angle = std::f64::consts::TAU * k as f64 / CIRCLE as f64;
                [x + radius * angle.cos(), y + radius * angle.sin()]
            });
            chart = chart.region(Region::new("", circle.collect()).color(palette::ORANGE));
        }
    }
    let track: Vec<[f64; 2]> = shown
        .frames
        .iter()
        .map(|frame| [frame.centre.x, frame.centre.y])
        .collect();
    let start = track[..1].to_vec();
    chart = chart
        .series(Series::line("centre of mass", track).color(palette::BLUE))
        .series(Series::points("start", start).color(palette::GREEN));
    let waypoints = walk.waypoints.clone();
    if waypoints.is_empty() {
        return chart;
    }
    let label = if waypoints.len() == 1 {
        "waypoint"
    } else {
        "waypoints"
    };
    chart.series(Series::points(label, waypoints).color(palette::ORANGE))
}

/// The ground of a planar robot has one axis; the other is the step.
fn planar_track(walk: &Walk, shown: &Frames, unit: &str) -> Result<Picture, PictureError> {
    let mut chart = Chart::new(Axis::new("step"), Axis::new("x").unit(unit))
        .title("Track of the centre of mass")
        .size(WIDTH, 0.6 * WIDTH);
    let firsts = std::iter::once(0).chain(walk.rolls.iter().map(|roll| roll + 1));
    let lasts = walk.rolls.iter().copied().chain([shown.frames.len() - 1]);
    for (index, (first, last)) in firsts.zip(lasts).enumerate() {
        let corners = shown.frames[first].support_corners();
        let [a, b] = corners.as_slice() else {
            continue;
        };
        let (from, to) = (first as f64, last as f64);
        let label = if index == 0 { "support" } else { "" };
        let corners = vec![[from, a.x], [to, a.x], [to, b.x], [from, b.x]];
        chart = chart.region(Region::new(label, corners));
    }
    let track = shown.frames.iter().enumerate();
    let track = track.map(|(step, frame)| [step as f64, frame.centre.x]);
    chart = chart.series(Series::line("centre of mass", track.collect()).color(palette::BLUE));
    for (index, &[x, _]) in walk.waypoints.iter().enumerate() {
        chart = chart.level(Level::new(format!("waypoint {index}"), x).color(palette::ORANGE));
    }
    chart.draw()
}

/// What the walk leaves to each limit, step by step (figure 7): longest and shortest member,
/// distance between members, angle, rigidity index, balance, and displacement of nodes.
///
/// # Errors
/// [`PictureError`] when the walk's lists do not fit together, or there are not as many margins
/// as configurations.
pub fn draw_margins(walk: &Walk, margins: &[Margins], unit: &str) -> Result<Picture, PictureError> {
    let shown = Frames::of(walk)?;
    if margins.len() != shown.frames.len() {
        return Err(PictureError::Empty {
            what: "the list of margins".to_owned(),
        });
    }
    let limits = &walk.limits;
    let over = |quantity: fn(&Margins) -> f64| -> Vec<[f64; 2]> {
        let steps = margins.iter().enumerate();
        steps.map(|(k, m)| [k as f64, quantity(m)]).collect()
    };
    let chart = |title: &str, axis: Axis| Chart::new(Axis::new("step"), axis).title(title);
    let mut pictures = vec![
        chart("Lengths of members", Axis::new("length").unit(unit))
            .series(Series::line("longest", over(|m| m.longest)))
            .series(Series::line("shortest", over(|m| m.shortest)))
            .level(Level::new("greatest length", limits.max_length))
            .level(Level::new("least length", limits.min_length))
            .draw()?,
    ];
    let distances = over(|m| m.distance);
    if distances.iter().all(|point| point[1].is_finite()) {
        pictures.push(
            chart(
                "Distance of members that share no node",
                Axis::new("least distance").unit(unit),
            )
            .series(Series::line("", distances))
            .level(Level::new("limit", limits.min_distance))
            .draw()?,
        );
    }
    pictures.push(
        chart(
            "Angle between members at a node",
            Axis::new("least angle").unit("°"),
        )
        .series(Series::line("", over(|m| m.angle.to_degrees())))
        .level(Level::new("limit", limits.min_angle.to_degrees()))
        .draw()?,
    );
    let mut rigidity = chart("Worst-case rigidity index", Axis::new("index"))
        .series(Series::line("", over(|m| m.rigidity)));
    if let Some(limit) = limits.min_rigidity {
        rigidity = rigidity.level(Level::new("limit", limit));
    }
    pictures.push(rigidity.draw()?);
    pictures.push(
        chart(
            "Centre of mass inside the support polygon",
            Axis::new("distance from its sides").unit(unit),
        )
        .series(Series::line("", over(|m| m.balance)))
        .level(Level::new("limit", 0.0))
        .draw()?,
    );
    let steps: Vec<[f64; 2]> = shown
        .frames
        .windows(2)
        .enumerate()
        .filter(|(index, _)| !walk.rolls.contains(index))
        .map(|(index, pair)| {
            let nodes = pair[0].positions.iter().zip(&pair[1].positions);
            let moved = nodes.map(|(a, b)| (b - a).norm()).fold(0.0, f64::max);
            [(index + 1) as f64, moved]
        })
        .collect();
    if !steps.is_empty() {
        pictures.push(
            chart(
                "Displacement in a step, rolls left out",
                Axis::new("largest of any node").unit(unit),
            )
            .series(Series::line("", steps))
            .level(Level::new("limit", limits.max_move))
            .draw()?,
        );
    }
    Ok(Picture::grid(&pictures, 2))
}

/// The plan over the triangular grid (figure 10): cells that the search expanded, those that it
/// has seen, those walked over, obstacles, and the track of the centre of mass.
///
/// # Errors
/// [`PictureError`] when the walk's lists do not fit together.
pub fn draw_grid_plan(
    walk: &Walk,
    plan: &TwoTierWalk,
    unit: &str,
) -> Result<Picture, PictureError> {
    let shown = Frames::of(walk)?;
    let mut chart = map(walk, unit, "Plan over the grid of support polygons");
    let path: Vec<Cell> = unique(plan.cells.iter().copied());
    let closed = plan.searches.iter().flat_map(|search| &search.closed);
    let closed = unique(closed.copied().filter(|cell| !path.contains(cell)));
    let open = plan.searches.iter().flat_map(|search| &search.open);
    let open = unique(
        open.copied()
            .filter(|cell| !path.contains(cell) && !closed.contains(cell)),
    );
    for (cells, label, color) in [
        (&open, "seen", palette::GREEN),
        (&closed, "expanded", palette::ORANGE),
        (&path, "walked over", palette::BLUE),
    ] {
        for (index, &cell) in cells.iter().enumerate() {
            let label = if index == 0 { label } else { "" };
            let corners = corners(&plan.grid, cell);
            chart = chart.region(Region::new(label, corners).color(color));
        }
    }
    with_goals(with_obstacles(chart, walk), walk, &shown).draw()
}

fn corners(grid: &TriangularGrid, cell: Cell) -> Vec<[f64; 2]> {
    grid.corners(cell).iter().map(|p| [p.x, p.y]).collect()
}

fn unique(cells: impl Iterator<Item = Cell>) -> Vec<Cell> {
    let cells: std::collections::BTreeSet<Cell> = cells.collect();
    cells.into_iter().collect()
}

/// One simulated execution of a walk.
#[derive(Clone, Debug, PartialEq)]
pub struct TrackingRun {
    /// Name of the motion; runs of the same name make one line.
    pub name: String,
    /// Execution time of one roll, in seconds.
    pub seconds_of_roll: f64,
    /// Mean distance of the nodes from the plan.
    pub mean_error: f64,
    /// Error over time: seconds, and mean distance of the nodes from the plan.
    pub errors: Vec<(f64, f64)>,
}

/// Mean error against execution time (figure 16), and beside it the error along the motion of the
/// runs of the first name. Lengths are metres.
///
/// # Errors
/// [`PictureError`] when there are no runs, or an error is not a positive number.
pub fn draw_tracking_error(runs: &[TrackingRun]) -> Result<Picture, PictureError> {
    let [first, ..] = runs else {
        return Err(PictureError::Empty {
            what: "the list of runs".to_owned(),
        });
    };
    let mut names: Vec<&str> = Vec::new();
    for run in runs {
        if !names.contains(&run.name.as_str()) {
            names.push(&run.name);
        }
    }
    let mut mean = Chart::new(
        Axis::new("execution time of a roll").unit("s"),
        Axis::new("mean error of the nodes")
            .unit("cm")
            .logarithmic(),
    )
    .title("Error against execution time")
    .level(Level::new("1 cm", 1.0));
    for (color, name) in names.iter().enumerate() {
        let mut points: Vec<[f64; 2]> = runs
            .iter()
            .filter(|run| run.name == **name)
            .map(|run| [run.seconds_of_roll, 100.0 * run.mean_error])
            .collect();
        points.sort_by(|a, b| a[0].total_cmp(&b[0]));
        mean = mean
            .series(Series::line("", points.clone()).color(color))
            .series(Series::points(*name, points).color(color));
    }
    let mut along = Chart::new(
        Axis::new("share of the motion").unit("%"),
        Axis::new("error of the nodes").unit("cm"),
    )
    .title(format!("{}: error along the motion", first.name));
    for run in runs.iter().filter(|run| run.name == first.name) {
        let Some(&(end, _)) = run.errors.last() else {
            continue;
        };
        let points = run.errors.iter();
        let points = points.map(|(time, error)| [100.0 * time / end, 100.0 * error]);
        let label = format!("{} s a roll", run.seconds_of_roll);
        along = along.series(Series::line(label, points.collect()));
    }
    Ok(Picture::grid(&[mean.draw()?, along.draw()?], 2))
}
