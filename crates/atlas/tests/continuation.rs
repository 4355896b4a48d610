//! Atlases of whole components against closed forms: coverage, area, Euler
//! characteristic, borders, sheets, and graph search.

use std::collections::BTreeSet;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use tensegra_atlas::{
    BilliardWalk, Border, ChartDomain, ComponentAtlas, Continuation, ContinuationError,
    ContinuationOptions, Everywhere, Exploration, ImplicitManifold, Predicate, RouteError,
    RouteOptions, SparseRow, SparsityPattern, Validity, Workspace,
    doc::{Sphere, Torus, Twice},
};

fn options(radius: f64) -> ContinuationOptions {
    let mut options = ContinuationOptions::default();
    options.domain = ChartDomain {
        radius,
        ..ChartDomain::default()
    };
    options
}

fn explore(
    manifold: &impl ImplicitManifold,
    validity: &impl Validity,
    radius: f64,
    start: &[f64],
) -> Exploration {
    Continuation::new(manifold, validity, options(radius))
        .explore(start, &mut |_| true)
        .unwrap()
}

/// The points of a walk over the component that no chart covers.
fn uncovered(
    manifold: &impl ImplicitManifold,
    validity: &impl Validity,
    atlas: &ComponentAtlas,
    points: usize,
) -> Vec<Vec<f64>> {
    let mut random = Pcg64::seed_from_u64(7);
    let start = atlas.chart(0).center().to_vec();
    let mut walk = BilliardWalk::new(manifold, validity, &start, 0.05, move || random.random());
    let mut work = Workspace::default();
    let mut missed = Vec::new();
    for _ in 0..points {
        let x = walk.advance().unwrap();
        if atlas.covering(manifold, x, &mut work).is_none() {
            missed.push(x.to_vec());
        }
    }
    missed
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    let square = |(a, b): (&f64, &f64)| (a - b).powi(2);
    a.iter().zip(b).map(square).sum::<f64>().sqrt()
}

fn triangle(a: &[f64], b: &[f64], c: &[f64]) -> f64 {
    let (x, y, z) = (distance(a, b), distance(b, c), distance(c, a));
    let s = 0.5 * (x + y + z);
    (s * (s - x) * (s - y) * (s - z)).max(0.0).sqrt()
}

/// Area of a closed surface by the triangles between centres and corners of the
/// cells, and its Euler characteristic: as every corner is a triangle of charts,
/// χ = charts − corners / 2.
fn area_and_euler_characteristic(
    manifold: &impl ImplicitManifold,
    atlas: &ComponentAtlas,
) -> (f64, f64) {
    let mut work = Workspace::default();
    let mut area = 0.0;
    let mut corners_of_all = BTreeSet::new();
    for i in 0..atlas.len() {
        let mut corners = atlas.corners(manifold, i, &mut work);
        corners.sort_by(|a, b| {
            let angle = |t: &[f64]| t[1].atan2(t[0]);
            angle(&a.tangent).total_cmp(&angle(&b.tangent))
        });
        for (j, corner) in corners.iter().enumerate() {
            let next = &corners[(j + 1) % corners.len()];
            area += triangle(atlas.chart(i).center(), &corner.point, &next.point);
            corners_of_all.insert(corner.charts.clone());
        }
    }
    let euler = atlas.len() as f64 - 0.5 * corners_of_all.len() as f64;
    (area, euler)
}

#[test]
fn the_sphere_is_covered_whole() {
    let sphere = Sphere::new();
    for radius in [0.4, 0.25, 0.15] {
        let found = explore(&sphere, &Everywhere, radius, &[0.0, 0.6, 0.8]);
        assert!(found.complete && found.borders.is_empty());
        assert!((0..found.atlas.len()).all(|i| !found.atlas.is_at_border(i)));
        assert!(uncovered(&sphere, &Everywhere, &found.atlas, 1000).is_empty());
        let (area, euler) = area_and_euler_characteristic(&sphere, &found.atlas);
        assert_eq!(euler, 2.0, "radius {radius}");
        // Flat triangles of size ρ lose a part of the order of ρ².
        let exact = 4.0 * std::f64::consts::PI;
        let missing = (exact - area) / exact;
        assert!(
            (0.0..0.25 * radius * radius).contains(&missing),
            "{missing}"
        );
    }
}

