//! Sky visibility (ambient occlusion) of the surfaces in an image.
//!
//! The visible share of the sky varies smoothly along a surface. It is therefore sampled on a coarse image grid, 16 rays
//! per grid point, and interpolated to the pixels from grid points on the same surface.

use super::exposure::{Exposure, MIDDLE};
use super::lens::FAR_M;
use random::{hash, unit};
use rayon::prelude::*;
use raytrace::{Ray, Vec3};
use town::{Scene, SceneHit, Snapshot};

/// Occluders beyond this distance are ignored, m.
const REACH_M: f32 = 40.0;
/// Square root of the number of rays per grid point.
const GRID_SIDE: u32 = 4;
/// Square root of the number of rays for pixels without a usable grid point.
const ALONE_SIDE: u32 = 2;

/// The coarse grid of one image.
#[derive(Debug)]
pub struct SkyView {
    columns: usize,
    rows: usize,
    /// Pixels per grid cell.
    step: f32,
    places: Vec<Option<Place>>,
}

#[derive(Clone, Copy, Debug)]
struct Place {
    point: Vec3,
    normal: Vec3,
    range_m: f32,
    open: f32,
}

impl SkyView {
    /// A grid for an image of `width` x `height` px with rays `direction(u, v)`: one point every `step` px.
    pub fn new(
        exposure: &Exposure<'_>,
        [width, height]: [usize; 2],
        step: usize,
        direction: impl Fn(usize, usize) -> Option<Vec3> + Sync,
    ) -> Self {
        let columns = width.div_ceil(step) + 1;
        let rows = height.div_ceil(step) + 1;
        let snapshot = exposure.snapshot(MIDDLE);
        let place = |i: usize| {
            let u = (i % columns * step).min(width - 1);
            let v = (i / columns * step).min(height - 1);
            // The seed differs from the seeds of the pixels, so that rays end at different places in leaves.
            let ray = exposure.ray(MIDDLE, &direction(u, v)?, i as u64 ^ 0x51c7_0000_0000);
            let hit = exposure.scene.cast(snapshot, &ray, FAR_M)?;
            let point = ray.at(hit.range_m);
            let open = open_share(exposure.scene, snapshot, &ray, &hit, GRID_SIDE);
            Some(Place { point, normal: hit.normal, range_m: hit.range_m, open })
        };
        let places = (0..columns * rows).into_par_iter().map(place).collect();
        Self { columns, rows, step: step as f32, places }
    }

    /// Share of the sky visible from a hit at pixel `[u, v]`, 0 to 1, weighted by the cosine.
    pub fn open(&self, exposure: &Exposure<'_>, instant: usize, ray: &Ray, hit: &SceneHit, [u, v]: [f32; 2]) -> f32 {
        let x = u / self.step;
        let y = v / self.step;
        let column = (x as usize).min(self.columns - 2);
        let row = (y as usize).min(self.rows - 2);
        let fx = x - column as f32;
        let fy = y - row as f32;
        let point = ray.at(hit.range_m);
        let mut sum = 0.0;
        let mut weights = 0.0;
        for (dx, dy, near) in
            [(0, 0, (1.0 - fx) * (1.0 - fy)), (1, 0, fx * (1.0 - fy)), (0, 1, (1.0 - fx) * fy), (1, 1, fx * fy)]
        {
            let Some(place) = self.places[(row + dy) * self.columns + column + dx] else { continue };
            // Uneven facades deviate by some cm and degrees from their plane.
            let off = (point - place.point).dot(&place.normal).abs();
            let same = place.normal.dot(&hit.normal) > 0.8 && off < 0.04 + 0.01 * place.range_m;
            if same {
                let weight = near + 0.01;
                sum += weight * place.open;
                weights += weight;
            }
        }
        if weights > 0.2 {
            return sum / weights;
        }
        open_share(exposure.scene, exposure.snapshot(instant), ray, hit, ALONE_SIDE)
    }
}

/// The visible share from `side` times `side` rays, stratified over the hemisphere around the normal.
fn open_share(scene: &Scene, snapshot: &Snapshot, ray: &Ray, hit: &SceneHit, side: u32) -> f32 {
    let origin = ray.at(hit.range_m) + hit.normal * 0.01;
    let across = if hit.normal.z.abs() < 0.9 { Vec3::z() } else { Vec3::x() }.cross(&hit.normal).normalize();
    let along = hit.normal.cross(&across);
    let mut open = 0.0;
    for i in 0..side * side {
        let seed = hash(ray.seed, 0xa0 + u64::from(i));
        let radius2 = ((i / side) as f32 + unit(seed)) / side as f32;
        let angle = std::f32::consts::TAU * ((i % side) as f32 + unit(seed << 24)) / side as f32;
        let radius = radius2.sqrt();
        let direction =
            across * (radius * angle.cos()) + along * (radius * angle.sin()) + hit.normal * (1.0 - radius2).sqrt();
        // Directions below the horizon do not show the sky.
        if direction.z <= 0.0 {
            continue;
        }
        let up = Ray { origin, direction, seed };
        open += f32::from(u8::from(!scene.is_blocked(snapshot, &up, REACH_M)));
    }
    open / (side * side) as f32
}
