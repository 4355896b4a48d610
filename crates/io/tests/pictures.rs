//! What can be told of pictures without looking: no text lies on another or
//! leaves the page, the same input gives the same picture, bad input is named.

#[allow(dead_code)] // each test uses a part of it
#[path = "../examples/gallery/data.rs"]
mod data;
#[path = "../examples/gallery/pictures.rs"]
mod pictures;

use std::sync::Arc;

use resvg::usvg::{Group, Node, Options, Tree, fontdb::Database};
use tensegra_io::{
    Axis, Chart, PictureError, Quantity, Series, Units, draw_forces, draw_lengths, draw_paths,
    draw_snapshots,
};

fn parse(svg: &str) -> Tree {
    let mut fonts = Database::new();
    fonts.load_font_data(ttf_noto_sans::REGULAR.to_vec());
    let options = Options {
        fontdb: Arc::new(fonts),
        font_family: "Noto Sans".to_owned(),
        ..Options::default()
    };
    Tree::from_str(svg, &options).unwrap()
}

/// A text and the corners of its box, which is turned with it.
struct Found {
    text: String,
    corners: [[f32; 2]; 4],
}

/// The texts of a drawing.
fn texts(group: &Group, found: &mut Vec<Found>) {
    for node in group.children() {
        match node {
            Node::Group(group) => texts(group, found),
            Node::Text(text) => {
                let area = text.bounding_box();
                // Boxes are as high as the font, letters are lower.
                let (slack_x, slack_y) = (0.5, 2.5);
                let (left, right) = (area.left() + slack_x, area.right() - slack_x);
                let (top, bottom) = (area.top() + slack_y, area.bottom() - slack_y);
                let corners = [[left, top], [right, top], [right, bottom], [left, bottom]];
                let turn = text.abs_transform();
                found.push(Found {
                    text: text.chunks().iter().map(|chunk| chunk.text()).collect(),
                    corners: corners.map(|[x, y]| {
                        [
                            turn.sx * x + turn.kx * y + turn.tx,
                            turn.ky * x + turn.sy * y + turn.ty,
                        ]
                    }),
                });
            }
            _ => {}
        }
    }
}

/// Whether no side of either of two convex quadrilaterals separates them.
fn meet(a: &[[f32; 2]; 4], b: &[[f32; 2]; 4]) -> bool {
    let separates = |corners: &[[f32; 2]; 4]| {
        (0..4).any(|i| {
            let ([x, y], [u, v]) = (corners[i], corners[(i + 1) % 4]);
            let along = |[s, t]: [f32; 2]| s * (y - v) + t * (u - x);
            let range = |points: &[[f32; 2]; 4]| {
                points
                    .map(along)
                    .iter()
                    .fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), &value| {
                        (low.min(value), high.max(value))
                    })
            };
            let ((a_low, a_high), (b_low, b_high)) = (range(a), range(b));
            a_high < b_low || b_high < a_low
        })
    };
    !separates(a) && !separates(b)
}

#[test]
fn texts_stay_on_the_page_and_off_each_other() {
    for (name, picture) in pictures::pictures().unwrap() {
        let tree = parse(&picture.to_svg());
        let [width, height] = picture.size().map(|side| side as f32);
        let mut found = Vec::new();
        texts(tree.root(), &mut found);
        assert!(found.len() > 3, "{name}");
        for (index, Found { text, corners }) in found.iter().enumerate() {
            let inside = corners
                .iter()
                .all(|&[x, y]| (0.0..=width).contains(&x) && (0.0..=height).contains(&y));
            assert!(inside, "{name}: `{text}` leaves the page: {corners:?}");
            for other in &found[..index] {
                assert!(
                    !meet(corners, &other.corners),
                    "{name}: `{text}` lies on `{}`: {corners:?} {:?}",
                    other.text,
                    other.corners
                );
            }
        }
    }
}

#[test]
fn pictures_follow_from_their_input_alone() {
    let svgs = || -> Vec<String> {
        let pictures = pictures::pictures().unwrap();
        pictures
            .iter()
            .map(|(_, picture)| picture.to_svg())
            .collect()
    };
    assert_eq!(svgs(), svgs());
}

