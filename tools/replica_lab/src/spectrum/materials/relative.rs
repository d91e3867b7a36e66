//! Reflectances up to a factor, without a white reference.

use anyhow::{Context, ensure};
use formats::band_image::BandImage;
use formats::sensor_calibration::SensorCalibration;
use simulation::illuminants::sunlight;

/// Mean of all values of the result, typical of common scenes. The true factor is unknown.
const GRAY: f32 = 0.18;

/// Divides each band by the signal of a white surface in the sun, as the manufacturer measured the filters, and applies the correction of
/// the calibration file. The largest sample is saturated: it becomes NaN.
pub fn reflectances(image: &BandImage, sensor: &SensorCalibration) -> anyhow::Result<BandImage> {
    let n_filters = sensor.bands.len();
    ensure!(image.n_bands == n_filters, "{} bands; the calibration file has {n_filters}", image.n_bands);
    let sun = sunlight();
    let white = |band: usize| {
        let response = sensor.system_response(band).context("a band has no response")?;
        let signal: f64 = response.samples().map(|(nm, value)| value * f64::from(sun.at(nm as f32))).sum();
        ensure!(signal > 0.0, "band {band} has no response to sunlight");
        Ok(signal as f32)
    };
    let white: Vec<f32> = (0..n_filters).map(white).collect::<anyhow::Result<_>>()?;
    let n = image.size[0] * image.size[1];
    let largest = image.values.iter().copied().filter(|value| value.is_finite()).fold(0.0, f32::max);
    let value = |band: usize, pixel: usize| match image.values[band * n + pixel] {
        sample if sample >= largest => f32::NAN,
        sample => sample / white[band],
    };
    let mut result = match sensor.reflectance_matrix() {
        Some(matrix) => {
            let rows = &matrix.virtual_bands;
            let corrected = |row: usize, pixel: usize| {
                let weights = rows[row].coefficients.iter().enumerate();
                weights.map(|(band, weight)| *weight as f32 * value(band, pixel)).sum::<f32>()
            };
            let all = (0..rows.len()).flat_map(|row| (0..n).map(move |pixel| (row, pixel)));
            BandImage {
                size: image.size,
                n_bands: rows.len(),
                wavelengths_nm: rows.iter().map(|row| row.wavelength_nm as f32).collect(),
                values: all.map(|(row, pixel)| corrected(row, pixel)).collect(),
            }
        }
        None => BandImage {
            size: image.size,
            n_bands: n_filters,
            wavelengths_nm: sensor.bands.iter().map(|band| band.wavelength_nm() as f32).collect(),
            values: (0..n_filters)
                .flat_map(|band| (0..n).map(move |pixel| (band, pixel)))
                .map(|(b, p)| value(b, p))
                .collect(),
        },
    };
    let mut sum = 0.0_f64;
    let mut count = 0_u64;
    for value in result.values.iter().filter(|value| value.is_finite()) {
        sum += f64::from(*value);
        count += 1;
    }
    let factor = GRAY / (sum / count.max(1) as f64) as f32;
    result.values.iter_mut().for_each(|value| *value *= factor);
    Ok(result)
}
