//! Which vehicles are parked and which drive.

use super::builder::Builder;
use super::models::vehicle;
use crate::random::Random;
use crate::trace::Primitive;

/// A parked vehicle: mostly cars.
pub fn parked(b: &mut Builder, instance: u16, random: &mut Random) -> Vec<Primitive> {
    match random.index(8) {
        0 => vehicle::van_model(b, instance, random),
        _ => vehicle::random_model(b, instance, random),
    }
}

/// A vehicle on its way.
pub fn moving(b: &mut Builder, instance: u16, random: &mut Random) -> Vec<Primitive> {
    match random.index(5) {
        0 => vehicle::van_model(b, instance, random),
        _ => vehicle::random_model(b, instance, random),
    }
}
