//! Rows of houses along urban streets, with gateways to courtyards.

use crate::construction::block_use::BlockUse;
use crate::construction::reach::DETAIL_RADIUS_M;
use crate::construction::town_builder::TownBuilder;
use crate::material::Material;
use crate::models::facade::{self, Wall};
use crate::models::house::{self, Lot};
use crate::models::style::Style;
use crate::models::{clutter, fence, furniture, tree};
use messages::ClassId;
use nalgebra::Isometry3;
use random::Random;
use raytrace::Vec3;
use std::f32::consts::TAU;

/// Depth of houses, m.
const DEPTH_M: f64 = 10.0;
/// Depth of courtyards behind gateways, m.
const YARD_M: f64 = 16.0;

/// The plot of a house: its front from `front[0]` to `front[1]` along the street, its back likewise.
#[derive(Clone, Copy, Debug)]
struct Plot {
    street: usize,
    side: f64,
    front: [f64; 2],
    back: [f64; 2],
    /// Distance from the center line to the facade, m.
    t: f64,
}

impl Plot {
    /// Street coordinates at `share` of the front and `back_m` behind it.
    fn point(&self, share: f64, back_m: f64) -> (f64, f64) {
        let along = |ends: [f64; 2]| ends[0] + (ends[1] - ends[0]) * share;
        let front = along(self.front);
        let back = along(self.back);
        (front + (back - front) * (back_m / DEPTH_M).clamp(0.0, 1.5), self.side * (self.t + back_m))
    }
}

impl TownBuilder {
    /// Builds houses from corner to corner, if the adjacent block has houses.
    pub fn row_of_houses(&mut self, street: usize, side: f64, random: &mut Random) {
        if self.block_beside(street, side).is_some_and(|block| self.uses[block] != BlockUse::Houses) {
            return;
        }
        let profile = self.network.streets[street].profile;
        let [begin, end] = self.network.facade_ends(street, side);
        let [back_begin, back_end] = self.network.line_ends(street, side, profile.outer_t + DEPTH_M);
        let mut s = begin;
        while s < end - 1.0 {
            let mut width = f64::from(random.range(9.0, 19.0));
            if end - s - width < 7.0 {
                width = end - s;
            }
            let is_first = s == begin;
            let is_last = s + width >= end - 0.01;
            let plot = Plot {
                street,
                side,
                front: [s, s + width],
                // Corner houses meet their neighbors around the corner on a miter.
                back: [if is_first { back_begin } else { s }, if is_last { back_end } else { s + width }],
                t: profile.outer_t + f64::from(random.range(0.0, 0.3)),
            };
            s += width;
            let is_gateway = !is_first && !is_last && random.chance(0.14);
            if is_gateway {
                let gap = f64::from(random.range(3.0, 4.5));
                let gate = Plot {
                    front: [plot.front[0], plot.front[0] + gap],
                    back: [plot.back[0], plot.back[0] + gap],
                    ..plot
                };
                if self.is_built(street, gate.front[0], gate.t) {
                    self.courtyard(&gate, random);
                }
                s = plot.front[0] + gap;
            } else if self.is_built(street, 0.5 * (plot.front[0] + plot.front[1]), side * plot.t) {
                self.house(&plot, random);
            }
        }
    }

    fn house(&mut self, plot: &Plot, random: &mut Random) {
        let style = Style::urban(random);
        let lot = Lot {
            width: (plot.front[1] - plot.front[0]) as f32,
            depth: DEPTH_M as f32,
            floors: 3 + random.index(4),
            open: [false; 2],
            gate: random.chance(0.15),
        };
        let street = self.network.streets[plot.street].clone();
        let base = street.point(0.5 * (plot.front[0] + plot.front[1]), plot.side * plot.t, 0.1).z as f32;
        let width = f64::from(lot.width);
        let plan = |u: f32, z: f32, out: f32| {
            let (s, t) = plot.point(f64::from(u) / width, f64::from(-out));
            let mut p = street.vertex(s, t, 0.0);
            p.z = base + z;
            p
        };
        house::row_house(&mut self.builder, &plan, &lot, &style, random);
    }

