//! The pose graph over the submaps of all drives.
//!
//! The error that a drive has in common — a receiver's datum, the multipath of one hour — must not shrink with the number of its
//! submaps. So each drive has a pose of its own, `survey_from_drive`, which starts as the identity: the submaps are measured relative
//! to it, and it is known only as well as one submap of the drive is.

use crate::control::SeenControl;
use crate::drives::{Submap, Submaps};
use crate::error::SurveyError;
use geometry::{Point3, Pose};
use georeference::{AntennaPosition, Gauge, PoseGraph, RelativePose, Solution, Start, UpDirection};
use nalgebra::{Matrix6, Vector3, Vector6};

/// Submaps whose errors in the run are one error: 200 m, about 30 s of multipath or of drift of an inertial unit.
const CORRELATED: f64 = 10.0;
/// Errors of the odometry between two submaps: m, share of their distance, and rad. The drift of the odometry is about 0.1 %
/// (`lab/notebook/odometry.md`).
const STEP_M: f64 = 0.005;
const STEP_SHARE: f64 = 0.001;
const STEP_RAD: f64 = 0.0002;
/// Standard deviations from the run are at least this, m and rad: zero would fix a pose.
const LEAST_M: f64 = 0.005;
const LEAST_RAD: f64 = 0.0002;
/// A height point says nothing about its horizontal position: this deviation, m.
const UNMEASURED_M: f64 = 1e4;

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

/// Solves for all poses with these relative poses between drives and these control points.
pub fn adjust(
    submaps: &Submaps,
    start: &[Pose],
    matches: Vec<RelativePose>,
    control: &[SeenControl],
) -> Result<Adjusted, SurveyError> {
    let n = submaps.all.len();
    let mut graph = PoseGraph { loops: matches, ..PoseGraph::default() };
    graph.positions = control.iter().map(position).collect();
    let mut poses = start.to_vec();
    for (drive, _) in submaps.drives.iter().enumerate() {
        let numbers: Vec<usize> = (0..n).filter(|k| submaps.all[*k].drive == drive).collect();
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
fn odometry(submaps: &Submaps, target: usize, source: usize) -> RelativePose {
    let [a, b] = [target, source].map(|k| &submaps.all[k].survey_from_submap);
    let target_from_source = a.inv_mul(b);
    let m = STEP_M + STEP_SHARE * target_from_source.translation.vector.norm();
    RelativePose { target, source, target_from_source, information: information([m; 3], [STEP_RAD; 3]) }
}

/// The pose of a submap in its run, as one of [`CORRELATED`] measurements of one error.
fn pose_in_drive(submaps: &Submaps, survey_from_drive: usize, k: usize) -> RelativePose {
    let submap = &submaps.all[k];
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
fn drive_position(submaps: &Submaps, survey_from_drive: usize, k: usize, n: usize) -> AntennaPosition {
    let submap = &submaps.all[k];
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
fn position_m(submap: &Submap) -> [f64; 3] {
    let [along, across, up] = submap.sigma_m.map(|m| m.max(LEAST_M));
    [along.max(across), along.max(across), up]
}

fn upright(submaps: &Submaps, k: usize) -> UpDirection {
    let submap = &submaps.all[k];
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
