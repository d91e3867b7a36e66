//! Parser of hand-written TOML files. Every entry is read separately, so that all problems are reported at once.

use crate::problems::{FileError, FileProblem};
use crate::toml_nesting::check_nesting;
use serde::de::{DeserializeOwned, IntoDeserializer};
use std::path::{Path, PathBuf};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Number of problems that are reported: nobody reads more, and finding the line of each takes time.
const MAX_PROBLEMS: usize = 20;

/// A file with the problems found so far, up to 20, and the number of further problems.
#[derive(Clone, Debug)]
pub struct TomlFile {
    path: PathBuf,
    /// Empty if the text is not TOML.
    text: String,
    is_toml: bool,
    problems: Vec<FileProblem>,
    n_left_out: usize,
}

impl TomlFile {
    /// Parses a text. Its top-level keys must be among `known`. If the text is not TOML, this is the only problem.
    pub fn new(path: &Path, text: impl Into<String>, known: &[&str]) -> Self {
        let mut file =
            Self { path: path.to_owned(), text: text.into(), is_toml: true, problems: Vec::new(), n_left_out: 0 };
        let text = std::mem::take(&mut file.text);
        if let Err(error) = check_nesting(&text) {
            file.is_toml = false;
            file.problem(Some(line_of(&text, error.at)), "", error.to_string());
            return file;
        }
        match DeTable::parse(&text) {
            Ok(table) => {
                for (key, _) in table.get_ref().iter().filter(|(key, _)| !known.contains(&key.get_ref().as_ref())) {
                    if file.is_full() {
                        continue;
                    }
                    let line = Some(line_of(&text, key.span().start));
                    file.problem(line, key.get_ref(), format!("unknown key; known keys are {}", known.join(", ")));
                }
                file.text = text;
            }
            Err(error) => {
                file.is_toml = false;
                let line = error.span().map(|span| line_of(&text, span.start));
                file.problem(line, "", error.message());
            }
        }
        file
    }

    /// A required entry. If it is a table, it must have the keys `members`.
    pub fn required<T: DeserializeOwned>(&mut self, key: &str, members: &[&str]) -> Option<T> {
        let is_there = self.with_table(|_, table| table.contains_key(key));
        if self.is_toml && !is_there {
            self.problem(None, key, "is missing");
        }
        self.optional(key, members)
    }

    /// An optional entry. If it is a table, it must have the keys `members`.
    pub fn optional<T: DeserializeOwned>(&mut self, key: &str, members: &[&str]) -> Option<T> {
        let read = self.with_table(|text, table| table.get(key).map(|entry| value(text, entry, members)))?;
        self.value_or_problems(key, read)
    }

    /// All tables `[[key]]`, which must have the keys `members`; `None` for tables that cannot be read.
    pub fn list<T: DeserializeOwned>(&mut self, key: &str, members: &[&str]) -> Vec<Option<T>> {
        let read = self.with_table(|text, table| {
            let list = table.get(key)?;
            Some(match list.get_ref() {
                DeValue::Array(items) => Ok(up_to_faults(items.iter().map(|item| value(text, item, members)))),
                _ => Err(line_of(text, list.span().start)),
            })
        });
        match read {
            None => Vec::new(),
            Some(Err(line)) => {
                self.problem(Some(line), key, format!("expected tables [[{key}]]"));
                Vec::new()
            }
            Some(Ok(items)) => {
                let items = items.into_iter().enumerate();
                items.map(|(index, item)| self.value_or_problems(&format!("{key}[{index}]"), item)).collect()
            }
        }
    }

    /// A required entry that is one table `[key]` or several `[[key]]`, which must have the keys `members`; `None` for
    /// tables that cannot be read.
    pub fn one_or_more<T: DeserializeOwned>(&mut self, key: &str, members: &[&str]) -> Vec<Option<T>> {
        let n_items = self.with_table(|_, table| match table.get(key).map(Spanned::get_ref) {
            Some(DeValue::Array(items)) => Some(items.len()),
            _ => None,
        });
        if n_items == Some(0) {
            self.problem(None, key, "is empty; expected at least one table");
        }
        if n_items.is_some() { self.list(key, members) } else { vec![self.required(key, members)] }
    }

    fn value_or_problems<T>(&mut self, key: &str, read: Result<T, Vec<(usize, String)>>) -> Option<T> {
        let faults = match read {
            Ok(value) => return Some(value),
            Err(faults) => faults,
        };
        for (line, rule) in faults {
            self.problem(Some(line), key, rule);
        }
        None
    }

    /// Records a problem with a value, for example of key `camera[2].model.fx`. The line is the line of the value or of
    /// its nearest parent.
    pub fn fault(&mut self, key: &str, rule: impl Into<String>) {
        if self.is_full() {
            return;
        }
        let line = self.with_table(|text, table| line_of_key(text, table, key));
        self.problem(line, key, rule);
    }

    /// Records a problem unless the rule holds.
    pub fn rule(&mut self, key: &str, holds: bool, rule: impl FnOnce() -> String) {
        if !holds {
            self.fault(key, rule());
        }
    }

