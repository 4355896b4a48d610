//! Shortcuts and smoothing on the sphere: great circles, an obstacle, bounds.

use tensegra_atlas::{Contacts, Everywhere, Obstruction, SparseRow, Validity, doc::Sphere};
use tensegra_sampling::{
    AtlasRrt, PlannerOptions, ShortcutOptions, Shortcutter, SmoothError, Smoother, SmootherOptions,
};

fn at(longitude: f64, latitude: f64) -> Vec<f64> {
    let (sin, cos) = latitude.sin_cos();
    vec![cos * longitude.cos(), cos * longitude.sin(), sin]
}

/// A ball of the given radius about a point of the sphere is forbidden.
struct Ball {
    center: Vec<f64>,
    radius: f64,
}

impl Ball {
    fn value(&self, x: &[f64]) -> f64 {
        distance(x, &self.center) - self.radius
    }
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(a, b)| (a - b) * (a - b))
        .sum::<f64>()
        .sqrt()
}

impl Validity for Ball {
    type Memory = Vec<f64>;

    fn memory(&self) -> Vec<f64> {
        Vec::new()
    }

    fn enter(&self, x: &[f64], memory: &mut Vec<f64>) {
        memory.clear();
        memory.extend_from_slice(x);
    }

    fn step(
        &self,
        from: &Vec<f64>,
        x: &[f64],
        to: &mut Vec<f64>,
        between: &mut dyn FnMut(f64, &mut [f64]) -> bool,
        violated: &mut Vec<usize>,
    ) -> Result<(), Obstruction> {
        self.enter(x, to);
        if self.value(x) < 0.0 {
            violated.push(0);
            return Err(Obstruction::Contacts);
        }
        // The step is short against the ball: a few points between will do.
        let mut y = from.clone();
        let clear = (1..8).all(|i| between(f64::from(i) / 8.0, &mut y) && self.value(&y) >= 0.0);
        if clear {
            Ok(())
        } else {
            Err(Obstruction::Blocked)
        }
    }

    fn contacts(&self, x: &[f64], _: &mut Vec<f64>, reach: f64, found: &mut Contacts) {
        let value = self.value(x);
        if value < reach {
            let mut row = SparseRow::default();
            let distance = distance(x, &self.center);
            for (i, (x, c)) in x.iter().zip(&self.center).enumerate() {
                row.add(i, (x - c) / distance);
            }
            found.push(0, value, &row);
        }
    }

    fn is_valid(&self, x: &[f64]) -> bool {
        self.value(x) >= 0.0
    }
}

/// The shortest way on the sphere between two points at angle γ from the centre
/// of a forbidden cap of angle ρ, seen from there under the angle ω: tangents to
/// the cap and an arc along it.
fn around_cap(gamma: f64, rho: f64, omega: f64) -> f64 {
    // In the right spherical triangle of centre, end and point of tangency.
    let tangent = (gamma.cos() / rho.cos()).acos();
    let turn = (rho.tan() / gamma.tan()).acos();
    2.0 * tangent + rho.sin() * (omega - 2.0 * turn)
}

fn planned(ball: &Ball, seed: u64) -> Vec<Vec<f64>> {
    let mut options = PlannerOptions::default();
    options.seed = seed;
    AtlasRrt::new(&Sphere::new(), ball, options)
        .plan(&at(-0.8, 0.0), &at(0.8, 0.0), &mut ())
        .unwrap()
        .points
}

