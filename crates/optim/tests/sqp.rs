//! Behaviour of the SQP solvers apart from standard problems: infeasible and unbounded problems,
//! fixed variables, scaling, warm starts, restricted domains, larger sparse problems, bad input.

use tensegra_optim::{
    BoundKind, DenseSqp, Hessian, KktResiduals, Nlp, NumericalTrouble, ProblemError, SparseSqp,
    SqpOptions, SqpReport, SqpStatus, TripletPattern, UnmetConstraint,
};

const INF: f64 = f64::INFINITY;

type Scalar = Box<dyn Fn(&[f64]) -> (f64, Vec<f64>)>;

/// A problem from closures that give values and gradients.
struct Problem {
    bounds: Vec<(f64, f64)>,
    scales: Vec<f64>,
    objective: Scalar,
    rows: Vec<(f64, f64, Scalar)>,
}

impl Problem {
    fn new(n: usize, objective: impl Fn(&[f64]) -> (f64, Vec<f64>) + 'static) -> Self {
        Self {
            bounds: vec![(-INF, INF); n],
            scales: vec![1.0; n],
            objective: Box::new(objective),
            rows: Vec::new(),
        }
    }

    fn row(
        mut self,
        lower: f64,
        upper: f64,
        row: impl Fn(&[f64]) -> (f64, Vec<f64>) + 'static,
    ) -> Self {
        self.rows.push((lower, upper, Box::new(row)));
        self
    }

    fn bounds(mut self, bounds: &[(f64, f64)]) -> Self {
        self.bounds = bounds.to_vec();
        self
    }
}

impl Nlp for Problem {
    fn num_variables(&self) -> usize {
        self.bounds.len()
    }
    fn num_constraints(&self) -> usize {
        self.rows.len()
    }
    fn variable_bounds(&self, lower: &mut [f64], upper: &mut [f64]) {
        for (j, &(l, u)) in self.bounds.iter().enumerate() {
            (lower[j], upper[j]) = (l, u);
        }
    }
    fn constraint_bounds(&self, lower: &mut [f64], upper: &mut [f64]) {
        for (i, &(l, u, _)) in self.rows.iter().enumerate() {
            (lower[i], upper[i]) = (l, u);
        }
    }
    fn variable_scales(&self, scales: &mut [f64]) {
        scales.copy_from_slice(&self.scales);
    }
    fn jacobian_pattern(&self) -> TripletPattern {
        TripletPattern::dense(self.rows.len(), self.bounds.len())
    }
    fn objective(&mut self, x: &[f64]) -> f64 {
        (self.objective)(x).0
    }
    fn gradient(&mut self, x: &[f64], gradient: &mut [f64]) {
        gradient.copy_from_slice(&(self.objective)(x).1);
    }
    fn constraints(&mut self, x: &[f64], values: &mut [f64]) {
        for (value, row) in values.iter_mut().zip(&self.rows) {
            *value = row.2(x).0;
        }
    }
    fn jacobian(&mut self, x: &[f64], values: &mut [f64]) {
        for (values, row) in values.chunks_exact_mut(x.len()).zip(&self.rows) {
            values.copy_from_slice(&row.2(x).1);
        }
    }
}

/// Solves with both solvers.
fn both(make: impl Fn() -> Problem, start: &[f64]) -> [(SqpReport, Vec<f64>); 2] {
    both_with(&SqpOptions::default(), make, start)
}

fn both_with(
    options: &SqpOptions,
    make: impl Fn() -> Problem,
    start: &[f64],
) -> [(SqpReport, Vec<f64>); 2] {
    let (mut a, mut b) = (start.to_vec(), start.to_vec());
    let dense = DenseSqp::new(options.clone())
        .unwrap()
        .solve(&mut make(), &mut a);
    let sparse = SparseSqp::new(options.clone())
        .unwrap()
        .solve(&mut make(), &mut b);
    [(dense.unwrap(), a), (sparse.unwrap(), b)]
}

fn unmet(report: &SqpReport) -> &[UnmetConstraint] {
    match &report.status {
        SqpStatus::Infeasible(unmet) => unmet,
        status => panic!("expected infeasibility, found {status:?}"),
    }
}

