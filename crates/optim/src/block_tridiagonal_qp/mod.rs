//! Convex quadratic programmes over a chain of blocks, by a primal-dual interior-point method.
//!
//! ```text
//! minimise    Σ_i ½ tᵢᵀ Hᵢ tᵢ + Σ_i tᵢ₊₁ᵀ Cᵢ tᵢ + Σ_i gᵢᵀ tᵢ + Σ_r w_r s_r      tᵢ ∈ ℝᵏ, i = 1 … n
//! subject to  l ≤ t ≤ u                                        finite or not
//!             aᵣᵀ t ≥ bᵣ − s_r,  s_r ≥ 0                       r = 1 … m
//! ```
//!
//! The Hessian (blocks Hᵢ on the diagonal, Cᵢ below it) is positive definite. Each row aᵣ touches
//! one block or two neighbouring ones: the problems that arise where a whole path is optimised,
//! one block for each of its points. A row may be violated by s_r at the price w_r; with an
//! infinite price it must hold. As long as no price is infinite there is always a solution.
//!
//! Source: S. Mehrotra, "On the implementation of a primal-dual interior point method", SIAM
//! Journal on Optimization 2 (1992), 575–601, with slacks and multipliers eliminated: what is
//! left of each Newton step is one system with the Hessian plus a term of rank one for each row,
//! block-tridiagonal like the Hessian. A priced row with multiplier λ, value z above its bound
//! and slack s has there the weight 1 / (z/λ + s/(w − λ)); z and s stay strictly positive, λ
//! strictly between 0 and w.
//!
//! Cost of an iteration: one block Cholesky factorisation, 7/3 n k³, and 2 k² for each row;
//! memory 2 n k² + 2 m k. Usually 8 to 20 iterations, whatever the numbers of blocks and rows.

mod factor;

use thiserror::Error;

use self::factor::BlockCholesky;
use crate::vector::{axpy, largest, refill};

/// Steps end this fraction of the way to the nearest bound.
const TO_THE_BOUND: f64 = 0.995;
/// Smallest interior distance from a bound at the start, relative to the width between bounds.
const INTERIOR: f64 = 1e-2;

/// Rows give way by this much, over the Hessian's largest entry, for each unit of a multiplier's
/// change: the weights of active rows would else drown the Hessian in rounding errors. What is
/// amiss with a step by that is put right by the next.
const SOFTEST: f64 = 1e-12;

/// Σ aᵢ bᵢ, with several sums, so that it is vectorised.
#[inline(always)]
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 4];
    let (a4, b4) = (a.chunks_exact(4), b.chunks_exact(4));
    let rest = a4.remainder().iter().zip(b4.remainder());
    let rest: f64 = rest.map(|(a, b)| a * b).sum();
    for (a, b) in a4.zip(b4) {
        for i in 0..4 {
            sums[i] += a[i] * b[i];
        }
    }
    (sums[0] + sums[2]) + (sums[1] + sums[3]) + rest
}

/// A row that touches one block, or one and the next.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Row {
    block: u32,
    /// Number of coefficients: k or 2 k.
    width: u32,
    /// Where its coefficients begin.
    start: usize,
    at_least: f64,
    price: f64,
}

impl Row {
    fn columns(&self, size: usize) -> std::ops::Range<usize> {
        let first = self.block as usize * size;
        first..first + self.width as usize
    }
}

/// The data of a quadratic programme over a chain of blocks.
///
/// # Examples
/// A chain of three points on a line between 0 and 4, pulled straight by ½ Σ (tᵢ₊₁ − tᵢ)², the
/// middle one kept at 1.5 or less:
/// ```
/// use tensegra_optim::{BlockTridiagonalQp, BlockTridiagonalQpSolver};
///
/// let mut qp = BlockTridiagonalQp::new(3, 1);
/// for i in 0..3 {
///     qp.diagonal_mut(i)[0] = 2.0;
/// }
/// for i in 0..2 {
///     qp.coupling_mut(i)[0] = -1.0;
/// }
/// qp.gradient_mut(2)[0] = -4.0;
/// qp.push_row(1, &[-1.0], -1.5, f64::INFINITY);
///
/// let mut solver = BlockTridiagonalQpSolver::new();
/// solver.solve(&qp)?;
/// for (t, expected) in solver.solution().iter().zip([0.75, 1.5, 2.75]) {
///     assert!((t - expected).abs() < 1e-7);
/// }
/// assert!((solver.row_multipliers()[0] - 0.5).abs() < 1e-6);
/// # Ok::<(), tensegra_optim::BlockTridiagonalQpError>(())
/// ```
#[derive(Debug, Clone, Default, PartialEq)]
pub struct BlockTridiagonalQp {
    blocks: usize,
    size: usize,
    /// Hᵢ, row-major, one after the other.
    diagonal: Vec<f64>,
    /// Cᵢ, row-major: rows belong to block i + 1, columns to block i.
    coupling: Vec<f64>,
    gradient: Vec<f64>,
    lower: Vec<f64>,
    upper: Vec<f64>,
    rows: Vec<Row>,
    coefficients: Vec<f64>,
}

