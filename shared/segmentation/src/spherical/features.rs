//! Input features of the network.

#![allow(
    clippy::needless_range_loop,
    reason = "loops over constant bounds become vector instructions; iterators and calls in between do not"
)]

use super::elementary::tanh;
use super::named_features::NamedFeatures;
use super::surface::{Surface, SurfaceTile, Tile};
use super::{Features, PolarImage};
use kernels::images::{BORDER, Border, LANES, Planes, PlanesMut};
use pulp::{Arch, NullaryFnOnce};

/// Number of features of a model that names none.
pub const N_FEATURES: usize = 10;

/// The input image. The channels hold `fold` neighboring columns: feature f of n of column c is in channel
/// `c % fold * n + f` of column `c / fold`. Rows are padded with zeros to a multiple of `row_multiple`.
///
/// # Panics
/// If `fold` does not divide the columns.
pub fn features(image: &PolarImage, features: &Features, fold: usize, row_multiple: usize) -> Planes {
    assert!(image.columns.is_multiple_of(fold), "{} columns by {fold}", image.columns);
    let rows = image.rows.next_multiple_of(row_multiple);
    let mut planes = Planes::zeros(fold * features.len(), rows, image.columns / fold);
    write_features(image, features, &mut planes.view_mut());
    planes.fill_border(Border::Circular);
    planes
}

/// Writes the input image except its border. Its number of channels defines the number of folded columns.
pub(super) fn write_features(image: &PolarImage, features: &Features, planes: &mut PlanesMut<'_>) {
    assert!(planes.width() >= BORDER);
    if features.is_default() {
        Arch::new().dispatch(Job { image, planes: planes.view_mut() });
    } else {
        Arch::new().dispatch(NamedFeatures { image, features, planes: planes.view_mut() });
    }
    for block in 0..planes.n_blocks() {
        (image.rows..planes.height()).for_each(|row| planes.row_mut(block, row).fill([0.0; LANES]));
    }
}

struct Job<'a> {
    image: &'a PolarImage,
    planes: PlanesMut<'a>,
}

impl NullaryFnOnce for Job<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { image, mut planes } = self;
        let fold = planes.channels() / N_FEATURES;
        let surface = Surface::of(image);
        let mut of_row = vec![[0.0_f32; N_FEATURES]; image.columns.next_multiple_of(LANES)];
        for row in 0..image.rows {
            let pixels = &image.pixels[row * image.columns..][..image.columns];
            for (tile, (values, pixels)) in of_row.chunks_exact_mut(LANES).zip(pixels.chunks(LANES)).enumerate() {
                let (mut height_m, mut intensity) = ([0.0; LANES], [0.0; LANES]);
                for (i, pixel) in pixels.iter().enumerate() {
                    (height_m[i], intensity[i]) = (pixel.height_m, f32::from(pixel.intensity));
                }
                let surface = surface.tile(row, tile * LANES);
                let features = of_tile(&surface, &height_m, &intensity, image.has_intensity);
                for i in 0..LANES {
                    for feature in 0..N_FEATURES {
                        values[i][feature] = features[feature][i];
                    }
                }
            }
            write_folded(of_row[..image.columns].as_flattened(), fold * N_FEATURES, row, &mut planes);
        }
    }
}

/// Writes the features of a row. `n_channels` of them are one column of the planes.
#[inline(always)]
pub(super) fn write_folded(of_row: &[f32], n_channels: usize, row: usize, planes: &mut PlanesMut<'_>) {
    for (column, channels) in of_row.chunks_exact(n_channels).enumerate() {
        for (block, channels) in channels.chunks(LANES).enumerate() {
            planes.row_mut(block, row)[column][..channels.len()].copy_from_slice(channels);
        }
    }
}

/// The features of a model that names none.
#[inline(always)]
pub(super) fn of_tile(
    surface: &SurfaceTile,
    height_m: &Tile,
    intensity: &Tile,
    has_intensity: bool,
) -> [Tile; N_FEATURES] {
    let known = f32::from(u8::from(has_intensity));
    let (mut features, mut log_range) = ([[0.0; LANES]; N_FEATURES], [0.0; LANES]);
    // A separate loop: the logarithm of the library is not vectorized.
    for i in 0..LANES {
        log_range[i] = (1.0 + surface.range_m[i]).ln() - 2.0;
    }
    for i in 0..LANES {
        let (range_m, ray, normal) = (surface.range_m[i], &surface.ray, &surface.normal);
        let is_valid = range_m > 0.0;
        let mut set = |feature: usize, value: f32| features[feature][i] = if is_valid { value } else { 0.0 };
        let (x, y, z) = (ray[0][i] / range_m, ray[1][i] / range_m, ray[2][i] / range_m);
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
