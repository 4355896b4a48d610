//! The page of a suite, and docs/benchmarks.md made of such pages.

use std::{fs, process::Command};

use tensegra::io::bench_table;

use super::Results;
use crate::root;

const HEAD: &str = "# Benchmarks\n\nEvery figure on this page is measured: `cargo xtask bench \
                    --update-docs` writes it.\n";

/// A suite's page, as Markdown.
pub fn section(suite: &str, results: &Results) -> String {
    let mut text = format!("## Suite `{suite}`\n\n{}\n", results.introduction);
    text += &format!("{}\n\n", provenance());
    text += &bench_table(&results.rows).to_string();
    if results.picture.is_some() {
        text += &format!("\n![Charts of the suite]({suite}.svg)\n");
    }
    text += "\n### Runs that failed\n\n";
    if results.failures.is_empty() {
        text += "None.\n";
    }
    for failure in &results.failures {
        text += &format!("- {failure}\n");
    }
    text
}

/// What was measured, on what.
fn provenance() -> String {
    let version = env!("CARGO_PKG_VERSION");
    let git = |arguments: &[&str]| {
        let output = Command::new("git")
            .args(arguments)
            .current_dir(root())
            .output()
            .ok()
            .filter(|output| output.status.success())?;
        Some(String::from_utf8_lossy(&output.stdout).trim().to_owned())
    };
    // Pages that suites wrote before this one change nothing that is measured.
    let changes = git(&["status", "--porcelain", "--", ".", ":(exclude)docs"]);
    let changed = changes.is_some_and(|changes| !changes.is_empty());
    let commit = git(&["rev-parse", "--short=12", "HEAD"]).map_or_else(String::new, |commit| {
        format!(" at {commit}{}", if changed { " with changes" } else { "" })
    });
    let processor = fs::read_to_string("/proc/cpuinfo")
        .ok()
        .and_then(|text| {
            let line = text.lines().find(|line| line.starts_with("model name"))?;
            Some(line.split_once(':')?.1.trim().to_owned())
        })
        .unwrap_or_else(|| std::env::consts::ARCH.to_owned());
    let profile = if cfg!(debug_assertions) {
        "development build"
    } else {
        "release build"
    };
    format!("Version {version}{commit}, {profile}, one thread of: {processor}.")
}

/// The page `old` with the section of one suite put in or renewed.
pub fn with_section(old: &str, suite: &str, section: &str) -> String {
    let begin = format!("<!-- suite {suite} -->\n");
    let end = format!("<!-- end of suite {suite} -->\n");
    let section = format!("{begin}{section}{end}");
    let place = old.find(&begin).and_then(|from| {
        let length = old[from..].find(&end)? + end.len();
        Some(from..from + length)
    });
    match place {
        Some(place) => format!("{}{section}{}", &old[..place.start], &old[place.end..]),
        None if old.is_empty() => format!("{HEAD}\n{section}"),
        None => format!("{old}\n{section}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sections_are_added_and_renewed() {
        let page = with_section("", "a", "first\n");
        assert!(page.starts_with("# Benchmarks"));
        let page = with_section(&page, "b", "other\n");
        let page = with_section(&page, "a", "second\n");
        assert!(!page.contains("first"));
        let [second, other] = ["second", "other"].map(|text| page.find(text).unwrap());
        assert!(second < other);
        assert_eq!(page.matches("<!-- suite").count(), 2);
        assert_eq!(with_section(&page, "b", "other\n"), page);
    }
}
