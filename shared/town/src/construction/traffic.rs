//! Moving objects: vehicles on the round in both directions, people on sidewalks and crosswalks.

use crate::construction::reach::DETAIL_RADIUS_M;
use crate::construction::tour::Tour;
use crate::construction::town_builder::TownBuilder;
use crate::kind::{Town, Traffic};
use crate::models::person;
use crate::movers::clearance::Clearance;
use crate::movers::fleet;
use crate::movers::mover::{Mover, Route, Timing};
use crate::path::GroundPath;
use crate::speed_profile::{Driver, SpeedProfile};
use crate::streets::lane;
use crate::streets::network::Leg;
use crate::streets::profile::StreetKind;
use nalgebra::Vector3;
use random::Random;
use std::sync::Arc;

/// Start of the leading vehicle and of two following vehicles relative to the ego vehicle, m.
const CONVOY_M: [f64; 3] = [17.0, -14.0, -30.0];
/// Start of the leading and following vehicles on motorways, m.
const FAST_CONVOY_M: [f64; 3] = [45.0, -40.0, -85.0];
/// Share by which vehicles in each lane of a motorway are faster than in the lane to its right.
const FASTER: f64 = 0.2;
/// Time between two oncoming vehicles, s: at least a bus length, even in turns.
const SLOT_SECONDS: [f32; 2] = [4.2, 11.0];
/// Walking lanes: distance behind the kerb, m, and speed, m/s.
const WALKS: [(f64, f64); 2] = [(1.45, 1.32), (2.05, 1.18)];
/// Distance between two people in one walking lane, m.
const WALKERS_M: [f32; 2] = [4.0, 26.0];
/// Number of walker models per stride of two steps.
const PHASES: u8 = 8;
/// Speed of people on crosswalks, m/s.
const CROSSING_MPS: f64 = 1.45;

impl TownBuilder {
    /// All movers that come close to the ego vehicle.
    pub fn traffic(&mut self, tour: &Tour, random: &mut Random) -> Vec<Mover> {
        let mut clearance = Clearance::new(&tour.path, &tour.speed, tour.seconds);
        if self.traffic == Traffic::Dense {
            let mut movers = self.queue(tour, &mut clearance, random);
            let people = self.people(tour, random);
            movers.extend(people.into_iter().filter(|mover| clearance.admit(mover)));
            return movers;
        }
        let mut movers = self.convoy(tour, random);
        movers.extend(self.oncoming(tour, random));
        movers.extend(self.overtaking(tour, random));
        movers.extend(self.people(tour, random));
        movers.retain(|mover| clearance.admit(mover));
        movers
    }

    /// People on crosswalks and sidewalks.
    fn people(&mut self, tour: &Tour, random: &mut Random) -> Vec<Mover> {
        let mut movers = self.people_at_red(tour, random);
        movers.extend(self.people_on_side_streets(tour, random));
        movers.extend(self.walkers(random));
        movers
    }

    /// A leading vehicle that never stops, and a queue behind the ego vehicle.
    fn convoy(&mut self, tour: &Tour, random: &mut Random) -> Vec<Mover> {
        let Tour { path, driver, speed, seconds, .. } = tour;
        let [leader_m, followers_m @ ..] = if self.kind == Town::Motorway { FAST_CONVOY_M } else { CONVOY_M };
        let eager = Driver { cruise_mps: 1.05 * driver.cruise_mps, stops: Vec::new(), ..driver.clone() };
        let leader = SpeedProfile::from_rest(path, &eager, speed.distance_m(0.0) + leader_m, *seconds);
        let timings = [Timing::Ahead { speed: Arc::new(leader), ahead_m: 0.0, earlier_s: 0.0 }]
            .into_iter()
            .chain(followers_m.map(|ahead_m| Timing::Ahead { speed: speed.clone(), ahead_m, earlier_s: 0.0 }));
        timings.filter_map(|timing| self.vehicle_on(path, timing, random)).collect()
    }

    /// Oncoming vehicles in all lanes.
    fn oncoming(&mut self, tour: &Tour, random: &mut Random) -> Vec<Mover> {
        let legs: Vec<Leg> = self.network.round.iter().rev().map(|leg| leg.reversed()).collect();
        (0..self.network.lanes_t().len()).flat_map(|lane| self.stream(&legs, lane, tour, random)).collect()
    }

    /// Faster vehicles in the lanes to the left of the ego vehicle.
    fn overtaking(&mut self, tour: &Tour, random: &mut Random) -> Vec<Mover> {
        let legs = self.network.round.clone();
        (1..self.network.lanes_t().len()).flat_map(|lane| self.stream(&legs, lane, tour, random)).collect()
    }

