//! Parser of one sentence, from `$` or `!` to its checksum.

use super::fields::Fields;
use super::{KNOT_MPS, MAX_GEOID_M, checksum};
use files::calendar::DAY_NANOS;
use geometry::Stamp;
use serde::{Deserialize, Serialize};

/// Heights of vehicles and aircraft, m: the shore of the Dead Sea is at -430 m, and receivers err by some hundred metres.
const MIN_HEIGHT_M: f64 = -1000.0;
const MAX_HEIGHT_M: f64 = 20_000.0;
/// Largest speed: 514 m/s, the limit of civil receivers.
const MAX_SPEED_KNOTS: f64 = 1000.0;

/// Largest standard deviation and dilution, in a sentence that is not damaged: receivers without a position state 10 000 km and 99.99.
const MAX_DEVIATION_M: f64 = 1e7;
const MAX_DILUTION: f64 = 1000.0;

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
    /// The sentence has no checksum and fewer fields than its type.
    #[error("{sentence} has no checksum and {n} fields; without checksum it must have {least}, or it is cut")]
    Cut {
        /// GGA, RMC, ZDA, GST or GSA.
        sentence: &'static str,
        /// Fields after the name.
        n: usize,
        /// Fields of a whole sentence.
        least: usize,
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
    /// Date and time.
    Zda(Zda),
    /// Standard deviations of the position.
    Gst(Gst),
    /// Dilutions of precision.
    Gsa(Gsa),
    /// Any other sentence.
    Other,
}

impl Sentence {
    /// Whether fixes and dates come from sentences of this type.
    pub(super) const fn has_time_or_position(&self) -> bool {
        matches!(self, Self::Gga(_) | Self::Rmc(_) | Self::Zda(_))
    }
}

/// GGA sentence. Empty fields are `None`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Gga {
    /// Time of day (UTC), ns since midnight.
    pub time_nanos: Option<i64>,
    /// Latitude and longitude, WGS84, deg, north and east positive; `None` without a fix.
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

/// ZDA sentence. Empty fields are `None`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Zda {
    /// Date and time (UTC).
    pub stamp: Option<Stamp>,
}

/// GST sentence. Empty fields are `None`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Gst {
    /// Time of day (UTC), ns since midnight.
    pub time_nanos: Option<i64>,
    /// Standard deviations, m.
    pub deviation: Option<StatedDeviation>,
}

/// Standard deviations that a receiver states for its position, m.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct StatedDeviation {
    /// Standard deviation along one horizontal axis: the root mean square of both.
    pub across_m: f64,
    /// Standard deviation in height.
    pub up_m: f64,
}

/// GSA sentence. Empty fields are `None`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Gsa {
    /// Vertical dilution of precision.
    pub vdop: Option<f64>,
}

/// RMC sentence. Empty fields are `None`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Rmc {
    /// Time of day (UTC), ns since midnight.
    pub time_nanos: Option<i64>,
    /// Date and time (UTC).
    pub stamp: Option<Stamp>,
    /// Whether the receiver reports a valid position (status A).
    pub is_valid: bool,
    /// Latitude and longitude, WGS84, deg, north and east positive; `None` without a fix.
    pub position_deg: Option<[f64; 2]>,
    /// Speed over ground.
    pub speed_mps: Option<f64>,
    /// Course over ground, deg clockwise from north.
    pub course_deg: Option<f64>,
}

/// A sentence, and whether its checksum was compared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Checked {
    pub(super) sentence: Sentence,
    pub(super) has_checksum: bool,
}

