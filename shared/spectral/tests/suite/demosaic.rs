//! Demosaicing of images with known bands.

use spectral::{Demosaicer, Demosaicing, SpectralError};

const METHODS: [Demosaicing; 4] = [
    Demosaicing::WeightedBilinear,
    Demosaicing::IntensityDifference,
    Demosaicing::IterativeIntensityDifference(2),
    Demosaicing::PpiDifference,
];

/// A scene: reflectance of a band at a pixel.
type Radiance<'a> = &'a dyn Fn(usize, usize, usize) -> f32;

fn mosaic(width: usize, height: usize, pattern: usize, scene: Radiance<'_>) -> Vec<f32> {
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    pixels.map(|(x, y)| scene((y % pattern) * pattern + x % pattern, x, y)).collect()
}

fn demosaiced(width: usize, height: usize, pattern: usize, samples: &[f32], method: Demosaicing) -> Vec<f32> {
    let mut bands = vec![f32::NAN; samples.len() * pattern * pattern];
    let mut demosaicer = Demosaicer::new(width, height, pattern).expect("whole cells");
    demosaicer.demosaic_into(samples, method, &mut bands).expect("fits");
    bands
}

#[test]
fn mosaic_constant_per_band_is_reproduced() {
    for pattern in 1..=5 {
        let width = pattern * 7;
        let height = pattern * 4;
        let samples = mosaic(width, height, pattern, &|band, _, _| 0.03 + 0.036 * band as f32);
        for method in METHODS {
            let bands = demosaiced(width, height, pattern, &samples, method);
            for (band, plane) in bands.chunks_exact(width * height).enumerate() {
                let expected = 0.03 + 0.036 * band as f32;
                let worst = plane.iter().map(|value| (value - expected).abs()).fold(0.0, f32::max);
                let allowed = if method == Demosaicing::WeightedBilinear { 0.0 } else { 1e-6 };
                assert!(worst <= allowed, "{pattern} {method:?} band {band}: off by {worst}");
            }
        }
    }
}

#[test]
fn measured_samples_are_kept_bit_by_bit() {
    for pattern in [4, 5] {
        let width = pattern * 6;
        let height = pattern * 5;
        // Without any structure that a method could exploit.
        let samples = mosaic(width, height, pattern, &|band, x, y| ((x * 37 + y * 101 + band * 11) % 89) as f32 / 89.0);
        for method in METHODS {
            let bands = demosaiced(width, height, pattern, &samples, method);
            for (index, sample) in samples.iter().enumerate() {
                let x = index % width;
                let y = index / width;
                let band = (y % pattern) * pattern + x % pattern;
                assert_eq!(bands[band * samples.len() + index], *sample, "{method:?} at {x} {y}");
            }
            assert!(bands.iter().all(|value| value.is_finite()));
        }
    }
}

#[test]
fn bilinear_method_reproduces_a_ramp() {
    let width = 40;
    let height = 30;
    let pattern = 5;
    let scene = |band: usize, x: usize, y: usize| 0.1 + 0.002 * x as f32 + 0.003 * y as f32 + 0.01 * band as f32;
    let samples = mosaic(width, height, pattern, &scene);
    let bands = demosaiced(width, height, pattern, &samples, Demosaicing::WeightedBilinear);
    for band in 0..25 {
        for y in pattern..height - pattern {
            for x in pattern..width - pattern {
                let value = bands[(band * height + y) * width + x];
                assert!((value - scene(band, x, y)).abs() < 1e-6, "band {band} at {x} {y}: {value}");
            }
        }
    }
}

#[test]
fn bands_are_valid_only_between_valid_samples() {
    let width = 12;
    let height = 12;
    let pattern = 4;
    let demosaicer = Demosaicer::new(width, height, pattern).expect("whole cells");
    let mut valid = vec![true; width * height];
    valid[5 * width + 6] = false; // Band 1 * 4 + 2, of the cell in the middle.
    let mut masks = vec![u32::MAX; width * height];
    demosaicer.masks_into(&valid, &mut masks).expect("fits");
    let unknown = |band: usize| masks.iter().filter(|mask| *mask >> band & 1 == 0).count();
    // Columns 3 to 9 and rows 2 to 8 are nearer to it than to the samples around it.
    assert_eq!((unknown(6), (0..16).map(unknown).sum::<usize>()), (49, 49));
    assert_eq!((masks[5 * 12 + 2], masks[5 * 12 + 3]), (0xffff, 0xffbf));
}

