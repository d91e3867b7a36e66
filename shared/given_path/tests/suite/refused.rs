//! The true path is accepted; each wrong reading of it is refused with its name.

use crate::drive::{NAMES, Row, START_S, entry, evidence, evidence_of_part, found, poses, read, rows};
use drive::manifest::{Clock, HeadingSense, TrajectoryEntry, TrajectoryFormat};
use formats::sbet::SbetRecord;
use geometry::Stamp;
use given_path::{Evidence, GivenPath, check};

#[test]
fn true_path_is_accepted_and_equals_the_truth() {
    let findings = found(NAMES, &rows(), &entry());
    assert_eq!(findings.problems, Vec::<String>::new());
    for words in ["heading agrees", "turning agrees", "places agree", "roll and pitch agree"] {
        assert!(findings.notes.iter().any(|note| note.contains(words)), "{words}: {:?}", findings.notes);
    }
    let path = read(NAMES, &rows(), &entry()).expect("is read");
    for (s, truth) in poses().iter().skip(1).step_by(333) {
        let pose = path.at(Stamp(((START_S + s) * 1e3).round() as i64 * 1_000_000)).expect("inside");
        // The table has angles against the vertical of the origin, 1 km away.
        let off = truth.inverse() * pose;
        assert!(off.translation.vector.norm() < 2e-3 && off.rotation.angle() < 5e-4, "{s}: {off}");
    }
}

/// A drive of 11 s with a bend to the left: the mean force of the unit is 7 degrees off the vertical.
#[test]
fn true_path_of_a_short_drive_in_a_bend_is_accepted() {
    for g in [1.0, 1.0 / 9.81] {
        let mut evidence = evidence_of_part(-5.0, 6.0);
        evidence.imu.iter_mut().for_each(|sample| sample.acceleration = sample.acceleration.map(|force| force * g));
        let findings = check(&read(NAMES, &rows(), &entry()).expect("is read"), &evidence);
        assert_eq!(findings.problems, Vec::<String>::new());
        assert!(findings.notes.iter().any(|note| note.contains("roll and pitch agree")), "{:?}", findings.notes);
    }
}

/// Asserts that a path is refused with these words.
fn refused(name: &str, rows: &[Row], names: &str, entry: &TrajectoryEntry, words: &[&str]) {
    let text = match read(names, rows, entry) {
        Ok(path) => check(&path, &evidence()).problems.join("\n"),
        Err(problem) => problem,
    };
    for words in words {
        assert!(text.contains(words), "{name}: expected {words:?} in {text:?}");
    }
}

fn changed(change: impl Fn(&mut Row)) -> Vec<Row> {
    let mut rows = rows();
    rows.iter_mut().for_each(change);
    rows
}

#[test]
fn wrong_senses_and_units_of_angles_are_named() {
    let math = TrajectoryEntry { heading: HeadingSense::CounterclockwiseFromEast, ..entry() };
    refused("compass as math", &rows(), NAMES, &math, &["the heading differs", "a compass heading is taken"]);
    let turned = changed(|row| row[6] = (90.0 - row[6]).rem_euclid(360.0));
    refused("math as compass", &turned, NAMES, &entry(), &["a compass heading is taken"]);
    let radians = changed(|row| row[6] = row[6].to_radians());
    refused("radians as degrees", &radians, NAMES, &entry(), &["the headings are in radians"]);
    let in_radians = "GPSTime,Latitude,Longitude,H-Ell,Roll,Pitch,Heading(rad)";
    refused("degrees as radians", &rows(), in_radians, &entry(), &["degrees are out of range", "must not say (rad)"]);
    let backwards = changed(|row| row[6] = (row[6] + 180.0).rem_euclid(360.0));
    refused("backwards", &backwards, NAMES, &entry(), &["faces backwards"]);
    let rolled = changed(|row| row[4] = -row[4]);
    refused("roll", &rolled, NAMES, &entry(), &["the opposite roll would fit"]);
    let pitched = changed(|row| row[5] = -row[5]);
    refused("pitch", &pitched, NAMES, &entry(), &["the opposite pitch would fit"]);
}

#[test]
fn mirrored_axes_are_named() {
    let local = "GPSTime,x,y,z,Roll,Pitch,Heading";
    let entry = TrajectoryEntry { heading: HeadingSense::CounterclockwiseFromEast, ..entry() };
    let in_local = |mirror: f64, turn: f64| -> Vec<Row> {
        let mut rows = rows();
        for (row, (_, pose)) in rows.iter_mut().zip(poses().iter().step_by(2)) {
            let p = pose.translation;
            row[1..4].copy_from_slice(&[p.x, p.y * mirror, p.z]);
            row[6] = (90.0 - row[6]) * turn;
        }
        rows
    };
    assert_eq!(found(local, &in_local(1.0, 1.0), &entry).problems, Vec::<String>::new());
    refused("y", &in_local(-1.0, 1.0), local, &entry, &["an axis is mirrored"]);
    refused("y and heading", &in_local(-1.0, -1.0), local, &entry, &["turns right where the inertial unit turns left"]);
}