#[test]
fn the_torus_is_covered_whole() {
    let torus = Torus::new(1.0, 0.4);
    let found = explore(&torus, &Everywhere, 0.2, &torus.point(1.0, 2.0));
    assert!(found.complete && found.borders.is_empty());
    assert!(uncovered(&torus, &Everywhere, &found.atlas, 1500).is_empty());
    let (area, euler) = area_and_euler_characteristic(&torus, &found.atlas);
    assert_eq!(euler, 0.0);
    let exact = 4.0 * std::f64::consts::PI.powi(2) * 0.4;
    assert!((area / exact - 1.0).abs() < 0.02, "{area} {exact}");
}

#[test]
fn equations_stated_twice_give_the_same_atlas() {
    let once = Torus::new(1.0, 0.4);
    let twice = Twice::new(once.clone());
    // Without symmetry: else four cells may meet in one corner.
    let start = once.point(1.0, 2.0);
    let a = explore(&once, &Everywhere, 0.2, &start).atlas;
    let b = explore(&twice, &Everywhere, 0.2, &start).atlas;
    // Bases, and with them polytopes and centres, may differ: the surface may not.
    assert!(uncovered(&twice, &Everywhere, &b, 500).is_empty());
    let (area, euler) = area_and_euler_characteristic(&twice, &b);
    assert_eq!(euler, 0.0);
    assert!((area / area_and_euler_characteristic(&once, &a).0 - 1.0).abs() < 0.01);
}

#[test]
fn radii_shrink_until_charts_are_as_accurate_as_asked() {
    let (sphere, torus) = (Sphere::new(), Torus::new(1.0, 0.4));
    for (radius, error) in [(5.0, 0.05), (0.5, 0.01)] {
        let mut options = options(radius);
        options.domain.error = error;
        let on_sphere = Continuation::new(&sphere, &Everywhere, options)
            .explore(&[0.0, 0.0, 1.0], &mut |_| true)
            .unwrap();
        let on_torus = Continuation::new(&torus, &Everywhere, options)
            .explore(&torus.point(0.0, 0.0), &mut |_| true)
            .unwrap();
        assert!(on_sphere.complete && on_sphere.borders.is_empty());
        assert!(on_torus.complete && on_torus.borders.is_empty());
        assert!(uncovered(&sphere, &Everywhere, &on_sphere.atlas, 2000).is_empty());
        assert!(uncovered(&torus, &Everywhere, &on_torus.atlas, 2000).is_empty());
    }
}

/// The part of the unit sphere above lower bounds of the variables and where
/// normal · x + offset ≥ 0.
struct CutSphere {
    sphere: Sphere,
    lower: [f64; 3],
    normal: [f64; 3],
    offset: f64,
}

impl CutSphere {
    /// Between two heights: a bound of a variable and a limit.
    fn belt() -> Self {
        Self {
            sphere: Sphere::new(),
            lower: [-2.0, -2.0, -0.3],
            normal: [0.0, 0.0, -1.0],
            offset: 0.6,
        }
    }

    /// Between two meridians, `angle` apart.
    fn lune(angle: f64) -> Self {
        let (sin, cos) = angle.sin_cos();
        Self {
            sphere: Sphere::new(),
            lower: [-2.0, 0.0, -2.0],
            normal: [sin, -cos, 0.0],
            offset: 0.0,
        }
    }
}

impl ImplicitManifold for CutSphere {
    fn ambient_dimension(&self) -> usize {
        3
    }

