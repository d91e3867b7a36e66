//! Pixels of `sensor_msgs/Image`, decoded by their encoding.

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

/// Encodings that are read.
const ENCODINGS: &str = "rgb8, rgba8, bgr8, bgra8, 8UC3, mono8, 8UC1, mono16, yuv422, uyvy, yuv422_yuy2, yuyv, bayer_rggb8, \
                         bayer_bggr8, bayer_gbrg8, bayer_grbg8";

/// Encodings whose samples are used unchanged.
const RAW_ENCODINGS: &str = "mono8, 8UC1, mono16, 16UC1, bayer_rggb8, bayer_bggr8, bayer_gbrg8, bayer_grbg8, bayer_rggb16, \
                             bayer_bggr16, bayer_gbrg16, bayer_grbg16";

pub(super) fn from_image<'a>(image: &Image<'a>) -> Result<Pixels<'a>, String> {
    // Positions of red, green and blue in a pixel.
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
        "mono16" => Ok(Pixels::Gray(reduced(&rows(image, 2)?, image.is_big).into())),
        // Brightness of two pixels, and the colors that they share.
        "yuv422" | "uyvy" => yuv422(image, [1, 3], [0, 2]),
        "yuv422_yuy2" | "yuyv" => yuv422(image, [0, 2], [1, 3]),
        "bayer_rggb8" => bayer(image, [0, 1, 1, 2]),
        "bayer_bggr8" => bayer(image, [2, 1, 1, 0]),
        "bayer_gbrg8" => bayer(image, [1, 2, 0, 1]),
        "bayer_grbg8" => bayer(image, [1, 0, 2, 1]),
        other => Err(format!("encoding {other:?} must be one of {ENCODINGS}")),
    }
}

/// Whether the conversion of an encoding loses bits.
pub(super) fn is_reduced(encoding: &str) -> bool {
    encoding == "mono16"
}

/// Samples of an image of one channel, row by row without gaps.
#[derive(Debug, PartialEq)]
pub(super) struct RawSamples<'a> {
    /// Whether samples have two bytes.
    pub is_wide: bool,
    pub big_endian: Cow<'a, [u8]>,
}

/// The samples, unchanged.
pub(super) fn raw_samples<'a>(image: &Image<'a>) -> Result<RawSamples<'a>, String> {
    match image.encoding.as_str() {
        "mono8" | "8UC1" | "bayer_rggb8" | "bayer_bggr8" | "bayer_gbrg8" | "bayer_grbg8" => {
            Ok(RawSamples { is_wide: false, big_endian: rows(image, 1)? })
        }
        "mono16" | "16UC1" | "bayer_rggb16" | "bayer_bggr16" | "bayer_gbrg16" | "bayer_grbg16" => {
            let mut big_endian = rows(image, 2)?;
            if !image.is_big {
                big_endian.to_mut().as_chunks_mut::<2>().0.iter_mut().for_each(|bytes| bytes.reverse());
            }
            Ok(RawSamples { is_wide: true, big_endian })
        }
        other => Err(format!("encoding {other:?} of a mosaic camera must be one of {RAW_ENCODINGS}")),
    }
}

/// Converts values of 16 bits to 8 bits: full scale stays full scale.
fn reduced(values: &[u8], is_big: bool) -> Vec<u8> {
    let value = |bytes: &[u8; 2]| if is_big { u16::from_be_bytes(*bytes) } else { u16::from_le_bytes(*bytes) };
    values.as_chunks::<2>().0.iter().map(|bytes| ((u32::from(value(bytes)) + 128) / 257) as u8).collect()
}

/// Decodes pairs of pixels. `brightness`, `colors`: positions of brightness and of blue and red differences in four bytes
/// (BT.601, 16 to 235).
fn yuv422<'a>(image: &Image<'a>, brightness: [usize; 2], colors: [usize; 2]) -> Result<Pixels<'a>, String> {
    if image.width % 2 == 1 {
        return Err(format!("{} pixels in a row; {} has pairs of pixels", image.width, image.encoding));
    }
    let rows = rows(image, 2)?;
    let mut pixels = Vec::with_capacity(rows.len() / 2 * 3);
    for pair in rows.chunks_exact(4) {
        let [u, v] = colors.map(|place| f32::from(pair[place]) - 128.0);
        for place in brightness {
            let y = 1.164 * (f32::from(pair[place]) - 16.0);
            let rgb = [y + 1.596 * v, y - 0.392 * u - 0.813 * v, y + 2.017 * u];
            pixels.extend(rgb.map(|value| value.round().clamp(0.0, 255.0) as u8));
        }
    }
    Ok(Pixels::Rgb(Cow::Owned(pixels)))
}

