//! `.param` files: `KEY = value`, one after the other.

use crate::{
    diagnostic::{Finding, Findings, Severity, SourceFile, did_you_mean},
    problem::{PlannerKind, PlannerSettings, SamplingRadius},
    tens::{
        expression::{Reader, Reported, Scope},
        scanner::Token,
    },
};

/// What a key may be set to.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Domain {
    /// Above 0.
    Positive,
    /// 0 or above.
    NotNegative,
    /// Above 0 and below 1.
    Fraction,
    /// A whole number, 1 or above.
    Count,
    /// A whole number, 0 or above.
    Whole,
    /// 0 or 1.
    Switch,
    /// Anything: the key has no meaning here.
    Any,
}

impl Domain {
    fn holds(self, value: f64) -> bool {
        match self {
            Self::Positive => value > 0.0,
            Self::NotNegative => value >= 0.0,
            Self::Fraction => value > 0.0 && value < 1.0,
            Self::Count => value >= 1.0 && value.fract() == 0.0,
            Self::Whole => value >= 0.0 && value.fract() == 0.0,
            Self::Switch => value == 0.0 || value == 1.0,
            Self::Any => true,
        }
    }

    fn describe(self) -> &'static str {
        match self {
            Self::Positive => "a positive number",
            Self::NotNegative => "a number that is not negative",
            Self::Fraction => "a number between 0 and 1",
            Self::Count => "a whole number from 1",
            Self::Whole => "a whole number from 0",
            Self::Switch => "true or false",
            Self::Any => "a value",
        }
    }
}

/// The keys that are known, what they may be, and the value that the format gives
/// to one that is not stated.
const KEYS: [(&str, Domain, Option<f64>); 16] = [
    ("EPSILON", Domain::Positive, Some(1e-6)),
    ("R", Domain::Positive, Some(0.4)),
    ("SR", Domain::NotNegative, Some(1.25)),
    ("E", Domain::Positive, Some(0.4)),
    ("CE", Domain::Fraction, Some(0.4)),
    ("DELTA", Domain::Positive, Some(0.04)),
    ("MAX_NEWTON_ITERATIONS", Domain::Count, None),
    ("PRETENSION", Domain::NotNegative, Some(1.0)),
    ("N_DOF", Domain::Whole, Some(0.0)),
    ("MAX_CHARTS", Domain::Count, Some(150_000.0)),
    ("MAX_PLANNING_TIME", Domain::Positive, Some(600.0)),
    ("MAX_NODES_RRT", Domain::Count, Some(250_000.0)),
    ("BI_RRT", Domain::Switch, Some(1.0)),
    // How the equations are written down and simplified is not a choice here.
    ("REPRESENTATION", Domain::Any, None),
    ("DUMMIFY", Domain::Any, None),
    ("SIMPLIFICATION_LEVEL", Domain::Any, None),
];

/// The parameters that a `.param` file states.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Parameters {
    /// Keys in capitals and values, in the order of the file.
    stated: Vec<(String, f64)>,
}

impl Parameters {
    /// Reads the text of a `.param` file.
    pub(crate) fn read(file: &SourceFile, findings: &mut Findings) -> Self {
        let mut parameters = Self::default();
        let mut reader = Reader::new(file, 0..file.text().len(), findings);
        while reader.token() != Token::End && !reader.findings.is_full() {
            if parameters.statement(&mut reader).is_err() {
                // The next key is a word before a `=`.
                while reader.token() != Token::End
                    && !(matches!(reader.token(), Token::Word(_))
                        && reader.second() == Token::Sign("="))
                {
                    reader.advance();
                }
            }
        }
        parameters
    }

