//! Color cameras: wide-angle lens, motion blur, automatic gain, and sensor noise.
//!
//! Every pixel is sampled once in the middle of the exposure. Pixels that differ from their neighbors (edges, texture)
//! are sampled at four more points, each in a different quarter of the exposure. Edges are therefore antialiased, and
//! close moving objects are blurred.

mod develop;

use super::exposure::{Exposure, MIDDLE, stratified};
use super::lens::{FAR_M, lens_rays};
use super::look::{Palette, Sample, Seen};
use super::sky_view::SkyView;
use crate::sensors::filter::Filter;
use develop::{Rgb, develop, tone};
use geometry::CameraModel;
use random::{hash, unit};
use rayon::prelude::*;
use raytrace::Vec3;

/// Center and standard deviation of the red, green and blue filters, nm.
const FILTERS: [(f32, f32); 3] = [(616.0, 28.0), (541.0, 28.0), (462.0, 25.0)];
/// Grid spacing of the sky view, px.
const SKY_STEP: usize = 8;
/// Grid spacing of the exposure metering, px.
const METER_STEP: usize = 16;
/// Target mean of the metered levels, clipped at 1.
const METER_LEVEL: f32 = 0.29;
/// Range of the automatic gain.
const GAINS: [f32; 2] = [0.25, 8.0];
/// Pixels whose level after the tone curve differs by more than this (of 1) from a neighbor get more samples.
const CONTRAST: f32 = 0.035;
/// Additional samples of such pixels.
const FINE: usize = 4;

/// A color camera with its response to each material.
#[derive(Debug)]
pub struct ColorCamera {
    width: u32,
    height: u32,
    rays: Vec<Option<Vec3>>,
    /// Vignetting: share of the light that reaches a pixel.
    shading: Vec<f32>,
    palette: Palette,
}

impl ColorCamera {
    /// A camera with a lens.
    pub fn new(model: &CameraModel) -> Self {
        let (width, height) = model.size();
        let pixels = (0..height).flat_map(|v| (0..width).map(move |u| [f64::from(u), f64::from(v)]));
        let rays = lens_rays(model, pixels);
        // As in a retrofocus lens: 0.62 at 60 degrees from the axis.
        let shading =
            rays.iter().map(|ray| ray.map_or(0.0, |ray| 1.0 - 0.38 * (ray.z.acos() / 1.05).powi(2))).collect();
        let filters = FILTERS.map(|(center, sigma)| Filter::gauss(center, sigma));
        // White balance close to sunlight, as cameras choose it in sunny streets: shadows are bluish.
        let palette = Palette::new(&filters, |sun, sky| sun + 0.4 * sky);
        Self { width, height, rays, shading, palette }
    }

    /// Columns and rows.
    pub const fn size(&self) -> [u32; 2] {
        [self.width, self.height]
    }

    /// Automatic gain for exposures of cameras that fire together.
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
        // The mean rises with the gain: bisection in stops, to a twentieth of a stop.
        let [mut low, mut high] = GAINS.map(f32::log2);
        while high - low > 0.05 {
            let middle = 0.5 * (low + high);
            if mean_at(middle.exp2(), &levels) < METER_LEVEL { low = middle } else { high = middle }
        }
        (0.5 * (low + high)).exp2()
    }

    /// The image at a gain: sRGB, row-major.
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
            let refined: Vec<usize> = row.clone().filter(|i| self.needs_samples(&levels, *i)).collect();
            let samples: Vec<Option<Sample>> = refined.iter().flat_map(|i| self.fine(exposure, *i)).collect();
            let seen = self.palette.look_at_some(exposure, &sky, &samples);
            let mut light = first[row].to_vec();
            for (i, seen) in refined.iter().zip(seen.chunks(FINE)) {
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

    /// Share of the light of a pixel that comes from the sky, from the samples of a refined pixel: 0 to 1.
    pub fn sky_share(&self, exposure: &Exposure<'_>, [u, v]: [usize; 2]) -> f32 {
        let i = v * self.width as usize + u;
        let samples = std::iter::once(self.sample(exposure, i, MIDDLE, [0.0; 2], 0)).chain(self.fine(exposure, i));
        let shows_sky = |Sample { instant, ray, .. }: Sample| {
            exposure.scene.cast(exposure.snapshot(instant), &ray, FAR_M).is_none()
        };
        let n_sky = samples.flatten().filter(|sample| shows_sky(*sample)).count();
        n_sky as f32 / (FINE + 1) as f32
    }

    const fn sides(&self) -> [usize; 2] {
        [self.width as usize, self.height as usize]
    }

    /// Whether a pixel differs from its neighbors.
    fn needs_samples(&self, levels: &[f32], i: usize) -> bool {
        let [width, height] = self.sides();
        let u = i % width;
        let v = i / width;
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
            // The pairing of pixel quarter and exposure quarter changes from pixel to pixel.
            let instant = stratified(k + i % FINE + i / self.width as usize, FINE, random);
            self.sample(exposure, i, instant, offset, k as u64 + 1)
        })
    }

    /// One ray through a pixel, `offset` px from its center; `None` outside the field of view.
    fn sample(&self, exposure: &Exposure<'_>, i: usize, instant: usize, offset: [f32; 2], k: u64) -> Option<Sample> {
        let width = self.width as usize;
        let center = self.rays[i]?;
        // The rays of the neighbors give the angular size of a pixel.
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
