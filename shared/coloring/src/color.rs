//! The `color` column.

use crate::candidates::Candidates;
use crate::choice::Choices;
use crate::chunk::{CHUNK, Chunk};
use crate::color_image::ColorImage;
use crate::gains::ExposureGains;
use messages::{ColorRow, UNSEEN};
use rayon::prelude::*;

/// Writes the color of every point into `rows`, one row per point, and returns the number of points with a color. `images`
/// belong to the exposures by index. With `is_leveled`, the brightness of exposures is leveled, and an exposure that is
/// saturated or black at a point is replaced by another one.
pub fn color_into(
    candidates: &Candidates<'_>,
    images: &[ColorImage<'_>],
    is_leveled: bool,
    rows: &mut [ColorRow],
) -> u64 {
    let gains = is_leveled.then(|| ExposureGains::estimate(candidates, images));
    let color_chunk = |(choices, chunk): &mut (Choices, Chunk), (index, rows): (usize, &mut [ColorRow])| {
        candidates.points.read_chunk(index, chunk);
        choices.choose(chunk, candidates);
        rows.fill(UNSEEN_ROW);
        let mut n_seen = 0;
        for (i, exposure, pixel) in choices.chosen() {
            rows[i] = match &gains {
                Some(gains) => leveled_color(gains, candidates, images, chunk, (i, exposure, pixel)),
                None => images[exposure].sample(pixel),
            };
            n_seen += 1;
        }
        n_seen
    };
    rows.par_chunks_mut(CHUNK).enumerate().map_init(Default::default, color_chunk).sum()
}

/// The leveled color of point `i` of a chunk in the chosen exposure. If that is saturated or black there, the color of the
/// next best exposure that is not.
pub fn leveled_color(
    gains: &ExposureGains,
    candidates: &Candidates<'_>,
    images: &[ColorImage<'_>],
    chunk: &Chunk,
    (i, exposure, pixel): (usize, usize, [f32; 2]),
) -> ColorRow {
    let row = images[exposure].sample(pixel);
    if is_well_exposed(row) {
        return gains.leveled(row, exposure);
    }
    let is_good = |exposure: usize, pixel| is_well_exposed(images[exposure].sample(pixel));
    let (exposure, pixel) = Choices::best_where(i, chunk, candidates, is_good).unwrap_or((exposure, pixel));
    gains.leveled(images[exposure].sample(pixel), exposure)
}

/// Whether no channel is saturated and not all are zero.
fn is_well_exposed(row: ColorRow) -> bool {
    let brightest = row.r.max(row.g).max(row.b);
    (4..254).contains(&brightest)
}

const UNSEEN_ROW: ColorRow = ColorRow { r: 0, g: 0, b: 0, camera: UNSEEN };
