//! Tracing and stability, judged by `tensegra-check` and by closed forms.

use std::path::Path;

use tensegra::{
    Motion, TraceError, TraceSetup, TraceStep, TraceStop, Tracer,
    check::{CheckOptions, check_path},
    model::{Actuation, ElementQuantity, Formulation, Problem, Stability},
    trace,
};

fn problem(name: &str) -> Problem {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures");
    let mut problem = Problem::read(&folder.join(format!("{name}.toml"))).unwrap();
    problem.goal = None;
    problem
}

fn element(problem: &Problem, name: &str) -> usize {
    problem.structure.element_index(name).unwrap()
}

fn rest(problem: &Problem, name: &str, to: f64) -> Motion {
    let quantity = ElementQuantity::Rest(element(problem, name));
    Motion { quantity, to }
}

/// Traces and requires that the judge accepts what comes of it.
fn traced(problem: &Problem, motions: &[Motion]) -> tensegra::Trace {
    let traced = trace(problem, motions, &mut ()).unwrap();
    let report = check_path(problem, &traced.path, &CheckOptions::default());
    assert!(report.ok, "{report}");
    traced
}

#[test]
fn a_rest_length_reaches_its_value_in_both_formulations() {
    for formulation in [Formulation::Nodes, Formulation::Directions] {
        let mut kite = problem("kite");
        kite.settings.formulation = formulation;
        let motions = [rest(&kite, "c1", 0.3), rest(&kite, "c2", 0.5)];
        let traced = traced(&kite, &motions);
        assert_eq!(traced.stop, None, "{formulation:?}");
        assert!((traced.reached[0] - 0.3).abs() < 1e-8);
        assert_eq!(traced.dimension, 3);
        assert!(traced.worst_held.is_some());
    }
}

#[test]
fn several_quantities_move_in_proportion() {
    let kite = problem("kite");
    let motions = [rest(&kite, "c1", 0.3), rest(&kite, "c2", 0.5)];
    let traced = traced(&kite, &motions);
    assert_eq!(traced.stop, None);
    let first = &traced.path.configurations[0];
    let from = motions.map(|motion| motion.quantity.value(first).unwrap());
    for configuration in &traced.path.configurations {
        let share = |i: usize| {
            let value = motions[i].quantity.value(configuration).unwrap();
            (value - from[i]) / (motions[i].to - from[i])
        };
        assert!((share(0) - share(1)).abs() < 1e-6);
    }
}

#[test]
fn the_way_back_leads_to_the_start() {
    let kite = problem("kite");
    let setup = TraceSetup::new(&kite).unwrap();
    setup
        .with_tracer(|tracer| {
            let start = tracer.configuration();
            let quantities = ["c1", "c3"].map(|name| ElementQuantity::Rest(element(&kite, name)));
            let value = |tracer: &Tracer<'_>, i: usize| {
                let configuration = tracer.configuration();
                quantities[i].value(&configuration).unwrap()
            };
            let go = |tracer: &mut Tracer<'_>, i: usize, to: f64| {
                let motion = Motion {
                    quantity: quantities[i],
                    to,
                };
                for _ in 0..1000 {
                    match tracer.step(&[motion]).unwrap() {
                        TraceStep::Moved => {}
                        TraceStep::Arrived => return,
                        TraceStep::Stopped(stop) => panic!("{stop}"),
                    }
                }
                panic!("a thousand steps");
            };
            let c1 = value(tracer, 0);
            go(tracer, 0, c1 + 0.05);
            // It has given way meanwhile.
            let c3 = value(tracer, 1);
            go(tracer, 1, c3 - 0.05);
            go(tracer, 1, c3);
            go(tracer, 0, c1);
            let end = tracer.configuration();
            for (p, q) in start.positions.iter().zip(&end.positions) {
                assert!((p - q).norm() < 1e-9);
            }
            for (f, g) in start.forces.iter().zip(&end.forces) {
                assert!((f.unwrap_or(0.0) - g.unwrap_or(0.0)).abs() < 1e-9);
            }
        })
        .unwrap();
}

