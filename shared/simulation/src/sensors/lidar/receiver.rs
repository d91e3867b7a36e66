//! What a receiver makes of the light that comes back: echoes, the strongest of them, its range and its intensity.

use super::LidarReturn;
use super::model::LidarModel;
use crate::material::{Material, Properties};
use crate::random::{gauss, hash, unit};
use crate::scene::{SceneHit, Surface};
use crate::trace::Ray;

/// Parts of a beam: its middle and four beside it.
pub const N_PARTS: usize = 5;
/// A full foil sends back this many times the light of a white wall; the maker's scale says only "more".
const FOIL_GAIN: f32 = 30.0;
/// Glass and paint mirror the beam into the receiver if they are met at right angles within this, rad (1.5 deg: panes and
/// sheets are not quite flat). Light of a lobe that narrow is far stronger than what scatters.
const MIRROR_ANGLE: f32 = 0.026;
/// The light mirrored by a surface of gloss 1, in units of a white wall's.
const MIRROR_GAIN: f32 = 100.0;
/// The device's correction of intensities for the range falls short by this share at the longest range.
const RANGE_SHORTFALL: f32 = 0.25;
/// Scatter of intensities, counts.
const INTENSITY_SIGMA: f32 = 2.0;
/// A count of the range, m.
const RANGE_UNIT_M: f32 = 0.002;

/// What a part of a beam brings back.
#[derive(Clone, Copy, Debug)]
pub struct Part {
    /// Share of the beam.
    weight: f32,
    range_m: f32,
    /// Scattered, 1 = all that a white wall does that is met at right angles.
    scattered: f32,
    /// Sent straight back by foils and mirrors, in the same unit.
    straight: f32,
    surface: Surface,
}

impl Part {
    /// Light at the receiver, in units of a white wall's at 1 m.
    fn light(&self) -> f32 {
        self.weight * (self.scattered + self.straight) / (self.range_m * self.range_m)
    }
}

/// The receiver and what it knows of materials.
#[derive(Clone, Debug)]
pub struct Receiver {
    model: LidarModel,
    /// Properties and reflectance at the laser's wavelength, by material.
    materials: Vec<(Properties, f32)>,
}

impl Receiver {
    /// Of a model.
    pub fn new(model: &LidarModel) -> Self {
        let materials = Material::ALL.iter().map(|material| {
            let properties = material.properties();
            let reflectance = properties.spectrum.at(model.wavelength_nm);
            (properties, reflectance)
        });
        Self { model: *model, materials: materials.collect() }
    }

    /// What a part of a beam brings back of a hit; `None` if it is mirrored away or goes through.
    pub fn part(&self, weight: f32, ray: &Ray, hit: &SceneHit) -> Option<Part> {
        let (properties, reflectance) = &self.materials[hit.surface.material as usize];
        let incidence = -hit.normal.dot(&ray.direction);
        let off2 = 2.0 * (1.0 - incidence) / (MIRROR_ANGLE * MIRROR_ANGLE);
        let mirrored = if off2 < 9.0 { MIRROR_GAIN * properties.gloss * (-off2).exp() } else { 0.0 };
        if mirrored < 0.1 && unit(hash(ray.seed, 2)) < properties.beam_loss {
            return None;
        }
        // Foil sends light back whence it came, up to about 60 degrees from its normal.
        let foil = properties.retroreflection * ((incidence - 0.3) / 0.7).max(0.0);
        let scattered = reflectance * properties.texture(&hit.texture_point, &hit.normal) * incidence;
        let straight = FOIL_GAIN * foil + mirrored;
        Some(Part { weight, range_m: hit.range_m, scattered, straight, surface: hit.surface })
    }

    /// The strongest echo of the parts; `None` if it is too weak, too near or too far. `correction_m` is what the laser's range is
    /// to be corrected by.
    pub fn strongest(&self, parts: &mut [Part], correction_m: f32, seed: u64) -> Option<LidarReturn> {
        parts.sort_unstable_by(|a, b| a.range_m.total_cmp(&b.range_m));
        let echo = parts
            .chunk_by(|a, b| b.range_m - a.range_m < self.model.echo_m)
            .map(|echo| (echo, echo.iter().map(Part::light).sum::<f32>()))
            .max_by(|a, b| a.1.total_cmp(&b.1));
        let (echo, light) = echo?;
        // The weakest are lost or kept by chance.
        let needed = 0.1 / self.model.tenth_m.powi(2) * (0.8 + 0.4 * unit(hash(seed, 3)));
        if light < needed {
            return None;
        }
        // Surfaces within a pulse's length are measured between them.
        let range_m = echo.iter().map(|part| part.light() * part.range_m).sum::<f32>() / light;
        let measured_m = range_m + self.model.range_sigma_m * gauss(hash(seed, 1));
        let [shortest_m, longest_m] = self.model.range_m;
        let count = ((measured_m - correction_m) / RANGE_UNIT_M).round();
        if !(shortest_m..longest_m).contains(&measured_m) || !(1.0..=f32::from(u16::MAX)).contains(&count) {
            return None;
        }
        let surface = echo.iter().max_by(|a, b| a.light().total_cmp(&b.light()))?.surface;
        Some(LidarReturn {
            range_2mm: count as u16,
            intensity: self.intensity(echo, range_m, seed),
            class: surface.class,
            instance: surface.instance,
            range_m,
        })
    }

    /// The maker's scale: 0 to 100 for what scatters, in percent of a white wall, above for what sends straight back.
    fn intensity(&self, echo: &[Part], range_m: f32, seed: u64) -> u8 {
        let kept = 1.0 - RANGE_SHORTFALL * range_m / self.model.range_m[1];
        let scattered: f32 = echo.iter().map(|part| part.weight * part.scattered).sum();
        let straight: f32 = echo.iter().map(|part| part.weight * part.straight).sum();
        let diffuse = (100.0 * scattered * kept).min(100.0);
        let level = diffuse + 155.0 * (straight / FOIL_GAIN).min(1.0) + INTENSITY_SIGMA * gauss(hash(seed, 4));
        level.round().clamp(1.0, 255.0) as u8
    }
}
