//! What the network sees of a pixel.

use super::elementary::tanh;
use super::surface::Surface;
use super::{PolarImage, PolarPixel};
use crate::engine::{BORDER, Border, LANES, Planes};

/// Names of the features, in order. All are about -1 to 3.
///
/// | feature | is |
/// |---|---|
/// | `valid` | 1 where there is a point; all others are 0 elsewhere |
/// | `range` | ln(1 + range / m) - 2 |
/// | `height_fine` | tanh(height above the ground / 0.3 m): kerbs |
/// | `height_coarse` | height above the ground / 4 m, -1 to 3 |
/// | `normal_up` | z of the unit normal; 0 where there is none |
/// | `incidence` | cosine of ray and normal, 0 to 1; 0 where there is none |
/// | `elevation` | sine of the ray's elevation |
/// | `roughness` | tanh(distance from the line between the neighbors in the row / 0.1 m) |
/// | `intensity` | return strength / 50; 0 where unknown |
/// | `has_intensity` | 1 where it is known |
pub const FEATURES: [&str; N_FEATURES] = [
    "valid",
    "range",
    "height_fine",
    "height_coarse",
    "normal_up",
    "incidence",
    "elevation",
    "roughness",
    "intensity",
    "has_intensity",
];

/// How many there are.
pub const N_FEATURES: usize = 10;

/// The input image: `fold` neighboring columns side by side in the channels, feature f of column c in channel
/// `c % fold * N_FEATURES + f` of column `c / fold`. Rows are filled up with nothing to a multiple of `row_multiple`.
///
/// # Panics
/// If `fold` does not divide the columns.
pub fn features(image: &PolarImage, fold: usize, row_multiple: usize) -> Planes {
    assert!(image.columns.is_multiple_of(fold), "{} columns by {fold}", image.columns);
    let width = image.columns / fold;
    assert!(width >= BORDER);
    let mut planes = Planes::zeros(fold * N_FEATURES, image.rows.next_multiple_of(row_multiple), width);
    let surface = Surface::of(image);
    let mut of_row = vec![[0.0_f32; N_FEATURES]; image.columns];
    for row in 0..image.rows {
        for (column, (values, pixel)) in
            of_row.iter_mut().zip(&image.pixels[row * image.columns..][..image.columns]).enumerate()
        {
            *values = if pixel.is_valid() { of_pixel(&surface, image, pixel, row, column) } else { [0.0; N_FEATURES] };
        }
        for (column, folded) in of_row.chunks_exact(fold).enumerate() {
            for (channel, value) in folded.as_flattened().iter().enumerate() {
                planes.row_mut(channel / LANES, row)[column][channel % LANES] = *value;
            }
        }
    }
    planes.fill_border(Border::Circular);
    planes
}

fn of_pixel(
    surface: &Surface<'_>,
    image: &PolarImage,
    pixel: &PolarPixel,
    row: usize,
    column: usize,
) -> [f32; N_FEATURES] {
    let range_m = surface.range_m(row, column);
    let ray = pixel.ray.map(|v| v / range_m);
    let normal = surface.normal(row, column).unwrap_or_default();
    let incidence = -(ray[0] * normal[0] + ray[1] * normal[1] + ray[2] * normal[2]);
    // An edge of what is seen is as rough as can be.
    let roughness_m = surface.roughness_m(row, column).unwrap_or(1.0);
    let known = f32::from(u8::from(image.has_intensity));
    [
        1.0,
        (1.0 + range_m).ln() - 2.0,
        tanh(pixel.height_m / 0.3),
        (pixel.height_m / 4.0).clamp(-1.0, 3.0),
        normal[2],
        incidence,
        ray[2],
        tanh(roughness_m / 0.1),
        known * f32::from(pixel.intensity) / 50.0,
        known,
    ]
}