/// Why a programme cannot be solved.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
#[non_exhaustive]
pub enum BlockTridiagonalQpError {
    /// A number is NaN or infinite that must not be.
    #[error("the {what} of block {block} are not all finite")]
    NotFinite {
        /// "Hessian", "gradient" or "rows".
        what: &'static str,
        /// The block concerned.
        block: usize,
    },
    /// A lower bound does not lie below its upper bound.
    #[error(
        "variable {variable} has the bounds [{lower}, {upper}]: an interior-point method needs \
         room between them"
    )]
    NoRoom {
        /// Index of the variable, blocks one after the other.
        variable: usize,
        /// Lower bound.
        lower: f64,
        /// Upper bound.
        upper: f64,
    },
    /// The price of a row is not positive.
    #[error("row {row} has the price {price}: give a positive one, or infinity")]
    BadPrice {
        /// Index of the row.
        row: usize,
        /// The price.
        price: f64,
    },
    /// The Hessian is not positive definite.
    #[error("the Hessian is not positive definite at block {block}")]
    NotConvex {
        /// Where the factorisation broke down.
        block: usize,
    },
}

/// How a solve ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum BlockTridiagonalQpStatus {
    /// Solved to the tolerance.
    Solved,
    /// The largest number of iterations was reached, or steps became too short. Rows of infinite
    /// price may contradict each other.
    Stalled,
}

/// What a solve reached, measured from the data.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct BlockTridiagonalQpReport {
    /// How it ended.
    pub status: BlockTridiagonalQpStatus,
    /// Objective, prices of violated rows included.
    pub objective: f64,
    /// ‖Ht + g − Aᵀλ − ζ‖∞, with the multipliers λ of rows and ζ of bounds.
    pub stationarity: f64,
    /// Largest violation aᵣᵀt ≥ bᵣ of a row of infinite price.
    pub infeasibility: f64,
    /// Mean product of a multiplier and the distance from its bound.
    pub complementarity: f64,
    /// Interior-point iterations.
    pub iterations: usize,
}

impl BlockTridiagonalQp {
    /// A programme of `blocks` blocks of `size` variables without bounds and rows; all else is 0.
    #[must_use]
    pub fn new(blocks: usize, size: usize) -> Self {
        let mut qp = Self::default();
        qp.reset(blocks, size);
        qp
    }

    /// Makes this the programme that [`new`](Self::new) returns, keeping its memory.
    pub fn reset(&mut self, blocks: usize, size: usize) {
        self.blocks = blocks;
        self.size = size;
        let variables = blocks * size;
        refill(&mut self.diagonal, variables * size, 0.0);
        refill(
            &mut self.coupling,
            variables.saturating_sub(size) * size,
            0.0,
        );
        refill(&mut self.gradient, variables, 0.0);
        refill(&mut self.lower, variables, f64::NEG_INFINITY);
        refill(&mut self.upper, variables, f64::INFINITY);
        self.clear_rows();
    }

    /// Number n of blocks.
    #[must_use]
    pub fn blocks(&self) -> usize {
        self.blocks
    }

    /// Number k of variables in a block.
    #[must_use]
    pub fn block_size(&self) -> usize {
        self.size
    }

    /// Number m of rows.
    #[must_use]
    pub fn num_rows(&self) -> usize {
        self.rows.len()
    }

    /// The block Hᵢ of the Hessian: k × k, row-major, symmetric.
    ///
    /// # Panics
    /// If there is no such block.
    pub fn diagonal_mut(&mut self, block: usize) -> &mut [f64] {
        let square = self.size * self.size;
        &mut self.diagonal[block * square..(block + 1) * square]
    }

    /// The block Cᵢ of the Hessian between block i and the next: k × k, row-major; its rows belong
    /// to block i + 1, its columns to block i.
    ///
    /// # Panics
    /// If there is no such block.
    pub fn coupling_mut(&mut self, block: usize) -> &mut [f64] {
        let square = self.size * self.size;
        &mut self.coupling[block * square..(block + 1) * square]
    }

