//! What surrounds a structure: obstacles, and which bodies may not touch.

use std::collections::HashMap;

use nalgebra::Point3;
use tensegra_collision::{MeshError, ShapeError, Solid};
use thiserror::Error;

use crate::{build_errors::BuildErrors, diagnostic::did_you_mean, structure::Structure};

/// Whether a body collides and is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Role {
    /// Collides and is drawn.
    #[default]
    Solid,
    /// Collides but is not drawn.
    Hidden,
    /// Is drawn but never collides.
    Decoration,
}

/// A shape, in the frame of its owner.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// An axis-aligned box.
    Box {
        /// Least corner.
        min: Point3<f64>,
        /// Greatest corner.
        max: Point3<f64>,
    },
    /// A ball.
    Sphere {
        /// Centre.
        center: Point3<f64>,
        /// Radius.
        radius: f64,
    },
    /// A cylinder with flat ends.
    Cylinder {
        /// Centre of one end.
        p: Point3<f64>,
        /// Centre of the other end.
        q: Point3<f64>,
        /// Radius.
        radius: f64,
    },
    /// A triangle extruded along its normal (p1 − p0) × (p2 − p0).
    Prism {
        /// Corners of the triangle.
        corners: [Point3<f64>; 3],
        /// Height of the extrusion.
        height: f64,
    },
    /// All points on or below a plane.
    HalfSpace {
        /// A point of the plane.
        point: Point3<f64>,
        /// Normal that points out of the solid.
        normal: nalgebra::Vector3<f64>,
    },
    /// A closed surface of polygons, possibly not convex.
    Mesh {
        /// The file it was read from, as the problem names it.
        file: String,
        /// Vertices.
        vertices: Vec<Point3<f64>>,
        /// Faces, as indices of vertices in order.
        faces: Vec<Vec<usize>>,
    },
}

/// A fixed body of the environment.
#[derive(Clone, Debug, PartialEq)]
pub struct Obstacle {
    /// Name, unique among elements, obstacles and attachments.
    pub name: String,
    /// Its shape, in world coordinates.
    pub shape: Shape,
    /// Whether it collides and is drawn.
    pub role: Role,
    /// Name of a colour, where the file gives one.
    pub color: Option<String>,
}

/// A body that takes part in collision tests.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Body {
    /// An element of the structure.
    Element(usize),
    /// An attachment of the structure.
    Attachment(usize),
    /// An obstacle.
    Obstacle(usize),
}

/// Obstacles, and the pairs of bodies that may not touch.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Environment {
    /// Obstacles, in the order of declaration.
    pub obstacles: Vec<Obstacle>,
    /// Pairs that are tested: the lower body (in the order of [`Body`]) first,
    /// sorted, without repetition. Obstacles are never paired with each other.
    pub pairs: Vec<[Body; 2]>,
}

impl Shape {
    /// The solid that collision tests see.
    ///
    /// # Errors
    /// A shape that is no body: numbers that are not finite, sizes that are not
    /// positive, a surface that is not closed.
    pub fn solid(&self) -> Result<Solid, BadShape> {
        Ok(match self {
            Self::Box { min, max } => Solid::cuboid(*min, *max)?,
            Self::Sphere { center, radius } => Solid::sphere(*center, *radius)?,
            Self::Cylinder { p, q, radius } => Solid::cylinder(*p, *q, *radius)?,
            Self::Prism {
                corners: [p0, p1, p2],
                height,
            } => Solid::triangular_prism(*p0, *p1, *p2, *height)?,
            Self::HalfSpace { point, normal } => Solid::half_space(*point, *normal)?,
            Self::Mesh {
                vertices, faces, ..
            } => Solid::mesh(vertices, faces)?,
        })
    }

