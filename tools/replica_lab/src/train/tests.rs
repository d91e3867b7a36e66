//! Colors, spectra, removed classes and starts from other models in whole data sets and trainings.

use super::camera_columns::CameraColumns;
use super::point_dataset::PointDataset;
use super::recipe::{AnyRecipe, Recipe};
use super::recipe_data::RecordingSource;
use super::sweep_dataset::SweepDataset;
use super::test_recordings::{submaps, write_recording};
use super::{Args, TrainingData, TrainingRecipe, run};
use messages::{ColorRow, SpectraHeader, UNSEEN};
use segmentation::ComputeDevice;
use segmentation::network::{WeightTensor, Weights};
use segmentation::spherical::SphericalModel;
use std::path::{Path, PathBuf};
use training::{Dataset, Network, UNKNOWN};

/// One submap of one sweep for training, another one for validation.
const TOWNS: &str = "towns = ['urban']\nseeds = { first = 1, last = 1 }\nvalidation_seeds = { first = 2, last = 2 }\n\
                     seconds = 2.0\nsubmaps = 1\nsweeps = 1\nstride = 1";
const CLASSES: &str = "['road', 'building', 'vegetation']";

/// A small U-Net.
fn recipe_text(classes: &str, model: &str, data: &str) -> String {
    format!(
        "[model]\nkind = 'unet'\nwidths = [8, 8]\ncolumns = 512\nfold = 2\nclasses = {classes}\nvote_cell_m = 0.2\n{model}\n\
         [data]\nwithout_intensity = 0.0\n{data}\n[augmentation]\ncolor_dropout = 0.5\n[train]\nseed = 1\nepochs = 1\nbatch = 1\n\
         learning_rate = 0.001\npatience = 1\nloss = {{ kind = 'cross_entropy' }}\n"
    )
}

fn recipe(classes: &str, model: &str, data: &str) -> Recipe {
    toml::from_str(&recipe_text(classes, model, data)).expect("a recipe")
}

fn clouds() -> RecordingSource {
    RecordingSource {
        file: "clouds.mcap".into(),
        drive: None,
        predicted_above: None,
        validation: false,
        weight: 1.0,
        every: 1,
    }
}

/// Trains in a folder, and returns the path of the model.
fn train(folder: &Path, name: &str, text: &str) -> PathBuf {
    let recipe = folder.join(format!("{name}.toml"));
    std::fs::write(&recipe, text).expect("writes");
    let out = folder.join(name);
    run(&Args { recipe, out: out.clone(), stop_after: None, device: ComputeDevice::Cpu }).expect("trains");
    out.join("model.safetensors")
}

/// Each third point has no color and no spectrum.
fn columns_of(n_points: usize) -> CameraColumns {
    let color =
        |point: usize| ColorRow { r: 51, g: 102, b: 204, camera: if point.is_multiple_of(3) { UNSEEN } else { 0 } };
    let mut header =
        Box::new(SpectraHeader { n_points: n_points as u32, n_spectra: 1, n_bands: 2, ..SpectraHeader::default() });
    header.wavelengths_nm[..2].copy_from_slice(&[640.0, 790.0]);
    let mut rows: Vec<u32> = (0..n_points).map(|point| if point.is_multiple_of(3) { u32::MAX } else { 0 }).collect();
    rows.extend([0b11, 0, 0.25_f32.to_bits(), 0.75_f32.to_bits()]);
    CameraColumns { colors: Some((0..n_points).map(color).collect()), spectra: Some((header, rows)) }
}

