//! Settings of a stage: declared once, with type, default, rule and meaning; checked with every problem at once.

#[doc(hidden)]
pub use {serde, toml};

use serde::{Deserialize, Serialize, de::DeserializeOwned};
use std::fmt::{Debug, Display};
use std::ops::Range;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// One setting as `--describe` shows it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Field {
    /// Key in launch.toml.
    pub key: String,
    /// Type, as Rust writes it.
    pub kind: String,
    /// Value if absent, as TOML writes it.
    pub default: String,
    /// What values are allowed.
    pub rule: String,
    /// What it is for, with its unit.
    pub meaning: String,
}

/// A problem of a launch file or of a file that it names.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Problem {
    /// Key it is about, `table.key`.
    pub key: String,
    /// Byte range in the launch file, if the key or value stands there.
    pub span: Option<Range<usize>>,
    /// Value and rule in words.
    pub text: String,
}

impl Problem {
    /// A problem with the setting `key` of the stage. The caller adds table and place.
    pub fn of_key(key: &str, text: impl Into<String>) -> Self {
        Self { key: key.to_owned(), span: None, text: text.into() }
    }
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
    /// It has another type.
    #[error("{expected} (value {shown})")]
    Type {
        /// As found.
        shown: String,
        /// What was expected instead.
        expected: String,
    },
    /// It breaks the rule of the setting.
    #[error("value {shown} {rule}")]
    Rule {
        /// As found.
        shown: String,
        /// "must be …".
        rule: String,
    },
    /// Another rule, of settings that are not declared by [`settings!`](crate::settings!).
    #[error("{0}")]
    Other(String),
}

/// Which values a setting may have.
pub trait Rule<T: ?Sized> {
    /// Whether `value` is allowed.
    fn allows(&self, value: &T) -> bool;
    /// The rule in words: "must be …".
    fn text(&self) -> String;
}

struct AnyValue;
struct Within<T>(T, T);
struct ZeroOrWithin(f64, f64);
struct AtLeast<T>(T);
struct OneOf(&'static [&'static str]);
struct EachOneOf(&'static [&'static str]);

/// Every value of the type.
pub fn any<T>() -> impl Rule<T> {
    AnyValue
}
/// From `low` to `high`, both included. NaN is outside.
pub fn within<T: PartialOrd + Display>(low: T, high: T) -> impl Rule<T> {
    Within(low, high)
}
/// 0, or from `low` to `high`, both included.
pub fn zero_or_within(low: f64, high: f64) -> impl Rule<f64> {
    ZeroOrWithin(low, high)
}
/// `low` and above.
pub fn at_least<T: PartialOrd + Display>(low: T) -> impl Rule<T> {
    AtLeast(low)
}
/// One of these words.
pub fn one_of(words: &'static [&'static str]) -> impl Rule<String> {
    OneOf(words)
}
/// A list of these words.
pub fn each_one_of(words: &'static [&'static str]) -> impl Rule<Vec<String>> {
    EachOneOf(words)
}

impl<T: ?Sized> Rule<T> for AnyValue {
    fn allows(&self, _value: &T) -> bool {
        true
    }
    fn text(&self) -> String {
        String::new()
    }
}
impl<T: PartialOrd + Display> Rule<T> for Within<T> {
    fn allows(&self, value: &T) -> bool {
        *value >= self.0 && *value <= self.1
    }
    fn text(&self) -> String {
        format!("must be between {} and {}", self.0, self.1)
    }
}
impl Rule<f64> for ZeroOrWithin {
    fn allows(&self, value: &f64) -> bool {
        *value == 0.0 || *value >= self.0 && *value <= self.1
    }
    fn text(&self) -> String {
        format!("must be 0 or between {} and {}", self.0, self.1)
    }
}
impl<T: PartialOrd + Display> Rule<T> for AtLeast<T> {
    fn allows(&self, value: &T) -> bool {
        *value >= self.0
    }
    fn text(&self) -> String {
        format!("must be at least {}", self.0)
    }
}
impl Rule<String> for OneOf {
    fn allows(&self, value: &String) -> bool {
        self.0.contains(&value.as_str())
    }
    fn text(&self) -> String {
        format!("must be one of {}", self.0.join(", "))
    }
}
impl Rule<Vec<String>> for EachOneOf {
    fn allows(&self, values: &Vec<String>) -> bool {
        values.iter().all(|value| self.0.contains(&value.as_str()))
    }
    fn text(&self) -> String {
        format!("must be a list out of {}", self.0.join(", "))
    }
}

