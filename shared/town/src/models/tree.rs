//! Trees and lower plants: trunks, branches, and clusters of leaves that let a part of the rays through.

use super::frame::{At, Frame};
use crate::material::Material;
use crate::scene_builder::{SceneBuilder, SurfaceId};
use messages::ClassId::Vegetation;
use nalgebra::Isometry3;
use random::Random;
use raytrace::Vec3;
use std::f32::consts::TAU;

/// Depth of trunks in the ground, m.
const ROOT_M: f32 = 0.4;
/// The golden angle, rad: successive rotations by it are evenly spread.
const GOLDEN: f32 = 2.399_963;

/// A tree of any kind that stands along streets.
pub fn build(b: &mut SceneBuilder, pose: &Isometry3<f32>, random: &mut Random) {
    let kinds: [fn(&mut SceneBuilder, &Isometry3<f32>, &mut Random); 7] =
        [deciduous, deciduous, deciduous, plane_tree, plane_tree, poplar, sapling];
    random.pick(&kinds)(b, pose, random);
}

/// A lime or maple of 7 to 11 m.
pub fn deciduous(b: &mut SceneBuilder, pose: &Isometry3<f32>, random: &mut Random) {
    let mut f = Frame::new(b, pose);
    let bark = f.surface(Vegetation, Material::Bark);
    let leaf = *random.pick(&[Material::Leaves, Material::LeavesDark, Material::LeavesYoung]);
    let leaves = f.surface(Vegetation, leaf);
    let height = random.range(7.0, 11.0);
    let crown =
        Crown { trunk: random.range(2.4, 3.2), height, spread: 0.31 * height, girth: 0.018 * height, clusters: 44 };
    crown.grow(&mut f, [bark, leaves], random);
}

/// A plane tree of 10 to 15 m: a pale, patched trunk under a wide crown.
pub fn plane_tree(b: &mut SceneBuilder, pose: &Isometry3<f32>, random: &mut Random) {
    let mut f = Frame::new(b, pose);
    let bark = f.surface(Vegetation, Material::BarkPlane);
    let leaves = f.surface(Vegetation, Material::Leaves);
    let height = random.range(10.0, 15.0);
    let crown = Crown { trunk: random.range(3.5, 4.5), height, spread: 0.36 * height, girth: 0.3, clusters: 60 };
    crown.grow(&mut f, [bark, leaves], random);
}

/// A young tree of 3.5 to 5 m, tied to two stakes.
pub fn sapling(b: &mut SceneBuilder, pose: &Isometry3<f32>, random: &mut Random) {
    let mut f = Frame::new(b, pose);
    let bark = f.surface(Vegetation, Material::Bark);
    let leaves = f.surface(Vegetation, Material::LeavesYoung);
    let wood = f.surface(messages::ClassId::Pole, Material::Wood);
    let crown =
        Crown { trunk: 1.9, height: random.range(3.5, 5.0), spread: random.range(0.8, 1.1), girth: 0.05, clusters: 14 };
    crown.grow(&mut f, [bark, leaves], random);
    for x in [-0.35, 0.35] {
        f.tube([x, 0.0, -ROOT_M], [x, 0.0, 1.6], 0.035, wood);
    }
    f.beam([-0.35, 0.0, 1.5], [0.35, 0.0, 1.5], [0.03, 0.06], wood);
}

/// Measures of a round crown, m.
struct Crown {
    /// Height of the first fork.
    trunk: f32,
    /// Height of the whole tree.
    height: f32,
    /// Radius of the crown.
    spread: f32,
    /// Radius of the trunk at its foot.
    girth: f32,
    clusters: usize,
}

