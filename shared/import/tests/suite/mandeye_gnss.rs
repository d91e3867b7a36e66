//! Fixes of `MandEye` folders, written by the tests in the format of the recorder.

use super::mandeye::{imported, recording};
use super::support::{Import, folder, import_from, write_file};
use drive::Drive;
use lidar::nmea::{Fix, LogStats};
use std::path::PathBuf;
use tempfile::TempDir;

/// An older line: degrees and minutes.
const FIRST: &str = "4321300848940 5156.43798828125 2009.1610107421875 122.1999969482421875 1.25 8 35.799999237060546875 nan 14:51:42 1";

fn with(folder: &TempDir, files: &[(&str, &[u8])]) -> (PathBuf, Import) {
    let root = recording(folder);
    for (name, bytes) in files {
        write_file(&root.join(name), bytes);
    }
    let import = import_from(&root, folder);
    (root, import)
}

fn fixes(drive: &Drive) -> Vec<Fix> {
    let (fixes, stats) = drive.fixes().expect("reads");
    let n = 2 * fixes.len() as u64;
    assert_eq!(stats, LogStats { sentences: n, ..LogStats::default() }, "the drive reads each line");
    fixes
}

fn sealed(body: &str) -> String {
    format!("${body}*{:02X}", body.bytes().fold(0, |sum, byte| sum ^ byte))
}

fn near(fix: &Fix, degrees: [f64; 2]) -> bool {
    (0..2).all(|axis| (fix.position_deg[axis] - degrees[axis]).abs() < 1e-8)
}

#[test]
fn values_of_the_recorder_become_fixes_with_stamps_of_the_sensor() {
    let folder = folder();
    let lines = format!(
        "{FIRST}\n\
         4321500848940 5156.43798828125 2009.1610107421875 121 1.25 8 35.8 nan 14:51:43 1\n\
         4321500948940 5156.438 2009.161 121 1.25 8 35.8 nan 14:51:43 1\n\
         4321600000000 nan nan nan 99.9 0 nan nan 14:51:44 0\n"
    );
    // A newer file: degrees, an unknown geoid height, and the time of the computer.
    let newer = "4321700000000 -33.5 -70.25 500.5 0.75 12 nan nan 14:51:44 4 1700000000123\n\
                 4321800000000 -33.5 -70.25 500.5 nan 12 28.25 nan 14:51:45 5 1700000000323\n";
    let (_, import) = with(&folder, &[("gnss0000.gnss", lines.as_bytes()), ("gnss0001.gnss", newer.as_bytes())]);
    let (report, drive) = imported(&import);
    let line = "imported: 4 GNSS fixes; 1 without position are left out; \
                1 whose stamp is not later than the previous one are left out";
    assert!(report.iter().any(|found| found == line), "{report:?}");
    assert!(!report.iter().any(|line| line.contains("not imported: gnss")), "{report:?}");
    let found = fixes(&drive);
    // Times of sentences are in ms.
    let stamps: Vec<i64> = found.iter().map(|fix| fix.stamp.0).collect();
    assert_eq!(stamps, [4_321_300_000_000, 4_321_500_000_000, 4_321_700_000_000, 4_321_800_000_000]);
    let warsaw = [51.0 + 56.437_988_281_25 / 60.0, 20.0 + 9.161_010_742_187_5 / 60.0];
    assert!(near(&found[0], warsaw) && near(&found[2], [-33.5, -70.25]), "{found:?}");
    assert!((found[0].altitude_m.expect("has one") - 158.0).abs() < 1e-3, "{found:?}");
    assert!((found[3].altitude_m.expect("has one") - 528.75).abs() < 1e-3, "{found:?}");
    assert_eq!((found[2].altitude_m, found[3].hdop), (None, None));
    let qualities: Vec<_> = found.iter().map(|fix| (fix.quality, fix.satellites)).collect();
    assert_eq!(qualities, [(1, 8), (1, 8), (4, 12), (5, 12)]);
    let entry = drive.manifest().gnss.as_ref().expect("has one");
    assert!(entry.origin[..2] == warsaw && (entry.origin[2] - 158.0).abs() < 1e-5, "{entry:?}");
}

#[test]
fn sentences_of_the_recorder_are_joined_by_their_times_and_have_the_stamps_of_the_sensor() {
    let folder = folder();
    let rmc = |time: &str| sealed(&format!("GNRMC,{time},A,5212.01834,N,02056.49288,E,1.953,254.11,080725,,,R,V"));
    let gga =
        |time: &str| sealed(&format!("GPGGA,{time},5212.02878,N,02056.51988,E,4,12,0.94,109.1,M,34.4,M,2.0,0093"));
    let lines = [
        // First the position before the motion, then the reverse; the fix has the stamp of the position.
        format!("4321300000000 1752000000000 {} ", gga("184852.00")),
        format!("4321304000000 1752000000004 {} ", rmc("184852.00")),
        format!("4321400000000 1752000000100 {} ", rmc("184852.10")),
        format!("4321405000000 1752000000105 {} ", gga("184852.10")),
        // Without motion, and in the form of the first recorders.
        format!("4321505000000 {}", gga("184852.20")),
        format!("4321506000000 {}", sealed("GPGGA,184852.30,,,,,0,00,,,M,,M,,")),
        format!("4321507000000 {}", sealed("GPGSV,1,1,00")),
    ];
    let values = format!("{FIRST}\n");
    let (_, import) =
        with(&folder, &[("gnss0000.nmea", lines.join("\r\n").as_bytes()), ("gnss0000.gnss", values.as_bytes())]);
    let (report, drive) = imported(&import);
    assert!(report.contains(&"imported: 3 GNSS fixes; 1 without position are left out".to_owned()), "{report:?}");
    assert!(report.contains(&"not imported: gnss0000.gnss".to_owned()), "{report:?}");
    let found = fixes(&drive);
    let stamps: Vec<i64> = found.iter().map(|fix| fix.stamp.0 / 1_000_000).collect();
    assert_eq!(stamps, [4_321_300, 4_321_405, 4_321_505]);
    for (fix, has_motion) in found.iter().zip([true, true, false]) {
        assert!(near(fix, [52.0 + 12.028_78 / 60.0, 20.0 + 56.519_88 / 60.0]), "{fix:?}");
        assert!((fix.altitude_m.expect("has one") - 143.5).abs() < 1e-3, "{fix:?}");
        assert_eq!((fix.course_deg, fix.speed_mps.is_some()), (has_motion.then_some(254.11), has_motion));
    }
    let speed_mps = found[0].speed_mps.expect("has one");
    assert!((speed_mps - 1.953 * 1852.0 / 3600.0).abs() < 1e-3, "{speed_mps}");
}

