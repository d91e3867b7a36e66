//! The LiDAR of a submap above the ground that it drives on: whether the ground is where the mounting of the LiDAR puts it.

use std::fmt::{self, Display, Formatter};
use std::ops::RangeInclusive;

mod corridor;

use crate::sample::sample_step;
use crate::sweep_positions::sweep_positions;
use corridor::Corridor;
use messages::{SubmapHeader, SubmapPoint};

/// Number of examined positions of the LiDAR.
const MAX_POSITIONS: usize = 8;
/// With fewer points, a submap is not judged: it may be a drive's last sweep.
const MIN_POINTS: usize = 1000;
/// Largest horizontal distance of ground near the path, m. The lowest ring of a VLP-16 on a van meets the road at 9 m.
const NEAR_M: f64 = 15.0;
/// Largest distance of ground points from the terrain, m.
const GROUND_M: f32 = 0.15;
/// Least number of ground points near a position.
const MIN_NEAR: f64 = 30.0;
/// Heights of LiDARs above the ground, m: from a robot or a person who stoops to a mast on a van.
/// These limits were not fitted to drives: KITTI raw 0048, Annieway durlacher and simulated drives of four rigs have 1.7 to 3.0 m.
const HEIGHTS_M: RangeInclusive<f32> = 0.7..=4.0;
/// Largest slope of ground relative to the horizontal plane of the body at the start, degrees: a
/// drive from one side of a pass of 17 % to the other has 19. The drives above have at most 2.1.
const MAX_SLOPE_DEG: f32 = 20.0;

/// Half the width of the corridor along the path in which a vehicle has ground, m.
const CORRIDOR_ACROSS_M: f64 = 2.0;
/// Least number of ground points in the corridor of a position. Good drives have 100 times as many.
const MIN_IN_CORRIDOR: u32 = 5;
/// Largest share of the positions without ground in the corridor. Vehicles around a LiDAR hide the ground at some positions.
const MAX_BARE_SHARE: f32 = 0.5;

/// The LiDAR above the ground near its path.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum LidarAboveGround {
    /// The submap has no position of the LiDAR, or hardly a point.
    #[default]
    Unknown,
    /// There is no ground near the path.
    NoGround,
    /// There is ground near the path.
    Found {
        /// Height of the first LiDAR above it, m; median of several positions.
        height_m: f32,
        /// Angle between the ground and the horizontal plane of the submap, degrees; median as well.
        slope_deg: f32,
        /// Positions of the LiDAR that have a direction of travel; 0 if the LiDAR stood.
        n_directed: u32,
        /// The ones without ground in the corridor ahead and behind.
        n_bare: u32,
    },
}

/// Why the mounting of the LiDAR cannot be right.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MountingFault {
    /// There is no ground near the path.
    NoGround,
    /// The LiDAR is lower or higher than on a vehicle or a person.
    Height,
    /// The ground is steeper than any street.
    Slope,
    /// There is ground at the sides of the path, but not on it: tops of walls, or feet of facades.
    OffPath,
}

impl MountingFault {
    /// All faults.
    pub const ALL: [Self; 4] = [Self::NoGround, Self::Height, Self::Slope, Self::OffPath];
}

impl Display for MountingFault {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoGround => f.write_str("no ground near the path"),
            Self::Height => write!(f, "LiDAR not {} to {} m above the ground", HEIGHTS_M.start(), HEIGHTS_M.end()),
            Self::Slope => write!(f, "ground inclined by more than {MAX_SLOPE_DEG} degrees"),
            Self::OffPath => write!(
                f,
                "ground at the sides but not within {CORRIDOR_ACROSS_M} m across and {NEAR_M} m along the path, {} to {} m below the LiDAR,",
                HEIGHTS_M.start(),
                HEIGHTS_M.end()
            ),
        }
    }
}

impl LidarAboveGround {
    /// The fault of the mounting that this shows.
    pub fn fault(&self) -> Option<MountingFault> {
        match self {
            Self::Unknown => None,
            Self::NoGround => Some(MountingFault::NoGround),
            Self::Found { height_m, .. } if !HEIGHTS_M.contains(height_m) => Some(MountingFault::Height),
            Self::Found { slope_deg, .. } if *slope_deg > MAX_SLOPE_DEG => Some(MountingFault::Slope),
            Self::Found { n_directed, n_bare, .. } => {
                (*n_bare as f32 > MAX_BARE_SHARE * *n_directed as f32).then_some(MountingFault::OffPath)
            }
        }
    }

