//! Differential kinematics of a robot that stands on the ground: node velocities from length
//! rates and back, with independent (master) and dependent (slave) actuators.
//!
//! Source: Usevitch et al., equations (4) to (10) and (22). The matrix H = [R; C] stacks the
//! scaled rigidity matrix and the contact rows. Its independent rows are chosen by a pivoted
//! Gram–Schmidt factorisation of Hᵀ (rank revealing: at each step the row with the largest part
//! outside the span of those chosen so far), contact rows first, then preferred actuators, then
//! the others. Cost: O((n_L + contacts)·(d n)²) once; O((d n)²) for each velocity.

use nalgebra::{DMatrix, DVector, Dyn, LU};
use thiserror::Error;

use crate::framework::FrameworkError;
use crate::rigidity::{RowScaling, rigidity_matrix};
use crate::{Dimension, Framework, Rigidity};

/// Rows whose part outside the span of the others is below this are dependent. Rows of H are of
/// unit order.
const DEPENDENCE_TOLERANCE: f64 = 1e-9;

/// How the nodes on the ground are held (the rows of C, C ẋ = 0).
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum GroundContact {
    /// Every coordinate of these nodes is held: feet that do not slide.
    Fixed(Vec<usize>),
    /// The fewest rows that hold the robot: of the d support nodes the first in all coordinates,
    /// the second in height and (in space) one horizontal coordinate, the third in height.
    Minimal(Vec<usize>),
}

impl GroundContact {
    /// The nodes in contact.
    #[must_use]
    pub fn nodes(&self) -> &[usize] {
        match self {
            Self::Fixed(nodes) | Self::Minimal(nodes) => nodes,
        }
    }

    /// The coordinates held, as indices into the coordinate slice: one row of C each.
    fn held_coordinates(&self, framework: &Framework) -> Vec<usize> {
        let axes = framework.dimension().axes();
        let up = axes - 1;
        match self {
            Self::Fixed(nodes) => nodes
                .iter()
                .flat_map(|node| (0..axes).map(move |axis| node * axes + axis))
                .collect(),
            Self::Minimal(nodes) => {
                let mut held = Vec::with_capacity(framework.dimension().rigid_motions());
                for (rank, &node) in nodes.iter().enumerate() {
                    match (rank, framework.dimension()) {
                        (0, _) => held.extend((0..axes).map(|axis| node * axes + axis)),
                        (1, Dimension::Three) => {
                            // The turn about the first node moves the second across the line
                            // between them: hold the coordinate that it moves most.
                            let along = framework.position(node) - framework.position(nodes[0]);
                            let axis = usize::from(along.x.abs() > along.y.abs());
                            held.extend([node * axes + axis, node * axes + up]);
                        }
                        _ => held.push(node * axes + up),
                    }
                }
                held
            }
        }
    }
}

/// Why velocities of a robot cannot be computed.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum KinematicsError {
    /// Positions that do not make a framework.
    #[error(transparent)]
    Framework(#[from] FrameworkError),
    /// A contact node does not exist, or is listed twice.
    #[error(
        "node {node} cannot be a contact: the nodes are numbered 0 to {last}, each listed once"
    )]
    BadContact {
        /// The node.
        node: usize,
        /// The largest node index.
        last: usize,
    },
    /// A minimal contact needs as many nodes as the space has axes.
    #[error("a minimal contact needs {needed} nodes, found {found}")]
    ContactCount {
        /// Number of nodes needed.
        needed: usize,
        /// Number of nodes found.
        found: usize,
    },
    /// The framework can flex without any actuator moving.
    #[error(
        "the robot is not infinitesimally rigid: it has {mechanisms} mechanism(s) that no actuator controls, moving nodes {nodes:?}; add members there or leave the singular configuration"
    )]
    NotRigid {
        /// Number of independent mechanisms.
        mechanisms: usize,
        /// The nodes that they move, the most mobile first.
        nodes: Vec<usize>,
    },
    /// The contact leaves the robot free to move as a rigid body.
    #[error(
        "the contact at nodes {nodes:?} does not hold the robot: {free} rigid motion(s) remain; hold more nodes, not all on one line"
    )]
    NotHeld {
        /// The contact nodes.
        nodes: Vec<usize>,
        /// Number of rigid motions left.
        free: usize,
    },
    /// Length rates that no motion of the nodes produces.
    #[error(
        "the length rates contradict each other: member {member} would have to change at {needed}, not {given}; choose the rates of the independent members and compute the others from them"
    )]
    Inconsistent {
        /// The dependent member with the largest contradiction.
        member: usize,
        /// The rate that follows from the independent members.
        needed: f64,
        /// The rate given.
        given: f64,
    },
    /// A slice does not have the length needed.
    #[error("{what} has {found} entries, {expected} are needed")]
    WrongLength {
        /// The slice concerned.
        what: &'static str,
        /// Length needed.
        expected: usize,
        /// Length found.
        found: usize,
    },
}

