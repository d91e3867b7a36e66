//! Solid barriers along a foot line: free-standing walls, guard rails, parapets.

use super::frame::beam;
use super::line::Line;
use crate::material::Material;
use crate::noise::rough;
use crate::scene_builder::SceneBuilder;
use messages::ClassId::{self, GuardRail, Wall};
use random::Random;
use raytrace::{Shape, Vec3};

/// A wall of fieldstone, brick, plaster or concrete with a coping, 1.6 to 2.4 m high.
pub fn wall(b: &mut SceneBuilder, feet: &[Vec3], random: &mut Random) {
    let (material, uneven_m) = *random.pick(&[
        (Material::Fieldstone, 0.05),
        (Material::Fieldstone, 0.05),
        (Material::Brick, 0.02),
        (Material::PlasterGray, 0.025),
        (Material::PlasterCream, 0.025),
        (Material::Concrete, 0.01),
    ]);
    wall_of(b, feet, random.range(1.6, 2.4), Wall, material, uneven_m, random);
}

/// A low parapet of stone, 1 m high, along a quay or on a bridge, of the given class.
pub fn parapet(b: &mut SceneBuilder, feet: &[Vec3], class: ClassId, random: &mut Random) {
    wall_of(b, feet, 1.0, class, Material::LimestoneDressed, 0.015, random);
}

/// A wall 0.36 m thick whose faces are uneven by up to `uneven_m`.
fn wall_of(
    b: &mut SceneBuilder,
    feet: &[Vec3],
    height_m: f32,
    class: ClassId,
    material: Material,
    uneven_m: f32,
    random: &mut Random,
) {
    let [body, coping] = [b.surface(class, 0, material), b.surface(class, 0, Material::ConcreteNew)];
    let line = Line::new(feet, 0.6);
    if line.len() < 2 {
        return;
    }
    let seed = random.bits();
    let lengths = line.lengths();
    for side in [-1.0_f32, 1.0] {
        let rows = (height_m / 0.5).ceil() as usize;
        let profile: Vec<[f32; 2]> =
            (0..=rows + 1).map(|row| [side * 0.18, (height_m * (row as f32 - 1.0) / rows as f32).max(-0.5)]).collect();
        let uneven = |foot: usize, corner: usize| {
            uneven_m * rough(seed ^ side.to_bits() as u64, lengths[foot], profile[corner][1], 1.9, 0.5)
        };
        line.extrude_uneven(b, &profile, body, &uneven);
    }
    let cap = [
        [0.25, height_m - 0.03],
        [0.25, height_m + 0.05],
        [0.0, height_m + 0.12],
        [-0.25, height_m + 0.05],
        [-0.25, height_m - 0.03],
        [0.25, height_m - 0.03],
    ];
    line.extrude(b, &cap, coping);
    line.close(b, &cap, coping);
    line.close(b, &[[0.18, -0.5], [0.18, height_m], [-0.18, height_m], [-0.18, -0.5]], body);
}

/// A steel guard rail: a W-shaped beam at 0.45 to 0.76 m, its road side on the left of the foot line, posts every 2 m.
pub fn guard_rail(b: &mut SceneBuilder, feet: &[Vec3]) {
    let steel = b.surface(GuardRail, 0, Material::Steel);
    let reflector = b.surface(GuardRail, 0, Material::SignWhite);
    let line = Line::new(feet, 2.0);
    // EN 1317's type A beam: 310 mm high, 83 mm deep.
    let profile = [
        [0.06, 0.45],
        [0.085, 0.47],
        [0.085, 0.51],
        [0.01, 0.57],
        [0.01, 0.64],
        [0.085, 0.70],
        [0.085, 0.74],
        [0.06, 0.76],
    ];
    line.extrude(b, &profile, steel);
    for foot in 0..line.len() {
        let [low, high] = [-0.4, 0.72].map(|up| line.point(foot, [-0.08, up]));
        b.add(beam(&low, &high, [0.1, 0.06]), steel);
        let [from, to] = [-0.05, 0.02].map(|left| line.point(foot, [left, 0.605]));
        b.add(beam(&from, &to, [0.06, 0.08]), steel);
        if foot % 6 == 3 {
            let [from, to] = [0.02, 0.05].map(|left| line.point(foot, [left, 0.605]));
            b.add(beam(&from, &to, [0.08, 0.05]), reflector);
        }
    }
}

/// A noise barrier of concrete or wood, 2.5 to 4.5 m high, between steel posts every 4 m.
pub fn noise_wall(b: &mut SceneBuilder, feet: &[Vec3], random: &mut Random) {
    let (material, uneven_m) =
        *random.pick(&[(Material::Concrete, 0.03), (Material::Wood, 0.03), (Material::WoodGray, 0.03)]);
    let height_m = random.range(2.5, 4.5);
    wall_of(b, feet, height_m, Wall, material, uneven_m, random);
    let steel = b.surface(Wall, 0, Material::Steel);
    let line = Line::new(feet, 4.0);
    for foot in 0..line.len() {
        let [low, high] = [-0.4, height_m + 0.15].map(|up| line.point(foot, [0.0, up]));
        b.add(beam(&low, &high, [0.46, 0.16]), steel);
    }
}

/// Concrete blocks of "New Jersey" shape, 0.8 m high, class guard-rail.
pub fn concrete_barrier(b: &mut SceneBuilder, feet: &[Vec3]) {
    let concrete = b.surface(GuardRail, 0, Material::ConcreteNew);
    let line = Line::new(feet, 6.0);
    let half = [[0.3, -0.1], [0.3, 0.08], [0.17, 0.33], [0.1, 0.8]];
    let profile: Vec<[f32; 2]> = half.into_iter().chain(half.iter().rev().map(|[left, up]| [-left, *up])).collect();
    line.extrude(b, &profile, concrete);
    line.close(b, &profile, concrete);
}

/// Chains between iron posts, 0.6 m high, around a lawn or a monument. Class fence.
pub fn chain(b: &mut SceneBuilder, feet: &[Vec3]) {
    let iron = b.surface(ClassId::Fence, 0, Material::DarkMetal);
    let line = Line::new(feet, 1.8);
    for foot in 0..line.len() {
        let [low, high] = [-0.2, 0.62].map(|up| line.point(foot, [0.0, up]));
        b.add(Shape::cylinder(low, high, 0.035), iron);
        b.add(Shape::Sphere { center: high, radius: 0.05 }, iron);
        if foot > 0 {
            let at = |share: f32| {
                let sag = 0.55 - 0.6 * share * (1.0 - share);
                line.point(foot - 1, [0.0, sag]).lerp(&line.point(foot, [0.0, sag]), share)
            };
            for piece in 0..4 {
                b.add(Shape::cylinder(at(0.25 * piece as f32), at(0.25 * (piece + 1) as f32), 0.012), iron);
            }
        }
    }
}
