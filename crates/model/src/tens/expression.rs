//! Evaluates the arithmetic of `.tens` files, `.param` files and texts in problem
//! files, in one pass over the tokens.
//!
//! `^` binds strongest and from the left (`2^3^2` is 64), then signs, then `*`
//! and `/`, then `+` and `-`, then comparisons, which give 0 or 1. A conditional
//! `(c ? a : b)` evaluates the branch that is taken alone.

use std::{collections::HashMap, ops::Range};

use super::{
    param::Parameters,
    scanner::{Scanner, Token},
};
use crate::diagnostic::{Finding, Findings, Severity, SourceFile, did_you_mean};

/// Nesting of parentheses that an expression may have.
const DEEPEST: usize = 100;

const FUNCTIONS: [&str; 11] = [
    "sin", "cos", "tan", "cot", "asin", "acos", "atan", "atan2", "exp", "sqrt", "abs",
];

/// Constants by name, and the parameters that `parameter(NAME)` refers to.
#[derive(Clone, Debug, Default)]
pub(crate) struct Scope {
    /// Values; NaN stands for one whose definition is broken.
    pub(crate) constants: HashMap<String, f64>,
    pub(crate) parameters: Option<Parameters>,
}

/// An error has been reported; give up the statement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Reported;

/// Reads tokens with one token of look-ahead, and reports what is wrong.
///
/// A value that cannot be computed is reported once and carried on as NaN, so
/// that one pass finds all errors.
pub(crate) struct Reader<'a, 'f> {
    pub(crate) file: &'a SourceFile,
    pub(crate) findings: &'f mut Findings,
    scanner: Scanner<'a>,
    token: Token<'a>,
    span: Range<usize>,
    /// End of the token read last.
    previous_end: usize,
    depth: usize,
    /// Whether values matter: false in the branch of a conditional not taken.
    live: bool,
}

impl<'a, 'f> Reader<'a, 'f> {
    /// Reads a range of a file's text.
    pub(crate) fn new(
        file: &'a SourceFile,
        range: Range<usize>,
        findings: &'f mut Findings,
    ) -> Self {
        let mut scanner = Scanner::new(file.text(), range.clone());
        let (token, span) = scanner.next();
        Self {
            file,
            findings,
            scanner,
            token,
            span,
            previous_end: range.start,
            depth: 0,
            live: true,
        }
    }

