//! Points of cloud files.

/// x, y, z and intensity as stored in the file.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CloudPoint {
    /// x, m.
    pub x: f32,
    /// y, m.
    pub y: f32,
    /// z, m.
    pub z: f32,
    /// Intensity; 0 if the file has no intensities.
    pub intensity: f32,
}

/// A point with its beam and its time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FiredPoint {
    /// The point.
    pub point: CloudPoint,
    /// Beam, 0 = lowest; 0 if the file has no beams.
    pub ring: u8,
    /// Time after the sweep's stamp, ns; 0 if the file has no times.
    pub offset_nanos: u32,
}

/// The points of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FiredCloud {
    /// The points, in the order of the file.
    pub points: Vec<FiredPoint>,
    /// Whether the file has rings.
    pub has_rings: bool,
    /// Whether the file has times.
    pub has_times: bool,
}

/// Longest range of a point, m: more than twice the range of every supported sensor.
pub const MAX_RANGE_M: f32 = 300.0;

/// Error of a point that no supported LiDAR measures.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("point {index}: {quantity} {value} must be 0 to {limit}")]
pub struct ImplausiblePoint {
    /// Index of the point.
    pub index: usize,
    /// `range in m` or `intensity`.
    pub quantity: &'static str,
    /// The value found.
    pub value: f32,
    /// Largest value.
    pub limit: f32,
}

/// Fails at the first point beyond [`MAX_RANGE_M`] or with an intensity outside 0 to `max_intensity`. Bytes of another layout fail
/// within their first points. Missing returns may be NaN, but not most points.
pub fn check_points(points: &[CloudPoint], max_intensity: f32) -> Result<(), ImplausiblePoint> {
    let is_missing = |p: &CloudPoint| [p.x, p.y, p.z].iter().any(|value| value.is_nan());
    let most_are_missing = 2 * points.iter().filter(|p| is_missing(p)).count() > points.len();
    for (index, p) in points.iter().enumerate() {
        if is_missing(p) && !most_are_missing {
            continue;
        }
        let range_m = (p.x * p.x + p.y * p.y + p.z * p.z).sqrt();
        for (quantity, value, limit) in
            [("range in m", range_m, MAX_RANGE_M), ("intensity", p.intensity, max_intensity)]
        {
            if !(0.0..=limit).contains(&value) {
                return Err(ImplausiblePoint { index, quantity, value, limit });
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn implausible_points_are_found() {
        let good = CloudPoint { x: 3.0, y: -4.0, z: 0.0, intensity: 1.0 };
        assert_eq!(check_points(&[good, CloudPoint::default()], 1.0), Ok(()));
        for (bad, quantity) in [
            (CloudPoint { x: 300.0, ..good }, "range in m"),
            (CloudPoint { z: f32::INFINITY, ..good }, "range in m"),
            (CloudPoint { intensity: 4.0, ..good }, "intensity"),
            (CloudPoint { intensity: -0.1, ..good }, "intensity"),
        ] {
            let found = check_points(&[good, bad], 1.0).expect_err("is implausible");
            assert_eq!((found.index, found.quantity), (1, quantity));
        }
        let missing = CloudPoint { x: f32::NAN, ..good };
        assert_eq!(check_points(&[good, missing, good], 1.0), Ok(()));
        assert_eq!(check_points(&[good, missing, missing], 1.0).expect_err("is implausible").index, 1);
    }
}
