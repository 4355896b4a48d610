//! The forces that balance at given positions, as a particular solution and a
//! basis, with the range of each.

use nalgebra::{DMatrix, DVector, Point3};
use tensegra_model::{
    Configuration, Coupling, Element, ForceLaw, Interval, Structure, statics::EquilibriumMatrix,
};
use tensegra_optim::{DenseQp, DenseQpSolver, QpConstraint, QpStatus};

use super::{InverseError, InverseOptions};

/// Prestress that is spread where neither a pretension nor wanted rest lengths say
/// how much: it strains the softest element by this.
const STRAIN: f64 = 0.05;
/// Least tension of what can only pull, relative to the spread prestress.
const LEAST_TENSION: f64 = 1e-3;
/// Programmes after which the pretension is given up.
const MAX_PROGRAMMES: usize = 100;
/// Relative accuracy of the pretension.
const PRETENSION_TOLERANCE: f64 = 1e-12;
/// Weight of the forces against the violation of their ranges.
const REGULARISATION: f64 = 1e-9;

pub(super) struct Balance {
    lengths: Vec<f64>,
    /// Elements whose forces are unknown.
    unknown: Vec<usize>,
    /// Forces that lengths determine.
    known: Vec<Option<f64>>,
    /// Unknown forces are `particular + basis · c`: the basis is orthonormal, and
    /// the particular ones are orthogonal to it.
    particular: DVector<f64>,
    basis: DMatrix<f64>,
    /// Admissible unknown forces.
    ranges: Vec<Interval>,
    /// Forces to stay near.
    target: DVector<f64>,
}

/// Equations E t = b for the unknown forces, row by row.
struct Equations<'a> {
    structure: &'a Structure,
    lengths: &'a [f64],
    known: &'a [Option<f64>],
    unknown: &'a [usize],
    rows: Vec<(Vec<f64>, f64)>,
    /// The element that each row after those of balance is about.
    followers: Vec<usize>,
}

impl Balance {
    pub(super) fn new(
        structure: &Structure,
        positions: &[Point3<f64>],
        options: &InverseOptions,
    ) -> Result<Self, InverseError> {
        let matrix = EquilibriumMatrix::new(structure, positions)?;
        let lengths: Vec<f64> = structure
            .elements
            .iter()
            .map(|element| {
                let [a, b] = element.nodes;
                (positions[b] - positions[a]).norm()
            })
            .collect();
        check_lengths(structure, &lengths, options.tolerance)?;
        let known: Vec<Option<f64>> = structure
            .elements
            .iter()
            .zip(&lengths)
            .map(|(element, length)| known_force(element, *length))
            .collect();
        let unknown: Vec<usize> = matrix
            .elements()
            .iter()
            .copied()
            .filter(|&e| known[e].is_none())
            .collect();

        let mut equations = Equations {
            structure,
            lengths: &lengths,
            known: &known,
            unknown: &unknown,
            rows: Vec::new(),
            followers: Vec::new(),
        };
        equations.balance(&matrix);
        equations.couplings();
        let (particular, basis, smallest) = equations.solve(options.tolerance);
        equations.judge(&matrix, &particular, options.tolerance)?;
        let loaded = structure.nodes.iter().any(|node| node.load.norm() > 0.0);
        if unknown.len() == matrix.elements().len() && !loaded && basis.ncols() == 0 {
            return Err(InverseError::NoSelfStress { smallest });
        }

        let spread = spread_prestress(structure, &lengths, &unknown);
        let least = options.least_tension.unwrap_or(LEAST_TENSION * spread);
        let element = |&e: &usize| &structure.elements[e];
        let ranges = unknown
            .iter()
            .map(|e| admissible_forces(element(e), lengths[*e], least))
            .collect();
        let target = unknown.iter().map(|&e| {
            let element = &structure.elements[e];
            let wanted = options.wanted_rest_lengths.get(e).copied().flatten();
            match (wanted, element.stiffness()) {
                (Some(rest), Some(stiffness)) => stiffness * (lengths[e] - rest),
                _ if element.pulls_only() || element.force.lo >= 0.0 => spread,
                _ if element.force.hi <= 0.0 => -spread,
                _ => 0.0,
            }
        });
        let target = DVector::from_iterator(unknown.len(), target);
        let balance = Self {
            lengths,
            unknown,
            known,
            particular,
            basis,
            ranges,
            target,
        };
        balance.check_known(structure, options.tolerance)?;
        Ok(balance)
    }

