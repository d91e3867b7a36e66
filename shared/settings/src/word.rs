//! Words of settings as enums.

use serde::{Deserialize, Deserializer, de::Error};
use std::fmt::Debug;

/// An enum whose variants are words in launch.toml and on command lines. Implemented by [`words!`](crate::words!).
pub trait Word: Copy + Debug + Eq + 'static {
    /// All words in the order of their declaration.
    const ALL: &'static [Self];
    /// The word in launch.toml.
    fn word(self) -> &'static str;
    /// What the word means: the documentation of its variant, without the line breaks.
    fn meaning(self) -> &'static str;
    /// The variant of a word; `None` if there is no such word.
    fn from_word(word: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|known| known.word() == word)
    }
}

/// A word that the enum does not have.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("value {found:?} must be one of {known}")]
pub struct UnknownWord {
    /// Word found.
    pub found: String,
    /// The words of the enum.
    pub known: String,
}

/// All words of an enum: "a, b, c".
pub fn words_of<W: Word>() -> String {
    W::ALL.iter().map(|known| known.word()).collect::<Vec<_>>().join(", ")
}

/// The variant of a word. Used by [`words!`](crate::words!).
#[doc(hidden)]
pub fn parse_word<W: Word>(word: &str) -> Result<W, UnknownWord> {
    W::from_word(word).ok_or_else(|| UnknownWord { found: word.to_owned(), known: words_of::<W>() })
}

/// Deserializes a word. Used by [`words!`](crate::words!).
#[doc(hidden)]
pub fn deserialize_word<'de, W: Word, D: Deserializer<'de>>(deserializer: D) -> Result<W, D::Error> {
    parse_word(&String::deserialize(deserializer)?).map_err(D::Error::custom)
}

