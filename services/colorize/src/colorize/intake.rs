//! Input: poses, images and cubes, checked against the rig.

use super::Colorize;
use crate::saved::{held_cube, held_image};
use coloring::{ColorImage, CubeImage};
use geometry::Stamp;
use messages::{CubeTopic, ImageTopic, TrajectoryTopic};
use stage::{Inputs, Outputs, Received, StepError};

impl Colorize {
    pub(super) fn take_poses(&mut self, inputs: &mut Inputs) -> Result<(), StepError> {
        for message in inputs.take::<TrajectoryTopic>() {
            for row in message.rows() {
                let pose = row.odom_from_body.checked().map_err(|error| StepError::data(error).at("trajectory"))?;
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
                self.held.images.add(held_image(image));
            } else {
                let header = image.header();
                self.held.images.refuse(header.camera);
                outputs.count("images_unusable", 1);
                outputs.note(format!(
                    "images of camera {} with {}x{} px and {} channels do not match the rig: ignored",
                    header.camera, header.width, header.height, header.channels
                ));
            }
        }
        for cube in inputs.take::<CubeTopic>() {
            if self.cube_image(&cube).is_some() && self.bands.accept(cube.header()) {
                self.held.cubes.add(held_cube(cube));
            } else {
                let header = cube.header();
                self.held.cubes.refuse(header.camera);
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
        ColorImage::for_camera(self.cameras.get(header.camera as usize)?, header, image.rows())
    }

    /// The cells of a cube; `None` if its header does not match the rig.
    pub(super) fn cube_image<'a>(&self, cube: &'a Received<CubeTopic>) -> Option<CubeImage<'a>> {
        let header = cube.header();
        let camera = cube.header().camera as usize;
        CubeImage::for_camera(self.mosaics.get(camera)?, *self.patterns.get(camera)?, header, cube.rows())
    }
}
