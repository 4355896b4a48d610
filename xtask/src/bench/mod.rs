//! `cargo xtask bench`: measured figures beside those of others.

mod atlas;
mod document;
mod formfinding;
mod implicit;
mod lar;
mod manifold;
mod scaling;
mod smoothing;

use std::{fs, path::PathBuf};

use clap::ValueEnum;
use tensegra::io::{BenchRow, Picture, bench_table, write_atomic, write_bench_rows};

use crate::{Error, root};

/// Runs a suite of benchmarks and writes its figures.
///
/// Every case is run for seeds 1 to N in each of its variants, one run at a
/// time on one thread, and every path found is judged by `tensegra-check`. A run
/// counts as a success when a path was found and the judge accepts it; figures
/// are over the successes, and every run that fails is named. Times are CPU
/// seconds of planning alone, without reading, judging and writing.
///
/// In the suite `lar` the seeds are random sequences of waypoints, 100 unless
/// said otherwise (at most 20 random robots and 10 multi-starts), --quick takes
/// 2 and leaves out what is slow, and walks end by their number of
/// configurations, so that --time-limit has no effect.
///
/// Into the folder of results go SUITE.json (the rows), SUITE.md (the table,
/// beside the figures that others report) and SUITE.svg (the distribution of
/// planning times). The table is printed as well.
#[derive(clap::Args)]
pub struct BenchArguments {
    /// The suite
    #[arg(long, value_enum, default_value_t = Suite::Manifold)]
    suite: Suite,
    /// Number of seeds for each case and variant [default: 20, with --quick 5; of `lar` 100 and 2]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    seeds: Option<u64>,
    /// Only the first case, in its default variant; of `lar`, a part of each case
    #[arg(long)]
    quick: bool,
    /// Only this case; may be given several times
    #[arg(long = "case", value_name = "NAME")]
    cases: Vec<String>,
    /// CPU seconds after which a run is given up and counts as failed
    #[arg(long, value_name = "S", default_value_t = TIME_LIMIT, value_parser = parse_seconds)]
    time_limit: f64,
    /// Folder of results
    #[arg(long, value_name = "DIR", default_value = OUT)]
    out: PathBuf,
    /// Also renew the suite's section of docs/benchmarks.md and its picture
    #[arg(long, conflicts_with_all = ["quick", "cases"])]
    update_docs: bool,
}

const TIME_LIMIT: f64 = 60.0;
const OUT: &str = "out/bench";

fn parse_seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if seconds.is_finite() && seconds > 0.0 => Ok(seconds),
        _ => Err("give a positive number of seconds".to_owned()),
    }
}

impl BenchArguments {
    /// The short benchmark of continuous integration.
    pub fn quick() -> Self {
        Self {
            suite: Suite::Manifold,
            seeds: None,
            quick: true,
            cases: Vec::new(),
            time_limit: TIME_LIMIT,
            out: OUT.into(),
            update_docs: false,
        }
    }

    fn seed_count(&self) -> u64 {
        self.seeds.unwrap_or(if self.quick { 5 } else { 20 })
    }

    /// Refuses cases that a suite does not have.
    fn refuse_unknown_cases(&self, known: &[&str]) -> Result<(), Error> {
        match self
            .cases
            .iter()
            .find(|name| !known.contains(&name.as_str()))
        {
            None => Ok(()),
            Some(unknown) => Err(format!(
                "the suite has no case {unknown}: choose from {}",
                known.join(", ")
            )
            .into()),
        }
    }

    /// Whether the case with this name and place in its suite is asked for.
    fn selects_case(&self, name: &str, index: usize) -> bool {
        if self.cases.is_empty() {
            !self.quick || index == 0
        } else {
            self.cases.iter().any(|case| case == name)
        }
    }
}

/// A set of cases that belong together: one module each.
#[derive(Clone, Copy, ValueEnum)]
enum Suite {
    /// Paths on equilibrium manifolds of tensegrity structures
    Manifold,
    /// Paths on other implicit manifolds: a sphere, a chain, a parallel robot
    Implicit,
    /// Walks of linear-actuator (truss) robots
    Lar,
    /// Stable forms: from conditions alone, free of collisions
    Formfinding,
    /// Atlases of whole components of equilibrium manifolds
    Atlas,
    /// Control effort of planned and smoothed paths
    Smoothing,
}

impl Suite {
    fn name(self) -> &'static str {
        match self {
            Self::Manifold => "manifold",
            Self::Implicit => "implicit",
            Self::Lar => "lar",
            Self::Formfinding => "formfinding",
            Self::Atlas => "atlas",
            Self::Smoothing => "smoothing",
        }
    }

    fn measure(self, arguments: &BenchArguments) -> Result<Results, Error> {
        match self {
            Self::Manifold => manifold::measure(arguments),
            Self::Implicit => implicit::measure(arguments),
            Self::Lar => lar::measure(arguments),
            Self::Formfinding => formfinding::measure(arguments),
            Self::Atlas => atlas::measure(arguments),
            Self::Smoothing => smoothing::measure(arguments),
        }
    }
}

/// What a suite has measured.
pub struct Results {
    /// What is measured, and whose figures stand beside it; Markdown.
    introduction: &'static str,
    rows: Vec<BenchRow>,
    failures: Vec<RunFailure>,
    /// None when no run succeeded.
    picture: Option<Picture>,
}

/// A run without an accepted path.
pub struct RunFailure {
    case: String,
    variant: String,
    seed: u64,
    reason: String,
}

impl std::fmt::Display for RunFailure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self {
            case,
            variant,
            seed,
            reason,
        } = self;
        let comma = if variant.is_empty() { "" } else { ", " };
        write!(f, "{case}{comma}{variant}, seed {seed}: {reason}")
    }
}

pub fn run(arguments: &BenchArguments) -> Result<(), Error> {
    measure_and_write(arguments).map(drop)
}

/// Measures, writes and prints; returns the runs that failed.
pub fn measure_and_write(arguments: &BenchArguments) -> Result<Vec<RunFailure>, Error> {
    let out = &arguments.out;
    // Now, so that nothing is measured in vain.
    fs::create_dir_all(out).map_err(|error| format!("cannot create {}: {error}", out.display()))?;
    let suite = arguments.suite.name();
    let results = arguments.suite.measure(arguments)?;
    let section = document::section(suite, &results);
    let rows = out.join(format!("{suite}.json"));
    write_bench_rows(&rows, &results.rows)?;
    write_atomic(&out.join(format!("{suite}.md")), section.as_bytes())?;
    if let Some(picture) = &results.picture {
        picture.write_svg(&out.join(format!("{suite}.svg")))?;
    }
    if arguments.update_docs {
        let docs = root().join("docs");
        let page = docs.join("benchmarks.md");
        let old = match fs::read_to_string(&page) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => String::new(),
            Err(error) => return Err(format!("cannot read {}: {error}", page.display()).into()),
        };
        let new = document::with_section(&old, suite, &section);
        write_atomic(&page, new.as_bytes())?;
        if let Some(picture) = &results.picture {
            picture.write_svg(&docs.join(format!("{suite}.svg")))?;
        }
    }
    print!("{}", bench_table(&results.rows));
    for failure in &results.failures {
        println!("FAILED {failure}");
    }
    eprintln!("written to {}", out.display());
    Ok(results.failures)
}