    /// Dimension of the set of forces that balance.
    pub(super) fn choices(&self) -> usize {
        self.basis.ncols()
    }

    /// Refuses known forces outside of their ranges.
    fn check_known(&self, structure: &Structure, tolerance: f64) -> Result<(), InverseError> {
        let scale = self
            .known
            .iter()
            .flatten()
            .fold(0.0_f64, |l, f| l.max(f.abs()));
        for (element, force) in structure.elements.iter().zip(&self.known) {
            let violation = force.map_or(0.0, |force| -element.force.margin(force));
            if violation > tolerance * scale {
                return Err(InverseError::OutOfRange {
                    elements: vec![element.name.clone()],
                    worst: element.name.clone(),
                    violation,
                });
            }
        }
        Ok(())
    }

    /// The unknown forces nearest to the target that keep their ranges and have the
    /// pretension, where there is one.
    pub(super) fn solve(&self, structure: &Structure) -> Result<DVector<f64>, InverseError> {
        let first = self.nearest(None).ok_or_else(|| self.explain(structure))?;
        let Some(pretension) = structure.pretension else {
            return Ok(self.forces(&first));
        };
        // The basis is orthonormal and orthogonal to the rest: a sphere for c.
        let given: f64 = self.known.iter().flatten().map(|f| f * f).sum();
        let given = given + self.particular.norm_squared();
        let failed = |reached: f64| InverseError::Pretension {
            pretension,
            reached,
        };
        let square = pretension * pretension - given;
        if square < 0.0 || first.is_empty() {
            let exact = square.abs() <= PRETENSION_TOLERANCE * pretension * pretension;
            return match exact {
                true => Ok(self.forces(&first)),
                false => Err(failed(given.sqrt())),
            };
        }
        let radius = square.sqrt();
        let mut c = first;
        for _ in 0..MAX_PROGRAMMES {
            // The tangent plane of the sphere, at the point below c.
            let normal = c
                .try_normalize(0.0)
                .unwrap_or_else(|| DVector::from_fn(c.len(), |i, _| f64::from(u8::from(i == 0))));
            let reached = (given + c.norm_squared()).sqrt();
            c = self
                .nearest(Some((&normal, radius)))
                .ok_or_else(|| failed(reached))?;
            if (c.norm() - radius).abs() <= PRETENSION_TOLERANCE * pretension {
                return Ok(self.forces(&c));
            }
        }
        Err(failed((given + c.norm_squared()).sqrt()))
    }

    fn forces(&self, c: &DVector<f64>) -> DVector<f64> {
        &self.particular + &self.basis * c
    }

    /// The c nearest to the target that keeps all ranges and, with a plane, lies on
    /// it.
    fn nearest(&self, plane: Option<(&DVector<f64>, f64)>) -> Option<DVector<f64>> {
        let n = self.choices();
        if n == 0 {
            let inside = self.ranges.iter().zip(self.particular.iter());
            let slack = 1e-9 * self.particular.amax();
            return inside
                .map(|(range, &force)| range.margin(force))
                .all(|margin| margin >= -slack)
                .then(|| DVector::zeros(0));
        }
        let mut programme = DenseQp::new(n);
        let pull = self.basis.tr_mul(&(&self.target - &self.particular));
        for i in 0..n {
            programme.set_hessian(i, i, 1.0);
            programme.gradient_mut()[i] = -pull[i];
        }
        if let Some((normal, offset)) = plane {
            programme.push_equality(normal.as_slice(), offset);
        }
        for (i, range) in self.ranges.iter().enumerate() {
            let row: Vec<f64> = self.basis.row(i).iter().copied().collect();
            let shift = self.particular[i];
            programme.push_range(&row, range.lo - shift, range.hi - shift);
        }
        let mut solver = DenseQpSolver::new();
        let report = solver.solve(&programme).ok()?;
        (report.status == QpStatus::Solved).then(|| DVector::from_column_slice(solver.solution()))
    }

