//! Whole houses: in rows between others, detached with a garage, barns, churches. All class building.

use super::facade::Front;
use super::roof::{self, Body};
use super::style::{Roof, Style};
use super::wall::{FOOT_M, WallFrame, block, course, cuts_of};
use crate::material::Material;
use crate::scene_builder::SceneBuilder;
use messages::ClassId::{Building, Ground};
use nalgebra::{Isometry3, Point3};
use random::Random;
use raytrace::{Shape, Vec3};

/// A plot between other houses. Its plan maps u from 0 to `width` and out from 0 (the front) to `-depth` (the back).
#[derive(Clone, Copy, Debug)]
pub struct Lot {
    /// Width along the street, at least 4 m.
    pub width: f32,
    /// Depth away from the street, at least 5 m.
    pub depth: f32,
    /// Storeys, at least 1.
    pub floors: usize,
    /// Whether the sides at u = 0 and at u = `width` are free-standing: they then have windows.
    pub open: [bool; 2],
    /// Whether a passage of 3 m leads through the ground floor to the back; for lots of at least 9 m.
    pub gate: bool,
}

/// A house on a lot: front, back, sides, roof, and the passage through it.
pub fn row_house(b: &mut SceneBuilder, plan: WallFrame<'_>, lot: &Lot, style: &Style, random: &mut Random) {
    let width = lot.width;
    let depth = lot.depth;
    let back = style.back();
    let gate = (lot.gate && width >= 9.0).then(|| {
        let middle = width * random.range(0.4, 0.6);
        [middle - 1.5, middle + 1.5]
    });
    let front = |style, length, gate, door, random: &mut Random| Front {
        style,
        length,
        floors: lot.floors,
        door,
        gate,
        seed: random.bits(),
    };
    let door = Some(random.range(0.0, width));
    front(style, width, gate, door, random).build(b, plan, random);
    let back_plan = |u: f32, z: f32, out: f32| plan(width - u, z, -depth - out);
    let back_gate = gate.map(|[from, to]| [width - to, width - from]);
    let door = Some(random.range(0.0, width));
    front(&back, width, back_gate, door, random).build(b, &back_plan, random);
    for (right, open) in lot.open.into_iter().enumerate() {
        let side_plan =
            |u: f32, z: f32, out: f32| if right == 0 { plan(-out, z, -u) } else { plan(width + out, z, -u) };
        if open {
            front(&back, depth, None, None, random).build(b, &side_plan, random);
        } else {
            party_wall(b, &side_plan, style, depth, style.height(lot.floors));
        }
    }
    if let Some(gate) = gate {
        passage(b, plan, style, gate, depth);
    }
    let body = Body { width, depth, top: style.height(lot.floors), open: lot.open };
    roof::build(b, plan, &body, style, random);
}

/// A wall without windows. It extends up to the fronts, so that no sky is visible between two houses.
fn party_wall(b: &mut SceneBuilder, plan: WallFrame<'_>, style: &Style, depth: f32, top: f32) {
    let wall = b.surface(Building, 0, style.wall);
    let out = 0.0;
    let ends = [-style.uneven_m, depth + style.uneven_m];
    let corners = [(ends[0], -FOOT_M), (ends[1], -FOOT_M), (ends[1], top), (ends[0], top)];
    b.quad(corners.map(|(u, z)| plan(u, z, out)), wall);
}

/// A paved passage from the front to the back, walled and covered.
fn passage(b: &mut SceneBuilder, plan: WallFrame<'_>, style: &Style, gate: [f32; 2], depth: f32) {
    let [wall, paving] = [b.surface(Building, 0, style.base), b.surface(Ground, 0, Material::Cobble)];
    let ceiling = style.ground_m - 0.3;
    for out in cuts_of([0.0, depth], 2.5).windows(2) {
        let mut strip = |[u0, z0]: [f32; 2], [u1, z1]: [f32; 2], surface: u32| {
            b.quad(
                [plan(u0, z0, -out[0]), plan(u1, z1, -out[0]), plan(u1, z1, -out[1]), plan(u0, z0, -out[1])],
                surface,
            );
        };
        strip([gate[0], -FOOT_M], [gate[0], ceiling], wall);
        strip([gate[1], -FOOT_M], [gate[1], ceiling], wall);
        strip([gate[0], ceiling], [gate[1], ceiling], wall);
        strip([gate[0], 0.02], [gate[1], 0.02], paving);
    }
}

/// The plan of a rectangle around a pose: `width` along its x, `depth` along its y; its front is on -y.
fn around(pose: &Isometry3<f32>, width: f32, depth: f32) -> impl Fn(f32, f32, f32) -> Vec3 {
    let pose = *pose;
    move |u, z, out| (pose * Point3::new(u - 0.5 * width, -0.5 * depth - out, z)).coords
}

