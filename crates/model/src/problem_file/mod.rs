//! Reads problems: `.toml` problem files, and `.tens` files with their siblings.

mod decode;
mod endpoint;
mod environment;
mod formfind;
mod planner;
mod structure;

use std::path::Path;

use toml::de::DeTable;

use self::decode::{Decoder, Table, Value};
use crate::{
    declarations::Declarations,
    diagnostic::{Finding, Findings, ReadErrors, Severity, SourceFile},
    files::{self, Meshes},
    form::FormSettings,
    problem::{PlannerSettings, Problem},
    tens::{self, Parameters, Scope},
};

/// Reads a problem from a file; see [`Problem::read`].
pub(crate) fn read(path: &Path) -> Result<Problem, ReadErrors> {
    let mut findings = Findings::default();
    let problem = read_any(path, &mut findings);
    let notices = findings.finish()?;
    match problem {
        Some(problem) => Ok(Problem { notices, ..problem }),
        // Whatever yields no problem has reported why; should it not have, this
        // stands in for it.
        None => Err(ReadErrors::from(Finding::about_file(
            path,
            "the file cannot be read",
        ))),
    }
}

fn read_any(path: &Path, findings: &mut Findings) -> Option<Problem> {
    let file = files::read_text(path, findings)?;
    let extension = path.extension().and_then(|extension| extension.to_str());
    match extension {
        Some("toml") => read_toml(path, file, findings),
        Some("tens") => read_tens(path, file, findings),
        _ => {
            findings.push(
                Finding::about_file(path, "this is no problem file")
                    .with_hint("a problem is a `.toml` file or a `.tens` file".to_string()),
            );
            None
        }
    }
}

/// Name of a problem that states none.
fn name_of(path: &Path) -> String {
    path.file_stem()
        .map_or_else(String::new, |stem| stem.to_string_lossy().into_owned())
}

/// A `.tens` file with what its `.param` file states.
struct TensFile {
    declarations: Declarations,
    parameters: Parameters,
    /// The `.tens` file, then the `.param` file, if there is one.
    files: Vec<SourceFile>,
}

/// Reads a `.tens` file with a `.param` file: the one given, or the sibling if it
/// exists. Nothing if an error was found.
fn load_tens(file: SourceFile, param: Option<&Path>, findings: &mut Findings) -> Option<TensFile> {
    let errors = findings.error_count();
    let sibling = file.path().with_extension("param");
    let param = param.or_else(|| files::exists(&sibling).then_some(&*sibling));
    let param = match param {
        Some(path) => Some(files::read_text(path, findings)?),
        None => None,
    };
    let parameters = param
        .as_ref()
        .map_or_else(Parameters::default, |file| Parameters::read(file, findings));
    if findings.error_count() > errors {
        return None;
    }
    let mut meshes = Meshes::beside(file.path());
    let declarations = tens::parse(&file, parameters.clone(), &mut meshes, findings);
    if findings.error_count() > errors {
        return None;
    }
    Some(TensFile {
        declarations,
        parameters,
        files: std::iter::once(file).chain(param).collect(),
    })
}

fn read_tens(path: &Path, file: SourceFile, findings: &mut Findings) -> Option<Problem> {
    let TensFile {
        declarations,
        parameters,
        mut files,
    } = load_tens(file, None, findings)?;
    let (structure, environment) = declarations.build(&files[0], findings)?;
    let mut settings = PlannerSettings::default();
    parameters.apply(&mut settings);

    let (mut start, mut goal) = (None, None);
    let links = path.with_extension("links");
    if files::exists(&links) {
        let links = files::read_text(&links, findings)?;
        start = tens::read_row(&links, 1, &structure, findings);
        goal = tens::read_row(&links, 2, &structure, findings);
        files.push(links);
    }
    Some(Problem {
        source: Some(path.to_path_buf()),
        environment,
        start,
        goal,
        settings,
        files,
        ..Problem::new(name_of(path), structure)
    })
}