    /// Whether the shape can play its role: whatever collides must be a body, a
    /// decoration may be any surface.
    pub(crate) fn validate(&self, role: Role) -> Result<(), BadShape> {
        match self {
            Self::Mesh { .. } if role == Role::Decoration => Ok(()),
            _ => self.solid().map(drop),
        }
    }
}

/// Why a shape is no body.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum BadShape {
    /// The numbers of a simple shape describe no body.
    #[error(transparent)]
    Shape(#[from] ShapeError),
    /// The surface of a mesh encloses no body.
    #[error(transparent)]
    Mesh(#[from] MeshError),
}

/// A rule of collision testing; a later rule overrules an earlier one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CollisionRule {
    /// Whether the pairs are tested, or no longer tested.
    pub check: bool,
    /// Which pairs the rule is about.
    pub pairs: PairSelection,
}

/// Pairs of bodies that a [`CollisionRule`] is about.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum PairSelection {
    /// All pairs of bodies, except two obstacles.
    All,
    /// Pairs of elements that share a node.
    Connected,
    /// The obstacle of this name with every element and attachment.
    Obstacle(String),
    /// Two bodies by name.
    Pair(String, String),
}

/// An error of an environment: of which part, and why.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("{flaw}")]
pub struct EnvironmentError {
    /// Where it is.
    pub place: EnvironmentPlace,
    /// What is wrong.
    pub flaw: EnvironmentFlaw,
}

/// A part of an environment under construction, by its index in the order of declaration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum EnvironmentPlace {
    /// An obstacle.
    Obstacle(usize),
    /// A collision rule; where one of its names is wrong, which one.
    Rule(usize, usize),
}

/// What can be wrong with an environment.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum EnvironmentFlaw {
    /// Two things have one name.
    #[error("the name `{name}` is taken by {by}; choose another for the obstacle")]
    DuplicateName {
        /// The name.
        name: String,
        /// What has it already.
        by: &'static str,
    },
    /// The name of an obstacle is empty.
    #[error("the name of the obstacle is empty")]
    EmptyName,
    /// A shape that is no body.
    #[error("obstacle `{name}`: {reason}")]
    BadShape {
        /// The obstacle.
        name: String,
        /// Why.
        reason: BadShape,
    },
    /// No body has this name.
    #[error("there is no element, attachment or obstacle `{name}`")]
    UnknownBody {
        /// The name.
        name: String,
        /// A body that may be meant.
        suggestion: Option<String>,
    },
    /// A body that is no obstacle where an obstacle is meant.
    #[error("`{name}` is no obstacle; a rule with one name is about an obstacle")]
    NoObstacle {
        /// The name.
        name: String,
    },
    /// Two obstacles.
    #[error("`{a}` and `{b}` are both obstacles, which never move against each other")]
    TwoObstacles {
        /// One.
        a: String,
        /// The other.
        b: String,
    },
    /// A body with itself.
    #[error("`{name}` cannot collide with itself")]
    Itself {
        /// The body.
        name: String,
    },
    /// A decoration that is to be tested.
    #[error("`{name}` is a decoration, which never collides")]
    Decoration {
        /// The body.
        name: String,
    },
    /// More pairs than can be tested.
    #[error("{count} pairs of bodies would be tested; at most {MAX_PAIRS} can be")]
    TooManyPairs {
        /// How many.
        count: usize,
    },
}

impl EnvironmentFlaw {
    /// How to mend it, where that is not plain from the message.
    pub fn hint(&self) -> Option<String> {
        let text = match self {
            Self::UnknownBody { suggestion, .. } => return suggestion.clone(),
            Self::NoObstacle { .. } => "name the two bodies of a pair, or an obstacle",
            Self::Decoration { .. } => "remove the rule, or do not call the body a decoration",
            Self::TooManyPairs { .. } => "test chosen pairs instead of all",
            _ => return None,
        };
        Some(text.to_string())
    }
}

/// Pairs of bodies that an environment can hold.
const MAX_PAIRS: usize = 2_000_000;

