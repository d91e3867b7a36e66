//! Rows of objects along country roads: feet of fences and rails, trees, bushes.

use crate::construction::town_builder::TownBuilder;
use crate::models::{barrier, tree};
use random::Random;
use raytrace::Vec3;

/// Height of the meadows relative to the terrain, m (see `ground`).
pub const MEADOW_H: f64 = -0.16;

impl TownBuilder {
    /// Height of the street, or of the meadows next to it, above the terrain at `t` m from the center line, m.
    fn beside_h(&self, street: usize, t: f64) -> f64 {
        let profile = self.network.streets[street].profile;
        if t.abs() > profile.outer_t { MEADOW_H } else { profile.height(t) }
    }

    /// Positions every `every` m along a street between its mouths, at a distance from the center line; only positions
    /// that are built.
    pub fn feet(&self, street: usize, [from, to]: [f64; 2], t: f64, every: f64) -> Vec<Vec3> {
        let n = ((to - from) / every).ceil().max(1.0) as usize;
        let line = &self.network.streets[street];
        (0..=n)
            .map(|i| from + (to - from) * i as f64 / n as f64)
            .filter(|s| self.is_built(street, *s, t))
            .map(|s| line.vertex(s, t, self.beside_h(street, t)))
            .collect()
    }

    /// Scatters trees along a street, from `t[0]` to `t[1]` m off the center line.
    pub fn trees(&mut self, street: usize, side: f64, t: [f32; 2], every: f32, random: &mut Random) {
        let [begin, end] = self.network.mouths(street);
        let mut s = begin;
        while s < end {
            let off = side * f64::from(random.range(t[0], t[1]));
            if self.is_built(street, s, off) {
                let pose = self.stand_at(&self.network.streets[street].plan(s, off), MEADOW_H, 0.0);
                let b = &mut self.builder;
                match random.index(7) {
                    0..=2 => tree::conifer(b, &pose, random),
                    3 | 4 => tree::deciduous(b, &pose, random),
                    5 => tree::bush(b, &pose, random),
                    _ => tree::tuft(b, &pose, random),
                }
            }
            s += f64::from(every * random.range(0.5, 1.5));
        }
    }

    /// Builds bushes along a span of a street, `t[0]` to `t[1]` m from the center line, `apart` m from each other.
    pub fn bushes(&mut self, street: usize, span: [f64; 2], t: [f32; 2], apart: [f32; 2], random: &mut Random) {
        let mut s = span[0];
        while s < span[1] {
            let t = f64::from(random.range(t[0], t[1]));
            if self.is_built(street, s, t) {
                let pose = self.stand_at(&self.network.streets[street].plan(s, t), self.beside_h(street, t), 0.0);
                tree::bush(&mut self.builder, &pose, random);
            }
            s += f64::from(random.range(apart[0], apart[1]));
        }
    }

    /// Builds a guard rail along a span of a street, `t` m from the center line; its road side is on its left or right.
    pub fn guard_rail(&mut self, street: usize, t: f64, faces_left: bool, span: [f64; 2]) {
        let mut feet = self.feet(street, span, t, 4.0);
        // The road side of the model is on the left of its foot line.
        if !faces_left {
            feet.reverse();
        }
        if feet.len() > 1 {
            barrier::guard_rail(&mut self.builder, &feet);
        }
    }
}
