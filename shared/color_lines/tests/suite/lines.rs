//! Color lines.

use crate::support::{photograph, psnr};
use color_lines::{ColorLinesError, Image, Model, Settings, StraightLines, project_onto_straight_lines};

/// An image of `n_bands` whose pixels lie on two bent lines from the origin: (t, 0.3 t², ...) and (0.3 t², t, ...).
fn bent_lines(n_bands: usize) -> Vec<f32> {
    let value = |band: usize, at: usize| {
        let t = (at / 2) as f32 / 1250.0;
        200.0 * if at % 2 == band % 2 { t } else { 0.3 * t * t }
    };
    (0..n_bands).flat_map(|band| (0..2500).map(move |at| value(band, at))).collect()
}

#[test]
fn two_bent_lines_of_any_number_of_bands_are_found() {
    for n_bands in [2, 3, 12, 36] {
        let values = bent_lines(n_bands);
        let image = Image::new([50, 50], n_bands, &values).expect("an image");
        let fit = Model::fit(&image, &Settings::default()).expect("pixels");
        let of_lines = |n_lines| psnr(&image, &values, &fit.model.projected(&image, n_lines).expect("the image"));
        assert!(
            of_lines(2) > 34.0 && of_lines(2) > of_lines(1) + 8.0,
            "{n_bands} bands: {} {}",
            of_lines(2),
            of_lines(1)
        );
        assert_eq!(fit.model.lines[0].nodes[0], 0, "the first line starts at the origin");
    }
}

#[real_data::test("images/astronaut.png", "images/coffee.png")]
fn four_lines_of_photographs_are_above_30_db_and_beat_straight_lines() {
    for name in ["images/astronaut.png", "images/coffee.png"] {
        let (values, size) = photograph(name);
        let image = Image::new(size, 3, &values).expect("an image");
        let model = Model::fit(&image, &Settings::default()).expect("pixels").model;
        for n_lines in [4, 5] {
            let graph = psnr(&image, &values, &model.projected(&image, n_lines).expect("the image"));
            let straight = |method| project_onto_straight_lines(&image, n_lines, method).expect("three bands");
            let frequent = psnr(&image, &values, &straight(StraightLines::Frequent));
            let refined = psnr(&image, &values, &straight(StraightLines::Refined));
            assert!(graph > 32.0, "{name}, {n_lines} lines: {graph} dB");
            assert!(graph > frequent + 4.0 && graph > refined + 1.0, "{name}: {graph} {frequent} {refined} dB");
        }
    }
}

#[test]
fn model_survives_its_file_and_projects_another_image() {
    let values = bent_lines(3);
    let image = Image::new([50, 50], 3, &values).expect("an image");
    let model = Model::fit(&image, &Settings::default()).expect("pixels").model;
    let read: Model = serde_json::from_str(&serde_json::to_string(&model).expect("JSON")).expect("a model");
    read.check().expect("consistent");
    let darker: Vec<f32> = values.iter().map(|value| 0.5 * value).collect();
    let other = Image::new([50, 50], 3, &darker).expect("an image");
    let projection = |model: &Model| psnr(&other, &darker, &model.projected(&other, 2).expect("three bands"));
    assert!((projection(&read) - projection(&model)).abs() < 1e-6);
    // The lines are bent, so half of a color is only near the lines, not on them.
    assert!((20.0..40.0).contains(&projection(&model)), "{}", projection(&model));
    let gray = Image::new([50, 50], 1, &values[..2500]).expect("an image");
    assert_eq!(model.projected(&gray, 2), Err(ColorLinesError::Bands { found: 1, expected: 3 }));
}

#[test]
fn model_file_of_unknown_nodes_is_refused() {
    let values = bent_lines(3);
    let image = Image::new([50, 50], 3, &values).expect("an image");
    let model = Model::fit(&image, &Settings::default()).expect("pixels").model;
    let mut changed = model.clone();
    changed.lines[0].nodes.push(model.regions.len() + 1);
    assert!(matches!(changed.check(), Err(ColorLinesError::Model(_))));
    let mut changed = model.clone();
    changed.regions[0].spectrum.pop();
    assert!(matches!(changed.check(), Err(ColorLinesError::Model(_))));
    let mut changed = model.clone();
    changed.regions[0].gaussian.covariance[0] = -1.0;
    assert!(matches!(changed.check(), Err(ColorLinesError::Model(_))));
    assert_eq!(model.check(), Ok(()));
}
