//! The independent judge of a planned path.
//!
//! [`check_path`] judges a [`Path`] against a [`Problem`] from physical quantities alone: node
//! positions, lengths, rest lengths and forces. It shares no stepping, projection or simplification
//! code with the planners: what it solves, it solves with its own equations in node coordinates.
//! It judges
//!
//! * every configuration: lengths, Hooke's law, force balance at every node, ranges, pretension,
//!   gauge, couplings, attachments;
//! * the path: its ends, the displacement of nodes in a step;
//! * clearance, at the samples and for the whole motion between them.
//!
//! # The motion between samples
//! Two neighbouring samples define it: node coordinates and forces interpolated linearly, with
//! equilibrium restored by steps of least norm. Clearance on it is proven by a bound on how far
//! points move and by separating planes; both rest on the assumption, checked at every halving,
//! that the motion strays from the straight one by no more than a stated multiple
//! ([`CheckOptions::slack_factor`]) of what is measured half-way.
//!
//! # Invariants
//! Nothing here panics on bad data: whatever cannot be judged is a [`Failure`] that says what and
//! where. The verdict is the same on every run.
//!
//! ```no_run
//! # fn demo(problem: &tensegra_model::Problem, path: &tensegra_model::Path) {
//! use tensegra_check::{Check, CheckOptions, check_path};
//!
//! let report = check_path(problem, path, &CheckOptions::default());
//! println!("{report}");
//! if let Some(balance) = report.figure(Check::Balance) {
//!     println!("worst balance {:e} at {}", balance.value, balance.location);
//! }
//! # }
//! ```

mod bodies;
mod conditions;
mod input;
mod motion;
mod options;
mod report;
mod restore;
mod stability;
mod statics;

use tensegra_model::{Actuation, Configuration, Path, Problem};

use bodies::Bodies;
use conditions::Conditions;
use motion::Motion;
pub use options::{CheckOptions, OptionError};
pub use report::{Check, Failure, Figure, Location, Report, Statistics};
use report::{ConditionList, Ledger, Subject};
use stability::Stability;
use statics::Statics;

/// Judges a path.
///
/// A path of one configuration is judged too, if it is start and goal at once; an empty one is
/// refused. An end that the problem describes by conditions (`start = { formfind = … }`) has to
/// meet these; where it states neither, that end is free.
pub fn check_path(problem: &Problem, path: &Path, options: &CheckOptions) -> Report {
    judge(problem, path, options, Ends::OfPath)
}

/// Judges one configuration: everything that [`check_path`] judges, but for the ends of the path
/// and the motion.
pub fn check_configuration(
    problem: &Problem,
    configuration: &Configuration,
    options: &CheckOptions,
) -> Report {
    let path = Path {
        configurations: vec![configuration.clone()],
    };
    judge(problem, &path, options, Ends::Free)
}

/// Judges a form: everything that [`check_configuration`] judges, and what the problem asks of
/// forms (its table `[formfind]`): conditions, clearances, stability.
pub fn check_form(
    problem: &Problem,
    configuration: &Configuration,
    options: &CheckOptions,
) -> Report {
    let path = Path {
        configurations: vec![configuration.clone()],
    };
    let form = &problem.form;
    // Cylinders without ends keep at least as far apart as elements do.
    let clearance = match form.infinite_cylinders {
        true => options.min_clearance,
        false => options.min_clearance.max(form.clearance),
    };
    let options = options.clone().with_min_clearance(clearance);
    judge(problem, &path, &options, Ends::OfForm)
}

/// What the first and the last configuration have to be.
#[derive(Clone, Copy, PartialEq)]
enum Ends {
    /// Anything.
    Free,
    /// Start and goal.
    OfPath,
    /// What is asked of a form.
    OfForm,
}

fn judge(problem: &Problem, path: &Path, options: &CheckOptions, ends: Ends) -> Report {
    let mut ledger = Ledger::new();
    judge_into(problem, path, options, ends, &mut ledger);
    ledger.into_report(problem)
}

