//! The mosaic cameras Photonfocus HS02 and HS03: every pixel looks through one filter of a repeating pattern.
//!
//! The scene is sampled by one ray per pattern cell, and every pixel of a cell sees that point through its own filter: a
//! cube of the cells (409 x 217 and 512 x 256) then has exact spectra and no color fringes at edges.

use super::{FAR_M, for_tracer, lens_rays};
use crate::light::{Light, SKY_STRENGTH, mirror_brightness, mirrored, sky_brightness};
use crate::material::{Material, Properties};
use crate::random::{gauss, hash, unit};
use crate::scene::{Scene, Snapshot};
use crate::spectrum::{Band, Spectrum};
use crate::trace::{Ray, Vec3};
use geometry::{CameraModel, Pose};
use rayon::prelude::*;

/// Columns and rows of the raw image.
pub const SIZE: [usize; 2] = [2048, 1088];
/// Bits of a sample.
pub const BIT_DEPTH: u32 = 10;
const FULL: f32 = 1023.0;
/// Exposure of the scene and of the dark reference, ns (thesis 2.5.1: 5 ms).
pub const EXPOSURE_NANOS: u64 = 5_000_000;
/// Exposure of the white reference, ns: shorter, because a white target in the sun would saturate.
pub const WHITE_EXPOSURE_NANOS: u64 = 2_000_000;
/// Reflectance of the white target (thesis 2.5.1: "close to 98 %").
pub const WHITE_REFLECTANCE: f32 = 0.98;
/// Level of the white reference in the most sensitive band, counts above the dark level.
const WHITE_LEVEL: f32 = 0.72 * FULL;
/// Level without light, counts.
const BIAS: f32 = 16.0;
/// Counts per ms without light.
const DARK_PER_MS: f32 = 0.12;
/// Electrons per count: a full well of 11 000.
const ELECTRONS: f32 = 10.75;
/// Read noise, counts.
const READ_NOISE: f32 = 0.8;
/// One pixel in this many is stuck at full.
const HOT_EVERY: u64 = 60_000;
/// Seed of what belongs to the chip and not to the drive: stuck pixels, uneven levels.
const CHIP: u64 = 0x00c4_1900;

/// A model of camera.
#[derive(Clone, Debug, PartialEq)]
pub struct MosaicModel {
    /// `hs02` or `hs03`.
    pub name: &'static str,
    /// Side of the pattern, px.
    pub pattern: usize,
    /// Left column, top row, width and height of the area with filters, px.
    pub active_area: [usize; 4],
    /// First and last center, nm.
    range_nm: [f32; 2],
    /// Standard deviation of the filters, nm.
    sigma_nm: f32,
}

impl MosaicModel {
    /// 25 bands from 600 to 975 nm.
    pub const fn hs02() -> Self {
        Self { name: "hs02", pattern: 5, active_area: [0, 0, 2045, 1085], range_nm: [600.0, 975.0], sigma_nm: 7.0 }
    }
    /// 16 bands from 470 to 630 nm.
    pub const fn hs03() -> Self {
        Self { name: "hs03", pattern: 4, active_area: [0, 32, 2048, 1024], range_nm: [470.0, 630.0], sigma_nm: 6.0 }
    }
    /// The filters, row-major in the pattern. On the chip they do not stand in the order of their wavelengths.
    pub fn bands(&self) -> Vec<Band> {
        let n = self.pattern * self.pattern;
        let step = (self.range_nm[1] - self.range_nm[0]) / (n - 1) as f32;
        // A stride without common divisor with n visits all bands.
        (0..n)
            .map(|i| Band { center_nm: self.range_nm[0] + step * (i * 7 % n) as f32, sigma_nm: self.sigma_nm })
            .collect()
    }
    /// Columns and rows of pattern cells.
    pub const fn cells(&self) -> [usize; 2] {
        [self.active_area[2] / self.pattern, self.active_area[3] / self.pattern]
    }
}

/// A mosaic camera and how it sees materials.
#[derive(Debug)]
pub struct MosaicCamera {
    model: MosaicModel,
    rays: Vec<Option<Vec3>>,
    materials: Vec<Look>,
    /// Per band: reflected by a perfect white under the full sky alone, against [`Self::counts_per_ms`].
    sky: Vec<f32>,
    /// Per band: counts per ms of a perfect white that faces the sun under the open sky.
    counts_per_ms: Vec<f32>,
}

#[derive(Debug)]
struct Look {
    properties: Properties,
    /// Per band: apparent reflectance under the full sun and under the full sky.
    sun: Vec<f32>,
    sky: Vec<f32>,
}

/// What a pattern cell sees.
struct Cell {
    material: Option<usize>,
    sun: f32,
    sky: f32,
    /// Mirrored or direct skylight.
    mirror: f32,
}