    /// Which ranges contradict one another, and by how much at best.
    fn explain(&self, structure: &Structure) -> InverseError {
        let n = self.choices();
        // All ranges are widened by one amount, as small as can be.
        let mut programme = DenseQp::new(n + 1);
        for i in 0..n {
            programme.set_hessian(i, i, REGULARISATION);
        }
        programme.set_hessian(n, n, 1.0);
        programme.set_bounds(n, 0.0, f64::INFINITY);
        let mut owners = Vec::new();
        for (i, range) in self.ranges.iter().enumerate() {
            let shift = self.particular[i];
            for (bound, sign) in [(range.lo, 1.0), (range.hi, -1.0)] {
                if bound.is_finite() {
                    let mut row: Vec<f64> = self.basis.row(i).iter().map(|b| sign * b).collect();
                    row.push(1.0);
                    programme.push_at_least(&row, sign * (bound - shift));
                    owners.push(i);
                }
            }
        }
        let mut solver = DenseQpSolver::new();
        let solved = solver
            .solve(&programme)
            .is_ok_and(|report| report.status == QpStatus::Solved);
        let solution = if solved { solver.solution() } else { &[] };
        let c = DVector::from_fn(n, |i, _| solution.get(i).copied().unwrap_or(0.0));
        let forces = self.forces(&c);
        let violations = self.ranges.iter().zip(forces.iter());
        let violation = |(range, &force): (&Interval, &f64)| (-range.margin(force)).max(0.0);
        let violations: Vec<f64> = violations.map(violation).collect();
        let worst = (0..violations.len())
            .max_by(|&a, &b| violations[a].total_cmp(&violations[b]))
            .unwrap_or(0);
        // Those that hold the violation up.
        let active = solver
            .active_set()
            .iter()
            .filter_map(|active| match active.constraint {
                QpConstraint::Row(row) => owners.get(row).copied(),
                QpConstraint::Bound(_) => None,
            });
        let mut elements: Vec<usize> = active.map(|i| self.unknown[i]).collect();
        elements.push(self.unknown[worst]);
        elements.sort_unstable();
        elements.dedup();
        let name = |e: usize| structure.elements[e].name.clone();
        InverseError::OutOfRange {
            elements: elements.into_iter().map(name).collect(),
            worst: name(self.unknown[worst]),
            violation: violations[worst],
        }
    }

    /// The configuration with these unknown forces.
    pub(super) fn configuration(
        &self,
        structure: &Structure,
        positions: &[Point3<f64>],
        forces: &DVector<f64>,
    ) -> Configuration {
        let mut all = self.known.clone();
        for (&e, &force) in self.unknown.iter().zip(forces.iter()) {
            all[e] = Some(force);
        }
        let rest = |e: usize| match structure.elements[e].law {
            ForceLaw::Linear { rest, .. } if rest.is_constant() => Some(rest.lo),
            ForceLaw::Linear { stiffness, .. } => {
                all[e].map(|force| self.lengths[e] - force / stiffness)
            }
            _ => None,
        };
        Configuration {
            positions: positions.to_vec(),
            lengths: self.lengths.clone(),
            rest_lengths: (0..all.len()).map(rest).collect(),
            forces: all,
        }
    }
}

