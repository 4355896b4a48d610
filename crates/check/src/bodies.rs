//! The bodies that may collide, and where they are at a configuration.
//!
//! A body is made of parts. A part that moves does so with a few control points: every point of it
//! is a fixed convex combination of them (the ends of a capsule; the corners of a box around a
//! solid). So what holds for the motion of the control points, a bound on displacements or on the
//! deviation from straight lines, holds for the whole part.
//!
//! | body | parts |
//! |---|---|
//! | strut, bar | capsule whose end caps touch the nodes |
//! | cable, spring | capsule of the axis from 10 % to 90 % |
//! | prismatic strut | capsule of the least length from the first node; rod of half the radius from the far node that covers the range; ball of the radius at the far node |
//! | attachment | its shapes, placed by its three anchors |
//! | obstacle | its shape |

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use tensegra_collision::{
    Aabb, Capsule, Solid, capsule_capsule, capsule_solid, capsule_solid_posed, solid_solid,
    swept::{Certificate, swept_capsule_capsule, swept_capsule_solid},
};
use tensegra_model::{Attachment, Body, Element, ElementKind, Problem, Role, Shape, Structure};

use crate::report::{Check, Ledger, Location};

/// Which stretch of an element's axis a capsule covers.
#[derive(Clone, Copy, Debug)]
enum Stretch {
    /// All but this length at both ends.
    Inset(f64),
    /// From 10 % to 90 %.
    Middle,
    /// From one distance to another from the first node.
    FromFirst(f64, f64),
    /// From one distance to another from the second node.
    FromSecond(f64, f64),
}

impl Stretch {
    fn ends(self, a: &Point3<f64>, b: &Point3<f64>) -> [Point3<f64>; 2] {
        let length = (b - a).norm();
        // Fractions of the axis; a capsule never reaches beyond the nodes.
        let share = |distance: f64| {
            if length > distance {
                distance / length
            } else {
                1.0
            }
        };
        let (from, to) = match self {
            Self::Inset(inset) => (share(inset).min(0.5), 1.0 - share(inset).min(0.5)),
            Self::Middle => (0.1, 0.9),
            Self::FromFirst(from, to) => (share(from), share(to)),
            Self::FromSecond(from, to) => (1.0 - share(from), 1.0 - share(to)),
        };
        [a + (b - a) * from, a + (b - a) * to]
    }
}

enum Geometry {
    /// A capsule on the axis of an element.
    Element {
        nodes: [usize; 2],
        stretch: Stretch,
        radius: f64,
    },
    /// A capsule of an attachment, in its frame.
    AttachedCapsule { attachment: usize, capsule: Capsule },
    /// A solid of an attachment, in its frame, with the corners of a box around it.
    AttachedSolid {
        attachment: usize,
        solid: Box<Solid>,
        corners: [Point3<f64>; 8],
    },
    /// A capsule of the environment.
    FixedCapsule(Capsule),
    /// A solid of the environment.
    FixedSolid(Box<Solid>),
}

struct Part {
    geometry: Geometry,
    /// A capsule around the solid, in its frame, where there is one that fits tightly.
    hull: Option<Capsule>,
    /// First control point, and how many.
    control: usize,
    count: usize,
}

/// Two parts of the bodies of one pair.
pub(crate) struct PartPair {
    pub(crate) bodies: [Body; 2],
    parts: [usize; 2],
}

/// The bodies of a problem, and the pairs that may not touch.
pub(crate) struct Bodies<'a> {
    structure: &'a Structure,
    parts: Vec<Part>,
    pub(crate) pairs: Vec<PartPair>,
    controls: usize,
}

/// Where the bodies are at one configuration.
#[derive(Clone, Debug, Default)]
pub(crate) struct Placement {
    poses: Vec<Isometry3<f64>>,
    controls: Vec<Point3<f64>>,
    boxes: Vec<Aabb>,
}

/// Where a part is: what the distance functions take.
enum Placed<'a> {
    Capsule(Capsule),
    Solid(&'a Solid, Isometry3<f64>),
}

