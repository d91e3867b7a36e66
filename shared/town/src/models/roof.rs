//! Roofs of houses in the frame of their plan: mansards with dormers, gables, parapets; and their chimneys.

use super::style::{Roof, Style};
use super::wall::{WallFrame, block, cuts_of};
use crate::material::Material;
use crate::noise::rough;
use crate::scene_builder::{SceneBuilder, SurfaceId};
use messages::ClassId::Building;
use random::Random;
use raytrace::Shape;

/// The body of a house under its roof: `width` along the plan, `depth` behind it, and the `top` of the wall, m.
#[derive(Clone, Copy, Debug)]
pub struct Body {
    /// Width along u.
    pub width: f32,
    /// Depth, from out = 0 to out = -depth.
    pub depth: f32,
    /// Height of the wall.
    pub top: f32,
    /// Whether the left and the right side are free: the roof then overhangs them.
    pub open: [bool; 2],
}

/// Outline of a roof from front to back: positions outward and up from the top of the wall, m.
type Outline = Vec<[f32; 2]>;

/// Builds the roof of a house and closes the gables of the party walls.
pub fn build(b: &mut SceneBuilder, plan: WallFrame<'_>, body: &Body, style: &Style, random: &mut Random) {
    let cover = match style.roof {
        Roof::Mansard => *random.pick(&[Material::Zinc, Material::Zinc, Material::Slate]),
        Roof::Gabled => *random.pick(&[Material::ClayTile, Material::ClayTile, Material::Slate]),
        Roof::Flat => Material::Bitumen,
    };
    let cover = b.surface(Building, 0, cover);
    let wall = b.surface(Building, 0, style.wall);
    let outline = outline(body, style, random);
    sheets(b, plan, body, &outline, cover, random.bits());
    for (u, _) in [0.0, body.width].into_iter().zip(body.open) {
        gable(b, plan, body, &outline, u, wall);
    }
    match style.roof {
        Roof::Mansard => dormers(b, plan, body, style, cover),
        Roof::Gabled => {}
        Roof::Flat => parapet(b, plan, body, style, random),
    }
    if style.chimneys {
        let ridge = outline.iter().map(|place| place[1]).fold(0.0, f32::max);
        chimneys(b, plan, body, (ridge - 0.8).max(0.0), random);
    }
}

fn outline(body: &Body, style: &Style, random: &mut Random) -> Outline {
    let depth = body.depth;
    match style.roof {
        Roof::Mansard => {
            let steep = random.range(2.2, 2.6);
            let back = 1.2;
            vec![[0.02, 0.0], [-back, steep], [-0.5 * depth, steep + 0.7], [back - depth, steep], [-depth - 0.02, 0.0]]
        }
        Roof::Gabled => {
            let rise = (depth * random.range(0.32, 0.46)).min(5.0);
            let eave = 0.4;
            let drop = -eave * rise / (0.5 * depth);
            vec![[eave, drop], [-0.5 * depth, rise], [-depth - eave, drop]]
        }
        Roof::Flat => vec![[0.0, 0.0], [-depth, 0.0]],
    }
}

/// The covered slopes, out of plane by 2 cm, 40 cm beyond free sides.
fn sheets(b: &mut SceneBuilder, plan: WallFrame<'_>, body: &Body, outline: &Outline, cover: SurfaceId, seed: u64) {
    let hang = |open: bool| if open && outline.len() == 3 { 0.4 } else { 0.0 };
    let us = cuts_of([-hang(body.open[0]), body.width + hang(body.open[1])], 2.5);
    let point = |u: f32, [out, up]: [f32; 2]| plan(u, body.top + up + 0.02 * rough(seed, u, out, 3.0, 1.2), out);
    for pair in outline.windows(2) {
        let n = ((pair[1][0] - pair[0][0]).abs() / 2.5).ceil().max(1.0) as usize;
        let at = |i: usize| {
            let share = i as f32 / n as f32;
            [0, 1].map(|k| pair[0][k] + share * (pair[1][k] - pair[0][k]))
        };
        for i in 0..n {
            for u in us.windows(2) {
                let corners = [(u[0], at(i)), (u[1], at(i)), (u[1], at(i + 1)), (u[0], at(i + 1))];
                b.quad(corners.map(|(u, place)| point(u, place)), cover);
            }
        }
    }
}

