//! Pixels of `sensor_msgs/Image` by its encoding.

use crate::ros::messages::Image;
use spectral::{Demosaicer, Demosaicing};
use std::borrow::Cow;

/// 8-bit pixels, row by row without gaps.
#[derive(Debug, PartialEq)]
pub(super) enum Pixels<'a> {
    Gray(Cow<'a, [u8]>),
    Rgb(Cow<'a, [u8]>),
}

impl std::ops::Deref for Pixels<'_> {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        match self {
            Self::Gray(pixels) | Self::Rgb(pixels) => pixels,
        }
    }
}

/// Encodings of 8 bits.
const ENCODINGS: &str =
    "rgb8, rgba8, bgr8, bgra8, 8UC3, mono8, 8UC1, bayer_rggb8, bayer_bggr8, bayer_gbrg8, bayer_grbg8";

pub(super) fn of_image<'a>(image: &Image<'a>) -> Result<Pixels<'a>, String> {
    // Places of red, green and blue in a pixel.
    let color = |n_bytes: usize, places: [usize; 3]| {
        let rows = rows(image, n_bytes)?;
        let pixels = rows.chunks_exact(n_bytes).flat_map(|pixel| places.map(|place| pixel[place])).collect();
        Ok(Pixels::Rgb(Cow::Owned(pixels)))
    };
    match image.encoding.as_str() {
        "rgb8" => Ok(Pixels::Rgb(rows(image, 3)?)),
        "rgba8" => color(4, [0, 1, 2]),
        // OpenCV's order.
        "bgr8" | "8UC3" => color(3, [2, 1, 0]),
        "bgra8" => color(4, [2, 1, 0]),
        "mono8" | "8UC1" => Ok(Pixels::Gray(rows(image, 1)?)),
        "bayer_rggb8" => bayer(image, [0, 1, 1, 2]),
        "bayer_bggr8" => bayer(image, [2, 1, 1, 0]),
        "bayer_gbrg8" => bayer(image, [1, 2, 0, 1]),
        "bayer_grbg8" => bayer(image, [1, 0, 2, 1]),
        other => Err(format!("encoding {other:?} must be one of {ENCODINGS}")),
    }
}

/// The rows without the gaps between them.
fn rows<'a>(image: &Image<'a>, pixel_bytes: usize) -> Result<Cow<'a, [u8]>, String> {
    let (height, step) = (image.height as usize, image.step as usize);
    let row_bytes = image.width as usize * pixel_bytes;
    let n_bytes = if height == 0 { 0 } else { step.saturating_mul(height - 1).saturating_add(row_bytes) };
    if row_bytes == 0 || height == 0 || step < row_bytes || n_bytes > image.data.len() {
        let (width, found) = (image.width, image.data.len());
        return Err(format!(
            "{width} x {height} pixels of {pixel_bytes} bytes in rows of {step} bytes need {n_bytes} bytes; {found} are there"
        ));
    }
    if step == row_bytes {
        return Ok(Cow::Borrowed(&image.data[..n_bytes]));
    }
    Ok(Cow::Owned(image.data.chunks(step).take(height).flat_map(|row| &row[..row_bytes]).copied().collect()))
}

/// Colors (0 red, 1 green, 2 blue) of the four cells of the filter, row by row.
fn bayer<'a>(image: &Image<'a>, colors: [usize; 4]) -> Result<Pixels<'a>, String> {
    let samples: Vec<f32> = rows(image, 1)?.iter().map(|value| f32::from(*value) / 255.0).collect();
    let (width, height) = (image.width as usize, image.height as usize);
    let fault = |error: spectral::SpectralError| error.to_string();
    let mut demosaicer = Demosaicer::new(width, height, 2).map_err(fault)?;
    let mut pixels = Vec::with_capacity(3 * samples.len());
    let take = |bands: &[f32]| {
        for x in 0..width {
            let mut sums = [0.0; 3];
            for (band, color) in colors.iter().enumerate() {
                // Green has two of the four cells.
                sums[*color] += bands[band * width + x] * if *color == 1 { 0.5 } else { 1.0 };
            }
            pixels.extend(sums.map(|value| (value * 255.0).round().clamp(0.0, 255.0) as u8));
        }
    };
    demosaicer.demosaic_rows(&samples, Demosaicing::PpiDifference, take).map_err(fault)?;
    Ok(Pixels::Rgb(Cow::Owned(pixels)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ros::messages::Header;

    fn image<'a>(encoding: &str, [width, height, step]: [u32; 3], data: &'a [u8]) -> Image<'a> {
        let header = Header { stamp: 0, frame: String::new() };
        Image { header, height, width, encoding: encoding.into(), step, data }
    }

    #[test]
    fn pixels_of_all_orders_become_rgb() {
        let rgb = |pixels: &[u8]| Pixels::Rgb(pixels.to_vec().into());
        for (encoding, data) in [
            ("rgb8", &[1, 2, 3, 9][..]),
            ("bgr8", &[3, 2, 1, 9]),
            ("8UC3", &[3, 2, 1, 9]),
            ("rgba8", &[1, 2, 3, 7]),
            ("bgra8", &[3, 2, 1, 7]),
        ] {
            assert_eq!(of_image(&image(encoding, [1, 1, 4], data)), Ok(rgb(&[1, 2, 3])), "{encoding}");
        }
        let gray = of_image(&image("mono8", [2, 2, 3], &[1, 2, 0, 3, 4])).expect("converts");
        assert_eq!(gray, Pixels::Gray(vec![1, 2, 3, 4].into()));
    }

    #[test]
    fn bayer_patterns_become_the_color_of_an_even_image() {
        for (encoding, cells) in [
            ("bayer_rggb8", [10, 20, 20, 30]),
            ("bayer_bggr8", [30, 20, 20, 10]),
            ("bayer_gbrg8", [20, 30, 10, 20]),
            ("bayer_grbg8", [20, 10, 30, 20]),
        ] {
            let [a, b, c, d] = cells;
            let data: Vec<u8> = (0..3).flat_map(|_| [[a, b].repeat(4), [c, d].repeat(4)].concat()).collect();
            let pixels = of_image(&image(encoding, [8, 6, 8], &data)).expect("converts");
            assert!(
                pixels.len() == 144 && pixels.chunks(3).all(|pixel| pixel == [10, 20, 30]),
                "{encoding}: {pixels:?}"
            );
        }
    }

    #[test]
    fn images_that_leave_their_data_are_refused() {
        for (encoding, size, rule) in [
            ("rgb8", [2, 2, 6], "need 12 bytes; 11 are there"),
            ("rgb8", [2, 2, 5], "in rows of 5 bytes"),
            ("rgb8", [0, 2, 6], "0 x 2 pixels"),
            ("mono8", [u32::MAX, u32::MAX, u32::MAX], "are there"),
            ("16UC1", [2, 2, 4], "encoding \"16UC1\" must be one of rgb8"),
            ("bayer_rggb8", [3, 2, 3], "complete cells"),
        ] {
            let error = of_image(&image(encoding, size, &[0; 11])).expect_err(rule);
            assert!(error.contains(rule), "{error}");
        }
    }
}
