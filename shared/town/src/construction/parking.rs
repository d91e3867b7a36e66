//! Parked vehicles along the kerbs.

use crate::construction::ground::{STOP_LINE, YIELD_LINE};
use crate::construction::town_builder::TownBuilder;
use crate::movers::fleet;
use crate::streets::profile::LANE_T;
use random::Random;
use std::f64::consts::PI;

/// Distance from a mouth to the middle of the first parked car, m: behind crosswalk and stop line.
const CLEAR_M: f64 = 8.5;
/// Distance between the middles of parked cars, m.
const APART_M: [f32; 2] = [5.8, 7.3];
/// Share of occupied parking spaces.
const TAKEN: f32 = 0.68;

/// Distance from a stop line to the middle of the waiting car, and from this car to the next one, m.
const QUEUE_M: [f64; 2] = [2.9, 6.2];

impl TownBuilder {
    /// Places cars that wait at the stop lines of side streets.
    pub fn waiting_cars(&mut self, street: usize, random: &mut Random) {
        for end in [0, 1] {
            let node = self.network.streets[street].nodes[end];
            let is_junction = self.network.nodes[node].arms.len() > 2;
            if self.is_on_round(street) || !self.is_node_on_round(node) || !is_junction {
                continue;
            }
            let line = if self.network.nodes[node].has_lights { STOP_LINE[1] } else { YIELD_LINE[1] };
            let mut from_node = self.network.arm(street, end).mouth_m + line + QUEUE_M[0];
            let mut is_taken = random.chance(0.5);
            while is_taken {
                let (s, t) = self.network.streets[street].at_node(end, from_node, LANE_T);
                if self.is_built(street, s, t) {
                    let instance = self.instances.next();
                    let model = fleet::car(&mut self.builder, instance, random);
                    let street = &self.network.streets[street];
                    let yaw = if end == 1 { 0.0 } else { PI };
                    let pose = street.leaning(s, t, street.profile.road_height(t), yaw);
                    self.builder.place(&model, &pose);
                }
                from_node += QUEUE_M[1];
                is_taken = random.chance(0.35);
            }
        }
    }

    /// Parks cars along the kerbs of a street, with gaps.
    pub fn park_cars(&mut self, street: usize, random: &mut Random) {
        let [begin, end] = self.network.mouths(street);
        let profile = self.network.streets[street].profile;
        for side in [-1.0, 1.0] {
            let Some(parking_t) = profile.parking_t(side).filter(|_| !self.is_queue_lane(street, side)) else {
                continue;
            };
            let yaw = if side > 0.0 { PI } else { 0.0 };
            let mut s = begin + CLEAR_M;
            while s < end - CLEAR_M {
                if self.is_built(street, s, 0.0) && random.chance(TAKEN) {
                    let instance = self.instances.next();
                    let model = fleet::parked(&mut self.builder, instance, random);
                    let t = side * (parking_t + f64::from(random.range(-0.1, 0.1)));
                    let turned = yaw + f64::from(random.range(-0.03, 0.03));
                    let pose = self.network.streets[street].leaning(s, t, profile.road_height(t), turned);
                    self.builder.place(&model, &pose);
                }
                s += f64::from(random.range(APART_M[0], APART_M[1]));
            }
        }
    }
}
