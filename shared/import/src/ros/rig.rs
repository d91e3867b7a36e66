//! The mounting of the sensors in the body frame.

use super::RosOptions;
use super::frames::Frames;
use crate::error::ImportError;
use geometry::{Isometry3, Pose, Quaternion, Translation3, UnitQuaternion};
use std::collections::BTreeMap;

/// Usual name of the body frame (REP 105).
const BASE_LINK: &str = "base_link";

/// The body frame and the poses of other frames in it.
#[derive(Debug)]
pub(crate) struct Mountings<'a> {
    frames: &'a Frames,
    given: BTreeMap<&'a str, Pose>,
    body: String,
    /// Lines of the report.
    pub report: Vec<String>,
}

impl<'a> Mountings<'a> {
    /// Chooses the body frame. `lidar`: frame of the LiDAR.
    pub fn new(frames: &'a Frames, lidar: &str, options: &'a RosOptions) -> Result<Self, ImportError> {
        let mut given = BTreeMap::new();
        for (frame, [x, y, z, qx, qy, qz, qw]) in &options.transforms {
            let quaternion = Quaternion::new(*qw, *qx, *qy, *qz);
            let translation = Translation3::new(*x, *y, *z);
            if (quaternion.norm() - 1.0).abs() >= 1e-3 || !translation.vector.iter().all(|v| v.is_finite()) {
                let rule = format!("{frame}: {:?} must be a unit quaternion x y z w", [qx, qy, qz, qw]);
                return Err(ImportError::for_option("--transform", rule));
            }
            let rotation = UnitQuaternion::from_quaternion(quaternion);
            given.insert(frame.as_str(), Isometry3::from_parts(translation, rotation));
        }
        let mut report = Vec::new();
        let body = match &options.body_frame {
            Some(name) => name.clone(),
            None if frames.pose(BASE_LINK, lidar).is_some() && frames.contains(BASE_LINK) => BASE_LINK.to_owned(),
            None if frames.contains(lidar) => frames.root_of(lidar).unwrap_or(lidar).to_owned(),
            None if given.contains_key(lidar) => BASE_LINK.to_owned(),
            None => {
                report.push(format!("no transform of frame {lidar:?}: the body frame is the LiDAR frame"));
                lidar.to_owned()
            }
        };
        if report.is_empty() {
            report.push(format!("the body frame is {body:?}"));
        }
        report
            .extend(frames.changed().map(|frame| format!("frame {frame:?} has several transforms; the last is taken")));
        Ok(Self { frames, given, body, report })
    }

    /// The pose of a frame in the body frame, or the reason why it is unknown.
    pub fn body_from(&self, frame: &str) -> Result<Pose, String> {
        let body = &self.body;
        self.given.get(frame).copied().or_else(|| self.frames.pose(body, frame)).ok_or_else(|| {
            if let Some(motion) = self.frames.motion_above(frame).filter(|_| self.frames.root_of(frame) != Some(body)) {
                return format!("{motion}: a sensor must be fixed; --transform \"{frame}=x,y,z,qx,qy,qz,qw\" sets its pose");
            }
            format!(
                "no transform from {body:?} to {frame:?} in tf_static; --transform \"{frame}=x,y,z,qx,qy,qz,qw\" gives one"
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ros::messages::Transform;

    fn frames() -> Frames {
        let mut frames = Frames::default();
        for (parent, child) in [("base_footprint", "base_link"), ("base_link", "velodyne")] {
            let parent = parent.to_owned();
            let child = child.to_owned();
            let transform = Transform { parent, child, translation: [0.0, 0.0, 1.0], rotation: [0.0, 0.0, 0.0, 1.0] };
            frames.add(transform).expect("valid");
        }
        frames
    }

    #[test]
    fn body_frame_is_base_link_or_the_root_or_the_lidar() {
        let all = frames();
        let options = RosOptions::default();
        let height = |rig: &Mountings, frame: &str| rig.body_from(frame).map(|pose| pose.translation.z);
        let rig = Mountings::new(&all, "velodyne", &options).expect("has one");
        assert_eq!((rig.body.as_str(), height(&rig, "velodyne")), ("base_link", Ok(1.0)));
        let root = RosOptions { body_frame: Some("base_footprint".into()), ..RosOptions::default() };
        let rig = Mountings::new(&all, "velodyne", &root).expect("has one");
        assert_eq!(height(&rig, "velodyne"), Ok(2.0));
        assert!(height(&rig, "camera").expect_err("is unknown").contains("--transform \"camera=x,y,z,qx,qy,qz,qw\""));
        let rig = Mountings::new(&all, "os_sensor", &options).expect("has one");
        assert_eq!((rig.body.as_str(), height(&rig, "os_sensor")), ("os_sensor", Ok(0.0)));
        assert!(rig.report[0].contains("the body frame is the LiDAR frame"), "{:?}", rig.report);
        let given = RosOptions {
            transforms: vec![("os_sensor".into(), [0.0, 0.0, 3.0, 0.0, 0.0, 1.0, 0.0])],
            ..RosOptions::default()
        };
        let rig = Mountings::new(&all, "os_sensor", &given).expect("has one");
        assert_eq!((rig.body.as_str(), height(&rig, "os_sensor")), ("base_link", Ok(3.0)));
        let bad = RosOptions { transforms: vec![("a".into(), [0.0; 7])], ..RosOptions::default() };
        assert!(Mountings::new(&all, "a", &bad).expect_err("is refused").to_string().contains("unit quaternion"));
    }
}