#[test]
fn recorded_colors_and_spectra_come_into_the_images() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let submaps = submaps();
    let columns: Vec<CameraColumns> = submaps.iter().map(|submap| columns_of(submap.points.len())).collect();
    write_recording(&folder.path().join("clouds.mcap"), &submaps, "imported", &columns);
    let recipe = recipe(CLASSES, "features = ['valid', 'blue', 'red', 'band_650', 'band_800']", "");
    let mut data = SweepDataset::new(&recipe, folder.path()).expect("a file");
    data.add_recording(&clouds(), folder.path()).expect("read");
    assert_eq!(data.n_sweeps(), 6);
    let image = data.image(3);
    let mut n_known = 0;
    let mut n_unknown = 0;
    for (pixel, values) in image.pixels.iter().zip(image.camera.as_chunks::<4>().0) {
        if !pixel.is_valid() {
            assert!(values.iter().all(|value| value.is_nan()));
        } else if values[0].is_nan() {
            n_unknown += 1;
        } else {
            assert_eq!(*values, [0.8, 0.2, 0.25, 0.75]);
            n_known += 1;
        }
    }
    assert!(n_known > 1000 && (n_known / 3..n_known).contains(&n_unknown), "{n_known} {n_unknown}");
}

#[test]
fn recording_without_a_needed_column_is_refused_with_topic_and_feature() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let submaps = submaps();
    let columns: Vec<CameraColumns> =
        submaps.iter().map(|submap| CameraColumns { spectra: None, ..columns_of(submap.points.len()) }).collect();
    let path = folder.path().join("clouds.mcap");
    let error = |features: &str| {
        let recipe = recipe(CLASSES, &format!("features = {features}"), "");
        let mut data = SweepDataset::new(&recipe, folder.path()).expect("a file");
        format!("{:#}", data.add_recording(&clouds(), folder.path()).expect_err("is refused"))
    };
    write_recording(&path, &submaps, "imported", &[]);
    let found = error("['valid', 'has_color']");
    assert!(found.contains("clouds.mcap: has no topic `color`, and the feature has_color of the recipe"), "{found}");
    write_recording(&path, &submaps, "imported", &columns);
    let found = error("['red', 'band_650']");
    assert!(found.contains("has no topic `spectra`, and the feature band_650 of the recipe needs it"), "{found}");
    let columns: Vec<CameraColumns> = submaps.iter().map(|submap| columns_of(submap.points.len())).collect();
    write_recording(&path, &submaps, "imported", &columns);
    let found = error("['band_650', 'band_900']");
    assert!(found.contains("clouds.mcap: its spectra have no band near the one of the feature band_900"), "{found}");
}

#[test]
fn recorded_colors_come_into_the_points() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let submaps = submaps();
    let columns: Vec<CameraColumns> = submaps.iter().map(|submap| columns_of(submap.points.len())).collect();
    write_recording(&folder.path().join("clouds.mcap"), &submaps, "imported", &columns);
    let text = "[model]\nkind = 'pointnet2'\nnetwork = { abstractions = [{ centers = 16, scales = [{ radius_m = 1.0, neighbors = 8, \
                widths = [8] }] }], propagations = [[8]], dropout = 0.0 }\nclasses = ['road']\nfeatures = ['color_height']\ncell_m = 0.5\n\
                radius_m = 5.0\n[data]\nwithout_intensity = 0.0\nremoved_classes = ['building']\nseeds = { first = 1, last = 1 }\n\
                validation_seeds = { first = 2, last = 2 }\ntowns = ['urban']\n[train]\nseed = 1\nepochs = 1\nbatch = 1\n\
                learning_rate = 0.01\npatience = 1\nloss = { kind = 'cross_entropy' }\n";
    let path = folder.path().join("recipe.toml");
    std::fs::write(&path, text).expect("writes");
    let AnyRecipe::Points(recipe) = AnyRecipe::load(&path).expect("a recipe") else { panic!("one of points") };
    let mut data = PointDataset::new(&recipe, folder.path(), false).expect("a file");
    data.add_recording(&clouds(), folder.path()).expect("read");
    // Colors of some spheres are dropped.
    let has_color = |index: usize| {
        let features = data.example(index, None).features;
        features.as_chunks::<4>().0.iter().any(|[red, ..]| *red > 0.1)
    };
    let n_colored = (0..20).filter(|index| has_color(*index)).count();
    assert!((10..20).contains(&n_colored), "{n_colored} of 20 spheres");
    let example = data.example(0, None);
    // The truth of the other points is unknown, and there are no buildings.
    let n_road: usize = example.truth.iter().map(|class| usize::from(*class == 0)).sum();
    assert!(n_road > 10 && n_road < example.truth.len());
}

