//! Recorded solutions.

use drive::manifest::{Clock, HeadingSense, TrajectoryEntry, TrajectoryFormat};
use given_path::{Evidence, GivenPath, check};
use std::path::Path;
use std::process::Command;

/// The heading of this solution is a compass heading in a frame of east and north.
#[real_data::test("trajectories/novatel_ins_csv/novatel-enu.csv.gz")]
fn compass_heading_of_a_car_agrees_with_its_travel_and_a_mathematical_one_is_refused() {
    let output = Command::new("gzip")
        .arg("-dc")
        .arg(real_data::path("trajectories/novatel_ins_csv/novatel-enu.csv.gz"))
        .output()
        .expect("gzip starts");
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("path.csv"), output.stdout).expect("writes");
    let read = |heading: HeadingSense| {
        let entry = TrajectoryEntry { heading, ..TrajectoryEntry::new("path.csv", TrajectoryFormat::Table) };
        GivenPath::read(folder.path(), &entry, None, None).expect("is read")
    };
    let compass = check(&read(HeadingSense::ClockwiseFromNorth), &Evidence::default());
    assert_eq!(compass.problems, Vec::<String>::new());
    assert!(compass.notes.iter().any(|note| note.contains("heading agrees")), "{:?}", compass.notes);
    let math = check(&read(HeadingSense::CounterclockwiseFromEast), &Evidence::default());
    assert!(math.problems.iter().any(|problem| problem.contains("a compass heading is taken")), "{math:?}");
}

#[real_data::test("trajectories/novatel_oem7/ins2.gps")]
fn binary_log_of_a_receiver_is_dated_and_has_deviations() {
    let file = real_data::path("trajectories/novatel_oem7/ins2.gps");
    let name = file.file_name().and_then(|name| name.to_str()).expect("a name");
    let folder = file.parent().unwrap_or(Path::new(""));
    let entry = TrajectoryEntry { max_gap_s: 1.0, ..TrajectoryEntry::new(name, TrajectoryFormat::Novatel) };
    let path = GivenPath::read(folder, &entry, None, None).expect("is read");
    // Second 600118.4 of GPS week 2100 is 2020-04-11 22:41:40.4 UTC.
    assert_eq!(path.span()[0].0, 1_586_644_900_400_000_000);
    let deviation = path.deviation_at(path.span()[0]);
    assert!(deviation.east_north_up_m.iter().all(|m| (0.1..20.0).contains(m)), "{deviation:?}");
    let utc = TrajectoryEntry { clock: Some(Clock::Utc), ..entry };
    let shifted = GivenPath::read(folder, &utc, None, None).expect("is read");
    assert_eq!(shifted.span()[0].0 - path.span()[0].0, 18_000_000_000);
}
