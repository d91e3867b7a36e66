//! The points of a moment of the drive, read from the clouds of the run.

use super::finished_run::FinishedRun;
use delivery::CloudEntry;
use formats::ply::{PlyError, PlyRows, Vertices};
use geometry::{Point3, Stamp};
use std::iter::once;

/// Points of several LiDARs come sweep by sweep: they are out of the order of time by less than this, s.
const DISORDER_S: f64 = 0.2;
/// Points of a moment: several LiDARs give less than three million a second.
const MAX_ROWS: usize = 1 << 21;

/// A point of the moment.
pub struct MomentPoint {
    /// Frame of the clouds, m.
    pub position: Point3<f64>,
    pub lidar: Point3<f64>,
    pub sweep: i64,
    pub ring: u8,
    pub azimuth_deg: f32,
    pub elevation_deg: f32,
}

/// The stamp of the middle of the path: the vehicle moves there, which shows delays of cameras, too.
pub fn middle_of_path(run: &FinishedRun) -> Option<Stamp> {
    let poses = run.trajectory.poses();
    let half_m = 0.5 * run.trajectory.length_m();
    let mut length_m = 0.0;
    for pair in poses.windows(2) {
        length_m += (pair[1].1.translation.vector - pair[0].1.translation.vector).norm();
        if length_m >= half_m {
            return Some(pair[0].0);
        }
    }
    poses.first().map(|(stamp, _)| *stamp)
}

/// The points within `half_s` around a stamp. Empty if no cloud covers it.
pub fn points_around(run: &FinishedRun, stamp: Stamp, half_s: f64) -> Result<Vec<MomentPoint>, PlyError> {
    let half_nanos = (half_s * 1e9) as i64;
    let covers = |cloud: &&CloudEntry| {
        cloud.stamp_begin <= stamp.0.saturating_add(half_nanos) && cloud.stamp_end >= stamp.0.saturating_sub(half_nanos)
    };
    let clouds = run.index.iter().flat_map(|index| &index.clouds).filter(covers);
    let mut points = Vec::new();
    for cloud in clouds {
        let rows = PlyRows::open(&run.folder.join(&cloud.file))?;
        let has_lidars = rows.header().properties.iter().any(|property| property.name == "lidar");
        let disorder_s = if has_lidars { DISORDER_S } else { 0.0 };
        let middle_s = stamp.0 as f64 * 1e-9;
        let begin = partition(&rows, middle_s - half_s - disorder_s)?;
        let end = partition(&rows, middle_s + half_s + disorder_s)?.min(begin + MAX_ROWS);
        let vertices = rows.select(once(begin..end))?;
        add(&vertices, [middle_s - half_s, middle_s + half_s], &mut points)?;
    }
    Ok(points)
}

/// The first row that is not before `time_s`, within the disorder.
fn partition(rows: &PlyRows, time_s: f64) -> Result<usize, PlyError> {
    let (mut low, mut high) = (0, rows.len());
    while low < high {
        let middle = low.midpoint(high);
        let is_before = rows.select(once(middle..middle + 1))?.f64s("timestamp")?.first().is_some_and(|t| *t < time_s);
        if is_before { low = middle + 1 } else { high = middle }
    }
    Ok(low)
}

fn add(vertices: &Vertices, [begin_s, end_s]: [f64; 2], points: &mut Vec<MomentPoint>) -> Result<(), PlyError> {
    let axes = |names: [&str; 3]| -> Result<[Vec<f64>; 3], PlyError> {
        let [x, y, z] = names;
        Ok([vertices.f64s(x)?, vertices.f64s(y)?, vertices.f64s(z)?])
    };
    let positions = axes(["x", "y", "z"])?;
    let lidars = axes(["x_lidar_position", "y_lidar_position", "z_lidar_position"])?;
    let (times_s, sweeps, rings) = (vertices.f64s("timestamp")?, vertices.i64s("index_frame")?, vertices.u8s("ring")?);
    let (azimuths, elevations) = (vertices.f32s("azimuth_deg")?, vertices.f32s("elevation_deg")?);
    let at = |axes: &[Vec<f64>; 3], i: usize| Point3::new(axes[0][i], axes[1][i], axes[2][i]);
    let inside = (0..vertices.len()).filter(|i| (begin_s..=end_s).contains(&times_s[*i]));
    points.extend(inside.map(|i| MomentPoint {
        position: at(&positions, i),
        lidar: at(&lidars, i),
        sweep: sweeps[i],
        ring: rings[i],
        azimuth_deg: azimuths[i],
        elevation_deg: elevations[i],
    }));
    Ok(())
}
