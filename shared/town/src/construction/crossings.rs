//! Crossings of country roads: canal, level crossing, tunnel, bridge; and the footbridge of a town.

use crate::construction::ground;
use crate::construction::town_builder::TownBuilder;
use crate::material::Material;
use crate::models::{barrier, bridge, fence, pole, track, water};
use crate::streets::country::Stretch;
use crate::streets::paving::Paving;
use messages::ClassId;
use nalgebra::Vector2;
use random::Random;
use raytrace::Vec3;
use std::f64::consts::PI;

/// Half the width of a tunnel, m.
const TUNNEL_HALF_M: f64 = 5.2;
/// Height of the tunnel crown above the road, m; the hill over it starts a metre higher.
const TUNNEL_TOP_M: f64 = 6.1;
/// Longest tunnel, m.
const TUNNEL_M: f64 = 130.0;
/// Distance from the portals of a tunnel to the mouths of its street, m.
const PORTAL_M: f64 = 28.0;
/// Position of canals under their streets, as a share of the length.
const CANAL_AT: f64 = 0.52;
/// Width of the canal, m.
const CANAL_M: f64 = 9.0;
/// Distance from the road to the end of canals and railways, m.
const AWAY_M: f64 = 75.0;

/// A canal, which keeps meadows off its water.
#[derive(Clone, Copy, Debug)]
pub struct Canal {
    /// Position where it passes under the road.
    at: Vector2<f64>,
    /// Its direction, unit.
    along: Vector2<f64>,
}

impl Canal {
    /// Distance of a position from its center line, m.
    pub fn distance(&self, p: &Vector2<f64>) -> f64 {
        let to = p - self.at;
        if to.dot(&self.along).abs() < AWAY_M - 6.0 { to.perp(&self.along).abs() } else { f64::INFINITY }
    }
    /// Whether a meadow cell at this position would cover the water.
    pub fn covers(&self, p: &Vector2<f64>) -> bool {
        self.distance(p) < 0.5 * CANAL_M + 3.2
    }
}

impl TownBuilder {
    /// All canals.
    pub fn canals(&self) -> Vec<Canal> {
        let is_rural = self.network.blocks.is_empty();
        let crossed = (0..self.stretches.len()).filter(|k| is_rural && self.stretches[*k] == Stretch::Crossings);
        crossed.map(|street| self.canal_of(street, CANAL_AT)).collect()
    }
    /// The canal of a street, at `share` of the length from its start.
    fn canal_of(&self, street: usize, share: f64) -> Canal {
        let line = &self.network.streets[street];
        let (at, direction) = line.center(share * line.length_m);
        Canal { at, along: Vector2::new(-direction.y, direction.x) }
    }

    /// Builds a canal that the road crosses on a bridge with parapets.
    pub fn canal(&mut self, street: usize, random: &mut Random) {
        let line = self.network.streets[street].clone();
        let s = CANAL_AT * line.length_m;
        if !self.is_built(street, s, 0.0) {
            return;
        }
        let canal = self.canal_of(street, CANAL_AT);
        let level = line.point(s, 0.0, -0.2).z as f32;
        let place = |t: f64, off: f64| canal.at + canal.along * t + Vector2::new(canal.along.y, -canal.along.x) * off;
        let middle = [-AWAY_M, 0.0, AWAY_M].map(|t| Vec3::new(place(t, 0.0).x as f32, place(t, 0.0).y as f32, level));
        water::canal(&mut self.builder, &middle, CANAL_M as f32, random);
        // Banks from the coping stones down to below the meadows.
        let grass = self.pavings.id(Paving::Grass);
        let edge = 0.5 * CANAL_M + 0.4;
        let terrain = self.network.terrain;
        for off in [-1.0, 1.0] {
            for i in 0..30 {
                let [from, to] = [i, i + 1].map(|i| AWAY_M * (f64::from(i) / 15.0 - 1.0));
                let corner = |t: f64, out: f64, z: Option<f32>| {
                    let p = place(t, off * out);
                    Vec3::new(p.x as f32, p.y as f32, z.unwrap_or_else(|| (terrain.height(&p) - 0.35) as f32))
                };
                let near = Some(level + 0.02);
                let corners = [
                    corner(from, edge, near),
                    corner(to, edge, near),
                    corner(to, edge + 7.0, None),
                    corner(from, edge + 7.0, None),
                ];
                self.builder.quad(corners, grass);
            }
        }
        // The bridge: faces below the verge, and parapets.
        let stone = self.builder.surface(ClassId::Bridge, 0, Material::Limestone);
        let half = 0.5 * CANAL_M + 1.0;
        for side in [-1.0, 1.0] {
            let t = side * line.profile.outer_t;
            let at = |s: f64, h: f64| line.vertex(s, t, h);
            self.builder.quad([at(s - half, -2.0), at(s + half, -2.0), at(s + half, -0.3), at(s - half, -0.3)], stone);
            let feet: Vec<Vec3> = (0..=6)
                .map(|i| {
                    let s = s - half - 3.0 + (2.0 * half + 6.0) * f64::from(i) / 6.0;
                    let t = side * (line.profile.kerb_t + 1.3);
                    line.vertex(s, t, line.profile.height(t))
                })
                .collect();
            // The water is visible through the bars of one parapet and hidden by the other.
            if side > 0.0 {
                fence::railing(&mut self.builder, &feet);
            } else {
                barrier::parapet(&mut self.builder, &feet, ClassId::Bridge, random);
            }
        }
    }

