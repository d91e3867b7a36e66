//! Regions of equal spectra, divided by models of the frames and by model files.

use crate::mosaics::{SATURATION, STAMP, T_RAW, WIDTH, drive_with_references, frame, header};
use calibrate::{Calibrate, ColorLines, Settings};
use color_lines::{Image, Model, Start};
use drive::manifest::MosaicEntry;
use messages::{CubeTopic, CubeView, MosaicTopic};
use stage::testing::{Bench, context};
use stage::{Received, Stage};
use std::collections::BTreeSet;

/// Two adjacent surfaces: the left one gets darker with the band, the right one brighter.
fn two_surfaces(entry: &MosaicEntry) -> Vec<u16> {
    let [x0, y0, ..] = entry.active_area;
    let p = entry.pattern;
    frame(T_RAW, |x, y| {
        let band = f64::from((y + 10 * p - y0) % p * p + (x + 10 * p - x0) % p);
        if x < x0 + 4 * p { 0.5 - 0.015 * band } else { 0.1 + 0.015 * band }
    })
}

/// The region of each cell.
fn regions(cube: &Received<CubeTopic>) -> Vec<u32> {
    let view = CubeView::new(cube.header(), cube.rows()).expect("fits");
    view.regions().expect("are there").to_vec()
}

#[test]
fn cells_get_the_numbers_of_their_regions_and_the_spectra_of_simplified_cubes() {
    let (manifest, folder) = drive_with_references();
    let context = context(folder.path());
    let mut frame = two_surfaces(&manifest.mosaics[0]);
    frame[(2 * WIDTH + 1) as usize] = SATURATION;
    let cubes_of = |color_lines: ColorLines, frames: u32, is_restarted: bool| {
        let settings =
            Settings { color_lines, color_lines_gaussians: 2, color_lines_frames: frames, ..Settings::default() };
        let mut bench = Bench::<Calibrate>::new(&settings, &context).expect("starts");
        let mut cubes = Vec::new();
        for _ in 0..3 {
            bench.send::<MosaicTopic>(STAMP, header(0), frame.clone());
            bench.send::<MosaicTopic>(STAMP, header(1), two_surfaces(&manifest.mosaics[1]));
            bench.tick().expect("a tick");
            cubes.extend(bench.take::<CubeTopic>());
            if is_restarted {
                bench = bench.restarted(&settings, &context).expect("takes its state up");
            }
        }
        assert_eq!(bench.counter("cubes_without_regions"), 0);
        cubes
    };
    let rows = |cubes: &[Received<CubeTopic>]| cubes.iter().map(|cube| cube.rows().to_vec()).collect::<Vec<_>>();

    let off = cubes_of(ColorLines::Off, 2, false);
    let on = cubes_of(ColorLines::Regions, 2, false);
    let measured = |cube: &Received<CubeTopic>| {
        let header = cube.header();
        cube.rows()[..(header.width * header.height * (header.n_bands + 1)) as usize].to_vec()
    };
    assert_eq!((off.len(), on.len()), (6, 6), "three frames of two cameras");
    assert!(off.iter().zip(&on).all(|(off, on)| off.rows() == measured(on)), "regions change no reflectance");
    assert!(CubeView::new(off[0].header(), off[0].rows()).is_some_and(|view| view.regions().is_none()));
    for cube in &on {
        let found = regions(cube);
        let is_saturated = cube.header().camera == 0;
        assert_eq!(found[0] == 0, is_saturated, "a cell with a masked band has no region");
        let left = found[1];
        let right = found[5];
        assert!(left != 0 && right != 0 && left != right, "{found:?}");
        let width = cube.header().width as usize;
        let expected = |i: usize| if i % width < 4 { left } else { right };
        assert!((1..found.len()).all(|i| found[i] == expected(i)), "{found:?}");
    }
    // The model of two frames is followed by another, whose regions have other numbers. Cameras share no region
    // numbers.
    let numbers = |i: usize| [regions(&on[i])[1], regions(&on[i])[5]];
    assert_eq!((numbers(0), numbers(1)), (numbers(2), numbers(3)));
    let all = [numbers(0), numbers(1), numbers(4), numbers(5)].concat();
    assert_eq!(all.iter().copied().collect::<BTreeSet<u32>>(), (1..=8).collect(), "{all:?}");

    let simplified = cubes_of(ColorLines::Simplified, 2, false);
    assert_eq!(simplified.len(), on.len());
    for (simplified, on) in simplified.iter().zip(&on) {
        assert_eq!(regions(simplified), regions(on));
        let view = |cube| CubeView::new(on.header(), cube).expect("fits");
        let simple = view(simplified.rows());
        let exact = view(on.rows());
        for band in 0..on.header().n_bands as usize {
            let cells = simple.band(band).iter().zip(exact.band(band)).zip(regions(on));
            assert!(cells.clone().all(|((a, b), _)| (a - b).abs() < 0.002), "a surface has one spectrum");
            let first = simple.band(band)[1];
            assert!(cells.filter(|(_, region)| *region == regions(on)[1]).all(|((a, _), _)| *a == first));
        }
    }
    assert_eq!(rows(&cubes_of(ColorLines::Simplified, 2, true)), rows(&simplified), "a restart changes nothing");
}

