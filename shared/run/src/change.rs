//! Changes of a launch file on the command line.

use serde::{Deserialize, Serialize};
use std::fmt;

/// A change of a launch file: `--set` or `--unset` of a command line, or a part of a swap.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Change {
    /// Sets a key to a value.
    Set {
        /// Its table.
        table: String,
        /// The key.
        key: String,
        /// The value as TOML or as bare text: `drives/a` needs no quotes.
        value: String,
    },
    /// Removes a key that the launch file sets, so that its default applies.
    Unset {
        /// Its table.
        table: String,
        /// The key.
        key: String,
    },
}

/// A command-line text that is not a change.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ChangeError {
    /// Invalid text after `--set`.
    #[error("must have the form TABLE.KEY=VALUE")]
    Set,
    /// Invalid text after `--unset`.
    #[error("must have the form TABLE.KEY")]
    Unset,
}

impl Change {
    /// The change of `--set TABLE.KEY=VALUE`.
    pub fn set(text: &str) -> Result<Self, ChangeError> {
        let (path, value) = text.split_once('=').ok_or(ChangeError::Set)?;
        let (table, key) = path.trim().split_once('.').ok_or(ChangeError::Set)?;
        Ok(Self::Set { table: table.to_owned(), key: key.to_owned(), value: value.trim().to_owned() })
    }

    /// The change of `--unset TABLE.KEY`.
    pub fn unset(text: &str) -> Result<Self, ChangeError> {
        let (table, key) = text.trim().split_once('.').ok_or(ChangeError::Unset)?;
        Ok(Self::Unset { table: table.to_owned(), key: key.to_owned() })
    }

    /// The table that it changes.
    pub fn table(&self) -> &str {
        let (Self::Set { table, .. } | Self::Unset { table, .. }) = self;
        table
    }

    /// `TABLE.KEY`.
    pub fn path(&self) -> String {
        let (Self::Set { table, key, .. } | Self::Unset { table, key }) = self;
        format!("{table}.{key}")
    }

    /// The option of the command line, and its value.
    pub fn option(&self) -> (&'static str, String) {
        match self {
            Self::Set { value, .. } => ("--set", format!("{}={value}", self.path())),
            Self::Unset { .. } => ("--unset", self.path()),
        }
    }
}

/// The option as on the command line: `--set TABLE.KEY=VALUE`.
impl fmt::Display for Change {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (option, value) = self.option();
        write!(f, "{option} {value}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn change_round_trips_through_its_option_and_through_files() {
        let set = Change::set("run.drive = drives/a=b").expect("valid");
        let expected = Change::Set { table: "run".into(), key: "drive".into(), value: "drives/a=b".into() };
        assert_eq!((&set, set.to_string().as_str()), (&expected, "--set run.drive=drives/a=b"));
        let unset = Change::unset("infer.model").expect("valid");
        assert_eq!(unset, Change::Unset { table: "infer".into(), key: "model".into() });
        assert_eq!(unset.option(), ("--unset", "infer.model".to_owned()));
        for change in [set, unset] {
            let text = serde_json::to_string(&change).expect("JSON");
            assert_eq!(serde_json::from_str::<Change>(&text).expect("JSON"), change);
            let bytes = postcard::to_stdvec(&change).expect("bytes");
            assert_eq!(postcard::from_bytes::<Change>(&bytes).expect("a change"), change);
        }
    }

    #[test]
    fn text_of_another_form_is_refused() {
        assert_eq!(Change::set("nonsense"), Err(ChangeError::Set));
        assert_eq!(Change::set("run=3"), Err(ChangeError::Set));
        assert_eq!(Change::set("!infer.model"), Err(ChangeError::Set), "a key is removed by --unset");
        assert_eq!(Change::unset("infer"), Err(ChangeError::Unset));
    }
}
