//! Objects on the sidewalks of a street.

use crate::construction::ground::STOP_LINE;
use crate::construction::town_builder::TownBuilder;
use crate::models::{clutter, fence, furniture, person, pole, sign, structure, tree};
use nalgebra::Isometry3;
use random::Random;
use std::f64::consts::PI;

/// Spacing of objects at the kerb, m.
const BEAT_M: [f32; 2] = [3.6, 6.0];
/// Distance to junctions without objects, m.
const CLEAR_M: f64 = 5.5;
/// Least width of sidewalks with objects at the walls, m.
const WALL_OBJECTS_M: f64 = 3.3;

impl TownBuilder {
    /// Builds trees, lamps, signs, furniture and clutter on a sidewalk between houses.
    pub fn kerbside(&mut self, street: usize, side: f64, random: &mut Random) {
        let [begin, end] = self.network.mouths(street);
        // All trees of a row are of one kind.
        let tree_kind = random.index(3);
        let tree_every = 2 + random.index(2);
        let mut slot = random.index(12);
        let mut s = begin + CLEAR_M + f64::from(random.range(0.0, 3.0));
        while s < end - CLEAR_M {
            slot += 1;
            if self.is_built(street, s, 0.0) {
                if slot.is_multiple_of(tree_every) {
                    let pose = self.by_kerb(street, s, side, 0.85);
                    match tree_kind {
                        0 => tree::plane_tree(&mut self.builder, &pose, random),
                        1 => tree::deciduous(&mut self.builder, &pose, random),
                        _ => tree::build(&mut self.builder, &pose, random),
                    }
                } else {
                    self.object_at_kerb(slot, street, s, side, random);
                }
                if slot.is_multiple_of(3) {
                    self.object_at_wall(street, s, side, random);
                }
            }
            s += f64::from(random.range(BEAT_M[0], BEAT_M[1]));
        }
        self.corner_railings(street, side, random);
    }

    /// Builds lamps, a few signs and bins on a sidewalk between gardens or in a village.
    pub fn quiet_kerbside(&mut self, street: usize, side: f64, random: &mut Random) {
        let [begin, end] = self.network.mouths(street);
        let mut s = begin + 3.0 + f64::from(random.range(0.0, 6.0));
        let mut slot = random.index(4);
        while s < end - 3.0 {
            slot += 1;
            if self.is_built(street, s, 0.0) {
                let pose = self.by_kerb(street, s, side, 0.35);
                match slot % 4 {
                    0 => pole::lamp_post(&mut self.builder, &pose, random),
                    1 if random.chance(0.6) => self.sign(street, s, side, random),
                    2 if random.chance(0.6) => {
                        let pose =
                            self.stand(street, s, side * (self.outer_t(street) - 0.4), self.facing_road(side) + PI);
                        clutter::bin(&mut self.builder, &pose, random);
                    }
                    3 if random.chance(0.4) => {
                        let pose =
                            self.stand(street, s, side * (self.outer_t(street) - 0.35), self.facing_road(side) + PI);
                        let objects = [furniture::mailbox, furniture::hydrant, furniture::cabinet];
                        objects[random.index(objects.len())](&mut self.builder, &pose, random);
                    }
                    _ => {}
                }
            }
            s += f64::from(random.range(7.0, 12.0));
        }
    }

    /// Builds traffic lights at both ends of a street, on the right and sometimes on the left of approaching traffic.
    pub fn lights(&mut self, street: usize, random: &mut Random) {
        for end in [0, 1] {
            let node = self.network.streets[street].nodes[end];
            if !self.network.nodes[node].has_lights || !self.is_node_on_round(node) {
                continue;
            }
            let line = self.network.streets[street].clone();
            let from_node = self.network.arm(street, end).mouth_m + STOP_LINE[0] - 0.6;
            // x points in the direction of approaching traffic: the lamps face -x.
            let yaw = if end == 1 { 0.0 } else { PI };
            let at = line.profile.kerb_t + 0.45;
            for (t, is_right) in [(at, true), (-at, false)] {
                let (s, t) = line.at_node(end, from_node, t);
                if !self.is_built(street, s, 0.0) {
                    continue;
                }
                let pose = self.stand(street, s, t, yaw);
                if is_right && random.chance(0.3) {
                    pole::traffic_light_arm(&mut self.builder, &pose, 3.5);
                } else if is_right || random.chance(0.5) {
                    pole::traffic_light(&mut self.builder, &pose);
                }
            }
        }
    }

    /// Builds a sign that faces the traffic on its side.
    pub fn sign(&mut self, street: usize, s: f64, side: f64, random: &mut Random) {
        let yaw = if side < 0.0 { 0.0 } else { PI };
        let pose = self.stand(street, s, side * (self.network.streets[street].profile.kerb_t + 0.45), yaw);
        sign::sign(&mut self.builder, &pose, random);
    }

