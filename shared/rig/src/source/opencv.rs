//! Camera intrinsics in the formats of OpenCV and ROS.

use super::lens::{Intrinsics, lens};
use super::{CameraPart, RigParts, SourceOptions};
use crate::yaml::{Node, YamlError};
use std::path::Path;

/// Names of the camera matrix.
pub(super) const MATRIX_KEYS: &[&str] = &["camera_matrix", "Camera_Matrix", "K", "k", "cameraMatrix", "M1", "M"];
const COEFFICIENT_KEYS: &[&str] =
    &["distortion_coefficients", "Distortion_Coefficients", "D", "d", "distCoeffs", "D1", "dist_coeffs"];
const WIDTH_KEYS: &[&str] = &["image_width", "image_Width", "width"];
const HEIGHT_KEYS: &[&str] = &["image_height", "image_Height", "height"];

/// One camera. Without an entry for its lens model, four or five coefficients are `plumb_bob`; OpenCV's
/// `fisheye_model: 1` is a fisheye.
pub(super) fn parts(document: &Node, path: &Path, options: &SourceOptions) -> Result<RigParts, YamlError> {
    let fault = |line: usize, rule: String| YamlError { line, rule };
    let matrix_node = document
        .get_any(MATRIX_KEYS)
        .ok_or_else(|| fault(document.line, format!("no camera matrix; must be one of {}", MATRIX_KEYS.join(", "))))?;
    let matrix: [f64; 9] = matrix_node.numbers_of()?;
    let [fx, skew, cx, _, fy, cy, ..] = matrix;
    if skew.abs() > 1e-6 * fx.abs() {
        return Err(fault(matrix_node.line, format!("the camera matrix has a skew of {skew}; must be 0")));
    }
    let size = size(document, options)?;
    let coefficients = document.get_any(COEFFICIENT_KEYS).map_or_else(|| Ok(Vec::new()), Node::numbers)?;
    let is_fisheye = document.get("fisheye_model").and_then(Node::text).is_some_and(|text| text.trim() == "1");
    let stated = document.get("distortion_model").and_then(Node::text);
    let model = stated.unwrap_or(if is_fisheye { "fisheye" } else { "plumb_bob" });
    let intrinsics = Intrinsics { size, numbers: [fx, fy, cx, cy] };
    let model = lens(intrinsics, model, &coefficients).map_err(|rule| fault(document.line, rule))?;
    let frame = document.get("header").and_then(|header| header.get("frame_id")).and_then(Node::text);
    let name = options.camera_name.clone().or_else(|| Some(document.get("camera_name")?.text()?.to_owned()));
    let name = name.or_else(|| frame.map(str::to_owned)).unwrap_or_else(|| {
        path.file_stem().map_or_else(|| "camera".to_owned(), |stem| stem.to_string_lossy().into_owned())
    });
    let note = format!("camera {name}: intrinsics of {}; frame of the source: the camera", path.display());
    let camera = CameraPart {
        // Drivers write the frame of the camera, or its name, which is often the name of its frame.
        frame: Some(frame.map_or_else(|| name.clone(), str::to_owned)),
        name,
        body_from_camera: options.body_from_source,
        model,
    };
    Ok(RigParts { cameras: vec![camera], notes: vec![note], ..RigParts::default() })
}

fn size(document: &Node, options: &SourceOptions) -> Result<[u32; 2], YamlError> {
    let of = |keys: &[&str]| document.get_any(keys).map(Node::number).transpose();
    if let (Some(width), Some(height)) = (of(WIDTH_KEYS)?, of(HEIGHT_KEYS)?) {
        return Ok([width as u32, height as u32]);
    }
    if let Some(node) = document.get_any(&["image_size", "resolution", "imageSize"]) {
        let [width, height]: [f64; 2] = node.numbers_of()?;
        return Ok([width as u32, height as u32]);
    }
    options.image_size.ok_or_else(|| YamlError {
        line: document.line,
        rule: "no image_width and image_height; give --image-size W,H".to_owned(),
    })
}
