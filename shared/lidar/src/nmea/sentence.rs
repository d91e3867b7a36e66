//! Parser of one sentence.

use super::{KNOT_MPS, checksum};
use files::calendar::{DAY_NANOS, days_from_date};
use geometry::Stamp;
use serde::{Deserialize, Serialize};

/// Heights of vehicles and aircraft, m: the shore of the Dead Sea is at -430 m, and receivers err by some hundred metres.
const MIN_HEIGHT_M: f64 = -1000.0;
const MAX_HEIGHT_M: f64 = 20_000.0;
/// Largest speed: 514 m/s, the limit of civil receivers.
const MAX_SPEED_KNOTS: f64 = 1000.0;

/// Error of a line that is not a valid sentence.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum NmeaError {
    /// The line does not have the form of a sentence.
    #[error("not a sentence; expected $...*hh")]
    Frame,
    /// The checksum is wrong.
    #[error("checksum {got:02X}, expected {expected:02X}")]
    Checksum {
        /// Checksum of the line.
        got: u8,
        /// Computed checksum.
        expected: u8,
    },
    /// A field has an impossible value.
    #[error("{sentence} field {field}: {value:?} {rule}")]
    Field {
        /// GGA or RMC.
        sentence: &'static str,
        /// Number of the field, from 1 after the name.
        field: usize,
        /// Text found.
        value: String,
        /// Values allowed.
        rule: &'static str,
    },
}

/// A parsed sentence.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sentence {
    /// Position and quality.
    Gga(Gga),
    /// Date and motion.
    Rmc(Rmc),
    /// Any other sentence.
    Other,
}

/// GGA sentence. Empty fields are `None`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Gga {
    /// Time of day (UTC), ns since midnight.
    pub time_nanos: Option<i64>,
    /// Latitude and longitude, WGS84, deg, north and east positive.
    pub position_deg: Option<[f64; 2]>,
    /// Quality: 0 none, 1 single, 2 differential, 4 RTK fixed, 5 RTK float.
    pub quality: u32,
    /// Satellites in use.
    pub satellites: u32,
    /// Horizontal dilution of precision.
    pub hdop: Option<f64>,
    /// Height above the geoid, m.
    pub height_m: Option<f64>,
    /// Height of the geoid above the ellipsoid, m.
    pub geoid_m: Option<f64>,
}

/// RMC sentence. Empty fields are `None`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Rmc {
    /// Date and time (UTC).
    pub stamp: Option<Stamp>,
    /// Whether the receiver reports a valid position (status A).
    pub is_valid: bool,
    /// Latitude and longitude, WGS84, deg, north and east positive.
    pub position_deg: Option<[f64; 2]>,
    /// Speed over ground.
    pub speed_mps: Option<f64>,
    /// Course over ground, deg clockwise from north.
    pub course_deg: Option<f64>,
}

/// Parses one line.
pub fn parse(line: &str) -> Result<Sentence, NmeaError> {
    let line = line.trim();
    let (body, sum) = line.strip_prefix('$').and_then(|rest| rest.rsplit_once('*')).ok_or(NmeaError::Frame)?;
    if !sum.is_ascii() || sum.len() != 2 || !body.is_ascii() {
        return Err(NmeaError::Frame);
    }
    let got = u8::from_str_radix(sum, 16).map_err(|_| NmeaError::Frame)?;
    let expected = checksum(body);
    if got != expected {
        return Err(NmeaError::Checksum { got, expected });
    }
    let (name, fields) = body.split_once(',').unwrap_or((body, ""));
    // Two letters name the talker (GP, GL, GN …), three letters the type.
    match name.get(2..) {
        Some("GGA") => gga(&Fields::new("GGA", fields)).map(Sentence::Gga),
        Some("RMC") => rmc(&Fields::new("RMC", fields)).map(Sentence::Rmc),
        _ => Ok(Sentence::Other),
    }
}

fn gga(fields: &Fields<'_>) -> Result<Gga, NmeaError> {
    Ok(Gga {
        time_nanos: fields.time(1)?,
        position_deg: fields.position(2)?,
        quality: fields.count(6)?.unwrap_or_default(),
        satellites: fields.count(7)?.unwrap_or_default(),
        hdop: fields.number(8, 0.0, 1000.0)?,
        height_m: fields.number(9, MIN_HEIGHT_M, MAX_HEIGHT_M)?,
        geoid_m: fields.number(11, -200.0, 200.0)?,
    })
}

