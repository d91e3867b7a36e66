//! The steps of the stage: class columns, counters, restart, invalid models.

use infer::{Infer, Settings};
use messages::{
    CLASS_TABLE_VERSION, ClassId, ClassRow, ClassTopic, ColorHeader, ColorRow, ColorTopic, GROUND_CLASSES,
    SubmapHeader, SubmapPoint, SubmapTopic, UNSEEN,
};
use random::Random;
use segmentation::intensity::IntensityUse;
use segmentation::network::{NetworkSpec, TensorShape, WeightTensor, Weights};
use segmentation::points::{
    Parameters, PlaneConvolution, PointFeature, PointNetworkSpec, PointSettings, SphereSettings, WaffleIron,
};
use segmentation::spherical::{Feature, Features, GroundUse};
use segmentation::{ComputeDevice, Fusion};
use stage::testing::{Bench, context};
use stage::{Context, Stage};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The root of the project, with launch.toml and models/.
fn at_root() -> Context {
    context(Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")))
}

/// Settings of the ground model, which needs no sweeps.
fn ground() -> Settings {
    Settings { model: "models/ground.safetensors".to_owned(), ..Settings::default() }
}

fn bench() -> Bench<Infer> {
    Bench::new(&ground(), &at_root()).expect("the model loads")
}

/// One revolution of an upright HDL-32E, 1.9 m above a road between walls at 9 m on both sides, and flags of the road
/// points. Without intensities: if road and wall had equal ones, the model would classify walls as grass.
fn street_sweep() -> (SubmapHeader, Vec<SubmapPoint>, Vec<bool>) {
    let mut points = Vec::new();
    let mut is_road = Vec::new();
    for firing in 0..2170_u32 {
        for ring in 0..32_u8 {
            let azimuth = firing as f32 / 2170.0 * 360.0;
            let up = (-30.67 + 4.0 / 3.0 * f32::from(ring)).to_radians();
            let (sin, cos) = azimuth.to_radians().sin_cos();
            let ray = [up.cos() * cos, -up.cos() * sin, up.sin()];
            let to_road = if ray[2] < 0.0 { -1.9 / ray[2] } else { f32::INFINITY };
            let range = to_road.min(9.0 / ray[1].abs());
            if range > 40.0 {
                continue;
            }
            let [x, y, z] = ray.map(|v| v * range);
            points.push(SubmapPoint { x, y, z, azimuth: (azimuth * 100.0) as u16, ring, ..Default::default() });
            is_road.push(range == to_road);
        }
    }
    let mut header = SubmapHeader { n_rings: 32, n_sweeps: 1, ..SubmapHeader::default() };
    header.sweeps[0].n_points = points.len() as u32;
    header.sweeps[0].duration_nanos = 100_000_000;
    header.sweeps[0].submap_from_lidar_begin = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    header.sweeps[0].submap_from_lidar_end = header.sweeps[0].submap_from_lidar_begin;
    (header, points, is_road)
}

/// Both sweeps are equal, so the skipped one must have the same classes as the other.
#[test]
fn points_of_skipped_sweep_get_votes_of_nearby_points() {
    let (header, points, _) = street_sweep();
    let mut twice = header;
    twice.n_sweeps = 2;
    twice.sweeps[1] = twice.sweeps[0];
    twice.sweeps[1].first_point = points.len() as u32;
    let classes = |every: u32, header: &SubmapHeader, points: Vec<SubmapPoint>| {
        let settings = Settings { every, model: "models/street.safetensors".to_owned(), ..Settings::default() };
        let mut bench: Bench<Infer> = Bench::new(&settings, &at_root()).expect("the model loads");
        bench.send::<SubmapTopic>(0, *header, points);
        bench.tick().expect("steps");
        bench.take::<ClassTopic>()[0].rows().to_vec()
    };
    let alone = classes(1, &header, points.clone());
    let both = classes(2, &twice, [points.clone(), points].concat());
    assert!(both[..alone.len()] == alone && both[alone.len()..] == alone);
}

/// Three sweeps in batches of two: the last batch is not full.
#[test]
fn classes_do_not_depend_on_batch() {
    let (header, points, _) = street_sweep();
    let mut three = header;
    three.n_sweeps = 3;
    for sweep in 1..3 {
        three.sweeps[sweep] = three.sweeps[0];
        three.sweeps[sweep].first_point = (sweep * points.len()) as u32;
    }
    let mut uneven = points.clone();
    uneven.iter_mut().step_by(7).for_each(|point| point.z += 0.1);
    let points = [points.clone(), uneven, points].concat();
    let classes = |batch: u32| {
        let settings = Settings { batch, ..Settings::default() };
        let mut bench: Bench<Infer> = Bench::new(&settings, &at_root()).expect("the model loads");
        bench.send::<SubmapTopic>(0, three, points.clone());
        bench.tick().expect("steps");
        bench.take::<ClassTopic>()[0].rows().to_vec()
    };
    let one_by_one = classes(1);
    assert!(one_by_one.iter().any(|row| row.score > 0));
    assert!([2, 3, 64].into_iter().all(|batch| classes(batch) == one_by_one));
}

/// Files of the shipped networks on images and on points.
fn networks() -> [PathBuf; 2] {
    ["street", "points"].map(|name| at_root().resolve(format!("models/{name}.safetensors").as_ref()))
}

/// A fused model of both networks, of which the first processes one of `every` sweeps.
fn fused_file(folder: &Path, every: usize) -> PathBuf {
    let [street, points] = networks();
    let file = folder.join(format!("every_{every}.safetensors"));
    let fusion = Fusion { share: 0.6, every, priors: BTreeMap::new(), temperature: 1.0 };
    std::fs::write(&file, segmentation::fuse(&street, &points, &fusion).expect("both suit each other"))
        .expect("writes");
    file
}

#[test]
fn fused_model_gives_the_class_on_which_both_agree() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let root = at_root();
    let [street, points] = networks();
    let fused = fused_file(folder.path(), 1);
    let (header, cloud, _) = street_sweep();
    let classes = |model: &Path| {
        // The corrections follow the probabilities, which differ.
        let settings = Settings {
            model: model.display().to_string(),
            driven_is_road: false,
            vehicle_shape: false,
            ..Settings::default()
        };
        assert_eq!(Infer::check(&settings, &root), []);
        let mut bench: Bench<Infer> = Bench::new(&settings, &root).expect("the model loads");
        bench.send::<SubmapTopic>(0, header, cloud.clone());
        bench.tick().expect("steps");
        let columns = bench.take::<ClassTopic>();
        (columns[0].rows().to_vec(), columns[0].header().model_digest)
    };
    let (on_images, first) = classes(&street);
    let (on_points, second) = classes(&points);
    let (fused, both) = classes(&fused);
    let class = |rows: &[ClassRow], point: usize| rows[point].class_id;
    let (agreed, open): (Vec<usize>, Vec<usize>) =
        (0..fused.len()).partition(|point| class(&on_images, *point) == class(&on_points, *point));
    assert_eq!(fused.len(), cloud.len());
    assert!(!agreed.is_empty(), "both models agree on some point");
    assert!(agreed.iter().all(|point| class(&fused, *point) == class(&on_images, *point)));
    for one in [&on_images, &on_points] {
        let n_of_one = open.iter().filter(|point| class(&fused, **point) == class(one, **point)).count();
        assert!((1..open.len()).contains(&n_of_one), "{n_of_one} of {}", open.len());
    }
    assert!(both != first && both != second);
}

