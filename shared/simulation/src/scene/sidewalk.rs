//! What stands on the sidewalks.

use super::ground::{FACADE_T, KERB_T};
use super::layout::Town;
use super::models::{clutter, furniture, pole, sign, tree};
use crate::random::Random;
use std::f32::consts::PI;

impl Town {
    /// Trees, lamps, signs, benches and bins, each on its own beat.
    pub fn sidewalk(&mut self, side: f32, random: &mut Random) {
        let [begin, end] = self.ends();
        let mut x = begin + 4.0 + random.range(0.0, 4.0);
        let mut beat = random.index(6);
        while x < end - 2.0 {
            beat += 1;
            if !self.near_crossing(x, 9.5) {
                self.stand_by_the_kerb(beat % 6, x, side, random);
            }
            x += random.range(4.0, 6.5);
        }
    }

    fn stand_by_the_kerb(&mut self, kind: usize, x: f32, side: f32, random: &mut Random) {
        let (by_kerb, by_wall) = (side * (KERB_T + 0.55), side * (FACADE_T - 0.65));
        // Turned half around on the left side, where the road is to the right.
        let yaw = if side > 0.0 { PI } else { 0.0 };
        match kind {
            0 | 3 => {
                let pose = self.stand(x, by_kerb + side * 0.3, 0.0);
                tree::build(&mut self.builder, &pose, random);
            }
            1 => {
                let pose = self.stand(x, by_kerb, yaw);
                pole::lamp_post(&mut self.builder, &pose, random);
            }
            2 => {
                let pose = self.stand(x, by_kerb, yaw);
                sign::sign(&mut self.builder, &pose, random);
            }
            4 => {
                let pose = self.stand(x, by_wall, PI - yaw);
                furniture::bench(&mut self.builder, &pose, random);
            }
            _ => {
                let (bin, bollard) =
                    (self.stand(x, by_wall, random.range(-0.2, 0.2)), self.stand(x + 1.0, by_kerb, 0.0));
                clutter::bin(&mut self.builder, &bin, random);
                pole::bollard(&mut self.builder, &bollard, random);
            }
        }
    }
}
