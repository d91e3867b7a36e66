//! Objects along country roads.

use crate::construction::reach::DETAIL_RADIUS_M;
use crate::construction::town_builder::TownBuilder;
use crate::material::Material;
use crate::models::{barrier, bridge, fence, house, pole, sign, tree};
use crate::streets::country::Stretch;
use messages::ClassId;
use random::Random;
use raytrace::{Shape, Vec3};
use std::f64::consts::PI;

/// How far the meadows lie below the terrain, m (see `ground`).
pub const MEADOW_H: f64 = -0.16;

impl TownBuilder {
    /// One street of a rural town: a stretch of its round, or a lane.
    pub fn rural_street(&mut self, street: usize, random: &mut Random) {
        let is_lane = !self.is_on_round(street);
        if is_lane {
            self.lane_side(street, random);
            return;
        }
        match self.stretches[street] {
            Stretch::Village => self.village(street, random),
            Stretch::Field => {}
            Stretch::Forest => self.forest(street, random),
            Stretch::Tunnel => self.tunnel(street, random),
            Stretch::Crossings => {
                self.level_crossing(street, 0.24, random);
                self.canal(street, random);
                self.overpass(street, 0.8, random);
            }
            Stretch::Farms => self.farms(street, random),
        }
        if !matches!(self.stretches[street], Stretch::Field) {
            for side in [-1.0, 1.0] {
                let [begin, end] = self.network.mouths(street);
                let s = if side < 0.0 { end - 12.0 } else { begin + 12.0 };
                if self.is_built(street, s, 0.0) {
                    self.sign(street, s, side, random);
                    let pose = self.by_kerb(street, s - 6.0 * side, side, 2.4);
                    sign::direction_sign(&mut self.builder, &pose, random);
                }
            }
        }
    }

    /// Places `every` m along a street between its mouths, at a distance from the center line; only those that are built.
    pub fn feet(&self, street: usize, [from, to]: [f64; 2], t: f64, every: f64) -> Vec<Vec3> {
        let n = ((to - from) / every).ceil().max(1.0) as usize;
        let line = &self.network.streets[street];
        (0..=n)
            .map(|i| from + (to - from) * i as f64 / n as f64)
            .filter(|s| self.is_built(street, *s, t))
            .map(|s| line.vertex(s, t, if t.abs() > line.profile.outer_t { MEADOW_H } else { line.profile.height(t) }))
            .collect()
    }

    fn village(&mut self, street: usize, random: &mut Random) {
        for side in [-1.0, 1.0] {
            self.gardens(street, side, random);
            self.quiet_kerbside(street, side, random);
        }
    }

    fn lane_side(&mut self, street: usize, random: &mut Random) {
        let [begin, end] = self.network.mouths(street);
        for side in [-1.0, 1.0] {
            let t = side * (self.outer_t(street) + 0.5);
            let feet = self.feet(street, [begin + 2.0, end], t, 5.0);
            if feet.len() < 2 {
                continue;
            }
            match random.index(4) {
                0 => fence::pasture_fence(&mut self.builder, &feet, random),
                1 => tree::hedge(&mut self.builder, &feet, random.range(1.2, 2.2), random),
                2 => barrier::wall(&mut self.builder, &feet, random),
                _ => {}
            }
        }
        // A barn or the village's church at its end.
        let line = self.network.streets[street].clone();
        if self.is_built(street, end, 0.0) {
            if line.profile.has_kerb() {
                let pose = self.stand_at(&line.plan(end + 14.0, 0.0), MEADOW_H, line.heading(end));
                house::church(&mut self.builder, &pose, random);
            } else {
                let pose = self.stand_at(&line.plan(end + 9.0, 0.0), MEADOW_H, line.heading(end) - 0.5 * PI);
                house::barn(&mut self.builder, &pose, random);
            }
        }
    }

    /// Trees scattered beside a street, from `t[0]` to `t[1]` m off the center line.
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

    fn forest(&mut self, street: usize, random: &mut Random) {
        let side = if random.chance(0.5) { 1.0 } else { -1.0 };
        let outer = self.outer_t(street) as f32;
        self.trees(street, side, [outer + 1.0, outer + 9.0], 3.0, random);
        self.trees(street, side, [outer + 8.0, outer + 35.0], 2.2, random);
        self.trees(street, -side, [outer + 12.0, outer + 40.0], 7.0, random);
        let line = &self.network.streets[street];
        let (t, span) = (-side * (line.profile.kerb_t + 0.9), [0.08, 0.92].map(|share| share * line.length_m));
        self.guard_rail(street, t, side > 0.0, span);
        let [begin, end] = self.network.mouths(street);
        let feet = self.feet(street, [begin + 5.0, end - 5.0], side * f64::from(outer), 32.0);
        pole::utility_line(&mut self.builder, &feet, random);
    }

