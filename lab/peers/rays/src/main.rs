//! Rays per second and core, from the root:
//! `cargo run --release --manifest-path lab/peers/rays/Cargo.toml [-- SEED [COPIES]]`.
//!
//! Time is the CPU time of the thread, so that other programs do not count; sharing caches still slows it.
//!
//! 1. The urban scene from the lidar: one revolution of the mounted HDL-32E, shadows off: scene with movers, the
//!    static scene, and whole firings (beam, receiver, noise). In packets, as the simulator does it, and as single rays.
//! 2. The same rays on the same triangles with [obvhs](https://docs.rs/obvhs) (its eight-wide tree with SIMD traversal). The
//!    triangles are the scene's; other primitives are replaced by their bounding boxes, because obvhs supports only triangles.
//! 3. The same for COPIES copies of the scene, 60 m apart: a large town. The default is three million triangles.

use obvhs::BvhBuildParams;
use obvhs::cwbvh::builder::build_cwbvh_from_tris;
use obvhs::ray::{Ray as PeerRay, RayHit};
use obvhs::triangle::Triangle;
use raytrace::{Bvh, Primitive, Ray, Shape, Vec3};
use rustix::time::{ClockId, clock_gettime};
use simulation::{DriveSpec, Simulation};
use std::hint::black_box;
use std::time::{Duration, Instant};

/// Maximum range, m.
const FAR_M: f32 = 120.0;
/// After five seconds of drive.
const FIRST_PACKET: u64 = 5 * 1809;
/// The best of this many rounds counts.
const ROUNDS: usize = 20;

fn main() {
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    one.install(run);
}

fn run() {
    let numbers: Vec<u64> = std::env::args().skip(1).filter_map(|arg| arg.parse().ok()).collect();
    let seed = numbers.first().copied().unwrap_or(1);
    let start = Instant::now();
    let simulation = Simulation::new(&DriveSpec::urban(seed, 12.0)).expect("a town");
    println!(
        "urban scene, seed {seed}: {} primitives, {} movers, made in {:.2} s",
        simulation.scene.n_primitives(),
        simulation.scene.movers().len(),
        start.elapsed().as_secs_f64()
    );
    let lidar = simulation.lidar();
    let in_order = |packet: u64| {
        let rays = lidar.rays(FIRST_PACKET + packet);
        lidar.order().iter().map(|slot| rays[*slot]).collect::<Vec<Ray>>()
    };
    let rays: Vec<Ray> = (0..181).flat_map(in_order).collect();
    let scene = &simulation.scene;
    let snapshot = scene.at(5.0);
    let hits = rays.iter().filter(|ray| scene.cast(&snapshot, ray, FAR_M).is_some()).count();
    println!(
        "one revolution: {} rays, {:.1} % meet something within {FAR_M} m",
        rays.len(),
        100.0 * share(hits, rays.len())
    );
    report("scene, movers and normals, ray packets", rays.len(), || {
        scene.cast_all(&rays, FAR_M, |_| &snapshot).iter().flatten().count()
    });
    report("static scene, nearest, ray packets", rays.len(), || {
        scene.statics().nearest_of(&rays, FAR_M).iter().flatten().count()
    });
    report("scene, movers and normals", rays.len(), || {
        rays.iter().filter(|ray| scene.cast(&snapshot, ray, FAR_M).is_some()).count()
    });
    report("static scene, nearest", rays.len(), || {
        rays.iter().filter(|ray| scene.statics().nearest(ray, FAR_M).is_some()).count()
    });
    report("static scene, any", rays.len(), || rays.iter().filter(|ray| scene.statics().any(ray, FAR_M)).count());
    report("static scene, any, ray packets", rays.len(), || {
        scene.statics().any_of(&rays, FAR_M).iter().filter(|is_hit| **is_hit).count()
    });
    report("firings of the lidar", rays.len(), || lidar.packets(FIRST_PACKET..FIRST_PACKET + 181).len());
    let n_rays: usize = (0..181).map(|packet| lidar.n_rays(FIRST_PACKET + packet)).sum();
    println!("a firing takes {:.2} rays", share(n_rays, rays.len()));

    let soup: Vec<[Vec3; 3]> = scene.statics().primitives().iter().flat_map(|p| triangles(&p.shape)).collect();
    beside_obvhs("the scene's triangles", &soup, &rays);
    let copies = numbers.get(1).map_or(3_000_000_usize.div_ceil(soup.len()), |copies| *copies as usize);
    let shift = |copy: usize| Vec3::new(0.0, 60.0 * (copy as f32 - (copies / 2) as f32), 0.0);
    let town: Vec<[Vec3; 3]> =
        (0..copies).flat_map(|copy| soup.iter().map(move |t| t.map(|p| p + shift(copy)))).collect();
    beside_obvhs(&format!("{copies} copies"), &town, &rays);
}

