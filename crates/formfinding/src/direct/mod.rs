//! Direct form-finding: from rest lengths to node positions.
//!
//! Minimises the potential energy
//! ```text
//! E(x) = Σ ½ k (l − r)² − Σ pᵀ x   over elastic elements and loads,
//! subject to l = L for every element of constant length,
//! ```
//! where cables and springs pull and never push: they contribute where l > r only.
//! Elements without a law whose length a motor changes keep the length they start with.
//! What is held (supports, fixed coordinates) does not move.
//!
//! # Method
//! Newton's method on the Lagrangian, with the exact Hessian (the tangent
//! stiffness, see [`tensegra_model::statics`]). Neutral motions of the whole are
//! made stiff, which leaves the Newton step as it is; constraint directions too.
//! Where the Hessian is not positive definite, as with slack cables or far from
//! equilibrium, a multiple of the identity is added, adapted to how well the
//! energy was predicted (a trust region in the form of Levenberg and Marquardt).
//! Saddles are left along the direction of the most negative curvature. So the
//! result is a minimum, or close to singular; which one of several minima depends
//! on the start.
//!
//! # Cost
//! An iteration costs a Cholesky factorisation, n³/3 for n free coordinates; from
//! nearby some five are needed. The smallest eigenvalue at the end costs some
//! 4 n³/3 once. Memory is kept between solves.

mod energy;
mod newton;

use nalgebra::{DMatrix, Point3, Vector3};
use tensegra_model::{Configuration, ForceLaw, Structure, statics::Freedoms};

use crate::alignment;
use energy::Energy;
use newton::{Curvature, Newton};

/// How direct form-finding goes about it.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct DirectOptions {
    /// Newton iterations after which it is given up. Default 500.
    pub max_iterations: usize,
    /// Largest unbalanced force, relative to the largest force. Default 1e-12.
    pub tolerance: f64,
    /// Let cables and springs push as well as pull, as a linear model would.
    /// Default no.
    pub pushing_cables: bool,
}

impl Default for DirectOptions {
    fn default() -> Self {
        Self {
            max_iterations: 500,
            tolerance: 1e-12,
            pushing_cables: false,
        }
    }
}

/// A configuration in equilibrium, found from rest lengths.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct DirectForm {
    /// The configuration. A slack cable has force 0, whatever its rest length.
    pub configuration: Configuration,
    /// Elements that could only pull and hang slack.
    pub slack: Vec<usize>,
    /// Largest unbalanced force at a node, in units of force.
    pub residual: f64,
    /// Potential energy, in force times length.
    pub energy: f64,
    /// Smallest eigenvalue of the tangent stiffness, motors holding rest lengths, on
    /// the motions that keep constant lengths and are not neutral, in force per
    /// length; none where nothing can move. Couplings are not held: they say what
    /// motors are told, not what the structure does.
    pub least_stiffness: Option<f64>,
    /// The largest such eigenvalue: what the smallest is compared with.
    pub largest_stiffness: f64,
    /// Newton iterations.
    pub iterations: usize,
}

/// A stiffness below this fraction of the largest is none.
const NO_STIFFNESS: f64 = 1e-9;
/// A constant length that misses by this multiple of what would be converged is not
/// met for a reason.
const VIOLATED: f64 = 1e4;
/// Saddles that are left before one is taken as the result.
const ESCAPES: usize = 8;

impl DirectForm {
    /// Whether the equilibrium is a strict minimum of the energy.
    pub fn is_stable(&self) -> bool {
        self.least_stiffness
            .is_none_or(|least| least > NO_STIFFNESS * self.largest_stiffness)
    }
}

