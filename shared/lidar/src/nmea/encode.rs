//! Encoding of fixes as sentences, for simulated receivers.

use super::line::{Content, content};
use super::sentence::{Checked, Sentence};
use super::{Fix, KNOT_MPS, StatedDeviation, checksum};
use files::calendar::{DAY_NANOS, date_from_days};
use geometry::Stamp;

/// The fix as `$GPGGA` without line end. `geoid_m` is the height of the geoid above the ellipsoid. Without altitude, the height
/// fields are empty.
pub fn gga_from_fix(fix: &Fix, geoid_m: f64) -> String {
    let height = fix.altitude_m.map(|altitude| format!("{:.3}", altitude - geoid_m)).unwrap_or_default();
    let hdop = fix.hdop.map(|hdop| format!("{hdop:.1}")).unwrap_or_default();
    let position = position(fix.position_deg);
    let quality = fix.quality;
    let satellites = fix.satellites;
    let time = time(fix.stamp);
    sealed(&format!("GPGGA,{time},{position},{quality},{satellites:02},{hdop},{height},M,{geoid_m:.1},M,,"))
}

/// An epoch without position as `$GPGGA`: quality 0.
pub fn gga_without_fix(stamp: Stamp) -> String {
    sealed(&format!("GPGGA,{},,,,,0,00,,,M,,M,,", time(stamp)))
}

/// The fix as `$GPRMC`, without line end.
pub fn rmc_from_fix(fix: &Fix) -> String {
    let knots = fix.speed_mps.map(|speed| format!("{:.3}", speed / KNOT_MPS)).unwrap_or_default();
    let course = fix.course_deg.map(|course| format!("{course:.2}")).unwrap_or_default();
    let time = time(fix.stamp);
    let position = position(fix.position_deg);
    let date = date(fix.stamp);
    sealed(&format!("GPRMC,{time},A,{position},{knots},{course},{date},,,A"))
}

/// The standard deviations of the fix as `$GPGST` without line end; `None` without them. It precedes the other sentences of the fix.
pub fn gst_from_fix(fix: &Fix) -> Option<String> {
    let StatedDeviation { across_m, up_m } = fix.deviation?;
    Some(sealed(&format!("GPGST,{},,,,,{across_m:.3},{across_m:.3},{up_m:.3}", time(fix.stamp))))
}

/// An epoch without position as `$GPRMC`: status V with time and date.
pub fn rmc_without_fix(stamp: Stamp) -> String {
    sealed(&format!("GPRMC,{},V,,,,,,,{},,,N", time(stamp), date(stamp)))
}

/// A line with the time of its GGA, RMC, ZDA and GST sentences, and the dates of RMC and ZDA, moved by `nanos`, rounded to milliseconds;
/// everything else is unchanged.
pub fn restamped(line: &str, nanos: i64) -> String {
    let Content::Sentences(found) = content(line.as_bytes()) else { return line.to_owned() };
    let mut text = String::new();
    let mut end = 0;
    for found in found {
        let Ok(checked) = found.parsed else { continue };
        // Sentences are ASCII, so these are boundaries of characters.
        let moved = restamped_sentence(&line[found.begin + 1..found.end], &checked, nanos);
        let Some(moved) = moved else { continue };
        text += &line[end..found.begin];
        text += &moved;
        end = found.end;
    }
    text + &line[end..]
}

/// A sentence without its `$`, moved. `None`: it has no time.
fn restamped_sentence(text: &str, checked: &Checked, nanos: i64) -> Option<String> {
    let body = text.rsplit_once('*').filter(|_| checked.has_checksum).map_or(text, |(body, _)| body);
    let (stamp, date_field) = match checked.sentence {
        Sentence::Gga(gga) => (Stamp(gga.time_nanos?), None),
        Sentence::Rmc(rmc) => (rmc.stamp?, Some(9)),
        Sentence::Zda(zda) => (zda.stamp?, Some(2)),
        Sentence::Gst(gst) => (Stamp(gst.time_nanos?), None),
        Sentence::Gsa(_) | Sentence::Other => return None,
    };
    let stamp = stamp.plus_nanos(nanos);
    let mut fields: Vec<String> = body.split(',').map(str::to_owned).collect();
    *fields.get_mut(1)? = time(stamp);
    match date_field {
        Some(9) => *fields.get_mut(9)? = date(stamp),
        Some(first) => {
            let (year, month, day) = date_from_days(stamp.0.div_euclid(DAY_NANOS));
            let date = [format!("{day:02}"), format!("{month:02}"), format!("{year:04}")];
            fields.get_mut(first..first + 3)?.clone_from_slice(&date);
        }
        None => {}
    }
    let body = fields.join(",");
    Some(if checked.has_checksum { sealed(&body) } else { format!("${body}") })
}

