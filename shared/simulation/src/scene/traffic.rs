//! All that moves during a drive: vehicles on the round in both directions, people on sidewalks and crosswalks.

use super::clearance::Clearance;
use super::fleet;
use super::lane;
use super::models::person;
use super::mover::{Mover, Route, Timing};
use super::network::Leg;
use super::profile::{Kind, LANE_T};
use super::town::{BUILT_M, Town};
use crate::pace::{Driver, Pace};
use crate::random::Random;
use crate::way::Way;
use nalgebra::Vector3;
use std::sync::Arc;

/// How far ahead of the recording vehicle the next one starts, m.
const LEADER_M: f64 = 17.0;
/// How far behind it others follow, m.
const FOLLOWERS_M: [f64; 2] = [-14.0, -30.0];
/// Between two oncoming vehicles, s: a bus length even where they turn.
const SLOT_SECONDS: [f32; 2] = [4.2, 11.0];
/// Lanes of people, m behind the kerb, and their speed, m/s.
const WALKS: [(f64, f64); 2] = [(1.45, 1.32), (2.05, 1.18)];
/// Between two people on the same lane, m.
const WALKERS_M: [f32; 2] = [4.0, 26.0];
/// How fast people cross, m/s.
const CROSSING_MPS: f64 = 1.45;

/// The recording vehicle's drive.
#[derive(Clone, Copy)]
struct Vehicle<'a> {
    way: &'a Arc<Way>,
    legs: &'a [[f64; 2]],
    driver: &'a Driver,
    pace: &'a Arc<Pace>,
    seconds: f64,
}

impl Town {
    /// All movers that come near the recording vehicle.
    pub fn traffic(
        &mut self,
        way: &Arc<Way>,
        legs: &[[f64; 2]],
        driver: &Driver,
        pace: &Arc<Pace>,
        seconds: f64,
        random: &mut Random,
    ) -> Vec<Mover> {
        let vehicle = Vehicle { way, legs, driver, pace, seconds };
        let mut clearance = Clearance::new(way, pace, seconds);
        let mut movers = self.convoy(vehicle, random);
        movers.extend(self.oncoming(vehicle, random));
        movers.extend(self.people_at_red(vehicle, random));
        movers.extend(self.people_on_side_streets(vehicle, random));
        movers.extend(self.walkers(random));
        movers.retain(|mover| clearance.admit(mover));
        movers
    }

    /// A vehicle ahead that finds all lights green, and a queue behind the recording one.
    fn convoy(&mut self, vehicle: Vehicle<'_>, random: &mut Random) -> Vec<Mover> {
        let Vehicle { way, driver, pace, seconds, .. } = vehicle;
        let eager = Driver { cruise_mps: 1.05 * driver.cruise_mps, stops: Vec::new(), ..driver.clone() };
        let leader = Pace::from_rest(way, &eager, pace.length_m(0.0) + LEADER_M, seconds);
        let timings = [Timing::Ahead { pace: Arc::new(leader), ahead_m: 0.0 }]
            .into_iter()
            .chain(FOLLOWERS_M.map(|ahead_m| Timing::Ahead { pace: pace.clone(), ahead_m }));
        timings.filter_map(|timing| self.vehicle_on(way, timing, random)).collect()
    }

    /// Vehicles the other way round, each a time behind the one before it.
    fn oncoming(&mut self, vehicle: Vehicle<'_>, random: &mut Random) -> Vec<Mover> {
        let legs: Vec<Leg> = self.network.round.iter().rev().map(|leg| leg.reversed()).collect();
        let Some(lane) = lane::around(&self.network, &legs, -LANE_T) else { return Vec::new() };
        let way = Arc::new(lane.way);
        let driver = Driver { stops: Vec::new(), ..vehicle.driver.clone() };
        // Long enough for those who are a round ahead.
        let slowest_round = way.length_m() / 4.0;
        let pace = Arc::new(Pace::rolling(&way, &driver, 0.0, vehicle.seconds + slowest_round));
        let round_seconds = pace.seconds_at(way.length_m());
        let mut movers = Vec::new();
        let mut seconds = 0.0;
        while seconds < round_seconds - f64::from(SLOT_SECONDS[0]) {
            movers.extend(self.vehicle_on(&way, Timing::Earlier { pace: pace.clone(), seconds }, random));
            seconds += f64::from(random.range(SLOT_SECONDS[0], SLOT_SECONDS[1]));
        }
        movers
    }

    fn vehicle_on(&mut self, way: &Arc<Way>, timing: Timing, random: &mut Random) -> Option<Mover> {
        let instance = self.instances.next();
        let model = fleet::moving(&mut self.builder, instance, random);
        Mover::new(model, Route { way: way.clone(), left_m: 0.0, leans: true, timing })
    }

