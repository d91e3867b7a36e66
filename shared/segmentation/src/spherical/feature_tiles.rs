//! The default features of 16 pixels, and their position in the channels of the input image.

#![allow(
    clippy::needless_range_loop,
    reason = "loops over constant bounds become vector instructions; iterators and calls in between do not"
)]

use super::elementary::tanh;
use super::feature::N_FEATURES;
use super::surface::{SurfaceTile, Tile};
use kernels::images::{LANES, PlanesMut};

/// Writes the features of a row. Each column has `n_channels` of them.
#[inline(always)]
pub(super) fn write_folded(of_row: &[f32], n_channels: usize, row: usize, planes: &mut PlanesMut<'_>) {
    for (column, channels) in of_row.chunks_exact(n_channels).enumerate() {
        for (block, channels) in channels.chunks(LANES).enumerate() {
            planes.row_mut(block, row)[column][..channels.len()].copy_from_slice(channels);
        }
    }
}

/// The default features.
#[inline(always)]
pub(super) fn default_features(
    surface: &SurfaceTile,
    height_m: &Tile,
    intensity: &Tile,
    has_intensity: bool,
) -> [Tile; N_FEATURES] {
    let known = f32::from(u8::from(has_intensity));
    let mut features = [[0.0; LANES]; N_FEATURES];
    let mut log_range = [0.0; LANES];
    // A separate loop because the logarithm of the library is not vectorized.
    for i in 0..LANES {
        log_range[i] = (1.0 + surface.range_m[i]).ln() - 2.0;
    }
    for i in 0..LANES {
        let range_m = surface.range_m[i];
        let ray = &surface.ray;
        let normal = &surface.normal;
        let is_valid = range_m > 0.0;
        let mut set = |feature: usize, value: f32| features[feature][i] = if is_valid { value } else { 0.0 };
        let x = ray[0][i] / range_m;
        let y = ray[1][i] / range_m;
        let z = ray[2][i] / range_m;
        set(0, 1.0);
        set(1, log_range[i]);
        set(2, tanh(height_m[i] / 0.3));
        set(3, (height_m[i] / 4.0).clamp(-1.0, 3.0));
        set(4, normal[2][i]);
        set(5, -(x * normal[0][i] + y * normal[1][i] + z * normal[2][i]));
        set(6, z);
        set(7, tanh(surface.roughness_m[i] / 0.1));
        set(8, known * intensity[i] / 50.0);
        set(9, known);
    }
    features
}
