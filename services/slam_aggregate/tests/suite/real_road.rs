//! A real road through the reader of drives and the stage, as in a run: the figures of lab/peers/README.md.

use drive::Drive;
use geometry::{Pose, Vector3};
use messages::{SweepHeader, SweepPoint, SweepTopic, TrajectoryTopic};
use nalgebra::Matrix3;
use slam_aggregate::{Settings, SlamAggregate};
use stage::Received;
use stage::testing::Bench;
use std::ops::Range;
use std::path::Path;

/// Height of the LiDAR above the road, m.
const HEIGHT_M: f64 = 1.73;

/// Writes sweeps that are stored as range images of 64 x 870 px, 1/500 m per step, as clouds of KITTI: ring by ring,
/// without rings and point times.
fn write_clouds(numbers: Range<usize>, to: &Path) {
    let folder = real_data::path("annieway");
    let settings = std::fs::read_to_string(folder.join("range_image.cfg")).unwrap();
    let values = settings.lines().find(|line| !line.starts_with('#')).unwrap();
    let values: Vec<f64> = values.split_whitespace().map(|value| value.parse().unwrap()).collect();
    let mut files: Vec<_> =
        std::fs::read_dir(folder.join("muehlburger")).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.retain(|path| path.extension().is_some_and(|extension| extension == "png"));
    files.sort();
    for number in numbers {
        let image = image::open(&files[number]).unwrap().into_luma16();
        let mut bytes = Vec::new();
        for row in 0..image.height() {
            let elevation = -values[5 + row as usize].to_radians();
            for col in 0..image.width() {
                let range = f64::from(image.get_pixel(col, row).0[0]) / values[0];
                if range > 1.5 && range < 120.0 {
                    let azimuth = (180.0 - 360.0 * (f64::from(col) + 0.5) / f64::from(image.width())).to_radians();
                    let x = range * elevation.cos() * azimuth.cos();
                    let y = range * elevation.cos() * azimuth.sin();
                    let numbers = [x, y, range * elevation.sin(), 0.3];
                    bytes.extend(numbers.iter().flat_map(|number| (*number as f32).to_le_bytes()));
                }
            }
        }
        std::fs::write(to.join(format!("{number:06}.bin")), bytes).unwrap();
    }
}

/// The poses of a drive by the stage with its default settings, and the points of its first and last sweep.
struct Followed {
    poses: Vec<Pose>,
    first: Vec<SweepPoint>,
    last: Vec<SweepPoint>,
}

fn follow(folder: &Path) -> Followed {
    let drive = Drive::open(folder).unwrap();
    let mut bench = Bench::with_stage(SlamAggregate::with_mounting(&Settings::default(), drive.rig().body_from_lidar));
    let mut sweeps = drive.sweeps().unwrap();
    let mut first = Vec::new();
    let mut last = Vec::new();
    let mut rows = Vec::new();
    while let Some(sweep) = sweeps.next_sweep(|piece| rows.extend_from_slice(piece)).unwrap() {
        let header = SweepHeader {
            duration_nanos: sweep.duration_nanos,
            lost_packets: 0,
            n_rings: drive.lidar().n_rings() as u32,
            has_times: u32::from(sweep.has_times),
            lidar: 0,
        };
        last = std::mem::take(&mut rows);
        if first.is_empty() {
            first.clone_from(&last);
        }
        bench.send::<SweepTopic>(sweep.stamp.0, header, last.clone());
        bench.tick().unwrap();
    }
    bench.finish().unwrap();
    let rows = bench.take::<TrajectoryTopic>();
    let poses = rows.iter().flat_map(Received::rows).map(|row| row.odom_from_body.to_pose().unwrap());
    Followed { poses: poses.collect(), first, last }
}

/// Normal of the road around an upright LiDAR, in its frame: planes by least squares, each time without the points off it.
fn road_normal(points: &[SweepPoint]) -> Vector3<f64> {
    let position = |point: &SweepPoint| Vector3::new(point.x, point.y, point.z).cast::<f64>();
    let is_near = |p: &Vector3<f64>| (3.0..20.0).contains(&p.x.hypot(p.y)) && (p.z + HEIGHT_M).abs() < 0.6;
    let mut near: Vec<Vector3<f64>> = points.iter().map(position).filter(is_near).collect();
    let mut normal = Vector3::z();
    for gate_m in [0.3, 0.15, 0.08, 0.08, 0.08] {
        let center = near.iter().sum::<Vector3<f64>>() / near.len() as f64;
        let scatter: Matrix3<f64> = near.iter().map(|p| (p - center) * (p - center).transpose()).sum();
        let eigen = scatter.symmetric_eigen();
        normal = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned();
        normal *= normal.z.signum();
        near.retain(|p| (p - center).dot(&normal).abs() < gate_m);
    }
    normal
}

/// The end of a drive against the plane of the road at its start.
struct End {
    height_m: f64,
    sideways_m: f64,
    /// Inclination of the last road along the direction of travel.
    pitch_deg: f64,
}

fn end_on_flat_road(Followed { poses, first, last }: &Followed) -> End {
    let normal = road_normal(first);
    let x = (Vector3::x() - normal * normal.x).normalize();
    let level_from_first = Matrix3::from_columns(&[x, normal.cross(&x), normal]).transpose();
    let first_from_last = poses[0].inverse() * poses[poses.len() - 1];
    let place = level_from_first * first_from_last.translation.vector;
    let rotation = level_from_first * first_from_last.rotation.to_rotation_matrix().matrix();
    let heading = Vector3::new(rotation[(0, 0)], rotation[(1, 0)], 0.0).normalize();
    let road = rotation * road_normal(last);
    End { height_m: place.z, sideways_m: place.y, pitch_deg: (-road.dot(&heading)).asin().to_degrees() }
}

/// With the nearest beams of the model as rings, the height is -2.45 m and the pitch -1.66 degrees.
#[real_data::test("annieway/range_image.cfg", "annieway/muehlburger")]
fn flat_road_without_a_ring_column_stays_flat() {
    let folder = tempfile::tempdir().unwrap();
    write_clouds(0..341, folder.path());
    let End { height_m, sideways_m, pitch_deg } = end_on_flat_road(&follow(folder.path()));
    println!("height {height_m:.2} m, pitch {pitch_deg:.2} degrees, sideways {sideways_m:.2} m");
    assert!((height_m + 1.44).abs() < 0.2 && (pitch_deg + 0.88).abs() < 0.2, "{height_m} m, {pitch_deg} degrees");
    assert!((sideways_m - 1.38).abs() < 0.3, "{sideways_m} m");
}
