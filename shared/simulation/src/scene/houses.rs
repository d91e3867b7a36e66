//! Rows of houses and the alleys between them.

use super::ground::{CROSS_HALF, FACADE_T};
use super::layout::Town;
use super::models::facade::{self, FLOOR_M, Wall};
use super::models::fence;
use crate::material::Material;
use crate::random::Random;
use crate::trace::Vec3;
use messages::ClassId;
use nalgebra::Isometry3;

impl Town {
    /// Houses from end to end, interrupted by cross streets and now and then by an alley.
    pub fn houses(&mut self, side: f32, random: &mut Random) {
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
        for _ in 0..=random.index(3) {
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
            fence::railing(&mut self.builder, &feet);
        }
    }
}
