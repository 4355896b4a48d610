//! Stable forms free of collisions, from many random starts.
//!
//! From each start:
//!
//! 1. the violations of all constraints, tightened by a margin, are brought to zero by
//!    Levenberg–Marquardt steps on those that are violated (a Gauss–Newton method with an active
//!    set). Against the penalty method with BFGS of Hernández Juan and Mirats Tur (2008), which
//!    solves the same conditions, it converges quadratically and needs no growing weight.
//!    Where that fails, bodies may pass through each other first, and are separated afterwards: a
//!    start may lie on the wrong side of a bar;
//! 2. where the equilibrium found is unstable, the least tangent stiffness joins the constraints;
//! 3. where a cost is to be minimised, sequential quadratic programming does so;
//! 4. the same steps as in 1, with next to no margin, polish the result to the accuracy of the
//!    arithmetic.
//!
//! Cost of a step: O(n² m) for n variables and m violated rows.
//!
//! The random numbers of a start depend on the seed and its index alone, so that results do not
//! depend on the number of threads.

use nalgebra::Point3;
use rayon::prelude::*;
use tensegra_collision::{Capsule, Solid, capsule_solid};
use tensegra_model::{
    Body, BodyError, Configuration, Environment, EquilibriumManifold, FormCondition, FormCost,
    FormSettings, FreeSpace, NodesManifold, Problem, Role, Structure,
};
use tensegra_optim::{
    DenseSqp, LeastSquaresOptions, LevenbergMarquardt, Nlp, SqpOptions, StepScaling,
    restore_feasibility,
};

use crate::{
    error::{FormError, Unmet},
    frame::{Frame, Group},
    program::Program,
    start,
};

/// Margin of inequalities while a form is sought, in the manifold's units.
const WIDE_MARGIN: f64 = 1e-2;
/// Margin of inequalities of a polished form: what keeps rounding from crossing them.
const THIN_MARGIN: f64 = 1e-8;
/// Residual that a form has at most, in the manifold's units.
pub const RESIDUAL: f64 = 1e-9;
/// Residual at which polishing ends.
const POLISHED: f64 = 1e-12;
/// Iterations of a search, and of polishing.
const SEARCH_ITERATIONS: usize = 150;
const POLISH_ITERATIONS: usize = 60;
/// Forms whose nodes are apart by no more than this fraction of the size are one shape.
const SAME_SHAPE: f64 = 1e-2;
/// Starts from which the cause of a failure is sought, for each group of constraints.
const CAUSE_STARTS: usize = 6;
/// Weight of constraints that are relaxed, and the violation of others that counts as none.
const RELAXED_WEIGHT: f64 = 1e-3;
const NEGLIGIBLE: f64 = 1e-4;

/// A form-finding problem: a structure with its surroundings, and what is asked of its form.
///
/// # Examples
/// ```
/// use tensegra_formfinding::FormProblem;
/// use tensegra_model::{FormCondition, Problem, StructureBuilder};
///
/// // Two crossed struts tied by four cables: where does the upper one end?
/// let structure = StructureBuilder::planar()
///     .strut("s1", ["a", "b"], 1.0)
///     .strut("s2", ["c", "d"], 1.0)
///     .cable("c1", ["a", "c"], 0.0..=3.0, 1.0, 0.0..=2.0)
///     .cable("c2", ["b", "c"], 0.0..=3.0, 1.0, 0.0..=2.0)
///     .cable("c3", ["a", "d"], 0.0..=3.0, 1.0, 0.0..=2.0)
///     .cable("c4", ["b", "d"], 0.0..=3.0, 1.0, 0.0..=2.0)
///     .fix_coordinate("b", 1, 0.0)
///     .build()?;
/// let mut problem = Problem::new("cross", structure);
/// let tip = FormCondition::centroid(&[3], [0.2, 0.6, 0.0]);
/// let forms = FormProblem::new(&problem, &[tip])?.find(1, 20)?;
/// let form = forms.best();
/// assert!((form.configuration.positions[3].y - 0.6).abs() < 1e-9);
/// assert!(form.least_stiffness.is_some_and(|stiffness| stiffness > 0.0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct FormProblem {
    manifold: NodesManifold,
    environment: Environment,
    settings: FormSettings,
    conditions: Vec<FormCondition>,
    /// Obstacles that collide, with their index.
    solids: Vec<(usize, Solid)>,
}

