//! Position fixes as the log `gnss.nmea` of a drive.

use crate::plan::{Plan, TextFile};
use drive::manifest::GnssEntry;
use geometry::Stamp;
use lidar::nmea::{Fix, Sentence, gga_from_fix, gst_from_fix, parse, rmc_from_fix};

/// A millisecond, the resolution of times in sentences, ns.
const MILLI: i64 = 1_000_000;

/// Adds fixes in the order of their stamps to a drive, with the antenna at the origin of the body. Fixes within the same
/// millisecond are left out: a reader would take them as one epoch. `origin`: latitude, longitude (deg) and ellipsoidal
/// height (m) of the world frame.
pub(crate) fn add<'a>(plan: &mut Plan, fixes: impl IntoIterator<Item = &'a Fix>, origin: [f64; 3]) {
    let mut text = String::new();
    let mut last = None;
    for fix in fixes {
        let milli = millisecond(fix.stamp);
        if last.replace(milli) == Some(milli) {
            continue;
        }
        for sentence in sentences(fix) {
            text += &sentence;
            text.push('\n');
        }
    }
    let file = "gnss.nmea";
    plan.texts.push(TextFile { place: file.into(), text });
    plan.manifest.gnss =
        Some(GnssEntry { delay_nanos: 0, file: file.to_owned(), origin, antenna_in_body: [0.0; 3], geoid_m: None });
}

/// Checks that a fix can be a line of the log.
pub(crate) fn check(fix: &Fix) -> Result<(), String> {
    let [gga, rmc] = position_sentences(fix).map(|sentence| parse(&sentence).map_err(|error| error.to_string()));
    gga?;
    match rmc? {
        Sentence::Rmc(rmc) if rmc.stamp.map(millisecond) == Some(millisecond(fix.stamp)) => Ok(()),
        _ => Err(format!("the stamp {} ns must be in the years 1970 to 2069", fix.stamp.0)),
    }
}

/// Number of the millisecond since 1970.
pub(crate) fn millisecond(stamp: Stamp) -> i64 {
    stamp.0.div_euclid(MILLI)
}

/// Heights are above the ellipsoid, so the sentences state a geoid separation of 0.
fn sentences(fix: &Fix) -> impl Iterator<Item = String> {
    gst_from_fix(fix).into_iter().chain(position_sentences(fix))
}

fn position_sentences(fix: &Fix) -> [String; 2] {
    [gga_from_fix(fix, 0.0), rmc_from_fix(fix)]
}