fn read_toml(path: &Path, file: SourceFile, findings: &mut Findings) -> Option<Problem> {
    let document = match DeTable::parse(file.text()) {
        Ok(document) => document,
        Err(first) => {
            syntax_errors(&file, first, findings);
            return None;
        }
    };
    let errors = findings.error_count();
    let mut decoder = Decoder {
        file: &file,
        findings,
        scope: Scope::default(),
    };
    let mut table = Table::new(document.get_ref(), 0..0);
    let folder = path.parent().unwrap_or(Path::new(""));

    // Everything is decoded before anything is built, so that one run tells of all
    // slips of the pen.
    let name = table
        .take("name")
        .map(|value| decoder.text(value, "a name").map(str::to_string));
    let seed = table
        .take("seed")
        .map(|value| decoder.whole(value, 0..u64::MAX));
    if let Some(value) = table.take("constants") {
        constants(&mut decoder, value);
    }
    let structure = match table.take("structure") {
        Some(value) => structure::decode(&mut decoder, value, folder),
        None => {
            decoder.error(
                0..0,
                "there is no structure",
                "add a table [structure], or structure = \"file.tens\"".to_string(),
            );
            None
        }
    };
    let planar = structure
        .as_ref()
        .is_some_and(|structure| structure.is_planar());
    let mut meshes = Meshes::beside(path);
    let environment = environment::decode(&mut decoder, &mut table, planar, &mut meshes);
    let start = table
        .take("start")
        .map(|value| endpoint::decode(&mut decoder, value, planar));
    let goal = table
        .take("goal")
        .map(|value| endpoint::decode(&mut decoder, value, planar));
    let form = table
        .take("formfind")
        .map(|value| formfind::decode(&mut decoder, value, planar));
    let mut settings = PlannerSettings::default();
    if let Some(structure::Source::Tens(tens)) = &structure {
        tens.parameters.apply(&mut settings);
    }
    if let Some(value) = table.take("planner") {
        planner::decode(&mut decoder, value, &mut settings);
    }
    decoder.finish(table);
    if decoder.findings.error_count() > errors {
        return None;
    }

    let mut files = Vec::new();
    let (structure, environment) = match structure? {
        structure::Source::Inline(mut declarations) => {
            let (environment, spans) = environment.unwrap_or_default();
            declarations.environment = environment;
            declarations.spans.obstacles = spans.obstacles;
            declarations.spans.rules = spans.rules;
            declarations.build(&file, findings)?
        }
        structure::Source::Tens(tens) => {
            let TensFile {
                declarations,
                files: tens_files,
                ..
            } = *tens;
            let built = match environment {
                None => declarations.build(&tens_files[0], findings)?,
                Some((environment, spans)) => {
                    let bare = Declarations {
                        environment: Default::default(),
                        ..declarations
                    };
                    let (structure, _) = bare.build(&tens_files[0], findings)?;
                    let environment = crate::declarations::build_environment(
                        environment,
                        &structure,
                        &spans,
                        &file,
                        findings,
                    )?;
                    (structure, environment)
                }
            };
            files = tens_files;
            built
        }
    };
    let mut endpoint = |stated: Option<Option<endpoint::Stated<'_>>>| {
        let mut decoder = Decoder {
            file: &file,
            findings,
            scope: Scope::default(),
        };
        match stated.flatten() {
            None => (None, None),
            Some(endpoint::Stated::Form(conditions)) => {
                let conditions = formfind::resolve(&mut decoder, conditions, &structure);
                (None, Some(conditions))
            }
            Some(stated) => {
                let found = endpoint::resolve(&mut decoder, stated, &structure, folder, &mut files);
                (found, None)
            }
        }
    };
    let (start, start_form) = endpoint(start);
    let (goal, goal_form) = endpoint(goal);
    let mut decoder = Decoder {
        file: &file,
        findings,
        scope: Scope::default(),
    };
    let form = form.map_or_else(FormSettings::default, |form| {
        formfind::resolve_settings(&mut decoder, form, &structure)
    });
    files.insert(0, file.clone());
    Some(Problem {
        source: Some(path.to_path_buf()),
        environment,
        start,
        goal,
        start_form,
        goal_form,
        form,
        settings,
        seed: seed.flatten().unwrap_or(0),
        files,
        ..Problem::new(
            name.flatten().unwrap_or_else(|| name_of(path)),
            structure.clone(),
        )
    })
}

/// Reports what is no TOML: all errors, or the first where the text is so long that
/// they could be very many.
fn syntax_errors(file: &SourceFile, first: toml::de::Error, findings: &mut Findings) {
    const LONG: usize = 1 << 20;
    let errors = if file.text().len() > LONG {
        vec![first]
    } else {
        DeTable::parse_recoverable(file.text()).1
    };
    let end = file.text().len();
    for error in errors {
        let span = error.span().unwrap_or(end..end);
        let finding = Finding::in_text(Severity::Error, file, span, error.message());
        findings.push(finding);
    }
}

/// Defines constants, in the order of the text.
fn constants(decoder: &mut Decoder<'_>, value: Value<'_>) {
    let Some(table) = decoder.table(value) else {
        return;
    };
    for entry in table.into_entries() {
        let letters = |letter: char| letter.is_ascii_alphanumeric() || letter == '_';
        if !entry.key.chars().all(letters) || entry.key.starts_with(|c: char| c.is_ascii_digit()) {
            let hint = "a name is made of letters, digits and _, and begins with no digit";
            let message = format!("no expression can name the constant `{}`", entry.key);
            decoder.error(entry.key_span.clone(), message, hint.to_string());
        }
        // A broken definition still defines the name: it is reported here, not
        // wherever the name is used.
        let value = decoder
            .number_if(entry.value, "a finite number", |_| true)
            .unwrap_or(f64::NAN);
        decoder.scope.constants.insert(entry.key.to_string(), value);
    }
}
