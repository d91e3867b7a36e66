//! Reflectance of synthetic scenes with known ground truth. The sensor model here is independent of the library.

use spectral::{
    Calibration, Correction, DarkReference, FrameCounts, Mosaic, PixelReflectances, Reference, SpectralError,
    WhitePanel, WhiteTarget,
};

const RHO_WHITE: f64 = 0.98;
const T_WHITE: u64 = 4_000_000;
const T_RAW: u64 = 5_000_000;

/// A camera whose pixels each have a bias and a sensitivity (counts per ms at reflectance 1).
struct Camera {
    mosaic: Mosaic,
    bias: Vec<u16>,
    sensitivity: Vec<f64>,
}

impl Camera {
    fn new(size: [u32; 2], pattern: u32, active_area: [u32; 4]) -> Self {
        let mosaic = Mosaic::new(size, pattern, active_area, 12).expect("sound");
        let mut random = random::Random::new(7);
        let bias = (0..mosaic.n_samples()).map(|_| random.range(20.0, 60.0) as u16).collect();
        let sensitivity = (0..mosaic.n_samples()).map(|_| f64::from(random.range(300.0, 600.0))).collect();
        Self { mosaic, bias, sensitivity }
    }
    /// The raw frame of a scene of `reflectance(x, y)`.
    fn expose(&self, nanos: u64, reflectance: impl Fn(u32, u32) -> f64) -> Vec<u16> {
        let [width, height] = self.mosaic.size();
        let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        pixels
            .zip(self.bias.iter().zip(&self.sensitivity))
            .map(|((x, y), (bias, sensitivity))| {
                let counts = f64::from(*bias) + sensitivity * nanos as f64 * 1e-6 * reflectance(x, y);
                (counts.round() as u16).min(self.mosaic.saturation())
            })
            .collect()
    }
    fn reference(&self, what: &'static str, frames: &[Vec<u16>]) -> Reference {
        let mut reference = Reference::new(what, &self.mosaic);
        for frame in frames {
            reference.add(frame).expect("fits");
        }
        reference
    }
    fn calibration(&self) -> Calibration {
        let dark = self.reference("dark", std::slice::from_ref(&self.bias));
        let white = self.reference("white", &[self.expose(T_WHITE, |_, _| RHO_WHITE)]);
        Calibration::new(&self.mosaic, &dark, &white, TARGET).expect("sound")
    }
    fn cube(&self, raw: &[u16]) -> (Vec<f32>, Vec<u32>, FrameCounts) {
        // Old values in the buffers must be overwritten.
        let mut cube = vec![f32::NAN; self.mosaic.n_bands() * self.mosaic.n_cells()];
        let mut masks = vec![u32::MAX; self.mosaic.n_cells()];
        let counts = self.calibration().cube_into(raw, T_RAW, &mut cube, &mut masks).expect("fits");
        assert!(cube.iter().all(|value| value.is_finite()));
        (cube, masks, counts)
    }
}

const TARGET: WhiteTarget = WhiteTarget { reflectance: RHO_WHITE, exposure_nanos: T_WHITE };

/// Reflectance of band k in the scenes below: 0.1 to 0.58, all different.
fn band_reflectance(band: usize) -> f64 {
    0.1 + 0.02 * band as f64
}

fn cameras() -> [Camera; 2] {
    [Camera::new([68, 43], 4, [3, 2, 64, 40]), Camera::new([70, 47], 5, [1, 3, 67, 41])]
}

#[test]
fn scene_constant_per_band_has_its_reflectance_in_each_plane() {
    for camera in cameras() {
        let pattern = camera.mosaic.pattern();
        let [x0, y0] = camera.mosaic.origin();
        // The pattern continues left of and above the origin.
        let raw = camera.expose(T_RAW, |x, y| {
            let phase = |v: u32, v0: u32| (v + 100 * pattern - v0) % pattern;
            band_reflectance((phase(y, y0) * pattern + phase(x, x0)) as usize)
        });
        let (cube, masks, counts) = camera.cube(&raw);
        assert_eq!(counts, FrameCounts::default());
        let all_bands = u32::MAX >> (32 - camera.mosaic.n_bands());
        assert!(masks.iter().all(|mask| *mask == all_bands));
        for (band, plane) in cube.chunks_exact(camera.mosaic.n_cells()).enumerate() {
            // Half a count of rounding in raw and in white, out of at least 1200 counts: 0.001.
            let worst = plane.iter().map(|r| (f64::from(*r) - band_reflectance(band)).abs()).fold(0.0, f64::max);
            assert!(worst < 0.001, "band {band} is off by {worst}");
        }
    }
}

