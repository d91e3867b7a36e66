//! Inertial units that are mounted, wired or logged incorrectly: each is corrected by name or not used.

use crate::street::{RawSweep, STREET, raw, send};
use crate::world::body_from_lidar;
use geometry::{UnitQuaternion, Vector3};
use messages::{ImuRow, ImuTopic, NoHeader, PlacementTopic, TrajectoryTopic};
use slam_aggregate::{Correction, Settings, SlamAggregate};
use stage::testing::Bench;
use std::sync::LazyLock;

/// Eight seconds: the road winds, and the vehicle brakes and accelerates.
const N_SWEEPS: u32 = 80;
/// Samples per second.
const RATE_HZ: i64 = 100;
const GRAVITY: f64 = 9.806_65;

static SWEEPS: LazyLock<Vec<RawSweep>> = LazyLock::new(|| (0..N_SWEEPS).map(raw).collect());

/// Output of a unit: specific force and angular rate at a time, s.
type Unit<'a> = &'a dyn Fn(f64) -> (Vector3<f64>, Vector3<f64>);

/// The result of a drive.
struct Driven {
    /// Largest distance of a pose from the truth, m.
    error_m: f64,
    notes: Vec<String>,
    doubt: Option<f64>,
    n_up_directions: u32,
}

impl Driven {
    fn says(&self, words: &str) -> bool {
        self.notes.iter().any(|note| note.contains(words))
    }
}

fn drive(settings: &Settings, unit: Option<Unit<'_>>) -> Driven {
    let mut bench = Bench::with_stage(SlamAggregate::with_mounting(settings, body_from_lidar()));
    let mut next = 0;
    let mut error_m = 0.0_f64;
    let mut check = |bench: &mut Bench<SlamAggregate>| {
        for message in bench.take::<TrajectoryTopic>() {
            for row in message.rows() {
                let found = row.odom_from_body.to_pose().unwrap();
                let truth = STREET.world_from_body(row.stamp as f64 * 1e-9);
                error_m = error_m.max((found.translation.vector - truth.translation.vector).norm());
            }
        }
    };
    for raw in SWEEPS.iter() {
        if let Some(unit) = unit {
            let end = (raw.stamp + 100_000_000) * RATE_HZ / 1_000_000_000;
            let row = |i: i64| {
                let (force, rate) = unit(i as f64 / RATE_HZ as f64);
                let stamp = i * 1_000_000_000 / RATE_HZ;
                ImuRow { stamp, acceleration: force.into(), angular_rate: rate.into() }
            };
            bench.send::<ImuTopic>(raw.stamp, NoHeader::default(), (next..end).map(row).collect());
            next = end;
        }
        send(&mut bench, raw);
        bench.tick().unwrap();
        check(&mut bench);
    }
    bench.finish().unwrap();
    check(&mut bench);
    let placement = bench.take::<PlacementTopic>();
    Driven {
        error_m,
        notes: bench.notes().to_vec(),
        doubt: bench.doubt("imu_not_used"),
        n_up_directions: placement.first().map_or(0, |message| message.header().n_uprights),
    }
}

/// Settings that use the inertial unit in all ways.
fn settings() -> Settings {
    Settings { submap_m: 15.0, correct: vec![Correction::Imu], ..Settings::default() }
}

fn noise(seed: f64) -> Vector3<f64> {
    Vector3::from_fn(|axis, _| f64::from(random::gauss(random::hash((seed * 1e4) as u64, axis as u64))))
}

/// The sample of a good industrial unit.
fn sound(t: f64) -> (Vector3<f64>, Vector3<f64>) {
    let (force, rate) = STREET.inertial(t);
    let biases = (Vector3::new(0.02, -0.01, 0.02), Vector3::new(0.0017, -0.001, 0.0015));
    (force + biases.0 + noise(t) * 0.05, rate + biases.1 + noise(t + 0.5) * 0.001)
}

static BY_LIDAR: LazyLock<f64> = LazyLock::new(|| drive(&settings(), None).error_m);

/// Error with a sound unit that is used from the first sample on.
static BY_SOUND_UNIT: LazyLock<f64> =
    LazyLock::new(|| drive(&Settings { imu_probation: false, ..settings() }, Some(&sound)).error_m);

/// Whether the result is as good as with the LiDAR alone or with a sound unit.
fn is_as_good(driven: &Driven) -> bool {
    println!(
        "{:.3} m, by LiDAR alone {:.3} m; doubt {:?}; {:#?}",
        driven.error_m, *BY_LIDAR, driven.doubt, driven.notes
    );
    driven.error_m < 1.2 * BY_LIDAR.max(*BY_SOUND_UNIT) + 0.03
}

