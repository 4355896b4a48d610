//! Where a structure touches nothing: clearances of all collision pairs as a
//! validity test for planners.
//!
//! Each pair keeps a lower bound of its clearance along a branch: it falls by
//! the displacement of the two bodies, and only when it is used up is the
//! clearance measured again. A step is accepted only when every pair is clear
//! **throughout**: by that bound, by the clearances at both ends against the
//! displacement, or by a plane that separates the bodies during linear motion
//! with room for twice the deviation of the true motion from it, measured at
//! the step's middle; the step is halved where that does not suffice.
//!
//! Cost of a step: one comparison for each pair, and a distance for those few
//! whose bound is used up.

mod contacts;

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use tensegra_atlas::{Contacts, Obstruction, SparseRow, Validity};
use tensegra_collision::{
    Capsule, Contact, Solid, capsule_capsule, capsule_solid, capsule_solid_posed, solid_solid,
    swept,
};

use crate::{
    environment::{BadShape, Body, Environment, Role, Shape},
    equilibrium::EquilibriumManifold,
    structure::{Attachment, Element, ElementKind, Interval, Structure},
};

/// Clearance kept, relative to the structure's size, so that a judge with
/// another solver agrees.
const LEAST_CLEARANCE: f64 = 1e-4;
/// The true motion between two samples deviates from the linear one by at most
/// this multiple of the deviation at the middle.
const DEVIATION_FACTOR: f64 = 2.0;
/// Another return to the manifold strays from the straight line at most this many
/// times as far as ours.
const STRAY_FACTOR: f64 = 4.0;
/// Forces vary linearly along a step of a path to this fraction of the largest force,
/// for an element as long as the structure; to less for a shorter one.
const FORCE_DEVIATION: f64 = 0.01;
/// Points move at most this much farther than the distance between samples.
const CURVATURE_FACTOR: f64 = 1.1;
/// In a tree, the motion is taken to stray from the linear one by this fraction of
/// the displacement; for whoever returns to the manifold in a way of their own, by no
/// less: it may bend to one side and the other with the middle on the straight line.
const PROBABLE_STRAY: f64 = 0.005;
/// Halvings of a step.
const HALVINGS: usize = 5;

/// One end of an element's capsule, on the line from its first to its last node.
#[derive(Clone, Copy, Debug)]
enum End {
    /// At a fraction of the length.
    Fraction(f64),
    /// At a distance from the first node.
    FromFirst(f64),
    /// At a distance from the last node.
    FromLast(f64),
}

impl End {
    fn fraction(self, length: f64) -> f64 {
        match self {
            Self::Fraction(f) => f,
            Self::FromFirst(d) => (d / length).clamp(0.0, 1.0),
            Self::FromLast(d) => (1.0 - d / length).clamp(0.0, 1.0),
        }
    }

    /// By how much the end's distance from the first node grows with the length.
    fn slope(self, length: f64) -> f64 {
        match self {
            Self::Fraction(f) => f,
            Self::FromFirst(d) => f64::from(u8::from(d >= length)),
            Self::FromLast(d) => f64::from(u8::from(d < length)),
        }
    }
}

/// A capsule that moves with the structure.
#[derive(Clone, Debug)]
enum MovingCapsule {
    Element {
        nodes: [usize; 2],
        ends: [End; 2],
        radius: f64,
    },
    Attached {
        attachment: usize,
        ends: [Vector3<f64>; 2],
        radius: f64,
    },
}

/// The two bodies of a pair, as primitive shapes.
#[derive(Clone, Copy, Debug)]
enum Primitives {
    Capsules(usize, usize),
    CapsuleObstacle(usize, usize),
    CapsuleAttached(usize, usize),
    AttachedObstacle(usize, usize),
    AttachedAttached(usize, usize),
}

#[derive(Clone, Copy, Debug)]
struct Pair {
    primitives: Primitives,
    /// The pair of the environment it belongs to.
    bodies: [Body; 2],
}

/// A convex or meshed shape glued to three nodes.
#[derive(Clone, Debug)]
struct AttachedSolid {
    attachment: usize,
    solid: Solid,
    radius: f64,
    middle: Vector3<f64>,
}

/// Three anchors of an attachment: points of it are p₀ + α u + β v + γ u × v
/// with u = p₁ − p₀ and v = p₂ − p₀.
#[derive(Clone, Debug)]
struct Frame {
    nodes: [usize; 3],
    local: [Point3<f64>; 3],
}

impl Frame {
    fn new(attachment: &Attachment) -> Self {
        Self {
            nodes: attachment.anchors.map(|anchor| anchor.node),
            local: attachment.anchors.map(|anchor| anchor.local),
        }
    }

    fn axes(p: [&Point3<f64>; 3]) -> Matrix3<f64> {
        let (u, v) = (p[1] - p[0], p[2] - p[0]);
        Matrix3::from_columns(&[u, v, u.cross(&v)])
    }

    /// Coordinates (α, β, γ) of a point of the attachment's own frame.
    fn coordinates(&self, point: &Point3<f64>) -> Option<Vector3<f64>> {
        let [a, b, c] = &self.local;
        Some(Self::axes([a, b, c]).try_inverse()? * (point - a))
    }

