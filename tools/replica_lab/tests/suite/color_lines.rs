//! `replica-lab spectrum lines` on synthetic images.

use crate::support::{printed, replica_lab, succeeded, text};
use formats::envi::{self, Header, Image};
use std::path::{Path, PathBuf};

/// A ramp of two colors; `brightness` 0 to 1.
fn write_photograph(folder: &Path, name: &str, brightness: f32) -> PathBuf {
    let pixel = |x: u32, y: u32| {
        let level = |factor: f32| (factor * brightness * (x * 8) as f32).min(255.0) as u8;
        image::Rgb(if y < 12 { [level(1.0), level(0.6), level(0.1)] } else { [level(0.1), level(0.5), level(1.0)] })
    };
    let path = folder.join(name);
    image::RgbImage::from_fn(32, 24, pixel).save(&path).expect("written");
    path
}

fn lines(arguments: &[&str]) -> std::process::Output {
    replica_lab(&[&["spectrum", "lines"], arguments].concat())
}

#[test]
fn first_image_is_modeled_and_further_images_are_projected() {
    let folder = tempfile::tempdir().expect("a folder");
    let first = write_photograph(folder.path(), "first.png", 1.0);
    let second = write_photograph(folder.path(), "second.png", 0.8);
    let out = folder.path().join("out");
    let shown = succeeded(&lines(&[text(&first), text(&second), "--lines", "2", "--out", text(&out)]));
    let psnr = |name: &str| -> f64 {
        let row = shown.lines().find(|line| line.starts_with(&format!("| {name} |"))).expect("a row");
        row.split('|').nth(2).expect("a cell").trim().parse().expect("dB")
    };
    assert!(psnr("first") > 35.0 && psnr("second") > 35.0, "{shown}");
    let read = |name: &str| image::open(out.join(name)).expect("an image");
    assert_eq!(read("second_lines.png").to_rgb8().dimensions(), (32, 24));
    let labels = read("first_labels.png").to_luma16();
    assert_ne!(labels.get_pixel(30, 2), labels.get_pixel(30, 20));
    let picture = std::fs::read_to_string(out.join("spectrum.svg")).expect("a picture");
    assert!(picture.contains("line 2") && picture.contains("green"));

    // The written model gives the same images.
    let again = folder.path().join("again");
    succeeded(&lines(&[
        text(&second),
        "--apply",
        text(&out.join("model.json")),
        "--lines",
        "2",
        "--out",
        text(&again),
    ]));
    let bytes = |folder: &Path, name: &str| std::fs::read(folder.join(name)).expect("written");
    for name in ["second_lines.png", "second_regions.png", "second_labels.png"] {
        assert_eq!(bytes(&out, name), bytes(&again, name), "{name}");
    }
    assert!(!again.join("model.json").exists());
}

#[test]
fn cube_keeps_its_wavelengths_and_unknown_values() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut header = Header::new(20, 10, 4);
    header.wavelengths = vec![500.0, 600.0, 700.0, 800.0];
    header.wavelength_units = "nm".into();
    header.data_ignore_value = Some(-1.0);
    let value =
        |(band, at): (usize, usize)| if at == 7 { -1.0 } else { (1 + band) as f32 * 0.1 * (at % 20) as f32 / 20.0 };
    let values = (0..4).flat_map(|band| (0..200).map(move |at| (band, at))).map(value).collect();
    let path = folder.path().join("cube.hdr");
    envi::write(&path, &Image { header, values }).expect("written");
    let out = folder.path().join("out");
    succeeded(&lines(&[text(&path), "--out", text(&out)]));
    let found = envi::read(&out.join("cube_lines.hdr")).expect("a cube");
    assert_eq!(found.header.wavelengths, [500.0, 600.0, 700.0, 800.0]);
    let unknown = found.header.data_ignore_value.expect("a value");
    let at: Vec<usize> = (0..800).filter(|at| found.values[*at] == unknown).collect();
    assert_eq!(at, [7, 207, 407, 607]);
    assert!((found.values[19] - 0.095).abs() < 0.01, "{}", found.values[19]);
}

#[test]
fn spatial_weight_gives_regions_without_lines() {
    let folder = tempfile::tempdir().expect("a folder");
    let first = write_photograph(folder.path(), "first.png", 1.0);
    let out = folder.path().join("out");
    let arguments = [text(&first), "--spatial-weight", "1", "--gaussians", "8", "--out", text(&out)];
    assert!(succeeded(&lines(&arguments)).contains("| first | - | - |"));
    assert!(out.join("first_regions.png").exists() && !out.join("first_lines.png").exists());
}

#[test]
fn wrong_inputs_are_refused_with_their_place() {
    let folder = tempfile::tempdir().expect("a folder");
    let first = write_photograph(folder.path(), "first.png", 1.0);
    let out = folder.path().join("out");
    let refused = |arguments: &[&str], code, message: &str| {
        let output = lines(&[arguments, &["--out", text(&out)]].concat());
        assert_eq!(output.status.code(), Some(code), "{}", printed(&output));
        assert!(printed(&output).contains(message), "{}", printed(&output));
    };
    refused(&[text(&first), "--bins", "1"], 1, "bins = 1; must be 2 to 128");
    let model = folder.path().join("model.json");
    std::fs::write(&model, "{}").expect("written");
    refused(&[text(&first), "--apply", text(&model)], 1, "model.json");
    refused(&[text(&first), "--apply", text(&model), "--bins", "8"], 2, "--apply");
    refused(&[text(&first), text(&first)], 1, "have the same name");
}