#[test]
fn paths_around_an_obstacle_become_tangents_and_an_arc() {
    let (gamma, rho) = (0.8_f64, 0.5_f64);
    let ball = Ball {
        center: at(0.0, 0.0),
        radius: 2.0 * (0.5 * rho).sin(),
    };
    let expected = around_cap(gamma, rho, std::f64::consts::PI);
    let sphere = Sphere::new();
    for seed in 1..=5 {
        let path = planned(&ball, seed);
        let mut options = ShortcutOptions::default();
        options.seed = seed;
        let shortened = Shortcutter::new(&sphere, &ball, options)
            .shorten(&path)
            .unwrap();
        let smoothed = Smoother::new(&sphere, &ball, SmootherOptions::default())
            .smooth(&shortened.points, &mut ())
            .unwrap();
        assert!(smoothed.converged, "{smoothed:?}");
        assert!(smoothed.length <= shortened.length);
        assert!(
            (smoothed.length - expected).abs() < 5e-3,
            "{} {expected}",
            smoothed.length
        );
        for pair in smoothed.points.windows(2) {
            assert!(distance(&pair[0], &pair[1]) <= 0.05);
        }
        assert!(smoothed.points.iter().all(|x| ball.is_valid(x)));
        assert_eq!(smoothed.points.first(), path.first());
        assert_eq!(smoothed.points.last(), path.last());
    }
}

#[test]
fn the_same_path_is_smoothed_to_the_same_bits() {
    let ball = Ball {
        center: at(0.0, 0.0),
        radius: 0.3,
    };
    let path = planned(&ball, 3);
    let smooth = || {
        Smoother::new(&Sphere::new(), &ball, SmootherOptions::default())
            .smooth(&path, &mut ())
            .unwrap()
            .points
    };
    assert_eq!(smooth(), smooth());
}

#[test]
fn the_step_follows_the_displacement() {
    let path: Vec<Vec<f64>> = (0..20).map(|i| at(0.05 * f64::from(i), 0.0)).collect();
    let smoothed = Smoother::new(&Sphere::new(), &Everywhere, SmootherOptions::default())
        .max_displacement(0.02)
        .smooth(&path, &mut ())
        .unwrap();
    for pair in smoothed.points.windows(2) {
        assert!(distance(&pair[0], &pair[1]) <= 0.02);
    }
    assert!((smoothed.length - 0.95).abs() < 1e-3);
}

#[test]
fn what_cannot_be_smoothed_is_refused() {
    let sphere = Sphere::new();
    let smoother = Smoother::new(&sphere, &Everywhere, SmootherOptions::default());
    assert_eq!(
        smoother.smooth(&[at(0.0, 0.0)], &mut ()).unwrap_err(),
        SmoothError::TooShort { points: 1 }
    );
    // Hidden from the optimiser, the obstacle can only be found in the way.
    let hidden = tensegra_atlas::Predicate::new(3, 3, |x: &[f64]| x[0] < 0.99);
    let around: Vec<Vec<f64>> = (0..60)
        .map(|i| {
            let angle = std::f64::consts::PI * (1.0 - f64::from(i) / 59.0);
            let (sin, cos) = angle.sin_cos();
            at(0.5 * cos, 0.5 * sin)
        })
        .collect();
    let blocked = Smoother::new(&sphere, &hidden, SmootherOptions::default())
        .smooth(&around, &mut ())
        .unwrap_err();
    assert!(
        matches!(blocked, SmoothError::Blocked { .. }),
        "{blocked:?}"
    );
    let cancelled = smoother.smooth(&around, &mut Cancel).unwrap_err();
    assert_eq!(cancelled, SmoothError::Cancelled);
}

#[test]
fn a_draft_tells_the_length_and_is_refined_like_the_path() {
    let ball = Ball {
        center: at(0.0, 0.0),
        radius: 0.4,
    };
    let sphere = Sphere::new();
    let path = planned(&ball, 2);
    let smoother = Smoother::new(&sphere, &ball, SmootherOptions::default());
    let draft = smoother.draft(&path, &mut ()).unwrap();
    let (length, iterations) = (draft.length(), draft.iterations());
    let depth = smoother.depth(&draft);
    assert!(depth < 0.01, "{depth}");
    let refined = smoother.refine(draft, &mut ()).unwrap();
    assert!(iterations > 0 && iterations < refined.iterations);
    assert!((length - refined.length).abs() < 0.02 * refined.length);
    let at_once = smoother.smooth(&path, &mut ()).unwrap();
    assert_eq!(at_once.points, refined.points);
}

struct Cancel;

impl tensegra_sampling::SmoothObserver for Cancel {
    fn progress(&mut self, _: &tensegra_sampling::SmoothProgress) -> bool {
        false
    }
}
