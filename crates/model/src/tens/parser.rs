//! Reads the sections of a `.tens` file into declarations, in one pass.
//!
//! A statement that cannot be read is reported and skipped, so that one run finds
//! the errors of all statements.

use nalgebra::{Isometry3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};

use crate::{
    builder::{AttachmentSpec, CouplingSpec, ElementSpec, Followers, StructureBuilder},
    declarations::{AttachmentSpans, Declarations, ElementSpans, Order, Span, color, color_names},
    diagnostic::{Finding, Findings, Severity, SourceFile, did_you_mean},
    environment::{CollisionRule, Obstacle, PairSelection, Role, Shape},
    files::Meshes,
    structure::{AttachedShape, ElementKind, Interval},
    tens::{
        expression::{Reader, Reported, Scope},
        param::Parameters,
        scanner::Token,
    },
    validate::ElementPart,
};

/// A section of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Section {
    /// Before the first section, or in one that is not understood.
    None,
    Constants,
    Structure,
    FixedPoints,
    Forces,
    Couple,
    Addons,
    Obstacles,
    Collisions,
}

/// Titles of sections; that of a free-flying structure goes on with its ranges.
const TITLES: [(&str, Section); 11] = [
    ("CONSTANTS", Section::Constants),
    ("STRUCTURE", Section::Structure),
    ("PLANAR STRUCTURE", Section::Structure),
    ("FREE FLYING STRUCTURE", Section::Structure),
    ("FREE FLYING PLANAR STRUCTURE", Section::Structure),
    ("FIXED POINTS", Section::FixedPoints),
    ("FORCES", Section::Forces),
    ("COUPLE", Section::Couple),
    ("ADDONS", Section::Addons),
    ("OBSTACLES", Section::Obstacles),
    ("COLLISIONS", Section::Collisions),
];

const KINDS: [(&str, ElementKind); 5] = [
    ("strut", ElementKind::Strut),
    ("bar", ElementKind::Bar),
    ("cable", ElementKind::Cable),
    ("spring", ElementKind::Spring),
    ("prismatic", ElementKind::Prismatic),
];

/// Keywords of the attributes of an element, with their rank in the order in which
/// they must stand.
const ATTRIBUTES: [(&str, u8); 17] = [
    ("stiffness", 0),
    ("rest", 1),
    ("force", 2),
    ("radius", 3),
    ("loops", 4),
    ("granularity", 5),
    ("hidden", COLOR + 1),
    ("decoration", COLOR + 1),
    ("mass", 8),
    ("inertial", 9),
    ("inertia", 10),
    ("velocity", 11),
    ("acceleration", 12),
    ("effort", 13),
    ("cost", 14),
    ("friction", 15),
    ("damping", 16),
];

/// Rank of the colour, which has no keyword.
const COLOR: u8 = 6;

const SHAPES: [&str; 5] = ["box", "sphere", "cylinder", "prism", "body"];

/// Reads a `.tens` file. Errors are in the findings; the declarations are complete
/// if there are none.
pub(crate) fn parse(
    file: &SourceFile,
    parameters: Parameters,
    meshes: &mut Meshes,
    findings: &mut Findings,
) -> Declarations {
    let mut parser = Parser {
        reader: Reader::new(file, 0..file.text().len(), findings),
        scope: Scope {
            parameters: Some(parameters),
            ..Scope::default()
        },
        declarations: Declarations::new(),
        header: None,
        nodes: Order::default(),
        bodies: Order::default(),
        meshes,
    };
    parser.file();
    let Parser {
        declarations,
        header,
        nodes,
        bodies,
        ..
    } = parser;
    if header.is_none() && findings.error_count() == 0 {
        let end = file.text().trim_end().len();
        let message = "there is no structure: a section [STRUCTURE] is missing";
        findings.push(Finding::in_text(Severity::Error, file, end..end, message));
    }
    nodes.report(file, findings);
    bodies.report(file, findings);
    declarations
}

/// What the title of a structure says.
#[derive(Clone, Debug, PartialEq)]
struct Header {
    planar: bool,
    base_range: Option<[f64; 3]>,
}

