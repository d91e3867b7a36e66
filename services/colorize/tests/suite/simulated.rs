//! A simulated street: vegetation is green in color and bright in the near infrared.

use crate::support::{bare_manifest, camera, drive, mosaic, stamped, submap};
use colorize::{Colorize, Settings};
use drive::manifest::Manifest;
use geometry::Stamp;
use messages::{
    ClassId, ColorRow, ColorTopic, CubeHeader, CubeTopic, ImageHeader, ImageTopic, NoHeader, SpectraTopic, SpectraView,
    StampedPose, SubmapPoint, SubmapTopic, TrajectoryTopic, UNSEEN, pod::cast_slice_mut,
};
use nalgebra::{Point3, Vector3};
use rayon::prelude::*;
use raytrace::Ray;
use simulation::sensors::camera::ColorCamera;
use simulation::sensors::mosaic::{
    BIT_DEPTH, EXPOSURE_NANOS, MosaicCamera, SIZE, WHITE_EXPOSURE_NANOS, WHITE_REFLECTANCE,
};
use simulation::{DriveSpec, RigSpec, Simulation};
use spectral::{Calibration, Mosaic, Reference, WhiteTarget};
use stage::testing::{Bench, context};
use std::sync::LazyLock;

/// Number of points for classes.
const SPARSE: u32 = 60_000;
/// Number of points for outlines: the visibility maps have no gaps.
const DENSE: u32 = 700_000;

fn manifest() -> Manifest {
    let rig = RigSpec::l3d2();
    let mosaics = rig.mosaics.iter().map(|spec| {
        let sensor = &spec.sensor;
        let area = sensor.active_area.map(|v| v as u32);
        let mut entry = mosaic(&spec.name, spec.body_from_camera, spec.lens.clone(), sensor.pattern as u32, area);
        entry.wavelengths_nm = sensor.bands().iter().map(|band| f64::from(band.center_nm)).collect();
        entry
    });
    Manifest {
        cameras: rig.cameras.iter().map(|spec| camera(&spec.name, spec.body_from_camera, spec.lens.clone())).collect(),
        mosaics: mosaics.collect(),
        ..bare_manifest()
    }
}

/// Points and classes that rays in all directions from above the roof hit, each at its own time within a tenth of a second of
/// `stamp`.
fn points(simulation: &Simulation, stamp: Stamp, n_points: u32) -> Vec<(SubmapPoint, ClassId)> {
    let submap_from_world = simulation.motion.pose_at(stamp).inverse();
    let cast = |i: u32| {
        // Fibonacci sphere: uniform in all directions.
        let z = 1.0 - 2.0 * (f64::from(i) + 0.5) / f64::from(n_points);
        let angle = f64::from(i) * 2.399_963_229_728_653;
        let across = (1.0 - z * z).sqrt();
        let offset_nanos = i.wrapping_mul(2_654_435_761) % 200_000_000;
        let seconds = stamp.seconds_since(simulation.motion.begin) - 0.1 + f64::from(offset_nanos) * 1e-9;
        let world_from_body = simulation.motion.pose(seconds);
        let origin = world_from_body * Point3::new(-0.4, 0.0, 2.3);
        let direction = world_from_body * Vector3::new(across * angle.cos(), across * angle.sin(), z);
        let ray = Ray { origin: origin.coords.cast(), direction: direction.cast(), seed: u64::from(i) };
        let hit = simulation.scene.cast(&simulation.scene.at(seconds), &ray, 40.0)?;
        let p = submap_from_world * (origin + direction * f64::from(hit.range_m));
        let point = SubmapPoint { x: p.x as f32, y: p.y as f32, z: p.z as f32, offset_nanos, ..SubmapPoint::default() };
        Some((point, hit.surface.class))
    };
    (0..n_points).into_par_iter().filter_map(cast).collect()
}