/// Declares the words of a setting as an enum. Each line: meaning as a doc comment, variant, word.
///
/// The enum can be a setting (rules [`one_word`](crate::one_word) and [`list_of_words`](crate::list_of_words)), an option of a command
/// line (`FromStr`, `Display`) and a value in a file (`Serialize`, `Deserialize`: the word).
///
/// ```
/// settings::words! {
///     /// Frame of the clouds.
///     pub enum Frame {
///         /// Corrected at the end of the drive.
///         World = "world",
///         /// Never corrected.
///         Odom = "odom",
///     }
/// }
/// settings::settings! {
///     /// Settings of the example.
///     pub struct Settings {
///         /// Frame of the clouds.
///         pub frame: Frame = Frame::World => settings::one_word();
///     }
/// }
/// fn is_corrected(frame: Frame) -> bool {
///     match frame {
///         Frame::World => true,
///         Frame::Odom => false,
///     }
/// }
/// assert!(is_corrected(Settings::default().frame));
/// assert_eq!(<Settings as settings::Settings>::fields()[0].rule, "must be one of world, odom");
/// ```
///
/// A word that is not handled does not compile:
///
/// ```compile_fail,E0004
/// settings::words! {
///     /// Frame of the clouds.
///     pub enum Frame {
///         /// Corrected at the end of the drive.
///         World = "world",
///         /// Never corrected.
///         Odom = "odom",
///         /// Easting and northing.
///         Utm = "utm",
///     }
/// }
/// fn is_corrected(frame: Frame) -> bool {
///     match frame {
///         Frame::World => true,
///         Frame::Odom => false,
///     }
/// }
/// ```
#[macro_export]
macro_rules! words {
    ($(#[$meta:meta])* $visibility:vis enum $name:ident {
        $( $(#[$($attribute:tt)*])* $variant:ident = $word:literal, )+
    }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        $visibility enum $name { $( $(#[$($attribute)*])* $variant, )+ }

        impl $crate::Word for $name {
            const ALL: &'static [Self] = &[$( Self::$variant, )+];
            fn word(self) -> &'static str {
                match self { $( Self::$variant => $word, )+ }
            }
            fn meaning(self) -> &'static str {
                match self { $( Self::$variant => $crate::word_meaning!($(#[$($attribute)*])*).trim_ascii(), )+ }
            }
        }

        impl ::std::fmt::Display for $name {
            fn fmt(&self, f: &mut ::std::fmt::Formatter<'_>) -> ::std::fmt::Result {
                f.write_str($crate::Word::word(*self))
            }
        }

        impl ::std::str::FromStr for $name {
            type Err = $crate::UnknownWord;
            fn from_str(word: &str) -> Result<Self, $crate::UnknownWord> {
                $crate::parse_word(word)
            }
        }

        impl $crate::serde::Serialize for $name {
            fn serialize<S: $crate::serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                serializer.serialize_str($crate::Word::word(*self))
            }
        }

        impl<'de> $crate::serde::Deserialize<'de> for $name {
            fn deserialize<D: $crate::serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                $crate::deserialize_word(deserializer)
            }
        }
    };
}

/// The text of the doc comments among attributes. Used by [`words!`].
#[doc(hidden)]
#[macro_export]
macro_rules! word_meaning {
    () => { "" };
    (#[doc = $text:literal] $($rest:tt)*) => { concat!($text, $crate::word_meaning!($($rest)*)) };
    (#[$($other:tt)*] $($rest:tt)*) => { $crate::word_meaning!($($rest)*) };
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Settings as _, parse_table};
    use toml::de::DeTable;

    crate::words! {
        /// Sensors of the test.
        #[derive(Default)]
        pub enum Sensor {
            /// Inertial samples,
            /// 100 a second.
            #[default]
            Imu = "imu",
            /// Fixes.
            Gnss = "gnss",
        }
    }
    crate::settings! {
        /// Settings of the test.
        pub struct Settings {
            /// The first one.
            pub first: Sensor = Sensor::Imu => crate::one_word();
            /// All of them.
            pub all: Vec<Sensor> = vec![Sensor::Gnss] => crate::list_of_words();
        }
    }

    fn parse(text: &str) -> Result<Settings, Vec<String>> {
        let table = DeTable::parse(text).expect("TOML");
        let (settings, problems) = parse_table::<Settings>(table.get_ref());
        if problems.is_empty() { Ok(settings) } else { Err(problems.into_iter().map(|problem| problem.text).collect()) }
    }

    #[test]
    fn rule_of_an_enum_lists_all_words_and_the_type_stays_a_string() {
        let fields = Settings::fields();
        assert_eq!(fields[0].rule, "must be one of imu, gnss");
        assert_eq!(fields[1].rule, "must be a list out of imu, gnss");
        assert_eq!((fields[0].kind.as_str(), fields[1].kind.as_str()), ("String", "Vec<String>"));
        assert_eq!((fields[0].default.as_str(), fields[1].default.as_str()), ("\"imu\"", "[\"gnss\"]"));
    }

    #[test]
    fn words_are_read_and_unknown_words_and_types_are_refused_with_the_rule() {
        let read = parse("first = 'gnss'\nall = ['imu', 'gnss']").expect("valid");
        assert_eq!(read, Settings { first: Sensor::Gnss, all: vec![Sensor::Imu, Sensor::Gnss] });
        let refused = parse("first = 'gps'\nall = ['imu', 'gps']").expect_err("refused");
        assert!(refused.contains(&"value \"gps\" must be one of imu, gnss".to_owned()), "{refused:?}");
        assert!(
            refused.contains(&"value [\"imu\", \"gps\"] must be a list out of imu, gnss".to_owned()),
            "{refused:?}"
        );
        let refused = parse("first = 3").expect_err("refused");
        assert_eq!(refused, ["invalid type: integer `3`, expected a string (value 3)"]);
    }

    #[test]
    fn word_has_its_meaning_and_is_the_same_in_files_and_on_command_lines() {
        assert_eq!(Sensor::default().meaning(), "Inertial samples, 100 a second.");
        for sensor in Sensor::ALL {
            let text = serde_json::to_string(sensor).expect("JSON");
            assert_eq!(text, format!("\"{sensor}\""));
            assert_eq!(serde_json::from_str::<Sensor>(&text).expect("JSON"), *sensor);
            assert_eq!(sensor.to_string().parse(), Ok(*sensor));
        }
        let error = "gps".parse::<Sensor>().expect_err("unknown").to_string();
        assert_eq!(error, "value \"gps\" must be one of imu, gnss");
    }
}
