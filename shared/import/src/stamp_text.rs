//! Stamps as text: seconds with decimals, integers since 1970 in s, ms, µs or ns, dates.

use crate::times::nanos_of_date;

/// Integers of at least this many units since 1970 are of this century: ns, µs, ms.
const UNITS: [(i64, i64); 3] =
    [(100_000_000_000_000_000, 1), (100_000_000_000_000, 1000), (100_000_000_000, 1_000_000)];
/// Smallest number of whole seconds that is a time of this century.
const MIN_EPOCH_S: i64 = 946_684_800;
/// Largest number of seconds that fits in ns.
const MAX_S: i64 = 9_000_000_000;

/// The stamp of a text, ns. `None` for other texts and for small integers, whose unit is ambiguous.
pub(crate) fn nanos(text: &str) -> Option<i64> {
    if let Ok(number) = text.parse::<i64>() {
        let unit = UNITS.iter().find(|(least, _)| number >= *least).map(|(_, nanos)| *nanos);
        let unit = unit.or((MIN_EPOCH_S..MAX_S).contains(&number).then_some(1_000_000_000));
        return unit.and_then(|nanos| number.checked_mul(nanos));
    }
    seconds(text).or_else(|| scientific(text)).or_else(|| nanos_of_date(text))
}

/// The stamp in a file name without its extension: a stamp, or seconds and ns between underscores at its end.
pub(crate) fn nanos_of_name(stem: &str) -> Option<i64> {
    let mut words = stem.rsplit('_');
    let last = words.next()?;
    let before = words.next();
    let parts = before.and_then(|seconds| Some((seconds.parse::<i64>().ok()?, last.parse::<i64>().ok()?)));
    match parts {
        Some((s, nanos)) if (MIN_EPOCH_S..MAX_S).contains(&s) && (0..1_000_000_000).contains(&nanos) => {
            Some(s * 1_000_000_000 + nanos)
        }
        _ => nanos(last),
    }
}

/// A cell without white space and quotes around it.
pub(crate) fn unquoted(cell: &str) -> &str {
    let cell = cell.trim();
    let inner = ['"', '\''].iter().find_map(|quote| cell.strip_prefix(*quote)?.strip_suffix(*quote));
    inner.unwrap_or(cell).trim()
}

/// Parses decimal seconds exactly.
fn seconds(text: &str) -> Option<i64> {
    let (whole, decimals) = text.split_once('.')?;
    let are_digits = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    if whole.is_empty() || !are_digits(whole) || !are_digits(decimals) {
        return None;
    }
    let whole: i64 = whole.parse().ok().filter(|s| *s < MAX_S)?;
    let nanos: i64 = format!("{decimals:0<9.9}").parse().ok()?;
    Some(whole * 1_000_000_000 + nanos)
}

/// Parses seconds with an exponent, as written by KITTI. Their digits resolve the nanosecond only for small numbers.
fn scientific(text: &str) -> Option<i64> {
    let is_scientific = text.contains(['e', 'E']);
    let seconds: f64 = text.parse().ok().filter(|_| is_scientific)?;
    (0.0..MAX_S as f64).contains(&seconds).then(|| (seconds * 1e9).round() as i64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stamps_of_all_units_are_read_and_unclear_ones_are_not() {
        let expected = Some(1_583_836_591_182_590_976);
        for text in ["1583836591.182590976", "1583836591182590976"] {
            assert_eq!(nanos(text), expected, "{text}");
        }
        for name in ["cloud_1583836591_182590976", "1583836591.182590976", "scan_1583836591182590976"] {
            assert_eq!(nanos_of_name(name), expected, "{name}");
        }
        assert_eq!(nanos("1583836591182590"), Some(1_583_836_591_182_590_000));
        assert_eq!(nanos("1583836591182"), Some(1_583_836_591_182_000_000));
        assert_eq!(nanos("1583836591"), Some(1_583_836_591_000_000_000));
        assert_eq!(nanos("1.037e-01"), Some(103_700_000));
        assert_eq!(nanos("0.1"), Some(100_000_000));
        assert_eq!(nanos("2011-09-26 13:02:25.5"), Some(1_317_042_145_500_000_000));
        for text in ["", "0", "17", "-1.5", "nan", "1e300", "inf", "99999999999999999999", "a.b"] {
            assert_eq!(nanos(text), None, "{text}");
        }
        assert_eq!(nanos_of_name("000017"), None);
    }
}
