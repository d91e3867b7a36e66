//! Frames per second of processor time from raw mosaics to cubes and to spectrally corrected cubes, on one core:
//! `cargo run --release -p studies --example cube_bench`; compared with `NumPy`: `lab/peers/cube_numpy.py`.

use spectral::{Calibration, Correction, Mosaic, Reference, SpectralError, WhiteTarget};

const N_FRAMES: u32 = 200;

fn main() -> Result<(), SpectralError> {
    bench("HS02 5x5", 5, [0, 3, 2045, 1085], 25)?;
    bench("HS03 4x4", 4, [0, 32, 2048, 1024], 15)
}

fn bench(name: &str, pattern: u32, active_area: [u32; 4], n_virtual_bands: usize) -> Result<(), SpectralError> {
    let mosaic = Mosaic::new([2048, 1088], pattern, active_area, 10)?;
    let frame = |level: u32| (0..2048 * 1088_u32).map(|i| (level + i * 7 % 61) as u16).collect::<Vec<_>>();
    let reference = |what, level| {
        let mut reference = Reference::new(what, &mosaic);
        reference.add(&frame(level)).map(|()| reference)
    };
    let target = WhiteTarget { reflectance: 0.98, exposure_nanos: 5_000_000 };
    let calibration = Calibration::new(&mosaic, &reference("dark", 20)?, &reference("white", 700)?, target)?;
    let raw = frame(360);
    let mut cube = vec![0.0; mosaic.n_bands() * mosaic.n_cells()];
    let mut masks = vec![0; mosaic.n_cells()];
    calibration.cube_into(&raw, 5_000_000, &mut cube, &mut masks)?;
    let start = cpu_seconds();
    for _ in 0..N_FRAMES {
        calibration.cube_into(&raw, 5_000_000, &mut cube, &mut masks)?;
    }
    let seconds = cpu_seconds() - start;
    // The same ramp lies under all three frames: every reflectance is 0.98 * 340 / 680.
    let worst = cube.iter().map(|value| (value - 0.49).abs()).fold(0.0, f32::max);
    assert!(worst < 1e-4, "a reflectance is off by {worst}");
    report(name, "cube", seconds);

    // Rows that sum to 1, as in a real matrix.
    let n_bands = mosaic.n_bands();
    let row = |j: usize| {
        let weight = |k: usize| ((j * 7 + k * 3) % 11) as f64 / 5.0 - 1.0;
        let sum: f64 = (0..n_bands).map(weight).sum();
        (0..n_bands).map(|k| weight(k) + (1.0 - sum) / n_bands as f64).collect::<Vec<f64>>()
    };
    let rows: Vec<Vec<f64>> = (0..n_virtual_bands).map(row).collect();
    let correction = Correction::new(n_bands, rows.iter().map(|row| &row[..]))?;
    let mut corrected = vec![0.0; n_virtual_bands * mosaic.n_cells()];
    let mut corrected_masks = vec![0; mosaic.n_cells()];
    let start = cpu_seconds();
    for _ in 0..N_FRAMES {
        calibration.corrected_cube_into(&raw, 5_000_000, &correction, &mut corrected, &mut corrected_masks)?;
    }
    let seconds = cpu_seconds() - start;
    let worst = corrected.iter().map(|value| (value - 0.49).abs()).fold(0.0, f32::max);
    assert!(worst < 1e-3, "a corrected reflectance is off by {worst}");
    report(name, "corrected cube", seconds);
    Ok(())
}

fn report(name: &str, what: &str, seconds: f64) {
    println!(
        "{name} to {what}: {:.0} frames/s, {:.2} ms each",
        f64::from(N_FRAMES) / seconds,
        seconds * 1e3 / f64::from(N_FRAMES)
    );
}

/// Processor time of this thread, s: other work on the machine does not count.
fn cpu_seconds() -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    let nanos = text.split_whitespace().next().and_then(|nanos| nanos.parse::<f64>().ok());
    nanos.expect("Linux counts the time of threads") * 1e-9
}
