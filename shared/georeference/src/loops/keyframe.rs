//! The surroundings of a submap, used to recognize its place later.

use geometry::{Point3, Pose, Vector3};
use registration::{MapPoint, thinned};
use serde::{Deserialize, Serialize};

/// Surfaces farther away are skipped, m.
pub const REACH_M: f64 = 40.0;
/// One point per cube of this side, m: the search radius of a match.
const SPACING_M: f64 = 0.5;
/// Largest number of points; about 9 bytes each in a saved state.
const MAX_POINTS: usize = 8_000;
/// Unit of stored coordinates, m: a quarter of the noise of a LiDAR.
const UNIT_M: f64 = 0.005;

/// The surfaces around the end of a submap, in its frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Keyframe {
    /// Number of the submap.
    pub submap: usize,
    /// Path length since the start of the drive, m.
    pub path_m: f64,
    /// Position of the vehicle from its odometry, m.
    pub p_in_odom: Point3<f64>,
    /// Pose of the vehicle in the submap.
    pub submap_from_body: Pose,
    surfaces: Vec<Packed>,
}

/// A point in units of [`UNIT_M`] and its normal in units of 1/127.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Packed([i16; 3], [i8; 3]);

/// A point of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// Position, m.
    pub position: Point3<f64>,
    /// Unit normal.
    pub normal: Vector3<f64>,
}

impl Keyframe {
    /// Creates a keyframe from the map of the odometry at the vehicle pose `odom_from_body`.
    pub fn new(submap: usize, path_m: f64, map: &[MapPoint], odom_from_submap: &Pose, odom_from_body: &Pose) -> Self {
        let center = odom_from_body.translation.vector;
        let is_near = |p: &&MapPoint| (Vector3::from(p.position) - center).norm_squared() < REACH_M * REACH_M;
        let near: Vec<&MapPoint> = map.iter().filter(is_near).collect();
        let submap_from_odom = odom_from_submap.inverse();
        let position = |p: &&MapPoint| submap_from_odom * Point3::from(p.position);
        let firsts = thinned(near.iter().map(|p| position(p).coords.cast::<f32>().into()), SPACING_M);
        let step = firsts.len().div_ceil(MAX_POINTS).max(1);
        let pack = |index: usize| {
            let at = position(&near[index]).coords / UNIT_M;
            let normal = submap_from_odom.rotation * Vector3::from(near[index].normal).cast::<f64>() * 127.0;
            // The range of 163 m suffices; a submap is some tens of metres long.
            Packed(at.map(|v| v.round() as i16).into(), normal.map(|v| v.round() as i8).into())
        };
        Self {
            submap,
            path_m,
            p_in_odom: Point3::from(center),
            submap_from_body: submap_from_odom * odom_from_body,
            surfaces: firsts.into_iter().step_by(step).map(pack).collect(),
        }
    }
    /// Surface points in the frame of the submap, m.
    pub fn surfaces(&self) -> impl Iterator<Item = SurfacePoint> {
        self.surfaces.iter().map(|Packed(at, normal)| SurfacePoint {
            position: Point3::from(at.map(|v| f64::from(v) * UNIT_M)),
            normal: Vector3::from(normal.map(f64::from)).normalize(),
        })
    }
    /// Number of points.
    pub fn len(&self) -> usize {
        self.surfaces.len()
    }
    /// Whether there is no point.
    pub fn is_empty(&self) -> bool {
        self.surfaces.is_empty()
    }
}