/// Both sweeps are equal except for a shift, so the first network gives other classes if it processes both.
#[test]
fn fused_model_skips_sweeps_as_the_setting_does() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let root = at_root();
    let (mut header, cloud, _) = street_sweep();
    header.n_sweeps = 2;
    header.sweeps[1] = header.sweeps[0];
    header.sweeps[1].first_point = cloud.len() as u32;
    let second = cloud.iter().map(|point| SubmapPoint { y: point.y + 0.7, z: point.z + 0.1, ..*point });
    let both: Vec<SubmapPoint> = cloud.iter().copied().chain(second).collect();
    let classes = |model: &Path, every: u32| {
        let settings = Settings { model: model.display().to_string(), every, ..Settings::default() };
        let mut bench: Bench<Infer> = Bench::new(&settings, &root).expect("the model loads");
        bench.send::<SubmapTopic>(0, header, both.clone());
        bench.tick().expect("steps");
        bench.take::<ClassTopic>()[0].rows().to_vec()
    };
    let [one, two] = [1, 2].map(|every| fused_file(folder.path(), every));
    assert!(classes(&two, 1) == classes(&one, 2));
    assert!(classes(&two, 1) != classes(&one, 1));
}

#[test]
fn fusion_with_numbers_out_of_range_is_refused_with_the_rule() {
    let [street, points] = networks();
    for (share, every, temperature, rule) in [
        (1.5, 1, 1.0, "share = 1.5, must be 0 to 1"),
        (f64::NAN, 1, 1.0, "share = NaN"),
        (0.5, 17, 1.0, "every = 17, must be 1 to 16"),
        (0.5, 0, 1.0, "every = 0"),
        (0.5, 1, 0.05, "temperature = 0.05, must be 0.1 to 10"),
        (0.5, 1, f32::NAN, "temperature = NaN"),
    ] {
        let fusion = Fusion { share, every, priors: BTreeMap::new(), temperature };
        let error = segmentation::fuse(&street, &points, &fusion).expect_err("refused").to_string();
        assert!(error.contains(rule), "{error}");
    }
}

