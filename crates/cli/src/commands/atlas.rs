//! `tensegra atlas`: the whole component of a structure, and paths over it.

use std::path::{Path, PathBuf};

use serde_json::{Map, Value, json};
use tensegra::{
    AtlasError, AtlasPath, AtlasView, Coverage, EquilibriumAtlas, PlanningError, Shade,
    atlas::RouteError,
    check::{Check, CheckOptions, Report, check_path},
    io::{
        LogOptions, PathFile, Quantity, read_atlas_file, write_atlas_file, write_log,
        write_path_file,
    },
    model::Problem,
    parse_quantity, three_quantities,
};

use super::{
    Formulation, formulation_name, json_failure, parse_seconds, print_json, print_written,
    read_problem, require_writable, write_picture,
};
use crate::{failure::Failure, progress::Spinner};

/// Build the atlas of everything that a structure can reach from its start, and
/// find paths on it.
///
/// Higher-dimensional continuation covers the whole component of the equilibrium
/// manifold with charts, up to where cables go slack, ranges end or bodies touch.
/// Made for structures with one to three degrees of freedom (`tensegra info` tells
/// k): the number of charts grows like ρ⁻ᵏ. For more, use `tensegra plan`.
///
/// Writes into the output folder: atlas.json (to be queried again), atlas.svg and
/// .png (the charts in the space of three quantities, coloured by a fourth, with
/// the borders), tree.svg and .png (a random tree on it). When the problem has a
/// goal, or with --query, also path.json and path.mcap: the path from start to goal
/// by graph search over the charts, judged like that of `tensegra plan`.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    tensegra atlas fixtures/tower3D.toml\n  \
    tensegra atlas fixtures/free_prism.toml --radius 0.2 --color energy\n  \
    tensegra atlas fixtures/tower3D.toml --axes length:c1,length:c2,z:n8 --color compression:s1\n  \
    tensegra atlas --query out/prism/atlas/atlas.json fixtures/prism.toml\n\n\
    Quantities are length:ELEMENT, rest:ELEMENT, force:ELEMENT, x:NODE, y:NODE and z:NODE; a\n\
    colour may also be compression:ELEMENT or energy.\n\n\
    Exit status: 0 the atlas is complete without gaps, and a path asked for is found and\n\
    accepted by the judge; 1 not; 2 bad input.")]
pub struct Arguments {
    /// Problem (.toml) or structure (.tens) file: what to explore or, with --query,
    /// from where to where.
    problem: PathBuf,
    /// Answer the problem on this atlas file instead of building an atlas. The
    /// structure must be that of the atlas; start, goal and obstacles may differ.
    #[arg(long, value_name = "ATLAS", conflicts_with_all = [
        "radius", "error", "max_charts", "time_limit", "formulation", "trace",
    ])]
    query: Option<PathBuf>,
    /// Largest radius ρ of a chart [default: the problem's].
    #[arg(long, value_name = "R", value_parser = parse_positive, allow_negative_numbers = true)]
    radius: Option<f64>,
    /// Largest distance ε between a chart and the manifold [default: the problem's].
    #[arg(long, value_name = "E", value_parser = parse_positive, allow_negative_numbers = true)]
    error: Option<f64>,
    /// Charts after which the atlas is left incomplete [default: the problem's].
    #[arg(long, value_name = "N")]
    max_charts: Option<usize>,
    /// CPU seconds after which the atlas is left incomplete [default: the problem's].
    #[arg(long, value_name = "S", value_parser = parse_seconds, allow_negative_numbers = true)]
    time_limit: Option<f64>,
    /// Coordinates of the equilibrium manifold [default: the problem's].
    #[arg(long, value_enum)]
    formulation: Option<Formulation>,
    /// Points of the component that are traced at random, to test that charts cover
    /// them; 0 for none.
    #[arg(long, value_name = "N", default_value_t = 1000)]
    trace: usize,
    /// Three quantities that the pictures show [default: the first that differ].
    #[arg(long, value_name = "Q,Q,Q", value_delimiter = ',')]
    axes: Vec<String>,
    /// What the charts are coloured by [default: compression of the first strut].
    #[arg(long, value_name = "Q")]
    color: Option<String>,
    /// Nodes of the tree that is drawn on the atlas; 0 for none.
    #[arg(long, value_name = "N", default_value_t = 1000)]
    tree: usize,
    /// Seed of tracing and of the tree [default: the problem's].
    #[arg(long)]
    seed: Option<u64>,
    /// Output folder [default: out/NAME/atlas].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

fn parse_positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value > 0.0 => Ok(value),
        _ => Err(format!("`{text}` is no positive number")),
    }
}

/// What was made of a problem.
struct Outcome {
    atlas: EquilibriumAtlas,
    coverage: Option<Coverage>,
    area: Option<f64>,
    /// None where there is no goal; an error where there is no path to it.
    answer: Option<Result<(AtlasPath, Report), RouteError>>,
    files: Vec<PathBuf>,
}