    fn world_axes(&self, positions: &[Point3<f64>]) -> Matrix3<f64> {
        Self::axes(self.nodes.map(|node| &positions[node]))
    }

    fn point(&self, coordinates: &Vector3<f64>, positions: &[Point3<f64>]) -> Point3<f64> {
        positions[self.nodes[0]] + self.world_axes(positions) * coordinates
    }

    /// The rigid motion from the attachment's frame to the world.
    fn pose(&self, positions: &[Point3<f64>]) -> Isometry3<f64> {
        let orthonormal = |p: [&Point3<f64>; 3]| {
            let (u, v) = ((p[1] - p[0]).normalize(), p[2] - p[0]);
            let w = u.cross(&v).normalize();
            Matrix3::from_columns(&[u, w.cross(&u), w])
        };
        let [a, b, c] = &self.local;
        let rotation = orthonormal(self.nodes.map(|node| &positions[node]))
            * orthonormal([a, b, c]).transpose();
        let rotation =
            UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation));
        let origin = positions[self.nodes[0]] - rotation * a.coords;
        Isometry3::from_parts(Translation3::from(origin.coords), rotation)
    }

    /// Gradients with respect to the anchors of nᵀ x for the point with the
    /// given coordinates.
    fn gradients(
        &self,
        c: &Vector3<f64>,
        n: &Vector3<f64>,
        positions: &[Point3<f64>],
    ) -> [(usize, Vector3<f64>); 3] {
        let [p0, p1, p2] = self.nodes.map(|node| positions[node]);
        let (u, v) = (p1 - p0, p2 - p0);
        let g1 = n * c.x + v.cross(n) * c.z;
        let g2 = n * c.y + n.cross(&u) * c.z;
        [
            (self.nodes[0], n - g1 - g2),
            (self.nodes[1], g1),
            (self.nodes[2], g2),
        ]
    }
}

/// The collision bodies and pairs of a problem.
#[derive(Clone, Debug)]
struct Scene {
    capsules: Vec<MovingCapsule>,
    attached: Vec<AttachedSolid>,
    obstacles: Vec<Solid>,
    frames: Vec<Frame>,
    pairs: Vec<Pair>,
}

/// Collision-free space over an equilibrium manifold: a [`Validity`].
#[derive(Clone, Debug)]
pub struct FreeSpace<'a, M: ?Sized> {
    manifold: &'a M,
    scene: Scene,
    size: f64,
    least: f64,
}

/// What is remembered of a configuration.
#[derive(Clone, Debug)]
pub struct Memory {
    state: State,
    /// Lower bound of the clearance of each pair.
    bounds: Vec<f64>,
    scratch: Scratch,
}

/// A point of the manifold with the node positions and bodies that follow.
#[derive(Clone, Debug)]
struct State {
    x: Vec<f64>,
    positions: Vec<Point3<f64>>,
    capsules: Vec<Capsule>,
    /// Pose of each attachment, where there are attached solids.
    poses: Vec<Isometry3<f64>>,
    /// Middle of each attached solid.
    middles: Vec<Point3<f64>>,
    /// Force and length of each element, once they are asked for.
    strengths: Vec<[f64; 2]>,
}

/// The largest displacement of any point of each body during a step, if linear.
#[derive(Clone, Debug, Default)]
struct Displacements {
    capsules: Vec<f64>,
    attached: Vec<f64>,
}

impl Displacements {
    fn largest(&self) -> f64 {
        let all = self.capsules.iter().chain(&self.attached);
        all.copied().fold(0.0, f64::max)
    }
}

/// Memory of the test of a step.
#[derive(Clone, Debug, Default)]
struct Scratch {
    moved: Displacements,
    doubts: Vec<Doubt>,
    /// Middles of the step, of its halves, and so on.
    middles: Vec<Middle>,
    gradients: Vec<(usize, Vector3<f64>)>,
    /// Forces and lengths at the start, unless it has them, and in the middle.
    strengths: [Vec<[f64; 2]>; 2],
}

#[derive(Clone, Debug)]
struct Middle {
    x: Vec<f64>,
    state: State,
    /// How far each capsule lies off the middle of the linear motion.
    strays: Vec<f64>,
    moved: Displacements,
    /// Pairs in doubt here too, and their clearances in the middle.
    open: Vec<(Doubt, f64)>,
    left: Vec<Doubt>,
}

/// For whom a step must be valid.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Rigour {
    /// For a tree; it will be judged again.
    Tree,
    /// For whoever moves as we do.
    Exact,
    /// For whoever returns to the manifold in a way of their own.
    Robust,
}

/// A pair whose clearance between two states is in doubt.
#[derive(Clone, Copy, Debug)]
struct Doubt {
    pair: usize,
    /// At both ends.
    clearances: [f64; 2],
}

/// A collision pair that is too close, for messages.
#[derive(Clone, Debug, PartialEq)]
pub struct Closest {
    /// Clearance, negative when the bodies overlap.
    pub clearance: f64,
    /// The bodies.
    pub bodies: [Body; 2],
}

/// Why a shape is not a valid solid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{body} has an invalid shape: {error}")]
pub struct BodyError {
    /// Name of the body.
    pub body: String,
    /// What is wrong with it.
    pub error: BadShape,
}

