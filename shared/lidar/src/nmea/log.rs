//! Joins GGA and RMC sentences of the same epoch to fixes.

use super::{Gga, Rmc, Sentence, parse};
use files::calendar::DAY_NANOS;
use geometry::Stamp;
use serde::{Deserialize, Serialize};

/// One position fix.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fix {
    /// Time of the fix.
    pub stamp: Stamp,
    /// Latitude and longitude, WGS84, deg, north and east positive.
    pub position_deg: [f64; 2],
    /// Height above the ellipsoid, m; `None` without GGA.
    pub altitude_m: Option<f64>,
    /// Speed over ground.
    pub speed_mps: Option<f64>,
    /// Course over ground, deg clockwise from north.
    pub course_deg: Option<f64>,
    /// Horizontal dilution of precision.
    pub hdop: Option<f64>,
    /// Satellites in use; 0 without GGA.
    pub satellites: u32,
    /// GGA quality: 1 single, 2 differential, 4 fixed, 5 float.
    pub quality: u32,
}

/// Counters of a log.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct LogStats {
    /// GGA and RMC sentences.
    pub sentences: u64,
    /// Sentences of other types, which are not used.
    pub other_sentences: u64,
    /// Lines that are not sentences, are damaged or have impossible values.
    pub bad_lines: u64,
    /// Epochs without position.
    pub without_fix: u64,
    /// Skipped fixes: not after the previous fix, or without a known date.
    pub out_of_order: u64,
}

/// All fixes of a log, sorted by time. Lines that are not text are bad lines.
pub fn fixes(log: &[u8]) -> (Vec<Fix>, LogStats) {
    let mut joiner = FixJoiner::default();
    let mut fixes: Vec<Fix> = log.split(|byte| *byte == b'\n').filter_map(|line| joiner.take(line)).collect();
    fixes.extend(joiner.finish());
    (fixes, joiner.stats())
}

/// Joins the sentences of one epoch, line by line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FixJoiner {
    gga: Option<Gga>,
    rmc: Option<Rmc>,
    /// Midnight of the day of the last RMC.
    midnight: Option<i64>,
    /// Time of the last fix.
    last: Option<Stamp>,
    stats: LogStats,
}

impl FixJoiner {
    /// Reads the next line. Returns the fix completed by it: of the same epoch or of the previous one.
    pub fn take(&mut self, line: &[u8]) -> Option<Fix> {
        let line = line.trim_ascii();
        if line.is_empty() {
            return None;
        }
        match std::str::from_utf8(line).ok().and_then(|line| parse(line).ok()) {
            Some(Sentence::Gga(gga)) => self.gga(gga),
            Some(Sentence::Rmc(rmc)) => self.rmc(rmc),
            Some(Sentence::Other) => {
                self.stats.other_sentences += 1;
                None
            }
            None => {
                self.stats.bad_lines += 1;
                None
            }
        }
    }

    /// Completes the last epoch after the last line.
    pub fn finish(&mut self) -> Option<Fix> {
        self.emit()
    }

    /// Counters since the first line.
    pub fn stats(&self) -> LogStats {
        self.stats
    }

    fn gga(&mut self, gga: Gga) -> Option<Fix> {
        self.stats.sentences += 1;
        let is_other_epoch =
            self.rmc.and_then(|rmc| rmc.stamp).is_some_and(|stamp| Some(time_of_day(stamp)) != gga.time_nanos);
        let before = if self.gga.is_some() || is_other_epoch { self.emit() } else { None };
        self.gga = Some(gga);
        before.or_else(|| self.emit_if_joined())
    }

    fn rmc(&mut self, rmc: Rmc) -> Option<Fix> {
        self.stats.sentences += 1;
        let is_other_epoch = self.gga.is_some_and(|gga| gga.time_nanos != rmc.stamp.map(time_of_day));
        let before = if self.rmc.is_some() || is_other_epoch { self.emit() } else { None };
        if let Some(stamp) = rmc.stamp {
            self.midnight = Some(stamp.0 - time_of_day(stamp));
        }
        self.rmc = Some(rmc);
        before.or_else(|| self.emit_if_joined())
    }

    fn emit_if_joined(&mut self) -> Option<Fix> {
        if self.gga.is_some() && self.rmc.is_some() { self.emit() } else { None }
    }

    /// Completes the current epoch.
    fn emit(&mut self) -> Option<Fix> {
        let gga = self.gga.take();
        let rmc = self.rmc.take().filter(|rmc| rmc.is_valid);
        if gga.is_none() && rmc.is_none() {
            return None;
        }
        let position = gga.filter(|gga| gga.quality > 0).and_then(|gga| gga.position_deg);
        let Some(position_deg) = position.or(rmc.and_then(|rmc| rmc.position_deg).filter(|_| gga.is_none())) else {
            self.stats.without_fix += 1;
            return None;
        };
        let stamp = rmc.and_then(|rmc| rmc.stamp).or_else(|| self.dated(gga?.time_nanos?));
        let Some(stamp) = stamp.filter(|stamp| self.last.is_none_or(|last| last < *stamp)) else {
            self.stats.out_of_order += 1;
            return None;
        };
        self.last = Some(stamp);
        Some(Fix {
            stamp,
            position_deg,
            altitude_m: gga.and_then(|gga| Some(gga.height_m? + gga.geoid_m?)),
            speed_mps: rmc.and_then(|rmc| rmc.speed_mps),
            course_deg: rmc.and_then(|rmc| rmc.course_deg),
            hdop: gga.and_then(|gga| gga.hdop),
            satellites: gga.map_or(0, |gga| gga.satellites),
            quality: gga.map_or(1, |gga| gga.quality),
        })
    }

