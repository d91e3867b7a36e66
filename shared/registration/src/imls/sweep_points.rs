//! Points of a sweep that may enter the model: with normal and planarity, without small objects.

use super::model::OrientedPoint;
use crate::moving_objects::small_objects::SmallObjects;
use crate::sweep::neighborhood::{LANES, Planes, Shapes};
use crate::{DeskewTable, Feature, Sweep};
use geometry::{Pose, UnitQuaternion, Vector3};
use nalgebra::Point3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::ops::RangeInclusive;

/// A point with the surface around it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct SweepPoint {
    /// m, LiDAR frame at the time of the shot.
    position: [f32; 3],
    offset_nanos: u32,
    /// Unit normal towards the LiDAR, axes of the LiDAR at the last shot.
    normal: [f32; 3],
    planarity: f32,
}

/// Points of a sweep.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct SweepPoints {
    points: Vec<SweepPoint>,
    duration_nanos: u32,
}

/// The surface around a cell; planarity is -1 if it is unknown.
#[derive(Clone, Copy)]
struct CellShape {
    normal: [f32; 3],
    planarity: f32,
}

impl SweepPoints {
    /// All points with a normal, without small objects. `end_from_begin`: motion of the LiDAR during the sweep,
    /// `level_from_end`: rotation to axes with z up. Points outside `ranges_m` belong to the vehicle or have no
    /// normals.
    pub fn new(
        sweep: &Sweep,
        end_from_begin: &Pose,
        level_from_end: &UnitQuaternion<f64>,
        ranges_m: &RangeInclusive<f32>,
    ) -> Self {
        let table = DeskewTable::new(end_from_begin, &Pose::identity(), sweep.duration_nanos());
        let image = sweep.image().moved(|idx| {
            let point = &sweep.points()[idx];
            table.deskew(point.position, point.offset_nanos)
        });
        let rows = image.rows();
        let cols = image.cols();
        let planes = Planes::new(&image, 1);
        let shapes: Vec<Vec<CellShape>> = (0..rows).into_par_iter().map(|row| row_shapes(&planes, row)).collect();
        let level = level_from_end.cast::<f32>().to_rotation_matrix();
        let cell = |cell: usize| (level * image.position(cell / cols, cell % cols)).into();
        let placed: Vec<[f32; 3]> = (0..rows * cols).into_par_iter().map(cell).collect();
        let of_small_object = SmallObjects::segment(&placed, cols, cols).contained(placed.len());
        let point = |(idx, point): (usize, &crate::TimedPoint)| {
            let (row, col) = sweep.image().cell(idx)?;
            let CellShape { normal, planarity } = shapes[row][col];
            let raw = Vector3::from(point.position);
            if planarity < 0.0 || of_small_object[row * cols + col] || !ranges_m.contains(&raw.norm()) {
                return None;
            }
            let normal = Vector3::from(normal);
            let towards_lidar = if normal.dot(&image.position(row, col)) > 0.0 { -normal } else { normal };
            let position = point.position;
            let offset_nanos = point.offset_nanos;
            Some(SweepPoint { position, offset_nanos, normal: towards_lidar.into(), planarity })
        };
        let points = sweep.points().iter().enumerate().filter_map(point).collect();
        Self { points, duration_nanos: sweep.duration_nanos() }
    }

    /// Whether there is no point.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// The points as features, deskewed to the last shot.
    pub fn features(&self, end_from_begin: &Pose) -> Vec<Feature> {
        let deskewed = self.deskewed(end_from_begin);
        let feature = |(idx, (point, position)): (usize, (&SweepPoint, [f32; 3]))| Feature {
            position,
            normal: point.normal,
            share: 0.5,
            planarity: point.planarity,
            roughness_m: 0.0,
            is_rough: false,
            lever: 0.0,
            row: 0,
            point_idx: idx as u32,
        };
        self.points.iter().zip(deskewed).enumerate().map(feature).collect()
    }

