//! Faulty inertial units and receivers on a simulated drive with all sensors, by the default settings.

use crate::faulty_drive::{Fault, Outcome, SensorDrive};
use simulation::{DriveSettings, Town};
use slam_aggregate::Settings;
use std::sync::LazyLock;

/// A drive through a town from rest, with turns.
static DRIVE: LazyLock<SensorDrive> = LazyLock::new(|| {
    let settings = DriveSettings { seed: 1001, seconds: 15.0, rig: "l3d2".into(), ..DriveSettings::default() };
    SensorDrive::simulated(&settings)
});

/// A drive with a turn by more than 90 degrees.
static TURNING_DRIVE: LazyLock<SensorDrive> = LazyLock::new(|| {
    let town = Town::Suburban;
    let settings =
        DriveSettings { town, seed: 1005, seconds: 25.0, rig: "nuscenes".into(), ..DriveSettings::default() };
    SensorDrive::simulated(&settings)
});

fn with(fault: Fault) -> Outcome {
    on(&DRIVE, fault)
}

fn on(drive: &SensorDrive, fault: Fault) -> Outcome {
    let found = drive.run(&Settings::default(), fault);
    println!(
        "{fault:?}: end {:.3} m, second {:.3} m, tilt {:.2} degrees, {:?}, {:#?}",
        found.end_m, found.second_m, found.tilt_deg, found.doubts, found.notes
    );
    found
}

static BY_LIDAR: LazyLock<Outcome> = LazyLock::new(|| with(Fault::NoUnit));

#[test]
fn unit_in_degrees_per_second_leaves_the_path() {
    let found = with(Fault::Degrees);
    assert!(found.end_m < 1.2 * BY_LIDAR.end_m && found.tilt_deg < 1.2 * BY_LIDAR.tilt_deg);
}

#[test]
fn mirrored_unit_leaves_the_path() {
    let found = with(Fault::Mirrored);
    assert!(found.end_m < 1.2 * BY_LIDAR.end_m && found.tilt_deg < 1.2 * BY_LIDAR.tilt_deg);
}

#[test]
fn delay_of_a_unit_that_the_filter_follows_is_not_underestimated() {
    let found = with(Fault::Late(0.05));
    let is_stated = (30..=70).any(|millis| found.says(&format!("stamps {millis} ms late")));
    assert!(is_stated && found.doubts.is_empty());
}

#[test]
fn bias_of_the_accelerometers_does_not_tilt_the_world() {
    let sound = on(&TURNING_DRIVE, Fault::None);
    assert!(!sound.says("accelerations have a bias"));
    for bias in [[0.5, 0.0], [0.0, 0.5]] {
        let found = on(&TURNING_DRIVE, Fault::ForceBias(bias));
        assert!(found.says("accelerations have a bias") && found.tilt_deg < sound.tilt_deg + 0.8, "{bias:?}");
    }
}

#[test]
fn late_fixes_leave_the_odometry() {
    let [sound, late] = [Fault::None, Fault::LateFixes(0.5)].map(with);
    assert!(late.end_m < sound.end_m + 0.15 && late.second_m < sound.second_m + 0.05);
}
