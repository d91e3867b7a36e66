//! Fidelity of simplified images.

/// Fidelity of an image against the original.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fidelity {
    /// Sum over the bands of the squared errors of a pixel, mean over pixels: the MSE column of table 3.1 of the thesis.
    pub squared_error: f64,
    /// Peak signal-to-noise ratio, dB: 10 log10(peak^2 / e), where e is the mean of the squared error over pixels *and*
    /// bands. Infinite for equal images.
    pub psnr_db: f64,
}

/// Compares two band-sequential images of `n_bands`. A pixel with a value that is not finite in either image is skipped
/// in all bands. `None` if there is no pixel to compare.
pub fn fidelity(original: &[f32], image: &[f32], n_bands: usize, peak: f64) -> Option<Fidelity> {
    fidelity_where(original, image, n_bands, peak, |_| true)
}

/// Compares the pixels whose index is selected, like [`fidelity`].
pub fn fidelity_where(
    original: &[f32],
    image: &[f32],
    n_bands: usize,
    peak: f64,
    selected: impl Fn(usize) -> bool,
) -> Option<Fidelity> {
    let n_pixels = original.len() / n_bands.max(1);
    let mut sum = 0.0;
    let mut n = 0_u64;
    for pixel in (0..n_pixels.min(image.len() / n_bands.max(1))).filter(|pixel| selected(*pixel)) {
        let error =
            |band: usize| f64::from(original[band * n_pixels + pixel]) - f64::from(image[band * n_pixels + pixel]);
        let squared: f64 = (0..n_bands).map(|band| error(band).powi(2)).sum();
        if squared.is_finite() {
            sum += squared;
            n += 1;
        }
    }
    let squared_error = sum / n as f64;
    let psnr_db = 10.0 * (peak * peak * n_bands as f64 / squared_error).log10();
    (n > 0).then_some(Fidelity { squared_error, psnr_db })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn squared_error_62_gives_34_96_db_as_in_the_thesis() {
        // Two pixels of three bands; errors 2, 3, 7 and 2, 3, 7: 62 summed over the bands.
        let original = [10.0; 6];
        let image = [12.0, 8.0, 13.0, 7.0, 3.0, 17.0];
        let found = fidelity(&original, &image, 3, 255.0).expect("pixels");
        assert_eq!(found.squared_error, 62.0);
        assert!((found.psnr_db - 34.98).abs() < 0.03, "{found:?}");
    }

    #[test]
    fn pixel_with_an_unknown_band_is_left_out() {
        let original = [1.0, 5.0, 1.0, f32::NAN];
        let found = fidelity(&original, &[1.0, 0.0, 2.0, 0.0], 2, 1.0).expect("a pixel");
        assert_eq!(found, Fidelity { squared_error: 1.0, psnr_db: 10.0 * 2.0_f64.log10() });
        assert_eq!(fidelity(&[f32::NAN], &[0.0], 1, 1.0), None);
        assert_eq!(fidelity(&[1.0], &[1.0], 1, 1.0).map(|f| f.psnr_db), Some(f64::INFINITY));
    }
}
