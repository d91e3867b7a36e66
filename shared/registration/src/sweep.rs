//! One revolution of a LiDAR.

pub(crate) mod eigen;
pub(crate) mod incidence;
pub(crate) mod neighborhood;
pub(crate) mod point;
pub(crate) mod range_image;

use crate::{RangeImage, TimedPoint};
use geometry::Stamp;
use incidence::incidences;
use messages::{SweepHeader, SweepPoint};

/// Spin direction of a sensor, seen from above.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SpinDirection {
    /// From left over front to right, as Velodyne sensors do.
    Clockwise,
    /// From right over front to left.
    Counterclockwise,
}

/// A revolution of a sensor whose recording has no point times.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Revolution {
    /// Direction.
    pub spin: SpinDirection,
    /// Time of the revolution, ns.
    pub duration_nanos: u32,
}

/// Sets the times of points from a recording without times: the times of a sensor that spins uniformly once in
/// `duration_nanos`, from rear to rear (-x), as in the sweeps of KITTI raw.
pub fn set_times_from_azimuth(points: &mut [TimedPoint], spin: SpinDirection, duration_nanos: u32) {
    for point in points {
        let [x, y, _] = point.position;
        let left = y.atan2(x) / std::f32::consts::TAU;
        let share = match spin {
            SpinDirection::Clockwise => 0.5 - left,
            SpinDirection::Counterclockwise => 0.5 + left,
        };
        // A point that is not finite gets the first time and is not used.
        point.offset_nanos = (f64::from(share.clamp(0.0, 1.0)) * f64::from(duration_nanos)) as u32;
    }
}

/// The returns of one revolution, and their neighborhood in a range image.
#[derive(Clone, Debug)]
pub struct Sweep {
    stamp: Stamp,
    points: Vec<TimedPoint>,
    duration_nanos: u32,
    image: RangeImage,
}

impl Sweep {
    /// Creates a sweep. `stamp` is the time of the first shot; without point times it is the time at which the sensor
    /// faces ahead. `n_rings` is the sensor's number of rings. If it is 0 or 1, or if all points have the same ring,
    /// the rows of the range image are elevation bins. Points that are not finite are never neighbors or features.
    pub fn new(stamp: Stamp, points: Vec<TimedPoint>, n_rings: u32) -> Self {
        let duration_nanos = points.iter().map(|point| point.offset_nanos).max().unwrap_or(0);
        let image = RangeImage::new(&points, n_rings);
        Self { stamp, points, duration_nanos, image }
    }
    /// Creates a sweep from points without times of a sensor that spins uniformly, from rear to rear. `stamp` is the
    /// time at which it faces ahead, as for a rigid sweep.
    pub fn spinning(stamp: Stamp, mut points: Vec<TimedPoint>, n_rings: u32, revolution: Revolution) -> Self {
        let Revolution { spin, duration_nanos } = revolution;
        set_times_from_azimuth(&mut points, spin, duration_nanos);
        Self::new(stamp.plus_nanos(-i64::from(duration_nanos / 2)), points, n_rings)
    }
    /// Creates a sweep from the rows of topic `sweep`. `untimed`: revolution of a sensor whose recording has no point
    /// times, see [`Sweep::spinning`]; `None` leaves the sweep rigid.
    pub fn from_rows(stamp: Stamp, header: &SweepHeader, rows: &[SweepPoint], untimed: Option<Revolution>) -> Self {
        let timed = |point: &SweepPoint| TimedPoint {
            position: [point.x, point.y, point.z],
            offset_nanos: if header.has_times == 0 { 0 } else { point.offset_nanos },
            ring: point.ring,
        };
        let points = rows.iter().map(timed).collect();
        match untimed.filter(|_| header.has_times == 0) {
            Some(revolution) => Self::spinning(stamp, points, header.n_rings, revolution),
            None => Self::new(stamp, points, header.n_rings),
        }
    }
    /// Time of the first shot.
    pub fn stamp(&self) -> Stamp {
        self.stamp
    }
    /// All returns, in the order given.
    pub fn points(&self) -> &[TimedPoint] {
        &self.points
    }
    /// Time from the stamp to the last return, ns; 0 if the recording has no point times.
    pub fn duration_nanos(&self) -> u32 {
        self.duration_nanos
    }
    /// Range image: ring by azimuth.
    pub fn image(&self) -> &RangeImage {
        &self.image
    }
    /// Middle between first and last shot: the time of the sweep's pose.
    pub fn mid_stamp(&self) -> Stamp {
        self.stamp.plus_nanos(i64::from(self.duration_nanos / 2))
    }
    /// Cosine of the angle of incidence per point, between its ray and the normal of the surface around it, 0 to 1; NaN
    /// without neighbors.
    pub fn incidences(&self) -> Vec<f32> {
        incidences(&self.image, &self.points)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spin_begins_at_the_rear_and_passes_the_sides_in_its_direction() {
        let at = |x: f32, y: f32| TimedPoint { position: [x, y, 1.0], offset_nanos: 7, ring: 0 };
        let mut points = [at(-5.0, 0.001), at(0.0, 5.0), at(5.0, 0.0), at(0.0, -5.0), at(-5.0, -0.001)];
        let nanos = |points: &[TimedPoint]| points.iter().map(|p| p.offset_nanos.div_ceil(1000)).collect::<Vec<_>>();
        set_times_from_azimuth(&mut points, SpinDirection::Clockwise, 100_000_000);
        for (found, expected) in nanos(&points).iter().zip([0, 25_000, 50_000, 75_000, 100_000]) {
            assert!(found.abs_diff(expected) < 10, "{found} us, expected {expected}");
        }
        set_times_from_azimuth(&mut points, SpinDirection::Counterclockwise, 100_000_000);
        for (found, expected) in nanos(&points).iter().zip([100_000, 75_000, 50_000, 25_000, 0]) {
            assert!(found.abs_diff(expected) < 10, "{found} us, expected {expected}");
        }
    }
}
