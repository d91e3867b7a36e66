//! Rails along a foot line on the ground: on sleepers in ballast, or sunk into a street.

use super::frame::beam;
use super::line::Line;
use crate::material::Material;
use crate::noise::rough;
use crate::scene_builder::SceneBuilder;
use messages::ClassId::RailTrack;
use random::Random;
use raytrace::Vec3;

/// Half the distance between the rail centers, m: standard gauge 1.435 m and a rail head of 7 cm.
const HALF_GAUGE_M: f32 = 0.7525;

/// A track in a bed of ballast 3.6 m wide and 0.35 m high; all of it is class rail-track.
pub fn railway(b: &mut SceneBuilder, feet: &[Vec3], random: &mut Random) {
    let [ballast, sleeper, rail, web] = [Material::Ballast, Material::Concrete, Material::RailHead, Material::Rust]
        .map(|material| b.surface(RailTrack, 0, material));
    let bed = Line::new(feet, 0.6);
    let seed = random.bits();
    let lengths = bed.lengths();
    let profile =
        [[1.8, -0.2], [1.45, 0.3], [0.9, 0.36], [0.3, 0.35], [-0.3, 0.35], [-0.9, 0.36], [-1.45, 0.3], [-1.8, -0.2]];
    let uneven = |foot: usize, corner: usize| 0.04 * rough(seed, lengths[foot], profile[corner][0], 0.9, 0.35);
    bed.extrude_uneven(b, &profile, ballast, &uneven);
    for foot in 0..bed.len() {
        let [from, to] = [-1.25, 1.25].map(|left| bed.point(foot, [left, 0.36]));
        b.add(beam(&from, &to, [0.26, 0.14]), sleeper);
    }
    let rails = Line::new(feet, 6.0);
    for side in [-1.0, 1.0] {
        for foot in 1..rails.len() {
            let ends = |up: f32| [foot - 1, foot].map(|foot| rails.point(foot, [side * HALF_GAUGE_M, up]));
            let mut piece = |up: f32, size: [f32; 2], surface: u32| {
                let [from, to] = ends(up);
                b.add(beam(&from, &to, size), surface);
            };
            piece(0.44, [0.14, 0.02], web);
            piece(0.51, [0.02, 0.12], web);
            piece(0.585, [0.07, 0.04], rail);
        }
    }
}

/// Tram rails in the street, raised by 3 mm so that rays hit them: heads and grooves between strips of cobbles.
pub fn tramway(b: &mut SceneBuilder, feet: &[Vec3]) {
    let [rail, groove, stones] =
        [Material::RailHead, Material::Rust, Material::Cobble].map(|material| b.surface(RailTrack, 0, material));
    let line = Line::new(feet, 2.0);
    for side in [-1.0_f32, 1.0] {
        let at = side * HALF_GAUGE_M;
        let strip = |left: f32, width: f32, up: f32| [[left - 0.5 * width, up], [left + 0.5 * width, up]];
        line.extrude(b, &strip(at, 0.07, 0.012), rail);
        line.extrude(b, &strip(at - side * 0.055, 0.04, 0.006), groove);
        line.extrude(b, &strip(at + side * 0.16, 0.25, 0.008), stones);
        line.extrude(b, &strip(at - side * 0.2, 0.25, 0.008), stones);
    }
}

/// A buffer stop at the end of a track: its front towards the frame's -x.
pub fn buffer_stop(b: &mut SceneBuilder, pose: &nalgebra::Isometry3<f32>, _: &mut Random) {
    let mut f = super::frame::Frame::new(b, pose);
    let [red, steel] = [f.surface(RailTrack, Material::PaintRed), f.surface(RailTrack, Material::Rust)];
    for y in [-HALF_GAUGE_M, HALF_GAUGE_M] {
        f.beam([0.0, y, 0.0], [0.0, y, 1.3], [0.12, 0.12], steel);
        f.beam([1.2, y, 0.3], [0.0, y, 1.1], [0.1, 0.1], steel);
        f.tube([-0.25, y, 1.1], [0.0, y, 1.1], 0.15, steel);
    }
    f.beam([0.0, -1.2, 1.1], [0.0, 1.2, 1.1], [0.18, 0.3], red);
}
