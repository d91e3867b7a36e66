//! The path of the antenna around a fix, from the odometry: the clock of the receiver may be wrong by some tenths of a
//! second.

use crate::recent_path::RecentPath;
use geometry::{Point3, Vector3};
use serde::{Deserialize, Serialize};

/// Time between positions, s and ns: velocities are means over twice this time, so errors of 1 cm become 3 cm/s.
const STEP_S: f64 = 0.25;
const STEP_NANOS: i64 = 250_000_000;
/// Number of positions on either side of the fix.
const N_SIDE: usize = 4;
const N: usize = 2 * N_SIDE + 1;

/// Positions of the antenna in odom axes, from a second before a fix to a second after it.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct AntennaTrack {
    /// Position at the fix, m.
    antenna_in_odom: Point3<f64>,
    /// Displacements from there, one every [`STEP_S`], m. Less than 100 m: rounding is below 4 µm.
    displacements: [[f32; 3]; N],
}

impl AntennaTrack {
    pub const HALF_SPAN_S: f64 = STEP_S * N_SIDE as f64;
    pub const HALF_SPAN_NANOS: i64 = STEP_NANOS * N_SIDE as i64;

    /// Creates the track; `None` if the path does not include the stamp. Beyond the ends of the path the velocity
    /// continues.
    pub fn new(path: &RecentPath, stamp: i64, antenna_in_body: &Point3<f64>) -> Option<Self> {
        let at = |stamp: i64| path.at(stamp).map(|odom_from_body| odom_from_body * antenna_in_body);
        let antenna_in_odom = at(stamp)?;
        let mut known: [Option<Vector3<f64>>; N] = [None; N];
        for (k, place) in known.iter_mut().enumerate() {
            *place = at(stamp + (k as i64 - N_SIDE as i64) * STEP_NANOS).map(|p| p - antenna_in_odom);
        }
        // Outwards from the fix.
        for side in 1..=N_SIDE {
            for (k, inner, next) in [
                (N_SIDE + side, N_SIDE + side - 1, (N_SIDE + side).wrapping_sub(2)),
                (N_SIDE - side, N_SIDE - side + 1, N_SIDE - side + 2),
            ] {
                if known[k].is_none() {
                    let a = known[inner].unwrap_or_default();
                    let b = known[next].unwrap_or_default();
                    known[k] = Some(a + (a - b));
                }
            }
        }
        let displacements = known.map(|displacement| displacement.unwrap_or_default().cast::<f32>().into());
        Some(Self { antenna_in_odom, displacements })
    }

    /// Position `seconds` after the stamp of the fix.
    pub fn at(&self, seconds: f64) -> Point3<f64> {
        let TrackPlace { k, share } = Self::place(seconds);
        // Catmull-Rom: cubic, with the velocities below at the ends.
        let p = self.displacement(k);
        let q = self.displacement(k + 1);
        let v = self.tangent(k);
        let w = self.tangent(k + 1);
        let s = share;
        let s2 = share * share;
        let s3 = share * share * share;
        let off = p * (2.0 * s3 - 3.0 * s2 + 1.0) + v * (s3 - 2.0 * s2 + s) + q * (3.0 * s2 - 2.0 * s3) + w * (s3 - s2);
        self.antenna_in_odom + off
    }

    /// Velocity `seconds` after the stamp of the fix, m/s.
    pub fn velocity(&self, seconds: f64) -> Vector3<f64> {
        let TrackPlace { k, share } = Self::place(seconds);
        (self.tangent(k) * (1.0 - share) + self.tangent(k + 1) * share) / STEP_S
    }

    fn place(seconds: f64) -> TrackPlace {
        let steps = (seconds / STEP_S + N_SIDE as f64).clamp(0.0, (N - 1) as f64);
        let k = (steps as usize).min(N - 2);
        TrackPlace { k, share: steps - k as f64 }
    }
    fn displacement(&self, k: usize) -> Vector3<f64> {
        Vector3::from(self.displacements[k]).cast()
    }
    /// Displacement per step around a position.
    fn tangent(&self, k: usize) -> Vector3<f64> {
        let before = k.saturating_sub(1);
        let after = (k + 1).min(N - 1);
        (self.displacement(after) - self.displacement(before)) / (after - before) as f64
    }
}

/// A time between two positions.
struct TrackPlace {
    /// Index of the position before.
    k: usize,
    /// Share of the step from there.
    share: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::{Isometry3, Pose};

    fn turning(seconds: f64) -> Pose {
        let angle = 0.5 * seconds;
        Isometry3::new(Vector3::new(16.0 * angle.sin(), 16.0 * (1.0 - angle.cos()), 0.0), Vector3::z() * angle)
    }

    fn track(from: f64, to: f64) -> AntennaTrack {
        let mut path = RecentPath::default();
        for k in (from * 10.0) as i64..=(to * 10.0) as i64 {
            path.push(k * 100_000_000, turning(k as f64 * 0.1));
        }
        AntennaTrack::new(&path, 1_500_000_000, &Point3::new(-1.0, 0.3, 1.8)).expect("two poses and more")
    }

    #[test]
    fn track_in_a_turn_follows_the_path() {
        let track = track(0.0, 3.0);
        for seconds in [-0.9, -0.4, -0.1, 0.0, 0.2, 0.63, 1.0] {
            let truth = |s: f64| turning(1.5 + s) * Point3::new(-1.0, 0.3, 1.8);
            assert!((track.at(seconds) - truth(seconds)).norm() < 0.05, "{seconds}");
            let velocity = (truth(seconds + 0.01) - truth(seconds - 0.01)) / 0.02;
            let bound = if seconds.abs() < 0.75 { 0.1 } else { 0.6 };
            assert!((track.velocity(seconds) - velocity).norm() < bound, "{seconds}");
        }
    }

    #[test]
    fn track_beyond_the_ends_of_the_path_keeps_the_velocity() {
        let short = track(1.2, 1.9);
        for seconds in [-1.0, 1.0] {
            let off = (short.at(seconds) - turning(1.5 + seconds) * Point3::new(-1.0, 0.3, 1.8)).norm();
            assert!(off < 2.5, "{off} m after {seconds} s");
        }
        assert!(AntennaTrack::new(&RecentPath::default(), 0, &Point3::origin()).is_none());
    }
}