    /// Adds `factor` times a block-diagonal matrix to the Hessian: n blocks of k × k, row-major,
    /// symmetric.
    ///
    /// # Panics
    /// If there are not as many values as in the diagonal blocks of the Hessian.
    pub fn add_to_diagonal(&mut self, factor: f64, blocks: &[f64]) {
        assert_eq!(blocks.len(), self.diagonal.len());
        axpy(factor, blocks, &mut self.diagonal);
    }

    /// The gradient gᵢ at the origin.
    ///
    /// # Panics
    /// If there is no such block.
    pub fn gradient_mut(&mut self, block: usize) -> &mut [f64] {
        &mut self.gradient[block * self.size..(block + 1) * self.size]
    }

    /// Bounds all variables: l ≤ t ≤ u, the same for all.
    pub fn set_box(&mut self, lower: f64, upper: f64) {
        self.lower.fill(lower);
        self.upper.fill(upper);
    }

    /// Lower and upper bounds of the variables of one block.
    ///
    /// # Panics
    /// If there is no such block.
    pub fn bounds_mut(&mut self, block: usize) -> (&mut [f64], &mut [f64]) {
        let range = block * self.size..(block + 1) * self.size;
        (&mut self.lower[range.clone()], &mut self.upper[range])
    }

    /// Adds the row aᵀ (tᵢ, tᵢ₊₁) ≥ b, or aᵀ tᵢ ≥ b where a has k coefficients. What it falls short
    /// costs `price` a unit; an infinite price forbids it.
    ///
    /// # Panics
    /// If `coefficients` has neither k nor 2 k entries, or a block is missing.
    pub fn push_row(&mut self, block: usize, coefficients: &[f64], at_least: f64, price: f64) {
        let spans = coefficients.len() / self.size.max(1);
        assert!(
            coefficients.len() == spans * self.size && (spans == 1 || spans == 2),
            "a row has {} or {} coefficients, not {}",
            self.size,
            2 * self.size,
            coefficients.len()
        );
        assert!(block + spans <= self.blocks, "no block {block} + {spans}");
        self.rows.push(Row {
            block: block as u32,
            width: coefficients.len() as u32,
            start: self.coefficients.len(),
            at_least,
            price,
        });
        self.coefficients.extend_from_slice(coefficients);
    }

    /// Sets the price of all rows that have a finite one.
    pub fn set_prices(&mut self, price: f64) {
        for row in self.rows.iter_mut().filter(|row| row.price.is_finite()) {
            row.price = price;
        }
    }

    /// Removes all rows.
    pub fn clear_rows(&mut self) {
        self.rows.clear();
        self.coefficients.clear();
    }

    #[inline(always)]
    fn coefficients(&self, row: &Row) -> &[f64] {
        &self.coefficients[row.start..row.start + row.width as usize]
    }

    /// aᵣᵀ t.
    #[inline(always)]
    fn row_value(&self, row: &Row, t: &[f64]) -> f64 {
        dot(self.coefficients(row), &t[row.columns(self.size)])
    }

    /// `product` = H t.
    #[inline(always)]
    fn times_hessian(&self, t: &[f64], product: &mut [f64]) {
        let k = self.size;
        if k == 0 {
            return;
        }
        for (i, (p, row)) in product
            .iter_mut()
            .zip(self.diagonal.chunks_exact(k))
            .enumerate()
        {
            let block = i / k * k;
            *p = dot(row, &t[block..block + k]);
        }
        for (i, row) in self.coupling.chunks_exact(k).enumerate() {
            let block = i / k * k;
            product[i + k] += dot(row, &t[block..block + k]);
            axpy(t[i + k], row, &mut product[block..block + k]);
        }
    }

    /// How much a row falls short at `t`.
    fn shortfall(&self, row: &Row, t: &[f64]) -> f64 {
        (row.at_least - self.row_value(row, t)).max(0.0)
    }

    /// The objective at `t`, prices of violated rows included; rows of infinite price are left out.
    ///
    /// # Panics
    /// If `t` is not as long as there are variables.
    #[must_use]
    pub fn objective(&self, t: &[f64]) -> f64 {
        let mut product = vec![0.0; t.len()];
        self.times_hessian(t, &mut product);
        let prices = self.rows.iter().filter(|row| row.price.is_finite());
        0.5 * dot(t, &product)
            + dot(&self.gradient, t)
            + prices
                .map(|row| row.price * self.shortfall(row, t))
                .sum::<f64>()
    }

