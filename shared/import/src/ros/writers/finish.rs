//! The manifest and the report after all messages were read.

use super::{LidarFiles, LidarWriter, Writers};
use crate::error::{At, ImportError};
use crate::plan::{Link, TextFile};
use crate::ros::bag::Topic;
use crate::ros::camera::Camera;
use crate::ros::lidar::FinishedSweeps;
use crate::ros::packets::PacketsKind;
use crate::ros::rig::Mountings;
use crate::ros::roles::{Role, Roles};
use crate::ros::{gnss, imu};
use crate::{Kind, drive_name};
use drive::manifest::{CameraEntry, GnssEntry, ImuEntry, LidarEntry, Manifest};
use formats::cloud_fields::MapOrigin;
use geometry::{Pose, UnitQuaternion, Vector3};
use lidar::Model;
use messages::MAX_LIDARS;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// Exposure time that is written if none is known, ns: typical for a sunny street.
const EXPOSURE_NANOS: u64 = 1_000_000;
/// Smaller rotations do not count as a rectification, deg.
const MAX_TURN_DEG: f64 = 0.01;
/// Frame of the points that are decoded from the packets of an Ouster, whose messages do not name a frame.
const OUSTER_FRAME: &str = "os_sensor";
/// Name of the metadata of an Ouster in the LiDAR folder.
const METADATA: &str = "metadata.json";

/// Result of the import of a bag.
pub(in crate::ros) struct Parts {
    pub manifest: Manifest,
    pub links: Vec<Link>,
    pub texts: Vec<TextFile>,
    pub report: Vec<String>,
    /// Reasons why topics are not imported, by index.
    pub reasons: BTreeMap<usize, String>,
}

/// The LiDAR of the drive.
struct LidarPart {
    model: Model,
    format: &'static str,
    calibration: Option<String>,
    map_origin: Option<[i64; 3]>,
    texts: Vec<TextFile>,
    report: Vec<String>,
    /// Rotation of the points of the drive in the frame of the messages.
    frame_from_points: UnitQuaternion<f64>,
}

