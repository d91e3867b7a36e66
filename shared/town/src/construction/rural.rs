//! Objects along country roads.

use crate::construction::reach::DETAIL_RADIUS_M;
use crate::construction::roadside::MEADOW_H;
use crate::construction::town_builder::TownBuilder;
use crate::material::Material;
use crate::models::{barrier, fence, house, pole, sign, tree};
use crate::streets::country::Stretch;
use messages::ClassId;
use random::Random;
use raytrace::Shape;
use std::f64::consts::PI;

impl TownBuilder {
    /// Builds the objects of one street of a rural town: a stretch of its round, or a lane.
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
        // A barn, or the church of the village, at its end.
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

    fn forest(&mut self, street: usize, random: &mut Random) {
        let side = if random.chance(0.5) { 1.0 } else { -1.0 };
        let outer = self.outer_t(street) as f32;
        self.trees(street, side, [outer + 1.0, outer + 9.0], 3.0, random);
        self.trees(street, side, [outer + 8.0, outer + 35.0], 2.2, random);
        self.trees(street, -side, [outer + 12.0, outer + 40.0], 7.0, random);
        let line = &self.network.streets[street];
        let t = -side * (line.profile.kerb_t + 0.9);
        let span = [0.08, 0.92].map(|share| share * line.length_m);
        self.guard_rail(street, t, side > 0.0, span);
        let [begin, end] = self.network.mouths(street);
        let feet = self.feet(street, [begin + 5.0, end - 5.0], side * f64::from(outer), 32.0);
        pole::utility_line(&mut self.builder, &feet, random);
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
                // Hay bales on the meadow: class unlabeled.
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
}
