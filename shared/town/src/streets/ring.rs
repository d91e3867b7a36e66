//! Nodes in a ring: the rounds of country roads and motorways.

use nalgebra::{Rotation2, Vector2};
use random::Random;
use std::f64::consts::TAU;

/// Deviation of the nodes of a ring from a regular polygon.
#[derive(Clone, Copy, Debug)]
pub struct Ring {
    /// Mean radius, m.
    pub radius_m: f32,
    /// Largest deviation along the ring, as a share of the distance between nodes.
    pub along: f32,
    /// Smallest and largest radius, as shares of the mean.
    pub radii: [f32; 2],
    /// Largest deviation of the headings, rad.
    pub heading: f32,
}

impl Ring {
    /// Positions of `n` nodes, counterclockwise, and the directions in which a street passes them.
    pub fn nodes(&self, n: usize, random: &mut Random) -> (Vec<Vector2<f64>>, Vec<Vector2<f64>>) {
        let turn = f64::from(random.range(0.0, TAU as f32));
        let polar = |angle: f64, radius: f64| Vector2::new(angle.cos(), angle.sin()) * radius;
        let angles: Vec<f64> = (0..n)
            .map(|k| turn + (k as f64 + f64::from(random.range(-self.along, self.along))) * TAU / n as f64)
            .collect();
        let [least, most] = self.radii;
        let places =
            angles.iter().map(|angle| polar(*angle, f64::from(self.radius_m * random.range(least, most)))).collect();
        let headings = angles
            .iter()
            .map(|angle| {
                Rotation2::new(f64::from(random.range(-self.heading, self.heading))) * polar(angle + TAU / 4.0, 1.0)
            })
            .collect();
        (places, headings)
    }
}