#[test]
fn simulated_towns_have_colors_and_reflectances() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    // A drive with a perfect LiDAR: points of other units are displaced from the surfaces that their rays hit.
    let towns = TOWNS.replace("first = 1, last = 1", "first = 3, last = 3");
    let recipe = recipe(CLASSES, "features = ['valid', 'red', 'green', 'band_670', 'band_800']", &towns);
    let mut data = SweepDataset::new(&recipe, folder.path()).expect("a file");
    data.add_towns(&recipe.data, recipe.data.seeds.expect("seeds"), &mut |_, _| ()).expect("simulated");
    let image = data.image(0);
    let truth = data.example(0, None).truth;
    let shown = || image.pixels.iter().zip(image.camera.as_chunks::<4>().0).zip(&truth);
    let n_valid = shown().filter(|((pixel, _), _)| pixel.is_valid()).count();
    let n_known = shown().filter(|((_, values), _)| !values[0].is_nan() && !values[3].is_nan()).count();
    assert!(n_valid > 1000 && n_known * 10 > n_valid * 9, "{n_known} of {n_valid}");
    let plants: Vec<&[f32; 4]> = shown().filter(|(_, class)| **class == 2).map(|((_, values), _)| values).collect();
    let n_known = plants.iter().filter(|[red, ..]| !red.is_nan()).count();
    assert!(plants.len() > 20 && n_known * 10 > plants.len() * 8, "{n_known} of {} plants", plants.len());
    let brighter = plants.iter().filter(|[.., red, infrared]| infrared > &(2.0 * red)).count();
    assert!(brighter * 2 > n_known, "{brighter} of {n_known} plants");
}

#[test]
fn removed_classes_are_absent_from_the_images() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    write_recording(&folder.path().join("clouds.mcap"), &submaps(), "imported", &[]);
    let images = |data: &str| {
        let mut images = SweepDataset::new(&recipe("['building', 'pole']", "", data), folder.path()).expect("a file");
        images.add_recording(&clouds(), folder.path()).expect("read");
        images.finish();
        let counts = images.counts().to_vec();
        let n_valid: usize = (0..images.n_sweeps())
            .map(|index| images.image(index).pixels.iter().filter(|pixel| pixel.is_valid()).count())
            .sum();
        (n_valid, counts, images.ground_intensities())
    };
    let (n_all, all, ground) = images("");
    let (n_left, left, no_ground) = images("removed_classes = ['road', 'road-line', 'sidewalk', 'ground', 'terrain']");
    assert!(n_left * 4 < n_all * 3, "{n_left} of {n_all} pixels");
    // A pixel shows the nearest point: where ground was in front, there may be a building now.
    assert!(left[0] >= all[0] && left[1] >= all[1] && all[0] > 1000, "{all:?} {left:?}");
    assert!(ground.is_some() && no_ground.is_none());
}

#[test]
fn training_with_colors_gives_a_model_that_reads_colors() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let model = "features = ['valid', 'depth', 'red', 'green', 'blue', 'has_color']";
    let path = train(folder.path(), "color", &recipe_text(CLASSES, model, TOWNS));
    let asked = segmentation::asked_columns(&path).expect("a model");
    assert!(asked.color && asked.wavelengths_nm.is_empty());
    segmentation::load(&path, &segmentation::Options::default()).expect("loads");
}

/// Weights of an output of the last layer.
fn row(weights: &Weights, row: usize) -> &[f32] {
    let WeightTensor { shape, values } = &weights.tensors["classes.weight"];
    &values[row * shape[1]..(row + 1) * shape[1]]
}