impl Crown {
    fn grow(&self, f: &mut Frame<'_>, [bark, leaves]: [SurfaceId; 2], random: &mut Random) {
        let lean = [random.range(-0.15, 0.15), random.range(-0.15, 0.15)];
        let fork = [lean[0], lean[1], self.trunk];
        f.cone([0.0, 0.0, -ROOT_M], [0.0, 0.0, 0.35], [1.7 * self.girth, self.girth], bark);
        f.cone([0.0, 0.0, 0.35], fork, [self.girth, 0.75 * self.girth], bark);
        let half_height = 0.5 * (self.height - self.trunk) + 0.3;
        let middle = self.height - half_height;
        // Boughs end halfway out in the crown, and each carries twigs.
        let n_boughs = 5 + random.index(3);
        let mut tips = vec![[lean[0], lean[1], middle + 0.4 * half_height]];
        f.cone(fork, tips[0], [0.6 * self.girth, 0.15 * self.girth], bark);
        for i in 0..n_boughs {
            let angle = i as f32 * GOLDEN + random.range(-0.3, 0.3);
            let out = self.spread * random.range(0.45, 0.65);
            let tip = [
                lean[0] + out * angle.cos(),
                lean[1] + out * angle.sin(),
                middle + half_height * random.range(-0.45, 0.35),
            ];
            f.cone(fork, tip, [0.45 * self.girth, 0.12 * self.girth], bark);
            tips.push(tip);
        }
        for i in 0..self.clusters {
            let share = (i as f32 + 0.5) / self.clusters as f32;
            let up = 2.0 * share - 1.0;
            // More clusters on the outside than inside: leaves grow towards the light.
            let ring = (1.0 - up * up).sqrt() * random.range(0.0, 1.0_f32).powf(0.35);
            let angle = i as f32 * GOLDEN + random.range(-0.4, 0.4);
            let radius = self.spread * random.range(0.14, 0.27);
            let reach = (self.spread - radius) * ring;
            let center = [
                lean[0] + reach * angle.cos(),
                lean[1] + reach * angle.sin(),
                middle + up * (half_height - radius) + random.range(-0.15, 0.15),
            ];
            // Leaves of larger trees are larger and farther apart.
            f.leaves(center, radius, self.spread * random.range(0.16, 0.30), leaves);
            if i % 2 == 0 {
                let from = nearest(&tips, &center);
                f.tube(from, center, 0.07 * self.girth, bark);
            }
        }
    }
}

fn nearest(places: &[At], to: &At) -> At {
    let distance2 = |place: &At| (Vec3::from(*place) - Vec3::from(*to)).norm_squared();
    places.iter().copied().min_by(|a, b| distance2(a).total_cmp(&distance2(b))).unwrap_or(*to)
}

/// A Lombardy poplar of 10 to 15 m: a column of leaves.
pub fn poplar(b: &mut SceneBuilder, pose: &Isometry3<f32>, random: &mut Random) {
    let mut f = Frame::new(b, pose);
    let bark = f.surface(Vegetation, Material::Bark);
    let leaves = f.surface(Vegetation, Material::LeavesDark);
    let height = random.range(10.0, 15.0);
    f.cone([0.0, 0.0, -ROOT_M], [0.0, 0.0, 0.95 * height], [0.24, 0.03], bark);
    let n = (height * 3.0) as usize;
    for i in 0..n {
        let share = i as f32 / n as f32;
        let width = 1.15 * (std::f32::consts::PI * (0.12 + 0.85 * share)).sin();
        let angle = i as f32 * GOLDEN;
        let out = 0.5 * width;
        let radius = 0.25 + 0.5 * width * random.range(0.7, 1.0);
        let z = 1.5 + share * (height - 2.2);
        f.leaves([out * angle.cos(), out * angle.sin(), z], radius, 0.4, leaves);
        if i % 4 == 0 {
            f.tube([0.0, 0.0, z - 0.8], [out * angle.cos(), out * angle.sin(), z], 0.025, bark);
        }
    }
}

