//! Tracing: motors are moved, and the equilibrium is followed (Porta and
//! Hernández-Juan 2016, section 4.1).

use cpu_time::ThreadTime;
use tensegra_model::{
    Body, Configuration, Coupling, ElementQuantity, EquilibriumManifold, FreeSpace, Path, Problem,
    Stability, Stable, Structure,
};
use tensegra_sampling::{self as sampling, Observer, Progress, Quantities, TraceOptions};

use crate::planning::{Grounded, PlanningError, body_name, prepare_start, refuse_instability};

/// A quantity that is to be moved, and where to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// The quantity.
    pub quantity: ElementQuantity,
    /// Its value in the end.
    pub to: f64,
}

/// Why a motion cannot be traced.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TraceError {
    /// The problem is refused.
    #[error(transparent)]
    Problem(#[from] PlanningError),
    /// Nothing is to be moved.
    #[error("nothing is to be moved: name an element, a quantity of it and a value")]
    NoMotion,
    /// The element has no such quantity.
    #[error("{element} has no {quantity}: move another quantity of it")]
    NoQuantity {
        /// Name of the element.
        element: String,
        /// The quantity.
        quantity: &'static str,
    },
    /// The quantity never changes.
    #[error("the {quantity} of {element} is constant: move another one")]
    Constant {
        /// Name of the element.
        element: String,
        /// The quantity.
        quantity: &'static str,
    },
    /// A quantity is to be moved twice.
    #[error("the {quantity} of {element} is to be moved twice: give one value")]
    Twice {
        /// Name of the element.
        element: String,
        /// The quantity.
        quantity: &'static str,
    },
    /// The value is not a finite number.
    #[error("the {quantity} of {element} cannot become {value}: give a finite number")]
    NotFinite {
        /// Name of the element.
        element: String,
        /// The quantity.
        quantity: &'static str,
        /// The value.
        value: f64,
    },
}

/// What a step came to.
#[derive(Clone, Debug, PartialEq)]
pub enum TraceStep {
    /// The quantities came nearer to their values.
    Moved,
    /// They have them.
    Arrived,
    /// There is no way on.
    Stopped(TraceStop),
}

/// Why there is no way on.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TraceStop {
    /// A quantity has reached the end of its range.
    #[error("the {quantity} of {element} has reached its {} limit {bound:.6}", if *.upper { "upper" } else { "lower" })]
    Range {
        /// Name of the element.
        element: String,
        /// The quantity.
        quantity: &'static str,
        /// The end of its range.
        bound: f64,
        /// Whether it is the upper end.
        upper: bool,
    },
    /// Another limit of the equilibrium manifold.
    #[error("a limit is reached: {name}")]
    Limit {
        /// Its name.
        name: String,
    },
    /// Two bodies touch.
    #[error("{a} touches {b}")]
    Collision {
        /// Name of one body.
        a: String,
        /// Name of the other.
        b: String,
    },
    /// Beyond, the equilibrium is not as stable as demanded.
    #[error(
        "beyond, the equilibrium is not stable enough: its smallest stiffness is {stiffness:.4e}"
    )]
    Unstable {
        /// Smallest eigenvalue of the tangent stiffness at the point reached.
        stiffness: f64,
    },
    /// The moved quantities are at an extremum, or what is held can be held no
    /// longer: beyond, there is no such equilibrium nearby.
    #[error("a fold: no equilibrium lies beyond with the other motors held")]
    Fold,
    /// More quantities are moved than the structure has parameters, and no
    /// equilibrium has them all nearer to their values.
    #[error(
        "{moved} quantities are moved, but in equilibrium the structure moves with {dimension} \
         parameters: move fewer at once"
    )]
    TooMany {
        /// Number of quantities that are moved.
        moved: usize,
        /// Dimension k of the equilibrium manifold.
        dimension: usize,
    },
    /// The dimension of the equilibrium manifold changes.
    #[error("a singular configuration: the freedoms of the structure change there")]
    Singular,
}

/// A structure made ready for tracing. Owns what a [`Tracer`] borrows.
pub struct TraceSetup<'a> {
    problem: &'a Problem,
    grounded: Grounded,
}

/// The manifold as it is owned.
type Manifold = dyn EquilibriumManifold;

/// Every quantity of every element.
struct All<'a> {
    manifold: &'a Manifold,
}

