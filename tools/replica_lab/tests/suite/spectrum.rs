//! `replica-lab spectrum` on cubes with known distributions.

use crate::support::{printed, replica_lab};
use formats::envi::{self, Header, Image};
use std::path::{Path, PathBuf};
use std::process::Output;

fn spectrum(arguments: &[&str]) -> Output {
    replica_lab(&[&["spectrum"], arguments].concat())
}

/// Three bands of 40 x 25 cells with reflectances from 0 to `top`, in per cent. The last cell is invalid, and the bands are not
/// sorted by wavelength.
fn write_cube(folder: &Path, name: &str, top: f32) -> PathBuf {
    let n_cells = 40 * 25;
    let mut header = Header::new(40, 25, 3);
    header.wavelengths = vec![600.0, 500.0, 700.0];
    header.wavelength_units = "nm".into();
    header.reflectance_scale_factor = Some(100.0);
    header.data_ignore_value = Some(-1.0);
    let band = |factor: f32| {
        (0..n_cells).map(move |i| if i == n_cells - 1 { -1.0 } else { i as f32 / 998.0 * top * 100.0 * factor })
    };
    let values = [1.0, 0.5, 1.0].into_iter().flat_map(band).collect();
    let path = folder.join(name);
    envi::write(&path, &Image { header, values }).expect("written");
    path
}

#[test]
fn two_inputs_have_their_own_statistics_and_diagnosis() {
    let folder = tempfile::tempdir().expect("a folder");
    let spread = write_cube(folder.path(), "spread.hdr", 1.0);
    let narrow = write_cube(folder.path(), "narrow.hdr", 0.1);
    let figures = folder.path().join("figures");
    let inputs = [spread.to_str().expect("UTF-8"), narrow.to_str().expect("UTF-8")];
    let json = ["--format", "json", "--thresholds", "0.25,0.5", "--figures", figures.to_str().expect("UTF-8")];
    let output = spectrum(&[&inputs[..], &json].concat());
    assert!(output.status.success(), "{}", printed(&output));
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let channels = |input: usize| report["inputs"][input]["channels"].as_array().expect("channels").clone();
    let nm: Vec<f64> = channels(0).iter().filter_map(|channel| channel["wavelength_nm"].as_f64()).collect();
    assert_eq!(nm, [500.0, 600.0, 700.0], "sorted by wavelength");
    for (channel, top) in channels(0).iter().zip([0.5, 1.0, 1.0]) {
        let number = |key: &str| channel[key].as_f64().expect("a number");
        assert_eq!((channel["n"].as_u64(), number("invalid")), (Some(999), 0.001));
        assert!((number("mean") - top / 2.0).abs() < 1e-4 && (number("max") - top).abs() < 1e-4);
        // A uniform distribution.
        assert!((number("deviation") - top / 12.0_f64.sqrt()).abs() < 1e-3);
        for (rate, threshold) in channel["above"].as_array().expect("rates").iter().zip([0.25, 0.5]) {
            let expected = (1.0_f64 - threshold / top).max(0.0);
            assert!((rate.as_f64().expect("a rate") - expected).abs() < 3e-3, "{channel}");
        }
    }
    let diagnosis = |input: usize| report["inputs"][input]["diagnosis"].to_string();
    assert_eq!(diagnosis(0), "[\"no problem found\"]");
    assert!(diagnosis(1).contains("concentrated: 3 of 3 channels"), "{}", diagnosis(1));
    let histogram = std::fs::read_to_string(figures.join("histogram.svg")).expect("a figure");
    assert_eq!(histogram.matches("<polyline").count(), 6, "one line per channel of each input");
    assert!(figures.join("distribution.svg").is_file() && !figures.join("signature.svg").exists());
}

#[test]
fn clipped_values_are_reported_with_a_warning_first() {
    let folder = tempfile::tempdir().expect("a folder");
    let cube = write_cube(folder.path(), "cube.hdr", 1.0);
    let cube = cube.to_str().expect("UTF-8");
    for (arguments, words) in [
        (["--clip-threshold", "0.2"], "clipped at 0.2"),
        (["--clip-percent", "90"], "clipped by channel to the 90 % of pixels closest to the mean"),
    ] {
        let text = printed(&spectrum(&[&[cube], &arguments[..]].concat()));
        let first = text.lines().next().expect("a line");
        assert!(first.contains(words) && first.contains("not reflectances"), "{first}");
    }
    let text = printed(&spectrum(&[cube, "--clip-threshold", "0.2", "--thresholds", "0.999", "--format", "csv"]));
    let rows: Vec<Vec<&str>> =
        text.lines().filter(|line| line.starts_with('"')).map(|line| line.split(',').collect()).collect();
    // All values above 0.2 become 1: 60 % of the band that ends at 0.5, and 80 % of the others.
    for (row, expected) in rows.iter().zip([0.6, 0.8, 0.8]) {
        let rate: f64 = row[8].parse().expect("a rate");
        assert!((rate - expected).abs() < 3e-3, "{row:?}");
    }
    assert_eq!(rows.len(), 3);
    let figures = folder.path().join("figures");
    let output = spectrum(&[cube, "--clip-threshold", "0.2", "--figures", figures.to_str().expect("UTF-8")]);
    assert!(output.status.success(), "{}", printed(&output));
    let expanded = std::fs::read_to_string(figures.join("expanded.svg")).expect("a figure");
    assert_eq!(expanded.matches("<polyline").count(), 6, "three channels before and after");
    assert!(expanded.contains("clipped at 0.2") && expanded.contains("not a reflectance"));
}

