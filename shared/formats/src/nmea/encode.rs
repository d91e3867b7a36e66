//! Fixes as sentences, for simulated receivers.

use super::{Fix, KNOT_MPS, checksum};
use crate::calendar::{DAY_NANOS, date_from_days};

/// The fix as `$GPGGA`, without line end; `geoid_m` is the geoid above the ellipsoid. A fix without altitude has empty
/// fields there.
pub fn gga_from_fix(fix: &Fix, geoid_m: f64) -> String {
    let height = fix.altitude_m.map(|altitude| format!("{:.3}", altitude - geoid_m)).unwrap_or_default();
    let hdop = fix.hdop.map(|hdop| format!("{hdop:.1}")).unwrap_or_default();
    let position = position(fix.position_deg);
    let (quality, satellites) = (fix.quality, fix.satellites);
    sealed(&format!("GPGGA,{},{position},{quality},{satellites:02},{hdop},{height},M,{geoid_m:.1},M,,", time(fix)))
}

/// The fix as `$GPRMC`, without line end.
pub fn rmc_from_fix(fix: &Fix) -> String {
    let (year, month, day) = date_from_days(fix.stamp.0.div_euclid(DAY_NANOS));
    let knots = fix.speed_mps.map(|speed| format!("{:.3}", speed / KNOT_MPS)).unwrap_or_default();
    let course = fix.course_deg.map(|course| format!("{course:.2}")).unwrap_or_default();
    let (position, year) = (position(fix.position_deg), year.rem_euclid(100));
    sealed(&format!("GPRMC,{},A,{position},{knots},{course},{day:02}{month:02}{year:02},,,A", time(fix)))
}

/// To the millisecond.
fn time(fix: &Fix) -> String {
    let millis = fix.stamp.0.rem_euclid(DAY_NANOS) / 1_000_000;
    let seconds = millis / 1000;
    format!("{:02}{:02}{:02}.{:03}", seconds / 3600, seconds / 60 % 60, seconds % 60, millis % 1000)
}

fn position([latitude, longitude]: [f64; 2]) -> String {
    format!("{},{}", angle(latitude, 2, ['N', 'S']), angle(longitude, 3, ['E', 'W']))
}

/// Degrees and minutes to 2 mm on the ground.
fn angle(value: f64, digits: usize, [positive, negative]: [char; 2]) -> String {
    let side = if value < 0.0 { negative } else { positive };
    // In millionths of a minute, so that 59.9999996 minutes become the next degree.
    let total = (value.abs() * 60e6).round() as u64;
    let (degrees, minutes) = (total / 60_000_000, total % 60_000_000);
    format!("{degrees:0digits$}{:02}.{:06},{side}", minutes / 1_000_000, minutes % 1_000_000)
}

fn sealed(body: &str) -> String {
    format!("${body}*{:02X}", checksum(body))
}
