//! The inferred manifest of a folder without `drive.toml`, or of a capture.

use super::listing::{captures, files_with_extension, files_with_name};
use super::read::Read;
use super::{Drive, DriveLidar, MANIFEST_FILE, Missing};
use crate::manifest::{LidarEntry, Manifest, PoseEntry};
use files::problems::{FileError, FileProblem};
use files::regular_file;
use formats::cloud::check_points;
use formats::kitti;
use lidar::pcap::{Compression, has_capture_magic, is_capture_name, sort_by_time};
use lidar::{Lidar, Model, SweepReader, velodyne};
use std::io;
use std::path::{Path, PathBuf};

/// Formats by file name extension.
const FORMATS: [&str; 4] = ["pcd", "bin", "pcap", "pcapng"];
/// Extensions of other recordings and clouds, which `replica import` reads.
const IMPORTED: [&str; 6] = ["bag", "mcap", "db3", "ply", "las", "laz"];
/// Files of unknown kind whose first bytes are read.
const MAX_UNKNOWN: usize = 64;

/// Files of one kind in a folder.
pub struct KindOfFiles {
    /// Extension: `pcd`, `bin`, `pcap` for all captures, or of a recording or cloud that `replica import` reads.
    pub extension: &'static str,
    /// The files, in natural order of their names.
    pub files: Vec<PathBuf>,
}

impl KindOfFiles {
    /// The kinds of sweeps, recordings and clouds in a folder.
    pub fn list(folder: &Path) -> io::Result<Vec<Self>> {
        let mut found = Vec::new();
        for extension in ["pcd", "bin", "pcap"].into_iter().chain(IMPORTED) {
            let files =
                if extension == "pcap" { captures(folder)? } else { files_with_extension(folder, &[extension])? };
            if !files.is_empty() {
                found.push(Self { extension, files });
            }
        }
        Ok(found)
    }

    /// Number, name of the first and size of the files.
    pub fn text(&self) -> String {
        let size: u64 = self.files.iter().filter_map(|path| path.metadata().ok()).map(|metadata| metadata.len()).sum();
        let first = self.files.first().and_then(|path| path.file_name()).unwrap_or_default().to_string_lossy();
        format!("{} *.{} (first: {first}; {size} bytes)", self.files.len(), self.extension)
    }

    /// Texts of several kinds.
    pub fn texts(kinds: &[Self]) -> String {
        kinds.iter().map(Self::text).collect::<Vec<_>>().join(", ")
    }
}

/// Files that begin as captures but have other names, of the first files of unknown kind.
pub fn unnamed_captures(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let is_unknown = |path: &Path| {
        let name = path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
        let is_known = FORMATS.iter().chain(&IMPORTED).any(|extension| name.ends_with(&format!(".{extension}")));
        !name.starts_with('.') && !is_known && !is_capture_name(path)
    };
    let unknown = files_with_name(folder, is_unknown)?;
    Ok(unknown.into_iter().take(MAX_UNKNOWN).filter(|path| has_capture_magic(path)).collect())
}

/// Fails if the first sweep of `*.bin` files is not in the layout of KITTI: rows of x y z intensity.
fn check_rows(path: &Path) -> Result<(), FileError> {
    let problem = |rule: String| FileError::from(FileProblem::for_file(path, rule));
    let hint = "without drive.toml, *.bin must be sweeps of KITTI; use `replica import` or write a drive.toml";
    if path.to_string_lossy().ends_with(".pcd.bin") {
        return Err(problem(format!("is a sweep of nuScenes; {hint}")));
    }
    let bytes = regular_file::read(path).map_err(|error| problem(error.to_string()))?;
    let points = kitti::points_from_bin(&bytes).map_err(|error| problem(format!("{error}; {hint}")))?;
    check_points(&points, 1.0).map_err(|error| problem(format!("{error}; {hint}")))
}

/// Infers a manifest from the files in a folder.
pub(super) fn read(folder: &Path) -> Result<Read, FileError> {
    let problem = |rule: String| FileError::from(FileProblem::for_file(folder, rule));
    let listed = |error: io::Error| problem(error.to_string());
    let mut kinds = KindOfFiles::list(folder).map_err(listed)?;
    let unnamed = unnamed_captures(folder).map_err(listed)?;
    if let Some(first) = unnamed.first() {
        return Err(problem(format!(
            "{} file(s) are captures by their first bytes, but not by their names, the first: {}; name them *.pcap",
            unnamed.len(),
            first.display()
        )));
    }
    let is_imported = |kind: &KindOfFiles| IMPORTED.contains(&kind.extension);
    if !kinds.is_empty() && kinds.iter().all(is_imported) {
        return Err(problem(format!(
            "contains neither {MANIFEST_FILE} nor *.{}, but {}: make a drive of them with `replica import`",
            FORMATS.join(", *."),
            KindOfFiles::texts(&kinds)
        )));
    }
    if kinds.len() > 1 {
        return Err(problem(format!(
            "has several kinds of recordings: {}; move each kind into its own folder, or write a {MANIFEST_FILE} that names \
             the format",
            KindOfFiles::texts(&kinds)
        )));
    }
    let Some(KindOfFiles { extension, mut files }) = kinds.pop() else {
        return Err(problem(format!("contains neither {MANIFEST_FILE} nor *.{}", FORMATS.join(", *."))));
    };
    if extension == "bin" {
        check_rows(&files[0])?;
    }
    let model = if extension == "pcap" {
        sort_by_time(&mut files).map_err(problem)?;
        model_of(files).map_err(problem)?
    } else {
        velodyne::Model::Hdl64e.into()
    };
    let manifest = manifest(folder, model, extension);
    Ok(Read::inferred(&folder.join(MANIFEST_FILE), manifest))
}

/// The drive that consists of one capture.
pub(super) fn drive_from_capture(file: &Path) -> Result<Drive, FileError> {
    let problem = |rule: String| FileError::from(FileProblem::for_file(file, rule));
    if let Some(compression) = Compression::find(file) {
        return Err(problem(compression.to_string()));
    }
    if !is_capture_name(file) && !has_capture_magic(file) {
        return Err(problem(format!(
            "is not a drive: a drive is a folder with {MANIFEST_FILE} or with files *.{}, or a capture *.pcap or *.pcapng",
            FORMATS.join(", *.")
        )));
    }
    let model = model_of(vec![file.to_owned()]).map_err(problem)?;
    let manifest = manifest(file, model, "pcap");
    let rig = manifest.rig().map_err(|error| problem(error.to_string()))?;
    Ok(Drive {
        folder: file.parent().unwrap_or(Path::new(".")).to_owned(),
        manifest,
        rig,
        first_lidar: DriveLidar {
            lidar: Lidar::from(model),
            format: "pcap".to_owned(),
            files: vec![file.to_owned()],
            stamps: Vec::new(),
            intensity_scale: None,
            map_origin: None,
            missing: Missing::default(),
        },
        other_lidars: Vec::new(),
        is_inferred: true,
        camera_frames: Vec::new(),
        mosaic_frames: Vec::new(),
        sensors: Vec::new(),
        unnamed_files: Vec::new(),
    })
}

/// The model whose packets the captures contain.
fn model_of(captures: Vec<PathBuf>) -> Result<Model, String> {
    SweepReader::open(captures, None).map(|reader| reader.model()).map_err(|error| error.to_string())
}

/// The manifest of a drive with only a LiDAR. The body frame is the lidar frame.
fn manifest(path: &Path, model: Model, format: &str) -> Manifest {
    let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    Manifest::with_lidar(&name, LidarEntry::new(model.name(), format, ".", PoseEntry::IDENTITY))
}