#[test]
fn sound_unit_is_used_as_it_is() {
    let [checked, unchecked] =
        [true, false].map(|check_imu| drive(&Settings { check_imu, imu_probation: false, ..settings() }, Some(&sound)));
    assert!(is_as_good(&checked));
    assert_eq!(checked.error_m.to_bits(), unchecked.error_m.to_bits(), "the check changes nothing");
    assert!(checked.doubt.is_none() && checked.says("agrees with the LiDAR") && !checked.says("corrected"));
    assert!(checked.n_up_directions > 2 && checked.n_up_directions == unchecked.n_up_directions);
}

#[test]
fn probation_of_a_sound_unit_costs_nothing() {
    let driven = drive(&settings(), Some(&sound));
    assert!(driven.error_m < *BY_SOUND_UNIT + 0.005 && driven.says("agrees with the LiDAR"), "{}", driven.error_m);
}

#[test]
fn unit_in_g_is_recognized() {
    let driven = drive(&settings(), Some(&|t| (sound(t).0 / GRAVITY, sound(t).1)));
    assert!(is_as_good(&driven) && driven.doubt.is_none());
    assert!(driven.says("accelerations are in g") && driven.n_up_directions > 2);
}

#[test]
fn unit_in_degrees_per_second_is_recognized() {
    let driven = drive(&settings(), Some(&|t| (sound(t).0, sound(t).1.map(f64::to_degrees))));
    assert!(is_as_good(&driven) && driven.doubt.is_none());
    assert!(driven.says("angular rates are in degrees per second") && driven.n_up_directions > 0);
}

#[test]
fn unit_upside_down_is_recognized() {
    let turn = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
    let driven = drive(&settings(), Some(&|t| (turn * sound(t).0, turn * sound(t).1)));
    assert!(is_as_good(&driven) && driven.doubt.is_none());
    assert!(driven.says("x, y, z of the body are x, -y, -z of the unit") && driven.n_up_directions > 0);
}

#[test]
fn unit_with_swapped_axes_is_recognized() {
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::FRAC_PI_2);
    let driven = drive(&settings(), Some(&|t| (turn * sound(t).0, turn * sound(t).1)));
    assert!(is_as_good(&driven) && driven.doubt.is_none());
    assert!(driven.says("x, y, z of the body are y, -x, z of the unit"));
}

#[test]
fn unit_with_flipped_sign_of_gravity_is_recognized() {
    let driven = drive(&settings(), Some(&|t| (-sound(t).0, sound(t).1)));
    assert!(is_as_good(&driven) && driven.doubt.is_none());
    assert!(driven.says("accelerations: x, y, z of the body are -x, -y, -z of the unit"));
    assert!(!driven.says("angular rates:") && driven.n_up_directions > 0);
}

#[test]
fn mirrored_unit_is_recognized() {
    let mirror = |v: Vector3<f64>| Vector3::new(v.x, -v.y, v.z);
    // Rates of a left-handed frame have the opposite sign.
    let driven = drive(&settings(), Some(&|t| (mirror(sound(t).0), -mirror(sound(t).1))));
    assert!(is_as_good(&driven) && driven.doubt.is_none());
    assert!(driven.says("accelerations: x, y, z of the body are x, -y, z of the unit"));
    assert!(driven.says("angular rates: x, y, z of the body are -x, y, -z of the unit"));
}

#[test]
fn late_unit_is_recognized() {
    let driven = drive(&settings(), Some(&|t| sound(t - 0.1)));
    assert!(is_as_good(&driven) && driven.doubt.is_none());
    let is_stated = (95..=105).any(|millis| driven.says(&format!("stamps {millis} ms late, corrected")));
    assert!(is_stated);
}

#[test]
fn rotation_that_a_short_drive_does_not_determine_is_not_corrected() {
    let tilt = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), 6_f64.to_radians());
    let driven = drive(&settings(), Some(&|t| (tilt.inverse() * sound(t).0, tilt.inverse() * sound(t).1)));
    assert!(is_as_good(&driven) && driven.doubt.is_none());
    assert!(!driven.says("rotated by"));
}

#[test]
fn dead_unit_is_not_used() {
    let driven = drive(&settings(), Some(&|_| (Vector3::zeros(), Vector3::zeros())));
    assert!(is_as_good(&driven) && driven.doubt.is_some() && driven.n_up_directions == 0);
    assert!(driven.says("the specific force is 0.00 m/s^2"));
}

#[test]
fn unit_that_reports_noise_is_not_used() {
    let driven = drive(&settings(), Some(&|t| (noise(t) * 10.0, noise(t + 0.5))));
    assert!(is_as_good(&driven) && driven.doubt.is_some() && driven.n_up_directions == 0);
    let only_rates = drive(&settings(), Some(&|t| (sound(t).0, noise(t + 0.5) * 0.3)));
    assert!(is_as_good(&only_rates) && only_rates.doubt.is_some());
}

#[test]
fn unit_that_dies_during_the_drive_is_not_used_any_more() {
    let driven = drive(&settings(), Some(&|t| if t < 4.0 { sound(t) } else { (Vector3::zeros(), Vector3::zeros()) }));
    assert!(is_as_good(&driven) && driven.doubt.is_some());
}
