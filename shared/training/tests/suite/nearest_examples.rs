//! Nearest examples in place of the last layer of a network on images.

use geometry::NO_POINT;
use messages::{ClassId, ClassRow, SubmapHeader, SubmapPoint, SubmapSweep};
use random::Random;
use segmentation::network::NetworkSpec;
use segmentation::spherical::{
    ColumnExamples, Features, GroundUse, N_FEATURES, PolarImage, RangeSweep, Settings, features, range_sweeps,
};
use segmentation::{ModelInput, Options, Refinement, SegmentationError};
use training::{Dataset, Example, UNKNOWN, Variables, draw_examples};

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

/// Two sweeps of a LiDAR that moves 1 m during each.
fn submap() -> (Box<SubmapHeader>, Vec<SubmapPoint>) {
    let mut random = Random::new(8);
    let mut header: Box<SubmapHeader> = Box::default();
    header.n_rings = u32::from(RINGS);
    header.n_sweeps = 2;
    let mut points = Vec::new();
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
    (header, points)
}

/// Range images with the class of every pixel.
struct Labeled(Vec<(PolarImage, Vec<u8>)>);

impl Dataset for Labeled {
    fn len(&self) -> usize {
        self.0.len()
    }
    fn example(&self, index: usize, _: Option<&mut Random>) -> Example {
        let (image, truth) = &self.0[index];
        Example::new(features(image, &Features::default(), 2, 2), truth.clone())
    }
}

#[test]
fn nearest_examples_beat_untrained_last_layer() {
    let settings = settings();
    let weights = Variables::random(&settings.network, 1).and_then(|variables| variables.weights()).expect("variables");
    let (header, points) = submap();
    let cloud = ModelInput::new(&header, &points);
    let heights_m = cloud.ground().heights(cloud.points);
    // Low rings are road, middle ones vehicles, high ones buildings.
    let truth = |point: &SubmapPoint| [0, 2, 1][usize::from(point.ring) / 6];
    let of_sweep = |sweep: RangeSweep| {
        let class = |&shown: &u32| match shown {
            NO_POINT => UNKNOWN,
            shown => truth(&points[sweep.points.start + shown as usize]),
        };
        let truth = sweep.image.nearest.iter().map(class).collect();
        (sweep.polar, truth)
    };
    let data = Labeled(range_sweeps(&cloud, settings.columns, &heights_m).into_iter().map(of_sweep).collect());
    let draw = |per_class: usize| draw_examples(&settings, &weights, &data, per_class).expect("draws");
    let folder = tempfile::tempdir().expect("a temporary folder");
    let share_right = |bytes: Result<Vec<u8>, SegmentationError>| {
        let path = folder.path().join("model.safetensors");
        std::fs::write(&path, bytes.expect("encodes")).expect("writes");
        // The classes of this cloud have no shapes.
        let options = Options { refinement: Refinement::NONE, ..Options::default() };
        let model = segmentation::load(&path, &options).expect("loads");
        let mut classes = vec![ClassRow::default(); points.len()];
        model.segment(&cloud, &mut classes).expect("segments");
        let is_right = |(point, row): &(&SubmapPoint, &ClassRow)| {
            ClassId::from_id(row.class_id).map(ClassId::name)
                == Some(settings.classes[usize::from(truth(point))].as_str())
        };
        points.iter().zip(&classes).filter(is_right).count() as f64 / points.len() as f64
    };
    let all = draw(usize::MAX);
    assert_eq!(all.iter().map(|of_column| of_column.classes.len()).sum::<usize>(), points.len());
    let last_layer = share_right(settings.to_bytes(&weights));
    let own = share_right(settings.to_bytes_with_examples(&weights, 1, &all));
    let few = share_right(settings.to_bytes_with_examples(&weights, 5, &draw(200)));
    assert!(last_layer < 0.5, "{last_layer}");
    // Every pixel is its own nearest example; errors share a cell with other points.
    assert!(own > 0.98, "{own}");
    // The features of an untrained network depend only partly on the ring. Chance level is a third.
    assert!(few > 0.5, "{few}");
}