/// Scores of the ground model fall from 1 on the ground to 1/2 at the tolerance of 25 cm; some points are 10 cm above
/// the road.
#[test]
fn points_with_score_below_setting_are_unlabeled_and_counted() {
    let run = |unknown_below: f64| {
        let mut bench =
            Bench::<Infer>::new(&Settings { unknown_below, ..ground() }, &at_root()).expect("the model loads");
        let (mut points, _) = road_with_box();
        points.iter_mut().step_by(7).for_each(|point| point.z += 0.1);
        bench.send::<SubmapTopic>(0, SubmapHeader::default(), points);
        bench.tick().expect("steps");
        (bench.take::<ClassTopic>()[0].rows().to_vec(), bench.counter("unknown_points"), bench.counter("points_unseen"))
    };
    let (all, n_unknown, n_unseen) = run(0.0);
    assert_eq!((n_unknown, n_unseen), (0, 0));
    let threshold = 230;
    let is_low = |row: &ClassRow| row.class_id != ClassId::Unlabeled as u8 && row.score < threshold;
    let expected: Vec<ClassRow> = all
        .iter()
        .map(|row| ClassRow { class_id: if is_low(row) { ClassId::Unlabeled as u8 } else { row.class_id }, ..*row })
        .collect();
    let n_low = all.iter().filter(|row| is_low(row)).count() as u64;
    assert!(n_low > 1000, "{n_low}");
    assert!(run(f64::from(threshold) / 255.0) == (expected, n_low, 0));
}

/// This build has no CUDA, unless its features include it.
#[test]
fn device_that_is_not_built_in_is_refused_by_check() {
    let settings = Settings { device: ComputeDevice::Cuda, ..Settings::default() };
    let problems = Infer::check(&settings, &at_root());
    if cfg!(feature = "cuda") {
        assert!(problems.iter().all(|problem| problem.text.contains("GPU")), "{problems:?}");
    } else {
        assert_eq!(problems.len(), 1, "{problems:?}");
        assert_eq!(problems[0].key, "device");
        assert!(
            problems[0].text.contains("cargo build --release -p infer -p replica_lab --features cuda"),
            "{problems:?}"
        );
        assert!(Infer::new(&settings, &at_root()).is_err());
    }
}

#[test]
fn default_model_distinguishes_road_from_walls() {
    let mut bench: Bench<Infer> = Bench::new(&Settings::default(), &at_root()).expect("the model loads");
    let (header, points, is_road) = street_sweep();
    bench.send::<SubmapTopic>(0, header, points);
    // Without sweeps in the header, the position of the LiDAR is unknown.
    bench.send::<SubmapTopic>(1, SubmapHeader::default(), vec![SubmapPoint::default(); 5]);
    bench.tick().expect("steps");
    let columns = bench.take::<ClassTopic>();
    let rows = columns[0].rows();
    assert_eq!(rows.len(), is_road.len());
    let is_ground = |row: &ClassRow| GROUND_CLASSES.iter().any(|class| *class as u8 == row.class_id);
    let share = |road: bool| {
        let of_kind: Vec<&ClassRow> =
            rows.iter().zip(&is_road).filter(|(_, is)| **is == road).map(|(row, _)| row).collect();
        of_kind.iter().filter(|row| is_ground(row)).count() as f64 / of_kind.len() as f64
    };
    assert!(share(true) > 0.9, "{:.3} of the road is ground", share(true));
    assert!(share(false) < 0.1, "{:.3} of the walls are ground", share(false));
    assert!(rows.iter().all(|row| row.score > 0));
    assert_eq!(columns[1].rows().len(), 5);
    assert!(columns[1].rows().iter().all(|row| *row == ClassRow::default()));
    assert_eq!(bench.counter("points_unseen"), 5);
}

