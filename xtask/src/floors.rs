//! `cargo xtask floors`: who may depend on whom.

use serde::Deserialize;

use crate::{Error, cargo};

/// The floor of every crate, by package name. A crate depends only on crates of
/// lower floors. Crates that are planned have their place already.
const FLOORS: [(&str, u8); 14] = [
    ("tensegra-atlas", 0),
    ("tensegra-collision", 0),
    ("tensegra-optim", 0),
    ("tensegra-model", 1),
    ("tensegra-lar", 1),
    ("tensegra-formfinding", 2),
    ("tensegra-dynamics", 2),
    ("tensegra-sampling", 2),
    ("tensegra-convex", 2),
    ("tensegra-io", 3),
    ("tensegra-check", 3),
    ("tensegra", 4),
    ("tensegra-cli", 5),
    ("xtask", 5),
];

/// Crates that may use even less than their floor allows, and why.
const RESTRICTED: [(&str, &[&str], &str); 1] = [(
    "tensegra-check",
    &["tensegra-model", "tensegra-collision"],
    "the judge shares no code with the planners that it judges",
)];

/// Checks that crates depend only on crates of lower floors.
///
/// The table of floors is in docs/architecture.md. Beyond it, `tensegra-check`
/// uses only `tensegra-model` and `tensegra-collision`. What is declared is read
/// from `cargo metadata`; dev-dependencies are exempt. A crate without a floor
/// is an error: give it one in xtask/src/floors.rs and in the table.
#[derive(clap::Args)]
pub struct FloorsArguments {}

/// What is needed of the output of `cargo metadata --no-deps`.
#[derive(Deserialize)]
struct Metadata {
    packages: Vec<Package>,
}

#[derive(Deserialize)]
struct Package {
    name: String,
    dependencies: Vec<Dependency>,
}

#[derive(Deserialize)]
struct Dependency {
    name: String,
    /// None for an ordinary dependency, else "dev" or "build".
    kind: Option<String>,
}

pub fn run(_: &FloorsArguments) -> Result<(), Error> {
    let packages = check_workspace()?;
    println!("{packages} crates, each depends only on crates of lower floors");
    Ok(())
}

/// Checks the workspace; returns the number of its crates.
fn check_workspace() -> Result<usize, Error> {
    let output = cargo()
        .args(["metadata", "--no-deps", "--format-version", "1"])
        .output()?;
    if !output.status.success() {
        return Err(String::from_utf8_lossy(&output.stderr).into());
    }
    let metadata: Metadata = serde_json::from_slice(&output.stdout)?;
    let violations = violations(&metadata);
    if violations.is_empty() {
        Ok(metadata.packages.len())
    } else {
        Err(violations.join("\n").into())
    }
}

fn floor(package: &str) -> Option<u8> {
    let place = FLOORS.iter().find(|(name, _)| *name == package);
    place.map(|(_, floor)| *floor)
}

fn violations(metadata: &Metadata) -> Vec<String> {
    let mut found = Vec::new();
    let is_ours = |name: &str| {
        floor(name).is_some() || metadata.packages.iter().any(|package| package.name == name)
    };
    for Package { name, dependencies } in &metadata.packages {
        let Some(own) = floor(name) else {
            found.push(format!(
                "{name} has no floor: give it one in xtask/src/floors.rs and docs/architecture.md"
            ));
            continue;
        };
        let counted = dependencies
            .iter()
            .filter(|dependency| dependency.kind.as_deref() != Some("dev"))
            .map(|dependency| dependency.name.as_str())
            .filter(|dependency| is_ours(dependency));
        for dependency in counted {
            // One without a floor is told where it is declared.
            if let Some(other) = floor(dependency)
                && other >= own
            {
                found.push(format!(
                    "{name} (floor {own}) depends on {dependency} (floor {other}): a crate \
                     depends only on crates of lower floors"
                ));
            }
            for (restricted, allowed, reason) in RESTRICTED {
                if restricted == name && !allowed.contains(&dependency) {
                    let allowed = allowed.join(" and ");
                    found.push(format!(
                        "{name} depends on {dependency}, but may only use {allowed}: {reason}"
                    ));
                }
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn violations_of(metadata: &str) -> Vec<String> {
        violations(&serde_json::from_str(metadata).unwrap())
    }

    #[test]
    fn the_workspace_keeps_to_its_floors() {
        check_workspace().unwrap();
    }

    #[test]
    fn lower_floors_dev_dependencies_and_others_crates_are_allowed() {
        let found = violations_of(
            r#"{"packages": [
                {"name": "tensegra-atlas", "dependencies": [
                    {"name": "nalgebra", "kind": null},
                    {"name": "tensegra-sampling", "kind": "dev"}]},
                {"name": "tensegra-check", "dependencies": [
                    {"name": "tensegra-model", "kind": null},
                    {"name": "tensegra-io", "kind": "dev"}]}]}"#,
        );
        assert!(found.is_empty(), "{found:?}");
    }

    #[test]
    fn violations_are_named() {
        let found = violations_of(
            r#"{"packages": [
                {"name": "tensegra-atlas", "dependencies": [
                    {"name": "tensegra-model", "kind": null}]},
                {"name": "tensegra-model", "dependencies": [
                    {"name": "tensegra-lar", "kind": "build"}]},
                {"name": "tensegra-check", "dependencies": [
                    {"name": "tensegra-sampling", "kind": null}]},
                {"name": "tensegra-novelty", "dependencies": []}]}"#,
        );
        assert_eq!(found.len(), 4, "{found:?}");
        assert!(found[0].contains("tensegra-atlas (floor 0)"), "{found:?}");
        assert!(found[1].contains("tensegra-lar (floor 1)"), "{found:?}");
        assert!(found[2].contains("may only use"), "{found:?}");
        assert!(
            found[3].contains("tensegra-novelty has no floor"),
            "{found:?}"
        );
    }
}
