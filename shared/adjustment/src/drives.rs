//! The drives of a survey and their submaps in one frame.

use crate::error::SurveyError;
use crate::surfaces::{Shape, shape};
use geometry::{Geodetic, Isometry3, LocalFrame, Point3, Pose, Stamp, UnitQuaternion, Vector3};
use georeference::Keyframe;
use nalgebra::{Matrix3, Point2, Rotation3};
use rayon::prelude::*;
use surveying::RunFolder;

/// A submap of a drive.
pub struct Submap {
    /// Its number in the run.
    pub seq: u64,
    /// Index of its drive.
    pub drive: usize,
    /// Time of its first shot.
    pub stamp: Stamp,
    /// Pose from the run.
    pub survey_from_submap: Pose,
    /// Standard deviations from the run along the axes of the submap, m.
    pub sigma_m: [f64; 3],
    /// Standard deviations from the run about the axes of the submap, rad.
    pub sigma_rad: [f64; 3],
    /// Its surfaces.
    pub keyframe: Keyframe,
    /// Horizontal positions of its columns, in the submap, m.
    pub columns: Vec<Point2<f64>>,
}

/// A drive of a survey.
pub struct SurveyDrive {
    /// Its name in the survey.
    pub name: String,
    /// Its finished run.
    pub run: RunFolder,
    /// Rotation and translation from the local frame of the run to the one of the survey.
    pub survey_from_run: Pose,
}

/// All submaps of a survey, drive by drive.
pub struct Submaps {
    /// East-north-up frame of the survey: the frame of the first drive.
    pub frame: LocalFrame,
    /// The drives.
    pub drives: Vec<SurveyDrive>,
    /// The submaps.
    pub all: Vec<Submap>,
}

impl Submaps {
    /// Reads the submaps of finished runs, each with a name. `progress` receives numbers of submaps that were read.
    pub fn read(runs: Vec<(String, RunFolder)>, progress: impl Fn(usize) + Sync) -> Result<Self, SurveyError> {
        let mut frame = None;
        let mut drives = Vec::new();
        for (name, run) in runs {
            let origin = origin(&run)?;
            let frame: &LocalFrame = frame.get_or_insert_with(|| LocalFrame::new(origin));
            let survey_from_run = between(frame, &LocalFrame::new(origin));
            drives.push(SurveyDrive { name, run, survey_from_run });
        }
        let Some(frame) = frame else { return Err(SurveyError::Undetermined) };
        let entries: Vec<_> = (0..)
            .zip(&drives)
            .flat_map(|(index, drive)| {
                let placed = drive.run.index.clouds.iter().filter(|entry| entry.is_placed() && entry.n_points > 0);
                placed.map(move |entry| (index, entry))
            })
            .collect();
        let read = entries.par_iter().enumerate().map(|(number, (index, entry))| {
            let SurveyDrive { run, survey_from_run, .. } = &drives[*index];
            let shape = shape(run, entry, survey_from_run, number)?;
            progress(1);
            let Some(Shape { keyframe, columns }) = shape else { return Ok(None) };
            Ok(Some(Submap {
                seq: entry.seq,
                drive: *index,
                stamp: Stamp(entry.stamp_begin),
                survey_from_submap: survey_from_run * entry.pose(),
                sigma_m: entry.sigma_m.unwrap_or_default().map(f64::from),
                sigma_rad: entry.sigma_rad.unwrap_or_default().map(f64::from),
                keyframe,
                columns,
            }))
        });
        let all: Result<Vec<Option<Submap>>, SurveyError> = read.collect();
        let all: Vec<Submap> = all?.into_iter().flatten().collect();
        Ok(Self { frame, drives, all })
    }

    /// Positions of the vehicle in the middle of each submap for these poses of the submaps.
    pub(crate) fn centers(&self, poses: &[Pose]) -> Vec<Point3<f64>> {
        let centers = self.all.iter().zip(poses);
        centers
            .map(|(submap, pose)| Point3::from((pose * submap.keyframe.submap_from_body).translation.vector))
            .collect()
    }
}

/// Origin of a run whose clouds are in its local frame.
fn origin(run: &RunFolder) -> Result<Geodetic, SurveyError> {
    let georeference = run.georeference.as_ref();
    if georeference.is_some_and(surveying::Georeference::is_utm) {
        let rule = "the clouds are in UTM; a survey needs clouds in the local frame: run with export.frame = \"local\"";
        return Err(SurveyError::content(run.path(), rule));
    }
    let local = georeference.and_then(surveying::Georeference::local);
    let rule = "is not placed on the Earth; a survey needs fixes or a given path to find where its drives meet";
    local.map(LocalFrame::origin).ok_or_else(|| SurveyError::content(run.path(), rule))
}

/// The rigid transformation between two east-north-up frames.
fn between(target: &LocalFrame, source: &LocalFrame) -> Pose {
    /// Long enough that rounding of geographic coordinates does not turn the axes.
    const AXIS_M: f64 = 1000.0;
    let mapped = |p: Vector3<f64>| target.world_from_geodetic(&source.geodetic_from_world(&Point3::from(p))).coords;
    let origin = mapped(Vector3::zeros());
    let axis = |k: usize| (mapped(Vector3::ith(k, AXIS_M)) - origin) / AXIS_M;
    let rotation = Rotation3::from_matrix(&Matrix3::from_columns(&[axis(0), axis(1), axis(2)]));
    Isometry3::from_parts(origin.into(), UnitQuaternion::from_rotation_matrix(&rotation))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_of_two_places_differ_by_a_rigid_motion() {
        let at = |latitude_deg, longitude_deg| {
            LocalFrame::new(Geodetic::new(latitude_deg, longitude_deg, 100.0).expect("on Earth"))
        };
        let [a, b] = [at(48.1, 2.3), at(48.13, 2.36)];
        let a_from_b = between(&a, &b);
        assert!((4000.0..7000.0).contains(&a_from_b.translation.vector.norm()));
        for p in [Point3::new(0.0, 0.0, 0.0), Point3::new(-700.0, 350.0, 12.0), Point3::new(90.0, -800.0, -3.0)] {
            let expected = a.world_from_geodetic(&b.geodetic_from_world(&p));
            assert!((a_from_b * p - expected).norm() < 1e-4, "{p}");
        }
    }
}
