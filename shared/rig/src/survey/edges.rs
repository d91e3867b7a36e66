//! The outlines of objects in each sweep, for the comparison with images.

use super::RawSweep;
use camera_alignment::{DepthEdge, depth_edges};
use coloring::{PointBuffers, SubmapPoints};
use geometry::{Pose, Stamp};
use messages::{SubmapPoint, SubmapSweep};
use registration::{KeptPoints, OpenSubmap, Registered, Sweep, SweepRows};

/// Points nearer than this are on the vehicle itself, m.
const MIN_RANGE_M: f64 = 1.0;

/// The depth edges of one sweep.
#[derive(Clone, Debug)]
pub struct SweepEdges {
    /// First shot.
    pub begin: Stamp,
    /// Last shot.
    pub end: Stamp,
    /// Pose of the edge frame: position and heading of the body at the first shot.
    pub odom_from_edges: Pose,
    /// Number of rings of the LiDAR.
    pub n_rings: u32,
    /// The edges; their times are in s after the first shot.
    pub edges: Vec<DepthEdge>,
}

impl SweepEdges {
    /// The edges of a registered sweep; `None` if it has no match, because its points are then not deskewed.
    pub(super) fn from_sweep(raw: &RawSweep, sweep: &Sweep, registered: &Registered, begin: &Pose) -> Option<Self> {
        registered.matched.as_ref()?;
        let OneSweep { frame, sweep: submap_sweep, rows } = deskewed(raw, sweep, registered, begin);
        let mut buffers = PointBuffers::default();
        let points = SubmapPoints::new(
            &rows,
            std::slice::from_ref(&submap_sweep),
            raw.stamp.0,
            raw.header.n_rings,
            &mut buffers,
        );
        let all = [f32::NEG_INFINITY, f32::INFINITY];
        let edges = depth_edges(&points, &[all]);
        let odom_from_edges = frame.odom_from_submap;
        let end = registered.end_stamp();
        Some(Self { begin: raw.stamp, end, odom_from_edges, n_rings: raw.header.n_rings, edges })
    }
}

/// A submap with one sweep: the frame of the body at its first shot.
pub(super) struct OneSweep {
    pub frame: registration::SubmapFrame,
    sweep: SubmapSweep,
    /// The deskewed points.
    pub rows: Vec<SubmapPoint>,
}

/// Deskews the points of a sweep.
pub(super) fn deskewed(raw: &RawSweep, sweep: &Sweep, registered: &Registered, begin: &Pose) -> OneSweep {
    let kept = KeptPoints::select(sweep, MIN_RANGE_M, 0.0);
    let mut rows = vec![SubmapPoint::default(); kept.indices.len()];
    let mut submap = OpenSubmap::new(begin, 1);
    let body = begin.translation.vector;
    submap.append(&mut rows, 0, SweepRows { raw: raw.view(), sweep, kept: &kept }, registered, body);
    OneSweep { frame: submap.frame, sweep: submap.header.sweeps[0], rows }
}
