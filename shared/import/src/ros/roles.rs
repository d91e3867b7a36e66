//! Assigns topics to the sensors of the drive.

use super::bag::Topic;
use super::packets::PacketsKind;
use crate::error::ImportError;
use std::collections::BTreeMap;
use std::path::Path;

/// Use of a topic.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Role {
    Lidar,
    /// A further LiDAR, from 1 on.
    SecondaryLidar(usize),
    /// `std_msgs/String` with the metadata of an Ouster.
    Metadata,
    /// Images of the camera of this index.
    Camera(usize),
    /// Lens of the camera of this index.
    CameraInfo(usize),
    Imu,
    Gnss,
    Nmea,
}

/// The name that leaves a role out.
const NONE: &str = "none";
/// Maximum number of cameras that an option may name.
const MAX_CAMERAS: usize = 256;

pub(super) const CLOUDS: [&str; 3] =
    ["sensor_msgs/PointCloud2", "livox_ros_driver/CustomMsg", "livox_ros_driver2/CustomMsg"];
const IMAGES: [&str; 2] = ["sensor_msgs/Image", "sensor_msgs/CompressedImage"];
const CAMERA_INFO: &str = "sensor_msgs/CameraInfo";

impl Role {
    /// The name in `--topic NAME=TOPIC`.
    pub fn name(self) -> String {
        match self {
            Self::Lidar => "lidar".into(),
            Self::SecondaryLidar(index) => format!("lidar.{index}"),
            Self::Metadata => "metadata".into(),
            Self::Camera(index) => format!("camera.{index}"),
            Self::CameraInfo(index) => format!("camera_info.{index}"),
            Self::Imu => "imu".into(),
            Self::Gnss => "gnss".into(),
            Self::Nmea => "nmea".into(),
        }
    }

    fn from_name(name: &str) -> Option<Self> {
        let index = |prefix: &str| name.strip_prefix(prefix)?.parse().ok().filter(|index| *index < MAX_CAMERAS);
        let plain = [Self::Lidar, Self::Metadata, Self::Imu, Self::Gnss, Self::Nmea];
        let plain = plain.into_iter().find(|role| role.name() == name);
        let other = index("lidar.").filter(|index| (1..messages::MAX_LIDARS).contains(index)).map(Self::SecondaryLidar);
        plain
            .or(other)
            .or_else(|| index("camera.").map(Self::Camera))
            .or_else(|| index("camera_info.").map(Self::CameraInfo))
    }

    /// Whether messages of this type fit the role.
    fn fits(self, kind: &str) -> bool {
        match self {
            Self::Lidar | Self::SecondaryLidar(_) => CLOUDS.contains(&kind) || PacketsKind::from_type(kind).is_some(),
            Self::Metadata => kind == "std_msgs/String",
            Self::Camera(_) => IMAGES.contains(&kind),
            Self::CameraInfo(_) => kind == CAMERA_INFO,
            Self::Imu => kind == "sensor_msgs/Imu",
            Self::Gnss => kind == "sensor_msgs/NavSatFix",
            Self::Nmea => kind == "nmea_msgs/Sentence",
        }
    }
}

/// The chosen topics.
#[derive(Debug, Default)]
pub(crate) struct Roles {
    /// Indexes of topics.
    pub topics: BTreeMap<Role, usize>,
    /// Reasons why other topics are not imported, by index.
    pub reasons: BTreeMap<usize, String>,
    /// Roles that the user chose; they must not be left out.
    chosen: Vec<Role>,
}

impl Roles {
    /// Assigns topics by type and by the user's `--topic ROLE=NAME`.
    pub fn choose(source: &Path, topics: &[Topic], wishes: &[(String, String)]) -> Result<Self, ImportError> {
        let mut roles = Self::default();
        let left_out = roles.take_wishes(topics, wishes)?;
        let is_free = |name: &str| !left_out.iter().any(|out| out == name);
        if !roles.has(Role::Lidar) {
            let candidates = roles.candidates(topics, Role::Lidar, |topic| !topic.name.ends_with("imu_packets"));
            let lidar = only(source, topics, Role::Lidar, &candidates)?;
            let rule = || {
                let kinds = "PointCloud2, VelodyneScan, PandarScan, NebulaPackets, Ouster PacketMsg or Livox CustomMsg";
                ImportError::at(source, format!("no topic with messages of a LiDAR ({kinds})"))
            };
            roles.topics.insert(Role::Lidar, lidar.ok_or_else(rule)?);
        }
        for role in [Role::Imu, Role::Nmea, Role::Gnss] {
            if is_free(&role.name()) && !roles.has(role) {
                let candidates = roles.candidates(topics, role, |_| true);
                if let Some(topic) = only(source, topics, role, &candidates)? {
                    roles.topics.insert(role, topic);
                }
            }
        }
        roles.one_receiver();
        roles.find_metadata(topics);
        if is_free("camera") && !roles.topics.keys().any(|role| matches!(role, Role::Camera(_))) {
            roles.find_cameras(source, topics)?;
        }
        roles.find_camera_info(topics);
        Ok(roles)
    }

