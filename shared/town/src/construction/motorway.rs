//! Objects along motorways: guard rails, signs, verges, berms and noise walls.

use crate::construction::town_builder::TownBuilder;
use crate::models::{barrier, fence, pole, sign, tree};
use crate::streets::paving::Paving;
use nalgebra::{Isometry3, Vector3};
use random::Random;
use raytrace::Vec3;

/// Spacing of delineators, m.
const DELINEATOR_M: f64 = 50.0;
/// Distance of guard rails beyond the edge of the road, m: delineators and signs are behind them.
const RAIL_M: f64 = 0.8;
/// Distance of the median guard rails from the center line, m.
const MEDIAN_RAIL_T: f64 = 1.0;
/// Distance of a berm beyond the outer edge of the street, m. Its cross-section follows: offset and share of its height.
const BERM_M: f64 = 0.5;
const BERM: [[f64; 2]; 5] = [[0.0, 0.0], [3.0, 0.5], [6.0, 1.0], [7.5, 1.0], [13.0, 0.0]];
/// Height of berm feet relative to the terrain, m: below the meadows.
const BERM_FOOT_M: f64 = -0.25;
/// Length over which a berm rises at its ends, m.
const BERM_RISE_M: f64 = 24.0;
/// Spacing of the rows of a berm's surface, m.
const BERM_STEP_M: f64 = 3.0;

/// Scenery on one side of a street of the motorway.
#[derive(Clone, Copy, Debug)]
enum Scenery {
    Meadow,
    Forest,
    Berm,
    NoiseWall,
    Bushes,
}

/// Sceneries to draw from; repeated entries are more frequent.
const SCENERIES: [Scenery; 6] =
    [Scenery::Meadow, Scenery::Forest, Scenery::Forest, Scenery::Berm, Scenery::NoiseWall, Scenery::Bushes];

impl TownBuilder {
    /// Builds the objects along one street of the motorway's round.
    pub fn motorway_street(&mut self, street: usize, random: &mut Random) {
        self.median(street, random);
        for side in [-1.0, 1.0] {
            self.edge(street, side, random);
            self.scenery(street, side, *random.pick(&SCENERIES), random);
            self.verge(street, side, random);
        }
        if random.chance(0.4) {
            self.overpass(street, f64::from(random.range(0.3, 0.7)), random);
        }
    }

    /// Builds the median: two guard rails back to back or a concrete barrier, with bushes between some of the rails.
    fn median(&mut self, street: usize, random: &mut Random) {
        let length_m = self.network.streets[street].length_m;
        let kind = random.index(4);
        if kind == 0 {
            let feet = self.feet(street, [0.0, length_m], 0.0, 6.0);
            if feet.len() > 1 {
                barrier::concrete_barrier(&mut self.builder, &feet);
            }
            return;
        }
        for side in [-1.0, 1.0] {
            self.guard_rail(street, side * MEDIAN_RAIL_T, side > 0.0, [0.0, length_m]);
        }
        if kind == 1 {
            self.bushes(street, [5.0, length_m], [0.0, 0.0], [2.0, 7.0], random);
        }
    }

    /// Builds the edge along the paved shoulder: guard rail, delineators, signs.
    fn edge(&mut self, street: usize, side: f64, random: &mut Random) {
        let profile = self.network.streets[street].profile;
        let length_m = self.network.streets[street].length_m;
        if random.chance(0.75) {
            let [from, to] = [random.range(0.0, 0.3), random.range(0.7, 1.0)].map(|share| f64::from(share) * length_m);
            self.guard_rail(street, side * (profile.kerb_t + RAIL_M), side < 0.0, [from, to]);
        }
        let n_delineators = (length_m / DELINEATOR_M) as usize;
        for i in 0..n_delineators {
            let s = DELINEATOR_M * (i as f64 + 0.5);
            if self.is_built(street, s, 0.0) {
                let pose = self.by_kerb(street, s, side, RAIL_M + 0.35);
                pole::delineator(&mut self.builder, &pose);
            }
        }
        for half in [0.0, 0.5] {
            self.sign_over_or_beside(street, length_m * (half + f64::from(random.range(0.1, 0.4))), side, random);
        }
    }

    fn sign_over_or_beside(&mut self, street: usize, s: f64, side: f64, random: &mut Random) {
        let kind = random.index(3);
        if !self.is_built(street, s, 0.0) {
            return;
        }
        match kind {
            0 => {
                // Over one carriageway, starting at the median.
                let [inner, outer] = [MEDIAN_RAIL_T, self.network.streets[street].profile.kerb_t + RAIL_M + 1.0];
                let pose = self.stand(street, s, side * 0.5 * (inner + outer), self.facing_road(side));
                sign::gantry(&mut self.builder, &pose, (outer - inner) as f32, random);
            }
            1 => {
                let pose = self.by_kerb(street, s, side, RAIL_M + 2.2);
                sign::direction_sign(&mut self.builder, &pose, random);
            }
            _ => {
                let pose = self.by_kerb(street, s, side, RAIL_M + 0.8);
                sign::sign(&mut self.builder, &pose, random);
            }
        }
    }

