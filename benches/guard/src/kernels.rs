//! The kernels: each function prepares fixed inputs and returns the work of a round.
#![allow(clippy::unnecessary_wraps, reason = "all preparations are of one type, also those that cannot fail")]

use crate::street;
use anyhow::Context;
use coloring::{
    AgeLimits, Candidates, ColorImage, ColorSteps, PointBuffers, PosedExposure, ProjectionCamera, SubmapPoints,
    color_into, visibility_maps,
};
use formats::ply::{Header, Kind, PlyWriter};
use geometry::{CameraModel, Isometry3, Pinhole, RigCamera, Stamp, UnitQuaternion};
use kernels::images::{Border, Planes};
use lidar::velodyne::{BLOCKS_PER_PACKET, RawBlock, RawReturn, encode_data_packet};
use lidar::{Lidar, Model, PacketDecoder};
use materials::{Classifier, Method, Model as MaterialModel, Places, Smoothing, Spectra, materials_of};
use messages::{ClassRow, ColorRow, SubmapHeader, SubmapPoint};
use morphology::Connectivity;
use ndarray::Array2;
use random::Random;
use registration::{Odometry, OdometrySettings, Sweep, TimedPoint};
use segmentation::network::Inference;
use segmentation::spherical::{LoadedModel, SphericalModel};
use segmentation::{ModelInput, Options};
use spectral::{Calibration, Mosaic, Reference, WhiteTarget};
use std::f64::consts::FRAC_PI_2;
use std::hint::black_box;
use std::path::{Path, PathBuf};

/// Rounds that are not counted: they fill buffers, and the odometry matches its first two sweeps together.
pub const N_WARM: u32 = 2;
/// Rounds that are counted.
pub const N_COUNTED: u32 = 4;

type Round = Box<dyn FnMut() -> anyhow::Result<()>>;
type Prepare = fn() -> anyhow::Result<Round>;

/// Name, and preparation.
pub const KERNELS: [(&str, Prepare); 10] = [
    ("decode a revolution of an HDL-32E", decode),
    ("odometry, a sweep", odometry),
    ("dilate 512x512 f32, 5x5", dilation),
    ("components of 512x512 pixels", components),
    ("ground by BEV and morphology, a sweep", ground),
    ("network, an eighth of a sweep", network),
    ("color 60000 points from one exposure", color),
    ("write 100000 points as PLY", ply),
    ("mosaic of 512x512 pixels to cube", cube),
    ("materials of 10000 points", materials_of_points),
];

fn decode() -> anyhow::Result<Round> {
    let model = Model::from_name("hdl32e").context("no model hdl32e")?;
    let mut random = Random::new(1);
    let packet = |number: i64| {
        let mut blocks = [RawBlock::default(); BLOCKS_PER_PACKET];
        for (idx, block) in (0..).zip(&mut blocks) {
            block.azimuth = ((number * 12 + idx) * 36_000 / 2170 % 36_000) as u16;
            block.returns.fill_with(|| RawReturn {
                range_2mm: 500 + random.index(20_000) as u16,
                intensity: random.index(256) as u8,
            });
        }
        encode_data_packet(lidar::velodyne::Model::Hdl32e, Stamp(number * 552_960), &blocks)
    };
    let packets: Vec<_> = (0..181).map(packet).collect();
    let mut decoder = PacketDecoder::new(&Lidar::from(model));
    let mut points = Vec::new();
    Ok(Box::new(move || {
        points.clear();
        for packet in &packets {
            anyhow::ensure!(decoder.decode_into(packet, &mut points), "a packet was not decoded");
        }
        anyhow::ensure!(points.len() == 181 * 384, "{} points", points.len());
        Ok(())
    }))
}

