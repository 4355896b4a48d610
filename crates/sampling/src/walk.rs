//! Straight walks on the manifold from point to point, without sliding.

use tensegra_atlas::{Chart, ImplicitManifold, ManifoldError, Validity, Workspace};

use crate::tree::squared_distance;

/// A kept chart serves points up to this distance from its centre.
const NEARBY: f64 = 0.5;
/// The chart is moved along where the walk is farther from its centre.
const RECENTER: f64 = 0.2;
/// Each step must lower the squared distance to the goal by this multiple of
/// the squared step.
const NEARER: f64 = 0.1;
/// Residual of the points.
const TOLERANCE: f64 = 1e-12;
/// A step may be this much longer on the manifold than in tangent coordinates.
const STRETCH: f64 = 1.3;

/// Charts by the points that they were built at: the nearest one, moved, saves
/// a factorisation.
#[derive(Clone, Debug, Default)]
pub(crate) struct ChartPool {
    built: Vec<Chart>,
}

impl ChartPool {
    /// Makes `chart` a chart about `x`.
    pub(crate) fn chart_at<M: ImplicitManifold + ?Sized>(
        &mut self,
        manifold: &M,
        dimension: usize,
        x: &[f64],
        chart: &mut Option<Chart>,
        work: &mut Workspace,
    ) -> Result<(), ManifoldError> {
        let nearest = self
            .built
            .iter()
            .map(|chart| (squared_distance(chart.center(), x), chart))
            .min_by(|a, b| a.0.total_cmp(&b.0));
        if let Some((distance, nearest)) = nearest
            && distance < NEARBY * NEARBY
        {
            let mut moved = chart.take().unwrap_or_else(|| nearest.clone());
            moved.clone_from(nearest);
            let done = moved.recenter(manifold, x, work);
            *chart = Some(moved);
            if done {
                return Ok(());
            }
        }
        let new = Chart::new(manifold, x, dimension, work)?;
        self.built.push(new.clone());
        *chart = Some(new);
        Ok(())
    }
}

/// Walks on a manifold, with their memory.
pub(crate) struct Walker<'a, M: ?Sized, V: Validity> {
    manifold: &'a M,
    validity: &'a V,
    dimension: usize,
    step: f64,
    max_displacement: f64,
    pool: ChartPool,
    chart: Option<Chart>,
    work: Workspace,
    memory: V::Memory,
    next_memory: V::Memory,
    limits: Vec<f64>,
    here: Vec<f64>,
    next: Vec<f64>,
    here_t: Vec<f64>,
    goal_t: Vec<f64>,
}

impl<'a, M: ImplicitManifold + ?Sized, V: Validity> Walker<'a, M, V> {
    pub(crate) fn new(
        manifold: &'a M,
        validity: &'a V,
        dimension: usize,
        step: f64,
        max_displacement: f64,
    ) -> Self {
        let m = manifold.ambient_dimension();
        Self {
            manifold,
            validity,
            dimension,
            step,
            max_displacement,
            pool: ChartPool::default(),
            chart: None,
            work: Workspace::default(),
            memory: validity.memory(),
            next_memory: validity.memory(),
            limits: vec![0.0; manifold.limit_count()],
            here: vec![0.0; m],
            next: vec![0.0; m],
            here_t: vec![0.0; dimension],
            goal_t: vec![0.0; dimension],
        }
    }

