//! Fields of a sentence: numbers, times, dates and positions with their rules.

use super::NmeaError;
use files::calendar::days_from_date;

/// Fields of a sentence by number, from 1.
pub(super) struct Fields<'a> {
    sentence: &'static str,
    fields: Vec<&'a str>,
}

impl<'a> Fields<'a> {
    pub(super) fn new(sentence: &'static str, text: &'a str) -> Self {
        // Sentences have fewer fields. The limit bounds the memory of a damaged line.
        Self { sentence, fields: text.split(',').take(32).collect() }
    }
    /// Number of fields, up to the limit.
    pub(super) fn len(&self) -> usize {
        self.fields.len()
    }
    pub(super) fn text(&self, field: usize) -> &'a str {
        self.fields.get(field - 1).copied().unwrap_or_default()
    }
    fn fault(&self, field: usize, rule: &'static str) -> NmeaError {
        NmeaError::Field { sentence: self.sentence, field, value: self.text(field).to_owned(), rule }
    }
    pub(super) fn count(&self, field: usize) -> Result<Option<u32>, NmeaError> {
        let text = self.text(field);
        if text.is_empty() {
            return Ok(None);
        }
        let count = text.parse().ok().filter(|count| *count < 1000);
        count.map(Some).ok_or_else(|| self.fault(field, "is not an integer below 1000"))
    }
    pub(super) fn number(&self, field: usize, low: f64, high: f64) -> Result<Option<f64>, NmeaError> {
        let text = self.text(field);
        if text.is_empty() {
            return Ok(None);
        }
        let value = text.parse().ok().filter(|value| (low..=high).contains(value));
        value.map(Some).ok_or_else(|| self.fault(field, "is not a number in the possible range"))
    }
    /// Parses `hhmmss` or `hhmmss.sss…` to ns since midnight. A leap second counts as the next second.
    pub(super) fn time(&self, field: usize) -> Result<Option<i64>, NmeaError> {
        let text = self.text(field);
        if text.is_empty() {
            return Ok(None);
        }
        let (whole, decimals) = text.split_once('.').unwrap_or((text, ""));
        let fault = || self.fault(field, "is not a time hhmmss.sss");
        let [hours, minutes, seconds] = pairs(whole).ok_or_else(fault)?;
        if hours > 23 || minutes > 59 || seconds > 60 || !decimals.bytes().all(|byte| byte.is_ascii_digit()) {
            return Err(fault());
        }
        let nanos: i64 = format!("{decimals:0<9.9}").parse().map_err(|_| fault())?;
        Ok(Some(((hours * 60 + minutes) * 60 + seconds) * 1_000_000_000 + nanos))
    }
    /// Parses `ddmmyy` to days since 1970. Two-digit years are 1970, where clocks that were never set start, to 2069.
    pub(super) fn date(&self, field: usize) -> Result<Option<i64>, NmeaError> {
        let text = self.text(field);
        if text.is_empty() {
            return Ok(None);
        }
        let days = pairs(text).and_then(|[day, month, year]| {
            days_from_date(if year >= 70 { 1900 + year } else { 2000 + year }, month, day)
        });
        days.map(Some).ok_or_else(|| self.fault(field, "is not a date ddmmyy"))
    }
    /// Parses three fields, day, month and year of four digits, to days since 1970.
    pub(super) fn whole_date(&self, field: usize) -> Result<Option<i64>, NmeaError> {
        let [day, month, year] = [0, 1, 2].map(|offset| self.text(field + offset));
        if day.is_empty() && month.is_empty() && year.is_empty() {
            return Ok(None);
        }
        let number = |text: &str| text.parse::<u16>().ok().map(i64::from);
        let days = number(day).zip(number(month)).zip(number(year).filter(|year| (1970..2070).contains(year)));
        let days = days.and_then(|((day, month), year)| days_from_date(year, month, day));
        days.map(Some).ok_or_else(|| self.fault(field, "and the next two fields are not a date dd,mm,yyyy"))
    }
    /// Parses four fields: latitude, N or S, longitude, E or W.
    pub(super) fn position(&self, field: usize) -> Result<Option<[f64; 2]>, NmeaError> {
        let latitude = self.angle(field, ["N", "S"], 90.0)?;
        let longitude = self.angle(field + 2, ["E", "W"], 180.0)?;
        let Some((latitude, longitude)) = latitude.zip(longitude) else { return Ok(None) };
        // Degrees with decimals have so few digits. As degrees and minutes they would be in the Gulf of Guinea, off every coast.
        let is_decimal = latitude.n_whole_digits < 3 && longitude.n_whole_digits < 4;
        if is_decimal && [latitude.value, longitude.value] != [0.0; 2] {
            return Err(self.fault(field, "is degrees with decimals; it must be degrees and minutes ddmm.mm"));
        }
        Ok(Some([latitude.value, longitude.value]))
    }
    /// Parses degrees and minutes with decimals: the minutes start at the second digit before the point. Some receivers
    /// omit leading zeros of the degrees, and some the point. The next field is the hemisphere.
    fn angle(&self, field: usize, sides: [&str; 2], limit: f64) -> Result<Option<Angle>, NmeaError> {
        let text = self.text(field);
        if text.is_empty() {
            return Ok(None);
        }
        let whole = text.split_once('.').map_or(text, |(whole, _)| whole);
        let n_whole_digits = whole.len();
        let (degrees, minutes) = text.split_at(n_whole_digits.saturating_sub(2));
        let is_number = text.bytes().all(|byte| byte.is_ascii_digit() || byte == b'.');
        let degrees = if degrees.is_empty() { "0" } else { degrees };
        let value = degrees.parse::<f64>().ok().zip(minutes.parse::<f64>().ok()).filter(|_| is_number);
        let Some((degrees, minutes)) = value else {
            return Err(self.fault(field, "is not degrees and minutes ddmm.mm"));
        };
        if minutes >= 60.0 {
            return Err(self.fault(field, "is not degrees and minutes ddmm.mm: the minutes must be less than 60"));
        }
        let value = degrees + minutes / 60.0;
        if value > limit {
            let rule = if limit < 180.0 { "must be at most 90 degrees" } else { "must be at most 180 degrees" };
            return Err(self.fault(field, rule));
        }
        match sides.iter().position(|side| *side == self.text(field + 1)) {
            Some(side) => Ok(Some(Angle { value: if side == 0 { value } else { -value }, n_whole_digits })),
            None => Err(self.fault(field + 1, "is not N or S, E or W")),
        }
    }
}

/// A latitude or longitude, deg.
#[derive(Clone, Copy)]
struct Angle {
    value: f64,
    /// Digits before the point.
    n_whole_digits: usize,
}

/// Splits six digits into three numbers. Some receivers omit leading zeros.
fn pairs(text: &str) -> Option<[i64; 3]> {
    if text.is_empty() {
        return None;
    }
    let text = format!("{text:0>6}");
    let digits: &[u8; 6] = text.as_bytes().try_into().ok()?;
    let pair = |at: usize| {
        let both = digits[at].is_ascii_digit() && digits[at + 1].is_ascii_digit();
        both.then(|| i64::from(digits[at] - b'0') * 10 + i64::from(digits[at + 1] - b'0'))
    };
    Some([pair(0)?, pair(2)?, pair(4)?])
}
