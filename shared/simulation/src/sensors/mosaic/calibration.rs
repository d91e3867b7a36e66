//! Calibration file of a simulated camera, with its spectral correction matrix.

use super::chip::{BIT_DEPTH, FULL_WELL, SIZE};
use super::model::MosaicModel;
use formats::sensor_calibration::{
    CorrectionMatrix, Curve, FilterBand, OpticalComponent, Peak, SensorCalibration, VirtualBand,
};
use nalgebra::{DMatrix, DVector};

/// First and last wavelength of all curves, nm, in steps of 1.
const FIRST_NM: i32 = 400;
/// See [`FIRST_NM`].
const LAST_NM: i32 = 1000;
/// Weight of small coefficients relative to accurate bands: with a smaller weight, the correction amplifies noise more
/// than three times.
const RIDGE: f64 = 4e-4;

/// Content of the file `sensor.xml` of the camera.
pub fn sensor_calibration(model: &MosaicModel) -> SensorCalibration {
    let bands = model
        .bands()
        .iter()
        .map(|filter| {
            let second = filter.second;
            let strength = |fwhm: f32, peak: f32| f64::from(fwhm * peak);
            let all = strength(filter.fwhm_nm, filter.efficiency) + strength(second[1], second[2]);
            let peak = |nm: f32, fwhm: f32, peak: f32| Peak {
                wavelength_nm: decimal(nm),
                fwhm_nm: decimal(fwhm),
                quantum_efficiency: decimal(peak),
                contribution: rounded(strength(fwhm, peak) / all, 1e4),
            };
            FilterBand {
                selected: true,
                peaks: vec![
                    peak(filter.center_nm, filter.fwhm_nm, filter.efficiency),
                    peak(second[0], second[1], second[2]),
                ],
                response: curve(|nm| filter.response(nm)),
            }
        })
        .collect();
    let [long, short] = model.rejection_nm;
    // Edge filters pass 0.95 on one side and a ten-thousandth on the other, over some 8 nm.
    let edge = |nm: f64| 1e-4 + 0.95 / (1.0 + (-nm / 1.8).exp());
    let component =
        |kind: &str, tag: String, transmission| OpticalComponent { kind: kind.to_owned(), tag, transmission };
    let mut calibration = SensorCalibration {
        version: 1,
        sensor_id: model.sensor_id.to_owned(),
        size: SIZE.map(|side| side as u32),
        bit_depth: Some(BIT_DEPTH),
        full_well_electrons: Some(f64::from(FULL_WELL)),
        active_area: model.active_area.map(|v| v as u32),
        pattern: model.pattern as u32,
        spectral_range_nm: model.range_nm,
        bands,
        optical_components: vec![
            component("longpass_filter", format!("filter_lp_{long}"), curve(|nm| edge(nm - long))),
            component("shortpass_filter", format!("filter_sp_{short}"), curve(|nm| edge(short - nm))),
        ],
        matrices: Vec::new(),
    };
    calibration.matrices = vec![reflectance_matrix(model, &calibration)];
    calibration
}

/// Coefficients c that combine the band responses E (each of area 1) to a Gaussian band v of area 1:
/// `min |E^T c - v|^2 + ridge |c|^2` subject to `sum c = 1`, for every band that is kept.
fn reflectance_matrix(model: &MosaicModel, calibration: &SensorCalibration) -> CorrectionMatrix {
    let n = model.bands().len();
    let responses: Vec<Vec<f64>> = (0..n)
        .filter_map(|k| calibration.system_response(k))
        .map(|curve| curve.samples().map(|(_, value)| value / curve.area()).collect())
        .collect();
    let responses = DMatrix::from_fn(n, responses[0].len(), |k, i| responses[k][i]);
    let gram = &responses * responses.transpose() + DMatrix::identity(n, n) * RIDGE;
    let Some(inverse) = gram.try_inverse() else { unreachable!("a Gram matrix with a ridge is positive definite") };
    let ones = DVector::from_element(n, 1.0);
    let to_sum = &inverse * &ones;
    let mut stay: Vec<usize> = (0..n).filter(|k| !model.left_out.contains(k)).collect();
    stay.sort_by(|a, b| model.bands()[*a].center_nm.total_cmp(&model.bands()[*b].center_nm));
    let virtual_bands = stay.into_iter().map(|k| {
        let filter = &model.bands()[k];
        let sigma = f64::from(filter.fwhm_nm) / 2.355;
        let wanted = DVector::from_fn(responses.ncols(), |i, _| {
            let off = (f64::from(FIRST_NM) + i as f64 - f64::from(filter.center_nm)) / sigma;
            (-0.5 * off * off).exp() / (sigma * std::f64::consts::TAU.sqrt())
        });
        let free = &inverse * (&responses * wanted);
        let missing = (1.0 - free.sum()) / to_sum.sum();
        VirtualBand {
            wavelength_nm: decimal(filter.center_nm),
            fwhm_nm: decimal(filter.fwhm_nm),
            coefficients: (free + &to_sum * missing).iter().map(|c| rounded(*c, 1e7)).collect(),
        }
    });
    CorrectionMatrix {
        name: "hsi".to_owned(),
        kind: "hyperspectral".to_owned(),
        virtual_bands: virtual_bands.collect(),
    }
}

fn curve(value: impl Fn(f64) -> f64) -> Curve {
    Curve::from_samples((FIRST_NM..=LAST_NM).map(f64::from).map(|nm| (nm, rounded(value(nm), 1e8))).collect())
}

fn rounded(value: f64, steps: f64) -> f64 {
    (value * steps).round() / steps
}

/// A number of the tables without the extra digits of f32.
fn decimal(value: f32) -> f64 {
    rounded(f64::from(value), 1e4)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn calibration_file_round_trips_and_correction_recovers_reflectance() {
        for (model, n_virtual) in [(MosaicModel::hs02(), 23), (MosaicModel::hs03(), 13)] {
            let calibration = sensor_calibration(&model);
            assert_eq!(SensorCalibration::from_xml(&calibration.to_xml()).as_ref(), Ok(&calibration));
            let matrix = calibration.reflectance_matrix().expect("for reflectances");
            assert_eq!(matrix.virtual_bands.len(), n_virtual);
            assert!(matrix.virtual_bands.is_sorted_by(|a, b| a.wavelength_nm < b.wavelength_nm));
            let responses: Vec<Curve> =
                (0..calibration.bands.len()).filter_map(|k| calibration.system_response(k)).collect();
            for row in &matrix.virtual_bands {
                assert!((row.coefficients.iter().sum::<f64>() - 1.0).abs() < 1e-5, "white stays white");
                let noise = row.coefficients.iter().map(|c| c * c).sum::<f64>().sqrt();
                assert!(noise < 3.0, "{} nm: {noise}", row.wavelength_nm);
                let combined = curve(|nm| {
                    row.coefficients
                        .iter()
                        .zip(&responses)
                        .map(|(c, response)| c * response.at(nm) / response.area())
                        .sum()
                });
                let off = (combined.peak_nm() - row.wavelength_nm).abs();
                assert!(off < 2.5, "{} nm: its peak is off by {off} nm", row.wavelength_nm);
                // The second passbands are removed: most of the light is from around the peak.
                let near = Curve::from_samples(
                    combined.samples().filter(|(nm, _)| (nm - row.wavelength_nm).abs() < 2.0 * row.fwhm_nm).collect(),
                );
                assert!(near.area() > 0.75, "{} nm: {}", row.wavelength_nm, near.area());
            }
        }
    }
}
