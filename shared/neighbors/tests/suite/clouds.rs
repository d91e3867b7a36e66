//! Clouds of tests.

use neighbors::squared_distance;
use random::Random;

/// Positions with a uniform distribution in a cube of side 20 m.
pub fn uniform(n: usize, seed: u64) -> Vec<[f32; 3]> {
    let mut random = Random::new(seed);
    (0..n).map(|_| std::array::from_fn(|_| random.range(-10.0, 10.0))).collect()
}

/// Difficult inputs for an index: surfaces, lines, copies, coordinates on a coarse grid (many equal distances) and a
/// distant outlier.
pub fn awkward(n: usize, seed: u64) -> Vec<[f32; 3]> {
    let mut random = Random::new(seed);
    let mut points: Vec<[f32; 3]> = (0..n)
        .map(|i| match i % 5 {
            0 => [random.range(-10.0, 10.0), random.range(-10.0, 10.0), 0.0],
            1 => [3.0, -2.0, random.range(0.0, 9.0)],
            2 => [0.25, 0.5, 0.75],
            3 => std::array::from_fn(|_| random.index(8) as f32),
            _ => std::array::from_fn(|_| random.gauss() * 1e-3),
        })
        .collect();
    points.extend([[1e12, -3e11, 5.0], [f32::NAN, 0.0, 0.0], [0.0, f32::INFINITY, 0.0], [0.0, 0.0, -2e18]]);
    points
}

/// A KITTI sweep.
pub fn real_sweep() -> Vec<[f32; 3]> {
    let bytes = std::fs::read(real_data::path("kitti00/000094.bin")).expect("readable");
    let number = |bytes: &[u8]| f32::from_le_bytes(bytes.try_into().expect("four bytes"));
    bytes.chunks_exact(16).map(|p| [number(&p[..4]), number(&p[4..8]), number(&p[8..12])]).collect()
}

/// Squared distance and number of all points, nearest first, then by number.
pub fn sorted_by_distance(points: &[[f32; 3]], query: [f32; 3]) -> Vec<(f32, u32)> {
    let is_valid = |p: &[f32; 3]| p.iter().all(|v| v.abs() <= neighbors::LIMIT_M);
    let valid = points.iter().enumerate().filter(|(_, p)| is_valid(p));
    let mut all: Vec<(f32, u32)> = valid.map(|(i, p)| (squared_distance(*p, query), i as u32)).collect();
    all.sort_by(|a, b| a.partial_cmp(b).expect("no NaN"));
    all
}

/// Queries: points of the cloud and positions near them.
pub fn queries(points: &[[f32; 3]], n: usize, seed: u64) -> Vec<[f32; 3]> {
    let mut random = Random::new(seed);
    let valid: Vec<[f32; 3]> =
        points.iter().copied().filter(|p| p.iter().all(|v| v.abs() <= neighbors::LIMIT_M)).collect();
    let near = |i: usize, random: &mut Random| {
        let p = *random.pick(&valid);
        if i.is_multiple_of(2) { p } else { p.map(|v| v + random.range(-2.0, 2.0)) }
    };
    (0..n).map(|i| near(i, &mut random)).collect()
}