    /// Builds a gap between two houses: closed by a fence at the sidewalk, or open to a paved yard with a wall at its
    /// end.
    fn courtyard(&mut self, gate: &Plot, random: &mut Random) {
        let street = self.network.streets[gate.street].clone();
        let h = street.profile.side_height(street.profile.outer_t);
        let point = |s: f64, back: f64, up: f64| street.vertex(s, gate.side * (gate.t + back), h + up);
        if random.chance(0.35) {
            let feet = [gate.front[0], gate.front[1]].map(|s| point(s, 0.3, 0.0));
            fence::bar_fence(&mut self.builder, &feet);
        }
        let cobble = self.pavings.id(crate::streets::paving::Paving::Cobble);
        let wall = self.builder.surface(ClassId::Wall, 0, *random.pick(&[Material::Brick, Material::PlasterGray]));
        // Behind the houses the yard is three times as wide as its gateway.
        let middle = 0.5 * (gate.front[0] + gate.front[1]);
        let half = 0.5 * (gate.front[1] - gate.front[0]);
        let steps = [(0.0, half), (DEPTH_M, half), (DEPTH_M, 3.0 * half), (YARD_M + 4.0, 3.0 * half)];
        for pair in [[0, 1], [2, 3]] {
            let [(from, wide), (to, _)] = pair.map(|i| steps[i]);
            let n = ((to - from) / 2.0).ceil() as usize;
            for i in 0..n {
                let [a, c] = [i, i + 1].map(|i| from + (to - from) * i as f64 / n as f64);
                let corners = [(middle - wide, a), (middle + wide, a), (middle + wide, c), (middle - wide, c)];
                self.builder.quad(corners.map(|(s, back)| point(s, back, -0.01)), cobble);
            }
        }
        let wide = 3.0 * half;
        let end = YARD_M + 4.0;
        for [(s0, b0), (s1, b1)] in [
            [(middle - wide, end), (middle + wide, end)],
            [(middle - wide, DEPTH_M), (middle - wide, end)],
            [(middle + wide, DEPTH_M), (middle + wide, end)],
        ] {
            let corners = [point(s0, b0, -0.4), point(s1, b1, -0.4), point(s1, b1, 3.2), point(s0, b0, 3.2)];
            self.builder.quad(corners, wall);
        }
        let yard = |back: f64, off: f64| street.plan(middle + off, gate.side * (gate.t + back));
        let pose = self.stand_at(&yard(DEPTH_M + 5.0, 0.8 * half), h, 0.0);
        tree::build(&mut self.builder, &pose, random);
        let pose = self.stand_at(&yard(DEPTH_M + 3.0, -1.5 * half), h, street.heading(middle));
        if random.chance(0.5) {
            furniture::bicycle_rack(&mut self.builder, &pose, random);
        } else {
            clutter::container(&mut self.builder, &pose, random);
        }
        self.heap(&yard(DEPTH_M + 7.0, 0.0), h, random);
    }

    /// Builds a heap of rubble: class unlabeled, because no class covers it.
    pub fn heap(&mut self, p: &nalgebra::Vector2<f64>, h: f64, random: &mut Random) {
        let pose = self.stand_at(p, h, 0.0);
        let rubble = self.builder.surface(ClassId::Unlabeled, 0, Material::Fieldstone);
        for _ in 0..24 {
            let angle = random.range(0.0, TAU);
            let out = random.range(0.0, 0.9);
            let center = Vec3::new(out * angle.cos(), out * angle.sin(), 0.55 * (1.0 - out) * random.range(0.3, 1.0));
            let size = Vec3::new(random.range(0.12, 0.3), random.range(0.12, 0.3), random.range(0.1, 0.2));
            let turned = pose * Isometry3::new(center, Vec3::z() * angle);
            self.builder.cuboid(&turned, (-size).into(), size.into(), rubble);
        }
    }

    /// Builds houses across the far ends of side streets, beyond which nothing is built.
    pub fn closures(&mut self, street: usize, random: &mut Random) {
        for end in [0, 1] {
            let node = self.network.streets[street].nodes[end];
            if self.is_node_on_round(node) {
                continue;
            }
            let line = self.network.streets[street].clone();
            let half = line.profile.outer_t as f32 + 1.5;
            let from = self.network.arm(street, end).mouth_m;
            let (s, _) = line.at_node(end, from, 0.0);
            if !self.reach.is_near(&line.plan(s, 0.0), DETAIL_RADIUS_M + 15.0) {
                continue;
            }
            let material = *random.pick(&[Material::PlasterCream, Material::Limestone, Material::Brick]);
            let wall = Wall { length: 2.0 * half, floors: 4, material, balconies: false, seed: random.bits() };
            let base = line.point(s, 0.0, 0.05).z as f32;
            let plan = |u: f32, z: f32, out: f32| {
                let (s, t) = line.at_node(end, from + f64::from(out), f64::from(u - half));
                let mut p = line.vertex(s, t, 0.0);
                p.z = base + z;
                p
            };
            facade::build(&mut self.builder, &plan, &wall, random);
        }
    }
}