/// A road of 20 m x 10 m that rises by 5 %, with a box of 1.5 m height on it. The points of the box are last.
fn road_with_box() -> (Vec<SubmapPoint>, usize) {
    let point = |x: f32, y: f32, above: f32| SubmapPoint { x, y, z: 0.05 * x + above, ..SubmapPoint::default() };
    let grid = |n: u16, step: f32| (0..n).map(move |i| f32::from(i) * step + 0.05);
    let mut points: Vec<SubmapPoint> =
        grid(200, 0.1).flat_map(|x| grid(100, 0.1).map(move |y| (x, y))).map(|(x, y)| point(x, y, 0.0)).collect();
    let n_road = points.len();
    points.extend(grid(40, 0.1).flat_map(|x| grid(18, 0.1).map(move |y| point(x + 8.0, y + 4.0, 1.5))));
    (points, n_road)
}

#[test]
fn every_submap_gets_class_column_of_its_length_and_seq() {
    let mut bench = bench();
    let (points, n_road) = road_with_box();
    let n_points = points.len();
    bench.send::<SubmapTopic>(70, SubmapHeader::default(), points);
    bench.send::<SubmapTopic>(80, SubmapHeader::default(), Vec::new());
    bench.tick().expect("steps");
    bench.tick().expect("steps without input");
    let columns = bench.take::<ClassTopic>();
    let shapes: Vec<_> = columns.iter().map(|column| (column.seq(), column.stamp(), column.rows().len())).collect();
    assert_eq!(shapes, [(0, 70, n_points), (1, 80, 0)]);
    let header = columns[0].header();
    assert_eq!(header.class_table_version, CLASS_TABLE_VERSION);
    assert_ne!(header.model_digest, 0);
    let is_ground = |row: &ClassRow| row.class_id == ClassId::Ground as u8 && row.score > 127;
    assert!(columns[0].rows()[..n_road].iter().all(is_ground));
    assert!(columns[0].rows()[n_road..].iter().all(|row| *row == ClassRow::default()));
    assert_eq!(bench.counter("points_unseen"), 0);
}

#[test]
fn points_with_nan_are_counted_and_unlabeled() {
    let mut bench = bench();
    let (mut points, n_road) = road_with_box();
    points[7].x = f32::NAN;
    points[8].z = f32::INFINITY;
    bench.send::<SubmapTopic>(0, SubmapHeader::default(), points);
    bench.tick().expect("steps");
    let columns = bench.take::<ClassTopic>();
    assert_eq!(bench.counter("points_unseen"), 2);
    assert_eq!(columns[0].rows().iter().filter(|row| row.score > 0).count(), n_road - 2);
}

#[test]
fn many_unclassified_points_are_doubted() {
    let run = |n_invalid: usize, settings: &Settings| {
        let mut bench = Bench::<Infer>::new(settings, &at_root()).expect("the model loads");
        let (mut points, n_road) = road_with_box();
        points.truncate(n_road);
        points[..n_invalid].iter_mut().for_each(|point| point.x = f32::NAN);
        bench.send::<SubmapTopic>(0, SubmapHeader::default(), points);
        bench.tick().expect("steps");
        bench.finish().expect("an end");
        bench.doubt("points_unseen")
    };
    let (_, n_road) = road_with_box();
    assert_eq!(run(n_road / 10, &ground()), None);
    assert_eq!(run(n_road / 2, &ground()), Some(0.5));
    assert_eq!(run(n_road / 2, &Settings { max_unseen_share: 0.6, ..ground() }), None);
}

