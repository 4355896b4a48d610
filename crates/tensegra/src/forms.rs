//! From a problem to forms: stable configurations that meet what the problem asks for.

use std::borrow::Cow;

use tensegra_check::{CheckOptions, Report, check_form};
use tensegra_formfinding::{FormError, FormProblem, Forms};
use tensegra_model::{Configuration, Endpoint, Problem};

/// How forms are sought.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct FormOptions {
    /// Seed of the random starts; the problem's if not given.
    pub seed: Option<u64>,
    /// Number of starts; the problem's if not given.
    pub starts: Option<usize>,
    /// Number of threads; as many as there are processors if not given. Results do not depend
    /// on it.
    pub threads: Option<usize>,
}

impl FormOptions {
    /// Sets the seed.
    #[must_use]
    pub fn with_seed(mut self, seed: u64) -> Self {
        self.seed = Some(seed);
        self
    }

    /// Sets the number of starts.
    #[must_use]
    pub fn with_starts(mut self, starts: usize) -> Self {
        self.starts = Some(starts);
        self
    }

    /// Sets the number of threads.
    #[must_use]
    pub fn with_threads(mut self, threads: usize) -> Self {
        self.threads = Some(threads);
        self
    }
}

/// Forms, and what the judge says of each.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct JudgedForms {
    /// The forms.
    pub forms: Forms,
    /// The judge's report on each.
    pub reports: Vec<Report>,
    /// Seed of the random starts.
    pub seed: u64,
}

impl JudgedForms {
    /// Number of forms that the judge accepts.
    pub fn accepted(&self) -> usize {
        self.reports.iter().filter(|report| report.ok).count()
    }
}

/// Finds forms of the problem's structure that meet the conditions of its `[formfind]` table,
/// from many random starts in parallel, and has each judged.
///
/// # Errors
/// [`FormError`]: the problem makes no sense, or no start led to a form; what cannot be met is
/// named.
pub fn formfind(problem: &Problem, options: FormOptions) -> Result<JudgedForms, FormError> {
    let seed = options.seed.unwrap_or(problem.seed);
    let starts = options.starts.unwrap_or(problem.form.starts);
    let found = FormProblem::new(problem, &[])?;
    let find = || found.find(seed, starts);
    let forms = match options
        .threads
        .map(|threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build())
    {
        Some(Ok(pool)) => pool.install(find)?,
        // Without threads of its own it works on those there are.
        Some(Err(_)) | None => find()?,
    };
    let check = CheckOptions::default();
    let reports = forms
        .forms
        .iter()
        .map(|form| check_form(problem, &form.configuration, &check))
        .collect();
    Ok(JudgedForms {
        forms,
        reports,
        seed,
    })
}

/// The problem with its start and goal found, where it describes them by conditions
/// (`start = { formfind = { … } }`). The goal is sought from the start first, so that it is
/// connected with it more often than not.
///
/// # Errors
/// "start" or "goal", and why there is no such form.
pub fn find_endpoints(problem: &Problem) -> Result<Cow<'_, Problem>, (&'static str, FormError)> {
    if problem.start_form.is_none() && problem.goal_form.is_none() {
        return Ok(Cow::Borrowed(problem));
    }
    let mut resolved = problem.clone();
    let mut near: Option<Configuration> = problem
        .start
        .as_ref()
        .map(|start| crate::complete(&problem.structure, start));
    let starts = problem.form.starts;
    if let Some(conditions) = resolved.start_form.take() {
        let form = FormProblem::new(problem, &conditions)
            .and_then(|found| found.find_one(None, problem.seed, starts))
            .map_err(|error| ("start", error))?;
        resolved.start = Some(endpoint(&form.configuration));
        near = Some(form.configuration);
    }
    if let Some(conditions) = resolved.goal_form.take() {
        let form = FormProblem::new(problem, &conditions)
            .and_then(|found| found.find_one(near.as_ref(), problem.seed, starts))
            .map_err(|error| ("goal", error))?;
        resolved.goal = Some(endpoint(&form.configuration));
    }
    Ok(Cow::Owned(resolved))
}

fn endpoint(configuration: &Configuration) -> Endpoint {
    Endpoint {
        positions: configuration.positions.clone(),
        forces: configuration.forces.clone(),
        rest_lengths: configuration.rest_lengths.clone(),
    }
}