fn sorted_indices(unmet: &[UnmetConstraint]) -> Vec<usize> {
    let mut indices: Vec<usize> = unmet.iter().map(|u| u.constraint).collect();
    indices.sort_unstable();
    indices
}

#[test]
fn a_constraint_that_nothing_meets() {
    let make = || {
        Problem::new(1, |x| (x[0], vec![1.0]))
            .row(-INF, 0.0, |x| (x[0] * x[0] + 1.0, vec![2.0 * x[0]]))
            .row(-INF, 10.0, |x| (x[0], vec![1.0]))
    };
    for (report, x) in both(make, &[3.0]) {
        let unmet = unmet(&report);
        assert_eq!(sorted_indices(unmet), [0]);
        assert!((unmet[0].violation - 1.0).abs() < 1e-3, "{report:?}");
        assert!(x[0].abs() < 0.03);
    }
}

#[test]
fn linear_constraints_against_bounds() {
    let make = || {
        Problem::new(2, |x| (x[0] * x[0], vec![2.0 * x[0], 0.0]))
            .bounds(&[(0.0, 1.0); 2])
            .row(3.0, INF, |x| (x[0] + x[1], vec![1.0, 1.0]))
            .row(0.5, INF, |x| (x[0], vec![1.0, 0.0]))
    };
    for (report, x) in both(make, &[0.2, 0.1]) {
        let unmet = unmet(&report);
        assert_eq!(sorted_indices(unmet), [0]);
        assert!((unmet[0].violation + 1.0).abs() < 1e-6, "{report:?}");
        assert!((x[0] - 1.0).abs() < 1e-6 && (x[1] - 1.0).abs() < 1e-6);
    }
}

#[test]
fn contradictory_equalities() {
    let make = || {
        Problem::new(2, |x| (x[1], vec![0.0, 1.0]))
            .row(0.0, 0.0, |x| (x[0], vec![1.0, 0.0]))
            .row(1.0, 1.0, |x| (x[0], vec![1.0, 0.0]))
            .row(2.0, 2.0, |x| (x[1], vec![0.0, 1.0]))
    };
    for (report, x) in both(make, &[5.0, 5.0]) {
        let unmet = unmet(&report);
        assert!(sorted_indices(unmet).iter().all(|&i| i < 2));
        let total: f64 = unmet.iter().map(|u| u.violation.abs()).sum();
        assert!((total - 1.0).abs() < 1e-5, "{report:?}");
        assert!((x[1] - 2.0).abs() < 1e-6);
    }
}

/// "isolated" of Byrd, Curtis, Nocedal, "Infeasibility detection and SQP methods for nonlinear
/// optimization", SIAM J. Optim. 20 (2010): the violation has an isolated minimum at the origin.
#[test]
fn isolated_infeasible_point() {
    let make = || {
        Problem::new(2, |x| (x[0] + x[1], vec![1.0, 1.0]))
            .row(-INF, 0.0, |x| {
                (x[0] * x[0] - x[1] + 1.0, vec![2.0 * x[0], -1.0])
            })
            .row(-INF, 0.0, |x| {
                (x[0] * x[0] + x[1] + 1.0, vec![2.0 * x[0], 1.0])
            })
            .row(-INF, 0.0, |x| {
                (x[1] * x[1] - x[0] + 1.0, vec![-1.0, 2.0 * x[1]])
            })
            .row(-INF, 0.0, |x| {
                (x[1] * x[1] + x[0] + 1.0, vec![1.0, 2.0 * x[1]])
            })
    };
    for (report, x) in both(make, &[3.0, 2.0]) {
        assert_eq!(sorted_indices(unmet(&report)), [0, 1, 2, 3]);
        // (0, 0) minimises the sum of violations, but near it their slopes are small.
        assert!(x[0].abs() < 0.05 && x[1].abs() < 0.05, "{x:?}");
    }
}

/// "unique" of the same paper: the least violation is at (0, 1).
#[test]
fn unique_infeasible_point() {
    let make = || {
        Problem::new(2, |x| (x[0] + x[1], vec![1.0, 1.0]))
            .row(0.0, INF, |x| {
                (x[1] - x[0] * x[0] - 1.0, vec![-2.0 * x[0], 1.0])
            })
            .row(0.0, INF, |x| {
                (0.3 * (1.0 - x[1].exp()), vec![0.0, -0.3 * x[1].exp()])
            })
    };
    for (report, _) in both(make, &[3.0, 2.0]) {
        assert!(!unmet(&report).is_empty());
    }
}

