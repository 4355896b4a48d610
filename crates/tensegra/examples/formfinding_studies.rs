//! The three studies of S. Hernández Juan and J. M. Mirats Tur, "A method to generate stable, collision
//! free configurations for tensegrity based robots", IROS 2008: a plane approaches while the centroid of
//! the upper triangle stays; a target close to two planes; the centroid on a straight line, with and
//! without avoidance of self-collision, and the distances of the bars on the way (their figure 8).
//!
//! ```text
//! cargo run --release -p tensegra --example formfinding_studies [FOLDER]
//! ```
//!
//! Writes pictures (SVG and PNG) into the folder, `out/formfinding` unless given.

use std::{error::Error, path::Path};

use tensegra::{
    FormOptions,
    check::{CheckOptions, check_configuration},
    collision::closest_points_segment_segment,
    formfind,
    formfinding::{FollowOptions, Followed, FormProblem, follow},
    io::{
        Axis, Chart, Level, Picture, Scene, SceneOptions, Series, Units, View, draw_scenes,
        draw_snapshots,
    },
    model::{Configuration, Environment, FormCondition, Problem, Shape},
};

/// Upper nodes of the prism.
const UPPER: [&str; 3] = ["b1", "b2", "b3"];
/// Pairs of bars.
const PAIRS: [[&str; 2]; 3] = [["s1", "s2"], ["s2", "s3"], ["s3", "s1"]];
/// Steps of a motion, and the largest displacement of a node in one.
const STEPS: usize = 50;
const STEP: f64 = 0.06;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args()
        .nth(1)
        .unwrap_or_else(|| "out/formfinding".to_owned());
    let folder = Path::new(&folder);
    std::fs::create_dir_all(folder)?;
    approaching_plane(folder)?;
    two_planes(folder)?;
    straight_line(folder)
}

fn read(name: &str) -> Result<Problem, Box<dyn Error>> {
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/formfinding");
    Ok(Problem::read(&fixtures.join(name))?)
}

/// The best of many forms, accepted by the judge.
fn best(problem: &Problem) -> Result<Configuration, Box<dyn Error>> {
    let found = formfind(problem, FormOptions::default())?;
    println!(
        "{}: {} of {} starts converged, {} accepted, {} shapes",
        problem.name,
        found.forms.forms.len(),
        found.forms.starts,
        found.accepted(),
        found.forms.shape_count()
    );
    Ok(found.forms.best().configuration.clone())
}

/// The wall comes closer to the centroid, which stays.
fn approaching_plane(folder: &Path) -> Result<(), Box<dyn Error>> {
    const FAR: f64 = 0.3;
    const NEAR: f64 = 0.03;
    let problem = read("plane.toml")?;
    let start = best(&problem)?;
    let at = |t: f64| {
        let mut moved = problem.clone();
        let distance = FAR + (NEAR - FAR) * t;
        if let Shape::HalfSpace { point, normal } = &mut moved.environment.obstacles[0].shape {
            // From where it is in the fixture, along its normal.
            *point += *normal * (FAR - distance);
        }
        moved
    };
    let followed = follow(
        &start,
        |t| FormProblem::new(&at(t), &[]),
        FollowOptions::new(STEPS, STEP),
    )?;
    report("plane", &followed, at)?;
    let mut panels = Vec::new();
    for share in [0.0, 0.8, 1.0] {
        let index = ((followed.forms.len() - 1) as f64 * share).round() as usize;
        let (t, form) = &followed.forms[index];
        let moved = at(*t);
        let title = format!("wall {:.2} m from the centroid", FAR + (NEAR - FAR) * t);
        let scene = Scene::of(&moved.structure, &moved.environment, &form.configuration)?;
        panels.push((title, scene));
    }
    // From the side, along the wall.
    let view = View::Axonometric {
        azimuth: -90.0,
        elevation: 0.0,
    };
    let options = SceneOptions::default().view(view).columns(3).names();
    let picture = draw_scenes(&panels, &options.unit("m"))?;
    write(&picture, folder, "approaching-plane")
}

/// The target close to two planes.
fn two_planes(folder: &Path) -> Result<(), Box<dyn Error>> {
    let problem = read("two-planes.toml")?;
    let configuration = best(&problem)?;
    let scene = Scene::of(&problem.structure, &problem.environment, &configuration)?;
    // Along the line in which the planes meet.
    let view = View::Axonometric {
        azimuth: 180.0,
        elevation: (30_f64.to_radians().cos() * 0.5_f64.sqrt())
            .atan2(30_f64.to_radians().sin())
            .to_degrees(),
    };
    let panels = [("a target 4 cm from two planes".to_owned(), scene)];
    let options = SceneOptions::default().view(view).names().unit("m");
    let picture = draw_scenes(&panels, &options)?;
    write(&picture, folder, "two-planes")
}

