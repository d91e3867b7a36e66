//! The tree of frames of `tf_static`, and of the frames of `tf` that never move.

use super::messages::Transform;
use geometry::{Isometry3, Pose, Quaternion, Translation3, UnitQuaternion};
use std::collections::BTreeMap;

/// Frames with their parents.
#[derive(Debug, Default)]
pub(crate) struct Frames {
    parents: BTreeMap<String, (String, Pose)>,
    /// Frames whose transform changed later.
    changed: BTreeMap<String, u64>,
    /// Frames of `tf`.
    observed: BTreeMap<String, Observed>,
}

/// A frame of `tf` over the recording.
#[derive(Debug)]
struct Observed {
    parent: String,
    first: Pose,
    /// Largest differences from the first pose, m and rad.
    moved_m: f64,
    turned_rad: f64,
    has_other_parent: bool,
}

/// Frames of `tf` that move less are fixed, m and rad: 1 mm, 0.05 degrees.
const MAX_MOVED_M: f64 = 0.001;
const MAX_TURNED_RAD: f64 = 0.05 * std::f64::consts::PI / 180.0;

impl Observed {
    fn is_fixed(&self) -> bool {
        self.moved_m <= MAX_MOVED_M && self.turned_rad <= MAX_TURNED_RAD && !self.has_other_parent
    }
}

impl Frames {
    /// Adds a transform; a later one of the same frame replaces it.
    pub fn add(&mut self, transform: Transform) -> Result<(), String> {
        let (parent, child, pose) = checked(transform)?;
        let entry = (parent, pose);
        if self.parents.get(&child).is_some_and(|known| *known != entry) {
            *self.changed.entry(child.clone()).or_default() += 1;
        }
        self.parents.insert(child, entry);
        Ok(())
    }

    /// Adds a transform of `tf`.
    pub fn observe(&mut self, transform: Transform) -> Result<(), String> {
        let (parent, child, pose) = checked(transform)?;
        let new =
            || Observed { parent: parent.clone(), first: pose, moved_m: 0.0, turned_rad: 0.0, has_other_parent: false };
        let known = self.observed.entry(child).or_insert_with(new);
        known.has_other_parent |= known.parent != parent;
        known.moved_m = known.moved_m.max((pose.translation.vector - known.first.translation.vector).norm());
        known.turned_rad = known.turned_rad.max(known.first.rotation.angle_to(&pose.rotation));
        Ok(())
    }

    /// Takes the frames of `tf` that never moved and are not in `tf_static`. Returns their names.
    pub fn take_fixed(&mut self) -> Vec<String> {
        let mut taken = Vec::new();
        for (child, observed) in &self.observed {
            if observed.is_fixed() && !self.parents.contains_key(child) {
                self.parents.insert(child.clone(), (observed.parent.clone(), observed.first));
                taken.push(child.clone());
            }
        }
        taken
    }

    /// Describes the motion of the root of `frame` in its parent on `tf`, if it moves.
    pub fn motion_above(&self, frame: &str) -> Option<String> {
        let root = self.root_of(frame)?;
        let observed = self.observed.get(root).filter(|observed| !observed.is_fixed())?;
        let Observed { parent, moved_m, turned_rad, .. } = observed;
        let mm = moved_m * 1e3;
        let degrees = turned_rad.to_degrees();
        Some(format!("frame {root:?} moves in {parent:?} on tf, by {mm:.0} mm and {degrees:.1} degrees"))
    }

    pub fn is_empty(&self) -> bool {
        self.parents.is_empty()
    }

    /// Frames whose transform changed.
    pub fn changed(&self) -> impl Iterator<Item = &str> {
        self.changed.keys().map(String::as_str)
    }

    pub fn contains(&self, frame: &str) -> bool {
        self.parents.contains_key(frame) || self.parents.values().any(|(parent, _)| parent == frame)
    }

    /// The root frame of a frame, and the pose in it. `None` for frames in a cycle.
    fn root<'a>(&'a self, frame: &'a str) -> Option<(&'a str, Pose)> {
        let mut at = frame;
        let mut root_from_frame = Pose::identity();
        for _ in 0..=self.parents.len() {
            let Some((parent, parent_from_at)) = self.parents.get(at) else { return Some((at, root_from_frame)) };
            root_from_frame = parent_from_at * root_from_frame;
            at = parent;
        }
        None
    }

    /// Name of the root frame of a frame.
    pub fn root_of<'a>(&'a self, frame: &'a str) -> Option<&'a str> {
        self.root(frame).map(|(root, _)| root)
    }

    /// The pose of `frame` in `body`; `None` if no transforms connect them.
    pub fn pose(&self, body: &str, frame: &str) -> Option<Pose> {
        if body == frame {
            return Some(Pose::identity());
        }
        let (root, root_from_frame) = self.root(frame)?;
        let (other, root_from_body) = self.root(body)?;
        (root == other).then(|| root_from_body.inverse() * root_from_frame)
    }
}

