//! Transformation of filters for Winograd's minimal filtering; see [`super::winograd`].

use super::planes::{Feature, LANES, blocks};
use super::shape::Shape;

/// Side of the output of a tile, px.
pub(super) const OUT: usize = 4;
/// Side of the input of a tile, px.
pub(super) const IN: usize = 6;
/// Number of transformed values of a tile.
pub(super) const VALUES: usize = IN * IN;
/// Whether these kernels can apply a filter of this shape to an image of this size.
pub(super) fn fits(shape: &Shape, height: usize, width: usize) -> bool {
    shape.kernel == [3, 3] && shape.stride_x == 1 && height.is_multiple_of(OUT) && width.is_multiple_of(OUT)
}

/// The transformed filter: rows of 16 output channels by value, output block, input block, input channel.
pub(super) fn transformed(shape: &Shape, taps: &[Feature]) -> Vec<Feature> {
    let root = std::f64::consts::SQRT_2;
    let by_point: [[f64; 3]; IN] = [
        [1.0, 0.0, 0.0],
        [-2.0 / 3.0, -root / 3.0, -1.0 / 3.0],
        [-2.0 / 3.0, root / 3.0, -1.0 / 3.0],
        [1.0 / 6.0, root / 6.0, 1.0 / 3.0],
        [1.0 / 6.0, -root / 6.0, 1.0 / 3.0],
        [0.0, 0.0, 1.0],
    ];
    let n = blocks(shape.out_channels) * shape.in_blocks() * LANES;
    let mut values = vec![[0.0; LANES]; VALUES * n];
    // Padding channels stay zero: without them a network of few channels is prepared several times faster.
    let is_padding: Vec<bool> = (shape.in_channels.iter())
        .flat_map(|&channels| (0..blocks(channels) * LANES).map(move |channel| channel >= channels))
        .collect();
    for row in (0..n).filter(|row| !is_padding[row % is_padding.len()]) {
        let pair = row / LANES;
        let channel = row % LANES;
        for y in 0..IN {
            for x in 0..IN {
                let mut sum = [0.0_f64; LANES];
                for tap in 0..9 {
                    let factor = by_point[y][tap / 3] * by_point[x][tap % 3];
                    let weights = &taps[(pair * 9 + tap) * LANES + channel];
                    sum.iter_mut().zip(weights).for_each(|(sum, &weight)| *sum += factor * f64::from(weight));
                }
                values[(y * IN + x) * n + row] = sum.map(|v| v as f32);
            }
        }
    }
    values
}
