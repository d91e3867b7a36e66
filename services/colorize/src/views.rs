//! Exposures with their poses.

use crate::choose::View;
use crate::frustum::{Frustum, Slopes, slopes};
use crate::lens::Lens;
use geometry::{Pose, RigCamera};

/// A camera of the rig, ready to project.
#[derive(Clone, Debug)]
pub struct Camera {
    body_from_camera: Pose,
    lens: Lens,
    slopes: Option<Slopes>,
    size: [u32; 2],
}

impl From<&RigCamera> for Camera {
    fn from(camera: &RigCamera) -> Self {
        let (width, height) = camera.model.size();
        let lens = Lens::from(&camera.model);
        let slopes = slopes(&camera.model, &lens);
        Self { body_from_camera: camera.body_from_camera, lens, slopes, size: [width, height] }
    }
}

impl Camera {
    /// Columns and rows of its images.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// Of the lens, on the axis.
    pub fn px_per_rad(&self) -> f32 {
        self.lens.px_per_rad()
    }

    /// The whole image of an exposure at `stamp`.
    pub fn view(&self, stamp: i64, world_from_body: &Pose, world_from_submap: &Pose) -> View<'_> {
        let [width, height] = self.size;
        self.view_of_area(stamp, world_from_body, world_from_submap, [0, 0, width, height])
    }

    /// The part of the image in `area` = left column, top row, width, height.
    pub fn view_of_area(
        &self,
        stamp: i64,
        world_from_body: &Pose,
        world_from_submap: &Pose,
        area: [u32; 4],
    ) -> View<'_> {
        // In f64 as long as the world's large numbers are in it.
        let camera_from_submap = (world_from_body * self.body_from_camera).inverse() * world_from_submap;
        let position = camera_from_submap.inverse().translation.vector;
        let matrix = camera_from_submap.to_homogeneous();
        let [x0, y0, width, height] = area.map(|v| v as f32);
        let camera_from_submap = [0, 1, 2].map(|i| [0, 1, 2, 3].map(|j| matrix[(i, j)] as f32));
        View {
            stamp,
            camera_from_submap,
            position: [position.x, position.y, position.z].map(|v| v as f32),
            lens: &self.lens,
            frustum: Frustum::new(self.slopes, &camera_from_submap),
            // A pixel reaches half a pixel to each side of its center.
            min: [x0 - 0.5, y0 - 0.5],
            max: [x0 + width - 0.5, y0 + height - 0.5],
        }
    }
}