    fn scenery(&mut self, street: usize, side: f64, kind: Scenery, random: &mut Random) {
        let outer_t = self.outer_t(street);
        let outer = outer_t as f32;
        let span = [4.0, self.network.streets[street].length_m - 4.0];
        match kind {
            Scenery::Meadow => self.trees(street, side, [outer + 15.0, outer + 60.0], 9.0, random),
            Scenery::Forest => {
                self.trees(street, side, [outer + 1.0, outer + 10.0], 2.0, random);
                self.trees(street, side, [outer + 8.0, outer + 35.0], 1.5, random);
                let feet = self.feet(street, span, side * (outer_t + 0.4), 5.0);
                if feet.len() > 1 && random.chance(0.5) {
                    fence::mesh_fence(&mut self.builder, &feet);
                }
            }
            Scenery::Berm => self.berm(street, side, random),
            Scenery::NoiseWall => {
                let feet = self.feet(street, span, side * (outer_t - 1.5), 4.0);
                if feet.len() > 1 {
                    barrier::noise_wall(&mut self.builder, &feet, random);
                }
                self.trees(street, side, [outer + 1.0, outer + 20.0], 5.0, random);
            }
            Scenery::Bushes => {
                let t = [0.5, 5.0].map(|beyond| side as f32 * (outer + beyond));
                self.bushes(street, span, t, [0.6, 2.0], random);
                self.trees(street, side, [outer + 4.0, outer + 40.0], 5.0, random);
            }
        }
    }

    /// Builds tufts and bushes on the grass along the road.
    fn verge(&mut self, street: usize, side: f64, random: &mut Random) {
        let profile = self.network.streets[street].profile;
        let mut s = 0.0;
        while s < self.network.streets[street].length_m {
            let beyond = random.range(1.6, (profile.outer_t - profile.kerb_t) as f32);
            let is_tuft = random.chance(0.85);
            if self.is_built(street, s, 0.0) {
                let pose = self.by_kerb(street, s, side, f64::from(beyond));
                let model = if is_tuft { tree::tuft } else { tree::bush };
                model(&mut self.builder, &pose, random);
            }
            s += f64::from(random.range(2.0, 9.0));
        }
    }

    /// Builds a ridge of earth of 2 to 4 m along a street, with bushes.
    fn berm(&mut self, street: usize, side: f64, random: &mut Random) {
        let height_m = f64::from(random.range(2.0, 4.0));
        let line = self.network.streets[street].clone();
        let foot_t = self.outer_t(street) + BERM_M;
        let grass = self.pavings.id(Paving::Grass);
        let rise = |s: f64| (s.min(line.length_m - s) / BERM_RISE_M).clamp(0.0, 1.0);
        let at = |s: f64, [offset, share]: [f64; 2]| -> Vector3<f64> {
            let t = side * (foot_t + offset);
            let uneven = 4.0 * self.network.terrain.uneven(&line.plan(s, t));
            line.point(s, t, BERM_FOOT_M + share * rise(s) * (height_m - BERM_FOOT_M + uneven))
        };
        let n = (line.length_m / BERM_STEP_M) as usize;
        let s_of = |i: usize| line.length_m * i as f64 / n as f64;
        for (s0, s1) in (0..n).map(|i| (s_of(i), s_of(i + 1))) {
            if !self.is_built(street, s0, side * foot_t) {
                continue;
            }
            for pair in BERM.windows(2) {
                let corners = [at(s0, pair[0]), at(s1, pair[0]), at(s1, pair[1]), at(s0, pair[1])];
                self.builder.quad(corners.map(|corner| -> Vec3 { corner.cast() }), grass);
            }
        }
        let mut s = BERM_RISE_M;
        while s < line.length_m - BERM_RISE_M {
            let section = BERM[1 + random.index(3)];
            if self.is_built(street, s, side * foot_t) {
                let foot = at(s, section);
                let pose = Isometry3::translation(foot.x, foot.y, foot.z).cast();
                match random.index(4) {
                    0 => tree::deciduous(&mut self.builder, &pose, random),
                    1 => tree::tuft(&mut self.builder, &pose, random),
                    _ => tree::bush(&mut self.builder, &pose, random),
                }
            }
            s += f64::from(random.range(2.5, 9.0));
        }
    }
}
