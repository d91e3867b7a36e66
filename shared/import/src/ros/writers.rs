//! The files of the drive during the reading of the bag.

mod finish;

use super::bag::{Message, Topic};
use super::camera::Camera;
use super::cloud::{Fields, livox_points};
use super::cursor::Cursor;
use super::frames::Frames;
use super::gnss::Gnss;
use super::images::Images;
use super::imu::ImuLog;
use super::lidar::{Capture, FieldNames, Sweeps};
use super::messages::{CameraInfo, CompressedImage, Header, Image, Imu, NavSatFix, sentence, string, transforms};
use super::packets::{Packets, PacketsKind};
use super::roles::{Role, Roles};
use crate::Options;
use crate::error::{At, ImportError};
use crate::sweeps::LIDAR_FOLDER;
use formats::cloud_fields::ValueType;
use lidar::ouster;
use lidar::velodyne::DATA_PORT;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// Destination of a topic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Use {
    Role(Role),
    /// Transforms of `tf_static`.
    Transforms,
    /// Transforms of `tf`.
    Motions,
    /// A topic that may belong to a further LiDAR: its frame is known from its first message.
    PossibleLidar,
}

/// The LiDAR's data.
enum LidarWriter {
    Clouds(Sweeps),
    Livox(Sweeps),
    Packets(PacketsKind, Capture),
}

/// A LiDAR's files.
struct LidarFiles {
    /// Name, if there are several LiDARs.
    name: Option<String>,
    /// Folder in the drive.
    folder: String,
    writer: LidarWriter,
    fields: FieldNames,
}

/// All files that are being written.
pub(super) struct Writers<'a> {
    source: &'a Path,
    out: PathBuf,
    topics: &'a [Topic],
    roles: &'a Roles,
    options: &'a Options,
    uses: Vec<Vec<Use>>,
    /// Files of the LiDARs, by role.
    lidars: BTreeMap<Role, LidarFiles>,
    /// Frames of the sensors, the same in all messages of a topic.
    frame_of: BTreeMap<Role, String>,
    /// Frames of topics that may belong to further LiDARs, from the topic's first message.
    frame_of_possible: BTreeMap<usize, String>,
    cameras: BTreeMap<usize, Camera>,
    imu: Option<ImuLog>,
    gnss: Option<Gnss>,
    metadata: Option<String>,
    frames: Frames,
    /// Messages so far, by topic.
    n_read: Vec<u64>,
    /// Messages without stamp, by topic.
    n_unstamped: BTreeMap<usize, u64>,
}

impl<'a> Writers<'a> {
    pub fn create(
        source: &'a Path,
        out: &Path,
        topics: &'a [Topic],
        roles: &'a Roles,
        options: &'a Options,
    ) -> Result<Self, ImportError> {
        let mut uses = vec![Vec::new(); topics.len()];
        for (role, topic) in &roles.topics {
            uses[*topic].push(Use::Role(*role));
        }
        for (topic, of_topic) in topics.iter().zip(&mut uses) {
            let is_transform = matches!(topic.kind.as_str(), "tf2_msgs/TFMessage" | "tf/tfMessage");
            let name = topic.name.rsplit('/').next();
            match name.filter(|_| is_transform && topic.encoding.is_some()) {
                Some(name) if name.ends_with("tf_static") => of_topic.push(Use::Transforms),
                Some("tf") => of_topic.push(Use::Motions),
                _ => {}
            }
        }
        for topic in roles.possible_lidars(topics) {
            uses[topic].push(Use::PossibleLidar);
        }
        let folder = |name: &str| {
            let path = out.join(name);
            fs::create_dir_all(&path).at(&path).map(|()| path)
        };
        let mut lidars: BTreeMap<Role, LidarFiles> = BTreeMap::new();
        let of_lidars = roles.topics.iter().filter(|(role, _)| matches!(role, Role::Lidar | Role::SecondaryLidar(_)));
        let has_others = roles.has(Role::SecondaryLidar(1));
        for (role, topic) in of_lidars {
            let mut name = word(&topics[*topic].name);
            if lidars.values().any(|other| other.name.as_ref() == Some(&name)) {
                name = format!("{name}_{}", lidars.len());
            }
            let place = if *role == Role::Lidar { LIDAR_FOLDER.to_owned() } else { format!("{LIDAR_FOLDER}_{name}") };
            // The option names the model of the first LiDAR.
            let model = options.model.filter(|_| *role == Role::Lidar);
            let kind = topics[*topic].kind.as_str();
            let path = folder(&place)?;
            let writer = match PacketsKind::from_type(kind) {
                Some(PacketsKind::Ouster) if *role != Role::Lidar => {
                    let rule =
                        "packets of an Ouster need their metadata, which only the role lidar has; take its clouds";
                    return Err(ImportError::at_part(source, &topics[*topic].name, rule));
                }
                Some(kind) => {
                    let port = if kind == PacketsKind::Ouster { ouster::DATA_PORT } else { DATA_PORT };
                    LidarWriter::Packets(kind, Capture::create(&path, port)?)
                }
                None if kind == "sensor_msgs/PointCloud2" => LidarWriter::Clouds(Sweeps::new(path, model)),
                None => LidarWriter::Livox(Sweeps::new(path, model)),
            };
            let name = Some(name).filter(|_| has_others);
            let fields = FieldNames::default();
            lidars.insert(*role, LidarFiles { name, folder: place, writer, fields });
        }
        let mut cameras = BTreeMap::new();
        for (role, topic) in &roles.topics {
            if let Role::Camera(index) = role {
                let name = format!("camera/{index}");
                let images = Images::new(folder(&name)?);
                cameras.insert(*index, Camera::new(*topic, &topics[*topic].name, name, images));
            }
        }
        let has_log = roles.has(Role::Gnss) || roles.has(Role::Nmea);
        Ok(Self {
            source,
            out: out.to_owned(),
            topics,
            roles,
            options,
            uses,
            lidars,
            frame_of: BTreeMap::new(),
            frame_of_possible: BTreeMap::new(),
            cameras,
            imu: roles.has(Role::Imu).then(|| ImuLog::create(out)).transpose().at(out)?,
            gnss: has_log.then(|| Gnss::create(out)).transpose().at(out)?,
            metadata: None,
            frames: Frames::default(),
            n_read: vec![0; topics.len()],
            n_unstamped: BTreeMap::new(),
        })
    }