/// The linear map between length rates and node velocities at one configuration.
///
/// # Examples
///
/// ```
/// use nalgebra::Point3;
/// use tensegra_lar::{DifferentialKinematics, Framework, Graph, GroundContact};
///
/// let points = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0.3, 0.3, 0.8]];
/// let robot = Framework::in_space(
///     Graph::complete(4)?,
///     &points.map(|[x, y, z]| Point3::new(x, y, z)),
/// )?;
/// let kinematics =
///     DifferentialKinematics::new(&robot, &GroundContact::Minimal(vec![0, 1, 2]), &[])?;
/// // Minimally rigid with a minimal contact: every actuator moves as it likes (proposition 1).
/// assert_eq!(kinematics.independent_members().len(), 6);
/// let velocity = kinematics.node_velocities(&[0.1, 0.0, 0.0, 0.0, 0.0, 0.2])?;
/// let rates = kinematics.length_rates(&velocity)?;
/// assert!((rates[0] - 0.1).abs() < 1e-12 && (rates[5] - 0.2).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct DifferentialKinematics {
    rigidity: DMatrix<f64>,
    held: Vec<usize>,
    independent: Vec<usize>,
    dependent: Vec<usize>,
    factors: LU<f64, Dyn, Dyn>,
    axes: usize,
}

impl DifferentialKinematics {
    /// The kinematics of `framework` standing on `contact`. Members listed in `preferred` are made
    /// independent before any other, as far as they are.
    ///
    /// # Errors
    /// See [`KinematicsError`].
    pub fn new(
        framework: &Framework,
        contact: &GroundContact,
        preferred: &[usize],
    ) -> Result<Self, KinematicsError> {
        let dimension = framework.dimension();
        let nodes = framework.graph().num_nodes();
        for (position, &node) in contact.nodes().iter().enumerate() {
            if node >= nodes || contact.nodes()[..position].contains(&node) {
                return Err(KinematicsError::BadContact {
                    node,
                    last: nodes - 1,
                });
            }
        }
        if let GroundContact::Minimal(list) = contact
            && list.len() != dimension.axes()
        {
            return Err(KinematicsError::ContactCount {
                needed: dimension.axes(),
                found: list.len(),
            });
        }
        let analysis = Rigidity::of(framework);
        if !analysis.is_infinitesimally_rigid() {
            return Err(KinematicsError::NotRigid {
                mechanisms: analysis.num_mechanisms(),
                nodes: analysis.loose_nodes(),
            });
        }

        let size = nodes * dimension.axes();
        let held = contact.held_coordinates(framework);
        let rigidity = rigidity_matrix(framework, RowScaling::UnitLength);
        let mut span = RowSpan::new(size);
        for &coordinate in &held {
            let mut row = DVector::zeros(size);
            row[coordinate] = 1.0;
            span.insert(row);
        }
        let mut independent = Vec::new();
        let (first, second): (Vec<usize>, Vec<usize>) =
            (0..rigidity.nrows()).partition(|member| preferred.contains(member));
        for class in [first, second] {
            independent.extend(span.insert_by_pivoting(&rigidity, class));
        }
        if span.len() < size {
            return Err(KinematicsError::NotHeld {
                nodes: contact.nodes().to_vec(),
                free: size - span.len(),
            });
        }
        independent.sort_unstable();
        let dependent = (0..rigidity.nrows())
            .filter(|member| !independent.contains(member))
            .collect();

        // Contact rows are distinct unit rows, hence independent, and come after the members.
        let master = DMatrix::from_fn(size, size, |row, column| match independent.get(row) {
            Some(&member) => rigidity[(member, column)],
            None => f64::from(u8::from(held[row - independent.len()] == column)),
        });
        Ok(Self {
            rigidity,
            held,
            independent,
            dependent,
            factors: master.lu(),
            axes: dimension.axes(),
        })
    }

