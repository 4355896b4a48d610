use crate::{Nlp, OptionError, ProblemError, SqpOptions, SqpReport};

/// SQP for large, sparse problems.
#[derive(Debug)]
pub struct SparseSqp {
    options: SqpOptions,
}

impl SparseSqp {
    /// A solver with the given options.
    ///
    /// # Errors
    /// An option outside its range.
    pub fn new(options: SqpOptions) -> Result<Self, OptionError> {
        options.validate()?;
        Ok(Self { options })
    }

    /// Solves `problem` from `x`, which is overwritten by the final point.
    ///
    /// # Errors
    /// See [`ProblemError`].
    pub fn solve<P: Nlp>(
        &mut self,
        _problem: &mut P,
        _x: &mut [f64],
    ) -> Result<SqpReport, ProblemError> {
        unimplemented!("{:?}", self.options)
    }

    /// Multipliers λ of the constraints at the final point of the last solve: positive at an
    /// upper bound, negative at a lower bound.
    #[must_use]
    pub fn multipliers(&self) -> &[f64] {
        &[]
    }
}
