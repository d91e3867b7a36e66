//! A camera: its images and its lens.

use super::images::Images;
use super::lens::lens;
use super::messages::CameraInfo;
use geometry::CameraModel;

/// A camera while the bag is read.
pub(crate) struct Camera {
    /// Index of the topic of its images.
    pub topic: usize,
    /// Folder in the drive.
    pub folder: String,
    /// Name for display.
    pub name: String,
    pub images: Images,
    pub info: Option<CameraInfo>,
    /// Whether another `CameraInfo` had other values.
    pub has_changed: bool,
    is_rectified: bool,
}

impl Camera {
    /// A camera without images. `topic_name` names the topic of its images.
    pub fn new(topic: usize, topic_name: &str, folder: String, images: Images) -> Self {
        let image = topic_name.strip_suffix("/compressed").unwrap_or(topic_name);
        let (namespace, image) = image.rsplit_once('/').unwrap_or(("", image));
        let name = namespace.trim_start_matches('/');
        Self {
            topic,
            folder,
            name: if name.is_empty() { image.to_owned() } else { name.to_owned() },
            images,
            info: None,
            has_changed: false,
            // Image names used by image_proc.
            is_rectified: image.starts_with("image_rect"),
        }
    }

    pub fn add_info(&mut self, info: CameraInfo) {
        let same = |known: &CameraInfo| CameraInfo { header: info.header.clone(), ..known.clone() } == info;
        match &self.info {
            Some(known) => self.has_changed |= !same(known),
            None => self.info = Some(info),
        }
    }

    /// Angle by which the rectification turns the camera, deg.
    pub fn rectification_deg(&self) -> f64 {
        let trace =
            self.info.as_ref().map_or(3.0, |info| [0, 4, 8].map(|index| info.rectification[index]).iter().sum());
        // All zero if there is no rectification.
        if trace == 0.0 { 0.0 } else { ((trace - 1.0) * 0.5).clamp(-1.0, 1.0).acos().to_degrees() }
    }

    /// Frame and lens, or the reason why they are unknown. `image_frame`: frame of the images.
    pub fn lens(&self, image_frame: &str) -> Result<(String, CameraModel), String> {
        let info = self.info.as_ref().ok_or("no CameraInfo was recorded for it")?;
        if self.images.n_written == 0 {
            return Err("no images were recorded".into());
        }
        let stated = [info.width, info.height];
        if let Some([width, height]) = self.images.size.filter(|size| *size != stated) {
            return Err(format!(
                "images of {width} x {height} pixels, but a CameraInfo of {} x {}",
                stated[0], stated[1]
            ));
        }
        let frame = if image_frame.is_empty() { &info.header.frame } else { image_frame };
        Ok((frame.to_owned(), lens(info, self.is_rectified)?))
    }
}
