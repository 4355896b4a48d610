//! What surrounds a structure: obstacles, and which bodies may not touch.

use nalgebra::Point3;

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