impl Scene {
    fn new(structure: &Structure, environment: &Environment) -> Result<Self, BodyError> {
        let mut scene = Self {
            capsules: Vec::new(),
            attached: Vec::new(),
            obstacles: Vec::new(),
            frames: structure.attachments.iter().map(Frame::new).collect(),
            pairs: Vec::new(),
        };
        let mut elements = Vec::new();
        for element in &structure.elements {
            let first = scene.capsules.len();
            scene.capsules.extend(element_capsules(element));
            elements.push(first..scene.capsules.len());
        }
        let (mut attached_capsules, mut attached_solids) = (Vec::new(), Vec::new());
        for (i, attachment) in structure.attachments.iter().enumerate() {
            let (first_capsule, first_solid) = (scene.capsules.len(), scene.attached.len());
            for part in attachment
                .shapes
                .iter()
                .filter(|s| s.role != Role::Decoration)
            {
                let error = |error| BodyError {
                    body: attachment.name.clone(),
                    error,
                };
                scene.attach(i, &part.shape).map_err(error)?;
            }
            attached_capsules.push(first_capsule..scene.capsules.len());
            attached_solids.push(first_solid..scene.attached.len());
        }
        // Decorations have no solid, and no pairs.
        let mut solid_of_obstacle = Vec::new();
        for obstacle in &environment.obstacles {
            if obstacle.role == Role::Decoration {
                solid_of_obstacle.push(None);
                continue;
            }
            solid_of_obstacle.push(Some(scene.obstacles.len()));
            let error = |error| BodyError {
                body: obstacle.name.clone(),
                error,
            };
            scene.obstacles.push(obstacle.shape.solid().map_err(error)?);
        }
        for &bodies in &environment.pairs {
            let collides = |body: Body| match body {
                Body::Element(e) => structure.elements[e].appearance.role != Role::Decoration,
                Body::Obstacle(o) => solid_of_obstacle[o].is_some(),
                Body::Attachment(_) => true,
            };
            if !bodies.iter().all(|&body| collides(body)) {
                continue;
            }
            let capsules = |body: Body| match body {
                Body::Element(e) => elements[e].clone(),
                Body::Attachment(a) => attached_capsules[a].clone(),
                Body::Obstacle(_) => 0..0,
            };
            let solids = |body: Body| match body {
                Body::Attachment(a) => attached_solids[a].clone(),
                _ => 0..0,
            };
            let obstacle = |body: Body| match body {
                Body::Obstacle(o) => solid_of_obstacle[o],
                _ => None,
            };
            let mut add = |primitives| scene.pairs.push(Pair { primitives, bodies });
            let [a, b] = bodies;
            for i in capsules(a) {
                capsules(b).for_each(|j| add(Primitives::Capsules(i, j)));
                solids(b).for_each(|j| add(Primitives::CapsuleAttached(i, j)));
                if let Some(o) = obstacle(b) {
                    add(Primitives::CapsuleObstacle(i, o));
                }
            }
            for i in solids(a) {
                capsules(b).for_each(|j| add(Primitives::CapsuleAttached(j, i)));
                solids(b).for_each(|j| add(Primitives::AttachedAttached(i, j)));
                if let Some(o) = obstacle(b) {
                    add(Primitives::AttachedObstacle(i, o));
                }
            }
        }
        Ok(scene)
    }

    /// Adds a shape of an attachment: balls and cylinders as capsules (a little
    /// larger at flat ends), others as they are.
    fn attach(&mut self, attachment: usize, shape: &Shape) -> Result<(), BadShape> {
        let frame = &self.frames[attachment];
        let coordinates = |p: &Point3<f64>| frame.coordinates(p).unwrap_or_else(Vector3::zeros);
        match shape {
            Shape::Sphere { center, radius } => {
                let center = coordinates(center);
                self.capsules.push(MovingCapsule::Attached {
                    attachment,
                    ends: [center, center],
                    radius: *radius,
                });
            }
            Shape::Cylinder { p, q, radius } => {
                self.capsules.push(MovingCapsule::Attached {
                    attachment,
                    ends: [coordinates(p), coordinates(q)],
                    radius: *radius,
                });
            }
            _ => {
                let solid = shape.solid()?;
                let (middle, radius) = solid.bounding_sphere();
                let middle = coordinates(&middle);
                self.attached.push(AttachedSolid {
                    attachment,
                    solid,
                    radius,
                    middle,
                });
            }
        }
        Ok(())
    }

    fn place(&self, state: &mut State) {
        let State {
            positions,
            capsules,
            poses,
            middles,
            ..
        } = state;
        for (pose, frame) in poses.iter_mut().zip(&self.frames) {
            *pose = frame.pose(positions);
        }
        for (middle, solid) in middles.iter_mut().zip(&self.attached) {
            *middle = self.frames[solid.attachment].point(&solid.middle, positions);
        }
        for (capsule, moving) in capsules.iter_mut().zip(&self.capsules) {
            match moving {
                MovingCapsule::Element {
                    nodes: [a, b],
                    ends,
                    ..
                } => {
                    let (p, q) = (positions[*a], positions[*b]);
                    let d = q - p;
                    let (first, last) = match ends {
                        [End::Fraction(first), End::Fraction(last)] => (*first, *last),
                        _ => {
                            let length = d.norm().max(f64::MIN_POSITIVE);
                            (ends[0].fraction(length), ends[1].fraction(length))
                        }
                    };
                    capsule.a = p + d * first;
                    capsule.b = p + d * last;
                }
                MovingCapsule::Attached {
                    attachment, ends, ..
                } => {
                    let frame = &self.frames[*attachment];
                    let axes = frame.world_axes(positions);
                    let origin = positions[frame.nodes[0]];
                    capsule.a = origin + axes * ends[0];
                    capsule.b = origin + axes * ends[1];
                }
            }
        }
    }