/// A wall between two allowed regions: infeasible where it starts, but not everywhere.
#[test]
fn a_way_out_of_an_infeasible_start_is_found() {
    let make = || {
        Problem::new(2, |x| {
            (x[0] * x[0] + x[1] * x[1], vec![2.0 * x[0], 2.0 * x[1]])
        })
        .row(4.0, INF, |x| {
            let (a, b) = (x[0] - 0.3, x[1] - 0.1);
            (a * a + b * b, vec![2.0 * a, 2.0 * b])
        })
        .row(0.0, INF, |x| (x[0] + x[1] - 1.0, vec![1.0, 1.0]))
    };
    for (report, x) in both(make, &[0.4, 0.15]) {
        assert!(report.is_converged(), "{report:?}");
        let distance = (x[0] - 0.3).hypot(x[1] - 0.1);
        assert!((distance - 2.0).abs() < 1e-7);
    }
}

#[test]
fn fixed_variables_stay() {
    let make = || {
        Problem::new(3, |x| {
            let d = [x[0] - 1.0, x[1] - 2.0, x[2] - 3.0];
            (
                d.iter().map(|d| d * d).sum(),
                d.iter().map(|d| 2.0 * d).collect(),
            )
        })
        .bounds(&[(-INF, INF), (5.0, 5.0), (-INF, INF)])
        .row(0.0, 0.0, |x| (x[0] + x[1] + x[2], vec![1.0; 3]))
    };
    for (report, x) in both(make, &[0.0, 0.0, 0.0]) {
        assert!(report.is_converged());
        for (found, expected) in x.iter().zip([-3.5, 5.0, -1.5]) {
            assert!((found - expected).abs() < 1e-7, "{x:?}");
        }
    }
}

#[test]
fn nothing_to_move_and_nothing_to_meet() {
    let all_fixed = || Problem::new(1, |x| (x[0], vec![1.0])).bounds(&[(2.0, 2.0)]);
    for (report, x) in both(all_fixed, &[0.0]) {
        assert!(report.is_converged());
        assert_eq!(x, [2.0]);
    }
    let fixed_and_unmet = || {
        Problem::new(1, |x| (x[0], vec![1.0]))
            .bounds(&[(2.0, 2.0)])
            .row(0.0, 1.0, |x| (x[0], vec![1.0]))
    };
    for (report, _) in both(fixed_and_unmet, &[0.0]) {
        assert_eq!(sorted_indices(unmet(&report)), [0]);
    }
}

#[test]
fn redundant_constraints_do_no_harm() {
    let make = || {
        let mut problem = Problem::new(2, |x| (x[0] + 2.0 * x[1], vec![1.0, 2.0]));
        for factor in [1.0, 2.0, -3.0] {
            problem = problem.row(factor, factor, move |x| {
                (
                    factor * (x[0] * x[0] + x[1] * x[1]),
                    vec![2.0 * factor * x[0], 2.0 * factor * x[1]],
                )
            });
        }
        problem
    };
    let expected = -(5.0_f64.sqrt());
    for (report, _) in both(make, &[-1.0, 0.3]) {
        assert!(report.is_converged(), "{report:?}");
        assert!((report.objective - expected).abs() < 1e-6);
    }
}

#[test]
fn steps_out_of_the_domain_are_taken_back() {
    let make = || {
        Problem::new(1, |x| (10.0 * x[0] - x[0].ln(), vec![10.0 - 1.0 / x[0]])).row(
            -INF,
            3.0,
            |x| (x[0].sqrt(), vec![0.5 / x[0].sqrt()]),
        )
    };
    for (report, x) in both(make, &[5.0]) {
        assert!(report.is_converged(), "{report:?}");
        assert!((x[0] - 0.1).abs() < 1e-6);
    }
}

