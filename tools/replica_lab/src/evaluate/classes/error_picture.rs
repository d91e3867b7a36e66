//! Draws truth, prediction and errors of a submap in a top view.

use anyhow::Context;
use geometry::BevGrid;
use image::{Rgb, RgbImage};
use messages::SubmapPoint;
use pictures::class_color::class_color;
use std::path::Path;

/// Half of the side of the area shown, m.
const REACH_M: f64 = 35.0;
/// Side of a pixel, m.
const CELL_M: f64 = 0.1;
/// Distance between the pictures, px.
const GAP: u32 = 10;
const BACKGROUND: Rgb<u8> = Rgb([20, 20, 24]);
const WRONG: Rgb<u8> = Rgb([230, 40, 40]);
const RIGHT: Rgb<u8> = Rgb([70, 74, 80]);

/// Writes three pictures side by side: truth, prediction and errors. x points up. Each pixel shows its highest point, so trees
/// hide the points below them.
pub fn write(path: &Path, points: &[SubmapPoint], truth: &[u8], predicted: &[u8]) -> anyhow::Result<()> {
    let side = (2.0 * REACH_M / CELL_M) as usize;
    let grid = BevGrid { x0: -REACH_M, y0: -REACH_M, cell_m: CELL_M, rows: side, cols: side };
    let mut highest: Vec<Option<usize>> = vec![None; grid.n_cells()];
    for (index, point) in points.iter().enumerate() {
        let Some((row, column)) = grid.cell(f64::from(point.x), f64::from(point.y)) else { continue };
        let shown = &mut highest[row * side + column];
        if shown.is_none_or(|other| point.z > points[other].z) {
            *shown = Some(index);
        }
    }
    let width = side as u32;
    let mut image = RgbImage::from_pixel(3 * width + 2 * GAP, width, BACKGROUND);
    for (cell, index) in highest.iter().enumerate().filter_map(|(cell, index)| Some((cell, (*index)?))) {
        let u = (side - 1 - cell % side) as u32;
        let v = (side - 1 - cell / side) as u32;
        let right = if truth[index] == predicted[index] { RIGHT } else { WRONG };
        let colors = [Rgb(class_color(truth[index])), Rgb(class_color(predicted[index])), right];
        for (k, color) in (0..).zip(colors) {
            image.put_pixel(k * (width + GAP) + u, v, color);
        }
    }
    image.save(path).with_context(|| path.display().to_string())
}