struct Parser<'a, 'm> {
    reader: Reader<'a, 'm>,
    scope: Scope,
    declarations: Declarations,
    header: Option<Header>,
    nodes: Order<'a>,
    bodies: Order<'a>,
    meshes: &'m mut Meshes,
}

impl<'a> Parser<'a, '_> {
    fn file(&mut self) {
        let mut section = Section::None;
        while self.reader.token() != Token::End && !self.reader.findings.is_full() {
            let start = self.reader.span().start;
            let outcome = if self.reader.at("[") {
                match self.title() {
                    Ok(next) => {
                        section = next;
                        continue;
                    }
                    Err(Reported) => {
                        section = Section::None;
                        Err(Reported)
                    }
                }
            } else {
                self.statement(section)
            };
            if outcome.is_err() {
                if self.reader.span().start == start {
                    self.reader.advance();
                }
                while self.reader.token() != Token::End && !self.at_start_of(section) {
                    self.reader.advance();
                }
            }
        }
    }

    fn statement(&mut self, section: Section) -> Result<(), Reported> {
        match section {
            Section::None => Err(self
                .reader
                .unexpected("the title of a section, such as [STRUCTURE],")),
            Section::Constants => self.constant(),
            Section::Structure => self.element(),
            Section::FixedPoints => self.fixed_point(),
            Section::Forces => self.force(),
            Section::Couple => self.couple(),
            Section::Addons => self.addon(),
            Section::Obstacles => self.obstacle(),
            Section::Collisions => self.collision(),
        }
    }

    /// Whether a statement of the section, or another section, begins here.
    fn at_start_of(&self, section: Section) -> bool {
        let second = self.reader.second();
        if self.reader.at("[") {
            let titles = TITLES
                .iter()
                .filter_map(|(title, _)| title.split(' ').next());
            return matches!(second, Token::Word(word) if titles
                .into_iter()
                .any(|title| title.eq_ignore_ascii_case(word)));
        }
        let Token::Word(word) = self.reader.token() else {
            return false;
        };
        let is = |keyword: &str| word.eq_ignore_ascii_case(keyword);
        match section {
            Section::None => false,
            Section::Constants => {
                second == Token::Sign(":=") || (is("print") && matches!(second, Token::Word(_)))
            }
            Section::Structure => KINDS.iter().any(|(keyword, _)| is(keyword)),
            Section::FixedPoints => matches!(second, Token::Sign("(" | "=")),
            Section::Forces => second == Token::Sign("(") || is("no"),
            Section::Couple | Section::Addons | Section::Obstacles => second == Token::Sign(":"),
            Section::Collisions => is("do") || (is("check") && second == Token::Sign(":")),
        }
    }

    fn title(&mut self) -> Result<Section, Reported> {
        let start = self.reader.span().start;
        self.reader.expect("[")?;
        let words_start = self.reader.span().start;
        let mut title = String::new();
        while let Token::Word(word) = self.reader.token() {
            if !title.is_empty() {
                title.push(' ');
            }
            title.push_str(&word.to_ascii_uppercase());
            self.reader.advance();
            if word.eq_ignore_ascii_case("STRUCTURE") {
                break;
            }
        }
        let Some(&(title, section)) = TITLES.iter().find(|(known, _)| *known == title) else {
            let span = self.reader.since(words_start);
            let names = TITLES.iter().map(|(known, _)| *known);
            let hint = did_you_mean(&title, names.clone()).unwrap_or_else(|| {
                format!("sections are {}", names.collect::<Vec<_>>().join(", "))
            });
            return Err(self.reader.error(span, "there is no such section", hint));
        };
        let planar = title.contains("PLANAR");
        let range_start = self.reader.span().start;
        let base_range = match (title.starts_with("FREE"), planar) {
            (false, _) => None,
            (true, planar) => {
                let x = self.reader.expression(&self.scope)?;
                self.reader.expect(",")?;
                let y = self.reader.expression(&self.scope)?;
                let z = if planar {
                    0.0
                } else {
                    self.reader.expect(",")?;
                    self.reader.expression(&self.scope)?
                };
                Some([x, y, z])
            }
        };
        let range_span = self.reader.since(range_start);
        self.reader.expect("]")?;
        if section == Section::Structure {
            let span = self.reader.since(start);
            let header = Header { planar, base_range };
            match &self.header {
                None => {
                    let builder = if planar {
                        StructureBuilder::planar()
                    } else {
                        StructureBuilder::spatial()
                    };
                    let builder = match base_range {
                        Some(range) => builder.free_flying(range),
                        None => builder,
                    };
                    let pretension = self
                        .scope
                        .parameters
                        .as_ref()
                        .and_then(Parameters::pretension);
                    self.declarations.structure = match pretension {
                        Some(pretension) => builder.pretension(pretension),
                        None => builder,
                    };
                    self.declarations.spans.structure = span;
                    self.declarations.spans.base_range = range_span;
                    self.header = Some(header);
                }
                Some(first) if *first == header => {}
                Some(_) => {
                    return Err(self.reader.error(
                        span,
                        "the file holds one structure, which has another title above",
                        "repeat the title as it stands above".to_string(),
                    ));
                }
            }
        }
        Ok(section)
    }

    fn constant(&mut self) -> Result<(), Reported> {
        if self.reader.at_word("print") && matches!(self.reader.second(), Token::Word(_)) {
            let start = self.reader.span().start;
            self.reader.advance();
            let (name, span) = self.reader.name("the name of a constant")?;
            let Some(&value) = self.scope.constants.get(name) else {
                let names = self.scope.constants.keys().map(String::as_str);
                let hint = did_you_mean(name, names);
                let message = format!("there is no constant `{name}`");
                return Err(self.reader.error(span, message, hint));
            };
            let span = self.reader.since(start);
            let message = format!("{name} = {value}");
            self.reader.findings.push(Finding::in_text(
                Severity::Note,
                self.reader.file,
                span,
                message,
            ));
            return Ok(());
        }
        let (name, span) = self.reader.name("the name of a constant")?;
        let outcome = self
            .reader
            .expect(":=")
            .and_then(|()| self.reader.expression(&self.scope));
        if self.scope.constants.contains_key(name) {
            self.reader.error(
                span,
                format!("the constant `{name}` is defined already"),
                "a constant keeps its value; choose another name".to_string(),
            );
        } else {
            // A broken definition still defines the name: it is reported here, not
            // wherever the name is used.
            let value = outcome.unwrap_or(f64::NAN);
            self.scope.constants.insert(name.to_string(), value);
        }
        outcome.map(drop)
    }

    fn range_or_value(&mut self) -> Result<Interval, Reported> {
        if self.reader.take("[") {
            let lo = self.reader.expression(&self.scope)?;
            self.reader.expect(",")?;
            let hi = self.reader.expression(&self.scope)?;
            self.reader.expect("]")?;
            Ok(Interval { lo, hi })
        } else {
            self.reader.expression(&self.scope).map(Interval::constant)
        }
    }

    fn element(&mut self) -> Result<(), Reported> {
        let kind = KINDS
            .iter()
            .find(|(keyword, _)| self.reader.at_word(keyword));
        let Some(&(_, kind)) = kind else {
            if let Token::Word(word) = self.reader.token() {
                let span = self.reader.span();
                let kinds = KINDS.iter().map(|(keyword, _)| *keyword);
                let attributes = ATTRIBUTES.iter().map(|(keyword, _)| *keyword);
                let names = kinds.chain(attributes).chain(color_names());
                let hint = did_you_mean(word, names)
                    .unwrap_or_else(|| "after its attributes, the next element begins with strut, bar, cable, spring or prismatic".to_string());
                let message = format!("`{word}` is neither an attribute nor a kind of element");
                return Err(self.reader.error(span, message, hint));
            }
            return Err(self.reader.unexpected("a kind of element"));
        };
        self.reader.advance();
        let (name, name_span) = self.reader.name("the name of the element")?;
        self.bodies.declare(name, name_span.start);
        self.reader.expect(":")?;
        let (first, first_span) = self.reader.name("the first node")?;
        self.nodes.declare(first, first_span.start);
        let (second, second_span) = self.reader.name("the second node")?;
        self.nodes.declare(second, second_span.start);
        let mut parts = vec![(ElementPart::Nodes, first_span.start..second_span.end)];
        if !self.reader.take_word("length") {
            return Err(self.reader.unexpected("`length`"));
        }
        let start = self.reader.span().start;
        let length = self.range_or_value()?;
        parts.push((ElementPart::Length, self.reader.since(start)));
        let mut spec = ElementSpec::new(kind, name, [first, second], length);

        let mut least = 0;
        while let Token::Word(word) = self.reader.token() {
            let span = self.reader.span();
            let keyword = word.to_ascii_lowercase();
            let rank = match ATTRIBUTES.iter().find(|(known, _)| *known == keyword) {
                Some(&(_, rank)) => rank,
                None if color(word).is_some() => COLOR,
                None => break,
            };
            if rank < least {
                let message = format!("`{word}` is not expected here");
                let hint = "attributes have an order: stiffness, rest, force, radius, loops, granularity, colour, hidden or decoration, dynamic ones; each at most once";
                return Err(self.reader.error(span, message, hint.to_string()));
            }
            least = rank + 1;
            self.reader.advance();
            let start = self.reader.span().start;
            match keyword.as_str() {
                "stiffness" => {
                    spec.stiffness = Some(self.reader.expression(&self.scope)?);
                    parts.push((ElementPart::Stiffness, self.reader.since(start)));
                }
                "rest" => {
                    spec.rest = Some(self.range_or_value()?);
                    parts.push((ElementPart::Rest, self.reader.since(start)));
                }
                "force" => {
                    spec.force = Some(self.range_or_value()?);
                    parts.push((ElementPart::Force, self.reader.since(start)));
                }
                "radius" => {
                    spec.radius = Some(self.reader.expression(&self.scope)?);
                    parts.push((ElementPart::Radius, self.reader.since(start)));
                }
                "loops" => spec.appearance.loops = Some(self.natural("loops")?),
                "granularity" => spec.appearance.granularity = Some(self.natural("facets")?),
                "hidden" | "decoration" => {
                    spec.appearance.role = if keyword == "hidden" {
                        Role::Hidden
                    } else {
                        Role::Decoration
                    };
                }
                _ if rank == COLOR => spec.appearance.color = color(word),
                _ => {
                    let (keyword, values) = self.dynamic(&keyword)?;
                    parts.push((ElementPart::Dynamics, self.reader.since(start)));
                    spec.dynamics.push((keyword, values));
                }
            }
        }
        self.declarations.structure.elements.push(spec);
        self.declarations.spans.elements.push(ElementSpans {
            name: name_span,
            parts,
        });
        Ok(())
    }

    /// A whole number above zero.
    fn natural(&mut self, what: &str) -> Result<u32, Reported> {
        let start = self.reader.span().start;
        let value = self.reader.expression(&self.scope)?;
        if value.is_nan() {
            return Ok(1);
        }
        if value.fract() == 0.0 && (1.0..=1e6).contains(&value) {
            // In range by the test above.
            return Ok(value as u32);
        }
        let span = self.reader.since(start);
        let message = format!("the number of {what} must be a whole number from 1 to 1000000");
        self.reader.error(span, message, None);
        Ok(1)
    }

    /// The values of a dynamic attribute, after its keyword: the name it is kept
    /// by, and its numbers.
    fn dynamic(&mut self, keyword: &str) -> Result<(String, Vec<f64>), Reported> {
        Ok(match keyword {
            "inertial" => {
                if !self.reader.take_word("frame") {
                    return Err(self.reader.unexpected("`frame`"));
                }
                let frame = self.transform(true)?.to_homogeneous();
                let rows = frame.fixed_rows::<3>(0);
                let values = rows.transpose().iter().copied().collect();
                ("inertial frame".to_string(), values)
            }
            "inertia" => {
                self.reader.take_word("matrix");
                let values: [f64; 6] = self.reader.tuple(&self.scope)?;
                ("inertia".to_string(), values.to_vec())
            }
            _ => {
                let value = self.reader.expression(&self.scope)?;
                (keyword.to_string(), vec![value])
            }
        })
    }

    /// A product of rotations, and of translations where they make sense.
    fn transform(&mut self, with_translations: bool) -> Result<Isometry3<f64>, Reported> {
        transform(&mut self.reader, &self.scope, with_translations)
    }

    /// The name of a node that must exist already.
    fn node(&mut self) -> Result<(&'a str, Span), Reported> {
        let (name, span) = self.reader.name("the name of a node")?;
        self.nodes.usage(name, &span);
        Ok((name, span))
    }

    /// The name of an element, add-on or obstacle that must exist already.
    fn body(&mut self, expected: &str) -> Result<(&'a str, Span), Reported> {
        let (name, span) = self.reader.name(expected)?;
        self.bodies.usage(name, &span);
        Ok((name, span))
    }

    fn fixed_point(&mut self) -> Result<(), Reported> {
        let (name, span) = self.node()?;
        let start = span.start;
        if self.reader.take("(") {
            let axis = ["x", "y", "z"]
                .iter()
                .position(|axis| self.reader.at_word(axis));
            let Some(axis) = axis else {
                return Err(self.reader.unexpected("`x`, `y` or `z`"));
            };
            self.reader.advance();
            self.reader.expect(")")?;
            self.reader.expect("=")?;
            let value = self.reader.expression(&self.scope)?;
            self.fix(name, axis, value, start);
        } else {
            self.reader.expect("=")?;
            let position: [f64; 3] = self.reader.tuple(&self.scope)?;
            for (axis, value) in position.into_iter().enumerate() {
                self.fix(name, axis, value, start);
            }
        }
        Ok(())
    }

    fn fix(&mut self, name: &str, axis: usize, value: f64, start: usize) {
        self.declarations
            .structure
            .fixed
            .push((name.to_string(), axis, value));
        self.declarations.spans.fixed.push(self.reader.since(start));
    }

    fn force(&mut self) -> Result<(), Reported> {
        if self.reader.at_word("no") && matches!(self.reader.second(), Token::Word(_)) {
            self.reader.advance();
            for keyword in ["null", "force"] {
                if !self.reader.take_word(keyword) {
                    return Err(self.reader.unexpected("`no null force :`"));
                }
            }
            self.reader.expect(":")?;
            loop {
                let (name, span) = self.node()?;
                self.declarations.structure.supports.push(name.to_string());
                self.declarations.spans.supports.push(span);
                if !self.reader.take(",") {
                    return Ok(());
                }
            }
        }
        let (name, span) = self.node()?;
        let force: [f64; 3] = self.reader.tuple(&self.scope)?;
        let load = (name.to_string(), Vector3::from(force));
        self.declarations.structure.loads.push(load);
        self.declarations
            .spans
            .loads
            .push(self.reader.since(span.start));
        Ok(())
    }

    fn couple(&mut self) -> Result<(), Reported> {
        const QUANTITIES: [&str; 4] = ["length", "rest", "force", "orientation"];
        let quantity = QUANTITIES
            .iter()
            .find(|quantity| self.reader.at_word(quantity));
        let Some(&quantity) = quantity else {
            return Err(self
                .reader
                .unexpected("`length`, `rest`, `force` or `orientation`"));
        };
        self.reader.advance();
        self.reader.expect(":")?;
        let (reference, span) = self.body("the name of an element")?;
        let mut spans = vec![span];
        let mut scaled = Vec::new();
        let mut rotated = Vec::new();
        while self.reader.take(",") {
            let bracket = self.reader.take("[");
            let mut factor = 1.0;
            let mut rotation = Rotation3::identity();
            if bracket {
                if quantity == "orientation" {
                    rotation = self.transform(false)?.rotation.to_rotation_matrix();
                } else {
                    factor = self.reader.expression(&self.scope)?;
                }
                self.reader.expect("]")?;
            }
            let (follower, span) = self.body("the name of an element")?;
            spans.push(span);
            if quantity == "orientation" {
                rotated.push((follower.to_string(), rotation));
            } else {
                scaled.push((follower.to_string(), factor));
            }
        }
        let followers = match quantity {
            "length" => Followers::Length(scaled),
            "rest" => Followers::Rest(scaled),
            "force" => Followers::Force(scaled),
            _ => Followers::Orientation(rotated),
        };
        self.declarations.structure.couplings.push(CouplingSpec {
            reference: reference.to_string(),
            followers,
        });
        self.declarations.spans.couplings.push(spans);
        Ok(())
    }

    fn point(&mut self) -> Result<Point3<f64>, Reported> {
        self.reader.tuple::<3>(&self.scope).map(Point3::from)
    }

    /// A point, or `+` and the way to it from another.
    fn point_after(&mut self, first: Point3<f64>) -> Result<Point3<f64>, Reported> {
        if self.reader.take("+") {
            Ok(first + self.point()?.coords)
        } else {
            self.point()
        }
    }

    fn at_shape(&self) -> bool {
        SHAPES.iter().any(|keyword| self.reader.at_word(keyword))
    }

    /// A shape with its colour and role, and where it stands. Nothing if its file
    /// has been reported as unreadable.
    fn shape(&mut self) -> Result<(Option<AttachedShape>, Span), Reported> {
        let start = self.reader.span().start;
        let keyword = SHAPES
            .iter()
            .find(|keyword| self.reader.at_word(keyword))
            .copied();
        let Some(keyword) = keyword else {
            return Err(self
                .reader
                .unexpected("a shape (box, sphere, cylinder, prism or body)"));
        };
        self.reader.advance();
        let shape = match keyword {
            "box" => {
                let p = self.point()?;
                let q = self.point_after(p)?;
                Some(Shape::Box {
                    min: p.inf(&q),
                    max: p.sup(&q),
                })
            }
            "sphere" => {
                let radius = self.reader.expression(&self.scope)?;
                let center = self.point()?;
                Some(Shape::Sphere { center, radius })
            }
            "cylinder" => {
                let radius = self.reader.expression(&self.scope)?;
                let p = self.point()?;
                let q = self.point_after(p)?;
                Some(Shape::Cylinder { p, q, radius })
            }
            "prism" => {
                let corners = [self.point()?, self.point()?, self.point()?];
                let height = self.reader.expression(&self.scope)?;
                Some(Shape::Prism { corners, height })
            }
            _ => {
                let Token::Text(name) = self.reader.token() else {
                    return Err(self.reader.unexpected("the name of a file in quotes"));
                };
                let span = self.reader.span();
                self.reader.advance();
                let shape = self.meshes.mesh(name, self.reader.findings);
                if shape.is_none() {
                    self.reader.error(span, "this mesh cannot be read", None);
                }
                shape
            }
        };
        let span = self.reader.since(start);
        let mut shape_color = None;
        if let Token::Word(word) = self.reader.token()
            && let Some(found) = color(word)
        {
            shape_color = Some(found);
            self.reader.advance();
        }
        let role = if self.reader.take_word("decoration") {
            Role::Decoration
        } else if self.reader.take_word("hidden") {
            Role::Hidden
        } else {
            Role::Solid
        };
        let attached = shape.map(|shape| AttachedShape {
            shape,
            role,
            color: shape_color,
        });
        Ok((attached, span))
    }

    /// Reports a word after a shape that is no colour, if there is one.
    fn after_shape(&mut self) -> Result<(), Reported> {
        if let Token::Word(word) = self.reader.token()
            && self.reader.second() != Token::Sign(":")
            && !self.at_shape()
        {
            let span = self.reader.span();
            let names = color_names().chain(["decoration", "hidden"]).chain(SHAPES);
            let hint = did_you_mean(word, names);
            let message = format!("`{word}` is no colour, and neither `decoration` nor `hidden`");
            return Err(self.reader.error(span, message, hint));
        }
        Ok(())
    }

    fn addon(&mut self) -> Result<(), Reported> {
        let (name, name_span) = self.reader.name("the name of an add-on")?;
        self.bodies.declare(name, name_span.start);
        self.reader.expect(":")?;
        let mut shapes = Vec::new();
        let mut spans = AttachmentSpans {
            name: name_span,
            ..AttachmentSpans::default()
        };
        while self.at_shape() {
            let (shape, span) = self.shape()?;
            if let Some(shape) = shape {
                shapes.push(shape);
                spans.shapes.push(span);
            }
            self.after_shape()?;
        }
        let mut anchor = || -> Result<(Point3<f64>, String), Reported> {
            let start = self.reader.span().start;
            let local = self.point()?;
            let (node, _) = self.node()?;
            spans.anchors.push(self.reader.since(start));
            Ok((local, node.to_string()))
        };
        let anchors = [anchor()?, anchor()?, anchor()?];
        self.declarations
            .structure
            .attachments
            .push(AttachmentSpec {
                name: name.to_string(),
                shapes,
                anchors,
            });
        self.declarations.spans.attachments.push(spans);
        Ok(())
    }

    fn obstacle(&mut self) -> Result<(), Reported> {
        let (name, span) = self.reader.name("the name of an obstacle")?;
        self.bodies.declare(name, span.start);
        self.reader.expect(":")?;
        let (attached, shape_span) = self.shape()?;
        if let Some(attached) = attached {
            let environment = std::mem::take(&mut self.declarations.environment);
            self.declarations.environment = environment.obstacle(Obstacle {
                name: name.to_string(),
                shape: attached.shape,
                role: attached.role,
                color: attached.color,
            });
            self.declarations
                .spans
                .obstacles
                .push(span.start..shape_span.end);
        }
        self.after_shape()
    }

    fn collision(&mut self) -> Result<(), Reported> {
        let start = self.reader.span().start;
        let negated = self.reader.take_word("do");
        if negated && !self.reader.take_word("not") {
            return Err(self.reader.unexpected("`do not check :`"));
        }
        if !self.reader.take_word("check") {
            return Err(self.reader.unexpected("`check :` or `do not check :`"));
        }
        self.reader.expect(":")?;
        let what_span = self.reader.span();
        let mut spans = [what_span.clone(), what_span];
        let pairs = if self.reader.take_word("all") {
            PairSelection::All
        } else if self.reader.at_word("connected") {
            self.reader.advance();
            if !negated {
                let span = self.reader.since(start);
                let hint = "pairs of connected elements always touch; write `do not check: connected`, or leave the rule out";
                return Err(self.reader.error(
                    span,
                    "connected elements cannot be checked",
                    hint.to_string(),
                ));
            }
            PairSelection::Connected
        } else {
            let (first, _) = self.body("`all`, `connected` or a name")?;
            if self.reader.take(",") {
                let (second, span) = self.body("the name of an element or obstacle")?;
                spans[1] = span;
                PairSelection::Pair(first.to_string(), second.to_string())
            } else {
                PairSelection::Obstacle(first.to_string())
            }
        };
        let environment = std::mem::take(&mut self.declarations.environment);
        self.declarations.environment = environment.rule(CollisionRule {
            check: !negated,
            pairs,
        });
        self.declarations.spans.rules.push(spans);
        Ok(())
    }
}

