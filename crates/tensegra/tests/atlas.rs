//! Atlases of whole components: coverage, files, paths over them.

use std::path::{Path, PathBuf};

use tensegra::{
    AtlasError, EquilibriumAtlas,
    check::{CheckOptions, check_path},
    io::{read_atlas_file, write_atlas_file},
    model::{Endpoint, Interval, Problem},
};

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../fixtures")
        .join(name)
}

fn problem(name: &str) -> Problem {
    Problem::read(&fixture(name)).unwrap()
}

/// The problem with the configuration at the centre of a chart as its goal.
fn with_goal(problem: &Problem, atlas: &EquilibriumAtlas, chart: usize) -> Problem {
    let configuration = atlas.configurations().swap_remove(chart);
    let mut goal = Endpoint::at(configuration.positions, &problem.structure);
    goal.forces = configuration.forces;
    let mut problem = problem.clone();
    problem.goal = Some(goal);
    problem
}

#[test]
fn the_component_of_the_symmetric_tower_is_covered() {
    let mut problem = problem("tower3D.toml");
    problem.settings.max_charts = 1000;
    let atlas = tensegra::explore(&problem, &mut ()).unwrap();
    assert!(atlas.complete);
    assert_eq!(atlas.dimension(), 2);
    let coverage = atlas.measure_coverage(&problem, 600, 3).unwrap();
    assert_eq!(coverage.covered, coverage.points);
    // Centres lie on their own charts; the start with another chirality on none.
    let configurations = atlas.configurations();
    for (i, configuration) in configurations.iter().enumerate().step_by(10) {
        assert_eq!(atlas.covering(configuration), Some(i));
    }
    let mut mirrored = configurations[0].clone();
    mirrored.positions.iter_mut().for_each(|p| p.y = -p.y);
    assert_eq!(atlas.covering(&mirrored), None);
    // It ends where cables go slack and where struts touch.
    let kinds: Vec<&str> = atlas.borders.iter().map(|b| b.kind.as_str()).collect();
    assert!(kinds.contains(&"limit") && kinds.contains(&"contact"));
}

#[test]
fn components_are_covered_whatever_the_radius() {
    // Tips of corridors, and what lies behind a box, come at any place on a rim. At 0.22
    // only a way of two bends leads on.
    for (name, radii) in [
        ("tower3D.toml", &[0.25, 0.4104, 0.4142, 2.0][..]),
        ("prism.toml", &[0.22, 0.35, 0.3876, 0.55, 1.0]),
    ] {
        let mut problem = problem(name);
        for &radius in radii {
            problem.settings.chart_radius = radius;
            let atlas = tensegra::explore(&problem, &mut ()).unwrap();
            assert!(atlas.complete);
            let coverage = atlas.measure_coverage(&problem, 3000, 2).unwrap();
            assert_eq!(coverage.covered, coverage.points, "{name} {radius}");
        }
    }
}

#[test]
fn an_atlas_file_answers_queries_like_the_atlas() {
    let problem = problem("free_prism.toml");
    let atlas = tensegra::explore(&problem, &mut ()).unwrap();
    assert!(atlas.complete);
    assert!(atlas.measure_coverage(&problem, 600, 5).unwrap().covered == 600);
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("atlas.json");
    write_atlas_file(&file, &atlas.to_file(&problem)).unwrap();
    let contents = read_atlas_file(&file).unwrap();
    assert_eq!(contents.charts, atlas.to_file(&problem).charts);
    // As far away as it gets.
    let query = with_goal(&problem, &atlas, atlas.charts.len() - 1);
    let read = EquilibriumAtlas::from_file(&contents, &query).unwrap();
    let [first, again] = [&atlas, &read].map(|atlas| atlas.answer(&query).unwrap());
    assert_eq!(first.path, again.path);
    let report = check_path(&query, &first.path, &CheckOptions::default());
    assert!(report.ok, "{report}");
    // Another structure is refused.
    let kite = self::problem("kite.toml");
    let error = EquilibriumAtlas::from_file(&contents, &kite).err().unwrap();
    assert!(
        matches!(error, AtlasError::OtherStructure { .. }),
        "{error}"
    );
    let mut longer = query.clone();
    longer.structure.elements[0].length = Interval::constant(1.1);
    let error = EquilibriumAtlas::from_file(&contents, &longer).err();
    assert!(matches!(error, Some(AtlasError::OtherManifold { .. })));
}