/// Builds an [`Environment`] for a structure, with full validation.
///
/// Nothing is tested unless a rule says so; the last rule that is about a pair
/// decides. Decorations are never tested. Cost: linear in the declarations and
/// in the pairs that result (times a logarithm for sorting).
///
/// ```
/// use nalgebra::Point3;
/// use tensegra_model::{EnvironmentBuilder, Obstacle, Role, Shape, StructureBuilder};
///
/// let structure = StructureBuilder::planar()
///     .strut("s1", ["a", "b"], 1.0)
///     .cable("c1", ["b", "a"], 0.5..=2.0, 1.0, 0.0..=2.0)
///     .build()?;
/// let ball = Obstacle {
///     name: "ball".into(),
///     shape: Shape::Sphere { center: Point3::new(3.0, 0.0, 0.0), radius: 0.5 },
///     role: Role::Solid,
///     color: None,
/// };
/// let environment = EnvironmentBuilder::default()
///     .obstacle(ball)
///     .check_all()
///     .ignore_connected()
///     .build(&structure)?;
/// assert_eq!(environment.pairs.len(), 2);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EnvironmentBuilder {
    obstacles: Vec<Obstacle>,
    rules: Vec<CollisionRule>,
}

impl EnvironmentBuilder {
    /// Adds an obstacle.
    pub fn obstacle(mut self, obstacle: Obstacle) -> Self {
        self.obstacles.push(obstacle);
        self
    }

    /// Adds a rule.
    pub fn rule(mut self, rule: CollisionRule) -> Self {
        self.rules.push(rule);
        self
    }

    /// Tests all pairs of bodies.
    pub fn check_all(self) -> Self {
        self.rule(CollisionRule {
            check: true,
            pairs: PairSelection::All,
        })
    }

    /// Tests a pair of bodies, given by name.
    pub fn check(self, a: &str, b: &str) -> Self {
        self.rule(CollisionRule {
            check: true,
            pairs: PairSelection::Pair(a.to_string(), b.to_string()),
        })
    }

    /// Tests an obstacle against every element and attachment.
    pub fn check_obstacle(self, obstacle: &str) -> Self {
        self.rule(CollisionRule {
            check: true,
            pairs: PairSelection::Obstacle(obstacle.to_string()),
        })
    }

    /// Does not test elements that share a node.
    pub fn ignore_connected(self) -> Self {
        self.rule(CollisionRule {
            check: false,
            pairs: PairSelection::Connected,
        })
    }

    /// Does not test a pair of bodies.
    pub fn ignore(self, a: &str, b: &str) -> Self {
        self.rule(CollisionRule {
            check: false,
            pairs: PairSelection::Pair(a.to_string(), b.to_string()),
        })
    }

    /// Validates the obstacles, resolves the rules, and builds the environment.
    ///
    /// # Errors
    /// Everything that is wrong, in the order of declaration.
    pub fn build(
        self,
        structure: &Structure,
    ) -> Result<Environment, BuildErrors<EnvironmentError>> {
        let mut errors = Vec::new();
        let mut bodies = Bodies::new(structure);
        for (index, obstacle) in self.obstacles.iter().enumerate() {
            if let Err(flaw) = bodies.add_obstacle(index, obstacle) {
                errors.push(EnvironmentError {
                    place: EnvironmentPlace::Obstacle(index),
                    flaw,
                });
            }
        }
        let mut rules = Rules::new(self.obstacles.len());
        for (index, rule) in self.rules.iter().enumerate() {
            if let Err((member, flaw)) = rules.add(index, rule, &bodies, errors.len()) {
                errors.push(EnvironmentError {
                    place: EnvironmentPlace::Rule(index, member),
                    flaw,
                });
            }
        }
        BuildErrors::none_of(errors)?;
        let pairs = rules
            .pairs(structure, &bodies)
            .map_err(|flaw| EnvironmentError {
                place: EnvironmentPlace::Rule(rules.all.map_or(0, |(index, _)| index), 0),
                flaw,
            })?;
        Ok(Environment {
            obstacles: self.obstacles,
            pairs,
        })
    }
}

