//! Sweeps that are one cloud file each, without firing times.

use crate::cloud::CloudPoint;
use crate::velodyne::{LidarReturn, Model, SweepReader};
use crate::{kitti, pcd};
use std::path::Path;

/// Closer to the sensor is no return: some files keep missing ones as 0 0 0.
const MIN_RANGE_M: f32 = 0.1;

/// The returns of a cloud file.
pub(super) fn load(path: &Path, format: &str, model: Model) -> Result<Vec<LidarReturn>, String> {
    let bytes = std::fs::read(path).map_err(|error| error.to_string())?;
    let points = match format {
        "bin" => kitti::points_from_bin(&bytes).map_err(|error| error.to_string())?,
        _ => pcd::points_from_pcd(&bytes).map_err(|error| error.to_string())?,
    };
    let returns = returns_from_cloud(&points, model);
    let limit = SweepReader::MAX_RETURNS;
    if returns.len() > limit {
        return Err(format!("{} points, must be at most {limit}", returns.len()));
    }
    Ok(returns)
}

/// Returns in the order of the file, without times. Points that are not finite or within 0.1 m are left out. The azimuth is
/// that of the point, the ring that of the nearest beam by elevation; intensities from 0 to 1 become 0 to 255.
pub fn returns_from_cloud(points: &[CloudPoint], model: Model) -> Vec<LidarReturn> {
    let rings = Rings::new(model);
    let is_share = points.iter().all(|p| p.intensity <= 1.0);
    let scale = if is_share { 255.0 } else { 1.0 };
    let is_return = |p: &&CloudPoint| {
        let range_m = (p.x * p.x + p.y * p.y + p.z * p.z).sqrt();
        range_m.is_finite() && range_m > MIN_RANGE_M
    };
    let one = |p: &CloudPoint| LidarReturn {
        x: p.x,
        y: p.y,
        z: p.z,
        offset_nanos: 0,
        // Clockwise in 0.01 deg.
        azimuth: ((-p.y.atan2(p.x).to_degrees() * 100.0).round() as i32).rem_euclid(36_000) as u16,
        intensity: (p.intensity * scale).round().clamp(0.0, 255.0) as u8,
        ring: rings.nearest(p.z.atan2(p.x.hypot(p.y))),
    };
    points.iter().filter(is_return).map(one).collect()
}

/// Nominal elevations of a model's beams, lowest first, rad.
struct Rings(Vec<f32>);

impl Rings {
    fn new(model: Model) -> Self {
        let degrees: Vec<f64> = match model {
            // Clouds of this model are corrected for their device's own angles; what is left are the nominal ones: 32 beams
            // from -24.33 deg up by 1/2 deg, 32 from -8.33 to 2 deg by 1/3 deg.
            Model::Hdl64e => {
                let lower = (0..32).map(|i| -24.33 + 15.5 / 31.0 * f64::from(i));
                lower.chain((0..32).map(|i| -8.33 + 10.33 / 31.0 * f64::from(i))).collect()
            }
            Model::Hdl32e | Model::Vlp16 => model.lasers().iter().map(|laser| laser.elevation_deg).collect(),
        };
        let mut elevations: Vec<f32> = degrees.iter().map(|degrees| degrees.to_radians() as f32).collect();
        elevations.sort_by(f32::total_cmp);
        Self(elevations)
    }

    fn nearest(&self, elevation: f32) -> u8 {
        let above = self.0.partition_point(|e| *e < elevation).clamp(1, self.0.len() - 1);
        let lower_is_nearer = elevation - self.0[above - 1] < self.0[above] - elevation;
        (if lower_is_nearer { above - 1 } else { above }) as u8
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rings_and_azimuths_follow_the_beams() {
        for model in Model::ALL {
            if model == Model::Hdl64e {
                continue;
            }
            let rings = model.rings();
            for (laser, ring) in model.lasers().iter().zip(&rings) {
                let elevation = laser.elevation_deg.to_radians() as f32;
                let (sin, cos) = elevation.sin_cos();
                // 30 degrees to the right.
                let point = CloudPoint { x: 8.660_254 * cos, y: -5.0 * cos, z: 10.0 * sin, intensity: 0.5 };
                let [found] = returns_from_cloud(&[point], model).try_into().expect("one");
                assert_eq!((found.ring, found.azimuth, found.intensity), (*ring, 3000, 128));
            }
        }
        let at = |degrees: f32| CloudPoint { x: 10.0, z: 10.0 * degrees.to_radians().tan(), ..CloudPoint::default() };
        let found = returns_from_cloud(&[-40.0, -24.3, -8.83, -8.33, 1.9, 20.0].map(at), Model::Hdl64e);
        assert_eq!(found.iter().map(|r| r.ring).collect::<Vec<_>>(), [0, 0, 31, 32, 63, 63]);
    }

    #[test]
    fn what_is_no_return_is_left_out() {
        let far = CloudPoint { x: -5.0, intensity: 200.0, ..CloudPoint::default() };
        let bad = CloudPoint { z: f32::NAN, ..far };
        let found = returns_from_cloud(&[CloudPoint::default(), bad, far], Model::Hdl64e);
        assert_eq!(found.len(), 1);
        assert_eq!((found[0].intensity, found[0].azimuth), (200, 18_000));
    }
}