    /// A guard rail at `t` m from the center line, from one place on the street to another; its road side is on its left or right.
    pub fn guard_rail(&mut self, street: usize, t: f64, faces_left: bool, span: [f64; 2]) {
        let mut feet = self.feet(street, span, t, 4.0);
        // The model's road side is on the left of its foot line.
        if !faces_left {
            feet.reverse();
        }
        if feet.len() > 1 {
            barrier::guard_rail(&mut self.builder, &feet);
        }
    }

    fn farms(&mut self, street: usize, random: &mut Random) {
        let [begin, end] = self.network.mouths(street);
        for side in [-1.0, 1.0] {
            let t = side * (self.outer_t(street) + 0.3);
            let feet = self.feet(street, [begin + 4.0, end - 4.0], t, 11.0);
            for foot in &feet {
                let pose = nalgebra::Isometry3::translation(foot.x, foot.y, foot.z);
                tree::poplar(&mut self.builder, &pose, random);
            }
            let fence = self.feet(street, [begin + 4.0, end - 4.0], t + side * 2.0, 6.0);
            if fence.len() > 1 {
                fence::pasture_fence(&mut self.builder, &fence, random);
            }
            let mut s = begin + 30.0;
            while s < end - 30.0 {
                let t = side * f64::from(random.range(24.0, 45.0));
                if self.is_built(street, s, t) {
                    let line = &self.network.streets[street];
                    let yaw = line.heading(s) + if side > 0.0 { 0.0 } else { PI };
                    let pose = self.stand_at(&line.plan(s, t), MEADOW_H, yaw);
                    if random.chance(0.5) {
                        house::barn(&mut self.builder, &pose, random);
                    } else {
                        house::detached(&mut self.builder, &pose, 11.0, 8.0, random);
                    }
                }
                // Bales of hay on the meadow: class unlabeled.
                let p = self.network.streets[street].plan(s + 14.0, side * f64::from(random.range(12.0, 22.0)));
                if self.reach.is_near(&p, DETAIL_RADIUS_M) {
                    let hay = self.builder.surface(ClassId::Unlabeled, 0, Material::DryGrass);
                    let pose = self.stand_at(&p, MEADOW_H, f64::from(random.range(0.0, 3.0)));
                    let at = |y: f32| (pose * nalgebra::Point3::new(0.0, y, 0.62)).coords;
                    self.builder.add(Shape::cylinder(at(-0.65), at(0.65), 0.65), hay);
                }
                s += f64::from(random.range(35.0, 60.0));
            }
        }
    }

    /// A bridge over the road, its ramps on both sides.
    pub fn overpass(&mut self, street: usize, share: f64, random: &mut Random) {
        let line = self.network.streets[street].clone();
        let s = share * line.length_m;
        if !self.is_built(street, s, 0.0) {
            return;
        }
        let half = line.profile.kerb_t + 2.8;
        let over = bridge::Overpass { span_m: 2.0 * half as f32, width_m: 7.0, clearance_m: 4.9 };
        let pose = line.upright(s, 0.0, 0.0, 0.0);
        over.build(&mut self.builder, &pose, random);
        let top = f64::from(over.clearance_m + bridge::Overpass::DECK_M);
        let grass = self.pavings.id(crate::streets::paving::Paving::Grass);
        let road = self.pavings.id(crate::streets::paving::Paving::Asphalt);
        let at = |along: f64, t: f64, h: f64| line.vertex(s + along, t, h);
        for side in [-1.0, 1.0] {
            let [near, far] = [half + 1.5, half + 45.0].map(|t| side * t);
            self.builder.quad([at(-3.5, near, top), at(3.5, near, top), at(3.5, far, -0.3), at(-3.5, far, -0.3)], road);
            for edge in [-1.0, 1.0] {
                let [inner, outer] = [3.5 * edge, 13.0 * edge];
                let corners = [at(inner, near, top), at(inner, far, -0.3), at(outer, far, -0.6), at(outer, near, -0.6)];
                self.builder.quad(corners, grass);
                let face = [at(inner, near, top), at(outer, near, -0.6), at(inner, near, -0.6)];
                self.builder.triangle(face, grass);
            }
        }
    }
}
