//! Fixes of a recorder's receiver, with stamps of the LiDAR clock: `gnss*.nmea`, otherwise `gnss*.gnss`.
//!
//! Lines of `*.nmea`: stamp in ns, in newer files the time of the computer in ms, and a sentence. Lines of `*.gnss`: [`VALUES`], in newer
//! files also the time of the computer. The older files have latitude and longitude in degrees and minutes `ddmm.mmmm`
//! like the sentence, the newer ones in degrees.

use crate::error::{At, ImportError};
use crate::files::files;
use crate::fixes;
use crate::plan::Plan;
use files::calendar::DAY_NANOS;
use files::regular_file;
use geometry::Stamp;
use lidar::nmea::{Fix, Rmc, Sentence, is_null_island, parse};
use std::path::{Path, PathBuf};

/// Values of a line of `*.gnss`. `height` is the height of the geoid above the ellipsoid.
const VALUES: [&str; 10] =
    ["timestamp", "lat", "lon", "alt", "hdop", "satelites_tracked", "height", "age", "time", "fix_quality"];

/// Fixes of all files.
#[derive(Default)]
struct GnssLog {
    fixes: Vec<Fix>,
    /// UTC time of day of the last fix, if the file has sentences, and the last RMC: GGA and RMC of one epoch form one fix.
    epoch: Option<i64>,
    rmc: Option<Rmc>,
    n_without: usize,
    n_not_rising: usize,
    n_bad: usize,
    first_bad: Option<ImportError>,
}

/// Adds the fixes to a drive. Files without fixes are left out.
pub(super) fn add(plan: &mut Plan, source: &Path) -> Result<(), ImportError> {
    let mut log = GnssLog::default();
    let inputs = files_of(source)?;
    if inputs.is_empty() {
        return Ok(());
    }
    for path in &inputs {
        // A damaged line may not be text.
        let bytes = regular_file::read(path).at(path)?;
        let is_nmea = path.extension().is_some_and(|extension| extension == "nmea");
        for (number, line) in (1..).zip(bytes.split(|byte| *byte == b'\n')) {
            let line = String::from_utf8_lossy(line);
            let line = line.trim();
            if line.is_empty() {
                continue;
            }
            let read = if is_nmea { log.sentence(line) } else { log.values(line) };
            if let Err(rule) = read {
                log.n_bad += 1;
                log.first_bad.get_or_insert_with(|| ImportError::at_line(path, number, rule));
            }
        }
    }
    let first = log.fixes.iter().find_map(|fix| Some((fix.position_deg, fix.altitude_m?)));
    let notes = log.notes();
    let Some(([latitude, longitude], height_m)) = first else {
        plan.report.push(format!("GNSS: {} fixes, none with a height{notes}", log.fixes.len()));
        return Ok(());
    };
    plan.report.push(format!("imported: {} GNSS fixes{notes}", log.fixes.len()));
    fixes::add(plan, &log.fixes, [latitude, longitude, height_m]);
    plan.read.extend(inputs);
    Ok(())
}

/// The files with sentences, which also have speeds; otherwise the files with values.
fn files_of(source: &Path) -> Result<Vec<PathBuf>, ImportError> {
    for end in [".nmea", ".gnss"] {
        let found = files(source, end)?.into_iter().filter(|(name, _)| name.starts_with("gnss"));
        let found: Vec<PathBuf> = found.map(|(_, path)| path).collect();
        if !found.is_empty() {
            return Ok(found);
        }
    }
    Ok(Vec::new())
}

impl GnssLog {
    fn sentence(&mut self, line: &str) -> Result<(), String> {
        let (times, sentence) = line.split_once('$').ok_or("has no sentence; expected timestamp $...*hh")?;
        let stamp = stamp(times.split_whitespace().next())?;
        // The recorder writes each sentence with its checksum, so one without it is cut.
        if !sentence.contains('*') {
            return Err("the sentence has no checksum; it is cut".to_owned());
        }
        match parse(&format!("${sentence}")).map_err(|error| error.to_string())? {
            Sentence::Gga(gga) => {
                let position_deg =
                    gga.position_deg.filter(|position_deg| gga.quality > 0 && !is_null_island(*position_deg));
                let Some(position_deg) = position_deg else {
                    self.n_without += 1;
                    return Ok(());
                };
                let rmc = self.rmc.filter(|rmc| rmc.stamp.map(time_of_day) == gga.time_nanos);
                let is_taken = self.push(Fix {
                    stamp,
                    position_deg,
                    altitude_m: gga.height_m.zip(gga.geoid_m).map(|(height_m, geoid_m)| height_m + geoid_m),
                    speed_mps: rmc.and_then(|rmc| rmc.speed_mps),
                    course_deg: rmc.and_then(|rmc| rmc.course_deg),
                    hdop: gga.hdop,
                    satellites: gga.satellites,
                    quality: gga.quality,
                    vdop: None,
                    deviation: None,
                })?;
                self.epoch = gga.time_nanos.filter(|_| is_taken);
            }
            Sentence::Rmc(rmc) if rmc.is_valid && rmc.stamp.is_some() => {
                let is_of_last = self.epoch == rmc.stamp.map(time_of_day);
                if let Some(last) = self.fixes.last_mut().filter(|_| is_of_last) {
                    last.speed_mps = rmc.speed_mps;
                    last.course_deg = rmc.course_deg;
                }
                self.rmc = Some(rmc);
            }
            Sentence::Rmc(_) | Sentence::Zda(_) | Sentence::Gst(_) | Sentence::Gsa(_) | Sentence::Other => {}
        }
        Ok(())
    }

