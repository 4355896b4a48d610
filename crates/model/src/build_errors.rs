//! All that is wrong with something declared, as one error.

use std::{fmt, ops::Deref};

/// All errors of a structure or an environment under construction, in the order of
/// declaration: at least one. `Display` writes each on a line of its own.
///
/// # Examples
/// ```
/// use tensegra_model::StructureBuilder;
///
/// let errors = StructureBuilder::planar()
///     .strut("s1", ["a", "b"], 1.0)
///     .cable("c1", ["a", "b"], 0.0..=3.0, 1.0, 0.0..=2.0)
///     .fix_coordinate("a", 0, f64::NAN)
///     .pretension(0.0)
///     .build()
///     .unwrap_err();
/// assert_eq!(errors.len(), 2);
/// assert!(errors.to_string().contains("which is no finite number"));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct BuildErrors<E>(Vec<E>);

impl<E> BuildErrors<E> {
    /// `Ok` where there is no error.
    pub(crate) fn none_of(errors: Vec<E>) -> Result<(), Self> {
        if errors.is_empty() {
            Ok(())
        } else {
            Err(Self(errors))
        }
    }
}

impl<E> From<E> for BuildErrors<E> {
    fn from(error: E) -> Self {
        Self(vec![error])
    }
}

impl<E> Deref for BuildErrors<E> {
    type Target = [E];

    fn deref(&self) -> &[E] {
        &self.0
    }
}

impl<E> IntoIterator for BuildErrors<E> {
    type Item = E;
    type IntoIter = std::vec::IntoIter<E>;

    fn into_iter(self) -> Self::IntoIter {
        self.0.into_iter()
    }
}

impl<E: fmt::Display> fmt::Display for BuildErrors<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, error) in self.0.iter().enumerate() {
            let separator = if index == 0 { "" } else { "\n" };
            write!(f, "{separator}{error}")?;
        }
        Ok(())
    }
}

impl<E: fmt::Debug + fmt::Display> std::error::Error for BuildErrors<E> {}

impl<E: fmt::Debug + fmt::Display> miette::Diagnostic for BuildErrors<E> {}