    /// Positions and normals in the odom frame, for the model.
    pub fn placed(&self, odom_from_begin: &Pose, odom_from_end: &Pose) -> Vec<OrientedPoint> {
        let rotation = odom_from_end.rotation.cast::<f32>();
        let place = |(point, position): (&SweepPoint, [f32; 3])| {
            let position = odom_from_end * Point3::from(position).cast::<f64>();
            OrientedPoint { position: position.coords, normal: rotation * Vector3::from(point.normal) }
        };
        let end_from_begin = odom_from_end.inverse() * odom_from_begin;
        self.points.iter().zip(self.deskewed(&end_from_begin)).map(place).collect()
    }

    /// Positions in the LiDAR frame at the last shot, m.
    fn deskewed(&self, end_from_begin: &Pose) -> Vec<[f32; 3]> {
        let table = DeskewTable::new(end_from_begin, &Pose::identity(), self.duration_nanos);
        self.points.iter().map(|point| table.deskew(point.position, point.offset_nanos)).collect()
    }
}

/// Shapes around all cells of a row.
fn row_shapes(planes: &Planes, row: usize) -> Vec<CellShape> {
    wide_loops::run(
        #[inline(always)]
        || {
            let mut found = Vec::with_capacity(planes.n());
            for first in (0..planes.n()).step_by(LANES) {
                let Shapes { normal: [x, y, z], planarity, .. } = Shapes::around(planes, row, first);
                let lanes = 0..LANES.min(planes.n() - first);
                let shape = |lane: usize| CellShape { normal: [x[lane], y[lane], z[lane]], planarity: planarity[lane] };
                found.extend(lanes.map(shape));
            }
            found
        },
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::TimedPoint;
    use geometry::Stamp;

    /// A floor 2 m below, a wall 25 m ahead, and a box of 2 m on the floor.
    fn street() -> Sweep {
        let mut points = Vec::new();
        for column in 0..2000_u32 {
            for ring in 0..32_u8 {
                let azimuth = column as f32 * std::f32::consts::TAU / 2000.0;
                let elevation = (-30.67 + f32::from(ring) * 1.333_f32).to_radians();
                let ray =
                    Vector3::new(azimuth.cos() * elevation.cos(), azimuth.sin() * elevation.cos(), elevation.sin());
                let floor = if ray.z < 0.0 { -2.0 / ray.z } else { f32::MAX };
                let wall = if ray.x > 0.0 { 25.0 / ray.x } else { f32::MAX };
                let on_box = if ray.x > 0.0 { 8.0 / ray.x } else { f32::MAX };
                let side = ray.y * on_box;
                let up = ray.z * on_box;
                let hits_box = side.abs() < 1.0 && (-1.95..-0.2).contains(&up);
                let range = if hits_box { on_box } else { floor.min(wall) };
                if range < 80.0 {
                    points.push(TimedPoint { position: (ray * range).into(), offset_nanos: 0, ring });
                }
            }
        }
        Sweep::new(Stamp(0), points, 32)
    }

    #[test]
    fn small_objects_are_removed_and_ground_and_walls_stay() {
        let sweep = street();
        let still = Pose::identity();
        let level = UnitQuaternion::identity();
        let found = SweepPoints::new(&sweep, &still, &level, &(1.0..=100.0));
        let of = |is: fn(&[f32; 3]) -> bool, points: &mut dyn Iterator<Item = [f32; 3]>| points.filter(is).count();
        let all = || sweep.points().iter().map(|point| point.position);
        let kept = || found.points.iter().map(|point| point.position);
        let share = |is: fn(&[f32; 3]) -> bool| of(is, &mut kept()) as f64 / of(is, &mut all()) as f64;
        assert!(of(|p| (p[0] - 8.0).abs() < 1e-3 && p[2] > -1.6, &mut all()) > 200, "the box is in view");
        assert!(share(|p| (p[0] - 8.0).abs() < 1e-3 && p[2] > -1.6) == 0.0, "the box is removed");
        assert!(share(|p| p[2] < -1.99) > 0.95, "the ground stays: {}", share(|p| p[2] < -1.99));
        assert!(share(|p| p[0] > 24.99) > 0.95, "the wall stays: {}", share(|p| p[0] > 24.99));
    }
}
