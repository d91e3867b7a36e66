//! Brightness profiles of images across projected depth edges.
//!
//! Every [`DepthEdge`] is projected onto an exposure of about its time, and the brightness of the image is read along a line
//! across it. A large change of brightness is an outline. Over many edges the background averages out, and a peak remains at
//! the true offset of the outlines (Levinson and Thrun, "Automatic Online Calibration of Cameras and Lasers", RSS 2013; here
//! with a search along a line instead of shifted images). A profile also keeps how a rotation of the camera or a delay of
//! the exposure moves the edge along its line, so that [`crate::fit()`] needs neither images nor points.

use crate::depth_edges::DepthEdge;
use coloring::{ColorImage, PosedExposure, SubmapPoints, VisibilityMap};
use serde::{Deserialize, Serialize};

/// Steps of a profile on each side of the expected outline.
pub const REACH: usize = 48;

/// Angle of a step, rad, or one pixel if it is larger. A profile covers at least 3.4 degrees on each side.
const STEP_RAD: f32 = 0.00125;

/// Largest time between the shot of an edge and the exposure, s: one and a half revolutions, in which the pose drifts by
/// less than a millimetre.
pub const MAX_AGE_S: f32 = 0.15;

/// Largest number of edges per exposure. Additional edges belong to the same outlines.
const MAX_EDGES: usize = 150;

/// Largest distance between the two shots of an edge, steps. Edges with a larger distance are between rings: their
/// position is accurate to half a degree only, with a bias that depends on the shape of objects.
const MAX_GAP: f32 = 8.0;

/// Noise of the image sensor, levels of 255. It prevents the scaling up of a profile that contains only noise.
const NOISE_LEVELS: f32 = 4.0;

/// The brightness changes of one exposure around one depth edge.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Profile {
    /// Range of the near side from the LiDAR, m.
    pub range_m: f32,
    /// Distance between the two shots of the edge, steps: the outline may be anywhere between them.
    pub gap: f32,
    /// Steps that the outline moves along the line per rad of camera rotation about its own x, y and z axes.
    pub per_rad: [f32; 3],
    /// Steps that the outline moves along the line per second that the exposure is later than its stamp.
    pub per_s: f32,
    /// Added to the steps, 0 to 1. It differs from edge to edge: a sum of profiles that are sampled at the same positions would
    /// peak at such a position.
    pub phase: f32,
    /// Change of brightness at each step from `-REACH` to `REACH`, minus the mean, in sixteenths of the standard deviation.
    pub changes: Vec<i8>,
}

/// An exposure with its poses shortly before and after its stamp.
pub struct AlignmentExposure<'a> {
    /// The exposure at its stamp.
    pub exposure: PosedExposure<'a>,
    /// The exposure with poses slightly earlier and slightly later.
    pub shifted: [PosedExposure<'a>; 2],
    /// Time between these two, s.
    pub shift_s: f32,
    /// Occlusion in the exposure.
    pub visibility: &'a VisibilityMap,
    /// Pixels of the exposure.
    pub image: ColorImage<'a>,
}

/// The angle of a step of the profiles of an exposure, rad.
fn step_rad(px_per_rad: f32) -> f32 {
    STEP_RAD.max(1.0 / px_per_rad)
}

