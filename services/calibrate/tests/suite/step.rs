//! Small mosaics of known reflectance, tick by tick.

use crate::mosaics::{
    DARK, HEIGHT, SATURATION, STAMP, T_RAW, T_WHITE, WIDTH, drive, drive_with_references, frame, header, manifest,
    write_pgm, write_references,
};
use calibrate::{Calibrate, Settings};
use drive::manifest::{Manifest, MosaicEntry, WhitePanelEntry};
use formats::sensor_calibration::{CorrectionMatrix, Curve, FilterBand, SensorCalibration, VirtualBand};
use messages::{CubeTopic, CubeView, MosaicHeader, MosaicTopic};
use spectral::Resolution;
use stage::testing::{Bench, context};
use stage::{Context, Mode, Received, Stage};
use std::path::Path;
use tempfile::TempDir;

fn bench(folder: &Path) -> Bench<Calibrate> {
    Bench::new(&Settings::default(), &context(folder)).expect("starts")
}

/// Reflectance of band k of camera `index` in the scene.
fn truth(index: usize, band: u32) -> f64 {
    0.05 + 0.02 * f64::from(band) + 0.2 * index as f64
}

fn scene(index: usize, entry: &MosaicEntry) -> Vec<u16> {
    let [x0, y0, ..] = entry.active_area;
    let p = entry.pattern;
    frame(T_RAW, |x, y| truth(index, (y + 10 * p - y0) % p * p + (x + 10 * p - x0) % p))
}

fn assert_is_truth(cube: &Received<CubeTopic>) {
    let header = cube.header();
    let index = header.camera as usize;
    let view = CubeView::new(header, cube.rows()).expect("fits");
    for band in 0..header.n_bands {
        for (reflectance, mask) in view.band(band as usize).iter().zip(view.masks()) {
            assert_eq!(mask >> band & 1, 1);
            let error = f64::from(*reflectance) - truth(index, band);
            assert!(error.abs() < 0.001, "camera {index} band {band}: {reflectance}");
        }
    }
}

#[test]
fn frame_becomes_a_cube_of_its_reflectances() {
    let manifest = manifest();
    let folder = drive(&manifest);
    let mut bench = bench_with_references(folder.path());
    for (index, entry) in manifest.mosaics.iter().enumerate() {
        bench.send::<MosaicTopic>(STAMP + index as i64, header(index as u32), scene(index, entry));
    }
    bench.tick().expect("a tick");
    let cubes = bench.take::<CubeTopic>();
    assert_eq!(cubes.len(), 2);
    for (index, (cube, entry)) in cubes.iter().zip(&manifest.mosaics).enumerate() {
        let header = cube.header();
        assert_eq!((cube.seq(), cube.stamp()), (index as u64, STAMP + index as i64));
        let [x0, y0, width, height] = entry.active_area;
        assert_eq!((header.x0, header.y0, header.pattern), (x0, y0, entry.pattern));
        assert_eq!((header.width, header.height), (width / entry.pattern, height / entry.pattern));
        assert_eq!(
            (header.camera as usize, header.n_bands, header.exposure_nanos),
            (index, entry.pattern.pow(2), T_RAW)
        );
        assert_eq!(header.valid_bands, (1 << header.n_bands) - 1);
        let wavelengths = header.wavelengths_nm.iter().zip(&entry.wavelengths_nm);
        assert!(wavelengths.clone().all(|(got, expected)| f64::from(*got) == *expected));
        assert!(header.wavelengths_nm[header.n_bands as usize..].iter().all(|w| *w == 0.0));
        assert_is_truth(cube);
    }
    assert_eq!(bench.counter("masked"), 0);
    assert_eq!(bench.counter("samples"), 8 * 5 * 25 + 10 * 7 * 16);
}