impl<'a> Bodies<'a> {
    /// The bodies of all pairs; enters what is wrong with their shapes. Indices are valid.
    pub(crate) fn new(problem: &'a Problem, ledger: &mut Ledger) -> Self {
        let structure = &problem.structure;
        let mut bodies = Self {
            structure,
            parts: Vec::new(),
            pairs: Vec::new(),
            controls: 0,
        };
        let mut known: Vec<(Body, Vec<usize>)> = Vec::new();
        let mut mend = |name: &str, fault: String| {
            let message = format!("problem: shape of {name}: {fault}");
            ledger.tell(Check::Input, Location::Whole, message);
        };
        for &pair in &problem.environment.pairs {
            let parts = pair.map(|body| {
                if let Some((_, parts)) = known.iter().find(|(known, _)| *known == body) {
                    return parts.clone();
                }
                let parts = bodies.add(problem, body, &mut mend);
                known.push((body, parts.clone()));
                parts
            });
            for &a in &parts[0] {
                for &b in &parts[1] {
                    if bodies.parts[a].count + bodies.parts[b].count > 0 {
                        bodies.pairs.push(PartPair {
                            bodies: pair,
                            parts: [a, b],
                        });
                    }
                }
            }
        }
        bodies
    }

    fn add(
        &mut self,
        problem: &Problem,
        body: Body,
        mend: &mut dyn FnMut(&str, String),
    ) -> Vec<usize> {
        let mut added = Vec::new();
        match body {
            Body::Element(index) => {
                let element = &problem.structure.elements[index];
                if element.appearance.role != Role::Decoration {
                    for (stretch, radius) in stretches(element) {
                        let nodes = element.nodes;
                        let geometry = Geometry::Element {
                            nodes,
                            stretch,
                            radius,
                        };
                        added.push(self.push(geometry, None, 2));
                    }
                }
            }
            Body::Attachment(index) => {
                let attachment = &problem.structure.attachments[index];
                if frame(attachment.anchors.map(|anchor| anchor.local)).is_none() {
                    mend(&attachment.name, "its anchors lie in one line".to_owned());
                    return added;
                }
                for shape in attachment
                    .shapes
                    .iter()
                    .filter(|s| s.role != Role::Decoration)
                {
                    let solid = match convert(&shape.shape) {
                        Ok(Converted::Capsule(capsule)) => {
                            let geometry = Geometry::AttachedCapsule {
                                attachment: index,
                                capsule,
                            };
                            added.push(self.push(geometry, None, 2));
                            continue;
                        }
                        Ok(Converted::Solid(solid, hull)) => (solid, hull),
                        Err(fault) => {
                            mend(&attachment.name, fault);
                            continue;
                        }
                    };
                    let (solid, hull) = solid;
                    let Aabb { min, max } = solid.aabb();
                    if !(min.iter().chain(max.iter()).all(|x| x.is_finite())) {
                        mend(
                            &attachment.name,
                            "it is unbounded and cannot be attached".to_owned(),
                        );
                        continue;
                    }
                    let corners = std::array::from_fn(|corner: usize| {
                        let end = |axis: usize| {
                            if corner >> axis & 1 == 0 {
                                min[axis]
                            } else {
                                max[axis]
                            }
                        };
                        Point3::new(end(0), end(1), end(2))
                    });
                    let geometry = Geometry::AttachedSolid {
                        attachment: index,
                        solid,
                        corners,
                    };
                    added.push(self.push(geometry, hull, 8));
                }
            }
            Body::Obstacle(index) => {
                let obstacle = &problem.environment.obstacles[index];
                if obstacle.role != Role::Decoration {
                    match convert(&obstacle.shape) {
                        Ok(Converted::Capsule(capsule)) => {
                            added.push(self.push(Geometry::FixedCapsule(capsule), None, 0));
                        }
                        Ok(Converted::Solid(solid, hull)) => {
                            added.push(self.push(Geometry::FixedSolid(solid), hull, 0));
                        }
                        Err(fault) => mend(&obstacle.name, fault),
                    }
                }
            }
        }
        added
    }

    fn push(&mut self, geometry: Geometry, hull: Option<Capsule>, count: usize) -> usize {
        self.parts.push(Part {
            geometry,
            hull,
            control: self.controls,
            count,
        });
        self.controls += count;
        self.parts.len() - 1
    }

