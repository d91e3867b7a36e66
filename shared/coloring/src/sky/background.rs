//! The surfaces at the rim of an exposure, without the sky.

use super::rim::{RimMap, Surroundings};
use super::tint::Tint;
use crate::color_image::ColorImage;
use crate::visibility::CellGrid;

/// Side of the blocks of cells that share a reference.
const BLOCK: usize = 8;

/// Pixels of a reference around the middle of its block, in steps of `REFERENCE_STEP` cells: they cover the width of the
/// rim.
const REFERENCE: usize = 4;
const REFERENCE_STEP: usize = 2;

/// One pixel in this many, the darkest ones, form the reference. At the tip of a branch most pixels show the sky.
const REFERENCE_SHARE: usize = 8;

/// The parts of an exposure that may show the sky, and the references there.
#[derive(Debug)]
pub struct Background {
    grid: CellGrid,
    /// Side of a cell, px.
    pub step: usize,
    rim: RimMap,
    /// Reference of each block with rim cells, row by row.
    references: Vec<Option<Tint>>,
}

impl Background {
    /// Computes the references of an exposure from its rim and image.
    pub fn new(grid: CellGrid, rim: RimMap, image: &ColorImage<'_>) -> Self {
        let step = (grid.cell_px() + 0.5) as usize;
        let [columns, rows] = grid.size();
        let of_block = |block: usize| {
            let across = columns.div_ceil(BLOCK);
            let [x, y] = [block % across, block / across].map(|index| index * BLOCK);
            let mut cells =
                (y..rows.min(y + BLOCK)).flat_map(|y| (x..columns.min(x + BLOCK)).map(move |x| y * columns + x));
            let is_rim = cells.any(|cell| rim.surroundings(cell as u32) == Surroundings::Rim);
            let middle = (y + BLOCK / 2).min(rows - 1) * columns + (x + BLOCK / 2).min(columns - 1);
            is_rim.then(|| reference(image, grid.pixel(middle), step))
        };
        let references = (0..columns.div_ceil(BLOCK) * rows.div_ceil(BLOCK)).map(of_block).collect();
        Self { grid, step, rim, references }
    }

    /// The reference at a pixel. `None` if surfaces surround the pixel.
    pub fn reference(&self, image: &ColorImage<'_>, pixel: [f32; 2]) -> Option<Tint> {
        let cell = self.grid.cell(pixel[0], pixel[1]);
        if self.rim.surroundings(cell) == Surroundings::Surface {
            return None;
        }
        let [columns, _] = self.grid.size();
        let [x, y] = [cell as usize % columns, cell as usize / columns].map(|index| index / BLOCK);
        let of_block = self.references.get(y * columns.div_ceil(BLOCK) + x).copied().flatten();
        // Computed on demand, because isolated points are rare.
        Some(of_block.unwrap_or_else(|| reference(image, pixel, self.step)))
    }
}

/// The mean of the darkest pixels around a pixel.
fn reference(image: &ColorImage<'_>, pixel: [f32; 2], step: usize) -> Tint {
    let around = image.around(pixel, REFERENCE, REFERENCE_STEP * step);
    let mut around: Vec<[u8; 3]> = around.map(|(_, color)| color).collect();
    let n_dark = around.len().div_ceil(REFERENCE_SHARE);
    let (darker, darkest, _) = around.select_nth_unstable_by_key(n_dark - 1, |rgb| {
        let [r, g, b] = rgb.map(u32::from);
        r + 2 * g + b
    });
    let of_channel = |c: usize| {
        let sum = darker.iter().chain([&*darkest]).map(|rgb| u32::from(rgb[c])).sum::<u32>();
        sum as f32 / n_dark as f32
    };
    Tint::from_rgb([0, 1, 2].map(of_channel))
}
