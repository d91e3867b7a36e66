//! The layouts of labeled clouds, as published.

use super::classes::class_of;
use crate::error::{At, ImportError};
use crate::files::{files, stem};
use formats::ply::{Header, Kind, PlyRows};
use messages::ClassId;
use std::path::{Path, PathBuf};

/// A layout.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Layout {
    /// Paris-CARLA-3D: PLY with positions of the scanner, times, classes and instances.
    ParisCarla,
    /// Paris-Lille-3D: PLY; the complete data set has positions and times, the benchmark has neither.
    ParisLille,
    /// Toronto-3D: PLY of `CloudCompare`.
    Toronto,
    /// `Street3D` of SHREC 2020: text, x y z first and the class last.
    Street3d,
    /// Oakland 3-D Point Cloud Dataset: text of x y z label confidence, also compressed by gzip.
    Oakland,
}

/// Names of the columns of a PLY file.
struct Names {
    scanner: [&'static str; 3],
    time: &'static str,
    class: &'static str,
    instance: &'static str,
    intensity: &'static str,
    cosine: &'static str,
}

/// Names of the color columns in all layouts with colors; other types than `uchar` are not imported.
const COLORS: [&str; 3] = ["red", "green", "blue"];
/// Name of a column that the layout does not have.
const NONE: &str = "";

impl Layout {
    /// Name of the data set.
    pub fn title(self) -> &'static str {
        match self {
            Self::ParisCarla => "Paris-CARLA-3D",
            Self::ParisLille => "Paris-Lille-3D",
            Self::Toronto => "Toronto-3D",
            Self::Street3d => "Street3D",
            Self::Oakland => "Oakland 3-D",
        }
    }

    fn names(self) -> Names {
        match self {
            Self::ParisCarla => Names {
                scanner: ["x_lidar_position", "y_lidar_position", "z_lidar_position"],
                time: "timestamp",
                class: "semantic",
                instance: "instance",
                intensity: "intensity",
                cosine: "cos_angle_lidar_surface",
            },
            Self::ParisLille => Names {
                scanner: ["x_origin", "y_origin", "z_origin"],
                time: "GPS_time",
                class: "class",
                instance: "label",
                intensity: "reflectance",
                cosine: NONE,
            },
            // Its times are rounded to 0.03 s, and it has no positions to which they could belong.
            Self::Toronto => Names {
                scanner: [NONE; 3],
                time: NONE,
                class: "scalar_Label",
                instance: NONE,
                intensity: "scalar_Intensity",
                cosine: NONE,
            },
            Self::Street3d | Self::Oakland => {
                Names { scanner: [NONE; 3], time: NONE, class: NONE, instance: NONE, intensity: NONE, cosine: NONE }
            }
        }
    }

    /// The clouds of a source: the file itself, or the files of a folder, sorted by name.
    pub fn files(self, source: &Path) -> Result<Vec<PathBuf>, ImportError> {
        if source.is_file() {
            return Ok(vec![source.to_owned()]);
        }
        let is_cloud = |(_, path): &(String, PathBuf)| self != Self::Street3d || is_street3d(path);
        let mut found = Vec::new();
        for end in self.ends() {
            found.extend(files(source, end)?.into_iter().filter(is_cloud).map(|(_, path)| path));
        }
        Ok(found)
    }

    /// Ends of the names of its files, in any letter case.
    fn ends(self) -> &'static [&'static str] {
        match self {
            Self::ParisCarla | Self::ParisLille | Self::Toronto => &[".ply"],
            Self::Street3d => &[".txt"],
            Self::Oakland => &[".xyz_label_conf", ".xyz_label_conf.gz"],
        }
    }

    /// Whether its files are text without names of the columns.
    pub fn is_text(self) -> bool {
        matches!(self, Self::Street3d | Self::Oakland)
    }

    /// Whether the first cloud of the source has the columns of this layout.
    pub fn fits(self, source: &Path) -> Result<bool, ImportError> {
        let name = source.file_name().unwrap_or_default().to_string_lossy();
        let has_end = |end: &&str| stem(&name, end).is_some();
        if source.is_file() && !self.ends().iter().any(has_end) {
            return Ok(false);
        }
        let Some(first) = self.files(source)?.into_iter().next() else { return Ok(false) };
        match self {
            Self::Street3d => return Ok(is_street3d(&first)),
            // Only this data set has this end.
            Self::Oakland => return Ok(true),
            Self::ParisCarla | Self::ParisLille | Self::Toronto => {}
        }
        // Any other file is not a cloud of this layout; unreadable sweeps are reported as such.
        let Ok(rows) = PlyRows::open(&first) else { return Ok(false) };
        let names = self.names();
        let has = |name: &str| column(rows.header(), name).is_some();
        let mark = match self {
            Self::ParisCarla => names.scanner[0],
            _ => names.intensity,
        };
        Ok(has(names.class) && has(mark))
    }
}

