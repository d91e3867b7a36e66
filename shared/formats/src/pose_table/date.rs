//! Dates with times, as `2020-10-13 16:03:08.029` or `2020-10-13-16-03-08-029`.

use files::calendar::days_from_date;

/// Nanoseconds since 1970 of a date and time without zone. A seventh group of digits are decimals of the second.
pub(super) fn nanos(text: &str) -> Option<i64> {
    let text = text.trim().trim_end_matches('Z');
    let groups: Vec<&str> = text.split(|c: char| !c.is_ascii_digit()).filter(|group| !group.is_empty()).collect();
    if !(6..=7).contains(&groups.len()) || groups[0].len() != 4 {
        return None;
    }
    let number = |index: usize| groups[index].parse::<i64>().ok();
    let [year, month, day, hour, minute, second] =
        [number(0)?, number(1)?, number(2)?, number(3)?, number(4)?, number(5)?];
    let days = days_from_date(year, month, day)?;
    let is_time = hour < 24 && minute < 60 && second < 61;
    let decimals = groups.get(6).copied().unwrap_or("0");
    let nanos: i64 = format!("{decimals:0<9.9}").parse().ok()?;
    is_time.then(|| (days * 86_400 + hour * 3600 + minute * 60 + second) * 1_000_000_000 + nanos)
}
