//! Reads the points of a cloud.

use crate::evaluate::trajectory::true_trajectory;
use anyhow::ensure;
use drive::{Drive, MANIFEST_FILE, SweepSource};
use formats::ply::Vertices;
use geometry::{Point3, Pose, Trajectory, Vector3};
use lidar::SweepPoint;
use pictures::cloud_files::cloud_files;
use std::path::Path;

/// A limit on memory: 12 bytes per point, twice while they are sorted.
const MAX_POINTS: usize = 1 << 30;

/// Positions relative to an origin near them: within 8 km an f32 resolves better than 1 mm.
pub struct LocalPoints {
    /// Positions relative to the origin, m.
    pub points: Vec<[f32; 3]>,
    /// The origin, m.
    pub origin: Vector3<f64>,
}

/// Which points are read, and how they are transformed.
#[derive(Clone, Copy)]
pub struct PointSelection {
    /// Ignore points that are flagged as dynamic.
    pub static_only: bool,
    /// The origin. `None`: the first point, rounded to m.
    pub origin: Option<Vector3<f64>>,
    /// Transform that is applied to all points.
    pub truth_world_from_world: Pose,
}

/// Reads all points of a PLY file, of the clouds of a run, or of the sweeps of a drive placed by its true poses.
pub fn read(path: &Path, selection: &PointSelection) -> anyhow::Result<LocalPoints> {
    let mut found = LocalPoints { points: Vec::new(), origin: selection.origin.unwrap_or_default() };
    let mut has_origin = selection.origin.is_some();
    let mut push = |position: Vector3<f64>| -> anyhow::Result<()> {
        if !has_origin && position.iter().all(|value| value.is_finite()) {
            found.origin = position.map(f64::round);
            has_origin = true;
        }
        ensure!(found.points.len() < MAX_POINTS, "{}: more than {MAX_POINTS} points", path.display());
        found.points.push((position - found.origin).cast::<f32>().into());
        Ok(())
    };
    if path.join(MANIFEST_FILE).is_file() {
        let drive = Drive::open(path)?;
        place_sweeps(&drive, &true_trajectory(&drive)?, |position| {
            push((selection.truth_world_from_world * position).coords)
        })?;
    } else {
        for file in cloud_files(path)? {
            let cloud = Vertices::load(&file)?;
            let is_dynamic = selection.static_only.then(|| cloud.u8s("dynamic")).transpose()?;
            let [x, y, z] = [cloud.f64s("x")?, cloud.f64s("y")?, cloud.f64s("z")?];
            for i in (0..cloud.len()).filter(|i| is_dynamic.as_ref().is_none_or(|flags| flags[*i] == 0)) {
                push((selection.truth_world_from_world * Point3::new(x[i], y[i], z[i])).coords)?;
            }
        }
    }
    ensure!(!found.points.is_empty(), "{}: no points", path.display());
    Ok(found)
}

/// Places each return by the true pose at its time. Returns before the first or after the last true pose are ignored.
fn place_sweeps(
    drive: &Drive,
    truth: &Trajectory,
    mut push: impl FnMut(Point3<f64>) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    let mountings = std::iter::once(&drive.rig().body_from_lidar).chain(&drive.rig().body_from_other_lidars);
    for (lidar, body_from_lidar) in drive.lidars().zip(mountings).filter(|(lidar, _)| !lidar.files.is_empty()) {
        place_sweeps_of(SweepSource::open(lidar)?, body_from_lidar, truth, &mut push)?;
    }
    Ok(())
}

fn place_sweeps_of(
    mut source: SweepSource,
    body_from_lidar: &Pose,
    truth: &Trajectory,
    push: &mut impl FnMut(Point3<f64>) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    let mut returns: Vec<SweepPoint> = Vec::new();
    while let Some(sweep) = source.next_sweep(|some| returns.extend_from_slice(some))? {
        // Returns of one firing are consecutive and have the same time: 32 of an HDL-32E.
        let mut offset_nanos = None;
        let mut world_from_lidar = None;
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
