//! `replica-lab cube` on frames with known reflectances, and on real frames.

use crate::support::{printed, replica_lab, text};
use formats::envi::{self, Image};
use formats::pgm::pgm_from_samples;
use std::path::{Path, PathBuf};
use std::process::Output;

const WIDTH: u32 = 24;
const HEIGHT: u32 = 16;
const MAX: u16 = 1023;
/// Region of the white panel in the frame: 8 x 4 px.
const PANEL: &str = "8,4,8,4";

fn cube(arguments: &[&str]) -> Output {
    replica_lab(&[&["cube"], arguments].concat())
}

/// Writes a frame with a pattern of 2 x 2.
fn write(folder: &Path, name: &str, sample: impl Fn(usize, u32, u32) -> u16) -> PathBuf {
    let pixels = (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| (x, y)));
    let samples: Vec<u16> = pixels.map(|(x, y)| sample((y % 2 * 2 + x % 2) as usize, x, y)).collect();
    let path = folder.join(name);
    std::fs::create_dir_all(path.parent().expect("has a folder")).expect("made");
    std::fs::write(&path, pgm_from_samples(WIDTH, HEIGHT, MAX, &samples)).expect("written");
    path
}

fn is_panel(x: u32, y: u32) -> bool {
    (8..16).contains(&x) && (4..8).contains(&y)
}

fn read(folder: &Path, name: &str) -> Image {
    envi::read(&folder.join(name)).expect("an ENVI cube")
}

#[test]
fn references_with_other_exposures_give_reflectances_and_mark_unknown_values() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    write(folder, "dark/0.pgm", |_, _, _| 49);
    write(folder, "dark/1.pgm", |_, _, _| 51);
    // White at 4 ms, the frame at 8 ms.
    write(folder, "white/0.pgm", |band, _, _| 50 + 200 + 50 * band as u16);
    let frame = write(folder, "frame.pgm", |band, x, y| match (x, y) {
        (2, 0) => MAX,
        _ => 50 + 100 + 25 * band as u16,
    });
    let out = folder.join("out");
    let dark = folder.join("dark");
    let white = folder.join("white");
    let arguments_of_frame =
        [text(&frame), "--pattern", "2", "--dark", text(&dark), "--white", text(&white), "--out", text(&out)];
    let refused = cube(&arguments_of_frame);
    assert!(printed(&refused).contains("--white-exposure-ms must be given"), "{}", printed(&refused));
    let exposures = ["--exposure-ms", "8", "--white-exposure-ms", "4", "--white-reflectance", "0.9,0.8,0.7,0.6"];
    for demosaic in ["bin", "ppid"] {
        let done = cube(&[&arguments_of_frame[..], &exposures, &["--demosaic", demosaic]].concat());
        assert!(done.status.success() && printed(&done).contains("samples saturated 1,"), "{}", printed(&done));
        let Image { header, values } = read(&out, "frame.hdr");
        let size = if demosaic == "bin" { (12, 8) } else { (24, 16) };
        assert_eq!(((header.samples, header.lines), header.bands, header.data_ignore_value), (size, 4, Some(-9999.0)));
        assert!(header.description.starts_with("reflectance; bands as measured by the filters"), "{header:?}");
        let n_cells = header.samples * header.lines;
        for (band, plane) in values.chunks_exact(n_cells).enumerate() {
            let expected = (0.9 - 0.1 * band as f32) * 0.5 * 0.5;
            let unknown = plane.iter().filter(|value| **value == -9999.0).count();
            // The saturated sample makes one cell unknown; in full resolution it is the 3 x 3 pixels around it, without the row above
            // the image.
            assert_eq!(unknown, if band == 0 { if demosaic == "bin" { 1 } else { 6 } } else { 0 }, "{demosaic}");
            let known = plane.iter().filter(|value| **value != -9999.0);
            let worst = known.map(|value| (value - expected).abs()).fold(0.0, f32::max);
            assert!(worst < 1e-4, "{demosaic} band {band}: off by {worst}");
        }
    }
}

