//! Radiance along camera rays, and the signal of each band.

use super::exposure::Exposure;
use super::lens::FAR_M;
use super::sky_view::SkyView;
use crate::illuminants::{skylight, sunlight};
use crate::light::{Light, RayHit, SKY_STRENGTH, mirrored, sun_on};
use crate::sensors::filter::Filter;
use raytrace::Ray;
use town::material::{Material, Properties};
use town::{SceneHit, Spectrum};

/// One contribution to a camera ray: a material under some light, or the sky.
#[derive(Clone, Copy, Debug, Default)]
pub struct Part {
    /// Index in [`Material::ALL`]; `Material::ALL.len()` represents the sky.
    pub material: u16,
    /// Light towards the camera, before the reflectance is applied.
    pub light: Light,
}

/// A camera ray.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// Instant of the exposure.
    pub instant: usize,
    /// The ray at this instant.
    pub ray: Ray,
    /// Image coordinates, px.
    pub at: [f32; 2],
}

/// A ray with its instant of the exposure.
#[derive(Clone, Copy)]
struct TimedRay {
    ray: Ray,
    instant: usize,
}

/// Results of rays.
struct TracedRays {
    /// Contribution of each ray.
    parts: Vec<Part>,
    hits: Vec<Option<SceneHit>>,
}

/// Light at a hit.
struct LightAtHit {
    /// Visible share of the sky.
    open: f32,
    /// Share of the light that is not specularly reflected.
    kept: f32,
}

/// Contributions to a ray: the direct hit and its specular reflection.
pub type Seen = [Part; 2];

/// Index that represents the sky, with reflectance 1.
const WHITE: u16 = Material::ALL.len() as u16;
/// Specular reflections weaker than this are skipped.
const FAINT: f32 = 0.02;
/// Assumed visible share of the sky for reflected objects.
const OPEN_IN_MIRROR: f32 = 0.5;

/// Response of the bands of a camera to each material.
#[derive(Debug)]
pub struct Palette {
    properties: Vec<Properties>,
    /// Signal by material and band under the full sun, in units of [`Self::new`]; the sky is last.
    sun: Vec<f32>,
    /// Signal by material and band under the full sky, in the same units.
    sky: Vec<f32>,
    n_bands: usize,
}

impl Palette {
    /// A palette for these filters. `unit(sun, sky)` is the signal that counts as 1 for a band in which a perfect white
    /// gives `sun` and `sky`.
    pub fn new(filters: &[Filter], unit: impl Fn(f32, f32) -> f32) -> Self {
        let sunlight = sunlight();
        let skylight = skylight();
        let properties: Vec<Properties> = Material::ALL.iter().map(|material| material.properties()).collect();
        let white = Spectrum::from_fn(|_| 1.0);
        let spectra = || properties.iter().map(|p| &p.spectrum).chain([&white]);
        let through = |spectrum: &Spectrum, light: &Spectrum, strength: f32| -> Vec<f32> {
            filters
                .iter()
                .map(|filter| {
                    let unit = unit(filter.signal(&white, &sunlight), SKY_STRENGTH * filter.signal(&white, &skylight));
                    strength * filter.signal(spectrum, light) / unit
                })
                .collect()
        };
        let sun = spectra().flat_map(|spectrum| through(spectrum, &sunlight, 1.0)).collect();
        let sky = spectra().flat_map(|spectrum| through(spectrum, &skylight, SKY_STRENGTH)).collect();
        Self { properties, sun, sky, n_bands: filters.len() }
    }

    /// Signal of a band.
    pub fn band(&self, part: &Part, band: usize) -> f32 {
        let at = part.material as usize * self.n_bands + band;
        part.light.sun * self.sun[at] + part.light.sky * self.sky[at]
    }

    /// Contribution of a hit that receives the share `sun` of the full sun and the share `open` of the skylight, and
    /// scatters the share `kept` of its light; all 0 to 1.
    pub fn part(&self, hit: &SceneHit, sun: f32, open: f32, kept: f32) -> Part {
        let material = hit.surface.material as u16;
        let texture = self.properties[material as usize].texture(&hit.texture_point, &hit.normal);
        Part { material, light: Light::on(sun, open).times(texture * kept) }
    }

