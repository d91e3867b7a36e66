//! The inertial unit: its samples for the odometry, and the report about it.

use geometry::{Pose, Stamp};
use messages::ImuRow;
use registration::{InertialCheck, InertialSample, Registered};
use stage::Outputs;

pub(crate) fn sample(row: &ImuRow) -> InertialSample {
    InertialSample { stamp: Stamp(row.stamp), force: row.acceleration.into(), rate: row.angular_rate.into() }
}

pub(crate) fn row(sample: &InertialSample) -> ImuRow {
    ImuRow { stamp: sample.stamp.0, acceleration: sample.force.into(), angular_rate: sample.rate.into() }
}

/// Time and pose (`odom_from_body`) of the middle of a sweep; no pose where the match did not determine it.
pub(crate) fn measured_pose(registered: &Registered, body_from_lidar: &Pose) -> (Stamp, Option<Pose>) {
    let stamp = registered.stamp.plus_nanos(i64::from(registered.duration_nanos) / 2);
    let is_measured = registered.matched.as_ref().is_some_and(|matched| matched.n_degenerate_directions == 0);
    (stamp, is_measured.then(|| registered.motion.mid * body_from_lidar.inverse()))
}

/// Reports what became of the unit.
pub(crate) fn report(check: &InertialCheck, outputs: &mut Outputs) {
    check.summary().into_iter().for_each(|line| outputs.note(line));
    if let Some(reason) = check.why_withheld() {
        let text = format!(
            "the inertial unit is not used: {reason}; check the units (m/s^2, rad/s) and axes of its file, imu.body_from_imu and the \
             clock of the unit, or remove [imu] from drive.toml"
        );
        outputs.doubt("imu_not_used", 1.0, text);
    }
}
