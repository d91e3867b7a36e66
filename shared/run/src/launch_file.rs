//! Reads launch.toml. Every problem can be shown with its line.

use crate::Change;
use files::text_file::{MAX_SETTINGS_BYTES, read_text};
use files::toml_nesting::check_nesting;
use settings::{Problem, nearest_key};
use std::borrow::Cow;
use std::ops::Range;
use std::path::{Path, PathBuf};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Syntax errors that are reported; more would not be read.
const MAX_ERRORS: usize = 20;
/// Largest number of tables of a launch file: one for each stage and three for the run. The largest pipeline has a
/// tenth.
const MAX_TABLES: usize = 256;

/// A parsed launch.toml with the changes of the command line applied to it.
#[derive(Debug)]
pub struct LaunchFile {
    path: PathBuf,
    text: &'static str,
    root: DeTable<'static>,
    /// Tables without the changes of the command line.
    written: DeTable<'static>,
    /// Keys that the command line changes, `table.key`.
    changed: Vec<String>,
}

impl LaunchFile {
    /// Reads the file and applies the changes of the command line in their order. All problems are reported, not only the first.
    pub fn load(path: &Path, changes: &[Change]) -> Result<Self, Vec<Problem>> {
        let text = read_text(path, MAX_SETTINGS_BYTES)
            .map_err(|error| vec![Problem::for_key("", format!("cannot be read: {error}"))])?;
        Self::parse(path, text, changes)
    }

    /// [`LaunchFile::load`] for a text.
    pub fn parse(path: &Path, text: String, changes: &[Change]) -> Result<Self, Vec<Problem>> {
        if let Err(error) = check_nesting(&text) {
            let problem = Problem { key: String::new(), span: Some(error.at..error.at + 1), text: error.to_string() };
            return Err(vec![problem]);
        }
        // A process reads its launch file once and needs it until it ends: parsed values borrow from the text.
        let text: &'static str = text.leak();
        let (parsed, errors) = DeTable::parse_recoverable(text);
        let mut problems: Vec<Problem> = errors
            .iter()
            .take(MAX_ERRORS)
            .map(|error| Problem {
                key: String::new(),
                span: error.span(),
                text: error.message().trim_end().to_owned(),
            })
            .collect();
        let mut root = parsed.into_inner();
        if root.len() > MAX_TABLES {
            let text = format!("has {} tables, must have up to {MAX_TABLES}", root.len());
            problems.push(Problem::for_key("", text));
        }
        let written = root.clone();
        for change in changes {
            if let Err(error) = apply(&mut root, change) {
                problems.push(Problem::for_key("", format!("{change}: {error}")));
            }
        }
        if problems.is_empty() {
            let changed = changes.iter().map(Change::path).collect();
            Ok(Self { path: path.to_owned(), text, root, written, changed })
        } else {
            Err(problems)
        }
    }

    /// Names of all tables and their positions, in the order of the file. Tables of the command line have no position
    /// in it.
    pub fn tables(&self) -> Vec<(String, Option<Range<usize>>)> {
        let place = |span: Range<usize>| (!span.is_empty()).then_some(span);
        let mut tables: Vec<_> = self.root.keys().map(|key| (key.get_ref().to_string(), place(key.span()))).collect();
        tables.sort_by_key(|(_, span)| span.as_ref().map_or(usize::MAX, |span| span.start));
        tables
    }

    /// A table's content; an absent table is empty. `Err` if the key exists but is not a table.
    pub fn table(&self, name: &str) -> Result<DeTable<'static>, Problem> {
        let Some((_, value)) = self.root.iter().find(|(key, _)| key.get_ref() == name) else {
            return Ok(DeTable::new());
        };
        match value.get_ref() {
            DeValue::Table(table) => Ok(table.clone()),
            other => Err(Problem {
                key: name.to_owned(),
                span: Some(value.span()),
                text: format!("must be a table, is a {}", other.type_str()),
            }),
        }
    }

    /// Whether the file itself, without the changes of the command line, has this table.
    pub fn is_written(&self, table: &str) -> bool {
        self.written.keys().any(|key| key.get_ref() == table)
    }

    /// The text of a key in the file itself, without the changes of the command line.
    pub fn written_text(&self, table: &str, key: &str) -> Option<&str> {
        let named = |(name, value): (&Spanned<_>, _)| (name.get_ref() == key).then_some(value);
        let (_, table) = self.written.iter().find(|(name, _)| name.get_ref() == table)?;
        let DeValue::Table(table) = table.get_ref() else { return None };
        table.iter().find_map(named)?.get_ref().as_str()
    }

    /// Completes a problem of `table`: adds the full key, and removes the position in the file for values of the
    /// command line.
    pub fn located(&self, table: &str, mut problem: Problem) -> Problem {
        problem.key = if problem.key.is_empty() { table.to_owned() } else { format!("{table}.{}", problem.key) };
        if self.changed.contains(&problem.key) {
            problem.span = None;
            problem.text = format!("{} (from --set)", problem.text);
        }
        problem
    }

    /// Renders one problem for people: file, line, column, key, rule, and the line itself.
    pub fn render(&self, problem: &Problem) -> String {
        render(&self.path, self.text, problem)
    }
}