    /// A frame `off_m` behind the kerb with the road on its left.
    pub fn by_kerb(&self, street: usize, s: f64, side: f64, off_m: f64) -> Isometry3<f32> {
        let t = side * (self.network.streets[street].profile.kerb_t + off_m);
        self.stand(street, s, t, self.facing_road(side))
    }
    /// The yaw at which y points to the road.
    #[allow(clippy::unused_self, reason = "reads as a property of the town's streets")]
    pub fn facing_road(&self, side: f64) -> f64 {
        if side > 0.0 { PI } else { 0.0 }
    }
    pub fn outer_t(&self, street: usize) -> f64 {
        self.network.streets[street].profile.outer_t
    }

    fn object_at_kerb(&mut self, slot: usize, street: usize, s: f64, side: f64, random: &mut Random) {
        let pose = self.by_kerb(street, s, side, 0.5);
        let is_wide = self.outer_t(street) > 9.3;
        // Furniture opens towards -y: to the sidewalk if y points to the road.
        let b = &mut self.builder;
        match slot % 11 {
            0 | 5 => pole::lamp_post(b, &pose, random),
            1 | 7 => self.sign(street, s, side, random),
            2 => {
                for i in 0..4 {
                    let pose = self.by_kerb(street, s + 1.1 * f64::from(i), side, 0.35);
                    pole::bollard(&mut self.builder, &pose, random);
                }
            }
            3 => clutter::bin(b, &pose, random),
            4 => furniture::bicycle_rack(b, &pose, random),
            6 => furniture::cabinet(b, &pose, random),
            8 if is_wide => {
                let pose = self.by_kerb(street, s, side, 1.1);
                match random.index(4) {
                    0 => furniture::advertising_column(&mut self.builder, &pose, random),
                    1 => furniture::bus_shelter(&mut self.builder, &pose, random),
                    2 => furniture::kiosk(&mut self.builder, &pose, random),
                    _ => furniture::bench(&mut self.builder, &pose, random),
                }
            }
            8 => furniture::hydrant(b, &pose, random),
            9 => furniture::mailbox(b, &pose, random),
            _ => match random.index(5) {
                4 => self.heap(
                    &self.network.streets[street].plan(s, side * (self.network.streets[street].profile.kerb_t - 0.9)),
                    -0.08,
                    random,
                ),
                0 => clutter::bags(b, &pose, random),
                1 => clutter::cone(b, &pose, random),
                2 => clutter::barrier(b, &pose, random),
                _ => tree::flower_pot(b, &pose, random),
            },
        }
    }

    /// Builds objects in front of shops and groups of people where the sidewalk is wide enough.
    fn object_at_wall(&mut self, street: usize, s: f64, side: f64, random: &mut Random) {
        let profile = self.network.streets[street].profile;
        if profile.outer_t - profile.kerb_t < WALL_OBJECTS_M {
            return;
        }
        let has_houses = self.block_beside(street, side).is_none_or(|block| self.uses[block].has_houses());
        let t = side * (profile.outer_t - 0.55);
        let pose = self.stand(street, s, t, self.facing_road(side) + PI);
        let b = &mut self.builder;
        match random.index(8) {
            0 if has_houses => clutter::cafe_table(b, &pose, random),
            1 if has_houses => clutter::crates(b, &pose, random),
            2 => clutter::sandwich_board(b, &pose, random),
            3 => furniture::bench(b, &pose, random),
            4 => tree::flower_pot(b, &pose, random),
            5 if has_houses && random.chance(0.35) => structure::scaffolding(b, &pose, 8.0),
            6 => self.group(&self.network.streets[street].plan(s, t), profile.side_height(t), random),
            _ => {}
        }
    }

    /// Builds a group of two to four people in conversation, `h` m above the terrain.
    pub fn group(&mut self, p: &nalgebra::Vector2<f64>, h: f64, random: &mut Random) {
        let pose = self.stand_at(p, h, 0.0);
        let Self { builder, instances, .. } = self;
        person::group(builder, &pose, &mut || instances.next(), random);
    }

    /// Builds railings at street corners next to the crosswalk.
    fn corner_railings(&mut self, street: usize, side: f64, random: &mut Random) {
        for end in [0, 1] {
            let line = self.network.streets[street].clone();
            let node = line.nodes[end];
            let mouth = self.network.arm(street, end).mouth_m;
            if !self.is_node_on_round(node) || !random.chance(0.4) {
                continue;
            }
            let feet: Vec<_> = (0..4)
                .map(|i| {
                    let (s, _) = line.at_node(end, mouth + 5.2 + 1.3 * f64::from(i), 0.0);
                    self.stand(street, s, side * (line.profile.kerb_t + 0.25), 0.0).translation.vector
                })
                .collect();
            if self.is_built(street, line.at_node(end, mouth + 7.0, 0.0).0, 0.0) {
                fence::railing(&mut self.builder, &feet);
            }
        }
    }
}