    fn equation_count(&self) -> usize {
        1
    }

    fn residual(&self, x: &[f64], residual: &mut [f64]) {
        self.sphere.residual(x, residual);
    }

    fn jacobian_pattern(&self) -> &SparsityPattern {
        self.sphere.jacobian_pattern()
    }

    fn jacobian(&self, x: &[f64], values: &mut [f64]) {
        self.sphere.jacobian(x, values);
    }

    fn lower_bounds(&self) -> &[f64] {
        &self.lower
    }

    fn upper_bounds(&self) -> &[f64] {
        &[2.0; 3]
    }

    fn limit_count(&self) -> usize {
        1
    }

    fn limits(&self, x: &[f64], values: &mut [f64]) {
        let along = self.normal.iter().zip(x).map(|(n, x)| n * x);
        values[0] = self.offset + along.sum::<f64>();
    }

    fn limit_gradient(&self, _: usize, _: &[f64], row: &mut SparseRow) {
        for (axis, &n) in self.normal.iter().enumerate() {
            row.add(axis, n);
        }
    }
}

#[test]
fn bounds_and_limits_are_borders_and_are_covered_up_to() {
    let belt = CutSphere::belt();
    let found = explore(&belt, &Everywhere, 0.3, &[1.0, 0.0, 0.0]);
    assert!(found.complete);
    let kinds: Vec<Border> = found.borders.keys().copied().collect();
    assert_eq!(kinds, [Border::Lower(2), Border::Limit(0)]);
    let heights = (0..found.atlas.len()).map(|i| found.atlas.chart(i).center()[2]);
    assert!(heights.clone().all(|z| (-0.3..=0.6).contains(&z)));
    assert!(uncovered(&belt, &Everywhere, &found.atlas, 2000).is_empty());
    // The rims themselves are covered as well.
    let mut work = Workspace::default();
    for z in [-0.3_f64, 0.6] {
        let out = (1.0 - z * z).sqrt();
        for i in 0..200 {
            let angle = std::f64::consts::TAU * f64::from(i) / 200.0;
            let x = [out * angle.cos(), out * angle.sin(), z];
            let chart = found.atlas.covering(&belt, &x, &mut work);
            assert!(chart.is_some(), "{x:?}");
        }
    }
}

#[test]
fn components_are_followed_into_narrow_tips() {
    for angle in [1.0, 0.3, 0.1, 0.03, 0.01] {
        let lune = CutSphere::lune(angle);
        let point = |share: f64, latitude: f64| {
            let (height, out) = latitude.sin_cos();
            let (y, x) = (share * angle).sin_cos();
            [out * x, out * y, height]
        };
        for (i, radius) in [0.15, 0.2, 0.27, 0.31, 0.4, 1.0].into_iter().enumerate() {
            let start = point(0.7, 0.1 * i as f64);
            let found = explore(&lune, &Everywhere, radius, &start);
            assert!(found.complete);
            let mut work = Workspace::default();
            for (i, share) in [0.0, 0.01, 0.3, 0.5, 0.8, 1.0].into_iter().enumerate() {
                for j in -100..=100 {
                    let latitude = 0.015 * f64::from(j) + 1e-3 * i as f64;
                    let x = point(share, latitude);
                    let chart = found.atlas.covering(&lune, &x, &mut work);
                    assert!(chart.is_some(), "{angle} {radius}: {x:?}");
                }
            }
        }
    }
}

#[test]
fn obstacles_are_borders_and_other_components_are_not_entered() {
    let sphere = Sphere::new();
    // A thin wall about the equator.
    let wall = Predicate::new(3, 6, |x: &[f64]| x[2].abs() > 0.05);
    let found = explore(&sphere, &wall, 0.4, &[0.0, 0.0, 1.0]);
    assert!(found.complete);
    assert!((0..found.atlas.len()).all(|i| found.atlas.chart(i).center()[2] > 0.05));
    assert_eq!(found.borders.keys().collect::<Vec<_>>(), [&Border::Blocked]);
    assert!(uncovered(&sphere, &wall, &found.atlas, 2000).is_empty());
}

