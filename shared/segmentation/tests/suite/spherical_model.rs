//! Models on range images: range sweeps, classes, invalid files.

use geometry::NO_POINT;
use kernels::images::{Border, Planes};
use messages::{ClassId, ClassRow, ColorRow, SubmapHeader, SubmapPoint, SubmapSweep, UNSEEN};
use random::Random;
use segmentation::network::{Inference, NetworkSpec, WeightTensor, Weights};
use segmentation::spherical::{
    ARCHITECTURE, Feature, Features, GroundUse, ImageSource, LoadedModel, N_FEATURES, OwnedSubmap, SegmentedSubmap,
    Settings, SphericalModel, SubmapSweeps, SweepImages, VERSION, features, range_sweeps,
};
use segmentation::{ModelCard, ModelInput, SegmentationError, Segmenter};
use std::path::PathBuf;
use std::sync::Arc;

/// Class of a row that no model has written.
const UNKNOWN: u8 = u8::MAX;
const RINGS: u8 = 16;
const FIRINGS: u32 = 512;

fn settings() -> Settings {
    let classes = ["road", "building", "vehicles"].map(str::to_owned).to_vec();
    let network = NetworkSpec::Unet { inputs: 2 * N_FEATURES, outputs: 6, widths: vec![16, 16], head: None };
    Settings {
        network,
        columns: 512,
        fold: 2,
        classes,
        vote_cell_m: 0.2,
        temperature: 1.0,
        ground_intensities: None,
        nearest: None,
        notice: None,
        features: Features::default(),
        ground: GroundUse::Kept,
    }
}

/// Random filters of mean 0, scaled like initial filters of a training, and biases of 0.
fn weights(settings: &Settings) -> Weights {
    let mut weights = Weights::default();
    for (stream, layer) in (0..).zip(settings.network.layers()) {
        let mut random = Random::for_stream(1, stream);
        let [weight, bias] = layer.tensors();
        let fan_in: usize = weight.shape[1..].iter().product();
        let gain = if layer.shape.rectify { 1.713_858 } else { 1.0 };
        let filter = |_: usize| {
            let raw: Vec<f32> = (0..fan_in).map(|_| random.gauss()).collect();
            let mean = raw.iter().sum::<f32>() / fan_in as f32;
            raw.into_iter().map(|v| gain * (v - mean) / (fan_in as f32).sqrt()).collect::<Vec<f32>>()
        };
        let values = (0..bias.shape[0]).flat_map(filter).collect();
        weights.tensors.insert(weight.name, WeightTensor { shape: weight.shape, values });
        let values = vec![0.0; bias.shape[0]];
        weights.tensors.insert(bias.name, WeightTensor { shape: bias.shape, values });
    }
    weights
}

fn file_of(settings: &Settings, weights: &Weights) -> Vec<u8> {
    settings.to_bytes(weights).expect("encodes")
}

fn load(bytes: &[u8]) -> Result<SphericalModel, SegmentationError> {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path: PathBuf = folder.path().join("model.safetensors");
    std::fs::write(&path, bytes).expect("writes");
    SphericalModel::load(&path).map(|loaded| loaded.model)
}

