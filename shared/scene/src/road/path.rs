//! The path of the vehicle as reference lines of roads: each street once.

use geometry::Trajectory;
use std::collections::HashMap;

/// Distance of neighboring stations, m.
pub const STATION_M: f64 = 0.5;
/// Poses nearer to one another are skipped, m: a standing vehicle has no direction.
const MIN_MOTION_M: f64 = 0.25;
/// Deviation of the smoothing, stations: 1.5 m.
const SMOOTHING: f64 = 3.0;
/// A direction is measured between the stations this many before and after: 2 m.
const DIRECTION_STATIONS: usize = 2;
/// A path this near to an earlier part of itself, m, and parallel to it, is on the same street: three lanes.
const SAME_STREET_M: f64 = 12.0;
/// Parallel: cosine of the largest angle, 30 degrees.
const PARALLEL: f64 = 0.87;
/// An earlier part in the same direction is at least this far back along the path, stations: 40 m.
const EARLIER: usize = 80;
/// Shortest road, stations: 10 m.
const MIN_STATIONS: usize = 20;

/// A place of a reference line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Station {
    /// Place in the frame of the clouds, m.
    pub place: [f64; 2],
    /// Unit vector along the path.
    pub direction: [f64; 2],
}

impl Station {
    /// Distance along and to the left of the direction, m.
    pub fn along_and_left(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let off = [x - self.place[0], y - self.place[1]];
        let [dx, dy] = self.direction;
        [off[0] * dx + off[1] * dy, off[1] * dx - off[0] * dy]
    }
}

/// A street that was driven.
#[derive(Clone, Debug, PartialEq)]
pub struct DrivenRoad {
    /// Stations every 0.5 m.
    pub stations: Vec<Station>,
}

/// The streets of paths, in the order in which they were driven. Repeated parts are left out.
pub fn driven_roads<'a>(paths: impl IntoIterator<Item = &'a Trajectory>) -> Vec<DrivenRoad> {
    let mut seen: HashMap<[i64; 2], Vec<usize>> = HashMap::new();
    let cell = |place: [f64; 2]| place.map(|value| (value / SAME_STREET_M).floor() as i64);
    let mut roads = Vec::new();
    let mut open: Vec<Station> = Vec::new();
    let mut all: Vec<Station> = Vec::new();
    for path in paths {
        // All stations of earlier paths are earlier parts.
        let first = all.len();
        for station in stations(path) {
            let idx = all.len();
            let [column, row] = cell(station.place);
            let near = (-1..=1).flat_map(|i| (-1..=1).map(move |j| [column + i, row + j]));
            let earlier = near.filter_map(|cell| seen.get(&cell)).flatten();
            let is_repeated = earlier.map(|earlier| (*earlier, &all[*earlier])).any(|(number, earlier)| {
                let cosine = earlier.direction[0] * station.direction[0] + earlier.direction[1] * station.direction[1];
                let [along, left] = earlier.along_and_left(station.place);
                let is_back = number < first || idx - number > EARLIER;
                let is_parallel = cosine < -PARALLEL || cosine > PARALLEL && is_back;
                is_parallel && along.hypot(left) < SAME_STREET_M
            });
            all.push(station);
            if is_repeated {
                roads.push(std::mem::take(&mut open));
            } else {
                seen.entry([column, row]).or_default().push(idx);
                open.push(station);
            }
        }
        roads.push(std::mem::take(&mut open));
    }
    roads.retain(|stations| stations.len() >= MIN_STATIONS);
    roads.into_iter().map(|stations| DrivenRoad { stations }).collect()
}

/// Places at equal distances along the smoothed path.
fn stations(path: &Trajectory) -> Vec<Station> {
    let mut kept: Vec<[f64; 2]> = Vec::new();
    for (_, pose) in path.poses() {
        let place = [pose.translation.x, pose.translation.y];
        if kept.last().is_none_or(|last| distance_m(*last, place) >= MIN_MOTION_M) {
            kept.push(place);
        }
    }
    let smooth = smoothed(&equally_spaced(&kept));
    let places = equally_spaced(&smooth);
    let direction = |idx: usize| {
        let [a, b] =
            [places[idx.saturating_sub(DIRECTION_STATIONS)], places[(idx + DIRECTION_STATIONS).min(places.len() - 1)]];
        let length = distance_m(a, b).max(f64::MIN_POSITIVE);
        [(b[0] - a[0]) / length, (b[1] - a[1]) / length]
    };
    (0..places.len()).map(|idx| Station { place: places[idx], direction: direction(idx) }).collect()
}

