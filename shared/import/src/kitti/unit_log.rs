//! The log of a GNSS and IMU unit: fixes, samples and poses of the same times.

use crate::fixes;
use crate::plan::{Plan, TextFile};
use drive::imu::{ImuSample, csv_from_samples};
use drive::manifest::ImuEntry;
use geometry::{Geodetic, LocalFrame, Pose, Trajectory};
use lidar::nmea::Fix;

/// Records in the order of their stamps.
#[derive(Default)]
pub(crate) struct UnitLog {
    records: Vec<Record>,
    /// Records whose stamp is not later than the previous one.
    n_not_rising: usize,
}

struct Record {
    fix: Fix,
    sample: ImuSample,
    place: Geodetic,
    /// Rotation of the body in the east, north, up frame.
    rotation: Pose,
}

impl UnitLog {
    /// Adds a record, unless its stamp is not later than the last one.
    pub fn push(&mut self, fix: Fix, sample: ImuSample, place: Geodetic, rotation: Pose) {
        if self.records.last().is_some_and(|last| last.fix.stamp >= fix.stamp) {
            self.n_not_rising += 1;
        } else {
            self.records.push(Record { fix, sample, place, rotation });
        }
    }

    pub fn is_empty(&self) -> bool {
        self.records.is_empty()
    }

    /// Poses of the body in the east, north, up frame at the first fix.
    fn trajectory(&self, frame: &LocalFrame) -> Trajectory {
        let mut trajectory = Trajectory::default();
        for record in &self.records {
            let mut pose = record.rotation;
            pose.translation.vector = frame.world_from_geodetic(&record.place).coords;
            trajectory.push(record.fix.stamp, pose);
        }
        trajectory
    }

    /// Adds GNSS, IMU and true trajectory to a drive whose body frame is the frame of the unit.
    pub fn add_to(&self, plan: &mut Plan, name: &str) {
        let Some(first) = self.records.first() else { return };
        let origin = first.place;
        plan.add_truth(&self.trajectory(&LocalFrame::new(origin)), None);
        let samples: Vec<ImuSample> = self.records.iter().map(|record| record.sample).collect();
        plan.texts.push(TextFile { place: "imu.csv".into(), text: csv_from_samples(&samples) });
        let origin = [origin.latitude_deg, origin.longitude_deg, origin.altitude_m];
        fixes::add(plan, self.records.iter().map(|record| &record.fix), origin);
        plan.manifest.imu =
            Some(ImuEntry { delay_nanos: 0, file: "imu.csv".into(), position_in_body: [0.0; 3], body_from_imu: None });
        let n = self.records.len();
        plan.report.push(format!("imported: {n} records of {name} as GNSS fixes, IMU samples and true poses"));
        if self.n_not_rising > 0 {
            let n = self.n_not_rising;
            plan.report
                .push(format!("not imported: {n} records of {name} whose stamp is not later than the previous one"));
        }
    }
}