fn judge_into(
    problem: &Problem,
    path: &Path,
    options: &CheckOptions,
    ends: Ends,
    ledger: &mut Ledger,
) {
    let configurations = &path.configurations;
    ledger.statistics.configurations = configurations.len();
    if let Err(fault) = options.validate() {
        ledger.tell(Check::Input, Location::Whole, fault.to_string());
        return;
    }
    if !input::problem(problem, ledger) {
        return;
    }
    if configurations.is_empty() {
        let message = "the path has no configurations".to_owned();
        ledger.tell(Check::Input, Location::Whole, message);
        return;
    }
    let usable: Vec<bool> = configurations
        .iter()
        .enumerate()
        .map(|(index, configuration)| {
            let location = Location::Configuration { index };
            input::configuration(problem, configuration, location, ledger)
        })
        .collect();

    let structure = &problem.structure;
    let first = configurations
        .iter()
        .zip(&usable)
        .find_map(|(c, &usable)| usable.then_some(c));
    let Some(first) = first else { return };
    let size = structure.size(&first.positions);
    let mut statics = Statics::new(problem, options, size);
    let last = configurations.len() - 1;
    let mut stability = Stability::new(structure);
    // Stiffness is that of motors which keep rest lengths; that of a form is judged with its
    // other conditions.
    let keeps_lengths = problem.settings.actuation == Actuation::Length;
    let demanded = problem.settings.least_stiffness;
    let demanded = demanded.filter(|_| keeps_lengths && ends != Ends::OfForm);
    for (index, configuration) in configurations.iter().enumerate() {
        if !usable[index] {
            continue;
        }
        let location = Location::Configuration { index };
        statics.judge(configuration, location, ledger);
        // Eigenvalues of large structures are too dear to be had everywhere unasked.
        if (demanded.is_some() || stability.is_cheap() || index == 0 || index == last)
            && let Some(least) = stability.least_stiffness(configuration)
        {
            match demanded {
                Some(margin) => {
                    ledger.judge(Check::Stability, least, margin, location, Subject::None);
                }
                None => ledger.report(Check::Stability, least, location, Subject::None),
            }
        }
    }
    let conditions = Conditions {
        problem,
        options,
        size,
    };
    if ends == Ends::OfPath {
        use ConditionList::{Goal, Start};
        for (checks, endpoint, described, list, index) in [
            (
                [Check::Start, Check::StartForces],
                &problem.start,
                &problem.start_form,
                Start,
                0,
            ),
            (
                [Check::Goal, Check::GoalForces],
                &problem.goal,
                &problem.goal_form,
                Goal,
                last,
            ),
        ] {
            let configuration = &configurations[index];
            let location = Location::Configuration { index };
            match endpoint {
                _ if !usable[index] => {}
                Some(endpoint) => {
                    statics.judge_endpoint(checks, endpoint, configuration, location, ledger);
                }
                None if described.is_some() => {
                    conditions.judge(list, configuration, location, &mut stability, ledger);
                }
                None => {}
            }
        }
    } else if ends == Ends::OfForm && usable[0] {
        let location = Location::Configuration { index: 0 };
        let list = ConditionList::Form;
        conditions.judge(list, &configurations[0], location, &mut stability, ledger);
    }
    let displacements = displacements(problem, path, &usable, options, size, ledger);
    let bodies = Bodies::new(problem, ledger);
    Motion::new(&statics, &bodies).judge(path, &usable, &displacements, ledger);
}

/// Judges the steps; returns the largest displacement of a node in each, 0 where it is unknown.
fn displacements(
    problem: &Problem,
    path: &Path,
    usable: &[bool],
    options: &CheckOptions,
    size: f64,
    ledger: &mut Ledger,
) -> Vec<f64> {
    let step = options
        .max_displacement
        .unwrap_or(problem.settings.step * size);
    // A step may end on the limit up to rounding.
    let limit = step * (1.0 + options.range_tolerance);
    let steps = path
        .configurations
        .windows(2)
        .enumerate()
        .map(|(index, pair)| {
            if !(usable[index] && usable[index + 1]) {
                return 0.0;
            }
            let moved = pair[0]
                .positions
                .iter()
                .zip(&pair[1].positions)
                .map(|(p, q)| (q - p).norm());
            let (node, displacement) = moved
                .enumerate()
                .max_by(|a, b| a.1.total_cmp(&b.1))
                .unwrap_or((0, 0.0));
            let location = Location::Step { index };
            ledger.judge(
                Check::Displacement,
                displacement,
                limit,
                location,
                Subject::Node(node),
            );
            ledger.statistics.path_length += displacement;
            displacement
        });
    steps.collect()
}
