//! Regions of Gaussians.

use crate::support::photograph;
use color_lines::{ColorLinesError, Fit, Image, Model, Settings, Start};
use scores::regions::{LabelImage, shapes};

/// A chessboard of four colors with noise, 64 x 48 px, two of the fields equal in color but apart.
fn board() -> Vec<f32> {
    let mut random = random::Random::new(3);
    let colors = [[200.0, 40.0, 40.0], [40.0, 200.0, 40.0], [40.0, 40.0, 200.0], [200.0, 40.0, 40.0]];
    let mut values = vec![0.0; 3 * 64 * 48];
    for at in 0..64 * 48 {
        let field = at % 64 / 32 + 2 * (at / 64 / 24);
        (0..3).for_each(|band| values[band * 64 * 48 + at] = colors[field][band] + 4.0 * random.gauss());
    }
    values
}

fn fit(values: &[f32], settings: &Settings) -> Fit {
    Model::fit(&Image::new([64, 48], 3, values).expect("an image"), settings).expect("pixels")
}

#[test]
fn fields_of_equal_color_are_one_region_unless_coordinates_have_a_weight() {
    let values = board();
    let at = |x: usize, y: usize| y * 64 + x;
    let of = |spatial_weight| {
        let settings =
            Settings { start: Start::Count(4), bins: 8, spatial_weight, hemispheres: 1, ..Settings::default() };
        let labels = fit(&values, &settings).labels;
        [at(10, 10), at(50, 10), at(10, 40), at(50, 40)].map(|pixel| labels[pixel])
    };
    let [red, green, blue, other_red] = of(0.0);
    assert!(red == other_red && red != green && green != blue && blue != red);
    let [red, .., other_red] = of(2.0);
    assert_ne!(red, other_red);
}

#[test]
fn invalid_pixels_have_no_region_and_change_nothing_else() {
    let mut values = board();
    values[100] = f32::NAN;
    values[64 * 48 + 200] = f32::INFINITY;
    let found = fit(&values, &Settings::default());
    let zeros: Vec<usize> = (0..64 * 48).filter(|at| found.labels[*at] == 0).collect();
    assert_eq!(zeros, [100, 200]);
    let image = Image::new([64, 48], 3, &values).expect("an image");
    let projection = found.model.projected(&image, 3).expect("the image");
    let simplified = found.model.simplified(&image, &found.labels).expect("the image");
    for at in zeros {
        assert!(projection.values[at].is_nan() && simplified[at].is_nan() && projection.lines[at] == 0);
    }
    assert_eq!(found.model.labels(&image).expect("the image"), found.labels);
    assert_eq!(found.model.regions.iter().map(|region| region.n_pixels).sum::<u64>(), 64 * 48 - 2);
}

#[test]
fn image_without_valid_pixels_or_with_wrong_settings_is_refused() {
    let nothing = vec![f32::NAN; 3 * 64 * 48];
    let image = Image::new([64, 48], 3, &nothing).expect("an image");
    assert!(matches!(Model::fit(&image, &Settings::default()), Err(ColorLinesError::Empty)));
    let values = board();
    let image = Image::new([64, 48], 3, &values).expect("an image");
    for settings in [
        Settings { hemispheres: 0, ..Settings::default() },
        Settings { bins: 1, ..Settings::default() },
        Settings { spatial_weight: f64::NAN, ..Settings::default() },
        Settings { start: Start::KMeans(5, 1), ..Settings::default() },
    ] {
        assert!(matches!(Model::fit(&image, &settings), Err(ColorLinesError::Setting { .. })), "{settings:?}");
    }
    assert!(matches!(Image::new([64, 48], 3, &values[1..]), Err(ColorLinesError::Length { .. })));
}

#[test]
fn equal_flat_and_tiny_images_have_a_model() {
    for (size, values) in
        [([1, 1], vec![7.0; 3]), ([8, 8], vec![7.0; 192]), ([2, 1], vec![0.0, 9.0, 0.0, 0.0, 0.0, 0.0])]
    {
        for start in [Start::Contrast(3.0), Start::Count(150)] {
            for spatial_weight in [0.0, 1.0] {
                let image = Image::new(size, 3, &values).expect("an image");
                let settings = Settings { start, spatial_weight, ..Settings::default() };
                let found = Model::fit(&image, &settings).expect("pixels");
                assert_eq!(found.labels.len(), size[0] * size[1]);
                assert!(found.labels.iter().all(|label| (1..=found.model.regions.len() as u32).contains(label)));
                let spectra = found.model.spectra();
                assert_eq!(spectra.len(), found.model.regions.len());
                assert!(spectra.iter().all(|spectrum| spectrum.len() == 3), "{spectra:?}");
                assert!(spectra.iter().flatten().all(|value| value.is_finite()), "{spectra:?}");
            }
        }
    }
}

#[real_data::test("images/coffee.png")]
fn regions_do_not_depend_on_threads_and_become_compact_with_spatial_weight() {
    let (values, size) = photograph("images/coffee.png");
    let image = Image::new(size, 3, &values).expect("an image");
    let of = |spatial_weight, threads| {
        let settings = Settings { start: Start::Count(100), spatial_weight, ..Settings::default() };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| Model::fit(&image, &settings).expect("pixels"))
    };
    let one = of(0.5, 1);
    let two = of(0.5, 2);
    assert_eq!((&one.labels, &one.model), (&two.labels, &two.model));
    let extent = |fit: &Fit| shapes(&LabelImage::new(size[0], &fit.labels).expect("an image")).extent;
    let extents = [of(0.0, 1), one, of(1.0, 1)].map(|fit| extent(&fit));
    assert!(extents[2] > 1.5 * extents[0].max(extents[1]), "{extents:?}");
}

#[real_data::test("photonfocus/frame_02245_nir.tif")]
fn unconstrained_pixels_of_a_real_cube_are_closer_than_constrained_ones() {
    let cube = formats::band_image::read(&real_data::path("photonfocus/frame_02245_nir.tif")).expect("a cube");
    let image = Image::new(cube.size, cube.n_bands, &cube.values).expect("an image");
    let psnr = |constrained, start, hemispheres| {
        let found =
            Model::fit(&image, &Settings { constrained, start, hemispheres, ..Settings::default() }).expect("pixels");
        let simplified = found.model.simplified(&image, &found.labels).expect("the image");
        scores::fidelity(&cube.values, &simplified, 25, 255.0).expect("pixels").psnr_db
    };
    let constrained = psnr(true, Start::Count(60), 10);
    let free = psnr(false, Start::Count(60), 10);
    assert!(free > constrained && constrained > 28.0, "{constrained} {free} dB");
    let k_means = psnr(false, Start::KMeans(60, 1), 1);
    assert!((25.0..free + 1.0).contains(&k_means), "{k_means} dB");
}