/// Two sweeps of a LiDAR that moves 1 m in each, and their rays.
fn submap() -> (Box<SubmapHeader>, Vec<SubmapPoint>, Vec<[f32; 3]>) {
    let mut random = Random::new(8);
    let mut header: Box<SubmapHeader> = Box::default();
    header.n_rings = u32::from(RINGS);
    header.n_sweeps = 2;
    let mut points = Vec::new();
    let mut rays = Vec::new();
    for sweep in 0..2_u16 {
        let begin_x = f32::from(sweep);
        let first_point = points.len() as u32;
        for firing in 0..FIRINGS {
            for ring in 0..RINGS {
                if random.unit() < 0.2 {
                    continue;
                }
                let azimuth = (firing as f32 + 0.5) / FIRINGS as f32 * 360.0;
                let up = (f32::from(ring) * 2.0 - 25.0).to_radians();
                let (sin, cos) = azimuth.to_radians().sin_cos();
                let range = random.range(3.0, 40.0);
                let ray = [up.cos() * cos, -up.cos() * sin, up.sin()].map(|v| v * range);
                let offset_nanos = firing * 195_000;
                let x0 = begin_x + offset_nanos as f32 / 1e8;
                points.push(SubmapPoint {
                    x: x0 + ray[0],
                    y: ray[1],
                    z: ray[2],
                    offset_nanos,
                    azimuth: (azimuth * 100.0).round() as u16,
                    ring,
                    sweep_idx: sweep,
                    intensity: 1 + ring,
                    ..SubmapPoint::default()
                });
                rays.push(ray);
            }
        }
        let pose = |x: f32| [x, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
        header.sweeps[usize::from(sweep)] = SubmapSweep {
            duration_nanos: 100_000_000,
            first_point,
            n_points: points.len() as u32 - first_point,
            submap_from_lidar_begin: pose(begin_x),
            submap_from_lidar_end: pose(begin_x + 1.0),
            ..SubmapSweep::default()
        };
    }
    (header, points, rays)
}

#[test]
fn range_sweeps_contain_all_rays_of_submap() {
    let (header, points, rays) = submap();
    let cloud = ModelInput::new(&header, &points);
    let heights: Vec<f32> = (0..points.len()).map(|i| i as f32).collect();
    let images = range_sweeps(&cloud, FIRINGS as usize, &heights);
    assert_eq!(images.len(), 2);
    let mut n_pixels = 0;
    for sweep in &images {
        assert_eq!(sweep.image.collision_rate(), 0.0);
        for (index, point) in points[sweep.points.clone()].iter().enumerate() {
            let firing = (u64::from(point.offset_nanos) / 195_000) as usize;
            let row = usize::from(RINGS - 1 - point.ring);
            assert_eq!(sweep.image.pixel_of_point[index] as usize, row * FIRINGS as usize + firing);
            let pixel = &sweep.polar.pixels[row * FIRINGS as usize + firing];
            let ray = rays[sweep.points.start + index];
            assert!((0..3).all(|i| (pixel.ray[i] - ray[i]).abs() < 1e-4), "{:?} for {ray:?}", pixel.ray);
            assert_eq!((pixel.height_m, pixel.intensity), ((sweep.points.start + index) as f32, point.intensity));
        }
        n_pixels += sweep.polar.pixels.iter().filter(|pixel| pixel.is_valid()).count();
    }
    assert_eq!(n_pixels, points.len());
}

#[test]
fn points_without_rings_are_placed_by_elevation() {
    let (mut header, mut points, rays) = submap();
    header.n_rings = 0;
    for (point, ray) in points.iter_mut().zip(&rays) {
        point.ring = 0;
        point.elevation = (ray[2].atan2(ray[0].hypot(ray[1])).to_degrees() * 100.0).round() as i16;
    }
    // A non-repetitive pattern has no order of angles either.
    for sweep in &header.sweeps[..2] {
        let first = sweep.first_point as usize;
        let n = sweep.n_points as usize;
        let mut random = Random::new(3);
        for index in (1..n).rev() {
            points.swap(first + index, first + random.index(index + 1));
        }
    }
    let cloud = ModelInput::new(&header, &points);
    let images = range_sweeps(&cloud, FIRINGS as usize, &vec![0.0; points.len()]);
    for sweep in &images {
        assert_eq!((sweep.image.rows, sweep.image.collision_rate()), (64, 0.0));
        let pixels: Vec<u32> = sweep.image.pixel_of_point.clone();
        for (point, pixel) in points[sweep.points.clone()].iter().zip(pixels) {
            let row = usize::try_from(pixel).expect("a pixel") / FIRINGS as usize;
            // Sixteen beams two degrees apart, from +5 to -25 deg, in 64 rows.
            let expected = (500 - i32::from(point.elevation)) as f32 / 3001.0 * 64.0;
            assert!((row as f32 - expected).abs() < 1.1, "{row} for {}", point.elevation);
        }
    }
    let settings = settings();
    let model = load(&file_of(&settings, &weights(&settings))).expect("loads");
    let mut classes = vec![ClassRow { class_id: UNKNOWN, score: 0 }; points.len()];
    model.segment(&cloud, &mut classes).expect("segments");
    assert!(classes.iter().all(|row| row.class_id != UNKNOWN), "every point gets a class");
}

#[test]
fn number_of_threads_does_not_change_classes() {
    let settings = settings();
    let model = load(&file_of(&settings, &weights(&settings))).expect("loads");
    let (header, points, _) = submap();
    let classes = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        let mut classes = vec![ClassRow::default(); points.len()];
        let cloud = ModelInput::new(&header, &points);
        let report = pool.install(|| model.segment(&cloud, &mut classes)).expect("segments");
        assert_eq!(report.n_unseen, 0);
        classes
    };
    let one = classes(1);
    assert_eq!(one, classes(3));
    let known = [ClassId::Road, ClassId::Building, ClassId::Vehicles].map(|class| class as u8);
    assert!(one.iter().all(|row| known.contains(&row.class_id) && row.score >= 84), "one of three has a third");
    let n_of = |class: u8| one.iter().filter(|row| row.class_id == class).count();
    assert!(known.iter().filter(|class| n_of(**class) > 0).count() > 1, "all points have one class");
}

