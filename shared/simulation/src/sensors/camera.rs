//! The color cameras: wide-angle, with a shutter that moves with the vehicle, automatic gain, and the noise of small pixels.
//!
//! Every pixel is sampled once in the middle of the exposure; where it differs from its neighbors (edges, texture), at four
//! more places within the pixel, each at its own quarter of the exposure. So edges are smooth, and what passes nearby is
//! blurred as far as it moved.

mod develop;

use super::exposure::{Exposure, MIDDLE, stratified};
use super::lens_rays;
use super::look::{Palette, Sample, Seen};
use super::sky_view::SkyView;
use crate::random::{hash, unit};
use crate::spectrum::Filter;
use crate::trace::Vec3;
use develop::{develop, tone};
use geometry::CameraModel;
use rayon::prelude::*;

/// Middle and standard deviation of the red, green and blue filters, nm.
const FILTERS: [(f32, f32); 3] = [(616.0, 28.0), (541.0, 28.0), (462.0, 25.0)];
/// Places of the pictures' sky view, px apart.
const SKY_STEP: usize = 8;
/// Places at which the exposure is metered, px apart.
const METER_STEP: usize = 16;
/// The meter brings the mean of what it sees (whites clipped) to this level.
const METER_LEVEL: f32 = 0.29;
/// Range of the automatic gain: below, the shutter is too long; above, noise would be all.
const GAINS: [f32; 2] = [0.25, 8.0];
/// Levels after the tone curve that differ by more, out of 1, are sampled more.
const CONTRAST: f32 = 0.035;
/// Samples of such pixels beside the first.
const FINE: usize = 4;

/// Light by color: 1 fills the sensor at gain 1.
type Rgb = [f32; 3];

/// A color camera and how it sees materials.
#[derive(Debug)]
pub struct ColorCamera {
    width: u32,
    height: u32,
    rays: Vec<Option<Vec3>>,
    /// Share of the light that arrives at a pixel: the lens is darker to its rim.
    shading: Vec<f32>,
    palette: Palette,
}

impl ColorCamera {
    /// For a lens.
    pub fn new(model: &CameraModel) -> Self {
        let (width, height) = model.size();
        let pixels = (0..height).flat_map(|v| (0..width).map(move |u| [f64::from(u), f64::from(v)]));
        let rays = lens_rays(model, pixels);
        // Between the square of the cosine and none, as a retrofocus lens: 0.62 at 60 degrees from the axis.
        let shading =
            rays.iter().map(|ray| ray.map_or(0.0, |ray| 1.0 - 0.38 * (ray.z.acos() / 1.05).powi(2))).collect();
        let filters = FILTERS.map(|(center, sigma)| Filter::gauss(center, sigma));
        // White balance near the sun, as cameras choose it in sunny streets: shadows are cool.
        let palette = Palette::new(&filters, |sun, sky| sun + 0.4 * sky);
        Self { width, height, rays, shading, palette }
    }

