//! What a camera's ray sees, before any filter, and what filters make of it.

use super::FAR_M;
use super::exposure::Exposure;
use super::sky_view::SkyView;
use crate::light::{Light, SKY_STRENGTH, mirrored};
use crate::material::{Material, Properties};
use crate::spectrum::{Filter, Spectrum};
use crate::trace::Ray;

/// A surface or the sky in some light. A ray sees one, and with a shiny surface also what that mirrors.
#[derive(Clone, Copy, Debug, Default)]
pub struct Part {
    /// Number in [`Material::ALL`]; `Material::ALL.len()` is the white of the sky.
    pub material: u16,
    /// What it sends to the camera, before its reflectance.
    pub light: Light,
}

/// What a ray sees.
pub type Seen = [Part; 2];

/// Stands for the sky, which has no reflectance of its own.
const WHITE: u16 = Material::ALL.len() as u16;
/// Mirror images weaker than this are left out.
const FAINT: f32 = 0.02;
/// How much of the sky a thing in a mirror sees: half of it, as things in streets do.
const OPEN_IN_MIRROR: f32 = 0.5;

/// Materials as a camera sees them.
#[derive(Debug)]
pub struct Palette {
    properties: Vec<Properties>,
    /// By material and band, the white of the sky last: the reflected of the full sun and of the full sky, against
    /// [`Self::new`]'s unit.
    sun: Vec<f32>,
    sky: Vec<f32>,
    n_bands: usize,
}

impl Palette {
    /// For filters; `unit(sun, sky)` is what counts as 1 of a band that gets `sun` and `sky` from a perfect white.
    pub fn new(filters: &[Filter], unit: impl Fn(f32, f32) -> f32) -> Self {
        let (sunlight, skylight) = (Spectrum::sunlight(), Spectrum::skylight());
        let properties: Vec<Properties> = Material::ALL.iter().map(|material| material.properties()).collect();
        let white = Spectrum::from_fn(|_| 1.0);
        let spectra = || properties.iter().map(|p| &p.spectrum).chain([&white]);
        let through = |spectrum: &Spectrum, light: &Spectrum, strength: f32| -> Vec<f32> {
            filters
                .iter()
                .map(|filter| {
                    let unit = unit(white.through(&sunlight, filter), SKY_STRENGTH * white.through(&skylight, filter));
                    strength * spectrum.through(light, filter) / unit
                })
                .collect()
        };
        let sun = spectra().flat_map(|spectrum| through(spectrum, &sunlight, 1.0)).collect();
        let sky = spectra().flat_map(|spectrum| through(spectrum, &skylight, SKY_STRENGTH)).collect();
        Self { properties, sun, sky, n_bands: filters.len() }
    }

    /// What band `band` gets.
    pub fn band(&self, part: &Part, band: usize) -> f32 {
        let at = part.material as usize * self.n_bands + band;
        part.light.sun * self.sun[at] + part.light.sky * self.sky[at]
    }

    /// Along a ray of the exposure at an instant, near the pixel `at`.
    pub fn look(&self, exposure: &Exposure<'_>, sky: &SkyView, instant: usize, ray: &Ray, at: [f32; 2]) -> Seen {
        let snapshot = exposure.snapshot(instant);
        let Some(hit) = exposure.scene.cast(snapshot, ray, FAR_M) else {
            return [Part { material: WHITE, light: Light::of_sky(&ray.direction) }, Part::default()];
        };
        let material = hit.surface.material as u16;
        let properties = &self.properties[material as usize];
        let open = sky.open(exposure, instant, ray, &hit, at);
        let light = Light::on(exposure.scene, snapshot, ray, &hit, open);
        let texture = properties.texture(&hit.texture_point, &hit.normal);
        let share =
            if properties.gloss > 0.0 { mirrored(properties.gloss, -hit.normal.dot(&ray.direction)) } else { 0.0 };
        let first = Part { material, light: light.times(texture * (1.0 - share)) };
        if share < FAINT {
            return [first, Part::default()];
        }
        let direction = ray.direction - hit.normal * (2.0 * hit.normal.dot(&ray.direction));
        let mirror = Ray { origin: ray.at(hit.range_m) + hit.normal * 0.01, direction, seed: ray.seed ^ 0x3144 };
        let image = self.in_mirror(exposure, instant, &mirror);
        [first, Part { light: image.light.times(share), ..image }]
    }

    /// What a mirror shows, itself without gloss.
    fn in_mirror(&self, exposure: &Exposure<'_>, instant: usize, ray: &Ray) -> Part {
        let snapshot = exposure.snapshot(instant);
        let Some(hit) = exposure.scene.cast(snapshot, ray, FAR_M) else {
            return Part { material: WHITE, light: Light::of_sky(&ray.direction) };
        };
        let material = hit.surface.material as u16;
        let light = Light::on(exposure.scene, snapshot, ray, &hit, OPEN_IN_MIRROR);
        let texture = self.properties[material as usize].texture(&hit.texture_point, &hit.normal);
        Part { material, light: light.times(texture) }
    }
}
