//! Conversion between dates and days since 1970 (H. Hinnant, "chrono-compatible low-level date algorithms"; eras of 400 years from 1 March).

/// Nanoseconds of a day.
pub const DAY_NANOS: i64 = 86_400_000_000_000;

/// Largest year of a date: the largest number of four digits.
const MAX_YEAR: i64 = 9999;

/// Days since 1970-01-01; `None` for dates that do not exist and for years other than 0 to 9999.
pub fn days_from_date(year: i64, month: i64, day: i64) -> Option<i64> {
    if !(0..=MAX_YEAR).contains(&year) || !(1..=12).contains(&month) || !(1..=31).contains(&day) {
        return None;
    }
    let y = if month <= 2 { year - 1 } else { year };
    let era = y.div_euclid(400);
    let year_of_era = y.rem_euclid(400);
    let day_of_year = (153 * ((month + 9) % 12) + 2) / 5 + day - 1;
    let day_of_era = year_of_era * 365 + year_of_era / 4 - year_of_era / 100 + day_of_year;
    let days = era * 146_097 + day_of_era - 719_468;
    // 31 April would convert back to 1 May.
    (date_from_days(days) == (year, month, day)).then_some(days)
}

/// Year, month and day of a number of days since 1970-01-01.
pub fn date_from_days(days: i64) -> (i64, i64, i64) {
    let z = days + 719_468;
    let era = z.div_euclid(146_097);
    let day_of_era = z.rem_euclid(146_097);
    let year_of_era = (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let shifted = (5 * day_of_year + 2) / 153;
    let month = if shifted < 10 { shifted + 3 } else { shifted - 9 };
    (year_of_era + era * 400 + i64::from(month <= 2), month, day_of_year - (153 * shifted + 2) / 5 + 1)
}

/// Date and time of a stamp in ns since 1970, to the millisecond: `2023-11-14 22:13:20.302 UTC`.
pub fn text_of_nanos(nanos: i64) -> String {
    let (year, month, day) = date_from_days(nanos.div_euclid(DAY_NANOS));
    let millis = nanos.rem_euclid(DAY_NANOS) / 1_000_000;
    let (seconds, millis) = (millis / 1000, millis % 1000);
    let (hours, minutes, seconds) = (seconds / 3600, seconds / 60 % 60, seconds % 60);
    format!("{year:04}-{month:02}-{day:02} {hours:02}:{minutes:02}:{seconds:02}.{millis:03} UTC")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stamps_are_written_as_dates() {
        assert_eq!(text_of_nanos(1_700_000_000_302_999_999), "2023-11-14 22:13:20.302 UTC");
        assert_eq!(text_of_nanos(-1_000_000), "1969-12-31 23:59:59.999 UTC");
    }

    #[test]
    fn every_day_of_two_centuries_converts_both_ways() {
        let mut expected = (1970, 1, 1);
        for days in 0..73_000 {
            assert_eq!(date_from_days(days), expected);
            assert_eq!(days_from_date(expected.0, expected.1, expected.2), Some(days));
            let (year, month, day) = expected;
            let leap = year % 4 == 0 && (year % 100 != 0 || year % 400 == 0);
            let length = [31, 28 + i64::from(leap), 31, 30, 31, 30, 31, 31, 30, 31, 30, 31][month as usize - 1];
            expected = match (day == length, month == 12) {
                (false, _) => (year, month, day + 1),
                (true, false) => (year, month + 1, 1),
                (true, true) => (year + 1, 1, 1),
            };
        }
        for (year, month, day) in [
            (2021, 2, 29),
            (2020, 4, 31),
            (2020, 0, 1),
            (2020, 13, 1),
            (2020, 1, 0),
            (10_000, 1, 1),
            (i64::MAX, 1, 1),
            (i64::MIN, 1, 1),
        ] {
            assert_eq!(days_from_date(year, month, day), None);
        }
    }
}