/// Two parallel planes, h apart: x₂ (x₂ − h) = 0, within a square.
struct Sheets(SparsityPattern, f64);

impl ImplicitManifold for Sheets {
    fn ambient_dimension(&self) -> usize {
        3
    }

    fn equation_count(&self) -> usize {
        1
    }

    fn residual(&self, x: &[f64], residual: &mut [f64]) {
        residual[0] = x[2] * (x[2] - self.1) / self.1;
    }

    fn jacobian_pattern(&self) -> &SparsityPattern {
        &self.0
    }

    fn jacobian(&self, x: &[f64], values: &mut [f64]) {
        values.copy_from_slice(&[0.0, 0.0, (2.0 * x[2] - self.1) / self.1]);
    }

    fn lower_bounds(&self) -> &[f64] {
        &[-1.0; 3]
    }

    fn upper_bounds(&self) -> &[f64] {
        &[1.0; 3]
    }
}

#[test]
fn sheets_that_pass_near_each_other_are_told_apart() {
    let sheets = Sheets(SparsityPattern::dense(1, 3), 0.03);
    let lower = explore(&sheets, &Everywhere, 0.3, &[0.0, 0.0, 0.0]);
    assert!(lower.complete);
    assert!((0..lower.atlas.len()).all(|i| lower.atlas.chart(i).center()[2].abs() < 1e-9));
    let mut work = Workspace::default();
    let above = [0.1, 0.1, 0.03];
    assert_eq!(lower.atlas.covering(&sheets, &above, &mut work), None);
    // An atlas with centres on both keeps them apart.
    let centers = [[0.0, 0.0, 0.0], [0.1, 0.0, 0.03], [0.2, 0.0, 0.0]];
    let charts = centers.map(|c| (c.to_vec(), 0.3, None));
    let both = ComponentAtlas::rebuild(&sheets, 2, ChartDomain::default(), charts.clone()).unwrap();
    assert_eq!(both.neighbours(0).collect::<Vec<_>>(), [2]);
    assert_eq!(both.neighbours(1).count(), 0);
    let off = [(vec![0.0, 0.0, 0.5], 0.3, None)];
    let (index, _) = ComponentAtlas::rebuild(&sheets, 2, ChartDomain::default(), off).unwrap_err();
    assert_eq!(index, 0);
}

/// The unit sphere of any dimension.
struct Ball(SparsityPattern);

impl Ball {
    fn new(m: usize) -> Self {
        Self(SparsityPattern::dense(1, m))
    }
}

impl ImplicitManifold for Ball {
    fn ambient_dimension(&self) -> usize {
        self.0.columns()
    }

    fn equation_count(&self) -> usize {
        1
    }

    fn residual(&self, x: &[f64], residual: &mut [f64]) {
        residual[0] = 0.5 * (x.iter().map(|x| x * x).sum::<f64>() - 1.0);
    }

    fn jacobian_pattern(&self) -> &SparsityPattern {
        &self.0
    }

    fn jacobian(&self, x: &[f64], values: &mut [f64]) {
        values.copy_from_slice(x);
    }

    fn lower_bounds(&self) -> &[f64] {
        &[f64::NEG_INFINITY; 4][..self.0.columns()]
    }

    fn upper_bounds(&self) -> &[f64] {
        &[f64::INFINITY; 4][..self.0.columns()]
    }
}

