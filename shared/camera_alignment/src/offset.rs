//! The estimated offset between cameras and LiDAR.

/// A rotation of a camera, rad about its own x (image moves up), y (to the right) and z (the optical axis, clockwise).
pub type Rotation = [f32; 3];

/// Fewer edges give no result.
const MIN_EDGES: usize = 150;

/// Smallest height of a valid peak, in standard deviations of the score of random positions. Edges of one outline are not
/// independent, so 4 are not enough: with errors planted in rig l3d2 on development seeds 41, 42 and 44, right peaks have 12
/// and more, wrong ones mostly 9 and 10.
const MIN_PEAK: f32 = 11.0;

/// Largest standard deviation of a valid rotation, rad. If parts of the drive disagree more, each has found its own peak.
const MAX_DEVIATION: f32 = 2.5e-3;

/// The offset of one camera.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraOffset {
    /// Rotation of the camera in its own frame that aligns it with the points: `p_true = rotation * p_as_mounted`.
    pub rotation: Rotation,
    /// Whether a rotation about the optical axis is significant; otherwise it is 0.
    pub is_rotated_about_axis: bool,
    /// Whether only the rotation perpendicular to the outlines is observable, because all of them have about the same
    /// direction; the other one is 0.
    pub is_across_alone: bool,
    /// Standard deviation of the rotation, from parts of the drive, rad.
    pub deviation: Rotation,
    /// Number of edges.
    pub n_edges: usize,
    /// Height of the peak, in standard deviations of the score of random positions.
    pub peak: f32,
}

impl CameraOffset {
    /// Whether the offset is observable: the peak is significant and the parts of the drive agree.
    pub fn is_observable(&self) -> bool {
        self.n_edges >= MIN_EDGES && self.peak >= MIN_PEAK && self.sigma() <= MAX_DEVIATION
    }

    /// Whether the offset is observable and significantly larger than an angle, rad.
    pub fn exceeds(&self, angle: f32) -> bool {
        self.is_observable() && self.angle() - 3.0 * self.sigma() > angle
    }

    /// Standard deviation of the offset in the middle of the image, rad.
    pub fn sigma(&self) -> f32 {
        self.deviation[0].hypot(self.deviation[1])
    }

    /// Offset in the middle of the image, rad.
    pub fn angle(&self) -> f32 {
        self.rotation[0].hypot(self.rotation[1])
    }
}

/// The offsets of all cameras.
#[derive(Clone, Debug, PartialEq)]
pub struct Offset {
    /// Time from stamp to exposure, s, and its standard deviation; `None` if no significant delay was found.
    pub delay_s: Option<[f32; 2]>,
    /// Whether a delay is observable: it is not if it would move the edges like rotations.
    pub is_delay_observable: bool,
    /// Offset of each camera, by index.
    pub cameras: Vec<CameraOffset>,
}
