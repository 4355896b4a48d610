//! Cuts `.tens` and `.param` texts into tokens. Cost: linear.

use std::ops::Range;

/// A token; what it says is in the text it covers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Token<'a> {
    /// A name or keyword.
    Word(&'a str),
    /// A number.
    Number(f64),
    /// A text in double quotes, without them.
    Text(&'a str),
    /// A sign of one or two characters.
    Sign(&'static str),
    /// Something that belongs to no token, and why.
    Invalid(&'static str),
    /// The end of the text.
    End,
}

/// Signs, longer ones before their prefixes.
const SIGNS: [&str; 22] = [
    ":=", "==", "!=", "<=", ">=", ":", "=", "<", ">", "+", "-", "*", "/", "^", "?", ",", "(", ")",
    "[", "]", "{", "}",
];

/// A position in a text, from which the next token is read.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scanner<'a> {
    text: &'a str,
    position: usize,
    end: usize,
}

impl<'a> Scanner<'a> {
    /// Scans a range of a text.
    pub(crate) fn new(text: &'a str, range: Range<usize>) -> Self {
        Self {
            text,
            position: range.start,
            end: range.end,
        }
    }

    fn rest(&self) -> &'a str {
        &self.text[self.position..self.end]
    }

    /// Skips blanks and comments: `%`, `#`, `//` to the end of the line, and
    /// `/* … */`, which the end of the text closes as well.
    fn skip_blanks(&mut self) {
        loop {
            let rest = self.rest();
            let blank = rest.len() - rest.trim_start().len();
            let rest = &rest[blank..];
            let comment = if rest.starts_with(['%', '#']) || rest.starts_with("//") {
                rest.find('\n').unwrap_or(rest.len())
            } else if let Some(inside) = rest.strip_prefix("/*") {
                inside.find("*/").map_or(rest.len(), |length| length + 4)
            } else {
                0
            };
            self.position += blank + comment;
            if comment == 0 {
                return;
            }
        }
    }

    /// The next token and the bytes it covers.
    pub(crate) fn next(&mut self) -> (Token<'a>, Range<usize>) {
        self.skip_blanks();
        let rest = self.rest();
        let start = self.position;
        let Some(first) = rest.chars().next() else {
            return (Token::End, start..start);
        };
        let (token, length) = if first.is_ascii_alphabetic() || first == '_' {
            let length = rest
                .find(|letter: char| !letter.is_ascii_alphanumeric() && letter != '_')
                .unwrap_or(rest.len());
            (Token::Word(&rest[..length]), length)
        } else if first.is_ascii_digit()
            || (first == '.' && rest[1..].starts_with(|next: char| next.is_ascii_digit()))
        {
            number(rest)
        } else if first == '"' {
            match rest[1..].find(['"', '\n']) {
                Some(length) if rest[1 + length..].starts_with('"') => {
                    (Token::Text(&rest[1..=length]), length + 2)
                }
                length => (
                    Token::Invalid("the text in quotes has no end on this line"),
                    1 + length.unwrap_or(rest.len() - 1),
                ),
            }
        } else if let Some(sign) = SIGNS.iter().find(|sign| rest.starts_with(**sign)) {
            (Token::Sign(sign), sign.len())
        } else {
            (
                Token::Invalid("this character has no meaning here"),
                first.len_utf8(),
            )
        };
        self.position += length;
        (token, start..self.position)
    }
}

/// A number at the start of `rest`, and its length.
fn number(rest: &str) -> (Token<'_>, usize) {
    let bytes = rest.as_bytes();
    let digits = |from: usize| {
        from + bytes[from..]
            .iter()
            .take_while(|byte| byte.is_ascii_digit())
            .count()
    };
    let mut length = digits(0);
    if bytes.get(length) == Some(&b'.') {
        length = digits(length + 1);
    }
    if matches!(bytes.get(length), Some(b'e' | b'E')) {
        let sign = usize::from(matches!(bytes.get(length + 1), Some(b'+' | b'-')));
        let end = digits(length + 1 + sign);
        if end > length + 1 + sign {
            length = end;
        }
    }
    // A letter right after a number is a slip such as `2x` or `1e`.
    let glued = rest[length..]
        .find(|letter: char| !letter.is_ascii_alphanumeric() && letter != '_')
        .unwrap_or(rest.len() - length);
    if glued > 0 {
        return (
            Token::Invalid("a number must not run into a name"),
            length + glued,
        );
    }
    match rest[..length].parse::<f64>() {
        Ok(value) if value.is_finite() => (Token::Number(value), length),
        _ => (Token::Invalid("the number is out of range"), length),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tokens(text: &str) -> Vec<Token<'_>> {
        let mut scanner = Scanner::new(text, 0..text.len());
        std::iter::from_fn(|| Some(scanner.next().0))
            .take_while(|token| *token != Token::End)
            .collect()
    }

    #[test]
    fn comments_of_every_kind_are_skipped() {
        let text = "a % x\nb # x\nc // x\n/* x\n x */ d /* to the end";
        assert_eq!(tokens(text), ["a", "b", "c", "d"].map(Token::Word));
        assert_eq!(tokens("/**/a/***/b"), ["a", "b"].map(Token::Word));
        assert_eq!(tokens("%"), []);
    }

    #[test]
    fn numbers_are_read_in_every_notation() {
        let values = [1.0, 0.5, 2.0, 14e10, 2.5e9, 1e-10, 3e2];
        assert_eq!(
            tokens("1 .5 2. 14e10 2.5e9 1e-10 3E+2"),
            values.map(Token::Number)
        );
        for bad in ["1e999", "2x", "1e", "3_"] {
            assert!(matches!(tokens(bad)[..], [Token::Invalid(_)]), "{bad}");
        }
    }

    #[test]
    fn signs_prefer_the_longer_one() {
        let signs = [":=", ":", "=", "==", "<=", "<", "^", "?"];
        assert_eq!(tokens(":= : = == <= < ^ ?"), signs.map(Token::Sign));
    }

    #[test]
    fn texts_end_on_their_line() {
        assert_eq!(tokens("\"a b.off\""), [Token::Text("a b.off")]);
        assert_eq!(tokens("\"\""), [Token::Text("")]);
        assert!(matches!(
            tokens("\"a\nb\"")[..],
            [Token::Invalid(_), Token::Word("b"), Token::Invalid(_)]
        ));
        assert!(matches!(tokens("é")[..], [Token::Invalid(_)]));
    }
}
