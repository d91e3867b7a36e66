//! Logs of 33 receivers, compared with the positions that gpsd reports of them.

use files::calendar::days_from_date;
use lidar::nmea::{self, Fix};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// GPS weeks are counted with 10 bits, and gpsd replaces dates that are too early by the same day 1024 weeks later.
const ROLLOVER_MILLIS: i64 = 1024 * 7 * 86_400_000;

/// A report of gpsd.
#[derive(Clone, Copy)]
struct Report {
    position_deg: [f64; 2],
    /// Above the ellipsoid, m.
    height_m: Option<f64>,
}

/// The reports of a log: all, and the last one of each millisecond.
#[derive(Default)]
struct Reports {
    all: Vec<Report>,
    by_time: BTreeMap<i64, Vec<Report>>,
}

/// Milliseconds of `2026-03-13T02:16:12.949Z` within 1024 weeks.
fn millis(text: &str) -> i64 {
    let number = |range: std::ops::Range<usize>| text[range].parse::<i64>().expect("is a number");
    let days = days_from_date(number(0..4), number(5..7), number(8..10)).expect("is a date");
    let minutes = (days * 24 + number(11..13)) * 60 + number(14..16);
    (minutes * 60_000 + number(17..19) * 1000 + number(20..23)).rem_euclid(ROLLOVER_MILLIS)
}

fn reports(path: &Path) -> Reports {
    let mut reports = Reports::default();
    for line in fs::read_to_string(path).expect("reads").lines() {
        let Ok(value) = serde_json::from_str::<Value>(line) else { continue };
        let Some(position_deg) = value["lat"].as_f64().zip(value["lon"].as_f64()) else { continue };
        let report = Report { position_deg: position_deg.into(), height_m: value["altHAE"].as_f64() };
        reports.all.push(report);
        if let Some(time) = value["time"].as_str() {
            reports.by_time.entry(millis(time)).or_default().push(report);
        }
    }
    reports
}

fn has_position(reports: &[Report], fix: &Fix, tolerance_deg: f64) -> bool {
    reports.iter().any(|report| {
        report.position_deg.iter().zip(fix.position_deg).all(|(one, other)| (one - other).abs() < tolerance_deg)
    })
}

#[real_data::test("receiver_logs")]
fn fixes_of_receivers_are_the_positions_and_times_of_gpsd() {
    let folder = fs::read_dir(real_data::path("receiver_logs")).expect("lists");
    let logs: Vec<PathBuf> = folder.map(|entry| entry.expect("is one").path()).collect();
    let logs: Vec<PathBuf> = logs.into_iter().filter(|path| path.extension().is_some_and(|end| end == "log")).collect();
    assert_eq!(logs.len(), 33);
    let mut n_fixes = 0;
    let mut n_heights = 0;
    for path in &logs {
        let name = path.file_name().expect("has a name").display();
        let (fixes, stats) = nmea::fixes(&fs::read(path).expect("reads"));
        let reports = reports(&path.with_extension("log.chk"));
        let by_time: BTreeMap<i64, &Fix> =
            fixes.iter().map(|fix| ((fix.stamp.0 / 1_000_000).rem_euclid(ROLLOVER_MILLIS), fix)).collect();
        for (time, reports) in &reports.by_time {
            let fix = by_time.get(time).unwrap_or_else(|| panic!("{name}: no fix at {time} ms"));
            // One log has GGA with a digit more than RMC.
            assert!(has_position(reports, fix, 5e-7), "{name} at {time} ms: {:?}", fix.position_deg);
            let heights = reports.iter().filter_map(|report| report.height_m).zip(fix.altitude_m);
            let apart_m = heights.map(|(one, other)| (one - other).abs()).reduce(f64::min);
            assert!(
                apart_m.is_none_or(|apart_m| apart_m < 0.051),
                "{name} at {time} ms: heights differ by {apart_m:?} m"
            );
            n_heights += usize::from(apart_m.is_some());
        }
        // gpsd leaves out some epochs at the start and the end of logs or without GGA, and reports the epochs of two simulators without time.
        let is_simulator = reports.by_time.is_empty();
        let n_more = fixes.len() - reports.by_time.len();
        assert!(n_more <= if is_simulator { 18 } else { 2 }, "{name}: {n_more} more fixes than gpsd");
        let n_strange = fixes.iter().filter(|fix| !has_position(&reports.all, fix, 2e-9)).count();
        assert!(is_simulator || n_strange <= 2, "{name}: {n_strange} positions that gpsd does not report");
        assert_eq!((stats.undated, stats.out_of_order, stats.conflicting, stats.null_islands), (0, 0, 0, 0), "{name}");
        assert_eq!(stats.alternating, 0, "{name}: {} mm", stats.apart_mm);
        n_fixes += fixes.len();
    }
    assert_eq!((n_fixes, n_heights), (860, 698));
}

/// The number of fixes with stated deviations, and the last fix.
fn stated(name: &str) -> (usize, Fix) {
    let path = real_data::path(&format!("receiver_logs/{name}.log"));
    let (fixes, _) = nmea::fixes(&fs::read(path).expect("reads"));
    (fixes.iter().filter(|fix| fix.deviation.is_some()).count(), *fixes.last().expect("has fixes"))
}

#[real_data::test("receiver_logs")]
fn deviations_and_vertical_dilutions_of_receivers_reach_their_fixes() {
    // GST and GSA follow the fix, so the first fix lacks them. gpsd: lat 2.3 to 2.4, lon 3.5, alt 4.0 to 4.2; vdop 0.83 to 0.92.
    let (n, last) = stated("ublox-zed-f9p-nmea");
    let deviation = last.deviation.expect("is stated");
    assert!(n >= 27, "{n}");
    assert!((deviation.across_m - 2.3_f64.hypot(3.5) / 2_f64.sqrt()).abs() < 0.15, "{deviation:?}");
    assert!((deviation.up_m - 4.1).abs() < 0.2 && last.vdop == Some(0.92), "{last:?}");
    // An ellipse of 14 by 5 m contradicts axes of 0.9 and 0.5 m.
    let (n, last) = stated("skytraq-fixB");
    let deviation = last.deviation.expect("is stated");
    assert!(n >= 5 && deviation.across_m > 8.0 && deviation.up_m < 1.0, "{n} {deviation:?}");
    // GSA only.
    let (n, last) = stated("venus634lp");
    assert!(n == 0 && last.vdop.is_some(), "{n} {last:?}");
}

#[real_data::test("receiver_logs")]
fn binary_messages_between_sentences_of_a_receiver_change_no_fix() {
    let path = real_data::path("receiver_logs/ublox-zed-f9p-nmea.log");
    let log = fs::read(path).expect("reads");
    let plain = nmea::fixes(&log);
    // UBX-NAV-PVT starts before each sentence, has no line end of its own, and contains line ends and dollar signs.
    let mut ubx = b"\xb5\x62\x01\x07\x5c\x00".to_vec();
    ubx.extend((0..92_u8).map(|index| index.wrapping_mul(37)));
    ubx[20..24].copy_from_slice(b"\x80\n$G");
    ubx.extend(b"\x11\x22");
    let mixed: Vec<u8> = log.split_inclusive(|byte| *byte == b'\n').flat_map(|line| [&ubx, line].concat()).collect();
    let (fixes, stats) = nmea::fixes(&mixed);
    assert_eq!(fixes, plain.0);
    assert_eq!(stats, plain.1);
}
