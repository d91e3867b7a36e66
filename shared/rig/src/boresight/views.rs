//! The features of all passes, with the poses of the vehicle from the given paths.

use super::GROUPS;
use crate::error::RigError;
use crate::survey::SurveySettings;
use drive::Drive;
use geometry::{LocalFrame, Pose, Stamp, Vector3};
use given_path::{Deviation, GivenPath};
use lidar::SweepPoint;
use messages::SweepHeader;
use registration::{FeatureSettings, Revolution, Sweep, planar_features};

/// A sweep is used once the vehicle has moved so far since the last one, m: other views of the same surfaces.
const STEP_M: f64 = 3.0;
/// Largest number of used sweeps of a drive: 1.2 km.
const MAX_SWEEPS: usize = 400;
/// Longest range of features, m, and at most one per cube of this side, m.
const MAX_RANGE_M: f32 = 40.0;
const SPACING_M: f64 = 0.5;

/// A feature in one sweep.
pub struct View {
    /// Pose of the body at its time, in the frame of the first drive.
    pub world_from_body: Pose,
    /// Its time.
    pub stamp: Stamp,
    position: [f32; 3],
    normal: [f32; 3],
    /// Index of its drive.
    pub drive: usize,
    /// Group of stretches of its drive.
    pub group: usize,
}

/// The passes of a vehicle.
pub struct Passes {
    /// Features, drive by drive, in the order of their times.
    pub views: Vec<View>,
    /// Standard deviations of the path of each drive, in its middle.
    deviations: Vec<Deviation>,
}

impl View {
    /// Position in the LiDAR, m.
    pub fn p_in_lidar(&self) -> Vector3<f64> {
        Vector3::from(self.position).cast()
    }
    /// Unit normal in the LiDAR.
    pub fn normal_in_lidar(&self) -> Vector3<f64> {
        Vector3::from(self.normal).cast()
    }
    /// Distance from the LiDAR, m.
    pub fn range_m(&self) -> f64 {
        self.p_in_lidar().norm()
    }
}

impl Passes {
    /// Reads drives with the same mounting.
    pub fn read(drives: &[&Drive], settings: &SurveySettings) -> Result<Self, RigError> {
        let mut found = Self { views: Vec::new(), deviations: Vec::new() };
        let mut frame: Option<LocalFrame> = None;
        for (index, drive) in drives.iter().enumerate() {
            let path = path(drive)?;
            if drive.rig().body_from_lidar != drives[0].rig().body_from_lidar {
                let rule = format!(
                    "[lidar] body_from_lidar differs from {}: all passes need the same vehicle and the same drive.toml",
                    drives[0].folder().display()
                );
                return Err(RigError::source(drive.folder(), "drive.toml", rule));
            }
            let world_from_own = match (&frame, path.local_frame()) {
                (_, None) if drives.len() == 1 => Pose::identity(),
                (_, None) => {
                    let rule = "its frame has no place on the Earth, which relates it to the other drives; set trajectory.origin";
                    return Err(RigError::source(path.file(), "", rule));
                }
                (None, Some(own)) => {
                    frame = Some(*own);
                    Pose::identity()
                }
                (Some(frame), Some(own)) => {
                    let origin = frame.world_from_geodetic(&own.origin()).coords;
                    Pose::from_parts(origin.into(), frame.rotation_from(own))
                }
            };
            // Further drives are read whole: they may meet the first one anywhere.
            let part = if index == 0 {
                *settings
            } else {
                SurveySettings { start_s: 0.0, seconds: f64::INFINITY, ..*settings }
            };
            let first = found.views.len();
            found.add(index, drive, &path, &world_from_own, &part)?;
            let own = &mut found.views[first..];
            let n = own.len().max(1);
            for (k, view) in own.iter_mut().enumerate() {
                view.group = k * GROUPS / n;
            }
            let middle = own.get(n / 2).map_or(path.span()[0], |view| view.stamp);
            found.deviations.push(path.deviation_at(middle));
        }
        Ok(found)
    }

    /// Number of drives.
    pub fn n_drives(&self) -> usize {
        self.deviations.len()
    }

    /// Standard deviation of the position of a drive relative to the first one, m: the largest of its axes.
    pub fn offset_sigma_m(&self, drive: usize) -> f64 {
        let largest = |drive: usize| self.deviations[drive].east_north_up_m.into_iter().fold(1e-3, f64::max);
        largest(0).hypot(largest(drive))
    }

    /// Standard deviations of the mean attitude error of the paths, rad: roll, pitch, heading.
    pub fn attitude_sigma(&self) -> [f64; 3] {
        let n = self.deviations.len() as f64;
        let square = |axis: usize| self.deviations.iter().map(|d| d.roll_pitch_heading_rad[axis].powi(2)).sum::<f64>();
        [0, 1, 2].map(|axis| square(axis).sqrt() / n)
    }

    fn add(
        &mut self,
        index: usize,
        drive: &Drive,
        path: &GivenPath,
        world_from_own: &Pose,
        settings: &SurveySettings,
    ) -> Result<(), RigError> {
        let mut source = drive.sweeps()?;
        let up = (drive.rig().body_from_lidar.rotation.inverse() * Vector3::z()).cast();
        let features = FeatureSettings { spacing_m: SPACING_M, max_range_m: MAX_RANGE_M, ..FeatureSettings::default() };
        let mut begin = None;
        let mut last: Option<Vector3<f64>> = None;
        let mut n_sweeps = 0;
        while n_sweeps < MAX_SWEEPS {
            let mut rows: Vec<SweepPoint> = Vec::new();
            let Some(info) = source.next_sweep(|points| rows.extend_from_slice(points))? else { break };
            let seconds = info.stamp.seconds_since(*begin.get_or_insert(info.stamp));
            if seconds >= settings.start_s + settings.seconds {
                break;
            }
            let Some(pose) = path.at(info.stamp) else { continue };
            let p = pose.translation.vector;
            if seconds < settings.start_s || last.is_some_and(|last| (p - last).norm() < STEP_M) {
                continue;
            }
            last = Some(p);
            n_sweeps += 1;
            let header = SweepHeader {
                n_rings: drive.lidar().n_rings() as u32,
                has_times: u32::from(info.has_times),
                ..SweepHeader::default()
            };
            let revolution = |spin| Revolution { spin, duration_nanos: info.duration_nanos };
            let sweep = Sweep::from_rows(info.stamp, &header, &rows, settings.untimed_turn.map(revolution));
            for feature in planar_features(&sweep, &up, &features).into_iter().filter(|feature| !feature.is_rough) {
                let nanos = (f64::from(feature.share) + 0.5) * f64::from(sweep.duration_nanos());
                let stamp = info.stamp.plus_nanos(nanos as i64);
                let Some(pose) = path.at(stamp) else { continue };
                self.views.push(View {
                    world_from_body: world_from_own * pose,
                    stamp,
                    position: feature.position,
                    normal: feature.normal,
                    drive: index,
                    group: 0,
                });
            }
        }
        Ok(())
    }
}

/// The path of a drive.
fn path(drive: &Drive) -> Result<GivenPath, RigError> {
    let fault = |rule: &str| RigError::source(drive.folder(), "drive.toml", rule);
    let path = GivenPath::from_drive(drive)
        .ok_or_else(|| fault("has no [trajectory]; the mounting needs a post-processed path of each pass"))?;
    path.map_err(|problem| fault(&problem.to_string()))
}
