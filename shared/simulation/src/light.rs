//! Sun and sky, and how much of each falls on a surface.

use crate::scene::{Scene, SceneHit, Snapshot};
use crate::trace::{Ray, Vec3};

/// Elevation 48 degrees and azimuth of the early afternoon: it lights the facades on the left and throws shadows onto the
/// road, so that both cases are in every picture.
pub fn sun_direction() -> Vec3 {
    Vec3::new(0.35, -0.57, 0.743).normalize()
}

/// Shares of the full sun and the full sky that light a surface, 0 to 1 each. A white target that faces the sun under the
/// open sky has 1 and 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// Direct.
    pub sun: f32,
    /// Scattered.
    pub sky: f32,
}

/// Strength of the skylight against the direct sun.
pub const SKY_STRENGTH: f32 = 0.35;

/// Brightness of the sky in a direction against its mean: the haze near the horizon and around the sun.
pub fn sky_brightness(direction: &Vec3) -> f32 {
    let around_sun = direction.dot(&sun_direction()).max(0.0).powi(24);
    0.8 + 0.7 * (1.0 - direction.z.max(0.0)).powi(3) + 1.5 * around_sun
}

/// Share of light that a smooth surface mirrors: `normal` at right angles, all at grazing incidence (Schlick, 1994).
pub fn mirrored(normal: f32, incidence: f32) -> f32 {
    normal + (1.0 - normal) * (1.0 - incidence.clamp(0.0, 1.0)).powi(5)
}

/// Brightness of what a mirror shows of sky and town: the sky above, a dim street below.
pub fn mirror_brightness(ray: &Ray, normal: &Vec3) -> f32 {
    let direction = ray.direction - normal * (2.0 * normal.dot(&ray.direction));
    // Houses hide the lowest 20 degrees of the sky.
    if direction.z > 0.35 { sky_brightness(&direction) } else { 0.25 }
}

/// Shadows of things farther than this from the surface are left out.
const SHADOW_M: f32 = 60.0;
/// Skylight that reaches surfaces which face down, from the lit ground.
const BOUNCE: f32 = 0.15;

impl Light {
    /// What falls on a hit.
    pub fn on(scene: &Scene, snapshot: &Snapshot, ray: &Ray, hit: &SceneHit) -> Self {
        let sun = sun_direction();
        let facing = hit.normal.dot(&sun).max(0.0);
        let origin = ray.at(hit.range_m) + hit.normal * 0.01;
        let shaded = facing > 0.0 && {
            let to_sun = Ray { origin, direction: sun, seed: ray.seed ^ 0x5_0115 };
            scene.is_blocked(snapshot, &to_sun, SHADOW_M)
        };
        let open = 0.5 + 0.5 * hit.normal.z;
        Self { sun: if shaded { 0.0 } else { facing }, sky: BOUNCE + (1.0 - BOUNCE) * open }
    }
}
