//! Bad input, as the program reports it.

use tensegra::model::ReadErrors;

/// Why a command did not run.
pub enum Failure {
    /// A problem file with errors, to be shown in its text.
    Problem(Box<ReadErrors>),
    /// Anything else, in one sentence.
    Message(String),
}

impl Failure {
    /// A failure of the given kind as one sentence.
    pub fn message(error: impl std::fmt::Display) -> Self {
        Self::Message(error.to_string())
    }

    /// Prints the failure on standard error.
    pub fn report(self) {
        match self {
            Self::Problem(errors) => eprintln!("{:?}", miette::Report::new(*errors)),
            Self::Message(message) => eprintln!("error: {message}"),
        }
    }

    /// The failure as text without decoration.
    pub fn text(&self) -> String {
        match self {
            Self::Problem(errors) => format!("{errors:#}"),
            Self::Message(message) => message.clone(),
        }
    }
}

impl From<ReadErrors> for Failure {
    fn from(errors: ReadErrors) -> Self {
        Self::Problem(Box::new(errors))
    }
}
