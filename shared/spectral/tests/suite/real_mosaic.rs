//! A frame of a real 4x4 snapshot mosaic camera, 2048x1024, 8 bit.

use formats::raw_mosaic::RawMosaic;
use spectral::{Calibration, Mosaic, Reference, WhiteTarget};

const SIZE: [u32; 2] = [2048, 1024];

fn cube(raw: &[u16], pattern: u32) -> (Mosaic, Vec<f32>, Vec<u32>) {
    let mosaic = Mosaic::new(SIZE, pattern, [0, 0, SIZE[0], SIZE[1]], 8).expect("sound");
    let constant = |what, level| {
        let mut reference = Reference::new(what, &mosaic);
        reference.add(&vec![level; raw.len()]).map(|()| reference).expect("fits")
    };
    let target = WhiteTarget { reflectance: 1.0, exposure_nanos: 1 };
    let calibration = Calibration::new(&mosaic, &constant("dark", 0), &constant("white", 250), target).expect("sound");
    let mut cube = vec![0.0; mosaic.n_bands() * mosaic.n_cells()];
    let mut masks = vec![0; mosaic.n_cells()];
    calibration.cube_into(raw, 1, &mut cube, &mut masks).expect("fits");
    (mosaic, cube, masks)
}

/// Standard deviation of the means of the planes, in counts.
fn spread_of_means(pattern: u32, raw: &[u16]) -> f64 {
    let (mosaic, cube, _) = cube(raw, pattern);
    let planes = cube.chunks_exact(mosaic.n_cells());
    let means: Vec<f64> = planes.map(|plane| plane.iter().map(|r| f64::from(*r)).sum::<f64>()).collect();
    let means: Vec<f64> = means.iter().map(|sum| 250.0 * sum / mosaic.n_cells() as f64).collect();
    let mean = means.iter().sum::<f64>() / means.len() as f64;
    (means.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / means.len() as f64).sqrt()
}

#[real_data::test("mosaic/4_baichideng2_11.tif")]
fn bands_of_a_real_mosaic_have_distinct_means() {
    let path = real_data::path("mosaic/4_baichideng2_11.tif");
    let raw = RawMosaic::read(&path).expect("a frame").samples;
    let (mosaic, cube, masks) = cube(&raw, 4);
    assert_eq!(mosaic.cells(), [512, 256]);
    for (index, sample) in raw.iter().enumerate() {
        let x = index % 2048;
        let y = index / 2048;
        let band = (y % 4) * 4 + x % 4;
        let cell = (y / 4) * 512 + x / 4;
        let measured = *sample < 255;
        assert_eq!(masks[cell] >> band & 1 == 1, measured);
        let expected = if measured { f32::from(*sample) / 250.0 } else { 0.0 };
        assert!((cube[band * mosaic.n_cells() + cell] - expected).abs() < 1e-6);
    }
    // The filters of the camera repeat every 4 pixels, so its bands differ. Any other pattern mixes them (1.30 counts for
    // 4, 0.025 for 3 and 0.023 for 5).
    let right = spread_of_means(4, &raw);
    assert!((right - 1.30).abs() < 0.05, "{right}");
    for wrong in [3, 5] {
        assert!(spread_of_means(wrong, &raw) < 0.1, "pattern {wrong}: {}", spread_of_means(wrong, &raw));
    }
}
