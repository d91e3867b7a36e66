//! Frames per second from raw mosaics to cubes, on one core: `cargo run --release -p spectral --example cube_bench`.

use spectral::{Calibration, Mosaic, Reference, SpectralError, WhiteTarget};
use std::time::Instant;

const N_FRAMES: u32 = 200;

fn main() -> Result<(), SpectralError> {
    bench("HS02 5x5", 5, [0, 3, 2045, 1085])?;
    bench("HS03 4x4", 4, [0, 32, 2048, 1024])
}

fn bench(name: &str, pattern: u32, active_area: [u32; 4]) -> Result<(), SpectralError> {
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
    let start = Instant::now();
    for _ in 0..N_FRAMES {
        calibration.cube_into(&raw, 5_000_000, &mut cube, &mut masks)?;
    }
    let seconds = start.elapsed().as_secs_f64();
    // The same ramp lies under all three frames: every reflectance is 0.98 * 340 / 680.
    let worst = cube.iter().map(|value| (value - 0.49).abs()).fold(0.0, f32::max);
    assert!(worst < 1e-4, "a reflectance is off by {worst}");
    println!(
        "{name}: {:.0} frames/s, {:.2} ms each",
        f64::from(N_FRAMES) / seconds,
        seconds * 1e3 / f64::from(N_FRAMES)
    );
    Ok(())
}
