//! Rows of benchmarks: what every suite measures, as JSON for programs and as
//! Markdown tables for people.

use std::{
    fs, io,
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize};

use crate::{
    atomic::{WriteError, write_atomic},
    json::Layout,
    number::significant,
};

/// One measured quantity of one case, over several runs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BenchRow {
    /// The suite, for instance `manifold`.
    pub suite: String,
    /// The problem, for instance `kite`.
    pub case: String,
    /// What was varied, for instance the formulation; empty for the default.
    pub variant: String,
    /// What was measured, for instance `planning time`.
    pub metric: String,
    /// Its unit; `1` for a number of things or a ratio.
    pub unit: String,
    /// Number of runs.
    pub runs: usize,
    /// Number of runs that succeeded; the other figures are over these.
    pub success: usize,
    /// Median; none when no run succeeded.
    pub median: Option<f64>,
    /// 10th percentile.
    pub p10: Option<f64>,
    /// 90th percentile.
    pub p90: Option<f64>,
    /// What others report for the same quantity.
    pub reference: Vec<ReferenceValue>,
}

/// A figure that a paper or another program gives.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReferenceValue {
    /// Who gives it.
    pub source: String,
    /// The figure, in the unit of the row.
    pub value: f64,
}

/// Why rows were not read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BenchReadError {
    /// The file cannot be opened or read.
    #[error("cannot read `{}`: {reason}", file.display())]
    Unreadable {
        /// The file.
        file: PathBuf,
        /// What the system says.
        reason: io::Error,
    },
    /// The file does not hold rows of benchmarks.
    #[error("`{}` does not hold rows of benchmarks: {reason}", file.display())]
    Malformed {
        /// The file.
        file: PathBuf,
        /// What is wrong, with line and column.
        reason: serde_json::Error,
    },
}

impl BenchRow {
    /// A row over `samples`, one finite value for each run that succeeded out
    /// of `runs`; suite, variant and references are empty, for the caller to
    /// fill in.
    ///
    /// # Examples
    /// ```
    /// use tensegra_io::BenchRow;
    /// let row = BenchRow::new("kite", "charts", "1", 4, &[30.0, 10.0, 20.0]);
    /// assert_eq!((row.runs, row.success, row.median), (4, 3, Some(20.0)));
    /// ```
    pub fn new(case: &str, metric: &str, unit: &str, runs: usize, samples: &[f64]) -> Self {
        let mut sorted = samples.to_vec();
        sorted.sort_by(f64::total_cmp);
        Self {
            suite: String::new(),
            case: case.to_owned(),
            variant: String::new(),
            metric: metric.to_owned(),
            unit: unit.to_owned(),
            runs,
            success: samples.len(),
            median: quantile(&sorted, 0.5),
            p10: quantile(&sorted, 0.1),
            p90: quantile(&sorted, 0.9),
            reference: Vec::new(),
        }
    }
}

/// The value below which the share `level` (0 to 1) of the ascending `sorted`
/// values lies, interpolated linearly between neighbours; none of no values.
///
/// # Examples
/// ```
/// use tensegra_io::quantile;
/// assert_eq!(quantile(&[1.0, 2.0, 4.0], 0.75), Some(3.0));
/// assert_eq!(quantile(&[], 0.5), None);
/// ```
pub fn quantile(sorted: &[f64], level: f64) -> Option<f64> {
    let last = sorted.len().checked_sub(1)?;
    let place = level.clamp(0.0, 1.0) * last as f64;
    let below = (place.floor() as usize).min(last);
    let above = (below + 1).min(last);
    let share = place - below as f64;
    Some(sorted[below] + share * (sorted[above] - sorted[below]))
}

/// Writes rows as a JSON array, whole or not at all.
///
/// # Errors
/// [`WriteError`] when the file cannot be written.
pub fn write_bench_rows(file: &Path, rows: &[BenchRow]) -> Result<(), WriteError> {
    let mut bytes = Vec::new();
    let mut serializer = serde_json::Serializer::with_formatter(&mut bytes, Layout::default());
    rows.serialize(&mut serializer)
        .map_err(|failure| WriteError::File {
            file: file.to_path_buf(),
            reason: failure.into(),
        })?;
    bytes.push(b'\n');
    write_atomic(file, &bytes)
}

/// Reads rows that [`write_bench_rows`] wrote.
///
/// # Errors
/// [`BenchReadError`] when the file is unreadable or holds something else.
pub fn read_bench_rows(file: &Path) -> Result<Vec<BenchRow>, BenchReadError> {
    let bytes = fs::read(file).map_err(|reason| BenchReadError::Unreadable {
        file: file.to_path_buf(),
        reason,
    })?;
    serde_json::from_slice(&bytes).map_err(|reason| BenchReadError::Malformed {
        file: file.to_path_buf(),
        reason,
    })
}