#[test]
fn examples_of_unknown_classes_are_rejected_by_position_and_value() {
    let settings = settings();
    let weights = Variables::random(&settings.network, 1).and_then(|variables| variables.weights()).expect("variables");
    let (header, points) = submap();
    let cloud = ModelInput::new(&header, &points);
    let images = range_sweeps(&cloud, settings.columns, &cloud.ground().heights(cloud.points));
    let rejected = |change: &dyn Fn(&mut Vec<u8>)| {
        let known = images.iter().map(|sweep| (sweep.polar.clone(), vec![0; sweep.polar.pixels.len()]));
        let mut data = Labeled(known.collect());
        draw_examples(&settings, &weights, &data, 10).expect("known classes are accepted");
        change(&mut data.0[1].1);
        draw_examples(&settings, &weights, &data, 10).expect_err("is rejected").to_string()
    };
    let n_classes = settings.classes.len();
    let columns = settings.columns;
    assert_eq!(
        rejected(&|truth| truth[2 * columns + 5] = n_classes as u8),
        format!(
            "example 1 of the data: row 2, column 5 has class {n_classes}, must be below {n_classes}, or 255 if unknown"
        )
    );
    let too_long = rejected(&|truth| truth.resize(truth.len() + columns, 0));
    assert!(too_long.starts_with("example 1 of the data: ") && too_long.contains("pixels have a class"), "{too_long}");
}

#[test]
fn wrong_examples_are_refused_by_tensor_and_element() {
    let settings = settings();
    let weights = Variables::random(&settings.network, 1).and_then(|variables| variables.weights()).expect("variables");
    // An example of each class, with the features of the last but one layer.
    let n_channels = 16;
    let column = |sign: f32| {
        let mut of_column = ColumnExamples { vote_weights: vec![1.0, 2.0, 1.0], ..ColumnExamples::default() };
        for class in 0..3_u8 {
            let features: Vec<f32> = (0..n_channels).map(|i| sign * f32::from(u8::from(i % 3 == class))).collect();
            of_column.push(&features, class);
        }
        of_column
    };
    let examples = [column(1.0), column(-1.0)];
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("nearest.safetensors");
    let write = |examples: &[ColumnExamples]| {
        std::fs::write(&path, settings.to_bytes_with_examples(&weights, 2, examples).expect("encodes"))
            .expect("writes");
    };
    write(&examples);
    segmentation::load(&path, &Options::default()).expect("loads");

    let refused = |change: &dyn Fn(&mut ColumnExamples)| {
        let mut wrong = examples.clone();
        change(&mut wrong[1]);
        write(&wrong);
        segmentation::load(&path, &Options::default()).err().expect("is refused").to_string()
    };
    let class = refused(&|column| column.classes[2] = 3);
    assert!(
        class.contains("examples.1.classes") && class.contains("element 2 is 3, must be a class from 0 to 2"),
        "{class}"
    );
    let weight = refused(&|column| column.vote_weights[0] = -1.0);
    assert!(weight.contains("examples.1.vote_weights") && weight.contains("element 0 is -1"), "{weight}");
    let shape = refused(&|column| column.features.truncate(24));
    assert!(shape.contains("examples.1.features") && shape.contains("expected [3, 16]"), "{shape}");
    let sets =
        settings.to_bytes_with_examples(&weights, 2, &examples[..1]).expect_err("one set is missing").to_string();
    assert!(sets.contains("1 sets of examples, must be fold = 2"), "{sets}");
    let k = settings.to_bytes_with_examples(&weights, 0, &examples).expect_err("nothing votes").to_string();
    assert!(k.contains("nearest.k = 0, must be 1 to 1000"), "{k}");
}
