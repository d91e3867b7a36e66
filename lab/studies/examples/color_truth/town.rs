//! Truth of the points of a submap from the simulator: position, material, visibility.

use coloring::CHUNK;
use geometry::{CameraModel, Pose, Stamp, Trajectory};
use messages::{ClassId, POINT_DYNAMIC, SubmapHeader, SubmapPoint};
use nalgebra::{Point3, Vector3};
use random::hash;
use rayon::prelude::*;
use raytrace::Ray;
use simulation::Simulation;
use std::collections::BTreeMap;
use town::{Material, Snapshot};

/// Largest distance of a point from the surface that its beam hits, m. Farther points are mixed returns.
const MAX_DISTANCE_M: f64 = 0.3;
/// Beams that are tried to find the surface of a point: leaves are hit by chance. One in a hundred points in foliage that lets half
/// of the light through stays without a surface.
const MAX_BEAMS: u64 = 64;
/// Time between snapshots of the town, s: a car at 10 m/s moves 2 cm.
const SNAPSHOT_S: f64 = 0.002;

/// A town and the estimated trajectory through it.
pub struct Town<'a> {
    pub simulation: &'a Simulation,
    pub trajectory: &'a Trajectory,
}

/// The truth about a point.
#[derive(Clone, Copy)]
pub struct TruePoint {
    /// Position in the world frame, m.
    pub p: Point3<f64>,
    pub range_m: f64,
    pub stamp: i64,
    /// Material of the surface that the beam hit; `None` for mixed returns.
    pub material: Option<Material>,
    /// Its class; `None` for mixed returns.
    pub class: Option<ClassId>,
    /// Whether there is such a surface and it is not foliage.
    pub is_solid: bool,
    /// Whether it is on an object that moves within a second.
    pub moves: bool,
}

/// The truth about an exposure.
pub struct TrueExposure {
    pub stamp: i64,
    pub snapshot: Snapshot,
    pub eye: Point3<f64>,
    pub camera_from_world: Pose,
    pub model: CameraModel,
}

impl TrueExposure {
    /// Pixel of a point.
    pub fn pixel(&self, p: &Point3<f64>) -> Option<[f32; 2]> {
        self.model.pixel_from_camera(&(self.camera_from_world * p)).map(|pixel| [pixel.x as f32, pixel.y as f32])
    }
}

impl Town<'_> {
    fn seconds(&self, stamp: i64) -> f64 {
        Stamp(stamp).seconds_since(self.simulation.motion.begin)
    }

    /// The exposure of a camera at a stamp.
    pub fn exposure(&self, stamp: i64, body_from_camera: &Pose, model: &CameraModel) -> TrueExposure {
        let seconds = self.seconds(stamp);
        let world_from_camera = self.simulation.motion.pose(seconds) * body_from_camera;
        TrueExposure {
            stamp,
            snapshot: self.simulation.scene.at(seconds),
            eye: Point3::from(world_from_camera.translation.vector),
            camera_from_world: world_from_camera.inverse(),
            model: model.clone(),
        }
    }

    /// The points moved by the error of the estimated pose; they keep the noise of the LiDAR. `None` for points without a pose.
    pub fn points(
        &self,
        header: &SubmapHeader,
        odom_from_submap: &Pose,
        points: &[SubmapPoint],
    ) -> Vec<Option<TruePoint>> {
        let of_chunk = |points: &[SubmapPoint]| {
            let mut snapshots = BTreeMap::new();
            let of = |point: &SubmapPoint| self.point(header, odom_from_submap, point, &mut snapshots);
            points.iter().map(of).collect::<Vec<_>>()
        };
        points.par_chunks(CHUNK).flat_map_iter(of_chunk).collect()
    }

    fn point(
        &self,
        header: &SubmapHeader,
        odom_from_submap: &Pose,
        point: &SubmapPoint,
        snapshots: &mut BTreeMap<i64, [Snapshot; 2]>,
    ) -> Option<TruePoint> {
        let stamp = header.sweeps.get(usize::from(point.sweep_idx))?.stamp + i64::from(point.offset_nanos);
        let estimated = self.trajectory.at(Stamp(stamp))?;
        let seconds = self.seconds(stamp);
        let world_from_body = self.simulation.motion.pose(seconds);
        let p_in_submap = Point3::new(point.x, point.y, point.z).cast::<f64>();
        let p = world_from_body * estimated.inverse() * odom_from_submap * p_in_submap;
        let origin = (world_from_body * self.simulation.rig.lidar.body_from_lidar).translation.vector;
        let range_m = (p.coords - origin).norm();
        let direction = ((p.coords - origin) / range_m).cast();
        let origin = origin.cast();
        let scene = &self.simulation.scene;
        let key = (seconds / SNAPSHOT_S).round() as i64;
        let [now, later] = snapshots.entry(key).or_insert_with(|| {
            let seconds = key as f64 * SNAPSHOT_S;
            [seconds, seconds + 1.0].map(|seconds| scene.at(seconds))
        });
        let far_m = range_m as f32 + 1.0;
        let found = (0..MAX_BEAMS).find_map(|seed| {
            let ray = Ray { origin, direction, seed };
            let hit = scene.cast(now, &ray, far_m)?;
            ((f64::from(hit.range_m) - range_m).abs() < MAX_DISTANCE_M).then_some((ray, hit))
        });
        let moves = found.as_ref().is_some_and(|(ray, hit)| {
            let again = scene.cast(later, ray, far_m).map(|hit| hit.range_m);
            hit.surface.instance > 0 && again.is_none_or(|m| (m - hit.range_m).abs() > 0.2)
        });
        let hit = found.map(|(_, hit)| hit);
        let class = hit.as_ref().map(|hit| hit.surface.class);
        let is_solid = class.is_some_and(|class| class != ClassId::Vegetation);
        Some(TruePoint { p, range_m, stamp, material: hit.map(|hit| hit.surface.material), class, is_solid, moves })
    }

    /// Class of the object that occludes `p` from the camera, with the tolerances of `truth/visibility`. Leaves are hit by
    /// chance, each time anew: a hit beyond the point means that it is visible.
    pub fn occluder(&self, exposure: &TrueExposure, p: &Point3<f64>) -> Option<ClassId> {
        let toward: Vector3<f64> = p - exposure.eye;
        let distance = toward.norm();
        let direction = (toward / distance).cast::<f32>();
        let seed = hash(exposure.stamp as u64, p.x.to_bits());
        let ray = Ray { origin: exposure.eye.coords.cast(), direction, seed };
        let hit = self.simulation.scene.cast(&exposure.snapshot, &ray, distance as f32)?;
        let gap = distance - f64::from(hit.range_m);
        let across = gap * f64::from(hit.normal.dot(&direction).abs());
        let is_there = gap < 0.1 || (gap < 0.5 && (hit.surface.class == ClassId::Vegetation || across < 0.06));
        (!is_there).then_some(hit.surface.class)
    }
}

/// The points with their true flags.
pub fn with_true_flags(points: &[SubmapPoint], truth: &[Option<TruePoint>]) -> Vec<SubmapPoint> {
    let flag = |(point, truth): (&SubmapPoint, &Option<TruePoint>)| {
        let moves = truth.is_some_and(|truth| truth.moves);
        SubmapPoint { flags: if moves { POINT_DYNAMIC } else { 0 }, ..*point }
    };
    points.iter().zip(truth).map(flag).collect()
}