    /// The independent actuators (the master group), in rising order: their rates may be chosen
    /// freely.
    #[must_use]
    pub fn independent_members(&self) -> &[usize] {
        &self.independent
    }

    /// The dependent actuators (the slave group), in rising order: their rates follow.
    #[must_use]
    pub fn dependent_members(&self) -> &[usize] {
        &self.dependent
    }

    /// The full matrix H = [R; C] of equation (4), members first.
    #[must_use]
    pub fn matrix(&self) -> DMatrix<f64> {
        let (members, size) = self.rigidity.shape();
        let mut matrix = DMatrix::zeros(members + self.held.len(), size);
        matrix.rows_mut(0, members).copy_from(&self.rigidity);
        for (row, &coordinate) in self.held.iter().enumerate() {
            matrix[(members + row, coordinate)] = 1.0;
        }
        matrix
    }

    /// Node velocities ẋ from the rates of the independent members, in the order of
    /// [`independent_members`](Self::independent_members) (equation (9)).
    ///
    /// # Errors
    /// A slice of the wrong length.
    pub fn node_velocities_from_independent(
        &self,
        rates: &[f64],
    ) -> Result<DVector<f64>, KinematicsError> {
        expect_length(
            "the list of independent rates",
            self.independent.len(),
            rates.len(),
        )?;
        let mut right = DVector::zeros(self.rigidity.ncols());
        right.rows_mut(0, rates.len()).copy_from_slice(rates);
        // The master matrix has full rank: its rows were chosen to be independent.
        let solved = self.factors.solve_mut(&mut right);
        debug_assert!(solved);
        Ok(right)
    }

    /// Rates of the dependent members from those of the independent ones (equation (10)), in the
    /// order of [`dependent_members`](Self::dependent_members).
    ///
    /// # Errors
    /// A slice of the wrong length.
    pub fn dependent_rates(&self, rates: &[f64]) -> Result<Vec<f64>, KinematicsError> {
        let velocity = self.node_velocities_from_independent(rates)?;
        Ok(self
            .dependent
            .iter()
            .map(|&m| self.rigidity.row(m).tr_dot(&velocity))
            .collect())
    }

    /// Node velocities ẋ from the rates of all members (equation (5), or (9) and (10)).
    ///
    /// # Errors
    /// Rates of an over-constrained robot that contradict each other by more than 1e-8 relative
    /// to the largest, or a slice of the wrong length.
    pub fn node_velocities(&self, rates: &[f64]) -> Result<DVector<f64>, KinematicsError> {
        expect_length(
            "the list of length rates",
            self.rigidity.nrows(),
            rates.len(),
        )?;
        let chosen: Vec<f64> = self
            .independent
            .iter()
            .map(|&member| rates[member])
            .collect();
        let velocity = self.node_velocities_from_independent(&chosen)?;
        let scale = rates.iter().fold(0.0_f64, |max, rate| max.max(rate.abs()));
        let worst = self
            .dependent
            .iter()
            .map(|&member| (member, self.rigidity.row(member).tr_dot(&velocity)))
            .max_by(|a, b| {
                (a.1 - rates[a.0])
                    .abs()
                    .total_cmp(&(b.1 - rates[b.0]).abs())
            });
        match worst {
            Some((member, needed)) if (needed - rates[member]).abs() > 1e-8 * scale => {
                Err(KinematicsError::Inconsistent {
                    member,
                    needed,
                    given: rates[member],
                })
            }
            _ => Ok(velocity),
        }
    }

    /// Length rates L̇ = R ẋ of node velocities (equation (3)).
    ///
    /// # Errors
    /// A slice of the wrong length.
    pub fn length_rates(&self, velocity: &DVector<f64>) -> Result<DVector<f64>, KinematicsError> {
        expect_length("the velocity", self.rigidity.ncols(), velocity.len())?;
        Ok(&self.rigidity * velocity)
    }