#[test]
fn live_vehicle_has_its_rig_and_its_references_in_other_folders() {
    let manifest = manifest();
    let folder = tempfile::tempdir().expect("a folder");
    let rig = folder.path().join("vehicle.toml");
    std::fs::write(&rig, stage::toml::to_string(&manifest).expect("encodes")).expect("written");
    let context =
        Context { mode: Mode::Live, drive: rig, launch_folder: folder.path().into(), ..context(folder.path()) };
    let settings = Settings { references: "grabber".into(), ..Settings::default() };
    let problems = Calibrate::check(&settings, &context);
    assert!(problems.len() == 1 && problems[0].text.ends_with("grabber is not a folder"), "{problems:?}");
    for entry in &manifest.mosaics {
        write_references(&folder.path().join("grabber"), &entry.folder);
    }
    assert_eq!(Calibrate::check(&settings, &context), []);
    let mut bench = Bench::<Calibrate>::new(&settings, &context).expect("starts");
    for (index, entry) in manifest.mosaics.iter().enumerate() {
        bench.send::<MosaicTopic>(STAMP + index as i64, header(index as u32), scene(index, entry));
    }
    bench.tick().expect("a tick");
    let cubes = bench.take::<CubeTopic>();
    assert_eq!(cubes.len(), 2);
    cubes.iter().for_each(assert_is_truth);
    let offline = Context { mode: Mode::Offline, ..context };
    let problems = Calibrate::check(&settings, &offline);
    assert!(problems.len() == 1 && problems[0].key == "references", "{problems:?}");
    // Without a rig the vehicle has no cameras.
    let context = Context { mode: Mode::Live, drive: std::path::PathBuf::new(), ..offline };
    let mut bench = Bench::<Calibrate>::new(&Settings::default(), &context).expect("starts");
    bench.tick().expect("a tick");
    assert!(bench.take::<CubeTopic>().is_empty());
}

fn bench_with_references(folder: &Path) -> Bench<Calibrate> {
    write_references(folder, "hs02");
    write_references(folder, "hs03");
    bench(folder)
}

#[test]
fn invalid_samples_are_masked_and_counted() {
    let manifest = manifest();
    let folder = drive(&manifest);
    write_references(folder.path(), "hs03");
    let dead = frame(T_WHITE, |x, y| if (x, y) == (3 + 4, 1) { 0.0 } else { 0.98 });
    write_pgm(&folder.path().join("hs03/white/000.pgm"), &dead);
    let mut bench = bench(folder.path());
    let mut samples = scene(1, &manifest.mosaics[1]);
    samples[(WIDTH + 3) as usize] = SATURATION;
    samples[(WIDTH + 3 + 9) as usize] = 0;
    bench.send::<MosaicTopic>(STAMP, header(1), samples);
    bench.tick().expect("a tick");
    let cubes = bench.take::<CubeTopic>();
    let view = CubeView::new(cubes[0].header(), cubes[0].rows()).expect("fits");
    assert_eq!(view.masks()[..4], [0xfffe, 0xfffe, 0xfffd, 0xffff]);
    assert_eq!((view.band(0)[0], view.band(0)[1], view.band(1)[2]), (0.0, 0.0, 0.0));
    let counters = ["saturated_samples", "dead_samples", "clipped_samples", "masked"].map(|name| bench.counter(name));
    assert_eq!(counters, [1, 1, 1, 3]);
}

#[test]
fn frames_of_a_camera_without_references_are_skipped_and_reported() {
    let manifest = manifest();
    let folder = drive(&manifest);
    write_references(folder.path(), "hs03");
    std::fs::create_dir_all(folder.path().join("hs02/dark")).expect("made");
    let mut bench = bench(folder.path());
    for _ in 0..2 {
        bench.send::<MosaicTopic>(STAMP, header(0), scene(0, &manifest.mosaics[0]));
        bench.send::<MosaicTopic>(STAMP, header(1), scene(1, &manifest.mosaics[1]));
        bench.tick().expect("a tick");
    }
    let cubes = bench.take::<CubeTopic>();
    assert_eq!(cubes.iter().map(|cube| cube.header().camera).collect::<Vec<_>>(), [1, 1]);
    assert_eq!(cubes.iter().map(Received::seq).collect::<Vec<_>>(), [0, 1]);
    assert_eq!(bench.counter("frames_without_reference"), 2);
    let folder = folder.path().join("hs02/dark");
    assert_eq!(bench.notes(), [format!("hs02: no dark reference in {}: no reflectance", folder.display())]);
}

#[test]
fn invalid_references_are_named() {
    let (manifest, folder) = drive_with_references();
    std::fs::write(folder.path().join("hs02/white/000.pgm"), b"P5\n2 2\n65535\n\0\x01\0\x02\0\x03\0\x04")
        .expect("written");
    std::fs::write(folder.path().join("hs03/white/000.pgm"), b"P5\n43 29\n65535\n\0\x01").expect("written");
    let mut bench = bench(folder.path());
    bench.send::<MosaicTopic>(STAMP, header(0), scene(0, &manifest.mosaics[0]));
    bench.send::<MosaicTopic>(STAMP, header(1), scene(1, &manifest.mosaics[1]));
    bench.tick().expect("a tick");
    assert_eq!(bench.take::<CubeTopic>().len(), 0);
    assert_eq!(bench.counter("frames_without_reference"), 2);
    assert!(bench.notes()[0].contains("000.pgm: 2x2 px; must be 43x29"), "{:?}", bench.notes());
    assert!(bench.notes()[1].starts_with("hs03: ") && bench.notes()[1].contains("000.pgm"), "{:?}", bench.notes());
}

