//! The pose graph over the submaps of all drives.
//!
//! The error that a drive has in common — a receiver's datum, the multipath of one hour — must not shrink with the number of its
//! submaps. So each drive has a pose of its own, `survey_from_drive`, which starts as the identity: the submaps are measured relative
//! to it, and it is known only as well as one submap of the drive is.

#[cfg(test)]
mod draws;

use crate::control::SeenControl;
use crate::drives::Submap;
use crate::error::SurveyError;
use geometry::{Point3, Pose};
use georeference::{AntennaPosition, Gauge, PoseGraph, RelativePose, Solution, Start, UpDirection};
use nalgebra::{Matrix2, Matrix6, Vector3, Vector6};

/// Submaps whose errors in the run are one error: 200 m, about 30 s of multipath or of drift of an inertial unit.
const CORRELATED: f64 = 10.0;
/// Errors of the odometry between two submaps: m, share of their distance, and rad. The drift of the odometry is about 0.1 %
/// (`lab/notebook/odometry.md`).
const STEP_M: f64 = 0.005;
const STEP_SHARE: f64 = 0.001;
const STEP_RAD: f64 = 0.0002;
/// Largest error of the odometry along an axis that no surface determines, m, and the error of one surface, m. Chosen on rural 63 and 64.
const MAX_SLIP_M: f64 = 0.1;
const RESIDUAL_M: f64 = 0.2;
/// Least horizontal component of the normal of an upright surface: 30 degrees from the vertical axis, steeper than embankments.
const UPRIGHT: f64 = 0.5;
/// Standard deviations from the run are at least this, m and rad: zero would fix a pose.
const LEAST_M: f64 = 0.005;
const LEAST_RAD: f64 = 0.0002;
/// A height point says nothing about its horizontal position: this deviation, m.
const UNMEASURED_M: f64 = 1e4;

/// The pose of a submap from its run.
#[derive(Clone, Debug)]
pub struct RunPose {
    /// Index of the drive.
    pub drive: usize,
    /// The pose.
    pub survey_from_submap: Pose,
    /// Standard deviations along the axes of the submap, m.
    pub sigma_m: [f64; 3],
    /// Standard deviations about the axes of the submap, rad.
    pub sigma_rad: [f64; 3],
    /// Sum of the products of the horizontal components of the normals of its upright surfaces, in its axes: how well they determine
    /// a horizontal position.
    pub upright: Matrix2<f64>,
}

impl From<&Submap> for RunPose {
    fn from(submap: &Submap) -> Self {
        let Submap { drive, survey_from_submap, sigma_m, sigma_rad, .. } = submap;
        let normals =
            submap.keyframe.surfaces().map(|surface| surface.normal.xy()).filter(|normal| normal.norm() > UPRIGHT);
        Self {
            drive: *drive,
            survey_from_submap: *survey_from_submap,
            sigma_m: *sigma_m,
            sigma_rad: *sigma_rad,
            upright: normals.map(|normal| normal * normal.transpose()).sum(),
        }
    }
}

/// Solution of the network. Weights are 0 (outlier) to 1 (inlier).
pub struct Adjusted {
    /// Poses of the submaps.
    pub poses: Vec<Pose>,
    /// Standard deviation of each submap, m: the largest horizontal axis, and up.
    pub sigma_m: Vec<[f64; 2]>,
    /// For each relative pose.
    pub match_weights: Vec<f64>,
    /// For each seen control point.
    pub control_weights: Vec<f64>,
}

/// Solves for all poses of submaps, drive by drive, with these relative poses between drives and these control points.
pub fn adjust(
    submaps: &[RunPose],
    start: &[Pose],
    matches: Vec<RelativePose>,
    control: &[SeenControl],
) -> Result<Adjusted, SurveyError> {
    let n = submaps.len();
    let mut graph = PoseGraph { loops: matches, ..PoseGraph::default() };
    graph.positions = control.iter().map(position).collect();
    let mut poses = start.to_vec();
    let n_drives = submaps.iter().map(|submap| submap.drive + 1).max().unwrap_or(0);
    for drive in 0..n_drives {
        let numbers: Vec<usize> = (0..n).filter(|k| submaps[*k].drive == drive).collect();
        if numbers.is_empty() {
            continue;
        }
        graph.odometry.extend(numbers.windows(2).map(|pair| odometry(submaps, pair[0], pair[1])));
        let survey_from_drive = poses.len();
        poses.push(Pose::identity());
        for &k in &numbers {
            graph.odometry.push(pose_in_drive(submaps, survey_from_drive, k));
            graph.positions.push(drive_position(submaps, survey_from_drive, k, numbers.len()));
            graph.up_directions.push(upright(submaps, k));
        }
    }
    let solution = graph.solve_from(&poses, Start::Guess, Gauge::Positions).ok_or(SurveyError::Undetermined)?;
    let Solution { poses, covariances, loop_weights, mut position_weights } = solution;
    position_weights.truncate(control.len());
    let sigma_m = (0..n).map(|k| {
        let axes = poses[k].rotation.to_rotation_matrix();
        let covariance = axes.matrix() * covariances[k].fixed_view::<3, 3>(0, 0) * axes.matrix().transpose();
        let [east, north, up] = [0, 1, 2].map(|axis| covariance[(axis, axis)].max(0.0).sqrt());
        [east.max(north), up]
    });
    Ok(Adjusted {
        sigma_m: sigma_m.collect(),
        poses: poses[..n].to_vec(),
        match_weights: loop_weights,
        control_weights: position_weights,
    })
}

