//! Time of ground segmentation of a synthetic submap with two million points:
//! `cargo run --release -p studies --example bench_ground -- models/ground.safetensors`.

use messages::{ClassId, ClassRow, SubmapHeader, SubmapPoint};
use segmentation::ModelInput;
use std::path::Path;
use std::time::Instant;

const N_POINTS: u32 = 2_000_000;
const N_RUNS: usize = 9;

/// Numbers in 0 to 1 that fill the square evenly (the additive recurrences of Roberts).
fn even(i: u32, step: f64) -> f32 {
    (f64::from(i) * step).fract() as f32
}

/// A street of 20 m path, 120 m wide with its surroundings: two thirds ground that climbs by 5 %, denser near the path,
/// the rest fronts and cars.
fn submap() -> Vec<SubmapPoint> {
    let point = |i: u32| {
        let u = even(i, 0.819_172_513_396);
        let v = even(i, 0.671_043_606_703);
        let w = even(i, 0.549_700_477_901);
        let x = 140.0 * u - 60.0;
        // Cubed: most returns are near the sensor.
        let y = 60.0 * (2.0 * v - 1.0).powi(3);
        let above = match i % 6 {
            0 => return SubmapPoint { x, y: 9.0_f32.copysign(y), z: 0.05 * x + 8.0 * w, ..SubmapPoint::default() },
            1 => 1.5,
            _ => 0.04 * (w - 0.5),
        };
        let (x, y) = if i % 6 == 1 { ((x / 8.0).round() * 8.0 + 4.0 * w, 3.0 + 1.8 * v) } else { (x, y) };
        SubmapPoint { x, y, z: 0.05 * x + above, ..SubmapPoint::default() }
    };
    (0..N_POINTS).map(point).collect()
}

fn main() {
    let path = std::env::args_os().nth(1).unwrap_or_else(|| "models/ground.safetensors".into());
    let model = match segmentation::load(Path::new(&path), &segmentation::Options::default()) {
        Ok(model) => model,
        Err(error) => {
            eprintln!("{error}");
            std::process::exit(1);
        }
    };
    let points = submap();
    let header = SubmapHeader::default();
    let mut classes = vec![ClassRow::default(); points.len()];
    let mut nanos: Vec<u128> = Vec::new();
    for _ in 0..N_RUNS {
        let begin = Instant::now();
        let report = model.segment(&ModelInput::new(&header, &points), &mut classes);
        nanos.push(begin.elapsed().as_nanos());
        assert!(report.is_ok(), "{report:?}");
    }
    let n_ground = classes.iter().filter(|row| row.class_id == ClassId::Ground as u8).count();
    let share = n_ground as f64 / points.len() as f64;
    assert!((0.6..0.75).contains(&share), "{share} of the points are ground; made were two thirds");
    nanos.sort_unstable();
    let per_point = |nanos: u128| nanos as f64 / f64::from(N_POINTS);
    println!(
        "ground_quasi_flat, {N_POINTS} points, {N_RUNS} runs: {:.1} ns per point at best, {:.1} in the median; {share:.3} ground",
        per_point(nanos[0]),
        per_point(nanos[N_RUNS / 2])
    );
}