/// Reads one value and checks its rule. Used by [`settings!`](crate::settings!).
#[doc(hidden)]
pub fn read_value<T: DeserializeOwned>(value: Spanned<DeValue<'_>>, rule: &dyn Rule<T>) -> Result<T, SettingError> {
    let shown = shown(value.get_ref());
    match T::deserialize(serde::de::IntoDeserializer::into_deserializer(value)) {
        Ok(value) if rule.allows(&value) => Ok(value),
        Ok(_) => Err(SettingError::Rule { shown, rule: rule.text() }),
        Err(error) => Err(SettingError::Type { shown, expected: error.message().trim_end().to_owned() }),
    }
}

fn shown(value: &DeValue<'_>) -> String {
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

/// Unknown keys of a table that are reported one by one; a person reads no more.
const MAX_UNKNOWN: usize = 20;
/// Longer keys are not compared with known ones.
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

/// Declares a stage's settings. Each line: meaning as a doc comment, key, type, default, rule.
///
/// ```
/// settings::settings! {
///     /// Settings of the example.
///     pub struct Settings {
///         /// Length of a submap along the path, m.
///         pub submap_m: f64 = 20.0 => settings::within(1.0, 1000.0);
///         /// What to write.
///         pub formats: Vec<String> = vec!["ply".to_owned()] => settings::each_one_of(&["ply", "las"]);
///     }
/// }
/// let table = toml::de::DeTable::parse("submap_m = 2000.0\nformat = []").unwrap();
/// let (_, problems) = settings::parse_table::<Settings>(table.get_ref());
/// assert_eq!(problems.len(), 2);
/// ```
#[macro_export]
macro_rules! settings {
    ($(#[$meta:meta])* pub struct $name:ident {
        $( $(#[doc = $meaning:literal])* pub $key:ident: $kind:ty = $default:expr => $rule:expr; )*
    }) => {
        $(#[$meta])*
        #[derive(Clone, Debug, PartialEq)]
        pub struct $name { $( $(#[doc = $meaning])* pub $key: $kind, )* }

        impl Default for $name {
            fn default() -> Self {
                Self { $( $key: $default, )* }
            }
        }

        // Written out: the derive would have to name the crate through which the caller knows serde.
        impl $crate::serde::Serialize for $name {
            fn serialize<S: $crate::serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                use $crate::serde::ser::SerializeMap;
                #[allow(unused_mut, reason = "a stage without settings has nothing to write")]
                let mut map = serializer.serialize_map(None)?;
                $( map.serialize_entry(stringify!($key), &self.$key)?; )*
                map.end()
            }
        }

        impl $crate::Settings for $name {
            fn fields() -> Vec<$crate::Field> {
                vec![$({
                    let default: $kind = $default;
                    let rule: &dyn $crate::Rule<$kind> = &$rule;
                    $crate::Field {
                        key: stringify!($key).to_owned(),
                        kind: stringify!($kind).replace(' ', ""),
                        default: $crate::default_text(&default),
                        rule: rule.text(),
                        meaning: [$($meaning),*].join("").trim().to_owned(),
                    }
                }),*]
            }

            #[allow(unused_variables, reason = "a stage without settings has nothing to set")]
            fn set(
                &mut self,
                key: &str,
                value: $crate::toml::Spanned<$crate::toml::de::DeValue<'_>>,
            ) -> Option<Result<(), $crate::SettingError>> {
                match key {
                    $( stringify!($key) => Some($crate::read_value::<$kind>(value, &$rule).map(|value| self.$key = value)), )*
                    _ => None,
                }
            }
        }
    };
}
