//! `drive.toml` from text to values: every entry is read on its own, so that one fault hides no other.

use super::DriveProblem;
use crate::manifest::{LidarEntry, Manifest};
use serde::de::{DeserializeOwned, IntoDeserializer};
use std::path::{Path, PathBuf};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// A manifest with what was wrong with it so far. The manifest is there if all of its entries could be read.
pub(super) struct Read {
    path: PathBuf,
    text: String,
    pub(super) manifest: Option<Manifest>,
    pub(super) problems: Vec<DriveProblem>,
}

impl Read {
    /// A manifest that was not read but assumed.
    pub(super) fn assumed(path: PathBuf, manifest: Manifest) -> Self {
        Self { path, text: String::new(), manifest: Some(manifest), problems: Vec::new() }
    }

    pub(super) fn of_text(path: &Path, text: String) -> Self {
        let mut read = Self { path: path.to_owned(), text, manifest: None, problems: Vec::new() };
        let text = std::mem::take(&mut read.text);
        match DeTable::parse(&text) {
            Ok(table) => read.entries(&text, table.get_ref()),
            Err(error) => {
                let line = error.span().map(|span| line_of(&text, span.start));
                read.problems.push(DriveProblem { line, ..DriveProblem::of_file(path, error.message()) });
            }
        }
        read.text = text;
        read
    }

    fn entries(&mut self, text: &str, table: &DeTable<'_>) {
        const KEYS: [&str; 8] = ["version", "name", "lidar", "camera", "mosaic", "gnss", "imu", "truth"];
        for (key, _) in table {
            if !KEYS.contains(&key.get_ref().as_ref()) {
                let line = Some(line_of(text, key.span().start));
                let rule = format!("unknown key; known are {}", KEYS.join(", "));
                self.problem(line, key.get_ref(), rule);
            }
        }
        let version = self.required(text, table, "version");
        let name = self.required(text, table, "name");
        let lidar: Option<LidarEntry> = self.required(text, table, "lidar");
        let cameras = self.list(text, table, "camera");
        let mosaics = self.list(text, table, "mosaic");
        let (gnss, imu, truth) =
            (self.entry(text, table, "gnss"), self.entry(text, table, "imu"), self.entry(text, table, "truth"));
        if let (Some(version), Some(name), Some(lidar)) = (version, name, lidar)
            && self.problems.is_empty()
        {
            self.manifest = Some(Manifest { version, name, lidar, cameras, mosaics, gnss, imu, truth });
        }
    }

    fn required<T: DeserializeOwned>(&mut self, text: &str, table: &DeTable<'_>, key: &str) -> Option<T> {
        if !table.contains_key(key) {
            self.problem(None, key, "is missing");
        }
        self.entry(text, table, key)
    }

    fn entry<T: DeserializeOwned>(&mut self, text: &str, table: &DeTable<'_>, key: &str) -> Option<T> {
        table.get(key).and_then(|value| self.value(text, value, key))
    }

    fn list<T: DeserializeOwned>(&mut self, text: &str, table: &DeTable<'_>, key: &str) -> Vec<T> {
        let Some(value) = table.get(key) else { return Vec::new() };
        let DeValue::Array(items) = value.get_ref() else {
            self.problem(Some(line_of(text, value.span().start)), key, format!("must be tables [[{key}]]"));
            return Vec::new();
        };
        let read = |(index, item)| self.value(text, item, &format!("{key}[{index}]"));
        items.iter().enumerate().filter_map(read).collect()
    }

    fn value<T: DeserializeOwned>(&mut self, text: &str, value: &Spanned<DeValue<'_>>, key: &str) -> Option<T> {
        match T::deserialize(value.clone().into_deserializer()) {
            Ok(entry) => Some(entry),
            Err(error) => {
                let span = error.span().unwrap_or(value.span());
                self.problem(Some(line_of(text, span.start)), key, error.message().trim_end());
                None
            }
        }
    }

    fn problem(&mut self, line: Option<usize>, key: &str, rule: impl Into<String>) {
        self.problems.push(DriveProblem { file: self.path.clone(), line, key: key.to_owned(), rule: rule.into() });
    }

    /// Takes down a fault of a value that reads but cannot be. The line is that of the value, or of its nearest parent.
    pub(super) fn fault(&mut self, key: &str, rule: impl Into<String>) {
        let line = DeTable::parse(&self.text).ok().and_then(|table| line_of_key(&self.text, table.get_ref(), key));
        self.problem(line, key, rule);
    }
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
