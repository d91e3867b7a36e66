//! The layouts that are recognized.

use crate::clouds::Layout;
use crate::error::{At, ImportError};
use crate::files::files;
use crate::{boreas, mandeye, nuscenes, ros};
use drive::KindOfFiles;
use std::path::Path;

/// A layout.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Bag of ROS 1 (`*.bag`) or ROS 2 (`*.mcap`, `*.db3`, or the folder with `metadata.yaml`).
    Ros,
    /// KITTI raw: `velodyne_points/data/*.bin`, `velodyne_points/timestamps.txt`.
    KittiRaw,
    /// KITTI odometry: `velodyne/*.bin`, `times.txt`.
    KittiOdometry,
    /// `nuScenes`: `samples/LIDAR_TOP` and `sweeps/LIDAR_TOP`, or `*.pcd.bin`; rows of x y z intensity ring as f32.
    Nuscenes,
    /// `MandEye`: `lidar*.laz`, `imu*.csv`.
    Mandeye,
    /// Boreas: `lidar/*.bin`, `applanix`, `calib`; rows of x y z intensity laser time as f32.
    Boreas,
    /// Rows of x y z intensity as f32.
    Bin,
    /// Labeled clouds with positions of the scanner, of Paris-CARLA-3D.
    ParisCarla,
    /// Labeled clouds of Paris-Lille-3D.
    ParisLille,
    /// Labeled clouds of Toronto-3D.
    Toronto,
    /// Labeled clouds of `Street3D` as text.
    Street3d,
    /// Labeled clouds of Oakland 3-D as text.
    Oakland,
    /// Point clouds of PCL.
    Pcd,
    /// Point clouds of the Stanford format.
    Ply,
    /// Point clouds of ASPRS, also compressed: `*.las`, `*.laz`.
    Las,
}

impl Kind {
    /// All layouts, in the order in which they are recognized.
    pub const ALL: [Self; 15] = [
        Self::Ros,
        Self::KittiRaw,
        Self::KittiOdometry,
        Self::Nuscenes,
        Self::Mandeye,
        Self::Boreas,
        Self::ParisCarla,
        Self::ParisLille,
        Self::Toronto,
        Self::Bin,
        Self::Pcd,
        Self::Ply,
        Self::Las,
        Self::Street3d,
        Self::Oakland,
    ];