#[test]
fn frames_that_do_not_fit_are_skipped_and_counted() {
    let manifest = manifest();
    let folder = drive(&manifest);
    let mut bench = bench_with_references(folder.path());
    let samples = scene(0, &manifest.mosaics[0]);
    bench.send::<MosaicTopic>(STAMP, header(2), samples.clone());
    bench.send::<MosaicTopic>(STAMP, MosaicHeader { width: HEIGHT, height: WIDTH, ..header(0) }, samples.clone());
    bench.send::<MosaicTopic>(STAMP, MosaicHeader { bit_depth: 10, ..header(0) }, samples.clone());
    bench.send::<MosaicTopic>(STAMP, MosaicHeader { exposure_nanos: 0, ..header(0) }, samples.clone());
    bench.send::<MosaicTopic>(STAMP, header(0), samples[1..].to_vec());
    bench.send::<MosaicTopic>(STAMP, header(0), samples);
    bench.tick().expect("a tick");
    assert_eq!(bench.take::<CubeTopic>().len(), 1);
    assert_eq!(bench.counter("frames_unusable"), 5);
    assert_eq!(bench.notes().len(), 5);
}

#[test]
fn frames_of_cameras_of_another_stage_are_left_to_it() {
    let manifest = manifest();
    let folder = drive(&manifest);
    manifest.mosaics.iter().for_each(|entry| write_references(folder.path(), &entry.name));
    let settings = Settings { cameras: vec!["hs03".to_owned()], ..Settings::default() };
    let context = context(folder.path());
    assert_eq!(Calibrate::check(&settings, &context), Vec::new());
    let mut bench = Bench::<Calibrate>::new(&settings, &context).expect("starts");
    for (index, entry) in manifest.mosaics.iter().enumerate() {
        bench.send::<MosaicTopic>(STAMP, header(index as u32), scene(index, entry));
    }
    bench.tick().expect("a tick");
    let cubes = bench.take::<CubeTopic>();
    assert_eq!(cubes.iter().map(|cube| cube.header().camera).collect::<Vec<_>>(), [1]);
    assert_is_truth(&cubes[0]);
    assert_eq!((bench.notes().len(), bench.counter("samples")), (0, 10 * 7 * 16));
    let settings = Settings { cameras: vec!["hs04".to_owned()], ..Settings::default() };
    let problems = Calibrate::check(&settings, &context);
    assert_eq!((problems.len(), problems[0].key.as_str()), (1, "cameras"));
    assert_eq!(problems[0].text, "names hs04; the mosaic cameras of the drive are hs02, hs03");
}

#[test]
fn restart_in_mid_stream_gives_the_same_cubes() {
    let manifest = manifest();
    let folder = drive(&manifest);
    let settings = Settings::default();
    let context = context(folder.path());
    let mut bench = bench_with_references(folder.path());
    let mut cubes = Vec::new();
    for tick in 0..2 {
        bench.send::<MosaicTopic>(STAMP + tick, header(0), scene(0, &manifest.mosaics[0]));
        bench.tick().expect("a tick");
        cubes.extend(bench.take::<CubeTopic>());
        bench = bench.restarted(&settings, &context).expect("takes its state up");
    }
    assert_eq!(cubes.iter().map(Received::stamp).collect::<Vec<_>>(), [STAMP, STAMP + 1]);
    assert_eq!(cubes[0].rows(), cubes[1].rows());
    assert_eq!(cubes[0].header(), cubes[1].header());
    assert!(bench.stage.load(b"something else").is_err());
}

/// Virtual bands of hs03: each has the weight 2 for its own filter and -1 for the next one; the last has no next one.
fn virtual_bands() -> Vec<VirtualBand> {
    let row = |j: usize| VirtualBand {
        wavelength_nm: 470.0 + 10.0 * j as f64,
        fwhm_nm: 12.0,
        coefficients: (0..16).map(|k| if k == j { 2.0 } else { -f64::from(u8::from(k == j + 1)) }).collect(),
    };
    (0..15).map(row).collect()
}