/// Parent, child and pose.
fn checked(transform: Transform) -> Result<(String, String, Pose), String> {
    let Transform { parent, child, translation, rotation: [x, y, z, w] } = transform;
    let quaternion = Quaternion::new(w, x, y, z);
    let is_rigid = translation.iter().all(|v| v.is_finite()) && (quaternion.norm() - 1.0).abs() < 1e-3;
    if !is_rigid {
        return Err(format!(
            "transform of {child}: translation {translation:?} and rotation {:?} must be numbers and a unit quaternion",
            [x, y, z, w]
        ));
    }
    let rotation = UnitQuaternion::from_quaternion(quaternion);
    Ok((parent, child, Isometry3::from_parts(Translation3::from(translation), rotation)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::{Point3, Vector3};

    fn transform(parent: &str, child: &str, translation: [f64; 3], yaw: f64) -> Transform {
        let q = UnitQuaternion::from_scaled_axis(Vector3::z() * yaw);
        Transform { parent: parent.into(), child: child.into(), translation, rotation: [q.i, q.j, q.k, q.w] }
    }

    #[test]
    fn poses_are_chained_over_the_common_root() {
        let mut frames = Frames::default();
        let quarter = std::f64::consts::FRAC_PI_2;
        for one in [
            transform("map", "base_link", [5.0, 0.0, 0.0], 1.0),
            transform("base_link", "mast", [1.0, 0.0, 2.0], quarter),
            transform("mast", "velodyne", [1.0, 0.0, 0.5], 0.0),
            transform("other", "elsewhere", [0.0; 3], 0.0),
        ] {
            frames.add(one).expect("valid");
        }
        let pose = frames.pose("base_link", "velodyne").expect("is connected");
        let at = pose * Point3::new(1.0, 0.0, 0.0);
        assert!((at - Point3::new(1.0, 2.0, 2.5)).norm() < 1e-12, "{at}");
        let back = frames.pose("velodyne", "base_link").expect("is connected");
        assert!((back * at - Point3::new(1.0, 0.0, 0.0)).norm() < 1e-12);
        assert_eq!(frames.root_of("velodyne"), Some("map"));
        assert_eq!(frames.pose("base_link", "elsewhere"), None);
        assert_eq!(frames.pose("base_link", "unknown"), None);
        assert_eq!(frames.pose("unknown", "unknown"), Some(Pose::identity()));
    }

    #[test]
    fn frames_of_tf_are_taken_if_they_never_move() {
        let mut frames = Frames::default();
        frames.add(transform("base_link", "imu", [0.0; 3], 0.0)).expect("valid");
        for k in 0..100 {
            let k = f64::from(k);
            for one in [
                transform("odom", "base_link", [k, 0.0, 0.0], 0.01 * k),
                transform("base_link", "velodyne", [1.0 + 9e-6 * k, 0.0, 2.0], 8e-6 * k),
                transform("base_link", "turret", [0.0; 3], 2e-5 * k),
                // tf_static takes precedence over tf.
                transform("base_link", "imu", [5.0, 0.0, 0.0], 0.0),
            ] {
                frames.observe(one).expect("valid");
            }
        }
        assert_eq!(frames.take_fixed(), ["velodyne"]);
        let pose = frames.pose("base_link", "velodyne").expect("is connected");
        assert_eq!(pose.translation.vector, Vector3::new(1.0, 0.0, 2.0));
        assert_eq!(frames.pose("base_link", "imu").map(|pose| pose.translation.x), Some(0.0));
        assert_eq!(frames.pose("base_link", "turret"), None);
        let motion = frames.motion_above("turret").expect("turns");
        assert_eq!(motion, "frame \"turret\" moves in \"base_link\" on tf, by 0 mm and 0.1 degrees");
        assert!(frames.motion_above("velodyne").expect("drives").contains("\"base_link\" moves in \"odom\""));
        assert_eq!(frames.root_of("velodyne"), Some("base_link"));
    }

    #[test]
    fn circles_end_and_changes_are_known() {
        let mut frames = Frames::default();
        frames.add(transform("a", "b", [1.0, 0.0, 0.0], 0.0)).expect("valid");
        frames.add(transform("b", "a", [1.0, 0.0, 0.0], 0.0)).expect("valid");
        assert_eq!(frames.pose("a", "b"), None);
        frames.add(transform("b", "a", [1.0, 0.0, 0.0], 0.0)).expect("valid");
        assert_eq!(frames.changed().count(), 0);
        frames.add(transform("b", "a", [2.0, 0.0, 0.0], 0.0)).expect("valid");
        assert_eq!(frames.changed().collect::<Vec<_>>(), ["a"]);
        let bad = Transform { rotation: [0.0; 4], ..transform("a", "c", [0.0; 3], 0.0) };
        assert!(frames.add(bad).expect_err("is refused").contains("unit quaternion"));
    }
}