    /// Σ of what the rows of finite price fall short at `t`.
    ///
    /// # Panics
    /// If `t` is not as long as there are variables.
    #[must_use]
    pub fn priced_shortfall(&self, t: &[f64]) -> f64 {
        let priced = self.rows.iter().filter(|row| row.price.is_finite());
        priced.map(|row| self.shortfall(row, t)).sum()
    }

    /// `residual` −= Aᵀ λ.
    ///
    /// # Panics
    /// If there are not as many multipliers as rows, or not as many residuals as variables.
    #[inline(always)]
    pub fn subtract_rows(&self, multipliers: &[f64], residual: &mut [f64]) {
        assert_eq!(multipliers.len(), self.rows.len());
        assert_eq!(residual.len(), self.gradient.len());
        for (row, &multiplier) in self.rows.iter().zip(multipliers) {
            axpy(
                -multiplier,
                self.coefficients(row),
                &mut residual[row.columns(self.size)],
            );
        }
    }

    fn validate(&self) -> Result<(), BlockTridiagonalQpError> {
        let k = self.size.max(1);
        let finite = |what, values: &[f64], per_block: usize| match values
            .iter()
            .position(|value| !value.is_finite())
        {
            Some(i) => Err(BlockTridiagonalQpError::NotFinite {
                what,
                block: i / per_block,
            }),
            None => Ok(()),
        };
        finite("Hessian", &self.diagonal, k * k)?;
        finite("Hessian", &self.coupling, k * k)?;
        finite("gradient", &self.gradient, k)?;
        for (index, row) in self.rows.iter().enumerate() {
            if !(row.at_least.is_finite() && self.coefficients(row).iter().all(|a| a.is_finite())) {
                return Err(BlockTridiagonalQpError::NotFinite {
                    what: "rows",
                    block: row.block as usize,
                });
            }
            if !(row.price > 0.0) {
                return Err(BlockTridiagonalQpError::BadPrice {
                    row: index,
                    price: row.price,
                });
            }
        }
        for (variable, (&lower, &upper)) in self.lower.iter().zip(&self.upper).enumerate() {
            let infinite = lower == f64::INFINITY || upper == f64::NEG_INFINITY;
            if !(lower < upper) || infinite {
                return Err(BlockTridiagonalQpError::NoRoom {
                    variable,
                    lower,
                    upper,
                });
            }
        }
        Ok(())
    }
}

/// The interior-point method, with its memory.
///
/// A solver may be used for programmes of any sizes one after the other; it allocates only when
/// one is larger than all before. It starts afresh every time: the same programme has the same
/// solution, bit for bit.
#[derive(Debug, Clone)]
pub struct BlockTridiagonalQpSolver {
    tolerance: f64,
    max_iterations: usize,
    t: Vec<f64>,
    // Rows: value above the bound z, slack s, multiplier λ.
    value: Vec<f64>,
    slack: Vec<f64>,
    multiplier: Vec<f64>,
    // Bounds: multipliers of l and u.
    lower_multiplier: Vec<f64>,
    upper_multiplier: Vec<f64>,
    bound_multiplier: Vec<f64>,
    direction: Direction,
    affine: Direction,
    residual: Vec<f64>,
    right: Vec<f64>,
    row_weight: Vec<f64>,
    row_right: Vec<f64>,
    /// Inverse distances from l and u, and inverses of λ and w − λ; 0 where these are infinite.
    lower_inverse: Vec<f64>,
    upper_inverse: Vec<f64>,
    multiplier_inverse: Vec<f64>,
    rest_inverse: Vec<f64>,
    factor: BlockCholesky,
}

/// [`BlockTridiagonalQpSolver::iterate`], compiled for the widest vectors that the processor has.
/// A closure of this size would be called as a function compiled for any processor.
struct Solve<'a> {
    solver: &'a mut BlockTridiagonalQpSolver,
    qp: &'a BlockTridiagonalQp,
}

impl pulp::NullaryFnOnce for Solve<'_> {
    type Output = Result<BlockTridiagonalQpReport, BlockTridiagonalQpError>;

    #[inline(always)]
    fn call(self) -> Self::Output {
        self.solver.iterate(self.qp)
    }
}

/// The same for a factorisation alone; whether there is one.
struct Factorise<'a> {
    factor: &'a mut BlockCholesky,
    qp: &'a BlockTridiagonalQp,
}

