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
use tensegra_optim::StepScaling;

use crate::{
    error::{FormError, Unmet},
    frame::{Frame, Group},
    outline::Outline,
    search::{Search, THIN_MARGIN, WIDE_MARGIN},
    start,
};

/// Residual that a form has at most, in the manifold's units.
pub const RESIDUAL: f64 = 1e-9;
/// Forms whose nodes are apart by no more than this fraction of the size are one shape.
const SAME_SHAPE: f64 = 1e-2;
/// Starts from which the cause of a failure is sought, for each group of constraints.
const CAUSE_STARTS: usize = 6;

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
                |search, start| search.try_start(seed, start),
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
        Ok(Search::new(&frame).try_start(seed, start))
    }

    /// Gives a test the programme and a random point.
    #[cfg(test)]
    pub(crate) fn with_random_point(
        &self,
        start: usize,
        test: impl FnOnce(&mut crate::program::Program<'_, '_>, &[f64]),
    ) {
        let frame = self.frame().unwrap();
        let mut search = Search::new(&frame);
        let x = search.random(1, start);
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
            .find_map(|start| search.try_start(seed, start))
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
                    |search, start| search.relaxed(group, seed, start),
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