/// Parses a sentence without its `$`, with or without `*hh`.
pub(super) fn checked(text: &str) -> Result<Checked, NmeaError> {
    let (body, sum) = match text.rsplit_once('*') {
        Some((body, sum)) => (body, Some(sum)),
        None => (text, None),
    };
    if !body.bytes().all(|byte| byte.is_ascii_graphic() || byte == b' ') {
        return Err(NmeaError::Frame);
    }
    if let Some(sum) = sum {
        let is_hex = sum.len() == 2 && sum.bytes().all(|byte| byte.is_ascii_hexdigit());
        let got = is_hex.then(|| u8::from_str_radix(sum, 16).ok()).flatten().ok_or(NmeaError::Frame)?;
        let expected = checksum(body);
        if got != expected {
            return Err(NmeaError::Checksum { got, expected });
        }
    }
    let (name, fields) = body.split_once(',').unwrap_or((body, ""));
    // Two letters name the talker (GP, GL, GN …), three letters the type.
    let fields = |sentence, least| match Fields::new(sentence, fields) {
        fields if sum.is_none() && fields.len() < least => Err(NmeaError::Cut { sentence, n: fields.len(), least }),
        fields => Ok(fields),
    };
    let sentence = match name.get(2..) {
        Some("GGA") => Sentence::Gga(gga(&fields("GGA", 14)?)?),
        Some("RMC") => Sentence::Rmc(rmc(&fields("RMC", 11)?)?),
        Some("ZDA") => Sentence::Zda(zda(&fields("ZDA", 6)?)?),
        Some("GST") => Sentence::Gst(gst(&fields("GST", 8)?)?),
        Some("GSA") => Sentence::Gsa(gsa(&fields("GSA", 17)?)?),
        _ => Sentence::Other,
    };
    Ok(Checked { sentence, has_checksum: sum.is_some() })
}

fn gga(fields: &Fields<'_>) -> Result<Gga, NmeaError> {
    let quality = fields.count(6)?.unwrap_or_default();
    Ok(Gga {
        time_nanos: fields.time(1)?,
        // Without a fix, some receivers send an impossible position.
        position_deg: if quality > 0 { fields.position(2)? } else { None },
        quality,
        satellites: fields.count(7)?.unwrap_or_default(),
        hdop: fields.number(8, 0.0, 1000.0)?,
        height_m: fields.number(9, MIN_HEIGHT_M, MAX_HEIGHT_M)?,
        geoid_m: fields.number(11, -MAX_GEOID_M, MAX_GEOID_M)?,
    })
}

fn rmc(fields: &Fields<'_>) -> Result<Rmc, NmeaError> {
    let time_nanos = fields.time(1)?;
    let stamp = time_nanos.zip(fields.date(9)?).map(|(time_nanos, days)| Stamp(days * DAY_NANOS + time_nanos));
    let is_valid = fields.text(2) == "A";
    Ok(Rmc {
        time_nanos,
        stamp,
        is_valid,
        position_deg: if is_valid { fields.position(3)? } else { None },
        speed_mps: fields.number(7, 0.0, MAX_SPEED_KNOTS)?.map(|knots| knots * KNOT_MPS),
        course_deg: fields.number(8, 0.0, 360.0)?,
    })
}

fn gst(fields: &Fields<'_>) -> Result<Gst, NmeaError> {
    let deviation = |field| fields.number(field, 0.0, MAX_DEVIATION_M);
    let [major, minor] = [deviation(3)?.unwrap_or_default(), deviation(4)?.unwrap_or_default()];
    let deviation = match (deviation(6)?, deviation(7)?, deviation(8)?) {
        (Some(north), Some(east), Some(up_m)) => {
            // Some receivers state an ellipse that contradicts the axes; the larger one counts.
            let across_m = north.hypot(east).max(major.hypot(minor)) / 2_f64.sqrt();
            Some(StatedDeviation { across_m, up_m })
        }
        _ => None,
    };
    Ok(Gst { time_nanos: fields.time(1)?, deviation })
}

fn gsa(fields: &Fields<'_>) -> Result<Gsa, NmeaError> {
    Ok(Gsa { vdop: fields.number(17, 0.0, MAX_DILUTION)? })
}

