//! Houses with gardens along residential streets.

use crate::construction::block_use::BlockUse;
use crate::construction::town_builder::TownBuilder;
use crate::models::{barrier, fence, house, structure, tree};
use crate::movers::fleet;
use random::Random;
use raytrace::Vec3;
use std::f64::consts::PI;

/// Distance from the garden fence to the front of the house, m.
const SETBACK_M: [f32; 2] = [4.0, 7.5];
/// Depth of plots, m: rows on both sides of a corner end where they would meet.
const PLOT_M: f64 = 18.0;
/// Height of the meadows relative to the terrain, m (see `ground`).
const LAWN_H: f64 = -0.16;

impl TownBuilder {
    /// Builds plots with houses along a side of a street, unless there is a park.
    pub fn gardens(&mut self, street: usize, side: f64, random: &mut Random) {
        if self.block_beside(street, side).is_some_and(|block| self.uses[block] == BlockUse::Park) {
            return;
        }
        let outer = self.outer_t(street);
        let [begin, end] = self.network.line_ends(street, side, outer + PLOT_M);
        let [first, last] = self.network.facade_ends(street, side);
        let mut s = begin.max(first);
        while s + 13.0 < end.min(last) {
            let width = f64::from(random.range(15.0, 21.0)).min(end.min(last) - s);
            if self.is_built(street, s + 0.5 * width, side * outer) {
                self.garden(street, side, [s, s + width], random);
            }
            s += width;
        }
        // The corners between two rows are also gardens.
        for corner in [[first, begin], [end, last]] {
            let middle = 0.5 * (corner[0] + corner[1]);
            if corner[1] - corner[0] > 3.0 && self.is_built(street, middle, side * outer) {
                self.front(street, side, [corner[0] + 0.5, corner[1]], random);
                let p = self.network.streets[street].plan(middle, side * (outer + 4.0));
                let pose = self.stand_at(&p, LAWN_H, 0.0);
                tree::build(&mut self.builder, &pose, random);
            }
        }
    }

    fn garden(&mut self, street: usize, side: f64, [from, to]: [f64; 2], random: &mut Random) {
        let outer = self.outer_t(street);
        let width = to - from;
        let setback = f64::from(random.range(SETBACK_M[0], SETBACK_M[1]));
        let line = self.network.streets[street].clone();
        let at = |s: f64, back: f64| line.plan(s, side * (outer + back));
        // A gap of 3.2 m for the driveway, on either side of the front.
        let is_drive_first = random.chance(0.5);
        let (drive, front) = if is_drive_first { (from + 1.9, [from + 3.5, to]) } else { (to - 1.9, [from, to - 3.5]) };
        self.front(street, side, front, random);
        let middle = 0.5 * (from + to) + if is_drive_first { 1.2 } else { -1.2 };
        // The front of the house, its -y side, faces the street.
        let yaw = line.heading(middle) + if side > 0.0 { 0.0 } else { PI };
        let house_width = (width - 6.5).clamp(7.0, 13.0) as f32;
        let depth = random.range(7.5, 9.5);
        let pose = self.stand_at(&at(middle, setback + 0.5 * f64::from(depth)), LAWN_H, yaw);
        if width > 18.0 && random.chance(0.2) {
            house::apartments(&mut self.builder, &pose, house_width, depth, 3 + random.index(2), random);
        } else {
            house::detached(&mut self.builder, &pose, house_width, depth, random);
        }
        if random.chance(0.55) {
            let instance = self.instances.next();
            let model = fleet::parked(&mut self.builder, instance, random);
            let turn = if random.chance(0.5) { 0.5 * PI } else { -0.5 * PI };
            let pose = line.leaning(drive, side * (outer + 4.2), LAWN_H, turn);
            self.builder.place(&model, &pose);
        }
        for _ in 0..=random.index(3) {
            let p =
                at(from + width * f64::from(random.range(0.1, 0.9)), f64::from(random.range(0.2, 0.8)) * setback + 1.2);
            let pose = self.stand_at(&p, LAWN_H, 0.0);
            match random.index(5) {
                0 => tree::sapling(&mut self.builder, &pose, random),
                1 | 2 => tree::bush(&mut self.builder, &pose, random),
                3 => tree::flower_bed(&mut self.builder, &pose, random),
                _ => tree::tuft(&mut self.builder, &pose, random),
            }
        }
        let p = at(middle, setback + f64::from(depth) + 4.0);
        let pose = self.stand_at(&p, LAWN_H, 0.0);
        if random.chance(0.6) {
            tree::build(&mut self.builder, &pose, random);
        } else {
            tree::conifer(&mut self.builder, &pose, random);
        }
        if random.chance(0.06) {
            let pose = self.stand_at(&at(drive, 2.5), LAWN_H, yaw);
            structure::skip(&mut self.builder, &pose, random);
        }
        // The border between neighbors.
        let feet = [2.0, 9.0, PLOT_M].map(|back| self.lawn_foot(street, to, side * (outer + back)));
        fence::mesh_fence(&mut self.builder, &feet);
    }

    /// A hedge, fence or wall along the sidewalk.
    fn front(&mut self, street: usize, side: f64, [from, to]: [f64; 2], random: &mut Random) {
        let t = side * (self.outer_t(street) + 0.45);
        let n = ((to - from) / 3.0).ceil().max(1.0) as usize;
        let feet: Vec<Vec3> =
            (0..=n).map(|i| self.lawn_foot(street, from + (to - from) * i as f64 / n as f64, t)).collect();
        let b = &mut self.builder;
        match random.index(6) {
            0 => tree::hedge(b, &feet, random.range(1.1, 1.9), random),
            1 => fence::wooden_fence(b, &feet, random),
            2 | 3 => barrier::wall(b, &feet, random),
            4 => fence::mesh_fence(b, &feet),
            _ => {}
        }
    }

    /// A position on the ground next to the street's own pavement.
    pub fn lawn_foot(&self, street: usize, s: f64, t: f64) -> Vec3 {
        self.network.streets[street].vertex(s, t, LAWN_H)
    }
}
