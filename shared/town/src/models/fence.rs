//! Fences along a foot line: bars, mesh, planks. Bars and mesh let a part of the rays through.

use super::frame::beam;
use super::line::Line;
use crate::material::Material;
use crate::scene_builder::SceneBuilder;
use messages::ClassId::{Fence, Wall};
use random::Random;
use raytrace::{Shape, Vec3};

/// A railing of upright bars, 1.1 m high.
pub fn railing(b: &mut SceneBuilder, feet: &[Vec3]) {
    let metal = b.surface(Fence, 0, Material::DarkMetal);
    bars(b, feet, metal, &Bars { foot: 0.15, top: 1.1, gap: 0.12, radius: 0.009, rails: &[0.15, 1.1] });
    for foot in posts(feet, 2.5) {
        b.add(Shape::cylinder(foot - Vec3::z() * 0.1, foot + Vec3::z() * 1.12, 0.028), metal);
    }
}

/// A Parisian fence: bars of 1.7 m with spear heads on a stone plinth, between posts.
pub fn bar_fence(b: &mut SceneBuilder, feet: &[Vec3]) {
    let [iron, stone] = [b.surface(Fence, 0, Material::DarkMetal), b.surface(Wall, 0, Material::LimestoneDressed)];
    let line = Line::new(feet, 3.0);
    let plinth = [[0.16, -0.3], [0.16, 0.42], [-0.16, 0.42], [-0.16, -0.3]];
    line.extrude(b, &plinth, stone);
    line.close(b, &plinth, stone);
    let form = Bars { foot: 0.42, top: 2.0, gap: 0.13, radius: 0.011, rails: &[0.55, 1.75] };
    for tip in bars(b, feet, iron, &form) {
        b.add(Shape::cone(tip, tip + Vec3::z() * 0.13, [0.024, 0.002]), iron);
    }
    for foot in posts(feet, 3.0) {
        b.add(Shape::cylinder(foot + Vec3::z() * 0.4, foot + Vec3::z() * 2.1, 0.04), iron);
        b.add(Shape::Sphere { center: foot + Vec3::z() * 2.15, radius: 0.07 }, iron);
    }
}

/// A mesh of wire, 1.8 m high between steel posts; it stops a quarter of the rays.
pub fn mesh_fence(b: &mut SceneBuilder, feet: &[Vec3]) {
    let paint = b.surface(Fence, 0, Material::GreenMetal);
    let line = Line::new(feet, 2.5);
    for foot in 0..line.len() {
        let [low, high] = [-0.3, 1.85].map(|up| line.point(foot, [0.0, up]));
        b.add(Shape::cylinder(low, high, 0.025), paint);
        if foot > 0 {
            let corner = line.point(foot - 1, [0.0, 0.05]);
            let edge1 = line.point(foot, [0.0, 0.05]) - corner;
            b.add(Shape::Panel { corner, edge1, edge2: Vec3::z() * 1.75, fill: 0.25 }, paint);
            for up in [0.06, 1.8] {
                let [from, to] = [foot - 1, foot].map(|foot| line.point(foot, [0.0, up]));
                b.add(Shape::cylinder(from, to, 0.006), paint);
            }
        }
    }
}

/// Vertical planks of 1.5 m with gaps of a few cm, on posts and two rails.
pub fn wooden_fence(b: &mut SceneBuilder, feet: &[Vec3], random: &mut Random) {
    let wood = *random.pick(&[Material::Wood, Material::WoodGray, Material::WoodWhite]);
    let wood = b.surface(Fence, 0, wood);
    for foot in posts(feet, 2.4) {
        b.add(beam(&(foot - Vec3::z() * 0.3), &(foot + Vec3::z() * 1.45), [0.1, 0.1]), wood);
    }
    for pair in feet.windows(2) {
        let along = pair[1] - pair[0];
        let left = Vec3::z().cross(&along).try_normalize(1e-6).unwrap_or_else(Vec3::y);
        for up in [0.4, 1.15] {
            b.add(beam(&(pair[0] + Vec3::z() * up), &(pair[1] + Vec3::z() * up), [0.04, 0.09]), wood);
        }
        let n = (along.norm() / 0.14) as usize;
        for i in 0..n {
            let foot = pair[0].lerp(&pair[1], (i as f32 + 0.5) / n as f32) + left * 0.045;
            let ends = [foot + Vec3::z() * 0.08, foot + Vec3::z() * random.range(1.45, 1.53)];
            plank(b, ends, &along, wood);
        }
    }
}