/// The rows as a Markdown table, in the order given.
pub fn bench_table(rows: &[BenchRow]) -> MarkdownTable {
    let mut table = MarkdownTable::new([
        Column::left("case"),
        Column::left("variant"),
        Column::left("metric"),
        Column::left("unit"),
        Column::right("success"),
        Column::right("median"),
        Column::right("p10"),
        Column::right("p90"),
        Column::left("reference"),
    ]);
    let figure = |value: Option<f64>| value.map_or_else(|| "–".to_owned(), |v| significant(v, 3));
    for row in rows {
        let references: Vec<String> = row
            .reference
            .iter()
            .map(|reference| format!("{} {}", reference.source, significant(reference.value, 3)))
            .collect();
        table.push([
            row.case.clone(),
            row.variant.clone(),
            row.metric.clone(),
            row.unit.clone(),
            format!("{}/{}", row.success, row.runs),
            figure(row.median),
            figure(row.p10),
            figure(row.p90),
            references.join("; "),
        ]);
    }
    table
}

/// A column of a [`MarkdownTable`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Column {
    title: String,
    right: bool,
}

impl Column {
    /// A column of text, set flush left.
    pub fn left(title: impl Into<String>) -> Self {
        Self {
            title: title.into(),
            right: false,
        }
    }

    /// A column of figures, set flush right.
    pub fn right(title: impl Into<String>) -> Self {
        Self {
            title: title.into(),
            right: true,
        }
    }
}

/// A table in Markdown whose source is as readable as its rendering: columns
/// are padded to one width.
///
/// # Examples
/// ```
/// use tensegra_io::{Column, MarkdownTable};
/// let mut table = MarkdownTable::new([Column::left("case"), Column::right("k")]);
/// table.push(["kite", "3"]);
/// table.push(["tower", "15"]);
/// assert_eq!(
///     table.to_string(),
///     "| case  |   k |\n|-------|----:|\n| kite  |   3 |\n| tower |  15 |\n"
/// );
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MarkdownTable {
    columns: Vec<Column>,
    rows: Vec<Vec<String>>,
}

impl MarkdownTable {
    /// A table without rows.
    pub fn new(columns: impl IntoIterator<Item = Column>) -> Self {
        let mut columns: Vec<Column> = columns.into_iter().collect();
        for column in &mut columns {
            column.title = cell(&column.title);
        }
        Self {
            columns,
            rows: Vec::new(),
        }
    }

    /// Adds a row; cells that are missing stay empty, those that no column has
    /// are dropped.
    pub fn push<S: Into<String>>(&mut self, cells: impl IntoIterator<Item = S>) {
        let mut row: Vec<String> = cells.into_iter().map(|text| cell(&text.into())).collect();
        row.resize(self.columns.len(), String::new());
        self.rows.push(row);
    }
}

/// A text that stays in its cell.
fn cell(text: &str) -> String {
    text.replace('|', "\\|").replace(['\n', '\r'], " ")
}

impl std::fmt::Display for MarkdownTable {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let width = |text: &String| text.chars().count();
        let widths: Vec<usize> = (0..self.columns.len())
            .map(|c| {
                let cells = self.rows.iter().map(|row| width(&row[c]));
                cells.fold(width(&self.columns[c].title).max(3), usize::max)
            })
            .collect();
        let line = |f: &mut std::fmt::Formatter<'_>, cells: &[&String]| {
            for ((column, text), width) in self.columns.iter().zip(cells).zip(&widths) {
                match column.right {
                    true => write!(f, "| {text:>width$} ")?,
                    false => write!(f, "| {text:<width$} ")?,
                }
            }
            writeln!(f, "|")
        };
        line(
            f,
            &self.columns.iter().map(|c| &c.title).collect::<Vec<_>>(),
        )?;
        for (column, width) in self.columns.iter().zip(&widths) {
            let end = if column.right { ":" } else { "-" };
            write!(f, "|{}{end}", "-".repeat(width + 1))?;
        }
        writeln!(f, "|")?;
        self.rows
            .iter()
            .try_for_each(|row| line(f, &row.iter().collect::<Vec<_>>()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_read_back_as_written() {
        let mut row = BenchRow::new("kite", "planning time", "s", 3, &[0.1, 0.3]);
        row.suite = "manifold".into();
        row.reference.push(ReferenceValue {
            source: "paper".into(),
            value: 0.16,
        });
        let none = BenchRow::new("tower", "planning time", "s", 3, &[]);
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("rows.json");
        write_bench_rows(&file, &[row.clone(), none.clone()]).unwrap();
        assert_eq!(read_bench_rows(&file).unwrap(), [row, none]);
        std::fs::write(&file, "{").unwrap();
        let failure = read_bench_rows(&file).unwrap_err().to_string();
        assert!(failure.contains("rows.json"), "{failure}");
    }

    #[test]
    fn table_shows_figures_and_references() {
        let mut row = BenchRow::new("kite", "planning time", "s", 2, &[0.0012345, 0.0012345]);
        row.reference.push(ReferenceValue {
            source: "a|b".into(),
            value: 12345.6,
        });
        let none = BenchRow::new("tower", "charts", "1", 1, &[]);
        let text = bench_table(&[row, none]).to_string();
        let lines: Vec<&str> = text.lines().collect();
        assert!(lines[2].contains("|     2/2 | 0.00123 |"), "{text}");
        assert!(lines[2].contains("a\\|b 12346"), "{text}");
        assert!(lines[3].contains("|     0/1 |       – |"), "{text}");
        let widths = lines.iter().map(|line| line.chars().count());
        assert!(
            widths.clone().all(|width| width == lines[0].len()),
            "{text}"
        );
    }
}
