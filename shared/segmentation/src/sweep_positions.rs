//! Where the first LiDAR of a submap was.

use messages::{MAX_SWEEPS_PER_SUBMAP, SubmapHeader};

/// Positions of the first LiDAR in a sweep, m, in the frame of the submap.
pub(crate) struct SweepPositions {
    /// At the first shot.
    pub begin: [f64; 3],
    /// At the last shot.
    pub end: [f64; 3],
}

/// The positions in all sweeps of the first LiDAR that have points, in order.
pub(crate) fn sweep_positions(header: &SubmapHeader) -> impl Iterator<Item = SweepPositions> {
    let n_sweeps = (header.n_sweeps as usize).min(MAX_SWEEPS_PER_SUBMAP);
    let of_first = header.sweeps[..n_sweeps].iter().filter(|sweep| sweep.lidar == 0 && sweep.n_points > 0);
    let position = |pose: &[f32; 7]| [0, 1, 2].map(|axis| f64::from(pose[axis]));
    let positions = of_first.map(move |sweep| SweepPositions {
        begin: position(&sweep.submap_from_lidar_begin),
        end: position(&sweep.submap_from_lidar_end),
    });
    positions.filter(|SweepPositions { begin, end }| begin.iter().chain(end).all(|v| v.is_finite()))
}
