//! Images for tests.

use color_lines::{Image, Projection, band_sequential};

/// Values, columns and rows of a color image of the data folder.
pub fn photograph(name: &str) -> (Vec<f32>, [usize; 2]) {
    let image = image::open(real_data::path(name)).expect("an image").to_rgb8();
    (band_sequential(image.as_raw(), 3), [image.width() as usize, image.height() as usize])
}

/// PSNR of a projection, dB; the peak is 255.
pub fn psnr(image: &Image<'_>, values: &[f32], projection: &Projection) -> f64 {
    scores::fidelity(values, &projection.values, image.n_bands(), 255.0).expect("pixels").psnr_db
}