#[test]
fn points_without_sweep_or_ring_are_unlabeled() {
    let settings = settings();
    let model = load(&file_of(&settings, &weights(&settings))).expect("loads");
    let (mut header, mut points, _) = submap();
    // Far from all others, so that it gets no vote from a neighbor.
    points[5] = SubmapPoint { ring: 200, z: 30.0, ..points[5] };
    points[6].x = f32::NAN;
    header.n_sweeps = 1;
    let n_first = header.sweeps[0].n_points as usize;
    let mut classes = vec![ClassRow::default(); points.len()];
    let report = model.segment(&ModelInput::new(&header, &points), &mut classes).expect("segments");
    assert_eq!((classes[5], classes[6]), (ClassRow::default(), ClassRow::default()));
    assert!(report.n_unseen >= 2 && report.n_unseen <= points.len() - n_first + 2, "{}", report.n_unseen);
    // A sweep beyond the points of the submap is skipped.
    header.sweeps[0].n_points = u32::MAX;
    let report = model.segment(&ModelInput::new(&header, &points), &mut classes).expect("segments");
    assert_eq!(report.n_unseen, points.len());
}

#[test]
fn invalid_files_are_rejected_with_reason() {
    let good = settings();
    let weights = weights(&good);
    let bytes = file_of(&good, &weights);
    for len in [0, 7, 100, bytes.len() / 2, bytes.len() - 1] {
        assert!(matches!(load(&bytes[..len]), Err(SegmentationError::Container { .. })), "cut at {len}");
    }
    let rejected = |settings: &Settings, rule: &str| {
        let Err(error) = load(&file_of(settings, &weights)) else { panic!("{rule}: was loaded") };
        assert!(error.to_string().contains(rule), "{error}");
    };
    rejected(&Settings { columns: 510, ..good.clone() }, "columns = 510, must be a multiple of fold x 2");
    rejected(&Settings { columns: 1 << 20, ..good.clone() }, "columns = 1048576, must be 64 to 8192");
    rejected(&Settings { fold: 0, ..good.clone() }, "fold = 0, must be 1 to 16");
    rejected(&Settings { temperature: 0.0, ..good.clone() }, "temperature = 0, must be 0.1 to 10");
    rejected(&Settings { vote_cell_m: 0.0, ..good.clone() }, "vote_cell_m = 0, must be 0.02 to 5");
    let two = good.classes[..2].to_vec();
    rejected(&Settings { classes: two, ..good.clone() }, "network.outputs = 6, must be fold x 2 classes");
    let unknown = vec!["road".to_owned(), "castle".to_owned(), "moat".to_owned()];
    rejected(&Settings { classes: unknown, ..good.clone() }, "castle");
    let wider = NetworkSpec::Unet { inputs: 2 * N_FEATURES, outputs: 6, widths: vec![32, 16], head: None };
    rejected(
        &Settings { network: wider, ..good.clone() },
        "`down.0.0.weight`: has shape [16, 20, 3, 3], expected [32, 20, 3, 3]",
    );
    let deep = NetworkSpec::Unet { inputs: 2 * N_FEATURES, outputs: 6, widths: vec![16; 7], head: None };
    rejected(&Settings { network: deep, ..good.clone() }, "7 levels, must be 1 to 6");
    let mut missing = weights.clone();
    missing.tensors.remove("up.0.1.bias");
    assert!(
        matches!(load(&file_of(&good, &missing)), Err(SegmentationError::Tensor { name, .. }) if name == "up.0.1.bias")
    );
    let mut broken = weights.clone();
    broken.tensors.get_mut("classes.bias").expect("is there").values[1] = f32::INFINITY;
    let Err(error) = load(&file_of(&good, &broken)) else { panic!("was loaded") };
    assert!(error.to_string().contains("`classes.bias`: element 1 is inf"), "{error}");
}