#[test]
fn an_unbounded_objective_is_said_to_be() {
    let make = || {
        Problem::new(2, |x| (-x[0] * x[0] + x[1], vec![-2.0 * x[0], 1.0]))
            .row(0.0, INF, |x| (x[1], vec![0.0, 1.0]))
    };
    for (report, _) in both(make, &[1.0, 1.0]) {
        assert_eq!(
            report.status,
            SqpStatus::NumericalTrouble(NumericalTrouble::Unbounded),
            "{report:?}"
        );
    }
}

#[test]
fn a_wrong_gradient_is_trouble() {
    let make = || {
        Problem::new(2, |x| {
            (x[0] * x[0] + x[1] * x[1], vec![-2.0 * x[0], 2.0 * x[1]])
        })
    };
    for (report, _) in both(make, &[1.0, 1.0]) {
        assert_eq!(
            report.status,
            SqpStatus::NumericalTrouble(NumericalTrouble::StepTooSmall)
        );
    }
}

#[test]
fn the_iteration_limit_holds() {
    let options = SqpOptions::default().with_max_iterations(2);
    let make = || Problem::new(1, |x| (x[0].powi(4), vec![4.0 * x[0].powi(3)]));
    for (report, _) in both_with(&options, make, &[3.0]) {
        assert_eq!(report.status, SqpStatus::IterationLimit);
        assert_eq!(report.iterations, 2);
    }
}

fn rosen_suzuki(objective_unit: f64, variable_unit: f64, row_unit: f64) -> Problem {
    let row = move |coefficients: [f64; 4], linear: [f64; 4]| {
        move |x: &[f64]| {
            let mut value = 0.0;
            let mut gradient = Vec::new();
            for j in 0..4 {
                let y = x[j] / variable_unit;
                value += row_unit * (coefficients[j] * y * y + linear[j] * y);
                gradient.push(row_unit * (2.0 * coefficients[j] * y + linear[j]) / variable_unit);
            }
            (value, gradient)
        }
    };
    let mut problem = Problem::new(4, move |x| {
        let (coefficients, linear) = ([1.0, 1.0, 2.0, 1.0], [-5.0, -5.0, -21.0, 7.0]);
        let mut value = 0.0;
        let mut gradient = Vec::new();
        for j in 0..4 {
            let y = x[j] / variable_unit;
            value += objective_unit * (coefficients[j] * y * y + linear[j] * y);
            gradient.push(objective_unit * (2.0 * coefficients[j] * y + linear[j]) / variable_unit);
        }
        (value, gradient)
    })
    .row(-INF, 8.0 * row_unit, row([1.0; 4], [1.0, -1.0, 1.0, -1.0]))
    .row(
        -INF,
        10.0 * row_unit,
        row([1.0, 2.0, 1.0, 2.0], [-1.0, 0.0, 0.0, -1.0]),
    )
    .row(
        -INF,
        5.0 * row_unit,
        row([2.0, 1.0, 1.0, 0.0], [2.0, -1.0, 0.0, -1.0]),
    );
    problem.scales = vec![variable_unit; 4];
    problem
}

/// Units of the objective, of the variables (with their scales) and of the constraints change
/// neither the solution nor the number of iterations.
#[test]
fn units_do_not_matter() {
    let plain = both(|| rosen_suzuki(1.0, 1.0, 1.0), &[0.0; 4]);
    for (objective, variable, row) in [
        (1e5, 1.0, 1.0),
        (1e-5, 1.0, 1.0),
        (1.0, 1e3, 1.0),
        (1.0, 1.0, 1e-1),
    ] {
        let options = SqpOptions::default().with_feasibility_tolerance(1e-8 * row);
        let scaled = both_with(
            &options,
            || rosen_suzuki(objective, variable, row),
            &[0.0; 4],
        );
        for ((a, x), (b, y)) in plain.iter().zip(&scaled) {
            assert!(a.is_converged() && b.is_converged(), "{a:?} {b:?}");
            assert!((a.objective + 44.0).abs() < 1e-6);
            assert!((b.objective / objective + 44.0).abs() < 1e-6);
            assert!(a.iterations.abs_diff(b.iterations) <= 2, "{a:?} {b:?}");
            for (x, y) in x.iter().zip(y) {
                assert!((x - y / variable).abs() < 1e-3);
            }
        }
    }
}