    /// Columns and rows.
    pub const fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    /// The gain that the exposures of cameras that fire together ask for.
    pub fn meter(&self, exposures: &[Exposure<'_>]) -> f32 {
        let [width, height] = self.sides();
        let mean_at = |gain: f32, levels: &[f32]| {
            levels.iter().map(|level| (level * gain).min(1.0)).sum::<f32>() / levels.len().max(1) as f32
        };
        let sample = |exposure: &Exposure<'_>, u: usize, v: usize| {
            let direction = self.rays[v * width + u]?;
            let ray = exposure.ray(MIDDLE, &direction, (v * width + u) as u64);
            Some(Sample { instant: MIDDLE, ray, at: [u as f32, v as f32] })
        };
        let row = |exposure: &Exposure<'_>, sky: &SkyView, v: usize| -> Vec<f32> {
            let across = (METER_STEP / 2..width).step_by(METER_STEP);
            let samples: Vec<Sample> = across.filter_map(|u| sample(exposure, u, v)).collect();
            self.palette.look(exposure, sky, &samples).iter().map(|seen| self.color(seen)[1]).collect()
        };
        let rows: Vec<usize> = (METER_STEP / 2..height).step_by(METER_STEP).collect();
        let levels: Vec<f32> = exposures
            .iter()
            .flat_map(|exposure| {
                let sky = SkyView::new(exposure, [width, height], 4 * SKY_STEP, |u, v| self.rays[v * width + u]);
                rows.par_iter().flat_map_iter(|v| row(exposure, &sky, *v)).collect::<Vec<f32>>()
            })
            .collect();
        // The mean rises with the gain: halve the interval in stops; a twentieth of a stop is not seen.
        let [mut low, mut high] = GAINS.map(f32::log2);
        while high - low > 0.05 {
            let middle = 0.5 * (low + high);
            if mean_at(middle.exp2(), &levels) < METER_LEVEL { low = middle } else { high = middle }
        }
        (0.5 * (low + high)).exp2()
    }

    /// The picture at a gain: sRGB, row-major.
    pub fn shoot(&self, exposure: &Exposure<'_>, gain: f32, seed: u64) -> Vec<u8> {
        let [width, height] = self.sides();
        let sky = SkyView::new(exposure, [width, height], SKY_STEP, |u, v| self.rays[v * width + u]);
        let first_row = |v: usize| {
            let samples: Vec<Option<Sample>> =
                (v * width..(v + 1) * width).map(|i| self.sample(exposure, i, MIDDLE, [0.0; 2], 0)).collect();
            let seen = self.palette.look_at_some(exposure, &sky, &samples);
            seen.into_iter().map(|seen| self.color(&seen)).collect::<Vec<Rgb>>()
        };
        let first: Vec<Rgb> = (0..height).into_par_iter().flat_map_iter(first_row).collect();
        let levels: Vec<f32> =
            first.par_iter().map(|rgb| tone(gain * (rgb[0] + 2.0 * rgb[1] + rgb[2]) / 4.0)).collect();
        let fine_row = |v: usize| {
            let row = v * width..(v + 1) * width;
            let busy: Vec<usize> = row.clone().filter(|i| self.is_busy(&levels, *i)).collect();
            let samples: Vec<Option<Sample>> = busy.iter().flat_map(|i| self.fine(exposure, *i)).collect();
            let seen = self.palette.look_at_some(exposure, &sky, &samples);
            let mut light = first[row].to_vec();
            for (i, seen) in busy.iter().zip(seen.chunks(FINE)) {
                let rgb = &mut light[i % width];
                for seen in seen {
                    let more = self.color(seen);
                    *rgb = std::array::from_fn(|c| rgb[c] + more[c]);
                }
                *rgb = rgb.map(|c| c / (FINE + 1) as f32);
            }
            light
        };
        let light: Vec<Rgb> = (0..height).into_par_iter().flat_map_iter(fine_row).collect();
        develop(&light, &self.shading, gain, seed)
    }

    const fn sides(&self) -> [usize; 2] {
        [self.width as usize, self.height as usize]
    }

    /// Whether a pixel differs from those around it.
    fn is_busy(&self, levels: &[f32], i: usize) -> bool {
        let [width, height] = self.sides();
        let (u, v) = (i % width, i / width);
        let around = [
            (u > 0).then(|| i - 1),
            (u + 1 < width).then_some(i + 1),
            (v > 0).then(|| i - width),
            (v + 1 < height).then_some(i + width),
        ];
        around.into_iter().flatten().any(|near| (levels[near] - levels[i]).abs() > CONTRAST)
    }

    /// A sample in each quarter of the pixel.
    fn fine(&self, exposure: &Exposure<'_>, i: usize) -> [Option<Sample>; FINE] {
        let random = hash(i as u64, 0xf14e);
        std::array::from_fn(|k| {
            let random = hash(random, k as u64);
            let within = |corner: usize, random: u64| 0.5 * (corner as f32 + unit(random)) - 0.5;
            let offset = [within(k % 2, random), within(k / 2, random << 24)];
            // Which quarter of the pixel sees which of the exposure changes from pixel to pixel.
            let instant = stratified(k + i % FINE + i / self.width as usize, FINE, random);
            self.sample(exposure, i, instant, offset, k as u64 + 1)
        })
    }

    /// One ray through a pixel, `offset` px beside its middle; `None` where the lens shows nothing.
    fn sample(&self, exposure: &Exposure<'_>, i: usize, instant: usize, offset: [f32; 2], k: u64) -> Option<Sample> {
        let width = self.width as usize;
        let center = self.rays[i]?;
        // The neighbors' rays say how far a pixel is.
        let toward = |step: usize, share: f32| {
            let neighbor = if share < 0.0 { i.checked_sub(step) } else { Some(i + step) };
            let ray = neighbor.and_then(|n| self.rays.get(n)).copied().flatten();
            ray.map_or_else(Vec3::zeros, |ray| (ray - center) * share.abs())
        };
        let direction = (center + toward(1, offset[0]) + toward(width, offset[1])).normalize();
        let ray = exposure.ray(instant, &direction, (i as u64) << 3 | k);
        let at = [(i % width) as f32 + offset[0], (i / width) as f32 + offset[1]].map(|p| p.max(0.0));
        Some(Sample { instant, ray, at })
    }

    fn color(&self, seen: &Seen) -> Rgb {
        std::array::from_fn(|c| seen.iter().map(|part| self.palette.band(part, c)).sum())
    }
}