#[test]
fn scores_of_a_network_outside_the_model_give_its_classes() {
    let (header, points, _) = submap();
    let settings = Settings { ground: GroundUse::Removed, ..settings() };
    let weights = weights(&settings);
    let card = ModelCard { architecture: ARCHITECTURE.to_owned(), version: VERSION, digest: 0 };
    let model = SphericalModel::new(card, settings.clone(), &weights).expect("fits");
    let mut expected = vec![ClassRow::default(); points.len()];
    let report = model.segment(&ModelInput::new(&header, &points), &mut expected).expect("runs");

    let network = Inference::new(settings.network.clone(), &weights, Border::Circular).expect("fits");
    let images = SweepImages::new(settings).expect("valid");
    let submap = OwnedSubmap { header, points, colors: None, spectra: None };
    let mut sweeps = SubmapSweeps::new(Arc::new(images), submap).expect("columns fit");
    assert_eq!(sweeps.sizes(), [[20, 16, 256]; 2]);
    let inputs = sweeps.images(0..2);
    // The order of the sweeps does not matter.
    for (sweep, values) in inputs.chunks_exact(inputs.len() / 2).enumerate().rev() {
        let mut input = Planes::zeros(20, 16, 256);
        input.write_channels_first(values);
        input.fill_border(Border::Circular);
        let output = network.run(&input.to_tensor().expect("an image")).expect("runs");
        let scores = Planes::from_tensor(&output, 6).expect("an image").to_channels_first();
        sweeps.vote(sweep, &scores).expect("fits");
    }
    let SegmentedSubmap { classes, report: found } = sweeps.classes();
    assert!(classes == expected && found == report);
    let error = sweeps.vote(1, &[0.0; 5]).expect_err("too few");
    assert_eq!(error.to_string(), "scores of sweep 1: 5 numbers; the model needs [6, 16, 256] channels, rows, columns");
}

/// Different code writes named features in the default order and default features.
#[test]
fn shipped_model_keeps_its_bytes_and_default_features() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../models/street.safetensors");
    let LoadedModel { model, weights } = SphericalModel::load(path.as_ref()).expect("loads");
    assert!(model.settings().features.is_default() && model.settings().ground == GroundUse::Kept);
    assert!(model.settings().to_bytes(&weights).expect("encodes") == std::fs::read(path).expect("reads"));
}

#[test]
fn features_by_name_have_the_values_of_the_default_ones() {
    let (header, points, _) = submap();
    let cloud = ModelInput::new(&header, &points);
    let image = range_sweeps(&cloud, 512, &cloud.ground().heights(cloud.points)).remove(0).polar;
    let usual = features(&image, &Features::default(), 1, 1);
    let mut named = Features::default().as_slice().to_vec();
    named.reverse();
    named.push(Feature::Depth);
    let named = features(&image, &Features::new(named), 1, 1);
    for row in 0..image.rows {
        for column in 0..image.columns {
            let usual = usual.row(0, row)[column];
            let named = named.row(0, row)[column];
            assert!((0..10).all(|feature| usual[feature] == named[9 - feature]), "{row} {column}");
            let range_m = image.pixels[row * image.columns + column].range_m();
            assert!((named[10] - range_m / 50.0).abs() < 1e-6, "{row} {column}");
        }
    }
}