/// Why direct form-finding found nothing.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DirectError {
    /// There is not one value for each of what is there.
    #[error("{given} {what} are given, but there are {expected}")]
    WrongCount {
        /// What is counted.
        what: &'static str,
        /// How many are given.
        given: usize,
        /// How many there are.
        expected: usize,
    },
    /// A start that is not finite.
    #[error("node `{node}` starts at a coordinate that is not finite")]
    BadStart {
        /// The node.
        node: String,
    },
    /// An actuated element without a rest length.
    #[error("no rest length is given for `{element}`, which is actuated: give one")]
    MissingRest {
        /// The element.
        element: String,
    },
    /// A rest length that is no length.
    #[error("the rest length of `{element}` is {value}: it must be finite and not negative")]
    BadRest {
        /// The element.
        element: String,
        /// What was given.
        value: f64,
    },
    /// An element of constant length that starts without one.
    #[error(
        "`{element}` starts without length: its nodes are at one point, so it has no direction"
    )]
    NoLength {
        /// The element.
        element: String,
    },
    /// Loads that nothing can hold.
    #[error(
        "the loads sum to {sum:.3e} along {axis} and no support takes it: no prestress can carry \
         that; add a support or balance the loads"
    )]
    UnbalancedLoads {
        /// The axis with the largest sum.
        axis: char,
        /// The sum of the loads along it.
        sum: f64,
    },
    /// The structure flew apart.
    #[error(
        "there is no equilibrium with these rest lengths: the energy has no lower bound, `{node}` \
         runs away"
    )]
    Unbounded {
        /// The node that is farthest away.
        node: String,
    },
    /// The constant lengths cannot be met together.
    #[error(
        "the constant lengths cannot be met together: `{element}` misses its length by \
         {violation:.3e} at best"
    )]
    IncompatibleLengths {
        /// The element that misses the most.
        element: String,
        /// By how much.
        violation: f64,
    },
    /// No convergence.
    #[error(
        "no equilibrium after {iterations} iterations: {force:.3e} is unbalanced at `{node}`, more \
         than {allowed:.1e}"
    )]
    NotConverged {
        /// Iterations made.
        iterations: usize,
        /// The node with the largest unbalanced force.
        node: String,
        /// That force.
        force: f64,
        /// What would be allowed.
        allowed: f64,
    },
}

/// Finds configurations of one structure from rest lengths; keeps its memory
/// between solves.
///
/// # Examples
/// Two cables of stiffness 1 hold a node between supports 4 apart; with rest
/// lengths 1 and 2 each stretches by 1/2:
/// ```
/// use nalgebra::Point3;
/// use tensegra_formfinding::DirectSolver;
/// use tensegra_model::StructureBuilder;
///
/// let structure = StructureBuilder::planar()
///     .cable("left", ["a", "b"], 0.0..=9.0, 1.0, 0.0..=2.0)
///     .cable("right", ["b", "c"], 0.0..=9.0, 1.0, 0.0..=2.0)
///     .support("a")
///     .support("c")
///     .build()?;
/// let start = [[0.0, 0.0], [1.0, 0.5], [4.0, 0.0]].map(|[x, y]| Point3::new(x, y, 0.0));
/// let form = DirectSolver::new(&structure).solve(&start, &[Some(1.0), Some(2.0)])?;
/// assert!((form.configuration.positions[1] - Point3::new(1.5, 0.0, 0.0)).norm() < 1e-12);
/// assert!(form.is_stable());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct DirectSolver<'a> {
    structure: &'a Structure,
    options: DirectOptions,
    /// With fixed coordinates held, to find the equilibrium.
    held: View,
    /// With supports alone held, to judge it, where that is not the same: a fixed
    /// coordinate is no support, and how it is fixed says nothing of stability.
    floating: Option<View>,
}

/// The structure with some coordinates held.
struct View {
    freedoms: Freedoms,
    energy: Energy,
    newton: Newton,
}

impl View {
    fn new(
        structure: &Structure,
        freedoms: Freedoms,
        pushing_cables: bool,
        absent: &[usize],
    ) -> Self {
        let energy = Energy::new(structure, &freedoms, pushing_cables, absent);
        let newton = Newton::new(freedoms.len(), energy.constraint_count());
        Self {
            freedoms,
            energy,
            newton,
        }
    }

    /// Neutral motions of the whole where the energy stands.
    fn neutral(&self, structure: &Structure) -> DMatrix<f64> {
        self.freedoms
            .neutral_motions(structure, self.energy.positions())
    }

    fn curvature(&mut self, neutral: &DMatrix<f64>) -> Curvature {
        self.newton.curvature(&mut self.energy, neutral)
    }
}