    /// Contributions along samples of an exposure. This is faster if consecutive samples are coherent.
    pub fn look(&self, exposure: &Exposure<'_>, sky: &SkyView, samples: &[Sample]) -> Vec<Seen> {
        let share = |ray: &Ray, hit: &SceneHit| {
            let gloss = self.properties[hit.surface.material as usize].gloss;
            if gloss > 0.0 { mirrored(gloss, -hit.normal.dot(&ray.direction)) } else { 0.0 }
        };
        let timed_ray = |sample: &Sample| TimedRay { ray: sample.ray, instant: sample.instant };
        let timed_rays: Vec<TimedRay> = samples.iter().map(timed_ray).collect();
        let TracedRays { parts: direct, hits } = self.trace(exposure, &timed_rays, |i, hit| {
            let Sample { instant, ray, at } = &samples[i];
            LightAtHit { open: sky.open(exposure, *instant, ray, hit, *at), kept: 1.0 - share(ray, hit) }
        });
        let mut seen: Vec<Seen> = direct.into_iter().map(|part| [part, Part::default()]).collect();

        let mut shares = Vec::new();
        let mut mirror_rays: Vec<TimedRay> = Vec::new();
        for (i, TimedRay { ray, instant }) in timed_rays.iter().enumerate() {
            let Some(hit) = hits[i] else { continue };
            let share = share(ray, &hit);
            if share >= FAINT {
                let direction = ray.direction - hit.normal * (2.0 * hit.normal.dot(&ray.direction));
                let origin = ray.at(hit.range_m) + hit.normal * 0.01;
                let mirrored = Ray { origin, direction, seed: ray.seed ^ 0x3144 };
                mirror_rays.push(TimedRay { ray: mirrored, instant: *instant });
                shares.push((i, share));
            }
        }
        // Only one reflection is traced.
        let in_mirror = |_, _: &SceneHit| LightAtHit { open: OPEN_IN_MIRROR, kept: 1.0 };
        let images = self.trace(exposure, &mirror_rays, in_mirror).parts;
        for ((i, share), image) in shares.into_iter().zip(images) {
            seen[i][1] = Part { light: image.light.times(share), ..image };
        }
        seen
    }

    /// Like [`Self::look`]; samples that are `None` get no light.
    pub fn look_at_some(&self, exposure: &Exposure<'_>, sky: &SkyView, samples: &[Option<Sample>]) -> Vec<Seen> {
        let some: Vec<Sample> = samples.iter().copied().flatten().collect();
        let mut seen = self.look(exposure, sky, &some).into_iter();
        samples.iter().map(|sample| sample.and_then(|_| seen.next()).unwrap_or_default()).collect()
    }

    /// Traces rays. `light_at(i, hit)` returns the light at the hit of ray i.
    fn trace(
        &self,
        exposure: &Exposure<'_>,
        timed_rays: &[TimedRay],
        light_at: impl Fn(usize, &SceneHit) -> LightAtHit,
    ) -> TracedRays {
        let rays: Vec<Ray> = timed_rays.iter().map(|timed| timed.ray).collect();
        let hits = exposure.scene.cast_all(&rays, FAR_M, |i| exposure.snapshot(timed_rays[i].instant));
        let places: Vec<usize> = (0..hits.len()).filter(|i| hits[*i].is_some()).collect();
        let met = rays.iter().zip(&hits).filter_map(|(ray, hit)| Some(RayHit { ray: *ray, hit: (*hit)? }));
        let met: Vec<RayHit> = met.collect();
        let mut suns = sun_on(exposure.scene, &met, |k| exposure.snapshot(timed_rays[places[k]].instant)).into_iter();
        let part = |(i, hit): (usize, &Option<SceneHit>)| {
            let Some((hit, sun)) = hit.as_ref().zip(hit.and_then(|_| suns.next())) else {
                return Part { material: WHITE, light: Light::sky(&rays[i].direction) };
            };
            let LightAtHit { open, kept } = light_at(i, hit);
            self.part(hit, sun, open, kept)
        };
        TracedRays { parts: hits.iter().enumerate().map(part).collect(), hits }
    }
}