fn beside_obvhs(name: &str, soup: &[[Vec3; 3]], rays: &[Ray]) {
    println!("{name}: {} triangles", soup.len());
    let primitives: Vec<Primitive> =
        soup.iter().map(|&[a, b, c]| Primitive { shape: Shape::triangle(a, b, c), surface: 0 }).collect();
    let start = Instant::now();
    let tree = Bvh::new(primitives);
    println!("  ours: built in {:.2} s, {} MB", start.elapsed().as_secs_f64(), tree.bytes() >> 20);
    let mine = report("  ours", rays.len(), || rays.iter().filter(|ray| tree.nearest(ray, FAR_M).is_some()).count());

    report("  ours, ray packets", rays.len(), || tree.nearest_of(rays, FAR_M).iter().flatten().count());

    let peer: Vec<Triangle> = soup
        .iter()
        .map(|t| {
            let [v0, v1, v2] = t.map(|p| glam::vec3a(p.x, p.y, p.z));
            Triangle { v0, v1, v2 }
        })
        .collect();
    let start = Instant::now();
    let bvh = build_cwbvh_from_tris(&peer, BvhBuildParams::medium_build(), &mut Duration::default());
    println!("  obvhs: built in {:.2} s", start.elapsed().as_secs_f64());
    // In the order of its leaves, as ours.
    let ordered: Vec<Triangle> = bvh.primitive_indices.iter().map(|&index| peer[index as usize]).collect();
    let peer_rays: Vec<PeerRay> = rays
        .iter()
        .map(|ray| {
            let [origin, direction] = [ray.origin, ray.direction].map(|v| glam::vec3a(v.x, v.y, v.z));
            PeerRay::new(origin, direction, 1e-3, FAR_M)
        })
        .collect();
    let theirs = report("  obvhs", rays.len(), || {
        peer_rays
            .iter()
            .filter(|ray| bvh.ray_traverse(**ray, &mut RayHit::none(), |ray, id| ordered[id].intersect(ray)))
            .count()
    });
    println!("  hits: {mine} and {theirs}");
}

/// Prints the best rate and returns the count of the work.
fn report(name: &str, n_rays: usize, mut work: impl FnMut() -> usize) -> usize {
    let mut best = f64::INFINITY;
    let mut counted = 0;
    for _ in 0..ROUNDS {
        let start = cpu_seconds();
        counted = black_box(work());
        best = best.min(cpu_seconds() - start);
    }
    println!("{name}: {:.2} million rays/s on one core", n_rays as f64 / best * 1e-6);
    counted
}

fn cpu_seconds() -> f64 {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}

/// Triangles of a shape: a triangle unchanged, any other shape as its bounding box.
fn triangles(shape: &Shape) -> Vec<[Vec3; 3]> {
    if let Shape::Triangle { corner, edge1, edge2 } = *shape {
        return vec![[corner, corner + edge1, corner + edge2]];
    }
    let [low, high] = shape.bounds();
    let corner = |i: usize| Vec3::from_fn(|axis, _| if i >> axis & 1 == 1 { high[axis] } else { low[axis] });
    [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]]
        .iter()
        .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]].map(|t| t.map(corner)))
        .collect()
}

fn share(part: usize, all: usize) -> f64 {
    part as f64 / all.max(1) as f64
}
