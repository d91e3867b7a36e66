//! Patterns: spatial variation of the reflectance of a material.

use crate::noise::value_noise;
use random::{hash, unit};
use raytrace::Vec3;

/// The pattern on a material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Pattern {
    Plain,
    /// Grain and repaired patches.
    Grain,
    /// Rain stains over undulations of a metre and more.
    Stains,
    /// Courses of blocks: width and height in m, strength of the joints (negative = darker).
    Blocks {
        width: f32,
        height: f32,
        joint: f32,
    },
    /// Pieces of irregular shape, with this size in m.
    Rubble {
        size: f32,
    },
    /// Light and dark leaves.
    Leafy,
}

impl Pattern {
    /// Factor of the reflectance at a point of the surface (m, in the frame of its object), about 0.5 to 1.5.
    pub fn factor(&self, p: &Vec3, normal: &Vec3) -> f32 {
        match *self {
            Pattern::Plain => 1.0,
            Pattern::Grain => {
                1.0 + 0.12 * value_noise(1, p.x * 18.0, p.y * 18.0, p.z * 18.0)
                    + 0.16 * value_noise(2, p.x / 2.5, p.y / 2.5, p.z / 2.5)
            }
            Pattern::Stains => {
                1.0 + 0.12 * value_noise(3, p.x / 1.7, p.y / 1.7, p.z / 3.0)
                    + 0.05 * value_noise(4, p.x * 4.0, p.y * 4.0, p.z * 2.0)
            }
            Pattern::Blocks { width, height, joint } => blocks(p, normal, width, height, joint),
            Pattern::Rubble { size } => {
                let at = p / size;
                1.0 + 0.45 * value_noise(6, at.x, at.y, at.z) + 0.1 * value_noise(7, p.x, p.y, p.z)
            }
            Pattern::Leafy => 1.0 + 0.35 * value_noise(5, p.x * 9.0, p.y * 9.0, p.z * 9.0),
        }
    }
}

/// Every other course is shifted by half a block; joints are 8 % of a block's height.
fn blocks(p: &Vec3, normal: &Vec3, width: f32, height: f32, joint: f32) -> f32 {
    // On walls along the nearer axis and up, on the ground along the two axes. The direction of the wall itself is not
    // used: the normal of an uneven wall varies from cell to cell, and the blocks would jump with it.
    let (along, up) = if normal.z.abs() > 0.7 {
        (p.x, p.y)
    } else if normal.y.abs() > normal.x.abs() {
        (p.x, p.z)
    } else {
        (p.y, p.z)
    };
    let row = (up / height).floor();
    let column = along / width + 0.5 * (row as i64).rem_euclid(2) as f32;
    let in_row = up / height - row;
    let in_column = column - column.floor();
    let gap = 0.08;
    if in_row < gap || in_column < gap * height / width {
        return 1.0 + joint;
    }
    let block = hash(row as i64 as u64, column.floor() as i64 as u64);
    0.88 + 0.24 * unit(block)
}