/// A stable configuration that meets all conditions.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Form {
    /// The configuration.
    pub configuration: Configuration,
    /// The start that led to it.
    pub start: usize,
    /// Largest residual of an equation, in units of the structure's size and force.
    pub residual: f64,
    /// Smallest eigenvalue of the tangent stiffness while rest lengths are held, in force per
    /// length; `None` where nothing can move.
    pub least_stiffness: Option<f64>,
    /// Smallest clearance of a collision pair; infinite where there is none.
    pub clearance: f64,
    /// Elastic energy Σ f² / (2 |k|) of the elements with a linear law.
    pub energy: f64,
    /// Steps that it took.
    pub iterations: usize,
}

/// What form-finding found.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Forms {
    /// The forms, in the order of their starts; not empty.
    pub forms: Vec<Form>,
    /// Number of starts.
    pub starts: usize,
    /// For each form the index of the first one of the same shape.
    pub shapes: Vec<usize>,
    best: usize,
}

impl Forms {
    /// The best form: the one with the least cost, or, where nothing is minimised, the stiffest.
    pub fn best(&self) -> &Form {
        &self.forms[self.best]
    }

    /// Index of the best form.
    pub fn best_index(&self) -> usize {
        self.best
    }

    /// Number of distinct shapes: forms whose nodes are farther apart than 1 % of the size of the
    /// structure.
    pub fn shape_count(&self) -> usize {
        let firsts = self.shapes.iter().enumerate();
        firsts.filter(|(index, first)| index == *first).count()
    }
}

impl FormProblem {
    /// A problem with the conditions of its settings and further ones.
    ///
    /// # Errors
    /// [`FormError::Structure`], [`FormError::Body`] and [`FormError::Swallowed`]: what no start
    /// can mend.
    pub fn new(problem: &Problem, further: &[FormCondition]) -> Result<Self, FormError> {
        let structure = &problem.structure;
        let conditions = [&problem.form.conditions, further].concat();
        let reference = start::positions(structure, &conditions, &mut start::generator(0, 0));
        let manifold = NodesManifold::new(structure, &reference)?;
        let mut solids = Vec::new();
        for (index, obstacle) in problem.environment.obstacles.iter().enumerate() {
            if obstacle.role != Role::Decoration {
                let solid = obstacle.shape.solid().map_err(|error| BodyError {
                    body: obstacle.name.clone(),
                    error,
                })?;
                solids.push((index, solid));
            }
        }
        let found = Self {
            manifold,
            environment: problem.environment.clone(),
            settings: problem.form.clone(),
            conditions,
            solids,
        };
        found.free()?;
        found.refuse_swallowed_nodes()?;
        Ok(found)
    }

    fn structure(&self) -> &Structure {
        self.manifold.structure()
    }

