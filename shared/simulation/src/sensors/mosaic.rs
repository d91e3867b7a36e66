//! Mosaic cameras Photonfocus HS02 and HS03: every pixel has one filter of a repeating pattern.
//!
//! One ray per 2 x 2 pixels samples the scene, each in a different ninth of the exposure. A pixel integrates the nine
//! samples around it, weighted by the point spread of the lens (1.5 px), through its own filter: light x reflectance x
//! response over the whole exposure, with motion blur.

mod calibration;
mod chip;
mod model;

pub use calibration::sensor_calibration;
pub use chip::{BIT_DEPTH, Chip, Defect, DefectivePixel, SIZE};
pub use model::{InterferenceFilter, MosaicModel};

use super::exposure::{Exposure, stratified};
use super::lens::lens_rays;
use super::look::{Palette, Sample, Seen};
use super::sky_view::SkyView;
use crate::illuminants::{skylight, sunlight};
use crate::sensors::filter::Filter;
use chip::FULL;
use geometry::CameraModel;
use random::{hash, unit};
use rayon::prelude::*;
use raytrace::Vec3;
use town::Spectrum;

/// Default exposure of the scene and of the dark reference, ns (thesis 2.5.1: 5 ms).
pub const EXPOSURE_NANOS: u64 = 5_000_000;
/// Exposure of the white reference, ns: it reaches 72 % of saturation.
pub const WHITE_EXPOSURE_NANOS: u64 = 12_000_000;
/// Reflectance of the white target (thesis 2.5.1: "close to 98 %").
pub const WHITE_REFLECTANCE: f32 = 0.98;
/// Level of the white reference in the most sensitive band, counts above the dark level. At 5 ms a white in the sun is
/// then at 30 % and a gray in the shade at 3 %: the concentration at low values that the thesis reports (4.3.1).
const WHITE_LEVEL: f32 = 0.72 * FULL;
/// Side of the block of pixels that share one ray, px.
const BLOCK: usize = 2;
/// Standard deviation of the lens' point spread, px.
const SPREAD_PX: f32 = 1.5;
/// Grid spacing of the sky view, blocks.
const SKY_STEP: usize = 16;
/// Strata of the exposure: one for each of the samples of a pixel.
const STRATA: usize = 9;

/// A mosaic camera with its response to each material.
#[derive(Debug)]
pub struct MosaicCamera {
    model: MosaicModel,
    chip: Chip,
    exposure_nanos: u64,
    /// Columns and rows of blocks.
    blocks: [usize; 2],
    rays: Vec<Option<Vec3>>,
    palette: Palette,
    /// Counts per ms, by band, of a perfect white that faces the sun under the open sky, in the middle of the image.
    counts_per_ms: Vec<f32>,
}

impl MosaicCamera {
    /// A camera of a model with a lens, at [`EXPOSURE_NANOS`].
    pub fn new(model: MosaicModel, lens: &CameraModel) -> Self {
        let [left, top, ..] = model.active_area;
        let blocks = model.cells().map(|cells| (cells * model.pattern).div_ceil(BLOCK));
        let middle = |block: usize, first: usize| (first + block * BLOCK) as f64 + 0.5 * (BLOCK - 1) as f64;
        let all = (0..blocks[1]).flat_map(|y| (0..blocks[0]).map(move |x| (x, y)));
        let rays = lens_rays(lens, all.map(|(x, y)| [middle(x, left), middle(y, top)]));
        let calibration = sensor_calibration(&model);
        let filters: Vec<Filter> = (0..model.bands().len())
            .filter_map(|k| calibration.system_response(k))
            .map(|curve| Filter::from_fn(|nm| curve.at(nm)))
            .collect();
        let palette = Palette::new(&filters, |sun, sky| sun + sky);
        let counts_per_ms = counts_per_ms(&filters);
        let chip = Chip::new(model.sensor_id);
        Self { model, chip, exposure_nanos: EXPOSURE_NANOS, blocks, rays, palette, counts_per_ms }
    }

