//! What reading a file finds: errors, warnings and notes that point into a text.
//!
//! A [`Finding`] is a [`miette::Diagnostic`]: a renderer shows file, line and
//! column, underlines the text concerned and prints the hint. Without a renderer,
//! `{:#}` gives the same on one line.

use std::{
    fmt,
    ops::Range,
    path::{Path, PathBuf},
    sync::Arc,
};

use miette::{Diagnostic, LabeledSpan, MietteError, SourceCode, SourceSpan, SpanContents};

/// Findings of one kind that are kept; more are only counted.
const KEPT: usize = 40;

/// Length of the longest text that [`Finding::excerpt`] returns, in bytes.
const EXCERPT: usize = 200;

/// A text that was read, with the path it came from. Cloning is cheap.
#[derive(Clone, PartialEq, Eq)]
pub struct SourceFile {
    path: PathBuf,
    name: String,
    text: Arc<str>,
}

impl SourceFile {
    /// A text that claims to come from `path`.
    pub fn new(path: impl Into<PathBuf>, text: impl Into<Arc<str>>) -> Self {
        let path = path.into();
        Self {
            name: path.display().to_string(),
            path,
            text: text.into(),
        }
    }

    /// Reads a text file of at most 16 MiB.
    ///
    /// # Errors
    /// [`ReadErrors`] with the reason: no such file, a folder, no text in UTF-8, empty.
    pub fn read(path: &Path) -> Result<Self, ReadErrors> {
        let text = crate::files::load(path)?;
        Ok(Self::new(path, text))
    }

    /// Where the text came from.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The text.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Line and column of a byte of the text, both counted from one, the column
    /// in characters.
    fn line_and_column(&self, offset: usize) -> (usize, usize) {
        let before = &self.text[..self.text.floor_char_boundary(offset)];
        let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
        let line = before.bytes().filter(|&byte| byte == b'\n').count() + 1;
        (line, before[line_start..].chars().count() + 1)
    }
}

impl fmt::Debug for SourceFile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SourceFile")
            .field("path", &self.path)
            .field("bytes", &self.text.len())
            .finish()
    }
}

impl SourceCode for SourceFile {
    fn read_span<'a>(
        &'a self,
        span: &SourceSpan,
        lines_before: usize,
        lines_after: usize,
    ) -> Result<Box<dyn SpanContents<'a> + 'a>, MietteError> {
        let contents = self.text.read_span(span, lines_before, lines_after)?;
        Ok(Box::new(miette::MietteSpanContents::new_named(
            self.name.clone(),
            contents.data(),
            *contents.span(),
            contents.line(),
            contents.column(),
            contents.line_count(),
        )))
    }
}

/// How grave a finding is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Severity {
    /// The file cannot be used.
    Error,
    /// The file can be used, but something in it may not be meant.
    Warning,
    /// Something the file asks to report.
    Note,
}

/// One thing found in a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    severity: Severity,
    message: String,
    hint: Option<String>,
    place: Place,
}

#[derive(Clone, Debug, PartialEq)]
enum Place {
    /// A range of bytes of a text.
    Text {
        file: SourceFile,
        span: Range<usize>,
    },
    /// A file as a whole.
    File { path: PathBuf },
}

impl Finding {
    /// A finding about some bytes of a text.
    pub(crate) fn in_text(
        severity: Severity,
        file: &SourceFile,
        span: Range<usize>,
        message: impl Into<String>,
    ) -> Self {
        Self {
            severity,
            message: message.into(),
            hint: None,
            place: Place::Text {
                file: file.clone(),
                span,
            },
        }
    }

    /// An error about some bytes of a text: for readers of other kinds of files.
    pub fn error(file: &SourceFile, span: Range<usize>, message: impl Into<String>) -> Self {
        Self::in_text(Severity::Error, file, span, message)
    }

    /// An error about a file as a whole.
    pub(crate) fn about_file(path: &Path, message: impl Into<String>) -> Self {
        Self {
            severity: Severity::Error,
            message: message.into(),
            hint: None,
            place: Place::File {
                path: path.to_path_buf(),
            },
        }
    }

    /// Adds a hint.
    pub(crate) fn with_hint(mut self, hint: impl Into<Option<String>>) -> Self {
        self.hint = hint.into();
        self
    }

    /// How grave it is.
    pub fn severity(&self) -> Severity {
        self.severity
    }

    /// What was found.
    pub fn message(&self) -> &str {
        &self.message
    }

    /// How to mend it.
    pub fn hint(&self) -> Option<&str> {
        self.hint.as_deref()
    }