    /// The d × (number of independent members) matrix M H⁻¹ from the rates of the independent
    /// members to the velocity of the centre of mass (equation (22)), with the mass fraction of
    /// each node.
    ///
    /// # Errors
    /// A list of fractions of the wrong length.
    pub fn centre_of_mass_jacobian(
        &self,
        mass_fractions: &[f64],
    ) -> Result<DMatrix<f64>, KinematicsError> {
        let size = self.rigidity.ncols();
        expect_length("the list of masses", size / self.axes, mass_fractions.len())?;
        let mut columns = DMatrix::zeros(size, self.independent.len());
        columns.fill_with_identity();
        let solved = self.factors.solve_mut(&mut columns);
        debug_assert!(solved);
        let mass = DMatrix::from_fn(self.axes, size, |axis, column| {
            if column % self.axes == axis {
                mass_fractions[column / self.axes]
            } else {
                0.0
            }
        });
        Ok(mass * columns)
    }
}

fn expect_length(what: &'static str, expected: usize, found: usize) -> Result<(), KinematicsError> {
    if expected == found {
        Ok(())
    } else {
        Err(KinematicsError::WrongLength {
            what,
            expected,
            found,
        })
    }
}

/// An orthonormal basis of the span of rows, grown one row at a time.
struct RowSpan {
    basis: Vec<DVector<f64>>,
    size: usize,
}

impl RowSpan {
    fn new(size: usize) -> Self {
        Self {
            basis: Vec::with_capacity(size),
            size,
        }
    }

    fn len(&self) -> usize {
        self.basis.len()
    }

    /// Removes from `row` its part inside the span, twice for orthogonality to rounding.
    fn remove_span(&self, row: &mut DVector<f64>) {
        for _ in 0..2 {
            for direction in &self.basis {
                row.axpy(-direction.dot(row), direction, 1.0);
            }
        }
    }

    /// Adds a row; false when it lies in the span already.
    fn insert(&mut self, mut row: DVector<f64>) -> bool {
        self.remove_span(&mut row);
        let norm = row.norm();
        if norm <= DEPENDENCE_TOLERANCE {
            return false;
        }
        self.basis.push(row / norm);
        true
    }