    /// The next token.
    pub(crate) fn token(&self) -> Token<'a> {
        self.token
    }

    /// The token after the next.
    pub(crate) fn second(&self) -> Token<'a> {
        self.scanner.clone().next().0
    }

    /// The bytes of the next token.
    pub(crate) fn span(&self) -> Range<usize> {
        self.span.clone()
    }

    /// From `start` to the end of the token read last.
    pub(crate) fn since(&self, start: usize) -> Range<usize> {
        start..self.previous_end.max(start)
    }

    /// Moves on.
    pub(crate) fn advance(&mut self) {
        self.previous_end = self.span.end;
        (self.token, self.span) = self.scanner.next();
    }

    /// Reports an error at some bytes.
    pub(crate) fn error(
        &mut self,
        span: Range<usize>,
        message: impl Into<String>,
        hint: impl Into<Option<String>>,
    ) -> Reported {
        let finding = Finding::in_text(Severity::Error, self.file, span, message).with_hint(hint);
        self.findings.push(finding);
        Reported
    }

    /// Reports that the next token is not what is expected.
    pub(crate) fn unexpected(&mut self, expected: &str) -> Reported {
        let message = match self.token {
            Token::Invalid(reason) => reason.to_string(),
            Token::End => format!("the text ends here, but {expected} is expected"),
            _ => format!("{expected} is expected here"),
        };
        self.error(self.span(), message, None)
    }

    /// Whether the next token is a sign.
    pub(crate) fn at(&self, sign: &str) -> bool {
        matches!(self.token, Token::Sign(found) if found == sign)
    }

    /// Takes a sign if it comes next.
    pub(crate) fn take(&mut self, sign: &str) -> bool {
        let found = self.at(sign);
        if found {
            self.advance();
        }
        found
    }

    /// Takes a sign that must come next.
    pub(crate) fn expect(&mut self, sign: &str) -> Result<(), Reported> {
        if self.take(sign) {
            Ok(())
        } else {
            Err(self.unexpected(&format!("`{sign}`")))
        }
    }

    /// Whether the next token is a keyword, in letters of either case.
    pub(crate) fn at_word(&self, keyword: &str) -> bool {
        matches!(self.token, Token::Word(word) if word.eq_ignore_ascii_case(keyword))
    }

    /// Takes a keyword if it comes next.
    pub(crate) fn take_word(&mut self, keyword: &str) -> bool {
        let found = self.at_word(keyword);
        if found {
            self.advance();
        }
        found
    }

    /// Takes a name, with the bytes it covers.
    pub(crate) fn name(&mut self, expected: &str) -> Result<(&'a str, Range<usize>), Reported> {
        match self.token {
            Token::Word(word) => {
                let span = self.span();
                self.advance();
                Ok((word, span))
            }
            _ => Err(self.unexpected(expected)),
        }
    }

    /// Reads `(e, e, …)` with a given number of expressions.
    pub(crate) fn tuple<const N: usize>(&mut self, scope: &Scope) -> Result<[f64; N], Reported> {
        let mut values = [0.0; N];
        self.expect("(")?;
        for (index, value) in values.iter_mut().enumerate() {
            if index > 0 {
                self.expect(",")?;
            }
            *value = self.expression(scope)?;
        }
        self.expect(")")?;
        Ok(values)
    }

    /// Reads an expression and gives its value; NaN if that has been reported as
    /// impossible.
    pub(crate) fn expression(&mut self, scope: &Scope) -> Result<f64, Reported> {
        self.nested(|reader| reader.comparison(scope))
    }

    /// Reads a part of an expression one level deeper.
    fn nested(
        &mut self,
        read: impl FnOnce(&mut Self) -> Result<f64, Reported>,
    ) -> Result<f64, Reported> {
        if self.depth == DEEPEST {
            return Err(self.error(
                self.span(),
                format!("the expression is nested more than {DEEPEST} deep"),
                "define parts of it as constants".to_string(),
            ));
        }
        self.depth += 1;
        let value = read(self);
        self.depth -= 1;
        value
    }

    fn comparison(&mut self, scope: &Scope) -> Result<f64, Reported> {
        let mut left = self.sum(scope)?;
        while let Token::Sign(sign @ ("==" | "!=" | "<=" | ">=" | "<" | ">")) = self.token {
            self.advance();
            let right = self.sum(scope)?;
            let holds = match sign {
                "==" => left == right,
                "!=" => left != right,
                "<=" => left <= right,
                ">=" => left >= right,
                "<" => left < right,
                _ => left > right,
            };
            left = if left.is_nan() || right.is_nan() {
                f64::NAN
            } else {
                f64::from(u8::from(holds))
            };
        }
        Ok(left)
    }

    fn sum(&mut self, scope: &Scope) -> Result<f64, Reported> {
        let start = self.span.start;
        let mut left = self.product(scope)?;
        while let Token::Sign(sign @ ("+" | "-")) = self.token {
            self.advance();
            let right = self.product(scope)?;
            let value = if sign == "+" {
                left + right
            } else {
                left - right
            };
            left = self.finite(start, &[left, right], value, "the sum is out of range");
        }
        Ok(left)
    }

    fn product(&mut self, scope: &Scope) -> Result<f64, Reported> {
        let start = self.span.start;
        let mut left = self.signed(scope)?;
        while let Token::Sign(sign @ ("*" | "/")) = self.token {
            self.advance();
            let right = self.signed(scope)?;
            let (value, complaint) = if sign == "*" {
                (left * right, "the product is out of range")
            } else if right == 0.0 {
                (f64::NAN, "division by zero")
            } else {
                (left / right, "the quotient is out of range")
            };
            left = self.finite(start, &[left, right], value, complaint);
        }
        Ok(left)
    }

    /// Any number of signs before a power. Read in a loop, so that no text can
    /// nest the calls.
    fn signed(&mut self, scope: &Scope) -> Result<f64, Reported> {
        let mut sign = 1.0;
        while let Token::Sign(found @ ("+" | "-")) = self.token {
            if found == "-" {
                sign = -sign;
            }
            self.advance();
        }
        Ok(sign * self.power(scope)?)
    }

    fn power(&mut self, scope: &Scope) -> Result<f64, Reported> {
        let start = self.span.start;
        let mut base = self.primary(scope)?;
        while self.take("^") {
            // A sign in the exponent takes the powers after it along: it binds
            // less than they do.
            let exponent = if self.at("+") || self.at("-") {
                self.nested(|reader| reader.signed(scope))?
            } else {
                self.primary(scope)?
            };
            let value = base.powf(exponent);
            base = self.finite(
                start,
                &[base, exponent],
                value,
                "the power is no finite number",
            );
        }
        Ok(base)
    }

    fn primary(&mut self, scope: &Scope) -> Result<f64, Reported> {
        match self.token {
            Token::Number(value) => {
                self.advance();
                Ok(value)
            }
            Token::Sign("(") => {
                self.advance();
                let value = self.parenthesis(scope)?;
                self.expect(")")?;
                Ok(value)
            }
            Token::Word(word) => self.word(scope, word),
            _ => Err(self.unexpected("a value")),
        }
    }

    /// The inside of a pair of parentheses: an expression or a conditional.
    fn parenthesis(&mut self, scope: &Scope) -> Result<f64, Reported> {
        let condition = self.expression(scope)?;
        if !self.take("?") {
            return Ok(condition);
        }
        let holds = condition != 0.0;
        let first = self.branch(scope, holds)?;
        self.expect(":")?;
        let second = self.branch(scope, !holds)?;
        Ok(if condition.is_nan() {
            f64::NAN
        } else if holds {
            first
        } else {
            second
        })
    }

    /// A branch of a conditional: read in any case, evaluated if it is taken.
    fn branch(&mut self, scope: &Scope, taken: bool) -> Result<f64, Reported> {
        let live = self.live;
        self.live = live && taken;
        let value = self.expression(scope);
        self.live = live;
        value
    }

    fn word(&mut self, scope: &Scope, word: &'a str) -> Result<f64, Reported> {
        let span = self.span();
        self.advance();
        if self.at("(") {
            if word.eq_ignore_ascii_case("parameter") {
                return self.parameter(scope);
            }
            let name = word.to_ascii_lowercase();
            if let Some(name) = FUNCTIONS.iter().find(|known| **known == name) {
                return self.function(scope, name, span);
            }
        }
        if let Some(&value) = scope.constants.get(word) {
            return Ok(value);
        }
        if word.eq_ignore_ascii_case("pi") {
            return Ok(std::f64::consts::PI);
        }
        if self.at("(") {
            let hint = did_you_mean(word, FUNCTIONS);
            return Err(self.error(span, format!("there is no function `{word}`"), hint));
        }
        let names = scope.constants.keys().map(String::as_str).chain(["pi"]);
        let hint = did_you_mean(word, names)
            .unwrap_or_else(|| "a constant must be defined before it is used".to_string());
        self.error(span, format!("there is no constant `{word}`"), hint);
        Ok(f64::NAN)
    }

    fn parameter(&mut self, scope: &Scope) -> Result<f64, Reported> {
        self.expect("(")?;
        let (name, span) = self.name("the name of a parameter")?;
        self.expect(")")?;
        let Some(parameters) = &scope.parameters else {
            self.error(span, "parameters exist in `.tens` files only", None);
            return Ok(f64::NAN);
        };
        match parameters.value(name) {
            Some(value) => Ok(value),
            None => {
                let hint = did_you_mean(name, parameters.names())
                    .unwrap_or_else(|| format!("state it in the `.param` file: `{name} = …`"));
                self.error(span, format!("there is no parameter `{name}`"), hint);
                Ok(f64::NAN)
            }
        }
    }

    fn function(&mut self, scope: &Scope, name: &str, span: Range<usize>) -> Result<f64, Reported> {
        if name == "atan2" {
            let [y, x] = self.tuple(scope)?;
            return Ok(y.atan2(x));
        }
        let [x] = self.tuple(scope)?;
        let value = match name {
            "sin" => x.sin(),
            "cos" => x.cos(),
            "tan" => x.tan(),
            "cot" => (std::f64::consts::FRAC_PI_2 - x).tan(),
            "asin" => x.asin(),
            "acos" => x.acos(),
            "atan" => x.atan(),
            "exp" => x.exp(),
            "sqrt" => x.sqrt(),
            _ => x.abs(),
        };
        let complaint = match name {
            "sqrt" => "the square root of a negative number",
            "asin" | "acos" => "the argument is outside [-1, 1]",
            _ => "the value is out of range",
        };
        Ok(self.finite(span.start, &[x], value, complaint))
    }

    /// Passes on a value, or reports why finite operands give none.
    fn finite(&mut self, start: usize, operands: &[f64], value: f64, complaint: &str) -> f64 {
        if value.is_finite() {
            return value;
        }
        if self.live && operands.iter().all(|operand| operand.is_finite()) {
            self.error(self.since(start), complaint, None);
        }
        f64::NAN
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn evaluate(text: &str) -> Result<f64, Vec<String>> {
        let file = SourceFile::new("a.tens", text);
        let mut findings = Findings::default();
        let mut reader = Reader::new(&file, 0..text.len(), &mut findings);
        let scope = Scope {
            constants: HashMap::from([("l".to_string(), 2.0), ("zero".to_string(), 0.0)]),
            parameters: Some(Parameters::default()),
        };
        let value = reader.expression(&scope);
        if value.is_ok() && reader.token() != Token::End {
            reader.unexpected("the end");
        }
        match findings.finish() {
            Ok(_) => Ok(value.unwrap()),
            Err(errors) => Err(errors.errors().iter().map(|e| format!("{e:#}")).collect()),
        }
    }

    #[test]
    fn operators_bind_as_the_language_says() {
        for (text, value) in [
            ("1+2*3", 7.0),
            ("(1+2)*3", 9.0),
            ("2^3^2", 64.0),
            ("-2^2", -4.0),
            ("2^-1", 0.5),
            ("2^-1^2", 0.5),
            ("2*-3", -6.0),
            ("1++2", 3.0),
            ("1--2", 3.0),
            ("---1", -1.0),
            ("-l*l", -4.0),
            ("8/2/2", 2.0),
            ("2<3", 1.0),
            ("1+1==2", 1.0),
            ("1!=1", 0.0),
            ("3>=4", 0.0),
            ("(1<2 ? 5 : 6)", 5.0),
            ("(zero ? 5 : 6)*2", 12.0),
            ("(1 ? (0 ? 1 : 2) : 3)", 2.0),
            ("l^3/l", 4.0),
            ("l", 2.0),
        ] {
            assert_eq!(evaluate(text), Ok(value), "{text}");
        }
    }

    #[test]
    fn functions_and_names_ignore_case_where_the_language_does() {
        use std::f64::consts::PI;
        for (text, value) in [
            ("sin(PI/6)", 0.5),
            ("Cos(pi)", -1.0),
            ("tan(pi/4)", 1.0),
            ("cot(pi/4)", 1.0),
            ("asin(1)", PI / 2.0),
            ("acos(0)", PI / 2.0),
            ("atan(1)", PI / 4.0),
            ("atan2(1,-1)", 3.0 * PI / 4.0),
            ("exp(1)", std::f64::consts::E),
            ("SQRT(2)", 2.0_f64.sqrt()),
            ("abs(-3)", 3.0),
            ("PARAMETER(PRETENSION)", 1.0),
            ("parameter(r)", 0.4),
        ] {
            let error = (evaluate(text).unwrap() - value).abs();
            assert!(error <= 1e-15 * value.abs().max(1.0), "{text}");
        }
        assert!(evaluate("L").is_err(), "names are case-sensitive");
    }

    #[test]
    fn only_the_branch_taken_is_evaluated() {
        assert_eq!(evaluate("(abs(zero)<1 ? 7 : 1/zero)"), Ok(7.0));
        assert_eq!(evaluate("(zero ? sqrt(-1) : 8)"), Ok(8.0));
        // A name must exist in either branch.
        assert!(evaluate("(1 ? 1 : nowhere)").is_err());
    }

    #[test]
    fn errors_tell_where_and_why() {
        let error = |text: &str| evaluate(text).unwrap_err().join("\n");
        assert_eq!(error("1 + l/zero"), "a.tens:1:5: division by zero");
        assert_eq!(
            error("sqrt(-1)"),
            "a.tens:1:1: the square root of a negative number"
        );
        assert_eq!(error("10^400"), "a.tens:1:1: the power is no finite number");
        assert_eq!(
            error("(1+2"),
            "a.tens:1:5: the text ends here, but `)` is expected"
        );
        assert_eq!(
            error("sqr(2)"),
            "a.tens:1:1: there is no function `sqr` (did you mean `sqrt`?)"
        );
        assert_eq!(
            error("1 +"),
            "a.tens:1:4: the text ends here, but a value is expected"
        );
        // One error each, not one for everything that depends on it.
        assert_eq!(evaluate("1/zero + 2*(3 - 1/zero)").unwrap_err().len(), 2);
    }

    #[test]
    fn deep_nesting_is_refused_not_followed() {
        let deep = "(".repeat(100_000);
        assert!(evaluate(&deep).unwrap_err()[0].contains("nested"));
        let powers = "2^-".repeat(100_000) + "1";
        assert!(evaluate(&powers).is_err());
        let signs = "-".repeat(100_001) + "1";
        assert_eq!(evaluate(&signs), Ok(-1.0));
    }
}
