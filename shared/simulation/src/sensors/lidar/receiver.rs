//! Lidar receiver: merges the returned light into echoes and measures range and intensity of the strongest.

use super::errors::LaserError;
use super::model::LidarModel;
use super::optics::Optics;
use super::returns::LidarReturn;
use random::{gauss, hash, unit};
use raytrace::Ray;
use town::material::{Material, Properties};
use town::{SceneHit, Surface};

/// Rays per beam: the center and four sides.
pub const N_PARTS: usize = 5;
/// Light of a full retroreflector relative to a white wall.
const FOIL_GAIN: f32 = 30.0;
/// Width of the specular lobe of glass and paint around normal incidence, rad (1.5 deg: panes and sheets are not quite flat).
const MIRROR_ANGLE: f32 = 0.026;
/// Specular light of a surface of gloss 1, relative to a white wall.
const MIRROR_GAIN: f32 = 100.0;
/// Error of the range correction of intensities at the maximum range, as a share.
const RANGE_SHORTFALL: f32 = 0.25;
/// Intensity noise, standard deviation: counts, and share of the level.
const INTENSITY_SIGMA: [f32; 2] = [0.4, 0.04];
/// Standard deviation of the laser gains after factory calibration. Rings of a real HDL-32E measure the same road as 3 to
/// 7.
const GAIN_SIGMA: f32 = 0.15;
/// Range unit of the packets, m.
const RANGE_UNIT_M: f32 = 0.002;

/// Light returned by a part of a beam.
#[derive(Clone, Copy, Debug)]
pub struct Part {
    /// Share of the beam.
    weight: f32,
    range_m: f32,
    /// Scattered light; 1 = a white wall at normal incidence.
    scattered: f32,
    /// Light returned by retroreflection and specular reflection, in the same unit.
    retro: f32,
    surface: Surface,
}

impl Part {
    /// Light at the receiver, relative to a white wall at 1 m.
    fn light(&self) -> f32 {
        self.weight * (self.scattered + self.retro) / (self.range_m * self.range_m)
    }
}

/// Receiver of one laser.
#[derive(Clone, Copy, Debug)]
struct LaserReceiver {
    /// Range correction of the factory table, m: true minus sent range.
    correction_m: f32,
    /// Error of this table, m: reported minus true range.
    range_error_m: f32,
    gain: f32,
}

/// Gain of a laser after factory calibration.
fn calibrated_gain(laser: usize) -> f32 {
    1.0 + GAIN_SIGMA * gauss(hash(0x6a14, laser as u64)).clamp(-2.0, 2.0)
}

/// A material for a laser.
#[derive(Clone, Debug)]
struct LaserMaterial {
    properties: Properties,
    /// Reflectance at the wavelength of the laser.
    reflectance: f32,
}

fn materials(optics: &Optics) -> Vec<LaserMaterial> {
    let with_reflectance = |material: &Material| {
        let properties = material.properties();
        let reflectance = properties.spectrum.at(optics.wavelength_nm);
        LaserMaterial { properties, reflectance }
    };
    Material::ALL.iter().map(with_reflectance).collect()
}

/// A receiver with the properties of all materials.
#[derive(Clone, Debug)]
pub struct Receiver {
    optics: Optics,
    /// Properties of each material.
    materials: Vec<LaserMaterial>,
    lasers: Vec<LaserReceiver>,
}

impl Receiver {
    /// A receiver of a model, with the errors of its lasers.
    pub(super) fn new(model: &LidarModel, errors: &[LaserError]) -> Self {
        let lasers = model.model.lasers().iter().zip(errors).enumerate().map(|(i, (laser, error))| LaserReceiver {
            correction_m: laser.range_m as f32,
            range_error_m: error.range_m as f32,
            gain: calibrated_gain(i) * error.gain as f32,
        });
        Self { optics: model.optics, materials: materials(&model.optics), lasers: lasers.collect() }
    }

    /// A receiver of a perfect unit with `n_lasers` lasers.
    pub(super) fn perfect(optics: Optics, n_lasers: usize) -> Self {
        let laser = |laser| LaserReceiver { correction_m: 0.0, range_error_m: 0.0, gain: calibrated_gain(laser) };
        Self { optics, materials: materials(&optics), lasers: (0..n_lasers).map(laser).collect() }
    }