    pub fn has(&self, role: Role) -> bool {
        self.topics.contains_key(&role)
    }

    /// Topics that may be of further LiDARs, packets before clouds.
    pub fn possible_lidars(&self, topics: &[Topic]) -> Vec<usize> {
        let is_ouster = |topic: &Topic| PacketsKind::from_type(&topic.kind) == Some(PacketsKind::Ouster);
        let mut found = self.candidates(topics, Role::SecondaryLidar(1), |topic| !is_ouster(topic));
        found.sort_by_key(|topic| PacketsKind::from_type(&topics[*topic].kind).is_none());
        found
    }

    /// Number of imported LiDARs.
    pub fn n_lidars(&self) -> usize {
        self.topics.keys().filter(|role| matches!(role, Role::Lidar | Role::SecondaryLidar(_))).count()
    }

    pub fn is_chosen(&self, role: Role) -> bool {
        self.chosen.contains(&role)
    }

    /// Applies the choices of the user. Returns the names of roles that are left out.
    fn take_wishes(&mut self, topics: &[Topic], wishes: &[(String, String)]) -> Result<Vec<String>, ImportError> {
        let fault = |rule: String| Err(ImportError::for_option("--topic", rule));
        let mut left_out = Vec::new();
        for (name, wish) in wishes {
            if wish == NONE && matches!(name.as_str(), "camera" | "imu" | "gnss" | "nmea") {
                left_out.push(name.clone());
                continue;
            }
            let Some(role) = Role::from_name(name) else {
                return fault(format!(
                    "role {name:?} must be lidar, camera.0 and so on, camera_info.0, imu, gnss, nmea, metadata or lidar.1 and so on"
                ));
            };
            let named: Vec<usize> = (0..topics.len()).filter(|index| topics[*index].name == *wish).collect();
            let Some(&topic) = named.iter().find(|index| role.fits(&topics[**index].kind)) else {
                return fault(match named.first() {
                    Some(index) => {
                        format!("{name}={wish}: messages of type {} cannot have this role", topics[*index].kind)
                    }
                    None => format!("{name}={wish}: the bag has no such topic; it has {}", names(topics, &all(topics))),
                });
            };
            if topics[topic].encoding.is_none() {
                return fault(format!("{name}={wish}: its serialization must be ROS 1 or CDR"));
            }
            if self.topics.insert(role, topic).is_some() {
                return fault(format!("{name} is there twice"));
            }
            self.chosen.push(role);
        }
        let cameras =
            self.topics.keys().filter_map(|role| if let Role::Camera(index) = role { Some(*index) } else { None });
        if let Some((expected, found)) = cameras.enumerate().find(|(expected, found)| expected != found) {
            return fault(format!(
                "camera.{found}: cameras are numbered from 0 without gaps; camera.{expected} is missing"
            ));
        }
        let others = self
            .topics
            .keys()
            .filter_map(|role| if let Role::SecondaryLidar(index) = role { Some(*index) } else { None });
        if let Some((expected, found)) = (1..).zip(others).find(|(expected, found)| expected != found) {
            return fault(format!(
                "lidar.{found}: further LiDARs are numbered from 1 without gaps; lidar.{expected} is missing"
            ));
        }
        Ok(left_out)
    }

    /// Topics that could have a role and have messages.
    fn candidates(&self, topics: &[Topic], role: Role, also: impl Fn(&Topic) -> bool) -> Vec<usize> {
        let is_candidate = |index: &usize| {
            let topic = &topics[*index];
            role.fits(&topic.kind) && topic.count > 0 && topic.encoding.is_some() && also(topic)
        };
        (0..topics.len())
            .filter(is_candidate)
            .filter(|index| !self.topics.values().any(|taken| taken == index))
            .collect()
    }

    /// Keeps one receiver. Sentences of a receiver contain more than its fixes, and a drive has one log.
    fn one_receiver(&mut self) {
        if let (true, Some(fixes)) = (self.has(Role::Nmea), self.topics.get(&Role::Gnss).copied()) {
            let out = if self.is_chosen(Role::Gnss) && !self.is_chosen(Role::Nmea) { Role::Nmea } else { Role::Gnss };
            let topic = self.topics.remove(&out).unwrap_or(fixes);
            let (kept, option) = if out == Role::Gnss { ("sentences", "nmea=none") } else { ("fixes", "gnss=none") };
            self.reasons.insert(topic, format!("the {kept} of the receiver are taken; --topic {option} takes these"));
        }
    }