/// A drive whose hs03 has the calibration file of its maker.
fn drive_with_sensor(active_area: [u32; 4]) -> (TempDir, Manifest) {
    let mut manifest = manifest();
    manifest.mosaics[1].sensor = Some("hs03/sensor.xml".to_owned());
    let folder = drive(&manifest);
    let response = Curve::from_samples(vec![(460.0, 0.1), (640.0, 0.3)]);
    let band = FilterBand { selected: true, peaks: Vec::new(), response };
    let sensor = SensorCalibration {
        version: 1,
        sensor_id: "test".to_owned(),
        size: [WIDTH, HEIGHT],
        bit_depth: Some(12),
        full_well_electrons: None,
        active_area,
        pattern: 4,
        spectral_range_nm: [470.0, 630.0],
        bands: vec![band; 16],
        optical_components: Vec::new(),
        matrices: vec![CorrectionMatrix {
            name: "hsi".to_owned(),
            kind: "hyperspectral".to_owned(),
            virtual_bands: virtual_bands(),
        }],
    };
    std::fs::write(folder.path().join("hs03/sensor.xml"), sensor.to_xml()).expect("written");
    (folder, manifest)
}

#[test]
fn calibration_file_turns_filter_bands_into_virtual_bands() {
    let (folder, manifest) = drive_with_sensor([3, 1, 40, 28]);
    write_references(folder.path(), "hs02");
    write_references(folder.path(), "hs03");
    let mut samples = scene(1, &manifest.mosaics[1]);
    // Band 2 of the second cell: bands 1 and 2 of the cube weigh it.
    samples[(WIDTH + 3 + 4 + 2) as usize] = SATURATION;
    for (correction, median) in [(true, false), (false, false), (true, true)] {
        let settings = Settings { correction, median, ..Settings::default() };
        let mut bench = Bench::<Calibrate>::new(&settings, &context(folder.path())).expect("starts");
        bench.send::<MosaicTopic>(STAMP, header(1), samples.clone());
        bench.tick().expect("a tick");
        let cubes = bench.take::<CubeTopic>();
        let header = cubes[0].header();
        let view = CubeView::new(header, cubes[0].rows()).expect("fits");
        assert_eq!(bench.counter("samples"), 10 * 7 * 16);
        if !correction {
            assert_eq!((header.n_bands, view.masks()[1]), (16, 0xfffb));
            continue;
        }
        assert_eq!((header.n_bands, header.valid_bands), (15, 0x7fff));
        assert_eq!(view.masks()[..3], [0x7fff, 0x7ff9, 0x7fff]);
        for (j, row) in virtual_bands().iter().enumerate() {
            assert_eq!(f64::from(header.wavelengths_nm[j]), row.wavelength_nm);
            let expected: f64 = (0..16).map(|k| row.coefficients[k as usize] * truth(1, k)).sum();
            for (reflectance, mask) in view.band(j).iter().zip(view.masks()) {
                let expected = if mask >> j & 1 == 1 { expected } else { 0.0 };
                assert!((f64::from(*reflectance) - expected).abs() < 0.003, "band {j}: {reflectance}");
            }
        }
        assert_eq!(header.wavelengths_nm[15], 0.0);
    }
}

#[test]
fn manifest_that_contradicts_the_calibration_file_is_rejected() {
    let (folder, _) = drive_with_sensor([2, 1, 40, 28]);
    let error =
        Bench::<Calibrate>::new(&Settings::default(), &context(folder.path())).err().expect("refused").to_string();
    for part in ["drive.toml", "mosaic[1].active_area", "[3, 1, 40, 28] must be [2, 1, 40, 28]", "hs03/sensor.xml"] {
        assert!(error.contains(part), "{error}");
    }
}

