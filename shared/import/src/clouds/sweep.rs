//! A section of the path of the scanner.

use messages::SubmapSweep;

/// A section of the path of the scanner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sweep {
    /// Stamp in the recording, ns.
    pub stamp: i64,
    pub duration_nanos: u32,
    /// Position at its start, m.
    pub begin: [f64; 3],
    pub end: [f64; 3],
}

impl Sweep {
    /// The entry in the header of a submap, in its frame and without points. `seq` is the number of the sweep in the
    /// recording.
    pub fn entry(&self, seq: u64, origin: [f64; 3]) -> SubmapSweep {
        let pose = |position: [f64; 3]| {
            let [x, y, z] = difference(position, origin).map(|value| value as f32);
            [x, y, z, 0.0, 0.0, 0.0, 1.0]
        };
        SubmapSweep {
            stamp: self.stamp,
            seq,
            duration_nanos: self.duration_nanos,
            submap_from_lidar_begin: pose(self.begin),
            submap_from_lidar_end: pose(self.end),
            ..SubmapSweep::default()
        }
    }
}

pub(super) fn difference(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|k| a[k] - b[k])
}
