//! Bridges over a street, and tunnels that follow it.

use super::barrier::parapet;
use super::frame::Frame;
use super::line::Line;
use crate::material::Material;
use crate::noise::rough;
use crate::scene_builder::SceneBuilder;
use messages::ClassId::{Bridge, Wall};
use nalgebra::Isometry3;
use random::Random;
use raytrace::Vec3;

/// A bridge across the street at the pose.
#[derive(Clone, Copy, Debug)]
pub struct Overpass {
    /// Distance between its abutments, across the street (the frame's y), m.
    pub span_m: f32,
    /// Width of its deck, along the street (the frame's x), m.
    pub width_m: f32,
    /// Clearance from the street to the underside of the deck, m.
    pub clearance_m: f32,
}

impl Overpass {
    /// Thickness of the deck, m.
    pub const DECK_M: f32 = 0.9;

    /// Builds a deck on girders with supporting abutments and parapets; a long span has two pillars. Class bridge.
    pub fn build(&self, b: &mut SceneBuilder, pose: &Isometry3<f32>, random: &mut Random) {
        let mut f = Frame::new(b, pose);
        let concrete = *random.pick(&[Material::Concrete, Material::ConcreteNew, Material::Limestone, Material::Brick]);
        let [body, deck, steel] = [concrete, Material::Concrete, Material::Steel].map(|m| f.surface(Bridge, m));
        let x = 0.5 * self.width_m;
        let y = 0.5 * self.span_m;
        let low = self.clearance_m;
        let top = low + Self::DECK_M;
        f.cuboid([-x, -y - 1.5, low + 0.5], [x, y + 1.5, top], deck);
        let girders = (self.width_m / 2.2).ceil().max(2.0) as usize;
        for i in 0..girders {
            let at = -x + 0.3 + (self.width_m - 0.6) * i as f32 / (girders - 1) as f32;
            f.cuboid([at - 0.2, -y - 1.0, low], [at + 0.2, y + 1.0, low + 0.5], deck);
        }
        for side in [-1.0_f32, 1.0] {
            let [near, far] = [side * y, side * (y + 1.6)];
            f.cuboid([-x - 0.4, near.min(far), -1.0], [x + 0.4, near.max(far), low + 0.5], body);
            // Protruding courses of stone.
            for course in 0..(low / 1.2) as usize {
                let z = 0.9 + 1.2 * course as f32;
                let out = near - side * 0.06;
                f.cuboid([-x - 0.45, out.min(near), z], [x + 0.45, out.max(near), z + 0.12], body);
            }
        }
        if self.span_m > 14.0 {
            for side in [-1.0_f32, 1.0] {
                for at in [-0.7 * x, 0.0, 0.7 * x] {
                    f.tube([at, side * 0.32 * self.span_m, -0.5], [at, side * 0.32 * self.span_m, low], 0.4, body);
                }
                let beam = side * 0.32 * self.span_m;
                f.cuboid([-0.9 * x, beam - 0.45, low - 0.5], [0.9 * x, beam + 0.45, low], body);
            }
        }
        for end in [-x, x] {
            let feet = [[end, -y - 1.5, top], [end, y + 1.5, top]].map(|at| f.at(at));
            let ends = [[end, -y - 1.5, top + 1.15], [end, y + 1.5, top + 1.15]];
            f.tube(ends[0], ends[1], 0.04, steel);
            parapet(f.builder(), &feet, Bridge, random);
        }
    }
}

/// A tunnel of 3 to 40 m width that follows a foot line in the middle of the road: side walls to 3 m and a vault above,
/// class bridge for the vault and wall for the sides; lamps along its crown and niches in the walls.
pub fn tunnel(b: &mut SceneBuilder, middle: &[Vec3], half_width_m: f32, random: &mut Random) {
    const STEPS: usize = 8;
    let [lining, side_wall, lamp] = [
        b.surface(Bridge, 0, Material::Concrete),
        b.surface(Wall, 0, Material::ConcreteNew),
        b.surface(Bridge, 0, Material::Lamp),
    ];
    let line = Line::new(middle, 1.5);
    let seed = random.bits();
    let lengths = line.lengths();
    let spring = 3.0;
    let rise = (0.55 * half_width_m).min(3.0);
    let vault: Vec<[f32; 2]> = (0..=STEPS)
        .map(|i| {
            let angle = std::f32::consts::PI * i as f32 / STEPS as f32;
            [half_width_m * angle.cos(), spring + rise * angle.sin()]
        })
        .collect();
    line.extrude_uneven(b, &vault, lining, &|foot, i| 0.04 * rough(seed, lengths[foot], i as f32, 3.0, 1.1));
    for side in [-1.0, 1.0] {
        let profile = [
            [side * half_width_m, -0.5],
            [side * half_width_m, 0.8],
            [side * (half_width_m + 0.05), 0.85],
            [side * (half_width_m + 0.05), 2.0],
            [side * half_width_m, spring],
        ];
        let uneven = |foot: usize, i: usize| 0.025 * rough(seed ^ 3, lengths[foot] + side * 700.0, i as f32, 2.3, 0.9);
        line.extrude_uneven(b, &profile, side_wall, &uneven);
        // Ribs every 6 m.
        for foot in (0..line.len()).step_by(4) {
            let [low, high] = [-0.3, spring].map(|up| line.point(foot, [side * (half_width_m - 0.06), up]));
            b.add(super::frame::beam(&low, &high, [0.3, 0.3]), side_wall);
        }
    }
    for foot in (2..line.len()).step_by(5) {
        let crown = line.point(foot, [0.0, spring + rise - 0.1]);
        b.add(raytrace::Shape::Sphere { center: crown, radius: 0.12 }, lamp);
    }
}