impl pulp::NullaryFnOnce for Factorise<'_> {
    type Output = bool;

    #[inline(always)]
    fn call(self) -> bool {
        let BlockTridiagonalQp {
            blocks,
            size,
            diagonal,
            coupling,
            ..
        } = self.qp;
        self.factor.load(*blocks, *size, diagonal, coupling);
        self.factor.factorise().is_ok()
    }
}

/// A Newton step in all unknowns.
#[derive(Debug, Clone, Default)]
struct Direction {
    t: Vec<f64>,
    value: Vec<f64>,
    slack: Vec<f64>,
    multiplier: Vec<f64>,
    lower: Vec<f64>,
    upper: Vec<f64>,
}

impl Direction {
    fn resize(&mut self, variables: usize, rows: usize) {
        for (vector, length) in [
            (&mut self.t, variables),
            (&mut self.lower, variables),
            (&mut self.upper, variables),
            (&mut self.value, rows),
            (&mut self.slack, rows),
            (&mut self.multiplier, rows),
        ] {
            refill(vector, length, 0.0);
        }
    }
}

impl Default for BlockTridiagonalQpSolver {
    fn default() -> Self {
        Self::new()
    }
}

impl BlockTridiagonalQpSolver {
    /// A solver with tolerance 1e-8 and at most 60 iterations.
    #[must_use]
    pub fn new() -> Self {
        Self {
            tolerance: 1e-8,
            max_iterations: 60,
            t: Vec::new(),
            value: Vec::new(),
            slack: Vec::new(),
            multiplier: Vec::new(),
            lower_multiplier: Vec::new(),
            upper_multiplier: Vec::new(),
            bound_multiplier: Vec::new(),
            direction: Direction::default(),
            affine: Direction::default(),
            residual: Vec::new(),
            right: Vec::new(),
            row_weight: Vec::new(),
            row_right: Vec::new(),
            lower_inverse: Vec::new(),
            upper_inverse: Vec::new(),
            multiplier_inverse: Vec::new(),
            rest_inverse: Vec::new(),
            factor: BlockCholesky::default(),
        }
    }

    /// Sets the tolerance: of stationarity, relative to the gradient, and of the duality gap,
    /// relative to the objective.
    #[must_use]
    pub fn tolerance(mut self, tolerance: f64) -> Self {
        self.tolerance = tolerance;
        self
    }

    /// Sets the largest number of iterations.
    #[must_use]
    pub fn max_iterations(mut self, iterations: usize) -> Self {
        self.max_iterations = iterations;
        self
    }

    /// The solution of the last solve, blocks one after the other.
    #[must_use]
    pub fn solution(&self) -> &[f64] {
        &self.t
    }

    /// Multipliers λ of the rows, between 0 and the price: the objective grows by λ with b.
    #[must_use]
    pub fn row_multipliers(&self) -> &[f64] {
        &self.multiplier
    }

    /// Multipliers ζ of the bounds: positive at a lower, negative at an upper bound.
    #[must_use]
    pub fn bound_multipliers(&self) -> &[f64] {
        &self.bound_multiplier
    }

    /// Whether the Hessian of `qp` is positive definite. Cost: one factorisation.
    pub fn is_convex(&mut self, qp: &BlockTridiagonalQp) -> bool {
        pulp::Arch::new().dispatch(Factorise {
            factor: &mut self.factor,
            qp,
        })
    }

    /// Solves `qp`.
    ///
    /// # Errors
    /// [`BlockTridiagonalQpError`]: data that are not finite, bounds without room, prices that are
    /// not positive, or a Hessian that is not positive definite.
    pub fn solve(
        &mut self,
        qp: &BlockTridiagonalQp,
    ) -> Result<BlockTridiagonalQpReport, BlockTridiagonalQpError> {
        qp.validate()?;
        pulp::Arch::new().dispatch(Solve { solver: self, qp })
    }