#[test]
fn a_warm_start_needs_fewer_iterations() {
    let mut solver = DenseSqp::new(SqpOptions::default()).unwrap();
    let mut x = [0.0; 4];
    let cold = solver
        .solve(&mut rosen_suzuki(1.0, 1.0, 1.0), &mut x)
        .unwrap();
    let warm = solver
        .solve_warm(&mut rosen_suzuki(1.0, 1.0, 1.0), &mut x)
        .unwrap();
    assert!(cold.is_converged() && warm.is_converged());
    assert!(
        warm.iterations < cold.iterations && warm.iterations <= 2,
        "{warm:?}"
    );
}

#[test]
fn a_solver_leaves_no_trace_in_the_next_solve() {
    let options = SqpOptions::default();
    let mut used = (
        DenseSqp::new(options.clone()).unwrap(),
        SparseSqp::new(options.clone()).unwrap(),
    );
    let mut other = Problem::new(2, |x| (x[0], vec![1.0, 0.0])).row(1.0, 1.0, |x| {
        (x[0] * x[0] + x[1] * x[1], vec![2.0 * x[0], 2.0 * x[1]])
    });
    used.0.solve(&mut other, &mut [0.3, 0.4]).unwrap();
    used.1.solve(&mut other, &mut [0.3, 0.4]).unwrap();
    let [(dense, x), (sparse, y)] = both(|| rosen_suzuki(1.0, 1.0, 1.0), &[0.0; 4]);
    let (mut a, mut b) = ([0.0; 4], [0.0; 4]);
    assert_eq!(
        used.0
            .solve(&mut rosen_suzuki(1.0, 1.0, 1.0), &mut a)
            .unwrap(),
        dense
    );
    assert_eq!(
        used.1
            .solve(&mut rosen_suzuki(1.0, 1.0, 1.0), &mut b)
            .unwrap(),
        sparse
    );
    assert_eq!((&a[..], &b[..]), (&x[..], &y[..]));
}

/// A string of points from (−2, 0) to (2, 0) over the unit disc, with least sum of squared steps,
/// and many other discs far away. Every fourth variable is fixed nowhere; the ends are constants.
struct TautString {
    points: usize,
    discs: Vec<(f64, f64, f64)>,
    kind: Hessian,
}

impl TautString {
    fn point(&self, x: &[f64], k: usize) -> (f64, f64) {
        match k {
            0 => (-2.0, 0.0),
            k if k > self.points => (2.0, 0.0),
            k => (x[2 * k - 2], x[2 * k - 1]),
        }
    }

    fn start(&self) -> Vec<f64> {
        (1..=self.points)
            .flat_map(|k| {
                let t = k as f64 / (self.points + 1) as f64;
                [4.0 * t - 2.0, 2.0 * (std::f64::consts::PI * t).sin()]
            })
            .collect()
    }
}