/// Runs the verb.
pub fn run(arguments: &Arguments) -> Result<bool, Failure> {
    let outcome =
        explore(arguments).map_err(|failure| json_failure(arguments.json, "complete", failure))?;
    let answered = match &outcome.answer {
        None => true,
        Some(Ok((_, report))) => report.ok,
        Some(Err(_)) => false,
    };
    if arguments.json {
        print_json(&as_json(&outcome));
    } else {
        print(&outcome);
    }
    let covered = outcome.coverage.is_none_or(|c| c.covered == c.points);
    Ok(answered && covered && (outcome.atlas.complete || arguments.query.is_some()))
}

fn explore(arguments: &Arguments) -> Result<Outcome, Failure> {
    let mut problem = read_problem(&arguments.problem)?;
    let settings = &mut problem.settings;
    settings.chart_radius = arguments.radius.unwrap_or(settings.chart_radius);
    settings.chart_error = arguments.error.unwrap_or(settings.chart_error);
    settings.max_charts = arguments.max_charts.unwrap_or(settings.max_charts);
    settings.time_limit = arguments.time_limit.unwrap_or(settings.time_limit);
    if let Some(formulation) = arguments.formulation {
        settings.formulation = formulation.into();
    }
    problem.seed = arguments.seed.unwrap_or(problem.seed);
    let problem = tensegra::find_endpoints(&problem)
        .map_err(|error| Failure::message(PlanningError::from(error)))?
        .into_owned();
    let shade = match &arguments.color {
        Some(text) => Shade::parse(&problem.structure, text).map_err(Failure::message)?,
        None => Shade::usual(&problem.structure),
    };
    let axes = axes(arguments, &problem)?;
    let out = arguments
        .out
        .clone()
        .unwrap_or_else(|| Path::new("out").join(&problem.name).join("atlas"));
    require_writable(&out)?;

    let atlas = match &arguments.query {
        Some(file) => {
            let contents = read_atlas_file(file).map_err(Failure::message)?;
            EquilibriumAtlas::from_file(&contents, &problem).map_err(Failure::message)?
        }
        None => {
            let mut spinner = Spinner::new(&format!("exploring {}", problem.name));
            tensegra::explore(&problem, &mut spinner).map_err(Failure::message)?
        }
    };
    let coverage = match arguments.trace {
        points if points > 0 && arguments.query.is_none() => Some(
            atlas
                .measure_coverage(&problem, points, problem.seed)
                .map_err(Failure::message)?,
        ),
        _ => None,
    };
    let answer = if problem.goal.is_some() || arguments.query.is_some() {
        match atlas.answer(&problem) {
            Ok(answer) => {
                let report = check_path(&problem, &answer.path, &CheckOptions::default());
                Some(Ok((answer, report)))
            }
            Err(AtlasError::Route(error)) => Some(Err(error)),
            Err(error) => return Err(Failure::message(error)),
        }
    } else {
        None
    };
    let mut outcome = Outcome {
        atlas,
        coverage,
        area: None,
        answer,
        files: Vec::new(),
    };
    write(arguments, &problem, &out, axes, shade, &mut outcome)?;
    Ok(outcome)
}

/// The three quantities asked for; none where they are left open.
fn axes(arguments: &Arguments, problem: &Problem) -> Result<Option<[Quantity; 3]>, Failure> {
    if arguments.axes.is_empty() {
        return Ok(None);
    }
    let axes = arguments
        .axes
        .iter()
        .map(|text| parse_quantity(&problem.structure, text).map_err(Failure::message))
        .collect::<Result<Vec<_>, _>>()?;
    let count = axes.len();
    let axes = axes.try_into().map_err(|_| {
        Failure::Message(format!(
            "--axes names {count} quantities; give three, such as length:c1,length:c2,z:n1"
        ))
    })?;
    Ok(Some(axes))
}

