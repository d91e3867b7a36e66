//! Input features of a model that names its features. This code is slower than [`super::features`], whose number of
//! features is constant.

#![allow(
    clippy::needless_range_loop,
    reason = "loops over constant bounds become vector instructions; iterators and calls in between do not"
)]

use super::feature::{Feature, Features, N_FEATURES};
use super::feature_tiles::{default_features, write_folded};
use super::polar_image::PolarImage;
use super::surface::{Surface, SurfaceTile, Tile};
use kernels::images::{LANES, PlanesMut};
use pulp::NullaryFnOnce;
use std::ops::Range;

/// Writes the input image except its border.
pub(super) struct NamedFeatures<'a> {
    pub(super) image: &'a PolarImage,
    pub(super) features: &'a Features,
    pub(super) planes: PlanesMut<'a>,
}

/// Source of the values of a feature.
#[derive(Clone, Copy)]
enum Source {
    /// Default feature with this index.
    Usual(usize),
    /// LiDAR feature that is not a default feature.
    Further(Feature),
    /// Camera measurement with this index.
    Camera(usize),
    /// Whether the camera measurement is known.
    HasCamera(usize),
}

impl NullaryFnOnce for NamedFeatures<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { image, features, mut planes } = self;
        let n = features.len();
        let sources = sources(features);
        let surface = Surface::from_image(image);
        let mut of_row = vec![0.0_f32; n * image.columns.next_multiple_of(LANES)];
        for row in 0..image.rows {
            let first = row * image.columns;
            let pixels = &image.pixels[first..][..image.columns];
            for (tile, (values, pixels)) in of_row.chunks_exact_mut(n * LANES).zip(pixels.chunks(LANES)).enumerate() {
                let mut height_m = [0.0; LANES];
                let mut intensity = [0.0; LANES];
                for (i, pixel) in pixels.iter().enumerate() {
                    (height_m[i], intensity[i]) = (pixel.height_m, f32::from(pixel.intensity));
                }
                let surface = surface.tile(row, tile * LANES);
                let usual = default_features(&surface, &height_m, &intensity, image.has_intensity);
                for (feature, source) in sources.iter().enumerate() {
                    let pixels = first + tile * LANES..first + tile * LANES + pixels.len();
                    let of_feature = match *source {
                        Source::Usual(number) => usual[number],
                        Source::Further(feature) => further(feature, &surface),
                        Source::Camera(number) => camera(image, pixels, &surface.range_m, number, |value| value),
                        Source::HasCamera(number) => camera(image, pixels, &surface.range_m, number, |_| 1.0),
                    };
                    for i in 0..LANES {
                        values[i * n + feature] = of_feature[i];
                    }
                }
            }
            let n_channels = planes.channels();
            write_folded(&of_row[..n * image.columns], n_channels, row, &mut planes);
        }
    }
}

fn sources(features: &Features) -> Vec<Source> {
    let usual = Features::default();
    let bands = features.camera_bands();
    let source = |feature: &Feature| {
        let band = feature.camera_band().and_then(|band| bands.iter().position(|of| *of == band));
        match (band, usual.as_slice().iter().position(|of| of == feature)) {
            (Some(band), _) if matches!(feature, Feature::HasColor | Feature::HasBand(_)) => Source::HasCamera(band),
            (Some(band), _) => Source::Camera(band),
            (None, Some(number)) if number < N_FEATURES => Source::Usual(number),
            _ => Source::Further(*feature),
        }
    };
    features.as_slice().iter().map(source).collect()
}

/// LiDAR features that are not default features.
#[inline(always)]
fn further(feature: Feature, surface: &SurfaceTile) -> Tile {
    let mut values = [0.0; LANES];
    for i in 0..LANES {
        let range_m = surface.range_m[i];
        let ray = &surface.ray;
        let normal = &surface.normal;
        if range_m <= 0.0 {
            continue;
        }
        let flat_m = (ray[0][i] * ray[0][i] + ray[1][i] * ray[1][i]).sqrt().max(1e-6);
        let x = ray[0][i] / flat_m;
        let y = ray[1][i] / flat_m;
        values[i] = match feature {
            Feature::NormalX => x * normal[0][i] + y * normal[1][i],
            Feature::NormalY => x * normal[1][i] - y * normal[0][i],
            Feature::Depth => (range_m / 50.0).min(3.0),
            Feature::Z => (ray[2][i] / 10.0).clamp(-3.0, 3.0),
            _ => 0.0,
        };
    }
    values
}

/// A camera measurement at up to 16 pixels; 0 if it is unknown or there is no point.
#[inline(always)]
fn camera(image: &PolarImage, pixels: Range<usize>, range_m: &Tile, number: usize, value: impl Fn(f32) -> f32) -> Tile {
    let mut values = [0.0; LANES];
    let n = image.n_camera_bands();
    if n == 0 {
        return values;
    }
    let of_pixels = image.camera[pixels.start * n..pixels.end * n].chunks_exact(n);
    for ((found, of_pixel), range_m) in values.iter_mut().zip(of_pixels).zip(range_m) {
        if *range_m > 0.0 && !of_pixel[number].is_nan() {
            *found = value(of_pixel[number]);
        }
    }
    values
}