    /// Vehicles in a lane (0: the rightmost) along legs, at random intervals.
    fn stream(&mut self, legs: &[Leg], lane: usize, tour: &Tour, random: &mut Random) -> Vec<Mover> {
        let cruise_mps = tour.driver.cruise_mps * (1.0 + FASTER * lane as f64);
        let Some(lane) = lane::around(&self.network, legs, -self.network.lanes_t()[lane]) else { return Vec::new() };
        let path = Arc::new(lane.path);
        let driver = Driver { stops: Vec::new(), cruise_mps, ..tour.driver.clone() };
        // Long enough for vehicles that start one round ahead.
        let slowest_round = path.length_m() / 4.0;
        let speed = Arc::new(SpeedProfile::rolling(&path, &driver, 0.0, tour.seconds + slowest_round));
        let round_seconds = speed.seconds_at(path.length_m());
        let mut movers = Vec::new();
        let mut seconds = 0.0;
        while seconds < round_seconds - f64::from(SLOT_SECONDS[0]) {
            movers.extend(self.vehicle_on(&path, Timing::Earlier { speed: speed.clone(), seconds }, random));
            seconds += f64::from(random.range(SLOT_SECONDS[0], SLOT_SECONDS[1]));
        }
        movers
    }

    fn vehicle_on(&mut self, path: &Arc<GroundPath>, timing: Timing, random: &mut Random) -> Option<Mover> {
        let instance = self.instances.next();
        let fleet = if self.kind == Town::Motorway { fleet::fast } else { fleet::moving };
        let model = fleet(&mut self.builder, instance, random);
        Mover::new(model, Route { path: path.clone(), left_m: 0.0, leans: true, timing })
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
                let length = lane.path.length_m();
                movers.extend(self.people_along(&Arc::new(lane.path), length, speed_mps, random));
            }
        }
        for street in self.built_streets() {
            let profile = self.network.streets[street].profile;
            if !matches!(profile.kind, StreetKind::Village) {
                continue;
            }
            for (side, speed_mps) in [(1.0, 1.2), (-1.0, 1.3)] {
                let [begin, end] = self.network.mouths(street);
                let n = (end - begin) as usize;
                let t = side * (profile.kerb_t + 1.0);
                let line = &self.network.streets[street];
                let points = (0..=n).map(|i| line.point(begin + i as f64, t, profile.height(t))).collect();
                let Some(path) = GroundPath::open(points, 1.0, self.network.terrain) else { continue };
                movers.extend(self.people_along(&Arc::new(path), end - begin, speed_mps, random));
            }
        }
        movers
    }

    fn people_along(
        &mut self,
        path: &Arc<GroundPath>,
        length_m: f64,
        speed_mps: f64,
        random: &mut Random,
    ) -> Vec<Mover> {
        let mut movers = Vec::new();
        let mut from_m = f64::from(random.range(0.0, WALKERS_M[1]));
        while from_m < length_m - 3.0 {
            movers.extend(self.person_on(path, Timing::Steady { from_m, speed_mps }, random));
            from_m += f64::from(random.range(WALKERS_M[0], WALKERS_M[1]));
        }
        movers
    }

    fn person_on(&mut self, path: &Arc<GroundPath>, timing: Timing, random: &mut Random) -> Option<Mover> {
        let instance = self.instances.next();
        let appearance = person::PersonAppearance::random(random);
        let phase = |i: u8| f32::from(i) / f32::from(PHASES);
        let models = (0..PHASES).map(|i| person::walker(&mut self.builder, instance, phase(i), &appearance)).collect();
        let route = Route { path: path.clone(), left_m: 0.0, leans: false, timing };
        Mover::striding(models, f64::from(appearance.stride_m()), route)
    }

    /// People who cross in front of the waiting ego vehicle.
    fn people_at_red(&mut self, tour: &Tour, random: &mut Random) -> Vec<Mover> {
        let mut movers = Vec::new();
        let round_m = tour.path.length_m();
        for stop in &tour.driver.stops {
            let at = stop.at_m;
            let seconds = tour.speed.seconds_at(at - 1.0);
            let Some(k) = tour.legs.iter().position(|leg| (leg[1] - at.rem_euclid(round_m)).abs() < 12.0) else {
                continue;
            };
            if seconds >= tour.seconds {
                break;
            }
            let leg = self.network.round[k];
            for i in 0..=random.index(3) {
                let from = seconds - 0.5 + 0.8 * i as f64;
                movers.extend(self.person_across(leg.street, usize::from(leg.is_forward), from, i, random));
            }
        }
        movers
    }

    /// People who cross the side streets as the ego vehicle approaches.
    fn people_on_side_streets(&mut self, tour: &Tour, random: &mut Random) -> Vec<Mover> {
        let mut movers = Vec::new();
        for (k, leg) in self.network.round.clone().iter().enumerate() {
            let node = self.network.node_after(*leg);
            let place = self.network.nodes[node].at;
            if !self.network.nodes[node].has_lights || !self.reach.is_near(&place, DETAIL_RADIUS_M) {
                continue;
            }
            let seconds = tour.speed.seconds_at(tour.legs[k][1]);
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

    /// A person on the crosswalk at an end of a street, starting at second `from`, on one of three tracks.
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
            let (s, t) = line.at_node(end, at, t);
            let p = line.plan(s, t);
            Vector3::new(p.x, p.y, self.network.terrain.height(&p) + line.profile.height(t))
        });
        let path = GroundPath::open(points.collect(), 2.0 * reach / n as f64, self.network.terrain)?;
        self.person_on(&Arc::new(path), Timing::Once { from, speed_mps: CROSSING_MPS }, random)
    }
}