    /// Topics of which messages are read.
    pub fn wanted(&self) -> Vec<bool> {
        self.uses.iter().map(|uses| !uses.is_empty()).collect()
    }

    /// Topics of which all messages are used.
    pub fn used(&self) -> Vec<bool> {
        self.uses.iter().map(|uses| uses.iter().any(|of_topic| *of_topic != Use::PossibleLidar)).collect()
    }

    /// Writes a message of a file of the bag. Returns whether more of its topic are wanted.
    pub fn add(&mut self, path: &Path, message: Message<'_>) -> Result<bool, ImportError> {
        self.n_read[message.topic] += 1;
        for index in 0..self.uses[message.topic].len() {
            let of_topic = self.uses[message.topic][index];
            let added = self.add_use(of_topic, message);
            if of_topic == Use::PossibleLidar {
                // The topic is not imported, so an unreadable message is not an error.
                continue;
            }
            added.map_err(|rule| {
                let topic = &self.topics[message.topic];
                let number = self.n_read[message.topic];
                let part =
                    format!("message {number} of {} ({}), received at {}", topic.name, topic.kind, message.received);
                ImportError::at_part(path, &part, rule)
            })?;
        }
        Ok(self.uses[message.topic] != [Use::PossibleLidar])
    }

    fn add_use(&mut self, of_topic: Use, message: Message<'_>) -> Result<(), String> {
        let topic = &self.topics[message.topic];
        let encoding = topic.encoding.ok_or("unknown serialization")?;
        let mut c = Cursor::new(encoding, message.data).map_err(|fault| fault.to_string())?;
        let fault = |fault: super::cursor::MessageFault| fault.to_string();
        match of_topic {
            Use::Transforms => {
                for transform in transforms(&mut c).map_err(fault)? {
                    self.frames.add(transform)?;
                }
            }
            Use::Motions => {
                for transform in transforms(&mut c).map_err(fault)? {
                    self.frames.observe(transform)?;
                }
            }
            Use::PossibleLidar => {
                let header = Header::read(&mut c).map_err(fault)?;
                self.frame_of_possible.entry(message.topic).or_insert(header.frame);
            }
            Use::Role(role @ (Role::Lidar | Role::SecondaryLidar(_))) => return self.add_lidar(role, &mut c, message),
            Use::Role(Role::Metadata) => self.metadata = Some(string(&mut c).map_err(fault)?),
            Use::Role(role @ Role::Camera(index)) => {
                let Some(camera) = self.cameras.get_mut(&index) else { return Ok(()) };
                if topic.kind == "sensor_msgs/Image" {
                    let image = Image::read(&mut c).map_err(fault)?;
                    let stamp = stamp(&mut self.n_unstamped, &image.header, message);
                    camera.images.add(stamp, &image).map_err(without_cameras)?;
                    self.keep_frame(role, &image.header.frame)?;
                } else {
                    let image = CompressedImage::read(&mut c).map_err(fault)?;
                    let stamp = stamp(&mut self.n_unstamped, &image.header, message);
                    camera.images.add_compressed(stamp, &image).map_err(without_cameras)?;
                    self.keep_frame(role, &image.header.frame)?;
                }
            }
            Use::Role(Role::CameraInfo(index)) => {
                if let Some(camera) = self.cameras.get_mut(&index) {
                    camera.add_info(CameraInfo::read(&mut c).map_err(fault)?);
                }
            }
            Use::Role(Role::Imu) => {
                let imu = Imu::read(&mut c).map_err(fault)?;
                let stamp = stamp(&mut self.n_unstamped, &imu.header, message);
                if let Some(log) = &mut self.imu {
                    log.add(stamp, &imu).map_err(|error| error.to_string())?;
                }
                self.keep_frame(Role::Imu, &imu.header.frame)?;
            }
            Use::Role(Role::Gnss) => {
                let fix = NavSatFix::read(&mut c).map_err(fault)?;
                let stamp = stamp(&mut self.n_unstamped, &fix.header, message);
                if let Some(log) = &mut self.gnss {
                    log.add_fix(stamp, &fix)?;
                }
                self.keep_frame(Role::Gnss, &fix.header.frame)?;
            }
            Use::Role(Role::Nmea) => {
                let header = Header::read(&mut c.clone()).map_err(fault)?;
                if let Some(log) = &mut self.gnss {
                    log.add_sentence(&sentence(&mut c).map_err(fault)?)?;
                }
                self.keep_frame(Role::Nmea, &header.frame)?;
            }
        }
        Ok(())
    }

