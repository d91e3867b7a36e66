//! Rules for the values of a setting, with their texts.

use crate::field::{SettingError, shown};
use crate::word::{Word, words_of};
use serde::de::{DeserializeOwned, IntoDeserializer};
use std::fmt::Display;
use std::marker::PhantomData;
use toml::Spanned;
use toml::de::DeValue;

/// A rule for the values of a setting.
pub trait Rule<T> {
    /// Whether `value` is allowed.
    fn allows(&self, value: &T) -> bool;
    /// The rule in words: "must be …".
    fn text(&self) -> String;
    /// Type that `--describe` shows, if it differs from the type in Rust.
    fn kind(&self) -> Option<&'static str> {
        None
    }
    /// The value that a table gives the setting, if the rule allows it.
    fn read(&self, value: Spanned<DeValue<'_>>) -> Result<T, SettingError>
    where
        T: DeserializeOwned,
    {
        let shown = shown(value.get_ref());
        let value = deserialized(value)?;
        if self.allows(&value) { Ok(value) } else { Err(SettingError::Rule { shown, rule: self.text() }) }
    }
}

fn deserialized<T: DeserializeOwned>(value: Spanned<DeValue<'_>>) -> Result<T, SettingError> {
    let shown = shown(value.get_ref());
    T::deserialize(value.into_deserializer())
        .map_err(|error| SettingError::Type { shown, expected: error.message().trim_end().to_owned() })
}

struct AnyValue;
struct Within<T>(T, T);
struct ZeroOrWithin(f64, f64);
struct AtLeast<T>(T);
struct OneWord<W>(PhantomData<W>);
struct ListOfWords<W>(PhantomData<W>);
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
/// One of the words of an enum ([`words!`](crate::words!)).
pub fn one_word<W: Word>() -> impl Rule<W> {
    OneWord(PhantomData)
}
/// A list of words of an enum ([`words!`](crate::words!)).
pub fn list_of_words<W: Word>() -> impl Rule<Vec<W>> {
    ListOfWords(PhantomData)
}
/// One of the given words.
pub fn one_of(words: &'static [&'static str]) -> impl Rule<String> {
    OneOf(words)
}
/// A list of the given words.
pub fn each_one_of(words: &'static [&'static str]) -> impl Rule<Vec<String>> {
    EachOneOf(words)
}

impl<T> Rule<T> for AnyValue {
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
impl<W: Word> Rule<W> for OneWord<W> {
    fn allows(&self, _value: &W) -> bool {
        true
    }
    fn text(&self) -> String {
        format!("must be one of {}", words_of::<W>())
    }
    fn kind(&self) -> Option<&'static str> {
        Some("String")
    }
    fn read(&self, value: Spanned<DeValue<'_>>) -> Result<W, SettingError> {
        let shown = shown(value.get_ref());
        let word: String = deserialized(value)?;
        W::from_word(&word).ok_or_else(|| SettingError::Rule { shown, rule: self.text() })
    }
}
impl<W: Word> Rule<Vec<W>> for ListOfWords<W> {
    fn allows(&self, _values: &Vec<W>) -> bool {
        true
    }
    fn text(&self) -> String {
        format!("must be a list out of {}", words_of::<W>())
    }
    fn kind(&self) -> Option<&'static str> {
        Some("Vec<String>")
    }
    fn read(&self, value: Spanned<DeValue<'_>>) -> Result<Vec<W>, SettingError> {
        let shown = shown(value.get_ref());
        let words: Vec<String> = deserialized(value)?;
        let known: Option<Vec<W>> = words.iter().map(|word| W::from_word(word)).collect();
        known.ok_or_else(|| SettingError::Rule { shown, rule: self.text() })
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
