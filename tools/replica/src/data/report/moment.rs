//! The points of a moment of the drive, read from the clouds of the run.

use super::finished_run::FinishedRun;
use delivery::{CloudEntry, GEOREFERENCE};
use formats::ply::{PlyError, PlyRows, Vertices};
use geometry::{Point3, Stamp};
use std::iter::once;
use surveying::crs::CrsError;
use surveying::{Georeference, TargetFrame};

/// Points of several LiDARs are stored sweep by sweep: they are out of time order by less than this, s.
const DISORDER_S: f64 = 0.2;
/// Largest number of points of a moment: several LiDARs give less than three million a second.
const MAX_ROWS: usize = 1 << 21;

/// A point of the moment.
pub struct MomentPoint {
    /// Position in the frame of the path, m.
    pub position: Point3<f64>,
    pub lidar: Point3<f64>,
    pub sweep: i64,
    pub ring: u8,
    pub azimuth_deg: f32,
    pub elevation_deg: f32,
}

/// The stamp of the middle of the path: the vehicle moves there, so delays of cameras are visible.
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

/// The points within `half_s` around a stamp, in the frame of the path. Empty if no cloud covers it.
pub fn points_around(run: &FinishedRun, stamp: Stamp, half_s: f64) -> anyhow::Result<Vec<MomentPoint>> {
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
    if !run.has_local_clouds() {
        to_local(run, &mut points)?;
    }
    Ok(points)
}

/// Transforms points from UTM to the local frame.
fn to_local(run: &FinishedRun, points: &mut [MomentPoint]) -> anyhow::Result<()> {
    let georeference = Georeference::load(&run.folder.join(GEOREFERENCE))?;
    let frame = TargetFrame::local(Some(&georeference));
    let mut converter = frame.converter();
    let mut convert = |p: Point3<f64>| Ok::<_, CrsError>(Point3::from(converter.convert(p.coords.into())?));
    for point in points {
        point.position = convert(point.position)?;
        point.lidar = convert(point.lidar)?;
    }
    Ok(())
}

/// The first row that is not before `time_s`, within the disorder.
fn partition(rows: &PlyRows, time_s: f64) -> Result<usize, PlyError> {
    let mut low = 0;
    let mut high = rows.len();
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
    let times_s = vertices.f64s("timestamp")?;
    let sweeps = vertices.i64s("index_frame")?;
    let rings = vertices.u8s("ring")?;
    let azimuths = vertices.f32s("azimuth_deg")?;
    let elevations = vertices.f32s("elevation_deg")?;
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

#[cfg(test)]
mod tests {
    use super::*;
    use formats::ply::{Header, Kind, PlyWriter};
    use geometry::{Geodetic, LocalFrame, Utm};
    use run::summary::Summary;
    use serde_json::json;

    const COLUMNS: [(&str, Kind); 11] = [
        ("x", Kind::Double),
        ("y", Kind::Double),
        ("z", Kind::Double),
        ("x_lidar_position", Kind::Double),
        ("y_lidar_position", Kind::Double),
        ("z_lidar_position", Kind::Double),
        ("timestamp", Kind::Double),
        ("index_frame", Kind::Int),
        ("ring", Kind::UChar),
        ("azimuth_deg", Kind::Float),
        ("elevation_deg", Kind::Float),
    ];

    #[test]
    fn points_of_clouds_in_utm_are_in_the_frame_of_the_path() {
        let folder = tempfile::tempdir().expect("a folder");
        let origin = Geodetic::new(48.8, 2.3, 50.0).expect("valid");
        let local = LocalFrame::new(origin);
        let utm = Utm::from_geodetic(&origin).expect("has a zone");
        let expected = [Point3::new(300.0, -400.0, 5.0), Point3::new(290.0, -390.0, 2.0)];
        let [point, lidar] = expected.map(|p| utm.project(&local.geodetic_from_world(&p)).expect("projects"));
        let path = folder.path().join("a.ply");
        let mut writer = PlyWriter::create(&path, &Header::new(COLUMNS), 1).expect("creates");
        let encode = |_: usize, row: &mut formats::ply::Row<'_>| {
            for value in point.into_iter().chain(lidar).chain([100.0]) {
                row.f64(value);
            }
            row.i32(7).u8(3).f32(0.0).f32(0.0);
        };
        writer.write_amended(1, encode, |_, _| Ok(())).expect("writes");
        writer.finish_unsynced().expect("finishes");
        let georeference = json!({
            "frame": "utm", "trajectory_frame": "local", "origin": origin, "standard_deviations": null,
            "utm": { "epsg": utm.epsg(), "convergence_deg": -0.5 },
        });
        std::fs::write(folder.path().join(GEOREFERENCE), georeference.to_string()).expect("writes");
        let cloud = json!({
            "seq": 0, "file": "a.ply", "bytes": 0, "n_points": 1, "stamp_begin": 99_000_000_000_i64,
            "stamp_end": 101_000_000_000_i64, "translation": [0, 0, 0], "rotation": [0, 0, 0, 1], "lost": [],
        });
        let run = FinishedRun {
            folder: folder.path().to_owned(),
            summary: Summary::default(),
            index: serde_json::from_value(json!({"version": 2, "frame": "utm", "n_points": 1, "clouds": [cloud]})).ok(),
            georeference: serde_json::from_value(georeference).ok(),
            trajectory: geometry::Trajectory::default(),
            begun: None,
        };
        assert!(run.index.is_some() && run.georeference.is_some());
        let found = points_around(&run, Stamp(100_000_000_000), 0.05).expect("reads");
        assert_eq!(found.len(), 1);
        for (found, expected) in [found[0].position, found[0].lidar].iter().zip(expected) {
            assert!((found - expected).norm() < 1e-3, "{found} {expected}");
        }
    }
}