    fn state(&self, nodes: usize) -> State {
        let radius = |c: &MovingCapsule| match c {
            MovingCapsule::Element { radius, .. } | MovingCapsule::Attached { radius, .. } => {
                *radius
            }
        };
        State {
            x: Vec::new(),
            positions: vec![Point3::origin(); nodes],
            capsules: self
                .capsules
                .iter()
                .map(|c| Capsule {
                    a: Point3::origin(),
                    b: Point3::origin(),
                    radius: radius(c),
                })
                .collect(),
            poses: if self.attached.is_empty() {
                Vec::new()
            } else {
                vec![Isometry3::identity(); self.frames.len()]
            },
            middles: vec![Point3::origin(); self.attached.len()],
            strengths: Vec::new(),
        }
    }

    fn contact(&self, pair: &Pair, state: &State) -> Contact {
        let pose = |s: &AttachedSolid| state.poses[s.attachment];
        match pair.primitives {
            Primitives::Capsules(i, j) => capsule_capsule(&state.capsules[i], &state.capsules[j]),
            Primitives::CapsuleObstacle(i, o) => {
                capsule_solid(&state.capsules[i], &self.obstacles[o])
            }
            Primitives::CapsuleAttached(i, s) => {
                let solid = &self.attached[s];
                capsule_solid_posed(&state.capsules[i], &solid.solid, &pose(solid))
            }
            Primitives::AttachedObstacle(s, o) => {
                let solid = &self.attached[s];
                let identity = Isometry3::identity();
                solid_solid(&solid.solid, &pose(solid), &self.obstacles[o], &identity)
            }
            Primitives::AttachedAttached(s, r) => {
                let (s, r) = (&self.attached[s], &self.attached[r]);
                solid_solid(&s.solid, &pose(s), &r.solid, &pose(r))
            }
        }
    }

    /// Writes how far points of each body move at most, if linearly.
    fn displacements(&self, a: &State, b: &State, moved: &mut Displacements) {
        let capsules = a.capsules.iter().zip(&b.capsules);
        moved.capsules.clear();
        moved
            .capsules
            .extend(capsules.map(|(a, b)| farthest_end(a, b)));
        let middles = a.middles.iter().zip(&b.middles);
        moved.attached.clear();
        moved
            .attached
            .extend(middles.zip(&self.attached).map(|((p, q), solid)| {
                // A turn by θ moves points of a ball of radius r by at most θ r
                // beyond its centre.
                let [from, to] = [a, b].map(|state| state.poses[solid.attachment].rotation);
                (q - p).norm() + (from.inverse() * to).angle() * solid.radius
            }));
    }

    /// How far the bodies of a pair move towards each other at most: by the sum of
    /// their displacements.
    fn displacement(&self, pair: &Pair, moved: &Displacements) -> f64 {
        let Displacements { capsules, attached } = moved;
        CURVATURE_FACTOR
            * match pair.primitives {
                Primitives::Capsules(i, j) => capsules[i] + capsules[j],
                Primitives::CapsuleObstacle(i, _) => capsules[i],
                Primitives::CapsuleAttached(i, s) => capsules[i] + attached[s],
                Primitives::AttachedObstacle(s, _) => attached[s],
                Primitives::AttachedAttached(s, r) => attached[s] + attached[r],
            }
    }

    /// The same, sharper where two capsules move alike: no two of their points move
    /// more relative to each other than two of their ends do.
    fn relative_displacement(&self, pair: &Pair, sum: f64, a: &State, b: &State) -> f64 {
        let Primitives::Capsules(i, j) = pair.primitives else {
            return sum;
        };
        let moved = |i: usize| {
            let (from, to) = (&a.capsules[i], &b.capsules[i]);
            [to.a - from.a, to.b - from.b]
        };
        let ([p, q], [r, s]) = (moved(i), moved(j));
        let square = [p - r, p - s, q - r, q - s]
            .iter()
            .fold(0.0, |largest: f64, d| largest.max(d.norm_squared()));
        // What curvature may add depends on how far each of them moves.
        let curvature = sum * (1.0 - 1.0 / CURVATURE_FACTOR);
        sum.min(square.sqrt() + curvature)
    }