/// All bodies by name, and whether they can collide.
struct Bodies {
    by_name: HashMap<String, Body>,
    elements: Vec<bool>,
    attachments: Vec<bool>,
    obstacles: Vec<bool>,
}

impl Bodies {
    fn new(structure: &Structure) -> Self {
        let elements = structure.elements.iter().enumerate();
        let attachments = structure.attachments.iter().enumerate();
        let by_name = elements
            .map(|(index, element)| (element.name.clone(), Body::Element(index)))
            .chain(
                attachments
                    .map(|(index, attachment)| (attachment.name.clone(), Body::Attachment(index))),
            )
            .collect();
        Self {
            by_name,
            elements: structure
                .elements
                .iter()
                .map(|element| element.appearance.role != Role::Decoration)
                .collect(),
            attachments: structure
                .attachments
                .iter()
                .map(|attachment| {
                    attachment
                        .shapes
                        .iter()
                        .any(|attached| attached.role != Role::Decoration)
                })
                .collect(),
            obstacles: Vec::new(),
        }
    }

    fn add_obstacle(&mut self, index: usize, obstacle: &Obstacle) -> Result<(), EnvironmentFlaw> {
        let name = obstacle.name.clone();
        self.obstacles.push(obstacle.role != Role::Decoration);
        if name.is_empty() {
            return Err(EnvironmentFlaw::EmptyName);
        }
        if let Some(body) = self.by_name.get(&name) {
            let by = match body {
                Body::Element(_) => "an element",
                Body::Attachment(_) => "an attachment",
                Body::Obstacle(_) => "another obstacle",
            };
            return Err(EnvironmentFlaw::DuplicateName { name, by });
        }
        self.by_name.insert(name.clone(), Body::Obstacle(index));
        obstacle
            .shape
            .validate(obstacle.role)
            .map_err(|reason| EnvironmentFlaw::BadShape { name, reason })
    }

    fn collides(&self, body: Body) -> bool {
        match body {
            Body::Element(index) => self.elements[index],
            Body::Attachment(index) => self.attachments[index],
            Body::Obstacle(index) => self.obstacles[index],
        }
    }

    /// Elements and attachments that can collide.
    fn moving(&self) -> Vec<Body> {
        let elements = (0..self.elements.len()).map(Body::Element);
        let attachments = (0..self.attachments.len()).map(Body::Attachment);
        elements
            .chain(attachments)
            .filter(|&body| self.collides(body))
            .collect()
    }
}

/// The last rule of each reach: its index, and whether it tests.
struct Rules {
    all: Option<(usize, bool)>,
    connected: Option<(usize, bool)>,
    obstacles: Vec<Option<(usize, bool)>>,
    pairs: HashMap<[Body; 2], (usize, bool)>,
}

impl Rules {
    fn new(obstacles: usize) -> Self {
        Self {
            all: None,
            connected: None,
            obstacles: vec![None; obstacles],
            pairs: HashMap::new(),
        }
    }