    fn free(&self) -> Result<FreeSpace<'_, NodesManifold>, BodyError> {
        FreeSpace::new(&self.manifold, &self.environment, self.manifold.size())
    }

    fn frame(&self) -> Result<Frame<'_>, FormError> {
        Ok(Frame::new(
            &self.manifold,
            self.free()?,
            &self.environment,
            &self.settings,
            &self.conditions,
            &self.solids,
        ))
    }

    /// Refuses a node that is fixed inside an obstacle it must not touch.
    fn refuse_swallowed_nodes(&self) -> Result<(), FormError> {
        let structure = self.structure();
        let mut places = vec![Point3::origin(); structure.nodes.len()];
        let mut fixed = vec![3 - structure.dimension; structure.nodes.len()];
        for coordinate in &structure.fixed {
            places[coordinate.node][coordinate.axis] = coordinate.value;
            fixed[coordinate.node] += 1;
        }
        for (node, place) in places.iter().enumerate().filter(|(i, _)| fixed[*i] == 3) {
            for (obstacle, solid) in &self.solids {
                // The bodies of struts and bars begin at the node itself.
                let touches = self.environment.pairs.iter().any(|pair| match *pair {
                    [Body::Element(e), Body::Obstacle(o)] => {
                        use tensegra_model::ElementKind::{Bar, Prismatic, Strut};
                        let element = &structure.elements[e];
                        o == *obstacle
                            && element.nodes.contains(&node)
                            && matches!(element.kind, Strut | Bar | Prismatic)
                    }
                    _ => false,
                });
                let least = match (touches, self.settings.node_radius) {
                    (_, Some(radius)) => radius,
                    (true, None) => self.settings.clearance,
                    (false, None) => continue,
                };
                let point = Capsule {
                    a: *place,
                    b: *place,
                    radius: 0.0,
                };
                let clearance = capsule_solid(&point, solid).clearance;
                if clearance < least {
                    return Err(FormError::Swallowed {
                        node: structure.nodes[node].name.clone(),
                        obstacle: self.environment.obstacles[*obstacle].name.clone(),
                        clearance,
                        least,
                    });
                }
            }
        }
        Ok(())
    }

    /// Finds forms from random starts, on the threads of the current rayon pool.
    ///
    /// # Errors
    /// [`FormError::Unmet`] if no start led to a form: what cannot be met, by how much.
    pub fn find(&self, seed: u64, starts: usize) -> Result<Forms, FormError> {
        let frame = self.frame()?;
        let found: Vec<Option<Form>> = (0..starts)
            .into_par_iter()
            .map_init(
                || Search::new(&frame),
                |search, start| search.try_start(self, seed, start),
            )
            .collect();
        let forms: Vec<Form> = found.into_iter().flatten().collect();
        if forms.is_empty() {
            return Err(self.cause(&frame, seed, starts));
        }
        Ok(self.gather(forms, starts))
    }

    /// The form that one random start leads to, if it leads to one.
    ///
    /// # Errors
    /// [`FormError::Body`]; that nothing is found is no error.
    pub fn attempt(&self, seed: u64, start: usize) -> Result<Option<Form>, FormError> {
        let frame = self.frame()?;
        Ok(Search::new(&frame).try_start(self, seed, start))
    }

    /// Gives a test the programme and a random point.
    #[cfg(test)]
    pub(crate) fn with_random_point(
        &self,
        start: usize,
        test: impl FnOnce(&mut Program<'_, '_>, &[f64]),
    ) {
        let frame = self.frame().unwrap();
        let mut search = Search::new(&frame);
        let x = search.random(self, 1, start);
        test(&mut search.program, &x);
    }

    /// Finds one form: from `near` first, if given, then from up to `starts` random starts.
    ///
    /// # Errors
    /// As [`find`](Self::find).
    pub fn find_one(
        &self,
        near: Option<&Configuration>,
        seed: u64,
        starts: usize,
    ) -> Result<Form, FormError> {
        let frame = self.frame()?;
        let mut search = Search::new(&frame);
        if let Some(near) = near {
            let mut x = self.manifold.coordinates(near);
            if let Some(form) = search.solve_anyhow(&mut x, StepScaling::None, WIDE_MARGIN, 0) {
                return Ok(form);
            }
        }
        (0..starts)
            .find_map(|start| search.try_start(self, seed, start))
            .ok_or_else(|| self.cause(&frame, seed, starts))
    }

    /// The form near a configuration, with next to no margin from the limits: the step of a
    /// [`follow`](crate::follow)er.
    ///
    /// # Errors
    /// [`FormError::Unmet`] where the nearby point that misses the least misses something.
    pub fn nearest(&self, near: &Configuration) -> Result<Form, FormError> {
        let frame = self.frame()?;
        let mut search = Search::new(&frame);
        let mut x = self.manifold.coordinates(near);
        search
            .solve(&mut x, StepScaling::None, THIN_MARGIN, 0)
            .ok_or_else(|| {
                let unmet = search
                    .unmet(&x, None)
                    .map_or_else(Vec::new, |(_, unmet)| unmet);
                FormError::Unmet { unmet, starts: 1 }
            })
    }

    fn gather(&self, forms: Vec<Form>, starts: usize) -> Forms {
        let best = match self.settings.cost {
            FormCost::Energy => forms
                .iter()
                .enumerate()
                .min_by(|a, b| a.1.energy.total_cmp(&b.1.energy)),
            _ => forms.iter().enumerate().min_by(|a, b| {
                let softness = |form: &Form| -form.least_stiffness.unwrap_or(f64::INFINITY);
                softness(a.1).total_cmp(&softness(b.1))
            }),
        };
        let best = best.map_or(0, |(index, _)| index);
        let apart = SAME_SHAPE * self.manifold.size();
        let outlines: Vec<Outline> = forms
            .iter()
            .map(|form| Outline::of(&form.configuration.positions))
            .collect();
        let mut shapes: Vec<usize> = Vec::with_capacity(forms.len());
        for (index, outline) in outlines.iter().enumerate() {
            let first = (0..index)
                .find(|&other| shapes[other] == other && outline.is_like(&outlines[other], apart));
            shapes.push(first.unwrap_or(index));
        }
        Forms {
            forms,
            starts,
            shapes,
            best,
        }
    }

    /// What keeps the problem from having a form: the first group of constraints without which
    /// there is one, with its smallest violation.
    fn cause(&self, frame: &Frame<'_>, seed: u64, starts: usize) -> FormError {
        let tried = starts.min(CAUSE_STARTS);
        let groups = [
            Some(Group::Conditions),
            Some(Group::Stability),
            Some(Group::Clearance),
            Some(Group::Balance),
            Some(Group::Forces),
            Some(Group::Lengths),
            None,
        ];
        for group in groups {
            let found: Vec<Option<(f64, Vec<Unmet>)>> = (0..tried)
                .into_par_iter()
                .map_init(
                    || Search::new(frame),
                    |search, start| search.relaxed(self, group, seed, start),
                )
                .collect();
            let best = found
                .into_iter()
                .flatten()
                .min_by(|a, b| a.0.total_cmp(&b.0));
            if let Some((_, unmet)) = best {
                return FormError::Unmet { unmet, starts };
            }
        }
        FormError::Unmet {
            unmet: Vec::new(),
            starts,
        }
    }
}

