//! Checks whether the points are mirrored: a frame with left and right exchanged rotates in the opposite sense.

use super::Verdict;
use super::gnss::Turning;
use crate::survey::Survey;
use nalgebra::Matrix3;

/// Least ratio of the odometry's turning to the turning of the receiver's course; a mirrored odometry has -1.
const MIN_SHARE: f64 = -0.5;

/// Verdict from the course of the receiver, or from the axes of the inertial unit.
pub(super) fn verdict(survey: &Survey) -> Verdict {
    let by_course = Turning::from_survey(survey);
    let by_unit = axes(survey);
    let advice = "the points of the LiDAR are mirrored: one axis of its frame has the wrong sense (y points to the left, \
                  azimuths rise clockwise); correct the files, no mounting can";
    let limit = String::new();
    if let Some(turning) = &by_course {
        let value = format!(
            "the LiDAR turns {:+.2} times as much as the course of the receiver ({:.0} degrees)",
            turning.share,
            turning.turned.to_degrees()
        );
        return Verdict::new("handedness", "lidar", turning.share > MIN_SHARE, [value, limit, advice.to_owned()]);
    }
    match by_unit {
        Some([rate, force]) => {
            // A mirrored unit has the same mirrored axes for rates and forces; mirrored points rotate the two
            // differently.
            let is_sound = (rate.determinant() > 0.0) == (force.determinant() > 0.0);
            let value = if is_sound {
                "angular rates and accelerations of the inertial unit have the same axes"
            } else {
                "angular rates and accelerations of the inertial unit fit with different axes"
            };
            Verdict::new("handedness", "lidar", is_sound, [value.to_owned(), limit, advice.to_owned()])
        }
        None => Verdict::unknown("handedness", "lidar", "no turn that a receiver or an inertial unit also measured"),
    }
}

/// The axes of rates and forces, if the comparison of the unit has determined them.
fn axes(survey: &Survey) -> Option<[Matrix3<f64>; 2]> {
    let check = survey.inertial.as_ref()?;
    let is_judged = check.is_verified();
    let correction = check.correction();
    is_judged.then(|| [correction.rate.axes.matrix(), correction.force.axes.matrix()])
}
