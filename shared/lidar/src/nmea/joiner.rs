//! Joins GGA and RMC sentences of the same epoch to fixes.

use super::line::{Content, content};
use super::{Fix, Gga, Gsa, Gst, LogStats, Rmc, Sentence, StatedDeviation, Zda, is_null_island};
use files::calendar::DAY_NANOS;
use geometry::Stamp;
use serde::{Deserialize, Serialize};

/// Metres per degree on a sphere of the Earth's mean radius.
const METRES_PER_DEGREE: f64 = 111_195.0;

/// GST and GSA describe fixes up to this time apart, ns. Receivers send them after the fix, so they count for the next fix: they
/// change slowly.
const STATED_NANOS: i64 = 2_000_000_000;

/// Joins the sentences of one epoch, line by line.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FixJoiner {
    gga: Option<Gga>,
    rmc: Option<Rmc>,
    /// The last known date and time. Times of day are dated by it.
    reference: Option<Stamp>,
    /// Time and position of the last fix.
    last: Option<Stamp>,
    last_position_deg: Option<[f64; 2]>,
    /// Height of the geoid for sentences without it.
    geoid_m: Option<f64>,
    gst: Option<Gst>,
    gsa: Option<TimedGsa>,
    n_lines: u64,
    stats: LogStats,
}

/// GSA with the fix before it: it has no time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct TimedGsa {
    vdop: f64,
    after: Stamp,
}

impl FixJoiner {
    /// Distance of two positions of an epoch above which they are from different receivers, m. Sentences have a resolution of 0.2 m.
    pub const MAX_APART_M: f64 = 0.5;

    /// A joiner that dates times of day near `reference` until the first date.
    pub(super) fn near(reference: Stamp) -> Self {
        Self { reference: Some(reference), ..Self::default() }
    }

    /// Returns the joiner for a receiver whose sentences state no height of the geoid above the ellipsoid.
    #[must_use]
    pub fn above_geoid(self, geoid_m: Option<f64>) -> Self {
        Self { geoid_m, ..self }
    }

    /// Reads the next line. Returns the fix completed by it: of the same epoch or of the previous one.
    pub fn take(&mut self, line: &[u8]) -> Option<Fix> {
        self.take_line(line, self.n_lines + 1)
    }

    pub(super) fn take_line(&mut self, line: &[u8], number: u64) -> Option<Fix> {
        self.n_lines = number;
        match content(line) {
            Content::Empty | Content::Binary => None,
            Content::Text => {
                self.reject(number, &"not a sentence; expected $...*hh");
                None
            }
            Content::Sentences(found) => {
                let mut fix = None;
                for found in found {
                    match found.parsed {
                        Ok(checked) => {
                            let is_used = checked.sentence.has_time_or_position();
                            self.stats.without_checksum += u64::from(is_used && !checked.has_checksum);
                            // A line with a lost end completes at most one fix in practice; the first one is kept.
                            fix = fix.or(self.sentence(checked.sentence));
                        }
                        Err(error) => self.reject(number, &error),
                    }
                }
                fix
            }
        }
    }

    /// Completes the last epoch after the last line.
    pub fn finish(&mut self) -> Option<Fix> {
        self.emit()
    }

    /// Counters since the first line.
    pub fn stats(&self) -> LogStats {
        self.stats.clone()
    }

    fn reject(&mut self, number: u64, error: &dyn std::fmt::Display) {
        self.stats.bad_lines += 1;
        self.stats.first_bad.get_or_insert_with(|| format!("line {number}: {error}"));
    }

    fn sentence(&mut self, sentence: Sentence) -> Option<Fix> {
        self.stats.sentences += u64::from(sentence.has_time_or_position());
        self.stats.other_sentences += u64::from(!sentence.has_time_or_position());
        match sentence {
            Sentence::Gga(gga) => self.gga(gga),
            Sentence::Rmc(rmc) => self.rmc(rmc),
            Sentence::Zda(Zda { stamp }) => {
                self.reference = stamp.or(self.reference);
                None
            }
            Sentence::Gst(gst) => {
                self.gst = Some(gst);
                None
            }
            Sentence::Gsa(Gsa { vdop }) => {
                self.gsa = vdop.zip(self.last).map(|(vdop, after)| TimedGsa { vdop, after });
                None
            }
            Sentence::Other => None,
        }
    }