    fn statement(&mut self, reader: &mut Reader<'_, '_>) -> Result<(), Reported> {
        let (name, name_span) = reader.name("the name of a parameter")?;
        reader.expect("=")?;
        let key = name.to_ascii_uppercase();
        let domain = KEYS
            .iter()
            .find(|(known, ..)| *known == key)
            .map(|&(_, domain, _)| domain);
        let start = reader.span().start;
        let symbol = match reader.token() {
            Token::Word(word)
                if reader.second() != Token::Sign("(") && !word.eq_ignore_ascii_case("pi") =>
            {
                reader.advance();
                Some(word.to_ascii_lowercase())
            }
            _ => None,
        };
        let value = match symbol.as_deref() {
            None => Some(reader.expression(&Scope::default())?),
            Some("true") => Some(1.0),
            Some("false") => Some(0.0),
            Some(_) => None,
        };
        let span = reader.since(start);
        let warning = |message: String, hint: Option<String>| {
            Finding::in_text(Severity::Warning, reader.file, name_span, message).with_hint(hint)
        };
        let Some(domain) = domain else {
            let hint = did_you_mean(&key, KEYS.iter().map(|(known, ..)| *known));
            let warning = warning(format!("the parameter `{name}` has no meaning here"), hint);
            reader.findings.push(warning);
            if let Some(value) = value {
                self.stated.push((key, value));
            }
            return Ok(());
        };
        match value {
            // Reported already.
            Some(value) if value.is_nan() => {}
            Some(value) if domain.holds(value) => {
                if self.stated.iter().any(|(stated, _)| *stated == key) {
                    let message = format!("`{name}` is stated twice; the last value counts");
                    let warning = warning(message, None);
                    reader.findings.push(warning);
                }
                self.stated.push((key, value));
            }
            None if domain == Domain::Any => {}
            _ => {
                reader.error(span, format!("{key} must be {}", domain.describe()), None);
            }
        }
        Ok(())
    }

    /// The value of a key: as stated, or what the format gives to it otherwise.
    pub(crate) fn value(&self, name: &str) -> Option<f64> {
        let key = name.to_ascii_uppercase();
        self.stated(&key).or_else(|| {
            KEYS.iter()
                .find(|(known, ..)| *known == key)
                .and_then(|&(_, _, default)| default)
        })
    }

    /// All keys that have a value.
    pub(crate) fn names(&self) -> impl Iterator<Item = &str> {
        let stated = self.stated.iter().map(|(key, _)| key.as_str());
        let defaults = KEYS.iter().filter(|(.., value)| value.is_some());
        stated.chain(defaults.map(|(key, ..)| *key))
    }

    fn stated(&self, key: &str) -> Option<f64> {
        let mut stated = self.stated.iter().rev();
        stated
            .find(|(stated, _)| stated == key)
            .map(|&(_, value)| value)
    }

    /// The prescribed norm of all forces; `Some(None)` states that there is none.
    pub(crate) fn pretension(&self) -> Option<Option<f64>> {
        self.stated("PRETENSION")
            .map(|value| (value > 0.0).then_some(value))
    }

