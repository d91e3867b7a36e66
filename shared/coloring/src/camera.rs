//! A camera of the rig, prepared for projection.

use crate::exposure::PosedExposure;
use crate::frustum::{Frustum, Slopes, slopes};
use crate::lens::Lens;
use geometry::{Pose, RigCamera};

/// A camera of the rig with its lens prepared: it turns poses into exposures.
#[derive(Clone, Debug)]
pub struct ProjectionCamera {
    body_from_camera: Pose,
    lens: Lens,
    slopes: Option<Slopes>,
    size: [u32; 2],
}

impl From<&RigCamera> for ProjectionCamera {
    fn from(camera: &RigCamera) -> Self {
        let (width, height) = camera.model.size();
        let lens = Lens::from(&camera.model);
        let slopes = slopes(&camera.model, &lens);
        Self { body_from_camera: camera.body_from_camera, lens, slopes, size: [width, height] }
    }
}

impl ProjectionCamera {
    /// Width and height of its images, px.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// Resolution of the lens on its axis, px/rad.
    pub fn px_per_rad(&self) -> f32 {
        self.lens.px_per_rad()
    }

    /// An exposure at `stamp` whose whole image is usable. Only the pose of the camera relative to the submap matters:
    /// both poses may be in any fixed frame, as long as it is the same one.
    pub fn exposure(&self, stamp: i64, odom_from_body: &Pose, odom_from_submap: &Pose) -> PosedExposure<'_> {
        let [width, height] = self.size;
        self.exposure_of_area(stamp, odom_from_body, odom_from_submap, [0, 0, width, height])
    }

    /// An exposure whose image is usable in `area` = left column, top row, width, height.
    pub fn exposure_of_area(
        &self,
        stamp: i64,
        odom_from_body: &Pose,
        odom_from_submap: &Pose,
        area: [u32; 4],
    ) -> PosedExposure<'_> {
        // Computed in f64, because coordinates in odom grow with the drive.
        let camera_from_submap = (odom_from_body * self.body_from_camera).inverse() * odom_from_submap;
        let position = camera_from_submap.inverse().translation.vector;
        let matrix = camera_from_submap.to_homogeneous();
        let [x0, y0, width, height] = area.map(|v| v as f32);
        let camera_from_submap = [0, 1, 2].map(|i| [0, 1, 2, 3].map(|j| matrix[(i, j)] as f32));
        PosedExposure {
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