#[test]
fn panel_in_the_frame_serves_as_white_reference() {
    let folder = tempfile::tempdir().expect("a folder");
    let sample =
        |band: usize, x: u32, y: u32| if is_panel(x, y) { 500 + 40 * band as u16 } else { 250 + 20 * band as u16 };
    let frame = write(folder.path(), "frame.pgm", sample);
    let arguments_of_frame = [text(&frame), "--pattern", "2", "--white-region", PANEL, "--exposure-ms", "5"];
    let done =
        cube(&[&arguments_of_frame[..], &["--white-reflectance", "0.98", "--out", text(folder.path())]].concat());
    assert!(done.status.success() && printed(&done).contains("no dark reference"), "{}", printed(&done));
    let Image { header, values } = read(folder.path(), "frame.hdr");
    for (at, value) in values.iter().enumerate() {
        let cell = at % (header.samples * header.lines);
        let x = 2 * (cell % header.samples) as u32;
        let y = 2 * (cell / header.samples) as u32;
        let expected = if is_panel(x, y) { 0.98 } else { 0.49 };
        assert!((value - expected).abs() < 1e-5, "{value} at {x} {y}");
    }
    // Two inputs of one name would overwrite a cube.
    let twice = cube(&[&arguments_of_frame[..], &[text(&frame), "--out", text(folder.path())]].concat());
    assert_eq!(twice.status.code(), Some(1));
    assert!(printed(&twice).contains("another input has this name"), "{}", printed(&twice));
    let outside =
        cube(&[text(&frame), "--pattern", "2", "--white-region", "20,4,8,4", "--exposure-ms", "5", "--out", "."]);
    assert!(printed(&outside).contains("must lie in the active area"), "{}", printed(&outside));
}

#[real_data::test("photonfocus")]
fn real_frames_with_calibration_files_give_cubes() {
    for (name, xml, cells, [n_bands, n_virtual], panel) in [
        ("vis", "CMV2K-SSM4x4-470_620-9.4.10.10_HS03-VIS.xml", [512, 256], [16, 15], "800,400,40,40"),
        ("nir", "CMV2K-SSM5x5-665_975-13.8.15.1_HS02-NIR.xml", [409, 217], [25, 25], "800,400,50,50"),
    ] {
        let frame = real_data::path(&format!("photonfocus/frame_02245_{name}.tif"));
        let xml = real_data::path(&format!("photonfocus/{xml}"));
        let folder = tempfile::tempdir().expect("a folder");
        let arguments_of_frame = [text(&frame), "--sensor", text(&xml), "--out", text(folder.path())];
        let done = cube(&arguments_of_frame);
        assert!(done.status.success() && printed(&done).contains("not a reflectance"), "{}", printed(&done));
        let Image { header, values } = read(folder.path(), &format!("frame_02245_{name}.hdr"));
        assert_eq!(([header.samples, header.lines], header.bands), (cells, n_bands));
        let raw = formats::tiff::Tiff::parse(&std::fs::read(&frame).expect("readable")).expect("a TIFF");
        for (at, value) in values.iter().enumerate() {
            let band = at / (cells[0] * cells[1]);
            let cell = at % (cells[0] * cells[1]);
            let sample = raw.samples[cell * n_bands + band];
            let expected = if sample == 255 { -9999.0 } else { f32::from(sample) / 255.0 };
            assert!((value - expected).abs() < 1e-5, "{name}: {value}, not {expected}");
        }
        // A patch of plants as white reference: its corrected bands are 1, as all rows of the matrix sum to 1.
        let white = ["--white-region", panel, "--white-reflectance", "1"];
        let done = cube(&[&arguments_of_frame[..], &white].concat());
        assert!(done.status.success(), "{}", printed(&done));
        let Image { header, .. } = read(folder.path(), &format!("frame_02245_{name}.hdr"));
        assert_eq!((header.bands, header.wavelengths.len(), header.fwhm.len()), (n_virtual, n_virtual, n_virtual));
        assert!(header.description.contains("virtual bands") && header.wavelength_units == "nm");
        assert!(header.wavelengths.is_sorted());
    }
}