    /// Whether the pair keeps the slack while its bodies move linearly.
    fn is_swept_clear(&self, pair: &Pair, a: &State, b: &State, slack: f64) -> bool {
        match pair.primitives {
            Primitives::Capsules(i, j) => swept::swept_capsule_capsule(
                &a.capsules[i],
                &b.capsules[i],
                &a.capsules[j],
                &b.capsules[j],
                slack,
            )
            .is_clear(),
            Primitives::CapsuleObstacle(i, o) => {
                let obstacle = &self.obstacles[o];
                swept::swept_capsule_solid(&a.capsules[i], &b.capsules[i], obstacle, slack)
                    .is_clear()
            }
            _ => false,
        }
    }
}

/// How far the ends of a capsule's axis move at most.
fn farthest_end(from: &Capsule, to: &Capsule) -> f64 {
    (to.a - from.a).norm().max((to.b - from.b).norm())
}

/// The capsules of an element: struts and bars inset by one radius at both
/// ends, cables and springs from 10 % to 90 % of their length, prismatic struts
/// in two parts.
fn element_capsules(element: &Element) -> Vec<MovingCapsule> {
    let (nodes, radius) = (element.nodes, element.radius);
    let capsule = |ends, radius| MovingCapsule::Element {
        nodes,
        ends,
        radius,
    };
    match element.kind {
        ElementKind::Cable | ElementKind::Spring => {
            vec![capsule([End::Fraction(0.1), End::Fraction(0.9)], radius)]
        }
        ElementKind::Prismatic => {
            let Interval { lo, hi } = element.length;
            let tube = [
                End::FromFirst(radius),
                End::FromFirst((lo - radius).max(radius)),
            ];
            let rod = [End::FromLast((hi - lo).max(radius)), End::FromLast(radius)];
            vec![capsule(tube, radius), capsule(rod, 0.5 * radius)]
        }
        ElementKind::Strut | ElementKind::Bar if element.has_constant_length() => {
            let inset = (radius / element.length.lo).min(0.5);
            vec![capsule(
                [End::Fraction(inset), End::Fraction(1.0 - inset)],
                radius,
            )]
        }
        ElementKind::Strut | ElementKind::Bar => {
            vec![capsule(
                [End::FromFirst(radius), End::FromLast(radius)],
                radius,
            )]
        }
    }
}

impl<'a, M: EquilibriumManifold + ?Sized> FreeSpace<'a, M> {
    /// The free space of a structure with the given manifold. `size` is a
    /// typical length; contacts are measured in multiples of it.
    ///
    /// # Errors
    /// [`BodyError`] when a shape is not a solid.
    pub fn new(manifold: &'a M, environment: &Environment, size: f64) -> Result<Self, BodyError> {
        let scene = Scene::new(manifold.structure(), environment)?;
        Ok(Self {
            manifold,
            scene,
            size,
            least: LEAST_CLEARANCE * size,
        })
    }

    /// Keeps less clearance where the point x, a start or goal, has less:
    /// half of its own.
    pub fn admit(&mut self, x: &[f64]) {
        if let Some(closest) = self.closest(x) {
            self.least = self.least.min(0.5 * closest.clearance.max(0.0));
        }
    }

    /// The pair with the smallest clearance at x, if there are pairs at all.
    pub fn closest(&self, x: &[f64]) -> Option<Closest> {
        let state = self.state(x);
        self.scene
            .pairs
            .iter()
            .map(|pair| (self.scene.contact(pair, &state).clearance, pair))
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map(|(clearance, pair)| Closest {
                clearance,
                bodies: pair.bodies,
            })
    }

    /// The bodies of a contact.
    pub fn bodies(&self, contact: usize) -> [Body; 2] {
        self.scene.pairs[contact].bodies
    }

    /// Number of contacts: pairs of simple bodies of which the collision pairs are made.
    pub fn contact_count(&self) -> usize {
        self.scene.pairs.len()
    }

    /// Nodes on whose positions the clearance of a contact depends.
    pub fn contact_nodes(&self, contact: usize) -> Vec<usize> {
        let capsule = |capsule: usize| match &self.scene.capsules[capsule] {
            MovingCapsule::Element { nodes, .. } => nodes.to_vec(),
            MovingCapsule::Attached { attachment, .. } => {
                self.scene.frames[*attachment].nodes.to_vec()
            }
        };
        let attached = |solid: usize| {
            let attachment = self.scene.attached[solid].attachment;
            self.scene.frames[attachment].nodes.to_vec()
        };
        let mut nodes = match self.scene.pairs[contact].primitives {
            Primitives::Capsules(i, j) => [capsule(i), capsule(j)].concat(),
            Primitives::CapsuleObstacle(i, _) => capsule(i),
            Primitives::CapsuleAttached(i, s) => [capsule(i), attached(s)].concat(),
            Primitives::AttachedObstacle(s, _) => attached(s),
            Primitives::AttachedAttached(s, r) => [attached(s), attached(r)].concat(),
        };
        nodes.sort_unstable();
        nodes.dedup();
        nodes
    }

    /// Writes the clearances of all contacts at x; the memory then holds x.
    pub fn clearances(&self, x: &[f64], memory: &mut Memory, clearances: &mut [f64]) {
        self.place(x, &mut memory.state);
        for (pair, clearance) in self.scene.pairs.iter().zip(clearances) {
            *clearance = self.scene.contact(pair, &memory.state).clearance;
        }
    }

