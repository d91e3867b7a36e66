//! Range images of sensors whose firings are farther apart than the columns: an OS1 with 1024 columns, an HDL-32E at 20
//! Hz. Networks are trained on images without such gaps and confuse the stripes with porous objects, so the gaps show
//! the adjacent point.

use geometry::{NO_POINT, RangeImage};
use messages::SubmapPoint;
use std::borrow::Cow;

/// Azimuths of successive firings of a ring differ by less than this, 0.01 deg. Larger differences are lost returns.
const STEPS: usize = 256;

/// The point that each pixel shows: the point of the pixel, otherwise the point of a pixel to the left that is nearer
/// than the next firing.
pub(super) fn shown_points<'a>(image: &'a RangeImage, points: &[SubmapPoint]) -> Cow<'a, [u32]> {
    let gap = columns_per_firing(points, image.columns).saturating_sub(1);
    if gap == 0 {
        return Cow::Borrowed(&image.nearest);
    }
    let filled = image.nearest.chunks_exact(image.columns).flat_map(|row| {
        (0..image.columns).map(move |column| {
            let to_the_left = (0..=gap).map(|back| row[(column + image.columns - back) % image.columns]);
            to_the_left.into_iter().find(|point| *point != NO_POINT).unwrap_or(NO_POINT)
        })
    });
    Cow::Owned(filled.collect())
}

/// Columns from one firing of a ring to the next, rounded: the median over a sweep. 1 if it is unknown.
fn columns_per_firing(points: &[SubmapPoint], columns: usize) -> usize {
    let mut last = [None; 256];
    let mut counts = [0_usize; STEPS];
    for point in points {
        let of_ring = &mut last[usize::from(point.ring)];
        if let Some(before) = of_ring.replace(point.azimuth) {
            let step = usize::from(point.azimuth.abs_diff(before));
            let step = step.min(36_000_usize.saturating_sub(step));
            if (1..STEPS).contains(&step) {
                counts[step] += 1;
            }
        }
    }
    let half = counts.iter().sum::<usize>().div_ceil(2);
    let mut below = 0;
    let median = counts.iter().position(|count| {
        below += count;
        half > 0 && below >= half
    });
    median.map_or(1, |step| ((step * columns) as f64 / 36_000.0).round().max(1.0) as usize)
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::column_of_azimuth;

    /// Two rings of `n` firings; every tenth has no return.
    fn sweep(n: u16) -> Vec<SubmapPoint> {
        let azimuth = |firing: u16| (u32::from(firing) * 36_000).div_ceil(u32::from(n)) as u16;
        let of_firing =
            |firing| [0, 1].map(|ring| SubmapPoint { azimuth: azimuth(firing), ring, ..Default::default() });
        (0..n).filter(|firing| firing % 10 != 3).flat_map(of_firing).collect()
    }

    fn image(points: &[SubmapPoint]) -> RangeImage {
        let placed =
            points.iter().map(|point| (Some((usize::from(point.ring), column_of_azimuth(point.azimuth, 2048))), 5.0));
        RangeImage::new(2, 2048, placed)
    }

    #[test]
    fn sensor_as_fine_as_the_image_shows_each_point_once() {
        for n in [1800, 2048, 2170] {
            let points = sweep(n);
            let image = image(&points);
            assert!(matches!(shown_points(&image, &points), Cow::Borrowed(_)), "{n}");
        }
    }

    #[test]
    fn gaps_between_firings_show_the_point_to_the_left_and_lost_returns_stay_empty() {
        let points = sweep(1024);
        let image = image(&points);
        let shown = shown_points(&image, &points);
        assert_eq!(image.nearest.iter().filter(|point| **point == NO_POINT).count(), 4096 - points.len());
        for (pixel, point) in shown.iter().enumerate() {
            let firing = pixel % 2048 / 2;
            let expected = if firing % 10 == 3 { NO_POINT } else { image.nearest[pixel / 2 * 2] };
            assert_eq!(*point, expected, "{pixel}");
        }
    }

    #[test]
    fn sweep_without_steps_is_taken_as_it_is() {
        assert_eq!(columns_per_firing(&[], 2048), 1);
        assert_eq!(columns_per_firing(&[SubmapPoint::default(); 3], 2048), 1);
    }
}
