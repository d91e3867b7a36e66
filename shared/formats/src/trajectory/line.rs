//! Fields of a line: numbers, stamps, rotations.

use super::PoseFault;
use geometry::{Quaternion, Stamp, UnitQuaternion};
use std::str::FromStr;

/// Tolerance of a rotation: files may have as few as 6 digits.
pub const ROTATION_TOLERANCE: f64 = 1e-3;

/// Lines that are neither empty nor comments (`#`), with their numbers from 1.
pub fn content_lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let lines = text.lines().enumerate().map(|(index, line)| (index + 1, line.trim()));
    lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
}

/// Parses exactly `N` finite numbers separated by blanks.
pub fn parse_numbers<const N: usize>(fields: &str) -> Result<[f64; N], PoseFault> {
    let mut numbers = [0.0; N];
    let mut fields = fields.split_ascii_whitespace();
    for (index, number) in numbers.iter_mut().enumerate() {
        let field = fields.next().ok_or(PoseFault::TooFewNumbers { found: index, expected: N })?;
        *number = finite(field).ok_or_else(|| PoseFault::Number { found: field.to_owned() })?;
    }
    match fields.next() {
        None => Ok(numbers),
        Some(field) => Err(PoseFault::ExtraField { found: field.to_owned(), expected: N }),
    }
}

/// Parses a finite number.
pub fn finite(field: &str) -> Option<f64> {
    f64::from_str(field).ok().filter(|value| value.is_finite())
}

/// Parses seconds with any number of decimals, exact to the nanosecond, unlike f64. Further decimals are truncated.
/// Numbers with an exponent, as written by `numpy`, have the precision of f64.
pub fn parse_stamp(field: &str) -> Result<Stamp, PoseFault> {
    seconds(field).ok_or_else(|| PoseFault::Seconds { found: field.to_owned() })
}

/// Nanoseconds of a number of seconds, as in a line of TUM.
pub fn nanos_from_seconds(field: &str) -> Option<i64> {
    seconds(field).map(|stamp| stamp.0)
}

fn seconds(field: &str) -> Option<Stamp> {
    if field.contains(['e', 'E']) {
        let seconds: f64 = field.parse().ok()?;
        return (seconds.abs() < 9e9).then(|| Stamp::from_seconds(seconds));
    }
    let (negative, digits) = field.strip_prefix('-').map_or((false, field), |digits| (true, digits));
    let (whole, decimals) = digits.split_once('.').unwrap_or((digits, ""));
    let all_digits = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    if whole.is_empty() || !all_digits(whole) || !all_digits(decimals) {
        return None;
    }
    let nanos: i64 = format!("{decimals:0<9.9}").parse().ok()?;
    let stamp = whole.parse::<i64>().ok()?.checked_mul(1_000_000_000)?.checked_add(nanos)?;
    Some(Stamp(if negative { -stamp } else { stamp }))
}

/// The rotation of a quaternion x y z w with norm 1 within [`ROTATION_TOLERANCE`]. A quaternion of norm 1 within the precision of
/// f64 keeps its bits.
pub fn rotation([x, y, z, w]: [f64; 4]) -> Result<UnitQuaternion<f64>, PoseFault> {
    let quaternion = Quaternion::new(w, x, y, z);
    let norm = quaternion.norm();
    if (norm - 1.0).abs() > ROTATION_TOLERANCE {
        return Err(PoseFault::Quaternion { x, y, z, w, norm });
    }
    Ok(if (norm - 1.0).abs() < 1e-15 {
        UnitQuaternion::new_unchecked(quaternion)
    } else {
        UnitQuaternion::from_quaternion(quaternion)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stamps_are_exact_to_the_nanosecond() {
        for (text, nanos) in [
            ("0", 0),
            ("12.5", 12_500_000_000),
            ("1700000000.123456789", 1_700_000_000_123_456_789),
            ("1700000000.1234567899", 1_700_000_000_123_456_789),
            ("-0.000000001", -1),
            ("1.5e3", 1_500_000_000_000),
        ] {
            assert_eq!(parse_stamp(text), Ok(Stamp(nanos)), "{text}");
        }
        for text in ["", "-", ".5", "1.2.3", "nan", "0x1", "99999999999", "1e300", "1,5"] {
            assert!(parse_stamp(text).is_err(), "{text}");
        }
    }
}
