//! What stands where: fills the street from a seed.

use super::builder::Builder;
use super::facade::{self, FLOOR_M, Wall};
use super::ground::{self, CROSS_HALF, CROSS_REACH, FACADE_T, KERB_T};
use super::mover::{Mover, Route};
use super::street::Street;
use super::{Scene, car, furniture, person, tree};
use crate::material::Material;
use crate::motion::Progress;
use crate::random::Random;
use crate::trace::{Bvh, Vec3};
use messages::ClassId;
use nalgebra::Isometry3;

/// Lane of the recording vehicle: drives on the right. m left of the center line.
pub const LANE_T: f64 = -1.6;
/// Middle of the parked cars, m from the center line.
const PARKING_T: f64 = 4.15;

/// The street for a drive of `seconds` along `progress`.
pub fn build(seed: u64, seconds: f64, progress: &Progress) -> Scene {
    let mut random = Random::new(seed, 0x00c1_7100);
    let length = (progress.x(seconds) + 75.0).ceil().max(200.0);
    let street = Street::new(length, f64::from(random.range(0.0, 6.28)));
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

struct Town {
    builder: Builder,
    street: Street,
    crossings: Vec<f32>,
    seed: u64,
    n_instances: u16,
}

impl Town {
    fn instance(&mut self) -> u16 {
        // A street holds a few hundred; ids that ran out would repeat rather than become "none".
        self.n_instances = self.n_instances % (u16::MAX - 1) + 1;
        self.n_instances
    }
    fn ends(&self) -> [f32; 2] {
        self.street.ends.map(|x| x as f32)
    }
    fn near_crossing(&self, x: f32, distance: f32) -> bool {
        self.crossings.iter().any(|c| (x - c).abs() < distance)
    }
    /// Something that stands upright on the ground.
    fn stand(&self, x: f32, t: f32, yaw: f32) -> Isometry3<f32> {
        let h = ground::height(&self.crossings, self.seed, x, t);
        self.street.upright(f64::from(x), f64::from(t), f64::from(h), f64::from(yaw)).cast()
    }

    /// Houses from end to end, interrupted by cross streets and now and then by an alley.
    fn houses(&mut self, side: f32, random: &mut Random) {
        let [mut x, end] = self.ends();
        while x < end - 4.0 {
            if let Some(c) = self.crossings.iter().copied().find(|c| (x - c + CROSS_HALF).abs() < 0.01) {
                x = c + CROSS_HALF;
                continue;
            }
            let next_gap = self.crossings.iter().map(|c| c - CROSS_HALF).find(|g| *g > x).unwrap_or(end).min(end);
            let mut width = random.range(9.0, 19.0);
            if next_gap - x - width < 6.0 {
                width = next_gap - x;
            }
            self.house(x, width, side, random);
            x += width;
            if random.chance(0.3) && next_gap - x > 12.0 {
                let gap = random.range(2.5, 4.0);
                self.alley(x, gap, side, random);
                x += gap;
            }
        }
    }

    fn house(&mut self, x: f32, width: f32, side: f32, random: &mut Random) {
        let wall = Wall {
            length: width,
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
        let t = FACADE_T + random.range(0.0, 0.3);
        let street = self.street.clone();
        let base = street.center(f64::from(x + 0.5 * width)).z as f32 + 0.1;
        let plan = |u: f32, z: f32, out: f32| {
            let mut p = street.vertex(x + u, side * (t - out), 0.0);
            p.z = base + z;
            p
        };
        facade::build(&mut self.builder, &plan, &wall, random);
        // Party walls and a zinc roof with chimneys, for the skyline and for shadows.
        let top = wall.floors as f32 * FLOOR_M;
        let stone = self.builder.surface(ClassId::Building, 0, wall.material);
        let zinc = self.builder.surface(ClassId::Building, 0, Material::Zinc);
        let rise = random.range(0.8, 2.8);
        for u in [0.0, width] {
            // As far out as the uneven wall goes, so that no sky shows between two houses.
            let out = facade::UNEVEN_M;
            let corners = [plan(u, -0.7, out), plan(u, -0.7, -10.0), plan(u, top, -10.0), plan(u, top, out)];
            self.builder.quad(corners, stone);
            let gable = [plan(u, top, 0.0), plan(u, top, -10.0), plan(u, top + rise, -10.0), plan(u, top + rise, -2.2)];
            self.builder.quad(gable, stone);
        }
        let mut strip = |from: [f32; 2], to: [f32; 2]| {
            let n = (width / 3.0).ceil() as usize;
            for i in 0..n {
                let (a, c) = (width * i as f32 / n as f32, width * (i + 1) as f32 / n as f32);
                let corner = |u: f32, [up, back]: [f32; 2]| plan(u, top + up, -back);
                self.builder.quad([corner(a, from), corner(c, from), corner(c, to), corner(a, to)], zinc);
            }
        };
        strip([0.0, -0.05], [rise, 2.2]);
        strip([rise, 2.2], [rise, 10.0]);
        let brick = self.builder.surface(ClassId::Building, 0, Material::Brick);
        for _ in 0..1 + random.index(3) {
            let (u, tall) = (random.range(0.5, width - 1.5), rise + random.range(0.8, 1.6));
            let corner = plan(u, top, -3.0);
            let pose = Isometry3::new(corner, Vec3::z() * street.heading(f64::from(x + u)) as f32);
            self.builder.cuboid(&pose, [0.0, -0.3, 0.0], [1.1, 0.3, tall], brick);
        }
    }

    /// A gap between two houses, closed by a wall or a railing some metres back.
    fn alley(&mut self, x: f32, width: f32, side: f32, random: &mut Random) {
        let back = FACADE_T + random.range(0.4, 5.0);
        if random.chance(0.5) {
            let concrete = self.builder.surface(ClassId::Wall, 0, random.pick([Material::Concrete, Material::Brick]));
            let pose = self.stand(x, side * back, 0.0);
            self.builder.cuboid(&pose, [0.0, -0.12, -0.6], [width, 0.12, 2.2], concrete);
        } else {
            let feet = [x, x + 0.5 * width, x + width].map(|x| self.stand(x, side * back, 0.0).translation.vector);
            furniture::railing(&mut self.builder, &feet);
        }
    }

    /// Trees, lamps, signs, benches and bins, each on its own beat.
    fn sidewalk(&mut self, side: f32, random: &mut Random) {
        let [begin, end] = self.ends();
        let kerbside = side * (KERB_T + 0.55);
        // A frame's y points over the road on the right side; on the left it must be turned.
        let to_road = if side > 0.0 { std::f32::consts::PI } else { 0.0 };
        let mut x = begin + 4.0 + random.range(0.0, 4.0);
        let mut beat = random.index(6);
        while x < end - 2.0 {
            beat += 1;
            if !self.near_crossing(x, 9.5) {
                let b = &mut Builder::default();
                std::mem::swap(b, &mut self.builder);
                match beat % 6 {
                    0 | 3 => tree::build(b, &self.stand(x, kerbside + side * 0.3, 0.0), random),
                    1 => furniture::lamp_post(b, &self.stand(x, kerbside, to_road)),
                    2 => furniture::sign(b, &self.stand(x, kerbside, if side > 0.0 { to_road } else { 0.0 }), random),
                    4 => furniture::bench(
                        b,
                        &self.stand(x, side * (FACADE_T - 0.6), if side > 0.0 { 0.0 } else { std::f32::consts::PI }),
                    ),
                    _ => {
                        furniture::bin(b, &self.stand(x, side * (FACADE_T - 0.7), random.range(-0.2, 0.2)));
                        furniture::bollard(b, &self.stand(x + 1.0, kerbside, 0.0));
                    }
                }
                std::mem::swap(b, &mut self.builder);
            }
            x += random.range(4.0, 6.5);
        }
    }

    fn parked_cars(&mut self, side: f32, random: &mut Random) {
        let [begin, end] = self.ends();
        let yaw = if side > 0.0 { std::f64::consts::PI } else { 0.0 };
        let mut x = begin + 5.0;
        while x < end - 5.0 {
            if !self.near_crossing(x, 11.0) && random.chance(0.72) {
                let instance = self.instance();
                let model = car::random_model(&mut self.builder, instance, random);
                let t = f64::from(side) * (PARKING_T + f64::from(random.range(-0.12, 0.12)));
                let turned = yaw + f64::from(random.range(-0.03, 0.03));
                let pose = self.street.frame(f64::from(x), t, -0.018 * t.abs(), turned);
                self.builder.place(&model, &pose.cast());
            }
            x += random.range(5.7, 7.2);
        }
    }

    /// Houses across both ends of the street: beyond them is no town.
    fn closures(&mut self, random: &mut Random) {
        let street = self.street.clone();
        for (x, inward) in [(self.ends()[0], 1.0_f32), (self.ends()[1], -1.0)] {
            let plan = |u: f32, z: f32, out: f32| street.vertex(x + inward * out, u - FACADE_T - 1.0, z);
            self.wall_across(&plan, 2.0 * FACADE_T + 2.0, random);
        }
    }

    fn wall_across(&mut self, plan: facade::Plan<'_>, length: f32, random: &mut Random) {
        let material = random.pick([Material::PlasterCream, Material::Limestone, Material::Brick]);
        let wall = Wall { length, floors: 4, material, balconies: false, seed: random.bits() };
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
                    // 15 cm before the party wall of the corner house, which would show through else.
                    let plan = |u: f32, z: f32, out: f32| {
                        street.vertex(x0 + edge * (CROSS_HALF - 0.15 - out), side * (from + u), z)
                    };
                    self.wall_across(&plan, length, random);
                }
                let corner = self.stand(x0 + edge * (CROSS_HALF + 0.6), side * (KERB_T + 0.5), 0.0);
                if edge * side > 0.0 {
                    furniture::traffic_light(&mut self.builder, &corner);
                }
                let feet = [2.2_f32, 4.2, 6.2]
                    .map(|d| self.stand(x0 + edge * (CROSS_HALF + d), side * (KERB_T + 0.3), 0.0).translation.vector);
                furniture::railing(&mut self.builder, &feet);
            }
            let plan = |u: f32, z: f32, out: f32| street.vertex(x0 - CROSS_HALF + u, side * (CROSS_REACH - out), z);
            self.wall_across(&plan, 2.0 * CROSS_HALF, random);
            let foot = |t: f32| street.vertex(x0 + CROSS_HALF - 0.5, side * t, 0.0);
            tree::hedge(&mut self.builder, &foot(14.0), &foot(20.0), random);
        }
    }

    /// Oncoming cars and a van, a car ahead and one behind, people on both sidewalks.
    fn traffic(&mut self, progress: &Progress, seconds: f64, random: &mut Random) -> Vec<Mover> {
        let mut movers = Vec::new();
        let start = progress.x(0.0);
        for (i, ahead_m) in [15.0, -13.0].into_iter().enumerate() {
            let instance = self.instance();
            let model = car::random_model(&mut self.builder, instance, random);
            let route = Route::Convoy { progress: *progress, ahead_m, drift_m: 1.0 + i as f64, t: LANE_T };
            movers.extend(Mover::new(model, route));
        }
        let mut x = start + f64::from(random.range(25.0, 40.0));
        let mut n_oncoming = 0;
        // What can still meet the vehicle before the drive ends.
        while x < progress.x(seconds) + 9.0 * seconds + 30.0 {
            let instance = self.instance();
            let is_van = n_oncoming % 3 == 1;
            let model = if is_van {
                car::van_model(&mut self.builder, instance, random)
            } else {
                car::random_model(&mut self.builder, instance, random)
            };
            // All at one speed: nobody drives through the one in front.
            let route = Route::Steady { x, t: -LANE_T, h: -0.018 * 1.6, speed_mps: -8.5 };
            movers.extend(Mover::new(model, route));
            n_oncoming += 1;
            x += f64::from(random.range(28.0, 55.0));
        }
        let mut x = start - 10.0;
        while x < progress.x(seconds) + 40.0 {
            let instance = self.instance();
            let model = person::model(&mut self.builder, instance, random);
            let side = if random.chance(0.5) { 1.0 } else { -1.0 };
            let t = side * f64::from(random.range(6.6, 7.3));
            let way = if random.chance(0.5) { 1.0 } else { -1.0 };
            let stands = random.chance(0.2);
            let speed_mps = if stands { 0.0 } else { way * f64::from(random.range(0.9, 1.6)) };
            let h = 0.14 + 0.01 * (t.abs() - 5.2) - 0.018 * 5.2;
            movers.extend(Mover::new(model, Route::Steady { x, t, h, speed_mps }));
            x += f64::from(random.range(4.0, 11.0));
        }
        movers
    }
}