    /// Places all bodies at the given node positions.
    pub(crate) fn place(&self, positions: &[Point3<f64>], placement: &mut Placement) {
        let Placement {
            poses,
            controls,
            boxes,
        } = placement;
        poses.clear();
        poses.extend(
            self.structure
                .attachments
                .iter()
                .map(|attachment| pose(attachment, positions)),
        );
        controls.clear();
        boxes.clear();
        for part in &self.parts {
            let first = controls.len();
            let bounds = match &part.geometry {
                Geometry::Element {
                    nodes,
                    stretch,
                    radius,
                } => {
                    controls.extend(stretch.ends(&positions[nodes[0]], &positions[nodes[1]]));
                    bounds(&controls[first..], *radius)
                }
                Geometry::AttachedCapsule {
                    attachment,
                    capsule,
                } => {
                    let pose = &poses[*attachment];
                    controls.extend([pose * capsule.a, pose * capsule.b]);
                    bounds(&controls[first..], capsule.radius)
                }
                Geometry::AttachedSolid {
                    attachment,
                    corners,
                    ..
                } => {
                    let pose = &poses[*attachment];
                    controls.extend(corners.iter().map(|corner| pose * corner));
                    bounds(&controls[first..], 0.0)
                }
                Geometry::FixedCapsule(capsule) => capsule.aabb(),
                Geometry::FixedSolid(solid) => solid.aabb(),
            };
            boxes.push(bounds);
        }
    }