    fn values(&mut self, line: &str) -> Result<(), String> {
        let words: Vec<&str> = line.split_whitespace().collect();
        if words.len() != VALUES.len() && words.len() != VALUES.len() + 1 {
            return Err(format!("{} values; a line has {}: {}", words.len(), VALUES.len(), VALUES.join(" ")));
        }
        let number = |index: usize| -> Result<f64, String> {
            let name = VALUES[index];
            let word = words[index];
            word.parse().map_err(|_| format!("{name} is {word:?}; it must be a number"))
        };
        let count = |index: usize| -> Result<u32, String> {
            let name = VALUES[index];
            let word = words[index];
            word.parse().map_err(|_| format!("{name} is {word:?}; it must be a count"))
        };
        let stamp = stamp(words.first().copied())?;
        let position = [number(1)?, number(2)?];
        let quality = count(9)?;
        let satellites = count(5)?;
        let altitude_m = number(3)?;
        let geoid_m = number(6)?;
        let hdop = number(4)?;
        // Receivers without position send empty fields, which the recorder writes as 0 or NaN.
        if quality == 0 || position == [0.0; 2] || position.iter().any(|value| value.is_nan()) {
            self.n_without += 1;
            return Ok(());
        }
        self.push(Fix {
            stamp,
            position_deg: degrees(position)?,
            altitude_m: Some(altitude_m + geoid_m).filter(|altitude| altitude.is_finite()),
            speed_mps: None,
            course_deg: None,
            hdop: Some(hdop).filter(|hdop| hdop.is_finite()),
            satellites,
            quality,
            vdop: None,
            deviation: None,
        })?;
        Ok(())
    }

    /// Adds a fix, unless its stamp is not later than the last one.
    fn push(&mut self, fix: Fix) -> Result<bool, String> {
        fixes::check(&fix)?;
        let milli = fixes::millisecond(fix.stamp);
        let is_after = self.fixes.last().is_none_or(|last| fixes::millisecond(last.stamp) < milli);
        if is_after {
            self.fixes.push(fix);
        } else {
            self.n_not_rising += 1;
        }
        Ok(is_after)
    }

    /// Note about lines and fixes that were left out, for the report.
    fn notes(&self) -> String {
        let left = [
            (self.n_without, "without position"),
            (self.n_not_rising, "whose stamp is not later than the previous one"),
        ];
        let left = left.iter().filter(|(n, _)| *n > 0).map(|(n, what)| format!("; {n} {what} are left out"));
        let bad = self.first_bad.as_ref();
        let bad = bad.map(|first| format!("; {} bad lines are left out, the first: {first}", self.n_bad));
        left.chain(bad).collect()
    }
}

/// The stamp of a line.
fn stamp(word: Option<&str>) -> Result<Stamp, String> {
    let word = word.unwrap_or_default();
    word.parse()
        .ok()
        .filter(|nanos: &i64| *nanos >= 0)
        .map(Stamp)
        .ok_or_else(|| format!("timestamp is {word:?}; it must be a number of ns"))
}

/// Latitude and longitude in degrees. A number of degrees and minutes is outside the range of degrees, except within a
/// degree of the intersection of equator and prime meridian, which is in the sea.
fn degrees(position: [f64; 2]) -> Result<[f64; 2], String> {
    let [latitude, longitude] = position;
    if latitude.abs() <= 90.0 && longitude.abs() <= 180.0 {
        return Ok(position);
    }
    let [latitude, longitude] = position.map(|value| {
        let minutes = value % 100.0;
        (minutes.abs() < 60.0).then(|| (value / 100.0).trunc() + minutes / 60.0)
    });
    let found = latitude.filter(|latitude| latitude.abs() <= 90.0).zip(longitude.filter(|value| value.abs() <= 180.0));
    found.map(|(latitude, longitude)| [latitude, longitude]).ok_or_else(|| {
        format!("lat {} lon {} must be degrees, or degrees and minutes ddmm.mmmm", position[0], position[1])
    })
}

/// Time of day, ns.
fn time_of_day(stamp: Stamp) -> i64 {
    stamp.0.rem_euclid(DAY_NANOS)
}
