//! Dense traffic: lanes full of vehicles that stop and start together with the ego vehicle.

use crate::construction::tour::Tour;
use crate::construction::town_builder::TownBuilder;
use crate::kind::Traffic;
use crate::models::vehicle;
use crate::movers::clearance::Clearance;
use crate::movers::fleet;
use crate::movers::mover::{Mover, Route, Timing};
use crate::streets::network::Leg;
use random::Random;
use raytrace::Primitive;
use std::sync::Arc;

/// Bumper-to-bumper distance of two vehicles in a standing queue, m.
const GAP_M: [f32; 2] = [1.2, 2.6];
/// Half length of the ego vehicle, m.
const EGO_HALF_M: f64 = 2.5;
/// Length of the queue ahead and behind, m: vehicles farther away are hidden by the others.
const REACH_M: f64 = 42.0;
/// Start delay along the queue, s per m: drivers react to the vehicle ahead.
const WAVE_S_PER_M: f64 = 0.02;
/// Largest start delay or lead of the neighboring lane, s.
const LANE_DELAY_S: f32 = 0.25;
/// Distance from the ego vehicle to the lane on its right, m, in streets with room for parked cars.
const RIGHT_M: f64 = 2.8;
/// Middle of the bus alongside, relative to the ego vehicle, m.
const ALONGSIDE_M: [f32; 2] = [-1.5, 2.5];

/// Kinds of queued vehicles, from the largest to the smallest.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Size {
    Bus,
    Truck,
    Van,
    Car,
}

impl Size {
    /// The next smaller size.
    const fn smaller(self) -> Option<Self> {
        match self {
            Self::Bus => Some(Self::Truck),
            Self::Truck => Some(Self::Van),
            Self::Van => Some(Self::Car),
            Self::Car => None,
        }
    }
}

/// A lane of the queue.
struct QueueLane<'a> {
    tour: &'a Tour,
    /// Offset to the left of the lane of the ego vehicle, m.
    left_m: f64,
    /// Lead of its start over the lane of the ego vehicle, s.
    earlier_s: f64,
}

impl TownBuilder {
    /// Builds queues in the lane of the ego vehicle, in the lane to its left, with a bus alongside, and in the lane to
    /// its right, which replaces parked cars. The street is one-way.
    pub fn queue(&mut self, tour: &Tour, clearance: &mut Clearance, random: &mut Random) -> Vec<Mover> {
        let own = QueueLane { tour, left_m: 0.0, earlier_s: 0.0 };
        let delay = f64::from(random.range(-LANE_DELAY_S, LANE_DELAY_S));
        let left_m = self.network.left_lane_m();
        let second_lane = QueueLane { tour, left_m, earlier_s: delay };
        let mut movers = Vec::new();
        for direction in [1.0, -1.0] {
            self.fill_lane(&own, direction * EGO_HALF_M, direction, clearance, random, &mut movers);
        }
        let alongside_m = f64::from(random.range(ALONGSIDE_M[0], ALONGSIDE_M[1]));
        let mut ends = [alongside_m; 2];
        if let Some(bus) = self.queued(&second_lane, Size::Bus, |_| alongside_m, clearance, random) {
            let half_m = half_length(&bus);
            ends = [alongside_m - half_m, alongside_m + half_m];
            movers.push(bus);
        }
        for (end_m, direction) in ends.into_iter().zip([-1.0, 1.0]) {
            self.fill_lane(&second_lane, end_m, direction, clearance, random, &mut movers);
        }
        if self.has_parking_on_round() {
            let delay = f64::from(random.range(-LANE_DELAY_S, LANE_DELAY_S));
            let right = QueueLane { tour, left_m: -RIGHT_M, earlier_s: delay };
            let middle_m = f64::from(random.range(-3.0, 0.0));
            for direction in [1.0, -1.0] {
                self.fill_lane(&right, middle_m, direction, clearance, random, &mut movers);
            }
        }
        movers
    }

    fn has_parking_on_round(&self) -> bool {
        let has_parking = |leg: &Leg| self.network.streets[leg.street].profile.parking_t(own_side(*leg)).is_some();
        self.network.round.iter().all(has_parking)
    }

    /// Whether the queue replaces the cars parked on a side (1 left, -1 right) of a street.
    pub fn is_queue_lane(&self, street: usize, side: f64) -> bool {
        let is_here = |leg: &Leg| leg.street == street && own_side(*leg) == side;
        self.traffic == Traffic::Dense && self.network.round.iter().any(is_here)
    }

    /// Fills a lane with consecutive vehicles from `end_m` on, ahead (`direction` 1) or behind (-1).
    fn fill_lane(
        &mut self,
        lane: &QueueLane<'_>,
        mut end_m: f64,
        direction: f64,
        clearance: &mut Clearance,
        random: &mut Random,
        movers: &mut Vec<Mover>,
    ) {
        while end_m.abs() < REACH_M {
            end_m += direction * f64::from(random.range(GAP_M[0], GAP_M[1]));
            let size = *random.pick(&[Size::Bus, Size::Truck, Size::Truck, Size::Van, Size::Van, Size::Car]);
            let place = |half_m: f64| end_m + direction * half_m;
            let Some(mover) = self.queued(lane, size, place, clearance, random) else {
                // No size fits.
                end_m += direction * EGO_HALF_M;
                continue;
            };
            end_m += direction * 2.0 * half_length(&mover);
            movers.push(mover);
        }
    }

    /// The largest vehicle up to `size` that does not meet the ego vehicle during the drive: long ones meet it in turns.
    /// `place` maps the half length of the vehicle to its middle, m ahead of the ego vehicle.
    fn queued(
        &mut self,
        lane: &QueueLane<'_>,
        size: Size,
        place: impl Fn(f64) -> f64,
        clearance: &mut Clearance,
        random: &mut Random,
    ) -> Option<Mover> {
        let mut wanted = Some(size);
        while let Some(size) = wanted {
            let model = self.model_of(size, random);
            let speed = lane.tour.speed.clone();
            let path: Arc<_> = lane.tour.path.clone();
            let timing = Timing::Ahead { speed, ahead_m: 0.0, earlier_s: 0.0 };
            let mut mover = Mover::new(model, Route { path, left_m: lane.left_m, leans: true, timing })?;
            let at_m = place(half_length(&mover));
            mover.route.timing = Timing::Ahead {
                speed: lane.tour.speed.clone(),
                ahead_m: at_m,
                earlier_s: lane.earlier_s + WAVE_S_PER_M * at_m,
            };
            if clearance.admit_queued(&mover) {
                return Some(mover);
            }
            wanted = size.smaller();
        }
        None
    }

    fn model_of(&mut self, size: Size, random: &mut Random) -> Vec<Primitive> {
        let instance = self.instances.next();
        match size {
            Size::Bus => vehicle::bus(&mut self.builder, instance, random),
            Size::Truck => vehicle::truck(&mut self.builder, instance, random),
            Size::Van => vehicle::van_model(&mut self.builder, instance, random),
            Size::Car => fleet::car(&mut self.builder, instance, random),
        }
    }
}

/// The side of a street (1 left, -1 right) on which the ego vehicle drives along a leg.
const fn own_side(leg: Leg) -> f64 {
    if leg.is_forward { -1.0 } else { 1.0 }
}

fn half_length(mover: &Mover) -> f64 {
    let [low, high] = mover.bounds();
    f64::from((high.x - low.x) * 0.5)
}
