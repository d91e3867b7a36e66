//! ROS 1 and ROS 2 bags: clouds or packets of a LiDAR, images, IMU and GNSS, and the rig of `tf_static` and `CameraInfo`.

mod bag;
mod camera;
mod cloud;
mod cursor;
mod frames;
mod gnss;
mod images;
mod imu;
mod lens;
mod lidar;
mod live;
mod messages;
mod packets;
mod rig;
mod roles;
mod writers;

pub(crate) use bag::is_bag;
pub use live::{LiveData, LiveSensor, LiveTopic};

use crate::error::{At, ImportError};
use crate::plan::{Link, Plan};
use crate::sweeps::LIDAR_FOLDER;
use crate::{Kind, Options};
use bag::{Bag, Topic};
use roles::Roles;
use std::path::{Path, PathBuf};
use writers::Writers;

/// Options of the import of a bag.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RosOptions {
    /// Roles and names of topics: `lidar`, `camera.0`, `camera_info.0`, `imu`, `gnss`, `nmea`, `metadata`. The name `none` leaves out
    /// `camera` (all), `imu`, `gnss` or `nmea`. Other roles are assigned by type.
    pub topics: Vec<(String, String)>,
    /// Frame of the body. `None`: `base_link`, or the root frame.
    pub body_frame: Option<String>,
    /// Poses of frames in the body frame that replace transforms of `tf_static`: x y z, m, and a unit quaternion x y z w.
    pub transforms: Vec<(String, [f64; 7])>,
    /// Calibration file of the LiDAR.
    pub calibration: Option<PathBuf>,
    /// Further files of a recording that was split.
    pub parts: Vec<PathBuf>,
}

/// Folder of decompressed files, in the folder of the drive while the bag is read.
const SCRATCH: &str = ".bag";

/// The drive of a bag. Its files are written to the folder `out`.
pub(crate) fn plan(source: &Path, out: &Path, options: &Options) -> Result<Plan, ImportError> {
    let scratch = out.join(SCRATCH);
    let mut bag = Bag::open(source, &options.ros.parts, &scratch)?;
    let topics: Vec<Topic> = bag.topics().to_vec();
    let roles = Roles::choose(source, &topics, &options.ros.topics)?;
    let mut writers = Writers::create(source, out, &topics, &roles, options)?;
    let used = writers.used();
    bag.read(writers.wanted(), |path, message| writers.add(path, message))?;
    let mut parts = writers.finish()?;
    if scratch.exists() {
        std::fs::remove_dir_all(&scratch).at(&scratch)?;
    }
    if let Some(path) = &options.ros.calibration {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let place = Path::new(LIDAR_FOLDER).join(name);
        parts.manifest.lidar.calibration = Some(place.to_string_lossy().into_owned());
        parts.links.push(Link { place, original: path.canonicalize().at(path)? });
    }
    let mut report = parts.report;
    report.extend(not_taken(&topics, &used, &parts.reasons));
    let mut read = bag.files().to_vec();
    let metadata = source.join(bag::METADATA);
    read.extend(metadata.is_file().then_some(metadata));
    Ok(Plan {
        kind: Kind::Ros,
        manifest: parts.manifest,
        links: parts.links,
        texts: parts.texts,
        conversions: Vec::new(),
        read,
        report,
    })
}

/// One line per topic that is not imported.
fn not_taken<'a>(
    topics: &'a [Topic],
    used: &'a [bool],
    reasons: &'a std::collections::BTreeMap<usize, String>,
) -> impl Iterator<Item = String> {
    topics.iter().enumerate().filter(|(index, _)| !used[*index] || reasons.contains_key(index)).map(|(index, topic)| {
        let Topic { name, kind, count, .. } = topic;
        let messages = if *count == 1 { "message" } else { "messages" };
        let reason = reasons.get(&index).map_or(String::new(), |reason| format!(": {reason}"));
        format!("not imported: {count} {messages} of {name} ({kind}){reason}")
    })
}
