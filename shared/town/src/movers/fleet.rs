//! Mix of vehicles: parked ones and moving ones.

use crate::models::{two_wheeler, vehicle};
use crate::scene_builder::SceneBuilder;
use random::Random;
use raytrace::Primitive;

/// A vehicle at the kerb: mostly cars, some vans, a few two-wheelers and trucks.
pub fn parked(b: &mut SceneBuilder, instance: u16, random: &mut Random) -> Vec<Primitive> {
    match random.index(24) {
        0..=2 => vehicle::van_model(b, instance, random),
        3 => vehicle::minibus(b, instance, random),
        4 => two_wheeler::scooter(b, instance, random),
        5 => two_wheeler::motorcycle(b, instance, random),
        6 => two_wheeler::bicycle(b, instance, random),
        _ => vehicle::car(b, instance, random),
    }
}

/// A moving vehicle: cars, taxis, vans, buses, trucks, cyclists, scooters.
pub fn moving(b: &mut SceneBuilder, instance: u16, random: &mut Random) -> Vec<Primitive> {
    match random.index(24) {
        0 | 1 => vehicle::taxi(b, instance, random),
        2..=4 => vehicle::van_model(b, instance, random),
        5 | 6 => vehicle::bus(b, instance, random),
        7 => vehicle::truck(b, instance, random),
        8 | 9 => {
            let phase = random.range(0.0, 1.0);
            two_wheeler::cyclist(b, instance, phase, random)
        }
        10 | 11 => two_wheeler::scooter_rider(b, instance, random),
        12 => two_wheeler::motorcyclist(b, instance, random),
        _ => vehicle::car(b, instance, random),
    }
}

/// A vehicle on a motorway: cars, vans, trucks, buses, motorcyclists.
pub fn fast(b: &mut SceneBuilder, instance: u16, random: &mut Random) -> Vec<Primitive> {
    match random.index(24) {
        0..=3 => vehicle::van_model(b, instance, random),
        4..=7 => vehicle::truck(b, instance, random),
        8 => vehicle::bus(b, instance, random),
        9 => two_wheeler::motorcyclist(b, instance, random),
        _ => vehicle::car(b, instance, random),
    }
}

/// A car.
pub fn car(b: &mut SceneBuilder, instance: u16, random: &mut Random) -> Vec<Primitive> {
    vehicle::car(b, instance, random)
}
