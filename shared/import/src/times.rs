//! Formats of times in text files.

use files::calendar::{DAY_NANOS, days_from_date};

/// KITTI odometry: seconds since the first sweep.
pub(crate) fn nanos_of_seconds(text: &str) -> Option<i64> {
    let seconds: f64 = text.parse().ok()?;
    (0.0..1e9).contains(&seconds).then(|| (seconds * 1e9).round() as i64)
}

/// KITTI raw: `2011-09-26 13:02:25.951199337`. The time zone is not given; UTC is assumed.
pub(crate) fn nanos_of_date(text: &str) -> Option<i64> {
    let (date, time) = text.split_once(' ')?;
    let [year, month, day] = numbers(date, '-')?;
    let (time, decimals) = time.split_once('.').unwrap_or((time, ""));
    let [hours, minutes, seconds] = numbers(time, ':')?;
    if hours > 23 || minutes > 59 || seconds > 60 || !decimals.bytes().all(|byte| byte.is_ascii_digit()) {
        return None;
    }
    let nanos: i64 = format!("{decimals:0<9.9}").parse().ok()?;
    let nanos_of_day = ((hours * 60 + minutes) * 60 + seconds) * 1_000_000_000 + nanos;
    // A stamp can represent the years 1678 to 2261.
    days_from_date(year, month, day)?.checked_mul(DAY_NANOS)?.checked_add(nanos_of_day)
}

fn numbers(text: &str, separator: char) -> Option<[i64; 3]> {
    let numbers: Option<Vec<i64>> = text.split(separator).map(|part| part.parse().ok().filter(|n| *n >= 0)).collect();
    numbers?.try_into().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_of_both_kitti_layouts_are_parsed() {
        assert_eq!(nanos_of_date("2011-09-26 13:02:25.951199337"), Some(1_317_042_145_951_199_337));
        assert_eq!(nanos_of_date("2011-02-30 13:02:25"), None);
        for year in ["011", "1676", "2263", "9223372036854775807"] {
            assert_eq!(nanos_of_date(&format!("{year}-09-26 13:02:25")), None, "{year}");
        }
        assert_eq!(nanos_of_seconds("1.037875e-01"), Some(103_787_500));
        assert_eq!(nanos_of_seconds("-1"), None);
    }
}
