//! What a camera's ray sees, before any filter, and what filters make of it.

use super::FAR_M;
use super::exposure::Exposure;
use super::sky_view::SkyView;
use crate::light::{Light, SKY_STRENGTH, mirrored, sun_on};
use crate::material::{Material, Properties};
use crate::scene::SceneHit;
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

/// A ray that a camera sends out.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// Instant of the exposure.
    pub instant: usize,
    /// The ray then.
    pub ray: Ray,
    /// The pixel near which it passes, px.
    pub at: [f32; 2],
}

/// A ray and its instant of the exposure.
type Sight = (Ray, usize);

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

    /// A hit that the share `sun` of the full sun reaches, that sees the share `open` of the sky, and that does not mirror the
    /// share `kept` of its light; all 0 to 1.
    pub fn part(&self, hit: &SceneHit, sun: f32, open: f32, kept: f32) -> Part {
        let material = hit.surface.material as u16;
        let texture = self.properties[material as usize].texture(&hit.texture_point, &hit.normal);
        Part { material, light: Light::on(sun, open).times(texture * kept) }
    }

    /// Along samples of the exposure; it is faster if each lies beside the one before.
    pub fn look(&self, exposure: &Exposure<'_>, sky: &SkyView, samples: &[Sample]) -> Vec<Seen> {
        let share = |ray: &Ray, hit: &SceneHit| {
            let gloss = self.properties[hit.surface.material as usize].gloss;
            if gloss > 0.0 { mirrored(gloss, -hit.normal.dot(&ray.direction)) } else { 0.0 }
        };
        let sights: Vec<Sight> = samples.iter().map(|sample| (sample.ray, sample.instant)).collect();
        let (direct, hits) = self.parts(exposure, &sights, |i, hit| {
            let Sample { instant, ray, at } = &samples[i];
            (sky.open(exposure, *instant, ray, hit, *at), 1.0 - share(ray, hit))
        });
        let mut seen: Vec<Seen> = direct.into_iter().map(|part| [part, Part::default()]).collect();

        let mut shares = Vec::new();
        let mut mirror_sights: Vec<Sight> = Vec::new();
        for (i, (ray, instant)) in sights.iter().enumerate() {
            let Some(hit) = hits[i] else { continue };
            let share = share(ray, &hit);
            if share >= FAINT {
                let direction = ray.direction - hit.normal * (2.0 * hit.normal.dot(&ray.direction));
                let origin = ray.at(hit.range_m) + hit.normal * 0.01;
                mirror_sights.push((Ray { origin, direction, seed: ray.seed ^ 0x3144 }, *instant));
                shares.push((i, share));
            }
        }
        // What a mirror shows is itself without gloss.
        let (images, _) = self.parts(exposure, &mirror_sights, |_, _| (OPEN_IN_MIRROR, 1.0));
        for ((i, share), image) in shares.into_iter().zip(images) {
            seen[i][1] = Part { light: image.light.times(share), ..image };
        }
        seen
    }

    /// The same where some samples are none: those see nothing.
    pub fn look_at_some(&self, exposure: &Exposure<'_>, sky: &SkyView, samples: &[Option<Sample>]) -> Vec<Seen> {
        let some: Vec<Sample> = samples.iter().copied().flatten().collect();
        let mut seen = self.look(exposure, sky, &some).into_iter();
        samples.iter().map(|sample| sample.and_then(|_| seen.next()).unwrap_or_default()).collect()
    }

    /// What is at the ends of rays, in which light, and where. `place(i, hit)`: the share of the sky that ray i's hit sees, and
    /// that of its light that it does not mirror.
    fn parts(
        &self,
        exposure: &Exposure<'_>,
        sights: &[Sight],
        place: impl Fn(usize, &SceneHit) -> (f32, f32),
    ) -> (Vec<Part>, Vec<Option<SceneHit>>) {
        let rays: Vec<Ray> = sights.iter().map(|(ray, _)| *ray).collect();
        let hits = exposure.scene.cast_all(&rays, FAR_M, |i| exposure.snapshot(sights[i].1));
        let places: Vec<usize> = (0..hits.len()).filter(|i| hits[*i].is_some()).collect();
        let met: Vec<(Ray, SceneHit)> = rays.iter().zip(&hits).filter_map(|(ray, hit)| Some((*ray, (*hit)?))).collect();
        let mut suns = sun_on(exposure.scene, &met, |k| exposure.snapshot(sights[places[k]].1)).into_iter();
        let part = |(i, hit): (usize, &Option<SceneHit>)| {
            let Some((hit, sun)) = hit.as_ref().zip(hit.and_then(|_| suns.next())) else {
                return Part { material: WHITE, light: Light::of_sky(&rays[i].direction) };
            };
            let (open, kept) = place(i, hit);
            self.part(hit, sun, open, kept)
        };
        (hits.iter().enumerate().map(part).collect(), hits)
    }
}