fn odometry() -> anyhow::Result<Round> {
    let sweep = |number: u32| {
        let point = |shot: street::Shot| TimedPoint {
            position: shot.position,
            offset_nanos: shot.offset_nanos,
            ring: shot.ring,
        };
        let points = street::sweep(number).into_iter().map(point).collect();
        Sweep::new(Stamp(street::stamp(number)), points, street::RINGS)
    };
    let mut sweeps = (0..N_WARM + N_COUNTED).map(sweep).collect::<Vec<_>>().into_iter();
    let mut odometry = Odometry::new(OdometrySettings::default(), Isometry3::identity());
    Ok(Box::new(move || {
        let found = odometry.register(&sweeps.next().context("no more sweeps")?)?;
        if let Some(last) = found.last() {
            let truth = street::along(last.stamp.0 + i64::from(last.duration_nanos));
            let error = (last.end().translation.vector.x - truth).abs();
            anyhow::ensure!(error < 0.1, "the odometry is {error} m off");
        }
        Ok(())
    }))
}

fn image(side: usize) -> Array2<f32> {
    let mut random = Random::new(2);
    Array2::from_shape_fn((side, side), |(row, col)| ((row / 37 + col / 23) % 7) as f32 + random.unit())
}

fn dilation() -> anyhow::Result<Round> {
    let image = image(512);
    Ok(Box::new(move || {
        black_box(morphology::dilate(&image, 2));
        Ok(())
    }))
}

fn components() -> anyhow::Result<Round> {
    let mask = image(512).mapv(|height| height > 2.4);
    Ok(Box::new(move || {
        black_box(morphology::connected_components(&mask, Connectivity::Eight));
        Ok(())
    }))
}

/// One sweep as a submap.
fn submap() -> (Box<SubmapHeader>, Vec<SubmapPoint>) {
    let point = |shot: street::Shot| SubmapPoint {
        x: shot.position[0],
        y: shot.position[1],
        z: shot.position[2],
        offset_nanos: shot.offset_nanos,
        azimuth: shot.azimuth,
        ring: shot.ring,
        intensity: 20,
        ..SubmapPoint::default()
    };
    let points: Vec<SubmapPoint> = street::sweep(0).into_iter().map(point).collect();
    let header = SubmapHeader::one_sweep(points.len(), street::RINGS as usize);
    (header, points)
}

fn model_file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models").join(name)
}

fn ground() -> anyhow::Result<Round> {
    let model = segmentation::load(&model_file("ground.safetensors"), &Options::default())?;
    let (header, points) = submap();
    let mut classes = vec![ClassRow::default(); points.len()];
    Ok(Box::new(move || {
        model.segment(&ModelInput::new(&header, &points), &mut classes)?;
        Ok(())
    }))
}

/// Runs on an eighth of a sweep's image: valgrind computes fused multiplications one at a time.
fn network() -> anyhow::Result<Round> {
    let LoadedModel { model, weights } = SphericalModel::load(&model_file("street.safetensors"))?;
    let settings = model.settings();
    let network = Inference::new(settings.network.clone(), &weights, Border::Circular)?;
    let mut input = Planes::zeros(settings.network.inputs(), 32, settings.columns / settings.fold / 8);
    let mut random = Random::new(4);
    input.values_mut().fill_with(|| random.unit());
    let input = input.to_tensor()?;
    Ok(Box::new(move || {
        black_box(network.run(&input)?);
        Ok(())
    }))
}

