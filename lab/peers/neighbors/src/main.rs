//! Neighborhoods of every point of a cloud, compared with [kiddo](https://docs.rs/kiddo): `neighbors_peer CLOUD K RADIUS_M`.
//! CLOUD has x y z as `f32`. Prints the seconds of each step and the sums by which results are compared;
//! `lab/peers/neighbors.py` runs it.
//!
//! `RAYON_NUM_THREADS` sets the threads of both. The best of two rounds counts; the radius search runs once. Each line has the
//! wall time and the CPU time: other programs lengthen the wall time.

use kiddo::{ImmutableKdTree, SquaredEuclidean};
use neighbors::SpatialIndex;
use rustix::time::{ClockId, clock_gettime};
use std::hint::black_box;
use std::num::NonZero;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::LazyLock;
use std::time::Instant;

static START: LazyLock<Instant> = LazyLock::new(Instant::now);

/// Wall and CPU time, s.
fn now() -> [f64; 2] {
    let cpu = clock_gettime(ClockId::ProcessCPUTime);
    [START.elapsed().as_secs_f64(), cpu.tv_sec as f64 + cpu.tv_nsec as f64 * 1e-9]
}

fn main() {
    let words: Vec<String> = std::env::args().collect();
    let [_, cloud, k, radius_m] = words.as_slice() else { panic!("usage: neighbors_peer CLOUD K RADIUS_M") };
    let bytes = std::fs::read(cloud).expect("reads the cloud");
    let number = |bytes: &[u8]| f32::from_le_bytes(bytes.try_into().expect("four bytes"));
    let points: Vec<[f32; 3]> =
        bytes.chunks_exact(12).map(|p| [number(&p[..4]), number(&p[4..8]), number(&p[8..])]).collect();
    let k: usize = k.parse().expect("a number");
    let radius_m: f32 = radius_m.parse().expect("a number");
    let only = std::env::var("ONLY").unwrap_or_default();
    if only != "kiddo" {
        let index = timed("ours build", 2, || SpatialIndex::new(&points));
        let own = timed("ours nearest", 2, || index.nearest_of_own(k));
        let of = |i| f64::from(own.get(i).last().expect("has k points").squared_m2);
        println!("ours sum: {:.6}", (0..points.len()).map(of).sum::<f64>());
        drop(own);
        let each = timed("ours nearest, as queries", 2, || index.nearest_of_each(&points, k));
        drop(each);
        let counts = timed("ours within, lists dropped", 1, || {
            index.map_within_of_own(radius_m, |_, found| black_box(found).len() as u64)
        });
        println!("ours count: {}", counts.iter().sum::<u64>());
    }
    if only != "ours" {
        let tree = timed("kiddo build", 2, || ImmutableKdTree::<f32, 3>::new_from_slice(&points).expect("builds"));
        let of_k = NonZero::new(k).expect("k > 0");
        let batch = timed("kiddo nearest", 2, || tree.query_batch(&points).nearest_n::<SquaredEuclidean<f32>>(of_k).execute());
        println!("kiddo sum: {:.6}", (0..points.len()).map(|i| f64::from(batch[i].last().expect("k").distance)).sum::<f64>());
        drop(batch);
        let count = timed("kiddo within, lists dropped", 1, || {
            let count = AtomicU64::new(0);
            tree.query_batch(&points).within::<SquaredEuclidean<f32>>(radius_m * radius_m).unsorted().for_each(|_, found| {
                count.fetch_add(black_box(found).len() as u64, Ordering::Relaxed);
            });
            count.into_inner()
        });
        println!("kiddo count: {count}");
    }
}

fn timed<R>(name: &str, rounds: usize, mut work: impl FnMut() -> R) -> R {
    let mut best = [f64::INFINITY; 2];
    let mut result = None;
    for _ in 0..rounds {
        drop(result.take());
        let start = now();
        result = Some(black_box(work()));
        let end = now();
        best = std::array::from_fn(|clock| best[clock].min(end[clock] - start[clock]));
    }
    println!("{name}: {:.3} s, CPU {:.3}", best[0], best[1]);
    result.expect("at least one round")
}