#[test]
fn a_circle_and_a_sphere_in_four_dimensions_are_covered() {
    let circle = Ball::new(2);
    let found = explore(&circle, &Everywhere, 0.3, &[1.0, 0.0]);
    assert!(found.complete && found.borders.is_empty());
    // Each chart has two neighbours: a ring.
    let bounding = |i| found.atlas.cell(i).neighbours().count();
    assert!((0..found.atlas.len()).all(|i| bounding(i) == 2));
    assert!(uncovered(&circle, &Everywhere, &found.atlas, 300).is_empty());

    let sphere = Ball::new(4);
    let found = explore(&sphere, &Everywhere, 0.4, &[0.0, 0.0, 0.0, 1.0]);
    assert!(found.complete && found.borders.is_empty());
    assert!(uncovered(&sphere, &Everywhere, &found.atlas, 1000).is_empty());
}

#[test]
fn routes_lead_around_walls_and_nowhere_else() {
    let sphere = Sphere::new();
    // A wall about the equator with a gap at positive x.
    let wall = Predicate::new(3, 6, |x: &[f64]| x[2].abs() > 0.05 || x[0] > 0.9);
    let (start, goal) = ([-0.6, 0.0, 0.8], [-0.6, 0.0, -0.8]);
    let found = explore(&sphere, &wall, 0.3, &start);
    let route = found
        .atlas
        .route(&sphere, &wall, [&start, &goal], &RouteOptions::default())
        .unwrap();
    let mut before = start.to_vec();
    assert_eq!(route.points[0], start);
    assert_eq!(route.points.last().unwrap()[..], goal);
    for x in &route.points {
        assert!(distance(x, &before) < 0.1);
        assert!((x.iter().map(|x| x * x).sum::<f64>() - 1.0).abs() < 1e-11);
        assert!(wall.is_valid(x));
        before.clone_from(x);
    }
    assert!(route.points.iter().any(|x| x[0] > 0.9));
    // The same atlas under a wall without a gap.
    let closed = Predicate::new(3, 6, |x: &[f64]| x[2].abs() > 0.05);
    let blocked = found
        .atlas
        .route(&sphere, &closed, [&start, &goal], &RouteOptions::default());
    assert!(matches!(blocked, Err(RouteError::Blocked { .. })));
    let half = explore(&sphere, &closed, 0.3, &start);
    let outside = half
        .atlas
        .route(&sphere, &closed, [&start, &goal], &RouteOptions::default());
    assert!(matches!(
        outside,
        Err(RouteError::NotCovered { which: "goal", .. })
    ));
}

#[test]
fn an_atlas_is_built_again_from_its_centres() {
    let torus = Torus::new(1.0, 0.4);
    let found = explore(&torus, &Everywhere, 0.2, &torus.point(0.0, 0.0)).atlas;
    let charts = (0..found.len()).map(|i| {
        let center = found.chart(i).center().to_vec();
        (center, found.radius(i), found.parent(i))
    });
    let again = ComponentAtlas::rebuild(&torus, 2, found.domain(), charts).unwrap();
    assert_eq!(again.len(), found.len());
    assert!((0..found.len()).all(|i| !again.is_at_border(i)));
    assert!(uncovered(&torus, &Everywhere, &again, 500).is_empty());
}

#[test]
fn what_cannot_be_explored_is_refused() {
    let belt = CutSphere::belt();
    let start = |x: &[f64]| {
        Continuation::new(&belt, &Everywhere, options(0.3))
            .explore(x, &mut |_| true)
            .map(|_| ())
    };
    assert!(matches!(
        start(&[0.6, 0.0, 0.8]),
        Err(ContinuationError::Invalid(_))
    ));
    assert!(matches!(
        start(&[2.0, 0.0, 0.0]),
        Err(ContinuationError::Manifold(_))
    ));
    assert!(matches!(
        start(&[1.0, 0.0]),
        Err(ContinuationError::Manifold(_))
    ));
    // A continuation that is told to stop returns what it has.
    let sphere = Sphere::new();
    let stopped = Continuation::new(&sphere, &Everywhere, options(0.2))
        .explore(&[0.0, 0.0, 1.0], &mut |charts| charts < 10)
        .unwrap();
    assert!(!stopped.complete && stopped.atlas.len() == 10);
}
