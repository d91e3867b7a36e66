//! Rows of houses along streets between blocks, with gateways to courtyards between them.

use super::models::facade::{self, FLOOR_M, Wall};
use super::models::{clutter, fence, furniture, tree};
use super::open_blocks::BlockUse;
use super::street::Street;
use super::town::{BUILT_M, Town};
use crate::material::Material;
use crate::random::Random;
use crate::trace::Vec3;
use messages::ClassId;
use nalgebra::Isometry3;

/// How deep houses are, m.
const DEPTH_M: f64 = 10.0;
/// How deep courtyards behind gateways are, m.
const YARD_M: f64 = 16.0;

/// A house's place: its front from `front[0]` to `front[1]` along the street, its back likewise.
#[derive(Clone, Copy, Debug)]
struct Plot {
    street: usize,
    side: f64,
    front: [f64; 2],
    back: [f64; 2],
    /// From the center line to the facade, m.
    t: f64,
}

impl Plot {
    /// The point `share` of the way along the front, `back_m` behind it, `h` above the terrain.
    fn point(&self, street: &Street, share: f64, back_m: f64) -> (f64, f64) {
        let along = |ends: [f64; 2]| ends[0] + (ends[1] - ends[0]) * share;
        let (front, back) = (along(self.front), along(self.back));
        let _ = street;
        (front + (back - front) * (back_m / DEPTH_M).clamp(0.0, 1.5), self.side * (self.t + back_m))
    }
}

impl Town {
    /// Houses from corner to corner, where the block beside the street has houses.
    pub fn row_of_houses(&mut self, street: usize, side: f64, random: &mut Random) {
        if let Some(block) = self.block_beside(street, side) {
            if self.uses[block] != BlockUse::Houses {
                return;
            }
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
        let wall = Wall {
            length: (plot.front[1] - plot.front[0]) as f32,
            floors: 3 + random.index(4),
            material: random.pick([
                Material::PlasterCream,
                Material::PlasterGray,
                Material::PlasterRose,
                Material::Limestone,
                Material::Limestone,
                Material::Brick,
                Material::Concrete,
            ]),
            balconies: random.chance(0.6),
            seed: random.bits(),
        };
        let street = self.network.streets[plot.street].clone();
        let base = street.point(0.5 * (plot.front[0] + plot.front[1]), plot.side * plot.t, 0.1).z as f32;
        let width = f64::from(wall.length);
        let plan = |u: f32, z: f32, out: f32| {
            let (s, t) = plot.point(&street, f64::from(u) / width, f64::from(-out));
            let mut p = street.vertex(s, t, 0.0);
            p.z = base + z;
            p
        };
        facade::build(&mut self.builder, &plan, &wall, random);
        self.shell(&plan, &wall, random);
    }

    /// Party walls, back wall and a zinc roof with chimneys, for courtyards, the skyline and shadows.
    fn shell(&mut self, plan: facade::Plan<'_>, wall: &Wall, random: &mut Random) {
        let (width, depth) = (wall.length, DEPTH_M as f32);
        let top = wall.floors as f32 * FLOOR_M;
        let stone = self.builder.surface(ClassId::Building, 0, wall.material);
        let zinc = self.builder.surface(ClassId::Building, 0, Material::Zinc);
        let rise = random.range(0.8, 2.8);
        for u in [0.0, width] {
            // As far out as the uneven wall goes, so that no sky shows between two houses.
            let out = facade::UNEVEN_M;
            let corners = [plan(u, -0.7, out), plan(u, -0.7, -depth), plan(u, top, -depth), plan(u, top, out)];
            self.builder.quad(corners, stone);
            let gable =
                [plan(u, top, 0.0), plan(u, top, -depth), plan(u, top + rise, -depth), plan(u, top + rise, -2.2)];
            self.builder.quad(gable, stone);
        }
        let n = (width / 3.0).ceil() as usize;
        let mut strip = |from: [f32; 2], to: [f32; 2], surface: u32| {
            for i in 0..n {
                let (a, c) = (width * i as f32 / n as f32, width * (i + 1) as f32 / n as f32);
                let corner = |u: f32, [z, back]: [f32; 2]| plan(u, z, -back);
                self.builder.quad([corner(a, from), corner(c, from), corner(c, to), corner(a, to)], surface);
            }
        };
        strip([top, -0.05], [top + rise, 2.2], zinc);
        strip([top + rise, 2.2], [top + rise, depth], zinc);
        strip([-0.7, depth], [top + rise, depth], stone);
        let brick = self.builder.surface(ClassId::Building, 0, Material::Brick);
        for _ in 0..=random.index(3) {
            let (u, tall) = (random.range(0.5, width - 1.5), rise + random.range(0.8, 1.6));
            let (corner, along) = (plan(u, top, -3.0), plan(u + 0.5, top, -3.0));
            let yaw = (along - corner).y.atan2((along - corner).x);
            let pose = Isometry3::new(corner, Vec3::z() * yaw);
            self.builder.cuboid(&pose, [0.0, -0.3, 0.0], [1.1, 0.3, tall], brick);
        }
    }

    /// A gap between two houses: closed by a fence at the sidewalk, or open to a paved yard with a wall at its end.
    fn courtyard(&mut self, gate: &Plot, random: &mut Random) {
        let street = self.network.streets[gate.street].clone();
        let h = street.profile.side_height(street.profile.outer_t);
        let point = |s: f64, back: f64, up: f64| street.vertex(s, gate.side * (gate.t + back), h + up);
        if random.chance(0.35) {
            let feet = [gate.front[0], gate.front[1]].map(|s| point(s, 0.3, 0.0));
            fence::bar_fence(&mut self.builder, &feet);
        }
        let cobble = self.pavings.id(super::paving::Paving::Cobble);
        let wall = self.builder.surface(ClassId::Wall, 0, random.pick([Material::Brick, Material::PlasterGray]));
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
        let (wide, end) = (3.0 * half, YARD_M + 4.0);
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
    }

    /// Houses across the far ends of side streets: beyond them nothing is built.
    pub fn closures(&mut self, street: usize, random: &mut Random) {
        for end in [0, 1] {
            let node = self.network.streets[street].nodes[end];
            if self.is_node_on_round(node) {
                continue;
            }
            let line = self.network.streets[street].clone();
            let half = line.profile.outer_t as f32 + 1.5;
            let from = self.network.arm(street, end).mouth_m;
            let (s, _) = line.from_node(end, from, 0.0);
            if !self.reach.is_near(&line.plan(s, 0.0), BUILT_M + 15.0) {
                continue;
            }
            let material = random.pick([Material::PlasterCream, Material::Limestone, Material::Brick]);
            let wall = Wall { length: 2.0 * half, floors: 4, material, balconies: false, seed: random.bits() };
            let base = line.point(s, 0.0, 0.05).z as f32;
            let plan = |u: f32, z: f32, out: f32| {
                let (s, t) = line.from_node(end, from + f64::from(out), f64::from(u - half));
                let mut p = line.vertex(s, t, 0.0);
                p.z = base + z;
                p
            };
            facade::build(&mut self.builder, &plan, &wall, random);
        }
    }
}
