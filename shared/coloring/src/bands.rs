//! The bands of a spectrum.

use messages::{CubeHeader, MAX_BANDS};
use std::collections::BTreeMap;

/// The bands of all mosaic cameras, one camera after another.
#[derive(Clone, Debug, PartialEq)]
pub struct Bands {
    /// Center wavelength of each band, nm; 0 after the last band.
    pub wavelengths_nm: [f32; MAX_BANDS],
    /// Index of the camera of each band.
    pub cameras: [u8; MAX_BANDS],
    /// First band of each camera, followed by the number of all bands.
    pub(crate) starts: Vec<usize>,
}

/// The mosaic cameras have more bands than a spectrum can hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{n_bands} bands of {n_cameras} mosaic cameras; the limits are {MAX_BANDS} bands and 255 cameras")]
pub struct TooManyBands {
    /// Number of bands of all cameras.
    pub n_bands: usize,
    /// Number of cameras.
    pub n_cameras: usize,
}

impl Bands {
    /// Takes the wavelengths of each camera, nm.
    ///
    /// # Errors
    /// For more than [`MAX_BANDS`] bands or more than 255 cameras.
    pub fn new(wavelengths_nm: &[Vec<f32>]) -> Result<Self, TooManyBands> {
        let n_bands = wavelengths_nm.iter().map(Vec::len).sum();
        let n_cameras = wavelengths_nm.len();
        if n_bands > MAX_BANDS || n_cameras > usize::from(u8::MAX) {
            return Err(TooManyBands { n_bands, n_cameras });
        }
        let mut bands = Self { wavelengths_nm: [0.0; MAX_BANDS], cameras: [0; MAX_BANDS], starts: vec![0] };
        let mut n_bands = 0;
        for (camera, wavelengths_nm) in wavelengths_nm.iter().enumerate() {
            for wavelength_nm in wavelengths_nm {
                bands.wavelengths_nm[n_bands] = *wavelength_nm;
                bands.cameras[n_bands] = camera as u8;
                n_bands += 1;
            }
            bands.starts.push(n_bands);
        }
        Ok(bands)
    }

    /// Takes the wavelengths of the first cubes, by camera index, and the expected wavelengths for cameras without a
    /// cube.
    ///
    /// # Errors
    /// See [`Bands::new`].
    pub fn from_first_cubes(
        expected_nm: &[Vec<f32>],
        first_nm: &BTreeMap<u32, Vec<f32>>,
    ) -> Result<Self, TooManyBands> {
        let known = |(camera, expected): (u32, &Vec<f32>)| first_nm.get(&camera).unwrap_or(expected).clone();
        Self::new(&(0..).zip(expected_nm).map(known).collect::<Vec<_>>())
    }

    /// Number of bands of all cameras.
    pub fn n_bands(&self) -> usize {
        self.starts.last().copied().unwrap_or_default()
    }
}

/// The bands of all mosaic cameras. The expected bands apply until the first cube of a camera arrives. That cube then
/// defines the bands of its camera, because `calibrate` decides whether cubes are corrected.
#[derive(Clone, Debug)]
pub struct KnownBands {
    expected_nm: Vec<Vec<f32>>,
    first_nm: BTreeMap<u32, Vec<f32>>,
    bands: Bands,
}

impl KnownBands {
    /// Takes the expected wavelengths of each camera, nm.
    ///
    /// # Errors
    /// See [`Bands::new`].
    pub fn new(expected_nm: Vec<Vec<f32>>) -> Result<Self, TooManyBands> {
        Ok(Self { bands: Bands::new(&expected_nm)?, first_nm: BTreeMap::new(), expected_nm })
    }

    /// Continues with the wavelengths of the first cubes, by camera index.
    ///
    /// # Errors
    /// See [`Bands::new`].
    pub fn resume(&mut self, first_nm: BTreeMap<u32, Vec<f32>>) -> Result<(), TooManyBands> {
        self.bands = Bands::from_first_cubes(&self.expected_nm, &first_nm)?;
        self.first_nm = first_nm;
        Ok(())
    }

    /// The bands.
    pub fn bands(&self) -> &Bands {
        &self.bands
    }

    /// Wavelengths of the first cubes, nm, by index of the camera.
    pub fn first_nm(&self) -> &BTreeMap<u32, Vec<f32>> {
        &self.first_nm
    }

    /// Whether a cube has the bands of its camera.
    pub fn accept(&mut self, header: &CubeHeader) -> bool {
        let Some(wavelengths_nm) = header.wavelengths_nm.get(..header.n_bands as usize) else { return false };
        if let Some(known) = self.first_nm.get(&header.camera) {
            return known == wavelengths_nm;
        }
        self.first_nm.insert(header.camera, wavelengths_nm.to_vec());
        if let Ok(bands) = Bands::from_first_cubes(&self.expected_nm, &self.first_nm) {
            self.bands = bands;
            return true;
        }
        self.first_nm.remove(&header.camera);
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_of_all_cameras_are_concatenated() {
        let bands = Bands::new(&[vec![700.0, 650.0], vec![], vec![500.0]]).expect("few");
        assert_eq!((bands.n_bands(), &bands.starts[..]), (3, &[0, 2, 2, 3][..]));
        assert_eq!(bands.wavelengths_nm[..4], [700.0, 650.0, 500.0, 0.0]);
        assert_eq!(bands.cameras[..3], [0, 0, 2]);
        assert_eq!(Bands::new(&[]).map(|bands| bands.n_bands()), Ok(0));
        assert_eq!(Bands::new(&[vec![1.0; 40], vec![1.0; 25]]), Err(TooManyBands { n_bands: 65, n_cameras: 2 }));
    }
}
