//! Suite `lar`: the experiments of Usevitch, Hammond and Schwager (2020) on
//! linear-actuator (truss) robots.

mod gaits;
mod walks;

use cpu_time::ThreadTime;
use tensegra::io::{BenchRow, Picture, ReferenceValue};

use super::{BenchArguments, Results, RunFailure};
use crate::Error;

const SUITE: &str = "lar";

const INTRODUCTION: &str = "\
Truss robots of Usevitch, Hammond and Schwager (2020): K5 and the octahedron on a unit triangle, \
and random minimally rigid robots. Every walk is judged by the independent check; a walk that is \
refused, or does not reach its waypoints, is a failure. Times are CPU seconds of one thread; a \
time a step is that of a whole walk over its optimisations, recoveries and rolls included. Cost is \
Σ‖ΔL‖² for primitives and equation (40), steps × Σ‖ΔL‖²/distance, for walks. A mean, a share or an \
exponent stands in the column of the median.

Cases: `primitives` (one roll, from a given shape at the tip and from the generic multi-start), \
`gaits` (cost per roll over two to four rolls and of the periodic gait, relative to one roll), \
`greedy` and `two-tier` (random sequences of five waypoints in a square of side 5, the robot \
starting in its middle; greedily with recovery unless said otherwise, two-tier with primitives of \
up to so many rolls, by default two and the periodic gait that can turn; with it, the first walks \
are simulated as well), `random` (random robots travel 5 units), `dynamics` (one roll under length \
control, nodes of 1 kg).

References: `paper`, as printed; `IPOPT`, the same problems stated with CasADi and solved by \
IPOPT on a machine like the one below (walks: small samples).
";

/// Measures one case.
type Case = fn(&mut Suite) -> Result<(), Error>;

const CASES: [(&str, Case); 6] = [
    ("primitives", gaits::primitives),
    ("gaits", gaits::gaits),
    ("greedy", walks::greedy),
    ("two-tier", walks::two_tier),
    ("random", walks::random),
    ("dynamics", gaits::dynamics),
];

/// The rigidity index imposed on walks; the paper's 0.005 on another scale.
const MIN_RIGIDITY: f64 = 0.0025;

/// What is measured on the way.
#[derive(Default)]
struct Suite {
    rows: Vec<BenchRow>,
    failures: Vec<RunFailure>,
    pictures: Vec<Picture>,
    quick: bool,
    /// Trials of each kind of walk.
    trials: u64,
}

impl Suite {
    fn row(
        &mut self,
        case: &str,
        variant: &str,
        [metric, unit]: [&str; 2],
        runs: usize,
        samples: &[f64],
        reference: &[(&str, f64)],
    ) {
        let mut row = BenchRow::new(case, metric, unit, runs, samples);
        row.suite = SUITE.to_owned();
        row.variant = variant.to_owned();
        row.reference = reference
            .iter()
            .map(|&(source, value)| ReferenceValue {
                source: source.to_owned(),
                value,
            })
            .collect();
        self.rows.push(row);
    }

    fn fail(&mut self, case: &str, variant: &str, seed: u64, reason: impl ToString) {
        self.failures.push(RunFailure {
            case: case.to_owned(),
            variant: variant.to_owned(),
            seed,
            reason: reason.to_string(),
        });
    }
}

pub fn measure(arguments: &BenchArguments) -> Result<Results, Error> {
    arguments.refuse_unknown_cases(&CASES.map(|(name, _)| name))?;
    let mut suite = Suite {
        quick: arguments.quick,
        trials: arguments
            .seeds
            .unwrap_or(if arguments.quick { 2 } else { 100 }),
        ..Suite::default()
    };
    for (name, measure) in CASES {
        if arguments.cases.is_empty() || arguments.cases.iter().any(|case| case == name) {
            let start = ThreadTime::now();
            measure(&mut suite)?;
            eprintln!("{name}: {:.1} s", start.elapsed().as_secs_f64());
        }
    }
    let picture = (!suite.pictures.is_empty()).then(|| Picture::grid(&suite.pictures, 2));
    Ok(Results {
        introduction: INTRODUCTION,
        rows: suite.rows,
        failures: suite.failures,
        picture,
    })
}

/// Seconds of CPU that a computation takes, with its outcome.
fn timed<T>(compute: impl FnOnce() -> T) -> (T, f64) {
    let start = ThreadTime::now();
    let outcome = compute();
    (outcome, start.elapsed().as_secs_f64())
}