    /// Light returned by a hit; `None` if it is reflected away or transmitted.
    pub fn part(&self, weight: f32, ray: &Ray, hit: &SceneHit) -> Option<Part> {
        let LaserMaterial { properties, reflectance } = &self.materials[hit.surface.material as usize];
        let incidence = -hit.normal.dot(&ray.direction);
        let off2 = 2.0 * (1.0 - incidence) / (MIRROR_ANGLE * MIRROR_ANGLE);
        let mirrored = if off2 < 9.0 { MIRROR_GAIN * properties.gloss * (-off2).exp() } else { 0.0 };
        if mirrored < 0.1 && unit(hash(ray.seed, 2)) < properties.specular_loss {
            return None;
        }
        // Retroreflectors work up to about 60 degrees from their normal.
        let foil = properties.retroreflection * ((incidence - 0.3) / 0.7).max(0.0);
        let scattered = reflectance * properties.texture(&hit.texture_point, &hit.normal) * incidence;
        let retro = FOIL_GAIN * foil + mirrored;
        Some(Part { weight, range_m: hit.range_m, scattered, retro, surface: hit.surface })
    }

    /// The strongest echo; `None` if it is too weak, too near or too far.
    pub fn strongest(&self, parts: &mut [Part], laser: usize, seed: u64) -> Option<LidarReturn> {
        let LaserReceiver { correction_m, range_error_m, gain } = self.lasers[laser];
        parts.sort_unstable_by(|a, b| a.range_m.total_cmp(&b.range_m));
        let echo = parts
            .chunk_by(|a, b| b.range_m - a.range_m < self.optics.echo_m)
            .map(|echo| (echo, echo.iter().map(Part::light).sum::<f32>()))
            .max_by(|a, b| a.1.total_cmp(&b.1));
        let (echo, light) = echo?;
        // Near the threshold, detection is random.
        let needed = 0.1 / self.optics.tenth_m.powi(2) * (0.8 + 0.4 * unit(hash(seed, 3)));
        if light < needed {
            return None;
        }
        // Surfaces within the pulse length give a range between them.
        let range_m = echo.iter().map(|part| part.light() * part.range_m).sum::<f32>() / light;
        let measured_m = range_m + self.optics.range_sigma_m * gauss(hash(seed, 1));
        let [shortest_m, longest_m] = self.optics.range_m;
        let count = ((measured_m + range_error_m - correction_m) / RANGE_UNIT_M).round();
        if !(shortest_m..longest_m).contains(&measured_m) || !(1.0..=f32::from(u16::MAX)).contains(&count) {
            return None;
        }
        let surface = echo.iter().max_by(|a, b| a.light().total_cmp(&b.light()))?.surface;
        Some(LidarReturn {
            range_2mm: count as u16,
            intensity: self.intensity(echo, range_m, gain, seed),
            class: surface.class,
            instance: surface.instance,
            range_m,
        })
    }