impl MosaicCamera {
    /// For a model behind a lens.
    pub fn new(model: MosaicModel, lens: &CameraModel) -> Self {
        let [left, top, ..] = model.active_area;
        let [columns, rows] = model.cells();
        let middle =
            |cell: usize, first: usize| (first + cell * model.pattern) as f64 + 0.5 * (model.pattern - 1) as f64;
        let pixels = (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column)));
        let rays = lens_rays(lens, pixels.map(|(row, column)| [middle(column, left), middle(row, top)]));
        let bands = model.bands();
        let (sunlight, skylight) = (Spectrum::sunlight(), Spectrum::skylight());
        let white = Spectrum::from_fn(|_| 1.0);
        let full: Vec<f32> = bands
            .iter()
            .map(|band| white.through(&sunlight, *band) + SKY_STRENGTH * white.through(&skylight, *band))
            .collect();
        let apparent = |spectrum: &Spectrum, light: &Spectrum, strength: f32| -> Vec<f32> {
            bands.iter().zip(&full).map(|(band, full)| strength * spectrum.through(light, *band) / full).collect()
        };
        let materials = Material::ALL
            .iter()
            .map(|material| {
                let properties = material.properties();
                let sun = apparent(&properties.spectrum, &sunlight, 1.0);
                let sky = apparent(&properties.spectrum, &skylight, SKY_STRENGTH);
                Look { properties, sun, sky }
            })
            .collect();
        // Silicon: best at 600 nm, a quarter left at 1000 nm; with the light's own spectrum.
        let response: Vec<f32> = bands
            .iter()
            .zip(&full)
            .map(|(band, full)| full * (1.0 - 0.75 * ((band.center_nm - 600.0) / 400.0).abs().min(1.0)))
            .collect();
        let strongest = response.iter().copied().fold(0.0, f32::max);
        let per_ms = WHITE_LEVEL / (WHITE_REFLECTANCE * WHITE_EXPOSURE_NANOS as f32 * 1e-6);
        let counts_per_ms = response.iter().map(|r| r / strongest * per_ms).collect();
        let sky = apparent(&white, &skylight, SKY_STRENGTH);
        Self { model, rays, materials, sky, counts_per_ms }
    }

    /// The scene: raw samples, row-major.
    pub fn shoot(&self, scene: &Scene, snapshot: &Snapshot, world_from_camera: &Pose, seed: u64) -> Vec<u16> {
        let pose = for_tracer(world_from_camera);
        let cells: Vec<Cell> = self
            .rays
            .par_iter()
            .enumerate()
            .map(|(i, direction)| {
                let Some(direction) = direction else { return Cell::DARK };
                let seed = hash(seed, i as u64);
                let ray = Ray { origin: pose.translation.vector, direction: pose.rotation * direction, seed };
                self.look(scene, snapshot, &ray)
            })
            .collect();
        self.expose(EXPOSURE_NANOS, seed, |cell, band| {
            let cell = &cells[cell];
            let scattered = cell.material.map_or(0.0, |m| {
                let look = &self.materials[m];
                cell.sun * look.sun[band] + cell.sky * look.sky[band]
            });
            scattered + cell.mirror * self.sky[band]
        })
    }

    /// The dark reference: the lens is closed.
    pub fn dark(&self, seed: u64) -> Vec<u16> {
        self.expose(EXPOSURE_NANOS, seed, |_, _| 0.0)
    }

    /// The white reference: a target that faces the sun fills the image.
    pub fn white(&self, seed: u64) -> Vec<u16> {
        self.expose(WHITE_EXPOSURE_NANOS, seed, |_, _| WHITE_REFLECTANCE)
    }

    fn look(&self, scene: &Scene, snapshot: &Snapshot, ray: &Ray) -> Cell {
        let Some(hit) = scene.cast(snapshot, ray, FAR_M) else {
            return Cell { mirror: 1.6 * sky_brightness(&ray.direction), ..Cell::DARK };
        };
        let light = Light::on(scene, snapshot, ray, &hit);
        let material = hit.surface.material as usize;
        let properties = &self.materials[material].properties;
        let gloss = properties.gloss;
        let share = if gloss > 0.0 { mirrored(gloss, -hit.normal.dot(&ray.direction)) } else { 0.0 };
        let scattered = (1.0 - share) * properties.texture(&hit.texture_point, &hit.normal);
        let mirror = if share > 0.0 { share * mirror_brightness(ray, &hit.normal) } else { 0.0 };
        Cell { material: Some(material), sun: scattered * light.sun, sky: scattered * light.sky, mirror }
    }

    /// Samples of a chip that sees `reflectance(cell, band)`.
    fn expose(&self, exposure_nanos: u64, seed: u64, reflectance: impl Fn(usize, usize) -> f32 + Sync) -> Vec<u16> {
        let exposure_ms = exposure_nanos as f32 * 1e-6;
        let [left, top, ..] = self.model.active_area;
        let [columns, rows] = self.model.cells();
        let pattern = self.model.pattern;
        let mut samples = vec![0_u16; SIZE[0] * SIZE[1]];
        samples.par_chunks_mut(SIZE[0]).enumerate().for_each(|(v, row)| {
            let in_rows = (top..top + rows * pattern).contains(&v);
            for (u, sample) in row.iter_mut().enumerate() {
                let pixel = (v * SIZE[0] + u) as u64;
                let light = if in_rows && (left..left + columns * pattern).contains(&u) {
                    let (x, y) = (u - left, v - top);
                    let band = y % pattern * pattern + x % pattern;
                    let cell = y / pattern * columns + x / pattern;
                    reflectance(cell, band) * self.counts_per_ms[band] * exposure_ms
                } else {
                    0.0
                };
                *sample = read_out(pixel, light, exposure_ms, seed);
            }
        });
        samples
    }
}

