//! Illumination of a surface by the sun, the sky and the surrounding town, and the radiance of the sky.

use raytrace::{Ray, Vec3};
use town::noise::value_noise;
use town::{Scene, SceneHit, Snapshot};

/// Direction of the sun: elevation 48 degrees, azimuth of the early afternoon. Facades on the left are lit and shadows
/// fall on the road, so every image contains both.
pub fn sun_direction() -> Vec3 {
    Vec3::new(0.35, -0.57, 0.743).normalize()
}

/// Light by spectrum, relative to a white target that faces the sun under the open sky (1 and 1).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Light {
    /// Light with the spectrum of the sun: direct, from clouds, or reflected by the town.
    pub sun: f32,
    /// Light with the spectrum of the blue sky.
    pub sky: f32,
}

/// Strength of the skylight relative to the direct sun.
pub const SKY_STRENGTH: f32 = 0.35;
/// Light reflected by the town onto a surface without a view of the sky, relative to the full sun: facades and roads
/// reflect a quarter on average, and half of them are in the sun.
const REFLECTED: f32 = 0.12;
/// Objects farther than this cast no shadow, m.
const SHADOW_M: f32 = 60.0;

impl Light {
    /// A share of this light.
    #[must_use]
    pub fn times(self, share: f32) -> Self {
        Self { sun: self.sun * share, sky: self.sky * share }
    }

    /// Light on a surface that receives the share `sun` of the full sun and the share `open` of the skylight, both 0 to 1
    /// and weighted by the cosine.
    pub fn on(sun: f32, open: f32) -> Self {
        Self { sun: REFLECTED * (1.0 - open) + sun, sky: open }
    }

    /// The sky in a direction: blue, with haze at the horizon, clouds, and the sun with its glow. A white surface under the
    /// full light has the brightness 1 and 1.
    pub fn sky(direction: &Vec3) -> Self {
        let up = direction.z.max(0.0);
        let to_sun = direction.dot(&sun_direction()).max(0.0);
        let cloud = clouds(direction);
        let haze = (1.0 - up).powi(4);
        // The disk of the sun and the glow around it from lens and air.
        let glow = 0.4 * to_sun.powi(24) + 3.0 * to_sun.powi(400) + 40.0 * to_sun.powi(20_000);
        let bright = cloud * (0.75 + 0.4 * to_sun.powi(4));
        Self { sun: bright + 0.28 * haze * (1.0 - cloud) + glow, sky: (1.0 - 0.8 * cloud) * (0.75 + 0.35 * haze) }
    }
}

/// A ray and its hit.
#[derive(Clone, Copy, Debug)]
pub struct RayHit {
    /// The ray.
    pub ray: Ray,
    /// Its hit.
    pub hit: SceneHit,
}

/// The share of the full sun that reaches each hit, weighted by the cosine.
pub fn sun_on<'s>(scene: &Scene, hits: &[RayHit], snapshot: impl Fn(usize) -> &'s Snapshot) -> Vec<f32> {
    let sun = sun_direction();
    let mut shares: Vec<f32> = hits.iter().map(|RayHit { hit, .. }| hit.normal.dot(&sun).max(0.0)).collect();
    let facing: Vec<usize> = (0..hits.len()).filter(|i| shares[*i] > 0.0).collect();
    let to_sun = |i: &usize| {
        let RayHit { ray, hit } = &hits[*i];
        let origin = ray.at(hit.range_m) + hit.normal * 0.01;
        Ray { origin, direction: sun, seed: ray.seed ^ 0x5_0115 }
    };
    let rays: Vec<Ray> = facing.iter().map(to_sun).collect();
    let blocked = scene.are_blocked(&rays, SHADOW_M, |k| snapshot(facing[k]));
    for (i, is_blocked) in facing.into_iter().zip(blocked) {
        if is_blocked {
            shares[i] = 0.0;
        }
    }
    shares
}

/// Fair-weather clouds 1.2 km up: 0 is blue sky, 1 is cloud.
fn clouds(direction: &Vec3) -> f32 {
    if direction.z < 0.02 {
        return 0.0;
    }
    let scale = 1.9 / (direction.z + 0.12);
    let x = direction.x * scale;
    let y = direction.y * scale;
    let octave = |i: u32| {
        let f = f32::from(1_u16 << i);
        value_noise(u64::from(i) ^ 0x0c10_0d00, x * f, y * f, 0.3 * f) / f
    };
    let density = (0..5).map(octave).sum::<f32>() - 0.16;
    // Edges of clouds are soft over a tenth of their density.
    let edge = (density / 0.45).clamp(0.0, 1.0);
    edge * edge * (3.0 - 2.0 * edge)
}

/// Specularly reflected share of light on a smooth surface: `normal` at normal incidence, 1 at grazing incidence
/// (Schlick, 1994).
pub fn mirrored(normal: f32, incidence: f32) -> f32 {
    normal + (1.0 - normal) * (1.0 - incidence.clamp(0.0, 1.0)).powi(5)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sky_is_brightest_at_sun_and_paler_at_horizon() {
        let sun = Light::sky(&sun_direction());
        let mut dark = f32::INFINITY;
        for i in 0..2000_u16 {
            let z = f32::from(i) / 2000.0;
            let angle = f32::from(i) * 2.399_963;
            let across = (1.0 - z * z).sqrt();
            let sky = Light::sky(&Vec3::new(across * angle.cos(), across * angle.sin(), z));
            assert!(sky.sun >= 0.0 && sky.sky > 0.0 && sky.sun + sky.sky < sun.sun + sun.sky, "{sky:?}");
            dark = dark.min(sky.sun);
        }
        assert!(sun.sun > 20.0 && dark < 0.05, "{dark}");
        let low = Light::sky(&Vec3::new(0.0, 1.0, 0.01));
        let high = Light::sky(&Vec3::new(0.0, 0.6, 0.8));
        assert!(low.sun / low.sky > 0.2 && low.sky > 0.0 && high.sky > 0.1);
    }
}
