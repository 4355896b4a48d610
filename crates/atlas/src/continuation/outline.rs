//! The outlines of domains, for pictures and measures of curves and surfaces.
//!
//! Cost: a projection for each corner of a cell; at a border, a bisection for each
//! of the directions that sample it.

use crate::{
    chart::Workspace,
    continuation::{
        border::{Border, broken_limit},
        component::ComponentAtlas,
    },
    manifold::ImplicitManifold,
    qr::dot,
    validity::Validity,
};

/// Directions that sample the outline of a domain at a border.
const DIRECTIONS: usize = 40;
/// Halvings of the way to a border.
const HALVINGS: usize = 12;
const TOLERANCE: f64 = 1e-9;

/// A point of the outline of a domain.
#[derive(Clone, Debug, PartialEq)]
pub struct OutlinePoint {
    /// The point of the manifold.
    pub point: Vec<f64>,
    /// What ends the component there; none where a neighbour follows.
    pub border: Option<Border>,
}

impl ComponentAtlas {
    /// The outline of a chart's domain within the component: for surfaces
    /// (k = 2) a polygon with its corners in order, for curves (k = 1) the two
    /// ends, and nothing for other dimensions.
    ///
    /// Neighbours agree on common corners. At a border, points are as far from the
    /// centre as the straight way in tangent coordinates is valid.
    pub fn outline<M: ImplicitManifold + ?Sized, V: Validity>(
        &self,
        manifold: &M,
        validity: &V,
        index: usize,
        work: &mut Workspace,
    ) -> Vec<OutlinePoint> {
        let corners = self.corners(manifold, index, work);
        let ends = |x: &[f64]| {
            broken_limit(manifold, x).or_else(|| (!validity.is_valid(x)).then_some(Border::Blocked))
        };
        // Corners that are no one else's and valid stand as they are.
        let mut rays: Vec<(Vec<f64>, Option<Vec<f64>>)> = Vec::new();
        let mut inner = !self.is_at_border(index);
        for corner in corners {
            let valid = ends(&corner.point).is_none();
            inner &= valid;
            rays.push((corner.tangent, valid.then_some(corner.point)));
        }
        match self.dimension() {
            1 => rays.extend([-1.0, 1.0].map(|t| (vec![t], None))),
            2 if !inner => {
                let vertices = self.cell(index).vertices();
                rays.extend(vertices.iter().map(|v| (v.point.clone(), None)));
                rays.extend((0..DIRECTIONS).map(|i| {
                    let angle = std::f64::consts::TAU * i as f64 / DIRECTIONS as f64;
                    (vec![angle.cos(), angle.sin()], None)
                }));
            }
            2 => {}
            _ => return Vec::new(),
        }
        let angle = |t: &[f64]| t.get(1).map_or(t[0], |y| y.atan2(t[0]));
        // Of directions that coincide, the corner comes first.
        rays.sort_by(|a, b| {
            let angles = angle(&a.0).total_cmp(&angle(&b.0));
            angles.then_with(|| a.1.is_none().cmp(&b.1.is_none()))
        });
        if self.dimension() == 1 {
            rays.dedup_by(|b, a| a.0[0] * b.0[0] > 0.0);
        } else {
            rays.dedup_by(|b, a| (angle(&a.0) - angle(&b.0)).abs() < 0.03);
        }
        rays.into_iter()
            .filter_map(|(direction, corner)| match corner {
                Some(point) => Some(OutlinePoint {
                    point,
                    border: None,
                }),
                None => self.end_of_ray(manifold, &ends, index, &direction, work),
            })
            .collect()
    }

    /// The last valid point of a domain in a direction from its centre.
    fn end_of_ray<M: ImplicitManifold + ?Sized>(
        &self,
        manifold: &M,
        ends: &dyn Fn(&[f64]) -> Option<Border>,
        index: usize,
        direction: &[f64],
        work: &mut Workspace,
    ) -> Option<OutlinePoint> {
        let length = dot(direction, direction).sqrt();
        let unit: Vec<f64> = direction.iter().map(|d| d / length).collect();
        let radius = self.radius(index);
        let reach = self.cell(index).reach(&unit);
        let chart = self.chart(index);
        let mut x = vec![0.0; chart.center().len()];
        let mut look = |s: f64, x: &mut [f64]| {
            let t: Vec<f64> = unit.iter().map(|u| s * u).collect();
            match chart.exp(manifold, &t, x, TOLERANCE, work) {
                Ok(()) => ends(x),
                Err(_) => Some(Border::Curvature),
            }
        };
        let whole = reach.min(radius);
        let Some(mut border) = look(whole, &mut x) else {
            return Some(OutlinePoint {
                point: x,
                // Where nothing was found to go on at the radius.
                border: (reach > radius * (1.0 + 1e-6)).then_some(Border::Blocked),
            });
        };
        let (mut inside, mut outside) = (0.0, whole);
        let mut point = chart.center().to_vec();
        for _ in 0..HALVINGS {
            let middle = 0.5 * (inside + outside);
            match look(middle, &mut x) {
                None => {
                    inside = middle;
                    point.copy_from_slice(&x);
                }
                Some(found) => {
                    outside = middle;
                    border = found;
                }
            }
        }
        Some(OutlinePoint {
            point,
            border: Some(border),
        })
    }
}
