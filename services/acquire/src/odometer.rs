//! How far the vehicle went between two moments, by its position fixes.

use formats::nmea::Fix;
use geometry::Stamp;

/// Over a longer gap between fixes nothing is said.
const MAX_GAP_S: f64 = 5.0;
/// Mean radius of the earth, m; good to 0.5 % for distances.
const EARTH_M: f64 = 6_371_000.0;

/// The way along the fixes. Receivers measure speed by Doppler shift to centimetres a second, while positions a second apart
/// jitter by decimetres; so the way is the integral of the speed, and positions count where there is no speed.
#[derive(Debug)]
pub(crate) struct Odometer {
    marks: Vec<Mark>,
}

#[derive(Clone, Copy, Debug)]
struct Mark {
    stamp: Stamp,
    /// Since the first fix.
    way_m: f64,
    /// From here to the next mark at this speed at first, with this acceleration.
    speed_mps: f64,
    acceleration: f64,
    /// Whether the next mark is near enough.
    is_followed: bool,
}

impl Odometer {
    pub(crate) fn new(fixes: &[Fix]) -> Self {
        let mut marks: Vec<Mark> = Vec::with_capacity(fixes.len());
        let mut way_m = 0.0;
        for (index, fix) in fixes.iter().enumerate() {
            let mut mark = Mark { stamp: fix.stamp, way_m, speed_mps: 0.0, acceleration: 0.0, is_followed: false };
            if let Some(next) = fixes.get(index + 1) {
                let seconds = next.stamp.seconds_since(fix.stamp);
                (mark.speed_mps, mark.acceleration) = match (fix.speed_mps, next.speed_mps) {
                    (Some(from), Some(to)) => (from, (to - from) / seconds),
                    _ => (distance_m(fix.position_deg, next.position_deg) / seconds, 0.0),
                };
                mark.is_followed = seconds <= MAX_GAP_S;
                way_m += mark.way_after(seconds);
            }
            marks.push(mark);
        }
        Self { marks }
    }

    /// m, if there are fixes around both moments and no long gap between them.
    pub(crate) fn between(&self, from: Stamp, to: Stamp) -> Option<f64> {
        let (first, last) = (self.mark_before(from)?, self.mark_before(to)?);
        let known = self.marks[first..=last].iter().all(|mark| mark.is_followed || mark.stamp == to);
        known.then(|| self.way_at(last, to) - self.way_at(first, from))
    }

    /// Index of the last mark at or before a moment, unless the fixes end before it.
    fn mark_before(&self, stamp: Stamp) -> Option<usize> {
        let after = self.marks.partition_point(|mark| mark.stamp <= stamp);
        let index = after.checked_sub(1)?;
        (after < self.marks.len() || self.marks[index].stamp == stamp).then_some(index)
    }

    fn way_at(&self, index: usize, stamp: Stamp) -> f64 {
        let mark = &self.marks[index];
        mark.way_m + mark.way_after(stamp.seconds_since(mark.stamp))
    }
}

impl Mark {
    fn way_after(&self, seconds: f64) -> f64 {
        seconds * (self.speed_mps + 0.5 * self.acceleration * seconds)
    }
}

/// On a sphere; for a few metres the flat formula is exact.
fn distance_m(from: [f64; 2], to: [f64; 2]) -> f64 {
    let north = (to[0] - from[0]).to_radians();
    // The short way around, also over the date line.
    let east = ((to[1] - from[1] + 540.0).rem_euclid(360.0) - 180.0).to_radians() * from[0].to_radians().cos();
    EARTH_M * north.hypot(east)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A vehicle that goes east, at these speeds second by second.
    pub(crate) fn fixes(speeds: &[f64]) -> Vec<Fix> {
        let mut way_m = 0.0;
        let mut fix = |(second, speed): (usize, &f64)| {
            let longitude = 2.0 + (way_m / (EARTH_M * 48_f64.to_radians().cos())).to_degrees();
            way_m += 0.5 * (speed + speeds.get(second + 1).unwrap_or(speed));
            Fix {
                stamp: Stamp(second as i64 * 1_000_000_000),
                position_deg: [48.0, longitude],
                altitude_m: Some(100.0),
                speed_mps: Some(*speed),
                course_deg: None,
                hdop: None,
                satellites: 9,
                quality: 1,
            }
        };
        speeds.iter().enumerate().map(&mut fix).collect()
    }

    fn at(seconds: f64) -> Stamp {
        Stamp::from_seconds(seconds)
    }

    #[test]
    fn the_way_follows_from_speeds_and_equally_from_positions() {
        let fixes = fixes(&[0.0, 2.0, 4.0, 4.0, 4.0, 0.0]);
        let by_speed = Odometer::new(&fixes);
        let stripped: Vec<Fix> = fixes.iter().map(|fix| Fix { speed_mps: None, ..*fix }).collect();
        let by_position = Odometer::new(&stripped);
        for (from, to, way_m) in [(0.0, 5.0, 14.0), (1.0, 2.0, 3.0), (3.0, 3.0, 0.0), (2.5, 3.25, 3.0)] {
            let way = by_speed.between(at(from), at(to)).expect("known");
            assert!((way - way_m).abs() < 1e-9, "{from} to {to}: {way}");
            let way = by_position.between(at(from), at(to)).expect("known");
            assert!((way - way_m).abs() < 1e-3, "{from} to {to}: {way}");
        }
        // A quarter of a second into the first: at^2/2.
        assert!((by_speed.between(at(0.0), at(0.25)).expect("known") - 0.0625).abs() < 1e-9);
    }

    #[test]
    fn nothing_is_said_outside_the_fixes_and_over_gaps() {
        let mut fixes = fixes(&[3.0; 12]);
        let whole = Odometer::new(&fixes);
        assert_eq!(whole.between(at(-0.1), at(1.0)), None);
        assert_eq!(whole.between(at(1.0), at(11.1)), None);
        fixes.drain(3..9);
        let torn = Odometer::new(&fixes);
        assert_eq!(torn.between(at(1.0), at(10.0)), None);
        assert!((torn.between(at(0.5), at(2.0)).expect("known") - 4.5).abs() < 1e-9);
        assert_eq!(Odometer::new(&[]).between(at(0.0), at(1.0)), None);
    }
}
