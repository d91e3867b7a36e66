//! Smooth noise for uneven surfaces and stained walls: random values at integer positions, smoothly interpolated.

use random::{hash, unit};

/// Value noise in three dimensions, within -1 to 1, with period 1 between its random values.
pub fn value_noise(seed: u64, x: f32, y: f32, z: f32) -> f32 {
    let ix = x.floor();
    let iy = y.floor();
    let iz = z.floor();
    let fx = smooth(x - ix);
    let fy = smooth(y - iy);
    let fz = smooth(z - iz);
    let corner = |dx: i64, dy: i64, dz: i64| {
        // 21 bits per axis: no repetition within a million cells.
        let part = |v: f32, d: i64| ((v as i64 + d) & 0x1f_ffff) as u64;
        2.0 * unit(hash(seed, part(ix, dx) | (part(iy, dy) << 21) | (part(iz, dz) << 42))) - 1.0
    };
    let edge = |dy, dz| lerp(corner(0, dy, dz), corner(1, dy, dz), fx);
    let face = |dz| lerp(edge(0, dz), edge(1, dz), fy);
    lerp(face(0), face(1), fz)
}

/// Two octaves of [`value_noise`] over a plane, within -1 to 1: undulations of `coarse_m`, and of `fine_m` with half the
/// amplitude.
pub fn rough(seed: u64, u: f32, v: f32, coarse_m: f32, fine_m: f32) -> f32 {
    let coarse = value_noise(seed, u / coarse_m, v / coarse_m, 0.5);
    let fine = value_noise(seed ^ 0x5eed, u / fine_m, v / fine_m, 0.5);
    (2.0 * coarse + fine) / 3.0
}

fn smooth(f: f32) -> f32 {
    f * f * (3.0 - 2.0 * f)
}

fn lerp(a: f32, b: f32, share: f32) -> f32 {
    a + (b - a) * share
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_bounded_continuous_and_not_flat() {
        let mut extremes = [0.0_f32; 2];
        for i in -2000..2000 {
            let x = i as f32 * 0.037;
            let here = value_noise(3, x, 0.3 * x, 0.1);
            let near = value_noise(3, x + 1e-3, 0.3 * x, 0.1);
            assert!((here - near).abs() < 0.01);
            extremes = [extremes[0].min(here), extremes[1].max(here)];
        }
        assert!(extremes[0] < -0.5 && extremes[1] > 0.5 && extremes[0] >= -1.0 && extremes[1] <= 1.0);
    }
}
