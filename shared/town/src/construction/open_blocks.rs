//! Blocks without houses: squares and parks.

use crate::construction::block_use::BlockUse;
use crate::construction::reach::DETAIL_RADIUS_M;
use crate::construction::town_builder::TownBuilder;
use crate::models::{clutter, fence, furniture, structure, tree};
use crate::streets::network::Leg;
use crate::streets::paving::Paving;
use crate::streets::street::resample;
use nalgebra::{Vector2, Vector3};
use random::Random;
use raytrace::Vec3;
use std::f32::consts::TAU;

/// Rings of cells from the edge of an open block to its middle.
const RINGS: usize = 14;
/// Length of cells along the edge, m.
const EDGE_M: f64 = 2.5;

/// An open block: its edge, counterclockwise, and its middle.
struct Place {
    edge: Vec<Vector2<f64>>,
    middle: Vector2<f64>,
    /// Height of its ground above the terrain, m.
    h: f64,
}

impl Place {
    /// A point between the center (0) and the edge (1), at the share `around` of the edge.
    fn at(&self, around: f64, outward: f64) -> Vector2<f64> {
        let u = around.rem_euclid(1.0) * self.edge.len() as f64;
        let i = u as usize % self.edge.len();
        let edge = self.edge[i].lerp(&self.edge[(i + 1) % self.edge.len()], u.fract());
        self.middle.lerp(&edge, outward)
    }
}

impl TownBuilder {
    /// Builds the squares and parks within the detail radius.
    pub fn open_blocks(&mut self, random: &mut Random) {
        for number in 0..self.uses.len() {
            let is_square = match self.uses[number] {
                BlockUse::Square => true,
                BlockUse::Park => false,
                BlockUse::Houses | BlockUse::Gardens => continue,
            };
            let place = self.place(self.network.blocks[number]);
            if !place.edge.iter().any(|p| self.reach.is_near(p, 0.8 * DETAIL_RADIUS_M)) {
                continue;
            }
            let cover = if is_square { Paving::Cobble } else { Paving::Grass };
            self.cover(&place, cover);
            if is_square {
                self.square(&place, random);
            } else {
                self.park(&place, random);
            }
        }
    }

    fn place(&self, legs: [Leg; 4]) -> Place {
        let mut edge = Vec::new();
        let mut h = 0.0;
        for leg in legs {
            let street = &self.network.streets[leg.street];
            let side = if leg.is_forward { 1.0 } else { -1.0 };
            let [begin, end] = self.network.facade_ends(leg.street, side);
            let (from, to) = if leg.is_forward { (begin, end) } else { (end, begin) };
            let t = side * (street.profile.outer_t + 0.02);
            let n = ((to - from).abs() / EDGE_M).ceil() as usize;
            edge.extend((0..n).map(|i| street.plan(from + (to - from) * i as f64 / n as f64, t)));
            h = street.profile.side_height(t) - 0.03;
        }
        edge.push(edge[0]);
        let n = edge.len() - 1;
        let mut edge = resample(&edge, n);
        edge.pop();
        let middle = edge.iter().sum::<Vector2<f64>>() / edge.len() as f64;
        Place { edge, middle, h }
    }

    fn cover(&mut self, place: &Place, paving: Paving) {
        let id = self.pavings.id(paving);
        let n = place.edge.len();
        for i in 0..n {
            for ring in 0..RINGS {
                let corner = |i: usize, ring: usize| -> Vec3 {
                    let p = place.middle.lerp(&place.edge[i % n], ring as f64 / RINGS as f64);
                    let terrain = &self.network.terrain;
                    Vector3::new(p.x, p.y, terrain.height(&p) + terrain.uneven(&p) + place.h).cast()
                };
                let corners = [corner(i, ring), corner(i, ring + 1), corner(i + 1, ring + 1), corner(i + 1, ring)];
                self.builder.quad(corners, id);
            }
        }
    }

    fn square(&mut self, place: &Place, random: &mut Random) {
        let h = place.h;
        let pose = self.stand_at(&place.middle, h, 0.0);
        if random.chance(0.7) {
            furniture::fountain(&mut self.builder, &pose, random);
        } else {
            furniture::statue(&mut self.builder, &pose, random);
        }
        let n_trees = 14 + random.index(8);
        for i in 0..n_trees {
            let p = place.at(i as f64 / n_trees as f64, 0.78);
            let pose = self.stand_at(&p, h, 0.0);
            tree::plane_tree(&mut self.builder, &pose, random);
        }
        for _ in 0..26 {
            let p = place.at(f64::from(random.range(0.0, 1.0)), f64::from(random.range(0.3, 0.93)));
            let pose = self.stand_at(&p, h, f64::from(random.range(0.0, TAU)));
            let b = &mut self.builder;
            match random.index(13) {
                0 | 1 => furniture::bench(b, &pose, random),
                2 => furniture::kiosk(b, &pose, random),
                3 => furniture::advertising_column(b, &pose, random),
                4..=6 => structure::market_stall(b, &pose, random),
                7 => structure::tent(b, &pose, random),
                8 | 9 => clutter::cafe_table(b, &pose, random),
                10 => clutter::bin(b, &pose, random),
                11 => tree::flower_bed(b, &pose, random),
                _ => self.group(&p, h, random),
            }
        }
    }

    fn park(&mut self, place: &Place, random: &mut Random) {
        // Sections of the fence with gates between them.
        let n_gates = 4;
        for gate in 0..n_gates {
            let feet: Vec<Vec3> = (0..=24)
                .map(|i| {
                    let around = (f64::from(gate) + 0.04 + 0.92 * f64::from(i) / 24.0) / f64::from(n_gates);
                    self.stand_at(&place.at(around, 0.985), place.h, 0.0).translation.vector
                })
                .collect();
            fence::bar_fence(&mut self.builder, &feet);
        }
        let pose = self.stand_at(&place.middle, place.h, 0.0);
        crate::models::water::pond(&mut self.builder, &pose, random.range(5.0, 9.0), random);
        for _ in 0..46 {
            let p = place.at(f64::from(random.range(0.0, 1.0)), f64::from(random.range(0.45, 0.95)));
            let pose = self.stand_at(&p, place.h, f64::from(random.range(0.0, TAU)));
            let b = &mut self.builder;
            match random.index(10) {
                0..=3 => tree::build(b, &pose, random),
                4 => tree::conifer(b, &pose, random),
                5 | 6 => tree::bush(b, &pose, random),
                7 => furniture::bench(b, &pose, random),
                8 => tree::flower_bed(b, &pose, random),
                _ => self.group(&p, place.h, random),
            }
        }
    }
}
