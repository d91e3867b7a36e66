//! The `color` column.

use crate::candidates::Candidates;
use crate::choice::{Choices, PointChoice, ShownPoint};
use crate::chunk::{CHUNK, Chunk};
use crate::color_image::ColorImage;
use crate::gains::ExposureGains;
use crate::sky::Sky;
use messages::{ColorRow, UNSEEN};
use rayon::prelude::*;

/// Optional steps in addition to sampling; all are off by default.
#[derive(Clone, Copy, Debug, Default)]
pub struct ColorSteps {
    /// Level the brightness of exposures. Replace an exposure that is saturated or black at a point by another one.
    pub level_exposures: bool,
    /// Replace a pixel that shows the sky by a neighboring one or by another exposure; if both show the sky, the point
    /// gets no color.
    pub reject_sky: bool,
}

/// The color of a point.
#[derive(Clone, Copy, Debug)]
pub struct PointColor {
    /// Index of the exposure.
    pub exposure: usize,
    /// px.
    pub pixel: [f32; 2],
    /// The color, leveled.
    pub row: ColorRow,
}

/// Samples colors from exposures.
pub struct Sampler<'a> {
    candidates: &'a Candidates<'a>,
    images: &'a [ColorImage<'a>],
    gains: Option<ExposureGains>,
    sky: Option<Sky>,
}

impl<'a> Sampler<'a> {
    /// `images[i]` belongs to exposure `i` of the candidates.
    pub fn new(candidates: &'a Candidates<'a>, images: &'a [ColorImage<'a>], steps: ColorSteps) -> Self {
        let Candidates { exposures, visibility, .. } = *candidates;
        let gains = steps.level_exposures.then(|| ExposureGains::estimate(candidates, images));
        let sky = steps.reject_sky.then(|| Sky::learn(exposures, visibility, images));
        Self { candidates, images, gains, sky }
    }

    /// The color of point `i` of a chunk. It comes from the chosen exposure and pixel. If these are unusable, it comes
    /// from a neighboring pixel or the next best exposure. `None` if the chosen pixel shows the sky and there is no
    /// replacement.
    pub fn sample(&self, chunk: &Chunk, choice: PointChoice) -> Option<PointColor> {
        let PointChoice { i, exposure, pixel } = choice;
        let z = chunk.z[i];
        let clear = self.clear_of_sky(exposure, pixel, z);
        if let Some(pixel) = clear {
            let row = self.images[exposure].sample(pixel);
            if self.is_exposed(row) {
                return Some(self.leveled(row, exposure, pixel));
            }
        }
        let is_good = |exposure: usize, pixel| {
            self.is_exposed(self.images[exposure].sample(pixel)) && self.clear_of_sky(exposure, pixel, z) == Some(pixel)
        };
        let other = Choices::best_where(i, chunk, self.candidates, is_good);
        let is_sky = clear.is_none() && self.sky.as_ref().is_some_and(|sky| sky.shows(&self.images[exposure], pixel));
        let of_choice = ShownPoint { exposure, pixel: clear.unwrap_or(pixel) };
        let ShownPoint { exposure, pixel } = other.or((!is_sky).then_some(of_choice))?;
        Some(self.leveled(self.images[exposure].sample(pixel), exposure, pixel))
    }

    fn leveled(&self, row: ColorRow, exposure: usize, pixel: [f32; 2]) -> PointColor {
        let row = self.gains.as_ref().map_or(row, |gains| gains.leveled(row, exposure));
        PointColor { exposure, pixel, row }
    }

    /// Whether a color is neither saturated nor black; always true if exposures are not leveled.
    fn is_exposed(&self, row: ColorRow) -> bool {
        self.gains.is_none() || is_well_exposed(row)
    }

    /// The pixel of a point with the height `z`, or a neighboring one that does not show the sky.
    fn clear_of_sky(&self, exposure: usize, pixel: [f32; 2], z: f32) -> Option<[f32; 2]> {
        let Some(sky) = &self.sky else { return Some(pixel) };
        // There is no sky below the horizon.
        let is_above = z > self.candidates.exposures[exposure].position[2];
        if is_above { sky.clear_pixel(exposure, &self.images[exposure], pixel) } else { Some(pixel) }
    }
}

/// Writes the color of every point into `rows`, one row per point, and returns the number of points with a color.
/// `images[i]` belongs to exposure `i`.
pub fn color_into(
    candidates: &Candidates<'_>,
    images: &[ColorImage<'_>],
    steps: ColorSteps,
    rows: &mut [ColorRow],
) -> u64 {
    let sampler = Sampler::new(candidates, images, steps);
    let color_chunk = |(choices, chunk): &mut (Choices, Chunk), (index, rows): (usize, &mut [ColorRow])| {
        candidates.points.read_chunk(index, chunk);
        choices.choose(chunk, candidates);
        rows.fill(UNSEEN_ROW);
        let mut n_seen = 0;
        for choice in choices.chosen() {
            let Some(color) = sampler.sample(chunk, choice) else { continue };
            rows[choice.i] = color.row;
            n_seen += 1;
        }
        n_seen
    };
    rows.par_chunks_mut(CHUNK).enumerate().map_init(Default::default, color_chunk).sum()
}

/// Whether no channel is saturated and at least one is not zero.
fn is_well_exposed(row: ColorRow) -> bool {
    let brightest = row.r.max(row.g).max(row.b);
    (4..254).contains(&brightest)
}

const UNSEEN_ROW: ColorRow = ColorRow { r: 0, g: 0, b: 0, camera: UNSEEN };