#[test]
fn wrong_clocks_are_named() {
    let utc = TrajectoryEntry { clock: Some(Clock::Utc), ..entry() };
    refused("leap seconds", &rows(), NAMES, &utc, &["18.00 s late", "leap seconds between GPS time and UTC"]);
    let late = changed(|row| row[0] += 3600.0);
    refused("an hour", &late, NAMES, &entry(), &["-3600 s later", "1 h, a time zone"]);
    let next_day = changed(|row| row[0] += 86_400.0);
    refused("a day", &next_day, NAMES, &entry(), &["not the whole drive", "1 days"]);
    let next_week = TrajectoryEntry { gps_week: Some(2332), ..entry() };
    refused("a week", &rows(), NAMES, &next_week, &["1 weeks", "gps_week"]);
    let delayed = changed(|row| row[0] += 0.3);
    refused("a delay", &delayed, NAMES, &entry(), &["0.30 s late", "delay_nanos = 300000000"]);
    let known = TrajectoryEntry { delay_nanos: 300_000_000, ..entry() };
    assert_eq!(found(NAMES, &delayed, &known).problems, Vec::<String>::new());
    let today = changed(|row| row[0] = row[0].rem_euclid(86_400.0));
    let of_day = TrajectoryEntry { clock: Some(Clock::GpsDay), ..entry() };
    assert_eq!(found(NAMES, &today, &of_day).problems, Vec::<String>::new());
    refused("seconds of the day", &today, NAMES, &entry(), &["days"]);
}

/// The path stands for hours before and after the drive, so that any time zone covers it.
#[test]
fn hour_inside_a_long_path_is_found_by_turning_and_by_fixes() {
    let mut rows = rows();
    let (first, last) = (rows[0], rows[rows.len() - 1]);
    let standing = |row: Row, from: f64| {
        (0..28_800).map(move |k| {
            let mut row = row;
            row[0] = from + f64::from(k) * 0.25;
            row
        })
    };
    let before: Vec<Row> = standing(first, first[0] - 7200.0).filter(|row| row[0] < first[0]).collect();
    let after: Vec<Row> = standing(last, last[0] + 0.25).collect();
    rows = [before, rows, after].concat();
    for row in &mut rows {
        row[0] += 3600.0;
    }
    let entry = TrajectoryEntry { max_gap_s: 0.5, ..entry() };
    refused("by turning", &rows, NAMES, &entry, &["3600.00 s late, by the turning rate", "1 h, a time zone"]);
    let path = read(NAMES, &rows, &entry).expect("is read");
    let without_unit = Evidence { imu: Vec::new(), ..evidence() };
    let problems = check(&path, &without_unit).problems;
    // The standing vehicle has no speed at the times of the drive: the places are refused without a time.
    assert!(problems.iter().any(|problem| problem.contains("m from the fixes")), "{problems:?}");
}

#[test]
fn leap_seconds_are_found_by_fixes_alone() {
    let utc = TrajectoryEntry { clock: Some(Clock::Utc), ..entry() };
    let path = read(NAMES, &rows(), &utc).expect("is read");
    let problems = check(&path, &Evidence { imu: Vec::new(), ..evidence() }).problems;
    assert!(problems.iter().any(|problem| problem.contains("18 s late, by the fixes")), "{problems:?}");
}

#[test]
fn wrong_places_are_named() {
    let low = changed(|row| row[3] -= 44.6);
    refused("geoid", &low, NAMES, &entry(), &["44.6 m below the fixes", "set trajectory.geoid_m"]);
    let known = TrajectoryEntry { geoid_m: Some(44.6), ..entry() };
    assert_eq!(found(NAMES, &low, &known).problems, Vec::<String>::new());
    let exchanged = "GPSTime,Longitude,Latitude,H-Ell,Roll,Pitch,Heading";
    refused("exchanged", &rows(), exchanged, &entry(), &["latitude and longitude are exchanged"]);
    let radians = changed(|row| (row[1], row[2]) = (row[1].to_radians(), row[2].to_radians()));
    refused("radians", &radians, NAMES, &entry(), &["m from the fixes"]);
    let jump = changed(|row| row[3] += if row[0] > 476_870.0 { 30.0 } else { 0.0 });
    refused("jump", &jump, NAMES, &entry(), &["the path jumps by 30.0 m"]);
}

