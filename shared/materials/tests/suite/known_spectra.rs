//! Two surfaces with the same noise distribution.

use materials::{Classifier, Fit, Method, Model, Places, Smoothing, Spectra, best_row, materials_of, mean_spectra};
use messages::MaterialId;
use random::Random;

const BANDS_NM: [f32; 10] = [500.0, 540.0, 580.0, 620.0, 660.0, 700.0, 740.0, 780.0, 820.0, 860.0];
const GREEN: [f32; 10] = [0.04, 0.10, 0.06, 0.05, 0.04, 0.12, 0.30, 0.42, 0.45, 0.46];
const GRAY: [f32; 10] = [0.20, 0.21, 0.22, 0.22, 0.23, 0.23, 0.23, 0.24, 0.24, 0.24];

/// A surface in the sun or in the shade, with noise.
fn measured(truth: &[f32; 10], is_sunlit: bool, noise: f32, random: &mut Random) -> Vec<f32> {
    let light = if is_sunlit { random.range(0.5, 1.0) } else { random.range(0.05, 0.15) };
    truth.iter().map(|value| (value * light + noise * random.gauss()).max(0.0)).collect()
}

fn spectra(truths: &[&[f32; 10]], noise: f32, seed: u64) -> Spectra {
    let mut random = Random::for_stream(seed, 0);
    let mut spectra = Spectra::new(&BANDS_NM);
    for (i, truth) in truths.iter().enumerate() {
        spectra.push(0x3ff, &measured(truth, i % 2 == 0, noise, &mut random));
    }
    spectra
}

fn model(noise: f32) -> Model {
    let mut fit = Fit::new(&BANDS_NM);
    fit.add_surface("green", MaterialId::Vegetation, &GREEN);
    fit.add_surface("gray", MaterialId::Concrete, &GRAY);
    for (name, truth, seed) in [("green", &GREEN, 1), ("gray", &GRAY, 2)] {
        let spectra = spectra(&[truth; 400], noise, seed);
        (0..spectra.len()).for_each(|i| fit.add(name, i % 2 == 0, spectra.get(i)));
    }
    fit.model("test".to_owned()).expect("enough spectra")
}

/// Share of the spectra with the correct material; the first half is green.
fn accuracy(found: &[materials::Probabilities]) -> f64 {
    let n = found.len();
    let truth = |i: usize| if i < n / 2 { MaterialId::Vegetation } else { MaterialId::Concrete };
    (0..n).filter(|i| best_row(&found[*i]).material_id == truth(*i) as u8).count() as f64 / n as f64
}

#[test]
fn fitted_model_separates_its_surfaces_in_sun_and_shade() {
    let model = model(0.004);
    let truths = [[&GREEN; 200], [&GRAY; 200]].concat();
    let found = Classifier::new(&model, &BANDS_NM, Method::Learned).classify(&spectra(&truths, 0.004, 3));
    assert!(accuracy(&found) > 0.98, "{}", accuracy(&found));
    let share = |levels: std::ops::Range<usize>| model.lights[levels].iter().map(|light| light.share).sum::<f64>();
    assert!((share(0..2) - 0.5).abs() < 0.01 && (share(2..6) - 0.5).abs() < 0.01, "sun and shade are equally frequent");
    let brightness: Vec<f32> = model.lights.iter().map(|light| light.offset.iter().sum()).collect();
    assert!(brightness[..2].is_sorted() && brightness[2..].is_sorted(), "{brightness:?}");
}

#[test]
fn fit_without_shade_gives_no_model() {
    let mut fit = Fit::new(&BANDS_NM);
    fit.add_surface("green", MaterialId::Vegetation, &GREEN);
    let spectra = spectra(&[&GREEN; 100], 0.004, 1);
    (0..spectra.len()).step_by(2).for_each(|i| fit.add("green", true, spectra.get(i)));
    assert!(fit.model("test".to_owned()).is_none());
}

#[test]
fn neighbors_correct_noisy_spectra_and_their_order_does_not_matter() {
    let model = model(0.05);
    let truths = [[&GREEN; 300], [&GRAY; 300]].concat();
    let spectra = spectra(&truths, 0.05, 4);
    // Two patches that are far apart.
    let position =
        |i: usize| [(i % 300 % 20) as f32 * 0.05, (i % 300 / 20) as f32 * 0.05, if i < 300 { 0.0 } else { 9.0 }];
    let positions: Vec<[f32; 3]> = (0..600).map(position).collect();
    let classifier = Classifier::new(&model, &BANDS_NM, Method::Learned);
    // The patches are regions; one point of each has no region.
    let regions: Vec<u32> = (0..600).map(|i| if i % 300 == 0 { 0 } else { 1 + i / 300 }).collect();
    let places = Places { positions: &positions, regions: Some(&regions) };
    let alone = accuracy(&materials_of(&classifier, &spectra, places, Smoothing::Off));
    for smoothing in &Smoothing::ALL[1..] {
        let found = materials_of(&classifier, &spectra, places, *smoothing);
        let smoothed = accuracy(&found);
        assert!(smoothed > alone + 0.02, "{}: {smoothed}, alone {alone}", smoothing.name());
    }
    let whole = materials_of(&classifier, &spectra, places, Smoothing::Regions);
    assert!(whole[1..300].iter().all(|found| *found == whole[1]) && whole[0] != whole[1], "a region is one");
    assert!(accuracy(&whole) > 0.99);
    let mean = mean_spectra(&spectra, &positions);
    assert_eq!(mean.len(), 600);
    assert!(mean.valid.iter().all(|valid| *valid == 0x3ff));
}

#[test]
fn bands_between_those_of_the_model_are_interpolated() {
    let model = model(0.004);
    let nm: Vec<f32> = BANDS_NM.windows(2).map(|pair| 0.5 * (pair[0] + pair[1])).chain([2000.0]).collect();
    let between = |truth: &[f32; 10]| -> Vec<f32> {
        // The model interpolates logarithms. The light is one of the training lights.
        truth.windows(2).map(|pair| 0.75 * (pair[0] * pair[1]).sqrt()).chain([f32::NAN]).collect()
    };
    let mut spectra = Spectra::new(&nm);
    for truth in [&GREEN, &GRAY] {
        spectra.push(0x3ff, &between(truth));
    }
    let found = Classifier::new(&model, &nm, Method::Learned).classify(&spectra);
    assert_eq!(accuracy(&found), 1.0, "the band at 2000 nm is ignored");
}
