//! JSON that people can read too, and the place of a value in a JSON text.

use std::{
    collections::HashMap,
    io::{self, Write},
};

use serde_json::{
    ser::{CompactFormatter, Formatter},
    value::RawValue,
};

/// Lays JSON out with one line for each member of the two outermost levels and
/// everything deeper in one line: a line of a path file is a configuration.
#[derive(Default)]
pub(crate) struct Layout {
    depth: usize,
    empty: bool,
}

const BROKEN_LEVELS: usize = 2;

impl Layout {
    fn open<W: ?Sized + Write>(&mut self, writer: &mut W, bracket: &[u8]) -> io::Result<()> {
        self.depth += 1;
        self.empty = true;
        writer.write_all(bracket)
    }

    fn separate<W: ?Sized + Write>(&mut self, writer: &mut W, first: bool) -> io::Result<()> {
        self.empty = false;
        if !first {
            writer.write_all(b",")?;
        }
        if self.depth <= BROKEN_LEVELS {
            self.line(writer)
        } else if first {
            Ok(())
        } else {
            writer.write_all(b" ")
        }
    }

    fn close<W: ?Sized + Write>(&mut self, writer: &mut W, bracket: &[u8]) -> io::Result<()> {
        self.depth -= 1;
        if self.depth < BROKEN_LEVELS && !self.empty {
            self.line(writer)?;
        }
        self.empty = false;
        writer.write_all(bracket)
    }

    fn line<W: ?Sized + Write>(&self, writer: &mut W) -> io::Result<()> {
        writer.write_all(b"\n")?;
        (0..self.depth).try_for_each(|_| writer.write_all(b"  "))
    }
}

impl Formatter for Layout {
    fn begin_array<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        self.open(writer, b"[")
    }

    fn end_array<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        self.close(writer, b"]")
    }

    fn begin_array_value<W: ?Sized + Write>(
        &mut self,
        writer: &mut W,
        first: bool,
    ) -> io::Result<()> {
        self.separate(writer, first)
    }

    fn begin_object<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        self.open(writer, b"{")
    }

    fn end_object<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        self.close(writer, b"}")
    }

    fn begin_object_key<W: ?Sized + Write>(
        &mut self,
        writer: &mut W,
        first: bool,
    ) -> io::Result<()> {
        self.separate(writer, first)
    }

    fn begin_object_value<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        CompactFormatter.begin_object_value(writer)?;
        writer.write_all(b" ")
    }
}

/// A step into a JSON value.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Step {
    /// The member of an object.
    Key(&'static str),
    /// The item of an array, from 0.
    Index(usize),
}

/// Line and column, both from 1, of the value that `steps` lead to, or of the
/// last one on the way that exists. `text` is well-formed JSON.
pub(crate) fn locate(text: &str, steps: &[Step]) -> (usize, usize) {
    let mut place = text.trim_start();
    for step in steps {
        let inner = match step {
            Step::Key(key) => serde_json::from_str::<HashMap<String, &RawValue>>(place)
                .ok()
                .and_then(|members| members.get(*key).copied()),
            Step::Index(index) => serde_json::from_str::<Vec<&RawValue>>(place)
                .ok()
                .and_then(|items| items.get(*index).copied()),
        };
        match inner {
            Some(value) => place = value.get(),
            None => break,
        }
    }
    // A raw value borrows from the text, so its address tells where it stands.
    let offset = place.as_ptr().addr().saturating_sub(text.as_ptr().addr());
    line_and_column(text.as_bytes(), offset)
}

/// Line and column, both from 1 and the column in bytes, of the byte at `offset`.
pub(crate) fn line_and_column(bytes: &[u8], offset: usize) -> (usize, usize) {
    let before = &bytes[..offset.min(bytes.len())];
    let line = before.iter().filter(|&&byte| byte == b'\n').count() + 1;
    let start = before
        .iter()
        .rposition(|&byte| byte == b'\n')
        .map_or(0, |newline| newline + 1);
    (line, before.len() - start + 1)
}

#[cfg(test)]
mod tests {
    use serde::Serialize;

    use super::*;

    fn lay_out(value: &serde_json::Value) -> String {
        let mut bytes = Vec::new();
        let mut serializer = serde_json::Serializer::with_formatter(&mut bytes, Layout::default());
        value.serialize(&mut serializer).unwrap();
        String::from_utf8(bytes).unwrap()
    }

    #[test]
    fn two_levels_are_broken_into_lines() {
        let value = serde_json::json!({"a": [[1, {"b": [2, 3]}], []], "c": {}, "d": []});
        let text = lay_out(&value);
        assert_eq!(
            text,
            "{\n  \"a\": [\n    [1, {\"b\": [2, 3]}],\n    []\n  ],\n  \"c\": {},\n  \"d\": []\n}"
        );
        assert_eq!(
            serde_json::from_str::<serde_json::Value>(&text).unwrap(),
            value
        );
    }

    #[test]
    fn values_are_located() {
        let text = "\n{\"a\": 1,\n \"b\": [10,\n  {\"c\": 3}]}";
        assert_eq!(locate(text, &[]), (2, 1));
        assert_eq!(locate(text, &[Step::Key("a")]), (2, 7));
        assert_eq!(locate(text, &[Step::Key("b"), Step::Index(0)]), (3, 8));
        let deep = [Step::Key("b"), Step::Index(1), Step::Key("c")];
        assert_eq!(locate(text, &deep), (4, 9));
        let beyond = [Step::Key("b"), Step::Index(7)];
        assert_eq!(locate(text, &beyond), (3, 7));
    }
}