#[test]
fn points_without_color_have_flag_zero() {
    let (header, points, _) = submap();
    let color = |i: usize| match i % 3 {
        0 => ColorRow { camera: UNSEEN, ..ColorRow::default() },
        _ => ColorRow { r: 51, g: 102, b: 255, camera: 1 },
    };
    let colors: Vec<ColorRow> = (0..points.len()).map(color).collect();
    let features_of = Features::new(vec![Feature::HasColor, Feature::Blue, Feature::Red, Feature::Valid]);
    let planes = |colors: Option<&[ColorRow]>| {
        let cloud = ModelInput { colors, ..ModelInput::new(&header, &points) };
        let heights_m = cloud.ground().heights(cloud.points);
        let source = ImageSource::new(&cloud, 512, &heights_m).with_camera(&features_of.camera_bands());
        let sweep = source.sweeps().remove(1);
        (features(&sweep.polar, &features_of, 1, 1), sweep)
    };
    let (with, sweep) = planes(Some(&colors));
    let (without, _) = planes(None);
    let mut n_known = 0;
    let mut n_unknown = 0;
    for (pixel, &shown) in sweep.image.nearest.iter().enumerate() {
        let at = |planes: &Planes| planes.row(0, pixel / 512)[pixel % 512];
        let [known, blue, red, valid, ..] = at(&with);
        let is_known = shown != NO_POINT && !(sweep.points.start + shown as usize).is_multiple_of(3);
        let expected = if is_known { [1.0, 1.0, 0.2] } else { [0.0; 3] };
        assert_eq!([known, blue, red], expected, "pixel {pixel}");
        assert_eq!(at(&without)[..4], [0.0, 0.0, 0.0, valid]);
        n_known += usize::from(is_known);
        n_unknown += usize::from(!is_known);
    }
    assert!(n_known > 1000 && n_unknown > 1000);
}

#[test]
fn removed_ground_has_the_class_of_the_ground_model() {
    let (header, mut points, _) = submap();
    // A floor under the returns; every third of its points is far above it.
    points.iter_mut().enumerate().for_each(|(i, point)| point.z = if i % 3 == 0 { 4.0 } else { -2.0 });
    let settings = Settings { ground: GroundUse::Removed, ..settings() };
    let model = load(&file_of(&settings, &weights(&settings))).expect("loads");
    assert_eq!(model.settings().ground, GroundUse::Removed);
    let cloud = ModelInput::new(&header, &points);
    let ground = cloud.ground();
    let given = ground.classes(&ground.heights(&points));
    let mut classes = vec![ClassRow::default(); points.len()];
    model.segment(&cloud, &mut classes).expect("segments");
    let n_ground = given.iter().filter(|row| row.class_id == ClassId::Ground as u8).count();
    assert!(n_ground > points.len() / 2 && n_ground < points.len(), "{n_ground}");
    for (row, given) in classes.iter().zip(&given) {
        if given.class_id == ClassId::Ground as u8 {
            assert_eq!(row, given);
        } else {
            assert!(row.class_id != ClassId::Unlabeled as u8 && row.class_id != ClassId::Ground as u8);
        }
    }
}

#[test]
fn unknown_or_repeated_features_are_refused() {
    let bytes = file_of(&settings(), &weights(&settings()));
    let text = String::from_utf8_lossy(&bytes).into_owned();
    assert!(!text.contains("features") && !text.contains("\\\"ground\\\""), "defaults are not written");
    let wrong = Settings { features: Features::new(vec![Feature::Valid, Feature::Valid]), ..settings() };
    let error = wrong.check().expect_err("is refused").to_string();
    assert!(error.contains("features: valid is listed twice"), "{error}");
    let wrong = Settings { features: Features::new(vec![Feature::Valid, Feature::Red]), ..settings() };
    let error = wrong.check().expect_err("is refused").to_string();
    assert!(error.contains("network.inputs = 20, must be fold x 2 features"), "{error}");
}