#[test]
fn equal_samples_have_equal_reflectances_bit_by_bit() {
    let mosaic = Mosaic::new([40, 40], 5, [0, 0, 40, 40], 10).expect("sound");
    let band_value = |i: usize, base: u16| base + ((i / 40 % 5) * 5 + i % 5) as u16;
    let frame = |base: u16| (0..1600).map(|i| band_value(i, base)).collect::<Vec<_>>();
    let camera = Camera { bias: frame(10), sensitivity: Vec::new(), mosaic };
    let dark = camera.reference("dark", &[frame(10)]);
    let white = camera.reference("white", &[frame(810)]);
    let calibration = Calibration::new(&camera.mosaic, &dark, &white, TARGET).expect("sound");
    let mut cube = vec![0.0; 1600];
    let mut masks = vec![0; 64];
    calibration.cube_into(&frame(210), T_WHITE, &mut cube, &mut masks).expect("fits");
    for plane in cube.chunks_exact(64) {
        assert!(plane.iter().all(|r| r.to_bits() == plane[0].to_bits()), "{plane:?}");
        assert!((plane[0] - 0.98 * 200.0 / 800.0).abs() < 1e-6);
    }
}

#[test]
fn white_target_has_its_reflectance() {
    for camera in cameras() {
        let raw = camera.expose(T_RAW, |_, _| RHO_WHITE);
        let PixelReflectances { values: reflectances, valid, .. } =
            camera.calibration().reflectance(&raw, T_RAW).expect("fits");
        assert_eq!([reflectances.len(), valid.len()], [camera.mosaic.n_bands() * camera.mosaic.n_cells(); 2]);
        assert!(valid.iter().all(|valid| *valid));
        assert!(reflectances.iter().all(|r| (r - 0.98).abs() < 0.001));
    }
}

#[test]
fn binned_reflectances_equal_those_per_pixel() {
    for camera in cameras() {
        let raw = camera.expose(T_RAW, |x, y| 0.01 * f64::from((x * 31 + y * 17) % 200));
        let PixelReflectances { values: pixels, valid, counts: pixel_counts } =
            camera.calibration().reflectance(&raw, T_RAW).expect("fits");
        let (cube, masks, counts) = camera.cube(&raw);
        assert_eq!(pixel_counts, counts);
        assert!(counts.saturated > 0, "the scene must saturate at some pixels");
        let pattern = camera.mosaic.pattern() as usize;
        let columns = camera.mosaic.cells()[0] as usize;
        for ((y, x), r) in pixels.indexed_iter() {
            let band = (y % pattern) * pattern + x % pattern;
            let cell = (y / pattern) * columns + x / pattern;
            assert_eq!(cube[band * camera.mosaic.n_cells() + cell].to_bits(), r.to_bits());
            assert_eq!(masks[cell] >> band & 1 == 1, valid[(y, x)]);
        }
    }
}

