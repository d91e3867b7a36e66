//! What stands where: fills the street from a seed.

use super::Scene;
use super::builder::Builder;
use super::ground::{self, CROSS_HALF, CROSS_REACH, FACADE_T, KERB_T};
use super::models::facade::{self, Wall};
use super::models::{fence, pole, tree};
use super::street::Street;
use crate::material::Material;
use crate::motion::Progress;
use crate::random::Random;
use crate::trace::Bvh;
use nalgebra::Isometry3;

/// Lane of the recording vehicle: drives on the right. m left of the center line.
pub const LANE_T: f64 = -1.6;

/// The street for a drive of `seconds` along `progress`.
pub fn build(seed: u64, seconds: f64, progress: Progress) -> Scene {
    let mut random = Random::new(seed, 0x00c1_7100);
    let length = (progress.x(seconds) + 75.0).ceil().max(200.0);
    let street = Street::new(length, f64::from(random.range(0.0, std::f32::consts::TAU)));
    let crossings = crossings(length as f32, &mut random);
    let mut town = Town { builder: Builder::default(), street, crossings, seed, n_instances: 0 };
    ground::build(&mut town.builder, &town.street, &town.crossings, seed);
    for side in [-1.0_f32, 1.0] {
        town.houses(side, &mut random);
        town.sidewalk(side, &mut random);
        town.parked_cars(side, &mut random);
    }
    town.closures(&mut random);
    for x in town.crossings.clone() {
        town.crossing(x, &mut random);
    }
    let movers = town.traffic(progress, seconds, &mut random);
    let Town { builder, street, .. } = town;
    Scene { street, statics: Bvh::new(builder.primitives), movers, surfaces: builder.surfaces }
}

/// One cross street about every 110 m, the first one early in the drive; on the ground's cell edges.
fn crossings(length: f32, random: &mut Random) -> Vec<f32> {
    let mut crossings = Vec::new();
    let mut x = 75.0 + random.range(0.0, 12.0);
    while x < length - 30.0 {
        crossings.push((2.0 * x).round() / 2.0);
        x += 100.0 + random.range(0.0, 25.0);
    }
    crossings
}

/// A town that is being filled. What fills it is in `houses`, `sidewalk`, `traffic` and below.
pub struct Town {
    pub builder: Builder,
    pub street: Street,
    /// x of the cross streets, m.
    pub crossings: Vec<f32>,
    seed: u64,
    n_instances: u16,
}

impl Town {
    /// The next instance id.
    pub fn instance(&mut self) -> u16 {
        // A street holds a few hundred; ids that ran out would repeat rather than become "none".
        self.n_instances = self.n_instances % (u16::MAX - 1) + 1;
        self.n_instances
    }
    /// Where the street begins and ends.
    pub fn ends(&self) -> [f32; 2] {
        self.street.ends.map(|x| x as f32)
    }
    /// Whether a cross street's middle is that near.
    pub fn near_crossing(&self, x: f32, distance: f32) -> bool {
        self.crossings.iter().any(|c| (x - c).abs() < distance)
    }
    /// The frame of something that stands upright on the ground.
    pub fn stand(&self, x: f32, t: f32, yaw: f32) -> Isometry3<f32> {
        let h = ground::height(&self.crossings, self.seed, x, t);
        self.street.upright(f64::from(x), f64::from(t), f64::from(h), f64::from(yaw)).cast()
    }

    /// Houses across both ends of the street: beyond them is no town.
    fn closures(&mut self, random: &mut Random) {
        let street = self.street.clone();
        for (x, inward) in [(self.ends()[0], 1.0_f32), (self.ends()[1], -1.0)] {
            let plan = |u: f32, z: f32, out: f32| street.vertex(x + inward * out, u - FACADE_T - 1.0, z);
            self.wall_across(&plan, 2.0 * FACADE_T + 2.0, 4, random);
        }
    }

    fn wall_across(&mut self, plan: facade::Plan<'_>, length: f32, floors: usize, random: &mut Random) {
        let material = random.pick([Material::PlasterCream, Material::Limestone, Material::Brick]);
        let wall = Wall { length, floors, material, balconies: false, seed: random.bits() };
        facade::build(&mut self.builder, plan, &wall, random);
    }

    /// What stands along a cross street and at its corners.
    fn crossing(&mut self, x0: f32, random: &mut Random) {
        let street = self.street.clone();
        for side in [-1.0_f32, 1.0] {
            for edge in [-1.0_f32, 1.0] {
                let n = 3;
                let length = (CROSS_REACH - FACADE_T) / n as f32;
                for i in 0..n {
                    let from = FACADE_T + i as f32 * length;
                    // 30 cm before the party wall of the corner house, which would show through the windows else.
                    let plan = |u: f32, z: f32, out: f32| {
                        street.vertex(x0 + edge * (CROSS_HALF - 0.3 - out), side * (from + u), z)
                    };
                    self.wall_across(&plan, length, 3, random);
                }
                let corner = self.stand(x0 + edge * (CROSS_HALF + 0.6), side * (KERB_T + 0.5), 0.0);
                if edge * side > 0.0 {
                    pole::traffic_light(&mut self.builder, &corner);
                }
                let feet = [2.2_f32, 4.2, 6.2]
                    .map(|d| self.stand(x0 + edge * (CROSS_HALF + d), side * (KERB_T + 0.3), 0.0).translation.vector);
                fence::railing(&mut self.builder, &feet);
            }
            let plan = |u: f32, z: f32, out: f32| street.vertex(x0 - CROSS_HALF + u, side * (CROSS_REACH - out), z);
            self.wall_across(&plan, 2.0 * CROSS_HALF, 3, random);
            let foot = |t: f32| street.vertex(x0 + CROSS_HALF - 0.5, side * t, 0.0);
            tree::hedge(&mut self.builder, &[foot(14.0), foot(20.0)], 1.0, random);
        }
    }
}
