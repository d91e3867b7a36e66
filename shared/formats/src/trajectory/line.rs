//! Fields of a line: numbers, stamps, rotations.

use geometry::{Quaternion, Stamp, UnitQuaternion};
use std::str::FromStr;

/// How far a quaternion's norm or a matrix may be from a rotation: files carry as few as 6 digits.
pub const ROTATION_TOLERANCE: f64 = 1e-3;

/// Lines with something on them that is no comment (`#`), numbered from 1.
pub fn content_lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let lines = text.lines().enumerate().map(|(index, line)| (index + 1, line.trim()));
    lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
}

/// Exactly `N` finite numbers between blanks.
pub fn parse_numbers<const N: usize>(fields: &str) -> Result<[f64; N], String> {
    let mut numbers = [0.0; N];
    let mut fields = fields.split_ascii_whitespace();
    for (index, number) in numbers.iter_mut().enumerate() {
        let field = fields.next().ok_or_else(|| format!("{index} numbers, must be {N}"))?;
        *number = parse_number(field)?;
    }
    match fields.next() {
        None => Ok(numbers),
        Some(field) => Err(format!("{field:?} follows after {N} numbers")),
    }
}

/// A finite number.
pub fn parse_number(field: &str) -> Result<f64, String> {
    let value = f64::from_str(field).ok().filter(|value| value.is_finite());
    value.ok_or_else(|| format!("{field:?} is no number"))
}

/// Seconds with any number of decimals; exact to the nanosecond, which f64 would not be. Further decimals are cut. With an
/// exponent, as `numpy` writes them: exact to what f64 holds.
pub fn parse_stamp(field: &str) -> Result<Stamp, String> {
    seconds(field).ok_or_else(|| format!("{field:?} is no time in seconds"))
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

/// The rotation of a quaternion x y z w whose norm is 1 to [`ROTATION_TOLERANCE`]; keeps the bits of one that is a unit as
/// well as f64 can say it.
pub fn rotation([x, y, z, w]: [f64; 4]) -> Result<UnitQuaternion<f64>, String> {
    let quaternion = Quaternion::new(w, x, y, z);
    let norm = quaternion.norm();
    if (norm - 1.0).abs() > ROTATION_TOLERANCE {
        return Err(format!("quaternion {x} {y} {z} {w} has norm {norm}, must be 1"));
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
    fn stamps_are_exact() {
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
