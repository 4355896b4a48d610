//! What is said of the benchmark structures.

use tensegra::{
    Description, Rigidity,
    check::{Check, CheckOptions, check_configuration},
    complete, describe,
    model::Problem,
};

fn read(name: &str) -> Problem {
    let file = format!("{}/../../fixtures/{name}.toml", env!("CARGO_MANIFEST_DIR"));
    Problem::read(file.as_ref()).unwrap()
}

fn described(name: &str) -> (Problem, Description) {
    let problem = read(name);
    let description = describe(&problem, None).unwrap();
    (problem, description)
}

#[test]
fn states_of_self_stress_and_mechanisms_are_counted() {
    // Elements with a force, freedoms, rigid motions: s − m = e − n + rigid.
    for (name, stress, mechanisms) in [
        ("kite", 1, 0),
        ("free_flying", 1, 0),
        ("prism", 1, 1),
        ("formfinding/six_bar", 1, 1),
    ] {
        let (_, description) = described(name);
        let statics = &description.rigidity;
        let found = (statics.self_stress.len(), statics.mechanisms.len());
        assert_eq!(found, (stress, mechanisms), "{name}");
        assert!(
            statics.rank_gap[0] > 1e-6 && statics.rank_gap[1] < 1e-10,
            "{name}"
        );
    }
}

#[test]
fn the_least_stiffness_is_the_one_that_the_judge_finds() {
    for name in ["prism", "tower", "tower3D", "robot", "formfinding/six_bar"] {
        let problem = read(name);
        let start = complete(&problem.structure, problem.start.as_ref().unwrap());
        let rigidity = Rigidity::new(&problem.structure, &start, None).unwrap();
        let report = check_configuration(&problem, &start, &CheckOptions::default());
        let judged = report.figure(Check::Stability).unwrap().value;
        let found = rigidity.length_controlled.least().unwrap();
        assert!(
            (found - judged).abs() < 1e-6 * judged.abs() + 1e-12,
            "{name}: {found} {judged}"
        );
    }
}

#[test]
fn the_six_bar_is_described_in_words_and_figures() {
    let (problem, description) = described("formfinding/six_bar");
    let statics = &description.rigidity;
    let least = statics.length_controlled.least().unwrap();
    assert!((least - 4.9958).abs() < 1e-3);
    assert!(
        statics.super_stability.is_super_stable(),
        "{:?}",
        statics.super_stability
    );
    // Five times as much and more prestress: rest lengths would be negative.
    assert!(statics.buckling_factor.is_none_or(|factor| factor > 5.0));
    let fates = [
        statics.critical_elements(),
        statics.folding_elements(),
        statics.dispensable_elements(),
    ];
    assert_eq!(fates.concat().len(), 30);
    // Twelve nodes of mass 0.7: a rod of mass 1, four cables of mass 0.1.
    let frequencies = statics.frequencies.as_ref().unwrap();
    let slowest = (least / 0.7).sqrt() / std::f64::consts::TAU;
    assert!((frequencies[0] - slowest).abs() < 1e-9);
    assert_eq!(frequencies.len(), 30);
    let words = statics.in_words(&problem.structure).join("\n");
    for part in [
        "1 infinitesimal mechanism",
        "prestress-stable",
        "Super-stable",
        "without any one of",
    ] {
        assert!(words.contains(part), "{part}: {words}");
    }
}
