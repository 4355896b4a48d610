//! Small geometry that the log and the pictures share.

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use tensegra_model::{Anchor, Configuration, Path};

/// The pose that takes the frame of an attachment to the world, given the
/// positions of all nodes; none when its anchors lie in one line, where no such
/// pose is determined.
pub(crate) fn attachment_pose(
    anchors: &[Anchor; 3],
    positions: &[Point3<f64>],
) -> Option<Isometry3<f64>> {
    let local = anchors.map(|anchor| anchor.local);
    let world = anchors.map(|anchor| positions[anchor.node]);
    let rotation = frame(&world)? * frame(&local)?.transpose();
    let rotation =
        UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation));
    // The anchors are points of a rigid body, but hold only to the tolerance of
    // the equations: their centroids share that error evenly.
    let centroid = |points: &[Point3<f64>; 3]| {
        points
            .iter()
            .map(|point| point.coords)
            .sum::<Vector3<f64>>()
            / 3.0
    };
    let translation = centroid(&world) - rotation * centroid(&local);
    Some(Isometry3::from_parts(
        Translation3::from(translation),
        rotation,
    ))
}

/// Orthonormal axes fixed to three points, as columns.
fn frame(points: &[Point3<f64>; 3]) -> Option<Matrix3<f64>> {
    let along = (points[1] - points[0]).try_normalize(f64::MIN_POSITIVE)?;
    let side = points[2] - points[0];
    let normal = along
        .cross(&side)
        .try_normalize(side.norm() * f64::EPSILON.sqrt())?;
    Some(Matrix3::from_columns(&[
        along,
        normal.cross(&along),
        normal,
    ]))
}

/// Two unit vectors that complete `axis` to a right-handed orthogonal frame
/// (first, second, axis).
pub(crate) fn perpendicular(axis: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let axis = axis.try_normalize(0.0).unwrap_or_else(Vector3::z);
    // The coordinate axis along which `axis` is smallest is far from parallel.
    let mut other = Vector3::zeros();
    other[axis.iamin()] = 1.0;
    let first = other.cross(&axis).normalize();
    [first, axis.cross(&first)]
}

/// Where each configuration stands along the path, strictly ascending from 0
/// to 1. A step counts by the largest displacement of a node, but at least a
/// tenth of the mean step, so that a change of force alone takes its time too.
pub(crate) fn parameters_along(path: &Path) -> Vec<f64> {
    let configurations = &path.configurations;
    let mut steps: Vec<f64> = configurations
        .windows(2)
        .map(|step| largest_displacement(&step[0], &step[1]))
        .collect();
    let mean = steps.iter().sum::<f64>() / steps.len() as f64;
    let least = if mean > 0.0 { 0.1 * mean } else { 1.0 };
    steps.iter_mut().for_each(|step| *step = step.max(least));
    let total: f64 = steps.iter().sum();
    let mut parameters = vec![0.0; configurations.len().min(1)];
    let mut reached = 0.0;
    for step in &steps {
        reached += step;
        parameters.push(reached / total);
    }
    parameters
}

fn largest_displacement(from: &Configuration, to: &Configuration) -> f64 {
    from.positions
        .iter()
        .zip(&to.positions)
        .map(|(a, b)| nalgebra::distance(a, b))
        .fold(0.0, f64::max)
}

/// Least and greatest corner of a box around points.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bounds {
    pub(crate) min: Point3<f64>,
    pub(crate) max: Point3<f64>,
}

impl Bounds {
    /// The box around `points`; none around none.
    pub(crate) fn around(points: impl IntoIterator<Item = Point3<f64>>) -> Option<Self> {
        points.into_iter().fold(None, |bounds, point| {
            Some(match bounds {
                None => Self {
                    min: point,
                    max: point,
                },
                Some(Self { min, max }) => Self {
                    min: min.inf(&point),
                    max: max.sup(&point),
                },
            })
        })
    }