/// A house with a garden, its front towards -y: one or two storeys under a gabled roof, a porch, sometimes a garage.
pub fn detached(b: &mut SceneBuilder, pose: &Isometry3<f32>, width: f32, depth: f32, random: &mut Random) {
    let style = Style::cottage(random);
    let lot = Lot { width, depth, floors: 1 + random.index(2), open: [true; 2], gate: false };
    let plan = around(pose, width, depth);
    free_standing(b, &plan, &lot, &style, Some(0.5 * width), random);
    porch(b, &plan, &style, 0.5 * width, random);
    if random.chance(0.5) {
        garage(b, &plan, &style, [width, depth], random);
    }
}

/// A free-standing apartment house with windows on all sides.
pub fn apartments(
    b: &mut SceneBuilder,
    pose: &Isometry3<f32>,
    width: f32,
    depth: f32,
    floors: usize,
    random: &mut Random,
) {
    let style = Style { shops: false, ..Style::modern(random) };
    let lot = Lot { width, depth, floors, open: [true; 2], gate: false };
    let door = Some(random.range(0.2, 0.8) * width);
    free_standing(b, &around(pose, width, depth), &lot, &style, door, random);
}

/// Four fronts and a roof, with a door only in the front.
fn free_standing(
    b: &mut SceneBuilder,
    plan: WallFrame<'_>,
    lot: &Lot,
    style: &Style,
    door: Option<f32>,
    random: &mut Random,
) {
    let width = lot.width;
    let depth = lot.depth;
    let side = |turn: usize, u: f32, z: f32, out: f32| match turn {
        0 => plan(u, z, out),
        1 => plan(width + out, z, -u),
        2 => plan(width - u, z, -depth - out),
        _ => plan(-out, z, -u),
    };
    for turn in 0..4 {
        let length = if turn % 2 == 0 { width } else { depth };
        let door = door.filter(|_| turn == 0);
        let plain = style.back();
        let style = if turn == 0 { style } else { &plain };
        let front = Front { style, length, floors: lot.floors, door, gate: None, seed: random.bits() };
        front.build(b, &|u, z, out| side(turn, u, z, out), random);
    }
    let body = Body { width, depth, top: style.height(lot.floors), open: [true; 2] };
    roof::build(b, plan, &body, style, random);
}

/// A small roof on two posts over the door, with steps.
fn porch(b: &mut SceneBuilder, plan: WallFrame<'_>, style: &Style, door: f32, random: &mut Random) {
    let tiles = *random.pick(&[Material::ClayTile, Material::Slate]);
    let [tiles, post, stone] = [tiles, style.frame, Material::Granite].map(|material| b.surface(Building, 0, material));
    let u = [door - 1.1, door + 1.1];
    for at in u {
        b.add(Shape::cylinder(plan(at, -0.3, 1.4), plan(at, 2.5, 1.4), 0.06), post);
    }
    block(b, plan, [u[0] - 0.1, u[1] + 0.1], [2.45, 2.57], [1.33, 1.47], post);
    let eave = [u[0] - 0.25, u[1] + 0.25];
    b.quad(
        [plan(eave[0], 2.5, 1.75), plan(eave[1], 2.5, 1.75), plan(eave[1], 3.1, 0.0), plan(eave[0], 3.1, 0.0)],
        tiles,
    );
    for (out, top) in [(1.5, 0.12), (1.1, 0.24)] {
        block(b, plan, [door - 0.9, door + 0.9], [-0.5, top], [0.0, out], stone);
    }
}

/// A garage next to the right side, flush with the front.
fn garage(b: &mut SceneBuilder, plan: WallFrame<'_>, style: &Style, [width, depth]: [f32; 2], random: &mut Random) {
    let length = (depth - 1.0).min(6.0);
    let [wall, door, roof] = [style.wall, style.frame, Material::Bitumen].map(|m| b.surface(Building, 0, m));
    let u = [width + 0.1, width + 3.3];
    block(b, plan, u, [-FOOT_M, 2.5], [-length, -0.3], wall);
    block(b, plan, [u[0] - 0.1, u[1] + 0.15], [2.5, 2.65], [-length - 0.1, -0.15], roof);
    for panel in 0..4 {
        let z = 0.02 + 0.52 * panel as f32;
        block(b, plan, [u[0] + 0.35, u[1] - 0.35], [z, z + 0.5], [-0.32, -0.27 + random.range(0.0, 0.01)], door);
    }
}