impl Writers<'_> {
    /// Completes the files.
    pub fn finish(self) -> Result<Parts, ImportError> {
        let Self {
            source,
            out,
            topics,
            roles,
            options,
            lidars,
            frame_of,
            frame_of_possible,
            cameras,
            imu,
            gnss,
            metadata,
            mut frames,
            ..
        } = self;
        let fixed = frames.take_fixed();
        let topic_of = |role: Role| roles.topics.get(&role).map_or("", |topic| topics[*topic].name.as_str());
        let frame = |role: Role| frame_of.get(&role).cloned().unwrap_or_else(|| OUSTER_FRAME.to_owned());
        let mut rig = Mountings::new(&frames, &frame(Role::Lidar), &options.ros)?;
        let mut entries = Vec::new();
        let mut texts = Vec::new();
        let mut report = Vec::new();
        for (role, files) in lidars {
            let name = files.name.clone();
            let folder = files.folder.clone();
            let lidar = match role {
                Role::Lidar => finish_lidar(source, topic_of(role), files, options.model, metadata.clone())?,
                _ => finish_lidar(source, topic_of(role), files, None, None)?,
            };
            let body_from_frame = rig.body_from(&frame(role)).map_err(|rule| ImportError::at(source, rule))?;
            let body_from_lidar = body_from_frame * lidar.frame_from_points;
            let entry = LidarEntry::new(lidar.model.name(), lidar.format, &folder, body_from_lidar.into());
            entries.push(LidarEntry { name, calibration: lidar.calibration, map_origin: lidar.map_origin, ..entry });
            texts.extend(lidar.texts);
            report.extend(lidar.report);
        }
        let mut entries = entries.into_iter();
        let first = entries.next().ok_or_else(|| ImportError::at(source, "no LiDAR"))?;
        let mut parts = Parts {
            manifest: Manifest::with_lidar(&drive_name(source, Kind::Ros), first),
            links: Vec::new(),
            texts,
            report,
            reasons: roles.reasons.clone(),
        };
        parts.manifest.other_lidars = entries.collect();
        parts.reasons.extend(further_lidars(topics, roles, &frame_of, &frame_of_possible, &rig));
        if frames.is_empty() {
            parts.report.push("the bag has no tf_static".into());
        }
        if !fixed.is_empty() {
            parts.report.push(format!("frames of tf that never move are taken: {}", fixed.join(", ")));
        }
        parts.report.append(&mut rig.report);
        // Leaves a sensor out, or fails if the user requested it.
        let leave_out = |parts: &mut Parts, role: Role, topic: usize, reason: String| {
            if roles.is_chosen(role) {
                return Err(ImportError::at_part(source, &topics[topic].name, reason));
            }
            parts.reasons.insert(topic, reason);
            Ok(())
        };
        for (index, camera) in cameras {
            let image_frame = frame_of.get(&Role::Camera(index)).map_or("", String::as_str);
            let mounted = camera.lens(image_frame).and_then(|(frame, lens)| Ok((rig.body_from(&frame)?, lens)));
            match mounted {
                Ok((body_from_camera, model)) => {
                    parts.report.extend(camera_report(&camera, &topics[camera.topic].name));
                    parts.manifest.cameras.push(CameraEntry {
                        delay_nanos: 0,
                        name: camera.name,
                        folder: camera.folder,
                        exposure_nanos: EXPOSURE_NANOS,
                        body_from_camera: body_from_camera.into(),
                        model,
                    });
                }
                Err(reason) => {
                    camera.images.discard().at(&out)?;
                    leave_out(&mut parts, Role::Camera(index), camera.topic, reason)?;
                }
            }
        }
        if !parts.manifest.cameras.is_empty() {
            parts.report.push(
                "exposure times are not in the bag: stamps are taken as the middle of exposures of 1 ms; set exposure_nanos \
                 in drive.toml"
                    .into(),
            );
        }
        if let (Some(mut log), Some(&topic)) = (imu, roles.topics.get(&Role::Imu)) {
            let path = out.join(imu::FILE);
            let was_in_g = log.finish().at(&path)?;
            let frame = frame_of.get(&Role::Imu).map_or("", String::as_str);
            let mounted = if log.n_samples > 0 { rig.body_from(frame) } else { Err("no valid samples".into()) };
            match mounted {
                Ok(body_from_imu) => {
                    parts.report.extend(imu_report(&log, &topics[topic].name, was_in_g));
                    let body_from_imu = Some(body_from_imu.into());
                    let file = imu::FILE.to_owned();
                    parts.manifest.imu =
                        Some(ImuEntry { delay_nanos: 0, file, position_in_body: [0.0; 3], body_from_imu });
                }
                Err(reason) => {
                    fs::remove_file(&path).at(&path)?;
                    leave_out(&mut parts, Role::Imu, topic, reason)?;
                }
            }
        }
        let receiver = [Role::Nmea, Role::Gnss].into_iter().find_map(|role| Some((role, *roles.topics.get(&role)?)));
        if let (Some(log), Some((role, topic))) = (gnss, receiver) {
            let path = out.join(gnss::FILE);
            let counts = GnssCounts { n_lines: log.n_lines, n_late: log.n_late, n_without: log.n_without };
            let origin = log.finish().at(&path)?.ok_or("no position with a height".to_owned());
            let frame = frame_of.get(&role).map_or("", String::as_str);
            match origin.and_then(|origin| Ok((origin, rig.body_from(frame)?))) {
                Ok((origin, body_from_antenna)) => {
                    parts.report.extend(gnss_report(&topics[topic].name, role, &counts));
                    let antenna_in_body = body_from_antenna.translation.vector.into();
                    parts.manifest.gnss = Some(GnssEntry {
                        delay_nanos: 0,
                        file: gnss::FILE.into(),
                        origin,
                        antenna_in_body,
                        geoid_m: None,
                    });
                }
                Err(reason) => {
                    fs::remove_file(&path).at(&path)?;
                    leave_out(&mut parts, role, topic, reason)?;
                }
            }
        }
        for (topic, n) in self.n_unstamped {
            let name = &topics[topic].name;
            parts
                .report
                .push(format!("{n} messages of {name} have no stamp: the times at which they were received are taken"));
        }
        Ok(parts)
    }
}

/// Topics of further LiDARs, with the option that imports them, if they have a fixed frame of their own. A second topic
/// of a frame has the same data.
fn further_lidars(
    topics: &[Topic],
    roles: &Roles,
    frame_of: &BTreeMap<Role, String>,
    frame_of_possible: &BTreeMap<usize, String>,
    rig: &Mountings<'_>,
) -> BTreeMap<usize, String> {
    let is_lidar = |role: &Role| matches!(role, Role::Lidar | Role::SecondaryLidar(_));
    let mut known: Vec<&String> = frame_of.iter().filter(|(role, _)| is_lidar(role)).map(|(_, frame)| frame).collect();
    let mut reasons = BTreeMap::new();
    for topic in roles.possible_lidars(topics) {
        let number = roles.n_lidars() + reasons.len();
        let Some(frame) = frame_of_possible.get(&topic).filter(|_| number < MAX_LIDARS) else { continue };
        if !known.contains(&frame) && rig.body_from(frame).is_ok() {
            known.push(frame);
            let name = &topics[topic].name;
            reasons
                .insert(topic, format!("a further LiDAR in frame {frame:?}; --topic lidar.{number}={name} takes it"));
        }
    }
    reasons
}