    #[inline(always)]
    fn iterate(
        &mut self,
        qp: &BlockTridiagonalQp,
    ) -> Result<BlockTridiagonalQpReport, BlockTridiagonalQpError> {
        self.begin(qp);
        let mut status = BlockTridiagonalQpStatus::Stalled;
        let mut iterations = 0;
        loop {
            self.refresh_residual(qp);
            let gap = self.complementarity(qp);
            let pairs = self.pairs(qp).max(1) as f64;
            let scale = 1.0 + self.smooth_objective(qp).abs();
            let stationary = largest(&self.residual)
                <= self.tolerance * (1.0 + largest(&qp.gradient).max(largest(&self.multiplier)));
            if stationary && gap <= self.tolerance * scale {
                status = BlockTridiagonalQpStatus::Solved;
                break;
            }
            if iterations == self.max_iterations {
                break;
            }
            iterations += 1;
            self.factorise(qp)?;
            // Predictor: straight at the solution.
            self.newton(qp, 0.0, false);
            let step = self.longest_step(qp);
            let aimed = self.complementarity_after(qp, step);
            let mu = gap / pairs;
            let centring = (aimed / gap.max(f64::MIN_POSITIVE)).powi(3).min(1.0);
            std::mem::swap(&mut self.direction, &mut self.affine);
            // Corrector: with what the predictor makes of the products.
            self.newton(qp, centring * mu, true);
            let step = (TO_THE_BOUND * self.longest_step(qp)).min(1.0);
            if !(step > 1e-10) {
                break;
            }
            self.advance(qp, step);
        }
        let gap = self.complementarity(qp) / self.pairs(qp).max(1) as f64;
        for ((b, l), u) in self
            .bound_multiplier
            .iter_mut()
            .zip(&self.lower_multiplier)
            .zip(&self.upper_multiplier)
        {
            *b = l - u;
        }
        Ok(BlockTridiagonalQpReport {
            status,
            objective: qp.objective(&self.t),
            stationarity: largest(&self.residual),
            infeasibility: qp
                .rows
                .iter()
                .filter(|row| row.price.is_infinite())
                .map(|row| qp.shortfall(row, &self.t))
                .fold(0.0, f64::max),
            complementarity: gap,
            iterations,
        })
    }

    /// An interior starting point: the middle of the box where it has one, every product of a
    /// multiplier and its distance about the same.
    #[inline(always)]
    fn begin(&mut self, qp: &BlockTridiagonalQp) {
        let (variables, rows) = (qp.gradient.len(), qp.rows.len());
        self.t.clear();
        self.t
            .extend(qp.lower.iter().zip(&qp.upper).map(|(&lower, &upper)| {
                match (lower.is_finite(), upper.is_finite()) {
                    (true, true) => 0.5 * (lower + upper),
                    (true, false) => (lower + 1.0).max(0.0),
                    (false, true) => (upper - 1.0).min(0.0),
                    (false, false) => 0.0,
                }
            }));
        refill(&mut self.residual, variables, 0.0);
        refill(&mut self.right, variables, 0.0);
        refill(&mut self.bound_multiplier, variables, 0.0);
        refill(&mut self.row_weight, rows, 0.0);
        refill(&mut self.row_right, rows, 0.0);
        refill(&mut self.lower_inverse, variables, 0.0);
        refill(&mut self.upper_inverse, variables, 0.0);
        refill(&mut self.multiplier_inverse, rows, 0.0);
        refill(&mut self.rest_inverse, rows, 0.0);
        self.direction.resize(variables, rows);
        self.affine.resize(variables, rows);
        let force = largest(&qp.gradient).max(1e-3);
        refill(&mut self.lower_multiplier, variables, 0.0);
        refill(&mut self.upper_multiplier, variables, 0.0);
        for (i, (&lower, &upper)) in qp.lower.iter().zip(&qp.upper).enumerate() {
            if lower.is_finite() {
                self.lower_multiplier[i] = 0.1 * force;
            }
            if upper.is_finite() {
                self.upper_multiplier[i] = 0.1 * force;
            }
        }
        for vector in [&mut self.value, &mut self.slack, &mut self.multiplier] {
            refill(vector, rows, 0.0);
        }
        for (i, row) in qp.rows.iter().enumerate() {
            let above = qp.row_value(row, &self.t) - row.at_least;
            let width = dot(qp.coefficients(row), qp.coefficients(row)).sqrt();
            let room = INTERIOR * width.max(1e-3);
            if row.price.is_finite() {
                self.slack[i] = (-above).max(0.0) + room;
                self.value[i] = above + self.slack[i];
                self.multiplier[i] = (0.1 * force).min(0.5 * row.price);
            } else {
                self.value[i] = above.max(room);
                self.multiplier[i] = 0.1 * force;
            }
        }
    }

    /// Residual of stationarity, Ht + g − Aᵀλ − ζ.
    #[inline(always)]
    fn refresh_residual(&mut self, qp: &BlockTridiagonalQp) {
        qp.times_hessian(&self.t, &mut self.residual);
        axpy(1.0, &qp.gradient, &mut self.residual);
        qp.subtract_rows(&self.multiplier, &mut self.residual);
        axpy(-1.0, &self.lower_multiplier, &mut self.residual);
        axpy(1.0, &self.upper_multiplier, &mut self.residual);
    }

