//! Measures CPU time of instance extraction with a generated submap of two million points:
//! `cargo run --release -p studies --example bench_instance`.

use instance::{InstanceStage, Settings};
use messages::{
    ClassHeader, ClassId, ClassRow, ClassTopic, InstanceTopic, PoseRow, SubmapHeader, SubmapPoint, SubmapTopic,
};
use rustix::time::{ClockId, clock_gettime};
use stage::testing::{Bench, context};
use std::path::Path;

const N_POINTS: u32 = 2_000_000;
const N_RUNS: usize = 9;
const N_CARS: u32 = 40;

/// Low-discrepancy numbers from 0 to 1 (additive recurrences of Roberts).
fn even(i: u32, step: f64) -> f32 {
    (f64::from(i) * step).fract() as f32
}

/// A street 160 m long and 60 m wide: two thirds of the points are ground, one sixth facades, one sixth 40 parked cars in two rows.
fn submap() -> (Vec<SubmapPoint>, Vec<ClassRow>) {
    let point = |i: u32| {
        let u = even(i, 0.819_172_513_396);
        let v = even(i, 0.671_043_606_703);
        let w = even(i, 0.549_700_477_901);
        let (x, y, above, class) = match i % 6 {
            0 => (160.0 * u, 30.0_f32.copysign(v - 0.5), 8.0 * w, ClassId::Building),
            1 => {
                let car = (i / 6) % N_CARS;
                let row = car % 2;
                let place = car / 2;
                (8.0 * place as f32 + 4.4 * u, 6.0 * row as f32 - 4.0 + 1.8 * v, 0.2 + 1.3 * w, ClassId::Vehicles)
            }
            _ => (160.0 * u, 60.0 * v - 30.0, 0.0, ClassId::Ground),
        };
        let point = SubmapPoint { x, y, z: 0.05 * x + above, ..SubmapPoint::default() };
        (point, ClassRow { class_id: class as u8, score: 255 })
    };
    (0..N_POINTS).map(point).unzip()
}

/// CPU time of this process, independent of other programs.
fn cpu_nanos() -> i64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec * 1_000_000_000 + time.tv_nsec
}

fn main() {
    let (points, classes) = submap();
    let mut nanos: Vec<i64> = Vec::new();
    for _ in 0..N_RUNS {
        let stage = Bench::<InstanceStage>::new(&Settings::default(), &context(Path::new("/nowhere")));
        let mut bench = stage.expect("the stage reads no files");
        let odom_from_submap = PoseRow { translation: [0.0; 3], rotation: [0.0, 0.0, 0.0, 1.0] };
        let header = SubmapHeader { odom_from_submap, ..SubmapHeader::default() };
        bench.send::<SubmapTopic>(0, header, points.clone());
        bench.send::<ClassTopic>(0, ClassHeader::default(), classes.clone());
        let begin = cpu_nanos();
        bench.tick().expect("the submap is sound");
        nanos.push(cpu_nanos() - begin);
        let columns = bench.take::<InstanceTopic>();
        assert_eq!(columns[0].header().n_instances, N_CARS, "cars found");
    }
    nanos.sort_unstable();
    let per_point = |nanos: i64| nanos as f64 / f64::from(N_POINTS);
    println!(
        "instance, {N_POINTS} points, {N_CARS} cars, {N_RUNS} runs: {:.1} ns per point at best, {:.1} in the median",
        per_point(nanos[0]),
        per_point(nanos[N_RUNS / 2])
    );
}