    /// The file concerned.
    pub fn path(&self) -> &Path {
        match &self.place {
            Place::Text { file, .. } => file.path(),
            Place::File { path } => path,
        }
    }

    /// Line and column, counted from one, the column in characters; `None` where
    /// the finding is about a file as a whole.
    pub fn position(&self) -> Option<(usize, usize)> {
        match &self.place {
            Place::Text { file, span } => Some(file.line_and_column(span.start)),
            Place::File { .. } => None,
        }
    }

    /// The text concerned (at most 200 bytes of it).
    pub fn excerpt(&self) -> Option<&str> {
        match &self.place {
            Place::Text { file, span } => {
                let text = file.text();
                let start = text.floor_char_boundary(span.start);
                let end = text.floor_char_boundary(span.end.min(span.start + EXCERPT));
                Some(&text[start..end.max(start)])
            }
            Place::File { .. } => None,
        }
    }
}

impl fmt::Display for Finding {
    /// The message; with `{:#}`, also file, line, column and hint.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !f.alternate() {
            return f.write_str(&self.message);
        }
        write!(f, "{}", self.path().display())?;
        if let Some((line, column)) = self.position() {
            write!(f, ":{line}:{column}")?;
        }
        write!(f, ": {}", self.message)?;
        if let Some(hint) = &self.hint {
            write!(f, " ({hint})")?;
        }
        Ok(())
    }
}

impl std::error::Error for Finding {}

impl Diagnostic for Finding {
    fn severity(&self) -> Option<miette::Severity> {
        Some(match self.severity {
            Severity::Error => miette::Severity::Error,
            Severity::Warning => miette::Severity::Warning,
            Severity::Note => miette::Severity::Advice,
        })
    }

    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        self.hint
            .as_ref()
            .map(|hint| Box::new(hint) as Box<dyn fmt::Display>)
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        match &self.place {
            Place::Text { file, .. } => Some(file),
            Place::File { .. } => None,
        }
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        match &self.place {
            Place::Text { span, .. } => Some(Box::new(std::iter::once(LabeledSpan::underline(
                span.clone(),
            )))),
            Place::File { .. } => None,
        }
    }
}

/// Why a problem could not be read: one or more errors.
#[derive(Clone, Debug, PartialEq)]
pub struct ReadErrors {
    errors: Vec<Finding>,
    omitted: usize,
}

impl ReadErrors {
    /// The errors, in the order in which they were found.
    pub fn errors(&self) -> &[Finding] {
        &self.errors
    }

    /// How many further errors were found but not kept.
    pub fn omitted(&self) -> usize {
        self.omitted
    }
}

impl From<Finding> for ReadErrors {
    fn from(error: Finding) -> Self {
        Self {
            errors: vec![error],
            omitted: 0,
        }
    }
}

impl fmt::Display for ReadErrors {
    /// The number of errors; with `{:#}`, every error on a line of its own.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if f.alternate() {
            for (index, error) in self.errors.iter().enumerate() {
                let separator = if index == 0 { "" } else { "\n" };
                write!(f, "{separator}{error:#}")?;
            }
            if self.omitted > 0 {
                write!(f, "\nand {} more", self.omitted)?;
            }
            return Ok(());
        }
        let (count, many) = match self.errors.len() + self.omitted {
            1 => ("an error".to_string(), ""),
            count => (count.to_string(), " errors"),
        };
        let path = self.errors.first().map_or(Path::new(""), Finding::path);
        write!(f, "cannot read {}: {count}{many}", path.display())
    }
}

impl std::error::Error for ReadErrors {}

impl Diagnostic for ReadErrors {
    fn related<'a>(&'a self) -> Option<Box<dyn Iterator<Item = &'a dyn Diagnostic> + 'a>> {
        Some(Box::new(
            self.errors.iter().map(|error| error as &dyn Diagnostic),
        ))
    }
}

/// Collects what is found while reading.
#[derive(Debug, Default)]
pub(crate) struct Findings {
    errors: Vec<Finding>,
    omitted: usize,
    notices: Vec<Finding>,
}

impl Findings {
    /// Keeps a finding, or counts it when there are many already.
    pub(crate) fn push(&mut self, finding: Finding) {
        let list = match finding.severity {
            Severity::Error => &mut self.errors,
            Severity::Warning | Severity::Note => &mut self.notices,
        };
        if list.len() < KEPT {
            list.push(finding);
        } else if finding.severity == Severity::Error {
            self.omitted += 1;
        }
    }

    /// Whether so many errors were found that looking further serves nobody.
    pub(crate) fn is_full(&self) -> bool {
        self.errors.len() >= KEPT
    }

    /// Number of errors so far.
    pub(crate) fn error_count(&self) -> usize {
        self.errors.len() + self.omitted
    }

