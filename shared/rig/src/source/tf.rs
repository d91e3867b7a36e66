//! A tree of ROS frames in the format of `ros2 topic echo /tf_static`.

use super::{RigParts, SourceOptions, pose_of};
use crate::yaml::{Node, Value, YamlError};
use geometry::Pose;
use std::collections::{BTreeMap, BTreeSet};

/// Largest number of frames from the body to a sensor.
const MAX_DEPTH: usize = 64;
/// Parts of frame names that identify sensors.
const LIDAR_NAMES: [&str; 9] =
    ["lidar", "velodyne", "os_sensor", "ouster", "hesai", "pandar", "rslidar", "livox", "laser"];
const IMU_NAMES: [&str; 1] = ["imu"];
const ANTENNA_NAMES: [&str; 3] = ["gnss", "gps", "antenna"];
/// Usual names of the body frame.
const BODY_NAMES: [&str; 3] = ["base_link", "base_footprint", "body"];

/// Parent of a frame.
#[derive(Clone, Debug)]
struct ParentFrame {
    parent: String,
    parent_from_frame: Pose,
}

/// A frame above another one.
struct Ancestor {
    name: String,
    /// Pose of the lower frame in this one.
    from_frame: Pose,
}

/// Frames by name, each with its parent.
#[derive(Clone, Debug, Default)]
pub struct FrameTree {
    frames: BTreeMap<String, ParentFrame>,
}

impl FrameTree {
    /// Adds the transforms of some documents.
    pub(super) fn add(&mut self, documents: &[Node]) -> Result<(), YamlError> {
        for document in documents {
            let single = std::slice::from_ref(document);
            let transforms = match document.get("transforms") {
                Some(node) => node.elements(),
                None if document.get("child_frame_id").is_some() => single,
                // The end of the stream is an empty document.
                None if matches!(&document.value, Value::Scalar(_)) => &[],
                None => return Err(YamlError { line: document.line, rule: "no transforms".to_owned() }),
            };
            for transform in transforms {
                self.add_transform(transform)?;
            }
        }
        Ok(())
    }

    fn add_transform(&mut self, node: &Node) -> Result<(), YamlError> {
        let fault = |rule: String| YamlError { line: node.line, rule };
        let name = |node: &Node| node.text().map(|text| text.trim_start_matches('/').to_owned());
        let child =
            name(node.required("child_frame_id")?).ok_or_else(|| fault("child_frame_id is not a name".into()))?;
        let parent = node.required("header")?.required("frame_id")?;
        let parent = name(parent).ok_or_else(|| fault("frame_id is not a name".into()))?;
        let transform = node.required("transform")?;
        let numbers = |key: &str, names: &[&str]| -> Result<Vec<f64>, YamlError> {
            let part = transform.required(key)?;
            names.iter().map(|name| part.required(name)?.number()).collect()
        };
        let position = numbers("translation", &["x", "y", "z"])?;
        let rotation = numbers("rotation", &["x", "y", "z", "w"])?;
        let pose =
            pose_of([position[0], position[1], position[2]], [rotation[0], rotation[1], rotation[2], rotation[3]])
                .map_err(|rule| fault(format!("{child}: {rule}")))?;
        self.frames.insert(child, ParentFrame { parent, parent_from_frame: pose });
        Ok(())
    }

    /// Whether the tree has a frame.
    pub fn has(&self, frame: &str) -> bool {
        self.frames.contains_key(frame) || self.frames.values().any(|entry| entry.parent == frame)
    }

    /// The frames from one up to the root.
    fn up_from(&self, frame: &str) -> Result<Vec<Ancestor>, String> {
        let mut way = vec![Ancestor { name: frame.to_owned(), from_frame: Pose::identity() }];
        while let Some(last) = way.last() {
            let Some(entry) = self.frames.get(&last.name) else { break };
            if way.len() > MAX_DEPTH {
                return Err(format!("the parents of frame {frame} form a circle, or are more than {MAX_DEPTH}"));
            }
            let from_frame = entry.parent_from_frame * last.from_frame;
            way.push(Ancestor { name: entry.parent.clone(), from_frame });
        }
        Ok(way)
    }

    /// Name of the body: the chosen one, a usual one, or the only root.
    pub fn body(&self, options: &SourceOptions) -> Result<String, String> {
        if let Some(name) = &options.body_frame {
            return if self.has(name) { Ok(name.clone()) } else { Err(format!("no frame {name}; {}", self.list())) };
        }
        if let Some(name) = BODY_NAMES.into_iter().find(|name| self.has(name)) {
            return Ok(name.to_owned());
        }
        let mut roots: Vec<&String> = self
            .frames
            .values()
            .map(|entry| &entry.parent)
            .filter(|parent| !self.frames.contains_key(*parent))
            .collect();
        roots.sort();
        roots.dedup();
        match roots[..] {
            [root] => Ok(root.clone()),
            _ => Err(format!("the body frame is ambiguous; give --body FRAME. {}", self.list())),
        }
    }