#[test]
fn demosaiced_cubes_have_a_cell_per_pixel_and_masks_around_invalid_samples() {
    let (manifest, folder) = drive_with_references();
    for demosaic in [Resolution::Wb, Resolution::Id, Resolution::Iid, Resolution::Ppid] {
        let settings = Settings { demosaic, ..Settings::default() };
        let mut bench = Bench::<Calibrate>::new(&settings, &context(folder.path())).expect("starts");
        let mut saturated = scene(1, &manifest.mosaics[1]);
        // Band 5 of the second cell in the second row.
        saturated[((1 + 4 + 1) * WIDTH + 3 + 4 + 1) as usize] = SATURATION;
        bench.send::<MosaicTopic>(STAMP, header(0), scene(0, &manifest.mosaics[0]));
        bench.send::<MosaicTopic>(STAMP + 1, header(1), saturated);
        bench.tick().expect("a tick");
        let cubes = bench.take::<CubeTopic>();
        let sizes = cubes.iter().map(|cube| (cube.header().pattern, cube.header().width, cube.header().height));
        assert_eq!(sizes.collect::<Vec<_>>(), [(1, 40, 25), (1, 40, 28)], "{demosaic}");
        for (cube, index) in cubes.iter().zip([0, 1]) {
            let header = cube.header();
            let view = CubeView::new(header, cube.rows()).expect("fits");
            let mut unknown = vec![0; header.n_bands as usize];
            for band in 0..header.n_bands {
                for (reflectance, mask) in view.band(band as usize).iter().zip(view.masks()) {
                    let is_known = mask >> band & 1 == 1;
                    unknown[band as usize] += usize::from(!is_known);
                    let expected = if is_known { truth(index, band) } else { 0.0 };
                    let error = f64::from(*reflectance) - expected;
                    assert!(error.abs() < 0.002, "{demosaic}, camera {index} band {band}: {reflectance}");
                }
            }
            // Including the samples around it: 7 x 7 pixels.
            let expected = |band: usize| if (index, band) == (1, 5) { 49 } else { 0 };
            assert_eq!(
                (unknown.len(), view.masks().len()),
                (header.n_bands as usize, (header.width * header.height) as usize)
            );
            assert!((0..unknown.len()).all(|band| unknown[band] == expected(band)), "{demosaic}: {unknown:?}");
        }
        assert_eq!((bench.counter("saturated_samples"), bench.counter("masked")), (1, 1));
    }
}

#[test]
fn dark_folders_by_exposure_and_a_panel_region_are_used() {
    let mut manifest = manifest();
    let t_dark = 50_000_000;
    let panel = [7, 5, 16, 12];
    // Warm: 1 count per ms, so that 5 ms at 0.25 would be off by 1 %.
    let with_current =
        |frame: Vec<u16>, nanos: u64| frame.into_iter().map(|v| v + (nanos / 1_000_000) as u16).collect();
    let entry = &mut manifest.mosaics[1];
    let reflectances: Vec<f64> = (0..16).map(|band| 0.9 - 0.01 * f64::from(band)).collect();
    entry.white_panel = Some(WhitePanelEntry { reflectances: Some(reflectances.clone()), region: Some(panel) });
    entry.dark_exposure_nanos = 1_000_000;
    let folder = drive(&manifest);
    let dark = |nanos: u64| -> Vec<u16> { with_current(vec![DARK; (WIDTH * HEIGHT) as usize], nanos) };
    let flat = |nanos: u64, reflectance: &dyn Fn(u32, u32, usize) -> f64| -> Vec<u16> {
        let pixels = (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| (x, y)));
        let counts = pixels.map(|(x, y)| {
            let band = ((y + 3) % 4 * 4 + (x + 1) % 4) as usize;
            DARK + (650.0 * nanos as f64 * 1e-6 * reflectance(x, y, band)).round() as u16
        });
        with_current(counts.collect(), nanos)
    };
    let is_panel =
        |x: u32, y: u32| (panel[0]..panel[0] + panel[2]).contains(&x) && (panel[1]..panel[1] + panel[3]).contains(&y);
    let white = flat(T_WHITE, &|x, y, band| if is_panel(x, y) { reflectances[band] } else { 0.2 });
    write_pgm(&folder.path().join("hs03/dark/000.pgm"), &dark(1_000_000));
    write_pgm(&folder.path().join(format!("hs03/dark/{t_dark}/000.pgm")), &dark(t_dark));
    write_pgm(&folder.path().join("hs03/white/000.pgm"), &white);
    let mut bench = bench(folder.path());
    bench.send::<MosaicTopic>(STAMP, header(1), flat(T_RAW, &|_, _, band| 0.05 + 0.01 * band as f64));
    bench.tick().expect("a tick");
    let cubes = bench.take::<CubeTopic>();
    let view = CubeView::new(cubes[0].header(), cubes[0].rows()).expect("fits");
    for band in 0..16 {
        let expected = 0.05 + 0.01 * band as f32;
        let worst = view.band(band).iter().map(|r| (r - expected).abs()).fold(0.0, f32::max);
        assert!(worst < 0.0005, "band {band}: off by {worst}");
    }
}