#[test]
fn bad_lines_are_counted_and_the_first_is_named() {
    let cases: [(&str, &[u8], &str); 9] = [
        ("gnss.gnss", b"1 2 3\n", ":1: 3 values; a line has 10: timestamp lat lon"),
        ("gnss.gnss", b"x 51.5 20 122 1 8 35 nan 14:51:42 1\n", ":1: timestamp is \"x\"; it must be a number of ns"),
        ("gnss.gnss", b"-5 51.5 20 122 1 8 35 nan 14:51:42 1\n", ":1: timestamp is \"-5\"; it must be"),
        ("gnss.gnss", b"5 51.5 ? 122 1 8 35 nan 14:51:42 1\n", ":1: lon is \"?\"; it must be a number"),
        ("gnss.gnss", b"5 51.5 20 122 1 -8 35 nan 14:51:42 1\n", ":1: satelites_tracked is \"-8\"; it must be a count"),
        ("gnss.gnss", b"5 5160.5 2000 122 1 8 35 nan 14:51:42 1\n", ":1: lat 5160.5 lon 2000 must be degrees, or"),
        ("gnss.gnss", b"5 51.5 20 99999 1 8 35 nan 14:51:42 1\n", ":1: GGA field 9: \"100034.000\" is not a number"),
        (
            "gnss.gnss",
            b"9000000000000000000 51.5 20 122 1 8 35 nan 14:51:42 1\n",
            ":1: the stamp 9000000000000000000 ns must be in the years 1970 to 2069",
        ),
        ("gnss.nmea", b"5 $GPGGA,\xff\xfe,,*00\n", ":1: not a sentence; expected $...*hh"),
    ];
    for (name, line, rule) in cases {
        let folder = folder();
        let good = if name == "gnss.gnss" {
            FIRST.to_owned()
        } else {
            let body = "GPGGA,184852.00,5212.02878,N,02056.51988,E,4,12,0.94,109.1,M,34.4,M,2.0,0093";
            format!("4321300000000 {}", sealed(body))
        };
        let bytes = [line, line, good.as_bytes()].concat();
        let (_, import) = with(&folder, &[(name, &bytes)]);
        let (report, drive) = imported(&import);
        let found = report.iter().find(|line| line.contains("GNSS")).expect("has a line");
        assert!(found.starts_with("imported: 1 GNSS fixes; 2 bad lines are left out, the first: "), "{found}");
        assert!(found.contains(&format!("{name}{rule}")), "{rule}: {found}");
        assert_eq!(fixes(&drive).len(), 1);
    }
}

#[test]
fn receiver_that_never_had_a_position_is_left_and_lidar_only_does_not_read_it() {
    let folder = folder();
    let line = b"4321600000000 0 0 0 99.9 0 0 nan 14:51:44 0\n";
    let (_, import) = with(&folder, &[("gnss0000.gnss", line)]);
    let (report, drive) = imported(&import);
    let lines: Vec<&String> = report.iter().filter(|line| line.to_lowercase().contains("gnss")).collect();
    assert_eq!(
        lines,
        ["GNSS: 0 fixes, none with a height; 1 without position are left out", "not imported: gnss0000.gnss"]
    );
    assert_eq!(drive.manifest().gnss, None);
    std::fs::remove_dir_all(&import.out).expect("removes");
    let (_, mut import) = with(&folder, &[("gnss0000.gnss", FIRST.as_bytes())]);
    import.options.lidar_only = true;
    let (report, drive) = imported(&import);
    assert!(report.contains(&"not imported: gnss0000.gnss".to_owned()), "{report:?}");
    assert_eq!(drive.manifest().gnss, None);
}

#[test]
fn files_cut_anywhere_are_read_up_to_the_cut() {
    let body = "GPGGA,184852.00,5212.02878,N,02056.51988,E,4,12,0.94,109.1,M,34.4,M,2.0,0093";
    for (name, line) in
        [("gnss.gnss", FIRST.to_owned()), ("gnss.nmea", format!("4321300000000 1752000000000 {}", sealed(body)))]
    {
        for length in 0..line.len() {
            let folder = folder();
            let (_, import) = with(&folder, &[(name, &line.as_bytes()[..length])]);
            let (report, drive) = imported(&import);
            assert!(fixes(&drive).is_empty(), "{length}: {report:?}");
        }
    }
}