impl AlignmentExposure<'_> {
    /// Profiles of the edges that are visible in this exposure.
    pub fn profiles(&self, points: &SubmapPoints<'_>, edges: &[DepthEdge]) -> Vec<Profile> {
        let time = coloring::seconds(self.exposure.stamp, points.origin);
        let near = edges.iter().filter(|edge| (edge.time - time).abs() < MAX_AGE_S);
        let visible: Vec<&DepthEdge> = near.filter(|edge| self.sees(edge)).collect();
        let profiles = visible.into_iter().enumerate().filter_map(|(i, edge)| {
            // Multiples of the golden ratio are uniform.
            self.profile(edge, (i as f32 * 0.618_034).fract())
        });
        thinned(profiles.filter(|profile| profile.gap < MAX_GAP).collect())
    }

    fn sees(&self, edge: &DepthEdge) -> bool {
        let p = self.exposure.in_camera(edge.at);
        self.visibility.sees(&self.exposure, p, self.exposure.lens.pixel(p))
    }

    fn profile(&self, edge: &DepthEdge, phase: f32) -> Option<Profile> {
        let lens = self.exposure.lens;
        let p = self.exposure.in_camera(edge.at);
        let at = lens.pixel(p);
        let toward =
            |step: [f32; 3]| minus(lens.pixel(self.exposure.in_camera([0, 1, 2].map(|i| edge.at[i] + step[i]))), at);
        // The line is perpendicular to the outline in the image; it does not follow the ring.
        let [x, y] = toward(edge.outline);
        let normal = [-y, x].map(|v| v / x.hypot(y));
        let [x, y] = toward(edge.across);
        let side = x * normal[0] + y * normal[1];
        let length = side.abs();
        let line = normal.map(|v| v * side.signum());
        // An edge along the line of sight has no direction across it in the image.
        let norm = |v: [f32; 3]| v.iter().map(|v| v * v).sum::<f32>().sqrt();
        let full_px = norm(edge.across) / norm(p) * lens.px_per_rad();
        if length.is_nan() || length < 0.3 * full_px {
            return None;
        }
        let step_px = step_rad(lens.px_per_rad()) * lens.px_per_rad();
        let along = |[du, dv]: [f32; 2]| (du * line[0] + dv * line[1]) / step_px;
        // A rotation moves p by its cross product. A thousandth of a rad is far above rounding errors.
        let rotated = |axis: usize| {
            let rotation = [0, 1, 2].map(|i| if i == axis { 0.001 } else { 0.0 });
            let moved = cross(rotation, p);
            lens.pixel([0, 1, 2].map(|i| p[i] + moved[i]))
        };
        let per_rad = [0, 1, 2].map(|axis| along(minus(rotated(axis), at)) * 1000.0);
        let [before, after] = [0, 1].map(|i| lens.pixel(self.shifted[i].in_camera(edge.at)));
        let per_s = along(minus(after, before)) / self.shift_s;
        let changes = self.changes(at, [line[0] * step_px, line[1] * step_px], phase)?;
        let is_finite = per_s.is_finite() && per_rad.iter().all(|v| v.is_finite());
        is_finite.then_some(Profile { range_m: edge.range_m, gap: length / step_px, per_rad, per_s, phase, changes })
    }

    /// Changes of brightness from step to step along the line; `None` if it leaves the image.
    fn changes(&self, [u, v]: [f32; 2], [du, dv]: [f32; 2], phase: f32) -> Option<Vec<i8>> {
        let reach = REACH as i32;
        let mut levels = Vec::with_capacity(2 * REACH + 2);
        for i in -reach..=reach + 1 {
            let steps = i as f32 + phase - 0.5;
            let at = [u + steps * du, v + steps * dv];
            if !self.exposure.contains(at[0], at[1]) {
                return None;
            }
            levels.push(self.image.brightness(at));
        }
        let changes: Vec<f32> = levels.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect();
        let n = changes.len() as f32;
        let mean = changes.iter().sum::<f32>() / n;
        let deviation = (changes.iter().map(|c| (c - mean).powi(2)).sum::<f32>() / n).sqrt();
        let scale = 16.0 / (deviation + NOISE_LEVELS);
        Some(changes.into_iter().map(|change| ((change - mean) * scale).round() as i8).collect())
    }
}

/// At most [`MAX_EDGES`] profiles, spread over the whole list.
fn thinned(profiles: Vec<Profile>) -> Vec<Profile> {
    let every = profiles.len().div_ceil(MAX_EDGES).max(1);
    profiles.into_iter().step_by(every).collect()
}

fn minus(a: [f32; 2], b: [f32; 2]) -> [f32; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use coloring::ProjectionCamera;
    use geometry::{CameraModel, Pinhole, Pose, RigCamera};

    /// A camera of 400 px per rad images a bright half plane left of a line through the image center, 30 degrees off
    /// vertical.
    #[test]
    fn profile_crosses_outline_for_any_ring_direction() {
        const SIDE: u32 = 401;
        let model =
            Pinhole { width: SIDE, height: SIDE, fx: 400.0, fy: 400.0, cx: 200.0, cy: 200.0, distortion: [0.0; 5] };
        let camera = RigCamera { body_from_camera: Pose::identity(), model: CameraModel::Pinhole(model) };
        let camera = ProjectionCamera::from(&camera);
        let (sin, cos) = 30.0_f32.to_radians().sin_cos();
        let pixel = |i: u32| {
            let [u, v] = [i % SIDE, i / SIDE].map(|at| at as f32 - 200.0);
            [if u * cos + v * sin < 0.0 { 200_u8 } else { 50 }; 3]
        };
        let pixels: Vec<u8> = (0..SIDE * SIDE).flat_map(pixel).collect();
        let exposure = camera.exposure(0, &Pose::identity(), &Pose::identity());
        let image = ColorImage::new(0, SIDE, SIDE, &pixels).expect("fits");
        let visibility = VisibilityMap::unobstructed();
        let shifted = [exposure; 2];
        let exposure = AlignmentExposure { exposure, shifted, shift_s: 0.04, visibility: &visibility, image };
        for across in [[0.04, 0.0, 0.0], [0.02, 0.02, 0.0], [0.0, 0.05, 0.0]] {
            let outline = [-sin, cos, 0.0];
            let edge = DepthEdge { at: [0.0, 0.0, 10.0], across, range_m: 10.0, outline, time: 0.0 };
            let profile = exposure.profile(&edge, 0.5).expect("in the middle of the image");
            let peak = (0..profile.changes.len()).max_by_key(|i| profile.changes[*i]).expect("not empty");
            assert!(peak.abs_diff(REACH) <= 1, "{profile:?}");
            // A rotation about y moves points sideways, one about x up or down.
            let [x, y, _] = profile.per_rad;
            assert!((y - 400.0 * cos).abs() < 1.0 && (x.abs() - 400.0 * sin).abs() < 1.0, "{profile:?}");
        }
    }
}
