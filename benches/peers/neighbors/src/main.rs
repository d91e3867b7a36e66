//! Neighborhoods of every point of a cloud beside [kiddo](https://docs.rs/kiddo): `neighbors_peer CLOUD K RADIUS_M`. CLOUD has x y z
//! as `f32`. Prints the seconds of each step and the sums by which results are compared; `benches/peers/neighbors.py` runs it.
//!
//! `RAYON_NUM_THREADS` sets the threads of both. The best of three rounds counts.

use kiddo::{ImmutableKdTree, SquaredEuclidean};
use neighbors::SpatialIndex;
use std::hint::black_box;
use std::num::NonZero;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

const ROUNDS: usize = 3;

fn main() {
    let words: Vec<String> = std::env::args().collect();
    let [_, cloud, k, radius_m] = words.as_slice() else { panic!("usage: neighbors_peer CLOUD K RADIUS_M") };
    let bytes = std::fs::read(cloud).expect("reads the cloud");
    let number = |bytes: &[u8]| f32::from_le_bytes(bytes.try_into().expect("four bytes"));
    let points: Vec<[f32; 3]> =
        bytes.chunks_exact(12).map(|p| [number(&p[..4]), number(&p[4..8]), number(&p[8..])]).collect();
    let (k, radius_m): (usize, f32) = (k.parse().expect("a number"), radius_m.parse().expect("a number"));
    let only = std::env::var("ONLY").unwrap_or_default();
    if only != "kiddo" {
        let index = timed("ours build", || SpatialIndex::new(&points));
        let own = timed("ours nearest", || index.nearest_of_own(k));
        let of = |i| f64::from(own.of(i).last().expect("has k points").squared_m2);
        println!("ours sum {:.6}", (0..points.len()).map(of).sum::<f64>());
        drop(own);
        let each = timed("ours nearest, as queries", || index.nearest_of_each(&points, k));
        drop(each);
        let within = timed("ours within", || index.within_of_own(radius_m));
        println!("ours count {}", within.n_items());
    }
    if only != "ours" {
        let tree = timed("kiddo build", || ImmutableKdTree::<f32, 3>::new_from_slice(&points).expect("builds"));
        let of_k = NonZero::new(k).expect("k > 0");
        let batch = timed("kiddo nearest", || tree.query_batch(&points).nearest_n::<SquaredEuclidean<f32>>(of_k).execute());
        println!("kiddo sum {:.6}", (0..points.len()).map(|i| f64::from(batch[i].last().expect("k").distance)).sum::<f64>());
        drop(batch);
        let count = timed("kiddo within, lists dropped", || {
            let count = AtomicU64::new(0);
            tree.query_batch(&points).within::<SquaredEuclidean<f32>>(radius_m * radius_m).unsorted().for_each(|_, found| {
                count.fetch_add(black_box(found).len() as u64, Ordering::Relaxed);
            });
            count.into_inner()
        });
        println!("kiddo count {count}");
    }
}

fn timed<R>(name: &str, mut work: impl FnMut() -> R) -> R {
    let mut best = f64::INFINITY;
    let mut result = None;
    for _ in 0..ROUNDS {
        drop(result.take());
        let start = Instant::now();
        result = Some(black_box(work()));
        best = best.min(start.elapsed().as_secs_f64());
    }
    println!("{name} {best:.3}");
    result.expect("at least one round")
}
