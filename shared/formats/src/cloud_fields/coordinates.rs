//! Map coordinates: hundreds of kilometers, where f32 has steps of centimeters to half a meter.

use super::RawCloud;
use super::ValueType;

/// Larger coordinates are map coordinates, m: no LiDAR has such a range.
const MAX_COORDINATE_M: f64 = 10_000.0;
/// Largest coordinate of a point of a map, m: the center of the earth is nearer.
const MAX_MAP_M: f64 = 1e8;
/// Least number of doubles that show that all were once f32.
const MIN_POINTS: usize = 50;
/// Points beyond the range of every LiDAR in a sweep, as a part of its points: reflections and noise are fewer.
const MAX_FAR: f64 = 0.1;

/// Whole meters that are subtracted from map coordinates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MapOrigin(pub [i64; 3]);

/// Reason why the coordinates of a file are not the coordinates of a sweep.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CoordinateFault {
    /// Map coordinates that have lost their precision.
    #[error(
        "point {index}: {axis} {value} m is a map coordinate, stored as f32 in steps of {step_m} m; export the sweeps in the frame \
         of the LiDAR, or with coordinates of 8 bytes (double)"
    )]
    Quantized {
        /// Index of the point.
        index: usize,
        /// `x`, `y` or `z`.
        axis: &'static str,
        /// The value found, m.
        value: f64,
        /// Distance of neighboring numbers of f32 there, m.
        step_m: f64,
    },
    /// A coordinate that is not on the earth.
    #[error("point {index}: {axis} {value} m is not a coordinate; must be up to {MAX_MAP_M} m")]
    OffEarth {
        /// Index of the point.
        index: usize,
        /// `x`, `y` or `z`.
        axis: &'static str,
        /// The value found, m.
        value: f64,
    },
    /// A cloud that is larger than the range of a LiDAR.
    #[error(
        "{percent:.0} % of the points are more than {limit_m} m from the origin of the LiDAR: a map, registered by another program, \
         and not one sweep; give one file for each revolution, in the frame of the LiDAR"
    )]
    Map {
        /// Points beyond the range, percent.
        percent: f64,
        /// Largest range, m.
        limit_m: f64,
    },
}

impl RawCloud {
    /// Origin of the map coordinates of a cloud: the median of each axis. `None` if most points have no map coordinates.
    pub fn map_origin(&self) -> Result<Option<MapOrigin>, CoordinateFault> {
        if !self.has_map_coordinates() {
            return Ok(None);
        }
        let returns = || (0..self.positions.len()).filter(|index| self.is_return(*index));
        for index in returns() {
            let far = (0..3).find(|axis| self.positions[index][*axis].abs() > MAX_MAP_M);
            if let Some(axis) = far {
                let value = self.positions[index][axis];
                return Err(CoordinateFault::OffEarth { index, axis: AXES[axis], value });
            }
        }
        if self.is_quantized() {
            let (index, axis) =
                returns().find_map(|index| Some((index, largest(self.positions[index])?))).unwrap_or((0, 0));
            let value = self.positions[index][axis];
            let single = value.abs() as f32;
            let step_m = f64::from(single.next_up()) - f64::from(single);
            return Err(CoordinateFault::Quantized { index, axis: AXES[axis], value, step_m });
        }
        let median = |axis: usize| {
            let mut values: Vec<f64> = returns().map(|index| self.positions[index][axis]).collect();
            let middle = values.len() / 2;
            *values.select_nth_unstable_by(middle, f64::total_cmp).1
        };
        Ok(Some(MapOrigin([0, 1, 2].map(|axis| median(axis).round() as i64))))
    }

    /// Whether most returns have a coordinate beyond the range of every LiDAR.
    pub fn has_map_coordinates(&self) -> bool {
        let mut n = 0_usize;
        let mut n_far = 0_usize;
        for index in (0..self.positions.len()).filter(|index| self.is_return(*index)) {
            n += 1;
            n_far += usize::from(largest(self.positions[index]).is_some());
        }
        n_far * 2 > n
    }

    /// Whether the coordinates have passed through f32.
    fn is_quantized(&self) -> bool {
        let is_single = |value: f64| !value.is_finite() || f64::from(value as f32) == value;
        self.position_type == ValueType::F32
            || (self.positions.len() >= MIN_POINTS
                && self.positions.as_flattened().iter().all(|value| is_single(*value)))
    }