    /// A time of day on the day of the last RMC, or on the next day if midnight passed since the last fix.
    fn dated(&self, time_nanos: i64) -> Option<Stamp> {
        let stamp = Stamp(self.midnight? + time_nanos);
        match self.last {
            Some(last) if stamp.0 < last.0 - DAY_NANOS / 2 => Some(stamp.plus_nanos(DAY_NANOS)),
            _ => Some(stamp),
        }
    }
}

fn time_of_day(stamp: Stamp) -> i64 {
    stamp.0.rem_euclid(DAY_NANOS)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nmea::{gga_from_fix, gga_without_fix, rmc_from_fix, rmc_without_fix};

    fn fix(i: i64) -> Fix {
        Fix {
            // Crosses midnight.
            stamp: Stamp(1_622_505_598_000_000_000 + i * 500_000_000),
            position_deg: [-0.000_1 * i as f64, 179.999_9 - 0.3 * i as f64],
            altitude_m: Some(104.25 + i as f64),
            speed_mps: Some(7.5),
            course_deg: Some(12.5),
            hdop: Some(0.9),
            satellites: 9,
            quality: 2,
        }
    }

    fn log(lines: impl Iterator<Item = String>) -> Vec<u8> {
        lines.flat_map(|line| line.into_bytes().into_iter().chain(*b"\r\n")).collect()
    }

    fn assert_near(back: &Fix, fix: &Fix) {
        assert_eq!(back.stamp, fix.stamp);
        for axis in 0..2 {
            assert!((back.position_deg[axis] - fix.position_deg[axis]).abs() < 1e-8, "{back:?}");
        }
        assert!((back.altitude_m.expect("has one") - fix.altitude_m.expect("has one")).abs() < 1e-3);
    }

    #[test]
    fn fixes_survive_round_trip() {
        let lines = (0..10).flat_map(|i| [gga_from_fix(&fix(i), 44.6), rmc_from_fix(&fix(i))]);
        let (back, stats) = fixes(&log(lines));
        assert_eq!(stats, LogStats { sentences: 20, ..LogStats::default() });
        assert_eq!(back.len(), 10);
        for (i, back) in back.iter().enumerate() {
            assert_near(back, &fix(i as i64));
            assert!((back.speed_mps.expect("has one") - 7.5).abs() < 1e-3);
            assert_eq!((back.course_deg, back.hdop, back.satellites, back.quality), (Some(12.5), Some(0.9), 9, 2));
        }
    }

    #[test]
    fn gga_without_date_is_dated_across_midnight() {
        let lines = std::iter::once(rmc_from_fix(&fix(0))).chain((0..10).map(|i| gga_from_fix(&fix(i), 44.6)));
        let (back, _) = fixes(&log(lines));
        assert_eq!(back.len(), 10);
        assert_near(&back[9], &fix(9));
        assert_eq!((back[0].speed_mps.is_some(), back[9].speed_mps), (true, None));
    }

    #[test]
    fn epochs_without_position_are_counted_and_keep_the_date() {
        let stamp = fix(4).stamp;
        let lost = [gga_without_fix(stamp), rmc_without_fix(stamp)];
        let found = [gga_from_fix(&fix(5), 44.6), rmc_from_fix(&fix(5))];
        let (back, stats) = fixes(&log(lost.into_iter().chain(found)));
        assert_eq!(stats, LogStats { sentences: 4, without_fix: 1, ..LogStats::default() });
        assert_eq!(back.len(), 1);
        assert_near(&back[0], &fix(5));
    }

    #[test]
    fn damaged_lines_are_counted_and_affect_no_other_line() {
        let mut lines: Vec<String> =
            (0..4).flat_map(|i| [gga_from_fix(&fix(i), 44.6), rmc_from_fix(&fix(i))]).collect();
        lines[2].replace_range(10..11, "7");
        lines.push("\u{0}noise".into());
        lines.push(rmc_from_fix(&fix(1)));
        let (back, stats) = fixes(&log(lines.into_iter()));
        assert_eq!(stats, LogStats { sentences: 8, bad_lines: 2, out_of_order: 1, ..LogStats::default() });
        // The GGA of the second fix is damaged, so it has no height.
        assert_eq!(back.iter().map(|fix| fix.altitude_m.is_some()).collect::<Vec<_>>(), [true, false, true, true]);
    }
}
