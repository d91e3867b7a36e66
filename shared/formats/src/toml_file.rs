//! A TOML file that people write, from text to values: every entry is read on its own, so that one fault hides no other.

use crate::problems::{FileError, FileProblem};
use serde::de::{DeserializeOwned, IntoDeserializer};
use std::path::{Path, PathBuf};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// A file with what was wrong with it so far.
#[derive(Clone, Debug)]
pub struct TomlFile {
    path: PathBuf,
    /// Empty if it was no TOML.
    text: String,
    is_toml: bool,
    problems: Vec<FileProblem>,
}

impl TomlFile {
    /// A text of the given name, whose top-level keys must be among `known`. A text that is no TOML has this fault alone.
    pub fn new(path: &Path, text: impl Into<String>, known: &[&str]) -> Self {
        let mut file = Self { path: path.to_owned(), text: text.into(), is_toml: true, problems: Vec::new() };
        let text = std::mem::take(&mut file.text);
        match DeTable::parse(&text) {
            Ok(table) => {
                for (key, _) in table.get_ref().iter().filter(|(key, _)| !known.contains(&key.get_ref().as_ref())) {
                    let line = Some(line_of(&text, key.span().start));
                    file.problem(line, key.get_ref(), format!("unknown key; known are {}", known.join(", ")));
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

    /// An entry that must be there.
    pub fn required<T: DeserializeOwned>(&mut self, key: &str) -> Option<T> {
        let is_there = self.with_table(|_, table| table.contains_key(key));
        if self.is_toml && !is_there {
            self.problem(None, key, "is missing");
        }
        self.optional(key)
    }

    /// An entry that may be there.
    pub fn optional<T: DeserializeOwned>(&mut self, key: &str) -> Option<T> {
        let read = self.with_table(|text, table| Some(value(text, table.get(key)?)))?;
        read.map_err(|(line, rule)| self.problem(Some(line), key, rule)).ok()
    }

    /// All tables `[[key]]`; those that cannot be read are left out.
    pub fn list<T: DeserializeOwned>(&mut self, key: &str) -> Vec<T> {
        let read = self.with_table(|text, table| {
            let list = table.get(key)?;
            Some(match list.get_ref() {
                DeValue::Array(items) => Ok(items.iter().map(|item| value(text, item)).collect::<Vec<_>>()),
                _ => Err(line_of(text, list.span().start)),
            })
        });
        match read {
            None => Vec::new(),
            Some(Err(line)) => {
                self.problem(Some(line), key, format!("must be tables [[{key}]]"));
                Vec::new()
            }
            Some(Ok(items)) => {
                let mut sound = Vec::new();
                for (index, item) in items.into_iter().enumerate() {
                    match item {
                        Ok(item) => sound.push(item),
                        Err((line, rule)) => self.problem(Some(line), &format!("{key}[{index}]"), rule),
                    }
                }
                sound
            }
        }
    }

    /// Takes down a fault of a value that reads but cannot be; `key` as `camera[2].model.fx`. The line is that of the value, or
    /// of its nearest parent.
    pub fn fault(&mut self, key: &str, rule: impl Into<String>) {
        let line = self.with_table(|text, table| line_of_key(text, table, key));
        self.problem(line, key, rule);
    }

    /// Takes down a fault unless the rule holds.
    pub fn rule(&mut self, key: &str, holds: bool, rule: impl FnOnce() -> String) {
        if !holds {
            self.fault(key, rule());
        }
    }

    /// Whether nothing was wrong so far.
    pub fn is_sound(&self) -> bool {
        self.problems.is_empty()
    }

    /// Everything that was wrong, if anything was.
    pub fn finish(self) -> Result<(), FileError> {
        if self.problems.is_empty() { Ok(()) } else { Err(self.into_error()) }
    }

    /// Everything that was wrong.
    pub fn into_error(self) -> FileError {
        FileError { problems: self.problems }
    }

    /// The text was parsed before; it is parsed anew for each entry, because a table borrows from its text.
    fn with_table<T: Default>(&self, read: impl FnOnce(&str, &DeTable<'_>) -> T) -> T {
        DeTable::parse(&self.text).map(|table| read(&self.text, table.get_ref())).unwrap_or_default()
    }

    fn problem(&mut self, line: Option<usize>, key: &str, rule: impl Into<String>) {
        self.problems.push(FileProblem { file: self.path.clone(), line, key: key.to_owned(), rule: rule.into() });
    }
}

/// The value, or line and reason why it cannot be read.
fn value<T: DeserializeOwned>(text: &str, value: &Spanned<DeValue<'_>>) -> Result<T, (usize, String)> {
    T::deserialize(value.clone().into_deserializer()).map_err(|error| {
        let span = error.span().unwrap_or(value.span());
        (line_of(text, span.start), error.message().trim_end().to_owned())
    })
}

fn line_of(text: &str, at: usize) -> usize {
    text.as_bytes().iter().take(at).filter(|byte| **byte == b'\n').count() + 1
}

/// Follows `a[2].b.c` as far as it goes.
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