/// The rows without the padding between them.
fn rows<'a>(image: &Image<'a>, pixel_bytes: usize) -> Result<Cow<'a, [u8]>, String> {
    let height = image.height as usize;
    let step = image.step as usize;
    let row_bytes = image.width as usize * pixel_bytes;
    let n_bytes = if height == 0 { 0 } else { step.saturating_mul(height - 1).saturating_add(row_bytes) };
    if row_bytes == 0 || height == 0 || step < row_bytes || n_bytes > image.data.len() {
        let width = image.width;
        let found = image.data.len();
        return Err(format!(
            "{width} x {height} pixels of {pixel_bytes} bytes in rows of {step} bytes need {n_bytes} bytes; {found} are there"
        ));
    }
    if step == row_bytes {
        return Ok(Cow::Borrowed(&image.data[..n_bytes]));
    }
    Ok(Cow::Owned(image.data.chunks(step).take(height).flat_map(|row| &row[..row_bytes]).copied().collect()))
}

/// Demosaics an image. `colors` (0 red, 1 green, 2 blue) of the four cells of the filter, row by row.
fn bayer<'a>(image: &Image<'a>, colors: [usize; 4]) -> Result<Pixels<'a>, String> {
    let samples: Vec<f32> = rows(image, 1)?.iter().map(|value| f32::from(*value) / 255.0).collect();
    let width = image.width as usize;
    let height = image.height as usize;
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
        Image { header, height, width, encoding: encoding.into(), is_big: false, step, data }
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
            assert_eq!(from_image(&image(encoding, [1, 1, 4], data)), Ok(rgb(&[1, 2, 3])), "{encoding}");
        }
        let gray = from_image(&image("mono8", [2, 2, 3], &[1, 2, 0, 3, 4])).expect("converts");
        assert_eq!(gray, Pixels::Gray(vec![1, 2, 3, 4].into()));
    }

    #[test]
    fn values_of_16_bits_keep_their_full_scale() {
        let data = [0, 0, 0xff, 0xff, 0x00, 0x80, 0x01, 0x01];
        let gray = |is_big| from_image(&Image { is_big, ..image("mono16", [2, 2, 4], &data) });
        assert_eq!(gray(false), Ok(Pixels::Gray(vec![0, 255, 128, 1].into())));
        assert_eq!(gray(true), Ok(Pixels::Gray(vec![0, 255, 0, 1].into())));
        assert!(is_reduced("mono16") && !is_reduced("mono8"));
    }

    #[test]
    fn pairs_of_pixels_with_shared_colors_become_rgb() {
        // Black, white; then red of BT.601 twice.
        let expected = Ok(Pixels::Rgb(vec![0, 0, 0, 255, 255, 255, 254, 0, 0, 254, 0, 0].into()));
        let uyvy = [128, 16, 128, 235, 90, 81, 240, 81];
        let yuyv = [16, 128, 235, 128, 81, 90, 81, 240];
        for encoding in ["yuv422", "uyvy"] {
            assert_eq!(from_image(&image(encoding, [4, 1, 8], &uyvy)), expected, "{encoding}");
        }
        for encoding in ["yuv422_yuy2", "yuyv"] {
            assert_eq!(from_image(&image(encoding, [2, 2, 4], &yuyv)), expected, "{encoding}");
        }
        let error = from_image(&image("yuyv", [3, 1, 6], &[0; 6])).expect_err("has no pairs");
        assert!(error.contains("3 pixels in a row"), "{error}");
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
            let pixels = from_image(&image(encoding, [8, 6, 8], &data)).expect("converts");
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
            let error = from_image(&image(encoding, size, &[0; 11])).expect_err(rule);
            assert!(error.contains(rule), "{error}");
        }
    }
}