fn rmc(fields: &Fields<'_>) -> Result<Rmc, NmeaError> {
    let stamp = match (fields.time(1)?, fields.date(9)?) {
        (Some(time_nanos), Some(days)) => Some(Stamp(days * DAY_NANOS + time_nanos)),
        _ => None,
    };
    Ok(Rmc {
        stamp,
        is_valid: fields.text(2) == "A",
        position_deg: fields.position(3)?,
        speed_mps: fields.number(7, 0.0, MAX_SPEED_KNOTS)?.map(|knots| knots * KNOT_MPS),
        course_deg: fields.number(8, 0.0, 360.0)?,
    })
}

/// Fields of a sentence by number, from 1.
struct Fields<'a> {
    sentence: &'static str,
    fields: Vec<&'a str>,
}

impl<'a> Fields<'a> {
    fn new(sentence: &'static str, text: &'a str) -> Self {
        // Sentences have fewer fields. The limit bounds the memory of a damaged line.
        Self { sentence, fields: text.split(',').take(32).collect() }
    }
    fn text(&self, field: usize) -> &'a str {
        self.fields.get(field - 1).copied().unwrap_or_default()
    }
    fn fault(&self, field: usize, rule: &'static str) -> NmeaError {
        NmeaError::Field { sentence: self.sentence, field, value: self.text(field).to_owned(), rule }
    }
    fn count(&self, field: usize) -> Result<Option<u32>, NmeaError> {
        let text = self.text(field);
        if text.is_empty() {
            return Ok(None);
        }
        let count = text.parse().ok().filter(|count| *count < 1000);
        count.map(Some).ok_or_else(|| self.fault(field, "is not an integer below 1000"))
    }
    fn number(&self, field: usize, low: f64, high: f64) -> Result<Option<f64>, NmeaError> {
        let text = self.text(field);
        if text.is_empty() {
            return Ok(None);
        }
        let value = text.parse().ok().filter(|value| (low..=high).contains(value));
        value.map(Some).ok_or_else(|| self.fault(field, "is not a number in the possible range"))
    }
    /// Parses `hhmmss` or `hhmmss.sss…` to ns since midnight. A leap second counts as the next second.
    fn time(&self, field: usize) -> Result<Option<i64>, NmeaError> {
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
    fn date(&self, field: usize) -> Result<Option<i64>, NmeaError> {
        let text = self.text(field);
        if text.is_empty() {
            return Ok(None);
        }
        let days = pairs(text).and_then(|[day, month, year]| {
            days_from_date(if year >= 70 { 1900 + year } else { 2000 + year }, month, day)
        });
        days.map(Some).ok_or_else(|| self.fault(field, "is not a date ddmmyy"))
    }
    /// Parses four fields: latitude, N or S, longitude, E or W.
    fn position(&self, field: usize) -> Result<Option<[f64; 2]>, NmeaError> {
        let latitude = self.angle(field, 2, ["N", "S"], 90.0)?;
        let longitude = self.angle(field + 2, 3, ["E", "W"], 180.0)?;
        Ok(latitude.zip(longitude).map(|(latitude, longitude)| [latitude, longitude]))
    }
    /// Parses degrees with a fixed number of digits, then minutes with decimals. The next field is the hemisphere.
    fn angle(&self, field: usize, digits: usize, sides: [&str; 2], limit: f64) -> Result<Option<f64>, NmeaError> {
        let text = self.text(field);
        if text.is_empty() {
            return Ok(None);
        }
        let fault = |rule| self.fault(field, rule);
        let split = text.split_at_checked(digits).filter(|_| text.bytes().all(|b| b.is_ascii_digit() || b == b'.'));
        let (degrees, minutes) = split.ok_or_else(|| fault("is not degrees and minutes"))?;
        let value = degrees.parse::<f64>().ok().zip(minutes.parse::<f64>().ok().filter(|minutes| *minutes < 60.0));
        let value = value.map(|(degrees, minutes)| degrees + minutes / 60.0).filter(|value| *value <= limit);
        let value = value.ok_or_else(|| fault("is not degrees and minutes"))?;
        match sides.iter().position(|side| *side == self.text(field + 1)) {
            Some(side) => Ok(Some(if side == 0 { value } else { -value })),
            None => Err(self.fault(field + 1, "is not N or S, E or W")),
        }
    }
}