    fn add_lidar(&mut self, role: Role, c: &mut Cursor<'_>, message: Message<'_>) -> Result<(), String> {
        let Some(lidar) = self.lidars.get_mut(&role) else { return Ok(()) };
        let fault = |fault: super::cursor::MessageFault| fault.to_string();
        let frame = match &mut lidar.writer {
            LidarWriter::Clouds(sweeps) => {
                let cloud = Fields::read(c).map_err(fault)?;
                let stamp = stamp(&mut self.n_unstamped, &cloud.header, message);
                let position_type = cloud.position_type();
                sweeps.add(stamp, cloud.height, position_type, cloud.points())?;
                lidar.fields = FieldNames { time: cloud.time_name, ring: cloud.ring_name, n_rows: cloud.height };
                Some(cloud.header.frame)
            }
            LidarWriter::Livox(sweeps) => {
                let (header, points) = livox_points(c).map_err(fault)?;
                let stamp = stamp(&mut self.n_unstamped, &header, message);
                lidar.fields = FieldNames { time: Some("offset_time".to_owned()), ring: None, n_rows: 1 };
                sweeps.add(stamp, 1, ValueType::F32, points.into_iter())?;
                Some(header.frame)
            }
            LidarWriter::Packets(kind, capture) => {
                let Packets { frame, packets } = kind.read(c, message.received).map_err(fault)?;
                for (stamp, packet) in packets {
                    capture.add(stamp, packet)?;
                }
                frame
            }
        };
        frame.map_or(Ok(()), |frame| self.keep_frame(role, &frame))
    }

    /// Remembers the frame of a sensor. All its messages must be in the frame of the first one, whose mounting they get.
    fn keep_frame(&mut self, role: Role, frame: &str) -> Result<(), String> {
        let first = self.frame_of.entry(role).or_insert_with(|| frame.to_owned());
        if first == frame {
            return Ok(());
        }
        let wish = match role {
            Role::Lidar | Role::SecondaryLidar(_) => format!("{}=NAME", role.name()),
            Role::Camera(_) => "camera=none".to_owned(),
            _ => format!("{}=none", role.name()),
        };
        Err(format!(
            "header.frame_id is {frame:?}, the messages before it are in {first:?}; a topic must have one sensor. Write a bag with \
             a topic for each frame, or change the choice: --topic {wish}"
        ))
    }
}

/// Converts the name of a topic to a name of letters, digits and `_`.
fn word(topic: &str) -> String {
    topic.trim_matches('/').chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect()
}

/// Adds a hint how to import the rest.
fn without_cameras(rule: String) -> String {
    rule + "; --topic camera.0=NAME chooses other images, --topic camera=none leaves the cameras out"
}

/// The stamp of a message, or the time of its reception.
fn stamp(n_unstamped: &mut BTreeMap<usize, u64>, header: &Header, message: Message<'_>) -> i64 {
    if header.stamp == 0 {
        *n_unstamped.entry(message.topic).or_default() += 1;
        return message.received;
    }
    header.stamp
}
