//! Numbers of coordinate reference systems as users write them.

use super::registry;
use std::str::FromStr;

/// A projected system, and the system of its heights if one is named: `EPSG:25832`, `EPSG:25832+7837`, or the number of a compound system
/// of the registry such as `EPSG:7415`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CrsCode {
    /// EPSG number of the projected system.
    pub horizontal: u32,
    /// EPSG number of the vertical system.
    pub height: Option<u32>,
}

/// The text is not a number of the EPSG registry.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("EPSG:N or EPSG:N+M")]
pub struct InvalidCode;

impl FromStr for CrsCode {
    type Err = InvalidCode;

    fn from_str(text: &str) -> Result<Self, InvalidCode> {
        let prefix = text.get(..5).filter(|begin| begin.eq_ignore_ascii_case("epsg:"));
        let numbers = prefix.and(text.get(5..)).ok_or(InvalidCode)?;
        let number = |text: &str| {
            // `parse` accepts a sign.
            let is_number = text.starts_with(|digit: char| digit.is_ascii_digit());
            text.parse().ok().filter(|_| is_number).ok_or(InvalidCode)
        };
        let Some((horizontal, height)) = numbers.split_once('+') else {
            let epsg = number(numbers)?;
            return Ok(match registry::compound(epsg) {
                Some(parts) => Self { horizontal: parts.horizontal, height: Some(parts.height) },
                None => Self { horizontal: epsg, height: None },
            });
        };
        Ok(Self { horizontal: number(horizontal)?, height: Some(number(height)?) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heights_are_named_by_a_second_number_or_a_compound_system() {
        let code = |text: &str| text.parse::<CrsCode>().ok().map(|code| (code.horizontal, code.height));
        assert_eq!(code("epsg:2154"), Some((2154, None)));
        assert_eq!(code("EPSG:25832+7837"), Some((25_832, Some(7837))));
        assert_eq!(code("EPSG:7415"), Some((28_992, Some(5709))));
        for text in ["", "2154", "EPSG:", "EPSG:x", "EPSG:+5", "EPSG:1+", "EPSG:1+2+3", "EPSG:1++2", "é:4326"] {
            assert_eq!(code(text), None, "{text}");
        }
    }
}