    /// The warnings and notes, or all errors if there are any.
    pub(crate) fn finish(self) -> Result<Vec<Finding>, ReadErrors> {
        if self.errors.is_empty() {
            Ok(self.notices)
        } else {
            Err(ReadErrors {
                errors: self.errors,
                omitted: self.omitted,
            })
        }
    }
}

/// The candidate that `name` may be a slip of, as a hint.
pub(crate) fn did_you_mean<'a>(
    name: &str,
    candidates: impl IntoIterator<Item = &'a str>,
) -> Option<String> {
    // Enough candidates for every file that a person writes; bounds the work on
    // generated ones.
    const COMPARED: usize = 10_000;
    candidates
        .into_iter()
        .take(COMPARED)
        .map(|candidate| (edit_distance(name, candidate), candidate))
        .filter(|&(distance, candidate)| {
            distance <= candidate.chars().count().min(name.chars().count()) / 3
        })
        .min()
        .map(|(_, candidate)| format!("did you mean `{candidate}`?"))
}

/// Number of letters to insert, delete, replace or swap with their neighbour
/// (optimal string alignment), letters of either case being equal.
fn edit_distance(a: &str, b: &str) -> usize {
    // Names longer than this are no slips of each other worth pointing out.
    const LONGEST: usize = 64;
    let letters = |text: &str| -> Vec<char> {
        text.chars()
            .take(LONGEST)
            .map(|letter| letter.to_ascii_lowercase())
            .collect()
    };
    let (a, b) = (letters(a), letters(b));
    // The rows of the table of distances between beginnings of a and b, last three.
    let mut before = vec![0; b.len() + 1];
    let mut above: Vec<usize> = (0..=b.len()).collect();
    let mut row = above.clone();
    for i in 1..=a.len() {
        row[0] = i;
        for j in 1..=b.len() {
            let replaced = above[j - 1] + usize::from(a[i - 1] != b[j - 1]);
            row[j] = replaced.min(above[j] + 1).min(row[j - 1] + 1);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                row[j] = row[j].min(before[j - 2] + 1);
            }
        }
        std::mem::swap(&mut before, &mut above);
        std::mem::swap(&mut above, &mut row);
    }
    above[b.len()]
}

/// Names in quotes, shortened to the first few.
pub(crate) fn list_names<'a>(names: impl IntoIterator<Item = &'a str>) -> String {
    const SHOWN: usize = 6;
    let mut names = names.into_iter();
    let shown: Vec<String> = names
        .by_ref()
        .take(SHOWN)
        .map(|name| format!("`{name}`"))
        .collect();
    match names.count() {
        0 => shown.join(", "),
        more => format!("{} and {more} more", shown.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_count_lines_and_characters_from_one() {
        let file = SourceFile::new("a.tens", "één\ntwee drie\n");
        assert_eq!(file.line_and_column(0), (1, 1));
        assert_eq!(file.line_and_column("één".len()), (1, 4));
        assert_eq!(file.line_and_column("één\ntwee ".len()), (2, 6));
        assert_eq!(file.line_and_column(file.text().len()), (3, 1));
    }

    #[test]
    fn a_finding_tells_file_line_column_text_and_hint() {
        let file = SourceFile::new("a.tens", "strut s1 : n1 n2\n  lenght 1");
        let finding = Finding::in_text(Severity::Error, &file, 19..25, "unknown attribute")
            .with_hint(did_you_mean("lenght", ["rest", "length"]));
        assert_eq!(finding.position(), Some((2, 3)));
        assert_eq!(finding.excerpt(), Some("lenght"));
        assert_eq!(
            format!("{finding:#}"),
            "a.tens:2:3: unknown attribute (did you mean `length`?)"
        );
    }

    #[test]
    fn suggestions_are_close_or_absent() {
        assert_eq!(
            did_you_mean("N1", ["n1", "n2"]),
            Some("did you mean `n1`?".to_string())
        );
        assert_eq!(did_you_mean("platform", ["n1", "n2"]), None);
        for (a, b, distance) in [
            ("kitten", "sitting", 3),
            ("rde", "red", 1),
            ("", "ab", 2),
            ("Ab", "aB", 0),
        ] {
            assert_eq!(edit_distance(a, b), distance);
        }
    }

    #[test]
    fn many_errors_are_counted_not_kept() {
        let mut findings = Findings::default();
        for _ in 0..KEPT + 7 {
            findings.push(Finding::about_file(Path::new("a"), "bad"));
        }
        let errors = findings.finish().unwrap_err();
        assert_eq!((errors.errors().len(), errors.omitted()), (KEPT, 7));
    }
}