/// [`LaunchFile::render`] for a file that did not parse.
pub fn render(path: &Path, text: &str, problem: &Problem) -> String {
    let key = if problem.key.is_empty() { String::new() } else { format!("{}: ", problem.key) };
    let Some(span) = problem.span.clone().filter(|span| span.start <= text.len()) else {
        return format!("{}: {key}{}", path.display(), problem.text);
    };
    let before = &text[..span.start];
    let line_start = before.rfind('\n').map_or(0, |at| at + 1);
    let line_number = before.matches('\n').count() + 1;
    let line = text[line_start..].lines().next().unwrap_or_default();
    let column = text[line_start..span.start].chars().count();
    let width =
        text.get(span.clone()).map_or(1, |marked| marked.lines().next().unwrap_or_default().chars().count().max(1));
    format!(
        "{}:{line_number}:{}: {key}{}\n    {line}\n    {}{}",
        path.display(),
        column + 1,
        problem.text,
        " ".repeat(column),
        "^".repeat(width)
    )
}

/// A change that cannot be applied.
#[derive(Debug, thiserror::Error)]
enum ApplyError {
    #[error("the launch file does not set {path}{hint}")]
    Absent { path: String, hint: String },
    #[error("{table} is not a table")]
    NotATable { table: String },
}

fn apply(root: &mut DeTable<'static>, change: &Change) -> Result<(), ApplyError> {
    match change {
        Change::Set { table, key, value } => {
            let slot =
                root.entry(placeless(table)).or_insert_with(|| Spanned::new(0..0, DeValue::Table(DeTable::new())));
            let DeValue::Table(keys) = slot.get_mut() else {
                return Err(ApplyError::NotATable { table: table.clone() });
            };
            keys.insert(placeless(key), toml_value(value));
        }
        Change::Unset { table, key } => {
            let found = root.iter_mut().find(|(name, _)| name.get_ref() == table).map(|(_, value)| value.get_mut());
            let removed = if let Some(DeValue::Table(keys)) = found { keys.remove(key.as_str()) } else { None };
            if removed.is_none() {
                let path = change.path();
                return Err(ApplyError::Absent { hint: nearest_set(root, &path), path });
            }
        }
    }
    Ok(())
}

/// A key without a position in the file.
fn placeless(name: &str) -> Spanned<Cow<'static, str>> {
    Spanned::new(0..0, Cow::Owned(name.to_owned()))
}

/// The key in the file that is most similar to `path`, as a hint; empty if no key is similar.
fn nearest_set(root: &DeTable<'static>, path: &str) -> String {
    let keys_of = |(name, value): (&Spanned<Cow<'static, str>>, &Spanned<DeValue<'static>>)| {
        let keys = value.get_ref().as_table().into_iter().flat_map(|table| table.keys());
        let of_table = |key: &Spanned<Cow<'static, str>>| format!("{}.{}", name.get_ref(), key.get_ref());
        keys.map(of_table).collect::<Vec<_>>()
    };
    let set: Vec<String> = root.iter().flat_map(keys_of).collect();
    let hint = nearest_key(path, set.iter().map(String::as_str));
    hint.split_once(';').map(|(_, hint)| format!(";{hint}")).unwrap_or_default()
}