    /// People around the blocks, in both directions, and along the sidewalks of villages.
    fn walkers(&mut self, random: &mut Random) -> Vec<Mover> {
        let mut movers = Vec::new();
        let around_blocks: Vec<[Leg; 4]> = self.network.blocks.clone();
        for legs in around_blocks {
            let is_near = legs.iter().any(|leg| {
                let street = &self.network.streets[leg.street];
                self.is_on_round(leg.street) && self.is_built(leg.street, 0.5 * street.length_m, 0.0)
            });
            if !is_near {
                continue;
            }
            for (k, (behind_m, speed_mps)) in WALKS.into_iter().enumerate() {
                let kerb = legs.map(|leg| self.network.streets[leg.street].profile.kerb_t)[0];
                let t = kerb + behind_m.min(self.outer_t(legs[0].street) - kerb - 0.5);
                let mut legs = legs.to_vec();
                let t = if k == 0 { t } else { -t };
                if k == 1 {
                    legs = legs.into_iter().rev().map(Leg::reversed).collect();
                }
                let Some(lane) = lane::around(&self.network, &legs, t) else { continue };
                let length = lane.way.length_m();
                movers.extend(self.people_along(&Arc::new(lane.way), length, speed_mps, random));
            }
        }
        for street in self.built_streets() {
            let profile = self.network.streets[street].profile;
            if !matches!(profile.kind, Kind::Village) {
                continue;
            }
            for (side, speed_mps) in [(1.0, 1.2), (-1.0, 1.3)] {
                let [begin, end] = self.network.mouths(street);
                let n = (end - begin) as usize;
                let t = side * (profile.kerb_t + 1.0);
                let line = &self.network.streets[street];
                let points = (0..=n).map(|i| line.point(begin + i as f64, t, profile.height(t))).collect();
                let Some(way) = Way::open(points, 1.0, self.network.terrain) else { continue };
                movers.extend(self.people_along(&Arc::new(way), end - begin, speed_mps, random));
            }
        }
        movers
    }

    fn people_along(&mut self, way: &Arc<Way>, length_m: f64, speed_mps: f64, random: &mut Random) -> Vec<Mover> {
        let mut movers = Vec::new();
        let mut from_m = f64::from(random.range(0.0, WALKERS_M[1]));
        while from_m < length_m - 3.0 {
            movers.extend(self.person_on(way, Timing::Steady { from_m, speed_mps }, random));
            from_m += f64::from(random.range(WALKERS_M[0], WALKERS_M[1]));
        }
        movers
    }

    fn person_on(&mut self, way: &Arc<Way>, timing: Timing, random: &mut Random) -> Option<Mover> {
        let instance = self.instances.next();
        let model = person::model(&mut self.builder, instance, random);
        Mover::new(model, Route { way: way.clone(), left_m: 0.0, leans: false, timing })
    }

    /// People who cross before the recording vehicle while it waits.
    fn people_at_red(&mut self, vehicle: Vehicle<'_>, random: &mut Random) -> Vec<Mover> {
        let mut movers = Vec::new();
        let round_m = vehicle.way.length_m();
        for (at, _) in &vehicle.driver.stops {
            let seconds = vehicle.pace.seconds_at(at - 1.0);
            let Some(k) = vehicle.legs.iter().position(|leg| (leg[1] - at.rem_euclid(round_m)).abs() < 12.0) else {
                continue;
            };
            if seconds >= vehicle.seconds {
                break;
            }
            let leg = self.network.round[k];
            for i in 0..1 + random.index(3) {
                let from = seconds - 0.5 + 0.8 * i as f64;
                movers.extend(self.person_across(leg.street, usize::from(leg.is_forward), from, i, random));
            }
        }
        movers
    }

    /// People who cross the side streets as the recording vehicle comes.
    fn people_on_side_streets(&mut self, vehicle: Vehicle<'_>, random: &mut Random) -> Vec<Mover> {
        let mut movers = Vec::new();
        for (k, leg) in self.network.round.clone().iter().enumerate() {
            let node = self.network.node_after(*leg);
            let place = self.network.nodes[node].at;
            if !self.network.nodes[node].has_lights || !self.reach.is_near(&place, BUILT_M) {
                continue;
            }
            let seconds = vehicle.pace.seconds_at(vehicle.legs[k][1]);
            let arms: Vec<(usize, usize)> = self.network.nodes[node].arms.iter().map(|a| (a.street, a.end)).collect();
            for (street, end) in arms {
                if self.is_on_round(street) {
                    continue;
                }
                for i in 0..random.index(3) {
                    let from = seconds - f64::from(random.range(3.0, 12.0));
                    movers.extend(self.person_across(street, end, from, i, random));
                }
            }
        }
        movers
    }

    /// Somebody who crosses a street on its crosswalk at an end, from second `from` on, on one of three tracks.
    fn person_across(
        &mut self,
        street: usize,
        end: usize,
        from: f64,
        track: usize,
        random: &mut Random,
    ) -> Option<Mover> {
        let line = &self.network.streets[street];
        let at = self.network.arm(street, end).mouth_m + 1.1 + 0.7 * (track % 3) as f64;
        let reach = line.profile.kerb_t + 0.9;
        let side = if random.chance(0.5) { 1.0 } else { -1.0 };
        let n = (2.0 * reach) as usize;
        let points = (0..=n).map(|i| {
            let t = side * reach * (2.0 * i as f64 / n as f64 - 1.0);
            let (s, t) = line.from_node(end, at, t);
            let p = line.plan(s, t);
            Vector3::new(p.x, p.y, self.network.terrain.height(&p) + line.profile.height(t))
        });
        let way = Way::open(points.collect(), 2.0 * reach / n as f64, self.network.terrain)?;
        self.person_on(&Arc::new(way), Timing::Once { from, speed_mps: CROSSING_MPS }, random)
    }
}