    fn gga(&mut self, gga: Gga) -> Option<Fix> {
        match self.gga {
            Some(first) if first.time_nanos.is_some() && first.time_nanos == gga.time_nanos => {
                self.repeat(first.position_deg, gga.position_deg);
                // A second talker may have a position before the first one.
                if first.quality == 0 {
                    self.gga = Some(gga);
                }
                return None;
            }
            None if self.is_of_last(gga.time_nanos) && self.rmc.is_none() => {
                self.repeat(self.last_position_deg, gga.position_deg);
                return None;
            }
            _ => {}
        }
        let is_other_epoch = self.rmc.is_some_and(|rmc| rmc.time_nanos != gga.time_nanos);
        let before = if self.gga.is_some() || is_other_epoch { self.emit() } else { None };
        self.gga = Some(gga);
        before.or_else(|| self.emit_if_joined())
    }

    fn rmc(&mut self, rmc: Rmc) -> Option<Fix> {
        match self.rmc {
            Some(first) if first.time_nanos.is_some() && first.time_nanos == rmc.time_nanos => {
                self.stats.repeated += 1;
                if !first.is_valid {
                    self.rmc = Some(rmc);
                }
                return None;
            }
            None if rmc.stamp.is_some() && rmc.stamp == self.last && self.gga.is_none() => {
                self.stats.repeated += 1;
                return None;
            }
            _ => {}
        }
        let is_other_epoch = self.gga.is_some_and(|gga| gga.time_nanos != rmc.time_nanos);
        let before = if self.rmc.is_some() || is_other_epoch { self.emit() } else { None };
        self.reference = rmc.stamp.or(self.reference);
        self.rmc = Some(rmc);
        before.or_else(|| self.emit_if_joined())
    }

    fn is_of_last(&self, time_nanos: Option<i64>) -> bool {
        time_nanos.is_some() && self.last.map(|last| last.0.rem_euclid(DAY_NANOS)) == time_nanos
    }

    /// Counts a second position of an epoch.
    fn repeat(&mut self, first_deg: Option<[f64; 2]>, second_deg: Option<[f64; 2]>) {
        self.stats.repeated += 1;
        let apart_m = first_deg.zip(second_deg).map_or(0.0, |(first, second)| {
            let east = (second[1] - first[1]).rem_euclid(360.0);
            let east = east.min(360.0 - east) * first[0].to_radians().cos();
            east.hypot(second[0] - first[0]) * METRES_PER_DEGREE
        });
        if apart_m > Self::MAX_APART_M {
            self.stats.conflicting += 1;
            self.stats.apart_mm = self.stats.apart_mm.max((apart_m * 1000.0) as u64);
        }
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
        if is_null_island(position_deg) {
            self.stats.null_islands += 1;
            return None;
        }
        let time_nanos = gga.and_then(|gga| gga.time_nanos).or(rmc.and_then(|rmc| rmc.time_nanos));
        let Some(stamp) = rmc.and_then(|rmc| rmc.stamp).or_else(|| self.dated(time_nanos?)) else {
            self.stats.undated += 1;
            return None;
        };
        if self.last.is_some_and(|last| last >= stamp) {
            self.stats.out_of_order += 1;
            return None;
        }
        self.last = Some(stamp);
        let vdop = self.gsa.filter(|gsa| stamp.0 - gsa.after.0 <= STATED_NANOS).map(|gsa| gsa.vdop);
        let deviation = self.gst.and_then(|gst| stated(&gst, stamp));
        self.last_position_deg = Some(position_deg);
        let height_m = gga.and_then(|gga| gga.height_m);
        let geoid_m = gga.and_then(|gga| gga.geoid_m).or(self.geoid_m);
        self.stats.without_geoid += u64::from(height_m.is_some() && geoid_m.is_none());
        Some(Fix {
            stamp,
            position_deg,
            altitude_m: height_m.zip(geoid_m).map(|(height_m, geoid_m)| height_m + geoid_m),
            speed_mps: rmc.and_then(|rmc| rmc.speed_mps),
            course_deg: rmc.and_then(|rmc| rmc.course_deg),
            hdop: gga.and_then(|gga| gga.hdop),
            satellites: gga.map_or(0, |gga| gga.satellites),
            quality: gga.map_or(1, |gga| gga.quality),
            vdop,
            deviation,
        })
    }

    /// A time of day as the stamp nearest to the last known date and the last fix.
    fn dated(&self, time_nanos: i64) -> Option<Stamp> {
        let near = self.reference?.max(self.last.unwrap_or(Stamp(i64::MIN)));
        let ahead = (time_nanos - near.0).rem_euclid(DAY_NANOS);
        Some(near.plus_nanos(if ahead > DAY_NANOS / 2 { ahead - DAY_NANOS } else { ahead }))
    }
}

/// The deviations of a GST sentence for a fix.
fn stated(gst: &Gst, stamp: Stamp) -> Option<StatedDeviation> {
    let apart = (stamp.0 - gst.time_nanos?).rem_euclid(DAY_NANOS);
    gst.deviation.filter(|_| apart.min(DAY_NANOS - apart) <= STATED_NANOS)
}
