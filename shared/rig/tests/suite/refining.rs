//! Rigs with known errors are refined within the stated standard deviations, and never made worse.

use crate::support::{Copied, turn, with_cameras, with_turns};
use geometry::{UnitQuaternion, Vector3};
use rig::refine::{Change, Outcome, Refined};
use rig::survey::{Survey, SurveySettings};
use simulation::sensors::lidar::LidarErrors;
use simulation::{DriveSpec, RigSpec, write_drive};

fn refined(copied: &Copied) -> Refined {
    let drive = copied.open();
    let survey = Survey::from_drive(&drive, &SurveySettings::default()).expect("surveyed");
    Refined::from_survey(&drive, &survey, &SurveySettings::default()).expect("refined")
}

fn find_change<'a>(refined: &'a Refined, subject: &str, quantity: &str) -> &'a Change {
    let found = refined.changes.iter().find(|change| change.subject == subject && change.quantity == quantity);
    found.unwrap_or_else(|| panic!("no {quantity} of {subject}"))
}

/// Asserts that a change differs from a planted error by less than `tolerance`, states a standard deviation below
/// `max_sigma`, and has an error of less than three standard deviations. Without the first two, a large standard
/// deviation would accept any change.
fn assert_finds(change: &Change, planted: f64, tolerance: f64, max_sigma: f64) {
    let error = (change.difference - planted).abs();
    assert!(error < tolerance, "{change} instead of {planted}");
    assert!(change.sigma < max_sigma, "{change}: deviation above {max_sigma}");
    assert!(error < 3.0 * change.sigma, "{change} instead of {planted}: the deviation is too small");
}

/// Largest angle between mountings of cameras, mrad.
fn off(refined: &Refined, truth: &Copied) -> f64 {
    let pairs = refined.manifest.cameras.iter().zip(&truth.manifest.cameras);
    let angle = |(found, truth): (&drive::manifest::CameraEntry, &drive::manifest::CameraEntry)| {
        let [found, truth] = [found, truth].map(|entry| entry.body_from_camera.to_pose().expect("a pose"));
        found.rotation.angle_to(&truth.rotation) * 1e3
    };
    pairs.map(angle).fold(0.0, f64::max)
}

#[test]
fn turned_camera_is_turned_back_within_the_deviation() {
    let right = Copied::from_recorded(with_cameras());
    let mut wrong = Copied::from_recorded(with_cameras());
    turn(&mut wrong.manifest.cameras[0].body_from_camera, Vector3::y(), 1.0, false);
    let found = refined(&wrong);
    let change = find_change(&found, "CAM_FRONT", "rotation about y");
    let planted = 1.0_f64.to_radians() * 1e3;
    assert_eq!(change.outcome, Outcome::Replaced);
    assert_finds(change, planted, 1.0, 0.6);
    assert_eq!(find_change(&found, "CAM_FRONT", "position").outcome, Outcome::NotObservable);
    assert!(off(&found, &right) < 1.0, "{} mrad", off(&found, &right));
}

#[test]
fn right_cameras_stay_within_their_deviations() {
    let right = Copied::from_recorded(with_cameras());
    let found = refined(&right);
    let is_rotation = |change: &&Change| change.unit == "mrad" && change.outcome != Outcome::NotObservable;
    let rotations: Vec<&Change> = found.changes.iter().filter(is_rotation).collect();
    assert!(rotations.len() >= 6, "two of each camera: {rotations:?}");
    for change in rotations {
        assert_eq!(change.outcome, Outcome::Kept, "{change}");
        assert_finds(change, 0.0, 1.0, 0.8);
    }
    assert_eq!(off(&found, &right), 0.0, "the mountings are as they were");
    assert_eq!(find_change(&found, "cameras", "delay").outcome, Outcome::Kept);
}

#[test]
fn late_images_get_their_delay() {
    let found = refined(&Copied::from_recorded(with_cameras()).with_images_late(-40_000_000));
    let change = find_change(&found, "cameras", "delay");
    assert_eq!(change.outcome, Outcome::Replaced);
    assert_finds(change, 40.0, 4.0, 2.0);
    // The exposures are after their stamps: the stamps are early.
    for camera in &found.manifest.cameras {
        assert!((camera.delay_nanos as f64 * 1e-6 + change.difference).abs() < 1e-5, "{camera:?}");
    }
}

