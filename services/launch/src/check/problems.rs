//! Collects the problems of a launch file.

use crate::programs::ProgramError;
use run::launch_file::LaunchFile;
use settings::{Problem, Settings, nearest_key, parse_table};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// The problems so far.
pub struct Problems<'a> {
    file: &'a LaunchFile,
    problems: Vec<Problem>,
    has_failure: bool,
}

/// Why a launch file is not used.
#[derive(Debug)]
pub struct Refusal {
    /// The rendered problems, in the order of the file.
    pub problems: Vec<String>,
    /// Whether a program was killed or gave no answer: not the launch file is to blame, and another attempt may succeed.
    pub is_failure: bool,
}

impl<'a> Problems<'a> {
    /// An empty collection.
    pub fn new(file: &'a LaunchFile) -> Self {
        Self { file, problems: Vec::new(), has_failure: false }
    }

    /// The file without the borrow of the problems.
    pub fn file(&self) -> &'a LaunchFile {
        self.file
    }

    /// Whether there are no problems.
    pub fn is_empty(&self) -> bool {
        self.problems.is_empty()
    }

    /// Whether the file has the table.
    pub fn has_table(&self, name: &str) -> bool {
        self.file.tables().iter().any(|(table, _)| table == name)
    }

    /// The position of a table in the file.
    pub fn place_of(&self, name: &str) -> Option<Range<usize>> {
        self.file.tables().into_iter().find(|(table, _)| table == name).and_then(|(_, span)| span)
    }

    /// The most similar table of the file, or all tables, as a hint.
    pub fn nearest_table(&self, name: &str) -> String {
        let tables = self.file.tables();
        nearest_key(name, tables.iter().map(|(table, _)| table.as_str()))
            .replace("unknown key", "no such table in the file")
    }

    /// Adds a problem of a table.
    pub fn add(&mut self, table: &str, problem: Problem) {
        self.problems.push(self.file.located(table, problem));
    }

    /// Adds a problem of a table at `span`.
    pub fn add_at(&mut self, table: &str, span: Option<Range<usize>>, text: String) {
        self.add(table, Problem { key: String::new(), span, text });
    }

    /// Adds a problem with the program of a table at `span`.
    pub fn add_program(&mut self, table: &str, span: Option<Range<usize>>, error: &ProgramError) {
        self.has_failure |= error.is_failure();
        self.add_at(table, span, error.to_string());
    }

    /// Adds a problem of the file as a whole.
    pub fn add_without_place(&mut self, text: impl Into<String>) {
        self.add("", Problem::for_key("", text));
    }

    /// Adds problems with positions that a program has determined.
    pub fn add_located(&mut self, problems: Vec<Problem>) {
        self.problems.extend(problems);
    }

    /// Parses the keys of a table that `is_wanted` selects. Problems are added.
    pub fn table<S: Settings>(&mut self, name: &str, is_wanted: impl Fn(&str) -> bool) -> S {
        match self.file.table(name) {
            Ok(table) => {
                let table = table.into_iter().filter(|(key, _)| is_wanted(key.get_ref())).collect();
                let (settings, problems) = parse_table::<S>(&table);
                for problem in problems {
                    self.add(name, problem);
                }
                settings
            }
            Err(problem) => {
                self.problems.push(problem);
                S::default()
            }
        }
    }

    /// A problem at the position of a value, or at the table if the key is absent.
    pub fn at_value(&self, table: &str, key: &str, text: String) -> Problem {
        let span = self.file.table(table).ok().and_then(|table| {
            let (_, value) = table.iter().find(|(name, _)| name.get_ref() == key)?;
            Some(value.span())
        });
        Problem { key: key.to_owned(), span, text }
    }

    /// A path of `[run]`, relative to `folder`.
    pub fn path(&mut self, key: &str, value: &str, folder: &Path) -> PathBuf {
        if value.is_empty() {
            let problem = self.at_value("run", key, "must be given".to_owned());
            self.add("run", problem);
        }
        let path = folder.join(value);
        // Resolves symbolic links and `..`, so that one folder has one name.
        path.canonicalize().unwrap_or(path)
    }

    /// The refusal with these problems, if there are any. Problems without a position come first.
    pub fn into_refusal(mut self) -> Option<Refusal> {
        if self.problems.is_empty() {
            return None;
        }
        self.problems.sort_by_key(|problem| problem.span.as_ref().map(|span| span.start));
        self.problems.dedup();
        let problems = self.problems.iter().map(|problem| self.file.render(problem)).collect();
        Some(Refusal { problems, is_failure: self.has_failure })
    }
}