    /// Fails if the cloud is larger than a sweep: `limit_m` is the largest range.
    pub fn check_extent(&self, origin: Option<MapOrigin>, limit_m: f64) -> Result<(), CoordinateFault> {
        let returns = (0..self.positions.len()).filter(|index| self.is_return(*index));
        let mut n = 0_usize;
        let mut n_far = 0_usize;
        for index in returns {
            let [x, y, z] = relative(self.positions[index], origin);
            n += 1;
            n_far += usize::from(x * x + y * y + z * z > limit_m * limit_m);
        }
        if n_far as f64 > MAX_FAR * n as f64 {
            return Err(CoordinateFault::Map { percent: 100.0 * n_far as f64 / n as f64, limit_m });
        }
        Ok(())
    }
}

const AXES: [&str; 3] = ["x", "y", "z"];

/// The axis of a map coordinate.
fn largest(position: [f64; 3]) -> Option<usize> {
    let axis = (0..3).max_by(|a, b| position[*a].abs().total_cmp(&position[*b].abs()))?;
    (position[axis].abs() > MAX_COORDINATE_M).then_some(axis)
}

/// A position after the origin is subtracted.
pub(super) fn relative(position: [f64; 3], origin: Option<MapOrigin>) -> [f64; 3] {
    let MapOrigin(origin) = origin.unwrap_or(MapOrigin([0; 3]));
    [0, 1, 2].map(|axis| position[axis] - origin[axis] as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud_fields::PointFlags;

    fn cloud(position_type: ValueType, shift: [f64; 3], radius_m: f64) -> RawCloud {
        let position = |k: usize| {
            let angle = k as f64 * 0.01;
            [shift[0] + radius_m * angle.cos(), shift[1] + radius_m * angle.sin(), shift[2] + 0.001 * k as f64]
        };
        let mut positions: Vec<[f64; 3]> = (0..628).map(position).collect();
        if position_type == ValueType::F32 {
            positions.as_flattened_mut().iter_mut().for_each(|value| *value = f64::from(*value as f32));
        }
        positions.push([f64::NAN; 3]);
        RawCloud {
            positions,
            position_type,
            intensities: None,
            beams: None,
            times: None,
            viewpoint: None,
            flags: PointFlags::default(),
        }
    }

    #[test]
    fn map_coordinates_of_8_bytes_get_an_origin_and_those_of_4_bytes_are_refused() {
        let utm = [452_150.0, 5_410_700.0, 94.0];
        let found = cloud(ValueType::F64, utm, 12.0).map_origin();
        assert_eq!(found, Ok(Some(MapOrigin([452_150, 5_410_700, 94]))));
        assert_eq!(cloud(ValueType::F64, utm, 12.0).check_extent(found.expect("is a map"), 300.0), Ok(()));
        assert_eq!(cloud(ValueType::F32, [0.0; 3], 250.0).map_origin(), Ok(None));
        let error = cloud(ValueType::F32, utm, 12.0).map_origin().expect_err("is quantized").to_string();
        assert!(error.contains("y 5410700 m is a map coordinate, stored as f32 in steps of 0.5 m"), "{error}");
        // Doubles that were once f32.
        let mut laundered = cloud(ValueType::F32, utm, 12.0);
        laundered.position_type = ValueType::F64;
        assert!(matches!(laundered.map_origin(), Err(CoordinateFault::Quantized { .. })));
        let error = cloud(ValueType::F64, [1e30, 0.0, 0.0], 12.0).map_origin().expect_err("off").to_string();
        assert!(error.contains("is not a coordinate"), "{error}");
    }

    #[test]
    fn map_of_a_drive_is_not_a_sweep() {
        let error = cloud(ValueType::F64, [0.0; 3], 900.0).check_extent(None, 300.0).expect_err("too large");
        assert!(error.to_string().contains("100 % of the points are more than 300 m"), "{error}");
        let mut noisy = cloud(ValueType::F64, [0.0; 3], 30.0);
        noisy.positions[3][0] = 1e6;
        assert_eq!(noisy.check_extent(None, 300.0), Ok(()));
    }
}
