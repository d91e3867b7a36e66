//! The results of a declaration: the description of each setting, and the values read from a table.

use serde::{Deserialize, Serialize};
use std::fmt::Debug;
use toml::Spanned;
use toml::de::DeValue;

/// One setting as `--describe` shows it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Field {
    /// Key in launch.toml.
    pub key: String,
    /// Type in Rust. Words are a `String`.
    pub kind: String,
    /// Default value in TOML.
    pub default: String,
    /// Rule for allowed values.
    pub rule: String,
    /// Purpose, with the unit.
    pub meaning: String,
}

/// Implemented by [`settings!`](crate::settings!).
pub trait Settings: Sized + Default + Debug + Serialize {
    /// All settings in the order of their declaration.
    fn fields() -> Vec<Field>;
    /// Sets `key` from `value`; the error says what was expected. `None`: there is no such key.
    fn set(&mut self, key: &str, value: Spanned<DeValue<'_>>) -> Option<Result<(), SettingError>>;
}

/// A value that a setting may not have.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SettingError {
    /// The value has another type.
    #[error("{expected} (value {shown})")]
    Type {
        /// Value found.
        shown: String,
        /// Type expected.
        expected: String,
    },
    /// The value breaks the rule of the setting.
    #[error("value {shown} {rule}")]
    Rule {
        /// Value found.
        shown: String,
        /// "must be …".
        rule: String,
    },
}

/// The value as launch.toml has it, for messages.
pub(crate) fn shown(value: &DeValue<'_>) -> String {
    match value {
        DeValue::String(text) => format!("{text:?}"),
        DeValue::Integer(number) => number.to_string(),
        DeValue::Float(number) => number.to_string(),
        DeValue::Boolean(flag) => flag.to_string(),
        DeValue::Datetime(datetime) => datetime.to_string(),
        DeValue::Array(items) => {
            let items: Vec<String> = items.iter().map(|item| self::shown(item.get_ref())).collect();
            format!("[{}]", items.join(", "))
        }
        DeValue::Table(_) => "a table".to_owned(),
    }
}

/// The value as launch.toml would write it. Used by [`settings!`](crate::settings!).
#[doc(hidden)]
pub fn default_text<T: Serialize + Debug>(value: &T) -> String {
    serde_json::to_string(value).unwrap_or_else(|_| format!("{value:?}"))
}