    /// ½ tᵀHt + gᵀt + Σ w s, from the residual.
    #[inline(always)]
    fn smooth_objective(&self, qp: &BlockTridiagonalQp) -> f64 {
        let mut objective = dot(&qp.gradient, &self.t);
        for (i, &t) in self.t.iter().enumerate() {
            let product = self.residual[i] - qp.gradient[i] + self.lower_multiplier[i]
                - self.upper_multiplier[i];
            objective += 0.5 * t * product;
        }
        for ((row, &multiplier), &slack) in qp.rows.iter().zip(&self.multiplier).zip(&self.slack) {
            objective +=
                0.5 * multiplier * dot(qp.coefficients(row), &self.t[row.columns(qp.size)]);
            if row.price.is_finite() {
                objective += row.price * slack;
            }
        }
        objective
    }

    #[inline(always)]
    fn pairs(&self, qp: &BlockTridiagonalQp) -> usize {
        let finite = |bounds: &[f64]| bounds.iter().filter(|b| b.is_finite()).count();
        let priced = qp.rows.iter().filter(|row| row.price.is_finite()).count();
        finite(&qp.lower) + finite(&qp.upper) + qp.rows.len() + priced
    }

    /// Sum of the products of multipliers and distances.
    #[inline(always)]
    fn complementarity(&self, qp: &BlockTridiagonalQp) -> f64 {
        self.complementarity_along(qp, 0.0, &Direction::default())
    }

    /// The same a step along the current direction.
    #[inline(always)]
    fn complementarity_after(&self, qp: &BlockTridiagonalQp, step: f64) -> f64 {
        self.complementarity_along(qp, step, &self.direction)
    }

    #[inline(always)]
    fn complementarity_along(&self, qp: &BlockTridiagonalQp, step: f64, along: &Direction) -> f64 {
        let move_by = |v: f64, direction: &[f64], i: usize| {
            v + step * direction.get(i).copied().unwrap_or(0.0)
        };
        let mut sum = 0.0;
        for i in 0..self.t.len() {
            let t = move_by(self.t[i], &along.t, i);
            if qp.lower[i].is_finite() {
                sum += (t - qp.lower[i]) * move_by(self.lower_multiplier[i], &along.lower, i);
            }
            if qp.upper[i].is_finite() {
                sum += (qp.upper[i] - t) * move_by(self.upper_multiplier[i], &along.upper, i);
            }
        }
        for (i, row) in qp.rows.iter().enumerate() {
            let multiplier = move_by(self.multiplier[i], &along.multiplier, i);
            sum += move_by(self.value[i], &along.value, i) * multiplier;
            if row.price.is_finite() {
                sum += move_by(self.slack[i], &along.slack, i) * (row.price - multiplier);
            }
        }
        sum
    }

    /// Factorises the Hessian with the terms of rows and bounds.
    #[inline(always)]
    fn factorise(&mut self, qp: &BlockTridiagonalQp) -> Result<(), BlockTridiagonalQpError> {
        let k = qp.size;
        self.factor.load(qp.blocks, k, &qp.diagonal, &qp.coupling);
        for (i, (&lower, &upper)) in qp.lower.iter().zip(&qp.upper).enumerate() {
            let (below, above) = (1.0 / (self.t[i] - lower), 1.0 / (upper - self.t[i]));
            self.lower_inverse[i] = below;
            self.upper_inverse[i] = above;
            let weight = self.lower_multiplier[i] * below + self.upper_multiplier[i] * above;
            self.factor.add_diagonal(i, weight);
        }
        let softest = SOFTEST / largest(&qp.diagonal).max(f64::MIN_POSITIVE);
        for (i, row) in qp.rows.iter().enumerate() {
            let (value, multiplier) = (self.value[i], self.multiplier[i]);
            let (inverse, rest) = (1.0 / multiplier, 1.0 / (row.price - multiplier));
            self.multiplier_inverse[i] = inverse;
            self.rest_inverse[i] = rest;
            let weight = 1.0 / (value * inverse + self.slack[i] * rest + softest);
            self.row_weight[i] = weight;
            self.factor
                .add_outer_product(row.block as usize, qp.coefficients(row), weight);
        }
        self.factor
            .factorise()
            .map_err(|block| BlockTridiagonalQpError::NotConvex { block })
    }