impl Cell {
    const DARK: Self = Self { material: None, sun: 0.0, sky: 0.0, mirror: 0.0 };
}

/// One pixel's sample for `light` counts.
fn read_out(pixel: u64, light: f32, exposure_ms: f32, seed: u64) -> u16 {
    let chip = hash(CHIP, pixel);
    if chip.is_multiple_of(HOT_EVERY) {
        return FULL as u16;
    }
    // Every pixel has its own dark level (within 2 counts) and gain (within 1 %).
    let level = BIAS + 4.0 * (unit(chip) - 0.5) + DARK_PER_MS * exposure_ms;
    let light = light * (1.0 + 0.02 * (unit(chip << 24) - 0.5));
    let noise = (READ_NOISE * READ_NOISE + light / ELECTRONS).sqrt() * gauss(hash(seed, pixel));
    (level + light + noise).round().clamp(0.0, FULL) as u16
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::RigSpec;

    fn mean_per_band(model: &MosaicModel, samples: &[u16]) -> Vec<f32> {
        let [left, top, ..] = model.active_area;
        let [columns, rows] = model.cells();
        let n = model.pattern;
        (0..n * n)
            .map(|band| {
                let mut sum = 0.0;
                for row in 0..rows {
                    for column in 0..columns {
                        let (v, u) = (top + row * n + band / n, left + column * n + band % n);
                        sum += f32::from(samples[v * SIZE[0] + u]);
                    }
                }
                sum / (rows * columns) as f32
            })
            .collect()
    }

    #[test]
    fn a_surface_of_known_reflectance_is_found_between_dark_and_white() {
        for model in [MosaicModel::hs02(), MosaicModel::hs03()] {
            let camera = MosaicCamera::new(model.clone(), &RigSpec::l3d2().mosaics[0].lens);
            let dark = mean_per_band(&model, &camera.dark(1));
            let white = mean_per_band(&model, &camera.white(2));
            let gray = mean_per_band(&model, &camera.expose(EXPOSURE_NANOS, 3, |_, band| 0.1 + 0.01 * band as f32));
            let per_exposure = EXPOSURE_NANOS as f32 / WHITE_EXPOSURE_NANOS as f32;
            for band in 0..white.len() {
                let reflectance =
                    WHITE_REFLECTANCE * (gray[band] - dark[band]) / ((white[band] - dark[band]) * per_exposure);
                let truth = 0.1 + 0.01 * band as f32;
                assert!((reflectance - truth).abs() < 0.005, "{} band {band}: {reflectance}", model.name);
                // What a perfect white would give in each band is known, so the white frame itself says 0.98.
                let of_white = (white[band] - dark[band]) / (camera.counts_per_ms[band] * 2.0);
                assert!((of_white - 0.98).abs() < 0.005, "{} band {band}: {of_white}", model.name);
            }
        }
    }

    #[test]
    fn every_band_occurs_once_and_within_its_range() {
        for (model, low, high) in [(MosaicModel::hs02(), 600.0, 975.0), (MosaicModel::hs03(), 470.0, 630.0)] {
            let mut centers: Vec<f32> = model.bands().iter().map(|band| band.center_nm).collect();
            centers.sort_by(f32::total_cmp);
            assert!(centers.windows(2).all(|pair| pair[1] - pair[0] > 5.0));
            assert_eq!((centers[0], *centers.last().expect("bands")), (low, high));
        }
        assert_eq!((MosaicModel::hs02().cells(), MosaicModel::hs03().cells()), ([409, 217], [512, 256]));
    }
}
