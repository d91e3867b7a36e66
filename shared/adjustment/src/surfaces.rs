//! The surfaces and columns of a submap, from its points.

use crate::error::SurveyError;
use delivery::CloudEntry;
use geometry::{Point3, Pose, Vector3};
use georeference::Keyframe;
use messages::ClassId;
use nalgebra::{Matrix3, Point2, SymmetricEigen};
use registration::MapPoint;
use std::collections::HashMap;
use surveying::{CloudPoint, RunFolder};

/// Side of the cubes whose points are averaged, m.
const CUBE_M: f64 = 0.5;
/// Fewer points of a cube determine no plane.
const MIN_POINTS: f64 = 12.0;
/// Largest standard deviation of the points of a cube from their plane, m: the noise of a LiDAR and of its deskewing.
const MAX_ROUGHNESS_M: f64 = 0.04;
/// Largest ratio of the deviation across the plane to the smaller one within: edges and wires have no normal.
const MAX_THICKNESS: f64 = 0.35;

/// Things that reach through this band above the vehicle's body frame are columns, m: walls, posts, trunks. Vehicles and people end
/// below it.
const BAND_M: [f64; 2] = [1.5, 5.5];
/// Side of a column, m, and its least height within the band.
const COLUMN_M: f64 = 0.5;
const MIN_HEIGHT_M: f64 = 1.5;

/// What stays of the points of a submap.
pub struct Shape {
    /// Its surfaces.
    pub keyframe: Keyframe,
    /// Horizontal positions of its columns, in the submap, m.
    pub columns: Vec<Point2<f64>>,
}

/// Classes of things that stand elsewhere in the next drive.
const MOBILE: [ClassId; 3] = [ClassId::Pedestrian, ClassId::Vehicles, ClassId::Dynamic];

/// Sums over the points of a cube, relative to its center.
#[derive(Clone, Copy, Debug, Default)]
struct CubeSums {
    n: f64,
    sum: Vector3<f64>,
    products: Matrix3<f64>,
    to_lidar: Vector3<f64>,
}

/// Reads the points of a submap. Its number is `number`, the position of its keyframe is the middle of its path in the survey frame.
/// Points on moving objects are left out, vehicles and people also where they stand: they are somewhere else in the next drive.
pub fn shape(
    run: &RunFolder,
    entry: &CloudEntry,
    survey_from_run: &Pose,
    number: usize,
) -> Result<Option<Shape>, SurveyError> {
    let middle = geometry::Stamp(entry.stamp_begin.midpoint(entry.stamp_end));
    let Some(run_from_body) = run.trajectory.at(middle) else { return Ok(None) };
    let band = BAND_M.map(|height| run_from_body.translation.z + height);
    let mut cubes: HashMap<[i32; 3], CubeSums> = HashMap::new();
    let mut columns: HashMap<[i32; 2], ColumnExtent> = HashMap::new();
    run.each_point(entry, |point| {
        if !stays(point) || point.xyz.iter().any(|value| !value.is_finite()) {
            return;
        }
        add(&mut cubes, point);
        let [x, y, z] = point.xyz;
        if band[0] < z && z < band[1] {
            let extent = columns.entry([x, y].map(|value| (value / COLUMN_M).floor() as i32)).or_default();
            extent.low = extent.low.min(z);
            extent.high = extent.high.max(z);
        }
    })?;
    let mut cubes: Vec<([i32; 3], CubeSums)> = cubes.into_iter().collect();
    cubes.sort_unstable_by_key(|(cube, _)| *cube);
    let points: Vec<MapPoint> = cubes.iter().filter_map(|(cube, sums)| sums.surface(*cube, survey_from_run)).collect();
    let survey_from_submap = survey_from_run * entry.pose();
    let keyframe = Keyframe::new(number, 0.0, &points, &survey_from_submap, &(survey_from_run * run_from_body));
    let mut columns: Vec<[i32; 2]> = columns
        .into_iter()
        .filter(|(_, extent)| extent.high - extent.low > MIN_HEIGHT_M)
        .map(|(cell, _)| cell)
        .collect();
    columns.sort_unstable();
    let submap_from_run = entry.pose().inverse();
    let position = |cell: &[i32; 2]| {
        let [x, y] = cell.map(|index| (f64::from(index) + 0.5) * COLUMN_M);
        (submap_from_run * Point3::new(x, y, run_from_body.translation.z)).xy()
    };
    Ok(Some(Shape { keyframe, columns: columns.iter().map(position).collect() }))
}

/// Lowest and highest point of a column within the band, m.
struct ColumnExtent {
    low: f64,
    high: f64,
}

impl Default for ColumnExtent {
    fn default() -> Self {
        Self { low: f64::INFINITY, high: f64::NEG_INFINITY }
    }
}

/// Whether a point is on something that stays where it is from drive to drive.
fn stays(point: &CloudPoint) -> bool {
    !point.is_moving && !MOBILE.iter().any(|class| point.class == *class as u8)
}

fn add(cubes: &mut HashMap<[i32; 3], CubeSums>, point: &CloudPoint) {
    let cube = point.xyz.map(|value| (value / CUBE_M).floor() as i32);
    let p = Vector3::from(point.xyz) - center(cube);
    let sums = cubes.entry(cube).or_default();
    sums.n += 1.0;
    sums.sum += p;
    sums.products += p * p.transpose();
    sums.to_lidar += Vector3::from(point.lidar_xyz) - Vector3::from(point.xyz);
}

fn center(cube: [i32; 3]) -> Vector3<f64> {
    Vector3::from(cube.map(|index| (f64::from(index) + 0.5) * CUBE_M))
}

impl CubeSums {
    /// The surface in the cube, with its normal towards the LiDAR.
    fn surface(&self, cube: [i32; 3], survey_from_run: &Pose) -> Option<MapPoint> {
        if self.n < MIN_POINTS {
            return None;
        }
        let mean = self.sum / self.n;
        let eigen = SymmetricEigen::new(self.products / self.n - mean * mean.transpose());
        let mut order = [0, 1, 2];
        order.sort_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]));
        let [across, within] = [order[0], order[1]].map(|axis| eigen.eigenvalues[axis].max(0.0).sqrt());
        if across > MAX_ROUGHNESS_M || across > MAX_THICKNESS * within {
            return None;
        }
        let normal: Vector3<f64> = eigen.eigenvectors.column(order[0]).into();
        let normal = if normal.dot(&self.to_lidar) < 0.0 { -normal } else { normal };
        Some(MapPoint {
            position: (survey_from_run * Point3::from(center(cube) + mean)).coords.into(),
            normal: (survey_from_run.rotation * normal).cast::<f32>().into(),
            lever: 0.0,
            turn_lever: 0.0,
            batch: 0,
        })
    }
}
