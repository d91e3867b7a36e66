//! One revolution as this crate sees it.

use crate::RangeImage;
use crate::incidence::incidences;
use crate::range_image::fast_atan2;
use geometry::Stamp;

/// One return.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimedPoint {
    /// x y z, m, lidar frame at the time of the shot.
    pub position: [f32; 3],
    /// ns after the sweep's stamp.
    pub offset_nanos: u32,
    /// Beam, 0 = lowest.
    pub ring: u8,
}

/// Sense in which a sensor turns, seen from its top.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Turn {
    /// From left over ahead to right, as Velodynes do.
    Clockwise,
    /// From right over ahead to left.
    Counterclockwise,
}

/// Gives points of a recording without times the times at which a sensor fires there that turns evenly once in
/// `duration_nanos`, beginning and ending behind (along -x): so are the sweeps of KITTI raw cut.
pub fn set_times_from_azimuth(points: &mut [TimedPoint], turn: Turn, duration_nanos: u32) {
    for point in points {
        let [x, y, _] = point.position;
        let left = y.atan2(x) / std::f32::consts::TAU;
        let share = match turn {
            Turn::Clockwise => 0.5 - left,
            Turn::Counterclockwise => 0.5 + left,
        };
        // A point that is no number is shot first and never used.
        point.offset_nanos = (f64::from(share.clamp(0.0, 1.0)) * f64::from(duration_nanos)) as u32;
    }
}

/// The returns of one revolution and how they lie beside each other.
#[derive(Clone, Debug)]
pub struct Sweep {
    stamp: Stamp,
    points: Vec<TimedPoint>,
    duration_nanos: u32,
    image: RangeImage,
}

impl Sweep {
    /// `stamp` is the time of the first shot. `n_rings` is the sensor's; where it is 0 or 1, or all points have the
    /// same ring, rows are made from the elevation. Points that are not finite are never neighbors or features.
    pub fn new(stamp: Stamp, points: Vec<TimedPoint>, n_rings: u32) -> Self {
        let duration_nanos = points.iter().map(|point| point.offset_nanos).max().unwrap_or(0);
        let image = RangeImage::new(&points, n_rings);
        Self { stamp, points, duration_nanos, image }
    }
    /// Time of the first shot.
    pub fn stamp(&self) -> Stamp {
        self.stamp
    }
    /// All returns, in the order given.
    pub fn points(&self) -> &[TimedPoint] {
        &self.points
    }
    /// ns from the stamp to the last return; 0 where the recording has no point times.
    pub fn duration_nanos(&self) -> u32 {
        self.duration_nanos
    }
    /// Ring by azimuth.
    pub fn image(&self) -> &RangeImage {
        &self.image
    }
    /// Middle between first and last shot: the time to which the sweep's pose belongs.
    pub fn mid_stamp(&self) -> Stamp {
        self.stamp.plus_nanos(i64::from(self.duration_nanos / 2))
    }
    /// By point the cosine of the angle between its ray and the surface around it, 0 to 1; NaN where the neighbors do not
    /// tell.
    pub fn incidences(&self) -> Vec<f32> {
        incidences(&self.image, &self.points)
    }
    /// Angle of the ray of a point over the lidar's horizontal plane, rad, within 2e-5.
    #[inline]
    pub fn elevation(&self, point_idx: usize) -> f32 {
        let [x, y, z] = self.points[point_idx].position;
        fast_atan2(z, (x * x + y * y).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turn_begins_behind_and_passes_its_first_side_before_its_second() {
        let at = |x: f32, y: f32| TimedPoint { position: [x, y, 1.0], offset_nanos: 7, ring: 0 };
        let mut points = [at(-5.0, 0.001), at(0.0, 5.0), at(5.0, 0.0), at(0.0, -5.0), at(-5.0, -0.001)];
        let nanos = |points: &[TimedPoint]| points.iter().map(|p| p.offset_nanos.div_ceil(1000)).collect::<Vec<_>>();
        set_times_from_azimuth(&mut points, Turn::Clockwise, 100_000_000);
        for (found, expected) in nanos(&points).iter().zip([0, 25_000, 50_000, 75_000, 100_000]) {
            assert!(found.abs_diff(expected) < 10, "{found} us, expected {expected}");
        }
        set_times_from_azimuth(&mut points, Turn::Counterclockwise, 100_000_000);
        for (found, expected) in nanos(&points).iter().zip([100_000, 75_000, 50_000, 25_000, 0]) {
            assert!(found.abs_diff(expected) < 10, "{found} us, expected {expected}");
        }
    }
}
