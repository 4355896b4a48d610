//! Length and control effort of paths, in the coordinates of Porta and
//! Hernández-Juan (2016): the simplified system of directions, lengths, rest
//! lengths and forces, whatever a planner uses inside.
//!
//! Control has to make up for the drift −∇E that the potential energy causes:
//! c = s − ∇E with the unit direction s of the step (eq. 21) and the gradient of
//! E within the tangent space. The effort is C ≈ Σ cᵀc d over the steps of length
//! d (eq. 24). Along the path −2 s·∇E adds up to twice the energy lost, so that C
//! is the length of the path, less 2 (E_goal − E_start), plus the integral of
//! |∇E|²: what shortens a path reduces its effort.
//!
//! Cost: the length is O(elements) a point, the effort a factorisation of the
//! Jacobian a point.

mod gradient;

use tensegra_atlas::{Chart, ImplicitManifold, ManifoldError, Workspace, dimension};

use crate::{
    configuration::Path,
    equilibrium::{DirectionsManifold, EquilibriumError, EquilibriumManifold},
    structure::Structure,
};

/// Why the effort of a path cannot be told.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EffortError {
    /// The structure has no equilibrium manifold.
    #[error(transparent)]
    Structure(#[from] EquilibriumError),
    /// A configuration has no tangent space.
    #[error("configuration {index} of the path has no tangent space")]
    NoTangentSpace {
        /// Index of the configuration.
        index: usize,
        /// Why.
        source: ManifoldError,
    },
}

/// Length of a path in the coordinates of [`DirectionsManifold`].
///
/// # Errors
/// [`EquilibriumError`] when the structure has no equilibrium manifold.
///
/// # Examples
/// ```
/// use nalgebra::Point3;
/// use tensegra_model::{
///     Configuration, ElementKind, ElementSpec, Path, StructureBuilder, path_length,
/// };
///
/// // A rod that carries nothing, moved by (0.3, 0.4).
/// let rod = ElementSpec::new(ElementKind::Strut, "rod", ["a", "b"], 1.0).force(0.0);
/// let structure = StructureBuilder::planar()
///     .element(rod)
///     .free_flying([2.0, 2.0, 0.0])
///     .build()?;
/// let at = |x: f64, y: f64| Configuration {
///     positions: vec![Point3::new(x, y, 0.0), Point3::new(x + 1.0, y, 0.0)],
///     lengths: vec![1.0],
///     rest_lengths: vec![None],
///     forces: vec![None],
/// };
/// let path = Path {
///     configurations: vec![at(0.0, 0.0), at(0.3, 0.4)],
/// };
/// let length = path_length(&structure, &path)?;
/// # // Node b closes no loop: its position counts like that of the base.
/// assert!((length - 0.5 * 2.0_f64.sqrt()).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn path_length(structure: &Structure, path: &Path) -> Result<f64, EquilibriumError> {
    let manifold = DirectionsManifold::new(structure)?;
    Ok(manifold.path_length(&coordinates(&manifold, path)))
}

/// Control effort C of a path (eq. 24).
///
/// # Errors
/// [`EffortError`] when the structure has no equilibrium manifold, or where a
/// configuration is a singular point of it.
pub fn control_effort(structure: &Structure, path: &Path) -> Result<f64, EffortError> {
    let manifold = DirectionsManifold::new(structure)?;
    manifold.control_effort(&coordinates(&manifold, path))
}

fn coordinates(manifold: &DirectionsManifold, path: &Path) -> Vec<Vec<f64>> {
    path.configurations
        .iter()
        .map(|configuration| manifold.coordinates(configuration))
        .collect()
}

impl DirectionsManifold {
    /// Length of the polyline through the given points (m coordinates each).
    pub fn path_length<P: AsRef<[f64]>>(&self, points: &[P]) -> f64 {
        points
            .windows(2)
            .map(|pair| distance(pair[0].as_ref(), pair[1].as_ref()))
            .sum()
    }