    /// Builds a level crossing of a railway, with lights.
    pub fn level_crossing(&mut self, street: usize, share: f64, random: &mut Random) {
        let line = self.network.streets[street].clone();
        let s = share * line.length_m;
        if !self.is_built(street, s, 0.0) {
            return;
        }
        let edge = line.profile.kerb_t + 0.9;
        for side in [-1.0, 1.0] {
            let n = 18;
            let feet: Vec<Vec3> = (0..=n)
                .map(|i| {
                    let t = side * (edge + (AWAY_M - edge) * f64::from(i) / f64::from(n));
                    line.vertex(s, t, if t.abs() > 7.0 { -0.16 } else { line.profile.height(t) - 0.5 })
                })
                .collect();
            track::railway(&mut self.builder, &feet, random);
            // Lamps face approaching traffic, which drives along +s on the right.
            let yaw = if side < 0.0 { 0.0 } else { PI };
            let pose = self.stand(street, s + side * 4.5, side * (line.profile.kerb_t + 0.6), yaw);
            pole::traffic_light(&mut self.builder, &pose);
        }
        // On the road the rails lie between its stones.
        let n = 12;
        let feet: Vec<Vec3> = (0..=n)
            .map(|i| {
                let t = edge * (2.0 * f64::from(i) / f64::from(n) - 1.0);
                ground::vertex(self, &line.plan(s, t), line.profile.height(t) + 0.012)
            })
            .collect();
        track::tramway(&mut self.builder, &feet);
    }

    /// Builds a tunnel through a hill: at most 130 m, in the middle of the street.
    pub fn tunnel(&mut self, street: usize, random: &mut Random) {
        let line = self.network.streets[street].clone();
        let [from, to] = self.tunnel_ends(street);
        let feet = self.feet(street, [from, to], 0.0, 2.0);
        if feet.len() > 1 {
            bridge::tunnel(&mut self.builder, &feet, TUNNEL_HALF_M as f32, random);
        }
        let grass = self.pavings.id(Paving::Grass);
        let stone = self.builder.surface(ClassId::Wall, 0, Material::Limestone);
        let hill = |t: f64| {
            let over = ((30.0 - t.abs()) / 22.0).clamp(0.0, 1.0);
            (TUNNEL_TOP_M + 1.2) * over * over * (3.0 - 2.0 * over) - 0.4
        };
        let columns: Vec<f64> = (-15..=15).map(|i| 2.0 * f64::from(i)).collect();
        let n = ((to - from) / 4.0).ceil() as usize;
        for i in 0..n {
            let [a, c] = [i, i + 1].map(|i| from + (to - from) * i as f64 / n as f64);
            if !self.is_built(street, a, 0.0) {
                continue;
            }
            for pair in columns.windows(2) {
                let at = |s: f64, t: f64| line.vertex(s, t, hill(t));
                self.builder.quad([at(a, pair[0]), at(c, pair[0]), at(c, pair[1]), at(a, pair[1])], grass);
            }
        }
        for s in [from, to] {
            if !self.is_built(street, s, 0.0) {
                continue;
            }
            let mut edges = columns.clone();
            edges.extend([-TUNNEL_HALF_M, TUNNEL_HALF_M]);
            edges.sort_by(f64::total_cmp);
            for pair in edges.windows(2) {
                let is_open = pair[0].abs().max(pair[1].abs()) <= TUNNEL_HALF_M;
                let low = if is_open { TUNNEL_TOP_M - 0.4 } else { -0.8 };
                let corners =
                    [(pair[0], low), (pair[1], low), (pair[1], hill(pair[1]) + 0.4), (pair[0], hill(pair[0]) + 0.4)];
                self.builder.quad(corners.map(|(t, h)| line.vertex(s, t, h)), stone);
            }
        }
    }

    /// Builds a footbridge between the houses on both sides.
    pub fn footbridge(&mut self, street: usize, random: &mut Random) {
        let line = self.network.streets[street].clone();
        let s = 0.5 * line.length_m;
        if self.is_built(street, s, 0.0) {
            let over =
                bridge::Overpass { span_m: 2.0 * line.profile.outer_t as f32 - 0.4, width_m: 4.0, clearance_m: 5.2 };
            over.build(&mut self.builder, &line.upright(s, 0.0, 0.0, 0.0), random);
        }
    }

    /// Start and end of the tunnel of a street, as `s`.
    pub fn tunnel_ends(&self, street: usize) -> [f64; 2] {
        let [begin, end] = self.network.mouths(street);
        let half = (0.5 * (end - begin) - PORTAL_M).min(0.5 * TUNNEL_M);
        let middle = 0.5 * (begin + end);
        [middle - half, middle + half]
    }

    /// Builds a bridge over the road, with ramps on both sides.
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
        let grass = self.pavings.id(Paving::Grass);
        let road = self.pavings.id(Paving::Asphalt);
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