#[test]
fn the_prism_with_its_box_is_planned_on_its_atlas() {
    let problem = problem("prism.toml");
    let atlas = tensegra::explore(&problem, &mut ()).unwrap();
    assert!(atlas.complete);
    let answer = atlas.answer(&problem).unwrap();
    let report = check_path(&problem, &answer.path, &CheckOptions::default());
    assert!(report.ok, "{report}");
    // The outlines tile the component: its area does not depend on the size of
    // charts, but for the overlap of neighbours where the manifold bends.
    let area = |atlas: &EquilibriumAtlas| {
        let outlines = atlas.outlines(&problem).unwrap();
        atlas.area(&outlines).unwrap()
    };
    let with_radius = |factor: f64| {
        let mut scaled = problem.clone();
        scaled.settings.chart_radius *= factor;
        tensegra::explore(&scaled, &mut ()).unwrap()
    };
    let [coarse, fine] = [0.5, 0.25].map(with_radius);
    assert!(fine.charts.len() > 2 * coarse.charts.len());
    let (coarse, fine) = (area(&coarse), area(&fine));
    assert!((coarse / fine - 1.0).abs() < 0.05, "{coarse} {fine}");
}

#[test]
fn queries_are_answered_whatever_the_radius() {
    let mut problem = problem("prism.toml");
    // Of large charts, some are reached on ways that graze a limit.
    for radius in [0.1, 0.3, 0.737, 1.5, 3.0] {
        problem.settings.chart_radius = radius;
        let atlas = tensegra::explore(&problem, &mut ()).unwrap();
        let answer = atlas.answer(&problem).unwrap();
        let report = check_path(&problem, &answer.path, &CheckOptions::default());
        assert!(report.ok, "{radius}: {report}");
    }
}

#[test]
fn atlas_files_that_contradict_themselves_are_refused() {
    let problem = problem("free_prism.toml");
    let mut limited = problem.clone();
    limited.settings.max_charts = 5;
    let atlas = tensegra::explore(&limited, &mut ()).unwrap();
    assert!(!atlas.complete && atlas.charts.len() == 5);
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("atlas.json");
    write_atlas_file(&file, &atlas.to_file(&problem)).unwrap();
    let good = std::fs::read_to_string(&file).unwrap();
    for (from, to, message) in [
        ("tensegra-atlas", "tensegra-path", "not `tensegra-atlas`"),
        ("\"version\": 1", "\"version\": 2", "version 2"),
        ("\"nodes\": [", "\"nodes\": [\"extra\", ", "positions for"),
        ("\"dimension\": 2", "\"dimension\": 99", "no dimension 99"),
        ("\"cosine\": 0.9", "\"cosine\": -1", "cosine is -1"),
        (
            "\"parent\": 0",
            "\"parent\": 7",
            "parent is a chart before it",
        ),
        ("\"charts\": [", "\"charts\": [1, ", "invalid type"),
    ] {
        assert!(good.contains(from), "{from}");
        std::fs::write(&file, good.replacen(from, to, 1)).unwrap();
        let error = read_atlas_file(&file).unwrap_err().to_string();
        assert!(error.contains(message), "{error}");
    }
    std::fs::write(&file, "").unwrap();
    assert!(
        read_atlas_file(&file)
            .unwrap_err()
            .to_string()
            .contains("empty")
    );
    assert!(read_atlas_file(&folder.path().join("none.json")).is_err());
}