fn cube(simulation: &Simulation, index: usize, stamp: Stamp) -> (CubeHeader, Vec<u32>) {
    let spec = &simulation.rig.mosaics[index];
    let model = spec.sensor.clone();
    let bands = model.bands();
    let [x0, y0, width, height] = model.active_area.map(|v| v as u32);
    let pattern = model.pattern as u32;
    let mosaic = Mosaic::new(SIZE.map(|v| v as u32), pattern, [x0, y0, width, height], BIT_DEPTH).expect("sound");
    let camera = MosaicCamera::new(model, &spec.lens);
    let reference = |what, frame: &[u16]| {
        let mut reference = Reference::new(what, &mosaic);
        reference.add(frame).map(|()| reference).expect("fits")
    };
    let target = WhiteTarget { reflectance: f64::from(WHITE_REFLECTANCE), exposure_nanos: WHITE_EXPOSURE_NANOS };
    let dark = reference("dark", &camera.dark(1));
    let white = reference("white", &camera.white(2));
    let calibration = Calibration::new(&mosaic, &dark, &white, target).expect("sound");
    let raw = simulation.mosaic(&camera, index, stamp);
    let mut rows = vec![0; (mosaic.n_bands() + 1) * mosaic.n_cells()];
    let (reflectances, masks) = rows.split_at_mut(mosaic.n_bands() * mosaic.n_cells());
    calibration.cube_into(&raw, EXPOSURE_NANOS, cast_slice_mut(reflectances), masks).expect("fits");
    let [columns, rows_of_cells] = mosaic.cells();
    let mut header = CubeHeader {
        camera: index as u32,
        width: columns,
        height: rows_of_cells,
        n_bands: bands.len() as u32,
        pattern,
        valid_bands: calibration.valid_bands(),
        x0,
        y0,
        exposure_nanos: EXPOSURE_NANOS,
        ..CubeHeader::default()
    };
    for (out, band) in header.wavelengths_nm.iter_mut().zip(bands) {
        *out = band.center_nm;
    }
    (header, rows)
}

/// Points on vegetation in view of the first mosaic camera, which faces left.
fn n_vegetation_in_view(simulation: &Simulation, stamp: Stamp) -> usize {
    let camera = &simulation.rig.mosaics[0];
    let camera_from_body = camera.body_from_camera.inverse();
    let points = points(simulation, stamp, SPARSE);
    let vegetation = points.iter().filter(|(_, class)| *class == ClassId::Vegetation);
    let p_in_camera = vegetation.map(|(p, _)| camera_from_body * Point3::new(p.x, p.y, p.z).cast::<f64>());
    p_in_camera.filter(|p| camera.lens.pixel_from_camera(p).is_some()).count()
}

fn mean_of(values: impl Iterator<Item = f64>) -> f64 {
    let values: Vec<f64> = values.collect();
    assert!(values.len() > 100, "only {} values", values.len());
    values.iter().sum::<f64>() / values.len() as f64
}

/// The poses around a stamp.
fn poses(simulation: &Simulation, stamp: Stamp) -> Vec<StampedPose> {
    let stamps = (-30..=30).map(|i| stamp.plus_nanos(i * 50_000_000));
    stamps.map(|stamp| stamped(stamp.0, simulation.motion.pose_at(stamp))).collect()
}

/// The images of all color cameras.
fn images(simulation: &Simulation, stamp: Stamp) -> Vec<(ImageHeader, Vec<u8>)> {
    let camera = ColorCamera::new(&simulation.rig.cameras[0].lens);
    let [width, height] = camera.size();
    let image = |index: usize| {
        let header = ImageHeader { camera: index as u32, width, height, channels: 3, exposure_nanos: 2_000_000 };
        (header, simulation.image(&camera, index, stamp))
    };
    (0..simulation.rig.cameras.len()).map(image).collect()
}

/// A street at the exposure with the most vegetation in view, and its color images. Most of the time of its tests is spent on the
/// images.
struct Street {
    simulation: Simulation,
    stamp: Stamp,
    images: Vec<(ImageHeader, Vec<u8>)>,
}

static STREET: LazyLock<Street> = LazyLock::new(|| {
    let simulation = Simulation::new(&DriveSpec::urban(1, 6.0)).expect("a town");
    let in_view = |stamp: &Stamp| n_vegetation_in_view(&simulation, *stamp);
    let stamp = simulation.exposures().into_iter().max_by_key(in_view).expect("exposures");
    Street { images: images(&simulation, stamp), simulation, stamp }
});

