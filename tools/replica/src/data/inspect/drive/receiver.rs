//! The GNSS receiver: fixes, their quality, jumps, and the path.

use super::DriveReport;
use super::lidar::LidarSurvey;
use super::stream::{Stream, seconds_between};
use anyhow::Context;
use drive::Drive;
use geometry::{Geodetic, LocalFrame, Vector3};
use lidar::nmea::{Fix, LogStats};
use std::collections::BTreeMap;

/// Faster than any car, m/s: a fix that implies this speed since the fix before it is a jump.
const MAX_SPEED_MPS: f64 = 70.0;
/// The path is unknown over a longer time between fixes, s.
const MAX_GAP_S: f64 = 5.0;
/// Share of epochs without position above which a doubt is reported.
const MAX_LOST_SHARE: f64 = 0.1;
/// Median HDOP above which a doubt is reported: positions are then several times worse than with open sky.
const MAX_HDOP: f64 = 5.0;

/// Adds the stream, facts and doubts.
pub fn add(drive: &Drive, lidar: &LidarSurvey, report: &mut DriveReport) -> anyhow::Result<()> {
    let (fixes, log, kind) = match &drive.manifest().gnss {
        Some(entry) => {
            let (fixes, log) = drive.fixes().with_context(|| entry.file.clone())?;
            (fixes, log, "NMEA log")
        }
        None if !lidar.fixes.is_empty() => (lidar.fixes.clone(), lidar.log.clone(), "position packets"),
        None => {
            report.section("GNSS", vec!["no receiver".to_owned()]);
            return Ok(());
        }
    };
    let stamps = fixes.iter().map(|fix| fix.stamp.0).collect();
    let mut stream = Stream::new("gnss", kind, stamps);
    if let Some(entry) = &drive.manifest().gnss {
        let file = drive.folder().join(&entry.file);
        stream = stream.with_files(1, file.metadata().map_or(0, |metadata| metadata.len()));
    }
    report.streams.push(stream);
    let mut lines = quality(&fixes, &log, report);
    lines.extend(path(&fixes, report));
    report.fixes = fixes;
    report.section("GNSS", lines);
    Ok(())
}

fn quality(fixes: &[Fix], log: &LogStats, report: &mut DriveReport) -> Vec<String> {
    let mut by_quality: BTreeMap<u32, usize> = BTreeMap::new();
    for fix in fixes {
        *by_quality.entry(fix.quality).or_default() += 1;
    }
    let name = |quality: u32| match quality {
        1 => "single".to_owned(),
        2 => "differential".to_owned(),
        4 => "RTK fixed".to_owned(),
        5 => "RTK float".to_owned(),
        6 => "estimated".to_owned(),
        7 => "manual input".to_owned(),
        8 => "simulated".to_owned(),
        other => format!("quality {other}"),
    };
    let qualities: Vec<String> = by_quality.iter().map(|(quality, n)| format!("{} {n}", name(*quality))).collect();
    let mut lines = vec![format!("fixes: {} ({})", fixes.len(), qualities.join(", "))];
    let n_epochs = fixes.len() as u64 + log.without_fix;
    if log.without_fix > 0 {
        lines.push(format!("epochs without position: {}", log.without_fix));
    }
    if log.without_fix as f64 > MAX_LOST_SHARE * n_epochs as f64 {
        report.doubt(format!("gnss: {} of {n_epochs} epochs have no position", log.without_fix));
    }
    if log.out_of_order > 0 {
        lines.push(format!("fixes out of order: {}", log.out_of_order));
    }
    let first_bad = log.first_bad.as_ref().map(|first| format!("; the first: {first}")).unwrap_or_default();
    if log.bad_lines > 0 {
        lines.push(format!("bad lines: {}{first_bad}", log.bad_lines));
    }
    if log.bad_lines * 100 > log.sentences {
        let n = log.sentences;
        report.doubt(format!("gnss: {} lines are damaged or impossible, of {n} sentences{first_bad}", log.bad_lines));
    }
    lines.extend(
        [
            (log.without_checksum, "sentences without checksum"),
            (log.null_islands, "skipped fixes at 0 0"),
            (log.undated, "skipped fixes before the first date"),
            (log.repeated, "skipped sentences of a second talker in their epoch"),
        ]
        .into_iter()
        .filter(|(n, _)| *n > 0)
        .map(|(n, what)| format!("{what}: {n}")),
    );
    if log.undated > 0 {
        report.doubt(format!("gnss: {} fixes have no date: log RMC or ZDA sentences", log.undated));
    }
    if log.null_islands > 0 {
        let n = log.null_islands;
        report.doubt(format!(
            "gnss: {n} fixes at 0 0 are skipped: the receiver reported a position that it did not have"
        ));
    }
    if log.conflicting > 0 {
        let apart_m = log.apart_mm as f64 / 1000.0;
        let n = log.conflicting;
        report.doubt(format!(
            "gnss: {n} epochs have two positions, up to {apart_m:.1} m apart: two receivers in one log"
        ));
    }
    let without_height = fixes.iter().filter(|fix| fix.altitude_m.is_none()).count();
    if without_height > 0 {
        lines.push(format!("fixes without height: {without_height}"));
        if without_height * 2 > fixes.len() {
            let fields = if log.without_geoid > 0 {
                " with geoid separation (field 11), or set gnss.geoid_m in drive.toml"
            } else {
                ""
            };
            let n = fixes.len();
            report.doubt(format!("gnss: {without_height} of {n} fixes have no height: log GGA sentences{fields}"));
        }
    }
    let mut hdops: Vec<f64> = fixes.iter().filter_map(|fix| fix.hdop).collect();
    hdops.sort_by(f64::total_cmp);
    if let Some(last) = hdops.last() {
        let median = hdops[hdops.len() / 2];
        lines.push(format!("HDOP: median {median:.1}, largest {last:.1}"));
        if median > MAX_HDOP {
            report.doubt(format!("gnss: the median HDOP is {median:.1}, above {MAX_HDOP}"));
        }
    }
    if fixes.is_empty() {
        report.doubt("gnss: no fix in the log");
    }
    lines
}