    /// Control effort C (eq. 24) of a path through the given points of the
    /// manifold (m coordinates each). See [`control_effort`] for a path of
    /// physical configurations.
    ///
    /// # Errors
    /// [`EffortError::NoTangentSpace`] at a singular point.
    pub fn control_effort<P: AsRef<[f64]>>(&self, points: &[P]) -> Result<f64, EffortError> {
        let Some(first) = points.first() else {
            return Ok(0.0);
        };
        let k = dimension(self, first.as_ref());
        let mut work = Workspace::default();
        let mut gradient = vec![0.0; self.ambient_dimension()];
        let mut effort = 0.0;
        for (index, pair) in points.windows(2).enumerate() {
            let (x, next) = (pair[0].as_ref(), pair[1].as_ref());
            let step = distance(x, next);
            if step == 0.0 {
                continue;
            }
            let chart = Chart::new(self, x, k, &mut work)
                .map_err(|source| EffortError::NoTangentSpace { index, source })?;
            self.potential_energy_gradient(x, &mut gradient);
            // |s − Φ Φᵀ ∇E|² of the unit vector s.
            let mut square = 1.0;
            for tangent in (0..k).map(|j| chart.tangent(j)) {
                let drift = dot(tangent, &gradient);
                let along = (dot(tangent, next) - dot(tangent, x)) / step;
                square += drift * (drift - 2.0 * along);
            }
            effort += square * step;
        }
        Ok(effort)
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(x, y)| (x - y) * (x - y))
        .sum::<f64>()
        .sqrt()
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;
    use crate::{Configuration, StructureBuilder};

    /// Two struts, the diagonals of a square of four cables.
    fn square() -> (Structure, Configuration) {
        let structure = [
            ("c1", ["n1", "n3"]),
            ("c2", ["n2", "n3"]),
            ("c3", ["n1", "n4"]),
            ("c4", ["n2", "n4"]),
        ]
        .into_iter()
        .fold(
            StructureBuilder::planar()
                .strut("s1", ["n1", "n2"], 1.0)
                .strut("s2", ["n3", "n4"], 1.0),
            |builder, (name, nodes)| builder.cable(name, nodes, 0.0..=3.0, 1.0, 0.0..=2.0),
        )
        .free_flying([3.0, 3.0, 0.0])
        .build()
        .unwrap();
        let side = 0.5_f64.sqrt();
        let tension = 0.125_f64.sqrt();
        let at = |x: f64, y: f64| Point3::new(x * side, y * side, 0.0);
        let configuration = Configuration {
            positions: vec![at(0.0, 0.0), at(1.0, 1.0), at(1.0, 0.0), at(0.0, 1.0)],
            lengths: vec![1.0, 1.0, side, side, side, side],
            rest_lengths: vec![None; 6],
            forces: [-0.5, -0.5, tension, tension, tension, tension]
                .map(Some)
                .to_vec(),
        };
        (structure, configuration)
    }

    /// Points of the manifold in a straight line of tangent coordinates.
    fn curve(manifold: &DirectionsManifold, start: &[f64], step: f64) -> Vec<Vec<f64>> {
        let mut work = Workspace::default();
        let chart = Chart::new(manifold, start, 6, &mut work).unwrap();
        (0..=(0.2 / step) as usize)
            .map(|i| {
                let t: Vec<f64> = (1..=6)
                    .map(|j| 0.5 * step * i as f64 * f64::from(j).sin())
                    .collect();
                let mut x = vec![0.0; start.len()];
                chart.exp(manifold, &t, &mut x, 1e-12, &mut work).unwrap();
                x
            })
            .collect()
    }

    /// A point away from the symmetry of the square.
    fn askew(manifold: &DirectionsManifold, square: &Configuration) -> Vec<f64> {
        let points = curve(manifold, &manifold.coordinates(square), 0.2);
        points[1].clone()
    }

    #[test]
    fn what_one_way_costs_more_is_the_energy_gained() {
        let (structure, configuration) = square();
        let manifold = DirectionsManifold::new(&structure).unwrap();
        let start = askew(&manifold, &configuration);
        let mut points = curve(&manifold, &start, 1e-3);
        let energy = |x: &Vec<f64>| manifold.potential_energy(x);
        let gain = energy(points.last().unwrap()) - energy(&points[0]);
        assert!(gain.abs() > 1e-4, "{gain}");
        let there = manifold.control_effort(&points).unwrap();
        points.reverse();
        let back = manifold.control_effort(&points).unwrap();
        assert!((there - back + 4.0 * gain).abs() < 1e-2 * gain.abs());
        let length = manifold.path_length(&points);
        assert!(there + back > 2.0 * length);
    }

    /// The same square of elastic elements alone: telescopic struts whose rest
    /// lengths motors change, and springs.
    fn elastic_square() -> (Structure, Configuration) {
        let (_, mut configuration) = square();
        let (side, tension) = (0.5_f64.sqrt(), 0.125_f64.sqrt());
        let builder = StructureBuilder::planar()
            .prismatic("s1", ["n1", "n2"], 0.8..=1.5, 2.0, 0.0..=3.0)
            .prismatic("s2", ["n3", "n4"], 0.8..=1.5, 2.0, 0.0..=3.0);
        let structure = [
            ("c1", ["n1", "n3"]),
            ("c2", ["n2", "n3"]),
            ("c3", ["n1", "n4"]),
            ("c4", ["n2", "n4"]),
        ]
        .into_iter()
        .fold(builder, |builder, (name, nodes)| {
            builder.spring(name, nodes, 0.0..=3.0, 1.0, side - tension)
        })
        .free_flying([3.0, 3.0, 0.0])
        .pretension(None)
        .build()
        .unwrap();
        configuration.rest_lengths = vec![None; 6];
        (structure, configuration)
    }