    /// The clearance of a contact at the point that the memory holds. Appends its gradients with
    /// respect to node positions; a node may occur more than once. `None` where the bodies touch
    /// in such a way that no direction separates them.
    pub fn clearance_gradient(
        &self,
        contact: usize,
        memory: &Memory,
        gradients: &mut Vec<(usize, Vector3<f64>)>,
    ) -> Option<f64> {
        self.gradients_of(contact, &memory.state, gradients)
    }

    fn gradients_of(
        &self,
        contact: usize,
        state: &State,
        gradients: &mut Vec<(usize, Vector3<f64>)>,
    ) -> Option<f64> {
        let pair = &self.scene.pairs[contact];
        let found = self.scene.contact(pair, state);
        self.contact_gradients(pair, &found, state, gradients)?;
        Some(found.clearance)
    }

    /// Gradients of the clearance of a pair at the given witnesses.
    fn contact_gradients(
        &self,
        pair: &Pair,
        found: &Contact,
        state: &State,
        gradients: &mut Vec<(usize, Vector3<f64>)>,
    ) -> Option<()> {
        let n = found.normal;
        if !found.clearance.is_finite() || n.norm_squared() == 0.0 {
            return None;
        }
        match pair.primitives {
            Primitives::Capsules(i, j) => {
                self.capsule_gradients(i, found.s, n, state, gradients);
                self.capsule_gradients(j, found.t, -n, state, gradients);
            }
            Primitives::CapsuleObstacle(i, _) => {
                self.capsule_gradients(i, found.s, n, state, gradients);
            }
            Primitives::CapsuleAttached(i, s) => {
                self.capsule_gradients(i, found.s, n, state, gradients);
                self.attached_gradients(s, &found.on_b, -n, state, gradients)?;
            }
            Primitives::AttachedObstacle(s, _) => {
                self.attached_gradients(s, &found.on_a, n, state, gradients)?;
            }
            Primitives::AttachedAttached(s, r) => {
                self.attached_gradients(s, &found.on_a, n, state, gradients)?;
                self.attached_gradients(r, &found.on_b, -n, state, gradients)?;
            }
        }
        Some(())
    }

    /// Gradients of nᵀ x for the point x at the fraction s of a capsule's axis.
    fn capsule_gradients(
        &self,
        capsule: usize,
        s: f64,
        n: Vector3<f64>,
        state: &State,
        gradients: &mut Vec<(usize, Vector3<f64>)>,
    ) {
        match &self.scene.capsules[capsule] {
            MovingCapsule::Element {
                nodes: [a, b],
                ends,
                ..
            } => {
                let d = state.positions[*b] - state.positions[*a];
                let length = d.norm();
                let along = |f: fn(End, f64) -> f64| {
                    let (first, last) = (f(ends[0], length), f(ends[1], length));
                    first + s * (last - first)
                };
                let f = along(End::fraction);
                let mut by_last = n * f;
                if length > 0.0 {
                    // Ends at a constant distance from a node do not follow the element's extension.
                    let stretched = (along(End::slope) - f) / (length * length);
                    by_last += d * (stretched * n.dot(&d));
                }
                gradients.extend([(*a, n - by_last), (*b, by_last)]);
            }
            MovingCapsule::Attached {
                attachment, ends, ..
            } => {
                let coordinates = ends[0] + (ends[1] - ends[0]) * s;
                let frame = &self.scene.frames[*attachment];
                gradients.extend(frame.gradients(&coordinates, &n, &state.positions));
            }
        }
    }

    /// Gradients of nᵀ x for a point x of an attached solid.
    fn attached_gradients(
        &self,
        solid: usize,
        at: &Point3<f64>,
        n: Vector3<f64>,
        state: &State,
        gradients: &mut Vec<(usize, Vector3<f64>)>,
    ) -> Option<()> {
        let frame = &self.scene.frames[self.scene.attached[solid].attachment];
        let axes = frame.world_axes(&state.positions).try_inverse()?;
        let coordinates = axes * (at - state.positions[frame.nodes[0]]);
        gradients.extend(frame.gradients(&coordinates, &n, &state.positions));
        Some(())
    }

    fn state(&self, x: &[f64]) -> State {
        let mut state = self.scene.state(self.manifold.structure().nodes.len());
        self.place(x, &mut state);
        state
    }

    fn place(&self, x: &[f64], state: &mut State) {
        state.x.clear();
        state.x.extend_from_slice(x);
        self.manifold.positions(x, &mut state.positions);
        state.strengths.clear();
        self.scene.place(state);
    }

    fn middle(&self) -> Middle {
        Middle {
            x: vec![0.0; self.manifold.ambient_dimension()],
            state: self.scene.state(self.manifold.structure().nodes.len()),
            strays: Vec::new(),
            moved: Displacements::default(),
            open: Vec::new(),
            left: Vec::new(),
        }
    }