fn zda(fields: &Fields<'_>) -> Result<Zda, NmeaError> {
    let stamp = fields.time(1)?.zip(fields.whole_date(2)?);
    Ok(Zda { stamp: stamp.map(|(time_nanos, days)| Stamp(days * DAY_NANOS + time_nanos)) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nmea::parse;

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

    #[test]
    fn minutes_are_the_two_digits_before_the_point() {
        let read = |latitude: &str, longitude: &str| {
            let body = format!("GPGGA,120000,{latitude},N,{longitude},E,1,8,1.0,50,M,45,M,,");
            match parse(&sealed(&body)) {
                Ok(Sentence::Gga(gga)) => Ok(gga.position_deg.expect("has one")),
                Err(error) => Err(error.to_string()),
                other => panic!("{other:?}"),
            }
        };
        for (latitude, longitude, expected) in [
            ("4521.0", "1026.66", [45.35, 10.0 + 26.66 / 60.0]),
            ("4851.0000000", "221.0", [48.85, 2.35]),
            ("121.0", "10348.0", [1.35, 103.8]),
            ("21.0", "3235.4", [0.35, 32.59]),
            // Without a point.
            ("4521", "1026", [45.35, 10.0 + 26.0 / 60.0]),
            ("4521.", "01026.", [45.35, 10.0 + 26.0 / 60.0]),
            ("0048.85", "00002.35", [48.85 / 60.0, 2.35 / 60.0]),
            ("9000.0", "18000.0", [90.0, 180.0]),
            ("0.0", "0.0", [0.0, 0.0]),
        ] {
            let found = read(latitude, longitude).expect("is a position");
            let close = found.iter().zip(&expected).all(|(found, expected)| (found - expected).abs() < 1e-12);
            assert!(close, "{latitude} {longitude}: {found:?}");
        }
        for (latitude, longitude, expected) in [
            (
                "4560.0",
                "01026.0",
                "GGA field 2: \"4560.0\" is not degrees and minutes ddmm.mm: the minutes must be less than 60",
            ),
            (
                "4521.0",
                "1060.0",
                "GGA field 4: \"1060.0\" is not degrees and minutes ddmm.mm: the minutes must be less than 60",
            ),
            ("9000.1", "01026.0", "GGA field 2: \"9000.1\" must be at most 90 degrees"),
            ("4521.0", "18000.1", "GGA field 4: \"18000.1\" must be at most 180 degrees"),
            ("4521.0.0", "01026.0", "GGA field 2: \"4521.0.0\" is not degrees and minutes ddmm.mm"),
            ("-4521.0", "01026.0", "GGA field 2: \"-4521.0\" is not degrees and minutes ddmm.mm"),
            (".", "01026.0", "GGA field 2: \".\" is not degrees and minutes ddmm.mm"),
            (
                "48.85",
                "2.35",
                "GGA field 2: \"48.85\" is degrees with decimals; it must be degrees and minutes ddmm.mm",
            ),
            (
                "48.85",
                "102.35",
                "GGA field 2: \"48.85\" is degrees with decimals; it must be degrees and minutes ddmm.mm",
            ),
        ] {
            assert_eq!(read(latitude, longitude), Err(expected.to_owned()));
        }
    }

    #[test]
    fn whole_sentences_without_checksum_are_read_and_cut_ones_are_reported() {
        let rmc = "$GPRMC,214106,A,3707.8178,N,12139.2690,W,010.3,188.2,230715,013.8,E";
        assert_eq!(parse(rmc), parse(&format!("{rmc}*{:02X}", checksum(&rmc[1..]))));
        let cut = NmeaError::Cut { sentence: "RMC", n: 9, least: 11 };
        assert_eq!(parse("$GPRMC,214106,A,3707.8178,N,12139.2690,W,010.3,188.2,2307"), Err(cut));
        assert_eq!(
            parse("$GPRMC,214106,A,3707.8178,N,12139.2690,W,010.3,188.2,230715,013.8,E*0"),
            Err(NmeaError::Frame)
        );
        assert!(matches!(parse("$GPZDA,201530.00,31,02,2002,00,00"), Err(NmeaError::Field { field: 2, .. })));
    }
}
