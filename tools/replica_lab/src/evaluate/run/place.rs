//! Frame of a run in the world of the truth.

use anyhow::Context;
use delivery::{GEOREFERENCE, GeoreferenceFile};
use drive::Drive;
use files::regular_file;
use geometry::{Geodetic, LocalFrame, Point3, Pose, Translation3, UnitQuaternion, Vector3};
use std::path::Path;

/// The frame of a run relative to the frame of the truth.
#[derive(Clone, Debug, PartialEq)]
pub enum RunPlace {
    /// Both are on the Earth: absolute errors are defined.
    World {
        /// Transform from the local frame of the run to the local frame of the drive.
        truth_from_run: Pose,
    },
    /// The run has its own frame: only errors relative to its first submap are defined. The text gives the reason.
    Own(String),
    /// The run was not moved to its final frame.
    Odometry,
}

impl RunPlace {
    /// Determines the place from `georeference.json` of the run and the origin of the drive.
    pub fn from_run(drive: &Drive, run: &Path) -> anyhow::Result<Self> {
        let path = run.join(GEOREFERENCE);
        if !path.exists() {
            return Ok(Self::Odometry);
        }
        let text = regular_file::read_to_string(&path).with_context(|| path.display().to_string())?;
        let found: GeoreferenceFile = serde_json::from_str(&text).with_context(|| path.display().to_string())?;
        let Some(origin) = found.origin else { return Ok(Self::Own("the run has no geographic origin".to_owned())) };
        let Some(gnss) = &drive.manifest().gnss else {
            return Ok(Self::Own("the drive has no [gnss] origin, so the place of its truth is unknown".to_owned()));
        };
        let frame = |[latitude_deg, longitude_deg, altitude_m]: [f64; 3]| {
            Geodetic::new(latitude_deg, longitude_deg, altitude_m).map(LocalFrame::new)
        };
        let run_frame = frame([origin.latitude_deg, origin.longitude_deg, origin.altitude_m]);
        let run_frame =
            run_frame.with_context(|| format!("{}: origin {origin:?} is not a position", path.display()))?;
        let truth_frame =
            frame(gnss.origin).with_context(|| format!("gnss.origin {:?} is not a position", gnss.origin))?;
        Ok(Self::World { truth_from_run: between(&truth_frame, &run_frame) })
    }
}

/// Long axes, so that rounding of positions on the Earth turns them by less than 1e-12 rad.
const AXIS_M: f64 = 10_000.0;

/// The rigid transform between two local frames, which are both Cartesian.
fn between(to: &LocalFrame, from: &LocalFrame) -> Pose {
    let moved = |p: Vector3<f64>| to.world_from_geodetic(&from.geodetic_from_world(&Point3::from(p))).coords;
    let origin = moved(Vector3::zeros());
    let [x, y] = [Vector3::x(), Vector3::y()].map(|axis| (moved(axis * AXIS_M) - origin) / AXIS_M);
    let rotation = UnitQuaternion::face_towards(&x.cross(&y), &y);
    Pose::from_parts(Translation3::from(origin), rotation)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_with_different_origins_are_converted_to_each_other() {
        let frame = |place: [f64; 3]| LocalFrame::new(Geodetic::new(place[0], place[1], place[2]).expect("a place"));
        let a = frame([48.8, 2.3, 100.0]);
        let b = frame([48.81, 2.32, 90.0]);
        let a_from_b = between(&a, &b);
        for p in [[0.0, 0.0, 0.0], [700.0, -300.0, 12.0], [-4000.0, 2500.0, -30.0]].map(Point3::from) {
            let expected = a.world_from_geodetic(&b.geodetic_from_world(&p));
            assert!((a_from_b * p - expected).norm() < 1e-6, "{p}");
        }
        assert!(a_from_b.translation.vector.norm() > 1000.0);
        assert!((between(&a, &a).translation.vector.norm()) < 1e-8);
    }
}