/// Place of a quantity in the list of all.
fn index(quantity: ElementQuantity) -> usize {
    let (kind, element) = match quantity {
        ElementQuantity::Length(e) => (0, e),
        ElementQuantity::Rest(e) => (1, e),
        ElementQuantity::Force(e) => (2, e),
    };
    3 * element + kind
}

fn quantity(index: usize) -> ElementQuantity {
    let element = index / 3;
    match index % 3 {
        0 => ElementQuantity::Length(element),
        1 => ElementQuantity::Rest(element),
        _ => ElementQuantity::Force(element),
    }
}

impl Quantities for All<'_> {
    fn count(&self) -> usize {
        3 * self.manifold.structure().elements.len()
    }

    fn value(&self, i: usize, x: &[f64]) -> f64 {
        self.manifold.quantity(quantity(i), x).unwrap_or(0.0)
    }

    fn gradient(&self, i: usize, x: &[f64], row: &mut tensegra_atlas::SparseRow) {
        self.manifold.quantity_gradient(quantity(i), x, row);
    }

    fn yields(&self, held: usize, moved: usize) -> bool {
        let (held, moved) = (quantity(held).element(), quantity(moved).element());
        held == moved
            || representative(self.manifold.structure(), held)
                == representative(self.manifold.structure(), moved)
    }
}

/// The element that the length or rest length of another one is tied to.
fn representative(structure: &Structure, element: usize) -> usize {
    structure
        .couplings
        .iter()
        .find_map(|coupling| match coupling {
            Coupling::Length {
                reference,
                followers,
            }
            | Coupling::Rest {
                reference,
                followers,
            } if followers.iter().any(|(follower, _)| *follower == element) => Some(*reference),
            _ => None,
        })
        .unwrap_or(element)
}

impl<'a> TraceSetup<'a> {
    /// Prepares a problem's structure at its start.
    ///
    /// # Errors
    /// [`PlanningError`] when the structure or its start is refused.
    pub fn new(problem: &'a Problem) -> Result<Self, PlanningError> {
        let grounded = prepare_start(problem)?;
        Ok(Self { problem, grounded })
    }

    /// The manifold that is followed.
    pub fn manifold(&self) -> &Manifold {
        self.grounded.manifold.as_ref()
    }

    /// Lets `act` work with a tracer at the start.
    ///
    /// # Errors
    /// [`PlanningError`] when the start is refused.
    pub fn with_tracer<T>(
        &self,
        act: impl FnOnce(&mut Tracer<'_>) -> T,
    ) -> Result<T, PlanningError> {
        let manifold = self.manifold();
        let problem = self.problem;
        let settings = &problem.settings;
        let Grounded { start, size, .. } = &self.grounded;
        let mut free = FreeSpace::new(manifold, &problem.environment, *size)?;
        free.admit(start);
        let free = Stable::new(manifold, settings.actuation, settings.least_stiffness, free);
        refuse_instability(&free, "start", start)?;
        let structure = &problem.structure;
        let motors: Vec<usize> = (0..structure.elements.len())
            .filter(|&e| representative(structure, e) == e)
            .filter_map(|e| ElementQuantity::actuated(structure, e))
            .map(index)
            .collect();
        let mut options = TraceOptions::default();
        options.step = settings.step;
        options.displacement = settings.step * size;
        let all = All { manifold };
        let inner = sampling::Tracer::new(manifold, &free, &all, &motors, options, start).map_err(
            |error| {
                PlanningError::Planner(tensegra_sampling::PlanError::Manifold {
                    which: "start",
                    error,
                })
            },
        )?;
        Ok(act(&mut Tracer {
            problem,
            manifold,
            free: &free,
            dimension: self.grounded.dimension,
            inner,
        }))
    }
}

type Free<'a> = Stable<'a, Manifold, FreeSpace<'a, Manifold>>;

/// Follows the equilibrium of a structure, one step at a time: what an
/// interactive program moves.
///
/// The other motors are held as well as possible: they change as little as they
/// can at every moment, in the sense of least squares of their rest lengths (of
/// the lengths of inextensible elements); see [`sampling::Tracer`]. A step back
/// along the way that the tracer came returns to where it was.
pub struct Tracer<'a> {
    problem: &'a Problem,
    manifold: &'a Manifold,
    free: &'a Free<'a>,
    dimension: usize,
    inner: sampling::Tracer<'a, Manifold, Free<'a>, All<'a>>,
}