    /// Finds the ground near the positions of the first LiDAR. `heights_m` are the heights of the points above the
    /// terrain.
    pub fn find(header: &SubmapHeader, points: &[SubmapPoint], heights_m: &[f32]) -> Self {
        let places = places(header);
        if places.is_empty() || points.len() < MIN_POINTS {
            return Self::Unknown;
        }
        let mut planes = vec![Plane::default(); places.len()];
        let mut corridors: Vec<Corridor> = places.iter().filter_map(|place| place.corridor).collect();
        for (point, height_m) in points.iter().zip(heights_m).step_by(sample_step(points.len())) {
            // False for NaN.
            if height_m.abs() <= GROUND_M {
                let point = [point.x, point.y, point.z].map(f64::from);
                planes.iter_mut().zip(&places).for_each(|(plane, place)| plane.add(point, &place.position));
                for corridor in &mut corridors {
                    corridor.add(point);
                }
            }
        }
        let found: Vec<[f32; 2]> = planes.iter().filter_map(Plane::height_and_slope).collect();
        if 2 * found.len() < places.len() {
            return Self::NoGround;
        }
        let median = |of: usize| {
            let mut values: Vec<f32> = found.iter().map(|found| found[of]).collect();
            let middle = values.len() / 2;
            *values.select_nth_unstable_by(middle, f32::total_cmp).1
        };
        let n_bare = corridors.iter().filter(|corridor| corridor.n_points < MIN_IN_CORRIDOR).count();
        Self::Found {
            height_m: median(0),
            slope_deg: median(1),
            n_directed: corridors.len() as u32,
            n_bare: n_bare as u32,
        }
    }
}

/// A position of the first LiDAR.
struct Place {
    position: [f64; 3],
    /// The corridor along the path there; `None` if the LiDAR stood.
    corridor: Option<Corridor>,
}

/// Positions of the first LiDAR at the start of some sweeps with points, evenly spaced.
fn places(header: &SubmapHeader) -> Vec<Place> {
    let all: Vec<[f64; 3]> = sweep_positions(header).map(|sweep| sweep.begin).collect();
    let step = all.len().div_ceil(MAX_POSITIONS).max(1);
    let place = |index: usize| Place { position: all[index], corridor: Corridor::new(&all, index) };
    (0..all.len()).step_by(step).map(place).collect()
}

/// Sums of ground points relative to a position of the LiDAR, for the plane through them.
#[derive(Clone, Copy, Default)]
struct Plane {
    n: f64,
    sums: [f64; 3],
    /// Sums of xx, xy, yy, xz, yz.
    products: [f64; 5],
}

impl Plane {
    fn add(&mut self, point: [f64; 3], position: &[f64; 3]) {
        let [x, y, z] = std::array::from_fn(|axis| point[axis] - position[axis]);
        if x * x + y * y > NEAR_M * NEAR_M {
            return;
        }
        self.n += 1.0;
        self.sums.iter_mut().zip([x, y, z]).for_each(|(sum, value)| *sum += value);
        self.products.iter_mut().zip([x * x, x * y, y * y, x * z, y * z]).for_each(|(sum, value)| *sum += value);
    }

    /// Height of the position above the plane, m, and slope of the plane, degrees; `None` if too few points determine
    /// it.
    fn height_and_slope(&self) -> Option<[f32; 2]> {
        if self.n < MIN_NEAR {
            return None;
        }
        let [x, y, z] = self.sums.map(|sum| sum / self.n);
        let [xx, xy, yy, xz, yz] = self.products.map(|sum| sum / self.n);
        let [xx, xy, yy, xz, yz] = [xx - x * x, xy - x * y, yy - y * y, xz - x * z, yz - y * z];
        let determinant = xx * yy - xy * xy;
        if determinant < 1e-3 {
            return None;
        }
        let rise = [(xz * yy - yz * xy) / determinant, (yz * xx - xz * xy) / determinant];
        let below = z - rise[0] * x - rise[1] * y;
        let slope_deg = rise[0].hypot(rise[1]).atan().to_degrees();
        Some([-below as f32, slope_deg as f32])
    }
}