/// A spruce of 7 to 13 m: whorls of drooping branches that get shorter towards the top.
pub fn conifer(b: &mut SceneBuilder, pose: &Isometry3<f32>, random: &mut Random) {
    let mut f = Frame::new(b, pose);
    let bark = f.surface(Vegetation, Material::Bark);
    let needles = f.surface(Vegetation, Material::Needles);
    let height = random.range(7.0, 13.0);
    f.cone([0.0, 0.0, -ROOT_M], [0.0, 0.0, height], [0.02 * height, 0.02], bark);
    let mut z = random.range(0.8, 1.4);
    let mut turn = 0.0;
    while z < height - 0.2 {
        let reach = 0.24 * (height - z) + 0.1;
        let n = 4 + (reach * 2.2) as usize;
        for i in 0..n {
            let angle = turn + TAU * i as f32 / n as f32;
            let tip = reach * random.range(0.85, 1.1);
            let cos = angle.cos();
            let sin = angle.sin();
            f.tube([0.0, 0.0, z], [tip * cos, tip * sin, z - 0.22 * tip], 0.015, bark);
            for share in [0.45, 0.85] {
                let radius = 0.14 + 0.18 * reach * (1.2 - share);
                let at = [share * tip * cos, share * tip * sin, z - 0.22 * share * tip];
                f.leaves(at, radius, 0.28, needles);
            }
        }
        turn += 1.1;
        z += 0.35 + 0.16 * reach;
    }
}

/// A bush of 0.8 to 1.6 m; one in three is in blossom.
pub fn bush(b: &mut SceneBuilder, pose: &Isometry3<f32>, random: &mut Random) {
    let mut f = Frame::new(b, pose);
    let bark = f.surface(Vegetation, Material::Bark);
    let leaf = *random.pick(&[Material::Leaves, Material::LeavesDark, Material::LeavesYoung]);
    let leaves = f.surface(Vegetation, leaf);
    let blossom = f.surface(Vegetation, Material::Blossom);
    let height = random.range(0.8, 1.6);
    let spread = random.range(0.4, 0.8);
    let blooms = random.chance(0.33);
    for i in 0..14 {
        let share = (i as f32 + 0.5) / 14.0;
        let angle = i as f32 * GOLDEN;
        let out = spread * random.range(0.2, 0.6);
        let radius = spread * random.range(0.28, 0.42);
        let at = [out * angle.cos(), out * angle.sin(), radius + share * (height - 2.0 * radius).max(0.0)];
        f.tube([0.2 * at[0], 0.2 * at[1], -0.1], at, 0.012, bark);
        f.leaves(at, radius, 0.25, leaves);
        if blooms && i % 2 == 0 {
            let up = [at[0] * 1.2, at[1] * 1.2, at[2] + 0.5 * radius];
            f.leaves(up, 0.4 * radius, 0.12, blossom);
        }
    }
}

/// Tufts of grass and weeds within half a metre, 0.15 to 0.5 m high.
pub fn tuft(b: &mut SceneBuilder, pose: &Isometry3<f32>, random: &mut Random) {
    let mut f = Frame::new(b, pose);
    let grass = *random.pick(&[Material::Grass, Material::Grass, Material::DryGrass]);
    let grass = f.surface(Vegetation, grass);
    for i in 0..24 {
        let angle = i as f32 * GOLDEN;
        let out = random.range(0.0, 0.2);
        let bend = random.range(0.03, 0.22);
        let height = random.range(0.15, 0.5);
        let c = angle.cos();
        let s = angle.sin();
        f.cone([out * c, out * s, -0.02], [(out + bend) * c, (out + bend) * s, height], [0.009, 0.002], grass);
    }
    f.leaves([0.0, 0.0, 0.06], 0.2, 0.15, grass);
}

/// A bed of flowers 2 m long and 1 m wide between low stones.
pub fn flower_bed(b: &mut SceneBuilder, pose: &Isometry3<f32>, random: &mut Random) {
    let mut f = Frame::new(b, pose);
    let stone = f.surface(messages::ClassId::Static, Material::Granite);
    let soil = f.surface(messages::ClassId::Terrain, Material::Soil);
    let leaves = f.surface(Vegetation, Material::LeavesYoung);
    let blossom = f.surface(Vegetation, Material::Blossom);
    for y in [-0.5, 0.42] {
        f.cuboid([-1.0, y, -0.1], [1.0, y + 0.08, 0.16], stone);
    }
    for x in [-1.0, 0.92] {
        f.cuboid([x, -0.42, -0.1], [x + 0.08, 0.42, 0.16], stone);
    }
    f.cuboid([-0.92, -0.42, -0.1], [0.92, 0.42, 0.11], soil);
    for i in 0..20 {
        let at = [random.range(-0.8, 0.8), random.range(-0.33, 0.33), random.range(0.18, 0.34)];
        f.leaves(at, random.range(0.09, 0.16), 0.12, if i % 3 == 0 { blossom } else { leaves });
    }
}

