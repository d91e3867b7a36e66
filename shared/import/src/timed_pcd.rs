//! PCD files of points with their times.

use formats::cloud::CloudPoint;

/// Content of a binary file: x y z intensity as f32, `t` as u32, ns after the stamp of the sweep.
pub(crate) fn timed_pcd(points: &[(CloudPoint, u32)]) -> Vec<u8> {
    let n = points.len();
    let mut bytes = format!(
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z intensity t\nSIZE 4 4 4 4 4\nTYPE F F F F U\n\
         COUNT 1 1 1 1 1\nWIDTH {n}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {n}\nDATA binary\n"
    )
    .into_bytes();
    for (p, offset_nanos) in points {
        bytes.extend([p.x, p.y, p.z, p.intensity].map(f32::to_le_bytes).as_flattened());
        bytes.extend(offset_nanos.to_le_bytes());
    }
    bytes
}
