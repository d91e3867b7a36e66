//! How far the outlines that the LiDAR saw are from those that the cameras saw: what is looked at.
//!
//! Every [`DepthEdge`] is projected onto an exposure of about its time, and the image's brightness is read along the line across it:
//! where it changes by much there is an outline. Over many edges what belongs to the background averages out, and what
//! remains is a peak where the outlines really are (Levinson and Thrun, "Automatic Online Calibration of Cameras and Lasers", RSS 2013,
//! with the search along a line instead of shifted images). How a turn of the camera, or a delay of its shutter, would move each edge along its
//! line is kept with it, so that [`crate::offset_fit`] needs neither images nor points.

use crate::choose::View;
use crate::cloud::Cloud;
use crate::color::Picture;
use crate::depth_edges::DepthEdge;
use crate::occlusion::Sight;
use serde::{Deserialize, Serialize};

/// Steps of a profile to each side of the expected outline.
pub const REACH: usize = 48;

/// Angle of a step, rad; a pixel if that is more. The profile reaches 3.4 degrees to each side, or more.
const STEP_RAD: f32 = 0.00125;

/// Between the shot of an edge and the exposure, s: a revolution and a half, in whose time the pose drifts by less than a millimetre.
pub const MAX_AGE_S: f32 = 0.15;

/// Of one exposure at most. More are of the same outlines.
const MAX_EDGES: usize = 150;

/// Edges whose shots are farther apart, steps, are those between rings: where their outline is, is known to half a degree, and which half of it
/// is more likely depends on the shape of things.
const MAX_GAP: f32 = 8.0;

/// Levels out of 255. A change that the sensor's noise makes is no outline, and counts less in a profile where there is no other.
const NOISE_LEVELS: f32 = 4.0;

/// What one exposure shows around one depth edge.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Profile {
    /// Range of the near side from the sensor, m.
    pub range_m: f32,
    /// Between the two shots of the edge, steps: the outline may be anywhere there.
    pub gap: f32,
    /// By how many steps the outline moves along the line if the camera is turned about its own x, y and z axes, per rad.
    pub per_rad: [f32; 3],
    /// The same if the exposure was later than its stamp says, per s.
    pub per_s: f32,
    /// What is added to the steps, 0 to 1: another one for each edge, because a sum of profiles that are read at the same places would peak
    /// at such a place.
    pub phase: f32,
    /// Change of brightness at each step from `-REACH` to `REACH`, less the mean, in sixteenths of the standard deviation.
    pub changes: Vec<i8>,
}

/// An exposure, and how its camera would see if the shutter had opened at another time.
pub struct Look<'a> {
    /// As the stamp says.
    pub view: View<'a>,
    /// A bit before and after.
    pub beside: [View<'a>; 2],
    /// Between these two, s.
    pub beside_s: f32,
    /// What hides from it.
    pub sight: &'a Sight,
    /// Its pixels.
    pub picture: Picture<'a>,
}

/// The angle of a step of a view's profiles, rad.
pub fn step_rad(px_per_rad: f32) -> f32 {
    STEP_RAD.max(1.0 / px_per_rad)
}