impl Equations<'_> {
    /// A t + p = 0.
    fn balance(&mut self, matrix: &EquilibriumMatrix) {
        let loads = matrix.loads(self.structure);
        for (row, load) in matrix.matrix().row_iter().zip(loads.iter()) {
            let mut terms: Vec<(usize, f64)> = Vec::new();
            for (&e, &entry) in matrix.elements().iter().zip(row.iter()) {
                if entry != 0.0 {
                    terms.push((e, entry));
                }
            }
            self.push(&terms, -load);
        }
    }

    /// Couplings of forces and of rest lengths, the latter as forces.
    fn couplings(&mut self) {
        let structure = self.structure;
        for coupling in &structure.couplings {
            match coupling {
                Coupling::Force {
                    reference,
                    followers,
                } => {
                    for &(follower, scale) in followers {
                        self.follow(follower, &[(*reference, 1.0), (follower, -scale)], 0.0);
                    }
                }
                Coupling::Rest {
                    reference,
                    followers,
                } => {
                    // r = l − t / k: t/k − s t'/k' = l − s l'.
                    for &(follower, scale) in followers {
                        let both =
                            [*reference, follower].map(|e| structure.elements[e].stiffness());
                        let [Some(k), Some(other)] = both else {
                            continue;
                        };
                        let terms = [(*reference, 1.0), (follower, -scale * k / other)];
                        let right = k * (self.lengths[*reference] - scale * self.lengths[follower]);
                        self.follow(follower, &terms, right);
                    }
                }
                Coupling::Length { .. } | Coupling::Orientation { .. } => {}
            }
        }
    }

    fn follow(&mut self, follower: usize, terms: &[(usize, f64)], right: f64) {
        if terms.iter().any(|(e, _)| self.unknown.contains(e)) {
            let norm = terms.iter().map(|(_, f)| f * f).sum::<f64>().sqrt();
            let scaled: Vec<_> = terms.iter().map(|&(e, f)| (e, f / norm)).collect();
            self.push(&scaled, right / norm);
            self.followers.push(follower);
        }
    }

    fn push(&mut self, terms: &[(usize, f64)], mut right: f64) {
        let mut row = vec![0.0; self.unknown.len()];
        for &(e, factor) in terms {
            match self.known[e] {
                Some(force) => right -= factor * force,
                None => {
                    if let Some(column) = self.unknown.iter().position(|&u| u == e) {
                        row[column] += factor;
                    }
                }
            }
        }
        self.rows.push((row, right));
    }

    /// A particular solution by least squares, the null space, and the smallest
    /// singular value relative to the largest.
    fn solve(&self, tolerance: f64) -> (DVector<f64>, DMatrix<f64>, f64) {
        let n = self.unknown.len();
        if n == 0 {
            return (DVector::zeros(0), DMatrix::zeros(0, 0), 0.0);
        }
        // Padded with rows of zeros, so that all right singular vectors are found.
        let rows = self.rows.len().max(n);
        let matrix = DMatrix::from_fn(rows, n, |i, j| self.rows.get(i).map_or(0.0, |r| r.0[j]));
        let right = DVector::from_fn(rows, |i, _| self.rows.get(i).map_or(0.0, |r| r.1));
        let svd = matrix.svd(true, true);
        let (u, v_t) = (svd.u.unwrap_or_default(), svd.v_t.unwrap_or_default());
        let values = svd.singular_values;
        let largest = values.amax();
        let mut particular = DVector::zeros(n);
        let mut null = Vec::new();
        for (i, &value) in values.iter().enumerate() {
            let vector = v_t.row(i).transpose();
            if value > tolerance * largest {
                particular += vector * (u.column(i).dot(&right) / value);
            } else {
                null.push(vector);
            }
        }
        let basis = DMatrix::from_fn(n, null.len(), |i, j| null[j][i]);
        (particular, basis, values.min() / largest)
    }

    /// Refuses a particular solution that leaves too much over.
    fn judge(
        &self,
        matrix: &EquilibriumMatrix,
        particular: &DVector<f64>,
        tolerance: f64,
    ) -> Result<(), InverseError> {
        let structure = self.structure;
        let load = structure
            .nodes
            .iter()
            .fold(0.0_f64, |l, node| l.max(node.load.norm()));
        let known = self
            .known
            .iter()
            .flatten()
            .fold(0.0_f64, |l, f| l.max(f.abs()));
        let scale = if particular.is_empty() {
            0.0
        } else {
            particular.amax()
        };
        let allowed = tolerance * scale.max(load).max(known);
        let left_over = |(row, right): &(Vec<f64>, f64)| {
            let sum: f64 = row.iter().zip(particular.iter()).map(|(a, t)| a * t).sum();
            sum - right
        };
        let balance = matrix.freedoms().len();
        let mut forces = vec![0.0_f64; structure.nodes.len()];
        for (row, &[node, _]) in self.rows[..balance]
            .iter()
            .zip(matrix.freedoms().coordinates())
        {
            forces[node] += left_over(row).powi(2);
        }
        let worst = (0..forces.len()).max_by(|&a, &b| forces[a].total_cmp(&forces[b]));
        if let Some(node) = worst.filter(|&node| !(forces[node].sqrt() <= allowed)) {
            return Err(InverseError::NoBalance {
                what: match (load > 0.0, known > 0.0) {
                    (true, _) => "the loads",
                    (false, true) => "those of constant rest length",
                    (false, false) => "one another",
                },
                node: structure.nodes[node].name.clone(),
                force: forces[node].sqrt(),
                allowed,
            });
        }
        for (row, &follower) in self.rows[balance..].iter().zip(&self.followers) {
            let force = left_over(row).abs();
            if !(force <= allowed) {
                return Err(InverseError::NoCoupling {
                    element: structure.elements[follower].name.clone(),
                    force,
                });
            }
        }
        Ok(())
    }
}

