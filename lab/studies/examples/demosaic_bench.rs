//! Frames per second of processor time to full resolution, on one core: `cargo run --release -p studies --example demosaic_bench`.

use spectral::{Demosaicer, Demosaicing, SpectralError};

const N_FRAMES: u32 = 10;

fn main() -> Result<(), SpectralError> {
    bench("HS02 5x5", 2045, 1085, 5)?;
    bench("HS03 4x4", 2048, 1024, 4)
}

fn bench(name: &str, width: usize, height: usize, pattern: usize) -> Result<(), SpectralError> {
    let samples: Vec<f32> = (0..width * height).map(|i| (i * 7919 % 1009) as f32 / 1009.0).collect();
    let mut demosaicer = Demosaicer::new(width, height, pattern)?;
    let mut bands = vec![0.0; samples.len() * demosaicer.n_bands()];
    for method in [
        Demosaicing::WeightedBilinear,
        Demosaicing::IntensityDifference,
        Demosaicing::IterativeIntensityDifference(2),
        Demosaicing::PpiDifference,
    ] {
        demosaicer.demosaic_into(&samples, method, &mut bands)?;
        let start = cpu_seconds();
        for _ in 0..N_FRAMES {
            demosaicer.demosaic_into(&samples, method, &mut bands)?;
        }
        let seconds = (cpu_seconds() - start) / f64::from(N_FRAMES);
        println!("{name} {method:?}: {:.1} frames/s, {:.0} ms each", 1.0 / seconds, seconds * 1e3);
    }
    Ok(())
}

/// Processor time of this thread, s: other work on the machine does not count.
fn cpu_seconds() -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    let nanos = text.split_whitespace().next().and_then(|nanos| nanos.parse::<f64>().ok());
    nanos.expect("Linux counts the time of threads") * 1e-9
}