impl Nlp for TautString {
    fn num_variables(&self) -> usize {
        2 * self.points
    }
    fn num_constraints(&self) -> usize {
        self.points * self.discs.len()
    }
    fn constraint_bounds(&self, lower: &mut [f64], _upper: &mut [f64]) {
        for (lower, (_, _, radius)) in lower.iter_mut().zip(self.discs.iter().cycle()) {
            *lower = radius * radius;
        }
    }
    fn jacobian_pattern(&self) -> TripletPattern {
        let mut pattern = TripletPattern::new();
        for row in 0..self.num_constraints() {
            let k = row / self.discs.len();
            pattern.push_row(row, 2 * k..2 * k + 2);
        }
        pattern
    }
    fn objective(&mut self, x: &[f64]) -> f64 {
        (0..=self.points)
            .map(|k| {
                let (a, b) = (self.point(x, k), self.point(x, k + 1));
                (b.0 - a.0).powi(2) + (b.1 - a.1).powi(2)
            })
            .sum()
    }
    fn gradient(&mut self, x: &[f64], gradient: &mut [f64]) {
        for k in 1..=self.points {
            let (a, b, c) = (self.point(x, k - 1), self.point(x, k), self.point(x, k + 1));
            gradient[2 * k - 2] = 2.0 * (2.0 * b.0 - a.0 - c.0);
            gradient[2 * k - 1] = 2.0 * (2.0 * b.1 - a.1 - c.1);
        }
    }
    fn constraints(&mut self, x: &[f64], values: &mut [f64]) {
        for (row, value) in values.iter_mut().enumerate() {
            let (k, disc) = (row / self.discs.len(), self.discs[row % self.discs.len()]);
            *value = (x[2 * k] - disc.0).powi(2) + (x[2 * k + 1] - disc.1).powi(2);
        }
    }
    fn jacobian(&mut self, x: &[f64], values: &mut [f64]) {
        for (row, values) in values.chunks_exact_mut(2).enumerate() {
            let (k, disc) = (row / self.discs.len(), self.discs[row % self.discs.len()]);
            values[0] = 2.0 * (x[2 * k] - disc.0);
            values[1] = 2.0 * (x[2 * k + 1] - disc.1);
        }
    }
    fn hessian_kind(&self) -> Hessian {
        self.kind
    }
    fn hessian_pattern(&self) -> TripletPattern {
        let mut pattern = TripletPattern::diagonal(2 * self.points);
        for j in 2..2 * self.points {
            pattern.push(j - 2, j);
        }
        pattern
    }
    fn hessian(&mut self, _x: &[f64], weight: f64, multipliers: &[f64], values: &mut [f64]) {
        let (diagonal, beside) = values.split_at_mut(2 * self.points);
        beside.fill(-2.0 * weight);
        for (k, pair) in diagonal.chunks_exact_mut(2).enumerate() {
            pair.fill(4.0 * weight);
            if self.kind == Hessian::Lagrangian {
                let own = &multipliers[k * self.discs.len()..(k + 1) * self.discs.len()];
                let sum: f64 = own.iter().sum();
                pair[0] += 2.0 * sum;
                pair[1] += 2.0 * sum;
            }
        }
    }
}

fn far_discs() -> Vec<(f64, f64, f64)> {
    let mut discs = vec![(0.0, 0.0, 1.0)];
    discs.extend((0..20).map(|k| (f64::from(k) - 10.0, -6.0 - f64::from(k % 3), 1.5)));
    discs
}

#[test]
fn a_long_string_over_a_disc() {
    for kind in [Hessian::Convex, Hessian::Lagrangian] {
        let mut problem = TautString {
            points: 99,
            discs: far_discs(),
            kind,
        };
        let mut x = problem.start();
        let options = SqpOptions::default().with_initial_radius(0.3);
        let mut solver = SparseSqp::new(options).unwrap();
        let report = solver.solve(&mut problem, &mut x).unwrap();
        assert!(report.is_converged(), "{kind:?} {report:?}");
        assert!(report.residuals.infeasibility < 1e-8);
        // Two tangents and an arc, in a hundred nearly equal steps.
        let length = 2.0 * 3.0_f64.sqrt() + std::f64::consts::PI / 3.0;
        let expected = length * length / 100.0;
        assert!(
            (report.objective / expected - 1.0).abs() < 2e-3,
            "{report:?}"
        );
        assert!(report.iterations < 30, "{kind:?} {report:?}");
    }
}

/// Leaving out rows does not change the result.
#[test]
fn dense_and_sparse_agree_on_a_string() {
    for kind in [Hessian::Convex, Hessian::Lagrangian, Hessian::QuasiNewton] {
        let options = SqpOptions::default().with_initial_radius(0.3);
        let mut problem = TautString {
            points: 9,
            discs: far_discs(),
            kind,
        };
        let (mut x, mut y) = (problem.start(), problem.start());
        let dense = DenseSqp::new(options.clone())
            .unwrap()
            .solve(&mut problem, &mut x)
            .unwrap();
        let sparse = SparseSqp::new(options)
            .unwrap()
            .solve(&mut problem, &mut y)
            .unwrap();
        assert!(
            dense.is_converged() && sparse.is_converged(),
            "{dense:?} {sparse:?}"
        );
        assert!((dense.objective - sparse.objective).abs() < 1e-6);
    }
}