#[test]
fn utm_coordinates_need_their_zone() {
    let zone = |code: u32| TrajectoryEntry { frame: Some(format!("EPSG:{code}")), ..entry() };
    let names = "GPSTime,Easting,Northing,H-Ell,Roll,Pitch,Heading";
    let utm = geometry::Utm::from_geodetic(&crate::drive::local_frame().origin()).expect("a zone");
    let rows = changed(|row| {
        let place = geometry::Geodetic::new(row[1], row[2], row[3]).expect("a position");
        row[1..4].copy_from_slice(&utm.project(&place).expect("projects"));
    });
    assert_eq!(found(names, &rows, &zone(32_631)).problems, Vec::<String>::new());
    refused("other zone", &rows, names, &zone(32_632), &["m from the fixes", "trajectory.frame"]);
    refused("no zone", &rows, names, &entry(), &["set trajectory.frame"]);
    refused("no UTM", &rows, names, &zone(2154), &["EPSG:2154 is not a UTM zone"]);
    refused("geodetic", &rows, NAMES, &entry(), &["is not a position in degrees and m"]);
}

#[test]
fn uncovered_stretches_gaps_and_disorder_are_named() {
    let short: Vec<Row> = rows().into_iter().filter(|row| row[0] < 476_818.0 + 110.0).collect();
    refused("end", &short, NAMES, &entry(), &["not the last 10.0 s of the drive"]);
    let late: Vec<Row> = rows().into_iter().filter(|row| row[0] >= 476_818.0 + 20.0).collect();
    refused("start", &late, NAMES, &entry(), &["not the first 20.0 s of the drive"]);
    let gap: Vec<Row> = rows().into_iter().filter(|row| !(476_860.0..476_861.0).contains(&row[0])).collect();
    refused("gap", &gap, NAMES, &entry(), &["no poses for 1.02 s from 2024-09-13 12:27:21", "max_gap_s"]);
    let mut backward = rows();
    backward[900][0] -= 1.0;
    refused("backward", &backward, NAMES, &entry(), &["line 902", "before the time of the previous pose"]);
    let mut twice = rows();
    twice[900] = twice[899];
    assert_eq!(found(NAMES, &twice, &entry()).problems, Vec::<String>::new());
    assert!(found(NAMES, &twice, &entry()).notes.iter().any(|note| note.contains("1 repeated poses")));
    twice[900][3] += 1.0;
    refused("contradiction", &twice, NAMES, &entry(), &["stands twice with poses 1.000 m apart"]);
    let mut lost = rows();
    lost[7][5] = f64::NAN;
    refused("NaN", &lost, NAMES, &entry(), &["path.csv:9: pitch: \"NaN\" is not a finite number"]);
}

/// The layout of `deliver`, with a week that ends during the drive.
#[test]
fn sbet_with_the_end_of_a_week_is_read_with_its_deviations() {
    let folder = tempfile::tempdir().expect("a folder");
    let record = |k: i32| SbetRecord {
        time_s: (604_799.0 + f64::from(k) * 0.1).rem_euclid(604_800.0),
        latitude_rad: 0.85,
        longitude_rad: 0.04 + f64::from(k) * 1e-8,
        altitude_m: 100.0,
        platform_heading_rad: 1.5,
        wander_rad: -0.07,
        ..SbetRecord::default()
    };
    let bytes: Vec<u8> = (0..20).flat_map(|k| record(k).to_bytes()).collect();
    std::fs::write(folder.path().join("path.sbet"), bytes).expect("writes");
    let deviations: Vec<u8> = [[604_799.0, 0.01], [604_800.9, 0.03]]
        .iter()
        .flat_map(|[time, m]| [*time, *m, 2.0 * m, 3.0 * m, 0.0, 0.0, 0.0, 1.0, 1.0, 6.0])
        .flat_map(f64::to_le_bytes)
        .collect();
    std::fs::write(folder.path().join("smrmsg.out"), deviations).expect("writes");
    let entry = TrajectoryEntry {
        deviations: Some("smrmsg.out".into()),
        ..TrajectoryEntry::new("path.sbet", TrajectoryFormat::Sbet)
    };
    // The week 2331 ends on 2024-09-14, 18 s before midnight UTC.
    let end = Stamp(1_726_358_382_000_000_000);
    let path = GivenPath::read(folder.path(), &entry, Some(end), None).expect("is read");
    assert_eq!(path.span(), [end.plus_nanos(-1_000_000_000), end.plus_nanos(900_000_000)]);
    let deviation = path.deviation_at(end.plus_nanos(-50_000_000));
    let [east, north, up] = deviation.east_north_up_m;
    assert!((east - 0.04).abs() < 1e-9 && (north - 0.02).abs() < 1e-9 && (up - 0.06).abs() < 1e-9, "{deviation:?}");
    assert!((deviation.roll_pitch_heading_rad[2] - 0.1_f64.to_radians()).abs() < 1e-12);
    // Heading: platform minus wander, 1.57 rad, is east.
    let ahead = path.at(end).expect("inside").rotation * geometry::Vector3::x();
    assert!(ahead.x > 0.999_9, "{ahead}");
    let undated = GivenPath::read(folder.path(), &entry, Some(Stamp(0)), None).expect_err("has no week").to_string();
    assert!(undated.contains("set trajectory.gps_week"), "{undated}");
}