impl<'a> DirectSolver<'a> {
    /// A solver with default options. Supports stay where a start puts them, and
    /// so do fixed coordinates.
    pub fn new(structure: &'a Structure) -> Self {
        Self::with_options(structure, DirectOptions::default())
    }

    /// A solver with options.
    pub fn with_options(structure: &'a Structure, options: DirectOptions) -> Self {
        Self::without(structure, options, &[])
    }

    /// A solver for the structure as it is when some elements are taken out.
    pub fn without(structure: &'a Structure, options: DirectOptions, absent: &[usize]) -> Self {
        let mut fixed = vec![[false; 3]; structure.nodes.len()];
        for coordinate in &structure.fixed {
            fixed[coordinate.node][coordinate.axis] = true;
        }
        let freedoms = Freedoms::with(structure, |node, axis| {
            structure.nodes[node].balanced && !fixed[node][axis]
        });
        let view = |freedoms| View::new(structure, freedoms, options.pushing_cables, absent);
        let floating = Freedoms::new(structure);
        Self {
            structure,
            held: view(freedoms.clone()),
            floating: (floating != freedoms).then(|| view(floating)),
            options,
        }
    }

    /// Finds the equilibrium that the structure settles in from `start`, one
    /// position for each node, with one rest length for each element: none for
    /// elements of constant length, optional where the rest length is constant.
    ///
    /// # Errors
    /// [`DirectError`] for bad input, and where no equilibrium is found.
    pub fn solve(
        &mut self,
        start: &[Point3<f64>],
        rest_lengths: &[Option<f64>],
    ) -> Result<DirectForm, DirectError> {
        let start = self.prepare(start, rest_lengths)?;
        let structure = self.structure;
        let view = &mut self.held;
        view.energy.set_positions(&start);
        let mut iterations = 0;
        let mut escapes = 0;
        let (neutral, mut curvature) = loop {
            let neutral = view.neutral(structure);
            iterations += view
                .newton
                .minimise(&mut view.energy, &neutral, &self.options)
                .map_err(|failure| explain(structure, view, failure))?;
            // They have moved with the structure.
            let neutral = view.neutral(structure);
            let curvature = view.curvature(&neutral);
            let saddle = curvature
                .least
                .is_some_and(|least| least < -NO_STIFFNESS * curvature.largest);
            if !saddle || escapes == ESCAPES {
                break (neutral, curvature);
            }
            escapes += 1;
            view.newton.escape(&mut view.energy, &neutral);
        };
        if let Some(floating) = &mut self.floating {
            floating.energy.set_positions(view.energy.positions());
            let neutral = floating.neutral(structure);
            curvature = floating.curvature(&neutral);
        }
        let energy = &self.held.energy;
        let mut positions = energy.positions().to_vec();
        if self.is_free(&neutral) {
            let loaded = |points: &[Point3<f64>]| -> Vec<Point3<f64>> {
                let all = points.iter().enumerate();
                all.filter(|(node, _)| self.held.freedoms.is_loaded(*node))
                    .map(|(_, point)| *point)
                    .collect()
            };
            let planar = self.structure.dimension == 2;
            let back = alignment(&loaded(&positions), &loaded(&start), planar);
            positions
                .iter_mut()
                .for_each(|point| *point = back * *point);
        }
        self.follow(&start, &mut positions);
        let configuration = energy.configuration(structure, positions);
        let residual = energy.unbalanced(structure, &configuration).1;
        Ok(DirectForm {
            slack: energy.slack(),
            residual,
            energy: energy.value(),
            least_stiffness: curvature.least,
            largest_stiffness: curvature.largest,
            iterations,
            configuration,
        })
    }