fn write(
    arguments: &Arguments,
    problem: &Problem,
    out: &Path,
    axes: Option<[Quantity; 3]>,
    shade: Shade,
    outcome: &mut Outcome,
) -> Result<(), Failure> {
    let Outcome { atlas, files, .. } = outcome;
    if arguments.query.is_none() {
        let file = out.join("atlas.json");
        write_atlas_file(&file, &atlas.to_file(problem)).map_err(Failure::message)?;
        files.push(file);
    }
    let path = match &outcome.answer {
        Some(Ok((answer, report))) => {
            let (file, log) = (out.join("path.json"), out.join("path.mcap"));
            let mut contents = PathFile::new(problem, answer.path.clone());
            contents.statistics = json!({
                "planning_seconds": answer.seconds,
                "charts": atlas.charts.len(),
                "charts_passed": answer.charts,
                "ways_tested": answer.tested,
            });
            contents.check = json!(report);
            write_path_file(&file, &contents).map_err(Failure::message)?;
            write_log(&log, problem, &answer.path, &LogOptions::default())
                .map_err(Failure::message)?;
            files.extend([file, log]);
            Some(&answer.path)
        }
        _ => None,
    };
    let outlines = atlas.outlines(problem).map_err(Failure::message)?;
    outcome.area = atlas.area(&outlines);
    let Some(quantities) =
        axes.or_else(|| three_quantities(&problem.structure, &atlas.configurations()))
    else {
        // Nothing varies in three ways: there is no picture.
        return Ok(());
    };
    let title = format!("{}: {} charts", problem.name, atlas.charts.len());
    let view = AtlasView::new(quantities, shade, title);
    let drawn = atlas
        .draw(problem, &outlines, &view, path)
        .map_err(Failure::message)?;
    write_picture(out, "atlas", &drawn, files)?;
    if arguments.tree > 0 {
        let tree = atlas
            .grow_tree(problem, arguments.tree, problem.seed)
            .map_err(Failure::message)?;
        let drawn = atlas
            .draw_tree(problem, &outlines, &view, &tree)
            .map_err(Failure::message)?;
        write_picture(out, "tree", &drawn, files)?;
    }
    Ok(())
}

fn as_json(outcome: &Outcome) -> Value {
    let Outcome {
        atlas,
        coverage,
        area,
        answer,
        files,
    } = outcome;
    let mut by_kind: Map<String, Value> = Map::new();
    for border in &atlas.borders {
        let count = by_kind.get(&border.kind).and_then(Value::as_u64);
        let sum = count.unwrap_or(0) + border.count as u64;
        by_kind.insert(border.kind.clone(), json!(sum));
    }
    let answer = answer.as_ref().map(|answer| match answer {
        Ok((path, report)) => json!({
            "solved": true,
            "seconds": path.seconds,
            "configurations": path.path.configurations.len(),
            "charts": path.charts,
            "ways_tested": path.tested,
            "check": report,
        }),
        Err(error) => json!({ "solved": false, "error": error.to_string() }),
    });
    json!({
        "complete": atlas.complete,
        "charts": atlas.charts.len(),
        "border_charts": atlas.border_charts(),
        "dimension": atlas.dimension(),
        "formulation": formulation_name(atlas.formulation),
        "seconds": atlas.seconds,
        "validity_tests": atlas.validity_tests,
        "borders": by_kind,
        "borders_by_name": atlas.borders,
        "traced": coverage.as_ref().map(|c| c.points),
        "covered": coverage.as_ref().map(|c| c.covered),
        "area": area,
        "path": answer,
        "files": files,
    })
}

fn print(outcome: &Outcome) {
    let Outcome {
        atlas,
        coverage,
        area,
        answer,
        files,
    } = outcome;
    say!(
        "atlas              {} charts, {} of them at a border, dimension {}, formulation {}",
        atlas.charts.len(),
        atlas.border_charts(),
        atlas.dimension(),
        formulation_name(atlas.formulation)
    );
    say!(
        "component          {}",
        if atlas.complete {
            "explored whole"
        } else {
            "NOT explored whole: a limit was met (--max-charts, --time-limit)"
        }
    );
    if atlas.seconds > 0.0 {
        say!(
            "time               {:.4} s, {} ways tested",
            atlas.seconds,
            atlas.validity_tests
        );
    }
    if let Some(coverage) = coverage {
        say!(
            "coverage           {} of {} points traced at random lie on a chart{}",
            coverage.covered,
            coverage.points,
            if coverage.covered < coverage.points {
                ": there are gaps, build it with another --radius or --error"
            } else {
                ""
            }
        );
    }
    if let Some(area) = area {
        let what = if atlas.dimension() == 1 {
            "length"
        } else {
            "area"
        };
        say!("{what:<18} {area:.4} in the coordinates of the formulation");
    }
    for (i, border) in atlas.borders.iter().enumerate() {
        say!(
            "{:<18} {}: {} ({} directions)",
            if i == 0 { "ends at" } else { "" },
            border.kind,
            border.name,
            border.count
        );
    }
    match answer {
        None => {}
        Some(Ok((path, report))) => {
            say!(
                "path               {} configurations over {} charts, {} ways tested, {:.4} s",
                path.path.configurations.len(),
                path.charts.len(),
                path.tested,
                path.seconds
            );
            if let Some(least) = report.figure(Check::Stability) {
                say!(
                    "least stiffness    {:.4e} at {}",
                    least.value,
                    least.location
                );
            }
            if report.ok {
                say!("check              accepted by the independent judge");
            } else {
                say!("check              REFUSED by the independent judge");
                for failure in &report.failures {
                    say!("                   {}", failure.message);
                }
            }
        }
        Some(Err(error)) => say!("path               none: {error}"),
    }
    print_written(files);
}
