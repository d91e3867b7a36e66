//! The pose of the sensor that PCL writes as an element `camera`.

use super::packed::packed_rows;
use super::reader::{is_plain, plain_rows, scalar_properties};
use ply_rs::ply::{Encoding, Header};
use std::path::Path;

/// Name of the element.
const CAMERA: &str = "camera";
/// Position and axes, with the numbers of the identity.
const POSE: [(&str, f64); 12] = [
    ("view_px", 0.0),
    ("view_py", 0.0),
    ("view_pz", 0.0),
    ("x_axisx", 1.0),
    ("x_axisy", 0.0),
    ("x_axisz", 0.0),
    ("y_axisx", 0.0),
    ("y_axisy", 1.0),
    ("y_axisz", 0.0),
    ("z_axisx", 0.0),
    ("z_axisy", 0.0),
    ("z_axisz", 1.0),
];
/// Axes of unit length are rounded to f32.
const ROUNDING: f64 = 1e-6;

/// The numbers of a pose that differ from the identity, as a text. `None` without a camera, or if its row is damaged: no
/// point depends on it.
pub(super) fn viewpoint(head: &Header, bytes: &[u8], start: usize, path: &Path) -> Option<String> {
    let camera = head.elements.get(CAMERA)?;
    let row = if head.encoding == Encoding::BinaryLittleEndian && is_plain(head, camera) {
        bytes.get(plain_rows(head, CAMERA, start, bytes.len(), path).ok()?)?.to_vec()
    } else {
        packed_rows(head, CAMERA, bytes, start, path).ok()?
    };
    let mut at = 0;
    let mut values = Vec::new();
    for property in scalar_properties(camera) {
        values.push((property.name, property.kind.value(row.get(at..)?)));
        at += property.kind.size();
    }
    let other = |(name, identity): &(&str, f64)| {
        let (_, value) = values.iter().find(|(found, _)| found == name)?;
        ((value - identity).abs() > ROUNDING).then(|| format!("{name} {value}"))
    };
    let differing: Vec<String> = POSE.iter().filter_map(other).collect();
    (!differing.is_empty()).then(|| format!("the element camera ({})", differing.join(", ")))
}

#[cfg(test)]
mod tests {
    use crate::ply::Vertices;
    use std::path::Path;

    /// A file of PCL: a point and a camera.
    fn file(encoding: &str, camera: [f32; 12]) -> Vec<u8> {
        let properties = super::POSE.map(|(name, _)| format!("property float {name}\n")).concat();
        let head = format!(
            "ply\nformat {encoding} 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nelement camera 1\n\
             {properties}property int viewportx\nend_header\n"
        );
        let values = [1.0, 2.0, 3.0].into_iter().chain(camera);
        if encoding == "ascii" {
            let words: Vec<String> = values.map(|value: f32| value.to_string()).collect();
            let (point, camera) = words.split_at(3);
            return format!("{head}{}\n{} 1\n", point.join(" "), camera.join(" ")).into_bytes();
        }
        let bytes =
            values.flat_map(|value| if encoding.contains("big") { value.to_be_bytes() } else { value.to_le_bytes() });
        head.into_bytes().into_iter().chain(bytes).chain([0; 4]).collect()
    }

    #[test]
    fn camera_of_pcl_that_is_not_the_identity_is_named() {
        let identity = super::POSE.map(|(_, value)| value as f32);
        let mut moved = identity;
        (moved[0], moved[2], moved[3]) = (10.5, 1.5, 0.0);
        for encoding in ["ascii", "binary_little_endian", "binary_big_endian"] {
            let viewpoint = |camera: [f32; 12]| {
                let vertices = Vertices::decode(file(encoding, camera), Path::new("a.ply")).expect("decodes");
                assert_eq!(vertices.f64s("z").expect("is there"), [3.0]);
                vertices.raw_cloud().expect("a cloud").viewpoint
            };
            assert_eq!(viewpoint(identity), None, "{encoding}");
            let text = "the element camera (view_px 10.5, view_pz 1.5, x_axisx 0)";
            assert_eq!(viewpoint(moved).as_deref(), Some(text), "{encoding}");
        }
    }
}