    /// Takes in a rule; an error comes with the name that is wrong, 0 or 1.
    fn add(
        &mut self,
        index: usize,
        rule: &CollisionRule,
        bodies: &Bodies,
        errors_so_far: usize,
    ) -> Result<(), (usize, EnvironmentFlaw)> {
        let find = |member: usize, name: &String| -> Result<Body, (usize, EnvironmentFlaw)> {
            let Some(&body) = bodies.by_name.get(name) else {
                // None after many errors, which keeps the cost of hopeless input linear.
                let suggestion = (errors_so_far < 40)
                    .then(|| did_you_mean(name, bodies.by_name.keys().map(String::as_str)))
                    .flatten();
                let name = name.clone();
                return Err((member, EnvironmentFlaw::UnknownBody { name, suggestion }));
            };
            if rule.check && !bodies.collides(body) {
                let name = name.clone();
                return Err((member, EnvironmentFlaw::Decoration { name }));
            }
            Ok(body)
        };
        let verdict = (index, rule.check);
        match &rule.pairs {
            PairSelection::All => self.all = Some(verdict),
            PairSelection::Connected => self.connected = Some(verdict),
            PairSelection::Obstacle(name) => match find(0, name)? {
                Body::Obstacle(obstacle) => self.obstacles[obstacle] = Some(verdict),
                _ => {
                    let name = name.clone();
                    return Err((0, EnvironmentFlaw::NoObstacle { name }));
                }
            },
            PairSelection::Pair(first, second) => {
                let (a, b) = (find(0, first)?, find(1, second)?);
                let (first, second) = (first.clone(), second.clone());
                if a == b {
                    return Err((1, EnvironmentFlaw::Itself { name: first }));
                }
                if let (Body::Obstacle(_), Body::Obstacle(_)) = (a, b) {
                    let (a, b) = (first, second);
                    return Err((1, EnvironmentFlaw::TwoObstacles { a, b }));
                }
                self.pairs.insert([a.min(b), a.max(b)], verdict);
            }
        }
        Ok(())
    }

    /// The pairs that are tested, sorted.
    fn pairs(
        &self,
        structure: &Structure,
        bodies: &Bodies,
    ) -> Result<Vec<[Body; 2]>, EnvironmentFlaw> {
        let moving = bodies.moving();
        let obstacles: Vec<Body> = (0..bodies.obstacles.len())
            .map(Body::Obstacle)
            .filter(|&body| bodies.collides(body))
            .collect();
        let connected = |a: Body, b: Body| match (a, b) {
            (Body::Element(a), Body::Element(b)) => {
                let (a, b) = (structure.elements[a].nodes, structure.elements[b].nodes);
                a.iter().any(|node| b.contains(node))
            }
            _ => false,
        };
        let tested = |a: Body, b: Body| -> bool {
            let by_connection = self.connected.filter(|_| connected(a, b));
            let by_obstacle = match b {
                Body::Obstacle(index) => self.obstacles[index],
                _ => None,
            };
            let by_name = self.pairs.get(&[a, b]).copied();
            [self.all, by_connection, by_obstacle, by_name]
                .into_iter()
                .flatten()
                .max()
                .is_some_and(|(_, check)| check)
        };

        // Candidates: everything where a rule tests everything, else what is named.
        let n = moving.len();
        let everything = [self.all, self.connected]
            .into_iter()
            .flatten()
            .any(|(_, check)| check);
        let named_obstacles = obstacles.iter().filter(|body| {
            matches!(body, Body::Obstacle(index) if self.obstacles[*index].is_some_and(|(_, check)| check))
        });
        let count = if everything {
            (n * n.saturating_sub(1) / 2).saturating_add(n * obstacles.len())
        } else {
            (n * named_obstacles.clone().count()).saturating_add(self.pairs.len())
        };
        if count > MAX_PAIRS {
            return Err(EnvironmentFlaw::TooManyPairs { count });
        }
        let mut pairs = Vec::new();
        if everything {
            for (index, &a) in moving.iter().enumerate() {
                let others = moving[index + 1..].iter().chain(&obstacles);
                pairs.extend(others.map(|&b| [a, b]).filter(|&[a, b]| tested(a, b)));
            }
        } else {
            for &obstacle in named_obstacles {
                let with_all = moving.iter().map(|&a| [a, obstacle]);
                pairs.extend(with_all.filter(|&[a, b]| tested(a, b)));
            }
            pairs.extend(self.pairs.keys().filter(|&&[a, b]| tested(a, b)));
        }
        pairs.sort_unstable();
        pairs.dedup();
        Ok(pairs)
    }
}