/// A barn of planks, brick or stone, 14 to 20 m long, with a large gate in its front on -y.
pub fn barn(b: &mut SceneBuilder, pose: &Isometry3<f32>, random: &mut Random) {
    let width = random.range(14.0, 20.0);
    let depth = random.range(9.0, 12.0);
    let wall = *random.pick(&[Material::Wood, Material::WoodGray, Material::Brick, Material::Fieldstone]);
    let height = random.range(4.0, 5.5);
    let style = Style::blank(random, wall, height);
    let lot = Lot { width, depth, floors: 1, open: [true; 2], gate: false };
    let plan = around(pose, width, depth);
    free_standing(b, &plan, &lot, &style, None, random);
    let [gate, iron] = [style.door, Material::DarkMetal].map(|material| b.surface(Building, 0, material));
    let middle = width * random.range(0.35, 0.65);
    for u in [[middle - 2.0, middle - 0.03], [middle + 0.03, middle + 2.0]] {
        block(b, &plan, u, [0.05, 3.4], [0.02, 0.1], gate);
        block(b, &plan, [u[0] + 0.1, u[1] - 0.1], [0.6, 0.75], [0.1, 0.14], iron);
        block(b, &plan, [u[0] + 0.1, u[1] - 0.1], [2.7, 2.85], [0.1, 0.14], iron);
    }
    if wall == Material::Wood || wall == Material::WoodGray {
        // Boards protrude where they overlap.
        let wood = b.surface(Building, 0, wall);
        for i in 0..(width / 0.5) as usize {
            let u = 0.25 + 0.5 * i as f32;
            if (u - middle).abs() > 2.1 {
                block(b, &plan, [u, u + 0.07], [0.3, style.height(1)], [0.0, 0.05], wood);
            }
        }
    }
}

/// A church 22 m long with a tower and a spire of 30 m; its door is in the tower, on -x.
pub fn church(b: &mut SceneBuilder, pose: &Isometry3<f32>, random: &mut Random) {
    let wall = *random.pick(&[Material::Limestone, Material::Fieldstone, Material::Brick]);
    let nave_style = Style {
        bay_m: 4.0,
        window: [1.3, 4.2, 2.2],
        surrounds: true,
        cornice_m: 0.25,
        trim: Material::LimestoneDressed,
        frame: Material::DarkMetal,
        roof: Roof::Gabled,
        recess_m: 0.35,
        ..Style::blank(random, wall, 8.5)
    };
    let length = 20.0;
    let depth = 10.0;
    let nave = pose * Isometry3::translation(3.0, 0.0, 0.0);
    let plan = around(&nave, length, depth);
    let lot = Lot { width: length, depth, floors: 1, open: [true; 2], gate: false };
    free_standing(b, &plan, &lot, &nave_style, None, random);
    let stone = b.surface(Building, 0, wall);
    for i in 0..=5 {
        let u = length * i as f32 / 5.0;
        for (z, reach) in [(4.5, 1.2), (7.0, 0.7)] {
            block(b, &plan, [u - 0.35, u + 0.35], [-FOOT_M, z], [-0.1, reach], stone);
            block(b, &plan, [u - 0.35, u + 0.35], [-FOOT_M, z], [-depth - reach, 0.1 - depth], stone);
        }
    }
    tower(b, &(pose * Isometry3::translation(-9.0, 0.0, 0.0)), wall, random);
}

/// A square tower of 5.6 m and 19 m height under a spire.
fn tower(b: &mut SceneBuilder, pose: &Isometry3<f32>, wall: Material, random: &mut Random) {
    let size = 5.6;
    let height = 19.0;
    let style = Style {
        roof: Roof::Flat,
        cornice_m: 0.3,
        trim: Material::LimestoneDressed,
        ..Style::blank(random, wall, height)
    };
    let [slate, dark, trim, door, face] =
        [Material::Slate, Material::BlackCloth, Material::LimestoneDressed, Material::Wood, Material::WoodWhite]
            .map(|material| b.surface(Building, 0, material));
    for turn in 0..4 {
        let side = pose * Isometry3::rotation(Vec3::z() * std::f32::consts::FRAC_PI_2 * turn as f32);
        let plan = around(&side, size, size);
        let front = Front { style: &style, length: size, floors: 1, door: None, gate: None, seed: random.bits() };
        front.build(b, &plan, random);
        let middle = 0.5 * size;
        for u in [middle - 1.0, middle + 0.2] {
            block(b, &plan, [u, u + 0.8], [15.0, 17.6], [-0.02, 0.07], dark);
            block(b, &plan, [u - 0.1, u + 0.9], [14.8, 15.0], [0.0, 0.2], trim);
        }
        b.add(Shape::cylinder(plan(middle, 13.2, 0.0), plan(middle, 13.2, 0.12), 0.8), face);
        block(b, &plan, [middle - 0.04, middle + 0.04], [13.2, 13.85], [0.12, 0.16], dark);
        course(b, &plan, [0.0, size], [7.0, 7.25], [-0.05, 0.12], trim);
        if turn == 3 {
            block(b, &plan, [middle - 1.2, middle + 1.2], [0.0, 3.6], [-0.02, 0.12], trim);
            block(b, &plan, [middle - 0.9, middle + 0.9], [0.05, 3.3], [0.1, 0.18], door);
        }
        let eave = |u: f32| plan(u, height - 0.05, 0.35);
        let tip = (pose * Point3::new(0.0, 0.0, height + 10.0)).coords;
        b.triangle([eave(-0.35), eave(size + 0.35), tip], slate);
    }
    let iron = b.surface(Building, 0, Material::DarkMetal);
    let at = |y: f32, z: f32| (pose * Point3::new(0.0, y, z)).coords;
    b.add(Shape::cylinder(at(0.0, height + 9.8), at(0.0, height + 11.3), 0.05), iron);
    b.add(Shape::cylinder(at(-0.4, height + 10.9), at(0.4, height + 10.9), 0.05), iron);
}