#[test]
fn saturated_clipped_and_dead_samples_are_masked_and_counted() {
    let [camera, _] = cameras();
    let width = camera.mosaic.size()[0] as usize;
    let [x0, y0] = camera.mosaic.origin().map(|v| v as usize);
    let at = |x: usize, y: usize| (y0 + y) * width + x0 + x;
    let mut raw = camera.expose(T_RAW, |_, _| 0.5);
    raw[at(0, 0)] = 4095;
    raw[at(5, 0)] = 0;
    let mut whites = [camera.expose(T_WHITE, |_, _| RHO_WHITE), camera.expose(T_WHITE, |_, _| RHO_WHITE)];
    whites[0][at(10, 1)] = camera.bias[at(10, 1)];
    whites[1][at(10, 1)] = camera.bias[at(10, 1)];
    whites[1][at(15, 3)] = 4095;
    // A dead pixel stays dead, whatever its value in the raw frame.
    raw[at(15, 3)] = 4095;
    let dark = camera.reference("dark", std::slice::from_ref(&camera.bias));
    let white = camera.reference("white", &whites);
    let calibration = Calibration::new(&camera.mosaic, &dark, &white, TARGET).expect("sound");
    let n_cells = camera.mosaic.n_cells();
    let mut cube = vec![0.0; 16 * n_cells];
    let mut masks = vec![0; n_cells];
    let counts = calibration.cube_into(&raw, T_RAW, &mut cube, &mut masks).expect("fits");
    assert_eq!(counts, FrameCounts { dead: 2, saturated: 1, clipped: 1 });
    assert_eq!(counts.masked(), 4);
    for (cell, band) in [(0, 0), (1, 1), (2, 6), (3, 15)] {
        assert_eq!(masks[cell], 0xffff & !(1 << band), "cell {cell}");
        assert_eq!(cube[band * n_cells + cell], 0.0);
    }
    assert!(masks[4..].iter().all(|mask| *mask == 0xffff));
}

#[test]
fn frames_without_light_are_black_or_masked() {
    let [camera, _] = cameras();
    // As dark as the dark reference: measured, and black.
    let (cube, masks, counts) = camera.cube(&camera.bias.clone());
    assert_eq!(counts.masked(), 0);
    assert!(cube.iter().all(|r| *r == 0.0) && masks.iter().all(|mask| *mask == 0xffff));
    // All zeros: the black level is missing, nothing was measured.
    let (cube, masks, counts) = camera.cube(&vec![0; camera.mosaic.n_samples()]);
    assert_eq!(counts.clipped, 16 * camera.mosaic.n_cells() as u64);
    assert!(cube.iter().all(|r| *r == 0.0) && masks.iter().all(|mask| *mask == 0));
    // A white reference taken with the lens cap on: all pixels are dead.
    let dark = camera.reference("dark", std::slice::from_ref(&camera.bias));
    let calibration = Calibration::new(&camera.mosaic, &dark, &dark, TARGET).expect("sound");
    assert_eq!(calibration.valid_bands(), 0);
    let PixelReflectances { values: reflectances, valid, counts } =
        calibration.reflectance(&camera.expose(T_RAW, |_, _| 0.5), T_RAW).expect("fits");
    assert_eq!([reflectances.len(), valid.len()], [camera.mosaic.n_bands() * camera.mosaic.n_cells(); 2]);
    assert_eq!(counts.dead, valid.len() as u64);
    assert!(reflectances.iter().all(|r| *r == 0.0) && valid.iter().all(|valid| !valid));
}

#[test]
fn pixel_darker_than_the_dark_reference_is_negative() {
    let [camera, _] = cameras();
    let raw: Vec<u16> = camera.bias.iter().map(|bias| bias - 4).collect();
    let (cube, _, counts) = camera.cube(&raw);
    assert_eq!(counts.masked(), 0);
    assert!(cube.iter().all(|r| *r < 0.0 && *r > -0.01));
}

#[test]
fn reflectance_is_independent_of_the_exposure_time() {
    let [camera, _] = cameras();
    let calibration = camera.calibration();
    for nanos in [1_000_000, 2_500_000, 5_000_000] {
        let raw = camera.expose(nanos, |_, _| 0.4);
        let reflectances = calibration.reflectance(&raw, nanos).expect("fits").values;
        let mean = f64::from(reflectances.mean().expect("not empty"));
        assert!((mean - 0.4).abs() < 0.0005, "at {nanos} ns: {mean}");
    }
}

