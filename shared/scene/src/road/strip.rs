//! The ground along roads: counts of surfaces by station and by distance from the path.

use super::path::DrivenRoad;
use crate::ground::GroundKind;
use messages::ClassId;
use std::collections::HashMap;
use surveying::CloudPoint;

/// Width of a bin across the road, m.
pub const BIN_M: f64 = 0.1;
/// Distance from the path that is examined on each side, m.
pub const REACH_M: f64 = 20.0;
/// Bins of a station, from the right to the left.
pub const N_BINS: usize = (2.0 * REACH_M / BIN_M) as usize;
/// Side of the cells that name their nearest station, m.
const CELL_M: f64 = 1.0;
/// Stations around the one of its cell among which a point finds its own.
const SEARCH: usize = 4;

/// The ground in a bin.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bin {
    /// Numbers of points by kind: road, marking, sidewalk, other.
    pub kinds: [u16; 4],
    /// Sum of their heights, m.
    pub height_m: f64,
}

impl Bin {
    /// Number of points.
    pub fn n(&self) -> u32 {
        self.kinds.iter().map(|n| u32::from(*n)).sum()
    }
}

/// A station of a road.
#[derive(Clone, Copy)]
struct Place {
    road: usize,
    station: usize,
    distance_m: f64,
}

/// The ground along all roads of a drive.
pub struct RoadStrips {
    roads: Vec<DrivenRoad>,
    /// `N_BINS` bins for each station of each road.
    bins: Vec<Vec<Bin>>,
    nearest: HashMap<[i32; 2], Place>,
}

impl RoadStrips {
    /// Empty strips.
    pub fn new(roads: Vec<DrivenRoad>) -> Self {
        let mut nearest: HashMap<[i32; 2], Place> = HashMap::new();
        for (road, driven) in roads.iter().enumerate() {
            for (number, station) in driven.stations.iter().enumerate() {
                let [low, high] = [-REACH_M, REACH_M].map(|off| station.place.map(|value| cell(value + off)));
                for (x, y) in (low[0]..=high[0]).flat_map(|x| (low[1]..=high[1]).map(move |y| (x, y))) {
                    let middle = [x, y].map(|cell| (f64::from(cell) + 0.5) * CELL_M);
                    let distance_m = (middle[0] - station.place[0]).hypot(middle[1] - station.place[1]);
                    let place = Place { road, station: number, distance_m };
                    let found = nearest.entry([x, y]).or_insert(place);
                    if distance_m < found.distance_m {
                        *found = place;
                    }
                }
            }
        }
        let bins = roads.iter().map(|road| vec![Bin::default(); road.stations.len() * N_BINS]).collect();
        Self { roads, bins, nearest }
    }

    /// Adds a point of the static world.
    pub fn add(&mut self, point: &CloudPoint) {
        let Some(kind) = ClassId::from_id(point.class).and_then(GroundKind::from_class) else { return };
        let place = [point.xyz[0], point.xyz[1]];
        let Some(near) = self.nearest.get(&place.map(cell)) else { return };
        let stations = &self.roads[near.road].stations;
        let around = near.station.saturating_sub(SEARCH)..stations.len().min(near.station + SEARCH + 1);
        let best = around
            .map(|station| (station, stations[station].along_and_left(place)))
            .min_by(|(_, a), (_, b)| a[0].abs().total_cmp(&b[0].abs()));
        let Some((station, [along, left])) = best else { return };
        // Points before the first and after the last station belong to no cross section.
        if along.abs() > super::path::STATION_M || left.abs() >= REACH_M {
            return;
        }
        let bin = ((left + REACH_M) / BIN_M) as usize;
        let bin = &mut self.bins[near.road][station * N_BINS + bin.min(N_BINS - 1)];
        bin.kinds[kind as usize] = bin.kinds[kind as usize].saturating_add(1);
        bin.height_m += point.xyz[2];
    }

    /// The roads.
    pub fn roads(&self) -> &[DrivenRoad] {
        &self.roads
    }

    /// The bins of a station, from the right to the left.
    pub fn station(&self, road: usize, station: usize) -> &[Bin] {
        &self.bins[road][station * N_BINS..][..N_BINS]
    }

    /// Direction of the street at a place within reach of a road.
    pub fn direction(&self, place: [f64; 2]) -> Option<[f64; 2]> {
        let near = self.nearest.get(&place.map(cell))?;
        Some(self.roads[near.road].stations[near.station].direction)
    }
}

fn cell(value: f64) -> i32 {
    (value / CELL_M).floor() as i32
}

/// Distance of the middle of a bin to the left of the path, m.
pub fn left_of_bin(bin: usize) -> f64 {
    (bin as f64 + 0.5) * BIN_M - REACH_M
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::removal::tests::point;
    use crate::road::Station;

    #[test]
    fn points_are_counted_at_their_station_and_side() {
        let direction = [0.6, 0.8];
        let station = |k: usize| Station { place: [0.3 * k as f64, 0.4 * k as f64], direction };
        let mut strips = RoadStrips::new(vec![DrivenRoad { stations: (0..100).map(station).collect() }]);
        // 3.05 m to the left of station 50.
        let left = [15.0 - 0.8 * 3.05, 20.0 + 0.6 * 3.05, 1.5];
        strips.add(&point(ClassId::RoadLine, left));
        strips.add(&point(ClassId::Building, left));
        strips.add(&point(ClassId::Road, [500.0, 0.0, 0.0]));
        let bins = strips.station(0, 50);
        let filled: Vec<usize> = (0..N_BINS).filter(|bin| bins[*bin].n() > 0).collect();
        assert_eq!(filled.len(), 1);
        assert!((left_of_bin(filled[0]) - 3.05).abs() < 1e-6);
        assert_eq!((bins[filled[0]].kinds, bins[filled[0]].height_m), ([0, 1, 0, 0], 1.5));
        assert_eq!(strips.direction([15.0, 21.0]), Some(direction));
        assert_eq!(strips.direction([0.0, 500.0]), None);
    }
}
