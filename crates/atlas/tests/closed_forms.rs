//! Charts, maps and dimensions against closed forms on the sphere and the torus,
//! and the same with every equation stated twice.

use tensegra_atlas::{
    Atlas, Chart, ChartDomain, ImplicitManifold, ManifoldError, SparsityPattern, Workspace,
    dimension,
    doc::{Sphere, Torus, Twice},
    project,
};

const RING: f64 = 1.0;
const TUBE: f64 = 0.4;

/// The height of the torus over its outermost point (R + r, 0, 0), where the
/// tangent plane is that of y and z: x of the point with these y and z.
fn over_outermost(y: f64, z: f64) -> f64 {
    let out = RING + (TUBE * TUBE - z * z).sqrt();
    (out * out - y * y).sqrt()
}

fn check_exponential_map_of_torus(torus: &impl ImplicitManifold) {
    let mut work = Workspace::default();
    let center = [RING + TUBE, 0.0, 0.0];
    assert_eq!(dimension(torus, &center), 2);
    let chart = Chart::new(torus, &center, 2, &mut work).unwrap();
    let mut x = [0.0; 3];
    for [y, z] in [[0.1, 0.05], [-0.2, 0.2], [0.3, -0.25], [0.0, 0.3]] {
        // Tangent coordinates of the wanted foot, in the basis that the chart chose.
        let t = [0, 1].map(|j| chart.tangent(j)[1] * y + chart.tangent(j)[2] * z);
        chart.exp(torus, &t, &mut x, 1e-13, &mut work).unwrap();
        let expected = [over_outermost(y, z), y, z];
        for (a, b) in x.iter().zip(expected) {
            assert!((a - b).abs() < 1e-11, "{x:?} {expected:?}");
        }
        let mut back = [0.0; 2];
        chart.log(&x, &mut back);
        assert!(back.iter().zip(t).all(|(a, b)| (a - b).abs() < 1e-12));
    }
}

#[test]
fn the_exponential_map_of_the_torus_is_the_closed_form() {
    check_exponential_map_of_torus(&Torus::new(RING, TUBE));
}

#[test]
fn equations_stated_twice_change_nothing() {
    let torus = Twice::new(Torus::new(RING, TUBE));
    check_exponential_map_of_torus(&torus);
    let twice_twice = Twice::new(torus);
    assert_eq!(twice_twice.equation_count(), 4);
    check_exponential_map_of_torus(&twice_twice);
    let mut x = [1.5, 0.2, 0.3];
    project(&twice_twice, &mut x, 1e-12, 30).unwrap();
    let out = x[0].hypot(x[1]) - RING;
    assert!((out.hypot(x[2]) - TUBE).abs() < 1e-11);
}

#[test]
fn projections_onto_the_torus_stay_near() {
    let torus = Torus::new(RING, TUBE);
    for (around, across) in [(0.3, 0.1), (2.0, 2.5), (4.0, -1.0)] {
        let on = torus.point(around, across);
        // Pushed off along the normal: the tube's radius grows by a quarter.
        let center = [RING * f64::cos(around), RING * f64::sin(around), 0.0];
        let mut x = [0, 1, 2].map(|i| center[i] + 1.25 * (on[i] - center[i]));
        project(&torus, &mut x, 1e-13, 30).unwrap();
        for (a, b) in x.iter().zip(on) {
            assert!((a - b).abs() < 1e-9, "{x:?} {on:?}");
        }
    }
}

#[test]
fn cuts_of_neighbours_leave_no_crack_on_the_sphere() {
    let sphere = Sphere::new();
    let mut work = Workspace::default();
    let mut atlas = Atlas::new(2, ChartDomain::default());
    let angle = 0.35_f64;
    let (a, b) = ([0.0, 0.0, 1.0], [angle.sin(), 0.0, angle.cos()]);
    atlas.add(&sphere, &a, &mut work).unwrap();
    atlas.add(&sphere, &b, &mut work).unwrap();
    assert_eq!(atlas.cuts(0).len(), 1);
    // Along the great circle between the two, and a strip beside it, every point
    // belongs to one of the charts.
    let mut t = [0.0; 2];
    for along in 0..=40 {
        for aside in -5..=5 {
            let (u, v) = (angle * f64::from(along) / 40.0, 0.05 * f64::from(aside));
            let x = [u.sin() * v.cos(), v.sin(), u.cos() * v.cos()];
            let inside = (0..2).any(|chart| {
                atlas.chart(chart).log(&x, &mut t);
                atlas.inside_cuts(chart, &t)
            });
            assert!(inside, "crack at {u} {v}");
        }
    }
}

/// Two planes that cross: x y = 0, singular along the z axis.
struct CrossedPlanes(SparsityPattern);

impl ImplicitManifold for CrossedPlanes {
    fn ambient_dimension(&self) -> usize {
        3
    }

    fn equation_count(&self) -> usize {
        1
    }

    fn residual(&self, x: &[f64], residual: &mut [f64]) {
        residual[0] = x[0] * x[1];
    }

    fn jacobian_pattern(&self) -> &SparsityPattern {
        &self.0
    }

    fn jacobian(&self, x: &[f64], values: &mut [f64]) {
        values.copy_from_slice(&[x[1], x[0], 0.0]);
    }

    fn lower_bounds(&self) -> &[f64] {
        &[-1.0; 3]
    }

    fn upper_bounds(&self) -> &[f64] {
        &[1.0; 3]
    }
}

#[test]
fn a_singular_point_is_no_centre() {
    let planes = CrossedPlanes(SparsityPattern::dense(1, 3));
    let mut work = Workspace::default();
    assert!(Chart::new(&planes, &[0.3, 0.0, 0.2], 2, &mut work).is_ok());
    let error = Chart::new(&planes, &[0.0, 0.0, 0.2], 2, &mut work).unwrap_err();
    assert!(matches!(
        error,
        ManifoldError::Singular {
            rank: 0,
            expected: 1,
            ..
        }
    ));
}