    /// Finds the metadata of an Ouster next to its packets.
    fn find_metadata(&mut self, topics: &[Topic]) {
        let Some(&lidar) = self.topics.get(&Role::Lidar) else { return };
        let is_ouster = PacketsKind::from_type(&topics[lidar].kind) == Some(PacketsKind::Ouster);
        let name = format!("{}/metadata", parent(&topics[lidar].name));
        if is_ouster
            && !self.has(Role::Metadata)
            && let Some(&topic) = self.candidates(topics, Role::Metadata, |topic| topic.name == name).first()
        {
            self.topics.insert(Role::Metadata, topic);
        }
    }

    /// Finds the images that have a `CameraInfo`.
    fn find_cameras(&mut self, source: &Path, topics: &[Topic]) -> Result<(), ImportError> {
        let mut by_info: BTreeMap<String, Vec<usize>> = BTreeMap::new();
        for image in self.candidates(topics, Role::Camera(0), |_| true) {
            if let Some(info) = info_of(topics, image) {
                by_info.entry(topics[info].name.clone()).or_default().push(image);
                continue;
            }
            let name = &topics[image].name;
            let reason =
                format!("no CameraInfo in its namespace; --topic camera.0={name} --topic camera_info.0=/... names one");
            self.reasons.insert(image, reason);
        }
        for (index, images) in by_info.into_values().enumerate() {
            if let Some(image) = only(source, topics, Role::Camera(index), &images)? {
                self.topics.insert(Role::Camera(index), image);
            }
        }
        Ok(())
    }

    fn find_camera_info(&mut self, topics: &[Topic]) {
        let cameras: Vec<(Role, usize)> = self.topics.iter().map(|(role, topic)| (*role, *topic)).collect();
        for (role, image) in cameras {
            if let (Role::Camera(index), Some(info)) = (role, info_of(topics, image)) {
                self.topics.entry(Role::CameraInfo(index)).or_insert(info);
            }
        }
    }
}

/// The only candidate, if there is one.
fn only(source: &Path, topics: &[Topic], role: Role, candidates: &[usize]) -> Result<Option<usize>, ImportError> {
    match candidates {
        [] => Ok(None),
        [topic] => Ok(Some(*topic)),
        [first, ..] => {
            let role = role.name();
            let first = &topics[*first].name;
            let names = names(topics, candidates);
            let or_none = match role.as_str() {
                "imu" | "gnss" | "nmea" => format!(" or --topic {role}={NONE}"),
                _ => String::new(),
            };
            let others = if role == "lidar" { "; further LiDARs are lidar.1 and so on" } else { "" };
            let rule = format!(
                "several topics can be the {role}: {names}{others}; choose one with --topic {role}={first}{or_none}"
            );
            Err(ImportError::at(source, rule))
        }
    }
}

fn parent(name: &str) -> &str {
    name.rsplit_once('/').map_or("", |(parent, _)| parent)
}

/// The `CameraInfo` in the namespace of an image, as `image_transport` places it.
fn info_of(topics: &[Topic], image: usize) -> Option<usize> {
    let name = &topics[image].name;
    let name = name.strip_suffix("/compressed").unwrap_or(name);
    let wanted = format!("{}/camera_info", parent(name));
    topics.iter().position(|topic| {
        topic.name == wanted && topic.kind == CAMERA_INFO && topic.count > 0 && topic.encoding.is_some()
    })
}

fn all(topics: &[Topic]) -> Vec<usize> {
    (0..topics.len()).collect()
}

