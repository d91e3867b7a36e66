//! Labels of key frames: classes of nuScenes-lidarseg, instances of the boxes.

use super::boxes::{self, SweepBox};
use super::category::class_of_category;
use super::table;
use crate::error::{At, ImportError};
use crate::plan::{Conversion, Plan};
use drive::is_return;
use files::regular_file;
use formats::kitti::{Label, bytes_from_labels};
use formats::nuscenes::points_from_bin;
use geometry::{Point3, Pose};
use messages::ClassId;
use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::rc::Rc;

/// Folder of the labels in the drive.
const LABELS: &str = "truth/labels";

/// A sweep that may have labels.
pub(super) struct KeyFrame {
    /// Number of the sweep in the drive.
    pub seq: usize,
    pub sweep: PathBuf,
    pub data_token: String,
    pub sample_token: String,
    pub world_from_lidar: Pose,
}

#[derive(Deserialize)]
struct LidarSeg {
    sample_data_token: String,
    filename: String,
}

#[derive(Deserialize)]
struct IndexedCategory {
    name: String,
    index: u8,
}

/// Adds the labels of the key frames that have labels.
pub(super) fn add(plan: &mut Plan, source: &Path, tables: &Path, frames: Vec<KeyFrame>) -> Result<(), ImportError> {
    let segmented = segmented(source, tables, &frames)?;
    let has_boxes = tables.join("sample_annotation.json").is_file();
    let mut boxes = BTreeMap::new();
    if has_boxes {
        boxes = boxes::read(tables, &frames.iter().map(|frame| frame.sample_token.as_str()).collect())?;
        plan.read.extend(["sample_annotation.json", "instance.json", "category.json"].map(|name| tables.join(name)));
    }
    let classes = Rc::new(if segmented.is_empty() { BTreeMap::new() } else { classes(tables)? });
    if !segmented.is_empty() {
        plan.read.push(tables.join("lidarseg.json"));
    }
    let mut n_files = 0;
    let n_segmented = segmented.len();
    for frame in frames {
        let points = segmented.get(&frame.data_token).cloned();
        let found = boxes.get(&frame.sample_token);
        if points.is_none() && found.is_none() {
            continue;
        }
        let boxes: Vec<SweepBox> =
            found.into_iter().flatten().map(|found| found.in_sweep(&frame.world_from_lidar)).collect();
        let classes = classes.clone();
        let originals = points.iter().cloned().collect();
        plan.conversions.push(Conversion {
            place: Path::new(LABELS).join(format!("{:06}.label", frame.seq)),
            originals,
            content: Box::new(move || Ok(bytes(&frame.sweep, points.as_deref(), &classes, &boxes)?.into())),
        });
        n_files += 1;
    }
    if n_files == 0 {
        return Ok(());
    }
    if let Some(truth) = &mut plan.manifest.truth {
        truth.labels = Some(LABELS.to_owned());
    }
    let kind = match (n_segmented, has_boxes) {
        (0, _) => "instances of the boxes; points outside are unlabeled",
        (_, true) => "classes of lidarseg and instances of the boxes",
        (_, false) => "classes of lidarseg",
    };
    plan.report.push(format!("imported: labels of {n_files} key frames: {kind}; other sweeps have no labels"));
    Ok(())
}

/// Files of nuScenes-lidarseg by the tokens of their sweeps; empty without its table.
fn segmented(source: &Path, tables: &Path, frames: &[KeyFrame]) -> Result<BTreeMap<String, PathBuf>, ImportError> {
    let path = tables.join("lidarseg.json");
    let mut files = BTreeMap::new();
    if !path.is_file() {
        return Ok(files);
    }
    let wanted: BTreeSet<&str> = frames.iter().map(|frame| frame.data_token.as_str()).collect();
    table::each_row(&path, |row: LidarSeg| {
        if wanted.contains(row.sample_data_token.as_str()) {
            let file = table::file_inside(source, &row.filename)?;
            let file = file.canonicalize().map_err(|error| format!("{}: {error}", file.display()))?;
            files.insert(row.sample_data_token, file);
        }
        Ok(())
    })?;
    Ok(files)
}

/// Class of each number of a lidarseg file.
fn classes(tables: &Path) -> Result<BTreeMap<u8, ClassId>, ImportError> {
    let path = tables.join("category.json");
    let mut classes = BTreeMap::new();
    table::each_row(&path, |row: IndexedCategory| {
        classes.insert(row.index, class_of_category(&row.name)?);
        Ok(())
    })?;
    Ok(classes)
}

/// The label file of a sweep. The class of a point is the class of its segment, otherwise of its box; its instance is the
/// instance of a box with the same class.
fn bytes(
    sweep: &Path,
    segments: Option<&Path>,
    classes: &BTreeMap<u8, ClassId>,
    boxes: &[SweepBox],
) -> Result<Vec<u8>, ImportError> {
    let points = points_from_bin(&regular_file::read(sweep).at(sweep)?).at(sweep)?;
    let segments = segments.map(|path| Ok((path, regular_file::read(path).at(path)?))).transpose()?;
    if let Some((path, ids)) = segments.as_ref().filter(|(_, ids)| ids.len() != points.len()) {
        let rule = format!("{} labels, but {} has {} points", ids.len(), sweep.display(), points.len());
        return Err(ImportError::at(path, rule));
    }
    let mut labels = Vec::new();
    for (index, (point, _)) in points.iter().enumerate().filter(|(_, (point, _))| is_return(point)) {
        let position = Point3::new(f64::from(point.x), f64::from(point.y), f64::from(point.z));
        let class = match &segments {
            None => None,
            Some((path, ids)) => Some(*classes.get(&ids[index]).ok_or_else(|| {
                ImportError::at(path, format!("label {index} is {}, which category.json does not have", ids[index]))
            })?),
        };
        let is_of_box = |found: &&SweepBox| class.is_none_or(|class| class == found.class) && found.contains(&position);
        let found = boxes.iter().find(is_of_box);
        let class = class.or(found.map(|found| found.class)).unwrap_or(ClassId::Unlabeled);
        labels.push(Label { class: class as u16, instance: found.map_or(0, |found| found.instance) });
    }
    Ok(bytes_from_labels(&labels))
}
