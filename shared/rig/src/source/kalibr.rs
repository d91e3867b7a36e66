//! A camera chain of Kalibr, with or without an inertial unit.

use super::lens::{Intrinsics, lens};
use super::{CameraPart, RigParts, SourceOptions, pose_of_matrix};
use crate::yaml::{Node, YamlError};
use geometry::Pose;

/// Cameras `cam0`, `cam1`, … The source frame is the frame of the inertial unit if the chain has one (`T_cam_imu`),
/// otherwise the frame of `cam0`.
pub(super) fn parts(document: &Node, options: &SourceOptions) -> Result<RigParts, YamlError> {
    let mut found = RigParts::default();
    let chain = document.entries().iter().filter(|(key, _)| is_camera(key));
    let mut source_from_last = Pose::identity();
    let has_imu = document.get("cam0").is_some_and(|camera| camera.get("T_cam_imu").is_some());
    // Without a stated mounting, the inertial unit is the body.
    let body_from_source = options.body_from_source.or_else(|| has_imu.then(Pose::identity));
    for (index, (name, entry)) in chain.enumerate() {
        let fault = |node: &Node| {
            let line = node.line;
            move |rule: String| YamlError { line, rule }
        };
        let pose = |key: &str| match entry.get(key) {
            Some(node) => pose_of_matrix(&node.numbers()?).map(Some).map_err(fault(node)),
            None => Ok(None),
        };
        let source_from_camera = match (has_imu, pose("T_cam_imu")?, pose("T_cn_cnm1")?) {
            (true, Some(camera_from_imu), _) => camera_from_imu.inverse(),
            (_, _, Some(camera_from_last)) if index > 0 => source_from_last * camera_from_last.inverse(),
            (false, _, None) if index == 0 => Pose::identity(),
            _ => {
                let rule = format!("{name} has no {}", if has_imu { "T_cam_imu" } else { "T_cn_cnm1" });
                return Err(YamlError { line: entry.line, rule });
            }
        };
        source_from_last = source_from_camera;
        let model = model(entry).map_err(fault(entry))?;
        if let Some(shift) = entry.get("timeshift_cam_imu") {
            let late_ms = -shift.number()? * 1e3;
            found
                .notes
                .push(format!("{name}: stamps of its images are {late_ms:+.2} ms late; shift the names of its files"));
        }
        found.cameras.push(CameraPart {
            name: name.clone(),
            frame: None,
            body_from_camera: body_from_source.map(|body| body * source_from_camera),
            model,
        });
    }
    let frame = if has_imu { "the inertial unit" } else { "cam0" };
    found.notes.push(format!("{} cameras of Kalibr; frame of the source: {frame}", found.cameras.len()));
    if has_imu {
        found.body_from_imu = body_from_source;
    }
    Ok(found)
}

fn is_camera(key: &str) -> bool {
    key.strip_prefix("cam").is_some_and(|number| !number.is_empty() && number.bytes().all(|b| b.is_ascii_digit()))
}

fn model(entry: &Node) -> Result<geometry::CameraModel, String> {
    let text = |key: &str| entry.get(key).and_then(Node::text).map(str::to_owned).ok_or_else(|| format!("no {key}"));
    let numbers = |key: &str| {
        let node = entry.get(key).ok_or_else(|| format!("no {key}"))?;
        node.numbers().map_err(|fault| fault.rule)
    };
    let camera_model = text("camera_model")?;
    if camera_model != "pinhole" {
        return Err(format!(
            "camera_model {camera_model:?} is not supported; must be pinhole (with radtan or equidistant)"
        ));
    }
    let intrinsics: [f64; 4] = numbers("intrinsics")?
        .try_into()
        .map_err(|found: Vec<f64>| format!("{} intrinsics; must be fx fy cx cy", found.len()))?;
    let resolution: [f64; 2] = numbers("resolution")?
        .try_into()
        .map_err(|found: Vec<f64>| format!("{} numbers of resolution; must be width and height", found.len()))?;
    let size = resolution.map(|side| side as u32);
    let distortion = text("distortion_model")?;
    let coefficients = if distortion == "none" { Vec::new() } else { numbers("distortion_coeffs")? };
    lens(Intrinsics { size, numbers: intrinsics }, &distortion, &coefficients)
}
