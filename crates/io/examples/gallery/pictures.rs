//! Every kind of picture, from invented data.

use std::f64::consts::TAU;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use tensegra_io::{
    Axis, Chart, Curve, Level, Patch, Picture, Quantity, Region, Scale, Series, SpacePlot, Units,
    draw_configuration, draw_forces, draw_lengths, draw_paths, draw_rest_lengths, draw_snapshots,
    fit_power_law,
};

use crate::data;

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

/// The pictures and their names.
pub fn pictures() -> Outcome<Vec<(&'static str, Picture)>> {
    let units = Units::new("m", "N");
    let mut pictures = Vec::new();

    for (names, (problem, path)) in [
        (
            [
                "kite-snapshots",
                "kite-start",
                "kite-forces",
                "kite-lengths",
            ],
            data::kite(),
        ),
        (
            [
                "prism-snapshots",
                "prism-start",
                "prism-forces",
                "prism-lengths",
            ],
            data::prism(),
        ),
    ] {
        let (structure, environment) = (&problem.structure, &problem.environment);
        let start = &path.configurations[0];
        pictures.extend([
            (
                names[0],
                draw_snapshots(structure, environment, &path, 4, &units)?,
            ),
            (
                names[1],
                draw_configuration(structure, environment, start, "start", &units)?,
            ),
            (names[2], draw_forces(structure, &path, &units)?),
            (names[3], draw_lengths(structure, &path, &units)?),
        ]);
    }
    let (kite, planned) = data::kite();
    pictures.push((
        "kite-rest-lengths",
        draw_rest_lengths(&kite.structure, &planned, &Units::default())?,
    ));

    let mut smoothed = planned.clone();
    for (index, configuration) in smoothed.configurations.iter_mut().enumerate() {
        let s = index as f64 / (planned.configurations.len() - 1) as f64;
        for length in &mut configuration.lengths {
            *length += 0.12 * (TAU / 2.0 * s).sin() + 0.02 * (40.0 * s).sin() * s * (1.0 - s);
        }
    }
    let lengths = [3, 5, 7].map(Quantity::Length);
    let paths = [("planned", &planned), ("smoothed", &smoothed)];
    pictures.push((
        "paths",
        draw_paths(&kite.structure, &paths, lengths, &units)?,
    ));

    let mut random = Pcg64::seed_from_u64(1);
    pictures.push(("atlas", atlas(&mut random)?));
    pictures.push(("times", times(&mut random)?));
    pictures.push(("histogram", histogram(&mut random)?));
    pictures.push(("growth", growth(&mut random)?));
    pictures.push(("track", track()?));
    pictures.push(("margins", margins()?));
    let pair = [histogram(&mut random)?, times(&mut random)?];
    pictures.push(("pair", Picture::grid(&pair, 2)));
    Ok(pictures)
}

/// A torus in polygons, with a tree and a path on it.
fn atlas(random: &mut Pcg64) -> Outcome<Picture> {
    let on = |u: f64, v: f64| {
        let reach = 1.0 + 0.45 * v.cos();
        [reach * u.cos(), reach * u.sin(), 0.45 * v.sin()]
    };
    let [around, across] = [40, 20];
    let mut patches = Vec::new();
    for i in 0..around {
        for j in 0..across {
            let [u, v] = [TAU * f64::from(i) / 40.0, TAU * f64::from(j) / 20.0];
            let [du, dv] = [TAU / 40.0, TAU / 20.0];
            patches.push(Patch {
                corners: vec![on(u, v), on(u + du, v), on(u + du, v + dv), on(u, v + dv)],
                value: -3.0 + (u + 0.5).sin() * (v + 1.0).cos(),
            });
        }
    }
    let mut places = vec![[-1.9, 0.7]];
    let mut tree = Vec::new();
    for _ in 0..900 {
        let target = [
            random.random_range(-2.6..0.4),
            random.random_range(-0.3..2.2),
        ];
        let distance = |p: &[f64; 2]| (p[0] - target[0]).hypot(p[1] - target[1]);
        let near = places
            .iter()
            .copied()
            .min_by(|a, b| distance(a).total_cmp(&distance(b)));
        let near = near.unwrap_or_default();
        let share = (0.06 / distance(&near)).min(1.0);
        let next = [0, 1].map(|i| near[i] + share * (target[i] - near[i]));
        tree.push([on(near[0], near[1]), on(next[0], next[1])]);
        places.push(next);
    }
    let path = (0..80).map(|i| {
        let s = f64::from(i) / 79.0;
        on(-1.9 + 1.6 * s, 0.7 + 0.5 * (4.0 * s).sin())
    });
    let axes = ["length of c1", "length of c2", "length of c3"].map(|l| Axis::new(l).unit("m"));
    let plot = SpacePlot::new(axes)
        .polygons(Axis::new("strut compression").unit("N"), patches)
        .curve(Curve::segments("tree", tree))
        .curve(Curve::path("path", path.collect()).color(1))
        .equal_scale()
        .size(560.0, 420.0);
    Ok(plot.draw()?)
}

