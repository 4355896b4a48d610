//! What a file declares, with the place of everything in its text, so that the
//! validation shared with Rust code can point into the file.

use std::{collections::HashMap, ops::Range};

use crate::{
    builder::StructureBuilder,
    diagnostic::{Finding, Findings, Severity, SourceFile},
    environment::{Environment, EnvironmentBuilder, EnvironmentPlace},
    structure::Structure,
    validate::{ElementPart, Place},
};

/// A range of bytes of a text.
pub(crate) type Span = Range<usize>;

/// A structure and an environment as a file declares them.
#[derive(Debug)]
pub(crate) struct Declarations {
    pub(crate) structure: StructureBuilder,
    pub(crate) environment: EnvironmentBuilder,
    pub(crate) spans: Spans,
}

/// Where declarations stand; lists run parallel to those of the builders.
#[derive(Debug, Default)]
pub(crate) struct Spans {
    /// Where the structure begins.
    pub(crate) structure: Span,
    pub(crate) elements: Vec<ElementSpans>,
    pub(crate) fixed: Vec<Span>,
    pub(crate) loads: Vec<Span>,
    pub(crate) masses: Vec<Span>,
    pub(crate) gravity: Span,
    pub(crate) supports: Vec<Span>,
    pub(crate) base_range: Span,
    pub(crate) pretension: Option<Span>,
    /// The reference, then the followers.
    pub(crate) couplings: Vec<Vec<Span>>,
    pub(crate) attachments: Vec<AttachmentSpans>,
    pub(crate) obstacles: Vec<Span>,
    /// The two names of a rule, or twice the whole.
    pub(crate) rules: Vec<[Span; 2]>,
}

/// Where an element stands.
#[derive(Debug, Default)]
pub(crate) struct ElementSpans {
    pub(crate) name: Span,
    pub(crate) parts: Vec<(ElementPart, Span)>,
}

/// Where an attachment stands.
#[derive(Debug, Default)]
pub(crate) struct AttachmentSpans {
    pub(crate) name: Span,
    pub(crate) shapes: Vec<Span>,
    pub(crate) anchors: Vec<Span>,
}

impl Spans {
    fn structure_place(&self, place: Place) -> Span {
        match place {
            Place::Structure => self.structure.clone(),
            Place::Element(index, part) => {
                let element = &self.elements[index];
                element
                    .parts
                    .iter()
                    .find(|(found, _)| *found == part)
                    .map_or(&element.name, |(_, span)| span)
                    .clone()
            }
            Place::FixedCoordinate(index) => self.fixed[index].clone(),
            Place::Load(index) => self.loads[index].clone(),
            Place::Mass(index) => self.masses[index].clone(),
            Place::Gravity => self.gravity.clone(),
            Place::Support(index) => self.supports[index].clone(),
            Place::BaseRange => self.base_range.clone(),
            Place::Pretension => self.pretension.as_ref().unwrap_or(&self.structure).clone(),
            Place::Coupling(index, member) => self.couplings[index][member].clone(),
            Place::Attachment(index) => self.attachments[index].name.clone(),
            Place::AttachedShape(index, shape) => self.attachments[index].shapes[shape].clone(),
            Place::Anchor(index, anchor) => self.attachments[index].anchors[anchor].clone(),
        }
    }

    fn environment_place(&self, place: EnvironmentPlace) -> Span {
        match place {
            EnvironmentPlace::Obstacle(index) => self.obstacles[index].clone(),
            EnvironmentPlace::Rule(index, member) => self.rules[index][member].clone(),
        }
    }
}

impl Declarations {
    /// No declarations yet.
    pub(crate) fn new() -> Self {
        Self {
            structure: StructureBuilder::spatial(),
            environment: EnvironmentBuilder::default(),
            spans: Spans::default(),
        }
    }

    /// Validates the declarations and builds what they declare, or reports what is
    /// wrong with them.
    pub(crate) fn build(
        self,
        file: &SourceFile,
        findings: &mut Findings,
    ) -> Option<(Structure, Environment)> {
        let Self {
            structure,
            environment,
            spans,
        } = self;
        let structure = structure.build().map_err(|errors| {
            for error in errors {
                let message = format!("{}: {}", error.subject, error.flaw);
                let span = spans.structure_place(error.place);
                findings.push(
                    Finding::in_text(Severity::Error, file, span, message)
                        .with_hint(error.flaw.hint()),
                );
            }
        });
        let structure = structure.ok()?;
        let environment = build_environment(environment, &structure, &spans, file, findings)?;
        Some((structure, environment))
    }
}

/// Validates and builds an environment, or reports what is wrong with it.
pub(crate) fn build_environment(
    environment: EnvironmentBuilder,
    structure: &Structure,
    spans: &Spans,
    file: &SourceFile,
    findings: &mut Findings,
) -> Option<Environment> {
    let environment = environment.build(structure).map_err(|errors| {
        for error in errors {
            let span = spans.environment_place(error.place);
            findings.push(
                Finding::in_text(Severity::Error, file, span, error.flaw.to_string())
                    .with_hint(error.flaw.hint()),
            );
        }
    });
    environment.ok()
}

/// Colours that files may name. Both spellings of grey mean the same.
const COLORS: [&str; 14] = [
    "red", "green", "blue", "purple", "cyan", "yellow", "white", "black", "grey", "gray", "orange",
    "magenta", "brown", "pink",
];

/// The colour of a name, in letters of either case.
pub(crate) fn color(name: &str) -> Option<String> {
    let name = name.to_ascii_lowercase();
    let known = COLORS.iter().find(|known| **known == name)?;
    Some(if *known == "gray" { "grey" } else { known }.to_string())
}

/// The names of all colours.
pub(crate) fn color_names() -> impl Iterator<Item = &'static str> {
    COLORS.into_iter()
}

/// Finds names that are used before they are declared.
#[derive(Debug, Default)]
pub(crate) struct Order<'a> {
    declared: HashMap<&'a str, usize>,
    used: Vec<(&'a str, Span)>,
}

impl<'a> Order<'a> {
    /// Notes that a name comes into being; the first time counts.
    pub(crate) fn declare(&mut self, name: &'a str, at: usize) {
        self.declared.entry(name).or_insert(at);
    }

    /// Notes that a name is used.
    pub(crate) fn usage(&mut self, name: &'a str, span: &Span) {
        self.used.push((name, span.clone()));
    }

    /// Reports names that are used too early.
    pub(crate) fn report(self, file: &SourceFile, findings: &mut Findings) {
        for (name, span) in self.used {
            if self.declared.get(name).is_some_and(|&at| at > span.start) {
                let message = format!("`{name}` is used before it is declared");
                findings.push(
                    Finding::in_text(Severity::Error, file, span, message)
                        .with_hint("move this section below the declaration".to_string()),
                );
            }
        }
    }
}