    /// Refuses bad input; the start with everything fixed in its place.
    fn prepare(
        &mut self,
        start: &[Point3<f64>],
        rest_lengths: &[Option<f64>],
    ) -> Result<Vec<Point3<f64>>, DirectError> {
        let structure = self.structure;
        let count = |what, given, expected| match given == expected {
            true => Ok(()),
            false => Err(DirectError::WrongCount {
                what,
                given,
                expected,
            }),
        };
        count("positions", start.len(), structure.nodes.len())?;
        count("rest lengths", rest_lengths.len(), structure.elements.len())?;
        let mut start = start.to_vec();
        for fixed in &structure.fixed {
            start[fixed.node][fixed.axis] = fixed.value;
        }
        for (node, position) in structure.nodes.iter().zip(&mut start) {
            if structure.dimension == 2 {
                position.z = 0.0;
            }
            if !position.iter().all(|coordinate| coordinate.is_finite()) {
                let node = node.name.clone();
                return Err(DirectError::BadStart { node });
            }
        }
        for (e, (element, &given)) in structure.elements.iter().zip(rest_lengths).enumerate() {
            let name = || element.name.clone();
            match element.law {
                ForceLaw::None => {}
                ForceLaw::Free => {
                    let [a, b] = element.nodes;
                    let length = (start[b] - start[a]).norm();
                    if length == 0.0 {
                        return Err(DirectError::NoLength { element: name() });
                    }
                    if !element.has_constant_length() {
                        // Its motor holds the length that it starts with.
                        for view in [Some(&mut self.held), self.floating.as_mut()]
                            .into_iter()
                            .flatten()
                        {
                            view.energy.set_constant_length(e, length);
                        }
                    }
                }
                ForceLaw::Linear { rest, .. } => {
                    let value = given.or(rest.is_constant().then_some(rest.lo));
                    let Some(value) = value else {
                        return Err(DirectError::MissingRest { element: name() });
                    };
                    if !(value.is_finite() && value >= 0.0) {
                        return Err(DirectError::BadRest {
                            element: name(),
                            value,
                        });
                    }
                    self.held.energy.set_rest_length(e, value);
                    if let Some(floating) = &mut self.floating {
                        floating.energy.set_rest_length(e, value);
                    }
                }
            }
        }
        if structure.nodes.iter().all(|node| node.balanced) {
            let sum: Vector3<f64> = structure.nodes.iter().map(|node| node.load).sum();
            let all: f64 = structure.nodes.iter().map(|node| node.load.norm()).sum();
            let axis = sum.iamax();
            if sum[axis].abs() > 1e-12 * all {
                return Err(DirectError::UnbalancedLoads {
                    axis: ['x', 'y', 'z'][axis],
                    sum: sum[axis],
                });
            }
        }
        Ok(start)
    }

    /// Whether the structure floats: no coordinate is held, no load has a direction.
    fn is_free(&self, neutral: &DMatrix<f64>) -> bool {
        let full = match self.structure.dimension {
            2 => 3,
            _ => 6,
        };
        neutral.ncols() == full
    }

    /// Lets nodes that no force reaches follow: each moves with the others as one
    /// body as far as that can be, then to where its constant lengths and coupled
    /// directions put it.
    fn follow(&self, start: &[Point3<f64>], positions: &mut [Point3<f64>]) {
        let followers: Vec<usize> = (0..positions.len())
            .filter(|&node| !self.held.freedoms.is_loaded(node))
            .collect();
        if !followers.is_empty() {
            crate::followers::place(self.structure, &followers, start, positions);
        }
    }
}

/// Puts a failure where the energy stands in terms of the structure.
fn explain(structure: &Structure, view: &View, failure: newton::Failure) -> DirectError {
    let energy = &view.energy;
    match failure {
        newton::Failure::Unbounded => {
            let origin = energy.positions()[0];
            let far = |node: usize| (energy.positions()[node] - origin).norm();
            let farthest = (0..structure.nodes.len())
                .filter(|&node| view.freedoms.is_loaded(node))
                .max_by(|&a, &b| far(a).total_cmp(&far(b)));
            DirectError::Unbounded {
                node: structure.nodes[farthest.unwrap_or(0)].name.clone(),
            }
        }
        newton::Failure::NotConverged {
            iterations,
            allowed,
        } => {
            if let Some((element, violation)) = energy.worst_length()
                && violation > VIOLATED * allowed.length
            {
                return DirectError::IncompatibleLengths {
                    element: structure.elements[element].name.clone(),
                    violation,
                };
            }
            let configuration = energy.configuration(structure, energy.positions().to_vec());
            let (node, force) = energy.unbalanced(structure, &configuration);
            DirectError::NotConverged {
                iterations,
                node: structure.nodes[node].name.clone(),
                force,
                allowed: allowed.force,
            }
        }
    }
}