/// The text as a TOML value if it is one, else as a string: `--set run.drive=drives/a` needs no quotes.
fn toml_value(text: &str) -> Spanned<DeValue<'static>> {
    let parsed = check_nesting(text).is_ok().then(|| {
        let wrapped: &'static str = format!("v = {text}").leak();
        DeTable::parse(wrapped).ok().and_then(|table| table.into_inner().into_iter().next())
    });
    match parsed.flatten() {
        Some((_, value)) => value,
        None => Spanned::new(0..0, DeValue::String(Cow::Owned(text.to_owned()))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(text: &str) -> Change {
        Change::set(text).expect("valid")
    }

    fn unset(text: &str) -> Change {
        Change::unset(text).expect("valid")
    }

    const TEXT: &str = "[run]\ndrive = \"a\"\n\n[infer]\nmodell = 3\n";

    #[test]
    fn problem_is_rendered_with_its_line() {
        let file = LaunchFile::parse(Path::new("launch.toml"), TEXT.to_owned(), &[]).expect("parses");
        let table = file.table("infer").expect("a table");
        let (key, _) = table.iter().next().expect("one key");
        let problem = Problem { key: "modell".into(), span: Some(key.span()), text: "unknown key".into() };
        let shown = file.render(&file.located("infer", problem));
        assert_eq!(shown, "launch.toml:5:1: infer.modell: unknown key\n    modell = 3\n    ^^^^^^");
    }

    #[test]
    fn brackets_that_overflow_the_stack_of_the_parser_are_refused() {
        let text = format!("a = 1\nx = {}", "{[]x=".repeat(100_000));
        let problems = LaunchFile::parse(Path::new("launch.toml"), text.clone(), &[]).expect_err("refused");
        let shown = render(Path::new("launch.toml"), &text, &problems[0]);
        assert!(
            shown.starts_with("launch.toml:2:501: more than 100 arrays and inline tables are open"),
            "{shown:.200}"
        );
        let value = set(&format!("run.drive={}", "{[]x=".repeat(100_000)));
        let file = LaunchFile::parse(Path::new("launch.toml"), TEXT.to_owned(), &[value]).expect("is a text");
        assert!(file.table("run").is_ok());
    }

    #[test]
    fn device_or_huge_file_is_refused() {
        let folder = tempfile::tempdir().expect("a folder");
        let refused = |path: &Path| LaunchFile::load(path, &[]).expect_err("refused").remove(0).text;
        assert_eq!(refused(Path::new("/dev/zero")), "cannot be read: is not a regular file");
        let path = folder.path().join("launch.toml");
        std::fs::write(&path, "# long\n".repeat(200_000)).expect("writes");
        assert!(refused(&path).starts_with("cannot be read: has more than 1048576 bytes"));
        let tables: Vec<String> = (0..1000).map(|k| format!("[stage_{k}]\n")).collect();
        std::fs::write(&path, tables.concat()).expect("writes");
        assert_eq!(refused(&path), "has 1000 tables, must have up to 256");
    }

    #[test]
    fn first_unknown_keys_of_a_table_are_reported_and_the_others_are_counted() {
        settings::settings! {
            /// Settings of the test.
            pub struct Small {
                /// A size, m.
                pub size_m: f64 = 1.0 => settings::at_least(0.0);
            }
        }
        let text = (0..50_000).map(|k| format!("size_{k} = 1\n")).collect::<Vec<_>>().concat();
        let table = DeTable::parse(&text).expect("parses");
        let (_, problems) = settings::parse_table::<Small>(table.get_ref());
        assert_eq!(problems.len(), 21);
        assert_eq!(problems[20].text, "49980 more unknown keys");
    }

    #[test]
    fn changed_value_needs_no_quotes() {
        let changes = ["run.drive=/data/drive 7", "infer.modell=4", "new.key=true"].map(set);
        let file = LaunchFile::parse(Path::new("launch.toml"), TEXT.to_owned(), &changes).expect("parses");
        let value = |table: &str| file.table(table).expect("a table").into_iter().next().expect("one").1.into_inner();
        assert_eq!(value("run").as_str(), Some("/data/drive 7"));
        assert_eq!(value("infer").as_integer().map(|i| i.as_str().to_owned()), Some("4".to_owned()));
        assert_eq!(value("new").as_bool(), Some(true));
        let shown = file.located("infer", Problem { key: "modell".into(), span: Some(0..1), text: "x".into() });
        assert_eq!((shown.span, shown.text.as_str()), (None, "x (from --set)"));
    }

    #[test]
    fn written_values_are_those_of_the_file_without_changes() {
        let changes = ["run.drive=b", "simulate.seed=4"].map(set);
        let file = LaunchFile::parse(Path::new("launch.toml"), TEXT.to_owned(), &changes).expect("parses");
        assert_eq!(file.written_text("run", "drive"), Some("a"));
        assert_eq!((file.written_text("run", "output"), file.written_text("infer", "modell")), (None, None));
        assert!(file.is_written("run") && !file.is_written("simulate"));
    }

    #[test]
    fn removal_of_key_requires_the_key() {
        let parse = |changes: &[Change]| LaunchFile::parse(Path::new("l"), TEXT.to_owned(), changes);
        let removed = unset("infer.modell");
        assert!(parse(std::slice::from_ref(&removed)).expect("parses").table("infer").expect("a table").is_empty());
        let set_again = parse(&[removed, set("infer.modell=4")]).expect("parses");
        assert_eq!(set_again.table("infer").expect("a table").len(), 1);
        for absent in ["infer.mode", "instance.modell"] {
            let problems = parse(&[unset(absent)]).expect_err("no such key");
            assert_eq!(problems.len(), 1, "{absent}");
            assert!(problems[0].text.starts_with(&format!("--unset {absent}: the launch file does not set {absent}")));
        }
    }

    #[test]
    fn syntax_errors_are_all_reported() {
        let changes = [unset("run.c")];
        let problems =
            LaunchFile::parse(Path::new("l"), "[run]\na = \nb = = 3\n".to_owned(), &changes).expect_err("faulty");
        assert!(problems.len() >= 3, "{problems:?}");
    }
}