#[test]
fn turned_and_late_inertial_unit_is_found_within_the_deviations() {
    let body_from_unit = UnitQuaternion::from_scaled_axis(Vector3::new(0.06, -0.05, 0.0));
    let turned = |v: [f64; 3]| -> [f64; 3] { (body_from_unit.inverse() * Vector3::from(v)).into() };
    let late_ms = 30.0;
    let copied = Copied::from_recorded(with_turns())
        .with_samples(|stamp, force, rate| (stamp + (late_ms * 1e6) as i64, turned(force), turned(rate)));
    let found = refined(&copied);
    for (quantity, planted) in [("rotation about x", 0.06_f64), ("rotation about y", -0.05)] {
        let change = find_change(&found, "imu", quantity);
        let planted = planted.to_degrees();
        assert_eq!(change.outcome, Outcome::Replaced, "{change}");
        assert_finds(change, planted, 0.2, 0.7);
    }
    // Turns about the vertical alone do not determine the heading of the unit.
    assert_eq!(find_change(&found, "imu", "rotation about z").outcome, Outcome::NotObservable);
    let change = find_change(&found, "imu", "delay");
    assert_eq!(change.outcome, Outcome::Replaced, "{change}");
    assert_finds(change, late_ms, 5.0, 13.0);
    let new = found.manifest.imu.as_ref().expect("a unit");
    assert!((new.delay_nanos as f64 * 1e-6 - change.difference).abs() < 1e-5, "{new:?}");
    let new = new.mounting();
    let given = body_from_unit.angle();
    let remaining = new.rotation.angle_to(&body_from_unit);
    assert!(remaining < 0.1 * given, "{remaining} of {given} rad");
}

#[test]
fn late_receiver_gets_its_delay() {
    for planted_ms in [0.0, 200.0, -350.0] {
        let mut late = Copied::from_recorded(with_turns());
        // The stamps of the log are correct: a stated delay that is too small leaves them late.
        let receiver = late.manifest.gnss.as_mut().expect("a receiver");
        receiver.delay_nanos = (-planted_ms * 1e6) as i64;
        let found = refined(&late);
        let change = find_change(&found, "gnss", "delay");
        assert_finds(change, planted_ms, 30.0, 50.0);
        let new = found.manifest.gnss.as_ref().expect("a receiver").delay_nanos;
        // An insignificant delay is kept: the receiver of this drive has no delay.
        assert!((new as f64 * 1e-6).abs() < 30.0, "{change}: {new}");
        assert_eq!(change.outcome == Outcome::Replaced, planted_ms != 0.0, "{change}");
    }
}

/// Errors without their mean and linear part, which no drive shows.
fn detrended(errors: &[f64]) -> Vec<f64> {
    let n = errors.len() as f64;
    let middle = (n - 1.0) / 2.0;
    let mean = errors.iter().sum::<f64>() / n;
    let at = |ring: usize| ring as f64 - middle;
    let slope = (0..errors.len()).map(|ring| at(ring) * errors[ring]).sum::<f64>()
        / (0..errors.len()).map(|ring| at(ring).powi(2)).sum::<f64>();
    errors.iter().enumerate().map(|(ring, error)| error - mean - slope * at(ring)).collect()
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64).sqrt()
}

#[test]
fn ring_angles_of_a_poor_unit_come_nearer_to_the_truth() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("drive");
    // Its rings cross on the facades: they measure one surface from near and far.
    let rig = RigSpec::l3d2();
    let lidar_errors = LidarErrors { unit_seed: 5, ..LidarErrors::POOR };
    let spec = DriveSpec { rig, lidar_errors, ..DriveSpec::urban(1, 14.0).sparse(1) };
    write_drive(&spec, &path, &mut |_| {}).expect("simulated");
    let drive = drive::Drive::open(&path).expect("a drive");
    let survey = Survey::from_drive(&drive, &SurveySettings::default()).expect("surveyed");
    let found = Refined::from_survey(&drive, &survey, &SurveySettings::default()).expect("refined");
    let truth = std::fs::read_to_string(path.join("truth/lidar_errors.csv")).expect("reads");
    let truth: Vec<f64> = truth
        .lines()
        .skip(1)
        .map(|line| line.split(',').nth(1).expect("a column").parse().expect("a number"))
        .collect();
    let (name, text) = found.lidar_file.clone().expect("a file");
    assert_eq!(found.manifest.lidar.calibration.as_deref(), Some(name));
    let refined = lidar::Lidar::with_calibration(drive.model(), name, text).expect("reads");
    let mut corrections = vec![0.0; truth.len()];
    for ((ring, new), old) in
        drive.lidar().rings().into_iter().zip(refined.elevations_deg()).zip(drive.lidar().elevations_deg())
    {
        corrections[usize::from(ring)] = new - old;
    }
    let rest: Vec<f64> = truth.iter().zip(&corrections).map(|(truth, correction)| truth - correction).collect();
    let before = rms(&detrended(&truth));
    let after = rms(&detrended(&rest));
    assert!(after < 0.8 * before, "{after} after {before} degrees: {corrections:?}");
    assert_eq!(find_change(&found, "lidar", "elevation of all rings").outcome, Outcome::NotObservable);
}