    /// The gradient of C against differences of C between points of the manifold
    /// on both sides of each point of a path.
    fn assert_gradient_agrees(structure: &Structure, configuration: &Configuration) {
        let manifold = DirectionsManifold::new(structure).unwrap();
        let mut start = manifold.coordinates(configuration);
        tensegra_atlas::project(&manifold, &mut start, 1e-13, 30).unwrap();
        let k = dimension(&manifold, &start);
        let mut work = Workspace::default();
        let chart = Chart::new(&manifold, &start, k, &mut work).unwrap();
        let points: Vec<Vec<f64>> = (0..6)
            .map(|i| {
                let t: Vec<f64> = (1..=k)
                    .map(|j| 0.03 * (f64::from(i) + 0.4) * ((i + 1) as f64 * j as f64).sin())
                    .collect();
                let mut x = vec![0.0; start.len()];
                chart.exp(&manifold, &t, &mut x, 1e-14, &mut work).unwrap();
                x
            })
            .collect();
        let gradient = manifold.control_effort_gradient(&points).unwrap();
        let mut largest = 0.0_f64;
        for i in 0..points.len() {
            let here = Chart::new(&manifold, &points[i], k, &mut work).unwrap();
            for j in 0..k {
                let mut effort = |h: f64| {
                    let mut t = vec![0.0; k];
                    t[j] = h;
                    let mut moved = points.clone();
                    here.exp(&manifold, &t, &mut moved[i], 1e-14, &mut work)
                        .unwrap();
                    manifold.control_effort(&moved).unwrap()
                };
                let h = 1e-5;
                let difference = (effort(h) - effort(-h)) / (2.0 * h);
                let found = dot(here.tangent(j), &gradient[i]);
                assert!(
                    (difference - found).abs() < 1e-6 * (1.0 + difference.abs()),
                    "point {i}, direction {j}: {difference} {found}"
                );
                largest = largest.max(found.abs());
            }
        }
        // Of the length alone the gradient would be another.
        assert!(largest > 0.1);
    }

    #[test]
    fn the_gradient_agrees_with_differences_where_struts_are_rigid() {
        let (structure, configuration) = square();
        assert_gradient_agrees(&structure, &configuration);
    }

    #[test]
    fn the_gradient_agrees_with_differences_where_all_elements_are_elastic() {
        let (structure, configuration) = elastic_square();
        assert_gradient_agrees(&structure, &configuration);
    }

    #[test]
    fn a_translation_is_as_long_as_it_is_and_drifts_sideways() {
        let (structure, configuration) = square();
        let manifold = DirectionsManifold::new(&structure).unwrap();
        let x = askew(&manifold, &configuration);
        let start = manifold.configuration(&x);
        let mut moved = start.clone();
        for p in &mut moved.positions {
            p.x += 0.3;
            p.y -= 0.4;
        }
        let path = Path {
            configurations: vec![start.clone(), moved, start],
        };
        let length = path_length(&structure, &path).unwrap();
        assert!((length - 1.0).abs() < 1e-12);
        let effort = control_effort(&structure, &path).unwrap();
        // The tangential gradient is the same everywhere, and stands on the path.
        let mut gradient = vec![0.0; x.len()];
        manifold.potential_energy_gradient(&x, &mut gradient);
        let chart = Chart::new(&manifold, &x, 6, &mut Workspace::default()).unwrap();
        let square: f64 = (0..6)
            .map(|j| dot(chart.tangent(j), &gradient).powi(2))
            .sum();
        assert!(square > 1e-6, "{square}");
        assert!((effort - length * (1.0 + square)).abs() < 1e-10);
    }

    #[test]
    fn a_path_of_at_most_one_configuration_costs_nothing() {
        let (structure, configuration) = square();
        let mut path = Path::default();
        assert_eq!(control_effort(&structure, &path).unwrap(), 0.0);
        path.configurations.push(configuration);
        assert_eq!(control_effort(&structure, &path).unwrap(), 0.0);
        assert_eq!(path_length(&structure, &path).unwrap(), 0.0);
    }
}
