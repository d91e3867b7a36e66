//! Colors and spectra of simulated submaps, as ideal cameras at the LiDAR would measure them.

use super::camera_columns::{CameraColumns, CameraNeeds};
use messages::{ColorRow, MAX_BANDS, NO_SPECTRUM, SpectraHeader, UNSEEN};
use simulation::Simulation;
use town_sweeps::{IdealCamera, TownSubmap};

/// The cameras that the features of a recipe need.
pub struct IdealCameras {
    color: Option<IdealCamera>,
    bands: Option<IdealCamera>,
    wavelengths_nm: Vec<u16>,
}

impl IdealCameras {
    pub fn new(needs: &CameraNeeds) -> Self {
        let mut wavelengths_nm = needs.wavelengths_nm();
        wavelengths_nm.truncate(MAX_BANDS);
        Self {
            color: needs.color.as_ref().map(|_| IdealCamera::color()),
            bands: (!wavelengths_nm.is_empty()).then(|| IdealCamera::with_bands(&wavelengths_nm)),
            wavelengths_nm,
        }
    }
    /// The columns of a submap of a simulation.
    pub fn columns(&self, simulation: &Simulation, submap: &TownSubmap) -> CameraColumns {
        let shown: Vec<usize> = (0..submap.points.len()).collect();
        let values = |camera: &IdealCamera| camera.values(simulation, &submap.header, &submap.points, &shown);
        let colors = self.color.as_ref().map(values);
        let reflectances = self.bands.as_ref().map(values);
        CameraColumns {
            colors: colors.map(|values| values.as_chunks().0.iter().map(color_row).collect()),
            spectra: reflectances.map(|values| self.spectra(&values)),
        }
    }
    /// Header and rows of the topic.
    fn spectra(&self, reflectances: &[f32]) -> (Box<SpectraHeader>, Vec<u32>) {
        let n_bands = self.wavelengths_nm.len();
        let of_points = || reflectances.chunks_exact(n_bands);
        let mut header = Box::new(SpectraHeader {
            n_points: of_points().len() as u32,
            n_bands: n_bands as u32,
            ..SpectraHeader::default()
        });
        for (center, nm) in header.wavelengths_nm.iter_mut().zip(&self.wavelengths_nm) {
            *center = f32::from(*nm);
        }
        let mut rows = Vec::with_capacity(of_points().len());
        let mut table = Vec::new();
        let measured = u64::MAX >> (MAX_BANDS - n_bands);
        for spectrum in of_points() {
            if spectrum[0].is_nan() {
                rows.push(NO_SPECTRUM);
                continue;
            }
            rows.push(header.n_spectra);
            header.n_spectra += 1;
            table.extend([measured as u32, (measured >> 32) as u32]);
            table.extend(spectrum.iter().map(|reflectance| reflectance.to_bits()));
        }
        rows.append(&mut table);
        (header, rows)
    }
}

/// Red, green, blue of 0 to 1, or NaN.
fn color_row(values: &[f32; 3]) -> ColorRow {
    if values[0].is_nan() {
        return ColorRow { r: 0, g: 0, b: 0, camera: UNSEEN };
    }
    let [r, g, b] = values.map(|value| (255.0 * value).round() as u8);
    ColorRow { r, g, b, camera: 0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::SpectraView;
    use town_sweeps::{Mount, TownDrive};

    #[test]
    fn columns_have_the_values_of_the_cameras() {
        let drive = TownDrive { town: simulation::Town::Urban, seed: 41, seconds: 2.0 };
        let simulation = drive.simulation().expect("a town");
        let submap = &drive.submaps_in(&simulation, 1, 1, 1, Mount::Rig).expect("long enough")[0];
        let bands = vec![(550, "band_550".to_owned()), (800, "band_800".to_owned())];
        let cameras = IdealCameras::new(&CameraNeeds { color: Some("red".to_owned()), bands });
        let columns = cameras.columns(&simulation, submap);
        let shown: Vec<usize> = (0..submap.points.len()).collect();
        let values = |camera: IdealCamera| camera.values(&simulation, &submap.header, &submap.points, &shown);
        let colors = columns.colors.expect("colors");
        let spectra = columns.spectra.expect("spectra");
        let of_color = values(IdealCamera::color());
        for (row, values) in colors.iter().zip(of_color.chunks_exact(3)) {
            assert_eq!(row.camera == UNSEEN, values[0].is_nan());
            assert!(values[0].is_nan() || (f32::from(row.g) / 255.0 - values[1]).abs() < 0.002, "{row:?} {values:?}");
        }
        let view = SpectraView::new(&spectra.0, &spectra.1).expect("rows that fit the header");
        let of_bands = values(IdealCamera::with_bands(&[550, 800]));
        let mut n_seen = 0;
        for (point, values) in of_bands.chunks_exact(2).enumerate() {
            match view.spectrum(point) {
                Some((measured, reflectances)) => {
                    assert_eq!((measured, reflectances), (0b11, values));
                    n_seen += 1;
                }
                None => assert!(values[0].is_nan()),
            }
        }
        assert!(n_seen * 10 > shown.len() * 9, "{n_seen} of {} points", shown.len());
        let none = IdealCameras::new(&CameraNeeds::default()).columns(&simulation, submap);
        assert!(none.colors.is_none() && none.spectra.is_none());
    }
}