/// The wall between its top and the roof on one side.
fn gable(b: &mut SceneBuilder, plan: WallFrame<'_>, body: &Body, outline: &Outline, u: f32, wall: SurfaceId) {
    let inside: Vec<[f32; 2]> = outline
        .iter()
        .map(|[out, up]| if *up <= 0.0 { [out.clamp(-body.depth, 0.0), 0.0] } else { [*out, *up] })
        .collect();
    let point = |[out, up]: [f32; 2]| plan(u, body.top + up, out);
    for pair in inside[1..].windows(2) {
        b.triangle([point(inside[0]), point(pair[0]), point(pair[1])], wall);
    }
}

/// One dormer over every bay of the front.
fn dormers(b: &mut SceneBuilder, plan: WallFrame<'_>, body: &Body, style: &Style, cover: SurfaceId) {
    let [wall, glass, frame] =
        [style.trim, Material::Glass, style.frame].map(|material| b.surface(Building, 0, material));
    let n = (body.width / style.bay_m).round().max(1.0) as usize;
    for i in 0..n {
        let u = body.width * (i as f32 + 0.5) / n as f32;
        let z = body.top;
        block(b, plan, [u - 0.58, u + 0.58], [z + 0.25, z + 1.75], [-1.3, -0.3], wall);
        block(b, plan, [u - 0.68, u + 0.68], [z + 1.75, z + 1.86], [-1.4, -0.18], cover);
        block(b, plan, [u - 0.4, u + 0.4], [z + 0.45, z + 1.6], [-0.31, -0.28], glass);
        block(b, plan, [u - 0.03, u + 0.03], [z + 0.45, z + 1.6], [-0.29, -0.26], frame);
    }
}

/// One to three stacks across the roof, with pots.
fn chimneys(b: &mut SceneBuilder, plan: WallFrame<'_>, body: &Body, foot: f32, random: &mut Random) {
    let stack = *random.pick(&[Material::Brick, Material::Brick, Material::PlasterGray]);
    let [stack, pot] = [b.surface(Building, 0, stack), b.surface(Building, 0, Material::ClayTile)];
    for _ in 0..=random.index(3) {
        let u = random.range(0.6, body.width - 0.6);
        let out = -body.depth * random.range(0.3, 0.6);
        let half = random.range(0.35, 0.8);
        let top = body.top + foot + random.range(1.6, 2.4);
        block(b, plan, [u - 0.25, u + 0.25], [body.top + foot - 1.0, top], [out - half, out + half], stack);
        let n = (half / 0.2) as usize;
        for i in 0..=n {
            let at = out - half + 0.15 + (2.0 * half - 0.3) * i as f32 / n.max(1) as f32;
            b.add(Shape::cone(plan(u, top, at), plan(u, top + 0.4, at), [0.11, 0.08]), pot);
        }
    }
}

/// A parapet around a flat roof, and the objects behind it.
fn parapet(b: &mut SceneBuilder, plan: WallFrame<'_>, body: &Body, style: &Style, random: &mut Random) {
    let wall = b.surface(Building, 0, style.wall);
    let z = [body.top - 0.05, body.top + 0.8];
    for out in [[-0.25, 0.02], [-body.depth - 0.02, 0.25 - body.depth]] {
        super::wall::course(b, plan, [0.0, body.width], z, out, wall);
    }
    for u in [[0.0, 0.25], [body.width - 0.25, body.width]] {
        block(b, plan, u, z, [-body.depth, 0.0], wall);
    }
    let metal = b.surface(Building, 0, Material::Steel);
    let concrete = b.surface(Building, 0, Material::Concrete);
    let u = random.range(0.2, 0.6) * body.width;
    block(b, plan, [u, u + 2.5], [body.top, body.top + 2.4], [-0.7 * body.depth, -0.4 * body.depth], concrete);
    for _ in 0..=random.index(3) {
        let u = random.range(1.0, body.width - 1.5);
        let out = -random.range(1.5, body.depth - 1.5);
        block(b, plan, [u, u + 0.9], [body.top, body.top + 0.9], [out - 0.4, out + 0.4], metal);
    }
}