    /// Intensity as defined by the manufacturer: 0 to 100 for diffuse targets, in percent of a white wall; above for retroreflectors.
    fn intensity(&self, echo: &[Part], range_m: f32, gain: f32, seed: u64) -> u8 {
        let kept = 1.0 - RANGE_SHORTFALL * range_m / self.optics.range_m[1];
        let scattered: f32 = echo.iter().map(|part| part.weight * part.scattered).sum();
        let retro: f32 = echo.iter().map(|part| part.weight * part.retro).sum();
        let diffuse = (100.0 * scattered * kept * gain).min(100.0);
        let level = diffuse + 155.0 * (retro / FOIL_GAIN).min(1.0);
        let noise = (INTENSITY_SIGMA[0] + INTENSITY_SIGMA[1] * level) * gauss(hash(seed, 4));
        (level + noise).round().clamp(1.0, 255.0) as u8
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensors::lidar::LidarErrors;
    use messages::ClassId;
    use raytrace::Vec3;

    const SURFACE: Surface = Surface { class: ClassId::Wall, instance: 0, material: Material::Concrete };

    fn part(weight: f32, range_m: f32, scattered: f32, class: ClassId) -> Part {
        Part { weight, range_m, scattered, retro: 0.0, surface: Surface { class, ..SURFACE } }
    }

    fn receiver() -> Receiver {
        let optics = Optics { range_sigma_m: 0.0, ..Optics::HDL32E };
        let model = LidarModel { optics, ..LidarModel::HDL32E };
        Receiver::new(&model, &LidarErrors::NONE.per_laser(model.model))
    }

    #[test]
    fn close_surfaces_merge_into_one_echo_and_distant_ones_do_not() {
        let receiver = receiver();
        let found = |parts: &mut [Part]| receiver.strongest(parts, 0, 5).expect("an echo");
        let close = found(&mut [part(0.6, 10.0, 0.5, ClassId::Pole), part(0.4, 10.5, 0.5, ClassId::Building)]);
        // The nearer one is also brighter by the square of the ranges.
        assert!((10.15..10.21).contains(&close.range_m), "{close:?}");
        assert_eq!(close.class, ClassId::Pole);
        let apart = found(&mut [part(0.4, 10.0, 0.2, ClassId::Pole), part(0.6, 12.0, 0.7, ClassId::Building)]);
        assert_eq!((apart.range_2mm, apart.class), (6000, ClassId::Building));
        // A strong surface beyond the pulse of a weak one does not add light to it.
        assert!(apart.intensity < 60, "{apart:?}");
    }

    #[test]
    fn weak_near_and_far_echoes_are_lost() {
        let receiver = receiver();
        let is_seen = |range_m, scattered| {
            (0..200)
                .filter(|&seed| {
                    receiver.strongest(&mut [part(1.0, range_m, scattered, ClassId::Wall)], 3, seed).is_some()
                })
                .count()
        };
        // 10 % at 90 m is the limit, where half of the returns are kept at random; a dark road at grazing incidence is
        // lost long before.
        assert!((60..140).contains(&is_seen(90.0, 0.1)));
        assert_eq!((is_seen(80.0, 0.1), is_seen(105.0, 0.1), is_seen(45.0, 0.02)), (200, 0, 0));
        assert_eq!((is_seen(0.9, 0.5), is_seen(1.1, 0.5), is_seen(121.0, 0.9)), (0, 200, 0));
    }

    #[test]
    fn diffuse_targets_stay_below_100_and_retroreflectors_exceed_it() {
        let receiver = receiver();
        let mean = |parts: &[Part]| {
            let level = |seed| receiver.strongest(&mut parts.to_vec(), (seed % 32) as usize, seed).expect("an echo");
            (0..320).map(|seed| f32::from(level(seed).intensity)).sum::<f32>() / 320.0
        };
        let gray = mean(&[part(1.0, 5.0, 0.5, ClassId::Wall)]);
        let dark = mean(&[part(1.0, 5.0, 0.1, ClassId::Wall)]);
        assert!((gray - 50.0).abs() < 5.0 && (dark - 10.0).abs() < 1.5, "{gray} {dark}");
        let foil = Part { retro: FOIL_GAIN, ..part(1.0, 5.0, 0.5, ClassId::TrafficSign) };
        assert!(mean(&[foil]) > 190.0);
        let half = Part { retro: FOIL_GAIN * 0.4, ..part(1.0, 5.0, 0.5, ClassId::TrafficSign) };
        assert!((100.0..130.0).contains(&mean(&[half])));
    }

    #[test]
    fn glass_returns_normal_incidence_only_and_oblique_echoes_are_weaker() {
        let receiver = receiver();
        let seen = |material, degrees: f32| {
            let direction = Vec3::new(1.0, 0.0, 0.0);
            let normal = -Vec3::new(degrees.to_radians().cos(), degrees.to_radians().sin(), 0.0);
            let surface = Surface { material, ..SURFACE };
            let hit = SceneHit { range_m: 8.0, normal, surface, texture_point: Vec3::zeros() };
            let ray = |seed| Ray { origin: Vec3::zeros(), direction, seed };
            let parts: Vec<Part> = (0..500).filter_map(|seed| receiver.part(1.0, &ray(seed), &hit)).collect();
            let light = parts.iter().map(Part::light).sum::<f32>() / parts.len().max(1) as f32;
            (parts.len(), light)
        };
        let retro = seen(Material::Glass, 0.0);
        let oblique = seen(Material::Glass, 30.0);
        assert!(retro.0 == 500 && oblique.0 < 120, "{retro:?} {oblique:?}");
        assert!(retro.1 > 50.0 * oblique.1, "a pane mirrors: {retro:?} {oblique:?}");
        let wall = seen(Material::Concrete, 0.0);
        let slanted = seen(Material::Concrete, 60.0);
        assert_eq!((wall.0, slanted.0), (500, 500));
        assert!((slanted.1 / wall.1 - 0.5).abs() < 1e-3);
    }
}
