//! The fixes of a log, and what was left out.

use super::alternation::{Alternation, alternation};
use super::line::{decoded, lines};
use super::ubx::accuracies;
use super::{FixJoiner, Rmc, Sentence, StatedDeviation, sentence};
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
    /// Vertical dilution of precision, from GSA.
    pub vdop: Option<f64>,
    /// Standard deviations from GST or UBX-NAV-PVT.
    pub deviation: Option<StatedDeviation>,
}

/// Counters of a log.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct LogStats {
    /// GGA, RMC and ZDA sentences.
    pub sentences: u64,
    /// Sentences of other types. Only GST and GSA are used.
    pub other_sentences: u64,
    /// Lines that are not sentences, are damaged or have impossible values.
    pub bad_lines: u64,
    /// Place and reason of the first bad line.
    pub first_bad: Option<String>,
    /// Used sentences without checksum: damage in them may be unnoticed.
    pub without_checksum: u64,
    /// Epochs without position.
    pub without_fix: u64,
    /// Fixes at 0 0, which are skipped: the receiver had no position.
    pub null_islands: u64,
    /// Fixes with a position above the geoid only, because the receiver states no geoid separation.
    pub without_geoid: u64,
    /// Skipped fixes before the first sentence with a date.
    pub undated: u64,
    /// Skipped fixes: not after the previous fix.
    pub out_of_order: u64,
    /// Skipped sentences of an epoch that has one of this type: of a second talker or receiver.
    pub repeated: u64,
    /// GGA sentences that contradict another one of their epoch by more than [`FixJoiner::MAX_APART_M`]: of a second receiver.
    pub conflicting: u64,
    /// Fixes to one side of the fixes before and after them: of a second receiver with other epochs.
    pub alternating: u64,
    /// Largest distance of positions of two receivers, mm.
    pub apart_mm: u64,
}

impl LogStats {
    /// The counters with the file of the first bad line.
    #[must_use]
    pub fn in_file(self, file: &str) -> Self {
        let first_bad = self.first_bad.map(|text| format!("{file}: {text}"));
        Self { first_bad, ..self }
    }

    /// Fixes and epochs that were left out, with their numbers, as text.
    pub fn left_out(&self) -> String {
        let counts = [
            (self.without_fix, "without position"),
            (self.null_islands, "at 0 0"),
            (self.undated, "before the first RMC or ZDA sentence with a date"),
            (self.out_of_order, "not after the previous fix"),
            (self.without_geoid, "without geoid separation (set gnss.geoid_m in drive.toml)"),
        ];
        let found = counts.iter().filter(|(n, _)| *n > 0).map(|(n, what)| format!("{n} {what}"));
        found.collect::<Vec<_>>().join(", ")
    }
}

/// All fixes of a log, sorted by time, with the deviations of UBX-NAV-PVT messages of the same time. Fixes before the first date have the date that makes them the nearest.
pub fn fixes(log: &[u8]) -> (Vec<Fix>, LogStats) {
    fixes_above_geoid(log, None)
}

/// All fixes of a log, as [`fixes`]. `geoid_m`: height of the geoid above the ellipsoid for sentences without it.
pub fn fixes_above_geoid(log: &[u8], geoid_m: Option<f64>) -> (Vec<Fix>, LogStats) {
    let log = decoded(log);
    let joiner = first_date(&log).map_or_else(FixJoiner::default, FixJoiner::near);
    let mut joiner = joiner.above_geoid(geoid_m);
    let mut fixes: Vec<Fix> = lines(&log).filter_map(|line| joiner.take_line(line.text, line.number)).collect();
    fixes.extend(joiner.finish());
    accuracies(&log, &mut fixes);
    let mut stats = joiner.stats();
    if let Some(Alternation { n_fixes, apart_m }) = alternation(&fixes) {
        stats.alternating = n_fixes;
        stats.apart_mm = stats.apart_mm.max((apart_m * 1000.0) as u64);
    }
    (fixes, stats)
}

