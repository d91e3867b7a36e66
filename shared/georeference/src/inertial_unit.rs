//! The samples of the inertial unit: comparison with the motion of the LiDAR, and distribution to their users.

use crate::{GeoreferenceSettings, Georeferencer};
use doubts::Doubt;
use geometry::Pose;
use messages::ImuRow;
use registration::{InertialCheck, InertialSample, Registered, SelectedOdometry};
use serde::{Deserialize, Serialize};

/// An inertial unit whose samples may be wrong.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct InertialUnit {
    /// Comparison of the samples with the motion of the LiDAR; `None`: the samples are used uncorrected.
    check: Option<InertialCheck>,
    /// Whether the samples predict the motion.
    predicts: bool,
}

impl InertialUnit {
    /// `predicts`: the samples predict the motion.
    pub fn new(check: Option<InertialCheck>, predicts: bool) -> Self {
        Self { check, predicts }
    }

    /// Adds the samples that are not withheld to odometry and pose graph.
    pub fn add(
        &mut self,
        rows: &[ImuRow],
        odometry: &mut SelectedOdometry,
        georeferencer: &mut Georeferencer,
        settings: &GeoreferenceSettings,
    ) {
        let mut samples: Vec<InertialSample> = rows.iter().map(InertialSample::from).collect();
        if let Some(check) = &mut self.check {
            samples = check.add_samples(&samples);
            odometry.set_imu_probation(check.is_on_probation());
            forget_wrong(check, odometry, georeferencer);
        }
        let rows: Vec<ImuRow> = samples.iter().map(ImuRow::from).collect();
        georeferencer.add_imu(&rows, settings);
        if self.predicts {
            for sample in samples {
                odometry.add_imu(sample);
            }
        }
    }

    /// Compares the samples with the motion of a registered sweep.
    pub fn compare(
        &mut self,
        registered: &Registered,
        body_from_lidar: &Pose,
        odometry: &mut SelectedOdometry,
        georeferencer: &mut Georeferencer,
    ) {
        if let Some(check) = &mut self.check {
            check.add_registered(registered, body_from_lidar);
            forget_wrong(check, odometry, georeferencer);
        }
    }

    /// Results of the comparison, for the operator.
    pub fn summary(&self) -> Vec<String> {
        self.check.as_ref().map(InertialCheck::summary).unwrap_or_default()
    }

    /// The doubt if the unit was not used.
    pub fn doubt(&self) -> Option<Doubt> {
        self.check.as_ref().and_then(InertialCheck::doubt)
    }
}

fn forget_wrong(check: &mut InertialCheck, odometry: &mut SelectedOdometry, georeferencer: &mut Georeferencer) {
    if check.take_change() {
        odometry.forget_imu();
        georeferencer.forget_imu();
    }
}