    /// Whether some pairs are clear between the states `a` and `b`, at the
    /// fractions `s` of the step; they are clear at both. The step is halved as often
    /// as there are `middles`.
    fn is_clear_between(
        &self,
        doubts: &[Doubt],
        (a, b): (&State, &State),
        s: [f64; 2],
        between: &mut dyn FnMut(f64, &mut [f64]) -> bool,
        middles: &mut [Middle],
        robust: bool,
    ) -> bool {
        let Some((at_middle, middles)) = middles.split_first_mut() else {
            return false;
        };
        let Middle {
            x,
            state,
            strays,
            moved,
            open,
            left,
        } = at_middle;
        let middle = 0.5 * (s[0] + s[1]);
        if !between(middle, x) {
            return false;
        }
        self.place(x, state);
        // The deviation in all coordinates, forces included: a judge that
        // returns to the manifold along another normal may move the nodes by
        // what is a change of forces here.
        let whole = self.deviation(&a.x, &b.x, x);
        strays.clear();
        let capsules = a.capsules.iter().zip(&b.capsules).zip(&state.capsules);
        strays.extend(capsules.map(|((a, b), m)| {
            let first = (m.a - nalgebra::center(&a.a, &b.a)).norm();
            let last = (m.b - nalgebra::center(&a.b, &b.b)).norm();
            let stray = first.max(last).max(whole);
            if robust {
                stray.max(PROBABLE_STRAY * farthest_end(a, b))
            } else {
                stray
            }
        }));
        open.clear();
        for &doubt in doubts {
            let pair = &self.scene.pairs[doubt.pair];
            let stray = match pair.primitives {
                Primitives::Capsules(i, j) => strays[i] + strays[j],
                Primitives::CapsuleObstacle(i, _) => strays[i],
                _ => 0.0,
            };
            // Who returns to the manifold another way finds another middle, which may
            // stray farther from the straight line than this one.
            let room = if robust { STRAY_FACTOR * stray } else { 0.0 };
            let clearance = self.scene.contact(pair, state).clearance;
            if clearance < self.least + room {
                return false;
            }
            let slack = self.least + DEVIATION_FACTOR * stray;
            if !self.scene.is_swept_clear(pair, a, b, slack) {
                open.push((doubt, clearance));
            }
        }
        if open.is_empty() {
            return true;
        }
        if middles.is_empty() {
            return false;
        }
        let room = if robust { 0.5 * whole } else { 0.0 };
        let state = &*state;
        let halves = [((a, state), [s[0], middle]), ((state, b), [middle, s[1]])];
        halves.into_iter().enumerate().all(|(half, (states, s))| {
            let least = self.least + room;
            self.scene.displacements(states.0, states.1, moved);
            left.clear();
            left.extend(open.iter().filter_map(|&(mut doubt, clearance)| {
                doubt.clearances[1 - half] = clearance;
                let pair = &self.scene.pairs[doubt.pair];
                let sum = self.scene.displacement(pair, moved);
                let moved = self
                    .scene
                    .relative_displacement(pair, sum, states.0, states.1);
                let [first, last] = doubt.clearances;
                (first + last - 2.0 * least <= moved).then_some(doubt)
            }));
            left.is_empty() || self.is_clear_between(left, states, s, between, middles, robust)
        })
    }

    /// How far the middle of the motion from `a` to `b` lies off the straight line
    /// between them, as a length, changes of forces included.
    fn stray(
        &self,
        a: &[f64],
        b: &[f64],
        middle: &mut [f64],
        between: &mut dyn FnMut(f64, &mut [f64]) -> bool,
    ) -> Option<f64> {
        between(0.5, middle).then(|| self.deviation(a, b, middle))
    }

    /// Whether forces vary nearly linearly from `a` to `b`. Of short elements force
    /// density and force do not do so both, and who knows forces only finds another
    /// middle than who follows densities.
    fn forces_are_linear(
        &self,
        a: &State,
        middle: &[f64],
        b: &mut State,
        [at_start, in_middle]: &mut [Vec<[f64; 2]>; 2],
    ) -> bool {
        let manifold = self.manifold;
        manifold.forces_and_lengths(middle, in_middle);
        manifold.forces_and_lengths(&b.x, &mut b.strengths);
        let start = if a.strengths.is_empty() {
            manifold.forces_and_lengths(&a.x, at_start);
            at_start
        } else {
            &a.strengths
        };
        let largest = start
            .iter()
            .fold(0.0, |most: f64, [f, _]| most.max(f.abs()));
        let ends = start.iter().zip(&b.strengths);
        ends.zip(in_middle).all(|(([a, _], [b, _]), [f, length])| {
            (*f - 0.5 * (a + b)).abs() * self.size <= FORCE_DEVIATION * largest * *length
        })
    }

    fn deviation(&self, a: &[f64], b: &[f64], middle: &[f64]) -> f64 {
        let square: f64 = a
            .iter()
            .zip(b)
            .zip(middle)
            .map(|((a, b), y)| (y - 0.5 * (a + b)).powi(2))
            .sum();
        self.size * square.sqrt()
    }