impl Tracer<'_> {
    /// Moves quantities towards their values, in proportion, by one step.
    ///
    /// # Errors
    /// [`TraceError`] where a quantity cannot be moved at all.
    pub fn step(&mut self, motions: &[Motion]) -> Result<TraceStep, TraceError> {
        check_motions(&self.problem.structure, motions)?;
        Ok(self.advance(motions))
    }

    fn advance(&mut self, motions: &[Motion]) -> TraceStep {
        let targets: Vec<(usize, f64)> =
            motions.iter().map(|m| (index(m.quantity), m.to)).collect();
        match self.inner.step(&targets) {
            sampling::Advance::Moved => TraceStep::Moved,
            sampling::Advance::Arrived => TraceStep::Arrived,
            sampling::Advance::Stopped(sampling::Stop::Fold) if motions.len() > self.dimension => {
                TraceStep::Stopped(TraceStop::TooMany {
                    moved: motions.len(),
                    dimension: self.dimension,
                })
            }
            sampling::Advance::Stopped(stop) => TraceStep::Stopped(self.explain(stop)),
        }
    }

    /// The configuration reached.
    pub fn configuration(&self) -> Configuration {
        self.manifold.configuration(self.inner.point())
    }

    /// Number of steps that the way from the start has.
    pub fn steps(&self) -> usize {
        self.inner.trail().count() - 1
    }

    /// The way from the start to the configuration reached.
    pub fn path(&self) -> Path {
        let configurations = self.inner.trail().map(|x| self.manifold.configuration(x));
        Path {
            configurations: configurations.collect(),
        }
    }

    /// The motor that was moved the most though it should have been held, and by
    /// how much, since other quantities were moved than now.
    pub fn worst_held(&self) -> Option<(ElementQuantity, f64)> {
        let (i, deviation) = self.inner.worst_held()?;
        Some((quantity(i), deviation))
    }

    /// Names what stopped the tracer.
    fn explain(&self, stop: sampling::Stop) -> TraceStop {
        match stop {
            sampling::Stop::Fold => TraceStop::Fold,
            sampling::Stop::Singular => TraceStop::Singular,
            sampling::Stop::Contact(contact) => {
                let [a, b] = self.free.inner().bodies(contact);
                self.collision([a, b])
            }
            sampling::Stop::Blocked => self.explain_blocked(),
            sampling::Stop::Limit(limit) => self.explain_limit(limit),
        }
    }

    fn collision(&self, bodies: [Body; 2]) -> TraceStop {
        let [a, b] = bodies.map(|body| body_name(self.problem, body));
        TraceStop::Collision { a, b }
    }

    /// Either a collision between the points of a step or a lack of stability.
    fn explain_blocked(&self) -> TraceStop {
        let settings = &self.problem.settings;
        let stability = Stability::new(&self.problem.structure, settings.actuation);
        let stiffness = stability.least_stiffness(&self.configuration());
        let closest = self.free.inner().closest(self.inner.point());
        match (settings.least_stiffness, stiffness, closest) {
            // A clearance that a step could not have used up is no obstacle.
            (Some(_), Some(stiffness), closest)
                if closest.as_ref().is_none_or(|closest| {
                    closest.clearance > 1e-3 * settings.step * self.problem_size()
                }) =>
            {
                TraceStop::Unstable { stiffness }
            }
            (_, _, Some(closest)) => self.collision(closest.bodies),
            (_, stiffness, None) => TraceStop::Unstable {
                stiffness: stiffness.unwrap_or(f64::NAN),
            },
        }
    }

    fn problem_size(&self) -> f64 {
        let lengths = self.configuration().lengths;
        lengths.iter().fold(0.0, |longest: f64, l| longest.max(*l))
    }

    /// The range that ends at the point reached, by element and quantity; else
    /// the limit by the manifold's name.
    fn explain_limit(&self, limit: sampling::Limit) -> TraceStop {
        let structure = &self.problem.structure;
        let x = self.inner.point();
        let mut met: Option<(f64, TraceStop)> = None;
        for i in 0..3 * structure.elements.len() {
            let quantity = quantity(i);
            let (Some(range), Some(value)) = (
                quantity.range(structure),
                self.manifold.quantity(quantity, x),
            ) else {
                continue;
            };
            if range.is_constant() {
                continue;
            }
            for (bound, upper) in [(range.lo, false), (range.hi, true)] {
                let finite = [bound.abs(), value.abs(), range.hi - range.lo];
                let scale = finite.into_iter().filter(|s| s.is_finite());
                let distance = (value - bound).abs() / scale.fold(1e-12, f64::max);
                if distance < 1e-4 && met.as_ref().is_none_or(|(least, _)| distance < *least) {
                    let element = structure.elements[quantity.element()].name.clone();
                    let stop = TraceStop::Range {
                        element,
                        quantity: quantity.noun(),
                        bound,
                        upper,
                    };
                    met = Some((distance, stop));
                }
            }
        }
        met.map_or_else(
            || TraceStop::Limit {
                name: match limit {
                    sampling::Limit::Lower(i) => {
                        format!("lower end of {}", self.manifold.variable_name(i))
                    }
                    sampling::Limit::Upper(i) => {
                        format!("upper end of {}", self.manifold.variable_name(i))
                    }
                    sampling::Limit::Derived(i) => self.manifold.limit_name(i),
                },
            },
            |(_, stop)| stop,
        )
    }
}

