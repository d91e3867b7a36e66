//! The synthetic street as the stage receives it.

use crate::world::Drive;
use messages::{ImuRow, SweepHeader, SweepPoint, SweepTopic};
use slam_aggregate::SlamAggregate;
use stage::testing::Bench;

pub const STREET: Drive = Drive { speed: 10.0, noise_m: 0.02, ground_only: false };

/// One sweep of the street as `acquire` publishes it.
pub struct RawSweep {
    pub stamp: i64,
    pub header: SweepHeader,
    pub rows: Vec<SweepPoint>,
}

pub fn raw(number: u32) -> RawSweep {
    let sweep = STREET.sweep(number);
    let row = |(idx, point): (usize, &registration::TimedPoint)| SweepPoint {
        x: point.position[0],
        y: point.position[1],
        z: point.position[2],
        offset_nanos: point.offset_nanos,
        azimuth: (point.offset_nanos / 2778 % 36_000) as u16,
        intensity: (idx % 251) as u8,
        ring: point.ring,
    };
    RawSweep {
        stamp: sweep.stamp().0,
        header: SweepHeader { duration_nanos: 100_000_000, lost_packets: 0, n_rings: 32, has_times: 1, lidar: 0 },
        rows: sweep.points().iter().enumerate().map(row).collect(),
    }
}

/// Sends a sweep.
pub fn send(bench: &mut Bench<SlamAggregate>, raw: &RawSweep) {
    bench.send::<SweepTopic>(raw.stamp, raw.header, raw.rows.clone());
}

/// The sample of a perfect inertial unit at the body's origin.
pub fn imu_row(stamp: i64) -> ImuRow {
    let (force, rate) = STREET.inertial(stamp as f64 * 1e-9);
    ImuRow { stamp, acceleration: force.into(), angular_rate: rate.into() }
}
