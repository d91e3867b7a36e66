//! Points of labeled sweeps.

use messages::SubmapPoint;
use std::path::Path;

/// Bytes of a point of `SUSTechPOINTS`. The header names padding with a count of 0, so it does not give the true offsets.
const SUSTECH_BYTES: usize = 48;

/// The returns of a sweep: rows of x y z intensity (`bin`), or a binary `pcd` of `SUSTechPOINTS`.
pub fn read(path: &Path) -> Vec<SubmapPoint> {
    let bytes = std::fs::read(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let is_pcd = path.extension().is_some_and(|extension| extension == "pcd");
    let (rows, row_bytes, intensity_at) = if is_pcd {
        const END: &[u8] = b"DATA binary\n";
        let at = bytes.windows(END.len()).position(|window| window == END);
        let at = at.unwrap_or_else(|| panic!("{}: no line DATA binary", path.display()));
        let head = String::from_utf8_lossy(&bytes[..at]);
        let n_points: Option<usize> = head.lines().find_map(|line| line.strip_prefix("POINTS ")?.trim().parse().ok());
        let n_points = n_points.unwrap_or_else(|| panic!("{}: no number of POINTS", path.display()));
        let rows = &bytes[at + END.len()..];
        // Other bytes follow the points.
        let rows = rows.get(..n_points * SUSTECH_BYTES);
        (rows.unwrap_or_else(|| panic!("{}: less than {n_points} points", path.display())), SUSTECH_BYTES, 16)
    } else {
        (&bytes[..], 16, 12)
    };
    assert!(
        rows.len().is_multiple_of(row_bytes),
        "{}: {} bytes of points, not a multiple of {row_bytes}",
        path.display(),
        rows.len()
    );
    let float = |row: &[u8], at: usize| f32::from_le_bytes([row[at], row[at + 1], row[at + 2], row[at + 3]]);
    let point = |row: &[u8]| {
        let [x, y, z] = [0, 4, 8].map(|at| float(row, at));
        let azimuth = (((-y).atan2(x).to_degrees().rem_euclid(360.0) * 100.0) as u16).min(35_999);
        let elevation = (z.atan2(x.hypot(y)).to_degrees() * 100.0).round() as i16;
        let intensity = float(row, intensity_at).round().clamp(0.0, 255.0) as u8;
        SubmapPoint { x, y, z, azimuth, elevation, intensity, ..SubmapPoint::default() }
    };
    let returns = rows.chunks_exact(row_bytes).map(point);
    returns.filter(|p| p.x.is_finite() && p.y.is_finite() && p.z.is_finite() && p.x.hypot(p.y) > 0.0).collect()
}
