//! The virtual camera of a picture.

use super::settings::PictureSize;
use geometry::Vector3;

/// Height of the camera above the lidar and distance behind it, m: above parked vans, below the second floor.
const CAMERA_UP_M: f64 = 9.0;
const CAMERA_BACK_M: f64 = 22.0;

/// The camera looks at the road this far ahead of the vehicle, m.
const TARGET_AHEAD_M: f64 = 14.0;
const LIDAR_HEIGHT_M: f64 = 2.0;

/// Half of the picture's width at a distance of 1: a field of view of 70 degrees.
const HALF_WIDTH: f64 = 0.70;

/// Nothing nearer than this is drawn, m.
const NEAR_M: f64 = 1.0;
/// A view of a place leaves out points nearer than this share of the distance: leaves and facades in front of it.
const NEAR_SHARE: f64 = 0.55;

/// Margin around the path in the top view, m.
const PATH_MARGIN_M: f64 = 30.0;

/// Projects points to pixels.
pub struct Camera {
    eye: Vector3<f64>,
    right: Vector3<f64>,
    down: Vector3<f64>,
    forward: Vector3<f64>,
    /// Scale: px at a distance of 1, or px per m.
    scale: f64,
    is_perspective: bool,
    center: [f64; 2],
    /// Nothing nearer than this is drawn.
    near_m: f64,
}

/// The projection of a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Projected {
    /// px, right.
    pub u: f64,
    /// px, down.
    pub v: f64,
    /// Distance along the optical axis, m.
    pub depth_m: f64,
    /// px per m at this depth.
    pub px_per_m: f64,
}

impl Camera {
    /// Orthographic top view, north up: the surroundings of the path, or all points if there is no path.
    pub fn top_view(bounds: [[f64; 3]; 2], path: &[[f64; 3]], size: PictureSize) -> Self {
        let [[x0, x1], [y0, y1]] = Self::surroundings(bounds, path);
        let max = bounds[1];
        let fit = |side: usize, low: f64, high: f64| side as f64 / (high - low).max(1.0);
        Self {
            eye: Vector3::new(f64::midpoint(x0, x1), f64::midpoint(y0, y1), max[2] + 1.0 + NEAR_M),
            right: Vector3::x(),
            down: -Vector3::y(),
            forward: -Vector3::z(),
            scale: fit(size.width, x0, x1).min(fit(size.height, y0, y1)),
            is_perspective: false,
            center: center(size),
            near_m: NEAR_M,
        }
    }

    /// Orthographic view from above of the surroundings of a place.
    pub fn top_view_of(place: [f64; 2], radius_m: f64, bounds: [[f64; 3]; 2], size: PictureSize) -> Self {
        let [min, max] = bounds;
        let low = [place[0] - radius_m, place[1] - radius_m, min[2]];
        let high = [place[0] + radius_m, place[1] + radius_m, max[2]];
        Self::top_view([low, high], &[], size)
    }

    /// Perspective view of the surroundings of a place, from the side of the path. `ground_m`: height of the ground there.
    pub fn street_view_of(place: [f64; 2], radius_m: f64, ground_m: f64, path: &[[f64; 3]], size: PictureSize) -> Self {
        let target = Vector3::new(place[0], place[1], ground_m);
        let distance = |p: &[f64; 3]| (p[0] - place[0]).hypot(p[1] - place[1]);
        // From the nearest position on the path that is far enough for a direction; without such a position, from the south.
        let far_enough = path.iter().filter(|p| distance(p) > 0.2 * radius_m);
        let from = far_enough.min_by(|a, b| distance(a).total_cmp(&distance(b)));
        let side = from.map(|p| Vector3::new(p[0] - place[0], p[1] - place[1], 0.0).normalize());
        // At this distance the radius fills half of the picture's width.
        let eye = target + side.unwrap_or(-Vector3::y()) * (1.2 * radius_m) + Vector3::z() * (0.8 * radius_m);
        Self { near_m: NEAR_SHARE * (target - eye).norm(), ..Self::looking(eye, target, size) }
    }

    fn looking(eye: Vector3<f64>, target: Vector3<f64>, size: PictureSize) -> Self {
        let forward = (target - eye).normalize();
        let right = forward.cross(&Vector3::z()).normalize();
        Self {
            eye,
            right,
            down: forward.cross(&right),
            forward,
            scale: size.width as f64 / 2.0 / HALF_WIDTH,
            is_perspective: true,
            center: center(size),
            near_m: NEAR_M,
        }
    }

    /// Whether this is a view from above with north up.
    pub fn is_top_view(&self) -> bool {
        !self.is_perspective
    }