    fn placed<'s>(&'s self, part: usize, at: &Placement) -> Placed<'s> {
        match &self.parts[part].geometry {
            Geometry::FixedSolid(solid) => Placed::Solid(solid, Isometry3::identity()),
            Geometry::AttachedSolid {
                attachment, solid, ..
            } => Placed::Solid(solid, at.poses[*attachment]),
            Geometry::FixedCapsule(capsule) => Placed::Capsule(*capsule),
            Geometry::Element { radius, .. } => Placed::Capsule(self.capsule(part, at, *radius)),
            Geometry::AttachedCapsule { capsule, .. } => {
                Placed::Capsule(self.capsule(part, at, capsule.radius))
            }
        }
    }

    /// The capsule between the two control points of a part.
    fn capsule(&self, part: usize, at: &Placement, radius: f64) -> Capsule {
        let control = self.parts[part].control;
        Capsule {
            a: at.controls[control],
            b: at.controls[control + 1],
            radius,
        }
    }

    /// The capsule that a part is, at three instants.
    fn capsules(&self, part: usize, at: [&Placement; 3]) -> Option<[Capsule; 3]> {
        let capsules = at.map(|at| match self.placed(part, at) {
            Placed::Capsule(capsule) => Some(capsule),
            Placed::Solid(..) => None,
        });
        let [Some(start), Some(middle), Some(end)] = capsules else {
            return None;
        };
        Some([start, middle, end])
    }

    /// The capsule around a solid part, at three instants.
    fn hulls(&self, part: usize, at: [&Placement; 3]) -> Option<[Capsule; 3]> {
        let hull = self.parts[part].hull?;
        Some(at.map(|at| match self.placed(part, at) {
            Placed::Capsule(capsule) => capsule,
            Placed::Solid(_, pose) => hull.transformed(&pose),
        }))
    }

    /// A lower bound on the clearance of a pair, from boxes.
    pub(crate) fn bound(&self, pair: &PartPair, at: &Placement) -> f64 {
        at.boxes[pair.parts[0]].distance(&at.boxes[pair.parts[1]])
    }

    /// The clearance of a pair.
    pub(crate) fn clearance(&self, pair: &PartPair, at: &Placement) -> f64 {
        let [a, b] = pair.parts.map(|part| self.placed(part, at));
        let contact = match (&a, &b) {
            (Placed::Capsule(a), Placed::Capsule(b)) => capsule_capsule(a, b),
            (Placed::Capsule(capsule), Placed::Solid(solid, pose))
            | (Placed::Solid(solid, pose), Placed::Capsule(capsule)) => {
                if *pose == Isometry3::identity() {
                    capsule_solid(capsule, solid)
                } else {
                    capsule_solid_posed(capsule, solid, pose)
                }
            }
            (Placed::Solid(a, pose_a), Placed::Solid(b, pose_b)) => {
                solid_solid(a, pose_a, b, pose_b)
            }
        };
        contact.clearance
    }

    /// How far any point of one part moves relative to any point of the other, straight from
    /// `start` to `end`.
    pub(crate) fn relative_motion(
        &self,
        pair: &PartPair,
        start: &Placement,
        end: &Placement,
    ) -> f64 {
        let moves = |part: usize| {
            let Part { control, count, .. } = self.parts[part];
            (control..control + count).map(|index| end.controls[index] - start.controls[index])
        };
        let [a, b] = pair.parts;
        let mut largest: f64 = 0.0;
        match (self.parts[a].count, self.parts[b].count) {
            (0, _) => moves(b).for_each(|motion| largest = largest.max(motion.norm_squared())),
            (_, 0) => moves(a).for_each(|motion| largest = largest.max(motion.norm_squared())),
            _ => {
                for one in moves(a) {
                    for other in moves(b) {
                        largest = largest.max((one - other).norm_squared());
                    }
                }
            }
        }
        largest.sqrt()
    }

    /// How far the two parts of a pair are from half-way at `middle`, added.
    pub(crate) fn deviation(&self, pair: &PartPair, [start, middle, end]: [&Placement; 3]) -> f64 {
        let of = |part: usize| {
            let Part { control, count, .. } = self.parts[part];
            let range = control..control + count;
            deviation(
                &start.controls[range.clone()],
                &middle.controls[range.clone()],
                &end.controls[range],
            )
        };
        of(pair.parts[0]) + of(pair.parts[1])
    }

    /// A lower bound on the clearance of a pair during the motion from `start` to `end`, proven
    /// with separating planes along the straight motion; at least `required`, or `None`.
    ///
    /// `factor` times the deviation of `middle` from half-way is allowed for.
    pub(crate) fn certificate(
        &self,
        pair: &PartPair,
        at: [&Placement; 3],
        factor: f64,
        required: f64,
    ) -> Option<f64> {
        let [a, b] = pair.parts;
        let (outcome, slack) = match (self.capsules(a, at), self.capsules(b, at)) {
            (Some(a), Some(b)) => {
                let slack = factor * (straying(&a) + straying(&b));
                (
                    swept_capsule_capsule(&a[0], &a[2], &b[0], &b[2], required + slack),
                    slack,
                )
            }
            (Some(capsules), None) => self.against_solid(capsules, b, at, factor, required),
            (None, Some(capsules)) => self.against_solid(capsules, a, at, factor, required),
            (None, None) => match (self.hulls(a, at), self.hulls(b, at)) {
                (Some(hulls), _) => self.against_solid(hulls, b, at, factor, required),
                (None, Some(hulls)) => self.against_solid(hulls, a, at, factor, required),
                (None, None) => return None,
            },
        };
        match outcome {
            Certificate::Clear { clearance } => Some(clearance - slack),
            Certificate::Undecided => None,
        }
    }

    /// The straight motion of a capsule in the frame of a solid, and the slack allowed for.
    fn against_solid(
        &self,
        mut capsules: [Capsule; 3],
        part: usize,
        at: [&Placement; 3],
        factor: f64,
        required: f64,
    ) -> (Certificate, f64) {
        let solid = match &self.parts[part].geometry {
            Geometry::FixedSolid(solid) => solid,
            Geometry::AttachedSolid {
                attachment, solid, ..
            } => {
                for (capsule, at) in capsules.iter_mut().zip(at) {
                    *capsule = capsule.transformed(&at.poses[*attachment].inverse());
                }
                solid
            }
            // Every other part is a capsule.
            _ => return (Certificate::Undecided, 0.0),
        };
        let slack = factor * straying(&capsules);
        (
            swept_capsule_solid(&capsules[0], &capsules[2], solid, required + slack),
            slack,
        )
    }
}

const ORIGIN: Capsule = Capsule {
    a: Point3::new(0.0, 0.0, 0.0),
    b: Point3::new(0.0, 0.0, 0.0),
    radius: 0.0,
};

fn deviation(start: &[Point3<f64>], middle: &[Point3<f64>], end: &[Point3<f64>]) -> f64 {
    let each = start.iter().zip(middle).zip(end);
    each.map(|((start, middle), end)| (middle - nalgebra::center(start, end)).norm_squared())
        .fold(0.0, f64::max)
        .sqrt()
}

