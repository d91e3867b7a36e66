//! Input: poses, images and cubes, checked against the rig.

use super::Colorize;
use coloring::{Bands, ColorImage, CubeImage};
use formats::drive::Drive;
use formats::manifest::MosaicEntry;
use formats::sensor_calibration::SensorCalibration;
use geometry::Stamp;
use messages::{CubeTopic, ImageTopic, TrajectoryTopic};
use stage::{Inputs, Outputs, Received, StepError};

impl Colorize {
    pub(super) fn take_poses(&mut self, inputs: &mut Inputs) -> Result<(), StepError> {
        for message in inputs.take::<TrajectoryTopic>() {
            for row in message.rows() {
                let pose = row.world_from_body.checked().map_err(|error| StepError::data(error).at("trajectory"))?;
                if !self.held.trajectory.push(Stamp(row.stamp), pose) {
                    let text = format!("trajectory: pose at {} ns is older than the one before it", row.stamp);
                    return Err(StepError::data(text));
                }
            }
        }
        Ok(())
    }

    pub(super) fn take_exposures(&mut self, inputs: &mut Inputs, outputs: &mut Outputs) {
        for image in inputs.take::<ImageTopic>() {
            if self.color_image(&image).is_some() {
                self.held.images.add(image);
            } else {
                self.held.images.refuse(&image);
                let header = image.header();
                outputs.count("images_unusable", 1);
                outputs.note(format!(
                    "images of camera {} with {}x{} px and {} channels do not match the rig: ignored",
                    header.camera, header.width, header.height, header.channels
                ));
            }
        }
        for cube in inputs.take::<CubeTopic>() {
            if self.cube_image(&cube).is_some() && self.has_expected_bands(&cube) {
                self.held.cubes.add(cube);
            } else {
                self.held.cubes.refuse(&cube);
                let header = cube.header();
                outputs.count("cubes_unusable", 1);
                outputs.note(format!(
                    "cubes of mosaic camera {} with {}x{} cells of {} bands do not match the rig: ignored",
                    header.camera, header.width, header.height, header.n_bands
                ));
            }
        }
    }

    /// The pixels of an image; `None` if its header does not match the rig.
    pub(super) fn color_image<'a>(&self, image: &'a Received<ImageTopic>) -> Option<ColorImage<'a>> {
        let header = image.header();
        let camera = self.cameras.get(header.camera as usize)?;
        let fits = camera.size() == [header.width, header.height] && header.channels == 3;
        ColorImage::new(header.camera as u8, header.width, header.height, image.rows()).filter(|_| fits)
    }

    /// The cells of a cube; `None` if its header does not match the rig.
    pub(super) fn cube_image<'a>(&self, cube: &'a Received<CubeTopic>) -> Option<CubeImage<'a>> {
        let header = cube.header();
        let camera = header.camera as usize;
        let [width, height] = self.mosaics.get(camera)?.size().map(u64::from);
        let end = |first: u32, n_cells: u32| u64::from(first) + u64::from(n_cells) * u64::from(header.pattern);
        let fits = end(header.x0, header.width) <= width
            && end(header.y0, header.height) <= height
            && (header.pattern == self.patterns[camera] || header.pattern == 1);
        CubeImage::new(header, cube.rows()).filter(|_| fits)
    }

    /// Whether the cube has the bands of its camera. The first cube of a camera defines them, because `calibrate` decides
    /// whether cubes are corrected.
    fn has_expected_bands(&mut self, cube: &Received<CubeTopic>) -> bool {
        let header = cube.header();
        let Some(wavelengths_nm) = header.wavelengths_nm.get(..header.n_bands as usize) else { return false };
        if let Some(known) = self.held.bands_nm.get(&header.camera) {
            return known == wavelengths_nm;
        }
        self.held.bands_nm.insert(header.camera, wavelengths_nm.to_vec());
        if let Ok(bands) = Bands::of_first_cubes(&self.expected_nm, &self.held.bands_nm) {
            self.bands = bands;
            return true;
        }
        self.held.bands_nm.remove(&header.camera);
        false
    }
}

/// The virtual bands of the camera calibration if there is one, because `calibrate` corrects by default; otherwise the bands
/// of the filters.
fn expected_nm(entry: &MosaicEntry, sensor: Option<&SensorCalibration>) -> Vec<f32> {
    match sensor.and_then(SensorCalibration::reflectance_matrix) {
        Some(matrix) => matrix.virtual_bands.iter().map(|band| band.wavelength_nm as f32).collect(),
        None => entry.wavelengths_nm.iter().map(|nm| *nm as f32).collect(),
    }
}

/// The expected bands of all mosaic cameras, nm.
pub(super) fn expected_bands(drive: &Drive) -> Vec<Vec<f32>> {
    let mosaics = drive.manifest().mosaics.iter().zip(drive.sensors());
    mosaics.map(|(entry, sensor)| expected_nm(entry, sensor.as_ref())).collect()
}
