//! `cargo xtask ci`: the gate that every change passes.

use std::time::Instant;

use clap::ValueEnum;

use crate::{
    Error,
    bench::{self, BenchArguments},
    cargo,
    floors::{self, FloorsArguments},
};

/// Runs all that must hold before a change is accepted.
///
/// Every step runs, also after one has failed; the exit status is 0 when all
/// have passed. `.ci/run` and the workflow on GitHub call this command.
#[derive(clap::Args)]
pub struct CiArguments {
    /// Steps to run, in their usual order; all when none is given
    #[arg(value_enum)]
    steps: Vec<Step>,
}

/// The steps, in the order in which they run: cheap ones first.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Step {
    /// The code is formatted
    Format,
    /// Crates depend only on crates of lower floors
    Floors,
    /// Clippy and the compiler have no warnings
    Clippy,
    /// All tests pass
    Test,
    /// The documentation builds without warnings
    Doc,
    /// A short benchmark: every run solves and passes the judge
    Bench,
}

impl Step {
    fn name(self) -> String {
        self.to_possible_value()
            .map_or_else(String::new, |value| value.get_name().to_owned())
    }

    fn run(self) -> Result<(), Error> {
        match self {
            Self::Format => run_cargo(&["fmt", "--all", "--check"], &[]),
            Self::Floors => floors::run(&FloorsArguments {}),
            Self::Clippy => {
                let arguments = [
                    "clippy",
                    "--workspace",
                    "--all-targets",
                    "--",
                    "-D",
                    "warnings",
                ];
                run_cargo(&arguments, &[])
            }
            Self::Test => run_cargo(&["test", "--workspace"], &[]),
            Self::Doc => {
                // Libraries only: the page of the program `tensegra` would take
                // the place of the library's.
                let arguments = ["doc", "--workspace", "--no-deps", "--lib"];
                run_cargo(&arguments, &[("RUSTDOCFLAGS", "-D warnings")])
            }
            Self::Bench => {
                let failures = bench::measure_and_write(&BenchArguments::quick())?;
                match failures.len() {
                    0 => Ok(()),
                    count => Err(format!("{count} runs of the benchmark failed").into()),
                }
            }
        }
    }
}

pub fn run(arguments: &CiArguments) -> Result<(), Error> {
    let steps = Step::value_variants()
        .iter()
        .filter(|step| arguments.steps.is_empty() || arguments.steps.contains(step));
    let mut verdicts = Vec::new();
    let mut failed = Vec::new();
    for step in steps {
        let name = step.name();
        println!("==> {name}");
        let clock = Instant::now();
        let verdict = match step.run() {
            Ok(()) => "ok".to_owned(),
            Err(error) => {
                failed.push(name.clone());
                format!("FAILED: {error}")
            }
        };
        let seconds = clock.elapsed().as_secs_f64();
        verdicts.push(format!("{name:<7} {seconds:>6.1} s  {verdict}"));
    }
    println!("==> summary");
    for verdict in verdicts {
        println!("{verdict}");
    }
    if failed.is_empty() {
        Ok(())
    } else {
        Err(format!("failed: {}", failed.join(", ")).into())
    }
}

/// Runs cargo, whose output goes where this program's goes.
fn run_cargo(arguments: &[&str], environment: &[(&str, &str)]) -> Result<(), Error> {
    let status = cargo()
        .args(arguments)
        .envs(environment.iter().copied())
        .status()?;
    if status.success() {
        Ok(())
    } else {
        Err(format!("cargo {}: {status}", arguments.join(" ")).into())
    }
}
