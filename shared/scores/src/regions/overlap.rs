//! Overlap of superpixels with the segments of a segmentation, and the variation of colors that they explain.

use super::LabelImage;
use std::collections::BTreeMap;

/// Overlap of superpixels with the segments of a segmentation. All values are shares of the pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OverlapScores {
    /// Pixels outside the segment with the largest overlap of their superpixel (Van den Bergh et al.).
    pub under_segmentation_bergh: f64,
    /// Sum over pairs of superpixel and segment of the smaller part, inside or outside (Neubert and Protzel). 0 to
    /// about 1.
    pub under_segmentation_np: f64,
    /// Achievable segmentation accuracy: 1 - `under_segmentation_bergh`.
    pub achievable_accuracy: f64,
}

/// Compares regions. Both images must have the same size.
pub fn overlap_scores(superpixels: &LabelImage<'_>, segmentation: &LabelImage<'_>) -> OverlapScores {
    let mut overlaps: BTreeMap<(u32, u32), u64> = BTreeMap::new();
    for pair in superpixels.labels.iter().zip(segmentation.labels) {
        *overlaps.entry((*pair.0, *pair.1)).or_default() += 1;
    }
    let areas = superpixels.areas();
    let mut largest = vec![0; areas.len()];
    let mut smaller_parts = 0;
    for ((superpixel, _), overlap) in &overlaps {
        let superpixel = *superpixel as usize;
        largest[superpixel] = overlap.max(&largest[superpixel]).to_owned();
        smaller_parts += overlap.min(&(areas[superpixel] - overlap));
    }
    let n_pixels = superpixels.labels.len() as f64;
    let achievable_accuracy = largest.iter().sum::<u64>() as f64 / n_pixels;
    OverlapScores {
        under_segmentation_bergh: 1.0 - achievable_accuracy,
        under_segmentation_np: smaller_parts as f64 / n_pixels,
        achievable_accuracy,
    }
}

/// Share of the variance of an image, band-sequential, that is between regions (Moore et al.), 0 to 1. 1 for a flat image.
pub fn explained_variation(image: &LabelImage<'_>, values: &[f32]) -> f64 {
    let areas = image.areas();
    let mut between = 0.0;
    let mut all = 0.0;
    for band in values.chunks_exact(image.labels.len()) {
        let mut sums = vec![0.0; areas.len()];
        image.labels.iter().zip(band).for_each(|(label, value)| sums[*label as usize] += f64::from(*value));
        let mean = sums.iter().sum::<f64>() / band.len() as f64;
        for (sum, area) in sums.iter().zip(&areas).filter(|(_, area)| **area > 0) {
            between += (sum / *area as f64 - mean).powi(2) * *area as f64;
        }
        all += band.iter().map(|value| (f64::from(*value) - mean).powi(2)).sum::<f64>();
    }
    if all > 0.0 { between / all } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn superpixel_over_two_segments_leaks_its_smaller_part() {
        // Superpixel 1 has 3 px in segment 0 and 1 in segment 1; superpixel 2 lies in segment 1.
        let superpixels = [1, 1, 1, 1, 2, 2, 2, 2];
        let segments = [0, 0, 0, 1, 1, 1, 1, 1];
        let image = |labels| LabelImage::new(8, labels).expect("an image");
        let found = overlap_scores(&image(&superpixels), &image(&segments));
        assert_eq!(found.under_segmentation_bergh, 0.125);
        assert_eq!(found.under_segmentation_np, 0.25);
        assert_eq!(found.achievable_accuracy, 0.875);
    }

    #[test]
    fn regions_explain_the_variance_between_them() {
        let labels = [0, 0, 1, 1];
        let image = LabelImage::new(4, &labels).expect("an image");
        // Mean 5, region means 2 and 8: 4 * 9 of 4 * 9 + 4.
        assert_eq!(explained_variation(&image, &[1.0, 3.0, 7.0, 9.0]), 0.9);
        assert_eq!(explained_variation(&image, &[1.0; 4]), 1.0);
    }
}