    fn list(&self) -> String {
        let names: Vec<&str> = self.frames.keys().map(String::as_str).take(40).collect();
        format!("frames: {}", names.join(", "))
    }

    /// Pose of a frame in the body.
    pub fn body_from(&self, frame: &str, options: &SourceOptions) -> Result<Pose, String> {
        let body = self.body(options)?;
        let of_frame = self.up_from(frame)?;
        let of_body = self.up_from(&body)?;
        let common = of_frame.iter().find_map(|frame| {
            let body = of_body.iter().find(|other| other.name == frame.name)?;
            Some(body.from_frame.inverse() * frame.from_frame)
        });
        common.ok_or_else(|| format!("frames {frame} and {body} are not connected; {}", self.list()))
    }

    /// The sensors identified by frame names. A kind with several frames is skipped and noted.
    pub(super) fn parts(&self, options: &SourceOptions) -> Result<RigParts, String> {
        let body = self.body(options)?;
        let mut parts = RigParts {
            notes: vec![format!("tf tree of {} frames; body: {body}", self.frames.len())],
            ..RigParts::default()
        };
        let mut one = |names: &[&str], kind: &str| -> Result<Option<Pose>, String> {
            let is_named = |frame: &&String| names.iter().any(|name| frame.to_lowercase().contains(name));
            let found: BTreeSet<&String> = self.frames.keys().filter(is_named).collect();
            // If a sensor has frames of its parts, the frame nearest to the body.
            let nearest: Vec<&&String> =
                found.iter().filter(|frame| !found.contains(&self.frames[**frame].parent)).collect();
            match nearest[..] {
                [frame] => {
                    parts.notes.push(format!("{kind}: frame {frame}"));
                    self.body_from(frame, options).map(Some)
                }
                [] => Ok(None),
                _ => {
                    let names: Vec<&str> = nearest.iter().map(|name| name.as_str()).collect();
                    parts.notes.push(format!("{kind}: several frames ({}); none is used", names.join(", ")));
                    Ok(None)
                }
            }
        };
        let lidar = one(&LIDAR_NAMES, "LiDAR")?;
        let imu = one(&IMU_NAMES, "IMU")?;
        let antenna = one(&ANTENNA_NAMES, "antenna")?;
        parts.body_from_lidar = lidar;
        parts.body_from_imu = imu;
        parts.antenna_in_body = antenna.map(|pose| pose.translation.vector.into());
        Ok(parts)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::yaml::documents;

    fn tree(text: &str) -> FrameTree {
        let mut tree = FrameTree::default();
        tree.add(&documents(text).expect("YAML")).expect("a tree");
        tree
    }

    fn transform(parent: &str, child: &str, x: f64) -> String {
        format!(
            "- header: {{stamp: {{sec: 0, nanosec: 0}}, frame_id: {parent}}}\n  child_frame_id: {child}\n  transform:\n    translation: {{x: {x}, y: 0.0, z: 1.0}}\n    rotation: {{x: 0.0, y: 0.0, z: 0.70710678, w: 0.70710678}}\n"
        )
    }

    #[test]
    fn poses_follow_the_tree_up_and_down() {
        let text = format!(
            "transforms:\n{}---\ntransforms:\n{}{}---\n",
            transform("map", "base_link", 5.0),
            transform("base_link", "roof", 1.0),
            transform("roof", "velodyne", 2.0)
        );
        let tree = tree(&text);
        let parts = tree.parts(&SourceOptions::default()).expect("parts");
        let lidar = parts.body_from_lidar.expect("a LiDAR");
        // The roof is rotated to the left: its x axis is the y axis of the body.
        assert!((lidar.translation.vector - geometry::Vector3::new(1.0, 2.0, 2.0)).norm() < 1e-6, "{lidar}");
        assert!((lidar.rotation.angle() - std::f64::consts::PI).abs() < 1e-6);
        let from_roof = SourceOptions { body_frame: Some("roof".into()), ..SourceOptions::default() };
        let body = tree.body_from("base_link", &from_roof).expect("connected");
        assert!((body.translation.vector - geometry::Vector3::new(0.0, 1.0, -1.0)).norm() < 1e-6, "{body}");
    }

    #[test]
    fn circles_and_unknown_frames_are_refused() {
        let circle = tree(&format!("transforms:\n{}{}", transform("a", "b", 0.0), transform("b", "a", 0.0)));
        let options = SourceOptions { body_frame: Some("a".into()), ..SourceOptions::default() };
        assert!(circle.body_from("b", &options).expect_err("refused").contains("circle"));
        let unknown = SourceOptions { body_frame: Some("hull".into()), ..SourceOptions::default() };
        assert!(circle.body(&unknown).expect_err("refused").starts_with("no frame hull; frames: a, b"));
        let two = tree(&format!("transforms:\n{}{}", transform("a", "lidar_l", 0.0), transform("a", "lidar_r", 0.0)));
        let parts = two.parts(&SourceOptions::default()).expect("parts");
        assert_eq!(parts.body_from_lidar, None);
        assert!(parts.notes[1].contains("several frames (lidar_l, lidar_r)"), "{:?}", parts.notes);
    }
}