#[test]
fn model_files_divide_all_frames_and_others_are_refused_with_place_and_rule() {
    let (manifest, folder) = drive_with_references();
    let context = context(folder.path());
    // A model for each camera: of the two surfaces, in units of reflectance.
    let model_of = |entry: &MosaicEntry| {
        let n_bands = (entry.pattern * entry.pattern) as usize;
        let value = |band: usize, cell: usize| {
            let band = band as f32;
            let is_left = cell % 8 < 4;
            if is_left { 0.5 - 0.015 * band } else { 0.1 + 0.015 * band }
        };
        let values: Vec<f32> = (0..n_bands).flat_map(|band| (0..40).map(move |cell| value(band, cell))).collect();
        let image = Image::new([8, 5], n_bands, &values).expect("an image");
        let settings = color_lines::Settings { start: Start::Count(2), ..color_lines::Settings::default() };
        Model::fit(&image, &settings).expect("fits").model
    };
    let write = |name: &str, text: String| std::fs::write(context.launch_folder.join(name), text).expect("written");
    for (entry, name) in manifest.mosaics.iter().zip(["a.json", "b.json"]) {
        write(name, serde_json::to_string(&model_of(entry)).expect("encodes"));
    }
    let of = |color_lines: ColorLines, models: &[&str]| Settings {
        color_lines,
        color_lines_frames: 1,
        color_lines_models: models.iter().map(|name| (*name).to_owned()).collect(),
        ..Settings::default()
    };

    let settings = of(ColorLines::Regions, &["a.json", "b.json"]);
    let mut bench = Bench::<Calibrate>::new(&settings, &context).expect("starts");
    let mut cubes = Vec::new();
    for _ in 0..2 {
        for (camera, entry) in (0..).zip(&manifest.mosaics) {
            bench.send::<MosaicTopic>(STAMP, header(camera), two_surfaces(entry));
        }
        bench.tick().expect("a tick");
        cubes.extend(bench.take::<CubeTopic>());
        bench = bench.restarted(&settings, &context).expect("takes its state up");
    }
    let numbers: Vec<[u32; 2]> = cubes.iter().map(|cube| [regions(cube)[1], regions(cube)[5]]).collect();
    assert_eq!(numbers[..2], numbers[2..], "a model file divides all frames");
    let all: BTreeSet<u32> = numbers.concat().into_iter().collect();
    assert_eq!(all, (1..=4).collect(), "cameras share no region");

    assert!(Calibrate::check(&settings, &context).is_empty());
    write("broken.json", "{}".to_owned());
    for (color_lines, models, words) in [
        (ColorLines::Off, ["a.json", "b.json"].as_slice(), "needs color_lines"),
        (ColorLines::Regions, &["a.json"], "names 1 files; the stage has 2 mosaic cameras"),
        (
            ColorLines::Regions,
            &["b.json", "a.json"],
            "b.json: the model has 16 bands; the cubes of mosaic camera 0 have 25",
        ),
        (ColorLines::Regions, &["a.json", "absent.json"], "absent.json: "),
        (ColorLines::Regions, &["a.json", "broken.json"], "broken.json: model: missing field"),
    ] {
        let settings = of(color_lines, models);
        let problems = Calibrate::check(&settings, &context);
        let text = &problems.first().expect("refused before the start").text;
        assert!(text.contains(words), "{text}");
        assert!(Calibrate::new(&settings, &context).is_err(), "{text}");
    }
}