/// Refuses motions of what there is not, and of what never moves.
fn check_motions(structure: &Structure, motions: &[Motion]) -> Result<(), TraceError> {
    if motions.is_empty() {
        return Err(TraceError::NoMotion);
    }
    for (i, motion) in motions.iter().enumerate() {
        let quantity = motion.quantity.noun();
        let element = structure.elements.get(motion.quantity.element());
        let name = element.map_or_else(|| "no element".to_owned(), |e| e.name.clone());
        let Some(range) = motion.quantity.range(structure) else {
            return Err(TraceError::NoQuantity {
                element: name,
                quantity,
            });
        };
        if range.is_constant() {
            return Err(TraceError::Constant {
                element: name,
                quantity,
            });
        }
        if motions[..i].iter().any(|m| m.quantity == motion.quantity) {
            return Err(TraceError::Twice {
                element: name,
                quantity,
            });
        }
        if !motion.to.is_finite() {
            return Err(TraceError::NotFinite {
                element: name,
                quantity,
                value: motion.to,
            });
        }
    }
    Ok(())
}

/// A motion that was traced.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Trace {
    /// From the start to the last equilibrium reached.
    pub path: Path,
    /// Why it ends there; `None` when all quantities have their values.
    pub stop: Option<TraceStop>,
    /// Whether the observer ended it.
    pub cancelled: bool,
    /// Values that the moved quantities reached, in the order of the motions.
    pub reached: Vec<f64>,
    /// The motor that gave way the most, and by how much.
    pub worst_held: Option<(ElementQuantity, f64)>,
    /// Dimension k of the manifold.
    pub dimension: usize,
    /// The smallest eigenvalue of the tangent stiffness along the path, force per
    /// length, with the index of the configuration that has it.
    pub least_stiffness: Option<(usize, f64)>,
    /// CPU seconds of tracing.
    pub seconds: f64,
}

/// Moves quantities from their values at the problem's start to others, in
/// proportion, and follows the equilibrium until they are reached or there is
/// no way on.
///
/// # Errors
/// [`TraceError`] when the problem or a motion is refused.
pub fn trace(
    problem: &Problem,
    motions: &[Motion],
    observer: &mut dyn Observer,
) -> Result<Trace, TraceError> {
    check_motions(&problem.structure, motions)?;
    let setup = TraceSetup::new(problem)?;
    let clock = ThreadTime::now();
    let traced = setup.with_tracer(|tracer| {
        let mut cancelled = false;
        let stop = loop {
            match tracer.advance(motions) {
                TraceStep::Moved => {}
                TraceStep::Arrived => break None,
                TraceStep::Stopped(stop) => break Some(stop),
            }
            let mut progress = Progress::default();
            progress.seconds = clock.elapsed().as_secs_f64();
            progress.nodes = tracer.steps();
            cancelled =
                progress.seconds > problem.settings.time_limit || !observer.progress(&progress);
            if cancelled {
                break None;
            }
        };
        (tracer.path(), stop, cancelled, tracer.worst_held())
    })?;
    let seconds = clock.elapsed().as_secs_f64();
    let (path, stop, cancelled, worst_held) = traced;
    let last = path.configurations.last();
    let value = |motion: &Motion| last.and_then(|last| motion.quantity.value(last));
    let stability = Stability::new(&problem.structure, problem.settings.actuation);
    Ok(Trace {
        reached: motions.iter().filter_map(value).collect(),
        least_stiffness: stability.least_along(&path),
        path,
        stop,
        cancelled,
        worst_held,
        dimension: setup.grounded.dimension,
        seconds,
    })
}
