//! Parsers of argument values.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use settings::{UnknownWord, Word};
use std::str::FromStr;

/// A value that breaks the rule of its argument.
#[derive(Debug, thiserror::Error)]
#[error("must be {0}")]
pub struct InvalidValue(pub &'static str);

/// The words of an enum, with their meanings.
pub fn words<W: Word + FromStr<Err = UnknownWord> + Send + Sync>() -> impl TypedValueParser<Value = W> {
    let words = W::ALL.iter().map(|word| PossibleValue::new(word.word()).help(word.meaning()));
    PossibleValuesParser::new(words).try_map(|word| word.parse::<W>())
}

/// A number that is not infinite.
pub fn finite(text: &str) -> Result<f64, InvalidValue> {
    text.parse().ok().filter(|value: &f64| value.is_finite()).ok_or(InvalidValue("a number"))
}

/// A number that is 0 or above.
pub fn not_negative(text: &str) -> Result<f64, InvalidValue> {
    finite(text).ok().filter(|value| *value >= 0.0).ok_or(InvalidValue("0 or above"))
}

/// A number above 0.
pub fn positive(text: &str) -> Result<f64, InvalidValue> {
    finite(text).ok().filter(|value| *value > 0.0).ok_or(InvalidValue("above 0"))
}

/// A percentage above 0.
pub fn percent(text: &str) -> Result<f64, InvalidValue> {
    positive(text).ok().filter(|value| *value <= 100.0).ok_or(InvalidValue("above 0, up to 100"))
}

/// A share of a whole.
pub fn share(text: &str) -> Result<f64, InvalidValue> {
    finite(text).ok().filter(|value| (0.0..=1.0).contains(value)).ok_or(InvalidValue("0 to 1"))
}

/// Left column, top row, width and height: four whole numbers.
pub fn rectangle<T: FromStr>(text: &str) -> Result<[T; 4], InvalidValue> {
    let numbers: Option<Vec<T>> = text.split(',').map(|number| number.trim().parse().ok()).collect();
    numbers.and_then(|numbers| numbers.try_into().ok()).ok_or(InvalidValue("four whole numbers X,Y,W,H"))
}

/// A command line with the arguments of one subcommand, for tests.
#[derive(clap::Parser)]
pub struct Cli<A: clap::Args> {
    /// The arguments.
    #[command(flatten)]
    pub args: A,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn value_outside_its_range_is_refused_with_the_rule() {
        for (parsed, rule) in [
            (finite("inf"), "must be a number"),
            (not_negative("-0.1"), "must be 0 or above"),
            (positive("0"), "must be above 0"),
            (percent("101"), "must be above 0, up to 100"),
        ] {
            assert_eq!(parsed.expect_err("is refused").to_string(), rule);
        }
        assert_eq!(rectangle::<u32>("1, 2,3,4").expect("is a rectangle"), [1, 2, 3, 4]);
        assert!(rectangle::<u32>("1,2,3").is_err() && rectangle::<u32>("1,2,3,-4").is_err());
    }
}