/// The relative pose of two consecutive submaps in their run.
fn odometry(submaps: &[RunPose], target: usize, source: usize) -> RelativePose {
    let [a, b] = [target, source].map(|k| &submaps[k].survey_from_submap);
    let target_from_source = a.inv_mul(b);
    let m = STEP_M + STEP_SHARE * target_from_source.translation.vector.norm();
    let mut information = information([m; 3], [STEP_RAD; 3]);
    let horizontal = Matrix2::from_diagonal_element(m * m) + slip(&submaps[target].upright);
    if let Some(inverse) = horizontal.try_inverse() {
        information.fixed_view_mut::<2, 2>(0, 0).copy_from(&inverse);
    }
    RelativePose { target, source, target_from_source, information }
}

/// Covariance of the odometry where hardly any surface is upright, m², in the axes of a submap: in a field it is off by up to a
/// decimetre along the track, whatever its drift elsewhere.
fn slip(upright: &Matrix2<f64>) -> Matrix2<f64> {
    let least = (RESIDUAL_M / MAX_SLIP_M).powi(2);
    let weak = (upright + Matrix2::from_diagonal_element(least)).try_inverse();
    weak.map_or_else(Matrix2::zeros, |inverse| inverse * (RESIDUAL_M * RESIDUAL_M))
}

/// The pose of a submap in its run, as one of [`CORRELATED`] measurements of one error.
fn pose_in_drive(submaps: &[RunPose], survey_from_drive: usize, k: usize) -> RelativePose {
    let submap = &submaps[k];
    let scale = CORRELATED.sqrt();
    RelativePose {
        target: survey_from_drive,
        source: k,
        target_from_source: submap.survey_from_submap,
        // Translations are in axes of the target.
        information: information(
            position_m(submap).map(|m| m * scale),
            submap.sigma_rad.map(|rad| rad.max(LEAST_RAD) * scale),
        ),
    }
}

/// One of `n` equal parts of the position of a drive.
fn drive_position(submaps: &[RunPose], survey_from_drive: usize, k: usize, n: usize) -> AntennaPosition {
    let submap = &submaps[k];
    let p = Point3::from(submap.survey_from_submap.translation.vector);
    let sigma_m = position_m(submap);
    AntennaPosition {
        submap: survey_from_drive,
        p_in_submap: p,
        p_in_world: p,
        sigma_m,
        sigma_above_m: sigma_m[2],
        share: 1.0 / n as f64,
        tolerance_m: 0.0,
    }
}

/// Standard deviations of the position of a submap in its run, east, north and up, m.
fn position_m(submap: &RunPose) -> [f64; 3] {
    let [along, across, up] = submap.sigma_m.map(|m| m.max(LEAST_M));
    [along.max(across), along.max(across), up]
}

fn upright(submaps: &[RunPose], k: usize) -> UpDirection {
    let submap = &submaps[k];
    UpDirection {
        submap: k,
        up_in_submap: submap.survey_from_submap.rotation.inverse() * Vector3::z(),
        sigma_rad: submap.sigma_rad[0].max(submap.sigma_rad[1]).max(LEAST_RAD) * CORRELATED.sqrt(),
    }
}

fn position(seen: &SeenControl) -> AntennaPosition {
    let [horizontal, up] = seen.sigma_m.map(|sigma| sigma.unwrap_or(UNMEASURED_M));
    AntennaPosition {
        submap: seen.submap,
        p_in_submap: seen.p_in_submap,
        p_in_world: seen.p_in_survey,
        sigma_m: [horizontal, horizontal, up],
        sigma_above_m: up,
        share: seen.share,
        tolerance_m: 0.0,
    }
}

fn information(m: [f64; 3], rad: [f64; 3]) -> Matrix6<f64> {
    let [a, b, c] = m;
    let [d, e, f] = rad;
    Matrix6::from_diagonal(&Vector6::new(a, b, c, d, e, f).map(|sigma| sigma.powi(-2)))
}
