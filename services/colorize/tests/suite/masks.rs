//! From raw samples to points: exactly the dead, saturated and clipped samples of a mosaic are invalid in the spectra.

use crate::support::painted_street::{self as street, SECOND, START};
use crate::support::{bare_manifest, drive, submap};
use colorize::{Colorize, Settings};
use drive::manifest::MosaicEntry;
use formats::pgm::pgm_from_samples;
use geometry::Point3;
use messages::{
    CubeHeader, CubeTopic, NoHeader, SpectraTopic, SpectraView, SubmapTopic, TrajectoryTopic, pod::cast_slice_mut,
};
use spectral::{Camera, Demosaicing, FullResolution};
use stage::testing::{Bench, context};
use std::path::Path;

const DARK: u16 = 40;
const SATURATION: u16 = 1023;
const ALL: u64 = 0xffff;
/// Band without a white signal.
const DEAD: u32 = 11;
/// Band at the largest value in the left half of the image, and at zero in its right half.
const SATURATED: u32 = 2;
const CLIPPED: u32 = 7;

fn reflectance(band: u32) -> f64 {
    0.1 + 0.03 * f64::from(band)
}

/// A raw frame from the sample of each band in each column.
fn frame(entry: &MosaicEntry, sample: impl Fn(u32, u32) -> u16) -> Vec<u16> {
    let (width, height) = entry.model.size();
    let [x0, y0, ..] = entry.active_area;
    let band = |x: u32, y: u32| (y + 100 - y0) % 4 * 4 + (x + 100 - x0) % 4;
    (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| sample(band(x, y), x)).collect()
}

fn write_references(drive: &Path, entry: &MosaicEntry) {
    let (width, height) = entry.model.size();
    let white = frame(entry, |band, _| if band == DEAD { DARK } else { DARK + 600 });
    for (name, samples) in [("dark", frame(entry, |_, _| DARK)), ("white", white)] {
        let folder = drive.join(&entry.folder).join(name);
        std::fs::create_dir_all(&folder).expect("made");
        let bytes = pgm_from_samples(width, height, SATURATION, &samples);
        std::fs::write(folder.join("0.pgm"), bytes).expect("written");
    }
}

/// The cube of a frame, as `calibrate` publishes it.
fn cube(camera: &Camera, raw: &[u16], method: Option<Demosaicing>) -> (CubeHeader, Vec<u32>) {
    let [columns, rows] = camera.mosaic().cells();
    let [x0, y0] = camera.mosaic().origin();
    let (pattern, scale) = if method.is_some() { (1, 4) } else { (4, 1) };
    let mut header = CubeHeader {
        width: columns * scale,
        height: rows * scale,
        n_bands: 16,
        pattern,
        valid_bands: camera.valid_bands(),
        x0,
        y0,
        exposure_nanos: 5_000_000,
        ..CubeHeader::default()
    };
    header.wavelengths_nm[..16].copy_from_slice(camera.wavelengths_nm());
    let n_cells = (header.width * header.height) as usize;
    let mut words = vec![0; 17 * n_cells];
    let (values, masks) = words.split_at_mut(16 * n_cells);
    let values = cast_slice_mut(values);
    let counts = match method {
        Some(method) => {
            let mut full = FullResolution::new(camera, method).expect("fits");
            full.cube_into(camera, raw, 5_000_000, values, masks)
        }
        None => camera.cube_into(raw, 5_000_000, values, masks),
    };
    let counts = counts.expect("fits");
    assert!(counts.dead > 1000 && counts.saturated > 1000 && counts.clipped > 1000, "{counts:?}");
    (header, words)
}

#[test]
fn dead_saturated_and_clipped_samples_are_invalid_on_points() {
    let mut manifest = street::manifest();
    manifest.cameras.clear();
    manifest.mosaics.remove(0);
    let entry = manifest.mosaics[0].clone();
    assert_eq!((entry.pattern, bare_manifest().mosaics.len()), (4, 0));
    let folder = drive(&manifest);
    write_references(folder.path(), &entry);
    let camera = Camera::read(folder.path(), &entry, None).expect("has references");
    let middle = entry.model.size().0 / 2;
    let raw = frame(&entry, |band, x| match band {
        SATURATED if x < middle => SATURATION,
        CLIPPED if x >= middle => 0,
        band => DARK + (600.0 * reflectance(band) / 0.98).round() as u16,
    });
    let stamp = START + SECOND / 2;
    let painted = street::points(1_000_000_000);
    let points: Vec<_> = painted.iter().map(|painted| painted.point).collect();
    let camera_from_odom =
        (street::odom_from_body(stamp) * entry.body_from_camera.to_pose().expect("a pose")).inverse();
    let column = |point: &messages::SubmapPoint| {
        let p_in_submap = Point3::new(point.x, point.y, point.z).cast();
        let pixel = entry.model.pixel_from_camera(&(camera_from_odom * street::odom_from_submap() * p_in_submap));
        pixel.map(|pixel| pixel.x)
    };
    for method in [None, Some(Demosaicing::PpiDifference)] {
        let (cube_header, cube_rows) = cube(&camera, &raw, method);
        let mut bench = Bench::<Colorize>::new(&Settings::default(), &context(folder.path())).expect("starts");
        bench.send::<TrajectoryTopic>(
            START,
            NoHeader::default(),
            street::trajectory(START - SECOND, START + 3 * SECOND),
        );
        bench.send::<CubeTopic>(stamp, cube_header, cube_rows);
        bench.send::<SubmapTopic>(START, submap(street::odom_from_submap(), START, &points), points.clone());
        bench.tick().expect("a tick");
        bench.finish().expect("an end");
        let spectra = bench.take::<SpectraTopic>();
        let view = SpectraView::new(spectra[0].header(), spectra[0].rows()).expect("fits");
        let mut n = [0; 2];
        for (point_idx, point) in points.iter().enumerate() {
            let Some((valid, values)) = view.spectrum(point_idx) else { continue };
            let column = column(point).expect("a point with a spectrum is in the image");
            // Near the border of the halves, demosaicing lacks one more band.
            if (column - f64::from(middle)).abs() < 8.0 {
                continue;
            }
            let is_right = column > f64::from(middle);
            let unknown = if is_right { CLIPPED } else { SATURATED };
            assert_eq!(valid, ALL & !(1 << DEAD) & !(1 << unknown), "{method:?} in column {column}");
            for (band, value) in values.iter().enumerate() {
                let expected = if valid >> band & 1 == 1 { reflectance(band as u32) } else { 0.0 };
                assert!((f64::from(*value) - expected).abs() < 0.002, "{method:?} band {band}: {value}");
            }
            n[usize::from(is_right)] += 1;
        }
        assert!(n.iter().all(|n| *n > 20), "{method:?}: {n:?}");
    }
}