/// Refuses lengths out of their ranges by more than `tolerance` times the longest.
fn check_lengths(
    structure: &Structure,
    lengths: &[f64],
    tolerance: f64,
) -> Result<(), InverseError> {
    let longest = lengths.iter().copied().fold(0.0, f64::max);
    for (element, &length) in structure.elements.iter().zip(lengths) {
        let violation = -element.length.margin(length);
        if violation > tolerance * longest {
            return Err(InverseError::Length {
                element: element.name.clone(),
                length,
                violation,
            });
        }
    }
    Ok(())
}

/// The force that the length determines, where the rest length is constant.
fn known_force(element: &Element, length: f64) -> Option<f64> {
    match element.law {
        ForceLaw::Linear { stiffness, rest } if rest.is_constant() => {
            let force = stiffness * (length - rest.lo);
            Some(if element.pulls_only() {
                force.max(0.0)
            } else {
                force
            })
        }
        _ => None,
    }
}

/// Forces that an element's ranges of force and rest length admit at a length.
fn admissible_forces(element: &Element, length: f64, least: f64) -> Interval {
    let mut range = element.force;
    if let ForceLaw::Linear { stiffness, rest } = element.law {
        let ends = [rest.lo, rest.hi].map(|rest| stiffness * (length - rest));
        range = range.intersection(&Interval::new(ends[0].min(ends[1]), ends[0].max(ends[1])));
    }
    if element.pulls_only() {
        range = range.intersection(&Interval::new(least, f64::INFINITY));
    }
    range
}

/// The size of an evenly spread prestress.
fn spread_prestress(structure: &Structure, lengths: &[f64], unknown: &[usize]) -> f64 {
    if let Some(pretension) = structure.pretension {
        let carrying = structure.elements.iter().filter(|e| e.carries_force());
        return pretension / (carrying.count().max(1) as f64).sqrt();
    }
    let softest = unknown
        .iter()
        .filter_map(|&e| Some(structure.elements[e].stiffness()?.abs() * lengths[e]))
        .fold(f64::INFINITY, f64::min);
    if softest.is_finite() {
        STRAIN * softest
    } else {
        1.0
    }
}