/// Length, extent and jumps of the path.
fn path(fixes: &[Fix], report: &mut DriveReport) -> Vec<String> {
    let geodetic =
        |fix: &Fix| Geodetic::new(fix.position_deg[0], fix.position_deg[1], fix.altitude_m.unwrap_or_default());
    let Some(origin) = fixes.first().and_then(geodetic) else { return Vec::new() };
    let frame = LocalFrame::new(origin);
    let places: Vec<(&Fix, Vector3<f64>)> =
        fixes.iter().filter_map(|fix| Some((fix, frame.world_from_geodetic(&geodetic(fix)?).coords))).collect();
    let mut length_m = 0.0;
    let mut unknown_s = 0.0;
    let mut n_jumps = 0;
    let mut first_jump = None;
    for pair in places.windows(2) {
        let [(before, from), (fix, to)] = [pair[0], pair[1]];
        let seconds = fix.stamp.seconds_since(before.stamp);
        let distance_m = (to - from).xy().norm();
        if seconds > 0.0 && distance_m / seconds > MAX_SPEED_MPS {
            n_jumps += 1;
            first_jump.get_or_insert((fix.stamp, distance_m));
        } else if seconds > MAX_GAP_S {
            unknown_s += seconds;
        } else {
            length_m += distance_m;
        }
    }
    report.path_m = places.iter().map(|(_, place)| [place.x, place.y]).collect();
    let extent = |axis: usize| {
        let values = || places.iter().map(|(_, place)| place[axis]);
        values().fold(f64::NEG_INFINITY, f64::max) - values().fold(f64::INFINITY, f64::min)
    };
    let Geodetic { latitude_deg, longitude_deg, .. } = origin;
    let mut lines = vec![
        format!(
            "path: {length_m:.0} m; extent {:.0} m east, {:.0} m north, {:.0} m up",
            extent(0),
            extent(1),
            extent(2)
        ),
        format!("first fix: {latitude_deg:.6} {longitude_deg:.6}"),
    ];
    if unknown_s > 0.0 {
        lines.push(format!("path unknown during {unknown_s:.1} s of gaps"));
    }
    if let Some((stamp, distance_m)) = first_jump {
        let after_s = report.lidar_span().map_or(0.0, |[first, _]| seconds_between(stamp, first));
        report.doubt(format!(
            "gnss: {n_jumps} jumps faster than {MAX_SPEED_MPS} m/s, the first of {distance_m:.0} m at {after_s:+.1} s"
        ));
    }
    lines
}
