//! Cars, parked and driving, and people.

use super::ground;
use super::layout::{LANE_T, Town};
use super::models::{person, vehicle};
use super::mover::{Mover, Route};
use crate::motion::Progress;
use crate::random::Random;

/// Middle of the parked cars, m from the center line.
const PARKING_T: f64 = 4.15;
/// The oncoming cars' speed, m/s; all have the same, so that nobody drives through the one in front.
const ONCOMING_MPS: f64 = 8.5;

impl Town {
    /// Cars along one kerb, with gaps.
    pub fn parked_cars(&mut self, side: f32, random: &mut Random) {
        let [begin, end] = self.ends();
        let yaw = if side > 0.0 { std::f64::consts::PI } else { 0.0 };
        let mut x = begin + 5.0;
        while x < end - 5.0 {
            if !self.near_crossing(x, 11.0) && random.chance(0.72) {
                let instance = self.instance();
                let model = vehicle::random_model(&mut self.builder, instance, random);
                let t = f64::from(side) * (PARKING_T + f64::from(random.range(-0.12, 0.12)));
                let turned = yaw + f64::from(random.range(-0.03, 0.03));
                let pose = self.street.frame(f64::from(x), t, road_height(t), turned);
                self.builder.place(&model, &pose.cast());
            }
            x += random.range(5.7, 7.2);
        }
    }

    /// All that moves during the drive.
    pub fn traffic(&mut self, progress: Progress, seconds: f64, random: &mut Random) -> Vec<Mover> {
        let mut movers = self.convoy(progress, random);
        movers.extend(self.oncoming(progress, seconds, random));
        movers.extend(self.walkers(progress, seconds, random));
        movers
    }

    /// A car ahead of the recording vehicle and one behind it.
    fn convoy(&mut self, progress: Progress, random: &mut Random) -> Vec<Mover> {
        [(15.0, 1.0), (-13.0, 2.0)]
            .into_iter()
            .filter_map(|(ahead_m, drift_m)| {
                let instance = self.instance();
                let model = vehicle::random_model(&mut self.builder, instance, random);
                Mover::new(model, Route::Convoy { progress, ahead_m, drift_m, t: LANE_T })
            })
            .collect()
    }

    /// Every third oncoming car is a van.
    fn oncoming(&mut self, progress: Progress, seconds: f64, random: &mut Random) -> Vec<Mover> {
        let mut movers = Vec::new();
        let mut x = progress.x(0.0) + f64::from(random.range(25.0, 40.0));
        // What can still meet the vehicle before the drive ends.
        while x < progress.x(seconds) + ONCOMING_MPS * seconds + 30.0 {
            let instance = self.instance();
            let model = if movers.len() % 3 == 1 {
                vehicle::van_model(&mut self.builder, instance, random)
            } else {
                vehicle::random_model(&mut self.builder, instance, random)
            };
            let t = -LANE_T;
            movers.extend(Mover::new(model, Route::Steady { x, t, h: road_height(t), speed_mps: -ONCOMING_MPS }));
            x += f64::from(random.range(28.0, 55.0));
        }
        movers
    }

    /// People on both sidewalks, one in five standing.
    fn walkers(&mut self, progress: Progress, seconds: f64, random: &mut Random) -> Vec<Mover> {
        let mut movers = Vec::new();
        let mut x = progress.x(0.0) - 10.0;
        while x < progress.x(seconds) + 40.0 {
            let instance = self.instance();
            let model = person::model(&mut self.builder, instance, random);
            let t = random.pick([-1.0, 1.0]) * f64::from(random.range(6.6, 7.3));
            let speed_mps = random.pick([-1.0, -1.0, 0.0, 1.0, 1.0]) * f64::from(random.range(0.9, 1.6));
            let h = f64::from(ground::walk_height(t as f32));
            movers.extend(Mover::new(model, Route::Steady { x, t, h, speed_mps }));
            x += f64::from(random.range(4.0, 11.0));
        }
        movers
    }
}

/// Height of the smooth road, m.
fn road_height(t: f64) -> f64 {
    f64::from(ground::road_height(t as f32))
}