fn distance_m(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// Points every [`STATION_M`] along a line.
fn equally_spaced(line: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut found = Vec::new();
    let mut next_m = 0.0;
    let mut length_m = 0.0;
    for pair in line.windows(2) {
        let [a, b] = [pair[0], pair[1]];
        let step_m = distance_m(a, b);
        while next_m <= length_m + step_m {
            let share = if step_m > 0.0 { (next_m - length_m) / step_m } else { 0.0 };
            found.push([a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])]);
            next_m += STATION_M;
        }
        length_m += step_m;
    }
    found
}

/// Means weighted by a Gaussian. At both ends the window is shortened symmetrically, so that the ends stay.
fn smoothed(line: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let reach = (3.0 * SMOOTHING) as usize;
    let mean = |idx: usize| {
        let reach = reach.min(idx).min(line.len() - 1 - idx);
        let mut sum = [0.0; 2];
        let mut weights = 0.0;
        for (offset, place) in line[idx - reach..=idx + reach].iter().enumerate() {
            let weight = (-0.5 * ((offset as f64 - reach as f64) / SMOOTHING).powi(2)).exp();
            weights += weight;
            sum.iter_mut().zip(place).for_each(|(sum, value)| *sum += weight * value);
        }
        sum.map(|sum| sum / weights)
    };
    (0..line.len()).map(mean).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::{Isometry3, Stamp};

    fn path(places: impl Iterator<Item = [f64; 2]>) -> Trajectory {
        let mut path = Trajectory::default();
        for (k, [x, y]) in places.enumerate() {
            assert!(path.push(Stamp(k as i64 * 100_000_000), Isometry3::translation(x, y, 0.0)));
        }
        path
    }

    #[test]
    fn street_that_is_driven_twice_is_one_road() {
        // 100 m to the east, a stop, back on the other lane, then north.
        let there = (0..100).map(|x| [f64::from(x), 0.0]);
        let stop = (0..50).map(|_| [99.0, 0.0]);
        let back = (0..100).map(|x| [99.0 - f64::from(x), 3.5]);
        let north = (1..60).map(|y| [0.0, 3.5 + f64::from(y)]);
        let roads = driven_roads([&path(there.chain(stop).chain(back).chain(north))]);
        let lengths: Vec<f64> = roads.iter().map(|road| road.stations.len() as f64 * STATION_M).collect();
        assert_eq!(lengths.len(), 2, "{lengths:?}");
        assert!((lengths[0] - 100.0).abs() < 5.0 && (lengths[1] - 58.0).abs() < 12.0, "{lengths:?}");
        let station = roads[0].stations[100];
        assert!((station.direction[0] - 1.0).abs() < 1e-6);
        let [along, left] = station.along_and_left([station.place[0] + 2.0, 3.0]);
        assert!((along - 2.0).abs() < 1e-6 && (left - 3.0).abs() < 1e-6);
    }

    #[test]
    fn street_that_an_earlier_drive_has_driven_is_not_repeated() {
        let there = path((0..100).map(|x| [f64::from(x), 0.0]));
        let again = path((0..160).map(|x| [f64::from(x), 1.0]));
        let roads = driven_roads([&there, &again]);
        let lengths: Vec<f64> = roads.iter().map(|road| road.stations.len() as f64 * STATION_M).collect();
        assert_eq!(lengths.len(), 2, "{lengths:?}");
        assert!((lengths[0] - 99.5).abs() < 1.0 && (lengths[1] - 48.0).abs() < 2.0, "{lengths:?}");
    }

    #[test]
    fn standing_vehicle_has_no_road() {
        assert!(driven_roads([&path((0..100).map(|k| [0.01 * f64::from(k % 2), 0.0]))]).is_empty());
        assert!(driven_roads([&Trajectory::default()]).is_empty());
    }
}