    /// Value of `--kind`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ros => "ros",
            Self::KittiRaw => "kitti-raw",
            Self::KittiOdometry => "kitti-odometry",
            Self::Nuscenes => "nuscenes",
            Self::Bin => "bin",
            Self::Pcd => "pcd",
            Self::Ply => "ply",
            Self::Las => "las",
            Self::Mandeye => "mandeye",
            Self::Boreas => "boreas",
            Self::ParisCarla => "paris-carla-3d",
            Self::ParisLille => "paris-lille-3d",
            Self::Toronto => "toronto-3d",
            Self::Street3d => "street3d",
            Self::Oakland => "oakland-3d",
        }
    }

    /// The layout of this name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }

    /// Name of the data set for messages.
    pub fn title(self) -> &'static str {
        match self {
            Self::Ros => "ROS bag",
            Self::KittiRaw => "KITTI raw",
            Self::KittiOdometry => "KITTI odometry",
            Self::Nuscenes => "nuScenes",
            Self::Mandeye => "MandEye",
            Self::Boreas => "Boreas",
            Self::Bin | Self::Pcd | Self::Ply | Self::Las => "bare sweeps",
            Self::ParisCarla => Layout::ParisCarla.title(),
            Self::ParisLille => Layout::ParisLille.title(),
            Self::Toronto => Layout::Toronto.title(),
            Self::Street3d => Layout::Street3d.title(),
            Self::Oakland => Layout::Oakland.title(),
        }
    }

    /// The layout of labeled clouds, which become a recording.
    pub(crate) fn clouds(self) -> Option<Layout> {
        match self {
            Self::ParisCarla => Some(Layout::ParisCarla),
            Self::ParisLille => Some(Layout::ParisLille),
            Self::Toronto => Some(Layout::Toronto),
            Self::Street3d => Some(Layout::Street3d),
            Self::Oakland => Some(Layout::Oakland),
            _ => None,
        }
    }

    /// File names or columns by which the layout is recognized.
    fn mark(self) -> &'static str {
        match self {
            Self::Ros => "a ROS bag",
            Self::KittiRaw => "velodyne_points/data",
            Self::KittiOdometry => "velodyne",
            Self::Nuscenes => "sweeps/LIDAR_TOP or *.pcd.bin",
            Self::Bin => "*.bin",
            Self::Pcd => "*.pcd",
            Self::Ply => "*.ply",
            Self::Las => "*.las or *.laz",
            Self::Mandeye => "lidar*.laz",
            Self::Boreas => "lidar with applanix or calib/T_applanix_lidar.txt",
            Self::ParisCarla => "*.ply with x_lidar_position and semantic",
            Self::ParisLille => "*.ply with reflectance and class",
            Self::Toronto => "*.ply with scalar_Label",
            Self::Street3d => "*.txt with points and classes",
            Self::Oakland => "*.xyz_label_conf",
        }
    }

    /// Whether a source has this layout.
    pub fn fits(self, source: &Path) -> Result<bool, ImportError> {
        let has = |end: &str| files(source, end).map(|files| !files.is_empty());
        Ok(match self {
            Self::Ros => ros::is_bag(source),
            Self::KittiRaw => source.join("velodyne_points/data").is_dir(),
            Self::KittiOdometry => source.join("velodyne").is_dir(),
            Self::Nuscenes => nuscenes::lidar_folders(source).next().is_some() || has(".pcd.bin")?,
            Self::Bin => has(".bin")?,
            Self::Pcd => has(".pcd")?,
            Self::Ply => has(".ply")?,
            Self::Las => has(".las")? || has(".laz")?,
            Self::Mandeye => !mandeye::lidar_files(source)?.is_empty(),
            Self::Boreas => boreas::is_sequence(source),
            Self::ParisCarla | Self::ParisLille | Self::Toronto | Self::Street3d | Self::Oakland => {
                self.clouds().map_or(Ok(false), |layout| layout.fits(source))?
            }
        })
    }

    /// The layout of a source.
    pub fn recognize(source: &Path) -> Result<Self, ImportError> {
        source.metadata().at(source)?;
        for kind in Self::ALL {
            if kind.fits(source)? {
                kind.check_alone(source)?;
                return Ok(kind);
            }
        }
        let found = if source.is_dir() { KindOfFiles::list(source).at(source)? } else { Vec::new() };
        if let Some(rule) = next_step(source, &found) {
            return Err(ImportError::at(source, rule));
        }
        let marks = Self::ALL.map(Self::mark).join(", ");
        let found = if found.is_empty() { String::new() } else { format!("; found {}", KindOfFiles::texts(&found)) };
        Err(ImportError::at(source, format!("no known layout; must contain one of {marks}{found}")))
    }

    /// Fails if the folder of a layout that is recognized by the kind of its files also contains other recordings or clouds.
    fn check_alone(self, source: &Path) -> Result<(), ImportError> {
        let has_own_names =
            matches!(self, Self::KittiRaw | Self::KittiOdometry | Self::Nuscenes | Self::Mandeye | Self::Boreas);
        if has_own_names || !source.is_dir() {
            return Ok(());
        }
        let found = KindOfFiles::list(source).at(source)?;
        let is_las = |kind: &KindOfFiles| matches!(kind.extension, "las" | "laz");
        if found.len() < 2 || found.iter().all(is_las) {
            return Ok(());
        }
        let rule = format!(
            "has several kinds of recordings: {}; import each from a folder of its own, or choose one with --kind, which leaves \
             out the others",
            KindOfFiles::texts(&found)
        );
        Err(ImportError::at(source, rule))
    }
}

/// What to do with a folder of recordings of one kind that is not a layout; `None` if the layouts are the answer.
fn next_step(source: &Path, found: &[KindOfFiles]) -> Option<String> {
    let [kind] = found else { return None };
    let path = kind.files.first()?.display();
    let files = kind.text();
    match kind.extension {
        "mcap" | "db3" if kind.files.len() == 1 => Some(format!(
            "has {files} without metadata.yaml, so it is not the folder of a ROS 2 bag: import the file itself, {path}, or write \
             metadata.yaml with `ros2 bag reindex`"
        )),
        "mcap" | "db3" => Some(format!(
            "has {files} without metadata.yaml, which states whether they are parts of one recording: write it with `ros2 bag reindex`, \
             or import each file, as {path}"
        )),
        "bag" => Some(format!(
            "has {files}, which is not a bag of ROS 1: import the folder of its metadata.yaml, or record it again"
        )),
        "pcap" => Some(format!(
            "has {files}: captures need no import; set run.drive = \"{}\", and write a drive.toml there for the mounting (`replica rig new`)",
            source.display()
        )),
        _ => None,
    }
}