#[test]
fn region_is_compared_with_reference_spectra_and_must_be_inside() {
    let folder = tempfile::tempdir().expect("a folder");
    let cube = write_cube(folder.path(), "cube.hdr", 1.0);
    let cube = cube.to_str().expect("UTF-8");
    let known = |name: &str, values: [f64; 3]| {
        let path = folder.path().join(format!("{name}.spectrum.txt"));
        let rows: Vec<String> = ["0.5", "0.6", "0.7"].iter().zip(values).map(|(um, v)| format!("{um} {v}\n")).collect();
        let head = "X Units: Wavelength (micrometers)\nY Units: Reflectance (percent)\n\n";
        std::fs::write(&path, format!("Name: {name}\n{head}{}", rows.concat())).expect("written");
        path.to_str().expect("UTF-8").to_owned()
    };
    // The cube's bands are as 1 : 2 : 2 everywhere.
    let same = known("same", [20.0, 40.0, 40.0]);
    let other = known("other", [40.0, 40.0, 20.0]);
    let text = printed(&spectrum(&[cube, "--region", "5,5,10,4", "--reference", &other, "--reference", &same]));
    let same_row = text.find("| same | 0.00° |").unwrap_or_else(|| panic!("{text}"));
    assert!(same_row < text.find("| other |").expect("the second-nearest reference"), "{text}");
    let figures = folder.path().join("figures");
    let drawn = ["--reference", &same, "--clip-threshold", "0.5", "--figures", figures.to_str().expect("UTF-8")];
    let output = spectrum(&[&[cube, "--region", "5,6,10,4"], &drawn[..]].concat());
    assert!(output.status.success(), "{}", printed(&output));
    let figure = |name: &str| std::fs::read_to_string(figures.join(name)).expect("a figure");
    assert_eq!(
        figure("pixels_1.svg").matches("<polyline").count(),
        40 + 1,
        "the cells of the region and the reference spectrum"
    );
    let normalized = figure("normalized.svg");
    assert_eq!(normalized.matches("<polyline").count(), 3);
    assert!(normalized.contains("clipped at 0.5") && normalized.contains("to the 95 % of pixels"), "{normalized}");
    let picture = image::open(figures.join("region_1.png")).expect("a picture").into_rgb8();
    assert_eq!(picture.dimensions(), (40, 25));
    let is_frame = |u: u32, v: u32| picture.get_pixel(u, v).0 == [0, 255, 255];
    assert!(
        is_frame(4, 5) && is_frame(15, 10) && is_frame(9, 5) && !is_frame(5, 6) && !is_frame(14, 9) && !is_frame(3, 5)
    );
    let output = spectrum(&[cube, "--region", "35,5,10,4"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(printed(&output).contains("region 35,5,10,4 must lie in the 40 x 25 cells"), "{}", printed(&output));
}

#[real_data::test("photonfocus/frame_02245_nir.tif", "photonfocus/CMV2K-SSM5x5-665_975-13.8.15.1_HS02-NIR.xml")]
fn real_tiff_is_reported_with_exposure_and_saturation() {
    let files = ["photonfocus/frame_02245_nir.tif", "photonfocus/CMV2K-SSM5x5-665_975-13.8.15.1_HS02-NIR.xml"];
    let [frame, xml] = files.map(|name| real_data::path(name).to_str().expect("UTF-8").to_owned());
    let output = spectrum(&[&frame, "--sensor", &xml, "--format", "json"]);
    assert!(output.status.success(), "{}", printed(&output));
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let input = &report["inputs"][0];
    assert!(input["name"].as_str().is_some_and(|name| name.contains("at 3.65 ms, share of the full scale")), "{input}");
    let channels = input["channels"].as_array().expect("channels");
    let nm: Vec<f64> = channels.iter().filter_map(|channel| channel["wavelength_nm"].as_f64()).collect();
    assert!(nm.len() == 25 && nm.is_sorted() && nm[0] > 650.0 && nm[24] < 1000.0, "{nm:?}");
    let raw = formats::tiff::Tiff::parse(&std::fs::read(&frame).expect("readable")).expect("a TIFF");
    let saturated = raw.samples.iter().filter(|sample| **sample == 255).count() as f64;
    let invalid: f64 = channels.iter().filter_map(|channel| channel["invalid"].as_f64()).sum::<f64>() / 25.0;
    assert!((invalid - saturated / raw.samples.len() as f64).abs() < 1e-9, "{invalid}");
}