/// A solver with its memory: one for each thread.
pub(crate) struct Search<'f, 'a> {
    program: Program<'f, 'a>,
    frame: &'f Frame<'a>,
}

impl<'f, 'a> Search<'f, 'a> {
    pub(crate) fn new(frame: &'f Frame<'a>) -> Self {
        Self {
            program: frame.program(),
            frame,
        }
    }

    fn random(&self, problem: &FormProblem, seed: u64, start: usize) -> Vec<f64> {
        let mut rng = start::generator(seed, start as u64 + 1);
        let structure = problem.structure();
        let positions = start::positions(structure, &problem.conditions, &mut rng);
        let force = problem.manifold.force_unit();
        let configuration = start::configuration(structure, positions, force, &mut rng);
        problem.manifold.coordinates(&configuration)
    }

    fn try_start(&mut self, problem: &FormProblem, seed: u64, start: usize) -> Option<Form> {
        let mut x = self.random(problem, seed, start);
        self.solve_anyhow(&mut x, StepScaling::Jacobian, WIDE_MARGIN, start)
    }

    /// Steps towards a point that meets all constraints with a margin; the number of steps, and
    /// whether it does.
    fn descend(
        &mut self,
        x: &mut [f64],
        margin: f64,
        scaling: StepScaling,
        iterations: usize,
    ) -> Option<(usize, bool)> {
        self.program.margin = margin;
        let options = LeastSquaresOptions::default()
            .with_max_iterations(iterations)
            .with_residual_tolerance(POLISHED)
            .with_scaling(scaling);
        let mut solver = LevenbergMarquardt::new(options).ok()?;
        let report = restore_feasibility(&mut self.program, &mut solver, x).ok()?;
        let met = report.largest_residual <= 0.5 * RESIDUAL;
        Some((report.iterations, met && x.iter().all(|v| v.is_finite())))
    }

    /// The form that is reached from x, if not directly, then by letting bodies pass through each
    /// other first.
    fn solve_anyhow(
        &mut self,
        x: &mut [f64],
        scaling: StepScaling,
        margin: f64,
        start: usize,
    ) -> Option<Form> {
        let from = x.to_vec();
        self.solve(x, scaling, margin, start).or_else(|| {
            x.copy_from_slice(&from);
            self.program.relaxed = Some((Group::Clearance, 0.0));
            self.program.stable = false;
            self.descend(x, margin, scaling, SEARCH_ITERATIONS)?;
            self.solve(x, scaling, margin, start)
        })
    }

    /// The form that is reached from x.
    fn solve(
        &mut self,
        x: &mut [f64],
        scaling: StepScaling,
        margin: f64,
        start: usize,
    ) -> Option<Form> {
        let frame = self.frame;
        self.program.relaxed = None;
        self.program.stable = false;
        let least = frame.settings().least_stiffness;
        let (mut iterations, mut met) = self.descend(x, margin, scaling, SEARCH_ITERATIONS)?;
        if least.is_some() {
            self.program.stable = true;
            let stiffness = self.program.least_stiffness(x);
            if stiffness.is_some_and(|s| Some(s) <= least) {
                let (more, again) = self.descend(x, margin, scaling, SEARCH_ITERATIONS)?;
                iterations += more;
                met = again;
            }
        }
        if frame.settings().cost != FormCost::None {
            self.program.margin = THIN_MARGIN;
            let options = SqpOptions::default()
                .with_initial_radius(0.1)
                .with_feasibility_tolerance(1e-9);
            let mut sqp = DenseSqp::new(options).ok()?;
            let report = sqp.solve(&mut self.program, x).ok()?;
            iterations += report.iterations;
            met = false;
        }
        if !met {
            let (more, again) =
                self.descend(x, THIN_MARGIN, StepScaling::None, POLISH_ITERATIONS)?;
            iterations += more;
            if !again {
                return None;
            }
        }
        let (residual, violation) = self.program.violations(x);
        if !(residual <= RESIDUAL && violation <= 0.0) {
            return None;
        }
        Some(Form {
            configuration: frame.manifold.configuration(x),
            start,
            residual,
            least_stiffness: self.program.least_stiffness(x),
            clearance: self.program.least_clearance(x),
            energy: self.program.energy(x),
            iterations,
        })
    }