/// Posts and three rails around a pasture, 1.2 m high.
pub fn pasture_fence(b: &mut SceneBuilder, feet: &[Vec3], random: &mut Random) {
    let wood = b.surface(Fence, 0, Material::WoodGray);
    let stakes = posts(feet, 3.0);
    for foot in &stakes {
        let lean = Vec3::new(random.range(-0.06, 0.06), random.range(-0.06, 0.06), 1.25);
        b.add(Shape::cylinder(foot - Vec3::z() * 0.3, foot + lean, 0.06), wood);
    }
    for pair in stakes.windows(2) {
        for up in [0.4, 0.75, 1.1] {
            let mut end = |foot: &Vec3| foot + Vec3::z() * (up + random.range(-0.04, 0.04));
            let from = end(&pair[0]);
            let to = end(&pair[1]);
            b.add(Shape::cylinder(from, to, 0.04), wood);
        }
    }
}

/// One plank 10 cm wide along the fence and 2 cm thick.
fn plank(b: &mut SceneBuilder, [low, high]: [Vec3; 2], along: &Vec3, surface: u32) {
    let yaw = along.y.atan2(along.x);
    let rotation = nalgebra::UnitQuaternion::from_axis_angle(&Vec3::z_axis(), yaw);
    let half = Vec3::new(0.05, 0.01, 0.5 * (high.z - low.z));
    b.add(Shape::Cuboid { center: (low + high) * 0.5, half, rotation }, surface);
}

/// Measures of a row of bars, m: heights above the foot line, spacing and radius of the bars, heights of the rails.
struct Bars {
    foot: f32,
    top: f32,
    gap: f32,
    radius: f32,
    rails: &'static [f32],
}

/// Draws bars and rails; returns the tops of the bars.
fn bars(b: &mut SceneBuilder, feet: &[Vec3], surface: u32, form: &Bars) -> Vec<Vec3> {
    let mut tips = Vec::new();
    for pair in feet.windows(2) {
        let length = (pair[1] - pair[0]).norm();
        if length < form.gap {
            continue;
        }
        for up in form.rails {
            let up = Vec3::z() * *up;
            b.add(Shape::cylinder(pair[0] + up, pair[1] + up, 2.0 * form.radius), surface);
        }
        let n = (length / form.gap) as usize;
        for i in 0..n {
            let foot = pair[0].lerp(&pair[1], (i as f32 + 0.5) / n as f32);
            let tip = foot + Vec3::z() * form.top;
            b.add(Shape::cylinder(foot + Vec3::z() * form.foot, tip, form.radius), surface);
            tips.push(tip);
        }
    }
    tips
}

/// Positions of posts: both ends of every section, and between them at most `apart_m`.
fn posts(feet: &[Vec3], apart_m: f32) -> Vec<Vec3> {
    let line = Line::new(feet, apart_m);
    (0..line.len()).map(|foot| line.point(foot, [0.0, 0.0])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use raytrace::{Bvh, Ray};

    /// Share of horizontal rays across a straight fence of 20 m that pass between two heights.
    fn passing(build: impl Fn(&mut SceneBuilder, &[Vec3]), heights: [f32; 2]) -> f32 {
        let mut b = SceneBuilder::default();
        build(&mut b, &[Vec3::new(-10.0, 0.0, 0.0), Vec3::new(10.0, 0.0, 0.0)]);
        let tree = Bvh::new(b.primitives);
        let mut random = Random::for_hashed_stream(2, 0);
        let n = 4000;
        let passed = (0..n)
            .filter(|i| {
                let origin = Vec3::new(random.range(-9.5, 9.5), -5.0, random.range(heights[0], heights[1]));
                tree.nearest(&Ray { origin, direction: Vec3::y(), seed: *i }, 20.0).is_none()
            })
            .count();
        passed as f32 / n as f32
    }

    #[test]
    fn rays_pass_bars_and_mesh_but_not_planks() {
        for (name, share, expected) in [
            ("railing", passing(railing, [0.2, 1.0]), 0.80..0.90),
            ("bar fence", passing(bar_fence, [0.6, 1.7]), 0.76..0.88),
            ("mesh", passing(mesh_fence, [0.1, 1.7]), 0.68..0.77),
            (
                "planks",
                passing(|b, feet| wooden_fence(b, feet, &mut Random::for_hashed_stream(1, 0)), [0.2, 1.4]),
                0.10..0.35,
            ),
            ("plinth", passing(bar_fence, [0.0, 0.4]), 0.0..1e-6),
        ] {
            assert!(expected.contains(&share), "{name}: {share}");
        }
    }
}