#[test]
fn a_limit_is_named() {
    let kite = problem("kite");
    let c1 = element(&kite, "c1");
    let motion = Motion {
        quantity: ElementQuantity::Force(c1),
        to: -1.0,
    };
    let mut free = kite.clone();
    free.environment.pairs.clear();
    let traced = traced(&free, &[motion]);
    let Some(TraceStop::Range {
        element,
        quantity,
        bound,
        upper,
    }) = &traced.stop
    else {
        panic!("{:?}", traced.stop);
    };
    // The cable gets slack, or the rest length of another one ends before.
    assert!(!upper && *bound == 0.0);
    let e = free.structure.element_index(element).unwrap();
    let last = traced.path.configurations.last().unwrap();
    let value = match *quantity {
        "force" => last.forces[e].unwrap(),
        "rest length" => last.rest_lengths[e].unwrap(),
        _ => last.lengths[e],
    };
    assert!(value.abs() < 1e-3, "{value}");
}

#[test]
fn a_collision_is_named() {
    let kite = problem("kite");
    let stopped = traced(&kite, &[rest(&kite, "c1", 0.4)]);
    let bodies = |a: &str, b: &str| TraceStop::Collision {
        a: a.to_owned(),
        b: b.to_owned(),
    };
    assert_eq!(stopped.stop, Some(bodies("s2", "sp1")));
    // Whatever is moved far enough runs into one of the five balls.
    let mut collisions = 0;
    for name in ["c1", "c2", "c3", "c4"] {
        for to in [0.0, 2.0] {
            let traced = traced(&kite, &[rest(&kite, name, to)]);
            if let Some(TraceStop::Collision { a, b }) = &traced.stop {
                assert!(a.starts_with('s') && b.starts_with("sp"), "{a} {b}");
                collisions += 1;
            }
        }
    }
    assert!(collisions > 0);
}

#[test]
fn the_arch_snaps_through_where_theory_says() {
    let mut arch = problem("arch");
    let least = 0.05_f64.cbrt();
    let traced_down = traced(&arch, &[rest(&arch, "s1", 1.0)]);
    assert_eq!(traced_down.stop, Some(TraceStop::Fold));
    let apex = arch.structure.node_index("c").unwrap();
    let y = traced_down.path.configurations.last().unwrap().positions[apex].y;
    assert!((y - least).abs() < 1e-3, "{y}");
    let (_, stiffness) = traced_down.least_stiffness.unwrap();
    assert!(stiffness.abs() < 0.1, "{stiffness}");

    // By their lengths the bars can be led over the fold, to unstable equilibria.
    let motion = Motion {
        quantity: ElementQuantity::Length(element(&arch, "s1")),
        to: (1.0 + 0.04_f64).sqrt(),
    };
    let over = traced(&arch, &[motion]);
    assert_eq!(over.stop, None);
    let last = over.path.configurations.last().unwrap();
    assert!((last.positions[apex].y - 0.2).abs() < 1e-6);
    let (index, stiffness) = over.least_stiffness.unwrap();
    assert_eq!(index, over.path.configurations.len() - 1);
    // (2 / l²) (k y² − P / (2 y)).
    let expected = 2.0 / 1.04 * (10.0 * 0.04 - 1.0 / 0.4);
    assert!((stiffness - expected).abs() < 1e-6, "{stiffness}");

    // Unless stability is demanded: then the fold is the end.
    arch.settings.least_stiffness = Some(0.0);
    let stable = traced(&arch, &[motion]);
    assert!(matches!(stable.stop, Some(TraceStop::Unstable { .. })));
    let y = stable.path.configurations.last().unwrap().positions[apex].y;
    assert!((y - least).abs() < 1e-3, "{y}");
    assert!(stable.least_stiffness.unwrap().1 > 0.0);
}

