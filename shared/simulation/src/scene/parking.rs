//! Parked vehicles along the kerbs.

use super::fleet;
use super::town::Town;
use crate::random::Random;
use std::f64::consts::PI;

/// From a mouth to the middle of the first parked car, m: behind crosswalk and stop line.
const CLEAR_M: f64 = 8.5;
/// From middle to middle, m.
const APART_M: [f32; 2] = [5.8, 7.3];
/// Share of the places that are taken.
const TAKEN: f32 = 0.68;

impl Town {
    /// Cars along the kerbs of a street, with gaps.
    pub fn park_cars(&mut self, street: usize, random: &mut Random) {
        let [begin, end] = self.network.mouths(street);
        let profile = self.network.streets[street].profile;
        for side in [-1.0, 1.0] {
            let Some(parking_t) = profile.parking_t(side) else { continue };
            let yaw = if side > 0.0 { PI } else { 0.0 };
            let mut s = begin + CLEAR_M;
            while s < end - CLEAR_M {
                if self.is_built(street, s, 0.0) && random.chance(TAKEN) {
                    let instance = self.instance();
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