/// Day, month and year, two digits each.
fn date(stamp: Stamp) -> String {
    let (year, month, day) = date_from_days(stamp.0.div_euclid(DAY_NANOS));
    format!("{day:02}{month:02}{:02}", year.rem_euclid(100))
}

/// Time of day with a resolution of milliseconds, `hhmmss.sss`.
fn time(stamp: Stamp) -> String {
    let millis = stamp.0.rem_euclid(DAY_NANOS) / 1_000_000;
    let seconds = millis / 1000;
    format!("{:02}{:02}{:02}.{:03}", seconds / 3600, seconds / 60 % 60, seconds % 60, millis % 1000)
}

fn position([latitude, longitude]: [f64; 2]) -> String {
    format!("{},{}", angle(latitude, 2, ['N', 'S']), angle(longitude, 3, ['E', 'W']))
}

/// Degrees and minutes with a resolution of 2 mm on the ground.
fn angle(value: f64, digits: usize, [positive, negative]: [char; 2]) -> String {
    let side = if value < 0.0 { negative } else { positive };
    // Rounded to millionths of a minute first, so that 59.9999996 minutes become the next degree.
    let total = (value.abs() * 60e6).round() as u64;
    let degrees = total / 60_000_000;
    let minutes = total % 60_000_000;
    format!("{degrees:0digits$}{:02}.{:06},{side}", minutes / 1_000_000, minutes % 1_000_000)
}

fn sealed(body: &str) -> String {
    format!("${body}*{:02X}", checksum(body))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nmea::parse;

    #[test]
    fn restamped_sentences_move_over_midnight_and_keep_their_other_fields() {
        // From a VLP-16's position packet.
        let rmc = "$GPRMC,214106,A,3707.8178,N,12139.2690,W,010.3,188.2,230715,013.8,E,D*05\r\n";
        let moved = restamped(rmc, (2 * 3600 + 20 * 60) * 1_000_000_000 + 250_000_000);
        assert!(
            moved.starts_with("$GPRMC,000106.250,A,3707.8178,N,12139.2690,W,010.3,188.2,240715,013.8,E,D*"),
            "{moved}"
        );
        assert!(moved.ends_with("\r\n") && matches!(parse(&moved), Ok(Sentence::Rmc(_))), "{moved}");
        let gga = sealed("GNGGA,235959.5,4800.0,N,00200.0,E,4,08,0.9,60.0,M,44.6,M,1.0,0042");
        let moved = restamped(&gga, 1_000_000_000);
        assert!(moved.starts_with("$GNGGA,000000.500,4800.0,N,00200.0,E,4,08,0.9,60.0,M,44.6,M,1.0,0042*"), "{moved}");
        assert_eq!(
            restamped(&gga, -86_400_000_000_000),
            sealed(&gga[1..gga.len() - 3].replace("235959.5", "235959.500"))
        );
        // A tag block stays, and a sentence without checksum gets none.
        let tagged = "\\c:1*58\\$GPZDA,235959.00,31,12,2023,00,00\r\n";
        assert_eq!(restamped(tagged, 1_000_000_000), "\\c:1*58\\$GPZDA,000000.000,01,01,2024,00,00\r\n");
        let gst = sealed("GPGST,235959.0,,,,,1.0,1.0,2.0");
        assert_eq!(restamped(&gst, 1_000_000_000), sealed("GPGST,000000.000,,,,,1.0,1.0,2.0"));
        for line in ["$GPGSV,1,1,00*79\n", "noise", "$GPGGA,,,,,,0,,,,,,,,*66", ""] {
            assert_eq!(restamped(line, 5), line);
        }
    }
}