fn sample(random: &mut Pcg64, median: f64, spread: f64, count: usize) -> Vec<f64> {
    let mut normal = || (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0;
    (0..count)
        .map(|_| median * (spread * normal()).exp())
        .collect()
}

fn times(random: &mut Pcg64) -> Outcome<Picture> {
    let time = Axis::new("planning time").unit("s").logarithmic();
    let share = Axis::new("share of the runs").range(0.0, 1.0);
    let mut chart = Chart::new(time, share).title("kite, 100 seeds");
    for (label, median) in [
        ("nodes", 0.0017),
        ("directions", 0.0046),
        ("one tree", 0.09),
    ] {
        let values = sample(random, median, 0.5, 100);
        chart = chart.series(Series::distribution(label, &values));
    }
    Ok(chart.draw()?)
}

fn histogram(random: &mut Pcg64) -> Outcome<Picture> {
    let values = sample(random, 0.0017, 0.35, 400);
    let chart = Chart::new(Axis::new("planning time").unit("s"), Axis::new("runs"))
        .series(Series::histogram("default", &values, 24, Scale::Linear));
    Ok(chart.draw()?)
}

fn growth(random: &mut Pcg64) -> Outcome<Picture> {
    let elements = Axis::new("elements").logarithmic();
    let time = Axis::new("time for a chart").unit("s").logarithmic();
    let mut chart = Chart::new(elements, time).note(
        "Each point is the median of 20 seeds; lines are power laws by least squares of the logarithms.",
    );
    for (color, (label, exponent)) in [("nodes", 1.6), ("directions", 2.4)]
        .into_iter()
        .enumerate()
    {
        let points: Vec<[f64; 2]> = (2..13)
            .map(|stages| {
                let elements = 6.0 + 9.0 * f64::from(stages);
                let noise = 1.0 + 0.2 * random.random::<f64>();
                [elements, 2e-7 * elements.powf(exponent) * noise]
            })
            .collect();
        let law = fit_power_law(&points).ok_or("no power law fits")?;
        let line = [20.0, 130.0].map(|x| [x, law.at(x)]).to_vec();
        let label = format!("{label}, exponent {:.2}", law.exponent);
        chart = chart
            .series(Series::points(label, points).color(color))
            .series(Series::line("", line).color(color).thin());
    }
    Ok(chart.draw()?)
}

/// The track of a centre of mass over its polygons of support.
fn track() -> Outcome<Picture> {
    let side = 0.8;
    let mut chart = Chart::new(Axis::new("x").unit("m"), Axis::new("y").unit("m")).equal_scale();
    for step in 0..7 {
        let left = 0.5 * side * f64::from(step);
        let height = 0.5 * 3.0_f64.sqrt() * side;
        let (low, high) = if step % 2 == 0 {
            (0.0, height)
        } else {
            (height, 0.0)
        };
        let corners = vec![[left, low], [left + side, low], [left + 0.5 * side, high]];
        let label = if step == 0 { "support" } else { "" };
        chart = chart.region(Region::new(label, corners));
    }
    let way = (0..200).map(|i| {
        let x = 0.4 + 2.4 * f64::from(i) / 199.0;
        [x, 0.34 + 0.08 * (x * TAU / side).sin()]
    });
    let steps = (0..7).map(|step| [0.4 + 0.4 * f64::from(step), 0.34]);
    let chart = chart
        .series(Series::line("centre of mass", way.collect()))
        .series(Series::points("rolls", steps.collect()));
    Ok(chart.draw()?)
}

fn margins() -> Outcome<Picture> {
    let mut chart = Chart::new(Axis::new("configuration"), Axis::new("margin").unit("m"))
        .level(Level::new("violated below", 0.0));
    for (index, name) in ["length", "distance", "angle", "ground"]
        .into_iter()
        .enumerate()
    {
        let margin = |i: u32| {
            let phase = f64::from(i) / 40.0 * TAU + index as f64;
            [
                f64::from(i),
                0.05 * (index as f64 + 1.0) * (1.0 + phase.sin()),
            ]
        };
        chart = chart.series(Series::line(name, (0..=160).map(margin).collect()));
    }
    Ok(chart.draw()?)
}