#[test]
fn training_from_a_model_with_other_classes_starts_with_the_outputs_of_the_same_names() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = train(folder.path(), "first", &recipe_text(CLASSES, "", TOWNS));
    let first = SphericalModel::load(&path).expect("loads").weights;
    let start = |classes: &str| {
        let recipe = recipe(classes, "start = 'first/model.safetensors'", TOWNS);
        recipe.network(folder.path(), ComputeDevice::Cpu).expect("a network").weights().expect("weights")
    };
    let is_near = |a: &[f32], b: &[f32]| {
        a.len() == b.len() && !a.is_empty() && a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-4)
    };
    // The same number of classes: the shapes are equal.
    let second = start("['vegetation', 'pole', 'road']");
    for column in 0..2 {
        let [vegetation, pole, road] = [0, 1, 2].map(|class| row(&second, 3 * column + class));
        assert!(is_near(vegetation, row(&first, 3 * column + 2)) && is_near(road, row(&first, 3 * column)));
        assert!((0..6).all(|output| !is_near(pole, row(&first, output))));
    }
    let third = start("['building', 'pole', 'fence', 'road']");
    assert!(is_near(row(&third, 4), row(&first, 4)) && is_near(row(&third, 3), row(&first, 0)));
}

#[test]
fn model_has_the_temperature_of_the_recipe() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = train(folder.path(), "fixed", &recipe_text(CLASSES, "temperature = 2.5", TOWNS));
    let temperature = SphericalModel::load(&path).expect("loads").model.settings().temperature;
    assert!((temperature - 2.5).abs() < 1e-6, "{temperature}");
}

#[test]
#[ignore = "long: .ci/run --nightly"]
fn model_is_a_mean_of_the_weights_before_and_after_training() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let weights = |name: &str, model: &str| {
        let path = train(folder.path(), name, &recipe_text(CLASSES, model, TOWNS));
        SphericalModel::load(&path).expect("loads").weights
    };
    let start = weights("start", "");
    let after = weights("after", "start = 'start/model.safetensors'");
    assert!(after != start, "training changes weights");
    let is_near = |found: &Weights, share: f32| {
        let expected = after.mixed_with(&start, share);
        let mut pairs =
            found.tensors.iter().flat_map(|(name, of)| of.values.iter().zip(&expected.tensors[name].values));
        pairs.all(|(a, b)| (a - b).abs() < 1e-6)
    };
    let mean = weights("mean", "start = 'start/model.safetensors'\nstart_share = 0.25");
    assert!(is_near(&mean, 0.25) && !is_near(&mean, 0.0) && !is_near(&mean, 1.0));
    let same = weights("same", "start = 'start/model.safetensors'\nstart_share = 1.0");
    assert!(is_near(&same, 1.0) && !is_near(&same, 0.25));
}

#[test]
fn dropout_of_colors_changes_training_examples_and_no_others() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let recipe = recipe(CLASSES, "features = ['has_color']", TOWNS);
    let mut data = SweepDataset::new(&recipe, folder.path()).expect("a file");
    data.add_towns(&recipe.data, recipe.data.seeds.expect("seeds"), &mut |_, _| ()).expect("simulated");
    let has_color = |random: Option<&mut random::Random>| {
        let input = data.example(0, random).input;
        (0..input.height()).any(|row| input.row(0, row).iter().any(|pixel| pixel[0] > 0.0))
    };
    assert!(has_color(None));
    let n = (0..40).filter(|seed| has_color(Some(&mut random::Random::new(*seed)))).count();
    assert!((8..32).contains(&n), "{n} of 40 with colors, expected 20");
}