    /// Length of the diagonal.
    pub(crate) fn diagonal(&self) -> f64 {
        (self.max - self.min).norm()
    }

    /// The eight corners.
    pub(crate) fn corners(&self) -> [Point3<f64>; 8] {
        std::array::from_fn(|corner| {
            Point3::from(Vector3::from_fn(|axis, _| match corner >> axis & 1 {
                0 => self.min[axis],
                _ => self.max[axis],
            }))
        })
    }
}

/// The side walls and the two ends of a triangle extruded along its normal, as
/// polygons that turn counterclockwise seen from outside.
pub(crate) fn prism_faces(
    corners: &[Point3<f64>; 3],
    height: f64,
) -> Option<Vec<Vec<Point3<f64>>>> {
    let normal = (corners[1] - corners[0])
        .cross(&(corners[2] - corners[0]))
        .try_normalize(0.0)?;
    let top = corners.map(|corner| corner + normal * height);
    let mut faces = vec![corners.iter().rev().copied().collect(), top.to_vec()];
    for side in 0..3 {
        let next = (side + 1) % 3;
        faces.push(vec![corners[side], corners[next], top[next], top[side]]);
    }
    // A negative height turns the solid inside out.
    if height < 0.0 {
        faces.iter_mut().for_each(|face| face.reverse());
    }
    Some(faces)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pose_is_recovered_from_three_anchors() {
        let pose = Isometry3::new(Vector3::new(1.0, -2.0, 0.5), Vector3::new(0.3, 1.1, -0.7));
        let locals = [[0.0, 0.0, 0.0], [2.0, 0.1, 0.0], [0.3, 1.0, -0.4]].map(Point3::from);
        let positions: Vec<_> = locals.iter().map(|local| pose * local).collect();
        let anchors = [0, 1, 2].map(|node| Anchor {
            local: locals[node],
            node,
        });
        let found = attachment_pose(&anchors, &positions).unwrap();
        let difference = (found.to_homogeneous() - pose.to_homogeneous()).norm();
        assert!(difference < 1e-12, "{difference}");
    }

    #[test]
    fn anchors_in_one_line_have_no_pose() {
        let positions = [0.0, 1.0, 2.0].map(|x| Point3::new(x, 0.0, 0.0));
        let anchors = [0, 1, 2].map(|node| Anchor {
            local: positions[node],
            node,
        });
        assert!(attachment_pose(&anchors, &positions).is_none());
    }

    #[test]
    fn perpendicular_vectors_complete_a_frame() {
        for axis in [[1.0, 0.0, 0.0], [0.2, -3.0, 0.1], [0.0, 0.0, -1.0]] {
            let axis = Vector3::from(axis).normalize();
            let [first, second] = perpendicular(&axis);
            assert!((first.cross(&second) - axis).norm() < 1e-12);
        }
    }

    #[test]
    fn parameters_follow_the_largest_displacement() {
        let at = |x: f64| Configuration {
            positions: vec![Point3::origin(), Point3::new(x, 0.0, 0.0)],
            lengths: vec![],
            rest_lengths: vec![],
            forces: vec![],
        };
        let path = |xs: &[f64]| Path {
            configurations: xs.iter().copied().map(at).collect(),
        };
        assert_eq!(parameters_along(&path(&[0.0, 1.0, 4.0])), [0.0, 0.25, 1.0]);
        assert_eq!(parameters_along(&path(&[2.0, 2.0, 2.0])), [0.0, 0.5, 1.0]);
        let halting = parameters_along(&path(&[0.0, 1.0, 1.0, 2.0]));
        assert!(
            halting.windows(2).all(|step| step[0] < step[1]),
            "{halting:?}"
        );
        assert_eq!(parameters_along(&path(&[2.0])), [0.0]);
        assert_eq!(parameters_along(&path(&[])), [0.0; 0]);
    }
}
