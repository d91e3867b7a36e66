//! Whether the sensors cover the same time, and whether their clocks agree.

use super::DriveReport;
use super::lidar::LidarSurvey;
use super::stream::seconds_between;
use geometry::Stamp;
use lidar::ClockReference;
use std::collections::BTreeMap;

/// A sensor that starts later or ends earlier than the LiDAR by more than this, s, misses a part of the drive.
const MAX_MISSING_S: f64 = 2.0;
/// Start and end of a sensor with another clock are off by the same time within this, s; recordings do not start at the same
/// moment.
const MAX_SPREAD_S: f64 = 5.0;
/// Step of the offsets of time zones, s: some are off by half an hour.
const ZONE_S: f64 = 1800.0;
/// Leap seconds between UTC and GPS time since 2017, and between UTC and TAI.
const LEAP_SECONDS: [(f64, &str); 2] = [(18.0, "GPS time"), (37.0, "TAI")];
/// Largest deviation from a leap second count by which an offset is still attributed to it, s.
const LEAP_TOLERANCE_S: f64 = 0.6;
/// Largest share of packets in which the clock of the LiDAR has no reference, as `acquire.max_unlocked_share` by default.
const MAX_UNLOCKED_SHARE: f64 = 0.5;
/// Largest difference of the clocks of LiDAR and capturing machine that is usual, s.
const MAX_CAPTURE_OFFSET_S: f64 = 1.0;

/// Adds facts and doubts.
pub fn add(lidar: &LidarSurvey, report: &mut DriveReport) {
    let mut lines = Vec::new();
    if let Some(Remark { line, doubt }) = referenced(&lidar.clock_references) {
        lines.push(line);
        // A LiDAR alone needs no other clock.
        let has_others = report.streams.iter().any(|stream| !stream.is_reference && stream.name != "lidar sweeps");
        report.doubts.extend(doubt.filter(|_| has_others));
    }
    if let Some(ahead_s) = lidar.ahead_of_capture_s {
        lines.push(format!("LiDAR minus capturing machine: {ahead_s:+.3} s"));
        if ahead_s.abs() > MAX_CAPTURE_OFFSET_S && lidar.capture_ahead_of_gnss_s.is_none() {
            report.doubt(format!(
                "clocks: the LiDAR is {ahead_s:+.1} s off the capturing machine, and no receiver shows which of the two is right"
            ));
        }
    }
    if let Some(ahead_s) = lidar.capture_ahead_of_gnss_s {
        lines.push(format!("capturing machine minus GNSS of the position packets: {ahead_s:+.3} s"));
        if ahead_s.abs() > MAX_CAPTURE_OFFSET_S {
            let text = explained(ahead_s).map(|why| format!(" ({why})")).unwrap_or_default();
            report.doubt(format!(
                "clocks: the capturing machine is {ahead_s:+.1} s off GNSS time{text}; LiDAR times are corrected, cameras \
                 that this machine stamps are not"
            ));
        }
    }
    let Some(reference) = report.lidar_span() else {
        report.section("Clocks", lines);
        return;
    };
    let others: Vec<(String, [Stamp; 2], f64)> = report
        .streams
        .iter()
        .filter(|stream| !stream.is_reference && stream.name != "lidar sweeps")
        .filter_map(|stream| Some((stream.name.clone(), stream.span()?, stream.period_s().unwrap_or(0.0))))
        .collect();
    for (name, span, period_s) in others {
        let Remark { line, doubt } = compared(&name, span, reference, period_s);
        lines.push(line);
        report.doubts.extend(doubt);
    }
    report.section("Clocks", lines);
}

/// A line of the section, and a doubt.
struct Remark {
    line: String,
    doubt: Option<String>,
}

/// The reference that the LiDAR reports for its clock.
fn referenced(references: &BTreeMap<ClockReference, u64>) -> Option<Remark> {
    let n_all = references.values().sum::<u64>();
    if n_all == 0 {
        return None;
    }
    let percent = |n: u64| format!("{:.1} %", n as f64 / n_all as f64 * 100.0);
    let parts: Vec<String> = references.iter().map(|(reference, n)| format!("{reference} {}", percent(*n))).collect();
    let n_unlocked: u64 = references.iter().filter(|(reference, _)| !reference.is_locked()).map(|(_, n)| n).sum();
    let doubt = (n_unlocked as f64 > MAX_UNLOCKED_SHARE * n_all as f64).then(|| {
        format!(
            "clocks: the LiDAR reports that its clock follows neither PPS nor PTP in {} of its packets ({}): stamps of other \
             sensors may come from another clock",
            percent(n_unlocked),
            parts.join(", ")
        )
    });
    Some(Remark { line: format!("reference of the LiDAR's clock: {}", parts.join(", ")), doubt })
}

