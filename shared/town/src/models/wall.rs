//! Coordinates on a wall, and blocks attached to it.

use super::frame::beam;
use crate::scene_builder::{SceneBuilder, SurfaceId};
use raytrace::Vec3;

/// Maps wall coordinates, a position along it, up, and outward (m), to the world.
pub type WallFrame<'a> = &'a dyn Fn(f32, f32, f32) -> Vec3;

/// Height of a storey of a plain wall, m.
pub const FLOOR_M: f32 = 3.1;
/// Depth of the wall below the street level, m: streets slope down along it.
pub const FOOT_M: f32 = 1.2;

/// The surfaces of a front.
pub struct FacadeSurfaces {
    pub wall: SurfaceId,
    pub base: SurfaceId,
    pub trim: SurfaceId,
    pub frame: SurfaceId,
    pub glass: SurfaceId,
    pub door: SurfaceId,
    pub iron: SurfaceId,
}

/// Evenly spaced values from the first to the second, at most `step` apart.
pub fn cuts_of([from, to]: [f32; 2], step: f32) -> Vec<f32> {
    let n = ((to - from) / step).ceil().max(1.0) as usize;
    (0..=n).map(|i| from + (to - from) * i as f32 / n as f32).collect()
}

/// A straight block on a wall.
pub fn block(b: &mut SceneBuilder, plan: WallFrame<'_>, u: [f32; 2], z: [f32; 2], out: [f32; 2], surface: SurfaceId) {
    let middle = |u: f32| plan(u, 0.5 * (z[0] + z[1]), 0.5 * (out[0] + out[1]));
    b.add(beam(&middle(u[0]), &middle(u[1]), [out[1] - out[0], z[1] - z[0]]), surface);
}

/// A block of any length, cut every 2.5 m so that it follows a curved wall.
pub fn course(b: &mut SceneBuilder, plan: WallFrame<'_>, u: [f32; 2], z: [f32; 2], out: [f32; 2], surface: SurfaceId) {
    for pair in cuts_of(u, 2.5).windows(2) {
        block(b, plan, [pair[0], pair[1]], z, out, surface);
    }
}