fn straying([start, middle, end]: &[Capsule; 3]) -> f64 {
    deviation(&[start.a, start.b], &[middle.a, middle.b], &[end.a, end.b])
}

fn bounds(points: &[Point3<f64>], margin: f64) -> Aabb {
    Aabb::of_points(points)
        .unwrap_or(Aabb {
            min: ORIGIN.a,
            max: ORIGIN.a,
        })
        .loosened(margin)
}

fn stretches(element: &Element) -> Vec<(Stretch, f64)> {
    let radius = element.radius;
    match element.kind {
        ElementKind::Strut | ElementKind::Bar => vec![(Stretch::Inset(radius), radius)],
        ElementKind::Cable | ElementKind::Spring => vec![(Stretch::Middle, radius)],
        ElementKind::Prismatic => {
            let least = element.length.lo;
            let travel = element.length.hi - least;
            vec![
                (
                    Stretch::FromFirst(radius, (least - radius).max(radius)),
                    radius,
                ),
                (
                    Stretch::FromSecond(radius, travel.max(radius)),
                    0.5 * radius,
                ),
                (Stretch::FromSecond(radius, radius), radius),
            ]
        }
    }
}

enum Converted {
    Capsule(Capsule),
    Solid(Box<Solid>, Option<Capsule>),
}

fn convert(shape: &Shape) -> Result<Converted, String> {
    let solid = |solid: Result<Solid, _>| {
        solid
            .map(|solid| Converted::Solid(Box::new(solid), None))
            .map_err(|fault: tensegra_collision::ShapeError| fault.to_string())
    };
    match shape {
        Shape::Sphere { center, radius } => Capsule::new(*center, *center, *radius)
            .map(Converted::Capsule)
            .map_err(|fault| fault.to_string()),
        Shape::Box { min, max } => solid(Solid::cuboid(*min, *max)),
        Shape::Cylinder { p, q, radius } => {
            let fault = |fault: tensegra_collision::ShapeError| fault.to_string();
            let hull = Capsule::new(*p, *q, *radius).map_err(fault)?;
            let solid = Solid::cylinder(*p, *q, *radius).map_err(fault)?;
            Ok(Converted::Solid(Box::new(solid), Some(hull)))
        }
        Shape::Prism {
            corners: [p0, p1, p2],
            height,
        } => solid(Solid::triangular_prism(*p0, *p1, *p2, *height)),
        Shape::HalfSpace { point, normal } => solid(Solid::half_space(*point, *normal)),
        Shape::Mesh {
            vertices, faces, ..
        } => Solid::mesh(vertices, faces)
            .map(|solid| Converted::Solid(Box::new(solid), None))
            .map_err(|fault| fault.to_string()),
    }
}

/// Orthonormal axes of a triangle: along its first side, in its plane, normal to it.
fn frame([p, q, r]: [Point3<f64>; 3]) -> Option<Matrix3<f64>> {
    let (side, other): (Vector3<f64>, Vector3<f64>) = (q - p, r - p);
    let normal = side.cross(&other);
    if normal.norm() <= 1e-9 * side.norm() * other.norm() {
        return None;
    }
    let (first, third) = (side.normalize(), normal.normalize());
    Some(Matrix3::from_columns(&[first, third.cross(&first), third]))
}

/// Where the anchors put an attachment: the frames of the two triangles on each other, and their
/// centres. Anchors in one line, which no equilibrium of a valid structure has, leave it unturned.
fn pose(attachment: &Attachment, positions: &[Point3<f64>]) -> Isometry3<f64> {
    let local = attachment.anchors.map(|anchor| anchor.local);
    let world = attachment.anchors.map(|anchor| positions[anchor.node]);
    let rotation = match (frame(local), frame(world)) {
        (Some(local), Some(world)) => {
            let matrix = Rotation3::from_matrix_unchecked(world * local.transpose());
            UnitQuaternion::from_rotation_matrix(&matrix)
        }
        _ => UnitQuaternion::identity(),
    };
    let center =
        |points: [Point3<f64>; 3]| points.iter().map(|p| p.coords).sum::<Vector3<f64>>() / 3.0;
    let translation = center(world) - rotation * center(local);
    Isometry3::from_parts(Translation3::from(translation), rotation)
}
