//! Position fixes as NMEA sentences.

use super::messages::NavSatFix;
use files::regular_file;
use geometry::Stamp;
use lidar::nmea::{
    Fix, fixes, gga_from_fix, gga_without_fix, gst_from_fix, is_null_island, rmc_from_fix, rmc_without_fix,
};
use std::fs::File;
use std::io::{self, BufWriter, Read, Write};
use std::path::{Path, PathBuf};

/// Name of the log in the drive.
pub(crate) const FILE: &str = "gnss.nmea";
/// Part of the log that is searched for the first fix with a height, bytes: hours of a receiver.
const MAX_SEARCHED: u64 = 1 << 24;

/// Writes the log.
pub(crate) struct Gnss {
    path: PathBuf,
    log: BufWriter<File>,
    last: Option<i64>,
    pub n_lines: u64,
    /// Fixes that are not later than the previous one.
    pub n_late: u64,
    /// Fixes without position.
    pub n_without: u64,
}

impl Gnss {
    pub fn create(folder: &Path) -> io::Result<Self> {
        let path = folder.join(FILE);
        let log = BufWriter::new(File::create(&path)?);
        Ok(Self { path, log, last: None, n_lines: 0, n_late: 0, n_without: 0 })
    }

    /// Adds a fix. Its height is above the ellipsoid, so the sentences state a geoid separation of 0.
    pub fn add_fix(&mut self, stamp: i64, message: &NavSatFix) -> Result<(), String> {
        if self.last.is_some_and(|last| last >= stamp) {
            self.n_late += 1;
            return Ok(());
        }
        self.last = Some(stamp);
        let (lines, has_position) = fix_lines(stamp, message)?;
        self.n_without += u64::from(!has_position);
        self.write(&lines)
    }

    /// Adds the text of a receiver unchanged.
    pub fn add_sentence(&mut self, text: &str) -> Result<(), String> {
        self.write(&text.lines().map(str::to_owned).collect::<Vec<_>>())
    }

    fn write(&mut self, lines: &[String]) -> Result<(), String> {
        for line in lines.iter().map(|line| line.trim()).filter(|line| !line.is_empty()) {
            self.n_lines += 1;
            self.log.write_all(format!("{line}\r\n").as_bytes()).map_err(|error| error.to_string())?;
        }
        Ok(())
    }

    /// Latitude, longitude (deg) and height (m) of the first fix with a height.
    pub fn finish(mut self) -> io::Result<Option<[f64; 3]>> {
        self.log.flush()?;
        let mut begin = Vec::new();
        regular_file::open(&self.path)?.take(MAX_SEARCHED).read_to_end(&mut begin)?;
        let first = fixes(&begin).0.into_iter().find_map(|fix| Some((fix.position_deg, fix.altitude_m?)));
        Ok(first.map(|([latitude, longitude], altitude_m)| [latitude, longitude, altitude_m]))
    }
}

/// The sentences of a fix, and whether it has a position.
pub(crate) fn fix_lines(stamp: i64, message: &NavSatFix) -> Result<(Vec<String>, bool), String> {
    let stamp = Stamp(stamp);
    let quality = match message.status {
        0 => 1,
        1 => 2,
        2 => 4,
        _ => 0,
    };
    let [latitude, longitude] = message.position_deg;
    if quality == 0 || !latitude.is_finite() || !longitude.is_finite() || is_null_island(message.position_deg) {
        return Ok((vec![gga_without_fix(stamp), rmc_without_fix(stamp)], false));
    }
    if latitude.abs() > 90.0 || longitude.abs() > 180.0 {
        return Err(format!("position {latitude} {longitude} must be latitude -90 to 90 and longitude -180 to 180"));
    }
    let fix = Fix {
        stamp,
        position_deg: message.position_deg,
        altitude_m: Some(message.altitude_m).filter(|altitude| altitude.is_finite()),
        speed_mps: None,
        course_deg: None,
        hdop: None,
        satellites: 0,
        quality,
        vdop: None,
        deviation: message.deviation,
    };
    let deviations = gst_from_fix(&fix).into_iter();
    Ok((deviations.chain([gga_from_fix(&fix, 0.0), rmc_from_fix(&fix)]).collect(), true))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ros::messages::Header;

    #[test]
    fn fix_at_null_island_is_an_epoch_without_position() {
        let header = || Header { stamp: 0, frame: String::new() };
        let message =
            |position_deg| NavSatFix { header: header(), status: 0, position_deg, altitude_m: 0.0, deviation: None };
        let has_position =
            |position_deg| fix_lines(1_700_000_000_000_000_000, &message(position_deg)).expect("is valid").1;
        assert!(!has_position([0.0, 0.0]));
        assert!(has_position([0.0, 10.44]) && has_position([48.85, 0.0]));
    }
}
