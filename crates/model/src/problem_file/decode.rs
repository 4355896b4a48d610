//! Takes values out of a parsed TOML text, with the place of each, and reports
//! everything that does not fit.

use std::ops::Range;

use nalgebra::Point3;
use toml::{
    Spanned,
    de::{DeTable, DeValue},
};

use crate::{
    declarations::Span,
    diagnostic::{Finding, Findings, Severity, SourceFile, did_you_mean},
    structure::Interval,
    tens::{Reader, Reported, Scope, Token},
};

/// A value of a TOML text and its place.
pub(crate) type Value<'t> = &'t Spanned<DeValue<'t>>;

/// Reads values of one file.
pub(crate) struct Decoder<'a> {
    pub(crate) file: &'a SourceFile,
    pub(crate) findings: &'a mut Findings,
    /// Constants that expressions may name.
    pub(crate) scope: Scope,
}

/// A table whose keys are taken one by one, so that those left over can be
/// reported.
#[derive(Clone, Debug)]
pub(crate) struct Table<'t> {
    /// Where the table stands.
    pub(crate) span: Span,
    entries: Vec<Entry<'t>>,
    known: Vec<&'static str>,
}

/// A key and its value.
#[derive(Clone, Debug)]
pub(crate) struct Entry<'t> {
    pub(crate) key: &'t str,
    pub(crate) key_span: Span,
    pub(crate) value: Value<'t>,
    taken: bool,
}

impl<'t> Table<'t> {
    /// A table with its entries in the order of the text.
    pub(crate) fn new(table: &'t DeTable<'t>, span: Span) -> Self {
        let mut entries: Vec<Entry<'t>> = table
            .iter()
            .map(|(key, value)| Entry {
                key: key.get_ref().as_ref(),
                key_span: key.span(),
                value,
                taken: false,
            })
            .collect();
        entries.sort_by_key(|entry| entry.key_span.start);
        Self {
            span,
            entries,
            known: Vec::new(),
        }
    }

    /// The value of a key, if the table has it.
    pub(crate) fn take(&mut self, key: &'static str) -> Option<Value<'t>> {
        self.known.push(key);
        let entry = self.entries.iter_mut().find(|entry| entry.key == key)?;
        entry.taken = true;
        Some(entry.value)
    }

    /// All entries, in the order of the text.
    pub(crate) fn into_entries(self) -> Vec<Entry<'t>> {
        self.entries
    }
}