/// Whether a text begins as a cloud of `Street3D`: two lines of numbers, at least x y z and a class from 0 to 5.
fn is_street3d(path: &Path) -> bool {
    super::text_points::begins_as_cloud(path)
}

/// Positions of the values of a point in a file.
#[derive(Clone, Debug)]
pub(super) struct Columns {
    pub layout: Layout,
    pub position: [usize; 3],
    pub scanner: Option<[usize; 3]>,
    pub time: Option<usize>,
    pub class: usize,
    pub instance: Option<usize>,
    pub intensity: Option<usize>,
    pub cosine: Option<usize>,
    /// Red, green, blue.
    pub color: Option<[usize; 3]>,
    /// Names of the columns that are not imported.
    pub left: Vec<String>,
}

impl Columns {
    /// The columns of a file.
    pub fn from_layout(layout: Layout, file: &Path) -> Result<Self, ImportError> {
        if layout.is_text() {
            let position = [0, 1, 2];
            let scanner = None;
            // `Street3D` has the class in its last column; in Oakland a confidence follows it.
            let class = if layout == Layout::Oakland { 3 } else { usize::MAX };
            return Ok(Self {
                layout,
                position,
                scanner,
                time: None,
                class,
                instance: None,
                intensity: None,
                cosine: None,
                color: None,
                left: Vec::new(),
            });
        }
        let rows = PlyRows::open(file).at(file)?;
        let names = layout.names();
        let needed = |name: &str| {
            let found = column(rows.header(), name);
            found.ok_or_else(|| ImportError::at(file, format!("has no column {name}, which {} has", layout.title())))
        };
        let optional = |name: &str| column(rows.header(), name);
        let scanner: Vec<usize> = names.scanner.iter().filter_map(|name| optional(name)).collect();
        let scanner: Option<[usize; 3]> = scanner.try_into().ok();
        let is_byte = |at: &usize| rows.header().properties[*at].kind == Kind::UChar;
        let color: Vec<usize> = COLORS.iter().filter_map(|name| optional(name).filter(is_byte)).collect();
        let time = optional(names.time).filter(|_| scanner.is_some());
        let mut columns = Self {
            layout,
            position: [needed("x")?, needed("y")?, needed("z")?],
            scanner: scanner.filter(|_| time.is_some()),
            time,
            class: needed(names.class)?,
            instance: optional(names.instance),
            intensity: optional(names.intensity),
            cosine: optional(names.cosine),
            color: color.try_into().ok(),
            left: Vec::new(),
        };
        let single = [columns.time, columns.instance, columns.intensity, columns.cosine].into_iter().flatten();
        let triples = [Some(columns.position), columns.scanner, columns.color].into_iter().flatten().flatten();
        let taken: Vec<usize> = single.chain(triples).chain([columns.class]).collect();
        let properties = rows.header().properties.iter().enumerate();
        columns.left =
            properties.filter(|(at, _)| !taken.contains(at)).map(|(_, property)| property.name.clone()).collect();
        Ok(columns)
    }

    /// Whether positions of the scanner and times are known.
    pub fn has_positions(&self) -> bool {
        self.scanner.is_some()
    }

    pub fn has_instances(&self) -> bool {
        self.instance.is_some()
    }

    pub fn has_colors(&self) -> bool {
        self.color.is_some()
    }

    /// The class of an id of the file; `None` if the data set does not define the id.
    pub fn class_of(&self, id: i64) -> Option<ClassId> {
        class_of(self.layout, id)
    }
}

/// Number of a column.
fn column(header: &Header, name: &str) -> Option<usize> {
    header.properties.iter().position(|property| property.name == name)
}
