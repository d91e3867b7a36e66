//! Color cameras whose images are linked under their stamps.

use crate::error::{At, ImportError};
use crate::plan::{Link, Plan};
use drive::manifest::CameraEntry;
use files::regular_file;
use geometry::{CameraModel, Isometry3, Pinhole, Pose};
use image::ImageReader;
use std::io::Read;
use std::path::{Path, PathBuf};

/// A camera of a source.
pub(crate) struct Camera {
    /// Name in the data set.
    pub name: String,
    pub exposure_nanos: u64,
    pub body_from_camera: Pose,
    pub model: CameraModel,
    /// Stamp, ns since the Unix epoch, and absolute path of each image.
    pub images: Vec<(i64, PathBuf)>,
    /// Stamps without an image.
    pub n_absent: usize,
}

/// The projection of points to rectified images.
pub(crate) struct Projection {
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
    /// Frame of the points.
    pub rectified_from_camera: Pose,
}

impl Projection {
    /// Rule for the rows.
    pub const RULE: &str = "must be the projection of a rectified camera: fx 0 cx x 0 fy cy y 0 0 1 z";

    /// Parses the upper three rows of K (I | t).
    pub fn from_rows(rows: [f64; 12]) -> Option<Self> {
        let [fx, skew, cx, x, zero, fy, cy, y, g, h, i, z] = rows;
        let is_rectified = skew == 0.0 && zero == 0.0 && [g, h, i] == [0.0, 0.0, 1.0] && fx > 0.0 && fy > 0.0;
        let x = (x - cx * z) / fx;
        let y = (y - cy * z) / fy;
        let rectified_from_camera = Isometry3::translation(-x, -y, -z);
        is_rectified.then_some(Self { fx, fy, cx, cy, rectified_from_camera })
    }

    /// The lens: rectified images have no distortion.
    pub fn model(&self, [width, height]: [u32; 2]) -> CameraModel {
        let Self { fx, fy, cx, cy, .. } = *self;
        CameraModel::Pinhole(Pinhole { width, height, fx, fy, cx, cy, distortion: [0.0; 5] })
    }
}

/// Adds the cameras to a drive, in this order.
pub(crate) fn add(plan: &mut Plan, cameras: Vec<Camera>) -> Result<(), ImportError> {
    for (index, camera) in cameras.into_iter().enumerate() {
        let folder = format!("camera/{index}");
        for pair in camera.images.windows(2) {
            if pair[0].0 >= pair[1].0 {
                let rule = format!("stamp {} must be later than the stamp of {}", pair[1].0, pair[0].1.display());
                return Err(ImportError::at(&pair[1].1, rule));
            }
        }
        let absent = match camera.n_absent {
            0 => String::new(),
            n => format!("; {n} stamps have no image"),
        };
        plan.report.push(format!("imported: {} images of camera {}{absent}", camera.images.len(), camera.name));
        plan.links.extend(camera.images.into_iter().map(|(stamp, original)| {
            let extension = original.extension().unwrap_or_default().to_string_lossy().to_lowercase();
            Link { place: Path::new(&folder).join(format!("{stamp}.{extension}")), original }
        }));
        plan.manifest.cameras.push(CameraEntry {
            delay_nanos: 0,
            name: camera.name,
            folder,
            exposure_nanos: camera.exposure_nanos,
            body_from_camera: camera.body_from_camera.into(),
            model: camera.model,
        });
    }
    Ok(())
}

/// Columns and rows of a PNG (W3C PNG, section 11.2.1) or JPEG image, from its header.
pub(crate) fn image_size(path: &Path) -> Result<[u32; 2], ImportError> {
    let mut header = [0; 24];
    let read = regular_file::open(path).at(path)?.read_exact(&mut header);
    if read.is_ok() && header.starts_with(b"\x89PNG\r\n\x1a\n") && &header[12..16] == b"IHDR" {
        let number = |at: usize| u32::from_be_bytes([header[at], header[at + 1], header[at + 2], header[at + 3]]);
        return Ok([number(16), number(20)]);
    }
    let reader = ImageReader::open(path).and_then(ImageReader::with_guessed_format).at(path)?;
    let size = reader.into_dimensions().map_err(|_| {
        ImportError::at(path, "is neither a PNG nor a JPEG image: it does not begin with the header of one")
    })?;
    Ok([size.0, size.1])
}