#[test]
fn buffers_and_references_of_wrong_size_are_rejected() {
    let [camera, _] = cameras();
    let calibration = camera.calibration();
    let n_cells = camera.mosaic.n_cells();
    let mut cube = vec![0.0; 16 * n_cells];
    let mut masks = vec![0; n_cells];
    let raw = camera.expose(T_RAW, |_, _| 0.5);
    let length = |result: Result<FrameCounts, SpectralError>| match result {
        Err(SpectralError::Length { what, .. }) => what,
        other => panic!("{other:?}"),
    };
    assert_eq!(length(calibration.cube_into(&raw[1..], T_RAW, &mut cube, &mut masks)), "raw");
    assert_eq!(length(calibration.cube_into(&raw, T_RAW, &mut cube[1..], &mut masks)), "cube");
    assert_eq!(length(calibration.cube_into(&raw, T_RAW, &mut cube, &mut masks[1..])), "mask");
    let unexposed = calibration.cube_into(&raw, 0, &mut cube, &mut masks);
    assert_eq!(unexposed, Err(SpectralError::Exposure { what: "raw", nanos: 0 }));

    let dark = camera.reference("dark", std::slice::from_ref(&camera.bias));
    let none = Reference::new("white", &camera.mosaic);
    assert!(matches!(
        Calibration::new(&camera.mosaic, &dark, &none, TARGET),
        Err(SpectralError::Frames { what: "white", n_frames: 0 })
    ));
    for reflectance in [0.0, -0.5, 1.5, f64::NAN] {
        let target = WhiteTarget { reflectance, ..TARGET };
        assert!(matches!(
            Calibration::new(&camera.mosaic, &dark, &dark, target),
            Err(SpectralError::WhiteReflectance(_))
        ));
    }
}

#[test]
fn frame_corrected_row_by_row_equals_the_corrected_cube() {
    let camera = Camera::new([53, 31], 4, [2, 3, 50, 27]);
    let dark = camera.reference("dark", &[camera.expose(T_RAW, |_, _| 0.0)]);
    let white = camera.reference("white", &[camera.expose(T_WHITE, |_, _| RHO_WHITE)]);
    let target = WhiteTarget { reflectance: RHO_WHITE, exposure_nanos: T_WHITE };
    let calibration = Calibration::new(&camera.mosaic, &dark, &white, target).expect("sound");
    // Some of the samples are saturated.
    let raw = camera.expose(T_RAW, |x, y| 0.1 + 0.02 * f64::from(x * y % 83));
    let rows: Vec<Vec<f64>> =
        (0..15).map(|j| (0..16).map(|k| 1.0 / 16.0 + f64::from((j * k) % 5) / 10.0 - 0.2).collect()).collect();
    let correction = Correction::new(16, rows.iter().map(|row| &row[..])).expect("sound");
    let n_cells = camera.mosaic.n_cells();
    let mut cube = vec![0.0; 16 * n_cells];
    let mut masks = vec![0; n_cells];
    let counts = calibration.cube_into(&raw, T_RAW, &mut cube, &mut masks).expect("fits");
    assert!(counts.saturated > 20 && counts.dead == 0, "{counts:?}");
    let mut expected = vec![0.0; 15 * n_cells];
    let mut expected_masks = vec![0; n_cells];
    correction.correct_into(&cube, &masks, &mut expected, &mut expected_masks).expect("fits");
    let mut found = vec![9.0; 15 * n_cells];
    let mut found_masks = vec![9; n_cells];
    let again = calibration.corrected_cube_into(&raw, T_RAW, &correction, &mut found, &mut found_masks).expect("fits");
    assert_eq!((again, found_masks), (counts, expected_masks));
    assert_eq!(found, expected);
}