    /// The Newton step towards products of `target`, into `direction`; when `correct`, less the
    /// products of the affine steps.
    #[inline(always)]
    fn newton(&mut self, qp: &BlockTridiagonalQp, target: f64, correct: bool) {
        let k = qp.size;
        let affine = &self.affine;
        let product = |i: usize, a: &[f64], b: &[f64]| if correct { a[i] * b[i] } else { 0.0 };
        // Where a bound is infinite its inverse distance and its multiplier are 0.
        for i in 0..self.t.len() {
            let lower = (target - product(i, &affine.t, &affine.lower)) * self.lower_inverse[i];
            let upper = (target + product(i, &affine.t, &affine.upper)) * self.upper_inverse[i];
            let lower = lower - self.lower_multiplier[i];
            let upper = upper - self.upper_multiplier[i];
            self.right[i] = lower - upper - self.residual[i];
            self.direction.lower[i] = lower;
            self.direction.upper[i] = upper;
        }
        for (i, row) in qp.rows.iter().enumerate() {
            let along = product(i, &affine.value, &affine.multiplier);
            let mut right = (target - along) * self.multiplier_inverse[i] - self.value[i];
            if row.price.is_finite() {
                let across = product(i, &affine.slack, &affine.multiplier);
                let slack = (target + across) * self.rest_inverse[i] - self.slack[i];
                right -= slack;
                self.direction.slack[i] = slack;
            } else {
                // The value need not be that of t yet.
                right -= qp.row_value(row, &self.t) - row.at_least - self.value[i];
            }
            self.row_right[i] = right;
            axpy(
                self.row_weight[i] * right,
                qp.coefficients(row),
                &mut self.right[row.columns(k)],
            );
        }
        self.factor.solve(&mut self.right);
        let direction = &mut self.direction;
        direction.t.copy_from_slice(&self.right);
        for i in 0..self.t.len() {
            let change = direction.t[i];
            direction.lower[i] -= self.lower_multiplier[i] * self.lower_inverse[i] * change;
            direction.upper[i] += self.upper_multiplier[i] * self.upper_inverse[i] * change;
        }
        for (i, row) in qp.rows.iter().enumerate() {
            let along = dot(qp.coefficients(row), &direction.t[row.columns(k)]);
            let multiplier = self.row_weight[i] * (self.row_right[i] - along);
            direction.multiplier[i] = multiplier;
            if row.price.is_finite() {
                direction.slack[i] += self.slack[i] * self.rest_inverse[i] * multiplier;
                direction.value[i] = along + direction.slack[i];
            } else {
                let short = qp.row_value(row, &self.t) - row.at_least - self.value[i];
                direction.value[i] = along + short;
            }
        }
    }

    /// How far all distances and multipliers stay positive along the direction.
    #[inline(always)]
    fn longest_step(&self, qp: &BlockTridiagonalQp) -> f64 {
        let direction = &self.direction;
        let mut step = 1.0 / TO_THE_BOUND;
        let mut limit = |value: f64, change: f64| {
            if change < 0.0 {
                step = f64::min(step, -value / change);
            }
        };
        for i in 0..self.t.len() {
            if qp.lower[i].is_finite() {
                limit(self.t[i] - qp.lower[i], direction.t[i]);
                limit(self.lower_multiplier[i], direction.lower[i]);
            }
            if qp.upper[i].is_finite() {
                limit(qp.upper[i] - self.t[i], -direction.t[i]);
                limit(self.upper_multiplier[i], direction.upper[i]);
            }
        }
        for (i, row) in qp.rows.iter().enumerate() {
            limit(self.value[i], direction.value[i]);
            limit(self.multiplier[i], direction.multiplier[i]);
            if row.price.is_finite() {
                limit(self.slack[i], direction.slack[i]);
                limit(row.price - self.multiplier[i], -direction.multiplier[i]);
            }
        }
        step.min(1.0)
    }

    #[inline(always)]
    fn advance(&mut self, qp: &BlockTridiagonalQp, step: f64) {
        let direction = &self.direction;
        axpy(step, &direction.t, &mut self.t);
        axpy(step, &direction.lower, &mut self.lower_multiplier);
        axpy(step, &direction.upper, &mut self.upper_multiplier);
        axpy(step, &direction.slack, &mut self.slack);
        axpy(step, &direction.multiplier, &mut self.multiplier);
        axpy(step, &direction.value, &mut self.value);
        // Against the growth of rounding errors: z = aᵀt − b + s where both stay positive.
        for (i, row) in qp.rows.iter().enumerate() {
            if row.price.is_finite() {
                let above = qp.row_value(row, &self.t) - row.at_least;
                if above + self.slack[i] > 0.5 * self.value[i] {
                    self.value[i] = above + self.slack[i];
                }
            }
        }
    }
}