    /// Adds rows of `matrix` from `candidates`, always the one farthest from the span, until the
    /// rest depends on them; returns those added.
    fn insert_by_pivoting(&mut self, matrix: &DMatrix<f64>, candidates: Vec<usize>) -> Vec<usize> {
        let mut remaining: Vec<(usize, DVector<f64>)> = candidates
            .into_iter()
            .map(|row| (row, matrix.row(row).transpose()))
            .map(|(index, mut row)| {
                self.remove_span(&mut row);
                (index, row)
            })
            .collect();
        let mut added = Vec::new();
        while self.len() < self.size {
            let farthest = (0..remaining.len())
                .max_by(|&a, &b| remaining[a].1.norm().total_cmp(&remaining[b].1.norm()));
            let Some(farthest) = farthest else { break };
            let (index, row) = remaining.swap_remove(farthest);
            if !self.insert(row) {
                break;
            }
            added.push(index);
            let newest = &self.basis[self.basis.len() - 1];
            for (_, row) in &mut remaining {
                row.axpy(-newest.dot(row), newest, 1.0);
            }
        }
        added
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;
    use crate::Graph;

    fn k5() -> Framework {
        let points = [
            [-0.9, 0.0, 0.0],
            [0.0, -0.5, 0.0],
            [0.0, 0.5, 0.0],
            [-0.3, 0.05, 0.2],
            [-0.25, 0.0, 0.8],
        ];
        Framework::in_space(
            Graph::complete(5).unwrap(),
            &points.map(|[x, y, z]| Point3::new(x, y, z)),
        )
        .unwrap()
    }

    #[test]
    fn feet_that_do_not_slide_make_the_base_members_dependent() {
        let contact = GroundContact::Fixed(vec![0, 1, 2]);
        let kinematics = DifferentialKinematics::new(&k5(), &contact, &[9]).unwrap();
        assert_eq!(kinematics.independent_members().len(), 6);
        for base in [0, 1, 4] {
            assert!(kinematics.dependent_members().contains(&base));
        }
        assert!(kinematics.independent_members().contains(&9), "preferred");
        assert_eq!(kinematics.matrix().shape(), (19, 15));

        let rates = [0.1, -0.2, 0.05, 0.3, 0.0, 0.15];
        let velocity = kinematics.node_velocities_from_independent(&rates).unwrap();
        assert!(velocity.rows(0, 9).norm() < 1e-12, "the feet stand still");
        let all = kinematics.length_rates(&velocity).unwrap();
        for (rate, &member) in rates.iter().zip(kinematics.independent_members()) {
            assert!((all[member] - rate).abs() < 1e-12);
        }
        let dependent = kinematics.dependent_rates(&rates).unwrap();
        for (rate, &member) in dependent.iter().zip(kinematics.dependent_members()) {
            assert!((all[member] - rate).abs() < 1e-12);
        }
        let again = kinematics.node_velocities(all.as_slice()).unwrap();
        assert!((again - velocity).norm() < 1e-10);
    }

    #[test]
    fn contradicting_rates_name_a_member() {
        let contact = GroundContact::Minimal(vec![0, 1, 2]);
        let kinematics = DifferentialKinematics::new(&k5(), &contact, &[]).unwrap();
        assert_eq!(kinematics.dependent_members().len(), 1);
        let mut rates = vec![0.0; 10];
        rates[kinematics.dependent_members()[0]] = 1.0;
        let error = kinematics.node_velocities(&rates).unwrap_err();
        let member = kinematics.dependent_members()[0];
        assert!(
            matches!(error, KinematicsError::Inconsistent { member: m, .. } if m == member),
            "{error}"
        );
    }

    #[test]
    fn the_centre_of_mass_moves_as_its_jacobian_says() {
        let contact = GroundContact::Minimal(vec![0, 1, 2]);
        let kinematics = DifferentialKinematics::new(&k5(), &contact, &[]).unwrap();
        let jacobian = kinematics.centre_of_mass_jacobian(&[0.2; 5]).unwrap();
        let rates: Vec<f64> = (0..9).map(|k| 0.1 * f64::from(k) - 0.3).collect();
        let velocity = kinematics.node_velocities_from_independent(&rates).unwrap();
        let moved = jacobian * DVector::from_vec(rates);
        for axis in 0..3 {
            let mean: f64 = (0..5).map(|node| 0.2 * velocity[3 * node + axis]).sum();
            assert!((mean - moved[axis]).abs() < 1e-12);
        }
    }

    #[test]
    fn singular_robots_and_weak_contacts_are_refused_by_name() {
        let contact = GroundContact::Minimal(vec![0, 1, 2]);
        let square = Graph::new(4, [[0, 1], [1, 2], [2, 3], [3, 0]]).unwrap();
        let flat = Framework::new(
            square,
            Dimension::Two,
            vec![0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0, 1.0],
        )
        .unwrap();
        let error = DifferentialKinematics::new(&flat, &GroundContact::Minimal(vec![0, 1]), &[])
            .unwrap_err();
        assert!(
            matches!(error, KinematicsError::NotRigid { mechanisms: 1, .. }),
            "{error}"
        );

        let two = GroundContact::Fixed(vec![1, 2]);
        let error = DifferentialKinematics::new(&k5(), &two, &[]).unwrap_err();
        assert!(
            matches!(error, KinematicsError::NotHeld { free: 1, .. }),
            "{error}"
        );
        let error = DifferentialKinematics::new(&k5(), &contact, &[])
            .unwrap()
            .node_velocities(&[0.0; 3])
            .unwrap_err();
        assert!(matches!(
            error,
            KinematicsError::WrongLength {
                expected: 10,
                found: 3,
                ..
            }
        ));
        let error =
            DifferentialKinematics::new(&k5(), &GroundContact::Fixed(vec![0, 0]), &[]).unwrap_err();
        assert!(matches!(error, KinematicsError::BadContact { node: 0, .. }));
    }
}