/// The first date of a position; without one, of ZDA.
fn first_date(log: &[u8]) -> Option<Stamp> {
    let mut of_zda = None;
    for line in lines(log) {
        match sentence(line.text) {
            Ok(Sentence::Rmc(Rmc { stamp: Some(stamp), is_valid: true, .. })) => return Some(stamp),
            Ok(Sentence::Zda(zda)) => of_zda = of_zda.or(zda.stamp),
            _ => {}
        }
    }
    of_zda
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nmea::{gga_from_fix, gga_without_fix, gst_from_fix, rmc_from_fix, rmc_without_fix};

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
            vdop: None,
            deviation: None,
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
        let first_bad = stats.first_bad.clone().expect("has one");
        assert!(first_bad.starts_with("line 3: checksum "), "{first_bad}");
        let first_bad = Some(first_bad);
        assert_eq!(stats, LogStats { sentences: 8, bad_lines: 2, out_of_order: 1, first_bad, ..LogStats::default() });
        // The GGA of the second fix is damaged, so it has no height.
        assert_eq!(back.iter().map(|fix| fix.altitude_m.is_some()).collect::<Vec<_>>(), [true, false, true, true]);
    }

    #[test]
    fn gga_is_dated_by_zda_and_by_a_later_date() {
        let zda = |stamp: Stamp| {
            let (year, month, day) = files::calendar::date_from_days(stamp.0.div_euclid(86_400_000_000_000));
            let time = gga_from_fix(&fix(0), 0.0).split(',').nth(1).expect("has a time").to_owned();
            format!("$GPZDA,{time},{day:02},{month:02},{year},00,00")
        };
        // The date follows after two epochs.
        for at in [0, 2] {
            let mut lines: Vec<String> = (0..10).map(|i| gga_from_fix(&fix(i), 44.6)).collect();
            lines.insert(at, zda(fix(0).stamp));
            let (back, stats) = fixes(&log(lines.into_iter()));
            assert_eq!((back.len(), stats.undated, stats.sentences), (10, 0, 11));
            assert_eq!(stats.without_checksum, 1, "of the ZDA");
            back.iter().zip(0..).for_each(|(back, i)| assert_near(back, &fix(i)));
        }
        let (back, stats) = fixes(&log((0..3).map(|i| gga_from_fix(&fix(i), 44.6))));
        assert_eq!((back.len(), stats.undated), (0, 3));
        assert!(stats.left_out().contains("3 before the first RMC or ZDA"), "{}", stats.left_out());
    }

    #[test]
    fn second_talker_is_counted_and_a_second_receiver_measured() {
        let other_talker = |line: String| {
            let body = line[3..].rsplit_once('*').expect("is sealed").0.to_owned();
            format!("$GN{body}")
        };
        let lines = |offset_deg: f64| {
            let two = (0..10).flat_map(move |i| {
                let first = fix(i);
                let mut second = first;
                second.position_deg[0] += offset_deg;
                [
                    gga_from_fix(&first, 44.6),
                    other_talker(gga_from_fix(&second, 44.6)),
                    rmc_from_fix(&first),
                    other_talker(rmc_from_fix(&second)),
                ]
            });
            fixes(&log(two))
        };
        let (back, stats) = lines(0.0);
        assert_eq!((back.len(), stats.repeated, stats.conflicting, stats.out_of_order), (10, 20, 0, 0));
        assert!(back.iter().all(|fix| fix.speed_mps.is_some() && fix.altitude_m.is_some()));
        let (back, stats) = lines(1e-4);
        assert_eq!((back.len(), stats.repeated, stats.conflicting), (10, 20, 10));
        assert!((11_000..11_300).contains(&stats.apart_mm), "{} mm", stats.apart_mm);
        back.iter().zip(0..).for_each(|(back, i)| assert_near(back, &fix(i)));
    }

    #[test]
    fn deviations_precede_or_follow_their_fix_and_expire() {
        let deviation = Some(StatedDeviation { across_m: 1.5, up_m: 2.5 });
        let stated = Fix { deviation, ..fix(0) };
        let gst = gst_from_fix(&stated).expect("has deviations");
        // Epochs of half a second: the deviations are 2 s old at the fifth one.
        let epochs = (0..8).flat_map(|i| [gga_from_fix(&fix(i), 44.6), rmc_from_fix(&fix(i))]);
        let (back, stats) = fixes(&log([gst].into_iter().chain(epochs)));
        let with: Vec<bool> = back.iter().map(|fix| fix.deviation.is_some()).collect();
        assert_eq!(with, [true, true, true, true, true, false, false, false]);
        let first = back[0].deviation.expect("is stated");
        assert!((first.across_m - 1.5).abs() < 1e-9 && (first.up_m - 2.5).abs() < 1e-9, "{first:?}");
        assert_eq!((stats.sentences, stats.other_sentences), (16, 1));
    }

    #[test]
    fn null_island_is_not_a_fix() {
        let mut lost = fix(0);
        lost.position_deg = [0.0; 2];
        let lines = [gga_from_fix(&lost, 0.0), rmc_from_fix(&lost), gga_from_fix(&fix(1), 44.6), rmc_from_fix(&fix(1))];
        let (back, stats) = fixes(&log(lines.into_iter()));
        assert_eq!((back.len(), stats.null_islands, stats.without_fix), (1, 1, 0));
        assert_near(&back[0], &fix(1));
    }

    #[test]
    fn fixes_without_geoid_separation_have_no_height_and_are_counted() {
        let gga = gga_from_fix(&fix(1), 0.0).replace(",0.0,M,,", ",,,,");
        let gga = gga.rsplit_once('*').expect("is sealed").0.to_owned();
        let text = log([gga, rmc_from_fix(&fix(1))].into_iter());
        let (back, stats) = fixes(&text);
        assert_eq!((back.len(), back[0].altitude_m, stats.without_geoid), (1, None, 1));
        assert!(stats.left_out().contains("1 without geoid separation (set gnss.geoid_m"), "{}", stats.left_out());
        let height_m = 104.25 + 1.0;
        let (back, stats) = fixes_above_geoid(&text, Some(44.0));
        assert_eq!((back[0].altitude_m, stats.without_geoid), (Some(height_m + 44.0), 0));
    }
}
