//! Walls of houses: uneven, with recessed windows, doors, shops, mouldings and balconies.
//!
//! A wall is a grid over `u` (along) and `z` (up) whose corners are displaced by noise of several wavelengths, so that no
//! wall is a plane. Plastered and stone walls of old streets deviate by centimetres.

use super::balcony;
use super::opening::{self, Opening, OpeningKind};
use super::style::{Balconies, Roof, Style};
use super::wall::{FOOT_M, FacadeSurfaces, WallFrame, block, course, cuts_of};
use crate::material::Material;
use crate::noise::rough;
use crate::scene_builder::{SceneBuilder, SurfaceId};
use messages::ClassId::Building;
use random::Random;

/// Measures of a wall with its own style.
#[derive(Clone, Copy, Debug)]
pub struct Wall {
    /// Length, m.
    pub length: f32,
    /// Storeys.
    pub floors: usize,
    /// Material of the wall.
    pub material: Material,
    /// Whether it has balconies.
    pub balconies: bool,
    /// Seed of its unevenness.
    pub seed: u64,
}

/// One front of a house.
#[derive(Clone, Copy, Debug)]
pub struct Front<'a> {
    /// Its style.
    pub style: &'a Style,
    /// Length, m.
    pub length: f32,
    /// Storeys.
    pub floors: usize,
    /// Position of its door, m along it: in the bay that contains this position. `None` without a door.
    pub door: Option<f32>,
    /// Start and end of a passage through the ground floor, m.
    pub gate: Option<[f32; 2]>,
    /// Seed of its unevenness.
    pub seed: u64,
}

/// Half of the unevenness of a [`Wall`], m: 6 cm in total.
pub const UNEVEN_M: f32 = 0.03;
/// Width of the wall between a passage and the next window, m.
const GATE_PIER_M: f32 = 0.35;
/// Largest cell size of the wall's grid, m: half of the shortest undulation.
const CELL_M: f32 = 0.9;

/// Builds a wall with windows; its ornament is random.
pub fn build(b: &mut SceneBuilder, plan: WallFrame<'_>, wall: &Wall, random: &mut Random) {
    let base = Style::faubourg(random).even_storeys();
    let balconies = if wall.balconies && random.chance(0.6) { Balconies::Alternate } else { Balconies::None };
    let style =
        Style { wall: wall.material, base: wall.material, balconies, uneven_m: UNEVEN_M, roof: Roof::Flat, ..base };
    let front = Front {
        style: &style,
        length: wall.length,
        floors: wall.floors,
        door: Some(random.range(0.0, wall.length)),
        gate: None,
        seed: wall.seed,
    };
    front.build(b, plan, random);
}

