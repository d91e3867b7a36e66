//! The LiDARs of a manifest: one table `[lidar]`, or several tables `[[lidar]]`.

use super::{CameraEntry, GnssEntry, ImuEntry, Manifest, MosaicEntry, PoseEntry, TrajectoryEntry, TruthEntry};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::net::Ipv4Addr;

/// A LiDAR's recording.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LidarEntry {
    /// Name of the LiDAR, used only for display. Several LiDARs must have different names.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Name of a [`lidar::Model`].
    pub model: String,
    /// `pcap`: packet captures. `pcd`, `bin` (KITTI) or `nuscenes`: one file per sweep, 10 sweeps per second unless the folder has a
    /// `times.txt`.
    pub format: String,
    /// Folder of the files: captures, which are read in the order of their times, or clouds, in the natural order of their names.
    pub folder: String,
    /// Captures with several LiDARs: address from which this LiDAR sends.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sender: Option<Ipv4Addr>,
    /// Captures with several LiDARs: UDP port to which this LiDAR sends its data packets.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub port: Option<u16>,
    /// Calibration file of the unit ([`lidar::Lidar::with_calibration`]). Without it the nominal beams of the model are
    /// used.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calibration: Option<String>,
    /// Clouds: factor by which intensities are multiplied, so that they are 0 to 255. Without it, it is determined from the files.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub intensity_scale: Option<f64>,
    /// Clouds with map coordinates: x y z in whole meters, subtracted from them. Without it, it is determined from the files.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub map_origin: Option<[i64; 3]>,
    /// Mounting.
    pub body_from_lidar: PoseEntry,
}

impl LidarEntry {
    /// Entry of the sweeps or captures of a model in a folder.
    pub fn new(model: &str, format: &str, folder: &str, body_from_lidar: PoseEntry) -> Self {
        Self {
            name: None,
            model: model.to_owned(),
            format: format.to_owned(),
            folder: folder.to_owned(),
            sender: None,
            port: None,
            calibration: None,
            intensity_scale: None,
            map_origin: None,
            body_from_lidar,
        }
    }
    /// Entry of the packet captures of a model in the folder `lidar`.
    pub fn from_captures(model: &str, body_from_lidar: PoseEntry) -> Self {
        Self::new(model, "pcap", "lidar", body_from_lidar)
    }
}

impl Manifest {
    /// All LiDARs, the first one first.
    pub fn lidars(&self) -> impl Iterator<Item = &LidarEntry> {
        std::iter::once(&self.lidar).chain(&self.other_lidars)
    }
    /// Name of a LiDAR for display: the name in its entry, otherwise `lidar` and its index.
    pub fn lidar_name(&self, index: usize) -> Cow<'_, str> {
        let name = self.lidars().nth(index).and_then(|entry| entry.name.as_deref());
        name.map_or_else(|| format!("lidar {index}").into(), Cow::Borrowed)
    }
}

/// [`Manifest`] with the keys of the file.
#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ManifestFile {
    version: u32,
    name: String,
    lidar: OneOrMore,
    #[serde(default)]
    camera: Vec<CameraEntry>,
    #[serde(default)]
    mosaic: Vec<MosaicEntry>,
    gnss: Option<GnssEntry>,
    imu: Option<ImuEntry>,
    trajectory: Option<TrajectoryEntry>,
    truth: Option<TruthEntry>,
}

/// Value of the key `lidar`.
#[derive(Clone, Serialize, Deserialize)]
#[serde(untagged)]
enum OneOrMore {
    One(Box<LidarEntry>),
    More(Vec<LidarEntry>),
}

impl TryFrom<ManifestFile> for Manifest {
    type Error = &'static str;

    fn try_from(file: ManifestFile) -> Result<Self, Self::Error> {
        let ManifestFile { version, name, lidar, camera, mosaic, gnss, imu, trajectory, truth } = file;
        let mut lidars = match lidar {
            OneOrMore::One(lidar) => vec![*lidar],
            OneOrMore::More(lidars) => lidars,
        }
        .into_iter();
        let lidar = lidars.next().ok_or("lidar: expected at least one table")?;
        let other_lidars = lidars.collect();
        let cameras = camera;
        let mosaics = mosaic;
        Ok(Self { version, name, lidar, other_lidars, cameras, mosaics, gnss, imu, trajectory, truth })
    }
}

impl From<Manifest> for ManifestFile {
    fn from(manifest: Manifest) -> Self {
        let Manifest { version, name, lidar, other_lidars, cameras, mosaics, gnss, imu, trajectory, truth } = manifest;
        let lidar = if other_lidars.is_empty() {
            OneOrMore::One(Box::new(lidar))
        } else {
            OneOrMore::More([vec![lidar], other_lidars].concat())
        };
        Self { version, name, lidar, camera: cameras, mosaic: mosaics, gnss, imu, trajectory, truth }
    }
}
