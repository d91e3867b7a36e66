//! GPS time and UTC.

/// Unix time of 1980-01-06, the epoch of GPS time, s.
const EPOCH_S: f64 = 315_964_800.0;
/// Unix time of 1980-01-06 in ns.
pub const EPOCH_NANOS: i64 = 315_964_800_000_000_000;

/// Unix times from which GPS time is ahead of UTC by 1, 2, … s (IERS Bulletin C; the last one is of 2017-01-01).
const LEAPS_S: [i64; 18] = [
    362_793_600,
    394_329_600,
    425_865_600,
    489_024_000,
    567_993_600,
    631_152_000,
    662_688_000,
    709_948_800,
    741_484_800,
    773_020_800,
    820_454_400,
    867_715_200,
    915_148_800,
    1_136_073_600,
    1_230_768_000,
    1_341_100_800,
    1_435_708_800,
    1_483_228_800,
];

/// Offset subtracted from GPS time so that a double resolves 0.1 µs (LAS 1.4 R15, "adjusted standard GPS time"), s.
const ADJUSTMENT_S: f64 = 1e9;
/// Seconds of a week.
const WEEK_S: f64 = 604_800.0;

/// GPS time, s since 1980-01-06, from seconds since the Unix epoch (UTC). Negative before 1980.
pub fn gps_from_unix(unix_s: f64) -> f64 {
    unix_s - EPOCH_S + leap_seconds_at_unix(unix_s) as f64
}

/// Seconds by which GPS time is ahead of UTC at a Unix time, s.
pub fn leap_seconds_at_unix(unix_s: f64) -> i64 {
    LEAPS_S.partition_point(|leap_s| *leap_s as f64 <= unix_s) as i64
}

/// Seconds by which GPS time is ahead of UTC at a GPS time, s since 1980-01-06.
fn leap_seconds_at_gps(gps_s: f64) -> u32 {
    // The n-th leap second makes GPS time n seconds ahead.
    let is_past = |n: usize, leap_s: i64| leap_s as f64 - EPOCH_S + n as f64 + 1.0 <= gps_s;
    LEAPS_S.iter().enumerate().take_while(|(n, leap_s)| is_past(*n, **leap_s)).count() as u32
}

/// Nanoseconds since the Unix epoch (UTC) from ns of GPS time since 1980-01-06. Exact.
pub fn unix_nanos_from_gps(gps_nanos: i64) -> i64 {
    let leaps = leap_seconds_at_gps(gps_nanos as f64 * 1e-9);
    gps_nanos + (EPOCH_S as i64 - i64::from(leaps)) * 1_000_000_000
}

/// Nanoseconds of a week.
pub const WEEK_NANOS: i64 = 604_800_000_000_000;

/// Adjusted standard GPS time, s, as in LAS files.
pub fn adjusted_gps_from_unix(unix_s: f64) -> f64 {
    gps_from_unix(unix_s) - ADJUSTMENT_S
}

/// Seconds of the GPS week, 0 to 604800.
pub fn week_seconds_from_unix(unix_s: f64) -> f64 {
    gps_from_unix(unix_s).rem_euclid(WEEK_S)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gps_time_counts_the_leap_seconds_since_1980() {
        // 2024-09-13T12:26:40Z, 18 leap seconds: second 476818 of week 2331.
        assert_eq!(gps_from_unix(1_726_230_400.0), 1_410_265_618.0);
        assert_eq!(adjusted_gps_from_unix(1_726_230_400.0), 410_265_618.0);
        assert_eq!(week_seconds_from_unix(1_726_230_400.0), 476_818.0);
        assert_eq!(gps_from_unix(315_964_800.0), 0.0);
        // The last second of 2016 was followed by a leap second.
        assert_eq!(gps_from_unix(1_483_228_800.0) - gps_from_unix(1_483_228_799.0), 2.0);
        assert_eq!(gps_from_unix(0.0), -315_964_800.0);
    }

    #[test]
    fn unix_time_from_gps_time_is_the_inverse() {
        for unix_s in [1_726_230_400_i64, 1_483_228_799, 1_483_228_800, 1_483_228_801, 362_793_600, 315_964_800] {
            let gps_nanos = gps_from_unix(unix_s as f64) as i64 * 1_000_000_000;
            assert_eq!(unix_nanos_from_gps(gps_nanos + 7), unix_s * 1_000_000_000 + 7);
        }
    }

    #[test]
    fn leap_seconds_are_at_the_begin_of_a_day() {
        assert!(LEAPS_S.iter().all(|leap_s| leap_s % 86_400 == 0) && LEAPS_S.is_sorted());
    }
}