impl Front<'_> {
    /// Builds the wall, its openings and its protruding parts.
    pub fn build(&self, b: &mut SceneBuilder, plan: WallFrame<'_>, random: &mut Random) {
        let style = self.style;
        let looks = FacadeSurfaces {
            wall: b.surface(Building, 0, style.wall),
            base: b.surface(Building, 0, style.base),
            trim: b.surface(Building, 0, style.trim),
            frame: b.surface(Building, 0, style.frame),
            glass: b.surface(Building, 0, Material::Glass),
            door: b.surface(Building, 0, style.door),
            iron: b.surface(Building, 0, Material::DarkMetal),
        };
        let bays = self.bays();
        let bay_at = |u: f32| bays.windows(2).position(|bay| (bay[0]..bay[1]).contains(&u));
        let gate_bay = self.gate.and_then(|gate| bay_at(0.5 * (gate[0] + gate[1])));
        let door_bay = self.door.and_then(bay_at);
        let n = bays.len() - 1;
        let shop = opening::Shop::random(random);
        for floor in 0..self.floors {
            let z = style.floor_z(floor);
            let storey = style.floor_z(floor + 1) - z;
            for column in 0..n {
                let bay = [bays[column], bays[column + 1]];
                let kind = match (floor, Some(column)) {
                    (0, bay) if bay == gate_bay => OpeningKind::Gate,
                    (0, bay) if bay == door_bay => OpeningKind::Door,
                    (0, _) if style.shops => OpeningKind::Shop,
                    _ => OpeningKind::Window,
                };
                let hole = Opening::new(style, kind, bay, z, storey, self.gate);
                self.panel(b, plan, &looks, bay, [z, z + storey], &hole);
                hole.build(b, plan, style, &looks, &shop, &|u, z| self.uneven(u, z), random);
                if floor > 0 {
                    balcony::at_window(b, plan, style, &looks, &hole, floor + column);
                }
            }
            if style.balconies == Balconies::Continuous && (floor == 2 || floor + 2 == self.floors && floor > 2) {
                balcony::along(b, plan, style, &looks, [0.15, self.length - 0.15], z);
            }
            if style.courses {
                course(b, plan, [0.0, self.length], [z + storey - 0.16, z + storey], [-0.05, 0.1], looks.trim);
            }
        }
        self.edges(b, plan, &looks);
        self.foot(b, plan, looks.base);
    }

    /// Edges of the bays from 0 to the length; one bay contains the passage.
    fn bays(&self) -> Vec<f32> {
        let evenly = |[from, to]: [f32; 2]| {
            let n = ((to - from) / self.style.bay_m).round().max(1.0) as usize;
            (0..=n).map(move |i| from + (to - from) * i as f32 / n as f32)
        };
        match self.gate {
            Some([from, to]) => {
                let left = evenly([0.0, from - GATE_PIER_M]);
                let right = evenly([to + GATE_PIER_M, self.length]);
                left.chain(right).collect()
            }
            None => evenly([0.0, self.length]).collect(),
        }
    }

    /// Displacement of the wall at a position, m: undulations of 4 m, 1.3 m and 0.5 m.
    pub fn uneven(&self, u: f32, z: f32) -> f32 {
        let large = rough(self.seed, u, z, 4.1, 1.3);
        let small = rough(self.seed ^ 0x51, u, z, 0.9, 0.5);
        self.style.uneven_m * (0.8 * large + 0.2 * small)
    }

    /// The wall of one bay of one storey around its opening.
    fn panel(
        &self,
        b: &mut SceneBuilder,
        plan: WallFrame<'_>,
        looks: &FacadeSurfaces,
        bay: [f32; 2],
        z: [f32; 2],
        hole: &Opening,
    ) {
        let surface = if z[0] == 0.0 { looks.base } else { looks.wall };
        let us = cuts([bay[0], hole.u[0], hole.u[1], bay[1]]);
        let zs = cuts([z[0], hole.z[0], hole.z[1], z[1]]);
        let point = |u: f32, z: f32| plan(u, z, self.uneven(u, z));
        for u in us.windows(2) {
            for z in zs.windows(2) {
                let u_middle = 0.5 * (u[0] + u[1]);
                let z_middle = 0.5 * (z[0] + z[1]);
                if hole.holds(u_middle, z_middle) {
                    continue;
                }
                b.quad([point(u[0], z[0]), point(u[1], z[0]), point(u[1], z[1]), point(u[0], z[1])], surface);
            }
        }
    }

    /// Cornice, quoins and the rain pipe.
    fn edges(&self, b: &mut SceneBuilder, plan: WallFrame<'_>, looks: &FacadeSurfaces) {
        let style = self.style;
        let top = self.style.height(self.floors);
        if style.cornice_m > 0.0 {
            let out = style.cornice_m;
            course(b, plan, [0.0, self.length], [top - 0.5, top - 0.25], [-0.05, 0.4 * out], looks.trim);
            course(b, plan, [0.0, self.length], [top - 0.25, top + 0.02], [-0.05, out], looks.trim);
        }
        if style.quoins {
            let n = (top / 0.45) as usize;
            for i in 0..n {
                let z = 0.45 * i as f32;
                let wide = if i % 2 == 0 { 0.5 } else { 0.3 };
                for u in [[0.0, wide], [self.length - wide, self.length]] {
                    block(b, plan, u, [z + 0.02, z + 0.43], [-0.05, 0.06], looks.trim);
                }
            }
        }
        let u = self.length - 0.18;
        b.add(raytrace::Shape::cylinder(plan(u, 0.1, 0.12), plan(u, top - 0.3, 0.12), 0.05), looks.iron);
    }

    /// The wall with a plinth below its ground floor, where the street slopes down.
    fn foot(&self, b: &mut SceneBuilder, plan: WallFrame<'_>, surface: SurfaceId) {
        let out = 0.02 + self.style.uneven_m;
        let parts = self.gate.map_or(vec![[0.0, self.length]], |gate| vec![[0.0, gate[0]], [gate[1], self.length]]);
        for pair in
            parts.into_iter().flat_map(|part| cuts_of(part, 2.0).windows(2).map(<[f32]>::to_vec).collect::<Vec<_>>())
        {
            let strip = |from: [f32; 2], to: [f32; 2]| {
                let corner = |u: f32, [z, out]: [f32; 2]| plan(u, z, out);
                [corner(pair[0], from), corner(pair[1], from), corner(pair[1], to), corner(pair[0], to)]
            };
            b.quad(strip([-FOOT_M, out], [0.25, out]), surface);
            b.quad(strip([0.25, out], [0.25, -0.1]), surface);
        }
    }
}

/// Edges of cells: the given ones, and additional ones where they are far apart. Duplicates are removed.
fn cuts(edges: [f32; 4]) -> Vec<f32> {
    let mut cuts = vec![edges[0]];
    for pair in edges.windows(2) {
        if pair[1] - pair[0] > 1e-3 {
            cuts.extend(&cuts_of([pair[0], pair[1]], CELL_M)[1..]);
        }
    }
    cuts
}