#[test]
fn reject_sky_takes_the_blue_out_of_trees() {
    let Street { simulation, stamp, images } = &*STREET;
    let stamp = *stamp;
    let (points, classes): (Vec<SubmapPoint>, Vec<ClassId>) = points(simulation, stamp, DENSE).into_iter().unzip();
    let folder = drive(&manifest());
    let n_blue = |reject_sky: bool| {
        let settings = Settings { reject_sky, ..Settings::default() };
        let mut bench = Bench::<Colorize>::new(&settings, &context(folder.path())).expect("starts");
        bench.send::<TrajectoryTopic>(stamp.0, NoHeader::default(), poses(simulation, stamp));
        for (header, rows) in images {
            bench.send::<ImageTopic>(stamp.0, *header, rows.clone());
        }
        let begin = stamp.0 - 100_000_000;
        let header = submap(simulation.motion.pose_at(stamp), begin, &points);
        bench.send::<SubmapTopic>(begin, header, points.clone());
        bench.tick().expect("a tick");
        let color = &bench.take::<ColorTopic>()[0];
        let trees = color.rows().iter().zip(&classes).filter(|(_, class)| **class == ClassId::Vegetation);
        trees.filter(|(row, _)| row.camera != UNSEEN && row.b > row.g.max(row.r).max(120)).count()
    };
    let kept = n_blue(false);
    let rejected = n_blue(true);
    println!("blue points on trees: {kept}, {rejected} with reject_sky");
    assert!(kept > 50 && 3 * rejected < 2 * kept, "{rejected} instead of {kept}");
}

#[test]
fn vegetation_is_green_and_bright_in_the_near_infrared() {
    let Street { simulation, stamp, images } = &*STREET;
    let stamp = *stamp;
    let folder = drive(&manifest());
    let mut bench = Bench::<Colorize>::new(&Settings::default(), &context(folder.path())).expect("starts");

    bench.send::<TrajectoryTopic>(stamp.0, NoHeader::default(), poses(simulation, stamp));
    for (header, rows) in images {
        bench.send::<ImageTopic>(stamp.0, *header, rows.clone());
    }
    for index in 0..2 {
        let (header, rows) = cube(simulation, index, stamp);
        bench.send::<CubeTopic>(stamp.0, header, rows);
    }
    let (points, classes): (Vec<SubmapPoint>, Vec<ClassId>) = points(simulation, stamp, SPARSE).into_iter().unzip();
    let begin = stamp.0 - 100_000_000;
    bench.send::<SubmapTopic>(begin, submap(simulation.motion.pose_at(stamp), begin, &points), points);
    bench.tick().expect("a tick");

    let color = &bench.take::<ColorTopic>()[0];
    let seen = || color.rows().iter().zip(&classes).filter(|(row, _)| row.camera != UNSEEN);
    // Points steeply below the vehicle are in no view.
    assert!(seen().count() * 10 > classes.len() * 7, "{} of {}", seen().count(), classes.len());
    // Relative to brightness, because trees shade themselves.
    let greenness = |row: &ColorRow| {
        let [r, g, b] = [row.r, row.g, row.b].map(f64::from);
        (2.0 * g - r - b) / (r + g + b).max(1.0)
    };
    let mean_greenness = |class| mean_of(seen().filter(|(_, of)| **of == class).map(|(row, _)| greenness(row)));
    let tree = mean_greenness(ClassId::Vegetation);
    let road = mean_greenness(ClassId::Road);
    println!("greenness of vegetation {tree:.3}, of the road {road:.3}");
    assert!(tree > 0.1 && road.abs() < 0.05);

    let spectra = &bench.take::<SpectraTopic>()[0];
    let header = spectra.header();
    let view = SpectraView::new(header, spectra.rows()).expect("fits");
    let mean = |class: ClassId, low: f32, high: f32| {
        let of_class = (0..classes.len()).filter(|i| classes[*i] == class).filter_map(|i| view.spectrum(i));
        mean_of(of_class.flat_map(|(valid, reflectances)| {
            let bands = (0..header.n_bands as usize)
                .filter(move |band| valid >> band & 1 == 1 && (low..high).contains(&header.wavelengths_nm[*band]));
            bands.map(|band| f64::from(reflectances[band])).collect::<Vec<_>>()
        }))
    };
    let red_edge = |class| mean(class, 760.0, 900.0) / mean(class, 620.0, 690.0);
    let tree = red_edge(ClassId::Vegetation);
    let facade = red_edge(ClassId::Building);
    println!("near infrared over red: vegetation {tree:.2}, facades {facade:.2}; {} spectra", header.n_spectra);
    // Facades are as bright in red as in the near infrared. Leaves are much brighter there, but through gaps of the crowns the
    // camera sees other surfaces than the beam hit, and some facades are seen through leaves: 2.6 and 1.3.
    assert!(tree > 2.2 && facade < 1.4);
}