fn color() -> anyhow::Result<Round> {
    const WIDTH: u32 = 800;
    const HEIGHT: u32 = 450;
    let model = CameraModel::Pinhole(Pinhole {
        width: WIDTH,
        height: HEIGHT,
        fx: 570.0,
        fy: 570.0,
        cx: 400.0,
        cy: 225.0,
        distortion: [-0.1, 0.01, 0.0, 0.0, 0.0],
    });
    let body_from_camera =
        Isometry3::rotation(UnitQuaternion::from_euler_angles(-FRAC_PI_2, 0.0, -FRAC_PI_2).scaled_axis());
    let camera = ProjectionCamera::from(&RigCamera { body_from_camera, model });
    let (header, mut points) = submap();
    // The points ahead, repeated, each time a little farther to the left.
    points.retain(|point| point.x > 2.0 && point.y.abs() < point.x);
    let ahead = points.clone();
    while points.len() < 60_000 {
        let by = points.len() as f32 * 1e-6;
        points.extend(ahead.iter().map(|point| SubmapPoint { y: point.y + by, ..*point }));
    }
    points.truncate(60_000);
    let bytes: Vec<u8> = (0..WIDTH * HEIGHT * 3).map(|i| (i % 251) as u8).collect();
    let mut buffers = PointBuffers::default();
    let mut rows = vec![ColorRow::default(); points.len()];
    Ok(Box::new(move || {
        let exposures: [PosedExposure<'_>; 1] =
            [camera.exposure(50_000_000, &Isometry3::identity(), &Isometry3::identity())];
        let images = [ColorImage::new(0, WIDTH, HEIGHT, &bytes).context("the image has another size")?];
        let points = SubmapPoints::new(&points, &header.sweeps[..1], 0, 32, &mut buffers);
        let limits = AgeLimits { max_age_s: 1.0, max_moving_age_s: 0.1 };
        let visibility = visibility_maps(&points, &exposures);
        let candidates = Candidates { points: &points, exposures: &exposures, visibility: &visibility, limits };
        color_into(&candidates, &images, ColorSteps::default(), &mut rows);
        let n_seen = rows.iter().filter(|row| row.camera == 0).count();
        anyhow::ensure!(n_seen > rows.len() / 2, "only {n_seen} points have a color");
        Ok(())
    }))
}

fn ply() -> anyhow::Result<Round> {
    let folder = tempfile::tempdir()?;
    let axes = ["x", "y", "z"].map(|name| (name, Kind::Float));
    let header = Header::new(axes.into_iter().chain([("timestamp", Kind::Double), ("intensity", Kind::UChar)]));
    let mut random = Random::new(3);
    let points: Vec<[f32; 3]> = (0..100_000).map(|_| [0; 3].map(|_: u8| random.range(-50.0, 50.0))).collect();
    Ok(Box::new(move || {
        let mut writer = PlyWriter::create(&folder.path().join("cloud.ply"), &header, points.len())?;
        writer.write_each(points.len(), |i, row| {
            let [x, y, z] = points[i];
            row.f32(x).f32(y).f32(z).f64(i as f64 * 1e-6).u8(i as u8);
        })?;
        writer.finish_unsynced()?;
        Ok(())
    }))
}

fn cube() -> anyhow::Result<Round> {
    let mosaic = Mosaic::new([512, 512], 4, [0, 0, 512, 512], 10)?;
    let frame = |level: u32| (0..512 * 512_u32).map(|i| (level + i * 7 % 61) as u16).collect::<Vec<_>>();
    let reference = |what, level| {
        let mut reference = Reference::new(what, &mosaic);
        reference.add(&frame(level)).map(|()| reference)
    };
    let target = WhiteTarget { reflectance: 0.98, exposure_nanos: 5_000_000 };
    let calibration = Calibration::new(&mosaic, &reference("dark", 20)?, &reference("white", 700)?, target)?;
    let raw = frame(360);
    let mut cube = vec![0.0; mosaic.n_bands() * mosaic.n_cells()];
    let mut masks = vec![0; mosaic.n_cells()];
    Ok(Box::new(move || {
        calibration.cube_into(&raw, 5_000_000, &mut cube, &mut masks)?;
        Ok(())
    }))
}

fn materials_of_points() -> anyhow::Result<Round> {
    let model = MaterialModel::built_in()?;
    let mut random = Random::new(9);
    let mut spectra = Spectra::new(&model.wavelengths_nm);
    let mut positions = Vec::new();
    for _ in 0..10_000 {
        let reference = random.pick(&model.references);
        let gain = 0.3 * random.gauss();
        let values: Vec<f32> =
            reference.log_reflectance.iter().map(|log| (log + gain + 0.05 * random.gauss()).exp()).collect();
        spectra.push(u64::MAX, &values);
        positions.push([random.range(0.0, 6.0), random.range(0.0, 6.0), 0.02 * random.gauss()]);
    }
    let classifier = Classifier::new(&model, &model.wavelengths_nm, Method::default());
    Ok(Box::new(move || {
        let places = Places { positions: &positions, regions: None };
        let found = materials_of(&classifier, &spectra, places, Smoothing::default());
        anyhow::ensure!(black_box(found).len() == 10_000, "not all points have a material");
        Ok(())
    }))
}