    /// Walks from `start` to `goal`, straight in tangent coordinates, and writes
    /// the points between into `points`. `None` where something is in the way,
    /// the walk gets no nearer, or would become longer than `longest`; else the
    /// length walked.
    pub(crate) fn walk(
        &mut self,
        start: &[f64],
        goal: &[f64],
        longest: f64,
        points: &mut Vec<Vec<f64>>,
    ) -> Option<f64> {
        points.clear();
        self.here.copy_from_slice(start);
        self.validity.enter(start, &mut self.memory);
        self.center(start, goal)?;
        let mut length = 0.0;
        let mut step = self.step;
        loop {
            let left = squared_distance(&self.here, goal).sqrt();
            if length + left > longest {
                return None;
            }
            if left <= self.step
                && self.validity.displacement(&self.here, goal) <= self.max_displacement
            {
                self.next.copy_from_slice(goal);
                return self.is_valid_step().then_some(length + left);
            }
            let distance = squared_distance(&self.here_t, &self.goal_t).sqrt();
            if distance < 1e-3 * self.step {
                return None;
            }
            // The last two steps are alike.
            let share = step.min(0.5 * distance.max(left.min(step))) / distance;
            let chart = self.chart.as_ref()?;
            self.next.copy_from_slice(&self.here);
            for (j, (goal, here)) in self.goal_t.iter().zip(&self.here_t).enumerate() {
                let along = share * (goal - here);
                for (x, v) in self.next.iter_mut().zip(chart.tangent(j)) {
                    *x += along * v;
                }
            }
            chart
                .retract(self.manifold, &mut self.next, TOLERANCE, &mut self.work)
                .ok()?;
            let walked = squared_distance(&self.here, &self.next).sqrt();
            if walked > self.step
                || self.validity.displacement(&self.here, &self.next) > self.max_displacement
            {
                step *= 0.7;
                if step < 0.1 * self.step {
                    return None;
                }
                continue;
            }
            let nearer =
                squared_distance(&self.next, goal) <= left * left - NEARER * walked * walked;
            let stretched = walked > STRETCH * share * distance;
            if !nearer || stretched || !self.is_within_limits() || !self.is_valid_step() {
                return None;
            }
            length += walked;
            points.push(self.next.clone());
            std::mem::swap(&mut self.here, &mut self.next);
            std::mem::swap(&mut self.memory, &mut self.next_memory);
            let chart = self.chart.as_ref()?;
            chart.log(&self.here, &mut self.here_t);
            if self.here_t.iter().any(|t| t.abs() > RECENTER) {
                let here = std::mem::take(&mut self.here);
                let centred = self.center(&here, goal);
                self.here = here;
                centred?;
            }
        }
    }

    /// Puts the chart about `x`.
    fn center(&mut self, x: &[f64], goal: &[f64]) -> Option<()> {
        self.pool
            .chart_at(
                self.manifold,
                self.dimension,
                x,
                &mut self.chart,
                &mut self.work,
            )
            .ok()?;
        self.here_t.fill(0.0);
        self.chart.as_ref()?.log(goal, &mut self.goal_t);
        Some(())
    }

    /// Whether `next` is within all bounds and limits.
    fn is_within_limits(&mut self) -> bool {
        let bounds = (self.manifold.lower_bounds().iter()).zip(self.manifold.upper_bounds());
        let within = (self.next.iter().zip(bounds)).all(|(x, (lo, hi))| lo <= x && x <= hi);
        self.manifold.limits(&self.next, &mut self.limits);
        within && self.limits.iter().all(|&value| value >= 0.0)
    }

    /// Whether the step from `here` to `next` is valid.
    fn is_valid_step(&mut self) -> bool {
        let Some(chart) = self.chart.as_ref() else {
            return false;
        };
        let (manifold, here, next, work) = (self.manifold, &self.here, &self.next, &mut self.work);
        self.validity
            .step(
                &self.memory,
                next,
                &mut self.next_memory,
                &mut |s, y| {
                    interpolate(here, next, s, y);
                    chart.retract(manifold, y, TOLERANCE, work).is_ok()
                },
                &mut Vec::new(),
            )
            .is_ok()
    }
}

/// y = (1 − s) a + s b.
pub(crate) fn interpolate(a: &[f64], b: &[f64], s: f64, y: &mut [f64]) {
    for ((y, a), b) in y.iter_mut().zip(a).zip(b) {
        *y = a + s * (b - a);
    }
}
