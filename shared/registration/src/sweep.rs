//! One revolution as this crate sees it.

use crate::RangeImage;
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
    /// Cosine of the angle between the ray of a point and the surface around it, 0 to 1; `None` where the neighbors do
    /// not tell.
    pub fn incidence(&self, point_idx: usize) -> Option<f32> {
        self.image.incidence(&self.points, point_idx)
    }
}