/// The centroid moves from (0, 0, 0.5) to (0, 0.5, 0.5).
fn straight_line(folder: &Path) -> Result<(), Box<dyn Error>> {
    let mut avoiding = read("prism.toml")?;
    avoiding.form.cost = tensegra::model::FormCost::Energy;
    let mut heedless = avoiding.clone();
    heedless.environment = Environment::default();
    let start = best(&avoiding)?;
    let mut chart = Chart::new(
        Axis::new("y of the centroid").unit("m"),
        Axis::new("distance of the bars' axes").unit("m"),
    )
    .title("with (solid) and without (dashed) avoidance of self-collision")
    .level(Level::new("sum of the radii", 0.035));
    for (dash, (name, problem)) in [("avoiding", &avoiding), ("heedless", &heedless)]
        .into_iter()
        .enumerate()
    {
        let nodes = upper(problem);
        let at = |t: f64| {
            let mut moved = problem.clone();
            moved.form.conditions = vec![FormCondition::centroid(&nodes, [0.0, 0.5 * t, 0.5])];
            moved
        };
        let followed = follow(
            &start,
            |t| FormProblem::new(&at(t), &[]),
            FollowOptions::new(STEPS, STEP),
        )?;
        report(name, &followed, at)?;
        for (color, pair) in PAIRS.iter().enumerate() {
            let points = followed
                .forms
                .iter()
                .map(|(t, form)| [0.5 * t, distance(problem, &form.configuration, pair)])
                .collect();
            let label = format!("{} and {}, {name}", pair[0], pair[1]);
            chart = chart.series(Series::line(label, points).color(color).dash(dash));
        }
        let path = tensegra::model::Path {
            configurations: followed
                .forms
                .iter()
                .map(|(_, form)| form.configuration.clone())
                .collect(),
        };
        let units = Units::new("m", "N");
        let picture = draw_snapshots(&problem.structure, &problem.environment, &path, 2, &units)?;
        write(&picture, folder, &format!("line-{name}"))?;
    }
    write(&chart.draw()?, folder, "distances")
}

fn upper(problem: &Problem) -> Vec<usize> {
    UPPER
        .iter()
        .filter_map(|name| problem.structure.node_index(name))
        .collect()
}

/// Distance of the axes of two bars.
fn distance(problem: &Problem, configuration: &Configuration, pair: &[&str; 2]) -> f64 {
    let axis = |name: &str| {
        let element = problem.structure.element_index(name).unwrap_or(0);
        problem.structure.elements[element]
            .nodes
            .map(|node| configuration.positions[node])
    };
    let ([a0, a1], [b0, b1]) = (axis(pair[0]), axis(pair[1]));
    let closest = closest_points_segment_segment(&a0, &a1, &b0, &b1);
    closest.distance()
}

/// Prints how a motion went, and has each of its forms judged.
fn report(
    name: &str,
    followed: &Followed,
    at: impl Fn(f64) -> Problem,
) -> Result<(), Box<dyn Error>> {
    let mut refused = 0;
    let (mut residual, mut stiffness) = (0.0_f64, f64::INFINITY);
    for (t, form) in &followed.forms {
        let judged = check_configuration(&at(*t), &form.configuration, &CheckOptions::default());
        refused += usize::from(!judged.ok);
        residual = residual.max(form.residual);
        stiffness = stiffness.min(form.least_stiffness.unwrap_or(f64::INFINITY));
    }
    println!(
        "{name}: {} forms to parameter {:.3}, {refused} refused, residual at most {residual:.1e}, \
         least stiffness {stiffness:.3} N/m",
        followed.forms.len(),
        followed.forms.last().map_or(0.0, |(t, _)| *t)
    );
    if let Some(stop) = &followed.stopped {
        println!("{name}: stopped: {stop}");
    }
    Ok(())
}

fn write(picture: &Picture, folder: &Path, name: &str) -> Result<(), Box<dyn Error>> {
    picture.write_svg(&folder.join(format!("{name}.svg")))?;
    picture.write_png(&folder.join(format!("{name}.png")), 2.0)?;
    Ok(())
}