#[test]
fn measured_residuals_see_what_is_wrong() {
    let mut problem = rosen_suzuki(1.0, 1.0, 1.0);
    let optimum = [0.0, 1.0, 2.0, -1.0];
    let multipliers = [1.0, 0.0, 2.0];
    let at_optimum = KktResiduals::measure(&mut problem, &optimum, &multipliers).unwrap();
    assert!(at_optimum.infeasibility < 1e-14 && at_optimum.stationarity < 1e-14);
    assert!(at_optimum.complementarity < 1e-14);
    let off = KktResiduals::measure(&mut problem, &[0.0, 1.0, 2.0, -1.5], &multipliers).unwrap();
    // The second constraint is then 0 + 2 + 4 + 4.5 − 0 + 1.5 = 12 instead of at most 10; the
    // first is violated by 1.75.
    assert!((off.infeasibility - 2.0).abs() < 1e-12, "{off:?}");
    let wrong = KktResiduals::measure(&mut problem, &optimum, &[0.0; 3]).unwrap();
    assert!((wrong.stationarity - 13.0).abs() < 1e-12, "{wrong:?}");
    let short = KktResiduals::measure(&mut problem, &optimum[..3], &multipliers);
    assert!(matches!(
        short,
        Err(ProblemError::WrongLength {
            expected: 4,
            found: 3,
            ..
        })
    ));
}

#[test]
fn bad_problems_are_named() {
    let solve = |problem: &mut Problem, x: &mut [f64]| {
        let dense = DenseSqp::new(SqpOptions::default())
            .unwrap()
            .solve(problem, x);
        let sparse = SparseSqp::new(SqpOptions::default())
            .unwrap()
            .solve(problem, x);
        let (dense, sparse) = (dense.unwrap_err(), sparse.unwrap_err());
        assert_eq!(dense.to_string(), sparse.to_string());
        dense
    };
    let plain = || Problem::new(2, |x| (x[0] + x[1], vec![1.0, 1.0]));

    let error = solve(&mut plain(), &mut [0.0; 3]);
    assert!(matches!(
        error,
        ProblemError::WrongLength {
            expected: 2,
            found: 3,
            ..
        }
    ));
    let error = solve(
        &mut plain().bounds(&[(0.0, 1.0), (2.0, 1.0)]),
        &mut [0.0; 2],
    );
    assert!(matches!(
        error,
        ProblemError::ContradictoryBounds {
            kind: BoundKind::Variable,
            index: 1,
            ..
        }
    ));
    let error = solve(
        &mut plain().row(f64::NAN, 0.0, |_| (0.0, vec![0.0; 2])),
        &mut [0.0; 2],
    );
    assert!(matches!(
        error,
        ProblemError::ContradictoryBounds {
            kind: BoundKind::Constraint,
            index: 0,
            ..
        }
    ));
    let error = solve(&mut plain(), &mut [0.0, f64::NAN]);
    assert!(matches!(
        error,
        ProblemError::StartNotFinite { index: 1, .. }
    ));
    let mut unscaled = plain();
    unscaled.scales[1] = 0.0;
    let error = solve(&mut unscaled, &mut [0.0; 2]);
    assert!(matches!(error, ProblemError::BadScale { index: 1, .. }));
    let mut log = Problem::new(1, |x| (x[0].ln(), vec![1.0 / x[0]]));
    let error = solve(&mut log, &mut [-1.0]);
    assert!(matches!(
        error,
        ProblemError::NotFiniteAtStart {
            what: "objective",
            ..
        }
    ));
    let mut bad_row = plain().row(0.0, 1.0, |_| (1.0, vec![1.0, f64::NAN]));
    let error = solve(&mut bad_row, &mut [0.0; 2]);
    assert!(matches!(
        error,
        ProblemError::NotFiniteAtStart {
            what: "constraint Jacobian",
            index: 1,
            ..
        }
    ));
}

#[test]
fn bad_options_are_named() {
    let options = SqpOptions::default().with_initial_radius(-1.0);
    let error = DenseSqp::new(options).unwrap_err();
    assert_eq!((error.name, error.value.as_str()), ("initial_radius", "-1"));
    let options = SqpOptions::default().with_feasibility_tolerance(f64::NAN);
    assert_eq!(
        SparseSqp::new(options).unwrap_err().name,
        "feasibility_tolerance"
    );
}

#[test]
fn solvers_can_move_between_threads() {
    fn is_send<T: Send>() {}
    is_send::<DenseSqp>();
    is_send::<SparseSqp>();
}