/// Compares start and end of a sensor with the LiDAR.
fn compared(name: &str, span: [Stamp; 2], lidar: [Stamp; 2], period_s: f64) -> Remark {
    let [begin_s, end_s] = [0, 1].map(|k| seconds_between(span[k], lidar[k]));
    let line = format!("{name}: begins {}, ends {}", relative(begin_s), relative(end_s));
    let lidar_s = seconds_between(lidar[1], lidar[0]);
    let has_overlap = span[0] <= lidar[1] && span[1] >= lidar[0];
    let spread_s = (begin_s - end_s).abs();
    let offset_s = f64::midpoint(begin_s, end_s);
    let is_shifted = spread_s <= MAX_SPREAD_S.max(0.1 * lidar_s);
    if is_shifted
        && (!has_overlap || offset_s.abs() > MAX_SPREAD_S)
        && let Some(why) = explained(offset_s)
    {
        return Remark { line, doubt: Some(format!("clocks: {name} is {offset_s:+.1} s off the LiDAR: {why}")) };
    }
    if !has_overlap {
        let text = format!("clocks: {name} has no time in common with the LiDAR: it is {offset_s:+.1} s off");
        return Remark { line, doubt: Some(text) };
    }
    // A slow sensor begins and ends up to one period within the drive.
    let allowed_s = MAX_MISSING_S.max(1.5 * period_s);
    let mut missing = Vec::new();
    if begin_s > allowed_s {
        missing.push(format!("begins {begin_s:.1} s after the LiDAR"));
    }
    if -end_s > allowed_s {
        missing.push(format!("ends {:.1} s before the LiDAR", -end_s));
    }
    let doubt = (!missing.is_empty()).then(|| format!("{name} {}", missing.join(" and ")));
    Remark { line, doubt }
}

fn relative(seconds: f64) -> String {
    let word = if seconds < 0.0 { "before" } else { "after" };
    format!("{:.3} s {word} the LiDAR", seconds.abs())
}

/// The usual reason of an offset between clocks.
fn explained(offset_s: f64) -> Option<String> {
    let zones = (offset_s / ZONE_S).round();
    if zones != 0.0 && (offset_s - zones * ZONE_S).abs() <= MAX_SPREAD_S && zones.abs() <= 28.0 {
        let hours = zones / 2.0;
        return Some(format!("{hours:+} hours: one clock shows local time, or the hour is wrong"));
    }
    let leap = LEAP_SECONDS.iter().find(|(leap_s, _)| (offset_s.abs() - leap_s).abs() <= LEAP_TOLERANCE_S);
    leap.map(|(leap_s, time)| format!("{leap_s:.0} leap seconds: one clock shows {time}, the other UTC"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn span(begin_s: f64, end_s: f64) -> [Stamp; 2] {
        [begin_s, end_s].map(|seconds| Stamp::from_seconds(1_700_000_000.0 + seconds))
    }

    #[test]
    fn reference_of_the_clock_is_told_and_doubted_where_it_is_absent() {
        let of = |counts: &[(ClockReference, u64)]| referenced(&counts.iter().copied().collect());
        assert!(of(&[]).is_none());
        let Remark { line, doubt } =
            of(&[(ClockReference::Pulse, 3), (ClockReference::PulseAbsent, 1)]).expect("references");
        assert_eq!(line, "reference of the LiDAR's clock: PPS locked 75.0 %, PPS absent 25.0 %");
        assert_eq!(doubt, None);
        let remark = of(&[(ClockReference::FreeRunning, 3), (ClockReference::Ptp, 1)]).expect("references");
        assert!(
            remark.doubt.is_some_and(|text| text.contains("75.0 % of its packets (PTP 25.0 %, free-running 75.0 %)"))
        );
    }

    #[test]
    fn offsets_of_clocks_are_explained_and_missing_parts_are_named() {
        let doubt = |begin_s: f64, end_s: f64| {
            compared("camera 0", span(begin_s, end_s), span(0.0, 60.0), 0.5).doubt.unwrap_or_default()
        };
        assert_eq!(doubt(0.3, 59.9), "");
        assert_eq!(doubt(-30.0, 80.0), "", "longer than the LiDAR");
        assert_eq!(doubt(0.2, 48.0), "camera 0 ends 12.0 s before the LiDAR");
        assert_eq!(doubt(4.0, 57.5), "camera 0 begins 4.0 s after the LiDAR and ends 2.5 s before the LiDAR");
        assert!(doubt(3600.4, 3660.1).contains("+3600.2 s off the LiDAR: +1 hours"), "{}", doubt(3600.4, 3660.1));
        assert!(doubt(-5400.0, -5340.0).contains("-1.5 hours"));
        assert!(doubt(18.1, 78.0).contains("18 leap seconds: one clock shows GPS time"));
        assert!(doubt(700.0, 760.0).contains("no time in common"));
    }
}