impl Look<'_> {
    /// Profiles of the edges that this exposure sees.
    pub fn profiles(&self, cloud: &Cloud<'_>, edges: &[DepthEdge]) -> Vec<Profile> {
        let time = crate::chunk::seconds(self.view.stamp, cloud.origin);
        let near = edges.iter().filter(|edge| (edge.time - time).abs() < MAX_AGE_S);
        let seen: Vec<&DepthEdge> = near.filter(|edge| self.sees(edge)).collect();
        let profiles = seen.into_iter().enumerate().filter_map(|(i, edge)| {
            // Multiples of the golden section are spread evenly.
            self.profile(edge, (i as f32 * 0.618_034).fract())
        });
        thinned(profiles.filter(|profile| profile.gap < MAX_GAP).collect())
    }

    fn sees(&self, edge: &DepthEdge) -> bool {
        let p = in_camera(&self.view, edge.at);
        let [u, v] = self.view.lens.pixel(p);
        let range_m = p.iter().map(|v| v * v).sum::<f32>().sqrt();
        self.view.holds(u, v) && range_m <= self.sight.reach_m(self.sight.grid.cell(u, v))
    }

    fn profile(&self, edge: &DepthEdge, phase: f32) -> Option<Profile> {
        let lens = self.view.lens;
        let p = in_camera(&self.view, edge.at);
        let at = lens.pixel(p);
        let toward =
            |way: [f32; 3]| minus(lens.pixel(in_camera(&self.view, [0, 1, 2].map(|i| edge.at[i] + way[i]))), at);
        // The line is read across the outline as the camera sees it, not along the ring.
        let [x, y] = toward(edge.outline);
        let normal = [-y, x].map(|v| v / x.hypot(y));
        let [x, y] = toward(edge.across);
        let side = x * normal[0] + y * normal[1];
        let (length, line) = (side.abs(), normal.map(|v| v * side.signum()));
        // An edge that the camera looks along has no line across.
        let norm = |v: [f32; 3]| v.iter().map(|v| v * v).sum::<f32>().sqrt();
        let full_px = norm(edge.across) / norm(p) * lens.px_per_rad();
        if length.is_nan() || length < 0.3 * full_px {
            return None;
        }
        let step_px = step_rad(lens.px_per_rad()) * lens.px_per_rad();
        let along = |[du, dv]: [f32; 2]| (du * line[0] + dv * line[1]) / step_px;
        // A turn moves the direction of p by its cross product; a thousandth of a rad is far above rounding.
        let turned = |axis: usize| {
            let turn = [0, 1, 2].map(|i| if i == axis { 0.001 } else { 0.0 });
            let moved = cross(turn, p);
            lens.pixel([0, 1, 2].map(|i| p[i] + moved[i]))
        };
        let per_rad = [0, 1, 2].map(|axis| along(minus(turned(axis), at)) * 1000.0);
        let [before, after] = [0, 1].map(|i| lens.pixel(in_camera(&self.beside[i], edge.at)));
        let per_s = along(minus(after, before)) / self.beside_s;
        let changes = self.changes(at, [line[0] * step_px, line[1] * step_px], phase)?;
        let is_finite = per_s.is_finite() && per_rad.iter().all(|v| v.is_finite());
        is_finite.then_some(Profile { range_m: edge.range_m, gap: length / step_px, per_rad, per_s, phase, changes })
    }

    /// How brightness changes from step to step along the line; `None` if it leaves the image or nothing changes.
    fn changes(&self, [u, v]: [f32; 2], [du, dv]: [f32; 2], phase: f32) -> Option<Vec<i8>> {
        let reach = REACH as i32;
        let mut levels = Vec::with_capacity(2 * REACH + 2);
        for i in -reach..=reach + 1 {
            let steps = i as f32 + phase - 0.5;
            let at = [u + steps * du, v + steps * dv];
            if !self.view.holds(at[0], at[1]) {
                return None;
            }
            levels.push(self.picture.brightness(at));
        }
        let changes: Vec<f32> = levels.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect();
        let n = changes.len() as f32;
        let mean = changes.iter().sum::<f32>() / n;
        let deviation = (changes.iter().map(|c| (c - mean).powi(2)).sum::<f32>() / n).sqrt();
        let scale = 16.0 / (deviation + NOISE_LEVELS);
        Some(changes.into_iter().map(|change| ((change - mean) * scale).round() as i8).collect())
    }
}

/// [`MAX_EDGES`] at most, from the whole list.
fn thinned(profiles: Vec<Profile>) -> Vec<Profile> {
    let every = profiles.len().div_ceil(MAX_EDGES).max(1);
    profiles.into_iter().step_by(every).collect()
}

fn in_camera(view: &View<'_>, p: [f32; 3]) -> [f32; 3] {
    view.camera_from_submap.map(|[a, b, c, d]| a * p[0] + b * p[1] + c * p[2] + d)
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
    use crate::views::Camera;
    use geometry::{CameraModel, Pinhole, Pose, RigCamera};

    /// A camera of 400 px per rad that sees a white half plane left of a line through its middle, 30 degrees off the upright.
    #[test]
    fn a_profile_runs_across_the_outline_whichever_way_the_ring_runs() {
        const SIDE: u32 = 401;
        let model =
            Pinhole { width: SIDE, height: SIDE, fx: 400.0, fy: 400.0, cx: 200.0, cy: 200.0, distortion: [0.0; 5] };
        let camera = RigCamera { body_from_camera: Pose::identity(), model: CameraModel::Pinhole(model) };
        let camera = Camera::from(&camera);
        let (sin, cos) = 30.0_f32.to_radians().sin_cos();
        let pixel = |i: u32| {
            let [u, v] = [i % SIDE, i / SIDE].map(|at| at as f32 - 200.0);
            [if u * cos + v * sin < 0.0 { 200_u8 } else { 50 }; 3]
        };
        let pixels: Vec<u8> = (0..SIDE * SIDE).flat_map(pixel).collect();
        let view = camera.view(0, &Pose::identity(), &Pose::identity());
        let picture = Picture::new(0, SIDE, SIDE, &pixels).expect("fits");
        let sight = Sight::free();
        let look = Look { view, beside: [view; 2], beside_s: 0.04, sight: &sight, picture };
        for across in [[0.04, 0.0, 0.0], [0.02, 0.02, 0.0], [0.0, 0.05, 0.0]] {
            let outline = [-sin, cos, 0.0];
            let edge = DepthEdge { at: [0.0, 0.0, 10.0], across, range_m: 10.0, outline, time: 0.0 };
            let profile = look.profile(&edge, 0.5).expect("in the middle of the image");
            let peak = (0..profile.changes.len()).max_by_key(|i| profile.changes[*i]).expect("not empty");
            assert!(peak.abs_diff(REACH) <= 1, "{profile:?}");
            // A turn about y moves things to the side, one about x downward or upward.
            let [x, y, _] = profile.per_rad;
            assert!((y - 400.0 * cos).abs() < 1.0 && (x.abs() - 400.0 * sin).abs() < 1.0, "{profile:?}");
        }
    }
}