fn names(topics: &[Topic], indexes: &[usize]) -> String {
    let name = |index: &usize| format!("{} ({})", topics[*index].name, topics[*index].kind);
    let mut names: Vec<String> = indexes.iter().map(name).collect();
    names.sort();
    names.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ros::bag::Encoding;

    fn topics(names: &[(&str, &str)]) -> Vec<Topic> {
        let topic = |(name, kind): &(&str, &str)| Topic {
            name: (*name).to_owned(),
            kind: (*kind).to_owned(),
            encoding: Some(Encoding::Cdr),
            count: 1,
        };
        names.iter().map(topic).collect()
    }

    fn choose(topics: &[Topic], wishes: &[(&str, &str)]) -> Result<Vec<(String, String)>, String> {
        let wishes: Vec<(String, String)> =
            wishes.iter().map(|(role, name)| ((*role).to_owned(), (*name).to_owned())).collect();
        let roles = Roles::choose(Path::new("a.bag"), topics, &wishes).map_err(|error| error.to_string())?;
        Ok(roles.topics.iter().map(|(role, topic)| (role.name(), topics[*topic].name.clone())).collect())
    }

    fn pairs(pairs: &[(&str, &str)]) -> Vec<(String, String)> {
        pairs.iter().map(|(role, name)| ((*role).to_owned(), (*name).to_owned())).collect()
    }

    const CLOUD: &str = "sensor_msgs/PointCloud2";

    #[test]
    fn several_candidates_are_listed_with_the_option_that_chooses() {
        let two = topics(&[("/points", CLOUD), ("/filtered", CLOUD), ("/imu", "sensor_msgs/Imu")]);
        let error = choose(&two, &[]).expect_err("is ambiguous");
        assert!(
            error.contains("several topics can be the lidar: /filtered (sensor_msgs/PointCloud2), /points"),
            "{error}"
        );
        assert!(error.ends_with("choose one with --topic lidar=/points"), "{error}");
        let chosen = choose(&two, &[("lidar", "/points")]).expect("is chosen");
        assert_eq!(chosen, pairs(&[("lidar", "/points"), ("imu", "/imu")]));
        assert_eq!(choose(&two, &[("lidar", "/filtered"), ("imu", "none")]), Ok(pairs(&[("lidar", "/filtered")])));
        let error = choose(&topics(&[("/imu", "sensor_msgs/Imu")]), &[]).expect_err("has no LiDAR");
        assert!(error.starts_with("a.bag: no topic with messages of a LiDAR"), "{error}");
    }

    #[test]
    fn cameras_are_the_images_beside_a_camera_info() {
        let image = "sensor_msgs/Image";
        let packed = "sensor_msgs/CompressedImage";
        let info = "sensor_msgs/CameraInfo";
        let mut found = topics(&[
            ("/points", CLOUD),
            ("/right/image_raw", image),
            ("/right/camera_info", info),
            ("/left/image_raw/compressed", packed),
            ("/left/camera_info", info),
            ("/range_image", image),
        ]);
        let chosen = choose(&found, &[]).expect("is unique");
        let expected = [
            ("lidar", "/points"),
            ("camera.0", "/left/image_raw/compressed"),
            ("camera.1", "/right/image_raw"),
            ("camera_info.0", "/left/camera_info"),
            ("camera_info.1", "/right/camera_info"),
        ];
        assert_eq!(chosen, pairs(&expected));
        found.extend(topics(&[("/left/image_raw", image)]));
        let error = choose(&found, &[]).expect_err("is ambiguous");
        assert!(
            error.contains(
                "several topics can be the camera.0: /left/image_raw (sensor_msgs/Image), /left/image_raw/compressed"
            ),
            "{error}"
        );
        let chosen = choose(&found, &[("camera.0", "/range_image"), ("camera_info.0", "/left/camera_info")]);
        let expected = [("lidar", "/points"), ("camera.0", "/range_image"), ("camera_info.0", "/left/camera_info")];
        assert_eq!(chosen, Ok(pairs(&expected)));
        assert_eq!(choose(&found, &[("camera", "none")]), Ok(pairs(&[("lidar", "/points")])));
    }

    #[test]
    fn sentences_go_before_fixes_unless_the_user_chooses() {
        let both = topics(&[("/points", CLOUD), ("/fix", "sensor_msgs/NavSatFix"), ("/nmea", "nmea_msgs/Sentence")]);
        let of = |receiver| Ok(pairs(&[("lidar", "/points"), receiver]));
        assert_eq!(choose(&both, &[]), of(("nmea", "/nmea")));
        assert_eq!(choose(&both, &[("nmea", "none")]), of(("gnss", "/fix")));
        assert_eq!(choose(&both, &[("gnss", "/fix")]), of(("gnss", "/fix")));
    }

    #[test]
    fn packets_of_an_ouster_come_with_their_metadata() {
        let packets = "ouster_sensor_msgs/PacketMsg";
        let found = topics(&[
            ("/ouster/imu_packets", packets),
            ("/ouster/lidar_packets", packets),
            ("/ouster/metadata", "std_msgs/String"),
            ("/chatter", "std_msgs/String"),
        ]);
        let expected = [("lidar", "/ouster/lidar_packets"), ("metadata", "/ouster/metadata")];
        assert_eq!(choose(&found, &[]), Ok(pairs(&expected)));
    }
}
