//! What comes: poses, images and cubes, and whether they fit the rig.

use super::Colorize;
use crate::color::Picture;
use crate::spectra::{Bands, CubePicture};
use formats::manifest::MosaicEntry;
use formats::sensor_calibration::SensorCalibration;
use geometry::Stamp;
use messages::{Cube, Image, Trajectory};
use stage::{Inputs, Outputs, Received, StepError};

impl Colorize {
    pub(super) fn take_poses(&mut self, inputs: &mut Inputs) -> Result<(), StepError> {
        for message in inputs.take::<Trajectory>() {
            for row in message.rows() {
                let pose = row.world_from_body.to_pose().ok_or_else(|| {
                    StepError::data(format!("trajectory: {row:?} is no pose (finite, unit quaternion x y z w)"))
                })?;
                if !self.held.trajectory.push(Stamp(row.stamp), pose) {
                    let text = format!("trajectory: pose at {} ns is older than the one before it", row.stamp);
                    return Err(StepError::data(text));
                }
            }
        }
        Ok(())
    }

    pub(super) fn take_exposures(&mut self, inputs: &mut Inputs, outputs: &mut Outputs) {
        for image in inputs.take::<Image>() {
            if self.picture(&image).is_some() {
                self.held.images.add(image);
            } else {
                let header = image.header();
                outputs.count("images_unusable", 1);
                outputs.note(format!(
                    "images of camera {} with {}x{} px and {} channels do not fit the rig: not used",
                    header.camera, header.width, header.height, header.channels
                ));
            }
        }
        for cube in inputs.take::<Cube>() {
            if self.cube_picture(&cube).is_some() && self.has_expected_bands(&cube) {
                self.held.cubes.add(cube);
            } else {
                let header = cube.header();
                outputs.count("cubes_unusable", 1);
                outputs.note(format!(
                    "cubes of mosaic camera {} with {}x{} cells of {} bands do not fit the rig: not used",
                    header.camera, header.width, header.height, header.n_bands
                ));
            }
        }
    }

    /// The image, if it is one of the rig's.
    pub(super) fn picture<'a>(&self, image: &'a Received<Image>) -> Option<Picture<'a>> {
        let header = image.header();
        let camera = self.cameras.get(header.camera as usize)?;
        let fits = camera.size() == [header.width, header.height] && header.channels == 3;
        Picture::new(header.camera as u8, header.width, header.height, image.rows()).filter(|_| fits)
    }

    /// The cube, if it is one of the rig's.
    pub(super) fn cube_picture<'a>(&self, cube: &'a Received<Cube>) -> Option<CubePicture<'a>> {
        let header = cube.header();
        let camera = header.camera as usize;
        let [width, height] = self.mosaics.get(camera)?.size().map(u64::from);
        let end = |first: u32, n_cells: u32| u64::from(first) + u64::from(n_cells) * u64::from(header.pattern);
        let fits = end(header.x0, header.width) <= width
            && end(header.y0, header.height) <= height
            && (header.pattern == self.patterns[camera] || header.pattern == 1);
        CubePicture::new(header, cube.rows()).filter(|_| fits)
    }

    /// Whether the cube has the bands of its camera. The first one of a camera says what they are: whether cubes are
    /// corrected is calibrate's affair.
    fn has_expected_bands(&mut self, cube: &Received<Cube>) -> bool {
        let header = cube.header();
        let Some(wavelengths_nm) = header.wavelengths_nm.get(..header.n_bands as usize) else { return false };
        if let Some(known) = self.held.bands_nm.get(&header.camera) {
            return known == wavelengths_nm;
        }
        self.held.bands_nm.insert(header.camera, wavelengths_nm.to_vec());
        if let Ok(bands) = self.known_bands() {
            self.bands = bands;
            return true;
        }
        self.held.bands_nm.remove(&header.camera);
        false
    }

    /// The bands of all cameras: of those whose cubes have come theirs, of others those that are expected.
    pub(super) fn known_bands(&self) -> Result<Bands, StepError> {
        let mut wavelengths_nm = self.expected_nm.clone();
        for (camera, bands_nm) in &self.held.bands_nm {
            if let Some(slot) = wavelengths_nm.get_mut(*camera as usize) {
                slot.clone_from(bands_nm);
            }
        }
        Bands::new(&wavelengths_nm).ok_or_else(|| too_many_bands(&wavelengths_nm))
    }
}

/// Virtual bands where the camera's calibration has some, because calibrate corrects by default; else the filters'.
pub(super) fn expected_nm(entry: &MosaicEntry, sensor: Option<&SensorCalibration>) -> Vec<f32> {
    match sensor.and_then(SensorCalibration::reflectance_matrix) {
        Some(matrix) => matrix.virtual_bands.iter().map(|band| band.wavelength_nm as f32).collect(),
        None => entry.wavelengths_nm.iter().map(|nm| *nm as f32).collect(),
    }
}

pub(super) fn too_many_bands(wavelengths_nm: &[Vec<f32>]) -> StepError {
    let n_bands: usize = wavelengths_nm.iter().map(Vec::len).sum();
    StepError::data(format!("{n_bands} bands in all; must be {} at most", messages::MAX_BANDS))
}