#[test]
fn submaps_too_wide_for_the_model_are_doubted() {
    let mut bench = bench();
    let (mut points, _) = road_with_box();
    bench.send::<SubmapTopic>(0, SubmapHeader::default(), points.clone());
    // 2 km by 2 km in cells of 0.2 m are 100 million, more than the model allows.
    let mut header = SubmapHeader { n_sweeps: 1, ..SubmapHeader::default() };
    header.sweeps[0].submap_from_lidar_end = [2000.0, 2000.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    (points[0].x, points[0].y) = (2000.0, 2000.0);
    bench.send::<SubmapTopic>(1, header, points);
    bench.tick().expect("steps");
    assert_eq!(bench.doubt("submaps_coarsened"), None, "shares are known at the end");
    bench.finish().expect("an end");
    assert_eq!(bench.doubt("submaps_coarsened"), Some(0.5));
}

#[test]
fn lidar_that_is_not_above_the_ground_is_doubted() {
    let (header, points, is_road) = street_sweep();
    let doubt = |max_misplaced_share: f64, change: &dyn Fn(&mut SubmapPoint)| {
        let mut bench =
            Bench::<Infer>::new(&Settings { max_misplaced_share, ..ground() }, &at_root()).expect("the model loads");
        let mut points = points.clone();
        points.iter_mut().for_each(change);
        bench.send::<SubmapTopic>(0, header, points);
        bench.tick().expect("steps");
        bench.finish().expect("an end");
        bench.doubt("lidar_misplaced")
    };
    assert!(is_road.iter().any(|is_road| *is_road));
    assert_eq!(doubt(0.5, &|_| ()), None);
    let (sin, cos) = 30_f32.to_radians().sin_cos();
    let rolled = |point: &mut SubmapPoint| {
        (point.y, point.z) = (cos * point.y - sin * point.z, sin * point.y + cos * point.z);
    };
    let on_the_road = |point: &mut SubmapPoint| point.z += 1.9;
    let changes: [&dyn Fn(&mut SubmapPoint); 2] = [&rolled, &on_the_road];
    for (number, change) in changes.into_iter().enumerate() {
        assert_eq!(doubt(0.5, change), Some(1.0), "change {number}");
        assert_eq!(doubt(1.0, change), None, "the limit is a setting");
    }
}

/// The ground of KITTI drives has a median of 66, the ground of the training has 12.
#[test]
fn intensities_on_another_scale_are_doubted_and_normalized() {
    let (header, points, _) = street_sweep();
    let classes = |intensity: u8, setting: IntensityUse| {
        let settings = Settings { intensity: setting, ..Settings::default() };
        let mut bench = Bench::<Infer>::new(&settings, &at_root()).expect("the model loads");
        let mut points = points.clone();
        for (i, point) in points.iter_mut().enumerate() {
            point.intensity = (f32::from(intensity) * (0.6 + 0.05 * (i % 17) as f32)) as u8;
        }
        bench.send::<SubmapTopic>(0, header, points);
        bench.tick().expect("steps");
        bench.finish().expect("an end");
        (bench.take::<ClassTopic>()[0].rows().to_vec(), bench.doubt("foreign_intensities"))
    };
    let (without, _) = classes(0, IntensityUse::Raw);
    assert!(classes(66, IntensityUse::Off) == (without.clone(), None));
    let (raw, doubt) = classes(66, IntensityUse::Raw);
    assert!(raw != without && doubt == Some(1.0));
    let (normalized, doubt) = classes(66, IntensityUse::Auto);
    assert!(normalized != without && normalized != raw && doubt == Some(1.0));
    assert!(classes(66, IntensityUse::Normalized) == (normalized, Some(1.0)));
    let (on_scale, doubt) = classes(12, IntensityUse::Auto);
    assert!(on_scale != without && doubt.is_none());
}

#[test]
fn restart_between_submaps_gives_same_output() {
    let outputs = |restart: bool| {
        let mut bench = bench();
        let mut rows = Vec::new();
        for seq in 0..4 {
            let (mut points, _) = road_with_box();
            points.truncate(points.len() - 100 * seq);
            bench.send::<SubmapTopic>(seq as i64, SubmapHeader::default(), points);
            bench.tick().expect("steps");
            rows.extend(bench.take::<ClassTopic>().iter().map(|column| (column.seq(), column.rows().to_vec())));
            if restart && seq == 1 {
                bench = bench.restarted(&ground(), &at_root()).expect("restarts");
            }
        }
        rows
    };
    let undisturbed = outputs(false);
    assert_eq!(undisturbed.len(), 4);
    assert!(outputs(true) == undisturbed);
}

#[test]
fn missing_and_broken_models_are_reported_by_check() {
    assert_eq!(Infer::check(&Settings::default(), &at_root()), []);
    let folder = tempfile::tempdir().expect("a temporary folder");
    let here = context(folder.path());
    let problems = Infer::check(&Settings::default(), &here);
    assert_eq!(problems.len(), 1);
    assert_eq!(problems[0].key, "model");
    assert!(problems[0].text.contains("models/street_fused.safetensors"), "{}", problems[0].text);

    std::fs::write(folder.path().join("torn.safetensors"), b"torn").expect("writes");
    let settings = Settings { model: "torn.safetensors".to_owned(), ..Settings::default() };
    let problems = Infer::check(&settings, &here);
    assert!(problems[0].text.contains("torn.safetensors: not a complete safetensors file"), "{}", problems[0].text);
    assert!(Infer::new(&settings, &here).is_err());
}

/// A small network on points with random weights, in a folder.
fn point_model() -> (tempfile::TempDir, Settings) {
    let network = PointNetworkSpec::WaffleIron(WaffleIron {
        inputs: 7,
        outputs: 3,
        width: 8,
        depth: 3,
        neighbors: 6,
        cell_m: 1.0,
        low_m: [-8.0; 3],
        high_m: [8.0; 3],
        convolution: PlaneConvolution::DepthWise,
    });
    let parameters = Parameters::random(&network.parameters(), &mut Random::new(3)).expect("a start");
    let settings = PointSettings {
        network,
        classes: ["road", "building", "vegetation"].map(str::to_owned).into(),
        features: vec![PointFeature::Offset, PointFeature::Height, PointFeature::Intensity],
        cell_m: 0.3,
        spheres: SphereSettings { radius_m: 8.0, overlap_m: 2.0 },
        squares: None,
        temperature: 1.0,
        ground_intensities: None,
        notice: Some("for tests only".to_owned()),
    };
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("points.safetensors");
    let bytes = settings.to_bytes(&parameters.weights().expect("f32")).expect("encodes");
    std::fs::write(&path, bytes).expect("writes");
    let model = path.to_str().expect("UTF-8").to_owned();
    (folder, Settings { model, ..Settings::default() })
}

#[test]
fn model_on_points_gives_every_point_a_class_and_counts_points_with_nan() {
    let (_folder, settings) = point_model();
    let problems = Infer::check(&settings, &at_root());
    assert!(problems.is_empty(), "{problems:?}");
    let (header, mut points, _) = street_sweep();
    points[7].x = f32::NAN;
    points[8].z = f32::INFINITY;
    let mut bench: Bench<Infer> = Bench::new(&settings, &at_root()).expect("the model loads");
    bench.send::<SubmapTopic>(0, header, points);
    bench.send::<SubmapTopic>(1, SubmapHeader::default(), Vec::new());
    bench.tick().expect("steps");
    let columns = bench.take::<ClassTopic>();
    let known = [ClassId::Road, ClassId::Building, ClassId::Vegetation].map(|class| class as u8);
    for (i, row) in columns[0].rows().iter().enumerate() {
        let is_classified = known.contains(&row.class_id) && row.score > 0;
        assert_eq!(is_classified, ![7, 8].contains(&i), "point {i}: {row:?}");
    }
    assert_eq!(columns[1].rows().len(), 0);
    assert_eq!(bench.counter("points_unseen"), 2);
    assert_ne!(columns[0].header().model_digest, 0);
    assert_eq!(bench.notes(), ["model: for tests only"]);
}

#[test]
fn model_on_points_on_a_gpu_is_refused_by_check() {
    let (_folder, settings) = point_model();
    let settings = Settings { device: ComputeDevice::Cuda, ..settings };
    assert!(!Infer::check(&settings, &at_root()).is_empty());
    assert!(Infer::new(&settings, &at_root()).is_err());
}

/// A network on images with random weights that reads heights, one color, and the reflectance at 650 nm if `with_band`.
fn color_model(with_band: bool) -> (tempfile::TempDir, Settings) {
    let mut features = vec![Feature::Valid, Feature::HeightCoarse, Feature::Red, Feature::HasColor];
    features.extend(with_band.then_some(Feature::Band(650)));
    let network = NetworkSpec::Unet { inputs: 2 * features.len(), outputs: 6, widths: vec![16, 16], head: None };
    let mut weights = Weights::default();
    for (stream, layer) in (0..).zip(network.layers()) {
        let mut random = Random::for_stream(5, stream);
        for TensorShape { name, shape } in layer.tensors() {
            let values = (0..shape.iter().product()).map(|_| 0.3 * random.gauss()).collect();
            weights.tensors.insert(name, WeightTensor { shape, values });
        }
    }
    let settings = segmentation::spherical::Settings {
        network,
        columns: 512,
        fold: 2,
        classes: ["road", "building", "vegetation"].map(str::to_owned).into(),
        vote_cell_m: 0.2,
        temperature: 1.0,
        ground_intensities: None,
        nearest: None,
        notice: None,
        features: Features::new(features),
        ground: GroundUse::Kept,
    };
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("color.safetensors");
    std::fs::write(&path, settings.to_bytes(&weights).expect("encodes")).expect("writes");
    let model = path.to_str().expect("UTF-8").to_owned();
    (folder, Settings { model, ..Settings::default() })
}

#[test]
fn model_with_colors_waits_for_them_and_is_the_same_after_a_restart() {
    let (_folder, settings) = color_model(false);
    let names = |settings: &Settings| -> Vec<&'static str> {
        let ports = Infer::inputs_with(settings, Path::new("")).expect("a model");
        ports.iter().map(stage::Port::topic).collect()
    };
    assert_eq!(names(&settings), ["submap", "color"]);
    assert_eq!(names(&color_model(true).1), ["submap", "color", "spectra"]);

    let (header, points, _) = street_sweep();
    let colored = |red: u8, camera: u8| vec![ColorRow { r: red, g: 0, b: 0, camera }; points.len()];
    let classes = |colors: [Vec<ColorRow>; 2], is_restarted: bool| {
        let mut bench: Bench<Infer> = Bench::new(&settings, &at_root()).expect("the model loads");
        for seq in 0..2 {
            bench.send::<SubmapTopic>(seq, header, points.clone());
        }
        bench.tick().expect("steps");
        assert_eq!(bench.take::<ClassTopic>().len(), 0, "the colors have not come");
        if is_restarted {
            bench = bench.restarted(&settings, &at_root()).expect("restarts");
        }
        for (seq, colors) in (0..).zip(colors) {
            bench.send::<ColorTopic>(seq, ColorHeader::default(), colors);
        }
        bench.tick().expect("steps");
        bench.take::<ClassTopic>().iter().map(|column| column.rows().to_vec()).collect::<Vec<_>>()
    };
    let undisturbed = classes([colored(255, 0), colored(0, UNSEEN)], false);
    assert_eq!(undisturbed.len(), 2);
    assert!(undisturbed[0] != undisturbed[1], "the same points in other colors");
    assert!(classes([colored(255, 0), colored(0, UNSEEN)], true) == undisturbed);
}

#[test]
fn columns_that_nothing_gives_are_refused_by_check() {
    let (_folder, with_colors) = color_model(false);
    let (_other, with_band) = color_model(true);
    // Also without the drive, whose sensors would be missing.
    let connected = |topics: &[&str]| Context {
        drive: Path::new("").into(),
        connected: topics.iter().map(|topic| (*topic).to_owned()).collect(),
        ..at_root()
    };
    let problem = |settings: &Settings, topics: &[&str]| {
        let problems = Infer::check(settings, &connected(topics));
        problems.first().map_or(String::new(), |problem| problem.text.clone())
    };
    assert!(problem(&with_colors, &["submap"]).contains("reads colors, and no stage produces topic color"));
    assert!(problem(&with_band, &["submap", "color"]).contains("reads spectra, and no stage produces topic spectra"));
    assert_eq!(problem(&with_colors, &["submap", "color"]), "");
    assert_eq!(problem(&with_band, &["submap", "color", "spectra"]), "");
}