    /// Whether no problem was found so far.
    pub fn is_sound(&self) -> bool {
        self.problems.is_empty()
    }

    /// An error with all problems, if there are any.
    pub fn finish(self) -> Result<(), FileError> {
        if self.problems.is_empty() { Ok(()) } else { Err(self.into_error()) }
    }

    /// An error with all problems.
    pub fn into_error(mut self) -> FileError {
        if self.n_left_out > 0 {
            let rule = format!("{} or more further problems", self.n_left_out);
            self.problems.push(FileProblem::for_file(&self.path, rule));
        }
        FileError { problems: self.problems }
    }

    /// Whether the list of problems is full; if so, counts one more.
    fn is_full(&mut self) -> bool {
        let is_full = self.problems.len() >= MAX_PROBLEMS;
        self.n_left_out += usize::from(is_full);
        is_full
    }

    /// Parses the text again for each entry, because a table borrows from its text.
    fn with_table<T: Default>(&self, read: impl FnOnce(&str, &DeTable<'_>) -> T) -> T {
        DeTable::parse(&self.text).map(|table| read(&self.text, table.get_ref())).unwrap_or_default()
    }

    fn problem(&mut self, line: Option<usize>, key: &str, rule: impl Into<String>) {
        if self.is_full() {
            return;
        }
        self.problems.push(FileProblem { file: self.path.clone(), line, key: key.to_owned(), rule: rule.into() });
    }
}

/// The items up to the last fault that is reported: finding the line of a fault takes as long as the file.
fn up_to_faults<T, E>(items: impl Iterator<Item = Result<T, E>>) -> Vec<Result<T, E>> {
    let mut n_faults = 0;
    let mut found = Vec::new();
    for item in items {
        n_faults += usize::from(item.is_err());
        found.push(item);
        if n_faults > MAX_PROBLEMS {
            break;
        }
    }
    found
}

/// The value, or lines and messages of all its faults. `members` are its required keys.
fn value<T: DeserializeOwned>(
    text: &str,
    value: &Spanned<DeValue<'_>>,
    members: &[&str],
) -> Result<T, Vec<(usize, String)>> {
    let missing = |key: &str| format!("missing field `{key}`");
    let begin = line_of(text, value.span().start);
    let absent = |key: &&&str| matches!(value.get_ref(), DeValue::Table(table) if !table.contains_key(**key));
    let mut faults: Vec<(usize, String)> = members.iter().filter(absent).map(|key| (begin, missing(key))).collect();
    // The parser reports one fault. The faulty entry is removed, so that the parser reaches the next fault.
    let mut left = value.clone();
    let mut left_out = Vec::new();
    loop {
        let error = match T::deserialize(left.clone().into_deserializer()) {
            Ok(value) if faults.is_empty() => return Ok(value),
            Ok(_) => return Err(faults),
            Err(error) => error,
        };
        let message = error.message().trim_end().to_owned();
        let is_known = members.iter().any(|key| missing(key) == message)
            || left_out.iter().any(|key: &String| missing(key) == message);
        if !is_known {
            let at = error.span().map_or(begin, |span| line_of(text, span.start));
            faults.push((at, message));
        }
        if faults.len() > MAX_PROBLEMS {
            return Err(faults);
        }
        match error.span().and_then(|span| leave_out(left.get_mut(), &span)) {
            Some(key) => left_out.push(key),
            None => return Err(faults),
        }
    }
}

/// Removes the entry of the table in which the parser found a fault. Returns its key.
fn leave_out(value: &mut DeValue<'_>, fault: &std::ops::Range<usize>) -> Option<String> {
    let DeValue::Table(table) = value else { return None };
    let contains = |span: std::ops::Range<usize>| span.start <= fault.start && fault.end <= span.end;
    let faulty = table.iter().find(|(key, value)| contains(key.span()) || contains(value.span()));
    let key = faulty.map(|(key, _)| key.get_ref().to_string())?;
    table.remove(key.as_str());
    Some(key)
}

fn line_of(text: &str, at: usize) -> usize {
    text.as_bytes().iter().take(at).filter(|byte| **byte == b'\n').count() + 1
}

/// Line of the deepest existing entry on the path `a[2].b.c`.
fn line_of_key(text: &str, table: &DeTable<'_>, key: &str) -> Option<usize> {
    let mut table = table;
    let mut line = None;
    for part in key.split('.') {
        let (name, index) = match part.split_once('[') {
            Some((name, index)) => (name, index.trim_end_matches(']').parse::<usize>().ok()),
            None => (part, None),
        };
        let Some(mut value) = table.get(name) else { break };
        if let (Some(index), DeValue::Array(items)) = (index, value.get_ref())
            && let Some(item) = items.get(index)
        {
            value = item;
        }
        line = Some(line_of(text, value.span().start));
        match value.get_ref() {
            DeValue::Table(inner) => table = inner,
            _ => break,
        }
    }
    line
}
