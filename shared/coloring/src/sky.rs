//! Detection of pixels that show the sky: leaves, poles and roof edges often share their pixel with the sky behind them.
//!
//! Only pixels at the rim of the LiDAR hits are tested: everywhere else there is another surface behind the point.
//!
//! The sky returns no pulse. Its colors are therefore frequent where there are no points, and rare on points. The test is
//! a likelihood ratio of two color histograms, as in skin detection (Jones and Rehg, "Statistical Color Models with
//! Application to Skin Detection", IJCV 2002). White walls and cars return pulses, and keep their color even below white
//! clouds. The sky is also brighter than most of a street, which distinguishes it from roofs and facades above the
//! highest ring.
//!
//! Where the sky shines through leaves, the color is a mixture of both. Such pixels are brighter and bluer than the
//! darkest pixels around them. Leaves in the sun are brighter, but not bluer.

mod background;
mod histogram;
mod rim;
mod tint;

use crate::color_image::ColorImage;
use crate::exposure::PosedExposure;
use crate::visibility::VisibilityMap;
use background::Background;
use histogram::{ColorSet, Counts};
use messages::ColorRow;
use rayon::prelude::*;
use rim::RimMap;
use tint::Tint;

/// Largest share of the sky in a color interpolated between four pixels, in 1/65536: a fifth.
const MAX_SHARE: u64 = (1 << 16) / 5;

/// Neighboring cells that may also show a point: a LiDAR beam is as wide as a cell.
const REACH: usize = 1;

/// The sky shines through if the brightness exceeds the reference by this share of the difference between sky and
/// reference.
const MIN_RISE: f32 = 0.15;

/// Limit for the share of blue, analogous to `MIN_RISE`: the brighter part of a mixture dominates it.
const MIN_BLUEING: f32 = 0.4;

/// Least difference in the share of blue between sky and reference. Gray poles differ by less, and their brightness alone
/// is not evidence of sky.
const MIN_CONTRAST: f32 = 0.03;

/// The sky in the exposures of a submap.
#[derive(Debug)]
pub struct Sky {
    colors: ColorSet,
    /// The background of each exposure, by index.
    backgrounds: Vec<Background>,
}

impl Sky {
    /// Learns the colors from all exposures. `visibility[i]` and `images[i]` belong to exposure `i`.
    pub fn learn(exposures: &[PosedExposure<'_>], visibility: &[VisibilityMap], images: &[ColorImage<'_>]) -> Self {
        let of_exposure = |((exposure, visibility), image)| {
            let rim = RimMap::new(visibility);
            (Counts::new(exposure, visibility, &rim, image), Background::new(visibility.grid, rim, image))
        };
        let all = exposures.par_iter().zip(visibility).zip(images);
        let (counts, backgrounds): (Vec<Counts>, Vec<Background>) = all.map(of_exposure).unzip();
        let mut sum = Counts::default();
        for counts in &counts {
            sum.add(counts);
        }
        Self { colors: sum.sky(), backgrounds }
    }

    /// The given pixel of exposure `exposure`, or the nearest pixel in reach, that neither shows the sky nor lets it
    /// shine through. `image` is the image of the exposure.
    pub fn clear_pixel(&self, exposure: usize, image: &ColorImage<'_>, pixel: [f32; 2]) -> Option<[f32; 2]> {
        let background = &self.backgrounds[exposure];
        let (Some(sky), Some(reference)) = (self.colors.mean, background.reference(image, pixel)) else {
            return Some(pixel);
        };
        let ColorRow { r, g, b, .. } = image.sample(pixel);
        if !shines_through([r, g, b], reference, sky) && !self.shows(image, pixel) {
            return Some(pixel);
        }
        let is_clear = |color| !self.colors.contains(color) && !shines_through(color, reference, sky);
        let around = image.around(pixel, REACH, background.step);
        let clear = around.filter(|(_, color)| is_clear(*color)).map(|(at, _)| at);
        let distance2 = |at: &[f32; 2]| (at[0] - pixel[0]).powi(2) + (at[1] - pixel[1]).powi(2);
        clear.min_by(|a, b| distance2(a).total_cmp(&distance2(b)))
    }

    /// Whether the sky contributes more than a fifth of the color at (u, v).
    pub fn shows(&self, image: &ColorImage<'_>, pixel: [f32; 2]) -> bool {
        let share = image.corners(pixel).map(|(at, share)| if self.colors.contains(image.at(at)) { share } else { 0 });
        share.iter().sum::<u64>() > MAX_SHARE
    }
}

/// Whether a color exceeds the reference in brightness and blueness by the least shares of the difference to the sky.
fn shines_through(color: [u8; 3], reference: Tint, sky: Tint) -> bool {
    let color = Tint::from_rgb(color);
    let rise = sky.level - reference.level;
    let blueing = sky.blue - reference.blue;
    blueing >= MIN_CONTRAST
        && color.level - reference.level > MIN_RISE * rise.max(0.0)
        && color.blue - reference.blue > MIN_BLUEING * blueing
}