/// A tub of 0.5 m with a clipped ball or a small conifer.
pub fn flower_pot(b: &mut SceneBuilder, pose: &Isometry3<f32>, random: &mut Random) {
    let mut f = Frame::new(b, pose);
    let tub = *random.pick(&[Material::ClayTile, Material::Concrete, Material::DarkMetal, Material::Wood]);
    let tub = f.surface(messages::ClassId::Static, tub);
    let leaves = f.surface(Vegetation, Material::LeavesDark);
    let bark = f.surface(Vegetation, Material::Bark);
    f.cone([0.0, 0.0, 0.0], [0.0, 0.0, 0.48], [0.2, 0.28], tub);
    f.tube([0.0, 0.0, 0.48], [0.0, 0.0, 0.8], 0.025, bark);
    if random.chance(0.5) {
        f.leaves([0.0, 0.0, 0.95], 0.33, 0.12, leaves);
    } else {
        for (z, radius) in [(0.68, 0.26), (0.95, 0.21), (1.2, 0.15), (1.4, 0.09)] {
            f.leaves([0.0, 0.0, z], radius, 0.1, leaves);
        }
    }
}

/// A clipped hedge along a foot line, `height` m high and 0.7 m thick: a dense core under looser leaves.
pub fn hedge(b: &mut SceneBuilder, feet: &[Vec3], height: f32, random: &mut Random) {
    let leaf = *random.pick(&[Material::LeavesDark, Material::Leaves]);
    let leaves = b.surface(Vegetation, 0, leaf);
    let up = Vec3::z() * (0.5 * height - 0.1);
    for pair in feet.windows(2) {
        b.add(super::frame::beam(&(pair[0] + up), &(pair[1] + up), [0.36, height - 0.1]), leaves);
        let along = pair[1] - pair[0];
        let across = Vec3::z().cross(&along).try_normalize(1e-6).unwrap_or_else(Vec3::y);
        let n = (along.norm() / 0.4).ceil() as usize;
        for i in 0..n {
            let foot = pair[0] + along * ((i as f32 + random.range(0.2, 0.8)) / n as f32);
            let mut cluster = |off: f32, z: f32| {
                let center = foot + across * (off + random.range(-0.04, 0.04)) + Vec3::z() * z;
                b.add(raytrace::Shape::Porous { center, radius: random.range(0.2, 0.3), free_path: 0.13 }, leaves);
            };
            let rows = (height / 0.38).ceil() as usize;
            for row in 0..rows {
                let z = 0.2 + (height - 0.4) * row as f32 / (rows - 1).max(1) as f32;
                cluster(0.15, z);
                cluster(-0.15, z);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use raytrace::{Bvh, Ray};

    #[test]
    fn some_rays_pass_crown_and_none_pass_trunk() {
        for (grow, heights) in
            [(deciduous as fn(&mut SceneBuilder, &Isometry3<f32>, &mut Random), [4.0, 6.0]), (plane_tree, [6.0, 9.0])]
        {
            let mut b = SceneBuilder::default();
            grow(&mut b, &Isometry3::identity(), &mut Random::for_hashed_stream(6, 0));
            let tree = Bvh::new(b.primitives);
            let mut random = Random::for_hashed_stream(7, 0);
            let n = 3000;
            let passed = (0..n)
                .filter(|i| {
                    let origin = Vec3::new(-30.0, random.range(-1.5, 1.5), random.range(heights[0], heights[1]));
                    tree.nearest(&Ray { origin, direction: Vec3::x(), seed: *i }, 60.0).is_none()
                })
                .count();
            let share = passed as f32 / n as f32;
            assert!((0.002..0.5).contains(&share), "{share}");
            let low = Ray { origin: Vec3::new(-30.0, 0.0, 1.0), direction: Vec3::x(), seed: 1 };
            let (range, _) = tree.nearest(&low, 60.0).expect("the trunk");
            assert!((29.4..30.0).contains(&range), "{range}");
        }
    }
}