impl Decoder<'_> {
    /// Reports an error.
    pub(crate) fn error(
        &mut self,
        span: Span,
        message: impl Into<String>,
        hint: impl Into<Option<String>>,
    ) {
        let finding = Finding::in_text(Severity::Error, self.file, span, message).with_hint(hint);
        self.findings.push(finding);
    }

    fn mismatch(&mut self, value: Value<'_>, expected: &str) {
        let found = match value.get_ref() {
            DeValue::String(_) => "a text",
            DeValue::Integer(_) | DeValue::Float(_) => "a number",
            DeValue::Boolean(_) => "true or false",
            DeValue::Datetime(_) => "a date",
            DeValue::Array(_) => "a list",
            DeValue::Table(_) => "a table",
        };
        self.error(
            value.span(),
            format!("{expected} is expected here, not {found}"),
            None,
        );
    }

    /// Reports the keys of a table that nobody has taken.
    pub(crate) fn finish(&mut self, table: Table<'_>) {
        for entry in table.entries.iter().filter(|entry| !entry.taken) {
            if self.findings.is_full() {
                return;
            }
            let hint = did_you_mean(entry.key, table.known.iter().copied())
                .unwrap_or_else(|| format!("keys here are {}", table.known.join(", ")));
            let message = format!("there is no key `{}` here", entry.key);
            self.error(entry.key_span.clone(), message, hint);
        }
    }

    /// A table.
    pub(crate) fn table<'t>(&mut self, value: Value<'t>) -> Option<Table<'t>> {
        match value.get_ref() {
            DeValue::Table(table) => Some(Table::new(table, value.span())),
            _ => {
                self.mismatch(value, "a table");
                None
            }
        }
    }

    /// A list.
    pub(crate) fn list<'t>(&mut self, value: Value<'t>) -> Option<Vec<Value<'t>>> {
        match value.get_ref() {
            DeValue::Array(list) => Some(list.iter().collect()),
            _ => {
                self.mismatch(value, "a list");
                None
            }
        }
    }

    /// A text.
    pub(crate) fn text<'t>(&mut self, value: Value<'t>, expected: &str) -> Option<&'t str> {
        match value.get_ref() {
            DeValue::String(text) => Some(text.as_ref()),
            _ => {
                self.mismatch(value, expected);
                None
            }
        }
    }

    /// True or false.
    pub(crate) fn flag(&mut self, value: Value<'_>) -> Option<bool> {
        match value.get_ref() {
            DeValue::Boolean(flag) => Some(*flag),
            _ => {
                self.mismatch(value, "true or false");
                None
            }
        }
    }

    /// One of some words.
    pub(crate) fn choice<T: Copy>(
        &mut self,
        value: Value<'_>,
        choices: &[(&'static str, T)],
    ) -> Option<T> {
        let names = choices.iter().map(|(name, _)| *name);
        let listed = names.clone().collect::<Vec<_>>().join("\", \"");
        let expected = format!("one of \"{listed}\"");
        let text = self.text(value, &expected)?;
        match choices.iter().find(|(name, _)| *name == text) {
            Some(&(_, choice)) => Some(choice),
            None => {
                let hint = did_you_mean(text, names);
                self.error(value.span(), format!("{expected} is expected here"), hint);
                None
            }
        }
    }

    /// A number: stated, or a text with an expression.
    pub(crate) fn number(&mut self, value: Value<'_>) -> Option<f64> {
        let number = match value.get_ref() {
            DeValue::Integer(integer) => i64::from_str_radix(integer.as_str(), integer.radix())
                .ok()
                .map(|integer| integer as f64),
            DeValue::Float(float) => float.as_str().parse().ok(),
            DeValue::String(_) => {
                return self.within(value, |reader, scope| reader.expression(scope));
            }
            _ => {
                self.mismatch(value, "a number");
                return None;
            }
        };
        if number.is_none() {
            self.error(value.span(), "the number is out of range", None);
        }
        number
    }

    /// Reads all of a text value as part of the expression language.
    pub(crate) fn within<T>(
        &mut self,
        value: Value<'_>,
        read: impl FnOnce(&mut Reader<'_, '_>, &Scope) -> Result<T, Reported>,
    ) -> Option<T> {
        let text = self.text(value, "an expression")?;
        let inside = inside_quotes(self.file.text(), value.span(), text);
        let Some(inside) = inside else {
            let hint = "write it on one line, in quotes and without escapes".to_string();
            self.error(value.span(), "the expression cannot be read", hint);
            return None;
        };
        let errors = self.findings.error_count();
        let mut reader = Reader::new(self.file, inside, self.findings);
        let result = read(&mut reader, &self.scope);
        if result.is_ok() && reader.token() != Token::End {
            reader.unexpected("the end of the expression");
        }
        // A value that was reported must not be used.
        (self.findings.error_count() == errors)
            .then_some(result.ok())
            .flatten()
    }

    /// A whole number within a range.
    pub(crate) fn whole(&mut self, value: Value<'_>, range: Range<u64>) -> Option<u64> {
        let integer = match value.get_ref() {
            DeValue::Integer(integer) => {
                u64::from_str_radix(integer.as_str(), integer.radix()).ok()
            }
            _ => None,
        };
        let integer = integer.filter(|integer| range.contains(integer));
        if integer.is_none() {
            let message = format!("a whole number from {} is expected here", range.start);
            self.error(value.span(), message, None);
        }
        integer
    }

    /// A finite number with a condition.
    pub(crate) fn number_if(
        &mut self,
        value: Value<'_>,
        expected: &str,
        holds: impl FnOnce(f64) -> bool,
    ) -> Option<f64> {
        let number = self.number(value)?;
        if number.is_finite() && holds(number) {
            return Some(number);
        }
        self.error(value.span(), format!("{expected} is expected here"), None);
        None
    }

    /// A constant or a range `[lo, hi]`.
    pub(crate) fn interval(&mut self, value: Value<'_>) -> Option<Interval> {
        match value.get_ref() {
            DeValue::Array(_) => {
                let [lo, hi] = self.numbers(value, "a range [lo, hi]")?;
                Some(Interval { lo, hi })
            }
            _ => self.number(value).map(Interval::constant),
        }
    }

    /// A list of a given number of numbers.
    pub(crate) fn numbers<const N: usize>(
        &mut self,
        value: Value<'_>,
        expected: &str,
    ) -> Option<[f64; N]> {
        let numbers = self.number_list(value)?;
        let numbers: Result<[f64; N], _> = numbers.try_into();
        if numbers.is_err() {
            self.error(value.span(), format!("{expected} is expected here"), None);
        }
        numbers.ok()
    }

    /// A list of numbers.
    pub(crate) fn number_list(&mut self, value: Value<'_>) -> Option<Vec<f64>> {
        let list = self.list(value)?;
        let numbers: Vec<f64> = list
            .iter()
            .filter_map(|number| self.number(number))
            .collect();
        (numbers.len() == list.len()).then_some(numbers)
    }

    /// A vector `[x, y, z]`, or `[x, y]` in the plane.
    pub(crate) fn vector(&mut self, value: Value<'_>, planar: bool) -> Option<[f64; 3]> {
        let numbers = self.number_list(value)?;
        match (&numbers[..], planar) {
            (&[x, y, z], _) => Some([x, y, z]),
            (&[x, y], true) => Some([x, y, 0.0]),
            _ => {
                let expected = if planar { "[x, y]" } else { "[x, y, z]" };
                self.error(value.span(), format!("{expected} is expected here"), None);
                None
            }
        }
    }

    /// A point.
    pub(crate) fn point(&mut self, value: Value<'_>, planar: bool) -> Option<Point3<f64>> {
        self.vector(value, planar).map(Point3::from)
    }

    /// A list of texts, with their places.
    pub(crate) fn names<'t>(&mut self, value: Value<'t>) -> Option<Vec<(&'t str, Span)>> {
        let list = self.list(value)?;
        let names: Vec<_> = list
            .iter()
            .filter_map(|name| Some((self.text(name, "a name")?, name.span())))
            .collect();
        (names.len() == list.len()).then_some(names)
    }
}

/// The range of a text without its quotes, if it stands there as it is.
fn inside_quotes(source: &str, span: Span, text: &str) -> Option<Span> {
    let inside = span.start + 1..span.end.checked_sub(1)?;
    (source.get(inside.clone())? == text).then_some(inside)
}