/// Reads a product such as `Rz(pi/2)*Rx(1)`, applied from right to left.
pub(crate) fn transform(
    reader: &mut Reader<'_, '_>,
    scope: &Scope,
    with_translations: bool,
) -> Result<Isometry3<f64>, Reported> {
    let mut product = Isometry3::identity();
    loop {
        let expected = if with_translations {
            "a transform (Rx, Ry, Rz, Tx, Ty, Tz, Txyz or Id)"
        } else {
            "a rotation (Rx, Ry or Rz)"
        };
        let Token::Word(word) = reader.token() else {
            return Err(reader.unexpected(expected));
        };
        let keyword = word.to_ascii_lowercase();
        let known = matches!(keyword.as_str(), "rx" | "ry" | "rz")
            || (with_translations
                && matches!(keyword.as_str(), "tx" | "ty" | "tz" | "txyz" | "id"));
        if !known {
            return Err(reader.unexpected(expected));
        }
        reader.advance();
        let axis = match keyword.as_bytes().get(1) {
            Some(b'x') => Vector3::x_axis(),
            Some(b'y') => Vector3::y_axis(),
            _ => Vector3::z_axis(),
        };
        product *= match keyword.as_str() {
            "id" => Isometry3::identity(),
            "txyz" => {
                let way: [f64; 3] = reader.tuple(scope)?;
                Translation3::from(Vector3::from(way)).into()
            }
            _ => {
                let [amount] = reader.tuple(scope)?;
                if keyword.starts_with('r') {
                    Isometry3::from_parts(
                        Translation3::identity(),
                        UnitQuaternion::from_axis_angle(&axis, amount),
                    )
                } else {
                    Translation3::from(axis.into_inner() * amount).into()
                }
            }
        };
        if !reader.take("*") {
            return Ok(product);
        }
    }
}
