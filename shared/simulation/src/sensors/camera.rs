//! The color cameras: one ray per pixel, lit by sun and sky, coded as sRGB.
//!
//! An exposure is taken at its middle: at 10 m/s and 2 ms the vehicle moves 2 cm, which no pixel of the facades shows.

use super::{FAR_M, for_tracer, lens_rays};
use crate::light::{Light, SKY_STRENGTH, mirror_brightness, mirrored, sky_brightness};
use crate::material::{Material, Properties};
use crate::random::hash;
use crate::scene::{Scene, Snapshot};
use crate::spectrum::{Band, Spectrum};
use crate::trace::{Ray, Vec3};
use geometry::{CameraModel, Pose};
use rayon::prelude::*;

/// Filters of the red, green and blue pixels.
const FILTERS: [Band; 3] = [
    Band { center_nm: 610.0, sigma_nm: 28.0 },
    Band { center_nm: 540.0, sigma_nm: 28.0 },
    Band { center_nm: 460.0, sigma_nm: 24.0 },
];
/// A white surface in full sun comes out at this linear level before the tone curve.
const EXPOSURE: f32 = 1.1;

/// A color camera and how it sees materials.
#[derive(Debug)]
pub struct ColorCamera {
    width: u32,
    height: u32,
    rays: Vec<Option<Vec3>>,
    materials: Vec<Look>,
    /// Color of the skylight, red green blue, with its strength.
    sky: [f32; 3],
}

#[derive(Debug)]
struct Look {
    properties: Properties,
    /// Reflected of the full sun and of the full sky.
    sun: [f32; 3],
    sky: [f32; 3],
}

impl ColorCamera {
    /// For a lens.
    pub fn new(model: &CameraModel) -> Self {
        let (width, height) = model.size();
        let pixels = (0..height).flat_map(|v| (0..width).map(move |u| [f64::from(u), f64::from(v)]));
        let white = Spectrum::from_fn(|_| 1.0);
        let (sunlight, skylight) = (Spectrum::sunlight(), Spectrum::skylight());
        // White balance on the direct sun: shadows then are bluish, as in photographs.
        let balance = FILTERS.map(|filter| 1.0 / white.through(&sunlight, filter));
        let seen = |spectrum: &Spectrum, light: &Spectrum, strength: f32| -> [f32; 3] {
            std::array::from_fn(|c| strength * balance[c] * spectrum.through(light, FILTERS[c]))
        };
        let materials = Material::ALL
            .iter()
            .map(|material| {
                let properties = material.properties();
                let sun = seen(&properties.spectrum, &sunlight, 1.0);
                let sky = seen(&properties.spectrum, &skylight, SKY_STRENGTH);
                Look { properties, sun, sky }
            })
            .collect();
        let sky = seen(&white, &skylight, SKY_STRENGTH);
        Self { width, height, rays: lens_rays(model, pixels), materials, sky }
    }

    /// Columns and rows.
    pub const fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    /// The picture: sRGB, row-major.
    pub fn shoot(&self, scene: &Scene, snapshot: &Snapshot, world_from_camera: &Pose, seed: u64) -> Vec<u8> {
        let pose = for_tracer(world_from_camera);
        let row = 3 * self.width as usize;
        let mut pixels = vec![0_u8; row * self.height as usize];
        pixels.par_chunks_mut(row).zip(self.rays.par_chunks(self.width as usize)).enumerate().for_each(
            |(v, (pixels, rays))| {
                for (u, (pixel, ray)) in pixels.chunks_exact_mut(3).zip(rays).enumerate() {
                    let Some(direction) = ray else { continue };
                    let seed = hash(seed, (v * rays.len() + u) as u64);
                    let ray = Ray { origin: pose.translation.vector, direction: pose.rotation * direction, seed };
                    pixel.copy_from_slice(&self.color(scene, snapshot, &ray).map(srgb));
                }
            },
        );
        pixels
    }

    fn color(&self, scene: &Scene, snapshot: &Snapshot, ray: &Ray) -> [f32; 3] {
        let Some(hit) = scene.cast(snapshot, ray, FAR_M) else {
            let brightness = sky_brightness(&ray.direction);
            return self.sky.map(|c| c * brightness * 1.6);
        };
        let light = Light::on(scene, snapshot, ray, &hit);
        let look = &self.materials[hit.surface.material as usize];
        let texture = look.properties.texture(&hit.texture_point, &hit.normal);
        let mirror = if look.properties.gloss > 0.0 {
            mirrored(look.properties.gloss, -hit.normal.dot(&ray.direction))
        } else {
            0.0
        };
        let mirror_light = if mirror > 0.0 { mirror * mirror_brightness(ray, &hit.normal) } else { 0.0 };
        std::array::from_fn(|c| {
            let scattered = texture * (light.sun * look.sun[c] + light.sky * look.sky[c]);
            (1.0 - mirror) * scattered + mirror_light * self.sky[c]
        })
    }
}

/// Linear light to 8 bits: a shoulder that keeps the sky below white, then the sRGB curve (IEC 61966-2-1).
fn srgb(linear: f32) -> u8 {
    let exposed = EXPOSURE * linear;
    let toned = 1.45 * exposed / (1.0 + 0.45 * exposed);
    let clipped = toned.clamp(0.0, 1.0);
    let coded = if clipped <= 0.003_130_8 { 12.92 * clipped } else { 1.055 * clipped.powf(1.0 / 2.4) - 0.055 };
    (255.0 * coded).round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tone_curve_rises_from_black_to_white() {
        let levels: Vec<u8> = (0..=20).map(|i| srgb(i as f32 * 0.06)).collect();
        assert_eq!((levels[0], levels[20]), (0, 255));
        assert!(levels.is_sorted() && levels[5] > 100 && levels[5] < 220);
    }
}