#[test]
fn sparse_views_and_labels_of_cells_are_added_to_unchanged_training_examples() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    write_recording(&folder.path().join("clouds.mcap"), &submaps(), "imported", &[]);
    let dataset = |train: &str| {
        let text = recipe_text(CLASSES, "", TOWNS).replace("[train]", &format!("[train]\n{train}"));
        let recipe: Recipe = toml::from_str(&text).expect("a recipe");
        let mut data = SweepDataset::new(&recipe, folder.path()).expect("a file");
        data.add_recording(&clouds(), folder.path()).expect("read");
        data
    };
    let plain = dataset("");
    let both = dataset("consistency = 1.0\nbev_head = 0.5");
    for index in 0..plain.len() {
        let random = || random::Random::new(index as u64);
        let off = plain.example(index, Some(&mut random()));
        let on = both.example(index, Some(&mut random()));
        assert!(off.input == on.input && off.truth == on.truth && off.sparse_view.is_none() && off.bev.is_none());
        let sparse = on.sparse_view.expect("a sparse view");
        let bev = on.bev.expect("labels");
        assert_eq!(bev.cells.len(), on.truth.len());
        // Pixels are within both views.
        let n_sparse = sparse.input.height() * sparse.input.width() * 2;
        assert!(sparse.pixels.len() > 500, "{}", sparse.pixels.len());
        assert!(sparse.pixels.iter().all(|[of, full]| (*of as usize) < n_sparse && (*full as usize) < on.truth.len()));
        // The label of a cell is the label of pixels in it.
        let has_class = |cell: usize, class: u8| {
            let mut pixels = bev.cells.iter().zip(&on.truth);
            pixels.any(|(of, truth)| *of as usize == cell && *truth == class)
        };
        let labeled: Vec<(usize, u8)> =
            bev.truth.iter().copied().enumerate().filter(|(_, class)| *class != UNKNOWN).collect();
        assert!(labeled.len() > 100 && labeled.iter().all(|(cell, class)| has_class(*cell, *class)));
    }
    let validation = both.example(0, None);
    assert!(validation.sparse_view.is_none() && validation.bev.is_none());
}

#[test]
fn training_with_consistency_and_bev_head_gives_a_model_without_the_head() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let weights = |name: &str, terms: &str| {
        let text = recipe_text(CLASSES, "", TOWNS).replace("[train]", &format!("[train]\n{terms}"));
        SphericalModel::load(&train(folder.path(), name, &text)).expect("loads").weights
    };
    let off = weights("off", "");
    let on = weights("on", "consistency = 1.0\nbev_head = 0.5");
    assert!(off != on && off.tensors.keys().eq(on.tensors.keys()));
}

#[test]
fn terms_that_a_network_does_not_have_are_refused() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("recipe.toml");
    let error = |text: &str, train: &str| {
        std::fs::write(&path, text.replace("[train]", &format!("[train]\n{train}"))).expect("writes");
        format!("{:#}", AnyRecipe::load(&path).err().expect("is refused"))
    };
    let spherical_dz = recipe_text(CLASSES, "", TOWNS).replace("'unet'", "'spherical_dz'");
    assert!(error(&spherical_dz, "bev_head = 1.0").contains("[train] bev_head requires kind = \"unet\""));
    let points = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../../models/points.toml"));
    let points = points.expect("models/points.toml is part of the project");
    for key in ["bev_head", "consistency"] {
        let error = error(&points, &format!("{key} = 1.0"));
        assert!(error.contains(&format!("[train] {key} = 1, must be 0 for a network on points")), "{error}");
    }
}

#[test]
fn named_sensors_are_those_of_the_simulated_drives() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let rows = |sensors: &str| {
        let towns = TOWNS.replace("first = 1, last = 1", "first = 4, last = 5");
        let recipe = recipe(CLASSES, "", &format!("{towns}\nsensors = {sensors}"));
        let mut data = SweepDataset::new(&recipe, folder.path()).expect("a file");
        data.add_towns(&recipe.data, recipe.data.seeds.expect("seeds"), &mut |_, _| ()).expect("simulated");
        (0..data.n_sweeps()).map(|sweep| data.image(sweep).rows).collect::<Vec<_>>()
    };
    assert_eq!(rows("['rig', 'kitti']"), [32, 64]);
    assert_eq!(rows("['vlp16']"), [16, 16]);
}