    /// [`Validity::step`] and its variants.
    fn test(
        &self,
        from: &Memory,
        x: &[f64],
        to: &mut Memory,
        between: &mut dyn FnMut(f64, &mut [f64]) -> bool,
        violated: &mut Vec<usize>,
        rigour: Rigour,
    ) -> Result<(), Obstruction> {
        let robust = rigour == Rigour::Robust;
        if self.scene.pairs.is_empty() && !robust {
            return Ok(());
        }
        let Memory {
            state,
            bounds,
            scratch,
        } = to;
        let Scratch {
            moved,
            doubts,
            middles,
            strengths,
            ..
        } = scratch;
        middles.resize_with(HALVINGS + 1, || self.middle());
        self.place(x, state);
        self.scene.displacements(&from.state, state, moved);
        doubts.clear();
        // Others may find the middle as far off again as it is from the straight line.
        let least = if robust {
            let middle = &mut middles[0].x;
            match self.stray(&from.state.x, x, middle, between) {
                Some(stray) if self.forces_are_linear(&from.state, middle, state, strengths) => {
                    self.least + DEVIATION_FACTOR * stray.max(PROBABLE_STRAY * moved.largest())
                }
                _ => return Err(Obstruction::Blocked),
            }
        } else {
            self.least
        };
        let state = &*state;
        let states = (&from.state, state);
        let bounds = from.bounds.iter().zip(bounds);
        for (i, (pair, (&before, after))) in self.scene.pairs.iter().zip(bounds).enumerate() {
            let sum = self.scene.displacement(pair, moved);
            *after = before - sum;
            if *after > least {
                continue;
            }
            let moved = self
                .scene
                .relative_displacement(pair, sum, &from.state, state);
            *after = before - moved;
            if *after > least {
                continue;
            }
            let bound = self.scene.lower_bound(pair, state);
            if bound - moved > least {
                *after = bound;
                continue;
            }
            let clearance = self.scene.contact(pair, state).clearance;
            *after = clearance;
            if clearance < self.least {
                violated.push(i);
            } else if clearance - moved <= least && before + clearance - 2.0 * least <= moved {
                // The bound of the clearance at the start may be much too low.
                let before = self.scene.contact(pair, &from.state).clearance;
                if before + clearance - 2.0 * least <= moved
                    && !(rigour == Rigour::Tree
                        && self.scene.is_swept_clear(
                            pair,
                            &from.state,
                            state,
                            self.least + PROBABLE_STRAY * moved,
                        ))
                {
                    doubts.push(Doubt {
                        pair: i,
                        clearances: [before, clearance],
                    });
                }
            }
        }
        if !violated.is_empty() {
            return Err(Obstruction::Contacts);
        }
        if doubts.is_empty()
            || self.is_clear_between(doubts, states, [0.0, 1.0], between, middles, robust)
        {
            Ok(())
        } else {
            Err(Obstruction::Blocked)
        }
    }
}

impl<M: EquilibriumManifold + ?Sized> Validity for FreeSpace<'_, M> {
    type Memory = Memory;

    fn memory(&self) -> Memory {
        Memory {
            state: self.scene.state(self.manifold.structure().nodes.len()),
            bounds: vec![f64::NEG_INFINITY; self.scene.pairs.len()],
            scratch: Scratch::default(),
        }
    }

    fn enter(&self, x: &[f64], memory: &mut Memory) {
        self.place(x, &mut memory.state);
        memory.bounds.fill(f64::NEG_INFINITY);
    }

    fn step(
        &self,
        from: &Memory,
        x: &[f64],
        to: &mut Memory,
        between: &mut dyn FnMut(f64, &mut [f64]) -> bool,
        violated: &mut Vec<usize>,
    ) -> Result<(), Obstruction> {
        self.test(from, x, to, between, violated, Rigour::Exact)
    }

    fn tree_step(
        &self,
        from: &Memory,
        x: &[f64],
        to: &mut Memory,
        between: &mut dyn FnMut(f64, &mut [f64]) -> bool,
        violated: &mut Vec<usize>,
    ) -> Result<(), Obstruction> {
        self.test(from, x, to, between, violated, Rigour::Tree)
    }

    fn robust_step(
        &self,
        from: &Memory,
        x: &[f64],
        to: &mut Memory,
        between: &mut dyn FnMut(f64, &mut [f64]) -> bool,
    ) -> bool {
        self.test(from, x, to, between, &mut Vec::new(), Rigour::Robust)
            .is_ok()
    }

    fn contact(
        &self,
        contact: usize,
        x: &[f64],
        memory: &mut Self::Memory,
        row: &mut SparseRow,
    ) -> Option<f64> {
        let Memory { state, scratch, .. } = memory;
        let gradients = &mut scratch.gradients;
        if state.x != x {
            self.place(x, state);
        }
        gradients.clear();
        let clearance = self.gradients_of(contact, state, gradients)?;
        for (_, gradient) in &mut *gradients {
            *gradient /= self.size;
        }
        self.manifold.pull_back(x, gradients, row);
        Some((clearance - self.least) / self.size)
    }

    fn contacts(&self, x: &[f64], memory: &mut Memory, reach: f64, found: &mut Contacts) {
        self.find_contacts(x, memory, reach, found);
    }

    fn is_clear(
        &self,
        a: &[f64],
        b: &[f64],
        between: &mut dyn FnMut(f64, &mut [f64]) -> bool,
    ) -> bool {
        self.is_clear_throughout(a, b, between)
    }

    fn displacement(&self, a: &[f64], b: &[f64]) -> f64 {
        self.manifold.displacement(a, b)
    }

    fn is_valid(&self, x: &[f64]) -> bool {
        self.closest(x)
            .is_none_or(|closest| closest.clearance >= self.least)
    }
}