#[test]
fn dark_frames_of_two_exposures_determine_bias_and_dark_current() {
    let [camera, _] = cameras();
    // A different dark current for each pixel, 2 to 9 counts per ms: warm, at long exposures.
    let current = |at: usize| 2.0 + (at * 29 % 8) as f64;
    let with_current = |frame: Vec<u16>, nanos: u64| -> Vec<u16> {
        let counts = |(at, sample): (usize, u16)| f64::from(sample) + current(at) * nanos as f64 * 1e-6;
        frame.into_iter().enumerate().map(|sample| counts(sample).round() as u16).collect()
    };
    let dark = |nanos: u64| camera.reference("dark", &[with_current(camera.bias.clone(), nanos)]);
    let short = dark(1_000_000);
    let long = dark(40_000_000);
    let white = camera.reference("white", &[with_current(camera.expose(T_WHITE, |_, _| RHO_WHITE), T_WHITE)]);
    let panel = WhitePanel { exposure_nanos: T_WHITE, reflectances: vec![RHO_WHITE], region: None };
    let raw = with_current(camera.expose(20_000_000, |_, _| 0.1), 20_000_000);
    let worst = |darks: &[DarkReference<'_>]| {
        let calibration = Calibration::with_panel(&camera.mosaic, darks, &white, &panel).expect("sound");
        let PixelReflectances { values: reflectances, counts, .. } =
            calibration.reflectance(&raw, 20_000_000).expect("fits");
        assert_eq!(counts.masked(), 0);
        reflectances.iter().map(|r| (r - 0.1).abs()).fold(0.0, f32::max)
    };
    let short = DarkReference { exposure_nanos: 1_000_000, frames: &short };
    let long = DarkReference { exposure_nanos: 40_000_000, frames: &long };
    let both = worst(&[short, long]);
    assert!(both < 0.001, "off by {both}");
    // With one exposure time the dark current of 20 ms counts as light.
    let one = worst(&[short]);
    assert!(one > 0.01, "off by {one} only");
    assert!(matches!(
        Calibration::with_panel(&camera.mosaic, &[], &white, &panel),
        Err(SpectralError::Frames { what: "dark", n_frames: 0 })
    ));
}

#[test]
fn panel_region_with_reflectances_per_band_calibrates_the_frame() {
    for mut camera in cameras() {
        // All pixels of a band are equal; the lens has no vignetting.
        for (at, sensitivity) in camera.sensitivity.iter_mut().enumerate() {
            let [width, _] = camera.mosaic.size();
            let x = at as u32 % width;
            let y = at as u32 / width;
            *sensitivity = 400.0 + 10.0 * band_at(&camera.mosaic, x, y) as f64;
        }
        let [x0, y0] = camera.mosaic.origin();
        let region = [x0 + 6, y0 + 11, 23, 12];
        let is_panel =
            |x: u32, y: u32| (region[0]..region[0] + 23).contains(&x) && (region[1]..region[1] + 12).contains(&y);
        let rho = |band: usize| 0.9 - 0.005 * band as f64;
        let mosaic = camera.mosaic.clone();
        let scene = |x: u32, y: u32| if is_panel(x, y) { rho(band_at(&mosaic, x, y)) } else { 0.3 };
        let frame = camera.expose(T_WHITE, scene);
        let dark = camera.reference("dark", std::slice::from_ref(&camera.bias));
        let white = camera.reference("white", std::slice::from_ref(&frame));
        let reflectances: Vec<f64> = (0..mosaic.n_bands()).map(rho).collect();
        let panel = WhitePanel { exposure_nanos: T_WHITE, reflectances, region: Some(region) };
        let dark = DarkReference { exposure_nanos: T_WHITE, frames: &dark };
        let with = |panel: &WhitePanel| Calibration::with_panel(&mosaic, &[dark], &white, panel);
        let calibration = with(&panel).expect("sound");
        let found = calibration.reflectance(&frame, T_WHITE).expect("fits");
        let PixelReflectances { values: reflectances, valid, .. } = found;
        assert!(valid.iter().all(|valid| *valid));
        for ((y, x), r) in reflectances.indexed_iter() {
            let expected = scene(x as u32 + x0, y as u32 + y0);
            assert!((f64::from(*r) - expected).abs() < 0.001, "{r} at {x} {y}, not {expected}");
        }
        let outside = WhitePanel { region: Some([x0, y0, 5000, 12]), ..panel.clone() };
        assert!(matches!(with(&outside), Err(SpectralError::Region { .. })));
        let few = WhitePanel { reflectances: vec![0.9; 3], ..panel };
        assert!(matches!(with(&few), Err(SpectralError::PanelBands { n: 3, .. })));
    }
}

fn band_at(mosaic: &Mosaic, x: u32, y: u32) -> usize {
    let p = mosaic.pattern();
    let [x0, y0] = mosaic.origin();
    (((y + 100 * p - y0) % p) * p + (x + 100 * p - x0) % p) as usize
}
