//! Points of maps.

use crate::commands::evaluate::trajectory::of_drive;
use crate::commands::inspect::cloud_files;
use anyhow::ensure;
use formats::drive::{Drive, MANIFEST_FILE};
use formats::ply::Vertices;
use formats::velodyne::LidarReturn;
use geometry::{Point3, Pose, Trajectory, Vector3};
use std::path::Path;

/// Memory: 12 bytes a point here, once more while they are sorted.
const MAX_POINTS: usize = 1 << 30;

/// Positions relative to a place near them, so that an f32 keeps less than 1 mm within 8 km.
pub struct Points {
    /// Moved by the origin.
    pub points: Vec<[f32; 3]>,
    /// Where it is, m.
    pub origin: Vector3<f64>,
}

/// What is read of a cloud.
#[derive(Clone, Copy)]
pub struct Choice {
    /// Without points that are flagged as moving.
    pub static_only: bool,
    /// Where 0 is to be; the first point if nothing is said.
    pub origin: Option<Vector3<f64>>,
    /// `truth_world_from_world`.
    pub moved: Pose,
}

/// All points of a PLY file, of the clouds in a run's folder, or the sweeps of a drive placed by its truth.
pub fn read(path: &Path, choice: &Choice) -> anyhow::Result<Points> {
    let mut found = Points { points: Vec::new(), origin: choice.origin.unwrap_or_default() };
    let mut has_origin = choice.origin.is_some();
    let mut push = |position: Vector3<f64>| -> anyhow::Result<()> {
        if !has_origin && position.iter().all(|value| value.is_finite()) {
            (found.origin, has_origin) = (position.map(f64::round), true);
        }
        ensure!(found.points.len() < MAX_POINTS, "{}: more than {MAX_POINTS} points", path.display());
        found.points.push((position - found.origin).cast::<f32>().into());
        Ok(())
    };
    if path.join(MANIFEST_FILE).is_file() {
        let drive = Drive::open(path)?;
        place_sweeps(&drive, &of_drive(&drive)?, |position| push((choice.moved * position).coords))?;
    } else {
        for file in cloud_files(path)? {
            let cloud = Vertices::load(&file)?;
            let is_dynamic = choice.static_only.then(|| cloud.u8s("dynamic")).transpose()?;
            let [x, y, z] = [cloud.f64s("x")?, cloud.f64s("y")?, cloud.f64s("z")?];
            for i in (0..cloud.len()).filter(|i| is_dynamic.as_ref().is_none_or(|flags| flags[*i] == 0)) {
                push((choice.moved * Point3::new(x[i], y[i], z[i])).coords)?;
            }
        }
    }
    ensure!(!found.points.is_empty(), "{}: no points", path.display());
    Ok(found)
}

/// Each return where the lidar was at its shot; those before the first or after the last true pose are left out.
fn place_sweeps(
    drive: &Drive,
    truth: &Trajectory,
    mut push: impl FnMut(Point3<f64>) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    let body_from_lidar = drive.rig().body_from_lidar;
    let mut source = drive.sweeps()?;
    let mut returns: Vec<LidarReturn> = Vec::new();
    while let Some(sweep) = source.next_sweep(|some| returns.extend_from_slice(some))? {
        // Shots of one instant stand together: 32 of an HDL-32E's firing.
        let (mut offset_nanos, mut world_from_lidar) = (None, None);
        for point in returns.drain(..) {
            if offset_nanos != Some(point.offset_nanos) {
                offset_nanos = Some(point.offset_nanos);
                let stamp = sweep.stamp.plus_nanos(i64::from(point.offset_nanos));
                world_from_lidar = truth.at(stamp).map(|world_from_body| world_from_body * body_from_lidar);
            }
            if let Some(pose) = &world_from_lidar {
                push(pose * Point3::new(point.x, point.y, point.z).cast::<f64>())?;
            }
        }
    }
    Ok(())
}
