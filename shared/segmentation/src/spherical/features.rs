//! Input features of the network.

#![allow(
    clippy::needless_range_loop,
    reason = "loops over constant bounds become vector instructions; iterators and calls in between do not"
)]

use super::feature::{Features, N_FEATURES};
use super::feature_tiles::{default_features, write_folded};
use super::named_features::NamedFeatures;
use super::polar_image::PolarImage;
use super::surface::Surface;
use kernels::images::{BORDER, Border, LANES, Planes, PlanesMut};
use pulp::{Arch, NullaryFnOnce};

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
        let surface = Surface::from_image(image);
        let mut of_row = vec![[0.0_f32; N_FEATURES]; image.columns.next_multiple_of(LANES)];
        for row in 0..image.rows {
            let pixels = &image.pixels[row * image.columns..][..image.columns];
            for (tile, (values, pixels)) in of_row.chunks_exact_mut(LANES).zip(pixels.chunks(LANES)).enumerate() {
                let mut height_m = [0.0; LANES];
                let mut intensity = [0.0; LANES];
                for (i, pixel) in pixels.iter().enumerate() {
                    (height_m[i], intensity[i]) = (pixel.height_m, f32::from(pixel.intensity));
                }
                let surface = surface.tile(row, tile * LANES);
                let features = default_features(&surface, &height_m, &intensity, image.has_intensity);
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