/// Splits six digits into three numbers.
fn pairs(text: &str) -> Option<[i64; 3]> {
    let digits: &[u8; 6] = text.as_bytes().try_into().ok()?;
    let pair = |at: usize| {
        let both = digits[at].is_ascii_digit() && digits[at + 1].is_ascii_digit();
        both.then(|| i64::from(digits[at] - b'0') * 10 + i64::from(digits[at + 1] - b'0'))
    };
    Some([pair(0)?, pair(2)?, pair(4)?])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sealed(body: &str) -> String {
        format!("${body}*{:02X}", checksum(body))
    }

    #[test]
    fn sentence_of_real_sensor_is_parsed() {
        // From a VLP-16's position packet.
        let line = "$GPRMC,214106,A,3707.8178,N,12139.2690,W,010.3,188.2,230715,013.8,E,D*05";
        let Ok(Sentence::Rmc(rmc)) = parse(line) else { panic!("no RMC") };
        assert_eq!(rmc.stamp, Some(Stamp(1_437_687_666_000_000_000)));
        assert!(rmc.is_valid);
        let [latitude, longitude] = rmc.position_deg.expect("has one");
        assert!((latitude - 37.130_296_67).abs() < 1e-8 && (longitude + 121.654_483_33).abs() < 1e-8);
        assert!((rmc.speed_mps.expect("has one") - 5.298_78).abs() < 1e-5);
        assert_eq!(rmc.course_deg, Some(188.2));
    }

    #[test]
    fn empty_fields_are_none_and_impossible_values_are_reported() {
        let Ok(Sentence::Gga(gga)) = parse(&sealed("GNGGA,,,,,,0,,,,,,,,")) else { panic!("no GGA") };
        assert_eq!((gga.time_nanos, gga.position_deg, gga.quality, gga.height_m), (None, None, 0, None));
        for (body, field) in [
            ("GPGGA,240000,,,,,1", 1),
            ("GPGGA,120000,9100.0,N,00000.0,E,1", 2),
            ("GPGGA,120000,4860.0,N,00000.0,E,1", 2),
            ("GPGGA,120000,4859.0,X,00000.0,E,1", 3),
            ("GPGGA,120000,4859.0,N,00000.0,E,x", 6),
            ("GPGGA,120000,4859.0,N,00000.0,E,1,8,1.0,20001,M,45,M,,", 9),
            ("GPGGA,120000,4859.0,N,00000.0,E,1,8,1.0,-1001,M,45,M,,", 9),
            ("GPGGA,120000,4859.0,N,00000.0,E,1,8,1.0,1e300,M,45,M,,", 9),
            ("GPRMC,120000,A,,,,,NaN,0,010120", 7),
            ("GPRMC,120000,A,,,,,1001,0,010120", 7),
            ("GPRMC,120000,A,,,,,1,0,310220", 9),
        ] {
            match parse(&sealed(body)) {
                Err(NmeaError::Field { field: named, .. }) => assert_eq!(named, field, "{body}"),
                other => panic!("{body}: {other:?}"),
            }
        }
        assert_eq!(parse("$GPGGA,,*00"), Err(NmeaError::Checksum { got: 0, expected: checksum("GPGGA,,") }));
        assert_eq!(parse("GPGGA,,*00"), Err(NmeaError::Frame));
        assert_eq!(parse(&sealed("GPGSV,1,1,00")), Ok(Sentence::Other));
    }

    #[test]
    fn years_of_two_digits_are_1970_to_2069() {
        let stamp = |date: &str| match parse(&sealed(&format!("GPRMC,000054.651,A,,,,,,,{date},,,A"))) {
            Ok(Sentence::Rmc(rmc)) => rmc.stamp.map(|stamp| stamp.0),
            other => panic!("{other:?}"),
        };
        // The clock of a sensor that started at 0.
        assert_eq!(stamp("010170"), Some(54_651_000_000));
        assert_eq!(stamp("060180"), Some(315_964_854_651_000_000));
        assert_eq!(stamp("311269"), Some(3_155_673_654_651_000_000));
    }
}