#[cfg(test)]
mod tests {
    use super::*;
    use raytrace::{Bvh, Ray};

    const WIDTH: f32 = 15.0;
    const DEPTH: f32 = 11.0;

    fn house(style: fn(&mut Random) -> Style, gate: bool, seed: u64) -> (Bvh, Style, SceneBuilder) {
        let mut random = Random::for_hashed_stream(seed, 0);
        let mut b = SceneBuilder::default();
        let style = style(&mut random);
        let lot = Lot { width: WIDTH, depth: DEPTH, floors: 4, open: [false, false], gate };
        row_house(&mut b, &|u, z, out| Vec3::new(u, -out, z), &lot, &style, &mut random);
        (Bvh::new(b.primitives.clone()), style, b)
    }

    #[test]
    fn no_ray_from_outside_enters_house() {
        for style in [Style::haussmann, Style::faubourg, Style::brick, Style::modern, Style::office] {
            let (tree, style, _) = house(style, false, 4);
            let mut random = Random::for_hashed_stream(8, 0);
            let top = style.height(4);
            for _ in 0..4000 {
                let u = random.range(0.05, WIDTH - 0.05);
                let z = random.range(0.0, top - 0.05);
                for (y, toward) in [(-20.0, 1.0), (DEPTH + 20.0, -1.0)] {
                    let ray = Ray { origin: Vec3::new(u, y, z), direction: Vec3::y() * toward, seed: 0 };
                    let (range, _) = tree.nearest(&ray, 60.0).expect("a wall");
                    // Awnings and balconies protrude by up to 1.3 m, panes lie up to 0.28 m behind an uneven wall.
                    assert!((18.6..20.4).contains(&range), "{range} at u = {u}, z = {z}");
                }
                let above = Vec3::new(u, random.range(0.05, DEPTH - 0.05), 60.0);
                let (range, _) =
                    tree.nearest(&Ray { origin: above, direction: -Vec3::z(), seed: 0 }, 80.0).expect("a roof");
                assert!(range < 60.0 - top + 0.1, "{range} at {above}");
            }
        }
    }

    #[test]
    fn gate_opens_passage_through_ground_floor() {
        let (tree, ..) = house(Style::haussmann, true, 4);
        let is_open = |u: f32, z: f32| {
            let ray = Ray { origin: Vec3::new(u, -20.0, z), direction: Vec3::y(), seed: 0 };
            tree.nearest(&ray, 60.0).is_none()
        };
        let open: Vec<f32> = (3..147).map(|i| i as f32 * 0.1).filter(|u| is_open(*u, 1.5)).collect();
        let width = open[open.len() - 1] - open[0];
        assert!((2.7..=3.1).contains(&width) && open.len() >= 27, "{width} m, {} rays", open.len());
        assert!(!is_open(open[open.len() / 2], 4.5), "closed above it");
    }

    #[test]
    fn plastered_wall_deviates_from_plane_by_centimeters() {
        let (tree, style, b) = house(Style::faubourg, false, 9);
        let wall = b.surfaces.iter().position(|s| s.material == style.wall).expect("the wall's surface");
        // Between the windows of the first floor; blocks on the wall are boxes and the wall is not.
        let depths: Vec<f32> = (0..3000)
            .filter_map(|i| {
                let u = 0.3 + 0.0048 * i as f32;
                let z = style.floor_z(1) + 0.35;
                let ray = Ray { origin: Vec3::new(u, -20.0, z), direction: Vec3::y(), seed: 0 };
                let (range, primitive) = tree.nearest(&ray, 60.0)?;
                (primitive.surface as usize == wall).then_some(20.0 - range)
            })
            .collect();
        let n = depths.len() as f32;
        assert!(n > 1500.0, "{n}");
        let mean = depths.iter().sum::<f32>() / n;
        let rms = (depths.iter().map(|d| (d - mean).powi(2)).sum::<f32>() / n).sqrt();
        assert!((0.004..0.04).contains(&rms), "{rms}");
        assert!(depths.iter().all(|d| d.abs() <= style.uneven_m + 1e-4));
    }
}