fn finish_lidar(
    source: &Path,
    topic: &str,
    LidarFiles { writer, fields, folder, .. }: LidarFiles,
    model: Option<Model>,
    metadata: Option<String>,
) -> Result<LidarPart, ImportError> {
    let same_axes = Pose::identity().rotation;
    match writer {
        LidarWriter::Clouds(sweeps) | LidarWriter::Livox(sweeps) => {
            let FinishedSweeps { model, origin, times, report } = sweeps.finish(source, topic, &folder, &fields)?;
            let map_origin = origin.map(|MapOrigin(origin)| origin);
            let texts = vec![times];
            let frame_from_points = same_axes;
            Ok(LidarPart { model, format: "pcd", calibration: None, map_origin, texts, report, frame_from_points })
        }
        LidarWriter::Packets(kind, capture) => {
            let report = vec![format!("imported: {} packets from {topic}", capture.n_packets)];
            // The packets of an Ouster do not name their model.
            let is_ouster = kind == PacketsKind::Ouster;
            let model = capture.finish(model.or(is_ouster.then_some(Model::Ouster)))?;
            let place = Path::new(&folder).join(METADATA);
            let metadata = metadata.filter(|_| model == Model::Ouster);
            let calibration = metadata.as_ref().map(|_| place.to_string_lossy().into_owned());
            let texts = metadata.map(|text| TextFile { place, text }).into_iter().collect();
            // Drivers of Hesai have y forward and x to the right.
            let quarter = UnitQuaternion::from_scaled_axis(Vector3::z() * std::f64::consts::FRAC_PI_2);
            let frame_from_points = if matches!(model, Model::Hesai(_)) { quarter } else { same_axes };
            Ok(LidarPart { model, format: "pcap", calibration, map_origin: None, texts, report, frame_from_points })
        }
    }
}

fn camera_report(camera: &Camera, topic: &str) -> Vec<String> {
    let mut lines = vec![format!("imported: {} images from {topic}", camera.images.n_written)];
    if camera.images.n_same_stamp > 0 {
        lines.push(format!("{} images of {topic} with the stamp of another are left out", camera.images.n_same_stamp));
    }
    if camera.images.is_reduced {
        lines.push(format!("images of {topic} have 16 bits; they become 8 bits: 65535 becomes 255"));
    }
    let turned_deg = camera.rectification_deg();
    if turned_deg > MAX_TURN_DEG {
        lines.push(format!(
            "the rectification of {topic} turns by {turned_deg:.2} deg; it is not applied: the images are assumed to be \
             in the camera frame"
        ));
    }
    if camera.has_changed {
        lines.push(format!("the CameraInfo of {topic} changes; the first is taken"));
    }
    lines
}

fn imu_report(log: &imu::ImuLog, topic: &str, was_in_g: bool) -> Vec<String> {
    let mut lines = vec![format!("imported: {} IMU samples from {topic}", log.n_samples)];
    if was_in_g {
        lines.push(format!("accelerations of {topic} are in g; they are multiplied by 9.80665"));
    }
    for (n, what) in [(log.n_late, "not in order"), (log.n_bad, "without valid values")] {
        if n > 0 {
            lines.push(format!("IMU samples of {topic} {what}, left out: {n}"));
        }
    }
    lines
}

/// Lines of a log of fixes.
struct GnssCounts {
    n_lines: u64,
    /// Not in order.
    n_late: u64,
    /// Without a position.
    n_without: u64,
}

fn gnss_report(topic: &str, role: Role, counts: &GnssCounts) -> Vec<String> {
    let GnssCounts { n_lines, n_late, n_without } = *counts;
    if role == Role::Nmea {
        return vec![format!("imported: {n_lines} NMEA sentences from {topic}")];
    }
    let mut lines = vec![format!("imported: {} fixes from {topic}, without speeds", n_lines / 2 - n_without)];
    for (n, what) in [(n_late, "not in order, left out"), (n_without, "without a position")] {
        if n > 0 {
            lines.push(format!("fixes of {topic} {what}: {n}"));
        }
    }
    lines
}