    /// Extent of the top view: smallest and largest x, and y, m.
    pub fn surroundings([min, max]: [[f64; 3]; 2], path: &[[f64; 3]]) -> [[f64; 2]; 2] {
        [0, 1].map(|k| {
            let low = path.iter().map(|p| p[k]).fold(f64::INFINITY, f64::min) - PATH_MARGIN_M;
            let high = path.iter().map(|p| p[k]).fold(f64::NEG_INFINITY, f64::max) + PATH_MARGIN_M;
            if path.is_empty() { [min[k], max[k]] } else { [low.max(min[k]), high.min(max[k])] }
        })
    }

    /// Perspective view from behind and above the position `share` (0 to 1) along the path. Without a path, the view is along
    /// the longer side of the bounds.
    pub fn street_view([min, max]: [[f64; 3]; 2], path: &[[f64; 3]], share: f64, size: PictureSize) -> Self {
        let middle = |k: usize| f64::midpoint(min[k], max[k]);
        let along_x = max[0] - min[0] >= max[1] - min[1];
        let fallback = if along_x { Vector3::x() } else { Vector3::y() };
        let pose = pose_on_path(path, share).unwrap_or_else(|| PathPose {
            position: Vector3::new(middle(0), middle(1), min[2] + LIDAR_HEIGHT_M),
            heading: fallback,
        });
        let PathPose { position: place, heading } = pose;
        let eye = place - heading * CAMERA_BACK_M + Vector3::z() * CAMERA_UP_M;
        let target = place + heading * TARGET_AHEAD_M - Vector3::z() * LIDAR_HEIGHT_M;
        Self::looking(eye, target, size)
    }

    /// px per m: everywhere in the top view, at a distance of 1 m in a perspective.
    pub fn px_per_m(&self) -> f64 {
        self.scale
    }

    /// `None` for points behind or very near the camera, and for positions that are not finite.
    pub fn project(&self, [x, y, z]: [f64; 3]) -> Option<Projected> {
        let p = Vector3::new(x, y, z) - self.eye;
        let depth_m = p.dot(&self.forward);
        // NaN is not less than any number, so it needs its own test.
        if depth_m.is_nan() || depth_m < self.near_m {
            return None;
        }
        let px_per_m = if self.is_perspective { self.scale / depth_m } else { self.scale };
        let u = self.center[0] + p.dot(&self.right) * px_per_m;
        let v = self.center[1] + p.dot(&self.down) * px_per_m;
        Some(Projected { u, v, depth_m, px_per_m })
    }
}

fn center(size: PictureSize) -> [f64; 2] {
    [size.width as f64 / 2.0, size.height as f64 / 2.0]
}

/// A pose on a path.
struct PathPose {
    position: Vector3<f64>,
    /// Horizontal unit vector.
    heading: Vector3<f64>,
}

/// The pose at `share` of the path. The heading is taken over the 20 m around, or less at the ends.
fn pose_on_path(path: &[[f64; 3]], share: f64) -> Option<PathPose> {
    let path: Vec<Vector3<f64>> = path.iter().map(|p| Vector3::from(*p)).collect();
    let place = *path.get(((path.len().checked_sub(1)?) as f64 * share) as usize)?;
    let around: Vec<&Vector3<f64>> = path.iter().filter(|p| (*p - place).norm() < 10.0).collect();
    let mut heading = *around.last()? - *around.first()?;
    heading.z = 0.0;
    Some(PathPose { position: place, heading: heading.try_normalize(0.5)? })
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: PictureSize = PictureSize { width: 200, height: 100 };
    const BOUNDS: [[f64; 3]; 2] = [[-50.0, -10.0, 0.0], [50.0, 10.0, 8.0]];

    #[test]
    fn street_view_keeps_right_and_up() {
        let path: Vec<[f64; 3]> = (0..100).map(|i| [0.0, f64::from(i), 2.0]).collect();
        let camera = Camera::street_view(BOUNDS, &path, 0.5, SIZE);
        let at = |p| camera.project(p).expect("is in front");
        // The vehicle drives north: east is on the right.
        assert!(at([3.0, 60.0, 0.0]).u > at([-3.0, 60.0, 0.0]).u);
        assert!(at([0.0, 60.0, 5.0]).v < at([0.0, 60.0, 0.0]).v);
        let target = at([0.0, 49.0 + TARGET_AHEAD_M, 0.0]);
        assert!((target.u - 100.0).abs() < 1e-6 && (target.v - 50.0).abs() < 1e-6, "{target:?}");
        assert_eq!(camera.project([0.0, 0.0, 0.0]), None);
        assert_eq!(camera.project([f64::NAN, 60.0, 0.0]), None);
    }

    #[test]
    fn top_view_has_north_up_and_contains_the_bounds() {
        let camera = Camera::top_view(BOUNDS, &[], SIZE);
        let corner = camera.project([50.0, 10.0, 0.0]).expect("is below");
        assert!((corner.u - 200.0).abs() < 1e-9 && (corner.v - 30.0).abs() < 1e-9, "{corner:?}");
        assert!(camera.project([0.0, 0.0, 8.0]).expect("is below").depth_m < corner.depth_m);
    }
}