#[test]
fn pictures_become_files() {
    let (problem, path) = data::kite();
    let picture = draw_forces(&problem.structure, &path, &Units::new("m", "N")).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let [svg, png] = ["forces.svg", "forces.png"].map(|name| folder.path().join(name));
    picture.write_svg(&svg).unwrap();
    picture.write_png(&png, 2.0).unwrap();
    let text = std::fs::read_to_string(svg).unwrap();
    assert!(text.contains("force, tension above zero (N)") && text.contains("cables ≤ 3"));
    let bytes = std::fs::read(png).unwrap();
    // Width and height stand in the header.
    let side = |at: usize| u32::from_be_bytes(bytes[at..at + 4].try_into().unwrap());
    let size = picture.size().map(|side| 2 * side as u32);
    assert_eq!([side(16), side(20)], size);
    assert!(picture.to_png(1e9).is_err());
}

#[test]
fn constants_are_told_and_not_drawn() {
    let (problem, path) = data::prism();
    let svg = draw_lengths(&problem.structure, &path, &Units::default())
        .unwrap()
        .to_svg();
    assert!(svg.contains("Constant along the path: base1 = 1.04"));
    let names = |name: &str| svg.matches(&format!(">{name}<")).count();
    assert_eq!([names("side1"), names("base1"), names("strut1")], [1, 0, 0]);
}

#[test]
fn names_are_written_as_they_are() {
    let (mut problem, path) = data::kite();
    problem.structure.elements[3].name = "<a&b>".to_owned();
    let svg = draw_forces(&problem.structure, &path, &Units::default())
        .unwrap()
        .to_svg();
    assert!(svg.contains("&lt;a&amp;b&gt;"));
    parse(&svg);
}

#[test]
fn bad_input_is_refused() {
    let (problem, mut path) = data::kite();
    let structure = &problem.structure;
    let units = Units::default();
    let quantities = [
        Quantity::Length(3),
        Quantity::RestLength(0),
        Quantity::Force(3),
    ];
    let valueless = draw_paths(structure, &[("planned", &path)], quantities, &units);
    assert!(matches!(&valueless, Err(PictureError::NoValue(what)) if what.contains("s1")));
    let beyond = Quantity::Coordinate { node: 99, axis: 7 };
    let beyond = draw_paths(structure, &[("planned", &path)], [beyond; 3], &units);
    assert!(matches!(beyond, Err(PictureError::NoValue(_))));

    path.configurations[4].positions[0].x = f64::NAN;
    let results = [
        draw_forces(structure, &path, &units).map(drop),
        draw_snapshots(structure, &problem.environment, &path, 2, &units).map(drop),
    ];
    for result in results {
        let failure = result.unwrap_err().to_string();
        assert!(
            failure.contains("configuration 4: the position of node `n1`"),
            "{failure}"
        );
    }
    path.configurations.clear();
    let empty = draw_lengths(structure, &path, &units);
    assert!(matches!(empty, Err(PictureError::Path(_))));

    let chart = Chart::new(Axis::new("n").logarithmic(), Axis::new("t"));
    let zero = chart.series(Series::points("a", vec![[0.0, 1.0]])).draw();
    assert!(matches!(zero, Err(PictureError::NotPositive { .. })));
}

#[test]
fn pictures_of_extreme_sizes_are_drawn() {
    for size in [1e-12, 1e-3, 1e9, 1e40] {
        let (mut problem, mut path) = data::prism();
        for configuration in &mut path.configurations {
            configuration
                .positions
                .iter_mut()
                .for_each(|position| *position *= size);
            configuration
                .lengths
                .iter_mut()
                .for_each(|length| *length *= size);
        }
        problem.environment.obstacles.clear();
        problem.structure.attachments.clear();
        let units = Units::default();
        let structure = &problem.structure;
        let environment = &problem.environment;
        let pictures = [
            draw_lengths(structure, &path, &units).unwrap(),
            draw_snapshots(structure, environment, &path, 1, &units).unwrap(),
        ];
        for picture in pictures {
            let svg = picture.to_svg();
            assert!(!svg.contains("NaN") && !svg.contains("inf"), "{size}");
            parse(&svg);
        }
    }
}