    /// This camera with another exposure of scene and dark reference, ns.
    #[must_use]
    pub fn exposed(self, exposure_nanos: u64) -> Self {
        Self { exposure_nanos, ..self }
    }

    /// Exposure of scene and dark reference, ns.
    pub const fn exposure_nanos(&self) -> u64 {
        self.exposure_nanos
    }

    /// The scene: raw samples, row-major.
    pub fn shoot(&self, exposure: &Exposure<'_>, seed: u64) -> Vec<u16> {
        let [columns, rows] = self.blocks;
        let sky = SkyView::new(exposure, [columns, rows], SKY_STEP, |x, y| self.rays[y * columns + x]);
        let row = |y: usize| {
            let samples: Vec<Option<Sample>> = (0..columns).map(|x| self.sample(exposure, y * columns + x)).collect();
            self.palette.look_at_some(exposure, &sky, &samples)
        };
        let seen: Vec<Seen> = (0..rows).into_par_iter().flat_map_iter(row).collect();
        let weights = [0, 1].map(spread);
        self.expose(self.exposure_nanos, seed, |[x, y], band| {
            let wx = &weights[x % BLOCK];
            let wy = &weights[y % BLOCK];
            let mut sum = 0.0;
            for (dy, wy) in wy.iter().enumerate() {
                let row = (y / BLOCK + dy).saturating_sub(1).min(rows - 1) * columns;
                for (dx, wx) in wx.iter().enumerate() {
                    let column = (x / BLOCK + dx).saturating_sub(1).min(columns - 1);
                    let [first, second] = &seen[row + column];
                    let mut light = self.palette.band(first, band);
                    if second.light.sun + second.light.sky > 0.0 {
                        light += self.palette.band(second, band);
                    }
                    sum += wx * wy * light;
                }
            }
            sum
        })
    }

    /// The dark reference, recorded with the lens covered.
    pub fn dark(&self, seed: u64) -> Vec<u16> {
        self.expose(self.exposure_nanos, seed, |_, _| 0.0)
    }

    /// The white reference: a target that faces the sun under the open sky and fills the image.
    pub fn white(&self, seed: u64) -> Vec<u16> {
        self.expose(WHITE_EXPOSURE_NANOS, seed, |_, _| WHITE_REFLECTANCE)
    }

    /// A ray through a block; `None` outside the field of view.
    fn sample(&self, exposure: &Exposure<'_>, i: usize) -> Option<Sample> {
        let center = self.rays[i]?;
        let columns = self.blocks[0];
        let x = i % columns;
        let y = i / columns;
        let random = hash(i as u64, 0x3051);
        // A random point in the block; the rays of neighboring blocks give its angular size.
        let toward = |neighbor: usize, random: u64| {
            let ray = self.rays.get(neighbor).copied().flatten();
            ray.map_or_else(Vec3::zeros, |ray| (ray - center) * (unit(random) - 0.5))
        };
        let across = if x + 1 < columns { toward(i + 1, random) } else { Vec3::zeros() };
        let direction = (center + across + toward(i + columns, random << 24)).normalize();
        let instant = stratified(x % 3 + 3 * (y % 3), STRATA, random);
        let ray = exposure.ray(instant, &direction, i as u64);
        Some(Sample { instant, ray, at: [x as f32, y as f32] })
    }