#[test]
fn bridged_gap_does_not_darken_its_surroundings() {
    let width = 24;
    let height = 24;
    let pattern = 4;
    let whole = mosaic(width, height, pattern, &|band, x, y| 0.2 + 0.01 * band as f32 + 0.004 * (x + y) as f32);
    let demosaicer = Demosaicer::new(width, height, pattern).expect("whole cells");
    let mut valid = vec![true; width * height];
    for at in [9 * width + 10, 0, 13 * width + 10] {
        valid[at] = false;
    }
    let mut masks = vec![0; width * height];
    demosaicer.masks_into(&valid, &mut masks).expect("fits");
    let blank: Vec<f32> = whole.iter().zip(&valid).map(|(value, valid)| if *valid { *value } else { 0.0 }).collect();
    let mut bridged = blank.clone();
    demosaicer.bridge_gaps(&mut bridged, &valid).expect("fits");
    for method in METHODS {
        let [truth, blank, bridged] =
            [&whole, &blank, &bridged].map(|samples| demosaiced(width, height, pattern, samples, method));
        let worst = |bands: &[f32]| {
            let n_pixels = width * height;
            let known = (0..bands.len()).filter(|at| masks[at % n_pixels] >> (at / n_pixels) & 1 == 1);
            known.map(|at| (bands[at] - truth[at]).abs()).fold(0.0, f32::max)
        };
        let [blank, bridged] = [worst(&blank), worst(&bridged)];
        if method == Demosaicing::WeightedBilinear {
            // Without blur the valid values are exact in both cases.
            assert_eq!([blank, bridged], [0.0, 0.0]);
        } else {
            assert!(bridged < 0.006 && blank > 0.012, "{method:?}: {bridged} with a bridge, {blank} without");
        }
    }
}

#[test]
fn rows_equal_those_of_the_whole_image() {
    let width = 20;
    let height = 15;
    let pattern = 5;
    let samples = mosaic(width, height, pattern, &|band, x, y| ((x * 37 + y * 101 + band * 11) % 89) as f32 / 89.0);
    for method in METHODS {
        let bands = demosaiced(width, height, pattern, &samples, method);
        let mut y = 0;
        let mut demosaicer = Demosaicer::new(width, height, pattern).expect("whole cells");
        let each = |row: &[f32]| {
            for (row, plane) in row.chunks_exact(width).zip(bands.chunks_exact(width * height)) {
                assert_eq!(row, &plane[y * width..][..width]);
            }
            y += 1;
        };
        demosaicer.demosaic_rows(&samples, method, each).expect("fits");
        assert_eq!(y, height);
    }
}

#[test]
fn mosaics_of_wrong_size_are_rejected() {
    assert_eq!(
        Demosaicer::new(10, 8, 4).map(drop),
        Err(SpectralError::PartialCells { width: 10, height: 8, pattern: 4 })
    );
    assert_eq!(Demosaicer::new(12, 12, 6).map(drop), Err(SpectralError::Pattern(6)));
    let mut demosaicer = Demosaicer::new(8, 8, 4).expect("whole cells");
    let refused = demosaicer.demosaic_into(&[0.0; 64], Demosaicing::PpiDifference, &mut [0.0; 64]);
    assert_eq!(refused, Err(SpectralError::Length { what: "bands", got: 64, expected: 1024 }));
}

/// The scene of the CAVE multispectral set: bands 480 to 630 nm in 10 nm steps, in reflectance times 255.
fn cave_band(index: usize) -> image::ImageBuffer<image::Luma<u16>, Vec<u16>> {
    let path = real_data::path(&format!("cave/chart_and_stuffed_toy_ms_{index:02}.png"));
    image::open(path).expect("a PNG").into_luma16()
}

#[real_data::test("cave/chart_and_stuffed_toy_ms_09.png", "cave/chart_and_stuffed_toy_ms_24.png")]
fn errors_on_a_real_scene_are_as_small_as_published() {
    let side = 512_usize;
    let rim = 8_usize;
    let pattern = 4;
    let truth: Vec<_> = (9..25).map(cave_band).collect();
    let scene = |band: usize, x: usize, y: usize| f32::from(truth[band][(x as u32, y as u32)].0[0]) / 65535.0;
    let samples = mosaic(side, side, pattern, &scene);
    // Mean over the bands of the peak signal-to-noise ratio, dB: published values on this scene, and the results of this
    // crate.
    let published = [27.30, 29.22, 30.33, 33.76];
    for (method, published) in METHODS.into_iter().zip(published) {
        let bands = demosaiced(side, side, pattern, &samples, method);
        let psnr = |band: usize| {
            let inside = (rim..side - rim).flat_map(|y| (rim..side - rim).map(move |x| (x, y)));
            let error2 =
                inside.map(|(x, y)| f64::from(bands[(band * side + y) * side + x] - scene(band, x, y)).powi(2));
            -10.0 * (error2.sum::<f64>() / ((side - 2 * rim) * (side - 2 * rim)) as f64).log10()
        };
        let mean = (0..16).map(psnr).sum::<f64>() / 16.0;
        println!("{method:?}: {mean:.2} dB (published: {published:.2})");
        assert!(mean > published - 0.3, "{method:?}: {mean} dB");
    }
}