    /// Applies what is stated to settings; the rest of them stays.
    pub(crate) fn apply(&self, settings: &mut PlannerSettings) {
        let number = |key: &str, target: &mut f64| {
            if let Some(value) = self.stated(key) {
                *target = value;
            }
        };
        let count = |key: &str, target: &mut usize| {
            if let Some(value) = self.stated(key) {
                // Saturates, which is as good as no limit.
                *target = value as usize;
            }
        };
        number("EPSILON", &mut settings.tolerance);
        number("R", &mut settings.chart_radius);
        number("E", &mut settings.chart_error);
        number("CE", &mut settings.curvature);
        number("DELTA", &mut settings.step);
        number("MAX_PLANNING_TIME", &mut settings.time_limit);
        count("MAX_NEWTON_ITERATIONS", &mut settings.max_newton_iterations);
        count("MAX_CHARTS", &mut settings.max_charts);
        count("MAX_NODES_RRT", &mut settings.max_nodes);
        if let Some(radius) = self.stated("SR") {
            settings.sampling_radius = if radius > 0.0 {
                SamplingRadius::Fixed(radius)
            } else {
                SamplingRadius::Automatic
            };
        }
        if let Some(dimension) = self.stated("N_DOF") {
            settings.expected_dimension = (dimension > 0.0).then_some(dimension as usize);
        }
        if let Some(two_trees) = self.stated("BI_RRT") {
            settings.planner = if two_trees > 0.0 {
                PlannerKind::TwoTrees
            } else {
                PlannerKind::OneTree
            };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnostic::ReadErrors;

    fn read(text: &str) -> Result<(Parameters, Vec<String>), ReadErrors> {
        let file = SourceFile::new("a.param", text);
        let mut findings = Findings::default();
        let parameters = Parameters::read(&file, &mut findings);
        findings.finish().map(|notices| {
            (
                parameters,
                notices.iter().map(|n| format!("{n:#}")).collect(),
            )
        })
    }

    #[test]
    fn every_key_reaches_its_setting() {
        let text = "EPSILON=1e-7 % comment\nr = 0.3\nSR=0 E=2*0.1\nCE=0.2\nDELTA=1/16
            MAX_NEWTON_ITERATIONS=20 PRETENSION = 4\nN_DOF=3 MAX_CHARTS=10 /* */
            MAX_PLANNING_TIME=5\nMAX_NODES_RRT=7\nBI_RRT=false REPRESENTATION = FLINKS
            DUMMIFY = 0 SIMPLIFICATION_LEVEL = 2";
        let (parameters, notices) = read(text).unwrap();
        assert!(notices.is_empty(), "{notices:?}");
        let mut settings = PlannerSettings::default();
        parameters.apply(&mut settings);
        let expected = PlannerSettings {
            tolerance: 1e-7,
            chart_radius: 0.3,
            chart_error: 0.2,
            curvature: 0.2,
            step: 0.0625,
            max_newton_iterations: 20,
            max_charts: 10,
            time_limit: 5.0,
            max_nodes: 7,
            planner: PlannerKind::OneTree,
            expected_dimension: Some(3),
            ..PlannerSettings::default()
        };
        assert_eq!(settings, expected);
        assert_eq!(parameters.pretension(), Some(Some(4.0)));
    }

    #[test]
    fn what_is_not_stated_stays() {
        let (parameters, _) = read("SR = 6 N_DOF = 0 PRETENSION = 0").unwrap();
        let mut settings = PlannerSettings::default();
        parameters.apply(&mut settings);
        let expected = PlannerSettings {
            sampling_radius: SamplingRadius::Fixed(6.0),
            ..PlannerSettings::default()
        };
        assert_eq!(settings, expected);
        assert_eq!(parameters.pretension(), Some(None));
        assert_eq!(Parameters::default().pretension(), None);
    }

    #[test]
    fn unknown_keys_are_warnings_and_keep_their_value() {
        let (parameters, notices) = read("DELTTA = 0.1\nMINE = 3\nR = 0.1 R = 0.2").unwrap();
        assert_eq!(
            notices,
            [
                "a.param:1:1: the parameter `DELTTA` has no meaning here (did you mean `DELTA`?)",
                "a.param:2:1: the parameter `MINE` has no meaning here",
                "a.param:3:9: `R` is stated twice; the last value counts",
            ]
        );
        assert_eq!(parameters.value("mine"), Some(3.0));
        assert_eq!(parameters.value("R"), Some(0.2));
    }

    #[test]
    fn values_out_of_place_are_errors_all_in_one_run() {
        let text = "R = -1\nMAX_CHARTS = 1.5\nEPSILON = small\n= 3\nCE = 1/0\nDELTA 0.1\nE = 0.1";
        let errors = read(text).unwrap_err();
        let told: Vec<String> = errors.errors().iter().map(|e| format!("{e:#}")).collect();
        assert_eq!(
            told,
            [
                "a.param:1:5: R must be a positive number",
                "a.param:2:14: MAX_CHARTS must be a whole number from 1",
                "a.param:3:11: EPSILON must be a positive number",
                "a.param:4:1: the name of a parameter is expected here",
                "a.param:5:6: division by zero",
                "a.param:6:7: `=` is expected here",
            ]
        );
    }
}