    /// Samples of a sensor chip whose pixels receive `reflectance([x, y] in the active area, band)` of a white in full
    /// light.
    fn expose(
        &self,
        exposure_nanos: u64,
        seed: u64,
        reflectance: impl Fn([usize; 2], usize) -> f32 + Sync,
    ) -> Vec<u16> {
        let exposure_ms = exposure_nanos as f32 * 1e-6;
        let [left, top, ..] = self.model.active_area;
        let [columns, rows] = self.model.cells();
        let pattern = self.model.pattern;
        let mut samples = vec![0_u16; SIZE[0] * SIZE[1]];
        samples.par_chunks_mut(SIZE[0]).enumerate().for_each(|(v, row)| {
            let in_rows = (top..top + rows * pattern).contains(&v);
            for (u, sample) in row.iter_mut().enumerate() {
                let light = if in_rows && (left..left + columns * pattern).contains(&u) {
                    let x = u - left;
                    let y = v - top;
                    let band = y % pattern * pattern + x % pattern;
                    reflectance([x, y], band) * self.counts_per_ms[band] * exposure_ms * shading(u, v)
                } else {
                    0.0
                };
                *sample = self.chip.read_out([u, v], light, exposure_ms, seed);
            }
        });
        samples
    }
}

/// Counts per ms of a perfect white in full light, by band.
fn counts_per_ms(filters: &[Filter]) -> Vec<f32> {
    let sunlight = sunlight();
    let skylight = skylight();
    let white = Spectrum::from_fn(|_| 1.0);
    let signal = |filter: &Filter| {
        filter.signal(&white, &sunlight) + crate::light::SKY_STRENGTH * filter.signal(&white, &skylight)
    };
    let signals: Vec<f32> = filters.iter().map(signal).collect();
    let strongest = signals.iter().copied().fold(0.0, f32::max);
    let per_ms = WHITE_LEVEL / (WHITE_REFLECTANCE * WHITE_EXPOSURE_NANOS as f32 * 1e-6);
    signals.iter().map(|signal| signal / strongest * per_ms).collect()
}

/// Weights of the previous, own and next block for pixel `at` (0 or 1) of a block.
fn spread(at: usize) -> [f32; 3] {
    let from_middle = at as f32 - 0.5 * (BLOCK - 1) as f32;
    let weights = [-1.0, 0.0, 1.0].map(|block| {
        let off = (block * BLOCK as f32 - from_middle) / SPREAD_PX;
        (-0.5 * off * off).exp()
    });
    let sum: f32 = weights.iter().sum();
    weights.map(|weight| weight / sum)
}

/// Vignetting: a quarter of the light is lost in the corners.
fn shading(u: usize, v: usize) -> f32 {
    let from_middle = |at: usize, side: usize| (at as f32 + 0.5) / side as f32 - 0.5;
    1.0 - 0.5 * (from_middle(u, SIZE[0]).powi(2) + from_middle(v, SIZE[1]).powi(2))
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
                        let v = top + row * n + band / n;
                        let u = left + column * n + band % n;
                        sum += f32::from(samples[v * SIZE[0] + u]);
                    }
                }
                sum / (rows * columns) as f32
            })
            .collect()
    }

    #[test]
    fn mosaic_reflectance_is_recovered_from_dark_and_white_references() {
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
                // The dark level at the exposure of the white reference is 0.35 counts higher than the subtracted one.
                let signal = camera.counts_per_ms[band] * 12.0;
                assert!((reflectance - truth).abs() < 0.004 + truth / signal, "{} {band}: {reflectance}", model.name);
            }
        }
    }

    #[test]
    fn mosaic_bands_are_distinct_and_within_range() {
        for model in [MosaicModel::hs02(), MosaicModel::hs03()] {
            assert_eq!(model.bands().len(), model.pattern * model.pattern);
            let mut centers: Vec<f32> = model.bands().iter().map(|band| band.center_nm).collect();
            centers.sort_by(f32::total_cmp);
            assert!(centers.windows(2).all(|pair| pair[1] - pair[0] > 3.0));
            let [low, high] = model.range_nm.map(|nm| nm as f32);
            assert!(centers.iter().all(|center| (low..high + 2.0).contains(center)));
        }
        assert_eq!((MosaicModel::hs02().cells(), MosaicModel::hs03().cells()), ([409, 217], [512, 256]));
    }
}
