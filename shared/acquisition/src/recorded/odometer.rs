//! Path length between two times, by position fixes.

use geometry::Stamp;
use lidar::nmea::Fix;

/// Largest gap between fixes. Over a longer gap the path length is unknown.
const MAX_GAP_S: f64 = 5.0;
/// Mean radius of the earth, m; good to 0.5 % for distances.
const EARTH_M: f64 = 6_371_000.0;

/// The path length along the fixes: the integral of the speed, or the distance of positions without a speed. Receivers measure
/// speed by Doppler shift to centimetres per second, while positions jitter by decimetres.
#[derive(Debug)]
pub(crate) struct Odometer {
    marks: Vec<Mark>,
}

#[derive(Clone, Copy, Debug)]
struct Mark {
    stamp: Stamp,
    /// Path length since the first fix.
    path_m: f64,
    /// Speed here, and acceleration until the next mark.
    speed_mps: f64,
    acceleration: f64,
    /// Whether the next mark follows without a gap.
    is_followed: bool,
}

impl Odometer {
    pub(crate) fn new(fixes: &[Fix]) -> Self {
        let mut marks: Vec<Mark> = Vec::with_capacity(fixes.len());
        let mut path_m = 0.0;
        for (index, fix) in fixes.iter().enumerate() {
            let mut mark = Mark { stamp: fix.stamp, path_m, speed_mps: 0.0, acceleration: 0.0, is_followed: false };
            if let Some(next) = fixes.get(index + 1) {
                let seconds = next.stamp.seconds_since(fix.stamp);
                (mark.speed_mps, mark.acceleration) = match (fix.speed_mps, next.speed_mps) {
                    (Some(from), Some(to)) => (from, (to - from) / seconds),
                    _ => (distance_m(fix.position_deg, next.position_deg) / seconds, 0.0),
                };
                mark.is_followed = seconds <= MAX_GAP_S;
                path_m += mark.path_after(seconds);
            }
            marks.push(mark);
        }
        Self { marks }
    }

    /// Path length between two times, m; `None` outside of the fixes and over gaps.
    pub(crate) fn between(&self, from: Stamp, to: Stamp) -> Option<f64> {
        let first = self.mark_before(from)?;
        let last = self.mark_before(to)?;
        let known = self.marks[first..=last].iter().all(|mark| mark.is_followed || mark.stamp == to);
        known.then(|| self.path_at(last, to) - self.path_at(first, from))
    }

    /// Index of the last mark at or before a time; `None` after the last fix.
    fn mark_before(&self, stamp: Stamp) -> Option<usize> {
        let after = self.marks.partition_point(|mark| mark.stamp <= stamp);
        let index = after.checked_sub(1)?;
        (after < self.marks.len() || self.marks[index].stamp == stamp).then_some(index)
    }

    fn path_at(&self, index: usize, stamp: Stamp) -> f64 {
        let mark = &self.marks[index];
        mark.path_m + mark.path_after(stamp.seconds_since(mark.stamp))
    }
}

impl Mark {
    fn path_after(&self, seconds: f64) -> f64 {
        seconds * (self.speed_mps + 0.5 * self.acceleration * seconds)
    }
}

/// Distance on a sphere, by the formula for short distances.
fn distance_m(from: [f64; 2], to: [f64; 2]) -> f64 {
    let north = (to[0] - from[0]).to_radians();
    // Also valid across the date line.
    let east = ((to[1] - from[1] + 540.0).rem_euclid(360.0) - 180.0).to_radians() * from[0].to_radians().cos();
    EARTH_M * north.hypot(east)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A vehicle that drives east with these speeds at whole seconds.
    pub(crate) fn fixes(speeds: &[f64]) -> Vec<Fix> {
        let mut path_m = 0.0;
        let mut fix = |(second, speed): (usize, &f64)| {
            let longitude = 2.0 + (path_m / (EARTH_M * 48_f64.to_radians().cos())).to_degrees();
            path_m += 0.5 * (speed + speeds.get(second + 1).unwrap_or(speed));
            Fix {
                stamp: Stamp(second as i64 * 1_000_000_000),
                position_deg: [48.0, longitude],
                altitude_m: Some(100.0),
                speed_mps: Some(*speed),
                course_deg: None,
                hdop: None,
                satellites: 9,
                quality: 1,
                vdop: None,
                deviation: None,
            }
        };
        speeds.iter().enumerate().map(&mut fix).collect()
    }

    fn at(seconds: f64) -> Stamp {
        Stamp::from_seconds(seconds)
    }

    #[test]
    fn path_by_speeds_equals_path_by_positions() {
        let fixes = fixes(&[0.0, 2.0, 4.0, 4.0, 4.0, 0.0]);
        let by_speed = Odometer::new(&fixes);
        let stripped: Vec<Fix> = fixes.iter().map(|fix| Fix { speed_mps: None, ..*fix }).collect();
        let by_position = Odometer::new(&stripped);
        for (from, to, path_m) in [(0.0, 5.0, 14.0), (1.0, 2.0, 3.0), (3.0, 3.0, 0.0), (2.5, 3.25, 3.0)] {
            let path = by_speed.between(at(from), at(to)).expect("known");
            assert!((path - path_m).abs() < 1e-9, "{from} to {to}: {path}");
            let path = by_position.between(at(from), at(to)).expect("known");
            assert!((path - path_m).abs() < 1e-3, "{from} to {to}: {path}");
        }
        // After a quarter of the first second: at^2/2.
        assert!((by_speed.between(at(0.0), at(0.25)).expect("known") - 0.0625).abs() < 1e-9);
    }

    #[test]
    fn path_is_unknown_outside_the_fixes_and_over_gaps() {
        let mut fixes = fixes(&[3.0; 12]);
        let whole = Odometer::new(&fixes);
        assert_eq!(whole.between(at(-0.1), at(1.0)), None);
        assert_eq!(whole.between(at(1.0), at(11.1)), None);
        fixes.drain(3..9);
        let with_gap = Odometer::new(&fixes);
        assert_eq!(with_gap.between(at(1.0), at(10.0)), None);
        assert!((with_gap.between(at(0.5), at(2.0)).expect("known") - 4.5).abs() < 1e-9);
        assert_eq!(Odometer::new(&[]).between(at(0.0), at(1.0)), None);
    }
}