#[test]
fn a_plan_keeps_to_stable_equilibria() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures");
    let mut arch = Problem::read(&folder.join("arch.toml")).unwrap();
    arch.settings.least_stiffness = Some(0.5);
    let plan = tensegra::plan(&arch, &mut ()).unwrap();
    let (_, stiffness) = plan.least_stiffness.unwrap();
    // At the goal, y = 0.5.
    let expected = 2.0 / 1.25 * (10.0 * 0.25 - 1.0);
    assert!((stiffness - expected).abs() < 1e-6, "{stiffness}");
    arch.settings.least_stiffness = Some(2.5);
    let refused = tensegra::plan(&arch, &mut ()).unwrap_err().to_string();
    assert!(refused.contains("goal is not stable enough"), "{refused}");
    // Motors that hold forces hold nothing up: no stiffness along the bars.
    arch.settings.least_stiffness = Some(0.0);
    arch.settings.actuation = Actuation::Force;
    assert!(tensegra::plan(&arch, &mut ()).is_err());
}

/// The judge refuses what is less stable than demanded.
#[test]
fn demanded_stability_is_judged() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures");
    let mut kite = Problem::read(&folder.join("kite.toml")).unwrap();
    let plan = tensegra::plan(&kite, &mut ()).unwrap();
    let (_, least) = plan.least_stiffness.unwrap();
    let mut accepted = |margin| {
        kite.settings.least_stiffness = Some(margin);
        check_path(&kite, &plan.path, &CheckOptions::default()).ok
    };
    assert!(accepted(least * (1.0 - 1e-6)));
    assert!(!accepted(least * (1.0 + 1e-6)));
}

/// The planner's stiffness is that of the judge, which is computed another way.
#[test]
fn planner_and_judge_agree_about_stiffness() {
    for name in ["kite", "free_flying", "tower", "prism", "robot", "tower3D"] {
        let problem = problem(name);
        let setup = TraceSetup::new(&problem).unwrap();
        let start = setup.with_tracer(|tracer| tracer.configuration()).unwrap();
        let stability = Stability::new(&problem.structure, Actuation::Length);
        let least = stability.least_stiffness(&start);
        let path = tensegra::model::Path {
            configurations: vec![start.clone()],
        };
        let report = check_path(&problem, &path, &CheckOptions::default());
        let judged = report.figure(tensegra::check::Check::Stability);
        let (Some(least), Some(judged)) = (least, judged) else {
            panic!("{name}: {least:?}");
        };
        let scale = judged.value.abs().max(1e-3);
        assert!(
            (least - judged.value).abs() < 1e-6 * scale,
            "{name}: {least}"
        );
        assert!(
            stability.exceeds(&start, least - 1e-6) && !stability.exceeds(&start, least + 1e-6)
        );
    }
}

#[test]
fn motions_that_cannot_be_are_refused() {
    let kite = problem("kite");
    let strut = element(&kite, "s1");
    let cable = element(&kite, "c1");
    let refuse = |motions: &[Motion]| trace(&kite, motions, &mut ()).unwrap_err();
    let motion = |quantity, to| Motion { quantity, to };
    assert_eq!(refuse(&[]), TraceError::NoMotion);
    assert!(matches!(
        refuse(&[motion(ElementQuantity::Rest(strut), 1.0)]),
        TraceError::NoQuantity { .. }
    ));
    assert!(matches!(
        refuse(&[motion(ElementQuantity::Length(strut), 1.0)]),
        TraceError::Constant { .. }
    ));
    let rest = ElementQuantity::Rest(cable);
    assert!(matches!(
        refuse(&[motion(rest, 0.3), motion(rest, 0.4)]),
        TraceError::Twice { .. }
    ));
    assert!(matches!(
        refuse(&[motion(rest, f64::NAN)]),
        TraceError::NotFinite { .. }
    ));
    assert!(
        refuse(&[motion(ElementQuantity::Force(99), 1.0)])
            .to_string()
            .contains("no element")
    );
}