    /// A point that meets all but one group of constraints, and what it misses of that group; the
    /// sum of the violations comes first. Without a group, whatever is missed.
    fn relaxed(
        &mut self,
        problem: &FormProblem,
        group: Option<Group>,
        seed: u64,
        start: usize,
    ) -> Option<(f64, Vec<Unmet>)> {
        let mut x = self.random(problem, seed, start);
        self.program.relaxed = group.map(|group| (group, RELAXED_WEIGHT));
        self.program.stable = false;
        let scaling = StepScaling::Jacobian;
        self.descend(&mut x, THIN_MARGIN, scaling, SEARCH_ITERATIONS)?;
        if self.frame.settings().least_stiffness.is_some() {
            self.program.stable = true;
            self.descend(&mut x, THIN_MARGIN, scaling, SEARCH_ITERATIONS)?;
        }
        self.unmet(&x, group)
    }

    /// What a point misses, if that is of the given group alone (of any without one).
    fn unmet(&mut self, x: &[f64], group: Option<Group>) -> Option<(f64, Vec<Unmet>)> {
        self.program.relaxed = None;
        let rows = self.program.num_constraints();
        let mut values = vec![0.0; rows];
        self.program.constraints(x, &mut values);
        let (mut lower, mut upper) = (vec![f64::NEG_INFINITY; rows], vec![f64::INFINITY; rows]);
        self.program.margin = 0.0;
        self.program.constraint_bounds(&mut lower, &mut upper);
        let mut sum = 0.0;
        let mut unmet = Vec::new();
        for (row, &value) in values.iter().enumerate() {
            let violation = (lower[row] - value).max(value - upper[row]);
            if violation <= NEGLIGIBLE {
                continue;
            }
            let of = self.frame.group(row);
            if group.is_some_and(|group| group != of) {
                return None;
            }
            let (constraint, unit) = self.frame.describe(row);
            sum += violation;
            unmet.push((
                violation,
                Unmet {
                    constraint,
                    group: of,
                    violation: violation * unit,
                },
            ));
        }
        let manifold = self.frame.manifold;
        for variable in 0..x.len() {
            use tensegra_atlas::ImplicitManifold;
            let violation = (manifold.lower_bounds()[variable] - x[variable])
                .max(x[variable] - manifold.upper_bounds()[variable]);
            if violation <= NEGLIGIBLE {
                continue;
            }
            let of = self.frame.group_of_variable(variable);
            if group.is_some_and(|group| group != of) {
                return None;
            }
            sum += violation;
            unmet.push((
                violation,
                Unmet {
                    constraint: self.frame.describe_variable(variable),
                    group: of,
                    violation,
                },
            ));
        }
        // By their size in the manifold's units: metres and newtons do not compare.
        unmet.sort_by(|a, b| b.0.total_cmp(&a.0));
        let unmet: Vec<Unmet> = unmet.into_iter().map(|(_, unmet)| unmet).collect();
        (group.is_none() || !unmet.is_empty()).then_some((sum, unmet))
    }
}

/// What tells shapes apart, whatever rigid motion they have made: the distances of all nodes, and
/// on which side of three nodes the others lie.
struct Outline {
    distances: Vec<f64>,
    volume: f64,
}

impl Outline {
    fn of(positions: &[Point3<f64>]) -> Self {
        let mut distances = Vec::with_capacity(positions.len() * positions.len() / 2);
        for (i, a) in positions.iter().enumerate() {
            distances.extend(positions[i + 1..].iter().map(|b| (b - a).norm()));
        }
        let volume = match positions {
            [a, b, c, others @ ..] => others
                .iter()
                .map(|d| (b - a).cross(&(c - a)).dot(&(d - a)))
                .max_by(|a, b| a.abs().total_cmp(&b.abs()))
                .unwrap_or(0.0),
            _ => 0.0,
        };
        Self { distances, volume }
    }

    fn is_like(&self, other: &Self, apart: f64) -> bool {
        let mut pairs = self.distances.iter().zip(&other.distances);
        // Shapes that are all but flat have no side.
        let flat = apart
            * self
                .distances
                .iter()
                .fold(0.0_f64, |m, d| m.max(*d))
                .powi(2);
        let sides = self.volume.signum() == other.volume.signum()
            || self.volume.abs() < flat
            || other.volume.abs() < flat;
        sides && pairs.all(|(a, b)| (a - b).abs() <= apart)
    }
}
