//! The corridor along the path of the LiDAR, in which a vehicle has ground below it.

use super::{CORRIDOR_ACROSS_M, HEIGHTS_M, NEAR_M};

/// The direction at a position is the chord between positions this far before and behind it, m.
const CHORD_M: f64 = 3.0;
/// A shorter chord has no direction, m.
const MIN_CHORD_M: f64 = 1.0;

/// Ground points within a corridor along the path, ahead of and behind a position of the LiDAR.
#[derive(Clone, Copy)]
pub(super) struct Corridor {
    position: [f64; 3],
    /// Direction of travel in the horizontal plane, of length 1.
    direction: [f64; 2],
    /// Rise of the path per horizontal metre. The ground of a hill rises with the path.
    rise: f64,
    /// Ground points found.
    pub n_points: u32,
}

impl Corridor {
    /// The corridor at one of the positions of a path; `None` if the LiDAR stood there.
    pub fn new(path: &[[f64; 3]], index: usize) -> Option<Self> {
        let position = path[index];
        let is_far = |place: &&[f64; 3]| (place[0] - position[0]).hypot(place[1] - position[1]) >= CHORD_M;
        let behind = path[..index].iter().rev().find(is_far).unwrap_or(&path[0]);
        let ahead = path[index..].iter().find(is_far).or(path.last())?;
        let [x, y, z] = std::array::from_fn(|axis| ahead[axis] - behind[axis]);
        let length = x.hypot(y);
        (length >= MIN_CHORD_M).then(|| Self {
            position,
            direction: [x / length, y / length],
            rise: z / length,
            n_points: 0,
        })
    }

    /// Counts a ground point within the corridor.
    pub fn add(&mut self, point: [f64; 3]) {
        let [x, y, z] = std::array::from_fn(|axis| point[axis] - self.position[axis]);
        let along = x * self.direction[0] + y * self.direction[1];
        let across = y * self.direction[0] - x * self.direction[1];
        let below = along * self.rise - z;
        let is_inside = along.abs() <= NEAR_M && across.abs() <= CORRIDOR_ACROSS_M;
        self.n_points += u32::from(is_inside && HEIGHTS_M.contains(&(below as f32)));
    }
}
