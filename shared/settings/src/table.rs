//! Tables of launch.toml, parsed with all problems reported at once.

use crate::field::Settings;
use serde::{Deserialize, Serialize};
use std::ops::Range;
use toml::de::DeTable;

/// A problem of a launch file or of a file that it names.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Problem {
    /// Key of the problem, `table.key`.
    pub key: String,
    /// Byte range in the launch file, if the key or value is there.
    pub span: Option<Range<usize>>,
    /// Value and rule in words.
    pub text: String,
}

impl Problem {
    /// A problem with the setting `key` of the stage. The caller adds table and place.
    pub fn for_key(key: &str, text: impl Into<String>) -> Self {
        Self { key: key.to_owned(), span: None, text: text.into() }
    }
}

/// Unknown keys of a table that are reported one by one; more would not be read.
const MAX_UNKNOWN: usize = 20;
/// Largest length of a key that is compared with known ones.
const MAX_KEY_CHARS: usize = 100;

/// Reads a table into settings. All problems are reported, not only the first; of unknown keys the first 20.
pub fn parse_table<S: Settings>(table: &DeTable<'_>) -> (S, Vec<Problem>) {
    let mut settings = S::default();
    let mut problems = Vec::new();
    let mut n_unknown = 0;
    for (key, value) in table {
        let name = key.get_ref().as_ref();
        match settings.set(name, value.clone()) {
            Some(Ok(())) => {}
            Some(Err(error)) => {
                problems.push(Problem { key: name.to_owned(), span: Some(value.span()), text: error.to_string() });
            }
            None if n_unknown >= MAX_UNKNOWN => n_unknown += 1,
            None => {
                n_unknown += 1;
                let fields = S::fields();
                let known = fields.iter().map(|field| field.key.as_str());
                problems.push(Problem { key: name.to_owned(), span: Some(key.span()), text: nearest_key(name, known) });
            }
        }
    }
    if n_unknown > MAX_UNKNOWN {
        let text = format!("{} more unknown keys", n_unknown - MAX_UNKNOWN);
        problems.push(Problem { key: String::new(), span: None, text });
    }
    (settings, problems)
}

/// "unknown key", with the nearest known one.
pub fn nearest_key<'a>(name: &str, known: impl Iterator<Item = &'a str>) -> String {
    let known: Vec<&str> = known.collect();
    let comparable = known.iter().filter(|_| name.len() <= MAX_KEY_CHARS);
    let nearest = comparable.map(|candidate| (strsim::levenshtein(name, candidate), *candidate)).min();
    match nearest {
        Some((distance, candidate)) if distance <= 1 + candidate.len() / 3 => {
            format!("unknown key; did you mean `{candidate}`?")
        }
        _ if known.is_empty() => "unknown key; this table has no settings".to_owned(),
        _ => format!("unknown key; known are {}", known.join(", ")),
    }
}
