//! The program `tensegra`: planning the motion of tensegrity structures and
//! truss robots from the command line. Each verb is a module of [`commands`].

#[macro_use]
mod output;
mod commands;
mod failure;
mod progress;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Plan the motion of tensegrity structures and truss robots, and trust the result.
///
/// A problem is a TOML file (structure, obstacles, start, goal), or a .tens
/// structure file with its .param and .links files beside it.
#[derive(Parser)]
#[command(name = "tensegra", version, max_term_width = 100)]
#[command(after_help = "Examples:\n  \
    tensegra plan fixtures/kite.toml                  plan, check, write out/kite/\n  \
    tensegra info fixtures/kite.toml                  what the structure is\n  \
    tensegra smooth out/kite/path.json                shorten it, least effort\n  \
    tensegra walk fixtures/lar/two-tier-s.toml        walk a truss robot, check, write\n  \
    tensegra formfind fixtures/formfinding/prism.toml  find a stable shape\n  \
    tensegra check out/kite/path.json                 judge a path or walk again\n  \
    tensegra trace fixtures/kite.toml --move c1:rest=0.4  move a motor\n  \
    tensegra atlas fixtures/tower3D.toml              all that a structure can reach\n\n\
    Exit status: 0 success, 1 no plan found or path refused, 2 bad input.")]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Info(commands::info::Arguments),
    Plan(commands::plan::Arguments),
    Walk(commands::walk::Arguments),
    Formfind(commands::formfind::Arguments),
    Smooth(commands::smooth::Arguments),
    Check(commands::check::Arguments),
    Trace(commands::trace::Arguments),
    Atlas(commands::atlas::Arguments),
}

fn main() -> ExitCode {
    let outcome = match Arguments::parse().command {
        Command::Info(arguments) => commands::info::run(&arguments),
        Command::Plan(arguments) => commands::plan::run(&arguments),
        Command::Walk(arguments) => commands::walk::run(&arguments),
        Command::Formfind(arguments) => commands::formfind::run(&arguments),
        Command::Smooth(arguments) => commands::smooth::run(&arguments),
        Command::Check(arguments) => commands::check::run(&arguments),
        Command::Trace(arguments) => commands::trace::run(&arguments),
        Command::Atlas(arguments) => commands::atlas::run(&arguments),
    };
    match outcome {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::from(1),
        Err(failure) => {
            failure.report();
            ExitCode::from(2)
        }
    }
}
